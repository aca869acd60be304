//! Fields at integration points that are updated when a step has converged.
//!
//! Within a step a state has the value of the last step; its update is an expression of that value and of the new
//! solution. A state has values at the points of one rule, so all terms that contain it share one rule: the largest
//! degree among them, or that of `quadrature` for one of them. Nothing is interpolated between points.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use wfl::{Code, Diagnostic, FieldKind as Declared, Span, ast::Place};
use wfl_compiler::{
    ValueLaw, compile_value,
    types::{InputSlot, PlaceSig, RateOrder},
};
use wfl_discrete::{
    assemble::Domain,
    field::{Field, FieldSpace},
    point_space::PointSpace,
    system::System,
    value::{Sampled, Value},
    window::Window,
};
use wfl_mesh::{
    mesh::{CellKind, Mesh, RegionSet, SupportSet},
    quadrature::{composite, vertex},
};

use super::{
    Builder, Parts, RuleChoice,
    covered::{Asked, Chosen},
    fields::{global_place, place_sig, support},
    mappings::{Through, fields_there},
    rule_choice::states_read,
    terms::{self, PlacedLaw, Rules},
};
use crate::NamedRegion;

/// The update of a state.
pub struct StateUpdate {
    /// The state.
    pub field: usize,
    value: Value,
    sampled: Sampled,
    /// By point its node, where the update reads through a mapping: points without an image have none.
    nodes: Option<Vec<u32>>,
}

impl StateUpdate {
    /// The expression at its points, in the order of the nodes of the state; `None` where it reads through a mapping, which
    /// leaves out points without an image.
    #[must_use]
    pub fn at_points(&self) -> Option<(&Value, &Sampled)> {
        self.nodes.is_none().then_some((&self.value, &self.sampled))
    }

    /// Whether its update reads second rates.
    pub(super) fn reads_second_rates(&self) -> bool {
        let is_second = |slot: &InputSlot| matches!(slot, InputSlot::History(RateOrder::Second, _));
        self.value.law.inputs.iter().any(is_second)
    }

    /// Its next values, in the order of its nodes, from the solution `u` at the end of a step. Points without an image
    /// under the mapping of the update keep theirs.
    pub fn next(&self, system: &System, window: Window, u: &[f64]) -> Vec<f64> {
        let value = self.value.at_step(system.with_present_rates(window));
        let state = system.values(u);
        let values = state.view();
        let Some(nodes) = &self.nodes else {
            let mut next = Vec::with_capacity(system.fields[self.field].n_dofs());
            // points come in the order in which the nodes were numbered
            value.for_each_point(&system.mesh, &self.sampled, values, |_, _, _, _, v| next.extend_from_slice(v));
            return next;
        };
        let (mut next, mut nodes) = (system.data()[self.field].clone(), nodes.iter());
        value.for_each_point(&system.mesh, &self.sampled, values, |_, _, _, _, v| {
            if let Some(node) = nodes.next() {
                next[*node as usize * v.len()..][..v.len()].copy_from_slice(v);
            }
        });
        next
    }
}

/// The fields that terms name, with those that the updates of states among them read.
pub(super) fn read_by(states: &[StateUpdate], named: Vec<usize>) -> BTreeSet<usize> {
    let field = |slot: &InputSlot| match slot {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => Some(b.field.index()),
        _ => None,
    };
    let mut read = BTreeSet::from_iter(named);
    // each pass finds states that the ones before are made of
    for _ in states {
        let found = states.iter().filter(|s| read.contains(&s.field)).flat_map(|s| &s.value.law.inputs);
        let found: Vec<usize> = found.filter_map(field).collect();
        read.extend(found);
    }
    read
}

/// A compiled update, before its points are known.
pub(super) struct StateLaw {
    pub(super) law: ValueLaw,
    field: usize,
    set: Option<RegionSet>,
    places: BTreeSet<String>,
    /// The mapping that the update reads through.
    through: Option<Through>,
    span: Span,
}

