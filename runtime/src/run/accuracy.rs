//! How many digits the unknowns of a step have.
//!
//! The equations are known to rounding only: of row i about `eps sum_j |K_ij| |u_j|`, what is left of the residual on
//! top. What such an uncertainty does to the unknowns is not bounded by a condition number, which for contact is too
//! large by many orders (a stiff penalty is ill-conditioned without being inaccurate); it is sampled: the tangent is
//! solved for uncertainties of that size in every row with signs that look random (statistical condition estimation,
//! Kenney and Laub 1994, with the componentwise uncertainty of Oettli and Prager). Two solutions with a factor that is
//! there already. The estimate is of the error from finite precision; that of the mesh is another matter.

use wfl_compiler::types::FieldKind;

use crate::{strategy::Strategy, system::System};

/// Sets of signs that are tried.
const SAMPLES: u64 = 2;
/// Part of a right-hand side that its solution may leave: an estimate needs few digits, and an older factor serves.
const LEFT: f64 = 1e-6;

/// What finite precision leaves of the unknowns of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Accuracy {
    /// Estimated error of the least accurate unknown, relative to the largest value of its kind.
    pub error: f64,
    /// The field it belongs to.
    pub field: String,
}

impl Accuracy {
    /// Correct decimal digits, 0 to 16.
    #[must_use]
    pub fn digits(&self) -> f64 {
        if self.error.is_nan() { 0.0 } else { (-self.error.log10()).clamp(0.0, 16.0) }
    }
}

/// Estimates the error of `u`, a solution whose residual by dof is given. `None` where no tangent was needed.
pub(super) fn estimate(system: &System, strategy: &mut Strategy, u: &[f64], residual: &[f64]) -> Option<Accuracy> {
    let uncertainty: Vec<f64> = system.magnitudes(u).iter().map(|m| f64::EPSILON * m).collect();
    let mut worst: Option<Accuracy> = None;
    let (mut rhs, mut x) = (Vec::new(), Vec::new());
    for sample in 1..=SAMPLES {
        let disturbed: Vec<f64> = (0..u.len()).map(|d| residual[d] + sign(sample, d as u64) * uncertainty[d]).collect();
        system.numbering.gather(&disturbed, &mut rhs);
        if rhs.iter().all(|r| *r == 0.0) {
            continue;
        }
        strategy.solve(&rhs, &mut x, LEFT).ok()?;
        let mut error = vec![0.0; u.len()];
        for (d, e) in system.numbering.free_dofs.iter().zip(&x) {
            error[*d as usize] = *e;
        }
        for found in by_kind(system, u, &error) {
            if worst.as_ref().is_none_or(|w| found.error.is_nan() || found.error > w.error) {
                worst = Some(found);
            }
        }
    }
    worst
}

/// Relative errors of the fields of one unit and size: those that meet on an interface are one kind.
fn by_kind(system: &System, u: &[f64], error: &[f64]) -> Vec<Accuracy> {
    let largest = |v: &[f64], k: usize| {
        let kind = |f: &usize| system.alike(*f) == system.alike(k) && system.fields[*f].kind == FieldKind::Unknown;
        let ranges = (0..system.fields.len()).filter(kind).filter_map(|f| system.range(f));
        ranges.flat_map(|r| v[r].iter()).fold(0.0f64, |m, x| if x.is_nan() { f64::NAN } else { m.max(x.abs()) })
    };
    let unknown = |k: &usize| system.fields[*k].kind == FieldKind::Unknown && system.range(*k).is_some();
    (0..system.fields.len())
        .filter(unknown)
        .filter_map(|k| {
            let (size, error) = (largest(u, k), largest(error, k));
            let accuracy = Accuracy { error: error / size, field: system.fields[k].name.clone() };
            // a field that is exactly zero is right
            (size > 0.0).then_some(accuracy)
        })
        .collect()
}

/// 1 or -1, evenly (the finaliser of splitmix64, Steele, Lea and Flood 2014).
fn sign(sample: u64, dof: u64) -> f64 {
    let mut z = (dof + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ sample.wrapping_mul(0xd1b5_4a32_d192_ed03);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
}
