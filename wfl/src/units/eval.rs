//! The unit of every part of an expression, and what does not fit.
//!
//! One [`Pass`] walks a scene once with what is known of the open units (coordinates, time). Where a part still has an
//! open unit nothing is reported; the relation is kept as an equation, from which [`super::infer`] finds the unit.

use std::collections::BTreeMap;

use crate::{
    ast::{Argument, Cond, CondKind, Expr, ExprKind, MulOp},
    codes::Code,
    diag::Diagnostic,
    source::Span,
    walk::each_name,
    words::{PREFIXES, split_prefixes},
};

use super::{
    functions::{Rule, derivative, rule},
    scene::Scene,
    unit::{Ratio, Symbol, Unit, factor_text},
    value::Value,
};

/// What is known of the open units.
#[derive(Clone, Debug, Default)]
pub(super) struct Solved {
    pub(super) length: Option<Unit>,
    /// The relation that says so; whether it is a sum of terms, which says something of each of its parts.
    pub(super) length_from: Option<(Span, Strength)>,
    pub(super) time: Option<Unit>,
    /// The same of time.
    pub(super) time_from: Option<(Span, Strength)>,
    pub(super) volume: Option<Unit>,
}

/// How sure a relation between units is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Strength {
    Strong,
    /// From a plain number or from the sum of terms: asked last.
    Weak,
}

/// A product that has to be 1, with open units in it.
#[derive(Clone, Debug)]
pub(super) struct Equation {
    pub(super) ratio: Unit,
    pub(super) strength: Strength,
    pub(super) at: Span,
}

/// Two operands whose units differ.
pub(super) struct Clash {
    left: Unit,
    right: Unit,
}

/// One walk over a scene.
pub(super) struct Pass<'s> {
    pub(super) scene: &'s Scene<'s>,
    pub(super) solved: Solved,
    /// Units of params, fields, measures and outputs.
    pub(super) units: BTreeMap<&'s str, Value>,
    /// By unknown the unit of its equations, which reactions add up; where it is known.
    pub(super) forces: BTreeMap<String, Unit>,
    pub(super) equations: Vec<Equation>,
    pub(super) diagnostics: Vec<Diagnostic>,
    /// In a statement where a plain number takes the unit that is needed.
    pub(super) plain: bool,
    /// ... that says where something is: a plain number is no factor with a unit there.
    pub(super) located: bool,
}

impl<'s> Pass<'s> {
    pub(super) fn new(scene: &'s Scene<'s>, solved: Solved) -> Self {
        let (units, equations, diagnostics) = (BTreeMap::new(), Vec::new(), Vec::new());
        let forces = BTreeMap::new();
        Self { scene, solved, units, forces, equations, diagnostics, plain: false, located: false }
    }

    pub(super) fn length(&self) -> Unit {
        self.solved.length.clone().unwrap_or_else(|| Unit::of(Symbol::Length))
    }

    pub(super) fn time(&self) -> Unit {
        self.solved.time.clone().unwrap_or_else(|| Unit::of(Symbol::Time))
    }

    pub(super) fn expr(&mut self, e: &Expr) -> Value {
        match &e.kind {
            ExprKind::Number(0.0) => Value::zero(),
            ExprKind::Number(_) => Value::number(),
            ExprKind::Name(word) => self.name(word),
            ExprKind::Sum(parts) => self.sum(e, parts),
            ExprKind::Product(first, rest) => {
                let first = self.expr(first);
                rest.iter().fold(first, |product, (op, _, factor)| {
                    let factor = self.expr(factor);
                    let (product, factor) = self.with_number(product, factor);
                    match op {
                        MulOp::Divide | MulOp::DivideByComponent => product.over(&factor),
                        _ => product.times(&factor),
                    }
                })
            }
            ExprKind::Negate(a) | ExprKind::Transpose(a) => self.expr(a),
            ExprKind::Power(base, exponent) => self.power(e, base, exponent),
            ExprKind::Call(callee, arguments) => self.call(e, callee, arguments),
            ExprKind::Tensor(rows) => self.all_equal(e, "[ ]", &rows.iter().flatten().collect::<Vec<_>>()),
            ExprKind::If(condition, a, b) => {
                self.cond(condition, e);
                self.all_equal(e, "if", &[a, b])
            }
        }
    }

