//! Geomview OFF in ASCII, with the variants that put colours, normals or texture coordinates after the position.
use std::str::SplitWhitespace;

use super::{Builder, DAMAGED, Malformed, Place, REEXPORT};
use crate::mesh::Soup;

/// Keywords whose vertices begin with x y z. The header may say ST, C and N in this order.
const HEADERS: [&str; 8] = ["OFF", "COFF", "NOFF", "CNOFF", "STOFF", "STCOFF", "STNOFF", "STCNOFF"];
/// Variants in four or n dimensions.
const FOREIGN: [&str; 3] = ["4OFF", "nOFF", "4nOFF"];

pub(super) fn is_header(first_line: &[u8]) -> bool {
    let word = first_line.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    HEADERS.iter().chain(&FOREIGN).any(|it| it.as_bytes() == word)
}

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, Malformed> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(at, line)| (at + 1, line.split('#').next().unwrap_or_default().trim()))
        .filter(|(_, line)| !line.is_empty());
    let mut next = |what: &dyn Fn() -> String| {
        lines.next().ok_or_else(|| Malformed::new(Place::File, format!("the file ends before {}", what()), DAMAGED))
    };
    let (mut line, first) = next(&|| "its header `OFF`".to_owned())?;
    let mut words = first.split_whitespace();
    let keyword = words.next().unwrap_or_default();
    if FOREIGN.contains(&keyword) {
        return Err(Malformed::line(line, format!("`{keyword}` does not lie in three dimensions")));
    }
    if !HEADERS.contains(&keyword) {
        return Err(Malformed::line(
            line,
            format!("an OFF file begins with `OFF`, not with `{}`", super::shorten(first)),
        ));
    }
    let mut counts = words.clone();
    if words.next().is_none() {
        let (at, second) = next(&|| "the numbers of vertices and faces".to_owned())?;
        (line, counts) = (at, second.split_whitespace());
    } else if first.split_whitespace().nth(1) == Some("BINARY") {
        return Err(Malformed::new(Place::Line(line), "binary OFF is not supported", "save it as ASCII OFF or as PLY"));
    }
    let vertices: usize = number(&mut counts, line, "the number of vertices")?;
    let faces: usize = number(&mut counts, line, "the number of faces")?;
    let mut builder = Builder::default();
    for index in 0..vertices {
        let (line, text) = next(&|| format!("vertex {index} of {vertices}"))?;
        let mut words = text.split_whitespace();
        let mut position = [0.0; 3];
        for value in &mut position {
            *value = number(&mut words, line, "a coordinate")?;
        }
        builder.vertex(position)?;
    }
    for index in 0..faces {
        let (line, text) = next(&|| format!("face {index} of {faces}"))?;
        let mut words = text.split_whitespace();
        let arity: usize = number(&mut words, line, "the number of corners")?;
        let mut corners = Vec::new();
        for _ in 0..arity {
            corners.push(number(&mut words, line, "the index of a vertex")?);
        }
        builder.polygon(Place::Line(line), &corners)?;
    }
    Ok(builder.finish())
}

fn number<T: std::str::FromStr>(words: &mut SplitWhitespace<'_>, line: usize, what: &str) -> Result<T, Malformed> {
    let word = words.next().ok_or_else(|| Malformed::new(Place::Line(line), format!("{what} is missing"), REEXPORT))?;
    word.parse().map_err(|_| Malformed::line(line, format!("`{}` is not {what}", super::shorten(word))))
}
