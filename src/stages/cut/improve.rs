//! Improves a solution by ruin and recreate (Schrimpf et al. 2000): the seams inside a piece or between two pieces are
//! glued and searched anew with another weight; what is cheaper stays.
use super::{CutError, search::Search};
use crate::{
    mesh::{EdgeId, FaceId},
    numeric::random::Random,
    surface::cut_graph::cut_to_disks,
};

/// The search ends when it has judged so many times the faces of the mesh …
const EFFORT: usize = 60;
/// … or after so many trials: pieces of a few faces hardly count.
const TRIALS: usize = 400;
/// How much creases attract seams, in turn.
const ATTRACTIONS: [f64; 4] = [2.0, 0.5, 4.0, 1.0];
/// Peaks of stretch relieved at a time, in turn.
const PEAKS: [usize; 3] = [1, 8, 3];

impl Search<'_> {
    /// Goes on until the effort is spent.
    pub(super) fn improve(&mut self) -> Result<(), CutError> {
        let mut random = Random::new(0);
        let limit = self.judged + EFFORT * self.mesh.face_count();
        let before = self.judged;
        for trial in 0..TRIALS {
            self.monitor.check()?;
            let done = (self.judged - before) as f64 / (limit - before) as f64;
            self.monitor.progress(0.5 + 0.5 * done.max(trial as f64 / TRIALS as f64), "shortening seams");
            let seams: Vec<EdgeId> =
                self.mesh.edges().filter(|&e| self.cut[e] && !self.mesh.is_boundary_edge(e)).collect();
            if self.judged >= limit || seams.is_empty() {
                break;
            }
            let [p, q] = self.sides(seams[random.below(seams.len())]);
            self.attract(ATTRACTIONS[random.below(ATTRACTIONS.len())]);
            self.peaks = PEAKS[random.below(PEAKS.len())];
            self.recreate(p, q)?;
        }
        Ok(())
    }

    /// Cuts pieces `p` and `q` (or only one, when they are the same) anew; keeps what is cheaper.
    fn recreate(&mut self, p: u32, q: u32) -> Result<(), CutError> {
        let first = self.pieces.len() as u32;
        let mut old = Vec::new();
        for id in if p == q { vec![p] } else { vec![p, q] } {
            old.push((id, self.pieces[id as usize].take().expect("every face lies in a piece that lives")));
        }
        let mut faces: Vec<FaceId> = old.iter().flat_map(|it| it.1.chart.faces.iter().copied()).collect();
        faces.sort_unstable();
        let inner: Vec<EdgeId> = self.inner_edges(&faces);
        let seams: Vec<EdgeId> = inner.iter().copied().filter(|&e| self.cut[e]).collect();
        let cost = self.length(&seams) + self.new_piece * old.len() as f64;
        for &e in &seams {
            self.cut[e] = false;
        }
        cut_to_disks(self.mesh, &faces, &self.weight, &self.curvature, &[], &mut self.cut, self.monitor)?;
        self.settle(&faces)?;
        self.join(first)?;
        let found: Vec<EdgeId> = inner.iter().copied().filter(|&e| self.cut[e]).collect();
        let made = || self.pieces[first as usize..].iter().flatten();
        let better = self.length(&found) + self.new_piece * made().count() as f64;
        if better < (1.0 - 1e-9) * cost && (made().all(|it| it.is_good()) || old.iter().any(|it| !it.1.is_good())) {
            return Ok(());
        }
        for &e in &inner {
            self.cut[e] = false;
        }
        for &e in &seams {
            self.cut[e] = true;
        }
        self.pieces.truncate(first as usize);
        for (id, piece) in old {
            for &f in &piece.chart.faces {
                self.piece_of[f] = id;
            }
            self.pieces[id as usize] = Some(piece);
        }
        Ok(())
    }

    /// Edges with a face of `faces` (ascending) on both sides.
    fn inner_edges(&self, faces: &[FaceId]) -> Vec<EdgeId> {
        let mesh = self.mesh;
        let inside = |h| mesh.twin(h).is_some_and(|twin| faces.binary_search(&mesh.face(twin)).is_ok());
        let sides = faces.iter().flat_map(|&f| mesh.face_halfedges(f));
        let mut out: Vec<EdgeId> =
            sides.filter(|&h| mesh.halfedge(mesh.edge(h)) == h && inside(h)).map(|h| mesh.edge(h)).collect();
        out.sort_unstable();
        out
    }
}
