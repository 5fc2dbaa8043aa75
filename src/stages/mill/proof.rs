//! The sweep of a program past the whole body, in every way that a controller may move between its blocks.
use super::{Body, Machine, Options, guard::in_box, machine::Between, plan::Plan};
use crate::{
    geom::{Box3, Vec3},
    mesh::{
        FaceId, Id,
        sweep::{Deepest, Pose, Sweep},
    },
    model::{CutMesh, MillMove, Setup},
    numeric::{Cancelled, Monitor},
};

/// Steps per block.
const SUBSTEPS: usize = 12;

/// A program as far as it has been swept.
pub(super) struct Proof<'a> {
    cut: &'a CutMesh,
    options: &'a Options,
    setup: Setup,
    fixture: Box3,
    normals: Vec<Vec3>,
    ways: Vec<(Between, Sweep<'a>)>,
    /// Blocks that were swept.
    done: usize,
}

/// What the sweeps of a program find. What one of the ways cuts into is cut into, what one of them leaves is left, and only
/// what all of them pass is passed.
pub(super) struct Swept {
    /// Smallest and largest clearance that one of the sweeps leaves on each sample, mm; what is cut into is negative.
    pub(super) lowest: Vec<f64>,
    pub(super) highest: Vec<f64>,
    /// Whether the line of contact passed over the sample in all of them.
    pub(super) passed: Vec<bool>,
    pub(super) collision: Deepest,
}

impl Swept {
    /// The one figure of a sample for a picture: a cut before what is left.
    pub(super) fn shown(&self, i: usize) -> f64 {
        if self.lowest[i] < 0.0 { self.lowest[i] } else { self.highest[i] }
    }
}

impl<'a> Proof<'a> {
    pub(super) fn new(cut: &'a CutMesh, body: &'a Body, plan: &Plan<'_>, options: &'a Options) -> Self {
        let band = options.tool.radius.max(2.0 * options.excess);
        let sweep = || Sweep::new(&body.samples, options.tool, band);
        Self {
            cut,
            options,
            setup: plan.setup,
            fixture: plan.fixture,
            normals: cut.mesh.faces().map(|f| cut.mesh.normal(f)).collect(),
            ways: options.machine.ways().iter().map(|&way| (way, sweep())).collect(),
            done: 0,
        }
    }

    /// Sweeps what has been added to a program.
    pub(super) fn advance(&mut self, moves: &[MillMove], monitor: &Monitor) -> Result<(), Cancelled> {
        let first = self.done.saturating_sub(1);
        self.done = moves.len();
        let (cut, options, setup) = (self.cut, self.options, self.setup);
        let in_body = |pose: &Pose| Pose { tip: setup.back(pose.tip), axis: setup.turn_back(pose.axis) };
        for (way, sweep) in &mut self.ways {
            for (i, w) in moves[first..].windows(2).enumerate() {
                monitor.check()?;
                if i % 64 == 0 {
                    monitor.progress(i as f64 / (moves.len() - first) as f64, "sweep");
                }
                let ends = ((&w[0].pose, w[0].joints.as_slice()), (&w[1].pose, w[1].joints.as_slice()));
                let facing = |f: FaceId| (cut.piece_of[f] == w[1].piece).then(|| self.normals[f.index()]);
                let mut last = in_body(&w[0].pose);
                for k in 1..=SUBSTEPS {
                    let pose = options.machine.between(*way, ends.0, ends.1, k as f64 / SUBSTEPS as f64);
                    let hit = match options.machine {
                        Machine::Mill(_) => in_box(&options.tool, &pose, &self.fixture),
                        Machine::Wire(_) => None,
                    };
                    if let Some(place) = hit {
                        sweep.collision.meet(options.tool.radius, setup.back(place));
                    }
                    let next = in_body(&pose);
                    sweep.step(&last, &next, w[1].contact, &facing);
                    last = next;
                }
            }
        }
        Ok(())
    }

    /// What was found so far.
    pub(super) fn swept(&self) -> Swept {
        let count = self.ways.first().map_or(0, |it| it.1.clearance.len());
        let mut out = Swept {
            lowest: vec![f64::INFINITY; count],
            highest: vec![f64::NEG_INFINITY; count],
            passed: vec![true; count],
            collision: Deepest::default(),
        };
        for (_, sweep) in &self.ways {
            for (i, &it) in sweep.clearance.iter().enumerate() {
                out.lowest[i] = out.lowest[i].min(it);
                out.highest[i] = out.highest[i].max(it);
                out.passed[i] &= sweep.passed[i];
            }
            out.collision.meet(sweep.collision.depth, sweep.collision.place);
        }
        // Where little enough is left, it does not matter how the contact went by.
        for (passed, high) in out.passed.iter_mut().zip(&out.highest) {
            *passed |= *high <= 0.5 * self.options.excess;
        }
        out
    }
}
