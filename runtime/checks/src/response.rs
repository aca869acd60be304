//! How many digits the unknowns of linear equations have at least, without a solution in every step.
//!
//! [`super::digits`] solves the equations for uncertainties with random signs. The variance of what comes out is a sum of the
//! squares of the uncertainties, each with its own factor: where all uncertainties are larger, the estimate tells as few digits
//! or fewer. As long as the matrix stays, the solutions for uncertainties of the size of its rows, one a field of equations, times
//! the largest quotient of an uncertainty and the size of its row, are such an estimate. It is enough where it tells of many
//! digits; where it does not, and where a factor may be spent on the question, [`super::digits`] is asked.
//!
//! Promises: depends on the matrix and the state alone, so that a run that goes on from a checkpoint says the same.

use std::sync::Arc;

use super::{
    Solved,
    digits::{Accuracy, CLEAR, LEFT, sign},
};
use wfl_discrete::{
    finite::largest,
    system::{FIXED, System},
};
use wfl_linear::LinearSolver;
use wfl_sparse::csr::Csr;

/// What uncertainties of the size of the rows of a matrix make of the unknowns.
pub struct Response {
    matrix: Arc<Csr>,
    /// By dof, in the rows of this rank: the sum of the sizes of the entries of its row that belong to its own field, of all
    /// where it has none; zero for dofs that are not free.
    sizes: Vec<f64>,
    /// By field that is solved for, what an uncertainty of its rows makes of all unknowns, by dof; `None` where that cannot be
    /// found.
    by_field: Option<Vec<(usize, Vec<f64>)>>,
}

/// An estimate of the error of a solution of linear equations that is no smaller than that of [`super::digits`], where it tells of
/// many digits; `known` keeps what was found of their matrix.
pub fn bound(known: &mut Option<Response>, state: Solved<'_>, solver: &mut LinearSolver) -> Option<Accuracy> {
    if !state.system.bulk_stays() {
        return None;
    }
    let matrix = state.system.shared_bulk();
    if known.as_ref().is_none_or(|known| !Arc::ptr_eq(&known.matrix, &matrix)) {
        *known = Some(Response::new(state.system, matrix, solver));
    }
    known.as_ref()?.accuracy(state).filter(|found| found.error < CLEAR)
}

impl Response {
    fn new(system: &System, matrix: Arc<Csr>, solver: &mut LinearSolver) -> Self {
        let sizes = row_sizes(system, &matrix);
        let by_field = solutions(system, &sizes, solver);
        Self { matrix, sizes, by_field }
    }

    fn accuracy(&self, state: Solved<'_>) -> Option<Accuracy> {
        let Solved { system, u, residual, tangent, .. } = state;
        let by_field = self.by_field.as_ref()?;
        let uncertainty = system.rounding(u, residual, tangent);
        let quotient = |d: usize| (uncertainty[d] + residual.values[d].abs()) / self.sizes[d];
        let of_body = |body: usize| largest(system.dofs_of_body(body).filter(|d| self.sizes[*d] > 0.0).map(quotient));
        let mut quotients: Vec<f64> = (0..system.n_bodies()).map(of_body).collect();
        system.team().max(&mut quotients);
        let mut error = vec![0.0; u.len()];
        for (field, solution) in by_field {
            // what is uncertain in one body changes none that nothing connects with it
            let on = system.largest_beside(&quotients, |body| system.field_of_body(body) == *field);
            let all = error.iter_mut().zip(solution).enumerate();
            all.for_each(|(dof, (sum, x))| *sum += on[system.body_of(dof)] * x.abs());
        }
        let worst = system.relative_sizes(u, &error).into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        worst.map(|(body, error)| Accuracy { error, field: system.fields[system.field_of_body(body)].name.clone() })
    }
}

/// By dof the size of its row.
fn row_sizes(system: &System, matrix: &Csr) -> Vec<f64> {
    let numbering = &system.numbering;
    let fields: Vec<usize> = numbering.free_dofs.iter().map(|d| system.field_of(*d as usize)).collect();
    let mut sizes = vec![0.0; numbering.n_dofs];
    for (row, dof) in numbering.free_dofs.iter().enumerate().filter(|(_, d)| system.owns(**d as usize)) {
        let (columns, values) = matrix.row(row);
        let entries = || columns.iter().zip(values).map(|(c, v)| (fields[*c as usize] == fields[row], v.abs()));
        let own: f64 = entries().filter(|(is_own, _)| *is_own).map(|(_, v)| v).sum();
        sizes[*dof as usize] = if own > 0.0 { own } else { entries().map(|(_, v)| v).sum() };
    }
    sizes
}

/// By field what uncertainties of the size of its rows, with signs that look random, make of all unknowns.
fn solutions(system: &System, sizes: &[f64], solver: &mut LinearSolver) -> Option<Vec<(usize, Vec<f64>)>> {
    let is_empty = |d: &u32| system.owns(*d as usize) && sizes[*d as usize] == 0.0;
    if system.team().any(system.numbering.free_dofs.iter().any(is_empty)) {
        return None;
    }
    let mut found = Vec::new();
    for (field, rows) in (0..system.fields.len()).filter_map(|k| Some((k, system.range(k)?))) {
        let mut uncertainty = vec![0.0; sizes.len()];
        for d in rows.filter(|d| system.numbering.free[*d] != FIXED) {
            uncertainty[d] = sign(1, system.dof_number(d)) * sizes[d];
        }
        let (mut rhs, mut x) = (Vec::new(), Vec::new());
        system.numbering.gather(&uncertainty, &mut rhs);
        if system.team().all(rhs.iter().all(|r| *r == 0.0)) {
            continue;
        }
        solver.solve(&rhs, &mut x, LEFT).ok()?;
        let mut solution = vec![0.0; sizes.len()];
        for (d, x) in system.numbering.free_dofs.iter().zip(&x) {
            solution[*d as usize] = *x;
        }
        found.push((field, solution));
    }
    Some(found)
}
