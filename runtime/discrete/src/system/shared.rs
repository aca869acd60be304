//! One system on several ranks: each assembles its rows, and all have every number by dof.
//!
//! Vectors are whole on every rank, with the bits of a run on one rank alone, so what is decided from them is decided
//! alike everywhere. Matrices have the rows of their rank. What assembles is made by all ranks together: residuals,
//! tangents, the beginning of a step; a term by itself ([`System::term_residual`]) is not.

use std::sync::Arc;

use wfl_host::team::{Alone, Team};
use wfl_sparse::csr::{Csr, CsrError};
use wfl_sparse::solve::RowOwners;

use super::System;
use crate::{
    assemble::{AssembledTerm, BranchCounts, FieldValues, TermError},
    share::Share,
};

impl System {
    /// Shares the rows out over ranks that have prepared the same scene; before the first step.
    ///
    /// # Errors
    /// [`CsrError`] when the pattern does not fit the index types.
    pub fn share_rows(&mut self, team: Arc<dyn Team>) -> Result<(), CsrError> {
        if team.is_alone() {
            return Ok(());
        }
        self.n_changing = Some(self.n_changing_dofs());
        self.share = Some(Arc::new(Share::new(team, &self.fields, &self.numbering)));
        for term in self.terms.iter_mut().chain(self.frozen.iter_mut().map(|f| &mut f.form)) {
            term.forget_share();
        }
        self.locate()
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
        Some(RowOwners { team: Arc::clone(share.team()), of_row })
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

    /// Clears what other ranks add to numbers by dof.
    pub(super) fn keep_own(&self, values: &mut [f64]) {
        if let Some(share) = &self.share {
            share.keep_own(values);
        }
    }
}
