//! Expressions of a state as a whole: `0.2*Dc/max(V) on fault`. Each reduction in them becomes a measure of its own, whose
//! name stands in its place; the rest is arithmetic of numbers, parameters and measures.

use super::{Allowed, Resolver};
use crate::{
    ast::{Argument, CmpOp, Cond, CondKind, Expr, ExprKind, Ident, MeasureAt, OptionItem, OptionValue, Reduction},
    codes::Code,
    diag::Diagnostic,
    foreign::form,
    script::{Computed, Event, Measure},
    source::Span,
    words::is_function,
};

impl Resolver<'_> {
    /// Reads expressions in which reductions may stand.
    pub(super) fn reducing<T>(&mut self, read: impl FnOnce(&mut Self) -> T) -> T {
        self.reduces = true;
        let read = read(self);
        self.reduces = false;
        read
    }

    /// An option whose value may hold reductions; they are added to `watched`.
    pub(super) fn watched(&mut self, option: OptionItem, watched: &mut Vec<Measure>) -> OptionItem {
        let OptionItem { name, value, places } = option;
        let value = match value {
            Some(OptionValue::Expr(e)) => Some(OptionValue::Expr(self.reduced(e, &name, &places, watched))),
            other => other,
        };
        OptionItem { name, value, places }
    }

    /// The expression with the names of measures in place of its reductions on the places.
    fn reduced(&mut self, mut e: Expr, owner: &Ident, places: &[Ident], watched: &mut Vec<Measure>) -> Expr {
        let before = watched.len();
        take(&mut e, "", places, watched);
        self.check_places(owner, e.span, places, &watched[before..]);
        e
    }
}

impl Resolver<'_> {
    /// The sides of an event, the larger one first.
    pub(super) fn event(&mut self, name: &Ident, condition: &Cond, places: &[Ident], span: Span) -> Option<()> {
        let places = self.places(places, Allowed::RegionsAndGlobal);
        let condition = self.reducing(|this| this.cond(condition))?;
        let places = places?;
        let (larger, smaller) = match condition.kind {
            CondKind::Compare(first, mut rest) if rest.len() == 1 => match rest.remove(0) {
                (CmpOp::Greater | CmpOp::GreaterEqual, second) => (*first, second),
                (CmpOp::Less | CmpOp::LessEqual, second) => (second, *first),
                _ => return self.no_event(condition.span),
            },
            _ => return self.no_event(condition.span),
        };
        let mut watched = Vec::new();
        let (mut larger, mut smaller) = (larger, smaller);
        take(&mut larger, &name.name, &places, &mut watched);
        take(&mut smaller, &name.name, &places, &mut watched);
        self.check_places(name, larger.span, &places, &watched);
        self.script.events.push(Event { name: name.clone(), larger, smaller, watched, span });
        Some(())
    }

    /// A number that measures make; its reductions are measures that only it reads.
    pub(super) fn computed(&mut self, name: &Ident, expr: &Expr, places: &[Ident], span: Span) -> Option<()> {
        if let Some(d) = self.no_number(expr, places) {
            self.diagnostics.push(d.help(format!("the form is: {}", form("measure").unwrap_or_default())));
            return None;
        }
        let places = self.places(places, Allowed::RegionsAndGlobal);
        let mut expr = self.reducing(|this| this.expr(expr))?;
        let places = places?;
        let mut watched = Vec::new();
        take(&mut expr, &name.name, &places, &mut watched);
        watched.iter_mut().for_each(|m| m.name.name.insert_str(0, &name.name));
        self.script.computed.push(Computed { name: name.clone(), expr, watched, span });
        Some(())
    }

    /// E113 for what is neither a measure nor a number that measures make.
    fn no_number(&self, e: &Expr, places: &[Ident]) -> Option<Diagnostic> {
        let mut taken = Vec::new();
        take(&mut e.clone(), "", places, &mut taken);
        let called = match &e.kind {
            ExprKind::Call(callee, _) => match &callee.kind {
                ExprKind::Name(word) => Some(word.as_str()),
                _ => None,
            },
            _ => None,
        };
        let unknown = called.filter(|word| !is_function(word) && !self.names.values.contains_key(*word));
        let expected = "expected `mean`, `max`, `min`, `integral`, `value` or `reaction`";
        let found = || called.map_or_else(|| "no reduction".to_owned(), |word| format!("`{word}`"));
        let text = match (taken.is_empty(), places.is_empty()) {
            (true, false) => format!("{expected}, found {}", found()),
            (true, true) => format!("{expected}, or arithmetic of measures, found `{}`", unknown?),
            (false, true) => {
                format!("`{}` is taken on a region, and none is named", taken[0].name.name.split(' ').next()?)
            }
            (false, false) => return None,
        };
        Some(Diagnostic::new(Code::E113, text).at(e.span, ""))
    }

    fn no_event<T>(&mut self, at: Span) -> Option<T> {
        let d = Diagnostic::new(Code::E445, "an event lasts while one number is larger than another");
        self.diagnostics.push(d.at(at, "").help("event quake = max(V) on fault > 1e-3"));
        None
    }

    /// E445 for reductions of an option or an event without places, and for places without reductions.
    fn check_places(&mut self, owner: &Ident, at: Span, places: &[Ident], reductions: &[Measure]) {
        let found = !reductions.is_empty();
        if found && places.is_empty() {
            let d = Diagnostic::new(Code::E445, format!("a reduction in `{}` needs a region", owner.name));
            self.diagnostics.push(d.at(at, "").help("max(V) on fault"));
        }
        if let Some(place) = places.first().filter(|_| !found) {
            let d =
                Diagnostic::new(Code::E445, format!("`{}` has a region and nothing that is taken on it", owner.name));
            self.diagnostics.push(d.at(place.span, "").help("max(V), min(V), mean(V), integral(V) or reaction(u(1))"));
        }
    }
}

