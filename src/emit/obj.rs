//! Wavefront OBJ. Numbers are the shortest that read back as the same f64 (at most 17 significant digits): six decimals, as
//! many tools write, collapse small triangles.
use std::io;

use crate::{
    geom::Vec2,
    mesh::{Field, TriMesh, VertexId},
};

/// Writes a mesh; with `uv`, every vertex also has a texture coordinate of the same index.
pub fn write(mesh: &TriMesh, uv: Option<&Field<VertexId, Vec2>>, out: &mut dyn io::Write) -> io::Result<()> {
    for p in mesh.positions().iter() {
        writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for t in uv.iter().flat_map(|it| it.iter()) {
        writeln!(out, "vt {} {}", t.x, t.y)?;
    }
    for face in mesh.face_indices() {
        let [a, b, c] = face.map(|i| i + 1);
        match uv {
            Some(_) => writeln!(out, "f {a}/{a} {b}/{b} {c}/{c}")?,
            None => writeln!(out, "f {a} {b} {c}")?,
        }
    }
    Ok(())
}
