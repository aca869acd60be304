//! What a linked library of solvers is told of a system.
//!
//! Contact touches few unknowns with nonlinear terms on faces, and multipliers; a library may solve them apart. Does not
//! solve.

use std::sync::Arc;

use wfl_compiler::{Class, types::FieldKind};
use wfl_discrete::{
    assemble::{AssembledTerm, Over},
    pruning::Pruning,
    system::{FIXED, System},
};
use wfl_sparse::solve::{Equations, OnContact, Traits};

/// What the choice of a method depends on.
pub(super) fn traits(system: &System) -> Traits {
    traits_with(system, &on_contact(system, is_on_faces))
}

fn traits_with(system: &System, on_contact: &[u32]) -> Traits {
    let numbering = &system.numbering;
    let is_own = |free: &&u32| system.owns(numbering.free_dofs[**free as usize] as usize);
    let on_contact = system.team().count(on_contact.iter().filter(is_own).count());
    let is_multiplier = |dof: &&u32| system.fields[system.field_of(**dof as usize)].kind == FieldKind::Multiplier;
    let own = numbering.free_dofs.iter().filter(|dof| system.owns(**dof as usize));
    let multipliers = system.team().count(own.filter(is_multiplier).count());
    Traits {
        unknowns: system.n_unknowns(),
        multipliers,
        dimension: system.mesh.dim(),
        is_linear: system.is_linear(),
        is_symmetric: system.is_symmetric() && system.uses(Pruning::Symmetric),
        on_contact,
        obstacle: system.node_layout_with_multipliers().err(),
    }
}

/// The equations after the linear terms of a step have been assembled.
pub(super) fn equations(system: &System) -> Equations {
    let on_contact = on_contact(system, is_on_faces);
    let traits = traits_with(system, &on_contact);
    let (layout, multipliers) = system.node_layout_with_multipliers().map_or((None, Vec::new()), |(l, m)| (Some(l), m));
    let (constant, changing) = (system.shared_bulk(), Arc::clone(system.changing_pattern()));
    Equations { traits, constant, changing, layout, multipliers, on_contact, owners: system.owners() }
}

fn nonlinear(system: &System) -> impl Iterator<Item = &AssembledTerm> {
    let written = system.terms.iter().filter(|term| term.law.class >= Class::Nonlinear);
    written.chain(system.frozen().iter().map(|frozen| &frozen.form))
}

pub(super) fn is_on_faces(term: &AssembledTerm) -> bool {
    term.integrator.domain.over == Over::Facets
}

/// What is told of unknowns whose bodies and contact are not linear, or why there is no iteration for them.
pub(super) fn on_contact_by_nodes(system: &System) -> Result<OnContact, String> {
    let (layout, multipliers) = system.node_layout_with_multipliers()?;
    let always = on_contact(system, |term| is_on_faces(term) && !term.integrator.moves());
    let rows = on_contact(system, is_on_faces);
    let at_times = rows.iter().copied().filter(|row| always.binary_search(row).is_err()).collect();
    Ok(OnContact { layout, multipliers, rows, at_times })
}

/// Free dofs that nonlinear terms touch of those that count, those of multipliers, and those that these are coupled to: of this rank
/// and of those in its rows.
fn on_contact(system: &System, counts: impl Fn(&AssembledTerm) -> bool) -> Vec<u32> {
    let numbering = &system.numbering;
    let mut touched = vec![false; numbering.n_dofs];
    for term in nonlinear(system).filter(|term| counts(term)) {
        if term.integrator.moves() {
            // one face may meet all others, pair by pair
            term.dofs().into_iter().for_each(|dof| touched[dof as usize] = true);
            continue;
        }
        term.for_each_entity(|tests, trials| tests.iter().chain(trials).for_each(|dof| touched[*dof as usize] = true));
    }
    let is_multiplier = |dof: &u32| system.fields[system.field_of(*dof as usize)].kind == FieldKind::Multiplier;
    for term in system.terms.iter().filter(|term| term.law.class >= Class::Linear && is_on_faces(term)) {
        term.for_each_entity(|tests, trials| {
            if tests.iter().chain(trials).any(is_multiplier) {
                tests.iter().chain(trials).for_each(|dof| touched[*dof as usize] = true);
            }
        });
    }
    // a frame mixes the components of its node
    for dof in 0..touched.len() {
        if let (true, Some(frame)) = (touched[dof], numbering.frames.of(dof)) {
            touched[frame.first..][..frame.axes.len()].fill(true);
        }
    }
    let free = touched.iter().zip(&numbering.free).filter(|(touched, free)| **touched && **free != FIXED);
    free.map(|(_, free)| *free).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_block::{Block, LAPLACE};

    #[test]
    fn unknowns_on_contact_are_those_of_the_floor() {
        let with = traits(&Block::with_friction(2).system);
        assert_eq!(
            (with.unknowns, with.on_contact, with.multipliers),
            (6, 6, 0),
            "three nodes are free, all on the floor"
        );
        assert!(!with.is_linear && !with.is_symmetric, "friction is not");
        let without = traits(&Block::new(2, &[LAPLACE], &[]).system);
        assert_eq!((without.on_contact, without.is_linear, without.is_symmetric), (0, true, true));
    }

    #[test]
    fn a_linear_spring_on_a_face_is_no_contact() {
        let block = Block::new(1, &[LAPLACE], &["3*u.Test_u"]);
        assert_eq!(traits(&block.system).on_contact, 0);
    }
}
