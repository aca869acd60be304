//! Syntax to typed graph: names are looked up, shapes and test functions checked, every problem reported.
//!
//! A [`Builder`] works on one term (or one other expression) on one place. It returns `None` after an error and
//! goes on with the neighbours, so one run reports all of them. Formulas of functions are in `ops/`.

use std::collections::BTreeMap;

use wfl::{
    Diagnostic, Span,
    ast::{Argument, CmpOp, Cond, CondKind, Expansions, Expr, ExprKind, MulOp},
    nearest,
};

use crate::{
    derive::derive,
    graph::{Arity, ExprId, Graph, Leaf, Role},
    ir::{Compare, Origin},
    ops,
    types::{FieldId, FieldKind, FieldOp, FieldSig, PlaceKind, PlaceSig, Shape, Side},
};

/// A named constant tensor.
#[derive(Clone, Debug)]
pub struct Constant {
    /// Its shape.
    pub shape: Shape,
    /// Its entries, first index fastest.
    pub values: Vec<f64>,
    /// Where it is declared, for messages.
    pub declared: Option<Span>,
}

/// What every expression of a scene can see.
#[derive(Clone, Debug)]
pub struct Env<'a> {
    /// Space dimension.
    pub dim: usize,
    /// Fields, by [`FieldId`].
    pub fields: &'a [FieldSig],
    /// Parameters by name.
    pub params: &'a BTreeMap<String, Constant>,
    /// Macro uses, so that messages can show them.
    pub expansions: &'a Expansions,
    /// The variable of `steps`, if written.
    pub step_variable: Option<&'a str>,
    /// Two coordinates are equal in a condition when they differ by at most this (a length).
    pub equal_within: f64,
}

/// Builds the graph of one expression on one place.
pub struct Builder<'a> {
    pub(crate) env: &'a Env<'a>,
    pub(crate) place: &'a PlaceSig,
    /// The graph so far.
    pub graph: Graph,
    /// What was found.
    pub diagnostics: Vec<Diagnostic>,
    /// Conditions compare coordinates within `equal_within`.
    pub(crate) loose_equality: bool,
    /// Role of plain field names: `Current`, except below `Previous`.
    pub(crate) order2: bool,
}

/// A call of a function, ready for `ops/`.
pub(crate) struct Call<'c> {
    pub(crate) name: &'c str,
    pub(crate) expr: &'c Expr,
    pub(crate) args: &'c [Argument],
}

impl<'a> Builder<'a> {
    /// A builder on `place`.
    #[must_use]
    pub fn new(env: &'a Env<'a>, place: &'a PlaceSig) -> Self {
        Self {
            env,
            place,
            graph: Graph::new(env.dim, env.fields),
            diagnostics: Vec::new(),
            loose_equality: false,
            order2: false,
        }
    }

    /// In conditions on positions `==` means "within `equal_within`".
    #[must_use]
    pub fn with_loose_equality(mut self) -> Self {
        self.loose_equality = true;
        self
    }

    /// A diagnostic at an expression: inside a macro the use is the primary place and the body the second.
    #[must_use]
    pub fn at(&self, diagnostic: Diagnostic, e: &Expr, text: impl Into<String>) -> Diagnostic {
        locate(diagnostic, Origin { span: e.span, expansion: e.expansion }, self.env.expansions, text)
    }

    pub(crate) fn report<T>(&mut self, diagnostic: Diagnostic, e: &Expr, text: impl Into<String>) -> Option<T> {
        let diagnostic = self.at(diagnostic, e, text);
        if !self.diagnostics.contains(&diagnostic) {
            self.diagnostics.push(diagnostic);
        }
        None
    }

    /// The graph node of an expression; `None` after errors.
    pub fn expr(&mut self, e: &Expr) -> Option<ExprId> {
        let origin = Some(Origin { span: e.span, expansion: e.expansion });
        let before = self.graph.set_origin(origin);
        let built = self.kind(e);
        self.graph.set_origin(before);
        built
    }

    fn kind(&mut self, e: &Expr) -> Option<ExprId> {
        match &e.kind {
            ExprKind::Number(x) => Some(self.graph.number(*x)),
            ExprKind::Name(name) => self.name(e, name),
            ExprKind::Sum(parts) => self.sum(parts),
            ExprKind::Product(first, rest) => self.product(e, first, rest),
            ExprKind::Negate(a) => {
                let a = self.expr(a)?;
                Some(self.graph.neg(a))
            }
            ExprKind::Power(a, b) => self.power(a, b),
            ExprKind::Transpose(a) => {
                let x = self.expr(a)?;
                Some(self.transpose(x))
            }
            ExprKind::Call(callee, args) => self.call(e, callee, args),
            ExprKind::Tensor(rows) => self.tensor(e, rows),
            ExprKind::If(cond, a, b) => {
                let mask = self.condition(cond);
                let (a_built, b_built) = (self.expr(a), self.expr(b));
                let (mask, x, y) = (mask?, a_built?, b_built?);
                let (x, y) = self.same_shape(e, x, y, "the two branches of `if`")?;
                for (part, x) in [(a, x), (b, y)] {
                    self.no_tests(part, x, "if")?;
                }
                Some(self.graph.select(mask, x, y))
            }
        }
    }

    // ---- names ----------------------------------------------------------------------------------------------

