//! A triangle mesh whose connectivity changes: collapse, split, flip.
//!
//! The same layout as [`TriMesh`] (halfedge `3 f + k` runs from corner `k` to corner `k + 1` of face `f`), so stepping is
//! arithmetic. Removed faces and vertices leave holes in the numbering until [`EditMesh::finish`]; ids of what stays
//! never change, and new elements are appended.
use crate::{
    geom::Vec3,
    mesh::{FaceId, HalfedgeId, Id, MeshError, TriMesh, VertexId},
};

/// No halfedge or vertex: the halfedge has no twin, or the element was removed.
const NONE: u32 = u32::MAX;

/// An oriented manifold triangle mesh that stays one through every edit, as long as [`EditMesh::can_collapse`] and
/// [`EditMesh::can_flip`] are asked first. Edges can carry a mark (for creases), which edits carry along.
#[derive(Debug, Clone)]
pub struct EditMesh {
    positions: Vec<Vec3>,
    /// Tail of every halfedge; `NONE` in removed faces.
    tails: Vec<u32>,
    twins: Vec<u32>,
    /// Per halfedge, equal on both sides of an edge.
    marks: Vec<bool>,
    /// One outgoing halfedge per vertex, the boundary one on the boundary; `NONE` for removed vertices.
    outgoing: Vec<u32>,
    vertices: usize,
    faces: usize,
    /// When a vertex was last seen by a link test.
    seen: Vec<u32>,
    stamp: u32,
}

impl EditMesh {
    /// A copy of `mesh` without marks.
    pub fn new(mesh: &TriMesh) -> Self {
        let index = |h: Option<HalfedgeId>| h.map_or(NONE, |h| h.0);
        Self {
            positions: mesh.positions().as_slice().to_vec(),
            tails: mesh.halfedges().map(|h| mesh.tail(h).0).collect(),
            twins: mesh.halfedges().map(|h| index(mesh.twin(h))).collect(),
            marks: vec![false; mesh.halfedge_count()],
            outgoing: mesh.vertices().map(|v| index(mesh.outgoing(v).next())).collect(),
            vertices: mesh.vertex_count(),
            faces: mesh.face_count(),
            seen: vec![0; mesh.vertex_count()],
            stamp: 0,
        }
    }

