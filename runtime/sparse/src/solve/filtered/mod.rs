//! Contact at a size where no factor of the bodies fits: GMRES with multigrid of the bodies and a filter on the contact.
//!
//! It is a [`Library`] of this program's own: what is told of the equations, how solutions are checked and how far Newton
//! asks for them is the same as for a linked one. `engine` is the method, `gmres` the iteration, `filter` the direct
//! solution on the unknowns of contact; `multigrid` makes the levels. `tangents` does the same with bodies that are not linear, `saddle` with a
//! pressure in place of contact.

mod engine;
mod filter;
mod gmres;
mod preconditioner;
mod saddle;
mod tangents;
#[cfg(test)]
mod tests;

use std::sync::Arc;

pub use saddle::CheckedSaddle;
pub use tangents::{CheckedContact, OnContact};

use super::SolveError;
use super::Symmetry;
use super::library::{Engine, Equations, Library, Traits};

/// The method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilteredMultigrid;

impl Library for FilteredMultigrid {
    fn name(&self) -> &'static str {
        "own"
    }

    fn plan(&self, traits: &Traits) -> String {
        in_words(traits)
    }

    fn engine(&self, equations: &Arc<Equations>, _symmetry: Symmetry) -> Result<Box<dyn Engine + Send>, SolveError> {
        Ok(Box::new(engine::FilteredEngine::new(equations)?))
    }
}

/// The method in words.
fn in_words(traits: &Traits) -> String {
    let prefix = if traits.is_linear { "one linear system" } else { "Newton" };
    match traits.on_contact {
        0 => format!("{prefix}; GMRES with multigrid"),
        n => format!("{prefix}; GMRES with multigrid, then a direct solution on the {n} dofs of contact"),
    }
}
