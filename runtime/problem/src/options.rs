//! The statements `steps` and `solver`: numbers and words with a meaning for the run, no expressions of fields.

use wfl::{
    Code, Diagnostic,
    ast::{OptionItem, OptionValue},
};
use wfl_discrete::{system::System, window::Window};
use wfl_linear::{obstacle, obstacle_of_filter};
use wfl_newton::{LARGEST_PERTURBATION, LARGEST_TOLERANCE, NewtonOptions};
use wfl_sparse::solve::LinearMethod;

use super::{
    Builder, constants,
    demand::{DEFAULT_QUANTITY, LARGEST, SMALLEST, is_accuracy},
};

/// Load or time steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// The name of the variable; `None` for a single solve.
    pub variable: Option<String>,
    /// Its values; the first and the last one where the run chooses the steps between them.
    pub values: Vec<f64>,
    /// What leads from one value to the next, where steps are equal.
    pub equal: Option<Equal>,
    /// How the run chooses its steps, if it does.
    pub auto: Option<Auto>,
    /// The largest order of backward differentiation by value, of steps that another run has chosen; empty for others.
    pub orders: Vec<(f64, usize)>,
    /// Go on after a step that did not converge.
    pub go_on: bool,
    /// How often the increment of a step that does not converge may be halved.
    pub halve: u32,
    /// Something reads a rate or the increment: the first value is where time starts, and nothing is solved there.
    pub from_start: bool,
}

/// The increment of equal steps: what the scene says, and no difference of two values. Far from zero values of the step
/// variable are rounded, their differences lose as many digits, and time that is measured from elsewhere would pass
/// at another rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equal {
    /// The increment.
    pub by: f64,
    /// That of a shorter last step.
    pub last: Option<f64>,
}

impl Equal {
    /// What leads through values that are equally spaced, within their rounding; `None` for others.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let ([first, .., last], n) = (values, values.len()) else { return None };
        #[expect(clippy::cast_precision_loss, reason = "as many steps as memory holds")]
        let (at, by) = (|k: usize| k as f64, (last - first) / (n - 1) as f64);
        let rounding = VALUE_ROUNDING * f64::EPSILON * first.abs().max(last.abs());
        let is_met = |k: usize| (values[k] - (first + at(k) * by)).abs() <= rounding;
        (0..n).all(is_met).then_some(Self { by, last: None })
    }
}

/// How a run chooses its steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Auto {
    /// The first increment.
    pub first: f64,
    /// Largest error of a step: of each field that has a past, relative to the largest change of the field since the start.
    pub error: f64,
    /// Smallest increment; a step of this increment is taken whatever its error.
    pub least: f64,
    /// Largest increment.
    pub most: f64,
    /// What limits the increment behind a state: an expression of measures.
    pub limit: Option<wfl::ast::Expr>,
    /// The fields whose error counts: states, and unknowns that equations compare with an earlier value; all unknowns
    /// where there is none.
    pub fields: Vec<usize>,
}

impl Steps {
    /// A single solve.
    fn one() -> Self {
        Self {
            variable: None,
            values: vec![0.0],
            equal: None,
            auto: None,
            orders: Vec::new(),
            go_on: false,
            halve: DEFAULT_HALVE,
            from_start: false,
        }
    }

    /// True of steps that the text lists: neither this run nor another one has chosen them.
    #[must_use]
    pub fn are_listed(&self) -> bool {
        self.auto.is_none() && self.orders.is_empty()
    }

    /// The first value.
    #[must_use]
    pub fn first(&self) -> f64 {
        self.values.first().copied().unwrap_or(0.0)
    }

    /// The last value.
    #[must_use]
    pub fn last(&self) -> f64 {
        self.values.last().copied().unwrap_or(0.0)
    }

    /// True for more than one step.
    #[must_use]
    pub fn several(&self) -> bool {
        self.values.len() > 1
    }

    /// The first increment; 0 for a single solve.
    #[must_use]
    pub fn first_increment(&self) -> f64 {
        self.auto.as_ref().map_or_else(|| self.increment(1), |auto| auto.first)
    }