    fn name(&mut self, e: &Expr, name: &str) -> Option<ExprId> {
        if let Some(c) = self.env.params.get(name) {
            return Some(self.graph.constant(c.shape, &c.values));
        }
        if self.field_id(name).is_some() {
            return self.field_word(e, name, Side::Here);
        }
        let component = |this: &mut Self, k: usize| {
            if k < this.env.dim {
                let x = this.graph.leaf(Leaf::X);
                Some(this.graph.pick(x, &[Some(k)]))
            } else {
                let d = Diagnostic::new("E205", format!("`{name}` does not exist in {} dimensions", this.env.dim));
                this.report(d, e, "")
            }
        };
        match name {
            "pi" => return Some(self.graph.number(std::f64::consts::PI)),
            "meshdim" => {
                #[expect(clippy::cast_precision_loss, reason = "the dimension is 1 to 3")]
                return Some(self.graph.number(self.env.dim as f64));
            }
            "X" => return Some(self.graph.leaf(Leaf::X)),
            "x" => return component(self, 0),
            "y" => return component(self, 1),
            "z" => return component(self, 2),
            "Normal" | "element_size" | "element_K" | "element_B" => return self.geometry(e, name, Side::Here),
            "timestep" => {
                if self.env.step_variable.is_none() {
                    let d = Diagnostic::new("E206", "`timestep` needs a `steps` statement");
                    return self.report(d, e, "");
                }
                return Some(self.graph.leaf(Leaf::TimeStep));
            }
            _ if Some(name) == self.env.step_variable => return Some(self.graph.leaf(Leaf::Time)),
            "t" => {
                let d = Diagnostic::new("E206", "`t` exists only if the scene says `steps t = ...`");
                return self.report(d, e, "");
            }
            _ => {}
        }
        if let Some(word) = FieldWord::split(name)
            && word.has_prefix()
        {
            return self.field_word(e, name, Side::Here);
        }
        if ops::find(name).is_some() {
            let d = Diagnostic::new("E105", format!("`{name}` is a function and needs its arguments"))
                .help(format!("{name}(...)"));
            return self.report(d, e, "");
        }
        self.unknown_name(e, name)
    }

    fn unknown_name<T>(&mut self, e: &Expr, name: &str) -> Option<T> {
        if ops::NOT_SUPPORTED.contains(&name) {
            let d = Diagnostic::new("E801", format!("`{name}` is GWFL this program does not have"))
                .help("`wfl explain E801` lists what is left out and what to write in its place");
            return self.report(d, e, "");
        }
        let env = self.env;
        let fixed = ["pi", "meshdim", "X", "x", "y", "z", "Normal", "element_size", "timestep"];
        let known = env.params.keys().map(String::as_str);
        let known = known.chain(env.fields.iter().map(|f| f.name.as_str()));
        let known = known.chain(fixed).chain(env.step_variable).chain(ops::names().map(|n| -> &str { n }));
        let text = match nearest(name, known) {
            Some(k) => format!("did you mean `{k}`?"),
            None => "not a parameter, field, macro or built-in name".to_owned(),
        };
        let d = Diagnostic::new("E201", format!("unknown name `{name}`"));
        self.report(d, e, text)
    }

    /// The field of that name.
    pub(crate) fn field_id(&self, name: &str) -> Option<FieldId> {
        self.env.fields.iter().position(|f| f.name == name).map(FieldId::new)
    }

    /// `Normal`, `element_size`, ... on a side.
    pub(crate) fn geometry(&mut self, e: &Expr, name: &str, side: Side) -> Option<ExprId> {
        let on_cells = matches!(self.place.kind, PlaceKind::Cells);
        if self.place.kind == PlaceKind::Global || (on_cells && name == "Normal") {
            let (code, text) =
                if name == "Normal" { ("E204", "exists on faces only") } else { ("E204", "needs a cell") };
            let d = Diagnostic::new(code, format!("`{name}` {text}"));
            let place = format!("`{}` is {}", self.place.name, self.place.description);
            return self.report(d, e, place);
        }
        Some(self.graph.leaf(match name {
            "Normal" => Leaf::Normal(side),
            "element_size" => Leaf::ElementSize(side),
            "element_K" => Leaf::ElementK(side),
            _ => Leaf::ElementB(side),
        }))
    }

