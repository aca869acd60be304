//! A system whose mass stands on the diagonal: the mass, the damping, and the longest stable step of central differences.
//!
//! The mass of a dof is the sum of its row of the mass matrix, found by a residual: with the second rate 1 in one component
//! of one field and zero in all others, the terms with `Dot2_` give the sums of the columns that belong to it. The damping
//! of a dof is found in the same way from the linear terms with `Dot_`; what couples it with other components and fields
//! counts with its size, so that the diagonal is never less than the matrix, and steps solve for the rest (`damping.rs`). Mass that
//! couples dofs of different components, fields or bodies is no diagonal: it is refused. Promises: no matrix of the linear terms is
//! assembled. Steps nothing.
//!
//! Sources: T. J. R. Hughes, The Finite Element Method (1987), 7.3.2 for row sums, 9.1 for central differences; the limit
//! with damping that lags by half a step, h^2 w^2/4 + h c/2 < 1, is that of T. Belytschko, W. K. Liu, B. Moran, Nonlinear
//! Finite Elements (2000), 6.2.

use wfl_compiler::{
    Class,
    types::{FieldKind, FieldOp, InputSlot, RateForm, RateOrder, Side, UniformSlot},
};
use wfl_sparse::csr::Csr;

use crate::{
    assemble::AssembledTerm,
    finite::largest,
    frames::Frame,
    rates::{RateFactors, Rates},
    system::{Branches, FIXED, System, SystemError},
    window::Window,
};

/// Mass and damping on the diagonal, by dof in the local frames of nodes; zero at dofs without inertia.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lumped {
    /// Force over acceleration.
    pub mass: Vec<f64>,
    /// Force over velocity; that of linear terms, as far as it stands on the diagonal.
    pub damping: Vec<f64>,
    /// Linear damping acts between components or fields: a step solves for the velocity at its end.
    pub couples: bool,
}

/// The longest stable step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepLimit {
    /// Its length; infinite where nothing has stiffness.
    pub step: f64,
    /// How often the terms were evaluated for it.
    pub evaluations: usize,
}

/// Why a mass cannot be lumped.
#[derive(Debug)]
pub enum Unlumped {
    /// An unknown has equations without a second rate.
    NoInertia {
        /// The field.
        field: String,
        /// It is a multiplier.
        multiplier: bool,
    },
    /// The inertia of a term, by its position, is not a matrix of its own that stays.
    Mixed {
        /// The term.
        term: usize,
    },
    /// The inertia of a term, by its position, acts between places: through gradients, or from one side of a face on the other.
    Between {
        /// The term.
        term: usize,
    },
    /// The inertia of one unknown acts on another one.
    Coupled {
        /// The field.
        field: String,
        /// The field that it acts on; the same where it is another component.
        on: String,
    },
    /// The mass of a node is not positive.
    Mass {
        /// The field.
        field: String,
        /// The sum of the row.
        value: f64,
        /// The node.
        position: [f64; 3],
    },
    /// The system cannot be evaluated.
    System(SystemError),
}

impl<E: Into<SystemError>> From<E> for Unlumped {
    fn from(error: E) -> Self {
        Self::System(error.into())
    }
}

/// The longest stable step counts as found where the highest frequency is known to this part of its square.
const RESOLVED: f64 = 1e-4;
/// Most applications of the stiffness for it: the highest frequencies of a mesh of equal cells lie close together, and the
/// bound that is then told is still a safe one.
const MOST: usize = 400;

/// What the growth of a power iteration is multiplied by: it comes near the largest eigenvalue slowly.
const UNSYMMETRIC: f64 = 1.05;
/// What is below this part of the largest number is rounding: a row that sums to zero, and what Lanczos' method has left of
/// a vector where the directions of the start are used up.
const ROUNDED: f64 = 1e-13;

/// Whether a term reads a rate of this order.
pub(crate) fn reads(term: &AssembledTerm, order: RateOrder) -> bool {
    term.law.inputs.iter().any(|slot| matches!(slot, InputSlot::History(o, _) if *o == order))
}

