//! Kanai's hierarchical system: a progressive mesh down to a tetrahedron, and back up with every face kept.
//!
//! On the way up every vertex split is placed in the kernel of the star, relaxed by the vertex Tutte step, and whenever the
//! mesh has doubled, the whole map is relaxed by the vertex conformal step in the order of what each gains, and centred.
//! Both steps have a closed form: for fixed neighbours F is linear in y_v on the sphere, with its minimum at
//! Σ w y_u / |Σ w y_u|, whatever the signs of the weights; the Tutte step has all weights 1.
use std::{cmp::Reverse, collections::BinaryHeap};

use super::{
    SphereError,
    centre::centre,
    certify::is_positive,
    relax,
    surface::{Surface, corner_cotangents},
};
use crate::{
    geom::Vec3,
    mesh::{HalfedgeId, Id, TriMesh, VertexId},
    numeric::Monitor,
    surface::{collapse::EdgeQueue, edit::EditMesh},
};

/// A step may not leave a face thinner than this (twice its area over its longest side squared), unless one around the vertex
/// was thinner before: without a margin later splits find no room.
const SLIVER: f64 = 2e-3;
/// A conformal step may not make a face smaller than this, so that what is split off later finds room in double precision.
const SMALLEST: f64 = 1e-9;
/// Halvings of a step that would leave the kernel.
const HALVINGS: usize = 6;
/// Rounds of Tutte steps of both vertices after a split.
const ROUNDS: usize = 2;
/// The queue ends at a gain of this share of F, divided by the number of vertices.
const ENOUGH: f64 = 1e-5;
/// Steps per vertex between two centrings, and centrings per level.
const STEPS: usize = 3;
const PASSES: usize = 6;

/// A map without flipped faces, and how many vertices the smallest size held back.
pub(super) fn map(mesh: &TriMesh, surface: &Surface, monitor: &Monitor) -> Result<(Vec<Vec3>, usize), SphereError> {
    let mut work = Hierarchy {
        edit: EditMesh::new(mesh),
        y: vec![Vec3::x(); mesh.vertex_count()],
        mass: surface.mass.clone(),
        held: 0,
    };
    let collapses = work.coarsen(monitor)?;
    work.start();
    let total = mesh.vertex_count();
    let mut next = 8;
    for (k, &Collapse { h, u, mass }) in collapses.iter().rev().enumerate() {
        let v = work.split(h, u, mesh.position(u), mass);
        if !work.place(u, v) {
            return Err(SphereError::NoRoom { vertex: u, place: mesh.position(u), placed: k + 4, total });
        }
        if work.edit.vertex_count() >= next || work.edit.vertex_count() == total {
            monitor.progress(work.edit.vertex_count() as f64 / total as f64, "mapping to the sphere");
            next = 2 * work.edit.vertex_count();
            work.relax(monitor)?;
        }
        if k % 256 == 0 {
            monitor.check()?;
        }
    }
    Ok((work.y, work.held))
}

/// A half-edge collapse: the halfedge, its tail, which goes, and the source area that goes with it.
struct Collapse {
    h: HalfedgeId,
    u: VertexId,
    mass: f64,
}

struct Hierarchy {
    edit: EditMesh,
    y: Vec<Vec3>,
    /// Source area of a vertex and of what collapsed into it; 0 for collapsed vertices.
    mass: Vec<f64>,
    /// Vertices that the smallest size held back in the last relaxation.
    held: usize,
}

impl Hierarchy {
    /// Half-edge collapses to a tetrahedron, shortest edges first.
    fn coarsen(&mut self, monitor: &Monitor) -> Result<Vec<Collapse>, SphereError> {
        let mut queue = EdgeQueue::default();
        let mut out = Vec::new();
        while self.edit.vertex_count() > 4 {
            // Every triangulated sphere but the tetrahedron has an edge that can collapse (Steinitz).
            let Some((_, mut h)) = queue.pop() else {
                monitor.check()?;
                for h in self.edit.edges().collect::<Vec<_>>() {
                    queue.set(&self.edit, h, self.price(h));
                }
                continue;
            };
            if !self.edit.can_collapse(h) {
                continue;
            }
            if let Some(twin) = self.edit.twin(h)
                && self.edit.valence(self.edit.tail(twin)) < self.edit.valence(self.edit.tail(h))
            {
                h = twin;
            }
            let (u, v) = (self.edit.tail(h), self.edit.head(h));
            queue.remove_for_collapse(&self.edit, h);
            self.edit.collapse(h, self.edit.position(v));
            let mass = std::mem::take(&mut self.mass[u.index()]);
            self.mass[v.index()] += mass;
            out.push(Collapse { h, u, mass });
            for spoke in self.edit.spokes(v).collect::<Vec<_>>() {
                queue.set(&self.edit, spoke, self.price(spoke));
            }
            if out.len() % 1024 == 0 {
                monitor.check()?;
            }
        }
        Ok(out)
    }