    /// The first step.
    #[must_use]
    pub fn first_window(&self) -> Window {
        Window::new(self.first(), self.first_increment())
    }

    /// A listed step by its number; the first one counts as long as the second one.
    #[must_use]
    pub fn window(&self, number: usize) -> Window {
        if number == 0 { self.first_window() } else { Window::new(self.values[number], self.increment(number)) }
    }

    /// The increment that leads to a listed value, by its number; 0 where there is none before it.
    #[must_use]
    pub fn increment(&self, number: usize) -> f64 {
        if number == 0 || number >= self.values.len() {
            return 0.0;
        }
        match self.equal {
            Some(Equal { last: Some(last), .. }) if number + 1 == self.values.len() => last,
            Some(Equal { by, .. }) => by,
            None => self.values[number] - self.values[number - 1],
        }
    }

    /// The longest increment between listed values, without its sign.
    #[must_use]
    pub fn longest_increment(&self) -> f64 {
        (1..self.values.len()).map(|k| self.increment(k).abs()).fold(0.0, f64::max)
    }

    /// How many steps there are, as far as that is known before a run.
    #[must_use]
    pub fn expected(&self) -> usize {
        if self.auto.is_some() { MANY } else { self.values.len() }
    }

    /// How many steps there are; `None` where the run chooses them.
    #[must_use]
    pub fn listed(&self) -> Option<usize> {
        self.auto.is_none().then_some(self.values.len())
    }

    /// Whether a step with this number, counted from 0, that ends at this value is the last one.
    #[must_use]
    pub fn is_last(&self, number: usize, time: f64) -> bool {
        match self.auto {
            Some(_) => number > 0 && time >= self.last(),
            None => number + 1 >= self.values.len(),
        }
    }
}

/// Steps of a run that chooses them, where a number is needed before it.
const MANY: usize = 1000;
/// The first increment where the scene does not say, in parts of the range of the step variable: small enough for what
/// begins fast, and growing by factors of two it costs twenty steps at most.
const FIRST: f64 = 1e-6;
/// The error of a step where the scene does not say.
pub const DEFAULT_STEP_ERROR: f64 = 1e-4;
/// The smallest increment where the scene does not say, in parts of the range.
const LEAST: f64 = 1e-12;
/// Errors of a step that can be asked for: below the smallest one rounding of the state is all that is estimated.
const ERRORS: std::ops::RangeInclusive<f64> = 1e-12..=0.1;

/// Halvings where the scene does not say how many: the smallest part is then 1/32 of an increment.
const DEFAULT_HALVE: u32 = 5;
/// Largest number of halvings.
const MAX_HALVE: f64 = 30.0;
/// Most steps that are not asked about: memory and report keep about 2 kB of each, and as many files lie in a folder as
/// it has steps.
const MOST_STEPS: f64 = 1e5;
/// Largest number of steps: their values alone then take 0.8 GB.
const MAX_STEPS: f64 = 1e8;
/// Steps that miss the last value by this part of a step meet it: the quotient of three rounded numbers is not better
/// known.
const SAME_STEP: f64 = 1e-9;
/// Rounding of a value of the step variable that was computed from the ends of its range, in units of epsilon.
const VALUE_ROUNDING: f64 = 2.0;
/// Rounding of the step variable in units of an increment that formulas of it should not see: a hundredth of a step.
const SEEN: f64 = 0.01;

