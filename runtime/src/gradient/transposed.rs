//! Solutions with the transposed tangent at the end of a step, as the terms are written: no law of it is scaled or
//! regularised, and no older factor stands in.

use std::sync::Arc;

use wfl::Diagnostic;

use super::refused::{NO_DERIVATIVE, not_made};
use crate::{
    csr::Csr,
    solve::{CheckedLlt, CheckedLu, LinearSolver, SolverOptions},
    system::{Branches, System},
};

/// Solutions with the transposed tangent of a step. The factor stays while the matrix does.
#[derive(Default)]
pub(super) struct Transposed {
    solver: Option<(Box<dyn LinearSolver>, Csr)>,
    /// The step is another one than that of the factor.
    pub(super) is_new: bool,
    pub(super) solutions: usize,
    pub(super) factorisations: usize,
}

impl Transposed {
    /// By dof in the axes of the scene, zero where values are prescribed: the solution at the state `u` of a right-hand side
    /// by dof.
    pub(super) fn solve(
        &mut self,
        system: &System,
        u: &[f64],
        rhs: &[f64],
        threads: usize,
    ) -> Result<Vec<f64>, Box<Diagnostic>> {
        let numbering = &system.numbering;
        if std::mem::take(&mut self.is_new) {
            self.factor(system, u, threads)?;
        }
        let mut turned = rhs.to_vec();
        numbering.turn(&mut turned);
        let mut own = Vec::new();
        numbering.gather(&turned, &mut own);
        let mut x = vec![0.0; own.len()];
        if own.iter().any(|b| *b != 0.0) {
            let (solver, _) = self.solver.as_mut().expect("factored above");
            solver.solve(&own, &mut x).map_err(|e| singular(&e.to_string()))?;
            self.solutions += 1;
        }
        let zero = vec![0.0; u.len()];
        let mut out = zero.clone();
        numbering.advance(&zero, &x, 1.0, &mut out);
        Ok(out)
    }

    fn factor(&mut self, system: &System, u: &[f64], threads: usize) -> Result<(), Box<Diagnostic>> {
        let mut tangent = system.new_tangent();
        system.tangent(u, Branches::AsWritten, &mut tangent).map_err(|e| not_made(&e.to_string()))?;
        let matrix = system.bulk().plus(&tangent.changing).map_err(|e| not_made(&e.to_string()))?;
        let is_symmetric = system.is_symmetric();
        let matrix = if is_symmetric { matrix } else { matrix.transpose() };
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
        let failed = |e: crate::solve::SolveError| singular(&e.to_string());
        let pattern = Arc::clone(matrix.pattern());
        if is_symmetric {
            let mut solver = CheckedLlt::new(&pattern, Some(&positions), options).map_err(failed)?;
            if solver.factor(&matrix).is_ok() {
                self.solver = Some((Box::new(solver), matrix));
                return Ok(());
            }
        }
        let mut solver = CheckedLu::new(&pattern, Some(&positions), options).map_err(failed)?;
        solver.factor(&matrix).map_err(failed)?;
        self.solver = Some((Box::new(solver), matrix));
        Ok(())
    }
}

/// The tangent at a solution cannot be solved with.
fn singular(why: &str) -> Box<Diagnostic> {
    let d = Diagnostic::new(NO_DERIVATIVE, "the tangent at the solution is singular: the result has no derivative");
    Box::new(
        d.note(why.to_owned())
            .help("a state between two branches, or one that is not unique, has none: W609, and the points told above"),
    )
}
