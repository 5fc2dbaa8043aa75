//! Direction fields: a unit tangent vector (symmetry 1) or line (symmetry 2) at every vertex.
//!
//! A direction of symmetry s is held by the s-th power of its complex number in the tangent plane, so that all s
//! representatives are one value and neighbours are compared by the s-th power of the transport. The smoothest field
//! minimises Σ w |u_j − r_ij^s u_i|² over edges at unit norm (Knöppel, Crane, Pinkall, Schröder 2013, with the
//! edge-based connection Laplacian): the eigenvector of the least eigenvalue, found by Lanczos iterations
//! with the inverse, of which the factor is made once.
mod distance;
mod trivial;

pub use distance::{away_from, tips};
pub use trivial::{TrivialError, trivial};

use super::{tangent::TangentSpaces, tree_cotree::TreeCotree};
use crate::{
    geom::Complex,
    mesh::{EdgeId, Field, Id, TriMesh, VertexId},
    numeric::{
        dissection::nested_dissection,
        random::Random,
        sparse::{Analysis, Cholesky, SparseError, SymmetricMatrix},
    },
};

/// Least weight of an edge: cotangent weights of either sign could make the connection Laplacian indefinite, and edges of
/// weight 0, as the diagonals of squares have, could leave vertices without neighbours.
const LEAST_WEIGHT: f64 = 1e-2;
/// What is added to the eigenvalues, times the area: a flat surface has parallel fields, whose eigenvalue is 0.
const SHIFT: f64 = 1e-4;
/// The residual of the eigenvector, relative to its eigenvalue; the energy is as good as its square.
const RESIDUAL: f64 = 1e-3;
/// Lanczos steps at most. Clusters of least eigenvalues, between which it need not choose, do not slow it down.
const STEPS: usize = 60;

/// Why there is no field.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// The connection Laplacian cannot be factored.
    #[error("the direction field cannot be computed: {0}; the mesh is nearly degenerate, remesh it")]
    Factor(#[from] SparseError),
    /// No direction is known anywhere.
    #[error("the field is zero everywhere: {0}")]
    Zero(&'static str),
}

/// A direction field.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionField {
    /// 1 for vectors, 2 for lines.
    pub symmetry: i32,
    /// The s-th power of the direction per vertex, of modulus 1; 0 where it is not known.
    pub power: Field<VertexId, Complex>,
}

/// Singularities of a field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Turns {
    /// Singular faces with their indices times the symmetry.
    pub faces: Vec<(crate::mesh::FaceId, i32)>,
    /// Per boundary loop: turns of the boundary against the field (0 for a field along the boundary), times the symmetry.
    pub loops: Vec<i32>,
}

impl Turns {
    /// Sum of all: symmetry × Euler characteristic (Poincaré–Hopf).
    pub fn sum(&self) -> i64 {
        self.faces.iter().map(|it| i64::from(it.1)).sum::<i64>()
            + self.loops.iter().map(|&it| i64::from(it)).sum::<i64>()
    }

    /// Those of a field of which the power rotates by `rotation`, radians, along every edge against the transport.
    pub fn by_rotation(mesh: &TriMesh, tangent: &TangentSpaces, symmetry: i32, rotation: &Field<EdgeId, f64>) -> Self {
        let along = |h| {
            let e = mesh.edge(h);
            if mesh.halfedge(e) == h { rotation[e] } else { -rotation[e] }
        };
        let s = f64::from(symmetry);
        let index = |f| {
            let sum: f64 = mesh.face_halfedges(f).map(along).iter().sum();
            ((sum + s * tangent.curvature(mesh, f)) / std::f64::consts::TAU).round() as i32
        };
        let faces = mesh.faces().map(|f| (f, index(f))).filter(|it| it.1 != 0).collect();
        let turn = |path: Vec<_>| {
            let sum: f64 = path.iter().map(|&h| along(h)).sum();
            ((s * tangent.turning(mesh, &path) - sum) / std::f64::consts::TAU).round() as i32
        };
        Self { faces, loops: mesh.boundary_loops().into_iter().map(turn).collect() }
    }
}

