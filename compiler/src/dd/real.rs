//! Double-double numbers as a type of the interpreter.

use super::Dd;
use crate::{
    asinh_exp,
    compare::Compare,
    math::{MathFn1, MathFn2},
    real::Real,
};

impl Real for Dd {
    const UNIT_ROUNDOFF: f64 = Dd::UNIT_ROUNDOFF;

    fn from_f64(x: f64) -> Self {
        Dd::from_f64(x)
    }
    fn to_f64(self) -> f64 {
        self.hi()
    }
    fn add(self, other: Self) -> Self {
        self + other
    }
    fn sub(self, other: Self) -> Self {
        self - other
    }
    fn mul(self, other: Self) -> Self {
        self * other
    }
    fn div(self, other: Self) -> Self {
        self / other
    }
    fn neg(self) -> Self {
        -self
    }
    fn abs(self) -> Self {
        Dd::abs(self)
    }
    fn sqrt(self) -> Self {
        Dd::sqrt(self)
    }
    fn compare(self, op: Compare, other: Self) -> bool {
        let tie = self.hi() == other.hi();
        match op {
            Compare::Less => self.hi() < other.hi() || (tie && self.lo() < other.lo()),
            Compare::LessEqual => self.hi() < other.hi() || (tie && self.lo() <= other.lo()),
            Compare::Equal => tie && self.lo() == other.lo(),
            Compare::NotEqual => !(tie && self.lo() == other.lo()),
        }
    }
    fn is_finite(self) -> bool {
        self.hi().is_finite()
    }
    fn call1(self, f: MathFn1) -> Self {
        self.function1(f)
    }
    fn call2(self, f: MathFn2, other: Self) -> Self {
        match f {
            MathFn2::Pow => self.pow(other),
            MathFn2::Atan2 => self.atan2(other),
            MathFn2::AsinhExp => asinh_exp::value(self, other),
            MathFn2::AsinhExpSlope => asinh_exp::slope(self, other),
        }
    }
}
