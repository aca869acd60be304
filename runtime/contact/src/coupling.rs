//! What multipliers and unknowns do to each other at some dofs, whatever the state of contact is.
//!
//! A contact law couples other dofs where it sticks than where it slips: in stick each component of a multiplier holds its
//! own component of the jump, in slip the bound of friction follows the normal one. Promises: tangents of the terms with
//! multipliers alone, with all points closed and on one branch of friction; rows and columns by the numbers given. Leaves
//! the terms without a place in the matrix of the system: [`System::leave_out`] finds it again.

use wfl_compiler::{Class, types::FieldKind};

use super::Contact;
use wfl_discrete::assemble::{AssembledTerm, FieldValues};
use wfl_discrete::system::{ActiveSet, System};
use wfl_sparse::csr::{Csr, CsrError};

/// The branch of friction at all points; contact is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Friction {
    /// No point slides.
    Sticks,
    /// Every point slides, in a direction that its law allows.
    Slips,
}

/// Factor that sets the numbers of a state apart that is like no other: the golden section, far from every ratio of small
/// numbers.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// True for a term in which a multiplier has a part.
#[must_use]
pub fn has_multiplier(system: &System, term: &AssembledTerm) -> bool {
    let mut fields = term.coupled_fields().map(|f| f.index());
    fields.any(|f| system.fields.get(f).is_some_and(|f| f.kind == FieldKind::Multiplier))
}

/// The tangents of the terms with multipliers over the dofs that have a number, on one branch of friction: of sliding one for
/// each of two ways; where a law has kinks that are no projections, as many for each of three states. The laws are those of the step begun last;
/// `size` is that of the unknowns.
///
/// # Errors
/// [`CsrError`] when the pattern does not fit the index types.
pub fn couplings(
    system: &mut System,
    contact: &Contact,
    numbers: &[u32],
    friction: Friction,
    size: f64,
) -> Result<Vec<Csr>, CsrError> {
    let chosen: Vec<usize> = (0..system.terms.len())
        .filter(|k| system.terms[*k].law.class > Class::Constant && has_multiplier(system, &system.terms[*k]))
        .collect();
    let any = state_like_no_other(system, size);
    let empty = system.partial_matrix(&chosen, numbers)?;
    let others: Vec<f64> = any.iter().map(|x| -x).collect();
    // in one direction of sliding what friction adds to a force may cancel what the pressure adds
    let mut closed_sets = vec![closed(system, contact, &any, friction)];
    if friction == Friction::Slips {
        closed_sets.push(closed(system, contact, &others, friction));
    }
    let is_frozen = |k: usize| system.frozen().iter().any(|f| f.term == k);
    let states = if chosen.iter().any(|k| system.terms[*k].law.class > Class::Linear && !is_frozen(*k)) {
        vec![vec![0.0; any.len()], any, others]
    } else {
        vec![vec![0.0; any.len()]]
    };
    let mut found = Vec::new();
    for (state, closed) in states.iter().flat_map(|state| closed_sets.iter().map(move |closed| (state, closed))) {
        let mut matrix = empty.clone();
        // a state may lie outside the domain of a function: the others tell then
        if system.add_partial_tangent(&chosen, state, closed, numbers, &mut matrix).is_ok() {
            found.push(matrix);
        }
    }
    Ok(found)
}

/// Numbers by dof of which no two are in a simple ratio.
fn state_like_no_other(system: &System, size: f64) -> Vec<f64> {
    #[expect(clippy::cast_precision_loss, reason = "a number of a dof")]
    let number = |d: usize| size * (((d + 1) as f64 * GOLDEN).fract() - 0.5);
    (0..system.numbering.n_dofs).map(number).collect()
}

/// All points closed, on one branch of friction.
fn closed(system: &System, contact: &Contact, u: &[f64], friction: Friction) -> ActiveSet {
    let values = system.values_with(u, contact.active_set());
    let mut found = Vec::with_capacity(contact.terms().len());
    for term in contact.terms() {
        let mut data = term.open();
        term.stick_all(&mut data);
        if friction == Friction::Slips {
            let mut current = values.current.clone();
            data.stand_in(term.field, &mut current);
            let state = term.read(&system.mesh, FieldValues { current: &current, ..values.view() });
            term.slide_all(&state, &mut data);
        }
        found.push(data);
    }
    ActiveSet { terms: found }
}
