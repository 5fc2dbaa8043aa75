//! Lines of a PDF, page by page, in millimetres. Reads what drawings need and no more: uncompressed content with paths of
//! straight lines, scaling, and marked content as layers.
use super::drawing::{Drawing, DrawingError, DrawnLine};
use crate::geom::Vec2;

const MM_PER_POINT: f64 = 25.4 / 72.0;

/// Reads the pages in the order of their objects.
pub fn read_pdf(bytes: &[u8]) -> Result<Vec<Drawing>, DrawingError> {
    let fault = |what: &str| DrawingError::Pdf(what.into());
    if !bytes.starts_with(b"%PDF-") {
        return Err(fault("it does not begin with %PDF"));
    }
    let text = String::from_utf8_lossy(bytes);
    let mut pages = Vec::new();
    for object in text.split("endobj") {
        let Some(at) = object.find("/MediaBox") else { continue };
        let list = object[at..].split(['[', ']']).nth(1).unwrap_or_default();
        let corners: Vec<f64> = list.split_whitespace().filter_map(|it| it.parse().ok()).collect();
        let [x0, y0, x1, y1] = corners[..] else { return Err(fault("a page without a media box of four numbers")) };
        let contents = object.find("/Contents").and_then(|at| object[at + 9..].split_whitespace().next());
        let number = contents.ok_or_else(|| fault("a page without content"))?;
        let head = format!("\n{number} 0 obj");
        let start = text.find(&head).ok_or_else(|| fault("the content of a page is missing"))?;
        let body = text[start..].split("endstream").next().unwrap_or_default();
        if body.contains("/Filter") {
            return Err(fault("its content is compressed"));
        }
        let stream = body.split_once("stream\n").ok_or_else(|| fault("the content of a page is no stream"))?.1;
        let size = Vec2::new(x1 - x0, y1 - y0) * MM_PER_POINT;
        pages.push(Drawing { size: Some(size), ..content(stream)? });
    }
    if pages.is_empty() { Err(fault("it has no page")) } else { Ok(pages) }
}

/// Scale and shift of the coordinates, points to the unit.
#[derive(Clone, Copy)]
struct State {
    scale: f64,
    shift: Vec2,
}

fn content(stream: &str) -> Result<Drawing, DrawingError> {
    let mut out = Drawing::default();
    let mut stack: Vec<State> = Vec::new();
    let mut state = State { scale: 1.0, shift: Vec2::zeros() };
    let mut operands: Vec<&str> = Vec::new();
    let mut layer = String::new();
    let mut path: Vec<Vec2> = Vec::new();
    for word in stream.split_ascii_whitespace() {
        let numbers = || operands.iter().map(|it| it.parse::<f64>()).collect::<Result<Vec<_>, _>>();
        let unknown = || DrawingError::Pdf(format!("`{} {word}` in its content", operands.join(" ")));
        let mut finish = |path: &mut Vec<Vec2>, closed: bool| {
            let points = std::mem::take(path);
            out.lines.push(DrawnLine { layer: layer.clone(), color: None, points, closed });
        };
        match (word, numbers().as_deref()) {
            ("m" | "l", Ok([x, y])) => {
                if word == "m" {
                    path.clear();
                }
                path.push((Vec2::new(*x, *y) * state.scale + state.shift) * MM_PER_POINT);
            }
            ("S", Ok([])) => finish(&mut path, false),
            ("s", Ok([])) => finish(&mut path, true),
            ("n", Ok([])) => path.clear(),
            ("q", Ok([])) => stack.push(state),
            ("Q", Ok([])) => state = stack.pop().ok_or_else(unknown)?,
            ("cm", Ok([a, b, c, d, e, f])) if *b == 0.0 && *c == 0.0 && a == d => {
                state = State { scale: state.scale * a, shift: state.shift + Vec2::new(*e, *f) * state.scale };
            }
            ("BMC", Err(_)) => layer = operands.first().map_or("", |it| it.trim_start_matches('/')).into(),
            ("EMC", Ok([])) => layer.clear(),
            ("Do", Err(_)) => {}
            // Clips, colours and styles say nothing about where lines are.
            ("re" | "W" | "RG" | "w" | "J" | "j", Ok(_)) => {}
            (word, _) if word.starts_with(|c: char| c.is_ascii_alphabetic()) => return Err(unknown()),
            _ => {
                operands.push(word);
                continue;
            }
        }
        operands.clear();
    }
    Ok(out)
}
