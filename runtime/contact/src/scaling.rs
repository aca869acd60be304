//! The scaling of contact laws: how stiff the bodies are at the interface against the arguments of the projections.

use wfl_compiler::ir::LANES;

use super::{
    Complementarity, ContactTerm, Regularisation, flexibility,
    regularisation::AS_WRITTEN,
    slopes::{is_displacement, lengthening},
    term::{STIFF, Scaling},
};
use wfl_discrete::assemble::{Bound, FieldValues, Workspace};
use wfl_discrete::system::{FIXED, System};

/// The stiffness that branches are chosen with, in units of the nodal stiffness over the area of an entity.
/// Values from 0.1 to 3 serve alike (`docs/newton.md`).
const STIFFNESS_FACTOR: f64 = 1.0;
/// Where the nodal stiffness is more than this times what the bodies give way with to forces at random, some of their
/// directions are locked (nearly incompressible, a body far softer than the other): what they give way with counts then,
/// times a factor. In other bodies the ratio is from 2 to 40.
const LOCKED: f64 = 100.0;
const GIVING_WAY: f64 = 3.0;
/// Points at which the slopes of arguments are sampled: a median of so many is not moved by a few odd ones, and they cost
/// less than one assembly of the term.
const SLOPE_POINTS: usize = 64;
/// Contact without a multiplier binds the stresses of the bodies where the terms on faces are this many times as stiff as
/// the bodies there while arguments are softer than the bodies by this factor: consistent terms of Nitsche's method with a
/// parameter of the order of the stiffness have ratios of about one in both.
const STIFF_FACES: f64 = 10.0;
const SOFT_ARGUMENTS: f64 = 100.0;
/// Bounds of `c`.
const RATIO_RANGE: (f64, f64) = (1e-13, 1e13);

impl Scaling {
    /// The stiffness of the bodies over the largest slope of an argument in the displacement.
    pub(super) fn stiffness_ratio(&self) -> f64 {
        let slope = self.slopes.iter().fold(0.0f64, |m, s| m.max(*s));
        if slope > 0.0 { self.stiffness / slope } else { 0.0 }
    }

    /// `c` of projection `k` at the present choice, for its argument less what compliance takes.
    pub(super) fn ratio(&self, k: usize, law: &Complementarity) -> f64 {
        let ratio = match self.ratios[k] {
            c if c < 1.0 => (c * law.growth).min(1.0),
            c => (c / law.growth).max(1.0),
        };
        ratio / (1.0 - self.compliance(k, law.regularisation.layer))
    }

    /// The part of the argument of projection `k` that a compliant layer takes.
    pub(super) fn compliance(&self, k: usize, layer: f64) -> f64 {
        if self.slopes[k] > 0.0 { 1.0 / (1.0 + layer * self.ratios[k]) } else { 0.0 }
    }

    /// The part of the argument of projection `k` that a law which differs from what is written takes.
    pub(super) fn taken(&self, k: usize, regularisation: &Regularisation) -> f64 {
        let compliance = self.compliance(k, regularisation.layer);
        if regularisation.softness == AS_WRITTEN || self.slopes[k] == 0.0 {
            return compliance;
        }
        1.0 - (1.0 - compliance) * regularisation.softness
    }

    /// The part of the argument beyond its bound that overstress keeps in the value of projection `k`. What passes
    /// between the sides is what the value lacks of the argument, over its slope.
    pub(super) fn overstress(&self, k: usize, overstress: f64) -> f64 {
        let viscous = overstress * self.stiffness;
        if viscous > 0.0 && self.slopes[k] > 0.0 { viscous / (viscous + self.slopes[k]) } else { 0.0 }
    }

    /// Displacement by traction that `c` of projection `k` stands for; 1 where it does not depend on displacements.
    pub(super) fn flexibility(&self, k: usize) -> f64 {
        let stiffness = self.ratios[k] * self.slopes[k];
        if stiffness > 0.0 { 1.0 / stiffness } else { 1.0 }
    }
}

