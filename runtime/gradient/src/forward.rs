//! From the first step to the last one: a solution with the tangent for each step and direction of the parameters.

mod beginning;
mod explicit;
mod side;

use wfl::Diagnostic;
use wfl_discrete::{
    assemble::FieldValues,
    rates::{Kept, Rates},
    window::Window,
};
use wfl_problem::node_positions;
use wfl_run::{As, Passed, PassedStep};

use super::{
    Differentiated, Request, WantedResult, When,
    along::Along,
    beginning::{Beginning, parted},
    extended::{Extended, Live},
    formulas::Formulas,
    linear::Tangent,
    measures::{Asked, Direct, Summed, Weighed},
    near::{Kinks, NearKink, join},
    parameters::from_declared,
    refused::{self, not_made, number_between, other_size},
    shape,
    sided::Sided,
    standing::{self, AGREEMENT, Ends, Standing},
};

/// What parameters and data fields move by.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Direction {
    /// By parameter its entries, first index fastest.
    pub parameters: Vec<(String, Vec<f64>)>,
    /// By data field its values: `[node * components + component]`.
    pub fields: Vec<(String, Vec<f64>)>,
}

/// By direction, measure and step the derivative of that measure at that step.
pub type Moved = Vec<Vec<Vec<f64>>>;

/// What measures do along directions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tangents {
    /// The step variable at the end of each step.
    pub times: Vec<f64>,
    /// Their derivatives.
    pub moved: Moved,
    /// Points between two branches, each of which counts with the one that it is on.
    pub near: Vec<NearKink>,
    /// What else there is to know of them, in words.
    pub notes: Vec<String>,
    /// Solutions with a tangent.
    pub solutions: usize,
    /// Factorisations of one.
    pub factorisations: usize,
    /// Steps that were computed again to keep to a bound of memory.
    pub steps_again: usize,
    /// Seconds that they took.
    pub seconds: f64,
}

/// Measures at all steps, in what the directions move.
pub(super) fn request(measures: &[String], directions: &[Direction]) -> Request {
    let result = |name: &String| WantedResult { name: name.clone(), measure: name.clone(), when: When::Sum };
    let mut made = Request { results: measures.iter().map(result).collect(), ..Request::default() };
    for direction in directions {
        for (list, names) in [(&mut made.parameters, &direction.parameters), (&mut made.fields, &direction.fields)] {
            names.iter().for_each(|(name, _)| {
                if !list.contains(name) {
                    list.push(name.clone());
                }
            });
        }
    }
    made
}

/// What fields move by.
#[derive(Clone, Default)]
struct Motion {
    /// By dof, in the axes of the scene.
    u: Vec<f64>,
    /// By field that is not solved for.
    known: Vec<Vec<f64>>,
    /// Of rates.
    kept: Kept,
}

/// A direction on its way through the steps.
#[derive(Clone, Default)]
struct Moving {
    /// By entry of the parameters that change.
    live: Vec<f64>,
    /// By data field that moves on its own what it moves by.
    fields: Vec<(usize, Vec<f64>)>,
    /// At the end of the step before, and of this one.
    before: Motion,
    end: Motion,
    /// What the equations of this step are off by, by dof in local frames: zero but where values are prescribed.
    rows: Vec<f64>,
    /// The rates of the step, and behind them those of what the fields move by; nothing in a scene without.
    rates: Option<Rates>,
    /// What mass and damping of explicit steps move by, by dof.
    mass: Vec<f64>,
    damping: Vec<f64>,
}

/// The run, forwards.
struct Forwards<'a, 's> {
    of: Differentiated<'a>,
    extended: &'a Extended<'a>,
    laws: Along,
    formulas: Formulas,
    standing: Standing<'a, 's>,
    tangent: Tangent,
    /// For derivatives to one side.
    sided: Option<Sided>,
    /// Points of the equations of this step are between two branches, and directions decide on which of them they are.
    decides: bool,
    /// What there is to tell of them.
    told: Vec<String>,
    /// A direction in which nothing moves but the unknowns at the end of a step.
    still: Moving,
    /// The vector of the equations, behind which others have their place.
    out: Vec<f64>,
}

