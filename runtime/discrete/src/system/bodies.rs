//! What of the fields hangs together: bodies that nothing connects have forces of their own, and are judged by these.
//!
//! A body is what of a field hangs together: through its cells, through terms (contact, springs, a common single number) and
//! through dofs that follow others. Bodies of several fields whose forces meet on an interface share one measure. Two bodies in
//! one field are judged as if each had a field of its own: beside a load of 1e7 on one, a load of 1 on the other is none that
//! may be out of balance. Fields with single equations are one body: their equations are judged one by one.
//!
//! Promises: the bodies of a scene, whatever the number of ranks. Found once, when they are first asked for.

use std::{
    collections::BTreeMap,
    sync::{Arc, OnceLock},
};

use wfl_compiler::types::FieldKind;
use wfl_mesh::element::Family;

use super::{FIXED, System};
use crate::field::FieldSpace;
use crate::finite::largest;
use crate::share::NumbersOfWhole;
use crate::space::Support;

/// See the module documentation.
#[derive(Debug)]
pub(super) struct Bodies {
    /// By body: its field. The first body of each field has the number of the field.
    fields: Vec<usize>,
    /// By dof: its body. Empty where each field is one.
    of_dof: Vec<u32>,
    /// By body: its dofs. Empty where each field is one.
    dofs: Vec<Vec<u32>>,
    /// By body: the first of those that share its measure.
    meets: Vec<usize>,
    /// By body: which part of the equations it belongs to, parts that nothing connects; `None` where that may be several.
    parts: Vec<Option<u64>>,
}

/// Found when they are asked for; a copy of a system has those of the system.
pub(super) type Found = OnceLock<Arc<Bodies>>;

/// Dofs that hang together.
struct Joined {
    above: Vec<u32>,
}

impl Joined {
    fn new(n: usize) -> Self {
        Self { above: (0..u32::try_from(n).expect("fewer than 2^32 dofs")).collect() }
    }

    fn root(&mut self, mut at: u32) -> u32 {
        while self.above[at as usize] != at {
            // paths stay short
            let next = self.above[self.above[at as usize] as usize];
            self.above[at as usize] = next;
            at = next;
        }
        at
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.above[a.max(b) as usize] = a.min(b);
    }

    fn join_all(&mut self, dofs: impl IntoIterator<Item = u32>) {
        let mut dofs = dofs.into_iter();
        let Some(first) = dofs.next() else { return };
        dofs.for_each(|dof| self.join(first, dof));
    }
}

impl System {
    fn all_bodies(&self) -> &Bodies {
        self.bodies.get_or_init(|| Arc::new(self.find_bodies()))
    }

    fn find_bodies(&self) -> Bodies {
        let n = self.fields.len();
        let single = Bodies {
            fields: (0..n).collect(),
            of_dof: Vec::new(),
            dofs: Vec::new(),
            meets: self.meets.clone(),
            parts: vec![Some(0); n],
        };
        // single equations are judged one by one
        let splits = |k: &usize| !self.has_single_equations(*k) && self.range(*k).is_some();
        let split: Vec<usize> = (0..n).filter(splits).collect();
        let mut joined = Joined::new(self.numbering.n_dofs);
        self.join_nodes(&mut joined);
        if self.are_whole(&split, &mut joined) {
            return single;
        }
        self.join_equations(&mut joined);
        let labels = self.labels(&mut joined);
        let mut bodies = single;
        bodies.of_dof = vec![0; labels.len()];
        for k in 0..n {
            let Some(range) = self.range(k) else { continue };
            if !split.contains(&k) {
                bodies.of_dof[range].fill(k as u32);
                bodies.parts[k] = None;
                continue;
            }
            let own = self.labels_of_all(range.clone().map(|d| labels[d]));
            bodies.parts[k] = own.first().copied();
            let numbers: Vec<usize> =
                (0..own.len()).map(|i| if i == 0 { k } else { bodies.fields.len() + i - 1 }).collect();
            bodies.fields.extend(own.iter().skip(1).map(|_| k));
            bodies.parts.extend(own.iter().skip(1).copied().map(Some));
            for d in range {
                let number = own.binary_search(&labels[d]).expect("the labels of all ranks");
                bodies.of_dof[d] = numbers[number] as u32;
            }
        }
        if bodies.fields.len() == n {
            bodies.of_dof.clear();
            return bodies;
        }
        bodies.dofs = vec![Vec::new(); bodies.fields.len()];
        for dof in (0..n).filter_map(|k| self.range(k)).flatten() {
            bodies.dofs[bodies.of_dof[dof] as usize].push(dof as u32);
        }
        let mut firsts = BTreeMap::new();
        let measure = |b: usize| (self.meets[bodies.fields[b]], bodies.parts[b]);
        let meets = (0..bodies.fields.len()).map(|b| *firsts.entry(measure(b)).or_insert(b)).collect();
        Bodies { meets, ..bodies }
    }

