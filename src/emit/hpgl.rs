//! HPGL for cutting plotters: 40 units per millimetre, one coordinate pair per command and a line each, because long
//! lists overrun some cutters.
use std::io;

use super::drawing::decimal;
use crate::{geom::Vec2, model::SheetPaths, profile::Machine};

/// Plotter units per millimetre.
const UNITS: f64 = 40.0;

/// Millimetres a minute in a centimetre a second.
const CM_PER_SECOND: f64 = 600.0;

/// Writes the plot of one sheet. `SP` selects the tool number of the operation.
pub(super) fn write(sheet: &SheetPaths, machine: &Machine, out: &mut dyn io::Write) -> io::Result<()> {
    let place = |point: Vec2| {
        let point = machine.to_work(point, sheet.size) * UNITS;
        format!("{},{}", decimal(point.x, 0), decimal(point.y, 0))
    };
    let mut text = String::from("IN;\nPA;\n");
    let mut selected = None;
    let (mut speed, mut force) = (0.0, 0.0);
    for path in &sheet.paths {
        let points = path.path.chords(super::CHORD);
        let (Some(tool), [first, rest @ ..]) = (machine.tools.get(path.operation), points.as_slice()) else {
            continue;
        };
        if selected != Some(tool.number) {
            // The other tool is put in with this one lifted.
            text.push_str(if selected.is_some() { "PU;\n" } else { "" });
            text.push_str(&format!("SP{};\n", tool.number));
            selected = Some(tool.number);
        }
        let mut set = |state: &mut f64, name: &str, value: Option<f64>| {
            if let Some(value) = value.filter(|it| it != state) {
                // Speed and force hold from the next movement on.
                text.push_str(&format!("{name}{value};\n"));
                *state = value;
            }
        };
        // Whole centimetres a second and grams, which every cutter takes.
        set(&mut speed, "VS", machine.velocity.then(|| (tool.feed / CM_PER_SECOND).round().max(1.0)));
        set(&mut force, "FS", tool.force.map(f64::round));
        let mut last = place(*first);
        if !path.joined {
            text.push_str(&format!("PU{last};\n"));
        }
        for point in rest.iter().map(|it| place(*it)) {
            // Points that fall together on the plotter's grid are one.
            if point != last {
                text.push_str(&format!("PD{point};\n"));
                last = point;
            }
        }
    }
    text.push_str("PU;\nSP0;\n");
    out.write_all(text.as_bytes())
}