    /// `u`, `Grad_u`, `Div_Test_u`, `Previous_u`, `Dot_u`, ... on a side.
    pub(crate) fn field_word(&mut self, e: &Expr, name: &str, side: Side) -> Option<ExprId> {
        let word = FieldWord::split(name)?;
        let Some(field) = self.field_id(word.field) else {
            if word.has_prefix() && self.env.params.contains_key(word.field) {
                let what = name.strip_suffix(word.field).unwrap_or(name).trim_end_matches('_').to_owned();
                let d = if word.role == WordRole::Test || word.role == WordRole::Test2 {
                    Diagnostic::new("E304", format!("`{}` is a param, it has no test function", word.field))
                } else {
                    Diagnostic::new("E106", format!("`{what}_` needs a field name, but `{}` is a param", word.field))
                };
                return self.report(d, e, "");
            }
            return self.unknown_name(e, name);
        };
        let sig = &self.env.fields[field.index()];
        if word.is_test() && !sig.is_unknown() {
            let kind = if sig.kind == FieldKind::State { "state" } else { "data" };
            let d = Diagnostic::new("E304", format!("`{}` is {kind}, it has no test function", sig.name));
            return self.report(d, e, "only unknowns and multipliers have one");
        }
        if word.op != WordOp::Value && sig.global {
            let d = Diagnostic::new(
                "E208",
                format!("`{}` is one number for the whole scene: it has no gradient", sig.name),
            );
            return self.report(d, e, "");
        }
        if word.op != WordOp::Value && sig.kind == FieldKind::State {
            let d = Diagnostic::new("E208", format!("`{}` lives at integration points: it has no gradient", sig.name));
            return self.report(d, e, "");
        }
        self.lives_here(e, field, side)?;
        let role = match word.role {
            WordRole::Plain | WordRole::Dot => Role::Current,
            WordRole::Test => Role::Test,
            WordRole::Test2 => {
                self.order2 = true;
                Role::Trial
            }
            WordRole::Previous => Role::Previous,
        };
        if matches!(word.role, WordRole::Previous | WordRole::Dot) && self.env.step_variable.is_none() {
            let d =
                Diagnostic::new("E206", format!("`{name}` needs a `steps` statement: without steps there is no past"));
            return self.report(d, e, "");
        }
        let op = match word.op {
            WordOp::Value => FieldOp::Value,
            WordOp::Grad | WordOp::Div => FieldOp::Grad,
            WordOp::Hess => FieldOp::Hess,
        };
        let shape = sig.shape;
        let mut leaf = self.graph.leaf(Leaf::Field { field, side, op, role });
        if word.role == WordRole::Dot {
            // backward Euler: the rate over the step
            let past = self.graph.leaf(Leaf::Field { field, side, op, role: Role::Previous });
            let change = self.graph.sub(leaf, past);
            let step = self.graph.leaf(Leaf::TimeStep);
            leaf = self.graph.divide(change, step);
        }
        if word.op == WordOp::Div {
            let rank = shape.rank();
            if rank == 0 && self.env.dim == 1 {
                // on a line a scalar is a vector of one component
                return Some(self.graph.entry(leaf, 0));
            }
            if rank == 0 || shape.size(rank - 1) != self.env.dim {
                let d = Diagnostic::new("E108", format!("`{name}` needs as many components as space has dimensions"));
                let text = format!("`{}` is a {shape}, space has {} dimensions", word.field, self.env.dim);
                return self.report(d, e, text);
            }
            return Some(self.graph.trace(leaf, rank - 1, rank));
        }
        Some(leaf)
    }

    fn lives_here(&mut self, e: &Expr, field: FieldId, side: Side) -> Option<()> {
        let sig = &self.env.fields[field.index()];
        if sig.global {
            return Some(());
        }
        let lives = match side {
            Side::Here => self.place.here[field.index()],
            Side::There => self.place.there[field.index()],
        };
        if lives {
            return Some(());
        }
        let name = &sig.name;
        let place = &self.place.name;
        if self.place.kind == PlaceKind::Global {
            let d = Diagnostic::new("E202", format!("`{name}` varies in space, but this term is on `global`"));
            return self.report(d, e, "only numbers and global unknowns have one value");
        }
        let other = match side {
            Side::Here => self.place.there[field.index()],
            Side::There => self.place.here[field.index()],
        };
        let d = if self.place.kind == PlaceKind::Interface && other {
            let d = Diagnostic::new("E202", format!("`{name}` does not live on this side of `{place}`"));
            match side {
                Side::Here => d.help(format!("Interpolate({name}, neighbor_element) is the trace from the other side")),
                Side::There => d.help(format!("`{name}` alone is the trace from this side")),
            }
        } else {
            Diagnostic::new("E202", format!("`{name}` does not live on `{place}`"))
        };
        let text = match (&self.place.here_name, other) {
            (Some(here), true) => format!("`{place}` is integrated from `{here}`"),
            _ => format!("`{place}` is {}", self.place.description),
        };
        self.report(d, e, text)
    }

    // ---- operators ------------------------------------------------------------------------------------------

    fn sum(&mut self, parts: &[(bool, Expr)]) -> Option<ExprId> {
        let built: Vec<Option<ExprId>> = parts.iter().map(|(_, p)| self.expr(p)).collect();
        let mut total: Option<ExprId> = None;
        for (k, ((minus, part), value)) in parts.iter().zip(built).enumerate() {
            let value = value?;
            let Some(sum) = total else {
                total = Some(if *minus { self.graph.neg(value) } else { value });
                continue;
            };
            let value = self.summand(sum, value, *minus, part, &parts[k - 1].1)?;
            total = Some(if *minus { self.graph.sub(sum, value) } else { self.graph.add(sum, value) });
        }
        total
    }

