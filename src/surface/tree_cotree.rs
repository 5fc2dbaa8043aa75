//! Integer 1-forms with prescribed sums around faces, boundary loops and handles, by a tree–cotree decomposition
//! (Eppstein 2003; seed 001, section 4.5).
//!
//! A 1-form has one value per edge, along [`TriMesh::halfedge`]. A *node* is a face or the cap that closes a boundary
//! loop; the sum around a node runs counter-clockwise as seen from outside, so that around a cap is minus that along the
//! loop with the surface on the left. The spanning tree of the vertices carries no integers; the edges in neither
//! tree nor cotree are the 2 g generators, each of which closes one loop through the tree.
use crate::mesh::{EdgeId, FaceId, Field, HalfedgeId, Id, TriMesh, VertexId};

const NONE: u32 = u32::MAX;

/// A face or a boundary loop (numbered as by [`TriMesh::boundary_loops`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Node {
    /// A face.
    Face(FaceId),
    /// A boundary loop.
    Loop(usize),
}

impl std::fmt::Display for Node {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Face(face) => write!(f, "face {face}"),
            Self::Loop(path) => write!(f, "boundary loop {path}"),
        }
    }
}

/// Why integers cannot be prescribed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum IndexError {
    /// No such face or loop.
    #[error("an index is given for {node}, but there are {count} of them, numbered from 0")]
    NoSuchNode {
        /// What was named.
        node: Node,
        /// How many there are.
        count: usize,
    },
    /// No such generator.
    #[error("an index is given for generator {generator}, but the surface has {count} (2 per handle), numbered from 0")]
    NoSuchGenerator {
        /// What was named.
        generator: usize,
        /// How many there are.
        count: usize,
    },
    /// The indices of a component do not have the sum that its topology asks for.
    #[error(
        "the indices of component {component} (with face {face}) sum to {sum}, but must sum to {expected}: {} is missing",
        expected - sum
    )]
    Sum {
        /// The component, numbered as by [`TriMesh::components`].
        component: usize,
        /// Its first face.
        face: FaceId,
        /// What they sum to.
        sum: i64,
        /// What they must sum to.
        expected: i64,
    },
}

/// Spanning trees of the vertices and of the nodes, and the edges in neither.
#[derive(Debug, Clone)]
pub struct TreeCotree {
    faces: usize,
    /// Boundary loops of the surface.
    pub loops: Vec<Vec<HalfedgeId>>,
    /// First vertex of each component.
    pub roots: Vec<VertexId>,
    /// The generators.
    pub generators: Vec<EdgeId>,
    /// Component of each node.
    component: Vec<u32>,
    components: usize,
    /// Vertices, every parent before its children, with the halfedge from the parent; boundary halfedges in reverse carry
    /// `true`.
    order: Vec<(VertexId, HalfedgeId, bool)>,
    /// Nodes, every parent before its children.
    nodes: Vec<u32>,
    /// Edge to the parent of each node, `NONE` at a root.
    parent: Vec<u32>,
    depth: Vec<u32>,
    /// Nodes left and right of each edge.
    sides: Field<EdgeId, [u32; 2]>,
}

impl TreeCotree {
    /// Decomposes a surface of any number of components, by breadth-first search.
    pub fn new(mesh: &TriMesh) -> Self {
        let faces = mesh.face_count();
        let loops = mesh.boundary_loops();
        let mut sides = Field::from_fn(mesh.edge_count(), |e| {
            let h = mesh.halfedge(e);
            [mesh.face(h).0, mesh.twin(h).map_or(NONE, |it| mesh.face(it).0)]
        });
        for (k, path) in loops.iter().enumerate() {
            for &h in path {
                sides[mesh.edge(h)][1] = (faces + k) as u32;
            }
        }
        let mut used = Field::<EdgeId, bool>::filled(mesh.edge_count(), false);
        let (order, roots) = vertex_tree(mesh, &mut used);
        let mut out = Self {
            faces,
            component: vec![NONE; faces + loops.len()],
            components: roots.len(),
            parent: vec![NONE; faces + loops.len()],
            depth: vec![0; faces + loops.len()],
            nodes: Vec::with_capacity(faces + loops.len()),
            generators: Vec::new(),
            loops,
            roots,
            order,
            sides,
        };
        out.node_tree(mesh, &mut used);
        out.generators = used.enumerate().filter(|it| !it.1).map(|it| it.0).collect();
        out
    }

