//! Tables over the step variable: values outside their rows are told before the run, and their corners are known, so that
//! steps that the run chooses end there.
//!
//! A table whose argument depends on something else than the step variable is not looked at here: a value outside its
//! rows is then an error of the step that meets it. One in a branch of `if` is asked for its corners only.

use std::sync::Arc;

use wfl::{
    Code, Curve, Diagnostic, ResolvedScript, StartKind,
    ast::{Argument, Expr, ExprKind},
    cond_children,
};
use wfl_compiler::{
    Env, ValueLaw, compile_value, interpret,
    lookup::{Reading, read},
    run_prologue,
    types::UniformSlot,
};
use wfl_output::Hash;

use super::{Builder, Forcing, Steps, fields::global_place, inputs::InputFile};

/// Values of the step variable at which arguments are looked at, where the run chooses its steps.
const SAMPLES: u32 = 1000;
/// Halvings of an interval until its ends are next to each other.
const HALVINGS: u32 = 60;

/// What a run has to know of the tables of its scene, and of what else drives it.
#[derive(Clone, Debug, Default)]
pub struct TablesOf {
    /// Values of the step variable at which tables have corners and other formulas jump, increasing: steps that the run
    /// chooses end there.
    pub corners: Vec<f64>,
    /// What steps that the run chooses do not pass over.
    pub forcing: Forcing,
    /// Tables, each with the range of its rows, whose arguments are only known at a state.
    pub states: Vec<String>,
}

/// A table over the step variable.
struct OverSteps<'s> {
    curve: &'s Arc<Curve>,
    argument: &'s Expr,
    /// Whether it stands in a branch of `if`.
    guarded: bool,
    law: ValueLaw,
}

impl OverSteps<'_> {
    /// The argument at a value of the step variable.
    fn at(&self, time: f64) -> f64 {
        let uniforms = run_prologue(&self.law.prologue, &vec![time; self.law.prologue.slots.len()]);
        let mut out = [0.0];
        interpret(&self.law.kernel, &uniforms, &[], &mut Vec::new(), &mut out);
        out[0]
    }
}

impl Builder<'_> {
    /// The files that tables are read from are part of what a run is.
    pub(super) fn table_inputs(&mut self) {
        let files = self.script.tables.iter();
        let files = files.map(|t| InputFile::new(self.folder, &t.name, Hash::of(t.text.as_bytes())));
        self.inputs.extend(files);
    }

    /// E447 for values outside the rows; the values of the step variable at which tables have corners, and the tables
    /// whose arguments are only known at a state.
    pub(super) fn tables(&mut self, steps: &Steps) -> TablesOf {
        let mut found = if self.script.tables.is_empty() { TablesOf::default() } else { self.of_tables(steps) };
        found.forcing = self.forcing(steps, &found.corners);
        found.forcing.add_to(&mut found.corners);
        self.differenced(steps);
        self.overlooked(steps);
        found
    }

    fn of_tables(&mut self, steps: &Steps) -> TablesOf {
        let (tables, states) = tables_of(self.script, self.env);
        let times = times(steps);
        let mut corners = Vec::new();
        for table in &tables {
            let arguments: Vec<f64> = times.iter().map(|t| table.at(*t)).collect();
            let missed = arguments.iter().position(|x| read(table.curve, Reading::Value, *x).is_nan());
            if let Some(k) = missed.filter(|_| !table.guarded) {
                self.diagnostics.push(outside(table, times[k], arguments[k], self.env));
            }
            if steps.auto.is_some() {
                add_corners(table, &times, &arguments, &mut corners);
            }
        }
        corners.retain(|t| *t > steps.first() && *t < steps.last());
        corners.sort_by(f64::total_cmp);
        corners.dedup();
        TablesOf { corners, states, forcing: Forcing::default() }
    }
}

/// Values of the step variable that a run meets, or may meet.
fn times(steps: &Steps) -> Vec<f64> {
    if steps.auto.is_none() {
        return steps.values.clone();
    }
    let (from, to) = (steps.first(), steps.last());
    let at = |k: u32| if k == SAMPLES { to } else { from + f64::from(k) / f64::from(SAMPLES) * (to - from) };
    (0..=SAMPLES).map(at).collect()
}

fn outside(table: &OverSteps<'_>, time: f64, argument: f64, env: &Env<'_>) -> Diagnostic {
    let (first, last) = table.curve.range();
    let variable = env.step_variable.unwrap_or("t");
    let d = Diagnostic::new(Code::E447, format!("the table {} has no row at {variable} = {time}", table.curve.name));
    let d = d.help(if argument > last {
        format!("end the steps there, add rows, or hold the last value: min({variable}, {last})")
    } else {
        format!("begin the steps there, add rows, or hold the first value: max({variable}, {first})")
    });
    wfl::at_expr(d, table.argument, env.expansions, format!("this is {argument}; the rows go from {first} to {last}"))
}

