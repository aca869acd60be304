//! Values that are not terms: initial guesses, given fields.

use std::collections::BTreeSet;

use wfl::{Code, DataValue, Diagnostic, Span, StartKind, at_expr};
use wfl_compiler::{
    compile_value,
    types::{FieldKind, RateForm},
    without_fields,
};
use wfl_discrete::{
    finite,
    point_values::{PointValues, SAME_PLACE},
    value::Value,
};
use wfl_host::{input::InputKind, reading};
use wfl_output::Hash;

use super::{
    Builder, InputFile,
    given::{CallerValues, Given},
    mesh,
    mesh_files::unread,
};

impl Builder<'_> {
    /// Values given at the nodes of a field by an expression of the position.
    pub(super) fn nodal_values(&mut self, what: &str, list: Vec<(String, wfl::ast::Expr)>) -> Vec<(usize, Given)> {
        let place = mesh::position_place(self.fields.len());
        let mut out = Vec::new();
        for (name, e) in list {
            let Some(k) = self.fields.iter().position(|f| f.name == name) else { continue };
            let law = compile_value(self.env, &place, "a nodal value", &e);
            self.diagnostics
                .extend(law.diagnostics.into_iter().map(|d| without_fields(d, Code::E407, mesh::POSITIONS_ONLY)));
            let Some(law) = law.value else { continue };
            let (found, needed) = (law.shape, self.sigs[k].shape);
            if found.len() != needed.len() {
                let d = Diagnostic::new(Code::E108, format!("`{name}` is a {needed}, found a {found}"));
                let d = mesh::with_zeros(d, &e, found.len(), needed.len());
                self.diagnostics.push(at_expr(d, &e, self.env.expansions, found.to_string()));
                continue;
            }
            match Value::new(law, self.batch) {
                Ok(v) if v.reads_positions_only() => {
                    out.push((k, Given::Formula(Box::new(v), format!("{what} `{name}`"), e.span)));
                }
                Ok(_) => self.diagnostics.push(Diagnostic::new(Code::E407, mesh::POSITIONS_ONLY).at(e.span, "")),
                Err(error) => self.diagnostics.push(Diagnostic::new(Code::E609, error.to_string()).at(e.span, "")),
            }
        }
        out
    }

    /// First values.
    pub(super) fn starts(&mut self) -> Vec<(usize, Given)> {
        let mut list = Vec::new();
        let mut out = Vec::new();
        for start in &self.script.starts {
            match &start.kind {
                StartKind::Field { field, value } => list.push((field.name.clone(), value.clone())),
                StartKind::Rate { .. } => {}
                StartKind::File { path, path_span } => out.extend(self.starts_from(path, *path_span)),
            }
        }
        // what a statement says of one field goes over what a file says of it
        out.extend(self.nodal_values("the first value of", list));
        out
    }

    /// The first values of all fields that have columns in a file.
    fn starts_from(&mut self, path: &str, span: Span) -> Vec<(usize, Given)> {
        let Some(table) = self.table(path, span) else { return Vec::new() };
        let mut out = Vec::new();
        for k in 0..self.fields.len() {
            if self.fields[k].kind != FieldKind::Data && table.has(&self.fields[k].name) {
                let name = self.fields[k].name.clone();
                let refused = self.is_no_start(&table, k);
                if let Some((what, help)) = refused {
                    let d = Diagnostic::new(Code::E418, format!("`{path}` does not fit `{name}`: {what}"));
                    self.diagnostics.push(d.at(span, "").help(help));
                    continue;
                }
                out.extend(self.table_values(&table, &name, k, (path, span)));
            }
        }
        if out.is_empty() && !self.diagnostics.iter().any(Diagnostic::is_error) {
            let names: Vec<&str> = self.fields.iter().map(|f| f.name.as_str()).collect();
            let d = Diagnostic::new(Code::E418, format!("`{path}` has no values of a field of this scene"));
            self.diagnostics.push(d.at(span, format!("the fields are {}", names.join(", "))));
        }
        out
    }

    /// Why the column of a file that has the name of a field is not its first values, and what helps.
    fn is_no_start(&self, table: &PointValues, field: usize) -> Option<(String, &'static str)> {
        let f = &self.fields[field];
        if f.name == "s" && table.has_distances() {
            return Some(("its column `s` is the distance along the line".to_owned(), "give the unknown another name"));
        }
        if f.kind != FieldKind::Unknown {
            return None;
        }
        // adding zero takes the sign off a zero
        let bits = |n: usize| f.node_position(n).map(|x| (x + 0.0).to_bits());
        let mut seen = BTreeSet::new();
        let twice = (0..f.n_nodes()).find(|n| !seen.insert(bits(*n)))?;
        let at = finite::position(f.node_position(twice));
        let what = format!("it has several values at {at}, and a file has one at a place");
        Some((what, "a field of its own on each side, or an element of one value a cell, can be started from a file"))
    }

    /// A file of values at positions, read; `None` after a message.
    fn table(&mut self, path: &str, span: Span) -> Option<PointValues> {
        let text = match reading::text(self.folder, self.folder, path, InputKind::Values) {
            Ok(text) => text,
            Err(e) => {
                self.diagnostics.push(unread(&e, Code::E418, &format!("`{path}` cannot be read")).at(span, ""));
                return None;
            }
        };
        let input = InputFile::new(self.folder, path, Hash::of(text.as_bytes()));
        if !self.inputs.contains(&input) {
            self.inputs.push(input);
        }
        match PointValues::parse(&text) {
            Ok(table) => Some(table),
            Err(e) => {
                let d = Diagnostic::new(Code::E418, format!("`{path}` cannot be read: {e}"));
                let d = d.help("a line of names (x, y, z, u_1, u_2, ...), then lines of numbers, with commas between");
                self.diagnostics.push(d.at(span, ""));
                None
            }
        }
    }

    /// The first rates of fields with second ones that a file has columns of, but those that are known otherwise.
    pub(super) fn rates_from(&mut self, path: &str, span: Span, known: &[(usize, Given)]) -> Vec<(usize, Given)> {
        let is_second = |k: &usize| self.env.rates.get(*k) == Some(&RateForm::Second);
        let is_open = |k: &usize| known.iter().all(|(other, _)| other != k);
        let fields: Vec<usize> = (0..self.fields.len()).filter(is_second).filter(is_open).collect();
        // what is wrong with the file was told with its values
        if fields.is_empty() || self.diagnostics.iter().any(Diagnostic::is_error) {
            return Vec::new();
        }
        let Some(table) = self.table(path, span) else { return Vec::new() };
        let mut out = Vec::new();
        for k in fields {
            let name = format!("Dot_{}", self.fields[k].name);
            if table.has(&name) {
                out.extend(self.table_values(&table, &name, k, (path, span)));
            }
        }
        out
    }

    /// The values of one field from the columns of a file with a name.
    fn table_values(
        &mut self,
        table: &PointValues,
        name: &str,
        field: usize,
        at: (&str, Span),
    ) -> Option<(usize, Given)> {
        let (path, span) = at;
        let (f, shape) = (&self.fields[field], self.sigs[field].shape);
        let index = |e: usize| shape.indices(e).iter().map(|i| (i + 1).to_string()).collect::<String>();
        let entries: Vec<String> = (0..shape.len()).map(index).collect();
        let nodes: Vec<[f64; 3]> = (0..f.n_nodes()).map(|n| f.node_position(n)).collect();
        let (low, high) = self.mesh.bounds();
        let size = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        match table.at_nodes(name, &entries, &nodes, size) {
            Ok(values) => Some((field, Given::Values(values))),
            Err(e) => {
                let d = Diagnostic::new(Code::E418, format!("`{path}` does not fit `{name}`: {e}"));
                let text = format!("positions are the same within {SAME_PLACE:e} of the mesh size");
                self.diagnostics.push(d.at(span, text));
                None
            }
        }
    }

    /// Given fields.
    pub(super) fn data(&mut self) -> Vec<(usize, Given)> {
        let (mut list, mut out) = (Vec::new(), Vec::new());
        for (k, field) in self.script.fields.iter().enumerate() {
            if let wfl::FieldKind::Data { value } = &field.kind {
                match value {
                    DataValue::Formula(e) => list.push((field.name.name.clone(), e.clone())),
                    DataValue::File(path, span) => {
                        if let Some(table) = self.table(path, *span) {
                            let name = self.fields[k].name.clone();
                            out.extend(self.table_values(&table, &name, k, (path, *span)));
                        }
                    }
                    DataValue::Caller => {
                        let n = self.fields[k].n_dofs();
                        out.push((k, Given::Caller(CallerValues::nothing(&field.name.name, n, field.span))));
                    }
                    DataValue::Missing => {
                        let d = Diagnostic::new(Code::E415, format!("data `{}` has no value", field.name.name));
                        self.diagnostics.push(d.at(field.name.span, "write `= expression`, or give it from Python"));
                    }
                }
            }
        }
        out.extend(self.nodal_values("the data", list));
        out
    }
}
