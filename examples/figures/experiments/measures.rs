//! Measures of a mesh that several figures compare.
use super::coordinates;
use fabricate::{
    geom::{Vec3, angle_between},
    mesh::{HalfedgeId, Id, TriMesh, VertexId},
    stages::develop::{Defects, Evaluator, Weights, energy::Energy},
};

/// `energy` of every vertex.
pub(super) fn energies(mesh: &TriMesh, energy: &'static Energy) -> Vec<f64> {
    let mut evaluator = Evaluator::new(mesh, energy, Weights::default());
    let x = coordinates(mesh);
    evaluator.evaluate(&x, &mut vec![0.0; x.len()]);
    evaluator.energies()
}

/// Sum of `energy`.
pub(super) fn total(mesh: &TriMesh, energy: &'static Energy) -> f64 {
    energies(mesh, energy).iter().sum()
}

/// Vertices that are not on the boundary.
pub(super) fn inner(mesh: &TriMesh) -> impl Iterator<Item = VertexId> + '_ {
    mesh.vertices().filter(|&v| !mesh.is_boundary_vertex(v))
}

/// |Angle defect| of every inner vertex, radians.
pub(super) fn defects(mesh: &TriMesh) -> Vec<f64> {
    inner(mesh).map(|v| mesh.angle_defect(v).abs()).collect()
}

/// Angles between neighbouring faces, degrees.
pub(super) fn bends(mesh: &TriMesh) -> Vec<f64> {
    mesh.edges().filter_map(|e| crease(mesh, mesh.halfedge(e))).collect()
}

/// Angles between the normals of two meshes with the same faces, degrees.
pub(super) fn tilts(a: &TriMesh, b: &TriMesh) -> Vec<f64> {
    a.faces().map(|f| angle_between(a.normal(f), b.normal(f)).to_degrees()).collect()
}

/// Largest angle between a normal and the vertex normal around each inner vertex, degrees: near 90 for a spike.
pub(super) fn cones(mesh: &TriMesh) -> Vec<f64> {
    inner(mesh)
        .map(|v| {
            let normal = mesh.outgoing(v).map(|h| mesh.area_vector(mesh.face(h))).sum::<Vec3>();
            let angles = mesh.outgoing(v).map(|h| angle_between(mesh.normal(mesh.face(h)), normal).to_degrees());
            angles.fold(0.0, f64::max)
        })
        .collect()
}

/// Root of the mean square.
pub(super) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// The value below which the share `at` of all lie.
pub(super) fn quantile(values: &[f64], at: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[(at * (sorted.len() - 1) as f64).round() as usize]
}

/// Angle between the faces on both sides of an edge, degrees; none on the boundary.
pub(super) fn crease(mesh: &TriMesh, h: HalfedgeId) -> Option<f64> {
    mesh.dihedral_cosine(mesh.edge(h)).map(|c| c.clamp(-1.0, 1.0).acos().to_degrees())
}

/// Angles across the edges around a vertex, degrees, sharpest first.
pub(super) fn creases(mesh: &TriMesh, v: VertexId) -> Vec<f64> {
    let mut out: Vec<f64> = mesh.outgoing(v).filter_map(|h| crease(mesh, h)).collect();
    out.sort_by(|a, b| b.total_cmp(a));
    out
}

/// Share of the inner vertices that are hinges (SGC definition 3.1), flat ones included: only two edges bend by more than
/// `tolerance` degrees.
pub(super) fn hinge_share(mesh: &TriMesh, tolerance: f64) -> f64 {
    share(mesh, |v| creases(mesh, v).get(2).is_none_or(|&third| third <= tolerance))
}

/// Share of the inner vertices without an edge that bends by more than `tolerance` degrees.
pub(super) fn flat_share(mesh: &TriMesh, tolerance: f64) -> f64 {
    share(mesh, |v| creases(mesh, v).first().is_none_or(|&sharpest| sharpest <= tolerance))
}

fn share(mesh: &TriMesh, is_so: impl Fn(VertexId) -> bool) -> f64 {
    inner(mesh).filter(|&v| is_so(v)).count() as f64 / inner(mesh).count() as f64
}

/// Share of Σ|angle defect| that the top 5 % of the inner vertices hold.
pub(super) fn top_share(mesh: &TriMesh) -> f64 {
    Defects::of(mesh).top5_share
}

/// How many flat facets of equal size would be as uneven as those of the mesh, (Σ A)²/Σ A². Faces that bend by less than
/// `tolerance` degrees against each other belong to one facet.
pub(super) fn facet_number(mesh: &TriMesh, tolerance: f64) -> f64 {
    let cosine = tolerance.to_radians().cos();
    let mut facet: Vec<usize> = (0..mesh.face_count()).collect();
    fn root(facet: &[usize], mut f: usize) -> usize {
        while facet[f] != f {
            f = facet[f];
        }
        f
    }
    for h in mesh.halfedges() {
        if let Some(twin) = mesh.twin(h)
            && mesh.dihedral_cosine(mesh.edge(h)).is_some_and(|it| it > cosine)
        {
            let (a, b) = (root(&facet, mesh.face(h).index()), root(&facet, mesh.face(twin).index()));
            facet[a.max(b)] = a.min(b);
        }
    }
    let mut areas = vec![0.0; mesh.face_count()];
    mesh.faces().for_each(|f| areas[root(&facet, f.index())] += mesh.area(f));
    mesh.total_area().powi(2) / areas.iter().map(|a| a * a).sum::<f64>()
}
