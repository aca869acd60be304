//! Comparison of two solutions of one scene, quantity by quantity.
//!
//! Differences are relative, in norms over the points of the reference run: `L2` and `H1` of the unknowns on cells, the
//! outputs on contact faces (traction, slip, …) by name, measures of the last step by name. Unknowns of several kinds, such as
//! displacements and a pressure, have no common unit: the norm of the worst kind counts. A constant that is added to unknowns
//! makes no error smaller: the norm `L2` that an error is a part of is that of the unknowns beside their value nearest to
//! zero, by component: of what vanishes somewhere or changes its sign it is the norm itself, of temperatures between 293
//! and 313 that of the rise above 293. Outputs and measures are taken as they are written. Promises: a point that the
//! other mesh does not have is counted; with too many of them there is no number. Does not know which of two runs is
//! better.

use wfl::{
    FieldKind, Output, OutputQuantity, ResolvedScript, Span,
    ast::{Expr, ExprKind, Place},
};
use wfl_compiler::backend::KernelBackend;
use wfl_discrete::{
    assemble::TermError,
    field::{Field, FieldSpace},
    space::Support,
    system::{Branches, Form, System},
};
use wfl_problem::{Given, SampleAt, Samples, Scene, StateAt};
use wfl_run::Outcome;

/// Degree to which the norms are exact.
pub const NORM_DEGREE: usize = 5;
/// Unknowns that vary by less than this part of themselves are constant: solutions keep ten digits at least, and the error is one
/// of the constant.
const VARIES: f64 = 1e-9;
/// Most points that were not found, as a part of all.
const LOST_POINTS: f64 = 0.01;
/// What the name of a measure begins with where an output of the scene has the same name.
pub const MEASURE: &str = "measure ";
/// The name of the output that holds the exact solution of a scene.
pub const EXACT_OUTPUT: &str = "the exact solution";

/// A run that came to its end, with what is needed to take more from it.
pub struct Solved {
    /// The scene as it was run.
    pub script: ResolvedScript,
    /// The outputs of the scene, which were not made.
    pub outputs: Vec<Output>,
    /// The problem.
    pub scene: Scene,
    /// What the run gave.
    pub outcome: Outcome,
}

impl Solved {
    /// The place that expressions of no text are given: a scene that was solved has a mesh statement.
    #[must_use]
    pub fn scene_span(&self) -> Span {
        let main = self.script.main;
        self.script.mesh.as_ref().map_or(Span { source: main, start: 0, end: 0 }, |m| m.span)
    }

    /// The solution of the last step as first guesses of a run of the same scene on the same mesh.
    #[must_use]
    pub fn starts(&self) -> Vec<(usize, Given)> {
        let Some(StateAt { unknowns, .. }) = state(self) else { return Vec::new() };
        let system = &self.scene.system;
        let of = |(k, f): (usize, &Field)| {
            let first = system.numbering.starts[k]?;
            Some((k, Given::Values(unknowns[first..first + f.n_dofs()].to_vec())))
        };
        system.fields.iter().enumerate().filter_map(of).collect()
    }
}

/// Measures of the last step.
#[must_use]
pub fn measures(run: &Solved) -> Vec<(String, f64)> {
    run.outcome.steps.last().map(|s| s.measures.clone()).unwrap_or_default()
}

/// A name as an expression. Expressions of our own have the place of the mesh statement: they are in no text.
#[must_use]
pub fn name(run: &Solved, word: &str) -> Expr {
    let span = run.scene_span();
    Expr { kind: ExprKind::Name(word.to_owned()), span, expansion: None }
}

/// Names of the unknowns that live on cells.
pub fn unknowns(run: &Solved) -> impl Iterator<Item = &str> {
    let on_cells = |f: &&wfl::Field| {
        let on_cells = |s: &FieldSpace| matches!(s, FieldSpace::Nodal(n) if matches!(n.support(), Support::Cells(_)));
        let nodal = run.scene.system.fields.iter().any(|g| g.name == f.name.name && on_cells(&g.space));
        matches!(f.kind, FieldKind::Unknown) && !matches!(f.space.place, Place::Global(_)) && nodal
    };
    run.script.fields.iter().filter(on_cells).map(|f| f.name.name.as_str())
}

/// The quantities of the outputs of a scene.
pub fn items(run: &Solved) -> impl Iterator<Item = &OutputQuantity> {
    run.outputs.iter().filter(|o| o.format.name == "vtk" && o.file != EXACT_OUTPUT).flat_map(|o| &o.items)
}

