//! `measure m = reaction(u(1)) on r`: what the values carry that `fix` prescribes at the nodes of regions.
//!
//! The equation of a prescribed value is not solved; what is left of it, the residual R, is the force of the support. The
//! measure is -sum w R over the prescribed values at the nodes, with w what the expression makes of a unit of the unknown
//! there: the force that the body exerts on its support. In a node with a local frame the force along its prescribed axes
//! counts alone. Promises: what is summed are the equations as they are written, at the end of the step.

use std::{
    cell::OnceCell,
    collections::{BTreeMap, BTreeSet},
};

use wfl::{
    Code, Diagnostic,
    ast::{Argument, Expr, ExprKind},
    at_expr, children, each_name, split_prefixes,
};
use wfl_compiler::{Constant, Env, InterpreterBackend, compile_value, types::FieldKind};
use wfl_discrete::{
    rates::Scheme,
    system::{Numbering, System},
    value::Value,
    window::Window,
};

use super::{Builder, Prescribed, mesh::position_place, rates::Integration};

/// An expression is linear if it is to this part of its size.
const LINEAR: f64 = 1e-9;
/// What the components of the unknown are multiplied with to see whether an expression is linear: no sum of some of them
/// is one.
const TRIAL: [f64; 3] = [0.37, 1.71, -2.93];

/// What a term adds to the equations of a field.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Added {
    /// To all of them together.
    pub(super) sum: f64,
    /// The sizes of what it adds to each: what goes from node to node counts, too.
    pub(super) moved: f64,
}

/// The state that measures are taken at.
pub struct Measured<'a> {
    /// The equations, which stand at the step.
    pub system: &'a System,
    /// The step that it ends.
    pub window: Window,
    /// The unknowns.
    pub u: &'a [f64],
    rows: OnceCell<Option<Vec<f64>>>,
    sums: OnceCell<Option<Vec<Vec<Added>>>>,
}

impl<'a> Measured<'a> {
    /// The end of a step.
    #[must_use]
    pub fn new(system: &'a System, window: Window, u: &'a [f64]) -> Self {
        Self { system, window, u, rows: OnceCell::new(), sums: OnceCell::new() }
    }

    /// The state where time starts, for which nothing was solved: no equation has a sum.
    #[must_use]
    pub fn where_time_starts(self) -> Self {
        let Self { system, u, .. } = self;
        let none = vec![vec![Added::default(); system.fields.len()]; system.terms.len()];
        Self { rows: OnceCell::from(Some(vec![0.0; u.len()])), sums: OnceCell::from(Some(none)), ..self }
    }

    /// The equations that were solved. States have been renewed since: terms read them as they were.
    pub(super) fn solved(&self) -> System {
        let mut system = self.system.clone();
        system.recall_states();
        system
    }

    /// By term and field what the term adds to the equations of the field, on all ranks; `None` where a number is not
    /// finite. Computed once.
    pub(super) fn sums(&self) -> Option<&[Vec<Added>]> {
        self.sums.get_or_init(|| term_sums(&self.solved(), self.u)).as_deref()
    }

    /// What is left of all equations, by dof in local frames: the rows of this rank; `None` where a number is not finite.
    pub(super) fn rows(&self) -> Option<&[f64]> {
        let found = self.rows.get_or_init(|| Some(self.solved().residual_at_points(self.u).ok()?.0));
        found.as_deref()
    }
}

/// By term and field its contributions.
fn term_sums(system: &System, u: &[f64]) -> Option<Vec<Vec<Added>>> {
    let mut out: Vec<Vec<Added>> = Vec::with_capacity(system.terms.len());
    let mut finite = true;
    for term in 0..system.terms.len() {
        let mut rows = vec![0.0; u.len()];
        finite &= system.term_residual(term, u, &mut rows).is_ok();
        let of_field = |field: usize| {
            let own = system.range(field).map_or(&[][..], |range| &rows[range]);
            Added { sum: own.iter().sum(), moved: own.iter().map(|row| row.abs()).sum() }
        };
        out.push((0..system.fields.len()).map(of_field).collect());
    }
    if system.team().any(!finite) {
        return None;
    }
    for added in &mut out {
        let mut numbers: Vec<f64> = added.iter().flat_map(|a| [a.sum, a.moved]).collect();
        system.team().sum(&mut numbers);
        let of_all = numbers.as_chunks().0.iter().map(|[sum, moved]| Added { sum: *sum, moved: *moved });
        *added = of_all.collect();
    }
    Some(out)
}

/// The prescribed values that carry something, with what the measure makes of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Reaction {
    /// By dof, in the local frame of its node.
    rows: Vec<(usize, f64)>,
    /// States are read as they were at the end of the previous step.
    pub(super) reads_past: bool,
}

