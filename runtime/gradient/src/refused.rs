//! What has no derivative, or none yet, each with its place and what to do.

use wfl::{
    Code, Diagnostic, ResolvedScript, Span,
    ast::{BoxDivision, Expr, MappingKind, MeshSource, OptionItem, OptionValue, Placing, QuadratureRule, RegionExpr},
    each_word, is_auto,
};
use wfl_discrete::system::FIXED;
use wfl_newton::Stop;
use wfl_problem::{Scene, place_of_moving};

use super::{Differentiated, Request, extended::Live, request::known, velocities::each_moving_place};

/// The code of what has no derivative.
pub const NO_DERIVATIVE: Code = Code::E470;

pub(super) fn message(text: impl Into<String>) -> Diagnostic {
    Diagnostic::new(NO_DERIVATIVE, text)
}

/// The first error.
pub(super) fn first(diagnostics: Vec<Diagnostic>) -> Option<Diagnostic> {
    diagnostics.into_iter().find(Diagnostic::is_error)
}

/// A law that the compiler does not differentiate, with its reason.
pub(super) fn no_derivative(what: &str, why: Option<Diagnostic>) -> Box<Diagnostic> {
    let mut d = message(format!("`{what}` has no derivative that can be computed"));
    if let Some(why) = why {
        d.labels = why.labels;
        d = d.note(why.message);
    }
    Box::new(d.help("a parameter that sizes, indices or choices are made of is no number that can change a little"))
}

/// A fault on the way.
pub(super) fn not_made(why: &str) -> Box<Diagnostic> {
    Box::new(message("the derivatives could not be computed").note(why))
}

/// A tangent (`which`) that is not that of the laws, by so large a part.
pub(super) fn apart(time: f64, which: &str, by: f64) -> Box<Diagnostic> {
    not_made(&format!("at t = {time} the {which} and the derivatives of the laws differ by {by:.1e}"))
}

/// No choice of branches solves the equations to one side.
pub(super) fn no_side(time: f64) -> Box<Diagnostic> {
    let d = message(format!(
        "at t = {time} points are between two branches, and no choice of them was found that the unknowns lead to: no derivative \
         to this side"
    ));
    Box::new(d.help("differences of whole runs show what happens: wfl verify --gradient"))
}

/// A number made of measures that is between two branches itself.
pub(super) fn number_between(name: &str, span: Option<Span>) -> Box<Diagnostic> {
    let d = message(format!("`{name}` is between two branches of its own: it has no derivative to one side yet"));
    Box::new(placed(d, span).help("the measures that it is made of have one"))
}

/// A direction of another size than what it moves.
pub(super) fn other_size(name: &str, given: usize, wanted: usize) -> Result<(), Box<Diagnostic>> {
    if given == wanted {
        return Ok(());
    }
    let d = message(format!("a direction has {given} numbers for `{name}`, which has {wanted}"));
    Err(Box::new(d.help("a number for each entry of a parameter, or for each component of each node of a data field")))
}

/// A result over steps where measures at all steps are wanted.
pub(super) fn no_whole_measure(name: &str) -> Box<Diagnostic> {
    let d = message(format!("`{name}` is a result over steps: a Jacobian has its measure at all steps"));
    Box::new(d.help("the name of the measure alone; sums over steps are sums over the rows"))
}

/// No such measure.
pub(super) fn no_result(script: &ResolvedScript, name: &str) -> Box<Diagnostic> {
    let measures = script.measures.iter().map(|m| m.name.name.as_str());
    let names: Vec<&str> = measures.chain(script.computed.iter().map(|c| c.name.name.as_str())).collect();
    let help = match script.energies().iter().any(|e| e == name) {
        true => "the balance of energy has no derivatives yet: a measure of the energy itself has them".to_owned(),
        false => known(name, &names, "measure"),
    };
    Box::new(message(format!("`{name}` is no measure that can be differentiated")).help(help))
}

