//! Multiplier components without a jump: prescribed values, or the mesh, leave the two sides no relative displacement.
//!
//! At a node the terms couple the components of a multiplier with displacements at that position: the rows of the jump.
//! A direction of the multiplier without a free displacement there is idle, unless the multiplier is of lower degree and
//! the jumps between its nodes determine it (`coarse.rs`). Its equation is empty or follows from others. Such a direction
//! is dropped, with two exceptions, in which it takes the value of the multiplier at the nearest node where it is not idle,
//! as the mortar method uses constants at the ends of an interface (Wohlmuth 2000), so that a uniform traction stays
//! uniform:
//! - a law depends on it where the sides can still move in another direction: friction needs the normal traction at a
//!   node that can only slide;
//! - both sides are one node, the tip of a crack: the traction of a closed crack does not end with the jump. A zero there
//!   would spoil the faces beside it. The equations of such a node are added to those of the one it follows; the jump is
//!   zero there, so that what is one-sided keeps its sign: where the node that it follows is open, both are zero.
//!
//! Promises: directions follow from the tangents ([`Friction`]), independent of the components of the multiplier;
//! nothing changes where no displacement is prescribed and no crack ends. Redundancy between two multipliers is the task
//! of `meeting.rs`.

mod coarse;
mod directions;
mod vectors;

use std::{
    cmp::Ordering,
    collections::{BTreeMap, BTreeSet},
};

use wfl::{Code, Diagnostic, ResolvedScript, Span, ast::Crosspoints};
use wfl_compiler::types::{FieldKind, Side};
use wfl_contact::{Contact, Friction, couplings, has_multiplier};
use wfl_discrete::{
    field::FieldSpace,
    frames::Frame,
    space::Space,
    system::{FIXED, System, Tie},
};
use wfl_mesh::mesh::{FacetRef, Topology};
use wfl_sparse::csr::{Csr, CsrError};

use super::{
    constraints::{SAME_PLACE, Spot, at_place, extent, facets_of_nodes},
    mappings::Mappings,
    meeting::crosspoints,
};
use coarse::{Readings, is_coarse};
use directions::{Node, Split};

/// What `wfl check` says of nodes whose sides are one: the multiplier and the reason.
pub(super) type Notes = Vec<(String, String)>;

/// A node of a multiplier at which some displacement is prescribed, or both sides are one.
struct Candidate {
    field: usize,
    node: u32,
    /// First dof of the node.
    first: usize,
    /// Dofs of displacements at the place, of all nodes that are not the end of a split.
    place: Vec<usize>,
    /// A field there is one on both sides.
    joined: bool,
    /// The components whose jump another multiplier holds, too, so that it may follow from that one.
    shared: Vec<usize>,
    /// The multiplier is of lower degree than what it acts on.
    coarse: bool,
    /// It is to follow where it is idle.
    follows: bool,
}

/// What lies across the faces of a multiplier, and what meets it.
#[derive(Clone, Copy)]
pub(super) struct Sides<'a> {
    /// Neighbours.
    pub(super) topology: &'a Topology,
    /// Images.
    pub(super) mappings: &'a Mappings,
    /// Multipliers of lower degree that may follow from others at their node.
    pub(super) shared: &'a BTreeSet<usize>,
}

