//! Looks at a solved state: forces by term, what contact laws say of gaps, fields of one unit.

use wfl_compiler::types::FieldKind;

use super::System;
use crate::{
    assemble::{FieldValues, TermError},
    finite::{BadState, largest as largest_of},
    newton::{Coercivity, ContactGaps, FrictionWork},
};

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

    /// By dof: what rounding leaves of the residual that was evaluated last. Where linear terms are evaluated at their
    /// points only the others count: what rounds there moves nothing.
    #[must_use]
    pub fn rounding(&self, u: &[f64]) -> Vec<f64> {
        let mut sizes = self.magnitudes(u);
        if self.pointwise {
            sizes.iter_mut().zip(&self.magnitude).for_each(|(s, linear)| *s -= linear);
        }
        sizes.iter_mut().for_each(|s| *s = f64::EPSILON * s.max(0.0));
        sizes
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

    /// Whether a contact law of the scene holds stresses of the bodies in its projections, as Nitsche's method does: then
    /// the exact solution meets it whatever its parameter is.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        self.pieces.iter().any(|p| p.is_consistent(&self.fields))
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

    /// The work of friction from the state `before` to `u`, of all terms; `None` for a scene without friction.
    #[must_use]
    pub fn friction_work(&self, before: &[f64], u: &[f64]) -> Option<FrictionWork> {
        let (now, then, previous) =
            (self.slices_with_guides(u), self.slices_with_guides(before), self.previous_slices());
        let values = |current| FieldValues { current, previous: &previous };
        let of = |p: &crate::newton::TermPieces| {
            let term = &self.terms[p.term];
            p.friction_work(&self.mesh, &self.fields, term, (values(&now), values(&then)))
        };
        let all: Vec<FrictionWork> = self.pieces.iter().filter_map(of).collect();
        let sum = |part: fn(&FrictionWork) -> f64| all.iter().map(part).sum();
        (!all.is_empty()).then(|| FrictionWork {
            taken: sum(|w| w.taken),
            size: sum(|w| w.size),
            bound: sum(|w| w.bound),
        })
    }

    /// True if a term has friction.
    #[must_use]
    pub fn has_sliding(&self) -> bool {
        self.pieces.iter().any(crate::newton::TermPieces::has_ball)
    }

    /// The terms with held pieces.
    pub(crate) fn pieces(&self) -> &[crate::newton::TermPieces] {
        &self.pieces
    }

    /// The values of all fields at `u`, those that guide the held pieces behind those of the scene.
    pub(crate) fn slices_with_guides<'a>(&'a self, u: &'a [f64]) -> Vec<&'a [f64]> {
        let mut current = self.slices(u);
        current.extend(self.guides.iter().map(Vec::as_slice));
        current
    }

    /// Brings the laws of all terms to a step; assembles nothing.
    pub(crate) fn set_laws(&mut self, time: f64, increment: f64) {
        self.terms.iter_mut().for_each(|t| t.set_step(time, increment));
        self.pieces.iter_mut().for_each(|p| p.set_step(time, increment));
    }

    /// What each contact law leaves of gaps and friction cones at `u`, whose largest displacement is `moved`, with the
    /// name of its term. A law that moves nothing itself is left out beside one that does.
    #[must_use]
    pub fn contact_gaps(&self, u: &[f64], moved: f64) -> Vec<(&str, ContactGaps)> {
        let mut current = self.slices(u);
        current.extend(self.guides.iter().map(Vec::as_slice));
        let previous = self.previous_slices();
        let values = FieldValues { current: &current, previous: &previous };
        let acts = |p: &crate::newton::TermPieces| p.acts_on_displacements(&self.fields, &self.terms[p.term]);
        let some_act = self.pieces.iter().any(acts);
        let of = |p: &crate::newton::TermPieces| {
            let term = &self.terms[p.term];
            Some((term.law.name.as_str(), p.contact_gaps(&self.mesh, &self.fields, term, values, moved)?))
        };
        self.pieces.iter().filter(|p| !some_act || acts(p)).filter_map(of).collect()
    }

    /// True if no force acts on the free dofs where all of them are zero, at what is prescribed in `u` now: then that is
    /// the solution. The last residual is that of `u` again.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub(crate) fn rests(&mut self, u: &[f64]) -> Result<bool, TermError> {
        let mut still = u.to_vec();
        self.numbering.part_of_free(0.0, &mut still);
        let (mut residual, mut again) = (Vec::new(), Vec::new());
        self.residual(&still, &mut residual)?;
        self.residual(u, &mut again)?;
        let free = &self.numbering.free_dofs;
        Ok(free.iter().all(|d| residual[*d as usize] == 0.0))
    }
}