impl DirectionField {
    /// From complex numbers that are not yet powers nor of modulus 1.
    pub fn from_vectors(symmetry: i32, vectors: &Field<VertexId, Complex>) -> Self {
        Self { symmetry, power: Field::from_vec(vectors.iter().map(|it| unit(it.powi(symmetry))).collect()) }
    }

    fn from_powers(symmetry: i32, power: impl Iterator<Item = Complex>) -> Result<Self, FieldError> {
        let power: Vec<Complex> = power.map(unit).collect();
        if power.iter().all(|it| it.norm_sqr() == 0.0) {
            return Err(FieldError::Zero("nothing determines a direction"));
        }
        Ok(Self { symmetry, power: Field::from_vec(power) })
    }

    /// One representative per vertex, of modulus 1 or 0.
    pub fn vectors(&self) -> Field<VertexId, Complex> {
        let root = |it: &Complex| if self.symmetry == 1 { *it } else { it.powf(1.0 / f64::from(self.symmetry)) };
        Field::from_vec(self.power.iter().map(|it| if it.norm_sqr() > 0.0 { root(it) } else { *it }).collect())
    }

    /// The field turned by `angle` in every tangent plane.
    pub fn turned(&self, angle: f64) -> Self {
        let turn = Complex::from_polar(1.0, f64::from(self.symmetry) * angle);
        Self { symmetry: self.symmetry, power: Field::from_vec(self.power.iter().map(|it| it * turn).collect()) }
    }

    /// The singularities, by the least rotation along every edge. Their sum is always symmetry × χ.
    pub fn turns(&self, mesh: &TriMesh, tangent: &TangentSpaces) -> Turns {
        let rotation = Field::from_fn(mesh.edge_count(), |e: EdgeId| {
            let h = mesh.halfedge(e);
            let carried = self.power[mesh.tail(h)] * tangent.transport(h).powi(self.symmetry);
            (self.power[mesh.head(h)] * carried.conj()).arg()
        });
        Turns::by_rotation(mesh, tangent, self.symmetry, &rotation)
    }
}

fn unit(z: Complex) -> Complex {
    let norm = z.norm();
    if norm > 0.0 && norm.is_finite() { z / norm } else { Complex::new(0.0, 0.0) }
}

/// The smoothest field, which puts its singularities where it likes.
pub fn smoothest(mesh: &TriMesh, tangent: &TangentSpaces, symmetry: i32) -> Result<DirectionField, FieldError> {
    let mass = masses(mesh, tangent);
    let area: f64 = mass.iter().sum();
    let extra: Vec<f64> = mass.iter().map(|it| SHIFT / area * it).collect();
    let factor = connection_laplacian(mesh, tangent, symmetry, &extra)?;
    let x = least_eigenvector(&factor, &mass);
    DirectionField::from_powers(symmetry, x.chunks_exact(2).map(|it| Complex::new(it[0], it[1])))
}

/// What a field should be at a vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guide {
    /// The vertex.
    pub vertex: VertexId,
    /// The direction there (not its power); its modulus does not count.
    pub direction: Complex,
    /// How much it counts, against 1 for the smoothness: times the weights of the edges around the vertex.
    pub strength: f64,
}

/// The smoothest field that follows `guides`: minimises the energy of [`smoothest`] plus Σ strength |u − guide|² without
/// a constraint of norm.
pub fn guided(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    symmetry: i32,
    guides: &[Guide],
) -> Result<DirectionField, FieldError> {
    let mass = masses(mesh, tangent);
    let area: f64 = mass.iter().sum();
    let mut extra: Vec<f64> = mass.iter().map(|it| 1e-3 * SHIFT / area * it).collect();
    let mut rhs = vec![0.0; 2 * mesh.vertex_count()];
    for guide in guides {
        let wish = unit(guide.direction).powi(symmetry) * guide.strength;
        let at = guide.vertex.index();
        extra[at] += guide.strength;
        rhs[2 * at] += wish.re;
        rhs[2 * at + 1] += wish.im;
    }
    if rhs.iter().all(|&it| it == 0.0) {
        return Err(FieldError::Zero("no guide gives a direction"));
    }
    connection_laplacian(mesh, tangent, symmetry, &extra)?.solve_in_place(&mut rhs);
    DirectionField::from_powers(symmetry, rhs.chunks_exact(2).map(|it| Complex::new(it[0], it[1])))
}

