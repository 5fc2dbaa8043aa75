//! Boundary and feature curves: fair, or held to those of the source.
//!
//! The energy has no term at boundary vertices, so nothing keeps a boundary smooth: neighbouring stars drag it this way and
//! that. Fairness penalises the change of the curvature vector along the curve, in arc length. With unit tangents t_j and
//! lengths l_j of consecutive edges, κ = (t_{j+1} − t_j) / ((l_j + l_{j+1})/2) is the curvature vector at their common
//! vertex, and for the middle one of three edges the residual
//!   r = l_1 (κ_12 − κ_01) = A (t_2 − t_1) − B (t_1 − t_0),  A = 2 l_1/(l_1 + l_2),  B = 2 l_1/(l_0 + l_1).
//! It has no scale, so it cannot shrink the curve; it vanishes on straight lines, and on smooth curves with the square of
//! the edge length; corners are left out.
use std::collections::BTreeSet;

use nalgebra::Matrix3;

use super::fidelity::Fidelity;
use crate::{
    geom::{Vec3, angle_between},
    mesh::{
        Bvh, Field, HalfedgeId, Id, TriMesh, VertexId,
        distance::{HausdorffBounds, two_sided_bounds},
    },
    numeric::{Cancelled, Monitor},
};

/// Edges on either side over which the direction at a possible corner is taken, so that jags do not count.
const ARM: usize = 3;
/// Turn between those arms, beyond that of a round curve of as many edges, from which a vertex is a corner, radians.
const CORNER: f64 = 0.8;

/// Weight of fairness against Σλ.
const FAIRNESS: f64 = 0.1;
/// Mean jaggedness of a curve at the start, radians, from which it is left as it is: the holes of raw scans zigzag at 32° to
/// 134°, and making them fair would tear the surface around them; curves that were meant have at most 10°.
const ROUGH: f64 = 0.35;
/// Weight of the hold of curves over that of surfaces, and half width of their dead zone over that of surfaces: nothing adds
/// samples where a curve is too far off, as corrections do for surfaces.
const GRIP: f64 = 10.0;
const CURVE_BAND: f64 = 0.97;

/// What is done with boundary curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Boundary {
    /// They slide, but stay smooth.
    Fair,
    /// Smooth, and as near to the boundary of the source as the surface to the surface.
    Hold,
    /// Nothing: only the surface is held.
    Free,
}

/// What is done with feature edges: those of the source with more than a given angle between their faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Features {
    /// Nothing: creases move where the energy wants them.
    Free,
    /// Creases of the start sharper than this angle (radians) stay near those of the source, and smooth.
    Hold(f64),
}

/// Curves of a mesh as chains of edges.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    /// Vertices in order; a closed chain repeats its first one at the end.
    chains: Vec<Vec<VertexId>>,
    /// Where a curve has a corner.
    corners: Vec<VertexId>,
    /// Whether each chain was smooth enough at the start to be made fair.
    smooth: Vec<bool>,
}

impl Network {
    /// The boundary loops of `mesh`.
    pub fn boundary(mesh: &TriMesh) -> Self {
        let close = |path: Vec<HalfedgeId>| path.iter().chain(path.first()).map(|&h| mesh.tail(h)).collect();
        Self::of(mesh, mesh.boundary_loops().into_iter().map(close).collect())
    }

    /// Inner edges with more than `angle` (radians) between their normals, in chains from branch to branch.
    pub fn features(mesh: &TriMesh, angle: f64) -> Self {
        let mut ways = vec![Vec::new(); mesh.vertex_count()];
        for e in mesh.edges().filter(|&e| mesh.dihedral_cosine(e).is_some_and(|cosine| cosine < angle.cos())) {
            let [a, b] = mesh.edge_vertices(e);
            ways[a.index()].push(b);
            ways[b.index()].push(a);
        }
        let mut walked = BTreeSet::new();
        let mut chains = Vec::new();
        // From ends and branches first; what is left are closed chains.
        let ends = mesh.vertices().filter(|v| ways[v.index()].len() != 2);
        for start in ends.chain(mesh.vertices()) {
            for &first in &ways[start.index()] {
                let (mut chain, mut next) = (vec![start], first);
                loop {
                    let here = chain[chain.len() - 1];
                    if !walked.insert([here.min(next), here.max(next)]) {
                        break;
                    }
                    chain.push(next);
                    let &[a, b] = ways[next.index()].as_slice() else { break };
                    next = if a == here { b } else { a };
                }
                if chain.len() > 1 {
                    chains.push(chain);
                }
            }
        }
        Self::of(mesh, chains)
    }

