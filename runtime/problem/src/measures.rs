//! Measures: numbers at each step, by reducing an expression over a region, its nodes, or taking it at one point.
//!
//! Promises: on a region the points are those of its terms, so that measured forces are those that act and states are met;
//! a value at a point is that of the first body, in the order of the fields, that has the expression and the point.

use std::sync::Arc;

use wfl::{
    Code, Diagnostic,
    ast::{Expr, MeasureAt, Place, Reduction},
    at_expr, each_name, split_prefixes,
};
use wfl_compiler::{ValueLaw, compile_value, types::InputSlot};
use wfl_discrete::{
    assemble::Domain,
    field::Field,
    finite::BadMeasure,
    system::System,
    value::{Sampled, Value},
};
use wfl_mesh::{
    element::{Element, Family},
    mesh::{CellKind, RegionSet},
    quadrature::{Rule, composite, vertex},
};
use wfl_output::Located;

use super::{
    Builder, Measure, Measured, RuleChoice, Taken, Turnover,
    constants::numbers,
    covered::{Asked, Chosen},
    jumps, mappings,
    outputs::OutputMaker,
    reactions::Held,
    rule_choice::states_read,
    sampling::parts,
    terms::{self, PointsOf},
    weights::{self, Weights},
};

/// An extreme value at nodes is looked for in so many parts of a cell along each direction, too, where its error is
/// estimated: between nodes a parabola is larger by at most 1/(2 n)^2 of its height.
const PARTS_BESIDE_NODES: usize = 8;

/// What measures are made from.
#[derive(Clone, Copy)]
pub(super) struct From<'a> {
    pub(super) rules: &'a terms::Rules,
    pub(super) held: Held<'a>,
    /// Each is taken at many steps.
    pub(super) often: bool,
}

