//! The halfedge triangle mesh.
use super::ids::{EdgeId, FaceId, Field, HalfedgeId, Id, VertexId};
use crate::geom::{Box3, Vec3, angle_between};

/// No twin: the halfedge lies on the boundary.
const NONE: u32 = u32::MAX;
/// A face is degenerate when twice its area is below this share of its longest squared edge (a corner of about
/// 1e-12 rad): angles and normals then hold no correct digit.
const DEGENERATE: f64 = 1e-12;

/// Why arrays of positions and faces are not a `TriMesh`. Ids are those of the arrays given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No faces at all.
    #[error("the mesh has no faces")]
    Empty,
    /// More elements than 32-bit ids hold.
    #[error("the mesh has {faces} faces; at most {limit} are supported")]
    TooLarge {
        /// Faces given.
        faces: usize,
        /// Most that fit.
        limit: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} names vertex {index}, but there are only {vertices} vertices (0 to {})", vertices - 1)]
    IndexOutOfRange {
        /// The face.
        face: usize,
        /// The index it holds.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} has a coordinate that is not a finite number: ({}, {}, {})", position.x, position.y, position.z)]
    NotFinite {
        /// The vertex.
        vertex: usize,
        /// What it holds.
        position: Vec3,
    },
    /// A face without area.
    #[error("face {face} (vertices {} {} {}) has no area; it lies at ({:.6}, {:.6}, {:.6})", corners[0], corners[1], corners[2], place.x, place.y, place.z)]
    DegenerateFace {
        /// The face.
        face: usize,
        /// Its vertices.
        corners: [u32; 3],
        /// Where it lies.
        place: Vec3,
    },
    /// A vertex that no face uses.
    #[error("vertex {vertex} belongs to no face")]
    Unreferenced {
        /// The vertex.
        vertex: usize,
    },
    /// Two faces run along an edge in the same direction, or more than two share it.
    #[error("edge {}-{} is used by {} faces in a way that is not a surface (non-manifold or wrongly oriented), near ({:.6}, {:.6}, {:.6}); faces {faces:?}", edge[0], edge[1], faces.len(), place.x, place.y, place.z)]
    NonManifoldEdge {
        /// Its vertices.
        edge: [u32; 2],
        /// The faces along it.
        faces: Vec<usize>,
        /// Its midpoint.
        place: Vec3,
    },
    /// The faces around a vertex do not form one fan.
    #[error("vertex {vertex} at ({:.6}, {:.6}, {:.6}) joins separate fans of faces (non-manifold vertex)", place.x, place.y, place.z)]
    NonManifoldVertex {
        /// The vertex.
        vertex: usize,
        /// Its position.
        place: Vec3,
    },
}

/// An oriented manifold triangle mesh, with or without boundary, in any number of components.
///
/// Guaranteed by [`TriMesh::new`]: indices in range, positions finite, every vertex in a face, every edge in one face or
/// in two of opposite direction, one fan of faces around every vertex, no degenerate face at construction.
/// Positions may be changed afterwards ([`TriMesh::positions_mut`]), connectivity never: algorithms that change it build
/// a new mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct TriMesh {
    positions: Field<VertexId, Vec3>,
    tails: Vec<VertexId>,
    twins: Vec<u32>,
    outgoing: Field<VertexId, HalfedgeId>,
    edges: Field<EdgeId, HalfedgeId>,
    edge_of: Vec<EdgeId>,
}

impl TriMesh {
    /// Most faces of a mesh: three halfedges per face must fit in 32 bits with one number to spare.
    pub const LIMIT: usize = 1 << 30;

    /// Builds and validates. O(F log F).
    pub fn new(positions: Vec<Vec3>, faces: &[[u32; 3]]) -> Result<Self, MeshError> {
        check_arrays(&positions, faces)?;
        for (face, corners) in faces.iter().enumerate() {
            let [a, b, c] = corners.map(|i| positions[i as usize]);
            if is_degenerate([a, b, c]) {
                return Err(MeshError::DegenerateFace { face, corners: *corners, place: (a + b + c) / 3.0 });
            }
        }
        let tails: Vec<VertexId> = faces.as_flattened().iter().map(|&i| VertexId(i)).collect();
        let twins = pair_halfedges(&positions, faces)?;
        let (edges, edge_of) = number_edges(&twins);
        let outgoing = fans(&positions, &tails, &twins)?;
        let mesh = Self { positions: Field::from_vec(positions), tails, twins, outgoing, edges, edge_of };
        debug_assert_eq!(mesh.validate(), Ok(()));
        Ok(mesh)
    }

