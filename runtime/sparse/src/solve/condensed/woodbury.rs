//! The Woodbury solver: the changing part as a low-rank update by forces between bodies.
//!
//! The rows of the changing part C are forces. Rows of facing dofs are opposite (what pulls here pushes there), so with
//! one column of J for each such pair, or single row, `C = J M` where M holds one row of C each. Once the flexibility
//! `V = K⁻¹ J` is known on the dofs that C reads,
//!
//! ```text
//! (K + J M) x = b      x = K⁻¹ (b - J w)      (1 + M V) w = M K⁻¹ b
//! ```
//!
//! and only the capacitance matrix `1 + M V`, small and dense, changes with C (Sherman, Morrison, Woodbury). A dof without any stiffness of its own (a multiplier) is
//! its own unknown w: its equation is the row of C as it stands. V is computed once.
//!
//! An older factor of `1 + M V` still serves as preconditioner of GMRES, with the exact product by V and the new M. In
//! single precision all is: the factor of the bulk, V and the factor of `1 + M V`. GMRES then takes products with V
//! from the factor of the bulk, whose own rounding the caller corrects by true residuals.
//!
//! Promises: the same bytes for any number of threads; memory is kept. K must be positive definite without C.
//! Does not look at residuals: the backward-error check of the caller does.

use std::sync::Arc;

use super::super::SolveError;
use super::super::krylov::{Gmres, Limits, Outcome};
use super::super::multifrontal::Multifrontal;
use super::super::symbolic::Symbolic;
use super::super::triangular_solve::{FrontFactor, Transpose, TriangularSolve};
use super::capacitance::{Capacitance, CapacitanceMatrix, Reference};
use super::flexibility::{FactoredBulk, Load};
use super::rows::Rows;
use crate::csr::{Csr, Pattern};
use crate::index::NONE;
use wfl_dense::sweeps::dot;

/// Part of the right-hand side that rounding leaves in the best of cases.
const ROUNDING: f64 = 1e-15;
/// Rows of two dofs are opposite when their sum is below this part of their largest entry.
const OPPOSITE: f64 = 1e-12;

/// See the module documentation.
pub(super) struct Woodbury {
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
    /// M, `(loads + bare) x dofs`, and where its values stand in C.
    rows: Csr,
    sources: Vec<usize>,
    displacements: Vec<f64>,
    /// What belongs to one choice of the loads; none before the first values of C.
    connected: Option<Connected>,
    /// Values of the factor of the bulk on the fronts that C can reach.
    reduced_values: f64,
    /// Whether V and the factor of `1 + M V` are of single precision; the factor of the bulk is then, too.
    single: bool,
    /// What the next factor is made from, where an earlier solver says so.
    remembered: Option<Reference>,
}

/// What belongs to one choice of the loads.
struct Connected {
    /// V and the factor of `1 + M V`.
    capacitance: Box<dyn CapacitanceMatrix>,
    /// Triangular solves over the fronts that C can reach.
    reduced: TriangularSolve,
}

/// The factored bulk.
pub(super) struct Bulk<'a> {
    pub(super) symbolic: &'a Symbolic,
    pub(super) factor: &'a Multifrontal,
    /// Over all fronts.
    pub(super) triangular: &'a mut TriangularSolve,
}

/// How the system of the capacitance matrix is solved.
pub(super) enum Inner<'a> {
    /// With a factor of this matrix.
    Fresh,
    /// With the factor of an earlier one, or one of single precision.
    Stale(Scaled<'a>),
}

/// What iterations need beside the operator.
pub(super) struct Scaled<'a> {
    pub(super) gmres: &'a mut Gmres,
    /// The target is a 2-norm of the scaled residual.
    pub(super) limits: Limits,
    /// By dof: makes the equations comparable.
    pub(super) scale: &'a [f64],
}

