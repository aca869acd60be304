//! Where the tangent of a term goes in a matrix.

use std::sync::Arc;

use super::{AssembledTerm, work::Located};
use crate::{assemble::scatter::Scatter, share::Share};
use wfl_sparse::csr::Pattern;

impl AssembledTerm {
    /// Looks up where each local pair stands in a matrix; `free` maps a dof to its row, or to nothing when fixed.
    pub fn locate(&mut self, pattern: &Arc<Pattern>, free: &[u32]) {
        self.locate_own(pattern, free, None);
    }

    /// The same in a matrix that has the rows of one rank alone; [`Self::add_tangent`] then adds to these, and is made by
    /// all ranks together.
    pub fn locate_own(&mut self, pattern: &Arc<Pattern>, free: &[u32], share: Option<&Arc<Share>>) {
        self.forget();
        self.locate_together(pattern, free, share);
    }

    /// The same for all copies of a term that has no places yet.
    pub(crate) fn locate_together(&self, pattern: &Arc<Pattern>, free: &[u32], share: Option<&Arc<Share>>) {
        let located = || Arc::new(Located { pattern: pattern.clone(), rows: free.to_vec(), share: share.cloned() });
        let located = self.located.get_or_init(located);
        if self.moving.is_none() {
            self.scatters.get_or_init(|| self.places_in(located, None).scatters);
        }
    }

    /// By group where its tangent goes; it has been located.
    pub(super) fn scatters(&self) -> &[Scatter] {
        self.scatters.get().expect("places before the tangent")
    }

    /// Forgets what [`Self::locate`] found: for terms that are assembled once.
    pub fn forget(&mut self) {
        self.scatters = Arc::default();
        self.located = Arc::default();
        self.forget_images();
        self.forget_places();
    }
}
