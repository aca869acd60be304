//! The search: solve, estimate, mark, refine, until the estimate meets the demand.
//!
//! On each mesh the scene is solved with elements of a degree and of the next one; their distance is the estimated error of
//! the first. That alone may be wrong: where the solution is even about the middle of each cell, the next degree finds
//! nothing, and a measure may meet its value by accident. So no estimate counts that another mesh has not confirmed: a
//! finer one checks the estimate of the one before, what it was too small by goes into the safety factor of the next, and
//! an estimate that fell faster than elements of its degree can is checked before it is believed. All cells are refined
//! first.

mod begin;
mod checks;
mod told;

use wfl_mesh::refine::Mark;
use wfl_output::{
    Real,
    record::{Other, Rounds, TrialRun},
};

use super::{
    Demand, Found, Indicator, Out, Short, Trials, Ways,
    marking::{also, everything, marked},
    outcome::{Extent, Guide, OfData},
    ways::Wanted,
};
use crate::knobs::Setting;

/// Estimates are taken larger by this factor: so that a run that just meets its estimate is not beyond the demand.
const SAFETY: f64 = 1.1;
/// An estimate may fall faster by this factor than its order says before it has to be checked: twice as fast
/// is an order more, as superconvergent measures have.
const FALL: f64 = 2.0;
/// Relative distances of solutions that differ by rounding alone: such solutions are exact.
const ROUNDING: f64 = 1e-11;
/// So many levels are checked with each new one: one may agree by accident, and a third lies so far back that its error says
/// nothing of the last.
const LAGS: usize = 2;
/// A check that says that estimates are too small by more than this factor says that they mean nothing yet: two levels of
/// first order lie so far apart.
const MOST_SAFETY: f64 = 4.0;
/// What the next mesh is planned for, in parts of what is allowed: planning for all of it would miss every second time,
/// by little.
const AIM: f64 = 0.8;
/// Least and largest part of the error that is marked at once: less would take many meshes, and more is uniform
/// refinement.
const PARTS: [f64; 2] = [0.2, 0.8];
/// The tolerance that is tried first, in parts of the demand, and the range it may have: what Newton leaves is at most as
/// large as its tolerance, which leaves nine tenths for the rest; beyond the range are rounding, and iterates that are none.
const FIRST_TOLERANCE: f64 = 1e-1;
pub(super) const TOLERANCES: std::ops::RangeInclusive<f64> = 1e-10..=1e-3;
/// The error of a richer run may be this part of the demand for that run to judge the next mesh: squares add up in a norm,
/// so that it adds 5 %.
const PART_OF_JUDGE: f64 = 0.3;
/// A measure may meet its value by accident, where errors of other signs cancel: its error is at least this part of what
/// the parts of all cells add up to without their signs. In smooth problems between a tenth and all of it is left.
const PART_OF_PARTS: f64 = 0.25;
/// What is not resolved of loads and coefficients may have this part of the demand before cells are refined for it: with less
/// it hardly changes the sum, and cells of the largest errors come first.
const PART_OF_DATA: f64 = 0.1;
/// Meshes without an estimate (a solution that is zero, an iteration that does not converge) before the search gives up: in
/// four halvings a body of one cell has come to sixteen across, where loads and contact are seen.
const BLIND: usize = 4;
/// Meshes in a row whose estimates may be no smaller than the best one: a dozen rounds divide the cells at
/// a corner to 1/4096 of their size.
const STALLED: usize = 12;

/// One mesh with its run.
struct Level<R> {
    setting: Vec<(String, String)>,
    fineness: usize,
    rounds: Rounds,
    run: R,
    rich: R,
    /// Distance of both; of a measure at least a part of what the parts of all cells add up to.
    apart: f64,
    /// What the error of the richer run may add to it, from its distance to that of the mesh before.
    of_rich: f64,
    /// Where that comes from, if it is known already.
    indicator: Option<Indicator>,
    /// What is not resolved of loads and coefficients.
    data: OfData,
    /// What the distance is multiplied with; infinite while it is not to be believed.
    factor: f64,
    /// What a finer level said of `apart`: the error over it.
    checked: Option<f64>,
    degree: usize,
    finer: f64,
    /// Why the whole scene has no solution on this mesh: it may have regions that need finer cells.
    unfit: Option<String>,
}