    fn node_tree(&mut self, mesh: &TriMesh, used: &mut Field<EdgeId, bool>) {
        let mut component = 0;
        for seed in 0..self.faces as u32 {
            if self.component[seed as usize] != NONE {
                continue;
            }
            self.component[seed as usize] = component;
            let mut at = self.nodes.len();
            self.nodes.push(seed);
            while at < self.nodes.len() {
                let node = self.nodes[at];
                at += 1;
                let face = (node as usize) < self.faces;
                let own = if face { mesh.face_halfedges(FaceId(node)) } else { [HalfedgeId(0); 3] };
                let around: &[HalfedgeId] = if face { &own } else { &self.loops[node as usize - self.faces] };
                for &h in around {
                    let e = mesh.edge(h);
                    let [left, right] = self.sides[e];
                    let other = (if left == node { right } else { left }) as usize;
                    if !used[e] && self.component[other] == NONE {
                        used[e] = true;
                        self.component[other] = component;
                        self.parent[other] = e.0;
                        self.depth[other] = self.depth[node as usize] + 1;
                        self.nodes.push(other as u32);
                    }
                }
            }
            component += 1;
        }
    }

    /// Number of nodes: faces, then caps.
    pub fn node_count(&self) -> usize {
        self.component.len()
    }

    /// Dense index of a node.
    pub fn index(&self, node: Node) -> Result<usize, IndexError> {
        let (index, count) = match node {
            Node::Face(f) => (f.index(), self.faces),
            Node::Loop(k) => (k, self.loops.len()),
        };
        if index >= count {
            return Err(IndexError::NoSuchNode { node, count });
        }
        Ok(if matches!(node, Node::Face(_)) { index } else { self.faces + index })
    }

    /// The node of a dense index.
    pub fn node(&self, index: usize) -> Node {
        if index < self.faces { Node::Face(FaceId::new(index)) } else { Node::Loop(index - self.faces) }
    }

    /// Component of a node.
    pub fn component(&self, index: usize) -> usize {
        self.component[index] as usize
    }

    /// `Err` unless the values per node sum to `expected(component)` in every component.
    pub fn check_sums(&self, values: &[i32], expected: impl Fn(usize) -> i64) -> Result<(), IndexError> {
        let mut sums = vec![0_i64; self.components];
        for (value, &component) in values.iter().zip(&self.component) {
            sums[component as usize] += i64::from(*value);
        }
        match (0..self.components).find(|&it| sums[it] != expected(it)) {
            None => Ok(()),
            Some(component) => {
                let face = self.component.iter().position(|&it| it as usize == component).unwrap_or(0);
                let (sum, expected) = (sums[component], expected(component));
                Err(IndexError::Sum { component, face: FaceId::new(face), sum, expected })
            }
        }
    }

    /// The integer 1-form n with D1 n = `values` per node and periods `periods` per generator. The values must sum to 0 in
    /// every component ([`TreeCotree::check_sums`]). O(F): the leaves of the cotree are peeled.
    pub fn integer_form(&self, values: &[i32], periods: &[i32]) -> Field<EdgeId, i32> {
        let mut form = Field::filled(self.sides.len(), 0);
        let mut rest = values.to_vec();
        for (&e, &period) in self.generators.iter().zip(periods) {
            form[e] = period;
            let [left, right] = self.sides[e];
            rest[left as usize] -= period;
            rest[right as usize] += period;
        }
        for &node in self.nodes.iter().rev() {
            let Some((e, sign, up)) = self.up(node as usize) else { continue };
            form[e] = sign * rest[node as usize];
            rest[up] += rest[node as usize];
        }
        form
    }

    /// Edge to the parent of a node, the sign with which the node runs along it, and the parent.
    fn up(&self, node: usize) -> Option<(EdgeId, i32, usize)> {
        let e = EdgeId(self.parent[node]);
        if e.0 == NONE {
            return None;
        }
        let [left, right] = self.sides[e];
        Some(if left as usize == node { (e, 1, right as usize) } else { (e, -1, left as usize) })
    }

    /// How the integer 1-form changes when `amount` moves from node `from` to node `to` of the same component: edges of a
    /// dual path with what is added to each.
    pub fn transfer(&self, from: usize, to: usize, amount: i32) -> Vec<(EdgeId, i32)> {
        let mut path = Vec::new();
        let (mut a, mut b) = (to, from);
        while a != b {
            // The deeper one climbs; what it hands over flows through its edge to the parent.
            let (node, amount) = if self.depth[a] >= self.depth[b] { (a, amount) } else { (b, -amount) };
            let Some((e, sign, up)) = self.up(node) else { break };
            path.push((e, sign * amount));
            if node == a { a = up } else { b = up }
        }
        path
    }

