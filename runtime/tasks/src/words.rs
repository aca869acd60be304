//! Numbers as people read them. For terminals only: files that programs read have every digit.

/// A number with ten significant digits and no zeros behind them; powers of ten outside 0.0001 to 10 million. A whole
/// number keeps one decimal, as a sign that it was measured: 40.0, 0.25, -1.5e-7.
#[must_use]
pub fn number(value: f64) -> String {
    digits(value, 10)
}

/// [`number`] with five significant digits: for values that are estimates.
#[must_use]
pub fn short(value: f64) -> String {
    digits(value, 5)
}

fn digits(value: f64, significant: usize) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    let rounded: f64 = format!("{value:.*e}", significant - 1).parse().unwrap_or(value);
    if rounded == 0.0 {
        "0.0".to_owned()
    } else if (1e-4..1e7).contains(&rounded.abs()) {
        format!("{rounded:?}")
    } else {
        format!("{rounded:e}")
    }
}

/// A relative error: two digits, `0` where there is none, in words where it is not known.
#[must_use]
pub fn error(value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else if value.is_finite() {
        format!("{value:.1e}")
    } else {
        "not known".to_owned()
    }
}

/// `1 step`, `20 steps`.
#[must_use]
pub fn count(n: usize, word: &str) -> String {
    format!("{n} {word}{}", if n == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_say_something() {
        let cases = [
            (40.0, "40.0"),
            (-2.000_000_000_000_3, "-2.0"),
            (1.0 / 3.0, "0.3333333333"),
            (1e-4, "0.0001"),
            (123_456.75, "123456.75"),
            (25e9, "2.5e10"),
            (-1.5e-7, "-1.5e-7"),
            (0.0, "0.0"),
            (-0.0, "0.0"),
            (f64::NAN, "NaN"),
        ];
        for (value, told) in cases {
            assert_eq!(number(value), told, "{value:e}");
        }
    }

    #[test]
    fn estimates_have_five_digits() {
        assert_eq!([38_616.123, 1.0 / 3.0, 4e-9].map(short), ["38616.0", "0.33333", "4e-9"]);
    }

    #[test]
    fn errors_and_counts_are_words() {
        assert_eq!([0.0, 3.14e-4, f64::NAN, f64::INFINITY].map(error), ["0", "3.1e-4", "not known", "not known"]);
        assert_eq!((count(1, "step"), count(0, "iteration")), ("1 step".to_owned(), "0 iterations".to_owned()));
    }
}
