//! A PDF of pages with a picture and lines of text below: instructions for people, not for machines.
//!
//! Content streams stay plain, so that our own reader can count and read them; only the pictures are compressed.
use std::io::Write;

use flate2::{Compression, write::ZlibEncoder};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref};

use super::pdf::{POINTS, begin};
use crate::geom::{Vec2, stroke_font::letter};

/// Size of a page, A5 upright, mm.
pub const PAGE: [f64; 2] = [148.0, 210.0];
/// Free on every side, mm.
const MARGIN: f64 = 10.0;
/// Capitals of the first line and of the others, and the distance of lines, mm.
const TITLE: f64 = 5.0;
const TEXT: f64 = 2.6;
const LEADING: f64 = 5.0;
/// Capitals of the labels in the picture, mm.
const LABEL: f64 = 2.4;

/// One page.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    /// First line.
    pub title: String,
    /// Text below the picture; long lines are broken between words.
    pub text: Vec<String>,
    /// Pixels of one side of the square picture.
    pub side: u32,
    /// Its colours, row by row from the top.
    pub pixels: Vec<[u8; 3]>,
    /// Words at places in the picture, pixels from its upper left corner.
    pub labels: Vec<(Vec2, String)>,
}

/// The document. The same pages give the same bytes.
pub fn booklet(pages: &[Page]) -> Vec<u8> {
    let (catalog, tree) = (Ref::new(1), Ref::new(2));
    let object = |page: usize, kind: i32| Ref::new(3 + 3 * page as i32 + kind);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(tree);
    pdf.pages(tree).kids((0..pages.len()).map(|k| object(k, 0))).count(pages.len() as i32);
    for (k, page) in pages.iter().enumerate() {
        let [width, height] = PAGE.map(|it| it as f32 * POINTS);
        let mut it = pdf.page(object(k, 0));
        it.parent(tree).media_box(Rect::new(0.0, 0.0, width, height)).contents(object(k, 1));
        it.resources().x_objects().pair(Name(b"Picture"), object(k, 2));
        it.finish();
        pdf.stream(object(k, 1), content(page).as_bytes());
        let bytes = compressed(page.pixels.as_flattened());
        let mut image = pdf.image_xobject(object(k, 2), &bytes);
        image.width(page.side as i32).height(page.side as i32).bits_per_component(8);
        image.color_space().device_rgb();
        image.filter(Filter::FlateDecode);
    }
    pdf.finish()
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("writing to memory cannot fail")
}

/// The marks of a page, in millimetres.
fn content(page: &Page) -> Content {
    let mut content = begin();
    let [width, height] = PAGE;
    let side = width - 2.0 * MARGIN;
    let top = height - MARGIN - 2.0 * TITLE;
    content.save_state();
    content.transform([side as f32, 0.0, 0.0, side as f32, MARGIN as f32, (top - side) as f32]);
    content.x_object(Name(b"Picture"));
    content.restore_state();
    let scale = side / f64::from(page.side.max(1));
    for (at, word) in &page.labels {
        let size = letter(word, LABEL).size;
        let corner = Vec2::new(MARGIN + at.x * scale, top - at.y * scale) - size / 2.0;
        // A light rim keeps the word readable on any colour.
        write(word, LABEL, corner, [1.0; 3], 1.1, &mut content);
        write(word, LABEL, corner, [0.1, 0.12, 0.15], 0.3, &mut content);
    }
    let ink = [0.1, 0.12, 0.15];
    write(&page.title, TITLE, Vec2::new(MARGIN, height - MARGIN - TITLE), ink, 0.5, &mut content);
    let mut y = top - side - LEADING;
    for line in page.text.iter().flat_map(|it| broken(it, side)) {
        if y < MARGIN / 2.0 {
            break;
        }
        write(&line, TEXT, Vec2::new(MARGIN, y), ink, 0.25, &mut content);
        y -= LEADING;
    }
    content
}

/// A line of text in pieces of at most `width`, mm, broken between words.
fn broken(text: &str, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        let longer = lines.last().map(|it| format!("{it} {word}")).filter(|it| letter(it, TEXT).size.x <= width);
        match (longer, lines.last_mut()) {
            (Some(longer), Some(last)) => *last = longer,
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn write(text: &str, height: f64, corner: Vec2, [r, g, b]: [f32; 3], width: f32, content: &mut Content) {
    content.set_stroke_rgb(r, g, b).set_line_width(width);
    for stroke in letter(text, height).strokes {
        for (i, p) in stroke.iter().enumerate() {
            let (x, y) = ((p.x + corner.x) as f32, (p.y + corner.y) as f32);
            if i == 0 {
                content.move_to(x, y)
            } else {
                content.line_to(x, y)
            };
        }
        content.stroke();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_broken_between_words_and_lose_none() {
        let text = "join part C along seams 4, 7, 12 and 13 to part A, which is in place, with the tabs under its edge";
        let lines = broken(text, 60.0);
        assert!(lines.len() > 1 && lines.iter().all(|it| letter(it, TEXT).size.x <= 60.0), "{lines:?}");
        assert_eq!(lines.join(" "), text);
        assert_eq!(broken("a-word-that-is-longer-than-any-line", 5.0).len(), 1);
    }
}
