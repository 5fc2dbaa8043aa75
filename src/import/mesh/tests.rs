//! Tests of the mesh readers.
use super::*;

/// Two triangles that share an edge, in every format and encoding.
fn square() -> Vec<(Format, &'static str, Vec<u8>)> {
    let points = [[0.0_f32, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.5], [0.0, 2.0, 0.25]];
    let triangles = [[0_u8, 1, 2], [0, 2, 3]];
    let mut stl = b"solid but binary".to_vec();
    stl.resize(80, b' ');
    stl.extend(2_u32.to_le_bytes());
    let mut ascii = "solid square\n".to_owned();
    for t in triangles {
        stl.extend([0; 12]);
        ascii.push_str("facet normal nan nan nan\n outer loop\n");
        for [x, y, z] in t.map(|i| points[usize::from(i)]) {
            stl.extend([x, y, z].into_iter().flat_map(f32::to_le_bytes));
            ascii.push_str(&format!("  vertex {x:e} {y:e} {z:e}\n"));
        }
        stl.extend([0; 2]);
        ascii.push_str(" endloop\nendfacet\n");
    }
    ascii.push_str("endsolid square\n");
    let header = |encoding: &str| {
        format!(
            "ply\nformat {encoding} 1.0\ncomment caf\u{e9}\nelement vertex 4\nproperty double z\nproperty float x\n\
             property uchar red\nproperty float y\nelement face 2\nproperty float weight\n\
             property list uchar int vertex_indices\nend_header\n"
        )
    };
    let (mut little, mut big) = (header("binary_little_endian").into_bytes(), header("binary_big_endian").into_bytes());
    for [x, y, z] in points {
        little.extend(f64::from(z).to_le_bytes().into_iter().chain(x.to_le_bytes()).chain([7]).chain(y.to_le_bytes()));
        big.extend(f64::from(z).to_be_bytes().into_iter().chain(x.to_be_bytes()).chain([7]).chain(y.to_be_bytes()));
    }
    for t in triangles {
        little.extend([0; 4].into_iter().chain([3]).chain(t.into_iter().flat_map(|i| i32::from(i).to_le_bytes())));
        big.extend([0; 4].into_iter().chain([3]).chain(t.into_iter().flat_map(|i| i32::from(i).to_be_bytes())));
    }
    let ascii_ply = header("ascii") + "0 0 9 0\n0 2 9 0\n0.5 2 9 2\n0.25 0 9 2\n1.5 3 0 1 2\n1 3 0 2 3\n";
    let obj = "# a comment\nmtllib no.mtl\no square\nv 0 0 0\nv 2 0 0 1 0.5 0.25\ng one\nv 4 4 1 2\nv 0 2 .25\n\
               vt 0 0\nusemtl none\nf 1/1/1 2//7 3\ng two\nf -4 -2 \\\n -1\n";
    let off = "OFF # header\n# comment\n4 2 0\n0 0 0\n2 0 0 \n2 2 0.5\n\n0 2 0.25\n3 0 1 2 255 0 0\n3 0 2 3\n";
    vec![
        (Format::Stl, "binary that begins with solid", stl),
        (Format::Stl, "ascii", ascii.into_bytes()),
        (Format::Ply, "little endian", little),
        (Format::Ply, "big endian", big),
        (Format::Ply, "ascii", ascii_ply.into_bytes()),
        (Format::Obj, "", obj.into()),
        (Format::Off, "", off.into()),
    ]
}

#[test]
fn every_format_gives_the_same_mesh() {
    let expected = Soup {
        positions: vec![Vec3::zeros(), Vec3::new(2.0, 0.0, 0.0), Vec3::new(2.0, 2.0, 0.5), Vec3::new(0.0, 2.0, 0.25)],
        faces: vec![[0, 1, 2], [0, 2, 3]],
    };
    for (format, encoding, bytes) in square() {
        assert_eq!(parse(&bytes, format).as_ref(), Ok(&expected), "{format} {encoding}");
        assert_eq!(sniff(&bytes), Some(format), "{format} {encoding}");
    }
}
