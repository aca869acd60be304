//! The balance of energy over the steps: kinetic energy, the work of every term, of loads and of prescribed values, and
//! what of it is lost.
//!
//! Work over a step is the trapezoidal rule: the mean of the forces at its ends times the change of the unknowns with second
//! rates. Exact for forces that are linear in them. With K the kinetic energy, W the work that terms take up and A that of
//! loads and supports, lost = A - W - (K - K_0): the damping of the scheme, what the equations leave, and the error of the
//! rule. Promises: the rates of the system are left as they were. Scenes that do not ask for it have none.

use std::ops::Range;

use wfl_compiler::{
    Class, TermLaw,
    types::{RateForm, RateOrder},
};
use wfl_discrete::{
    lumped::Lumped,
    rates::Rates,
    system::{FIXED, System},
    window::Window,
};
use wfl_host::team::Team;
use wfl_newton::NewtonError;
use wfl_problem::{Energy, Scene, Solving};

/// Energies since the start, in the units of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Balance {
    /// Kinetic energy at the start and now.
    pub(super) kinetic: [f64; 2],
    /// What each term has taken up, stored or dissipated, in the order of [`Energy::terms`]; that of loads behind them.
    pub(super) works: Vec<f64>,
    /// The work of supports and prescribed motions.
    pub(super) prescribed: f64,
    /// By term and loads the forces at the end of the last step, by dof in the axes of the scene: the rows of this rank.
    pub(super) forces: Vec<Vec<f64>>,
    /// The sum of all forces then, by dof in the local frames of nodes.
    pub(super) total: Vec<f64>,
    /// By term the least and the most that it had taken up at states without any force of it, and the most that it gave back
    /// between two of them; none where it never was.
    pub(super) free: Vec<Vec<f64>>,
}

/// How a balance tells forces apart.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kinds {
    /// By the names of [`Energy::terms`].
    Named,
    /// Those of linear terms, and those of terms that are neither linear nor loads.
    Linear,
}

impl Kinds {
    /// Those of all terms.
    fn of_terms(self, scene: &Scene, system: &System) -> KindsOfTerms {
        let names: &[String] = scene.energy.as_ref().map_or(&[], |e| &e.terms);
        let named = |law: &TermLaw| names.iter().position(|name| Energy::is_of(name, &law.name));
        let laws = system.terms.iter().map(|term| &term.law);
        match self {
            Self::Named => {
                let by_term = laws.map(|law| named(law).unwrap_or(names.len())).collect();
                KindsOfTerms { count: names.len(), by_term }
            }
            Self::Linear => KindsOfTerms { count: 2, by_term: laws.map(|law| Self::by_class(law.class)).collect() },
        }
    }

    fn by_class(class: Class) -> usize {
        match class {
            Class::Linear => 0,
            Class::Nonlinear | Class::Kinked => 1,
            Class::Constant => 2,
        }
    }
}

/// Which forces are told apart.
struct KindsOfTerms {
    /// How many kinds there are beside the loads.
    count: usize,
    /// By term its kind; `count` for what is none of them.
    by_term: Vec<usize>,
}

/// Forces at a state, as [`Balance`] keeps them, and the kinetic energy.
struct Forces {
    by_term: Vec<Vec<f64>>,
    total: Vec<f64>,
    kinetic: f64,
}

impl Balance {
    /// The state where time starts.
    pub(super) fn start(kinds: Kinds, scene: &mut Solving<'_>, window: Window, u: &[f64]) -> Result<Self, NewtonError> {
        let Forces { by_term, total, kinetic } = forces(kinds, scene, window, u)?;
        let works = vec![0.0; by_term.len()];
        let free = vec![Vec::new(); by_term.len()];
        let mut start = Self { kinetic: [kinetic; 2], works, prescribed: 0.0, forces: by_term, total, free };
        start.keep_free(scene.system.team());
        Ok(start)
    }

    /// The same with the rows of all ranks, made by all together.
    pub(super) fn of_all(&self, team: &dyn Team) -> Self {
        let mut all = self.clone();
        all.forces.iter_mut().chain([&mut all.total]).for_each(|forces| team.sum(forces));
        all
    }

