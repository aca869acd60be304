//! Matrix functions against closed forms, double-double and dual numbers.

use super::*;
use crate::{dd::Dd, dual::Dual};

fn eval<T: Real>(f: MatrixFn, n: usize, a: &[T]) -> Vec<T> {
    let mut out = vec![T::from_f64(0.0); f.n_results(n)];
    f.eval(n, a, &mut out);
    out
}

/// In double-double: the reference for f64.
fn wide(f: MatrixFn, n: usize, a: &[f64]) -> Vec<f64> {
    let a: Vec<Dd> = a.iter().map(|x| Dd::from_f64(*x)).collect();
    eval(f, n, &a).into_iter().map(Dd::hi).collect()
}

fn norm(a: &[f64]) -> f64 {
    a.iter().fold(0.0, |m, x| m.max(x.abs()))
}

fn assert_close(a: &[f64], b: &[f64], tolerance: f64) {
    let error = a.iter().zip(b).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()));
    assert!(error <= tolerance * norm(b), "{a:?}\n{b:?}\nerror {error:e} of {:e}", norm(b));
}

/// Matrices whose exponential and logarithm are asked for: symmetric and not, defective, near the identity,
/// with complex eigenvalues, badly scaled.
fn examples() -> Vec<(usize, Vec<f64>)> {
    vec![
        (1, vec![0.7]),
        (2, vec![1.0, 0.0, 0.0, 1.0]),
        (2, vec![2.0, 0.5, 0.5, 1.0]),
        (2, vec![2.0, 0.0, 1.0, 2.0]),
        (2, vec![0.3, 0.9, -0.9, 0.3]),
        (2, vec![1.0 + 1e-9, 2e-9, -1e-9, 1.0 - 3e-9]),
        (3, vec![1.2, 0.1, 0.0, 0.1, 0.9, -0.2, 0.0, -0.2, 1.1]),
        (3, vec![3.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 1.0, 3.0]),
        (3, vec![0.8, 0.7, 0.2, -0.7, 0.8, 0.1, 0.3, -0.1, 2.5]),
        (3, vec![4.0, 1.0, 0.5, 1.0, 0.3, 0.2, 0.5, 0.2, 0.7]),
        (3, vec![1.0 + 1e-7, 3e-8, 0.0, 3e-8, 1.0, 1e-8, 0.0, 1e-8, 1.0 - 2e-7]),
    ]
}

#[test]
fn double_precision_has_fourteen_digits() {
    for (n, a) in examples() {
        for f in MatrixFn::ALL {
            assert_close(&eval(f, n, &a), &wide(f, n, &a), 1e-14);
        }
    }
}

#[test]
fn logarithm_and_exponential_are_inverse_in_double_double() {
    for (n, a) in examples() {
        let a: Vec<Dd> = a.iter().map(|x| Dd::from_f64(*x)).collect();
        let back = eval(MatrixFn::Expm, n, &eval(MatrixFn::Logm, n, &a));
        for (x, y) in back.iter().zip(&a) {
            assert!((*x - *y).abs().hi() < 1e-28, "{x:?} {y:?}");
        }
    }
}

#[test]
fn closed_forms() {
    // A rotation by t is the exponential of t times the generator; of a Jordan block, exp(a) [1 1; 0 1].
    let t = 1.1;
    let rotation = [libm::cos(t), libm::sin(t), -libm::sin(t), libm::cos(t)];
    assert_close(&eval(MatrixFn::Expm, 2, &[0.0, t, -t, 0.0]), &rotation, 1e-15);
    assert_close(&eval(MatrixFn::Logm, 2, &rotation), &[0.0, t, -t, 0.0], 1e-14);
    let e = libm::exp(0.5);
    assert_close(&eval(MatrixFn::Expm, 2, &[0.5, 0.0, 1.0, 0.5]), &[e, 0.0, e, e], 1e-15);
    assert_close(&eval(MatrixFn::Logm, 2, &[2.0, 0.0, 1.0, 2.0]), &[libm::log(2.0), 0.0, 0.5, libm::log(2.0)], 1e-15);
    // Diagonal, far from 1: entries keep their own relative accuracy.
    let log = eval(MatrixFn::Logm, 3, &[1e-6, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1e8]);
    assert_close(&[log[0], log[4], log[8]], &[libm::log(1e-6), 0.0, libm::log(1e8)], 1e-14);
    let huge = eval(MatrixFn::Expm, 2, &[-1500.0, 0.0, 0.0, 1.0]);
    assert_close(&huge, &[0.0, 0.0, 0.0, std::f64::consts::E], 1e-12);
}

#[test]
fn derivatives_match_dual_numbers_and_differences() {
    for (n, a) in examples() {
        let size = n * n;
        for (f, g) in [(MatrixFn::Expm, MatrixFn::ExpmDerivative), (MatrixFn::Logm, MatrixFn::LogmDerivative)] {
            let derivative = eval(g, n, &a);
            let scale = norm(&derivative);
            for l in 0..size {
                let column = &derivative[l * size..(l + 1) * size];
                let dual: Vec<Dual> =
                    a.iter().enumerate().map(|(k, x)| Dual::new(*x, if k == l { 1.0 } else { 0.0 })).collect();
                let h = Dd::from_f64(1e-10);
                let shifted = |h: Dd| {
                    let entry = |(k, x): (usize, &f64)| Dd::from_f64(*x) + if k == l { h } else { Dd::ZERO };
                    eval(f, n, &a.iter().enumerate().map(entry).collect::<Vec<_>>())
                };
                let (up, down) = (shifted(h), shifted(-h));
                for (k, slope) in eval(f, n, &dual).iter().map(|x| x.slope).enumerate() {
                    let difference = ((up[k] - down[k]) / (h + h)).hi();
                    assert!((column[k] - difference).abs() < 1e-14 * scale, "{f:?} {a:?}: {} {difference}", column[k]);
                    assert!((column[k] - slope).abs() < 1e-12 * scale, "{f:?} {a:?}: {} {slope}", column[k]);
                }
            }
        }
    }
}

#[test]
fn no_logarithm_no_number() {
    let none: [(usize, &[f64]); 9] = [
        (1, &[0.0]),
        (1, &[-1.0]),
        (2, &[-1.0, 0.0, 0.0, -1.0]),
        (2, &[1.0, 0.0, 0.0, -2.0]),
        (2, &[0.0, 0.0, 1.0, 0.0]),
        (3, &[1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -2.0]),
        (3, &[1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 0.0, 0.0, 1.0]),
        (3, &[-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        (2, &[f64::NAN, 0.0, 0.0, 1.0]),
    ];
    for (n, a) in none {
        for f in [MatrixFn::Logm, MatrixFn::LogmDerivative] {
            assert!(eval(f, n, a).iter().all(|x| x.is_nan()), "{f:?} {a:?}");
        }
    }
    // A rotation by almost half a turn still has one, and so has a complex pair with negative real part.
    let t = 3.1;
    let rotation = [libm::cos(t), libm::sin(t), -libm::sin(t), libm::cos(t)];
    assert_close(&eval(MatrixFn::Logm, 2, &rotation), &[0.0, t, -t, 0.0], 1e-13);
    let three = [rotation[0], rotation[1], 0.0, rotation[2], rotation[3], 0.0, 0.0, 0.0, 1.0];
    assert_close(&eval(MatrixFn::Logm, 3, &three), &[0.0, t, 0.0, -t, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-13);
    assert!(eval(MatrixFn::Expm, 2, &[f64::INFINITY, 0.0, 0.0, 0.0]).iter().all(|x| x.is_nan()));
}
