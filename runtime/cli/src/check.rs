//! `wfl check`: everything but solving.

use std::{
    collections::{BTreeMap, BTreeSet},
    process::ExitCode,
    time::Instant,
};

use serde_json::{Map, Value, json};
use wfl::{
    Span,
    ast::{MeasureAt, Place, Reduction},
};
use wfl_compiler::types::FieldKind;
use wfl_discrete::{field::FieldSpace, system::FIXED};
use wfl_linear::LinearSolver;
use wfl_mesh::{
    element::Family,
    mesh::{self, FacetId, Mesh, Polynomials, RegionSet},
};
use wfl_newton::planned_stages;
use wfl_problem::{Cadence, Scene};
use wfl_sparse::solve::{Linked, SolverOptions};
use wfl_tasks::{
    Loaded,
    advice::{contact::warnings, hourglass, signs},
    folder::error_line,
};

use crate::{
    accuracy,
    args::CheckArgs,
    contact,
    load::{load_with_knobs, out, print_all, say},
    prepared::{EXIT_ERROR, backend, prepare_scene, sign_of_life},
    solvers, summary,
    table::{Table, number},
    together::shares_files,
};

pub(crate) fn check(args: &CheckArgs, started: Instant) -> ExitCode {
    if let Some(why) = solvers::missing(args.backend) {
        say(&error_line(&why));
        return ExitCode::from(EXIT_ERROR);
    }
    let Some(mut loaded) = load_with_knobs(&args.scene.scene, &args.scene.overrides, "check") else {
        return ExitCode::from(EXIT_ERROR);
    };
    let parse = started.elapsed().as_secs_f64();
    let preparing = sign_of_life();
    let Some(backend) = backend(false) else { return ExitCode::from(EXIT_ERROR) };
    let Some(scene) = prepare_scene(&mut loaded, &*backend, &[]) else { return ExitCode::from(EXIT_ERROR) };
    loaded.messages.extend(hourglass::rules(&loaded, &scene));
    let forms = scene.contact_forms();
    let of_contact = warnings(&loaded, &forms);
    let of_signs = signs::forces(&loaded, &scene, &of_contact);
    loaded.messages.extend(of_signs.into_iter().chain(of_contact));
    let shared = shares_files(&loaded, &scene);
    loaded.messages.extend(shared);
    drop(preparing);
    print_all(&loaded.messages, &loaded.sources);
    let accuracy = accuracy::table(&loaded, &scene);
    let mut tables = tables(&loaded, &scene, args.backend.library(), parse);
    tables.insert(1, accuracy);
    let terms = tables.iter().position(|t| t.name == "terms").map_or(tables.len(), |k| k + 1);
    tables.insert(terms, contact::table(&loaded, &scene, &forms));
    if args.json {
        let mut all = Map::new();
        all.insert("scene".to_owned(), loaded.name.clone().into());
        for table in &tables {
            all.insert(table.name.replace(' ', "_"), table.json());
        }
        out(&format!("{:#}\n", Value::Object(all)));
    } else if !args.all {
        out(&summary::text(&loaded, &tables));
    } else {
        let texts: Vec<String> = tables.iter().map(Table::text).filter(|t| !t.is_empty()).collect();
        out(&texts.join("\n"));
    }
    if loaded.messages.iter().any(wfl::Diagnostic::is_error) { ExitCode::from(EXIT_ERROR) } else { ExitCode::SUCCESS }
}

fn tables(loaded: &Loaded, scene: &Scene, library: Option<Linked>, parse: f64) -> Vec<Table> {
    let mut list = vec![mesh_table(&scene.system.mesh)];
    list.extend(refinements(loaded, scene));
    list.extend([quality(scene), regions(loaded, scene)]);
    list.extend([interfaces(scene), fields(loaded, scene), rims(scene), parameters(loaded, scene)]);
    list.push(units(loaded));
    list.extend(tables_read(loaded));
    list.extend([terms(scene), conditions(loaded, scene), measures(loaded), outputs(loaded, scene)]);
    list.extend([
        system(scene, library),
        ranks(scene, library),
        schedule(scene),
        left_out(loaded, scene),
        times(scene, parse),
    ]);
    list
}

