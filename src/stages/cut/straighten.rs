//! Seams between two pieces take short cuts.
use super::{CutError, piece::Piece, search::Search};
use crate::{
    mesh::{EdgeId, FaceId, HalfedgeId, VertexId},
    surface::{
        cut_graph::arcs,
        paths::{EdgeGraph, PathTree},
    },
};

/// A short cut that saves less than this share is not worth the trial.
const LEAST_SAVING: f64 = 0.02;
/// How often a seam is halved in search of a part that has a short cut.
const HALVINGS: usize = 3;

impl Search<'_> {
    /// Tries the shortest way between the ends of every seam between two pieces, of its halves, their halves and so on,
    /// until `limit` faces have been judged.
    pub(super) fn straighten(&mut self, limit: usize) -> Result<(), CutError> {
        for arc in arcs(self.mesh, &self.cut) {
            let mut parts: Vec<Vec<EdgeId>> = vec![arc];
            for _ in 0..=HALVINGS {
                let mut next = Vec::new();
                for part in parts {
                    self.monitor.check()?;
                    if self.judged >= limit {
                        return Ok(());
                    }
                    if part.len() > 1 && !self.shorten(&part)? {
                        let (a, b) = part.split_at(part.len() / 2);
                        next.extend([a.to_vec(), b.to_vec()]);
                    }
                }
                parts = next;
            }
        }
        Ok(())
    }

    /// Replaces a part of a seam by the shortest way between its ends through both pieces, if that is shorter and keeps
    /// them good.
    fn shorten(&mut self, part: &[EdgeId]) -> Result<bool, CutError> {
        let [p, q] = self.sides(part[0]);
        if p == q || part.iter().any(|&e| !self.cut[e] || self.kept[e]) {
            return Ok(false);
        }
        let live = |id: u32| self.pieces[id as usize].as_ref().expect("every face lies in a piece that lives");
        let mut faces: Vec<FaceId> = live(p).chart.faces.clone();
        faces.extend(&live(q).chart.faces);
        part.iter().for_each(|&e| self.cut[e] = false);
        let chart = self.builder.chart(faces, &|e| self.cut[e]);
        part.iter().for_each(|&e| self.cut[e] = true);
        let graph = EdgeGraph::new(self.mesh, &chart, &self.toll);
        let tail = |h: HalfedgeId| {
            let k = chart.faces.binary_search(&self.mesh.face(h)).expect("the part lies between faces of the chart");
            chart.corners[k][h.0 as usize % 3]
        };
        // The end of the part that is not shared with the next edge, and the one at its other end.
        let [from, to] = [(0, 1), (part.len() - 1, part.len() - 2)].map(|(end, beside)| {
            let h = self.mesh.halfedge(part[end]);
            let shared = self.mesh.edge_vertices(part[beside]);
            if shared.contains(&self.mesh.tail(h)) { tail(self.mesh.next(h)) } else { tail(h) }
        });
        let before = self.length(part);
        let enough = (1.0 - LEAST_SAVING) * before;
        // A way along the boundary would take from one piece what it is joined by.
        let tree = PathTree::new(&graph, &[(from, 0.0)], |v, length| {
            if v == to || length > enough {
                return None;
            }
            Some(v == from || !chart.on_boundary[v as usize])
        });
        if !(tree.distance[to as usize] < enough) || from == to {
            return Ok(false);
        }
        let path: Vec<EdgeId> = tree.path(to).into_iter().map(|h| self.mesh.edge(h)).collect();
        let passes = |v: VertexId| path.iter().any(|&e| self.mesh.edge_vertices(e).contains(&v));
        let inside = part.windows(2).flat_map(|pair| self.mesh.edge_vertices(pair[0]));
        if inside.into_iter().any(|v| self.must_cut[v] && !passes(v)) {
            return Ok(false);
        }
        let lifted = self.lift(vec![p, q]);
        let mut seams: Vec<EdgeId> = lifted.seams.iter().copied().filter(|e| !part.contains(e)).collect();
        seams.extend(&path);
        self.set_cut(&lifted.inner, &seams);
        for faces in self.builder.components(&lifted.faces, &|e| self.cut[e]) {
            let piece = self.judge(faces)?;
            let good = piece.is_good();
            self.insert(piece);
            if !good {
                break;
            }
        }
        let made = || self.pieces[lifted.first as usize..].iter().flatten();
        let after = self.length(&path) + self.price(made());
        let old = before + self.price(lifted.pieces.iter().map(|it| &it.1));
        if made().all(Piece::is_good) && after < old {
            return Ok(true);
        }
        self.put_back(lifted);
        Ok(false)
    }
}
