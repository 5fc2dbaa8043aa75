//! STL, binary and ASCII, parsed by `stl_io`. Corners with the same coordinates become one vertex: the format has no
//! vertices of its own.
use std::{collections::HashMap, io::Cursor};

use super::{Builder, DAMAGED, Malformed, Place, REEXPORT};
use crate::mesh::Soup;

/// Bytes before the first triangle of a binary file: a free header and the count.
const HEADER: usize = 84;
/// Bytes of a binary triangle.
const TRIANGLE: usize = 50;

/// Whether the length is that of a binary file with the count it announces. Some of them begin with `solid` all the same.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    announced(bytes).is_some_and(|count| count > 0 && bytes.len() == HEADER + TRIANGLE * count)
}

pub(super) fn is_ascii(bytes: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    start.get(..5).is_some_and(|it| it.eq_ignore_ascii_case(b"solid"))
        && !bytes[..bytes.len().min(1024)].contains(&0)
        && start.split(|&b| b == b'\n').skip(1).find(|it| !it.trim_ascii().is_empty()).is_some_and(|line| {
            let word = line.trim_ascii().to_ascii_lowercase();
            word.starts_with(b"facet") || word.starts_with(b"endsolid")
        })
}

fn announced(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER - 4..HEADER)?;
    Some(u32::from_le_bytes(count.try_into().expect("the slice has four bytes")) as usize)
}

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, Malformed> {
    if !is_binary(bytes) && is_ascii(bytes) { parse_ascii(bytes) } else { parse_binary(bytes) }
}

fn parse_binary(bytes: &[u8]) -> Result<Soup, Malformed> {
    let Some(count) = announced(bytes) else {
        return Err(Malformed::new(Place::File, format!("an STL file has at least {HEADER} bytes"), DAMAGED));
    };
    if bytes.len() < HEADER + TRIANGLE * count {
        let held = (bytes.len() - HEADER) / TRIANGLE;
        let problem = format!("the header announces {count} triangles, but the file ends after {held}");
        return Err(Malformed::new(Place::File, problem, DAMAGED));
    }
    // stl_io takes a file that begins with `solid ` for text.
    let mut data = bytes.to_vec();
    data[..HEADER - 4].fill(0);
    collect(&data, &|index| Place::Element("triangle", index))
}

fn parse_ascii(bytes: &[u8]) -> Result<Soup, Malformed> {
    let text = String::from_utf8_lossy(bytes).to_ascii_lowercase();
    let last = text.lines().rev().find(|it| !it.trim().is_empty()).unwrap_or_default();
    if !last.trim().starts_with("endsolid") {
        let problem = format!("the file ends with `{}` instead of `endsolid`", super::shorten(last));
        return Err(Malformed::new(Place::File, problem, DAMAGED));
    }
    // One solid with all facets; normals are not used, and some programs write `nan` there.
    let mut clean = String::with_capacity(text.len());
    let mut facets = Vec::new();
    clean.push_str("solid \n");
    for (at, line) in text.lines().enumerate() {
        match line.split_whitespace().next() {
            None | Some("solid" | "endsolid") => continue,
            Some("facet") => {
                facets.push(at + 1);
                clean.push_str("facet normal 0 0 0");
            }
            _ => clean.push_str(line),
        }
        clean.push('\n');
    }
    clean.push_str("endsolid\n");
    collect(clean.as_bytes(), &|index| match facets.get(index) {
        Some(&line) => Place::Line(line),
        None => Place::Element("facet", index),
    })
}

fn collect(data: &[u8], place: &dyn Fn(usize) -> Place) -> Result<Soup, Malformed> {
    let mut cursor = Cursor::new(data);
    let triangles = stl_io::create_stl_reader(&mut cursor)
        .map_err(|error| Malformed::new(Place::File, error.to_string(), DAMAGED))?;
    let mut builder = Builder::default();
    // Only looked up, never iterated.
    let mut ids = HashMap::new();
    for (index, triangle) in triangles.enumerate() {
        let triangle = triangle.map_err(|error| {
            Malformed::new(place(index), format!("the facet that begins here is wrong: {error}"), REEXPORT)
        })?;
        let mut corners = [0; 3];
        for (corner, vertex) in corners.iter_mut().zip(triangle.vertices) {
            // Adding 0 turns -0 into 0.
            let key = vertex.0.map(|it| (it + 0.0).to_bits());
            let fresh = builder.positions.len() as i64;
            *corner = *ids.entry(key).or_insert(fresh);
            if *corner == fresh {
                builder.vertex(vertex.0.map(|it| f64::from(it + 0.0)))?;
            }
        }
        builder.polygon(place(index), &corners)?;
    }
    Ok(builder.finish())
}
