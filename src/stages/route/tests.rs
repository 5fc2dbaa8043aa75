//! Laws of routing.
use std::collections::BTreeMap;

use super::{
    order::{Item, Visit, enclosed, improve, tour, travel},
    *,
};
use crate::{
    geom::{polygon::turned, polyline_length},
    model::{Mark, Part, Sheet},
    numeric::random::Random,
};

fn ring(center: Vec2, radius: f64, n: usize) -> Vec<Vec2> {
    (0..n).map(|k| center + turned(Vec2::new(radius, 0.0), std::f64::consts::TAU * k as f64 / n as f64)).collect()
}

fn hole(center: Vec2, radius: f64, n: usize) -> Vec<Vec2> {
    ring(center, radius, n).into_iter().rev().collect()
}

fn stroke(operation: Operation, points: &[[f64; 2]]) -> Mark {
    Mark { operation, points: points.iter().map(|&[x, y]| Vec2::new(x, y)).collect(), closed: false }
}

/// A frame with two holes, a part inside one of them with a hole of its own, and a row of discs with marks.
fn sheet() -> Sheets {
    let frame = Part {
        name: "frame".into(),
        contours: vec![
            ring(Vec2::new(100.0, 100.0), 90.0, 60),
            hole(Vec2::new(70.0, 100.0), 40.0, 40),
            hole(Vec2::new(150.0, 100.0), 20.0, 20),
        ],
        marks: vec![
            stroke(Operation::Text, &[[110., 100.], [112., 104.], [114., 100.]]),
            stroke(Operation::Text, &[[114., 100.], [118., 100.]]),
            stroke(Operation::ScoreValley, &[[115., 60.], [116., 140.]]),
        ],
    };
    let inner = Part {
        name: "inner".into(),
        contours: vec![ring(Vec2::new(70.0, 100.0), 30.0, 30), hole(Vec2::new(70.0, 100.0), 10.0, 12)],
        marks: vec![stroke(Operation::Sew, &[[60., 80.], [80., 80.]])],
    };
    let discs = (0..9).map(|k| Part {
        name: format!("disc {k}"),
        contours: vec![ring(Vec2::new(210.0 + 20.0 * f64::from(k % 3), 30.0 + 40.0 * f64::from(k / 3)), 8.0, 16)],
        marks: vec![],
    });
    let parts: Vec<Part> = [frame, inner].into_iter().chain(discs).collect();
    let sheet = Sheet { size: Vec2::new(300.0, 200.0), parts, placements: vec![] };
    Sheets { sheets: vec![sheet], margin: 5.0, gap: 2.0, unplaced: vec![] }
}

fn options() -> Options {
    let tool = |operation| Tool {
        operation,
        feed: 25.0,
        passes: vec![1.0],
        blade: false,
        kerf: 0.0,
        lead: 0.0,
        bridges: None,
    };
    Options {
        tools: Operation::ALL.into_iter().filter(|&it| it != Operation::Sew).map(tool).collect(),
        bed: Vec2::new(300.0, 200.0),
        home: Vec2::zeros(),
        tolerance: 0.005,
        arcs: 0.0,
        knife: None,
        dynamics: Dynamics { rapid: 100.0, acceleration: 500.0, lift: 0.35 },
    }
}

fn run(options: &Options) -> Toolpaths {
    route(&sheet(), options, &Monitor::silent()).unwrap()
}

#[test]
fn every_contour_is_run_exactly_once_and_closed() {
    let job = run(&options());
    let mut wanted: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for part in &sheet().sheets[0].parts {
        wanted.entry(part.name.clone()).or_default().extend(part.contours.iter().map(|it| polyline_length(it, true)));
    }
    let mut found: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for path in job.sheets[0].paths.iter().filter(|it| it.operation.is_cut()) {
        assert!(path.path.is_closed());
        found.entry(path.part.clone()).or_default().push(path.path.length());
    }
    for lengths in wanted.values_mut().chain(found.values_mut()) {
        lengths.sort_by(f64::total_cmp);
    }
    assert_eq!(wanted.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>());
    for (name, lengths) in &wanted {
        assert_eq!(lengths.len(), found[name].len());
        assert!(lengths.iter().zip(&found[name]).all(|(a, b)| (a - b).abs() < 1e-9), "{name}");
    }
}

#[test]
fn marks_come_first_and_what_is_enclosed_before_what_encloses_it() {
    let job = run(&options());
    let order: Vec<(Operation, &str)> = job.sheets[0].paths.iter().map(|it| (it.operation, it.part.as_str())).collect();
    let at = |operation, part| order.iter().position(|&it| it == (operation, part)).unwrap();
    let first_cut = order.iter().position(|it| it.0.is_cut()).unwrap();
    assert!(order[first_cut..].iter().all(|it| it.0.is_cut()));
    assert!(at(Operation::Text, "frame") < at(Operation::ScoreValley, "frame"));
    let hole_around_inner = order.iter().rposition(|&it| it == (Operation::CutInside, "frame")).unwrap();
    assert!(at(Operation::CutInside, "inner") < at(Operation::CutOutside, "inner"));
    assert!(at(Operation::CutOutside, "inner") < hole_around_inner);
    assert!(hole_around_inner < at(Operation::CutOutside, "frame"));
}

