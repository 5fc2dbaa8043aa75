//! Symmetries of a mesh: rigid motions and reflections that map it onto itself, face by face.
use nalgebra::Matrix3;

use super::{Field, HalfedgeId, Id, TriMesh, VertexId};
use crate::geom::Vec3;

/// x ↦ linear · x + offset, with an orthogonal matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Isometry {
    /// A rotation or, with determinant −1, a reflection.
    pub linear: Matrix3<f64>,
    /// In the unit of the positions.
    pub offset: Vec3,
}

impl Isometry {
    /// Where a point goes.
    pub fn of(&self, point: &Vec3) -> Vec3 {
        self.linear * point + self.offset
    }

    /// The one with the least squared distance between the images of `from` and `to`; a reflection where `mirrored`.
    fn between(from: &[Vec3], to: &[Vec3], mirrored: bool) -> Self {
        let middle = |points: &[Vec3]| points.iter().sum::<Vec3>() / points.len() as f64;
        let (a, b) = (middle(from), middle(to));
        let spread: Matrix3<f64> = from.iter().zip(to).map(|(p, q)| (p - a) * (q - b).transpose()).sum();
        let svd = spread.svd(true, true);
        let (u, v) = (svd.u.unwrap_or_default(), svd.v_t.unwrap_or_default().transpose());
        let least = svd.singular_values.imin();
        let mut signs = Vec3::repeat(1.0);
        signs[least] = if mirrored { -1.0 } else { 1.0 } * (v * u.transpose()).determinant().signum();
        let linear = v * Matrix3::from_diagonal(&signs) * u.transpose();
        Self { linear, offset: b - linear * a }
    }
}

/// A symmetry of a mesh that undoes itself.
#[derive(Debug, Clone)]
struct Involution {
    motion: Isometry,
    /// Image of every vertex.
    image: Vec<u32>,
}

/// Mirror planes, half-turns and the inversion of a mesh, as far as they commute: a group of at most eight.
///
/// Rotations of a higher order are left out. On the axis of one, two eigenvalues of any tensor are equal for ever, and a flow
/// that is led by the eigenvector of the smaller one has nowhere to go.
#[derive(Debug, Clone, Default)]
pub struct Symmetries {
    /// Every element of the group is a product of some of these.
    generators: Vec<Involution>,
}

impl Symmetries {
    /// The symmetries of a connected mesh up to `tolerance`, of those that `keeps` accepts; of several groups the one that
    /// is best aligned with the axes of coordinates. None where the mesh has several components, or where more than
    /// 256 vertices are alike, as on a surface of revolution.
    pub fn of(mesh: &TriMesh, tolerance: f64, keeps: impl Fn(&Isometry) -> bool) -> Self {
        let Some((at, class)) = rarest(mesh, tolerance) else { return Self::default() };
        let Some(start) = mesh.outgoing(at).next() else { return Self::default() };
        let identity: Vec<u32> = (0..mesh.vertex_count() as u32).collect();
        let positions = mesh.positions().as_slice();
        let mut found: Vec<Involution> = Vec::new();
        for v in class {
            for (h, mirrored) in mesh.outgoing(v).flat_map(|h| [(h, false), (mesh.previous(h), true)]) {
                let Some(image) = extended(mesh, start, h, mirrored, tolerance) else { continue };
                if image == identity || product(&image, &image) != identity {
                    continue;
                }
                let images: Vec<Vec3> = image.iter().map(|&v| positions[v as usize]).collect();
                let motion = Isometry::between(positions, &images, mirrored);
                let near = |(p, q): (&Vec3, &Vec3)| (motion.of(p) - q).norm() <= tolerance;
                if positions.iter().zip(&images).all(near) && keeps(&motion) {
                    found.push(Involution { motion, image });
                }
            }
        }
        // Steps of a thousandth, so that rounding does not decide.
        let aligned = |it: &Involution| (1e3 * it.motion.linear.diagonal().abs().sum()).round() as i64;
        found.sort_by_key(|it| (-aligned(it), it.motion.linear.determinant() > 0.0));
        let (mut generators, mut group) = (Vec::<Involution>::new(), vec![identity]);
        for it in found {
            let commutes = generators.iter().all(|g| product(&g.image, &it.image) == product(&it.image, &g.image));
            if commutes && !group.contains(&it.image) {
                group.extend(group.iter().map(|other| product(&it.image, other)).collect::<Vec<_>>());
                generators.push(it);
            }
        }
        Self { generators }
    }

    /// Number of elements, the identity among them.
    pub fn order(&self) -> usize {
        1 << self.generators.len()
    }

    /// Replaces a vector per vertex (x, y, z after one another) by the mean of its images: the nearest field that every
    /// symmetry leaves as it is.
    pub fn symmetrize(&self, field: &mut [f64]) {
        let at = |field: &[f64], v: usize| Vec3::new(field[3 * v], field[3 * v + 1], field[3 * v + 2]);
        for Involution { motion, image } in &self.generators {
            for (v, w) in image.iter().enumerate().map(|(v, &w)| (v, w as usize)).filter(|(v, w)| v <= w) {
                let mean = (at(field, v) + motion.linear * at(field, w)) / 2.0;
                field[3 * w..3 * w + 3].copy_from_slice((motion.linear * mean).as_slice());
                field[3 * v..3 * v + 3].copy_from_slice(mean.as_slice());
            }
        }
    }
}

