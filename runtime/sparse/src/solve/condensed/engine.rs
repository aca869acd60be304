//! The factor of a condensed system: a constant part, and a part that is factored again.
//!
//! Promises: the constant part is factored once, when the engine is made; factoring and solving reuse all memory. Does
//! not know residuals and earlier matrices.

use std::sync::Arc;

use super::super::dense::{Dense, Kind};
use super::super::factorization::Pivot;
use super::super::frontal_lu::{EntryMap, FrontalLu, Part};
use super::super::krylov::{Gmres, Limits, Outcome};
use super::super::multifrontal::Multifrontal;
use super::super::symbolic::Symbolic;
use super::super::triangular_solve::{FrontFactor, Transpose, TriangularSolve};
use super::super::{Precision, SolveError};
use super::woodbury::{Bulk, Inner, Scaled, Woodbury};
use crate::csr::{Csr, Pattern};
use wfl_host::memory::zeros;

/// Smallest pivot of the fronts, relative to its column, that is accepted.
const SMALLEST_PIVOT: f64 = 1e-11;
/// Multiplications that a factorisation makes while a triangular solve loads one value: from the cache, and from memory.
const OPERATIONS_PER_CACHED_VALUE: f64 = 16.0;
const OPERATIONS_PER_VALUE: f64 = 36.0;
/// Number of values that a cache holds.
const CACHED_VALUES: f64 = 4e6;
/// Woodbury: with fewer iterations a trial is not worth the solves with the bulk that it costs where it fails.
const FEWEST_ITERATIONS: f64 = 14.0;
/// From this number of forces on a factor of single precision saves more than its iterations cost.
const SINGLE_FROM: usize = 1200;
/// Smallest pivot, relative to its diagonal or column, with which a factor of single precision is of use.
const SMALLEST_SINGLE: f64 = 1e-4;
/// Never more iterations than this: the basis is kept.
pub(super) const MAX_ITERATIONS: usize = 60;
/// Smallest pivot of the bulk relative to its diagonal with which it can stand alone: with a smaller one the forces
/// that hold a body would cancel in the flexibility.
const SMALLEST_ALONE: f64 = 1e-8;

/// The factor.
pub(super) struct Engine {
    symbolic: Symbolic,
    constant: Multifrontal,
    /// Smallest relative pivot of the constant part.
    constant_pivot: f64,
    triangular: TriangularSolve,
    pub(super) method: Method,
}

pub(super) enum Method {
    Woodbury(Box<Woodbury>),
    Dense {
        /// S0, full, by columns.
        base: Vec<f64>,
        dense: Dense,
        /// Place in S of each entry of the changing part.
        places: Vec<usize>,
        /// Place among the interface unknowns of each changing dof.
        order: Vec<u32>,
        work: Vec<f64>,
    },
    Fronts {
        fronts: Box<FrontalLu>,
        bulk_map: EntryMap,
        changing_map: EntryMap,
        /// Triangular solves over the changing fronts alone.
        reduced: Box<TriangularSolve>,
        work: Vec<f64>,
    },
}

/// What an engine is made from.
pub(super) struct EngineContext<'a> {
    pub(super) bulk: &'a Csr,
    pub(super) changing: &'a Arc<Pattern>,
    pub(super) dofs: &'a [u32],
    pub(super) coordinates: Option<&'a [[f64; 3]]>,
    /// Facing dofs, on which the changing part may act with opposite forces.
    pub(super) pairs: &'a [(u32, u32)],
    pub(super) threads: usize,
    pub(super) precision: Precision,
}