    /// Checks every invariant of the connectivity, and that positions are finite; the reason where one is broken.
    /// [`TriMesh::new`] runs it in debug builds; after moving positions, run it in a `debug_assert_eq!`. O(F).
    pub fn validate(&self) -> Result<(), String> {
        let hold = |holds: bool, what: &dyn Fn() -> String| if holds { Ok(()) } else { Err(what()) };
        for h in self.halfedges() {
            if let Some(twin) = self.twin(h) {
                let opposite = self.tail(twin) == self.head(h) && self.head(twin) == self.tail(h);
                hold(self.twin(twin) == Some(h) && opposite, &|| format!("halfedge {h} and its twin {twin} disagree"))?;
            }
            let e = self.edge(h);
            let first = self.twin(h).map_or(h, |twin| twin.min(h));
            hold(self.halfedge(e) == first, &|| format!("halfedge {h} does not belong to its edge {e}"))?;
        }
        let mut degree = Field::<VertexId, usize>::filled(self.vertex_count(), 0);
        let mut boundary = Field::<VertexId, bool>::filled(self.vertex_count(), false);
        for h in self.halfedges() {
            degree[self.tail(h)] += 1;
            boundary[self.tail(h)] |= self.twin(h).is_none();
        }
        for v in self.vertices() {
            // The first one and the end of the walk bound the count, so a broken fan cannot walk for ever.
            let fan = self.outgoing(v).take(degree[v] + 1).filter(|&h| self.tail(h) == v).count();
            hold(fan == degree[v] && fan > 0, &|| format!("vertex {v} has {} faces, its fan {fan}", degree[v]))?;
            hold(self.is_boundary_vertex(v) == boundary[v], &|| format!("the fan of vertex {v} starts inside"))?;
            hold(self.position(v).iter().all(|it| it.is_finite()), &|| format!("vertex {v} is not at a finite place"))?;
        }
        Ok(())
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }
    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.tails.len() / 3
    }
    /// Number of edges.
    pub fn edge_count(&self) -> usize {
        self.edges.len()
    }
    /// Number of halfedges, three per face.
    pub fn halfedge_count(&self) -> usize {
        self.tails.len()
    }
    /// All vertices.
    pub fn vertices(&self) -> impl ExactSizeIterator<Item = VertexId> + Clone + use<> {
        (0..self.vertex_count() as u32).map(VertexId)
    }
    /// All faces.
    pub fn faces(&self) -> impl ExactSizeIterator<Item = FaceId> + Clone + use<> {
        (0..self.face_count() as u32).map(FaceId)
    }
    /// All halfedges.
    pub fn halfedges(&self) -> impl ExactSizeIterator<Item = HalfedgeId> + Clone + use<> {
        (0..self.halfedge_count() as u32).map(HalfedgeId)
    }
    /// All edges.
    pub fn edges(&self) -> impl ExactSizeIterator<Item = EdgeId> + Clone + use<> {
        (0..self.edge_count() as u32).map(EdgeId)
    }

    /// The next halfedge of the same face, counter-clockwise.
    pub fn next(&self, h: HalfedgeId) -> HalfedgeId {
        HalfedgeId(if h.0 % 3 == 2 { h.0 - 2 } else { h.0 + 1 })
    }
    /// The previous halfedge of the same face.
    pub fn previous(&self, h: HalfedgeId) -> HalfedgeId {
        HalfedgeId(if h.0.is_multiple_of(3) { h.0 + 2 } else { h.0 - 1 })
    }
    /// The opposite halfedge, or `None` on the boundary.
    pub fn twin(&self, h: HalfedgeId) -> Option<HalfedgeId> {
        let twin = self.twins[h.index()];
        (twin != NONE).then_some(HalfedgeId(twin))
    }
    /// Where the halfedge starts.
    pub fn tail(&self, h: HalfedgeId) -> VertexId {
        self.tails[h.index()]
    }
    /// Where the halfedge ends.
    pub fn head(&self, h: HalfedgeId) -> VertexId {
        self.tails[self.next(h).index()]
    }
    /// The face of a halfedge.
    pub fn face(&self, h: HalfedgeId) -> FaceId {
        FaceId(h.0 / 3)
    }
    /// The undirected edge of a halfedge.
    pub fn edge(&self, h: HalfedgeId) -> EdgeId {
        self.edge_of[h.index()]
    }
    /// One halfedge of an edge (the one with the smaller id).
    pub fn halfedge(&self, e: EdgeId) -> HalfedgeId {
        self.edges[e]
    }
    /// The three halfedges of a face.
    pub fn face_halfedges(&self, f: FaceId) -> [HalfedgeId; 3] {
        [HalfedgeId(3 * f.0), HalfedgeId(3 * f.0 + 1), HalfedgeId(3 * f.0 + 2)]
    }
    /// The three vertices of a face, counter-clockwise.
    pub fn face_vertices(&self, f: FaceId) -> [VertexId; 3] {
        self.face_halfedges(f).map(|h| self.tail(h))
    }
    /// The two vertices of an edge, tail then head of [`TriMesh::halfedge`].
    pub fn edge_vertices(&self, e: EdgeId) -> [VertexId; 2] {
        let h = self.halfedge(e);
        [self.tail(h), self.head(h)]
    }
    /// All faces as index triples.
    pub fn face_indices(&self) -> Vec<[u32; 3]> {
        self.tails.chunks_exact(3).map(|c| [c[0].0, c[1].0, c[2].0]).collect()
    }
    /// Outgoing halfedges of a vertex, counter-clockwise. On the boundary the first is the boundary halfedge that leaves
    /// the vertex, so every face of the star comes once.
    pub fn outgoing(&self, v: VertexId) -> impl Iterator<Item = HalfedgeId> + '_ {
        let first = self.outgoing[v];
        let mut at = Some(first);
        std::iter::from_fn(move || {
            let here = at?;
            at = self.twin(self.previous(here)).filter(|&h| h != first);
            Some(here)
        })
    }
    /// Neighbouring vertices, counter-clockwise; on the boundary both boundary neighbours are included (first and last).
    pub fn neighbors(&self, v: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        self.outgoing(v).flat_map(move |h| {
            let back = self.previous(h);
            let last = self.twin(back).is_none().then(|| self.tail(back));
            std::iter::once(self.head(h)).chain(last)
        })
    }
    /// Number of faces around a vertex.
    pub fn face_degree(&self, v: VertexId) -> usize {
        self.outgoing(v).count()
    }
    /// Whether a vertex lies on the boundary.
    pub fn is_boundary_vertex(&self, v: VertexId) -> bool {
        self.twin(self.outgoing[v]).is_none()
    }
    /// Whether an edge lies on the boundary.
    pub fn is_boundary_edge(&self, e: EdgeId) -> bool {
        self.twin(self.halfedge(e)).is_none()
    }
    /// The halfedge from `a` to `b`, if there is one.
    pub fn find_halfedge(&self, a: VertexId, b: VertexId) -> Option<HalfedgeId> {
        self.outgoing(a).find(|&h| self.head(h) == b)
    }
    /// Boundary loops as halfedges in the order of travel with the surface on the left; each starts at its smallest
    /// halfedge, loops sorted by that.
    pub fn boundary_loops(&self) -> Vec<Vec<HalfedgeId>> {
        let mut seen = vec![false; self.halfedge_count()];
        let mut loops = Vec::new();
        for start in self.halfedges() {
            if self.twin(start).is_some() || seen[start.index()] {
                continue;
            }
            let mut path = Vec::new();
            let mut at = start;
            loop {
                seen[at.index()] = true;
                path.push(at);
                at = self.outgoing[self.head(at)];
                if at == start {
                    break;
                }
            }
            loops.push(path);
        }
        loops
    }
    /// Connected component of every face, numbered from 0 in the order of their smallest face, and their number.
    pub fn components(&self) -> (Field<FaceId, u32>, usize) {
        let mut component = Field::filled(self.face_count(), NONE);
        let mut count = 0;
        let mut stack = Vec::new();
        for seed in self.faces() {
            if component[seed] != NONE {
                continue;
            }
            component[seed] = count;
            stack.push(seed);
            while let Some(f) = stack.pop() {
                for twin in self.face_halfedges(f).into_iter().filter_map(|h| self.twin(h)) {
                    let g = self.face(twin);
                    if component[g] == NONE {
                        component[g] = count;
                        stack.push(g);
                    }
                }
            }
            count += 1;
        }
        (component, count as usize)
    }
    /// V − E + F.
    pub fn euler_characteristic(&self) -> i64 {
        self.vertex_count() as i64 - self.edge_count() as i64 + self.face_count() as i64
    }
    /// Sum of the genera of all components: (2 C − B − χ) / 2 for C components and B boundary loops.
    pub fn genus(&self) -> usize {
        let (_, components) = self.components();
        let doubled = 2 * components as i64 - self.boundary_loops().len() as i64 - self.euler_characteristic();
        usize::try_from(doubled / 2).expect("an oriented manifold has a genus of at least 0")
    }

    /// All positions.
    pub fn positions(&self) -> &Field<VertexId, Vec3> {
        &self.positions
    }
    /// All positions, to be moved.
    pub fn positions_mut(&mut self) -> &mut Field<VertexId, Vec3> {
        &mut self.positions
    }
    /// Position of a vertex.
    pub fn position(&self, v: VertexId) -> Vec3 {
        self.positions[v]
    }
    /// The same connectivity at other positions.
    pub fn with_positions(&self, positions: Field<VertexId, Vec3>) -> Self {
        assert_eq!(positions.len(), self.vertex_count(), "one position per vertex");
        Self { positions, ..self.clone() }
    }
    /// Corner positions of a face.
    pub fn face_positions(&self, f: FaceId) -> [Vec3; 3] {
        self.face_vertices(f).map(|v| self.positions[v])
    }
    /// Twice the area vector of a face: its normal times twice its area.
    pub fn area_vector(&self, f: FaceId) -> Vec3 {
        let [a, b, c] = self.face_positions(f);
        (b - a).cross(&(c - a))
    }
    /// Area of a face, mm².
    pub fn area(&self, f: FaceId) -> f64 {
        0.5 * self.area_vector(f).norm()
    }
    /// Unit normal of a face; zero for a face that has become degenerate.
    pub fn normal(&self, f: FaceId) -> Vec3 {
        self.area_vector(f).try_normalize(0.0).unwrap_or_else(Vec3::zeros)
    }
    /// Vector along a halfedge.
    pub fn vector(&self, h: HalfedgeId) -> Vec3 {
        self.positions[self.head(h)] - self.positions[self.tail(h)]
    }
    /// Length of an edge, mm.
    pub fn edge_length(&self, e: EdgeId) -> f64 {
        self.vector(self.halfedge(e)).norm()
    }
    /// Interior angle at the tail of `h` in its face, radians.
    pub fn corner_angle(&self, h: HalfedgeId) -> f64 {
        angle_between(self.vector(h), -self.vector(self.previous(h)))
    }
    /// Cotangent of the angle opposite `h` in its face.
    pub fn cotangent(&self, h: HalfedgeId) -> f64 {
        // Both edges seen from the corner opposite `h`.
        let (a, b) = (-self.vector(self.next(h)), self.vector(self.previous(h)));
        a.dot(&b) / a.cross(&b).norm()
    }
    /// Angle defect: 2π (interior) or π (boundary) minus the sum of the corner angles.
    pub fn angle_defect(&self, v: VertexId) -> f64 {
        let full = if self.is_boundary_vertex(v) { std::f64::consts::PI } else { std::f64::consts::TAU };
        full - self.outgoing(v).map(|h| self.corner_angle(h)).sum::<f64>()
    }
    /// Cosine between the normals of the two faces of an edge; `None` on the boundary.
    pub fn dihedral_cosine(&self, e: EdgeId) -> Option<f64> {
        let h = self.halfedge(e);
        let twin = self.twin(h)?;
        Some(self.normal(self.face(h)).dot(&self.normal(self.face(twin))))
    }
    /// Bounding box.
    pub fn bounds(&self) -> Box3 {
        Box3::of(self.positions.iter())
    }
    /// Total area, mm².
    pub fn total_area(&self) -> f64 {
        self.faces().map(|f| self.area(f)).sum()
    }
    /// Mean edge length, mm.
    pub fn mean_edge_length(&self) -> f64 {
        self.edges().map(|e| self.edge_length(e)).sum::<f64>() / self.edge_count() as f64
    }
}

