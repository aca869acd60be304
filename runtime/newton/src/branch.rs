//! The branch that buckles: from an equilibrium in which the energy is no minimum to one in which it is.
//!
//! Newton's method is drawn to every stationary point of the energy, a straight column under three times its buckling load
//! among them. Where the scene asks for it (`solver newton with perturb=1e-6`), a step that ends in such a state is pushed
//! along the lowest direction, the eigenvector of `A v = m D v` with the smallest m (A the tangent, D by row the sum of its
//! magnitudes), by so much of the extent of the mesh. From there the energy decreases (`downhill`).
//!
//! Promises: the state that is left behind is an equilibrium with a positive definite tangent, or that which was there. The
//! side to which it goes is that of the loads where they push to one, and otherwise always the same. Needs a symmetric
//! tangent of displacements alone; does nothing else where there is none.

use super::{
    LoadStep, Method, NewtonError, StepHistory,
    downhill::{Downhill, Shifted},
    load_step::{Done, Norm},
};
use wfl_sparse::solve::LinearSolver as _;

/// Inverse iterations for the lowest direction, and the relative change of its curvature at which they end: what is looked
/// for is its sign and a direction that leads away, no digits of either.
const INVERSE_ITERATIONS: usize = 60;
const SETTLED: f64 = 1e-3;
/// Equilibria that may be left in one step: each may have a direction of its own.
const MOST_BRANCHES: usize = 8;
/// Work on the direction below this part of the size of the loads pushes to no side: it is rounding of what cancels, and the
/// direction is taken as it is numbered.
const NO_SIDE: f64 = 1e-10;

/// Leaves an equilibrium that is not a minimum, pushed by `size` times the extent of the mesh. What was done, or `None`
/// where there was nothing to do or no other state was found; `u` is then as it was.
///
/// # Errors
/// Those that end a run.
pub(super) fn leave(step: &mut LoadStep<'_>, u: &mut [f64], size: f64) -> Result<Option<StepHistory>, NewtonError> {
    let (mut all, mut was_lost): (Option<StepHistory>, bool) = (None, false);
    for _ in 0..MOST_BRANCHES {
        let before = u.to_vec();
        let found = from_one(step, u, size, all.take().unwrap_or_default());
        match found {
            Err(error) if error.ends_the_run() => return Err(error),
            Ok(Leaving::Found(history)) => all = Some(history),
            Ok(Leaving::Stable(history)) => {
                all = Some(history).filter(|h| !h.iterations.is_empty());
                break;
            }
            Err(_) | Ok(Leaving::Lost(_)) => {
                u.copy_from_slice(&before);
                was_lost = true;
                if let Ok(Leaving::Lost(history)) = found {
                    all = Some(history).filter(|h| h.converged());
                }
                break;
            }
        }
    }
    if all.is_some() || was_lost {
        // what is judged of the state is solved with the factor there, and not with one on a way that led nowhere
        step.assemble_tangent(u, false)?;
        step.factor()?;
    }
    Ok(all)
}

/// What came of leaving one equilibrium; histories go on.
enum Leaving {
    /// It is a minimum.
    Stable(StepHistory),
    /// Another one was found, where the tangent is positive definite.
    Found(StepHistory),
    /// None was.
    Lost(StepHistory),
}

fn from_one(
    step: &mut LoadStep<'_>,
    u: &mut [f64],
    size: f64,
    mut history: StepHistory,
) -> Result<Leaving, NewtonError> {
    let Some(tangent) = at_equilibrium(step, u)? else { return Ok(Leaving::Stable(history)) };
    let Some(lowest) = tangent.lowest(step) else { return Ok(Leaving::Stable(history)) };
    let (low, high) = step.system.mesh.bounds();
    let extent = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
    let start = u.to_vec();
    step.go(&start, &lowest, size * extent, u);
    let from = history.iterations.len();
    let converged = descend(step, u, &mut history)?;
    if converged {
        return Ok(Leaving::Found(history));
    }
    history.iterations.truncate(from);
    Ok(Leaving::Lost(history))
}

/// Goes downhill to a minimum; false where none was reached.
fn descend(step: &mut LoadStep<'_>, u: &mut [f64], history: &mut StepHistory) -> Result<bool, NewtonError> {
    let norm = Norm::new(step.weights(), false);
    let mut here = step.measure(u, &norm)?;
    let mut downhill = Downhill::default();
    for _ in 0..step.options.max_iterations {
        if step.watch.stops() {
            return Err(NewtonError::Stopped);
        }
        let Some(tangent) = at_equilibrium(step, u)? else { return Ok(false) };
        let Some(shift) = downhill.factor(step, &tangent) else { return Ok(false) };
        if shift == 0.0
            && let Some(stop) = here.stop(step.options)
        {
            history.stop = Some(stop);
            return Ok(true);
        }
        let Some((alpha, found)) = downhill.go(step, u, &here, &norm)? else { return Ok(false) };
        here = found;
        step.record(history, &here, Done { method: Method::Branch, step: alpha, changed: 0, corrections: 1 });
    }
    Ok(false)
}

