//! Series over the steps: expressions at points, a row for each point and step.

use wfl::{Code, Diagnostic, Span};
use wfl_compiler::ValueLaw;
use wfl_discrete::value::Value;
use wfl_output::{LineSample, Located};

use super::{
    Cadence, Every, Parts,
    constants::numbers,
    mappings::refused,
    outputs::{CsvOutput, OutputMaker, Target},
    rule_choice::states_read,
};

/// Most points of a series: each has a row in every step.
const MAX_AT: usize = 1000;

impl OutputMaker<'_> {
    /// E435 for quantities that live on none of the points of a series, W415 for points at which none of them has a value.
    fn lives_on_points(&mut self, output: &wfl::Output, line: &LineSample) {
        for name in line.nowhere() {
            let span = output.items.iter().find(|i| i.name == name).map_or(output.span, |i| i.span);
            let d = Diagnostic::new(Code::E435, format!("`{name}` lives on none of the points of `{}`", output.file));
            self.diagnostics.push(d.at(span, "").at(output.at[0].span, "the first point"));
        }
        self.points_outside(output, line);
    }

    fn points_outside(&mut self, output: &wfl::Output, line: &LineSample) {
        if line.is_empty() {
            return;
        }
        let found = line.found();
        let missing: Vec<usize> = (0..found.len()).filter(|k| !found[*k]).collect();
        // none at all is an error of each quantity
        let Some(first) = missing.first().filter(|_| missing.len() < found.len()) else { return };
        let text = format!(
            "{} of {} points of `{}` lie in no body of its quantities",
            missing.len(),
            found.len(),
            output.file
        );
        let (low, high) = self.parts.mesh.bounds();
        let dim = self.parts.mesh.dim();
        let d = Diagnostic::new(Code::W415, text).at(output.at[*first].span, "`nan` in its rows");
        self.diagnostics.push(d.note(format!("the mesh spans {:?} to {:?}", &low[..dim], &high[..dim])));
    }

    /// E416 for a quantity with a state at a point that is asked for: states have values at integration points alone.
    pub(super) fn state_at_points(&self, law: &ValueLaw, quantity: Span, at: (Span, &str)) -> Option<Diagnostic> {
        let fields = self.parts.fields;
        let state = states_read(fields, &law.inputs).next().map(|k| fields[k].name.as_str())?;
        let text = format!("`{state}` lives at integration points, and has no value at a point that is asked for");
        let d = Diagnostic::new(Code::E416, text).at(quantity, format!("`{state}` is a state")).at(at.0, at.1);
        Some(d.help("measure m = mean(...) on a region, or max, min; output vtk writes its mean over each cell"))
    }

    /// A series over the steps at points.
    pub(super) fn series(&mut self, output: &wfl::Output, bodies: &[Target], faces: &[Target]) -> Option<CsvOutput> {
        if let Some(option) = output.options.first() {
            let d = Diagnostic::new(Code::E414, format!("option `{}` is not understood here", option.name.name));
            self.diagnostics.push(d.at(option.name.span, "points are those behind `at`"));
            return None;
        }
        let dim = self.parts.mesh.dim();
        let mut points = Vec::new();
        for at in &output.at {
            let x = numbers(self.parts.env, "a point", at, self.diagnostics)?;
            if x.len() != dim || output.at.len() > MAX_AT {
                let d =
                    Diagnostic::new(Code::E108, format!("a point has {dim} coordinates here; at most {MAX_AT} points"));
                self.diagnostics.push(d.at(at.span, ""));
                return None;
            }
            points.push([0, 1, 2].map(|d| x.get(d).copied().unwrap_or(0.0)));
        }
        let mut line = LineSample::at(self.parts.mesh, points);
        for item in &output.items {
            for (target, law) in self.homes(bodies, faces, &item.expr) {
                if let Some(d) = refused(law.mapping, "a value at a point", item.expr.span) {
                    self.diagnostics.push(d);
                    continue;
                }
                let Parts { mesh, fields, .. } = self.parts;
                if let Some(d) = self.state_at_points(&law, item.span, (output.at[0].span, "the first point")) {
                    self.diagnostics.push(d);
                    break;
                }
                let added = Value::new(law, self.backend).map_err(|e| e.to_string()).and_then(|v| {
                    let located = Located::new(mesh, &target.support.region(), line.points());
                    let located = located.map_err(|e| e.to_string())?;
                    line.add(mesh, fields, item.name.clone(), v, located).map_err(|e| e.to_string())
                });
                if let Err(text) = added {
                    self.diagnostics.push(Diagnostic::new(Code::E416, text).at(item.expr.span, ""));
                }
            }
        }
        self.parts.mesh.check_whole(|| self.lives_on_points(output, &line));
        // a row of every step, unless the scene says otherwise
        let every = match output.every {
            None => Cadence { every: Every::Count(1), when: self.event(output)? },
            Some(_) => self.every(output)?,
        };
        Some(CsvOutput { file: output.file.clone(), every, line })
    }
}
