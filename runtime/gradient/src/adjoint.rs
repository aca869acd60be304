//! From the last step to the first one: a solution with the transposed tangent for each step and result.

mod beginning;
mod explicit;

use std::collections::BTreeMap;

use wfl::Diagnostic;
use wfl_compiler::types::{FieldId, FieldKind, RateOrder};
use wfl_discrete::{
    assemble::FieldValues,
    rates::{Kept, Rates},
    system::FIXED,
    window::Window,
};
use wfl_problem::node_positions;
use wfl_run::{As, Passed, PassedStep};

use super::{
    Differentiated, Gradient, Gradients, Request,
    beginning::Beginning,
    extended::{Extended, Live},
    formulas::Formulas,
    laws::{Laws, Of},
    linear::Tangent,
    measures::{Asked, Direct, Points, Summed, Weighed},
    near::{Kinks, NearKink, join},
    parameters::to_declared,
    refused::{self, not_made},
    shape,
    standing::{self, AGREEMENT, Ends, Standing},
};
use explicit::OfLumped;

/// When the states stand that a law reads.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Read {
    /// At the end of the step: of measures of points.
    AtTheEnd,
    /// As the equations of the step read them.
    ByEquations,
}

/// What a result changes with at the end of a step.
#[derive(Clone)]
struct Cotangent {
    /// By dof, in the axes of the scene.
    u: Vec<f64>,
    /// By field that is not solved for.
    known: Vec<Vec<f64>>,
    /// Of rates.
    kept: Kept,
}

impl Cotangent {
    /// True if a result changes with nothing of it.
    fn is_zero(&self) -> bool {
        let kept = self.kept.iter().flatten();
        self.u.iter().chain(self.known.iter().chain(kept).flatten()).all(|x| *x == 0.0)
    }
}

/// The derivatives of one result.
struct Sums {
    /// By entry of the parameters that change.
    live: Vec<f64>,
    /// By data field, over all steps.
    data: Vec<Vec<f64>>,
    /// What is followed of mass and damping of explicit steps.
    lumped: OfLumped,
}

/// What is known of all results on the way back.
struct Found {
    /// By result what it changes with at the end of a step, and at its start.
    end: Vec<Cotangent>,
    start: Vec<Cotangent>,
    sums: Vec<Sums>,
    /// Points between two branches.
    near: Vec<NearKink>,
}

impl Found {
    /// What results follow of what rates keep at the end of a step.
    fn of_rates(&mut self, rates: &Rates) {
        for (end, start) in self.end.iter_mut().zip(&mut self.start) {
            let kept = std::mem::replace(&mut end.kept, rates.nothing());
            rates.follow_end(&kept, [&mut end.u, &mut start.u], &mut start.kept);
        }
    }
}

/// The run, backwards.
struct Backwards<'a, 's> {
    of: Differentiated<'a>,
    extended: &'a Extended<'a>,
    laws: Laws,
    formulas: Formulas,
    standing: Standing<'a, 's>,
    tangent: Tangent,
    /// The vector of all derivatives, of one law after the other.
    out: Vec<f64>,
}

/// The derivatives of all results of a request.
pub(super) fn solve(of: Differentiated<'_>, request: &Request, live: &[Live]) -> Result<Gradients, Box<Diagnostic>> {
    let Differentiated { scene, script, outcome, backend, .. } = of;
    refused::places(script, live)?;
    let (trajectory, ends) = standing::of_run(outcome)?;
    let mut equations = outcome.equations.clone();
    let mut standing = Standing::new((of, trajectory), scene.solving(&mut equations));
    let extended = Extended::new(scene, script, live.to_vec());
    let mut extended = extended.map_err(|e| not_made(&e.to_string()))?;
    shape::find(&mut extended, of)?;
    let mut asked = Asked::new(&mut extended, of, request, &mut standing, &ends)?;
    let laws = Laws::new(&extended, script, std::mem::take(&mut asked.laws), backend)?;
    let kinks = Kinks::new(&extended, script, asked.weighed.iter().map(|w| w.measure), backend)?;
    let n_entries = extended.n_entries;
    let mut run = Backwards {
        formulas: Formulas::new(&extended, script)?,
        of,
        extended: &extended,
        laws,
        standing,
        tangent: Tangent::new(As::Transposed),
        out: vec![0.0; n_entries],
    };
    let (sums, mut near) = run.all_steps(&asked, &ends, &kinks)?;
    join(&mut near, std::mem::take(&mut asked.near));
    let (solutions, factorisations) = (run.tangent.solutions, run.tangent.factorisations);
    let steps_again = run.standing.steps.again();
    let shape::Told { near: of_mesh, notes } = shape::told(&extended, of, &request.parameters)?;
    near.extend(of_mesh);
    let mut made = Gradients { near, notes, solutions, factorisations, steps_again, ..Gradients::default() };
    for (into, mut sum) in sums.into_iter().enumerate() {
        extended.gather_motion(&mut sum.live);
        to_declared(script, &extended, &mut sum.live)?;
        let entries = |name: &String| {
            let k = extended.live.iter().position(|l| l.name == *name)?;
            Some((name.clone(), sum.live[extended.entries_of(k)].to_vec()))
        };
        let field = |name: &String| {
            let k = scene.system.fields.iter().position(|f| f.name == *name)?;
            Some((name.clone(), sum.data[k].clone()))
        };
        made.results.push(Gradient {
            name: request.names().swap_remove(into),
            value: asked.values[into],
            parameters: request.parameters.iter().filter_map(entries).collect(),
            fields: request.fields.iter().filter_map(field).collect(),
            sides: Vec::new(),
        });
    }
    Ok(made)
}

