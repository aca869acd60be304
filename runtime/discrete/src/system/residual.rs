//! The residual at a state, with the sizes that errors of it are relative to.

use wfl_compiler::Class;

use super::{ActiveSet, Branches, Form, LinearTerms, System};
use crate::assemble::{BranchCounts, TermError};
use crate::finite::largest;

/// A residual by dof, fixed ones included (their entries are reactions), in local frames where there are some. Of several
/// ranks each has its rows.
#[derive(Clone, Debug, Default)]
pub struct Residual {
    /// Of the equations that were asked for.
    pub values: Vec<f64>,
    /// By dof: sum of |K| |u| over the linear terms and of the sizes of the constant ones, what rounding of them is
    /// relative to.
    pub linear_sizes: Vec<f64>,
    /// By term: the branches of its kinks as the term is written; without entries for terms without kinks.
    pub branches: Vec<BranchCounts>,
    /// By body: the largest contribution of one class of terms to one entry (force).
    pub forces: Vec<f64>,
    /// How linear terms were evaluated.
    pub linear: LinearTerms,
    /// In the axes of the scene, without the terms that have a frozen form; empty if none has.
    without_frozen: Vec<f64>,
}

impl System {
    /// The residual at `u`, by dof.
    ///
    /// # Errors
    /// [`TermError`] with its place, also where `u` or a sum over terms is not finite.
    pub fn residual(&self, u: &[f64], form: &Form<'_>) -> Result<Residual, TermError> {
        self.check_finite("value", u, u)?;
        let mut out = self.constant.clone();
        let mut sum = Residual {
            linear_sizes: self.constant_sizes.clone(),
            forces: self.largest_by_body(&self.constant),
            linear: form.linear,
            ..Residual::default()
        };
        for ((slot, size), offset) in out.iter_mut().zip(&mut sum.linear_sizes).zip(form.offset) {
            *slot += offset;
            *size += offset.abs();
        }
        self.add_linear(u, form, &mut out, &mut sum)?;
        sum.branches.resize_with(self.terms.len(), BranchCounts::default);
        if !self.is_linear() {
            self.add_changing(u, &mut out, &mut sum)?;
        }
        self.team().max(&mut sum.forces);
        self.numbering.turn(&mut out);
        self.numbering.turn_sizes(&mut sum.linear_sizes);
        self.check_finite("residual", &out, u)?;
        sum.values = match form.branches {
            Branches::AsWritten => out,
            Branches::Frozen(active) => self.frozen_residual(&sum, u, active)?,
        };
        Ok(sum)
    }

    /// The residual at `u` of all terms as they are written, each at its points, by dof in local frames; and by term the
    /// branches of its kinks. Needs the laws of a step ([`Self::set_laws`]) alone, no matrix.
    ///
    /// # Errors
    /// As [`Self::residual`].
    pub fn residual_at_points(&self, u: &[f64]) -> Result<(Vec<f64>, Vec<BranchCounts>), TermError> {
        self.check_finite("value", u, u)?;
        let mut out = vec![0.0; u.len()];
        let values = self.values(u);
        let branches = self.terms.iter().map(|term| self.add_own(term, values.view(), &mut out));
        let branches = branches.collect::<Result<Vec<_>, _>>()?;
        self.numbering.turn(&mut out);
        self.check_finite("residual", &out, u)?;
        Ok((out, branches))
    }

    /// The residual at the same `u` as `here` with the branches of an active set: only the terms that have some are
    /// evaluated again.
    ///
    /// # Errors
    /// [`TermError`] with its place.
    pub fn frozen_residual(&self, here: &Residual, u: &[f64], active: &ActiveSet) -> Result<Vec<f64>, TermError> {
        if self.frozen.is_empty() {
            return Ok(here.values.clone());
        }
        let mut out = here.without_frozen.clone();
        let values = self.values_with(u, active);
        for frozen in &self.frozen {
            self.add_own(&frozen.form, values.view(), &mut out)?;
        }
        self.numbering.turn(&mut out);
        Ok(out)
    }

    /// Adds the linear terms at `u` to `out`, which holds what affine ones give at `base` (by dof, in the axes of the scene,
    /// in the rows of this rank).
    fn add_linear(&self, u: &[f64], form: &Form<'_>, out: &mut [f64], sum: &mut Residual) -> Result<(), TermError> {
        let (mut part, mut sizes) = (vec![0.0; out.len()], vec![0.0; out.len()]);
        let add = |sum: &mut Residual, sizes: &[f64]| {
            sum.linear_sizes.iter_mut().zip(sizes).for_each(|(sum, size)| *sum += size);
        };
        let is_assembled = if self.base.is_empty() {
            self.multiply_linear(u, None, [&mut part, &mut sizes, &mut []])
        } else {
            let change: Vec<f64> = u.iter().zip(&self.base).map(|(u, base)| u - base).collect();
            let mut whole = vec![0.0; out.len()];
            let is_assembled = self.multiply_linear(&change, Some(u), [&mut part, &mut sizes, &mut whole]);
            // unknowns are rounded as a whole, however small the change is that they are made of
            add(sum, &whole);
            is_assembled
        };
        if !is_assembled {
            return Ok(());
        }
        add(sum, &sizes);
        self.grow(&mut sum.forces, &part);
        if form.linear == LinearTerms::ByMatrix {
            out.iter_mut().zip(&part).for_each(|(slot, p)| *slot += p);
            return Ok(());
        }
        // the terms bring their constants with them
        out.fill(0.0);
        out.iter_mut().zip(form.offset).for_each(|(slot, s)| *slot = *s);
        let values = self.values(u);
        for term in self.terms.iter().filter(|t| t.law.class <= Class::Linear) {
            self.add_own(term, values.view(), out)?;
        }
        self.add_redistributed_at(u, out);
        Ok(())
    }

    /// Adds the terms that are neither constant nor linear to `out`, which holds the others (by dof, in the axes of the
    /// scene, the rows of this rank).
    fn add_changing(&self, u: &[f64], out: &mut [f64], sum: &mut Residual) -> Result<(), TermError> {
        let mut rest = vec![0.0; out.len()];
        let mut with_frozen = vec![0.0; if self.frozen.is_empty() { 0 } else { out.len() }];
        let values = self.values(u);
        for (k, term) in self.terms.iter().enumerate().filter(|(_, t)| t.law.class >= Class::Nonlinear) {
            let target = if self.frozen.iter().any(|f| f.term == k) { &mut with_frozen } else { &mut rest };
            sum.branches[k] = self.add_own(term, values.view(), target)?;
        }
        if !self.frozen.is_empty() {
            sum.without_frozen.extend(out.iter().zip(&rest).map(|(a, b)| a + b));
            rest.iter_mut().zip(&with_frozen).for_each(|(a, b)| *a += b);
        }
        self.grow(&mut sum.forces, &rest);
        for (slot, r) in out.iter_mut().zip(&rest) {
            *slot += r;
        }
        Ok(())
    }

    fn grow(&self, forces: &mut [f64], part: &[f64]) {
        let sizes = self.largest_by_body(part);
        for (f, s) in forces.iter_mut().zip(sizes) {
            *f = largest([*f, s]);
        }
    }

    /// By field the largest of numbers by dof that this rank has; zero for fields that are not solved for.
    #[must_use]
    pub fn largest_by_field(&self, v: &[f64]) -> Vec<f64> {
        let by_field = |k: usize| self.range(k).map_or(0.0, |r| largest(v[r].iter().copied()));
        (0..self.fields.len()).map(by_field).collect()
    }
}
