//! Prescribed values: which dofs `fix` takes out of the system, and multipliers that then have nothing to act on.

use std::collections::BTreeSet;

use wfl::{
    Diagnostic, FieldKind as Declared, ResolvedScript,
    ast::{Expr, Target, TargetPart},
};
use wfl_compiler::{
    Env,
    backend::KernelBackend,
    compile_value,
    types::{FieldKind, Shape},
    without_fields,
};

use crate::{
    field::{Field, FieldSpace},
    mesh::{CellId, FacetRef, Mesh, RegionSet, Topology},
    scene::{
        mesh::{POSITIONS_ONLY, position_place},
        regions::Regions,
        terms::component,
    },
    space::Support,
    system::Numbering,
    value::Value,
};

/// Dofs with prescribed values.
pub struct Prescribed {
    /// The dofs: `dofs[node * components.len() + k]` has entry `components[k]` of the value.
    pub dofs: Vec<usize>,
    /// Entries of the value that are used, with a factor (the sign of a normal).
    pub components: Vec<(usize, f64)>,
    /// Positions of the nodes.
    pub positions: Vec<[f64; 3]>,
    /// The value.
    pub value: Value,
}

impl Prescribed {
    /// Writes the prescribed values at a step into the vector of all unknowns.
    pub fn apply(&mut self, time: f64, increment: f64, u: &mut [f64]) {
        self.value.set_step(time, increment);
        let values = self.value.at_positions(&self.positions);
        let n = self.value.n_components();
        for (node, dofs) in self.dofs.chunks_exact(self.components.len()).enumerate() {
            for (dof, (entry, factor)) in dofs.iter().zip(&self.components) {
                u[*dof] = factor * values[node * n + entry];
            }
        }
    }
}

/// A facet normal counts as along an axis within this.
const ALIGNED: f64 = 1e-9;

pub(super) struct ConstraintMaker<'a> {
    pub(super) script: &'a ResolvedScript,
    pub(super) env: &'a Env<'a>,
    pub(super) mesh: &'a Mesh,
    pub(super) topology: &'a Topology,
    pub(super) regions: &'a Regions,
    pub(super) fields: &'a [Field],
    pub(super) numbering: &'a Numbering,
    pub(super) backend: &'a dyn KernelBackend,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
}

