//! Conditions that a solution satisfies for every method: equilibrium, no penetration, no slip of sticking points.
//!
//! Promises: numbers relative to what is there (forces to forces, lengths to the largest displacement of the bodies that
//! meet, beside a motion that they have in common), found from terms and prescribed values alone. Does not judge the mesh.

use wfl_compiler::{
    Class,
    types::{FieldKind, RateForm, UniformSlot},
};

use super::{
    Solved,
    common_motion::beside_common,
    moments::{Moments, moments},
    multiplier_law::LawDefect,
    turned_sides::turned_sum,
};
use wfl_contact::{Alternation, ContactGaps, Look, Moved, PressedFaces, Ways, contact_gaps, is_between};
use wfl_discrete::assemble::{AssembledTerm, TermError};
use wfl_discrete::field::FieldSpace;
use wfl_discrete::finite::{largest, position as position_of, short};
use wfl_discrete::rates::Rates;
use wfl_discrete::system::{Form, System};

/// Out of balance by more than this part of the forces is more than rounding and the tolerance of Newton: that is 1e-8 where
/// nothing is said, and a sum over all nodes adds up what each leaves.
const BALANCE: f64 = 1e-6;
/// Forces out of balance by more than this part of them are reported for every tolerance: they have fewer than three correct digits,
/// the limit of W605.
const LARGEST_BALANCE: f64 = 1e-3;
/// Overlap, or sliding at points that stick, in parts of the largest displacement (between two bodies, of what they do beside a
/// motion that they have in common): beyond it the law is no longer one
/// of contact but of springs as soft as the bodies. A penalty of E/h leaves a tenth of the displacement of a body
/// pressed by one cell's thickness, and less otherwise.
const OVERLAP: f64 = 0.2;

/// A force that has the wrong sign on more than this part of the area in contact is no matter of single points, at
/// which a discretisation may be off: a sign is wrong in the term. Right scenes on four cells an edge were seen to have
/// it on a thirteenth of the area; a wrong sign has it on most of what is in contact.
const AGAINST: f64 = 0.25;
/// Traction outside the friction cone, in parts of traction and radius. What a coarse mesh leaves between the points at
/// which a law holds was seen to be below a tenth; a term that loses its friction leaves nearly all.
const OUTSIDE: f64 = 0.5;
/// All displacements are moved by this part of the extent of the mesh to see whether that strains the cells: far more than
/// rounding, and far less than what turns a law of large strains.
const MOVED: f64 = 1e-6;
/// A motion of all displacements with forces below this part of those of one that strains each cell strains none: rounding is
/// 1e-10 of displacements as large as the mesh. Around an axis it is the square of a cell over the radius.
const RIGID: f64 = 1e-8;
/// Displacements below this part of the extent of the mesh are rounding: positions are known no better.
const UNMOVED: f64 = 1e-12;
/// Forces below this part of what cancels in them are rounding: some units of it, as Newton's method takes them.
const ROUNDED: f64 = 4.0 * f64::EPSILON;
/// Contact forces below this part of the forces of the bodies are rounding: below the tolerance of Newton's method in the
/// equations of the bodies, which they are a part of.
const UNPRESSED: f64 = 1e-9;

/// What the law of a multiplier may leave at single points, in parts of the multiplier. At the nodes of a plane
/// interface nothing is left; where it is this much, slip was seen to vary by about a hundredth with the parameter.
const AVERAGE: f64 = 1e-4;
/// The same in units of what Newton leaves of the equations: what is left of a weak law is a mean over a node, and single
/// points beside it may miss by several times as much.
const UNSOLVED: f64 = 10.0;

/// How the detail of a condition begins that was not judged.
const UNTESTED: &str = "not tested: ";