/// The state of the last step.
fn state(run: &Solved) -> Option<StateAt<'_>> {
    run.outcome.steps.last().map(|s| StateAt {
        system: &run.outcome.equations.system,
        window: s.window,
        unknowns: &s.state,
    })
}

/// Unknowns, their gradients and the outputs on contact faces.
///
/// # Errors
/// The first message about an expression that has no value at the points.
pub fn sampled(run: &Solved, backend: &dyn KernelBackend, at: SampleAt<'_>) -> Result<Vec<Samples>, String> {
    sampled_if(run, backend, at, &|_| true)
}

/// The same for the quantities that `wanted` picks by name (`L2`, `H1`, outputs).
///
/// # Errors
/// The first message about an expression that has no value at the points.
pub fn sampled_if(
    run: &Solved,
    backend: &dyn KernelBackend,
    at: SampleAt<'_>,
    wanted: &dyn Fn(&str) -> bool,
) -> Result<Vec<Samples>, String> {
    let mut list = Vec::new();
    for field in unknowns(run) {
        list.push((format!("L2 {field}"), name(run, field)));
        list.push((format!("H1 {field}"), name(run, &format!("Grad_{field}"))));
    }
    list.extend(items(run).map(|i| (i.name.clone(), i.expr.clone())));
    list.retain(|(name, _)| wanted(quantity(name)));
    let mut samples = take(run, backend, &list, at)?;
    samples.retain(|s| is_norm(&s.name) || !s.home.starts_with("body"));
    let kinds = kinds(run)?;
    for sample in samples.iter_mut().filter(|s| is_norm(&s.name)) {
        let of = kinds.iter().find(|kind| kind.fields.iter().any(|field| sample.name[3..] == *field));
        (sample.kind, sample.vanishes) = of.map_or_else(Default::default, |k| (k.fields[0].clone(), k.vanishes));
        if let (true, Some(of)) = (sample.name.starts_with("L2 "), of) {
            sample.constant.clone_from(&of.constant);
        }
    }
    Ok(samples)
}

/// Unknowns on cells that share unit and size: displacements of bodies that meet.
pub(crate) struct Kind {
    /// Their names.
    pub(crate) fields: Vec<String>,
    /// They are what rounding leaves of zero.
    pub(crate) vanishes: bool,
    /// By component their value nearest to zero at the nodes: zero where they change their sign.
    pub(crate) constant: Vec<f64>,
}

/// The unknowns on cells by kind; whether one vanishes matters beside another alone.
///
/// # Errors
/// If the equations of the last step cannot be evaluated.
pub(crate) fn kinds(run: &Solved) -> Result<Vec<Kind>, String> {
    let system = &run.outcome.equations.system;
    let mut kinds: Vec<(usize, Kind)> = Vec::new();
    for field in unknowns(run) {
        let Some(k) = system.fields.iter().position(|f| f.name == field) else { continue };
        match kinds.iter_mut().find(|(first, _)| *first == system.alike(k)) {
            Some((_, kind)) => kind.fields.push(field.to_owned()),
            None => {
                let kind = Kind { fields: vec![field.to_owned()], vanishes: false, constant: Vec::new() };
                kinds.push((system.alike(k), kind));
            }
        }
    }
    for (_, kind) in &mut kinds {
        kind.constant = state(run).map_or_else(Vec::new, |last| nearest_to_zero(system, &kind.fields, last.unknowns));
    }
    if let (Some(last), true) = (state(run), kinds.len() > 1) {
        let told = |e: TermError| e.to_string();
        let residual = system.residual(last.unknowns, &Form::AS_WRITTEN).map_err(told)?;
        let mut tangent = system.new_tangent();
        system.tangent(last.unknowns, Branches::AsWritten, &mut tangent).map_err(told)?;
        for (first, kind) in &mut kinds {
            let is_own = |body: &usize| system.alike(system.field_of_body(*body)) == *first;
            let is_zero = |body| system.is_zero_but_for_rounding(last.unknowns, &residual, &tangent, body);
            kind.vanishes = (0..system.n_bodies()).filter(is_own).all(is_zero);
        }
    }
    Ok(kinds.into_iter().map(|(_, kind)| kind).collect())
}

