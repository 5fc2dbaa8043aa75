//! Energy, barriers and their exact gradient over a mesh of fixed connectivity.
//!
//! Four passes, each over blocks of fixed size whose results are gathered, never scattered, so that the sums do not depend
//! on the number of threads: faces → (N, θ, …) per corner; stars → derivatives by N and θ per corner; faces → gradient per
//! corner; vertices → gradient. No pass allocates.
//!
//! Notation: halfedge k of a face runs along e_k from corner k to corner k + 1; s_k = N × e_k; doubled area 2A.
//!   ∂θ_k = s_k/|e_k|² + s_{k+2}/|e_{k+2}|² by corner k itself, −s_k/|e_k|² by corner k + 1, −s_{k+2}/|e_{k+2}|² by k + 2
//!   ∂N for a move of corner k = −s_{k+1}/(2A) ⟨N, ·⟩;  ∂ ln A = s_{k+1}/(2A) by corner k
use super::{
    barrier::{self, Weights},
    energy::{Corner, Energy, Pull, Work},
    robust::Robust,
};
use crate::{
    geom::Vec3,
    mesh::{FaceId, Id, TriMesh, VertexId},
    numeric::lanes::{LANES, Lanes, Lanes3, vectorized},
};
use rayon::prelude::*;

/// Face groups per block of the face passes (2048 faces).
const GROUPS: usize = 256;
/// Slots per block of the star pass (about 1000 vertices of valence 6), raised where one star does not fit.
const SLOTS: usize = 8192;
/// Vertices per block of the gather.
const VERTICES: usize = 1024;

/// What a pass over all stars reads and writes; [`StarPass::run`] applies the energy of one star to all of them.
pub(super) struct StarPass<'a> {
    layout: &'a Layout,
    /// [N, θ] per corner.
    corners: &'a [[f64; 4]],
    /// Doubled area per face, per group.
    areas2: &'a [Lanes],
    out: &'a mut StarData,
    defect_weight: f64,
    robust: Option<Robust>,
}

/// Connectivity, arranged for the passes.
#[derive(Debug)]
pub(super) struct Layout {
    vertices: usize,
    faces: usize,
    /// Vertices of the corners of [`LANES`] faces; the last group repeats its last face.
    corners: Vec<[[u32; LANES]; 3]>,
    /// First corner of the face across each halfedge; its own face on the boundary.
    across: Vec<u32>,
    /// Row of [`StarData::slots`] that holds the pull on each corner; the last, always zero, for boundary vertices.
    slot_of: Vec<u32>,
    blocks: Vec<Block>,
    slots_per_block: usize,
    /// Corners around each vertex, by [`Layout::first_corner`].
    corners_of: Vec<u32>,
    first_corner: Vec<u32>,
}

/// Stars whose slots lie in one chunk of [`StarData::slots`].
#[derive(Debug, Default)]
struct Block {
    batches: Vec<Batch>,
    valence: usize,
}

/// Up to [`LANES`] interior stars of one valence.
#[derive(Debug)]
struct Batch {
    valence: usize,
    /// Centres; unused lanes repeat the last one.
    vertices: [u32; LANES],
    lanes: usize,
    /// Corner `k` of lane `i`, counter-clockwise, at `k * LANES + i`.
    corners: Vec<u32>,
    /// Its first slot within the block: one row of [λ, K, 0, 0], then `valence` rows of pulls.
    slot: usize,
}

/// What the star pass writes.
#[derive(Debug)]
pub(super) struct StarData {
    /// Per star [λ, K, 0, 0], per corner [∂/∂N, ∂/∂θ].
    slots: Vec<[f64; 4]>,
    /// ∂/∂ ln A per row of [`StarData::slots`]; one idle row per block where the energy does not depend on areas.
    area_slots: Vec<f64>,
    /// (Σλ, defect barrier, Σ(ρ − λ)) of each block.
    partials: Vec<[f64; 3]>,
    scratch: Vec<Scratch>,
}

/// Room for one batch, per block.
#[derive(Debug)]
struct Scratch {
    corners: Vec<Corner>,
    pulls: Vec<Pull>,
    work: Work,
}

impl Scratch {
    fn new(energy: &Energy, valence: usize) -> Self {
        let (corners, pulls) = (vec![Corner::default(); valence], vec![Pull::default(); valence]);
        Self { corners, pulls, work: Work::new(energy, valence) }
    }
}

