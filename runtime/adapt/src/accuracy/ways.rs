//! What can be changed in a scene to make it more accurate or cheaper, and the resulting settings.

use std::collections::BTreeSet;

use wfl::{
    FieldKind, ResolvedScript,
    ast::{Expr, ExprKind, Ident, MappingKind, OptionValue, Place, QuadratureRule, RegionExpr},
};
use wfl_compiler::Class;
use wfl_contact::is_consistent;
use wfl_discrete::field::FieldSpace;
use wfl_mesh::mesh::RegionSet;
use wfl_problem::{Scene, SceneBox};

use crate::{
    compare::MEASURE,
    knobs::{RICHER, SUBSTEPS, mesh_words},
};

/// What a scene calls the parameter of a penalty method. A penalty changes the solution, and a stiffness of another name
/// may be that of a real one-sided spring: to raise it would solve another problem. A consistent method needs no name,
/// because its solution does not depend on the parameter.
const PENALTY: &str = "gamma";
/// Least number of contact faces: two that touch and two that do not, or no edge of a zone can be seen.
const LEAST_FACES: f64 = 4.0;

/// What the parameter of a method is to its error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// There is none, or the scene computes it, or the solution does not depend on it (multipliers).
    None,
    /// The method is consistent, the parameter must grow with the stiffness of the cells: it is scaled with the mesh.
    Consistent,
    /// The solution depends on it: its error is measured.
    Penalty,
}

/// The parameter of the contact method of a scene, if it is no part of the problem: the exact solution does not depend on
/// it (multipliers, consistent methods), or it is a penalty and what it changes is an error.
#[must_use]
pub fn method_word(script: &ResolvedScript, scene: &Scene) -> Option<String> {
    let multiplier = || script.fields.iter().any(|f| matches!(f.kind, FieldKind::Multiplier { .. }));
    let numerical = |name: &String| name == PENALTY || multiplier() || is_consistent(&scene.system, &scene.contact);
    scene.method_parameter(script).filter(numerical)
}

/// What divides the mesh.
#[derive(Clone, Debug, PartialEq)]
enum Division {
    /// The mesh cannot be refined.
    Fixed,
    /// A number of cells along each axis, for fineness 1.
    Cells(Vec<usize>),
    /// A parameter that is a number of cells.
    Count(String),
    /// A parameter that is the size of a cell, with its value for fineness 1.
    Size(String, f64),
}

/// What divides the steps.
#[derive(Clone, Debug, PartialEq)]
enum Increment {
    /// The solution does not depend on their length.
    None,
    /// A parameter that is the length of a step, with its value: equations may be made with it, too.
    Param(String, f64),
    /// The knob.
    Knob,
}

/// A setting that is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Of the unknowns.
    pub degree: usize,
    /// Of the mesh before it is refined locally.
    pub fineness: usize,
    /// By how much cells at contact are smaller than on that mesh.
    pub finer: f64,
    /// Of the iterations.
    pub tolerance: f64,
    /// Factor on the parameter of a penalty method.
    pub stiffer: f64,
    /// Parts of each step.
    pub substeps: usize,
    /// Elements of the next degree and finer rules: what errors are estimated with.
    pub richer: bool,
}

/// What can be changed in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Ways {
    /// Dimension of the mesh.
    pub dim: usize,
    /// Degrees that the unknowns on cells can have, rising.
    pub degrees: Vec<usize>,
    /// The fineness of the scene as it stands: its cells are in these proportions to those of fineness 1.
    pub own: usize,
    /// The coarsest fineness that is tried: two cells along the shortest edge, four faces of a contact.
    pub least: usize,
    /// The degree of the scene as it stands.
    pub own_degree: usize,
    /// Names of its measures.
    pub measures: Vec<String>,
    /// Whether terms have kinks.
    pub kinked: bool,
    /// What the parameter of the method is.
    pub role: Role,
    /// Its name; empty if there is none.
    pub parameter: String,
    division: Division,
    increment: Increment,
    fixed_degree: bool,
    /// The value of that parameter in the scene.
    value: f64,
}

