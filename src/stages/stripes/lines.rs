//! Stripes along line fields, which have no sign and may turn by half a turn around a point.
//!
//! On the double cover of the surface, branched at those points, the line field is a vector field X with −X on the other
//! sheet, so the vector machinery applies. From any solution u there, U = u − (u on the other sheet) changes its sign
//! with the sheet exactly, in its integers as well; u is made for twice the spacing. A face around which the
//! signs multiply to −1 is divided at its centre, over which the cover has one vertex. There U's potential is 0, and with the
//! isolines at half turns every branch point lies half-way between lines, and both sheets show the same lines.
use super::{
    StripesError,
    isolines::{Crossings, Levels},
};
use crate::{
    geom::{Complex, Vec3},
    mesh::{EdgeId, FaceId, Field, Id, TriMesh, VertexId},
    surface::{
        direction_field::DirectionField,
        field_aligned::{Indices, Parameterizer},
        tangent::TangentSpaces,
        tree_cotree::Node,
    },
};

/// The lines of the cover, at half turns of U.
const HALVES: Levels = Levels { per_turn: 1, offset: 0.5 };

/// A surface with branch points as vertices, and its double cover.
struct Cover {
    /// The surface with its branch faces divided: the vertices of the given one, then the centres.
    base: TriMesh,
    /// The face of the given surface in which each lies.
    origin: Field<FaceId, FaceId>,
    /// The cover: face 2 f + s lies over face f of the base, on sheet s; vertex v < V on sheet 0, the same + V on sheet 1 for
    /// the V vertices of the given surface, then the centres.
    mesh: TriMesh,
    vertices: usize,
}

impl Cover {
    fn new(mesh: &TriMesh, tangent: &TangentSpaces, field: &Field<VertexId, Complex>) -> Result<Self, StripesError> {
        let vertices = mesh.vertex_count();
        let flips = |h| {
            let carried = field[mesh.tail(h)] * tangent.transport(h);
            (carried * field[mesh.head(h)].conj()).re < 0.0
        };
        let flip = Field::from_fn(mesh.edge_count(), |e: EdgeId| flips(mesh.halfedge(e)));
        let mut positions = mesh.positions().as_slice().to_vec();
        let (mut faces, mut origin, mut above) = (Vec::new(), Vec::new(), Vec::new());
        for f in mesh.faces() {
            let corners = mesh.face_vertices(f).map(|v| v.0);
            let turns = mesh.face_halfedges(f).map(|h| flip[mesh.edge(h)]);
            let on = |k: usize, sheet: bool| corners[k] + if sheet { vertices as u32 } else { 0 };
            if !turns.iter().fold(false, |odd, it| odd != *it) {
                origin.push(f);
                faces.push(corners);
                for sheet in [false, true] {
                    let second = sheet != turns[0];
                    above.push([on(0, sheet), on(1, second), on(2, second != turns[1])]);
                }
                continue;
            }
            let centre = positions.len() as u32;
            positions.push(mesh.face_positions(f).iter().sum::<Vec3>() / 3.0);
            for k in 0..3 {
                origin.push(f);
                faces.push([corners[k], corners[(k + 1) % 3], centre]);
                for sheet in [false, true] {
                    above.push([on(k, sheet), on((k + 1) % 3, sheet != turns[k]), centre + vertices as u32]);
                }
            }
        }
        let sheets = [&positions[..vertices], &positions[..]].concat();
        Ok(Self {
            base: TriMesh::new(positions, &faces)?,
            origin: Field::from_vec(origin),
            mesh: TriMesh::new(sheets, &above)?,
            vertices,
        })
    }

    /// The vertex on the other sheet.
    fn other(&self, v: VertexId) -> VertexId {
        let (at, n) = (v.index(), self.vertices);
        VertexId::new(if at < n {
            at + n
        } else if at < 2 * n {
            at - n
        } else {
            at
        })
    }

    /// The edge on the other sheet, which runs the same way.
    fn other_edge(&self, e: EdgeId) -> EdgeId {
        let h = self.mesh.halfedge(e);
        let (face, corner) = (self.mesh.face(h).index(), h.index() % 3);
        self.mesh.edge(self.mesh.face_halfedges(FaceId::new(face ^ 1))[corner])
    }
}

/// What the lines of a line field are.
pub struct Lines {
    /// The surface, in whose branch faces there are new vertices.
    pub mesh: TriMesh,
    /// The face of the given surface in which each face lies.
    pub origin: Field<FaceId, FaceId>,
    /// The lines on `mesh`.
    pub crossings: Crossings,
    /// Branch points.
    pub branches: usize,
    /// U on the edges of the cover over sheet 0 of every face: around face f from its first corner, radians.
    pub rises: Field<FaceId, [f64; 3]>,
    /// Half of (U − 2 ω)ᵀ W (U − 2 ω) on the cover.
    pub energy: f64,
    /// Largest distance of a sum around a face of the cover from a multiple of 2π, radians.
    pub period_error: f64,
}

