//! Rates where time starts: given and prescribed ones, and the highest ones, which follow from the equations.
//!
//! With R the equations at the first state and M their derivative in the highest rates a, R(u_0, r_0, a; p) = 0 at the free
//! dofs: `M da = -(R_p dp + R_u du_0 + R_r dr_0)`. Prescribed rates move as the differences in time that the run makes of
//! prescribed values. A result goes the other way, through the transposed M.

use std::ops::Range;

use wfl::Diagnostic;
use wfl_compiler::types::RateForm;
use wfl_discrete::{
    rates::{Kept, Rates},
    system::{FIXED, Numbering},
};
use wfl_run::{As, Mass, Passed, mass_at_start};

use super::{
    refused::{message, not_made},
    standing::Standing,
};

/// What a scene with rates begins with.
pub(super) struct Beginning {
    /// Nothing where masses stand on the diagonal.
    mass: Option<Mass>,
    /// By field with rates, its form and its dofs.
    fields: Vec<(RateForm, Range<usize>)>,
    /// Quotients of changes begin as the rates.
    begins_with_rates: bool,
    /// Where unknowns are driven, half of the step that they are taken to have made before: how long before the start their first quotients are.
    driven: Option<f64>,
}

/// First and second rates by dof.
pub(super) struct AtStart {
    pub(super) first: Vec<f64>,
    pub(super) second: Vec<f64>,
}

impl Beginning {
    /// Brings the equations to where time starts; `None` where no step reads the rates there.
    pub(super) fn new(standing: &mut Standing<'_, '_>) -> Result<Option<Self>, Box<Diagnostic>> {
        let of_a_list = standing.solving.steps.are_listed();
        let first = standing.trajectory.steps.first();
        if first.is_none_or(|s| s.kind != Passed::Given) {
            return Ok(None);
        }
        let step = standing.steps.step(0)?;
        let Some(rates) = step.rates.as_ref().filter(|r| r.are_read_at_start(of_a_list)) else { return Ok(None) };
        let fields = rates.fields().iter().map(|of| (of.form, of.dofs.clone())).collect();
        let begins_with_rates = rates.scheme().most_order(RateForm::First) > 2 && of_a_list;
        let driven = rates.length_before().filter(|_| rates.are_driven()).map(|length| 0.5 * length);
        standing.at(0)?;
        if standing.solving.explicit.is_some() {
            return Ok(Some(Self { mass: None, fields, begins_with_rates, driven }));
        }
        let mass = mass_at_start(&mut standing.solving, &step.u, step.window);
        let mass = mass.map_err(|e| not_made(&e.to_string()))?;
        if mass.leaves_some_out() {
            let d = message("nodes without mass stay at rest where time starts: that has no derivative yet");
            return Err(Box::new(d.help("a term with the second rate at every node")));
        }
        standing.at(0)?;
        Ok(Some(Self { mass: Some(mass), fields, begins_with_rates, driven }))
    }

    /// The highest rates by dof of forces by dof, both in the axes of the scene and zero where values are prescribed.
    pub(super) fn highest(&self, numbering: &Numbering, forces: &[f64], form: As) -> Result<Vec<f64>, Box<Diagnostic>> {
        let mut turned = forces.to_vec();
        numbering.turn(&mut turned);
        let mut own = Vec::new();
        numbering.gather(&turned, &mut own);
        let zero = vec![0.0; forces.len()];
        let mut out = zero.clone();
        if let Some(mass) = self.mass.as_ref().filter(|_| own.iter().any(|x| *x != 0.0)) {
            let found = mass.rates(&own, form).map_err(|e| not_made(&e.to_string()))?;
            numbering.advance(&zero, &found, 1.0, &mut out);
        }
        Ok(out)
    }

    /// Of both rates the highest one of each dof.
    pub(super) fn of_highest(&self, of: &AtStart) -> Vec<f64> {
        let mut out = vec![0.0; of.first.len()];
        for (form, dofs) in &self.fields {
            let from = if *form == RateForm::Second { &of.second } else { &of.first };
            out[dofs.clone()].copy_from_slice(&from[dofs.clone()]);
        }
        out
    }

    /// Changes the highest rate of each dof.
    pub(super) fn each_highest(&self, of: &mut AtStart, mut f: impl FnMut(usize, &mut f64)) {
        for (form, dofs) in &self.fields {
            let from = if *form == RateForm::Second { &mut of.second } else { &mut of.first };
            dofs.clone().for_each(|d| f(d, &mut from[d]));
        }
    }

    /// What is kept where time starts.
    pub(super) fn kept(&self, rates: &Rates, of: &AtStart) -> Kept {
        let mut kept = rates.nothing();
        for (kept, (_, dofs)) in kept.iter_mut().zip(&self.fields) {
            for (slot, kept) in kept.iter_mut().enumerate().filter(|(_, kept)| !kept.is_empty()) {
                let [first, second] = self.factors(slot);
                for (k, d) in kept.iter_mut().zip(dofs.clone()) {
                    *k = first * of.first[d] + second * of.second[d];
                }
            }
        }
        kept
    }

    /// What a result follows of the rates, from what it follows of what is kept: the transpose of [`Self::kept`].
    pub(super) fn of_kept(&self, kept: &Kept, n_dofs: usize) -> AtStart {
        let mut made = AtStart { first: vec![0.0; n_dofs], second: vec![0.0; n_dofs] };
        for (kept, (_, dofs)) in kept.iter().zip(&self.fields) {
            for (slot, kept) in kept.iter().enumerate() {
                let [first, second] = self.factors(slot);
                for (k, d) in kept.iter().zip(dofs.clone()) {
                    made.first[d] += first * k;
                    made.second[d] += second * k;
                }
            }
        }
        made
    }

    /// What the first and the second rate are multiplied by in what is kept.
    fn factors(&self, slot: usize) -> [f64; 2] {
        let begins = self.begins_with_rates || self.driven.is_some();
        match slot {
            0 => [1.0, 0.0],
            1 => [0.0, 1.0],
            2 if begins => [1.0, -self.driven.unwrap_or(0.0)],
            3 if begins => [0.0, 1.0],
            _ => [0.0, 0.0],
        }
    }
}

/// Parts a vector by dof, in the axes of the scene, into what belongs to prescribed dofs, in local frames, and what belongs to
/// free ones, in the axes of the scene.
pub(super) fn parted(numbering: &Numbering, v: &[f64]) -> [Vec<f64>; 2] {
    let mut fixed = v.to_vec();
    numbering.frames.turn(&mut fixed);
    let mut free = fixed.clone();
    for (d, number) in numbering.free.iter().enumerate() {
        let other = if *number == FIXED { &mut free } else { &mut fixed };
        other[d] = 0.0;
    }
    numbering.frames.turn_back(&mut free);
    [fixed, free]
}
