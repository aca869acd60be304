//! Whether the matrix of a scene, or of its tangents, is assembled, or its terms are applied cell by cell.
//!
//! Decided before anything is assembled, from counted operations and bytes. Does not assemble and does not solve.

use std::sync::Arc;

use wfl_discrete::assemble::Counts;
use wfl_discrete::system::{System, SystemError, Tangent};
use wfl_sparse::csr::Csr;
use wfl_sparse::solve::SolveError;

use super::plan::{Held, LinearPlan};

/// Seconds of a product with a sum in single precision where terms are applied, on one thread: with the next number it gives what
/// `--bin operators` of wfl-tests measured of tetrahedra of degree 2 and 3 and of hexahedra of degree 2, to 6 %, of the latter with
/// sums over all nodes of a cell at once; what sums direction by direction take beside it, [`Counts::effort`] has.
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

/// Number of products with the finest level in a cycle: two and three of the smoother, and one for what is left between.
const PRODUCTS_OF_A_CYCLE: f64 = 6.0;
/// An entry of double precision, with its index, in units of one of single precision: bytes.
const DOUBLE_ENTRY: f64 = 12.0 / 4.5;
/// Seconds in which a stored number of single precision is read: four bytes, without an index, at the 6.9 GB/s of a triad there.
const NUMBER_SECONDS: f64 = 4.0 / 6.9e9;
/// Number of passes over the entries of the matrix of a tangent, of double precision, for each iteration that it serves: six, in
/// which it is assembled, summed with that of the linear terms, looked at and rounded, over the ten iterations of a correction.
const PASSES_OF_A_TANGENT: f64 = 6.0 / 10.0;

/// Whether nothing stands against terms that are applied, and an iteration with them is foreseen to be faster.
pub(super) fn pays(system: &System) -> bool {
    system.obstacle_to_operator().is_none() && is_faster(&system.counts_of_product(), system.is_linear())
}

/// The same from counts: of a cycle and the product with the matrix beside it.
fn is_faster(counts: &Counts, is_linear: bool) -> bool {
    let [effort, on_levels] = counts.effort();
    let of_level =
        on_levels * OPERATION_SECONDS + counts.gathered * GATHER_SECONDS + counts.stored_on_levels * NUMBER_SECONDS;
    let of_double = effort * OPERATION_SECONDS + counts.gathered * GATHER_SECONDS + counts.stored * NUMBER_SECONDS;
    let passes = if is_linear { 0.0 } else { PASSES_OF_A_TANGENT };
    let entries = PRODUCTS_OF_A_CYCLE + DOUBLE_ENTRY * (1.0 + passes);
    PRODUCTS_OF_A_CYCLE * of_level + 2.0 * of_double < entries * ASSEMBLED * counts.entries * ENTRY_SECONDS
}

/// Bytes of levels and operator for so many unknowns, without entries of laws.
pub(super) fn bytes(n: usize) -> u64 {
    BYTES * n as u64
}

/// The same with entries of laws that are stored: of double precision, of one tangent at a time, and of single precision on the levels.
pub(super) fn bytes_with_entries(system: &System) -> u64 {
    let counts = system.counts_of_product();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size in bytes")]
    let entries = (8.0 * counts.stored + 4.0 * counts.stored_on_levels) as u64;
    bytes(system.n_unknowns()) + entries
}

/// The plan of an iteration with how its matrix is held, where elements of degree 2 and more leave a choice.
pub(super) fn plan(system: &System, iteration: LinearPlan) -> LinearPlan {
    let solved = (0..system.fields.len()).filter(|k| system.range(*k).is_some());
    if solved.map(|k| system.fields[k].degree()).max().unwrap_or(0) < 2 {
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
    system.matrix().map_err(not_made)
}

/// The whole matrix of a tangent, assembled now where there is none.
///
/// # Errors
/// As [`assembled`].
pub(super) fn assembled_with(system: &System, tangent: &Tangent) -> Result<Csr, SolveError> {
    system.whole_matrix(tangent).map_err(not_made)
}

fn not_made(error: SystemError) -> SolveError {
    match error {
        SystemError::TooMuchMemory(need) => SolveError::TooMuchMemory(need),
        _ => SolveError::NotFactored,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 1000 cells with one elastic field.
    fn counts(nodes: f64, points: f64) -> Counts {
        let operations = 1e3 * points * (21.0 + 9.0 * (2.0 * nodes + 7.0));
        let entries = 9e3 * nodes * nodes;
        Counts { operations, operations_on_levels: operations, gathered: 6e3 * nodes, entries, ..Counts::default() }
    }

    /// The same of hexahedra of this degree with as many points, whose sums are taken direction by direction.
    fn counts_in_turn(degree: i32) -> Counts {
        let nodes = f64::from(degree + 1).powi(3);
        let (written, of_written) = (1e3 * 2.0 * 3.0 * 6.0 * nodes, f64::from(degree + 1));
        let operations = 1e3 * nodes * (21.0 + 9.0 * 7.0) + written * of_written;
        Counts {
            operations,
            operations_on_levels: operations,
            written,
            written_on_levels: written,
            ..counts(nodes, nodes)
        }
    }

    /// The same of a neo-Hookean one with a rule for its law.
    fn of_tangent(nodes: f64, points: f64, points_of_means: f64) -> Counts {
        let stored = 45e3;
        let all = counts(nodes, points);
        Counts {
            operations_on_levels: counts(nodes, points_of_means).operations,
            stored: points * stored,
            stored_on_levels: stored,
            ..all
        }
    }

    #[test]
    fn elements_of_degree_two_and_more_are_applied() {
        let hexahedra = [2, 3, 4].map(counts_in_turn);
        for counts in [counts(10.0, 4.0), counts(20.0, 14.0), counts(27.0, 27.0)].into_iter().chain(hexahedra) {
            assert!(is_faster(&counts, true) && is_faster(&counts, false));
        }
    }

    #[test]
    fn so_are_tangents_with_rules_for_their_laws() {
        for counts in [of_tangent(10.0, 11.0, 4.0), of_tangent(10.0, 24.0, 4.0), of_tangent(27.0, 27.0, 27.0)] {
            assert!(is_faster(&counts, false));
        }
    }
}
