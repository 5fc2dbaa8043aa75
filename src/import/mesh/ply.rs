//! Stanford PLY, binary of either byte order and ASCII; the header and the elements are parsed by `ply-rs-bw`.
use std::str;

use ply_rs_bw::{
    parser::{Parser, Reader},
    ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType},
};

use super::{Builder, DAMAGED, Malformed, Place, REEXPORT};
use crate::mesh::Soup;

/// Whatever a vertex or a face holds that we want.
#[derive(Default)]
struct Element {
    position: [f64; 3],
    corners: Vec<i64>,
}

const COORDINATES: [&str; 3] = ["x", "y", "z"];
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if let Some(axis) = COORDINATES.iter().position(|it| *it == name) {
            match scalar(&value) {
                Some(it) => self.position[axis] = it,
                None => return PropertyAccessResult::UnsupportedType,
            }
        } else if CORNERS.contains(&name) {
            match list(value) {
                Some(it) => self.corners = it,
                None => return PropertyAccessResult::UnsupportedType,
            }
        }
        PropertyAccessResult::Set
    }
}

fn scalar(value: &Property) -> Option<f64> {
    match *value {
        Property::Char(it) => Some(it.into()),
        Property::UChar(it) => Some(it.into()),
        Property::Short(it) => Some(it.into()),
        Property::UShort(it) => Some(it.into()),
        Property::Int(it) => Some(it.into()),
        Property::UInt(it) => Some(it.into()),
        Property::Float(it) => Some(it.into()),
        Property::Double(it) => Some(it),
        _ => None,
    }
}

fn list(value: Property) -> Option<Vec<i64>> {
    match value {
        Property::ListChar(it) => Some(it.into_iter().map(i64::from).collect()),
        Property::ListUChar(it) => Some(it.into_iter().map(i64::from).collect()),
        Property::ListShort(it) => Some(it.into_iter().map(i64::from).collect()),
        Property::ListUShort(it) => Some(it.into_iter().map(i64::from).collect()),
        Property::ListInt(it) => Some(it.into_iter().map(i64::from).collect()),
        Property::ListUInt(it) => Some(it.into_iter().map(i64::from).collect()),
        _ => None,
    }
}

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, Malformed> {
    let bytes = ascii_header(bytes);
    let parser = Parser::<Element>::new();
    let mut reader = Reader::new(&bytes[..]);
    let header = parser.read_header(&mut reader).map_err(|error| {
        let place = error.line().map_or(Place::File, Place::Line);
        Malformed::new(place, format!("the PLY header is wrong: {}", plain(&error)), REEXPORT)
    })?;
    check_header(&header)?;
    let first_line = reader.line();
    let mut data = reader.into_inner();
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    let mut line = first_line;
    for (name, definition) in &header.elements {
        let (kind, wanted) = match name.as_str() {
            "vertex" => ("vertex", Some(&mut vertices)),
            "face" => ("face", Some(&mut faces)),
            _ => ("element", None),
        };
        let mut keep = wanted;
        // An element without properties takes no bytes, so its count could be anything.
        let count = if definition.properties.is_empty() { 0 } else { definition.count };
        for index in 0..count {
            let element = read_element(&parser, &mut data, header.encoding, definition).map_err(|problem| {
                let problem = format!("{kind} {index} of {count}: {problem}");
                let place = if header.encoding == Encoding::Ascii { Place::Line(line) } else { Place::File };
                Malformed::new(place, problem, DAMAGED)
            })?;
            if let Some(list) = &mut keep {
                list.push(element);
            }
            line += 1;
        }
    }
    let mut builder = Builder::default();
    for vertex in &vertices {
        builder.vertex(vertex.position)?;
    }
    for (index, face) in faces.iter().enumerate() {
        builder.polygon(Place::Element("face", index), &face.corners)?;
    }
    Ok(builder.finish())
}

/// Replaces what is not ASCII in the header (names in comments), which the parser would refuse.
fn ascii_header(bytes: &[u8]) -> Vec<u8> {
    let mark = b"end_header";
    let end = bytes.windows(mark.len()).position(|it| it == mark).unwrap_or(0);
    let mut out = bytes.to_vec();
    out[..end].iter_mut().filter(|it| !it.is_ascii()).for_each(|it| *it = b'?');
    out
}

fn check_header(header: &Header) -> Result<(), Malformed> {
    let wrong = |problem: String| Err(Malformed::new(Place::File, problem, REEXPORT));
    let Some(vertex) = header.elements.get("vertex") else {
        return wrong("the PLY header announces no `element vertex`".to_owned());
    };
    for name in COORDINATES {
        if !vertex.properties.get(name).is_some_and(|it| matches!(it.data_type, PropertyType::Scalar(_))) {
            return wrong(format!("the vertices of the PLY file have no coordinate `{name}`"));
        }
    }
    let Some(face) = header.elements.get("face") else {
        let kinds: Vec<&str> = header.elements.keys().map(String::as_str).collect();
        let problem = format!("the PLY header announces no `element face` (only {})", kinds.join(", "));
        return Err(Malformed::new(Place::File, problem, "a point cloud or triangle strips must be made a mesh first"));
    };
    let has_corners =
        |name: &&str| face.properties.get(*name).is_some_and(|it| matches!(it.data_type, PropertyType::List(..)));
    if !CORNERS.iter().any(has_corners) {
        return wrong("the faces of the PLY file have no list `vertex_indices`".to_owned());
    }
    Ok(())
}

/// Reads one element from the front of `data`.
fn read_element(
    parser: &Parser<Element>,
    data: &mut &[u8],
    encoding: Encoding,
    definition: &ElementDef,
) -> Result<Element, String> {
    if data.is_empty() {
        return Err("the file ends here".to_owned());
    }
    let result = match encoding {
        Encoding::BinaryBigEndian => parser.read_big_endian_element(data, definition),
        Encoding::BinaryLittleEndian => parser.read_little_endian_element(data, definition),
        Encoding::Ascii => {
            let end = data.iter().position(|&b| b == b'\n').map_or(data.len(), |it| it + 1);
            let (line, rest) = data.split_at(end);
            *data = rest;
            let line = str::from_utf8(line).map_err(|_| "the line is not text".to_owned())?;
            parser.read_ascii_element(line, definition)
        }
    };
    result.map_err(|error| plain(&error))
}

/// The parser's message on one line.
fn plain(error: &impl ToString) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
