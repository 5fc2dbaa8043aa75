//! Integrals of the normals over any region that chords and boundary arcs enclose, from integrals along its border.
//!
//! On every face the density (N, 1) is constant, so there is a 1-form ω, linear in each face and continuous along edges,
//! with dω = (N, 1) dA: Whitney's lowest edge element, fixed by one number per edge. Its numbers follow from a spanning
//! tree of the faces, and by Stokes ∫_R (N, 1) dA = ∮_∂R ω. A chord is integrated exactly by walking through its faces;
//! then the integral over any region is a sum of as many terms as it has sides. Nothing is rasterised, and a region that
//! overlaps itself in the plane is no exception.
use super::patch::{NONE, Patch, Segment, next};
use crate::geom::Vec3;

/// ∫ N dA and ∫ dA, mm².
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Flux {
    pub(super) normal: Vec3,
    pub(super) area: f64,
}

impl std::ops::Add for Flux {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { normal: self.normal + other.normal, area: self.area + other.area }
    }
}

impl std::ops::Sub for Flux {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + other * -1.0
    }
}

impl std::ops::Mul<f64> for Flux {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self { normal: self.normal * factor, area: self.area * factor }
    }
}

/// The 1-form ω: its integral along every halfedge.
#[derive(Debug, Clone)]
pub(super) struct Form {
    along: Vec<Flux>,
    normals: Vec<Vec3>,
}

impl Form {
    /// For a connected patch with a boundary.
    pub(super) fn new(patch: &Patch) -> Self {
        let faces = patch.face_count();
        let normals: Vec<Vec3> = (0..faces as u32).map(|f| patch.normal(f)).collect();
        let mut along = vec![Flux::default(); 3 * faces];
        // Faces in breadth first order from one with a boundary side; each hands its excess to the one before it.
        let root = (0..3 * faces as u32).find(|&h| patch.twin[h as usize] == NONE).unwrap_or(0);
        let mut parent = vec![NONE; faces];
        parent[root as usize / 3] = root;
        let mut order = vec![root / 3];
        let mut done = 0;
        while done < order.len() {
            let f = order[done];
            for h in 3 * f..3 * f + 3 {
                let g = patch.twin[h as usize];
                if g != NONE && parent[g as usize / 3] == NONE {
                    parent[g as usize / 3] = g;
                    order.push(g / 3);
                }
            }
            done += 1;
        }
        for &f in order.iter().rev() {
            let area = patch.area(f);
            let total = Flux { normal: normals[f as usize] * area, area };
            let h = parent[f as usize];
            let others = along[next(h) as usize] + along[next(next(h)) as usize];
            along[h as usize] = total - others;
            let g = patch.twin[h as usize];
            if g != NONE {
                along[g as usize] = along[h as usize] * -1.0;
            }
        }
        Self { along, normals }
    }

    /// ∫ ω along a whole halfedge.
    pub(super) fn along(&self, h: u32) -> Flux {
        self.along[h as usize]
    }

    /// ∫ ω along a straight line inside a face.
    fn segment(&self, it: &Segment) -> Flux {
        let (p, q) = (it.from, it.to);
        (0..3).fold(Flux::default(), |sum, k| {
            let n = (k + 1) % 3;
            sum + self.along[3 * it.face as usize + k] * (p[k] * q[n] - p[n] * q[k])
        })
    }
}

/// A straight line in the plane between two boundary vertices, inside the region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Chord {
    /// ∫ ω from its start to its end.
    pub(super) flux: Flux,
    /// Length in the plane, mm.
    pub(super) length: f64,
    /// Length of the same line on the surface, mm.
    pub(super) surface: f64,
    /// Largest distance of a point of the surface on the chord from the same point of the straight line in space, mm.
    pub(super) bow: f64,
    /// Root mean square angle between the normals along it and their mean, radians.
    pub(super) spread: f64,
}

impl Chord {
    /// Walks from one boundary vertex to another; `None` when the straight line is no chord. `path` is scratch.
    pub(super) fn trace(patch: &Patch, form: &Form, from: u32, to: u32, path: &mut Vec<Segment>) -> Option<Self> {
        if !patch.trace(from, to, path) {
            return None;
        }
        let [start, end] = [from, to].map(|v| patch.uv[v as usize]);
        let [low, high] = [from, to].map(|v| patch.xyz[v as usize]);
        let line = end - start;
        let length = line.norm();
        let mut out = Self { flux: Flux::default(), length, surface: 0.0, bow: 0.0, spread: 0.0 };
        let mut sum = Vec3::zeros();
        let mut last = low;
        let mut before = 0.0;
        for it in path.iter() {
            out.flux = out.flux + form.segment(it);
            let t = (patch.flat_place(it.face, it.to) - start).dot(&line) / (length * length);
            let straight = low + (high - low) * t;
            let place = patch.place(it.face, it.to);
            out.bow = out.bow.max((place - straight).norm());
            out.surface += (place - last).norm();
            last = place;
            sum += form.normals[it.face as usize] * (t - before);
            before = t;
        }
        // |N − M|² summed along the chord with the unit mean M is 2 (1 − |∫N|), and an angle squared for small angles.
        out.spread = (2.0 * (1.0 - sum.norm())).max(0.0).sqrt();
        Some(out)
    }
}