/// What the first face pass leaves for the second.
#[derive(Debug, Clone, Default)]
struct FaceGroup {
    normal: Lanes3,
    spin: [Lanes3; 3],
    /// 1/|e_k|².
    inverse_length2: [Lanes; 3],
    /// 1/(2A).
    inverse_area2: Lanes,
    /// Derivative of the angle barrier by θ_k.
    angle_pull: [Lanes; 3],
    /// Derivative of the area term by ln A.
    area_pull: Lanes,
}

/// Values of the parts of the objective, weights included.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Parts {
    /// Σ λ over interior vertices of valence > 3, unweighted.
    pub energy: f64,
    /// Σ ρ(λ) − λ of the robust loss, not positive; 0 without one.
    pub relief: f64,
    /// Angle barrier.
    pub angle: f64,
    /// Fold barrier.
    pub fold: f64,
    /// Angle-defect barrier.
    pub defect: f64,
    /// Area term.
    pub area: f64,
}

impl Parts {
    /// Sum.
    pub fn total(&self) -> f64 {
        self.energy + self.relief + self.angle + self.fold + self.defect + self.area
    }
}

/// Evaluates energy and barriers.
#[derive(Debug)]
pub struct Evaluator {
    layout: Layout,
    energy: &'static Energy,
    weights: Weights,
    robust: Option<Robust>,
    /// Reciprocal reference area of each face, per group.
    inverse_rest_area: Vec<Lanes>,
    groups: Vec<FaceGroup>,
    /// [N, θ] per corner.
    corners: Vec<[f64; 4]>,
    /// Doubled area per face, per group.
    areas2: Vec<Lanes>,
    stars: StarData,
    /// Gradient per corner.
    pushes: Vec<[f64; 4]>,
    /// (angle, area) and (fold) barrier sums of each block of faces.
    partials: Vec<[f64; 3]>,
}

impl Layout {
    /// Arranges the connectivity of `mesh`.
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let faces = mesh.face_count();
        let corners = (0..faces.div_ceil(LANES))
            .map(|g| {
                let face = |i: usize| mesh.face_vertices(Id::new((g * LANES + i).min(faces - 1)));
                std::array::from_fn(|k| std::array::from_fn(|i| face(i)[k].0))
            })
            .collect();
        let across = mesh.halfedges().map(|h| 3 * mesh.face(mesh.twin(h).unwrap_or(h)).0).collect();
        let mut first_corner = vec![0];
        let mut corners_of = Vec::with_capacity(mesh.halfedge_count());
        for v in mesh.vertices() {
            corners_of.extend(mesh.outgoing(v).map(|h| h.0));
            first_corner.push(corners_of.len() as u32);
        }
        let mut layout = Self {
            vertices: mesh.vertex_count(),
            faces,
            corners,
            across,
            slot_of: Vec::new(),
            blocks: Vec::new(),
            slots_per_block: 0,
            corners_of,
            first_corner,
        };
        layout.arrange_stars(mesh);
        layout
    }

    /// Sorts interior stars by valence into batches, batches into blocks.
    fn arrange_stars(&mut self, mesh: &TriMesh) {
        let mut order: Vec<(usize, VertexId)> =
            mesh.vertices().filter(|&v| !mesh.is_boundary_vertex(v)).map(|v| (mesh.face_degree(v), v)).collect();
        order.sort_unstable();
        let widest = order.last().map_or(0, |it| it.0);
        self.slots_per_block = SLOTS.max((widest + 1) * LANES);
        self.slot_of = vec![u32::MAX; mesh.halfedge_count()];
        let mut used = self.slots_per_block;
        for stars in order.chunk_by(|a, b| a.0 == b.0).flat_map(|run| run.chunks(LANES)) {
            let valence = stars[0].0;
            let needed = (valence + 1) * LANES;
            if used + needed > self.slots_per_block {
                self.blocks.push(Block::default());
                used = 0;
            }
            let base = (self.blocks.len() - 1) * self.slots_per_block + used + LANES;
            let mut corners = vec![0; valence * LANES];
            for lane in 0..LANES {
                let v = stars[lane.min(stars.len() - 1)].1;
                for (k, h) in mesh.outgoing(v).enumerate() {
                    corners[k * LANES + lane] = h.0;
                    if lane < stars.len() {
                        self.slot_of[h.index()] = (base + k * LANES + lane) as u32;
                    }
                }
            }
            let vertices = std::array::from_fn(|lane| stars[lane.min(stars.len() - 1)].1.0);
            let block = self.blocks.last_mut().expect("pushed above when none had room");
            block.batches.push(Batch { valence, vertices, lanes: stars.len(), corners, slot: used });
            block.valence = block.valence.max(valence);
            used += needed;
        }
        let zero = (self.blocks.len() * self.slots_per_block) as u32;
        self.slot_of.iter_mut().filter(|slot| **slot == u32::MAX).for_each(|slot| *slot = zero);
    }
}

