//! `asinh(x exp(y))` as one function of two numbers, and its slope in x.
//!
//! Rate-and-state friction in its regularised form, `a*asinh(V/(2*V0)*exp((f0 + b*log(V0*theta/Dc))/a))`, has exponents
//! of 60 to 1000 and slip rates down to zero: the product, or its square in the derivative, leaves the range of numbers
//! where the value does not. Here the value is `log(2 x) + y` for large arguments, and the slope `1/hypot(x, exp(-y))`.
//!
//! Promises: the value and both derivatives are finite wherever x and y are, one formula for every number type. Where
//! the slope at x = 0 is beyond [`STEEPEST`] it is that number: as steep as no solution is that can be told from zero.

use crate::{compare::Compare, math::MathFn1, real::Real};

/// Logarithm of the steepest slope: 1e249, so that products with the coefficients of a scene stay in range.
const STEEPEST: f64 = 575.0;
/// Between these bounds a number has all its digits, also in double-double, whose low part is 1e-32 of it.
const LOW: f64 = 1e-270;
const HIGH: f64 = 1e300;
/// Beyond this logarithm `asinh t` is `log 2t`, and below its opposite it is `t`, to 1e-34.
const FAR: f64 = 40.0;

/// `asinh(x exp(y))`.
pub(crate) fn value<T: Real>(x: T, y: T) -> T {
    let zero = T::from_f64(0.0);
    if x.compare(Compare::Equal, zero) && !y.to_f64().is_nan() {
        return x;
    }
    let size = x.abs();
    let factor = y.call1(MathFn1::Exp);
    let product = size.mul(factor);
    let whole = |t: T| (LOW..=HIGH).contains(&t.to_f64());
    let found = if whole(factor) && whole(product) {
        product.call1(MathFn1::Asinh)
    } else {
        let log = size.call1(MathFn1::Log).add(y);
        if log.to_f64() > FAR {
            log.add(T::from_f64(2.0).call1(MathFn1::Log))
        } else if log.to_f64() < -FAR {
            log.call1(MathFn1::Exp)
        } else {
            log.call1(MathFn1::Exp).call1(MathFn1::Asinh)
        }
    };
    if x.compare(Compare::Less, zero) { found.neg() } else { found }
}

/// The derivative in x, `exp(y)/sqrt(1 + (x exp(y))^2)`; that in y is x times it.
pub(crate) fn slope<T: Real>(x: T, y: T) -> T {
    let steepest = T::from_f64(STEEPEST);
    let y = if y.compare(Compare::Less, steepest) || y.to_f64().is_nan() { y } else { steepest };
    let (size, width) = (x.abs(), y.neg().call1(MathFn1::Exp));
    let (large, small) = if size.compare(Compare::Less, width) { (width, size) } else { (size, width) };
    if !large.is_finite() || !small.is_finite() {
        return T::from_f64(1.0 / large.add(small).to_f64());
    }
    let (one, ratio) = (T::from_f64(1.0), small.div(large));
    one.div(large.mul(one.add(ratio.mul(ratio)).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dd::Dd;

    /// x, y, value and slope from 60-digit arithmetic (mpmath 1.3), rounded to the nearest f64.
    const VALUES: &[(f64, f64, f64, f64)] = &[
        (1e-09, 70.0, 49.96988134361354, 999999999.9999999),
        (1e-30, 70.0, 1.652949712076805, 9.2926128417504e+29),
        (1e-20, 60.0, 14.641445320679223, 9.999999999996166e+19),
        (0.3, 1.7, 1.2711311172526547, 2.8470130782175636),
        (2.5, -0.4, 1.28848533654336, 0.3434917315459614),
        (1000.0, 75.5, 83.10090245954208, 0.001),
        (1e-12, 690.25, 663.3121260646313, 1000000000000.0),
        (1e-320, 560.0, 1.602894840141628e-77, 1.6029126850757262e+243),
        (1e+300, -700.0, 9.859676527784923e-05, 9.859676495835224e-305),
        (10000000000.0, -690.5, 1.3172258525345524e-290, 1.3172258525345525e-300),
        (1e-250, 574.0, 0.19159265720489937, 1.892822634726372e+249),
        (5e-07, 1234.5, 1220.6844894420358, 2000000.0),
        (3.0, -30.0, 2.8072868906520526e-13, 9.357622968840175e-14),
    ];

    #[test]
    fn value_and_slope_are_those_of_an_outside_program() {
        for (x, y, expected, slope_expected) in VALUES {
            let near = |what: &str, found: f64, expected: f64, digits: f64| {
                let error = (found - expected).abs() / expected.abs().max(f64::MIN_POSITIVE);
                assert!(error <= digits, "{what} at ({x}, {y}): {found:e}, expected {expected:e}");
            };
            // an exponent y is known to eps |y|, and so is exp(y)
            let digits = 4.0 * f64::EPSILON * (1.0 + y.abs());
            near("value", value(*x, *y), *expected, digits);
            near("slope", slope(*x, *y), *slope_expected, digits);
            let (a, b) = (Dd::from_f64(*x), Dd::from_f64(*y));
            near("value in double-double", value(a, b).hi(), *expected, f64::EPSILON);
            near("slope in double-double", slope(a, b).hi(), *slope_expected, f64::EPSILON);
            assert_eq!(value(-*x, *y).to_bits(), (-value(*x, *y)).to_bits());
        }
    }

    #[test]
    fn no_finite_argument_gives_a_number_that_is_not_finite() {
        let list = [0.0, -0.0, 5e-324, 1e-300, 1e-20, 1.0, 1e20, 1e300, f64::MAX];
        for x in list.into_iter().chain(list.map(|x| -x)) {
            for y in list.into_iter().chain(list.map(|y| -y)).chain([-745.0, -700.0, 60.0, 574.0, 576.0, 709.0, 800.0])
            {
                let (v, s) = (value(x, y), slope(x, y));
                assert!(v.is_finite() && s.is_finite() && (x * s).is_finite(), "({x}, {y}): {v} {s}");
                assert!(v == 0.0 || (v < 0.0) == (x < 0.0), "({x}, {y}): {v}");
                assert!(s >= 0.0, "({x}, {y}): {s}");
            }
        }
        assert!(value(f64::NAN, 1.0).is_nan() && value(0.0, f64::NAN).is_nan() && slope(1.0, f64::NAN).is_nan());
    }
}