/// Which derivatives are taken where points stand between two branches.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Derivative {
    /// Those that are the same on both sides.
    TwoSided,
    /// Those to the side that the direction leads to.
    OneSided,
}

/// What the measures of a request do along directions.
pub(super) fn solve(
    of: Differentiated<'_>,
    request: &Request,
    live: &[Live],
    directions: &[Direction],
    derivative: Derivative,
) -> Result<Tangents, Box<Diagnostic>> {
    let Differentiated { scene, script, outcome, backend, .. } = of;
    refused::places(script, live)?;
    let (trajectory, ends) = standing::of_run(outcome)?;
    let times: Vec<f64> = ends.keys().map(|n| trajectory.steps[*n].window.end).collect();
    let mut equations = outcome.equations.clone();
    let mut standing = Standing::new((of, trajectory), scene.solving(&mut equations));
    let extended = Extended::new(scene, script, live.to_vec());
    let mut extended = extended.map_err(|e| not_made(&e.to_string()))?;
    if derivative == Derivative::OneSided && extended.has_motion() {
        return Err(not_made("to one side of a kink laws do not follow a mesh that parameters move"));
    }
    shape::find(&mut extended, of)?;
    // the laws of adjoints are not needed, but what they refuse is
    let mut asked = Asked::new(&mut extended, of, request, &mut standing, &ends)?;
    let kinks = Kinks::new(&extended, script, asked.weighed.iter().map(|w| w.measure), backend)?;
    if let Some(near) = asked.near.first().filter(|_| derivative == Derivative::OneSided) {
        return Err(number_between(&near.place, near.span));
    }
    let sided = match derivative {
        Derivative::OneSided => Some(Sided::new(&mut extended, script, &asked.weighed, backend)?),
        Derivative::TwoSided => None,
    };
    let mut run = Forwards {
        formulas: Formulas::new(&extended, script)?,
        of,
        extended: &extended,
        laws: Along::new(&extended, script, &asked.weighed, backend)?,
        standing,
        tangent: Tangent::new(As::Written),
        sided,
        decides: false,
        told: Vec::new(),
        still: Moving::default(),
        out: vec![0.0; extended.n_entries],
    };
    run.still = run.begin(&Direction::default())?;
    let mut moving = directions.iter().map(|d| run.begin(d)).collect::<Result<Vec<_>, _>>()?;
    let (moved, mut near) = run.all_steps(&mut moving, &asked, &ends, &kinks)?;
    join(&mut near, std::mem::take(&mut asked.near));
    let (solutions, factorisations) = (run.tangent.solutions, run.tangent.factorisations);
    let (mut notes, steps_again) = (std::mem::take(&mut run.told), run.standing.steps.again());
    let shape::Told { near: of_mesh, notes: of_shape } = shape::told(&extended, of, &request.parameters)?;
    near.extend(of_mesh);
    notes.extend(of_shape);
    Ok(Tangents { times, moved, near, notes, solutions, factorisations, steps_again, ..Tangents::default() })
}

