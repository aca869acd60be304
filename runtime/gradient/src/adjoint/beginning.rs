//! What results follow of the rates where time starts.

use wfl::Diagnostic;
use wfl_discrete::window::Window;
use wfl_problem::node_positions;
use wfl_run::{As, prescribed_differences};

use super::{Backwards, Cotangent, Of, Read, Sums, add};
use crate::{
    beginning::{AtStart, Beginning, parted},
    refused::not_made,
    standing::AGREEMENT,
};

impl Backwards<'_, '_> {
    /// Moves what a result follows of the rates where time starts to the first values, to the first rates that are given and
    /// prescribed, and to the parameters of the equations that give the highest ones.
    pub(super) fn of_beginning(
        &mut self,
        beginning: &Beginning,
        start: &mut Cotangent,
        sum: &mut Sums,
    ) -> Result<(), Box<Diagnostic>> {
        let step = &*self.standing.steps.step(0)?;
        let n_dofs = start.u.len();
        if let Some(explicit) = self.standing.solving.explicit.clone() {
            self.of_explicit_start(&explicit, start, sum)?;
            return self.of_given_rates(&beginning.of_kept(&start.kept, n_dofs), sum);
        }
        let mut rates = beginning.of_kept(&start.kept, n_dofs);
        let highest = beginning.of_highest(&rates);
        let numbering = &self.standing.solving.system.numbering;
        let adjoint = beginning.highest(numbering, &highest, As::Transposed)?;
        let weights = self.by_test_field(&adjoint);
        self.evaluate(|of| matches!(of, Of::Term(_)), &step.u, &weights)?;
        let (mut now, mut past) = (self.nothing(), self.nothing());
        self.spread(-1.0, Read::ByEquations, &mut now, &mut past, &mut sum.live);
        // nothing lies between both
        for moved in [&now, &past] {
            add(&mut start.u, &moved.u);
            start.known.iter_mut().zip(&moved.known).for_each(|(to, from)| add(to, from));
        }
        let of_equations = beginning.of_kept(&past.kept, n_dofs);
        add(&mut rates.first, &of_equations.first);
        add(&mut rates.second, &of_equations.second);
        let numbering = &self.standing.solving.system.numbering;
        let [_, left] = parted(numbering, &beginning.of_highest(&rates));
        let largest = |v: &[f64]| v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        if largest(&left) > AGREEMENT * largest(&highest) {
            let apart = largest(&left) / largest(&highest);
            return Err(not_made(&format!("where time starts mass and derivatives of the laws differ by {apart:.1e}")));
        }
        // at free dofs the equations give them, whatever they were
        beginning.each_highest(&mut rates, |d, rate| *rate -= left[d]);
        self.of_given_rates(&rates, sum)
    }

    /// First rates that are given, and both of prescribed values.
    fn of_given_rates(&self, rates: &AtStart, sum: &mut Sums) -> Result<(), Box<Diagnostic>> {
        let step = &*self.standing.steps.step(0)?;
        let numbering = &self.standing.solving.system.numbering;
        let [first_fixed, first] = parted(numbering, &rates.first);
        let [second_fixed, _] = parted(numbering, &rates.second);
        for (window, of_first, of_second) in prescribed_differences(step.window) {
            let of = first_fixed.iter().zip(&second_fixed);
            let functional: Vec<f64> = of.map(|(r, s)| of_first * r + of_second * s).collect();
            self.of_prescribed(window, &functional, sum)?;
        }
        let system = &self.standing.solving.system;
        for (field, formula) in &self.formulas.rates {
            let Some(range) = system.range(*field) else { continue };
            let at = Window::instant(step.window.end);
            formula.add(self.extended, (&node_positions(system, *field), at), &first[range], &mut sum.live)?;
        }
        Ok(())
    }
}
