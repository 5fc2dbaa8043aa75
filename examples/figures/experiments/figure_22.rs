//! A blob instead of the bunny, with one subdivision.
use super::{Figure, GUARDED, Report, descend, energy, figure_10::blob};
use fabricate::{stages::develop::Defects, surface::subdivide};

pub(super) const FIGURE: Figure = Figure { number: 22, claim: "Gauss curvature gathers on few curves", run };

fn run(report: &mut Report) {
    let start = blob();
    let before = Defects::of(&start);
    report.show("start", &start);
    report.note(format!("start: top 5 % hold {:.3}, median {:.1e}", before.top5_share, before.median));
    for name in ["covariance", "intrinsic"] {
        let (coarse, _) = descend(&start, energy(name), GUARDED, 300);
        report.show(&format!("{name}-coarse"), &coarse);
        let after = Defects::of(&coarse);
        report.at_least(&format!("{name}: share of the curvature that the top 5 % hold"), after.top5_share, 0.5);
        report.at_most(&format!("{name}: median defect over that of the start"), after.median / before.median, 0.05);

        let fine = subdivide(&coarse).expect("no face of the coarse mesh is degenerate");
        let (fine, _) = descend(&fine, energy(name), GUARDED, 300);
        report.show(&format!("{name}-fine"), &fine);
        let after = Defects::of(&fine);
        report.at_least(&format!("{name}, subdivided: share that the top 5 % hold"), after.top5_share, 0.8);
        report.at_most(
            &format!("{name}, subdivided: median defect over that of the start"),
            after.median / before.median,
            0.005,
        );
    }
}
