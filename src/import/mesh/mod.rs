//! Mesh readers: OBJ, STL, PLY and OFF into a [`Soup`]. A damaged file gives an error that names the place.
//!
//! A reader promises no more than a `Soup` does, except that every index is in range: whether the triangles are a surface
//! is for `mesh::repair` to say. Polygons are triangulated here. Ids in messages count from 0, lines from 1.

mod drawn;
mod obj;
mod off;
mod ply;
mod polygon;
mod stl;

use std::{
    ffi::OsStr,
    fmt, fs, io,
    path::{Path, PathBuf},
};

pub use drawn::{Drawn, NamedFace, read_drawn};

use crate::{geom::Vec3, mesh::Soup};

/// The mesh formats that we read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// STL, binary or ASCII.
    Stl,
    /// Stanford PLY, binary of either byte order or ASCII.
    Ply,
    /// Geomview OFF in ASCII.
    Off,
}

/// Extension and name of every format.
pub const FORMATS: [(Format, &str, &str); 4] = [
    (Format::Obj, "obj", "Wavefront OBJ"),
    (Format::Stl, "stl", "STL"),
    (Format::Ply, "ply", "Stanford PLY"),
    (Format::Off, "off", "Geomview OFF"),
];

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = FORMATS.iter().find(|it| it.0 == *self).map_or("", |it| it.2);
        f.write_str(name)
    }
}

/// Where in a file something is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// A line of a text file, from 1.
    Line(usize),
    /// An element, from 0.
    Element(&'static str, usize),
    /// The file as a whole.
    File,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}: "),
            Self::Element(kind, index) => write!(f, "{kind} {index} (counting from 0): "),
            Self::File => Ok(()),
        }
    }
}

/// What is wrong inside a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{place}{problem}; {advice}")]
pub struct Malformed {
    /// Where.
    pub place: Place,
    /// What.
    pub problem: String,
    /// What to do.
    pub advice: &'static str,
}

/// The advice for files that broke on the way.
const DAMAGED: &str = "the file is damaged or incomplete: copy or export it again";
/// The advice for files that another program wrote wrongly.
const REEXPORT: &str = "export the mesh again, or correct the file in a text editor";

impl Malformed {
    fn new(place: Place, problem: impl Into<String>, advice: &'static str) -> Self {
        Self { place, problem: problem.into(), advice }
    }

    fn line(line: usize, problem: impl Into<String>) -> Self {
        Self::new(Place::Line(line), problem, REEXPORT)
    }
}

/// Why a mesh file could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// It cannot be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It is a folder, a device or the like.
    #[error("{} is not a file; name a mesh file ({})", path.display(), extensions())]
    NotAFile {
        /// The path.
        path: PathBuf,
    },
    /// The extension is none of ours.
    #[error(
        "{} does not end like a mesh file that can be read ({}); {}", path.display(), extensions(),
        content.map_or("export the mesh in one of these formats".to_owned(), |it| format!("it holds {it} data, so rename it"))
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// What the content looks like.
        content: Option<Format>,
    },
    /// Extension and content disagree.
    #[error("{} is named like {named} but holds {content} data; rename it", path.display())]
    WrongExtension {
        /// The file.
        path: PathBuf,
        /// By its extension.
        named: Format,
        /// By its content.
        content: Format,
    },
    /// The content is wrong.
    #[error("{}: {source}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: Malformed,
    },
}

/// The beginning of what a file holds, for a message.
fn shorten(text: &str) -> String {
    let text = text.trim();
    if text.chars().count() <= 40 { text.to_owned() } else { text.chars().take(40).chain("…".chars()).collect() }
}

fn extensions() -> String {
    FORMATS.map(|it| it.1).join(", ")
}

