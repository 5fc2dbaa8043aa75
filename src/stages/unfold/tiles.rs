//! A polyhedron as flat tiles and the straight hinges between them: what is unfolded, and never cut, is a tile.
use std::collections::BTreeMap;

use nalgebra::Isometry2;

use crate::{
    geom::{Vec2, Vec3, angle_between, cross2},
    mesh::{EdgeId, FaceId, Field, HalfedgeId, Id, TriMesh},
};

/// Faces whose normals differ from that of the first face of a tile by less belong to it, radians. Laid into one plane they
/// keep their lengths to half the square of this.
const FLAT: f64 = 1e-5;
/// Edges between two tiles lie on one line when they leave it by less than this share of the length of the first.
const COLLINEAR: f64 = 1e-6;

/// Connected faces in one plane.
#[derive(Debug, Clone)]
pub(super) struct Tile {
    /// The faces.
    pub(super) faces: Vec<FaceId>,
    /// Corners of each face in the plane of the tile, mm, in the order of the face.
    pub(super) triangles: Vec<[Vec2; 3]>,
    /// Area, mm².
    pub(super) area: f64,
}

/// All edges on one line between two tiles: they fold together or are cut together.
#[derive(Debug, Clone)]
pub(super) struct Hinge {
    /// The tiles.
    pub(super) tiles: [u32; 2],
    /// The edges.
    pub(super) edges: Vec<EdgeId>,
    /// Their length, mm.
    pub(super) length: f64,
    /// Angle between the normals of the tiles, radians.
    pub(super) bend: f64,
    /// From the plane of the second tile to that of the first, unfolded.
    pub(super) motion: Isometry2<f64>,
}

/// All of them.
#[derive(Debug, Clone)]
pub(super) struct Tiles {
    /// The tiles.
    pub(super) tiles: Vec<Tile>,
    /// The hinges.
    pub(super) hinges: Vec<Hinge>,
    /// Hinges of each tile with the tile on their other side.
    pub(super) around: Vec<Vec<(u32, u32)>>,
    /// Vertices of each face, for telling which corners belong together.
    pub(super) corners: Field<FaceId, [u32; 3]>,
}

impl Tiles {
    /// Finds the tiles, the largest faces first, and their hinges. Faces of different groups are in different tiles.
    pub(super) fn new(mesh: &TriMesh, group: &Field<FaceId, u32>) -> Self {
        let (tiles, tile_of) = tiles(mesh, group);
        let flat = flatten(mesh, &tiles);
        let mut shared: BTreeMap<[u32; 2], Vec<EdgeId>> = BTreeMap::new();
        for e in mesh.edges() {
            let h = mesh.halfedge(e);
            let Some(twin) = mesh.twin(h) else { continue };
            let pair = [h, twin].map(|it| tile_of[mesh.face(it)]);
            if pair[0] != pair[1] {
                shared.entry([pair[0].min(pair[1]), pair[0].max(pair[1])]).or_default().push(e);
            }
        }
        let place = |h: HalfedgeId| flat[mesh.face(h)][h.index() % 3];
        let ends = |h: HalfedgeId| [place(h), place(mesh.next(h))];
        let mut hinges = Vec::new();
        for (pair, mut edges) in shared {
            edges.sort_by(|&a, &b| mesh.edge_length(b).total_cmp(&mesh.edge_length(a)).then(a.cmp(&b)));
            // The same line of both planes, in the direction of the first tile.
            let sides = |e: EdgeId| {
                let h = mesh.halfedge(e);
                let twin = mesh.twin(h).expect("hinges are not on the boundary");
                let (own, other) = if tile_of[mesh.face(h)] == pair[0] { (h, twin) } else { (twin, h) };
                let [b, a] = ends(other);
                (ends(own), [a, b])
            };
            while let Some(&first) = edges.first() {
                let ([p, q], there) = sides(first);
                let off = |it: Vec2| cross2(q - p, it - p).abs() <= COLLINEAR * (q - p).norm_squared();
                let (group, rest): (Vec<EdgeId>, Vec<EdgeId>) =
                    edges.iter().copied().partition(|&e| sides(e).0.into_iter().all(off));
                edges = rest;
                let h = mesh.halfedge(first);
                let twin = mesh.twin(h).expect("hinges are not on the boundary");
                hinges.push(Hinge {
                    tiles: pair,
                    length: group.iter().map(|&e| mesh.edge_length(e)).sum(),
                    edges: group,
                    bend: angle_between(mesh.normal(mesh.face(h)), mesh.normal(mesh.face(twin))),
                    motion: between(there, [p, q]),
                });
            }
        }
        let mut around = vec![Vec::new(); tiles.len()];
        for (k, hinge) in hinges.iter().enumerate() {
            let [a, b] = hinge.tiles;
            around[a as usize].push((k as u32, b));
            around[b as usize].push((k as u32, a));
        }
        let tiles = tiles.into_iter().map(|faces| Tile {
            area: faces.iter().map(|&f| mesh.area(f)).sum(),
            triangles: faces.iter().map(|&f| flat[f]).collect(),
            faces,
        });
        let corners = Field::from_fn(mesh.face_count(), |f| mesh.face_vertices(f).map(|v| v.0));
        Self { tiles: tiles.collect(), hinges, around, corners }
    }

