//! What the runs of a sweep are compared with, and the errors that follow.
//!
//! Three kinds: an exact solution that the scene defines (`def exact`, `def exact_NAME`), a finer run, made of another
//! method where the sweep has several scenes, or a file that an earlier sweep left. The reference has an error of its
//! own: a run on a mesh twice as coarse, and one four times, give it by Richardson's extrapolation. Errors are
//! relative, in norms over the points of the reference: `L2` and `H1` of the unknowns on cells, the outputs that live
//! on contact faces (traction, slip, …) by name, measures of the last step by name.

use std::path::Path;

use serde::{Deserialize, Serialize};
use wfl_adapt::{
    compare::{Compared, NORM_DEGREE, Solved, differences, measures, sampled},
    knobs::{Setting, number},
};
use wfl_compiler::backend::KernelBackend;
use wfl_host::input::InputKind;
use wfl_output::{Hash, OutputDir};
use wfl_problem::{SampleAt, Samples};

use super::{problem, table::write_text};
use crate::{
    bench::{Bench, Known, Status},
    exact,
    folder::told_later,
    scene_file::read_text,
    setting_text,
};

/// A solution to compare with.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Reference {
    /// What it is, in words.
    pub(super) what: String,
    /// What it follows from: what its run read, or the file it comes from.
    #[serde(default)]
    pub(super) identity: Hash,
    /// The parameters that make its problem.
    #[serde(default)]
    pub(super) problem: Vec<(String, Vec<f64>)>,
    /// Fields and outputs at points; empty for an exact solution.
    pub(super) samples: Vec<Samples>,
    /// Measures of the last step.
    pub(super) measures: Vec<(String, f64)>,
    /// Its own error by quantity, relative, estimated.
    pub(super) own: Vec<(String, f64)>,
    /// The exact solution is in the scene.
    pub(super) exact: bool,
    /// In a file: the hash of all the rest.
    #[serde(default)]
    pub(super) check: Hash,
}

impl Reference {
    /// The errors of a run, by quantity.
    pub(super) fn errors(&self, run: &Solved, backend: &dyn KernelBackend) -> Result<Vec<(String, f64)>, String> {
        if self.exact {
            return exact::errors(run, backend);
        }
        let of_run = |name: &str| run.scene.params.iter().find(|(own, _)| own == name).map(|(_, c)| &c.values);
        let other = self.problem.iter().find(|(name, values)| of_run(name).is_some_and(|own| own != values));
        if let Some((name, values)) = other {
            let told = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
            let own = told(of_run(name).map_or(&[], Vec::as_slice));
            return Err(format!("the reference ({}) has {name} = {}, and this run {own}", self.what, told(values)));
        }
        let samples = sampled(run, backend, SampleAt::Points(&self.samples))?;
        Ok(differences(Compared { samples: &samples, measures: &measures(run) }, self.compared()))
    }

    fn compared(&self) -> Compared<'_> {
        Compared { samples: &self.samples, measures: &self.measures }
    }

    /// Its own error of a quantity, if it is known.
    pub(super) fn own_error(&self, name: &str) -> Option<f64> {
        self.own.iter().find(|o| o.0 == name).map(|o| o.1)
    }
}

/// Reads a reference that an earlier sweep left. A number in it that was changed is noticed.
pub(super) fn from_file(path: &Path) -> Result<Reference, String> {
    let text = read_text(path, InputKind::Results).map_err(|why| format!("cannot read {}: {why}", path.display()))?;
    let mut found: Reference = serde_json::from_str(&text).map_err(|e| {
        format!("{} is no reference of a sweep: {e}\n  = help: a sweep leaves reference_1.json", path.display())
    })?;
    let check = std::mem::take(&mut found.check);
    if json(&found).map(|text| Hash::of(text.as_bytes())) == Ok(check) {
        return Ok(found);
    }
    let help = "take another one, or --reference auto, which makes it anew";
    Err(format!("{} is not what a sweep of this version wrote\n  = help: {help}", path.display()))
}

