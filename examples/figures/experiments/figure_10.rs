//! A blob under three energies, and single cones that flatten or grow into spikes.
use super::{
    FREE, Figure, GUARDED, Report, descend, energy,
    measures::{cones, hinge_share, total},
    moved, noisy,
};
use fabricate::{
    geom::Vec3,
    mesh::{TriMesh, VertexId, distance::SurfaceDistance, shapes},
    stages::develop::folded_edges,
};

pub(super) const FIGURE: Figure = Figure {
    number: 10,
    claim: "all energies lead to piecewise developable shapes, not the same; the intrinsic one makes fewer spikes",
    run,
};

const ENERGIES: [&str; 3] = ["combinatorial", "covariance", "intrinsic"];
/// Half apertures of the cones, degrees. The covariance energy of a cone, 2π s · min(s², (1 − s²)/2) with s the sine, has its
/// ridge at 35.3°: blunter ones flatten, sharper ones lose energy by growing. That of the intrinsic one, π s acos² s, is at
/// 28.4°.
const CONES: [f64; 3] = [30.0, 32.0, 34.0];

fn run(report: &mut Report) {
    let start = blob();
    report.show("start", &start);
    let mut ends = Vec::new();
    for name in ENERGIES {
        let (mesh, _) = descend(&start, energy(name), GUARDED, 400);
        report.show(name, &mesh);
        let ratio = total(&mesh, energy(name)) / total(&start, energy(name));
        report.at_most(&format!("{name}: its energy over that of the start"), ratio, 0.15);
        report.at_least(&format!("{name}: share of hinges (none at the start)"), hinge_share(&mesh, 2.0), 0.6);
        report.at_most(&format!("{name}: folded edges"), folded_edges(&mesh).len() as f64, 0.0);
        ends.push(mesh);
    }
    let apart =
        |a: usize, b: usize| 100.0 * SurfaceDistance::between(&ends[a], &ends[b]).mean / start.bounds().diagonal();
    for [a, b] in [[0, 1], [1, 2]] {
        let what = format!("{} and {}: mean distance between the ends, percent", ENERGIES[a], ENERGIES[b]);
        report.at_least(&what, apart(a, b), 0.5);
    }

    for half_aperture in CONES {
        for name in ENERGIES {
            let (mesh, _) = descend(&cone(half_aperture), energy(name), FREE, 1000);
            let (apex, steepest) = (mesh.angle_defect(VertexId(0)), cones(&mesh)[0]);
            let what = format!("{name}: cone of {half_aperture}°, angle defect");
            if name == "covariance" {
                report.at_least(&what, apex, 5.0);
                report.at_least(
                    &format!("{name}: cone of {half_aperture}°, normals from the axis, degrees"),
                    steepest,
                    89.0,
                );
            } else {
                report.at_most(&what, apex.abs(), 1e-3);
            }
        }
    }
}

/// A star-shaped blob.
pub(super) fn blob() -> TriMesh {
    let radius = |p: &Vec3| 1.0 + 0.3 * (3.0 * p.x).sin() * (2.0 * p.y + 1.0).cos() + 0.15 * (4.0 * p.z).sin();
    noisy(&moved(&shapes::icosphere(1.0, 3), |p| p * radius(p)), 0.02, 10)
}

/// A single star with the slant 1, slightly wider in one direction.
fn cone(half_aperture: f64) -> TriMesh {
    const FACES: u32 = 12;
    let (radius, height) = half_aperture.to_radians().sin_cos();
    let mut points = vec![Vec3::new(0.0, 0.0, height)];
    points.extend((0..FACES).map(|i| {
        let angle = std::f64::consts::TAU * f64::from(i) / f64::from(FACES);
        Vec3::new(1.02 * radius * angle.cos(), radius * angle.sin(), 0.0)
    }));
    let faces: Vec<[u32; 3]> = (0..FACES).map(|i| [0, 1 + i, 1 + (i + 1) % FACES]).collect();
    TriMesh::new(points, &faces).expect("a cone is a mesh")
}