/// Reads a mesh file. The format is chosen by the extension and checked against the content.
pub fn read(path: &Path) -> Result<Soup, ImportError> {
    let unreadable = |source| ImportError::Unreadable { path: path.to_owned(), source };
    // Opening a pipe or a device would wait or never end.
    if !fs::metadata(path).map_err(unreadable)?.is_file() {
        return Err(ImportError::NotAFile { path: path.to_owned() });
    }
    let bytes = fs::read(path).map_err(unreadable)?;
    let content = sniff(&bytes);
    let Some(format) = by_extension(path) else {
        return Err(ImportError::UnknownFormat { path: path.to_owned(), content });
    };
    if let Some(content) = content.filter(|&it| it != format) {
        return Err(ImportError::WrongExtension { path: path.to_owned(), named: format, content });
    }
    parse(&bytes, format).map_err(|source| ImportError::Malformed { path: path.to_owned(), source })
}

/// Reads the content of a mesh file.
pub fn parse(bytes: &[u8], format: Format) -> Result<Soup, Malformed> {
    if bytes.is_empty() {
        return Err(Malformed::new(Place::File, "the file is empty", DAMAGED));
    }
    match format {
        Format::Obj => obj::parse(bytes),
        Format::Stl => stl::parse(bytes),
        Format::Ply => ply::parse(bytes),
        Format::Off => off::parse(bytes),
    }
}

fn by_extension(path: &Path) -> Option<Format> {
    let extension = path.extension().and_then(OsStr::to_str)?.to_ascii_lowercase();
    FORMATS.iter().find(|it| it.1 == extension).map(|it| it.0)
}

/// The format by its content, where that is beyond doubt.
fn sniff(bytes: &[u8]) -> Option<Format> {
    let first_line = bytes.split(|&b| b == b'\n' || b == b'\r').next().unwrap_or_default().trim_ascii();
    if first_line == b"ply" {
        Some(Format::Ply)
    } else if off::is_header(first_line) {
        Some(Format::Off)
    } else if stl::is_binary(bytes) || stl::is_ascii(bytes) {
        Some(Format::Stl)
    } else {
        bytes.split(|&b| b == b'\n').any(obj::is_vertex_line).then_some(Format::Obj)
    }
}

/// Collects what a reader finds, checks indices and triangulates.
#[derive(Default)]
struct Builder {
    positions: Vec<Vec3>,
    corners: Vec<u32>,
    /// Where each polygon ends in `corners`.
    ends: Vec<usize>,
}

impl Builder {
    fn vertex(&mut self, [x, y, z]: [f64; 3]) -> Result<(), Malformed> {
        if self.positions.len() == u32::MAX as usize {
            return Err(Malformed::new(Place::File, "there are more than 2^32 vertices", "simplify the mesh first"));
        }
        self.positions.push(Vec3::new(x, y, z));
        Ok(())
    }

    /// Adds a polygon; `place` is where it stands in the file. All vertices must have been added before.
    fn polygon(&mut self, place: Place, corners: &[i64]) -> Result<(), Malformed> {
        let count = self.positions.len();
        if corners.len() > polygon::LIMIT {
            let problem = format!("a face has {} corners, more than {}", corners.len(), polygon::LIMIT);
            return Err(Malformed::new(place, problem, "triangulate the mesh in the program that it comes from"));
        }
        for &index in corners {
            if !usize::try_from(index).is_ok_and(|it| it < count) {
                let problem = match count {
                    0 => format!("a face names vertex {index}, but the file holds no vertices"),
                    _ => format!("a face names vertex {index}, but the vertices are 0 to {}", count - 1),
                };
                return Err(Malformed::new(place, problem, REEXPORT));
            }
            self.corners.push(index as u32);
        }
        self.ends.push(self.corners.len());
        Ok(())
    }

    fn finish(self) -> Soup {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        let polygons = starts.zip(&self.ends).map(|(start, &end)| &self.corners[start..end]);
        let faces = polygon::triangulate(&self.positions, polygons);
        Soup { positions: self.positions, faces }
    }
}

#[cfg(test)]
mod tests;