/// Keeps a reference for another sweep, or for the rest of this one.
pub(super) fn to_file(reference: &Reference, dir: &OutputDir, name: &str) -> Result<(), String> {
    let check = Hash::of(json(reference)?.as_bytes());
    let text = json(&Reference { check, ..reference.clone() })?;
    write_text(dir, name, &text).map_err(|e| told_later(&e))
}

fn json(reference: &Reference) -> Result<String, String> {
    serde_json::to_string(reference).map_err(|e| format!("the reference cannot be kept: {e}"))
}

/// Solves a scene for reference and estimates its own error.
pub(super) fn finer(bench: &Bench<'_>, path: &Path, known: &Known, setting: &Setting) -> Result<Reference, String> {
    let mut levels = Vec::new();
    for coarsen in [1.0, 0.5, 0.25] {
        let mut one = setting.to_vec();
        if coarsen < 1.0 {
            let refine = one.iter().position(|k| k.0 == "refine");
            let before = refine.map_or(Some(1.0), |k| number(&one[k].1)).unwrap_or(1.0);
            one.retain(|k| k.0 != "refine");
            one.push(("refine".to_owned(), (before * coarsen).to_string()));
        }
        let shown = format!("{} {}", path.display(), setting_text(&one));
        bench.listener.progress(&format!("reference: {shown}"));
        let run = bench.run(path, known, &one, "");
        match (run.status, run.solved) {
            (Status::Ok, Some(solved)) => levels.push(solved),
            (Status::Failed(why) | Status::NotConverged(why), _) if levels.is_empty() => {
                return Err(format!("the reference {shown} has no solution: {why}"));
            }
            // a coarse level that does not exist leaves the error unknown, or known with less certainty
            _ => break,
        }
    }
    let first = &levels[0];
    let mut reference = Reference {
        what: format!("{} {}", path.display(), setting_text(setting)),
        identity: known.identity.hash(),
        problem: problem::values(known, &first.scene),
        samples: sampled(first, bench.backend, SampleAt::Own(NORM_DEGREE))?,
        measures: measures(first),
        ..Reference::default()
    };
    let mut steps: Vec<Vec<(String, f64)>> = Vec::new();
    for pair in levels.windows(2) {
        let at = |run: &Solved| sampled(run, bench.backend, SampleAt::Points(&reference.samples));
        let coarse = Compared { samples: &at(&pair[1])?, measures: &measures(&pair[1]) };
        steps.push(differences(coarse, Compared { samples: &at(&pair[0])?, measures: &measures(&pair[0]) }));
    }
    reference.own = richardson(&steps);
    Ok(reference)
}

/// The error of the finest of meshes h, 2h, 4h from their differences: d/(q - 1), where q is the ratio of two
/// differences in a row, at least the root of 2 (a singular solution) and at most 8; 2 where there is only one.
fn richardson(steps: &[Vec<(String, f64)>]) -> Vec<(String, f64)> {
    let Some(fine) = steps.first() else { return Vec::new() };
    let estimate = |(name, d): &(String, f64)| {
        let coarse = steps.get(1).and_then(|s| s.iter().find(|c| c.0 == *name)).map(|c| c.1);
        let ratio = coarse.map_or(2.0, |c| if *d > 0.0 { (c / d).clamp(std::f64::consts::SQRT_2, 8.0) } else { 2.0 });
        (name.clone(), d / (ratio - 1.0))
    };
    fine.iter().map(estimate).collect()
}

/// References of different methods tell each other's error, where they have the same points: the distance between them
/// is the least that each may be wrong by.
pub(super) fn compare(one: &mut Reference, other: &mut Reference) {
    let positions = |r: &Reference| r.samples.iter().map(|s| s.positions.clone()).collect::<Vec<_>>();
    if positions(one) != positions(other) {
        return;
    }
    let apart = differences(one.compared(), other.compared());
    for reference in [one, other] {
        for (name, own) in &mut reference.own {
            let distance = apart.iter().find(|a| a.0 == *name).map_or(0.0, |a| a.1);
            *own = own.max(distance);
        }
    }
}

/// The unknowns of a scene have at most this degree.
pub(super) fn largest_degree(known: &Known) -> usize {
    known.scene.system.fields.iter().map(wfl_discrete::field::Field::degree).max().unwrap_or(1)
}
