//! Pairs of the grammar to expressions and conditions: precedence is here.
//!
//! The grammar gives an expression as a flat list of signs, values, calls and operators. From low to high:
//! `or`; `and`; `not`; comparisons; `+ -`; `* / . : .* ./ @` (equal, left to right, as in GWFL); signs; `^` (to the
//! right); the words `Sym Skew Trace Deviator Print` written without parentheses; `'` and calls.
//! Comparisons and numbers share this list, so no text is read twice; which of both stands where is checked here.

use super::{NESTING_LIMIT, Pair, Parsed, Rule, statement::Reader, terminal::comparison};
use crate::{
    ast::{Argument, Cond, CondKind, Expr, ExprKind, MulOp},
    codes::Code,
    diag::Diagnostic,
    source::Span,
};

/// A value or a condition, and how deep its tree is.
struct Tree {
    kind: TreeKind,
    depth: usize,
}

enum TreeKind {
    Value(Expr),
    Truth(Cond),
}

impl Tree {
    fn value(self) -> Parsed<(Expr, usize)> {
        match self.kind {
            TreeKind::Value(e) => Ok((e, self.depth)),
            TreeKind::Truth(c) => {
                let d = Diagnostic::new(Code::E122, "a condition stands where a number is needed").at(c.span, "");
                Err(Box::new(d.help("if condition then 1 else 0")))
            }
        }
    }

    fn truth(self) -> Parsed<(Cond, usize)> {
        match self.kind {
            TreeKind::Truth(c) => Ok((c, self.depth)),
            TreeKind::Value(e) => {
                let d = Diagnostic::new(Code::E122, "a number stands where a condition is needed").at(e.span, "");
                Err(Box::new(d.help("compare it: a < b, a == b")))
            }
        }
    }
}

/// A tree one deeper than `inner`, if that is allowed.
fn tree(kind: ExprKind, span: Span, inner: usize) -> Parsed<Tree> {
    let depth = deeper(inner, span)?;
    Ok(Tree { kind: TreeKind::Value(Expr { kind, span, expansion: None }), depth })
}

fn truth_tree(kind: CondKind, span: Span, inner: usize) -> Parsed<Tree> {
    let depth = deeper(inner, span)?;
    Ok(Tree { kind: TreeKind::Truth(Cond { kind, span }), depth })
}

fn deeper(inner: usize, span: Span) -> Parsed<usize> {
    if inner < NESTING_LIMIT {
        return Ok(inner + 1);
    }
    let d = Diagnostic::new(Code::E119, format!("nested more than {NESTING_LIMIT} deep"));
    Err(Box::new(d.at(span, "").help("give parts of it a name: def part = ...")))
}

/// One part of a flat list. What stands in brackets is already read, so that reading the list itself does not
/// recurse and nesting costs little stack.
enum Part<'i> {
    /// A sign, a word, a number, a name or an operator.
    Plain(Pair<'i>),
    /// What stood in parentheses or in a list.
    Value(Box<Tree>),
    /// The arguments of a call, the depth of the deepest, and the place of the parentheses.
    Call(Box<(Vec<Argument>, usize, Span)>),
}

/// The flat list of one expression with a reading position.
struct Flat<'r, 't, 'i> {
    reader: &'r Reader<'t>,
    parts: std::iter::Peekable<std::vec::IntoIter<Part<'i>>>,
    /// `^` inside the exponent of `^`: the only recursion of this list.
    powers: usize,
}

