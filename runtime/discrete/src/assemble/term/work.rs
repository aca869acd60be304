//! Who computes what of a term: threads, rows and places, made once and kept.

use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use wfl_mesh::mesh::Mesh;
use wfl_sparse::csr::Pattern;

use super::AssembledTerm;
use crate::{
    assemble::{
        evaluate::Workspace,
        rows::Rows,
        scatter::Halves,
        shares::{Duty, Shares, Touched},
    },
    share::Share,
};

/// Where the tangent of a term goes.
pub(super) struct Located {
    pub(super) pattern: Arc<Pattern>,
    /// The row of each dof.
    pub(super) rows: Vec<u32>,
    /// The rows that the pattern has; `None` for all.
    pub(super) share: Option<Arc<Share>>,
}

/// For the number of threads that assembled last.
#[derive(Clone, Default)]
pub(super) struct Kept {
    shares: Option<Arc<Shares>>,
    /// Of the located pattern.
    rows: Option<Arc<Rows>>,
    /// Of the located pattern, once a matrix is filled again.
    halves: Option<Arc<Halves>>,
}

impl Kept {
    fn forget_places(&mut self) {
        (self.rows, self.halves) = (None, None);
    }
}

/// A copy has workspaces of its own.
impl Clone for AssembledTerm {
    fn clone(&self) -> Self {
        let kept = |k: usize| Mutex::new(self.kept[k].lock().unwrap_or_else(PoisonError::into_inner).clone());
        Self {
            law: Arc::clone(&self.law),
            integrator: self.integrator.clone(),
            assembled: self.assembled.clone(),
            place: self.place.clone(),
            residual: Arc::clone(&self.residual),
            tangent: self.tangent.clone(),
            summands: self.summands.clone(),
            step: self.step.clone(),
            uniforms: self.uniforms.clone(),
            dofs: Arc::clone(&self.dofs),
            entries: Arc::clone(&self.entries),
            residual_needs: self.residual_needs.clone(),
            tangent_needs: self.tangent_needs.clone(),
            plans: Arc::clone(&self.plans),
            scatters: Arc::clone(&self.scatters),
            located: Arc::clone(&self.located),
            kept: [kept(0), kept(1)],
            workspaces: Mutex::default(),
            moving: self.moving.clone(),
            given: self.given.clone(),
        }
    }
}

impl AssembledTerm {
    /// Who computes what on the threads of the current pool that are worth while.
    fn shares(&self, mesh: &Mesh, share: Option<&Share>, kept: &mut Kept) -> Arc<Shares> {
        let domain = &self.assembled.domain;
        let n = Shares::count(domain, rayon::current_num_threads());
        if let Some(shares) = kept.shares.as_ref().filter(|s| s.duties.len() == n) {
            return shares.clone();
        }
        kept.forget_places();
        let made = Shares::new(mesh, domain, &self.assembled.binding, &self.touched(), share, n);
        kept.shares.insert(Arc::new(made)).clone()
    }

    fn kept(&self, share: Option<&Share>) -> &Mutex<Kept> {
        &self.kept[usize::from(share.is_some())]
    }

    /// The same with the rows of the located matrix, and with its halves if it is filled again.
    pub(super) fn shared_rows(
        &self,
        mesh: &Mesh,
        located: &Located,
        is_new: bool,
    ) -> (Arc<Shares>, Arc<Rows>, Option<Arc<Halves>>) {
        let Located { pattern, rows: free, share } = located;
        let mut kept = self.kept(share.as_deref()).lock().unwrap_or_else(PoisonError::into_inner);
        let shares = self.shares(mesh, share.as_deref(), &mut kept);
        let known = kept.rows.take().filter(|rows| rows.can_clear() || !is_new);
        let rows = || Arc::new(Rows::new(pattern, free, &shares, &self.touched(), is_new));
        let rows = kept.rows.insert(known.unwrap_or_else(rows)).clone();
        let halves = || Arc::new(Halves::new(self.scatters(), &shares, pattern.n_entries()));
        let halves = is_new.then(|| kept.halves.get_or_insert_with(halves).clone());
        (shares, rows, halves)
    }

    /// Forgets what belongs to a pattern.
    pub(super) fn forget_places(&mut self) {
        if let Some(moving) = &mut self.moving {
            moving.forget_places();
        }
        for kept in &mut self.kept {
            kept.get_mut().unwrap_or_else(PoisonError::into_inner).forget_places();
        }
    }

    /// Forgets which rows are those of this rank.
    pub(crate) fn forget_share(&mut self) {
        self.kept[1] = Mutex::default();
    }

    fn touched(&self) -> Touched<'_> {
        Touched::new(&self.assembled.domain, &self.assembled.binding, &self.dofs)
    }

    pub(super) fn with_workspace(&self, work: impl FnOnce(&mut Workspace)) {
        let pool = || self.workspaces.lock().unwrap_or_else(PoisonError::into_inner);
        let mut workspace = pool().pop().unwrap_or_default();
        work(&mut workspace);
        pool().push(workspace);
    }

    /// Calls `work(workspace, batches, owns)` on each of the threads of the current pool that are worth while.
    pub(super) fn share_out(
        &self,
        mesh: &Mesh,
        share: Option<&Share>,
        work: impl Fn(&mut Workspace, &[Duty], &dyn Fn(u32) -> bool) + Sync,
    ) {
        let shares = self.shares(mesh, share, &mut self.kept(share).lock().unwrap_or_else(PoisonError::into_inner));
        let one = |me: usize| {
            self.with_workspace(|workspace| {
                work(workspace, &shares.duties[me], &|dof| usize::from(shares.owner[dof as usize]) == me);
            });
        };
        match shares.duties.len() {
            1 => one(0),
            n => (0..n).into_par_iter().with_max_len(1).for_each(one),
        }
    }
}
