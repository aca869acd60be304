//! Bodies that fly on: what is out of balance beside their inertia.
//!
//! Promises: a state at which second rates vanish is not evaluated, only the product of the matrix of linear terms with the way there.

use super::{FIXED, System};
use crate::rates::Rates;

impl System {
    /// Whether unknowns have second rates in the step that was begun.
    #[must_use]
    pub fn has_flight(&self) -> bool {
        self.known.previous.is_some() && self.known.rates.as_ref().is_some_and(Rates::has_flight)
    }

    /// The residual `here` at `u`, by dof in local frames, beside what linear terms give on the way to where the free unknowns have no second rates:
    /// of a body in uniform flight nothing is left but what acts on it. `None` without second rates, and without a matrix.
    #[must_use]
    pub fn beside_flight(&self, u: &[f64], here: &[f64]) -> Option<Vec<f64>> {
        let (rates, past) = self.known.rates.as_ref().zip(self.known.previous.as_ref())?;
        let mut change = rates.to_flight(u, &past.unknowns)?;
        self.numbering.frames.turn(&mut change);
        let free = change.iter_mut().zip(&self.numbering.free);
        free.filter(|(_, free)| **free == FIXED).for_each(|(x, _)| *x = 0.0);
        self.numbering.frames.turn_back(&mut change);
        let mut to = u.to_vec();
        to.iter_mut().zip(&change).for_each(|(u, change)| *u += change);
        self.numbering.follow(&mut to);
        let change: Vec<f64> = to.iter().zip(u).map(|(to, u)| to - u).collect();
        let (mut part, mut sizes) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        let is_assembled = self.multiply_linear(&change, None, [&mut part, &mut sizes, &mut []]);
        if !self.team().any(is_assembled) {
            return None;
        }
        self.numbering.turn(&mut part);
        part.iter_mut().zip(here).for_each(|(part, here)| *part += here);
        Some(part)
    }
}
