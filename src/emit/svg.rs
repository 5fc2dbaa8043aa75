//! SVG at true size: millimetres as user units, one top-level layer per operation, plain stroke attributes, no transforms,
//! classes, clips or text, so that every importer sees the same lines.
use std::io;

use svg::{
    Document,
    node::element::{Group, Path},
};

use super::drawing::{Drawing, coordinate, short};
use crate::{geom::Vec2, profile::Machine};

/// Writes a drawing. SVG's y axis points down, so y is mirrored in the page.
pub(super) fn write(drawing: &Drawing<'_>, machine: &Machine, out: &mut dyn io::Write) -> io::Result<()> {
    let (width, height) = (short(drawing.size.x), short(drawing.size.y));
    let mut document = Document::new()
        .set("xmlns:inkscape", "http://www.inkscape.org/namespaces/inkscape")
        .set("width", format!("{width}mm"))
        .set("height", format!("{height}mm"))
        .set("viewBox", format!("0 0 {width} {height}"));
    for (layer, lines) in drawing.layers(machine) {
        let mut group = Group::new()
            .set("inkscape:groupmode", "layer")
            .set("inkscape:label", layer.name.as_str())
            .set("id", layer.name.to_lowercase());
        for line in lines {
            let path = Path::new()
                .set("d", path_data(&drawing.points(line), line.closed, drawing.size.y))
                .set("fill", "none")
                .set("stroke", String::from(layer.color))
                .set("stroke-width", short(machine.hairline.mm));
            group = group.add(path);
        }
        document = document.add(group);
    }
    out.write_all(b"<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n")?;
    svg::write(&mut *out, &document)?;
    out.write_all(b"\n")
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