/// The text of a place on one line.
fn line(loaded: &Loaded, span: Span) -> Value {
    let text = loaded.sources.snippet(span);
    let without_comments = text.lines().map(|l| l.split('#').next().unwrap_or(l));
    without_comments.flat_map(str::split_whitespace).collect::<Vec<_>>().join(" ").into()
}

/// What cells a mesh has.
pub(crate) fn mesh_table(mesh: &Mesh) -> Table {
    let mut table = Table::new("mesh", &["cells", "kind", "dimension", "order", "nodes", "from", "to"]);
    let mut kinds = mesh.kinds().to_vec();
    kinds.sort_by_key(|k| k.index());
    let (low, high) = mesh.bounds();
    for same in kinds.chunk_by(|a, b| a == b) {
        let corner = |x: &[f64; 3]| Value::from(x[..mesh.dim()].iter().map(|v| number(*v)).collect::<Vec<_>>());
        table.push(vec![
            same.len().into(),
            same[0].to_string().into(),
            mesh.dim().into(),
            mesh.order().into(),
            mesh.n_nodes().into(),
            corner(&low),
            corner(&high),
        ]);
    }
    table
}

/// The `refine` statements, with the cells before and after each.
fn refinements(loaded: &Loaded, scene: &Scene) -> Option<Table> {
    let refined = scene.refined.as_ref().filter(|r| !r.statements.is_empty())?;
    let mut table = Table::new("refinements", &["statement", "cells before", "cells after"]);
    let mut before = refined.cells_before;
    for (span, after) in &refined.statements {
        table.push(vec![line(loaded, *span), before.into(), (*after).into()]);
        before = *after;
    }
    Some(table)
}

/// The files that `table` reads.
fn tables_read(loaded: &Loaded) -> Option<Table> {
    let read = &loaded.script.tables;
    let mut table = Table::new("tables", &["file", "over", "unit", "column", "unit of column", "rows", "from", "to"]);
    for file in read {
        let unit = |head: &wfl::Head| head.unit.as_ref().map_or(Value::Null, |u| u.to_string().into());
        let name = |head: &wfl::Head| head.name.clone().map_or(Value::Null, Value::from);
        for (curve, head) in file.curves.iter().zip(&file.heads[1..]) {
            let (from, to) = curve.range();
            table.push(vec![
                file.name.clone().into(),
                name(&file.heads[0]),
                unit(&file.heads[0]),
                name(head),
                unit(head),
                curve.values.len().into(),
                from.into(),
                to.into(),
            ]);
        }
    }
    (!read.is_empty()).then_some(table)
}

/// What the mesh is like, and what is odd about it.
fn quality(scene: &Scene) -> Table {
    let mesh = &scene.system.mesh;
    let found = mesh::summary(mesh);
    let odd = mesh.warnings();
    let columns = ["smallest cell", "largest cell", "longest to shortest edge", "unused nodes", "nodes not joined"];
    let mut table = Table::new("cell sizes", &columns);
    let mut row: Vec<Value> = [found.min_size, found.max_size, found.max_aspect].map(|x| short(x).into()).to_vec();
    row.extend([odd.unused_nodes.len().into(), odd.duplicate_nodes.len().into()]);
    table.push(row);
    table
}