impl Woodbury {
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
        let mut place = vec![NONE; changing.n_rows()];
        read.iter().chain(&bare).zip(0..).for_each(|(&dof, at)| place[dof as usize] = at);
        Ok(Self {
            threads,
            apart: Vec::new(),
            displacements: vec![0.0; dofs.len()],
            is_bare,
            n_loads,
            loads: Vec::new(),
            pairs,
            bare,
            read,
            place,
            rows: Csr::zeros(Arc::new(Pattern::empty(0, changing.n_cols()))),
            sources: Vec::new(),
            connected: None,
            reduced_values: 0.0,
            single: false,
            remembered: None,
        })
    }

    /// Says whether the factor of the bulk is of single precision, and with it V and the factor of `1 + M V`. A change
    /// of that loses both.
    pub(super) fn set_single(&mut self, single: bool) {
        if self.single != single {
            self.single = single;
            self.connected = None;
        }
    }

    pub(super) fn is_single(&self) -> bool {
        self.single
    }

    /// Whether the values of the changing part are at hand, and the flexibility.
    pub(super) fn is_connected(&self) -> bool {
        self.connected.is_some()
    }

    pub(super) fn threads(&self) -> usize {
        self.threads
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

    /// Multiplications of the next factor, and values read by one product with V and the factor.
    pub(super) fn costs(&self) -> (f64, f64) {
        let n = self.n_forces() as f64;
        let operations = self.connected.as_ref().map_or(0.0, |connected| connected.capacitance.operations(self.rows()));
        let flexibility = self.read.len() as f64 * self.loads.len() as f64;
        if self.single {
            // Twice as many numbers of half the size at once; V is not read, but the factor of the bulk.
            return (operations / 2.0, self.reduced_values + n * n / 2.0);
        }
        (operations, flexibility + n * n)
    }

    /// Starts the next factor from what one of an earlier solver was made from.
    pub(super) fn remember(&mut self, reference: Reference) {
        self.remembered = Some(reference);
    }

    /// What the factor at hand was made from.
    pub(super) fn reference(&self) -> Reference {
        self.connected.as_ref().map(|connected| connected.capacitance.memory()).unwrap_or_default()
    }

    /// Has the next factor made from nothing; whether the one at hand was not.
    pub(super) fn forget(&mut self) -> bool {
        self.connected.as_mut().is_some_and(|connected| connected.capacitance.forget())
    }

    /// First dofs of facing pairs whose rows are not opposite.
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
        let is_new = self.connected.is_none() || self.pairs.len() < before;
        if is_new {
            self.connect(symbolic, factor, changing)?;
        }
        for (value, &source) in self.rows.values_mut().iter_mut().zip(&self.sources) {
            *value = changing.values()[source];
        }
        Ok(is_new)
    }

    fn connect(&mut self, symbolic: &Symbolic, factor: &Multifrontal, changing: &Csr) -> Result<(), SolveError> {
        self.connected = None;
        let mut other = vec![NONE; changing.n_rows()];
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
        let dofs: Vec<u32> = (0..changing.n_rows() as u32).filter(|dof| self.place[*dof as usize] != NONE).collect();
        let members = symbolic.fronts_above(&dofs);
        let values = |front: usize| {
            let (k, r) = symbolic.sizes(front);
            (k * (k + r)) as f64
        };
        self.reduced_values = (0..members.len()).filter(|&front| members[front]).map(values).sum();
        let base = FactoredBulk { symbolic, factor, members: &members };
        let n = self.n_forces();
        let capacitance: Box<dyn CapacitanceMatrix> = if self.single {
            Box::new(Capacitance::<f32>::new(
                base.flexibility(&self.loads, &self.read, self.threads)?,
                n,
                self.threads,
            )?)
        } else {
            Box::new(Capacitance::<f64>::new(
                base.flexibility(&self.loads, &self.read, self.threads)?,
                n,
                self.threads,
            )?)
        };
        self.take_rows(changing)?;
        self.connected =
            Some(Connected { capacitance, reduced: TriangularSolve::new(symbolic, members, self.threads) });
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
        let remembered = self.remembered.take();
        let rows = Rows { m: &self.rows, place: &self.place, n_read: self.read.len(), n_loads: self.loads.len() };
        let capacitance = &mut self.connected.as_mut().expect("the changing part has been taken").capacitance;
        match remembered {
            Some(reference) => capacitance.recall(rows, &reference),
            None => capacitance.factor(rows),
        }
    }

    /// Whether the determinant of K + C is negative: it is that of K times that of `1 + M V`, in which the rows of dofs
    /// without stiffness have the other sign. K is positive definite.
    pub(super) fn is_negative(&self) -> bool {
        let capacitance = self.connected.as_ref().is_some_and(|connected| connected.capacitance.is_negative());
        capacitance != (self.bare.len() % 2 == 1)
    }

    /// M, and where its columns stand.
    fn rows(&self) -> Rows<'_> {
        Rows { m: &self.rows, place: &self.place, n_read: self.read.len(), n_loads: self.loads.len() }
    }

    /// What is known of V.
    fn connected(&mut self) -> &mut Connected {
        self.connected.as_mut().expect("the changing part has been taken")
    }

    /// Solves with the changing part taken last, in place, by dof. Iterations say whether they converged.
    pub(super) fn solve(&mut self, bulk: Bulk<'_>, x: &mut [f64], inner: Inner<'_>) -> Outcome {
        let Bulk { symbolic, factor, triangular } = bulk;
        let panels = |front: usize| FrontFactor::Cholesky { panel: factor.panel(front) };
        let own: Vec<f64> = self.bare.iter().map(|&dof| std::mem::take(&mut x[dof as usize])).collect();
        let scale = factor.scale();
        x.iter_mut().for_each(|value| *value *= scale);
        // Backward only to what C reads, then forward only with the forces.
        triangular.substitute_forward(symbolic, panels, x);
        let reduced = &mut self.connected().reduced;
        reduced.copy_forward(triangular);
        reduced.substitute_backward(symbolic, panels, x);
        let mut w = vec![0.0; self.rows.n_rows()];
        self.rows.multiply(x, &mut w, 1);
        let n_loads = self.loads.len();
        w[n_loads..].iter_mut().zip(&own).for_each(|(w, load)| *w -= load);
        let outcome = match inner {
            Inner::Fresh => {
                self.connected().capacitance.solve(Transpose::No, &mut w);
                Outcome { iterations: 0, converged: true }
            }
            Inner::Stale(scaled) => self.iterate(symbolic, scale, panels, &mut w, scaled),
        };
        if !outcome.converged {
            // The caller makes a new factor: no solve for what nobody wants.
            x.fill(f64::NAN);
            return outcome;
        }
        x.fill(0.0);
        add_loads(&self.loads, &w, -scale, x);
        let reduced = &mut self.connected().reduced;
        reduced.substitute_forward(symbolic, panels, x);
        triangular.add_forward(reduced);
        triangular.substitute_backward(symbolic, panels, x);
        self.bare.iter().zip(&w[n_loads..]).for_each(|(&dof, value)| x[dof as usize] = *value);
        outcome
    }

    /// Solves the transposed system in place, by dof: `(1 + M V)ᵀ v = Jᵀ K⁻¹ b` and `x = K⁻¹ (b - Mᵀ v)`.
    pub(super) fn solve_transposed(&mut self, bulk: Bulk<'_>, x: &mut [f64]) {
        let Bulk { symbolic, factor, triangular } = bulk;
        let panels = |front: usize| FrontFactor::Cholesky { panel: factor.panel(front) };
        let own: Vec<f64> = self.bare.iter().map(|&dof| std::mem::take(&mut x[dof as usize])).collect();
        let loads = x.to_vec();
        x.iter_mut().for_each(|value| *value *= factor.scale());
        triangular.substitute_forward(symbolic, panels, x);
        triangular.substitute_backward(symbolic, panels, x);
        let at = |dof: u32| if dof == NONE { 0.0 } else { x[dof as usize] };
        let jumps = self.loads.iter().map(|load| at(load.here) - at(load.there));
        let mut v: Vec<f64> = jumps.chain(own.iter().map(|load| -load)).collect();
        self.connected().capacitance.solve(Transpose::Yes, &mut v);
        let mut forces = vec![0.0; x.len()];
        self.rows.multiply_transposed_add(&v, &mut forces);
        x.iter_mut().zip(&loads).zip(&forces).for_each(|((x, load), force)| *x = (load - force) * factor.scale());
        triangular.substitute_forward(symbolic, panels, x);
        triangular.substitute_backward(symbolic, panels, x);
        let bare_values = &v[self.loads.len()..];
        self.bare.iter().zip(bare_values).for_each(|(&dof, value)| x[dof as usize] = *value);
    }

    /// `w = (1 + M V)⁻¹ w` by GMRES; the factor at hand is the preconditioner, on the right. Where V is of single
    /// precision, products with it come from the factor of the bulk: rounded, but with sums of double precision.
    fn iterate<'f>(
        &mut self,
        symbolic: &Symbolic,
        bulk_scale: f64,
        panels: impl Fn(usize) -> FrontFactor<'f> + Sync,
        w: &mut [f64],
        Scaled { gmres, limits, scale }: Scaled<'_>,
    ) -> Outcome {
        let n_loads = self.loads.len();
        let dofs = self.loads.iter().map(|load| load.here).chain(self.bare.iter().copied());
        let scale: Vec<f64> = dofs.map(|dof| scale[dof as usize]).collect();
        let rhs: Vec<f64> = w.iter().zip(&scale).map(|(w, s)| w * s).collect();
        let target = limits.target.max(ROUNDING * dot(&rhs, &rhs).sqrt());
        let Connected { capacitance, reduced } = self.connected.as_mut().expect("the changing part has been taken");
        let (displacements, rows, place, read) = (&mut self.displacements, &self.rows, &self.place, &self.read);
        let loads = &self.loads;
        let mut x = vec![0.0; if self.single { place.len() } else { 0 }];
        let mut multiply = |z: &[f64], out: &mut [f64]| {
            w.iter_mut().zip(z).zip(&scale).for_each(|((w, z), s)| *w = z / s);
            capacitance.solve(Transpose::No, w);
            let (of_read, of_bare) = displacements.split_at_mut(read.len());
            if !capacitance.multiply_flexibility(&w[..n_loads], of_read) {
                x.fill(0.0);
                add_loads(loads, w, bulk_scale, &mut x);
                reduced.substitute_forward(symbolic, &panels, &x);
                reduced.substitute_backward(symbolic, &panels, &mut x);
                of_read.iter_mut().zip(read).for_each(|(value, &dof)| *value = x[dof as usize]);
            }
            of_bare.iter_mut().zip(&w[n_loads..]).for_each(|(value, w)| *value = -w);
            for (row, out) in out.iter_mut().enumerate() {
                let (columns, values) = rows.row(row);
                let sum: f64 =
                    columns.iter().zip(values).map(|(&c, v)| v * displacements[place[c as usize] as usize]).sum();
                let identity = if row < n_loads { w[row] } else { 0.0 };
                *out = (identity + sum) * scale[row];
            }
        };
        let mut z = vec![0.0; rhs.len()];
        let outcome = gmres.solve(&mut multiply, &rhs, &mut z, Limits { target, ..limits });
        w.iter_mut().zip(&z).zip(&scale).for_each(|((w, z), s)| *w = z / s);
        capacitance.solve(Transpose::No, w);
        outcome
    }
}

/// Adds multiples of the loads to a right-hand side by dof.
fn add_loads(loads: &[Load], w: &[f64], factor: f64, x: &mut [f64]) {
    for (load, value) in loads.iter().zip(w) {
        x[load.here as usize] += factor * value;
        if load.there != NONE {
            x[load.there as usize] -= factor * value;
        }
    }
}

/// Whether two rows are opposite to rounding.
fn are_opposite(matrix: &Csr, a: usize, b: usize) -> bool {
    let ((columns, here), (others, there)) = (matrix.row(a), matrix.row(b));
    let largest = here.iter().chain(there).fold(0.0f64, |largest, value| value.abs().max(largest));
    columns == others && here.iter().zip(there).all(|(x, y)| (x + y).abs() <= OPPOSITE * largest)
}
