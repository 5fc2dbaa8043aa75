//! Formulas against sweeps, kinematics against themselves, and what is refused.
use std::f64::consts::{FRAC_PI_2, PI};

use super::{
    kinematics::{Carrier, Kinematics, Linear, Rotary},
    posture::{Line, chord_error, largest_step, posture, twist_error},
};
use crate::{
    geom::Vec3,
    mesh::sweep::{Pose, Tool},
    numeric::random::Random,
};

fn cylinder(radius: f64, flute: f64) -> Tool {
    Tool { radius, taper: 0.0, flute, shank: radius, reach: flute, holder: radius, holder_length: 0.0 }
}

/// How deep a cutter is in the surface z = k x y, and how far above it, along a ruling: over all points near it.
fn against_twist(pose: &Pose, tool: &Tool, k: f64, half: f64) -> (f64, f64) {
    let (mut gouge, mut excess) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for i in 0..=200 {
        let x = -half + 2.0 * half * i as f64 / 200.0;
        // The nearest point of the surface in the plane of that x.
        let depth = (-4000..=4000)
            .map(|j| {
                let y = tool.radius * f64::from(j) / 4000.0;
                -tool.flank(pose, &Vec3::new(x, y, k * x * y)).unwrap_or(f64::INFINITY)
            })
            .fold(f64::NEG_INFINITY, f64::max);
        gouge = gouge.max(depth);
        excess = excess.max(-depth);
    }
    (gouge, excess)
}

#[test]
fn twist_costs_what_the_formula_says_and_half_the_tilt_saves_nearly_all_of_it() {
    let half = 10.0;
    for (radius, k) in [(3.0, 0.004), (6.0, 0.004), (6.0, 0.01), (6.0, 0.02)] {
        let tool = cylinder(radius, 40.0);
        let normal = |x: f64| Vec3::new(0.0, -k * x, 1.0).normalize();
        let line = Line {
            p: Vec3::new(-half, 0.0, 0.0),
            q: Vec3::new(half, 0.0, 0.0),
            normals: [normal(-half), normal(half)],
        };
        let twist = line.twist().abs();
        assert!((twist - 2.0 * (k * half).atan()).abs() < 1e-12);
        let (along, _) = against_twist(&posture(&line, &tool, 1.0, 0.0, 0.0).pose, &tool, k, half);
        let expected = twist_error(radius, twist);
        assert!((along / expected - 1.0).abs() < 0.05, "r {radius}, k {k}: {along} for {expected}");
        let (gouge, excess) = against_twist(&posture(&line, &tool, 1.0, 0.0, 0.5).pose, &tool, k, half);
        assert!(gouge.max(excess) < 0.12 * expected, "r {radius}, k {k}: {gouge} and {excess}, of {expected}");
        // Touching at both ends goes as much too far as the axis along the ruling stays behind.
        let (_, left) = against_twist(&posture(&line, &tool, 1.0, 0.0, 1.0).pose, &tool, k, half);
        assert!(left < 1.2 * expected);
    }
}

#[test]
fn chords_cost_what_the_formula_says() {
    // A cylinder of radius R about z; the tip goes straight between postures dt apart.
    let (surface, radius) = (30.0, 5.0);
    let tool = cylinder(radius, 20.0);
    for (convex, n) in [(true, 6), (true, 24), (false, 6), (false, 24)] {
        let step = 1.2 / f64::from(n);
        let side = if convex { 1.0 } else { -1.0 };
        let pose = |angle: f64| {
            let out = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let (p, q) = (out * surface, out * surface + Vec3::z() * 10.0);
            posture(&Line { p, q, normals: [out * side; 2] }, &tool, 1.0, 0.0, 0.5).pose
        };
        let (a, b) = (pose(0.0), pose(step));
        let worst = (0..=1000)
            .map(|i| {
                let angle = step * f64::from(i) / 1000.0;
                let p = Vec3::new(angle.cos(), angle.sin(), 0.5).component_mul(&Vec3::new(surface, surface, 10.0));
                let clearance = (0..=400).map(|j| {
                    let s = f64::from(j) / 400.0;
                    tool.flank(&Pose { tip: a.tip + (b.tip - a.tip) * s, axis: a.axis }, &p).unwrap_or(f64::INFINITY)
                });
                let clearance = clearance.fold(f64::INFINITY, f64::min);
                if convex { -clearance } else { clearance }
            })
            .fold(f64::NEG_INFINITY, f64::max);
        let expected = chord_error(surface * side, radius, step);
        assert!((worst / expected - 1.0).abs() < 0.04, "convex {convex}, {n} steps: {worst} for {expected}");
        assert!((chord_error(surface, radius, largest_step(surface, radius, 0.01)) - 0.01).abs() < 1e-12);
    }
}

