//! Unknowns that move as they are prescribed.
//!
//! Newmark's rule, and the methods made of it, follow the rates at the end of a step from those at its start and the change:
//! r = 2 (x - x_n)/h - r_n. Where the change is given, nothing damps an error of those rates: it stays with changing sign,
//! and that of second rates grows. So what is prescribed is differentiated by backward differences of second order, which
//! forget: its rates and the forces that follow from them are of second order in the step (second rates where steps are equal or
//! change slowly), and the impulse of a sudden motion is whole.
//! Backward differentiation has no step before its first one, and begins with differences: a given motion that begins with an
//! acceleration would have half of that, and, where the next steps are shorter, a multiple. Where something is driven, it begins with a step
//! before that had the rates where time starts, for all unknowns: two rules in one matrix of masses would not keep an impulse.
//! The equations are written with one scalar for all dofs; what is missing is added to the histories.

use std::ops::Range;

use wfl_compiler::types::RateForm;

use super::{
    FieldRates, Rates, Row, Rows, past,
    scheme::{KEPT, Lengths, Scheme},
};
use crate::frames::Frames;

/// The directions of unknowns that move as they are prescribed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Driven {
    /// Dofs that are components, rising.
    plain: Vec<usize>,
    /// Nodes with directions that are no axes: the first dof, and by component the row of the projection onto them.
    tilted: Vec<(usize, Vec<[f64; 3]>)>,
}

impl Driven {
    /// Dofs in local frames, rising, whose values are prescribed and change in time.
    #[must_use]
    pub fn new(frames: &Frames, dofs: impl IntoIterator<Item = usize>) -> Self {
        let mut made = Self::default();
        for dof in dofs {
            let Some(frame) = frames.of(dof) else {
                made.plain.push(dof);
                continue;
            };
            if made.tilted.last().is_none_or(|(first, _)| *first != frame.first) {
                made.tilted.push((frame.first, vec![[0.0; 3]; frame.axes.len()]));
            }
            let axis = &frame.axes[dof - frame.first];
            let (_, rows) = made.tilted.last_mut().expect("pushed above");
            for (row, a) in rows.iter_mut().zip(axis) {
                row.iter_mut().zip(axis).for_each(|(x, b)| *x += a * b);
            }
        }
        made
    }

    /// The same where copies of nodes have what their owners say. `nodes` has the dofs of each node of fields with rates; `update`
    /// gives copies the numbers of their owners, by dof.
    #[must_use]
    pub(crate) fn shared(
        &self,
        n_dofs: usize,
        nodes: impl Iterator<Item = Range<usize>>,
        update: impl Fn(&mut [f64]),
    ) -> Self {
        let mut plain = vec![0.0; n_dofs];
        self.plain.iter().for_each(|d| plain[*d] = 1.0);
        // by column of the projection
        let mut columns = [(); 3].map(|()| vec![0.0; n_dofs]);
        for (first, rows) in &self.tilted {
            for (i, row) in rows.iter().enumerate() {
                columns.iter_mut().zip(row).for_each(|(column, x)| column[first + i] = *x);
            }
        }
        update(&mut plain);
        columns.iter_mut().for_each(|column| update(column));
        let mut made = Self::default();
        for node in nodes {
            made.plain.extend(node.clone().filter(|d| plain[*d] != 0.0));
            let rows: Vec<[f64; 3]> = node.clone().map(|d| [0, 1, 2].map(|j| columns[j][d])).collect();
            if rows.iter().flatten().any(|x| *x != 0.0) {
                made.tilted.push((node.start, rows));
            }
        }
        made
    }

    /// With dofs in the axes of the scene, whole nodes of them.
    fn with(&self, dofs: &[usize]) -> Self {
        let mut plain = [&self.plain, dofs].concat();
        plain.sort_unstable();
        plain.dedup();
        let is_whole = |first: &usize| dofs.binary_search(first).is_ok();
        let tilted = self.tilted.iter().filter(|(first, _)| !is_whole(first)).cloned().collect();
        Self { plain, tilted }
    }

    fn is_empty(&self) -> bool {
        self.plain.is_empty() && self.tilted.is_empty()
    }

    /// Of a vector by dof what acts along these directions. The transpose is the same.
    fn part(&self, v: &mut [f64]) {
        let mut along = vec![0.0; v.len()];
        self.plain.iter().for_each(|d| along[*d] = v[*d]);
        for (first, rows) in &self.tilted {
            let node = &v[*first..][..rows.len()];
            for (x, row) in along[*first..].iter_mut().zip(rows) {
                *x = row.iter().zip(node).map(|(a, b)| a * b).sum();
            }
        }
        v.copy_from_slice(&along);
    }