impl EngineContext<'_> {
    pub(super) fn dense(&self) -> Result<Engine, SolveError> {
        let symbolic = Symbolic::new(self.bulk.pattern(), self.coordinates, self.dofs)?;
        // the constant part of the dense matrix, and what is factored
        symbolic.claim(|_| false, 2 * symbolic.n_interface() * symbolic.n_interface())?;
        let mut constant = Multifrontal::new(&symbolic, vec![true; symbolic.n_fronts()], self.threads)?;
        let n = symbolic.n_interface();
        let mut base = zeros(n * n, "the dense matrix of the changing dofs")?;
        constant.factor(&symbolic, self.bulk.values(), &mut base)?;
        for column in 0..n {
            for row in column + 1..n {
                base[row * n + column] = base[column * n + row];
            }
        }
        let place = |dof: u32| symbolic.ordering.inverse()[dof as usize] - symbolic.n_eliminated() as u32;
        let rows = (0..self.changing.n_rows() as u32)
            .flat_map(|row| self.changing.row(row as usize).iter().map(move |&column| (row, column)));
        let places = rows.map(|(row, column)| place(column) as usize * n + place(row) as usize).collect();
        let order = self.dofs.iter().map(|&dof| place(dof)).collect();
        let dense = Dense::new(n, self.threads)?;
        Ok(Engine {
            triangular: TriangularSolve::new(&symbolic, vec![true; symbolic.n_fronts()], self.threads),
            constant_pivot: smallest_pivot(&constant, &symbolic, self.bulk),
            constant,
            symbolic,
            method: Method::Dense { base, dense, places, order, work: vec![0.0; n] },
        })
    }

    /// # Errors
    /// Also [`SolveError::NotPositiveDefinite`] when the bulk can hardly stand alone.
    pub(super) fn woodbury(&self) -> Result<Engine, SolveError> {
        let (bulk, is_bare) = alone(self.bulk)?;
        let symbolic = Symbolic::new(bulk.pattern(), self.coordinates, &[])?;
        let n_forces = Woodbury::count(self.changing, self.pairs);
        // the flexibility of the changing dofs, and the capacitance matrix
        symbolic.claim(|_| false, self.dofs.len() * n_forces + n_forces * n_forces)?;
        let mut constant = whole_factor(&symbolic, &bulk, self.threads)?;
        let constant_pivot = smallest_pivot(&constant, &symbolic, &bulk);
        if constant_pivot < SMALLEST_ALONE {
            return Err(SolveError::NotPositiveDefinite { dof: 0, pivot: constant_pivot });
        }
        let mut woodbury = Woodbury::new(self.changing, self.dofs, self.pairs, is_bare, self.threads)?;
        let single = match self.precision {
            Precision::Auto => woodbury.n_forces() >= SINGLE_FROM,
            Precision::Double => false,
            Precision::Mixed => true,
        };
        if single && constant_pivot >= SMALLEST_SINGLE {
            woodbury.set_single(true);
            constant.narrow(&symbolic)?;
        }
        Ok(Engine {
            triangular: TriangularSolve::new(&symbolic, vec![true; symbolic.n_fronts()], self.threads),
            constant_pivot,
            constant,
            method: Method::Woodbury(Box::new(woodbury)),
            symbolic,
        })
    }

    pub(super) fn fronts(&self) -> Result<Engine, SolveError> {
        let pattern = self.bulk.pattern().union(self.changing)?.mirrored()?;
        let symbolic = Symbolic::new(&pattern, self.coordinates, &[])?;
        // The values of the bulk are read through the map of the wider pattern.
        let bulk = on_wider_pattern(self.bulk, pattern);
        let members = symbolic.fronts_above(self.dofs);
        symbolic.claim(|front| members[front], 0)?;
        let mut constant =
            Multifrontal::new(&symbolic, members.iter().map(|&changes| !changes).collect(), self.threads)?;
        constant.factor(&symbolic, bulk.values(), &mut [])?;
        let map = |pattern: &Pattern, all_inside: bool| {
            EntryMap::new(&symbolic, &members, pattern, all_inside).expect("the structure holds both patterns")
        };
        let (bulk_map, changing_map) = (map(self.bulk.pattern(), false), map(self.changing, true));
        Ok(Engine {
            triangular: TriangularSolve::new(&symbolic, vec![true; symbolic.n_fronts()], self.threads),
            constant_pivot: smallest_pivot(&constant, &symbolic, self.bulk),
            constant,
            method: Method::Fronts {
                fronts: Box::new(FrontalLu::new(&symbolic, members.clone(), self.threads)?),
                bulk_map,
                changing_map,
                reduced: Box::new(TriangularSolve::new(&symbolic, members, self.threads)),
                work: vec![0.0; self.bulk.n_rows()],
            },
            symbolic,
        })
    }
}

