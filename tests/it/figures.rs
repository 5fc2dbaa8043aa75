//! The experiments of the paper: their claims hold.
use rayon::prelude::*;

#[path = "../../examples/figures/experiments/mod.rs"]
mod experiments;

use experiments::{FIGURES, Report};

#[test]
fn the_claims_of_the_figures_hold() {
    let failures: Vec<String> = FIGURES
        .par_iter()
        .flat_map_iter(|figure| {
            let mut report = Report::new(figure.number, None);
            (figure.run)(&mut report);
            assert!(report.lines.len() >= 4, "figure {} claims nothing", figure.number);
            report.failures.into_iter().map(|it| format!("figure {} ({}): {it}", figure.number, figure.claim))
        })
        .collect();
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}
