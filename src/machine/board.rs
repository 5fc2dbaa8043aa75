//! What a GRBL-type board says about itself, and what of it does not fit the profile or the program.
use std::collections::BTreeMap;

use super::{
    program::Bounds,
    reply::{Mode, Report},
    timing::Limits,
};
use crate::{
    import::gcode::{Offsets, path::Point},
    profile::{Head, Machine},
};

/// GRBL's default, mm; where the board does not tell.
const JUNCTION: f64 = 0.01;

/// How a board is spoken to.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Fill the receive buffer by counting characters; otherwise one line at a time.
    pub counting: bool,
    /// Largest motion to have on the board, s.
    pub buffered: f64,
    /// How long a board may take to start after the port was opened, s.
    pub boot: f64,
    /// Lines that bring the tool to rest after M5: a servo's way up.
    pub retract: Vec<String>,
    /// Work height of the lifted tool where there is a Z axis, mm.
    pub clear_height: Option<f64>,
}

/// What the board said about itself.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Board {
    /// Its banner.
    pub banner: String,
    /// `$n` = value.
    pub settings: BTreeMap<u16, f64>,
    /// Letters of `[OPT:…]`.
    pub letters: String,
    /// Blocks of the planner.
    pub blocks: Option<u32>,
    /// Bytes of the receive buffer.
    pub receive: Option<u32>,
    /// Offsets.
    pub offsets: Offsets,
    /// Last reported machine position.
    pub position: Point,
    /// Axes that it reports.
    pub axes: Option<usize>,
    /// Last reported state.
    pub mode: Option<Mode>,
    /// Feed override in force, percent.
    pub overrides: u32,
}

/// Drives as the profile tells, for estimates without a board.
pub fn profile_limits(machine: &Machine) -> Limits {
    Limits { rate: [machine.rapid; 3], acceleration: [machine.acceleration; 3], junction: JUNCTION }
}

impl Board {
    /// Keeps an offset that `$#` tells.
    pub(super) fn set_offset(&mut self, name: &str, p: Point) {
        let offsets = &mut self.offsets;
        match name {
            "G92" => offsets.g92 = p,
            "G28" => offsets.park[0] = Some(p),
            "G30" => offsets.park[1] = Some(p),
            _ => {
                if let Some(slot) =
                    name[1..].parse::<usize>().ok().and_then(|it| offsets.work.get_mut(it.checked_sub(54)?))
                {
                    *slot = p;
                }
            }
        }
    }

    /// Keeps what a report says; parts of it come only now and then.
    pub(super) fn note(&mut self, report: &Report) {
        self.mode = Some(report.mode);
        self.axes = report.axes.or(self.axes);
        if let Some(p) = report.machine {
            self.position = p;
        } else if let Some(p) = report.work {
            let zero = report.offset.unwrap_or_else(|| self.work_zero());
            self.position = std::array::from_fn(|i| p[i] + zero[i]);
        }
        if let Some(percent) = report.overrides {
            self.overrides = percent;
        }
    }

    /// Machine position of the zero of G54.
    pub(super) fn work_zero(&self) -> Point {
        let mut zero: Point = std::array::from_fn(|i| self.offsets.work[0][i] + self.offsets.g92[i]);
        zero[2] += self.offsets.tool;
        zero
    }

    fn setting(&self, key: u16) -> Option<f64> {
        self.settings.get(&key).copied()
    }

    /// Whether it has homing switches.
    pub fn homes(&self) -> bool {
        self.setting(22).is_some_and(|it| it as u32 & 1 == 1)
    }

    /// Its drives; what it does not tell is the profile's.
    pub fn limits(&self, machine: &Machine) -> Limits {
        let fallback = profile_limits(machine);
        let positive = |key: u16| self.setting(key).filter(|&it| it > 0.0);
        let axes = |first: u16, other: Point| std::array::from_fn(|i| positive(first + i as u16).unwrap_or(other[i]));
        Limits {
            rate: axes(110, fallback.rate),
            acceleration: axes(120, fallback.acceleration),
            junction: positive(11).unwrap_or(fallback.junction),
        }
    }