impl Forwards<'_, '_> {
    /// A direction before the first step.
    fn begin(&self, direction: &Direction) -> Result<Moving, Box<Diagnostic>> {
        let (extended, system) = (self.extended, &self.standing.solving.system);
        let mut live = extended.zeros();
        for (name, entries) in &direction.parameters {
            let Some(k) = extended.live.iter().position(|l| l.name == *name) else { continue };
            let own = &mut live[extended.entries_of(k)];
            other_size(name, entries.len(), own.len())?;
            own.copy_from_slice(entries);
        }
        from_declared(self.of.script, extended, &mut live)?;
        extended.spread_motion(&mut live);
        let mut fields = Vec::new();
        for (name, values) in &direction.fields {
            let Some(k) = system.fields.iter().position(|f| f.name == *name) else { continue };
            other_size(name, values.len(), system.fields[k].n_dofs())?;
            fields.push((k, values.clone()));
        }
        let known = system.data().iter().map(|v| vec![0.0; v.len()]).collect();
        let kept = self.standing.rates().map_or_else(Kept::new, Rates::nothing);
        let mut before = Motion { u: vec![0.0; system.numbering.n_dofs], known, kept };
        for (field, formula) in &self.formulas.starts {
            let positions = node_positions(system, *field);
            let moved =
                formula.moved(extended, (&positions, Window::instant(self.standing.solving.steps.first())), &live)?;
            match system.range(*field) {
                Some(range) if !moved.is_empty() => before.u[range].copy_from_slice(&moved),
                None if !moved.is_empty() => before.known[*field] = moved,
                _ => {}
            }
        }
        if let Some(first) = self.standing.trajectory.steps.first() {
            self.data(first.window, (&live, &fields), &mut before.known)?;
        }
        let (end, rows) = (before.clone(), Vec::new());
        Ok(Moving { live, fields, before, end, rows, ..Moving::default() })
    }

    /// By direction, measure and step what the measure does; and the points between two branches.
    fn all_steps(
        &mut self,
        moving: &mut [Moving],
        asked: &Asked,
        ends: &Ends,
        kinks: &Kinks,
    ) -> Result<(Moved, Vec<NearKink>), Box<Diagnostic>> {
        let trajectory = self.standing.trajectory;
        let mut moved = vec![vec![vec![0.0; ends.len()]; asked.values.len()]; moving.len()];
        for Direct { into, end, live } in &asked.direct {
            for (moved, one) in moved.iter_mut().zip(moving.iter()) {
                moved[*into][*end] += live.iter().zip(&one.live).map(|(x, by)| x * by).sum::<f64>();
            }
        }
        let mut near = Vec::new();
        if let Some(beginning) = Beginning::new(&mut self.standing)? {
            self.set_step(trajectory.steps[0].window);
            for one in moving.iter_mut() {
                self.beginning(&beginning, one)?;
            }
        }
        for n in 0..trajectory.steps.len() {
            self.standing.at(n)?;
            let step = &*self.standing.steps.step(n)?;
            self.set_step(self.standing.window_of(step));
            self.tangent.is_new = true;
            self.decides = false;
            for one in moving.iter_mut() {
                self.step(step, one)?;
            }
            let at = step.window;
            if step.kind != Passed::Given {
                let at = self.standing.window_of(step);
                near.push(kinks.near(&self.standing.solving, self.extended, &step.u, at, None));
            }
            if self.standing.is_within(step) {
                self.go_to_end(step, moving)?;
            }
            if let Some(end) = ends.get(&n) {
                self.standing.put_states_behind(n)?;
                // the list is read backwards, as the adjoint finds it
                for (k, weighed) in asked.weighed.iter().enumerate().rev().filter(|(_, w)| w.steps[*end] != 0.0) {
                    let (u, of) = (step.at_end(), Some(weighed.measure));
                    near.push(kinks.near(&self.standing.solving, self.extended, u, at, of));
                    let shared = self.measure((k, weighed), step, moving, |d, x| {
                        moved[d][weighed.into][*end] += weighed.steps[*end] * x;
                    });
                    near.push(shared.into_iter().collect());
                }
            }
            moving.iter_mut().for_each(|one| std::mem::swap(&mut one.before, &mut one.end));
        }
        let mut joined = Vec::new();
        near.into_iter().rev().for_each(|found| join(&mut joined, found));
        Ok((moved, joined))
    }