/// Indices in range, positions finite, no unreferenced vertex, no repeated corner.
fn check_arrays(positions: &[Vec3], faces: &[[u32; 3]]) -> Result<(), MeshError> {
    if faces.is_empty() {
        return Err(MeshError::Empty);
    }
    if faces.len() > TriMesh::LIMIT {
        return Err(MeshError::TooLarge { faces: faces.len(), limit: TriMesh::LIMIT });
    }
    if let Some((vertex, &position)) = positions.iter().enumerate().find(|(_, p)| !p.iter().all(|c| c.is_finite())) {
        return Err(MeshError::NotFinite { vertex, position });
    }
    let mut used = vec![false; positions.len()];
    for (face, corners) in faces.iter().enumerate() {
        for &index in corners {
            let Some(slot) = used.get_mut(index as usize) else {
                return Err(MeshError::IndexOutOfRange { face, index, vertices: positions.len() });
            };
            *slot = true;
        }
        let [a, b, c] = *corners;
        if a == b || b == c || c == a {
            return Err(MeshError::DegenerateFace { face, corners: *corners, place: positions[a as usize] });
        }
    }
    match used.iter().position(|&it| !it) {
        Some(vertex) => Err(MeshError::Unreferenced { vertex }),
        None => Ok(()),
    }
}

