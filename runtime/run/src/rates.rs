//! Rates over a run: where time starts, in a step, at its end.
//!
//! Where time starts, first rates are those of `start Dot_u`, and prescribed values bring their own. The highest rates
//! follow from the equations: with M their derivative in the highest rates and R the residual without them, M a = -R
//! over the free unknowns, multipliers included. Promises: a scene without such rates is left alone.

use wfl_compiler::types::RateForm;
use wfl_discrete::{
    finite::BadGiven,
    rates::{RateFactors, Rates},
    system::{ActiveSet, Branches, FIXED, Form, System, SystemError},
    window::Window,
};
use wfl_newton::NewtonError;
use wfl_problem::{Explicit, Solving, node_positions};
use wfl_sparse::{
    csr::Csr,
    solve::{CheckedLlt, CheckedLu, LinearSolver, SolverOptions, Symmetry},
};

/// How equations are solved.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum As {
    /// As they are: what the unknowns do when something moves.
    Written,
    /// Transposed: what a result follows.
    Transposed,
}

/// One-sided differences of five values of equal distance, times 12 and the distance: the first derivative.
const FIRST: [f64; 5] = [-25.0, 48.0, -36.0, 16.0, -3.0];
/// The same times 12 and the square of the distance: the second derivative.
const SECOND: [f64; 5] = [35.0, -104.0, 114.0, -56.0, 11.0];
/// The rates are weighted by 2^(2 * this) in units of the first increment, so that of constraints on them only what multiplies
/// them is left in double precision.
const WEIGHT: i32 = 40;
/// What an equation without rates says of multipliers themselves counts so much more than what it says of the motion, in the units of
/// what they do to the rates it holds. Half of the digits: where it says nothing along some direction, as along the normal of closed
/// contact in axes that are others, its rounding must leave that to the motion.
const OF_VALUES: f64 = 67_108_864.0;

/// Begins the rates of a step; gives it with the stage at which its equations stand.
pub(super) fn enter(scene: &mut Solving<'_>, window: Window) -> Window {
    if let Some(rates) = scene.system.rates_mut() {
        // steps that another run has chosen have its orders
        let given = scene.scene.steps.orders.iter().find(|(value, _)| value.to_bits() == window.end.to_bits());
        given.iter().for_each(|(_, order)| rates.take_order(*order));
    }
    scene.system.begin_rates(window.increment);
    window.with_offset(offset(scene))
}

/// How far before its end the equations of a step stand, as a part of it.
pub(super) fn offset(scene: &Solving<'_>) -> f64 {
    scene.system.rates().map_or(0.0, |r| r.scheme().offset())
}

/// Writes the prescribed values of a step into `u`, which holds the state at its start or a first guess, and gives what is
/// driven by them its rates. Where the equations stand within the step, fields with rates are prescribed so that they have
/// their values at its end.
pub(super) fn prescribe(scene: &mut Solving<'_>, window: Window, u: &mut [f64]) -> Result<(), BadGiven> {
    let offset = offset(scene);
    let mut applied = Ok(());
    if offset != 0.0 {
        let mut with_rates = u.to_vec();
        applied = scene.prescribed.apply(window.at_end(), &mut with_rates);
        let past = scene.system.past().expect("rates read the past");
        scene.system.numbering.part_of_prescribed(&past.unknowns, 1.0 - offset, &mut with_rates);
        scene.system.numbering.follow(&mut with_rates);
        applied = applied.and_then(|()| scene.prescribed.apply(window, u));
        for of in scene.system.rates().into_iter().flat_map(Rates::fields) {
            u[of.dofs.clone()].copy_from_slice(&with_rates[of.dofs.clone()]);
        }
    } else {
        applied = applied.and_then(|()| scene.prescribed.apply(window, u));
    }
    agreed(scene.system, applied, u)?;
    if let Some((rates, past)) = scene.system.rates_and_past() {
        rates.drive(u, &past.unknowns);
    }
    Ok(())
}