impl Builder<'_> {
    /// The values of the step variable; `rates` if something reads them.
    pub(super) fn steps(&mut self, rates: bool) -> Option<Steps> {
        let Some(steps) = &self.script.steps else {
            return Some(Steps::one());
        };
        if steps.is_auto() {
            return self.auto_steps(steps, rates);
        }
        let [a, b, c] = [(&steps.from, "the first value"), (&steps.to, "the last value"), (&steps.by, "the step")]
            .map(|(e, what)| constants::number(self.env, what, e, self.diagnostics));
        let (from, to, by) = (a?, b?, c?);
        let Some((count, left)) = whole_steps(from, to, by) else {
            let d =
                Diagnostic::new(Code::E413, format!("steps from {from} to {to} by {by} do not reach the last value"));
            let back = by * (to - from) < 0.0;
            let d = if back { d.help(format!("by {}", -by)).replace(steps.by.span, format!("{}", -by)) } else { d };
            self.diagnostics.push(d.at(steps.by.span, ""));
            return None;
        };
        if rates && count == 0.0 && left.is_none() {
            let d = Diagnostic::new(Code::E413, "a scene with rates needs two values of the step variable");
            let text = "time starts at the first value with the state of `start`; the later values are solved";
            self.diagnostics.push(d.at(steps.span, text));
            return None;
        }
        let (mut go_on, mut halve, mut most) = (false, DEFAULT_HALVE, MOST_STEPS);
        for option in &steps.options {
            match (option.name.name.as_str(), self.option_number(option), word(option)) {
                ("on_fail", _, Some("go_on")) => go_on = true,
                ("on_fail", _, Some("stop")) => go_on = false,
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked in the guard")]
                ("halve", Some(n), _) if n.fract() == 0.0 && (0.0..=MAX_HALVE).contains(&n) => halve = n as u32,
                ("most", Some(n), _) if n.fract() == 0.0 && (1.0..=MAX_STEPS).contains(&n) => most = n,
                (name @ ("count" | "first" | "error" | "limit" | "least"), _, _) => {
                    self.bad_option(option, name, "only steps that the run chooses have it: by auto");
                }
                (name, _, _) => {
                    let known = "halve=0 to halve=30, on_fail=stop, on_fail=go_on, most=100000 to most=1e8";
                    self.bad_option(option, name, known);
                }
            }
        }
        let equal = Equal { by: told_increment(from, to, by, (count, left)), last: left };
        let values = self.listed(steps, [from, to, equal.by], (count, left), most)?;
        let variable = Some(steps.variable.name.clone());
        Some(Steps { variable, values, equal: Some(equal), go_on, halve, from_start: rates, ..Steps::one() })
    }

    /// The values of so many whole steps, and of a shorter one behind them.
    fn listed(
        &mut self,
        steps: &wfl::Steps,
        range: [f64; 3],
        whole: (f64, Option<f64>),
        most: f64,
    ) -> Option<Vec<f64>> {
        let ([from, to, by], (count, left)) = (range, whole);
        let n_steps = count + 1.0 + f64::from(u8::from(left.is_some()));
        if n_steps > most {
            self.diagnostics.push(too_many(steps, from, to, by, n_steps, most));
            return None;
        }
        if !self.resolved(steps, range) {
            return None;
        }
        if let Some(left) = left {
            let d = Diagnostic::new(Code::W410, "the last step is shorter than the others");
            let text = format!("steps of {by} from {from} do not meet {to}: the last one is {} long", short(left));
            self.diagnostics.push(d.at(steps.by.span, text).at(steps.to.span, "met exactly"));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "bounded above"
        )]
        let mut values: Vec<f64> = (0..count as usize).map(|k| from + k as f64 * by).collect();
        values.extend(left.map(|_| from + count * by));
        values.push(to);
        Some(values)
    }

    /// Whether the step variable moves from step to step: E413 where its values are one number, W421 where their rounding
    /// is a part of a step that formulas of it see.
    fn resolved(&mut self, steps: &wfl::Steps, range: [f64; 3]) -> bool {
        let [from, to, by] = range;
        let rounding = f64::EPSILON * from.abs().max(to.abs());
        if rounding <= SEEN * by.abs() {
            return true;
        }
        let name = &steps.variable.name;
        let help = format!("count `{name}` from where the run begins: {name} = 0 to {}", short(to - from));
        if rounding >= by.abs() {
            let d = Diagnostic::new(Code::E413, format!("`{name}` does not move in a step of {by:e}"));
            let text = format!("numbers near {to:e} lie {:.1e} apart", rounding);
            self.diagnostics.push(d.at(steps.by.span, text).help(help));
            return false;
        }
        let part = 100.0 * rounding / by.abs();
        let d = Diagnostic::new(Code::W421, format!("`{name}` is rounded to {part:.0} % of a step"));
        let text = format!("numbers near {to:e} lie {rounding:.1e} apart; formulas of `{name}` are that inexact");
        self.diagnostics.push(d.at(steps.from.span.to(steps.to.span), text).help(help));
        true
    }

    /// Steps that the run chooses.
    fn auto_steps(&mut self, steps: &wfl::Steps, rates: bool) -> Option<Steps> {
        let from = constants::number(self.env, "the first value", &steps.from, self.diagnostics)?;
        let to = constants::number(self.env, "the last value", &steps.to, self.diagnostics)?;
        let span = to - from;
        if span <= 0.0 {
            let d = Diagnostic::new(
                Code::E413,
                format!("steps that the run chooses go forward, and not from {from} to {to}"),
            );
            self.diagnostics.push(d.at(steps.from.span.to(steps.to.span), ""));
            return None;
        }
        let mut auto = Auto {
            first: FIRST * span,
            error: DEFAULT_STEP_ERROR,
            least: LEAST * span,
            most: span,
            limit: None,
            fields: Vec::new(),
        };
        let mut allowed = MOST_STEPS;
        for option in &steps.options {
            if let ("limit", Some(OptionValue::Expr(e))) = (option.name.name.as_str(), &option.value) {
                auto.limit = Some(e.clone());
                continue;
            }
            match (option.name.name.as_str(), self.auto_number(option)) {
                ("first", Some(h)) if h > 0.0 => auto.first = h,
                ("least", Some(h)) if h > 0.0 => auto.least = h,
                ("most", Some(h)) if h > 0.0 => auto.most = h,
                ("error", Some(e)) if ERRORS.contains(&e) => auto.error = e,
                ("count", Some(n)) if (1.0..=MAX_STEPS).contains(&n) => allowed = n,
                (name, _) => {
                    let known = "first, least and most are increments above 0; error=1e-12 to error=0.1; count=100000 \
                                 to count=1e8; limit=0.2*Dc/max(V) on fault";
                    self.bad_option(option, name, known);
                }
            }
        }
        auto.first = auto.first.min(auto.most);
        if auto.least > auto.most {
            let d = Diagnostic::new(
                Code::E413,
                format!("the smallest increment, {}, is above the largest one, {}", auto.least, auto.most),
            );
            self.diagnostics.push(d.at(steps.span, ""));
            return None;
        }
        // explicit steps are equal, and counted where their limit is known
        let explicit = self.script.scheme.as_ref().is_some_and(|s| s.name.name == "explicit");
        let fewest = (span / auto.most * (1.0 - SAME_STEP)).ceil();
        if fewest > allowed && !explicit {
            self.diagnostics.push(too_many_of_auto(steps, fewest, auto.most, allowed));
            return None;
        }
        let variable = Some(steps.variable.name.clone());
        Some(Steps {
            variable,
            values: vec![from, to],
            equal: None,
            auto: Some(auto),
            orders: Vec::new(),
            go_on: false,
            halve: 0,
            from_start: rates,
        })
    }

    /// The number that an option of steps takes, which may be the name of a parameter.
    fn auto_number(&mut self, option: &OptionItem) -> Option<f64> {
        match &option.value {
            Some(OptionValue::Expr(e)) => constants::number(self.env, "an increment", e, self.diagnostics),
            _ => None,
        }
    }

    fn bad_option(&mut self, option: &OptionItem, name: &str, known: &str) {
        let d = Diagnostic::new(Code::E414, format!("option `{name}` is not understood here"));
        self.diagnostics.push(d.at(option.name.span, format!("known: {known}")));
    }

    /// The number given to an option, if it is one.
    fn option_number(&mut self, option: &OptionItem) -> Option<f64> {
        match &option.value {
            Some(OptionValue::Expr(e)) if word(option).is_none() => {
                constants::number(self.env, "an option", e, self.diagnostics)
            }
            _ => None,
        }
    }

    /// What `solver` says: options of Newton, and the demanded error with its quantity.
    pub(super) fn solver_options(&mut self) -> (NewtonOptions, Option<(f64, String)>) {
        let mut options = NewtonOptions::default();
        let Some(solver) = &self.script.solver else { return (options, None) };
        let (mut asked, mut of) = (None, DEFAULT_QUANTITY.to_owned());
        let mut linear = Linear::default();
        for option in &solver.options {
            match (option.name.name.as_str(), self.option_number(option), word(option)) {
                ("tol", Some(t), _) if (0.0..=LARGEST_TOLERANCE).contains(&t) => options.tolerance = t,
                ("tol", Some(t), _) => {
                    let d =
                        Diagnostic::new(Code::E440, format!("`tol` = {t} is not allowed: it lies between 0 and 0.1"));
                    let d = d.at(option.name.span, "the relative residual at which the iteration stops");
                    self.diagnostics.push(d.help("tol=1e-10, or leave it out"));
                }
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked in the guard")]
                ("max_iter", Some(n), _) if n >= 1.0 && n.fract() == 0.0 && n < 1e6 => {
                    options.max_iterations = n as usize;
                }
                ("perturb", Some(size), _) if size > 0.0 && size <= LARGEST_PERTURBATION => {
                    options.perturb = Some(size);
                }
                ("accuracy", Some(e), _) if is_accuracy(e) => asked = Some(e),
                ("of", _, Some(quantity)) => of = quantity.to_owned(),
                ("cg" | "gmres", None, None) if option.value.is_none() => linear.iterative = Some(option),
                ("amg", None, None) if option.value.is_none() => linear.multigrid = Some(option),
                ("direct", None, None) if option.value.is_none() => linear.direct = Some(option),
                ("search", _, Some("auto")) => options.search = true,
                ("search", _, Some("none")) => options.search = false,
                ("accuracy", _, _) => {
                    let d = Diagnostic::new(
                        Code::E414,
                        format!("`accuracy` is a relative error from {SMALLEST:e} to {LARGEST}"),
                    );
                    self.diagnostics.push(d.at(option.name.span, "such as accuracy=1e-3"));
                }
                (name, _, _) => {
                    let known = "tol=1e-10, max_iter=50, search=auto, search=none, perturb=1e-6, accuracy=1e-3, of=L2, direct, cg, \
                         gmres, amg";
                    self.bad_option(option, name, known);
                }
            }
        }
        options.linear = self.linear_method(&linear);
        let word = solver.options.iter().find(|o| o.name.name == "of");
        if let Some(word) = word.filter(|_| asked.is_none()) {
            let d = Diagnostic::new(Code::W411, "`of` selects the quantity of an accuracy, and none is demanded");
            self.diagnostics.push(d.at(word.name.span, "").help("add accuracy=1e-3"));
        }
        (options, asked.map(|error| (error, of)))
    }
}