impl Reader<'_> {
    /// The expression of a pair of rule `expr`.
    pub(super) fn value(&self, pair: Pair<'_>) -> Parsed<Expr> {
        Ok(self.tree(pair)?.value()?.0)
    }

    /// The condition of a pair of rule `expr`.
    pub(super) fn cond(&self, pair: Pair<'_>) -> Parsed<Cond> {
        Ok(self.tree(pair)?.truth()?.0)
    }

    fn tree(&self, pair: Pair<'_>) -> Parsed<Tree> {
        let parts = self.parts(pair);
        if let [choice] = parts.as_slice()
            && choice.as_rule() == Rule::choice
        {
            return self.choice(choice.clone());
        }
        let parts = parts.into_iter().map(|p| self.part(p)).collect::<Parsed<Vec<Part<'_>>>>()?;
        Flat { reader: self, parts: parts.into_iter().peekable(), powers: 0 }.disjunction()
    }

    fn part<'i>(&self, pair: Pair<'i>) -> Parsed<Part<'i>> {
        match pair.as_rule() {
            Rule::paren => self.paren(pair),
            Rule::tensor => self.tensor(pair),
            Rule::call => self.call(pair),
            _ => Ok(Part::Plain(pair)),
        }
    }

    fn choice(&self, pair: Pair<'_>) -> Parsed<Tree> {
        let span = self.span(&pair);
        let mut parts = self.parts(pair).into_iter();
        let mut next = || self.tree(parts.next().expect("`if` has three parts"));
        let (cond, c) = next()?.truth()?;
        let (a, x) = next()?.value()?;
        let (b, y) = next()?.value()?;
        tree(ExprKind::If(Box::new(cond), Box::new(a), Box::new(b)), span, c.max(x).max(y))
    }

    /// The value of a number, which must be finite and may be zero only if it is written so.
    pub(super) fn number(&self, pair: &Pair<'_>) -> Parsed<f64> {
        let text = pair.as_str();
        let value: f64 = text.parse().expect("the grammar admits only what f64 reads");
        let mantissa = text.split(['e', 'E']).next().unwrap_or(text);
        let vanished = value == 0.0 && mantissa.contains(|c: char| ('1'..='9').contains(&c));
        if value.is_finite() && !vanished {
            return Ok(value);
        }
        let size = if vanished { "small" } else { "large" };
        let short: String = text.chars().take(40).collect();
        let d = Diagnostic::new(Code::E120, format!("the number `{short}` is too {size}"));
        Err(Box::new(d.at(self.span(pair), "").note("numbers lie between 5e-324 and 1.8e308")))
    }

    /// A number or a name.
    fn atom(&self, pair: &Pair<'_>) -> Parsed<Tree> {
        let span = self.span(pair);
        match pair.as_rule() {
            Rule::number => tree(ExprKind::Number(self.number(pair)?), span, 0),
            _ => tree(ExprKind::Name(pair.as_str().to_owned()), span, 0),
        }
    }

    fn paren<'i>(&self, pair: Pair<'i>) -> Parsed<Part<'i>> {
        let span = self.span(&pair);
        let mut inner = Box::new(self.tree(self.parts(pair).pop().expect("parentheses hold an expression"))?);
        match &mut inner.kind {
            TreeKind::Value(e) => e.span = span,
            TreeKind::Truth(c) => c.span = span,
        }
        Ok(Part::Value(inner))
    }

    fn tensor<'i>(&self, pair: Pair<'i>) -> Parsed<Part<'i>> {
        let span = self.span(&pair);
        let mut depth = 0;
        let mut rows = Vec::new();
        for row in self.parts(pair) {
            let mut entries = Vec::new();
            for entry in self.parts(row) {
                let (e, d) = self.tree(entry)?.value()?;
                depth = depth.max(d);
                entries.push(e);
            }
            rows.push(entries);
        }
        Ok(Part::Value(Box::new(tree(ExprKind::Tensor(rows), span, depth)?)))
    }

    fn call<'i>(&self, pair: Pair<'i>) -> Parsed<Part<'i>> {
        let span = self.span(&pair);
        let mut depth = 0;
        let mut arguments = Vec::new();
        for argument in self.parts(pair) {
            let inner = self.parts(argument).pop().expect("an argument is a slice or an expression");
            if inner.as_rule() == Rule::slice {
                arguments.push(Argument::Slice(self.span(&inner)));
                continue;
            }
            if inner.as_rule() == Rule::string {
                let text = inner.as_str().trim_matches('"').to_owned();
                arguments.push(Argument::Text(text, self.span(&inner)));
                continue;
            }
            let (e, d) = self.tree(inner)?.value()?;
            depth = depth.max(d);
            arguments.push(Argument::Expr(e));
        }
        Ok(Part::Call(Box::new((arguments, depth, span))))
    }
}

