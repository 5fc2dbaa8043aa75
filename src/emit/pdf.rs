//! PDF at true size: one page as large as the drawing, or tiles on printer paper with marks where they overlap.
//!
//! Written through `pdf-writer`; no compression, no date, no id, so that the same drawing gives the same bytes. Every layer
//! is a marked-content sequence that bears its name.
use std::io;

use pdf_writer::{
    Content, Finish, Name, Pdf, Rect, Ref,
    types::{LineCapStyle, LineJoinStyle},
};

use super::drawing::{CHECK_COLOR, CHECK_LAYER, Drawing};
use crate::{
    geom::{Box2, Vec2, stroke_font::letter},
    profile::{Color, Machine},
};

/// PDF counts in points, 72 to the inch.
pub(super) const POINTS: f32 = 72.0 / 25.4;
/// Paper that most printers cannot reach, on every side of a tile, mm.
const UNPRINTABLE: f64 = 10.0;
/// How far neighbouring tiles overlap, mm.
const OVERLAP: f64 = 10.0;
/// Layer of the marks of tiles.
const TILE_LAYER: &str = "TILE";
/// Height of the number of a tile, mm.
const NUMBER: f64 = 3.0;

/// One page of the size of the drawing.
pub(super) fn write(drawing: &Drawing<'_>, machine: &Machine, out: &mut dyn io::Write) -> io::Result<()> {
    let mut content = begin();
    lines(drawing, machine, &mut content);
    out.write_all(&document(&[(drawing.size, content)]))
}

/// Pages of A4.
pub(super) fn write_a4(drawing: &Drawing<'_>, machine: &Machine, out: &mut dyn io::Write) -> io::Result<()> {
    out.write_all(&tiled(drawing, machine, Vec2::new(210.0, 297.0)))
}

/// Pages of US letter.
pub(super) fn write_letter(drawing: &Drawing<'_>, machine: &Machine, out: &mut dyn io::Write) -> io::Result<()> {
    out.write_all(&tiled(drawing, machine, Vec2::new(215.9, 279.4)))
}

/// Content in millimetres.
pub(super) fn begin() -> Content {
    let mut content = Content::new();
    content.transform([POINTS, 0.0, 0.0, POINTS, 0.0, 0.0]);
    content.set_line_cap(LineCapStyle::RoundCap).set_line_join(LineJoinStyle::RoundJoin);
    content
}

fn tiled(drawing: &Drawing<'_>, machine: &Machine, paper: Vec2) -> Vec<u8> {
    // The way round that takes fewer pages.
    let grid = |paper: Vec2| {
        let room = paper.add_scalar(-2.0 * UNPRINTABLE);
        let count = |size: f64, room: f64| ((size - OVERLAP) / (room - OVERLAP)).ceil().max(1.0) as usize;
        (count(drawing.size.x, room.x), count(drawing.size.y, room.y), room, paper)
    };
    let (upright, turned) = (grid(paper), grid(paper.yx()));
    let (columns, rows, room, paper) = if turned.0 * turned.1 < upright.0 * upright.1 { turned } else { upright };
    let mut pages = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let step = room.add_scalar(-OVERLAP);
            let corner = Vec2::new(column as f64 * step.x, row as f64 * step.y);
            let mut content = begin();
            content.save_state();
            let [x, y, w, h] = [UNPRINTABLE, UNPRINTABLE, room.x, room.y].map(|it| it as f32);
            content.rect(x, y, w, h).clip_nonzero().end_path();
            let shift = Vec2::repeat(UNPRINTABLE) - corner;
            let page =
                Drawing { offset: drawing.offset + shift, lines: drawing.lines.clone(), check: Vec::new(), ..*drawing };
            lines(&page, machine, &mut content);
            content.restore_state();
            let number = format!("row {} of {rows}, column {} of {columns}", row + 1, column + 1);
            marks(room, [column > 0, column + 1 < columns, row > 0, row + 1 < rows], &number, &mut content);
            pages.push((paper, content));
        }
    }
    document(&pages)
}

