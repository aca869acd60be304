//! Operators: sums, products and powers, with the shapes and test functions that each needs.
//!
//! A product is read from left to right as in GWFL; every pair that does not fit is told with both shapes.

use wfl::{
    Code, Diagnostic, Span,
    ast::{Expr, ExprKind, MulOp},
    quote_without_tests,
};

use crate::{
    build::Builder,
    effect::vanishes,
    graph::{Arity, ExprId},
    ops,
    types::{MAX_ENTRIES, MAX_RANK, Shape},
};

/// Summands, factors and conditions that are joined one after the other, from left to right as written; longer lists are
/// cut into parts of this length. No scene of a person has such a list, so that its rounding does not change.
pub(super) const LONGEST_CHAIN: usize = 1000;

impl Builder<'_> {
    pub(super) fn sum(&mut self, e: &Expr, parts: &[(bool, Expr)]) -> Option<ExprId> {
        let built: Vec<Option<ExprId>> = parts.iter().map(|(_, p)| self.expr(p)).collect();
        // a long sum is one of parts: as a single chain it would be as deep as it is long
        let (mut done, mut total, mut count) = (None, None, 0);
        for (k, ((minus, _), value)) in parts.iter().zip(built).enumerate() {
            let value = value?;
            let value = match total.or(done) {
                Some(sum) => self.summand(e, sum, value, &parts[k - 1..=k])?,
                None => value,
            };
            total = Some(match (total, minus) {
                (None, true) => self.graph.neg(value),
                (None, false) => value,
                (Some(sum), true) => self.graph.sub(sum, value),
                (Some(sum), false) => self.graph.add(sum, value),
            });
            count += 1;
            if count == LONGEST_CHAIN {
                done = self.added(done, total);
                (total, count) = (None, 0);
            }
        }
        self.added(done, total)
    }

    fn added(&mut self, a: Option<ExprId>, b: Option<ExprId>) -> Option<ExprId> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.graph.add(a, b)),
            (a, b) => a.or(b),
        }
    }

    /// Checks that `value` may be added to `sum`; returns it with the shape of `sum`. `parts` are the last summand of `sum`
    /// and the one with this value.
    fn summand(&mut self, e: &Expr, sum: ExprId, value: ExprId, parts: &[(bool, Expr)]) -> Option<ExprId> {
        let [(_, before), (minus, part)] = parts else { return None };
        let minus = *minus;
        let (a, b) = (self.graph.shape(sum), self.graph.shape(value));
        let word = if minus { "subtract" } else { "add" };
        let one_number = a.is_scalar_like() && b.is_scalar_like();
        let value = if one_number { self.graph.reshape(value, a) } else { value };
        if a != b && !one_number {
            let (article_a, article_b) = (kind_word(a), kind_word(b));
            let message = match (minus, article_a == article_b) {
                (_, true) => format!("cannot {word} {b} {} {a}", if minus { "from" } else { "to" }),
                (true, _) => format!("cannot subtract a {article_b} from a {article_a}"),
                (false, _) => format!("cannot add a {article_b} to a {article_a}"),
            };
            let d = Diagnostic::new(Code::E101, message);
            let d = self.at_operand(d, e, before, a.to_string());
            let mut d = self.at_operand(d, e, part, b.to_string());
            if let ExprKind::Product(first, rest) = &part.kind
                && let Some((op, _, last)) = rest.last()
                && matches!(op, MulOp::Dot | MulOp::DoubleDot)
                && part.expansion == e.expansion
            {
                let sign = if minus { "-" } else { "+" };
                let op = if *op == MulOp::Dot { "." } else { ":" };
                let end = self.text_of(e, last);
                d = d.note(format!("`{op}` binds tighter than `{sign}`, so only the second part meets {end}"));
                if rest.len() == 1 {
                    let (before, first) = (self.text_of(e, before), self.text_of(e, first));
                    d = d.help(format!("({before} {sign} {first}){op}{end}"));
                }
            }
            self.diagnostics.push(d);
            return None;
        }
        let (x, y) = (self.graph.arity(sum), self.graph.arity(value));
        if x != y && !self.graph.is_zero(sum) && !self.graph.is_zero(value) {
            let culprit = if y == Arity::NONE || (y.test && !y.trial && x.trial) { part } else { before };
            let d = Diagnostic::new(Code::E302, "part of this term has no test function");
            let d = self.at_operand(d, e, culprit, "no Test_ in this summand");
            let d = d.help("if it is a potential to be minimised, write `energy` in place of `term`");
            self.diagnostics.push(d);
            return None;
        }
        Some(value)
    }

    pub(super) fn product(&mut self, e: &Expr, first: &Expr, rest: &[(MulOp, Span, Expr)]) -> Option<ExprId> {
        let outside = self.without_effect;
        self.without_effect |= vanishes(self.env.params, e);
        let made = if rest.len() > LONGEST_CHAIN {
            self.long_product(e, first, rest)
        } else {
            self.short_product(e, first, rest)
        };
        self.without_effect = outside;
        made
    }

    fn short_product(&mut self, e: &Expr, first: &Expr, rest: &[(MulOp, Span, Expr)]) -> Option<ExprId> {
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

    /// A product of many factors: scalars that follow each other are multiplied in parts first, so that it is not as deep as
    /// it is long.
    fn long_product(&mut self, e: &Expr, first: &Expr, rest: &[(MulOp, Span, Expr)]) -> Option<ExprId> {
        let mut left = self.expr(first)?;
        // scalars that are multiplied with `left` later: their product, the last of them, how many
        let mut part: Option<(ExprId, &Expr, usize)> = None;
        let mut before = first;
        for (op, _, factor) in rest {
            let right = self.expr(factor)?;
            let joins = *op == MulOp::Times && self.graph.shape(right).is_scalar_like();
            part = match part {
                Some((product, last, n)) if joins && n < LONGEST_CHAIN => {
                    let product = self.multiply(e, MulOp::Times, product, right, last, factor)?;
                    Some((product, factor, n + 1))
                }
                full => {
                    if let Some((product, last, _)) = full {
                        left = self.multiply(e, MulOp::Times, left, product, before, last)?;
                        before = last;
                    }
                    if joins {
                        Some((right, factor, 1))
                    } else {
                        left = self.multiply(e, *op, left, right, before, factor)?;
                        before = factor;
                        None
                    }
                }
            };
        }
        match part {
            Some((product, last, _)) => self.multiply(e, MulOp::Times, left, product, before, last),
            None => Some(left),
        }
    }

    fn multiply(&mut self, e: &Expr, op: MulOp, a: ExprId, b: ExprId, ea: &Expr, eb: &Expr) -> Option<ExprId> {
        let (ta, tb) = (self.graph.arity(a), self.graph.arity(b));
        if matches!(op, MulOp::Divide | MulOp::DivideByComponent) {
            if tb != Arity::NONE {
                let d = Diagnostic::new(Code::E303, "a test function cannot be divided by");
                return self.report(d, eb, "test function in the denominator");
            }
        } else if (ta.test && tb.test) || (ta.trial && tb.trial) {
            let d = Diagnostic::new(Code::E301, "a term must be linear in the test functions");
            let d = self.at_operand(d, e, ea, "");
            let d = self.at_operand(d, e, eb, "second test function in the same product");
            let known = quote_without_tests(self.operand(e, ea).span);
            let sign = sign_of(op);
            let d = d.help(format!("one of the two is the unknown: {known}{sign}{}", self.text_of(e, eb)));
            self.diagnostics.push(d);
            return None;
        }
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        match op {
            MulOp::Times => self.times(e, a, b, ea, eb),
            MulOp::Divide => {
                if !sb.is_scalar_like() {
                    let d = Diagnostic::new(Code::E109, format!("cannot divide by a {sb}"))
                        .help("`./` divides component by component");
                    return self.report(d, eb, sb.to_string());
                }
                if self.graph.scalar_constant(b) == Some(0.0) {
                    if self.dead {
                        return Some(a);
                    }
                    let d = Diagnostic::new(Code::E109, "division by zero");
                    return self.report(d, eb, "this is 0");
                }
                Some(self.graph.divide(a, b))
            }
            MulOp::Dot => self.dot(e, a, b, ea, eb),
            MulOp::DoubleDot => self.double_dot(e, a, b, ea, eb),
            MulOp::Outer => self.outer(a, b, ea, eb),
            MulOp::ByComponent | MulOp::DivideByComponent => {
                let sign = if op == MulOp::ByComponent { ".*" } else { "./" };
                if sa != sb && !(sa.is_scalar_like() && sb.is_scalar_like()) {
                    return self.bad_pair(e, sign, "equal shapes", ea, sa, eb, sb, None);
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
        e: &Expr,
        op: &str,
        needs: &str,
        ea: &Expr,
        sa: Shape,
        eb: &Expr,
        sb: Shape,
        help: Option<&str>,
    ) -> Option<ExprId> {
        let mut d = Diagnostic::new(Code::E102, format!("`{op}` needs {needs}, found {sa} and {sb}"));
        d = self.at_operand(d, e, eb, sb.to_string());
        d = self.at_operand(d, e, ea, sa.to_string());
        if let Some(h) = help {
            d = d.help(h);
        }
        self.diagnostics.push(d);
        None
    }

    fn times(&mut self, e: &Expr, a: ExprId, b: ExprId, ea: &Expr, eb: &Expr) -> Option<ExprId> {
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
                let d = Diagnostic::new(Code::E102, "`*` does not multiply two vectors");
                let d = if sa == sb {
                    let d = self.at_operand(d, e, eb, format!("{sb} on both sides"));
                    self.at_operand(d, e, ea, "")
                } else {
                    let d = self.at_operand(d, e, eb, sb.to_string());
                    self.at_operand(d, e, ea, sa.to_string())
                };
                let (u, v) = (self.text_of(e, ea), self.text_of(e, eb));
                let d = d.help(format!(
                    "`{u}.{v}` for the scalar product, `{u}@{v}` for the tensor product, `{u}.*{v}` for component by \
                     component"
                ));
                let operator = match &e.kind {
                    ExprKind::Product(_, rest) => rest.iter().find(|r| std::ptr::eq(&raw const r.2, eb)).map(|r| r.1),
                    _ => None,
                };
                self.diagnostics.push(match operator {
                    Some(operator) if sa == sb => d.replace(operator, "."),
                    _ => d,
                });
                None
            }
            _ => self.bad_pair(
                e,
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

    fn dot(&mut self, e: &Expr, a: ExprId, b: ExprId, ea: &Expr, eb: &Expr) -> Option<ExprId> {
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        match (sa.rank(), sb.rank()) {
            (0, 0) => Some(self.graph.scale(a, b)),
            (0, _) | (_, 0) if sa.is_scalar_like() && sb.is_scalar_like() => Some(self.graph.scale(a, b)),
            (0, _) | (_, 0) => {
                self.bad_pair(e, ".", "two tensors to contract", ea, sa, eb, sb, Some("`*` multiplies by a scalar"))
            }
            (m, n) if sa.size(m - 1) == sb.size(0) => {
                self.fits(m + n - 2, sa.len() / sb.size(0) * (sb.len() / sb.size(0)), ea)?;
                Some(self.graph.contract(a, b, &[(m - 1, 0)]))
            }
            _ => self.bad_pair(
                e,
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

    fn double_dot(&mut self, e: &Expr, a: ExprId, b: ExprId, ea: &Expr, eb: &Expr) -> Option<ExprId> {
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        match (sa.rank(), sb.rank()) {
            (0, 0) => Some(self.graph.scale(a, b)),
            (1, 1) if sa == sb => Some(self.graph.contract(a, b, &[(0, 0)])),
            (m, n) if m >= 2 && n >= 2 && sa.size(m - 2) == sb.size(0) && sa.size(m - 1) == sb.size(1) => {
                let inner = sb.size(0) * sb.size(1);
                self.fits(m + n - 4, sa.len() / inner * (sb.len() / inner), ea)?;
                Some(self.graph.contract(a, b, &[(m - 2, 0), (m - 1, 1)]))
            }
            _ => self.bad_pair(
                e,
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
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        self.fits(sa.rank() + sb.rank(), sa.len() * sb.len(), ea)?;
        Some(self.graph.contract(a, b, &[]))
    }

    fn fits(&mut self, rank: usize, entries: usize, e: &Expr) -> Option<()> {
        if rank <= MAX_RANK && entries <= MAX_ENTRIES {
            return Some(());
        }
        let text = if rank > MAX_RANK {
            format!("a tensor with {rank} indices is too large: {MAX_RANK} at most")
        } else {
            format!("a tensor with {entries} entries is too large: {MAX_ENTRIES} at most")
        };
        self.report(Diagnostic::new(Code::E110, text), e, "")
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

    pub(super) fn power(&mut self, a: &Expr, b: &Expr) -> Option<ExprId> {
        let (base, exponent) = (self.expr(a), self.expr(b));
        let (base, exponent) = (base?, exponent?);
        self.no_tests(a, base, "^")?;
        self.no_tests(b, exponent, "^")?;
        if !self.graph.shape(base).is_scalar_like() || !self.graph.shape(exponent).is_scalar_like() {
            let d = Diagnostic::new(Code::E108, "`^` takes a scalar and a scalar")
                .help("pow(v, p) acts component by component");
            return self.report(d, a, self.graph.shape(base).to_string());
        }
        let (base, exponent) = (self.graph.to_scalar(base), self.graph.to_scalar(exponent));
        Some(ops::power(&mut self.graph, base, exponent))
    }
}

/// The operator as it is written.
pub(crate) fn sign_of(op: MulOp) -> &'static str {
    match op {
        MulOp::Times => "*",
        MulOp::Divide => "/",
        MulOp::Dot => ".",
        MulOp::DoubleDot => ":",
        MulOp::Outer => "@",
        MulOp::ByComponent => ".*",
        MulOp::DivideByComponent => "./",
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
