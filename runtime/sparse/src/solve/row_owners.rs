//! Rows of one matrix on several ranks.

use std::sync::Arc;

use wfl_host::team::Team;

/// Which rank has which rows of the matrices of a scene.
#[derive(Clone, Debug)]
pub struct RowOwners {
    /// The ranks.
    pub team: Arc<dyn Team>,
    /// By row.
    pub of_row: Vec<u16>,
}

impl RowOwners {
    /// Whether this rank has a row.
    #[must_use]
    pub fn owns(&self, row: usize) -> bool {
        usize::from(self.of_row[row]) == self.team.rank()
    }

    /// Makes numbers by row whole, of which each rank has computed its own.
    pub fn gather(&self, values: &mut [f64]) {
        let others = (0..values.len()).filter(|row| !self.owns(*row));
        others.for_each(|row| values[row] = 0.0);
        self.team.sum(values);
    }
}