/// Whether the inertia of a term is a matrix that stays: nothing in the term depends on unknowns beyond a linear law, or on
/// the step variable.
pub(crate) fn has_a_mass_of_its_own(term: &AssembledTerm) -> bool {
    let timed = |s: &UniformSlot| matches!(s, UniformSlot::Time | UniformSlot::TimeStep);
    term.law.class <= Class::Linear && !term.law.prologue.slots.iter().any(timed)
}

impl Lumped {
    /// The diagonal of a system at the state `u` and a step, whose increment terms may read. The rates of the system are left zero.
    ///
    /// # Errors
    /// [`Unlumped`] says what has no mass.
    pub fn of(system: &mut System, u: &[f64], window: Window) -> Result<Self, Unlumped> {
        refuse_without_inertia(system)?;
        let mass = mass(system, u, window)?;
        for (k, field) in system.fields.iter().enumerate() {
            let Some(range) = system.range(k) else { continue };
            let rounding = ROUNDED * largest(mass[range.clone()].iter().copied());
            // also what is no number
            let none = |d: &usize| system.numbering.free[*d] != FIXED && (mass[*d] <= rounding || mass[*d].is_nan());
            if let Some(d) = range.clone().find(none) {
                let position = field.node_position((d - range.start) / field.n_components);
                return Err(Unlumped::Mass { field: field.name.clone(), value: mass[d], position });
            }
        }
        let (damping, couples) = damping(system, u, window)?;
        Ok(Self { mass, damping, couples })
    }

    /// What the acceleration over a step of this length is divided by: the diagonal of the damping acts at the end of it.
    #[must_use]
    pub fn divisor(&self, dof: usize, increment: f64) -> f64 {
        self.mass[dof] + 0.5 * increment * self.damping[dof]
    }

    /// The longest stable step of central differences at the state `u`: 2/w without damping beside the diagonal. The rates
    /// of the system are left zero; several ranks find it together.
    ///
    /// # Errors
    /// [`SystemError`] where the system cannot be evaluated at `u`.
    pub fn longest_step(&self, system: &mut System, u: &[f64], window: Window) -> Result<StepLimit, SystemError> {
        let mut evaluations = 0;
        let stiffness = Operator::stiffness(system, u, window)?;
        let squared = self.largest_eigenvalue(system, &stiffness, &mut evaluations)?;
        let damping = Operator::lagging(self, system, u, window)?;
        let lagged = match damping.is_nothing(system) {
            true => 0.0,
            false => self.largest_eigenvalue(system, &damping, &mut evaluations)?.max(0.0),
        };
        rest(system, window);
        let step = if squared > 0.0 {
            let ratio = 0.5 * lagged / squared.sqrt();
            2.0 / squared.sqrt() * ((ratio * ratio + 1.0).sqrt() - ratio)
        } else if lagged > 0.0 {
            2.0 / lagged
        } else {
            f64::INFINITY
        };
        Ok(StepLimit { step, evaluations })
    }

