//! PETSc as a library that a run is linked with.

use std::sync::Arc;

use wfl_sparse::solve::{Engine, Equations, Library, SolveError, Symmetry, Traits};

use crate::{
    engine::PetscEngine,
    method::{Choice, in_words},
};

/// PETSc as a library of solvers; a [`crate::Session`] must run while it solves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Petsc(pub Choice);

impl Petsc {
    /// The library with the name, as it is written in commands: `petsc`, `petsc:direct`, `petsc:iterative`.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        const ALL: [Petsc; 3] = [Petsc(Choice::Auto), Petsc(Choice::Direct), Petsc(Choice::Iterative)];
        static PETSC: [Petsc; 3] = ALL;
        PETSC.iter().find(|petsc| petsc.name() == name)
    }
}

impl Library for Petsc {
    fn name(&self) -> &'static str {
        match self.0 {
            Choice::Auto => "petsc",
            Choice::Direct => "petsc:direct",
            Choice::Iterative => "petsc:iterative",
        }
    }

    fn plan(&self, traits: &Traits) -> String {
        in_words(self.0, traits)
    }

    fn engine(&self, equations: &Arc<Equations>, symmetry: Symmetry) -> Result<Box<dyn Engine + Send>, SolveError> {
        Ok(Box::new(PetscEngine::new(self.0, equations, symmetry)?))
    }
}
