//! Bends of sheet metal: the flat pattern shortened at each bend line by what the bend gives back.
//!
//! A sheet of thickness T bent by an angle θ about an inner radius R keeps the length of its neutral fibre, K·T from its
//! inner side: the bend allowance is BA = θ (R + K·T). The legs end at their tangent lines, which lie a setback before the
//! corner that their faces would meet in: tan(θ/2) (R + T) on the outer side of the bend, tan(θ/2) R on its inner one
//! (Oberg et al., Machinery's Handbook, "Sheet Metal Bending"). The mesh is the printed side of the sheet, so the flat
//! pattern is shorter than that of the mesh by the bend deduction BD = 2 · setback − BA.
use std::collections::{BTreeMap, BTreeSet};

use super::folds::Fold;
use crate::{
    geom::{
        Vec2,
        polygon::{point_segment_distance, segment_distance},
        polyline::ArcLength,
        signed_area,
    },
    mesh::{FaceId, Field, HalfedgeId, TriMesh, VertexId},
    model::{Bend, CutMesh, Flattening, Operation, PieceId},
};

/// What a sheet does when it is bent; lengths in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bending {
    /// Thickness T.
    pub thickness: f64,
    /// Inner radius R of every bend.
    pub radius: f64,
    /// Distance of the neutral fibre from the inner side, as a share of the thickness.
    pub k_factor: f64,
}

impl Bending {
    /// Length of the bent zone in the flat, for a bend by `angle` radians.
    pub fn allowance(&self, angle: f64) -> f64 {
        angle * (self.radius + self.k_factor * self.thickness)
    }

    /// From the corner of the printed side to the tangent line; `up` bends have the printed side inside.
    pub fn setback(&self, angle: f64, up: bool) -> f64 {
        (angle / 2.0).tan() * if up { self.radius } else { self.radius + self.thickness }
    }

    /// By how much the flat pattern is shorter than both legs up to the corner of the printed side.
    pub fn deduction(&self, angle: f64, up: bool) -> f64 {
        2.0 * self.setback(angle, up) - self.allowance(angle)
    }
}

/// Bend lines that bow more than this are not straight, mm.
const STRAIGHT: f64 = 0.05;
/// No tool bends further than this, radians (170°), and the corner of the legs lies too far out to be reckoned with.
const SHARPEST: f64 = 2.967;

/// A flattening with its bends taken in.
pub(super) struct Bent {
    pub(super) flat: Flattening,
    /// Points of outlines between the tail and the head of a boundary halfedge: where it meets tangent lines.
    pub(super) inserted: BTreeMap<HalfedgeId, Vec<Vec2>>,
    /// Per fold, whether the flat pattern was corrected by it.
    pub(super) corrected: Vec<bool>,
    /// Of pieces that were: by how much flanges moved towards one another at most, mm. So far they may overlap where they lay
    /// side by side, at the corners that bends meet in.
    pub(super) closer: BTreeMap<PieceId, f64>,
}

impl Bent {
    /// Nothing to take in.
    pub(super) fn untouched(flat: &Flattening, folds: &[Fold]) -> Self {
        let corrected = vec![false; folds.len()];
        Self { flat: flat.clone(), inserted: BTreeMap::new(), corrected, closer: BTreeMap::new() }
    }
}

/// A bend with its line, for the lettering.
pub(super) struct BendLine {
    pub(super) piece: PieceId,
    pub(super) bend: Bend,
    pub(super) line: ArcLength,
    /// "UP 90°"; with what the pattern is to be shortened by where it was not.
    pub(super) text: String,
}