    /// A word: a name of the scene, with prefixes if it is a field, or a word with a meaning of its own.
    fn name(&mut self, word: &str) -> Value {
        if let Some(value) = self.units.get(word) {
            return value.clone();
        }
        let (mut prefixes, root) = split_prefixes(word);
        if prefixes.is_empty() {
            return self.constant(word);
        }
        let Some(mut value) = self.units.get(root).cloned() else {
            return Value::lost();
        };
        let mut outer_first = Vec::new();
        while let Some(prefix) = PREFIXES.iter().find(|p| prefixes.starts_with(**p)) {
            prefixes = &prefixes[prefix.len()..];
            outer_first.push(*prefix);
        }
        for prefix in outer_first.into_iter().rev() {
            value = match prefix {
                "Test_" => Value::test(root),
                "Grad_" | "Div_" => value.scaled(&self.length(), -1),
                "Hess_" => value.scaled(&self.length(), -2),
                "Dot_" => value.scaled(&self.time(), -1),
                "Dot2_" => value.scaled(&self.time(), -2),
                // earlier values, and the increment `Test2_` of a term that is written as a tangent
                _ => value,
            };
        }
        value
    }

    /// Both factors of a product. In a plain statement a number beside coordinates may have any unit, `100*t`, and so has
    /// the product.
    fn with_number(&self, a: Value, b: Value) -> (Value, Value) {
        let is_open = |soft: &Value, number: &Value| soft.soft && !number.named;
        if self.plain && !self.located && (is_open(&a, &b) || is_open(&b, &a)) {
            return (Value::zero(), Value::zero());
        }
        (a, b)
    }

    fn constant(&self, word: &str) -> Value {
        let open = |unit: Option<Unit>| {
            // in a plain statement a formula of the coordinates takes the unit that is needed, as far as it is open
            match unit {
                Some(unit) if self.plain && (self.located || !unit.is_open()) => Value::soft(unit),
                _ if self.plain => Value::zero(),
                unit => Value::of(unit),
            }
        };
        match word {
            "pi" => Value::number(),
            "Normal" | "Conormal" | "meshdim" => Value::of(Some(Unit::pure())),
            _ if self.scene.time == Some(word) => open(Some(self.time())),
            "timestep" => open(Some(self.time())),
            "X" | "x" | "y" | "z" | "element_size" | "element_K" => open(Some(self.length())),
            "element_B" => open(self.length().to_power(Ratio::whole(-1))),
            _ => Value::lost(),
        }
    }

    fn sum(&mut self, e: &Expr, parts: &[(bool, Expr)]) -> Value {
        let mut total: Option<Value> = None;
        for (i, (minus, part)) in parts.iter().enumerate() {
            let value = self.expr(part);
            total = Some(match total {
                None => value,
                Some(left) => match self.join(e.span, &left, &value) {
                    Ok(joined) => joined,
                    Err(clash) => {
                        let first = self.scene.local(&parts[0].1, e);
                        let left = parts[1..i].iter().fold(first, |span, (_, p)| span.to(self.scene.local(p, e)));
                        self.clash(if *minus { "-" } else { "+" }, e, left, part, &clash);
                        Value::lost()
                    }
                },
            });
        }
        total.unwrap_or_else(Value::lost)
    }

    /// Operands that must have one unit, which is the result.
    fn all_equal(&mut self, e: &Expr, what: &str, parts: &[&Expr]) -> Value {
        let mut total: Option<(Value, &Expr)> = None;
        for part in parts {
            let value = self.expr(part);
            total = Some(match total {
                None => (value, part),
                Some((left, at)) => match self.join(e.span, &left, &value) {
                    // the operand that decides the unit is the one to show
                    Ok(joined) => (joined, if left.unit().is_none() || !left.named { part } else { at }),
                    Err(clash) => {
                        let left = self.scene.local(at, e);
                        self.clash(what, e, left, part, &clash);
                        (Value::lost(), part)
                    }
                },
            });
        }
        total.map_or_else(Value::lost, |t| t.0)
    }

