//! A positive semidefinite model of the Hessian of energy, barriers and fidelity.
//!
//! Energy: with its eigenvector u held, λ is the sum of squares r_k = √θ_k ⟨u, N_k⟩, and u itself is the minimiser over unit
//! vectors. Variable projection (Golub, Pereyra 1973, in Kaufman's form) removes from the rows j_k = ∂r_k what a turn of u
//! towards the other eigenvectors t1, t2 undoes. Those two directions √θ_k ⟨t_m, N_k⟩ are orthogonal to each other (both
//! are eigenvectors of A) and of squared length μ_m, so
//!   H = 2 [ Σ j_k j_kᵀ − Σ_m g_m g_mᵀ / (μ_m + λ) ],  g_m = Σ_k √θ_k ⟨t_m, N_k⟩ j_k.
//! Barriers and fidelity: Gauss–Newton.
use nalgebra::Matrix3;
use rayon::prelude::*;

use super::{Evaluator, barrier, curves::Curves, fidelity::Fidelity};
use crate::{
    geom::Vec3,
    mesh::{EdgeId, FaceId, HalfedgeId, Id, TriMesh, VertexId},
    numeric::{
        sparse::{Analysis, SparseError, SymmetricMatrix},
        symmetric3::jacobi,
    },
};

/// Added to μ_m, so that stars that are flat to the last digit do not divide by zero.
const FLAT: f64 = 1e-9;

/// Stars per task.
const STARS: usize = 128;
/// Tasks whose results are held before they are added: few enough to stay in the cache.
const TASKS: usize = 16;

/// The pattern of the Hessian in 3 × 3 blocks and its analysis; serves one connectivity.
#[derive(Debug)]
pub(super) struct Curvature {
    /// Block rows a ≥ b of each block column b, ascending, so b itself first.
    rows: Vec<u32>,
    /// First entry of each block column in `rows`.
    starts: Vec<u32>,
    /// First value of each block column in the matrix.
    values: Vec<usize>,
    /// Interior vertices of valence > 3, the stars that have energy, and the first of each one's cells.
    stars: Vec<(VertexId, u32)>,
    /// Where the blocks of each star go, lower triangle by rows, as in [`Star::blocks`].
    star_cells: Vec<Cell>,
    /// Where the blocks of each face go, lower triangle by rows.
    face_cells: Vec<[Cell; 6]>,
    pub(super) analysis: Analysis<f32>,
    pattern: SymmetricMatrix,
}

/// Where a 3 × 3 block lies among the values of the matrix.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// Its first value.
    at: u32,
    /// Height of its block column.
    height: u32,
    place: Place,
}

/// What of a block is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    /// It lies on the diagonal: its lower triangle.
    Diagonal,
    /// All of it.
    Below,
    /// It lies above the diagonal: its mirror image is stored.
    Above,
}

impl Cell {
    /// Adds the block ∂²/∂a∂b (and, by symmetry, its mirror image).
    #[inline(always)]
    fn add(self, out: &mut [f64], block: &Matrix3<f64>) {
        let (at, height) = (self.at as usize, self.height as usize);
        // Column c of a block column begins at its own diagonal, so its rows lie c places higher.
        let columns = [at, at + height - 1, at + 2 * height - 3];
        match self.place {
            Place::Below => {
                for c in 0..3 {
                    let column = &mut out[columns[c]..columns[c] + 3];
                    (0..3).for_each(|r| column[r] += block[(r, c)]);
                }
            }
            Place::Above => {
                for c in 0..3 {
                    let column = &mut out[columns[c]..columns[c] + 3];
                    (0..3).for_each(|r| column[r] += block[(c, r)]);
                }
            }
            Place::Diagonal => {
                for c in 0..3 {
                    (c..3).for_each(|r| out[columns[c] + r] += block[(r, c)]);
                }
            }
        }
    }
}

/// Geometry of one face and its derivatives by its corners.
struct Face {
    vertices: [u32; 3],
    normal: Vec3,
    /// N × e_k over |e_k|².
    turn: [Vec3; 3],
    /// Height vector of each corner over 2A: ∂N/∂p_k = −lift_k ⟨N, ·⟩, ∂ ln A = lift_k.
    lift: [Vec3; 3],
    angles: [f64; 3],
    area: f64,
}

impl Face {
    fn of(mesh: &TriMesh, face: FaceId) -> Self {
        let p = mesh.face_positions(face);
        let edges = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
        let area_vector = edges[0].cross(&edges[1]);
        let doubled = area_vector.norm();
        let normal = area_vector / doubled;
        let spin = edges.map(|e| normal.cross(&e));
        Self {
            vertices: mesh.face_vertices(face).map(|v| v.0),
            normal,
            turn: [0, 1, 2].map(|k| spin[k] / edges[k].norm_squared()),
            lift: [0, 1, 2].map(|k| spin[(k + 1) % 3] / doubled),
            angles: [0, 1, 2].map(|k| doubled.atan2(-edges[k].dot(&edges[(k + 2) % 3]))),
            area: 0.5 * doubled,
        }
    }

