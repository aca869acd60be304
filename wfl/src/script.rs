//! The resolved script: what the next crates read. Plain data, macros expanded, statements sorted by kind.
//!
//! Words inside expressions are not looked up here; the compiler does that, where shapes and places are known.

use std::sync::Arc;

use crate::{
    ast::{AtSteps, BalancePart, Crosspoints, Differentiated, Reduction, Refine, RegionExpr, Space, Target, Unit},
    ast::{
        Cond, Domain, Expansions, Expr, ExprKind, Ident, MappingKind, MeasureAt, MeshSource, OptionItem, QuadratureRule,
    },
    codes::Code,
    diag::Diagnostic,
    lost::Lost,
    source::{SourceId, SourceMap, Span},
    tables::Table,
    walk::each_name,
    words::split_prefixes,
};

/// A scene whose names of statements are checked and whose macros are expanded. Lists are in the order of the text.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedScript {
    /// The text of the scene itself.
    pub main: SourceId,
    /// The mesh; absent only beside errors.
    pub mesh: Option<MeshStmt>,
    /// Refinements of the mesh, one after the other.
    pub refinements: Vec<Refinement>,
    /// Parameters.
    pub params: Vec<Param>,
    /// Regions, sorted so that a region stands behind those it is made of.
    pub regions: Vec<Region>,
    /// Mappings to other points.
    pub mappings: Vec<Mapping>,
    /// Unknowns, multipliers, data and states.
    pub fields: Vec<Field>,
    /// Names of regions that the scene uses and does not declare, where they stand first: only the groups of a mesh
    /// file can have them. Empty without a mesh file.
    pub groups: Vec<Ident>,
    /// Fields that are split along interior faces.
    pub splits: Vec<Split>,
    /// Terms and energies.
    pub terms: Vec<Term>,
    /// Prescribed values.
    pub fixes: Vec<Condition>,
    /// Loads.
    pub loads: Vec<Condition>,
    /// First guesses.
    pub starts: Vec<Start>,
    /// Load or time steps.
    pub steps: Option<Steps>,
    /// The solver, if one is chosen.
    pub solver: Option<Solver>,
    /// The scheme of time integration.
    pub scheme: Option<Scheme>,
    /// Rules of integration that replace the default.
    pub quadratures: Vec<Quadrature>,
    /// Numbers to print.
    pub measures: Vec<Measure>,
    /// What is added up; its numbers are measures, too.
    pub balances: Vec<Balance>,
    /// Numbers that measures make.
    pub computed: Vec<Computed>,
    /// What begins and ends during the steps.
    pub events: Vec<Event>,
    /// Derivatives to find.
    pub gradients: Vec<Gradient>,
    /// Conditions that must hold at the end.
    pub expects: Vec<Expect>,
    /// Files to write.
    pub outputs: Vec<Output>,
    /// Macros of the scene and of its included files.
    pub macros: Vec<MacroInfo>,
    /// Every use of a macro.
    pub expansions: Expansions,
    /// The files that `table` reads, each once, by their names.
    pub tables: Vec<Arc<Table>>,
    /// Names whose statements have errors and are not in these lists.
    pub lost: Lost,
}

impl ResolvedScript {
    /// The names of the measures that `scheme ... energy` asks for; none without it.
    #[must_use]
    pub fn energies(&self) -> Vec<String> {
        let asked = self.scheme.iter().flat_map(|s| &s.options).any(|o| o.name.name == "energy");
        if asked { Self::energies_of(&self.terms_with_energy()) } else { Vec::new() }
    }

    /// The names of the measures of a balance of energy over these terms: kinetic energy, what each term has taken up, the
    /// work of loads and of prescribed values, what is lost.
    #[must_use]
    pub fn energies_of(terms: &[String]) -> Vec<String> {
        let ends = ["kinetic"].into_iter().chain(terms.iter().map(String::as_str));
        ends.chain(["loads", "prescribed", "lost"]).map(|end| format!("energy_{end}")).collect()
    }