/// What all ranks make of prescribed values: of a part of the mesh those of its copies come from their owners, which have
/// all faces around them.
fn agreed(system: &System, applied: Result<(), BadGiven>, u: &mut [f64]) -> Result<(), BadGiven> {
    let team = system.mesh.holders();
    if team.is_alone() {
        return applied;
    }
    BadGiven::agreed(applied, team)?;
    system.update_copies(u);
    Ok(())
}

/// The state at the end of a step whose equations were solved: `u` moves there from where they stand.
pub(super) fn leave(scene: &mut Solving<'_>, window: Window, u: &mut [f64]) -> Result<(), SystemError> {
    if !scene.system.rates().is_some_and(Rates::change_at_end) {
        return Ok(());
    }
    if let Some((rates, past)) = scene.system.rates_and_past() {
        rates.finish(u, &past.unknowns);
    }
    scene.set_data(window.at_end())
}

/// The rates where time starts, at the state `u`, with the increment of the first step.
pub(super) fn start(scene: &mut Solving<'_>, u: &[f64], at: Window) -> Result<(), NewtonError> {
    let most = scene.system.rates().map_or(0, |rates| rates.scheme().most_order(RateForm::First));
    let of_a_list = scene.steps.are_listed();
    let begins_with_rates = most > 2 && of_a_list;
    if !scene.system.rates().is_some_and(|rates| rates.are_read_at_start(of_a_list)) {
        return Ok(());
    }
    let given = |bad: BadGiven| NewtonError::Given(Box::new(bad));
    let mut first = vec![0.0; u.len()];
    for (field, value) in &scene.scene.start_rates {
        let positions = node_positions(scene.system, *field);
        let values = value.at(&positions, Window::instant(at.end)).map_err(given)?;
        if let Some(start) = scene.system.numbering.starts[*field] {
            first[start..start + values.len()].copy_from_slice(&values);
        }
    }
    let [of_first, of_second] = prescribed_rates(scene, u, at).map_err(given)?;
    let numbering = &scene.system.numbering;
    let mut second = vec![0.0; u.len()];
    for (rate, prescribed) in [(&mut first, of_first), (&mut second, of_second)] {
        let mut prescribed = prescribed;
        [&mut *rate, &mut prescribed].into_iter().for_each(|v| numbering.frames.turn(v));
        for (x, (p, _)) in rate.iter_mut().zip(prescribed.iter().zip(&numbering.free)).filter(|(_, f)| *f.1 == FIXED) {
            *x = *p;
        }
        numbering.frames.turn_back(rate);
        numbering.follow(rate);
    }
    keep(scene, &first, &second);
    let (highest, all_known) = match scene.explicit.clone() {
        Some(explicit) => (highest_by_diagonal(scene, &explicit, u, at, [&first, &second])?, true),
        None => highest(scene, u, at, [&first, &second])?,
    };
    let form_of = |scene: &Solving<'_>, form| {
        let rates = scene.system.rates().into_iter().flat_map(Rates::fields);
        rates.filter(|f| f.form == form).flat_map(|f| f.dofs.clone()).collect::<Vec<_>>()
    };
    form_of(scene, RateForm::First).into_iter().for_each(|d| first[d] = highest[d]);
    form_of(scene, RateForm::Second).into_iter().for_each(|d| second[d] = highest[d]);
    keep(scene, &first, &second);
    if let Some(rates) = scene.system.rates_mut() {
        let keeps_errors = rates.scheme().keeps_errors_of_given();
        if begins_with_rates && all_known {
            rates.begin_with_rates();
        } else if rates.are_driven() && (all_known || keeps_errors) {
            rates.begin_driven(&first, &second, at.increment);
        }
    }
    Ok(())
}

/// Takes rates by dof as those at the start.
fn keep(scene: &mut Solving<'_>, first: &[f64], second: &[f64]) {
    if let Some(rates) = scene.system.rates_mut() {
        rates.take(first, second);
    }
}