/// A measure whose derivative is zero wherever it has one.
pub(super) fn flat(name: &str, span: Span) -> Box<Diagnostic> {
    let d = message(format!("`{name}` jumps and does not slide: its derivative is zero wherever it has one"));
    let d = d.at(span, "a share or a count of points");
    Box::new(
        d.help("an integral or a mean of what the condition compares changes smoothly: mean(pos_part(slip - limit))"),
    )
}

/// A measure that is a part of a balance.
pub(super) fn of_balance(name: &str, span: Span) -> Box<Diagnostic> {
    let d = message(format!("`{name}` is a part of a balance, which has no derivative yet")).at(span, "");
    Box::new(d.help("`reaction(p)` has one: what flows out where values are prescribed"))
}

/// A reaction where equations stand within a step.
pub(super) fn within(name: &str, span: Span) -> Box<Diagnostic> {
    let d = message(format!(
        "`{name}` is a reaction at the end of a step whose equations stand before it: it has no derivative yet"
    ));
    Box::new(
        d.at(span, "")
            .help("the integral of a traction over the faces has one; so has the reaction under `scheme newmark`"),
    )
}

/// Whether a run can be differentiated with what else was asked of it; why not, in words and with the place of what does not
/// go with it.
#[must_use]
pub fn not_together(scene: &Scene, script: &ResolvedScript) -> Option<Diagnostic> {
    let steps = || script.scheme.as_ref().map(|s| s.span).or(script.steps.as_ref().map(|s| s.span));
    let system = &scene.system;
    if !system.team().is_alone() {
        let d = message("several ranks have no derivatives yet").help("run it without mpirun");
        return Some(placed(d, steps()));
    }
    let turned = || !system.numbering.frames.list().is_empty() || system.numbering.has_ties();
    if scene.explicit.is_some() && turned() {
        let d =
            message("explicit steps with inclined supports, or with nodes that follow others, have no derivatives yet");
        return Some(placed(d.help("`scheme newmark` has them"), steps()));
    }
    if scene.explicit.as_ref().is_some_and(|explicit| explicit.lumped.couples) {
        let d = message("explicit steps whose dashpots act between components or fields have no derivatives yet");
        return Some(placed(d.help("`scheme newmark` has them"), steps()));
    }
    if system.redistribution().is_some() {
        let d = message("nodes without mass have no derivatives yet");
        let d = d.help("without `massless`, every scheme has them; differences of whole runs: wfl sweep");
        return Some(placed(d, steps()));
    }
    if let Some(d) = without_rate(scene, script) {
        return Some(d);
    }
    if system.has_moving_images() {
        let d = message("images that follow the bodies have no derivatives yet");
        let d = d.help("differences of whole runs do for a mapping `moving with u`: wfl sweep");
        return Some(placed(d, place_of_moving(script)));
    }
    None
}

/// Where the rates at the start count, a field that is solved for there and has none.
fn without_rate(scene: &Scene, script: &ResolvedScript) -> Option<Diagnostic> {
    let system = &scene.system;
    let rates = system.rates().filter(|r| r.are_read_at_start(scene.steps.are_listed()))?;
    let is_without = |k: &usize| {
        let is_free = |d: usize| system.numbering.free[d] != FIXED;
        let has_rates = rates.fields().iter().any(|of| of.field == *k);
        !has_rates && system.range(*k).is_some_and(|mut range| range.any(is_free))
    };
    let name = &system.fields[(0..system.fields.len()).find(is_without)?].name;
    let d = message(format!(
        "`{name}` has no rate, and the rates where time starts depend on it: no derivative follows that yet"
    ));
    let d = d.help("contact as a penalty or by Nitsche's method; differences of whole runs: wfl sweep");
    Some(placed(d, script.fields.iter().find(|f| f.name.name == *name).map(|f| f.span)))
}

fn placed(d: Diagnostic, at: Option<Span>) -> Diagnostic {
    match at {
        Some(span) => d.at(span, ""),
        None => d,
    }
}

