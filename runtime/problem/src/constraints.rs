//! Prescribed values: which dofs `fix` takes out of the system.
//!
//! A normal component on faces that are not normal to an axis is prescribed exactly: the equations of the node are
//! rotated to a frame of its normals ([`wfl_discrete::frames`]).

mod contradictions;
mod tilted;

use std::collections::{BTreeMap, BTreeSet};

use wfl::{
    Code, Diagnostic, Span,
    ast::{Expr, Target, TargetPart},
    at_expr,
};
use wfl_compiler::{Env, backend::KernelBackend, compile_value, types::Shape, without_fields};
use wfl_discrete::{
    field::{Field, FieldSpace},
    finite::BadGiven,
    frames::Frame,
    space::{Space, Support},
    system::Numbering,
    value::Value,
    window::Window,
};
use wfl_mesh::mesh::{CellId, FacetRef, Mesh, RegionSet, Topology};

use crate::{
    Parts, edges,
    mesh::{POSITIONS_ONLY, position_place, with_zeros},
    normals::{faces_of, held_faces, node_normals},
    terms::{component, restricted},
};

pub(super) use contradictions::Contradiction;
use contradictions::{Overruled, part_of};
use tilted::{INDEPENDENT, Tilted, apart, tilted};

/// The values of one `fix` for one field on one region.
struct Fix {
    /// Positions of the nodes.
    positions: Vec<[f64; 3]>,
    value: Value,
    /// Of what on which region, and where its expression is, for messages.
    what: String,
    span: Span,
    /// The field and the statement.
    field: String,
    statement: Span,
    /// The field by its position, and the faces of the region, if it has some.
    position: usize,
    facets: Vec<FacetRef>,
}

/// One number of a `fix`: the value of which, at which node, with a factor (the sign of a normal).
#[derive(Clone, Copy, Debug)]
struct Number {
    fix: usize,
    place: usize,
    factor: f64,
}

/// What a number says of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Along {
    /// The component.
    Component(usize),
    /// The displacement along a unit vector.
    Direction([f64; 3]),
}

/// One prescribed number.
struct Condition {
    /// First dof of the node.
    first: usize,
    n_components: usize,
    along: Along,
    number: Number,
}

/// All prescribed values of a scene.
#[derive(Default)]
pub struct Prescribed {
    fixes: Vec<Fix>,
    /// Dofs that are components, in the order of the statements: a later one wins.
    plain: Vec<(usize, Number)>,
    tilted: Vec<Tilted>,
    overruled: Vec<Overruled>,
    /// By `fix` and component (the number of components for a normal one): how many numbers it states.
    stated: BTreeMap<(usize, usize), usize>,
}

impl Prescribed {
    /// The numbers of every `fix` at a step.
    ///
    /// # Errors
    /// [`BadGiven`] for a value that is not finite.
    fn numbers(&self, window: Window) -> Result<Vec<Vec<f64>>, BadGiven> {
        let at = |fix: &Fix| {
            let found = fix.value.at_step(window).at_positions(&fix.positions);
            found.map_err(|at| BadGiven { what: fix.what.clone(), span: fix.span, at: Box::new(at) })
        };
        self.fixes.iter().map(at).collect()
    }

    /// Writes the prescribed values at a step into the vector of all unknowns.
    ///
    /// # Errors
    /// [`BadGiven`] for a value that is not finite; `u` is then as it was.
    pub fn apply(&self, window: Window, u: &mut [f64]) -> Result<(), BadGiven> {
        let values = self.numbers(window)?;
        self.write(&values, u);
        Ok(())
    }

    /// The formulas that give values on faces: the field by its position, the faces, the formula.
    pub(super) fn formulas(&self) -> impl Iterator<Item = (usize, &[FacetRef], &Value)> {
        let on_faces = self.fixes.iter().filter(|fix| !fix.facets.is_empty());
        on_faces.map(|fix| (fix.position, fix.facets.as_slice(), &fix.value))
    }

    /// Zeros in place of the numbers of every `fix`: `[position * components + component]`.
    #[must_use]
    pub fn zeros(&self) -> Vec<Vec<f64>> {
        self.fixes.iter().map(|fix| vec![0.0; fix.positions.len() * fix.value.n_components()]).collect()
    }

