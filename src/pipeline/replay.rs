//! What a mill or a hot wire would really do: its programs replayed by the kinematics of the profile, the cutter swept past
//! the body. Shares no code with what made the programs.
use nalgebra::{Rotation3, Unit};

use crate::{
    geom::Vec3,
    import::gcode::axes::{AXES, Block, read_axes},
    mesh::{
        FaceId, Field, Id, TriMesh,
        sweep::{Pose, Samples, Sweep},
    },
    model::{CutMesh, Milling},
    profile::{HotWire, LinearAxis, Machine, Mill, RotaryAxis, Rotation, Turns},
    stage::Check,
};

/// Steps per block.
const STEPS: usize = 16;
/// Samples are not nearer than this, mm.
const FINEST: f64 = 0.15;
/// Rounding of the words may leave the travel by so much, mm or degrees.
const SLACK: f64 = 1e-3;

/// One check per program, `mill.replay` and `mill.replay_tip`: how deep the cutter of the program goes into the body. A
/// program that leaves the travel, leaves too much on the surface, or has the holder in the body fails too, and says where.
pub fn replay(programs: &[(String, Vec<u8>)], job: &Milling, cut: &CutMesh, machine: &Machine) -> Vec<Check> {
    let body = Body::new(job, cut);
    let check = |(path, bytes): &(String, Vec<u8>)| {
        let found = std::str::from_utf8(bytes)
            .map_err(|it| it.to_string())
            .and_then(|text| carried_out(text, job, machine))
            .map(|poses| body.swept(&poses, job));
        let [gouge, excess] = job.limits;
        let name = if path.contains("-tip") { "mill.replay_tip" } else { "mill.replay" };
        let (ok, value, note) = match found {
            Ok([deep, left, hit]) => (
                deep <= gouge && left <= excess && hit <= 0.0,
                deep,
                format!(
                    "{path}: the replayed cutter goes {deep:.4} mm into the body, leaves {left:.4} mm, holder {hit:.2} mm in it"
                ),
            ),
            Err(fault) => (false, f64::from(u16::MAX), format!("{path}: {fault}; do not use this program")),
        };
        Check { name: name.into(), ok, value, limit: gouge, unit: "mm".into(), note }
    };
    programs.iter().map(check).collect()
}

struct Body {
    samples: Samples,
    /// Samples that the job says were passed, and what no ball of the cutter's radius could take off there, mm.
    passed: Vec<(usize, f64)>,
}

impl Body {
    fn new(job: &Milling, cut: &CutMesh) -> Self {
        let spacing = (2.0 * job.tool.radius * job.limits[0]).sqrt().max(FINEST);
        let placed = |mesh: &TriMesh| {
            mesh.with_positions(Field::from_vec(mesh.positions().iter().map(|&p| job.setup.place(p)).collect()))
        };
        let (mut points, mut faces) = Samples::spread(&placed(&cut.mesh), |_| Some(spacing));
        let painted = placed(&job.painted);
        let mut passed = Vec::new();
        for f in painted.faces().filter(|f| job.deviation[f.index()].is_some()) {
            passed.push((points.len(), job.closing[f.index()]));
            points.push(painted.face_positions(f).iter().sum::<Vec3>() / 3.0);
            faces.push(FaceId(0));
        }
        Self { samples: Samples::of_points(points, faces), passed }
    }

    /// How deep the cutter goes, how much it leaves, how deep the holder goes.
    fn swept(&self, poses: &[Pose], job: &Milling) -> [f64; 3] {
        let mut sweep = Sweep::new(&self.samples, job.tool, job.tool.radius.max(2.0 * job.limits[1]));
        for w in poses.windows(2) {
            sweep.step(&w[0], &w[1], [0.0, -1.0], &|_| None);
        }
        let left = self.passed.iter().map(|&(i, closing)| sweep.clearance[i] - closing).fold(0.0, f64::max);
        [sweep.gouge().depth, left, sweep.collision.depth]
    }
}