    /// The rows of this rank of what [`Self::of_all`] has.
    pub(super) fn keep_own(&mut self, system: &System) {
        for forces in self.forces.iter_mut().chain([&mut self.total]) {
            (0..forces.len()).filter(|d| !system.owns(*d)).for_each(|d| forces[d] = 0.0);
        }
    }

    /// Keeps what terms without force have taken up.
    fn keep_free(&mut self, team: &dyn Team) {
        for ((free, force), work) in self.free.iter_mut().zip(&self.forces).zip(&self.works) {
            if team.all(force.iter().all(|f| *f == 0.0)) {
                let [least, most, given] = *free.as_slice() else {
                    *free = vec![*work, *work, 0.0];
                    continue;
                };
                *free = vec![least.min(*work), most.max(*work), given.max(most - work)];
            }
        }
    }

    /// By term how much more it had taken up at one state without force of it than at another: nothing, if its forces
    /// have a potential and the rule is exact.
    pub(super) fn unreturned(&self) -> impl Iterator<Item = f64> + '_ {
        self.free.iter().map(|free| if let [least, most, _] = **free { most - least } else { 0.0 })
    }

    /// By term how much less it had taken up at a state without force of it than at an earlier one: nothing, if its forces have
    /// a potential or dissipate.
    pub(super) fn given(&self) -> impl Iterator<Item = f64> + '_ {
        self.free.iter().map(|free| free.get(2).copied().unwrap_or(0.0))
    }

    /// Adds a step that has ended at `u`; its start is the past of the scene.
    pub(super) fn add(
        &mut self,
        kinds: Kinds,
        scene: &mut Solving<'_>,
        window: Window,
        u: &[f64],
    ) -> Result<(), NewtonError> {
        let Forces { by_term, total, kinetic } = forces(kinds, scene, window, u)?;
        let system = &scene.system;
        let Some(past) = system.past() else { return Ok(()) };
        let mut change = change_of_moving(system, u, &past.unknowns);
        let mean = |a: &[f64], b: &[f64], d: usize| 0.5 * (a[d] + b[d]);
        for ((work, before), now) in self.works.iter_mut().zip(&self.forces).zip(&by_term) {
            *work += system.team().total((0..u.len()).map(|d| mean(before, now, d) * change[d]).sum());
        }
        let numbering = &system.numbering;
        numbering.frames.turn(&mut change);
        let supports = (0..u.len()).filter(|d| numbering.free[*d] == FIXED);
        self.prescribed += system.team().total(supports.map(|d| mean(&self.total, &total, d) * change[d]).sum());
        (self.forces, self.total, self.kinetic[1]) = (by_term, total, kinetic);
        self.keep_free(system.team());
        Ok(())
    }

    /// What was lost since the start: loads and supports gave it, and neither the terms nor the motion have it.
    pub(super) fn lost(&self) -> f64 {
        let work: f64 = self.works.iter().sum();
        self.prescribed - work - (self.kinetic[1] - self.kinetic[0])
    }

    /// What is reported, in the order of [`Energy::measures`].
    pub(super) fn values(&self) -> Vec<f64> {
        let (loads, terms) = self.works.split_last().expect("the loads");
        let taken: f64 = terms.iter().sum();
        let lost = self.prescribed - loads - taken - (self.kinetic[1] - self.kinetic[0]);
        let mut values = vec![self.kinetic[1]];
        values.extend(terms);
        values.extend([-loads, self.prescribed, lost]);
        values
    }
}

/// By dof the change over a step of the unknowns with second rates; zero for others.
pub(super) fn change_of_moving(system: &System, u: &[f64], before: &[f64]) -> Vec<f64> {
    let mut change = vec![0.0; u.len()];
    for d in moving(system.rates()).into_iter().flatten() {
        change[d] = u[d] - before[d];
    }
    change
}

/// The dofs of fields with second rates.
pub(super) fn moving(rates: Option<&Rates>) -> Vec<Range<usize>> {
    let fields = rates.into_iter().flat_map(Rates::fields);
    fields.filter(|of| of.form == RateForm::Second).map(|of| of.dofs.clone()).collect()
}