/// Takes the idle directions of all multipliers out of a system, with a message for each multiplier that loses some.
///
/// # Errors
/// [`CsrError`] when a pattern does not fit the index types.
pub(super) fn leave_out(
    script: &ResolvedScript,
    at: Sides<'_>,
    system: &mut System,
    contact: &Contact,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Notes, CsrError> {
    cannot_follow(script, system, diagnostics);
    let candidates = candidates(script, at, system);
    if candidates.is_empty() {
        return Ok(Notes::new());
    }
    let numbers = numbers(system, &candidates);
    let size = 1e-3 * extent(&system.mesh);
    let stick = couplings(system, contact, &numbers, Friction::Sticks, size)?;
    let slip = couplings(system, contact, &numbers, Friction::Slips, size)?;
    let mut nodes: Vec<Node> = candidates.iter().map(|c| Node::new(system, &numbers, &stick, c)).collect();
    let mut readings = candidates.iter().any(|c| c.coarse).then(|| Readings::new(system, &stick, &numbers));
    readings.iter_mut().for_each(|readings| readings.look_at(&mut nodes));
    let splits: Vec<Split> = (0..nodes.len()).map(|k| Split::new(system, &numbers, &slip, &nodes, k)).collect();
    let plan = Plan::new(system, readings.as_ref(), &candidates, splits);
    let notes = plan.tell(script, system, &candidates, diagnostics);
    system.leave_out(plan.dropped, plan.ties, plan.frames);
    Ok(notes)
}

/// Nodes of multipliers that may have an idle direction.
fn candidates(script: &ResolvedScript, sides: Sides<'_>, system: &System) -> Vec<Candidate> {
    let mut found = Vec::new();
    let scale = extent(&system.mesh);
    for field in 0..script.fields.len() {
        let wanted = crosspoints(script, field);
        let keep = wanted == Crosspoints::Keep || meets_moving(system, field);
        let (FieldKind::Multiplier, FieldSpace::Nodal(space), Some(range), false) =
            (system.fields[field].kind, &system.fields[field].space, system.range(field), keep)
        else {
            continue;
        };
        let partners = Partners::new(system, sides.mappings, field);
        for (node, facets) in facets_of_nodes(space) {
            let first = range.start + node as usize * system.fields[field].n_components;
            let x = space.node_coordinates()[node as usize];
            let (mut place, joined) = partners.at(sides.topology, system, &facets, Spot { x, extent: scale });
            place.extend(partners.images(system, first, x));
            let is_bound = |d: &usize| system.numbering.free[*d] == FIXED || system.numbering.frames.of(*d).is_some();
            let own = 0..system.fields[field].n_components;
            let shared: Vec<usize> = own.filter(|c| sides.shared.contains(&(first + c))).collect();
            if place.iter().any(is_bound) || (joined && place.is_empty()) || !shared.is_empty() {
                let follows = wanted == Crosspoints::Follow;
                let candidate = Candidate { field, node, first, place, joined, shared, coarse: false, follows };
                found.push(Candidate { coarse: is_coarse(system, &candidate), ..candidate });
            }
        }
    }
    found
}

/// Whether images of a multiplier move: which side it meets changes.
fn meets_moving(system: &System, field: usize) -> bool {
    let mut own = system.terms.iter().filter(|t| t.coupled_fields().any(|f| f.index() == field));
    own.any(|t| t.integrator.moves())
}

/// W404 for multipliers that are to follow and cannot.
fn cannot_follow(script: &ResolvedScript, system: &System, diagnostics: &mut Vec<Diagnostic>) {
    for (field, declared) in script.fields.iter().enumerate() {
        if crosspoints(script, field) == Crosspoints::Follow && meets_moving(system, field) {
            let text = format!("`{}` follows nowhere: what it meets moves", declared.name.name);
            let note = "which of its nodes have a jump changes with the state: all of them stay unknowns";
            let d = Diagnostic::new(Code::W404, text).note(note).at(declared.name.span, "");
            diagnostics.push(d.help("leave `crosspoints=follow` out"));
        }
    }
}

/// The unknowns that a multiplier acts on.
struct Partners<'a> {
    fields: BTreeSet<usize>,
    /// By first dof of a node and mapping: the dofs of unknowns that its terms read there.
    images: BTreeMap<(usize, usize), BTreeSet<usize>>,
    mappings: &'a Mappings,
}

impl<'a> Partners<'a> {
    fn new(system: &System, mappings: &'a Mappings, field: usize) -> Self {
        let range = system.range(field).unwrap_or_default();
        let n = system.fields[field].n_components;
        let unknown = |f: &usize| system.fields.get(*f).is_some_and(|f| f.kind == FieldKind::Unknown);
        let mut this = Self { fields: BTreeSet::new(), images: BTreeMap::new(), mappings };
        for term in system.terms.iter().filter(|t| t.coupled_fields().any(|f| f.index() == field)) {
            // those that stand in its rows or in its columns: a law may read others beside it, such as a slip rate
            let law = &term.law;
            let pairs = law.entries.iter().map(|(test, trial)| {
                let (test, trial) = (&law.tests[usize::from(*test)], &law.trials[usize::from(*trial)]);
                [test.field.index(), trial.field.index()]
            });
            let with_it = pairs.filter(|pair| pair.contains(&field)).flatten();
            this.fields.extend(with_it.filter(unknown));
            let Some(mapping) = term.law.listing.graph.mapping else { continue };
            let there = term.law.tests.iter().chain(&term.law.trials).filter(|s| s.side == Side::There);
            let there: Vec<_> =
                there.map(|s| s.field.index()).filter(unknown).filter_map(|f| system.range(f)).collect();
            term.for_each_entity(|tests, trials| {
                let all = || tests.iter().chain(trials).map(|d| *d as usize);
                let seen: BTreeSet<usize> = all().filter(|d| there.iter().any(|r| r.contains(d))).collect();
                for d in all().filter(|d| range.contains(d)) {
                    this.images.entry((d - (d - range.start) % n, mapping)).or_default().extend(&seen);
                }
            });
        }
        this
    }

