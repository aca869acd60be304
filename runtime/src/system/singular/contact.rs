//! Why contact does not hold a loose body: it is zero, it pulls, it is open, or it slides.

use wfl_compiler::{Class, types::FieldKind};

use super::{Singular, listed, verb};
use crate::{
    assemble::AssembledTerm,
    newton::TermPieces,
    system::{LooseMotions, System},
};

/// A force below this part of the largest is none.
const NONE: f64 = 1e-9;

/// Contact this many times as stiff as the bodies leaves fewer than four digits of their stiffness.
const FAR_STIFFER: f64 = 1e12;

/// What a contact term does for some fields at a state.
struct Touching {
    name: String,
    /// Points open, slipping, sticking (or closed).
    counts: [usize; 3],
    has_friction: bool,
}

impl System {
    /// Bodies that move as a whole, with what contact has to do with it.
    pub(super) fn loose_bodies(&mut self, motions: &[LooseMotions], u: &[f64]) -> Singular {
        let what: Vec<String> = motions.iter().map(ToString::to_string).collect();
        let fields = listed(motions);
        let mut found = Singular {
            what: what.join("; "),
            notes: Vec::new(),
            help: "fix it, or press it against something that is held".to_owned(),
            name: fields.first().cloned().unwrap_or_default(),
        };
        let own: Vec<usize> = (0..self.fields.len()).filter(|k| fields.contains(&self.fields[*k].name)).collect();
        let touching = self.touching(&own, u);
        if touching.is_empty() {
            let zero = self.terms_without_force();
            if !zero.is_empty() {
                let zero = verb(&zero, "gives no force", "give no force");
                found.notes.push(format!("{zero} whatever moves: a coefficient is zero"));
                found.help = "give the coefficient of that term a value, or fix the body".to_owned();
            }
            return found;
        }
        if let Some(name) = self.pulling(&own, u) {
            found
                .notes
                .push(format!("closed contact of `{name}` draws the sides together in place of holding them apart"));
            found.help = format!("a wrong sign in `{name}`: its force must resist what closes the gap");
            return found;
        }
        let tied = self.loose_when_tied(&fields, u);
        let ratio = self.changing().max_abs() / self.bulk().max_abs();
        if ratio.is_finite() && ratio > FAR_STIFFER {
            let names: Vec<String> = touching.iter().map(|t| format!("`{}`", t.name)).collect();
            let names = names.join(", ");
            found.what = format!(
                "the tangent of {names} is {ratio:.0e} times that of the bodies: rounding leaves next to nothing that holds \
                 `{}`",
                found.name
            );
            found.notes.push("the tangent is singular but for rounding".to_owned());
            found.help =
                format!("a smaller parameter in {names}: about the stiffness of the bodies over the size of a cell");
            return found;
        }
        if let Some(left) = tied {
            if touching.iter().any(|t| t.has_friction) {
                found.notes.push(format!("not even contact that is closed and sticks at all points holds it: {left}"));
            } else {
                let names: Vec<String> = touching.iter().map(|t| format!("`{}`", t.name)).collect();
                found
                    .notes
                    .push(format!("{} holds it along the normal only: contact without friction", names.join(", ")));
                found.help = "fix it along the surface, or give the contact friction".to_owned();
            }
            return found;
        }
        self.explain_state(&mut found, &touching, &own, u);
        found
    }

    /// Terms on faces that are zero whatever moves; loads may be.
    fn terms_without_force(&self) -> Vec<String> {
        let empty = |t: &&AssembledTerm| {
            let is_load = t.law.name.starts_with("load") && t.law.name.contains(" of ");
            let is_global = t.integrator.domain.groups.iter().any(|g| g.is_global);
            !t.on_cells() && !is_global && !is_load && t.law.tests.is_empty()
        };
        self.terms.iter().filter(empty).map(|t| format!("`{}`", t.law.name)).collect()
    }

