//! What several benchmarks do alike.
use fabricate::{import::mesh::read, mesh::TriMesh};
use std::path::Path;

/// The mesh of a file, by the name of the file; a benchmark ends where it cannot be read.
pub(crate) fn load(path: &str) -> (String, TriMesh) {
    let soup = read(Path::new(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
    let mesh = TriMesh::new(soup.positions, &soup.faces).unwrap_or_else(|error| panic!("{path}: {error}"));
    (Path::new(path).file_stem().unwrap_or_default().to_string_lossy().into_owned(), mesh)
}

/// Arguments that are not options.
pub(crate) fn words() -> impl Iterator<Item = String> {
    std::env::args().skip(1).filter(|arg| !arg.starts_with("--"))
}
