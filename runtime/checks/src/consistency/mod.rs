//! Whether the terms of a contact interface carry the stress of the bodies: formulations checked, not only tangents.
//!
//! Take bodies of constant stress that meet at a face with normal n (out of the first), with traction t on the first
//! and -t on the second. Integrated by parts, the terms of the bodies leave t.v on the face for every test function v
//! of the first, -t.v for the second. The terms of the interface give there a force F.v, a part S:Grad_v and laws L.m
//! of multipliers m. The equations of both together, with test functions that vanish away from the face, are met on
//! every mesh if at each point
//!
//! ```text
//! t + F1 = 0,   -t + F2 = 0,   S1 = S2 = 0,   L = 0
//! ```
//!
//! for every state that satisfies the conditions of contact (p > 0 a pressure, d a direction in the face, r the
//! friction bound at that state, s > 0, multipliers that satisfy the most equations):
//!
//! ```text
//! closed    t = -p n            no gap
//! sticking  t = -p n + r d/2    no gap, no slip
//! slipping  t = -p n - r d      no gap, slip s d
//! open      t = 0               gap > 0
//! ```
//!
//! What is left is measured in parts of p (S and L in parts of their size nearby). A consistent method leaves rounding,
//! below 1e-4 (1e-14 without initial gaps), whatever its parameter. A method whose projections read neither stresses
//! nor multipliers is a penalty: it leaves all of t, and satisfies the equations with an overlap p/k, k its stiffness:
//! its error is of order 1/k. A method that reads them means to carry them: more than 1e-2 left is a mistake, of the
//! size of the stress itself on every mesh and for every parameter (with it the overlap is of order p/gamma, too, but
//! the order of convergence of the method is lost). Between the two nothing is said: laws that are linearised differ by
//! the strain of these states, 1e-3.
//!
//! The variant of Nitsche's method follows from its tangent where contact is closed: with F depending on the gradients
//! by C and S on the displacements by theta C', theta = 1 is symmetric, 0 incomplete, -1 skew-symmetric.
//!
//! Judged are terms on faces with a half line that acts (`pos_part`) on a displacement. Nothing is asked of names.
//! Loads on the same faces, bodies with a memory, properties that vary inside cells, forces across an open gap
//! (cohesion), pressures that stay below that of the states are not judged, with the reason. The pressure of a fluid on the
//! faces, a number that no projection reads, is zero: what it is says an equation of its own.

mod place;
mod solve;

use wfl_compiler::ProjectionKind;

pub use solve::Left;

use place::{At, Place, TILTED, Vector};
use solve::{SATISFIED, Sizes, Trial, dot};
use wfl_contact::{Contact, ContactTerm};
use wfl_discrete::system::System;

/// More than this left, relative to the sizes of the state, is no rounding and no difference of linearised laws: those are as
/// large as the strain of the tests, a thousandth.
const MISTAKE: f64 = 1e-2;
/// Less than this left is rounding: also where initial gaps are many times the overlaps of the states that are tried.
const ROUNDED: f64 = 1e-4;
/// Places looked at, evenly over an interface: a law is one formula, a second place tells whether its coefficients
/// vary.
const PLACES: usize = 2;
/// Faces of which one that looks at the obstacle is sought: those of a ring of this many have one within 3 degrees.
const LOOKED_AT: usize = 64;
/// The wider of two gaps, in units of the other: a force that grows from one to the other is one of contact.
const WIDER: f64 = 20.0;
/// Parts of a friction bound of which one is below the bound in the direction that is tried, of laws that are weaker
/// there: they are no wrong laws.
const WEAKER: [f64; 3] = [0.5 / 8.0, 0.5 / 64.0, 0.5 / 512.0];
/// Slip in units of what the friction bound stretches the law by: from one on a point slips, and three is clear of that by
/// more than what turns with the gap.
const SLIP: f64 = 3.0;