impl Evaluator {
    /// For meshes of the connectivity of `mesh`. The area term compares with the geometric mean of a face's own area and
    /// the mean area in `mesh`.
    pub fn new(mesh: &TriMesh, energy: &'static Energy, weights: Weights) -> Self {
        let layout = Layout::new(mesh);
        let mean = mesh.total_area() / mesh.face_count() as f64;
        let groups = layout.corners.len();
        let inverse_rest_area = (0..groups)
            .map(|g| {
                Lanes::from_fn(|i| {
                    let area = mesh.area(Id::new((g * LANES + i).min(layout.faces - 1)));
                    1.0 / (area * mean).sqrt()
                })
            })
            .collect();
        let slots = layout.blocks.len() * layout.slots_per_block + 1;
        let scratch = layout.blocks.iter().map(|it| Scratch::new(energy, it.valence));
        let stars = StarData {
            slots: vec![[0.0; 4]; slots],
            area_slots: vec![0.0; if energy.areas { slots } else { layout.blocks.len() }],
            partials: vec![[0.0; 3]; layout.blocks.len()],
            scratch: scratch.collect(),
        };
        Self {
            energy,
            weights,
            robust: None,
            inverse_rest_area,
            groups: vec![FaceGroup::default(); groups],
            corners: vec![[0.0; 4]; groups * LANES * 3],
            areas2: vec![Lanes::default(); groups],
            stars,
            pushes: vec![[0.0; 4]; groups * LANES * 3],
            partials: vec![[0.0; 3]; groups.div_ceil(GROUPS)],
            layout,
        }
    }

    /// Values at positions `x` (three per vertex); `gradient` is overwritten. A degenerate face gives NaN.
    pub fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> Parts {
        assert_eq!(x.len(), 3 * self.layout.vertices);
        assert_eq!(gradient.len(), x.len());
        self.face_pass(x);
        (self.energy.pass)(StarPass {
            layout: &self.layout,
            corners: &self.corners,
            areas2: &self.areas2,
            out: &mut self.stars,
            defect_weight: self.weights.defect,
            robust: self.robust,
        });
        self.push_pass();
        self.gather_pass(gradient);
        let mut parts = Parts::default();
        for [energy, defect, relief] in &self.stars.partials {
            parts.energy += energy;
            parts.defect += defect;
            parts.relief += relief;
        }
        for [angle, area, fold] in &self.partials {
            parts.angle += angle;
            parts.area += area;
            parts.fold += fold;
        }
        parts
    }

    /// From now on energies go through ρ(λ) = σ ln(1 + λ/σ), or not.
    pub(super) fn set_robust(&mut self, sigma: Option<f64>) {
        self.robust = sigma.map(|sigma| Robust { sigma });
    }

    /// Derivative of the loss by the energy λ of a vertex.
    pub(super) fn loss_slope(&self, lambda: f64) -> f64 {
        self.robust.map_or(1.0, |it| it.slope(lambda))
    }

    /// Normal of a face at the positions of the latest evaluation.
    pub(super) fn normal(&self, face: FaceId) -> Vec3 {
        let [x, y, z, _] = self.corners[3 * face.index()];
        Vec3::new(x, y, z)
    }

    /// Weights of the barriers.
    pub(super) fn weights(&self) -> &Weights {
        &self.weights
    }

    /// Reciprocal of the area that the area term compares with.
    pub(super) fn inverse_rest_area(&self, face: FaceId) -> f64 {
        self.inverse_rest_area[face.index() / LANES].0[face.index() % LANES]
    }

    /// λ per vertex at the positions of the latest evaluation; 0 where the energy has no term.
    pub fn energies(&self) -> Vec<f64> {
        self.rows(0)
    }

    /// Value `column` of the first row of each star.
    fn rows(&self, column: usize) -> Vec<f64> {
        let mut out = vec![0.0; self.layout.vertices];
        for (b, block) in self.layout.blocks.iter().enumerate() {
            for batch in &block.batches {
                for lane in 0..batch.lanes {
                    let slot = b * self.layout.slots_per_block + batch.slot + lane;
                    out[batch.vertices[lane] as usize] = self.stars.slots[slot][column];
                }
            }
        }
        out
    }

