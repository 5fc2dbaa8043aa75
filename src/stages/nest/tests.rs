//! Laws of nesting, checked against brute force.
use std::f64::consts::{PI, TAU};

use super::*;
use crate::{
    geom::{
        Box2,
        polygon::{contains, edges, segment_distance},
    },
    model::Operation,
};

/// A star with `points` tips, with a hole where `hole` is not 0.
fn star(name: String, points: usize, radius: f64, hole: f64) -> Part {
    let ring = |r: f64, inner: f64, n: usize| -> Vec<Vec2> {
        (0..2 * n)
            .map(|k| turned(Vec2::new(if k.is_multiple_of(2) { r } else { inner * r }, 0.0), PI * k as f64 / n as f64))
            .collect()
    };
    let mut contours = vec![ring(radius, 0.5, points)];
    if hole > 0.0 {
        contours.push(ring(hole, 0.9, 8).into_iter().rev().collect());
    }
    let mark = Mark {
        operation: Operation::Engrave,
        points: vec![Vec2::x() * 0.9 * radius, Vec2::x() * 0.92 * radius],
        closed: false,
    };
    Part { name, contours, marks: vec![mark] }
}

fn job(count: usize) -> Parts {
    let mut random = Random::new(7);
    let part = |k: usize| {
        let radius = 12.0 + 40.0 * random.unit();
        star(format!("P{k}"), 3 + random.below(6), radius, if k.is_multiple_of(5) { 0.3 * radius } else { 0.0 })
    };
    Parts { parts: (0..count).map(part).collect(), ..Parts::default() }
}

fn options() -> Options {
    Options {
        stock: vec![Vec2::new(420.0, 297.0)],
        margin: 5.0,
        gap: 2.0,
        rotations: Rotations::Free(8),
        part_rotations: vec![],
        cell: 0.7,
        effort: 100,
        seconds: None,
        seed: 3,
    }
}

fn run(parts: &Parts, options: &Options) -> Sheets {
    nest(parts, options, &Monitor::silent()).unwrap()
}

/// Every pair of edges of every pair of parts, without any tree or grid.
fn check_by_brute_force(parts: &Parts, sheets: &Sheets) {
    let mut seen: Vec<usize> = sheets.sheets.iter().flat_map(|it| &it.placements).map(|it| it.part).collect();
    seen.sort_unstable();
    assert!(seen.windows(2).all(|w| w[0] != w[1]), "a part was placed twice");
    assert_eq!(seen.len() + sheets.unplaced.len(), parts.parts.len());
    for sheet in &sheets.sheets {
        for (part, placement) in sheet.parts.iter().zip(&sheet.placements) {
            let source = &parts.parts[placement.part];
            assert_eq!(part.name, source.name);
            assert_eq!(part.marks.len(), source.marks.len());
            assert!((area(&part.contours) - area(&source.contours)).abs() < 1e-6);
            let bounds = Box2::of(part.contours.iter().flatten());
            assert!(bounds.min.min() >= sheets.margin - 1e-9, "{}", bounds.min);
            assert!((sheet.size - bounds.max).min() >= sheets.margin - 1e-9, "{}", bounds.max);
        }
        for (i, a) in sheet.parts.iter().enumerate() {
            for b in &sheet.parts[i + 1..] {
                for (p, q) in a.contours.iter().flat_map(|it| edges(it)) {
                    for (r, s) in b.contours.iter().flat_map(|it| edges(it)) {
                        assert!(segment_distance(p, q, r, s) >= sheets.gap, "{} and {}", a.name, b.name);
                    }
                }
                assert!(!contains(&a.contours, b.contours[0][0]) && !contains(&b.contours, a.contours[0][0]));
            }
        }
    }
}

