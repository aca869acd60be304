//! Messages about statements without effect.
//!
//! Each check looks at the prepared problem, not at the text: which dofs a `load` reaches and which of them are free,
//! which of two prescribed values a node has, which quadrature rules have a law. Names that occur in the text only are
//! checked where names are resolved (W702). There is no message if a statement has an effect in some place: a load on a
//! face of which an edge is fixed, a rule of several regions one of which has terms.

use std::collections::BTreeSet;

use wfl::{
    Code, Diagnostic, FieldKind as Declared, StartKind,
    ast::{Ident, Place, Reduction},
    split_prefixes,
};
use wfl_compiler::types::{BasisSlot, FieldOp, Side};
use wfl_discrete::{
    field::{Field, FieldSpace},
    space::Support,
    system::{FIXED, Numbering},
    window::Window,
};
use wfl_mesh::{
    element::Family,
    mesh::{FacetRef, NodeId, RegionSet},
};

use super::{
    Builder,
    constraints::{Contradiction, Prescribed},
    covered::share,
    jumps,
    normals::{faces_of, held_faces, node_normals},
    options::Steps,
    terms::PlacedLaw,
};

/// Steps at which prescribed values are compared, the first and the last among them.
const COMPARED_STEPS: usize = 16;

/// What a step of a scene reads.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Reads {
    /// The step alone.
    Present,
    /// Also the one before.
    Past,
}

