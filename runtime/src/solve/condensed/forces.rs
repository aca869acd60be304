//! The changing part as forces between bodies.
//!
//! The rows of the changing part C are forces. Rows of facing dofs are opposite (what pulls here pushes there), so with
//! one column of J for each such pair, or single row, `C = J M` where M holds one row of C each. Once
//! `V = K⁻¹ J` is known on the dofs that C reads,
//!
//! ```text
//! (K + J M) x = b      x = K⁻¹ (b - J w)      (1 + M V) w = M K⁻¹ b
//! ```
//!
//! and only the small dense matrix `1 + M V` changes with C. A dof without any stiffness of its own (a multiplier) is
//! its own unknown w: its equation is the row of C as it stands. V is computed once.
//!
//! An older factor of `1 + M V` still serves as preconditioner of GMRES, with the exact product by V and the new M.
//!
//! Promises: the same bytes for any number of threads; memory is kept. K must be positive definite without C.
//! Does not look at residuals: the judge of the caller does.

use std::sync::Arc;

use rayon::prelude::*;

use super::super::SolveError;
use super::super::dense::{Dense, Kind};
use super::super::kernels::dot;
use super::super::krylov::{Gmres, Limits, Outcome};
use super::super::multifrontal::Multifrontal;
use super::super::sweep::{Form, FrontFactor, Sweep};
use super::super::symbolic::Symbolic;
use super::engine::above;
use super::response::{Base, Load, NOTHING};
use crate::csr::{Csr, Pattern};

/// Rows of two dofs are opposite when their sum is below this part of their largest entry.
const OPPOSITE: f64 = 1e-12;
/// Values of V from which a product is shared among threads, and rows in one share.
const PARALLEL_VALUES: usize = 1 << 20;
const SHARE: usize = 128;
/// Rows and columns of the dense matrix that are filled together: what they read of V stays in the cache.
const FILL_ROWS: usize = 16;
const FILL_COLUMNS: usize = 512;
/// Rows made together, the components of a node, and columns that their sums stay in registers for.
const TOGETHER: usize = 3;
const FILL_WIDTH: usize = 16;
/// Part of the right-hand side that rounding leaves in the best of cases.
const ROUNDING: f64 = 1e-15;

/// See the module documentation.
pub(super) struct Forces {
    threads: usize,
    /// Dofs whose rows may be opposite; only those that are not yet seen to differ.
    pairs: Vec<(u32, u32)>,
    /// First dofs of those that do differ.
    apart: Vec<u32>,
    /// Dofs without stiffness.
    is_bare: Vec<bool>,
    /// The forces; those of bare dofs follow.
    loads: Vec<Load>,
    n_loads: usize,
    bare: Vec<u32>,
    /// Dofs with stiffness that C reads.
    read: Vec<u32>,
    /// By dof: place in `read`, or behind it in `bare`.
    place: Vec<u32>,
    /// V, `read x loads` by rows.
    responses: Vec<f64>,
    /// M, `(loads + bare) x dofs`, and where its values stand in C.
    rows: Csr,
    sources: Vec<usize>,
    /// Factor of `(1 + M V)ᵀ`.
    dense: Dense,
    answers: Vec<f64>,
    /// Sweep over the fronts that C can reach; none before the first values of C.
    reduced: Option<Sweep>,
}

/// The factored bulk.
pub(super) struct Bulk<'a> {
    pub(super) symbolic: &'a Symbolic,
    pub(super) factor: &'a Multifrontal,
    /// Over all fronts.
    pub(super) sweep: &'a mut Sweep,
}

/// How the system in the forces is solved.
pub(super) enum Inner<'a> {
    /// With a factor of this matrix.
    Fresh,
    /// With the factor of an earlier one; `scale` by dof makes the equations comparable. The target is a
    /// 2-norm of the scaled residual.
    Stale { gmres: &'a mut Gmres, limits: Limits, scale: &'a [f64] },
}