    fn of(mesh: &TriMesh, chains: Vec<Vec<VertexId>>) -> Self {
        let corners: Vec<VertexId> = chains.iter().flat_map(|chain| corners(mesh, chain)).collect();
        let is_smooth = |chain: &Vec<VertexId>| mean_jag(mesh, &runs(chain, &corners)).is_none_or(|it| it < ROUGH);
        let smooth = chains.iter().map(is_smooth).collect();
        Self { chains, corners, smooth }
    }

    /// The same curves on the mesh that [`crate::surface::subdivide`] makes of `mesh`.
    pub fn subdivided(&self, mesh: &TriMesh) -> Self {
        let refine = |chain: &Vec<VertexId>| {
            let mut fine = vec![chain[0]];
            for pair in chain.windows(2) {
                let h = mesh.find_halfedge(pair[0], pair[1]).or_else(|| mesh.find_halfedge(pair[1], pair[0]));
                let edge = mesh.edge(h.expect("neighbours on a curve share an edge"));
                fine.extend([VertexId::new(mesh.vertex_count() + edge.index()), pair[1]]);
            }
            fine
        };
        Self { chains: self.chains.iter().map(refine).collect(), ..self.clone() }
    }

    /// Vertices of all edges.
    fn edges(&self) -> impl Iterator<Item = [VertexId; 2]> + '_ {
        self.chains.iter().flat_map(|chain| chain.windows(2).map(|it| [it[0], it[1]]))
    }

    /// [`runs`] of the chains that are to be fair.
    fn fair_runs(&self) -> Vec<[u32; 4]> {
        let fair = self.chains.iter().zip(&self.smooth).filter(|it| *it.1);
        fair.flat_map(|(chain, _)| runs(chain, &self.corners)).collect()
    }

    /// Its edges as a mesh of loose, degenerate triangles (a, b, b), so that queries and proofs about surfaces serve curves
    /// too; and the vertices behind the corners of those triangles. `None` for no edges.
    fn ribbon(&self, mesh: &TriMesh) -> Option<(TriMesh, Vec<u32>)> {
        let vertices: Vec<VertexId> = self.edges().flat_map(|[a, b]| [a, b, b]).collect();
        let ids: Vec<u32> = (0..vertices.len() as u32).collect();
        // A mesh is not made of degenerate faces, but its faces may become so.
        let valid = ids.iter().map(|&i| Vec3::new(f64::from(i), f64::from(i % 3 % 2), 0.0)).collect();
        let ribbon = TriMesh::new(valid, ids.as_chunks::<3>().0).ok()?;
        let ends = vertices.iter().map(|&v| mesh.position(v)).collect();
        Some((ribbon.with_positions(Field::from_vec(ends)), vertices.iter().map(|v| v.0).collect()))
    }

    /// Mean of |r| (the head of this file) over all places that are no corners: how far, in radians, an edge of the curve turns
    /// out of the arc through its neighbours. `None` where nothing is long enough to tell.
    pub fn jaggedness(&self, mesh: &TriMesh) -> Option<f64> {
        let all: Vec<_> = self.chains.iter().flat_map(|chain| runs(chain, &self.corners)).collect();
        mean_jag(mesh, &all)
    }

    /// Proven bounds of the largest distance between these curves of `mesh` and those of another network, either way; `None`
    /// if one of them has no edges.
    pub fn distance(
        &self,
        mesh: &TriMesh,
        (other, other_mesh): (&Self, &TriMesh),
        resolution: f64,
        monitor: &Monitor,
    ) -> Result<Option<HausdorffBounds>, Cancelled> {
        let (Some((a, _)), Some((b, _))) = (self.ribbon(mesh), other.ribbon(other_mesh)) else { return Ok(None) };
        two_sided_bounds(&a, &b, resolution, monitor).map(Some)
    }
}