    fn face_pass(&mut self, x: &[f64]) {
        let (layout, weights, rest) = (&self.layout, self.weights, &self.inverse_rest_area);
        self.groups
            .par_chunks_mut(GROUPS)
            .zip(self.corners.par_chunks_mut(GROUPS * LANES * 3))
            .zip(self.areas2.par_chunks_mut(GROUPS))
            .zip(&mut self.partials)
            .enumerate()
            .for_each(|(b, (((groups, corners), areas2), partial))| {
                vectorized(
                    #[inline(always)]
                    || {
                        *partial = [0.0; 3];
                        for (i, group) in groups.iter_mut().enumerate() {
                            let g = b * GROUPS + i;
                            let active = (layout.faces - g * LANES).min(LANES);
                            let out = &mut corners[i * LANES * 3..][..LANES * 3];
                            let [angle, area] =
                                face_group(x, &layout.corners[g], rest[g], &weights, group, out, &mut areas2[i]);
                            partial[0] += angle.0[..active].iter().sum::<f64>();
                            partial[1] += area.0[..active].iter().sum::<f64>();
                        }
                    },
                );
            });
    }

    fn push_pass(&mut self) {
        let (layout, corners, weight) = (&self.layout, &self.corners, self.weights.fold);
        let (slots, area_slots, areas) = (&self.stars.slots, &self.stars.area_slots, self.energy.areas);
        self.groups
            .par_chunks(GROUPS)
            .zip(self.pushes.par_chunks_mut(GROUPS * LANES * 3))
            .zip(&mut self.partials)
            .enumerate()
            .for_each(|(b, ((groups, pushes), partial))| {
                vectorized(
                    #[inline(always)]
                    || {
                        for (i, group) in groups.iter().enumerate() {
                            let first = (b * GROUPS + i) * LANES;
                            let active = (layout.faces - first).min(LANES);
                            let mut pull: [[[f64; 4]; 3]; LANES] = [[[0.0; 4]; 3]; LANES];
                            for (lane, pull) in pull.iter_mut().enumerate().take(active) {
                                for (k, pull) in pull.iter_mut().enumerate() {
                                    *pull = slots[layout.slot_of[3 * (first + lane) + k] as usize];
                                }
                            }
                            let out = &mut pushes[i * LANES * 3..][..LANES * 3];
                            let mut normal_pull = Lanes3::default();
                            let mut angle_pull = group.angle_pull;
                            for (i, [p, q, r]) in pull.iter().enumerate() {
                                for c in 0..3 {
                                    normal_pull.0[c].0[i] = p[c] + q[c] + r[c];
                                }
                                angle_pull[0].0[i] += p[3];
                                angle_pull[1].0[i] += q[3];
                                angle_pull[2].0[i] += r[3];
                            }
                            if weight > 0.0 {
                                partial[2] +=
                                    fold_pull(layout, corners, first, active, group.normal, weight, &mut normal_pull);
                            }
                            let mut area_pull = group.area_pull;
                            if areas {
                                for i in 0..active {
                                    for &slot in &layout.slot_of[3 * (first + i)..][..3] {
                                        area_pull.0[i] += area_slots[slot as usize];
                                    }
                                }
                            }
                            push_group(group, normal_pull, angle_pull, area_pull, out);
                        }
                    },
                );
            });
    }

    fn gather_pass(&self, gradient: &mut [f64]) {
        let (layout, pushes) = (&self.layout, &self.pushes);
        gradient.par_chunks_mut(3 * VERTICES).enumerate().for_each(|(b, out)| {
            vectorized(
                #[inline(always)]
                || {
                    for (i, out) in out.chunks_exact_mut(3).enumerate() {
                        let v = b * VERTICES + i;
                        let (from, to) = (layout.first_corner[v] as usize, layout.first_corner[v + 1] as usize);
                        let mut sum = [0.0; 4];
                        for &corner in &layout.corners_of[from..to] {
                            let push = &pushes[corner as usize];
                            for c in 0..4 {
                                sum[c] += push[c];
                            }
                        }
                        out.copy_from_slice(&sum[..3]);
                    }
                },
            );
        });
    }
}