/// A mapping in a scene whose mesh moves.
pub(super) fn of_mapping(name: &str, span: Option<Span>) -> Box<Diagnostic> {
    let d = message(format!("`{name}` moves the mesh, and images of a mapping do not follow that yet"));
    let d = d.help("`interface` where the meshes meet; differences of whole runs do for mappings: wfl sweep");
    Box::new(placed(d, span))
}

/// Nodes that follow others along axes of their own on a mesh that moves.
pub(super) fn of_ties(name: &str) -> Box<Diagnostic> {
    let d = message(format!(
        "`{name}` moves the mesh, and nodes that follow others along inclined axes have no derivatives there yet"
    ));
    Box::new(d.help("differences of whole runs: wfl sweep"))
}

/// Edges between faces of a mesh that moves: unknowns along them, and the sizes of their faces.
pub(super) fn of_edges(name: &str, why: &str, place: Option<(&str, Span)>) -> Box<Diagnostic> {
    let of = place.map_or_else(String::new, |(of, _)| format!(" of `{of}`"));
    let d = message(format!("`{name}` moves the mesh, and edges{of} have no derivative there yet: {why}"));
    let d = match place {
        Some((_, span)) => d.at(span, ""),
        None => d,
    };
    Box::new(d.help("differences of whole runs: wfl sweep"))
}

/// A normal displacement that is prescribed on faces whose normals turn.
pub(super) fn of_turning_support(name: &str, span: Span) -> Box<Diagnostic> {
    let d = message(format!("`{name}` turns the normals of this support: that has no derivative yet")).at(span, "");
    Box::new(d.help("a penalty or a multiplier for u.Normal follows them; differences of whole runs: wfl sweep"))
}

/// A nodal rule on faces that are or become no parallelograms.
pub(super) fn of_nodal_faces(name: &str, place: (&str, Span)) -> Box<Diagnostic> {
    let (of, span) = place;
    let d = message(format!(
        "`{name}` moves the faces of `{of}`, which bend and have their points at nodes: that has no derivative yet"
    ));
    Box::new(d.at(span, "").help("a rule of Gauss: `quadrature R degree=2`; differences of whole runs: wfl sweep"))
}

/// First values of a state that are others at other places, on a mesh that moves.
pub(super) fn of_points(name: &str, span: Span) -> Box<Diagnostic> {
    let d = message(format!("`{name}` begins with other values at other places, and parameters move those"));
    Box::new(d.at(span, "").help("a data field with this formula, from which the state begins"))
}

/// A measure through a mapping on a mesh that moves.
pub(super) fn of_mapped_measure(name: &str, span: Span) -> Box<Diagnostic> {
    let d = message(format!("`{name}` reads through a mapping, which does not follow a mesh that parameters move yet"));
    Box::new(d.at(span, "").help("differences of whole runs: wfl sweep"))
}

/// Refuses parameters in what multiplies the unknown of a reaction.
pub(super) fn not_in_weights(reaction: &Expr, live: &[&str]) -> Result<(), Box<Diagnostic>> {
    let mut found = None;
    each_word(reaction, &mut |at, word| {
        if live.contains(&word) {
            found.get_or_insert((at.span, word.to_owned()));
        }
    });
    let Some((span, name)) = found else { return Ok(()) };
    let d = message(format!("`{name}` multiplies what a reaction adds up: there it has no derivative yet"));
    let help = match name.as_str() {
        "x" | "y" | "z" | "X" => "the mesh moves, and the lever with it: differences of whole runs (wfl sweep)",
        _ => "the reaction without the factor: its derivative times the factor is the same",
    };
    Err(Box::new(d.at(span, "").help(help)))
}

