//! Regions by name: selected by position, interfaces, groups of a mesh file, and their combinations.

use std::collections::BTreeMap;

use wfl::{
    Code, Diagnostic, ResolvedScript, Span,
    ast::{CmpOp, Cond, CondKind, EntityKind, ExprKind, Ident, RegionExpr, RegionOp},
};
use wfl_compiler::{Constant, backend::KernelBackend};
use wfl_discrete::{field::Field, value::Value};
use wfl_mesh::mesh::{
    CellId, FaceEdge, FacetRef, InterfaceFacet, Mesh, RegionError, RegionSet, Topology, boundary_of, interface,
    outer_boundary, pick_cells, pick_facets, pick_nodes,
};

use crate::{
    conditions::{ConditionMaker, holds, not_a_number},
    constants::{bare_env, number},
    cut, edges, groups,
    surfaces::Along,
};

/// Coordinates that are tried to name the nearest members of an empty region.
const CANDIDATES: usize = 20;

/// A region with where it was declared.
#[derive(Clone, Debug)]
pub struct NamedRegion {
    /// Its members.
    pub set: RegionSet,
    /// The edges of faces that end at its nodes, of the rim, the interior and the crossings of a surface: what integrals are
    /// taken along.
    pub edges: Option<Vec<FaceEdge>>,
    /// Its declaration; `None` for `all`, `boundary` and groups of a mesh file.
    pub span: Option<Span>,
    /// The cell region on the owning side of an interface.
    pub here_name: Option<String>,
    /// Faces with a cell on both sides: an `interface along` them exists.
    pub inside: bool,
}

impl NamedRegion {
    /// What integrals are taken over: of a rim its edges, else the members.
    #[must_use]
    pub fn support(&self) -> RegionSet {
        self.edges.as_ref().map_or_else(|| self.set.clone(), |edges| RegionSet::Edges(edges.clone()))
    }

    /// Sorted nodes of a field in it.
    #[must_use]
    pub fn nodes_of(&self, field: &Field, mesh: &Mesh, topology: &Topology) -> Vec<u32> {
        let mut nodes = field.nodes_in(mesh, topology, &self.set);
        if let Some(edges) = &self.edges {
            nodes.extend(field.nodes_in(mesh, topology, &RegionSet::Edges(edges.clone())));
            nodes.sort_unstable();
            nodes.dedup();
        }
        nodes
    }
}

/// The members of a region that is made, and the edges of it.
struct Members {
    set: RegionSet,
    edges: Option<Vec<FaceEdge>>,
}

impl From<RegionSet> for Members {
    fn from(set: RegionSet) -> Self {
        Self { set, edges: None }
    }
}

/// What a region is picked from.
enum Part {
    /// The mesh and its outer boundary.
    Whole,
    /// Some cells.
    Cells(Vec<CellId>),
    /// Faces, or an interface whose sides stay what they are.
    Faces { of: RegionSet, faces: Vec<FacetRef> },
}

/// All regions of a scene.
pub type Regions = BTreeMap<String, NamedRegion>;

pub(super) struct RegionMaker<'a> {
    pub(super) script: &'a ResolvedScript,
    pub(super) mesh: &'a Mesh,
    pub(super) topology: &'a Topology,
    pub(super) params: &'a BTreeMap<String, Constant>,
    pub(super) backend: &'a dyn KernelBackend,
    /// As in [`ConditionMaker`].
    pub(super) smallest: f64,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
    pub(super) regions: Regions,
    /// What the region that is made is for.
    pub(super) counted: cut::Counted,
}

