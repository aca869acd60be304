//! Redundant multipliers: where two surfaces share a node of the fields they act on, both constrain the same jump.
//!
//! At a corner of a body that sticks on both of its faces two multipliers fix one node: only the sum of their forces is
//! determined, and the tangent is singular. The multiplier that is declared later is dropped there. Its law remains
//! with a multiplier of zero, which for the augmented Lagrangian is a penalty of stiffness gamma at that node. The same
//! holds where three bodies meet in a line: of three jumps two are independent; and at the corners of a cell that is
//! periodic in several directions: of four jumps between four nodes three are.
//!
//! Promises: drops nothing of a multiplier of one component that acts on vectors (each constrains a direction of its own),
//! of one whose laws do not constrain slip, or of two on the same faces. Prescribed values are the task of
//! `constraints.rs`.

use std::collections::{BTreeMap, BTreeSet};

use wfl::{Code, Diagnostic, FieldKind as Declared, ResolvedScript, Span, ast::Crosspoints};
use wfl_compiler::{ProjectionKind, types::FieldKind};
use wfl_discrete::{
    field::{Field, FieldSpace},
    space::{Space, Support},
    system::Numbering,
};
use wfl_mesh::mesh::{FacetId, FacetRef, Mesh, NodeId, Topology};

use super::{
    constraints::{SAME_PLACE, Spot, at_place, extent, facets_of_nodes},
    mappings::Mappings,
    terms::PlacedLaw,
};

/// A dof that a jump reads: field, node, component; what is prescribed is one thing.
type End = Option<(usize, u32, usize)>;

/// What is left of a row below this part of its entries is rounding: rows have entries of 1 and -1.
const DEPENDENT: f64 = 1e-9;

/// The rows of the multipliers that are kept, over the ends of jumps, each by its first end, where it is one: what is taken
/// away of it brings later ends alone.
#[derive(Default)]
struct Rows {
    by_pivot: BTreeMap<End, BTreeMap<End, f64>>,
}

impl Rows {
    /// The row of one multiplier: the sum of its jumps. At a node where surfaces cross it has several, of which it holds one
    /// combination. Without what is prescribed.
    fn row(jumps: &[(End, End)]) -> BTreeMap<End, f64> {
        let mut row = BTreeMap::new();
        for (a, b) in jumps {
            for (end, sign) in [(a, 1.0), (b, -1.0)].into_iter().filter(|(end, _)| end.is_some()) {
                *row.entry(*end).or_insert(0.0) += sign;
            }
        }
        row
    }

    /// What a row has beyond those that are kept; empty if it follows from them.
    fn beyond(&self, mut row: BTreeMap<End, f64>) -> BTreeMap<End, f64> {
        row.retain(|_, x| x.abs() > DEPENDENT);
        while let Some((end, factor)) =
            row.iter().find(|(end, _)| self.by_pivot.contains_key(end)).map(|(e, x)| (*e, *x))
        {
            for (other, x) in &self.by_pivot[&end] {
                *row.entry(*other).or_insert(0.0) -= factor * x;
            }
            row.retain(|other, x| *other != end && x.abs() > DEPENDENT);
        }
        row
    }

    /// Keeps a row.
    fn keep(&mut self, jumps: &[(End, End)]) {
        let row = self.beyond(Self::row(jumps));
        let Some((pivot, size)) = row.iter().next().map(|(end, x)| (*end, *x)) else { return };
        let row = row.into_iter().map(|(end, x)| (end, x / size)).collect();
        self.by_pivot.insert(pivot, row);
    }
}

/// The multipliers of a scene, and what they may meet on.
pub(super) struct Multipliers<'a> {
    pub(super) script: &'a ResolvedScript,
    pub(super) mesh: &'a Mesh,
    pub(super) topology: &'a Topology,
    pub(super) mappings: &'a Mappings,
    pub(super) fields: &'a [Field],
    pub(super) numbering: &'a Numbering,
    /// Components that are prescribed.
    pub(super) fixed: &'a BTreeSet<usize>,
    pub(super) laws: &'a [PlacedLaw],
}

