//! A net as a mesh of quads, and the lists of its laths.
use std::{fmt::Write as _, io};

use crate::model::{GeodesicNet, Lath};

/// Writes the net as an OBJ with 17 significant digits; vertex (i, j) has number i columns + j + 1.
pub fn obj(net: &GeodesicNet, out: &mut dyn io::Write) -> io::Result<()> {
    for p in &net.points {
        writeln!(out, "v {:.16e} {:.16e} {:.16e}", p.x, p.y, p.z)?;
    }
    for i in 0..net.rows - 1 {
        for j in 0..net.columns - 1 {
            let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| net.index(i, j) + 1);
            writeln!(out, "f {a} {b} {c} {d}")?;
        }
    }
    Ok(())
}

/// The cut list of laths as CSV: bars are counted from 1, and begin at 0; a lath that is longer than a bar has none.
pub fn cut_list(laths: &[Lath]) -> Vec<u8> {
    let mut out = String::from("lath,length_mm,crossings,bar,from_mm\n");
    for it in laths {
        let bar = it.bar.map_or(",".to_owned(), |(bar, from)| format!("{},{from:.2}", bar + 1));
        writeln!(out, "{},{:.2},{},{bar}", it.name, it.length, it.crossings.len())
            .expect("writing to memory cannot fail");
    }
    out.into_bytes()
}

/// The crossings along every lath as CSV: where its holes are, from its beginning, and how far both lines pass each other.
pub fn crossings(laths: &[Lath]) -> Vec<u8> {
    let mut out = String::from("lath,at_mm,crosses,gap_mm\n");
    for (lath, it) in laths.iter().flat_map(|lath| lath.crossings.iter().map(move |it| (lath, it))) {
        writeln!(out, "{},{:.2},{},{:.3}", lath.name, it.at, it.other, it.gap).expect("writing to memory cannot fail");
    }
    out.into_bytes()
}