/// What is wrong with the terms of an interface.
#[derive(Clone, Debug, PartialEq)]
pub enum Mistake {
    /// They do not carry the stress of the bodies: by body the force along the traction, which should be 1.
    Balance {
        /// "closed", "sticking" or "slipping".
        state: &'static str,
        /// The part of the traction that they put on each body; none where there is no second one.
        carried: [Option<f64>; 2],
    },
    /// What is tested with the stresses of the test functions does not cancel; the part that is left.
    Stress {
        /// Relative to its size.
        left: f64,
    },
    /// No multiplier satisfies its law together with the balance; the part that is left.
    Law {
        /// Relative to its size.
        left: f64,
    },
    /// Forces the wrong way round, in words.
    Direction(&'static str),
}

impl Mistake {
    /// Whether the same force acts on all bodies, the right way, and is less than that of the states that are tried.
    fn carries_less(&self) -> bool {
        let is_less = |part: f64| part > 0.0 && part < 1.0 - MISTAKE;
        let balances = |here: f64, there: f64| (here - there).abs() <= MISTAKE * here;
        matches!(self, Mistake::Balance { carried: [Some(here), there], .. }
            if is_less(*here) && there.is_none_or(|there| balances(*here, there)))
    }

    /// Whether forces along the traction are those that the bodies have: what is left lies along the face.
    fn carries_pressure(&self) -> bool {
        let is_whole = |part: f64| (part - 1.0).abs() <= MISTAKE;
        matches!(self, Mistake::Balance { carried: [Some(here), there], .. } if is_whole(*here) && there.is_none_or(is_whole))
    }
}

/// What the terms of an interface amount to.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The exact solution satisfies them.
    Consistent,
    /// The exact solution satisfies them but for this part.
    Nearly(f64),
    /// They need an overlap to carry a pressure: the pressure over this stiffness (stress over length).
    Penalty(f64),
    /// See [`Mistake`].
    Wrong(Mistake),
    /// It cannot be said, and why.
    NotJudged(String),
}

/// What a state leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateLeft {
    /// "closed", "sticking", "slipping" or "open".
    pub name: &'static str,
    /// What is left; with an overlap for a penalty.
    pub left: Left,
}

/// The terms of an interface.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactForm {
    /// Their names.
    pub terms: Vec<String>,
    /// The term with the projections: its place among the terms of the system.
    pub term: usize,
    /// What they amount to.
    pub verdict: Verdict,
    /// The variant of Nitsche's method; `None` where forces do not depend on stresses.
    pub theta: Option<f64>,
    /// There are multipliers.
    pub has_multipliers: bool,
    /// The states that were tried.
    pub states: Vec<StateLeft>,
    /// What part of friction was not judged, and why.
    pub unsaid: Option<String>,
}

/// Judges the contact terms of a system, its laws at the step that is asked about. Nothing is assembled.
#[must_use]
pub fn contact_forms(system: &System, contact: &Contact) -> Vec<ContactForm> {
    let rest = vec![0.0; system.numbering.n_dofs];
    let values = system.values_with(&rest, contact.active_set());
    let interface = At { system, contact, values: values.view() };
    let mut forms: Vec<ContactForm> = Vec::new();
    let mut seen: Vec<usize> = Vec::new();
    for piece in contact.terms() {
        if piece.on_cells() || piece.moves() || seen.contains(&piece.term) || !closes(piece) || !piece.pushes(system) {
            continue;
        }
        let mut found: Option<ContactForm> = None;
        for place in places(piece, PLACES) {
            let form = on_face(interface, piece, place, &mut seen);
            if found.as_ref().is_none_or(|f| rank(&form.verdict) > rank(&f.verdict)) {
                found = Some(form);
            }
        }
        forms.extend(found);
    }
    forms
}

/// True if a half line acts: a law of contact rather than of friction alone.
fn closes(piece: &ContactTerm) -> bool {
    piece.law().2.iter().any(|p| p.kind == ProjectionKind::HalfLine && p.n == 1 && p.acts)
}

/// Of the verdicts at several points the one that is reported.
fn rank(verdict: &Verdict) -> usize {
    match verdict {
        Verdict::Consistent => 0,
        Verdict::Nearly(_) => 1,
        Verdict::Penalty(_) => 2,
        Verdict::NotJudged(_) => 3,
        Verdict::Wrong(_) => 4,
    }
}

