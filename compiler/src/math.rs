//! The mathematical functions that kernels can call: the only place that names `sin`, `exp`, `pow`, ...
//!
//! One set of transcendentals (crate `libm`) serves the interpreter and the machine code, so that both give the
//! same bits on every machine. Matrix functions are in `matrix_fn.rs`, other precisions in `real.rs` and `dd.rs`.
//!
//! Promises: no allocation, no panic, NaN where the real function does not exist.

/// Functions of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[expect(missing_docs, reason = "each is the function of that name")]
pub enum MathFn1 {
    Exp,
    Log,
    Log10,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Asinh,
    Acosh,
    Atanh,
    Erf,
    Erfc,
    /// `sin(t)/t`, 1 at 0
    Sinc,
    /// First derivative of `sinc`, 0 at 0
    SincFirst,
    /// Second derivative of `sinc`, -1/3 at 0
    SincSecond,
}

impl MathFn1 {
    /// Every function, in order of declaration.
    pub const ALL: [MathFn1; 20] = {
        use MathFn1::*;
        [
            Exp, Log, Log10, Sin, Cos, Tan, Asin, Acos, Atan, Sinh, Cosh, Tanh, Asinh, Acosh, Atanh, Erf, Erfc, Sinc,
            SincFirst, SincSecond,
        ]
    };

    /// The name in the language and in listings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            MathFn1::Exp => "exp",
            MathFn1::Log => "log",
            MathFn1::Log10 => "log10",
            MathFn1::Sin => "sin",
            MathFn1::Cos => "cos",
            MathFn1::Tan => "tan",
            MathFn1::Asin => "asin",
            MathFn1::Acos => "acos",
            MathFn1::Atan => "atan",
            MathFn1::Sinh => "sinh",
            MathFn1::Cosh => "cosh",
            MathFn1::Tanh => "tanh",
            MathFn1::Asinh => "asinh",
            MathFn1::Acosh => "acosh",
            MathFn1::Atanh => "atanh",
            MathFn1::Erf => "erf",
            MathFn1::Erfc => "erfc",
            MathFn1::Sinc => "sinc",
            MathFn1::SincFirst => "sinc_first",
            MathFn1::SincSecond => "sinc_second",
        }
    }

    /// The value at `t`: the only definition, for interpreter and machine code alike.
    #[must_use]
    #[inline]
    pub fn eval(self, t: f64) -> f64 {
        match self {
            MathFn1::Exp => libm::exp(t),
            MathFn1::Log => libm::log(t),
            MathFn1::Log10 => libm::log10(t),
            MathFn1::Sin => libm::sin(t),
            MathFn1::Cos => libm::cos(t),
            MathFn1::Tan => libm::tan(t),
            MathFn1::Asin => libm::asin(t),
            MathFn1::Acos => libm::acos(t),
            MathFn1::Atan => libm::atan(t),
            MathFn1::Sinh => libm::sinh(t),
            MathFn1::Cosh => libm::cosh(t),
            MathFn1::Tanh => libm::tanh(t),
            MathFn1::Asinh => libm::asinh(t),
            MathFn1::Acosh => libm::acosh(t),
            MathFn1::Atanh => libm::atanh(t),
            MathFn1::Erf => libm::erf(t),
            MathFn1::Erfc => libm::erfc(t),
            MathFn1::Sinc => sinc_derivative(0, t),
            MathFn1::SincFirst => sinc_derivative(1, t),
            MathFn1::SincSecond => sinc_derivative(2, t),
        }
    }
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
