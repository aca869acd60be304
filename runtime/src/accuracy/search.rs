//! The search: solve, estimate, mark, refine, until the estimate meets the demand.
//!
//! On each mesh the scene is solved with elements of a degree and of the next one; their distance is the estimated error of
//! the first. That alone may be wrong: where the solution is even about the middle of each cell, the next degree finds
//! nothing, and a measure may meet its value by accident. So no estimate counts that another mesh has not confirmed: a
//! finer one checks the estimate of the one before, what it was too small by goes into the safety factor of the next, and
//! an estimate that fell faster than elements of its degree can is checked before it is believed. All cells are refined
//! first.

mod told;

use super::{
    Demand, Found, Out, Role, Rounds, Short, TrialRun, Trials, Ways,
    marking::{everything, marked},
    record::Other,
    ways::{Wanted, work},
};
use crate::{knobs::Setting, output::Real, refine::Mark};

/// Estimates are taken this much larger.
const SAFETY: f64 = 1.1;
/// An estimate may fall this much faster than its order says before it has to be checked.
const FALL: f64 = 2.0;
/// Relative distances of solutions that differ by rounding alone: such solutions are exact.
const ROUNDING: f64 = 1e-11;
/// So many levels are checked with each new one.
const LAGS: usize = 2;
/// An order of convergence is that of the elements from this part of it on.
const NEARLY: f64 = 0.75;
/// In scenes with kinks two checks in a row have to agree within this factor: until the active set is resolved, one says
/// little of the next.
const AGREE: f64 = 1.6;
/// A check that says that estimates are too small by more than this says that they mean nothing yet.
const MOST_SAFETY: f64 = 4.0;
/// What the next mesh is planned for, in parts of what is allowed.
const AIM: f64 = 0.8;
/// Least and largest part of the error that is marked at once.
const PARTS: [f64; 2] = [0.2, 0.8];
/// Parts of the demand that tolerance and method may have.
const PART_OF_TOLERANCE: f64 = 0.05;
const PART_OF_METHOD: f64 = 0.2;
/// The tolerance that is tried first, in parts of the demand, and the range it may have.
const FIRST_TOLERANCE: f64 = 1e-1;
pub(super) const TOLERANCES: std::ops::RangeInclusive<f64> = 1e-10..=1e-3;
/// A penalty is raised by at most this factor.
const MOST_STIFFER: f64 = 1e6;
/// The error of a richer run may be this part of the demand for that run to judge the next mesh: squares add up in a norm,
/// so that it adds 5 %.
const PART_OF_JUDGE: f64 = 0.3;
/// Meshes without an estimate (a solution that is zero, an iteration that does not converge) before the search gives up.
const BLIND: usize = 4;
/// Meshes in a row whose estimates may be no smaller than the best one.
const STALLED: usize = 12;

/// One mesh with its run.
struct Level<R> {
    setting: Vec<(String, String)>,
    rounds: Rounds,
    run: R,
    rich: R,
    /// Distance of both.
    apart: f64,
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
        if self.factor.is_finite() { self.factor * self.apart } else { f64::INFINITY }
    }
}

/// A mesh that is to be run.
struct Planned {
    degree: usize,
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
        trial_runs: Vec::new(),
        first: Vec::new(),
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
    trial_runs: Vec<TrialRun>,
    /// Runs on the first mesh by degree, until they are taken.
    first: Vec<(usize, T::Run)>,
    /// Why the last level without an estimate has none.
    blind: String,
    /// The parts of the error by cell, for meshes of so many rounds.
    parts: Vec<(usize, Vec<f64>)>,
}

