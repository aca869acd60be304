//! The functions of `math.rs` in double-double precision.
//!
//! Method: argument reduction and Taylor series for `exp`, `sin`, `cos`, `sinh`; one Newton step in double-double
//! from the f64 value for their inverses (the error is squared); series and continued fraction for `erf`, `erfc`.
//! Relative error about 1e-30 in ordinary ranges; next to a zero of `sin`, `cos`, `log`, ... it stays relative to the
//! result.
//!
//! Where it does less: `sin`, `cos`, `tan` beyond 2^40 have the accuracy of f64; results that are subnormal as well.
//! Special values (zeros, infinities, NaN, outside the domain) are those of `libm`.

use std::f64::consts;

use super::{Dd, quick_two_sum, two_prod, two_sum};
use crate::{
    ir::Compare,
    math::{MathFn1, MathFn2, SINC_SERIES_BOUND},
    real::Real,
};

/// log(2) in three parts, so that `k log(2)` is known to 1e-48 k.
const LN2: [f64; 3] = [consts::LN_2, 2.3190468138462996e-17, 5.707708438416212e-34];
/// log(10).
const LN10: Dd = Dd::constant(consts::LN_10, -2.1707562233822494e-16);
/// pi/2 in four parts.
const HALF_PI: [f64; 4] = [consts::FRAC_PI_2, 6.123233995736766e-17, -1.4973849048591698e-33, 5.562271104316826e-50];
/// 2/sqrt(pi).
const TWO_OVER_SQRT_PI: Dd = Dd::constant(consts::FRAC_2_SQRT_PI, 1.533545961316588e-17);
/// sqrt(pi).
const SQRT_PI: Dd = Dd::constant(1.772453850905516, -7.666586499825799e-17);
/// Beyond this, trigonometric functions have the accuracy of f64.
const TRIGONOMETRIC_BOUND: f64 = 1_099_511_627_776.0; // 2^40
/// Series stop when a term falls below this part of the sum.
const SERIES_END: f64 = 1e-34;

/// Sums `first (1 + r(1) + r(1) r(2) + ...)`, where `ratio(k)` is the quotient of term k and term k - 1.
fn series(first: Dd, ratio: impl Fn(f64) -> Dd) -> Dd {
    let (mut sum, mut term, mut k) = (first, first, 1.0);
    while term.hi.abs() > SERIES_END * sum.hi.abs() && k < 1000.0 {
        term = term * ratio(k);
        sum = sum + term;
        k += 1.0;
    }
    sum
}

/// `2 atanh(z) = log((1 + z)/(1 - z)) = 2 sum z^(2k+1)/(2k+1)` for small z.
fn log_from_ratio(z: Dd) -> Dd {
    if z.hi == 0.0 {
        return Dd::ZERO;
    }
    let square = z.square();
    series(z, |k| square * Dd::from_f64(2.0 * k - 1.0) / Dd::from_f64(2.0 * k + 1.0)).scale(2.0)
}

/// A row in double-double precision.
macro_rules! in_dd {
    ($x:ident native($f:path, $extended:expr, $slope:expr, $derivative:expr)) => {{
        let extended: fn(Dd) -> Dd = $extended;
        extended($x)
    }};
    ($x:ident formula(|$t:ident| $value:expr, $derivative:expr)) => {{
        fn formula<T: Real>($t: T) -> T {
            $value
        }
        formula::<Dd>($x)
    }};
}

macro_rules! extended_values {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        /// A function at a point where it is finite.
        fn extended(f: MathFn1, x: Dd) -> Dd {
            match f {
                $(MathFn1::$variant => in_dd!(x $form($($value)*))),*
            }
        }
    };
}

wfl::scalar_functions!(extended_values);

/// `x - k (p0 + p1 + ...)` without cancellation, for integers k and parts of falling size.
fn reduce(x: Dd, k: f64, parts: &[f64]) -> Dd {
    // The first difference is exact (or nearly so), the others are corrections of falling size.
    let (p, e) = two_prod(k, parts[0]);
    let (s, t) = two_sum(x.hi, -p);
    let mut rest = Dd::new(s, t) + Dd::from_f64(x.lo) + Dd::from_f64(-e);
    for part in &parts[1..] {
        let (p, e) = two_prod(k, *part);
        rest = rest + Dd::new(-p, -e);
    }
    rest
}