    /// The dofs at the images of a node at `x`: of the nodes that stand there, as on the other side of an interface; where
    /// none does, all that its terms read.
    fn images(&self, system: &System, first: usize, x: [f64; 3]) -> Vec<usize> {
        let near = SAME_PLACE * extent(&system.mesh);
        let mut found = Vec::new();
        for ((_, mapping), read) in self.images.range((first, 0)..(first + 1, 0)) {
            let image = self.mappings.image(*mapping, &system.mesh, x);
            let stands_there = |dof: &usize| {
                let (field, node, _) = system.numbering.describe(&system.fields, *dof);
                let y = system.fields[field].node_position(node);
                image.is_some_and(|image| (0..3).all(|d| (image[d] - y[d]).abs() <= near))
            };
            let there: Vec<usize> = read.iter().copied().filter(stands_there).collect();
            if there.is_empty() { found.extend(read) } else { found.extend(there) }
        }
        found
    }

    /// The dofs of the unknowns that stand at a place on both sides of these facets, and whether a field has one node
    /// there for both, which is then left out.
    fn at(&self, topology: &Topology, system: &System, facets: &[FacetRef], near: Spot) -> (Vec<usize>, bool) {
        let mut around = facets.to_vec();
        around.extend(facets.iter().filter_map(|f| topology.opposite(*f)));
        let (mut found, mut joined) = (Vec::new(), false);
        for field in &self.fields {
            let (FieldSpace::Nodal(space), Some(range)) = (&system.fields[*field].space, system.range(*field)) else {
                continue;
            };
            let nodes = at_place(&system.mesh, topology, space, &around, near);
            let is_torn = around.iter().any(|f| space.is_torn_along(topology.facet_id(*f)));
            if is_torn && nodes.len() == 1 {
                joined = true;
                continue;
            }
            let n = system.fields[*field].n_components;
            let dofs = nodes.into_iter().flat_map(move |node| (0..n).map(move |c| range.start + node as usize * n + c));
            found.push((is_torn || lives_on_one_side(space, topology, facets), dofs));
        }
        // beside sides that are one, what a law reads of fields that never jump is no jump
        let jumps = found.into_iter().filter(|(can_jump, _)| *can_jump || !joined);
        (jumps.flat_map(|(_, dofs)| dofs).collect(), joined)
    }
}

/// Whether a space has the cells of these facets on one side alone: its values are one end of a jump to another field.
fn lives_on_one_side(space: &Space, topology: &Topology, facets: &[FacetRef]) -> bool {
    let has = |facet: FacetRef| space.position_of_cell(facet.cell).is_some();
    facets.iter().any(|facet| topology.opposite(*facet).is_some_and(|other| has(*facet) != has(other)))
}

/// Numbers for the dofs of all entities of terms with multipliers that hold a candidate, or any multiplier beside coarse
/// ones.
fn numbers(system: &System, candidates: &[Candidate]) -> Vec<u32> {
    let n = |c: &Candidate| system.fields[c.field].n_components;
    let mut wanted: BTreeSet<usize> = candidates.iter().flat_map(|c| c.first..c.first + n(c)).collect();
    if candidates.iter().any(|c| c.coarse) {
        let multipliers = (0..system.fields.len()).filter(|k| system.fields[*k].kind == FieldKind::Multiplier);
        wanted.extend(multipliers.filter_map(|k| system.range(k)).flatten());
    }
    let mut numbers = vec![FIXED; system.numbering.n_dofs];
    let mut next = 0;
    for term in system.terms.iter().filter(|t| has_multiplier(system, t)) {
        term.for_each_entity(|tests, trials| {
            if tests.iter().chain(trials).any(|d| wanted.contains(&(*d as usize))) {
                for d in tests.iter().chain(trials) {
                    if numbers[*d as usize] == FIXED {
                        numbers[*d as usize] = next;
                        next += 1;
                    }
                }
            }
        });
    }
    numbers
}

