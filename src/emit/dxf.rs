//! DXF R2000 (AC1015) with closed LWPOLYLINEs on named layers, in millimetres.
//!
//! Written by hand because shops refuse what general writers make of it (see `CUTFILES.md`): both unit headers are set,
//! every object has a handle and an owner, no date and no random id goes in. The structure is that of Autodesk's "DXF
//! Reference" for AutoCAD 2000: the tables, the two block records with their blocks and layouts, the root dictionary.
use std::{fmt::Display, io};

use super::drawing::{CHECK_COLOR, CHECK_LAYER, Drawing, coordinate};
use crate::{
    geom::{Box2, Vec2},
    profile::{Color, Machine},
};

/// Handles of the fixed objects, hexadecimal in the file.
mod handle {
    pub(super) const VPORT_TABLE: u32 = 0x1;
    pub(super) const LTYPE_TABLE: u32 = 0x2;
    pub(super) const LAYER_TABLE: u32 = 0x3;
    pub(super) const STYLE_TABLE: u32 = 0x4;
    pub(super) const VIEW_TABLE: u32 = 0x5;
    pub(super) const UCS_TABLE: u32 = 0x6;
    pub(super) const APPID_TABLE: u32 = 0x7;
    pub(super) const DIMSTYLE_TABLE: u32 = 0x8;
    pub(super) const RECORD_TABLE: u32 = 0x9;
    pub(super) const ROOT: u32 = 0xA;
    pub(super) const GROUPS: u32 = 0xB;
    pub(super) const LAYOUTS: u32 = 0xC;
    pub(super) const PLOT_STYLES: u32 = 0xD;
    pub(super) const PLOT_STYLE: u32 = 0xE;
    pub(super) const VPORT: u32 = 0x10;
    pub(super) const BY_BLOCK: u32 = 0x11;
    pub(super) const BY_LAYER: u32 = 0x12;
    pub(super) const CONTINUOUS: u32 = 0x13;
    pub(super) const STYLE: u32 = 0x14;
    pub(super) const APPID: u32 = 0x15;
    pub(super) const DIMSTYLE: u32 = 0x16;
    pub(super) const LAYER_ZERO: u32 = 0x17;
    pub(super) const DASHED: u32 = 0x18;
    /// Record, block, end of block and layout of model space; those of paper space follow.
    pub(super) const MODEL: [u32; 4] = [0x20, 0x21, 0x22, 0x23];
    pub(super) const PAPER: [u32; 4] = [0x24, 0x25, 0x26, 0x27];
    /// Layers, then entities, count up from here.
    pub(super) const FIRST_FREE: u32 = 0x40;
}

/// Name of the only line type that is not continuous.
const DASHED: &str = "DASHED";

/// Some colours of the AutoCAD Colour Index; R2000 knows no others.
const COLOR_INDEX: &[(u8, [i32; 3])] = &[
    (1, [255, 0, 0]),
    (2, [255, 255, 0]),
    (3, [0, 255, 0]),
    (4, [0, 255, 255]),
    (5, [0, 0, 255]),
    (6, [255, 0, 255]),
    (7, [0, 0, 0]),
    (8, [128, 128, 128]),
    (9, [192, 192, 192]),
    (30, [255, 127, 0]),
    (54, [165, 165, 82]),
    (94, [0, 127, 0]),
    (174, [0, 0, 127]),
    (14, [127, 0, 0]),
];

/// A layer as it is written.
pub(super) struct Drawn<'a> {
    pub(super) name: &'a str,
    pub(super) color: Color,
    /// Whether it is to be printed and cut.
    plotted: bool,
    dashed: bool,
    /// Points, and whether the last joins the first.
    pub(super) lines: Vec<(Vec<Vec2>, bool)>,
}

/// The layers of a drawing, the check line last.
pub(super) fn drawn<'m>(drawing: &Drawing<'_>, machine: &'m Machine) -> Vec<Drawn<'m>> {
    let layers = drawing.layers(machine).into_iter().map(|(layer, lines)| Drawn {
        name: &layer.name,
        color: layer.color,
        plotted: true,
        dashed: layer.dashed,
        lines: lines.into_iter().map(|it| (drawing.points(it), it.closed)).collect(),
    });
    let check = || drawing.check().map(|it| (it, false)).collect();
    let check = (!drawing.check.is_empty()).then(|| Drawn {
        name: CHECK_LAYER,
        color: CHECK_COLOR,
        plotted: false,
        dashed: false,
        lines: check(),
    });
    layers.chain(check).collect()
}

