//! Points between two branches: there a result has one derivative for each direction, and the adjoint gives that of one
//! side. Where both sides of a kink are one number whatever moves (the jump at the tip of a crack, where both sides are one
//! node), no change leads to one branch rather than to the other, and there is nothing to tell.

use std::{collections::BTreeSet, sync::Arc};

use wfl::{Code, Diagnostic, ResolvedScript, Span};
use wfl_compiler::{
    KinkKind, KinkSides, ValueLaw, backend::KernelBackend, compile_term_kink_sides, compile_value_kink_sides,
};
use wfl_discrete::{
    assemble::{Domain, FieldValues},
    finite::largest,
    system::StateValues,
    value::{Sampled, Value},
    window::Window,
};
use wfl_problem::Solving;

use super::{extended::Extended, laws::update_of, refused::not_made};

/// The two sides of a kink are one number within this part of the largest of them in the region.
pub(super) const NEAR: f64 = 1e-9;

/// Sides that move apart by less than this part of what they move by do not move apart: both are sums of the same few numbers,
/// and what is left is their rounding.
const STILL: f64 = 1e-13;

/// How far beside a state it is tried what moves, in parts of the largest value of each field: a norm at zero, or a kink inside
/// a kink, has no slope at the state itself.
const BESIDE: f64 = 1e-3;

/// Points of a region between two branches at the end of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct NearKink {
    /// The term, the state or the measure.
    pub place: String,
    /// Its statement.
    pub span: Option<Span>,
    /// What they do there.
    pub kind: &'static str,
    /// The step variable at the end of the first such step; not a number for what holds at all steps.
    pub time: f64,
    /// How many there.
    pub points: usize,
    /// Of how many.
    pub of: usize,
    /// At how many further steps there are some.
    pub more: usize,
}

impl NearKink {
    /// W660: what there is to tell of them.
    #[must_use]
    pub fn finding(&self) -> Diagnostic {
        let Self { place, span, kind, time, points, of, more } = self;
        if time.is_nan() {
            return self.of_all_steps();
        }
        let further = match more {
            0 => String::new(),
            1 => ", and some at another step".to_owned(),
            n => format!(", and some at {n} more steps"),
        };
        // a number is no set of points
        let what = if *of == 0 { String::new() } else { format!("{points} of {of} points of ") };
        Diagnostic::new(Code::W660, format!("{what}`{place}` {kind} at t = {time}{further}"))
            .at_or_note(
                *span,
                "each counts with the branch that it is on: for changes to one side the derivative is another one",
            )
            .help("--one-sided PARAMETER gives those to both sides; differences of runs: wfl verify --gradient")
    }

    /// W660 for what the parameters do to the mesh.
    fn of_all_steps(&self) -> Diagnostic {
        let Self { place, span, kind, points, of, .. } = self;
        if *of > 0 {
            return Diagnostic::new(Code::W660, format!("{points} of {of} cells of `{place}` {kind}"))
                .at_or_note(*span, "the derivative is that of one of them, and another one for changes to the other side")
                .help("cells that are a little longer along one axis have one size; wfl verify --gradient shows both sides");
        }
        Diagnostic::new(Code::W660, format!("the region `{place}` {kind}"))
            .at_or_note(*span, "the derivative is that of its cells and faces as they are")
            .help("a condition that moves with the mesh keeps them: `x == L` for the end of a box `to [L,1]`")
    }

    /// A region that takes other members on a mesh that a parameter displaces a little.
    pub(super) fn of_region(name: &str, span: Span) -> Self {
        let kind = "takes other cells, faces or nodes where a parameter that moves the mesh changes";
        Self { place: name.to_owned(), span: Some(span), kind, time: f64::NAN, points: 0, of: 0, more: 0 }
    }

    /// Cells whose size has a kink; of how many.
    pub(super) fn of_sizes(points: usize, of: usize) -> Self {
        let kind = "have several smallest extents, which parameters change differently";
        Self { place: "element_size".to_owned(), span: None, kind, time: f64::NAN, points, of, more: 0 }
    }
}

/// Adds what is found at a step, going backwards, to what is known of later ones.
pub(super) fn join(known: &mut Vec<NearKink>, found: impl IntoIterator<Item = NearKink>) {
    for near in found {
        match known.iter_mut().find(|k| k.place == near.place && k.kind == near.kind) {
            // two results of one measure
            Some(later) if later.time.to_bits() == near.time.to_bits() => {}
            Some(later) => *later = NearKink { more: later.more + 1, ..near },
            None => known.push(near),
        }
    }
}

/// The kinks of the equations of a scene, of its states, and of results.
pub(super) struct Kinks {
    list: Vec<Kink>,
}

struct Kink {
    place: String,
    span: Option<Span>,
    /// The measure, for a kink of a result.
    measure: Option<usize>,
    kinds: Vec<KinkKind>,
    value: Value,
    sampled: Sampled,
    motion: Option<Motion>,
}

/// What the sides of the kinks of a law move by.
struct Motion {
    /// By kink how many pairs.
    pairs: Vec<usize>,
    value: Value,
    sampled: Sampled,
}