#[test]
fn strokes_that_meet_are_run_in_one_go_and_missing_tools_are_said() {
    let job = run(&options());
    let text: Vec<_> = job.sheets[0].paths.iter().filter(|it| it.operation == Operation::Text).collect();
    assert_eq!(text.len(), 1);
    assert!((text[0].path.length() - (2.0 * 20.0_f64.sqrt() + 4.0)).abs() < 1e-9);
    assert_eq!(job.left_out, [(Operation::Sew, 1)]);
    assert!(job.sheets[0].paths.iter().all(|it| it.operation != Operation::Sew));
}

#[test]
fn sums_agree_with_the_paths() {
    let job = run(&options());
    let paths = &job.sheets[0].paths;
    let cut: f64 = paths.iter().map(|it| it.path.length()).sum();
    let mut at = Vec2::zeros();
    let mut travel = 0.0;
    for path in paths {
        travel += (path.path.points[0] - at).norm();
        at = *path.path.points.last().unwrap();
    }
    assert!((job.cut_length - cut).abs() < 1e-9);
    assert!((job.travel_length - travel - at.norm()).abs() < 1e-9);
    assert_eq!(job.lifts, paths.len());
    assert!(job.seconds > cut / 25.0 + travel / 100.0);
}

#[test]
fn passes_repeat_paths() {
    let mut twice = options();
    for tool in &mut twice.tools {
        tool.passes = vec![1.0; 3];
    }
    let (one, three) = (run(&options()), run(&twice));
    assert!((three.cut_length - 3.0 * one.cut_length).abs() < 1e-6);
    let closed = |job: &Toolpaths| job.sheets[0].paths.iter().filter(|it| it.operation.is_cut()).count();
    assert_eq!(closed(&one), closed(&three));
    assert_eq!(three.lifts, one.lifts, "open lines are run to and fro");
    assert_eq!(three.sheets[0].paths.len() - one.sheets[0].paths.len(), 2 * (one.lifts - closed(&one)));
    for tool in &mut twice.tools {
        tool.passes = vec![0.5, 1.0];
    }
    let deeper = run(&twice);
    assert_eq!(deeper.lifts, one.lifts, "the tool goes down where it is");
    let strokes: Vec<&[Toolpath]> = deeper.sheets[0].strokes().collect();
    assert!(strokes.iter().all(|it| it.len() == 2 && [it[0].depth, it[1].depth] == [0.5, 1.0]));
}

#[test]
fn a_point_outside_the_bed_is_refused_with_its_place() {
    let small = Options { bed: Vec2::new(255.0, 200.0), ..options() };
    let Err(RouteError::OutsideBed { sheet: 1, part, place, .. }) = route(&sheet(), &small, &Monitor::silent()) else {
        panic!("the discs at x = 258 do not fit");
    };
    assert!(part.starts_with("disc") && place.x > 255.0);
}

#[test]
fn blades_are_led_only_where_they_cut() {
    let mut knife = options();
    knife.knife = Some(Knife { offset: 0.25, overcut: 0.5, lift: None });
    for tool in knife.tools.iter_mut().filter(|it| it.operation.is_cut()) {
        tool.blade = true;
    }
    let (plain, led) = (run(&options()), run(&knife));
    let aligned: Vec<&Toolpath> = led.sheets[0].paths.iter().filter(|it| it.part.is_empty()).collect();
    assert_eq!(aligned.len(), 1, "the blade is turned once, before its first cut");
    for (a, b) in plain.sheets[0].paths.iter().zip(led.sheets[0].paths.iter().filter(|it| !it.part.is_empty())) {
        assert_eq!((a.operation, &a.part), (b.operation, &b.part));
        assert_eq!(a.operation.is_cut(), a.path != b.path);
    }
}

fn scatter(count: usize, seed: u64) -> Vec<Item> {
    let mut random = Random::new(seed);
    let mut draw = |scale: f64| random.unit() * scale;
    (0..count)
        .map(|k| {
            let center = Vec2::new(draw(400.0), draw(300.0));
            let closed = k % 2 == 0;
            let points = if closed {
                ring(center, 1.0 + draw(9.0), 12)
            } else {
                vec![center, center + Vec2::new(draw(20.0), draw(20.0)), center + Vec2::new(draw(20.0), -draw(20.0))]
            };
            Item { points, closed, inside: None }
        })
        .collect()
}