/// Six digits are enough for a size.
fn short(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

/// Volume, area or length of a region; none for nodes.
fn measure(mesh: &mesh::Mesh, set: &RegionSet) -> Value {
    let sum = |parts: Vec<f64>| short(parts.iter().sum()).into();
    match set {
        RegionSet::Cells(cells) => sum(mesh::cell_volumes(mesh, cells)),
        RegionSet::Facets(facets) => sum(mesh::facet_measures(mesh, facets)),
        RegionSet::Interface(pairs) => {
            sum(mesh::facet_measures(mesh, &pairs.iter().map(|p| p.here).collect::<Vec<_>>()))
        }
        RegionSet::Edges(edges) if mesh.dim() > 2 => sum(mesh::edge_lengths(mesh, edges)),
        RegionSet::Edges(_) | RegionSet::Nodes(_) => Value::Null,
    }
}

fn regions(loaded: &Loaded, scene: &Scene) -> Table {
    let mut table = Table::new("regions", &["name", "kind", "members", "measure", "statement"]);
    let mut list: Vec<_> = scene.regions.iter().collect();
    // as in the text; what exists without a statement comes first
    list.sort_by_key(|(_, r)| r.span.map(|s| (s.source.index(), s.start)));
    for (name, region) in list {
        let kind = match region.set {
            RegionSet::Cells(_) => "cells",
            RegionSet::Facets(_) => "faces",
            RegionSet::Interface(_) => "interface",
            RegionSet::Edges(_) | RegionSet::Nodes(_) => "nodes",
        };
        let statement = region.span.map_or(Value::Null, |s| line(loaded, s));
        table.push(vec![
            name.clone().into(),
            kind.into(),
            region.set.len().into(),
            measure(&scene.system.mesh, &region.support()),
            statement,
        ]);
    }
    table
}

/// Sheets shown of one interface; of more their number is told.
const SHEETS_SHOWN: usize = 12;

/// Where `Normal` points on each connected sheet of the declared interfaces, and where fields stay joined.
fn interfaces(scene: &Scene) -> Table {
    let columns = ["name", "sheet", "faces", "measure", "mean normal", "from", "to", "front nodes"];
    let mut table = Table::new("interfaces", &columns);
    let mesh = &scene.system.mesh;
    let mut list: Vec<_> = scene.regions.iter().filter(|(_, r)| r.span.is_some()).collect();
    list.sort_by_key(|(_, r)| r.span.map(|s| (s.source.index(), s.start)));
    let torn = torn(scene);
    for (name, region) in list {
        let RegionSet::Interface(pairs) = &region.set else { continue };
        let sheets = mesh::sheets_of(mesh, pairs);
        if sheets.len() > SHEETS_SHOWN {
            let area = short(sheets.iter().map(|s| s.area).sum());
            let number = format!("{} sheets", sheets.len());
            let mut row = vec![name.clone().into(), number.into(), pairs.len().into(), area.into()];
            row.resize(columns.len(), Value::Null);
            table.push(row);
            continue;
        }
        for (k, sheet) in sheets.iter().enumerate() {
            let vector = |x: [f64; 3]| Value::from(x[..mesh.dim()].iter().map(|c| short(*c)).collect::<Vec<_>>());
            let vertices = sheet.facets.iter().flat_map(|f| mesh.facet_vertices(f.here).vertices().to_vec());
            let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for x in vertices.map(|v| mesh.node(v)) {
                low = std::array::from_fn(|i| x[i].min(low[i]));
                high = std::array::from_fn(|i| x[i].max(high[i]));
            }
            let is_torn = sheet.facets.iter().all(|f| torn.contains(&scene.topology.facet_id(f.here)));
            let front = is_torn.then(|| mesh::front_nodes(mesh, &scene.topology, &sheet.facets, &torn).len());
            table.push(vec![
                name.clone().into(),
                (k + 1).into(),
                sheet.facets.len().into(),
                short(sheet.area).into(),
                vector(sheet.mean_normal.map(|c| if c.abs() < NO_DIGITS { 0.0 } else { c })),
                vector(low),
                vector(high),
                front.map_or(Value::Null, Value::from),
            ]);
        }
    }
    table
}

/// Components of a mean unit normal below this are rounding.
const NO_DIGITS: f64 = 1e-12;

/// The faces along which some field is split.
fn torn(scene: &Scene) -> BTreeSet<FacetId> {
    let spaces = scene.system.fields.iter().filter_map(|f| match &f.space {
        FieldSpace::Nodal(space) => Some(space),
        _ => None,
    });
    spaces.flat_map(|space| space.torn().iter().map(|f| scene.topology.facet_id(*f))).collect()
}

fn kind_word(kind: FieldKind) -> &'static str {
    match kind {
        FieldKind::Unknown => "unknown",
        FieldKind::Multiplier => "multiplier",
        FieldKind::Data => "data",
        FieldKind::State => "state",
    }
}

