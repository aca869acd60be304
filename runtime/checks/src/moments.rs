//! Equilibrium of moments: what the internal forces of a body do as it turns.
//!
//! The virtual power of the stress of a body on a rotation of any part of it is nothing, whatever the loads are: of the
//! displacements for a law of small strains, of the positions x + u for one of finite strains. Over a cell the first is the
//! antisymmetric part of the stress P, the second that of P F' (Truesdell and Noll, The Non-Linear Field Theories of
//! Mechanics, section 16). So terms on cells alone are read, against the gradient of the test function: forces across a gap,
//! springs to ground, weights and inertia have moments of their own, and loads are no law.
//!
//! Promises: relative to the stress over all cells. Where the law at rest knows no rotations the check of the scene says so
//! (W514), and nothing is judged here; nor for micropolar bodies.

use wfl_compiler::Class;
use wfl_discrete::{
    assemble::{AssembledTerm, Gradient, StressAt},
    gradients::{norm, product, sum, transposed},
};

use crate::{
    Solved,
    objectivity::{KnownLaw, Strains, known_law},
    worst::Finding,
};

/// What a law may leave, relative to its moments, that rotations do not change at rest: far above what differences of
/// moments leave by rounding, and what an error in a law leaves is a part of 1.
const LEFT: f64 = 1e-6;
/// Stresses below this part of the stiffness, and of what cancels in the forces, are rounding: some tens of operations,
/// each rounded.
const ROUNDED: f64 = 64.0 * f64::EPSILON;

/// What was found of the moments in a field.
pub(crate) enum Moments {
    /// What is left of the stress when it is made symmetric, in parts of the stress.
    Left {
        /// How much.
        share: f64,
        /// What it may be.
        limit: f64,
        /// The cell with the most of it.
        position: [f64; 3],
    },
    /// Why they are not known.
    Untested(&'static str),
}

/// What a cell has of a stress.
#[derive(Clone, Copy, Default)]
struct OfCell {
    /// The antisymmetric part, integrated: entries (1,2), (2,3), (3,1).
    skew: [f64; 3],
    position: [f64; 3],
}

/// The moments in a vector field of the space that is not among those that are `turning` from the first step on; `None`
/// where it has no stiffness or no stress. Asked by all ranks together.
pub(crate) fn moments(state: Solved<'_>, field: usize, turning: &[String]) -> Option<Moments> {
    if turning.contains(&state.system.fields[field].name) {
        return Some(Moments::Untested("the law at the first step knows no rotations (W514), or is that of no body"));
    }
    let (system, team) = (state.system, state.system.team());
    let (strains, modulus) = match known_law(system, field)? {
        KnownLaw::Body { strains, modulus } => (strains, modulus),
        KnownLaw::Turning { share, limit, position } => return Some(Moments::Left { share, limit, position }),
        KnownLaw::None(why) => return Some(Moments::Untested(why)),
    };
    let values = system.values(state.u);
    let mut cells = vec![OfCell::default(); system.mesh.n_cells()];
    let (mut size, mut volume, mut blind) = (0.0, 0.0, false);
    let is_law = |t: &&AssembledTerm| t.on_cells() && t.law.class > Class::Constant;
    for term in system.terms.iter().filter(is_law) {
        term.for_each_stress(&system.mesh, values.view(), field, |at: &StressAt| {
            let stress = match (strains, &at.gradient) {
                (Strains::Small, _) => at.stress,
                (Strains::Finite, Some(gradient)) => sum(&at.stress, &product(&at.stress, &transposed(gradient)), 1.0),
                (Strains::Finite, None) => {
                    blind = true;
                    return;
                }
            };
            let own = &mut cells[at.cell.index()];
            let entries = [(0, 1), (1, 2), (2, 0)];
            own.skew.iter_mut().zip(entries).for_each(|(x, (i, j))| *x += at.weight * half_apart(&stress, i, j));
            own.position = at.position.unwrap_or(own.position);
            size += at.weight.abs() * norm(&stress);
            volume += at.weight.abs();
        });
    }
    if team.any(blind) {
        return Some(Moments::Untested("a term against the gradient does not read all of it"));
    }
    let of = |cell: &OfCell| 2.0f64.sqrt() * cell.skew.iter().fold(0.0f64, |m, x| m.hypot(*x));
    let mut sums = [cells.iter().map(of).sum(), size, volume];
    team.sum(&mut sums);
    let [left, size, volume] = sums;
    let worst = cells.iter().max_by(|a, b| of(a).total_cmp(&of(b)));
    let worst = worst.map(|c| Finding { size: of(c), numbers: c.position.to_vec(), names: Vec::new() });
    let position = Finding::worst(worst, team)?.numbers.try_into().ok()?;
    if size == 0.0 {
        return None;
    }
    if left > LEFT * size {
        let forces = team.total(system.cancelled(state.u, state.residual).iter().sum());
        if left <= ROUNDED * (modulus * volume + forces * system.extent()) {
            return Some(Moments::Untested("the stress is what rounding leaves of the motion"));
        }
    }
    Some(Moments::Left { share: left / size, limit: LEFT, position })
}

fn half_apart(stress: &Gradient, i: usize, j: usize) -> f64 {
    0.5 * (stress[i][j] - stress[j][i])
}