/// First and second derivatives of the prescribed values in the step variable, by dof; zero where nothing is prescribed.
/// Five values within the first step give them with an error of the fourth and third power of the increment.
fn prescribed_rates(scene: &mut Solving<'_>, u: &[f64], at: Window) -> Result<[Vec<f64>; 2], BadGiven> {
    let distance = 0.25 * at.increment;
    let (mut first, mut second) = (vec![0.0; u.len()], vec![0.0; u.len()]);
    let mut here = u.to_vec();
    scene.prescribed.apply(Window::new(at.end, distance), &mut here)?;
    for (k, (a, b)) in (0u32..).zip(FIRST.iter().zip(&SECOND)).skip(1) {
        let mut there = u.to_vec();
        scene.prescribed.apply(Window::new(at.end + f64::from(k) * distance, distance), &mut there)?;
        for (d, (x, y)) in there.iter().zip(&here).enumerate() {
            first[d] += a * (x - y) / (12.0 * distance);
            second[d] += b * (x - y) / (12.0 * distance * distance);
        }
    }
    Ok([first, second])
}

/// What rates of prescribed values are made of where time starts, which `at` ends with the increment of the first step: by
/// value the step that its formula sees, and its factors in the first and in the second rate.
#[must_use]
pub fn prescribed_differences(at: Window) -> Vec<(Window, f64, f64)> {
    let distance = 0.25 * at.increment;
    let of = |k: u32, a: f64, b: f64| {
        let window = Window::new(at.end + f64::from(k) * distance, distance);
        (window, a / (12.0 * distance), b / (12.0 * distance * distance))
    };
    (0u32..).zip(FIRST.iter().zip(&SECOND)).map(|(k, (a, b))| of(k, *a, *b)).collect()
}

/// The highest rate of each dof of a field with rates, from the equations with the other rates as they are kept; those
/// that are prescribed stay. Behind them whether the equations say something of each.
fn highest(
    scene: &mut Solving<'_>,
    u: &[f64],
    at: Window,
    known: [&[f64]; 2],
) -> Result<(Vec<f64>, bool), NewtonError> {
    let (mass, [first, second]) = settled(scene, u, at, known)?;
    let mut out = vec![0.0; u.len()];
    for of in scene.system.rates().into_iter().flat_map(Rates::fields) {
        let from = if of.form == RateForm::Second { &second } else { &first };
        out[of.dofs.clone()].copy_from_slice(&from[of.dofs.clone()]);
    }
    Ok((out, !mass.leaves_some_out()))
}

/// How often contact may change where time starts: each change is a factor, and a few rings of points change at most.
const MOST_CHANGES: usize = 30;
/// A part of the first increment in which rates lead to the motion that is looked at.
const JUST_BEHIND: f64 = 1.0 / 1024.0;
/// The part of that motion, and of the change of the multipliers with it, by which points leave a kink that they stand on: far above
/// rounding, and so little that no other point reaches one.
const HARDLY: f64 = 1.0 / 1_048_576.0;