impl Dd {
    /// A function of one number.
    #[must_use]
    pub fn function1(self, f: MathFn1) -> Dd {
        let rough = f.eval(self.hi);
        // Special values, poles and zeros at 0 are those of libm.
        if !rough.is_finite() || !self.hi.is_finite() || (self.hi == 0.0 && rough == 0.0) {
            return Dd::from_f64(rough);
        }
        extended(f, self)
    }

    fn log10(self) -> Dd {
        self.log() / LN10
    }

    fn sin(self) -> Dd {
        self.sin_cos().0
    }

    fn cos(self) -> Dd {
        self.sin_cos().1
    }

    fn tan(self) -> Dd {
        let (sine, cosine) = self.sin_cos();
        sine / cosine
    }

    fn asin(self) -> Dd {
        self.atan2(((Dd::ONE - self) * (Dd::ONE + self)).sqrt())
    }

    fn acos(self) -> Dd {
        ((Dd::ONE - self) * (Dd::ONE + self)).sqrt().atan2(self)
    }

    fn atan(self) -> Dd {
        self.atan2(Dd::ONE)
    }

    /// acosh(t) = 2 asinh(sqrt((t - 1)/2)): no cancellation at 1.
    fn acosh(self) -> Dd {
        (self - Dd::ONE).scale(0.5).sqrt().asinh().scale(2.0)
    }

    /// `exp(x) - 1`: near 0 as 2 sinh(x/2) exp(x/2), which cancels nothing.
    fn expm1(self) -> Dd {
        if self.hi.abs() < 0.5 {
            let half = self.scale(0.5);
            return half.sinh().scale(2.0) * half.exp();
        }
        self.exp() - Dd::ONE
    }

    /// `log(1 + x)`: near 0 by the series of `2 atanh(x/(2 + x))`.
    fn log1p(self) -> Dd {
        if self.hi.abs() >= 0.2 {
            return (Dd::ONE + self).log();
        }
        log_from_ratio(self / (self + Dd::from_f64(2.0)))
    }

    /// `exp`: x = k log 2 + 256 r, Taylor series of `exp(r) - 1`, eight times `e -> e (e + 2)`, which keeps the
    /// digits that squaring `exp(r)` itself would lose.
    #[must_use]
    pub fn exp(self) -> Dd {
        if self.hi.is_nan() || self.hi.abs() >= 745.2 {
            return Dd::from_f64(libm::exp(self.hi));
        }
        let k = libm::rint(self.hi / consts::LN_2);
        let r = reduce(self, k, &LN2).scale(1.0 / 256.0);
        if r.hi == 0.0 {
            return Dd::ONE.scale(libm::exp2(k));
        }
        let mut less_one = series(r, |k| r / Dd::from_f64(k + 1.0));
        for _ in 0..8 {
            less_one = less_one * (less_one + Dd::from_f64(2.0));
        }
        // In two factors: 2^k alone may leave the range where the product does not.
        let half = libm::trunc(k / 2.0);
        (less_one + Dd::ONE).scale(libm::exp2(half)).scale(libm::exp2(k - half))
    }

    /// `log`: near 1 by `2 atanh((x - 1)/(x + 1))`, else one Newton step for `exp(y) = x`.
    #[must_use]
    pub fn log(self) -> Dd {
        let rough = libm::log(self.hi);
        if !rough.is_finite() || !self.hi.is_finite() {
            return Dd::from_f64(rough);
        }
        if (self.hi - 1.0).abs() < 0.2 {
            return log_from_ratio((self - Dd::ONE) / (self + Dd::ONE));
        }
        // Keep exp(-y) and its low part in range.
        if self.hi < 1e-250 {
            return self.scale(UP).log() - log_power(40.0);
        }
        if self.hi > 1e250 {
            return self.scale(1.0 / UP).log() + log_power(40.0);
        }
        let y = Dd::from_f64(rough);
        y + (self * (-y).exp() - Dd::ONE)
    }

    /// Sine and cosine: reduction by multiples of pi/2, Taylor series on [-pi/4, pi/4].
    fn sin_cos(self) -> (Dd, Dd) {
        if self.hi.abs() > TRIGONOMETRIC_BOUND {
            return (Dd::from_f64(libm::sin(self.hi)), Dd::from_f64(libm::cos(self.hi)));
        }
        let k = libm::rint(self.hi * consts::FRAC_2_PI);
        let r = reduce(self, k, &HALF_PI);
        let square = -r.square();
        let sine = if r.hi == 0.0 { r } else { series(r, |k| square / Dd::from_f64(2.0 * k * (2.0 * k + 1.0))) };
        let cosine = series(Dd::ONE, |k| square / Dd::from_f64(2.0 * k * (2.0 * k - 1.0)));
        match (k as i64).rem_euclid(4) {
            0 => (sine, cosine),
            1 => (cosine, -sine),
            2 => (-sine, -cosine),
            _ => (-cosine, sine),
        }
    }