impl Forces {
    /// For changing parts with this pattern; `pairs` are facing dofs, `is_bare` says by dof what has no stiffness.
    pub(super) fn new(
        changing: &Pattern,
        dofs: &[u32],
        pairs: &[(u32, u32)],
        is_bare: Vec<bool>,
        threads: usize,
    ) -> Result<Self, SolveError> {
        let is_loaded = |dof: u32| !is_bare[dof as usize] && !changing.row(dof as usize).is_empty();
        let (bare, read): (Vec<u32>, Vec<u32>) = dofs.iter().partition(|&&dof| is_bare[dof as usize]);
        let pairs: Vec<(u32, u32)> =
            pairs.iter().copied().filter(|&(a, b)| a != b && is_loaded(a) && is_loaded(b)).collect();
        let n_loads = dofs.iter().filter(|&&dof| is_loaded(dof)).count() - pairs.len();
        let mut place = vec![NOTHING; changing.n_rows()];
        read.iter().chain(&bare).zip(0..).for_each(|(&dof, at)| place[dof as usize] = at);
        Ok(Self {
            threads,
            apart: Vec::new(),
            answers: vec![0.0; dofs.len()],
            is_bare,
            n_loads,
            loads: Vec::new(),
            pairs,
            bare,
            read,
            place,
            responses: Vec::new(),
            rows: Csr::zeros(Arc::new(Pattern::empty(0, changing.n_cols()))),
            sources: Vec::new(),
            dense: Dense::new(0, threads)?,
            reduced: None,
        })
    }

    /// Number of unknown forces, were all pairs opposite.
    pub(super) fn count(changing: &Pattern, pairs: &[(u32, u32)]) -> usize {
        let is_loaded = |dof: u32| !changing.row(dof as usize).is_empty();
        let rows = (0..changing.n_rows() as u32).filter(|&dof| is_loaded(dof)).count();
        rows - pairs.iter().filter(|&&(a, b)| is_loaded(a) && is_loaded(b)).count()
    }

    /// Number of unknown forces; before the first values of the changing part what it will be at least.
    pub(super) fn n_forces(&self) -> usize {
        self.n_loads + self.bare.len()
    }

    /// Multiplications of a new factor, and values read by one product with V and the factor.
    pub(super) fn costs(&self) -> (f64, f64) {
        let n = self.n_forces() as f64;
        let filling = self.rows.pattern().n_entries() as f64 * self.loads.len() as f64;
        (n * n * n / 3.0 + filling, self.responses.len() as f64 + n * n)
    }

    /// First dofs of facing ones whose rows have turned out not to be opposite.
    pub(super) fn apart(&self) -> &[u32] {
        &self.apart
    }

    /// Takes the facing dofs with these first ones as not opposite from the start.
    pub(super) fn part(&mut self, apart: &[u32]) {
        self.apart = apart.to_vec();
        let known: std::collections::BTreeSet<u32> = apart.iter().copied().collect();
        self.pairs.retain(|(a, _)| !known.contains(a));
    }

    /// Takes over the values of the changing part. True if the forces had to be chosen anew: an older factor is then
    /// of no use.
    pub(super) fn take(
        &mut self,
        symbolic: &Symbolic,
        factor: &Multifrontal,
        changing: &Csr,
    ) -> Result<bool, SolveError> {
        let before = self.pairs.len();
        let apart = &mut self.apart;
        self.pairs.retain(|&(a, b)| {
            let keeps = are_opposite(changing, a as usize, b as usize);
            if !keeps {
                apart.push(a);
            }
            keeps
        });
        let is_new = self.reduced.is_none() || self.pairs.len() < before;
        if is_new {
            self.connect(symbolic, factor, changing)?;
        }
        for (value, &source) in self.rows.values_mut().iter_mut().zip(&self.sources) {
            *value = changing.values()[source];
        }
        Ok(is_new)
    }

