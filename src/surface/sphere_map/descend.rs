//! Descent on F in a Sobolev metric, freely and with every face kept.
use super::{SphereError, centre, surface::Surface};
use crate::{
    geom::Vec3,
    numeric::{Monitor, sparse::Cholesky},
};

/// Most steps of a descent.
const STEPS: usize = 40;
/// A step that lowers F by a smaller share ends the descent.
const ENOUGH: f64 = 1e-7;
/// The shortest step tried; 1 is Newton's for small changes of high frequency.
const SHORTEST: f64 = 1e-3;

/// The Sobolev gradient (L + M)⁻¹ grad_T F / 2, in the tangent planes.
fn direction(surface: &Surface, factor: &Cholesky, y: &[Vec3]) -> Vec<Vec3> {
    let n = y.len();
    let mut columns = vec![0.0; 3 * n];
    for (v, (flow, p)) in surface.laplacian(y).into_iter().zip(y).enumerate() {
        let tangent = flow - flow.dot(p) * p;
        for k in 0..3 {
            columns[k * n + v] = tangent[k];
        }
    }
    factor.solve_in_place(&mut columns);
    let at = |v: usize| {
        let d = Vec3::new(columns[v], columns[n + v], columns[2 * n + v]);
        d - d.dot(&y[v]) * y[v]
    };
    (0..n).map(at).collect()
}

/// How a step is made valid.
type Mend<'a> = &'a dyn Fn(&[Vec3], &mut [Vec3]);

/// Steps along the Sobolev direction as long as they lower F by more than a share of it. Every step is centred before F is
/// told: otherwise the image gathers in one place.
fn lower(
    surface: &Surface,
    factor: &Cholesky,
    y: &mut Vec<Vec3>,
    mend: Mend<'_>,
    monitor: &Monitor,
) -> Result<(), SphereError> {
    let mut energy = surface.energy(y);
    for _ in 0..STEPS {
        monitor.check()?;
        let d = direction(surface, factor, y);
        let mut tau = 1.0;
        let (next, lower) = loop {
            let mut next: Vec<Vec3> = y.iter().zip(&d).map(|(p, d)| (p - tau * d).normalize()).collect();
            centre::centre(&surface.mass, &mut next, &|_| true);
            mend(y, &mut next);
            let lower = surface.energy(&next);
            if lower < energy || tau < SHORTEST {
                break (next, lower);
            }
            tau *= 0.5;
        };
        if !(lower < energy) {
            return Ok(());
        }
        *y = next;
        let done = energy - lower < ENOUGH * energy;
        energy = lower;
        if done {
            return Ok(());
        }
    }
    Ok(())
}

/// Lowers F of a centred map; faces may flip.
pub(super) fn descend(
    surface: &Surface,
    factor: &Cholesky,
    y: &mut Vec<Vec3>,
    monitor: &Monitor,
) -> Result<(), SphereError> {
    lower(surface, factor, y, &|_, _| (), monitor)
}

/// Lowers F of a centred map without flipped faces and keeps it so: vertices of a face that a step would flip stay.
pub(super) fn polish(
    surface: &Surface,
    factor: &Cholesky,
    y: &mut Vec<Vec3>,
    monitor: &Monitor,
) -> Result<(), SphereError> {
    lower(surface, factor, y, &|from, to| revert(surface, from, to), monitor)
}

/// Takes back the moves of the corners of every face that they flip or make a sliver.
fn revert(surface: &Surface, from: &[Vec3], to: &mut [Vec3]) {
    let mut open: Vec<u32> = (0..surface.faces.len() as u32).collect();
    while !open.is_empty() {
        let mut again = Vec::new();
        for &f in &open {
            if surface.may_move(f as usize, from, to) {
                continue;
            }
            for v in surface.faces[f as usize] {
                if to[v as usize] != from[v as usize] {
                    to[v as usize] = from[v as usize];
                    again.extend_from_slice(surface.star(v as usize));
                }
            }
        }
        again.sort_unstable();
        again.dedup();
        open = again;
    }
}