    /// The terms of the equations of some fields, each name once. Terms without a name are numbered.
    #[must_use]
    pub fn terms_of(&self, fields: &[Ident]) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for (k, term) in self.terms.iter().enumerate() {
            let mut is_of = false;
            each_name(&term.expr, &mut |word| {
                let (prefixes, root) = split_prefixes(word);
                let in_equation = term.energy || prefixes.contains("Test_");
                is_of |= in_equation && fields.iter().any(|f| f.name == root);
            });
            let name = term.name.as_ref().map_or_else(|| format!("term{}", k + 1), |n| n.name.clone());
            if is_of && !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    /// The terms that are more than inertia, each name once. Terms without a name are numbered.
    #[must_use]
    pub fn terms_with_energy(&self) -> Vec<String> {
        let solved_for = |kind: &FieldKind| matches!(kind, FieldKind::Unknown | FieldKind::Multiplier { .. });
        let mut names: Vec<String> = Vec::new();
        for (k, term) in self.terms.iter().enumerate() {
            let mut only_inertia = false;
            each_name(&term.expr, &mut |word| only_inertia |= split_prefixes(word).0.contains("Dot2_"));
            each_name(&term.expr, &mut |word| {
                let (prefixes, root) = split_prefixes(word);
                let is_field = self.fields.iter().any(|f| f.name.name == root && solved_for(&f.kind));
                only_inertia &= !is_field || prefixes.contains("Dot2_") || prefixes.contains("Test_");
            });
            let name = term.name.as_ref().map_or_else(|| format!("term{}", k + 1), |n| n.name.clone());
            if !only_inertia && !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }
}

/// `mesh ...`
#[derive(Clone, Debug, PartialEq)]
pub struct MeshStmt {
    /// Box or file.
    pub source: MeshSource,
    /// The new place of each node.
    pub map: Option<Expr>,
    /// Options.
    pub options: Vec<OptionItem>,
    /// The statement.
    pub span: Span,
}

/// `refine ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Refinement {
    /// Which cells, and how.
    pub what: Refine,
    /// The statement.
    pub span: Span,
}

/// `param ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Param {
    /// Its name.
    pub name: Ident,
    /// Its value: as declared, or from an [`crate::Override`].
    pub value: Expr,
    /// Its unit.
    pub unit: Option<Unit>,
    /// Allowed values, not checked here.
    pub domain: Option<Domain>,
    /// What it is, in words.
    pub text: Option<String>,
    /// The place of the override that gave the value, such as `theta=2` on the command line.
    pub overridden: Option<Span>,
    /// The statement.
    pub span: Span,
}

impl Param {
    /// The E701 that a value outside the domain deserves: the value is marked where it was given, and an overridden
    /// one names the declaration.
    #[must_use]
    pub fn outside_domain(&self, sources: &SourceMap) -> Diagnostic {
        let one_line = |span: Span| sources.snippet(span).split_whitespace().collect::<Vec<_>>().join(" ");
        let text = |e: &Expr| one_line(e.span);
        let allowed = match &self.domain {
            Some(Domain::Set(values)) => format!("one of {}", values.iter().map(text).collect::<Vec<_>>().join(", ")),
            Some(Domain::Range(low, high)) => format!("between {} and {}", text(low), text(high)),
            None => "finite".to_owned(),
        };
        let d = Diagnostic::new(Code::E701, format!("`{}` must be {allowed}", self.name.name));
        let Some(given) = self.overridden else {
            return d.at(self.value.span, "");
        };
        let line = sources.line_column(self.span).0;
        let place = format!("{}:{line}", sources.get(self.span.source).name);
        d.at(given, format!("declared: {}, {place}", one_line(self.span)))
    }
}

/// `region ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Its name.
    pub name: Ident,
    /// What it is.
    pub region: RegionExpr,
    /// The statement.
    pub span: Span,
}

/// `mapping ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    /// Its name.
    pub name: Ident,
    /// How a point is mapped.
    pub kind: MappingKind,
    /// Options.
    pub options: Vec<OptionItem>,
    /// The statement.
    pub span: Span,
}

/// An unknown, a multiplier, given data or a state.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Its name.
    pub name: Ident,
    /// What kind of field.
    pub kind: FieldKind,
    /// Its space.
    pub space: Space,
    /// The statement.
    pub span: Span,
}

/// What a field is.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldKind {
    /// Solved for.
    Unknown,
    /// Solved for; components that cannot act are dropped.
    Multiplier {
        /// What becomes of components that cannot act.
        crosspoints: Crosspoints,
    },
    /// Known.
    Data {
        /// Its value.
        value: DataValue,
    },
    /// Known at integration points, renewed at the end of a step.
    State {
        /// Its next value.
        update: Expr,
    },
}