    fn acting_on<'a>(&'a self, own: &'a [usize]) -> impl Iterator<Item = &'a TermPieces> + 'a {
        let tests = |p: &&TermPieces| {
            let law = &self.terms[p.term].law;
            !self.terms[p.term].on_cells() && law.tests.iter().any(|s| own.contains(&s.field.index()))
        };
        self.pieces.iter().filter(tests)
    }

    /// The contact terms on some fields with the state of their points at `u`.
    fn touching(&mut self, own: &[usize], u: &[f64]) -> Vec<Touching> {
        let mut residual = Vec::new();
        if self.residual(u, &mut residual).is_err() {
            return Vec::new();
        }
        let of = |p: &TermPieces| {
            let term = &self.terms[p.term];
            let counts = term.contact_counts()?;
            Some(Touching { name: term.law.name.clone(), counts, has_friction: p.has_friction() })
        };
        self.acting_on(own).filter_map(of).collect()
    }

    /// The translations of some fields together, by free number.
    fn translations(&self, own: &[usize]) -> Vec<Vec<f64>> {
        let mut free = Vec::new();
        (0..self.mesh.dim())
            .map(|d| {
                self.numbering.gather(&self.rigid(own, d), &mut free);
                free.clone()
            })
            .collect()
    }

    /// The term whose closed contact drives the bodies as they are moved as a whole.
    fn pulling(&mut self, own: &[usize], u: &[f64]) -> Option<String> {
        self.hold_tied(u).ok()?;
        self.tangent(u, true).ok()?;
        let translations = self.translations(own);
        let mut met = vec![0.0; self.numbering.n_free()];
        let mut energies = Vec::new();
        for motion in &translations {
            self.changing().multiply(motion, &mut met, 1);
            energies.push(motion.iter().zip(&met).map(|(a, b)| a * b).sum::<f64>());
        }
        let largest = energies.iter().fold(0.0f64, |m, e| m.max(e.abs()));
        let drives = energies.iter().any(|e| *e < -NONE * largest);
        drives.then(|| self.acting_on(own).next().map(|p| self.terms[p.term].law.name.clone())).flatten()
    }

    /// The motions in which the same bodies are loose with contact closed and sticking everywhere.
    fn loose_when_tied(&mut self, fields: &[String], u: &[f64]) -> Option<String> {
        self.hold_tied(u).and_then(|()| self.tangent(u, true)).ok()?;
        let tied = self.loose_motions();
        tied.iter().find(|m| m.fields.iter().any(|f| fields.contains(f))).map(ToString::to_string)
    }

    /// Open, sliding or pulled away.
    fn explain_state(&mut self, found: &mut Singular, touching: &[Touching], own: &[usize], u: &[f64]) {
        let total = |k: usize| touching.iter().map(|t| t.counts[k]).sum::<usize>();
        let names: Vec<String> = touching.iter().map(|t| format!("`{}`", t.name)).collect();
        let names = names.join(", ");
        let presses = self.load_presses(own, u);
        let (open, slip, stick) = (total(0), total(1), total(2));
        let friction = touching.iter().any(|t| t.has_friction);
        if presses == Some(false) {
            found.notes.push(format!("the load pulls it away from {names}: contact opens and holds nothing"));
            found.help =
                "hold the body by a `fix` or a spring, or turn the load: it must press the sides together".to_owned();
        } else if friction && slip > 0 && stick == 0 {
            found.notes.push(format!(
                "it is pressed, but all {slip} points in contact of {names} slide: friction is exhausted ({open} points are open)"
            ));
            found.help =
                "a larger friction coefficient, a smaller load along the surface, or a `fix` along it".to_owned();
        } else if presses == Some(true) && friction {
            found.notes.push(format!(
                "the load presses it on {names}; in the last iterate {open} points are open, {slip} slide and {stick} stick: \
                 friction does not hold the load along the surface"
            ));
            found.help =
                "a larger friction coefficient, a smaller load along the surface, a `fix` along it, or smaller steps"
                    .to_owned();
        } else {
            found.notes.push(format!("{names}: {open} points are open, {slip} slide, {stick} stick or are closed"));
            found.help =
                "fix it, or start from a state in which it is pressed: `start`, or a first step that moves it there"
                    .to_owned();
        }
    }

    /// Whether the resultant of the loads on some fields closes the gaps of their contact; `None` without a resultant.
    fn load_presses(&mut self, own: &[usize], u: &[f64]) -> Option<bool> {
        let dim = self.mesh.dim();
        let mut force = vec![0.0; dim];
        let mut size = 0.0f64;
        for range in own.iter().filter_map(|k| self.range(*k)) {
            for (n, d) in range.enumerate() {
                force[n % dim] -= self.constant[d];
                size += self.constant[d].abs();
            }
        }
        let length = force.iter().fold(0.0f64, |m, f| m.hypot(*f));
        if length <= NONE * size || length == 0.0 {
            return None;
        }
        let (low, high) = self.mesh.bounds();
        let extent = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        let mut moved = u.to_vec();
        for range in own.iter().filter_map(|k| self.range(*k)) {
            for (n, d) in range.enumerate() {
                moved[d] += 1e-6 * extent * force[n % dim] / length;
            }
        }
        let ends = self.line(u, &moved).ok()?;
        let mut closing = 0.0;
        for (k, piece) in self.pieces.iter().enumerate() {
            let acts = self.terms[piece.term].law.tests.iter().any(|s| own.contains(&s.field.index()));
            if acts && self.terms[piece.term].law.class > Class::Constant {
                closing += piece.closing(&ends[0][k], &ends[1][k]);
            }
        }
        let unknown = own.iter().all(|k| self.fields[*k].kind == FieldKind::Unknown);
        (closing != 0.0 && unknown).then_some(closing > 0.0)
    }
}