impl Builder<'_> {
    /// The parts of a place with the rule of the terms on each, so that measured forces are those that act and states are
    /// met; a higher one for the integral of a polynomial that this rule does not integrate exactly, and of what no field has
    /// a part in, such as the length of a curve: it does not depend on which terms stand there.
    fn rules_of_measure(
        &self,
        measure: &wfl::Measure,
        law: &ValueLaw,
        place: &str,
        set: Option<RegionSet>,
        rules: &terms::Rules,
    ) -> Vec<(Option<RegionSet>, RuleChoice)> {
        let own = law.degree.rule();
        let summed = matches!(measure.reduction, Reduction::Integral | Reduction::Mean);
        let is_geometry = !law.inputs.iter().any(reads_field);
        let known = law.degree.is_exact() || is_geometry;
        let is_free = summed && known && states_read(&self.fields, &law.inputs).next().is_none();
        // on a part of the region of a state its points are those of the state
        let of_state = |state: usize| match &self.script.fields.get(state)?.space.place {
            Place::On(list) => list.iter().find_map(|p| rules.get(&p.name)),
            _ => rules.get("all"),
        };
        let of_state = states_read(&self.fields, &law.inputs).find_map(of_state);
        let choose = |of: Chosen| match of.rule.map(|choice| choice.through(law.mapping)) {
            Some(RuleChoice::Degree(degree)) if is_free && !of.is_given => RuleChoice::Degree(degree.max(own)),
            Some(RuleChoice::Nodes { .. }) if is_free => RuleChoice::Degree(own),
            Some(choice) => choice,
            None => RuleChoice::Degree(own),
        };
        match set {
            Some(set) if of_state.is_none() => {
                let (statements, mapping) = (&self.script.quadratures, law.mapping);
                let asked = Asked { place, set: &set, statements, is_kinked: law.degree.kinked, mapping };
                let parts = asked.by_rule(&self.mesh, &self.regions, rules);
                parts.into_iter().map(|(set, chosen)| (Some(set), choose(chosen))).collect()
            }
            set => {
                let rule = of_state.or_else(|| rules.get(place)).copied();
                vec![(set, choose(Chosen { rule, is_given: false }))]
            }
        }
    }

    /// Parts of an entity along each direction that have the rule of a measure.
    fn parts_of_measure(
        &self,
        measure: &wfl::Measure,
        set: Option<&RegionSet>,
        law: &ValueLaw,
        rule: RuleChoice,
    ) -> usize {
        let exact = matches!(measure.reduction, Reduction::Integral | Reduction::Mean) && law.degree.is_exact();
        let (Some(set), RuleChoice::Degree(degree)) = (set, rule) else { return 1 };
        // states have values at the points of their rule alone
        let fixed = law.mapping.is_some() || states_read(&self.fields, &law.inputs).next().is_some();
        if exact || fixed || !self.sampling.is_of(&measure.name.name) {
            return 1;
        }
        let dim = match set {
            RegionSet::Cells(_) => self.mesh.dim(),
            RegionSet::Edges(_) => self.mesh.dim().saturating_sub(2),
            _ => self.mesh.dim() - 1,
        };
        parts(dim, set.len(), (degree / 2 + 1).pow(u32::try_from(dim).unwrap_or(3)))
    }

    pub(super) fn measures(&mut self, list: &[wfl::Measure], from: From<'_>) -> Vec<Measure> {
        let mut out = Vec::new();
        for measure in list {
            let taken = match measure.reduction {
                Reduction::Reaction => match self.reaction(measure, from.held) {
                    Some(reaction) => Taken::Reaction(reaction),
                    None => continue,
                },
                Reduction::Balance(part) => match self.balanced(measure, part, from.held) {
                    Some(balanced) => Taken::Balance(balanced),
                    None => continue,
                },
                reduction => Taken::Points(reduction, self.at_points(measure, from.rules)),
            };
            let weights =
                if from.often { self.linear_weights(measure, &taken, &from.held.numbering.starts) } else { None };
            let (name, span) = (measure.name.name.clone(), measure.expr.span);
            out.push(Measure { name, taken, weights, names_change: names_change(&measure.expr), span });
        }
        out
    }

    /// What makes a product with a vector of an integral over one region that is linear in the unknowns.
    fn linear_weights(&mut self, measure: &wfl::Measure, taken: &Taken, starts: &[Option<usize>]) -> Option<Weights> {
        let Taken::Points(Reduction::Integral | Reduction::Mean, parts) = taken else { return None };
        let ([(value, sampled)], [place]) = (parts.as_slice(), measure.places.as_slice()) else { return None };
        if sampled.moves() || value.law.mapping.is_some() || !weights::is_linear(&value.law, &self.fields) {
            return None;
        }
        let (sig, _) = self.term_maker().place(place)?;
        let laws = weights::laws(self.env, &sig, &measure.name.name, &measure.expr);
        let of = (&self.mesh, &self.fields[..], starts);
        match Weights::new(laws, &sampled.domain, of, self.batch) {
            Ok(made) => made,
            Err(e) => {
                self.diagnostics.push(Diagnostic::new(Code::E609, e.to_string()).at(measure.expr.span, ""));
                None
            }
        }
    }

    /// The expression of a measure at the points where it is taken.
    fn at_points(&mut self, measure: &wfl::Measure, rules: &terms::Rules) -> Vec<(Value, Sampled)> {
        let mut parts = Vec::new();
        if let MeasureAt::Point(x) = &measure.at {
            parts.extend(self.at_point(measure, x, rules));
        }
        let mut list = terms::Listed::default();
        for place in &measure.places {
            let Some((sig, set)) = self.term_maker().place(place) else { continue };
            // what is largest or smallest is the same however often it counts
            let mut unsaid = Vec::new();
            let counts = matches!(measure.reduction, Reduction::Integral | Reduction::Mean);
            let told = if counts { &mut *self.diagnostics } else { &mut unsaid };
            let Some(set) = list.rest(&self.mesh, place, set, told) else { continue };
            let law = compile_value(self.env, &sig, "measure", &measure.expr);
            self.diagnostics.extend(law.diagnostics);
            let Some(law) = law.value else { continue };
            if !self.is_number(measure, &law) {
                continue;
            }
            if let Some(set) = &set {
                let (parts, diagnostics) = self.parts();
                jumps::check(parts, &place.name, set, &law.jumps, diagnostics);
            }
            let at_nodes = matches!((&measure.at, &set), (MeasureAt::Nodes, Some(_)));
            let refused = at_nodes.then(|| mappings::refused(law.mapping, "a measure at nodes", measure.expr.span));
            if let Some(d) = refused.flatten() {
                self.diagnostics.push(d);
                continue;
            }
            if let (MeasureAt::Nodes, Some(set)) = (&measure.at, &set) {
                let domain = self.nodes_of(set, measure);
                parts.extend(domain.and_then(|domain| self.taken(measure, law, domain)));
                continue;
            }
            for (set, rule) in self.rules_of_measure(measure, &law, &place.name, set, rules) {
                let there = mappings::fields_there(&law.inputs, []);
                let through = law.mapping.map(|mapping| mappings::Through { mapping, there, pieces: None });
                let pieces = self.parts_of_measure(measure, set.as_ref(), &law, rule);
                let points = PointsOf { rule, parts: pieces };
                let domain = self.domain(&(place.name.clone(), set, through), points, measure.expr.span);
                parts.extend(domain.and_then(|domain| self.taken(measure, law.clone(), domain)));
            }
        }
        parts
    }

    /// Whether the expression of a measure has one number at each point.
    fn is_number(&mut self, measure: &wfl::Measure, law: &ValueLaw) -> bool {
        if law.shape.is_scalar_like() {
            return true;
        }
        let d = Diagnostic::new(Code::E108, format!("a measure is a scalar, found a {}", law.shape));
        let d = d.help("one number at each point: a component v(1), v.Normal, or Norm(v)");
        self.diagnostics.push(at_expr(d, &measure.expr, self.env.expansions, law.shape.to_string()));
        false
    }

    /// The expression of a measure at the points of a domain.
    fn taken(&mut self, measure: &wfl::Measure, law: ValueLaw, domain: Arc<Domain>) -> Option<(Value, Sampled)> {
        let span = measure.expr.span;
        match Value::new(law, self.batch) {
            Ok(value) => match value.bind(&self.mesh, domain, &self.fields) {
                Ok(sampled) => return Some((value, sampled)),
                Err(e) => self.diagnostics.push(Diagnostic::new(Code::E202, e.to_string()).at(span, "")),
            },
            Err(e) => self.diagnostics.push(Diagnostic::new(Code::E609, e.to_string()).at(span, "")),
        }
        None
    }

    /// The nodes of the cells or faces of a region, as many as its fields of the highest degree have.
    fn nodes_of(&mut self, set: &RegionSet, measure: &wfl::Measure) -> Option<Arc<Domain>> {
        let e = &measure.expr;
        let is_sampled = self.sampling.is_of(&measure.name.name);
        let degree = self.fields.iter().map(Field::degree).max().unwrap_or(1).max(1);
        let rule = |kind: CellKind| match Element::lagrange(kind, degree, Family::Continuous) {
            Ok(element) => {
                let mut points = element.points().to_vec();
                if is_sampled && let Ok(between) = composite(kind, 1, PARTS_BESIDE_NODES) {
                    points.extend(between.points);
                }
                Rule { kind, degree: 0, weights: vec![1.0; points.len()], points }
            }
            Err(_) => vertex(kind),
        };
        match Domain::new(&self.mesh, set, &rule) {
            Ok(domain) => Some(Arc::new(domain)),
            Err(error) => {
                self.diagnostics.push(Diagnostic::new(Code::E409, error.to_string()).at(e.span, ""));
                None
            }
        }
    }

    /// The expression of a measure at one point; `None` after a message.
    fn at_point(&mut self, measure: &wfl::Measure, x: &Expr, rules: &terms::Rules) -> Option<(Value, Sampled)> {
        let found = numbers(self.env, "the point of a measure", x, self.diagnostics)?;
        let dim = self.mesh.dim();
        if found.len() != dim {
            let d = Diagnostic::new(Code::E108, format!("a point has {dim} coordinates here, found {}", found.len()));
            self.diagnostics.push(d.at(x.span, ""));
            return None;
        }
        let point = [0, 1, 2].map(|d| found.get(d).copied().unwrap_or(0.0));
        let backend = self.batch;
        let (parts, diagnostics) = self.parts();
        let mut maker = OutputMaker::at_a_point(parts, rules, backend, diagnostics);
        let (bodies, faces) = (maker.bodies(), maker.faces_of_lines());
        let homes = maker.homes(&bodies, &faces, &measure.expr);
        let anywhere = !homes.is_empty();
        let mut refused = None;
        for (target, law) in homes {
            if let Some(d) = mappings::refused(law.mapping, "a value at a point", measure.expr.span) {
                refused = Some(d);
                continue;
            }
            let Ok(located) = Located::new(&self.mesh, &target.support.region(), &[point]) else { continue };
            if !located.found.contains(&true) {
                continue;
            }
            if !self.is_number(measure, &law) {
                return None;
            }
            let (parts, diagnostics) = self.parts();
            let maker = OutputMaker::at_a_point(parts, rules, backend, diagnostics);
            let told = maker.state_at_points(&law, measure.expr.span, (x.span, "the point"));
            if let Some(d) = told {
                self.diagnostics.push(d);
                return None;
            }
            let (parts, diagnostics) = self.parts();
            jumps::check(parts, &target.sig.name, &target.support.region(), &law.jumps, diagnostics);
            return self.taken(measure, law, located.domain);
        }
        if anywhere {
            let (low, high) = self.mesh.bounds();
            let missed = || {
                let d = Diagnostic::new(Code::E435, "the point is in no body that has this expression");
                let d = d.at(x.span, format!("the mesh spans {:?} to {:?}", &low[..dim], &high[..dim]));
                d.at(measure.expr.span, "of this")
            };
            self.diagnostics.push(refused.unwrap_or_else(missed));
        }
        None
    }
}

