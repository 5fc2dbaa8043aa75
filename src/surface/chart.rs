//! A part of a mesh opened along cut edges, with local vertices of its own: what gets flattened, and what the search for
//! cuts tries by the hundred without building meshes.
use crate::{
    geom::Vec2,
    mesh::{EdgeId, FaceId, Field, HalfedgeId, Id, TriMesh, VertexId},
};

const NONE: u32 = u32::MAX;
/// A flat triangle may lose this share of its distance to collapse in one step.
const TOWARDS_COLLAPSE: f64 = 0.8;

/// Angles, cotangents, lengths and areas of a mesh, computed once and shared by all its charts.
#[derive(Debug, Clone)]
pub struct Metric {
    /// Interior angle at the tail of each halfedge, radians.
    pub angle: Field<HalfedgeId, f64>,
    /// Cotangent of the angle opposite each halfedge.
    pub cotangent: Field<HalfedgeId, f64>,
    /// Length of each halfedge, mm.
    pub length: Field<HalfedgeId, f64>,
    /// Area of each face, mm².
    pub area: Field<FaceId, f64>,
    /// Length that each halfedge should have in the plane where it lies on the boundary of a chart, mm: that in space unless
    /// [`Metric::with_rim`] says otherwise.
    pub rim: Field<HalfedgeId, f64>,
}

impl Metric {
    /// Measures a mesh.
    pub fn new(mesh: &TriMesh) -> Self {
        let n = mesh.halfedge_count();
        let [mut angle, mut cotangent, mut length] = [(); 3].map(|()| Field::filled(n, 0.0));
        let area = Field::from_fn(mesh.face_count(), |f| {
            let points = mesh.face_positions(f);
            let sides = [0, 1, 2].map(|k| points[(k + 1) % 3] - points[k]);
            let double_area = sides[0].cross(&sides[1]).norm();
            let halfedges = mesh.face_halfedges(f);
            for k in 0..3 {
                let (next, last) = ((k + 1) % 3, (k + 2) % 3);
                length[halfedges[k]] = sides[k].norm();
                angle[halfedges[k]] = f64::atan2(double_area, -sides[k].dot(&sides[last]));
                cotangent[halfedges[k]] = -sides[next].dot(&sides[last]) / double_area;
            }
            0.5 * double_area
        });
        let rim = length.clone();
        Self { angle, cotangent, length, area, rim }
    }

    /// The same where some halfedges, as boundaries of charts, should be so many times as long in the plane as in space.
    pub fn with_rim(mut self, factors: &[(HalfedgeId, f64)]) -> Self {
        for &(h, factor) in factors {
            self.rim[h] = factor * self.length[h];
        }
        self
    }
}

/// Faces of a mesh with the vertices that remain joined once the cut edges are open. A vertex of the mesh through which
/// the cut runs is several vertices here, one per sector.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// The faces, ascending.
    pub faces: Vec<FaceId>,
    /// Local vertices of each face; corner k is the tail of halfedge 3 f + k.
    pub corners: Vec<[u32; 3]>,
    /// Vertex of the mesh for each local vertex.
    pub origin: Vec<VertexId>,
    /// Boundary loops, the surface on the left: each halfedge with the local vertex at its tail.
    pub loops: Vec<Vec<(HalfedgeId, u32)>>,
    /// Whether a local vertex lies on a loop.
    pub on_boundary: Vec<bool>,
}

/// One chart per label below `count`, of the faces that have it, without cuts.
pub fn labelled_charts<I: Id>(mesh: &TriMesh, labels: &Field<FaceId, I>, count: usize) -> Vec<Chart> {
    let mut faces: Vec<Vec<FaceId>> = vec![Vec::new(); count];
    for (f, label) in labels.enumerate() {
        faces[label.index()].push(f);
    }
    let mut builder = ChartBuilder::new(mesh);
    faces.into_iter().map(|it| builder.chart(it, &|_| false)).collect()
}

impl Chart {
    /// Number of local vertices.
    pub fn vertex_count(&self) -> usize {
        self.origin.len()
    }

