//! A noisy sheet, bent to half a cylinder.
use super::{
    FREE, Figure, Report, descend, energy,
    measures::{bends, defects, hinge_share, quantile, rms, tilts, total},
    moved, noisy,
};
use fabricate::{geom::Vec3, mesh::shapes};

pub(super) const FIGURE: Figure = Figure {
    number: 7,
    claim: "without angle defects a noisy sheet can be flattened but stays crumpled; developable, it is smooth and ruled",
    run,
};

/// Radius of the cylinder in edges.
const RADIUS: f64 = 10.0;
/// Noise in edges.
const NOISE: f64 = 0.12;

fn run(report: &mut Report) {
    let clean = moved(&shapes::grid(30, 20, 1.0), |p| {
        let angle = p.x / RADIUS;
        Vec3::new(RADIUS * angle.sin(), p.y, -RADIUS * angle.cos())
    });
    let start = noisy(&clean, NOISE, 7);
    report.show("noisy", &start);
    report.note(format!(
        "noisy: largest defect {:.2e}, bends {:.2}°",
        quantile(&defects(&start), 1.0),
        rms(&bends(&start))
    ));

    let (crumpled, _) = descend(&start, energy("angle-defect"), FREE, 1000);
    report.show("angle-defect", &crumpled);
    report.at_most("angle defect: largest defect, so it can be flattened", quantile(&defects(&crumpled), 1.0), 1e-5);
    report.at_most("angle defect: share of hinges", hinge_share(&crumpled, 1.0), 0.1);
    report.at_least("angle defect: bends over those of the noise", rms(&bends(&crumpled)) / rms(&bends(&start)), 0.5);

    for name in ["covariance", "combinatorial", "intrinsic"] {
        let (mesh, _) = descend(&start, energy(name), FREE, 300);
        report.show(name, &mesh);
        report.at_least(&format!("{name}: share of hinges, so it is ruled"), hinge_share(&mesh, 1.0), 0.95);
        report.at_most(
            &format!("{name}: largest defect, so it can be flattened"),
            quantile(&defects(&mesh), 1.0),
            1e-3,
        );
        let ratio = rms(&tilts(&mesh, &clean)) / rms(&tilts(&start, &clean));
        report.at_most(&format!("{name}: error of the normals over that of the noise"), ratio, 0.5);
        let ratio = total(&mesh, energy("covariance")) / total(&crumpled, energy("covariance"));
        report.at_most(&format!("{name}: covariance energy over that of the crumpled sheet"), ratio, 1e-3);
    }
}