/// What becomes of the idle directions.
#[derive(Default)]
struct Plan {
    dropped: Vec<usize>,
    ties: Vec<Tie>,
    frames: Vec<Frame>,
    /// By candidate: components left out, components that follow.
    counts: Vec<(usize, usize)>,
}

impl Plan {
    fn new(system: &System, readings: Option<&Readings>, candidates: &[Candidate], splits: Vec<Split>) -> Self {
        let mut plan = Self { frames: system.numbering.frames.list().to_vec(), ..Self::default() };
        let by_node: BTreeMap<(usize, u32), usize> =
            candidates.iter().enumerate().map(|(k, c)| ((c.field, c.node), k)).collect();
        // axes first, so that a leader has its frame before another node asks for it
        let mut axes: BTreeMap<usize, Vec<Vec<f64>>> = BTreeMap::new();
        for (candidate, split) in candidates.iter().zip(&splits) {
            if let Some(frame) = split.frame() {
                axes.insert(candidate.first, frame);
            }
        }
        // a leader that gets a frame counts its dofs along it: all have theirs before a dof is named
        let mut known = None;
        while known != Some(axes.len()) {
            known = Some(axes.len());
            for (candidate, split) in candidates.iter().zip(&splits) {
                for direction in &split.tied {
                    leader(system, candidate, direction, &by_node, &splits, &mut axes, &mut |_| true);
                }
            }
        }
        let mut followers: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (k, (candidate, split)) in candidates.iter().zip(&splits).enumerate() {
            plan.counts.push((split.dropped.len(), 0));
            for direction in &split.dropped {
                plan.dropped.extend(dof_along(candidate.first, direction, axes.get(&candidate.first)));
            }
            for direction in &split.tied {
                let Some(follower) = dof_along(candidate.first, direction, axes.get(&candidate.first)) else {
                    plan.counts[k].0 += 1;
                    continue;
                };
                let readings = readings.filter(|_| candidate.coarse && axes.is_empty());
                let mut can_lead = |leader: usize| {
                    followers.entry(leader).or_default().push(follower);
                    let can = readings.is_none_or(|readings| readings.can_lead(leader, &followers));
                    if !can {
                        followers.entry(leader).or_default().pop();
                    }
                    can
                };
                if let Some(leader) = leader(system, candidate, direction, &by_node, &splits, &mut axes, &mut can_lead)
                {
                    plan.ties.push(Tie { follower, leader });
                    plan.counts[k].1 += 1;
                } else {
                    plan.dropped.push(follower);
                    plan.counts[k].0 += 1;
                }
            }
        }
        plan.frames.extend(axes.into_iter().map(|(first, axes)| Frame { first, axes }));
        plan
    }

    /// The messages and notes.
    fn tell(
        &self,
        script: &ResolvedScript,
        system: &System,
        candidates: &[Candidate],
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Notes {
        let mut notes = Notes::new();
        for (field, declared) in script.fields.iter().enumerate() {
            let own = candidates.iter().zip(&self.counts).filter(|(candidate, _)| candidate.field == field);
            let (tips, others): (Vec<_>, Vec<_>) = own.partition(|(candidate, _)| candidate.joined);
            let (asked, others): (Vec<_>, Vec<_>) = others.into_iter().partition(|(candidate, _)| candidate.follows);
            let (coarse, others): (Vec<_>, Vec<_>) = others.into_iter().partition(|(candidate, _)| candidate.coarse);
            let counts =
                |list: Vec<(&Candidate, &(usize, usize))>| list.into_iter().map(|(_, counts)| *counts).collect();
            let of = Of { name: &system.fields[field].name, components: system.fields[field].n_components };
            notes.extend(of.tips(counts(tips), declared.name.span, diagnostics));
            notes.extend(of.asked(&counts(asked), declared.name.span, diagnostics));
            of.prescribed(counts(others), declared.name.span, diagnostics);
            of.coarse(&counts(coarse), declared.name.span, diagnostics);
        }
        notes
    }
}

/// A multiplier of which something is told.
struct Of<'a> {
    name: &'a str,
    components: usize,
}

