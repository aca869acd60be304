//! The linear solvers that `--backend` names: those of this program, or those of a library that it was built with.

use clap::ValueEnum;
use wfl_runtime::solve::Linked;

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
    use super::{Linked, Solvers};
    use wfl_petsc::{Petsc, Session};

    /// A library at work.
    pub(crate) struct Running {
        _session: Option<Session>,
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

    /// Starts the library of these solvers, or says why not: on one rank of several, the others have nothing to say. It runs as long as what is returned lives.
    pub(crate) fn start(solvers: Solvers) -> Result<Running, String> {
        if solvers == Solvers::Own {
            return Ok(Running { _session: None });
        }
        let session = Session::start().map_err(|failure| failure.to_string())?;
        match (session.size(), session.rank()) {
            (1, _) => {}
            (n, 0) => {
                return Err(format!(
                    "the program was started on {n} ranks, and a run goes on one\n  = help: start it without mpirun; \
                     --threads assembles on more cores (docs/scale.md)"
                ));
            }
            _ => return Err(String::new()),
        }
        Ok(Running { _session: Some(session) })
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
    pub(crate) fn start(solvers: Solvers) -> Result<Running, String> {
        missing(solvers).map_or(Ok(Running), Err)
    }

    /// Says why these solvers are not there.
    pub(crate) fn missing(solvers: Solvers) -> Option<String> {
        (solvers != Solvers::Own).then(|| {
            "this program was built without PETSc\n  = help: cargo build --release --features petsc (docs/scale.md)"
                .to_owned()
        })
    }
}

pub(crate) use linked::{missing, start};
