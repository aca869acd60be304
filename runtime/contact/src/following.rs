//! Contact whose images follow the bodies: what of it can be judged, and what cannot.
//!
//! Normal and distance of a point are those of its ray, and not of the mesh: overlap and the sign of the force along the
//! normal are known at any state. An offset of the law (an interference, a gap that meshing has left) is what its argument is
//! where nothing has moved and the point lies on its image. Not known is what the stresses in an argument are: its gradients
//! are those of the normal, too. So the cone of the stresses, their consistency, and slips that are no difference of
//! displacements (drift, energy of friction, creep, the sign of a distance) are not judged.
//!
//! Promises: points in the order of the law. Does not judge.

use std::collections::BTreeMap;

use wfl_compiler::{
    ProjectionKind,
    types::{FieldKind, FieldOp, InputSlot, Side},
};
use wfl_discrete::{
    assemble::{Domain, FieldValues, Group},
    domain::ImageMotion,
    system::System,
};

use super::{
    ContactTerm,
    conditions::{ContactGaps, PressedFaces},
    slopes::is_displacement,
};

impl ContactTerm {
    /// What inputs of a law are at a point that is an entity of its own where nothing has moved and the image is the point itself,
    /// on a plane face that faces it; `values` are those of any state.
    pub(super) fn at_touch(system: &System, point: (&Group, usize), slots: &[InputSlot], values: &[f64]) -> Vec<f64> {
        let (mesh, dim, (group, k)) = (&system.mesh, system.mesh.dim(), point);
        let (x, normal) = (group.position(mesh, k, 0), group.unit_normal(mesh, k, 0));
        let moves = |field: usize| system.fields.get(field).is_some_and(|f| f.kind != FieldKind::Data);
        let of = |(slot, value): (&InputSlot, &f64)| match slot {
            InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) if moves(b.field.index()) => 0.0,
            InputSlot::ImageX(k) => x[usize::from(*k)],
            InputSlot::ImageShift(e) => {
                let j = (0..dim).rfind(|j| j * (j + 1) / 2 <= usize::from(*e)).unwrap_or(0);
                let i = usize::from(*e) - j * (j + 1) / 2;
                f64::from(u8::from(i == j)) - normal[i] * normal[j]
            }
            InputSlot::ImageSlope(_) => 0.0,
            InputSlot::Normal(Side::There, k) => -normal[usize::from(*k)],
            _ => *value,
        };
        slots.iter().zip(values).map(of).collect()
    }

    /// Overlap, the sign of the force, and faces that press, at a state with the branches of the law as written.
    pub(super) fn gaps_of_images(&self, system: &System, values: FieldValues<'_>) -> ContactGaps {
        let domain = &self.sampled.at(&system.mesh, values.current).domain;
        let points = self.points_at(system, values);
        let fluxes = self.forces_along(system, values, domain);
        let mut found = ContactGaps::default();
        let mut faces: BTreeMap<usize, [usize; 2]> = BTreeMap::new();
        let (mut pressed, mut pulled) = (0.0, 0.0);
        for ((place, point), (force, weight)) in domain.entities().zip(&points).zip(fluxes) {
            let (group, k) = place;
            let Some(motion) = group.motion(k).filter(|motion| motion.stand_in.is_none()) else { continue };
            let presses = self.presses(point);
            faces.entry(group.entities[k]).or_default()[usize::from(presses)] += 1;
            if !presses {
                continue;
            }
            found.penetration = found.penetration.max(self.overlap(system, place, motion, &point.inputs));
            pressed += weight.abs();
            pulled += if force * weight < 0.0 { weight.abs() } else { 0.0 };
        }
        let count = |is: fn(&[usize; 2]) -> bool| faces.values().filter(|counts| is(counts)).count();
        found.pressed = PressedFaces { some: count(|c| c[1] > 0), whole: count(|c| c[0] == 0), of: faces.len() };
        found.pulled = (pressed > 0.0).then(|| pulled / pressed);
        found
    }

    /// How far the sides overlap beyond what the law of pressure takes for touching; zero for a law of none.
    fn overlap(&self, system: &System, place: (&Group, usize), motion: &ImageMotion, inputs: &[f64]) -> f64 {
        let half = self.projections.iter().position(|p| p.acts && p.kind == ProjectionKind::HalfLine && p.n == 1);
        let Some(half) = half else { return 0.0 };
        let touching = Self::at_touch(system, place, &self.law.law.inputs, inputs);
        let offset = self.outputs_of(&touching, self.law.uniforms())[self.projections[half].output];
        let slopes = self.slopes.at_point(&touching);
        let own = self.slopes.of_projection(half).filter(|(_, s)| s.slot.side == Side::Here);
        let slope = own
            .filter(|(_, s)| is_displacement(&system.fields, &s.slot))
            .fold(0.0f64, |norm, (at, _)| norm.hypot(slopes[at]));
        let overlap = offset / slope - motion.gap;
        if overlap.is_finite() { overlap.max(0.0) } else { 0.0 }
    }

    /// By point the force of the term on the near side against its normal, and the weight.
    fn forces_along(&self, system: &System, values: FieldValues<'_>, domain: &Domain) -> Vec<(f64, f64)> {
        let (term, dim) = (&system.terms[self.term], system.mesh.dim());
        let is_vector = |field: usize| system.fields.get(field).is_some_and(|f| f.n_components == dim);
        let tests: Vec<(usize, usize)> = (term.law.tests.iter().enumerate())
            .filter(|(_, t)| t.op == FieldOp::Value && t.side == Side::Here && is_vector(t.field.index()))
            .map(|(k, t)| (k, usize::from(t.entry)))
            .collect();
        let mut entities = domain.entities();
        let mut forces = Vec::new();
        term.for_each_flux(&system.mesh, values, |flux, weight| {
            let motion = entities.next().and_then(|(group, k)| group.motion(k));
            let normal = motion.map_or([0.0; 3], |motion| motion.normal);
            forces.push((tests.iter().map(|(k, component)| flux[*k] * normal[*component]).sum(), weight));
        });
        forces
    }
}