fn fields(loaded: &Loaded, scene: &Scene) -> Table {
    let columns = ["name", "kind", "shape", "element", "on", "nodes", "dofs", "free dofs"];
    let mut table = Table::new("fields", &columns);
    let system = &scene.system;
    let tensor = system.mesh.kinds().iter().all(|k| k.polynomials() == Polynomials::Each);
    for (k, (field, declared)) in system.fields.iter().zip(&loaded.script.fields).enumerate() {
        let element = match &field.space {
            FieldSpace::Global => "one value".to_owned(),
            FieldSpace::Points(_) => "integration points".to_owned(),
            FieldSpace::Nodal(space) => {
                let broken = if space.family() == Family::Discontinuous { "D" } else { "" };
                format!("{broken}{}{}", if tensor { "Q" } else { "P" }, space.degree())
            }
        };
        let on: Vec<String> = match &declared.space.place {
            Place::On(list) => list.iter().map(|n| n.name.clone()).collect(),
            Place::Global(_) => vec!["global".to_owned()],
            Place::Everywhere => vec!["all".to_owned()],
        };
        let range = system.range(k);
        let free = range.clone().map(|r| r.filter(|d| system.numbering.free[*d] != FIXED).count());
        table.push(vec![
            field.name.clone().into(),
            kind_word(field.kind).into(),
            scene.sigs[k].shape.to_string().into(),
            element.into(),
            on.into(),
            field.n_nodes().into(),
            range.map_or(0, |r| r.len()).into(),
            free.unwrap_or(0).into(),
        ]);
    }
    table
}

/// Where fluxes of fields on faces meet no condition at the rim of the faces.
fn rims(scene: &Scene) -> Table {
    let columns = ["field", "rim", "without a condition", "from", "to", "flux out of it"];
    let mut table = Table::new("rims", &columns);
    let dim = scene.system.mesh.dim();
    let corner = |x: &[f64; 3]| Value::from(x[..dim].iter().map(|c| short(*c)).collect::<Vec<_>>());
    for rim in scene.rims_of_fields() {
        let row = |part: &str, n: usize| vec![rim.field.clone().into(), part.into(), n.into()];
        let what = match (dim, rim.edges) {
            (3, 1) => "edge",
            (3, _) => "edges",
            (_, 1) => "end",
            _ => "ends",
        };
        let all = format!("{} {what}", rim.edges);
        if rim.open.is_empty() {
            table.push([row(&all, 0), vec![Value::Null; 3]].concat());
        }
        if rim.open.len() > SHEETS_SHOWN {
            let n = rim.open.iter().map(|part| part.edges).sum();
            let pieces = format!("{all}, {} pieces", rim.open.len());
            table.push([row(&pieces, n), vec![Value::Null, Value::Null, "none".into()]].concat());
            continue;
        }
        for part in &rim.open {
            let place = vec![corner(&part.low), corner(&part.high), "none".into()];
            table.push([row(&all, part.edges), place].concat());
        }
    }
    table
}

fn parameters(loaded: &Loaded, scene: &Scene) -> Table {
    let mut table = Table::new("parameters", &["name", "value", "given by", "what it is"]);
    let by_name: BTreeMap<&str, &wfl::Param> = loaded.script.params.iter().map(|p| (p.name.name.as_str(), p)).collect();
    for (name, value) in &scene.params {
        let Some(declared) = by_name.get(name.as_str()) else { continue };
        let value = match value.values.as_slice() {
            [x] => json!(x),
            list => json!(list),
        };
        let by = if declared.overridden.is_some() { "command line" } else { "scene" };
        let text = declared.text.clone().map_or(Value::Null, Value::from);
        table.push(vec![name.clone().into(), value, by.into(), text]);
    }
    table
}