    /// The value of a sum of both: equal units are needed where both have the same test function.
    pub(super) fn join(&mut self, at: Span, a: &Value, b: &Value) -> Result<Value, Clash> {
        let mut joined = a.clone();
        joined.named |= b.named;
        joined.soft |= b.soft;
        if a.lost || b.lost {
            joined.lost = true;
            return Ok(joined.map(|_| None));
        }
        for part in &b.parts {
            let Some(known) = joined.parts.iter_mut().find(|k| k.test == part.test) else {
                joined.parts.push(part.clone());
                continue;
            };
            let (Some(left), Some(right)) = (&known.unit, &part.unit) else {
                known.unit = known.unit.take().or_else(|| part.unit.clone());
                continue;
            };
            if self.plain && (!a.named || !b.named) {
                known.unit = if a.named { known.unit.take() } else { part.unit.clone() };
                continue;
            }
            if a.soft || b.soft {
                if !self.may_fit(at, left, right) {
                    return Err(Clash { left: left.clone(), right: right.clone() });
                }
                known.unit = if a.soft { part.unit.clone() } else { known.unit.take() };
                continue;
            }
            let strength = if a.named && b.named { Strength::Strong } else { Strength::Weak };
            if !self.fits(at, left, right, strength) {
                return Err(Clash { left: left.clone(), right: right.clone() });
            }
            if left.is_open() && !right.is_open() {
                known.unit = part.unit.clone();
            }
        }
        Ok(joined)
    }

    /// False for two units of one quantity that differ by a factor. Where something is, they say what coordinates are.
    pub(super) fn may_fit(&mut self, at: Span, left: &Unit, right: &Unit) -> bool {
        let Some(ratio) = left.over(right) else { return true };
        if ratio.is_open() {
            if self.located {
                self.fits(at, left, right, Strength::Strong);
            }
            return true;
        }
        ratio.size().is_none_or(|s| s.has_dimension() || s.is_one())
    }

    /// True if the units are equal as far as they are known.
    pub(super) fn fits(&mut self, at: Span, left: &Unit, right: &Unit, strength: Strength) -> bool {
        let Some(ratio) = left.over(right) else { return true };
        if !ratio.is_open() {
            return ratio.size().is_none_or(|s| s.is_one());
        }
        let fits = self.scene.can_be_one(&ratio);
        // more relations than that say nothing new
        let room = self.equations.len() < 2000;
        if fits && room && !self.equations.iter().any(|q| q.at == at && q.ratio == ratio) {
            self.equations.push(Equation { ratio, strength, at });
        }
        fits
    }

    fn power(&mut self, e: &Expr, base: &Expr, exponent: &Expr) -> Value {
        self.pure(exponent, "^", e);
        let value = self.expr(base);
        match self.scene.constant(exponent).map(Ratio::near) {
            Some(Some(power)) => value.raised(power),
            // no fraction of whole numbers, or not the same everywhere: only a pure number has such a power
            _ => {
                self.needs_pure(&value, base, "^", e);
                Value { named: value.named, ..Value::number() }
            }
        }
    }

    /// Evaluates an expression that has to be a pure number.
    fn pure(&mut self, part: &Expr, what: &str, owner: &Expr) {
        let value = self.expr(part);
        self.needs_pure(&value, part, what, owner);
    }

    fn needs_pure(&mut self, value: &Value, part: &Expr, what: &str, owner: &Expr) {
        let Some(unit) = value.unit().filter(|_| value.named || !self.plain) else { return };
        let unit = unit.clone();
        let fits = match value.soft {
            true => unit.is_open() || self.may_fit(part.span, &unit, &Unit::pure()),
            false => self.fits(part.span, &unit, &Unit::pure(), Strength::Weak),
        };
        if !fits {
            let text = format!("`{what}` needs a pure number");
            let d = Diagnostic::new(Code::E501, text).at(self.scene.local(part, owner), unit.show());
            self.report(d, owner);
        }
    }

