//! The values behind `expect`.

use std::collections::BTreeMap;

use wfl::{
    Diagnostic, Expect, Span,
    ast::{Cond, CondKind, Expr, ExprKind},
};
use wfl_compiler::{Constant, Env, compile_condition, constant, interpret, run_prologue, types::Shape};

use super::Scene;

impl Scene {
    /// The `expect` conditions with measures at their last values, and with derivatives: the condition and whether it holds;
    /// `None` for one that cannot be evaluated.
    #[must_use]
    pub fn expectations(
        &self,
        measures: &[(String, f64)],
        derivatives: &[(String, Constant)],
    ) -> (Vec<(Expect, Option<bool>)>, Vec<Diagnostic>) {
        let params = self.known(measures, derivatives);
        let env = self.bare(&params);
        let place = super::fields::global_place(0);
        let mut diagnostics = Vec::new();
        let mut out = Vec::new();
        for expect in &self.env.expects {
            let law = compile_condition(&env, &place, "expect", &expect.condition);
            diagnostics.extend(law.diagnostics);
            let known = self.operands_are_finite(&env, &expect.condition);
            let holds = law.value.filter(|l| l.inputs.is_empty() && known).map(|law| {
                let mut value = [0.0];
                interpret(&law.kernel, &run_prologue(&law.prologue, &[]), &[], &mut Vec::new(), &mut value);
                value[0] == 1.0
            });
            out.push((expect.clone(), holds));
        }
        (out, diagnostics)
    }

    /// True if everything a condition compares is finite: with a number that is none, `not (m > 5)` would hold.
    fn operands_are_finite(&self, env: &Env<'_>, condition: &Cond) -> bool {
        let finite = |e: &Expr| {
            let found = constant(env, "expect", e).value;
            found.is_none_or(|c| c.values.iter().all(|v| v.is_finite()))
        };
        match &condition.kind {
            CondKind::Compare(first, rest) => finite(first) && rest.iter().all(|(_, e)| finite(e)),
            CondKind::And(parts) | CondKind::Or(parts) => parts.iter().all(|c| self.operands_are_finite(env, c)),
            CondKind::Not(inner) => self.operands_are_finite(env, inner),
        }
    }

    /// What stands on the sides of the comparisons of a condition, with measures at their last values and derivatives, in the order of the
    /// text; what is a number as written is left out.
    #[must_use]
    pub fn sides(
        &self,
        condition: &Cond,
        measures: &[(String, f64)],
        derivatives: &[(String, Constant)],
    ) -> Vec<(Span, f64)> {
        let params = self.known(measures, derivatives);
        let env = self.bare(&params);
        let mut sides = Vec::new();
        compared(condition, &mut sides);
        let value = |e: &&Expr| constant(&env, "a side", e).value?.values.first().map(|v| (e.span, *v));
        sides.iter().filter_map(value).collect()
    }

    /// The number that an expression of params and the given values is; `None` where it is none.
    #[must_use]
    pub fn number_of(&self, e: &Expr, values: &[(String, f64)]) -> Option<f64> {
        self.numbers_of([e], values)[0]
    }

    /// The numbers that expressions without fields give with these values by name, as [`Self::number_of`] each of them.
    #[must_use]
    pub fn numbers_of<'e>(
        &self,
        all: impl IntoIterator<Item = &'e Expr>,
        values: &[(String, f64)],
    ) -> Vec<Option<f64>> {
        let params = self.with_measures(values);
        let env = self.bare(&params);
        all.into_iter().map(|e| constant(&env, "a number", e).value?.values.first().copied()).collect()
    }

    /// The params of the scene, its measures as numbers, and derivatives; those that nobody has found are no numbers.
    fn known(&self, measures: &[(String, f64)], derivatives: &[(String, Constant)]) -> BTreeMap<String, Constant> {
        let mut params = self.with_measures(measures);
        params.extend(self.env.derivatives.iter().chain(derivatives).cloned());
        params
    }

    /// The params of the scene and its measures as numbers.
    pub(super) fn with_measures(&self, measures: &[(String, f64)]) -> BTreeMap<String, Constant> {
        let mut params = self.env.params.clone();
        for (name, value) in measures {
            params.insert(name.clone(), Constant { shape: Shape::SCALAR, values: vec![*value], declared: None });
        }
        params
    }

    /// An environment without fields.
    pub(super) fn bare<'a>(&'a self, params: &'a BTreeMap<String, Constant>) -> Env<'a> {
        Env {
            dim: self.env.dim,
            fields: &[],
            mappings: &[],
            params,
            expansions: &self.env.expansions,
            step_variable: None,
            rates: &[],
            tables: &self.env.tables,
            equal_within: 0.0,
        }
    }
}

/// The sides of all comparisons in a condition that are not numbers as written.
fn compared<'c>(condition: &'c Cond, out: &mut Vec<&'c Expr>) {
    match &condition.kind {
        CondKind::Compare(first, rest) => {
            let sides = std::iter::once(first.as_ref()).chain(rest.iter().map(|(_, e)| e));
            out.extend(sides.filter(|e| !matches!(e.kind, ExprKind::Number(_))));
        }
        CondKind::And(parts) | CondKind::Or(parts) => parts.iter().for_each(|c| compared(c, out)),
        CondKind::Not(inner) => compared(inner, out),
    }
}