    fn connect(&mut self, symbolic: &Symbolic, factor: &Multifrontal, changing: &Csr) -> Result<(), SolveError> {
        self.reduced = None;
        let mut other = vec![NOTHING; changing.n_rows()];
        let mut is_second = vec![false; changing.n_rows()];
        for &(a, b) in &self.pairs {
            other[a as usize] = b;
            is_second[b as usize] = true;
        }
        let is_loaded = |dof: usize| !changing.row(dof).0.is_empty() && !self.is_bare[dof] && !is_second[dof];
        self.loads = (0..changing.n_rows())
            .filter(|&dof| is_loaded(dof))
            .map(|dof| Load { here: dof as u32, there: other[dof] })
            .collect();
        self.n_loads = self.loads.len();
        self.loads.sort_by_key(|load| symbolic.ordering.inverse()[load.here as usize]);
        let dofs: Vec<u32> = (0..changing.n_rows() as u32).filter(|dof| self.place[*dof as usize] != NOTHING).collect();
        let members = above(symbolic, &dofs);
        self.responses = Vec::new();
        let base = Base { symbolic, factor, members: &members };
        self.responses = base.responses(&self.loads, &self.read, self.threads)?;
        self.take_rows(changing)?;
        self.dense = Dense::new(self.n_forces(), self.threads)?;
        self.reduced = Some(Sweep::new(symbolic, members, self.threads));
        Ok(())
    }

    /// Finds the rows of M in the changing part.
    fn take_rows(&mut self, changing: &Csr) -> Result<(), SolveError> {
        let pattern = changing.pattern();
        let (mut starts, mut columns) = (vec![0], Vec::new());
        self.sources.clear();
        for dof in self.loads.iter().map(|load| load.here).chain(self.bare.iter().copied()) {
            let range = pattern.row_starts()[dof as usize]..pattern.row_starts()[dof as usize + 1];
            columns.extend_from_slice(pattern.row(dof as usize));
            self.sources.extend(range);
            starts.push(columns.len());
        }
        let pattern = Pattern::new(self.n_forces(), changing.n_cols(), starts, columns)?;
        self.rows = Csr::zeros(Arc::new(pattern));
        Ok(())
    }

    /// Factors `1 + M V`; the smallest pivot relative to its column, and its unknown.
    pub(super) fn factor(&mut self) -> Result<(f64, usize), SolveError> {
        let (n, n_loads, n_read) = (self.n_forces(), self.loads.len(), self.read.len());
        let (rows, place, responses) = (&self.rows, &self.place, &self.responses);
        let threads = self.threads;
        let fill_share = |(share, out): (usize, &mut [f64])| {
            let first = share * FILL_ROWS;
            fill_products(rows, place, (responses, n_read), first, out);
            for (row, out) in (first..).zip(out.chunks_exact_mut(n)) {
                let bare_part = &mut out[n_loads..];
                bare_part.fill(0.0);
                for (&column, value) in rows.row(row).0.iter().zip(rows.row(row).1) {
                    if let Some(bare) = (place[column as usize] as usize).checked_sub(n_read) {
                        bare_part[bare] -= value;
                    }
                }
                if row < n_loads {
                    out[row] += 1.0;
                }
            }
        };
        let fill = |matrix: &mut [f64]| {
            if threads > 1 {
                matrix.par_chunks_mut(FILL_ROWS * n).enumerate().for_each(fill_share);
            } else {
                matrix.chunks_mut(FILL_ROWS * n).enumerate().for_each(fill_share);
            }
        };
        self.dense.factor(Kind::General, fill)
    }

    /// Solves with the changing part taken last, in place, by dof. Iterations say whether they converged.
    pub(super) fn solve(&mut self, bulk: Bulk<'_>, x: &mut [f64], inner: Inner<'_>) -> Outcome {
        let Bulk { symbolic, factor, sweep } = bulk;
        let panels = |front: usize| FrontFactor::Cholesky { panel: factor.panel(front) };
        let own: Vec<f64> = self.bare.iter().map(|&dof| std::mem::take(&mut x[dof as usize])).collect();
        // Down only to what C reads, then up only with the forces.
        sweep.rise(symbolic, panels, x);
        let reduced = self.reduced.as_mut().expect("the changing part has been taken");
        reduced.copy(sweep);
        reduced.descend(symbolic, panels, x);
        let mut w = vec![0.0; self.rows.n_rows()];
        self.rows.multiply(x, &mut w, 1);
        let n_loads = self.loads.len();
        w[n_loads..].iter_mut().zip(&own).for_each(|(w, load)| *w -= load);
        let outcome = match inner {
            Inner::Fresh => {
                self.dense.solve(Form::Transposed, &mut w);
                Outcome { iterations: 0, converged: true }
            }
            Inner::Stale { gmres, limits, scale } => self.iterate(&mut w, gmres, limits, scale),
        };
        if !outcome.converged {
            // The caller makes a new factor: no sweep for what nobody wants.
            x.fill(f64::NAN);
            return outcome;
        }
        x.fill(0.0);
        for (load, value) in self.loads.iter().zip(&w) {
            x[load.here as usize] -= value;
            if load.there != NOTHING {
                x[load.there as usize] += value;
            }
        }
        self.bare.iter().zip(&w[n_loads..]).for_each(|(&dof, value)| x[dof as usize] = *value);
        let reduced = self.reduced.as_mut().expect("the changing part has been taken");
        reduced.rise(symbolic, panels, x);
        sweep.add(reduced);
        sweep.descend(symbolic, panels, x);
        outcome
    }