    fn call(&mut self, e: &Expr, callee: &Expr, arguments: &[Argument]) -> Value {
        let ExprKind::Name(name) = &callee.kind else {
            return self.expr(callee);
        };
        let given: Vec<&Expr> = arguments.iter().filter_map(argument).collect();
        if let Some((by, function)) = derivative(name) {
            let Some(rule) = rule(function) else { return Value::lost() };
            let value = self.apply(rule, function, e, &given);
            return given.get(by).map_or_else(Value::lost, |a| value.over(&self.expr(a)));
        }
        match rule(name) {
            Some(Rule::Table) => self.table(e, arguments),
            Some(rule) => self.apply(rule, name, e, &given),
            // a component of a field or of a tensor; an unknown function is reported elsewhere
            None => self.expr(callee),
        }
    }

    /// Whether pure numbers that are made of these are such as are written as plain numbers: in a statement where a plain number
    /// takes the unit that is needed, `0.1*sin(2*pi*t/T)` does as `0.1` does.
    fn is_open_formula(&self, given: &[&Expr]) -> bool {
        let mut found = false;
        let is_of_place = |word: &str| matches!(word, "X" | "x" | "y" | "z") || self.scene.time == Some(word);
        given.iter().for_each(|e| each_name(e, &mut |word| found |= is_of_place(word)));
        self.plain && found
    }

    fn apply(&mut self, rule: Rule, name: &str, e: &Expr, given: &[&Expr]) -> Value {
        let (first, second) = (given.first().copied(), given.get(1).copied());
        let value = |pass: &mut Self, a: Option<&Expr>| a.map_or_else(Value::lost, |a| pass.expr(a));
        match rule {
            Rule::Keep => value(self, first),
            Rule::Pure => {
                if !matches!(name, "Id" | "qdim" | "qdims") {
                    value(self, first);
                }
                if self.is_open_formula(given) { Value::number() } else { Value::of(Some(Unit::pure())) }
            }
            Rule::NeedsPure => {
                let value = value(self, first);
                if let Some(a) = first {
                    self.needs_pure(&value, a, name, e);
                }
                Value { named: value.named && !self.is_open_formula(given), ..Value::number() }
            }
            Rule::Power(power) => value(self, first).raised(power),
            Rule::Same => self.all_equal(e, name, given),
            Rule::SameToPure => {
                let named = self.all_equal(e, name, given).named && !self.is_open_formula(given);
                Value { named, ..Value::number() }
            }
            Rule::Multiply => given.iter().fold(Value::number(), |product, a| product.times(&self.expr(a))),
            Rule::Det => {
                let (value, dimension) = (value(self, first), self.scene.dimension);
                value.map(|u| match dimension {
                    Some(n) => u.to_power(Ratio::whole(n)),
                    None => u.same(&Unit::pure()).then(Unit::pure),
                })
            }
            Rule::Pow => match (first, second) {
                (Some(base), Some(exponent)) => self.power(e, base, exponent),
                _ => Value::lost(),
            },
            Rule::Gradient(order) => value(self, first).scaled(&self.length(), -order),
            Rule::Rate => value(self, first).scaled(&self.time(), -1),
            Rule::Filter => value(self, second),
            Rule::Law => self.law(name, e, given),
            Rule::StressAndGradient => {
                if let Some(gradient) = second {
                    self.pure(gradient, name, e);
                }
                value(self, first)
            }
            Rule::Diff => {
                let over = value(self, first).over(&value(self, second));
                given.get(2).map_or(over.clone(), |direction| over.times(&self.expr(direction)))
            }
            Rule::Coulomb => self.coulomb(name, e, given),
            // needs its texts: `call` has them
            Rule::Table => Value::lost(),
        }
    }

    /// A hyperelastic law: its stress has the unit of the first parameter, which may stand among pure numbers.
    fn law(&mut self, name: &str, e: &Expr, given: &[&Expr]) -> Value {
        if let Some(gradient) = given.first() {
            self.pure(gradient, name, e);
        }
        let Some(parameters) = given.get(1) else { return Value::lost() };
        match &parameters.kind {
            ExprKind::Tensor(rows) => {
                let each: Vec<Value> = rows.iter().flatten().map(|p| self.expr(p)).collect();
                each.into_iter().next().unwrap_or_else(Value::lost)
            }
            _ => self.expr(parameters),
        }
    }