    /// What a direction moves at the end of a step: data, prescribed values, unknowns, states.
    fn step(&mut self, step: &PassedStep, one: &mut Moving) -> Result<(), Box<Diagnostic>> {
        let at = self.standing.window_of(step);
        one.end.known.clone_from(&one.before.known);
        self.data(at, (&one.live, &one.fields), &mut one.end.known)?;
        one.rows.clear();
        if let Some(explicit) = self.standing.solving.explicit.clone().filter(|_| step.kind == Passed::Explicit) {
            return self.explicit(step, &explicit, one);
        }
        let n = self.extended.n;
        let mut of_rates = step.rates.as_ref().map(|rates| (rates, rates.along(&one.before.kept)));
        self.still.rates = step.rates.as_ref().map(|rates| rates.with_behind(&rates.along(&self.still.end.kept), n));
        if step.kind == Passed::Given {
            one.rates = of_rates.as_ref().map(|(rates, along)| rates.with_behind(along, n));
            one.end.u.clone_from(&one.before.u);
            one.end.kept.clone_from(&one.before.kept);
            return Ok(());
        }
        one.end.u.fill(0.0);
        self.prescribed_in(step, one)?;
        if let Some((_, along)) = &mut of_rates {
            along.drive(&one.end.u, &one.before.u);
        }
        one.rates = of_rates.as_ref().map(|(rates, along)| rates.with_behind(along, n));
        self.look(step, one);
        if self.decides {
            self.step_to_side(step, one)?;
        } else {
            self.linear(step, one)?;
        }
        self.states(step, one);
        if let Some((_, along)) = of_rates {
            // what the equations were solved for goes to the end of the step
            let mut end = one.end.u.clone();
            if self.standing.offset(step) != 0.0 {
                along.extrapolate(&mut end, &one.before.u);
            }
            one.end.kept = along.kept_at(&end, &one.before.u);
            one.end.u = end;
        }
        Ok(())
    }

    /// Brings laws to a step.
    fn set_step(&mut self, window: Window) {
        let at = self.standing.step_of(window);
        self.laws.set_step(at);
        if let Some(sided) = &mut self.sided {
            sided.set_step(at);
        }
    }

    /// What the unknowns move by, and what the equations are off by then.
    fn linear(&mut self, step: &PassedStep, one: &mut Moving) -> Result<(), Box<Diagnostic>> {
        one.rows = self.residual(step, one)?;
        let rhs: Vec<f64> = one.rows.iter().map(|x| -x).collect();
        let found = self.tangent.solve(self.standing.solving.system, &step.u, &rhs, self.of.threads)?;
        one.end.u.iter_mut().zip(&found).for_each(|(u, x)| *u += x);
        self.still.end.u = found;
        let mut of_unknowns = self.residual(step, &self.still.clone())?;
        one.rows.iter_mut().zip(&of_unknowns).for_each(|(x, y)| *x += y);
        let numbering = &self.standing.solving.system.numbering;
        numbering.turn(&mut one.rows);
        numbering.turn(&mut of_unknowns);
        let mut own = Vec::new();
        numbering.gather(&of_unknowns, &mut own);
        let apart = self.tangent.apart(self.standing.solving.system, &own);
        if apart.is_nan() || apart > AGREEMENT {
            return Err(refused::apart(step.window.end, "tangent", apart));
        }
        Ok(())
    }

    /// Renews what the states move by.
    fn states(&self, step: &PassedStep, one: &mut Moving) {
        let next: Vec<Option<Vec<f64>>> = {
            let values = self.standing.solving.system.values(&step.u);
            let (current, previous) = self.values(&values, one);
            let values = FieldValues { current: &current, previous: &previous, rates: one.rates.as_ref() };
            let states = 0..self.standing.solving.scene.states.len();
            let to_side = |k: usize| self.sided.as_ref()?.state(self.extended, k, values);
            states.map(|k| to_side(k).or_else(|| self.laws.state(self.extended, k, values))).collect()
        };
        for (state, next) in self.standing.solving.scene.states.iter().zip(next) {
            match next {
                Some(next) => one.end.known[state.field] = next,
                None => one.end.known[state.field].fill(0.0),
            }
        }
    }