impl ConstraintMaker<'_> {
    /// The `fix` statements.
    pub(super) fn make(&mut self) -> Vec<Prescribed> {
        let mut out = Vec::new();
        for fix in &self.script.fixes {
            for target in &fix.targets {
                for place in &fix.places {
                    out.extend(self.one(target, &fix.value, place));
                }
            }
        }
        out
    }

    fn one(&mut self, target: &Target, value: &Expr, place: &wfl::ast::Ident) -> Option<Prescribed> {
        let position = self.fields.iter().position(|f| f.name == target.field.name)?;
        let field = &self.fields[position];
        let start = self.numbering.starts[position]?;
        let nodes = if place.name == "global" {
            vec![0]
        } else {
            let region = self.regions.get(&place.name)?;
            field.nodes_in(self.mesh, self.topology, &region.set)
        };
        if nodes.is_empty() {
            let d = Diagnostic::new("E401", format!("`fix {}` meets no node of `{}`", field.name, field.name));
            let region = &self.regions[&place.name];
            let text = self.elsewhere(&place.name, &region.set, &field.name);
            self.diagnostics.push(d.at(place.span, text));
            return None;
        }
        let n = field.n_components;
        let components: Vec<(usize, f64)> = match &target.part {
            TargetPart::Whole => (0..n).map(|c| (c, 1.0)).collect(),
            TargetPart::Component(e) => vec![(component(self.env, e, field, self.diagnostics)?, 1.0)],
            TargetPart::Normal => vec![self.normal_component(target, place)?],
        };
        let whole = matches!(target.part, TargetPart::Whole);
        let value = self.value(value, if whole { n } else { 1 })?;
        let dofs =
            nodes.iter().flat_map(|node| components.iter().map(move |(c, _)| start + *node as usize * n + c)).collect();
        let positions = nodes.iter().map(|node| field.node_position(*node as usize)).collect();
        let components = if whole { components } else { vec![(0, components[0].1)] };
        Some(Prescribed { dofs, components, positions, value })
    }

    /// "the 256 faces of `east` belong to `right`; uL lives on `left`"
    fn elsewhere(&self, name: &str, set: &RegionSet, field: &str) -> String {
        let count = format!("the {} {} of `{name}`", set.len(), set.kind());
        let cells: Option<BTreeSet<CellId>> = match set {
            RegionSet::Facets(f) => Some(f.iter().map(|f| f.cell).collect()),
            RegionSet::Interface(i) => Some(i.iter().map(|p| p.here.cell).collect()),
            RegionSet::Cells(c) => Some(c.iter().copied().collect()),
            RegionSet::Nodes(_) => None,
        };
        // the first declared body that holds all of them
        let owner = self.script.regions.iter().find(|r| {
            let body = self.regions.get(&r.name.name).map(|n| &n.set);
            let (Some(RegionSet::Cells(body)), Some(cells)) = (body, &cells) else { return false };
            cells.iter().all(|c| body.contains(c)) && r.name.name != name
        });
        let belong = owner.map_or_else(
            || format!("none of {count} touches {field}"),
            |r| format!("{count} belong to `{}`", r.name.name),
        );
        let declared = self.script.fields.iter().find(|f| f.name.name == field);
        match declared.map(|f| &f.space.place) {
            Some(wfl::ast::Place::On(list)) => {
                let list: Vec<String> = list.iter().map(|r| format!("`{}`", r.name)).collect();
                format!("{belong}; {field} lives on {}", list.join(", "))
            }
            _ => belong,
        }
    }

    fn value(&mut self, e: &Expr, entries: usize) -> Option<Value> {
        let place = position_place(self.fields.len());
        let law = compile_value(self.env, &place, "a prescribed value", e);
        self.diagnostics.extend(law.diagnostics.into_iter().map(|d| without_fields(d, "E407", POSITIONS_ONLY)));
        let law = law.value?;
        if let Some(d) = wrong_size(e, law.shape, entries) {
            self.diagnostics.push(d);
            return None;
        }
        match Value::new(law, self.backend) {
            Ok(v) if v.reads_positions_only() => Some(v),
            Ok(_) => {
                self.diagnostics.push(Diagnostic::new("E407", POSITIONS_ONLY).at(e.span, ""));
                None
            }
            Err(error) => {
                self.diagnostics.push(Diagnostic::new("E609", error.to_string()).at(e.span, ""));
                None
            }
        }
    }

    /// `fix u.Normal` on facets that all look along one axis: that component, with the sign of the normal.
    fn normal_component(&mut self, target: &Target, place: &wfl::ast::Ident) -> Option<(usize, f64)> {
        let facets: Vec<FacetRef> = match &self.regions.get(&place.name)?.set {
            RegionSet::Facets(f) => f.clone(),
            RegionSet::Interface(i) => i.iter().map(|p| p.here).collect(),
            other => {
                let d = Diagnostic::new("E204", "`Normal` exists on faces only");
                self.diagnostics.push(d.at(target.span, format!("`{}` is a region of {}", place.name, other.kind())));
                return None;
            }
        };
        let dim = self.mesh.dim();
        let mut found: Option<(usize, f64)> = None;
        for facet in &facets {
            let normal = facet_normal(self.mesh, *facet);
            let axis = (0..dim).find(|k| (normal[*k].abs() - 1.0).abs() < ALIGNED);
            let here = axis.map(|k| (k, normal[k].signum()));
            if here.is_none() || (found.is_some() && found.map(|f| f.0) != here.map(|h| h.0)) {
                let d = Diagnostic::new("E407", "`fix u.Normal` needs faces that look along one axis")
                    .help("on other faces write a term: term on r : gamma*(u.Normal)*(Test_u.Normal)");
                self.diagnostics.push(d.at(target.span, format!("`{}` has a face with normal {normal:?}", place.name)));
                return None;
            }
            found = here;
        }
        found
    }
}

/// E108 for a prescribed value with another number of entries than its target.
pub(super) fn wrong_size(e: &Expr, found: Shape, entries: usize) -> Option<Diagnostic> {
    if found.len() == entries {
        return None;
    }
    let needed = if entries == 1 { "one value is".to_owned() } else { format!("{entries} values are") };
    let d = Diagnostic::new("E108", format!("{needed} needed here, found a {found}"));
    Some(d.at(e.span, found.to_string()))
}