/// Every four vertices in a row of a chain whose inner two are no corners.
fn runs(chain: &[VertexId], corners: &[VertexId]) -> Vec<[u32; 4]> {
    let closed = chain.len() > 4 && chain.first() == chain.last();
    let around = if closed { &chain[1..3] } else { &[] };
    let long: Vec<VertexId> = chain.iter().chain(around).copied().collect();
    let smooth = |it: &&[VertexId]| !it[1..3].iter().any(|v| corners.contains(v));
    // The loop around a hole of three edges has no four vertices.
    let distinct = |it: &&[VertexId]| it[0] != it[3];
    long.windows(4).filter(smooth).filter(distinct).map(|it| [0, 1, 2, 3].map(|k| it[k].0)).collect()
}

/// Mean of |r| (the head of this file), radians; `None` for no runs.
fn mean_jag(mesh: &TriMesh, runs: &[[u32; 4]]) -> Option<f64> {
    let jag = |run: &[u32; 4]| fairness(run.map(|v| mesh.position(VertexId(v)))).0.norm();
    (!runs.is_empty()).then(|| runs.iter().map(jag).sum::<f64>() / runs.len() as f64)
}

/// Vertices at which a chain turns by much more than a round curve of as many edges, seen over [`ARM`] edges.
fn corners(mesh: &TriMesh, chain: &[VertexId]) -> Vec<VertexId> {
    let closed = chain.first() == chain.last();
    let count = if closed { chain.len() - 1 } else { chain.len() };
    let arm = ARM.min(count / 4).max(1);
    let at = |i: usize| mesh.position(chain[i % count]);
    let turn = |i: usize| {
        if !closed && (i < arm || i + arm >= count) {
            return 0.0;
        }
        angle_between(at(i) - at(i + count - arm), at(i + arm) - at(i))
    };
    let turns: Vec<f64> = (0..count).map(turn).collect();
    let round = if closed { arm as f64 * std::f64::consts::TAU / count as f64 } else { 0.0 };
    let sharpest = |i: usize| {
        let near = (1..=arm).flat_map(|k| [(i + k) % count, (i + count - k) % count]);
        near.filter(|&k| k != i).all(|k| (turns[i], k) > (turns[k], i))
    };
    (0..count).filter(|&i| turns[i] > CORNER + round && sharpest(i)).map(|i| chain[i]).collect()
}

/// The curves of one mesh that have a term, followed through subdivision.
#[derive(Debug, Clone)]
pub(super) struct Networks {
    /// Unless the boundary is free.
    boundary: Option<Network>,
    /// If features are held.
    features: Option<Network>,
    boundary_held: bool,
}

impl Networks {
    pub(super) fn new(mesh: &TriMesh, boundary: Boundary, features: Features) -> Self {
        Self {
            boundary: (boundary != Boundary::Free).then(|| Network::boundary(mesh)),
            features: match features {
                Features::Free => None,
                Features::Hold(angle) => Some(Network::features(mesh, angle)),
            },
            boundary_held: boundary == Boundary::Hold,
        }
    }

    pub(super) fn subdivided(&self, mesh: &TriMesh) -> Self {
        let [boundary, features] = [&self.boundary, &self.features].map(|it| it.as_ref().map(|it| it.subdivided(mesh)));
        Self { boundary, features, ..*self }
    }

    /// Networks that are held.
    fn held(&self) -> impl Iterator<Item = &Network> {
        let boundary = self.boundary.iter().filter(|_| self.boundary_held);
        boundary.chain(&self.features)
    }