    /// The angle of the point (x, self): f64 angle a, then `atan` of the angle that is left,
    /// `(y cos a - x sin a) / (x cos a + y sin a)`, which is so small that `atan` does nothing.
    #[must_use]
    pub fn atan2(self, x: Dd) -> Dd {
        let rough = libm::atan2(self.hi, x.hi);
        let largest = self.hi.abs().max(x.hi.abs());
        if !rough.is_finite() || !largest.is_finite() {
            return Dd::from_f64(rough);
        }
        if self.hi == 0.0 {
            let pi = Dd::constant(2.0 * HALF_PI[0], 2.0 * HALF_PI[1]);
            return match (rough == 0.0, rough.is_sign_negative()) {
                (true, _) => Dd::from_f64(rough),
                (false, true) => -pi,
                (false, false) => pi,
            };
        }
        // Powers of two, in two steps so that neither leaves the range.
        let half = libm::exp2(-f64::from(libm::ilogb(largest) / 2));
        let (y, x) = (self.scale(half).scale(half), x.scale(half).scale(half));
        let a = Dd::from_f64(rough);
        if rough.abs() < 1e-290 {
            return y / x;
        }
        let (sine, cosine) = a.sin_cos();
        a + (y * cosine - x * sine) / (x * cosine + y * sine)
    }

    fn sinh(self) -> Dd {
        if self.hi.abs() < 0.5 {
            let square = self.square();
            return series(self, |k| square / Dd::from_f64(2.0 * k * (2.0 * k + 1.0)));
        }
        let e = self.abs().exp_half();
        let y = e - Dd::from_f64(0.25) / e;
        if self.hi < 0.0 { -y } else { y }
    }

    fn cosh(self) -> Dd {
        let e = self.abs().exp_half();
        e + Dd::from_f64(0.25) / e
    }

    /// `exp(self)/2`, finite as long as the result is.
    fn exp_half(self) -> Dd {
        if self.hi > 700.0 {
            let root = self.scale(0.5).exp();
            root * root.scale(0.5)
        } else {
            self.exp().scale(0.5)
        }
    }

    fn tanh(self) -> Dd {
        if self.hi.abs() < 0.5 {
            return self.sinh() / self.cosh();
        }
        let x = self.abs();
        let far = Dd::ONE - Dd::from_f64(2.0) / (x.scale(2.0).exp() + Dd::ONE);
        let far = if x.hi > 40.0 { Dd::ONE } else { far };
        if self.hi < 0.0 { -far } else { far }
    }

    /// One Newton step for `sinh(y) = x`; beyond 1e100 `asinh(x) = log(2 x)` to all digits.
    fn asinh(self) -> Dd {
        if self.hi == 0.0 {
            return self;
        }
        let x = self.abs();
        let y = if x.hi > 1e100 {
            x.log() + log_power(1.0)
        } else {
            let y = Dd::from_f64(libm::asinh(x.hi));
            y + (x - y.sinh()) / y.cosh()
        };
        if self.hi < 0.0 { -y } else { y }
    }

    /// `tanh(atanh(x) - y) = (x cosh y - sinh y) / (cosh y - x sinh y)` with the f64 value y.
    fn atanh(self) -> Dd {
        let y = Dd::from_f64(libm::atanh(self.hi));
        let (sinh, cosh) = (y.sinh(), y.cosh());
        y + (self * cosh - sinh) / (cosh - self * sinh)
    }

    /// `erf(x) = 2/sqrt(pi) exp(-x^2) sum_k 2^k x^(2k+1) / (1 3 5 ... (2k+1))`: all terms of one sign.
    fn erf(self) -> Dd {
        if self.hi.abs() >= 1.5 {
            let near_one = Dd::ONE - self.abs().erfc();
            return if self.hi < 0.0 { -near_one } else { near_one };
        }
        let twice = self.square().scale(2.0);
        TWO_OVER_SQRT_PI * (-self.square()).exp() * series(self, |k| twice / Dd::from_f64(2.0 * k + 1.0))
    }

