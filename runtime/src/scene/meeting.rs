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

use wfl::{Code, Diagnostic, FieldKind as Declared, ResolvedScript};
use wfl_compiler::{ProjectionKind, types::FieldKind};

use super::{
    constraints::{SAME_PLACE, Spot, at_place, extent},
    idle::facets_of_nodes,
    mappings::Mappings,
    terms::PlacedLaw,
};
use crate::{
    field::{Field, FieldSpace},
    mesh::{FacetId, FacetRef, Mesh, Topology},
    system::Numbering,
};

/// A dof that a jump reads: field, node, component; what is prescribed is one thing.
type End = Option<(usize, u32, usize)>;

/// What is tied to what, by the multipliers that are kept.
#[derive(Default)]
struct Ties {
    numbers: BTreeMap<End, usize>,
    above: Vec<usize>,
}

impl Ties {
    fn root(&mut self, end: End) -> usize {
        let next = self.above.len();
        let mut at = *self.numbers.entry(end).or_insert(next);
        if at == next {
            self.above.push(next);
        }
        while self.above[at] != at {
            at = self.above[at];
        }
        at
    }

    fn are_tied(&mut self, a: End, b: End) -> bool {
        self.root(a) == self.root(b)
    }

    fn tie(&mut self, a: End, b: End) {
        let (a, b) = (self.root(a), self.root(b));
        self.above[a] = b;
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

/// The multiplier dofs to leave out, and a note for each multiplier that loses some. A component that is prescribed on all
/// sides has no ends here.
pub(super) fn shared_multipliers(on: &Multipliers<'_>, diagnostics: &mut Vec<Diagnostic>) -> Vec<usize> {
    let Multipliers { script, topology, fields, numbering, laws, .. } = *on;
    let holding: Vec<usize> = (0..fields.len()).filter(|k| holds_a_jump(*k, fields, laws)).collect();
    if holding.len() < 2 {
        return Vec::new();
    }
    let extent = extent(on.mesh);
    let (mut ties, mut seen, mut shared) = (Ties::default(), BTreeSet::<FacetId>::new(), Vec::new());
    for k in holding {
        let (Some(start), FieldSpace::Nodal(space)) = (numbering.starts[k], &fields[k].space) else { continue };
        let around = facets_of_nodes(space);
        let keeps = matches!(script.fields[k].kind, Declared::Multiplier { keep_crosspoints: true });
        let mut jump = Jump { on, extent, acts_on: partners(k, fields, laws), mapping: None, images: Vec::new() };
        jump.look_through(laws.iter().filter(|l| tests(k, l)).find_map(|l| l.law.listing.graph.mapping));
        let n = fields[k].n_components;
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
                if !keeps && apart && ends.iter().all(|e| ties.are_tied(e.0, e.1)) {
                    shared.push(dof);
                    loses = true;
                } else {
                    ends.into_iter().for_each(|(a, b)| ties.tie(a, b));
                }
            }
            nodes += usize::from(loses);
        }
        seen.extend(around.values().flatten().map(|f| topology.facet_id(*f)));
        if nodes > 0 {
            let (words, is) = if nodes == 1 { ("1 node".to_owned(), "is") } else { (format!("{nodes} nodes"), "are") };
            let text = format!(
                "{words} of `{}` {is} constrained by another multiplier already and {is} dropped",
                fields[k].name
            );
            let note = "only the sum of both forces is determined in stick, and the system would be singular; an \
                        augmented Lagrangian acts as a penalty of stiffness gamma there; `with crosspoints=keep` keeps \
                        them";
            let d = Diagnostic::new(Code::W404, text).note(note);
            diagnostics.push(d.at(script.fields[k].name.span, "its surface meets that of the other multiplier"));
        }
    }
    shared.sort_unstable();
    shared
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

/// The unknowns on which multiplier `k` acts.
fn partners(k: usize, fields: &[Field], laws: &[PlacedLaw]) -> BTreeSet<usize> {
    let reads = |law: &&PlacedLaw| law.law.tests.iter().chain(&law.law.trials).any(|s| s.field.index() == k);
    let all = laws.iter().filter(reads).flat_map(|l| l.law.tests.iter().chain(&l.law.trials));
    let alike = |f: &usize| fields[*f].kind == FieldKind::Unknown && fields[*f].n_components == fields[k].n_components;
    all.map(|s| s.field.index()).filter(alike).collect()
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
            let nodes = at_place(self.on.mesh, self.on.topology, space, &[facet], spot);
            ends.extend(nodes.into_iter().filter_map(|node| self.end(*k, node, c)));
        }
        ends
    }
}
