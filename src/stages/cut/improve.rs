//! Improves a solution by ruin and recreate (Schrimpf et al. 2000): the seams inside a piece or between two pieces are
//! glued and searched anew with another weight; what is cheaper stays.
use super::{CutError, piece::Piece, search::Search};
use crate::{
    mesh::{EdgeId, FaceId},
    numeric::random::Random,
    surface::cut_graph::cut_to_disks,
};

/// The search ends after so many trials at the latest: pieces of a few faces hardly count as effort.
const TRIALS: usize = 400;
/// Pieces with more than this share of all faces together are left as they are: small ones are cut anew many times for the
/// effort of once.
const LARGEST: f64 = 0.2;
/// Of so few pieces every pair is cut anew.
const FEW: usize = 6;
/// How much creases attract seams, in turn.
const ATTRACTIONS: [f64; 4] = [2.0, 0.5, 4.0, 1.0];
/// Peaks of stretch relieved at a time, in turn.
const PEAKS: [usize; 3] = [1, 8, 3];

/// Pieces taken out to be cut anew.
pub(super) struct Lifted {
    /// Pieces made since have this number or a higher one.
    pub(super) first: u32,
    pub(super) pieces: Vec<(u32, Piece)>,
    /// Their faces, ascending.
    pub(super) faces: Vec<FaceId>,
    /// The edges inside them and between them.
    pub(super) inner: Vec<EdgeId>,
    /// Those of them that were cut.
    pub(super) seams: Vec<EdgeId>,
}

impl Search<'_> {
    /// Goes on until `limit` faces have been judged.
    pub(super) fn improve(&mut self, limit: usize) -> Result<(), CutError> {
        let mut random = Random::new(0);
        let before = self.judged;
        for trial in 0..TRIALS {
            self.monitor.check()?;
            let done = (self.judged - before) as f64 / limit.saturating_sub(before).max(1) as f64;
            self.monitor.progress(0.5 + 0.5 * done.max(trial as f64 / TRIALS as f64), "shortening seams");
            let seams = self.seams();
            if self.judged >= limit || seams.is_empty() {
                break;
            }
            let [p, q] = self.sides(seams[random.below(seams.len())]);
            let faces = |id: u32| self.pieces[id as usize].as_ref().map_or(0, |it| it.chart.faces.len());
            let size = faces(p) + if p == q { 0 } else { faces(q) };
            if size as f64 > LARGEST * self.mesh.face_count() as f64 && self.pieces.iter().flatten().count() > FEW {
                continue;
            }
            self.attract(ATTRACTIONS[random.below(ATTRACTIONS.len())]);
            self.peaks = PEAKS[random.below(PEAKS.len())];
            self.recreate(p, q)?;
        }
        Ok(())
    }

    /// Cuts pieces `p` and `q` (or only one, when they are the same) anew; keeps what is cheaper.
    fn recreate(&mut self, p: u32, q: u32) -> Result<(), CutError> {
        let lifted = self.lift(if p == q { vec![p] } else { vec![p, q] });
        cut_to_disks(self.mesh, &lifted.faces, &self.weight, &self.curvature, &[], &mut self.cut, self.monitor)?;
        self.settle(&lifted.faces)?;
        self.join(lifted.first)?;
        let made = || self.pieces[lifted.first as usize..].iter().flatten();
        let found: Vec<EdgeId> = lifted.inner.iter().copied().filter(|&e| self.cut[e]).collect();
        let before = self.length(&lifted.seams) + self.price(lifted.pieces.iter().map(|it| &it.1));
        let after = self.length(&found) + self.price(made());
        let none_worse = made().all(Piece::is_good) || lifted.pieces.iter().any(|it| !it.1.is_good());
        if !(none_worse && after < (1.0 - 1e-9) * before) {
            self.put_back(lifted);
        }
        Ok(())
    }

    /// Takes pieces out and glues all seams inside them and between them that the user did not ask for.
    pub(super) fn lift(&mut self, ids: Vec<u32>) -> Lifted {
        let first = self.pieces.len() as u32;
        let take = |id: u32| (id, self.pieces[id as usize].take().expect("every face lies in a piece that lives"));
        let pieces: Vec<(u32, Piece)> = ids.into_iter().map(take).collect();
        let mut faces: Vec<FaceId> = pieces.iter().flat_map(|it| it.1.chart.faces.iter().copied()).collect();
        faces.sort_unstable();
        let inner = self.inner_edges(&faces);
        let seams: Vec<EdgeId> = inner.iter().copied().filter(|&e| self.cut[e]).collect();
        for &e in seams.iter().filter(|&&e| !self.kept[e]) {
            self.cut[e] = false;
        }
        Lifted { first, pieces, faces, inner, seams }
    }

    /// Puts pieces back as they were, in place of what was made since.
    pub(super) fn put_back(&mut self, lifted: Lifted) {
        self.set_cut(&lifted.inner, &lifted.seams);
        self.pieces[lifted.first as usize..].fill_with(|| None);
        for (id, piece) in lifted.pieces {
            for &f in &piece.chart.faces {
                self.piece_of[f] = id;
            }
            self.pieces[id as usize] = Some(piece);
        }
    }

    /// Of the edges `inner` cuts just `seams`, and those that the user asked for.
    pub(super) fn set_cut(&mut self, inner: &[EdgeId], seams: &[EdgeId]) {
        for &e in inner {
            self.cut[e] = self.kept[e];
        }
        for &e in seams {
            self.cut[e] = true;
        }
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
