//! What the kinks of a term say of contact: open, slipping, sticking. Reads branches that a residual has counted.

use wfl_compiler::{Kink, KinkKind};

use super::AssembledTerm;
use crate::assemble::branches::BranchCounts;

impl AssembledTerm {
    /// The friction kink if there is one, else the first selection that is a multiple of a positive part, else the first one.
    pub(super) fn contact_kink(&self) -> Option<usize> {
        let first = |is: &dyn Fn(&Kink) -> bool| self.law.kinks.iter().position(is);
        first(&|k| k.kind == KinkKind::Ball).or_else(|| first(&|k| k.active.is_some())).or_else(|| first(&|_| true))
    }

    /// Whether the term has a friction kink.
    #[must_use]
    pub fn has_friction(&self) -> bool {
        self.law.kinks.iter().any(|k| k.kind == KinkKind::Ball)
    }

    /// Points open, slipping, sticking from points by code of the contact kink.
    fn by_state<T: Copy + Default + std::ops::Add<Output = T>>(&self, codes: [T; 3]) -> [T; 3] {
        let [zero, one, two] = codes;
        match self.contact_kink().map(|k| &self.law.kinks[k]) {
            Some(kink) if kink.kind == KinkKind::Ball => codes,
            Some(Kink { active: Some(0), .. }) => [one, T::default(), zero + two],
            _ => [zero, T::default(), one + two],
        }
    }

    /// Points open, slipping, sticking at the friction kink; without friction open and in contact (counted as stick).
    /// `branches` are those of a residual of this term.
    #[must_use]
    pub fn contact_counts(&self, branches: &BranchCounts) -> Option<[usize; 3]> {
        Some(self.by_state(*branches.kinks.get(self.contact_kink()?)?))
    }

    /// By entity of the region: the state of most of its points, 0 open, 1 slip, 2 stick (or contact); `None` without
    /// a kink. Of a tie the higher one. `branches` are those of a residual of this term.
    #[must_use]
    pub fn contact_states(&self, branches: &BranchCounts) -> Option<Vec<f64>> {
        self.contact_kink()?;
        let state = |packed: &u64| {
            let [zero, one, two] = self.by_state([0, 16, 32].map(|shift| (packed >> shift) & 0xffff));
            // a face without points touches nothing
            if two > 0 && two >= one && two >= zero {
                2.0
            } else if one > 0 && one >= zero {
                1.0
            } else {
                0.0
            }
        };
        Some(branches.by_entity.iter().map(state).collect())
    }
}