    /// The mesh without the holes in its numbering; vertices and faces keep their order. Fails if a face is degenerate.
    pub fn finish(&self) -> Result<TriMesh, MeshError> {
        let mut renumbered = vec![NONE; self.positions.len()];
        let mut positions = Vec::with_capacity(self.vertices);
        for v in self.vertices() {
            renumbered[v.index()] = positions.len() as u32;
            positions.push(self.position(v));
        }
        let faces: Vec<_> = self.faces().map(|f| self.face_vertices(f).map(|v| renumbered[v.index()])).collect();
        TriMesh::new(positions, &faces)
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertices
    }
    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.faces
    }
    /// Vertex ids are below this: the size of an array beside the mesh.
    pub fn vertex_capacity(&self) -> usize {
        self.positions.len()
    }
    /// Halfedge ids are below this; face ids below a third of it.
    pub fn halfedge_capacity(&self) -> usize {
        self.tails.len()
    }
    /// All vertices, ascending.
    pub fn vertices(&self) -> impl Iterator<Item = VertexId> + '_ {
        (0..self.outgoing.len()).filter(|&v| self.outgoing[v] != NONE).map(VertexId::new)
    }
    /// All faces, ascending.
    pub fn faces(&self) -> impl Iterator<Item = FaceId> + '_ {
        (0..self.tails.len() / 3).filter(|&f| self.tails[3 * f] != NONE).map(FaceId::new)
    }
    /// One halfedge per edge, ascending: the one that [`EditMesh::edge`] names.
    pub fn edges(&self) -> impl Iterator<Item = HalfedgeId> + '_ {
        (0..self.tails.len()).map(HalfedgeId::new).filter(|&h| self.is_alive(h) && self.edge(h) == h)
    }
    /// Whether the face of a halfedge still exists.
    pub fn is_alive(&self, h: HalfedgeId) -> bool {
        self.tails[h.index()] != NONE
    }
    /// The halfedge that stands for the edge of `h`: the smaller of the two.
    pub fn edge(&self, h: HalfedgeId) -> HalfedgeId {
        HalfedgeId(h.0.min(self.twins[h.index()]))
    }

    /// The next halfedge of the same face.
    pub fn next(&self, h: HalfedgeId) -> HalfedgeId {
        HalfedgeId(if h.0 % 3 == 2 { h.0 - 2 } else { h.0 + 1 })
    }
    /// The previous halfedge of the same face.
    pub fn previous(&self, h: HalfedgeId) -> HalfedgeId {
        HalfedgeId(if h.0.is_multiple_of(3) { h.0 + 2 } else { h.0 - 1 })
    }
    /// The opposite halfedge, or `None` on the boundary.
    pub fn twin(&self, h: HalfedgeId) -> Option<HalfedgeId> {
        id(self.twins[h.index()])
    }
    /// Where the halfedge starts.
    pub fn tail(&self, h: HalfedgeId) -> VertexId {
        VertexId(self.tails[h.index()])
    }
    /// Where the halfedge ends.
    pub fn head(&self, h: HalfedgeId) -> VertexId {
        self.tail(self.next(h))
    }
    /// The vertex opposite the halfedge in its face.
    pub fn apex(&self, h: HalfedgeId) -> VertexId {
        self.tail(self.previous(h))
    }
    /// The face of a halfedge.
    pub fn face(&self, h: HalfedgeId) -> FaceId {
        FaceId(h.0 / 3)
    }
    /// The vertices of a face, counter-clockwise.
    pub fn face_vertices(&self, f: FaceId) -> [VertexId; 3] {
        [0, 1, 2].map(|k| VertexId(self.tails[3 * f.index() + k]))
    }
    /// Corner positions of a face.
    pub fn face_positions(&self, f: FaceId) -> [Vec3; 3] {
        self.face_vertices(f).map(|v| self.position(v))
    }
    /// Position of a vertex.
    pub fn position(&self, v: VertexId) -> Vec3 {
        self.positions[v.index()]
    }
    /// Moves a vertex.
    pub fn set_position(&mut self, v: VertexId, position: Vec3) {
        self.positions[v.index()] = position;
    }
    /// Vector along a halfedge.
    pub fn vector(&self, h: HalfedgeId) -> Vec3 {
        self.position(self.head(h)) - self.position(self.tail(h))
    }
    /// Normal of a face times twice its area.
    pub fn area_vector(&self, f: FaceId) -> Vec3 {
        let [a, b, c] = self.face_positions(f);
        (b - a).cross(&(c - a))
    }
    /// Whether a vertex lies on the boundary.
    pub fn is_boundary_vertex(&self, v: VertexId) -> bool {
        self.twins[self.outgoing[v.index()] as usize] == NONE
    }
    /// Whether the edge of `h` is marked.
    pub fn is_marked(&self, h: HalfedgeId) -> bool {
        self.marks[h.index()]
    }
    /// Marks the edge of `h`, or not.
    pub fn set_mark(&mut self, h: HalfedgeId, mark: bool) {
        self.marks[h.index()] = mark;
        if let Some(t) = self.twin(h) {
            self.marks[t.index()] = mark;
        }
    }
    /// Outgoing halfedges of a vertex, counter-clockwise; on the boundary the boundary halfedge comes first.
    pub fn outgoing(&self, v: VertexId) -> impl Iterator<Item = HalfedgeId> + '_ {
        let first = HalfedgeId(self.outgoing[v.index()]);
        let mut at = Some(first);
        std::iter::from_fn(move || {
            let here = at?;
            at = self.twin(self.previous(here)).filter(|&h| h != first);
            Some(here)
        })
    }
    /// One halfedge per edge at a vertex, counter-clockwise: outgoing, except for the last one of a boundary vertex, which
    /// only has an incoming halfedge.
    pub fn spokes(&self, v: VertexId) -> impl Iterator<Item = HalfedgeId> + '_ {
        self.outgoing(v).flat_map(move |h| {
            let back = self.previous(h);
            std::iter::once(h).chain(self.twin(back).is_none().then_some(back))
        })
    }
    /// The end of the edge of `h` that is not `v`.
    pub fn other_end(&self, h: HalfedgeId, v: VertexId) -> VertexId {
        if self.tail(h) == v { self.head(h) } else { self.tail(h) }
    }
    /// Neighbouring vertices, counter-clockwise.
    pub fn neighbors(&self, v: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        self.spokes(v).map(move |h| self.other_end(h, v))
    }
    /// Number of edges at a vertex.
    pub fn valence(&self, v: VertexId) -> usize {
        self.spokes(v).count()
    }

    /// Whether collapsing the edge of `h` keeps the surface a manifold of the same topology: the link condition
    /// Lk(u) ∩ Lk(v) = Lk(uv) of Dey, Edelsbrunner, Guha, Nekhayev 1999, with all boundary edges joined to one imagined
    /// vertex.
    pub fn can_collapse(&mut self, h: HalfedgeId) -> bool {
        let (u, v) = (self.tail(h), self.head(h));
        let twin = self.twin(h);
        if twin.is_some() && self.is_boundary_vertex(u) && self.is_boundary_vertex(v) {
            return false;
        }
        // The apexes lose a face; they must keep a disk or a half disk.
        for side in [Some(h), twin].into_iter().flatten() {
            let apex = self.apex(side);
            let faces = self.outgoing(apex).take(4).count();
            if faces < if self.is_boundary_vertex(apex) { 2 } else { 4 } {
                return false;
            }
        }
        self.stamp += 1;
        let mut at = Some(HalfedgeId(self.outgoing[u.index()]));
        while let Some(out) = at {
            let (head, apex) = (self.head(out), self.apex(out));
            self.seen[head.index()] = self.stamp;
            self.seen[apex.index()] = self.stamp;
            at = self.twin(self.previous(out)).filter(|h| h.0 != self.outgoing[u.index()]);
        }
        let common = self.neighbors(v).filter(|w| self.seen[w.index()] == self.stamp).count();
        common == if twin.is_some() { 2 } else { 1 }
    }

    /// Collapses the edge of `h`: its tail is removed, its head moves to `position`; so do the one or two faces along it.
    /// Marks of the edges that become one are joined. [`EditMesh::can_collapse`] must hold.
    pub fn collapse(&mut self, h: HalfedgeId, position: Vec3) {
        let (u, v) = (self.tail(h), self.head(h));
        let twin = self.twin(h);
        let own: Vec<u32> = self.outgoing(u).map(|h| h.0).collect();
        for out in own {
            self.tails[out as usize] = v.0;
        }
        self.positions[v.index()] = position;
        self.outgoing[u.index()] = NONE;
        self.vertices -= 1;
        let mut apexes = [None; 2];
        for (side, apex_slot) in [Some(h), twin].into_iter().zip(&mut apexes) {
            let Some(h) = side else { continue };
            let (n, p) = (self.next(h), self.previous(h));
            let apex = self.tail(p);
            // The outer halfedges, apex → v and v → apex: they become the two sides of one edge.
            let (x, y) = (self.twin(n), self.twin(p));
            let mark = self.marks[n.index()] || self.marks[p.index()];
            for (one, other) in [(x, y), (y, x)] {
                if let Some(one) = one {
                    self.twins[one.index()] = other.map_or(NONE, |it| it.0);
                    self.marks[one.index()] = mark;
                }
            }
            if let Some(start) = x.or(y) {
                let (tail, head) = if x.is_some() { (apex, v) } else { (v, apex) };
                self.outgoing[tail.index()] = start.0;
                self.outgoing[head.index()] = self.next(start).0;
            }
            for dead in [h, n, p] {
                self.tails[dead.index()] = NONE;
            }
            self.faces -= 1;
            *apex_slot = Some(apex);
        }
        for vertex in apexes.into_iter().flatten().chain([v]) {
            self.boundary_first(vertex);
        }
    }

    /// Takes back the collapse of the inner edge of `h`, whose tail was `u`, and puts `u` at `position`: the vertex split of a
    /// progressive mesh (Hoppe 1996). Only the latest collapse that has not been taken back may be, and no other edit may
    /// have come after it; marks that the collapse joined stay joined.
    pub fn undo_collapse(&mut self, h: HalfedgeId, u: VertexId, position: Vec3) {
        let t = HalfedgeId(self.twins[h.index()]);
        // The inner halfedges of dead faces still know their twins: apex → v, v → apex on the side of h, and on that of t.
        let [n, p, tn, tp] = [self.next(h), self.previous(h), self.next(t), self.previous(t)];
        let outer = |it: HalfedgeId| HalfedgeId(self.twins[it.index()]);
        let [x, y, tx, ty] = [n, p, tn, tp].map(outer);
        let (v, c, d) = (self.tail(y), self.tail(x), self.tail(tx));
        for (slot, tail) in [(h, u), (n, v), (p, c), (t, v), (tn, u), (tp, d)] {
            self.tails[slot.index()] = tail.0;
        }
        for (inner, outer) in [(n, x), (p, y), (tn, tx), (tp, ty)] {
            self.twins[outer.index()] = inner.0;
        }
        // The fan from c to d goes back to u.
        let mut at = y;
        while at != tn {
            self.tails[at.index()] = u.0;
            at = HalfedgeId(self.twins[self.previous(at).index()]);
        }
        for (vertex, out) in [(u, h), (v, t), (c, p), (d, tp)] {
            self.outgoing[vertex.index()] = out.0;
        }
        self.positions[u.index()] = position;
        self.vertices += 1;
        self.faces += 2;
    }

    /// Turns the outgoing halfedge of `v` clockwise to the boundary, if there is one.
    fn boundary_first(&mut self, v: VertexId) {
        let first = HalfedgeId(self.outgoing[v.index()]);
        let mut at = first;
        while let Some(twin) = self.twin(at) {
            at = self.next(twin);
            if at == first {
                break;
            }
        }
        self.outgoing[v.index()] = at.0;
    }

    /// Splits the edge of `h` by a new vertex at `position`, and the faces along it. Both halves keep the mark.
    pub fn split(&mut self, h: HalfedgeId, position: Vec3) -> VertexId {
        let middle = VertexId::new(self.positions.len());
        let mark = self.is_marked(h);
        self.positions.push(position);
        self.seen.push(0);
        self.vertices += 1;
        let near = self.cut_face(h, middle, false);
        let far = self.twin(h).map(|t| self.cut_face(t, middle, true));
        // Each side now has a halfedge to the middle and one away from it: `h` and `near`, `far` and the twin.
        self.outgoing.push(near.0);
        if let Some(far) = far {
            self.pair(near, Some(far));
        }
        self.set_mark(near, mark);
        middle
    }

    /// Cuts the face of `h` from `middle` (on `h`) to its apex. `h` keeps the half at its tail, or at its head when `flip`.
    /// Returns the new halfedge for the other half, unpaired.
    fn cut_face(&mut self, h: HalfedgeId, middle: VertexId, flip: bool) -> HalfedgeId {
        let (n, p) = (self.next(h), self.previous(h));
        let (a, b, c) = (self.tail(h), self.tail(n), self.tail(p));
        let base = self.tails.len() as u32;
        let [h2, n2, p2] = [base, base + 1, base + 2].map(HalfedgeId);
        let corners = if flip { [a, middle, c] } else { [middle, b, c] };
        self.tails.extend(corners.map(|v| v.0));
        self.twins.extend([NONE; 3]);
        self.marks.extend([false; 3]);
        self.faces += 1;
        if flip {
            // Old: middle, b, c. New: a, middle, c; takes over the outer edge c–a.
            self.tails[h.index()] = middle.0;
            self.pair(p2, self.twin(p));
            self.marks[p2.index()] = self.marks[p.index()];
            self.pair(p, Some(n2));
            self.marks[p.index()] = false;
            if self.outgoing[a.index()] == h.0 {
                self.outgoing[a.index()] = h2.0;
            }
            if self.outgoing[c.index()] == p.0 {
                self.outgoing[c.index()] = p2.0;
            }
        } else {
            // Old: a, middle, c. New: middle, b, c; takes over the outer edge b–c.
            self.tails[n.index()] = middle.0;
            self.pair(n2, self.twin(n));
            self.marks[n2.index()] = self.marks[n.index()];
            self.pair(n, Some(p2));
            self.marks[n.index()] = false;
            if self.outgoing[b.index()] == n.0 {
                self.outgoing[b.index()] = n2.0;
            }
        }
        h2
    }

    fn pair(&mut self, h: HalfedgeId, twin: Option<HalfedgeId>) {
        self.twins[h.index()] = twin.map_or(NONE, |t| t.0);
        if let Some(t) = twin {
            self.twins[t.index()] = h.0;
        }
    }

    /// Whether the edge of `h` can be turned within its two faces: not on the boundary, not marked, its ends keep valence
    /// 3 (2 on the boundary), and its apexes are not joined already.
    pub fn can_flip(&self, h: HalfedgeId) -> bool {
        let Some(t) = self.twin(h) else { return false };
        let spare = |v| self.valence(v) > if self.is_boundary_vertex(v) { 2 } else { 3 };
        let (c, d) = (self.apex(h), self.apex(t));
        !self.is_marked(h) && c != d && spare(self.tail(h)) && spare(self.head(h)) && self.neighbors(c).all(|w| w != d)
    }

    /// Turns the edge of `h` so that it joins the apexes of its two faces. [`EditMesh::can_flip`] must hold.
    pub fn flip(&mut self, h: HalfedgeId) {
        let Some(t) = self.twin(h) else { return };
        let (n, p, tn, tp) = (self.next(h), self.previous(h), self.next(t), self.previous(t));
        let (a, b, c, d) = (self.tail(h), self.tail(t), self.tail(p), self.tail(tp));
        let outer = [n, p, tn, tp].map(|h| (self.twin(h), self.marks[h.index()]));
        // Faces a b c and b a d become d c a (in the slots of h) and c d b (in those of t).
        for (slot, tail) in [(h, d), (n, c), (p, a), (t, c), (tn, d), (tp, b)] {
            self.tails[slot.index()] = tail.0;
        }
        for (slot, (twin, mark)) in [tp, n, p, tn].into_iter().zip(outer) {
            self.pair(slot, twin);
            self.marks[slot.index()] = mark;
        }
        self.marks[h.index()] = false;
        self.marks[t.index()] = false;
        // Halfedges that left a, b, c, d inside the two faces have moved.
        for (v, inside) in [(a, p), (b, tp), (c, n), (d, tn)] {
            let first = HalfedgeId(self.outgoing[v.index()]);
            if [h, n, p, t, tn, tp].contains(&first) {
                self.outgoing[v.index()] = inside.0;
                self.boundary_first(v);
            }
        }
    }

    /// Checks every invariant, for tests and debug builds. O(F).
    ///
    /// # Panics
    /// If one does not hold.
    pub fn validate(&self) {
        let mut degree = vec![0; self.positions.len()];
        for f in self.faces() {
            for h in [0, 1, 2].map(|k| HalfedgeId(3 * f.0 + k)) {
                let (u, v) = (self.tail(h), self.head(h));
                assert!(u != v && self.outgoing[u.index()] != NONE, "face {f}: corner {u}");
                degree[u.index()] += 1;
                if let Some(t) = self.twin(h) {
                    assert!(self.is_alive(t), "halfedge {h} has a removed twin");
                    assert!(self.twin(t) == Some(h) && (self.tail(t), self.head(t)) == (v, u), "twins {h}, {t}");
                    assert!(self.marks[h.index()] == self.marks[t.index()], "marks of {h}, {t}");
                }
            }
        }
        for v in self.vertices() {
            assert!(self.outgoing(v).all(|h| self.is_alive(h) && self.tail(h) == v), "star of {v}");
            assert_eq!(self.outgoing(v).count(), degree[v.index()], "vertex {v} has one fan");
            let boundary = self.outgoing(v).any(|h| self.twin(h).is_none());
            assert_eq!(boundary, self.is_boundary_vertex(v), "the boundary halfedge of {v} comes first");
        }
        assert_eq!((self.vertices().count(), self.faces().count()), (self.vertices, self.faces));
    }
}

