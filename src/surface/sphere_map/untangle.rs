//! Takes poor faces out of a net: turned edges, vertices in the middle of their neighbours, collapsed edges. A net that the
//! surface winds away from under its vertices is folded there, and no descent of an energy opens a fold.
use super::{certify::is_positive, net::Net};
use crate::{
    geom::Vec3,
    mesh::{FaceId, HalfedgeId, Id, VertexId},
    surface::collapse::quality,
};

/// Faces of a lower quality are poor.
const POOR: f64 = 0.35;
/// The worst face has to become better by this factor.
const BETTER: f64 = 1.1;
/// Rounds at most.
const ROUNDS: usize = 4;

/// How bad some faces are: how many look away from the surface, and the quality of the worst.
#[derive(Clone, Copy)]
struct Score {
    folded: usize,
    worst: f64,
}

impl Score {
    fn beats(self, other: Self) -> bool {
        self.folded < other.folded || self.folded == other.folded && self.worst > BETTER * other.worst
    }
}

impl Net<'_> {
    /// Mends the faces that are poor or look away from the surface, as far as that goes.
    pub(super) fn untangle(&mut self) {
        for _ in 0..ROUNDS {
            let mut mended = 0;
            for f in self.edit.faces().collect::<Vec<_>>() {
                if self.edit.is_alive(HalfedgeId(3 * f.0)) && self.is_poor(f) && self.mend(f) {
                    mended += 1;
                }
            }
            if mended == 0 {
                break;
            }
        }
    }

    fn is_poor(&self, f: FaceId) -> bool {
        let score = self.score([self.edit.face_vertices(f)].into_iter());
        score.folded > 0 || score.worst < POOR
    }

    fn score(&self, faces: impl Iterator<Item = [VertexId; 3]>) -> Score {
        let mut score = Score { folded: 0, worst: 1.0 };
        for corners in faces {
            let places = corners.map(|v| self.edit.position(v));
            let [a, b, c] = places;
            let away = (b - a).cross(&(c - a)).dot(&corners.into_iter().map(|v| self.normal(v)).sum::<Vec3>()) <= 0.0;
            score.folded += usize::from(away);
            score.worst = score.worst.min(quality(places));
        }
        score
    }

    fn star(&self, v: VertexId) -> Vec<[VertexId; 3]> {
        self.edit.outgoing(v).map(|h| [v, self.edit.head(h), self.edit.apex(h)]).collect()
    }

    fn mend(&mut self, f: FaceId) -> bool {
        let sides = Self::halfedges(f);
        sides.into_iter().any(|h| self.turns_better(h))
            || self.edit.face_vertices(f).into_iter().any(|v| self.moves_better(v))
            || {
                let ways = sides.into_iter().flat_map(|h| [Some(h), self.edit.twin(h)]).flatten();
                let mut ways: Vec<(f64, HalfedgeId)> = ways.map(|h| (self.length(h), h)).collect();
                ways.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                ways.into_iter().any(|(_, h)| self.collapses_better(h))
            }
    }

    fn turns_better(&mut self, h: HalfedgeId) -> bool {
        let Some(t) = self.edit.twin(h) else { return false };
        let [a, b, c, d] = [self.edit.tail(h), self.edit.head(h), self.edit.apex(h), self.edit.apex(t)];
        let [before, after] = [[[a, b, c], [b, a, d]], [[d, c, a], [c, d, b]]].map(|it| self.score(it.into_iter()));
        let turns = after.beats(before) && self.is_free(h);
        if turns {
            self.edit.flip(h);
        }
        turns
    }

    fn moves_better(&mut self, v: VertexId) -> bool {
        let star = self.star(v);
        let before = self.score(star.iter().copied());
        let (at, place) = ((self.points[v.index()], self.spots[v.index()]), self.edit.position(v));
        let around = |weigh: &dyn Fn(VertexId) -> f64| -> Option<Vec3> {
            let sum: Vec3 = star.iter().map(|it| weigh(it[1]) * self.points[it[1].index()]).sum();
            sum.try_normalize(1e-300)
        };
        let even = around(&|_| 1.0);
        let far = around(&|w| (self.edit.position(w) - place).norm());
        for point in [even, far].into_iter().flatten() {
            if !star.iter().all(|it| is_positive([point, self.points[it[1].index()], self.points[it[2].index()]])) {
                continue;
            }
            self.put(v, point);
            if self.score(star.iter().copied()).beats(before) {
                return true;
            }
            (self.points[v.index()], self.spots[v.index()]) = at;
            self.edit.set_position(v, place);
        }
        false
    }

    /// Whether the tail of an edge went to its head.
    fn collapses_better(&mut self, h: HalfedgeId) -> bool {
        let (u, v) = (self.edit.tail(h), self.edit.head(h));
        let star = self.star(u);
        let stay: Vec<[VertexId; 3]> =
            star.iter().filter(|it| it[1] != v && it[2] != v).map(|it| [v, it[1], it[2]]).collect();
        let collapses = self.score(stay.iter().copied()).beats(self.score(star.into_iter()))
            && stay.iter().all(|it| is_positive(it.map(|w| self.points[w.index()])))
            && self.edit.can_collapse(h);
        if collapses {
            self.edit.collapse(h, self.edit.position(v));
        }
        collapses
    }
}