    /// Whether each of some fields hangs together through its cells, on all ranks as one.
    fn are_whole(&self, fields: &[usize], joined: &mut Joined) -> bool {
        let ranges = fields.iter().filter_map(|k| self.range(*k));
        if self.share.is_none() {
            return ranges.into_iter().all(|mut range| {
                let first = range.next().map(|dof| joined.root(dof as u32));
                range.all(|dof| Some(joined.root(dof as u32)) == first)
            });
        }
        let labels = self.labels(joined);
        // the lowest label of a field on any rank, turned round, and the highest
        let ends = |range: std::ops::Range<usize>| {
            let own = &labels[range];
            [!own.iter().copied().min().unwrap_or(u64::MAX), own.iter().copied().max().unwrap_or(0)]
        };
        let mut ends: Vec<u64> = ranges.flat_map(ends).collect();
        self.team().max_words(&mut ends);
        ends.as_chunks().0.iter().all(|[low, high]| !low == *high)
    }

    /// Joins the components of each node, nodes of each cell, and cells of a discontinuous field that the mesh connects.
    fn join_nodes(&self, joined: &mut Joined) {
        for (field, start) in self.fields.iter().zip(&self.numbering.starts) {
            let (Some(start), n) = (*start, field.n_components) else { continue };
            let dof = |node: usize| u32::try_from(start + node * n).expect("fewer than 2^32 dofs");
            for node in 0..field.n_nodes() {
                (1..n as u32).for_each(|c| joined.join(dof(node), dof(node) + c));
            }
            let FieldSpace::Nodal(space) = &field.space else { continue };
            // cells that have no node in common are one body where the mesh is one
            let bodies = if space.family() == Family::Discontinuous { self.mesh.bodies() } else { Vec::new() };
            let mut firsts = BTreeMap::new();
            for position in 0..space.n_positions() {
                let mut nodes = space.entity_nodes(position).iter().map(|node| dof(*node as usize)).peekable();
                if let (Some(first), false) = (nodes.peek().copied(), bodies.is_empty()) {
                    let cell = match space.support() {
                        Support::Cells(cells) => cells[position],
                        Support::Facets(facets) => facets[position].cell,
                        Support::Edges(edges) => edges[position].face.cell,
                    };
                    let body = bodies[self.mesh.cell_vertices(cell)[0].index()];
                    joined.join(*firsts.entry(body).or_insert(first), first);
                }
                joined.join_all(nodes);
            }
        }
    }

    /// Joins what the equations of terms connect, and dofs that follow others.
    fn join_equations(&self, joined: &mut Joined) {
        for term in &self.terms {
            if term.integrator.moves() {
                // its images may go anywhere
                joined.join_all(term.dofs());
            } else {
                term.for_each_entity(|tests, trials| joined.join_all(tests.iter().chain(trials).copied()));
            }
        }
        for tie in self.numbering.ties() {
            joined.join(tie.leader as u32, tie.follower as u32);
        }
    }

    /// By dof the number of its part, the same on all ranks: the least number that one of its dofs has among those of all.
    fn labels(&self, joined: &mut Joined) -> Vec<u64> {
        let n = self.numbering.n_dofs;
        let roots: Vec<usize> = (0..n).map(|dof| joined.root(dof as u32) as usize).collect();
        let Some(share) = &self.share else { return roots.into_iter().map(|root| root as u64).collect() };
        // the largest of negative numbers: what owners and copies tell each other
        let mut labels: Vec<f64> = match self.mesh.holders().is_alone() {
            true => (0..n).map(|dof| -(dof as f64)).collect(),
            false => {
                let numbers = NumbersOfWhole::new(&self.fields, &self.numbering);
                (0..n).map(|dof| -(numbers.of(dof) as f64)).collect()
            }
        };
        loop {
            let before = labels.clone();
            let mut most = vec![f64::NEG_INFINITY; n];
            (0..n).for_each(|dof| most[roots[dof]] = most[roots[dof]].max(labels[dof]));
            (0..n).for_each(|dof| labels[dof] = most[roots[dof]]);
            share.halo().largest_at_owners(&**share.team(), &mut labels);
            share.update(&mut labels);
            if !share.team().any(labels != before) {
                return labels.into_iter().map(|label| -label as u64).collect();
            }
        }
    }

    /// Labels of this rank and the others, sorted, each once.
    fn labels_of_all(&self, own: impl Iterator<Item = u64>) -> Vec<u64> {
        let once = |mut labels: Vec<u64>| {
            labels.sort_unstable();
            labels.dedup();
            labels
        };
        let own = once(own.collect());
        let bytes: Vec<u8> = own.iter().flat_map(|label| label.to_le_bytes()).collect();
        let all = if self.team().is_alone() { bytes } else { self.team().gather(&bytes).concat() };
        once(all.as_chunks().0.iter().map(|label| u64::from_le_bytes(*label)).collect())
    }

