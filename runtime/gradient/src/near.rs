//! Points between two branches: there a result has one derivative for each direction, and the adjoint gives that of one
//! side.

use std::collections::{BTreeMap, BTreeSet};

use wfl::{Code, Diagnostic, ResolvedScript, Span};
use wfl_compiler::{
    Constant, KinkKind, KinkSides, backend::KernelBackend, compile_kink_sides, compile_value_kink_sides,
};
use wfl_discrete::{
    assemble::FieldValues,
    value::{Sampled, Value},
    window::Window,
};
use wfl_problem::{Scene, Solving};

use super::{extended::Extended, laws::update_of, refused::not_made};

/// The two sides of a kink are one number within this part of the largest of them in the region.
pub(super) const NEAR: f64 = 1e-9;

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
}

impl Kinks {
    pub(super) fn new(
        extended: &Extended<'_>,
        script: &ResolvedScript,
        measures: impl Iterator<Item = usize>,
        backend: &dyn KernelBackend,
    ) -> Result<Self, Box<Diagnostic>> {
        let scene: &Scene = extended.scene;
        let params: BTreeMap<String, Constant> = scene.params.iter().cloned().collect();
        let env = scene.env_with(&scene.sigs, &params);
        let mut found = Vec::new();
        for term in scene.system.terms.iter().filter(|t| !t.law.kinks.is_empty()) {
            let domain = &term.integrator.domain;
            let place = extended.place(domain, term.law.listing.graph.mapping);
            let sides = compile_kink_sides(&env, &place, &term.law.name, &term.law.listing);
            let named = (term.law.name.clone(), scene.place_of_term(&term.law.name));
            found.push((named, None, domain, sides));
        }
        for state in &scene.states {
            let name = &scene.system.fields[state.field].name;
            if let (Some((value, sampled)), Some(update)) = (state.at_points(), update_of(script, name)) {
                let place = extended.place(&sampled.domain, value.law.mapping);
                let sides = compile_value_kink_sides(&env, &place, name, update);
                found.push(((name.clone(), scene.place_of_field(name)), None, &sampled.domain, sides));
            }
        }
        for k in measures.collect::<BTreeSet<usize>>() {
            let (measure, declared) = extended.measures[k];
            for (value, sampled) in measure.at_points().map_or(&[][..], |(_, parts)| parts) {
                let place = extended.place(&sampled.domain, value.law.mapping);
                let sides = compile_value_kink_sides(&env, &place, &measure.name, &declared.expr);
                found.push(((measure.name.clone(), Some(measure.span)), Some(k), &sampled.domain, sides));
            }
        }
        let mut list = Vec::new();
        for ((place, span), measure, domain, sides) in found {
            let Some(KinkSides { law, kinds }) = sides else { continue };
            let value = Value::new(law, backend).map_err(|e| not_made(&e.to_string()))?;
            let sampled = value.bind(&scene.system.mesh, domain.clone(), &scene.system.fields);
            let sampled = sampled.map_err(|e| not_made(&e.to_string()))?;
            list.push(Kink { place, span, measure, kinds, value, sampled });
        }
        Ok(Self { list })
    }

    /// The points between two branches at a state: of equations and states, or of a measure.
    pub(super) fn near(&self, solving: &Solving<'_>, u: &[f64], step: Window, measure: Option<usize>) -> Vec<NearKink> {
        let values = solving.system.values(u);
        let wanted = self.list.iter().filter(|kink| kink.measure == measure);
        wanted.flat_map(|kink| kink.near(solving, values.view(), step)).collect()
    }
}

impl Kink {
    fn near(&self, solving: &Solving<'_>, values: FieldValues<'_>, step: Window) -> Vec<NearKink> {
        let n = self.kinds.len();
        let mut points: Vec<f64> = Vec::new();
        let value = self.value.at_step(values.with_present_rates(step));
        value.for_each_point(&solving.system.mesh, &self.sampled, values, |_, _, _, _, v| points.extend_from_slice(v));
        let at = |point: &[f64], k: usize| [point[3 * k], point[3 * k + 1]];
        let scale = |k: usize| points.chunks_exact(3 * n).map(|p| p[3 * k + 2]).fold(0.0, f64::max);
        let scales: Vec<f64> = (0..n).map(scale).collect();
        let mut out = Vec::new();
        for (kind, text) in TEXTS {
            let is_near = |point: &&[f64]| {
                (0..n).filter(|k| self.kinds[*k] == kind).any(|k| {
                    let [a, b] = at(point, k);
                    // where nothing presses there is no friction, whatever the radius is; what does not move there either is
                    // at the tip of the cone, and its tangent that of stick
                    let counts = kind == KinkKind::Select || b > NEAR * scales[k] || (a == 0.0 && b == 0.0);
                    counts && (a - b).abs() <= NEAR * scales[k]
                })
            };
            let near = points.chunks_exact(3 * n).filter(is_near).count();
            if near > 0 {
                let of = points.len() / (3 * n);
                let (place, span) = (self.place.clone(), self.span);
                out.push(NearKink { place, span, kind: text, time: step.stage, points: near, of, more: 0 });
            }
        }
        out
    }
}

/// What points do at a kink of each kind.
const TEXTS: [(KinkKind, &str); 2] = [
    (KinkKind::Select, "are between two branches (open and in contact, as a rule)"),
    (KinkKind::Ball, "are between stick and slip"),
];
