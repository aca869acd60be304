//! The result of a search for a demanded accuracy: the record of the selected run, and the reasons in words.

use super::{
    AccuracyRecord, Found, Other, Out, Role, Trials,
    estimate::{Norm, Step},
    seek::{Search, TOLERANCES, View},
};
use crate::output::Real;

impl<T: Trials> Search<'_, T> {
    /// The error of the mesh of a level of a view, safety included.
    pub(super) fn found(mut self, sequence: usize, level: usize, views: &[View]) -> Result<Found<T::Run>, Out> {
        let view = &views[sequence];
        for (l, v) in self.sequences.iter().zip(views) {
            for (one, error) in l.levels.iter().zip(&v.errors) {
                for trial in self.trial_runs.iter_mut().filter(|r| r.setting == one.setting) {
                    trial.error = Real(v.safety * error);
                }
            }
        }
        let mesh = view.safety * view.errors[level];
        let others = self.others(sequence, level, view);
        let why = self.why(sequence, level, views);
        let one = self.sequences[sequence].levels.swap_remove(level);
        let mut record = self.record(one.setting, why);
        record.mesh = Real(mesh);
        record.order = Real(view.order);
        record.estimate = Real(mesh + self.other());
        record.reached = mesh + self.other() <= self.demand.error;
        record.others = others;
        Ok(Found { run: one.run, record, notice: None })
    }

    pub(super) fn record(&mut self, picked: Vec<(String, String)>, why: Vec<String>) -> AccuracyRecord {
        AccuracyRecord {
            asked: self.demand.error,
            quantity: self.demand.quantity.clone(),
            picked,
            why,
            mesh: Real(f64::NAN),
            order: Real(f64::NAN),
            tolerance: Real(self.tolerance_error),
            method: Real(self.method_error),
            estimate: Real(f64::NAN),
            reached: false,
            trial_runs: std::mem::take(&mut self.trial_runs),
            others: Vec::new(),
        }
    }

    /// Errors of the other quantities with the same order.
    fn others(&mut self, sequence: usize, level: usize, view: &View) -> Vec<Other> {
        let levels = &self.sequences[sequence].levels;
        let Some(below) = self.below(sequence, level) else { return Vec::new() };
        let (coarse, fine) = (&levels[below], &levels[level]);
        let (from, to) = (coarse.fineness as f64, fine.fineness as f64);
        let list = self.trials.distances(&coarse.run, &fine.run);
        let step = |distance| Step { from, to, distance };
        let error = |distance: f64| view.safety * Norm::Lengths.error_behind(step(distance), view.order.min(1.0));
        list.into_iter()
            .filter(|(quantity, _)| *quantity != self.demand.quantity)
            .map(|(quantity, d)| Other { quantity, error: Real(error(d)) })
            .collect()
    }

    fn why(&self, sequence: usize, level: usize, views: &[View]) -> Vec<String> {
        let mut why = Vec::new();
        let (own, view) = (&self.sequences[sequence], &views[sequence]);
        let n = own.levels.len();
        why.push(format!(
            "mesh: on {n} meshes of degree {} the error falls with order {:.2}; the estimated error of the selected mesh is {:.1e}",
            own.degree,
            view.order,
            view.safety * view.errors[level]
        ));
        for (other, v) in self.sequences.iter().zip(views).filter(|(l, _)| l.degree != own.degree) {
            let Some((l, e)) = other.levels.last().zip(v.errors.last()).filter(|(_, e)| e.is_finite()) else {
                let degree = other.degree;
                why.push(format!("degree {degree}: further runs would cost more than the setting picked"));
                continue;
            };
            let dofs = self.trials.cost(&l.run).dofs;
            why.push(format!(
                "degree {}: its finest mesh has {dofs} unknowns and an error of {:.1e}; a finer one would cost more \
                 than degree {}",
                other.degree,
                v.safety * e,
                own.degree
            ));
        }
        why.extend(self.why_of_parameters());
        why
    }

    pub(super) fn why_of_parameters(&self) -> Vec<String> {
        let tol = format!(
            "tol: {:.0e} adds an error of {:.0e}, measured on a coarse mesh against {:.0e}",
            self.tolerance,
            self.tolerance_error,
            TOLERANCES.start()
        );
        let name = &self.ways.parameter;
        let method = match self.ways.role {
            Role::None => None,
            Role::Consistent => {
                Some(format!("{name}: the method is consistent; its parameter scales with the cell size"))
            }
            Role::Penalty => Some(format!(
                "{name}: a penalty; {} times that of the scene adds an error of {:.0e}, measured on a coarse mesh against a ten times larger one",
                self.stiffer, self.method_error
            )),
        };
        std::iter::once(tol).chain(method).collect()
    }
}