/// At most so many faces of a term, all over it.
fn places(piece: &ContactTerm, most: usize) -> Vec<(usize, usize)> {
    let groups = &piece.law().1.domain.groups;
    let all: Vec<(usize, usize)> =
        groups.iter().enumerate().flat_map(|(g, group)| (0..group.entities.len()).map(move |e| (g, e))).collect();
    all.iter().step_by(all.len().div_ceil(most).max(1)).copied().collect()
}

/// What is found at a face. One that looks away from an obstacle never meets it, whatever the law would do there: where the whole
/// skin of a disc is a region of contact, what counts is the face that looks at the obstacle most.
fn on_face(interface: At<'_>, piece: &ContactTerm, at: (usize, usize), seen: &mut Vec<usize>) -> ContactForm {
    let (form, looks) = at_place(interface, piece, at, seen);
    if !matches!(form.verdict, Verdict::Wrong(_)) || looks > TILTED {
        return form;
    }
    let looks_at =
        |at: &(usize, usize)| Place::new(interface, piece, at.0, at.1).map_or(f64::NEG_INFINITY, |p| p.looks);
    let facing = places(piece, LOOKED_AT).into_iter().map(|at| (looks_at(&at), at)).max_by(|a, b| a.0.total_cmp(&b.0));
    match facing.filter(|(looks, _)| *looks > TILTED).map(|(_, at)| at_place(interface, piece, at, seen).0) {
        Some(there) if rank(&there.verdict) <= rank(&Verdict::Penalty(0.0)) => there,
        _ => form,
    }
}

/// What is found at a face, and how far it looks at the obstacle: see [`Place`].
fn at_place(interface: At<'_>, piece: &ContactTerm, at: (usize, usize), seen: &mut Vec<usize>) -> (ContactForm, f64) {
    let system = interface.system;
    let own = system.terms[piece.term].law.name.clone();
    let mut form = ContactForm {
        terms: vec![own],
        term: piece.term,
        verdict: Verdict::Consistent,
        theta: None,
        has_multipliers: false,
        states: Vec::new(),
        unsaid: None,
    };
    let mut looks = 1.0;
    match Place::new(interface, piece, at.0, at.1) {
        Ok(place) => {
            looks = place.looks;
            let terms = place.terms();
            form.terms = terms.iter().map(|t| system.terms[*t].law.name.clone()).collect();
            seen.extend(terms);
            form.has_multipliers = place.multipliers().next().is_some();
            form.verdict = match (Judge { place: &place, form: &mut form }).verdict() {
                Ok(verdict) => verdict,
                Err(Unjudged(why)) => Verdict::NotJudged(why.to_owned()),
            };
        }
        Err(why) => form.verdict = Verdict::NotJudged(why),
    }
    (form, looks)
}