/// Whether a triangle has no area to the accuracy at which angles and normals can be computed.
pub(super) fn is_degenerate([a, b, c]: [Vec3; 3]) -> bool {
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    let doubled = (b - a).cross(&(c - a)).norm();
    doubled <= DEGENERATE * longest || doubled.is_nan()
}

/// The undirected edge (smaller vertex first) and the id of every halfedge, sorted. `tails` holds three vertices per face.
pub(super) fn sorted_edges(tails: &[u32]) -> Vec<([u32; 2], u32)> {
    let edge = |h: usize| {
        let (a, b) = (tails[h], tails[if h % 3 == 2 { h - 2 } else { h + 1 }]);
        ([a.min(b), a.max(b)], h as u32)
    };
    let mut edges: Vec<_> = (0..tails.len()).map(edge).collect();
    edges.sort_unstable();
    edges
}

/// Twin of every halfedge, by sorting on the undirected edge.
fn pair_halfedges(positions: &[Vec3], faces: &[[u32; 3]]) -> Result<Vec<u32>, MeshError> {
    let tails = faces.as_flattened();
    let mut twins = vec![NONE; tails.len()];
    for run in sorted_edges(tails).chunk_by(|x, y| x.0 == y.0) {
        match *run {
            [_] => {}
            [(_, g), (_, h)] if tails[g as usize] != tails[h as usize] => {
                twins[g as usize] = h;
                twins[h as usize] = g;
            }
            _ => {
                let edge = run[0].0;
                return Err(MeshError::NonManifoldEdge {
                    edge,
                    faces: run.iter().map(|it| it.1 as usize / 3).collect(),
                    place: (positions[edge[0] as usize] + positions[edge[1] as usize]) / 2.0,
                });
            }
        }
    }
    Ok(twins)
}

