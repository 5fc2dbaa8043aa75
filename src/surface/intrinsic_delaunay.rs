//! The intrinsic Delaunay triangulation of a mesh by edge flips (Bobenko, Springborn 2007), and how 1-forms follow it.
//!
//! The surface and its vertices stay; only the straight edges through its faces change, until the angles opposite every
//! edge sum to π at most, so that no cotangent weight is negative. A flip replaces the diagonal a–b of the flat quadrilateral a,
//! d, b, c by d–c and keeps its number.
use crate::mesh::{EdgeId, Field, TriMesh};

const NONE: u32 = u32::MAX;
/// A sum of cotangents above minus this is Delaunay: rounding must not flip for ever.
const FLAT: f64 = 1e-12;

/// One flip.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Flip {
    /// The edge.
    edge: u32,
    /// Edges d → a, a → c, d → b, b → c with the signs with which they run that way.
    sides: [(u32, i32); 4],
    /// Share of a → b before the new edge crosses it.
    share: f64,
}

/// An intrinsic triangulation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct IntrinsicDelaunay {
    /// Vertices of each edge; both may be the same.
    pub ends: Vec<[u32; 2]>,
    /// ½ Σ cot of the angles opposite each edge, nowhere negative but for rounding.
    pub weight: Vec<f64>,
    flips: Vec<Flip>,
}

/// Halfedges 3 f + k of face f, while edges are flipped.
struct Flipper {
    tail: Vec<u32>,
    twin: Vec<u32>,
    edge: Vec<u32>,
    /// Whether a halfedge runs as its edge does.
    forward: Vec<bool>,
    length: Vec<f64>,
}

