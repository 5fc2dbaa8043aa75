//! The combinatorial energy with maxima: min over partitions of a star into two fans of max |N1 − N2|² over all pairs within
//! one fan (SGC eq. 5).
use super::{Corner, Pull, Work, partition::Partition};
use crate::numeric::lanes::{LANES, Lanes};

/// Up to this valence the diameters of all fans are tabulated; above it the table would outgrow the caches (and, for the tip
/// of a finely meshed cone, the memory), and the best partition is found by bisection instead.
const TABULATED: usize = 32;

/// Diameters of all fans, by length and first face; or the reach of every face.
pub(super) fn work(valence: usize) -> usize {
    if valence <= TABULATED { valence * valence } else { valence }
}

/// Energy of several stars of one valence; `pulls` gets ∂/∂N1 = 2 (N1 − N2) = −∂/∂N2 of a pair that attains it.
#[inline(always)]
pub(super) fn star(corners: &[Corner], pulls: &mut [Pull], work: &mut Work) -> Lanes {
    let n = corners.len();
    let (energy, partition) =
        if n <= TABULATED { tabulated(corners, &mut work.lanes) } else { bisected(corners, &mut work.lanes[..n]) };
    for pull in pulls.iter_mut() {
        *pull = Pull::default();
    }
    let (zero, one) = (Lanes::default(), Lanes::splat(1.0));
    let (mut open, mut nothing) = (one, zero);
    for a in 0..n {
        // Not a number if any normal is: the maxima pass over those.
        nothing += zero * corners[a].normal.dot(corners[a].normal);
        let side = partition.select(a, one, zero);
        for b in a + 1..n {
            let difference = corners[a].normal - corners[b].normal;
            // At least the energy, and on one side: equal to it, as no pair on one side exceeds it.
            let same = (side - partition.select(b, one, zero)).abs();
            let hit = same.lt_select(one, open, zero);
            let hit = difference.dot(difference).lt_select(energy, zero, hit);
            if zero.any_lt(hit) {
                open = open - hit;
                let pull = difference.scale(hit + hit);
                pulls[a].normal += pull;
                pulls[b].normal = pulls[b].normal - pull;
            }
        }
    }
    energy + nothing
}

/// The diameter of each fan from those of the two fans that are one face shorter.
#[inline(always)]
fn tabulated(corners: &[Corner], diameters: &mut [Lanes]) -> (Lanes, Partition) {
    let n = corners.len();
    // Row `l`, column `k`: faces k..=k + l, cyclic.
    diameters[..n].fill(Lanes::default());
    for l in 1..n - 2 {
        for k in 0..n {
            let (next, last) = ((k + 1) % n, (k + l) % n);
            let difference = corners[k].normal - corners[last].normal;
            let square = difference.dot(difference);
            let (a, b) = (diameters[(l - 1) * n + k], diameters[(l - 1) * n + next]);
            let longer = a.lt_select(b, b, a);
            diameters[l * n + k] = longer.lt_select(square, square, longer);
        }
    }
    let mut best = Lanes::splat(f64::INFINITY);
    let mut partition = Partition::default();
    for from in 0..n - 1 {
        for to in Partition::ends(n, from) {
            let (a, b) = (diameters[(to - from - 1) * n + from], diameters[(n + from - to - 1) * n + to]);
            let value = a.lt_select(b, b, a);
            partition.improve(value, best, from, to);
            best = value.lt_select(best, value, best);
        }
    }
    (best, partition)
}

/// The same for many faces, lane by lane: bisection on the value, as the order of floating-point numbers that are not
/// negative is that of their bits.
#[cold]
#[inline(never)]
fn bisected(corners: &[Corner], reach: &mut [Lanes]) -> (Lanes, Partition) {
    /// Above any |N1 − N2|².
    const MOST: f64 = 5.0;
    let mut energy = Lanes::splat(f64::NAN);
    let mut partition = Partition::default();
    for lane in 0..LANES {
        // Wrong for a limit just below 0 and right for MOST, unless a normal is not a number.
        let (mut low, mut high) = (0, MOST.to_bits() + 1);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if within(corners, reach, lane, f64::from_bits(middle - 1)).is_some() {
                high = middle;
            } else {
                low = middle;
            }
        }
        let limit = f64::from_bits(high - 1);
        if let Some((from, to)) = within(corners, reach, lane, limit) {
            energy.0[lane] = limit;
            partition.from.0[lane] = from as f64;
            partition.to.0[lane] = to as f64;
        }
    }
    (energy, partition)
}

/// A partition of one star whose pairs have squared distances of at most `limit`. O(n²).
fn within(corners: &[Corner], reach: &mut [Lanes], lane: usize, limit: f64) -> Option<(usize, usize)> {
    let n = corners.len();
    let near = |a: usize, b: usize| {
        let difference = corners[a % n].normal - corners[b % n].normal;
        difference.dot(difference).0[lane] <= limit
    };
    // A window of faces that are all near each other; its end never moves back.
    let mut end = 0;
    for start in 0..n {
        end = end.max(start + 1);
        while end < start + n && (start..end).all(|k| near(k, end)) {
            end += 1;
        }
        reach[start].0[lane] = (end - start) as f64;
    }
    let size = |start: usize| reach[start % n].0[lane] as usize;
    (0..n).find_map(|start| {
        // The longest fan leaves the shortest rest.
        let length = size(start).min(n - 2);
        let fits = length >= 2 && size(start + length) >= n - length;
        let to = start + length;
        fits.then(|| if to < n { (start, to) } else { (to - n, start) })
    })
}