/// A condition with what was found.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicsCheck {
    /// What is looked at: "equilibrium of uL, uR".
    pub name: String,
    /// The statement of the scene that it is about.
    pub about: About,
    /// What was found, relative.
    pub value: f64,
    /// What it may be.
    pub limit: f64,
    /// The numbers behind it, in words.
    pub detail: String,
    /// Of a body with inertia the displacement (length) that `value` is a part of: a motion that begins has hardly any
    /// when it meets the first wall, and the largest one of the run is what the length is compared with
    /// ([`Self::beside`]).
    pub displacement: Option<f64>,
}

/// The statement of a scene that a condition is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum About {
    /// Several of them.
    Scene,
    /// The declaration of this field.
    Field(String),
    /// The term of this name.
    Term(String),
}

impl PhysicsCheck {
    /// A condition that cannot be judged, and why.
    fn untested(name: String, about: About, limit: f64, why: &str) -> Self {
        Self { name, about, value: 0.0, limit, detail: format!("{UNTESTED}{why}"), displacement: None }
    }

    /// The value in parts of the largest displacement among those of the same condition at all times of a run (length).
    #[must_use]
    pub fn beside(&self, largest: f64) -> f64 {
        self.displacement.filter(|own| largest > *own).map_or(self.value, |own| self.value * (own / largest))
    }

    /// Why it was not judged, if it was not.
    #[must_use]
    pub fn why_untested(&self) -> Option<&str> {
        self.detail.strip_prefix(UNTESTED)
    }

    /// True if it holds; never for a number that is none.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.value <= self.limit
    }
}

/// A zone of contact that covers no face of its term.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NarrowZone {
    /// The term.
    pub term: String,
    /// Its faces.
    pub faces: PressedFaces,
}

/// Pressures of a term that alternate from point to point.
#[derive(Clone, Debug, PartialEq)]
pub struct Zigzag {
    /// The term.
    pub term: String,
    /// How much.
    pub size: Alternation,
}

/// What [`conditions`] found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conditions {
    /// What should be zero.
    pub checks: Vec<PhysicsCheck>,
    /// What the mesh does not resolve.
    pub narrow: Vec<NarrowZone>,
    /// Pressures that alternate.
    pub zigzags: Vec<Zigzag>,
}

/// Whether forces balance at a state, reactions included: as far as Newton was asked to go; with the fields whose
/// laws are known to know no rotations moments, too.
#[must_use]
pub fn balance(state: Solved<'_>, tolerance: f64, turning: Option<&Vec<String>>) -> Vec<PhysicsCheck> {
    let mut out = Vec::new();
    for group in displacement_groups(state.system) {
        let Some(mut forces) = equilibrium(state, &group, tolerance) else { continue };
        let of_field = |turning: &Vec<String>| group.iter().map(|k| (*k, moments(state, *k, turning))).collect();
        let found = turning.map_or_else(Vec::new, of_field);
        let mut broken = Vec::new();
        let said = of_moments(state.system, &found, &mut broken);
        if forces.why_untested().is_none() && !said.is_empty() {
            forces.detail += &format!(", moments {said}");
        }
        out.push(forces);
        out.extend(broken);
    }
    out.extend(action_and_reaction(state.system, state.u));
    out
}

/// True if no force acts on the free dofs where the displacements are zero, at what is prescribed and at what the other
/// unknowns are in `u` now: then that is the solution. No force is one that is rounding beside what it is made of, as under
/// an initial stress that balances itself.
///
/// # Errors
/// [`TermError`] with its place.
pub fn rests(state: Solved<'_>, form: &Form<'_>) -> Result<bool, TermError> {
    let Solved { system, u, .. } = state;
    let mut still = u.to_vec();
    system.numbering.part_of_free(0.0, &mut still);
    let positions = system.sizes_of_positions(state.tangent);
    let of_positions = if positions.is_empty() { Vec::new() } else { system.largest_of_alike(&positions) };
    if is_balanced(system, &still, form, &of_positions)? {
        return Ok(true);
    }
    let mut held = u.to_vec();
    for range in displacement_groups(system).iter().flatten().filter_map(|k| system.range(*k)) {
        held[range.clone()].copy_from_slice(&still[range]);
    }
    is_balanced(system, &held, form, &of_positions)
}