    /// Points and queries of each curve that is held, for a source in mm; `None` for one without edges. `spacing` is the
    /// largest distance of neighbouring points.
    pub(super) fn sources(&self, mesh: &TriMesh, spacing: f64) -> Vec<Option<SourceCurves>> {
        self.held().map(|network| SourceCurves::new(mesh, network, spacing)).collect()
    }
}

/// A held curve of the source, mm.
#[derive(Debug)]
pub(super) struct SourceCurves {
    points: Vec<Vec3>,
    tree: Bvh,
}

impl SourceCurves {
    fn new(mesh: &TriMesh, network: &Network, spacing: f64) -> Option<Self> {
        let mut points = Vec::new();
        for [a, b] in network.edges().map(|it| it.map(|v| mesh.position(v))) {
            let parts = ((b - a).norm() / spacing).ceil().clamp(1.0, 100.0);
            points.extend((0..parts as usize).map(|k| a + (b - a) * (k as f64 / parts)));
            points.push(b);
        }
        Some(Self { points, tree: Bvh::new(&network.ribbon(mesh)?.0) })
    }
}

/// The term of one level; lengths are in the unit of the moving mesh.
#[derive(Debug)]
pub(super) struct Curves<'a> {
    runs: Vec<[u32; 4]>,
    holds: Vec<Hold<'a>>,
}

/// Fidelity of a curve to a curve.
#[derive(Debug)]
struct Hold<'a> {
    /// The vertices of the mesh behind those of the ribbon.
    vertices: Vec<u32>,
    fidelity: Fidelity<'a>,
    /// Coordinates of the ribbon, and the gradient by them.
    x: Vec<f64>,
    gradient: Vec<f64>,
}

impl<'a> Curves<'a> {
    /// For the curves `networks` of `mesh`, held to `sources` (in the same order) within `band`. `None` if there are none.
    pub(super) fn new(
        sources: &'a [Option<SourceCurves>],
        networks: &Networks,
        mesh: &TriMesh,
        unit: f64,
        band: f64,
    ) -> Option<Self> {
        let hold = |(source, network): (&'a Option<SourceCurves>, &Network)| {
            let source = source.as_ref()?;
            let (ribbon, vertices) = network.ribbon(mesh)?;
            let mut fidelity = Fidelity::new(&source.tree, &source.points, &ribbon, unit, CURVE_BAND * band, GRIP);
            let middles: Vec<_> = ribbon.faces().map(|f| (f, [0.5, 0.5, 0.0])).collect();
            fidelity.add_outward(&middles, 1.0);
            let coordinates = vec![0.0; 3 * vertices.len()];
            Some(Hold { vertices, fidelity, gradient: coordinates.clone(), x: coordinates })
        };
        let runs = networks.boundary.iter().chain(&networks.features).flat_map(Network::fair_runs).collect::<Vec<_>>();
        let holds = sources.iter().zip(networks.held()).filter_map(hold).collect::<Vec<_>>();
        (!runs.is_empty() || !holds.is_empty()).then_some(Self { runs, holds })
    }

    /// Sets the weight with which the surface is held; curves follow.
    pub(super) fn set_weight(&mut self, weight: f64) {
        self.holds.iter_mut().for_each(|it| it.fidelity.weight = GRIP * weight);
    }

    /// Groups of vertices whose second derivatives do not vanish, beside those along edges.
    pub(super) fn groups(&self) -> &[[u32; 4]] {
        &self.runs
    }

