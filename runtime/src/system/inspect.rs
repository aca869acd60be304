//! Looks at a solved state: forces by term, what contact laws say of gaps, fields of one unit.

use super::System;
use crate::{
    assemble::{FieldValues, TermError},
    newton::{Coercivity, ContactGaps},
};

impl System {
    /// The first of the fields whose values have the unit and size of those of `field`: displacements of bodies that
    /// meet on an interface.
    #[must_use]
    pub fn alike(&self, field: usize) -> usize {
        self.meets[field]
    }

    /// The unknown field that a dof belongs to.
    #[must_use]
    pub fn field_of(&self, dof: usize) -> usize {
        self.numbering.describe(&self.fields, dof).0
    }

    /// By dof: the residual of what does not depend on the unknowns at this step; loads with the other sign.
    #[must_use]
    pub fn constant_residual(&self) -> &[f64] {
        &self.constant
    }

    /// Adds the residual of one term at `u` to `out`, by dof.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn term_residual(&mut self, term: usize, u: &[f64], out: &mut [f64]) -> Result<(), TermError> {
        self.with_values(u, |parts, values| parts.terms[term].add_residual(parts.mesh, values, out))
    }

    /// The parameter of each Nitsche term against the smallest safe one, at the state without displacement; call after
    /// the first [`System::set_step`].
    #[must_use]
    pub fn coercivity(&self) -> Vec<Coercivity> {
        let zero = vec![0.0; self.numbering.n_dofs];
        let mut current = self.slices(&zero);
        current.extend(self.guides.iter().map(Vec::as_slice));
        let previous = self.previous_slices();
        let values = FieldValues { current: &current, previous: &previous };
        let of = |p: &crate::newton::TermPieces| {
            p.coercivity(&self.mesh, &self.fields, &self.terms, values, &self.numbering.starts)
        };
        self.pieces.iter().filter_map(of).collect()
    }

    /// What each contact law leaves of gaps and friction cones at `u`, with the name of its term.
    #[must_use]
    pub fn contact_gaps(&self, u: &[f64]) -> Vec<(&str, ContactGaps)> {
        let mut current = self.slices(u);
        current.extend(self.guides.iter().map(Vec::as_slice));
        let previous = self.previous_slices();
        let values = FieldValues { current: &current, previous: &previous };
        let of = |p: &crate::newton::TermPieces| {
            let term = &self.terms[p.term];
            Some((term.law.name.as_str(), p.contact_gaps(&self.mesh, &self.fields, term, values)?))
        };
        self.pieces.iter().filter_map(of).collect()
    }
}