/// Edges in the order of their smaller halfedge.
fn number_edges(twins: &[u32]) -> (Field<EdgeId, HalfedgeId>, Vec<EdgeId>) {
    let mut edges = Vec::with_capacity(twins.len() / 2 + 1);
    let mut edge_of = vec![EdgeId(NONE); twins.len()];
    for (h, &twin) in twins.iter().enumerate() {
        if twin == NONE || h < twin as usize {
            let id = EdgeId::new(edges.len());
            edges.push(HalfedgeId::new(h));
            edge_of[h] = id;
            if twin != NONE {
                edge_of[twin as usize] = id;
            }
        }
    }
    (Field::from_vec(edges), edge_of)
}

/// One outgoing halfedge per vertex, the boundary one on the boundary; refuses vertices with several fans.
fn fans(positions: &[Vec3], tails: &[VertexId], twins: &[u32]) -> Result<Field<VertexId, HalfedgeId>, MeshError> {
    let mut outgoing = Field::<VertexId, _>::filled(positions.len(), HalfedgeId(NONE));
    let mut degree = vec![0_usize; positions.len()];
    for (h, &tail) in tails.iter().enumerate() {
        degree[tail.index()] += 1;
        if outgoing[tail].0 == NONE || (twins[h] == NONE && twins[outgoing[tail].index()] != NONE) {
            outgoing[tail] = HalfedgeId::new(h);
        }
    }
    for (v, &HalfedgeId(first)) in outgoing.enumerate() {
        let around = |&h: &u32| Some(twins[if h.is_multiple_of(3) { h + 2 } else { h - 1 } as usize]);
        let fan = std::iter::successors(Some(first), |h| around(h).filter(|&it| it != NONE && it != first)).count();
        if fan != degree[v.index()] {
            return Err(MeshError::NonManifoldVertex { vertex: v.index(), place: positions[v.index()] });
        }
    }
    Ok(outgoing)
}

#[cfg(test)]
mod tests;