impl RegionMaker<'_> {
    /// Makes every region of the scene.
    pub(super) fn make(mut self) -> Regions {
        let plain = |set| NamedRegion { set, edges: None, span: None, here_name: None, inside: false };
        self.regions.insert("all".to_owned(), plain(RegionSet::Cells(self.mesh.cells().collect())));
        self.regions.insert("boundary".to_owned(), plain(RegionSet::Facets(outer_boundary(self.topology))));
        if names_interior(self.script) {
            // every inner face once, seen from its first cell
            let pairs =
                self.topology.facets().iter().filter_map(|f| Some(InterfaceFacet { here: f.here, there: f.there? }));
            let mut pairs: Vec<InterfaceFacet> = pairs.collect();
            pairs.sort_unstable();
            self.regions.insert("interior".to_owned(), plain(RegionSet::Interface(pairs)));
        }
        self.groups();
        let counted = cut::counted(self.script);
        for region in &self.script.regions {
            self.counted = counted.get(region.name.name.as_str()).copied().unwrap_or_default();
            let here_name = match &region.region {
                RegionExpr::Interface { from, .. } => Some(from.name.clone()),
                RegionExpr::Picked { of: Some(of), .. } => self.lookup(of).and_then(|r| r.here_name.clone()),
                _ => None,
            };
            let Some(Members { set, edges }) = self.evaluate(&region.region, region.name.span) else { continue };
            if set.is_empty() {
                self.empty(&region.name, &region.region);
                continue;
            }
            let inside = self.is_inside(&set);
            let named = NamedRegion { set, edges, span: Some(region.span), here_name, inside };
            self.regions.insert(region.name.name.clone(), named);
        }
        self.regions
    }

    /// The groups of a mesh file, and names that no group has.
    fn groups(&mut self) {
        let Some(file) = self.script.mesh.as_ref().map(|m| m.span) else { return };
        let names = groups::names(self.mesh.groups(), self.script, file, self.diagnostics);
        for (group, name) in self.mesh.groups().iter().zip(&names) {
            match RegionSet::from_group(self.mesh, self.topology, group) {
                Ok(set) => {
                    let inside = self.is_inside(&set);
                    let made = NamedRegion { set, edges: None, span: None, here_name: None, inside };
                    self.regions.insert(name.clone(), made);
                }
                Err(e) => self.diagnostics.push(Diagnostic::new(Code::E410, e.to_string()).at(file, "")),
            }
        }
        let is_region = |name: &str| self.regions.contains_key(name);
        groups::unknown(self.script, &names, &is_region, self.diagnostics);
    }

    /// True for faces that all lie between two cells.
    fn is_inside(&self, set: &RegionSet) -> bool {
        matches!(set, RegionSet::Facets(faces) if faces.iter().all(|f| self.topology.opposite(*f).is_some()))
    }

    fn empty(&mut self, name: &Ident, region: &RegionExpr) {
        let (span, text) = match region {
            RegionExpr::Picked { entity, condition, of, span } => {
                let place = condition.as_ref().map_or(*span, |c| c.span);
                let nearest = condition.as_ref().and_then(|c| self.nearest_coordinate(*entity, of.as_ref(), c));
                (place, nearest.unwrap_or_else(|| self.extent(*entity, of.as_ref())))
            }
            RegionExpr::Interface { from, to, span } => {
                (*span, format!("`{}` and `{}` share no face", from.name, to.name))
            }
            _ => (name.span, String::new()),
        };
        let d = Diagnostic::new(Code::E402, format!("region `{}` is empty", name.name));
        self.diagnostics.push(d.at(span, text));
    }

    /// "no face; the nearest faces have x = 1", for a condition on one coordinate.
    fn nearest_coordinate(&mut self, entity: EntityKind, of: Option<&Ident>, c: &Cond) -> Option<String> {
        let CondKind::Compare(first, rest) = &c.kind else { return None };
        if of.is_some_and(|of| !matches!(self.lookup(of).map(|r| &r.set), Some(RegionSet::Cells(_)))) {
            return None;
        }
        let ([(CmpOp::Equal, wanted)], ExprKind::Name(name)) = (rest.as_slice(), &first.kind) else { return None };
        let axis = ["x", "y", "z"].iter().position(|n| n == name).filter(|d| *d < self.mesh.dim())?;
        let env = bare_env(self.script, self.mesh.dim(), self.params);
        let wanted = number(&env, "a coordinate", wanted, &mut Vec::new())?;
        let cells = of.and_then(|o| self.cells_of(o));
        let mut seen: Vec<f64> = Vec::new();
        let _ = self.pick(entity, cells.as_deref(), &mut |x| {
            seen.push(x[axis]);
            Ok(true)
        });
        seen.sort_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs()));
        seen.dedup();
        // the corners of a face may differ in the coordinate: a value of a whole face is needed
        let best = seen
            .into_iter()
            .take(CANDIDATES)
            .find(|b| self.pick(entity, cells.as_deref(), &mut |x| Ok(x[axis] == *b)).is_ok_and(|set| !set.is_empty()));
        let (one, many) = match entity {
            EntityKind::Cells => ("cell", "cells"),
            EntityKind::Faces => ("face", "faces"),
            _ => ("node", "nodes"),
        };
        best.map(|b| format!("no {one}; the nearest {many} have {name} = {b}"))
    }

    /// "no face of the outer boundary; the mesh spans x = 0..1"; of a part of faces or of an interface, "no face of `seam`".
    fn extent(&self, entity: EntityKind, of: Option<&Ident>) -> String {
        let named =
            of.filter(|of| !matches!(self.regions.get(&of.name).map(|r| &r.set), Some(RegionSet::Cells(_)) | None));
        let (low, high) = self.mesh.bounds();
        let range: Vec<String> = ["x", "y", "z"][..self.mesh.dim()]
            .iter()
            .enumerate()
            .map(|(d, name)| format!("{name} = {}..{}", low[d], high[d]))
            .collect();
        let word = match (entity, named) {
            (EntityKind::Faces, Some(of)) => format!("no face of `{}`", of.name),
            (EntityKind::Faces, None) => "no face of the outer boundary".to_owned(),
            (EntityKind::Cells, _) => "no cell".to_owned(),
            (EntityKind::Rim, _) => "no edge with one face alone".to_owned(),
            (EntityKind::Crossings, _) => "no edge with three faces or more".to_owned(),
            (EntityKind::Interior, _) => "no edge between two faces".to_owned(),
            (EntityKind::Nodes, _) => "no node".to_owned(),
        };
        format!("{word}; the mesh spans {}", range.join(", "))
    }

    /// The cells of a region that must be cells.
    fn cells_of(&mut self, name: &Ident) -> Option<Vec<CellId>> {
        match &self.lookup(name)?.set {
            RegionSet::Cells(cells) => Some(cells.clone()),
            other => {
                let d = Diagnostic::new(
                    Code::E405,
                    format!("`{}` is a region of {}, cells are needed", name.name, other.kind()),
                );
                self.diagnostics.push(d.at(name.span, ""));
                None
            }
        }
    }

    /// What is picked from: of cells themselves, their boundary or their nodes, of faces and interfaces the faces.
    fn part_of(&mut self, entity: EntityKind, name: &Ident) -> Option<Part> {
        let set = &self.lookup(name)?.set;
        let faces = match set {
            RegionSet::Facets(faces) => faces.clone(),
            RegionSet::Interface(pairs) => pairs.iter().map(|p| p.here).collect(),
            _ => Vec::new(),
        };
        match entity {
            EntityKind::Rim | EntityKind::Crossings | EntityKind::Interior if faces.is_empty() => {
                let text = format!("`{}` is a region of {}, faces are needed", name.name, set.kind());
                self.diagnostics.push(Diagnostic::new(Code::E405, text).at(name.span, ""));
                None
            }
            EntityKind::Cells => self.cells_of(name).map(Part::Cells),
            _ if !faces.is_empty() => Some(Part::Faces { of: set.clone(), faces }),
            _ => self.cells_of(name).map(Part::Cells),
        }
    }

    /// A region that exists already; unknown names have a message.
    fn lookup(&self, name: &Ident) -> Option<&NamedRegion> {
        self.regions.get(&name.name)
    }

    fn evaluate(&mut self, region: &RegionExpr, place: Span) -> Option<Members> {
        match region {
            RegionExpr::Name(name) => {
                let NamedRegion { set, edges, .. } = self.lookup(name)?.clone();
                Some(Members { set, edges })
            }
            RegionExpr::Interface { from, to, span } => {
                let (a, b) = (self.cells_of(from), self.cells_of(to));
                let made = interface(self.mesh, self.topology, &a?, &b?);
                self.checked(made, *span).map(Members::from)
            }
            RegionExpr::Along { surface, towards, span } => {
                let set = self.lookup(surface)?.set.clone();
                let Self { script, mesh, topology, params, ref mut diagnostics, .. } = *self;
                let mut made = Along { script, mesh, topology, params, diagnostics };
                made.make(&set, surface, towards.as_ref(), *span).map(Members::from)
            }
            RegionExpr::Picked { entity, of, condition, span } => {
                self.picked(*entity, of.as_ref(), condition.as_ref(), *span)
            }
            RegionExpr::Combine(first, rest) => {
                let mut total = self.evaluate(first, place)?;
                for (op, other) in rest {
                    let other = self.evaluate(other, place)?;
                    let with = |a: &RegionSet, b: &RegionSet| match op {
                        RegionOp::Union => a.union(b),
                        RegionOp::Minus => a.difference(b),
                        RegionOp::Intersect => a.intersection(b),
                    };
                    let set = self.checked(with(&total.set, &other.set), place)?;
                    // nodes of no edge leave open which edges are meant
                    let edges = total.edges.zip(other.edges).and_then(|(a, b)| {
                        match with(&RegionSet::Edges(a), &RegionSet::Edges(b)) {
                            Ok(RegionSet::Edges(edges)) => Some(edges),
                            _ => None,
                        }
                    });
                    total = Members { set, edges };
                }
                Some(total)
            }
        }
    }

    fn checked(&mut self, made: Result<RegionSet, RegionError>, span: Span) -> Option<RegionSet> {
        match made {
            Ok(set) => Some(set),
            Err(e) => {
                let d = Diagnostic::new(Code::E405, e.to_string()).at(span, "");
                self.diagnostics.push(match e {
                    RegionError::Overlap { .. } => d.help(
                        "of faces inside one body: interface along s, where s is a surface of the mesh file or other faces",
                    ),
                    _ => d,
                });
                None
            }
        }
    }

    fn picked(&mut self, entity: EntityKind, of: Option<&Ident>, cond: Option<&Cond>, span: Span) -> Option<Members> {
        let part = match of {
            Some(name) => self.part_of(entity, name)?,
            None => Part::Whole,
        };
        let condition = match cond {
            Some(c) => Some(self.condition(c)?),
            None => None,
        };
        let mut bad: Option<[f64; 3]> = None;
        let mut picks = |x: [f64; 3]| -> Result<bool, std::convert::Infallible> {
            let Some(value) = &condition else { return Ok(true) };
            let holds = holds(value, x);
            if holds.is_none() {
                bad = Some(x);
            }
            Ok(holds == Some(true))
        };
        let mut edges = None;
        let Ok(set) = match &part {
            Part::Whole => self.pick(entity, None, &mut picks),
            Part::Cells(cells) => self.pick(entity, Some(cells), &mut picks),
            Part::Faces { faces, .. } if entity == EntityKind::Faces => pick_facets(self.mesh, faces, &mut picks),
            Part::Faces { faces, .. } => match edges::between(self.mesh, entity, faces, span) {
                Ok(found) => {
                    let Ok(picked) = found.pick(self.mesh, &mut picks);
                    edges = picked.edges;
                    Ok(RegionSet::Nodes(picked.nodes))
                }
                Err(told) => {
                    self.diagnostics.push(*told);
                    return None;
                }
            },
        };
        if let Some(x) = bad {
            self.diagnostics.push(not_a_number(x, span));
            return None;
        }
        if let (Some(value), Some(cond)) = (&condition, cond) {
            let taken = edges.as_ref().map_or_else(|| set.clone(), |edges| RegionSet::Edges(edges.clone()));
            self.tell_cut(entity, &part, &taken, value, cond.span);
        }
        let set = match part {
            Part::Faces { of, .. } if entity == EntityKind::Faces => of.intersection(&set).unwrap_or(set),
            _ => set,
        };
        Some(Members { set, edges })
    }

    /// W419 for a condition that cuts what it selects; the first of several ranks has the whole mesh, and says it.
    fn tell_cut(&mut self, entity: EntityKind, part: &Part, set: &RegionSet, condition: &Value, span: Span) {
        if !self.mesh.check_whole(|| !set.is_empty()) {
            return;
        }
        let candidates = match (entity, part) {
            (EntityKind::Faces, Part::Faces { faces, .. }) => RegionSet::Facets(faces.clone()),
            (EntityKind::Rim, Part::Faces { faces, .. }) => RegionSet::Edges(edges::rim(self.mesh, faces)),
            (EntityKind::Faces, Part::Cells(cells)) => RegionSet::Facets(boundary_of(self.mesh, self.topology, cells)),
            (EntityKind::Faces, Part::Whole) => RegionSet::Facets(outer_boundary(self.topology)),
            (EntityKind::Cells, Part::Cells(cells)) => RegionSet::Cells(cells.clone()),
            (EntityKind::Cells, _) => RegionSet::Cells(self.mesh.cells().collect()),
            _ => return,
        };
        let mut holds = |x| holds(condition, x) == Some(true);
        self.diagnostics.extend(cut::told(self.mesh, &candidates, set, &mut holds, (span, self.counted)));
    }

    fn pick(
        &self,
        entity: EntityKind,
        cells: Option<&[CellId]>,
        holds: &mut dyn FnMut([f64; 3]) -> Result<bool, std::convert::Infallible>,
    ) -> Result<RegionSet, std::convert::Infallible> {
        match entity {
            EntityKind::Cells => pick_cells(self.mesh, cells, holds),
            EntityKind::Faces => {
                let facets = match cells {
                    Some(c) => boundary_of(self.mesh, self.topology, c),
                    None => outer_boundary(self.topology),
                };
                pick_facets(self.mesh, &facets, holds)
            }
            // the others have faces that they are of
            _ => pick_nodes(self.mesh, cells, holds),
        }
    }

    fn condition(&mut self, cond: &Cond) -> Option<Value> {
        let Self { script, mesh, params, backend, smallest, .. } = *self;
        ConditionMaker { script, mesh, params, backend, smallest }.make(cond, self.diagnostics)
    }
}

/// True if some statement is about `interior`; the region is made only then.
fn names_interior(script: &ResolvedScript) -> bool {
    let is = |i: &Ident| i.name == "interior";
    let in_regions = script.regions.iter().any(|r| mentions_interior(&r.region));
    let in_fields =
        script.fields.iter().any(|f| matches!(&f.space.place, wfl::ast::Place::On(list) if list.iter().any(is)));
    let places = script.terms.iter().map(|t| &t.places);
    let places = places.chain(script.loads.iter().map(|l| &l.places)).chain(script.reductions().map(|m| &m.places));
    let in_refinements = script.refinements.iter().flat_map(|r| &r.what.places).any(is);
    in_regions || in_refinements || in_fields || places.into_iter().flatten().any(is)
}

fn mentions_interior(region: &RegionExpr) -> bool {
    match region {
        RegionExpr::Name(name) | RegionExpr::Picked { of: Some(name), .. } => name.name == "interior",
        RegionExpr::Combine(first, rest) => mentions_interior(first) || rest.iter().any(|(_, r)| mentions_interior(r)),
        _ => false,
    }
}