/// By component the value nearest to zero between the smallest and the largest of some fields at their nodes; nothing where fields
/// have different numbers of components.
fn nearest_to_zero(system: &System, fields: &[String], u: &[f64]) -> Vec<f64> {
    let (mut ends, mut n_components): (Vec<[f64; 2]>, Option<usize>) = (Vec::new(), None);
    for (k, field) in system.fields.iter().enumerate().filter(|(_, f)| fields.contains(&f.name)) {
        let Some(range) = system.range(k) else { continue };
        let n = *n_components.get_or_insert(field.n_components);
        if n != field.n_components {
            return Vec::new();
        }
        ends.resize(n, [f64::INFINITY, f64::NEG_INFINITY]);
        for (i, x) in u[range].iter().enumerate() {
            let [low, high] = &mut ends[i % n];
            (*low, *high) = (low.min(*x), high.max(*x));
        }
    }
    ends.into_iter().map(|[low, high]| if low > 0.0 { low } else { high.min(0.0) }).collect()
}

/// A value of a field beside the constant that counts for nothing in its norm `L2`: the value nearest to zero of its kind, by component.
///
/// # Errors
/// If the equations of the last step cannot be evaluated.
pub fn beside_constant(run: &Solved, field: &str, value: &Expr) -> Result<Expr, String> {
    let constant = kinds(run)?.into_iter().find(|kind| kind.fields.iter().any(|own| own == field));
    Ok(constant.map_or_else(|| value.clone(), |kind| beside(run, value, &kind.constant)))
}

/// A value beside a constant, by component.
pub(crate) fn beside(run: &Solved, value: &Expr, constant: &[f64]) -> Expr {
    let like = |kind| Expr { kind, span: value.span, expansion: value.expansion };
    let number = |c: &f64| Expr { kind: ExprKind::Number(*c), span: run.scene_span(), expansion: None };
    let constant = match constant {
        _ if constant.iter().all(|c| *c == 0.0) => return value.clone(),
        [one] => number(one),
        all => like(ExprKind::Tensor(vec![all.iter().map(number).collect()])),
    };
    like(ExprKind::Sum(vec![(false, value.clone()), (true, constant)]))
}

fn is_norm(name: &str) -> bool {
    name.starts_with("L2 ") || name.starts_with("H1 ")
}

/// The quantity that samples belong to.
fn quantity(name: &str) -> &str {
    if is_norm(name) { &name[..2] } else { name }
}

/// Expressions at the state of the last step.
///
/// # Errors
/// The first message about an expression that has no value at the points.
pub fn take(
    run: &Solved,
    backend: &dyn KernelBackend,
    list: &[(String, Expr)],
    at: SampleAt<'_>,
) -> Result<Vec<Samples>, String> {
    let Some(state) = state(run) else { return Err("there is no step".to_owned()) };
    let (samples, messages) = run.scene.samples(&run.script, backend, list, at, state);
    match messages.first() {
        Some(message) => Err(message.message.clone()),
        None => Ok(samples),
    }
}

/// Sums over the points of one quantity.
#[derive(Default)]
struct Sum {
    /// Squares of the difference and of the reference, times weights.
    difference: f64,
    norm: f64,
    /// The square of the reference beside its constant.
    beside: f64,
    /// Weights of all points, and of those that were found.
    all: f64,
    seen: f64,
}

impl Sum {
    fn add(&mut self, samples: &Samples, like: &Samples) {
        let n = like.components;
        for (p, w) in like.weights.iter().enumerate() {
            let range = p * n..(p + 1) * n;
            let (Some(a), Some(b)) = (samples.values.get(range.clone()), like.values.get(range)) else { continue };
            self.all += w;
            if a.iter().all(|x| x.is_nan()) {
                continue;
            }
            self.seen += w;
            self.difference += w * a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>();
            self.norm += w * b.iter().map(|y| y * y).sum::<f64>();
            let constant = like.constant.iter().copied().chain(std::iter::repeat(0.0));
            self.beside += w * b.iter().zip(constant).map(|(y, c)| (y - c).powi(2)).sum::<f64>();
        }
    }

    fn relative(&self) -> f64 {
        let norm = if self.beside > VARIES * VARIES * self.norm { self.beside } else { self.norm };
        if self.seen >= (1.0 - LOST_POINTS) * self.all { (self.difference / norm).sqrt() } else { f64::NAN }
    }
}

/// What two runs are compared by.
#[derive(Clone, Copy, Debug)]
pub struct Compared<'a> {
    /// Quantities at points.
    pub samples: &'a [Samples],
    /// Measures of the last step.
    pub measures: &'a [(String, f64)],
}

