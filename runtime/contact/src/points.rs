//! Contact at the integration points of a region: state, gap, slip and traction, found without knowing the method.
//!
//! The argument of a projection is a gap or a slip times a stiffness, and the traction of a method that has one. With
//! gradients and multipliers set to zero the first part x0 remains. Of all displacements of one side that give it, J d =
//! x0 with J the slope of the argument in them, the smallest one d = J+ x0 (Moore-Penrose) is the gap along the normal of
//! a half-line, or the slip of a ball: exact for any normal. The traction is what the terms of the region, loads aside,
//! put on the test function of the displacement of the near side.
//!
//! Promises: points in the order of groups, entities and points of the rule; numbers of the law as it is written. Does
//! not judge them.

use std::sync::Arc;

use wfl_compiler::{
    Class, Projection, ProjectionKind,
    types::{FieldKind, FieldOp, Side},
};

use super::{Contact, ContactTerm, at_points::Point};
use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues},
    system::System,
};

/// The state of a point of contact, with the numbers that result files have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum PointState {
    /// No force.
    Open = 0,
    /// In contact, and beyond the friction bound.
    Slip = 1,
    /// In contact, and held; without friction, in contact.
    Stick = 2,
}

/// Contact at the integration points of a region.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactPoints {
    /// Where (length), unused coordinates zero.
    pub positions: Vec<[f64; 3]>,
    /// Weight of the rule times measure: length in 2-D, area in 3-D.
    pub weights: Vec<f64>,
    /// Unit normals that point away from the near side.
    pub normals: Vec<[f64; 3]>,
    /// States.
    pub states: Vec<PointState>,
    /// Distance of the sides along the normal (length), negative where they overlap; not a number where no law has one.
    pub gaps: Vec<f64>,
    /// Tangential motion of the near side against the other one (length), as the law of friction takes it: total, or
    /// since the last step; zero where no law has one.
    pub slips: Vec<[f64; 3]>,
    /// Force on the near side by area of the undeformed face, `stress . normal`: pressure points against the normal.
    pub tractions: Vec<[f64; 3]>,
}

/// Contact at the points of the regions that some contact terms act on, `terms` their positions in the system; all of
/// them on one region. `None` if no projection on faces is among them.
#[must_use]
pub fn contact_points(system: &System, contact: &Contact, u: &[f64], terms: &[usize]) -> Option<ContactPoints> {
    let values = system.values_with(u, contact.active_set());
    let is_law = |t: &&ContactTerm| terms.contains(&t.term) && !t.on_cells() && t.pushes(system);
    let laws: Vec<&ContactTerm> = contact.terms().iter().filter(is_law).collect();
    let first = laws.first()?;
    let mut found = first.places(system, values.view());
    found.states = vec![PointState::Stick; found.positions.len()];
    for law in laws.iter().filter(|l| l.shares_points(first)) {
        law.add_points(system, values.view(), &mut found);
    }
    for term in terms.iter().map(|k| &system.terms[*k]) {
        if Arc::ptr_eq(&term.integrator.domain, &first.sampled.domain) && term.law.class > Class::Constant {
            add_traction(system, term, values.view(), &mut found.tractions);
        }
    }
    Some(found)
}

impl ContactTerm {
    fn shares_points(&self, other: &ContactTerm) -> bool {
        Arc::ptr_eq(&self.sampled.domain, &other.sampled.domain)
    }

    /// The points, without what the laws say of them.
    fn places(&self, system: &System, values: FieldValues<'_>) -> ContactPoints {
        let (mesh, domain) = (&system.mesh, self.sampled.at(&system.mesh, values.current).domain);
        let mut found = ContactPoints::default();
        for group in &domain.groups {
            for entity in 0..group.entities.len() {
                for q in 0..group.n_points() {
                    found.positions.push(group.position(mesh, entity, q));
                    found.normals.push(group.unit_normal(mesh, entity, q));
                }
            }
        }
        self.law.for_each_point(mesh, &self.sampled, values, |_, _, _, weight, _| found.weights.push(weight));
        let n = found.positions.len();
        (found.gaps, found.slips, found.tractions) = (vec![f64::NAN; n], vec![[0.0; 3]; n], vec![[0.0; 3]; n]);
        found
    }

    /// What the projections of this term say of the points.
    fn add_points(&self, system: &System, values: FieldValues<'_>, found: &mut ContactPoints) {
        for (at, point) in self.points_at(system, values).iter().enumerate() {
            let gap = self.outputs_of(&self.without_tractions(system, &point.inputs), self.law.uniforms());
            let slopes = self.slopes.at_point(&point.inputs);
            let counts = self.counting(system, &slopes, &found.normals[at]);
            for (position, p) in self.projections.iter().enumerate().filter(|(k, _)| counts[*k]) {
                // where images move the gap turns with the bodies: without gradients it is another one
                let own = (!self.moves()).then(|| self.motion(system, position, &gap[p.output..][..p.n], &slopes));
                let moved = own.flatten();
                place(p, point, moved, at, found);
            }
        }
    }

