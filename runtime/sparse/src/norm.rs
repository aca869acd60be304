//! The maximum norm of vectors with possibly non-finite entries.
//!
//! Promises: NaN is never dropped. Does not decide what follows from such a norm.

/// The largest absolute value; not a number if one of the values is none (`f64::max` would drop it), 0 without values.
#[must_use]
#[inline]
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0f64, |m, x| if m.is_nan() || x.is_nan() { f64::NAN } else { m.max(x.abs()) })
}

#[cfg(test)]
mod tests {
    use super::largest;

    #[test]
    fn a_maximum_never_drops_what_is_not_a_number() {
        assert_eq!(largest([]), 0.0);
        assert_eq!(largest([1.0, -3.0, 2.0]), 3.0);
        assert_eq!(largest([1.0, f64::NEG_INFINITY]), f64::INFINITY);
        assert!(largest([f64::NAN, 1.0]).is_nan() && largest([1.0, f64::NAN]).is_nan());
        assert!(largest([f64::INFINITY, f64::NAN, 1.0]).is_nan());
    }
}
