//! What a search says of its result.

use wfl_output::{
    Real,
    record::{AccuracyRecord, Other},
};

use super::{End, Level, Planned, SAFETY, Search, TOLERANCES};
use crate::accuracy::{Found, Role, Short, Trials};

impl<T: Trials> Search<'_, T> {
    /// The result: a level with its run of the whole scene.
    pub(super) fn found_level(
        mut self,
        levels: &[Level<T::Run>],
        best: usize,
        run: T::Run,
        short: Option<Short>,
    ) -> Found<T::Run> {
        let level = &levels[best];
        let (setting, data) = (level.setting.clone(), level.data.error);
        let others = self.others(&level.run, &level.rich, level.factor);
        let end = End {
            setting,
            rounds: level.rounds.len(),
            apart: level.apart,
            error: level.estimate(),
            data,
            others,
            short,
        };
        self.found(levels, run, end)
    }

    /// The result on a mesh without a richer run of its own.
    pub(super) fn found_last(
        mut self,
        levels: &[Level<T::Run>],
        mesh: &Planned,
        run: T::Run,
        error: f64,
    ) -> Found<T::Run> {
        if let Some(trial) = self.trial_runs.last_mut() {
            trial.error = Real(error);
        }
        let others = levels.last().map_or_else(Vec::new, |judge| self.others(&run, &judge.rich, SAFETY));
        let setting = self.setting(mesh.degree, mesh.finer);
        let data = levels.last().map_or(0.0, |judge| judge.data.error);
        let (rounds, apart) = (mesh.rounds.len(), error / SAFETY);
        let end = End { setting, rounds, apart, error, data, others, short: None };
        self.found(levels, run, end)
    }

    /// The errors of the other quantities, from the distance to a richer run.
    fn others(&mut self, run: &T::Run, rich: &T::Run, factor: f64) -> Vec<Other> {
        let others = self.trials.distances(run, rich).into_iter();
        let others = others.filter(|(quantity, _)| *quantity != self.demand.quantity);
        others.map(|(quantity, d)| Other { quantity, error: Real(factor * d) }).collect()
    }

    fn found(mut self, levels: &[Level<T::Run>], run: T::Run, end: End) -> Found<T::Run> {
        let record = AccuracyRecord {
            asked: self.demand.error,
            quantity: self.demand.quantity.clone(),
            rounds: end.rounds as u64,
            cells: self.trials.mesh(&run).n_cells() as u64,
            why: self.why(levels, &run, &end),
            mesh: Real(end.error),
            order: Real(self.order_seen(levels, &run, &end)),
            tolerance: Real(self.tolerance_error),
            method: Real(self.method_error),
            data: Real(end.data),
            time: Real(self.time_error),
            geometry: Real(self.geometry_error),
            estimate: Real(end.error + self.other()),
            reached: end.short.is_none(),
            truth: None,
            picked: end.setting,
            trial_runs: std::mem::take(&mut self.trial_runs),
            others: end.others,
        };
        self.parts.retain(|(rounds, _)| *rounds <= end.rounds);
        Found { run, record, short: end.short, parts: self.parts.pop() }
    }

    /// The order in the number of unknowns to the power of one over the dimension, between the first level and the result.
    fn order_seen(&self, levels: &[Level<T::Run>], run: &T::Run, end: &End) -> f64 {
        let dofs = |run: &T::Run| self.trials.cost(run).dofs as f64;
        let Some(first) = levels.iter().find(|l| l.apart.is_finite() && dofs(&l.run) > 0.0) else { return f64::NAN };
        let sides = (dofs(run) / dofs(&first.run)).ln() / self.ways.dim as f64;
        if sides > 0.0 { (first.apart / end.apart).ln() / sides } else { f64::NAN }
    }

    fn why(&self, levels: &[Level<T::Run>], run: &T::Run, end: &End) -> Vec<String> {
        let mut why = Vec::new();
        let cells = |run: &T::Run| self.trials.mesh(run).n_cells();
        if let Some(first) = levels.first() {
            why.push(format!(
                "mesh: {} rounds of refinement where the error comes from, {} to {} cells of degree {}",
                end.rounds,
                cells(&first.run),
                cells(run),
                first.degree
            ));
        }
        let checks: Vec<String> = levels.iter().filter_map(|l| Some(format!("{:.2}", 1.0 / l.checked?))).collect();
        if !checks.is_empty() {
            why.push(format!("estimates over errors against the next mesh: {}", checks.join(", ")));
        }
        why.extend(self.why_of_parameters());
        why
    }

    fn why_of_parameters(&self) -> Vec<String> {
        let tol = format!(
            "tol: {:.0e} adds an error of {}, measured on the first mesh against {:.0e}",
            self.tolerance,
            one_digit(self.tolerance_error),
            TOLERANCES.start()
        );
        let name = &self.ways.parameter;
        let method = match self.ways.role {
            Role::None => None,
            Role::Consistent => {
                Some(format!("{name}: the method is consistent; its parameter scales with the cell size at contact"))
            }
            Role::Penalty => Some(format!(
                "{name}: a penalty; {} times that of the scene adds an error of {}, measured on the first mesh \
                 against a ten times larger one",
                self.stiffer,
                one_digit(self.method_error)
            )),
        };
        let steps = self.ways.divides_steps().then(|| {
            let error = one_digit(self.time_error);
            let each = if self.substeps > 1 {
                format!("each step in {} parts", self.substeps)
            } else {
                "steps as they are".to_owned()
            };
            format!("time: {each}, whose length adds an error of {error}, measured on the first mesh against halves")
        });
        std::iter::once(tol).chain(method).chain(steps).collect()
    }
}

/// An error to one digit; `0` where there is none.
fn one_digit(error: f64) -> String {
    if error == 0.0 { "0".to_owned() } else { format!("{error:.0e}") }
}