    /// Brings equations and directions from where the equations of a step stand to its end.
    fn go_to_end(&mut self, step: &PassedStep, moving: &mut [Moving]) -> Result<(), Box<Diagnostic>> {
        self.standing.go_to_end(step)?;
        self.set_step(step.window);
        let n = self.extended.n;
        for one in moving {
            let mut known = std::mem::take(&mut one.end.known);
            self.data(step.window, (&one.live, &one.fields), &mut known)?;
            one.end.known = known;
            one.rates = self.standing.rates().map(|held| held.with_behind(&held.along(&one.end.kept), n));
        }
        Ok(())
    }

    /// What prescribed values move by where the equations of a step stand, written into what the unknowns move by.
    fn prescribed_in(&self, step: &PassedStep, one: &mut Moving) -> Result<(), Box<Diagnostic>> {
        let at = self.standing.window_of(step);
        self.prescribed(at, &one.live, &mut one.end.u)?;
        let Some(rates) = step.rates.as_ref().filter(|_| self.standing.offset(step) != 0.0) else { return Ok(()) };
        let mut end = vec![0.0; one.end.u.len()];
        self.prescribed(step.window, &one.live, &mut end)?;
        let numbering = &self.standing.solving.system.numbering;
        let [mut before, _] = parted(numbering, &one.before.u);
        numbering.frames.turn_back(&mut before);
        for d in rates.fields().iter().flat_map(|of| of.dofs.clone()) {
            one.end.u[d] = end[d] + rates.scheme().offset() * (before[d] - end[d]);
        }
        Ok(())
    }