/// Refuses what the derivatives of a run do not follow.
pub(super) fn check(of: Differentiated<'_>, request: &Request) -> Result<(), Box<Diagnostic>> {
    let is_bad = |s: &&wfl_run::StepResult| !s.history.converged() && s.history.stop != Some(Stop::Given);
    if let Some(step) = of.outcome.steps.iter().find(is_bad) {
        return Err(Box::new(message(format!(
            "the step at t = {} did not converge: it has no derivative",
            step.window.end
        ))));
    }
    without_run(of.scene, of.script, request)
}

/// The same of what is known without a run.
pub(super) fn without_run(scene: &Scene, script: &ResolvedScript, request: &Request) -> Result<(), Box<Diagnostic>> {
    if let Some(d) = not_together(scene, script) {
        return Err(Box::new(d));
    }
    let is_asked = |p: &&wfl::Param| is_auto(&p.value) && request.parameters.contains(&p.name.name);
    if let Some(param) = script.params.iter().find(is_asked) {
        let d = message(format!("`{}` is found by the run: derivatives do not follow that", param.name.name));
        let value = scene.params.iter().find(|p| p.0 == param.name.name).and_then(|p| p.1.values.first().copied());
        let shown = value.map_or_else(String::new, |v| format!("; this run found {v}"));
        return Err(Box::new(d.at(param.value.span, "").help(format!("write the number in place of `auto`{shown}"))));
    }
    if let Some(state) = scene.states.iter().find(|s| s.at_points().is_none()) {
        let name = &scene.system.fields[state.field].name;
        let d = message(format!("the state `{name}` is renewed through a mapping: it has no derivative yet"));
        let span = script.fields.iter().find(|f| f.name.name == *name).map(|f| f.span);
        return Err(Box::new(match span {
            Some(span) => d.at(span, "").help("a state without a mapping, or differences of whole runs"),
            None => d,
        }));
    }
    fields(script, request)
}

/// Data fields that are differentiated in.
fn fields(script: &ResolvedScript, request: &Request) -> Result<(), Box<Diagnostic>> {
    let data: Vec<&str> = script
        .fields
        .iter()
        .filter(|f| matches!(f.kind, wfl::FieldKind::Data { .. }))
        .map(|f| f.name.name.as_str())
        .collect();
    match request.fields.iter().find(|name| !data.contains(&name.as_str())) {
        Some(name) => {
            Err(Box::new(message(format!("`{name}` is no data field")).help(known(name, &data, "data field"))))
        }
        None => Ok(()),
    }
}

/// Refuses parameters that stand where no derivative follows them: division of the mesh, regions that do not move with it,
/// mappings, steps, options.
pub(super) fn places(script: &ResolvedScript, live: &[Live]) -> Result<(), Box<Diagnostic>> {
    let mut found: Option<(Span, String, &'static str, &'static str)> = None;
    // a region whose condition moves with the mesh keeps its members, which is looked at
    let root = |l: &Live| l.made_of.clone().unwrap_or_else(|| l.name.clone());
    let mut movers: Vec<String> = Vec::new();
    each_moving_place(script, &mut |e| {
        each_word(e, &mut |_, word| movers.extend(live.iter().filter(|l| l.name == word).map(root)));
    });
    each_fixed_place(script, &mut |e, what, help| {
        each_word(e, &mut |at, word| {
            let is_followed = |l: &Live| what == REGION && movers.contains(&root(l));
            if found.is_none() && live.iter().any(|l| l.name == word && !is_followed(l)) {
                found = Some((at.span, word.to_owned(), what, help));
            }
        });
    });
    match found {
        None => Ok(()),
        Some((span, name, what, help)) => {
            let asked = live.iter().find(|l| l.name == name).and_then(|l| l.made_of.as_ref());
            let d = match asked {
                Some(asked) => message(format!(
                    "`{asked}` stands in {what} by `{name}`, which is made of it: there it has no derivative yet"
                )),
                None => message(format!("`{name}` stands in {what}: there it has no derivative yet")),
            };
            Err(Box::new(d.at(span, "").help(help)))
        }
    }
}