/// The reduction that a word names.
pub(super) fn reduction(word: &str) -> Option<Reduction> {
    Some(match word {
        "max" => Reduction::Max,
        "min" => Reduction::Min,
        "mean" => Reduction::Mean,
        "integral" => Reduction::Integral,
        "reaction" => Reduction::Reaction,
        _ => return None,
    })
}

/// Takes the reductions out of an expression: functions of their names that have one argument.
fn take(e: &mut Expr, owner: &str, places: &[Ident], watched: &mut Vec<Measure>) {
    let whole = match &e.kind {
        ExprKind::Call(callee, arguments) => match (&callee.kind, arguments.as_slice()) {
            (ExprKind::Name(word), [Argument::Expr(of)]) => reduction(word).map(|r| (r, word.clone(), of.clone())),
            _ => None,
        },
        _ => None,
    };
    if let Some((reduction, word, expr)) = whole {
        // no scene can declare a name with a space
        let name = format!("{word} {}", watched.len() + 1);
        e.kind = ExprKind::Name(format!("{owner}{name}"));
        let name = Ident { name, span: e.span };
        watched.push(Measure { name, reduction, expr, places: places.to_vec(), at: MeasureAt::Rule, span: e.span });
        return;
    }
    let mut below = |e: &mut Expr| take(e, owner, places, watched);
    match &mut e.kind {
        ExprKind::Sum(parts) => parts.iter_mut().for_each(|p| below(&mut p.1)),
        ExprKind::Product(first, rest) => {
            below(first);
            rest.iter_mut().for_each(|p| below(&mut p.2));
        }
        ExprKind::Negate(a) | ExprKind::Transpose(a) => below(a),
        ExprKind::Power(a, b) => {
            below(a);
            below(b);
        }
        ExprKind::Call(_, arguments) => {
            for argument in arguments {
                if let Argument::Expr(a) = argument {
                    below(a);
                }
            }
        }
        ExprKind::If(_, a, b) => {
            below(a);
            below(b);
        }
        ExprKind::Number(_) | ExprKind::Name(_) | ExprKind::Tensor(_) => {}
    }
}