/// Writes a drawing.
pub(super) fn write(drawing: &Drawing<'_>, machine: &Machine, out: &mut dyn io::Write) -> io::Result<()> {
    let layers = drawn(drawing, machine);
    let mut entities = Dxf::default();
    let mut next = handle::FIRST_FREE + layers.len() as u32;
    let mut bounds = Box2::empty();
    for layer in &layers {
        for (points, closed) in &layer.lines {
            points.iter().for_each(|point| bounds.grow(point));
            entities.polyline(next, layer.name, points, *closed);
            next += 1;
        }
    }
    let mut dxf = Dxf::default();
    dxf.header(drawing.size, bounds, next);
    dxf.section("CLASSES", |_| ());
    dxf.section("TABLES", |it| it.tables(drawing.size, &layers));
    dxf.section("BLOCKS", Dxf::blocks);
    dxf.section("ENTITIES", |it| it.0.push_str(&entities.0));
    dxf.section("OBJECTS", |it| it.objects(drawing.size));
    dxf.pair(0, "EOF");
    out.write_all(dxf.0.as_bytes())
}

/// Nearest entry of the colour index by squared distance in sRGB.
pub(super) fn color_index(color: Color) -> u8 {
    let distance = |other: [i32; 3]| -> i32 { (0..3).map(|i| (i32::from(color.0[i]) - other[i]).pow(2)).sum() };
    COLOR_INDEX.iter().min_by_key(|it| distance(it.1)).map_or(7, |it| it.0)
}

/// The text of a file: pairs of a group code and a value.
#[derive(Default)]
pub(super) struct Dxf(pub(super) String);

impl Dxf {
    pub(super) fn pair(&mut self, code: u16, value: impl Display) {
        self.0.push_str(&format!("{code:>3}\r\n{value}\r\n"));
    }

    pub(super) fn pairs(&mut self, pairs: &[(u16, &str)]) {
        for (code, value) in pairs {
            self.pair(*code, value);
        }
    }

    fn handle(&mut self, code: u16, handle: u32) {
        self.pair(code, format_args!("{handle:X}"));
    }

    pub(super) fn point(&mut self, code: u16, point: Vec2) {
        self.pair(code, coordinate(point.x));
        self.pair(code + 10, coordinate(point.y));
    }

    pub(super) fn section(&mut self, name: &str, content: impl FnOnce(&mut Self)) {
        self.pairs(&[(0, "SECTION"), (2, name)]);
        content(self);
        self.pair(0, "ENDSEC");
    }

    fn header(&mut self, size: Vec2, bounds: Box2, next_handle: u32) {
        // An empty drawing has no bounds; the page stands in.
        let bounds = if bounds.min.x <= bounds.max.x { bounds } else { Box2 { min: Vec2::zeros(), max: size } };
        self.section("HEADER", |it| {
            it.pairs(&[(9, "$ACADVER"), (1, "AC1015"), (9, "$DWGCODEPAGE"), (3, "ANSI_1252")]);
            for (name, point) in [("$INSBASE", Vec2::zeros()), ("$EXTMIN", bounds.min), ("$EXTMAX", bounds.max)] {
                it.pair(9, name);
                it.point(10, point);
                it.pair(30, "0.0");
            }
            for (name, point) in [("$LIMMIN", Vec2::zeros()), ("$LIMMAX", size)] {
                it.pair(9, name);
                it.point(10, point);
            }
            // 4 = millimetres, 1 = metric: some readers look at the one, some at the other.
            it.pairs(&[(9, "$INSUNITS"), (70, "4"), (9, "$MEASUREMENT"), (70, "1")]);
            it.pairs(&[(9, "$LUNITS"), (70, "2"), (9, "$LUPREC"), (70, "4"), (9, "$HANDSEED")]);
            it.handle(5, next_handle);
        });
    }

    /// Head of a symbol table.
    fn table(&mut self, name: &str, handle: u32, entries: usize, content: impl FnOnce(&mut Self)) {
        self.pairs(&[(0, "TABLE"), (2, name)]);
        self.handle(5, handle);
        self.handle(330, 0);
        self.pair(100, "AcDbSymbolTable");
        self.pair(70, entries);
        content(self);
        self.pair(0, "ENDTAB");
    }

    /// Head of an entry of a symbol table.
    fn entry(&mut self, kind: &str, class: &str, handle: u32, owner: u32, name: &str) {
        self.pair(0, kind);
        // Dimension styles alone have their handle under 105, because 5 is one of their values.
        self.handle(if kind == "DIMSTYLE" { 105 } else { 5 }, handle);
        self.handle(330, owner);
        self.pairs(&[(100, "AcDbSymbolTableRecord"), (100, class), (2, name)]);
    }