/// Whether an input is a value of a field, of this step or of those before.
fn reads_field(slot: &InputSlot) -> bool {
    matches!(slot, InputSlot::Field(_) | InputSlot::Previous(_) | InputSlot::History(..))
}

/// Whether an expression names a value of the previous step or the increment, which amounts of a step are made of.
fn names_change(e: &Expr) -> bool {
    let mut found = false;
    each_name(e, &mut |word| found |= word == "timestep" || split_prefixes(word).0.contains("Previous_"));
    found
}

impl Measure {
    /// The points of a measure that is taken on one set of them.
    pub(super) fn domain(&self) -> Option<Arc<Domain>> {
        let Taken::Points(_, parts) = &self.taken else { return None };
        let [(_, sampled)] = parts.as_slice() else { return None };
        Some(sampled.domain.clone())
    }

    /// How it is reduced, and its expression on each set of its points; `None` for sums of equations.
    #[must_use]
    pub fn at_points(&self) -> Option<(Reduction, &[(Value, Sampled)])> {
        match &self.taken {
            Taken::Points(reduction, parts) => Some((*reduction, parts)),
            Taken::Reaction(_) | Taken::Balance(_) => None,
        }
    }

    /// Of a reaction the prescribed dofs, in the local frames of their nodes, with the weight of each: it is minus the sum of
    /// their equations times that.
    #[must_use]
    pub fn rows(&self) -> Option<&[(usize, f64)]> {
        match &self.taken {
            Taken::Reaction(reaction) => Some(reaction.rows()),
            Taken::Points(..) | Taken::Balance(_) => None,
        }
    }

