//! The `output` statements: which expression is sampled on which piece.
//!
//! Bodies are the cell sets of the unknowns; an expression is written on every body where it is defined. One that needs
//! a face (`Normal`, the other side) is written on the faces that have terms. A plain field is also written on the
//! faces of its side, so that the faces of a fault carry both displacements. Quantities with a state are known at
//! integration points only: their mean over each cell is written. What lives on edges of faces alone is written there.
//! Where bodies have vector unknowns of their own, `DISPLACEMENT` has all of them in one array.

mod places;
mod points;

pub(super) use places::facet_support;

use std::{
    cell::Cell,
    collections::{BTreeMap, BTreeSet},
    time::Instant,
};

use wfl::{
    Code, Diagnostic, Span,
    ast::{Expr, ExprKind, OptionValue},
};
use wfl_compiler::{
    ValueLaw,
    backend::KernelBackend,
    compile_value,
    types::{FieldKind, PlaceSig},
};
use wfl_discrete::{
    field::{Field, FieldSpace},
    space::Support,
    value::Value,
};
use wfl_mesh::mesh::{CellId, SupportSet};
use wfl_output::{LineSample, Located, OutputError, PART, SampledPiece, check_name, step_name};

use crate::{
    Cadence, Every, Parts, Steps,
    constants::{number, numbers},
    jumps,
    mappings::{Mappings, refused},
    terms::Rules,
    written,
};

/// A VTU series.
pub struct VtkOutput {
    /// The name of its files.
    pub file: String,
    /// Of which steps files are written.
    pub every: Cadence,
    /// Its pieces.
    pub pieces: Vec<SampledPiece>,
}

/// A line sample.
pub struct CsvOutput {
    /// The name of its files.
    pub file: String,
    /// Of which steps files are written.
    pub every: Cadence,
    /// Its points and columns.
    pub line: LineSample,
}

impl VtkOutput {
    /// About as many bytes as the file of a step takes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.pieces.iter().map(SampledPiece::bytes).sum()
    }
}

impl CsvOutput {
    /// About as many bytes as the file of a step takes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.line.bytes()
    }
}

pub(super) struct OutputMaker<'a> {
    pub(super) parts: Parts<'a>,
    pub(super) rules: &'a Rules,
    /// Where quantities are read through mappings; none for a scene that is made already.
    pub(super) mappings: Option<&'a Mappings>,
    pub(super) backend: &'a dyn KernelBackend,
    /// None after an error in `steps`.
    pub(super) steps: Option<&'a Steps>,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
    /// Seconds spent on laws; the rest goes to finding where they are sampled.
    pub(super) law_seconds: Cell<f64>,
}

/// A place on which expressions may be sampled.
pub(super) struct Target {
    pub(super) sig: PlaceSig,
    pub(super) support: SupportSet,
}

/// Codes of what has no value at a place but may have one elsewhere: fields, other sides, normals.
const NOT_HERE: [Code; 3] = [Code::E202, Code::E203, Code::E204];

const DEFAULT_POINTS: f64 = 101.0;
const MAX_POINTS: f64 = 1e6;
/// The array with the vector unknowns of all bodies, so that one warp shows them.
const DISPLACEMENT: &str = "displacement";
/// Largest number behind `every`: beyond any number of steps.
const MAX_EVERY: f64 = 1e9;

/// What a scene writes: grids, lines, and series over the steps.
pub(super) type Made = (Vec<VtkOutput>, Vec<CsvOutput>, Vec<CsvOutput>);

pub(super) fn outputs(maker: &mut OutputMaker<'_>) -> Made {
    let (mut vtk, mut csv, mut series) = (Vec::new(), Vec::new(), Vec::new());
    maker.names();
    let bodies = maker.bodies();
    let faces = maker.faces();
    for output in &maker.parts.script.outputs {
        maker.check_file(output);
        match output.format.name.as_str() {
            "vtk" => vtk.extend(maker.vtk(output, &bodies, &faces)),
            "csv" if !output.at.is_empty() => series.extend(maker.series(output, &bodies, &faces)),
            "csv" => csv.extend(maker.csv(output, &bodies)),
            other => {
                let d = Diagnostic::new(Code::E416, format!("no output format `{other}`"));
                maker.diagnostics.push(d.at(output.format.span, "known: vtk, csv"));
            }
        }
    }
    (vtk, csv, series)
}

impl Target {
    pub(super) fn is_of_edges(&self) -> bool {
        matches!(self.support, SupportSet::Edges(_))
    }
}

