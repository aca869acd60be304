//! Why a step cannot go on.

use thiserror::Error;

use wfl_discrete::assemble::TermError;
use wfl_discrete::finite::BadGiven;
use wfl_discrete::system::SystemError;
use wfl_host::memory::TooMuchMemory;
use wfl_sparse::{csr::CsrError, solve::SolveError};

/// What a singular tangent leaves undetermined, and why.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Singular {
    /// What is found: "nothing holds `u` in 1 rigid motion (1 translation)".
    pub what: String,
    /// How it is known, and from which term.
    pub notes: Vec<String>,
    /// What to do.
    pub help: String,
    /// The field or the term it is about.
    pub name: String,
}

/// Why a step cannot go on.
#[derive(Debug, Error)]
pub enum NewtonError {
    /// A term gave a number that is not finite.
    #[error(transparent)]
    Term(TermError),
    /// A step could not be assembled.
    #[error(transparent)]
    System(SystemError),
    /// A value that the scene gives is not finite.
    #[error(transparent)]
    Given(Box<BadGiven>),
    /// A linear system could not be solved.
    #[error(transparent)]
    Solve(SolveError),
    /// What is needed does not fit into the memory: no other state, step or method can help, so it ends the run.
    #[error(transparent)]
    TooMuchMemory(TooMuchMemory),
    /// Who watches wanted no further iteration.
    #[error("stopped on request")]
    Stopped,
    /// Branches of contact where time starts change again and again.
    #[error(
        "contact does not settle where time starts: its branches change again and again, and no rates satisfy its laws"
    )]
    Unsettled,
    /// Dashpots of explicit steps couple dofs too stiffly.
    #[error("the accelerations that dashpots couple could not be solved for")]
    Dashpots,
    /// A linear system could not be solved, and it is known why.
    #[error("{}: {error}", why.what)]
    Singular {
        /// What is undetermined.
        why: Box<Singular>,
        /// What the solver says.
        error: SolveError,
    },
}

impl NewtonError {
    /// True if no other state, step or method is to be tried.
    #[must_use]
    pub fn ends_the_run(&self) -> bool {
        matches!(self, Self::TooMuchMemory(_) | Self::Stopped)
    }

    /// True if another state need not have this problem.
    pub(super) fn is_of_the_state(&self) -> bool {
        matches!(self, Self::Term(_) | Self::Solve(SolveError::Singular { .. }))
    }

    /// True if a tangent was singular.
    #[must_use]
    pub fn is_singular(&self) -> bool {
        matches!(self, Self::Singular { .. } | Self::Solve(SolveError::Singular { .. }))
    }

    /// Gives an error of the linear solver its reason where a singular tangent has one; `why` is asked then only.
    #[must_use]
    pub fn with_reason(self, why: impl FnOnce(&SolveError) -> Option<Singular>) -> Self {
        use SolveError::{ResidualTooLarge, Singular, VanishingPivot};
        match self {
            Self::Solve(error @ (Singular { .. } | VanishingPivot { .. } | ResidualTooLarge { .. })) => {
                match why(&error) {
                    Some(why) => Self::Singular { why: Box::new(why), error },
                    None => Self::Solve(error),
                }
            }
            other => other,
        }
    }
}

/// A need for memory is one kind of error, whoever had it: also where a matrix is made when a tangent is asked for.
impl From<TermError> for NewtonError {
    fn from(error: TermError) -> Self {
        match error {
            TermError::Matrix(CsrError::TooMuchMemory(need)) => Self::TooMuchMemory(need),
            other => Self::Term(other),
        }
    }
}

/// The same of solvers.
impl From<SolveError> for NewtonError {
    fn from(error: SolveError) -> Self {
        match error {
            SolveError::TooMuchMemory(need) => Self::TooMuchMemory(need),
            other => Self::Solve(other),
        }
    }
}

/// A number that is not finite is one kind of error, wherever it was met; so is a need for memory.
impl From<SystemError> for NewtonError {
    fn from(error: SystemError) -> Self {
        match error {
            SystemError::Term(term) => term.into(),
            SystemError::Given(bad) => Self::Given(bad),
            SystemError::TooMuchMemory(need) => Self::TooMuchMemory(need),
            other => Self::System(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wfl_sparse::solve::NullVector;

    fn singular() -> SolveError {
        SolveError::Singular { dof: 3, ratio: 1e-17, mode: NullVector::default() }
    }

    fn too_much() -> TooMuchMemory {
        TooMuchMemory { what: "the factor", needed: Some(1 << 30), in_use: 0, limit: 1 << 20, of: "" }
    }

    #[test]
    fn a_need_for_memory_ends_the_run_whoever_had_it() {
        let needs = [
            NewtonError::from(SolveError::TooMuchMemory(too_much())),
            NewtonError::from(SystemError::TooMuchMemory(too_much())),
            NewtonError::from(TermError::Matrix(CsrError::TooMuchMemory(too_much()))),
        ];
        for need in needs {
            assert!(need.ends_the_run() && !need.is_of_the_state() && !need.is_singular(), "{need}");
        }
    }

    #[test]
    fn another_state_may_have_a_tangent_that_is_not_singular() {
        let error = NewtonError::from(singular());
        assert!(error.is_singular() && error.is_of_the_state() && !error.ends_the_run());
        assert!(!NewtonError::Stopped.is_of_the_state() && NewtonError::Stopped.ends_the_run());
    }

    #[test]
    fn a_singular_tangent_is_told_with_its_reason_first() {
        let why = Singular { what: "nothing holds `u`".to_owned(), ..Singular::default() };
        let error = NewtonError::from(singular()).with_reason(|_| Some(why));
        assert!(error.to_string().starts_with("nothing holds `u`: the matrix is singular at dof 3"), "{error}");
        assert!(error.is_singular() && !error.is_of_the_state(), "that is a matter of the scene");
    }

    #[test]
    fn without_a_reason_the_solver_says_what_it_found() {
        let error = NewtonError::from(singular()).with_reason(|_| None);
        assert!(error.to_string().starts_with("the matrix is singular at dof 3"), "{error}");
    }

    #[test]
    fn nobody_asks_why_where_no_tangent_is_singular() {
        let shape = SolveError::Shape { what: "rows", expected: 1, found: 2 };
        let asked = |error: NewtonError| error.with_reason(|_| unreachable!("it is not asked")).to_string();
        assert_eq!(asked(NewtonError::Stopped), "stopped on request");
        assert_eq!(asked(NewtonError::from(shape)), "rows: expected 1, found 2");
    }
}
