//! Number types against each other: slopes, rounding, comparisons.

use super::Real;
use crate::{
    compare::Compare,
    dd::Dd,
    dual::Dual,
    math::{MathFn1, MathFn2},
};

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
                let at =
                    |s: Dd| (Dd::from_f64(t) + s * Dd::from_f64(dt)).call2(f, Dd::from_f64(u) + s * Dd::from_f64(du));
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