    /// True if it reads the end of the previous step.
    #[must_use]
    pub fn reads_past(&self) -> bool {
        match &self.taken {
            Taken::Points(_, parts) => parts.iter().any(|(value, _)| value.reads_past()),
            Taken::Reaction(reaction) => reaction.reads_past,
            Taken::Balance(balanced) => balanced.reads_past,
        }
    }

    /// Whether it samples an expression that says what changes in a step. A rate (`Dot_u`) reads the past, too, and is a value
    /// at the end of the step.
    #[must_use]
    pub fn reads_change(&self) -> bool {
        match &self.taken {
            Taken::Points(_, parts) => {
                self.names_change && parts.iter().any(|(value, _)| value.reads_past() || value.reads_step())
            }
            Taken::Reaction(_) | Taken::Balance(_) => false,
        }
    }

    /// Where the expression is not finite, for a `value` that is not, at the state of the last [`Self::evaluate`].
    pub fn bad(&self, value: f64, system: &System, u: &[f64]) -> BadMeasure {
        let state = system.values(u);
        let values = state.view();
        let at = match &self.taken {
            Taken::Points(_, parts) => {
                parts.iter().find_map(|(v, sampled)| v.first_not_finite(&system.mesh, sampled, values))
            }
            Taken::Reaction(_) | Taken::Balance(_) => None,
        };
        BadMeasure { name: self.name.clone(), span: self.span, value, at, is_made: false }
    }