impl Reaction {
    /// By dof, in the local frame of its node, what the measure makes of its equation.
    pub(super) fn rows(&self) -> &[(usize, f64)] {
        &self.rows
    }

    /// Its value at a state; made by all ranks together.
    pub(super) fn value(&self, at: &Measured<'_>) -> f64 {
        let own = match at.rows() {
            Some(rows) => -self.rows.iter().map(|(dof, weight)| weight * rows[*dof]).sum::<f64>(),
            None => f64::NAN,
        };
        at.system.team().total(own)
    }
}

/// What holds unknowns, and when their equations are solved.
#[derive(Clone, Copy)]
pub(super) struct Held<'a> {
    pub(super) numbering: &'a Numbering,
    pub(super) prescribed: &'a Prescribed,
    pub(super) integration: &'a Integration,
}

impl Builder<'_> {
    /// The rows of one `reaction`; `None` after a message.
    pub(super) fn reaction(&mut self, measure: &wfl::Measure, held: Held<'_>) -> Option<Reaction> {
        let e = &measure.expr;
        self.has_reactions(e, held.integration)?;
        let field = self.carried(e)?;
        self.takes_values(e, field)?;
        let start = held.numbering.starts[field]?;
        let prescribed = held.prescribed.dofs();
        let n = self.fields[field].n_components;
        let mut nodes = BTreeSet::new();
        for place in &measure.places {
            let own = match self.regions.get(&place.name) {
                Some(region) => region.nodes_of(&self.fields[field], &self.mesh, &self.topology),
                None if place.name == "global" => vec![0],
                None => return None,
            };
            let is_held = |node: &&u32| {
                let first = start + **node as usize * n;
                (first..first + n).any(|dof| prescribed.contains(&dof))
            };
            let own: Vec<u32> = own.iter().filter(is_held).copied().collect();
            // a part of the mesh may have none of them
            if self.mesh.lacks(&own) {
                let name = &self.fields[field].name;
                let d = Diagnostic::new(Code::E460, format!("no value of `{name}` is prescribed on `{}`", place.name));
                let d =
                    d.help(format!("fix {name} = ... on {}: the reaction is what prescribed values carry", place.name));
                self.diagnostics.push(d.at(place.span, "").at(e.span, "nothing carries this"));
                return None;
            }
            nodes.extend(own);
        }
        let nodes: Vec<u32> = nodes.into_iter().collect();
        let positions: Vec<[f64; 3]> = nodes.iter().map(|k| self.fields[field].node_position(*k as usize)).collect();
        let weights = self.weights(e, field, &positions)?;
        let mut rows = Vec::new();
        for (node, weight) in nodes.iter().zip(weights.chunks_exact(n)) {
            let first = start + *node as usize * n;
            for dof in (first..first + n).filter(|dof| prescribed.contains(dof)) {
                let along = match held.numbering.frames.of(dof) {
                    Some(frame) => frame.axes[dof - first].iter().zip(weight).map(|(a, w)| a * w).sum(),
                    None => weight[dof - first],
                };
                rows.push((dof, along));
            }
        }
        Some(Reaction { rows, reads_past: self.has_states() })
    }

    /// Whether equations are those of states that have been renewed since.
    pub(super) fn has_states(&self) -> bool {
        self.fields.iter().any(|f| f.kind == FieldKind::State)
    }

    /// Whether the equations hold at the end of a step, where measures are taken.
    pub(super) fn has_reactions(&mut self, e: &Expr, integration: &Integration) -> Option<()> {
        let why = match integration.scheme {
            Scheme::Explicit => "explicit steps solve no equations",
            Scheme::Alpha(_) => "the equations of this scheme hold between the ends of a step, not at its end",
            _ if integration.massless.is_some() => "nodes give their mass to others here",
            _ => return Some(()),
        };
        let d = Diagnostic::new(Code::E460, "the equations do not hold at the end of a step").at(e.span, why);
        self.diagnostics.push(d.help("scheme newmark"));
        None
    }

    /// The unknown whose equations an expression of a reaction is about.
    fn carried(&mut self, e: &Expr) -> Option<usize> {
        let mut found: BTreeSet<usize> = BTreeSet::new();
        each_name(e, &mut |word| {
            let (_, root) = split_prefixes(word);
            found.extend(self.fields.iter().position(|f| f.name == root));
        });
        let mut names = found.iter().copied();
        if let (Some(field), None) = (names.next(), names.next())
            && self.fields[field].kind == FieldKind::Unknown
        {
            return Some(field);
        }
        let d = Diagnostic::new(Code::E460, "a reaction is that of one unknown").at(e.span, "");
        self.diagnostics.push(d.help("measure force = reaction(u(1)) on west; of a scalar: reaction(p)"));
        None
    }

    /// Whether an expression has the unknown's values alone in it: a unit of it at a node has no derivative, so that what
    /// derives it would count as zero.
    fn takes_values(&mut self, e: &Expr, field: usize) -> Option<()> {
        let name = &self.fields[field].name;
        let Some((call, word)) = derivative(e, name) else {
            return Some(());
        };
        let d =
            Diagnostic::new(Code::E460, format!("a reaction is that of values of `{name}`, not of `{word}` of them"));
        let d = d.help("the force that is carried: reaction(u(1)), or reaction(p) of a scalar; its rate: differences of it, behind the run");
        self.diagnostics.push(at_expr(d, call, self.env.expansions, ""));
        None
    }

    /// By position and component what an expression makes of a unit of the component, which it is linear in.
    fn weights(&mut self, e: &Expr, field: usize, positions: &[[f64; 3]]) -> Option<Vec<f64>> {
        let n = self.fields[field].n_components;
        let unit = |c: usize| (0..n).map(|k| f64::from(u8::from(k == c))).collect::<Vec<f64>>();
        let mut columns = Vec::with_capacity(n);
        for c in 0..n {
            columns.push(self.at_nodes_with(e, field, &[unit(c)], positions)?);
        }
        // with both signs: an absolute value is linear on each side
        for sign in [1.0, -1.0] {
            let trial: Vec<f64> = (0..n).map(|c| sign * (TRIAL[c % TRIAL.len()] + (c / TRIAL.len()) as f64)).collect();
            let whole = self.at_nodes_with(e, field, std::slice::from_ref(&trial), positions)?;
            for (k, found) in whole.iter().enumerate() {
                let parts = || columns.iter().zip(&trial).map(|(column, t)| column[k] * t);
                let size: f64 = parts().map(f64::abs).sum();
                let apart = (found - parts().sum::<f64>()).abs();
                // what is not a number is linear in nothing
                if apart.is_nan() || apart > LINEAR * size.max(found.abs()) {
                    let name = &self.fields[field].name;
                    let d = Diagnostic::new(Code::E460, format!("this is not linear in `{name}`"));
                    let d = d.help("a sum of forces: a component u(1), a direction u.[0,1], a moment x*u(2) - y*u(1)");
                    self.diagnostics.push(at_expr(d, e, self.env.expansions, ""));
                    return None;
                }
            }
        }
        self.has_no_products(e, field, positions)?;
        let of_node = |k: usize| columns.iter().map(move |column| column[k]);
        Some((0..positions.len()).flat_map(of_node).collect())
    }

    /// Whether an expression is linear in all places in which the unknown stands, told apart. Products of the unknown may cancel,
    /// as in a moment about the current place, `(x + u(1))*u(2) - (y + u(2))*u(1)`: what is left is linear, and another number
    /// than the one that was meant, which has a state in the arms and a unit of the unknown behind them.
    fn has_no_products(&mut self, e: &Expr, field: usize, positions: &[[f64; 3]]) -> Option<()> {
        let (name, n) = (self.fields[field].name.clone(), self.fields[field].n_components);
        let mut places = 0;
        let apart = told_apart(e, &name, &mut places);
        if places < 2 {
            return Some(());
        }
        #[expect(clippy::cast_precision_loss, reason = "as many places as a line has")]
        let value = |k: usize| (0..n).map(move |c| (1.0 + k as f64 / places as f64) * TRIAL[(k + c) % TRIAL.len()]);
        let all: Vec<Vec<f64>> = (0..places).map(|k| value(k).collect()).collect();
        let whole = self.at_nodes_with(&apart, field, &all, positions)?;
        let mut sums = vec![[0.0; 2]; whole.len()];
        for k in 0..places {
            let one = |j: usize| if j == k { all[k].clone() } else { vec![0.0; n] };
            let part = self.at_nodes_with(&apart, field, &(0..places).map(one).collect::<Vec<_>>(), positions)?;
            sums.iter_mut().zip(part).for_each(|([sum, size], x)| (*sum, *size) = (*sum + x, *size + x.abs()));
        }
        let is_sum = |(found, [sum, size]): (&f64, &[f64; 2])| (found - sum).abs() <= LINEAR * size.max(found.abs());
        if whole.iter().zip(&sums).all(is_sum) {
            return Some(());
        }
        let d =
            Diagnostic::new(Code::E460, format!("this is not linear in `{name}`: it multiplies `{name}` by itself"));
        let d = d.help(format!(
            "arms of the reference placement: x*{name}(2) - y*{name}(1). With current ones, of a support that turns by a: \
             cos(a)*reaction(x*{name}(2) - y*{name}(1)) - sin(a)*reaction(x*{name}(1) + y*{name}(2))"
        ));
        self.diagnostics.push(at_expr(d, e, self.env.expansions, ""));
        None
    }

    /// An expression at positions with values of a field in place of its name, one, or one for each place in which it stands
    /// ([`told_apart`]); `None` after a message.
    fn at_nodes_with(
        &mut self,
        e: &Expr,
        field: usize,
        values: &[Vec<f64>],
        positions: &[[f64; 3]],
    ) -> Option<Vec<f64>> {
        let sig = &self.sigs[field];
        let mut params: BTreeMap<String, Constant> = self.params.clone();
        let names = std::iter::once(sig.name.clone()).chain((0..).map(|k| at_place(&sig.name, k)));
        for (name, value) in names.zip(values.iter().take(1).chain(values)) {
            params.insert(name, Constant { shape: sig.shape, values: value.clone(), declared: None });
        }
        let env = Env { params: &params, ..self.env.clone() };
        let law = compile_value(&env, &position_place(self.fields.len()), "a reaction", e);
        self.diagnostics
            .extend(law.diagnostics.into_iter().filter(|d| !self.diagnostics.contains(d)).collect::<Vec<_>>());
        let law = law.value?;
        if !law.shape.is_scalar_like() {
            let d = Diagnostic::new(Code::E108, format!("a measure is a scalar, found a {}", law.shape));
            let d = d.help(format!(
                "one component of the reaction: reaction({}(1)), or reaction({}.[0,1])",
                sig.name, sig.name
            ));
            self.diagnostics.push(at_expr(d, e, self.env.expansions, law.shape.to_string()));
            return None;
        }
        let made = match Value::new(law, &InterpreterBackend) {
            Ok(value) if value.reads_positions_only() && !value.reads_step() => value.at_positions(positions).ok(),
            Ok(_) => None,
            Err(error) => {
                self.diagnostics.push(Diagnostic::new(Code::E609, error.to_string()).at(e.span, ""));
                return None;
            }
        };
        if made.is_none() {
            let d = Diagnostic::new(
                Code::E460,
                "what multiplies the unknown in a reaction is a number, or one of the position",
            );
            let d = d.help(
                "what changes from step to step can be computed of reactions afterwards: `output csv`, or in Python",
            );
            self.diagnostics.push(at_expr(d, e, self.env.expansions, ""));
        }
        made
    }
}

