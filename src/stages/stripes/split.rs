//! Cuts a mesh along its isolines: every line becomes a path of edges.
use super::isolines::{Around, Crossings};
use crate::{
    geom::Vec3,
    mesh::{EdgeId, FaceId, Field, Id, MeshError, TriMesh, VertexId},
    surface::chart::ChartBuilder,
};

/// A mesh with isolines as edges.
#[derive(Debug, Clone, PartialEq)]
pub struct Split {
    /// The mesh: the vertices of the given one, then the crossings, then the ends inside faces.
    pub mesh: TriMesh,
    /// The face of the given mesh in which each face lies.
    pub origin: Field<FaceId, FaceId>,
    /// The edges along isolines as pairs of vertices.
    pub lines: Vec<[u32; 2]>,
}

impl Split {
    /// Whether a line runs along each edge.
    pub fn edges(&self) -> Field<EdgeId, bool> {
        let mut out = Field::filled(self.mesh.edge_count(), false);
        for &[a, b] in &self.lines {
            let [a, b] = [VertexId(a), VertexId(b)];
            let h = self.mesh.find_halfedge(a, b).or_else(|| self.mesh.find_halfedge(b, a));
            out[self.mesh.edge(h.expect("every piece of a line was made an edge"))] = true;
        }
        out
    }

    /// The faces of every part between the lines, which run along [`Split::edges`].
    pub fn parts(&self, lines: &Field<EdgeId, bool>) -> Vec<Vec<FaceId>> {
        let all: Vec<FaceId> = self.mesh.faces().collect();
        ChartBuilder::new(&self.mesh).components(&all, &|e| lines[e])
    }
}

/// Inserts the lines. Crossings nearer to a corner than the share `margin` of their edge are moved away to it, so that no
/// sliver arises; that moves a line by less than `margin` edges.
pub fn split(mesh: &TriMesh, crossings: &Crossings, margin: f64) -> Result<Split, MeshError> {
    let corners = mesh.vertex_count() as u32;
    let mut positions: Vec<Vec3> = mesh.positions().as_slice().to_vec();
    for c in 0..crossings.len() {
        let e = crossings.edge[c];
        let (first, last) = (crossings.first[e.index()], crossings.first[e.index() + 1]);
        // With many lines on one edge the margin shrinks, so that their order stays.
        let margin = margin.min(0.5 / f64::from(last - first));
        let [a, b] = mesh.edge_vertices(e).map(|v| mesh.position(v));
        positions.push(a + (b - a) * crossings.share[c].clamp(margin, 1.0 - margin));
    }
    positions.extend(crossings.ends.iter().map(|it| it.place));
    let mut end_of = Field::<FaceId, u32>::filled(mesh.face_count(), u32::MAX);
    crossings.ends.iter().zip(0..).for_each(|(it, k)| end_of[it.face] = k);
    let mut out = Pieces { corners, crossings, faces: Vec::new(), origin: Vec::new(), lines: Vec::new() };
    for f in mesh.faces() {
        let around = crossings.around(mesh, f);
        if around.len() == 3 {
            out.faces.push(mesh.face_vertices(f).map(|v| v.0));
            out.origin.push(f);
            continue;
        }
        let end = crossings.ends.get(end_of[f] as usize);
        let centre = end.map(|_| corners + crossings.len() as u32 + end_of[f]);
        let free = end.map_or(&[][..], |it| &it.crossings);
        out.divide(around, f, &positions, centre.map(|it| (it, free)));
    }
    let Pieces { faces, origin, lines, .. } = out;
    Ok(Split { mesh: TriMesh::new(positions, &faces)?, origin: Field::from_vec(origin), lines })
}

struct Pieces<'a> {
    corners: u32,
    crossings: &'a Crossings,
    faces: Vec<[u32; 3]>,
    origin: Vec<FaceId>,
    lines: Vec<[u32; 2]>,
}

impl Pieces<'_> {
    /// Cuts the polygon of a face at one line after the other and triangulates what is left; `end` is the vertex at which
    /// lines end and their crossings.
    fn divide(&mut self, around: Vec<Around>, f: FaceId, positions: &[Vec3], end: Option<(u32, &[u32])>) {
        let mut open = vec![around];
        while let Some(polygon) = open.pop() {
            let partner = |i: usize| match polygon[i] {
                Around::Crossing(x) => {
                    let y = self.crossings.partner(x)?;
                    polygon.iter().position(|it| *it == Around::Crossing(y))
                }
                Around::Corner(_) => None,
            };
            // Following each other in a polygon, the two have been cut apart already.
            let n = polygon.len();
            let chord = (0..n).find_map(|i| partner(i).filter(|&k| k > i + 1 && k - i < n - 1).map(|k| (i, k)));
            if let Some((i, k)) = chord {
                self.lines.push([self.vertex(polygon[i]), self.vertex(polygon[k])]);
                open.push([&polygon[..=i], &polygon[k..]].concat());
                open.push(polygon[i..=k].to_vec());
                continue;
            }
            let vertices: Vec<u32> = polygon.iter().map(|&it| self.vertex(it)).collect();
            let spokes = end.filter(|(_, free)| vertices.contains(&(self.corners + free[0])));
            let triangles = match spokes {
                Some((centre, free)) => {
                    self.lines.extend(free.iter().map(|c| [centre, self.corners + c]));
                    (0..n).map(|i| [vertices[i], vertices[(i + 1) % n], centre]).collect()
                }
                None => fan(&vertices, positions),
            };
            self.origin.extend(triangles.iter().map(|_| f));
            self.faces.extend(triangles);
        }
    }

    fn vertex(&self, it: Around) -> u32 {
        match it {
            Around::Corner(v) => v.0,
            Around::Crossing(x) => self.corners + x / 2,
        }
    }
}

/// A convex polygon as triangles about one of its corners: the one whose worst triangle is best.
fn fan(polygon: &[u32], positions: &[Vec3]) -> Vec<[u32; 3]> {
    let n = polygon.len();
    let about = |apex: usize| (1..n - 1).map(move |i| [0, i, i + 1].map(|k| polygon[(apex + k) % n]));
    let quality = |[a, b, c]: [u32; 3]| {
        let [a, b, c] = [a, b, c].map(|v| positions[v as usize]);
        let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
        (b - a).cross(&(c - a)).norm() / longest
    };
    let worst = |apex: usize| about(apex).map(quality).fold(f64::INFINITY, f64::min);
    let best = (0..n).max_by(|&a, &b| worst(a).total_cmp(&worst(b)).then(b.cmp(&a))).unwrap_or(0);
    about(best).collect()
}
