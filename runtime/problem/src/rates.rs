//! Rates of a scene: which fields have which, the statement `scheme`, first rates.

use std::collections::BTreeMap;

use wfl::{
    Code, Diagnostic, FieldKind as Declared, Fix, ResolvedScript, StartKind,
    ast::{Argument, Expr, ExprKind, Ident, OptionItem},
    at_expr, children, each_name, split_prefixes,
};
use wfl_compiler::{
    Constant, each_name_in_effect,
    types::{FieldKind, FieldSig, RateForm},
};
use wfl_discrete::{
    field::Field,
    rates::{Alpha, Driven, MOST_ORDER, Rates, Scheme},
    system::Numbering,
};

use super::{Builder, Energy, Given, Prescribed, constants};

/// By field, what its rates are compiled to. The equations decide: a field has a second rate where a term or the update of
/// a state has it, and a first one of its own where one has it and the scheme is not backward Euler; a factor that is zero
/// for the present parameters asks for neither. Without a statement the scheme is BDF for steps that the run chooses, that
/// of second rates where there are some, else backward Euler.
pub(super) fn forms(script: &ResolvedScript, sigs: &[FieldSig], params: &BTreeMap<String, Constant>) -> Vec<RateForm> {
    let (mut first, mut second) = (vec![false; sigs.len()], vec![false; sigs.len()]);
    let mut note = |word: &str| {
        let (prefixes, root) = split_prefixes(word);
        let Some(field) = sigs.iter().position(|s| s.name == root && s.is_unknown()) else { return };
        second[field] |= prefixes.contains("Dot2_");
        first[field] |= prefixes.contains("Dot_");
    };
    for text in texts(script) {
        each_name_in_effect(params, text, &mut note);
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

/// What decides which rates there are: terms and updates of states.
fn texts(script: &ResolvedScript) -> impl Iterator<Item = &Expr> {
    let updates = script.fields.iter().filter_map(|field| match &field.kind {
        Declared::State { update } => Some(update),
        _ => None,
    });
    script.terms.iter().map(|t| &t.expr).chain(updates)
}

/// Calls `f` for each `Rate(e)`, with what it is taken of.
fn each_rate<'e>(e: &'e Expr, f: &mut dyn FnMut(&'e Expr, &'e Expr)) {
    if let ExprKind::Call(callee, arguments) = &e.kind
        && let (ExprKind::Name(word), [Argument::Expr(of)]) = (&callee.kind, arguments.as_slice())
        && word == "Rate"
    {
        f(e, of);
    }
    children(e, &mut |part| each_rate(part, f));
}

/// True for a field whose second rate stands in a term, with an effect or without.
fn is_written(script: &ResolvedScript, field: &str) -> bool {
    let mut found = false;
    for text in texts(script) {
        wfl::each_name(text, &mut |word| {
            let (prefixes, root) = split_prefixes(word);
            found |= root == field && prefixes.contains("Dot2_");
        });
    }
    found
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

/// Rates with what prescribed values drive; a field that begins with values may begin with others than those.
pub(super) fn driven(
    rates: Option<Rates>,
    numbering: &Numbering,
    prescribed: &Prescribed,
    starts: &[(usize, Given)],
) -> Option<Rates> {
    let mut rates = rates?;
    let begins = |position: usize| starts.iter().any(|(field, _)| *field == position);
    rates.set_driven(Driven::new(&numbering.frames, prescribed.in_motion(begins)));
    Some(rates)
}

/// What the statement `scheme` says.
#[derive(Clone, Debug)]
pub(super) struct Integration {
    pub(super) scheme: Scheme,
    /// Steps by `auto` of explicit steps: the part of the stability limit.
    pub(super) fraction: f64,
    /// The balance of energy, if it is asked for.
    pub(super) energy: Option<Energy>,
    /// The region whose nodes give their mass away.
    pub(super) massless: Option<Ident>,
}

/// The part of the stability limit that explicit steps by `auto` take where the scene does not say: it leaves a tenth for
/// what becomes stiffer after the start.
const FRACTION: f64 = 0.9;
/// The largest such part: what a contact that opens and closes bears, a penalty of E/h on a bar above all.
pub const MOST_FRACTION: f64 = 0.95;
/// The part of the energy that may be lost where the scene does not say.
const LOST: f64 = 1e-3;

impl Builder<'_> {
    /// The scheme of time integration: that of the statement, else BDF for steps that the run chooses and where some equations have
    /// second rates and others first ones alone, the trapezoidal rule where all have second ones, and backward Euler.
    pub(super) fn scheme(&mut self) -> Integration {
        let second = self.env.rates.contains(&RateForm::Second);
        let mut made = Integration { scheme: Scheme::BackwardEuler, fraction: FRACTION, energy: None, massless: None };
        let Some(statement) = &self.script.scheme else {
            made.scheme = match (second, is_auto(self.script)) {
                // more than two orders leave the vibrations of second rates undamped
                (second, true) => Scheme::Bdf { most: if second { 2 } else { MOST_ORDER } },
                // the trapezoidal rule keeps what a sudden load makes of a pressure or a temperature, with changing sign
                (true, false) if self.has_rates_without_inertia() => Scheme::Bdf { most: 2 },
                (true, false) => Scheme::Newmark { beta: 0.25, gamma: 0.5 },
                (false, false) => Scheme::BackwardEuler,
            };
            return made;
        };
        let known = match statement.name.name.as_str() {
            "newmark" => &[("beta", 0.25, 0.0, 1.0), ("gamma", 0.5, 0.5, 1.0)][..],
            "hht" => &[("alpha", -0.1, -1.0 / 3.0, 0.0)],
            "generalised_alpha" => &[("rho_inf", 0.8, 0.0, 1.0)],
            "explicit" => &[("fraction", FRACTION, 0.0, MOST_FRACTION)],
            _ => &[],
        };
        let mut values: Vec<f64> = known.iter().map(|k| k.1).collect();
        for option in &statement.options {
            let name = option.name.name.as_str();
            if name == "massless" {
                made.massless = self.massless(option, statement, second);
                continue;
            }
            let found = known.iter().position(|k| k.0 == name);
            let positive = ["beta", "fraction", "energy"].contains(&name);
            match (found, self.setting(option)) {
                (None, limit) if name == "energy" && second && limit.is_none_or(|x| x > 0.0 && x <= 1.0) => {
                    made.energy = Some(Energy::new(self.script, limit.unwrap_or(LOST)));
                }
                (Some(k), Some(x)) if (known[k].2..=known[k].3).contains(&x) && (!positive || x > 0.0) => values[k] = x,
                _ => self.bad_setting(option, &statement.name.name, known),
            }
        }
        made.scheme = match statement.name.name.as_str() {
            "newmark" => Scheme::Newmark { beta: values[0], gamma: values[1] },
            "hht" => Scheme::Alpha(Alpha::hht(values[0])),
            "generalised_alpha" => Scheme::Alpha(Alpha::generalised(values[0])),
            "bdf2" => Scheme::Bdf { most: 2 },
            "bdf3" => Scheme::Bdf { most: 3 },
            "explicit" => {
                made.fraction = values[0];
                Scheme::Explicit
            }
            _ => Scheme::BackwardEuler,
        };
        self.unfit_scheme(made.scheme, statement);
        made
    }

    /// Whether a field is solved for that has no second rate, from equations with first ones: its own, or those of another one.
    fn has_rates_without_inertia(&self) -> bool {
        let is_such = |name: &str| {
            let mut fields = self.script.fields.iter().zip(self.env.rates);
            fields.any(|(field, form)| {
                field.name.name == name && matches!(field.kind, Declared::Unknown) && *form != RateForm::Second
            })
        };
        self.script.terms.iter().any(|term| {
            let (mut is_tested, mut has_rate) = (false, false);
            wfl::each_word(&term.expr, &mut |_, word| {
                let (prefixes, name) = split_prefixes(word);
                is_tested |= prefixes.contains("Test_") && is_such(name);
                has_rate |= prefixes.contains("Dot_");
            });
            is_tested && has_rate
        })
    }

    /// E461 for rates of states where equations, loads and updates read them: states are those of the last step there, now and one
    /// step earlier, so that their rates would be zero. Measures and outputs come behind their renewal.
    pub(super) fn rates_of_states(&mut self) {
        let is_state = |word: &str| {
            let (_, root) = split_prefixes(word);
            self.script.fields.iter().any(|f| f.name.name == root && matches!(f.kind, Declared::State { .. }))
        };
        let mut found: Option<(&Expr, String)> = None;
        for text in texts(self.script).chain(self.script.loads.iter().map(|load| &load.value)) {
            each_rate(text, &mut |e, of| {
                let mut state = None;
                each_name(of, &mut |word| {
                    state = state.take().or(is_state(word).then(|| split_prefixes(word).1.to_owned()))
                });
                found = found.take().or(state.map(|state| (e, state)));
            });
            wfl::each_word(text, &mut |e, word| {
                if split_prefixes(word).0.contains("Dot_") && is_state(word) {
                    found = found.take().or(Some((e, split_prefixes(word).1.to_owned())));
                }
            });
        }
        if let Some((e, state)) = found {
            let d = Diagnostic::new(
                Code::E461,
                format!("`{state}` has no rate before it is renewed, at the end of the step"),
            );
            let d = at_expr(d, e, self.env.expansions, "here the state is still that of the last step");
            self.diagnostics.push(d.help("the change as its update writes it, over `timestep`"));
        }
    }

    /// E461 for `Rate(e)` where rates of the scheme are no differences over the step, and for rates of data where the equations
    /// stand within it: those are differences from there over the whole step.
    pub(super) fn rates_of_expressions(&mut self, scheme: Scheme) {
        if scheme == Scheme::BackwardEuler {
            return;
        }
        if let (Scheme::Alpha(_), Some(statement)) = (scheme, &self.script.scheme) {
            self.past_within_a_step(statement);
        }
        let mut found = None;
        for text in texts(self.script) {
            wfl::each_word(text, &mut |e, word| {
                if word == "Rate" {
                    found = found.or(Some(e));
                }
            });
        }
        if let Some(e) = found {
            let d = Diagnostic::new(
                Code::E461,
                "`Rate` is a change over one step, and the scheme of this scene has others",
            );
            let d = at_expr(d, e, self.env.expansions, "").help("scheme backward_euler");
            self.diagnostics.push(match self.script.scheme.as_ref() {
                Some(statement) => d.at(statement.span, "this scheme"),
                None => d
                    .fix(Fix::AddStatement("scheme backward_euler".to_owned()))
                    .note("without `scheme`, steps `by auto` are backward differences of several steps"),
            });
        }
    }

    /// E461 for what mixes the two places of a step that the alpha methods have: their equations stand within the step, the
    /// past is the end of the last one, and a difference of the two is that of a part of a step.
    fn past_within_a_step(&mut self, statement: &wfl::Scheme) {
        let kind = |name: &str| self.script.fields.iter().find(|f| f.name.name == name).map(|f| &f.kind);
        let is_data = |name: &str| matches!(kind(name), Some(Declared::Data { .. }));
        let is_state = |name: &str| matches!(kind(name), Some(Declared::State { .. }));
        let mut found = None;
        for text in texts(self.script).chain(self.script.loads.iter().map(|load| &load.value)) {
            wfl::each_word(text, &mut |e, word| {
                let (prefixes, root) = split_prefixes(word);
                let is_past = prefixes.contains("Previous_") && !is_state(root);
                if is_past || (prefixes.contains("Dot_") && is_data(root)) {
                    found = found.or(Some((e, is_past)));
                }
            });
        }
        let Some((e, is_past)) = found else { return };
        let (what, help) = if is_past {
            (
                "the end of the last step is no whole step before the equations of this scheme",
                "a rate is Dot_u; friction by displacements: scheme newmark, bdf2 or backward_euler",
            )
        } else {
            (
                "rates of data are not those of this scheme",
                "scheme newmark or bdf2; or an unknown with an equation of its own: (k - formula)*Test_k",
            )
        };
        let d = Diagnostic::new(Code::E461, what);
        let d = at_expr(d, e, self.env.expansions, "").at(statement.span, "its equations stand within the step");
        self.diagnostics.push(d.help(help));
    }

    /// The region of `massless=`; a scene without second rates has no mass to give away.
    fn massless(&mut self, option: &OptionItem, statement: &wfl::Scheme, second: bool) -> Option<Ident> {
        let scheme = &statement.name.name;
        let d = Diagnostic::new(Code::E452, format!("`scheme {scheme}` does not take this `massless`"));
        let (text, region) = match &option.value {
            Some(wfl::ast::OptionValue::Expr(Expr { kind: ExprKind::Name(name), span, .. })) => {
                ("", Some(Ident { name: name.clone(), span: *span }))
            }
            _ => ("the name of a region: massless=wall", None),
        };
        let text = if scheme == "explicit" {
            "explicit steps divide by the mass of every node"
        } else if !second && !self.has_written_second_rates() {
            "no term has `Dot2_`: there is no mass"
        } else {
            text
        };
        if text.is_empty() {
            return region.filter(|_| second);
        }
        self.diagnostics.push(d.at(option.name.span, text));
        None
    }

    /// Whether a second rate stands in a text, with an effect or without.
    fn has_written_second_rates(&self) -> bool {
        self.fields.iter().any(|f| is_written(self.script, &f.name))
    }

    fn setting(&mut self, option: &OptionItem) -> Option<f64> {
        match &option.value {
            Some(wfl::ast::OptionValue::Expr(e)) => constants::number(self.env, "a setting", e, self.diagnostics),
            _ => None,
        }
    }

    fn bad_setting(&mut self, option: &OptionItem, scheme: &str, known: &[(&str, f64, f64, f64)]) {
        let d = Diagnostic::new(Code::E452, format!("`scheme {scheme}` does not take this `{}`", option.name.name));
        let list: Vec<String> = known
            .iter()
            .map(|(name, value, low, high)| format!("{name}={value} ({low} to {high})", low = short(*low)))
            .collect();
        let text = match (option.name.name.as_str(), list.is_empty()) {
            ("energy", _) => "energy, or energy=1e-3 (above 0, at most 1), where a term has `Dot2_`".to_owned(),
            (_, true) => "it has no settings".to_owned(),
            (_, false) => list.join(", "),
        };
        self.diagnostics.push(d.at(option.name.span, text));
    }

    /// E453 where the equations of a scheme stand within a step and states are renewed at its end. E457 for explicit steps
    /// without a mass.
    fn unfit_scheme(&mut self, scheme: Scheme, statement: &wfl::Scheme) {
        let state = self.fields.iter().find(|f| f.kind == FieldKind::State);
        if scheme == Scheme::Explicit && !self.env.rates.contains(&RateForm::Second) {
            let d = Diagnostic::new(Code::E457, "explicit steps need a mass, and no term has `Dot2_`");
            self.diagnostics.push(d.at(statement.name.span, "").help("rho*Dot2_u.Test_u, or scheme backward_euler"));
        }
        if let (Scheme::Alpha(_), Some(state)) = (scheme, state) {
            let name = &statement.name;
            let d =
                Diagnostic::new(Code::E453, format!("`scheme {}` cannot renew the state `{}`", name.name, state.name));
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
                let d = Diagnostic::new(Code::E434, format!("two initial rates of `{name}`"));
                self.diagnostics.push(d.at(field.span, ""));
                continue;
            }
            let k = self.fields.iter().position(|f| f.name == *name);
            let is_second = k.is_some_and(|k| self.env.rates.get(k) == Some(&RateForm::Second));
            if k.is_some() && !is_second && is_written(script, name) {
                // switched off by a factor: nothing starts
                continue;
            }
            if !is_second {
                let d = Diagnostic::new(Code::E454, format!("`Dot_{name}` has no initial value of its own"));
                let text = format!("no term has `Dot2_{name}`: the rate at the start follows from the equations");
                self.diagnostics.push(d.at(field.span, text));
                continue;
            }
            list.push((name.clone(), value.clone()));
        }
        let mut known = self.nodal_values("the first rate of", list);
        for start in &script.starts {
            if let StartKind::File { path, path_span } = &start.kind {
                let more = self.rates_from(path, *path_span, &known);
                known.extend(more);
            }
        }
        known
    }
}

/// A limit as it is told.
fn short(x: f64) -> String {
    if x.fract() == 0.0 { format!("{x}") } else { format!("{x:.4}") }
}