/// The tangent of the equations as written, where a smaller energy is what a body at rest would go to.
fn at_equilibrium(step: &mut LoadStep<'_>, u: &[f64]) -> Result<Option<Shifted>, NewtonError> {
    if step.system.rates().is_some() || !Downhill::serves(step) {
        return Ok(None);
    }
    step.assemble_tangent(u, false)?;
    Ok(Shifted::of(step))
}

impl Shifted {
    fn curvature(&self, v: &[f64]) -> f64 {
        let mut product = vec![0.0; v.len()];
        self.matrix.multiply(v, &mut product, 1);
        let parts = v.iter().zip(&product).zip(&self.sizes);
        let (energy, size) = parts.fold((0.0, 0.0), |(e, s), ((v, p), d)| (e + v * p, s + v * v * d));
        energy / size
    }

    /// The lowest direction, its largest entry 1 or -1; `None` where the tangent is positive definite.
    fn lowest(&self, step: &LoadStep<'_>) -> Option<Vec<f64>> {
        let mut made = None;
        if self.factor(step, 0, &mut made)? < 0 {
            return None;
        }
        let factor = made.as_mut()?;
        #[expect(clippy::cast_precision_loss, reason = "fixed numbers, orthogonal to nothing in particular")]
        let mut v: Vec<f64> =
            (0..self.sizes.len()).map(|k| ((k + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5).collect();
        let mut before = f64::INFINITY;
        for _ in 0..INVERSE_ITERATIONS {
            let rhs: Vec<f64> = v.iter().zip(&self.sizes).map(|(v, d)| v * d).collect();
            factor.solve(&rhs, &mut v).ok()?;
            let largest = v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            v.iter_mut().for_each(|x| *x /= largest);
            let curvature = self.curvature(&v);
            if curvature < 0.0 && (curvature - before).abs() <= SETTLED * curvature.abs() {
                break;
            }
            before = curvature;
        }
        (self.curvature(&v) < 0.0).then(|| sided(step, v))
    }
}

/// Turns a direction to the side that the loads push to; without such a side its first entry of at least half the largest
/// is positive.
fn sided(step: &LoadStep<'_>, mut v: Vec<f64>) -> Vec<f64> {
    let mut loads = Vec::new();
    step.system.numbering.gather(step.system.constant_residual(), &mut loads);
    let (work, size) = loads.iter().zip(&v).fold((0.0, 0.0), |(w, s), (l, v)| (w - l * v, s + l.abs() * v.abs()));
    let largest = loads.iter().fold(0.0f64, |m, l| m.max(l.abs()));
    let plain = v.iter().find(|x| x.abs() >= 0.5).is_some_and(|x| *x < 0.0);
    let pushed = work.abs() > NO_SIDE * size.max(largest);
    if if pushed { work < 0.0 } else { plain } {
        v.iter_mut().for_each(|x| *x = -*x);
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Silent, downhill::tests::shifted, test_block::LAPLACE, tests::Solving};

    #[test]
    fn a_curvature_is_that_of_a_direction_in_units_of_the_rows() {
        let tangent = shifted(2.0, 3.0);
        assert_eq!(tangent.curvature(&[1.0, 1.0, 0.0, 0.0]), 1.0);
        assert_eq!(tangent.curvature(&[7.0, -7.0, 0.0, 0.0]), -0.2, "of any length");
    }

    #[test]
    fn a_tangent_that_is_positive_definite_is_not_shifted_and_has_no_way_down() {
        Solving::new(&[LAPLACE], &[]).with(&mut Silent, |step, _| {
            let tangent = shifted(2.0, 1.0);
            assert_eq!(tangent.factor(step, 0, &mut None), Some(-1));
            assert_eq!(tangent.lowest(step), None);
        });
    }

    #[test]
    fn the_lowest_direction_goes_down_and_has_the_largest_entry_one() {
        Solving::new(&[LAPLACE], &[]).with(&mut Silent, |step, _| {
            let tangent = shifted(2.0, 3.0);
            let lowest = tangent.lowest(step).expect("there is one");
            assert!((tangent.curvature(&lowest) + 0.2).abs() < 4e-3, "{lowest:?}");
            assert_eq!(lowest.iter().fold(0.0f64, |m, x| m.max(x.abs())), 1.0);
        });
    }

    #[test]
    fn a_direction_is_turned_to_where_the_loads_push() {
        let mut solving = Solving::new(&[LAPLACE, "[-1,0].Test_u"], &[]);
        solving.with(&mut Silent, |step, _| {
            let x = |dof: &u32| f64::from(1 - dof % 2);
            let right: Vec<f64> = step.system.numbering.free_dofs.iter().map(x).collect();
            let left: Vec<f64> = right.iter().map(|x| -x).collect();
            assert_eq!(sided(step, left), right);
            assert_eq!(sided(step, right.clone()), right);
            // across the loads the first large entry is positive
            let up: Vec<f64> = right.iter().map(|x| 1.0 - x).collect();
            assert_eq!(sided(step, up.iter().map(|x| -x).collect()), up);
        });
    }
}
