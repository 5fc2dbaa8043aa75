//! Glues seams again where the pieces stay within the limit and flat.
use super::{CutError, search::Search};
use crate::{mesh::EdgeId, surface::cut_graph::arcs};

/// Passes over all seams at most; a pass ends the search when nothing was glued.
const PASSES: usize = 6;

impl Search<'_> {
    /// Tries to glue every arc of the cut, longest first, whole or in parts.
    pub(super) fn join(&mut self) -> Result<(), CutError> {
        for _ in 0..PASSES {
            let mut runs: Vec<Vec<EdgeId>> =
                arcs(self.mesh, &self.cut).into_iter().flat_map(|arc| self.gluable_runs(arc)).collect();
            let length = |run: &[EdgeId]| run.iter().map(|&e| self.mesh.edge_length(e)).sum::<f64>();
            runs.sort_by(|a, b| length(b).total_cmp(&length(a)).then_with(|| a.cmp(b)));
            let mut glued = false;
            for run in runs {
                self.monitor.check()?;
                glued |= self.try_glue(&run)?;
            }
            if !glued {
                break;
            }
        }
        Ok(())
    }

    /// The parts of an arc between vertices that must lie on a cut.
    fn gluable_runs(&self, arc: Vec<EdgeId>) -> Vec<Vec<EdgeId>> {
        let mut out = Vec::new();
        let mut run: Vec<EdgeId> = Vec::new();
        for e in arc {
            if let Some(&before) = run.last() {
                let [a, b] = self.mesh.edge_vertices(e);
                let shared = if self.mesh.edge_vertices(before).contains(&a) { a } else { b };
                if self.must_cut[shared] || self.mesh.is_boundary_vertex(shared) {
                    out.push(std::mem::take(&mut run));
                }
            }
            run.push(e);
        }
        out.push(run);
        out
    }

    fn try_glue(&mut self, run: &[EdgeId]) -> Result<bool, CutError> {
        if run.iter().any(|&e| !self.cut[e] || self.mesh.is_boundary_edge(e)) {
            return Ok(false);
        }
        let h = self.mesh.halfedge(run[0]);
        let twin = self.mesh.twin(h).expect("inner edges have two sides");
        let (p, q) = (self.piece_of[self.mesh.face(h)], self.piece_of[self.mesh.face(twin)]);
        let live = |id: u32| self.pieces[id as usize].as_ref().expect("every face lies in a piece that lives");
        let mut faces = live(p).chart.faces.clone();
        if p != q {
            faces.extend(&live(q).chart.faces);
        }
        let closed = p == q && {
            let slits = live(p).closed_slits(self.mesh, self.options.clearance);
            run.iter().all(|e| slits.contains(e))
        };
        for &e in run {
            self.cut[e] = false;
        }
        let chart = self.builder.chart(faces, &|e| self.cut[e]);
        if chart.is_disk() || (closed && chart.is_planar()) {
            let piece = self.judge(chart.faces)?;
            if piece.is_good() {
                self.remove(p);
                self.remove(q);
                self.insert(piece);
                return Ok(true);
            }
        }
        for &e in run {
            self.cut[e] = true;
        }
        Ok(false)
    }
}
