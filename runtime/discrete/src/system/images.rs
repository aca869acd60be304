//! Tangents whose pattern follows the images of points.
//!
//! Terms whose images stay have their places in the pattern of the system. Those whose images move couple the faces that images
//! lie on at a state, and the faces around these; a tangent at a state whose images have left that gets another pattern,
//! which within a step holds the one before. Promises: no entry of a tangent is lost. With frames, with dofs that follow
//! others and on several ranks each face is coupled with all others at once.

use std::sync::Arc;

use wfl_compiler::Class;

use super::{Branches, FIXED, StateValues, System, Tangent};
use crate::assemble::{AssembledTerm, TermError};
use crate::rates::RateFactors;
use wfl_sparse::csr::{Csr, CsrError, Pattern, PatternBuilder};

/// How often a way is halved on which points go through a surface.
const HALVINGS: usize = 8;

impl System {
    /// True if the pattern of tangents follows images.
    #[must_use]
    pub fn follows_images(&self) -> bool {
        let is_plain = self.numbering.frames.is_empty() && !self.numbering.has_ties() && self.share.is_none();
        is_plain && self.has_moving_images()
    }

    /// The points that are inside another body and have no image there, of all terms.
    fn n_inside(&self, u: &[f64]) -> usize {
        let values = self.slices(u);
        let moving = self.terms.iter().filter_map(|t| t.integrator.domain.moving.as_ref());
        let inside = moving.map(|points| points.are_inside(&self.mesh, &values).into_iter().filter(|is| *is).count());
        inside.sum()
    }

    /// How much of a part of the way from one state to another may be gone so that no more points go through the surface of
    /// another body, further than their images may be: there the force of contact ends, and a residual without it is no
    /// smaller one. All of it where halving does not help.
    #[must_use]
    pub fn way_of_images(&self, from: &[f64], to: &[f64], part: f64) -> f64 {
        if !self.has_moving_images() {
            return part;
        }
        let before = self.n_inside(from);
        let mut u = vec![0.0; from.len()];
        let mut tried = part;
        for _ in 0..HALVINGS {
            u.iter_mut().zip(from.iter().zip(to)).for_each(|(u, (a, b))| *u = a + tried * (b - a));
            if self.n_inside(&u) <= before {
                return tried;
            }
            tried *= 0.5;
        }
        part
    }

    /// The forms of the terms that change: the number of the term, and what is assembled for it.
    fn changing_forms(&self, branches: Branches<'_>) -> impl Iterator<Item = &AssembledTerm> {
        let is_frozen = matches!(branches, Branches::Frozen(_));
        let changing = self.terms.iter().enumerate().filter(|(_, t)| t.law.class >= Class::Nonlinear);
        changing.map(move |(k, term)| {
            let frozen = self.frozen.iter().find(|f| is_frozen && f.term == k);
            frozen.map_or(term, |f| &f.form)
        })
    }

    /// The tangent of the changing terms at `u`, in a pattern that holds the images there.
    pub(super) fn tangent_of_images(
        &self,
        u: &[f64],
        branches: Branches<'_>,
        out: &mut Tangent,
    ) -> Result<(), TermError> {
        let values = match branches {
            Branches::AsWritten => self.values(u),
            Branches::Frozen(active) => self.values_with(u, active),
        };
        let Some(images) = &mut out.images else { return Ok(()) };
        let matrix = images.fixed.values_mut();
        matrix.fill(0.0);
        for term in self.changing_forms(branches).filter(|t| !t.integrator.moves()) {
            term.add_tangent(&self.mesh, values.view(), matrix)?;
        }
        if !self.add_images(&values, branches, out)? {
            self.renew(&values, branches, out)?;
            let is_complete = self.add_images(&values, branches, out)?;
            assert!(is_complete, "the pattern was made for these images");
        }
        Ok(())
    }

    /// Makes the tangent the fixed part and adds the terms whose images move. False if the pattern lacks an image.
    fn add_images(
        &self,
        values: &StateValues<'_>,
        branches: Branches<'_>,
        out: &mut Tangent,
    ) -> Result<bool, TermError> {
        let Some(images) = &out.images else { return Ok(true) };
        let pattern = out.changing.pattern().clone();
        let matrix = out.changing.values_mut();
        matrix.fill(0.0);
        images.places.iter().zip(images.fixed.values()).for_each(|(place, value)| matrix[*place] = *value);
        for term in self.changing_forms(branches).filter(|t| t.integrator.moves()) {
            let on = (&pattern, self.numbering.free.as_slice());
            if !term.add_tangent_of_images(&self.mesh, values.view(), on, matrix)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// What terms whose images move couple at these values and near them, over the free dofs.
    pub(super) fn pattern_near<'s>(
        &self,
        terms: impl Iterator<Item = &'s AssembledTerm>,
        values: &StateValues<'_>,
    ) -> Result<Pattern, CsrError> {
        let n = self.numbering.n_free();
        let mut builder = PatternBuilder::new(n, n);
        let place = |dofs: &[u32], places: &mut Vec<u32>| {
            places.clear();
            places.extend(dofs.iter().map(|d| self.numbering.free[*d as usize]).filter(|place| *place != FIXED));
        };
        let (mut rows, mut columns) = (Vec::new(), Vec::new());
        for term in terms {
            term.for_each_near(&self.mesh, values.view(), &mut |tests, trials| {
                place(tests, &mut rows);
                place(trials, &mut columns);
                builder.add_coupling(&rows, &columns);
            });
        }
        builder.build()
    }

    /// Gives a tangent a pattern for the images at these values.
    fn renew(&self, values: &StateValues<'_>, branches: Branches<'_>, out: &mut Tangent) -> Result<(), TermError> {
        let Some(images) = &mut out.images else { return Ok(()) };
        let near = self.pattern_near(self.changing_forms(branches).filter(|t| t.integrator.moves()), values);
        let step = Some(self.window.with_rates(RateFactors::default()));
        let before = if images.step == step { out.changing.pattern() } else { images.fixed.pattern() };
        let united = |added: Pattern| before.union(&added).map(Arc::new);
        let pattern = near.and_then(united).map_err(TermError::Matrix)?;
        images.places = images.fixed.pattern().positions_in(&pattern).expect("a part of the union");
        images.step = step;
        out.changing = Csr::zeros(pattern);
        Ok(())
    }
}