impl Builder<'_> {
    /// Everything that is known once dofs are numbered and fixed: loads on what is fixed, rules without terms, tears of
    /// nothing, terms that are zero.
    pub(super) fn effects(&mut self, laws: &[PlacedLaw], prescribed: &Prescribed, numbering: &Numbering) {
        self.loads_on_fixed(laws, prescribed, numbering);
        self.terms_on_fixed(laws, prescribed, numbering);
        self.idle_rules(laws);
        self.idle_splits();
        self.zero_terms(laws);
        self.jumps_of_one_value(laws);
        self.twice(laws);
        self.free_between_fixed();
    }

    /// W416 for a `fix` on nodes of the mesh where the field has nodes between them, which stay free.
    fn free_between_fixed(&mut self) {
        let script = self.script;
        for fix in &script.fixes {
            for (target, place) in fix.targets.iter().flat_map(|t| fix.places.iter().map(move |p| (t, p))) {
                let field = self.fields.iter().find(|f| f.name == target.field.name);
                // a rim has the nodes between the ends of its edges
                let set = self.regions.get(&place.name).filter(|r| r.edges.is_none()).map(|r| &r.set);
                let (Some(field), Some(RegionSet::Nodes(nodes))) = (field, set) else { continue };
                let n = self.nodes_between(field, nodes);
                if n > 0 {
                    let d = Diagnostic::new(
                        Code::W416,
                        format!("`fix {}` leaves {n} nodes free between those it holds", field.name),
                    );
                    let text = format!("nodes of the mesh; `{}` has degree {}", field.name, field.degree());
                    let help = "a region of faces has all nodes on them: region side = faces where ...";
                    self.diagnostics.push(d.at(place.span, text).help(help));
                }
            }
        }
    }

    /// How many nodes a field has inside faces all of whose corners are among these nodes.
    fn nodes_between(&self, field: &Field, nodes: &[NodeId]) -> usize {
        let FieldSpace::Nodal(space) = &field.space else { return 0 };
        let Support::Cells(cells) = space.support() else { return 0 };
        if space.degree() < 2 || space.family() == Family::Discontinuous {
            return 0;
        }
        let mut listed = vec![false; self.mesh.n_nodes()];
        nodes.iter().for_each(|n| listed[n.index()] = true);
        let mut facets: Vec<FacetRef> = Vec::new();
        for cell in cells {
            for local in 0..self.topology.cell_facets(*cell).len() {
                let Ok(local) = u8::try_from(local) else { continue };
                let facet = FacetRef { cell: *cell, local };
                if self.mesh.facet_vertices(facet).vertices().iter().all(|v| listed[v.index()]) {
                    facets.push(facet);
                }
            }
        }
        let held: BTreeSet<u32> = space.nodes_at_mesh_nodes(&self.mesh, nodes).into_iter().collect();
        let all = space.nodes_on_facets(&self.mesh, &self.topology, &facets);
        all.iter().filter(|n| !held.contains(n)).count()
    }

    fn loads_on_fixed(&mut self, laws: &[PlacedLaw], prescribed: &Prescribed, numbering: &Numbering) {
        if prescribed.is_empty() {
            return;
        }
        let fixed = prescribed.components();
        for law in laws {
            let (Some(load), Some(set)) = (&law.load, &law.set) else { continue };
            let field = &self.fields[load.field];
            let Some(start) = numbering.starts[load.field] else { continue };
            let nodes = self.loaded_nodes(field, set);
            let first = |node: &u32| start + *node as usize * field.n_components;
            let tests = law.law.tests.iter().filter(|s| s.field.index() == load.field && s.op == FieldOp::Value);
            let pulled: BTreeSet<usize> = tests.map(|s| usize::from(s.entry)).collect();
            let held = |c: &usize| nodes.iter().all(|n| fixed.contains(&(first(n) + c)));
            let lost: Vec<usize> = pulled.iter().copied().filter(held).collect();
            let (what, dof) = if let Some(c) = lost.first().filter(|_| !nodes.is_empty()) {
                let names: Vec<String> = lost.iter().map(|c| component_name(field, *c)).collect();
                (names.join(", "), first(&nodes[0]) + c)
            } else if load.normal && self.normals_held(field, set, prescribed, start) {
                (format!("`{}.Normal`", field.name), first(&nodes[0]))
            } else {
                continue;
            };
            let d = Diagnostic::new(
                Code::W412,
                format!("a load on {what}, which is fixed on the whole of `{}`", law.place),
            );
            let d = d.at(load.span, "the support takes this force; no unknown changes");
            let by = prescribed.held_by(dof);
            self.diagnostics.push(by.into_iter().fold(d, |d, fix| d.at(fix, "fixed here")));
        }
    }

    /// W412 for terms on faces that are tested with nothing but what is prescribed there.
    fn terms_on_fixed(&mut self, laws: &[PlacedLaw], prescribed: &Prescribed, numbering: &Numbering) {
        if prescribed.is_empty() {
            return;
        }
        let fixed = prescribed.components();
        for law in laws.iter().filter(|law| law.load.is_none() && !law.law.tests.is_empty()) {
            let Some(set @ RegionSet::Facets(_)) = &law.set else { continue };
            let is_held = |slot: &BasisSlot| {
                let (number, field) = (slot.field.index(), &self.fields[slot.field.index()]);
                let (Some(start), Side::Here, FieldOp::Value) = (numbering.starts[number], slot.side, slot.op) else {
                    return false;
                };
                let nodes = self.loaded_nodes(field, set);
                let dof = |node: &u32| start + *node as usize * field.n_components + usize::from(slot.entry);
                !nodes.is_empty() && nodes.iter().all(|node| fixed.contains(&dof(node)))
            };
            if law.law.tests.iter().all(is_held) {
                let text = format!("all that this term is tested with is fixed on the whole of `{}`", law.place);
                let d = Diagnostic::new(Code::W412, text);
                self.diagnostics.push(d.at(law.span, "the support takes this force; no unknown changes"));
            }
        }
    }

    /// The nodes whose functions are not zero on the part of a region where a field is loaded.
    fn loaded_nodes(&self, field: &Field, set: &RegionSet) -> Vec<u32> {
        let here: RegionSet = match set {
            RegionSet::Interface(pairs) => RegionSet::Facets(pairs.iter().map(|p| p.here).collect()),
            other => other.clone(),
        };
        field.nodes_in(&self.mesh, &self.topology, &here)
    }

    /// True if all nodes on the faces of a load along the normal are fixed along their normals.
    fn normals_held(&self, field: &Field, set: &RegionSet, prescribed: &Prescribed, start: usize) -> bool {
        let (Some(facets), FieldSpace::Nodal(space)) = (faces_of(set), &field.space) else { return false };
        let beside = held_faces(self.script, &self.regions, &field.name);
        let normals = node_normals(&self.mesh, &self.topology, space, &facets, &beside);
        let first = |node: &u32| start + *node as usize * field.n_components;
        !normals.is_empty() && normals.iter().all(|(n, list)| list.iter().all(|x| prescribed.holds(first(n), x)))
    }

    /// W411 for a rule of integration on a region where nothing is integrated; E434 for two rules on one region.
    fn idle_rules(&mut self, laws: &[PlacedLaw]) {
        let script = self.script;
        let mut used: BTreeSet<&str> = laws.iter().filter(|l| l.at_nodes.is_none()).map(|l| l.place.as_str()).collect();
        for field in script.fields.iter().filter(|f| matches!(f.kind, Declared::State { .. })) {
            match &field.space.place {
                Place::On(list) => used.extend(list.iter().map(|p| p.name.as_str())),
                _ => {
                    used.insert("all");
                }
            }
        }
        let measured: BTreeSet<&str> = script.reductions().flat_map(|m| &m.places).map(|p| p.name.as_str()).collect();
        let own = script.mesh.as_ref().map(|m| m.span);
        let mut seen: Vec<&Ident> = Vec::new();
        // rules that a knob of the command line sets have the place of the mesh
        for statement in script.quadratures.iter().filter(|q| Some(q.span) != own) {
            for place in &statement.places {
                if let Some(first) = seen.iter().find(|p| p.name == place.name) {
                    let d = Diagnostic::new(Code::E434, format!("two quadrature rules on `{}`", place.name));
                    self.diagnostics.push(d.at(place.span, "").at(first.span, "the first one"));
                }
                seen.push(place);
            }
            if statement.places.iter().any(|p| used.contains(p.name.as_str())) {
                continue;
            }
            if statement.places.iter().any(|p| measured.contains(p.name.as_str())) {
                // a mean or what is largest is looked for where one wants; a force is a sum
                let is_sum = |m: &wfl::Measure| m.reduction == Reduction::Integral;
                let is_here =
                    |m: &wfl::Measure| m.places.iter().any(|p| statement.places.iter().any(|q| q.name == p.name));
                if script.reductions().any(|m| is_sum(m) && is_here(m)) {
                    self.measured_alone(statement, laws);
                }
            } else {
                let names: Vec<String> = used.union(&measured).map(|n| format!("`{n}`")).collect();
                let d = Diagnostic::new(Code::W411, "a quadrature rule where nothing is integrated");
                let d = d.at(statement.span, "no term, load, measure or state stands on this region by that name");
                self.diagnostics.push(d.help(format!("they stand on {}", names.join(", "))));
            }
        }
    }

    /// W411 for a rule on a region that measures alone name, where terms have other names for its entities: what is measured
    /// there are not the points of these terms.
    fn measured_alone(&mut self, statement: &wfl::Quadrature, laws: &[PlacedLaw]) {
        let sets: Vec<&RegionSet> =
            statement.places.iter().filter_map(|p| self.regions.get(&p.name)).map(|region| &region.set).collect();
        let is_there = |law: &&PlacedLaw| {
            let set = law.set.as_ref().filter(|_| law.at_nodes.is_none());
            set.is_some_and(|set| sets.iter().any(|other| share(&self.mesh, set, other)))
        };
        let names: BTreeSet<String> = laws.iter().filter(is_there).map(|law| format!("`{}`", law.place)).collect();
        if names.is_empty() {
            return;
        }
        let d = Diagnostic::new(Code::W411, "a quadrature rule that no term has");
        let d = d.at(statement.span, "measures alone stand on this region by that name");
        let names: Vec<String> = names.into_iter().collect();
        self.diagnostics.push(d.help(format!(
            "terms stand there on {}, with rules of their own: `quadrature on` these names",
            names.join(", ")
        )));
    }

    /// W411 for a `split` after which every node is one as before.
    fn idle_splits(&mut self) {
        for split in &self.script.splits {
            for name in &split.fields {
                let field = self.fields.iter().find(|f| f.name == name.name);
                let Some(FieldSpace::Nodal(space)) = field.map(|f| &f.space) else { continue };
                if !space.torn().is_empty() && !space.is_split() {
                    let d = Diagnostic::new(Code::W411, format!("`split` separates no node of `{}`", name.name));
                    let d = d.at(split.span, "all nodes of these faces are ends of the crack, which stay joined");
                    self.diagnostics.push(d.help("more faces, or an element of degree 2, have nodes between the ends"));
                }
            }
        }
    }

    /// W411 for a term that is zero for every state although no parameter in it is.
    fn zero_terms(&mut self, laws: &[PlacedLaw]) {
        for term in &self.script.terms {
            let own: Vec<&PlacedLaw> = laws.iter().filter(|l| l.load.is_none() && l.span == term.span).collect();
            if own.is_empty() || own.iter().any(|l| !l.law.tests.is_empty()) {
                continue;
            }
            let mut switched_off = false;
            wfl::each_name(&term.expr, &mut |name| {
                switched_off |= self.params.get(name).is_some_and(|p| p.values.contains(&0.0));
            });
            if !switched_off {
                let d = Diagnostic::new(Code::W411, "a term that is zero for all unknowns");
                self.diagnostics.push(d.at(term.span, "its parts cancel, or have the factor 0"));
            }
        }
    }

    /// W417 for jumps in terms of fields that have one value on both sides.
    fn jumps_of_one_value(&mut self, laws: &[PlacedLaw]) {
        let (parts, diagnostics) = self.parts();
        for law in laws {
            if let Some(set) = &law.set {
                jumps::check(parts, &law.place, set, &law.law.listing.value_jumps(), diagnostics);
            }
        }
    }

    /// Dofs of fields that are prescribed somewhere and stand in no term: with what is prescribed they stay what
    /// `start` says. W414 where that is all that determines them.
    pub(super) fn undetermined(
        &mut self,
        used: &BTreeSet<usize>,
        numbering: &Numbering,
        fixed: &BTreeSet<usize>,
    ) -> Vec<usize> {
        let mut all = Vec::new();
        for k in 0..self.fields.len() {
            let Some(start) = numbering.starts[k].filter(|_| !used.contains(&k)) else { continue };
            let n = self.fields[k].n_dofs();
            let own: Vec<usize> = (start..start + n).filter(|d| !fixed.contains(d)).collect();
            if !own.is_empty() {
                let count = format!("{} of its {n} values are", own.len());
                self.not_in_terms(k, &format!("{count} what `start` says, or 0"));
            }
            all.extend(own);
        }
        all
    }

    /// W414 for fields without dofs that a measure or an output reads.
    pub(super) fn read_but_in_no_term(&mut self, numbering: &Numbering) {
        let script = self.script;
        let mut read: BTreeSet<&str> = BTreeSet::new();
        let measured = script.reductions().map(|m| &m.expr);
        for e in measured.chain(script.outputs.iter().flat_map(|o| &o.items).map(|i| &i.expr)) {
            wfl::each_name(e, &mut |name| {
                read.insert(split_prefixes(name).1);
            });
        }
        for (k, declared) in script.fields.iter().enumerate() {
            let solved = matches!(declared.kind, Declared::Unknown | Declared::Multiplier { .. });
            if solved && numbering.starts[k].is_none() && read.contains(declared.name.name.as_str()) {
                self.not_in_terms(k, "all its values are what `start` says, or 0");
            }
        }
    }

    fn not_in_terms(&mut self, field: usize, values: &str) {
        let script = self.script;
        // a term with an error is no term that is zero
        if !script.lost.is_empty() || self.diagnostics.iter().any(Diagnostic::is_error) {
            return;
        }
        let name = &script.fields[field].name;
        let d = Diagnostic::new(Code::W414, format!("no term determines `{}`", name.name)).at(name.span, values);
        let names_it = |t: &&wfl::Term| {
            let mut found = false;
            wfl::each_name(&t.expr, &mut |n| found |= split_prefixes(n).1 == name.name);
            found
        };
        let d = match script.terms.iter().find(names_it) {
            Some(term) => d.at(term.span, "zero with these parameters"),
            None => d,
        };
        self.diagnostics.push(d);
    }

    /// W411 for first guesses of fields whose every value is prescribed; E434 for two of one field.
    pub(super) fn idle_starts(&mut self, numbering: &Numbering, prescribed: &Prescribed, reads: Reads) {
        let script = self.script;
        let mut seen: Vec<&Ident> = Vec::new();
        for statement in &script.starts {
            let StartKind::Field { field: name, .. } = &statement.kind else { continue };
            if let Some(first) = seen.iter().find(|f| f.name == name.name) {
                let d = Diagnostic::new(Code::E434, format!("two initial guesses of `{}`", name.name));
                self.diagnostics.push(d.at(name.span, "").at(first.span, "the first one"));
            }
            seen.push(name);
            let k = self.fields.iter().position(|f| f.name == name.name);
            let Some((k, start)) = k.and_then(|k| Some((k, numbering.starts[k]?))) else { continue };
            let own = start..start + self.fields[k].n_dofs();
            if reads == Reads::Present && own.clone().all(|d| numbering.free[d] == FIXED) {
                let d = Diagnostic::new(Code::W411, format!("`start {}` has no effect", name.name));
                let d = d.at(statement.span, "every value of the field is prescribed");
                let by = own.clone().find_map(|dof| prescribed.held_by(dof));
                self.diagnostics.push(by.into_iter().fold(d, |d, fix| d.at(fix, "by this statement")));
            }
        }
    }

    /// W411 where every value of every unknown is prescribed, so that no term of the scene is used; no message where a
    /// statement has a message already, since that is the same cause.
    pub(super) fn nothing_to_solve(&mut self, numbering: &Numbering, prescribed: &Prescribed) {
        let is_told = self.diagnostics.iter().any(|d| matches!(d.code, Code::W411 | Code::W412));
        if numbering.n_dofs > 0 && numbering.n_free() == 0 && !is_told {
            let d = Diagnostic::new(Code::W411, "no equation is left: every value of the unknowns is prescribed");
            let by = (0..numbering.n_dofs).find_map(|dof| prescribed.held_by(dof));
            self.diagnostics.push(by.into_iter().fold(d, |d, fix| d.at(fix, "by this statement, among others")));
        }
    }

    /// W411 for steps whose variable nothing reads.
    pub(super) fn idle_steps(&mut self, steps: &Steps, reads: Reads) {
        let script = self.script;
        let Some(statement) = &script.steps else { return };
        let remembers = script.fields.iter().any(|f| matches!(f.kind, Declared::State { .. }));
        if steps.values.len() < 2 || reads == Reads::Past || remembers {
            return;
        }
        let mut reads = false;
        let variable = statement.variable.name.as_str();
        let mut look = |e: &wfl::ast::Expr| wfl::each_name(e, &mut |n| reads |= n == variable || n == "timestep");
        script.terms.iter().for_each(|t| look(&t.expr));
        script.fixes.iter().chain(&script.loads).for_each(|c| look(&c.value));
        script.reductions().for_each(|m| look(&m.expr));
        script.computed.iter().for_each(|c| look(&c.expr));
        script.outputs.iter().flat_map(|o| &o.items).for_each(|i| look(&i.expr));
        for field in &script.fields {
            if let Declared::Data { value: wfl::DataValue::Formula(e) } = &field.kind {
                look(e);
            }
        }
        // a caller may give other values at each step
        let given = |f: &wfl::Field| matches!(f.kind, Declared::Data { value: wfl::DataValue::Caller });
        if !reads && !script.fields.iter().any(given) {
            let n = steps.values.len();
            let d = Diagnostic::new(Code::W411, format!("{n} steps solve the same problem"));
            let text = format!("nothing in the scene reads `{variable}`");
            self.diagnostics.push(d.at(statement.variable.span, text));
        }
    }

    /// Two values for one displacement: E432 where one statement is lost, W413 where regions overlap. Kernels must be
    /// callable.
    pub(super) fn contradictions(&mut self, prescribed: &mut Prescribed, steps: &Steps, n_dofs: usize) {
        for found in prescribed.contradictions(&sampled(steps), n_dofs) {
            let d = self.contradiction(&found);
            self.diagnostics.push(d);
        }
    }

    fn contradiction(&self, found: &Contradiction) -> Diagnostic {
        let Contradiction { field, component, earlier, later, .. } = found;
        let what = component.map_or_else(
            || format!("`{field}.Normal`"),
            |c| self.fields.iter().find(|f| f.name == *field).map_or_else(String::new, |f| component_name(f, c)),
        );
        let at = format!("{:?}", &found.position[..self.mesh.dim()]);
        let time =
            self.script.steps.as_ref().map_or_else(String::new, |s| format!(", {} = {}", s.variable.name, found.time));
        let (code, text) = if found.lost {
            (Code::E432, format!("two values for {what}: a later `fix` replaces an earlier one"))
        } else {
            let nodes = if found.n_nodes == 1 { "1 node".to_owned() } else { format!("{} nodes", found.n_nodes) };
            (Code::W413, format!("two values for {what} at {nodes}: the later statement holds"))
        };
        let d = Diagnostic::new(code, text).at(*later, format!("{} at {at}{time}", short(found.holds)));
        let d = d.at(*earlier, format!("{} there", short(found.instead)));
        d.help("a region without the nodes of the other: region rest = faces where ... and not (...)")
    }
}

/// The steps at which prescribed values are compared.
fn sampled(steps: &Steps) -> Vec<Window> {
    if let Some(auto) = &steps.auto {
        #[expect(clippy::cast_precision_loss, reason = "a few values")]
        let at = |k: usize| k as f64 / (COMPARED_STEPS - 1) as f64;
        let time = |k: usize| (1.0 - at(k)) * steps.first() + at(k) * steps.last();
        return (0..COMPARED_STEPS).map(|k| Window::new(time(k), auto.first)).collect();
    }
    let values = &steps.values;
    let last = values.len().saturating_sub(1);
    let mut picked: Vec<usize> = (0..COMPARED_STEPS).map(|k| k * last / (COMPARED_STEPS - 1)).collect();
    picked.dedup();
    picked
        .into_iter()
        .filter(|k| *k < values.len())
        .map(|k| Window::new(values[k], steps.increment(k.max(1))))
        .collect()
}

/// "`u(2)`", or "`p`" of a field of one component.
fn component_name(field: &Field, component: usize) -> String {
    if field.n_components == 1 { format!("`{}`", field.name) } else { format!("`{}({})`", field.name, component + 1) }
}

/// Six digits of a number.
fn short(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}
