//! The files of moulds: solids as STL with programs that mill them, and the schedule of panels.
use std::fmt::Write as _;

use super::{
    drawing::{decimal, short},
    stl,
};
use crate::{
    mesh::{FaceId, Id},
    model::{CutMesh, MoldPanel, MoldProgram, Molds},
};

/// Path and bytes of every solid, binary STL in mm.
pub fn solids(molds: &Molds) -> Vec<(String, Vec<u8>)> {
    let file = |it: &crate::model::MoldSegment| {
        let mut bytes = Vec::new();
        stl::write(&it.mesh, &mut bytes).expect("writing to memory cannot fail");
        (format!("mold/{}.stl", it.name), bytes)
    };
    molds.segments.iter().map(file).collect()
}

/// Decimals of programs, mm: a tenth of what the ball is let down to.
const DECIMALS: usize = 4;

/// Path and text of every program for a mill with three axes: metric, absolute, the zero in the corner of the segment's box.
pub fn programs(molds: &Molds) -> Vec<(String, Vec<u8>)> {
    molds.programs.iter().map(|it| (format!("mold/{}.ngc", it.segment), program(it).into_bytes())).collect()
}

fn program(it: &MoldProgram) -> String {
    let [feed, spindle] = it.speeds.map(short);
    let mut out = format!(
        "(fabricate: mould {})\n(ball nose, diameter {} mm; X Y Z are y z x of the STL)\nG21 G90 G94 G17 G40 G49 G54 G61\nT1 M6\nG43\nM3 S{spindle}\nF{feed}\n",
        it.segment,
        short(2.0 * it.radius)
    );
    let mut first = true;
    for (rapid, p) in &it.moves {
        let [x, y, z] = [p.x, p.y, p.z].map(|value| decimal(value, DECIMALS));
        // Up before the way to the first cut.
        if std::mem::take(&mut first) {
            writeln!(out, "G0 Z{z}").expect("writing to memory cannot fail");
        }
        let word = if *rapid { "G0" } else { "G1" };
        writeln!(out, "{word} X{x} Y{y} Z{z}").expect("writing to memory cannot fail");
    }
    out + "M5\nM2\n"
}

/// The schedule of panels as CSV: each part with its panel, counted from 1, the mould that it is formed on (`flat` where none is
/// needed) and where it lies there: rows from the foot and degrees from the middle meridian, and its total curvature. A panel
/// that was cut further has a line per part. The cut mesh is that of a net of so many `columns`.
pub fn schedule(molds: &Molds, cut: &CutMesh, columns: usize) -> Vec<u8> {
    let mut out = String::from("part,panel,mold,segments,from_row,to_row,strips,angle_deg,curvature_deg\n");
    let mut panel_of: Vec<Option<usize>> = vec![None; cut.pieces.len()];
    for f in cut.mesh.faces() {
        panel_of[cut.piece_of[f].index()] = panel(molds, f, columns);
    }
    for ((_, piece), panel) in cut.pieces.enumerate().zip(&panel_of) {
        let Some(number) = *panel else { continue };
        let it = &molds.panels[number];
        let mold = it.mold.map_or("flat".to_owned(), |k| format!("M{}", k + 1));
        let names: Vec<&str> = molds
            .segments
            .iter()
            .filter(|s| it.mold.is_some() && s.rows[0] >= it.rows[0] && s.rows[1] <= it.rows[1])
            .map(|s| s.name.as_str())
            .collect();
        let strips = it.columns[1] - it.columns[0];
        let curvature = it.mold.map_or(0.0, |k| molds.curvature[k].to_degrees());
        writeln!(
            out,
            "{},P{},{mold},{},{},{},{strips},{:.3},{curvature:.3}",
            piece.name,
            number + 1,
            names.join(" "),
            it.rows[0],
            it.rows[1],
            (molds.step * strips as f64).to_degrees(),
        )
        .expect("writing to memory cannot fail");
    }
    out.into_bytes()
}

/// The panel of a face of the net, whose quads are two faces each, row by row.
fn panel(molds: &Molds, face: FaceId, columns: usize) -> Option<usize> {
    let (row, column) = (face.index() / 2 / (columns - 1), face.index() / 2 % (columns - 1));
    let within = |at: usize, [from, to]: [usize; 2]| (from..to).contains(&at);
    molds.panels.iter().position(|it: &MoldPanel| within(row, it.rows) && within(column, it.columns))
}
