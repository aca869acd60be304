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

use nalgebra::DMatrix;
use wfl_compiler::{
    Class, Projection, ProjectionKind, interpret_lanes,
    types::{FieldKind, FieldOp, Side},
};

use super::{Contact, ContactTerm, conditions::is_traction, friction_work::Point, slopes::is_displacement};
use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues},
    system::System,
};

/// Singular values below this part of the largest slope are zero.
const NO_SLOPE: f64 = 1e-9;

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
    let laws: Vec<&ContactTerm> = contact.terms().iter().filter(|t| terms.contains(&t.term) && !t.on_cells()).collect();
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
        let (mesh, domain) = (&system.mesh, &self.sampled.domain);
        let mut found = ContactPoints::default();
        for group in &domain.groups {
            for entity in 0..group.entities.len() {
                for q in 0..group.n_points() {
                    found.positions.push(mesh.point_at(group.here.cells[entity], &group.here.geometry, q));
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
        let law = &self.law.law;
        let traction: Vec<bool> = law.inputs.iter().map(|s| is_traction(&system.fields, s)).collect();
        let n_out = law.kernel.kernel().outputs.len();
        let mut scratch = Vec::new();
        for (at, point) in self.points_at(system, values).iter().enumerate() {
            let mut without = point.inputs.clone();
            without.iter_mut().zip(&traction).filter(|(_, t)| **t).for_each(|(x, _)| *x = 0.0);
            let mut gap = vec![[0.0; 1]; n_out];
            interpret_lanes(&law.kernel, self.law.uniforms(), without.as_chunks::<1>().0, &mut scratch, &mut gap);
            let slopes = self.slopes.at_point(&point.inputs);
            for (position, p) in self.projections.iter().enumerate().filter(|(_, p)| p.acts) {
                let x0: Vec<f64> = gap[p.output..][..p.n].iter().map(|x| x[0]).collect();
                let moved = self.motion(system, position, &x0, &slopes);
                place(p, point, moved, at, found);
            }
        }
    }

    /// The smallest displacement of the near side that gives a part `x0` of the argument of a projection; of the far
    /// side where the argument knows that alone.
    fn motion(&self, system: &System, projection: usize, x0: &[f64], slopes: &[f64]) -> Option<[f64; 3]> {
        let of_side = |side: Side| {
            let own = self.slopes.of_projection(projection).filter(|(_, s)| s.slot.side == side);
            own.filter(|(_, s)| is_displacement(&system.fields, &s.slot)).collect::<Vec<_>>()
        };
        let (here, there) = (of_side(Side::Here), of_side(Side::There));
        let (own, sign) = if here.is_empty() { (there, -1.0) } else { (here, 1.0) };
        let field = own.first()?.1.slot.field;
        let mut matrix = DMatrix::zeros(x0.len(), 3);
        for (at, slope) in own.iter().filter(|(_, s)| s.slot.field == field) {
            matrix[(slope.entry, usize::from(slope.slot.entry))] = slopes[*at];
        }
        let scale = matrix.amax();
        if scale == 0.0 || !scale.is_finite() {
            return None;
        }
        let inverse = matrix.pseudo_inverse(NO_SLOPE * scale).ok()?;
        let moved = inverse * DMatrix::from_column_slice(x0.len(), 1, x0);
        Some([sign * moved[0], sign * moved[1], sign * moved[2]])
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