impl Ways {
    /// Looks at a scene as it stands.
    #[must_use]
    pub fn of(script: &ResolvedScript, scene: &Scene) -> Self {
        let (division, own, least) = division(script, scene);
        let (degrees, own_degree, fixed_degree) = degrees(script, scene);
        let (dim, role, parameter, value) = (scene.system.mesh.dim(), Role::None, String::new(), 0.0);
        let measures = measures(script);
        let kinked = scene.terms.iter().any(|t| t.class == Class::Kinked);
        let mut ways = Ways {
            dim,
            degrees,
            own,
            least,
            own_degree,
            measures,
            kinked,
            role,
            parameter,
            division,
            increment: increment(script, scene),
            fixed_degree,
            value,
        };
        ways.see_method(script, scene);
        ways.least = ways.least.max(ways.least_at_faces(scene)).min(ways.own);
        ways
    }

    /// The fineness that leaves enough faces to each contact.
    fn least_at_faces(&self, scene: &Scene) -> usize {
        let kinked = scene.terms.iter().filter(|t| t.class == Class::Kinked);
        let faces = kinked.filter_map(|t| scene.regions.get(&t.place)).map(|r| members(&r.set, self.dim));
        let least = faces.filter(|(n, d)| *n > 0.0 && *d > 0 && (*d as usize) < self.dim).map(|(n, d)| {
            let part = (LEAST_FACES / n).powf(1.0 / f64::from(d));
            (self.own as f64 * part).ceil()
        });
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
        return least.fold(1.0, f64::max) as usize;
    }

    /// What the method of a scene is. Its parameter counts where it is a plain number that the solution may depend on.
    fn see_method(&mut self, script: &ResolvedScript, scene: &Scene) {
        if script.fields.iter().any(|f| matches!(f.kind, FieldKind::Multiplier { .. })) {
            return;
        }
        let Some(name) = scene.method_parameter(script) else { return };
        let given = script.params.iter().find(|p| p.name.name == name);
        let plain = given.is_some_and(|p| matches!(p.value.kind, ExprKind::Number(_)));
        let value = scene.params.iter().find(|p| p.0 == name).and_then(|p| p.1.values.first().copied());
        let Some(value) = value.filter(|_| plain) else { return };
        self.role = match is_consistent(&scene.system, &scene.contact) {
            true => Role::Consistent,
            false if name == PENALTY => Role::Penalty,
            false => return,
        };
        (self.parameter, self.value) = (name, value);
    }

    /// Whether the mesh can be refined.
    #[must_use]
    pub fn refines(&self) -> bool {
        self.division != Division::Fixed
    }

    /// Whether the solution depends on the length of the steps, which can be divided.
    #[must_use]
    pub fn divides_steps(&self) -> bool {
        self.increment != Increment::None
    }

    /// The words of a setting.
    #[must_use]
    pub fn setting(&self, wanted: Wanted) -> Vec<(String, String)> {
        let Wanted { degree, fineness, finer, tolerance, stiffer, substeps, richer } = wanted;
        let mut out: Vec<(String, String)> = Vec::new();
        let mut set = |name: &str, value: String| out.push((name.to_owned(), value));
        let raised = degree + usize::from(richer);
        // the trace constant of a cell grows like degree^2/h; for a lower degree the larger value is safe
        let ratio = finer * fineness as f64 / self.own as f64;
        let ratio = ratio * (raised as f64 / self.own_degree as f64).powi(2).max(1.0);
        match &self.division {
            Division::Fixed => {}
            Division::Cells(base) => {
                let counts: Vec<String> = base.iter().map(|n| (n * fineness).to_string()).collect();
                set("cells", format!("[{}]", counts.join(",")));
            }
            Division::Count(name) => set(name, fineness.to_string()),
            Division::Size(name, size) => set(name, number(size / fineness as f64)),
        }
        if !self.fixed_degree {
            set("degree", degree.to_string());
        }
        if richer {
            set(RICHER, "1".to_owned());
        }
        match self.role {
            Role::Consistent if ratio != 1.0 => set(&self.parameter, number(self.value * ratio)),
            Role::Penalty if stiffer != 1.0 => set(&self.parameter, number(self.value * stiffer)),
            _ => {}
        }
        match &self.increment {
            Increment::Param(name, value) if substeps > 1 => set(name, number(value / substeps as f64)),
            Increment::Knob if substeps > 1 => set(SUBSTEPS, substeps.to_string()),
            _ => {}
        }
        set("tol", number(tolerance));
        out
    }

