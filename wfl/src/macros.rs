//! Macro expansion on trees: every use of a `def` is replaced by its body with the arguments in place.
//!
//! Nothing is pasted as text, so `def gap = a - b` keeps its meaning in `2*gap`. Arguments keep their own places;
//! nodes of a body keep the place in the body and the use that brought them ([`Expansions`]). A parameter shadows
//! everything of the same name; it may follow `Grad_`, `Test_`, ... and stand inside `Interpolate`, and is then
//! replaced by a name. Words that are no macros are not looked up here.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    ast::{Argument, Cond, CondKind, Expansion, ExpansionId, Expansions, Expr, ExprKind, MacroDef},
    codes::Code,
    diag::Diagnostic,
    render::at_expr,
    source::{SourceMap, Span},
    walk::{each_name, height, size},
    words::{only_prefixes, split_prefixes},
};

/// Expressions nest at most this deep after expansion (E119), so a walk over a tree may recurse.
pub const EXPANDED_NESTING_LIMIT: usize = 256;

/// Expansion copies at most this many nodes in one scene (E124).
pub const EXPANSION_LIMIT: usize = 1_000_000;

/// Macros that see each other, by name.
#[derive(Debug, Default)]
struct Table<'d> {
    defs: Vec<&'d MacroDef>,
    by_name: BTreeMap<&'d str, usize>,
    /// Defined by themselves; reported once, and silently without value wherever they are used.
    broken: BTreeSet<usize>,
}

impl<'d> Table<'d> {
    /// The first definition of each name counts; the second is reported by the caller.
    fn new(defs: impl IntoIterator<Item = &'d MacroDef>, diagnostics: &mut Vec<Diagnostic>) -> Self {
        let mut table = Table::default();
        for d in defs {
            table.by_name.entry(&d.name.name).or_insert(table.defs.len());
            table.defs.push(d);
        }
        table.find_cycles(diagnostics);
        table
    }

    /// The macros of this table that the body of `def` uses.
    fn uses(&self, def: &MacroDef) -> Vec<usize> {
        let mut used = Vec::new();
        each_name(&def.body, &mut |word| {
            if !def.formals.iter().any(|f| f.name == word) {
                used.extend(self.by_name.get(word));
            }
        });
        used
    }

    /// Depth-first search with an explicit stack: chains of definitions may be long.
    fn find_cycles(&mut self, diagnostics: &mut Vec<Diagnostic>) {
        let mut done = vec![false; self.defs.len()];
        for root in 0..self.defs.len() {
            let mut path: Vec<(usize, std::vec::IntoIter<usize>)> = Vec::new();
            let mut on_path = BTreeSet::new();
            let mut next = (!done[root]).then_some(root);
            loop {
                if let Some(def) = next.take() {
                    on_path.insert(def);
                    path.push((def, self.uses(self.defs[def]).into_iter()));
                }
                let Some((def, rest)) = path.last_mut() else { break };
                match rest.next() {
                    Some(used) if on_path.contains(&used) => {
                        let start = path.iter().position(|(d, _)| *d == used).expect("it is on the path");
                        let cycle: Vec<usize> = path[start..].iter().map(|(d, _)| *d).collect();
                        self.report_cycle(&cycle, diagnostics);
                    }
                    Some(used) => next = (!done[used]).then_some(used),
                    None => {
                        done[*def] = true;
                        on_path.remove(def);
                        path.pop();
                    }
                }
            }
        }
    }

    fn report_cycle(&mut self, cycle: &[usize], diagnostics: &mut Vec<Diagnostic>) {
        if cycle.iter().all(|d| self.broken.contains(d)) {
            return;
        }
        let mut path: Vec<&str> = cycle.iter().map(|d| self.defs[*d].name.name.as_str()).collect();
        path.push(path[0]);
        let shown = if path.len() > 12 {
            format!("{} -> ... -> {}", path[..10].join(" -> "), path[0])
        } else {
            path.join(" -> ")
        };
        let mut d = Diagnostic::new(Code::E123, format!("`{}` is defined by itself", path[0])).note(shown);
        for (i, def) in cycle.iter().take(4).enumerate() {
            d = d.at(self.defs[*def].head, if i == 0 { "" } else { "by way of this" });
        }
        diagnostics.push(d);
        self.broken.extend(cycle);
    }
}