    /// Value at `x`; adds to `gradient`.
    pub(super) fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        for run in &self.runs {
            let (residual, jacobian) = fairness(run.map(|v| position(x, v)));
            sum += FAIRNESS * residual.norm_squared();
            for (&v, j) in run.iter().zip(&jacobian) {
                let pull = j.tr_mul(&residual) * (2.0 * FAIRNESS);
                (0..3).for_each(|c| gradient[3 * v as usize + c] += pull[c]);
            }
        }
        for hold in &mut self.holds {
            hold.gather(x);
            hold.gradient.fill(0.0);
            sum += hold.fidelity.evaluate(&hold.x, &mut hold.gradient);
            for (&v, own) in hold.vertices.iter().zip(hold.gradient.as_chunks::<3>().0) {
                (0..3).for_each(|c| gradient[3 * v as usize + c] += own[c]);
            }
        }
        sum
    }

    /// Hands out the blocks ∂²/∂a∂b of the Gauss–Newton model, each pair of vertices once.
    pub(super) fn curvature(&self, x: &[f64], mut add: impl FnMut(u32, u32, &Matrix3<f64>)) {
        for run in &self.runs {
            let (_, jacobian) = fairness(run.map(|v| position(x, v)));
            for p in 0..4 {
                for q in 0..=p {
                    add(run[p], run[q], &(jacobian[p].tr_mul(&jacobian[q]) * (2.0 * FAIRNESS)));
                }
            }
        }
        for hold in &self.holds {
            let own: Vec<f64> = hold.vertices.iter().flat_map(|&v| position(x, v).data.0[0]).collect();
            hold.fidelity.curvature(&own, |_, corners, [s, t, u], block| {
                let [a, b, _] = corners.map(|v| hold.vertices[v as usize]);
                let (s, t) = (s, t + u);
                add(a, a, &(block * (s * s)));
                add(b, a, &(block * (s * t)));
                add(b, b, &(block * (t * t)));
            });
        }
    }

    /// Queries all closest points anew, see [`Fidelity::settle`].
    pub(super) fn settle(&mut self, x: &[f64]) {
        for hold in &mut self.holds {
            hold.gather(x);
            hold.fidelity.settle(&hold.x);
        }
    }

    /// Queries closest points anew, see [`Fidelity::refresh`].
    pub(super) fn refresh(&mut self, x: &[f64]) -> bool {
        self.holds.iter_mut().fold(false, |changed, hold| {
            hold.gather(x);
            hold.fidelity.refresh(&hold.x) || changed
        })
    }
}

impl Hold<'_> {
    fn gather(&mut self, x: &[f64]) {
        for (own, &v) in self.x.as_chunks_mut::<3>().0.iter_mut().zip(&self.vertices) {
            *own = position(x, v).data.0[0];
        }
    }
}

fn position(x: &[f64], v: u32) -> Vec3 {
    let at = 3 * v as usize;
    Vec3::new(x[at], x[at + 1], x[at + 2])
}

