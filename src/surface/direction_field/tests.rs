//! Poincaré–Hopf and optimality of direction fields on closed and bounded surfaces.
use super::*;
use crate::{
    geom::Vec3,
    mesh::{FaceId, shapes},
    surface::field_aligned::Parameterizer,
};
use std::f64::consts::{FRAC_PI_2, TAU};

fn surfaces() -> Vec<TriMesh> {
    let bumpy = shapes::icosphere(10.0, 3);
    let place = |p: &Vec3| p * (1.0 + 0.2 * (0.4 * p.x).sin() * (0.5 * p.y + 1.0).cos());
    let bumpy = bumpy.with_positions(Field::from_vec(bumpy.positions().iter().map(place).collect()));
    vec![
        bumpy,
        shapes::torus(20.0, 8.0, 24, 16),
        shapes::perforated_plate(3, 5.0, 2),
        shapes::grid(9, 7, 2.0),
        shapes::annulus(4.0, 12.0, 24, 8),
        shapes::cylinder(6.0, 20.0, 18, 12),
    ]
}

#[test]
fn curvature_and_turning_sum_to_the_euler_characteristic() {
    for mesh in surfaces() {
        let tangent = TangentSpaces::new(&mesh);
        let faces: f64 = mesh.faces().map(|f| tangent.curvature(&mesh, f)).sum();
        let turning: f64 = mesh.boundary_loops().iter().map(|path| tangent.turning(&mesh, path)).sum();
        assert!((faces + turning - TAU * mesh.euler_characteristic() as f64).abs() < 1e-9);
        // The holonomy of a face is its curvature, up to full turns.
        for f in mesh.faces() {
            let around: Complex = mesh.face_halfedges(f).map(|h| tangent.transport(h)).iter().product();
            let way = Complex::from_polar(1.0, tangent.curvature(&mesh, f));
            assert!((around - way).norm() < 1e-9, "{around} {way}");
        }
    }
}

#[test]
fn singularities_sum_to_the_euler_characteristic() {
    for mesh in surfaces() {
        let tangent = TangentSpaces::new(&mesh);
        for symmetry in [1, 2] {
            let expected = i64::from(symmetry) * mesh.euler_characteristic();
            let field = smoothest(&mesh, &tangent, symmetry).unwrap();
            assert_eq!(field.turns(&mesh, &tangent).sum(), expected);
            let curvature = principal(&mesh, &tangent);
            let guides = principal_guides(&curvature, true, 1.0);
            if !guides.is_empty() {
                assert_eq!(guided(&mesh, &tangent, symmetry, &guides).unwrap().turns(&mesh, &tangent).sum(), expected);
            }
        }
    }
}

#[test]
fn tangent_vectors_go_to_space_and_back() {
    for mesh in surfaces() {
        let tangent = TangentSpaces::new(&mesh);
        for v in mesh.vertices().step_by(7) {
            for h in mesh.outgoing(v) {
                let along = mesh.vector(h);
                assert!((tangent.to_space(&mesh, v, tangent.direction[h]) - along.normalize()).norm() < 1e-9);
                let back = tangent.from_space(&mesh, v, along).unwrap();
                assert!((unit(back) - tangent.direction[h]).norm() < 1e-6, "{back} {}", tangent.direction[h]);
                // Where the rim is bent in space, opposite directions are not opposite vectors.
                if mesh.is_boundary_vertex(v) && mesh.bounds().size().z < 1e-9 {
                    let out = tangent.from_space(&mesh, v, -along).unwrap();
                    let there = tangent.to_space(&mesh, v, unit(out));
                    assert!((there + along.normalize()).norm() < 1e-6, "{there} {along}");
                }
            }
        }
    }
}

#[test]
fn a_flat_surface_has_a_parallel_field() {
    let mesh = shapes::grid(9, 7, 2.0);
    let tangent = TangentSpaces::new(&mesh);
    for symmetry in [1, 2] {
        let field = smoothest(&mesh, &tangent, symmetry).unwrap();
        let first = tangent.to_space(&mesh, VertexId(0), field.vectors()[VertexId(0)]);
        for (v, &direction) in field.vectors().enumerate() {
            // Directions beyond the fan of a boundary vertex have no place in space.
            if !mesh.is_boundary_vertex(v) {
                let here = tangent.to_space(&mesh, v, direction);
                let along = if mesh.is_boundary_vertex(VertexId(0)) { here } else { first };
                let along = if symmetry == 2 && here.dot(&along) < 0.0 { -along } else { along };
                assert!((here - along).norm() < 1e-3);
            }
        }
        assert!(field.turns(&mesh, &tangent).faces.is_empty());
    }
}

/// Σ w |u_j − r u_i|² over Σ m |u|².
fn rayleigh(mesh: &TriMesh, tangent: &TangentSpaces, symmetry: i32, u: &[Complex]) -> f64 {
    let weight = crate::surface::tangent::cotangent_weights(mesh);
    let energy: f64 = mesh
        .edges()
        .map(|e| {
            let h = mesh.halfedge(e);
            let [a, b] = mesh.edge_vertices(e).map(|v| u[v.index()]);
            weight[e].max(LEAST_WEIGHT) * (b - tangent.transport(h).powi(symmetry) * a).norm_sqr()
        })
        .sum();
    energy / masses(mesh, tangent).iter().zip(u).map(|(m, z)| m * z.norm_sqr()).sum::<f64>()
}

