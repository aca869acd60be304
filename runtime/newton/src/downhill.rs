//! Downhill in the energy, where there is one.
//!
//! A softening law (a joint that breaks, a body that buckles) has states at which Newton's direction leads to a saddle or a top
//! of the energy, and searches for a smaller residual go round between such states for ever. Here each direction is that of
//! `A + s D` with the smallest s of a list for which that is positive definite (A the tangent, D by row the sum of its magnitudes;
//! Nocedal and Wright, Numerical Optimization, 2006, 3.4), followed to where the energy is the least (`critical_point`). Near a
//! minimum s is zero, and the iteration is Newton's.
//!
//! Where it is friction alone that has no energy, the whole of A is shifted by what makes its symmetric part positive definite: the
//! residual falls along such a direction, which is Newton's where s is zero. Friction itself may ask for a shift at the solution, so
//! Newton's correction is tried first once branches stay.
//!
//! Promises: directions that go downhill in an energy that there is. Of a tangent that is not symmetric (joints that soften and rub)
//! the symmetric part is what leads, which is a guess that the search along it judges. Needs displacements alone and factors; does
//! nothing where there are none. Does not say when to begin.

use std::time::Instant;

use super::{
    LoadStep, NewtonError,
    critical_point::{CriticalPoint, GOOD},
    load_step::{Measured, Norm},
};
use wfl_compiler::types::FieldKind;
use wfl_discrete::system::{FIXED, System};
use wfl_linear::LinearSolver;
use wfl_sparse::{
    csr::Csr,
    solve::{CheckedLlt, LinearSolver as _},
};

/// Shifts that are tried, in parts of the sums of rows: from rounding of a stiff body by this factor each.
pub(super) const SMALLEST_SHIFT: f64 = 1e-14;
const SHIFT_FACTOR: f64 = 8.0;

/// How many shifts there are, a number: the last is beyond one, where every symmetric matrix is positive definite (Gershgorin).
const N_SHIFTS: i32 = 17;

/// Where a way downhill is.
#[derive(Default)]
pub(super) struct Downhill {
    /// The number of the shift that the next indefinite tangent is tried with first.
    first: i32,
    /// The last iteration left all branches as they were.
    pub(super) is_settled: bool,
    /// The factor made last; its analysis serves the next one.
    made: Option<CheckedLlt>,
}

impl Downhill {
    /// Whether the equations of a scene may be those of an energy of displacements.
    pub(super) fn suits(system: &System) -> bool {
        system.is_symmetric() && Self::may_serve(system)
    }

    /// Whether they are but for laws on faces that are not linear on one branch either: joints that soften, and rub.
    pub(super) fn nearly_suits(system: &System) -> bool {
        let mut of_bodies = system.terms.iter().filter(|t| t.on_cells());
        let rest_is_symmetric = of_bodies.all(|t| t.law.symmetric);
        !system.is_symmetric() && system.has_curved_faces() && rest_is_symmetric && Self::may_serve(system)
    }

    /// Whether bodies that are not linear have an energy, and friction beside it none.
    pub(super) fn rubs(system: &System) -> bool {
        let rest_is_symmetric = system.terms.iter().filter(|t| t.on_cells()).all(|t| t.law.symmetric);
        !system.is_symmetric() && system.has_nonlinear_bodies() && rest_is_symmetric && Self::may_serve(system)
    }

    /// Not where sides meet at other places with each step: forces that end at edges have no energy, and the way to it leads off them.
    fn may_serve(system: &System) -> bool {
        let has_multipliers = system.fields.iter().any(|f| f.kind == FieldKind::Multiplier);
        !has_multipliers && !system.has_moving_images() && !system.is_linear() && system.team().is_alone()
    }

    /// Whether the fields are those of displacements alone, and factors of whole tangents are what steps are solved with.
    pub(super) fn serves(step: &LoadStep<'_>) -> bool {
        Self::may_serve(step.system) && step.solver.is_ours() && !step.solver.iterates() && !step.tangent.is_applied()
    }

    /// Factors a tangent, with a shift where it is not positive definite: the shift, or `None` where none of the list makes it so.
    pub(super) fn factor(&mut self, step: &mut LoadStep<'_>, tangent: &Shifted) -> Option<f64> {
        let begin = Instant::now();
        let number = tangent.factor(step, self.first, &mut self.made);
        step.spent.factor += begin.elapsed().as_secs_f64();
        self.first = (number? - 1).max(0);
        Some(shift(number?))
    }