#[test]
fn a_cone_stands_with_its_flank_on_the_ruling() {
    let tool = Tool { taper: 0.12, ..cylinder(2.0, 30.0) };
    let line = Line { p: Vec3::new(1.0, 2.0, 3.0), q: Vec3::new(1.0, 20.0, 3.0), normals: [Vec3::z(); 2] };
    let found = posture(&line, &tool, 0.5, 0.0, 0.5);
    for s in [-0.02, 0.0, 0.4, 1.0] {
        let p = line.p + (line.q - line.p) * s;
        let clearance = tool.flank(&found.pose, &p).unwrap();
        assert!(clearance.abs() < 1e-12, "{s}: {clearance}");
    }
    // 0.5 mm beyond P its end has passed.
    assert!(tool.flank(&found.pose, &(line.p - Vec3::y() * 0.51)).is_none());
    assert!((found.contact[0] - 0.5 / 0.12_f64.cos()).abs() < 1e-12);
}

fn axis(letter: char, carrier: Carrier, point: [f64; 3], range: [f64; 2]) -> Rotary {
    let about = "ABC".find(letter).unwrap();
    let range = range.map(f64::to_radians);
    Rotary { letter, about, carrier, point: Vec3::from(point), reverse: false, range, speed: 1.0 }
}

fn machine(first: Rotary, second: Rotary) -> Kinematics {
    let linear = ['X', 'Y', 'Z'].map(|letter| Linear { letter, range: [-1e4, 1e4], speed: 10.0 });
    Kinematics { linear, rotary: [first, second], pivot: 170.0 }
}

fn machines() -> Vec<(&'static str, Kinematics)> {
    use Carrier::{Head, Table};
    let wide = [-1e4, 1e4];
    vec![
        ("tables A/C", machine(axis('A', Table, [0.0, 3.0, 40.0], wide), axis('C', Table, [1.0, 2.0, 0.0], wide))),
        ("tables B/C", machine(axis('B', Table, [5.0, 0.0, -50.0], wide), axis('C', Table, [0.0; 3], wide))),
        ("tables A/B", machine(axis('A', Table, [0.0, 0.0, 10.0], wide), axis('B', Table, [2.0, 0.0, 30.0], wide))),
        ("head B, table C", machine(axis('B', Head, [0.0; 3], wide), axis('C', Table, [4.0, 5.0, 0.0], wide))),
        ("table C, head A", machine(axis('C', Table, [0.0; 3], wide), axis('A', Head, [0.0; 3], wide))),
        ("head B, table A", machine(axis('B', Head, [0.0; 3], wide), axis('A', Table, [0.0, 1.0, 60.0], wide))),
    ]
}