    /// An upper bound of the largest eigenvalue of a symmetric operator over the mass, by Lanczos' method: the largest Ritz
    /// value and the size of its residual. Of an operator that is not symmetric the largest growth in a power iteration,
    /// with [`UNSYMMETRIC`].
    fn largest_eigenvalue(
        &self,
        system: &mut System,
        operator: &Operator,
        evaluations: &mut usize,
    ) -> Result<f64, SystemError> {
        let roots: Vec<f64> = system.numbering.free_dofs.iter().map(|d| self.mass[*d as usize].sqrt()).collect();
        let n = roots.len();
        let symmetric = system.is_symmetric();
        let times = |system: &mut System, q: &[f64]| {
            let x: Vec<f64> = q.iter().zip(&roots).map(|(q, m)| q / m).collect();
            let mut y = operator.apply(system, self, &x)?;
            y.iter_mut().zip(&roots).for_each(|(y, m)| *y /= m);
            Ok::<_, SystemError>(y)
        };
        let (mut diagonal, mut beside): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut q = start_vector(n);
        let (mut before, mut found) = (vec![0.0; n], 0.0);
        for _ in 0..MOST.min(n) {
            let mut y = times(system, &q)?;
            *evaluations += 1;
            let along = dot(&q, &y);
            if !symmetric {
                let size = dot(&y, &y).sqrt();
                if size == 0.0 {
                    break;
                }
                found = UNSYMMETRIC * size;
                y.iter_mut().for_each(|y| *y /= size);
                q = y;
                continue;
            }
            let last = beside.last().copied().unwrap_or(0.0);
            for ((y, q), b) in y.iter_mut().zip(&q).zip(&before) {
                *y -= along * q + last * b;
            }
            let size = dot(&y, &y).sqrt();
            diagonal.push(along);
            let (value, end) = largest_of_tridiagonal(&diagonal, &beside);
            found = value + size * end;
            let spread = diagonal.iter().chain(&beside).fold(0.0f64, |a, b| a.max(b.abs()));
            if size * end <= RESOLVED * value || size <= ROUNDED * spread {
                break;
            }
            beside.push(size);
            y.iter_mut().for_each(|y| *y /= size);
            before = std::mem::replace(&mut q, y);
        }
        Ok(found)
    }
}

/// Unknowns that explicit steps do not give.
fn refuse_without_inertia(system: &System) -> Result<(), Unlumped> {
    let second = |k: usize| {
        let mut fields = system.rates().into_iter().flat_map(Rates::fields);
        fields.any(|of| of.field == k && of.form == RateForm::Second)
    };
    for (k, field) in system.fields.iter().enumerate() {
        let free = |r: std::ops::Range<usize>| r.into_iter().any(|d| system.numbering.free[d] != FIXED);
        if system.range(k).is_some_and(free) && !second(k) {
            let multiplier = field.kind == FieldKind::Multiplier;
            return Err(Unlumped::NoInertia { field: field.name.clone(), multiplier });
        }
    }
    let inertia = |t: &AssembledTerm| reads(t, RateOrder::Second);
    if let Some(term) = system.terms.iter().position(|t| inertia(t) && !has_a_mass_of_its_own(t)) {
        return Err(Unlumped::Mixed { term });
    }
    match system.terms.iter().position(|t| inertia(t) && acts_between_places(t)) {
        Some(term) => Err(Unlumped::Between { term }),
        None => Ok(()),
    }
}

/// Whether the inertia of a term acts through gradients, or from one side of a face on the other: sums of rows say nothing of it.
fn acts_between_places(term: &AssembledTerm) -> bool {
    let slots = || {
        term.law.inputs.iter().filter_map(|slot| match slot {
            InputSlot::History(RateOrder::Second, slot) => Some(slot),
            _ => None,
        })
    };
    let is_there = |side: Side| slots().any(|slot| slot.side == side);
    slots().any(|slot| slot.op != FieldOp::Value) || is_there(Side::Here) && is_there(Side::There)
}

/// Sets rates that are the same in one component of one field and zero elsewhere.
fn set_rate(system: &mut System, order: RateOrder, field: usize, component: Option<usize>, window: Window) {
    let zero = vec![0.0; system.numbering.n_dofs];
    let mut one = zero.clone();
    let stride = system.fields[field].n_components;
    for (k, d) in system.range(field).into_iter().flatten().enumerate() {
        one[d] = f64::from(u8::from(component == Some(k % stride)));
    }
    if let Some(rates) = system.rates_mut() {
        match order {
            RateOrder::First => rates.take(&one, &zero),
            RateOrder::Second => rates.take(&zero, &one),
        }
    }
    system.set_laws(window);
}

/// No rates.
fn rest(system: &mut System, window: Window) {
    let zero = vec![0.0; system.numbering.n_dofs];
    if let Some(rates) = system.rates_mut() {
        rates.take(&zero, &zero);
    }
    system.set_laws(window);
}

