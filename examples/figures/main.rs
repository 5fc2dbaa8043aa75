//! Repeats experiments of Stein, Grinspun and Crane, "Developability of Triangle Meshes" (2018), by the number of their figure:
//! `cargo run --release --example figures -- [--out FOLDER] [FIGURE…]`; without a number, all of them.
//!
//! Prints what was measured and what the figure claims, writes meshes and pictures to the folder, and exits with 1 if a claim
//! does not hold.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "it is a program")]
mod experiments;

use experiments::{FIGURES, Report};
use std::{path::PathBuf, process::ExitCode, time::Instant};

fn main() -> ExitCode {
    let (mut numbers, mut folder) = (Vec::new(), None);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        if arg == "--out" {
            folder = args.next().map(PathBuf::from);
        } else if let Some(number) = arg.parse().ok().filter(|it| FIGURES.iter().any(|figure| figure.number == *it)) {
            numbers.push(number);
        } else {
            let known: Vec<_> = FIGURES.iter().map(|it| it.number.to_string()).collect();
            eprintln!("`{arg}` is no figure that is repeated here; there are {}", known.join(", "));
            return ExitCode::from(2);
        }
    }
    if let Some(folder) = &folder
        && let Err(error) = std::fs::create_dir_all(folder)
    {
        eprintln!("{}: {error}", folder.display());
        return ExitCode::from(2);
    }
    let mut failed = Vec::new();
    for figure in FIGURES.iter().filter(|it| numbers.is_empty() || numbers.contains(&it.number)) {
        println!("Figure {}: {}", figure.number, figure.claim);
        let start = Instant::now();
        let mut report = Report::new(figure.number, folder.as_deref());
        // Within the pool: small meshes would spend their time on handing work over to it.
        rayon::scope(|_| (figure.run)(&mut report));
        report.lines.iter().for_each(|line| println!("  {line}"));
        println!("  {:.1} s", start.elapsed().as_secs_f64());
        if !report.failures.is_empty() {
            failed.push(figure.number);
        }
    }
    if failed.is_empty() {
        return ExitCode::SUCCESS;
    }
    println!("claims that do not hold: in figures {failed:?}");
    ExitCode::FAILURE
}