    /// The three halfedges of local face `k` with their tails and heads.
    pub fn face_halfedges(&self, k: usize) -> [(HalfedgeId, u32, u32); 3] {
        let first = 3 * self.faces[k].0;
        let [a, b, c] = self.corners[k];
        [(HalfedgeId(first), a, b), (HalfedgeId(first + 1), b, c), (HalfedgeId(first + 2), c, a)]
    }

    /// All halfedges of its faces with local tails and heads.
    pub fn halfedges(&self) -> impl Iterator<Item = (HalfedgeId, u32, u32)> + '_ {
        (0..self.faces.len()).flat_map(|k| self.face_halfedges(k))
    }

    /// Boundary edges, loop after loop: halfedge, local tail and head.
    pub fn boundary_edges(&self) -> impl Iterator<Item = (HalfedgeId, u32, u32)> + '_ {
        self.loops.iter().flat_map(|path| {
            let n = path.len();
            (0..n).map(move |i| (path[i].0, path[i].1, path[(i + 1) % n].1))
        })
    }

    /// The loops laid out as `uv` has the local vertices.
    pub fn contours(&self, uv: &[Vec2]) -> Vec<Vec<Vec2>> {
        self.loops.iter().map(|path| path.iter().map(|&(_, v)| uv[v as usize]).collect()).collect()
    }

    /// The longest step along `moves` that no triangle collapses on, with a margin; infinite where none does.
    pub fn longest_step(&self, uv: &[Vec2], moves: &[Vec2]) -> f64 {
        let mut longest = f64::INFINITY;
        for &[a, b, c] in &self.corners {
            let side = |at: &[Vec2], v: u32| at[v as usize] - at[a as usize];
            let (p, q, dp, dq) = (side(uv, b), side(uv, c), side(moves, b), side(moves, c));
            let cross = crate::geom::cross2;
            // Area along the step: area + linear t + square t².
            let (area, linear, square) = (cross(p, q), cross(p, dq) + cross(dp, q), cross(dp, dq));
            let discriminant = linear * linear - 4.0 * square * area;
            if discriminant < 0.0 || area <= 0.0 {
                continue;
            }
            // The least positive root, without cancellation.
            let k = -0.5 * (linear + discriminant.sqrt().copysign(linear));
            for root in [k / square, area / k] {
                if root > 0.0 {
                    longest = longest.min(TOWARDS_COLLAPSE * root);
                }
            }
        }
        longest
    }

    /// V − E + F.
    pub fn euler_characteristic(&self) -> i64 {
        let boundary: usize = self.loops.iter().map(Vec::len).sum();
        let edges = (3 * self.faces.len() + boundary) / 2;
        self.vertex_count() as i64 - edges as i64 + self.faces.len() as i64
    }

    /// Number of the loop for every vertex on one, `u32::MAX` for the others.
    pub fn loop_of_vertices(&self) -> Vec<u32> {
        let mut out = vec![NONE; self.vertex_count()];
        for (k, path) in self.loops.iter().enumerate() {
            for &(_, v) in path {
                out[v as usize] = k as u32;
            }
        }
        out
    }

    /// Whether a connected chart has a boundary and no handle.
    pub fn is_planar(&self) -> bool {
        !self.loops.is_empty() && self.euler_characteristic() == 2 - self.loops.len() as i64
    }

    /// Whether a connected chart is a disk.
    pub fn is_disk(&self) -> bool {
        self.loops.len() == 1 && self.euler_characteristic() == 1
    }
}

/// Makes charts of one mesh; keeps the scratch memory between them.
#[derive(Debug, Clone)]
pub struct ChartBuilder<'a> {
    mesh: &'a TriMesh,
    /// Local vertex at the tail of each halfedge of the chart being made, `NONE` elsewhere.
    corner: Vec<u32>,
}

impl<'a> ChartBuilder<'a> {
    /// For charts of `mesh`.
    pub fn new(mesh: &'a TriMesh) -> Self {
        Self { mesh, corner: vec![NONE; mesh.halfedge_count()] }
    }