/// States and places that share one rule.
#[derive(Default)]
struct Shared {
    states: BTreeSet<usize>,
    places: BTreeSet<String>,
}

impl Builder<'_> {
    /// The updates of all states, compiled on the regions of their states.
    pub(super) fn state_laws(&mut self) -> Vec<StateLaw> {
        let script = self.script;
        let mut out = Vec::new();
        for (field, declared) in script.fields.iter().enumerate() {
            let Declared::State { update } = &declared.kind else { continue };
            let Some((sig, set)) = self.home(declared) else { continue };
            let law = compile_value(self.env, &sig, "the update of a state", update);
            self.diagnostics.extend(law.diagnostics);
            let Some(law) = law.value else { continue };
            let (found, needed) = (law.shape, self.sigs[field].shape);
            if found.len() != needed.len() {
                let d = Diagnostic::new(
                    Code::E108,
                    format!("`{}` is a {needed}, its update a {found}", declared.name.name),
                );
                self.diagnostics.push(wfl::at_expr(d, update, self.env.expansions, found.to_string()));
                continue;
            }
            let there = fields_there(&law.inputs, []);
            let through = law.mapping.map(|mapping| Through { mapping, there, pieces: None });
            let places = match &declared.space.place {
                Place::Everywhere => BTreeSet::from(["all".to_owned()]),
                Place::Global(_) => BTreeSet::new(),
                Place::On(list) => list.iter().map(|p| p.name.clone()).collect(),
            };
            out.push(StateLaw { law, field, set, places, through, span: update.span });
        }
        out
    }

    /// Where the update of a state is evaluated.
    fn home(&mut self, declared: &wfl::Field) -> Option<(PlaceSig, Option<RegionSet>)> {
        let names = match &declared.space.place {
            Place::Global(_) => return Some((global_place(self.fields.len()), None)),
            Place::Everywhere => vec!["all"],
            Place::On(list) => list.iter().map(|p| p.name.as_str()).collect(),
        };
        let set = support(&declared.space.place, &declared.name, &self.regions, self.diagnostics)?;
        let here_name = match names.as_slice() {
            [one] => self.regions.get(*one)?.here_name.clone(),
            _ => None,
        };
        let inside = names.iter().all(|name| self.regions.get(*name).is_some_and(|r| r.inside));
        let region = NamedRegion { set: set.clone(), edges: None, span: None, here_name, inside };
        Some((place_sig(&names.join(", "), &region, &self.mesh, &self.fields), Some(set)))
    }

    /// Gives all places that read a state one rule.
    pub(super) fn share_rules(&mut self, laws: &[PlacedLaw], states: &[StateLaw], rules: &mut Rules) {
        for shared in shared(&self.fields, laws, states) {
            let said: Vec<(&wfl::Quadrature, RuleChoice)> = self
                .script
                .quadratures
                .iter()
                .flat_map(|q| q.places.iter().map(move |p| (q, p)))
                .filter(|(_, p)| shared.places.contains(&p.name))
                .filter_map(|(q, p)| Some((q, *rules.get(&p.name)?)))
                .collect();
            if let Some((statement, _)) = said.iter().find(|(_, choice)| choice.pieces().is_some()) {
                let names: Vec<&str> = shared.states.iter().map(|k| self.fields[*k].name.as_str()).collect();
                let d = Diagnostic::new(
                    Code::E411,
                    format!(
                        "the state `{}` has values at points of a rule, and segments have others",
                        names.join("`, `")
                    ),
                );
                let d = d.at(statement.span, "cut where edges pass, which changes as the bodies slide");
                self.diagnostics.push(d.help("quadrature on the region degree n keeps its points"));
                continue;
            }
            if let Some(pair) = said.windows(2).find(|pair| pair[0].1 != pair[1].1) {
                let names: Vec<&str> = shared.states.iter().map(|k| self.fields[*k].name.as_str()).collect();
                let d =
                    Diagnostic::new(Code::E411, format!("two quadrature rules for the state `{}`", names.join("`, `")));
                let d = d.at(pair[1].0.span, "these terms contain it too");
                self.diagnostics.push(d.at(pair[0].0.span, "all terms with a state share one rule"));
                continue;
            }
            let largest =
                shared.places.iter().filter_map(|p| rules.get(p)).fold(None, |most, choice| match (most, choice) {
                    (None, choice) => Some(*choice),
                    (Some(RuleChoice::Degree(a)), RuleChoice::Degree(b)) => Some(RuleChoice::Degree(a.max(*b))),
                    (Some(RuleChoice::Degree(_)), nodes @ RuleChoice::Nodes { .. }) => Some(*nodes),
                    (most, _) => most,
                });
            let own = states.iter().filter(|s| shared.states.contains(&s.field)).map(|s| s.law.degree.rule()).max();
            // terms that read it have it at their own points
            let reads = |l: &PlacedLaw| states_read(&self.fields, &l.law.inputs).any(|k| shared.states.contains(&k));
            let mut own_states = states.iter().filter(|s| shared.states.contains(&s.field));
            let largest = match largest {
                None | Some(RuleChoice::Degree(_)) if !laws.iter().any(reads) => {
                    own_states.find_map(|s| self.rule_of_terms(s, rules)).or(largest)
                }
                other => other,
            };
            let choice = said.first().map(|s| s.1).or(largest).unwrap_or(RuleChoice::Degree(own.unwrap_or(1)));
            rules.extend(shared.places.into_iter().map(|p| (p, choice)));
        }
    }

    /// The rule that terms have on all entities of a state: where its update has kinks: at nodes, or one that a statement gives.
    fn rule_of_terms(&self, state: &StateLaw, rules: &Rules) -> Option<RuleChoice> {
        let (set, is_kinked) = (state.set.as_ref()?, state.law.degree.kinked);
        let statements = &self.script.quadratures;
        let asked = Asked { place: "", set, statements, is_kinked, mapping: state.law.mapping };
        match asked.by_rule(&self.mesh, &self.regions, rules).as_slice() {
            [(_, Chosen { rule: choice @ Some(RuleChoice::Nodes { .. }), .. })] => *choice,
            [(_, Chosen { rule: choice @ Some(_), is_given: true })] => *choice,
            _ => None,
        }
    }

    /// Puts every state on the points of its rule and binds its update there.
    pub(super) fn state_updates(&mut self, laws: Vec<StateLaw>, rules: &Rules) -> Vec<StateUpdate> {
        let mut placed = Vec::new();
        for state in laws {
            let choice = state.places.iter().find_map(|p| rules.get(p)).copied().unwrap_or(RuleChoice::Degree(1));
            let made =
                terms::domain(&self.mesh, &self.fields, state.set.as_ref(), choice, state.span, self.diagnostics);
            let Some(domain) = made else { continue };
            if let FieldSpace::Points(space) = &mut self.fields[state.field].space {
                *space = PointSpace::new(&self.mesh, &domain);
            }
            let Some(images) = self.images(&state, &domain) else { continue };
            placed.push((state, images));
        }
        let mut out = Vec::new();
        for (state, domain) in placed {
            let nodes = state.through.as_ref().map(|_| nodes_of(&self.mesh, &self.fields[state.field], &domain));
            let value = match Value::new(state.law, self.batch) {
                Ok(value) => value,
                Err(e) => {
                    self.diagnostics.push(Diagnostic::new(Code::E609, e.to_string()).at(state.span, ""));
                    continue;
                }
            };
            match value.bind(&self.mesh, domain, &self.fields) {
                Ok(sampled) => out.push(StateUpdate { field: state.field, value, sampled, nodes }),
                Err(e) => self.diagnostics.push(Diagnostic::new(Code::E202, e.to_string()).at(state.span, "")),
            }
        }
        out
    }

    /// The points of a state with their images, where its update reads through a mapping. Terms that read the same tell of
    /// points without one. `None` after a message.
    fn images(&mut self, state: &StateLaw, points: &Arc<Domain>) -> Option<Arc<Domain>> {
        let Some(through) = &state.through else { return Some(points.clone()) };
        let mut said = Vec::new();
        let made = self.mappings.domain(through, &self.mesh, &self.fields, points, state.span, &mut said);
        if made.is_none() {
            self.diagnostics.append(&mut said);
        }
        made
    }
}

