//! What the rates where time starts do along a direction.

use wfl::Diagnostic;
use wfl_discrete::window::Window;
use wfl_problem::node_positions;
use wfl_run::{As, prescribed_differences};

use super::{Forwards, Moving};
use crate::beginning::{AtStart, Beginning, parted};

impl Forwards<'_, '_> {
    /// Moves the rates where time starts: first rates that are given, those of prescribed values, and the highest ones, which
    /// the equations give.
    pub(super) fn beginning(&mut self, beginning: &Beginning, one: &mut Moving) -> Result<(), Box<Diagnostic>> {
        let step = &*self.standing.steps.step(0)?;
        let n_dofs = one.before.u.len();
        let mut moved = AtStart { first: vec![0.0; n_dofs], second: vec![0.0; n_dofs] };
        for (field, formula) in &self.formulas.rates {
            let system = &self.standing.solving.system;
            let Some(range) = system.range(*field) else { continue };
            let at = Window::instant(step.window.end);
            let rates = formula.moved(self.extended, (&node_positions(system, *field), at), &one.live)?;
            if !rates.is_empty() {
                moved.first[range].copy_from_slice(&rates);
            }
        }
        let mut prescribed = AtStart { first: vec![0.0; n_dofs], second: vec![0.0; n_dofs] };
        for (window, of_first, of_second) in prescribed_differences(step.window) {
            let mut values = vec![0.0; n_dofs];
            self.prescribed(window, &one.live, &mut values)?;
            prescribed.first.iter_mut().zip(&values).for_each(|(r, x)| *r += of_first * x);
            prescribed.second.iter_mut().zip(&values).for_each(|(s, x)| *s += of_second * x);
        }
        let numbering = &self.standing.solving.system.numbering;
        for (rates, prescribed) in [(&mut moved.first, prescribed.first), (&mut moved.second, prescribed.second)] {
            let [mut fixed, _] = parted(numbering, &prescribed);
            numbering.frames.turn_back(&mut fixed);
            let [_, free] = parted(numbering, rates);
            *rates = fixed.iter().zip(&free).map(|(a, b)| a + b).collect();
        }
        let rates = step.rates.as_ref().expect("a scene with rates");
        if let Some(explicit) = self.standing.solving.explicit.clone() {
            one.before.kept = beginning.kept(rates, &moved);
            one.end = one.before.clone();
            return self.explicit_start(&explicit, one);
        }
        // at free dofs the equations give the highest ones
        let [_, free] = parted(numbering, &beginning.of_highest(&moved));
        beginning.each_highest(&mut moved, |d, rate| *rate -= free[d]);
        one.end = one.before.clone();
        one.rates = Some(rates.with_behind(&rates.along(&beginning.kept(rates, &moved)), self.extended.n));
        let forces: Vec<f64> = self.residual(step, one)?.iter().map(|x| -x).collect();
        let highest = beginning.highest(&self.standing.solving.system.numbering, &forces, As::Written)?;
        beginning.each_highest(&mut moved, |d, rate| *rate += highest[d]);
        one.before.kept = beginning.kept(rates, &moved);
        Ok(())
    }
}