fn next(h: usize) -> usize {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

fn last(h: usize) -> usize {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

impl Flipper {
    fn new(mesh: &TriMesh) -> Self {
        Self {
            tail: mesh.halfedges().map(|h| mesh.tail(h).0).collect(),
            twin: mesh.halfedges().map(|h| mesh.twin(h).map_or(NONE, |it| it.0)).collect(),
            edge: mesh.halfedges().map(|h| mesh.edge(h).0).collect(),
            forward: mesh.halfedges().map(|h| mesh.halfedge(mesh.edge(h)) == h).collect(),
            length: mesh.edges().map(|e| mesh.edge_length(e)).collect(),
        }
    }

    fn length(&self, h: usize) -> f64 {
        self.length[self.edge[h] as usize]
    }

    /// Where the corner opposite `h` lies when h runs from the origin along x: (x, y), y > 0.
    fn apex(&self, h: usize) -> (f64, f64) {
        let (l, from_head, from_tail) = (self.length(h), self.length(next(h)), self.length(last(h)));
        let x = (l * l + from_tail * from_tail - from_head * from_head) / (2.0 * l);
        // Heron's formula in the order that keeps digits for needles (Kahan).
        let mut sides = [l, from_head, from_tail];
        sides.sort_by(f64::total_cmp);
        let [c, b, a] = sides;
        let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
        (x, 0.5 * product.max(0.0).sqrt() / l)
    }

    /// Cotangent of the angle opposite `h`.
    fn cotangent(&self, h: usize) -> f64 {
        let (x, y) = self.apex(h);
        // The legs to both ends, (−x, −y) and (l − x, −y).
        let l = self.length(h);
        (y * y - x * (l - x)) / (y * l)
    }

    /// Flips the edge of `h`, a → b with twin.
    fn flip(&mut self, h: usize) -> Flip {
        let t = self.twin[h] as usize;
        let ((cx, cy), (dx, dy)) = (self.apex(h), self.apex(t));
        // The twin runs from b: turn its corner about the middle.
        let (dx, dy) = (self.length(h) - dx, -dy);
        let share = (dx + (cx - dx) * (-dy) / (cy - dy)) / self.length(h);
        // Old halfedges b → c, c → a of one face and a → d, d → b of the other.
        let old = [next(h), last(h), next(t), last(t)];
        let [bc, ca, ad, db] = old.map(|k| (self.tail[k], self.twin[k], self.edge[k], self.forward[k], k as u32));
        let e = self.edge[h];
        self.length[e as usize] = (cx - dx).hypot(cy - dy);
        // Around both new faces: c a d and d b c; the edge runs from d to c.
        let (f, g) = (h - h % 3, t - t % 3);
        let new = [(f, ca), (f + 1, ad), (g, db), (g + 1, bc)];
        for &(at, (tail, twin, edge, forward, _)) in &new {
            (self.tail[at], self.twin[at], self.edge[at], self.forward[at]) = (tail, twin, edge, forward);
        }
        // Twins, of which some are among the four.
        let moved = |x: u32| new.iter().find(|it| it.1.4 == x).map_or(x, |it| it.0 as u32);
        for &(at, (_, twin, ..)) in &new {
            if twin != NONE {
                let twin = moved(twin);
                self.twin[at] = twin;
                self.twin[twin as usize] = at as u32;
            }
        }
        for (at, tail, twin, forward) in [(f + 2, db.0, g + 2, true), (g + 2, ca.0, f + 2, false)] {
            (self.tail[at], self.twin[at], self.edge[at], self.forward[at]) = (tail, twin as u32, e, forward);
        }
        let along = |it: (u32, u32, u32, bool, u32)| (it.2, if it.3 { 1 } else { -1 });
        let against = |it| {
            let (edge, sign) = along(it);
            (edge, -sign)
        };
        Flip { edge: e, sides: [against(ad), against(ca), along(db), along(bc)], share }
    }
}

impl IntrinsicDelaunay {
    /// Flips until all edges are Delaunay. Terminates, in practice after fewer flips than edges.
    pub fn new(mesh: &TriMesh) -> Self {
        let mut it = Flipper::new(mesh);
        let mut halfedge: Vec<u32> = mesh.edges().map(|e| mesh.halfedge(e).0).collect();
        let mut flips = Vec::new();
        let mut waiting = vec![true; halfedge.len()];
        let mut queue: Vec<u32> = (0..halfedge.len() as u32).rev().collect();
        while let Some(e) = queue.pop() {
            waiting[e as usize] = false;
            let h = halfedge[e as usize] as usize;
            let t = it.twin[h];
            if t == NONE || it.cotangent(h) + it.cotangent(t as usize) > -FLAT {
                continue;
            }
            let t = t as usize;
            flips.push(it.flip(h));
            for face in [h - h % 3, t - t % 3] {
                for k in face..face + 3 {
                    let edge = it.edge[k] as usize;
                    halfedge[edge] = k as u32;
                    if edge != e as usize && !waiting[edge] {
                        waiting[edge] = true;
                        queue.push(edge as u32);
                    }
                }
            }
        }
        let mut ends = vec![[0; 2]; halfedge.len()];
        let mut weight = vec![0.0; halfedge.len()];
        for h in 0..it.tail.len() {
            let (a, b) = (it.tail[h], it.tail[next(h)]);
            let e = it.edge[h] as usize;
            ends[e] = if it.forward[h] { [a, b] } else { [b, a] };
            weight[e] += 0.5 * it.cotangent(h);
        }
        Self { ends, weight, flips }
    }

    /// Number of flips.
    pub fn flip_count(&self) -> usize {
        self.flips.len()
    }

    /// A real 1-form on the edges of the mesh as one on those of the triangulation: the integral of its Whitney interpolation
    /// along them.
    pub fn real(&self, form: &Field<EdgeId, f64>) -> Vec<f64> {
        let mut out = form.as_slice().to_vec();
        for flip in &self.flips {
            let [a, b] = [0, 2].map(|k| {
                let [x, y] = [flip.sides[k], flip.sides[k + 1]];
                f64::from(x.1) * out[x.0 as usize] + f64::from(y.1) * out[y.0 as usize]
            });
            out[flip.edge as usize] = (1.0 - flip.share) * a + flip.share * b;
        }
        out
    }

    /// An integer 1-form likewise: along a, so that an index of the two faces comes to lie beyond the new edge.
    pub fn integer(&self, form: &Field<EdgeId, i32>) -> Vec<i32> {
        let mut out = form.as_slice().to_vec();
        for flip in &self.flips {
            out[flip.edge as usize] = flip.sides[..2].iter().map(|it| it.1 * out[it.0 as usize]).sum();
        }
        out
    }

    /// The derivative by an integer 1-form on the mesh, from that by the one on the triangulation.
    pub fn pull_back(&self, mut slope: Vec<f64>) -> Field<EdgeId, f64> {
        for flip in self.flips.iter().rev() {
            let value = std::mem::take(&mut slope[flip.edge as usize]);
            for &(edge, sign) in &flip.sides[..2] {
                slope[edge as usize] += f64::from(sign) * value;
            }
        }
        Field::from_vec(slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{geom::Vec3, mesh::shapes};

    fn squashed() -> TriMesh {
        let ball = shapes::icosphere(10.0, 3);
        let flat = ball.positions().iter().map(|p| Vec3::new(p.x, 8.0 * p.y, 0.2 * p.z)).collect();
        ball.with_positions(Field::from_vec(flat))
    }

    #[test]
    fn no_weight_is_negative_and_the_surface_stays() {
        for mesh in [squashed(), shapes::torus(20.0, 2.0, 12, 30), shapes::grid(8, 5, 1.0)] {
            let it = IntrinsicDelaunay::new(&mesh);
            assert!(it.weight.iter().all(|w| *w > -1e-9), "{:?}", it.weight.iter().copied().fold(0.0, f64::min));
            // A linear function of a flat surface has the same energy whatever the edges.
            let x = |v: u32| mesh.position(crate::mesh::VertexId(v)).x;
            let energy: f64 = it.ends.iter().zip(&it.weight).map(|(e, w)| w * (x(e[1]) - x(e[0])).powi(2)).sum();
            let weight = crate::surface::tangent::cotangent_weights(&mesh);
            let before: f64 = mesh
                .edges()
                .map(|e| {
                    let [a, b] = mesh.edge_vertices(e);
                    weight[e] * (x(b.0) - x(a.0)).powi(2)
                })
                .sum();
            // Rippa 1990: of all triangulations Delaunay has the least.
            assert!(energy <= before * (1.0 + 1e-9), "{energy} {before}");
        }
        assert!(IntrinsicDelaunay::new(&squashed()).flip_count() > 100);
        assert_eq!(IntrinsicDelaunay::new(&shapes::grid(8, 5, 1.0)).flip_count(), 0);
    }

    #[test]
    fn differences_of_a_function_stay_differences() {
        let mesh = squashed();
        let it = IntrinsicDelaunay::new(&mesh);
        let value = |v: u32| i32::try_from(v * v % 97).unwrap();
        let form = Field::from_fn(mesh.edge_count(), |e: EdgeId| {
            let [a, b] = mesh.edge_vertices(e);
            value(b.0) - value(a.0)
        });
        let real = it.real(&Field::from_vec(form.iter().map(|&n| f64::from(n)).collect()));
        for (k, n) in it.integer(&form).into_iter().enumerate() {
            let [a, b] = it.ends[k];
            assert_eq!(n, value(b) - value(a));
            assert!((real[k] - f64::from(n)).abs() < 1e-9);
        }
    }
}