    /// Checks that `value` may be added to `sum`; returns it with the shape of `sum`.
    fn summand(&mut self, sum: ExprId, value: ExprId, minus: bool, part: &Expr, before: &Expr) -> Option<ExprId> {
        let (a, b) = (self.graph.shape(sum), self.graph.shape(value));
        let word = if minus { "subtract" } else { "add" };
        if a != b {
            if a.is_scalar_like() && b.is_scalar_like() {
                return Some(self.graph.reshape(value, a));
            }
            let (article_a, article_b) = (kind_word(a), kind_word(b));
            let message = match (minus, article_a == article_b) {
                (_, true) => format!("cannot {word} {b} {} {a}", if minus { "from" } else { "to" }),
                (true, _) => format!("cannot subtract a {article_b} from a {article_a}"),
                (false, _) => format!("cannot add a {article_b} to a {article_a}"),
            };
            let mut d = Diagnostic::new("E101", message);
            d = self.at(d, part, b.to_string());
            d = self.at(d, before, a.to_string());
            if let ExprKind::Product(first, rest) = &part.kind
                && let Some((op, _, last)) = rest.last()
                && matches!(op, MulOp::Dot | MulOp::DoubleDot)
            {
                let sign = if minus { "-" } else { "+" };
                let op = if *op == MulOp::Dot { "." } else { ":" };
                d = d
                    .note(format!("`{op}` binds tighter than `{sign}`, so only the second part meets {}", brief(last)));
                let _ = first;
                d = d.help(format!("put the sum in parentheses: (a {sign} b){op}{}", brief(last)));
            }
            self.diagnostics.push(d);
            return None;
        }
        let (x, y) = (self.graph.arity(sum), self.graph.arity(value));
        if x != y && !self.graph.is_zero(sum) && !self.graph.is_zero(value) {
            let (culprit, other) =
                if y == Arity::NONE || (y.test && !y.trial && x.trial) { (part, before) } else { (before, part) };
            let d = Diagnostic::new("E302", "part of this term has no test function");
            let d = self.at(d, culprit, "no Test_ in this summand");
            let d = self.at(d, other, "this one has");
            let d = d.help("if it is a potential to be minimised, write `energy` in place of `term`");
            self.diagnostics.push(d);
            return None;
        }
        Some(value)
    }

    fn product(&mut self, e: &Expr, first: &Expr, rest: &[(MulOp, Span, Expr)]) -> Option<ExprId> {
        let mut left = self.expr(first);
        let mut before = first;
        for (op, _, factor) in rest {
            let right = self.expr(factor);
            left = match (left, right) {
                (Some(a), Some(b)) => self.multiply(e, *op, a, b, before, factor),
                _ => None,
            };
            before = factor;
        }
        left
    }

    fn multiply(&mut self, e: &Expr, op: MulOp, a: ExprId, b: ExprId, ea: &Expr, eb: &Expr) -> Option<ExprId> {
        let (ta, tb) = (self.graph.arity(a), self.graph.arity(b));
        if matches!(op, MulOp::Divide | MulOp::DivideByComponent) {
            if tb != Arity::NONE {
                let d = Diagnostic::new("E303", "a test function cannot be divided by");
                return self.report(d, eb, "test function in the denominator");
            }
        } else if (ta.test && tb.test) || (ta.trial && tb.trial) {
            let d = Diagnostic::new("E301", "a term must be linear in the test functions");
            let d = self.at(d, eb, "second test function in the same product");
            let d = self.at(d, ea, "");
            let d = match (test_free(ea), test_free(eb)) {
                (Some(x), Some(y)) => d.help(format!(
                    "one of the two is the unknown: {x} in place of {}, or {y} in place of {}",
                    brief(ea),
                    brief(eb)
                )),
                _ => d.help("one of the two is the unknown"),
            };
            self.diagnostics.push(d);
            return None;
        }
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        match op {
            MulOp::Times => self.times(a, b, ea, eb),
            MulOp::Divide => {
                if !sb.is_scalar_like() {
                    let d = Diagnostic::new("E109", format!("cannot divide by a {sb}"))
                        .help("`./` divides component by component");
                    return self.report(d, eb, sb.to_string());
                }
                if self.graph.scalar_constant(b) == Some(0.0) {
                    let d = Diagnostic::new("E109", "division by zero");
                    return self.report(d, eb, "this is 0");
                }
                Some(self.graph.divide(a, b))
            }
            MulOp::Dot => self.dot(e, a, b, ea, eb),
            MulOp::DoubleDot => self.double_dot(a, b, ea, eb),
            MulOp::Outer => self.outer(a, b, ea, eb),
            MulOp::ByComponent | MulOp::DivideByComponent => {
                let sign = if op == MulOp::ByComponent { ".*" } else { "./" };
                if sa != sb && !(sa.is_scalar_like() && sb.is_scalar_like()) {
                    return self.bad_pair(sign, "equal shapes", ea, sa, eb, sb, None);
                }
                let b = self.graph.reshape(b, sa);
                Some(if op == MulOp::ByComponent {
                    self.graph.mul_components(a, b)
                } else {
                    self.graph.div_components(a, b)
                })
            }
        }
    }

    #[expect(clippy::too_many_arguments, reason = "two operands with their texts and shapes")]
    fn bad_pair(
        &mut self,
        op: &str,
        needs: &str,
        ea: &Expr,
        sa: Shape,
        eb: &Expr,
        sb: Shape,
        help: Option<&str>,
    ) -> Option<ExprId> {
        let mut d = Diagnostic::new("E102", format!("`{op}` needs {needs}, found {sa} and {sb}"));
        d = self.at(d, eb, sb.to_string());
        d = self.at(d, ea, sa.to_string());
        if let Some(h) = help {
            d = d.help(h);
        }
        self.diagnostics.push(d);
        None
    }