    /// Its value at a state; made by all ranks together.
    #[must_use]
    pub fn evaluate(&self, at: &Measured<'_>) -> f64 {
        match &self.taken {
            Taken::Points(reduction, parts) => match (&self.weights, parts.as_slice()) {
                (Some(weights), [(value, sampled)]) => match (weights.sums(at, (value, sampled)), reduction) {
                    (Some([sum, size]), Reduction::Mean) => sum / size,
                    (Some([sum, _]), _) => sum,
                    (None, _) => reduced(*reduction, parts, at),
                },
                _ => reduced(*reduction, parts, at),
            },
            Taken::Reaction(reaction) => reaction.value(at),
            Taken::Balance(balanced) => balanced.value(at),
        }
    }

    /// Of what a balance loses: what moves there.
    #[must_use]
    pub fn moved(&self, at: &Measured<'_>) -> Option<Turnover> {
        let Taken::Balance(balanced) = &self.taken else { return None };
        Some(Turnover { name: self.name.clone(), amount: balanced.moved(at)? })
    }
}

/// Values at points as one number.
fn reduced(reduction: Reduction, parts: &[(Value, Sampled)], at: &Measured<'_>) -> f64 {
    let Measured { system, window, u, .. } = *at;
    let state = system.values(u);
    let values = state.view();
    let (mut sum, mut size) = (0.0, 0.0);
    let (mut largest, mut smallest) = (f64::NEG_INFINITY, f64::INFINITY);
    // of a sum with an infinite part nothing is known, and neither of the largest of values of which one is none
    let mut broken: Option<f64> = None;
    for (value, sampled) in parts {
        value.at_step(values.with_present_rates(window)).for_each_counted_point(
            &system.mesh,
            sampled,
            values,
            |weight, v| {
                sum += weight * v[0];
                size += weight;
                largest = largest.max(v[0]);
                smallest = smallest.min(v[0]);
                if !v[0].is_finite() && !broken.is_some_and(f64::is_nan) {
                    broken = Some(v[0]);
                }
            },
        );
    }
    let team = system.team();
    if let Some(rank) = team.first(broken.is_some()) {
        return team.numbers_of(rank, broken.as_slice())[0];
    }
    let mut sums = [sum, size];
    team.sum(&mut sums);
    let [sum, size] = sums;
    let [_, largest] = team.range(largest, largest);
    let [smallest, _] = team.range(smallest, smallest);
    match reduction {
        Reduction::Mean => sum / size,
        Reduction::Max | Reduction::Value => largest,
        Reduction::Min => smallest,
        Reduction::Integral | Reduction::Reaction | Reduction::Balance(_) => sum,
    }
}
