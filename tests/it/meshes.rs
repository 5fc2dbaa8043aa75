//! Mesh files: what is written reads back, and no damaged file makes a reader panic or hang.
use fabricate::{
    emit,
    geom::Vec3,
    import::mesh::{Format, parse},
    mesh::{Field, TriMesh, VertexId, shapes},
};

fn obj(mesh: &TriMesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    emit::obj::write(mesh, None, &mut bytes).unwrap();
    bytes
}

fn stl(mesh: &TriMesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    emit::stl::write(mesh, &mut bytes).unwrap();
    bytes
}

#[test]
fn obj_reads_back_with_the_same_bits_and_ids() {
    let mut mesh = shapes::torus(37.3, 11.1, 24, 12);
    for (k, p) in mesh.positions_mut().as_mut_slice().iter_mut().enumerate() {
        *p = p.component_mul(&Vec3::new(1.0 / 3.0, 1e-9, 7e11)) * 1.000_000_1_f64.powi(k as i32);
    }
    let uv = Field::from_fn(mesh.vertex_count(), |v: VertexId| mesh.position(v).xy() / 7.0);
    let mut with_uv = Vec::new();
    emit::obj::write(&mesh, Some(&uv), &mut with_uv).unwrap();
    for bytes in [obj(&mesh), with_uv] {
        let soup = parse(&bytes, Format::Obj).unwrap();
        assert_eq!(soup.positions, mesh.positions().as_slice());
        assert_eq!(soup.faces, mesh.face_indices());
    }
}

#[test]
fn stl_reads_back_to_single_precision() {
    let mesh = shapes::torus(37.3, 11.1, 24, 12);
    let soup = parse(&stl(&mesh), Format::Stl).unwrap();
    let back = TriMesh::new(soup.positions, &soup.faces).unwrap();
    assert_eq!((back.vertex_count(), back.genus()), (mesh.vertex_count(), 1));
    for (f, g) in mesh.faces().zip(back.faces()) {
        for (p, q) in mesh.face_positions(f).into_iter().zip(back.face_positions(g)) {
            assert!((p - q).norm() < 1e-5, "{p} {q}");
        }
    }
}
