//! Rates of a scene: which fields have which, the statement `scheme`, first rates.

use wfl::{Diagnostic, FieldKind as Declared, ResolvedScript, StartKind, ast::OptionItem, split_prefixes};
use wfl_compiler::types::{FieldKind, FieldSig, RateForm};

use super::{Builder, Given, constants};
use crate::{
    field::Field,
    rates::{Alpha, Rates, Scheme},
    system::Numbering,
};

/// By field, what its rates are compiled to. The equations decide: a field has a second rate where a term or the update of
/// a state has it, and a first one of its own where one has it and the scheme is not backward Euler. Without a statement
/// the scheme is that of second rates, BDF2 for steps that the run chooses, else backward Euler.
pub(super) fn forms(script: &ResolvedScript, sigs: &[FieldSig]) -> Vec<RateForm> {
    let (mut first, mut second) = (vec![false; sigs.len()], vec![false; sigs.len()]);
    let mut note = |word: &str| {
        let (prefixes, root) = split_prefixes(word);
        let Some(field) = sigs.iter().position(|s| s.name == root && s.is_unknown()) else { return };
        second[field] |= prefixes.contains("Dot2_");
        first[field] |= prefixes.contains("Dot_");
    };
    script.terms.iter().for_each(|t| wfl::each_name(&t.expr, &mut note));
    for field in &script.fields {
        if let Declared::State { update } = &field.kind {
            wfl::each_name(update, &mut note);
        }
    }
    let named = script.scheme.as_ref().map(|s| s.name.name.as_str());
    let differences = match named {
        Some(name) => name == "backward_euler",
        None => !second.contains(&true) && !is_auto(script),
    };
    let form = |(first, second): (&bool, &bool)| match (second, first) {
        (true, _) => RateForm::Second,
        (false, true) if !differences => RateForm::First,
        _ => RateForm::Difference,
    };
    first.iter().zip(&second).map(form).collect()
}

/// True for steps that the run chooses.
fn is_auto(script: &ResolvedScript) -> bool {
    script.steps.as_ref().is_some_and(wfl::Steps::is_auto)
}

/// The rates of fields that are solved for, zero; `None` if there are none.
pub(super) fn of(scheme: Scheme, forms: &[RateForm], fields: &[Field], numbering: &Numbering) -> Option<Rates> {
    let range = |k: usize| numbering.starts[k].map(|start| start..start + fields[k].n_dofs());
    Rates::new(scheme, forms, &(0..fields.len()).map(range).collect::<Vec<_>>())
}