/// True if the forces on all free dofs are zero, or rounding beside the largest that their fields are made of; where laws add
/// unknowns to positions, beside the stiffness times the positions by body.
fn is_balanced(system: &System, u: &[f64], form: &Form<'_>, of_positions: &[f64]) -> Result<bool, TermError> {
    let residual = system.residual(u, form)?.values;
    let free = &system.numbering.free_dofs;
    if system.team().all(free.iter().all(|d| residual[*d as usize] == 0.0)) {
        return Ok(true);
    }
    let parts = system.largest_of_alike(&system.contributions(u)?);
    let made_of = |body: usize| parts[body] + of_positions.get(body).copied().unwrap_or(0.0);
    let is_rounding = |d: &u32| residual[*d as usize].abs() <= ROUNDED * made_of(system.body_of(*d as usize));
    Ok(system.team().all(free.iter().all(is_rounding)))
}

/// Fields of displacements by the bodies that meet: vectors of the space; along a line, any scalar could be one.
fn displacement_groups(system: &System) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let dim = system.mesh.dim();
    for k in 0..system.fields.len() {
        let f = &system.fields[k];
        let is_number = matches!(f.space, FieldSpace::Global) || system.mesh.check_whole(|| f.n_nodes() < 2);
        if dim < 2 || f.n_components != dim || f.kind != FieldKind::Unknown || system.range(k).is_none() || is_number {
            continue;
        }
        match groups.iter_mut().find(|g| system.alike(g[0]) == system.alike(k)) {
            Some(group) => group.push(k),
            None => groups.push(vec![k]),
        }
    }
    groups
}

fn names(system: &System, group: &[usize]) -> String {
    group.iter().map(|k| system.fields[*k].name.as_str()).collect::<Vec<_>>().join(", ")
}

/// A part of a whole; not a number, which holds for no condition, where the whole is too large for one.
fn share(part: f64, whole: f64) -> f64 {
    if whole.is_finite() { part / whole } else { f64::NAN }
}

/// Loads against reactions: what the equations at the free nodes leave, summed, by component.
fn equilibrium(state: Solved<'_>, group: &[usize], tolerance: f64) -> Option<PhysicsCheck> {
    let (system, residual) = (state.system, &state.residual.values);
    let dim = system.mesh.dim();
    let loads = system.constant_residual();
    let is_fixed = |d: usize| system.numbering.free[d] == wfl_discrete::system::FIXED;
    let part = |fixed: bool| {
        let mut all: Vec<f64> =
            residual.iter().enumerate().map(|(d, r)| if is_fixed(d) == fixed { *r } else { 0.0 }).collect();
        system.numbering.frames.turn_back(&mut all);
        all
    };
    let (held, free) = (part(true), part(false));
    let (mut load, mut reaction, mut left) = (vec![0.0; dim], vec![0.0; dim], vec![0.0; dim]);
    let mut size = 0.0;
    // the rows of this rank: those of others are zero
    for d in dofs(system, group) {
        let component = (d - system.range(system.field_of(d))?.start) % dim;
        load[component] -= loads[d];
        size += loads[d].abs();
        reaction[component] += held[d];
        size += held[d].abs();
        left[component] += free[d];
    }
    for sums in [&mut load, &mut reaction, &mut left] {
        system.team().sum(sums);
    }
    let mut size = system.team().total(size);
    let left = largest(left.iter().copied());
    let limit = BALANCE.max(tolerance).min(LARGEST_BALANCE);
    let name = format!("equilibrium of {}", names(system, group));
    let about = match group {
        [one] => About::Field(system.fields[*one].name.clone()),
        _ => About::Scene,
    };
    if share(left, size) > limit {
        // neither loads nor reactions: forces inside balance each other, or nothing acts
        let sum = |numbers: &[f64]| system.team().total(dofs(system, group).map(|d| numbers[d]).sum());
        size = size.max(sum(&system.contributions(state.u).ok()?));
        // what cancels inside laws, and in the gradients that they read: of a body that moves as a whole nothing is left
        let sizes = system.sizes(state.u, state.residual, state.tangent);
        let cancels = sum(&system.cancelled(state.u, state.residual)).max(sum(&sizes));
        if share(left, size) > limit && left <= ROUNDED * cancels {
            return Some(PhysicsCheck::untested(
                name,
                about,
                limit,
                "no force acts but what rounding leaves of the motion",
            ));
        }
    }
    if size == 0.0 {
        return None;
    }
    // what is within the imbalance that rounding leaves is nothing
    let shown = |x: &f64| short(if x.abs() <= BALANCE * size { 0.0 } else { *x });
    let list = |v: &[f64]| v.iter().map(shown).collect::<Vec<_>>().join(", ");
    let detail = format!("loads [{}], reactions [{}]", list(&load), list(&reaction));
    Some(PhysicsCheck { name, about, value: share(left, size), limit, detail, displacement: None })
}