/// Lines at `spacing` across a line field; `singularities` are faces with the number of lines that end there (the sign is that on
/// one of the sheets). On a surface where the signs cannot be told apart they must be an even number.
pub fn lines(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    field: &DirectionField,
    spacing: f64,
    singularities: &[(FaceId, i32)],
) -> Result<Lines, StripesError> {
    let vectors = field.vectors();
    let cover = Cover::new(mesh, tangent, &vectors)?;
    let omega = omega(mesh, tangent, &vectors, &cover, std::f64::consts::PI / spacing);
    let solver = Parameterizer::new(&cover.mesh)?;
    let mut nodes = Vec::new();
    let mut surplus = false;
    for &(f, index) in singularities {
        // The first of the faces into which it may be divided; N = k on this sheet − k on the other.
        let at = cover.origin.iter().position(|it| *it == f).unwrap_or(usize::MAX / 4);
        let more = if surplus { (index - index.rem_euclid(2)) / 2 } else { (index + index.rem_euclid(2)) / 2 };
        surplus ^= index % 2 != 0;
        nodes.push((Node::Face(FaceId(2 * u32::try_from(at).unwrap_or(u32::MAX / 2))), more));
        nodes.push((Node::Face(FaceId((2 * at + 1) as u32)), more - index));
    }
    let solved = solver.solve(&cover.mesh, omega, &Indices { nodes, generators: Vec::new() })?;
    let alpha = Field::from_fn(cover.mesh.vertex_count(), |v| {
        let turns = solved.alpha[v] - solved.alpha[cover.other(v)];
        // A level exactly at a vertex would be seen on one sheet only.
        let beside = (turns / std::f64::consts::TAU - HALVES.offset).fract() == 0.0;
        turns + if beside { 1e-12 * if v.index() < cover.vertices { 1.0 } else { -1.0 } } else { 0.0 }
    });
    let n = Field::from_fn(cover.mesh.edge_count(), |e| solved.n[e] - solved.n[cover.other_edge(e)]);
    let difference = |e: EdgeId| {
        let [a, b] = cover.mesh.edge_vertices(e);
        alpha[b] - alpha[a] + std::f64::consts::TAU * f64::from(n[e])
    };
    let along = |h| {
        let e = cover.mesh.edge(h);
        if cover.mesh.halfedge(e) == h { difference(e) } else { -difference(e) }
    };
    let rises = Field::from_fn(cover.base.face_count(), |f: FaceId| {
        cover.mesh.face_halfedges(FaceId::new(2 * f.index())).map(along)
    });
    let weight = crate::surface::tangent::cotangent_weights(&cover.mesh);
    let term = |e: EdgeId| weight[e] * (difference(e) - 2.0 * solved.omega()[e]).powi(2);
    let off = |it: &[f64; 3]| {
        let turns = it.iter().sum::<f64>() / std::f64::consts::TAU;
        (turns - turns.round()).abs() * std::f64::consts::TAU
    };
    let above = Crossings::new(&cover.mesh, &alpha, &n, HALVES);
    Ok(Lines {
        crossings: Crossings::below(&above, &cover.mesh, &cover.base),
        branches: cover.base.vertex_count() - cover.vertices,
        energy: 0.5 * cover.mesh.edges().map(term).sum::<f64>(),
        period_error: rises.iter().map(off).fold(0.0, f64::max),
        rises,
        mesh: cover.base,
        origin: cover.origin,
    })
}

/// The 1-form of the field on the cover: on sheet 1 its negative. Along the edges to the centres the field counts on the outer
/// half.
fn omega(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    field: &Field<VertexId, Complex>,
    cover: &Cover,
    frequency: f64,
) -> Field<EdgeId, f64> {
    let n = cover.vertices;
    Field::from_fn(cover.mesh.edge_count(), |e| {
        let [a, b] = cover.mesh.edge_vertices(e);
        let sign = |v: VertexId| if v.index() < n { frequency } else { -frequency };
        let down = |v: VertexId| VertexId::new(if v.index() < n { v.index() } else { v.index() - n });
        let centre = |v: VertexId| v.index() >= 2 * n;
        if centre(a) || centre(b) {
            let (outer, inner, way) = if centre(b) { (a, b, 1.0) } else { (b, a, -1.0) };
            let along = cover.mesh.position(inner) - cover.mesh.position(outer);
            let vector = tangent.to_space(mesh, down(outer), field[down(outer)]);
            return way * 0.5 * sign(outer) * vector.dot(&along);
        }
        let h = mesh.find_halfedge(down(a), down(b));
        let (h, way) = match h {
            Some(h) => (h, 1.0),
            None => (mesh.find_halfedge(down(b), down(a)).unwrap_or(crate::mesh::HalfedgeId(0)), -1.0),
        };
        let (tail, head) = if way > 0.0 { (a, b) } else { (b, a) };
        let dot = |x: Complex, y: Complex| x.re * y.re + x.im * y.im;
        let ends = sign(tail) * dot(field[mesh.tail(h)], tangent.direction[h])
            + sign(head) * dot(field[mesh.head(h)], tangent.arrival[h]);
        way * 0.5 * tangent.metric.length[h] * ends
    })
}