impl Engine {
    /// Takes over the values of the changing part; true if an older factor is of no use with them.
    pub(super) fn take(&mut self, changing: &Csr) -> Result<bool, SolveError> {
        match &mut self.method {
            Method::Woodbury(woodbury) => woodbury.take(&self.symbolic, &self.constant, changing),
            _ => Ok(false),
        }
    }

    /// Whether solutions with the factor need iterations because it is of single precision.
    pub(super) fn is_single(&self) -> bool {
        matches!(&self.method, Method::Woodbury(woodbury) if woodbury.is_single())
    }

    /// Chooses the precision of the factors of the bulk and of the capacitance matrix; where that changes, the latter is
    /// lost.
    pub(super) fn set_single(&mut self, single: bool, bulk: &Csr) -> Result<(), SolveError> {
        let Method::Woodbury(woodbury) = &mut self.method else { return Ok(()) };
        if woodbury.is_single() == single {
            return Ok(());
        }
        woodbury.set_single(single);
        if single {
            return self.constant.narrow(&self.symbolic);
        }
        self.constant = whole_factor(&self.symbolic, &alone(bulk)?.0, woodbury.threads())?;
        Ok(())
    }

    /// Has the next factor made from nothing; whether the one at hand was made from an earlier one.
    pub(super) fn forget(&mut self) -> bool {
        match &mut self.method {
            Method::Woodbury(woodbury) => woodbury.forget(),
            _ => false,
        }
    }

    /// Factors the changing part that was taken over last.
    pub(super) fn factor(&mut self, bulk: &Csr, changing: &Csr, kind: Kind) -> Result<Pivot, SolveError> {
        let is_single = self.is_single();
        let (ratio, _) = match &mut self.method {
            Method::Woodbury(woodbury) => {
                if !woodbury.is_connected() {
                    woodbury.take(&self.symbolic, &self.constant, changing)?;
                }
                match woodbury.factor() {
                    Ok((ratio, _)) | Err(SolveError::VanishingPivot { ratio, .. })
                        if is_single && (ratio.is_nan() || ratio < SMALLEST_SINGLE) =>
                    {
                        self.set_single(false, bulk)?;
                        return self.factor(bulk, changing, kind);
                    }
                    other => other?,
                }
            }
            Method::Dense { base, dense, places, .. } => {
                let fill = |values: &mut [f64]| {
                    values.copy_from_slice(base);
                    for (&place, value) in places.iter().zip(changing.values()) {
                        values[place] += value;
                    }
                };
                dense.factor(kind, fill)?
            }
            Method::Fronts { fronts, bulk_map, changing_map, .. } => {
                let parts = [
                    Part { map: bulk_map, values: bulk.values() },
                    Part { map: changing_map, values: changing.values() },
                ];
                let (ratio, dof) = fronts.factor(&self.symbolic, &parts, Some(&self.constant))?;
                if ratio < SMALLEST_PIVOT {
                    return Err(SolveError::VanishingPivot { dof: dof as usize, ratio });
                }
                (ratio, dof as usize)
            }
        };
        Ok(Pivot::of(ratio.min(self.constant_pivot)))
    }

    /// Whether the determinant of the matrix factored last is negative. What stays constant is positive definite.
    pub(super) fn is_negative(&self) -> bool {
        match &self.method {
            Method::Woodbury(woodbury) => woodbury.is_negative(),
            Method::Dense { dense, .. } => dense.is_negative(),
            Method::Fronts { fronts, .. } => fronts.is_negative(&self.symbolic),
        }
    }

    /// True if the matrix factored last is known to be positive definite. What stays constant is.
    pub(super) fn is_definite(&self) -> bool {
        matches!(&self.method, Method::Dense { dense, .. } if dense.is_definite())
    }

