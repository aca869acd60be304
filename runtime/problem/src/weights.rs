//! Integrals that are linear in the unknowns, as products with a vector.
//!
//! `integral(e)` and `mean(e)` of an expression that is affine in the unknowns, and that reads nothing else that changes, are
//! `c + w.u` with the same c and w at every step. Scenes of many steps assemble them once ([`super::Steps::are_many`]), at the
//! points of the measure. Promises: the same number as at the points but for rounding, below 1e-13 of the largest summand; a
//! number that is not finite is that of the points.

use std::sync::{Arc, OnceLock};

use wfl_compiler::{
    Reading, TermLaw, ValueLaw,
    backend::{BackendError, KernelBackend},
    compile_value_weights, is_affine,
    types::{InputSlot, PlaceSig},
};
use wfl_discrete::{
    assemble::{AssembledTerm, Binding, Domain, Integrator, LawSlots},
    field::Field,
    system::{StateValues, System},
    value::{Sampled, Value},
};
use wfl_mesh::mesh::Mesh;

use super::Measured;

/// The states of the unknowns that an expression may read.
const READINGS: [Reading; 2] = [Reading::Current, Reading::Previous];

/// The weights of a measure.
pub(super) struct Weights {
    /// Laws whose residuals are the weights of the unknowns as they are read at a state.
    laws: Vec<(Reading, AssembledTerm)>,
    made: OnceLock<Option<Made>>,
}

/// What is assembled once.
struct Made {
    /// By dof, in the rows of this rank.
    weights: Vec<(Reading, Vec<f64>)>,
    /// The integral where all unknowns are zero, and the size of the region: on all ranks.
    sums: [f64; 2],
}

/// The laws of an expression that [`is_linear`] holds of.
pub(super) fn laws(
    env: &wfl_compiler::Env<'_>,
    place: &PlaceSig,
    name: &str,
    expr: &wfl::ast::Expr,
) -> Vec<(Reading, TermLaw)> {
    READINGS.into_iter().filter_map(|of| Some((of, compile_value_weights(env, place, name, expr, of)?))).collect()
}

/// Whether an expression is affine in the unknowns, now and at the end of the last step, and reads nothing else that changes.
pub(super) fn is_linear(law: &ValueLaw, fields: &[Field]) -> bool {
    let field = |slot: &InputSlot| match slot {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => Some(b.field.index()),
        _ => None,
    };
    let has_rates = law.inputs.iter().any(|slot| matches!(slot, InputSlot::History(..)));
    let are_unknowns =
        law.inputs.iter().filter_map(field).all(|k| fields[k].kind == wfl_compiler::types::FieldKind::Unknown);
    are_unknowns
        && !has_rates
        && law.prologue.slots.is_empty()
        && law.inputs.iter().any(|slot| field(slot).is_some())
        && is_affine(&law.kernel, |slot| field(&law.inputs[slot]).is_some())
}

impl Weights {
    /// Laws made callable on the points of a measure.
    ///
    /// # Errors
    /// [`BackendError`]; `None` where a law finds no unknowns there.
    pub(super) fn new(
        laws: Vec<(Reading, TermLaw)>,
        domain: &Arc<Domain>,
        of: (&Mesh, &[Field], &[Option<usize>]),
        backend: &dyn KernelBackend,
    ) -> Result<Option<Self>, BackendError> {
        let (mesh, fields, starts) = of;
        let mut made = Vec::new();
        for (reading, law) in laws {
            let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
            let Ok(binding) = Binding::new(mesh, domain, fields, slots) else { return Ok(None) };
            let kernel = backend.compile(&[&law.residual])?.swap_remove(0);
            let integrator = Integrator { domain: domain.clone(), binding: Arc::new(binding) };
            if integrator.moves() || law.tests.iter().any(|test| starts[test.field.index()].is_none()) {
                return Ok(None);
            }
            made.push((reading, AssembledTerm::new(law, integrator, None, kernel, None, starts)));
        }
        Ok(Some(Self { laws: made, made: OnceLock::new() }))
    }

    /// The integral and the size of the region; `None` where the points have to be asked. Made by all ranks together.
    pub(super) fn sums(&self, at: &Measured<'_>, value: (&Value, &Sampled)) -> Option<[f64; 2]> {
        let made = self.made.get_or_init(|| self.make(at.system, value)).as_ref()?;
        let Measured { system, u, .. } = *at;
        let mut own = 0.0;
        for (reading, weights) in &made.weights {
            let read = match reading {
                Reading::Current => u,
                _ => &system.past()?.unknowns,
            };
            own += dot(weights, read);
        }
        let sum = made.sums[0] + system.team().total(own);
        sum.is_finite().then_some([sum, made.sums[1]])
    }

    fn make(&self, system: &System, value: (&Value, &Sampled)) -> Option<Made> {
        let zero = vec![0.0; system.numbering.n_dofs];
        let (value, sampled) = value;
        let past = if system.past().is_some() { system.slices(&zero) } else { Vec::new() };
        let rest = StateValues { current: system.slices(&zero), previous: past, rates: None };
        let mut sums = [0.0; 2];
        value.for_each_counted_point(&system.mesh, sampled, rest.view(), |weight, v| {
            sums[0] += weight * v[0];
            sums[1] += weight;
        });
        system.team().sum(&mut sums);
        let mut weights = Vec::with_capacity(self.laws.len());
        let mut is_finite = sums[0].is_finite();
        for (reading, law) in &self.laws {
            let mut made = vec![0.0; zero.len()];
            // all ranks make all of them
            is_finite &= system.residual_of(law, &zero, &mut made).is_ok();
            weights.push((*reading, made));
        }
        system.team().all(is_finite).then_some(Made { weights, sums })
    }
}

/// A product of two vectors, with the rounding of each sum added at the end (Neumaier, Z. angew. Math. Mech. 54, 1974): what is
/// lost does not grow with their length.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (mut sum, mut lost) = (0.0f64, 0.0f64);
    for (a, b) in a.iter().zip(b) {
        let x = a * b;
        let next = sum + x;
        lost += if sum.abs() >= x.abs() { (sum - next) + x } else { (x - next) + sum };
        sum = next;
    }
    sum + lost
}

#[cfg(test)]
mod tests {
    use super::dot;

    #[test]
    fn a_product_loses_no_more_than_the_rounding_of_its_summands() {
        assert_eq!(dot(&[1e16, 1.0, 1.0, -1e16], &[1.0; 4]), 2.0);
        let many = vec![0.1; 1_000_000];
        assert!((dot(&many, &vec![1.0; 1_000_000]) - 1e5).abs() < 1e-11);
    }
}
