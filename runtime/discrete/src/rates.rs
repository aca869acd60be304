//! Rates of fields in time: what the equations of a step read of the past, and what a step leaves to the next.
//!
//! `Dot_u` and `Dot2_u` are compiled to `c (u - Previous_u) + history`. Here are the scalars c of a step and the nodal
//! histories; which they are says the [`Scheme`]. Promises: between two steps the rates are those at the end of the last
//! one; a step can be begun again with another increment as often as needed; fields without rates keep nothing.
//! Does not solve anything and knows no equations.

mod apart;
mod driven;
mod linear;
mod rounding;
mod scheme;

use std::{ops::Range, sync::Arc};

use apart::Apart;
use driven::Both;
pub use driven::Driven;
pub use linear::Kept;
pub use scheme::{Alpha, KEPT, Lengths, MOST_ORDER, Row, Rows, Scheme};
use wfl_compiler::types::{RateFactor, RateForm, RateOrder};

/// The scalars that the change of a field is multiplied by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RateFactors {
    /// Of first rates of fields that have no second one; 1/time.
    pub rate: f64,
    /// Of first rates of the others; 1/time.
    pub velocity: f64,
    /// Of second rates; 1/time^2.
    pub acceleration: f64,
}

impl RateFactors {
    /// One of them.
    #[must_use]
    pub fn of(&self, factor: RateFactor) -> f64 {
        match factor {
            RateFactor::Rate => self.rate,
            RateFactor::Velocity => self.velocity,
            RateFactor::Acceleration => self.acceleration,
        }
    }
}

/// A field with rates.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldRates {
    /// The field.
    pub field: usize,
    /// Which rates.
    pub form: RateForm,
    /// Its unknowns.
    pub dofs: Range<usize>,
    /// What the last step has left, by dof: its first and its second rate at the end, and the quotients of the changes of
    /// its value and of its first rate; those that the scheme does not read are empty.
    pub kept: [Vec<f64>; KEPT],
    /// What rounding has taken from its values at the end of the last step, and at that of the step that was begun: with it
    /// they add up to all changes. Empty where the scheme does not carry it.
    lost: [Vec<f64>; 2],
}

impl FieldRates {
    /// The change of the value of one of its dofs over the step that was begun, from what is left of it in the values.
    fn change(&self, k: usize, rounded: f64) -> f64 {
        let [before, now] = &self.lost;
        now.get(k).map_or(rounded, |now| rounded + (now - before[k]))
    }
}

/// The rates of all fields that have some.
#[derive(Clone, Debug, PartialEq)]
pub struct Rates {
    scheme: Scheme,
    factors: RateFactors,
    /// Those of the step that was begun last: its matrices are still there between two steps.
    of_step: RateFactors,
    fields: Vec<FieldRates>,
    /// Unknowns that move as they are prescribed, where the scheme has other rows for them.
    driven: Option<Arc<Driven>>,
    /// Dofs without mass, rising.
    without_mass: Arc<[usize]>,
    /// Those and unknowns without mass: what their rates at the end of a step are, no equation says.
    made_of_values: Option<Arc<Driven>>,
    /// Where the mass of the equations stands beside the terms.
    apart: Option<Apart>,
    /// By order and field: what the past gives in the present step; empty for fields without.
    histories: [Vec<Vec<f64>>; 2],
    /// The increment of the step that was begun and whose end is not kept yet.
    open: Option<f64>,
    /// The increments of the last steps whose ends are kept, the newest first.
    before: Vec<f64>,
    /// The largest order of backward differentiation in the next step.
    order: usize,
}

/// Where rates stand between two steps, to go on from later with the same bits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RatesMemory {
    /// The scalars of the last step.
    pub factors: [f64; 3],
    /// The increments of the last steps, the newest first; empty before the first one.
    pub before: Vec<f64>,
    /// What each field that has rates keeps, and what rounding has taken from its values.
    pub kept: Vec<Vec<f64>>,
}