/// Where the values of a data field come from.
#[derive(Clone, Debug, PartialEq)]
pub enum DataValue {
    /// None is written.
    Missing,
    /// The caller of the runtime gives it, whatever is written.
    Caller,
    /// A formula of x, y, z, t.
    Formula(Expr),
    /// A file, as written, with its place.
    File(String, Span),
}

/// `split u across fault`
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Which fields.
    pub fields: Vec<Ident>,
    /// Across which regions of interior faces.
    pub places: Vec<Ident>,
    /// The statement.
    pub span: Span,
}

/// `term ...` or `energy ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// A potential, to be differentiated once.
    pub energy: bool,
    /// Its name, if it has one; several terms may share one.
    pub name: Option<Ident>,
    /// Where it is integrated; `global` for no place.
    pub places: Vec<Ident>,
    /// What is integrated.
    pub expr: Expr,
    /// The statement.
    pub span: Span,
}

/// `fix ...` or `load ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// What is fixed or loaded.
    pub targets: Vec<Target>,
    /// The value.
    pub value: Expr,
    /// Where.
    pub places: Vec<Ident>,
    /// The statement.
    pub span: Span,
}

/// `start ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// The first values.
    pub kind: StartKind,
    /// The statement.
    pub span: Span,
}

/// Where first values come from.
#[derive(Clone, Debug, PartialEq)]
pub enum StartKind {
    /// A formula for one field.
    Field {
        /// The field.
        field: Ident,
        /// Its first value.
        value: Expr,
    },
    /// A formula for the first rate of one field: `start Dot_u = ...`.
    Rate {
        /// The field.
        field: Ident,
        /// Its first rate.
        value: Expr,
    },
    /// A file with the values of an earlier run.
    File {
        /// The path as written.
        path: String,
        /// Its place.
        path_span: Span,
    },
}

/// `steps ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// The load parameter or time.
    pub variable: Ident,
    /// First value.
    pub from: Expr,
    /// Last value.
    pub to: Expr,
    /// Step; the word `auto` for steps that the run chooses, see [`Steps::is_auto`].
    pub by: Expr,
    /// The unit of the variable.
    pub unit: Option<Unit>,
    /// Quantities of a state that `limit` is made of; their names stand in it.
    pub watched: Vec<Measure>,
    /// Options.
    pub options: Vec<OptionItem>,
    /// The statement.
    pub span: Span,
}

/// `scheme ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Scheme {
    /// Which.
    pub name: Ident,
    /// Its settings.
    pub options: Vec<OptionItem>,
    /// The statement.
    pub span: Span,
}

impl Steps {
    /// True if the run chooses its steps.
    #[must_use]
    pub fn is_auto(&self) -> bool {
        is_auto(&self.by)
    }
}

/// True for the word `auto`.
#[must_use]
pub fn is_auto(e: &Expr) -> bool {
    matches!(&e.kind, ExprKind::Name(word) if word == "auto")
}

/// `balance ...`: the equations of some unknowns, added up.
#[derive(Clone, Debug, PartialEq)]
pub struct Balance {
    /// Its name.
    pub name: Ident,
    /// The unknowns.
    pub fields: Vec<Ident>,
    /// The statement.
    pub span: Span,
}

impl Balance {
    /// Its numbers by the ends of their names, terms of these names among them.
    pub fn parts<'t>(terms: impl Iterator<Item = &'t str>) -> impl Iterator<Item = (&'t str, BalancePart)> {
        let terms = terms.map(|term| (term, BalancePart::Term));
        let ends = [("in", BalancePart::In), ("out", BalancePart::Out)].into_iter();
        ends.chain(terms).chain([("lost", BalancePart::Lost)])
    }
}

impl ResolvedScript {
    /// All that is reduced to a number at a state: measures, and what stands in the limit of an increment, in events and in
    /// numbers that measures make.
    pub fn reductions(&self) -> impl Iterator<Item = &Measure> {
        let limits = self.steps.iter().flat_map(|s| &s.watched);
        let events = self.events.iter().flat_map(|e| &e.watched);
        let computed = self.computed.iter().flat_map(|c| &c.watched);
        self.measures.iter().chain(limits).chain(events).chain(computed)
    }
}