    /// Writes the numbers of every `fix` into the vector of all unknowns.
    pub fn write(&self, values: &[Vec<f64>], u: &mut [f64]) {
        let number = |n: &Number| n.factor * values[n.fix][n.place];
        for (dof, n) in &self.plain {
            u[*dof] = number(n);
        }
        for node in &self.tilted {
            let mut along: Vec<f64> = Vec::with_capacity(node.numbers.len());
            for (row, numbers) in node.triangle.iter().zip(&node.numbers) {
                let known: f64 = row.iter().zip(&along).map(|(c, a)| c * a).sum();
                along.push((numbers.iter().map(number).sum::<f64>() - known) / row[along.len()]);
            }
            let own = &mut u[node.frame.first..][..node.frame.axes.len()];
            if along.len() == own.len() {
                // nothing is left of what stood there, not even its rounding
                own.fill(0.0);
            }
            for (axis, wanted) in node.frame.axes.iter().zip(along) {
                let is: f64 = axis.iter().zip(own.iter()).map(|(a, x)| a * x).sum();
                own.iter_mut().zip(axis).for_each(|(x, a)| *x += (wanted - is) * a);
            }
        }
    }

    /// By `fix` and region: its statement, and the positions at which its formula is evaluated.
    pub fn places(&self) -> impl Iterator<Item = (Span, &[[f64; 3]])> {
        self.fixes.iter().map(|fix| (fix.statement, fix.positions.as_slice()))
    }

    /// What the numbers of every `fix` make of a linear functional of the prescribed dofs, which are in local frames: the
    /// transpose of [`Self::apply`].
    #[must_use]
    pub fn transposed(&self, functional: &[f64]) -> Vec<Vec<f64>> {
        let mut out = self.zeros();
        // of several numbers for a dof the last one counts
        for (dof, n) in self.plain.iter().map(|(dof, n)| (*dof, *n)).collect::<BTreeMap<usize, Number>>() {
            out[n.fix][n.place] += n.factor * functional[dof];
        }
        for node in &self.tilted {
            let mut along = functional[node.frame.first..][..node.numbers.len()].to_vec();
            for (i, (row, numbers)) in node.triangle.iter().zip(&node.numbers).enumerate().rev() {
                let share = along[i] / row[i];
                numbers.iter().for_each(|n| out[n.fix][n.place] += n.factor * share);
                along.iter_mut().zip(&row[..i]).for_each(|(a, c)| *a -= c * share);
            }
        }
        out
    }

    /// The dofs that are removed from the system; of a node with a local frame those of its first axes.
    #[must_use]
    pub fn dofs(&self) -> BTreeSet<usize> {
        let tilted = self.tilted.iter().flat_map(|t| (0..t.numbers.len()).map(|k| t.frame.first + k));
        self.plain.iter().map(|(dof, _)| *dof).chain(tilted).collect()
    }

    /// The dofs whose component is prescribed by its own name, each with the number of its statement: the last one that
    /// says so. Statements on several regions count for each.
    pub(super) fn statements(&self) -> BTreeMap<usize, usize> {
        self.plain.iter().map(|(dof, number)| (*dof, number.fix)).collect()
    }

    /// How many statements there are.
    pub(super) fn n_statements(&self) -> usize {
        self.fixes.len()
    }

    /// The dofs whose component is prescribed.
    pub(super) fn components(&self) -> BTreeSet<usize> {
        let all = self.tilted.iter().filter(|t| t.numbers.len() == t.frame.axes.len());
        let tilted = all.flat_map(|t| (0..t.numbers.len()).map(|k| t.frame.first + k));
        self.plain.iter().map(|(dof, _)| *dof).chain(tilted).collect()
    }

    /// The dofs, in local frames, whose prescribed values may move: not those that are zero and stay so. `begins` tells of fields
    /// with values at the start, which may be others.
    pub(super) fn in_motion(&self, begins: impl Fn(usize) -> bool) -> BTreeSet<usize> {
        let moves = |fix: &Fix| {
            let is_zero =
                || fix.value.at_positions(&fix.positions).is_ok_and(|values| values.iter().all(|x| *x == 0.0));
            begins(fix.position) || fix.value.reads_step() || !is_zero()
        };
        let all: Vec<bool> = self.fixes.iter().map(moves).collect();
        let moves = |number: &Number| all[number.fix];
        // along a direction that is no axis all numbers of a node count
        let tilted = self.tilted.iter().filter(|t| t.numbers.iter().flatten().any(moves));
        let tilted = tilted.flat_map(|t| (0..t.numbers.len()).map(|k| t.frame.first + k));
        self.plain.iter().filter(|(_, number)| moves(number)).map(|(dof, _)| *dof).chain(tilted).collect()
    }