#[test]
fn both_solutions_bring_the_tool_where_it_should_be_on_every_machine() {
    let mut random = Random::new(5);
    let mut draw = |size: f64| Vec3::from_fn(|_, _| size * (2.0 * random.unit() - 1.0));
    for (name, kinematics) in machines() {
        for reverse in [false, true] {
            let mut kinematics = kinematics.clone();
            kinematics.rotary[1].reverse = reverse;
            for _ in 0..300 {
                let pose = Pose { tip: draw(80.0), axis: draw(1.0).normalize() };
                for angles in kinematics.angles(&pose.axis, 0.0) {
                    let back = kinematics.pose(&kinematics.joints(&pose, angles));
                    assert!((back.tip - pose.tip).norm() < 1e-10, "{name}: {back:?} for {pose:?}");
                    assert!((back.axis - pose.axis).norm() < 1e-12, "{name}: {back:?} for {pose:?}");
                }
            }
        }
    }
}

#[test]
fn closed_forms_of_tables() {
    let mut random = Random::new(9);
    let machines = machines();
    let same = |a: f64, b: f64| ((a - b + PI).rem_euclid(2.0 * PI) - PI).abs() < 1e-12;
    for _ in 0..2000 {
        let a = Vec3::from_fn(|_, _| 2.0 * random.unit() - 1.0).normalize();
        let ac = [a.x.hypot(a.y).atan2(a.z), a.x.atan2(a.y)];
        let ab = [a.y.atan2(a.x.hypot(a.z)), (-a.x).atan2(a.z)];
        for (machine, [first, second]) in [(&machines[0].1, ac), (&machines[2].1, ab)] {
            let found = machine.angles(&a, 0.0);
            assert!(found.iter().any(|it| same(it[0], first) && same(it[1], second)), "{found:?}: {first}, {second}");
        }
    }
}

#[test]
fn a_path_past_the_pole_takes_the_solution_that_turns_least_and_keeps_to_the_travel() {
    let (_, mut kinematics) = machines().swap_remove(0);
    let path = |from: f64, to: f64| -> Vec<Pose> {
        let tilt = |k: u32| from + (to - from) * f64::from(k) / 40.0;
        (0..=40)
            .map(|k| Pose { tip: Vec3::zeros(), axis: Vec3::new(tilt(k).sin(), 0.02, tilt(k).cos()).normalize() })
            .collect()
    };
    let turned = |joints: &[[f64; 5]], k: usize| -> f64 { joints.windows(2).map(|w| (w[1][k] - w[0][k]).abs()).sum() };
    // Through the pole with a free trunnion: C need not turn round, A goes negative.
    let through = kinematics.along(&path(-0.8, 0.8), None).unwrap();
    assert!(turned(&through, 3) > 1.4, "{}", turned(&through, 3));
    // With a trunnion that tilts one way only, C must turn half round.
    kinematics.rotary[0].range = [0.0, 2.0];
    let round = kinematics.along(&path(-0.8, 0.8), None).unwrap();
    assert!(round.iter().all(|it| it[3] >= -1e-9));
    assert!(turned(&round, 4) > 2.8, "{}", turned(&round, 4));
    // And where it cannot tilt as far as the path asks, the pose and the axis are named.
    kinematics.rotary[0].range = [0.0, 0.5];
    let (i, beyond) = kinematics.along(&path(0.0, 0.8), None).unwrap_err();
    assert!((24..=26).contains(&i) && beyond.letter == 'A', "{i}, {beyond:?}");
    // Many turns of C add up instead of jumping back.
    let spiral: Vec<Pose> = (0..200)
        .map(|k| 0.1 * f64::from(k))
        .map(|c| Pose { tip: Vec3::zeros(), axis: Vec3::new(c.cos(), c.sin(), 1.0).normalize() })
        .collect();
    let (_, free) = machines().swap_remove(0);
    let joints = free.along(&spiral[..60], None).unwrap();
    assert!((turned(&joints, 4) - 5.9).abs() < 1e-6, "{}", turned(&joints, 4));
    assert!(joints.windows(2).all(|w| (w[1][4] - w[0][4]).abs() < 0.2));
    assert!((joints[59][3].abs() - FRAC_PI_2 / 2.0).abs() < 1e-9);
}