    /// Range of an axis in machine coordinates. GRBL's travel is negative, unless it was built to set the origin where
    /// it homes (letter Z, or bit 3 of `$22` on grblHAL), and then on the side that `$23` says.
    fn range(&self, axis: usize) -> Option<(f64, f64)> {
        let travel = self.setting(130 + axis as u16).filter(|&it| it > 0.0)?;
        let bits = |key: u16| self.setting(key).unwrap_or(0.0) as u32;
        let forced = self.letters.contains('Z') && !self.banner.contains("HAL") || bits(22) & 8 != 0;
        let positive = forced && bits(23) >> axis & 1 == 1;
        Some(if positive { (0.0, travel) } else { (-travel, 0.0) })
    }

    /// What does not fit the profile; nothing must be sent then.
    pub fn mismatches(&self, machine: &Machine) -> Vec<String> {
        let mut out = Vec::new();
        let told = self.setting(32).map(|it| it != 0.0);
        match (machine.head.laser_mode(), told) {
            (Some(true), Some(false)) => out.push(
                "the board is not in laser mode ($32=0): it would stop at every change of power and burn there; send \
                 `$32=1` to it, or choose another machine profile"
                    .to_owned(),
            ),
            (Some(false), Some(true)) => out.push(
                "the board is in laser mode ($32=1): a servo on the spindle output would not wait for the motion; send \
                 `$32=0` to it, or choose another machine profile"
                    .to_owned(),
            ),
            _ => {}
        }
        if let (Head::Laser { power_max, .. }, Some(max)) = (&machine.head, self.setting(30))
            && (max - power_max).abs() > 0.5
        {
            out.push(format!(
                "full power is S{power_max} in the profile and S{max} on the board ($30): the laser would run at \
                     {:.0} % of the power meant; make them equal",
                100.0 * power_max / max
            ));
        }
        if let (Head::Servo { up, down, .. }, Some(max)) = (&machine.head, self.setting(30)) {
            let most = up.max(*down);
            if most > max {
                out.push(format!("the servo needs S{most}, the board allows at most S{max} ($30)"));
            }
        }
        if self.setting(13).is_some_and(|it| it != 0.0) {
            out.push("the board reports in inches ($13=1); send `$13=0` to it".to_owned());
        }
        out
    }

    /// What a program needs that the board has not got: an axis that turns.
    pub fn lacks(&self, turns: Option<(usize, char)>) -> Option<String> {
        let ((line, letter), axes) = (turns?, self.axes?);
        (axes <= 3).then(|| {
            format!(
                "line {}: the program turns an axis {letter}; the board reports {axes} axes and would refuse the line with \
                 the tool at work: use a board with a fourth axis, or another machine profile",
                line + 1
            )
        })
    }

    /// Where the program would leave the machine's travel, going by its position and offsets.
    pub fn travel_faults(&self, machine: &Bounds, z: bool) -> Vec<String> {
        let mut out = Vec::new();
        if machine.is_empty() {
            return out;
        }
        for (axis, name) in ["X", "Y", "Z"].into_iter().enumerate().take(if z { 3 } else { 2 }) {
            let Some((low, high)) = self.range(axis) else { continue };
            let (min, max) = (machine.min[axis], machine.max[axis]);
            if min < low - 0.01 || max > high + 0.01 {
                out.push(format!(
                    "the program goes from {name}{min:.2} to {name}{max:.2} in machine coordinates; the travel is \
                     {name}{low:.2} to {name}{high:.2} (${}), the work zero is at {name}{:.2}: set the zero (--zero) \
                     so that the job fits, or move the job",
                    130 + axis,
                    self.offsets.work[0][axis] + self.offsets.g92[axis],
                ));
            }
        }
        out
    }
}
