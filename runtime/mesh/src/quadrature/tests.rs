use super::*;
use crate::cell::Basis;

/// Integral of `x^i y^j z^k` over the reference cell.
fn moment(kind: CellKind, powers: [usize; 3]) -> f64 {
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    let dim = kind.dim();
    let of_simplex = |powers: &[usize], dim: usize| {
        let top: f64 = powers.iter().map(|p| factorial(*p)).product();
        top / factorial(powers.iter().sum::<usize>() + dim)
    };
    match kind.basis() {
        Basis::Simplex if dim > 1 => return of_simplex(&powers, dim),
        Basis::Wedge => return of_simplex(&powers[..2], 2) / (powers[2] as f64 + 1.0),
        Basis::Pyramid => {
            // the integral of (1 - z)^(i + j + 2) z^k over the parts of x and y
            let [i, j, k] = powers;
            let beta = factorial(i + j + 2) * factorial(k) / factorial(i + j + k + 3);
            return beta / ((i as f64 + 1.0) * (j as f64 + 1.0));
        }
        Basis::Simplex | Basis::Tensor => {}
    }
    powers[..dim].iter().map(|p| 1.0 / (*p as f64 + 1.0)).product()
}

fn powers(kind: CellKind, degree: usize) -> Vec<[usize; 3]> {
    let reach = |d: usize| if d < kind.dim() { degree } else { 0 };
    let mut all = Vec::new();
    for i in 0..=reach(0) {
        for j in 0..=reach(1) {
            for k in 0..=reach(2) {
                let is_in = match kind.basis() {
                    Basis::Simplex | Basis::Pyramid => i + j + k <= degree,
                    Basis::Tensor => true,
                    Basis::Wedge => i + j <= degree,
                };
                if is_in {
                    all.push([i, j, k]);
                }
            }
        }
    }
    all
}

fn integrate(rule: &Rule, powers: [usize; 3]) -> f64 {
    let power = |x: f64, n: usize| (0..n).map(|_| x).product::<f64>();
    let value = |x: &[f64; 3]| (0..3).map(|d| power(x[d], powers[d])).product::<f64>();
    let terms = rule.points.iter().zip(&rule.weights);
    terms.map(|(x, w)| w * value(x)).sum()
}

fn check(rule: &Rule, degree: usize) {
    let kind = rule.kind;
    for powers in powers(kind, degree) {
        let (found, exact) = (integrate(rule, powers), moment(kind, powers));
        let error = (found - exact).abs();
        assert!(error <= 4e-15 * exact.max(0.01), "{kind} {degree} {powers:?}: {error:e}");
    }
    assert!(rule.weights.iter().all(|w| *w > 0.0));
    for x in &rule.points {
        let hats = kind.hat_values(*x);
        assert!(hats[..kind.n_vertices()].iter().all(|h| *h >= 0.0), "{kind} {x:?}");
    }
}

#[test]
fn every_rule_integrates_its_moments_with_positive_weights_inside() {
    for kind in CellKind::ALL {
        let highest = if matches!(kind, CellKind::Hexahedron | CellKind::Wedge | CellKind::Pyramid) { 9 } else { 14 };
        for degree in 0..=highest {
            let rule = rule(kind, degree).unwrap();
            assert!(rule.degree >= degree);
            check(&rule, rule.degree);
        }
        // on products the degree in each variable is 1, beyond that of the nodes of wedges
        check(&vertex(kind), 1);
    }
    check(&gauss(CellKind::Segment, 64).unwrap(), 127);
    check(&gauss(CellKind::Triangle, 20).unwrap(), 39);
}

#[test]
fn a_rule_is_not_exact_beyond_its_degree() {
    for kind in CellKind::ALL.into_iter().skip(1) {
        for degree in 0..=6 {
            let rule = rule(kind, degree).unwrap();
            let wrong = |p: &[usize; 3]| (integrate(&rule, *p) - moment(kind, *p)).abs() > 1e-9;
            assert!(powers(kind, rule.degree + 1).iter().any(wrong), "{kind} {degree}");
        }
    }
}

#[test]
fn tensor_rules_have_the_fewest_points() {
    for (degree, n) in [(0, 1), (1, 1), (2, 2), (3, 2), (4, 3), (5, 3)] {
        assert_eq!(rule(CellKind::Hexahedron, degree).unwrap().n_points(), n * n * n);
    }
    let counts = [1, 1, 3, 6, 6, 7, 12];
    for (degree, n) in counts.into_iter().enumerate() {
        assert_eq!(rule(CellKind::Triangle, degree).unwrap().n_points(), n);
    }
    let counts = [1, 1, 4, 8, 14, 14, 24];
    for (degree, n) in counts.into_iter().enumerate() {
        assert_eq!(rule(CellKind::Tetrahedron, degree).unwrap().n_points(), n);
    }
}

#[test]
fn impossible_rules_are_errors() {
    assert_eq!(gauss(CellKind::Triangle, 0), Err(QuadratureError::NoPoints));
    let error = rule(CellKind::Segment, 1000).unwrap_err();
    assert_eq!(error, QuadratureError::TooManyPoints { per_direction: 501 });
}

#[test]
fn rules_with_a_point_a_node_are_exact_to_their_degree() {
    for kind in CellKind::ALL.into_iter().filter(|kind| kind.dim() > 0) {
        for degree in 1..=3 {
            let rule = one_per_node(kind, degree);
            assert!(
                rule.degree >= if kind.is_product_of_segments() { 2 * degree - 1 } else { (2 * degree - 2).max(1) }
            );
            check(&rule, rule.degree);
        }
    }
    assert_eq!(one_per_node(CellKind::Quadrilateral, 2), nodal(CellKind::Quadrilateral, 2).unwrap());
    assert_eq!(one_per_node(CellKind::Triangle, 2).n_points(), 3);
    for (end, degree) in [(0, 1), (1, 1), (0, 2), (1, 3)] {
        let rule = beside_axis(degree, end);
        if degree > 1 {
            check(&rule, 2 * degree);
        }
        let [there, not] = [end as f64, 1.0 - end as f64];
        assert!(rule.points.iter().any(|x| x[0] == there) && rule.points.iter().all(|x| x[0] != not), "{rule:?}");
    }
    // the forces of a constant pressure on the nodes of the first face, over 2 pi h^2: at the axis, and the share of a
    // trapezoidal rule
    let rule = beside_axis(1, 1);
    let share = |hat: &dyn Fn(f64) -> f64| -> f64 {
        rule.points.iter().zip(&rule.weights).map(|(x, w)| w * x[0] * hat(x[0])).sum()
    };
    assert!((share(&|t| 1.0 - t) - 1.0 / 6.0).abs() < 1e-15 && (share(&|t| t) - 0.5).abs() < 1e-15);
}
