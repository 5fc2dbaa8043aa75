//! The combinatorial energy: min over partitions of a star into two fans of Σ_p 1/n_p Σ |N − N̄_p|² (SGC eq. 1, 2).
//!
//! 1/n Σ|N − N̄|² = 1/n² Σ over unordered pairs |N1 − N2|² = Σ|δ|²/n − |Σδ|²/n² with δ = N − N_0, so prefix sums of δ and
//! |δ|² give each partition in constant time. Differences to one normal of the star, not the normals themselves, because
//! 1 − |N̄|² would lose the digits of a nearly flat star.
use super::{Corner, Pull, Work, partition::Partition};
use crate::numeric::lanes::{Lanes, Lanes3};

/// Prefix sums of δ and of |δ|².
pub(super) fn work(valence: usize) -> usize {
    4 * (valence + 1)
}

/// Energy of several stars of one valence; `pulls` gets ∂/∂N = 2/n_p (N − N̄_p) for the best partition.
#[inline(always)]
pub(super) fn star(corners: &[Corner], pulls: &mut [Pull], work: &mut Work) -> Lanes {
    let n = corners.len();
    let first = corners[0].normal;
    let (sums, _) = work.lanes.as_chunks_mut::<4>();
    let sums = &mut sums[..n + 1];
    sums[0] = [Lanes::default(); 4];
    for (k, corner) in corners.iter().enumerate() {
        let d = corner.normal - first;
        let [x, y, z, square] = sums[k];
        sums[k + 1] = [x + d.0[0], y + d.0[1], z + d.0[2], square + d.dot(d)];
    }
    let total = sums[n];
    let mut best = Lanes::splat(f64::INFINITY);
    let mut partition = Partition::default();
    let mut inside = Lanes3::default();
    for from in 0..n - 1 {
        for to in Partition::ends(n, from) {
            let (a, b) = (sums[from], sums[to]);
            let sum = Lanes3([b[0] - a[0], b[1] - a[1], b[2] - a[2]]);
            let rest = Lanes3([total[0], total[1], total[2]]) - sum;
            let square = b[3] - a[3];
            let (size, rest_size) = (1.0 / (to - from) as f64, 1.0 / (n + from - to) as f64);
            let value = Lanes::splat(size) * (square - Lanes::splat(size) * sum.dot(sum))
                + Lanes::splat(rest_size) * (total[3] - square - Lanes::splat(rest_size) * rest.dot(rest));
            partition.improve(value, best, from, to);
            inside = Lanes3::lt_select(value, best, sum, inside);
            best = value.lt_select(best, value, best);
        }
    }
    let one = Lanes::splat(1.0);
    let share = one / (partition.to - partition.from);
    let rest_share = one / (Lanes::splat(n as f64) - partition.to + partition.from);
    let mean = first + inside.scale(share);
    let rest_mean = first + (Lanes3([total[0], total[1], total[2]]) - inside).scale(rest_share);
    let mut energy = Lanes::default();
    for (k, (corner, pull)) in corners.iter().zip(pulls).enumerate() {
        let deviation = corner.normal - partition.select3(k, mean, rest_mean);
        let share = partition.select(k, share, rest_share);
        // Summed from the squares themselves, which keep their digits.
        energy += share * deviation.dot(deviation);
        (pull.normal, pull.angle) = (deviation.scale(share + share), Lanes::default());
    }
    energy
}