    fn times(&mut self, a: ExprId, b: ExprId, ea: &Expr, eb: &Expr) -> Option<ExprId> {
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        if sa.rank() == 0 {
            return Some(self.graph.scale(a, b));
        }
        if sb.rank() == 0 {
            return Some(self.graph.scale(b, a));
        }
        let inner = sa.size(sa.rank() - 1) == sb.size(0);
        match (sa.rank(), sb.rank()) {
            (2, 1 | 2) if inner => Some(self.graph.contract(a, b, &[(1, 0)])),
            (4, 2) if sa.size(2) == sb.size(0) && sa.size(3) == sb.size(1) => {
                Some(self.graph.contract(a, b, &[(2, 0), (3, 1)]))
            }
            _ if sa.is_scalar_like() => Some(self.graph.scale(a, b)),
            _ if sb.is_scalar_like() => Some(self.graph.scale(b, a)),
            (1, 1) => {
                let mut d = Diagnostic::new("E102", "`*` does not multiply two vectors");
                d = self.at(d, eb, if sa == sb { format!("{sb} on both sides") } else { sb.to_string() });
                d = self.at(d, ea, sa.to_string());
                d = d.help(
                    "`u.v` for the scalar product, `u@v` for the tensor product, `u.*v` for component by component",
                );
                self.diagnostics.push(d);
                None
            }
            _ => self.bad_pair(
                "*",
                "a scalar factor, or matrix times vector or matrix of fitting sizes",
                ea,
                sa,
                eb,
                sb,
                Some("`:` contracts two indices, `.` one, `@` none"),
            ),
        }
    }

    fn dot(&mut self, _e: &Expr, a: ExprId, b: ExprId, ea: &Expr, eb: &Expr) -> Option<ExprId> {
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        match (sa.rank(), sb.rank()) {
            (0, 0) => Some(self.graph.scale(a, b)),
            (0, _) | (_, 0) if sa.is_scalar_like() && sb.is_scalar_like() => Some(self.graph.scale(a, b)),
            (0, _) | (_, 0) => {
                self.bad_pair(".", "two tensors to contract", ea, sa, eb, sb, Some("`*` multiplies by a scalar"))
            }
            (m, n) if sa.size(m - 1) == sb.size(0) => {
                self.rank_fits(m + n - 2, ea)?;
                Some(self.graph.contract(a, b, &[(m - 1, 0)]))
            }
            _ => self.bad_pair(
                ".",
                "the last index of the first as long as the first index of the second",
                ea,
                sa,
                eb,
                sb,
                None,
            ),
        }
    }

    fn double_dot(&mut self, a: ExprId, b: ExprId, ea: &Expr, eb: &Expr) -> Option<ExprId> {
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        match (sa.rank(), sb.rank()) {
            (0, 0) => Some(self.graph.scale(a, b)),
            (1, 1) if sa == sb => Some(self.graph.contract(a, b, &[(0, 0)])),
            (m, n) if m >= 2 && n >= 2 && sa.size(m - 2) == sb.size(0) && sa.size(m - 1) == sb.size(1) => {
                self.rank_fits(m + n - 4, ea)?;
                Some(self.graph.contract(a, b, &[(m - 2, 0), (m - 1, 1)]))
            }
            _ => self.bad_pair(
                ":",
                "the last two indices of the first as long as the first two of the second",
                ea,
                sa,
                eb,
                sb,
                None,
            ),
        }
    }

    fn outer(&mut self, a: ExprId, b: ExprId, ea: &Expr, _eb: &Expr) -> Option<ExprId> {
        self.rank_fits(self.graph.shape(a).rank() + self.graph.shape(b).rank(), ea)?;
        Some(self.graph.contract(a, b, &[]))
    }

    fn rank_fits(&mut self, rank: usize, e: &Expr) -> Option<()> {
        if rank <= crate::types::MAX_RANK {
            return Some(());
        }
        let d = Diagnostic::new(
            "E110",
            format!("a tensor with {rank} indices is too large: {} at most", crate::types::MAX_RANK),
        );
        self.report(d, e, "")
    }

    /// Vector to row; matrix transposed; higher: first two indices exchanged.
    pub(crate) fn transpose(&mut self, x: ExprId) -> ExprId {
        let s = self.graph.shape(x);
        match s.rank() {
            0 => x,
            1 => self.graph.reshape(x, Shape::matrix(1, s.size(0))),
            n => {
                let mut perm: Vec<usize> = (0..n).collect();
                perm.swap(0, 1);
                self.graph.permute(x, &perm)
            }
        }
    }

    fn power(&mut self, a: &Expr, b: &Expr) -> Option<ExprId> {
        let (base, exponent) = (self.expr(a), self.expr(b));
        let (base, exponent) = (base?, exponent?);
        self.no_tests(a, base, "^")?;
        self.no_tests(b, exponent, "^")?;
        if !self.graph.shape(base).is_scalar_like() || !self.graph.shape(exponent).is_scalar_like() {
            let d = Diagnostic::new("E108", "`^` takes a scalar and a scalar")
                .help("pow(v, p) acts component by component");
            return self.report(d, a, self.graph.shape(base).to_string());
        }
        let (base, exponent) = (self.graph.to_scalar(base), self.graph.to_scalar(exponent));
        Some(ops::power(&mut self.graph, base, exponent))
    }