/// What a kink belongs to.
type Owner = (String, Option<Span>, Option<usize>);

impl Kinks {
    pub(super) fn new(
        extended: &Extended<'_>,
        script: &ResolvedScript,
        measures: impl Iterator<Item = usize>,
        backend: &dyn KernelBackend,
    ) -> Result<Self, Box<Diagnostic>> {
        let (scene, env) = (extended.scene, extended.env());
        let mut found: Vec<(Owner, &Arc<Domain>, Option<KinkSides>)> = Vec::new();
        for (summary, term) in scene.terms.iter().zip(&scene.system.terms).filter(|(_, t)| !t.law.kinks.is_empty()) {
            let (domain, name) = (&term.integrator.domain, &term.law.name);
            let place = extended.place(domain, term.law.listing.graph.mapping);
            let Some(source) = scene.source_of(script, summary.origin) else {
                return Err(not_made(&format!("the text of `{name}` is not at hand")));
            };
            let sides = compile_term_kink_sides(&env, &place, name, source, extended.companions_on(domain));
            found.push(((name.clone(), scene.place_of_term(name), None), domain, sides));
        }
        for state in &scene.states {
            let name = &scene.system.fields[state.field].name;
            if let (Some((value, sampled)), Some(update)) = (state.at_points(), update_of(script, name)) {
                let domain = &sampled.domain;
                let place = extended.place(domain, value.law.mapping);
                let companions = Some(extended.companions_on(domain));
                let sides = compile_value_kink_sides(&env, &place, name, update, companions);
                found.push(((name.clone(), scene.place_of_field(name), None), domain, sides));
            }
        }
        for k in measures.collect::<BTreeSet<usize>>() {
            let (measure, declared) = extended.measures[k];
            for (value, sampled) in measure.at_points().map_or(&[][..], |(_, parts)| parts) {
                let domain = &sampled.domain;
                let place = extended.place(domain, value.law.mapping);
                let companions = Some(extended.companions_on(domain));
                let sides = compile_value_kink_sides(&env, &place, &measure.name, &declared.expr, companions);
                found.push(((measure.name.clone(), Some(measure.span), Some(k)), domain, sides));
            }
        }
        let with_kinks = found.into_iter().filter_map(|(owner, domain, sides)| Some((owner, domain, sides?)));
        let list = with_kinks.map(|(owner, domain, sides)| Kink::new(extended, owner, domain, sides, backend));
        Ok(Self { list: list.collect::<Result<_, _>>()? })
    }

    /// The points between two branches at a state: of equations and states, or of a measure.
    pub(super) fn near(
        &self,
        solving: &Solving<'_>,
        extended: &Extended<'_>,
        u: &[f64],
        step: Window,
        measure: Option<usize>,
    ) -> Vec<NearKink> {
        let wanted: Vec<&Kink> = self.list.iter().filter(|kink| kink.measure == measure).collect();
        if wanted.is_empty() {
            return Vec::new();
        }
        let values = solving.system.values(u);
        let state = Beside::new(extended, &values, 0.0);
        wanted.into_iter().flat_map(|kink| kink.near(extended, &state, step)).collect()
    }
}

impl Kink {
    fn new(
        extended: &Extended<'_>,
        owner: Owner,
        domain: &Arc<Domain>,
        sides: KinkSides,
        backend: &dyn KernelBackend,
    ) -> Result<Self, Box<Diagnostic>> {
        let bound = |law: ValueLaw| -> Result<(Value, Sampled), Box<Diagnostic>> {
            let value = Value::new(law, backend).map_err(|e| not_made(&e.to_string()))?;
            let sampled = value.bind(&extended.scene.system.mesh, Arc::clone(domain), &extended.fields);
            Ok((value, sampled.map_err(|e| not_made(&e.to_string()))?))
        };
        let ((place, span, measure), KinkSides { law, kinds, motion }) = (owner, sides);
        let (value, sampled) = bound(law)?;
        let motion = match motion {
            Some(motion) => {
                let (value, sampled) = bound(motion.law)?;
                Some(Motion { pairs: motion.pairs, value, sampled })
            }
            None => None,
        };
        Ok(Self { place, span, measure, kinds, value, sampled, motion })
    }