fn id(h: u32) -> Option<HalfedgeId> {
    (h != NONE).then_some(HalfedgeId(h))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn fixtures() -> Vec<TriMesh> {
        vec![
            shapes::icosphere(10.0, 2),
            shapes::torus(10.0, 4.0, 16, 8),
            shapes::perforated_plate(2, 5.0, 2),
            shapes::cylinder(5.0, 20.0, 12, 6),
            shapes::annulus(3.0, 9.0, 12, 3),
            shapes::grid(6, 5, 2.0),
        ]
    }

    fn topology(mesh: &TriMesh) -> (i64, usize, usize) {
        (mesh.euler_characteristic(), mesh.boundary_loops().len(), mesh.components().1)
    }

    struct Dice(u64);
    impl Dice {
        fn below(&mut self, n: usize) -> usize {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) as usize % n
        }
    }

    /// Moves every vertex off the others, so that `TriMesh::new` judges the connectivity alone.
    fn spread(mesh: &mut EditMesh) {
        for v in 0..mesh.vertex_capacity() {
            let t = v as f64;
            mesh.positions[v] = Vec3::new(t.sin(), (1.7 * t).cos(), (0.3 * t * t).sin()) * 10.0;
        }
    }

    #[test]
    fn random_edits_keep_every_invariant_and_the_topology() {
        for (seed, mesh) in fixtures().iter().enumerate() {
            let mut edited = EditMesh::new(mesh);
            edited.validate();
            assert_eq!(&edited.finish().unwrap(), mesh);
            let mut dice = Dice(seed as u64);
            let mut done = [0; 3];
            for round in 0..3000 {
                let h = HalfedgeId::new(dice.below(edited.halfedge_capacity()));
                if !edited.is_alive(h) {
                    continue;
                }
                let kind = dice.below(if round < 1500 { 3 } else { 5 });
                match kind {
                    0 => {
                        let middle = (edited.position(edited.tail(h)) + edited.position(edited.head(h))) / 2.0;
                        edited.split(h, middle);
                    }
                    1 if edited.can_flip(h) => edited.flip(h),
                    2.. if edited.can_collapse(h) => edited.collapse(h, Vec3::zeros()),
                    _ => continue,
                }
                done[kind.min(2)] += 1;
                if round % 16 == 0 {
                    edited.validate();
                }
            }
            assert!(done.iter().all(|&it| it > 100), "{done:?}");
            edited.validate();
            spread(&mut edited);
            assert_eq!(topology(&edited.finish().unwrap()), topology(mesh));
        }
    }

    #[test]
    fn collapsing_until_nothing_goes_leaves_the_smallest_surface_of_the_topology() {
        for (mesh, faces) in fixtures().iter().zip([4, 14, 0, 0, 0, 1]) {
            let mut edited = EditMesh::new(mesh);
            loop {
                let open: Vec<_> = edited.edges().collect();
                let before = edited.face_count();
                for h in open {
                    if edited.is_alive(h) && edited.can_collapse(h) {
                        edited.collapse(h, Vec3::zeros());
                    }
                }
                if edited.face_count() == before {
                    break;
                }
            }
            edited.validate();
            spread(&mut edited);
            let small = edited.finish().unwrap();
            assert_eq!(topology(&small), topology(mesh));
            // A sphere ends as a tetrahedron, a disk as a triangle; others may get stuck above their smallest number.
            assert!(if faces == 4 || faces == 1 { small.face_count() == faces } else { small.face_count() < 60 });
        }
    }

    #[test]
    fn marks_follow_their_edges() {
        let mesh = shapes::cuboid(Vec3::new(4.0, 6.0, 8.0), 3);
        let mut edited = EditMesh::new(&mesh);
        let creased = |edited: &EditMesh, h: HalfedgeId| {
            let Some(t) = edited.twin(h) else { return false };
            let normal = |h| edited.area_vector(edited.face(h)).normalize();
            normal(h).dot(&normal(t)) < 0.5
        };
        for h in edited.edges().collect::<Vec<_>>() {
            let mark = creased(&edited, h);
            edited.set_mark(h, mark);
        }
        let mut dice = Dice(7);
        let mut edits = 0;
        for _ in 0..2000 {
            let h = HalfedgeId::new(dice.below(edited.halfedge_capacity()));
            if !edited.is_alive(h) {
                continue;
            }
            let (u, v) = (edited.tail(h), edited.head(h));
            let flat = edited.spokes(u).all(|s| !edited.is_marked(s));
            match dice.below(3) {
                0 => {
                    edited.split(h, (edited.position(u) + edited.position(v)) / 2.0);
                }
                1 if edited.can_flip(h) => {
                    let [a, b, c, d] =
                        [u, v, edited.apex(h), edited.apex(edited.twin(h).unwrap())].map(|v| edited.position(v));
                    // Only where the quadrilateral is convex, so that the flat sides stay flat.
                    let n = (b - a).cross(&(c - a));
                    if (b - d).cross(&(c - d)).dot(&n) <= 1e-9 || (c - d).cross(&(a - d)).dot(&n) <= 1e-9 {
                        continue;
                    }
                    edited.flip(h);
                }
                2 if flat && edited.can_collapse(h) => {
                    let to = edited.position(v);
                    let guard = super::super::collapse::Guard { min_cosine: 0.9, min_quality: 0.05, min_fold: -1.0 };
                    if !guard.allows(&edited, h, to) {
                        continue;
                    }
                    edited.collapse(h, to);
                }
                _ => continue,
            }
            edits += 1;
        }
        assert!(edits > 300);
        edited.validate();
        for h in edited.edges() {
            let length = edited.vector(h).norm();
            assert_eq!(edited.is_marked(h), creased(&edited, h), "edge {h} of length {length}");
        }
        let marked: f64 = edited.edges().filter(|&h| edited.is_marked(h)).map(|h| edited.vector(h).norm()).sum();
        assert!((marked - 4.0 * 18.0).abs() < 1e-9, "{marked}");
    }
}