/// First `b`, then `a`.
fn product(a: &[u32], b: &[u32]) -> Vec<u32> {
    b.iter().map(|&v| a[v as usize]).collect()
}

/// Most vertices that may be alike.
const MOST: usize = 256;

/// A vertex with few others at its distance from the centre, and all of these, itself among them; `None` if there are many.
fn rarest(mesh: &TriMesh, tolerance: f64) -> Option<(VertexId, Vec<VertexId>)> {
    let positions = mesh.positions().as_slice();
    let centre = positions.iter().sum::<Vec3>() / positions.len() as f64;
    let radii = Field::<VertexId, f64>::from_vec(positions.iter().map(|p| (p - centre).norm()).collect());
    let mut order: Vec<VertexId> = mesh.vertices().collect();
    order.sort_by(|&a, &b| radii[a].total_cmp(&radii[b]).then(a.cmp(&b)));
    let classes = order.chunk_by(|&a, &b| radii[b] - radii[a] <= 2.0 * tolerance);
    let class = classes.min_by_key(|it| it.len())?;
    let at = *class.first()?;
    let class: Vec<_> = class.iter().copied().filter(|&v| mesh.face_degree(v) == mesh.face_degree(at)).collect();
    (class.len() <= MOST).then_some((at, class))
}

/// The images of all vertices if halfedge `start` goes to `goal` (reversed where `mirrored`) and all edges keep their length.
fn extended(mesh: &TriMesh, start: HalfedgeId, goal: HalfedgeId, mirrored: bool, tolerance: f64) -> Option<Vec<u32>> {
    let mut halfedges: Field<HalfedgeId, Option<HalfedgeId>> = Field::filled(mesh.halfedge_count(), None);
    let mut vertices = vec![u32::MAX; mesh.vertex_count()];
    let mut open = vec![(start, goal)];
    let mut faces = 0;
    while let Some((h, to)) = open.pop() {
        if let Some(known) = halfedges[h] {
            if known != to {
                return None;
            }
            continue;
        }
        faces += 1;
        let (mut h, mut to) = (h, to);
        for _ in 0..3 {
            halfedges[h] = Some(to);
            if (mesh.vector(h).norm() - mesh.vector(to).norm()).abs() > 2.0 * tolerance {
                return None;
            }
            match (mesh.twin(h), mesh.twin(to)) {
                (Some(h), Some(to)) => open.push((h, to)),
                (None, None) => (),
                _ => return None,
            }
            let image = if mirrored { mesh.head(to) } else { mesh.tail(to) };
            let known = &mut vertices[mesh.tail(h).index()];
            if *known != u32::MAX && *known != image.0 {
                return None;
            }
            *known = image.0;
            (h, to) = (mesh.next(h), if mirrored { mesh.previous(to) } else { mesh.next(to) });
        }
    }
    (faces == mesh.face_count()).then_some(vertices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn order(mesh: &TriMesh) -> usize {
        Symmetries::of(mesh, 1e-6, |_| true).order()
    }

    #[test]
    fn commuting_symmetries_of_known_bodies_are_found() {
        assert_eq!(order(&shapes::icosphere(1.0, 0)), 8);
        assert_eq!(order(&shapes::icosphere(1.0, 2)), 8);
        // One corner moved along its axis: of ten symmetries, the largest commuting group of involutions is one mirror.
        let mut dented = shapes::icosphere(1.0, 2);
        dented.positions_mut()[VertexId(0)] *= 0.9;
        assert_eq!(order(&dented), 2);
        dented.positions_mut()[VertexId(20)] *= 0.97;
        dented.positions_mut()[VertexId(50)] *= 0.95;
        assert_eq!(order(&dented), 1);
        let turns = Symmetries::of(&shapes::icosphere(1.0, 1), 1e-6, |it| it.linear.determinant() > 0.0);
        assert_eq!(turns.order(), 4);
        // All vertices of a flat square grid that are alike are no more than eight, however many there are.
        assert_eq!(order(&shapes::grid(40, 40, 1.0)), 4);
        assert_eq!(order(&shapes::cylinder(1.0, 2.0, 300, 2)), 1);
    }

    #[test]
    fn fields_are_projected_onto_those_that_every_symmetry_keeps() {
        let mesh = shapes::icosphere(1.0, 2);
        let group = Symmetries::of(&mesh, 1e-6, |_| true);
        let largest = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let radial: Vec<f64> = mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        let mut field = radial.clone();
        group.symmetrize(&mut field);
        assert!(largest(&field, &radial) < 1e-14);
        let mut noise: Vec<f64> = (0..field.len()).map(|i| (12.9898 * (i as f64 + 1.0)).sin()).collect();
        group.symmetrize(&mut noise);
        let once = noise.clone();
        group.symmetrize(&mut noise);
        assert!(largest(&noise, &once) < 1e-14);
        for it in &group.generators {
            for (v, &w) in it.image.iter().enumerate() {
                let at = |v: usize| Vec3::from_column_slice(&once[3 * v..3 * v + 3]);
                assert!((it.motion.linear * at(v) - at(w as usize)).norm() < 1e-14);
            }
        }
    }
}
