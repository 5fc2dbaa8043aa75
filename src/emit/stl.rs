//! Binary STL, single precision.
use std::io;

use stl_io::{Normal, Triangle, Vertex};

use crate::{geom::Vec3, mesh::TriMesh};

/// Writes the triangles of a mesh in id order, with their unit normals, in mm.
pub fn write(mesh: &TriMesh, out: &mut dyn io::Write) -> io::Result<()> {
    let single = |p: Vec3| [p.x as f32, p.y as f32, p.z as f32];
    let triangles: Vec<Triangle> = mesh
        .faces()
        .map(|f| Triangle {
            normal: Normal::new(single(mesh.normal(f))),
            vertices: mesh.face_positions(f).map(|p| Vertex::new(single(p))),
        })
        .collect();
    let mut out = out;
    stl_io::write_stl(&mut out, triangles.iter())
}
