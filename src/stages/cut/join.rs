//! Glues seams again where the pieces stay within the limit and flat.
use std::collections::BTreeMap;

use super::{CutError, hinge::Hinge, piece::Piece, search::Search};
use crate::{
    mesh::{EdgeId, FaceId, HalfedgeId},
    surface::{cut_graph::arcs, flatten::Limit},
};

/// Passes over all seams at most; a pass ends the search when nothing was glued.
const PASSES: usize = 6;
/// Gluing ends when it has judged so many times the faces of the mesh: where almost every vertex must lie on a seam there
/// are thousands of seams to try, and hardly one can be glued.
const EFFORT: usize = 60;

/// A failure counts for pieces up to so many times the area: a larger piece may swallow what the share of the area that
/// may exceed the limit did not allow a smaller one.
const GROWTH: f64 = 2.0;

/// Runs that could not be glued, by their least edge.
#[derive(Debug, Clone, Default)]
pub(super) struct Failures(BTreeMap<EdgeId, Vec<Failure>>);

/// A run that could not be glued. Gluing more of it or other seams of the same pieces only adds constraints, so a longer
/// run fails too, and so it does for all that the pieces are glued into.
#[derive(Debug, Clone)]
struct Failure {
    /// The edges, ascending.
    run: Vec<EdgeId>,
    /// The pieces beside it.
    pieces: [u32; 2],
    /// The area of both, mm².
    area: f64,
    /// Whether it lies flat but costs more, say for a neck: that says nothing about other runs and pieces.
    dear: bool,
}

/// Unions of fewer faces are judged whole at once.
const LEAST_WITH_VICINITY: usize = 100;
/// The vicinities of a run that are judged before all of it are these parts of all faces: most of what cannot be glued
/// shows close by.
const VICINITIES: [usize; 2] = [16, 4];