/// The residual of some terms, by dof in the axes of the scene: the rows of this rank.
fn sum(system: &System, u: &[f64], wanted: &dyn Fn(&AssembledTerm) -> bool) -> Result<Vec<f64>, SystemError> {
    let mut out = vec![0.0; system.numbering.n_dofs];
    for k in (0..system.terms.len()).filter(|k| wanted(&system.terms[*k])) {
        system.term_residual(k, u, &mut out)?;
    }
    Ok(out)
}

/// By field with second rates its number, and that of its components.
fn rated(system: &System) -> Vec<(usize, usize)> {
    let fields = system.rates().into_iter().flat_map(Rates::fields).filter(|of| of.form == RateForm::Second);
    fields.map(|of| (of.field, system.fields[of.field].n_components)).collect()
}

/// The sums of rows of the derivative of some terms in a rate: calls `f` with the field and the component that the rate is 1
/// in, and the difference by dof in the axes of the scene.
fn row_sums(
    system: &mut System,
    u: &[f64],
    window: Window,
    order: RateOrder,
    mut f: impl FnMut(&System, usize, usize, &[f64]),
) -> Result<(), SystemError> {
    let wanted = |t: &AssembledTerm| reads(t, order) && t.law.class <= Class::Linear;
    if !system.terms.iter().any(wanted) {
        return Ok(());
    }
    rest(system, window);
    let without = sum(system, u, &wanted)?;
    for (field, n) in rated(system) {
        for component in 0..n {
            set_rate(system, order, field, Some(component), window);
            let mut with = sum(system, u, &wanted)?;
            with.iter_mut().zip(&without).for_each(|(a, b)| *a -= b);
            f(system, field, component, &with);
        }
    }
    rest(system, window);
    Ok(())
}

/// A rate that the diagonal is found with: one in a component of a field.
#[derive(Clone, Debug)]
pub struct Probe {
    /// The rate by dof.
    pub rate: Vec<f64>,
    /// Its order.
    pub order: RateOrder,
    /// By dof what a row counts with: 0 where it does not.
    pub signs: Vec<f64>,
    /// The terms that count.
    pub terms: Vec<usize>,
}

impl Lumped {
    /// All rates that this diagonal was found with, at the state `u` and a value of the step variable. The rates of the system
    /// are left zero.
    ///
    /// # Errors
    /// [`SystemError`] where the system cannot be evaluated at `u`.
    pub fn probes(&self, system: &mut System, u: &[f64], window: Window) -> Result<Vec<Probe>, SystemError> {
        let mut made = Vec::new();
        for order in [RateOrder::Second, RateOrder::First] {
            let wanted = |t: &AssembledTerm| reads(t, order) && t.law.class <= Class::Linear;
            let terms: Vec<usize> = (0..system.terms.len()).filter(|k| wanted(&system.terms[*k])).collect();
            row_sums(system, u, window, order, |system, field, component, sums| {
                let (stride, n) = (system.fields[field].n_components, sums.len());
                let range = system.range(field).expect("a field with rates is solved for");
                let own: Vec<bool> =
                    (0..n).map(|d| range.contains(&d) && (d - range.start) % stride == component).collect();
                let sign = |d: usize| match order {
                    RateOrder::Second => f64::from(u8::from(own[d])),
                    RateOrder::First if self.damping[d] <= 0.0 || sums[d] == 0.0 => 0.0,
                    RateOrder::First => {
                        if own[d] {
                            1.0
                        } else {
                            sums[d].signum()
                        }
                    }
                };
                let rate = own.iter().map(|own| f64::from(u8::from(*own))).collect();
                made.push(Probe { rate, order, signs: (0..n).map(sign).collect(), terms: terms.clone() });
            })?;
        }
        Ok(made)
    }
}