    /// Solves the transposed system in place, by dof: `(1 + M V)ᵀ v = Jᵀ K⁻¹ b` and `x = K⁻¹ (b - Mᵀ v)`.
    pub(super) fn solve_transposed(&mut self, bulk: Bulk<'_>, x: &mut [f64]) {
        let Bulk { symbolic, factor, sweep } = bulk;
        let panels = |front: usize| FrontFactor::Cholesky { panel: factor.panel(front) };
        let own: Vec<f64> = self.bare.iter().map(|&dof| std::mem::take(&mut x[dof as usize])).collect();
        let loads = x.to_vec();
        sweep.rise(symbolic, panels, x);
        sweep.descend(symbolic, panels, x);
        let at = |dof: u32| if dof == NOTHING { 0.0 } else { x[dof as usize] };
        let jumps = self.loads.iter().map(|load| at(load.here) - at(load.there));
        let mut v: Vec<f64> = jumps.chain(own.iter().map(|load| -load)).collect();
        self.dense.solve(Form::Plain, &mut v);
        let mut forces = vec![0.0; x.len()];
        self.rows.multiply_transposed_add(&v, &mut forces);
        x.iter_mut().zip(&loads).zip(&forces).for_each(|((x, load), force)| *x = load - force);
        let bare_values = &v[self.loads.len()..];
        self.bare.iter().zip(bare_values).for_each(|(&dof, value)| x[dof as usize] = *value);
        sweep.rise(symbolic, panels, x);
        sweep.descend(symbolic, panels, x);
    }

    /// `w = (1 + M V)⁻¹ w` by GMRES; the old factor is the preconditioner, on the right.
    fn iterate(&mut self, w: &mut [f64], gmres: &mut Gmres, limits: Limits, scale: &[f64]) -> Outcome {
        let n_loads = self.loads.len();
        let dofs = self.loads.iter().map(|load| load.here).chain(self.bare.iter().copied());
        let scale: Vec<f64> = dofs.map(|dof| scale[dof as usize]).collect();
        let rhs: Vec<f64> = w.iter().zip(&scale).map(|(w, s)| w * s).collect();
        let target = limits.target.max(ROUNDING * dot(&rhs, &rhs).sqrt());
        let (dense, answers, rows, place) = (&mut self.dense, &mut self.answers, &self.rows, &self.place);
        let (responses, n_read) = (&self.responses, self.read.len());
        let is_parallel = self.threads > 1 && responses.len() > PARALLEL_VALUES;
        let mut multiply = |z: &[f64], out: &mut [f64]| {
            w.iter_mut().zip(z).zip(&scale).for_each(|((w, z), s)| *w = z / s);
            dense.solve(Form::Transposed, w);
            let (read, bare) = answers.split_at_mut(n_read);
            multiply_rows(responses, &w[..n_loads], read, is_parallel);
            bare.iter_mut().zip(&w[n_loads..]).for_each(|(answer, w)| *answer = -w);
            for (row, out) in out.iter_mut().enumerate() {
                let (columns, values) = rows.row(row);
                let sum: f64 = columns.iter().zip(values).map(|(&c, v)| v * answers[place[c as usize] as usize]).sum();
                let identity = if row < n_loads { w[row] } else { 0.0 };
                *out = (identity + sum) * scale[row];
            }
        };
        let mut z = vec![0.0; rhs.len()];
        let outcome = gmres.solve(&mut multiply, &rhs, &mut z, Limits { target, ..limits });
        w.iter_mut().zip(&z).zip(&scale).for_each(|((w, z), s)| *w = z / s);
        self.dense.solve(Form::Transposed, w);
        outcome
    }
}