impl Builder<'_> {
    /// The scheme of time integration: that of the statement, else the trapezoidal rule where a term has a second rate,
    /// BDF2 for steps that the run chooses, and backward Euler.
    pub(super) fn scheme(&mut self) -> Scheme {
        self.unfit_steps();
        let trapezoidal = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
        let Some(statement) = &self.script.scheme else {
            return match (self.env.rates.contains(&RateForm::Second), is_auto(self.script)) {
                (true, _) => trapezoidal,
                (false, true) => Scheme::Bdf2,
                (false, false) => Scheme::BackwardEuler,
            };
        };
        let known = match statement.name.name.as_str() {
            "newmark" => &[("beta", 0.25, 0.0, 1.0), ("gamma", 0.5, 0.5, 1.0)][..],
            "hht" => &[("alpha", -0.1, -1.0 / 3.0, 0.0)],
            "generalised_alpha" => &[("rho_inf", 0.8, 0.0, 1.0)],
            _ => &[],
        };
        let mut values: Vec<f64> = known.iter().map(|k| k.1).collect();
        for option in &statement.options {
            let name = option.name.name.as_str();
            let found = known.iter().position(|k| k.0 == name);
            match (found, self.setting(option)) {
                (Some(k), Some(x)) if (known[k].2..=known[k].3).contains(&x) && (name != "beta" || x > 0.0) => {
                    values[k] = x;
                }
                _ => self.bad_setting(option, &statement.name.name, known),
            }
        }
        let scheme = match statement.name.name.as_str() {
            "newmark" => Scheme::Newmark { beta: values[0], gamma: values[1] },
            "hht" => Scheme::Alpha(Alpha::hht(values[0])),
            "generalised_alpha" => Scheme::Alpha(Alpha::generalised(values[0])),
            "bdf2" => Scheme::Bdf2,
            _ => Scheme::BackwardEuler,
        };
        self.unfit_scheme(scheme, statement);
        scheme
    }

    fn setting(&mut self, option: &OptionItem) -> Option<f64> {
        match &option.value {
            Some(wfl::ast::OptionValue::Expr(e)) => constants::number(self.env, "a setting", e, self.diagnostics),
            _ => None,
        }
    }

    fn bad_setting(&mut self, option: &OptionItem, scheme: &str, known: &[(&str, f64, f64, f64)]) {
        let d = Diagnostic::new("E452", format!("`scheme {scheme}` does not take this `{}`", option.name.name));
        let list: Vec<String> = known
            .iter()
            .map(|(name, value, low, high)| format!("{name}={value} ({low} to {high})", low = short(*low)))
            .collect();
        let text = if list.is_empty() { "it has no settings".to_owned() } else { list.join(", ") };
        self.diagnostics.push(d.at(option.name.span, text));
    }

    /// E452 for steps that the run chooses with another scheme than BDF2 or backward Euler: the error of others is not
    /// estimated.
    fn unfit_steps(&mut self) {
        let named = self.script.scheme.as_ref().map(|s| s.name.name.as_str());
        let fits = matches!(named, None | Some("bdf2" | "backward_euler"));
        let second = self.env.rates.contains(&RateForm::Second);
        let Some(steps) = self.script.steps.as_ref().filter(|steps| (second || !fits) && steps.is_auto()) else {
            return;
        };
        let d =
            Diagnostic::new("E452", "steps by `auto` are made with bdf2 or backward_euler, and with first rates alone");
        let why = if second { "this scene has second rates" } else { "this scene has another scheme" };
        let help = if second {
            "write the increment: `by 0.01`"
        } else {
            "leave out `scheme`, or write the increment: `by 0.01`"
        };
        self.diagnostics.push(d.at(steps.by.span, why).help(help));
    }

    /// E452 for BDF2 and second rates. E453 where the equations of a scheme stand within a step and states are renewed at its
    /// end.
    fn unfit_scheme(&mut self, scheme: Scheme, statement: &wfl::Scheme) {
        if scheme == Scheme::Bdf2 && self.env.rates.contains(&RateForm::Second) {
            let d = Diagnostic::new("E452", "`scheme bdf2` integrates first rates alone");
            let d = d.at(statement.name.span, "this scene has second rates");
            self.diagnostics.push(d.help("scheme newmark beta=1/4 gamma=1/2"));
        }
        let state = self.fields.iter().find(|f| f.kind == FieldKind::State);
        if let (Scheme::Alpha(_), Some(state)) = (scheme, state) {
            let name = &statement.name;
            let d = Diagnostic::new("E453", format!("`scheme {}` cannot renew the state `{}`", name.name, state.name));
            let d = d.at(name.span, "its equations stand within the step, states are renewed at the end");
            self.diagnostics.push(d.help("scheme newmark beta=1/4 gamma=1/2"));
        }
    }

    /// First rates.
    pub(super) fn start_rates(&mut self) -> Vec<(usize, Given)> {
        let script = self.script;
        let mut list: Vec<(String, wfl::ast::Expr)> = Vec::new();
        for start in &script.starts {
            let StartKind::Rate { field, value } = &start.kind else { continue };
            let name = &field.name;
            if list.iter().any(|(known, _)| known == name) {
                let d = Diagnostic::new("E434", format!("two initial rates of `{name}`"));
                self.diagnostics.push(d.at(field.span, ""));
                continue;
            }
            let k = self.fields.iter().position(|f| f.name == *name);
            if k.is_none_or(|k| self.env.rates.get(k) != Some(&RateForm::Second)) {
                let d = Diagnostic::new("E454", format!("`Dot_{name}` has no initial value of its own"));
                let text = format!("no term has `Dot2_{name}`: the rate at the start follows from the equations");
                self.diagnostics.push(d.at(field.span, text));
                continue;
            }
            list.push((name.clone(), value.clone()));
        }
        self.nodal_values("the first rate of", list)
    }
}

/// A limit as it is told.
fn short(x: f64) -> String {
    if x.fract() == 0.0 { format!("{x}") } else { format!("{x:.4}") }
}
