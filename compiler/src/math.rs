//! The mathematical functions that kernels can call: the only place that names `sin`, `exp`, `pow`, ...
//!
//! One set of transcendentals (crate `libm`) serves the interpreter and the machine code, so that both give the
//! same bits on every machine. Matrix functions are in `matrix_fn.rs`, other precisions in `real.rs` and `dd.rs`.
//!
//! Promises: no allocation, no panic, NaN where the real function does not exist.

use crate::{ir::Compare, real::Real};

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

macro_rules! declare {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        /// Functions of one number; `wfl/src/scalar_functions.rs` has a row for each.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum MathFn1 {
            $(#[doc = $doc] $variant),*
        }

        impl MathFn1 {
            /// Every function, in order of the rows.
            pub const ALL: [MathFn1; [$($name),*].len()] = [$(MathFn1::$variant),*];

            /// The name in the language and in listings.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(MathFn1::$variant => $name),*
                }
            }

            /// The value at `t`: the only definition, for interpreter and machine code alike.
            #[must_use]
            #[inline]
            pub fn eval(self, t: f64) -> f64 {
                match self {
                    $(MathFn1::$variant => at_f64!(t $form($($value)*))),*
                }
            }

            /// Expressions that the tests differentiate; none for functions that the language does not have.
            #[must_use]
            pub fn samples(self) -> &'static [&'static str] {
                match self {
                    $(MathFn1::$variant => &[$($sample),*]),*
                }
            }
        }
    };
}

wfl::scalar_functions!(declare);

fn sinc(t: f64) -> f64 {
    sinc_derivative(0, t)
}

fn sinc_first(t: f64) -> f64 {
    sinc_derivative(1, t)
}

fn sinc_second(t: f64) -> f64 {
    sinc_derivative(2, t)
}

/// Functions of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MathFn2 {
    /// `pow(t, u)`: t to the u, C99 rules
    Pow,
    /// `atan2(t, u)`: the angle of the point (u, t)
    Atan2,
}

impl MathFn2 {
    /// Every function, in order of declaration.
    pub const ALL: [MathFn2; 2] = [MathFn2::Pow, MathFn2::Atan2];

    /// The name in the language and in listings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            MathFn2::Pow => "pow",
            MathFn2::Atan2 => "atan2",
        }
    }

    /// The value at `(t, u)`: the only definition, for interpreter and machine code alike.
    #[must_use]
    #[inline]
    pub fn eval(self, t: f64, u: f64) -> f64 {
        match self {
            MathFn2::Pow => libm::pow(t, u),
            MathFn2::Atan2 => libm::atan2(t, u),
        }
    }
}

/// Functions of a square matrix (1 by 1 to 3 by 3), entries column by column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MatrixFn {
    /// Matrix exponential: `n*n` results.
    Expm,
    /// Its Frechet derivative as a matrix: result `k + n*n*l` is the derivative of entry k in entry l: `n^4` results.
    ExpmDerivative,
    /// Principal matrix logarithm: `n*n` results.
    Logm,
    /// Its Frechet derivative, as for `ExpmDerivative`.
    LogmDerivative,
}

impl MatrixFn {
    /// Every function, in order of declaration.
    pub const ALL: [MatrixFn; 4] = [MatrixFn::Expm, MatrixFn::ExpmDerivative, MatrixFn::Logm, MatrixFn::LogmDerivative];

    /// The name in listings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            MatrixFn::Expm => "expm",
            MatrixFn::ExpmDerivative => "expm_derivative",
            MatrixFn::Logm => "logm",
            MatrixFn::LogmDerivative => "logm_derivative",
        }
    }

    /// Number of results for an n by n matrix.
    #[must_use]
    pub fn n_results(self, n: usize) -> usize {
        match self {
            MatrixFn::Expm | MatrixFn::Logm => n * n,
            MatrixFn::ExpmDerivative | MatrixFn::LogmDerivative => n * n * n * n,
        }
    }
}

/// Below this the series of `sinc` is summed, above it the closed form does not cancel by more than a digit.
pub(crate) const SINC_SERIES_BOUND: f64 = 2.0;