/// Directions of the largest normal curvature (lines: symmetry 2), turned by a quarter for the least: −Σ l β e^{2iφ} over the
/// edges around a vertex, with length l, bend β and direction φ; its modulus, mm, tells how sure it is.
pub fn principal(mesh: &TriMesh, tangent: &TangentSpaces) -> Field<VertexId, Complex> {
    let mut sum = Field::filled(mesh.vertex_count(), Complex::new(0.0, 0.0));
    for e in mesh.edges() {
        let h = mesh.halfedge(e);
        let Some(twin) = mesh.twin(h) else { continue };
        let [a, b] = [h, twin].map(|it| mesh.normal(mesh.face(it)));
        let along = mesh.vector(h);
        let length = along.norm();
        let bend = f64::atan2(a.cross(&b).dot(&along) / length, a.dot(&b));
        for (v, direction) in [(mesh.tail(h), tangent.direction[h]), (mesh.head(h), tangent.arrival[h])] {
            sum[v] -= direction * direction * (0.5 * length * bend);
        }
    }
    sum
}

/// Guides of the principal directions; `strength` weighs the most curved vertices.
pub fn principal_guides(curvature: &Field<VertexId, Complex>, least: bool, strength: f64) -> Vec<Guide> {
    let largest = curvature.iter().map(|it| it.norm()).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let turn = if least { Complex::new(0.0, 1.0) } else { Complex::new(1.0, 0.0) };
    let guide = |(vertex, it): (VertexId, &Complex)| Guide {
        vertex,
        direction: unit(*it).powf(0.5) * turn,
        strength: strength * it.norm() / largest,
    };
    curvature.enumerate().filter(|it| it.1.norm_sqr() > 0.0).map(guide).collect()
}

/// Guides along the boundary with the surface on the left, turned by `angle`.
pub fn boundary_guides(mesh: &TriMesh, tangent: &TangentSpaces, angle: f64, strength: f64) -> Vec<Guide> {
    let tangential = |v: VertexId| {
        let total: f64 = mesh.outgoing(v).map(|h| tangent.metric.angle[h]).sum();
        // Half-way between the two boundary edges is inwards.
        Complex::from_polar(1.0, 0.5 * total - std::f64::consts::FRAC_PI_2 + angle)
    };
    let rim = mesh.vertices().filter(|&v| mesh.is_boundary_vertex(v));
    rim.map(|vertex| Guide { vertex, direction: tangential(vertex), strength }).collect()
}

/// A third of the area around each vertex.
fn masses(mesh: &TriMesh, tangent: &TangentSpaces) -> Vec<f64> {
    let mut mass = vec![0.0; mesh.vertex_count()];
    for f in mesh.faces() {
        mesh.face_vertices(f).into_iter().for_each(|v| mass[v.index()] += tangent.metric.area[f] / 3.0);
    }
    mass
}

/// The connection Laplacian plus `extra` on the diagonal as a real matrix of twice the size (unknowns 2 v and 2 v + 1 are the
/// real and the imaginary part), factored.
fn connection_laplacian(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    symmetry: i32,
    extra: &[f64],
) -> Result<Cholesky, SparseError> {
    let n = mesh.vertex_count();
    let mut pairs = Vec::with_capacity(4 * mesh.edge_count());
    for e in mesh.edges() {
        let [i, j] = mesh.edge_vertices(e).map(|v| 2 * v.0);
        pairs.extend([(j, i), (j, i + 1), (j + 1, i), (j + 1, i + 1)]);
    }
    let (mut matrix, slots) = SymmetricMatrix::with_pattern(2 * n, &pairs);
    for (e, slots) in mesh.edges().zip(slots.chunks_exact(4)) {
        let h = mesh.halfedge(e);
        let cotangents = tangent.metric.cotangent[h] + mesh.twin(h).map_or(0.0, |it| tangent.metric.cotangent[it]);
        let weight = (0.5 * cotangents).max(LEAST_WEIGHT);
        let r = tangent.transport(h).powi(symmetry) * weight;
        let values = matrix.values_mut();
        for (&slot, value) in slots.iter().zip([-r.re, r.im, -r.im, -r.re]) {
            values[slot as usize] += value;
        }
        for v in mesh.edge_vertices(e) {
            for k in [0, 1] {
                matrix.add_to_diagonal(2 * v.index() + k, weight);
            }
        }
    }
    for (v, &value) in extra.iter().enumerate() {
        for k in [0, 1] {
            matrix.add_to_diagonal(2 * v + k, value);
        }
    }
    let places: Vec<[f64; 3]> = mesh.positions().iter().map(|p| [p.x, p.y, p.z]).collect();
    let order = nested_dissection(&matrix, 2, &places);
    Analysis::with_ordering(&matrix, &order)?.factor(&matrix)
}