    /// True if nothing is prescribed.
    pub(super) fn is_empty(&self) -> bool {
        self.fixes.is_empty()
    }

    /// The statement that prescribes a dof.
    pub(super) fn held_by(&self, dof: usize) -> Option<Span> {
        let plain = self.plain.iter().rev().find(|(d, _)| *d == dof).map(|(_, n)| n.fix);
        let tilted = || {
            let node =
                self.tilted.iter().find(|t| (t.frame.first..t.frame.first + t.frame.axes.len()).contains(&dof))?;
            node.numbers.first()?.first().map(|n| n.fix)
        };
        plain.or_else(tilted).map(|fix| self.fixes[fix].statement)
    }

    /// True if the displacement of the node whose dofs begin at `first` is prescribed along `direction`, by a frame of
    /// its own.
    pub(super) fn holds(&self, first: usize, direction: &[f64; 3]) -> bool {
        let Some(node) = self.tilted.iter().find(|t| t.frame.first == first) else { return false };
        let n = node.frame.axes.len();
        apart(&node.frame.axes[..node.numbers.len()], &direction[..n], INDEPENDENT).is_none()
    }

    /// The frames of the nodes that need one.
    #[must_use]
    pub fn frames(&self) -> Vec<Frame> {
        self.tilted.iter().map(|t| t.frame.clone()).collect()
    }

    /// Sorts conditions into components and nodes with directions.
    fn new(fixes: Vec<Fix>, conditions: Vec<Condition>) -> Self {
        let direction = |c: &&Condition| matches!(c.along, Along::Direction(_));
        let turned: BTreeSet<usize> = conditions.iter().filter(direction).map(|c| c.first).collect();
        let mut made = Self { fixes, ..Self::default() };
        let (mut last, mut nodes) = (BTreeMap::new(), BTreeMap::<usize, Vec<Condition>>::new());
        for c in conditions {
            *made.stated.entry((c.number.fix, part_of(c.along, c.n_components))).or_default() += 1;
            match c.along {
                Along::Component(k) if !turned.contains(&c.first) => {
                    made.plain.push((c.first + k, c.number));
                    if let Some(before) = last.insert(c.first + k, c.number) {
                        made.overruled.push(Overruled { number: before, ..c.overruled(c.number.fix) });
                    }
                }
                _ => nodes.entry(c.first).or_default().push(c),
            }
        }
        for list in nodes.into_values() {
            let (node, overruled) = tilted(&list);
            made.tilted.push(node);
            made.overruled.extend(overruled);
        }
        made
    }
}

impl Condition {
    fn overruled(&self, by: usize) -> Overruled {
        let Condition { first, n_components, along, number } = *self;
        Overruled { first, n_components, along, number, by }
    }
}

/// A facet normal counts as along an axis within this.
const ALIGNED: f64 = 1e-9;

pub(super) struct ConstraintMaker<'a> {
    pub(super) parts: Parts<'a>,
    pub(super) numbering: &'a Numbering,
    pub(super) backend: &'a dyn KernelBackend,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
}