#[test]
fn parts_keep_gap_and_margin_on_as_many_sheets_as_it_takes() {
    let parts = job(60);
    for rotations in [Rotations::Free(8), Rotations::Only(vec![0.0, PI])] {
        let sheets = run(&parts, &Options { rotations: rotations.clone(), ..options() });
        assert!(sheets.sheets.len() > 1 && sheets.unplaced.is_empty());
        check_by_brute_force(&parts, &sheets);
        let found = measure(&sheets);
        assert!(found.overlaps.is_empty());
        assert!(found.gap.unwrap().0 >= 2.0 && found.margin.unwrap().0 >= 5.0 - 1e-9);
        if let Rotations::Only(angles) = rotations {
            assert!(sheets.sheets.iter().flat_map(|it| &it.placements).all(|it| angles.contains(&it.angle)));
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_sheets_on_any_number_of_threads() {
    let parts = job(25);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&parts, &options()))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn more_effort_is_never_worse() {
    let parts = job(30);
    let height = |effort: usize| {
        let sheets = run(&parts, &Options { effort, ..options() }).sheets;
        let last = &sheets[sheets.len() - 1];
        (sheets.len(), Box2::of(last.parts.iter().flat_map(|it| &it.contours[0])).max.y)
    };
    let (first, little, much) = (height(0), height(50), height(600));
    assert!(little <= first && much <= little, "{first:?}, {little:?}, {much:?}");
    assert!(much < first, "{much:?} after {first:?}");
}

#[test]
fn remnants_are_used_first_and_single_parts_keep_their_grain() {
    let parts = job(20);
    let stock = vec![Vec2::new(150.0, 120.0), Vec2::new(90.0, 260.0), Vec2::new(420.0, 297.0)];
    let grain = vec![("P3".to_owned(), Rotations::Only(vec![0.0, PI]))];
    let sheets = run(&parts, &Options { stock: stock.clone(), part_rotations: grain, ..options() });
    check_by_brute_force(&parts, &sheets);
    assert!(sheets.unplaced.is_empty() && sheets.sheets.len() > 2);
    for (k, sheet) in sheets.sheets.iter().enumerate() {
        assert_eq!(sheet.size, stock[k.min(2)]);
        assert!(k > 1 || !sheet.parts.is_empty(), "a remnant lies idle");
        let kept = sheet.placements.iter().filter(|it| it.part == 3);
        assert!(kept.clone().all(|it| [0.0, PI].contains(&it.angle)));
    }
}

#[test]
fn a_limit_in_seconds_ends_the_search_whatever_the_effort() {
    let parts = job(25);
    let start = std::time::Instant::now();
    let clock = || start.elapsed().as_secs_f64();
    let monitor = Monitor::new(&|| false, &|_, _| (), &clock);
    let hurried = Options { effort: usize::MAX / 2000, seconds: Some(0.05), ..options() };
    check_by_brute_force(&parts, &nest(&parts, &hurried, &monitor).unwrap());
}

#[test]
fn small_parts_go_into_holes() {
    let mut parts = Parts { parts: vec![star("ring".into(), 12, 130.0, 60.0)], ..Parts::default() };
    parts.parts.push(star("core".into(), 5, 40.0, 0.0));
    // Too low for the core to stand beside the ring.
    let sheets = run(&parts, &Options { stock: vec![Vec2::new(275.0, 275.0)], ..options() });
    assert_eq!(sheets.sheets.len(), 1);
    check_by_brute_force(&parts, &sheets);
}

#[test]
fn a_part_larger_than_the_sheet_is_named_with_its_size_and_the_others_lie_well() {
    let mut parts = job(4);
    parts.parts.insert(1, star("whale".into(), 40, 400.0, 0.0));
    let sheets = run(&parts, &options());
    assert_eq!(sheets.unplaced.len(), 1);
    assert!(
        sheets.unplaced[0].contains("whale") && sheets.unplaced[0].contains("797.5 × 797.5 mm"),
        "{:?}",
        sheets.unplaced
    );
    check_by_brute_force(&parts, &sheets);
    assert_eq!(sheets.sheets.iter().map(|it| it.parts.len()).sum::<usize>(), 4);
}

#[test]
fn a_long_part_lies_across_the_sheet_when_it_fits_only_there() {
    let bar = [[0., 0.], [470., 0.], [470., 4.], [0., 4.]].map(|[x, y]| Vec2::new(x, y)).to_vec();
    let part = Part { name: "bar".into(), contours: vec![bar], marks: vec![] };
    let parts = Parts { parts: vec![part], ..Parts::default() };
    let sheets = run(&parts, &options());
    assert!(sheets.unplaced.is_empty());
    check_by_brute_force(&parts, &sheets);
    let angle = sheets.sheets[0].placements[0].angle.rem_euclid(TAU / 4.0);
    assert!((0.2..1.3).contains(&angle));
    let fixed = run(&parts, &Options { rotations: Rotations::Only(vec![0.0]), ..options() });
    assert_eq!((fixed.sheets.len(), fixed.unplaced.len()), (0, 1));
}

#[test]
fn impossible_jobs_say_why() {
    let parts = job(2);
    let tight = Options { margin: 150.0, ..options() };
    assert!(matches!(nest(&parts, &tight, &Monitor::silent()), Err(NestError::NoRoom { .. })));
    let mut broken = job(2);
    broken.parts[1].contours[0][2].x = f64::NAN;
    assert_eq!(nest(&broken, &options(), &Monitor::silent()), Err(NestError::BadPart { name: "P1".into() }));
    let cancelled = Monitor::new(&|| true, &|_, _| (), &|| 0.0);
    assert_eq!(nest(&parts, &options(), &cancelled), Err(NestError::Cancelled(Cancelled)));
    assert_eq!(run(&Parts::default(), &options()).sheets, vec![]);
}

#[test]
fn measuring_finds_overlaps_gaps_and_margins() {
    let place = |name: &str, x: f64, y: f64| {
        let square = [[0., 0.], [10., 0.], [10., 10.], [0., 10.]].map(|[u, v]| Vec2::new(x + u, y + v)).to_vec();
        Part { name: name.into(), contours: vec![square], marks: vec![] }
    };
    let sheet = |parts: Vec<Part>| Sheets {
        sheets: vec![Sheet { size: Vec2::new(100.0, 50.0), parts, placements: vec![] }],
        margin: 1.0,
        gap: 1.0,
        unplaced: vec![],
    };
    let apart = measure(&sheet(vec![place("A", 2.0, 3.0), place("B", 15.0, 3.0)]));
    assert!(apart.overlaps.is_empty());
    assert_eq!((apart.gap.unwrap().0, apart.margin.unwrap().0), (3.0, 2.0));
    for (x, y) in [(4.0, 4.0), (12.0, 3.0), (2.0, 3.0)] {
        let found = measure(&sheet(vec![place("A", 2.0, 3.0), place("B", x, y)]));
        assert_eq!(found.overlaps, ["parts A and B on sheet 1"], "{x} {y}");
    }
    let heap = measure(&sheet(vec![place("A", 2.0, 3.0), place("B", 5.0, 6.0), place("C", 6.0, 2.0)]));
    assert_eq!(heap.overlaps.len(), 3);
    let mut small = place("B", 5.0, 6.0);
    small.contours[0].iter_mut().for_each(|p| *p = Vec2::new(5.0, 6.0) + (*p - Vec2::new(5.0, 6.0)) * 0.2);
    assert_eq!(measure(&sheet(vec![place("A", 2.0, 3.0), small])).overlaps.len(), 1);
    assert_eq!(measure(&sheet(vec![place("A", 95.0, 3.0)])).margin.unwrap().0, -5.0);
}

#[test]
fn a_last_sheet_that_becomes_empty_is_given_up_and_the_search_ends() {
    let rectangle = |name: &str, width: f64, height: f64| {
        let corners = [[0., 0.], [width, 0.], [width, height], [0., height]].map(|[x, y]| Vec2::new(x, y)).to_vec();
        Part { name: name.into(), contours: vec![corners], marks: vec![] }
    };
    let parts =
        Parts { parts: vec![rectangle("large", 99.0, 93.0), rectangle("small", 20.0, 6.5)], ..Parts::default() };
    // On a coarse grid the small part needs a second sheet; the search finds room for it in the 7 mm above the large one, which
    // cover so much of the sheet that doing without the second one is not tried as such.
    let coarse = Options {
        stock: vec![Vec2::new(100.0, 100.0)],
        margin: 0.0,
        gap: 0.1,
        rotations: Rotations::Only(vec![0.0]),
        cell: 5.0,
        ..options()
    };
    assert_eq!(run(&parts, &Options { effort: 0, ..coarse.clone() }).sheets.len(), 2);
    // A search without end would be stopped here, and be an error.
    let looks = std::sync::atomic::AtomicUsize::new(0);
    let patience = || looks.fetch_add(1, std::sync::atomic::Ordering::Relaxed) > 1_000_000;
    let monitor = Monitor::new(&patience, &|_, _| (), &|| 0.0);
    let sheets = nest(&parts, &coarse, &monitor).unwrap();
    assert_eq!(sheets.sheets.len(), 1);
    check_by_brute_force(&parts, &sheets);
}

#[test]
fn a_part_nearly_as_wide_as_the_sheet_may_lie_low() {
    let corners = [[0., 0.], [100., 0.], [50., 30.]].map(|[x, y]| Vec2::new(x, y)).to_vec();
    let part = Part { name: "A".into(), contours: vec![corners], marks: vec![] };
    let parts = Parts { parts: vec![part], ..Parts::default() };
    // At multiples of 45 degrees from its longest side it fits upright only, 70 mm high or more.
    let roll = Options {
        stock: vec![Vec2::new(98.0, 300.0)],
        margin: 0.0,
        gap: 0.1,
        rotations: Rotations::Free(8),
        ..options()
    };
    let sheets = run(&parts, &roll);
    let height = Box2::of(sheets.sheets[0].parts[0].contours.iter().flatten()).size().y;
    assert!(height < 50.0, "{height}");
}