impl<'a> OutputMaker<'a> {
    /// For values at one point.
    pub(super) fn at_a_point(
        parts: Parts<'a>,
        rules: &'a Rules,
        backend: &'a dyn KernelBackend,
        diagnostics: &'a mut Vec<Diagnostic>,
    ) -> Self {
        let law_seconds = Cell::new(0.0);
        Self { parts, rules, mappings: None, backend, steps: None, diagnostics, law_seconds }
    }
}

impl OutputMaker<'_> {
    fn try_compile(&self, target: &Target, e: &Expr) -> Result<ValueLaw, Vec<Diagnostic>> {
        let begin = Instant::now();
        let compiled = compile_value(self.parts.env, &target.sig, "output", e);
        self.law_seconds.set(self.law_seconds.get() + begin.elapsed().as_secs_f64());
        match compiled.value {
            // images are those of the faces that a mapping begins on
            Some(law) if !self.begins_on(&law, target) => Err(Vec::new()),
            Some(law) if !compiled.diagnostics.iter().any(Diagnostic::is_error) => Ok(law),
            _ => Err(compiled.diagnostics),
        }
    }

    /// Bodies where the expression makes sense, else faces, else edges; a message when there are none.
    pub(super) fn homes<'t>(
        &mut self,
        bodies: &'t [Target],
        faces: &'t [Target],
        e: &Expr,
    ) -> Vec<(&'t Target, ValueLaw)> {
        let mut problems = Vec::new();
        let (faces, edges) = faces.split_at(faces.partition_point(|t| !t.is_of_edges()));
        for list in [bodies, faces, edges] {
            let mut found = Vec::new();
            for target in list {
                match self.try_compile(target, e) {
                    Ok(law) => found.push((target, law)),
                    Err(d) => problems = if problems.is_empty() { d } else { problems },
                }
            }
            if !found.is_empty() {
                return found;
            }
        }
        // where the fields live something else is wrong; else, of all the refusals, the one on the faces says most for
        // an expression with Normal in it
        let refusals = bodies.iter().chain(faces).filter_map(|t| self.try_compile(t, e).err());
        let elsewhere = |told: &Vec<Diagnostic>| told.iter().any(|d| NOT_HERE.contains(&d.code));
        let at_home = refusals.into_iter().find(|told| !elsewhere(told));
        let last = faces.last().or(bodies.last());
        let told = at_home.or_else(|| last.and_then(|t| self.try_compile(t, e).err())).unwrap_or(problems);
        let told = if told.is_empty() {
            let d = Diagnostic::new(Code::E416, "this quantity has a value nowhere");
            vec![d.at(e.span, "no body and no face has its fields")]
        } else {
            told
        };
        for d in told {
            if !self.diagnostics.contains(&d) {
                self.diagnostics.push(d);
            }
        }
        Vec::new()
    }

    /// Whether the files of an output can have its name, also with a number and an ending.
    fn check_file(&mut self, output: &wfl::Output) {
        /// The digits of the largest number of a step.
        const LAST: usize = usize::MAX;
        let names = [format!("{}.csv", output.file), step_name(&output.file, LAST, "vtu")];
        let wrong = names.iter().find_map(|name| check_name(name).err());
        if let Some(OutputError::BadName { reason, .. }) = wrong {
            let d =
                Diagnostic::new(Code::E710, format!("`{}` cannot be the name of result files: {reason}", output.file));
            self.diagnostics.push(
                d.at(output.format.span, "its files are named after it")
                    .help("results lie in the folder of --out; take a plain name, such as fields"),
            );
        }
    }

    fn vtk(&mut self, output: &wfl::Output, bodies: &[Target], faces: &[Target]) -> Option<VtkOutput> {
        if let Some(at) = output.at.first() {
            let d = Diagnostic::new(Code::E416, "`at` samples points: use `output csv`");
            self.diagnostics.push(d.at(at.span, ""));
            return None;
        }
        if let Some((from, _)) = &output.along {
            let d = Diagnostic::new(Code::E416, "`along` samples a line: use `output csv`");
            self.diagnostics.push(d.at(from.span, ""));
            return None;
        }
        if let Some(option) = output.options.first() {
            let d = Diagnostic::new(Code::E414, format!("option `{}` is not understood here", option.name.name));
            self.diagnostics.push(d.at(option.name.span, "points are those of a line: use `output csv`"));
            return None;
        }
        let degree = self.parts.fields.iter().map(Field::degree).max().unwrap_or(1).clamp(1, 2);
        let mut pieces: Vec<(SupportSet, SampledPiece)> = Vec::new();
        for item in &output.items {
            let name = item.name.clone();
            let mut homes = self.homes(bodies, faces, &item.expr);
            if matches!(item.expr.kind, ExprKind::Name(_)) {
                for face in faces.iter().filter(|face| !face.is_of_edges()) {
                    if !homes.iter().any(|(t, _)| self.are_one(&t.support, &face.support))
                        && let Some(law) = self.on_face(face, &item.expr)
                    {
                        homes.push((face, law));
                    }
                }
            }
            for (target, law) in homes {
                self.add(&mut pieces, target, law, &name, degree, item.expr.span);
            }
        }
        let mut pieces: Vec<SampledPiece> = pieces.into_iter().map(|p| p.1).filter(|p| !p.is_empty()).collect();
        // bodies first
        pieces.sort_by_key(|p| !matches!(p.support(), SupportSet::Cells(_)));
        let moved = self.moved(output);
        for piece in &mut pieces {
            // on the faces between two bodies, both are written: those of the first one move with it
            moved.iter().any(|name| piece.write_again(name, DISPLACEMENT));
        }
        Some(VtkOutput { file: output.file.clone(), every: self.every(output)?, pieces })
    }

    /// The vector unknowns among the quantities of a file, in its order, if there are several and no cell has two of them;
    /// none where the scene uses the word itself.
    fn moved(&self, output: &wfl::Output) -> Vec<String> {
        let dim = self.parts.mesh.dim();
        let mut found: BTreeMap<usize, (usize, &str)> = BTreeMap::new();
        let mut taken: BTreeSet<CellId> = BTreeSet::new();
        for (order, item) in output.items.iter().enumerate() {
            let ExprKind::Name(name) = &item.expr.kind else { continue };
            let Some(k) = self.parts.fields.iter().position(|f| f.name == *name) else { continue };
            let field = &self.parts.fields[k];
            let FieldSpace::Nodal(space) = &field.space else { continue };
            let Support::Cells(cells) = space.support() else { continue };
            if field.kind != FieldKind::Unknown || field.n_components != dim || dim == 1 || found.contains_key(&k) {
                continue;
            }
            if !self.parts.mesh.team().all(cells.iter().all(|c| taken.insert(*c))) {
                return Vec::new();
            }
            found.insert(k, (order, item.name.as_str()));
        }
        let mut names: Vec<(usize, &str)> = found.into_values().collect();
        names.sort_unstable();
        if names.len() < 2 || output.items.iter().any(|i| i.name == DISPLACEMENT) {
            return Vec::new();
        }
        names.into_iter().map(|(_, name)| name.to_owned()).collect()
    }

    /// E433 for two columns of one name: that of a quantity and that of the positions, or of a component of another one.
    fn columns(&mut self, output: &wfl::Output, line: &LineSample) {
        let columns = line.columns();
        let Some(twice) = columns.iter().enumerate().find(|(k, name)| columns[..*k].contains(name)) else { return };
        let d = Diagnostic::new(Code::E433, format!("two columns of one file are called `{}`", twice.1));
        let of = |item: &&wfl::OutputQuantity| item.name == *twice.1;
        let place = output.items.iter().find(of).map_or(output.span, |item| item.span);
        let d = d.at(place, "s, x, y and z are the distance along the line and the position");
        self.diagnostics.push(d.help("u as displacement gives a quantity another name"));
    }

    /// E435 for a line of which nothing is sampled, W415 for one with points outside the mesh or a quantity that lives
    /// on no point of it.
    fn outside(&mut self, output: &wfl::Output, line: &LineSample) {
        let Some((from, to)) = &output.along else { return };
        let span = from.span.to(to.span);
        self.columns(output, line);
        let n = line.n_points();
        let found = line.found();
        if found.iter().all(|f| !f) && !line.is_empty() {
            let d = Diagnostic::new(
                Code::E435,
                format!("no point of the line of `{}` is in a body of its quantities", output.file),
            );
            let (low, high) = self.parts.mesh.bounds();
            let dim = self.parts.mesh.dim();
            self.diagnostics.push(d.at(span, format!("the mesh spans {:?} to {:?}", &low[..dim], &high[..dim])));
            return;
        }
        let missing: Vec<[f64; 3]> = line.points().iter().zip(&found).filter(|(_, f)| !**f).map(|(x, _)| *x).collect();
        let all: Vec<CellId> = if missing.is_empty() { Vec::new() } else { self.parts.mesh.cells().collect() };
        let inside = Located::in_cells(self.parts.mesh, &all, &missing);
        let outside = missing.len() - inside.points.iter().map(Vec::len).sum::<usize>();
        if outside > 0 {
            let held: BTreeSet<usize> = inside.points.iter().flatten().copied().collect();
            let first = (0..missing.len()).find(|k| !held.contains(k)).map_or([0.0; 3], |k| missing[k]);
            let d = Diagnostic::new(Code::W415, format!("{outside} of {n} points of a line lie outside the mesh"));
            let text = format!("`nan` there, the first at {:?}", &first[..self.parts.mesh.dim()]);
            self.diagnostics.push(d.at(span, text));
        }
        let between = missing.len() - outside;
        if between > 0 {
            let text = format!("{between} of {n} points of a line lie in no body of its quantities");
            let d = Diagnostic::new(Code::W415, text).at(span, "`nan` there, in a body that has none of them");
            self.diagnostics.push(d);
        }
        for name in line.nowhere() {
            let item = output.items.iter().find(|i| i.name == name).map_or(span, |i| i.span);
            let d = Diagnostic::new(Code::W415, format!("`{name}` lives on no point of this line"));
            self.diagnostics.push(d.at(item, "`nan` in every row").at(span, "the line"));
        }
    }

    /// E433 for files of one name, and for two quantities of one name in a file.
    fn names(&mut self) {
        let several = self.steps.is_none_or(Steps::several);
        self.diagnostics.extend(written::shared(self.parts.script, several));
        for output in &self.parts.script.outputs {
            for (i, item) in output.items.iter().enumerate() {
                if item.name == PART && output.format.name == "vtk" {
                    let text = format!("`{PART}` is the number of the body in a file for viewers");
                    let d = Diagnostic::new(Code::E433, text);
                    self.diagnostics.push(d.at(item.span, "").help("u as share gives a quantity another name"));
                }
                if let Some(first) = output.items[..i].iter().find(|f| f.name == item.name) {
                    let d =
                        Diagnostic::new(Code::E433, format!("two quantities of one file are called `{}`", item.name));
                    let d = d.at(item.span, "").at(first.span, "the first one");
                    self.diagnostics.push(d.help("u as displacement gives one another name"));
                }
            }
        }
    }

    /// The number behind `every`; `None` after a message.
    pub(super) fn every(&mut self, output: &wfl::Output) -> Option<Cadence> {
        let when = self.event(output)?;
        let Some(e) = &output.every else {
            let usual = self.steps.map_or(Cadence { every: Every::Count(1), when: None }, Cadence::usual);
            return Some(Cadence { when, ..usual });
        };
        let mut names = (false, false);
        wfl::each_name(e, &mut |word| {
            let unit = self.parts.script.params.iter().any(|p| p.name.name == word && p.unit.is_some());
            names = (true, names.1 || unit);
        });
        if names.1 || names.0 && self.steps.is_some_and(|s| s.auto.is_some()) {
            let by = number(self.parts.env, "a length of the step variable", e, self.diagnostics)?;
            if by > 0.0 {
                return Some(Cadence { every: Every::Spaced { by, met: true }, when });
            }
        }
        let n = number(self.parts.env, "a number of steps", e, self.diagnostics)?;
        if n.fract() != 0.0 || !(1.0..=MAX_EVERY).contains(&n) {
            let d = Diagnostic::new(Code::E414, format!("`every` takes a whole number from 1, found {n}"));
            self.diagnostics.push(d.at(e.span, "`every 10` writes each tenth step, and the last one"));
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        Some(Cadence { every: Every::Count(n as usize), when })
    }

    /// The number of the event behind `when`; `None` after a message.
    #[expect(clippy::option_option, reason = "no event, and an unknown one")]
    pub(super) fn event(&mut self, output: &wfl::Output) -> Option<Option<usize>> {
        let Some(name) = &output.when else { return Some(None) };
        let found = self.parts.script.events.iter().position(|e| e.name.name == name.name);
        if found.is_none() {
            let d = Diagnostic::new(Code::E414, format!("`when` takes an event, and `{}` is none", name.name));
            self.diagnostics.push(d.at(name.span, "").help("event quake = max(V) on fault > 1e-3"));
            return None;
        }
        Some(found)
    }

    /// A plain field on a face, from whichever side it lives on.
    fn on_face(&self, face: &Target, e: &Expr) -> Option<ValueLaw> {
        if let Ok(law) = self.try_compile(face, e) {
            return Some(law);
        }
        let name = |n: &str| Expr { kind: ExprKind::Name(n.to_owned()), span: e.span, expansion: None };
        let args = vec![wfl::ast::Argument::Expr(e.clone()), wfl::ast::Argument::Expr(name("neighbor_element"))];
        let other = Expr { kind: ExprKind::Call(Box::new(name("Interpolate")), args), span: e.span, expansion: None };
        self.try_compile(face, &other).ok()
    }

    fn add(
        &mut self,
        pieces: &mut Vec<(SupportSet, SampledPiece)>,
        target: &Target,
        law: ValueLaw,
        name: &str,
        degree: usize,
        span: Span,
    ) {
        jumps::check(self.parts, &target.sig.name, &target.support.region(), &law.jumps, self.diagnostics);
        let position = match pieces.iter().position(|(s, _)| self.are_one(s, &target.support)) {
            Some(p) => p,
            None => match SampledPiece::new(
                self.parts.mesh,
                self.parts.topology,
                self.parts.fields,
                &target.support,
                degree,
            ) {
                Ok(piece) => {
                    pieces.push((target.support.clone(), piece));
                    pieces.len() - 1
                }
                Err(e) => {
                    self.diagnostics.push(Diagnostic::new(Code::E416, e.to_string()).at(span, ""));
                    return;
                }
            },
        };
        let points = match self.own_points(&law, target, span) {
            Ok(points) => points,
            Err(points::Told) => return,
        };
        let added = Value::new(law, self.backend).map_err(|e| e.to_string()).and_then(|v| {
            let (piece, name) = (&mut pieces[position].1, name.to_owned());
            match points {
                Some(domain) => piece.add_means(self.parts.mesh, self.parts.fields, name, v, domain),
                None => piece.add(self.parts.mesh, self.parts.fields, name, v),
            }
            .map_err(|e| e.to_string())
        });
        if let Err(text) = added {
            self.diagnostics.push(Diagnostic::new(Code::E416, text).at(span, ""));
        }
    }

    fn csv(&mut self, output: &wfl::Output, bodies: &[Target]) -> Option<CsvOutput> {
        let Some((from, to)) = &output.along else {
            let d = Diagnostic::new(Code::E416, "`output csv` needs a line, along [..] to [..], or points: at [..]");
            self.diagnostics.push(d.at(output.format.span, ""));
            return None;
        };
        let a = numbers(self.parts.env, "the start of the line", from, self.diagnostics)?;
        let b = numbers(self.parts.env, "the end of the line", to, self.diagnostics)?;
        let dim = self.parts.mesh.dim();
        if a.len() != dim || b.len() != dim {
            let d = Diagnostic::new(Code::E108, format!("the ends of a line have {dim} coordinates here"));
            self.diagnostics.push(d.at(to.span, ""));
            return None;
        }
        let mut n = DEFAULT_POINTS;
        for option in &output.options {
            match (&option.value, option.name.name.as_str()) {
                (Some(OptionValue::Expr(e)), "points") => {
                    n = number(self.parts.env, "a number of points", e, self.diagnostics)?
                }
                (_, name) => {
                    let d = Diagnostic::new(Code::E414, format!("option `{name}` is not understood here"));
                    self.diagnostics.push(d.at(option.name.span, "known: points=101"));
                }
            }
        }
        if n.fract() != 0.0 || !(1.0..=MAX_POINTS).contains(&n) {
            let d = Diagnostic::new(Code::E414, format!("a line has 1 to {MAX_POINTS} points, found {n}"));
            self.diagnostics.push(d.at(output.format.span, ""));
            return None;
        }
        let point = |v: &[f64]| [0, 1, 2].map(|d| v.get(d).copied().unwrap_or(0.0));
        let faces = self.faces_of_lines();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        let mut line = LineSample::new(self.parts.mesh, point(&a), point(&b), n as usize);
        for item in &output.items {
            let name = item.name.clone();
            for (target, law) in self.homes(bodies, &faces, &item.expr) {
                if let Some(d) = refused(law.mapping, "a value along a line", item.expr.span) {
                    self.diagnostics.push(d);
                    continue;
                }
                let Parts { mesh, fields, .. } = self.parts;
                if let Some(d) = self.state_at_points(&law, item.span, (from.span.to(to.span), "the line")) {
                    self.diagnostics.push(d);
                    break;
                }
                let added = Value::new(law, self.backend).map_err(|e| e.to_string()).and_then(|v| {
                    let located = Located::new(mesh, &target.support.region(), line.points());
                    let located = located.map_err(|e| e.to_string())?;
                    line.add(mesh, fields, name.clone(), v, located).map_err(|e| e.to_string())
                });
                if let Err(text) = added {
                    self.diagnostics.push(Diagnostic::new(Code::E416, text).at(item.expr.span, ""));
                }
            }
        }
        self.parts.mesh.check_whole(|| self.outside(output, &line));
        Some(CsvOutput { file: output.file.clone(), every: self.every(output)?, line })
    }
}
