//! `scheme explicit`: the mass on the diagonal, the longest stable step, and the steps that follow from it; and what
//! `scheme ... energy` asks for.
//!
//! Both are found at the state where time starts, before the run. Promises: a step that is not stable at the start is an
//! error with the limit; the scene is left as it was.

use std::sync::Arc;

use wfl::{Code, Diagnostic, ResolvedScript, Span};
use wfl_compiler::{Class, types::InputSlot};
use wfl_discrete::{
    longest_step::StepLimit,
    lumped::{Lumped, Unlumped},
    window::Window,
};

use super::{Given, Scene, Steps, options::Equal};

/// The mass of a scene on the diagonal.
#[derive(Clone, Debug, Default)]
pub struct Explicit {
    /// Mass and damping.
    pub lumped: Lumped,
    /// The longest stable increment at the start.
    pub limit: StepLimit,
}

impl Explicit {
    /// What is told of the solver.
    #[must_use]
    pub fn describe(&self, steps: &Steps) -> String {
        let h = steps.first_increment();
        let limit = self.limit.step;
        if limit.is_finite() {
            let part = h.abs() / limit;
            return format!(
                "central differences, lumped mass; steps of {h:.3e}, {part:.2} of the stability limit {limit:.3e}"
            );
        }
        format!("central differences, lumped mass; steps of {h:.3e}, nothing has stiffness")
    }
}

/// What a scene asks of its energy.
#[derive(Clone, Debug, PartialEq)]
pub struct Energy {
    /// The part that may be lost, of the largest energy of the run.
    pub limit: f64,
    /// The terms that have a measure of their own: those that are more than inertia, by name.
    pub terms: Vec<String>,
}

impl Energy {
    /// Of a script with this limit.
    pub(super) fn new(script: &ResolvedScript, limit: f64) -> Self {
        Self { limit, terms: script.terms_with_energy() }
    }

    /// The names of its measures: kinetic energy, work that terms have taken up, work of loads and of prescribed values,
    /// what is lost.
    #[must_use]
    pub fn measures(&self) -> Vec<String> {
        ResolvedScript::energies_of(&self.terms)
    }

    /// Whether a law belongs to the statement of a term: on several regions each has the region behind its name.
    #[must_use]
    pub fn is_of(term: &str, law: &str) -> bool {
        law.strip_prefix(term).is_some_and(|rest| rest.is_empty() || rest.starts_with(" on "))
    }
}

/// Most steps by `auto` of a scene that names none.
const MOST_STEPS: f64 = 1e5;
/// A whole number of steps that rounding has made a little larger.
const ROUNDING: f64 = 1e-9;

/// Finds mass and limit of a scene, and the steps of one that leaves them to the program.
pub(super) fn finish(scene: &mut Scene, script: &ResolvedScript, fraction: f64) -> Result<(), Box<Diagnostic>> {
    let Some(statement) = &script.scheme else { return Ok(()) };
    let at = statement.name.span;
    if let Some(field) = given_by_the_caller(scene) {
        let d = Diagnostic::new(
            Code::E457,
            format!("the caller gives `{field}`, and explicit steps need it before the run"),
        );
        return Err(d
            .at(at, "mass and stability limit are computed first")
            .help("scheme newmark beta=1/4 gamma=1/2")
            .into());
    }
    if scene.system.has_moving_images() {
        let d = Diagnostic::new(Code::E802, "explicit steps with a mapping that moves are not available yet");
        let text = "the longest stable step would change as bodies slide";
        return Err(d.at(at, text).help("scheme newmark beta=1/4 gamma=1/2").into());
    }
    let found = at_start(scene);
    let (lumped, limit) = found.map_err(|why| Box::new(unlumped(scene, script, at, why)))?;
    let steps = script.steps.as_ref();
    if let (Some(auto), Some(statement)) = (scene.steps.auto.take(), steps) {
        let foreign = statement.options.iter().find(|o| o.name.name != "most");
        if let Some(option) = foreign {
            let d = Diagnostic::new(Code::E414, format!("option `{}` is not understood here", option.name.name));
            let text = "explicit steps by `auto` are equal: most=1e-3 is the largest increment";
            return Err(d.at(option.name.span, text).into());
        }
        let values = equal_steps(scene, statement, auto.most.min(fraction * limit.step))?;
        #[expect(clippy::cast_precision_loss, reason = "bounded where they are made")]
        let by = (scene.steps.last() - scene.steps.first()) / (values.len() - 1) as f64;
        (scene.steps.values, scene.steps.equal) = (values, Some(Equal { by, last: None }));
    }
    let longest = scene.steps.longest_increment();
    if longest > limit.step {
        let d = Diagnostic::new(
            Code::E456,
            format!("steps of {longest} are above the stability limit of explicit steps, {:.4e}", limit.step),
        );
        let span = steps.map_or(at, |s| s.by.span);
        let d = d.at(span, "").help(format!("by auto, or by {:.2e}", 0.9 * limit.step));
        return Err(steps.into_iter().fold(d, |d, s| d.replace(s.by.span, "auto")).into());
    }
    scene.explicit = Some(Arc::new(Explicit { lumped, limit }));
    Ok(())
}