impl Backwards<'_, '_> {
    /// By result its derivatives; and the points between two branches.
    fn all_steps(
        &mut self,
        asked: &Asked,
        ends: &Ends,
        kinks: &Kinks,
    ) -> Result<(Vec<Sums>, Vec<NearKink>), Box<Diagnostic>> {
        let trajectory = self.standing.trajectory;
        let zero = self.nothing();
        let of_one =
            || Sums { live: self.extended.zeros(), data: zero.known.to_vec(), lumped: OfLumped::new(zero.u.len()) };
        let (results, n_sums) = (&asked.weighed, asked.values.len());
        let nothing = vec![zero.clone(); n_sums];
        let mut found = Found {
            end: nothing.clone(),
            start: Vec::new(),
            sums: (0..n_sums).map(|_| of_one()).collect(),
            near: Vec::new(),
        };
        for Direct { into, live, .. } in &asked.direct {
            add(&mut found.sums[*into].live, live);
        }
        for n in (0..trajectory.steps.len()).rev() {
            let of_end = |end: &usize| results.iter().map(|w| (w, w.steps[*end])).filter(|r| r.1 != 0.0).collect();
            let read: Vec<(&Weighed, f64)> = ends.get(&n).map(of_end).unwrap_or_default();
            if read.is_empty() && found.end.iter().all(Cotangent::is_zero) {
                continue;
            }
            found.start.clone_from(&nothing);
            let step = self.standing.steps.step(n)?;
            self.one_step((n, &step), &read, kinks, &mut found)?;
            std::mem::swap(&mut found.end, &mut found.start);
        }
        let beginning =
            if found.end.iter().all(Cotangent::is_zero) { None } else { Beginning::new(&mut self.standing)? };
        for (start, sum) in found.end.iter_mut().zip(&mut found.sums) {
            if let (Some(beginning), Some(first)) = (&beginning, trajectory.steps.first()) {
                self.standing.at(0)?;
                self.laws.set_step(self.standing.step_of(first.window));
                self.of_beginning(beginning, start, sum)?;
            }
            self.of_start(start, sum)?;
        }
        Ok((found.sums, found.near))
    }

    /// From the end of a step to its start; `read` are the results that it counts in.
    fn one_step(
        &mut self,
        of: (usize, &PassedStep),
        read: &[(&Weighed, f64)],
        kinks: &Kinks,
        found: &mut Found,
    ) -> Result<(), Box<Diagnostic>> {
        let (n, step) = of;
        self.standing.at(n)?;
        let (window, is_within) = (self.standing.window_of(step), self.standing.is_within(step));
        if is_within {
            self.standing.go_to_end(step)?;
        }
        self.laws.set_step(self.standing.step_of(step.window));
        self.of_results(read, of, kinks, found)?;
        if is_within {
            for (end, sum) in found.end.iter_mut().zip(&mut found.sums) {
                self.of_data(step.window, end, sum)?;
                self.standing.solving.data.iter().for_each(|(field, _)| end.known[*field].fill(0.0));
            }
            self.standing.at(n)?;
            self.laws.set_step(self.standing.step_of(window));
        }
        if step.kind != Passed::Given {
            join(&mut found.near, kinks.near(&self.standing.solving, self.extended, &step.u, window, None));
        }
        let explicit = self.standing.solving.explicit.clone().filter(|_| step.kind == Passed::Explicit);
        if let Some(rates) = step.rates.as_ref().filter(|_| explicit.is_none()) {
            found.of_rates(rates);
            let ends = found.end.iter_mut().zip(&mut found.start).filter(|_| is_within);
            ends.for_each(|(end, start)| rates.follow_extrapolation(&mut end.u, &mut start.u));
        }
        self.tangent.is_new = true;
        for ((end, start), sum) in found.end.iter_mut().zip(&mut found.start).zip(&mut found.sums) {
            match (&explicit, step.kind) {
                (Some(explicit), _) => self.of_explicit((step, explicit), end, start, sum)?,
                (None, Passed::Given) => {
                    add(&mut start.u, &end.u);
                    self.each_state(|k| add(&mut start.known[k], &end.known[k]));
                }
                (None, _) => {
                    self.of_states(step, end, start, sum)?;
                    self.of_equations(step, end, start, sum)?;
                }
            }
            self.of_data(window, end, sum)?;
        }
        Ok(())
    }