/// A word that nobody can write, for one of the places in which a field stands.
fn at_place(field: &str, k: usize) -> String {
    format!("{field}#{k}")
}

/// An expression with another word in each place in which a field stands, but in conditions; `n` counts them.
fn told_apart(e: &Expr, field: &str, n: &mut usize) -> Expr {
    let mut of = |part: &Expr| told_apart(part, field, n);
    let kind = match &e.kind {
        ExprKind::Name(word) if word == field => {
            *n += 1;
            ExprKind::Name(at_place(field, *n - 1))
        }
        ExprKind::Number(_) | ExprKind::Name(_) => e.kind.clone(),
        ExprKind::Sum(parts) => ExprKind::Sum(parts.iter().map(|(minus, part)| (*minus, of(part))).collect()),
        ExprKind::Product(first, rest) => {
            let first = Box::new(of(first));
            ExprKind::Product(first, rest.iter().map(|(op, place, part)| (*op, *place, of(part))).collect())
        }
        ExprKind::Negate(a) => ExprKind::Negate(Box::new(of(a))),
        ExprKind::Transpose(a) => ExprKind::Transpose(Box::new(of(a))),
        ExprKind::Power(a, b) => ExprKind::Power(Box::new(of(a)), Box::new(of(b))),
        ExprKind::Call(callee, arguments) => {
            let callee = Box::new(of(callee));
            let argument = |argument: &Argument| match argument {
                Argument::Expr(part) => Argument::Expr(of(part)),
                other => other.clone(),
            };
            ExprKind::Call(callee, arguments.iter().map(argument).collect())
        }
        ExprKind::Tensor(rows) => ExprKind::Tensor(rows.iter().map(|row| row.iter().map(&mut of).collect()).collect()),
        ExprKind::If(condition, a, b) => ExprKind::If(condition.clone(), Box::new(of(a)), Box::new(of(b))),
    };
    Expr { kind, span: e.span, expansion: e.expansion }
}

/// The first call in an expression that derives a field, with its word.
fn derivative<'e>(e: &'e Expr, field: &str) -> Option<(&'e Expr, &'e str)> {
    let mut found = None;
    if let ExprKind::Call(callee, _) = &e.kind
        && let ExprKind::Name(word) = &callee.kind
        && ["Grad", "Div", "Hess", "Diff", "Rate"].contains(&word.as_str())
    {
        each_name(e, &mut |inside| {
            if split_prefixes(inside).1 == field {
                found = Some((e, word.as_str()));
            }
        });
    }
    children(e, &mut |part| found = found.or_else(|| derivative(part, field)));
    found
}
