//! Developability energies: one file each, one list.
//!
//! An energy is a function of the normals, corner angles and areas around one interior vertex star, so each file holds only
//! that function and its derivatives by them; [`super::evaluate`] turns these into gradients by vertex positions.
//! Notation as in Stein, Grinspun, Crane, "Developability of Triangle Meshes" (2018), called SGC below.
//! Where an energy has a kink (a tie between partitions, maxima or eigenvalues), the derivatives are those of one of the
//! tied terms, a subgradient.
mod combinatorial;
mod combinatorial_max;
mod comparison;
pub(super) mod covariance;
mod covariance_max;
mod intrinsic;
mod intrinsic_max;
mod log_map;
mod partition;

use super::evaluate::StarPass;
use crate::numeric::lanes::{Lanes, Lanes3};
use log_map::Image;

pub use comparison::COMPARISONS;

/// A face of several stars of one valence: unit normal N, angle θ at the centre of the star, doubled area.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Corner {
    /// N.
    pub normal: Lanes3,
    /// θ, radians.
    pub angle: Lanes,
    /// 2A, only where [`Energy::areas`] is set.
    pub area2: Lanes,
}

/// Derivative of the energy of a star by the normal, the angle and the area of one of its corners.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pull {
    /// By N (its component along N has no effect).
    pub normal: Lanes3,
    /// By θ.
    pub angle: Lanes,
    /// By ln A, only read where [`Energy::areas`] is set.
    pub area: Lanes,
}

/// Scratch of a star function.
#[derive(Debug)]
pub(super) struct Work {
    lanes: Vec<Lanes>,
    images: Vec<Image>,
}

impl Work {
    /// Enough for stars of at most that valence.
    pub(super) fn new(energy: &Energy, valence: usize) -> Self {
        let images = if energy.areas { valence } else { 0 };
        Self { lanes: vec![Lanes::default(); (energy.work)(valence)], images: vec![Image::default(); images] }
    }
}

/// A developability energy.
#[derive(Clone, Copy)]
pub struct Energy {
    /// Its name in the config.
    pub name: &'static str,
    /// One sentence for people.
    pub about: &'static str,
    /// Whether it depends on areas, as those in the log map do.
    pub(super) areas: bool,
    /// [`Work::lanes`] that a star of that valence needs.
    work: fn(usize) -> usize,
    /// Runs its star function over all stars.
    pub(super) pass: fn(StarPass<'_>),
}

impl std::fmt::Debug for Energy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// Row of the list of energies. A macro, not a function, because each row needs its own closure that is inlined into the
/// vectorised loop: a function pointer to the star function would not be.
macro_rules! energy {
    ($name:literal, $about:literal, $star:path, work: $work:expr, areas: $areas:literal) => {
        $crate::stages::develop::energy::Energy {
            name: $name,
            about: $about,
            areas: $areas,
            work: $work,
            pass: |pass| {
                pass.run::<$areas>(
                    #[inline(always)]
                    |corners, pulls, work| $star(corners, pulls, work),
                )
            },
        }
    };
}
use energy;

/// The covariance energy λ.
pub const COVARIANCE: Energy = energy!(
    "covariance",
    "smallest eigenvalue of the angle-weighted covariance of the normals around a vertex (SGC eq. 3)",
    covariance::star,
    work: |_| 0,
    areas: false
);

/// All energies.
pub const ENERGIES: &[Energy] = &[
    COVARIANCE,
    energy!(
        "covariance-max",
        "least over all directions of the largest squared height of a normal above the plane across it (SGC eq. 6)",
        covariance_max::star,
        work: covariance_max::work,
        areas: false
    ),
    energy!(
        "combinatorial",
        "least over all splits of a star into two fans of the variances of the normals within them (SGC eq. 2)",
        combinatorial::star,
        work: combinatorial::work,
        areas: false
    ),
    energy!(
        "combinatorial-max",
        "least over all splits of a star into two fans of the largest squared distance of normals within one (SGC eq. 5)",
        combinatorial_max::star,
        work: combinatorial_max::work,
        areas: false
    ),
    energy!(
        "intrinsic",
        "smaller eigenvalue of the covariance of the normals in the log map at the vertex normal (SGC appendix B.5)",
        intrinsic::star,
        work: |_| 0,
        areas: true
    ),
    energy!(
        "intrinsic-max",
        "squared half width of the normals and their opposites in the log map at the vertex normal (SGC appendix B.5.1)",
        intrinsic_max::star,
        work: |_| 0,
        areas: true
    ),
];

impl Energy {
    /// Whether there is a model of its second derivatives, which Levenberg–Marquardt needs.
    pub fn has_curvature(&self) -> bool {
        self.name == COVARIANCE.name
    }

    /// The energy with that name.
    pub fn named(name: &str) -> Option<&'static Self> {
        ENERGIES.iter().find(|it| it.name == name)
    }
}

#[cfg(test)]
mod tests;