    /// Which projections say something of a point with these slopes and this normal: those that act, and of several half lines
    /// those that close as the sides come together, if there are some. What a bond holds an open gap with is no contact.
    fn counting(&self, system: &System, slopes: &[f64], normal: &[f64; 3]) -> Vec<bool> {
        let is_gap = |p: &Projection| p.acts && p.kind == ProjectionKind::HalfLine && p.n == 1;
        let mut counts: Vec<bool> = self.projections.iter().map(|p| p.acts).collect();
        if self.projections.iter().filter(|p| is_gap(p)).count() < 2 {
            return counts;
        }
        let along = |(k, p): (usize, &Projection)| {
            let moved = if is_gap(p) { self.motion(system, k, &[1.0], slopes) } else { None };
            moved.map_or(0.0, |moved| moved.iter().zip(normal).map(|(m, n)| m * n).sum::<f64>())
        };
        let along: Vec<f64> = self.projections.iter().enumerate().map(along).collect();
        if along.iter().any(|by| *by > 0.0) {
            counts.iter_mut().zip(&along).for_each(|(counts, by)| *counts &= *by >= 0.0);
        }
        counts
    }
}

/// Writes what one projection says of a point.
fn place(p: &Projection, point: &Point, moved: Option<[f64; 3]>, at: usize, found: &mut ContactPoints) {
    let x = &point.outputs[p.output..][..p.n];
    match p.kind {
        ProjectionKind::HalfLine if p.n == 1 => {
            if x[0] < 0.0 {
                found.states[at] = PointState::Open;
            }
            if let Some(moved) = moved {
                let along: f64 = moved.iter().zip(&found.normals[at]).map(|(m, n)| m * n).sum();
                found.gaps[at] = -along;
            }
        }
        ProjectionKind::HalfLine => {}
        ProjectionKind::Ball => {
            let (size, radius) = (x.iter().fold(0.0f64, |m, x| m.hypot(*x)), point.outputs[p.output + p.n]);
            if size > radius && found.states[at] != PointState::Open {
                found.states[at] = if radius > 0.0 { PointState::Slip } else { PointState::Open };
            }
            if let Some(moved) = moved {
                found.slips[at] = moved;
            }
        }
    }
}

/// Adds the force of a term on the near side: its fluxes are what the near side puts on the other one.
fn add_traction(system: &System, term: &AssembledTerm, values: FieldValues<'_>, tractions: &mut [[f64; 3]]) {
    let dim = system.mesh.dim();
    let tests: Vec<(usize, usize)> = (term.law.tests.iter().enumerate())
        .filter(|(_, t)| {
            let field = system.fields.get(t.field.index());
            let displacement = field.is_some_and(|f| f.kind == FieldKind::Unknown && f.n_components == dim);
            t.op == FieldOp::Value && t.side == Side::Here && displacement
        })
        .map(|(k, t)| (k, usize::from(t.entry)))
        .collect();
    let mut points = tractions.iter_mut();
    term.for_each_flux(&system.mesh, values, |flux, _| {
        if let Some(traction) = points.next() {
            tests.iter().for_each(|(k, component)| traction[*component] -= flux[*k]);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use wfl_compiler::{BranchLayout, BranchSizes};

    /// The state of a point whose laws give a pressure, and an argument of friction with a radius.
    fn state(pressure: f64, slip: [f64; 2], radius: f64) -> (PointState, f64, [f64; 3]) {
        let branch = |kind| BranchLayout::new(kind, 2, BranchSizes::default());
        let of = |kind, n, output| Projection { kind, n, branch: branch(kind), output, acts: true };
        let point = Point { inputs: Vec::new(), outputs: vec![pressure, 0.0, slip[0], slip[1], radius] };
        let mut found = ContactPoints {
            states: vec![PointState::Stick],
            gaps: vec![f64::NAN],
            slips: vec![[0.0; 3]],
            normals: vec![[0.0, -1.0, 0.0]],
            ..ContactPoints::default()
        };
        place(&of(ProjectionKind::HalfLine, 1, 0), &point, Some([0.0, 0.25, 0.0]), 0, &mut found);
        place(&of(ProjectionKind::Ball, 2, 2), &point, Some([0.5, 0.0, 0.0]), 0, &mut found);
        (found.states[0], found.gaps[0], found.slips[0])
    }

    #[test]
    fn a_point_sticks_up_to_its_bound_and_slips_beyond_it() {
        assert_eq!(state(1.0, [0.3, 0.4], 0.5).0, PointState::Stick, "a tie sticks");
        assert_eq!(state(1.0, [0.3, 0.5], 0.5).0, PointState::Slip);
    }

    #[test]
    fn a_point_that_pulls_is_open_whatever_its_friction_says() {
        assert_eq!(state(-1.0, [9.0, 0.0], 0.5).0, PointState::Open);
        assert_eq!(state(0.0, [9.0, 0.0], 0.0).0, PointState::Open, "without a bound nothing slips");
        assert_eq!(state(0.0, [0.0, 0.0], 0.0).0, PointState::Stick, "a tie is contact");
    }

    #[test]
    fn a_gap_is_the_motion_against_the_normal_and_a_slip_is_that_of_the_friction() {
        let (_, gap, slip) = state(1.0, [0.0, 0.0], 1.0);
        assert_eq!((gap, slip), (0.25, [0.5, 0.0, 0.0]));
    }
}