/// The mass, and the rates with what the equations make of the highest ones: a Newton iteration over the rates and the
/// multipliers, of known ones. Where points of contact touch without a force, or are open within the bound of friction zero,
/// the law as it is written holds them; its branches are those just behind the start.
fn settled(
    scene: &mut Solving<'_>,
    u: &[f64],
    at: Window,
    known: [&[f64]; 2],
) -> Result<(Mass, [Vec<f64>; 2]), NewtonError> {
    let mut set: Option<ActiveSet> = None;
    let mut changes = 0;
    loop {
        let branches = set.as_ref().map_or(Branches::AsWritten, Branches::Frozen);
        let held = tangent(scene, u, at, branches)?;
        let residual = scene.system.residual(u, &Form { branches, ..Form::AS_WRITTEN })?;
        let mut rhs = Vec::new();
        scene.system.numbering.gather(&residual.values, &mut rhs);
        // each rank solves the whole system: the others have their rows, and zeros in those of this one
        scene.system.team().sum(&mut rhs);
        rhs.iter_mut().for_each(|r| *r = -*r);
        let mass = mass(scene, u, at, &held, branches)?;
        let found = match mass.changes(&rhs, As::Written) {
            Ok(found) => found,
            // rounding may hold some components of points without a force and let others go
            Err(failed) if set.is_none() && !scene.contact.is_empty() && !failed.ends_the_run() => {
                set = Some(scene.contact.opened());
                continue;
            }
            Err(failed) => return Err(failed),
        };
        let time = JUST_BEHIND * at.increment;
        let (mut rates, ahead_of_it) = ahead(scene.system, [u, known[0], known[1]], &mass, &found, time);
        if mass.leaves_some_out() {
            rates = ahead(scene.system, [u, known[0], known[1]], &mass, &mass.of_masses(&found), time).0;
        }
        if scene.contact.is_empty() {
            return Ok((mass, rates));
        }
        let next = branches_ahead(scene, at, &ahead_of_it);
        let stays = match &set {
            Some(set) => *set == next,
            None => tangent(scene, u, at, Branches::Frozen(&next))?.values() == held.values(),
        };
        // ranks go on together
        if scene.system.team().all(stays) {
            return Ok((mass, rates));
        }
        set = Some(next);
        changes += 1;
        if changes > MOST_CHANGES {
            return Err(NewtonError::Unsettled);
        }
    }
}

/// The branches at a state just behind the start. Rates there are known by their sign alone: the change on the way to it has the weight
/// that rates have beside all else, and what slips or opens at all does so.
fn branches_ahead(scene: &mut Solving<'_>, at: Window, ahead: &[f64]) -> ActiveSet {
    let [weight, _] = weight_and_root(at);
    let held = scene.system.step();
    scene.contact.begin_step(at.with_rates(RateFactors { rate: weight, velocity: 0.0, acceleration: weight }));
    let found = scene.contact.written_at(scene.system, ahead);
    scene.contact.begin_step(held);
    found
}

/// What rates are weighted by, and its root, in a first step.
fn weight_and_root(at: Window) -> [f64; 2] {
    #[expect(clippy::cast_possible_truncation, reason = "an exponent")]
    let exponent = WEIGHT - at.increment.abs().log2().floor() as i32;
    [2 * exponent, exponent].map(|exponent| 2.0f64.powi(exponent))
}

/// First and second rates with a change of the highest ones, and a state on the way that they lead, with the multipliers that
/// go with them.
fn ahead(
    system: &System,
    [u, first, second]: [&[f64]; 3],
    mass: &Mass,
    found: &[f64],
    time: f64,
) -> ([Vec<f64>; 2], Vec<f64>) {
    let part = |of_rates: bool| -> Vec<f64> {
        found.iter().zip(&mass.rated).map(|(x, rated)| if *rated == of_rates { *x } else { 0.0 }).collect()
    };
    let [mut first, mut second] = [first, second].map(<[f64]>::to_vec);
    let mut behind = u.to_vec();
    system.numbering.advance(u, &part(false), 1.0, &mut behind);
    let of_rates = part(true);
    for of in system.rates().into_iter().flat_map(Rates::fields) {
        let highest = if of.form == RateForm::Second { &mut second } else { &mut first };
        let before = highest.clone();
        let mut all = before.clone();
        system.numbering.advance(&before, &of_rates, 1.0, &mut all);
        highest[of.dofs.clone()].copy_from_slice(&all[of.dofs.clone()]);
        for d in of.dofs.clone() {
            behind[d] = u[d] + time * (first[d] + 0.5 * time * second[d]);
        }
    }
    behind.iter_mut().zip(u).for_each(|(x, start)| *x = start + HARDLY * (*x - start));
    ([first, second], behind)
}

