//! Wavefront OBJ, parsed by `tobj`.
//!
//! tobj starts a mesh with vertices of its own at every group and material, numbers vertices by first use, drops unused
//! ones, and its errors name no line. So it gets a cleaned text: only `v` and `f` lines, faces with their position indices
//! alone, and one leading polygon over all vertices that keeps the numbering of the file.
use std::fmt::Write;

use super::{Builder, Malformed, Place, REEXPORT};
use crate::mesh::Soup;

/// The lines that matter, and where they stood.
#[derive(Default)]
struct Script {
    vertices: usize,
    /// Vertex and face lines.
    text: String,
    /// File line of every line in `text`.
    lines: Vec<usize>,
    /// Of every face: its file line, and how many vertices stood before it (negative indices count back from there).
    faces: Vec<(usize, usize)>,
}

pub(super) fn is_vertex_line(line: &[u8]) -> bool {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|it| !it.is_empty());
    let number = |word: &[u8]| std::str::from_utf8(word).is_ok_and(|it| it.parse::<f64>().is_ok());
    words.next() == Some(b"v") && words.clone().count() >= 3 && words.take(3).all(number)
}

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, Malformed> {
    if bytes.contains(&0) {
        return Err(Malformed::new(Place::File, "the file holds zero bytes, so it is no text", super::DAMAGED));
    }
    let script = gather(&String::from_utf8_lossy(bytes))?;
    if script.vertices == 0 {
        return Err(Malformed::new(Place::File, "there is no vertex (no line that begins with `v`)", super::DAMAGED));
    }
    let mesh = run_tobj(&script)?;
    let mut builder = Builder::default();
    for p in mesh.positions.chunks_exact(3) {
        builder.vertex([p[0], p[1], p[2]])?;
    }
    let mut rest = mesh.indices.get(script.vertices..).unwrap_or_default();
    for (k, &(line, _)) in script.faces.iter().enumerate() {
        // Without any polygon tobj leaves the list of arities empty; entry 0 is the leading polygon.
        let arity = mesh.face_arities.get(k + 1).map_or(3, |&it| it as usize);
        let (corners, after) = rest.split_at(arity.min(rest.len()));
        rest = after;
        let corners: Vec<i64> = corners.iter().map(|&it| i64::from(it)).collect();
        builder.polygon(Place::Line(line), &corners)?;
    }
    Ok(builder.finish())
}

fn gather(text: &str) -> Result<Script, Malformed> {
    let mut script = Script::default();
    logical_lines(text).into_iter().try_for_each(|(line, text)| add_line(&mut script, line, &text))?;
    Ok(script)
}

/// Lines without comments, those that end with a backslash joined to the next, each with the number of its last one.
pub(super) fn logical_lines(text: &str) -> Vec<(usize, String)> {
    let mut out = Vec::new();
    let mut joined = String::new();
    for (at, raw) in text.lines().enumerate() {
        let raw = raw.split('#').next().unwrap_or_default().trim_end();
        if let Some(head) = raw.strip_suffix('\\') {
            joined.push_str(head);
            joined.push(' ');
            continue;
        }
        joined.push_str(raw);
        out.push((at + 1, std::mem::take(&mut joined)));
    }
    out.push((text.lines().count(), joined));
    out
}

fn add_line(script: &mut Script, line: usize, text: &str) -> Result<(), Malformed> {
    let mut words = text.split_whitespace();
    match words.next() {
        Some("v") => {
            script.vertices += 1;
            script.text.push('v');
            // x y z, or x y z w; six numbers and more are a colour.
            let numbers = words.clone().count();
            for word in words.take(if numbers == 4 { 4 } else { 3 }) {
                script.text.push(' ');
                script.text.push_str(word);
            }
        }
        Some("f") => {
            script.faces.push((line, script.vertices));
            script.text.push('f');
            for word in words {
                let position = word.split('/').next().unwrap_or_default();
                if position.is_empty() {
                    return Err(Malformed::line(line, format!("the face corner `{word}` names no vertex")));
                }
                script.text.push(' ');
                script.text.push_str(position);
            }
            if script.text.ends_with('f') {
                return Err(Malformed::line(line, "a face has no corners"));
            }
        }
        _ => return Ok(()),
    }
    script.text.push('\n');
    script.lines.push(line);
    Ok(())
}

fn run_tobj(script: &Script) -> Result<tobj::Mesh, Malformed> {
    let mut text = String::with_capacity(script.text.len() + 8 * script.vertices);
    text.push('f');
    for k in 1..=script.vertices {
        write!(text, " {k}").expect("writing to a string cannot fail");
    }
    text.push('\n');
    let head = text.len();
    text.push_str(&script.text);
    let mut rest = text.as_bytes();
    let result = tobj::load_obj_buf(&mut rest, &tobj::LoadOptions::default(), |_| Err(tobj::LoadError::GenericFailure));
    let read = &script.text.as_bytes()[..(text.len() - rest.len()).saturating_sub(head)];
    match result {
        Ok((models, _)) => models
            .into_iter()
            .next()
            .map(|it| it.mesh)
            .ok_or_else(|| Malformed::new(Place::File, "the file holds no mesh", super::DAMAGED)),
        Err(tobj::LoadError::FaceVertexOutOfBounds) => Err(out_of_bounds(script)),
        Err(error) => {
            let last = read.iter().filter(|&&b| b == b'\n').count().saturating_sub(1);
            let words = read.trim_ascii_end().rsplit(|&b| b == b'\n').next().unwrap_or_default();
            let words = super::shorten(&String::from_utf8_lossy(words));
            let problem = match error {
                tobj::LoadError::PositionParseError => "a vertex needs three numbers",
                tobj::LoadError::ScalingByZeroError => "the fourth number of a vertex (its weight) is zero",
                tobj::LoadError::FaceParseError => "a face corner is not a whole number",
                _ => "this cannot be understood",
            };
            let line = script.lines.get(last).copied().unwrap_or_default();
            Err(Malformed::line(line, format!("{problem}: `{words}`")))
        }
    }
}

/// Finds the face that tobj could not resolve.
fn out_of_bounds(script: &Script) -> Malformed {
    let faces = script.text.lines().filter_map(|it| it.strip_prefix("f "));
    for (words, &(line, before)) in faces.zip(&script.faces) {
        for word in words.split(' ') {
            let problem = match word.parse::<i64>() {
                Ok(0) => "a face names vertex 0, but OBJ counts from 1".to_owned(),
                Ok(index) if index > script.vertices as i64 => {
                    format!("a face names vertex {index}, but the file holds {}", script.vertices)
                }
                Ok(index) if index < -(before as i64) => {
                    format!("a face counts {} vertices back, but only {before} come before it", index.unsigned_abs())
                }
                _ => continue,
            };
            return Malformed::new(Place::Line(line), problem, REEXPORT);
        }
    }
    Malformed::new(Place::File, "a face names a vertex that the file does not hold", REEXPORT)
}