const REGION: &str = "a region";
const OF_SHAPE: &str = "differences of whole runs show what it changes: wfl sweep";
const OF_REGION: &str = "in a region of a mesh that moves with it, it has one; differences of whole runs: wfl sweep";
const OF_STEPS: &str = "a load that grows with the step variable has a factor of its own: give that a param";
const OF_OPTION: &str = "give the option a number, so that the parameter changes the equations alone";

/// Calls `f` for every expression that no derivative follows, with where it stands and what to do.
fn each_fixed_place<'s>(script: &'s ResolvedScript, f: &mut dyn FnMut(&'s Expr, &'static str, &'static str)) {
    if let Some(mesh) = &script.mesh {
        match &mesh.source {
            MeshSource::Box { division: BoxDivision::Cells(d) | BoxDivision::Size(d), .. } => {
                f(d, "the division of the mesh", OF_SHAPE);
            }
            MeshSource::Files(files) if files.len() > 1 => {
                mesh.source.placing().for_each(|e| f(e, "the place of one of several mesh files", OF_SHAPE));
            }
            MeshSource::Files(files) => {
                for step in files.iter().flat_map(|file| &file.placed) {
                    if let Placing::Turned(_, Some(axis)) = step {
                        f(axis, "the axis of a turn", OF_SHAPE);
                    }
                }
            }
        }
        options(&mesh.options, f);
    }
    for refinement in &script.refinements {
        refinement.what.condition.iter().for_each(|c| wfl::cond_children(c, &mut |e| f(e, "`refine`", OF_SHAPE)));
        refinement.what.times.iter().for_each(|e| f(e, "`refine`", OF_SHAPE));
    }
    script.regions.iter().for_each(|r| region(&r.region, f));
    for mapping in &script.mappings {
        match &mapping.kind {
            MappingKind::Search { within, .. } => within.iter().for_each(|e| f(e, "a mapping", OF_SHAPE)),
            MappingKind::Point(e) => f(e, "a mapping", OF_SHAPE),
        }
        options(&mapping.options, f);
    }
    if let Some(steps) = &script.steps {
        [&steps.from, &steps.to, &steps.by].into_iter().for_each(|e| f(e, "`steps`", OF_STEPS));
        options(&steps.options, f);
        steps.watched.iter().for_each(|m| f(&m.expr, "the limit of the increment", OF_STEPS));
    }
    script.solver.iter().for_each(|s| options(&s.options, f));
    script.scheme.iter().for_each(|s| options(&s.options, f));
    for quadrature in &script.quadratures {
        if let QuadratureRule::Degree(e) = &quadrature.rule {
            f(e, "`quadrature`", OF_OPTION);
        }
    }
    for result in script.gradients.iter().flat_map(|g| &g.results) {
        if let wfl::ast::AtSteps::At(_, e) = &result.at {
            f(e, "the value of the step variable that a result is taken at", OF_STEPS);
        }
    }
}

fn region<'s>(of: &'s RegionExpr, f: &mut dyn FnMut(&'s Expr, &'static str, &'static str)) {
    match of {
        RegionExpr::Name(_) | RegionExpr::Interface { .. } => {}
        RegionExpr::Along { towards, .. } => towards.iter().for_each(|e| f(e, REGION, OF_REGION)),
        RegionExpr::Picked { condition, .. } => {
            condition.iter().for_each(|c| wfl::cond_children(c, &mut |e| f(e, REGION, OF_REGION)));
        }
        RegionExpr::Combine(first, rest) => {
            region(first, f);
            rest.iter().for_each(|(_, part)| region(part, f));
        }
    }
}

fn options<'s>(list: &'s [OptionItem], f: &mut dyn FnMut(&'s Expr, &'static str, &'static str)) {
    for option in list {
        if let Some(OptionValue::Expr(e)) = &option.value {
            f(e, "an option", OF_OPTION);
        }
    }
}