    /// From the plane of the tile on the other side of a hinge to that of `tile`.
    pub(super) fn across(&self, hinge: u32, tile: u32) -> Isometry2<f64> {
        let it = &self.hinges[hinge as usize];
        if it.tiles[0] == tile { it.motion } else { it.motion.inverse() }
    }
}

/// Faces by tile, and the tile of each face.
fn tiles(mesh: &TriMesh, group: &Field<FaceId, u32>) -> (Vec<Vec<FaceId>>, Field<FaceId, u32>) {
    const NONE: u32 = u32::MAX;
    let mut seeds: Vec<(f64, FaceId)> = mesh.faces().map(|f| (mesh.area(f), f)).collect();
    seeds.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut tile_of = Field::filled(mesh.face_count(), NONE);
    let mut tiles = Vec::new();
    for (_, seed) in seeds {
        if tile_of[seed] != NONE {
            continue;
        }
        let number = tiles.len() as u32;
        let normal = mesh.normal(seed);
        let mut faces = vec![seed];
        tile_of[seed] = number;
        let mut done = 0;
        while done < faces.len() {
            for h in mesh.face_halfedges(faces[done]) {
                let Some(g) = mesh.twin(h).map(|it| mesh.face(it)) else { continue };
                if tile_of[g] == NONE && group[g] == group[seed] && angle_between(normal, mesh.normal(g)) < FLAT {
                    tile_of[g] = number;
                    faces.push(g);
                }
            }
            done += 1;
        }
        tiles.push(faces);
    }
    (tiles, tile_of)
}

/// Corners of every face in the plane of its tile, which is that of the tile's first face.
fn flatten(mesh: &TriMesh, tiles: &[Vec<FaceId>]) -> Field<FaceId, [Vec2; 3]> {
    let mut flat = Field::filled(mesh.face_count(), [Vec2::zeros(); 3]);
    for faces in tiles {
        let [origin, b, _] = mesh.face_positions(faces[0]);
        let normal = mesh.normal(faces[0]);
        let x = (b - origin).normalize();
        let y: Vec3 = normal.cross(&x);
        for &f in faces {
            flat[f] = mesh.face_positions(f).map(|p| Vec2::new((p - origin).dot(&x), (p - origin).dot(&y)));
        }
    }
    flat
}

/// The motion that takes the middle and the direction of one segment to those of another.
fn between(from: [Vec2; 2], to: [Vec2; 2]) -> Isometry2<f64> {
    let turn = nalgebra::UnitComplex::rotation_between(&(from[1] - from[0]), &(to[1] - to[0]));
    let shift = (to[0] + to[1]) / 2.0 - turn * ((from[0] + from[1]) / 2.0);
    Isometry2::from_parts(shift.into(), turn)
}
