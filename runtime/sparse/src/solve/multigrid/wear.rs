//! Whether levels of an earlier matrix still serve.
//!
//! Levels of another matrix cost iterations: those beyond what the same digits took with the matrix that they were made of.
//! New ones are due once what was lost so since they were made is what they cost, which is never more than twice the least that
//! any rule could reach (the rule of who rents skis or buys them; Karlin, Manasse, Rudolph and Sleator 1988). All is counted
//! in iterations and nothing is timed, so that equal runs decide alike.

/// Iterations that take as long as new levels do: an estimate from the products that the Galerkin matrices of a cube of
/// quadratic tetrahedra take.
const LEVELS: f64 = 15.0;

/// What is known of the levels in use.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::solve) struct Wear {
    /// Iterations for a digit with the matrix of the levels; `None` before a solution.
    for_a_digit: Option<f64>,
    /// Iterations beyond that, in solutions with later matrices.
    lost: f64,
    is_expired: bool,
}

impl Wear {
    /// Hears of a solution that took so many iterations to an error, relative to the solution.
    pub(in crate::solve) fn hear(&mut self, iterations: usize, error: f64) {
        #[expect(clippy::cast_precision_loss, reason = "a count of iterations")]
        let iterations = iterations as f64;
        let digits = -error.log10();
        if digits.is_nan() || digits <= 0.0 {
            return;
        }
        match self.for_a_digit {
            None => self.for_a_digit = Some(iterations / digits),
            Some(before) => self.lost += (iterations - before * digits).max(0.0),
        }
    }

    /// The next matrix gets levels of its own.
    pub(in crate::solve) fn expire(&mut self) {
        self.is_expired = true;
    }

    /// Whether the next matrix is to get levels of its own.
    pub(in crate::solve) fn is_over(&self) -> bool {
        self.is_expired || self.lost >= LEVELS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_serve_until_what_they_lose_is_what_new_ones_cost() {
        let mut wear = Wear::default();
        wear.hear(12, 1e-6);
        for _ in 0..3 {
            wear.hear(12, 1e-6);
            assert!(!wear.is_over(), "nothing is lost");
        }
        wear.hear(22, 1e-6);
        assert!(!wear.is_over(), "ten are");
        wear.hear(17, 1e-6);
        assert!(wear.is_over());
    }

    #[test]
    fn a_solution_that_is_faster_saves_nothing_for_later() {
        let mut wear = Wear::default();
        wear.hear(12, 1e-6);
        wear.hear(2, 1e-6);
        wear.hear(27, 1e-6);
        assert!(wear.is_over());
    }

    #[test]
    fn levels_expire_whatever_they_cost() {
        let mut wear = Wear::default();
        wear.hear(0, 1.0);
        assert!(!wear.is_over());
        wear.expire();
        assert!(wear.is_over());
    }
}
