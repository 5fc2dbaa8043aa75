//! How densely parts are nested: strip packing of instances in the format of the ESICUP data sets, by the share of the used
//! strip that is covered.
//!
//!     cargo bench --bench nest -- SECONDS FILE.json…
//!
//! runs each file for so many seconds of processor time on one thread, so that a busy machine changes nothing;
//! `benches/nest_beside_spyrrow.py` puts another program's figures beside them. Without arguments it nests stars and says
//! how much the search saves over the first packing. A file may state a `gap` besides, and items without
//! `allowed_orientations` lie at any angle.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a program for the terminal, and broken input may stop it"
)]

use std::{f64::consts::PI, time::Instant};

use fabricate::{
    geom::{Box2, Vec2, polygon, signed_area},
    model::{Part, Parts, Sheets},
    numeric::Monitor,
    stages::nest::{Options, Rotations, measure, nest},
};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|it| it != "--bench").collect();
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap();
    let Some((seconds, files)) = args.split_first() else { return stars() };
    for file in files {
        let Instance { parts, width, gap, part_rotations } = instance(file);
        let (start, begun) = (Instant::now(), processor_seconds());
        let monitor = Monitor::new(&|| false, &|_, _| (), &processor_seconds);
        let seconds = Some(seconds.parse().unwrap());
        let options = Options { part_rotations, gap, ..options(&parts, width, Rotations::Free(8), EVER, seconds) };
        let sheets = nest(&parts, &options, &monitor).unwrap();
        let found = measure(&sheets);
        assert!(found.overlaps.is_empty() && sheets.sheets.len() == 1 && sheets.unplaced.is_empty());
        assert!(found.gap.is_none_or(|it| it.0 >= gap));
        let (spent, wall) = (processor_seconds() - begun, start.elapsed().as_secs_f64());
        println!("{file} {:.3} % in {spent:.1} s of processor, {wall:.1} s", 100.0 * density(&sheets, width));
    }
}

/// An effort that no search spends.
const EVER: usize = usize::MAX / 2000;

/// User seconds of this process; where the system does not tell, those of the clock.
fn processor_seconds() -> f64 {
    // Field 14 of proc(5)'s stat, in the customary 100 ticks a second; the name in field 2 has no blanks here.
    let stat = std::fs::read_to_string("/proc/self/stat").ok();
    let ticks = stat.and_then(|it| it.split(' ').nth(13)?.parse::<f64>().ok());
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    ticks.map_or_else(|| START.elapsed().as_secs_f64(), |it| it / 100.0)
}

struct Instance {
    parts: Parts,
    /// Fixed width of the strip, mm.
    width: f64,
    gap: f64,
    part_rotations: Vec<(String, Rotations)>,
}

/// The strips of the data run along x, ours along y.
fn instance(file: &str) -> Instance {
    let data: serde_json::Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    let (mut parts, mut part_rotations) = (Parts::default(), Vec::new());
    for item in data["items"].as_array().unwrap() {
        let point = |it: &serde_json::Value| Vec2::new(-it[1].as_f64().unwrap(), it[0].as_f64().unwrap());
        let mut points: Vec<Vec2> = item["shape"]["data"].as_array().unwrap().iter().map(point).collect();
        points.dedup();
        if points.first() == points.last() {
            points.pop();
        }
        if signed_area(&points) < 0.0 {
            points.reverse();
        }
        for copy in 0..item["demand"].as_u64().unwrap() {
            let name = format!("{}-{copy}", item["id"]);
            if let Some(degrees) = item["allowed_orientations"].as_array() {
                let angles = degrees.iter().map(|it| it.as_f64().unwrap().to_radians()).collect();
                part_rotations.push((name.clone(), Rotations::Only(angles)));
            }
            parts.parts.push(Part { name, contours: vec![points.clone()], marks: vec![] });
        }
    }
    let number = |key: &str| data[key].as_f64();
    Instance { parts, width: number("strip_height").unwrap(), gap: number("gap").unwrap_or(0.0), part_rotations }
}

fn area(parts: &[Part]) -> f64 {
    parts.iter().map(|it| polygon::area(&it.contours)).sum()
}

fn options(parts: &Parts, width: f64, rotations: Rotations, effort: usize, seconds: Option<f64>) -> Options {
    Options {
        stock: vec![Vec2::new(width, 3.0 * area(&parts.parts) / width)],
        margin: 0.0,
        gap: 0.0,
        rotations,
        part_rotations: vec![],
        cell: width / 300.0,
        effort,
        seconds,
        seed: 0,
    }
}

fn density(sheets: &Sheets, width: f64) -> f64 {
    let parts = &sheets.sheets[0].parts;
    let top = Box2::of(parts.iter().flat_map(|it| &it.contours[0])).max.y;
    area(parts) / (width * top)
}

fn stars() {
    let star = |k: usize| {
        let (points, radius) = (3 + k % 5, 15.0 + (7 * k % 23) as f64);
        let at = |i: usize| {
            let (turn, r) = (PI * i as f64 / points as f64, if i.is_multiple_of(2) { radius } else { 0.5 * radius });
            Vec2::new(turn.cos(), turn.sin()) * r
        };
        Part { name: format!("star {k}"), contours: vec![(0..2 * points).map(at).collect()], marks: vec![] }
    };
    let parts = Parts { parts: (0..40).map(star).collect(), ..Parts::default() };
    for effort in [0, 400, 4000] {
        let start = Instant::now();
        let options = options(&parts, 300.0, Rotations::Free(8), effort, None);
        let sheets = nest(&parts, &options, &Monitor::silent()).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        println!("effort {effort:>5}: {:.1} % covered, {seconds:.2} s", 100.0 * density(&sheets, 300.0));
    }
}