impl ConstraintMaker<'_> {
    /// The `fix` statements.
    pub(super) fn make(&mut self) -> Prescribed {
        let (mut fixes, mut conditions) = (Vec::new(), Vec::new());
        for fix in &self.parts.script.fixes {
            for target in &fix.targets {
                for place in &fix.places {
                    if let Some((made, list)) = self.one(target, fix, place, fixes.len()) {
                        fixes.push(made);
                        conditions.extend(list);
                    }
                }
            }
        }
        Prescribed::new(fixes, conditions)
    }

    fn one(
        &mut self,
        target: &Target,
        statement: &wfl::Condition,
        place: &wfl::ast::Ident,
        number: usize,
    ) -> Option<(Fix, Vec<Condition>)> {
        let position = self.parts.fields.iter().position(|f| f.name == target.field.name)?;
        let field = &self.parts.fields[position];
        let start = self.numbering.starts[position]?;
        let nodes = if place.name == "global" {
            vec![0]
        } else {
            let region = self.parts.regions.get(&place.name)?;
            region.nodes_of(field, self.parts.mesh, self.parts.topology)
        };
        // a part of the mesh may have none of them
        if self.parts.mesh.lacks(&nodes) {
            let d = Diagnostic::new(Code::E401, format!("`fix {}` meets no node of `{}`", field.name, field.name));
            let region = &self.parts.regions[&place.name];
            let text = self.elsewhere(&place.name, &region.set, &field.name);
            self.diagnostics.push(d.at(place.span, text));
            return None;
        }
        self.has_nodes_of_edges(field, place)?;
        let n = field.n_components;
        let whole = matches!(target.part, TargetPart::Whole);
        // by node: along what, with which entry of the value and which sign
        let along: Vec<Vec<(Along, usize, f64)>> = match &target.part {
            TargetPart::Whole => vec![(0..n).map(|c| (Along::Component(c), c, 1.0)).collect(); nodes.len()],
            TargetPart::Component(e) => {
                let c = component(self.parts.env, e, field, self.diagnostics)?;
                vec![vec![(Along::Component(c), 0, 1.0)]; nodes.len()]
            }
            TargetPart::Normal => self.along_normals(target, place, position, &nodes)?,
        };
        let entries = if whole { n } else { 1 };
        let span = statement.value.span;
        let value = self.value(&statement.value, entries)?;
        let mut conditions = Vec::with_capacity(nodes.len());
        for (k, (node, list)) in nodes.iter().zip(along).enumerate() {
            conditions.extend(list.into_iter().map(|(along, entry, factor)| Condition {
                first: start + *node as usize * n,
                n_components: n,
                along,
                number: Number { fix: number, place: k * entries + entry, factor },
            }));
        }
        let positions = nodes.iter().map(|node| field.node_position(*node as usize)).collect();
        let what = format!("the prescribed value of `{}` on `{}`", field.name, place.name);
        let (field, statement) = (field.name.clone(), statement.span);
        let facets = match self.parts.regions.get(&place.name).map(|r| restricted(&self.parts.fields[position], &r.set))
        {
            Some(RegionSet::Facets(facets)) => facets,
            _ => Vec::new(),
        };
        Some((Fix { positions, value, what, span, field, statement, position, facets }, conditions))
    }

    /// E405 for edges in space whose inner nodes would stay free.
    fn has_nodes_of_edges(&mut self, field: &Field, place: &wfl::ast::Ident) -> Option<()> {
        if self.parts.mesh.dim() < 3 || field.degree() < 2 || !edges::are_in(self.parts.script, &place.name) {
            return Some(());
        }
        let is_on_faces =
            matches!(&field.space, FieldSpace::Nodal(space) if matches!(space.support(), Support::Facets(_)));
        if is_on_faces && self.parts.regions.get(&place.name).is_some_and(|region| region.edges.is_some()) {
            return Some(());
        }
        let d = Diagnostic::new(Code::E405, format!("`{}` has nodes inside the edges of `{}`", field.name, place.name));
        let text = "values there would stay free: of a field of a higher degree that does not live on faces";
        self.diagnostics.push(d.at(place.span, text).help("a region of faces at the rim, or an element of degree 1"));
        None
    }

    /// "the 256 faces of `east` belong to `right`; uL lives on `left`"
    fn elsewhere(&self, name: &str, set: &RegionSet, field: &str) -> String {
        let count = format!("the {} {} of `{name}`", set.len(), set.kind());
        let cells: Option<BTreeSet<CellId>> = match set {
            RegionSet::Facets(f) => Some(f.iter().map(|f| f.cell).collect()),
            RegionSet::Interface(i) => Some(i.iter().map(|p| p.here.cell).collect()),
            RegionSet::Cells(c) => Some(c.iter().copied().collect()),
            RegionSet::Edges(_) | RegionSet::Nodes(_) => None,
        };
        // the first declared body that holds all of them
        let owner = self.parts.script.regions.iter().find(|r| {
            let body = self.parts.regions.get(&r.name.name).map(|n| &n.set);
            let (Some(RegionSet::Cells(body)), Some(cells)) = (body, &cells) else { return false };
            cells.iter().all(|c| body.contains(c)) && r.name.name != name
        });
        let belong = owner.map_or_else(
            || format!("none of {count} touches {field}"),
            |r| format!("{count} belong to `{}`", r.name.name),
        );
        let declared = self.parts.script.fields.iter().find(|f| f.name.name == field);
        match declared.map(|f| &f.space.place) {
            Some(wfl::ast::Place::On(list)) => {
                let list: Vec<String> = list.iter().map(|r| format!("`{}`", r.name)).collect();
                format!("{belong}; {field} lives on {}", list.join(", "))
            }
            _ => belong,
        }
    }

    fn value(&mut self, e: &Expr, entries: usize) -> Option<Value> {
        let place = position_place(self.parts.fields.len());
        let law = compile_value(self.parts.env, &place, "a prescribed value", e);
        self.diagnostics.extend(law.diagnostics.into_iter().map(|d| without_fields(d, Code::E407, POSITIONS_ONLY)));
        let law = law.value?;
        if let Some(d) = wrong_size(self.parts.env, e, law.shape, entries) {
            self.diagnostics.push(d);
            return None;
        }
        match Value::new(law, self.backend) {
            Ok(v) if v.reads_positions_only() => Some(v),
            Ok(_) => {
                self.diagnostics.push(Diagnostic::new(Code::E407, POSITIONS_ONLY).at(e.span, ""));
                None
            }
            Err(error) => {
                self.diagnostics.push(Diagnostic::new(Code::E609, error.to_string()).at(e.span, ""));
                None
            }
        }
    }

    /// `fix u.Normal`: by node the normals there, a component where they look along an axis.
    fn along_normals(
        &mut self,
        target: &Target,
        place: &wfl::ast::Ident,
        position: usize,
        nodes: &[u32],
    ) -> Option<Vec<Vec<(Along, usize, f64)>>> {
        let set = &self.parts.regions.get(&place.name)?.set;
        let Some(facets) = faces_of(set) else {
            let d = Diagnostic::new(Code::E204, "`Normal` exists on faces only");
            self.diagnostics.push(d.at(target.span, format!("`{}` is a region of {}", place.name, set.kind())));
            return None;
        };
        let (field, dim) = (&self.parts.fields[position], self.parts.mesh.dim());
        if field.n_components != dim {
            let d = Diagnostic::new(Code::E108, format!("`{}` has no normal component", field.name));
            let text = format!("it has {} components, space has {dim} dimensions", field.n_components);
            self.diagnostics.push(d.at(target.span, text));
            return None;
        }
        let FieldSpace::Nodal(space) = &field.space else { return None };
        let beside = held_faces(self.parts.script, self.parts.regions, &field.name);
        let normals = node_normals(self.parts.mesh, self.parts.topology, space, &facets, &beside);
        let along = |normal: &[f64; 3]| match (0..dim).find(|k| (normal[*k].abs() - 1.0).abs() < ALIGNED) {
            Some(k) => (Along::Component(k), 0, normal[k].signum()),
            None => (Along::Direction(*normal), 0, 1.0),
        };
        let of = |node: &u32| normals.get(node).map(|list| list.iter().map(along).collect()).unwrap_or_default();
        Some(nodes.iter().map(of).collect())
    }
}