/// All bends, in the order of the folds.
pub(super) fn lines(cut: &CutMesh, bent: &Bent, folds: &[Fold], sheet: &Bending) -> Vec<BendLine> {
    let line = |(fold, &corrected): (&Fold, &bool)| {
        let line = ArcLength::new(fold.chain.iter().map(|&v| bent.flat.uv[v]).collect())?;
        let up = fold.operation == Operation::ScoreValley;
        let (allowance, deduction) = (sheet.allowance(fold.angle), sheet.deduction(fold.angle, up));
        let mut text = format!("{} {:.0}°", if up { "UP" } else { "DOWN" }, fold.angle.to_degrees());
        if !corrected {
            text += &format!(" BD {deduction:.2}");
        }
        let part = cut.pieces[fold.piece].name.clone();
        let bend = Bend { part, angle: fold.angle, up, length: line.length(), allowance, deduction, corrected };
        Some(BendLine { piece: fold.piece, bend, line, text })
    };
    folds.iter().zip(&bent.corrected).filter_map(line).collect()
}

/// Shortens every piece whose folds are straight lines from edge to edge that part it into flanges. The largest flange stays
/// where it is. Where folds meet inside a piece, or are nearer to each other than their bent zones are wide, no flat pattern
/// is right for all of them, and the piece stays as it is.
pub(super) fn correct(cut: &CutMesh, flat: &Flattening, folds: &[Fold], sheet: &Bending) -> Bent {
    let mut bent = Bent::untouched(flat, folds);
    let mut of_piece: BTreeMap<PieceId, Vec<usize>> = BTreeMap::new();
    for (k, fold) in folds.iter().enumerate() {
        of_piece.entry(fold.piece).or_default().push(k);
    }
    for (piece, own) in of_piece {
        if let Some(flanges) = Flanges::of(cut, flat, piece, own.iter().map(|&k| &folds[k]), sheet) {
            flanges.apply(cut, flat, &mut bent);
            bent.closer.insert(piece, flanges.closer());
            own.iter().for_each(|&k| bent.corrected[k] = true);
        }
    }
    bent
}

/// A bend line between two flanges, before the correction.
struct Chord {
    ends: [Vec2; 2],
    /// Unit vector to the left of it.
    left: Vec2,
    /// The flanges on its left and on its right.
    sides: [usize; 2],
    setback: f64,
    deduction: f64,
}

impl Chord {
    /// Distance from the line into flange `side`, and whether the foot lies on the line or no farther beyond it than the
    /// setback.
    fn off(&self, side: usize, p: Vec2) -> (f64, bool) {
        let (d, along) = (p - self.ends[0], self.ends[1] - self.ends[0]);
        let foot = d.dot(&along) / along.norm();
        let sign = if self.sides[0] == side { 1.0 } else { -1.0 };
        (sign * d.dot(&self.left), foot > -self.setback && foot < along.norm() + self.setback)
    }
}

/// The parts of a piece between its bend lines.
struct Flanges {
    faces: Vec<FaceId>,
    flange: BTreeMap<FaceId, usize>,
    chords: Vec<Chord>,
    /// How far each flange moves.
    shift: Vec<Vec2>,
}