impl Search<'_> {
    /// Tries to glue every arc of the cut between pieces from `first` on, whole or in parts, those first that save most for
    /// the effort of judging them.
    pub(super) fn join(&mut self, first: u32) -> Result<(), CutError> {
        let limit = self.judged + EFFORT * self.mesh.face_count();
        for _ in 0..PASSES {
            let all = arcs(self.mesh, &self.cut).into_iter().flat_map(|arc| self.gluable_runs(arc));
            let mut runs: Vec<(f64, Vec<EdgeId>)> = all.map(|run| (self.worth(&run), run)).collect();
            runs.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
            let mut glued = false;
            for (_, run) in runs {
                self.monitor.check()?;
                if self.judged > limit {
                    return Ok(());
                }
                let [p, _] = self.sides(run[0]);
                glued |= p >= first && self.try_glue(&run)?;
            }
            if !glued {
                break;
            }
        }
        Ok(())
    }

    /// An arc, between vertices that must lie on a cut, its halves, their halves and so on; what is left of an arc is halved
    /// again in the next pass.
    fn gluable_runs(&self, arc: Vec<EdgeId>) -> Vec<Vec<EdgeId>> {
        let mut whole = Vec::new();
        let mut run: Vec<EdgeId> = Vec::new();
        for e in arc {
            if let Some(&before) = run.last() {
                let [a, b] = self.mesh.edge_vertices(e);
                let shared = if self.mesh.edge_vertices(before).contains(&a) { a } else { b };
                let end = self.kept[e] != self.kept[before];
                if end || self.must_cut[shared] || self.mesh.is_boundary_vertex(shared) {
                    whole.push(std::mem::take(&mut run));
                }
            }
            run.push(e);
        }
        whole.push(run);
        let mut out = whole.clone();
        for _ in 0..self.options.halvings {
            let halves = whole.iter().filter(|run| run.len() > 1).flat_map(|run| {
                let (a, b) = run.split_at(run.len() / 2);
                [a.to_vec(), b.to_vec()]
            });
            whole = halves.collect();
            out.extend_from_slice(&whole);
        }
        out
    }

    /// Length saved per face that has to be judged for it.
    fn worth(&self, run: &[EdgeId]) -> f64 {
        let [p, q] = self.sides(run[0]);
        let faces = |id: u32| self.pieces[id as usize].as_ref().map_or(0, |it| it.chart.faces.len());
        self.length(run) / (faces(p) + if p == q { 0 } else { faces(q) }) as f64
    }

    /// The pieces on both sides of a cut edge, the smaller number first.
    pub(super) fn sides(&self, e: EdgeId) -> [u32; 2] {
        let h = self.mesh.halfedge(e);
        let twin = self.mesh.twin(h).expect("cuts run along inner edges");
        let (p, q) = (self.piece_of[self.mesh.face(h)], self.piece_of[self.mesh.face(twin)]);
        [p.min(q), p.max(q)]
    }

    /// The piece that `id` has become part of.
    fn living(&self, mut id: u32) -> u32 {
        while self.glued_into[id as usize] != id {
            id = self.glued_into[id as usize];
        }
        id
    }

    /// Whether gluing a part of `run` (ascending) failed before for parts of `pieces`, which have `area` together.
    fn has_failed(&self, run: &[EdgeId], [p, q]: [u32; 2], area: f64) -> bool {
        let before = run.iter().filter_map(|e| self.failures.0.get(e)).flatten();
        before.into_iter().any(|it| {
            let [a, b] = it.pieces.map(|id| self.living(id));
            if it.dear {
                return it.pieces == [p, q] && it.run == run;
            }
            area < GROWTH * it.area
                && [p, q] == [a.min(b), a.max(b)]
                && it.run.iter().all(|e| run.binary_search(e).is_ok())
        })
    }

    fn try_glue(&mut self, run: &[EdgeId]) -> Result<bool, CutError> {
        if run.iter().any(|&e| !self.cut[e] || self.kept[e] || self.mesh.is_boundary_edge(e)) {
            return Ok(false);
        }
        let [p, q] = self.sides(run[0]);
        let live = |id: u32| self.pieces[id as usize].as_ref().expect("every face lies in a piece that lives");
        let mut faces = live(p).chart.faces.clone();
        let mut area = live(p).area;
        if p != q {
            faces.extend(&live(q).chart.faces);
            area += live(q).area;
        }
        let mut sorted = run.to_vec();
        sorted.sort_unstable();
        if self.has_failed(&sorted, [p, q], area) || (p != q && self.is_seen_to_fail([live(p), live(q)], run)) {
            return Ok(false);
        }
        let closed = p == q && {
            let slits = live(p).closed_slits(self.mesh, self.options.clearance);
            run.iter().all(|e| slits.contains(e))
        };
        let both = if p == q { vec![live(p)] } else { vec![live(p), live(q)] };
        let before = self.length(run) + self.price(both.into_iter());
        for &e in run {
            self.cut[e] = false;
        }
        let chart = self.builder.chart(faces, &|e| self.cut[e]);
        if !(chart.is_disk() || (closed && chart.is_planar())) {
            for &e in run {
                self.cut[e] = true;
            }
            return Ok(false);
        }
        let mut failure = Failure { run: sorted, pieces: [p, q], area, dear: false };
        for part in VICINITIES {
            if !self.vicinity_lies_flat(run, &chart.faces, area, part)? {
                return self.give_up(failure);
            }
        }
        let piece = self.judge(chart.faces)?;
        failure.dear = piece.is_good();
        if !piece.is_good() || self.price([&piece].into_iter()) > before {
            return self.give_up(failure);
        }
        for id in [p, q] {
            self.pieces[id as usize] = None;
            self.glued_into[id as usize] = self.pieces.len() as u32;
        }
        self.insert(piece);
        Ok(true)
    }

    /// Whether two pieces would lie on one another along `run`, or two useful ones hang together by less than the least
    /// neck.
    fn is_seen_to_fail(&self, [first, second]: [&Piece; 2], run: &[EdgeId]) -> bool {
        let dear = self.neck > self.new_piece && !self.is_small(first) && !self.is_small(second);
        let narrow = |hinge: &Hinge| dear && hinge.span < self.options.min_neck;
        Hinge::new(self.mesh, first, second, run).is_some_and(|it| narrow(&it) || it.overlaps(first))
    }

    /// Cuts its run again and remembers a failure.
    fn give_up(&mut self, failure: Failure) -> Result<bool, CutError> {
        for &e in &failure.run {
            self.cut[e] = true;
        }
        self.failures.0.entry(failure.run[0]).or_default().push(failure);
        Ok(false)
    }

    /// Whether the faces around `run`, one `part`-th of `faces` (ascending, of `area` together), lie flat: they must if all do,
    /// and are judged at a fraction of the cost. True also where they are no disk.
    fn vicinity_lies_flat(
        &mut self,
        run: &[EdgeId],
        faces: &[FaceId],
        area: f64,
        part: usize,
    ) -> Result<bool, CutError> {
        if faces.len() < LEAST_WITH_VICINITY {
            return Ok(true);
        }
        let mesh = self.mesh;
        let mut reached = vec![false; faces.len()];
        let mut near: Vec<FaceId> = Vec::new();
        let mut reach = |h: HalfedgeId, near: &mut Vec<FaceId>| {
            if let Ok(k) = faces.binary_search(&mesh.face(h))
                && !std::mem::replace(&mut reached[k], true)
            {
                near.push(faces[k]);
            }
        };
        for &e in run {
            let h = mesh.halfedge(e);
            reach(h, &mut near);
            mesh.twin(h).into_iter().for_each(|twin| reach(twin, &mut near));
        }
        let mut done = 0;
        while done < near.len() && near.len() < faces.len() / part {
            for h in mesh.face_halfedges(near[done]) {
                let across = mesh.twin(h).filter(|_| !self.cut[mesh.edge(h)]);
                across.into_iter().for_each(|twin| reach(twin, &mut near));
            }
            done += 1;
        }
        near.sort_unstable();
        let Self { builder, metric, cut, options, .. } = self;
        let inside = |h| near.binary_search(&mesh.face(h)).is_ok();
        let opened = |e: EdgeId| {
            let h = mesh.halfedge(e);
            cut[e] || !inside(h) || mesh.twin(h).is_some_and(|twin| !inside(twin))
        };
        let chart = builder.chart(near.clone(), &opened);
        if !chart.is_disk() {
            return Ok(true);
        }
        self.judged += near.len();
        let share: f64 = near.iter().map(|&f| metric.area[f]).sum::<f64>() / area;
        let limit = Limit::new(options.stretch);
        let limit = Limit { allowed: limit.allowed / share, ..limit };
        let piece = Piece::new(builder, metric, chart, &opened, options, limit)?;
        Ok(!piece.contours.is_empty())
    }
}