/// Why a place cannot be judged.
struct Unjudged(&'static str);

/// What acts where the bodies are apart.
enum Open {
    Nothing,
    /// Forces along the face alone.
    Shear,
    /// A force along the normal that grows with the gap; true if it pushes them further apart.
    Grows(bool),
    Other,
}

struct Judge<'a, 'p> {
    place: &'a Place<'p>,
    form: &'a mut ContactForm,
}

const NOT_FINITE: Unjudged = Unjudged("a law is not finite at the test states, or the bodies cannot have that stress");
const ACROSS: Unjudged = Unjudged("forces act across an open gap (cohesion or a load)");

fn times(v: &Vector, by: f64) -> Vector {
    v.map(|x| by * x)
}

fn plus(a: &Vector, b: &Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

impl Judge<'_, '_> {
    fn keep(&mut self, name: &'static str, left: Left) {
        self.form.states.push(StateLeft { name, left });
    }

    fn verdict(&mut self) -> Result<Verdict, Unjudged> {
        let place = self.place;
        let sizes = place.sizes().ok_or(Unjudged("no projection becomes active as the bodies approach"))?;
        let normal = place.normal;
        let open = self.open(&sizes)?;
        let pressed = times(&normal, -sizes.pressure);
        let closed = place.trial(&sizes, &pressed, &[0.0; 3], &[0.0; 3]).ok_or(NOT_FINITE)?;
        let (state, left) = place.best(&sizes, &closed, None).ok_or(NOT_FINITE)?;
        if !place.touches(&sizes).ok_or(NOT_FINITE)? {
            return Err(Unjudged("an initial gap changes with the gradient of the displacement"));
        }
        let (product, square) = place.couplings(&state);
        self.form.theta = (square > 0.0).then(|| product / square);
        if !place.reads_traction(&closed, ProjectionKind::HalfLine) {
            return self.penalty(&sizes, &closed, &open);
        }
        self.keep("closed", left);
        if matches!(open, Open::Other) {
            return Err(ACROSS);
        }
        if left.largest() > MISTAKE {
            return self.unless_worn("closed", &sizes, &closed, left);
        }
        if let Open::Grows(pushes) = open {
            return Ok(Verdict::Wrong(Mistake::Direction(if pushes {
                "the sides repel each other across an open gap, more as the gap grows"
            } else {
                "the sides attract each other across an open gap, more as the gap grows"
            })));
        }
        let wrong = self.friction(&sizes, [0.0; 3])?;
        let worst = self.form.states.iter().map(|s| s.left.largest()).fold(0.0, f64::max);
        Ok(wrong.unwrap_or(if worst > ROUNDED { Verdict::Nearly(worst) } else { Verdict::Consistent }))
    }

    /// What acts across a gap: nothing should.
    fn open(&mut self, sizes: &Sizes) -> Result<Open, Unjudged> {
        let place = self.place;
        let mut forces = [[0.0; 3]; 2];
        for (force, gap) in forces.iter_mut().zip([1.0, WIDER]) {
            let apart = times(&place.normal, -gap * sizes.length());
            let trial = place.trial(sizes, &[0.0; 3], &apart, &[0.0; 3]).ok_or(NOT_FINITE)?;
            let (state, left) = place.best(sizes, &trial, None).ok_or(NOT_FINITE)?;
            *force = place.contact_fluxes(sizes, &state).ok_or(NOT_FINITE)?.force[0];
            if gap == 1.0 {
                self.keep("open", left);
            }
        }
        let small = SATISFIED * sizes.pressure;
        let along = forces.map(|f| dot(&f, &place.normal));
        if along.iter().all(|f| f.abs() <= small) {
            let shear = forces.iter().any(|f| dot(f, f).sqrt() > small);
            return Ok(if shear { Open::Shear } else { Open::Nothing });
        }
        let grows = along[1].abs() > 0.5 * WIDER * along[0].abs() && along[0] * along[1] > 0.0;
        // a force on the first body along its normal is what presses it out of the other
        Ok(if grows { Open::Grows(along[1] > 0.0) } else { Open::Other })
    }

    /// A law without stresses and multipliers carries a pressure with an overlap.
    fn penalty(&mut self, sizes: &Sizes, closed: &Trial, open: &Open) -> Result<Verdict, Unjudged> {
        let place = self.place;
        let near = |sign: f64| {
            let start = times(&place.normal, sign * sizes.length());
            let (state, left) = place.best(sizes, closed, Some(&start))?;
            let moved = plus(&state.bodies[0].value, &times(&closed.state.bodies[0].value, -1.0));
            (left.balance[0] <= MISTAKE).then(|| (dot(&moved, &place.normal), left))
        };
        match (near(1.0).filter(|f| f.0 > 0.0), near(-1.0), open) {
            (Some((overlap, left)), _, Open::Nothing | Open::Shear) => {
                self.keep("closed", left);
                if left.largest() > MISTAKE {
                    return Ok(Verdict::Wrong(self.unheld(sizes, closed).ok_or(NOT_FINITE)?));
                }
                let wrong = self.friction(sizes, times(&place.normal, overlap))?;
                Ok(wrong.unwrap_or(Verdict::Penalty(sizes.pressure / overlap)))
            }
            (None, Some((gap, _)), Open::Grows(_)) if gap < 0.0 => {
                Ok(Verdict::Wrong(Mistake::Direction("no force resists penetration, and forces grow with an open gap")))
            }
            (None, _, Open::Nothing) => {
                let mistake = self.unheld(sizes, closed).ok_or(NOT_FINITE)?;
                if mistake.carries_pressure() && place.radius(&closed.state).1 > 0 {
                    return Err(Unjudged(
                        "the pressure is that of the overlap, and friction acts beside it on faces at rest",
                    ));
                }
                if mistake.carries_less() {
                    return Err(Unjudged("the pressure does not grow to that of the test states"));
                }
                Ok(Verdict::Wrong(mistake))
            }
            _ => Err(ACROSS),
        }
    }

    /// What is wrong with a penalty that does not resist an overlap, or not on both bodies.
    fn unheld(&self, sizes: &Sizes, closed: &Trial) -> Option<Mistake> {
        let mut state = closed.state.clone();
        state.bodies[0].value = plus(&state.bodies[0].value, &times(&self.place.normal, sizes.length()));
        let force =
            self.place.contact_fluxes(sizes, &state)?.force.map(|f| dot(&f, &self.place.normal) / sizes.pressure);
        if force[0] < -MISTAKE {
            return Some(Mistake::Direction("the sides attract each other more as they are pressed"));
        }
        let there = self.place.has_two_bodies().then_some(-force[1]);
        Some(Mistake::Balance { state: "closed", carried: [Some(force[0]), there] })
    }

    /// A gap that follows a state, which follows the pressure (wear), makes contact softer on purpose: such a law is not
    /// judged where an overlap is all it needs.
    fn unless_worn(&self, state: &'static str, sizes: &Sizes, trial: &Trial, left: Left) -> Result<Verdict, Unjudged> {
        let start = times(&self.place.normal, sizes.length());
        let softer = || self.place.best(sizes, trial, Some(&start)).is_some_and(|(_, left)| left.largest() <= MISTAKE);
        if self.place.gap_has_state(sizes, &trial.state) && softer() {
            return Err(Unjudged("the gap follows a state, as one that wears does"));
        }
        Ok(self.wrong_or_soft(state, sizes, trial, left))
    }

    /// A method that reads tractions and does not carry them: a mistake, unless an overlap far smaller than that of its
    /// own parameter is all it needs, as of a multiplier whose law is made softer on purpose.
    fn wrong_or_soft(&self, state: &'static str, sizes: &Sizes, trial: &Trial, left: Left) -> Verdict {
        if self.form.has_multipliers {
            let start = times(&self.place.normal, 0.0);
            if let Some((found, rest)) = self.place.best(sizes, trial, Some(&start)) {
                let moved = plus(&found.bodies[0].value, &times(&trial.state.bodies[0].value, -1.0));
                let overlap = dot(&moved, &self.place.normal);
                if rest.largest() <= SATISFIED && overlap > 0.0 && overlap < 0.1 * sizes.length() {
                    return Verdict::Penalty(sizes.pressure / overlap);
                }
            }
        }
        Verdict::Wrong(self.mistake(state, sizes, trial, left))
    }

    fn mistake(&self, state: &'static str, sizes: &Sizes, trial: &Trial, left: Left) -> Mistake {
        if self.form.has_multipliers && left.law > MISTAKE {
            return Mistake::Law { left: left.law };
        }
        let balance = left.balance[0].max(left.balance[1]);
        if balance <= MISTAKE {
            return if left.stress > MISTAKE {
                Mistake::Stress { left: left.stress }
            } else {
                Mistake::Law { left: left.law }
            };
        }
        let found = self.place.best(sizes, trial, None);
        let fluxes = found.and_then(|(state, _)| self.place.contact_fluxes(sizes, &state));
        // of a traction with shear the shear: the pressure has been looked at before
        let pressure = dot(&trial.traction, &self.place.normal);
        let shear = plus(&trial.traction, &times(&self.place.normal, -pressure));
        let along = if state == "closed" { trial.traction } else { shear };
        let size = dot(&along, &along);
        let part = |body: usize, sign: f64| fluxes.as_ref().map(|f| sign * dot(&f.force[body], &along) / size);
        let there = if self.place.has_two_bodies() { part(1, 1.0) } else { None };
        Mistake::Balance { state, carried: [part(0, -1.0), there] }
    }

    /// Sticking and slipping; `overlap` is what a penalty needs.
    fn friction(&mut self, sizes: &Sizes, overlap: Vector) -> Result<Option<Verdict>, Unjudged> {
        let place = self.place;
        let pressed = times(&place.normal, -sizes.pressure);
        let Some(along) = place.along() else { return Ok(None) };
        let at = |jump: &Vector, slid: &Vector, traction: &Vector| {
            place.trial(sizes, traction, &plus(&overlap, jump), slid).ok_or(NOT_FINITE)
        };
        let none = [0.0; 3];
        let rest = at(&none, &none, &pressed)?;
        let (state, _) = place.best(sizes, &rest, None).ok_or(NOT_FINITE)?;
        let (radius, balls) = place.radius(&state);
        if balls == 0 {
            return Ok(None);
        }
        let apart = place.trial(sizes, &none, &times(&place.normal, -sizes.length()), &none).ok_or(NOT_FINITE)?;
        if radius <= 0.0 {
            let wrong = place.radius(&apart.state).0 > 0.0;
            return Ok(wrong.then_some(Verdict::Wrong(Mistake::Direction(
                "friction acts across an open gap, and not in closed contact",
            ))));
        }
        if let Some(wrong) = self.sticking(sizes, &overlap, &along, radius)? {
            return Ok(Some(wrong));
        }
        let slide = times(&along, SLIP * radius / sizes.slope.abs());
        let sliding = at(&slide, &slide, &pressed)?;
        let mut moving = sliding.state.clone();
        moving.multipliers.clone_from(&state.multipliers);
        let radius = place.radius(&moving).0;
        let leaves = |sign: f64| {
            let trial = at(&slide, &slide, &plus(&pressed, &times(&along, sign * radius)))?;
            place.best(sizes, &trial, None).map(|found| found.1).ok_or(NOT_FINITE)
        };
        let left = leaves(-1.0)?;
        if left.largest() <= MISTAKE {
            self.keep("slipping", left);
        } else if leaves(1.0)?.largest() <= MISTAKE {
            self.keep("slipping", left);
            return Ok(Some(Verdict::Wrong(Mistake::Direction("friction drives the slip that it should resist"))));
        } else {
            let other = || "slip is not tested: other tangential forces act on the faces".to_owned();
            self.form.unsaid.get_or_insert_with(other);
        }
        Ok(None)
    }

    /// What is wrong with sticking. Where a part of the bound alone is carried, the bound depends on the direction.
    fn sticking(
        &mut self,
        sizes: &Sizes,
        overlap: &Vector,
        along: &Vector,
        radius: f64,
    ) -> Result<Option<Verdict>, Unjudged> {
        let place = self.place;
        let sheared = |part: f64| {
            let shear = times(along, part * radius);
            let traction = plus(&times(&place.normal, -sizes.pressure), &shear);
            let trial = place.trial(sizes, &traction, overlap, &[0.0; 3]).ok_or(NOT_FINITE)?;
            let (_, left) = place.best(sizes, &trial, None).ok_or(NOT_FINITE)?;
            Ok((shear, trial, left))
        };
        let (shear, trial, left) = sheared(0.5)?;
        if left.largest() <= MISTAKE {
            self.keep("sticking", left);
            return Ok(None);
        }
        if place.reads_traction(&trial, ProjectionKind::Ball) {
            for part in WEAKER {
                let (_, _, less) = sheared(part)?;
                // of a part of it the law is as right as of all, unless more than the bound was asked for
                if less.largest() <= MISTAKE * part {
                    self.keep("sticking", less);
                    self.form.unsaid =
                        Some("slip is not tested: the bound of friction depends on the direction".to_owned());
                    return Ok(None);
                }
            }
            self.keep("sticking", left);
            return self.unless_worn("sticking", sizes, &trial, left).map(Some);
        }
        // a penalty along the face: the first body has moved against the traction on it
        let start = times(&shear, -1.0 / sizes.slope.abs());
        let (state, left) = place.best(sizes, &trial, Some(&start)).ok_or(NOT_FINITE)?;
        let moved = plus(&state.bodies[0].value, &times(&trial.state.bodies[0].value, -1.0));
        if left.largest() > MISTAKE {
            self.form.unsaid = Some("stick is not tested: other tangential forces act on the faces".to_owned());
            return Ok(None);
        }
        self.keep("sticking", left);
        let drives = dot(&moved, &shear) > 0.0;
        Ok(drives.then_some(Verdict::Wrong(Mistake::Direction("friction drives the slip that it should resist"))))
    }
}