impl Of<'_> {
    /// Of nodes where both sides are one, by node the components that are left out and those that follow.
    fn tips(&self, counts: Vec<(usize, usize)>, span: Span, told: &mut Vec<Diagnostic>) -> Option<(String, String)> {
        let alone = counts.iter().filter(|(dropped, _)| *dropped > 0).count();
        if alone > 0 {
            let text =
                format!("`{}` is zero at {} where a `split` ends: no node beside has a jump", self.name, nodes(alone));
            let note = "it holds nothing on these faces: both ends of each are ends of the `split`";
            let help = "more faces along the crack; or one value a face, `DP0` beside displacements of degree two";
            told.push(Diagnostic::new(Code::W680, text).at(span, "").note(note).help(help));
        }
        let following = counts.iter().filter(|(_, tied)| *tied > 0).count();
        let why = "both sides share one node there, an end of the `split`: without a jump it takes the value of the nearest \
                   node that has one";
        (following > 0).then(|| (format!("`{}` at {}", self.name, nodes(following)), why.to_owned()))
    }

    /// The same of nodes that are to follow.
    fn asked(&self, counts: &[(usize, usize)], span: Span, told: &mut Vec<Diagnostic>) -> Option<(String, String)> {
        let dropped = counts.iter().filter(|(dropped, _)| *dropped > 0).count();
        if dropped > 0 {
            let text = format!("at {} `{}` has no node beside to follow and is dropped", nodes(dropped), self.name);
            let note = "no node of its surface nearby has a jump that would determine it";
            told.push(Diagnostic::new(Code::W404, text).note(note).at(span, ""));
        }
        let following = counts.iter().filter(|(_, tied)| *tied > 0).count();
        let why = "no jump determines it there: it has the value of the nearest node, `with crosspoints=follow`";
        (following > 0).then(|| (format!("`{}` at {}", self.name, nodes(following)), why.to_owned()))
    }

    /// The same of nodes of a multiplier of lower degree than what it acts on.
    fn coarse(&self, counts: &[(usize, usize)], span: Span, told: &mut Vec<Diagnostic>) {
        let name = self.name;
        let mut warn = |count: usize, what: &str| {
            if count > 0 {
                let text = format!("at {} `{name}` {what}", nodes(count));
                let note =
                    "what is free around them does not determine so many values; `with crosspoints=keep` keeps them";
                let label = "its surface has few free nodes there";
                told.push(Diagnostic::new(Code::W404, text).note(note).at(span, label));
            }
        };
        let dropped = counts.iter().filter(|(dropped, _)| *dropped > 0).count();
        let following = counts.iter().filter(|(dropped, tied)| *dropped == 0 && *tied > 0).count();
        warn(dropped, "is dropped");
        warn(following, "has the value of the nearest node that holds a jump");
    }

    /// The same of nodes where displacements of both sides are prescribed.
    fn prescribed(&self, counts: Vec<(usize, usize)>, span: Span, told: &mut Vec<Diagnostic>) {
        let (name, n) = (self.name, self.components);
        let count = |f: &dyn Fn(usize, usize) -> bool| counts.iter().filter(|k| f(k.0, k.1)).count();
        let kept = "they would make the system singular in stick, and are zero; `with crosspoints=follow` they have the value of \
                    the nearest node, `with crosspoints=keep` they stay";
        let mut warn = |text: String, note: &str, label: &str| {
            told.push(Diagnostic::new(Code::W404, text).note(note).at(span, label));
        };
        let whole = count(&|dropped, _| dropped == n);
        if whole > 0 {
            let (have, are) = if whole == 1 { ("has", "is") } else { ("have", "are") };
            let text = format!("{} of `{name}` {have} no jump and {are} dropped", nodes(whole));
            warn(text, kept, "the displacements of both sides are prescribed");
        }
        let part = count(&|dropped, _| dropped > 0 && dropped < n);
        if part > 0 {
            let text = format!("at {} of `{name}` a component has no jump and is dropped", nodes(part));
            warn(text, kept, "that displacement of both sides is prescribed");
        }
        let follow = count(&|_, tied| tied > 0);
        if follow > 0 {
            let text = format!(
                "at {} of `{name}` friction depends on a component without a jump: it takes the value of the nearest \
                 node that has one",
                nodes(follow)
            );
            let note = "without it friction would be lost there; as an unknown it makes the system singular; `with \
                        crosspoints=keep` keeps it";
            warn(text, note, "the normal displacements of both sides are prescribed, and the sides can slide");
        }
    }
}