/// True for moments that do not balance.
fn is_broken(found: Option<&Moments>) -> bool {
    matches!(found, Some(Moments::Left { share, limit, .. }) if share.is_nan() || share > limit)
}

/// Adds a condition for each field whose moments do not balance; in words what is known of the others.
fn of_moments(system: &System, found: &[(usize, Option<Moments>)], out: &mut Vec<PhysicsCheck>) -> String {
    let (mut most, mut words): (Option<f64>, Vec<String>) = (None, Vec::new());
    for (field, found) in found.iter().filter_map(|(field, found)| Some((*field, found.as_ref()?))) {
        let name = &system.fields[field].name;
        match found {
            Moments::Left { share, limit, position } if is_broken(Some(found)) => out.push(PhysicsCheck {
                name: format!("equilibrium of moments of {name}"),
                about: About::Field(name.clone()),
                value: *share,
                limit: *limit,
                detail: format!(
                    "at this state the law of the terms on cells against Grad_Test_{name} is one that a rotation changes, most \
                     at {}: the stress of a body (of finite strains its product with F') is symmetric",
                    position_of(*position)
                ),
                displacement: None,
            }),
            Moments::Left { share, .. } => most = Some(most.map_or(*share, |m| m.max(*share))),
            Moments::Untested(why) => {
                let word = format!("not tested: {why}");
                if !words.contains(&word) {
                    words.push(word);
                }
            }
        }
    }
    words.splice(0..0, most.map(|m| format!("{m:.1e}")));
    words.join("; ")
}

/// The dofs of some fields.
fn dofs<'a>(system: &'a System, group: &'a [usize]) -> impl Iterator<Item = usize> + 'a {
    group.iter().filter_map(|k| system.range(*k)).flatten()
}

/// What a term on an interface does to one side it does to the other: it acts on no rigid translation of both.
fn action_and_reaction(system: &System, u: &[f64]) -> Vec<PhysicsCheck> {
    let displacements: Vec<usize> = displacement_groups(system).concat();
    let both = |k: usize| {
        is_between(system, k, |field| displacements.contains(&field)) && system.terms[k].law.class > Class::Constant
    };
    let terms: Vec<usize> = (0..system.terms.len()).filter(|k| both(*k)).collect();
    terms.into_iter().filter_map(|k| balance_of_term(system, k, u)).collect()
}

