//! The scalar types over which kernels can be interpreted.
//!
//! [`Real`] is what a kernel needs of a number: four operations, square root, comparison and the functions of
//! `math.rs`. `f64` gives exactly the bits of the machine code; `f32` and [`Dd`] show what precision costs and
//! gains; [`Dual`] gives derivatives that know nothing of the symbolic ones.
//!
//! It is no general numeric tower: no integers, no formatting, no conversions except through f64.

use crate::{
    compare::Compare,
    math::{MathFn1, MathFn2},
};

/// A number type for the interpreter.
pub trait Real: Copy + std::fmt::Debug {
    /// Relative rounding error of one operation, as an f64.
    const UNIT_ROUNDOFF: f64;

    /// The nearest number to an f64.
    fn from_f64(x: f64) -> Self;
    /// The nearest f64; of a dual number its value.
    fn to_f64(self) -> f64;
    /// `self + other`
    fn add(self, other: Self) -> Self;
    /// `self - other`
    fn sub(self, other: Self) -> Self;
    /// `self * other`
    fn mul(self, other: Self) -> Self;
    /// `self / other`
    fn div(self, other: Self) -> Self;
    /// `-self`
    fn neg(self) -> Self;
    /// `|self|`
    fn abs(self) -> Self;
    /// Square root, NaN below 0.
    fn sqrt(self) -> Self;
    /// A comparison; all but `NotEqual` are false when an operand is NaN. Dual numbers compare by value.
    fn compare(self, op: Compare, other: Self) -> bool;
    /// Neither infinite nor NaN, in every component.
    fn is_finite(self) -> bool;
    /// A function of one number.
    fn call1(self, f: MathFn1) -> Self;
    /// A function of two numbers, `self` first.
    fn call2(self, f: MathFn2, other: Self) -> Self;
}

#[cfg(test)]
mod tests;