    /// ∂θ_c by corners c, c + 1, c + 2.
    fn angle_gradient(&self, c: usize) -> [Vec3; 3] {
        let (out, back) = (self.turn[c], self.turn[(c + 2) % 3]);
        [out + back, -out, -back]
    }
}

impl Curvature {
    /// Arranges and analyses the pattern: the vertices of every star, of the two faces of every edge, and of every group of
    /// `groups` meet.
    pub(super) fn new(mesh: &TriMesh, groups: &[[u32; 4]]) -> Result<Self, SparseError> {
        let mut meets: Vec<Vec<u32>> = mesh.vertices().map(|v| vec![v.0]).collect();
        let mut meet = |group: &[u32]| {
            for &a in group {
                meets[a as usize].extend(group.iter().filter(|&&b| b > a));
            }
        };
        for v in mesh.vertices() {
            let star: Vec<u32> = std::iter::once(v.0).chain(mesh.neighbors(v).map(|it| it.0)).collect();
            if !mesh.is_boundary_vertex(v) {
                meet(&star);
            }
        }
        groups.iter().for_each(|group| meet(group));
        for f in mesh.faces() {
            meet(&mesh.face_vertices(f).map(|v| v.0));
        }
        for e in mesh.edges() {
            if let Some((_, vertices)) = flap(mesh, e) {
                meet(&vertices.map(|v| v.0));
            }
        }
        let (mut rows, mut starts, mut values, mut pairs) = (Vec::new(), vec![0], vec![0], Vec::new());
        for (b, mut column) in meets.into_iter().enumerate() {
            column.sort_unstable();
            column.dedup();
            for &a in &column {
                pairs.extend((0..9).map(|k| (3 * a + k / 3, 3 * b as u32 + k % 3)));
            }
            let height = 3 * column.len();
            values.push(values[b] + 3 * height - 3);
            rows.extend(column);
            starts.push(rows.len() as u32);
        }
        let (pattern, _) = SymmetricMatrix::with_pattern(3 * mesh.vertex_count(), &pairs);
        let analysis = Analysis::of(&pattern)?;
        let (stars, star_cells, face_cells) = (Vec::new(), Vec::new(), Vec::new());
        let mut curvature = Self { rows, starts, values, stars, star_cells, face_cells, analysis, pattern };
        curvature.face_cells =
            mesh.faces().map(|f| curvature.triangle_cells(mesh.face_vertices(f).map(|v| v.0))).collect();
        let mut star = Vec::new();
        for v in mesh.vertices().filter(|&v| !mesh.is_boundary_vertex(v) && mesh.face_degree(v) > 3) {
            star.clear();
            star.extend(std::iter::once(v.0).chain(mesh.outgoing(v).map(|h| mesh.head(h).0)));
            curvature.stars.push((v, curvature.star_cells.len() as u32));
            for p in 0..star.len() {
                for q in 0..=p {
                    let cell = curvature.cell(star[p], star[q]);
                    curvature.star_cells.push(cell);
                }
            }
        }
        Ok(curvature)
    }

    /// A matrix of this pattern.
    pub(super) fn matrix(&self) -> SymmetricMatrix {
        self.pattern.clone()
    }

    /// Where the block of two vertices that meet goes.
    fn cell(&self, a: u32, b: u32) -> Cell {
        if a < b {
            return Cell { place: Place::Above, ..self.cell(b, a) };
        }
        let (from, to) = (self.starts[b as usize] as usize, self.starts[b as usize + 1] as usize);
        let index = self.rows[from..to].binary_search(&a).expect("the pattern has every pair of a star");
        let at = (self.values[b as usize] + 3 * index) as u32;
        let place = if a == b { Place::Diagonal } else { Place::Below };
        Cell { at, height: 3 * (to - from) as u32, place }
    }

    fn triangle_cells(&self, [a, b, c]: [u32; 3]) -> [Cell; 6] {
        [(a, a), (b, a), (b, b), (c, a), (c, b), (c, c)].map(|(p, q)| self.cell(p, q))
    }

    /// Adds `scale` · d dᵀ for the derivative d of some quantity by a few vertices.
    fn add_square<const N: usize>(&self, out: &mut [f64], vertices: [u32; N], d: [Vec3; N], scale: f64) {
        for p in 0..N {
            for q in 0..=p {
                self.cell(vertices[p], vertices[q]).add(out, &(d[p] * d[q].transpose() * scale));
            }
        }
    }