/// The vector x for which A x = λ M x with the least λ, by Lanczos in the inner product of M = diag(mass, mass).
fn least_eigenvector(factor: &Cholesky, mass: &[f64]) -> Vec<f64> {
    let n = factor.size();
    let dot = |a: &[f64], b: &[f64]| -> f64 {
        a.chunks_exact(2).zip(b.chunks_exact(2)).zip(mass).map(|((a, b), m)| m * (a[0] * b[0] + a[1] * b[1])).sum()
    };
    let mut random = Random::new(1);
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut diagonal: Vec<f64> = Vec::new();
    let mut beside: Vec<f64> = Vec::new();
    let mut next: Vec<f64> = (0..n).map(|_| random.unit() - 0.5).collect();
    let mut ritz = vec![1.0];
    let norm = dot(&next, &next).sqrt();
    next.iter_mut().for_each(|it| *it /= norm);
    while basis.len() < STEPS {
        basis.push(std::mem::take(&mut next));
        let last = &basis[basis.len() - 1];
        next = last.iter().enumerate().map(|(i, it)| mass[i / 2] * it).collect();
        factor.solve_in_place(&mut next);
        diagonal.push(dot(&next, last));
        // Against all before, twice over where it matters: the plain recurrence loses orthogonality as it converges.
        for q in basis.iter().rev() {
            let along = dot(&next, q);
            next.iter_mut().zip(q).for_each(|(x, q)| *x -= along * q);
        }
        let norm = dot(&next, &next).sqrt();
        let (value, vector) = largest_of_tridiagonal(&diagonal, &beside);
        ritz = vector;
        if norm * ritz[ritz.len() - 1].abs() <= RESIDUAL * value {
            break;
        }
        next.iter_mut().for_each(|it| *it /= norm);
        beside.push(norm);
    }
    let mut out = vec![0.0; n];
    for (q, s) in basis.iter().zip(ritz) {
        out.iter_mut().zip(q).for_each(|(x, q)| *x += s * q);
    }
    out
}

/// Largest eigenvalue of a small symmetric tridiagonal matrix, and its eigenvector.
fn largest_of_tridiagonal(diagonal: &[f64], beside: &[f64]) -> (f64, Vec<f64>) {
    let n = diagonal.len();
    let matrix = nalgebra::DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => diagonal[i],
        1 => beside[i.min(j)],
        _ => 0.0,
    });
    let eigen = matrix.symmetric_eigen();
    let best = eigen.eigenvalues.imax();
    (eigen.eigenvalues[best], eigen.eigenvectors.column(best).iter().copied().collect())
}

/// Number of components, with the Euler characteristic of each.
pub(super) fn euler_characteristics(mesh: &TriMesh, tree: &TreeCotree) -> Vec<i64> {
    let mut out = vec![0_i64; tree.roots.len()];
    let (component, _) = mesh.components();
    let of_vertex = |v: VertexId| mesh.outgoing(v).next().map_or(0, |h| component[mesh.face(h)] as usize);
    mesh.vertices().for_each(|v| out[of_vertex(v)] += 1);
    mesh.edges().for_each(|e| out[component[mesh.face(mesh.halfedge(e))] as usize] -= 1);
    mesh.faces().for_each(|f| out[component[f] as usize] += 1);
    out
}

#[cfg(test)]
mod tests;