/// `measure k = F/d`: a number that measures make.
#[derive(Clone, Debug, PartialEq)]
pub struct Computed {
    /// Its name.
    pub name: Ident,
    /// The number: arithmetic of measures, parameters and the step variable.
    pub expr: Expr,
    /// Reductions that stand in it, by the names that stand in their place.
    pub watched: Vec<Measure>,
    /// The statement.
    pub span: Span,
}

/// `gradient Fn with E`: derivatives of measures in parameters and data fields.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradient {
    /// The measures, and at which steps.
    pub results: Vec<Differentiated>,
    /// As each is written.
    pub texts: Vec<String>,
    /// The parameters.
    pub parameters: Vec<Ident>,
    /// The data fields.
    pub fields: Vec<Ident>,
    /// Those that `expect` knows.
    pub derivatives: Vec<Derivative>,
    /// The statement.
    pub span: Span,
}

/// `Fn_by_E`: what `expect` knows of a derivative.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivative {
    /// Its name.
    pub name: String,
    /// The measure, at the last step.
    pub measure: Ident,
    /// The parameter.
    pub parameter: Ident,
}

impl Derivative {
    /// Those of a statement. Derivatives of sums over steps, and of measures at other steps, have no name of one word.
    #[must_use]
    pub fn all(results: &[Differentiated], parameters: &[Ident]) -> Vec<Self> {
        let last = results.iter().filter(|r| r.at == AtSteps::Last).map(|r| &r.measure);
        let of = |m: &Ident, p: &Ident| Self {
            name: format!("{}_by_{}", m.name, p.name),
            measure: m.clone(),
            parameter: p.clone(),
        };
        last.flat_map(|m| parameters.iter().map(move |p| of(m, p))).collect()
    }
}

/// `event ...`: it lasts while the left side is larger than the right one.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Its name.
    pub name: Ident,
    /// The side that is larger while it lasts.
    pub larger: Expr,
    /// The other side.
    pub smaller: Expr,
    /// Quantities of a state that both sides are made of; their names stand in them.
    pub watched: Vec<Measure>,
    /// The statement.
    pub span: Span,
}

impl Event {
    /// What `expect` knows of an event, behind its name: how often it began, when first and last, and the time between its
    /// last two beginnings.
    pub const NUMBERS: [&'static str; 4] = ["_count", "_first", "_last", "_interval"];
}

/// `solver ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Solver {
    /// Which.
    pub name: Ident,
    /// Options.
    pub options: Vec<OptionItem>,
    /// The statement.
    pub span: Span,
}

/// `quadrature ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Quadrature {
    /// Where.
    pub places: Vec<Ident>,
    /// The mapping whose images cut the faces.
    pub segments: Option<Ident>,
    /// Which.
    pub rule: QuadratureRule,
    /// The statement.
    pub span: Span,
}

/// `measure ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Its name.
    pub name: Ident,
    /// What is done with the expression.
    pub reduction: Reduction,
    /// The expression.
    pub expr: Expr,
    /// Where; empty for a value at a point.
    pub places: Vec<Ident>,
    /// At which points.
    pub at: MeasureAt,
    /// The statement.
    pub span: Span,
}

/// `expect ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Expect {
    /// What must hold.
    pub condition: Cond,
    /// The condition as written.
    pub text: String,
    /// The statement.
    pub span: Span,
}

/// `output ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// `vtk` or `csv`.
    pub format: Ident,
    /// The file's name without its end.
    pub file: String,
    /// Of how many steps one is written; each without it.
    pub every: Option<Expr>,
    /// The event during which it is written; always without it.
    pub when: Option<Ident>,
    /// What is written.
    pub items: Vec<OutputQuantity>,
    /// Ends of the line it is sampled on.
    pub along: Option<(Expr, Expr)>,
    /// Points of which a series over the steps is written.
    pub at: Vec<Expr>,
    /// Options.
    pub options: Vec<OptionItem>,
    /// The statement.
    pub span: Span,
}

/// One quantity of an output.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputQuantity {
    /// What is written.
    pub expr: Expr,
    /// Its name: the word behind `as`, or the expression as written.
    pub name: String,
    /// The expression as written.
    pub span: Span,
}

/// A macro of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct MacroInfo {
    /// Its name.
    pub name: Ident,
    /// Name and parameters.
    pub head: Span,
    /// Some statement uses it.
    pub used: bool,
}