/// The forces of a term that come with the displacements, summed over both sides; loads written in it act on one.
fn balance_of_term(system: &System, term: usize, u: &[f64]) -> Option<PhysicsCheck> {
    let at = |u: &[f64]| {
        let mut forces = vec![0.0; u.len()];
        system.term_residual(term, u, &mut forces).ok()?;
        Some(forces)
    };
    let forces = at(u)?;
    let about = About::Term(system.terms[term].law.name.clone());
    let name = format!("action and reaction of `{}`", system.terms[term].law.name);
    let every = [true; 3];
    let (mut sum, mut size) = summed(system, &forces, None, every);
    if share(sum, size) > BALANCE {
        (sum, size) = summed(system, &forces, Some(&at(&vec![0.0; u.len()])?), every);
    }
    if share(sum, size) > BALANCE {
        // across an axis of revolution a motion of all is a strain, with forces of its own
        let rigid = rigid_translations(system, u);
        let own = &rigid[..system.mesh.dim()];
        if *own == [false] {
            let why = "a motion of all strains the bodies";
            return Some(PhysicsCheck::untested(name, about, BALANCE, why));
        }
        // springs hold a body in every direction: its faces balance all the same
        let rigid = if own.contains(&true) { rigid } else { every };
        if rigid != every {
            (sum, _) = summed(system, &forces, Some(&at(&vec![0.0; u.len()])?), rigid);
        }
    }
    if share(sum, size) > BALANCE {
        // of the ends of a sector one is the other turned, and so are the forces
        let moves = |field: usize| displacement_groups(system).iter().any(|group| group.contains(&field));
        sum = turned_sum(system, term, u, moves).map_or(sum, |turned| sum.min(turned));
    }
    if share(sum, size) > BALANCE {
        // a motion that is no rigid one: of both sides together the forces are the stiffness times the motion
        let (_, cancels) = summed(system, &at(&scrambled(system, u))?, None, every);
        if sum <= ROUNDED * cancels {
            return Some(PhysicsCheck::untested(name, about, BALANCE, "the two sides move as one"));
        }
    }
    (size > 0.0).then(|| PhysicsCheck {
        name,
        about,
        value: share(sum, size),
        limit: BALANCE,
        detail: "the forces on the two sides do not cancel: is the test function the jump of both?".to_owned(),
        displacement: None,
    })
}

/// By direction whether cells have no forces where all displacements are moved by the same in it, beside those of a motion that
/// strains each cell. Terms with rates have forces of inertia, and do not count.
fn rigid_translations(system: &System, u: &[f64]) -> [bool; 3] {
    let displacements = displacement_groups(system).concat();
    let is_rate = |slot: &UniformSlot| matches!(slot, UniformSlot::Rate(_) | UniformSlot::TimeStep);
    let counts = |t: &&AssembledTerm| {
        let moves = t.law.tests.iter().any(|s| displacements.contains(&s.field.index()));
        t.on_cells() && moves && t.law.class > Class::Constant && !t.law.prologue.slots.iter().any(is_rate)
    };
    let terms: Vec<&AssembledTerm> = system.terms.iter().filter(counts).collect();
    let (dim, size) = (system.mesh.dim(), MOVED * system.extent());
    // differences of displacements that are carried far away are rounded
    let far = largest(displacements.iter().filter_map(|f| system.range(*f)).flat_map(|range| u[range].iter().copied()));
    let nothing = RIGID + ROUNDED * system.team().largest(far) / size;
    let response = |moved: &dyn Fn(usize, usize) -> f64| -> Option<f64> {
        let mut end = u.to_vec();
        for range in displacements.iter().filter_map(|f| system.range(*f)) {
            range.enumerate().for_each(|(n, d)| end[d] += size * moved(n % dim, d));
        }
        let [mut before, mut behind] = [vec![0.0; u.len()], vec![0.0; u.len()]];
        for term in &terms {
            system.residual_of(term, u, &mut before).ok()?;
            system.residual_of(term, &end, &mut behind).ok()?;
        }
        Some(system.team().largest(largest(before.iter().zip(&behind).map(|(a, b)| a - b))))
    };
    let signs = scrambled(system, &vec![1.0; u.len()]);
    let strained = response(&|_, d| signs[d]);
    [0, 1, 2].map(|direction| {
        let moved = response(&|component, _| f64::from(u8::from(component == direction)));
        direction >= dim || moved.zip(strained).is_none_or(|(moved, strained)| moved <= nothing * strained)
    })
}

