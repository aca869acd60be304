//! What a run measures and prints at the end of a step. Does not judge it: what is not finite is kept and told later.

use super::{Progress, Run};
use crate::{
    finite::{BadMeasure, BadOutput},
    scene::Scene,
};

impl Run {
    /// The measures of the scene by name, and those that are not finite with the place.
    pub(super) fn measures(
        &self,
        scene: &mut Scene,
        time: f64,
        increment: f64,
    ) -> (Vec<(String, f64)>, Vec<BadMeasure>) {
        let Scene { system, measures: asked, .. } = scene;
        let u = &self.u;
        let (mut measures, mut bad_measures) = (Vec::with_capacity(asked.len()), Vec::new());
        for measure in asked {
            let value = measure.evaluate(system, time, increment, u);
            if !value.is_finite() {
                bad_measures.push(measure.bad(value, system, u));
            }
            measures.push((measure.name.clone(), value));
        }
        (measures, bad_measures)
    }

    /// What terms print at their points.
    pub(super) fn print(&mut self, scene: &mut Scene, time: f64, increment: f64, progress: &mut dyn Progress) {
        let Scene { system, prints, .. } = scene;
        let u = &self.u;
        let mut bad_prints = Vec::new();
        for print in prints {
            let (term, origin) = (print.term.clone(), print.origin);
            let mut bad = None;
            print.for_each(system, time, increment, u, |x, value| {
                bad = bad.or_else(|| value.iter().find(|v| !v.is_finite()).map(|v| (*v, x)));
                progress.printed(&term, origin, x, value);
            });
            if let Some((value, position)) = bad {
                bad_prints.push(BadOutput { what: format!("`Print` in `{term}`"), time, value, position });
            }
        }
        bad_prints.into_iter().for_each(|bad| self.add_bad(bad));
    }
}
