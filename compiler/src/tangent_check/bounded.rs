//! Double-double numbers that carry a bound of their own rounding error (running error analysis, Wilkinson).
//!
//! Says below which size a difference of residuals is noise. The bound is of first order: products of errors are
//! left out, and a branch that an error would turn is not seen.

use crate::{
    compare::Compare,
    dd::Dd,
    dual::Dual,
    math::{MathFn1, MathFn2},
    real::Real,
};

/// A number with a bound of its error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounded {
    /// The number.
    pub(super) value: Dd,
    /// Bound of its error.
    pub(super) error: f64,
}

/// Error of one operation of [`Dd`], functions included, over its result: a few units in the last place.
const ROUNDING: f64 = 16.0 * Dd::UNIT_ROUNDOFF;

fn rounded(value: Dd, inherited: f64) -> Bounded {
    Bounded { value, error: inherited + ROUNDING * value.hi().abs() }
}

impl Real for Bounded {
    const UNIT_ROUNDOFF: f64 = Dd::UNIT_ROUNDOFF;

    fn from_f64(x: f64) -> Self {
        Self { value: Dd::from_f64(x), error: 0.0 }
    }
    fn to_f64(self) -> f64 {
        self.value.hi()
    }
    fn add(self, other: Self) -> Self {
        rounded(self.value + other.value, self.error + other.error)
    }
    fn sub(self, other: Self) -> Self {
        rounded(self.value - other.value, self.error + other.error)
    }
    fn mul(self, other: Self) -> Self {
        let inherited = self.error * other.value.hi().abs() + other.error * self.value.hi().abs();
        rounded(self.value * other.value, inherited)
    }
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        rounded(value, (self.error + value.hi().abs() * other.error) / other.value.hi().abs())
    }
    fn neg(self) -> Self {
        Self { value: -self.value, error: self.error }
    }
    fn abs(self) -> Self {
        Self { value: self.value.abs(), error: self.error }
    }
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        // the root of what may be zero is uncertain by the root of the error
        let slope =
            if value.hi() * value.hi() > self.error { 0.5 * self.error / value.hi() } else { self.error.sqrt() };
        rounded(value, slope)
    }
    fn compare(self, op: Compare, other: Self) -> bool {
        self.value.compare(op, other.value)
    }
    fn is_finite(self) -> bool {
        self.value.is_finite()
    }
    fn call1(self, f: MathFn1) -> Self {
        rounded(self.value.call1(f), spread(self.error, |x| x.call1(f), self.value.hi()))
    }
    fn call2(self, f: MathFn2, other: Self) -> Self {
        let (a, b) = (self.value.hi(), other.value.hi());
        let first = spread(self.error, |x| x.call2(f, Dual::from_f64(b)), a);
        let second = spread(other.error, |x| Dual::from_f64(a).call2(f, x), b);
        rounded(self.value.call2(f, other.value), first + second)
    }
}

/// An error of an argument seen through a function.
fn spread(error: f64, f: impl Fn(Dual) -> Dual, at: f64) -> f64 {
    if error == 0.0 { 0.0 } else { (f(Dual::new(at, 1.0)).slope * error).abs() }
}