/// The sum of forces less loads on all displacements, its largest component of some directions, and the sum of their magnitudes.
fn summed(system: &System, forces: &[f64], loads: Option<&[f64]>, directions: [bool; 3]) -> (f64, f64) {
    let dim = system.mesh.dim();
    let (mut sums, mut size) = (vec![0.0; dim], 0.0);
    for range in displacement_groups(system).iter().flatten().filter_map(|f| system.range(*f)) {
        for (n, d) in range.enumerate() {
            let load = loads.map_or(0.0, |loads| loads[d]);
            sums[n % dim] += forces[d] - load;
            size += forces[d].abs() + load.abs();
        }
    }
    system.team().sum(&mut sums);
    let own = sums.into_iter().zip(directions).filter(|(_, counts)| *counts).map(|(sum, _)| sum);
    (largest(own), system.team().total(size))
}

/// Numbers of the sizes of `u` with signs that follow no motion.
fn scrambled(system: &System, u: &[f64]) -> Vec<f64> {
    let sign = |d: usize| {
        let mixed = (system.dof_number(d) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        if mixed >> 63 == 0 { 1.0 } else { -1.0 }
    };
    u.iter().enumerate().map(|(d, x)| sign(d) * x).collect()
}

/// Overlap, sliding of sticking points, signs, friction cone, laws of multipliers; the equations hold to the relative
/// residual `left`. Nothing where nothing has moved: what is left there is rounding.
#[must_use]
pub fn conditions(state: Solved<'_>, left: f64) -> Conditions {
    let system = state.system;
    let displacements = displacement_groups(system).concat();
    let mut by_body = system.largest_of_alike(&system.lengths(state.u));
    (0..by_body.len())
        .filter(|body| !displacements.contains(&system.field_of_body(*body)))
        .for_each(|body| by_body[body] = 0.0);
    let least = UNMOVED * system.extent();
    let has_moved = by_body.iter().any(|size| *size > least);
    let mut found = Conditions::default();
    if has_moved {
        let beside = beside_common(state, &by_body, [true; 3]);
        found = of_contact(state, Moved { by_body: &by_body, beside: &beside, least }, Look::Quick);
        if !found.narrow.is_empty() || !found.checks.iter().all(PhysicsCheck::holds) {
            // a motion of all that strains bodies, as one away from an axis of revolution, is none that they only have in common
            let rigid = if beside == by_body { [true; 3] } else { rigid_translations(system, state.u) };
            let beside = beside_common(state, &by_body, rigid);
            found = of_contact(state, Moved { by_body: &by_body, beside: &beside, least }, Look::Careful);
        }
    }
    if displacements.is_empty() || has_moved {
        let defects = state.law_defects(UNPRESSED);
        found.checks.extend(defects.into_iter().map(|defect| law_at_points(defect, left)));
    }
    found
}

/// The conditions of contact at a state with these largest displacements, zones that cover no face, and pressures that
/// alternate.
fn of_contact(state: Solved<'_>, moved: Moved<'_>, look: Look) -> Conditions {
    let mut found = Conditions::default();
    let rates = state.system.rates().into_iter().flat_map(Rates::fields);
    let moves = rates.into_iter().any(|of| of.form == RateForm::Second);
    for (term, ways, gaps) in contact_gaps(state.system, state.contact, state.u, moved, look) {
        if gaps.pressed.are_too_large() {
            found.narrow.push(NarrowZone { term: term.to_owned(), faces: gaps.pressed });
        }
        found.zigzags.extend(gaps.alternates.map(|size| Zigzag { term: term.to_owned(), size }));
        lengths(&mut found.checks, term, &gaps, Lengths { ways, moves });
        shares(&mut found.checks, term, &gaps);
    }
    found
}

/// What lengths are compared with.
#[derive(Clone, Copy)]
struct Lengths {
    /// How far the bodies of the term have moved (lengths).
    ways: Ways,
    /// The scene has second rates.
    moves: bool,
}

/// Lengths that should be zero, in parts of the largest displacement of the bodies of the term.
fn lengths(out: &mut Vec<PhysicsCheck>, term: &str, gaps: &ContactGaps, compared: Lengths) {
    let Lengths { ways, moves } = compared;
    let largest = ways.compared;
    let common = if largest < ways.largest { " beside the motion that the bodies have in common" } else { "" };
    let displacement = moves.then_some(largest);
    let [overlaps, slips] = gaps.strained;
    let mut add = |what: &str, length: f64, strained: f64, detail: String| {
        let (name, about) = (format!("{what} `{term}`"), About::Term(term.to_owned()));
        if strained > OVERLAP * largest && length <= OVERLAP * largest {
            out.push(PhysicsCheck::untested(
                name,
                about,
                OVERLAP,
                "the law is that of an elastic joint, which holds tension",
            ));
        } else if gaps.turns && length <= OVERLAP * largest {
            out.push(PhysicsCheck::untested(name, about, OVERLAP, "the normal of the law turns with the bodies"));
        } else {
            out.push(PhysicsCheck { name, about, value: length / largest, limit: OVERLAP, detail, displacement });
        }
    };
    add(
        "penetration at",
        gaps.penetration,
        overlaps,
        format!("the sides overlap by {:.3e}; the largest displacement{common} is {largest:.3e}", gaps.penetration),
    );
    if gaps.drift.max(slips) > 0.0 {
        add(
            "slip of sticking points at",
            gaps.drift,
            slips,
            format!(
                "sticking points have slipped by {:.3e}; the largest displacement{common} is {largest:.3e}",
                gaps.drift
            ),
        );
    }
}

/// Parts of the area, or of the traction, that should be zero.
fn shares(out: &mut Vec<PhysicsCheck>, term: &str, gaps: &ContactGaps) {
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let mut add = |what: &str, share: Option<f64>, limit: f64, detail: &dyn Fn(f64) -> String| {
        let (name, about) = (format!("{what} `{term}`"), About::Term(term.to_owned()));
        out.extend(share.map(|value| PhysicsCheck {
            name,
            about,
            value,
            limit,
            detail: detail(value),
            displacement: None,
        }));
    };
    add("tensile contact force at", gaps.pulled, AGAINST, &|s| {
        format!("the force is tensile on {} of the closed area: a wrong sign in the term?", percent(s))
    });
    add("friction along the slip at", gaps.driven, AGAINST, &|s| {
        format!("friction drives the slip on {} of the contact area: a wrong sign in the term?", percent(s))
    });
    // of a zone that covers no face the mesh knows no tractions
    let cone = gaps.cone.filter(|_| !gaps.pressed.are_too_large());
    add("traction outside the friction cone at", cone, OUTSIDE, &|s| {
        format!(
            "{} of the contact traction (stress of the bodies or multiplier) is outside the friction cone, averaged over the area: it falls with the size of the faces if the law is that of friction",
            percent(s)
        )
    });
}

/// The law of a multiplier at single points.
fn law_at_points(defect: LawDefect, left: f64) -> PhysicsCheck {
    PhysicsCheck {
        name: format!("law of `{}` at the points", defect.multiplier),
        about: About::Field(defect.multiplier),
        value: defect.size,
        limit: AVERAGE.max(UNSOLVED * left),
        detail:
            "it holds only on average over the faces of a node, and the result depends on the augmentation parameter: \
             the faces of a node have different normals, or the quadrature points are not the nodes (`quadrature ... \
             vertex`); the effect falls with the size of the faces, and a run with another parameter shows it"
                .to_owned(),
        displacement: None,
    }
}