    /// Number of bodies: the first body of each field has the number of the field.
    #[must_use]
    pub fn n_bodies(&self) -> usize {
        self.all_bodies().fields.len()
    }

    /// The field of a body.
    #[must_use]
    pub fn field_of_body(&self, body: usize) -> usize {
        self.all_bodies().fields[body]
    }

    /// The bodies of unknown fields, without those of multipliers.
    pub fn unknown_bodies(&self) -> impl Iterator<Item = usize> + '_ {
        let is_unknown = |field: usize| self.fields[field].kind == FieldKind::Unknown && self.range(field).is_some();
        (0..self.n_bodies()).filter(move |body| is_unknown(self.field_of_body(*body)))
    }

    /// The body of a dof.
    #[must_use]
    pub fn body_of(&self, dof: usize) -> usize {
        match self.all_bodies().of_dof.get(dof) {
            Some(body) => *body as usize,
            None => self.field_of(dof),
        }
    }

    /// The first of the bodies that share the measure of `body`: their forces meet.
    #[must_use]
    pub fn body_alike(&self, body: usize) -> usize {
        self.all_bodies().meets[body]
    }

    /// By body the largest of numbers by body, which are not negative, among those that count and that equations may connect
    /// with it.
    #[must_use]
    pub fn largest_beside(&self, numbers: &[f64], counts: impl Fn(usize) -> bool) -> Vec<f64> {
        let parts = &self.all_bodies().parts;
        let (mut of_part, mut of_several, mut of_all) = (BTreeMap::<u64, f64>::new(), 0.0f64, 0.0f64);
        for (body, part) in parts.iter().enumerate().filter(|(body, _)| counts(*body)) {
            let most = part.map_or(&mut of_several, |part| of_part.entry(part).or_insert(0.0));
            *most = largest([*most, numbers[body]]);
            of_all = largest([of_all, numbers[body]]);
        }
        let beside = |part: &Option<u64>| match part {
            Some(part) => largest([of_several, of_part.get(part).copied().unwrap_or(0.0)]),
            None => of_all,
        };
        parts.iter().map(beside).collect()
    }

    /// The dofs of a body.
    pub fn dofs_of_body(&self, body: usize) -> impl Iterator<Item = usize> + '_ {
        let all = self.all_bodies();
        let (listed, range) = match all.dofs.get(body) {
            Some(listed) => (listed.as_slice(), 0..0),
            None => (&[][..], self.range(all.fields[body]).unwrap_or_default()),
        };
        listed.iter().map(|dof| *dof as usize).chain(range)
    }

    /// By body the largest of numbers by dof that this rank has; zero for fields that are not solved for.
    #[must_use]
    pub fn largest_by_body(&self, numbers: &[f64]) -> Vec<f64> {
        self.largest_where(numbers, |_| true)
    }

    /// The same of the free dofs alone.
    #[must_use]
    pub fn largest_of_free_by_body(&self, numbers: &[f64]) -> Vec<f64> {
        self.largest_where(numbers, |dof| self.numbering.free[dof] != FIXED)
    }

    fn largest_where(&self, numbers: &[f64], counts: impl Fn(usize) -> bool) -> Vec<f64> {
        let all = self.all_bodies();
        let mut out = vec![0.0f64; all.fields.len()];
        for (k, range) in (0..self.fields.len()).filter_map(|k| Some((k, self.range(k)?))) {
            if all.of_dof.is_empty() {
                out[k] = largest(range.filter(|d| counts(*d)).map(|d| numbers[d]));
            } else {
                range.filter(|d| counts(*d)).for_each(|d| {
                    let most = &mut out[all.of_dof[d] as usize];
                    *most = largest([*most, numbers[d]]);
                });
            }
        }
        out
    }

    /// The first of the bodies that share a measure with a body: those that it meets.
    #[must_use]
    pub fn first_alike(&self, body: usize) -> usize {
        self.all_bodies().meets[body]
    }

    /// By body the largest of numbers by dof among all bodies that share its measure, on any rank.
    #[must_use]
    pub fn largest_of_alike(&self, numbers: &[f64]) -> Vec<f64> {
        let mut own = self.largest_by_body(numbers);
        self.team().max(&mut own);
        self.among_alike(&own)
    }

    /// By body the largest of numbers by body among all that share its measure.
    pub(super) fn among_alike(&self, own: &[f64]) -> Vec<f64> {
        let meets = &self.all_bodies().meets;
        let mut groups = vec![0.0f64; own.len()];
        for (size, group) in own.iter().zip(meets) {
            groups[*group] = largest([groups[*group], *size]);
        }
        meets.iter().take(own.len()).map(|group| groups[*group]).collect()
    }
}