    /// Whether a field has some of them.
    fn has_some_of(&self, field: &FieldRates) -> bool {
        self.plain.iter().any(|d| field.dofs.contains(d)) || self.tilted.iter().any(|(d, _)| field.dofs.contains(d))
    }
}

/// The rows of a field, and those of its driven unknowns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Both<T> {
    pub(super) own: T,
    pub(super) driven: T,
}

impl Rates {
    /// Unknowns are driven: before the first step. Schemes whose rates of given values are right leave them alone.
    pub fn set_driven(&mut self, driven: Driven) {
        if driven.is_empty() || !self.scheme.begins_with_given() {
            return;
        }
        self.driven = Some(driven.into());
        self.find_made_of_values();
    }

    /// The equations of these dofs have no second rates, which rise: before the first step.
    pub fn set_without_mass(&mut self, dofs: Vec<usize>) {
        self.without_mass = dofs.into();
        self.find_made_of_values();
    }

    /// What has rates of values alone: driven unknowns and those without mass.
    pub(super) fn find_made_of_values(&mut self) {
        let both = self.driven.as_deref().cloned().unwrap_or_default().with(&self.without_mass);
        if both.is_empty() || !self.scheme.keeps_errors_of_given() {
            return;
        }
        for of in self.fields.iter_mut().filter(|of| both.has_some_of(of)) {
            of.kept[2] = vec![0.0; of.dofs.len()];
            if of.form == RateForm::Second {
                of.kept[3] = vec![0.0; of.dofs.len()];
            }
        }
        self.made_of_values = Some(both.into());
    }

    /// What is driven.
    #[must_use]
    pub(crate) fn driven(&self) -> Option<&Driven> {
        self.driven.as_deref()
    }

    /// Whether some unknowns are driven.
    #[must_use]
    pub fn are_driven(&self) -> bool {
        self.driven.is_some()
    }

    /// The rates of driven unknowns where time starts, first and second ones by dof, are exact: the step before the first one, of
    /// the same length, had the means of a motion with these. A value that jumps in the first step acts with its whole impulse
    /// then, which it would not behind a step of no length.
    pub fn begin_driven(&mut self, first: &[f64], second: &[f64], increment: f64) {
        for of in &mut self.fields {
            let [_, _, of_value, of_rate, ..] = &mut of.kept;
            for (quotient, d) in of_value.iter_mut().zip(of.dofs.clone()) {
                *quotient = first[d] - 0.5 * increment * second[d];
            }
            for (quotient, d) in of_rate.iter_mut().zip(of.dofs.clone()) {
                *quotient = second[d];
            }
        }
        self.before = vec![increment];
    }

    /// The length of the step before the one that was begun; `None` where there was none.
    #[must_use]
    pub fn length_before(&self) -> Option<f64> {
        self.before.first().copied()
    }

    /// Adds to the histories of the step that was begun at `before` what driven unknowns miss of their rates; `u` has their
    /// values where the equations stand.
    pub fn drive(&mut self, u: &[f64], before: &[f64]) {
        for slot in 0..2 {
            let Some(missing) = self.missing(slot, [u, before], self.driven(), Self::rows_in_equations) else {
                continue;
            };
            for k in 0..self.fields.len() {
                let of = &self.fields[k];
                if of.kept[slot].is_empty() {
                    continue;
                }
                let Some(own) = self.own_history(of, slot) else { return };
                let all = own.iter().zip(&missing[of.dofs.clone()]).map(|(h, m)| h + m).collect();
                let field = of.field;
                self.all_histories_mut()[slot][field] = all;
            }
        }
    }

    /// The history of a rate by the rows of the scheme.
    fn own_history(&self, of: &FieldRates, slot: usize) -> Option<Vec<f64>> {
        let rows = self.rows_in_equations(of)?;
        let mut own = vec![0.0; of.dofs.len()];
        past(&rows[slot].own, &of.kept, &mut own);
        Some(own)
    }

    /// By slot and dof what [`Self::drive`] has added to the histories; empty where nothing is driven.
    pub(super) fn added_to_histories(&self) -> [Vec<f64>; 2] {
        let n = if self.are_driven() { self.fields.iter().map(|of| of.dofs.end).max().unwrap_or(0) } else { 0 };
        [0, 1].map(|slot| {
            let mut added = vec![0.0; n];
            for of in self.fields.iter().filter(|of| n > 0 && !of.kept[slot].is_empty()) {
                let Some(own) = self.own_history(of, slot) else { continue };
                let with = &self.histories_of(slot)[of.field];
                added[of.dofs.clone()].iter_mut().zip(with.iter().zip(&own)).for_each(|(x, (h, own))| *x = h - own);
            }
            added
        })
    }