impl Rates {
    /// Rates that are zero; `None` if no field has any. `ranges` has the dofs of each field that is solved for.
    #[must_use]
    pub fn new(scheme: Scheme, forms: &[RateForm], ranges: &[Option<Range<usize>>]) -> Option<Self> {
        let has = |k: &usize| forms.get(*k).is_some_and(|f| *f != RateForm::Difference);
        let fields: Vec<FieldRates> = (0..ranges.len())
            .filter(has)
            .filter_map(|field| {
                let (form, dofs) = (forms[field], ranges[field].clone()?);
                let zeros = |wanted: bool| vec![0.0; if wanted { dofs.len() } else { 0 }];
                let (kept, carried) = (scheme.keeps(form).map(zeros), zeros(scheme.carries_rounding(form)));
                Some(FieldRates { field, form, dofs, kept, lost: [carried.clone(), carried] })
            })
            .collect();
        if fields.is_empty() {
            return None;
        }
        let histories = [vec![Vec::new(); ranges.len()], vec![Vec::new(); ranges.len()]];
        let mut this = Self {
            scheme,
            factors: RateFactors::default(),
            of_step: RateFactors::default(),
            fields,
            driven: None,
            without_mass: Arc::default(),
            made_of_values: None,
            apart: None,
            histories,
            open: None,
            before: Vec::new(),
            order: MOST_ORDER,
        };
        this.hold();
        Some(this)
    }

    /// Whether steps read the rates where time starts: those with second rates, and of first ones all but BDF, whose first
    /// step is one of backward Euler; BDF3 with steps of a list would be of second order after it, and reads them too.
    #[must_use]
    pub fn are_read_at_start(&self, of_a_list: bool) -> bool {
        let most = self.scheme.most_order(RateForm::First);
        let has_second = || self.fields.iter().any(|of| of.form == RateForm::Second);
        most == 1 || most > 2 && of_a_list || has_second()
    }

    /// Every rate is zero, as before the first step.
    pub fn clear(&mut self) {
        let numbers = self.fields.iter_mut().flat_map(|of| of.kept.iter_mut().chain(&mut of.lost));
        numbers.for_each(|numbers| numbers.fill(0.0));
        self.of_step = RateFactors::default();
        self.before.clear();
        self.hold();
    }

    /// Rates jump here: backward differentiation begins again with a step of backward Euler.
    pub fn turn(&mut self) {
        self.before.clear();
    }

    /// The rates at the start, which were taken, are exact: backward differentiation begins with a quotient over a step of no
    /// length. The first step is then one of the trapezoidal rule, of second order, and the second one of third order.
    pub fn begin_with_rates(&mut self) {
        for of in &mut self.fields {
            let [first, second, of_value, of_rate, ..] = &mut of.kept;
            for (rate, quotient) in [(first, of_value), (second, of_rate)].into_iter().filter(|(_, q)| !q.is_empty()) {
                quotient.clone_from(rate);
            }
        }
        self.before = vec![0.0];
    }

    /// Backward differentiation takes at most this order in the steps that follow, until it is told another one.
    pub fn take_order(&mut self, order: usize) {
        self.order = order;
    }

    /// The largest order of backward differentiation that was taken last.
    #[must_use]
    pub fn taken_order(&self) -> usize {
        self.order
    }

    /// The scheme.
    #[must_use]
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The scalars of the present step.
    #[must_use]
    pub fn factors(&self) -> RateFactors {
        self.factors
    }

    /// The fields with rates.
    #[must_use]
    pub fn fields(&self) -> &[FieldRates] {
        &self.fields
    }

    /// The rates of the fields at the end of the last step, to be set: those at the start of a run.
    pub fn fields_mut(&mut self) -> &mut [FieldRates] {
        &mut self.fields
    }

