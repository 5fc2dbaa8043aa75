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

#[test]
fn polygons_and_odd_lines_are_understood() {
    let pentagon = "v 0 0 0\r\nv 2 0 0\r\nv 3 2 0\r\nv 1 3 0\r\nv -1 2 0\r\ns off\r\nl 1 2\r\np 1\r\nf 1 2 3 4 5\r\n";
    assert_eq!(parse(pentagon.as_bytes(), Format::Obj).unwrap().faces.len(), 3);
    let latin1 = b"# caf\xe9\ng t\xeate\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(parse(latin1, Format::Obj).unwrap().faces, [[0, 1, 2]]);
    let degenerate = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1 1 2\nf 3\nf 1 2 3\n";
    assert_eq!(parse(degenerate.as_bytes(), Format::Obj).unwrap().faces, [[0, 1, 1], [0, 0, 1], [2, 2, 2], [0, 1, 2]]);
    let one_line = "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert_eq!(parse(one_line.as_bytes(), Format::Off).unwrap().faces, [[0, 1, 2]]);
    let colours = "COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 0 0 0\n0 1 0 9 9 9 9\n3 0 1 2 0.5 0.5 0.5\n";
    assert_eq!(parse(colours.as_bytes(), Format::Off).unwrap().faces, [[0, 1, 2]]);
    let solids = "SOLID a\nFACET NORMAL 0 0 1\nOUTER LOOP\nVERTEX 0 0 0\nVERTEX 1 0 0\nVERTEX 0 1 0\nENDLOOP\nENDFACET\n\
                  ENDSOLID a\nsolid b\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex -1 0 -0\nendloop\n\
                  endfacet\nendsolid";
    let soup = parse(solids.as_bytes(), Format::Stl).unwrap();
    assert_eq!((soup.positions.len(), soup.faces), (4, vec![[0, 1, 2], [0, 2, 3]]));
}

#[test]
fn every_error_names_the_place_and_the_problem() {
    let ply = |vertex: &str, face: &str, data: &str| {
        format!("ply\nformat ascii 1.0\nelement vertex 3\n{vertex}element face 1\n{face}end_header\n{data}")
    };
    let (xyz, list) =
        ("property float x\nproperty float y\nproperty float z\n", "property list uchar int vertex_index\n");
    let points = "0 0 0\n1 0 0\n0 1 0\n";
    let cases: Vec<(Format, Vec<u8>, &str)> = vec![
        (Format::Obj, "".into(), "the file is empty"),
        (Format::Obj, "hello\n".into(), "there is no vertex"),
        (Format::Obj, b"v 0 0 0\n\0".to_vec(), "zero bytes"),
        (Format::Obj, "v 0 0 0\n\nv 1 2\n".into(), "line 3: a vertex needs three numbers: `v 1 2`"),
        (Format::Obj, "v 0 0 0\nv 1 x 0\n".into(), "line 2: a vertex needs three numbers: `v 1 x 0`"),
        (Format::Obj, "v 1 1 1 0\n".into(), "line 1: the fourth number of a vertex (its weight) is zero"),
        (Format::Obj, "v 0 0 0\nf 1 1 1\n# x\nf 1 2 3\n".into(), "line 4: a face names vertex 2, but the file holds 1"),
        (Format::Obj, "v 0 0 0\nf 1 0 1\n".into(), "line 2: a face names vertex 0, but OBJ counts from 1"),
        (Format::Obj, "v 0 0 0\nf -1 -2 1\nv 1 1 1\n".into(), "line 2: a face counts 2 vertices back, but only 1 come"),
        (Format::Obj, "v 0 0 0\nf 1 1 a/2\n".into(), "line 2: a face corner is not a whole number: `f 1 1 a`"),
        (Format::Obj, "v 0 0 0\nf 1 1 /2\n".into(), "line 2: the face corner `/2` names no vertex"),
        (Format::Obj, "v 0 0 0\nf\n".into(), "line 2: a face has no corners"),
        (Format::Stl, "solid".into(), "an STL file has at least 84 bytes"),
        (Format::Stl, vec![1; 200], "the header announces 16843009 triangles, but the file ends after 2"),
        (Format::Stl, "solid\nfacet normal 0 0 1\nouter".into(), "the file ends with `outer` instead of `endsolid`"),
        (
            Format::Stl,
            "solid\n\nfacet normal 0 0 1\nouter loop\nvertex 0 0\nendloop\nendsolid".into(),
            "line 3: the facet that begins here is wrong: vertex f32 f32 f32",
        ),
        (Format::Ply, "ply\nformat ascii 1.0\nelement vertex 1\n".into(), "line 4: the PLY header is wrong"),
        (Format::Ply, "ply\nformat ascii 1.0\nend_header\n".into(), "announces no `element vertex`"),
        (Format::Ply, ply("property float x\n", list, "").into(), "no coordinate `y`"),
        (Format::Ply, ply(xyz, "property int n\n", "").into(), "no list `vertex_indices`"),
        (Format::Ply, ply(xyz, list, "0 0 0\n1 0 0\n").into(), "line 12: vertex 2 of 3: the file ends here"),
        (Format::Ply, ply(xyz, list, "0 0 0\n1 zero 0\n").into(), "line 11: vertex 1 of 3:"),
        (
            Format::Ply,
            ply(xyz, list, &format!("{points}3 0 1 3\n")).into(),
            "face 0 (counting from 0): a face names vertex 3",
        ),
        (Format::Ply, ply(xyz, list, &format!("{points}3 0 1 -1\n")).into(), "a face names vertex -1"),
        (Format::Ply, ply(xyz, list, &format!("{points}200 0 1 2\n")).into(), "line 13: face 0 of 1:"),
        (Format::Off, "OFFSET\n".into(), "line 1: an OFF file begins with `OFF`"),
        (Format::Off, "nOFF 4\n".into(), "`nOFF` does not lie in three dimensions"),
        (Format::Off, "OFF BINARY\n".into(), "binary OFF is not supported"),
        (Format::Off, "OFF\n3 1\n0 0 0\n".into(), "the file ends before vertex 1 of 3"),
        (Format::Off, "OFF\n1 1\n0 0 z\n".into(), "line 3: `z` is not a coordinate"),
        (
            Format::Off,
            "OFF\n1 1 0\n0 0 0\n3 0 0 1\n".into(),
            "line 4: a face names vertex 1, but the vertices are 0 to 0",
        ),
        (Format::Off, "OFF\n1 1 0\n0 0 0\n9000000000 0\n".into(), "line 4: the index of a vertex is missing"),
    ];
    for (format, bytes, expected) in cases {
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let message = parse(&bytes, format).unwrap_err().to_string();
        assert!(message.contains(expected), "{format} {text:?}\n{message}");
        assert!(message.contains("; ") && !message.contains('\n'), "{message}");
    }
}

