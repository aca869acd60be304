//! Gauss-Jacobi rules on `[0, 1]` with the weight `(1 - t)^alpha`.
//!
//! The points are the roots of the Jacobi polynomial `P_n` with parameters `(alpha, 0)` at
//! `x = 2 t - 1`. Roots of `P_n` separate those of `P_{n-1}`, which gives safe brackets without a
//! transcendental starting guess. Weights: `1 / ((1 - x^2) P_n'(x)^2)`.

/// `P_n(x)` and `P_n'(x)`, by the three-term recurrence and its derivative.
fn jacobi(n: usize, alpha: f64, x: f64) -> (f64, f64) {
    let (mut before, mut slope_before) = (1.0, 0.0);
    if n == 0 {
        return (before, slope_before);
    }
    let (mut value, mut slope) = (alpha + 1.0 + (alpha + 2.0) * (x - 1.0) / 2.0, (alpha + 2.0) / 2.0);
    for m in 2..=n {
        let m = m as f64;
        let top = 2.0 * m + alpha;
        let scale = 2.0 * m * (m + alpha) * (top - 2.0);
        let linear = (top - 1.0) * top * (top - 2.0) / scale;
        let constant = (top - 1.0) * alpha * alpha / scale;
        let back = 2.0 * (m + alpha - 1.0) * (m - 1.0) * top / scale;
        let factor = linear * x + constant;
        let next = factor * value - back * before;
        let next_slope = factor * slope + linear * value - back * slope_before;
        (before, slope_before, value, slope) = (value, slope, next, next_slope);
    }
    (value, slope)
}

/// The root of `P_n` between two separating points: Newton, kept inside by bisection.
fn root(n: usize, alpha: f64, mut low: f64, mut high: f64) -> f64 {
    let sign = jacobi(n, alpha, low).0.signum();
    let mut x = 0.5 * (low + high);
    // Bisection alone ends after 60 halvings; Newton usually needs five steps.
    for _ in 0..80 {
        let (value, slope) = jacobi(n, alpha, x);
        if value == 0.0 {
            return x;
        }
        if value.signum() == sign {
            low = x;
        } else {
            high = x;
        }
        let newton = x - value / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= f64::EPSILON * 0.5 {
            return next;
        }
        x = next;
    }
    x
}

/// Points and weights of the rule with `n >= 1` points, points ascending. Exact for polynomials of
/// degree `2 n - 1` times `(1 - t)^alpha`.
pub(super) fn gauss_jacobi(n: usize, alpha: u32) -> Vec<(f64, f64)> {
    let alpha = f64::from(alpha);
    let mut roots: Vec<f64> = Vec::new();
    for m in 1..=n {
        let bound = |i: usize| match i {
            0 => -1.0,
            i if i > m - 1 => 1.0,
            i => roots[i - 1],
        };
        roots = (0..m).map(|i| root(m, alpha, bound(i), bound(i + 1))).collect();
    }
    if alpha == 0.0 {
        // Legendre roots are symmetric; make them so to the last bit.
        for i in 0..n / 2 {
            let x = 0.5 * (roots[n - 1 - i] - roots[i]);
            (roots[i], roots[n - 1 - i]) = (-x, x);
        }
        if n % 2 == 1 {
            roots[n / 2] = 0.0;
        }
    }
    let pair = |x: f64| {
        let slope = jacobi(n, alpha, x).1;
        let weight = 1.0 / ((1.0 - x) * (1.0 + x) * slope * slope);
        (0.5 + 0.5 * x, weight)
    };
    let mut rule: Vec<(f64, f64)> = roots.into_iter().map(pair).collect();
    // The weight sum is known, 1 / (alpha + 1): one common factor removes the last rounding.
    let sum: f64 = rule.iter().map(|(_, weight)| weight).sum();
    let scale = 1.0 / ((alpha + 1.0) * sum);
    for (_, weight) in &mut rule {
        *weight *= scale;
    }
    rule
}

/// Points and weights of the Gauss-Lobatto rule with `n >= 2` points on `[0, 1]`, points ascending: both ends and the
/// extremes of the Legendre polynomial `P_{n-1}`, with the weights `1 / (n (n - 1) P_{n-1}^2)`. Exact for degree `2 n - 3`.
pub(super) fn lobatto_line(n: usize) -> Vec<(f64, f64)> {
    let degree = n - 1;
    // an extreme lies between two roots: the derivative changes its sign there
    let roots: Vec<f64> = gauss_jacobi(degree, 0).iter().map(|(t, _)| 2.0 * t - 1.0).collect();
    let extreme = |pair: &[f64]| {
        let (mut low, mut high) = (pair[0], pair[1]);
        let sign = jacobi(degree, 0.0, low).1.signum();
        while high - low > f64::EPSILON {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            *if jacobi(degree, 0.0, middle).1.signum() == sign { &mut low } else { &mut high } = middle;
        }
        0.5 * (low + high)
    };
    let mut inner: Vec<f64> = roots.windows(2).map(extreme).collect();
    let count = inner.len();
    for i in 0..count / 2 {
        let x = 0.5 * (inner[count - 1 - i] - inner[i]);
        (inner[i], inner[count - 1 - i]) = (-x, x);
    }
    if count % 2 == 1 {
        inner[count / 2] = 0.0;
    }
    let places = std::iter::once(-1.0).chain(inner).chain([1.0]);
    let weighted: Vec<(f64, f64)> = places.map(|x| (0.5 + 0.5 * x, 1.0 / jacobi(degree, 0.0, x).0.powi(2))).collect();
    let sum: f64 = weighted.iter().map(|(_, weight)| weight).sum();
    weighted.into_iter().map(|(t, weight)| (t, weight / sum)).collect()
}
