//! What the kinks of a term say of contact: open, slipping, sticking. Reads branches that a residual has counted.

use wfl_compiler::KinkKind;

use super::AssembledTerm;
use crate::assemble::branches::BranchCounts;

impl AssembledTerm {
    /// The friction kink if there is one, else the first selection.
    pub(super) fn contact_kink(&self) -> Option<usize> {
        let ball = self.law.kinks.iter().position(|k| k.kind == KinkKind::Ball);
        ball.or(if self.law.kinks.is_empty() { None } else { Some(0) })
    }

    fn has_friction(&self) -> bool {
        self.law.kinks.iter().any(|k| k.kind == KinkKind::Ball)
    }

    /// Points open, slipping, sticking at the friction kink; without friction open and in contact (counted as stick).
    /// `branches` are those of a residual of this term.
    #[must_use]
    pub fn contact_counts(&self, branches: &BranchCounts) -> Option<[usize; 3]> {
        let [zero, one, two] = *branches.kinks.get(self.contact_kink()?)?;
        Some(if self.has_friction() { [zero, one, two] } else { [zero, 0, one + two] })
    }

    /// By entity of the region: the state of most of its points, 0 open, 1 slip, 2 stick (or contact); `None` without
    /// a kink. Of a tie the higher one. `branches` are those of a residual of this term.
    #[must_use]
    pub fn contact_states(&self, branches: &BranchCounts) -> Option<Vec<f64>> {
        self.contact_kink()?;
        let friction = self.has_friction();
        let state = |packed: &u64| {
            let [zero, one, two] = [0, 16, 32].map(|shift| (packed >> shift) & 0xffff);
            let [zero, one, two] = if friction { [zero, one, two] } else { [zero, 0, one + two] };
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
