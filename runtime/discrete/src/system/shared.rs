//! One system on several ranks: each assembles its rows.
//!
//! Vectors of equations and matrices have the rows of their rank; vectors of states have copies of what other ranks own
//! ([`crate::share`]). What is decided follows from numbers that all ranks have agreed on: largest ones, sums. What
//! assembles is made by all ranks together: residuals, tangents, the beginning of a step.

use std::sync::Arc;

use wfl_host::team::{Alone, Team};
use wfl_sparse::csr::{Csr, CsrError};
use wfl_sparse::solve::RowOwners;

use super::{FIXED, System, for_each_coupling};
use crate::{
    assemble::{AssembledTerm, BranchCounts, FieldValues, TermError},
    rates::Driven,
    share::Share,
};

/// Free dofs of all ranks: all of them, and those that changing terms touch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    unknowns: usize,
    changing: usize,
}

impl System {
    /// Number of free dofs, of all ranks.
    #[must_use]
    pub fn n_unknowns(&self) -> usize {
        self.counts.unknowns
    }

    /// Number of free dofs that the changing terms touch, by row or by column; of all ranks.
    #[must_use]
    pub fn n_changing_dofs(&self) -> usize {
        self.counts.changing
    }

    /// By free dof 1 where the changing terms of this rank touch it, by row or by column, and 0 elsewhere; empty where
    /// there are none.
    fn touched(&self) -> Vec<f64> {
        let (numbering, mut touched) = (&self.numbering, Vec::new());
        let (equations, share) = (numbering.equations(), self.share.as_deref());
        let place = |dof: u32| equations[dof as usize];
        for_each_coupling(self.terms_with_places(), &numbering.frames, place, share, |rows, columns| {
            if !columns.is_empty() {
                touched.resize(numbering.n_free(), 0.0);
                rows.iter().chain(columns).for_each(|k| touched[*k as usize] = 1.0);
            }
        });
        touched
    }

    /// Counts what there is in the rows of all ranks.
    pub(super) fn count(&mut self) {
        let (n, mut touched) = (self.numbering.n_free(), self.touched());
        let Some(owners) = self.owners() else {
            let changing = touched.iter().filter(|flag| **flag > 0.0).count();
            self.counts = Counts { unknowns: n, changing };
            return;
        };
        // other ranks may touch what this one has no changing terms for
        touched.resize(n, 0.0);
        owners.halo.largest_at_owners(&*owners.team, &mut touched);
        let own = || (0..n).filter(|row| owners.owns(*row));
        let changing = own().filter(|row| touched[*row] > 0.0).count();
        self.counts = Counts { unknowns: self.team().count(own().count()), changing: self.team().count(changing) };
    }

    /// Shares the rows out over ranks that have prepared the same scene; before the first step.
    pub fn share_rows(&mut self, team: Arc<dyn Team>) {
        if team.is_alone() {
            return;
        }
        if self.mesh.part().is_none() {
            Arc::make_mut(&mut self.mesh).share(team);
            self.share_again();
            self.forget_places();
        }
    }

    /// Shares the dofs out as the nodes of the mesh are, where several ranks have them.
    pub(super) fn share_again(&mut self) {
        let Some(part) = self.mesh.part() else { return };
        self.share = Some(Arc::new(Share::new(&self.mesh, part, &self.fields, &self.numbering)));
        self.share_driven();
        let past = self.past_forms.iter_mut().map(|f| &mut f.form);
        for term in self.terms.iter_mut().chain(self.frozen.iter_mut().map(|f| &mut f.form)).chain(past) {
            term.forget_share();
        }
        self.rate_forms.clear();
    }

    /// A part of the mesh has not all faces of its copies: what moves them says their owner.
    fn share_driven(&mut self) {
        let Some(rates) = &self.known.rates else { return };
        // where nothing is driven here, copies may be
        let none = Driven::default();
        let driven = rates.driven().unwrap_or(&none);
        let n_components = |field: usize| self.fields[field].n_components;
        let nodes = rates.fields().iter().flat_map(|of| {
            let n = n_components(of.field);
            of.dofs.clone().step_by(n).map(move |first| first..first + n)
        });
        let shared = driven.shared(self.numbering.n_dofs, nodes, |values| self.update_copies(values));
        if let Some(rates) = &mut self.known.rates {
            rates.set_driven(shared);
        }
    }

    /// Gives a vector by dof that is right in the rows of this rank the numbers of the other ranks at copies.
    pub fn update_copies(&self, values: &mut [f64]) {
        if let Some(share) = &self.share {
            share.update(values);
        }
    }

    /// Whether this rank has the row of a dof.
    #[inline]
    #[must_use]
    pub fn owns(&self, dof: usize) -> bool {
        self.share.as_ref().is_none_or(|share| share.owns(dof))
    }

    /// The sum of products over all dofs, of the rows of all ranks.
    #[must_use]
    pub fn dot(&self, a: &[f64], b: &[f64]) -> f64 {
        let own = a.iter().zip(b).enumerate().filter(|(d, _)| self.owns(*d)).map(|(_, (a, b))| a * b);
        self.team().total(own.sum())
    }

    /// The ranks that assemble.
    #[must_use]
    pub fn team(&self) -> &dyn Team {
        self.share.as_ref().map_or(&Alone, |share| &**share.team())
    }

    /// Which rank has the row of each free dof; `None` where one rank has all.
    #[must_use]
    pub fn owners(&self) -> Option<RowOwners> {
        let share = self.share.as_ref()?;
        let of = |dof: &u32| u16::try_from(share.owner(*dof as usize)).expect("fewer than 2^16 ranks");
        let of_row = self.numbering.free_dofs.iter().map(of).collect();
        let free = |dof: u32| Some(self.numbering.free[dof as usize]).filter(|row| *row != FIXED);
        Some(RowOwners {
            team: Arc::clone(share.team()),
            of_row,
            halo: share.halo().renumbered(free),
            numbers: self
                .numbering
                .free_of_whole
                .as_ref()
                .map(|whole| self.numbering.free_dofs.iter().map(|dof| u64::from(whole[*dof as usize])).collect()),
        })
    }

    /// A matrix with the rows of all ranks, made by all together: for looking at it, where it is small.
    ///
    /// # Errors
    /// [`CsrError`] when it does not fit the index types.
    pub fn whole(&self, matrix: Csr) -> Result<Csr, CsrError> {
        if self.share.is_some() { matrix.of_all(self.team()) } else { Ok(matrix) }
    }

    /// Adds the rows of this rank of the residual of a term.
    pub(super) fn add_own(
        &self,
        term: &AssembledTerm,
        values: FieldValues<'_>,
        out: &mut [f64],
    ) -> Result<BranchCounts, TermError> {
        term.add_own_residual(&self.mesh, values, out, self.share.as_deref())
    }

    /// Adds the rows of this rank of the diagonal of the tangent of a term, by dof.
    pub fn add_diagonal(&self, term: &AssembledTerm, values: FieldValues<'_>, diagonal: &mut [f64]) {
        term.add_own_diagonal(&self.mesh, values, diagonal, self.share.as_deref());
    }
}
