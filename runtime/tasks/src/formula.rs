//! A formula of a scene along a line: the closed form that stands beside a profile.
//!
//! The scene is that of the run, from the text in its report with the values of its parameters; its macros and params can
//! be used. Reads positions and the step variable alone: what the unknowns are stands in the files of the run.

use std::path::Path;

use wfl::{one_per_cause, render};
use wfl_compiler::{
    InterpreterBackend, compile_value,
    types::{PlaceKind, PlaceSig},
};
use wfl_discrete::{value::Value, window::Window};
use wfl_output::{ParameterValue, Report};
use wfl_problem::Sketch;

use crate::{Loaded, scene_file::read_scene_text};

/// The output that takes the formula through the front end.
const OUTPUT: &str = "formula_beside_a_profile";
/// What a formula is made of.
const MAY_READ: &str = "it may read positions, parameters, macros and the step variable";
/// Points along the line.
const POINTS: usize = 401;

/// The formula at points from one end of a line (0) to the other (1), at a value of the step variable.
///
/// # Errors
/// In words, or the messages about the formula.
pub fn along(report: &Report, formula: &str, ends: [[f64; 3]; 2], time: f64) -> Result<Vec<[f64; 2]>, String> {
    let Some(text) = report.about.texts.first() else {
        return Err("the report of the run has no text of its scene: run it again".to_owned());
    };
    let scene = Path::new(&report.scene);
    let more = format!("output vtk \"{OUTPUT}\" : ({formula}) as value\n");
    let whole = format!("{}\n{more}", text.text.trim_end());
    let plain = read_scene_text(scene, text.text.clone(), &[], "plot")?;
    let loaded = read_scene_text(scene, whole, &values(report, &plain), "plot")?;
    let told = |loaded: &Loaded| {
        let (told, _) = one_per_cause(&loaded.messages, &loaded.sources);
        let errors = told.iter().filter(|d| d.is_error());
        errors.map(|d| render(d, &loaded.sources)).collect::<Vec<_>>().join("\n")
    };
    let errors = told(&loaded);
    if !errors.is_empty() {
        return Err(format!("the formula `{formula}` cannot be read\n{errors}"));
    }
    let dim = usize::try_from(report.mesh.dim).unwrap_or(3);
    let output = loaded.script.outputs.iter().find(|o| o.file == OUTPUT);
    let expr = output.and_then(|o| o.items.first()).map(|i| &i.expr);
    let (Some(sketch), Some(expr)) = (Sketch::new(&loaded.script, Some(dim)), expr) else {
        return Err(format!("the formula `{formula}` cannot be read"));
    };
    let env = sketch.env();
    let place = PlaceSig {
        name: "here".to_owned(),
        kind: PlaceKind::Cells,
        here: vec![false; env.fields.len()],
        there: vec![false; env.fields.len()],
        entities: Vec::new(),
        description: "a line".to_owned(),
        here_name: None,
        inside: false,
    };
    let law = compile_value(&env, &place, "the formula", expr);
    let Some(law) = law.value else {
        let messages: Vec<String> = law.diagnostics.iter().map(|d| render(d, &loaded.sources)).collect();
        return Err(format!("the formula `{formula}` cannot be drawn: {MAY_READ}\n{}", messages.join("\n")));
    };
    if law.shape.len() != 1 {
        return Err(format!("the formula `{formula}` is a {}: name a component, such as ({formula})(1)", law.shape));
    }
    let value = Value::new(law, &InterpreterBackend).map_err(|e| e.to_string())?.at_step(Window::instant(time));
    if !value.reads_positions_only() {
        return Err(format!("the formula `{formula}` cannot be drawn: {MAY_READ}"));
    }
    #[expect(clippy::cast_precision_loss, reason = "a few hundred points")]
    let parts: Vec<f64> = (0..POINTS).map(|k| k as f64 / (POINTS - 1) as f64).collect();
    let at = |s: &f64| -> [f64; 3] { std::array::from_fn(|d| ends[0][d] + s * (ends[1][d] - ends[0][d])) };
    // a closed form may have poles and corners: points without a number are left out
    let number = |s: &f64| value.at_positions(&[at(s)]).ok().map(|v| [*s, v[0]]);
    let points: Vec<[f64; 2]> = parts.iter().filter_map(number).collect();
    if points.is_empty() { Err(format!("the formula `{formula}` is nowhere a number on the line")) } else { Ok(points) }
}

/// The values of the parameters as on the command line.
fn values(report: &Report, loaded: &Loaded) -> Vec<String> {
    let list = |row: &[wfl_output::Real]| {
        let numbers: Vec<String> = row.iter().map(|x| format!("{:e}", x.0)).collect();
        numbers.join(",")
    };
    let declared = |name: &str| loaded.script.params.iter().any(|p| p.name.name == name);
    let text = |value: &ParameterValue| match value {
        ParameterValue::Number(x) => Some(format!("{:e}", x.0)),
        ParameterValue::Vector(row) => Some(format!("[{}]", list(row))),
        ParameterValue::Matrix(rows) => {
            Some(format!("[{}]", rows.iter().map(|r| format!("[{}]", list(r))).collect::<Vec<_>>().join(",")))
        }
        ParameterValue::Text(_) => None,
    };
    let pairs = report.parameters.iter().filter(|(name, _)| declared(name));
    pairs.filter_map(|(name, value)| Some(format!("{name}={}", text(value)?))).collect()
}