/// What the equations multiply the highest rates by where time starts, over the free unknowns.
pub struct Mass {
    /// Rows and columns scaled; dofs without mass have one on the diagonal, and beside it multipliers alone.
    matrix: Csr,
    scale: Vec<f64>,
    /// By free number what forces are multiplied by beside it: of what has no rate how much more its values count.
    factors: Vec<f64>,
    rated: Vec<bool>,
    massless: Vec<bool>,
    /// Dofs without mass whose equation says what a multiplier is.
    meets_multiplier: Vec<bool>,
    root: f64,
    symmetry: Symmetry,
}

impl Mass {
    /// The highest rates of forces, by free number; zero for what has no rate or no mass.
    ///
    /// # Errors
    /// [`NewtonError`] where the matrix of the masses cannot be solved.
    pub fn rates(&self, forces: &[f64], form: As) -> Result<Vec<f64>, NewtonError> {
        // the rate of a dof without mass is none: nothing is given of it, and transposed nothing is asked
        let mut found = match form {
            As::Written => self.of_masses(&self.changes(forces, form)?),
            As::Transposed => self.changes(&self.of_masses(forces), form)?,
        };
        found.iter_mut().zip(&self.rated).filter(|(_, rated)| !**rated).for_each(|(x, _)| *x = 0.0);
        Ok(found)
    }

    /// The highest rates of forces, and what has none itself: multipliers.
    fn changes(&self, forces: &[f64], form: As) -> Result<Vec<f64>, NewtonError> {
        let Self { matrix, scale, factors, massless, root, symmetry, .. } = self;
        let counts = |k: usize| !massless[k] || self.meets_multiplier[k];
        let of = |(k, force): (usize, &f64)| if counts(k) { force * scale[k] * factors[k] } else { 0.0 };
        let rhs: Vec<f64> = forces.iter().enumerate().map(of).collect();
        let mut found = match (form, symmetry) {
            (As::Transposed, Symmetry::General) => mass_solution(&matrix.transpose(), *symmetry, &rhs)?,
            _ => mass_solution(matrix, *symmetry, &rhs)?,
        };
        found.iter_mut().for_each(|x| *x *= root);
        Ok(found)
    }

    /// The same, zero for dofs without mass.
    fn of_masses(&self, numbers: &[f64]) -> Vec<f64> {
        numbers.iter().zip(&self.massless).map(|(x, massless)| if *massless { 0.0 } else { *x }).collect()
    }

    /// True if the equations say nothing of the rate of some dof.
    #[must_use]
    pub fn leaves_some_out(&self) -> bool {
        self.massless.contains(&true)
    }
}

/// What the equations multiply the highest rates by at the state `u` where time starts, which `at` ends with the increment of
/// the first step.
///
/// # Errors
/// [`NewtonError`] where the equations cannot be assembled or solved there.
pub fn mass_at_start(scene: &mut Solving<'_>, u: &[f64], at: Window) -> Result<Mass, NewtonError> {
    if scene.contact.is_empty() {
        let held = tangent(scene, u, at, Branches::AsWritten)?;
        return mass(scene, u, at, &held, Branches::AsWritten);
    }
    // at the rates that were found nothing is left but the multipliers, which say where contact acts
    let mut known = [vec![0.0; u.len()], vec![0.0; u.len()]];
    for of in scene.system.rates().into_iter().flat_map(Rates::fields) {
        for (rates, kept) in known.iter_mut().zip(&of.kept).filter(|(_, kept)| !kept.is_empty()) {
            rates[of.dofs.clone()].copy_from_slice(kept);
        }
    }
    Ok(settled(scene, u, at, [&known[0], &known[1]])?.0)
}