impl<'i> Flat<'_, '_, 'i> {
    /// Takes the next operator if it is one of `signs`.
    fn infix(&mut self, signs: &[&str]) -> Option<Pair<'i>> {
        self.plain(|p| p.as_rule() == Rule::infix && signs.contains(&p.as_str()))
    }

    fn take(&mut self, rule: Rule) -> Option<Pair<'i>> {
        self.plain(|p| p.as_rule() == rule)
    }

    fn plain(&mut self, wanted: impl Fn(&Pair<'i>) -> bool) -> Option<Pair<'i>> {
        match self.parts.next_if(|p| matches!(p, Part::Plain(p) if wanted(p))) {
            Some(Part::Plain(pair)) => Some(pair),
            _ => None,
        }
    }

    fn disjunction(&mut self) -> Parsed<Tree> {
        let first = self.conjunction()?;
        self.logic(first, "or", Self::conjunction, CondKind::Or)
    }

    fn conjunction(&mut self) -> Parsed<Tree> {
        let first = self.comparison()?;
        self.logic(first, "and", Self::comparison, CondKind::And)
    }

    fn logic(
        &mut self,
        first: Tree,
        word: &str,
        next: impl Fn(&mut Self) -> Parsed<Tree>,
        make: impl Fn(Vec<Cond>) -> CondKind,
    ) -> Parsed<Tree> {
        if !matches!(self.parts.peek(), Some(Part::Plain(p)) if p.as_rule() == Rule::infix && p.as_str() == word) {
            return Ok(first);
        }
        let (first, mut depth) = first.truth()?;
        let mut span = first.span;
        let mut parts = vec![first];
        while self.infix(&[word]).is_some() {
            let (part, d) = next(self)?.truth()?;
            span = span.to(part.span);
            depth = depth.max(d);
            parts.push(part);
        }
        truth_tree(make(parts), span, depth)
    }

    /// `not`s, then a sum or a chain of comparisons.
    fn comparison(&mut self) -> Parsed<Tree> {
        let mut negated = false;
        let mut start = None;
        while let Some(not) = self.take(Rule::k_not) {
            negated = !negated;
            start.get_or_insert(self.reader.span(&not));
        }
        let inner = self.chain()?;
        let Some(start) = start else {
            return Ok(inner);
        };
        let (mut cond, depth) = inner.truth()?;
        let span = start.to(cond.span);
        if negated {
            return truth_tree(CondKind::Not(Box::new(cond)), span, depth);
        }
        cond.span = span;
        Ok(Tree { kind: TreeKind::Truth(cond), depth })
    }

    fn chain(&mut self) -> Parsed<Tree> {
        let first = self.sum()?;
        let mut pairs = Vec::new();
        let Some(op) = self.infix(COMPARISONS) else {
            return Ok(first);
        };
        let mut op = Some(op);
        let (first, mut depth) = first.value()?;
        let mut span = first.span;
        while let Some(sign) = op {
            let (e, d) = self.sum()?.value()?;
            span = span.to(e.span);
            depth = depth.max(d);
            pairs.push((comparison(sign.as_str()), e));
            op = self.infix(COMPARISONS);
        }
        truth_tree(CondKind::Compare(Box::new(first), pairs), span, depth)
    }

    fn sum(&mut self) -> Parsed<Tree> {
        let first = self.product()?;
        let Some(op) = self.infix(&["+", "-"]) else {
            return Ok(first);
        };
        let mut op = Some(op);
        let (first, mut depth) = first.value()?;
        let mut span = first.span;
        let mut parts = vec![(false, first)];
        while let Some(sign) = op {
            let (e, d) = self.product()?.value()?;
            span = span.to(e.span);
            depth = depth.max(d);
            parts.push((sign.as_str() == "-", e));
            op = self.infix(&["+", "-"]);
        }
        tree(ExprKind::Sum(parts), span, depth)
    }

    fn product(&mut self) -> Parsed<Tree> {
        let first = self.signed()?;
        let Some(op) = self.infix(FACTORS) else {
            return Ok(first);
        };
        let mut op = Some(op);
        let (first, mut depth) = first.value()?;
        let mut span = first.span;
        let mut rest = Vec::new();
        while let Some(sign) = op {
            let (e, d) = self.signed()?.value()?;
            span = span.to(e.span);
            depth = depth.max(d);
            rest.push((factor(sign.as_str()), self.reader.span(&sign), e));
            op = self.infix(FACTORS);
        }
        tree(ExprKind::Product(Box::new(first), rest), span, depth)
    }

    fn signed(&mut self) -> Parsed<Tree> {
        let mut negative = false;
        let mut start = None;
        while let Some(sign) = self.take(Rule::sign) {
            negative ^= sign.as_str() == "-";
            start.get_or_insert(self.reader.span(&sign));
        }
        let inner = self.power()?;
        let Some(start) = start else {
            return Ok(inner);
        };
        let (mut e, depth) = inner.value()?;
        let span = start.to(e.span);
        if negative {
            return tree(ExprKind::Negate(Box::new(e)), span, depth);
        }
        e.span = span;
        Ok(Tree { kind: TreeKind::Value(e), depth })
    }

    fn power(&mut self) -> Parsed<Tree> {
        let base = self.word()?;
        if self.infix(&["^"]).is_none() {
            return Ok(base);
        }
        let (base, x) = base.value()?;
        self.powers = deeper(self.powers, base.span)?;
        let (exponent, y) = self.signed()?.value()?;
        self.powers -= 1;
        let span = base.span.to(exponent.span);
        tree(ExprKind::Power(Box::new(base), Box::new(exponent)), span, x.max(y))
    }

    /// A value with its calls and transposes, and the words before it: `Sym Grad_u'` is `Sym(Grad_u')`.
    fn word(&mut self) -> Parsed<Tree> {
        let mut words = Vec::new();
        while let Some(w) = self.take(Rule::prefix_word) {
            words.push(w);
        }
        let mut t = match self.parts.next().expect("the grammar ends an expression with a value") {
            Part::Value(t) => *t,
            Part::Plain(p) if matches!(p.as_rule(), Rule::number | Rule::ident) => self.reader.atom(&p)?,
            Part::Plain(p) => {
                let d = Diagnostic::new(Code::E113, format!("`{}` cannot stand here", p.as_str()));
                let d = d.at(self.reader.span(&p), "");
                return Err(Box::new(d.help("put what belongs together in parentheses")));
            }
            Part::Call(_) => unreachable!("the grammar puts a value before every call"),
        };
        loop {
            if let Some(Part::Call(call)) = self.parts.next_if(|p| matches!(p, Part::Call(_))) {
                let (callee, d) = t.value()?;
                let (arguments, depth, at) = *call;
                let span = callee.span.to(at);
                t = tree(ExprKind::Call(Box::new(callee), arguments), span, d.max(depth))?;
            } else if let Some(mark) = self.take(Rule::transpose) {
                let (e, d) = t.value()?;
                let span = e.span.to(self.reader.span(&mark));
                t = tree(ExprKind::Transpose(Box::new(e)), span, d)?;
            } else {
                break;
            }
        }
        for w in words.into_iter().rev() {
            let (e, d) = t.value()?;
            let at = self.reader.span(&w);
            let callee = Expr { kind: ExprKind::Name(w.as_str().to_owned()), span: at, expansion: None };
            let span = at.to(e.span);
            t = tree(ExprKind::Call(Box::new(callee), vec![Argument::Expr(e)]), span, d)?;
        }
        Ok(t)
    }
}

const COMPARISONS: &[&str] = &["<=", ">=", "==", "!=", "<", ">"];
const FACTORS: &[&str] = &["*", "/", ".", ":", ".*", "./", "@"];

fn factor(sign: &str) -> MulOp {
    match sign {
        "*" => MulOp::Times,
        "/" => MulOp::Divide,
        "." => MulOp::Dot,
        ":" => MulOp::DoubleDot,
        ".*" => MulOp::ByComponent,
        "./" => MulOp::DivideByComponent,
        _ => MulOp::Outer,
    }
}
