//! Numbers that look random, the same in every run: where an identity is tested at sampled states.

/// A generator (xorshift, Marsaglia 2003).
pub(crate) struct Random(u64);

impl Random {
    /// A generator; other numbers for each `sample`.
    pub(crate) fn new(sample: u64) -> Self {
        Self(0x9e37_79b9_7f4a_7c15 ^ (sample << 32))
    }

    /// The next number in -1..1.
    pub(crate) fn next(&mut self) -> f64 {
        let state = &mut self.0;
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        #[expect(clippy::cast_precision_loss, reason = "53 random bits")]
        let unit = (*state >> 11) as f64 / (1u64 << 53) as f64;
        2.0 * unit - 1.0
    }
}
