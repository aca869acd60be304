//! What was tried in a step, and what came of it.

/// What grows from the start of a step to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// The step variable.
    Steps,
    /// Loads and prescribed values, at the value of the first step.
    Load,
    /// The step variable, by an increment that the run chose.
    Chosen,
}

/// How an attempt ended.
#[derive(Clone, Debug, PartialEq)]
pub enum AttemptEnd {
    /// With a solution.
    Converged,
    /// Out of iterations.
    NotConverged,
    /// With a solution whose estimated error is so many times the demanded one.
    Rejected(f64),
    /// With a solution whose estimated error is so many times the demanded one, and the smallest increment.
    Forced(f64),
    /// With an error: a number that is not finite, a singular tangent.
    Failed(String),
}

/// One try to solve a part of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Attempt {
    /// What grew.
    pub path: Path,
    /// Start and end of the part; 0 is the start of the step, 1 its end. One that was too long ends behind it.
    pub part: (f64, f64),
    /// Newton iterations.
    pub iterations: usize,
    /// Linear systems that were solved in it: a breakpoint of a path takes up to two, a predictor one.
    pub linear_solves: usize,
    /// What came of it.
    pub end: AttemptEnd,
}

impl Attempt {
    /// Whether it came to nothing and a shorter increment took its place, which knows nothing of it.
    pub(crate) fn is_left_behind(&self) -> bool {
        let has_ended = matches!(self.end, AttemptEnd::Converged | AttemptEnd::Forced(_));
        self.path == Path::Chosen && !has_ended
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attempt_at_a_longer_increment_leaves_nothing_and_a_part_of_a_step_does() {
        let attempt = |path, end| Attempt { path, part: (0.0, 4.0), iterations: 20, linear_solves: 150, end };
        assert!(attempt(Path::Chosen, AttemptEnd::NotConverged).is_left_behind());
        assert!(attempt(Path::Chosen, AttemptEnd::Rejected(3.0)).is_left_behind());
        assert!(!attempt(Path::Chosen, AttemptEnd::Converged).is_left_behind());
        assert!(!attempt(Path::Chosen, AttemptEnd::Forced(3.0)).is_left_behind());
        assert!(!attempt(Path::Steps, AttemptEnd::NotConverged).is_left_behind());
    }
}