    fn tables(&mut self, size: Vec2, layers: &[Drawn<'_>]) {
        self.table("VPORT", handle::VPORT_TABLE, 1, |it| it.viewport(size));
        self.table("LTYPE", handle::LTYPE_TABLE, 4, |it| {
            for (handle, name, text) in [
                (handle::BY_BLOCK, "ByBlock", ""),
                (handle::BY_LAYER, "ByLayer", ""),
                (handle::CONTINUOUS, "Continuous", "Solid line"),
            ] {
                it.entry("LTYPE", "AcDbLinetypeTableRecord", handle, handle::LTYPE_TABLE, name);
                it.pairs(&[(70, "0"), (3, text), (72, "65"), (73, "0"), (40, "0.0")]);
            }
            it.entry("LTYPE", "AcDbLinetypeTableRecord", handle::DASHED, handle::LTYPE_TABLE, DASHED);
            it.pairs(&[(70, "0"), (3, "Dashed __ __ __"), (72, "65"), (73, "2"), (40, "9.0")]);
            it.pairs(&[(49, "6.0"), (74, "0"), (49, "-3.0"), (74, "0")]);
        });
        self.table("LAYER", handle::LAYER_TABLE, layers.len() + 1, |it| {
            let zero = Drawn { name: "0", color: Color([0; 3]), plotted: true, dashed: false, lines: Vec::new() };
            it.layer(handle::LAYER_ZERO, &zero);
            for (handle, layer) in (handle::FIRST_FREE..).zip(layers) {
                it.layer(handle, layer);
            }
        });
        self.table("STYLE", handle::STYLE_TABLE, 1, |it| {
            it.entry("STYLE", "AcDbTextStyleTableRecord", handle::STYLE, handle::STYLE_TABLE, "Standard");
            it.pairs(&[(70, "0"), (40, "0.0"), (41, "1.0"), (50, "0.0"), (71, "0"), (42, "2.5"), (3, "txt"), (4, "")]);
        });
        self.table("VIEW", handle::VIEW_TABLE, 0, |_| ());
        self.table("UCS", handle::UCS_TABLE, 0, |_| ());
        self.table("APPID", handle::APPID_TABLE, 1, |it| {
            it.entry("APPID", "AcDbRegAppTableRecord", handle::APPID, handle::APPID_TABLE, "ACAD");
            it.pair(70, 0);
        });
        self.table("DIMSTYLE", handle::DIMSTYLE_TABLE, 1, |it| {
            it.pairs(&[(100, "AcDbDimStyleTable"), (71, "0")]);
            it.entry("DIMSTYLE", "AcDbDimStyleTableRecord", handle::DIMSTYLE, handle::DIMSTYLE_TABLE, "Standard");
            it.pair(70, 0);
        });
        self.table("BLOCK_RECORD", handle::RECORD_TABLE, 2, |it| {
            for (name, [record, _, _, layout]) in [("*Model_Space", handle::MODEL), ("*Paper_Space", handle::PAPER)] {
                it.entry("BLOCK_RECORD", "AcDbBlockTableRecord", record, handle::RECORD_TABLE, name);
                it.handle(340, layout);
            }
        });
    }

    /// The view that opens: the whole page.
    fn viewport(&mut self, size: Vec2) {
        self.entry("VPORT", "AcDbViewportTableRecord", handle::VPORT, handle::VPORT_TABLE, "*Active");
        self.pair(70, 0);
        let zero = Vec2::zeros();
        for (code, point) in [
            (10, zero),
            (11, Vec2::repeat(1.0)),
            (12, size / 2.0),
            (13, zero),
            (14, Vec2::repeat(10.0)),
            (15, Vec2::repeat(10.0)),
        ] {
            self.point(code, point);
        }
        self.pairs(&[(16, "0.0"), (26, "0.0"), (36, "1.0"), (17, "0.0"), (27, "0.0"), (37, "0.0")]);
        self.pair(40, coordinate(size.y));
        self.pair(41, coordinate(if size.y > 0.0 { size.x / size.y } else { 1.0 }));
        self.pairs(&[(42, "50.0"), (43, "0.0"), (44, "0.0"), (50, "0.0"), (51, "0.0")]);
        self.pairs(&[(71, "0"), (72, "1000"), (73, "1"), (74, "3"), (75, "0"), (76, "0"), (77, "0"), (78, "0")]);
    }

    fn layer(&mut self, handle: u32, layer: &Drawn<'_>) {
        self.entry("LAYER", "AcDbLayerTableRecord", handle, handle::LAYER_TABLE, layer.name);
        self.pair(70, 0);
        self.pair(62, color_index(layer.color));
        self.pair(6, if layer.dashed { DASHED } else { "Continuous" });
        if !layer.plotted {
            self.pair(290, 0);
        }
        self.pair(370, -3);
        self.handle(390, handle::PLOT_STYLE);
    }

    fn blocks(&mut self) {
        for (name, [record, block, end, _]) in [("*Model_Space", handle::MODEL), ("*Paper_Space", handle::PAPER)] {
            let paper = record == handle::PAPER[0];
            for (kind, class, handle) in [("BLOCK", "AcDbBlockBegin", block), ("ENDBLK", "AcDbBlockEnd", end)] {
                self.pair(0, kind);
                self.handle(5, handle);
                self.handle(330, record);
                self.pair(100, "AcDbEntity");
                if paper {
                    self.pair(67, 1);
                }
                self.pairs(&[(8, "0"), (100, class)]);
                if kind == "BLOCK" {
                    self.pairs(&[(2, name), (70, "0"), (10, "0.0"), (20, "0.0"), (30, "0.0"), (3, name), (1, "")]);
                }
            }
        }
    }

    fn polyline(&mut self, handle: u32, layer: &str, points: &[Vec2], closed: bool) {
        self.pair(0, "LWPOLYLINE");
        self.handle(5, handle);
        self.handle(330, handle::MODEL[0]);
        self.pairs(&[(100, "AcDbEntity"), (8, layer), (100, "AcDbPolyline")]);
        self.pair(90, points.len());
        self.pair(70, u8::from(closed));
        self.pair(43, "0.0");
        for point in points {
            self.point(10, *point);
        }
    }

    fn dictionary(&mut self, handle: u32, owner: u32, entries: &[(&str, u32)]) {
        self.pair(0, "DICTIONARY");
        self.handle(5, handle);
        self.handle(330, owner);
        self.pairs(&[(100, "AcDbDictionary"), (281, "1")]);
        for (name, value) in entries {
            self.pair(3, name);
            self.handle(350, *value);
        }
    }

    fn objects(&mut self, size: Vec2) {
        use handle::{GROUPS, LAYOUTS, MODEL, PAPER, PLOT_STYLE, PLOT_STYLES, ROOT};
        self.dictionary(
            ROOT,
            0,
            &[("ACAD_GROUP", GROUPS), ("ACAD_LAYOUT", LAYOUTS), ("ACAD_PLOTSTYLENAME", PLOT_STYLES)],
        );
        self.dictionary(GROUPS, ROOT, &[]);
        self.dictionary(LAYOUTS, ROOT, &[("Model", MODEL[3]), ("Layout1", PAPER[3])]);
        self.pair(0, "ACDBDICTIONARYWDFLT");
        self.handle(5, PLOT_STYLES);
        self.handle(330, ROOT);
        self.pairs(&[(100, "AcDbDictionary"), (281, "1"), (3, "Normal")]);
        self.handle(350, PLOT_STYLE);
        self.pair(100, "AcDbDictionaryWithDefault");
        self.handle(340, PLOT_STYLE);
        self.pair(0, "ACDBPLACEHOLDER");
        self.handle(5, PLOT_STYLE);
        self.handle(330, PLOT_STYLES);
        for (tab, name, [record, _, _, layout]) in [(0, "Model", MODEL), (1, "Layout1", PAPER)] {
            self.layout(tab, name, record, layout, size);
        }
    }

    fn layout(&mut self, tab: u8, name: &str, record: u32, handle: u32, size: Vec2) {
        self.pair(0, "LAYOUT");
        self.handle(5, handle);
        self.handle(330, handle::LAYOUTS);
        self.pairs(&[(100, "AcDbPlotSettings"), (1, ""), (2, ""), (4, ""), (6, "")]);
        for code in 40..=49 {
            self.pair(code, "0.0");
        }
        self.pairs(&[(140, "0.0"), (141, "0.0"), (142, "1.0"), (143, "1.0")]);
        // 1024 = model space; plot paper in millimetres, the whole drawing at scale 1.
        self.pair(70, if tab == 0 { 1024 } else { 0 });
        self.pairs(&[(72, "1"), (73, "0"), (74, "1"), (7, ""), (75, "16"), (147, "1.0"), (148, "0.0"), (149, "0.0")]);
        self.pairs(&[(100, "AcDbLayout"), (1, name), (70, "1")]);
        self.pair(71, tab);
        self.point(10, Vec2::zeros());
        self.point(11, size);
        for code in [12, 14, 15] {
            self.point(code, Vec2::zeros());
            self.pair(code + 20, "0.0");
        }
        self.pairs(&[(146, "0.0"), (13, "0.0"), (23, "0.0"), (33, "0.0")]);
        self.pairs(&[(16, "1.0"), (26, "0.0"), (36, "0.0"), (17, "0.0"), (27, "1.0"), (37, "0.0"), (76, "0")]);
        self.handle(330, record);
    }
}