/// What is said of the method for linear systems.
#[derive(Default)]
struct Linear<'a> {
    iterative: Option<&'a OptionItem>,
    multigrid: Option<&'a OptionItem>,
    direct: Option<&'a OptionItem>,
}

impl Builder<'_> {
    /// What `cg`, `gmres`, `amg` and `direct` ask for.
    fn linear_method(&mut self, said: &Linear<'_>) -> LinearMethod {
        if let (Some(direct), Some(other)) = (said.direct, said.iterative.or(said.multigrid)) {
            let d = Diagnostic::new(Code::E414, format!("`direct` and `{}` exclude each other", other.name.name));
            self.diagnostics.push(d.at(other.name.span, "an iteration").at(direct.name.span, "a factor"));
        }
        if let (None, Some(multigrid)) = (said.iterative, said.multigrid) {
            let d =
                Diagnostic::new(Code::E414, "`amg` is the preconditioner of `cg` and `gmres`, none of which is named");
            self.diagnostics.push(d.at(multigrid.name.span, "").help("cg, amg"));
        }
        match (said.direct, said.iterative) {
            (Some(_), _) => LinearMethod::Direct,
            (None, Some(_)) => LinearMethod::Iterative,
            (None, None) => LinearMethod::Auto,
        }
    }
}