    /// A step from `u`, whose measures are `here`, with the tangent at hand; `None` where there is no way.
    pub(super) fn advance(
        &mut self,
        step: &mut LoadStep<'_>,
        u: &mut [f64],
        here: &Measured,
        norm: &Norm,
    ) -> Result<Option<(f64, Measured)>, NewtonError> {
        let tangent = if Self::serves(step) { Shifted::part_of(step) } else { None };
        let Some(tangent) = tangent else { return Ok(None) };
        let Some(shift) = self.factor(step, &tangent) else { return Ok(None) };
        if Self::rubs(step.system) {
            let rhs = step.opposite(&here.residual);
            if self.is_settled
                && let Some(taken) = correct_much(step, &rhs, u, here, norm)?
            {
                return Ok(Some(taken));
            }
            if tangent.shift_whole(step, shift) {
                let mut direction = Vec::new();
                step.factor()?;
                step.solve(&rhs, &mut direction, 0.0)?;
                return follow(step, &direction, u, here, norm);
            }
        }
        self.go(step, u, here, norm)
    }

    /// A step along the direction of the factor made last.
    pub(super) fn go(
        &mut self,
        step: &mut LoadStep<'_>,
        u: &mut [f64],
        here: &Measured,
        norm: &Norm,
    ) -> Result<Option<(f64, Measured)>, NewtonError> {
        let Some(made) = &mut self.made else { return Ok(None) };
        let rhs = step.opposite(&here.residual);
        let mut direction = vec![0.0; rhs.len()];
        step.spent.linear_solves += 1;
        made.solve(&rhs, &mut direction)?;
        follow(step, &direction, u, here, norm)
    }
}

/// Newton's correction where it leaves little of the residual: near a solution that is not a minimum of anything a shift only
/// makes it slow. The state is as it was where it does not.
fn correct_much(
    step: &mut LoadStep<'_>,
    rhs: &[f64],
    u: &mut [f64],
    here: &Measured,
    norm: &Norm,
) -> Result<Option<(f64, Measured)>, NewtonError> {
    let (start, mut direction) = (u.to_vec(), Vec::new());
    let solved = step.factor().and_then(|()| step.solve(rhs, &mut direction, 0.0));
    if solved.is_ok() && step.longest_step(&start, &direction, 1.0) == 1.0 {
        step.go(&start, &direction, 1.0, u);
        if let Ok(found) = step.measure(u, norm)
            && (found.norm <= GOOD * here.norm || found.stop(step.options).is_some())
        {
            return Ok(Some((1.0, found)));
        }
        u.copy_from_slice(&start);
    }
    Ok(None)
}

/// A step along a direction to where the energy is the least; `None` where it does not go down.
fn follow(
    step: &mut LoadStep<'_>,
    direction: &[f64],
    u: &mut [f64],
    here: &Measured,
    norm: &Norm,
) -> Result<Option<(f64, Measured)>, NewtonError> {
    let start = u.to_vec();
    let allowed = step.longest_step(&start, direction, 1.0);
    let search = CriticalPoint { direction, norm, follows_turns: false, allowed };
    search.descend(step, u, &start, here)
}

/// The shift with a number, in parts of the sums of rows; -1 is none.
fn shift(number: i32) -> f64 {
    if number < 0 { 0.0 } else { SMALLEST_SHIFT * SHIFT_FACTOR.powi(number) }
}

/// A symmetric tangent, and by row the sum of its magnitudes.
pub(super) struct Shifted {
    pub(super) matrix: Csr,
    pub(super) sizes: Vec<f64>,
}

impl Shifted {
    /// The tangent at hand; `None` where it is not symmetric or not that of displacements alone.
    pub(super) fn of(step: &LoadStep<'_>) -> Option<Self> {
        Self::new(step, LinearSolver::symmetric_whole(step.system, step.tangent)?)
    }

    /// The same, or the symmetric part of one that is not symmetric: what friction takes from both sides.
    fn part_of(step: &LoadStep<'_>) -> Option<Self> {
        let whole = step.system.whole_matrix(step.tangent).ok()?;
        if let Some(matrix) = LinearSolver::if_symmetric(whole.clone()) {
            return Self::new(step, matrix);
        }
        let mut matrix = whole.plus(&whole.transpose()).ok()?;
        matrix.values_mut().iter_mut().for_each(|a| *a *= 0.5);
        Self::new(step, matrix)
    }

    fn new(step: &LoadStep<'_>, matrix: Csr) -> Option<Self> {
        let diagonal: Vec<f64> = (0..matrix.n_rows()).map(|row| matrix.get(row, row)).collect();
        if (0..step.system.fields.len()).any(|field| acts_as_force(step.system, field, &diagonal)) {
            return None;
        }
        let sizes: Vec<f64> = (0..matrix.n_rows()).map(|row| matrix.row(row).1.iter().map(|a| a.abs()).sum()).collect();
        sizes.iter().all(|d| *d > 0.0).then_some(Self { matrix, sizes })
    }

    /// The matrix with a shift of its diagonal.
    fn with(&self, shift: f64) -> Option<Csr> {
        let mut matrix = self.matrix.clone();
        let on_pattern = self.sizes.iter().enumerate().all(|(k, size)| matrix.add_to(k, k, shift * size));
        if on_pattern {
            return Some(matrix);
        }
        let entries: Vec<(u32, u32, f64)> = (0..).zip(&self.sizes).map(|(k, size)| (k, k, shift * size)).collect();
        let n = self.sizes.len();
        self.matrix.plus(&Csr::from_triplets(n, n, &entries).ok()?).ok()
    }