fn mass(system: &mut System, u: &[f64], window: Window) -> Result<Vec<f64>, Unlumped> {
    let mut all = vec![0.0; system.numbering.n_dofs];
    // the field whose inertia acts elsewhere, and a dof there
    let mut coupled = None;
    row_sums(system, u, window, RateOrder::Second, |system, field, component, sums| {
        let is_own = own(system, field, component);
        (0..sums.len()).filter(|d| is_own(*d)).for_each(|d| all[d] += sums[d]);
        coupled = coupled.or_else(|| beside(sums, &is_own).map(|d| (field, d)));
    })?;
    let name = |field: usize| system.fields[field].name.clone();
    if let Some((field, on)) = coupled {
        return Err(Unlumped::Coupled { field: name(field), on: name(system.field_of(on)) });
    }
    // masses that differ by component couple directions that are no axes
    let is_mixed = |frame: &&Frame| {
        let own = &all[frame.first..][..frame.axes.len()];
        let spread = largest(own.iter().map(|m| m - own[0]));
        let turned = frame.axes.iter().flatten().any(|x| *x != 0.0 && x.abs() < 1.0 - ROUNDED);
        turned && spread > ROUNDED * largest(own.iter().copied())
    };
    if let Some(frame) = system.numbering.frames.list().iter().find(is_mixed) {
        let field = name(system.field_of(frame.first));
        return Err(Unlumped::Coupled { on: field.clone(), field });
    }
    Ok(in_frames(system, all))
}

/// The damping on the diagonal, and whether it acts between components or fields.
fn damping(system: &mut System, u: &[f64], window: Window) -> Result<(Vec<f64>, bool), SystemError> {
    let mut all = vec![0.0; system.numbering.n_dofs];
    let mut couples = false;
    row_sums(system, u, window, RateOrder::First, |system, field, component, sums| {
        let is_own = own(system, field, component);
        for (d, value) in sums.iter().enumerate() {
            all[d] += if is_own(d) { *value } else { value.abs() };
        }
        couples |= beside(sums, &is_own).is_some();
    })?;
    let couples = !system.team().all(!couples);
    // damping that is negative as a whole stays where the term puts it
    all.iter_mut().for_each(|c| *c = c.max(0.0));
    Ok((in_frames(system, all), couples))
}

/// Whether a dof is one of a component of a field.
fn own(system: &System, field: usize, component: usize) -> impl Fn(usize) -> bool + use<> {
    let stride = system.fields[field].n_components;
    let range = system.range(field).expect("a field with rates is solved for");
    move |d| range.contains(&d) && (d - range.start) % stride == component
}

/// Of sums of rows one that is more than rounding and none of the component's own.
fn beside(sums: &[f64], is_own: &impl Fn(usize) -> bool) -> Option<usize> {
    let rounding = ROUNDED * largest(sums.iter().copied());
    (0..sums.len()).find(|d| !is_own(*d) && sums[*d].abs() > rounding)
}

/// A diagonal in the axes of the scene on the axes of local frames, followers added to their leaders.
fn in_frames(system: &System, mut diagonal: Vec<f64>) -> Vec<f64> {
    let numbering = &system.numbering;
    for frame in numbering.frames.list() {
        let own = diagonal[frame.first..][..frame.axes.len()].to_vec();
        for (k, axis) in frame.axes.iter().enumerate() {
            diagonal[frame.first + k] = axis.iter().zip(&own).map(|(a, m)| a * a * m).sum();
        }
    }
    for tie in numbering.ties() {
        diagonal[tie.leader] += diagonal[tie.follower];
    }
    system.update_copies(&mut diagonal);
    diagonal
}

/// The derivative of the equations in the unknowns, or in the velocities without what steps solve for.
pub(crate) struct Operator {
    /// That of the terms that are not linear, over the free dofs.
    changing: Csr,
    /// The linear terms where nothing has moved and nothing moves, by dof in the axes of the scene: the rows of this rank.
    at_rest: Vec<f64>,
    /// Of the velocities.
    of_rates: bool,
    /// Linear terms count.
    linear: bool,
}

impl Operator {
    fn stiffness(system: &mut System, u: &[f64], window: Window) -> Result<Self, SystemError> {
        Self::of(system, u, window, [false, true])
    }