/// From the tangent at rates that are held.
fn mass(
    scene: &mut Solving<'_>,
    u: &[f64],
    at: Window,
    held: &Csr,
    branches: Branches<'_>,
) -> Result<Mass, NewtonError> {
    let [weight, root] = weight_and_root(at);
    let own = scene.system.mass_over_free(u, branches)?;
    let of_rates = scene.system.whole(own).map_err(SystemError::from)?;
    let mut has_rate = vec![false; u.len()];
    for of in scene.system.rates().into_iter().flat_map(Rates::fields) {
        has_rate[of.dofs.clone()].fill(true);
    }
    let numbering = &scene.system.numbering;
    let rated: Vec<bool> = numbering.free_dofs.iter().map(|d| has_rate[*d as usize]).collect();
    // a dof without mass has no rate that the equations give: it stays at rest. Its equation says what a multiplier on it is, whose own
    // one may hold it
    let relieved = |k: usize| {
        let dof = numbering.free_dofs[k] as usize;
        scene.system.redistribution().is_some_and(|r| r.is_relieved(dof))
    };
    let without_mass = |k: usize| of_rates.get(k, k) == 0.0 || relieved(k);
    let massless: Vec<bool> = (0..rated.len()).map(|k| rated[k] && without_mass(k)).collect();
    let weighted = weighted(held, &of_rates, weight, &rated)?;
    let scale: Vec<f64> = rated.iter().map(|r| if *r { 1.0 / root } else { root }).collect();
    let symmetry = Symmetry::known(scene.system.is_symmetric() && rated.iter().all(|r| *r));
    let field_of = |k: usize| scene.system.field_of(numbering.free_dofs[k] as usize);
    let factors = factors_of_values(&weighted, &scale, [&massless, &rated], field_of);
    let matrix = scaled(&weighted, &scale, &factors, [&massless, &rated])?;
    // by the pattern: where contact is open nothing of the multiplier is left, and the force says where the dof goes
    let meets = |k: usize| massless[k] && weighted.row(k).0.iter().any(|c| !rated[*c as usize]);
    let meets_multiplier = (0..rated.len()).map(meets).collect();
    Ok(Mass { matrix, scale, factors, rated, massless, meets_multiplier, root, symmetry })
}

/// What the equations say of rates, which weigh so much, and beside it what they say of values where one of both has no rate: an
/// equation of motion says nothing of values where all of these are known.
fn weighted(held: &Csr, of_rates: &Csr, weight: f64, rated: &[bool]) -> Result<Csr, NewtonError> {
    let [mut values, mut rates] = [held, of_rates].map(Csr::clone);
    rates.values_mut().iter_mut().for_each(|value| *value *= weight);
    let pattern = values.pattern().clone();
    for row in (0..rated.len()).filter(|row| rated[*row]) {
        let range = pattern.row_starts()[row]..pattern.row_starts()[row + 1];
        let entries = values.values_mut()[range].iter_mut().zip(pattern.row(row));
        entries.filter(|(_, column)| rated[**column as usize]).for_each(|(value, _)| *value = 0.0);
    }
    Ok(values.plus(&rates).map_err(SystemError::from)?)
}

/// The accelerations with a mass on the diagonal; those that are prescribed stay.
fn highest_by_diagonal(
    scene: &mut Solving<'_>,
    explicit: &Explicit,
    u: &[f64],
    at: Window,
    known: [&[f64]; 2],
) -> Result<Vec<f64>, NewtonError> {
    let [first, second] = known;
    keep(scene, first, &vec![0.0; u.len()]);
    scene.system.set_laws(at);
    let (residual, _) = scene.system.residual_at_points(u)?;
    let numbering = &scene.system.numbering;
    let mut out = second.to_vec();
    numbering.frames.turn(&mut out);
    for d in (0..u.len()).filter(|d| numbering.free[*d] != FIXED) {
        out[d] = -residual[d] / explicit.lumped.mass[d];
    }
    numbering.frames.turn_back(&mut out);
    scene.system.update_copies(&mut out);
    numbering.follow(&mut out);
    Ok(out)
}

