//! Whether the matrix of a linear scene is assembled, or its linear terms are applied cell by cell.
//!
//! Decided before anything is assembled, from counted operations and bytes. Does not assemble and does not solve.

use std::sync::Arc;

use wfl_discrete::assemble::Counts;
use wfl_discrete::system::{System, SystemError};
use wfl_sparse::csr::Csr;
use wfl_sparse::solve::SolveError;

use super::plan::{Held, LinearPlan};

/// Seconds of a product with a sum in single precision where terms are applied, on one thread: with the next number it gives what
/// `--bin operators` of wfl-tests measured of tetrahedra of degree 2 and 3 and of hexahedra of degree 2, to 6 %.
const OPERATION_SECONDS: f64 = 1.0 / 53e9;
/// Seconds in which a cell reads a number of a node, or adds to it: measured with the one before.
const GATHER_SECONDS: f64 = 1.0 / 2.1e9;
/// Part of the entries of the matrices of all cells that the matrix has: counted, 0.38 for tetrahedra of degree 2, 0.54 of
/// degree 3, 0.69 for hexahedra of degree 2.
const ASSEMBLED: f64 = 0.38;
/// Seconds in which an entry of single precision and its share of an index are read from the memory: 4.5 bytes at the 6.9 GB/s
/// of a triad there.
const ENTRY_SECONDS: f64 = 4.5 / 6.9e9;
/// Bytes of levels and operator for each unknown: estimated from the sizes of the arrays for tetrahedra of degree 2, half of it
/// the levels of degree 1 and below.
const BYTES: u64 = 250;

/// Whether nothing stands against terms that are applied, and a product with them is foreseen to be faster.
pub(super) fn pays(system: &System) -> bool {
    system.is_linear() && system.obstacle_to_operator().is_none() && is_faster(&system.counts_of_product())
}

fn is_faster(counts: &Counts) -> bool {
    counts.operations * OPERATION_SECONDS + counts.gathered * GATHER_SECONDS
        < ASSEMBLED * counts.entries * ENTRY_SECONDS
}

/// Bytes of levels and operator for so many unknowns.
pub(super) fn bytes(n: usize) -> u64 {
    BYTES * n as u64
}

/// The plan of an iteration with how its matrix is held, where elements of degree 2 and more leave a choice.
pub(super) fn plan(system: &System, iteration: LinearPlan) -> LinearPlan {
    let solved = (0..system.fields.len()).filter(|k| system.range(*k).is_some());
    if !system.is_linear() || solved.map(|k| system.fields[k].degree()).max().unwrap_or(0) < 2 {
        return iteration;
    }
    let held = match system.obstacle_to_operator() {
        Some(why) => Held::Stored(why),
        None if pays(system) => Held::Applied,
        None => Held::Stored("that is faster".to_owned()),
    };
    LinearPlan::WithOperator(Box::new(iteration), held)
}

/// The matrix of the linear terms, assembled now where there is none.
///
/// # Errors
/// [`SolveError::TooMuchMemory`], or [`SolveError::NotFactored`] where a term gives what is no number.
pub(super) fn assembled(system: &System) -> Result<Arc<Csr>, SolveError> {
    system.matrix().map_err(|error| match error {
        SystemError::TooMuchMemory(need) => SolveError::TooMuchMemory(need),
        _ => SolveError::NotFactored,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 1000 cells with one elastic field.
    fn counts(nodes: f64, points: f64) -> Counts {
        let operations = 1e3 * points * (21.0 + 9.0 * (2.0 * nodes + 7.0));
        Counts { operations, gathered: 6e3 * nodes, entries: 9e3 * nodes * nodes }
    }

    #[test]
    fn elements_of_degree_two_and_more_are_applied() {
        assert!(is_faster(&counts(10.0, 4.0)) && is_faster(&counts(20.0, 14.0)) && is_faster(&counts(27.0, 27.0)));
    }
}
