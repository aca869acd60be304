//! A step to one side: where points are between two branches, the equations of what the unknowns move by have pieces, and
//! Newton's method finds the one that its own solution lies on.
//!
//! With `F'(u; du)` what the equations change by along `du`, which is linear on each piece, `F'(u; du) = 0` at the free dofs.
//! Each iterate takes the tangent of the piece that it lies on; where that does not bring it nearer, a part of the way. A
//! second search from the other side tells whether the solution is the only one.

use wfl::Diagnostic;
use wfl_discrete::{assemble::FieldValues, system::StateValues};
use wfl_run::PassedStep;
use wfl_sparse::csr::Csr;

use super::{Forwards, Moving, Weighed};
use crate::refused::{no_side, not_made};

/// Iterations at most.
const MOST: usize = 100;
/// So many of them go all the way: from piece to piece the error may grow before the last one is met.
const WHOLE: usize = 30;
/// The parts of the way that are tried.
const SMALLEST_PART: f64 = 1.0 / 256.0;
/// Equations of a field that are met to this part of the largest summands among them are met: rounding of some thousand.
const MET: f64 = 1e-12;
/// The same where rounding leaves more, of summands that cancel.
const NEARLY_MET: f64 = 1e-9;
/// Summands of a field that are smaller than this part of all are rounding of what moves others.
const SMALL: f64 = 1e-10;
/// Solutions further apart than this part of the larger one are two.
const OTHER: f64 = 1e-6;

/// An iterate: what the unknowns move by, and what the equations are off by.
struct Iterate {
    u: Vec<f64>,
    rows: Vec<f64>,
    error: f64,
    correction: Vec<f64>,
}

impl Forwards<'_, '_> {
    /// Finds out whether points of the equations are between two branches.
    pub(super) fn look(&mut self, step: &PassedStep, one: &Moving) {
        let Some(mut sided) = self.sided.take() else { return };
        let values = self.standing.solving.system.values(&step.u);
        let (current, previous) = self.values(&values, one);
        let values = FieldValues { current: &current, previous: &previous, rates: one.rates.as_ref() };
        let decides = sided.look(self.extended, values);
        self.decides = decides;
        self.sided = Some(sided);
    }

    /// What the unknowns move by, on the branches that this leads to; `one` has what is prescribed.
    pub(super) fn step_to_side(&mut self, step: &PassedStep, one: &mut Moving) -> Result<(), Box<Diagnostic>> {
        let prescribed = one.end.u.clone();
        let Some(found) = self.search(step, one, &prescribed, prescribed.clone())? else {
            return Err(no_side(step.window.end));
        };
        // as far on the other side of what is prescribed
        let mirrored = prescribed.iter().zip(&found.u).map(|(p, u)| 2.0 * p - u).collect();
        let other = self.search(step, one, &prescribed, mirrored).ok().flatten();
        if other.is_some_and(|other| self.are_two(&found.u, &other.u)) {
            let told = format!(
                "at t = {} more than one choice of branches solves the equations to this side: the derivative is that of one \
                 of them",
                step.window.end
            );
            if !self.told.contains(&told) {
                self.told.push(told);
            }
        }
        one.end.u = found.u;
        one.rows = found.rows;
        self.standing.solving.system.numbering.turn(&mut one.rows);
        Ok(())
    }

    /// True if two solutions differ in a field by more than rounding.
    fn are_two(&self, a: &[f64], b: &[f64]) -> bool {
        let system = &self.standing.solving.system;
        (0..system.fields.len()).filter_map(|k| system.range(k)).any(|range| {
            let (a, b) = (&a[range.clone()], &b[range]);
            let size = a.iter().chain(b).fold(0.0f64, |m, x| m.max(x.abs()));
            a.iter().zip(b).any(|(x, y)| (x - y).abs() > OTHER * size)
        })
    }

    /// Newton's method from `start`; nothing where it ends on no piece of its own.
    fn search(
        &mut self,
        step: &PassedStep,
        one: &mut Moving,
        prescribed: &[f64],
        start: Vec<f64>,
    ) -> Result<Option<Iterate>, Box<Diagnostic>> {
        one.end.u = start;
        let (mut best, mut part): (Option<Iterate>, f64) = (None, 1.0);
        for iteration in 0..MOST {
            let (rows, sizes) = self.residual_and_sizes(step, one)?;
            let matrix = self.matrix_to_side(step, one)?;
            let error = self.error(&matrix, (&rows, sizes), (&one.end.u, prescribed));
            let is_better = best.as_ref().is_none_or(|best| error < best.error);
            if is_better || iteration < WHOLE {
                let rhs: Vec<f64> = rows.iter().map(|x| -x).collect();
                let u = one.end.u.clone();
                if error <= MET {
                    return Ok(Some(Iterate { u, rows, error, correction: Vec::new() }));
                }
                let system = &self.standing.solving.system;
                let correction = self.tangent.solve_with(system, matrix, &rhs, self.of.threads)?;
                one.end.u.iter_mut().zip(&correction).for_each(|(u, x)| *u += x);
                part = 1.0;
                if is_better {
                    best = Some(Iterate { u, rows, error, correction });
                }
                if iteration + 1 != WHOLE {
                    continue;
                }
            } else {
                part *= 0.5;
            }
            let Some(best) = best.as_ref().filter(|_| part >= SMALLEST_PART) else { break };
            one.end.u = best.u.iter().zip(&best.correction).map(|(u, x)| u + part * x).collect();
        }
        // what rounding leaves where summands cancel
        Ok(best.filter(|best| best.error <= NEARLY_MET))
    }