impl Flanges {
    fn of<'a>(
        cut: &CutMesh,
        flat: &Flattening,
        piece: PieceId,
        folds: impl Iterator<Item = &'a Fold> + Clone,
        sheet: &Bending,
    ) -> Option<Self> {
        let (mesh, uv) = (&cut.mesh, &flat.uv);
        let across = |fold: &Fold| {
            let (first, last) = (fold.chain[0], fold.chain[fold.chain.len() - 1]);
            let bow = |&v: &VertexId| point_segment_distance(uv[v], uv[first], uv[last]);
            let inner = &fold.chain[1..fold.chain.len() - 1];
            fold.angle < SHARPEST
                && [first, last].iter().all(|&v| mesh.is_boundary_vertex(v))
                && inner.iter().all(|v| !mesh.is_boundary_vertex(*v) && bow(v) < STRAIGHT)
        };
        if !folds.clone().all(across) {
            return None;
        }
        let faces: Vec<FaceId> = mesh.faces().filter(|&f| cut.piece_of[f] == piece).collect();
        let bends: BTreeSet<_> = folds.clone().flat_map(|it| it.halfedges(mesh)).map(|h| mesh.edge(h)).collect();
        let flange = components(mesh, &faces, &|h| bends.contains(&mesh.edge(h)));
        let count = flange.values().max()? + 1;
        let chord = |fold: &Fold| {
            let h = fold.halfedges(mesh).next()?;
            let ends = [uv[fold.chain[0]], uv[fold.chain[fold.chain.len() - 1]]];
            let along = (ends[1] - ends[0]).try_normalize(1e-9)?;
            // The halfedge found may run against the chain.
            let forward = mesh.tail(h) == fold.chain[0];
            let (here, there) = (flange[&mesh.face(h)], flange[&mesh.face(mesh.twin(h)?)]);
            let up = fold.operation == Operation::ScoreValley;
            Some(Chord {
                ends,
                left: Vec2::new(-along.y, along.x),
                sides: if forward { [here, there] } else { [there, here] },
                setback: sheet.setback(fold.angle, up),
                deduction: sheet.deduction(fold.angle, up),
            })
        };
        let chords: Vec<Chord> = folds.map(chord).collect::<Option<_>>()?;
        let mut flanges = Self { faces, flange, chords, shift: vec![Vec2::zeros(); count] };
        // A line from edge to edge parts a disk in two, and each further one a flange in two.
        let fits = count == flanges.chords.len() + 1 && flanges.bends_have_room(mesh, uv);
        fits.then(|| flanges.lay(mesh, uv)).map(|()| flanges)
    }

    /// Whether bent zones keep clear of one another and every flange reaches beyond its own.
    fn bends_have_room(&self, mesh: &TriMesh, uv: &Field<VertexId, Vec2>) -> bool {
        let apart = |a: &Chord, b: &Chord| {
            let near = a.sides.iter().any(|it| b.sides.contains(it));
            // Lines that end in one corner of the outline share it: it becomes the corner of both bent zones.
            let corner = a.ends.iter().any(|it| b.ends.contains(it));
            let distance = segment_distance(a.ends[0], a.ends[1], b.ends[0], b.ends[1]);
            !near || corner || distance >= a.setback + b.setback
        };
        let reaches = |chord: &Chord, side: usize| {
            let own = self.faces.iter().filter(|it| self.flange[it] == side);
            own.flat_map(|&f| mesh.face_vertices(f)).any(|v| chord.off(side, uv[v]).0 > chord.setback)
        };
        self.chords.iter().enumerate().all(|(k, chord)| {
            self.chords[..k].iter().all(|other| apart(chord, other)) && chord.sides.iter().all(|&it| reaches(chord, it))
        })
    }

    /// Moves flanges towards the largest one, each by the deductions of the bends between.
    fn lay(&mut self, mesh: &TriMesh, uv: &Field<VertexId, Vec2>) {
        let mut areas = vec![0.0; self.shift.len()];
        for &f in &self.faces {
            areas[self.flange[&f]] += signed_area(&mesh.face_vertices(f).map(|v| uv[v]));
        }
        let root = (0..areas.len()).max_by(|&i, &j| areas[i].total_cmp(&areas[j]).then(j.cmp(&i))).unwrap_or(0);
        let mut reached = vec![root];
        let mut next = 0;
        while let Some(&here) = reached.get(next) {
            next += 1;
            for chord in &self.chords {
                let [left, right] = chord.sides;
                let (there, towards) = match here {
                    it if it == left => (right, chord.left),
                    it if it == right => (left, -chord.left),
                    _ => continue,
                };
                if !reached.contains(&there) {
                    self.shift[there] = self.shift[here] + towards * chord.deduction;
                    reached.push(there);
                }
            }
        }
    }

    /// By how much two flanges moved against one another at most, mm.
    fn closer(&self) -> f64 {
        let pairs =
            self.shift.iter().enumerate().flat_map(|(k, a)| self.shift[..k].iter().map(move |b| (a - b).norm()));
        pairs.fold(0.0, f64::max)
    }

    /// How far a point of a flange moves: within a bent zone less and less of the difference to the next flange, so that the
    /// bend line comes to lie in the middle.
    fn moved(&self, side: usize, p: Vec2) -> Vec2 {
        let mut sum = p + self.shift[side];
        for chord in self.chords.iter().filter(|it| it.sides.contains(&side)) {
            let other = if chord.sides[0] == side { chord.sides[1] } else { chord.sides[0] };
            let (off, beside) = chord.off(side, p);
            if beside && off < chord.setback {
                sum += (self.shift[other] - self.shift[side]) * (0.5 * (1.0 - off.max(0.0) / chord.setback));
            }
        }
        sum
    }

    fn apply(&self, cut: &CutMesh, flat: &Flattening, bent: &mut Bent) {
        let (mesh, uv) = (&cut.mesh, &flat.uv);
        // Where several lines end in a corner, the flange that all of them bound says where it goes.
        let mut lines: BTreeMap<VertexId, usize> = BTreeMap::new();
        for &f in &self.faces {
            let side = self.flange[&f];
            for v in mesh.face_vertices(f) {
                let bounds = |it: &&Chord| it.sides.contains(&side) && it.ends.contains(&uv[v]);
                let count = self.chords.iter().filter(bounds).count();
                if lines.get(&v).is_none_or(|&known| known < count) {
                    lines.insert(v, count);
                    bent.flat.uv[v] = self.moved(side, uv[v]);
                }
            }
            for h in mesh.face_halfedges(f).into_iter().filter(|&h| mesh.twin(h).is_none()) {
                let (p, q) = (uv[mesh.tail(h)], uv[mesh.head(h)]);
                let mut met: Vec<(f64, Vec2)> = Vec::new();
                for chord in self.chords.iter().filter(|it| it.sides.contains(&side)) {
                    let [from, to] = [p, q].map(|it| chord.off(side, it).0 - chord.setback);
                    if from * to < 0.0 {
                        let t = from / (from - to);
                        let point = p + (q - p) * t;
                        if chord.off(side, point).1 {
                            met.push((t, self.moved(side, point)));
                        }
                    }
                }
                met.sort_by(|a, b| a.0.total_cmp(&b.0));
                if !met.is_empty() {
                    bent.inserted.insert(h, met.into_iter().map(|it| it.1).collect());
                }
            }
        }
    }
}

