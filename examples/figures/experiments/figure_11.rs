//! An ellipsoid under the covariance energy and under the total variation of its normals, an L1 norm.
use super::{
    Figure, GUARDED, Report, descend, energy,
    measures::{bends, defects, facet_number, quantile, top_share},
    moved, noisy,
};
use fabricate::{geom::Vec3, mesh::shapes};

pub(super) const FIGURE: Figure = Figure {
    number: 11,
    claim: "a developability energy gathers curvature on few seams between curved pieces; an L1 norm makes flat facets",
    run,
};

/// Faces that bend less than this against each other belong to one facet, degrees.
const FLAT: f64 = 0.1;

fn run(report: &mut Report) {
    let start = noisy(&moved(&shapes::icosphere(1.0, 3), |p| Vec3::new(1.5 * p.x, p.y, 0.8 * p.z)), 0.02, 10);
    let [curved, flat] = ["covariance", "l1"].map(|name| descend(&start, energy(name), GUARDED, 1500).0);
    for (name, mesh) in [("start", &start), ("covariance", &curved), ("l1", &flat)] {
        report.show(name, mesh);
        let bends = bends(mesh);
        report.note(format!(
            "{name}: facets {:.0}, top 5 % hold {:.2} of the defect, median defect {:.1e}, bends (25, 50, 75 %) {:.2?}°",
            facet_number(mesh, FLAT),
            top_share(mesh),
            quantile(&defects(mesh), 0.5),
            [0.25, 0.5, 0.75].map(|it| quantile(&bends, it)),
        ));
    }
    report.at_least("covariance: share of the defect on 5 % of the vertices", top_share(&curved), 0.6);
    let ratio = quantile(&defects(&curved), 0.5) / quantile(&defects(&start), 0.5);
    report.at_most("covariance: median defect over that of the start", ratio, 0.1);
    report.at_least("covariance: facets, counted by area", facet_number(&curved, FLAT), 400.0);
    report.at_most("l1: facets, counted by area", facet_number(&flat, FLAT), 200.0);
}