/// E442 where the iteration that is asked for cannot be used.
pub(super) fn unfit_iteration(script: &wfl::ResolvedScript, system: &System) -> Option<Diagnostic> {
    let mut options = script.solver.iter().flat_map(|s| &s.options);
    let word = options.find(|o| ["cg", "gmres"].contains(&o.name.name.as_str()))?;
    let name = word.name.name.as_str();
    let (why, text, other) = match name {
        "cg" => (obstacle(system)?, "conjugate gradients need symmetric positive definite matrices", "gmres"),
        _ => (
            obstacle_of_filter(system)?,
            "the iteration for contact on symmetric bodies, and for a motion with a pressure",
            "cg",
        ),
    };
    let d = Diagnostic::new(Code::E442, format!("`{name}` cannot be used here: {why}"));
    let fits = if name == "cg" { obstacle_of_filter(system) } else { obstacle(system) }.is_none();
    let help = match fits {
        true => format!("write `{other}, amg`, or `direct`"),
        false => format!("leave `{name}` out, or write `direct`"),
    };
    Some(d.at(word.name.span, text).help(help))
}

/// How many whole steps there are, and the length of what is left behind them; `None` where steps lead away, or
/// nowhere.
fn whole_steps(from: f64, to: f64, by: f64) -> Option<(f64, Option<f64>)> {
    let count = (to - from) / by;
    if by == 0.0 || !count.is_finite() || count < -SAME_STEP {
        return None;
    }
    let nearest = count.round();
    let rounding = VALUE_ROUNDING * f64::EPSILON * from.abs().max(to.abs()) / by.abs();
    if (count - nearest).abs() <= rounding.max(SAME_STEP * nearest.max(1.0)) {
        return Some((nearest, None));
    }
    let whole = count.floor();
    Some((whole, Some(to - (from + whole * by))))
}