/// The values of equal steps of at most this length.
fn equal_steps(scene: &Scene, statement: &wfl::Steps, longest: f64) -> Result<Vec<f64>, Box<Diagnostic>> {
    let (from, to) = (scene.steps.first(), scene.steps.last());
    let count = ((to - from) / longest - ROUNDING).ceil().max(1.0);
    if count > MOST_STEPS {
        let d = Diagnostic::new(
            Code::E430,
            format!("{count} explicit steps of {longest:.3e}, at most {MOST_STEPS} are made by auto"),
        );
        let help = format!("to allow them: steps ... by {longest:.2e} with most={}", (1.02 * count).ceil());
        return Err(d.at(statement.by.span, "").help(help).into());
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "bounded above"
    )]
    let mut values: Vec<f64> = (0..count as usize).map(|k| from + k as f64 / count * (to - from)).collect();
    values.push(to);
    Ok(values)
}

/// A known field that the caller gives and that mass or stiffness depend on.
fn given_by_the_caller(scene: &Scene) -> Option<String> {
    let reads = |field: usize| {
        let terms = scene.system.terms.iter().filter(|t| t.law.class > Class::Constant);
        let mut inputs = terms.flat_map(|t| &t.law.inputs);
        inputs.any(|slot| matches!(slot, InputSlot::Field(s) if s.field.index() == field))
    };
    let given = scene.data.iter().find(|(field, given)| matches!(given, Given::Caller(_)) && reads(*field));
    given.map(|(field, _)| scene.system.fields[*field].name.clone())
}

/// Instants over the run at which the limit of a linear scene whose matrix changes in time is looked at before it: a coefficient
/// that has its largest value between them is found while it runs (W621).
const INSTANTS: u32 = 16;

/// Mass at the state where time starts, and the limit there; of a linear scene the least one of the run.
fn at_start(scene: &Scene) -> Result<(Lumped, StepLimit), Unlumped> {
    let first = scene.steps.first_window();
    let mut equations = scene.equations();
    let mut solving = scene.solving(&mut equations);
    solving.set_data(first)?;
    let mut u = solving.start().map_err(Box::new)?;
    scene.prescribed.apply(first, &mut u).map_err(Box::new)?;
    let system = solving.system;
    system.end_step(&u);
    let lumped = Lumped::of(system, &u, first)?;
    let mut limit = lumped.longest_step(system, &u, first)?;
    if system.is_linear() && !system.linear_terms_stay() {
        let (from, to) = (scene.steps.first(), scene.steps.last());
        for k in 1..=INSTANTS {
            let time = from + f64::from(k) / f64::from(INSTANTS) * (to - from);
            let window = Window { end: time, stage: time, ..first };
            let mut solving = scene.solving(&mut equations);
            solving.set_data(window)?;
            let there = lumped.longest_step(solving.system, &u, window)?;
            let evaluations = limit.evaluations + there.evaluations;
            limit = StepLimit { step: limit.step.min(there.step), evaluations };
        }
        let mut solving = scene.solving(&mut equations);
        solving.set_data(first)?;
    }
    Ok((lumped, limit))
}

/// What is said of a scene whose mass cannot be lumped.
fn unlumped(scene: &Scene, script: &ResolvedScript, at: Span, why: Unlumped) -> Diagnostic {
    match why {
        Unlumped::NoInertia { field, multiplier } => {
            let declared = script.fields.iter().find(|f| f.name.name == field).map_or(at, |f| f.name.span);
            let (what, help) = if multiplier {
                (
                    format!("explicit steps solve no equations, such as that of the multiplier `{field}`"),
                    "contact as a penalty or by Nitsche's method, or scheme newmark",
                )
            } else {
                (format!("explicit steps need a mass of `{field}`"), "a term with its second rate, or scheme newmark")
            };
            let d = Diagnostic::new(Code::E457, what).at(declared, format!("no term has `Dot2_{field}`"));
            d.at(at, "").help(help)
        }
        Unlumped::Mixed { term } => {
            let span = scene.terms.get(term).map_or(at, |t| t.span);
            let d = Diagnostic::new(Code::E455, "this inertia is no mass that stays the same");
            let text = "what else depends on unknowns or on the step variable stands in the same term";
            d.at(span, text).help("write the inertia as a term of its own: rho*Dot2_u.Test_u")
        }
        Unlumped::Between { term } => {
            let span = scene.terms.get(term).map_or(at, |t| t.span);
            let d = Diagnostic::new(
                Code::E455,
                "this inertia acts from one place on another, and explicit steps have a mass of each dof",
            );
            let text = "second rates of gradients, or of both sides of a face: lumped, they would be gone";
            d.at(span, text).at(at, "").help("scheme newmark")
        }
        Unlumped::Coupled { field, on } => {
            let declared = script.fields.iter().find(|f| f.name.name == field).map_or(at, |f| f.name.span);
            let what = if on == field {
                format!("the inertia of one component of `{field}` acts on another one")
            } else {
                format!("the inertia of `{field}` acts on `{on}`")
            };
            let d = Diagnostic::new(Code::E455, what)
                .at(declared, "explicit steps have a mass of each dof, which acts on it alone");
            d.at(at, "").help("scheme newmark")
        }
        Unlumped::Mass { field, value, position } => {
            let d = Diagnostic::new(
                Code::E455,
                format!("the lumped mass of `{field}` is {value:.3e} at {}", wfl_discrete::finite::position(position)),
            );
            let declared = script.fields.iter().find(|f| f.name.name == field).map_or(at, |f| f.name.span);
            let d = d.at(declared, "explicit steps need a positive mass at every node");
            d.at(at, "").help("elements of degree 1, or quadrilaterals and hexahedra; and a density above 0 everywhere")
        }
        Unlumped::System(error) => {
            Diagnostic::new(Code::E455, format!("the mass cannot be computed: {error}")).at(at, "")
        }
    }
}