    /// Whether the regions with terms are the same part of the bodies as on the mesh of the scene: members of a region
    /// of dimension d are as many as fineness^d says, within `slack`, relative. On a multiple of the scene's own mesh
    /// all its faces are there.
    #[must_use]
    pub fn fits(&self, own: &Scene, other: &Scene, fineness: usize, slack: f64) -> bool {
        if fineness.is_multiple_of(self.own) {
            return true;
        }
        let ratio = fineness as f64 / self.own as f64;
        let same = |place: &String| {
            let (a, b) = match (own.regions.get(place), other.regions.get(place)) {
                (Some(a), Some(b)) => (a, b),
                // what is global is so on every mesh
                (a, b) => return a.is_none() && b.is_none(),
            };
            let (n, dim) = members(&a.set, self.dim);
            let expected = n * ratio.powi(dim);
            (members(&b.set, self.dim).0 - expected).abs() <= slack * expected
        };
        own.terms.iter().all(|t| same(&t.place))
    }
}

/// A number in the fewest digits that give it back, of those that a scene can hold.
fn number(x: f64) -> String {
    let rounded: f64 = format!("{x:.11e}").parse().unwrap_or(x);
    if rounded != 0.0 && !(1e-4..1e6).contains(&rounded.abs()) { format!("{rounded:e}") } else { format!("{rounded}") }
}

/// Members of a region and their dimension.
fn members(set: &RegionSet, dim: usize) -> (f64, i32) {
    let d = i32::try_from(dim).unwrap_or(3);
    match set {
        RegionSet::Cells(c) => (c.len() as f64, d),
        RegionSet::Facets(f) => (f.len() as f64, d - 1),
        RegionSet::Interface(f) => (f.len() as f64, d - 1),
        RegionSet::Edges(e) => (e.len() as f64, d - 2),
        RegionSet::Nodes(n) => (n.len() as f64, 0),
    }
}

/// The measures by the names that a demand calls them.
fn measures(script: &ResolvedScript) -> Vec<String> {
    let outputs = || script.outputs.iter().filter(|o| o.format.name == "vtk").flat_map(|o| &o.items);
    let name = |m: &wfl::Measure| {
        let taken = outputs().any(|i| i.name == m.name.name) || ["L2", "H1"].contains(&m.name.name.as_str());
        if taken { format!("{MEASURE}{}", m.name.name) } else { m.name.name.clone() }
    };
    script.measures.iter().map(name).collect()
}

/// The possible degrees, the scene's own, and whether that is only the scene's own. Spaces of several degrees or
/// with multipliers are pairs that are stable together; a rule at the vertices and states belong to their degree.
fn degrees(script: &ResolvedScript, scene: &Scene) -> (Vec<usize>, usize, bool) {
    let on_cells = |f: &&wfl::Field| matches!(f.kind, FieldKind::Unknown) && !matches!(f.space.place, Place::Global(_));
    let degree = |f: &wfl::Field| {
        let field = scene.system.fields.iter().find(|g| g.name == f.name.name)?;
        matches!(field.space, FieldSpace::Nodal(_)).then(|| field.degree())
    };
    let own: Vec<usize> = script.fields.iter().filter(on_cells).filter_map(degree).collect();
    let first = own.first().copied().unwrap_or(1);
    let multipliers = script.fields.iter().any(|f| matches!(f.kind, FieldKind::Multiplier { .. }));
    let at_vertices = |q: &wfl::Quadrature| {
        let with_terms = q.places.iter().any(|p| scene.terms.iter().any(|t| t.place == p.name));
        matches!(q.rule, QuadratureRule::Vertex) && with_terms
    };
    let bound = multipliers
        || own.iter().any(|d| *d != first)
        || own.is_empty()
        || !scene.states.is_empty()
        || script.quadratures.iter().any(at_vertices);
    if bound || first > 2 { (vec![first], first, true) } else { (vec![1, 2], first, false) }
}