/// E108 for a prescribed value with another number of entries than its target.
pub(super) fn wrong_size(env: &Env<'_>, e: &Expr, found: Shape, entries: usize) -> Option<Diagnostic> {
    if found.len() == entries {
        return None;
    }
    let needed = if entries == 1 { "one value is".to_owned() } else { format!("{entries} values are") };
    let d = Diagnostic::new(Code::E108, format!("{needed} needed here, found a {found}"));
    Some(at_expr(with_zeros(d, e, found.len(), entries), e, env.expansions, found.to_string()))
}

/// Nodes this near to each other, in sizes of the mesh, stand at one place.
pub(super) const SAME_PLACE: f64 = 1e-9;

/// The largest extent of a mesh along an axis.
pub(super) fn extent(mesh: &Mesh) -> f64 {
    let (low, high) = mesh.bounds();
    (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]))
}

/// A point, and the extent of the mesh: what stands there is as near to it as rounding allows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) x: [f64; 3],
    pub(super) extent: f64,
}

/// The nodes of a space on some facets that stand at a point.
pub(super) fn at_place(mesh: &Mesh, topology: &Topology, space: &Space, facets: &[FacetRef], spot: Spot) -> Vec<u32> {
    let at_x = |node: &u32| {
        let y = space.node_coordinates()[*node as usize];
        (0..3).all(|d| (spot.x[d] - y[d]).abs() <= SAME_PLACE * spot.extent)
    };
    space.nodes_on_facets(mesh, topology, facets).into_iter().filter(at_x).collect()
}

/// The facets around each node.
pub(super) fn facets_of_nodes(space: &Space) -> BTreeMap<u32, Vec<FacetRef>> {
    let mut around: BTreeMap<u32, Vec<FacetRef>> = BTreeMap::new();
    if let Support::Facets(facets) = space.support() {
        for (position, facet) in facets.iter().enumerate() {
            space.entity_nodes(position).iter().for_each(|n| around.entry(*n).or_default().push(*facet));
        }
    }
    around
}