    /// Squared length, more for edges whose collapse would leave a vertex of high valence.
    fn price(&self, h: HalfedgeId) -> f64 {
        let valence = self.edit.valence(self.edit.tail(h)) + self.edit.valence(self.edit.head(h)) - 4;
        let crowding = (valence as f64 / 6.0).max(1.0);
        self.edit.vector(h).norm_squared() * crowding * crowding
    }

    /// The tetrahedron on the sphere, with the orientation of the surface.
    fn start(&mut self) {
        let corners = [[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0]];
        for (v, corner) in self.edit.vertices().collect::<Vec<_>>().into_iter().zip(corners) {
            self.y[v.index()] = Vec3::from(corner).normalize();
        }
        let first = self.edit.faces().next().map(|f| self.edit.face_vertices(f));
        if let Some([a, b, c]) = first
            && !is_positive([a, b, c].map(|v| self.y[v.index()]))
        {
            self.y.swap(a.index(), b.index());
        }
    }

    /// Takes back a collapse; the vertex that had stayed.
    fn split(&mut self, h: HalfedgeId, u: VertexId, position: Vec3, mass: f64) -> VertexId {
        self.edit.undo_collapse(h, u, position);
        let v = self.edit.head(h);
        self.mass[v.index()] -= mass;
        self.mass[u.index()] = mass;
        v
    }

    /// The opposite edges of the faces around `v` on the sphere.
    fn fan(&self, v: VertexId) -> Vec<[Vec3; 2]> {
        let at = |v: VertexId| self.y[v.index()];
        self.edit.outgoing(v).map(|h| [at(self.edit.head(h)), at(self.edit.apex(h))]).collect()
    }

    /// Puts the new vertex `u` beside `v`, from which it was split, and relaxes both. Whether there was room.
    fn place(&mut self, u: VertexId, v: VertexId) -> bool {
        self.y[u.index()] = self.y[v.index()];
        if !self.step_aside(u, v) {
            return false;
        }
        for _ in 0..ROUNDS {
            for it in [u, v] {
                let sum: Vec3 = self.edit.neighbors(it).map(|w| self.y[w.index()]).sum();
                self.move_towards(it, sum, 0.0);
            }
        }
        true
    }

    /// Moves `u` from the place of `v` along the bisector of its sector: there every face that lies between them opens, and
    /// the others stay open for a while.
    fn step_aside(&mut self, u: VertexId, v: VertexId) -> bool {
        let p = self.y[v.index()];
        // Counter-clockwise around u: v, c, …, d.
        let around: Vec<Vec3> = self.edit.neighbors(u).filter(|&w| w != v).map(|w| self.y[w.index()]).collect();
        let (Some(c), Some(d)) = (around.first(), around.last()) else { return false };
        let tangent = |q: &Vec3| {
            let e = q - p;
            (e - e.dot(&p) * p).normalize()
        };
        let (from, to) = (tangent(c), tangent(d));
        let angle = f64::atan2(p.dot(&from.cross(&to)), from.dot(&to)).rem_euclid(std::f64::consts::TAU);
        let (sin, cos) = (0.5 * angle).sin_cos();
        let direction = cos * from + sin * p.cross(&from);
        // det(p + t direction, b, c) stays positive up to t.
        let room = around.windows(2).map(|it| {
            let normal = (it[0] - p).cross(&(it[1] - p));
            let (here, slope) = (p.dot(&normal), direction.dot(&it[0].cross(&it[1])));
            if slope < 0.0 { here / -slope } else { f64::INFINITY }
        });
        let nearest = around.iter().map(|q| (q - p).norm()).fold(f64::INFINITY, f64::min);
        let mut reach = 0.5 * room.fold(nearest.min(1.0), f64::min);
        for _ in 0..40 {
            self.y[u.index()] = (p + reach * direction).normalize();
            let open = |w: VertexId| self.fan(w).iter().all(|&[b, c]| is_positive([self.y[w.index()], b, c]));
            if open(u) && open(v) {
                return true;
            }
            reach *= 0.5;
        }
        false
    }