/// A macro that was found by name.
#[derive(Clone, Copy)]
struct Found<'d> {
    def: &'d MacroDef,
    /// Place in the table of the scene; `None` for a macro of one term.
    global: Option<usize>,
    broken: bool,
}

/// The text that is being copied: the statement itself, or the body of a macro with its arguments.
struct Frame<'f> {
    def: Option<&'f MacroDef>,
    arguments: &'f [Given],
    id: Option<ExpansionId>,
    sees_locals: bool,
}

/// An expanded argument with its number of nodes and its depth.
struct Given {
    expr: Expr,
    nodes: usize,
    depth: usize,
}

/// Expands the expressions of a scene.
pub struct Expander<'d> {
    sources: &'d SourceMap,
    globals: Table<'d>,
    locals: Table<'d>,
    used: Vec<bool>,
    copied: usize,
    uses: usize,
    full: bool,
    /// Every use so far.
    pub expansions: Expansions,
    /// What was found; each problem once.
    pub diagnostics: Vec<Diagnostic>,
}

impl<'d> Expander<'d> {
    /// An expander for the macros of a scene; cycles among them are reported at once.
    #[must_use]
    pub fn new(sources: &'d SourceMap, defs: impl IntoIterator<Item = &'d MacroDef>) -> Self {
        let mut diagnostics = Vec::new();
        let globals = Table::new(defs, &mut diagnostics);
        let used = vec![false; globals.defs.len()];
        Self {
            sources,
            globals,
            locals: Table::default(),
            used,
            copied: 0,
            uses: 0,
            full: false,
            expansions: Expansions::default(),
            diagnostics,
        }
    }

    /// Which macros were used so far, in the order they were given.
    #[must_use]
    pub fn used(&self) -> &[bool] {
        &self.used
    }

    /// `e` with every macro replaced; `None` after an error.
    pub fn expr(&mut self, e: &Expr) -> Option<Expr> {
        self.walk(e, &TOP, 0)
    }

    /// `e` with every macro replaced, where the macros `locals` hide those of the scene.
    pub fn expr_with(&mut self, e: &Expr, locals: &'d [MacroDef]) -> Option<Expr> {
        self.locals = Table::new(locals, &mut self.diagnostics);
        let expanded = self.expr(e);
        self.locals = Table::default();
        expanded
    }

    /// A condition with every macro in it replaced.
    pub fn cond(&mut self, c: &Cond) -> Option<Cond> {
        self.walk_cond(c, &TOP, 0)
    }