    /// `(lambda, n, v, g, f, r)`: `r*v` and `r*g` are stresses like `lambda`.
    fn coulomb(&mut self, name: &str, e: &Expr, given: &[&Expr]) -> Value {
        let [stress, _, velocity, gap, _, factor] = given else { return Value::lost() };
        let values = [stress, velocity, gap, factor].map(|a| self.expr(a));
        for (part, length) in [(velocity, &values[1]), (gap, &values[2])] {
            let scaled = length.times(&values[3]);
            if let Err(clash) = self.join(part.span, &values[0], &scaled) {
                let left = self.scene.local(stress, e);
                self.clash(name, e, left, part, &clash);
                return Value::lost();
            }
        }
        values.into_iter().next().unwrap_or_else(Value::lost)
    }

    /// Checks a condition; `owner` is the expression it belongs to.
    pub(super) fn cond(&mut self, c: &Cond, owner: &Expr) {
        match &c.kind {
            CondKind::Compare(first, rest) => {
                let mut left: &Expr = first;
                let mut value = self.expr(left);
                for (_, right) in rest {
                    let next = self.expr(right);
                    if let Err(clash) = self.join(c.span, &value, &next) {
                        let at = self.scene.local(left, owner);
                        self.clash("a comparison", owner, at, right, &clash);
                    }
                    (left, value) = (right, next);
                }
            }
            CondKind::And(parts) | CondKind::Or(parts) => parts.iter().for_each(|p| self.cond(p, owner)),
            CondKind::Not(a) => self.cond(a, owner),
        }
    }

    /// E501 for two operands: both are marked with their units.
    fn clash(&mut self, what: &str, owner: &Expr, left: Span, right: &Expr, clash: &Clash) {
        let quoted = if what.contains(' ') && what != "[ ]" { what.to_owned() } else { format!("`{what}`") };
        let d = Diagnostic::new(Code::E501, format!("units do not match in {quoted}"));
        let d = d.at(self.scene.local(right, owner), clash.right.show()).at(left, clash.left.show());
        let d = scale_note(d, &clash.left, &clash.right);
        self.report(d, owner);
    }

    /// Checks the value of a statement against the unit of what it is for.
    pub(super) fn takes(&mut self, name: &str, declared: Span, needed: &Value, value: &Value, e: &Expr) {
        if let Err(clash) = self.join(e.span, needed, value) {
            let d = Diagnostic::new(Code::E501, format!("this value does not have the unit of `{name}`"));
            let d = d.at(self.scene.outer(e), clash.right.show()).at(declared, clash.left.show());
            let d = scale_note(d, &clash.left, &clash.right);
            self.report(d, e);
        }
    }

    /// Adds a message, once for each place. In a macro with arguments the use is shown as well.
    pub(super) fn report(&mut self, d: Diagnostic, owner: &Expr) {
        let place = |d: &Diagnostic| d.labels.first().map(|l| l.span);
        if self.diagnostics.iter().any(|x| place(x) == place(&d) && x.message == d.message) {
            return;
        }
        let d = match self.scene.call_with_arguments(owner) {
            Some(call) if d.labels.iter().all(|l| l.span != call) => d.at(call, "from here"),
            _ => d,
        };
        self.diagnostics.push(d);
    }
}

/// Says by what factor two units of one quantity differ.
pub(super) fn scale_note(d: Diagnostic, left: &Unit, right: &Unit) -> Diagnostic {
    let Some(ratio) = left.over(right).filter(|r| !r.is_open()) else { return d };
    match ratio.size() {
        Some(size) if !size.has_dimension() => {
            let (one, other) = if size.log_scale > 0.0 { (left, right) } else { (right, left) };
            let (one, factor, other) = (one.show(), size.log_scale.abs(), other.show());
            if [one.as_str(), other.as_str()].iter().any(|s| s.starts_with("pure number")) {
                return d;
            }
            d.note(format!(
                "the same quantity, but {one} is {} {other}: numbers are not converted",
                factor_text(factor)
            ))
        }
        _ => d,
    }
}

fn argument(a: &Argument) -> Option<&Expr> {
    match a {
        Argument::Expr(e) => Some(e),
        Argument::Slice(_) | Argument::Text(..) => None,
    }
}