/// Multiplier dofs whose jumps follow from those of other multipliers.
#[derive(Default)]
pub(super) struct Shared {
    /// To leave out.
    pub(super) dropped: Vec<usize>,
    /// Of multipliers of lower degree than what they act on: jumps between their nodes may determine them (`idle.rs`).
    pub(super) in_question: BTreeSet<usize>,
}

/// The multiplier dofs that follow from others, and a note for each multiplier that loses some. A component that is
/// prescribed on all sides has no ends here.
pub(super) fn shared_multipliers(on: &Multipliers<'_>, diagnostics: &mut Vec<Diagnostic>) -> Shared {
    let Multipliers { script, topology, fields, numbering, laws, .. } = *on;
    let holding: Vec<usize> = (0..fields.len()).filter(|k| holds_a_jump(*k, fields, laws)).collect();
    let may_branch = |k: &usize| matches!(&fields[*k].space, FieldSpace::Nodal(space) if branches(on.mesh, space));
    if holding.len() < 2 && !holding.iter().any(may_branch) {
        return Shared::default();
    }
    let extent = extent(on.mesh);
    let (mut rows, mut seen, mut shared) = (Rows::default(), BTreeSet::<FacetId>::new(), Shared::default());
    let mut several = Vec::new();
    for k in holding {
        let (Some(start), FieldSpace::Nodal(space)) = (numbering.starts[k], &fields[k].space) else { continue };
        let around = facets_of_nodes(space);
        let [keeps, follows] = [Crosspoints::Keep, Crosspoints::Follow].map(|wanted| crosspoints(script, k) == wanted);
        let mut jump = Jump { on, extent, acts_on: partners(k, fields, laws), mapping: None, images: Vec::new() };
        jump.look_through(laws.iter().filter(|l| tests(k, l)).find_map(|l| l.law.listing.graph.mapping));
        let n = fields[k].n_components;
        let is_coarse = jump.is_finer_than(space.degree());
        let mut nodes = 0;
        for (node, facets) in &around {
            let apart = facets.iter().all(|f| !seen.contains(&topology.facet_id(*f)));
            let mut loses = false;
            for c in 0..n {
                let dof = start + *node as usize * n + c;
                let ends = jump.ends(space.node_coordinates()[*node as usize], facets, c);
                if ends.is_empty() {
                    continue;
                }
                if !keeps && apart && rows.beyond(Rows::row(&ends)).is_empty() {
                    if is_coarse || follows {
                        shared.in_question.insert(dof);
                        continue;
                    }
                    shared.dropped.push(dof);
                    loses = true;
                } else {
                    rows.keep(&ends);
                    several.extend((ends.len() > 1).then_some(Several { field: k, node: *node, jumps: ends }));
                }
            }
            nodes += usize::from(loses);
        }
        seen.extend(around.values().flatten().map(|f| topology.facet_id(*f)));
        if nodes > 0 {
            diagnostics.push(redundant(&fields[k].name, script.fields[k].name.span, nodes));
        }
    }
    diagnostics.extend(crossings(on, &rows, &several));
    shared.dropped.sort_unstable();
    shared
}

/// What the text says of components that no jump determines.
pub(super) fn crosspoints(script: &ResolvedScript, field: usize) -> Crosspoints {
    match script.fields[field].kind {
        Declared::Multiplier { crosspoints } => crosspoints,
        _ => Crosspoints::Drop,
    }
}

/// W404 for nodes of a multiplier that are dropped beside another one.
fn redundant(name: &str, span: Span, nodes: usize) -> Diagnostic {
    let (words, is) = if nodes == 1 { ("1 node".to_owned(), "is") } else { (format!("{nodes} nodes"), "are") };
    let text = format!("{words} of `{name}` {is} constrained by another multiplier already and {is} dropped");
    let note = "only the sum of both forces is determined in stick, and the system would be singular; an \
                augmented Lagrangian acts as a penalty of stiffness gamma there; `with crosspoints=follow` they have the \
                value of the nearest node, `with crosspoints=keep` they stay";
    Diagnostic::new(Code::W404, text).note(note).at(span, "its surface meets that of the other multiplier")
}

