//! Values that are no terms: first guesses, given fields, measures.

use wfl::{DataValue, Diagnostic, StartKind, ast::Reduction};
use wfl_compiler::{compile_value, without_fields};

use super::{Builder, Measure, RuleChoice, mesh, terms};
use crate::{system::System, value::Value};

impl Builder<'_> {
    /// Values given at the nodes of a field by an expression of the position.
    fn nodal_values(&mut self, list: Vec<(String, wfl::ast::Expr)>) -> Vec<(usize, Value)> {
        let place = mesh::position_place(self.fields.len());
        let mut out = Vec::new();
        for (name, e) in list {
            let Some(k) = self.fields.iter().position(|f| f.name == name) else { continue };
            let law = compile_value(self.env, &place, "a nodal value", &e);
            self.diagnostics
                .extend(law.diagnostics.into_iter().map(|d| without_fields(d, "E407", mesh::POSITIONS_ONLY)));
            let Some(law) = law.value else { continue };
            let (found, needed) = (law.shape, self.sigs[k].shape);
            if found.len() != needed.len() {
                let d = Diagnostic::new("E108", format!("`{name}` is a {needed}, found a {found}"));
                self.diagnostics.push(d.at(e.span, found.to_string()));
                continue;
            }
            match Value::new(law, self.batch) {
                Ok(v) if v.reads_positions_only() => out.push((k, v)),
                Ok(_) => self.diagnostics.push(Diagnostic::new("E407", mesh::POSITIONS_ONLY).at(e.span, "")),
                Err(error) => self.diagnostics.push(Diagnostic::new("E609", error.to_string()).at(e.span, "")),
            }
        }
        out
    }

    pub(super) fn starts(&mut self) -> Vec<(usize, Value)> {
        let mut list = Vec::new();
        for start in &self.script.starts {
            match &start.kind {
                StartKind::Field { field, value } => list.push((field.name.clone(), value.clone())),
                StartKind::File { path_span, .. } => {
                    let d = Diagnostic::new("E802", "starting from a file is not available yet");
                    self.diagnostics.push(d.at(*path_span, "give an expression: start u = ..."));
                }
            }
        }
        self.nodal_values(list)
    }

    pub(super) fn data(&mut self) -> Vec<(usize, Value)> {
        let mut list = Vec::new();
        for field in &self.script.fields {
            if let wfl::FieldKind::Data { value } = &field.kind {
                match value {
                    DataValue::Formula(e) => list.push((field.name.name.clone(), e.clone())),
                    DataValue::File(_, span) => {
                        let d = Diagnostic::new("E802", "data fields from files are not available yet");
                        self.diagnostics.push(d.at(*span, "give an expression of x, y, z"));
                    }
                    DataValue::Host => {
                        let d = Diagnostic::new("E415", format!("data `{}` has no value", field.name.name));
                        self.diagnostics.push(d.at(field.name.span, "write `= expression`"));
                    }
                }
            }
        }
        self.nodal_values(list)
    }

    pub(super) fn measures(&mut self, rules: &terms::Rules) -> Vec<Measure> {
        let mut out = Vec::new();
        for measure in &self.script.measures {
            let mut parts = Vec::new();
            for place in &measure.places {
                let mut maker = terms::TermMaker {
                    script: self.script,
                    env: self.env,
                    mesh: &self.mesh,
                    regions: &self.regions,
                    fields: &self.fields,
                    diagnostics: &mut *self.diagnostics,
                };
                let Some((sig, set)) = maker.place(place) else { continue };
                let law = compile_value(self.env, &sig, "measure", &measure.expr);
                self.diagnostics.extend(law.diagnostics);
                let Some(law) = law.value else { continue };
                if !law.shape.is_scalar_like() {
                    let d = Diagnostic::new("E108", format!("a measure is a scalar, found a {}", law.shape));
                    self.diagnostics.push(d.at(measure.expr.span, law.shape.to_string()));
                    continue;
                }
                // the rule of the terms there, so that measured forces are those that act
                let choice = rules.get(&place.name).copied().unwrap_or(RuleChoice::Degree(law.degree.rule()));
                let Some(domain) =
                    terms::domain(&self.mesh, &self.fields, set.as_ref(), choice, measure.expr.span, self.diagnostics)
                else {
                    continue;
                };
                match Value::new(law, self.batch) {
                    Ok(value) => match value.bind(&self.mesh, domain, &self.fields) {
                        Ok(sampled) => parts.push((value, sampled)),
                        Err(e) => {
                            self.diagnostics.push(Diagnostic::new("E202", e.to_string()).at(measure.expr.span, ""))
                        }
                    },
                    Err(e) => self.diagnostics.push(Diagnostic::new("E609", e.to_string()).at(measure.expr.span, "")),
                }
            }
            out.push(Measure { name: measure.name.name.clone(), reduction: measure.reduction, parts });
        }
        out
    }
}

impl Measure {
    /// Its value at a state.
    pub fn evaluate(&mut self, system: &System, time: f64, increment: f64, u: &[f64]) -> f64 {
        let current = system.slices(u);
        let previous = system.previous_slices();
        let values = crate::assemble::FieldValues { current: &current, previous: &previous };
        let (mut sum, mut size) = (0.0, 0.0);
        let (mut largest, mut smallest) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut broken = false;
        for (value, sampled) in &mut self.parts {
            value.set_step(time, increment);
            value.for_each_point(&system.mesh, sampled, values, |_, _, _, weight, v| {
                sum += weight * v[0];
                size += weight;
                largest = largest.max(v[0]);
                smallest = smallest.min(v[0]);
                broken |= v[0].is_nan();
            });
        }
        match self.reduction {
            _ if broken => f64::NAN,
            Reduction::Integral => sum,
            Reduction::Mean => sum / size,
            Reduction::Max => largest,
            Reduction::Min => smallest,
        }
    }
}
