//! DXF R12 (AC1009): the same lines as POLYLINEs, for old controllers that read nothing newer.
use std::io;

use super::{
    drawing::Drawing,
    dxf::{Dxf, color_index, drawn},
};
use crate::profile::Machine;

/// Writes a drawing.
pub(super) fn write(drawing: &Drawing<'_>, machine: &Machine, out: &mut dyn io::Write) -> io::Result<()> {
    let layers = drawn(drawing, machine);
    let mut dxf = Dxf::default();
    dxf.section("HEADER", |it| {
        it.pairs(&[(9, "$ACADVER"), (1, "AC1009")]);
        it.pairs(&[(9, "$INSUNITS"), (70, "4"), (9, "$MEASUREMENT"), (70, "1")]);
    });
    dxf.section("TABLES", |it| {
        it.pairs(&[(0, "TABLE"), (2, "LTYPE"), (70, "1")]);
        it.pairs(&[(0, "LTYPE"), (2, "CONTINUOUS"), (70, "0"), (3, "Solid line"), (72, "65"), (73, "0"), (40, "0.0")]);
        it.pairs(&[(0, "ENDTAB"), (0, "TABLE"), (2, "LAYER")]);
        it.pair(70, layers.len() + 1);
        for (name, color) in std::iter::once(("0", 7)).chain(layers.iter().map(|it| (it.name, color_index(it.color)))) {
            it.pairs(&[(0, "LAYER"), (2, name), (70, "0")]);
            it.pair(62, color);
            it.pair(6, "CONTINUOUS");
        }
        it.pair(0, "ENDTAB");
    });
    dxf.section("BLOCKS", |_| ());
    dxf.section("ENTITIES", |it| {
        for layer in &layers {
            for (points, closed) in &layer.lines {
                it.pairs(&[(0, "POLYLINE"), (8, layer.name), (66, "1"), (10, "0.0"), (20, "0.0"), (30, "0.0")]);
                it.pair(70, u8::from(*closed));
                for point in points {
                    it.pairs(&[(0, "VERTEX"), (8, layer.name)]);
                    it.point(10, *point);
                    it.pair(30, "0.0");
                }
                it.pairs(&[(0, "SEQEND"), (8, layer.name)]);
            }
        }
    });
    dxf.pair(0, "EOF");
    out.write_all(dxf.0.as_bytes())
}