/// `y = A x`, A by rows.
fn multiply_rows(a: &[f64], x: &[f64], y: &mut [f64], is_parallel: bool) {
    let n = x.len();
    if n == 0 {
        return y.fill(0.0);
    }
    let work = |(share, y): (usize, &mut [f64])| {
        for (row, out) in a[share * SHARE * n..].chunks_exact(n).zip(y) {
            *out = dot(row, x);
        }
    };
    if is_parallel {
        y.par_chunks_mut(SHARE).enumerate().for_each(work);
    } else {
        y.chunks_mut(SHARE).enumerate().for_each(work);
    }
}

/// Rows of `M V`, those of M from `first` on, into rows of `out` with room for the bare dofs behind. Neighbouring rows
/// that read the same dofs (the components of a node) are made together: each value of V is loaded once for all.
fn fill_products(rows: &Csr, place: &[u32], (v, n_read): (&[f64], usize), first: usize, out: &mut [f64]) {
    let width = v.len() / n_read.max(1);
    let n = rows.n_rows();
    let last = first + out.len() / n;
    let mut starts = vec![first];
    for row in first + 1..last {
        let group = starts[starts.len() - 1];
        if row - group == TOGETHER || rows.row(row).0 != rows.row(group).0 {
            starts.push(row);
        }
    }
    starts.push(last);
    for columns in (0..width).step_by(FILL_COLUMNS).map(|column| column..width.min(column + FILL_COLUMNS)) {
        for group in starts.windows(2) {
            let (mut factors, mut answers) = (Vec::new(), Vec::new());
            for (k, &column) in rows.row(group[0]).0.iter().enumerate() {
                let at = place[column as usize] as usize;
                let mut all = [0.0; TOGETHER];
                (group[0]..group[1]).zip(&mut all).for_each(|(row, factor)| *factor = rows.row(row).1[k]);
                if at < n_read && all.iter().any(|&factor| factor != 0.0) {
                    factors.push(all);
                    answers.push(&v[at * width..][columns.clone()]);
                }
            }
            let mut targets = out[(group[0] - first) * n..(group[1] - first) * n].chunks_exact_mut(n);
            let targets: [&mut [f64]; TOGETHER] =
                std::array::from_fn(|_| targets.next().map_or(&mut [][..], |row| &mut row[columns.clone()]));
            combine(&factors, &answers, targets);
        }
    }
}

/// `targets[r] = Σ factors[k][r] answers[k]`; targets without room are left out.
fn combine(factors: &[[f64; TOGETHER]], answers: &[&[f64]], mut targets: [&mut [f64]; TOGETHER]) {
    let n = targets[0].len();
    let whole = n - n % FILL_WIDTH;
    for first in (0..whole).step_by(FILL_WIDTH) {
        let mut sums = [[0.0; FILL_WIDTH]; TOGETHER];
        for (factors, answers) in factors.iter().zip(answers) {
            let answers = &answers[first..first + FILL_WIDTH];
            for (sums, factor) in sums.iter_mut().zip(factors) {
                for lane in 0..FILL_WIDTH {
                    sums[lane] += factor * answers[lane];
                }
            }
        }
        for (target, sums) in targets.iter_mut().zip(&sums).filter(|(target, _)| !target.is_empty()) {
            target[first..first + FILL_WIDTH].copy_from_slice(sums);
        }
    }
    for column in whole..n {
        for (r, target) in targets.iter_mut().enumerate().filter(|(_, target)| !target.is_empty()) {
            target[column] = factors.iter().zip(answers).map(|(factors, answers)| factors[r] * answers[column]).sum();
        }
    }
}

/// Whether two rows are opposite to rounding.
fn are_opposite(matrix: &Csr, a: usize, b: usize) -> bool {
    let ((columns, here), (others, there)) = (matrix.row(a), matrix.row(b));
    let largest = here.iter().chain(there).fold(0.0f64, |largest, value| value.abs().max(largest));
    columns == others && here.iter().zip(there).all(|(x, y)| (x + y).abs() <= OPPOSITE * largest)
}
