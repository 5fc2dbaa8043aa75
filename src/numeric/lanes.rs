//! Several numbers computed at once: arrays in lockstep that the compiler turns into vector instructions.
//!
//! Every lane does the same IEEE operations in the same order as scalar code would (no fused multiply-add, no
//! reassociation), so results do not depend on the width of the machine's vectors. Wrap hot loops in
//! [`vectorized`], and mark everything below it `#[inline(always)]`: only then is it compiled for wide registers.
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Numbers per group.
pub const LANES: usize = 8;

/// A group of numbers in lockstep.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(align(64))]
pub struct Lanes(pub [f64; LANES]);

/// Runs `f` compiled for the widest vectors that the machine has.
#[inline(always)]
pub fn vectorized<R>(f: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(f)
}

impl Lanes {
    /// The same number in every lane.
    #[inline(always)]
    pub const fn splat(x: f64) -> Self {
        Self([x; LANES])
    }

    /// One number per lane, made from its index.
    #[inline(always)]
    pub fn from_fn(mut f: impl FnMut(usize) -> f64) -> Self {
        // Not `array::from_fn`: its internals are not always inlined, and then compiled without wide registers.
        let mut out = [0.0; LANES];
        for (i, out) in out.iter_mut().enumerate() {
            *out = f(i);
        }
        Self(out)
    }

    /// `f` of every lane.
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = f(self.0[i]);
        }
        Self(out)
    }

    /// `f` of every pair of lanes.
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = f(self.0[i], other.0[i]);
        }
        Self(out)
    }

    /// Square root.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        self.map(
            #[inline(always)]
            |x| x.sqrt(),
        )
    }

    /// Absolute value.
    #[inline(always)]
    pub fn abs(self) -> Self {
        self.map(
            #[inline(always)]
            |x| x.abs(),
        )
    }

    /// `yes` where `self < other`, else (also for NaN) `no`.
    #[inline(always)]
    pub fn lt_select(self, other: Self, yes: Self, no: Self) -> Self {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = if self.0[i] < other.0[i] { yes.0[i] } else { no.0[i] };
        }
        Self(out)
    }

    /// Whether `self < other` in any lane.
    #[inline(always)]
    pub fn any_lt(self, other: Self) -> bool {
        let mut any = false;
        for i in 0..LANES {
            any |= self.0[i] < other.0[i];
        }
        any
    }

    /// Angle of the vector (x, y) for y ≥ 0, radians in [0, π]; about 1 unit in the last place of π.
    ///
    /// The quotient of the smaller by the larger component is brought below tan(π/8) by one more angle subtraction
    /// (in the same division), then a polynomial in t² of degree 11, nearly minimax on [0, tan²(π/8)] with an error
    /// below 5e-19, gives atan(t)/t.
    #[inline(always)]
    pub fn atan2_upper(y: Self, x: Self) -> Self {
        use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
        let ax = x.abs();
        let small = y.lt_select(ax, y, ax);
        let large = y.lt_select(ax, ax, y);
        let reduce = small.lt_select(large * Self::splat(TAN_PI_8), Self::splat(0.0), Self::splat(1.0));
        // atan(s/l) = π/4 + atan((s − l)/(l + s)).
        let t = (small - reduce * large) / (large + reduce * small);
        let s = t * t;
        let mut p = Self::splat(ATAN[ATAN.len() - 1]);
        for &c in ATAN[..ATAN.len() - 1].iter().rev() {
            p = p * s + Self::splat(c);
        }
        let first = t * p + reduce * Self::splat(FRAC_PI_4);
        let first = ax.lt_select(y, Self::splat(FRAC_PI_2) - first, first);
        x.lt_select(Self::splat(0.0), Self::splat(PI) - first, first)
    }
}

/// tan(π/8) = √2 − 1.
const TAN_PI_8: f64 = std::f64::consts::SQRT_2 - 1.0;
/// atan(t)/t in powers of t², interpolated at Chebyshev nodes in extended precision.
const ATAN: [f64; 12] = [
    1.0,
    -0.3333333333333312,
    0.19999999999940557,
    -0.1428571427922286,
    0.11111110743774345,
    -0.09090896781377046,
    0.0769204491388214,
    -0.06662947756516754,
    0.05846852704887618,
    -0.050350011128756235,
    0.037962963745558805,
    -0.017803130593488224,
];

macro_rules! lanewise {
    ($($op:ident $method:ident),*) => {$(
        impl $op for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, #[inline(always)] |a, b| a.$method(b))
            }
        }
    )*};
}
lanewise!(Add add, Sub sub, Mul mul, Div div);

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(
            #[inline(always)]
            |x| -x,
        )
    }
}

/// A vector in space per lane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Lanes3(pub [Lanes; 3]);

impl Lanes3 {
    /// One vector per lane.
    #[inline(always)]
    pub fn from_fn(mut f: impl FnMut(usize) -> [f64; 3]) -> Self {
        let mut out = Self::default();
        for i in 0..LANES {
            let [x, y, z] = f(i);
            out.0[0].0[i] = x;
            out.0[1].0[i] = y;
            out.0[2].0[i] = z;
        }
        out
    }

    /// Inner product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> Lanes {
        self.0[0] * o.0[0] + self.0[1] * o.0[1] + self.0[2] * o.0[2]
    }

    /// Cross product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, o.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }

    /// Each vector times the number of its lane.
    #[inline(always)]
    pub fn scale(self, s: Lanes) -> Self {
        let [x, y, z] = self.0;
        Self([x * s, y * s, z * s])
    }

    /// `yes` where `a < b`, else `no`.
    #[inline(always)]
    pub fn lt_select(a: Lanes, b: Lanes, yes: Self, no: Self) -> Self {
        let ([p, q, r], [x, y, z]) = (yes.0, no.0);
        Self([a.lt_select(b, p, x), a.lt_select(b, q, y), a.lt_select(b, r, z)])
    }

    /// The vector of one lane.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> [f64; 3] {
        [self.0[0].0[i], self.0[1].0[i], self.0[2].0[i]]
    }
}

impl Add for Lanes3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, o.0);
        Self([a + x, b + y, c + z])
    }
}

impl Sub for Lanes3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, o.0);
        Self([a - x, b - y, c - z])
    }
}

impl AddAssign for Lanes3 {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn atan2_agrees_with_the_standard_library_to_the_last_digits() {
        let mut worst: f64 = 0.0;
        for step in 0..200_000 {
            let angle = f64::from(step) / 199_999.0 * std::f64::consts::PI;
            for radius in [1e-9, 1.0, 3e7] {
                let (y, x) = ((radius * angle.sin()).abs(), radius * angle.cos());
                let ours = Lanes::atan2_upper(Lanes::splat(y), Lanes::splat(x)).0[0];
                worst = worst.max((ours - y.atan2(x)).abs());
            }
        }
        assert!(worst <= 4.5e-16, "{worst:e}");
        for (y, x) in [(0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (1e-300, 1.0)] {
            let ours = Lanes::atan2_upper(Lanes::splat(y), Lanes::splat(x)).0[0];
            assert!((ours - f64::atan2(y, x)).abs() <= 4.5e-16, "{y} {x} {ours}");
        }
    }

    #[test]
    fn lanes_do_not_mix() {
        let a = Lanes::from_fn(|i| i as f64);
        let b = a * a + Lanes::splat(1.0);
        assert_eq!(b.0[3], 10.0);
        assert_eq!(a.lt_select(Lanes::splat(2.0), a, -a).0[..4], [0.0, 1.0, -2.0, -3.0]);
        assert!(!Lanes::splat(f64::NAN).any_lt(a));
    }
}