    /// `1 - erf(x)`, beyond 1.5 by the continued fraction
    /// `exp(-x^2)/sqrt(pi) / (x + (1/2)/(x + (2/2)/(x + (3/2)/(x + ...))))`, evaluated from its end.
    fn erfc(self) -> Dd {
        if self.hi < 1.5 {
            return Dd::ONE - self.erf();
        }
        if self.hi > 27.3 {
            return Dd::ZERO;
        }
        // The error after n levels falls like exp(-c x sqrt(n)); found by comparison with more levels.
        let levels = libm::ceil(1000.0 / (self.hi * self.hi)) + 40.0;
        let mut tail = self;
        let mut k = levels;
        while k >= 1.0 {
            tail = self + Dd::from_f64(k / 2.0) / tail;
            k -= 1.0;
        }
        (-self.square()).exp() / (SQRT_PI * tail)
    }

    /// Derivatives 0 to 2 of `sin(t)/t`, as in `math.rs`.
    fn sinc_derivative(self, order: u8) -> Dd {
        if self.hi.abs() >= SINC_SERIES_BOUND {
            let (sine, cosine) = self.sin_cos();
            let s = sine / self;
            let first = (cosine - s) / self;
            return match order {
                0 => s,
                1 => first,
                _ => -s - (first / self).scale(2.0),
            };
        }
        let square = -self.square();
        // Terms (-1)^k t^(2k) / (2k+1)!, differentiated: the factor of term k over that of term k - 1.
        let base = |k: f64| square / Dd::from_f64(2.0 * k * (2.0 * k + 1.0));
        match order {
            0 => series(Dd::ONE, base),
            1 => {
                let first = -self / Dd::from_f64(3.0);
                if first.hi == 0.0 {
                    return first;
                }
                series(first, |k| base(k + 1.0) * Dd::from_f64(k + 1.0) / Dd::from_f64(k))
            }
            _ => {
                let first = -(Dd::ONE / Dd::from_f64(3.0));
                series(first, |k| {
                    let (top, bottom) = ((2.0 * k + 2.0) * (2.0 * k + 1.0), 2.0 * k * (2.0 * k - 1.0));
                    base(k + 1.0) * Dd::from_f64(top) / Dd::from_f64(bottom)
                })
            }
        }
    }

    /// `self` to the `power`, C99 rules for special values; `exp(power log|self|)` elsewhere, small integer powers
    /// by multiplication.
    #[must_use]
    pub fn pow(self, power: Dd) -> Dd {
        let rough = MathFn2::Pow.eval(self.hi, power.hi);
        if !rough.is_finite() || rough == 0.0 || !self.hi.is_finite() || !power.hi.is_finite() || power.hi == 0.0 {
            return Dd::from_f64(rough);
        }
        if self.hi < 0.0 && libm::trunc(power.lo) != power.lo {
            return Dd::from_f64(f64::NAN);
        }
        if power.lo == 0.0 && power.hi.abs() <= 64.0 && libm::trunc(power.hi) == power.hi {
            return self.integer_power(power.hi as i32);
        }
        let magnitude = (power * self.abs().log()).exp();
        if rough < 0.0 { -magnitude } else { magnitude }
    }

    fn integer_power(self, power: i32) -> Dd {
        let (mut result, mut square, mut left) = (Dd::ONE, self, power.unsigned_abs());
        while left > 0 {
            if left % 2 == 1 {
                result = result * square;
            }
            left /= 2;
            if left > 0 {
                square = square.square();
            }
        }
        if power < 0 { Dd::ONE / result } else { result }
    }
}

/// 2^40.
const UP: f64 = 1_099_511_627_776.0;

/// `log(2^k)`.
fn log_power(k: f64) -> Dd {
    let (p, e) = two_prod(k, LN2[0]);
    let (s, t) = quick_two_sum(p, e + k * LN2[1]);
    Dd::new(s, t)
}

#[cfg(test)]
#[expect(clippy::approx_constant, reason = "digits of an outside program, constants among them")]
mod tests {
    use super::*;

