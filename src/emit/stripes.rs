//! Stripes as polylines in space.
use std::{fmt::Write as _, io};

use crate::model::Stripes;

/// Writes the lines as OBJ line elements, one object per line; a closed one repeats its first point.
pub fn obj(stripes: &Stripes, out: &mut dyn io::Write) -> io::Result<()> {
    let mut first = 1;
    for (k, line) in stripes.lines.iter().enumerate() {
        writeln!(out, "o line-{}", k + 1)?;
        for p in &line.points {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        write!(out, "l")?;
        (first..first + line.points.len()).try_for_each(|i| write!(out, " {i}"))?;
        writeln!(out, "{}", if line.closed { format!(" {first}") } else { String::new() })?;
        first += line.points.len();
    }
    Ok(())
}

/// The lines as a path for a tool, as CSV: the points of every line from its first, which is the end inside the surface where it
/// has one, with the way along the line, mm.
pub fn path(stripes: &Stripes) -> Vec<u8> {
    let mut out = String::from("line,point,x_mm,y_mm,z_mm,along_mm\n");
    for (k, line) in stripes.lines.iter().enumerate() {
        let mut along = 0.0;
        let again = line.points.first().filter(|_| line.closed);
        let mut last = line.points.first();
        for (i, p) in line.points.iter().chain(again).enumerate() {
            along += last.map_or(0.0, |last| (p - last).norm());
            last = Some(p);
            writeln!(out, "{},{},{:.4},{:.4},{:.4},{:.4}", k + 1, i + 1, p.x, p.y, p.z, along)
                .expect("writing to memory cannot fail");
        }
    }
    out.into_bytes()
}