    /// Takes first and second rates, by dof, as those at the end of the last step.
    pub fn take(&mut self, first: &[f64], second: &[f64]) {
        for of in &mut self.fields {
            let dofs = of.dofs.clone();
            for (kept, all) in of.kept.iter_mut().zip([first, second]).filter(|(kept, _)| !kept.is_empty()) {
                kept.copy_from_slice(&all[dofs.clone()]);
            }
        }
        self.hold();
    }

    /// First and second rates at the end `u` of a step that began at `before`, by dof; zero where there are none.
    #[must_use]
    pub fn ended(&self, u: &[f64], before: &[f64]) -> [Vec<f64>; 2] {
        let mut all = [vec![0.0; u.len()], vec![0.0; u.len()]];
        let kept = self.at_end(u, before).unwrap_or_else(|| self.fields.iter().map(|of| of.kept.clone()).collect());
        for (of, kept) in self.fields.iter().zip(kept) {
            let [first, second, ..] = kept;
            for (all, kept) in all.iter_mut().zip([first, second]).filter(|(_, kept)| !kept.is_empty()) {
                all[of.dofs.clone()].copy_from_slice(&kept);
            }
        }
        all
    }

    /// The second rates in the present step at the unknowns `u`, by dof, zero where there are none; `before` is the state
    /// at its start.
    #[must_use]
    pub fn second(&self, u: &[f64], before: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; u.len()];
        let (factor, histories) = self.of_second();
        for of in self.fields.iter().filter(|of| of.form == RateForm::Second) {
            for (d, past) in of.dofs.clone().zip(&histories[of.field]) {
                out[d] = factor * (u[d] - before[d]) + past;
            }
        }
        out
    }

    /// By dof the change from the unknowns `u` to those without any second rates, where nothing acts on what flies on; `before` is the state
    /// at the start of the step that was begun. `None` where there are no second rates.
    #[must_use]
    pub fn to_flight(&self, u: &[f64], before: &[f64]) -> Option<Vec<f64>> {
        let (factor, _) = self.of_second();
        self.has_flight().then(|| self.second(u, before).iter().map(|rate| -rate / factor).collect())
    }

    /// Whether unknowns have second rates in a step that was begun.
    #[must_use]
    pub fn has_flight(&self) -> bool {
        self.of_second().0 != 0.0 && self.fields.iter().any(|of| of.form == RateForm::Second)
    }

    /// What the past gives of a rate of a field, by its dofs; empty for a field without.
    #[must_use]
    pub fn history(&self, order: RateOrder, field: usize) -> &[f64] {
        self.histories[order_index(order)].get(field).map_or(&[], Vec::as_slice)
    }

    /// Histories and scalars of a step of this length.
    pub fn begin(&mut self, increment: f64) {
        let Self { scheme, factors, of_step, fields, histories, open, before, order, .. } = self;
        let lengths = Lengths::new(increment, before).at_most(*order);
        for of in fields {
            let [before, now] = &mut of.lost;
            now.clone_from(before);
            let Rows(rows) = scheme.in_equations(of.form, lengths);
            for (order, row) in rows.iter().enumerate().filter(|(order, _)| !of.kept[*order].is_empty()) {
                past(row, &of.kept, &mut histories[order][of.field]);
            }
            match of.form {
                RateForm::Second => (factors.velocity, factors.acceleration) = (rows[0].change, rows[1].change),
                _ => factors.rate = rows[0].change,
            }
        }
        *of_step = *factors;
        *open = Some(increment);
        self.set_apart();
    }

    /// The rates are those that are kept, whatever the unknowns are: where time starts, and at the end of a step.
    pub fn hold(&mut self) {
        self.factors = RateFactors::default();
        for of in &self.fields {
            for (histories, kept) in self.histories.iter_mut().zip(&of.kept) {
                histories[of.field].clone_from(kept);
            }
        }
        self.open = None;
        self.join();
    }

    /// Whether the rates at the end of a step are other than those its equations are written with: they stand within the step,
    /// or terms see no second rates in them, or those of nodes without mass are made of values.
    #[must_use]
    pub fn change_at_end(&self) -> bool {
        let are_made = !self.without_mass.is_empty() && self.scheme.keeps_errors_of_given();
        self.scheme.offset() != 0.0 || self.apart.is_some() || are_made
    }

    /// The state at the end of the step that was begun: `u` holds what its equations were solved for, `before` the state
    /// at its start. Schemes with their equations within a step extrapolate to its end, for fields with rates.
    pub fn finish(&mut self, u: &mut [f64], before: &[f64]) {
        if !self.change_at_end() || self.open.is_none() {
            return;
        }
        self.extrapolate(u, before);
        self.keep(u, before);
        self.hold();
    }

    /// Moves fields with rates from where the equations of a step stand to its end; `before` is the state at its start.
    pub fn extrapolate(&self, u: &mut [f64], before: &[f64]) {
        self.stretch(u, before, 1.0 / (1.0 - self.scheme.offset()));
    }

    /// Moves them from the end of a step to where its equations stand.
    pub fn draw_back(&self, u: &mut [f64], before: &[f64]) {
        self.stretch(u, before, 1.0 - self.scheme.offset());
    }

    fn stretch(&self, u: &mut [f64], before: &[f64], factor: f64) {
        for d in self.fields.iter().flat_map(|of| of.dofs.clone()).filter(|_| factor != 1.0) {
            u[d] = before[d] + factor * (u[d] - before[d]);
        }
    }

    /// What the step that was begun misses of a smooth solution, see [`Scheme::misses`]; `None` for a field without rates
    /// and where no step was begun.
    #[must_use]
    pub fn misses(&self, field: usize) -> Option<[f64; MOST_ORDER]> {
        Some(self.scheme.misses(self.of(field)?.form, self.lengths()?))
    }

    /// What the step that was begun would miss by backward differentiation of an order, times the derivative behind it;
    /// `None` where that cannot be chosen.
    #[must_use]
    pub fn misses_with(&self, field: usize, order: usize) -> Option<f64> {
        let of = self.of(field)?;
        let (lengths, most) = (Lengths::new(self.open?, &self.before), self.scheme.most_order(of.form));
        let is_choice = most > 2 && (2..=most.min(lengths.order())).contains(&order);
        is_choice.then(|| self.scheme.misses(of.form, lengths.at_most(order))[order - 1])
    }

    /// The order of backward differentiation in the step that was begun, of a field whose order can be chosen.
    #[must_use]
    pub fn order(&self, field: usize) -> Option<usize> {
        let most = self.scheme.most_order(self.of(field)?.form);
        Some(self.lengths()?.at_most(most).order()).filter(|_| most > 2)
    }

    fn of(&self, field: usize) -> Option<&FieldRates> {
        self.fields.iter().find(|of| of.field == field)
    }

    /// Those of the step that was begun.
    fn lengths(&self) -> Option<Lengths> {
        Some(Lengths::new(self.open?, &self.before).at_most(self.order))
    }

    /// The end `u` of the step that was begun at `before` becomes the past.
    pub fn keep(&mut self, u: &[f64], before: &[f64]) {
        if let Some(kept) = self.at_end(u, before) {
            for (of, kept) in self.fields.iter_mut().zip(kept) {
                of.kept = kept;
                let [before, now] = &mut of.lost;
                before.clone_from(now);
            }
            self.before = self.with_open();
            self.open = None;
        }
    }

    /// The increments of the last steps with the one that was begun.
    fn with_open(&self) -> Vec<f64> {
        self.open.iter().chain(&self.before).copied().take(MOST_ORDER - 1).collect()
    }

    /// What is kept at the end `u` of the step that was begun at `before`; `None` where that is done.
    fn at_end(&self, u: &[f64], before: &[f64]) -> Option<Vec<[Vec<f64>; KEPT]>> {
        self.open?;
        let of_field = |of: &FieldRates| {
            let rows = self.rows_at_end(of)?;
            let mut made: [Vec<f64>; KEPT] = std::array::from_fn(|slot| vec![0.0; of.kept[slot].len()]);
            for (Both { own: row, .. }, made) in rows.iter().zip(&mut made).filter(|(_, made)| !made.is_empty()) {
                past(row, &of.kept, made);
                let change = |k: usize, d: usize| of.change(k, u[d] - before[d]);
                made.iter_mut()
                    .zip(of.dofs.clone())
                    .enumerate()
                    .for_each(|(k, (m, d))| *m += row.change * change(k, d));
            }
            Some(made)
        };
        let mut all = self.fields.iter().map(of_field).collect::<Option<Vec<_>>>()?;
        for slot in 0..KEPT {
            let Some(missing) = self.missing(slot, [u, before], self.made_of_values.as_deref(), Self::rows_at_end)
            else {
                continue;
            };
            for (of, made) in self.fields.iter().zip(&mut all).filter(|(_, made)| !made[slot].is_empty()) {
                made[slot].iter_mut().zip(&missing[of.dofs.clone()]).for_each(|(m, x)| *m += x);
            }
        }
        Some(all)
    }

    /// What later steps depend on, at the end `u` of a step that began at `before`.
    #[must_use]
    pub fn memory(&self, u: &[f64], before: &[f64]) -> RatesMemory {
        let RateFactors { rate, velocity, acceleration } = self.of_step;
        let ended = self.at_end(u, before);
        let ended = ended.unwrap_or_else(|| self.fields.iter().map(|of| of.kept.clone()).collect());
        let lost = self.fields.iter().map(|of| of.lost[1].clone());
        let kept = ended.into_iter().zip(lost).flat_map(|(kept, lost)| kept.into_iter().chain([lost])).collect();
        RatesMemory { factors: [rate, velocity, acceleration], before: self.with_open(), kept }
    }

    /// Goes back to what was remembered; false, and nothing is changed, if that belongs to other fields.
    #[must_use]
    pub fn recall(&mut self, memory: &RatesMemory) -> bool {
        let lengths = self.fields.iter().flat_map(|of| of.kept.iter().chain(&of.lost[..1]).map(Vec::len));
        if !lengths.eq(memory.kept.iter().map(Vec::len)) {
            return false;
        }
        let mut kept = memory.kept.iter();
        for of in &mut self.fields {
            for slot in of.kept.iter_mut().chain(&mut of.lost[..1]) {
                slot.clone_from(kept.next().expect("as many as were counted"));
            }
            let [before, now] = &mut of.lost;
            now.clone_from(before);
        }
        self.hold();
        self.before.clone_from(&memory.before);
        let [rate, velocity, acceleration] = memory.factors;
        self.factors = RateFactors { rate, velocity, acceleration };
        self.of_step = self.factors;
        self.recall_apart();
        true
    }
}