    /// A result that changes with nothing.
    fn nothing(&self) -> Cotangent {
        let system = &self.standing.solving.system;
        Cotangent {
            u: vec![0.0; system.numbering.n_dofs],
            known: system.data().iter().map(|v| vec![0.0; v.len()]).collect(),
            kept: self.standing.rates().map_or_else(Kept::new, Rates::nothing),
        }
    }

    /// Results that a step counts in, each with its position and weight.
    fn of_results(
        &mut self,
        read: &[(&Weighed, f64)],
        at: (usize, &PassedStep),
        kinks: &Kinks,
        found: &mut Found,
    ) -> Result<(), Box<Diagnostic>> {
        let (n, step) = at;
        self.standing.put_states_behind(n)?;
        for (weighed, weight) in read {
            let Summed::Points(points) = &weighed.summed else { continue };
            let shared = self.of_measure(weighed, (points, *weight), step)?;
            join(&mut found.near, shared);
            let at = step.window;
            join(
                &mut found.near,
                kinks.near(&self.standing.solving, self.extended, step.at_end(), at, Some(weighed.measure)),
            );
            let into = weighed.into;
            let live = &mut found.sums[into].live;
            self.spread(1.0, Read::AtTheEnd, &mut found.end[into], &mut found.start[into], live);
            if let Some(moved) = &points.place {
                let (entries, place) = live.split_at_mut(self.extended.place_range().start);
                for (to, moved) in entries.iter_mut().zip(moved.chunks_exact(place.len())) {
                    *to += moved.iter().zip(&*place).map(|(m, g)| m * g).sum::<f64>();
                }
                place.fill(0.0);
            }
        }
        self.standing.put_states(&step.states);
        // where time starts no equation was solved, and a reaction is zero
        for (weighed, weight) in read.iter().filter(|_| step.kind != Passed::Given) {
            let (Summed::Rows(rows), into) = (&weighed.summed, weighed.into) else { continue };
            self.of_rows((rows, *weight), step)?;
            self.spread(
                -1.0,
                Read::ByEquations,
                &mut found.end[into],
                &mut found.start[into],
                &mut found.sums[into].live,
            );
        }
        Ok(())
    }

    fn each_state(&self, mut f: impl FnMut(usize)) {
        self.standing.solving.states.iter().for_each(|state| f(state.field));
    }

    /// Evaluates laws of derivatives with weights, by position behind the fields of the scene.
    fn evaluate(
        &mut self,
        wanted: impl Fn(Of) -> bool,
        u: &[f64],
        weights: &BTreeMap<usize, Vec<f64>>,
    ) -> Result<(), Box<Diagnostic>> {
        self.out.fill(0.0);
        let values = self.standing.solving.system.values(u);
        let extended = self.extended;
        let mut current = values.current.clone();
        current.resize(extended.fields.len(), &[]);
        for (k, live) in extended.live.iter().enumerate() {
            current[2 * extended.n + k] = &live.values;
        }
        for (k, numbers) in weights {
            current[*k] = numbers;
        }
        // what is read of the past of a parameter is what it is; a scene that reads nothing of the past has none
        let mut previous = values.previous.clone();
        if !previous.is_empty() {
            previous.extend_from_slice(&current[extended.n..]);
        }
        let values = FieldValues { current: &current, previous: &previous, rates: values.rates };
        self.laws.add(extended, wanted, values, &mut self.out)
    }