    /// The damping that acts half a step late.
    fn lagging(lumped: &Lumped, system: &mut System, u: &[f64], window: Window) -> Result<Self, SystemError> {
        Self::of(system, u, window, [true, !lumped.couples])
    }

    /// The damping of linear terms beside the diagonal. The rates of the system are left zero.
    pub(crate) fn linear_damping(system: &mut System, window: Window) -> Result<Self, SystemError> {
        rest(system, window);
        let changing = system.new_tangent().changing;
        let mut this = Self { changing, at_rest: Vec::new(), of_rates: true, linear: true };
        this.at_rest = this.linear(system, &vec![0.0; system.numbering.n_dofs])?;
        Ok(this)
    }

    fn of(system: &mut System, u: &[f64], window: Window, [of_rates, linear]: [bool; 2]) -> Result<Self, SystemError> {
        rest(system, window);
        let mut tangent = system.new_tangent();
        system.tangent(u, Branches::AsWritten, &mut tangent)?;
        let mut changing = tangent.changing;
        if of_rates {
            // with the velocity factor 1 the derivative has both parts
            if let Some(rates) = system.rates_mut() {
                rates.probe(RateFactors { velocity: 1.0, ..RateFactors::default() });
            }
            system.set_laws(window);
            let mut moving = system.new_tangent();
            system.tangent(u, Branches::AsWritten, &mut moving)?;
            let mut moving = moving.changing;
            moving.values_mut().iter_mut().zip(changing.values()).for_each(|(a, b)| *a -= b);
            changing = moving;
            rest(system, window);
        }
        let mut this = Self { changing, at_rest: Vec::new(), of_rates, linear };
        this.at_rest = this.linear(system, &vec![0.0; system.numbering.n_dofs])?;
        Ok(this)
    }

    /// True if no term has it.
    fn is_nothing(&self, system: &System) -> bool {
        let is_zero = self.changing.values().iter().all(|v| *v == 0.0);
        system.team().all(is_zero) && !system.terms.iter().any(|t| self.takes(t))
    }

    fn takes(&self, term: &AssembledTerm) -> bool {
        self.linear && term.law.class <= Class::Linear && (!self.of_rates || reads(term, RateOrder::First))
    }

    /// The linear terms at displacements, or velocities, by dof in the axes of the scene.
    fn linear(&self, system: &mut System, moved: &[f64]) -> Result<Vec<f64>, SystemError> {
        let zero = vec![0.0; moved.len()];
        if !self.of_rates {
            return sum(system, moved, &|t| self.takes(t));
        }
        let take = |system: &mut System, first: &[f64]| {
            if let Some(rates) = system.rates_mut() {
                rates.take(first, &zero);
            }
        };
        take(system, moved);
        let found = sum(system, &zero, &|t| self.takes(t));
        take(system, &zero);
        found
    }

    /// What accelerations of prescribed dofs, by dof in the axes of the scene, are multiplied by, over the free dofs.
    pub(crate) fn of_prescribed(&self, system: &mut System, moved: &[f64]) -> Result<Vec<f64>, SystemError> {
        let mut all = self.linear(system, moved)?;
        all.iter_mut().zip(&self.at_rest).for_each(|(a, b)| *a -= b);
        system.numbering.turn(&mut all);
        let mut y = Vec::new();
        system.numbering.gather(&all, &mut y);
        if let Some(owners) = system.owners() {
            owners.update(&mut y);
        }
        Ok(y)
    }