impl<R> Level<R> {
    fn estimate(&self) -> f64 {
        let apart = self.apart + self.of_rich;
        if self.factor.is_finite() { self.factor * apart + self.data.error } else { f64::INFINITY }
    }
}

/// A mesh that is to be run.
struct Planned {
    degree: usize,
    fineness: usize,
    rounds: Rounds,
    finer: f64,
    /// Whether the error on it should be as small as is demanded.
    enough: bool,
}

/// What the search ends with.
struct End {
    setting: Vec<(String, String)>,
    rounds: usize,
    /// Distance from a richer run, and the error that is told.
    apart: f64,
    error: f64,
    /// The part of it that is not resolved of loads and coefficients.
    data: f64,
    others: Vec<Other>,
    short: Option<Short>,
}

/// The error of a run over its distance from the run of the next degree, from what a finer mesh shows: the distance from the
/// richer run there is `seen` times as large, and that between its own two runs `fell` times.
///
/// Where both degrees converge alike (at a tip), the richer run has a part s of the error e, and the finer mesh has it too:
/// with distances (1 - s) e and (1 - s fell) e the error is (seen - fell)/(1 - fell) times the distance. `power` is 2
/// where distances are orthogonal to errors, as gradients are by Galerkin's method, so that squares add up.
fn error_over_distance(seen: f64, fell: f64, power: f64) -> Option<f64> {
    let [seen, fell] = [seen, fell].map(|x| x.powf(power));
    let limit = if seen <= 1.0 { 1.0 } else { (seen - fell) / (1.0 - fell) };
    (limit.is_finite() && limit > 0.0 && seen > 0.0).then(|| (limit * seen.min(1.0)).powf(1.0 / power))
}

/// Puts the estimate of a level beside its run.
fn tell_error<R>(trial_runs: &mut [TrialRun], level: &Level<R>) {
    let n_rounds = level.rounds.len();
    if let Some(trial) = trial_runs.iter_mut().find(|t| t.setting == level.setting && t.rounds == n_rounds as u64) {
        trial.error = Real(level.estimate());
    }
}

/// Finds a cheap setting and mesh of a scene that meets a demand, and runs it.
///
/// # Errors
/// [`Out`] where not even the first mesh has a solution.
pub fn seek<T: Trials>(trials: &mut T, ways: &Ways, demand: &Demand) -> Result<Found<T::Run>, Out> {
    let mut search = Search {
        trials,
        ways,
        demand,
        fineness: ways.own,
        tolerance: (FIRST_TOLERANCE * demand.error).clamp(*TOLERANCES.start(), *TOLERANCES.end()),
        stiffer: 1.0,
        tolerance_error: 0.0,
        method_error: 0.0,
        time_error: 0.0,
        geometry_error: 0.0,
        substeps: 1,
        trial_runs: Vec::new(),
        first: Vec::new(),
        first_fineness: ways.own,
        size: None,
        guide: Guide::Quantity,
        blind: String::new(),
        parts: Vec::new(),
    };
    search.begin()?;
    search.refine_to_demand()
}

struct Search<'a, T: Trials> {
    trials: &'a mut T,
    ways: &'a Ways,
    demand: &'a Demand,
    /// Of the first mesh.
    fineness: usize,
    tolerance: f64,
    stiffer: f64,
    tolerance_error: f64,
    method_error: f64,
    time_error: f64,
    geometry_error: f64,
    /// Parts of each step.
    substeps: usize,
    trial_runs: Vec<TrialRun>,
    /// Runs on the first mesh by degree, until they are taken.
    first: Vec<(usize, T::Run)>,
    first_fineness: usize,
    /// What the parts of the last mesh added up to, of a measure, and what marks follow.
    size: Option<f64>,
    guide: Guide,
    /// Why the last level without an estimate has none.
    blind: String,
    /// The parts of the error by cell, for meshes of so many rounds.
    parts: Vec<(usize, Vec<f64>)>,
}