    fn tensor(&mut self, e: &Expr, rows: &[Vec<Expr>]) -> Option<ExprId> {
        let mut parts: Vec<Vec<ExprId>> = Vec::new();
        let mut good = true;
        for row in rows {
            let built: Vec<Option<ExprId>> = row.iter().map(|p| self.expr(p)).collect();
            good &= built.iter().all(Option::is_some);
            parts.push(built.into_iter().flatten().collect());
        }
        if !good {
            return None;
        }
        if parts.iter().any(|r| r.len() != parts[0].len()) {
            let d = Diagnostic::new("E108", "the rows of a matrix must be of one length");
            return self.report(d, e, "");
        }
        let inner = self.graph.shape(parts[0][0]);
        for (row, texts) in parts.iter().zip(rows) {
            for (p, text) in row.iter().zip(texts) {
                let s = self.graph.shape(*p);
                if s != inner && !(s.is_scalar_like() && inner.is_scalar_like()) {
                    let d = Diagnostic::new("E108", "the parts of an explicit tensor must be of one shape");
                    return self.report(d, text, s.to_string());
                }
            }
        }
        let (m, n) = (parts.len(), parts[0].len());
        // written by rows, stored with the first index fastest; one row and one column are both vectors
        let ordered: Vec<ExprId> = (0..n).flat_map(|j| (0..m).map(move |i| (i, j))).map(|(i, j)| parts[i][j]).collect();
        if inner.is_scalar_like() {
            let shape = if m == 1 || n == 1 { Shape::new(&[m * n]) } else { Shape::new(&[m, n]) };
            let Some(shape) = shape else {
                let d = Diagnostic::new("E110", "this tensor is too large");
                return self.report(d, e, "");
            };
            let scalars: Vec<ExprId> = ordered.iter().map(|p| self.graph.to_scalar(*p)).collect();
            self.one_arity(e, &scalars)?;
            return Some(self.graph.stack(shape, &scalars));
        }
        if m > 1 && n > 1 {
            let d = Diagnostic::new("E108", "nested lists hold one row or one column of tensors");
            return self.report(d, e, "");
        }
        let Some(shape) = inner.with_last(m * n) else {
            let d = Diagnostic::new("E110", format!("a tensor has {} indices at most", crate::types::MAX_RANK));
            return self.report(d, e, "");
        };
        self.one_arity(e, &ordered)?;
        let mut entries = Vec::with_capacity(shape.len());
        for p in &ordered {
            for k in 0..inner.len() {
                entries.push(self.graph.entry(*p, k));
            }
        }
        Some(self.graph.stack(shape, &entries))
    }

    fn one_arity(&mut self, e: &Expr, parts: &[ExprId]) -> Option<()> {
        let arities: Vec<Arity> =
            parts.iter().filter(|p| !self.graph.is_zero(**p)).map(|p| self.graph.arity(*p)).collect();
        if arities.windows(2).all(|w| w[0] == w[1]) {
            return Some(());
        }
        let d = Diagnostic::new("E302", "some parts of this tensor have a test function and some have none");
        self.report(d, e, "")
    }

    // ---- calls and components -------------------------------------------------------------------------------

    fn call(&mut self, e: &Expr, callee: &Expr, args: &[Argument]) -> Option<ExprId> {
        if let ExprKind::Name(name) = &callee.kind
            && !self.env.params.contains_key(name)
            && self.field_id(name).is_none()
        {
            if let Some(op) = ops::find(name) {
                let n = args.len();
                if n < op.least || n > op.most {
                    let expected =
                        if op.least == op.most { op.least.to_string() } else { format!("{} to {}", op.least, op.most) };
                    let plural = if expected == "1" { "" } else { "s" };
                    let d = Diagnostic::new("E105", format!("`{name}` takes {expected} argument{plural}, {n} given"));
                    return self.report(d, e, op.usage);
                }
                return (op.build)(self, &Call { name, expr: e, args });
            }
            if name.starts_with("Derivative_") {
                return ops::derivative_of(self, &Call { name, expr: e, args });
            }
            let is_value = FieldWord::split(name).is_some_and(|w| w.has_prefix())
                || matches!(name.as_str(), "X" | "Normal" | "element_K" | "element_B");
            if !is_value {
                return self.unknown_name(callee, name);
            }
        }
        let value = self.expr(callee)?;
        self.component(e, value, args)
    }

    fn component(&mut self, e: &Expr, value: ExprId, args: &[Argument]) -> Option<ExprId> {
        let shape = self.graph.shape(value);
        let rank = shape.rank();
        if shape.is_scalar_like() && args.len() == 1 && rank == 0 {
            let index = self.index(&args[0])?;
            if index == Some(1) {
                return Some(value);
            }
        }
        if args.len() != rank {
            let d = Diagnostic::new(
                "E104",
                format!("{} ind{} given for a {shape}", args.len(), if args.len() == 1 { "ex" } else { "ices" }),
            );
            let text = if rank == 0 { "a scalar has no components".to_owned() } else { format!("needs {rank}") };
            return self.report(d, e, text);
        }
        let mut fixed = Vec::with_capacity(rank);
        for (k, arg) in args.iter().enumerate() {
            let size = shape.size(k);
            match self.index(arg)? {
                None => fixed.push(None),
                Some(i) if i >= 1 && i <= size => fixed.push(Some(i - 1)),
                Some(i) => {
                    let Argument::Expr(text) = arg else { return None };
                    let list: Vec<String> = (1..=size.min(6)).map(|k| k.to_string()).collect();
                    let d = Diagnostic::new("E104", format!("index {i} is out of range"))
                        .note("indices start at 1, as in GWFL");
                    return self.report(d, text, format!("{shape} has the components {}", list.join(", ")));
                }
            }
        }
        Some(self.graph.pick(value, &fixed))
    }