    /// Integrals of a 1-form along the tree from the root to every vertex.
    fn along_tree(&self, mesh: &TriMesh, form: &Field<EdgeId, f64>) -> Field<VertexId, f64> {
        let mut sum = Field::filled(mesh.vertex_count(), 0.0);
        for &(v, h, back) in &self.order {
            let parent = if back { mesh.head(h) } else { mesh.tail(h) };
            let e = mesh.edge(h);
            let forward = (mesh.halfedge(e) == h) != back;
            sum[v] = sum[parent] + if forward { form[e] } else { -form[e] };
        }
        sum
    }

    /// Periods of a 1-form around the loops of the generators: from the root through the tree to the tail of the generator,
    /// along it, and back.
    pub fn periods(&self, mesh: &TriMesh, form: &Field<EdgeId, f64>) -> Vec<f64> {
        if self.generators.is_empty() {
            return Vec::new();
        }
        let sum = self.along_tree(mesh, form);
        let period = |&e: &EdgeId| {
            let [a, b] = mesh.edge_vertices(e);
            sum[a] + form[e] - sum[b]
        };
        self.generators.iter().map(period).collect()
    }

    /// The edges of the loop of a generator with the signs with which it runs along them.
    pub fn generator_loop(&self, mesh: &TriMesh, generator: usize) -> Vec<(EdgeId, f64)> {
        let mut parent = Field::filled(mesh.vertex_count(), None);
        for &(v, h, back) in &self.order {
            parent[v] = Some((h, back));
        }
        let e = self.generators[generator];
        let mut out = vec![(e, 1.0)];
        let [a, b] = mesh.edge_vertices(e);
        for (end, way) in [(a, 1.0), (b, -1.0)] {
            let mut v = end;
            while let Some((h, back)) = parent[v] {
                let e = mesh.edge(h);
                let forward = (mesh.halfedge(e) == h) != back;
                out.push((e, if forward { way } else { -way }));
                v = if back { mesh.head(h) } else { mesh.tail(h) };
            }
        }
        out
    }

    /// D1 of a 1-form: its sum around every node.
    pub fn sums<T>(&self, form: &Field<EdgeId, T>) -> Vec<T>
    where
        T: Copy + Default + std::ops::AddAssign + std::ops::SubAssign,
    {
        let mut out = vec![T::default(); self.node_count()];
        for (&[left, right], &value) in self.sides.iter().zip(form.iter()) {
            out[left as usize] += value;
            out[right as usize] -= value;
        }
        out
    }

    /// What a 1-form transports across the cotree: λ per node, 0 at the roots, with λ(left) − λ(right) = form on every edge
    /// of the cotree.
    pub fn potential(&self, form: &Field<EdgeId, f64>) -> Vec<f64> {
        let mut out = vec![0.0; self.node_count()];
        for &node in &self.nodes {
            if let Some((e, sign, up)) = self.up(node as usize) {
                out[node as usize] = out[up] + f64::from(sign) * form[e];
            }
        }
        out
    }
}

/// A breadth-first tree of the vertices of every component, and their roots.
fn vertex_tree(mesh: &TriMesh, used: &mut Field<EdgeId, bool>) -> (Vec<(VertexId, HalfedgeId, bool)>, Vec<VertexId>) {
    let mut seen = Field::filled(mesh.vertex_count(), false);
    let (mut order, mut roots) = (Vec::with_capacity(mesh.vertex_count()), Vec::new());
    // Components come in the order of their smallest face, as those of `TriMesh::components` do.
    for seed in mesh.faces().map(|f| mesh.face_vertices(f)[0]) {
        if seen[seed] {
            continue;
        }
        seen[seed] = true;
        roots.push(seed);
        let mut at = order.len();
        let mut v = seed;
        loop {
            for h in mesh.outgoing(v) {
                let mut visit = |to: VertexId, h: HalfedgeId, back: bool| {
                    if !seen[to] {
                        seen[to] = true;
                        used[mesh.edge(h)] = true;
                        order.push((to, h, back));
                    }
                };
                visit(mesh.head(h), h, false);
                let last = mesh.previous(h);
                if mesh.twin(last).is_none() {
                    visit(mesh.tail(last), last, true);
                }
            }
            match order.get(at) {
                Some(next) => v = next.0,
                None => break,
            }
            at += 1;
        }
    }
    (order, roots)
}