/// The classes and kernels of all terms; also the view `terms` of `wfl show`.
pub(crate) fn terms(scene: &Scene) -> Table {
    let columns = ["name", "on", "class", "symmetric", "kinks", "rule", "points", "why", "residual", "tangent"];
    let mut table = Table::new("terms", &columns);
    for (summary, term) in scene.terms.iter().zip(&scene.system.terms) {
        let rule = summary.rule.words();
        table.push(vec![
            summary.name.clone().into(),
            summary.place.clone().into(),
            summary.class.word().into(),
            summary.symmetric.into(),
            term.law.kinks.len().into(),
            rule.into(),
            summary.n_points.into(),
            summary.why.clone().into(),
            summary.instructions.0.into(),
            summary.instructions.1.into(),
        ]);
    }
    table
}

fn conditions(loaded: &Loaded, scene: &Scene) -> Table {
    let script = &loaded.script;
    let mut table = Table::new("conditions", &["kind", "statement"]);
    let mut push = |kind: &str, span: Span| table.push(vec![kind.into(), line(loaded, span)]);
    script.fixes.iter().for_each(|c| push("fixed", c.span));
    script.loads.iter().for_each(|c| push("load", c.span));
    script.starts.iter().for_each(|s| push("start", s.span));
    script.scheme.iter().for_each(|s| push("scheme", s.span));
    script.solver.iter().for_each(|s| push("solver", s.span));
    script.quadratures.iter().for_each(|q| push("rule", q.span));
    script.gradients.iter().for_each(|g| push("derivatives", g.span));
    script.expects.iter().for_each(|e| push("expected", e.span));
    if let Some(steps) = &script.steps {
        push(&scene.steps.listed().map_or_else(|| "chosen steps".to_owned(), |n| format!("{n} steps")), steps.span);
    }
    table
}

/// What the names of a scene are measured in; no rows if nothing in the scene has a unit.
fn units(loaded: &Loaded) -> Table {
    let mut table = Table::new("units", &["name", "unit"]);
    for known in wfl::unit_report(&loaded.script, &loaded.sources) {
        table.push(vec![known.name.into(), known.unit.into()]);
    }
    table
}

fn measures(loaded: &Loaded) -> Table {
    let mut table = Table::new("measures", &["name", "what", "on", "of"]);
    for m in &loaded.script.measures {
        let what = match m.reduction {
            Reduction::Mean => "mean",
            Reduction::Max => "max",
            Reduction::Min => "min",
            Reduction::Integral => "integral",
            Reduction::Value => "value",
            Reduction::Reaction => "reaction",
            Reduction::Balance(_) => "balance",
        };
        let on: Vec<Value> = match &m.at {
            MeasureAt::Rule => m.places.iter().map(|p| p.name.clone().into()).collect(),
            MeasureAt::Nodes => m.places.iter().map(|p| format!("nodes of {}", p.name).into()).collect(),
            MeasureAt::Point(x) => vec![line(loaded, x.span)],
        };
        table.push(vec![m.name.name.clone().into(), what.into(), on.into(), line(loaded, m.expr.span)]);
    }
    for m in &loaded.script.computed {
        let on = m.watched.iter().flat_map(|w| &w.places).map(|p| p.name.clone()).collect::<BTreeSet<_>>();
        let on: Vec<Value> = on.into_iter().map(Value::from).collect();
        table.push(vec![m.name.name.clone().into(), "number".into(), on.into(), line(loaded, m.expr.span)]);
    }
    table
}