    /// The mesh.
    pub fn mesh(&self) -> &'a TriMesh {
        self.mesh
    }

    /// The chart of `faces`, opened along the edges for which `cut` holds; `faces` must be whole components of the mesh
    /// so opened, in any order.
    pub fn chart(&mut self, mut faces: Vec<FaceId>, cut: &impl Fn(EdgeId) -> bool) -> Chart {
        faces.sort_unstable();
        let mesh = self.mesh;
        let across = |h: HalfedgeId| mesh.twin(h).filter(|_| !cut(mesh.edge(h)));
        let mut origin = Vec::new();
        for h in faces.iter().flat_map(|&f| mesh.face_halfedges(f)) {
            if self.corner[h.0 as usize] != NONE {
                continue;
            }
            let id = origin.len() as u32;
            origin.push(mesh.tail(h));
            self.corner[h.0 as usize] = id;
            // Counter-clockwise until the sector ends or closes, then clockwise for what lies on the other side.
            let mut at = h;
            while let Some(next) = across(mesh.previous(at)).filter(|&it| it != h) {
                self.corner[next.0 as usize] = id;
                at = next;
            }
            let mut at = h;
            while let Some(next) = across(at).map(|it| mesh.next(it)).filter(|it| self.corner[it.0 as usize] == NONE) {
                self.corner[next.0 as usize] = id;
                at = next;
            }
        }
        let corners: Vec<[u32; 3]> =
            faces.iter().map(|&f| mesh.face_halfedges(f).map(|h| self.corner[h.0 as usize])).collect();
        let mut on_boundary = vec![false; origin.len()];
        let mut loops: Vec<Vec<(HalfedgeId, u32)>> = Vec::new();
        // A boundary halfedge that has been walked is marked by dropping its corner.
        for &start in faces.iter().flat_map(|&f| mesh.face_halfedges(f)).collect::<Vec<_>>().iter() {
            if across(start).is_some() || self.corner[start.0 as usize] == NONE {
                continue;
            }
            let mut path = Vec::new();
            let mut at = start;
            loop {
                let tail = std::mem::replace(&mut self.corner[at.0 as usize], NONE);
                on_boundary[tail as usize] = true;
                path.push((at, tail));
                at = mesh.next(at);
                while let Some(twin) = across(at) {
                    at = mesh.next(twin);
                }
                if at == start {
                    break;
                }
            }
            loops.push(path);
        }
        for h in faces.iter().flat_map(|&f| mesh.face_halfedges(f)) {
            self.corner[h.0 as usize] = NONE;
        }
        Chart { faces, corners, origin, loops, on_boundary }
    }

    /// The connected components of `faces` once the cut edges are open, each sorted, in the order of their first face.
    /// `faces` must be whole components of some coarser cut.
    pub fn components(&mut self, faces: &[FaceId], cut: &impl Fn(EdgeId) -> bool) -> Vec<Vec<FaceId>> {
        let mesh = self.mesh;
        let mut sorted = faces.to_vec();
        sorted.sort_unstable();
        let mut out = Vec::new();
        // The first corner of a face marks it as reached.
        for &seed in &sorted {
            if self.corner[3 * seed.0 as usize] != NONE {
                continue;
            }
            self.corner[3 * seed.0 as usize] = 0;
            let mut component = vec![seed];
            let mut done = 0;
            while done < component.len() {
                for h in mesh.face_halfedges(component[done]) {
                    let Some(twin) = mesh.twin(h).filter(|_| !cut(mesh.edge(h))) else { continue };
                    let g = mesh.face(twin);
                    if self.corner[3 * g.0 as usize] == NONE {
                        self.corner[3 * g.0 as usize] = 0;
                        component.push(g);
                    }
                }
                done += 1;
            }
            component.sort_unstable();
            out.push(component);
        }
        for f in out.iter().flatten() {
            self.corner[3 * f.0 as usize] = NONE;
        }
        out
    }
}
