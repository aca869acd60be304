//! Numbers with a derivative: forward differentiation, which knows nothing of the symbolic one.

use crate::{
    asinh_exp,
    compare::Compare,
    math::{MathFn1, MathFn2},
    real::Real,
    sinc::sinc_derivative,
};

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
            MathFn2::AsinhExp => {
                let slope = asinh_exp::slope(t, u);
                (slope, t * slope)
            }
            MathFn2::AsinhExpSlope => {
                let part = t * value;
                (-(part * value * value), value * (1.0 - part) * (1.0 + part))
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