#[test]
fn counts_in_a_header_are_not_trusted() {
    let huge = "ply\nformat binary_little_endian 1.0\nelement nothing 1000000000000\nelement vertex 4000000000\n\
                property float x\nproperty float y\nproperty float z\nelement face 4000000000\n\
                property list uint uint vertex_indices\nend_header\n1234567890123456";
    assert!(parse(huge.as_bytes(), Format::Ply).unwrap_err().to_string().contains("vertex 1 of 4000000000"));
    let list = "ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\n\
                property float z\nelement face 1\nproperty list uint uint vertex_indices\nend_header\n\u{7f}\u{7f}\u{7f}\u{7f}1234";
    assert!(parse(list.as_bytes(), Format::Ply).unwrap_err().to_string().contains("face 0 of 1"));
    assert!(parse(b"OFF\n99999999999 99999999999 0\n0 0 0\n", Format::Off).is_err());
    assert!(parse(b"OFF\n99999999999999999999 1 0\n0 0 0\n", Format::Off).is_err());
}

/// Every prefix of every file, and thousands of files with a few bytes changed: an answer, never a panic.
#[test]
fn damaged_files_never_panic() {
    let mut state = 7_u64;
    let mut random = move |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n
    };
    for (format, encoding, bytes) in square() {
        let whole = |length: &usize| parse(&bytes[..*length], format).is_ok_and(|it| it.faces.len() == 2);
        // Only the end of the last face may be missing: colours, or the remark that the solid ends.
        let first_whole = (0..bytes.len()).find(whole).unwrap_or(bytes.len());
        assert!(first_whole + 12 > bytes.len(), "{format} {encoding}: {first_whole} of {} bytes", bytes.len());
        for _ in 0..3000 {
            let mut damaged = bytes.clone();
            for _ in 0..1 + random(4) {
                let at = random(damaged.len());
                match random(4) {
                    0 => damaged[at] = random(256) as u8,
                    1 => damaged[at] = b"0123456789-+.eE \n/\\#"[random(20)],
                    2 => drop(damaged.remove(at)),
                    _ => damaged.insert(at, damaged[random(damaged.len())]),
                }
            }
            if let Ok(soup) = parse(&damaged, format) {
                assert!(soup.faces.iter().flatten().all(|&v| (v as usize) < soup.positions.len()));
            }
        }
    }
}

#[test]
fn the_name_must_fit_the_content() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    for (format, encoding, bytes) in square() {
        let own = FORMATS.iter().find(|it| it.0 == format).unwrap().1;
        assert!(read(&write(&format!("Right.{}", own.to_uppercase()), &bytes)).is_ok());
        for (other, extension, _) in FORMATS.into_iter().filter(|it| it.0 != format) {
            let error = read(&write(&format!("wrong.{extension}"), &bytes)).unwrap_err();
            let right = matches!(error, ImportError::WrongExtension { named, content, .. } if named == other && content == format);
            assert!(right, "{encoding}: {error}");
        }
        let error = read(&write("mesh.3ds", &bytes)).unwrap_err();
        assert!(error.to_string().contains(&format!("it holds {format} data, so rename it")), "{error}");
    }
    let error = read(&write("notes.txt", b"nothing")).unwrap_err();
    assert!(error.to_string().contains("export the mesh in one of these formats"), "{error}");
    let error = read(&folder.path().join("none.obj")).unwrap_err();
    assert!(matches!(error, ImportError::Unreadable { .. }), "{error}");
    assert!(matches!(read(folder.path()).unwrap_err(), ImportError::NotAFile { .. }));
}