    /// The operator times a vector over the free dofs.
    pub(crate) fn apply(&self, system: &mut System, lumped: &Lumped, x: &[f64]) -> Result<Vec<f64>, SystemError> {
        let zero = vec![0.0; system.numbering.n_dofs];
        let mut moved = zero.clone();
        system.numbering.advance(&zero, x, 1.0, &mut moved);
        let mut all = self.linear(system, &moved)?;
        all.iter_mut().zip(&self.at_rest).for_each(|(a, b)| *a -= b);
        let numbering = &system.numbering;
        numbering.turn(&mut all);
        let mut y = Vec::new();
        numbering.gather(&all, &mut y);
        self.changing.multiply_add(x, &mut y, rayon::current_num_threads());
        // of several ranks each has found its rows
        if let Some(owners) = system.owners() {
            owners.update(&mut y);
        }
        if self.of_rates && self.linear {
            for ((y, x), d) in y.iter_mut().zip(x).zip(&numbering.free_dofs) {
                *y -= lumped.damping[*d as usize] * x;
            }
        }
        Ok(y)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A vector of length 1 with a part in every direction, the same in every run.
fn start_vector(n: usize) -> Vec<f64> {
    let mut word = 0x9e37_79b9_7f4a_7c15u64;
    let mut next = || {
        word ^= word << 13;
        word ^= word >> 7;
        word ^= word << 17;
        #[expect(clippy::cast_precision_loss, reason = "53 bits")]
        let x = (word >> 11) as f64 / (1u64 << 53) as f64;
        x - 0.5
    };
    let mut v: Vec<f64> = (0..n).map(|_| next()).collect();
    let size = dot(&v, &v).sqrt();
    v.iter_mut().for_each(|x| *x /= size);
    v
}

/// The largest eigenvalue of a symmetric tridiagonal matrix, and the size of the last entry of its unit eigenvector.
fn largest_of_tridiagonal(diagonal: &[f64], beside: &[f64]) -> (f64, f64) {
    let n = diagonal.len();
    let off = |k: usize| if k == 0 { 0.0 } else { beside[k - 1].abs() };
    let radius = |k: usize| off(k) + beside.get(k).map_or(0.0, |b| b.abs());
    let disc = |sign: f64| (0..n).map(move |k| diagonal[k] + sign * radius(k));
    let (mut low, mut high) = (disc(-1.0).fold(f64::INFINITY, f64::min), disc(1.0).fold(f64::NEG_INFINITY, f64::max));
    // all eigenvalues lie below x where the pivots of x - T are positive
    let is_above = |x: f64| {
        let mut pivot = 1.0;
        (0..n).all(|k| {
            pivot = x - diagonal[k] - if k == 0 { 0.0 } else { off(k) * off(k) / pivot };
            pivot > 0.0
        })
    };
    while high - low > 4.0 * f64::EPSILON * high.abs().max(low.abs()) {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if is_above(middle) { high = middle } else { low = middle }
    }
    // of the eigenvector each entry follows from the two before it; the last row closes it
    let mut vector = vec![1.0; n];
    for k in 1..n {
        let before = if k > 1 { off(k - 1) * vector[k - 2] } else { 0.0 };
        vector[k] = ((high - diagonal[k - 1]) * vector[k - 1] - before) / off(k);
        if vector[k].abs() > 1e100 {
            vector[..=k].iter_mut().for_each(|x| *x *= 1e-100);
        }
    }
    let size = dot(&vector, &vector).sqrt();
    (high, vector[n - 1].abs() / size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_eigenvalue_of_a_tridiagonal_matrix_has_its_closed_form() {
        // second differences of n points: 2 - 2 cos(pi k/(n + 1)), with the eigenvector sin(pi k j/(n + 1))
        for n in [1usize, 2, 5, 40] {
            let (value, end) = largest_of_tridiagonal(&vec![2.0; n], &vec![-1.0; n - 1]);
            #[expect(clippy::cast_precision_loss, reason = "small")]
            let angle = std::f64::consts::PI * n as f64 / (n as f64 + 1.0);
            assert!((value - (2.0 - 2.0 * angle.cos())).abs() < 1e-13, "{n}: {value}");
            #[expect(clippy::cast_precision_loss, reason = "small")]
            let entry = (2.0 / (n as f64 + 1.0)).sqrt() * (angle * n as f64).sin().abs();
            assert!((end - entry).abs() < 1e-6, "{n}: {end} {entry}");
        }
    }
}
