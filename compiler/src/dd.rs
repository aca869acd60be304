//! Double-double numbers: an unevaluated sum of two f64, about 31 decimal digits.
//!
//! Built on error-free transformations (Dekker 1971, Knuth; Hida, Li and Bailey 2001): a sum or product of two f64
//! is exactly a rounded f64 plus an f64. Relative error of one operation: a few units of 2^-106.
//!
//! Promises: infinities and NaN behave as in f64; splitting does not overflow below the overflow of the result.
//! It does not promise full accuracy where the low part underflows (results below about 1e-290).
//! Functions are in `dd/functions.rs`.

mod functions;
mod real;

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A double-double number `hi + lo` with `|lo| <= ulp(hi)/2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dd {
    hi: f64,
    lo: f64,
}

/// `a + b` exactly, as rounded sum and error.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

/// `a + b` exactly when `|a| >= |b|`.
fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

/// `a` as two numbers of 26 bits.
fn split(a: f64) -> (f64, f64) {
    const FACTOR: f64 = 134_217_729.0; // 2^27 + 1
    const LARGE: f64 = 6.696_928_794_914_17e299; // 2^996: beyond, FACTOR * a may overflow
    if a.abs() > LARGE {
        let (hi, lo) = split(a * DOWN);
        return (hi * UP, lo * UP);
    }
    let t = FACTOR * a;
    let hi = t - (t - a);
    (hi, a - hi)
}

/// 2^-28 and 2^28.
const DOWN: f64 = 3.725_290_298_461_914e-9;
const UP: f64 = 268_435_456.0;

/// `a * b` exactly, as rounded product and error; the error is lost when it underflows.
fn two_prod(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    if !p.is_finite() {
        return (p, 0.0);
    }
    let (a_hi, a_lo) = split(a);
    let (b_hi, b_lo) = split(b);
    let e = ((a_hi * b_hi - p) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo;
    // Near the largest number a partial product may exceed it although p does not.
    if e.is_finite() { (p, e) } else { (p, 0.0) }
}

impl Dd {
    /// Relative rounding error of one operation.
    pub const UNIT_ROUNDOFF: f64 = 1.232_595_164_407_831e-32; // 2^-106

    /// Zero.
    pub const ZERO: Dd = Dd { hi: 0.0, lo: 0.0 };
    /// One.
    pub const ONE: Dd = Dd { hi: 1.0, lo: 0.0 };

    /// The number `x`.
    #[must_use]
    pub const fn from_f64(x: f64) -> Self {
        Self { hi: x, lo: 0.0 }
    }

    /// The number `hi + lo`; normalised when `|hi| >= |lo|`.
    #[must_use]
    pub fn new(hi: f64, lo: f64) -> Self {
        let (s, e) = quick_two_sum(hi, lo);
        // inf - inf in the error of an infinite sum is not part of the number.
        if s.is_finite() { Self { hi: s, lo: e } } else { Self { hi: s, lo: 0.0 } }
    }

    /// A constant given as its two parts.
    const fn constant(hi: f64, lo: f64) -> Self {
        Self { hi, lo }
    }

    /// The leading part: the nearest f64.
    #[must_use]
    pub fn hi(self) -> f64 {
        self.hi
    }

    /// The trailing part.
    #[must_use]
    pub fn lo(self) -> f64 {
        self.lo
    }

    /// `|self|`
    #[must_use]
    pub fn abs(self) -> Self {
        if self.hi.is_sign_negative() { -self } else { self }
    }

    /// Square root, NaN below 0 (Karp's method: one correction of the f64 root).
    #[must_use]
    pub fn sqrt(self) -> Self {
        let root = self.hi.sqrt();
        if root == 0.0 || !root.is_finite() {
            return Self::from_f64(root);
        }
        let (p, e) = two_prod(root, root);
        let rest = self - Self { hi: p, lo: e };
        Self::new(root, rest.hi / (2.0 * root))
    }

    /// Exact multiplication by a power of two (unless it over- or underflows).
    fn scale(self, power: f64) -> Self {
        Self { hi: self.hi * power, lo: self.lo * power }
    }

    fn square(self) -> Self {
        self * self
    }
}

impl Add for Dd {
    type Output = Dd;
    fn add(self, other: Dd) -> Dd {
        let (s, e) = two_sum(self.hi, other.hi);
        if !s.is_finite() {
            return Dd::from_f64(s);
        }
        let (t, f) = two_sum(self.lo, other.lo);
        let (s, e) = quick_two_sum(s, e + t);
        Dd::new(s, e + f)
    }
}

impl Sub for Dd {
    type Output = Dd;
    fn sub(self, other: Dd) -> Dd {
        self + (-other)
    }
}

impl Neg for Dd {
    type Output = Dd;
    fn neg(self) -> Dd {
        Dd { hi: -self.hi, lo: -self.lo }
    }
}

impl Mul for Dd {
    type Output = Dd;
    fn mul(self, other: Dd) -> Dd {
        let (p, e) = two_prod(self.hi, other.hi);
        if !p.is_finite() {
            return Dd::from_f64(p);
        }
        Dd::new(p, e + (self.hi * other.lo + self.lo * other.hi))
    }
}

impl Div for Dd {
    type Output = Dd;
    /// Long division in three f64 digits.
    fn div(self, other: Dd) -> Dd {
        let q1 = self.hi / other.hi;
        if !q1.is_finite() || q1 == 0.0 || other.hi.is_infinite() {
            return Dd::from_f64(q1);
        }
        let rest = self - other * Dd::from_f64(q1);
        let q2 = rest.hi / other.hi;
        let rest = rest - other * Dd::from_f64(q2);
        let q3 = rest.hi / other.hi;
        let (q1, q2) = quick_two_sum(q1, q2);
        if !q3.is_finite() {
            // The rest of a division near the ends of the range.
            return Dd::from_f64(q1);
        }
        Dd::new(q1, q2) + Dd::from_f64(q3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small deterministic generator (splitmix64).
    struct Random(u64);

    impl Random {
        fn bits(&mut self) -> u64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        }

        fn number(&mut self) -> Dd {
            let hi = (self.bits() >> 11) as f64 / (1u64 << 50) as f64 - 4.0;
            Dd::new(hi, hi * 1e-17 * ((self.bits() >> 11) as f64 / (1u64 << 53) as f64))
        }
    }

    fn assert_close(a: Dd, b: Dd, tolerance: f64) {
        let error = (a - b).abs().hi;
        assert!(error <= tolerance * b.hi.abs().max(f64::MIN_POSITIVE), "{a:?} {b:?}: {error:e}");
    }

    #[test]
    fn arithmetic_identities_hold_to_thirty_digits() {
        let mut random = Random(1);
        for _ in 0..500 {
            let (a, b) = (random.number(), random.number());
            assert_close((a / b) * b, a, 1e-31);
            assert_close((a + b) * (a - b) + b * b, a * a, 1e-28_f64.max(1e-31 * (b.hi / a.hi).powi(2)));
            assert_close(a.square().sqrt(), a.abs(), 1e-31);
        }
    }

    #[test]
    fn known_digits() {
        // 1/3 and sqrt(2) to 34 digits: the low parts from exact rational arithmetic.
        let third = Dd::ONE / Dd::from_f64(3.0);
        assert_eq!((third.hi, third.lo), (0.333_333_333_333_333_3, 1.850_371_707_708_594e-17));
        let root = Dd::from_f64(2.0).sqrt();
        assert_eq!(root.hi, std::f64::consts::SQRT_2);
        assert!((root.lo + 9.667_293_313_452_913e-17).abs() < 1e-31);
        // (1 + 2^-80) - 1 = 2^-80 needs the low part.
        let small = 2.0_f64.powi(-80);
        assert_eq!((Dd::ONE + Dd::from_f64(small)) - Dd::ONE, Dd::from_f64(small));
    }

    #[test]
    fn range_and_non_finite_numbers() {
        let large = Dd::from_f64(1.7e308);
        assert_eq!((large * Dd::ONE).hi, 1.7e308);
        assert_eq!((large / large).hi, 1.0);
        assert_eq!((large + large).hi, f64::INFINITY);
        assert_eq!((large * large).hi, f64::INFINITY);
        assert!((Dd::from_f64(f64::INFINITY) - Dd::from_f64(f64::INFINITY)).hi.is_nan());
        assert_eq!((Dd::ONE / Dd::ZERO).hi, f64::INFINITY);
        assert_eq!((Dd::ONE / Dd::from_f64(f64::INFINITY)).hi, 0.0);
        assert!((Dd::ZERO / Dd::ZERO).hi.is_nan());
        assert!(Dd::from_f64(-1.0).sqrt().hi.is_nan());
        assert_eq!(Dd::from_f64(f64::INFINITY).sqrt().hi, f64::INFINITY);
        assert!(Dd::from_f64(-0.0).sqrt().hi.is_sign_negative());
        assert_eq!((Dd::from_f64(f64::INFINITY) + Dd::ONE).hi, f64::INFINITY);
    }
}
