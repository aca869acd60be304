//! Rates along a direction, and what a result follows of rates: what is kept is linear in what fields were.
//!
//! With the rows of the scheme a step reads `history = rows.kept`, and leaves `kept' = change (x - x_n) + rows.kept`. Along a
//! direction the same rows act on what the fields move by; a result goes back through their transposes. Both take the
//! lengths of the steps as they are.

use super::{FieldRates, Rates, Row, driven::Both, order_index, scheme::KEPT};
use wfl_compiler::types::RateOrder;

/// What is kept between two steps: by field with rates, by slot, by dof.
pub type Kept = Vec<[Vec<f64>; KEPT]>;

impl Rates {
    /// The step that was begun, with what was kept before it.
    #[must_use]
    pub fn as_begun(&self) -> Self {
        self.clone()
    }

    /// Whether rates are those that are kept, whatever the unknowns are.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.open.is_none()
    }

    /// Nothing is kept.
    #[must_use]
    pub fn nothing(&self) -> Kept {
        let zeros = |of: &FieldRates| std::array::from_fn(|slot| vec![0.0; of.kept[slot].len()]);
        self.fields.iter().map(zeros).collect()
    }

    /// The same step where something else was kept: along a direction.
    #[must_use]
    pub fn along(&self, kept: &Kept) -> Self {
        let mut made = self.clone();
        for (of, kept) in made.fields.iter_mut().zip(kept) {
            of.kept.clone_from(kept);
            of.lost = [Vec::new(), Vec::new()];
        }
        match self.open {
            Some(increment) => made.begin(increment),
            None => made.hold(),
        }
        made
    }

    /// These rates, with the histories of others behind those of `n` fields.
    #[must_use]
    pub fn with_behind(&self, others: &Self, n: usize) -> Self {
        let mut made = self.clone();
        for (own, behind) in made.histories.iter_mut().zip(&others.histories) {
            own.resize(n, Vec::new());
            own.extend_from_slice(behind);
        }
        made
    }

    /// What is kept at the end `u` of the step that was begun at `before`; between two steps what is kept.
    #[must_use]
    pub fn kept_at(&self, u: &[f64], before: &[f64]) -> Kept {
        self.at_end(u, before).unwrap_or_else(|| self.fields.iter().map(|of| of.kept.clone()).collect())
    }

    /// Adds to what a result follows of what was kept, and of driven unknowns where the equations stand and at the start of the
    /// step, what it follows of the histories of the step, which `of` has by order and field.
    pub fn follow_histories<'h>(
        &self,
        of: impl Fn(RateOrder, usize) -> &'h [f64],
        factor: f64,
        ends: [&mut [f64]; 2],
        kept: &mut Kept,
    ) {
        let mut all = [vec![0.0; ends[0].len()], vec![0.0; ends[0].len()]];
        for (own, kept) in self.fields.iter().zip(&mut *kept) {
            for order in [RateOrder::First, RateOrder::Second] {
                let (slot, followed) = (order_index(order), of(order, own.field));
                if own.kept[slot].is_empty() {
                    continue;
                }
                let row = self.rows_in_equations(own).map(|rows| rows[slot].own);
                // between two steps the rates are those that are kept
                let row = row.unwrap_or_else(|| Row {
                    change: 0.0,
                    kept: std::array::from_fn(|k| f64::from(u8::from(k == slot))),
                });
                spread(&row, followed, factor, kept);
                let all = all[slot][own.dofs.clone()].iter_mut().zip(followed);
                all.for_each(|(all, followed)| *all = factor * followed);
            }
        }
        self.follow_missing(all, Self::rows_in_equations, ends, kept);
    }

    /// The transpose of [`Self::missing`], from what a result follows of both rates, by dof.
    fn follow_missing<const N: usize>(
        &self,
        followed: [Vec<f64>; N],
        rows: impl Fn(&Self, &FieldRates) -> Option<[Both<Row>; N]>,
        [u, before]: [&mut [f64]; 2],
        kept: &mut Kept,
    ) {
        if !self.are_driven() {
            return;
        }
        for (slot, mut followed) in followed.into_iter().enumerate() {
            let have_rows = |rows: &[Both<Row>; N]| rows[slot].driven != rows[slot].own;
            self.part_of_driven(&mut followed);
            for (own, kept) in self.fields.iter().zip(&mut *kept).filter(|(own, _)| !own.kept[slot].is_empty()) {
                let Some(rows) = rows(self, own).filter(have_rows) else { continue };
                let row = rows[slot].driven.minus(rows[slot].own);
                for d in own.dofs.clone() {
                    u[d] += row.change * followed[d];
                    before[d] -= row.change * followed[d];
                }
                spread(&row, &followed[own.dofs.clone()], 1.0, kept);
            }
        }
    }

    /// Takes what a result follows of the unknowns at the end of the step, by dof, to those where its equations stand and to
    /// those at its start: the transpose of [`Self::extrapolate`].
    pub fn follow_extrapolation(&self, u: &mut [f64], before: &mut [f64]) {
        let factor = 1.0 / (1.0 - self.scheme.offset());
        for d in self.fields.iter().flat_map(|of| of.dofs.clone()).filter(|_| factor != 1.0) {
            before[d] += (1.0 - factor) * u[d];
            u[d] *= factor;
        }
    }

    /// Takes what a result follows of prescribed values where the equations stand, by dof, to those at the end of the step and,
    /// in `before`, to the values at its start; what fields without rates have stays.
    pub fn follow_prescribed(&self, functional: &mut [f64], end: &mut [f64], before: &mut [f64]) {
        let offset = self.scheme.offset();
        for d in self.fields.iter().flat_map(|of| of.dofs.clone()) {
            let of = std::mem::take(&mut functional[d]);
            end[d] += (1.0 - offset) * of;
            before[d] += offset * of;
        }
    }

    /// Takes what a result follows of what is kept at the end of the step to the unknowns at its end and at its start, by dof,
    /// and to what was kept at its start.
    pub fn follow_end(&self, end: &Kept, ends: [&mut [f64]; 2], kept: &mut Kept) {
        let [u, before] = ends;
        let mut all = [(); KEPT].map(|()| vec![0.0; u.len()]);
        for ((own, end), kept) in self.fields.iter().zip(end).zip(&mut *kept) {
            for (slot, followed) in end.iter().enumerate().filter(|(_, followed)| !followed.is_empty()) {
                let Some(rows) = self.rows_at_end(own) else {
                    kept[slot].iter_mut().zip(followed).for_each(|(k, f)| *k += f);
                    continue;
                };
                let row = rows[slot].own;
                all[slot][own.dofs.clone()].copy_from_slice(followed);
                for (d, f) in own.dofs.clone().zip(followed) {
                    u[d] += row.change * f;
                    before[d] -= row.change * f;
                }
                spread(&row, followed, 1.0, kept);
            }
        }
        self.follow_missing(all, Self::rows_at_end, [u, before], kept);
    }
}

