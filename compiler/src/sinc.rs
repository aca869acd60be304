//! `sin(t)/t` and its derivatives to all digits, near 0 too.

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
        assert_eq!([0, 1, 2].map(|order| sinc_derivative(order, 0.0)), [1.0, 0.0, -1.0 / 3.0]);
    }
}