/// Numbers the sets of faces that are joined through edges which `parted` does not name.
fn components(mesh: &TriMesh, faces: &[FaceId], parted: &dyn Fn(HalfedgeId) -> bool) -> BTreeMap<FaceId, usize> {
    let mut of: BTreeMap<FaceId, usize> = BTreeMap::new();
    let mut count = 0;
    for &seed in faces {
        let mut stack = vec![seed];
        let fresh = !of.contains_key(&seed);
        while let Some(f) = stack.pop().filter(|_| fresh) {
            if of.insert(f, count).is_none() {
                let across = mesh.face_halfedges(f).into_iter().filter(|&h| !parted(h)).filter_map(|h| mesh.twin(h));
                stack.extend(across.map(|h| mesh.face(h)).filter(|it| !of.contains_key(it)));
            }
        }
        count += usize::from(fresh);
    }
    of
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn the_allowance_is_that_of_the_handbooks() {
        // CUTFILES.md: T 1, R 2, 90°, K 0.33 → 3.660 mm.
        let sheet = Bending { thickness: 1.0, radius: 2.0, k_factor: 0.33 };
        assert!((sheet.allowance(FRAC_PI_2) - 3.660).abs() < 5e-4);
        // Outside dimensions: two legs of 50 mm need 100 − 2 · 3 + 3.660 mm; inside dimensions 100 − 2 · 2 + 3.660.
        assert!((sheet.deduction(FRAC_PI_2, false) - 2.340).abs() < 5e-4);
        assert!((sheet.deduction(FRAC_PI_2, true) - 0.340).abs() < 5e-4);
        assert!(sheet.deduction(0.0, true) == 0.0);
    }
}