/// The whole tangent over the free unknowns at the present rates.
fn tangent(scene: &mut Solving<'_>, u: &[f64], at: Window, branches: Branches<'_>) -> Result<Csr, NewtonError> {
    scene.system.begin_step(at)?;
    scene.contact.begin_step(scene.system.step());
    let mut changing = scene.system.new_tangent();
    scene.system.tangent(u, branches, &mut changing)?;
    let own = scene.system.bulk().plus(&changing.changing).map_err(SystemError::from)?;
    Ok(scene.system.whole(own).map_err(SystemError::from)?)
}

/// By free number how much more the values of what has no rate count, one for all others: a number for each field, as an equation
/// along a direction is made of those of its components and of the nodes beside it.
fn factors_of_values(
    matrix: &Csr,
    scale: &[f64],
    [left_out, rated]: [&[bool]; 2],
    field_of: impl Fn(usize) -> usize,
) -> Vec<f64> {
    let n_fields = (0..rated.len()).map(&field_of).max().map_or(0, |last| last + 1);
    // by field the most motion that the values of an unknown make, in parts of what its equation says of values
    let mut most = vec![0.0f64; n_fields];
    for row in (0..matrix.n_rows()).filter(|row| !rated[*row]) {
        let (mut of_values, mut motion) = (0.0f64, 0.0);
        let (columns, values) = matrix.row(row);
        for (column, value) in columns.iter().zip(values) {
            let column = *column as usize;
            let scaled = scale[row] * value * scale[column];
            if !rated[column] {
                of_values = of_values.max(scaled.abs());
            } else if !left_out[column] {
                let back = scale[column] * matrix.get(column, row) * scale[row];
                motion += (scaled * back / (scale[column] * matrix.get(column, column) * scale[column])).abs();
            }
        }
        if of_values > 0.0 {
            let field = field_of(row);
            most[field] = most[field].max(motion / of_values);
        }
    }
    let of_field = |field: usize| {
        let factor = OF_VALUES * most[field];
        if factor.is_finite() && factor > 0.0 { factor.min(1.0) } else { 1.0 }
    };
    (0..rated.len()).map(|k| if rated[k] { 1.0 } else { of_field(field_of(k)) }).collect()
}

/// Rows and columns scaled. Dofs that are left out have one on the diagonal, and beside it what has no rate alone; what an equation
/// without rates says of values counts by its factor.
fn scaled(matrix: &Csr, scale: &[f64], factors: &[f64], [left_out, rated]: [&[bool]; 2]) -> Result<Csr, NewtonError> {
    let mut entries = Vec::new();
    for (row, number) in (0..matrix.n_rows()).zip(0u32..) {
        let (columns, values) = matrix.row(row);
        let is_kept = |column: usize| (!left_out[row] || !rated[column]) && (!left_out[column] || !rated[row]);
        if left_out[row] {
            entries.push((number, number, 1.0));
        }
        let kept = columns.iter().zip(values).filter(|(c, _)| is_kept(**c as usize));
        let factor = |column: usize| if rated[column] { 1.0 } else { factors[row] };
        let entry = |column: usize, value: f64| scale[row] * value * scale[column] * factor(column);
        entries.extend(kept.map(|(c, v)| (number, *c, entry(*c as usize, *v))));
    }
    let made = Csr::from_triplets(matrix.n_rows(), matrix.n_rows(), &entries);
    Ok(made.map_err(SystemError::from)?)
}

fn mass_solution(matrix: &Csr, symmetry: Symmetry, rhs: &[f64]) -> Result<Vec<f64>, NewtonError> {
    let mut x = vec![0.0; rhs.len()];
    if rhs.is_empty() {
        return Ok(x);
    }
    let options = SolverOptions { threads: rayon::current_num_threads(), ..SolverOptions::default() };
    let mut solver: Box<dyn LinearSolver> = if symmetry == Symmetry::Symmetric {
        Box::new(CheckedLlt::new(matrix.pattern(), None, options)?)
    } else {
        Box::new(CheckedLu::new(matrix.pattern(), None, options)?)
    };
    solver.factor(matrix)?;
    solver.solve(rhs, &mut x)?;
    Ok(x)
}