    fn find(&self, word: &str, frame: &Frame<'_>) -> Option<Found<'d>> {
        if frame.sees_locals
            && let Some(&i) = self.locals.by_name.get(word)
        {
            return Some(Found { def: self.locals.defs[i], global: None, broken: self.locals.broken.contains(&i) });
        }
        let i = *self.globals.by_name.get(word)?;
        Some(Found { def: self.globals.defs[i], global: Some(i), broken: self.globals.broken.contains(&i) })
    }

    fn report(&mut self, diagnostic: Diagnostic) {
        if !self.diagnostics.contains(&diagnostic) {
            self.diagnostics.push(diagnostic);
        }
    }

    /// Counts copied nodes; `None` once there are too many.
    fn copy(&mut self, nodes: usize, at: &Expr) -> Option<()> {
        self.copied += nodes;
        if self.copied <= EXPANSION_LIMIT {
            return Some(());
        }
        if !self.full {
            self.full = true;
            let d = Diagnostic::new(Code::E124, format!("macros expand to more than {EXPANSION_LIMIT} parts"))
                .note("a macro that uses another one twice doubles it, at every level");
            let d = at_expr(d, at, &self.expansions, "");
            self.report(d);
        }
        None
    }

    fn check_depth(&mut self, depth: usize, at: &Expr) -> Option<()> {
        if depth <= EXPANDED_NESTING_LIMIT {
            return Some(());
        }
        let text = format!("nested more than {EXPANDED_NESTING_LIMIT} deep after its macros are expanded");
        let d = at_expr(Diagnostic::new(Code::E119, text), at, &self.expansions, "");
        if !self.diagnostics.iter().any(|x| x.message == d.message && x.labels.first() == d.labels.first()) {
            self.diagnostics.push(d);
        }
        None
    }

    fn walk(&mut self, e: &Expr, frame: &Frame<'_>, depth: usize) -> Option<Expr> {
        self.check_depth(depth, e)?;
        if frame.id.is_some() {
            self.copy(1, e)?;
        }
        let next = depth + 1;
        let kind = match &e.kind {
            ExprKind::Name(word) => return self.name(e, word, frame, depth),
            ExprKind::Call(callee, arguments) => return self.call(e, callee, arguments, frame, depth),
            ExprKind::Number(x) => ExprKind::Number(*x),
            ExprKind::Sum(parts) => {
                let parts: Vec<_> = parts.iter().map(|(s, p)| Some((*s, self.walk(p, frame, next)?))).collect();
                ExprKind::Sum(parts.into_iter().collect::<Option<_>>()?)
            }
            ExprKind::Product(first, rest) => {
                let first = self.walk(first, frame, next);
                let rest: Vec<_> = rest.iter().map(|(o, s, p)| Some((*o, *s, self.walk(p, frame, next)?))).collect();
                ExprKind::Product(Box::new(first?), rest.into_iter().collect::<Option<_>>()?)
            }
            ExprKind::Negate(a) => ExprKind::Negate(Box::new(self.walk(a, frame, next)?)),
            ExprKind::Power(a, b) => {
                let (a, b) = (self.walk(a, frame, next), self.walk(b, frame, next));
                ExprKind::Power(Box::new(a?), Box::new(b?))
            }
            ExprKind::Transpose(a) => ExprKind::Transpose(Box::new(self.walk(a, frame, next)?)),
            ExprKind::Tensor(rows) => {
                let rows: Vec<Option<Vec<Expr>>> = rows.iter().map(|r| self.all(r, frame, next)).collect();
                ExprKind::Tensor(rows.into_iter().collect::<Option<_>>()?)
            }
            ExprKind::If(c, a, b) => {
                let c = self.walk_cond(c, frame, next);
                let (a, b) = (self.walk(a, frame, next), self.walk(b, frame, next));
                ExprKind::If(Box::new(c?), Box::new(a?), Box::new(b?))
            }
        };
        Some(Expr { kind, span: e.span, expansion: frame.id.or(e.expansion) })
    }

    /// All of a list, so that one error does not hide the next.
    fn all(&mut self, list: &[Expr], frame: &Frame<'_>, depth: usize) -> Option<Vec<Expr>> {
        let list: Vec<Option<Expr>> = list.iter().map(|e| self.walk(e, frame, depth)).collect();
        list.into_iter().collect()
    }

    fn walk_cond(&mut self, c: &Cond, frame: &Frame<'_>, depth: usize) -> Option<Cond> {
        let next = depth + 1;
        let kind = match &c.kind {
            CondKind::Compare(first, rest) => {
                let first = self.walk(first, frame, next);
                let rest: Vec<_> = rest.iter().map(|(o, e)| Some((*o, self.walk(e, frame, next)?))).collect();
                CondKind::Compare(Box::new(first?), rest.into_iter().collect::<Option<_>>()?)
            }
            CondKind::And(parts) => CondKind::And(self.all_conds(parts, frame, next)?),
            CondKind::Or(parts) => CondKind::Or(self.all_conds(parts, frame, next)?),
            CondKind::Not(a) => CondKind::Not(Box::new(self.walk_cond(a, frame, next)?)),
        };
        Some(Cond { kind, span: c.span })
    }

    fn all_conds(&mut self, list: &[Cond], frame: &Frame<'_>, depth: usize) -> Option<Vec<Cond>> {
        let list: Vec<Option<Cond>> = list.iter().map(|c| self.walk_cond(c, frame, depth)).collect();
        list.into_iter().collect()
    }

    fn name(&mut self, e: &Expr, word: &str, frame: &Frame<'_>, depth: usize) -> Option<Expr> {
        if let Some((prefix, i)) = formal(word, frame) {
            let argument = &frame.arguments[i];
            if prefix.is_empty() {
                self.check_depth(depth + argument.depth, e)?;
                self.copy(argument.nodes, e)?;
                return Some(argument.expr.clone());
            }
            return self.paste(e, prefix, i, frame);
        }
        match self.find(word, frame) {
            Some(found) => self.expand(e, found, &[], frame, depth),
            None => Some(Expr { kind: e.kind.clone(), span: e.span, expansion: frame.id.or(e.expansion) }),
        }
    }

    /// `Grad_v` with `v` standing for `u` is `Grad_u`.
    fn paste(&mut self, e: &Expr, prefix: &str, i: usize, frame: &Frame<'_>) -> Option<Expr> {
        if let ExprKind::Name(word) = &frame.arguments[i].expr.kind {
            return Some(Expr { kind: ExprKind::Name(format!("{prefix}{word}")), span: e.span, expansion: frame.id });
        }
        let v = self.formal_name(i, frame);
        let d =
            Diagnostic::new(Code::E106, format!("`{prefix}{v}` needs a field name, but `{v}` is an expression here"));
        self.needs_name(d, e.span, format!("`{v}` is pasted behind {prefix} here"), i, frame)
    }

    fn formal_name(&self, i: usize, frame: &Frame<'_>) -> String {
        frame.def.map_or(String::new(), |d| d.formals[i].name.clone())
    }

    fn needs_name(&mut self, d: Diagnostic, body: Span, why: String, i: usize, frame: &Frame<'_>) -> Option<Expr> {
        let argument = &frame.arguments[i].expr;
        let v = self.formal_name(i, frame);
        let d = at_expr(d, argument, &self.expansions, format!("this stands for `{v}`")).at(body, why);
        let d = match (frame.def, linear_argument(argument)) {
            (Some(def), Some((factor, name))) if def.formals.len() == 1 => {
                let factor = self.sources.snippet(factor);
                d.help(format!("{factor}*{}({})", def.name.name, self.sources.snippet(name)))
            }
            _ => d.help("give the name of a field"),
        };
        // One message for each argument, however often the body pastes it.
        let known = |x: &Diagnostic| x.code == d.code && x.labels.first() == d.labels.first();
        if !self.diagnostics.iter().any(known) {
            self.diagnostics.push(d);
        }
        None
    }

    fn call(
        &mut self,
        e: &Expr,
        callee: &Expr,
        arguments: &[Argument],
        frame: &Frame<'_>,
        depth: usize,
    ) -> Option<Expr> {
        let next = depth + 1;
        if let ExprKind::Name(word) = &callee.kind
            && formal(word, frame).is_none()
        {
            if let Some(found) = self.find(word, frame)
                && !found.def.formals.is_empty()
            {
                return self.expand(e, found, arguments, frame, depth);
            }
            if word == "Interpolate" {
                self.interpolate_takes_a_name(arguments, frame)?;
            }
        }
        let callee = self.walk(callee, frame, next);
        let arguments: Vec<Option<Argument>> = arguments
            .iter()
            .map(|a| match a {
                Argument::Slice(_) | Argument::Text(..) => Some(a.clone()),
                Argument::Expr(e) => Some(Argument::Expr(self.walk(e, frame, next)?)),
            })
            .collect();
        let arguments = arguments.into_iter().collect::<Option<_>>()?;
        Some(Expr {
            kind: ExprKind::Call(Box::new(callee?), arguments),
            span: e.span,
            expansion: frame.id.or(e.expansion),
        })
    }

    /// In a body, a parameter inside `Interpolate` stands for a name.
    fn interpolate_takes_a_name(&mut self, arguments: &[Argument], frame: &Frame<'_>) -> Option<()> {
        for argument in arguments {
            if let Argument::Expr(inner) = argument
                && let ExprKind::Name(word) = &inner.kind
                && let Some(("", i)) = formal(word, frame)
                && !matches!(frame.arguments[i].expr.kind, ExprKind::Name(_))
            {
                let d = Diagnostic::new(
                    Code::E106,
                    format!("`Interpolate` needs a field name, but `{word}` is an expression here"),
                );
                self.needs_name(d, inner.span, format!("`{word}` is the field of `Interpolate` here"), i, frame);
                return None;
            }
        }
        Some(())
    }

    /// The body of a macro in place of its use `e`.
    fn expand(
        &mut self,
        e: &Expr,
        found: Found<'d>,
        given: &[Argument],
        frame: &Frame<'_>,
        depth: usize,
    ) -> Option<Expr> {
        let def = found.def;
        if let Some(i) = found.global {
            self.used[i] = true;
        }
        let mut arguments = Vec::with_capacity(given.len());
        let mut complete = true;
        for argument in given {
            match argument {
                Argument::Slice(span) => {
                    let d = Diagnostic::new(Code::E105, format!("`:` is no argument of the macro `{}`", def.name.name));
                    self.report(d.at(*span, "").at(def.head, "defined here"));
                    complete = false;
                }
                Argument::Text(_, span) => {
                    let d =
                        Diagnostic::new(Code::E105, format!("a text is no argument of the macro `{}`", def.name.name));
                    self.report(d.at(*span, "").at(def.head, "defined here"));
                    complete = false;
                }
                Argument::Expr(a) => match self.walk(a, frame, depth) {
                    Some(expr) => arguments.push(Given { nodes: size(&expr), depth: height(&expr), expr }),
                    None => complete = false,
                },
            }
        }
        if given.len() != def.formals.len() {
            let at = Expr { kind: ExprKind::Number(0.0), span: e.span, expansion: frame.id.or(e.expansion) };
            let d = wrong_number(def, given.len());
            let d = at_expr(d, &at, &self.expansions, "").at(def.head, "defined here");
            self.report(d);
            return None;
        }
        if !complete || found.broken {
            return None;
        }
        self.uses += 1;
        let id = ExpansionId::new(self.expansions.list.len());
        let deep = self.check_depth(self.uses, e);
        self.expansions.list.push(Expansion {
            name: def.name.name.clone(),
            call: e.span,
            definition: def.head,
            parent: frame.id.or(e.expansion),
        });
        let inside = Frame { def: Some(def), arguments: &arguments, id: Some(id), sees_locals: found.global.is_none() };
        let expanded = deep.and_then(|()| self.walk(&def.body, &inside, depth));
        self.uses -= 1;
        expanded
    }
}

const TOP: Frame<'static> = Frame { def: None, arguments: &[], id: None, sees_locals: true };

fn wrong_number(def: &MacroDef, given: usize) -> Diagnostic {
    let n = def.formals.len();
    let plural = if n == 1 { "" } else { "s" };
    Diagnostic::new(Code::E105, format!("`{}` takes {n} argument{plural}, {given} given", def.name.name))
}

/// Prefix and place of the parameter that `word` is or ends with; the prefix may be empty.
fn formal<'w>(word: &'w str, frame: &Frame<'_>) -> Option<(&'w str, usize)> {
    let formals = &frame.def?.formals;
    if let Some(i) = formals.iter().position(|f| f.name == word) {
        return Some(("", i));
    }
    let (prefix, rest) = split_prefixes(word);
    if prefix.is_empty() {
        return None;
    }
    let i = formals.iter().position(|f| f.name == rest)?;
    only_prefixes(prefix).then_some((prefix, i))
}

/// Places of the factor and the name in `2*u`, where the factor is a number.
fn linear_argument(e: &Expr) -> Option<(Span, Span)> {
    match &e.kind {
        ExprKind::Product(a, rest) => match (&a.kind, rest.as_slice()) {
            (ExprKind::Number(_), [(crate::ast::MulOp::Times, _, b)]) if matches!(b.kind, ExprKind::Name(_)) => {
                Some((a.span, b.span))
            }
            _ => None,
        },
        _ => None,
    }
}

#[cfg(test)]
mod tests;
