//! Solutions with the tangent at the end of a step, transposed or not, as the terms are written: no law of it is scaled or
//! regularised, and no older factor stands in.

use std::sync::Arc;

use wfl::Diagnostic;
use wfl_discrete::system::{Branches, System};
use wfl_run::As;
use wfl_sparse::{
    csr::Csr,
    solve::{CheckedLdlt, CheckedLlt, CheckedLu, LinearSolver, SolverOptions, Symmetry},
};

use super::refused::{NO_DERIVATIVE, not_made};

/// Solutions with the tangent of a step. The factor stays while the matrix does.
pub(super) struct Tangent {
    form: As,
    solver: Option<(Box<dyn LinearSolver>, Csr)>,
    /// The last solution, by free number.
    own: Vec<f64>,
    /// The step is another one than that of the factor.
    pub(super) is_new: bool,
    pub(super) solutions: usize,
    pub(super) factorisations: usize,
}

impl Tangent {
    pub(super) fn new(form: As) -> Self {
        Self { form, solver: None, own: Vec::new(), is_new: false, solutions: 0, factorisations: 0 }
    }

    /// By dof in the axes of the scene, zero where values are prescribed: the solution at the state `u` of a right-hand side
    /// by dof.
    pub(super) fn solve(
        &mut self,
        system: &System,
        u: &[f64],
        rhs: &[f64],
        threads: usize,
    ) -> Result<Vec<f64>, Box<Diagnostic>> {
        if std::mem::take(&mut self.is_new) {
            self.factor(system, u, threads)?;
        }
        self.solved(system, rhs)
    }

    /// The same with another tangent, which is taken as it is: the next solution of the step makes its own again.
    pub(super) fn solve_with(
        &mut self,
        system: &System,
        matrix: Csr,
        rhs: &[f64],
        threads: usize,
    ) -> Result<Vec<f64>, Box<Diagnostic>> {
        self.is_new = true;
        self.hold((system, matrix), Symmetry::General, threads)?;
        self.solved(system, rhs)
    }

    fn solved(&mut self, system: &System, rhs: &[f64]) -> Result<Vec<f64>, Box<Diagnostic>> {
        let numbering = &system.numbering;
        let mut turned = rhs.to_vec();
        numbering.turn(&mut turned);
        let mut own = Vec::new();
        numbering.gather(&turned, &mut own);
        let mut x = vec![0.0; own.len()];
        if own.iter().any(|b| *b != 0.0) {
            let (solver, matrix) = self.solver.as_mut().expect("factored above");
            refined((solver.as_mut(), matrix), &own, &mut x).map_err(|e| singular(&e.to_string()))?;
            self.solutions += 1;
        }
        let zero = vec![0.0; rhs.len()];
        let mut out = zero.clone();
        numbering.advance(&zero, &x, 1.0, &mut out);
        self.own = x;
        Ok(out)
    }

    /// How far what the laws make of the last solution, by free number, is from what the tangent makes of it, over the sizes
    /// of the summands: over the largest of all, or of the field where it is furthest over those of its own equations, which
    /// have a unit of their own. The smaller one of both: the equations of a field may be nothing but rounding.
    pub(super) fn apart(&self, system: &System, of_laws: &[f64]) -> f64 {
        let Some((_, matrix)) = &self.solver else { return 0.0 };
        let in_rows = |rows: std::ops::Range<usize>| {
            let (mut most, mut apart) = (0.0f64, 0.0f64);
            for row in rows {
                let (columns, values) = matrix.row(row);
                let summands = || columns.iter().zip(values).map(|(k, a)| a * self.own[*k as usize]);
                most = most.max(summands().map(f64::abs).sum());
                let difference = (summands().sum::<f64>() - of_laws[row]).abs();
                // not a number is apart
                apart = if difference <= apart { apart } else { difference };
                if apart.is_nan() {
                    return apart;
                }
            }
            if apart == 0.0 { 0.0 } else { apart / most }
        };
        let of_all = in_rows(0..of_laws.len());
        let free_dofs = &system.numbering.free_dofs;
        let of_field = |field: usize| {
            let range = system.range(field)?;
            // free dofs are numbered in their order
            let before = |dof: usize| free_dofs.partition_point(|d| (*d as usize) < dof);
            Some(in_rows(before(range.start)..before(range.end)))
        };
        let worst = (0..system.fields.len()).filter_map(of_field).fold(0.0, f64::max);
        if of_all.is_nan() { of_all } else { of_all.min(worst) }
    }

