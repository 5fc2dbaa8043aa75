//! Strips as a polygon mesh, and the tables of bends for rolling and for a press brake.
use std::{fmt::Write as _, io};

use crate::{
    mesh::Field,
    model::{Piece, PieceId, Ruling, Strips},
};

/// Writes the panels as OBJ polygons, an object per piece and a group per strip. Neighbouring pieces share the points of
/// their seams.
pub fn obj(strips: &Strips, pieces: &Field<PieceId, Piece>, out: &mut dyn io::Write) -> io::Result<()> {
    for p in &strips.points {
        writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
    }
    let mut last = None;
    for panel in &strips.panels {
        let group = (panel.piece, panel.strip);
        if last.is_none_or(|it: (PieceId, u32)| it.0 != panel.piece) {
            writeln!(out, "o {}", pieces[panel.piece].name)?;
        }
        if last != Some(group) {
            writeln!(out, "g {}-{}", pieces[panel.piece].name, panel.strip + 1)?;
            last = Some(group);
        }
        write!(out, "f")?;
        for &c in &panel.outline {
            write!(out, " {}", strips.corners[c as usize].point + 1)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// The rulings that are rolled, in the order of work along each strip, as CSV. `feed_mm` is the way from the ruling before
/// in the same strip, middle to middle; places are those of the files of the parts; bends are positive where the outer
/// side is convex. Radii are those of the curvature across the ruling at its start (x1, y1), its middle and its end, where a
/// ruling of a cone or of tangents has different ones; where rulings meet in a point it is 0 there.
pub fn rolling(strips: &Strips, pieces: &Field<PieceId, Piece>) -> Vec<u8> {
    let mut out = String::from(
        "piece,strip,ruling,x1_mm,y1_mm,x2_mm,y2_mm,length_mm,feed_mm,bend_deg,radius_start_mm,radius_middle_mm,radius_end_mm\n",
    );
    let mut last: Option<&Ruling> = None;
    for (number, it) in in_order(strips, |it| it.bend.abs() < strips.fold_angle) {
        let strip = |r: &Ruling| r.panels.map(|p| strips.panels[p as usize].strip);
        let same = last.filter(|l| l.piece == it.piece && strip(l) == strip(it) && strip(it)[0] == strip(it)[1]);
        let feed = same.map_or_else(String::new, |l| format!("{:.3}", (middle(strips, l) - middle(strips, it)).norm()));
        let [a, b] = strip(it);
        let strip = if a == b { (a + 1).to_string() } else { format!("{}-{}", a.min(b) + 1, a.max(b) + 1) };
        line(&mut out, strips, it, &[&pieces[it.piece].name, &strip, &number.to_string()]);
        let [x, y, z] = it.radius;
        put(&mut out, format_args!(",{feed},{:.3},{x:.2},{y:.2},{z:.2}\n", it.bend.to_degrees()));
        last = Some(it);
    }
    out.into_bytes()
}

/// The rulings that are folded, as CSV. The angle is that between the flat sheet and the flange; `up` means towards the
/// printed outer side.
pub fn press_brake(strips: &Strips, pieces: &Field<PieceId, Piece>) -> Vec<u8> {
    let mut out = String::from("piece,bend,x1_mm,y1_mm,x2_mm,y2_mm,length_mm,angle_deg,direction\n");
    for (number, it) in in_order(strips, |it| it.bend.abs() >= strips.fold_angle) {
        line(&mut out, strips, it, &[&pieces[it.piece].name, &number.to_string()]);
        // On a mountain fold both flanges go down from the outer side.
        let direction = if it.bend > 0.0 { "down" } else { "up" };
        put(&mut out, format_args!(",{:.2},{direction}\n", it.bend.abs().to_degrees()));
    }
    out.into_bytes()
}

/// Rulings by piece and place in the strips, numbered from 1 in every piece.
fn in_order(strips: &Strips, wanted: impl Fn(&Ruling) -> bool) -> Vec<(usize, &Ruling)> {
    let mut rulings: Vec<&Ruling> = strips.rulings.iter().filter(|it| wanted(it)).collect();
    rulings.sort_by_key(|it| (it.piece, it.panels[0].max(it.panels[1]), it.panels[0].min(it.panels[1])));
    let chunks = rulings.chunk_by(|a, b| a.piece == b.piece);
    chunks.flat_map(|group| group.iter().enumerate().map(|(k, it)| (k + 1, *it))).collect()
}

fn middle(strips: &Strips, it: &Ruling) -> crate::geom::Vec2 {
    (strips.flat(it.ends[0]) + strips.flat(it.ends[1])) / 2.0
}

/// Names, ends and length of a ruling.
fn line(out: &mut String, strips: &Strips, it: &Ruling, names: &[&str]) {
    let [a, b] = it.ends.map(|c| strips.flat(c));
    let names = names.join(",");
    put(out, format_args!("{names},{:.3},{:.3},{:.3},{:.3},{:.3}", a.x, a.y, b.x, b.y, (b - a).norm()));
}

fn put(out: &mut String, text: std::fmt::Arguments<'_>) {
    out.write_fmt(text).expect("writing to memory cannot fail");
}
