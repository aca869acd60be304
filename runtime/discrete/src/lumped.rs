//! A system whose mass stands on the diagonal: the mass and the damping.
//!
//! The mass of a dof is the sum of its row of the mass matrix, found by its products ([`System::times_rates`]): with second rates
//! that are 1 in one component of one field and zero in all others they are the sums of the columns that belong to it. The damping
//! of a dof is found in the same way from the linear terms with `Dot_`; what couples it with other components and fields
//! counts with its size, so that the diagonal is never less than the matrix, and steps solve for the rest (`damping.rs`). Mass that
//! couples dofs of different components, fields or bodies is no diagonal: it is refused. Promises: no matrix is assembled. Steps
//! nothing.
//!
//! Source: T. J. R. Hughes, The Finite Element Method (1987), 7.3.2 for row sums.

use wfl_compiler::{
    Class,
    types::{FieldKind, FieldOp, InputSlot, RateForm, RateOrder, Side, UniformSlot},
};

use crate::{
    assemble::AssembledTerm,
    finite::largest,
    frames::Frame,
    rates::Rates,
    system::{Branches, FIXED, InRates, System, SystemError},
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

/// What is below this part of the largest number is rounding: a row that sums to zero, and what Lanczos' method has left of
/// a vector where the directions of the start are used up.
pub(crate) const ROUNDED: f64 = 1e-13;

/// Whether the inertia of a term is a matrix that stays: nothing in the term depends on unknowns beyond a linear law, or on
/// the step variable.
pub(crate) fn has_a_mass_of_its_own(term: &AssembledTerm) -> bool {
    let timed = |s: &UniformSlot| matches!(s, UniformSlot::Time | UniformSlot::TimeStep);
    term.law.class <= Class::Linear && !term.law.prologue.slots.iter().any(timed)
}

impl Lumped {
    /// The diagonal of a system at the state `u` and a step, whose increment terms may read.
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
    let inertia = |t: &AssembledTerm| t.law.reads_rates(RateOrder::Second);
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

/// No rates.
pub(crate) fn rest(system: &mut System, window: Window) {
    let zero = vec![0.0; system.numbering.n_dofs];
    if let Some(rates) = system.rates_mut() {
        rates.take(&zero, &zero);
    }
    system.set_laws(window);
}

/// The residual of some terms, by dof in the axes of the scene: the rows of this rank.
pub(crate) fn sum(
    system: &System,
    u: &[f64],
    wanted: &dyn Fn(&AssembledTerm) -> bool,
) -> Result<Vec<f64>, SystemError> {
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

/// The linear terms that read a rate of this order.
fn linear_terms_with(system: &System, order: RateOrder) -> Vec<usize> {
    let wanted = |t: &AssembledTerm| t.law.reads_rates(order) && t.law.class <= Class::Linear;
    (0..system.terms.len()).filter(|k| wanted(&system.terms[*k])).collect()
}

/// The sums of rows of the derivative of linear terms in a rate: calls `f` with the field and the component that the rate is 1
/// in, and the sums by dof in the axes of the scene.
fn row_sums(
    system: &mut System,
    u: &[f64],
    window: Window,
    order: RateOrder,
    mut f: impl FnMut(&System, usize, usize, &[f64]),
) -> Result<(), SystemError> {
    let terms = linear_terms_with(system, order);
    if terms.is_empty() {
        return Ok(());
    }
    system.set_laws(window);
    for (field, n) in rated(system) {
        for component in 0..n {
            let is_own = own(system, field, component);
            let one: Vec<f64> = (0..u.len()).map(|d| f64::from(u8::from(is_own(d)))).collect();
            let what = InRates { order, terms: &terms, at: u, branches: Branches::AsWritten };
            let sums = system.times_rates(what, &one)?;
            f(system, field, component, &sums);
        }
    }
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
    /// All rates that this diagonal was found with, at the state `u` and a value of the step variable.
    ///
    /// # Errors
    /// [`SystemError`] where the system cannot be evaluated at `u`.
    pub fn probes(&self, system: &mut System, u: &[f64], window: Window) -> Result<Vec<Probe>, SystemError> {
        let mut made = Vec::new();
        for order in [RateOrder::Second, RateOrder::First] {
            let terms = linear_terms_with(system, order);
            row_sums(system, u, window, order, |system, field, component, sums| {
                let (is_own, n) = (own(system, field, component), sums.len());
                let own: Vec<bool> = (0..n).map(is_own).collect();
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
    // each rank has seen its rows, and all end alike
    if !system.team().all(coupled.is_none()) {
        let first = || rated(system).first().map_or(0, |(field, _)| *field);
        let (field, on) = coupled.map_or_else(|| (first(), first()), |(field, d)| (field, system.field_of(d)));
        return Err(Unlumped::Coupled { field: name(field), on: name(on) });
    }
    // masses that differ by component couple directions that are no axes
    let is_mixed = |frame: &&Frame| {
        let own = &all[frame.first..][..frame.axes.len()];
        let spread = largest(own.iter().map(|m| m - own[0]));
        let turned = frame.axes.iter().flatten().any(|x| *x != 0.0 && x.abs() < 1.0 - ROUNDED);
        turned && spread > ROUNDED * largest(own.iter().copied())
    };
    let mixed = system.numbering.frames.list().iter().find(is_mixed);
    if !system.team().all(mixed.is_none()) {
        let field = name(mixed.map_or(0, |frame| system.field_of(frame.first)));
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