#[test]
fn the_smoothest_field_is_the_least_eigenvector() {
    let mesh = surfaces().swap_remove(0);
    let tangent = TangentSpaces::new(&mesh);
    let mass = masses(&mesh, &tangent);
    let area: f64 = mass.iter().sum();
    let extra: Vec<f64> = mass.iter().map(|it| SHIFT / area * it).collect();
    let factor = connection_laplacian(&mesh, &tangent, 1, &extra).unwrap();
    let to_complex = |x: &[f64]| x.chunks_exact(2).map(|it| Complex::new(it[0], it[1])).collect::<Vec<_>>();
    let mut x = least_eigenvector(&factor, &mass);
    let found = rayleigh(&mesh, &tangent, 1, &to_complex(&x));
    // A hundred plain steps of inverse iteration find nothing better.
    for _ in 0..100 {
        x = x.iter().enumerate().map(|(i, it)| mass[i / 2] * it).collect();
        factor.solve_in_place(&mut x);
        let norm = x.iter().map(|it| it * it).sum::<f64>().sqrt();
        x.iter_mut().for_each(|it| *it /= norm);
    }
    let better = rayleigh(&mesh, &tangent, 1, &to_complex(&x));
    assert!(found < better * (1.0 + 1e-5), "{found} {better}");
}

#[test]
fn trivial_fields_have_exactly_the_singularities_asked_for() {
    for mesh in surfaces() {
        let tangent = TangentSpaces::new(&mesh);
        let solver = Parameterizer::new(&mesh).unwrap();
        for symmetry in [1, 2] {
            let loops = vec![0; mesh.boundary_loops().len()];
            let all = i64::from(symmetry) * mesh.euler_characteristic();
            let n = mesh.face_count();
            let mut faces: Vec<(FaceId, i32)> =
                (0..all.abs()).map(|k| (FaceId::new(11 + 13 * k as usize % n), all.signum() as i32)).collect();
            faces.extend([(FaceId::new(n / 2), 1), (FaceId::new(n / 2 + 9), -1)]);
            faces.sort();
            let turns = Turns { faces, loops };
            let (field, rotation) = trivial(&mesh, &tangent, symmetry, &turns, &solver).unwrap();
            assert_eq!(Turns::by_rotation(&mesh, &tangent, symmetry, &rotation), turns);
            assert_eq!(field.turns(&mesh, &tangent).sum(), all);
            for e in mesh.edges() {
                let h = mesh.halfedge(e);
                let carried = field.power[mesh.tail(h)] * tangent.transport(h).powi(symmetry);
                let rotated = carried * Complex::from_polar(1.0, rotation[e]);
                assert!((field.power[mesh.head(h)] - rotated).norm() < 1e-9);
            }
            let one_more = Turns { faces: [&turns.faces[..], &[(FaceId(0), 1)]].concat(), ..turns };
            let error = trivial(&mesh, &tangent, symmetry, &one_more, &solver).unwrap_err().to_string();
            assert!(error.contains("-1 is missing"), "{error}");
        }
    }
}

#[test]
fn principal_directions_of_a_cylinder_run_around_and_along_it() {
    let mesh = shapes::cylinder(6.0, 20.0, 48, 12);
    let tangent = TangentSpaces::new(&mesh);
    let curvature = principal(&mesh, &tangent);
    for (least, expected) in [(false, 0.0), (true, 1.0)] {
        let field = guided(&mesh, &tangent, 2, &principal_guides(&curvature, least, 1.0)).unwrap();
        for (v, &direction) in field.vectors().enumerate().filter(|it| !mesh.is_boundary_vertex(it.0)) {
            let along = tangent.to_space(&mesh, v, direction).z.abs();
            assert!((along - expected).abs() < 1e-6, "{v}: {along}");
        }
    }
}

#[test]
fn guides_and_boundaries_are_followed() {
    let mesh = shapes::annulus(4.0, 12.0, 24, 8);
    let tangent = TangentSpaces::new(&mesh);
    let guides = boundary_guides(&mesh, &tangent, 0.0, 100.0);
    let field = guided(&mesh, &tangent, 1, &guides).unwrap();
    // Both rims with the surface on the left: opposite ways around, so the field turns in between.
    assert_eq!(field.turns(&mesh, &tangent).loops, [0, 0]);
    let radial = guided(&mesh, &tangent, 1, &boundary_guides(&mesh, &tangent, FRAC_PI_2, 100.0)).unwrap();
    assert_eq!(radial.turns(&mesh, &tangent).loops, [0, 0]);
    let grid = shapes::grid(9, 7, 2.0);
    let tangent = TangentSpaces::new(&grid);
    let middle = VertexId(34);
    let wish = tangent.from_space(&grid, middle, Vec3::new(1.0, 2.0, 0.0)).unwrap();
    let field = guided(&grid, &tangent, 1, &[Guide { vertex: middle, direction: wish, strength: 10.0 }]).unwrap();
    let other = tangent.to_space(&grid, VertexId(45), field.vectors()[VertexId(45)]);
    assert!((other - Vec3::new(1.0, 2.0, 0.0).normalize()).norm() < 1e-3, "{other}");
    assert!(matches!(guided(&grid, &tangent, 1, &[]), Err(FieldError::Zero(_))));
}