/// Relative differences from a reference by quantity, of norms of unknowns that of the worst kind; not a number where too
/// many points were not found. A measure with the name of an output is called `measure NAME`.
#[must_use]
pub fn differences(found: Compared<'_>, reference: Compared<'_>) -> Vec<(String, f64)> {
    let mut sums: Vec<([&str; 2], Sum)> = Vec::new();
    for like in reference.samples {
        let Some(samples) = found.samples.iter().find(|s| s.name == like.name && s.home == like.home) else { continue };
        if like.vanishes && samples.vanishes {
            // of rounding there is no relative difference
            continue;
        }
        let key = [quantity(&like.name), like.kind.as_str()];
        let at = sums.iter().position(|s| s.0 == key).unwrap_or_else(|| {
            sums.push((key, Sum::default()));
            sums.len() - 1
        });
        sums[at].1.add(samples, like);
    }
    let mut out: Vec<(String, f64)> = Vec::new();
    for ([quantity, _], sum) in sums.iter().filter(|(_, sum)| sum.norm > 0.0) {
        match out.iter_mut().find(|(name, _)| name == quantity) {
            // what is no number on one kind is none
            Some((_, worst)) => {
                *worst = if worst.is_nan() || sum.relative() <= *worst { *worst } else { sum.relative() }
            }
            None => out.push(((*quantity).to_owned(), sum.relative())),
        }
    }
    for (name, value) in found.measures {
        if let Some((_, at)) = reference.measures.iter().find(|m| m.0 == *name).filter(|m| m.1 != 0.0) {
            let taken = out.iter().any(|o| o.0 == *name);
            let name = if taken { format!("{MEASURE}{name}") } else { name.clone() };
            out.push((name, (value - at).abs() / at.abs()));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_norm_is_that_of_the_worst_kind_of_unknowns() {
        let samples = |u: f64, p: f64, noise: f64| {
            let one = |field: &str, value: f64, vanishes: bool| Samples {
                name: format!("L2 {field}"),
                kind: field.to_owned(),
                vanishes,
                components: 1,
                weights: vec![2.0],
                values: vec![value],
                ..Samples::default()
            };
            [one("u", u, false), one("p", p, false), one("T", noise, true)]
        };
        let [found, reference] = [samples(1.1e-3, 1e6 + 1.0, 1e-20), samples(1e-3, 1e6, -1e-20)];
        let compared = |samples| Compared { samples, measures: &[] };
        let list = differences(compared(&found), compared(&reference));
        assert!(list.len() == 1 && list[0].0 == "L2" && (list[0].1 - 0.1).abs() < 1e-12, "{list:?}");
    }

    #[test]
    fn a_constant_makes_no_error_smaller() {
        let samples = |constant: f64, values: [f64; 2]| {
            let values = values.map(|x| x + constant).to_vec();
            let one = Samples {
                name: "L2 T".to_owned(),
                kind: "T".to_owned(),
                constant: vec![constant],
                ..Samples::default()
            };
            [Samples { components: 1, weights: vec![2.0, 2.0], values, ..one }]
        };
        for constant in [0.0, 293.0, -1e6] {
            let [found, reference] = [samples(constant, [1.1, 2.2]), samples(constant, [1.0, 2.0])];
            let compared = |samples| Compared { samples, measures: &[] };
            let list = differences(compared(&found), compared(&reference));
            assert!((list[0].1 - 0.1).abs() < 1e-8, "{constant}: {list:?}");
        }
        // of what does not vary the error is one of the constant
        let [found, reference] = [samples(293.0, [2.93, 2.93]), samples(293.0, [0.0, 0.0])];
        let list =
            differences(Compared { samples: &found, measures: &[] }, Compared { samples: &reference, measures: &[] });
        assert!((list[0].1 - 0.01).abs() < 1e-12, "{list:?}");
    }

    #[test]
    fn a_measure_with_the_name_of_an_output_is_told_apart() {
        let samples = |value: f64| {
            let one =
                Samples { name: "slip".to_owned(), weights: vec![2.0], values: vec![value], ..Samples::default() };
            [Samples { components: 1, ..one }]
        };
        let measures = |value: f64| [("slip".to_owned(), value), ("other".to_owned(), value)];
        let found = Compared { samples: &samples(3.0), measures: &measures(5.0) };
        let found = differences(found, Compared { samples: &samples(2.0), measures: &measures(4.0) });
        let expected = [("slip", 0.5), ("measure slip", 0.25), ("other", 0.25)];
        assert_eq!(found, expected.map(|(n, d)| (n.to_owned(), d)));
    }
}