    fn near(&self, extended: &Extended<'_>, state: &Beside<'_>, step: Window) -> Vec<NearKink> {
        let n = self.kinds.len();
        let points = state.sample(extended, (&self.value, &self.sampled), step);
        let at = |point: &[f64], k: usize| [point[3 * k], point[3 * k + 1]];
        let scale = |k: usize| points.chunks_exact(3 * n).map(|p| p[3 * k + 2]).fold(0.0, f64::max);
        let scales: Vec<f64> = (0..n).map(scale).collect();
        let is_near = |point: &[f64], k: usize| {
            let [a, b] = at(point, k);
            // where nothing presses there is no friction, whatever the radius is; what does not move there either is
            // at the tip of the cone, and its tangent that of stick
            let counts = self.kinds[k] == KinkKind::Select || b > NEAR * scales[k] || (a == 0.0 && b == 0.0);
            counts && (a - b).abs() <= NEAR * scales[k]
        };
        let mut near: Vec<bool> = points
            .chunks_exact(3 * n)
            .flat_map(|point| (0..n).map(|k| is_near(point, k)).collect::<Vec<_>>())
            .collect();
        if near.contains(&true) {
            self.keep_those_that_move(extended, state.state, step, &mut near);
        }
        let mut out = Vec::new();
        for (kind, text) in TEXTS {
            let is_told = |point: &&[bool]| (0..n).any(|k| self.kinds[k] == kind && point[k]);
            let told = near.chunks_exact(n).filter(is_told).count();
            if told > 0 {
                let of = points.len() / (3 * n);
                let (place, span) = (self.place.clone(), self.span);
                out.push(NearKink { place, span, kind: text, time: step.stage, points: told, of, more: 0 });
            }
        }
        out
    }

    /// Takes out kinks whose sides stay one number whatever moves; `near` is by point and kink.
    fn keep_those_that_move(&self, extended: &Extended<'_>, values: &StateValues<'_>, step: Window, near: &mut [bool]) {
        let Some(motion) = &self.motion else { return };
        let n_pairs: usize = motion.pairs.iter().sum();
        let mut moves = vec![false; near.len()];
        for by in [BESIDE, -BESIDE] {
            let law = (&motion.value, &motion.sampled);
            let points = Beside::new(extended, values, by).sample(extended, law, step);
            if points.len() * self.kinds.len() != near.len() * 3 * n_pairs {
                return;
            }
            let mut pairs = points.chunks_exact(3);
            for (k, moves) in moves.iter_mut().enumerate() {
                for pair in pairs.by_ref().take(motion.pairs[k % self.kinds.len()]) {
                    let by = (pair[0] - pair[1]).abs();
                    // what is no number is not known to stand still
                    *moves |= by > STILL * pair[2] || by.is_nan() || pair[2].is_nan();
                }
            }
        }
        near.iter_mut().zip(moves).for_each(|(near, moves)| *near &= moves);
    }
}

/// Values of all fields beside a state, and a direction in which everything moves: fields, what they were, parameters, the
/// mesh. No two numbers of it are alike, so that what cancels along it cancels along every direction.
struct Beside<'v> {
    current: Vec<Vec<f64>>,
    previous: Vec<Vec<f64>>,
    moved: [Vec<Vec<f64>>; 2],
    live: Vec<f64>,
    state: &'v StateValues<'v>,
}

impl<'v> Beside<'v> {
    /// The state plus so many parts of the largest value of each field in that direction.
    fn new(extended: &Extended<'_>, state: &'v StateValues<'v>, by: f64) -> Self {
        let mut numbers = Numbers(0);
        let mut along = |fields: &[&[f64]]| -> Vec<Vec<f64>> {
            let of = |field: &&[f64]| {
                let size = largest(field.iter().copied());
                let size = if size > 0.0 && size.is_finite() { size } else { 1.0 };
                field.iter().map(|_| size * numbers.next()).collect()
            };
            fields.iter().map(of).collect()
        };
        let moved = [along(&state.current), along(&state.previous)];
        let beside = |fields: &[&[f64]], moved: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let of = |(field, moved): (&&[f64], &Vec<f64>)| field.iter().zip(moved).map(|(x, d)| x + by * d).collect();
            fields.iter().zip(moved).map(of).collect()
        };
        let (current, previous) = (beside(&state.current, &moved[0]), beside(&state.previous, &moved[1]));
        let live = extended.zeros().iter().map(|_| numbers.next()).collect();
        Self { current, previous, moved, live, state }
    }

    /// The values of a law, point by point.
    fn sample(&self, extended: &Extended<'_>, law: (&Value, &Sampled), step: Window) -> Vec<f64> {
        let current = extended.with_directions(&slices(&self.current), slices(&self.moved[0]), &self.live);
        // a scene that reads nothing of the past has none
        let previous = match slices(&self.previous) {
            own if own.is_empty() => Vec::new(),
            own => extended.with_directions(&own, slices(&self.moved[1]), &self.live),
        };
        let values = FieldValues { current: &current, previous: &previous, ..self.state.view() };
        let (value, sampled) = law;
        let value = value.at_step(values.with_present_rates(step));
        let mut points = Vec::new();
        value.for_each_point(&extended.scene.system.mesh, sampled, values, |_, _, _, _, v| points.extend_from_slice(v));
        points
    }
}

fn slices(fields: &[Vec<f64>]) -> Vec<&[f64]> {
    fields.iter().map(Vec::as_slice).collect()
}

/// Numbers between a half and three halves that nothing relates (splitmix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let bits = u32::try_from((z ^ (z >> 31)) >> 32).unwrap_or(0);
        0.5 + f64::from(bits) / f64::from(u32::MAX)
    }
}

/// What points do at a kink of each kind.
const TEXTS: [(KinkKind, &str); 2] = [
    (KinkKind::Select, "are between two branches (open and in contact, as a rule)"),
    (KinkKind::Ball, "are between stick and slip"),
];