/// r of the head of this file for four points in a row, and its derivatives by them.
fn fairness(points: [Vec3; 4]) -> (Vec3, [Matrix3<f64>; 4]) {
    let edges = [0, 1, 2].map(|k| points[k + 1] - points[k]);
    let [l0, l1, l2] = edges.map(|e| e.norm());
    let [t0, t1, t2] = edges.map(|e| e / e.norm());
    let (after, before) = (t2 - t1, t1 - t0);
    let (ahead, behind) = (l1 + l2, l0 + l1);
    let (a, b) = (2.0 * l1 / ahead, 2.0 * l1 / behind);
    let residual = after * a - before * b;
    // ∂t = (I − t tᵀ)/l ∂e, ∂l = ⟨t, ∂e⟩.
    let turn = |t: Vec3, l: f64| (Matrix3::identity() - t * t.transpose()) / l;
    let by_first = turn(t0, l0) * b + before * t0.transpose() * (2.0 * l1 / (behind * behind));
    let by_last = turn(t2, l2) * a - after * t2.transpose() * (2.0 * l1 / (ahead * ahead));
    let stretch = after * (2.0 * l2 / (ahead * ahead)) - before * (2.0 * l0 / (behind * behind));
    let by_middle = stretch * t1.transpose() - turn(t1, l1) * (a + b);
    (residual, [-by_first, by_first - by_middle, by_middle - by_last, by_last])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{geom::Vec2, mesh::shapes};

    fn loops(n: usize, at: impl Fn(f64) -> Vec3) -> f64 {
        let points: Vec<Vec3> = (0..n).map(|i| at(i as f64 / n as f64)).collect();
        (0..n).map(|i| fairness([0, 1, 2, 3].map(|k| points[(i + k) % n])).0.norm_squared()).sum()
    }

    #[test]
    fn fairness_has_the_derivative_of_differences() {
        let points = [[0.0, 0.0, 0.1], [0.9, 0.2, 0.0], [1.4, -0.3, 0.3], [2.9, 0.1, -0.2]].map(Vec3::from);
        let (_, jacobian) = fairness(points);
        for (k, j) in jacobian.iter().enumerate() {
            for c in 0..3 {
                let at = |h: f64| {
                    let mut moved = points;
                    moved[k][c] += h;
                    fairness(moved).0
                };
                let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!((difference - j.column(c)).norm() < 1e-8, "{k} {c}: {difference} {}", j.column(c));
            }
        }
    }

    #[test]
    fn fairness_vanishes_on_straight_and_smooth_curves_and_has_no_scale() {
        // A straight line, points at uneven places.
        let line = [0.0, 0.4, 1.0, 3.0].map(|t| Vec3::new(1.0, 2.0, -1.0) * t);
        assert!(fairness(line).0.norm() < 1e-15);
        let ellipse = |scale: f64| {
            move |t: f64| {
                // Uneven parameter: neighbouring edges differ in length.
                let phi = std::f64::consts::TAU * t + 0.3 * (std::f64::consts::TAU * t).sin();
                scale * Vec3::new(3.0 * phi.cos(), phi.sin(), 0.2 * (2.0 * phi).sin())
            }
        };
        let (coarse, fine) = (loops(60, ellipse(1.0)), loops(120, ellipse(1.0)));
        // |r| = O(h²), as many of them as 1/h.
        assert!(fine < coarse / 6.0, "{coarse} {fine}");
        assert!((loops(60, ellipse(7.0)) - coarse).abs() < 1e-12 * coarse);
        let jagged = |t: f64| {
            let side = if (120.0 * t).round() as i64 % 2 == 0 { 0.01 } else { -0.01 };
            ellipse(1.0)(t) * (1.0 + side)
        };
        assert!(loops(120, jagged) > 20.0 * fine, "{} {fine}", loops(120, jagged));
    }

    #[test]
    fn corners_are_where_a_boundary_turns() {
        let square = shapes::grid(12, 10, 0.3);
        let network = Network::boundary(&square);
        let mut found = network.corners.clone();
        found.sort_unstable();
        assert_eq!(found, [0, 12, 130, 142].map(VertexId));
        // Runs with a corner at an inner place are left out: two of them per corner.
        assert_eq!(network.fair_runs().len(), 44 - 8);
        for (inner, around) in [(1.0, 9), (1.0, 40)] {
            assert_eq!(Network::boundary(&shapes::annulus(inner, 2.0, around, 3)).corners, []);
        }
    }

    #[test]
    fn curves_that_start_as_zigzags_are_left_alone() {
        let smooth = shapes::annulus(1.0, 2.0, 40, 3);
        let mut rough = smooth.clone();
        let inner: Vec<VertexId> = smooth.vertices().filter(|&v| smooth.position(v).norm() < 1.01).collect();
        for v in inner.into_iter().step_by(2) {
            rough.positions_mut()[v] *= 0.85;
        }
        assert_eq!(Network::boundary(&smooth).fair_runs().len(), 80);
        let network = Network::boundary(&rough);
        assert_eq!(network.fair_runs().len(), 40, "only the outer one is fair");
        assert!(network.jaggedness(&rough).unwrap() > 10.0 * Network::boundary(&smooth).jaggedness(&smooth).unwrap());
    }

    #[test]
    fn features_are_chains_between_branches_and_follow_subdivision() {
        let cube = shapes::cuboid(Vec3::new(1.0, 2.0, 3.0), 3);
        let mut network = Network::features(&cube, 0.8);
        assert_eq!(network.chains.len(), 12);
        assert!(network.chains.iter().all(|chain| chain.len() == 4));
        let fine = crate::surface::subdivide(&cube).unwrap();
        network = network.subdivided(&cube);
        let mut expected: Vec<_> = Network::features(&fine, 0.8).edges().map(|[a, b]| [a.min(b), a.max(b)]).collect();
        let mut found: Vec<_> = network.edges().map(|[a, b]| [a.min(b), a.max(b)]).collect();
        expected.sort_unstable();
        found.sort_unstable();
        assert_eq!(found, expected);
        // A drum has two closed ones.
        let drum = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 1.0], [0.0, 1.0]].map(Vec2::from);
        let drum = Network::features(&shapes::revolve(&drum, 24), 0.8);
        assert_eq!(drum.chains.iter().map(Vec::len).collect::<Vec<_>>(), [25, 25]);
        assert!(drum.chains.iter().all(|chain| chain.first() == chain.last()));
    }

    #[test]
    fn the_term_has_the_gradient_of_differences_and_the_curvature_of_gauss_and_newton() {
        let source = shapes::annulus(1.0, 2.0, 24, 4);
        let mut mesh = source.clone();
        for (i, p) in mesh.positions_mut().as_mut_slice().iter_mut().enumerate() {
            let wave = |k: f64| (k * (i as f64 + 1.0)).sin();
            *p += 0.06 * Vec3::new(wave(12.9898), wave(78.233), wave(37.719));
        }
        let networks = Networks::new(&source, Boundary::Hold, Features::Free);
        let sources = networks.sources(&source, 0.05);
        let mut curves = Curves::new(&sources, &networks, &mesh, 1.0, 0.02).unwrap();
        curves.set_weight(1.0);
        let mut x: Vec<f64> = mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        let mut gradient = vec![0.0; x.len()];
        assert!(curves.evaluate(&x, &mut gradient) > 0.0);
        let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        let mut unused = vec![0.0; x.len()];
        for i in 0..x.len() {
            let (here, h) = (x[i], 1e-6);
            let mut at = |x_i: f64| {
                x[i] = x_i;
                curves.evaluate(&x, &mut unused)
            };
            let difference = (at(here + h) - at(here - h)) / (2.0 * h);
            x[i] = here;
            assert!((difference - gradient[i]).abs() < 1e-7 * largest, "{i}: {difference} {}", gradient[i]);
        }
        // The quadratic form of the blocks is that of the derivatives of the residuals.
        let v: Vec<f64> = (0..x.len()).map(|i| (1.7 * i as f64).sin()).collect();
        curves.holds.clear();
        let mut form = 0.0;
        curves.curvature(&x, |a, b, block| {
            let twice = if a == b { 1.0 } else { 2.0 };
            form += twice * position(&v, a).dot(&(block * position(&v, b)));
        });
        let residuals = |t: f64| -> Vec<Vec3> {
            let at = |k: u32| position(&x, k) + t * position(&v, k);
            curves.runs.iter().map(|run| fairness(run.map(at)).0).collect()
        };
        let (ahead, behind) = (residuals(1e-6), residuals(-1e-6));
        let expected: f64 =
            ahead.iter().zip(&behind).map(|(a, b)| 2.0 * FAIRNESS * ((a - b) / 2e-6).norm_squared()).sum();
        assert!((form - expected).abs() < 1e-6 * expected, "{form} {expected}");
    }

    #[test]
    fn distances_of_curves_are_proven() {
        let (inner, outer) = (shapes::annulus(1.0, 2.0, 64, 4), shapes::annulus(1.1, 2.05, 64, 4));
        let networks = [&inner, &outer].map(Network::boundary);
        let found = networks[0].distance(&inner, (&networks[1], &outer), 0.01, &Monitor::silent()).unwrap().unwrap();
        assert!(found.lower <= 0.1 + 1e-12 && found.upper >= 0.1 - 1e-3 && found.upper < 0.1015, "{found:?}");
        let closed = shapes::icosphere(1.0, 1);
        let none = Network::boundary(&closed);
        assert_eq!(none.distance(&closed, (&none, &closed), 0.01, &Monitor::silent()), Ok(None));
    }
}