/// A node of a multiplier with several jumps.
struct Several {
    field: usize,
    node: u32,
    jumps: Vec<(End, End)>,
}

/// Whether more than two facets of a surface meet in a node of a plane mesh, or along an edge.
fn branches(mesh: &Mesh, space: &Space) -> bool {
    let Support::Facets(facets) = space.support() else { return false };
    let mut counts: BTreeMap<Vec<NodeId>, usize> = BTreeMap::new();
    for edge in facets.iter().flat_map(|facet| mesh.edges_of_face(*facet)) {
        let mut ends = mesh.edge_ends(edge);
        ends.sort_unstable();
        *counts.entry(ends).or_default() += 1;
    }
    counts.into_values().any(|n| n > 2)
}

/// W424 for each multiplier that has one value for jumps of which several are free.
fn crossings(on: &Multipliers<'_>, rows: &Rows, several: &[Several]) -> Vec<Diagnostic> {
    let mut nodes: BTreeMap<usize, BTreeSet<u32>> = BTreeMap::new();
    for Several { field, node, jumps } in several {
        if jumps.iter().any(|jump| !rows.beyond(Rows::row(&[*jump])).is_empty()) {
            nodes.entry(*field).or_default().insert(*node);
        }
    }
    let told = |(k, nodes): (usize, BTreeSet<u32>)| {
        let first = nodes.first().map(|node| on.fields[k].node_position(*node as usize)).unwrap_or_default();
        let many = if nodes.len() == 1 { "1 node".to_owned() } else { format!("{} nodes", nodes.len()) };
        let text = format!("`{}` has one value for several jumps at {many}", on.fields[k].name);
        let d = Diagnostic::new(Code::W424, text);
        let at = format!("more than two bodies meet there, the first at {:?}", &first[..on.mesh.dim()]);
        let d = d.at(on.script.fields[k].name.span, at);
        d.note("it holds one combination of them: the bodies come apart there")
            .help("a multiplier for each surface, `interface from a to b` of two bodies")
    };
    nodes.into_iter().map(told).collect()
}

/// True for a multiplier of several components whose laws can constrain the whole jump.
fn holds_a_jump(k: usize, fields: &[Field], laws: &[PlacedLaw]) -> bool {
    let slides = |law: &PlacedLaw| {
        law.frozen.as_ref().is_some_and(|p| p.projections.iter().all(|p| p.kind != ProjectionKind::Ball))
    };
    let mut own = laws.iter().filter(|law| tests(k, law)).peekable();
    let vectors = |law: &PlacedLaw| law.law.trials.iter().any(|s| fields[s.field.index()].n_components > 1);
    fields[k].kind == FieldKind::Multiplier
        && (fields[k].n_components > 1 || !laws.iter().any(|law| tests(k, law) && vectors(law)))
        && own.peek().is_some()
        && own.all(|law| !slides(law))
}

/// Whether a law stands in the equations of field `k`.
fn tests(k: usize, law: &PlacedLaw) -> bool {
    law.law.tests.iter().any(|t| t.field.index() == k)
}

/// The unknowns on which multiplier `k` acts: those in its equations, and those in whose equations it is.
fn partners(k: usize, fields: &[Field], laws: &[PlacedLaw]) -> BTreeSet<usize> {
    let pairs = laws.iter().flat_map(|placed| {
        let law = &placed.law;
        law.entries.iter().map(|(test, trial)| {
            let (test, trial) = (&law.tests[usize::from(*test)], &law.trials[usize::from(*trial)]);
            [test.field.index(), trial.field.index()]
        })
    });
    let alike = |f: &usize| fields[*f].kind == FieldKind::Unknown && fields[*f].n_components == fields[k].n_components;
    pairs.filter(|pair| pair.contains(&k)).flatten().filter(alike).collect()
}