    /// The tangent on the piece that a direction lies on.
    fn matrix_to_side(&self, step: &PassedStep, one: &Moving) -> Result<Csr, Box<Diagnostic>> {
        let system = &self.standing.solving.system.with_matrix().map_err(|e| not_made(&e.to_string()))?;
        let Some(sided) = &self.sided else { return Err(not_made("laws to one side were not made")) };
        let of = system.values(&step.u);
        let (current, previous) = self.values(&of, one);
        let values = FieldValues { current: &current, previous: &previous, rates: one.rates.as_ref() };
        let mut tangent = system.new_tangent();
        let made = sided.with_stand_ins(values, |others| system.tangent_with(&step.u, others, &mut tangent));
        made.map_err(|e| not_made(&e.to_string()))?;
        system.whole_matrix(&tangent).map_err(|e| not_made(&e.to_string()))
    }

    /// What the equations change by, and by dof the sizes of what the terms add to that: they may cancel.
    fn residual_and_sizes(&mut self, step: &PassedStep, one: &Moving) -> Result<(Vec<f64>, Vec<f64>), Box<Diagnostic>> {
        let n = one.end.u.len();
        let (mut rows, mut sizes) = (vec![0.0; n], vec![0.0; n]);
        for term in 0..self.standing.solving.system.terms.len() {
            let of_term = self.residual_of(step, one, |k| k == term)?;
            for (k, x) in of_term.iter().enumerate() {
                rows[k] += x;
                sizes[k] += x.abs();
            }
        }
        Ok((rows, sizes))
    }

    /// The largest part of the summands of its field that an equation is off by: at another branch than that of a point it is
    /// off by the size of what the branch changes.
    fn error(&self, matrix: &Csr, off: (&[f64], Vec<f64>), moved: (&[f64], &[f64])) -> f64 {
        let system = &self.standing.solving.system;
        let numbering = &system.numbering;
        let gathered = |v: &[f64]| {
            let mut own = Vec::new();
            numbering.gather(v, &mut own);
            own
        };
        let (mut rows, mut sizes) = (off.0.to_vec(), off.1);
        numbering.turn(&mut rows);
        numbering.turn_sizes(&mut sizes);
        let mut x: Vec<f64> = moved.0.iter().zip(moved.1).map(|(u, p)| u - p).collect();
        numbering.frames.turn(&mut x);
        let (rows, sizes, x) = (gathered(&rows), gathered(&sizes), gathered(&x));
        let mut by_field = vec![[0.0f64; 2]; system.fields.len()];
        for (row, (off, size)) in rows.iter().zip(&sizes).enumerate() {
            let (columns, values) = matrix.row(row);
            let summands: f64 = columns.iter().zip(values).map(|(k, a)| (a * x[*k as usize]).abs()).sum();
            let [most_off, largest] = &mut by_field[system.field_of(numbering.free_dofs[row] as usize)];
            // not a number is no solution
            *most_off = if off.is_nan() { f64::INFINITY } else { most_off.max(off.abs()) };
            *largest = largest.max(size.max(summands));
        }
        let all = by_field.iter().fold(0.0f64, |m, of| m.max(of[1]));
        let part = |[off, size]: &[f64; 2]| if *off == 0.0 { 0.0 } else { off / size.max(SMALL * all) };
        by_field.iter().map(part).fold(0.0, f64::max)
    }

    /// What a measure does to one side; nothing for one without kinks.
    pub(super) fn measure_to_side(
        &self,
        result: (usize, &Weighed),
        step: &PassedStep,
        at: (&StateValues<'_>, FieldValues<'_>),
    ) -> Option<f64> {
        let (number, weighed) = result;
        let (values, made) = at;
        let sided = self.sided.as_ref()?.measure(self.extended, number, made);
        let of = (self.extended, &self.standing.solving);
        let lists = weighed.taken_at(of, values.view(), step.window);
        if sided.iter().all(Option::is_none) && !lists.shared {
            return None;
        }
        let moved = self.laws.points(self.extended, (number, &lists.counts), made);
        let moved: Vec<Vec<f64>> = moved.into_iter().zip(sided).map(|(plain, sided)| sided.unwrap_or(plain)).collect();
        Some(lists.along(&moved))
    }
}
