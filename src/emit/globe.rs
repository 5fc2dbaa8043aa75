//! The image of a surface on the sphere, in full precision.
use std::io;

use crate::model::Globe;

/// Writes the image as an OBJ with the faces of the input and 17 significant digits: a map without flipped faces rounded to
/// fewer has some.
pub fn obj(globe: &Globe, out: &mut dyn io::Write) -> io::Result<()> {
    for p in &globe.points {
        writeln!(out, "v {:.16e} {:.16e} {:.16e}", p.x, p.y, p.z)?;
    }
    for [a, b, c] in &globe.faces {
        writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1)?;
    }
    Ok(())
}