    /// By dof what a number that a step makes misses by the rows of the scheme of that by the rows of driven unknowns, along these; zero
    /// along all others. `None` where both have the same rows.
    pub(super) fn missing<const N: usize>(
        &self,
        slot: usize,
        [u, before]: [&[f64]; 2],
        along: Option<&Driven>,
        rows: impl Fn(&Self, &FieldRates) -> Option<[Both<Row>; N]>,
    ) -> Option<Vec<f64>> {
        let along = along?;
        let mut all = Vec::new();
        for of in self.fields.iter().filter(|of| !of.kept[slot].is_empty()) {
            let Some(rows) = rows(self, of).filter(|rows| rows[slot].driven != rows[slot].own) else { continue };
            all.resize(u.len(), 0.0);
            let row = rows[slot].driven.minus(rows[slot].own);
            let made = &mut all[of.dofs.clone()];
            past(&row, &of.kept, made);
            let changes = of.dofs.clone().enumerate().map(|(k, d)| of.change(k, u[d] - before[d]));
            made.iter_mut().zip(changes).for_each(|(m, change)| *m += row.change * change);
        }
        if all.is_empty() {
            return None;
        }
        along.part(&mut all);
        Some(all)
    }

    /// Of a vector by dof what acts along the directions of driven unknowns.
    pub(super) fn part_of_driven(&self, v: &mut [f64]) {
        match &self.driven {
            Some(driven) => driven.part(v),
            None => v.fill(0.0),
        }
    }

    /// The lengths that rates of given values are made with in the step that was begun, by backward differentiation of second order;
    /// `None` where they have the rows of all others.
    fn lengths_of_given(&self) -> Option<Lengths> {
        let lengths = Lengths::new(self.open?, &self.before).at_most(2);
        Some(lengths).filter(|_| self.scheme.keeps_errors_of_given())
    }

    /// What is kept at the end of the step that was begun, as rows. What driven unknowns keep beside their rates is kept for all
    /// unknowns of the field and read for those alone.
    pub(super) fn rows_at_end(&self, of: &FieldRates) -> Option<[Both<Row>; KEPT]> {
        let own = self.scheme.at_end(of.form, self.lengths()?);
        let Some(lengths) = self.lengths_of_given().filter(|_| self.made_of_values.is_some()) else {
            return Some(own.map(|row| Both { own: row, driven: row }));
        };
        let driven = Scheme::of_given(lengths);
        let rates = |slot| if slot < 2 { own[slot] } else { driven[slot] };
        Some(std::array::from_fn(|slot| Both { own: rates(slot), driven: driven[slot] }))
    }

