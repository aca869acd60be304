//! The part of a tangent that terms on faces have, apart from that of the bodies: for solvers that treat contact by itself.
//!
//! Promises: nothing is made where nobody asked for it.

use std::sync::Arc;

use wfl_compiler::Class;
use wfl_sparse::csr::{Csr, Pattern};

use super::{Branches, SceneAxes, StateValues, System, SystemError, pattern};
use crate::assemble::{AssembledTerm, Over, TermError};
use crate::frames::Frames;
use crate::rates::RateFactors;
use crate::window::Window;

/// Where the terms on faces that are not linear stand in a matrix of their own.
pub(super) struct OnFaces {
    terms: Vec<usize>,
    /// Where they are summed before they are rotated; `None` without local frames and dofs that follow others.
    axes: Option<SceneAxes>,
    /// Over the free dofs; of terms whose images are followed the place is that of each tangent.
    pattern: Arc<Pattern>,
}

/// The part of a tangent that terms on faces have.
#[derive(Clone, Debug)]
pub(super) struct PartOnFaces {
    pub(super) matrix: Arc<Csr>,
    /// The step that its pattern was made in, where images are followed and it may be used again.
    pub(super) step: Option<Window>,
}

/// Where a matrix is summed.
#[derive(Clone, Copy)]
struct Place<'a> {
    pattern: &'a Arc<Pattern>,
    /// By dof its row.
    rows: &'a [u32],
}

impl System {
    /// From now on tangents have the part of the terms on faces beside them, too.
    ///
    /// # Errors
    /// [`SystemError`] when the pattern does not fit the index types.
    pub fn keep_faces_apart(&mut self) -> Result<(), SystemError> {
        let is_own =
            |term: &AssembledTerm| term.law.class >= Class::Nonlinear && term.integrator.domain.over == Over::Facets;
        let terms: Vec<usize> = (0..self.terms.len()).filter(|k| is_own(&self.terms[*k])).collect();
        let frozen = self.frozen.iter().filter(|frozen| terms.contains(&frozen.term)).map(|frozen| &frozen.form);
        let all = terms.iter().map(|k| &self.terms[*k]).chain(frozen).filter(|term| !self.is_followed(term));
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

    /// The tangent of the terms on faces at a state over the free dofs, where tangents have it beside them; `before` is that of an
    /// earlier state.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub(super) fn tangent_on_faces(
        &self,
        u: &[f64],
        branches: Branches<'_>,
        before: Option<PartOnFaces>,
    ) -> Result<Option<PartOnFaces>, TermError> {
        let Some(held) = self.on_faces.as_deref() else { return Ok(None) };
        let values = match branches {
            Branches::AsWritten => self.values(u),
            Branches::Frozen(active) => self.values_with(u, active),
        };
        if self.follows_images() {
            return self.images_on_faces(held, &values, branches, before).map(Some);
        }
        let (pattern, rows) = match &held.axes {
            Some(axes) => (axes.pattern(), &axes.rows),
            None => (&held.pattern, &self.numbering.free),
        };
        let place = Place { pattern, rows };
        let mut matrix = self.sum_on_faces(held, &values, branches, place)?;
        if let Some(axes) = &held.axes {
            self.numbering.frames.turn_matrix(&mut matrix, |dof| axes.rows[dof] as usize);
            let mut turned = Csr::zeros(Arc::clone(&held.pattern));
            axes.apply_into(&matrix, turned.values_mut());
            matrix = turned;
        }
        Ok(Some(PartOnFaces { matrix: Arc::new(matrix), step: None }))
    }

    /// What is held of the terms on faces, summed in its place. Those whose images are followed are left out.
    fn sum_on_faces(
        &self,
        held: &OnFaces,
        values: &StateValues<'_>,
        branches: Branches<'_>,
        place: Place<'_>,
    ) -> Result<Csr, TermError> {
        let mut matrix = Csr::zeros(Arc::clone(place.pattern));
        for form in self.forms_on_faces(held, branches).filter(|form| !self.is_followed(form)) {
            let mut term = form.clone();
            term.locate(place.pattern, place.rows);
            term.add_tangent(&self.mesh, values.view(), matrix.values_mut())?;
        }
        Ok(matrix)
    }

    /// The same with those whose images are followed. Within a step the pattern holds the one before, and it is that one where no image has
    /// left it.
    fn images_on_faces(
        &self,
        held: &OnFaces,
        values: &StateValues<'_>,
        branches: Branches<'_>,
        before: Option<PartOnFaces>,
    ) -> Result<PartOnFaces, TermError> {
        let step = Some(self.window.with_rates(RateFactors::default()));
        let before = before.filter(|before| before.step == step);
        let rows = self.numbering.free.as_slice();
        if let Some(before) = &before {
            let place = Place { pattern: before.matrix.pattern(), rows };
            let mut matrix = self.sum_on_faces(held, values, branches, place)?;
            if self.add_images_on_faces(held, values, branches, &mut matrix)? {
                return Ok(PartOnFaces { matrix: Arc::new(matrix), step });
            }
        }
        let kept = before.as_ref().map_or(&held.pattern, |before| before.matrix.pattern());
        let followed = self.forms_on_faces(held, branches).filter(|form| self.is_followed(form));
        let near = self.pattern_near(followed, values).and_then(|near| kept.union(&near));
        let pattern = Arc::new(near.map_err(TermError::Matrix)?);
        let mut matrix = self.sum_on_faces(held, values, branches, Place { pattern: &pattern, rows })?;
        let is_complete = self.add_images_on_faces(held, values, branches, &mut matrix)?;
        assert!(is_complete, "the pattern was made for these images");
        Ok(PartOnFaces { matrix: Arc::new(matrix), step })
    }

    /// Adds the terms whose images are followed. False if the pattern lacks an image.
    fn add_images_on_faces(
        &self,
        held: &OnFaces,
        values: &StateValues<'_>,
        branches: Branches<'_>,
        matrix: &mut Csr,
    ) -> Result<bool, TermError> {
        let pattern = Arc::clone(matrix.pattern());
        for form in self.forms_on_faces(held, branches).filter(|form| self.is_followed(form)) {
            let on = (&pattern, self.numbering.free.as_slice());
            if !form.add_tangent_of_images(&self.mesh, values.view(), on, matrix.values_mut())? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn forms_on_faces<'s>(
        &'s self,
        held: &'s OnFaces,
        branches: Branches<'_>,
    ) -> impl Iterator<Item = &'s AssembledTerm> {
        let is_frozen = matches!(branches, Branches::Frozen(_));
        held.terms.iter().map(move |k| {
            let frozen = self.frozen.iter().find(|frozen| is_frozen && frozen.term == *k);
            frozen.map_or(&self.terms[*k], |frozen| &frozen.form)
        })
    }

    /// Whether tangents follow the images of a term.
    fn is_followed(&self, term: &AssembledTerm) -> bool {
        self.follows_images() && term.integrator.moves()
    }
}
