//! Nodes of fields with second rates that have no inertia: no term with one acts there, or they gave their mass away.
//!
//! Their equations are static. So no equation says what their second rates are, and beside the inertia of the others their forces are
//! nothing in short steps. Found once, from the terms and the redistribution of mass, not from what the mass is anywhere.

use std::sync::Arc;

use super::System;
use crate::{
    field::FieldSpace,
    rates::{FieldRates, Rates},
};
use wfl_compiler::types::{RateForm, RateOrder};

impl System {
    /// Looks for the nodes without inertia: before the first step, once the mass stands where it stays.
    pub fn find_nodes_without_mass(&mut self) {
        let has_nodes = |of: &&FieldRates| {
            of.form == RateForm::Second && matches!(self.fields[of.field].space, FieldSpace::Nodal(_))
        };
        let fields = self.rates().into_iter().flat_map(Rates::fields).filter(has_nodes);
        let of_fields: Vec<usize> = fields.flat_map(|of| of.dofs.clone()).collect();
        if of_fields.is_empty() {
            return;
        }
        let has_mass = self.where_masses_are();
        let without: Vec<usize> = of_fields.into_iter().filter(|d| !has_mass[*d]).collect();
        if without.is_empty() {
            return;
        }
        let moves = |body: &usize| self.dofs_of_body(*body).any(|d| has_mass[d]);
        let beside = (0..self.n_bodies()).filter(|body| self.range(self.field_of_body(*body)).is_some()).filter(moves);
        let mut static_beside_inertia: Vec<usize> =
            beside.flat_map(|body| self.dofs_of_body(body)).filter(|d| without.binary_search(d).is_ok()).collect();
        static_beside_inertia.sort_unstable();
        static_beside_inertia.dedup();
        self.static_beside_inertia = Arc::new(static_beside_inertia);
        if let Some(rates) = &mut self.known.rates {
            rates.set_without_mass(without);
        }
    }

    /// The dofs without inertia of bodies that have some elsewhere, rising.
    #[must_use]
    pub fn static_beside_inertia(&self) -> &[usize] {
        &self.static_beside_inertia
    }

    /// By dof whether inertia acts on it; a node that follows another shares its own.
    fn where_masses_are(&self) -> Vec<bool> {
        let mut has_mass = vec![false; self.numbering.n_dofs];
        for term in self.terms.iter().filter(|term| term.law.reads_rates(RateOrder::Second)) {
            term.for_each_entity(|rows, _| rows.iter().for_each(|d| has_mass[*d as usize] = true));
        }
        if let Some(redistribution) = self.redistribution() {
            (0..has_mass.len()).filter(|d| redistribution.is_relieved(*d)).for_each(|d| has_mass[d] = false);
        }
        let ties = self.numbering.ties();
        ties.iter().for_each(|tie| has_mass[tie.leader] |= has_mass[tie.follower]);
        ties.iter().for_each(|tie| has_mass[tie.follower] |= has_mass[tie.leader]);
        has_mass
    }
}
