//! Looks at a state: forces by term, fields of one unit, numbers that are not finite.

use wfl_compiler::types::FieldKind;

use super::System;
use crate::assemble::TermError;
use crate::finite::{BadState, largest as largest_of};

impl System {
    /// The first of the fields whose values have the unit and size of those of `field`: displacements of bodies that
    /// meet on an interface.
    #[must_use]
    pub fn alike(&self, field: usize) -> usize {
        self.meets[field]
    }

    /// By unknown field: the largest entry of `v` over the largest of `u` among the fields of its unit and size. Fields
    /// that are all zero are left out.
    #[must_use]
    pub fn relative_sizes(&self, u: &[f64], v: &[f64]) -> Vec<(usize, f64)> {
        let unknown = |k: &usize| self.fields[*k].kind == FieldKind::Unknown && self.range(*k).is_some();
        let largest = |w: &[f64], k: usize| {
            let kind = (0..self.fields.len()).filter(unknown).filter(|f| self.alike(*f) == self.alike(k));
            let values = kind.filter_map(|f| self.range(f)).flat_map(|r| w[r].iter());
            largest_of(values.copied())
        };
        let sizes = (0..self.fields.len()).filter(unknown).map(|k| (k, largest(u, k)));
        sizes.filter(|(_, size)| *size > 0.0).map(|(k, size)| (k, largest(v, k) / size)).collect()
    }

    /// Refuses numbers by dof that are not finite, of the state `u`.
    ///
    /// # Errors
    /// [`TermError::State`] with the first of them; `what` says what they are.
    pub fn check_finite(&self, what: &'static str, numbers: &[f64], u: &[f64]) -> Result<(), TermError> {
        let Some(dof) = numbers.iter().position(|x| !x.is_finite()) else { return Ok(()) };
        let (field, node, _) = self.numbering.describe(&self.fields, dof);
        let f = &self.fields[field];
        Err(TermError::State(Box::new(BadState {
            what,
            field: f.name.clone(),
            value: numbers[dof],
            position: f.node_position(node),
            largest: largest_of(u.iter().copied()),
        })))
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
    pub fn term_residual(&self, term: usize, u: &[f64], out: &mut [f64]) -> Result<(), TermError> {
        self.terms[term].add_residual(&self.mesh, self.values(u).view(), out).map(|_| ())
    }
}