    /// A literal index: `Some(None)` for `:`, `Some(Some(i))` for a whole number.
    fn index(&mut self, arg: &Argument) -> Option<Option<usize>> {
        match arg {
            Argument::Slice(_) => Some(None),
            Argument::Expr(a) => self.whole_number(a, "an index").map(Some),
        }
    }

    /// A whole number known when compiling.
    pub(crate) fn whole_number(&mut self, a: &Expr, what: &str) -> Option<usize> {
        let value = self.expr(a)?;
        let number = self.graph.scalar_constant(value);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be small and whole")]
        match number {
            Some(x) if (0.0..=65_535.0).contains(&x) && x.fract() == 0.0 => Some(x as usize),
            _ => {
                let d = Diagnostic::new("E104", format!("{what} must be a whole number known before the run"));
                self.report(d, a, number.map_or("not constant".to_owned(), |x| format!("{x}")))
            }
        }
    }

    // ---- conditions -----------------------------------------------------------------------------------------

    /// The mask of a condition.
    pub fn condition(&mut self, c: &Cond) -> Option<ExprId> {
        match &c.kind {
            CondKind::Compare(first, rest) => {
                let mut left = self.scalar_operand(first);
                let mut all: Option<ExprId> = None;
                for (op, part) in rest {
                    let right = self.scalar_operand(part);
                    let (a, b) = (left?, right?);
                    let mask = self.comparison(*op, a, b);
                    all = Some(all.map_or(mask, |m| self.graph.and(m, mask)));
                    left = Some(b);
                }
                all
            }
            CondKind::And(parts) => self.join(parts, Graph::and),
            CondKind::Or(parts) => self.join(parts, Graph::or),
            CondKind::Not(a) => {
                let a = self.condition(a)?;
                Some(self.graph.not(a))
            }
        }
    }

    fn join(&mut self, parts: &[Cond], f: fn(&mut Graph, ExprId, ExprId) -> ExprId) -> Option<ExprId> {
        let built: Vec<Option<ExprId>> = parts.iter().map(|p| self.condition(p)).collect();
        let mut all: Option<ExprId> = None;
        for b in built {
            let b = b?;
            all = Some(all.map_or(b, |a| f(&mut self.graph, a, b)));
        }
        all
    }

    fn scalar_operand(&mut self, e: &Expr) -> Option<ExprId> {
        let value = self.expr(e)?;
        self.no_tests(e, value, "a comparison")?;
        let shape = self.graph.shape(value);
        if !shape.is_scalar_like() {
            let d = Diagnostic::new("E108", format!("a comparison needs scalars, found a {shape}"));
            return self.report(d, e, shape.to_string());
        }
        Some(self.graph.to_scalar(value))
    }

    fn comparison(&mut self, op: CmpOp, a: ExprId, b: ExprId) -> ExprId {
        let g = &mut self.graph;
        match op {
            CmpOp::Less => g.compare(Compare::Less, a, b),
            CmpOp::LessEqual => g.compare(Compare::LessEqual, a, b),
            CmpOp::Greater => g.compare(Compare::Less, b, a),
            CmpOp::GreaterEqual => g.compare(Compare::LessEqual, b, a),
            CmpOp::Equal | CmpOp::NotEqual if self.loose_equality => {
                let difference = g.sub(a, b);
                let minus = g.neg(difference);
                let tolerance = g.number(self.env.equal_within);
                let above = g.compare(Compare::LessEqual, difference, tolerance);
                let below = g.compare(Compare::LessEqual, minus, tolerance);
                let equal = g.and(above, below);
                if op == CmpOp::Equal { equal } else { g.not(equal) }
            }
            CmpOp::Equal => g.compare(Compare::Equal, a, b),
            CmpOp::NotEqual => g.compare(Compare::NotEqual, a, b),
        }
    }

    // ---- helpers for ops ------------------------------------------------------------------------------------

    /// Refuses test functions inside a nonlinear function.
    pub(crate) fn no_tests(&mut self, e: &Expr, value: ExprId, function: &str) -> Option<()> {
        if self.graph.arity(value) == Arity::NONE {
            return Some(());
        }
        let d = Diagnostic::new("E303", "test function inside a nonlinear function");
        self.report(d, e, format!("`{function}` makes this term nonlinear in the test function"))
    }

    /// Gives two values one shape: a scalar is repeated to fit the other.
    pub(crate) fn same_shape(&mut self, e: &Expr, a: ExprId, b: ExprId, what: &str) -> Option<(ExprId, ExprId)> {
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        if sa == sb {
            return Some((a, b));
        }
        if sa.is_scalar_like() {
            let scalar = self.graph.to_scalar(a);
            return Some((self.graph.fill(scalar, sb), b));
        }
        if sb.is_scalar_like() {
            let scalar = self.graph.to_scalar(b);
            return Some((a, self.graph.fill(scalar, sa)));
        }
        let d = Diagnostic::new("E108", format!("{what} must be of one shape, found {sa} and {sb}"));
        self.report(d, e, "")
    }

