//! Why contact does not hold a loose body: it is zero, it pulls, it is open, or it slides.

use std::collections::BTreeSet;

use wfl_compiler::{Class, types::FieldKind};

use super::{listed, verb};
use crate::Examined;
use crate::LooseMotions;
use wfl_contact::ContactTerm;
use wfl_discrete::assemble::AssembledTerm;
use wfl_discrete::assemble::Over;
use wfl_discrete::system::{ActiveSet, Branches, Form, Tangent};
use wfl_newton::Singular;

/// A force below this part of the largest is none: sums over nodes, known to some hundred roundoffs.
const NONE: f64 = 1e-9;

/// Displacement of a body that is moved, in parts of the extent of the mesh: small beside displacements at which laws
/// turn, and ten digits above roundoff.
const MOVED: f64 = 1e-6;

/// A force that drives a motion by more than this part of the largest one that meets a motion is no rounding: such motions
/// are found to eight digits, and their squares count.
const DRIVES: f64 = 1e-6;

/// Work of differences of forces that is below this part of what cancels in them: some thousand roundoffs.
const CANCELS: f64 = 1e-12;

/// Contact this many times as stiff as the bodies leaves fewer than four digits of their stiffness: sixteen digits less
/// twelve.
const FAR_STIFFER: f64 = 1e12;

/// What a contact term does for some fields at a state.
struct Touching {
    name: String,
    /// Points open, slipping, sticking (or closed).
    counts: [usize; 3],
    has_friction: bool,
    /// It is between two of the fields, and goes with them where they move together.
    inside: bool,
}