    /// Solves in place, by dof.
    pub(super) fn solve(&mut self, transpose: Transpose, x: &mut [f64]) {
        let (symbolic, constant) = (&self.symbolic, &self.constant);
        let cholesky = |front: usize| FrontFactor::Cholesky { panel: constant.panel(front) };
        match &mut self.method {
            Method::Woodbury(woodbury) => {
                let bulk = Bulk { symbolic, factor: constant, triangular: &mut self.triangular };
                match transpose {
                    Transpose::No => {
                        woodbury.solve(bulk, x, Inner::Fresh);
                    }
                    Transpose::Yes => woodbury.solve_transposed(bulk, x),
                }
            }
            Method::Dense { dense, .. } => {
                self.triangular.solve(symbolic, cholesky, transpose, |interface| dense.solve(transpose, interface), x);
            }
            Method::Fronts { fronts, .. } => {
                let fronts = &**fronts;
                let factor = |front: usize| {
                    if fronts.members()[front] { fronts.front(symbolic, front) } else { cholesky(front) }
                };
                self.triangular.solve(symbolic, factor, transpose, |_| {}, x);
            }
        }
    }

    /// Solves in place, by dof, with the changing part taken last and the factor of an older one, or of single
    /// precision, to the limits `plain` where equations are not scaled; `difference` is what the older one lacks, on
    /// the changing dofs. `None` where the caller has to iterate.
    pub(super) fn solve_stale(
        &mut self,
        x: &mut [f64],
        gmres: &mut Gmres,
        limits: Limits,
        plain: Limits,
        scale: &[f64],
        difference: &Csr,
    ) -> Option<Outcome> {
        let (symbolic, constant) = (&self.symbolic, &self.constant);
        match &mut self.method {
            Method::Woodbury(woodbury) => {
                let bulk = Bulk { symbolic, factor: constant, triangular: &mut self.triangular };
                Some(woodbury.solve(bulk, x, Inner::Stale(Scaled { gmres, limits, scale })))
            }
            Method::Dense { dense, order, .. } => {
                let cholesky = |front: usize| FrontFactor::Cholesky { panel: constant.panel(front) };
                let mut outcome = None;
                let iterate = |interface: &mut [f64]| {
                    outcome = Some(iterate_dense(dense, order, difference, gmres, plain, interface));
                };
                self.triangular.solve(symbolic, cholesky, Transpose::No, iterate, x);
                outcome
            }
            Method::Fronts { .. } => None,
        }
    }

    /// Solves with a right-hand side on the changing dofs, for the changing dofs.
    pub(super) fn solve_changing(&mut self, dofs: &[u32], x: &mut [f64]) {
        match &mut self.method {
            Method::Woodbury(_) => unreachable!("the Woodbury solver iterates by itself"),
            Method::Dense { dense, order, work, .. } => {
                order.iter().zip(&*x).for_each(|(&place, value)| work[place as usize] = *value);
                dense.solve(Transpose::No, work);
                order.iter().zip(x).for_each(|(&place, value)| *value = work[place as usize]);
            }
            Method::Fronts { fronts, reduced, work, .. } => {
                let (fronts, symbolic) = (&**fronts, &self.symbolic);
                work.fill(0.0);
                dofs.iter().zip(&*x).for_each(|(&dof, value)| work[dof as usize] = *value);
                reduced.solve(symbolic, |front| fronts.front(symbolic, front), Transpose::No, |_| {}, work);
                dofs.iter().zip(x).for_each(|(&dof, value)| *value = work[dof as usize]);
            }
        }
    }

    /// Iterations that cost less than a new factor; none where a trial is not worth it.
    pub(super) fn worthwhile_iterations(&self) -> usize {
        let (operations, values) = match &self.method {
            Method::Woodbury(woodbury) => woodbury.costs(),
            Method::Dense { order, .. } => {
                let n = order.len() as f64;
                (n * n * n / 3.0, n * n)
            }
            Method::Fronts { fronts, .. } => {
                let changing = || (0..self.symbolic.n_fronts()).filter(|&front| fronts.members()[front]);
                let sizes = changing().map(|front| self.symbolic.sizes(front));
                let operations: f64 = changing().map(|front| 2.0 * self.symbolic.operations(front)).sum();
                (operations, sizes.map(|(k, r)| (k * (k + 2 * r)) as f64).sum())
            }
        };
        let per_value = if values <= CACHED_VALUES { OPERATIONS_PER_CACHED_VALUE } else { OPERATIONS_PER_VALUE };
        let iterations = operations / (per_value * values).max(1.0);
        if matches!(self.method, Method::Woodbury(_)) && iterations < FEWEST_ITERATIONS {
            return 0;
        }
        (iterations as usize).min(MAX_ITERATIONS)
    }
}