    /// Function, argument, and value from 300-bit arithmetic (mpmath 1.3) as the nearest f64 and what is left.
    #[rustfmt::skip]
    const VALUES: &[(MathFn1, f64, f64, f64)] = &[
        (MathFn1::Exp, -700.0, 9.85967654375977e-305, 8.5e-322),
        (MathFn1::Exp, -20.3, 1.5269401591266087e-09, -9.350718630790655e-26),
        (MathFn1::Exp, -1e-05, 0.9999900000499998, 5.730256126450165e-18),
        (MathFn1::Exp, 0.1, 1.1051709180756477, -8.149523913327619e-17),
        (MathFn1::Exp, 1.0, 2.718281828459045, 1.4456468917292502e-16),
        (MathFn1::Exp, 37.7, 2.359945468246331e+16, -1.8866262687593724),
        (MathFn1::Exp, 700.0, 1.0142320547350045e+304, 1.6666571920734673e+287),
        (MathFn1::Log, 1e-300, -690.7755278982137, -2.3670096176709832e-14),
        (MathFn1::Log, 0.01, -4.605170185988091, -4.332104933119537e-16),
        (MathFn1::Log, 0.75, -0.2876820724517809, -2.607160616442564e-17),
        (MathFn1::Log, 0.999, -0.0010005003335835344, -2.5644777003677798e-20),
        (MathFn1::Log, 1.0000001, 9.999999505838704e-08, 1.5249709528441489e-24),
        (MathFn1::Log, 1.3, 0.26236426446749106, 2.6633628353477566e-17),
        (MathFn1::Log, 12.5, 2.5257286443082556, -1.7065574170429193e-16),
        (MathFn1::Log, 1e+300, 690.7755278982137, 2.3747660028800243e-14),
        (MathFn1::Log10, 0.003, -2.5228787452803374, -1.555929779935345e-16),
        (MathFn1::Log10, 1.0001, 4.342727686266486e-05, -1.9836963783439306e-21),
        (MathFn1::Log10, 1000.0, 3.0, 0.0),
        (MathFn1::Log10, 7e+200, 200.84509804001425, 7.020315993327391e-15),
        (MathFn1::Sin, 1e-10, 1e-10, -1.6666666666666669e-31),
        (MathFn1::Sin, 0.5, 0.479425538604203, -5.103969860556013e-18),
        (MathFn1::Sin, 1.5, 0.9974949866040544, -1.4558643538840918e-17),
        (MathFn1::Sin, 3.14159, 2.65358979335273e-06, 1.2360375240852754e-22),
        (MathFn1::Sin, 100.25, -0.2772828564548513, -1.361336774720287e-17),
        (MathFn1::Sin, -12345.6, 0.7572737463791979, 4.0090727626328956e-17),
        (MathFn1::Cos, 0.5, 0.8775825618903728, -4.2623149864279997e-17),
        (MathFn1::Cos, 1.5707, 9.632679474766714e-05, 6.042858202752916e-21),
        (MathFn1::Cos, 22.0, -0.9999608263946371, -8.51603380017413e-19),
        (MathFn1::Cos, 100.25, 0.9607883312760612, -2.1441388741342008e-17),
        (MathFn1::Cos, 1000000.0, 0.9367521275331447, 4.637088260214747e-17),
        (MathFn1::Tan, 0.3, 0.30933624960962325, -2.7475966183811927e-17),
        (MathFn1::Tan, 1.57, 1255.7655915007897, -4.905371300143858e-14),
        (MathFn1::Tan, -2.5, 0.7470222972386603, -3.6166133011893774e-17),
        (MathFn1::Tan, 1000.1, 1.8424679807086333, 6.569634207889709e-18),
        (MathFn1::Asin, 1e-09, 1e-09, 1.6666666666666669e-28),
        (MathFn1::Asin, 0.3, 0.3046926540153975, -2.7469740051157017e-17),
        (MathFn1::Asin, -0.75, -0.848062078981481, -3.5058948874954465e-18),
        (MathFn1::Asin, 0.9999, 1.5566540733173846, -6.964901236178217e-17),
        (MathFn1::Asin, 1.0, 1.5707963267948966, 6.123233995736766e-17),
        (MathFn1::Acos, 0.0, 1.5707963267948966, 6.123233995736766e-17),
        (MathFn1::Acos, 0.3, 1.2661036727794992, -7.78313736852488e-17),
        (MathFn1::Acos, -0.75, 2.4188584057763776, 6.473823484486311e-17),
        (MathFn1::Acos, 0.9999, 0.014142253477512098, 7.7709162088928765e-19),
        (MathFn1::Acos, -1.0, 3.141592653589793, 1.2246467991473532e-16),
        (MathFn1::Atan, 1e-12, 1e-12, -3.333333333333333e-37),
        (MathFn1::Atan, 0.4, 0.3805063771123649, 3.540779945587601e-18),
        (MathFn1::Atan, 1.0, 0.7853981633974483, 3.061616997868383e-17),
        (MathFn1::Atan, -25.0, -1.5308176396716067, 8.913347633498722e-17),
        (MathFn1::Atan, 1e+20, 1.5707963267948966, 6.122233995736766e-17),
        (MathFn1::Sinh, 1e-09, 1e-09, 1.6666666666666669e-28),
        (MathFn1::Sinh, 0.3, 0.3045202934471426, 9.177343117072388e-18),
        (MathFn1::Sinh, -0.75, -0.82231673193583, 1.1335882233129953e-17),
        (MathFn1::Sinh, 5.5, 122.34392274639096, 3.0463153468293817e-15),
        (MathFn1::Sinh, 700.0, 5.0711602736750225e+303, 8.333285960367336e+286),
        (MathFn1::Cosh, 0.3, 1.0453385141288605, 7.371812611119388e-18),
        (MathFn1::Cosh, -0.75, 1.2946832846768448, -1.0437418026127239e-16),
        (MathFn1::Cosh, 5.5, 122.34800951782942, 1.0830048406214577e-15),
        (MathFn1::Cosh, -700.0, 5.0711602736750225e+303, 8.333285960367336e+286),
        (MathFn1::Tanh, 1e-07, 9.999999999999966e-08, -2.4610883121208847e-24),
        (MathFn1::Tanh, 0.3, 0.2913126124515909, -6.4602656586469586e-18),
        (MathFn1::Tanh, -0.75, -0.6351489523872873, -1.7012977006564836e-17),
        (MathFn1::Tanh, 3.3, 0.9972829600991421, 2.0750489070819206e-18),
        (MathFn1::Tanh, 30.0, 1.0, -1.751302152539304e-26),
        (MathFn1::Asinh, 1e-11, 1e-11, -1.6666666666666663e-34),
        (MathFn1::Asinh, 0.3, 0.29567304756342244, -1.351693404864361e-17),
        (MathFn1::Asinh, -4.5, -2.209347708615334, -1.3948991870543613e-16),
        (MathFn1::Asinh, 10000000000.0, 23.7189981105004, 1.294128121094199e-15),
        (MathFn1::Asinh, 1e+200, 461.2101657793691, -2.3993297946353776e-14),
        (MathFn1::Acosh, 1.0000001, 0.0004472135919037347, 2.6565376465076346e-20),
        (MathFn1::Acosh, 1.5, 0.9624236501192069, -4.651563402692547e-17),
        (MathFn1::Acosh, 20.0, 3.6882538673612966, 1.0022281081178846e-16),
        (MathFn1::Acosh, 1e+200, 461.2101657793691, -2.3993297946353776e-14),
        (MathFn1::Atanh, 1e-08, 1e-08, 3.3333333333333335e-25),
        (MathFn1::Atanh, 0.3, 0.3095196042031117, 5.4139184190139844e-18),
        (MathFn1::Atanh, -0.75, -0.9729550745276566, -3.6617931039524534e-17),
        (MathFn1::Atanh, 0.9999, 4.951718775643099, -4.4378719514942393e-16),
        (MathFn1::Erf, 1e-09, 1.1283791670955127e-09, -1.624992790279848e-26),
        (MathFn1::Erf, 0.3, 0.3286267594591274, 2.2908254446982777e-17),
        (MathFn1::Erf, -0.9, -0.7969082124228322, 2.3193178035628794e-17),
        (MathFn1::Erf, 1.4, 0.9522851197626488, -4.979818237999381e-17),
        (MathFn1::Erf, 1.6, 0.976348383344644, -6.353289291855306e-18),
        (MathFn1::Erf, 3.0, 0.9999779095030014, 5.363397058636269e-17),
        (MathFn1::Erf, 5.0, 0.9999999999984626, -2.294992711807301e-17),
        (MathFn1::Erfc, -2.0, 1.9953222650189528, -8.895031662953915e-17),
        (MathFn1::Erfc, 0.3, 0.6713732405408726, 3.2602896784275053e-17),
        (MathFn1::Erfc, 1.4, 0.0477148802373512, 1.2259250526432118e-18),
        (MathFn1::Erfc, 1.6, 0.023651616655355985, -5.856046120519227e-19),
        (MathFn1::Erfc, 3.0, 2.209049699858544e-05, 1.5563377960343457e-22),
        (MathFn1::Erfc, 10.0, 2.088487583762545e-45, -1.2006565763501381e-61),
        (MathFn1::Erfc, 25.0, 8.300172571196523e-274, -4.0508928147804266e-291),
        (MathFn1::Expm1, -40.0, -1.0, 4.248354255291589e-18),
        (MathFn1::Expm1, -0.7, -0.5034146962085905, 9.827550225511106e-18),
        (MathFn1::Expm1, -1e-09, -9.999999995e-10, -7.477230737177921e-26),
        (MathFn1::Expm1, 1e-05, 1.0000050000166668e-05, -3.111926571619883e-22),
        (MathFn1::Expm1, 0.3, 0.3498588075760031, 1.6549155728191776e-17),
        (MathFn1::Expm1, 0.6, 0.8221188003905089, 4.850485794703611e-17),
        (MathFn1::Expm1, 25.0, 72004899336.38588, -6.992440211033874e-06),
        (MathFn1::Expm1, 700.0, 1.0142320547350045e+304, 1.6666571920734673e+287),
        (MathFn1::Log1p, -0.999, -6.907755278982136, -2.369515526854508e-16),
        (MathFn1::Log1p, -0.3, -0.35667494393873234, -2.6895094047056423e-17),
        (MathFn1::Log1p, -1e-09, -1.0000000005000001e-09, 7.427230737157087e-26),
        (MathFn1::Log1p, 1e-12, 9.999999999995e-13, 2.4217940103012377e-29),
        (MathFn1::Log1p, 0.1, 0.09531017980432487, -3.808451650416249e-19),
        (MathFn1::Log1p, 0.3, 0.26236426446749106, -1.6067257209028454e-17),
        (MathFn1::Log1p, 25.0, 3.258096538021482, -9.038993183377354e-17),
        (MathFn1::Log1p, 1e+200, 460.51701859880916, -2.2129109272629473e-14),
        (MathFn1::Softplus, -700.0, 9.85967654375977e-305, 8.5e-322),
        (MathFn1::Softplus, -30.5, 5.675685232632561e-14, 2.1729694820189895e-30),
        (MathFn1::Softplus, -0.5, 0.4740769841801067, -5.522109052790765e-18),
        (MathFn1::Softplus, 0.0, 0.6931471805599453, 2.3190468138462996e-17),
        (MathFn1::Softplus, 0.5, 0.9740769841801067, -5.522109052790765e-18),
        (MathFn1::Softplus, 3.3, 3.336219258870659, 1.4969104230054168e-16),
        (MathFn1::Softplus, 40.0, 40.0, 4.248354255291589e-18),
        (MathFn1::Softplus, 10000000000.0, 10000000000.0, 0.0),
        (MathFn1::Logistic, -700.0, 9.85967654375977e-305, 8.5e-322),
        (MathFn1::Logistic, -30.5, 5.6756852326324e-14, 7.790731367469167e-31),
        (MathFn1::Logistic, -0.5, 0.37754066879814546, -2.695376417313478e-17),
        (MathFn1::Logistic, 0.0, 0.5, 0.0),
        (MathFn1::Logistic, 0.5, 0.6224593312018546, -2.855738705812305e-17),
        (MathFn1::Logistic, 3.3, 0.9644288107273639, -3.992634414087213e-17),
        (MathFn1::Logistic, 30.0, 0.9999999999999064, 1.557128750770682e-17),
        (MathFn1::Sinc, 1e-05, 0.9999999999833333, 1.3790895139247375e-18),
        (MathFn1::Sinc, 0.7, 0.9203109817681301, -9.4978074471137e-19),
        (MathFn1::Sinc, 1.99, 0.45900168911619355, 2.4980253404403675e-17),
        (MathFn1::Sinc, 2.01, 0.45029381259960255, 8.406949041712409e-18),
        (MathFn1::Sinc, 50.5, 0.004601460626841278, 3.049421986185831e-19),
        (MathFn1::SincFirst, 1e-05, -3.3333333333000005e-06, 1.8693207368836797e-22),
        (MathFn1::SincFirst, 0.7, -0.22209827783377378, 9.22854680645827e-18),
        (MathFn1::SincFirst, 1.99, -0.43519341496254227, 3.553578641930764e-18),
        (MathFn1::SincFirst, 2.01, -0.43557844014813674, -5.334294872991498e-18),
        (MathFn1::SincFirst, 50.5, 0.019168813947478235, 1.1778641861824888e-18),
        (MathFn1::SincSecond, 1e-05, -0.3333333333233333, -1.9331180309250307e-17),
        (MathFn1::SincSecond, 0.7, -0.2857444736716335, -2.48105839849412e-17),
        (MathFn1::SincSecond, 1.99, -0.02162137257092496, -1.690091374054651e-19),
        (MathFn1::SincSecond, 2.01, -0.016882429367625656, 1.57643983421693e-18),
        (MathFn1::SincSecond, 50.5, -0.005360621575256258, 3.354289132065885e-19),
    ];