/// The frame of a tile with crosses where the edge of its neighbour comes to lie, and its number below.
fn marks(room: Vec2, [left, right, below, above]: [bool; 4], number: &str, content: &mut Content) {
    let frame = Box2 { min: Vec2::repeat(UNPRINTABLE), max: room.add_scalar(UNPRINTABLE) };
    let mut strokes: Vec<Vec<Vec2>> = Vec::new();
    let corners = [frame.min, Vec2::new(frame.max.x, frame.min.y), frame.max, Vec2::new(frame.min.x, frame.max.y)];
    strokes.push(corners.iter().chain(&corners[..1]).copied().collect());
    let mut cross = |at: Vec2| {
        for half in [Vec2::new(2.5, 0.0), Vec2::new(0.0, 2.5)] {
            strokes.push(vec![at - half, at + half]);
        }
    };
    for (there, x) in [(left, frame.min.x + OVERLAP), (right, frame.max.x - OVERLAP)] {
        [frame.min.y, frame.max.y].into_iter().filter(|_| there).for_each(|y| cross(Vec2::new(x, y)));
    }
    for (there, y) in [(below, frame.min.y + OVERLAP), (above, frame.max.y - OVERLAP)] {
        [frame.min.x, frame.max.x].into_iter().filter(|_| there).for_each(|x| cross(Vec2::new(x, y)));
    }
    let foot = Vec2::new(frame.min.x, UNPRINTABLE - NUMBER - 1.0);
    strokes.extend(letter(number, NUMBER).strokes.into_iter().map(|it| it.into_iter().map(|p| p + foot).collect()));
    layer(TILE_LAYER, Color([0x90; 3]), strokes.iter().map(|it| (it.clone(), false)), 0.15, content);
    let check = super::drawing::check_line(Vec2::new(room.x, NUMBER), Vec2::new(frame.max.x - 135.0, foot.y));
    layer(CHECK_LAYER, CHECK_COLOR, check.into_iter().map(|it| (it, false)), 0.15, content);
}

/// All lines of a drawing, layer by layer.
fn lines(drawing: &Drawing<'_>, machine: &Machine, content: &mut Content) {
    for (it, lines) in drawing.layers(machine) {
        let lines = lines.into_iter().map(|line| (drawing.points(line), line.closed));
        layer(&it.name, it.color, lines, machine.hairline.mm, content);
    }
    let check = drawing.check.iter().map(|it| (it.clone(), false));
    layer(CHECK_LAYER, CHECK_COLOR, check, machine.hairline.mm, content);
}

fn layer(
    name: &str,
    Color(color): Color,
    lines: impl Iterator<Item = (Vec<Vec2>, bool)>,
    width: f64,
    content: &mut Content,
) {
    let [r, g, b] = color.map(|it| f32::from(it) / 255.0);
    content.begin_marked_content(Name(name.as_bytes()));
    content.set_stroke_rgb(r, g, b).set_line_width(width as f32);
    for (points, closed) in lines {
        for (i, p) in points.iter().enumerate() {
            let (x, y) = (p.x as f32, p.y as f32);
            if i == 0 {
                content.move_to(x, y)
            } else {
                content.line_to(x, y)
            };
        }
        if closed {
            content.close_and_stroke()
        } else {
            content.stroke()
        };
    }
    content.end_marked_content();
}

/// A document of pages with their sizes in mm.
fn document(pages: &[(Vec2, Content)]) -> Vec<u8> {
    let (catalog, tree) = (Ref::new(1), Ref::new(2));
    let page = |k: usize| Ref::new(3 + 2 * k as i32);
    let stream = |k: usize| Ref::new(4 + 2 * k as i32);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(tree);
    pdf.pages(tree).kids((0..pages.len()).map(page)).count(pages.len() as i32);
    for (k, (size, content)) in pages.iter().enumerate() {
        let size = size.map(|it| it as f32 * POINTS);
        let mut it = pdf.page(page(k));
        it.parent(tree).media_box(Rect::new(0.0, 0.0, size.x, size.y)).contents(stream(k));
        it.resources().finish();
        it.finish();
        pdf.stream(stream(k), content.as_bytes());
    }
    pdf.finish()
}