    /// The symbolic gradient of an expression: one more index at the end.
    pub(crate) fn gradient(&mut self, e: &Expr, value: ExprId) -> Option<ExprId> {
        let shape = self.graph.shape(value);
        let dim = self.env.dim;
        let Some(result) = shape.with_last(dim) else {
            let d = Diagnostic::new("E110", "the gradient of this tensor has too many indices");
            return self.report(d, e, "");
        };
        if let crate::graph::Node::Leaf(Leaf::Field { field, side, op, role }) = *self.graph.node(value) {
            return self.next_derivative(e, field, side, op, role);
        }
        let mut columns = Vec::with_capacity(dim);
        for k in 0..dim {
            let mut too_high = false;
            let moved = derive(&mut self.graph, value, &mut |g, leaf| match leaf {
                Leaf::X => {
                    let unit: Vec<f64> = (0..dim).map(|i| if i == k { 1.0 } else { 0.0 }).collect();
                    Some(g.constant(Shape::vector(dim), &unit))
                }
                Leaf::Field { field, .. } if g.is_global(field) => None,
                Leaf::Field { field, side, op, role } => {
                    let next = match op {
                        FieldOp::Value => FieldOp::Grad,
                        FieldOp::Grad => FieldOp::Hess,
                        FieldOp::Hess => {
                            too_high = true;
                            return None;
                        }
                    };
                    let full = g.leaf(Leaf::Field { field, side, op: next, role });
                    let rank = g.shape(full).rank();
                    let mut fixed = vec![None; rank];
                    fixed[rank - 1] = Some(k);
                    Some(g.pick(full, &fixed))
                }
                _ => None,
            });
            if too_high {
                let d = Diagnostic::new("E111", "third derivatives of a field are not available");
                return self.report(d, e, "");
            }
            match moved {
                Ok(d) => columns.push(d),
                Err(no) => return self.no_derivative(e, no.what),
            }
        }
        let entries: Vec<ExprId> =
            (0..result.len()).map(|p| self.graph.entry(columns[p / shape.len()], p % shape.len())).collect();
        Some(self.graph.stack(result, &entries))
    }

    fn next_derivative(&mut self, e: &Expr, field: FieldId, side: Side, op: FieldOp, role: Role) -> Option<ExprId> {
        let next = match op {
            FieldOp::Value => FieldOp::Grad,
            FieldOp::Grad => FieldOp::Hess,
            FieldOp::Hess => {
                let d = Diagnostic::new("E111", "third derivatives of a field are not available");
                return self.report(d, e, "");
            }
        };
        Some(self.graph.leaf(Leaf::Field { field, side, op: next, role }))
    }

    pub(crate) fn no_derivative<T>(&mut self, e: &Expr, what: &str) -> Option<T> {
        let d = Diagnostic::new("E111", format!("`{what}` has no second derivative here"));
        self.report(d, e, "needed for the tangent of this expression")
    }
}

/// A diagnostic at a place: inside a macro the outermost use is the primary place and the body the second.
#[must_use]
pub fn locate(diagnostic: Diagnostic, origin: Origin, expansions: &Expansions, text: impl Into<String>) -> Diagnostic {
    let Some(id) = origin.expansion else {
        return diagnostic.at(origin.span, text);
    };
    let inner = &expansions.list[id.index()];
    let mut outer = inner;
    while let Some(parent) = outer.parent {
        outer = &expansions.list[parent.index()];
    }
    let first = diagnostic.labels.is_empty();
    let d = if first { diagnostic.at(outer.call, format!("in this use of `{}`", outer.name)) } else { diagnostic };
    d.at(origin.span, text)
}

/// A short word for an expression in a message.
pub(crate) fn brief(e: &Expr) -> String {
    match &e.kind {
        ExprKind::Name(n) => n.clone(),
        ExprKind::Call(callee, _) => match &callee.kind {
            ExprKind::Name(n) => format!("{n}(...)"),
            _ => "this".to_owned(),
        },
        _ => "this part".to_owned(),
    }
}

fn test_free(e: &Expr) -> Option<String> {
    match &e.kind {
        ExprKind::Name(n) if n.contains("Test_") => Some(n.replacen("Test_", "", 1)),
        _ => None,
    }
}

fn kind_word(s: Shape) -> &'static str {
    match s.rank() {
        0 => "scalar",
        1 => "vector",
        2 => "matrix",
        _ => "tensor",
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum WordOp {
    Value,
    Grad,
    Hess,
    Div,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum WordRole {
    Plain,
    Test,
    Test2,
    Previous,
    Dot,
}

/// `Grad_Test_u` in its parts.
struct FieldWord<'n> {
    op: WordOp,
    role: WordRole,
    field: &'n str,
}

impl<'n> FieldWord<'n> {
    fn split(name: &'n str) -> Option<Self> {
        let (op, rest) = [("Grad_", WordOp::Grad), ("Hess_", WordOp::Hess), ("Div_", WordOp::Div)]
            .iter()
            .find_map(|(p, op)| name.strip_prefix(p).map(|r| (*op, r)))
            .unwrap_or((WordOp::Value, name));
        let (role, field) = [
            ("Test_", WordRole::Test),
            ("Test2_", WordRole::Test2),
            ("Previous_", WordRole::Previous),
            ("Dot_", WordRole::Dot),
        ]
        .iter()
        .find_map(|(p, role)| rest.strip_prefix(p).map(|r| (*role, r)))
        .unwrap_or((WordRole::Plain, rest));
        (!field.is_empty()).then_some(Self { op, role, field })
    }

    fn has_prefix(&self) -> bool {
        self.op != WordOp::Value || self.role != WordRole::Plain
    }

    fn is_test(&self) -> bool {
        matches!(self.role, WordRole::Test | WordRole::Test2)
    }
}