    #[rustfmt::skip]
    const POWERS: &[(f64, f64, f64, f64)] = &[
        (2.0, 0.5, 1.4142135623730951, -9.667293313452913e-17),
        (0.1, -3.0, 999.9999999999999, -5.284661597215743e-14),
        (1.0000001, 12345.5, 1.001235312309465, 5.943442110048728e-17),
        (-1.5, 7.0, -17.0859375, 0.0),
        (10.0, 300.25, 1.778279410038923e+300, -6.1297775435341706e+283),
        (3.7, 1e-05, 1.0000130834137837, -8.542405310226535e-17),
    ];

    #[rustfmt::skip]
    const ANGLES: &[(f64, f64, f64, f64)] = &[
        (1.0, 1.0, 0.7853981633974483, 3.061616997868383e-17),
        (1.0, -2.0, 2.677945044588987, 1.5527705369303147e-16),
        (-1e-05, -3.0, -3.1415893202564598, -1.5664743299584605e-16),
        (-2.0, 0.5, -1.3258176636680326, 8.824429373951136e-17),
        (1e-300, 1e-301, 1.4711276743037345, 1.0944888915666554e-16),
        (1e+300, -1e-300, 1.5707963267948966, 6.123233995736766e-17),
        (0.0, -1.0, 3.141592653589793, 1.2246467991473532e-16),
    ];