/// What a row makes of what is kept, by dof.
fn past(row: &Row, kept: &[Vec<f64>; KEPT], out: &mut [f64]) {
    out.fill(0.0);
    for (factor, kept) in row.kept.iter().zip(kept).filter(|(factor, kept)| **factor != 0.0 && !kept.is_empty()) {
        out.iter_mut().zip(kept).for_each(|(o, k)| *o += factor * k);
    }
}

fn order_index(order: RateOrder) -> usize {
    match order {
        RateOrder::First => 0,
        RateOrder::Second => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn rates(scheme: Scheme) -> Rates {
        let forms = [RateForm::Difference, RateForm::First, RateForm::Second];
        let mut made = Rates::new(scheme, &forms, &[Some(0..2), Some(2..3), Some(3..5)]).unwrap();
        let [first, second, ..] = &mut made.fields_mut()[1].kept;
        (*first, *second) = (vec![1.0, -2.0], vec![0.5, 3.0]);
        made.fields_mut()[0].kept[0] = vec![0.25];
        made.hold();
        made
    }

    #[test]
    fn a_step_can_be_begun_again_and_leaves_the_rates_of_its_last_beginning() {
        let scheme = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
        let (before, after) = ([0.0; 5], [1.0, 2.0, 3.0, 4.0, 5.0]);
        let (mut once, mut twice) = (rates(scheme), rates(scheme));
        once.begin(0.5);
        twice.begin(1.0);
        twice.begin(0.5);
        assert_eq!(once, twice);
        once.keep(&after, &before);
        // r = 2 (x - x_n)/h - r_n
        assert_eq!(once.fields()[0].kept[0], [4.0 * 3.0 - 0.25]);
        assert_eq!(once.fields()[1].kept[0], [4.0 * 4.0 - 1.0, 4.0 * 5.0 + 2.0]);
    }

    #[test]
    fn bdf2_begins_again_with_backward_euler_behind_a_turn() {
        let begun = |turns: bool| {
            let mut made = rates(Scheme::Bdf { most: 2 });
            made.begin(0.2);
            made.keep(&[0.7; 5], &[0.1; 5]);
            if turns {
                made.turn();
            }
            made.begin(0.5);
            (made.factors().rate, made.history(RateOrder::First, 1).to_vec())
        };
        // (2 h + g)/(h (h + g)) and -h/(h + g) times the last quotient 0.6/0.2
        let (factor, history) = begun(false);
        assert!(
            (factor - 1.2 / 0.35).abs() < 1e-14 && (history[0] + 0.5 / 0.7 * 3.0).abs() < 1e-14,
            "{factor} {history:?}"
        );
        assert_eq!(begun(true), (2.0, vec![0.0]));
    }

    #[test]
    fn bdf3_begins_with_the_rates_at_the_start_where_they_are_known() {
        let mut made = rates(Scheme::Bdf { most: 3 });
        made.begin_with_rates();
        made.begin(0.5);
        // the trapezoidal rule: r = 2 (x - x_n)/h - r_n
        assert_eq!((made.factors().rate, made.history(RateOrder::First, 1)), (4.0, &[-0.25][..]));
        assert_eq!(made.order(1), Some(2));
        made.keep(&[1.0; 5], &[0.0; 5]);
        made.begin(0.5);
        // the cubic through three values with the rate at the first one: 2 (x - x_n)/h - 2 (x_n - x_s)/h + r_s
        assert_eq!((made.factors().rate, made.history(RateOrder::First, 1)), (4.0, &[-4.0 + 0.25][..]));
        assert_eq!((made.order(1), made.order(2)), (Some(3), None));
        made.take_order(2);
        made.begin(0.5);
        assert_eq!((made.order(1), made.factors().rate), (Some(2), 3.0));
    }

    #[test]
    fn a_memory_brings_back_the_same_bits() {
        for scheme in [
            Scheme::BackwardEuler,
            Scheme::Alpha(Alpha::generalised(0.8)),
            Scheme::Bdf { most: 2 },
            Scheme::Bdf { most: 3 },
        ] {
            let (before, mut after) = ([0.1; 5], [1.0 / 3.0, 2.0, 3.0, 4.7, 5.1]);
            let mut ended = rates(scheme);
            ended.begin(0.2);
            ended.keep(&[0.7; 5], &before);
            ended.begin(0.3);
            ended.finish(&mut after, &before);
            let mut resumed = rates(scheme);
            assert!(resumed.recall(&ended.memory(&after, &before)));
            ended.keep(&after, &before);
            resumed.keep(&after, &before);
            ended.begin(0.3);
            resumed.begin(0.3);
            assert_eq!(ended, resumed);
            assert!(!resumed.recall(&RatesMemory::default()));
        }
    }
}