impl<T: Trials> Search<'_, T> {
    fn setting(&self, degree: usize, finer: f64) -> Vec<(String, String)> {
        self.ways.setting(self.wanted(degree, finer))
    }

    /// What the error of that one is estimated with.
    fn richer_setting(&self, degree: usize, finer: f64) -> Vec<(String, String)> {
        self.ways.setting(Wanted { richer: true, ..self.wanted(degree, finer) })
    }

    fn wanted(&self, degree: usize, finer: f64) -> Wanted {
        let Search { fineness, tolerance, stiffer, substeps, .. } = *self;
        Wanted { degree, fineness, finer, tolerance, stiffer, substeps, richer: false }
    }

    fn one(&mut self, setting: &Setting, rounds: &Rounds, extent: Extent) -> Result<T::Run, String> {
        let run = self.trials.run(setting, self.fineness, rounds, extent)?;
        Ok(self.noted(setting, rounds, run))
    }

    /// Puts a run into the list.
    fn noted(&mut self, setting: &Setting, rounds: &Rounds, run: T::Run) -> T::Run {
        let cost = self.trials.cost(&run);
        self.trial_runs.push(TrialRun {
            setting: setting.to_vec(),
            rounds: rounds.len() as u64,
            cells: self.trials.mesh(&run).n_cells() as u64,
            dofs: cost.dofs,
            seconds: cost.seconds,
            error: Real(f64::NAN),
        });
        run
    }

    /// What tolerance, method, steps and the boundary add.
    fn other(&self) -> f64 {
        self.tolerance_error + self.method_error + self.time_error + self.geometry_error
    }

    /// The order in the cell size by which an error falls on meshes that are refined where it comes from.
    fn order(&self, degree: usize) -> usize {
        match self.demand.quantity.as_str() {
            "H1" => degree,
            "L2" => degree + 1,
            _ if self.is_norm() => degree,
            _ => 2 * degree,
        }
    }

    /// Whether the parts of an indicator sum up to the square of the error, or to the error itself.
    fn is_norm(&self) -> bool {
        !self.ways.measures.contains(&self.demand.quantity)
    }

    /// The run of a degree, where it is not there yet, and of the next one on a mesh.
    fn level(&mut self, mesh: Planned, made: Option<T::Run>) -> Result<Level<T::Run>, String> {
        let Planned { degree, fineness, rounds, finer, .. } = mesh;
        self.fineness = fineness;
        let setting = self.setting(degree, finer);
        let first = if rounds.is_empty() { self.first.iter().position(|f| f.0 == degree) } else { None };
        let first = first.filter(|_| fineness == self.first_fineness).map(|at| self.first.swap_remove(at).1);
        let mut run = match made.or(first) {
            Some(run) => run,
            None => self.one(&setting, &rounds, Extent::Solution)?,
        };
        let richer = self.richer_setting(degree, finer);
        let rich = self.trials.rich(&mut run, &richer, fineness, &rounds)?;
        let rich = self.noted(&richer, &rounds, rich);
        let data = self.trials.data(&rich);
        let mut apart = self.trials.distance(&run, &rich).unwrap_or_else(|why| {
            self.blind = why;
            f64::INFINITY
        });
        let mut indicator = None;
        if apart.is_finite() && !self.is_norm() {
            let found = self.trials.indicator(&run, &rich, Guide::Quantity)?;
            let size = found.size.unwrap_or(0.0);
            apart = apart.max(PART_OF_PARTS * size);
            // parts that grow cancel each other: the adjoint solution of a flux through a boundary with given values is no
            // function, and to follow its parts would refine there for ever. Parts of scenes with kinks may grow until the
            // active set is resolved.
            if !self.ways.kinked && self.size.is_some_and(|before| size > before) {
                self.guide = Guide::Gradients;
            }
            self.size = Some(size);
            indicator = (self.guide == Guide::Quantity).then_some(found);
        }
        Ok(Level {
            setting,
            fineness,
            rounds,
            run,
            rich,
            apart,
            of_rich: 0.0,
            indicator,
            data,
            factor: f64::INFINITY,
            checked: None,
            degree,
            finer,
            unfit: None,
        })
    }

    fn refine_to_demand(mut self) -> Result<Found<T::Run>, Out> {
        let degree = self.choose_degree();
        let allowed = self.demand.error - self.other();
        let mut levels = self.first_levels(degree).map_err(Out::Failed)?;
        self.first.clear();
        loop {
            // the first that is good enough is the cheapest
            if let Some(good) = levels.iter().position(|l| l.unfit.is_none() && l.estimate() <= allowed) {
                self.fineness = levels[good].fineness;
                match self.one(&levels[good].setting, &levels[good].rounds, Extent::WholeScene) {
                    Ok(run) => return Ok(self.found_level(&levels, good, run, None)),
                    Err(why) => levels[good].unfit = Some(why),
                }
                continue;
            }
            if let Some(short) = self.stop(&levels) {
                return self.best(levels, short);
            }
            let mesh = match self.next(&levels, allowed) {
                Ok(mesh) => mesh,
                Err(why) => return self.best(levels, Short::Failed(why)),
            };
            self.fineness = mesh.fineness;
            let (made, unfit) = match self.last(&levels, &mesh, allowed) {
                Some(Ok((run, error))) if error <= allowed => return Ok(self.found_last(&levels, &mesh, run, error)),
                Some(Ok((run, _))) => (Some(run), None),
                Some(Err(why)) => (None, Some(why)),
                None => (None, None),
            };
            match self.level(mesh, made) {
                Ok(next) => self.check(&mut levels, Level { unfit, ..next }),
                Err(why) => return self.best(levels, Short::Failed(why)),
            }
        }
    }

    /// The mesh that the search begins with. It is not coarser than that of the scene, unless that is asked for: who made
    /// a mesh may know why. Where half of its division fits the scene it is solved, too: it says what estimates are worth.
    fn first_levels(&mut self, degree: usize) -> Result<Vec<Level<T::Run>>, String> {
        let planned = |fineness| Planned { degree, fineness, rounds: Rounds::new(), finer: 1.0, enough: false };
        let mut levels = Vec::new();
        self.first_fineness = self.fineness;
        let begin = if self.demand.from_coarsest { self.fineness } else { self.ways.own };
        if begin > self.fineness
            && begin.is_multiple_of(2)
            && let Ok(level) = self.level(planned(begin / 2), None)
        {
            let why = "the mesh is coarser than that of the scene".to_owned();
            levels.push(Level { unfit: Some(why), ..level });
        }
        let level = self.level(planned(begin), None)?;
        self.check(&mut levels, level);
        Ok(levels)
    }

    /// The mesh behind the last one.
    fn next(&mut self, levels: &[Level<T::Run>], allowed: f64) -> Result<Planned, String> {
        let here = levels.last().ok_or("no run")?;
        let (marks, enough) = self.marks(here, levels.len(), allowed)?;
        let finer = if self.trials.at_contact(&here.run, &marks) { 2.0 * here.finer } else { here.finer };
        let rounds = here.rounds.iter().cloned().chain([marks]).collect();
        Ok(Planned { degree: here.degree, fineness: here.fineness, rounds, finer, enough })
    }

    /// The run with everything that the scene asks for on a mesh that should be the last one, and its error from the richer
    /// run on the mesh before, where that is so much more accurate that no other is needed: the distance of both is the
    /// error of the coarser, but for that of the richer.
    fn last(
        &mut self,
        levels: &[Level<T::Run>],
        mesh: &Planned,
        allowed: f64,
    ) -> Option<Result<(T::Run, f64), String>> {
        let here = levels.last().filter(|l| mesh.enough && l.unfit.is_none() && l.factor.is_finite())?;
        let judge = self.error_of_richer(levels).filter(|e| *e <= PART_OF_JUDGE * allowed)?;
        let run = match self.one(&self.setting(here.degree, mesh.finer), &mesh.rounds, Extent::WholeScene) {
            Ok(run) => run,
            Err(why) => return Some(Err(why)),
        };
        let apart = self.trials.distance(&run, &here.rich).unwrap_or(f64::INFINITY);
        let fell = self.fell(here, apart);
        // of a measure the distance may be small by accident
        let least = here.apart * 0.5f64.powi(i32::try_from(self.order(here.degree)).unwrap_or(1));
        let sum = if self.is_norm() { apart.hypot(judge) } else { apart.max(least) + judge };
        let error = if fell { f64::INFINITY } else { here.factor * sum + here.data.error };
        Some(Ok((run, error)))
    }

    /// The error of the last richer run, from how far those of the meshes before are away, if it falls no faster than that
    /// of the coarser runs.
    fn error_of_richer(&mut self, levels: &[Level<T::Run>]) -> Option<f64> {
        let (here, before) = levels.split_last()?;
        let lags = before.iter().rev().take(LAGS);
        if before.len() < if self.ways.kinked { LAGS } else { 1 } {
            return None;
        }
        lags.map(|level| {
            let fell = here.apart / level.apart;
            let apart = self.trials.distance(&level.rich, &here.rich).ok()?;
            (fell < 1.0).then(|| apart * fell / (1.0 - fell))
        })
        .try_fold(0.0f64, |most, error| Some(most.max(error?)))
    }

    /// Runs the best level with everything that the scene asks for, where none is good enough.
    fn best(mut self, levels: Vec<Level<T::Run>>, short: Short) -> Result<Found<T::Run>, Out> {
        let data = levels.last().map_or(0.0, |l| l.data.error);
        let short = match short {
            Short::Budget { .. } | Short::Stalled if data > 0.5 * self.demand.error => Short::Data(data),
            other => other,
        };
        let mut order: Vec<usize> = (0..levels.len()).filter(|k| levels[*k].unfit.is_none()).collect();
        order.sort_by(|a, b| levels[*a].estimate().total_cmp(&levels[*b].estimate()).then(b.cmp(a)));
        let mut reason = levels.iter().rev().find_map(|l| l.unfit.clone()).unwrap_or_default();
        for k in order {
            self.fineness = levels[k].fineness;
            match self.one(&levels[k].setting, &levels[k].rounds, Extent::WholeScene) {
                Ok(run) => return Ok(self.found_level(&levels, k, run, Some(short))),
                Err(why) => reason = why,
            }
        }
        Err(Out::Failed(reason))
    }

    /// Whether there is no use, or no time, for another level.
    fn stop(&self, levels: &[Level<T::Run>]) -> Option<Short> {
        let blind = levels.iter().rev().take_while(|l| !l.apart.is_finite()).count();
        if self.other() >= self.demand.error {
            let own = self.tolerance_error + self.method_error;
            let (time, geometry) = (self.time_error, self.geometry_error);
            return Some(match geometry >= time.max(own) {
                true => Short::Geometry(geometry),
                false if time >= own => Short::Time(time),
                false => Short::Method(own),
            });
        }
        if blind > BLIND {
            return Some(Short::Blind(self.blind.clone()));
        }
        let best = levels.iter().map(|l| l.apart).fold(f64::INFINITY, f64::min);
        let since = levels.iter().rev().take_while(|l| l.apart > best).count();
        if since > STALLED {
            return Some(Short::Stalled);
        }
        let seconds = |l: &Level<T::Run>| self.trials.cost(&l.run).seconds + self.trials.cost(&l.rich).seconds;
        let last = levels.last().map_or(0.0, seconds);
        let before = levels.iter().rev().nth(1).map_or(0.0, seconds);
        // a mesh of about as many more cells as the last one had
        let growth = if before > 0.0 { (last / before).clamp(1.0, 8.0) } else { 2.0 };
        let (next, budget) = (growth * last, self.demand.budget);
        (self.trials.elapsed() + next > budget).then_some(Short::Budget { next, budget })
    }

    /// The cells to refine, and whether that should be enough.
    fn marks(&mut self, here: &Level<T::Run>, n_levels: usize, allowed: f64) -> Result<(Vec<Mark>, bool), String> {
        let begins = n_levels < 2 && self.ways.refines() || here.unfit.is_some();
        let (mut marks, mut enough) = if here.apart.is_finite() && !begins {
            let made;
            let indicator = match &here.indicator {
                Some(known) => known,
                None => {
                    made = self.trials.indicator(&here.run, &here.rich, self.guide)?;
                    &made
                }
            };
            self.parts.push((here.rounds.len(), indicator.parts.iter().map(|p| p.iter().sum()).collect()));
            let mesh = self.trials.mesh(&here.run);
            let power = if self.is_norm() { 2 } else { 1 };
            let may = (allowed / (here.factor.min(MOST_SAFETY) * here.apart)).powi(power);
            // parts fall with the square of the order of the gradients
            let left = 0.25f64.powi(i32::try_from(here.degree).unwrap_or(1));
            let part = ((1.0 - AIM.powi(power) * may) / (1.0 - left)).clamp(PARTS[0], PARTS[1]);
            (marked(mesh, indicator, part), 1.0 - part * (1.0 - left) <= may)
        } else {
            (everything(self.trials.mesh(&here.run)), false)
        };
        if here.data.error > PART_OF_DATA * self.demand.error && !begins {
            let of_data = Indicator { parts: here.data.parts.iter().map(|p| [*p; 3]).collect(), size: None };
            marks = also(marks, marked(self.trials.mesh(&here.run), &of_data, PARTS[1]));
            enough = false;
        }
        if marks.is_empty() {
            return Err("no cell has a part of the error".to_owned());
        }
        Ok((marks, enough))
    }
}
