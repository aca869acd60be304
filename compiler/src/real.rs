//! The scalar types over which kernels can be interpreted.
//!
//! [`Real`] is what a kernel needs of a number: four operations, square root, comparison and the functions of
//! `math.rs`. `f64` gives exactly the bits of the machine code; `f32` and [`Dd`] show what precision costs and
//! gains; [`Dual`] gives derivatives that know nothing of the symbolic ones.
//!
//! It is no general numeric tower: no integers, no formatting, no conversions except through f64.

use crate::{
    dd::Dd,
    ir::Compare,
    math::{MathFn1, MathFn2, sinc_derivative},
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

impl Real for f64 {
    const UNIT_ROUNDOFF: f64 = f64::EPSILON / 2.0;

    fn from_f64(x: f64) -> Self {
        x
    }
    fn to_f64(self) -> f64 {
        self
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
        f64::abs(self)
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    fn compare(self, op: Compare, other: Self) -> bool {
        op.holds(self, other)
    }
    fn is_finite(self) -> bool {
        f64::is_finite(self)
    }
    fn call1(self, f: MathFn1) -> Self {
        f.eval(self)
    }
    fn call2(self, f: MathFn2, other: Self) -> Self {
        f.eval(self, other)
    }
}

/// Single precision: every operation rounds to f32; functions are those of f64, rounded once.
impl Real for f32 {
    const UNIT_ROUNDOFF: f64 = f32::EPSILON as f64 / 2.0;

    fn from_f64(x: f64) -> Self {
        x as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
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
        f32::abs(self)
    }
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
    fn compare(self, op: Compare, other: Self) -> bool {
        op.holds(f64::from(self), f64::from(other))
    }
    fn is_finite(self) -> bool {
        f32::is_finite(self)
    }
    fn call1(self, f: MathFn1) -> Self {
        f.eval(f64::from(self)) as f32
    }
    fn call2(self, f: MathFn2, other: Self) -> Self {
        f.eval(f64::from(self), f64::from(other)) as f32
    }
}

/// A value with its derivative in one direction: forward differentiation over f64.
///
/// Where a function has no derivative (`|t|` at 0, `sqrt` at 0) the one-sided rule of its formula applies: `|t|`
/// continues as `t`, `sqrt` gives an infinite or NaN slope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual {
    /// The value.
    pub value: f64,
    /// Its derivative.
    pub slope: f64,
}

impl Dual {
    /// A number that varies with the direction.
    #[must_use]
    pub fn new(value: f64, slope: f64) -> Self {
        Self { value, slope }
    }

    /// `f(self)` by the chain rule; a constant keeps slope 0 even where `f` has an infinite derivative.
    fn chain(self, value: f64, derivative: f64) -> Self {
        Self { value, slope: if self.slope == 0.0 { 0.0 } else { derivative * self.slope } }
    }
}

impl Real for Dual {
    const UNIT_ROUNDOFF: f64 = f64::EPSILON / 2.0;

    fn from_f64(x: f64) -> Self {
        Self { value: x, slope: 0.0 }
    }
    fn to_f64(self) -> f64 {
        self.value
    }
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: self.slope + other.slope }
    }
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slope: self.slope - other.slope }
    }
    fn mul(self, other: Self) -> Self {
        Self { value: self.value * other.value, slope: self.slope * other.value + self.value * other.slope }
    }
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, slope: (self.slope - value * other.slope) / other.value }
    }
    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
    fn abs(self) -> Self {
        if self.value < 0.0 { self.neg() } else { Self { value: self.value.abs(), slope: self.slope } }
    }
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root)
    }
    fn compare(self, op: Compare, other: Self) -> bool {
        op.holds(self.value, other.value)
    }
    fn is_finite(self) -> bool {
        self.value.is_finite() && self.slope.is_finite()
    }
    fn call1(self, f: MathFn1) -> Self {
        let value = f.eval(self.value);
        self.chain(value, derivative1(f, self.value, value))
    }
    fn call2(self, f: MathFn2, other: Self) -> Self {
        let (t, u) = (self.value, other.value);
        let value = f.eval(t, u);
        let (in_t, in_u) = match f {
            MathFn2::Pow => (u * libm::pow(t, u - 1.0), if other.slope == 0.0 { 0.0 } else { value * libm::log(t) }),
            MathFn2::Atan2 => {
                // t / (t^2 + u^2) without overflow of the squares.
                let h = libm::hypot(t, u);
                (u / h / h, -(t / h / h))
            }
        };
        self.chain(value, in_t).add(Self { value: 0.0, slope: other.chain(0.0, in_u).slope })
    }
}

