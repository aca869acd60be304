//! Numbers of double and single precision, and the values of the mathematical functions at them: the only place that
//! names `sin`, `exp`, `pow`, ...
//!
//! One set of transcendentals (crate `libm`) serves the interpreter and the machine code, so that both give the same bits
//! on every machine. Promises: no allocation, no panic, NaN where the real function does not exist.

use crate::{
    asinh_exp,
    compare::Compare,
    math::{MathFn1, MathFn2},
    real::Real,
    sinc::sinc_derivative,
};

/// The value of a row at an f64.
macro_rules! at_f64 {
    ($t:ident native($f:path, $extended:expr, $slope:expr, $derivative:expr)) => {
        $f($t)
    };
    ($t:ident formula(|$x:ident| $value:expr, $derivative:expr)) => {{
        fn formula<T: Real>($x: T) -> T {
            $value
        }
        formula::<f64>($t)
    }};
}

macro_rules! values {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        impl MathFn1 {
            /// The value at `t`: the only definition, for interpreter and machine code alike.
            #[must_use]
            #[inline]
            pub fn eval(self, t: f64) -> f64 {
                match self {
                    $(MathFn1::$variant => at_f64!(t $form($($value)*))),*
                }
            }
        }
    };
}

wfl::scalar_functions!(values);

fn sinc(t: f64) -> f64 {
    sinc_derivative(0, t)
}

fn sinc_first(t: f64) -> f64 {
    sinc_derivative(1, t)
}

fn sinc_second(t: f64) -> f64 {
    sinc_derivative(2, t)
}

impl MathFn2 {
    /// The value at `(t, u)`: the only definition, for interpreter and machine code alike.
    #[must_use]
    #[inline]
    pub fn eval(self, t: f64, u: f64) -> f64 {
        match self {
            MathFn2::Pow => libm::pow(t, u),
            MathFn2::Atan2 => libm::atan2(t, u),
            MathFn2::AsinhExp => asinh_exp::value(t, u),
            MathFn2::AsinhExpSlope => asinh_exp::slope(t, u),
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::MatrixFn;

    /// Every smooth function beside itself in double-double arithmetic, from the smallest to the largest arguments.
    #[test]
    fn functions_near_zero_and_far_away_are_right_to_rounding() {
        let sizes =
            [0.0, 5e-324, 1e-300, 1e-17, 1e-9, 1e-3, 0.3, 0.7, 1.0, 5.0, 17.3, 36.1, 37.5, 100.0, 700.0, 744.0, 1e5];
        let smooth = [MathFn1::Expm1, MathFn1::Log1p, MathFn1::Softplus, MathFn1::Logistic];
        for f in smooth {
            for t in sizes.iter().flat_map(|t| [*t, -*t]) {
                let (found, right) = (f.eval(t), crate::Dd::from_f64(t).function1(f).hi());
                // below 1e-305 a result has fewer digits
                let bound = 4.0 * f64::EPSILON * right.abs() + 1e-320;
                let same = found == right || (found.is_nan() && right.is_nan());
                assert!(same || (found - right).abs() <= bound, "{}({t:e}): {found:e} {right:e}", f.name());
            }
        }
        assert_eq!([MathFn1::Softplus.eval(1e308), MathFn1::Softplus.eval(-1e308)], [1e308, 0.0]);
        assert_eq!([MathFn1::Logistic.eval(f64::INFINITY), MathFn1::Logistic.eval(f64::NEG_INFINITY)], [1.0, 0.0]);
        assert!(MathFn1::Softplus.eval(-744.0) > 0.0 && MathFn1::Logistic.eval(f64::NAN).is_nan());
    }

    #[test]
    fn functions_have_their_own_names_and_are_what_the_name_says() {
        let mut names: Vec<&str> = MathFn1::ALL.iter().map(|f| f.name()).collect();
        names.extend(MathFn2::ALL.iter().map(|f| f.name()));
        names.extend(MatrixFn::ALL.iter().map(|f| f.name()));
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
        let at_half = |f: MathFn1| f.eval(0.5);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
        close(at_half(MathFn1::Exp), 1.648_721_270_700_128_1);
        close(at_half(MathFn1::Log10), -std::f64::consts::LOG10_2);
        close(at_half(MathFn1::Asin), std::f64::consts::FRAC_PI_6);
        close(at_half(MathFn1::Acos), std::f64::consts::FRAC_PI_3);
        close(at_half(MathFn1::Tanh), 0.462_117_157_260_009_8);
        close(at_half(MathFn1::Atanh), 0.549_306_144_334_054_8);
        close(at_half(MathFn1::Erf), 0.520_499_877_813_046_5);
        close(at_half(MathFn1::Erf) + at_half(MathFn1::Erfc), 1.0);
        close(MathFn2::Pow.eval(2.0, -1.0), 0.5);
        close(MathFn2::Atan2.eval(1.0, 0.0), std::f64::consts::FRAC_PI_2);
    }
}