/// The transpose of what a row makes of what is kept.
fn spread(row: &Row, followed: &[f64], factor: f64, kept: &mut [Vec<f64>; KEPT]) {
    for (share, kept) in row.kept.iter().zip(kept).filter(|(share, kept)| **share != 0.0 && !kept.is_empty()) {
        kept.iter_mut().zip(followed).for_each(|(k, f)| *k += factor * share * f);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Alpha, Driven, Scheme, tests::rates};
    use super::*;
    use crate::frames::{Frame, Frames};

    /// A step is linear in the values and in what is kept; its transpose has the same products.
    #[test]
    fn a_step_and_its_transpose() {
        let newmark = Scheme::Newmark { beta: 0.3, gamma: 0.6 };
        let alpha = Scheme::Alpha(Alpha::generalised(0.6));
        let [bdf2, bdf3] = [2, 3].map(|most| Scheme::Bdf { most });
        let of_given =
            [(newmark, 3), (alpha, 3), (newmark, 0), (bdf2, 0), (bdf3, 0)].map(|(scheme, n)| (scheme, n, true));
        for (scheme, n_before, is_driven) in
            [bdf2, bdf3, newmark].map(|scheme| (scheme, 3, false)).into_iter().chain(of_given)
        {
            let mut step = rates(scheme);
            if is_driven {
                let frame = Frame { first: 3, axes: vec![vec![0.6, 0.8], vec![-0.8, 0.6]] };
                step.set_driven(Driven::new(&Frames::new(vec![frame], 5), [2, 3]));
                step.begin_driven(&[0.1, 0.2, 0.3, 0.4, 0.5], &[0.5, 0.4, 0.3, 0.2, 0.1], 0.2);
            }
            for h in &[0.2, 0.3, 0.25][..n_before] {
                let h = *h;
                step.begin(h);
                step.keep(&[h, 1.0, -h, 0.5, 2.0 * h], &[0.1; 5]);
            }
            step.begin(0.4);
            let mut number = 0.3;
            let mut next = || {
                number = (number * 7.13 + 0.37) % 1.0;
                number - 0.5
            };
            let mut any = step.nothing();
            any.iter_mut().flatten().flatten().for_each(|x| *x = next());
            let (u, before): (Vec<f64>, Vec<f64>) = (0..5).map(|_| (next(), next())).unzip();
            let mut back = step.nothing();
            back.iter_mut().flatten().flatten().for_each(|x| *x = next());
            let mut moved = step.along(&any);
            moved.drive(&u, &before);
            let end = moved.kept_at(&u, &before);
            let product = |a: &Kept, b: &Kept| -> f64 {
                a.iter().flatten().flatten().zip(b.iter().flatten().flatten()).map(|(x, y)| x * y).sum()
            };
            let (mut at_end, mut at_start, mut kept) = (vec![0.0; 5], vec![0.0; 5], step.nothing());
            step.follow_end(&back, [&mut at_end, &mut at_start], &mut kept);
            let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
            let transposed = dot(&at_end, &u) + dot(&at_start, &before) + product(&kept, &any);
            assert!((product(&back, &end) - transposed).abs() < 1e-12, "{scheme:?}");
            // what is read in the step
            let weights = [next(), next(), next(), next()];
            let of = |order: RateOrder, field: usize| {
                &weights[order_index(order) * 2..][..moved.history(order, field).len()]
            };
            let (mut read, mut of_u, mut of_before) = (step.nothing(), vec![0.0; 5], vec![0.0; 5]);
            step.follow_histories(of, 1.0, [&mut of_u, &mut of_before], &mut read);
            let histories: f64 = [1, 2]
                .into_iter()
                .flat_map(|field| [(RateOrder::First, field), (RateOrder::Second, field)])
                .map(|(order, field)| dot(moved.history(order, field), of(order, field)))
                .sum();
            let followed = product(&read, &any) + dot(&of_u, &u) + dot(&of_before, &before);
            assert!((followed - histories).abs() < 1e-12, "{scheme:?}: {followed} {histories}");
        }
    }
}