/// One position per lane.
#[inline(always)]
fn positions(x: &[f64], vertices: &[u32; LANES]) -> Lanes3 {
    Lanes3::from_fn(
        #[inline(always)]
        |i| {
            let at = 3 * vertices[i] as usize;
            [x[at], x[at + 1], x[at + 2]]
        },
    )
}

/// Geometry and barriers of one group of faces; returns the values of the angle and area terms.
#[inline(always)]
fn face_group(
    x: &[f64],
    vertices: &[[u32; LANES]; 3],
    inverse_rest_area: Lanes,
    weights: &Weights,
    group: &mut FaceGroup,
    corners: &mut [[f64; 4]],
    area2_out: &mut Lanes,
) -> [Lanes; 2] {
    let one = Lanes::splat(1.0);
    let [p0, p1, p2] = [positions(x, &vertices[0]), positions(x, &vertices[1]), positions(x, &vertices[2])];
    let edges = [p1 - p0, p2 - p1, p0 - p2];
    let area_vector = edges[0].cross(edges[1]);
    let area2 = area_vector.dot(area_vector).sqrt();
    *area2_out = area2;
    let inverse_area2 = one / area2;
    let normal = area_vector.scale(inverse_area2);
    group.normal = normal;
    group.inverse_area2 = inverse_area2;
    for k in 0..3 {
        group.spin[k] = normal.cross(edges[k]);
        group.inverse_length2[k] = one / edges[k].dot(edges[k]);
    }
    let first = Lanes::atan2_upper(area2, -edges[0].dot(edges[2]));
    let second = Lanes::atan2_upper(area2, -edges[1].dot(edges[0]));
    let angles = [first, second, Lanes::splat(std::f64::consts::PI) - first - second];
    for i in 0..LANES {
        let [nx, ny, nz] = normal.lane(i);
        for k in 0..3 {
            corners[3 * i + k] = [nx, ny, nz, angles[k].0[i]];
        }
    }
    let mut values = [Lanes::default(); 2];
    if weights.angle > 0.0 {
        let weight = Lanes::splat(weights.angle);
        for k in 0..3 {
            let (value, slope) = barrier::ANGLE.at_lanes(angles[k]);
            values[0] += weight * value;
            group.angle_pull[k] = weight * slope;
        }
    }
    if weights.area > 0.0 {
        let weight = Lanes::splat(weights.area);
        let ratio = Lanes::splat(0.5) * area2 * inverse_rest_area;
        let inverse = one / ratio;
        values[1] = weight * (ratio + inverse - Lanes::splat(2.0));
        group.area_pull = weight * (ratio - inverse);
    }
    values
}

/// Adds the fold barrier of the three edges of each face to the pull on its normal; returns half its value, because each
/// edge is met from both sides.
#[inline(always)]
fn fold_pull(
    layout: &Layout,
    corners: &[[f64; 4]],
    first: usize,
    active: usize,
    normal: Lanes3,
    weight: f64,
    pull: &mut Lanes3,
) -> f64 {
    let mut sum = 0.0;
    for k in 0..3 {
        let other = Lanes3::from_fn(
            #[inline(always)]
            |i| {
                let face = (first + i).min(layout.faces - 1);
                let [x, y, z, _] = corners[layout.across[3 * face + k] as usize];
                [x, y, z]
            },
        );
        let cosine = normal.dot(other);
        if !cosine.any_lt(Lanes::splat(barrier::FOLD.start())) {
            continue;
        }
        let (value, slope) = barrier::FOLD.at_lanes(cosine);
        *pull += other.scale(Lanes::splat(weight) * slope);
        sum += 0.5 * weight * value.0[..active].iter().sum::<f64>();
    }
    sum
}

/// Gradient of each corner from the pulls on normal, angles and area of its face.
#[inline(always)]
fn push_group(group: &FaceGroup, normal_pull: Lanes3, angle_pull: [Lanes; 3], area_pull: Lanes, out: &mut [[f64; 4]]) {
    // ∂E/∂θ_k − ∂E/∂θ_{k+1} turns along halfedge k.
    let mut turns = [Lanes3::default(); 3];
    for k in 0..3 {
        turns[k] = group.spin[k].scale((angle_pull[k] - angle_pull[(k + 1) % 3]) * group.inverse_length2[k]);
    }
    for k in 0..3 {
        let opposite = group.spin[(k + 1) % 3].scale(group.inverse_area2);
        let tilt = group.normal.scale(normal_pull.dot(opposite));
        let push = turns[k] - turns[(k + 2) % 3] + opposite.scale(area_pull) - tilt;
        for i in 0..LANES {
            let [x, y, z] = push.lane(i);
            out[3 * i + k] = [x, y, z, 0.0];
        }
    }
}

