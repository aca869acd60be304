//! The linear solvers that `--backend` names: those of this program, or those of a library that it was built with.

use clap::ValueEnum;
use wfl_sparse::solve::Linked;

/// Names of solvers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Solvers {
    /// Of this program
    Own,
    /// Of PETSc, as the scene suits
    Petsc,
    /// A factor of MUMPS, by PETSc
    #[value(name = "petsc:direct")]
    PetscDirect,
    /// Multigrid of PETSc wherever that is possible
    #[value(name = "petsc:iterative")]
    PetscIterative,
}

#[cfg(feature = "petsc")]
mod linked {
    use std::{process::ExitCode, sync::Arc, time::Duration};

    use wfl_host::team::Team;
    use wfl_petsc::{Petsc, Session};

    use super::{Linked, Solvers};
    use crate::{
        load::{fall_silent, say, speak_up},
        prepared::EXIT_ERROR,
    };

    /// Time that the first rank is given to tell an error that all ranks have.
    const FIRST_SPEAKS: Duration = Duration::from_secs(2);

    /// A library at work.
    pub(crate) struct Running {
        session: Option<Session>,
    }

    impl Solvers {
        /// The library that these solvers are of.
        pub(crate) fn library(self) -> Option<Linked> {
            let name = match self {
                Self::Own => return None,
                Self::Petsc => "petsc",
                Self::PetscDirect => "petsc:direct",
                Self::PetscIterative => "petsc:iterative",
            };
            Petsc::named(name).map(|petsc| Linked(petsc))
        }
    }

    /// Starts the library of these solvers; it runs as long as what is returned lives. Of several ranks the first one
    /// speaks.
    pub(crate) fn start(solvers: Solvers, is_repeatable: bool) -> Result<Running, String> {
        if solvers == Solvers::Own {
            return Ok(Running { session: None });
        }
        let session = Session::start(is_repeatable).map_err(|failure| failure.to_string())?;
        if session.rank() > 0 {
            fall_silent();
        }
        Ok(Running { session: Some(session) })
    }

    impl Running {
        /// The ranks of a run on several; `None` where there is one.
        pub(crate) fn team(&self) -> Option<Arc<dyn Team>> {
            let session = self.session.as_ref().filter(|session| session.size() > 1)?;
            Some(session.team())
        }

        /// Gives memory that is not used any more back to the system.
        pub(crate) fn trim_memory(&self) {
            self.session.iter().for_each(Session::trim_memory);
        }

        /// Ends the library. An error ends all ranks: those that do not have it would wait for this one.
        pub(crate) fn end(self, code: ExitCode) -> ExitCode {
            let Some(session) = self.session.filter(|session| session.size() > 1) else { return code };
            if code == ExitCode::from(EXIT_ERROR) {
                if session.rank() > 0 {
                    std::thread::sleep(FIRST_SPEAKS);
                    if let Some(unsaid) = speak_up() {
                        say(&format!("rank {}: {unsaid}", session.rank()));
                    }
                }
                session.abort(EXIT_ERROR);
            }
            code
        }
    }

    /// Says why these solvers are not there.
    pub(crate) fn missing(_: Solvers) -> Option<String> {
        None
    }
}

#[cfg(not(feature = "petsc"))]
mod linked {
    use super::{Linked, Solvers};

    /// No library is at work.
    pub(crate) struct Running;

    impl Solvers {
        /// The library that these solvers are of: none here.
        pub(crate) fn library(self) -> Option<Linked> {
            None
        }
    }

    /// Refuses what this program was built without.
    pub(crate) fn start(solvers: Solvers, _is_repeatable: bool) -> Result<Running, String> {
        missing(solvers).map_or(Ok(Running), Err)
    }

    impl Running {
        /// There is one rank.
        pub(crate) fn team(&self) -> Option<std::sync::Arc<dyn wfl_host::team::Team>> {
            None
        }

        /// One rank goes on with the memory that it has.
        pub(crate) fn trim_memory(&self) {}

        /// Has nothing to end.
        pub(crate) fn end(self, code: std::process::ExitCode) -> std::process::ExitCode {
            code
        }
    }

    /// Says why these solvers are not there.
    pub(crate) fn missing(solvers: Solvers) -> Option<String> {
        (solvers != Solvers::Own).then(|| {
            "this program was built without PETSc\n  = help: cargo build --release --features petsc (docs/scale.md)"
                .to_owned()
        })
    }
}

pub(crate) use linked::{Running, missing, start};
