//! Programs to test with, the strokes they mean, and the strokes that boards did.
use std::path::Path;

use fabricate::{
    import::gcode::{Sense, points},
    profile::{Machine, load_machine},
};

use crate::board::grbl::{GrblBoard, Sample, Tool};

pub(crate) fn machine(name: &str, keys: &str) -> Machine {
    let text = format!("profile = \"{name}\"\n{keys}");
    load_machine(Path::new("."), toml::de::DeTable::parse(&text).unwrap().get_ref()).unwrap()
}

pub(crate) const KNIFE: Tool = Tool::Servo { up: 40.0, down: 90.0 };

/// Closed polygons of a servo program, as `emit` writes them.
pub(crate) fn polygons(count: usize, corners: usize, radius: f64) -> String {
    let mut text = String::from("(fabricate: test)\nG21 G90 G94 G17 G54\nM3 S40\nG4 P0.15\n");
    for i in 0..count {
        let (cx, cy) = (20.0 + (i % 8) as f64 * 45.0, 20.0 + (i / 8) as f64 * 45.0);
        for k in 0..=corners {
            let a = k as f64 / corners as f64 * std::f64::consts::TAU;
            let (x, y) = (cx + radius * a.cos(), cy + radius * a.sin());
            if k == 0 {
                text += &format!("G0 X{x:.3} Y{y:.3}\nM3 S90\nG4 P0.2\n");
            } else {
                text += &format!("G1 X{x:.3} Y{y:.3}{}\n", if k == 1 { " F3000" } else { "" });
            }
        }
        text += "M3 S40\nG4 P0.15\n";
    }
    text + "G0 X0 Y0\nM2\n"
}

/// What the program says should be touched: strokes in work coordinates.
pub(crate) fn expected(program: &str, machine: &Machine) -> Vec<Vec<[f64; 2]>> {
    let read = fabricate::import::read_gcode(program, Sense::of(&machine.head)).unwrap();
    read.strokes().iter().map(|it| points(it, 1e-3).iter().map(|p| [p.x, p.y]).collect()).collect()
}

/// What the board really did with the tool on, as strokes in work coordinates.
pub(crate) fn touched(board: &GrblBoard) -> Vec<Vec<[f64; 2]>> {
    let zero = board.work_zero();
    let mut out: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut last: Option<Sample> = None;
    for &it in &board.trace {
        if it.on {
            let p = [it.at[0] - zero[0], it.at[1] - zero[1]];
            match last {
                Some(before) if before.on => {
                    let stroke = out.last_mut().unwrap();
                    let q = stroke[stroke.len() - 1];
                    if (p[0] - q[0]).hypot(p[1] - q[1]) > 1e-6 {
                        stroke.push(p);
                    }
                }
                _ => out.push(vec![p]),
            }
        }
        last = Some(it);
    }
    out.retain(|it| it.len() > 1);
    out
}

pub(crate) fn same(a: &[Vec<[f64; 2]>], b: &[Vec<[f64; 2]>]) -> Result<(), String> {
    if a.len() != b.len() {
        return Err(format!("{} strokes instead of {}", b.len(), a.len()));
    }
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        if a.len() != b.len() {
            return Err(format!("stroke {i}: {} points instead of {}", b.len(), a.len()));
        }
        for (p, q) in a.iter().zip(b) {
            if (p[0] - q[0]).hypot(p[1] - q[1]) > 1e-3 {
                return Err(format!("stroke {i}: {q:?} instead of {p:?}"));
            }
        }
    }
    Ok(())
}

/// Whether strokes run along each other, however their arcs were cut into chords.
pub(crate) fn along(a: &[Vec<[f64; 2]>], b: &[Vec<[f64; 2]>]) -> Result<f64, String> {
    if a.len() != b.len() {
        return Err(format!("{} strokes instead of {}", b.len(), a.len()));
    }
    let mut worst = 0.0_f64;
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        for (from, to) in [(a, b), (b, a)] {
            // In order: the nearest place is never sought behind the last one.
            let mut at = 0;
            for p in from {
                let near = |k: usize| segment_distance(*p, to[k], to[k + 1]);
                // The first that is near enough, so that a line which comes by again is not taken for its later self.
                let ahead = at..to.len() - 1;
                let first = ahead.clone().find(|k| near(*k) < 0.01);
                at = first.unwrap_or_else(|| ahead.min_by(|a, b| near(*a).total_cmp(&near(*b))).unwrap());
                worst = worst.max(near(at));
            }
            if worst > 0.01 {
                return Err(format!("stroke {i} is {worst:.3} mm off"));
            }
        }
    }
    Ok(worst)
}

pub(crate) fn segment_distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let t = (((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy).max(1e-12)).clamp(0.0, 1.0);
    (p[0] - a[0] - t * dx).hypot(p[1] - a[1] - t * dy)
}

/// After a job was resumed: every contour was done once, or more often where it was named as in doubt; few are.
pub(crate) fn once_or_doubted(wanted: &[Vec<[f64; 2]>], done: &[Vec<[f64; 2]>], told: &[String], name: &str) {
    let doubted: Vec<usize> = told
        .iter()
        .filter_map(|it| it.strip_prefix("in doubt, done again: contour "))
        .map(|it| it.split(' ').next().unwrap().parse::<usize>().unwrap() - 1)
        .collect();
    assert!(doubted.len() <= 4, "{name}: too many in doubt: {doubted:?}");
    for (i, want) in wanted.iter().enumerate() {
        let one = std::slice::from_ref(want);
        let times = done.iter().filter(|it| same(one, std::slice::from_ref(it)).is_ok()).count();
        let fine = if doubted.contains(&i) { (1..=2).contains(&times) } else { times == 1 };
        assert!(fine, "{name}: contour {i} was done {times} times; in doubt {doubted:?}");
    }
}