impl ContactTerm {
    /// Fits `c` of each projection to the stiffness of the bodies: that of the linear terms, or the `diagonal` of the
    /// cell terms, by dof.
    pub(super) fn fit(&mut self, system: &System, values: FieldValues<'_>, diagonal: &[f64]) {
        let (bulk, free, team) = (system.bulk(), &system.numbering.free, system.team());
        let dofs: Vec<u32> = self.form(system).dofs().into_iter().filter(|d| system.owns(*d as usize)).collect();
        let stiff: Vec<f64> = dofs.iter().map(|d| diagonal[*d as usize]).filter(|k| *k > 0.0).collect();
        let n_stiff = team.count(stiff.len());
        let area = self.entity_area(&system.mesh, values);
        if n_stiff == 0 || area <= 0.0 {
            return;
        }
        #[expect(clippy::cast_precision_loss, reason = "a mean")]
        let mean = team.total(stiff.iter().sum()) / n_stiff as f64;
        let places: Vec<u32> = dofs.iter().map(|d| free[*d as usize]).filter(|f| *f != FIXED).collect();
        let stiffness = match flexibility::stiffness(bulk, &places, system.owners().as_ref()) {
            Some(gives) if mean > LOCKED * gives => GIVING_WAY * gives,
            _ => STIFFNESS_FACTOR * mean,
        };
        let stiffness = stiffness / area;
        let slopes = self.largest_slopes(system, values);
        // without a multiplier the traction follows from displacements, and an argument is at least as stiff as it
        let largest = if self.has_multiplier { RATIO_RANGE.1 } else { 1.0 };
        let has_multiplier = self.has_multiplier;
        let scaling = &mut self.scaling;
        for (ratio, slope) in scaling.ratios.iter_mut().zip(&slopes) {
            if *slope > 0.0 && stiffness.is_finite() {
                *ratio = (stiffness / slope).clamp(RATIO_RANGE.0, largest);
            }
        }
        scaling.is_stiff = has_multiplier || scaling.ratios.iter().any(|c| *c < STIFF);
        scaling.slopes = slopes;
        scaling.stiffness = if stiffness.is_finite() { stiffness } else { 0.0 };
        let cells: f64 = dofs.iter().filter(|d| free[**d as usize] != FIXED).map(|d| diagonal[*d as usize]).sum();
        let linear: f64 = places.iter().map(|f| bulk.get(*f as usize, *f as usize)).sum();
        let (cells, linear) = (team.total(cells), team.total(linear));
        scaling.is_over_constrained =
            largest == 1.0 && linear > STIFF_FACES * cells && scaling.stiffness_ratio() > SOFT_ARGUMENTS;
    }

    /// By projection: the largest derivative of its argument with respect to a component of a displacement, median of
    /// some points of all ranks.
    pub(super) fn largest_slopes(&self, system: &System, values: FieldValues<'_>) -> Vec<f64> {
        let moving: Vec<(usize, usize)> = (self.slopes.list().iter().enumerate())
            .filter(|(_, s)| is_displacement(&system.fields, &s.slot))
            .map(|(at, s)| (at, s.projection))
            .collect();
        self.median_slopes(system, values, |slopes| {
            let mut largest = vec![0.0f64; self.projections.len()];
            for (at, projection) in &moving {
                largest[*projection] = largest[*projection].max(slopes[*at].abs());
            }
            largest
        })
    }

    /// By projection how much longer its argument becomes by a displacement of length one, median of some points of all
    /// ranks: what makes a length of it, whatever the axes are.
    pub(super) fn stiffnesses(&self, system: &System, values: FieldValues<'_>) -> Vec<f64> {
        let n = self.projections.len();
        self.median_slopes(system, values, |slopes| lengthening(self.slopes.list(), &system.fields, slopes, n))
    }

    /// By projection the median among some points of all ranks of what `sizes` makes of the derivatives there.
    fn median_slopes(&self, system: &System, values: FieldValues<'_>, sizes: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
        let mut found: Vec<Vec<f64>> = vec![Vec::new(); self.projections.len()];
        let sampled = self.sampled.at(&system.mesh, values.current);
        let bound = Bound { mesh: &system.mesh, domain: &sampled.domain, binding: &sampled.binding };
        let mut workspace = Workspace::default();
        let places = sampled.domain.places(&system.mesh);
        for (g, (group, places)) in sampled.domain.groups.iter().zip(&places).enumerate() {
            let n_points = group.n_points();
            // a point of the first entity of a batch, as one rank alone has them; any point that is an entity
            let each = if group.own.is_some() { 1 } else { LANES };
            let stride = (places.n.div_ceil(each) * n_points).div_ceil(SLOPE_POINTS).max(1);
            let first = |(k, place): (usize, &Option<usize>)| Some((k, place.filter(|p| p % each == 0)? / each));
            for (entity, batch) in places.of.iter().enumerate().filter_map(first) {
                let mut is_ready = false;
                for q in (0..n_points).filter(|q| (batch * n_points + q) % stride == 0) {
                    if !is_ready {
                        workspace.prepare(bound, g, entity / LANES, values);
                        is_ready = true;
                    }
                    let slopes = self.slopes.at_point(&self.point_inputs(&workspace, q, entity % LANES));
                    found.iter_mut().zip(sizes(&slopes)).for_each(|(list, x)| list.push(x));
                }
            }
        }
        let of_all = |own: Vec<f64>| system.team().all_numbers(&own);
        found.into_iter().map(of_all).map(median).collect()
    }

    /// What the law reads at a point of a prepared batch.
    pub(super) fn point_inputs(&self, workspace: &Workspace, q: usize, lane: usize) -> Vec<f64> {
        let n = self.law.law.inputs.len();
        (0..n).map(|s| workspace.inputs[(q * n + s) * LANES + lane]).collect()
    }
}

