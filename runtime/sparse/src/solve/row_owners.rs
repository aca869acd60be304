//! Who owns which rows where several ranks solve one system.

use std::sync::Arc;

use wfl_host::{halo::Halo, team::Team};

/// Which rank has which rows of the matrices of a scene. Vectors of unknowns have copies of what other ranks own, vectors
/// of equations the rows of their rank and zeros elsewhere.
#[derive(Clone, Debug)]
pub struct RowOwners {
    /// The ranks.
    pub team: Arc<dyn Team>,
    /// By row.
    pub of_row: Vec<u16>,
    /// Which rows are copies, and of whom.
    pub halo: Halo,
    /// By row what all ranks call it, where each has a part of them alone; `None` where all have all of them.
    pub numbers: Option<Vec<u64>>,
}

impl RowOwners {
    /// Whether this rank has a row.
    #[must_use]
    pub fn owns(&self, row: usize) -> bool {
        usize::from(self.of_row[row]) == self.team.rank()
    }

    /// Whether every rank has a place for all rows.
    #[must_use]
    pub fn are_whole(&self) -> bool {
        self.numbers.is_none()
    }

    /// What all ranks call a row.
    #[must_use]
    pub fn number(&self, row: usize) -> u64 {
        self.numbers.as_ref().map_or(row as u64, |numbers| numbers[row])
    }

    /// Gives copies the numbers of their owners.
    pub fn update(&self, values: &mut [f64]) {
        self.halo.update(&*self.team, values);
    }
}