impl StarPass<'_> {
    /// Applies `star` to every batch and adds the defect barrier. The areas of the corners are given, and the pulls on them
    /// taken, only with `AREAS`.
    pub(super) fn run<const AREAS: bool>(self, star: impl Fn(&[Corner], &mut [Pull], &mut Work) -> Lanes + Sync) {
        let Self { layout, corners, areas2, out, defect_weight, robust } = self;
        let StarData { slots, area_slots, partials, scratch } = out;
        let rows = layout.slots_per_block.max(1);
        layout
            .blocks
            .par_iter()
            .zip(slots.par_chunks_mut(rows))
            .zip(area_slots.par_chunks_mut(if AREAS { rows } else { 1 }))
            .zip(partials)
            .zip(scratch)
            .for_each(|((((block, slots), area_slots), partial), scratch)| {
                vectorized(
                    #[inline(always)]
                    || {
                        *partial = [0.0; 3];
                        for batch in &block.batches {
                            let n = batch.valence;
                            let (gathered, pulls) = (&mut scratch.corners[..n], &mut scratch.pulls[..n]);
                            let defect = gather_batch::<AREAS>(batch, corners, areas2, gathered);
                            // Valence 3 is left free (SGC section 4.1.4, triple points): it could only be flat.
                            let lambda = if n > 3 {
                                star(gathered, pulls, &mut scratch.work)
                            } else {
                                pulls.fill(Pull::default());
                                Lanes::default()
                            };
                            partial[0] += lambda.0[..batch.lanes].iter().sum::<f64>();
                            if let Some(robust) = robust {
                                let relief = robust.soften(lambda, pulls);
                                partial[2] += relief.0[..batch.lanes].iter().sum::<f64>();
                            }
                            let mut turn = Lanes::default();
                            if defect_weight > 0.0 {
                                let (value, slope) = defect_barrier(defect, defect_weight);
                                turn = slope;
                                partial[1] += value.0[..batch.lanes].iter().sum::<f64>();
                            }
                            let rows = &mut slots[batch.slot..][..(n + 1) * LANES];
                            for i in 0..LANES {
                                rows[i] = [lambda.0[i], defect.0[i], 0.0, 0.0];
                            }
                            for (k, pull) in pulls.iter().enumerate() {
                                let angle = pull.angle - turn;
                                for i in 0..LANES {
                                    let [x, y, z] = pull.normal.lane(i);
                                    rows[(k + 1) * LANES + i] = [x, y, z, angle.0[i]];
                                }
                            }
                            if AREAS {
                                let rows = &mut area_slots[batch.slot + LANES..][..n * LANES];
                                for (row, pull) in rows.chunks_exact_mut(LANES).zip(pulls.iter()) {
                                    row.copy_from_slice(&pull.area.0);
                                }
                            }
                        }
                    },
                );
            });
    }
}

/// Collects the corners of the stars of a batch; returns their angle defects.
#[inline(always)]
fn gather_batch<const AREAS: bool>(
    batch: &Batch,
    corners: &[[f64; 4]],
    areas2: &[Lanes],
    gathered: &mut [Corner],
) -> Lanes {
    let mut defect = Lanes::splat(std::f64::consts::TAU);
    for (k, corner) in gathered.iter_mut().enumerate() {
        for (i, &at) in batch.corners[k * LANES..][..LANES].iter().enumerate() {
            let [x, y, z, angle] = corners[at as usize];
            corner.normal.0[0].0[i] = x;
            corner.normal.0[1].0[i] = y;
            corner.normal.0[2].0[i] = z;
            corner.angle.0[i] = angle;
            if AREAS {
                let face = at as usize / 3;
                corner.area2.0[i] = areas2[face / LANES].0[face % LANES];
            }
        }
        defect = defect - corner.angle;
    }
    defect
}

/// weight · (|K| − 1.2)₊² and its derivative by K.
#[inline(always)]
fn defect_barrier(defect: Lanes, weight: f64) -> (Lanes, Lanes) {
    let zero = Lanes::default();
    let excess = defect.abs() - Lanes::splat(barrier::DEFECT);
    let excess = zero.lt_select(excess, excess, zero);
    let signed = defect.lt_select(zero, -excess, excess);
    (Lanes::splat(weight) * excess * excess, Lanes::splat(2.0 * weight) * signed)
}