/// Where an argument meets corners.
fn add_corners(table: &OverSteps<'_>, times: &[f64], arguments: &[f64], found: &mut Vec<f64>) {
    let corners = table.curve.corners();
    // the step variable itself: nothing to look for
    if times == arguments {
        found.extend(corners);
        return;
    }
    for (t, x) in times.windows(2).zip(arguments.windows(2)) {
        let (low, high) = (x[0].min(x[1]), x[0].max(x[1]));
        let begin = corners.partition_point(|c| *c < low);
        found.extend(corners[begin..].iter().take_while(|c| **c <= high).map(|c| met(table, t, x, *c)));
    }
}

/// Where an argument is equal to a value that lies between those at two ends.
fn met(table: &OverSteps<'_>, t: &[f64], x: &[f64], wanted: f64) -> f64 {
    let rising = x[1] >= x[0];
    let (mut from, mut to) = (t[0], t[1]);
    if x[0] == wanted {
        return from;
    }
    for _ in 0..HALVINGS {
        let middle = from + 0.5 * (to - from);
        let value = table.at(middle);
        if value == wanted {
            return middle;
        }
        if (value < wanted) == rising { from = middle } else { to = middle }
    }
    to
}

/// The tables of a scene: those whose argument changes with the step variable alone, and in words those whose argument is
/// another one at other points or states.
fn tables_of<'s>(script: &'s ResolvedScript, env: &Env<'_>) -> (Vec<OverSteps<'s>>, Vec<String>) {
    let (mut found, mut others) = (Vec::new(), Vec::new());
    let mut called = |file: &str, argument: &'s Expr, column: Option<&str>, standing: Standing| {
        let Some(Ok(curve)) = script.tables.iter().find(|t| t.name == file).map(|t| t.curve(column)) else { return };
        // what is wrong with an argument is told with its statement; without a place no field has a value
        match compile_value(env, &global_place(env.fields.len()), "table", argument).value {
            Some(law) if !law.shape.is_scalar_like() => {}
            Some(law) if law.inputs.is_empty() && law.prologue.slots == [UniformSlot::Time] => {
                let guarded = standing == Standing::InBranch;
                found.push(OverSteps { curve, argument, guarded, law });
            }
            Some(law) if law.inputs.is_empty() => {}
            _ => {
                let (first, last) = curve.range();
                let words = format!("{} ({first} to {last})", curve.name);
                if !others.contains(&words) {
                    others.push(words);
                }
            }
        }
    };
    each_expression(script, &mut |e| each_call(e, Standing::Free, &mut called));
    (found, others)
}

/// Calls `f` for each expression that has values during a run.
fn each_expression<'s>(script: &'s ResolvedScript, f: &mut dyn FnMut(&'s Expr)) {
    script.terms.iter().for_each(|t| f(&t.expr));
    script.fixes.iter().chain(&script.loads).for_each(|c| f(&c.value));
    for field in &script.fields {
        match &field.kind {
            wfl::FieldKind::Data { value: wfl::DataValue::Formula(e) } | wfl::FieldKind::State { update: e } => f(e),
            _ => {}
        }
    }
    for start in &script.starts {
        if let StartKind::Field { value, .. } | StartKind::Rate { value, .. } = &start.kind {
            f(value);
        }
    }
    script.reductions().for_each(|m| f(&m.expr));
    script.computed.iter().for_each(|c| f(&c.expr));
    script.events.iter().for_each(|e| [&e.larger, &e.smaller].into_iter().for_each(&mut *f));
    script.outputs.iter().flat_map(|o| &o.items).for_each(|q| f(&q.expr));
}

/// Where a call stands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Standing {
    /// Its value is always asked for.
    Free,
    /// In a branch of `if`.
    InBranch,
}

/// A call: file, argument, column, and where it stands.
type Called<'s, 'f> = dyn FnMut(&'s str, &'s Expr, Option<&'s str>, Standing) + 'f;

/// Calls `f` for each call of `table`.
fn each_call<'s>(e: &'s Expr, standing: Standing, f: &mut Called<'s, '_>) {
    match &e.kind {
        ExprKind::Number(_) | ExprKind::Name(_) => {}
        ExprKind::Sum(parts) => parts.iter().for_each(|(_, p)| each_call(p, standing, f)),
        ExprKind::Product(first, rest) => {
            each_call(first, standing, f);
            rest.iter().for_each(|(_, _, p)| each_call(p, standing, f));
        }
        ExprKind::Negate(a) | ExprKind::Transpose(a) => each_call(a, standing, f),
        ExprKind::Power(a, b) => [a, b].into_iter().for_each(|p| each_call(p, standing, f)),
        ExprKind::Call(callee, arguments) => {
            if let (ExprKind::Name(word), [Argument::Text(file, _), Argument::Expr(argument), rest @ ..]) =
                (&callee.kind, arguments.as_slice())
                && word == "table"
            {
                let column = if let [Argument::Text(column, _)] = rest { Some(column.as_str()) } else { None };
                f(file, argument, column, standing);
            }
            for argument in arguments {
                if let Argument::Expr(a) = argument {
                    each_call(a, standing, f);
                }
            }
        }
        ExprKind::Tensor(rows) => rows.iter().flatten().for_each(|p| each_call(p, standing, f)),
        ExprKind::If(condition, a, b) => {
            cond_children(condition, &mut |p| each_call(p, standing, f));
            [a, b].into_iter().for_each(|p| each_call(p, Standing::InBranch, f));
        }
    }
}