    /// Shifts the whole tangent at hand, of which this is the symmetric part; false where its pattern has no place for that.
    fn shift_whole(&self, step: &mut LoadStep<'_>, shift: f64) -> bool {
        let changing = &mut step.tangent.changing;
        shift == 0.0 || self.sizes.iter().enumerate().all(|(k, size)| changing.add_to(k, k, shift * size))
    }

    /// Leaves in `made` the factor with the first shift that makes the tangent positive definite: its number, that of none being -1.
    /// Where none does not serve the search begins with the number `first`, which is taken if it serves.
    pub(super) fn factor(&self, step: &LoadStep<'_>, first: i32, made: &mut Option<CheckedLlt>) -> Option<i32> {
        let mut serves = |number: i32| {
            let shifted = if number < 0 { None } else { Some(self.with(shift(number))?) };
            Some(step.solver.cholesky(shifted.as_ref().unwrap_or(&self.matrix), made).is_ok())
        };
        if serves(-1)? {
            return Some(-1);
        }
        let (mut low, mut high, mut stride) = (first - 1, first, 1);
        while !serves(high)? {
            if high + 1 >= N_SHIFTS {
                return None;
            }
            (low, high, stride) = (high, (high + stride).min(N_SHIFTS - 1), 2 * stride);
        }
        let mut last = high;
        while high - low > 1 {
            last = i32::midpoint(low, high);
            (low, high) = if serves(last)? { (low, last) } else { (last, high) };
        }
        (last == high || serves(high)?).then_some(high)
    }
}

/// Whether no free unknown of a field has a stiffness of its own: a pressure, whose energy has a maximum where that of the
/// displacements has a minimum.
fn acts_as_force(system: &System, field: usize, diagonal: &[f64]) -> bool {
    let dofs = system.range(field).into_iter().flatten();
    let mut free = dofs.map(|dof| system.numbering.free[dof]).filter(|free| *free != FIXED).peekable();
    free.peek().is_some() && free.all(|free| diagonal[free as usize] <= 0.0)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::{
        Silent,
        test_block::{CUBIC, LAPLACE, PENALTY_WITH_FRICTION},
        tests::Solving,
    };

    /// A matrix of 4 unknowns of two pairs that are coupled, with eigenvectors (1, 1) and (1, -1).
    pub(crate) fn shifted(diagonal: f64, beside: f64) -> Shifted {
        let pair = |k: u32| [(k, k, diagonal), (k + 1, k + 1, diagonal), (k, k + 1, beside), (k + 1, k, beside)];
        let matrix = Csr::from_triplets(4, 4, &[pair(0), pair(2)].concat()).unwrap();
        Shifted { matrix, sizes: vec![diagonal.abs() + beside.abs(); 4] }
    }

    #[test]
    fn the_shift_is_the_first_of_the_list_that_makes_a_tangent_definite() {
        Solving::new(&[LAPLACE], &[]).with(&mut Silent, |step, _| {
            // its lowest curvature is -1/5
            let mut made = None;
            for first in [0, 3, N_SHIFTS - 3] {
                let number = shifted(2.0, 3.0).factor(step, first, &mut made).expect("one of them does");
                assert!((0.2..0.2 * SHIFT_FACTOR).contains(&shift(number)), "{number}");
            }
            assert_eq!(
                shifted(2.0, 3.0).factor(step, N_SHIFTS - 1, &mut made),
                Some(N_SHIFTS - 1),
                "what serves is taken"
            );
            assert!(shift(N_SHIFTS - 1) > 1.0);
        });
    }

    /// A body that is not linear on a floor with friction: friction has no energy, the body has one.
    #[test]
    fn a_shift_of_the_whole_tangent_is_that_of_its_symmetric_part() {
        let mut solving = Solving::new(&[LAPLACE, CUBIC, "[-4,2].Test_u"], &[PENALTY_WITH_FRICTION]);
        solving.with(&mut Silent, |step, u| {
            assert!(Downhill::rubs(step.system) && !Downhill::suits(step.system));
            step.assemble_tangent(u, false).unwrap();
            let tangent = Shifted::part_of(step).expect("its symmetric part");
            let before = step.tangent.changing.clone();
            assert!(tangent.shift_whole(step, 0.0) && step.tangent.changing.values() == before.values());
            assert!(tangent.shift_whole(step, 0.5));
            for (k, size) in tangent.sizes.iter().enumerate() {
                let added = step.tangent.changing.get(k, k) - before.get(k, k);
                assert!((added - 0.5 * size).abs() < 1e-12 * size, "{added} {size}");
            }
        });
        let linear = crate::test_block::Block::new(1, &[LAPLACE], &[PENALTY_WITH_FRICTION]);
        assert!(!Downhill::rubs(&linear.system), "of linear bodies paths and active sets are known");
    }
}