    /// Moves what the laws gave, times a factor, to where it belongs.
    fn spread(&self, factor: f64, read: Read, end: &mut Cotangent, start: &mut Cotangent, live: &mut [f64]) {
        let (extended, system) = (self.extended, &self.standing.solving.system);
        let scaled = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, f)| *t += factor * f);
        for (k, field) in system.fields.iter().enumerate() {
            let [now, past] = [k, k + extended.n].map(|k| &self.out[extended.range(k)]);
            match system.range(k) {
                Some(range) => {
                    scaled(&mut end.u[range.clone()], now);
                    scaled(&mut start.u[range], past);
                }
                None => {
                    let is_old = field.kind == FieldKind::State && read == Read::ByEquations;
                    scaled(if is_old { &mut start.known[k] } else { &mut end.known[k] }, now);
                    scaled(&mut start.known[k], past);
                }
            }
        }
        if let Some(rates) = self.standing.rates() {
            let place = |order: RateOrder, field: usize| {
                extended.range(extended.companions().history(order, FieldId::new(field)).index())
            };
            // rates are held at an end behind the equations
            let kept = if read == Read::AtTheEnd && rates.is_held() { &mut end.kept } else { &mut start.kept };
            let ends = [&mut *end.u, &mut *start.u];
            rates.follow_histories(|order, field| &self.out[place(order, field)], factor, ends, kept);
        }
        scaled(live, &self.out[extended.live_range()]);
        scaled(&mut live[extended.n_live()..], &self.out[extended.motion_range()]);
    }

    /// The derivatives of a measure at the end of a step.
    fn of_measure(
        &mut self,
        weighed: &Weighed,
        weights: (&Points, f64),
        step: &PassedStep,
    ) -> Result<Option<NearKink>, Box<Diagnostic>> {
        let (made_of, weight) = weights;
        let values = self.standing.solving.system.values(step.at_end());
        let of = (self.extended, &self.standing.solving);
        let at = step.window;
        let (mut points, near) = weighed.at_points(of, values.view(), at);
        let mut fields = made_of.weights.clone();
        if made_of.grows {
            points.extend(weighed.growing(of, values.view(), at));
            fields.extend(&made_of.growing);
        }
        drop(values);
        let scaled = |list: Vec<f64>| list.into_iter().map(|x| weight * x).collect();
        let weights = fields.into_iter().zip(points.into_iter().map(scaled)).collect();
        self.evaluate(
            |of| matches!(of, Of::Measure(measure, _) if measure == weighed.measure),
            step.at_end(),
            &weights,
        )?;
        Ok(near)
    }

    /// The derivatives of weighted equations of prescribed values.
    fn of_rows(&mut self, rows: (&[(usize, f64)], f64), step: &PassedStep) -> Result<(), Box<Diagnostic>> {
        let (rows, factor) = rows;
        let numbering = &self.standing.solving.system.numbering;
        let mut weights = vec![0.0; numbering.n_dofs];
        rows.iter().for_each(|(dof, weight)| weights[*dof] += factor * weight);
        numbering.frames.turn_back(&mut weights);
        let weights = self.by_test_field(&weights);
        self.evaluate(|of| matches!(of, Of::Term(_)), &step.u, &weights)
    }

    /// Numbers by dof as the values of the fields that stand for the test functions.
    fn by_test_field(&self, numbers: &[f64]) -> BTreeMap<usize, Vec<f64>> {
        let n = self.extended.n;
        let ranges = (0..n).filter_map(|k| Some((k + n, self.standing.solving.system.range(k)?)));
        ranges.map(|(k, range)| (k, numbers[range].to_vec())).collect()
    }

    /// Updates of states: what the states at the end of a step follow.
    fn of_states(
        &mut self,
        step: &PassedStep,
        end: &mut Cotangent,
        start: &mut Cotangent,
        sum: &mut Sums,
    ) -> Result<(), Box<Diagnostic>> {
        let mut weights = BTreeMap::new();
        let n = self.extended.n;
        for (state, points) in self.standing.solving.scene.states.iter().zip(&self.laws.weights) {
            let functional = std::mem::take(&mut end.known[state.field]);
            let components = (functional.len() / points.len().max(1)).max(1);
            // the weight of a point is in the integral that is evaluated
            let over = |(k, x): (usize, &f64)| if *x == 0.0 { 0.0 } else { x / points[k / components] };
            weights.insert(state.field + n, functional.iter().enumerate().map(over).collect::<Vec<f64>>());
            end.known[state.field] = vec![0.0; functional.len()];
        }
        if weights.values().flatten().all(|x| *x == 0.0) {
            return Ok(());
        }
        self.evaluate(|of| matches!(of, Of::State(_)), &step.u, &weights)?;
        self.spread(1.0, Read::ByEquations, end, start, &mut sum.live);
        Ok(())
    }

    /// Equations: what the unknowns at the end of a step follow.
    fn of_equations(
        &mut self,
        step: &PassedStep,
        end: &mut Cotangent,
        start: &mut Cotangent,
        sum: &mut Sums,
    ) -> Result<(), Box<Diagnostic>> {
        if end.u.iter().all(|x| *x == 0.0) {
            return Ok(());
        }
        let adjoint = self.tangent.solve(self.standing.solving.system, &step.u, &end.u, self.of.threads)?;
        let weights = self.by_test_field(&adjoint);
        self.evaluate(|of| matches!(of, Of::Term(_)), &step.u, &weights)?;
        let rhs = end.u.clone();
        self.spread(-1.0, Read::ByEquations, end, start, &mut sum.live);
        // what is left is the derivative in the prescribed values, and nothing at the free dofs
        let numbering = &self.standing.solving.system.numbering;
        numbering.turn(&mut end.u);
        let size = rhs.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let free = numbering.free_dofs.iter().map(|d| end.u[*d as usize].abs()).fold(0.0, f64::max);
        if free.is_nan() || free > AGREEMENT * size {
            let mut of_laws = rhs;
            numbering.turn(&mut of_laws);
            of_laws.iter_mut().zip(&end.u).for_each(|(b, left)| *b -= left);
            let mut own = Vec::new();
            numbering.gather(&of_laws, &mut own);
            let apart = self.tangent.apart(self.standing.solving.system, &own);
            if apart.is_nan() || apart > AGREEMENT {
                return Err(refused::apart(step.window.end, "transposed tangent", apart));
            }
        }
        if let Some(rates) = step.rates.as_ref().filter(|_| self.standing.offset(step) != 0.0) {
            let is_fixed = |(x, free): (&f64, &u32)| if *free == FIXED { *x } else { 0.0 };
            let mut fixed: Vec<f64> = end.u.iter().zip(&numbering.free).map(is_fixed).collect();
            let (mut at_end, mut before) = (vec![0.0; fixed.len()], vec![0.0; fixed.len()]);
            rates.follow_prescribed(&mut fixed, &mut at_end, &mut before);
            numbering.frames.turn_back(&mut before);
            add(&mut start.u, &before);
            self.of_prescribed(step.window, &at_end, sum)?;
            return self.of_prescribed(self.standing.window_of(step), &fixed, sum);
        }
        self.of_prescribed(step.window, &end.u, sum)
    }

    /// Prescribed values, from the derivative in them in local frames.
    fn of_prescribed(&self, step: Window, functional: &[f64], sum: &mut Sums) -> Result<(), Box<Diagnostic>> {
        if self.formulas.fixes.iter().all(Option::is_none) {
            return Ok(());
        }
        let prescribed = &self.standing.solving.prescribed;
        let numbers = prescribed.transposed(functional);
        for ((statement, positions), numbers) in prescribed.places().zip(numbers) {
            let stated = self.of.script.fixes.iter().position(|fix| fix.span == statement);
            if let Some(formula) = stated.and_then(|k| self.formulas.fixes[k].as_ref()) {
                formula.add(self.extended, (positions, step), &numbers, &mut sum.live)?;
            }
        }
        Ok(())
    }

    /// Data at a step.
    fn of_data(&self, step: Window, end: &Cotangent, sum: &mut Sums) -> Result<(), Box<Diagnostic>> {
        for (field, _) in &self.standing.solving.data {
            add(&mut sum.data[*field], &end.known[*field]);
            if let Some(formula) = self.formulas.data.get(field) {
                let positions = node_positions(self.standing.solving.system, *field);
                formula.add(self.extended, (&positions, step), &end.known[*field], &mut sum.live)?;
            }
        }
        Ok(())
    }

    /// First values, and data before the first step.
    fn of_start(&self, start: &Cotangent, sum: &mut Sums) -> Result<(), Box<Diagnostic>> {
        let system = &self.standing.solving.system;
        for (field, formula) in &self.formulas.starts {
            let functional = match system.range(*field) {
                Some(range) => &start.u[range],
                None => &start.known[*field],
            };
            let positions = node_positions(system, *field);
            formula.add(
                self.extended,
                (&positions, Window::instant(self.standing.solving.steps.first())),
                functional,
                &mut sum.live,
            )?;
        }
        match self.standing.trajectory.steps.first() {
            Some(first) => self.of_data(first.window, start, sum),
            None => Ok(()),
        }
    }
}

fn add(to: &mut [f64], from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(t, f)| *t += f);
}