/// What divides the steps of a scene whose steps depend on those before them.
fn increment(script: &ResolvedScript, scene: &Scene) -> Increment {
    let remembers = scene.system.past().is_some() || !scene.states.is_empty();
    let Some(steps) = script.steps.as_ref().filter(|_| remembers && scene.steps.values.len() > 1) else {
        return Increment::None;
    };
    let ExprKind::Name(name) = &steps.by.kind else { return Increment::Knob };
    let given = script.params.iter().find(|p| p.name.name == *name);
    let plain = given.is_some_and(|p| matches!(p.value.kind, ExprKind::Number(_)));
    let value = scene.params.iter().find(|p| p.0 == *name).and_then(|p| p.1.values.first().copied());
    match value.filter(|_| plain) {
        Some(value) => Increment::Param(name.clone(), value),
        None => Increment::Knob,
    }
}

fn division(script: &ResolvedScript, scene: &Scene) -> (Division, usize, usize) {
    let Some(SceneBox { counts, by_size }) = scene.box_of(script) else { return (Division::Fixed, 1, 1) };
    let common = counts.iter().copied().fold(0, gcd);
    let mut words = mesh_words(script);
    words.dedup();
    let value = |name: &String| {
        let given = script.params.iter().find(|p| p.name.name == *name)?;
        let plain = matches!(given.value.kind, ExprKind::Number(_));
        let values = &scene.params.iter().find(|p| p.0 == *name)?.1.values;
        (plain && values.len() == 1).then(|| values[0])
    };
    let shortest = |own: usize| counts.iter().min().map_or(1, |n| (2 * own).div_ceil(*n).max(1));
    if let [name] = words.as_slice()
        && let Some(v) = value(name)
    {
        if by_size {
            return (Division::Size(name.clone(), v * common as f64), common, shortest(common));
        }
        let whole = counts.iter().find(|n| (**n as f64) == v).copied();
        if let Some(n) = whole.filter(|n| counts.iter().all(|c| c % n == 0)) {
            return (Division::Count(name.clone()), n, shortest(n));
        }
    }
    let base: Vec<usize> = counts.iter().map(|n| n / common.max(1)).collect();
    (Division::Cells(base), common, shortest(common))
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// A scene without what a run on the way does not need: measures, unless one of them is what is asked about,
/// expectations, and rules on regions without terms. A coarse mesh may have no member of a region that only they use.
pub fn lean(script: &mut ResolvedScript, own: &Scene, quantity: &str) {
    let output = script.outputs.iter().flat_map(|o| &o.items).any(|i| i.name == quantity);
    let name = quantity.strip_prefix(MEASURE).unwrap_or(quantity);
    if (output || !script.measures.iter().any(|m| m.name.name == name)) && !decides(script) {
        script.measures.clear();
        script.computed.clear();
        script.quadratures.retain(|q| q.places.iter().any(|p| own.terms.iter().any(|t| t.place == p.name)));
    }
    script.expects.clear();
    drop_regions(script);
}

/// Whether an event, or a limit of the steps, is about a measure.
fn decides(script: &ResolvedScript) -> bool {
    let names: BTreeSet<&str> = script
        .measures
        .iter()
        .map(|m| &m.name)
        .chain(script.computed.iter().map(|c| &c.name))
        .map(|name| name.name.as_str())
        .collect();
    let mut found = false;
    let mut look = |e: &Expr| wfl::each_name(e, &mut |name| found |= names.contains(name));
    for event in &script.events {
        look(&event.larger);
        look(&event.smaller);
    }
    let options = script.steps.iter().flat_map(|steps| &steps.options);
    for option in options {
        if let Some(OptionValue::Expr(e)) = &option.value {
            look(e);
        }
    }
    found
}

/// Leaves out the regions that no statement is about any more: a coarse mesh may have no member of them.
fn drop_regions(script: &mut ResolvedScript) {
    let mut used: BTreeSet<String> = BTreeSet::new();
    let mut add = |names: &[Ident]| used.extend(names.iter().map(|n| n.name.clone()));
    script.terms.iter().for_each(|t| add(&t.places));
    script.fixes.iter().chain(&script.loads).for_each(|c| add(&c.places));
    script.measures.iter().for_each(|m| add(&m.places));
    script.quadratures.iter().for_each(|q| add(&q.places));
    script.splits.iter().for_each(|s| add(&s.places));
    script.refinements.iter().for_each(|r| add(&r.what.places));
    for field in &script.fields {
        if let Place::On(places) = &field.space.place {
            add(places);
        }
    }
    for mapping in &script.mappings {
        if let MappingKind::Search { from, onto, .. } = &mapping.kind {
            add(&[from.clone(), onto.clone()]);
        }
    }
    // a region stands behind those it is made of
    let mut keep = vec![false; script.regions.len()];
    for (region, keep) in script.regions.iter().zip(&mut keep).rev() {
        *keep = used.contains(&region.name.name);
        if *keep {
            made_of(&region.region, &mut used);
        }
    }
    let mut keep = keep.into_iter();
    script.regions.retain(|_| keep.next().unwrap_or(true));
}

/// Adds the regions that a region is made of.
fn made_of(region: &RegionExpr, used: &mut BTreeSet<String>) {
    match region {
        RegionExpr::Name(name) => drop(used.insert(name.name.clone())),
        RegionExpr::Interface { from, to, .. } => used.extend([from.name.clone(), to.name.clone()]),
        RegionExpr::Along { surface, .. } => drop(used.insert(surface.name.clone())),
        RegionExpr::Picked { of, .. } => used.extend(of.iter().map(|o| o.name.clone())),
        RegionExpr::Combine(first, rest) => {
            made_of(first, used);
            rest.iter().for_each(|(_, other)| made_of(other, used));
        }
    }
}

/// Work of a run is about unknowns to this power, by dimension, and entries of a row to another: fitted to the runs of
/// the study, where a sparse factorisation takes no more than half of the time.
const POWER: [f64; 4] = [1.0, 1.0, 1.15, 1.4];
const POWER_OF_ENTRIES: f64 = 0.4;

/// Work of a step with elements of a degree, in any unit. Not the clock: the same scene gives the same choice.
#[must_use]
pub fn work(dim: usize, degree: usize, dofs: f64) -> f64 {
    let entries = (degree as f64 + 1.0).powf(dim as f64);
    dofs.powf(POWER[dim.min(3)]) * entries.powf(POWER_OF_ENTRIES)
}

/// A square of cells, for tests without a scene.
#[cfg(test)]
pub(super) fn test_ways(dim: usize, role: Role, own: usize) -> Ways {
    Ways {
        dim,
        degrees: vec![1, 2],
        own,
        least: 2,
        own_degree: 1,
        measures: vec!["Fn".to_owned()],
        kinked: false,
        role,
        parameter: "gamma".to_owned(),
        division: Division::Cells(vec![1; dim]),
        increment: Increment::None,
        fixed_degree: false,
        value: 1.0,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use wfl::{NoFiles, ResolvedScript, SourceMap, resolve};
    use wfl_compiler::InterpreterBackend;

    use super::{Role, Ways};
    use wfl_problem::Scene;

    const BLOCK: &str = "wfl 1
param E = 100
param slope = 300
param h = 0.5
mesh box [0,0] to [1,1] cells [2,2] quad
region floor = faces where y == 0
region top = faces where y == 1
unknown u : vector
def stress(v) = E*Sym(Grad_v)
term elastic on all : stress(u):Grad_Test_u
fix u(1) = 0 on top
load u = [0,-1] on top
";

    fn role(terms: &str) -> Role {
        let (script, scene) = prepared(terms);
        Ways::of(&script, &scene).role
    }

    #[test]
    fn a_stiffness_of_another_name_is_not_taken_for_a_penalty() {
        let law =
            |name: &str| format!("param {name} = 300\nterm law on floor : pos_part({name}*u.Normal)*(Test_u.Normal)");
        assert_eq!(role(&law("gamma")), Role::Penalty);
        assert_eq!(role(&law("k_spring")), Role::None);
        // the solution of a consistent method does not depend on its parameter, whatever its name
        let nitsche = "term contact on floor : pos_part(slope*u.Normal - (stress(u)*Normal).Normal)*(Test_u.Normal)";
        assert_eq!(role(nitsche), Role::Consistent);
    }

    fn prepared(terms: &str) -> (ResolvedScript, Scene) {
        let mut sources = SourceMap::new();
        let main = sources.add("scene.wfl", format!("{BLOCK}{terms}"));
        let script = resolve(&mut sources, main, &mut NoFiles, &[]);
        let script = script.value.unwrap_or_else(|| panic!("{:?}", script.diagnostics));
        let made = wfl_problem::prepare(&script, Path::new("."), &InterpreterBackend);
        let scene = made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics));
        (script, scene)
    }
}
