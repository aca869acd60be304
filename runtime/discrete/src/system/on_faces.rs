//! The part of a tangent that terms on faces have, apart from that of the bodies: for solvers that treat contact by itself.
//!
//! Promises: nothing is made where nobody asked for it.

use std::sync::Arc;

use wfl_compiler::Class;
use wfl_sparse::csr::{Csr, Pattern};

use super::{Branches, SceneAxes, System, SystemError, pattern};
use crate::assemble::{Over, TermError};
use crate::frames::Frames;

/// Where the terms on faces that are not linear stand in a matrix of their own.
pub(super) struct OnFaces {
    terms: Vec<usize>,
    /// Where they are summed before they are rotated; `None` without local frames and dofs that follow others.
    axes: Option<SceneAxes>,
    pattern: Arc<Pattern>,
}

impl System {
    /// From now on tangents have the part of the terms on faces beside them, too.
    ///
    /// # Errors
    /// [`SystemError`] when the pattern does not fit the index types.
    pub fn keep_faces_apart(&mut self) -> Result<(), SystemError> {
        let is_own = |k: &usize| {
            let term = &self.terms[*k];
            term.law.class >= Class::Nonlinear && term.integrator.domain.over == Over::Facets
        };
        let terms: Vec<usize> = (0..self.terms.len()).filter(is_own).collect();
        let frozen = self.frozen.iter().filter(|frozen| is_own(&frozen.term)).map(|frozen| &frozen.form);
        let all = terms.iter().map(|k| &self.terms[*k]).chain(frozen);
        let numbering = &self.numbering;
        let (axes, pattern) = if numbering.frames.is_empty() && !numbering.has_ties() {
            let place = |dof: u32| numbering.free[dof as usize];
            let own = pattern(all, numbering.n_free(), &Frames::default(), place, None)?;
            (None, Arc::clone(own.pattern()))
        } else {
            let axes = SceneAxes::new(all, numbering, None)?;
            let pattern = Arc::clone(axes.free_pattern());
            (Some(axes), pattern)
        };
        self.on_faces = Some(Arc::new(OnFaces { terms, axes, pattern }));
        Ok(())
    }

    /// The tangent of the terms on faces at a state over the free dofs.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub(super) fn tangent_on_faces(&self, held: &OnFaces, u: &[f64], branches: Branches<'_>) -> Result<Csr, TermError> {
        let (pattern, rows) = match &held.axes {
            Some(axes) => (axes.pattern(), &axes.rows),
            None => (&held.pattern, &self.numbering.free),
        };
        let (values, is_frozen) = match branches {
            Branches::AsWritten => (self.values(u), false),
            Branches::Frozen(active) => (self.values_with(u, active), true),
        };
        let mut made = Csr::zeros(Arc::clone(pattern));
        for k in &held.terms {
            let frozen = self.frozen.iter().find(|frozen| is_frozen && frozen.term == *k);
            let mut term = frozen.map_or(&self.terms[*k], |frozen| &frozen.form).clone();
            term.locate(pattern, rows);
            term.add_tangent(&self.mesh, values.view(), made.values_mut())?;
        }
        let Some(axes) = &held.axes else { return Ok(made) };
        self.numbering.frames.turn_matrix(&mut made, |dof| axes.rows[dof] as usize);
        let mut turned = Csr::zeros(Arc::clone(&held.pattern));
        axes.apply_into(&made, turned.values_mut());
        Ok(turned)
    }
}