    /// Moves `v` towards a direction as far as its faces stay open and no thinner than [`SLIVER`] and no smaller than `smallest`.
    /// Whether it moved.
    fn move_towards(&mut self, v: VertexId, direction: Vec3, smallest: f64) -> bool {
        let Some(target) = direction.try_normalize(1e-12) else { return false };
        let fan = self.fan(v);
        let from = self.y[v.index()];
        let before = Shape::of(from, &fan);
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            // Differences first, which stay exact where everything is small.
            let to = (from + share * (target - from)).normalize();
            let after = Shape::of(to, &fan);
            let thick = after.thinnest >= SLIVER.min(before.thinnest);
            let large = after.smallest >= smallest.min(before.smallest);
            if thick && large && to != from && fan.iter().all(|&[b, c]| is_positive([to, b, c])) {
                self.y[v.index()] = to;
                return true;
            }
            share *= 0.5;
        }
        false
    }

    /// Σ w y_u with the true cotangents, and what the conformal step of `v` would lower F by.
    fn gain(&self, v: VertexId) -> (Vec3, f64) {
        let mut sum = Vec3::zeros();
        for h in self.edit.outgoing(v) {
            let corners = [h, self.edit.next(h), self.edit.previous(h)].map(|it| self.edit.tail(it));
            let [ab, _, ca] = corner_cotangents(corners.map(|it| self.edit.position(it)));
            sum += 0.5 * ab * self.y[corners[1].index()] + 0.5 * ca * self.y[corners[2].index()];
        }
        let y = self.y[v.index()];
        // |s| − s·y, without the cancellation where s is nearly along y.
        let along = sum.dot(&y);
        let across = (sum - along * y).norm_squared();
        let gain = if along > 0.0 { across / (sum.norm() + along) } else { sum.norm() - along };
        (sum, 2.0 * gain)
    }

    /// The whole map relaxed by conformal steps, and centred after each pass.
    fn relax(&mut self, monitor: &Monitor) -> Result<(), SphereError> {
        for _ in 0..PASSES {
            self.centre(monitor)?;
            if !self.relax_once(monitor)? {
                break;
            }
        }
        self.centre(monitor)
    }

    /// Conformal steps, the largest gain first, about [`STEPS`] per vertex. Whether there is more to gain.
    fn relax_once(&mut self, monitor: &Monitor) -> Result<bool, SphereError> {
        let vertices: Vec<VertexId> = self.edit.vertices().collect();
        let enough = ENOUGH * 8.0 * std::f64::consts::PI / vertices.len() as f64;
        let mut version = vec![0_u32; self.y.len()];
        let mut queue = BinaryHeap::new();
        let entry = |gain: f64, v: VertexId, version: u32| (gain.to_bits(), Reverse(v.0), version);
        for &v in &vertices {
            let (_, gain) = self.gain(v);
            if gain > enough {
                queue.push(entry(gain, v, 0));
            }
        }
        let mut left = STEPS * vertices.len();
        self.held = 0;
        while let Some((_, Reverse(v), of)) = queue.pop() {
            let v = VertexId(v);
            if of != version[v.index()] {
                continue;
            }
            left -= 1;
            if left == 0 {
                return Ok(true);
            }
            if left.is_multiple_of(1024) {
                monitor.check()?;
            }
            let (sum, _) = self.gain(v);
            if !self.move_towards(v, sum, SMALLEST) {
                self.held += 1;
                continue;
            }
            for w in self.edit.neighbors(v).chain([v]).collect::<Vec<_>>() {
                version[w.index()] += 1;
                let (_, gain) = self.gain(w);
                if gain > enough {
                    queue.push(entry(gain, w, version[w.index()]));
                }
            }
        }
        Ok(false)
    }

    /// Centres the map: freely, with what that flips unfolded again, or else as far as nothing flips.
    fn centre(&mut self, monitor: &Monitor) -> Result<(), SphereError> {
        let vertices: Vec<VertexId> = self.edit.vertices().collect();
        let mut local = vec![0_u32; self.y.len()];
        vertices.iter().zip(0..).for_each(|(v, k)| local[v.index()] = k);
        let faces = self.edit.faces().map(|f| self.edit.face_vertices(f).map(|v| local[v.index()])).collect();
        let mass = vertices.iter().map(|v| self.mass[v.index()]).collect();
        let surface = Surface::build(faces, &|k| self.edit.position(vertices[k as usize]), mass);
        let before: Vec<Vec3> = vertices.iter().map(|v| self.y[v.index()]).collect();
        let mut y = before.clone();
        centre(&surface.mass, &mut y, &|_| true);
        if !relax::repair(&surface, &mut y, monitor)? {
            y = before;
            centre(&surface.mass, &mut y, &|it| surface.is_whole(it));
        }
        for (v, y) in vertices.iter().zip(y) {
            self.y[v.index()] = y;
        }
        Ok(())
    }
}

/// The worst faces around a vertex on the sphere.
struct Shape {
    /// Least of twice the area over the longest side squared; negative for a flipped face.
    thinnest: f64,
    /// Least longest side.
    smallest: f64,
}

impl Shape {
    fn of(p: Vec3, fan: &[[Vec3; 2]]) -> Self {
        let mut out = Self { thinnest: f64::INFINITY, smallest: f64::INFINITY };
        for &[b, c] in fan {
            let (pb, pc) = (b - p, c - p);
            let longest = pb.norm_squared().max(pc.norm_squared()).max((c - b).norm_squared());
            out.thinnest = out.thinnest.min(p.dot(&pb.cross(&pc)) / longest);
            out.smallest = out.smallest.min(longest.sqrt());
        }
        out
    }
}
