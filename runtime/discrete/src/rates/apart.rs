//! A mass that stands beside the terms: nodes give theirs to others.
//!
//! The terms would bring the inertia of the nodes that have none any more, c (u - u_n) + history at each point, and a matrix beside them
//! would take it away again: what is left of the two is the rounding of u times c, which grows as 1/h^2, in equations that have
//! nothing else to hold it. So terms see no second rate while a step is solved, and the whole mass acts through its matrix.

use super::{RateFactors, Rates};

/// What terms do not see of the second rates of the step that was begun.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Apart {
    /// The scalar of their change; zero between steps.
    factor: f64,
    /// By field the histories of the step; empty between steps.
    histories: Vec<Vec<f64>>,
}

impl Rates {
    /// The mass of the equations stands beside the terms from now on.
    pub fn stand_apart(&mut self) {
        self.apart = Some(Apart { factor: 0.0, histories: Vec::new() });
    }

    /// What the change over the step that was begun is multiplied by in the second rates that terms do not see; zero where they
    /// see them.
    #[must_use]
    pub fn factor_apart(&self) -> f64 {
        self.apart.as_ref().map_or(0.0, |apart| apart.factor)
    }

    /// Whether terms see no second rates: while a step is solved whose mass stands beside them.
    #[must_use]
    pub fn are_apart(&self) -> bool {
        self.apart.as_ref().is_some_and(|apart| !apart.histories.is_empty())
    }

    /// Takes the second rates of the step that was begun from the terms.
    pub(super) fn set_apart(&mut self) {
        let Some(apart) = &mut self.apart else { return };
        apart.factor = std::mem::take(&mut self.factors.acceleration);
        let zeros = self.histories[1].iter().map(|history| vec![0.0; history.len()]).collect();
        apart.histories = std::mem::replace(&mut self.histories[1], zeros);
    }

    /// Gives them back: between two steps.
    pub(super) fn join(&mut self) {
        if let Some(apart) = &mut self.apart {
            (apart.factor, apart.histories) = (0.0, Vec::new());
        }
    }

    /// The matrices are those of the last step.
    pub(super) fn recall_apart(&mut self) {
        if let Some(apart) = &mut self.apart {
            apart.factor = std::mem::take(&mut self.factors.acceleration);
        }
    }

    /// Scalar and histories of the second rates.
    pub(super) fn of_second(&self) -> (f64, &[Vec<f64>]) {
        match &self.apart {
            Some(apart) if self.are_apart() => (apart.factor, &apart.histories),
            _ => (self.factors.acceleration, &self.histories[1]),
        }
    }

    /// The histories of an order, whether terms see them or not.
    pub(super) fn histories_of(&self, slot: usize) -> &[Vec<f64>] {
        if slot == 0 { &self.histories[0] } else { self.of_second().1 }
    }

    /// Those of both orders, to be changed.
    pub(super) fn all_histories_mut(&mut self) -> [&mut Vec<Vec<f64>>; 2] {
        let is_apart = self.are_apart();
        let [first, second] = &mut self.histories;
        match &mut self.apart {
            Some(apart) if is_apart => [first, &mut apart.histories],
            _ => [first, second],
        }
    }

    /// No change is multiplied by anything: rates are their histories.
    pub(super) fn hold_factors(&mut self) {
        self.factors = RateFactors::default();
        if let Some(apart) = &mut self.apart {
            apart.factor = 0.0;
        }
    }
}