/// Solves `(S + D) x = b` in place with a factor of S; D is a difference on dofs with these places in S. With
/// `x = S⁻¹ (b + w)` the vector w lives on these dofs and solves `(1 + D S⁻¹) w = -D S⁻¹ b`. Not a number where the
/// iterations do not get there.
fn iterate_dense(
    dense: &mut Dense,
    order: &[u32],
    difference: &Csr,
    gmres: &mut Gmres,
    limits: Limits,
    b: &mut [f64],
) -> Outcome {
    let (n, mut all) = (order.len(), vec![0.0; b.len()]);
    let (mut start, mut w, mut solved) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    all.copy_from_slice(b);
    dense.solve(Transpose::No, &mut all);
    solved.iter_mut().zip(order).for_each(|(value, &place)| *value = all[place as usize]);
    difference.multiply(&solved, &mut start, 1);
    start.iter_mut().for_each(|value| *value = -*value);
    let mut multiply = |w: &[f64], out: &mut [f64]| {
        all.fill(0.0);
        order.iter().zip(w).for_each(|(&place, value)| all[place as usize] = *value);
        dense.solve(Transpose::No, &mut all);
        solved.iter_mut().zip(order).for_each(|(value, &place)| *value = all[place as usize]);
        out.copy_from_slice(w);
        difference.multiply_add(&solved, out, 1);
    };
    let outcome = gmres.solve(&mut multiply, &start, &mut w, limits);
    if outcome.converged {
        order.iter().zip(&w).for_each(|(&place, value)| b[place as usize] += value);
        dense.solve(Transpose::No, b);
    } else {
        b.fill(f64::NAN);
    }
    outcome
}

/// The factor of all fronts.
fn whole_factor(symbolic: &Symbolic, matrix: &Csr, threads: usize) -> Result<Multifrontal, SolveError> {
    let mut factor = Multifrontal::new(symbolic, vec![true; symbolic.n_fronts()], threads)?;
    factor.factor(symbolic, matrix.values(), &mut [])?;
    factor.finish();
    Ok(factor)
}

/// The bulk as it stands without the changing part, with some diagonal for each dof that has no stiffness; which they
/// are.
fn alone(bulk: &Csr) -> Result<(Csr, Vec<bool>), SolveError> {
    let n = bulk.n_rows();
    let is_bare: Vec<bool> = (0..n).map(|dof| bulk.row(dof).1.iter().all(|&value| value == 0.0)).collect();
    let diagonal = Pattern::new(n, n, (0..=n).collect(), (0..n as u32).collect())?;
    let mut whole = on_wider_pattern(bulk, bulk.pattern().union(&diagonal)?);
    // One in the unit of the others, so that single precision holds all.
    let largest = (0..n).map(|dof| bulk.get(dof, dof)).fold(0.0, f64::max);
    for dof in (0..n).filter(|&dof| is_bare[dof]) {
        assert!(whole.add_to(dof, dof, if largest > 0.0 { largest } else { 1.0 }), "the pattern holds the diagonal");
    }
    Ok((whole, is_bare))
}

fn smallest_pivot(constant: &Multifrontal, symbolic: &Symbolic, bulk: &Csr) -> f64 {
    let diagonal: Vec<f64> = (0..bulk.n_rows()).map(|dof| bulk.get(dof, dof)).collect();
    constant.smallest_pivot_ratio(symbolic, &diagonal).map_or(1.0, |(ratio, _)| ratio)
}

/// The same matrix on a pattern that holds its own.
fn on_wider_pattern(matrix: &Csr, pattern: Pattern) -> Csr {
    let places = matrix.pattern().positions_in(&pattern).expect("the pattern is a union with this one");
    let mut wider = Csr::zeros(Arc::new(pattern));
    for (&place, value) in places.iter().zip(matrix.values()) {
        wider.values_mut()[place] = *value;
    }
    wider
}