    /// The rates that the equations of the step that was begun are written with.
    pub(super) fn rows_in_equations(&self, of: &FieldRates) -> Option<[Both<Row>; 2]> {
        let Rows(own) = self.scheme.in_equations(of.form, self.lengths()?);
        let lengths = self.lengths_of_given().filter(|_| self.are_driven());
        let Rows(driven) = lengths.map_or(Rows(own), |lengths| self.scheme.of_given_in_equations(lengths));
        Some([0, 1].map(|slot| Both { own: own[slot], driven: driven[slot] }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{frames::Frame, rates::Alpha};
    use wfl_compiler::types::RateOrder;

    /// The rates of one unknown, in a plane of two components, of which the one along (3, 4)/5 is driven.
    fn driven(scheme: Scheme, form: RateForm, first: [f64; 2], increment: f64) -> Rates {
        let mut made = Rates::new(scheme, &[form], &[Some(0..2)]).unwrap();
        let axes = vec![vec![0.6, 0.8], vec![-0.8, 0.6]];
        made.set_driven(Driven::new(&Frames::new(vec![Frame { first: 0, axes }], 2), [0]));
        let [first, second] = first.map(along);
        made.take(&first, &second);
        made.begin_driven(&first, &second, increment);
        made
    }

    fn along(x: f64) -> [f64; 2] {
        [0.6 * x, 0.8 * x]
    }

    /// The rates after n steps up to t = 1 of a motion that is given, each second step shorter by this part.
    fn rates(scheme: Scheme, form: RateForm, part: f64, n: u32) -> [f64; 2] {
        let (motion, start) = (|t: f64| (3.0 * t).sin() / 3.0, [1.0, 0.0]);
        let mut made = driven(scheme, form, start, 1.0 / f64::from(n));
        let (mut t, mut x) = (0.0, along(motion(0.0)));
        for k in 0..n {
            let h = (1.0 + if k % 2 == 0 { part } else { -part }) / f64::from(n);
            t += h;
            let end = along(motion(t));
            made.begin(h);
            let offset = scheme.offset();
            made.drive(&[0, 1].map(|i| end[i] + offset * (x[i] - end[i])), &x);
            made.keep(&end, &x);
            x = end;
        }
        made.hold();
        [RateOrder::First, RateOrder::Second].map(|order| made.history(order, 0).first().map_or(0.0, |r| r / 0.6))
    }

    const SCHEMES: [Scheme; 4] = [
        Scheme::TRAPEZOIDAL,
        Scheme::Newmark { beta: 0.3025, gamma: 0.6 },
        Scheme::Alpha(Alpha { alpha_m: 0.0, alpha_f: 0.1, rate: 0.1 }),
        Scheme::Alpha(Alpha { alpha_m: 0.2, alpha_f: 0.4, rate: 0.3 }),
    ];

    #[test]
    fn rates_of_a_given_motion_are_of_second_order() {
        let exact = [3.0f64.cos(), -3.0 * 3.0f64.sin()];
        // second rates are differences of first ones, whose errors change with the steps
        for (scheme, (rate, part)) in SCHEMES.into_iter().flat_map(|s| [(0, 0.0), (0, 0.2), (1, 0.0)].map(|of| (s, of)))
        {
            for form in [RateForm::First, RateForm::Second].into_iter().skip(rate) {
                let error = |n| (rates(scheme, form, part, n)[rate] - exact[rate]).abs();
                let (coarse, fine) = (error(100), error(200));
                assert!(fine < 2e-3 && fine < 0.3 * coarse, "{scheme:?} {form:?} {rate} {part}: {coarse} {fine}");
            }
        }
    }

    /// Backward differentiation takes a parabola as it is from the first step on, however long the steps behind it are.
    #[test]
    fn a_motion_may_begin_with_an_acceleration() {
        for scheme in SCHEMES.into_iter().chain([2, 3].map(|most| Scheme::Bdf { most })) {
            let motion = |t: f64| 0.3 * t + 0.5 * t * t;
            let mut made = driven(scheme, RateForm::Second, [0.3, 1.0], 0.1);
            let mut t = 0.0;
            for h in [0.1, 1e-4, 0.02, 0.05] {
                let (x, end) = (along(motion(t)), along(motion(t + h)));
                t += h;
                made.begin(h);
                let offset = scheme.offset();
                made.drive(&[0, 1].map(|i| end[i] + offset * (x[i] - end[i])), &x);
                let in_step = made.second(&end, &x)[0] / 0.6;
                assert!(offset != 0.0 || (in_step - 1.0).abs() < 1e-8, "{scheme:?}: {in_step}");
                // once more from what is remembered, as behind a step that was rejected
                let memory = made.memory(&end, &x);
                made.keep(&end, &x);
                let mut other = made.clone();
                assert!(other.recall(&memory));
                other.begin(0.3);
                made.begin(0.3);
                assert_eq!(made.histories, other.histories);
                made.hold();
                let [rate, second] = [RateOrder::First, RateOrder::Second].map(|order| made.history(order, 0)[0] / 0.6);
                assert!((rate - 0.3 - t).abs() < 1e-9 && (second - 1.0).abs() < 1e-8, "{scheme:?}: {rate} {second}");
            }
        }
    }

    #[test]
    fn a_sudden_motion_is_forgotten_and_its_impulse_is_whole() {
        for scheme in SCHEMES.into_iter().chain([Scheme::Bdf { most: 2 }]) {
            let h = 0.01;
            let mut made = driven(scheme, RateForm::Second, [0.0, 0.0], h);
            let (mut x, mut impulse) = (0.0, 0.0);
            for step in 0..9 {
                let end = x + 2.0 * h;
                made.begin(h);
                made.keep(&along(end), &along(x));
                x = end;
                made.hold();
                let [rate, second] = [RateOrder::First, RateOrder::Second].map(|order| made.history(order, 0)[0] / 0.6);
                impulse += h * second;
                assert!(step < 4 || (rate - 2.0).abs() < 1e-12 && second.abs() < 1e-9, "{scheme:?}: {rate} {second}");
            }
            assert!((impulse - 2.0).abs() < 1e-10, "{scheme:?}: {impulse}");
        }
    }

    #[test]
    fn copies_have_what_their_owners_say() {
        let axes = vec![vec![0.6, 0.8], vec![-0.8, 0.6]];
        let owner = Driven::new(&Frames::new(vec![Frame { first: 2, axes }], 6), [2, 5]);
        let nodes = || (0..3).map(|k| 2 * k..2 * k + 2);
        assert_eq!(owner.shared(6, nodes(), |_| ()), owner);
        // another rank has the nodes as copies and knows of nothing
        let columns = std::cell::RefCell::new(Vec::new());
        let _ = owner.shared(6, nodes(), |column| columns.borrow_mut().push(column.to_vec()));
        let of_owner = std::cell::RefCell::new(columns.into_inner().into_iter());
        let copies = Driven::default().shared(6, nodes(), |column| {
            column.copy_from_slice(&of_owner.borrow_mut().next().expect("as many vectors"));
        });
        assert_eq!(copies, owner);
    }
}
