//! Whether contact touches so few unknowns that the rest is a matter of its own. Does not solve.

use wfl_discrete::{pruning::Pruning, system::System};

/// Nonlinear terms touch at most this part of the dofs where condensation pays: the dense part grows with its cube.
const CONDENSE_BELOW: f64 = 0.6;

/// True if the nonlinear terms touch few dofs beside a symmetric linear part.
pub fn condenses(system: &System) -> bool {
    #[expect(clippy::cast_precision_loss, reason = "a ratio of counts")]
    let few = (system.n_changing_dofs() as f64) < CONDENSE_BELOW * system.n_unknowns() as f64;
    few && !system.has_moving_images() && system.bulk_is_symmetric() && system.uses(Pruning::Condense)
}