/// Forces and kinetic energy at the end `u` of a step, with the rates there.
fn forces(kinds: Kinds, scene: &mut Solving<'_>, window: Window, u: &[f64]) -> Result<Forces, NewtonError> {
    let Solving { system, scene, .. } = scene;
    let kinds = kinds.of_terms(scene, system);
    system.with_other_rates(window, |system| forces_at_end(scene, system, &kinds, At { window, u }))
}

/// A state and the step that it is the end of.
#[derive(Clone, Copy)]
struct At<'a> {
    window: Window,
    u: &'a [f64],
}

fn forces_at_end(scene: &Scene, system: &mut System, kinds: &KindsOfTerms, at: At<'_>) -> Result<Forces, NewtonError> {
    let At { window, u } = at;
    let Scene { explicit, .. } = scene;
    let zero = vec![0.0; u.len()];
    let past = system.past().map_or(u, |past| &past.unknowns);
    let [first, second] = system.rates().map_or([zero.clone(), zero.clone()], |r| r.ended(u, past));
    let take = |rates: Option<&mut Rates>, second: &[f64]| {
        if let Some(rates) = rates {
            rates.take(&first, second);
        }
    };
    // without accelerations a term with inertia gives what else stands in it
    take(system.rates_mut(), &zero);
    system.set_laws(window);
    let has_inertia = |k: &usize| system.terms[*k].law.reads_rates(RateOrder::Second);
    let inertial: Vec<usize> = (0..system.terms.len()).filter(has_inertia).collect();
    let mut by_term = vec![zero.clone(); kinds.count + 1];
    let mut total = zero.clone();
    for k in 0..system.terms.len() {
        let mut force = zero.clone();
        system.term_residual(k, u, &mut force)?;
        by_term[kinds.by_term[k]].iter_mut().zip(&force).for_each(|(a, b)| *a += b);
        if explicit.is_some() || !inertial.contains(&k) {
            total.iter_mut().zip(&force).for_each(|(a, b)| *a += b);
        }
    }
    if let Some(explicit) = explicit {
        let kinetic = on_the_diagonal(&explicit.lumped, system, window, [&first, &second], &mut total);
        return Ok(Forces { by_term, total, kinetic });
    }
    take(system.rates_mut(), &second);
    for k in inertial {
        system.term_residual(k, u, &mut total)?;
    }
    system.add_redistributed(&second, &mut total);
    system.numbering.turn(&mut total);
    let kinetic = kinetic_of(system, u, &first)?;
    Ok(Forces { by_term, total, kinetic })
}

/// The kinetic energy of some velocities by dof, at the unknowns `u`. The laws are set.
pub(super) fn kinetic_of(system: &mut System, u: &[f64], velocities: &[f64]) -> Result<f64, NewtonError> {
    let momentum = system.mass_times(u, velocities)?;
    Ok(0.5 * system.team().total(velocities.iter().zip(&momentum).map(|(v, p)| v * p).sum()))
}

/// The kinetic energy of explicit steps; adds inertia to the sum of the other forces by dof in the axes of the scene, which
/// becomes that in the local frames.
fn on_the_diagonal(lumped: &Lumped, system: &System, window: Window, rates: [&[f64]; 2], total: &mut [f64]) -> f64 {
    let numbering = &system.numbering;
    let [velocity, acceleration] = rates.map(|v| {
        let mut v = v.to_vec();
        numbering.frames.turn(&mut v);
        v
    });
    let mut follows = vec![false; total.len()];
    numbering.ties().iter().for_each(|tie| follows[tie.follower] = true);
    let own = |d: &usize| !follows[*d] && system.owns(*d);
    numbering.turn(total);
    // the product of the velocities half a step before and behind: the energy that central differences keep
    let turn = 0.5 * window.increment;
    let mut twice = 0.0;
    for d in (0..total.len()).filter(own) {
        total[d] += lumped.mass[d] * acceleration[d];
        twice += lumped.mass[d] * (velocity[d] * velocity[d] - (turn * acceleration[d]) * (turn * acceleration[d]));
    }
    0.5 * system.team().total(twice)
}
