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
    compare::Compare,
    math::{MathFn1, MathFn2},
    real::Real,
    sinc::SINC_SERIES_BOUND,
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
mod tests;
