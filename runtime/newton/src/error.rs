//! Why a step cannot go on.

use thiserror::Error;

use wfl_discrete::assemble::TermError;
use wfl_discrete::finite::BadGiven;
use wfl_discrete::system::SystemError;
use wfl_host::memory::TooMuchMemory;
use wfl_sparse::solve::SolveError;

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
    Term(#[from] TermError),
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

    /// Gives an error of the linear solver its reason where a singular tangent has one; `why` is asked then only.
    #[must_use]
    pub fn with_reason(self, why: impl FnOnce() -> Option<Singular>) -> Self {
        use SolveError::{ResidualTooLarge, Singular, VanishingPivot};
        match self {
            Self::Solve(error @ (Singular { .. } | VanishingPivot { .. } | ResidualTooLarge { .. })) => match why() {
                Some(why) => Self::Singular { why: Box::new(why), error },
                None => Self::Solve(error),
            },
            other => other,
        }
    }
}

/// A need for memory is one kind of error, whoever had it.
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
            SystemError::Term(term) => Self::Term(term),
            SystemError::Given(bad) => Self::Given(bad),
            SystemError::TooMuchMemory(need) => Self::TooMuchMemory(need),
            other => Self::System(other),
        }
    }
}
