//! SVG at true size: millimetres as user units, one top-level layer per operation, plain stroke attributes, no transforms,
//! classes, clips or text, so that every importer sees the same lines.
use std::io;

use svg::{
    Document,
    node::element::{Group, Path},
};

use super::drawing::{CHECK_COLOR, CHECK_LAYER, Drawing, coordinate, short};
use crate::{
    geom::Vec2,
    profile::{Color, Machine},
};

/// Writes a drawing. SVG's y axis points down, so y is mirrored in the page.
pub(super) fn write(drawing: &Drawing<'_>, machine: &Machine, out: &mut dyn io::Write) -> io::Result<()> {
    let (width, height) = (short(drawing.size.x), short(drawing.size.y));
    let mut document = Document::new()
        .set("xmlns:inkscape", "http://www.inkscape.org/namespaces/inkscape")
        .set("width", format!("{width}mm"))
        .set("height", format!("{height}mm"))
        .set("viewBox", format!("0 0 {width} {height}"));
    for (layer, lines) in drawing.layers(machine) {
        let mut group = group(&layer.name);
        for line in lines {
            let data = path_data(&drawing.points(line), line.closed, drawing.size.y);
            group = group.add(path(data, layer.color, machine));
        }
        document = document.add(group);
    }
    if !drawing.check.is_empty() {
        let paths = drawing.check().map(|it| path(path_data(&it, false, drawing.size.y), CHECK_COLOR, machine));
        document = document.add(paths.fold(group(CHECK_LAYER), Group::add));
    }
    out.write_all(b"<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n")?;
    svg::write(&mut *out, &document)?;
    out.write_all(b"\n")
}

/// An empty layer.
fn group(name: &str) -> Group {
    Group::new().set("inkscape:groupmode", "layer").set("inkscape:label", name).set("id", name.to_lowercase())
}

fn path(data: String, color: Color, machine: &Machine) -> Path {
    Path::new()
        .set("d", data)
        .set("fill", "none")
        .set("stroke", String::from(color))
        .set("stroke-width", short(machine.hairline.mm))
}

fn path_data(points: &[Vec2], closed: bool, height: f64) -> String {
    let mut data = String::with_capacity(20 * points.len());
    for (i, point) in points.iter().enumerate() {
        data.push_str(match i {
            0 => "M",
            1 => " L",
            _ => " ",
        });
        data.push_str(&coordinate(point.x));
        data.push(',');
        data.push_str(&coordinate(height - point.y));
    }
    if closed {
        data.push_str(" Z");
    }
    data
}
