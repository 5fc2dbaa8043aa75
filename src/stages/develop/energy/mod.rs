//! Developability energies: one file each, one list.
//!
//! An energy is a function of the normals and corner angles of one interior vertex star, so each file holds only that
//! function and its derivatives by them; [`super::evaluate`] turns these into gradients by vertex positions.
//! Notation as in Stein, Grinspun, Crane, "Developability of Triangle Meshes" (2018), called SGC below.
pub(super) mod covariance;

use super::evaluate::{StarPass, star_pass};
use crate::numeric::lanes::{Lanes, Lanes3};

/// Unit normal N of a face and its angle θ at the centre of the star.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Corner {
    /// N.
    pub normal: Lanes3,
    /// θ, radians.
    pub angle: Lanes,
}

/// Derivative of the energy of a star by the normal and the angle of one of its corners.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pull {
    /// By N (its component along N has no effect).
    pub normal: Lanes3,
    /// By θ.
    pub angle: Lanes,
}

/// A developability energy.
#[derive(Clone, Copy)]
pub struct Energy {
    /// Its name in the config.
    pub name: &'static str,
    /// One sentence for people.
    pub about: &'static str,
    pub(super) pass: StarPass,
}

impl std::fmt::Debug for Energy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// All energies.
// Closures, not function names: only those are inlined where the compiler may use wide registers.
#[allow(clippy::redundant_closure)]
pub const ENERGIES: &[Energy] = &[Energy {
    name: "covariance",
    about: "smallest eigenvalue of the angle-weighted covariance of the normals around a vertex (SGC eq. 3)",
    pass: |stars, corners, out, weight| {
        star_pass(
            #[inline(always)]
            |star, pulls| covariance::star(star, pulls),
            stars,
            corners,
            out,
            weight,
        )
    },
}];

impl Energy {
    /// The energy with that name.
    pub fn named(name: &str) -> Option<&'static Self> {
        ENERGIES.iter().find(|it| it.name == name)
    }
}
