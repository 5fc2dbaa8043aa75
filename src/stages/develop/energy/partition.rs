//! Partitions of a star into two fans of faces, as two numbers per lane.
use crate::numeric::lanes::{Lanes, Lanes3};

/// Faces `from`..`to` (counter-clockwise, `from` < `to`) on one side, the rest on the other; one partition per lane.
///
/// Each side has at least two faces: a single face may point anywhere at no cost, but as a side of a hinge its angle would
/// be π (SGC proposition A.3), which no embedded star has.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Partition {
    pub from: Lanes,
    pub to: Lanes,
}

impl Partition {
    /// All `to` that go with `from`, of `n` faces. A cut before face 0 appears as `from` only.
    #[inline(always)]
    pub(super) fn ends(n: usize, from: usize) -> std::ops::Range<usize> {
        from + 2..n.min(from + n - 1)
    }

    /// Takes (from, to) as the partition where `value` < `best`.
    #[inline(always)]
    pub(super) fn improve(&mut self, value: Lanes, best: Lanes, from: usize, to: usize) {
        self.from = value.lt_select(best, Lanes::splat(from as f64), self.from);
        self.to = value.lt_select(best, Lanes::splat(to as f64), self.to);
    }

    /// `inside` where face `k` lies in `from`..`to`, else `outside`.
    #[inline(always)]
    pub(super) fn select(&self, k: usize, inside: Lanes, outside: Lanes) -> Lanes {
        let k = Lanes::splat(k as f64);
        k.lt_select(self.from, outside, k.lt_select(self.to, inside, outside))
    }

    /// The same for vectors.
    #[inline(always)]
    pub(super) fn select3(&self, k: usize, inside: Lanes3, outside: Lanes3) -> Lanes3 {
        let k = Lanes::splat(k as f64);
        Lanes3::lt_select(k, self.from, outside, Lanes3::lt_select(k, self.to, inside, outside))
    }
}