/// The increment of whole steps: as it is written, where so many of them lead to the last value within the rounding of
/// both ends; else the part of the range that makes them do so.
fn told_increment(from: f64, to: f64, by: f64, whole: (f64, Option<f64>)) -> f64 {
    let (count, left) = whole;
    let rounding = VALUE_ROUNDING * f64::EPSILON * from.abs().max(to.abs());
    if count == 0.0 || left.is_some() || (count * by - (to - from)).abs() <= rounding {
        by
    } else {
        (to - from) / count
    }
}

/// Six digits of a number.
fn short(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

/// E430 for more steps than allowed.
fn too_many(steps: &wfl::Steps, from: f64, to: f64, by: f64, n_steps: f64, most: f64) -> Diagnostic {
    // 1e-7 and not 0.0000001
    let by = if by.abs() < 1e-4 { format!("{by:e}") } else { by.to_string() };
    let d =
        Diagnostic::new(Code::E430, format!("{n_steps} steps from {from} to {to} by {by}, at most {most} are allowed"));
    let d = d.note(
        "report and memory keep about 2 kB of each step; `every` behind the name of an output writes fewer files",
    );
    if n_steps > MAX_STEPS {
        return d.at(steps.by.span, "").help(format!("a scene has at most {MAX_STEPS:e} steps"));
    }
    d.at(steps.by.span, "").help(format!("to allow them: steps ... by {by} with most={n_steps}"))
}

/// E430 for increments so small that the run would choose more steps than allowed.
fn too_many_of_auto(steps: &wfl::Steps, fewest: f64, most: f64, allowed: f64) -> Diagnostic {
    let text = format!("at least {} steps of at most {most:e}, and at most {allowed} are allowed", short(fewest));
    let option = steps.options.iter().find(|o| o.name.name == "most");
    let d =
        Diagnostic::new(Code::E430, text).at(option.map_or(steps.by.span, |o| o.name.span), "the largest increment");
    if fewest > MAX_STEPS {
        return d.help(format!("a larger `most`, or none: a scene has at most {MAX_STEPS:e} steps"));
    }
    d.help(format!("a larger `most`, or none; to allow them: count={}", short((1.1 * fewest).ceil())))
}

fn word(option: &OptionItem) -> Option<&str> {
    match &option.value {
        Some(OptionValue::Expr(e)) => match &e.kind {
            wfl::ast::ExprKind::Name(n) => Some(n),
            _ => None,
        },
        Some(OptionValue::Text(t, _)) => Some(t),
        None => None,
    }
}