/// What is written, and what a run of all steps would write of it.
fn outputs(loaded: &Loaded, scene: &Scene) -> Table {
    let mut table = Table::new("outputs", &["format", "file", "quantities", "files", "about MB"]);
    // where nothing bounds them, as many as steps are expected
    let times = |every: &Cadence| every.n_files(&scene.steps).unwrap_or_else(|| scene.steps.expected());
    let many = |every: &Cadence, bytes: usize| (times(every), times(every) * bytes);
    let vtk = scene.vtk.iter().map(|v| ("vtk", &v.file, many(&v.every, v.bytes())));
    let csv = scene.csv.iter().map(|c| ("csv", &c.file, many(&c.every, c.bytes())));
    // the rows of all steps are in one file
    let series = scene.series.iter().map(|c| ("csv", &c.file, (1, many(&c.every, c.bytes()).1)));
    let made: Vec<_> = vtk.chain(csv).chain(series).collect();
    for o in &loaded.script.outputs {
        let items: Vec<Value> = o.items.iter().map(|i| i.name.clone().into()).collect();
        let found = made.iter().find(|m| (m.0, m.1) == (o.format.name.as_str(), &o.file));
        let (files, bytes) = found.map_or((0, 0), |m| m.2);
        #[expect(clippy::cast_precision_loss, reason = "a size with few digits")]
        let size = short(bytes as f64 / 1e6);
        table.push(vec![o.format.name.clone().into(), o.file.clone().into(), items.into(), files.into(), size.into()]);
    }
    table
}

fn system(scene: &Scene, library: Option<Linked>) -> Table {
    let numbering = &scene.system.numbering;
    let mut table = Table::new("system", &["dofs", "fixed", "free", "solver"]);
    let free = numbering.n_free();
    let solutions = scene.steps.expected();
    let options = SolverOptions { method: scene.newton.linear, solutions, library, ..SolverOptions::default() };
    let solver = LinearSolver::plan(&scene.system, &options).to_string();
    table.push(vec![numbering.n_dofs.into(), (numbering.n_dofs - free).into(), free.into(), solver.into()]);
    table
}

/// What several ranks would have of the mesh; empty with the solvers of this program, which run on one.
fn ranks(scene: &Scene, library: Option<Linked>) -> Table {
    let mut table = Table::new("several ranks", &["mesh", "why"]);
    if library.is_some() {
        let row = match scene.needs_whole_mesh() {
            None => vec!["a part on each rank".into(), Value::Null],
            Some(why) => vec!["whole on each rank".into(), why.into()],
        };
        table.push(row);
    }
    table
}

/// The methods that a load step may come to, in their order.
fn schedule(scene: &Scene) -> Table {
    let mut table = Table::new("newton", &["method", "iterations", "steps"]);
    for stage in planned_stages(&scene.system, &scene.contact, scene.newton) {
        table.push(vec![stage.method.name().into(), stage.iterations.into(), stage.when.into()]);
    }
    table
}

fn left_out(loaded: &Loaded, scene: &Scene) -> Table {
    let mut table = Table::new("optimisations", &["name", "why", "turned off by"]);
    for l in scene.left_out() {
        let switch = l.switch.map_or(Value::Null, |s| format!("--no-prune {}", s.name()).into());
        table.push(vec![l.name.into(), l.why.into(), switch]);
    }
    let own = |m: &&wfl::MacroInfo| !loaded.sources.get(m.head.source).name.starts_with("<library>");
    for m in loaded.script.macros.iter().filter(own).filter(|m| !m.used) {
        table.push(vec![m.name.name.clone().into(), "an unused def".into(), Value::Null]);
    }
    table
}

fn times(scene: &Scene, parse: f64) -> Table {
    let mut table = Table::new("seconds", &["parse", "compile", "text to kernels", "mesh"]);
    let round = |x: f64| json!((x * 1e6).round() / 1e6);
    let compile = scene.times.compile;
    table.push(vec![round(parse), round(compile), round(parse + compile), round(scene.times.mesh)]);
    table
}