    fn assert_close(what: &str, found: Dd, hi: f64, lo: f64, tolerance: f64) {
        let error = ((found - Dd::from_f64(hi)) - Dd::from_f64(lo)).abs().hi;
        assert!(error <= tolerance * hi.abs(), "{what}: {found:?}, relative error {:e}", error / hi.abs());
    }

    #[test]
    fn all_functions_have_twenty_eight_digits() {
        for (f, x, hi, lo) in VALUES {
            assert_close(&format!("{}({x})", f.name()), Dd::from_f64(*x).function1(*f), *hi, *lo, 1e-28);
        }
        for f in MathFn1::ALL {
            assert!(VALUES.iter().filter(|(g, ..)| *g == f).count() >= 4, "{f:?} is not tested");
        }
        for (x, y, hi, lo) in POWERS {
            assert_close(&format!("{x}^{y}"), Dd::from_f64(*x).pow(Dd::from_f64(*y)), *hi, *lo, 1e-28);
        }
        for (y, x, hi, lo) in ANGLES {
            assert_close(&format!("atan2({y}, {x})"), Dd::from_f64(*y).atan2(Dd::from_f64(*x)), *hi, *lo, 1e-28);
        }
    }

    #[test]
    fn the_low_part_of_the_argument_counts() {
        // f(x + d) - f(x) = f'(x) d for d of the size of the last digits.
        let d = 1e-25;
        for f in MathFn1::ALL {
            let x = if f == MathFn1::Acosh { 1.75 } else { 0.75 };
            let difference = Dd::new(x, d).function1(f) - Dd::from_f64(x).function1(f);
            let h = Dd::from_f64(1e-12);
            let slope = ((Dd::from_f64(x) + h).function1(f) - (Dd::from_f64(x) - h).function1(f)) / (h + h);
            let error = (difference / Dd::from_f64(d) - slope).abs().hi;
            assert!(error < 1e-4, "{f:?}: {error:e}");
        }
    }