fn median(mut list: Vec<f64>) -> f64 {
    list.sort_by(f64::total_cmp);
    list.get(list.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bodies of stiffness 4 against an argument with the slope gamma.
    fn scaling(gamma: f64) -> Scaling {
        Scaling { ratios: vec![4.0 / gamma], slopes: vec![gamma], stiffness: 4.0, ..Scaling::default() }
    }

    fn grown(growth: f64) -> Complementarity {
        Complementarity { growth, ..Complementarity::default() }
    }

    #[test]
    fn a_ratio_grows_towards_the_argument_as_written_and_never_past_it() {
        for (gamma, at_first, later, at_last) in [(40.0, 0.1, 0.3, 1.0), (0.4, 10.0, 10.0 / 3.0, 1.0)] {
            let found = [1.0, 3.0, 1e3].map(|growth| scaling(gamma).ratio(0, &grown(growth)));
            assert!((found[0] - at_first).abs() < 1e-14 && (found[1] - later).abs() < 1e-14, "{gamma}: {found:?}");
            assert_eq!(found[2], at_last, "{gamma}");
        }
    }

    #[test]
    fn a_layer_takes_the_same_part_of_the_gap_whatever_gamma_is() {
        // springs in series: the layer has 0.3 of the stiffness of the bodies, so that c gamma is theirs for every gamma
        for gamma in [1e-3, 1.0, 1e6] {
            let compliance = scaling(gamma).compliance(0, 0.3);
            let traction_by_gap = (1.0 - compliance) / compliance * gamma;
            assert!((traction_by_gap / (0.3 * 4.0) - 1.0).abs() < 1e-12 / compliance.min(1.0 - compliance), "{gamma}");
        }
        assert_eq!(scaling(7.0).compliance(0, f64::INFINITY), 0.0, "as written");
    }

    #[test]
    fn a_soft_layer_makes_the_ratio_that_of_both() {
        let law = Complementarity {
            regularisation: Regularisation { layer: 0.5, ..Regularisation::default() },
            ..Complementarity::default()
        };
        let s = scaling(40.0);
        let compliance = s.compliance(0, 0.5);
        assert!(compliance > 0.9, "{compliance}");
        assert!((s.ratio(0, &law) * (1.0 - compliance) - 0.1).abs() < 1e-15);
    }

    #[test]
    fn softer_contact_has_a_part_of_its_argument_as_if_that_were_written() {
        let soft = |softness: f64, layer: f64| {
            let regularisation = Regularisation { softness, layer, ..Regularisation::default() };
            let law = Complementarity { regularisation, ..Complementarity::default() };
            let s = scaling(40.0);
            (s.taken(0, &regularisation), s.ratio(0, &law))
        };
        let written = soft(1.0, f64::INFINITY);
        assert_eq!(written.0, 0.0);
        assert_eq!(soft(0.25, f64::INFINITY), (0.75, written.1), "points are chosen as they are");
        let (layer, _) = soft(1.0, 0.5);
        assert!((1.0 - soft(0.25, 0.5).0 - 0.25 * (1.0 - layer)).abs() < 1e-15, "behind a layer");
        let of_none = Scaling { ratios: vec![1.0], slopes: vec![0.0], stiffness: 4.0, ..Scaling::default() };
        let softer = Regularisation { softness: 0.5, ..Regularisation::default() };
        assert_eq!(of_none.taken(0, &softer), 0.0, "an argument of no displacement stays");
    }

    #[test]
    fn overstress_keeps_half_of_what_is_beyond_a_bound_where_viscosity_is_as_stiff_as_the_argument() {
        assert_eq!(scaling(2.0).overstress(0, 0.5), 0.5);
        assert_eq!(scaling(2.0).overstress(0, 0.0), 0.0, "as written");
        assert!(scaling(1e-6).overstress(0, 0.5) > 0.999_999 - 1e-9);
    }

    #[test]
    fn an_argument_of_no_displacement_is_neither_softened_nor_held() {
        let s = Scaling { ratios: vec![1.0], slopes: vec![0.0], stiffness: 4.0, ..Scaling::default() };
        assert_eq!((s.compliance(0, 0.3), s.overstress(0, 0.5)), (0.0, 0.0));
        assert_eq!((s.flexibility(0), s.stiffness_ratio()), (1.0, 0.0));
    }

    #[test]
    fn the_flexibility_of_a_point_is_that_of_the_bodies_for_every_gamma() {
        for gamma in [1e-8, 3.0, 1e8] {
            assert!((scaling(gamma).flexibility(0) - 0.25).abs() < 1e-15, "{gamma}");
        }
    }

    #[test]
    fn a_median_is_that_of_a_sorted_list_and_zero_of_none() {
        assert_eq!(median(vec![9.0, 1.0, 4.0]), 4.0);
        assert_eq!(median(Vec::new()), 0.0);
    }
}
