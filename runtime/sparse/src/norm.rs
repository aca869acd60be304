//! The maximum norm of vectors with possibly non-finite entries.
//!
//! Promises: NaN is never dropped. Does not decide what follows from such a norm.

/// The largest absolute value; not a number if one of the values is none (`f64::max` would drop it), 0 without values.
///
/// Sizes of numbers have the order of their bits (IEEE 754, 5.10), and what is no number has larger ones than infinity: a maximum of
/// integers, which takes a third of the time that comparisons of numbers with that case beside them take.
#[must_use]
#[inline]
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    f64::from_bits(values.into_iter().fold(0, |most, x| most.max(x.abs().to_bits())))
}

#[cfg(test)]
mod tests {
    use super::largest;

    #[test]
    fn a_maximum_never_drops_what_is_not_a_number() {
        assert_eq!(largest([]), 0.0);
        assert_eq!(largest([1.0, -3.0, 2.0]), 3.0);
        assert_eq!(largest([-0.0, 5e-324]), 5e-324);
        assert_eq!(largest([1.0, f64::NEG_INFINITY]), f64::INFINITY);
        assert!(largest([f64::NAN, 1.0]).is_nan() && largest([1.0, f64::NAN]).is_nan());
        assert!(largest([f64::INFINITY, -f64::NAN, 1.0]).is_nan());
    }
}
