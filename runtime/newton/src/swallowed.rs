//! Corrections so short that adding them leaves an unknown as it is, while much of its equation is open.
//!
//! A law that is steep at rest (friction by the logarithm of a slip rate, from a slope of 1e20 on) asks for a correction below the
//! spacing of numbers there, and would be asked for the same one for ever. One number further on its slope is that of the law in
//! motion. Promises: changes nothing where corrections move what they are for.

use wfl_discrete::system::System;

/// Unknowns whose part of the work of the correction is below this share of the largest wait for the others: a thousandth of the
/// work is no reason to move what rounds.
const SHARE: f64 = 1e-3;

/// Makes the corrections of a direction (by free number) at `u` (by dof) that are lost one number long, where the residual by dof
/// times the correction is much of the largest such work. Whether there are some.
pub(super) fn lengthen(system: &System, u: &[f64], residual: &[f64], direction: &mut [f64]) -> bool {
    let dofs = &system.numbering.free_dofs;
    let works = dofs.iter().zip(&*direction).map(|(dof, d)| (residual[*dof as usize] * d).abs());
    let mut most = [works.fold(0.0, f64::max)];
    system.team().max(&mut most);
    let mut found = false;
    for (dof, d) in dofs.iter().zip(direction) {
        let at = u[*dof as usize];
        if *d != 0.0 && at + *d == at && (residual[*dof as usize] * *d).abs() >= SHARE * most[0] {
            *d = (at.abs().next_up() - at.abs()).copysign(*d);
            found = true;
        }
    }
    system.team().any(found)
}

#[cfg(test)]
mod tests {
    use super::lengthen;
    use crate::test_block::{Block, LAPLACE, PENALTY};

    #[test]
    fn a_correction_that_is_lost_becomes_one_number_long_and_others_stay() {
        let system = Block::new(1, &[LAPLACE], &[PENALTY]).system;
        let dofs = system.numbering.free_dofs.clone();
        let (mut u, mut residual) = (vec![0.0; system.numbering.n_dofs], vec![0.0; system.numbering.n_dofs]);
        u[dofs[0] as usize] = -1.0;
        u[dofs[1] as usize] = 1.0;
        u[dofs[2] as usize] = 1.0;
        residual[dofs[0] as usize] = 1.0;
        residual[dofs[1] as usize] = 1e-6;
        residual[dofs[2] as usize] = 1e20;
        let mut direction = vec![0.0; dofs.len()];
        direction[..3].copy_from_slice(&[-1e-20, -1e-20, 1e-40]);
        let works_alike = direction.clone();
        assert!(lengthen(&system, &u, &residual, &mut direction));
        assert!(!lengthen(&system, &u, &residual, &mut direction), "they move what they are for now");
        assert_eq!(direction[..3], [-f64::EPSILON, -1e-20, f64::EPSILON], "from {works_alike:?}");
    }
}