/// Terms of the series: at the bound the first one left out is below 1e-21 in all four derivatives.
const SINC_TERMS: usize = 17;

/// Coefficients of the derivatives 0 to 3 of `sinc`: derivative d is `t^(d mod 2) sum_i c[d][i] t^(2 i)`.
const SINC_SERIES: [[f64; SINC_TERMS]; 4] =
    [sinc_coefficients(0), sinc_coefficients(1), sinc_coefficients(2), sinc_coefficients(3)];

/// From `sinc(t) = sum_k (-1)^k t^(2 k) / (2 k + 1)!`, differentiated `order` times.
const fn sinc_coefficients(order: usize) -> [f64; SINC_TERMS] {
    let mut out = [0.0; SINC_TERMS];
    let mut i = 0;
    while i < SINC_TERMS {
        let k = i + order.div_ceil(2);
        let mut c = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut d = 0;
        while d < order {
            c *= (2 * k - d) as f64;
            d += 1;
        }
        let mut factorial = 1.0;
        let mut j = 2;
        while j <= 2 * k + 1 {
            factorial *= j as f64;
            j += 1;
        }
        out[i] = c / factorial;
        i += 1;
    }
    out
}

/// Derivative number `order` (0 to 3) of `sinc(t) = sin(t)/t`, by series near 0.
///
/// Far from 0 by repeated differentiation of `t s(t) = sin(t)`: `t s1 + s = cos`, `t s2 + 2 s1 = -sin`,
/// `t s3 + 3 s2 = -cos`.
pub(crate) fn sinc_derivative(order: usize, t: f64) -> f64 {
    if t.abs() < SINC_SERIES_BOUND {
        let square = t * t;
        let sum = SINC_SERIES[order].iter().rev().fold(0.0, |sum, c| sum * square + c);
        return if order % 2 == 1 { sum * t } else { sum };
    }
    let s = libm::sin(t) / t;
    if order == 0 {
        return s;
    }
    let cosine = libm::cos(t);
    let first = (cosine - s) / t;
    if order == 1 {
        return first;
    }
    let second = -s - 2.0 * (first / t);
    if order == 2 { second } else { -(cosine + 3.0 * second) / t }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From 40-digit arithmetic: t, then derivatives 0 to 3 of sinc.
    const SINC: [(f64, [f64; 4]); 6] = [
        (1e-8, [1.0, -3.3333333333333334e-09, -0.3333333333333333, 2e-09]),
        (0.5, [0.958851077208406, -0.16253703063606656, -0.3087029546641397, 0.09705260420409291]),
        (1.9999, [0.45469225309404465, -0.43539584870139597, -0.019274633511669546, 0.23695175021695375]),
        (2.0001, [0.45460517353912755, -0.43539969888908897, -0.019227243546538247, 0.23694790002927557]),
        (7.25, [0.11352839710503523, 0.06267527947360822, -0.1308181293736168, -0.024202728988668196]),
        (1e3, [0.0008268795405320026, 0.0005615521967501709, -0.0008280026449255029, -0.0005598950683559264]),
    ];

    #[test]
    fn sinc_family_matches_published_digits() {
        for (t, expected) in SINC {
            for (order, value) in expected.into_iter().enumerate() {
                let error = (sinc_derivative(order, t) - value).abs();
                // Near a zero of a derivative only the error relative to the size of its terms can be small.
                let scale = value.abs().max(0.5_f64.min(1.0 / t) * 0.2);
                let scale = if t < 0.1 { value.abs() } else { scale };
                assert!(error <= 4.0 * f64::EPSILON * scale, "order {order} at {t}: error {error:e}");
                let sign = if order % 2 == 1 { -1.0 } else { 1.0 };
                assert_eq!(sinc_derivative(order, -t), sign * sinc_derivative(order, t));
            }
        }
        assert_eq!(MathFn1::Sinc.eval(0.0), 1.0);
        assert_eq!(MathFn1::SincFirst.eval(0.0), 0.0);
        assert_eq!(MathFn1::SincSecond.eval(0.0), -1.0 / 3.0);
    }

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