    /// The same for the corners of a face.
    fn add_face_square(&self, out: &mut [f64], face: FaceId, d: [Vec3; 3], scale: f64) {
        let mut cells = self.face_cells[face.index()].iter();
        for p in 0..3 {
            for (q, cell) in (0..=p).zip(&mut cells) {
                cell.add(out, &(d[p] * d[q].transpose() * scale));
            }
        }
    }

    /// The model at the positions of `mesh`.
    pub(super) fn assemble(
        &self,
        mesh: &TriMesh,
        evaluator: &Evaluator,
        hold: Option<(&Fidelity, &[f64])>,
        out: &mut SymmetricMatrix,
    ) {
        let weights = evaluator.weights();
        let out = out.values_mut();
        out.fill(0.0);
        let faces: Vec<Face> = (0..mesh.face_count())
            .into_par_iter()
            .with_min_len(STARS)
            .map(|f| Face::of(mesh, FaceId::new(f)))
            .collect();
        self.add_stars(out, mesh, &faces, evaluator);
        for v in mesh.vertices().filter(|&v| weights.defect > 0.0 && !mesh.is_boundary_vertex(v)) {
            self.add_defect(out, mesh, v, &faces, weights.defect);
        }
        for (f, face) in mesh.faces().zip(&faces) {
            for c in 0..3 {
                let (_, slope) = barrier::ANGLE.root(face.angles[c]);
                if slope != 0.0 && weights.angle > 0.0 {
                    let gradient = face.angle_gradient(c);
                    let gradient = [0, 1, 2].map(|k| gradient[(k + 3 - c) % 3]);
                    self.add_face_square(out, f, gradient, 2.0 * weights.angle * slope * slope);
                }
            }
            if weights.area > 0.0 {
                let ratio = face.area * evaluator.inverse_rest_area(f);
                self.add_face_square(out, f, face.lift, weights.area * (ratio + 1.0 / ratio));
            }
        }
        if weights.fold > 0.0 {
            for e in mesh.edges() {
                self.add_fold(out, mesh, e, &faces, weights.fold);
            }
        }
        if let Some((hold, x)) = hold {
            hold.curvature(x, |face, _, coordinates, block| {
                let mut cells = self.face_cells[face.index()].iter();
                for p in 0..3 {
                    for (q, cell) in (0..=p).zip(&mut cells) {
                        cell.add(out, &(block * (coordinates[p] * coordinates[q])));
                    }
                }
            });
        }
    }

    /// Adds the model of a curve term at `x`.
    pub(super) fn add_curves(&self, curves: &Curves, x: &[f64], out: &mut SymmetricMatrix) {
        let out = out.values_mut();
        curves.curvature(x, |a, b, block| self.cell(a, b).add(out, block));
    }

    /// The energy: stars modelled in parallel, added in order.
    fn add_stars(&self, out: &mut [f64], mesh: &TriMesh, faces: &[Face], evaluator: &Evaluator) {
        let mut tasks: Vec<(Star, Vec<Matrix3<f64>>)> = Vec::new();
        tasks.resize_with(TASKS, Default::default);
        for batch in self.stars.chunks(STARS * TASKS) {
            tasks.iter_mut().for_each(|it| it.1.clear());
            tasks.par_iter_mut().zip(batch.par_chunks(STARS)).for_each(|((star, blocks), stars)| {
                for &(v, _) in stars {
                    star.gather(mesh, v, faces);
                    star.energy();
                    let scale = evaluator.loss_slope(star.lambda);
                    blocks.extend(star.blocks.iter().map(|block| block * scale));
                }
            });
            let blocks = tasks.iter().flat_map(|it| &it.1);
            let first = batch[0].1 as usize;
            for (cell, block) in self.star_cells[first..].iter().zip(blocks) {
                cell.add(out, block);
            }
        }
    }

    /// (|K| − 1.2)₊² where it acts.
    fn add_defect(&self, out: &mut [f64], mesh: &TriMesh, v: VertexId, faces: &[Face], weight: f64) {
        let angle = |h: HalfedgeId| faces[mesh.face(h).index()].angles[h.index() % 3];
        let defect = std::f64::consts::TAU - mesh.outgoing(v).map(angle).sum::<f64>();
        if weight == 0.0 || defect.abs() <= barrier::DEFECT {
            return;
        }
        let mut d: std::collections::BTreeMap<u32, Vec3> = std::collections::BTreeMap::new();
        for h in mesh.outgoing(v) {
            let (face, c) = (&faces[mesh.face(h).index()], h.index() % 3);
            for (k, g) in face.angle_gradient(c).into_iter().enumerate() {
                *d.entry(face.vertices[(c + k) % 3]).or_default() += g;
            }
        }
        for (&a, x) in &d {
            for (&b, y) in d.range(..=a) {
                self.cell(a, b).add(out, &(x * y.transpose() * (2.0 * weight)));
            }
        }
    }