/// The slope of a row at `t`, where it has the value `y`.
macro_rules! slope_of {
    ($t:ident $y:ident native($f:path, $extended:expr, $slope:expr, $derivative:expr)) => {{
        let slope: fn(f64, f64) -> f64 = $slope;
        slope($t, $y)
    }};
    ($t:ident $y:ident formula(|$x:ident| $value:expr, $derivative:expr)) => {{
        fn formula<T: Real>($x: T) -> T {
            $value
        }
        formula(Dual::new($t, 1.0)).slope
    }};
}

macro_rules! slopes {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        /// The derivative of `f` at `t`, where it has the value `y`.
        fn derivative1(f: MathFn1, t: f64, y: f64) -> f64 {
            match f {
                $(MathFn1::$variant => slope_of!(t y $form($($value)*))),*
            }
        }
    };
}

wfl::scalar_functions!(slopes);

/// Derivative of the error function.
fn bell(t: f64) -> f64 {
    std::f64::consts::FRAC_2_SQRT_PI * libm::exp(-t * t)
}

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
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dual_slopes_of_all_functions_match_differences_in_double_double() {
        // Central differences with h = 1e-10 in 31 digits: error of order 1e-20.
        let h = Dd::from_f64(1e-10);
        for f in MathFn1::ALL {
            for t in [0.2, 0.7, 1.3, 2.6] {
                let t = if f == MathFn1::Acosh { t + 1.0 } else { t };
                let x = Dd::from_f64(t);
                let slope = (((x + h).call1(f) - (x - h).call1(f)) / (h + h)).hi();
                let dual = Dual::new(t, 1.0).call1(f);
                assert_eq!(dual.value.to_bits(), f.eval(t).to_bits());
                if dual.value.is_nan() {
                    assert!(slope.is_nan(), "{f:?} at {t}");
                    continue;
                }
                let scale = slope.abs().max(0.05);
                assert!((dual.slope - slope).abs() < 2e-14 * scale, "{f:?} at {t}: {} {slope}", dual.slope);
            }
        }
        for f in MathFn2::ALL {
            for (t, u) in [(0.3, 1.7), (2.5, -0.4), (1.0, 3.0)] {
                for (dt, du) in [(1.0, 0.0), (0.0, 1.0)] {
                    let at = |s: Dd| {
                        (Dd::from_f64(t) + s * Dd::from_f64(dt)).call2(f, Dd::from_f64(u) + s * Dd::from_f64(du))
                    };
                    let slope = ((at(h) - at(-h)) / (h + h)).hi();
                    let dual = Dual::new(t, dt).call2(f, Dual::new(u, du));
                    assert!((dual.slope - slope).abs() < 1e-14 * slope.abs().max(0.1), "{f:?} {t} {u}");
                }
            }
        }
    }

    #[test]
    fn dual_arithmetic_is_the_product_and_quotient_rule() {
        let (a, b) = (Dual::new(3.0, 1.0), Dual::new(-2.0, 5.0));
        assert_eq!(a.mul(b), Dual::new(-6.0, 13.0));
        assert_eq!(a.div(b), Dual::new(-1.5, -4.25));
        assert_eq!(b.abs(), Dual::new(2.0, -5.0));
        assert_eq!(Dual::new(4.0, 2.0).sqrt(), Dual::new(2.0, 0.5));
        // A constant has no slope even where the function is vertical.
        assert_eq!(Dual::from_f64(0.0).sqrt(), Dual::new(0.0, 0.0));
        assert_eq!(Dual::new(-2.0, 1.0).call2(MathFn2::Pow, Dual::from_f64(3.0)), Dual::new(-8.0, 12.0));
    }

    #[test]
    fn single_precision_rounds_every_operation() {
        let tiny = f32::from_f64(1e-8);
        assert_eq!(1.0_f32.add(tiny), 1.0);
        assert_eq!(Real::to_f64(1.0_f32.call1(MathFn1::Exp)), f64::from(std::f32::consts::E));
    }

    #[test]
    fn comparisons_with_nan_are_false_except_not_equal() {
        fn check<T: Real>() {
            let (nan, one) = (T::from_f64(f64::NAN), T::from_f64(1.0));
            for op in [Compare::Less, Compare::LessEqual, Compare::Equal] {
                assert!(!nan.compare(op, one) && !one.compare(op, nan) && !nan.compare(op, nan));
            }
            assert!(nan.compare(Compare::NotEqual, nan) && nan.compare(Compare::NotEqual, one));
            assert!(T::from_f64(-0.0).compare(Compare::Equal, T::from_f64(0.0)));
            assert!(one.compare(Compare::LessEqual, T::from_f64(f64::INFINITY)));
        }
        check::<f64>();
        check::<f32>();
        check::<Dd>();
        check::<Dual>();
    }
}