#[test]
fn improving_never_lengthens_a_tour_and_keeps_every_stop() {
    for seed in 0..4 {
        let items = scatter(60, seed);
        let mut random = Random::new(seed + 100);
        let mut visits: Vec<Visit> = (0..items.len()).map(|item| Visit { item, entry: 0 }).collect();
        for k in (1..visits.len()).rev() {
            visits.swap(k, random.below(k + 1));
        }
        let before = travel(&items, Vec2::zeros(), &visits);
        improve(&items, Vec2::zeros(), &mut visits, &Monitor::silent()).unwrap();
        let after = travel(&items, Vec2::zeros(), &visits);
        assert!(after < 0.4 * before, "{before} → {after}");
        let mut seen: Vec<usize> = visits.iter().map(|it| it.item).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..items.len()).collect::<Vec<_>>());
        let found = travel(&items, Vec2::zeros(), &tour(&items, Vec2::zeros(), &Monitor::silent()).unwrap());
        assert!(found < 1.15 * after);
        let again = after;
        improve(&items, Vec2::zeros(), &mut visits, &Monitor::silent()).unwrap();
        assert!(travel(&items, Vec2::zeros(), &visits) <= again + 1e-9);
    }
}

#[test]
fn small_tours_come_close_to_the_best_of_all() {
    fn best(items: &[Item], at: Vec2, left: &mut Vec<usize>) -> f64 {
        let mut least = if left.is_empty() { 0.0 } else { f64::INFINITY };
        for k in 0..left.len() {
            let item = left.remove(k);
            let ends = if items[item].closed { 0..items[item].points.len() } else { 0..2 };
            for e in ends {
                let entry = if items[item].closed { e } else { e * (items[item].points.len() - 1) };
                let first = travel(items, at, &[Visit { item, entry }]);
                let exit = if items[item].closed { entry } else { items[item].points.len() - 1 - entry };
                least = least.min(first + best(items, items[item].points[exit], left));
            }
            left.insert(k, item);
        }
        least
    }
    let (mut total, mut least) = (0.0, 0.0);
    for seed in 0..12 {
        let items: Vec<Item> = scatter(10, seed).into_iter().skip(1).step_by(2).collect();
        total += travel(&items, Vec2::zeros(), &tour(&items, Vec2::zeros(), &Monitor::silent()).unwrap());
        least += best(&items, Vec2::zeros(), &mut (0..items.len()).collect());
    }
    assert!(total >= least - 1e-9 && total < 1.06 * least, "{total} against {least}");
}

#[test]
fn nested_rings_are_known_and_kept_in_order() {
    let center = Vec2::new(50.0, 50.0);
    let mut items: Vec<Item> =
        [40.0, 10.0, 30.0, 20.0].map(|r| Item { points: ring(center, r, 24), closed: true, inside: None }).to_vec();
    items.extend(scatter(20, 5).into_iter().filter(|it| it.closed));
    let shapes: Vec<Vec<Vec2>> = items.iter().map(|it| it.points.clone()).collect();
    let items = enclosed(items, &shapes);
    assert_eq!([0, 1, 2, 3].map(|k| items[k].inside), [None, Some(3), Some(0), Some(2)]);
    let found = tour(&items, Vec2::zeros(), &Monitor::silent()).unwrap();
    let place = |item: usize| found.iter().position(|it| it.item == item).unwrap();
    for (i, item) in items.iter().enumerate() {
        assert!(item.inside.is_none_or(|outer| place(i) < place(outer)));
    }
}

#[test]
fn cuts_come_where_the_order_of_work_has_them() {
    let mut options = options();
    let rank = |it: &Tool| {
        [Operation::CutInside, Operation::Text, Operation::CutOutside].iter().position(|o| *o == it.operation)
    };
    options.tools.retain(|it| rank(it).is_some());
    options.tools.sort_by_key(rank);
    let job = run(&options);
    let mut order: Vec<Operation> = job.sheets[0].paths.iter().map(|it| it.operation).collect();
    order.dedup();
    assert_eq!(order, [Operation::CutInside, Operation::Text, Operation::CutOutside]);
}

#[test]
fn webs_stand_only_where_a_part_comes_free() {
    // A bay whose mouth is narrower than the cut: the cut closes it off, and only waste comes free in it.
    let outline = [
        [10.0, 10.0],
        [70.0, 10.0],
        [70.0, 50.0],
        [40.05, 50.0],
        [40.05, 45.0],
        [55.0, 45.0],
        [55.0, 20.0],
        [25.0, 20.0],
        [25.0, 45.0],
        [39.95, 45.0],
        [39.95, 50.0],
        [10.0, 50.0],
    ];
    let part =
        Part { name: "bay".into(), contours: vec![outline.map(|[x, y]| Vec2::new(x, y)).to_vec()], marks: vec![] };
    let sheet = Sheet { size: Vec2::new(300.0, 200.0), parts: vec![part], placements: vec![] };
    let sheets = Sheets { sheets: vec![sheet], margin: 5.0, gap: 2.0, unplaced: vec![] };
    let mut options = options();
    for tool in &mut options.tools {
        (tool.kerf, tool.bridges) = (0.2, Some(Bridges { count: 3, width: 1.0, below: 0.0 }));
    }
    let job = route(&sheets, &options, &Monitor::silent()).unwrap();
    let closed: Vec<f64> =
        job.sheets[0].paths.iter().filter(|it| it.path.is_closed()).map(|it| it.path.length()).collect();
    assert_eq!((job.sheets[0].paths.len(), closed.len()), (5, 1), "three webs around, none in the bay");
    assert!((closed[0] - 2.0 * (29.8 + 24.8)).abs() < 0.5, "{closed:?}");
}