    /// b(N1·N2)² where it acts.
    fn add_fold(&self, out: &mut [f64], mesh: &TriMesh, e: EdgeId, faces: &[Face], weight: f64) {
        let Some((sides, vertices)) = flap(mesh, e) else { return };
        let [f, g] = sides.map(|f| &faces[f.index()]);
        let (_, slope) = barrier::FOLD.root(f.normal.dot(&g.normal));
        if slope == 0.0 {
            return;
        }
        let mut d = [Vec3::zeros(); 4];
        for (face, other) in [(f, g), (g, f)] {
            for k in 0..3 {
                let at = vertices.iter().position(|v| v.0 == face.vertices[k]).expect("a flap holds both its faces");
                d[at] -= face.normal * face.lift[k].dot(&other.normal);
            }
        }
        self.add_square(out, vertices.map(|v| v.0), d, 2.0 * weight * slope * slope);
    }
}

/// The two faces of an inner edge and their four vertices.
fn flap(mesh: &TriMesh, e: EdgeId) -> Option<([FaceId; 2], [VertexId; 4])> {
    let h = mesh.halfedge(e);
    let twin = mesh.twin(h)?;
    let vertices = [mesh.tail(h), mesh.head(h), mesh.tail(mesh.previous(h)), mesh.tail(mesh.previous(twin))];
    Some(([mesh.face(h), mesh.face(twin)], vertices))
}

/// One corner of a star: N, θ, ∂⟨·, N⟩ and ∂θ by centre, near and far neighbour.
struct StarCorner {
    normal: Vec3,
    angle: f64,
    lift: [Vec3; 3],
    angle_gradient: [Vec3; 3],
}

/// The dense model of one star.
#[derive(Default)]
struct Star {
    corners: Vec<StarCorner>,
    /// Lower triangle of 3 × 3 blocks over the centre, then its neighbours counter-clockwise.
    blocks: Vec<Matrix3<f64>>,
    /// g_1, g_2.
    turns: [Vec<Vec3>; 2],
    /// λ.
    lambda: f64,
}

impl Star {
    fn gather(&mut self, mesh: &TriMesh, v: VertexId, faces: &[Face]) {
        self.corners.clear();
        for h in mesh.outgoing(v) {
            let (face, c) = (&faces[mesh.face(h).index()], h.index() % 3);
            self.corners.push(StarCorner {
                normal: face.normal,
                angle: face.angles[c],
                lift: [c, (c + 1) % 3, (c + 2) % 3].map(|k| face.lift[k]),
                angle_gradient: face.angle_gradient(c),
            });
        }
    }

    /// Fills the blocks for the covariance energy.
    fn energy(&mut self) {
        let n = self.corners.len();
        self.blocks.clear();
        self.blocks.resize((n + 1) * (n + 2) / 2, Matrix3::zeros());
        let mut a = [[0.0; 3]; 3];
        for corner in &self.corners {
            for i in 0..3 {
                (0..3).for_each(|k| a[i][k] += corner.angle * corner.normal[i] * corner.normal[k]);
            }
        }
        let (values, vectors) = jacobi(a);
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &k| values[i].total_cmp(&values[k]));
        let [u, t1, t2] = order.map(|i| Vec3::from(vectors[i]));
        let lambda = values[order[0]].max(0.0);
        self.lambda = lambda;
        for turn in &mut self.turns {
            turn.clear();
            turn.resize(n + 1, Vec3::zeros());
        }
        for (k, corner) in self.corners.iter().enumerate() {
            let root = corner.angle.sqrt();
            let height = u.dot(&corner.normal);
            let local = [0, 1 + k, 1 + (k + 1) % n];
            let row: [Vec3; 3] = std::array::from_fn(|i| {
                corner.normal * (-root * u.dot(&corner.lift[i])) + corner.angle_gradient[i] * (0.5 * height / root)
            });
            for p in 0..3 {
                for q in 0..3 {
                    if local[p] >= local[q] {
                        let at = local[p] * (local[p] + 1) / 2 + local[q];
                        self.blocks[at] += row[p] * row[q].transpose() * 2.0;
                    }
                }
            }
            for (turn, t) in self.turns.iter_mut().zip([t1, t2]) {
                let factor = root * t.dot(&corner.normal);
                for p in 0..3 {
                    turn[local[p]] += row[p] * factor;
                }
            }
        }
        for (turn, i) in self.turns.iter().zip([1, 2]) {
            let scale = -2.0 / (values[order[i]] + lambda + FLAT);
            for p in 0..=n {
                let scaled = turn[p] * scale;
                for q in 0..=p {
                    self.blocks[p * (p + 1) / 2 + q] += scaled * turn[q].transpose();
                }
            }
        }
    }
}
