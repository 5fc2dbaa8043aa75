//! G-code of flank milling and hot-wire cutting for controllers of the LinuxCNC kind.
//!
//! Cuts are timed by inverse-time feeds (G93): F is 60 over the seconds of the block and stands on every G1, because
//! controllers forget it after each; G94 with an F comes back before every rapid. G61 keeps corners exact, which is what the
//! program was verified for.
use std::fmt::{Arguments, Write as _};

use super::drawing::{decimal, short};
use crate::{
    geom::Vec3,
    model::{MillMove, Milling},
    profile::{Machine, TipControl},
};

/// Feed that is in force between cuts, mm/min, and the shortest time of a block, s.
const IDLE: f64 = 600.0;
const SHORTEST: f64 = 1e-4;

/// The programs of a job: name of the file without folder, and its text. In joint coordinates always; with control of the
/// tip by the controller where the machine has that.
pub fn programs(job: &Milling, machine: &Machine) -> Vec<(&'static str, String)> {
    let tip = machine.mill.as_ref().and_then(|it| it.tip_control.as_ref());
    let mut out = vec![("mill.ngc", program(job, machine, None))];
    out.extend(tip.map(|it| ("mill-tip.ngc", program(job, machine, Some(it)))));
    out
}

struct Text {
    text: String,
    decimals: usize,
    timed: bool,
}

impl Text {
    fn line(&mut self, line: Arguments<'_>) {
        self.text.write_fmt(line).expect("writing to memory cannot fail");
        self.text.push('\n');
    }

    fn comment(&mut self, text: &str) {
        let plain: String = text.chars().filter(|c| matches!(c, ' '..='~') && !"()".contains(*c)).take(76).collect();
        self.line(format_args!("({plain})"));
    }

    /// Axis words.
    fn words(&self, letters: &[char], values: &[f64]) -> String {
        let word = |(letter, value): (&char, &f64)| format!(" {letter}{}", decimal(*value, self.decimals));
        letters.iter().zip(values).map(word).collect()
    }

    /// Ends inverse-time feeds.
    fn plain_feed(&mut self) {
        if std::mem::take(&mut self.timed) {
            self.line(format_args!("G94 F{}", short(IDLE)));
        }
    }

    fn block(&mut self, it: &MillMove, words: &str) {
        if it.rapid {
            self.plain_feed();
            return self.line(format_args!("G0{words}"));
        }
        if !std::mem::replace(&mut self.timed, true) {
            self.line(format_args!("G93"));
        }
        self.line(format_args!("G1{words} F{}", decimal(60.0 / it.seconds.max(SHORTEST), 4)));
    }
}

/// Values of the axis words of a block: degrees for rotary axes; X, Y and Z of the tip in the part where the controller
/// keeps it on its way.
fn values(it: &MillMove, tip: bool) -> Vec<f64> {
    let rotary = it.joints.len() == 5;
    let mut out: Vec<f64> = it
        .joints
        .iter()
        .enumerate()
        .map(|(k, &value)| if rotary && k > 2 { value.to_degrees() } else { value })
        .collect();
    if tip {
        out[..3].copy_from_slice(it.pose.tip.as_slice());
    }
    out
}

fn program(job: &Milling, machine: &Machine, tip: Option<&TipControl>) -> String {
    let mut out = Text { text: String::new(), decimals: machine.decimals, timed: false };
    out.comment(&format!("fabricate: pieces {}", job.pieces.join(", ")));
    out.comment(&format!("machine: {}", machine.title));
    let is_wire = job.span > 0.0;
    if is_wire {
        out.comment(&format!("wire, kerf {} mm, span {} mm", short(2.0 * job.tool.radius), short(job.span)));
    } else {
        let (tool, degrees) = (&job.tool, job.tool.taper.to_degrees());
        out.comment(&format!(
            "cutter: diameter {} mm at the tip, half angle {} deg, edges {} mm, reach {} mm",
            short(2.0 * tool.radius),
            short(degrees),
            short(tool.flute),
            short(tool.reach)
        ));
    }
    let row = |v: Vec3| format!("{} {} {}", decimal(v.x, 6), decimal(v.y, 6), decimal(v.z, 6));
    for (name, row_of, shift) in [
        ("x", job.setup.rows[0], job.setup.shift.x),
        ("y", job.setup.rows[1], job.setup.shift.y),
        ("z", job.setup.rows[2], job.setup.shift.z),
    ] {
        out.comment(&format!("work {name} = {} . model + {}", row(row_of), decimal(shift, 4)));
    }
    out.comment(match tip {
        Some(_) => "X Y Z: the tip in the part; the controller must know the kinematics",
        None => "joint coordinates: valid for this set-up and the pivots of the profile only",
    });
    out.line(format_args!("G21 G90 G94 G17 G40 G49 G54 G61"));
    out.line(format_args!("F{}", short(IDLE)));
    if !is_wire {
        out.line(format_args!("T1 M6"));
        out.line(format_args!("G43"));
        out.line(format_args!("G53 G0 Z0"));
    }
    out.line(format_args!("M3 S{}", short(job.spindle)));
    let Some(first) = job.moves.first() else { return out.text };
    if let Some(tip) = tip {
        // Over the start with the axes turned, before the controller takes the tip.
        let joints = values(first, false);
        let words = out.words(&job.axes[..2], &joints[..2]) + &out.words(&job.axes[3..], &joints[3..]);
        out.line(format_args!("G0{words}"));
        out.line(format_args!("{}", tip.on));
    } else if !is_wire {
        let joints = values(first, false);
        let words = out.words(&job.axes[..2], &joints[..2]) + &out.words(&job.axes[3..], &joints[3..]);
        out.line(format_args!("G0{words}"));
    }
    for it in &job.moves {
        let words = out.words(&job.axes, &values(it, tip.is_some()));
        out.block(it, &words);
    }
    out.plain_feed();
    if let Some(tip) = tip {
        out.line(format_args!("{}", tip.off));
    }
    out.line(format_args!("M5"));
    if !is_wire {
        out.line(format_args!("G53 G0 Z0"));
    }
    out.line(format_args!("M2"));
    out.text
}