fn nodes(n: usize) -> String {
    if n == 1 { "1 node".to_owned() } else { format!("{n} nodes") }
}

/// The dof of a node along a direction: the component, or the axis of its frame.
fn dof_along(first: usize, direction: &[f64], axes: Option<&Vec<Vec<f64>>>) -> Option<usize> {
    let along = |axis: &[f64]| vectors::dot(axis, direction).abs() > 1.0 - ALIGNED;
    let place = match axes {
        Some(axes) => axes.iter().position(|a| along(a)),
        None => direction.iter().position(|x| x.abs() > 1.0 - ALIGNED),
    };
    place.map(|k| first + k)
}

/// Unit vectors are one direction if their product is within this of 1.
const ALIGNED: f64 = 1e-9;

/// The dof that the direction of a candidate follows: of the nearest node of the field, over as few faces as possible,
/// at which it is not idle and that can lead; of those further away none, if none of these can.
fn leader(
    system: &System,
    candidate: &Candidate,
    direction: &[f64],
    by_node: &BTreeMap<(usize, u32), usize>,
    splits: &[Split],
    axes: &mut BTreeMap<usize, Vec<Vec<f64>>>,
    can_lead: &mut dyn FnMut(usize) -> bool,
) -> Option<usize> {
    let FieldSpace::Nodal(space) = &system.fields[candidate.field].space else { return None };
    let n = system.fields[candidate.field].n_components;
    let start = system.range(candidate.field)?.start;
    let positions = 0..space.n_positions();
    let distance = |node: u32| -> f64 {
        let (a, b) = (space.node_coordinates()[node as usize], space.node_coordinates()[candidate.node as usize]);
        (0..3).map(|d| (a[d] - b[d]).powi(2)).sum()
    };
    let mut seen = BTreeSet::from([candidate.node]);
    loop {
        let touched = positions.clone().filter(|p| space.entity_nodes(*p).iter().any(|m| seen.contains(m)));
        let mut ring: Vec<u32> = touched.flat_map(|p| space.entity_nodes(p).iter().copied()).collect();
        ring.retain(|m| !seen.contains(m));
        ring.sort_unstable();
        ring.dedup();
        // of nodes that are as near but for rounding, the first by its coordinates, whatever its number is
        let far = ring.iter().fold(0.0f64, |far, node| far.max(distance(*node)));
        let steps = |node: u32| (distance(node) / far * 1e9).round();
        ring.sort_by(|a, b| {
            let by_place = || compare(&space.node_coordinates()[*a as usize], &space.node_coordinates()[*b as usize]);
            steps(*a).total_cmp(&steps(*b)).then_with(by_place)
        });
        if ring.is_empty() {
            return None;
        }
        let mut has_some = false;
        for node in &ring {
            let is_idle = by_node.get(&(candidate.field, *node)).is_some_and(|k| splits[*k].is_idle(direction));
            let first = start + *node as usize * n;
            if is_idle {
                continue;
            }
            let own_frame = axes.get(&candidate.first).cloned();
            if let (Some(frame), false) = (own_frame, axes.contains_key(&first)) {
                axes.insert(first, frame);
            }
            let found = dof_along(first, direction, axes.get(&first));
            if let Some(dof) = found.filter(|d| system.numbering.free[*d] != FIXED) {
                has_some = true;
                if can_lead(dof) {
                    return Some(dof);
                }
            }
        }
        if has_some {
            return None;
        }
        seen.extend(ring);
    }
}

/// The order of two points by their first coordinates that differ.
fn compare(a: &[f64; 3], b: &[f64; 3]) -> Ordering {
    a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

/// The entry of a small matrix.
fn entry(matrix: &Csr, numbers: &[u32], row: usize, column: usize) -> f64 {
    match (numbers[row], numbers[column]) {
        (FIXED, _) | (_, FIXED) => 0.0,
        (row, column) => matrix.get(row as usize, column as usize),
    }
}