/// Poses of the cutter in the part along a program.
fn carried_out(text: &str, job: &Milling, machine: &Machine) -> Result<Vec<Pose>, String> {
    let tip = machine.mill.as_ref().and_then(|it| it.tip_control.as_ref());
    let read = read_axes(text, tip.map(|it| [it.on.as_str(), it.off.as_str()])).map_err(|it| it.to_string())?;
    if !read.ends_well {
        return Err("ends without M5, G94 and M2".into());
    }
    let length = job.tool.reach + job.tool.holder_length;
    let mut poses = Vec::new();
    let mut last: Option<&Block> = None;
    for block in &read.blocks {
        let whole = |it: &Block| -> Option<[f64; 8]> {
            let wanted: Vec<char> = job.axes.clone();
            let all = wanted.iter().all(|letter| axis(it, *letter).is_some());
            all.then(|| it.at.map(|it| it.unwrap_or(0.0)))
        };
        let Some(to) = whole(block) else {
            last = None;
            continue;
        };
        let from = last.filter(|it| it.tip == block.tip).and_then(whole).unwrap_or(to);
        for k in 1..=STEPS {
            let s = k as f64 / STEPS as f64;
            let mut words = [0.0; 8];
            for (i, it) in words.iter_mut().enumerate() {
                *it = from[i] + (to[i] - from[i]) * s;
            }
            let (pose, joints) = match (&machine.mill, &machine.wire) {
                (Some(mill), _) => milled(mill, length, &words, block.tip),
                (_, Some(wire)) => (wired(wire, &words), words),
                _ => return Err("the machine has no axes for it".into()),
            };
            travel(machine, &joints).map_err(|it| format!("line {}: {it}", block.line))?;
            poses.push(pose);
        }
        last = Some(block);
    }
    Ok(poses)
}

fn index(letter: char) -> usize {
    AXES.iter().position(|it| *it == letter).unwrap_or(0)
}

fn axis(block: &Block, letter: char) -> Option<f64> {
    block.at[index(letter)]
}

fn matrix(it: &Rotation, words: &[f64; 8]) -> Rotation3<f64> {
    let (about, letter) = match it.axis {
        RotaryAxis::A => (Vec3::x(), 'A'),
        RotaryAxis::B => (Vec3::y(), 'B'),
        RotaryAxis::C => (Vec3::z(), 'C'),
    };
    let angle = words[index(letter)].to_radians();
    Rotation3::from_axis_angle(&Unit::new_unchecked(about), if it.reverse { -angle } else { angle })
}

/// The cutter in the part, and all joints, at a place of the program. The part is turned by its tables: a point p of it
/// comes to c + R (p − c), first by the table that carries it.
fn milled(mill: &Mill, length: f64, words: &[f64; 8], tip: bool) -> (Pose, [f64; 8]) {
    let spindle = mill
        .rotary
        .iter()
        .filter(|it| it.turns == Turns::Head)
        .fold(Rotation3::identity(), |r, it| r * matrix(it, words));
    let tool = spindle * Vec3::z();
    let back = (tool - Vec3::z()) * (mill.pivot.mm + length);
    let tables: Vec<(Rotation3<f64>, Vec3)> = mill
        .rotary
        .iter()
        .filter(|it| it.turns == Turns::Table)
        .map(|it| (matrix(it, words), Vec3::from(it.point.map(|it| it.mm))))
        .collect();
    let xyz = Vec3::new(words[0], words[1], words[2]);
    let turned = tables.iter().fold(tool, |v, (r, _)| r.inverse() * v);
    if tip {
        let machine = tables.iter().rev().fold(xyz, |p, (r, c)| c + r * (p - c)) + back;
        let mut joints = *words;
        joints[..3].copy_from_slice(machine.as_slice());
        return (Pose { tip: xyz, axis: turned }, joints);
    }
    let part = tables.iter().fold(xyz - back, |p, (r, c)| c + r.inverse() * (p - c));
    (Pose { tip: part, axis: turned }, *words)
}

/// The wire between its carriages.
fn wired(wire: &HotWire, words: &[f64; 8]) -> Pose {
    let at = |x: char, y: char, along: f64| Vec3::new(words[index(x)], along, words[index(y)]);
    let (left, right) = (at('X', 'Y', 0.0), at('U', 'V', wire.span.mm));
    Pose { tip: left, axis: (right - left).normalize() }
}

/// Whether all axes are within their travel.
fn travel(machine: &Machine, joints: &[f64; 8]) -> Result<(), String> {
    let mut ranges: Vec<(char, [f64; 2])> = Vec::new();
    let linear = |letter: char, it: &LinearAxis| (letter, [it.min.mm, it.max.mm]);
    if let Some(it) = &machine.mill {
        ranges.extend([linear('X', &it.x), linear('Y', &it.y), linear('Z', &it.z)]);
        ranges.extend(it.rotary.iter().map(|it| (it.axis.letter(), [it.min, it.max])));
    }
    if let Some(it) = &machine.wire {
        ranges.extend([linear('X', &it.x), linear('Y', &it.y), linear('U', &it.u), linear('V', &it.v)]);
    }
    for (letter, [min, max]) in ranges {
        let value = joints[index(letter)];
        if !(min - SLACK..=max + SLACK).contains(&value) {
            return Err(format!("{letter} = {value:.3} is beyond its travel from {min} to {max}"));
        }
    }
    Ok(())
}
