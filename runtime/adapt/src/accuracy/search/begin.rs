//! How a search begins: the first mesh, what tolerance and method add, and the degree.

use super::{AIM, Extent, Rounds, SAFETY, Search, TOLERANCES};
use crate::accuracy::{Out, Role, Trials, ways::work};

/// Parts of the demand that tolerance and method may have: a tolerance is cheap to lower, a penalty costs iterations;
/// what is left is for the mesh.
const PART_OF_TOLERANCE: f64 = 0.05;
const PART_OF_METHOD: f64 = 0.2;
/// Part of the demand that the length of the steps may have: halved steps cost twice as much, so that they get more
/// than what is cheap.
const PART_OF_STEPS: f64 = 0.3;
/// Each step is divided into at most so many: eight halvings, with which methods of first order gain two digits and of second
/// order five; more is for steps that the scene sets itself.
const MOST_SUBSTEPS: usize = 256;
/// Factors by which distances fall when steps are halved: of methods of first to third order, and more slowly where rates jump.
const LEAST_RATE: f64 = 1.4;
const MOST_RATE: f64 = 8.0;
/// A penalty is raised by at most this factor: beyond it the digits that conditioning takes are more than those it
/// gives.
const MOST_STIFFER: f64 = 1e6;

impl<T: Trials> Search<'_, T> {
    /// The coarsest mesh with a solution; tolerance and penalty are set there.
    pub(super) fn begin(&mut self) -> Result<(), Out> {
        let own = self.ways.own;
        let mut wanted = self.ways.least.min(own);
        let degree = self.ways.degrees[0];
        let mut run = loop {
            self.fineness = wanted;
            match self.one(&self.setting(degree, 1.0), &Rounds::new(), Extent::Solution) {
                Ok(run) => break run,
                Err(why) if wanted >= own => return Err(Out::Failed(why)),
                Err(_) => wanted = (2 * wanted).min(own),
            }
        };
        self.set_tolerance(degree, &mut run)?;
        let run = self.set_penalty(degree, run)?;
        let run = self.set_steps(degree, run);
        let setting = self.setting(degree, 1.0);
        self.geometry_error = self.trials.geometry(&run, &setting, self.fineness);
        self.first.push((degree, run));
        Ok(())
    }

    /// Divides the steps of a scene whose solution depends on their length until half the length changes little.
    ///
    /// With distances that fall by a factor q from one halving to the next, what is left is q/(q - 1) times the distance.
    /// Of q nothing is known before the second one: the first is taken as that of a method of first order, twice. A
    /// distance that grows may have been small by accident, so that it counts for the next ones, halved each time.
    fn set_steps(&mut self, degree: usize, mut run: T::Run) -> T::Run {
        if !self.ways.divides_steps() {
            return run;
        }
        let allowed = PART_OF_STEPS * self.demand.error;
        let (mut before, mut seconds) = (None::<f64>, 0.0);
        loop {
            let own = self.substeps;
            self.substeps = 2 * own;
            let setting = self.setting(degree, 1.0);
            let finer = self.one(&setting, &Rounds::new(), Extent::Solution);
            let apart = finer.as_ref().map_err(Clone::clone).and_then(|finer| self.trials.distance(&run, finer));
            let (Ok(finer), Ok(apart)) = (finer, apart) else {
                // a solution that is zero has no relative error, and no part of it
                self.substeps = own;
                return run;
            };
            let apart = apart.max(0.25 * before.unwrap_or(0.0));
            let rate = before.map_or(2.0, |b| (b / apart).clamp(LEAST_RATE, MOST_RATE));
            self.time_error = apart * rate / (rate - 1.0);
            seconds += self.trials.cost(&finer).seconds;
            if self.time_error <= allowed || 2 * own > MOST_SUBSTEPS || 3.0 * seconds > self.demand.budget {
                self.substeps = own;
                return run;
            }
            (before, run) = (Some(apart), finer);
        }
    }

    /// Measures what the tolerance adds, and tightens it where that is too much.
    fn set_tolerance(&mut self, degree: usize, run: &mut T::Run) -> Result<(), Out> {
        let own = self.tolerance;
        self.tolerance = *TOLERANCES.start();
        let tight = self.setting(degree, 1.0);
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
            let setting = self.setting(degree, 1.0);
            let other = self.one(&setting, &Rounds::new(), Extent::Solution).map_err(Out::Failed)?;
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
                let setting = self.setting(degree, 1.0);
                self.one(&setting, &Rounds::new(), Extent::Solution).map_err(Out::Failed)?
            };
        }
    }

    /// The degree that should need the least work, from the errors on the first mesh against the highest degree there.
    pub(super) fn choose_degree(&mut self) -> usize {
        let least = self.ways.degrees[0];
        if self.ways.degrees.len() < 2 {
            return least;
        }
        if least == 1 && self.first.first().is_some_and(|f| self.trials.locks(&f.1)) {
            return self.ways.degrees[1];
        }
        for degree in least + 1..=self.ways.degrees.iter().max().map_or(least, |d| d + 1) {
            let setting = self.setting(degree, 1.0);
            match self.one(&setting, &Rounds::new(), Extent::Solution) {
                Ok(run) => self.first.push((degree, run)),
                Err(_) => break,
            }
        }
        let Some((best, rest)) = self.first.split_last() else { return least };
        let allowed = (self.demand.error - self.other()).max(f64::MIN_POSITIVE);
        // the result is not on a coarser mesh than that of the scene
        let begin = if self.demand.from_coarsest { self.fineness } else { self.ways.own.max(self.fineness) };
        let floor = (begin as f64 / self.fineness as f64).powf(self.ways.dim as f64);
        let mut choice = (least, f64::INFINITY);
        for (degree, run) in rest.iter().filter(|(d, _)| self.ways.degrees.contains(d)) {
            let error = SAFETY * self.trials.distance(run, &best.1).unwrap_or(f64::INFINITY);
            let order = self.order(*degree) as f64;
            let more = (error / (AIM * allowed)).max(1.0).powf(self.ways.dim as f64 / order).max(floor);
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
}