impl<T: Trials> Search<'_, T> {
    fn setting(&self, degree: usize, richer: bool, finer: f64) -> Vec<(String, String)> {
        let Search { fineness, tolerance, stiffer, .. } = *self;
        self.ways.setting(Wanted { degree, fineness, finer, tolerance, stiffer, richer })
    }

    fn one(&mut self, setting: &Setting, rounds: &Rounds, last: bool) -> Result<T::Run, String> {
        let run = self.trials.run(setting, self.fineness, rounds, last)?;
        let cost = self.trials.cost(&run);
        self.trial_runs.push(TrialRun {
            setting: setting.to_vec(),
            rounds: rounds.len() as u64,
            cells: self.trials.mesh(&run).n_cells() as u64,
            dofs: cost.dofs,
            seconds: cost.seconds,
            error: Real(f64::NAN),
        });
        Ok(run)
    }

    /// What tolerance and method add.
    fn other(&self) -> f64 {
        self.tolerance_error + self.method_error
    }

    /// The coarsest mesh with a solution; tolerance and penalty are set there.
    fn begin(&mut self) -> Result<(), Out> {
        let own = self.ways.own;
        let mut wanted = self.ways.least.min(own);
        let degree = self.ways.degrees[0];
        let mut run = loop {
            self.fineness = wanted;
            match self.one(&self.setting(degree, false, 1.0), &Rounds::new(), false) {
                Ok(run) => break run,
                Err(why) if wanted >= own => return Err(Out::Failed(why)),
                Err(_) => wanted = (2 * wanted).min(own),
            }
        };
        self.set_tolerance(degree, &mut run)?;
        let run = self.set_penalty(degree, run)?;
        self.first.push((degree, run));
        Ok(())
    }

    /// Measures what the tolerance adds, and tightens it where that is too much.
    fn set_tolerance(&mut self, degree: usize, run: &mut T::Run) -> Result<(), Out> {
        let own = self.tolerance;
        self.tolerance = *TOLERANCES.start();
        let tight = self.setting(degree, false, 1.0);
        self.tolerance = own;
        // a solution that is zero has no relative error, and no part of it
        let found = self.trials.tighter(run, &tight, self.fineness).unwrap_or(0.0);
        self.tolerance_error = found;
        let allowed = PART_OF_TOLERANCE * self.demand.error;
        if found > allowed {
            let wanted = (self.tolerance * 0.5 * allowed / found).max(*TOLERANCES.start());
            // a power of ten is as good as another number, and is read more easily
            self.tolerance = 10f64.powf(wanted.log10().floor()).max(*TOLERANCES.start());
            self.tolerance_error = 0.5 * allowed;
        }
        Ok(())
    }

    /// Raises a penalty until ten times as much changes little.
    fn set_penalty(&mut self, degree: usize, mut run: T::Run) -> Result<T::Run, Out> {
        if self.ways.role != Role::Penalty {
            return Ok(run);
        }
        loop {
            let own = self.stiffer;
            self.stiffer = 10.0 * own;
            let setting = self.setting(degree, false, 1.0);
            let other = self.one(&setting, &Rounds::new(), false).map_err(Out::Failed)?;
            // the error of a penalty falls like its inverse: the distance is nine tenths of it
            self.method_error = self.trials.distance(&run, &other).map_err(Out::Failed)? / 0.9;
            let allowed = PART_OF_METHOD * self.demand.error;
            if self.method_error <= allowed || own >= MOST_STIFFER {
                self.stiffer = own;
                return Ok(run);
            }
            let factor = 10f64.powf((self.method_error / allowed).log10().ceil().max(1.0));
            self.stiffer = own * factor.min(MOST_STIFFER / own);
            run = if factor == 10.0 {
                other
            } else {
                let setting = self.setting(degree, false, 1.0);
                self.one(&setting, &Rounds::new(), false).map_err(Out::Failed)?
            };
        }
    }

    /// The degree that should need the least work, from the errors on the first mesh against the highest degree there.
    fn choose_degree(&mut self) -> usize {
        let least = self.ways.degrees[0];
        if self.ways.degrees.len() < 2 {
            return least;
        }
        for degree in least + 1..=self.ways.degrees.iter().max().map_or(least, |d| d + 1) {
            let setting = self.setting(degree, false, 1.0);
            match self.one(&setting, &Rounds::new(), false) {
                Ok(run) => self.first.push((degree, run)),
                Err(_) => break,
            }
        }
        let Some((best, rest)) = self.first.split_last() else { return least };
        let allowed = (self.demand.error - self.other()).max(f64::MIN_POSITIVE);
        let mut choice = (least, f64::INFINITY);
        for (degree, run) in rest.iter().filter(|(d, _)| self.ways.degrees.contains(d)) {
            let error = SAFETY * self.trials.distance(run, &best.1).unwrap_or(f64::NAN);
            let order = self.order(*degree) as f64;
            let more = (error / (AIM * allowed)).max(1.0).powf(self.ways.dim as f64 / order);
            // on a few cells most unknowns may be prescribed, and those of a finer mesh are not
            let inside = self.trials.mesh(run).n_cells() as f64 * (*degree as f64).powf(self.ways.dim as f64);
            let dofs = inside.max(self.trials.cost(run).dofs as f64);
            let work = work(self.ways.dim, *degree, dofs * more);
            if work < choice.1 {
                choice = (*degree, work);
            }
        }
        choice.0
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
        let Planned { degree, rounds, finer, .. } = mesh;
        let setting = self.setting(degree, false, finer);
        let take = |list: &mut Vec<(usize, T::Run)>, degree: usize| {
            let at = list.iter().position(|(d, _)| *d == degree && rounds.is_empty())?;
            Some(list.swap_remove(at).1)
        };
        let run = match made.or_else(|| take(&mut self.first, degree)) {
            Some(run) => run,
            None => self.one(&setting, &rounds, false)?,
        };
        let rich = self.one(&self.setting(degree, true, finer), &rounds, false)?;
        let apart = self.trials.distance(&run, &rich).unwrap_or_else(|why| {
            self.blind = why;
            f64::INFINITY
        });
        Ok(Level {
            setting,
            rounds,
            run,
            rich,
            apart,
            factor: f64::INFINITY,
            checked: None,
            degree,
            finer,
            unfit: None,
        })
    }

    fn refine_to_demand(mut self) -> Result<Found<T::Run>, Out> {
        let degree = self.choose_degree();
        let first = Planned { degree, rounds: Rounds::new(), finer: 1.0, enough: false };
        let mut levels = vec![self.level(first, None).map_err(Out::Failed)?];
        self.first.clear();
        let allowed = self.demand.error - self.other();
        loop {
            // the first that is good enough is the cheapest
            if let Some(good) = levels.iter().position(|l| l.unfit.is_none() && l.estimate() <= allowed) {
                match self.one(&levels[good].setting, &levels[good].rounds, true) {
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

    /// The mesh behind the last one.
    fn next(&mut self, levels: &[Level<T::Run>], allowed: f64) -> Result<Planned, String> {
        let here = levels.last().ok_or("no run")?;
        let (marks, enough) = self.marks(here, allowed)?;
        let finer = if self.trials.at_contact(&here.run, &marks) { 2.0 * here.finer } else { here.finer };
        let rounds = here.rounds.iter().cloned().chain([marks]).collect();
        Ok(Planned { degree: here.degree, rounds, finer, enough })
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
        let run = match self.one(&self.setting(here.degree, false, mesh.finer), &mesh.rounds, true) {
            Ok(run) => run,
            Err(why) => return Some(Err(why)),
        };
        let apart = self.trials.distance(&run, &here.rich).unwrap_or(f64::INFINITY);
        let sum = if self.is_norm() { apart.hypot(judge) } else { apart + judge };
        let error = if self.fell(here, apart) { f64::INFINITY } else { here.factor * sum };
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
        let mut order: Vec<usize> = (0..levels.len()).filter(|k| levels[*k].unfit.is_none()).collect();
        order.sort_by(|a, b| levels[*a].estimate().total_cmp(&levels[*b].estimate()).then(b.cmp(a)));
        let mut reason = levels.iter().rev().find_map(|l| l.unfit.clone()).unwrap_or_default();
        for k in order {
            match self.one(&levels[k].setting, &levels[k].rounds, true) {
                Ok(run) => return Ok(self.found_level(&levels, k, run, Some(short))),
                Err(why) => reason = why,
            }
        }
        Err(Out::Failed(reason))
    }

    /// Adds a level, and checks the estimates of those before with it.
    fn check(&mut self, levels: &mut Vec<Level<T::Run>>, next: Level<T::Run>) {
        let power = if self.demand.quantity == "H1" { 2.0 } else { 1.0 };
        // a part of the error that the last round left as it was shows from further back only
        for before in levels.iter_mut().rev().take(LAGS).filter(|l| l.apart.is_finite()) {
            let truth = self.trials.distance(&before.run, &next.rich).unwrap_or(f64::NAN);
            let found = match (before.apart <= ROUNDING, truth <= ROUNDING) {
                (_, true) => Some(1.0),
                // both degrees have the same solution and the finer mesh another: nothing is known of the error
                (true, false) => Some(f64::INFINITY),
                _ => error_over_distance(truth / before.apart, next.apart / before.apart, power),
            };
            before.checked = before.checked.into_iter().chain(found).reduce(f64::max);
        }
        levels.push(next);
        for k in 0..levels.len() {
            levels[k].factor = self.factor(levels, k);
            tell_error(&mut self.trial_runs, &levels[k]);
        }
    }

    /// Whether the first two estimates fall about as fast as elements of their degree can: both degrees may share an error
    /// that falls more slowly, and a second mesh has to show it then.
    fn converges(&self, levels: &[Level<T::Run>]) -> bool {
        let [first, second, ..] = levels else { return false };
        let order = NEARLY * self.order(first.degree) as f64;
        second.apart <= ROUNDING || second.apart <= first.apart * 0.5f64.powf(order)
    }

    /// Whether an estimate is so much smaller than that of the mesh before that it may be so by accident.
    fn fell(&self, before: &Level<T::Run>, apart: f64) -> bool {
        let order = i32::try_from(self.order(before.degree)).unwrap_or(1);
        apart * FALL < before.apart * 0.5f64.powi(order)
    }

    /// What the checks of a level and of those before say of its estimate.
    fn factor(&self, levels: &[Level<T::Run>], k: usize) -> f64 {
        let (here, first) = (&levels[k], k.saturating_sub(LAGS));
        let fell = k > 0 && self.fell(&levels[k - 1], here.apart);
        let needed = if self.ways.kinked || !self.converges(levels) { 2 } else { 1 };
        let checks: Vec<f64> = levels[first..=k].iter().filter_map(|l| l.checked).collect();
        let (least, most) = checks.iter().fold((f64::INFINITY, 0.0f64), |(a, b), c| (a.min(*c), b.max(*c)));
        let differ = self.ways.kinked && most > AGREE * least;
        if fell && here.checked.is_none() || checks.len() < needed || most > MOST_SAFETY || differ {
            return f64::INFINITY;
        }
        SAFETY * most.max(1.0)
    }

    /// Whether there is no use, or no time, for another level.
    fn stop(&self, levels: &[Level<T::Run>]) -> Option<Short> {
        let blind = levels.iter().rev().take_while(|l| !l.apart.is_finite()).count();
        if self.other() >= self.demand.error {
            return Some(Short::Method(self.other()));
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
    fn marks(&mut self, here: &Level<T::Run>, allowed: f64) -> Result<(Vec<Mark>, bool), String> {
        let begins = here.rounds.is_empty() && self.ways.refines() || here.unfit.is_some();
        let (marks, enough) = if here.apart.is_finite() && !begins {
            let indicator = self.trials.indicator(&here.run, &here.rich)?;
            self.parts.push((here.rounds.len(), indicator.parts.iter().map(|p| p.iter().sum()).collect()));
            let mesh = self.trials.mesh(&here.run);
            let power = if self.is_norm() { 2 } else { 1 };
            let may = (allowed / (here.factor.min(MOST_SAFETY) * here.apart)).powi(power);
            // parts fall with the square of the order of the gradients
            let left = 0.25f64.powi(i32::try_from(here.degree).unwrap_or(1));
            let part = ((1.0 - AIM.powi(power) * may) / (1.0 - left)).clamp(PARTS[0], PARTS[1]);
            (marked(mesh, &indicator, part), 1.0 - part * (1.0 - left) <= may)
        } else {
            (everything(self.trials.mesh(&here.run)), false)
        };
        if marks.is_empty() {
            return Err("no cell has a part of the error".to_owned());
        }
        Ok((marks, enough))
    }
}