    /// Values of all fields and of what they move by, at the end of a step and before it.
    fn values<'v>(
        &'v self,
        of: &wfl_discrete::system::StateValues<'v>,
        one: &'v Moving,
    ) -> (Vec<&'v [f64]>, Vec<&'v [f64]>) {
        let (extended, system) = (self.extended, &self.standing.solving.system);
        let along = |motion: &'v Motion| -> Vec<&'v [f64]> {
            let of = |k: usize| system.range(k).map_or(motion.known[k].as_slice(), |range| &motion.u[range]);
            (0..extended.n).map(of).collect()
        };
        let current = extended.with_directions(&of.current, along(&one.end), &one.live);
        // a scene that reads nothing of the past has none
        let previous = match of.previous.as_slice() {
            [] => Vec::new(),
            past => extended.with_directions(past, along(&one.before), &one.live),
        };
        (current, previous)
    }

    /// What the equations change by, by dof.
    fn residual(&mut self, step: &PassedStep, one: &Moving) -> Result<Vec<f64>, Box<Diagnostic>> {
        self.residual_of(step, one, |_| true)
    }

    /// What some terms of them change by.
    fn residual_of(
        &mut self,
        step: &PassedStep,
        one: &Moving,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Vec<f64>, Box<Diagnostic>> {
        let mut out = std::mem::take(&mut self.out);
        out.fill(0.0);
        let system = &self.standing.solving.system;
        let values = system.values(&step.u);
        let (current, previous) = self.values(&values, one);
        let made = FieldValues { current: &current, previous: &previous, rates: one.rates.as_ref() };
        let sided = self.sided.as_ref().filter(|_| self.decides);
        let is_plain = |term: usize| wanted(term) && !sided.is_some_and(|sided| sided.has(term));
        self.laws.residual(self.extended, made, is_plain, &mut out)?;
        let mut by_dof = vec![0.0; system.numbering.n_dofs];
        for k in 0..self.extended.n {
            if let Some(range) = system.range(k) {
                by_dof[range].copy_from_slice(&out[self.extended.range(k)]);
            }
        }
        if let Some(sided) = sided {
            sided.residual(self.extended, made, &wanted, &mut by_dof)?;
        }
        drop(values);
        self.out = out;
        Ok(by_dof)
    }

    /// What the data at a step move by.
    fn data(
        &self,
        step: Window,
        by: (&[f64], &[(usize, Vec<f64>)]),
        known: &mut [Vec<f64>],
    ) -> Result<(), Box<Diagnostic>> {
        let (live, fields) = by;
        for (field, _) in &self.standing.solving.data {
            let positions = || node_positions(self.standing.solving.system, *field);
            let of_formula = match self.formulas.data.get(field) {
                Some(formula) => formula.moved(self.extended, (&positions(), step), live)?,
                None => Vec::new(),
            };
            let own = &mut known[*field];
            own.fill(0.0);
            let parts = fields.iter().filter(|f| f.0 == *field).map(|f| &f.1).chain([&of_formula]);
            parts.for_each(|part| own.iter_mut().zip(part).for_each(|(x, y)| *x += y));
        }
        Ok(())
    }

    /// What prescribed values move by.
    fn prescribed(&self, step: Window, live: &[f64], u: &mut [f64]) -> Result<(), Box<Diagnostic>> {
        if self.formulas.fixes.iter().all(Option::is_none) {
            return Ok(());
        }
        let prescribed = &self.standing.solving.prescribed;
        let mut numbers = prescribed.zeros();
        for ((statement, positions), numbers) in prescribed.places().zip(&mut numbers) {
            let stated = self.of.script.fixes.iter().position(|fix| fix.span == statement);
            if let Some(formula) = stated.and_then(|k| self.formulas.fixes[k].as_ref()) {
                let moved = formula.moved(self.extended, (positions, step), live)?;
                numbers.iter_mut().zip(&moved).for_each(|(x, y)| *x = *y);
            }
        }
        prescribed.write(&numbers, u);
        self.standing.solving.system.numbering.follow(u);
        Ok(())
    }

    /// A direction with what it moves the place of a point by, from what each entry of the parameters moves that by.
    fn at_its_place(&self, one: &Moving, moved: &[f64]) -> Moving {
        let mut placed = one.clone();
        let (live, place) = placed.live.split_at_mut(self.extended.place_range().start);
        place.fill(0.0);
        for (by, moved) in live.iter().zip(moved.chunks_exact(place.len())) {
            place.iter_mut().zip(moved).for_each(|(p, m)| *p += by * m);
        }
        placed
    }

    /// What a measure does along each direction, given to `put` with the number of the direction; and what there is to tell of
    /// points that share the largest value.
    fn measure(
        &self,
        result: (usize, &Weighed),
        step: &PassedStep,
        moving: &[Moving],
        mut put: impl FnMut(usize, f64),
    ) -> Option<NearKink> {
        let (number, weighed) = result;
        match &weighed.summed {
            Summed::Rows(rows) => {
                for (d, one) in moving.iter().enumerate() {
                    // where time starts no equation was solved, and a reaction is zero
                    let sum: f64 = rows.iter().map(|(dof, w)| w * one.rows.get(*dof).copied().unwrap_or(0.0)).sum();
                    put(d, -sum);
                }
                None
            }
            Summed::Points(made_of) => {
                let values = self.standing.solving.system.values(step.at_end());
                let at = step.window;
                let (points, shared) = weighed.at_points((self.extended, &self.standing.solving), values.view(), at);
                let growing = match made_of.grows {
                    true => weighed.growing((self.extended, &self.standing.solving), values.view(), at),
                    false => Vec::new(),
                };
                for (d, one) in moving.iter().enumerate() {
                    let placed = made_of.place.as_ref().map(|moved| self.at_its_place(one, moved));
                    let one = placed.as_ref().unwrap_or(one);
                    let (current, previous) = self.values(&values, one);
                    let made = FieldValues { current: &current, previous: &previous, rates: one.rates.as_ref() };
                    let to_side = self.sided.as_ref().map(|_| self.measure_to_side(result, step, (&values, made)));
                    let along = || self.laws.measure(self.extended, (number, [&points, &growing]), made);
                    put(d, to_side.flatten().unwrap_or_else(along));
                }
                shared
            }
        }
    }
}