    #[test]
    fn special_values_are_those_of_f64() {
        let list = [0.0, -0.0, 1.0, -1.0, 2.0, -2.5, 1e308, -1e308, 5e-324, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
        for x in list {
            for f in MathFn1::ALL {
                check(&format!("{f:?}({x})"), Dd::from_f64(x).function1(f).hi, f.eval(x));
            }
            for y in list {
                let (a, b) = (Dd::from_f64(x), Dd::from_f64(y));
                check(&format!("{x}^{y}"), a.pow(b).hi, MathFn2::Pow.eval(x, y));
                check(&format!("atan2({x}, {y})"), a.atan2(b).hi, MathFn2::Atan2.eval(x, y));
            }
        }
    }

    /// Not finite or zero: the same; else close, since libm is good to an ulp or two only.
    fn check(what: &str, found: f64, expected: f64) {
        if expected.is_nan() {
            assert!(found.is_nan(), "{what}: {found}");
        } else if expected == 0.0 || expected.is_infinite() {
            assert_eq!(found, expected, "{what}");
        } else if expected.abs() > 1e-300 {
            // sin(1e308) has no digits to compare beyond those of f64; all others have.
            assert!((found - expected).abs() <= 1e-13 * expected.abs(), "{what}: {found} {expected}");
        }
    }
}