/// By point of a domain the node of a state there.
fn nodes_of(mesh: &Mesh, state: &Field, domain: &Domain) -> Vec<u32> {
    let FieldSpace::Points(space) = &state.space else { return Vec::new() };
    let of = |group| space.tabulate(mesh.dim(), group).map(|(_, nodes)| nodes);
    domain.groups.iter().filter_map(of).flatten().collect()
}

/// The degree of the rule that means over an entity are taken with.
const MEAN_DEGREE: usize = 2;

/// Points inside the entities of a support, for what reads a field that has one value on each of them.
pub(super) fn points_of_entities(parts: Parts<'_>, law: &ValueLaw, support: &SupportSet) -> Option<Arc<Domain>> {
    let is_constant = |slot: &InputSlot| match slot {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => {
            let field = parts.fields.get(b.field.index());
            field.is_some_and(|f| f.degree() == 0 && matches!(f.space, FieldSpace::Nodal(_)))
        }
        _ => false,
    };
    if law.mapping.is_some() || !law.inputs.iter().any(is_constant) {
        return None;
    }
    let rule = |kind: CellKind| composite(kind, MEAN_DEGREE, 1).unwrap_or_else(|_| vertex(kind));
    Domain::new(parts.mesh, &support.region(), &rule).ok().map(Arc::new)
}

