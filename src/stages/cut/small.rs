//! Pieces under the useful size grow into their neighbours.
use super::{CutError, search::Search};
use crate::{
    mesh::{EdgeId, FaceId},
    surface::paths::{EdgeGraph, PathTree},
};

/// Sizes tried, in units of the least useful area: where the least does not lie flat or leaves something small, a larger one may not.
const SIZES: [f64; 3] = [1.02, 1.5, 2.5];

impl Search<'_> {
    /// Gives every piece under the useful size the nearest faces of a neighbour, with the shortest seams for which all
    /// that is made lies flat. Pieces for which that is not possible stay.
    pub(super) fn enlarge(&mut self) -> Result<(), CutError> {
        let small: Vec<u32> = (0..self.pieces.len() as u32).filter(|&id| self.small(id)).collect();
        for id in small {
            // An earlier one may have taken it in.
            if !self.small(id) {
                continue;
            }
            let mut ways = Vec::new();
            for q in self.neighbours(id) {
                self.ways_to_grow(id, q, &mut ways);
            }
            ways.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (_, q, seams) in ways {
                self.monitor.check()?;
                if self.grow(id, q, &seams)? {
                    break;
                }
            }
        }
        Ok(())
    }

    fn small(&self, id: u32) -> bool {
        self.pieces[id as usize].as_ref().is_some_and(|it| self.is_small(it))
    }

    /// The pieces on the other side of its seams, ascending.
    fn neighbours(&self, id: u32) -> Vec<u32> {
        let loops = self.pieces[id as usize].iter().flat_map(|it| it.chart.loops.iter().flatten());
        let others = loops.filter_map(|it| self.mesh.twin(it.0)).map(|twin| self.piece_of[self.mesh.face(twin)]);
        let mut out: Vec<u32> = others.filter(|&it| it != id).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Adds the ways in which `small` can take from `large`: how much longer the seams get, `large`, and the cut edges
    /// inside both then.
    fn ways_to_grow(&mut self, small: u32, large: u32, ways: &mut Vec<(f64, u32, Vec<EdgeId>)>) {
        let lifted = self.lift(vec![small, large]);
        let area = [0, 1].map(|k: usize| lifted.pieces[k].1.area);
        let chart = self.builder.chart(lifted.faces.clone(), &|e| self.cut[e]);
        let graph = EdgeGraph::new(self.mesh, &chart, &self.weight);
        let inside = |k: usize| self.piece_of[chart.faces[k]] == small;
        let starts: Vec<(u32, f64)> =
            (0..chart.faces.len()).filter(|&k| inside(k)).flat_map(|k| chart.corners[k]).map(|v| (v, 0.0)).collect();
        let tree = PathTree::new(&graph, &starts, |_, _| Some(true));
        let distance = |k: usize| chart.corners[k].map(|v| tree.distance[v as usize]).into_iter().fold(0.0, f64::max);
        let mut near: Vec<(f64, FaceId)> =
            (0..chart.faces.len()).filter(|&k| !inside(k)).map(|k| (distance(k), chart.faces[k])).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let before = self.length(&lifted.seams);
        // A strip of this area and the least width has as much outline as the small piece.
        let outline: f64 = lifted.pieces[0].1.chart.boundary_edges().map(|(h, ..)| self.metric.length[h]).sum();
        let least = self.options.min_area.max(0.5 * outline * self.options.min_neck);
        for size in SIZES.map(|it| it * least) {
            let mut taken = area[0];
            let given = near.iter().take_while(|it| {
                let enough = taken >= size;
                taken += self.metric.area[it.1];
                !enough
            });
            let mut grown: Vec<FaceId> = given.map(|it| it.1).collect();
            if area[0] + area[1] - taken < self.options.min_area {
                break;
            }
            grown.extend(&lifted.pieces[0].1.chart.faces);
            grown.sort_unstable();
            let within = |f: FaceId| grown.binary_search(&f).is_ok();
            let seams: Vec<EdgeId> = lifted
                .inner
                .iter()
                .copied()
                .filter(|&e| {
                    let h = self.mesh.halfedge(e);
                    let sides = [Some(h), self.mesh.twin(h)].map(|it| it.map(|h| self.mesh.face(h)));
                    let [a, b] = sides.map(|it| it.is_some_and(within));
                    // Slits stay, but not the seam that there was between the two.
                    let [p, q] = sides.map(|it| it.map(|f| self.piece_of[f]));
                    a != b || self.kept[e] || (p == q && lifted.seams.binary_search(&e).is_ok())
                })
                .collect();
            ways.push((self.length(&seams) - before, large, seams));
        }
        self.put_back(lifted);
    }

    /// Cuts two pieces along `seams` instead; whether all that makes is good and of a useful size. Else all stays.
    fn grow(&mut self, small: u32, large: u32, seams: &[EdgeId]) -> Result<bool, CutError> {
        let lifted = self.lift(vec![small, large]);
        self.set_cut(&lifted.inner, seams);
        for faces in self.builder.components(&lifted.faces, &|e| self.cut[e]) {
            let piece = self.judge(faces)?;
            if !piece.is_good() || self.is_small(&piece) {
                self.put_back(lifted);
                return Ok(false);
            }
            self.insert(piece);
        }
        self.join(lifted.first)?;
        Ok(true)
    }
}