/// What a multiplier at a node acts on.
struct Jump<'a> {
    on: &'a Multipliers<'a>,
    /// Of the mesh.
    extent: f64,
    acts_on: BTreeSet<usize>,
    /// What leads to the other side, where that is no neighbour.
    mapping: Option<usize>,
    /// The nodes of the fields in the order of their first coordinate, where that is needed: coordinate, field, node.
    images: Vec<(f64, usize, u32)>,
}

impl Jump<'_> {
    /// Whether what jumps is of higher degree than this.
    fn is_finer_than(&self, degree: usize) -> bool {
        self.acts_on.iter().any(|k| matches!(&self.on.fields[*k].space, FieldSpace::Nodal(s) if s.degree() > degree))
    }

    /// Takes the other side from a mapping.
    fn look_through(&mut self, mapping: Option<usize>) {
        self.mapping = mapping;
        if mapping.is_none() {
            return;
        }
        for k in &self.acts_on {
            let FieldSpace::Nodal(space) = &self.on.fields[*k].space else { continue };
            self.images.extend(space.node_coordinates().iter().zip(0..).map(|(x, node)| (x[0], *k, node)));
        }
        self.images.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    }

    /// Component `c` of the nodes at the image of `x`.
    fn at_image(&self, mapping: usize, x: [f64; 3], c: usize) -> Vec<End> {
        let Some(image) = self.on.mappings.image(mapping, self.on.mesh, x) else { return Vec::new() };
        let near = SAME_PLACE * self.extent;
        let from = self.images.partition_point(|(first, ..)| *first < image[0] - near);
        let beside = self.images[from..].iter().take_while(|(first, ..)| *first <= image[0] + near);
        let stands_there = |k: usize, node: u32| {
            let y = self.on.fields[k].node_position(node as usize);
            (0..3).all(|d| (image[d] - y[d]).abs() <= near)
        };
        beside
            .filter(|(_, k, node)| stands_there(*k, *node))
            .filter_map(|(_, k, node)| self.end(*k, *node, c))
            .collect()
    }

    /// The end that a component of a node is.
    fn end(&self, k: usize, node: u32, c: usize) -> Option<End> {
        let start = self.on.numbering.starts[k]?;
        let is_fixed = self.on.fixed.contains(&(start + node as usize * self.on.fields[k].n_components + c));
        Some(if is_fixed { None } else { Some((k, node, c)) })
    }

    /// The two ends of component `c` of the jumps at `x`, on each of the facets there, each pair once.
    fn ends(&self, x: [f64; 3], facets: &[FacetRef], c: usize) -> Vec<(End, End)> {
        let mut found = BTreeSet::new();
        for facet in facets {
            let here = self.at(x, *facet, c);
            let there = match self.mapping {
                Some(mapping) => Some(self.at_image(mapping, x, c)),
                None => self.on.topology.opposite(*facet).map(|f| self.at(x, f, c)),
            };
            // an image between nodes is an end of its own
            let there = match there.filter(|list| !list.is_empty()) {
                Some(list) => list,
                None if self.mapping.is_some() => continue,
                None => vec![None],
            };
            found.extend(here.iter().flat_map(|h| there.iter().map(|t| (*h, *t))).filter(|(h, t)| h != t));
        }
        found.into_iter().collect()
    }

    fn at(&self, x: [f64; 3], facet: FacetRef, c: usize) -> Vec<End> {
        let mut ends = Vec::new();
        let spot = Spot { x, extent: self.extent };
        for k in &self.acts_on {
            let FieldSpace::Nodal(space) = &self.on.fields[*k].space else { continue };
            // fields of the other side have nodes at the place, too
            if space.position_of_cell(facet.cell).is_none() {
                continue;
            }
            let nodes = at_place(self.on.mesh, self.on.topology, space, &[facet], spot);
            ends.extend(nodes.into_iter().filter_map(|node| self.end(*k, node, c)));
        }
        ends
    }
}