    fn factor(&mut self, system: &System, u: &[f64], threads: usize) -> Result<(), Box<Diagnostic>> {
        let mut tangent = system.new_tangent();
        system.tangent(u, Branches::AsWritten, &mut tangent).map_err(|e| not_made(&e.to_string()))?;
        let matrix = system.whole_matrix(&tangent).map_err(|e| not_made(&e.to_string()))?;
        let symmetry = Symmetry::known(system.is_symmetric());
        let matrix =
            if symmetry == Symmetry::Symmetric || self.form == As::Written { matrix } else { matrix.transpose() };
        self.hold((system, matrix), symmetry, threads)
    }

    /// Factors a matrix, unless it is the last one.
    fn hold(&mut self, of: (&System, Csr), symmetry: Symmetry, threads: usize) -> Result<(), Box<Diagnostic>> {
        let (system, matrix) = of;
        if let Some((_, known)) = &self.solver
            && known.values() == matrix.values()
        {
            return Ok(());
        }
        let options = SolverOptions { threads, ..SolverOptions::default() };
        self.factorisations += 1;
        if let Some((solver, known)) = self.solver.as_mut().filter(|(_, known)| known.pattern() == matrix.pattern())
            && solver.factor(&matrix).is_ok()
        {
            *known = matrix;
            return Ok(());
        }
        let numbering = &system.numbering;
        let position = |d: &u32| {
            let (field, node, _) = numbering.describe(&system.fields, *d as usize);
            system.fields[field].node_position(node)
        };
        let positions: Vec<[f64; 3]> = numbering.free_dofs.iter().map(position).collect();
        let failed = |e: wfl_sparse::solve::SolveError| singular(&e.to_string());
        let pattern = Arc::clone(matrix.pattern());
        if symmetry == Symmetry::Symmetric {
            let mut solver = CheckedLlt::new(&pattern, Some(&positions), options).map_err(failed)?;
            if solver.factor(&matrix).is_ok() {
                self.solver = Some((Box::new(solver), matrix));
                return Ok(());
            }
        }
        let mut solver: Box<dyn LinearSolver> = if symmetry == Symmetry::Symmetric {
            Box::new(CheckedLdlt::new(&pattern, Some(&positions), None, options).map_err(failed)?)
        } else {
            Box::new(CheckedLu::new(&pattern, Some(&positions), options).map_err(failed)?)
        };
        solver.factor(&matrix).map_err(failed)?;
        self.solver = Some((solver, matrix));
        Ok(())
    }
}

/// Steps of iterative refinement at most.
const REFINEMENTS: usize = 5;

/// A solution with iterative refinement by the backward error of each row on its own: rows of fluids and of solids differ by
/// many orders, and derivatives are sums over all of them.
fn refined(
    with: (&mut dyn LinearSolver, &Csr),
    rhs: &[f64],
    x: &mut [f64],
) -> Result<(), wfl_sparse::solve::SolveError> {
    let (solver, matrix) = with;
    solver.solve(rhs, x)?;
    let mut left = vec![0.0; rhs.len()];
    let mut error = row_error(matrix, rhs, x, &mut left);
    for _ in 0..REFINEMENTS {
        let (mut better, mut remains) = (vec![0.0; x.len()], vec![0.0; rhs.len()]);
        if error <= f64::EPSILON || solver.solve(&left, &mut better).is_err() {
            break;
        }
        better.iter_mut().zip(x.iter()).for_each(|(d, x)| *d += x);
        let next = row_error(matrix, rhs, &better, &mut remains);
        if next >= error {
            break;
        }
        x.copy_from_slice(&better);
        (error, left) = (next, remains);
    }
    Ok(())
}

/// The largest part of a row, in the sizes of its summands, that a solution leaves; `left` is what it leaves.
fn row_error(matrix: &Csr, rhs: &[f64], x: &[f64], left: &mut [f64]) -> f64 {
    let mut largest = 0.0f64;
    for (row, (left, b)) in left.iter_mut().zip(rhs).enumerate() {
        let (columns, values) = matrix.row(row);
        let (mut sum, mut size) = (*b, b.abs());
        for (k, a) in columns.iter().zip(values) {
            let summand = a * x[*k as usize];
            sum -= summand;
            size += summand.abs();
        }
        *left = sum;
        if size > 0.0 {
            largest = largest.max(sum.abs() / size);
        }
    }
    largest
}

/// The tangent at a solution cannot be solved with.
fn singular(why: &str) -> Box<Diagnostic> {
    let d = Diagnostic::new(NO_DERIVATIVE, "the tangent at the solution is singular: the result has no derivative");
    Box::new(
        d.note(why.to_owned())
            .help("a state between two branches, or one that is not unique, has none: W609, and the points told above"),
    )
}