/// Outward normal at the centre of a facet.
fn facet_normal(mesh: &Mesh, facet: FacetRef) -> [f64; 3] {
    let kind = mesh.kind(facet.cell);
    let table = mesh.geometry_element(kind).tabulate(&[kind.reference_centre()], 1);
    let j = mesh.jacobian_at(facet.cell, &table, 0);
    let dim = mesh.dim();
    let m = nalgebra::Matrix3::from_fn(|r, c| if r < dim && c < dim { j[r][c] } else { f64::from(u8::from(r == c)) });
    let reference = kind.facet_normal(usize::from(facet.local));
    let n =
        m.try_inverse().map_or_else(nalgebra::Vector3::zeros, |i| i.transpose() * nalgebra::Vector3::from(reference));
    let n = n.normalize();
    [n[0], n[1], n[2]]
}

/// Multiplier dofs whose jump is prescribed on all sides: component c of a node where component c of every unknown
/// with a node at that place is fixed. Their rows would be singular.
pub(super) fn idle_multipliers(
    script: &ResolvedScript,
    mesh: &Mesh,
    topology: &Topology,
    fields: &[Field],
    numbering: &Numbering,
    fixed: &BTreeSet<usize>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<usize> {
    let mut idle = Vec::new();
    let (low, high) = mesh.bounds();
    let scale = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
    for (k, declared) in script.fields.iter().enumerate() {
        let keep = matches!(declared.kind, Declared::Multiplier { keep_crosspoints: true });
        let (true, FieldSpace::Nodal(space)) = (fields[k].kind == FieldKind::Multiplier && !keep, &fields[k].space)
        else {
            continue;
        };
        let Some(start) = numbering.starts[k] else { continue };
        let Support::Facets(facets) = space.support() else { continue };
        let mut nodes: BTreeSet<u32> = BTreeSet::new();
        for (position, facet) in facets.iter().enumerate() {
            let mut around = vec![*facet];
            around.extend(topology.opposite(*facet));
            for node in space.entity_nodes(position) {
                let x = space.node_coordinates()[*node as usize];
                for c in 0..fields[k].n_components {
                    if prescribed_there(mesh, topology, fields, numbering, fixed, &around, (x, scale), c) {
                        idle.push(start + *node as usize * fields[k].n_components + c);
                        nodes.insert(*node);
                    }
                }
            }
        }
        if !nodes.is_empty() {
            let n = nodes.len();
            let (words, have) = if n == 1 { ("1 node", "has") } else { ("nodes", "have") };
            let count = if n == 1 { words.to_owned() } else { format!("{n} {words}") };
            let d = Diagnostic::new(
                "W404",
                format!(
                    "{count} of `{}` {have} no jump to act on and {} dropped",
                    fields[k].name,
                    if n == 1 { "is" } else { "are" }
                ),
            )
            .note("kept, they make the system singular in stick; `with crosspoints=keep` keeps them");
            diagnostics.push(d.at(declared.name.span, "where the fields on both sides are fixed"));
        }
    }
    idle.sort_unstable();
    idle.dedup();
    idle
}

/// True if every unknown with a node at `x` on these facets has component `c` fixed there, and there is one.
#[expect(clippy::too_many_arguments, reason = "a test on the whole discrete problem")]
fn prescribed_there(
    mesh: &Mesh,
    topology: &Topology,
    fields: &[Field],
    numbering: &Numbering,
    fixed: &BTreeSet<usize>,
    facets: &[FacetRef],
    (x, scale): ([f64; 3], f64),
    c: usize,
) -> bool {
    let mut any = false;
    for (k, field) in fields.iter().enumerate() {
        let (FieldKind::Unknown, FieldSpace::Nodal(space), Some(start)) =
            (field.kind, &field.space, numbering.starts[k])
        else {
            continue;
        };
        for node in space.nodes_on_facets(mesh, topology, facets) {
            let y = space.node_coordinates()[node as usize];
            if (0..3).all(|d| (x[d] - y[d]).abs() <= 1e-9 * scale) {
                if c >= field.n_components || !fixed.contains(&(start + node as usize * field.n_components + c)) {
                    return false;
                }
                any = true;
            }
        }
    }
    any
}
