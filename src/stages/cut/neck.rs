//! Pieces that hang together by too little are divided there.
use super::{CutError, divide::dividing_path, piece::Piece, search::Search};
use crate::{geom::neck::Neck, mesh::EdgeId};

/// Edges taken of the outline on each side of a neck: that a path parts all pairs of them says that it runs through the
/// neck.
const EDGES: usize = 12;

impl Search<'_> {
    /// Divides pieces at their narrowest necks as long as that is cheaper, and glues what can be glued again.
    pub(super) fn part_at_necks(&mut self) -> Result<(), CutError> {
        let mut parted = false;
        let mut id = 0;
        // What is made on the way has a higher number and its turn.
        while id < self.pieces.len() {
            self.monitor.check()?;
            parted |= self.part_at_neck(id as u32)?;
            id += 1;
        }
        if parted { self.join(0) } else { Ok(()) }
    }

    /// Divides a piece at the narrowest neck where that is cheaper; whether there is one.
    fn part_at_neck(&mut self, id: u32) -> Result<bool, CutError> {
        for k in 0.. {
            let Some(piece) = &self.pieces[id as usize] else { break };
            let Some(neck) = piece.necks.iter().rev().nth(k) else { break };
            // Only an outline without holes is divided by one path.
            let pairs = if piece.chart.is_disk() { across(neck, piece.contours[0].len()) } else { Vec::new() };
            let it = (piece, &pairs[..]);
            let path = dividing_path(self.mesh, it, &self.toll, self.new_piece, self.options.min_area);
            if let Some(path) = path
                && self.divide(id, &path)?
            {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Cuts a piece along `path` as well; whether that is cheaper. Else all stays.
    fn divide(&mut self, id: u32, path: &[EdgeId]) -> Result<bool, CutError> {
        let lifted = self.lift(vec![id]);
        let mut seams = lifted.seams.clone();
        seams.extend(path);
        self.set_cut(&lifted.inner, &seams);
        for faces in self.builder.components(&lifted.faces, &|e| self.cut[e]) {
            let piece = self.judge(faces)?;
            self.insert(piece);
        }
        let made = || self.pieces[lifted.first as usize..].iter().flatten();
        let before = self.price(lifted.pieces.iter().map(|it| &it.1));
        let cheaper = self.length(path) + self.price(made()) < before;
        if cheaper && made().all(Piece::is_good) {
            return Ok(true);
        }
        self.put_back(lifted);
        Ok(false)
    }
}

/// Pairs of edges of an outline of `n` edges from both sides of a neck, spread evenly.
fn across(neck: &Neck, n: usize) -> Vec<(usize, usize)> {
    let [a, b] = neck.edges;
    let spread = |from: usize, count: usize| {
        let taken = count.min(EDGES);
        (0..taken).map(move |k| (from + (2 * k + 1) * count / (2 * taken)) % n)
    };
    spread(a, b - a).flat_map(|i| spread(b, n + a - b).map(move |j| (i.min(j), i.max(j)))).collect()
}