impl Examined<'_> {
    /// Bodies that move as a whole, with what contact has to do with it.
    pub(super) fn loose_bodies(&self, motions: &[LooseMotions], u: &[f64]) -> Singular {
        let what: Vec<String> = motions.iter().map(ToString::to_string).collect();
        let fields = listed(motions);
        let mut found = Singular {
            what: what.join("; "),
            notes: Vec::new(),
            help: "prescribe a displacement of it, or press it against a supported body".to_owned(),
            name: fields.first().cloned().unwrap_or_default(),
        };
        let own = self.fields_of(motions);
        let mut touching = self.touching(&own, u);
        if touching.iter().any(|t| !t.inside) {
            touching.retain(|t| !t.inside);
        }
        if touching.is_empty() {
            self.told_of_symmetry(&mut found, &own);
            let zero = self.terms_without_force();
            if !zero.is_empty() {
                let zero = verb(&zero, "gives no force", "give no force");
                found.notes.push(format!("{zero} for any motion: a coefficient is zero"));
                found.help = "give the coefficient of that term a value, or fix the body".to_owned();
            }
            return found;
        }
        let tied_set = self.contact.tied(self.system, u);
        let mut tied = self.system.new_tangent();
        let is_tied = self.system.tangent(u, Branches::Frozen(&tied_set), &mut tied).is_ok();
        if let Some(name) = self.pulling(motions, &tied_set, u) {
            found.notes.push(format!("closed contact of `{name}` attracts the sides instead of repelling them"));
            found.help = format!("a wrong sign in `{name}`: its force must resist what closes the gap");
            return found;
        }
        let left = is_tied.then(|| self.loose_when_tied(&fields, &tied)).flatten();
        if let Some(stiff) = is_tied.then(|| self.far_stiffer(&tied, &touching)).flatten() {
            return stiff;
        }
        if let Some(left) = left {
            if self.told_of_symmetry(&mut found, &own) {
                return found;
            }
            if touching.iter().any(|t| t.has_friction) {
                found.notes.push(format!("even if all points of the contact stick: {left}"));
            } else {
                let names: Vec<String> = touching.iter().map(|t| format!("`{}`", t.name)).collect();
                let what = "supports it in the normal direction only: contact without friction";
                found.notes.push(format!("{} {what}", names.join(", ")));
                found.help = "prescribe its tangential displacement, or add friction to the contact".to_owned();
            }
            return found;
        }
        self.explain_state(&mut found, &touching, self.pushed(motions, &tied_set, u));
        found
    }

    /// Contact beside which the bodies are rounding, where no motion of a whole body is loose.
    pub(super) fn far_stiffer_contact(&self, u: &[f64]) -> Option<Singular> {
        let all: Vec<usize> = (0..self.system.fields.len()).filter(|k| self.is_displacement(*k)).collect();
        let touching = self.touching(&all, u);
        let mut tied = self.system.new_tangent();
        let set = self.contact.tied(self.system, u);
        if touching.is_empty() || self.system.tangent(u, Branches::Frozen(&set), &mut tied).is_err() {
            return None;
        }
        self.far_stiffer(&tied, &touching)
    }

    fn far_stiffer(&self, tied: &Tangent, touching: &[Touching]) -> Option<Singular> {
        let mut largest = [tied.changing.max_abs(), self.system.bulk().max_abs()];
        self.system.team().max(&mut largest);
        let ratio = largest[0] / largest[1];
        if !(ratio.is_finite() && ratio > FAR_STIFFER) {
            return None;
        }
        let names: Vec<String> = touching.iter().map(|t| format!("`{}`", t.name)).collect();
        let names = names.join(", ");
        let bodies = (0..self.system.fields.len()).filter(|k| self.is_displacement(*k));
        let name = bodies.map(|k| self.system.fields[k].name.clone()).last().unwrap_or_default();
        Some(Singular {
            what: format!(
                "the tangent of {names} is {ratio:.0e} times that of the bodies: rounding removes the stiffness that \
                 supports `{name}`"
            ),
            notes: vec!["the tangent is numerically singular".to_owned()],
            help: format!("a smaller parameter in {names}: about the stiffness of the bodies over the size of a cell"),
            name,
        })
    }

    /// Says which displacements are prescribed along a face where a symmetry was meant; false where none is.
    fn told_of_symmetry(&self, found: &mut Singular, own: &[usize]) -> bool {
        let along = self.held_along(own);
        if along.is_empty() {
            return false;
        }
        found.notes.push(format!("prescribed along a face: {}", along.join("; ")));
        found.help = "on a plane of symmetry the displacement normal to it is prescribed, and that along it is free: \
                      exchange the components; or prescribe a displacement that this motion changes"
            .to_owned();
        true
    }

    /// Terms on faces that are zero whatever moves; loads may be.
    fn terms_without_force(&self) -> Vec<String> {
        let empty = |t: &&AssembledTerm| {
            let is_load = t.law.name.starts_with("load") && t.law.name.contains(" of ");
            t.integrator.domain.over == Over::Facets && !is_load && t.law.tests.is_empty()
        };
        self.system.terms.iter().filter(empty).map(|t| format!("`{}`", t.law.name)).collect()
    }

    fn acting_on<'a>(&'a self, own: &'a [usize]) -> impl Iterator<Item = &'a ContactTerm> + 'a {
        let tests = |p: &&ContactTerm| {
            let law = &self.system.terms[p.term].law;
            !self.system.terms[p.term].on_cells() && law.tests.iter().any(|s| own.contains(&s.field.index()))
        };
        self.contact.terms().iter().filter(tests)
    }

    /// The contact terms on some fields with the state of their points at `u`.
    fn touching(&self, own: &[usize], u: &[f64]) -> Vec<Touching> {
        let Ok(residual) = self.system.residual(u, &Form::AS_WRITTEN) else { return Vec::new() };
        let of = |p: &ContactTerm| {
            let term = &self.system.terms[p.term];
            let counts = term.contact_counts(&residual.branches[p.term])?;
            let tested: BTreeSet<usize> = term.law.tests.iter().map(|s| s.field.index()).collect();
            let inside = tested.len() > 1 && tested.iter().all(|field| own.contains(field));
            Some(Touching { name: term.law.name.clone(), counts, has_friction: p.has_friction(), inside })
        };
        self.acting_on(own).filter_map(of).collect()
    }

    /// The term whose closed contact drives bodies as they are moved as a whole against the others. Prescribed values move
    /// with them: a motion that stops at them strains the body, and its stress is part of a Nitsche term.
    fn pulling(&self, motions: &[LooseMotions], tied: &ActiveSet, u: &[f64]) -> Option<String> {
        let (dim, extent) = (self.system.mesh.dim(), self.extent());
        let forces = |u: &[f64]| {
            let here = self.system.residual(u, &Form::AS_WRITTEN).ok()?;
            let mut forces = self.system.frozen_residual(&here, u, tied).ok()?;
            self.system.numbering.frames.turn_back(&mut forces);
            Some(forces)
        };
        let start = forces(u)?;
        let mut energies = Vec::new();
        for group in motions {
            for mut motion in self.motions(&group.bodies).into_iter().take(dim) {
                self.system.numbering.frames.turn_back(&mut motion);
                let moved: Vec<f64> = u.iter().zip(&motion).map(|(u, m)| u + MOVED * extent * m).collect();
                let end = forces(&moved)?;
                let (mut work, mut size) = (0.0, 0.0);
                for (m, (e, s)) in motion.iter().zip(end.iter().zip(&start)) {
                    work += m * (e - s);
                    size += m.abs() * (e.abs() + s.abs());
                }
                let (work, size) = (self.system.team().total(work), self.system.team().total(size));
                // forces that do not change leave what their differences round to
                energies.push(if work.abs() > CANCELS * size { work } else { 0.0 });
            }
        }
        let largest = energies.iter().fold(0.0f64, |m, e| m.max(e.abs()));
        let drives = energies.iter().any(|e| *e < -DRIVES * largest);
        let fields = self.fields_of(motions);
        drives.then(|| self.acting_on(&fields).next().map(|p| self.system.terms[p.term].law.name.clone())).flatten()
    }

    /// The fields that move.
    fn fields_of(&self, motions: &[LooseMotions]) -> Vec<usize> {
        let fields = listed(motions);
        (0..self.system.fields.len()).filter(|k| fields.contains(&self.system.fields[*k].name)).collect()
    }

    /// The largest edge of the box around the mesh.
    fn extent(&self) -> f64 {
        let (low, high) = self.system.mesh.bounds();
        (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]))
    }

    /// The motions in which the same bodies are loose with contact closed and sticking everywhere.
    fn loose_when_tied(&self, fields: &[String], tied: &Tangent) -> Option<String> {
        let tied = Examined { tangent: tied, ..*self }.loose_motions();
        tied.iter().find(|m| m.fields.iter().any(|f| fields.contains(f))).map(ToString::to_string)
    }

    /// Open, sliding, pulled away or lifted off.
    fn explain_state(&self, found: &mut Singular, touching: &[Touching], pushed: Pushed) {
        let total = |k: usize| touching.iter().map(|t| t.counts[k]).sum::<usize>();
        let names: Vec<String> = touching.iter().map(|t| format!("`{}`", t.name)).collect();
        let names = names.join(", ");
        let (open, slip, stick) = (total(0), total(1), total(2));
        let friction = touching.iter().any(|t| t.has_friction);
        let is_open = slip + stick == 0;
        if pushed.by_loads == Some(false) {
            found.notes.push(format!("the load pulls it away from {names}: the contact opens"));
            found.help =
                "support the body by a `fix` or a spring, or reverse the load: it must press the sides together"
                    .to_owned();
        } else if pushed.by_all == Some(false) {
            found.notes.push(format!(
                "the contact has opened: the force of {names} at open points (the pressure of a fluid, say) lifts the body off, \
                 against the load that presses it"
            ));
            found.help =
                "a smaller pressure there, a larger load, or a `fix` or a spring that holds the body when it is \
                          lifted; up to here the steps are right"
                    .to_owned();
        } else if friction && slip > 0 && stick == 0 {
            found.notes.push(format!(
                "it is pressed, but all {slip} closed points of {names} slip: the friction bound is reached everywhere ({open} points are open)"
            ));
            found.help =
                "a larger friction coefficient, a smaller tangential load, or a `fix` in the tangential direction"
                    .to_owned();
        } else if pushed.by_loads == Some(true) && friction && !is_open {
            found.notes.push(format!(
                "the load presses it on {names}; in the last iterate {open} points are open, {slip} slip and {stick} \
                 stick: friction does not balance the tangential load"
            ));
            found.help =
                "a larger friction coefficient, a smaller tangential load, a `fix` in the tangential direction, or smaller load steps"
                    .to_owned();
        } else {
            found.notes.push(format!("{names}: {open} points are open, {slip} slip, {stick} stick or are closed"));
            found.help =
                "prescribe a displacement of it, or start from a state in contact: `start`, or a first load step that closes the gap"
                    .to_owned();
        }
    }

    /// What pushes the bodies where their contact is open.
    fn pushed(&self, motions: &[LooseMotions], tied: &ActiveSet, u: &[f64]) -> Pushed {
        let here = self.system.residual(u, &Form::AS_WRITTEN).ok();
        let all = here.and_then(|here| self.system.frozen_residual(&here, u, &self.contact.opened()).ok());
        let all = all.map(|mut forces| {
            self.system.numbering.frames.turn_back(&mut forces);
            forces
        });
        Pushed {
            by_loads: self.presses(motions, tied, u, self.system.constant_residual()),
            by_all: all.and_then(|forces| self.presses(motions, tied, u, &forces)),
        }
    }

    /// Whether the resultant of some forces (a residual by dof) on bodies that move closes the gaps of their contact;
    /// `None` without a resultant.
    fn presses(&self, motions: &[LooseMotions], tied: &ActiveSet, u: &[f64], residual: &[f64]) -> Option<bool> {
        let (own, dim) = (self.fields_of(motions), self.system.mesh.dim());
        let mut force = vec![0.0; dim];
        let mut size = 0.0f64;
        for dofs in motions.iter().flat_map(|group| self.dofs_of(&group.bodies)) {
            for (d, r) in residual[dofs].iter().enumerate() {
                force[d] -= r;
                size += r.abs();
            }
        }
        self.system.team().sum(&mut force);
        let size = self.system.team().total(size);
        let length = force.iter().fold(0.0f64, |m, f| m.hypot(*f));
        if length <= NONE * size || length == 0.0 {
            return None;
        }
        let extent = self.extent();
        let mut moved = u.to_vec();
        for dofs in motions.iter().flat_map(|group| self.dofs_of(&group.bodies)) {
            moved[dofs].iter_mut().zip(&force).for_each(|(u, f)| *u += MOVED * extent * f / length);
        }
        let [from, to] = [u, &moved].map(|end| self.contact.states_on(self.system, end, tied));
        let mut closing = 0.0;
        for (k, term) in self.contact.terms().iter().enumerate() {
            let law = &self.system.terms[term.term].law;
            let acts = law.tests.iter().any(|s| own.contains(&s.field.index()));
            if acts && law.class > Class::Constant {
                closing += term.closing(&from[k], &to[k]);
            }
        }
        let closing = self.system.team().total(closing);
        let unknown = own.iter().all(|k| self.system.fields[*k].kind == FieldKind::Unknown);
        (closing != 0.0 && unknown).then_some(closing > 0.0)
    }
}

/// Whether what pushes a body closes its contact; `None` where nothing does, or where it is not known.
#[derive(Clone, Copy)]
struct Pushed {
    /// The loads.
    by_loads: Option<bool>,
    /// All forces that act on it where its contact is open.
    by_all: Option<bool>,
}