/// States and the places that read them, joined until no two have one in common.
fn shared(fields: &[Field], laws: &[PlacedLaw], states: &[StateLaw]) -> Vec<Shared> {
    let of_states = states.iter().map(|state| {
        let read = states_read(fields, &state.law.inputs).chain([state.field]);
        Shared { states: read.filter(|k| fields[*k].is_at_points()).collect(), places: state.places.clone() }
    });
    let of_laws = laws.iter().map(|law| Shared {
        states: states_read(fields, &law.law.inputs).collect(),
        places: BTreeSet::from([law.place.clone()]),
    });
    let all: Vec<Shared> = of_states.chain(of_laws).filter(|s| !s.states.is_empty()).collect();
    // by item: an earlier one that it has something in common with, or itself
    let mut root: Vec<usize> = (0..all.len()).collect();
    let (mut by_state, mut by_place) = (BTreeMap::new(), BTreeMap::new());
    for (k, item) in all.iter().enumerate() {
        let states = item.states.iter().map(|s| *by_state.entry(*s).or_insert(k));
        let places = item.places.iter().map(|p| *by_place.entry(p.as_str()).or_insert(k));
        for other in states.chain(places).collect::<Vec<_>>() {
            let (a, b) = (root_of(&mut root, other), root_of(&mut root, k));
            root[a.max(b)] = a.min(b);
        }
    }
    let mut groups: BTreeMap<usize, Shared> = BTreeMap::new();
    for (k, item) in all.iter().enumerate() {
        let group = groups.entry(root_of(&mut root, k)).or_default();
        group.states.extend(&item.states);
        group.places.extend(item.places.iter().cloned());
    }
    groups.into_values().collect()
}

/// The first item that is joined with `k`; shortens the way to it.
fn root_of(root: &mut [usize], mut k: usize) -> usize {
    while root[k] != k {
        root[k] = root[root[k]];
        k = root[k];
    }
    k
}
