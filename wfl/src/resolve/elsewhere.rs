//! Words that no scene declares and other programs know: one message for all of them in a statement, with what each is
//! called here. And the one message for a scene without any unknown.

use std::collections::BTreeSet;

use super::{Resolver, names::Kind, watch::reduction};
use crate::{
    ast::{Expr, Item, ItemKind, Target},
    codes::Code,
    diag::Diagnostic,
    fix::Fix,
    foreign::{Meant, field_slip, foreign, meant},
    render::at_expr,
    source::Span,
    walk::{each_name, each_word},
    words::{CONSTANTS, PREFIXES, is_function, split_prefixes},
};

/// Words of other programs named in one message; the rest is met when these are mended.
const NAMED: usize = 6;

impl Resolver<'_> {
    /// Reads the tables, then E216 for words of other programs, E201 for prefixes in the wrong order, in the expressions of one statement;
    /// `None` after a message, so that nothing else is said of it.
    pub(super) fn known_words(&mut self, expressions: &[&Expr]) -> Option<()> {
        self.read_tables(expressions)?;
        let mut found: Vec<(&Expr, &str)> = Vec::new();
        for e in expressions {
            each_word(e, &mut |e, word| {
                if found.len() < NAMED && !self.is_known(word) && found.iter().all(|f| f.1 != word) {
                    found.push((e, word));
                }
            });
        }
        let derivative = |w: &str| w.strip_prefix('d').is_some_and(|f| self.names.values.contains_key(f));
        if let Some((e, word)) = found.iter().find(|(_, w)| derivative(w)) {
            let d = self.of_elsewhere(&[(*e, *word, foreign("Dx").unwrap_or_default())]);
            self.diagnostics.push(d);
            return None;
        }
        let cured: Vec<_> = found.iter().filter_map(|(e, w)| Some((*e, *w, foreign(w)?))).collect();
        if !cured.is_empty() {
            let d = self.of_elsewhere(&cured);
            self.diagnostics.push(d);
            return None;
        }
        let fields = || self.names.values.iter().filter(|(_, v)| v.0.is_field()).map(|(name, _)| name.as_str());
        let Some((e, word, slip)) = found.iter().find_map(|(e, w)| Some((*e, *w, field_slip(w, fields())?))) else {
            return Some(());
        };
        let d = Diagnostic::new(Code::E201, format!("unknown name `{word}`")).about(word);
        let d = at_expr(d, e, &self.expander.expansions, slip.text);
        self.diagnostics.push(slip.word.or(slip.component).into_iter().fold(d, |d, meant| d.replace(e.span, meant)));
        None
    }

    fn is_known(&self, word: &str) -> bool {
        let (prefix, root) = split_prefixes(word);
        self.reduces && reduction(word).is_some()
            || is_function(word)
            || CONSTANTS.contains(&word)
            || ["x", "y", "z", "t"].contains(&word)
            || self.names.values.contains_key(word)
            || self.script.lost.covers(word)
            || is_order(prefix) && (self.names.values.contains_key(root) || self.script.lost.covers(root))
    }

    fn of_elsewhere(&self, words: &[(&Expr, &str, &'static str)]) -> Diagnostic {
        let mut quoted: Vec<String> = words.iter().map(|w| format!("`{}`", w.1)).collect();
        let last = quoted.pop().unwrap_or_default();
        let message = match quoted.len() {
            0 => format!("{last} is not a word of this language"),
            _ => format!("{} and {last} are not words of this language", quoted.join(", ")),
        };
        let mut d = Diagnostic::new(Code::E216, message);
        for (k, (e, _, _)) in words.iter().enumerate() {
            d = if k == 0 { at_expr(d, e, &self.expander.expansions, "") } else { marked(d, e) };
        }
        let mut said = BTreeSet::new();
        for (_, word, here) in words {
            if said.insert(*here) {
                d = d.help(format!("{word}: {here}"));
            }
        }
        for (e, word, _) in words {
            let is_called = self.sources.get(e.span.source).text[e.span.end as usize..].starts_with('(');
            d = match meant(word) {
                Meant::Function(name) if is_called => d.replace(e.span, name),
                Meant::Value(value) if !is_called => d.replace(e.span, value),
                _ => d,
            };
        }
        d
    }

    /// E423, once and at the first place that needs an unknown; what the scene takes for one is then not called unknown.
    pub(super) fn no_unknown(&mut self, items: &[Item]) {
        let declared = |item: &Item| matches!(item.kind, ItemKind::Unknown { .. });
        if !self.complete || items.iter().any(declared) {
            return;
        }
        let mut wanted: Vec<(String, Span)> = Vec::new();
        for item in items {
            wanted_fields(item, &mut wanted);
        }
        wanted.retain(|(name, _)| !matches!(self.names.values.get(name), Some((kind, _)) if *kind != Kind::Measure));
        let d = Diagnostic::new(Code::E423, "the scene has no unknown");
        let d = match wanted.first() {
            Some((name, at)) => d
                .at(*at, format!("nothing declares `{name}`"))
                .help(format!("unknown {name} : vector, or scalar; with an element and a region: vector P2 on REGION"))
                .fix(Fix::AddStatement(format!("unknown {name} : vector"))),
            None => d.missing("unknown u : vector"),
        };
        self.diagnostics.push(d);
        for (name, _) in wanted {
            self.script.lost.add(&name);
        }
    }
}

/// True for prefixes in the order in which they are read: a derivative, then what the field is taken as.
fn is_order(prefixes: &str) -> bool {
    let rest = ["Grad_", "Hess_", "Div_"].iter().find_map(|p| prefixes.strip_prefix(p)).unwrap_or(prefixes);
    !prefixes.is_empty() && (rest.is_empty() || PREFIXES.contains(&rest) && !rest.starts_with("Grad_"))
}

/// A further mark; one inside a macro of another place is left out.
fn marked(d: Diagnostic, e: &Expr) -> Diagnostic {
    if e.expansion.is_some() { d } else { d.at(e.span, "") }
}

/// Names that a statement takes for unknowns: tested, fixed, loaded or started.
fn wanted_fields(item: &Item, wanted: &mut Vec<(String, Span)>) {
    let targets = |targets: &[Target]| targets.iter().map(|t| (t.field.name.clone(), t.field.span)).collect::<Vec<_>>();
    match &item.kind {
        ItemKind::Term { energy, expr, .. } => {
            let mut words = Vec::new();
            each_name(expr, &mut |word| words.push(word));
            let needs = |prefix: &str| prefix.contains("Test") || *energy && !prefix.is_empty();
            let roots = words.iter().map(|w| split_prefixes(w)).filter(|(prefix, _)| needs(prefix));
            wanted.extend(roots.map(|(_, root)| (root.to_owned(), expr.span)));
        }
        ItemKind::Fix { targets: t, .. } | ItemKind::Load { targets: t, .. } => wanted.extend(targets(t)),
        ItemKind::Start { field, .. } => {
            let name = field.name.strip_prefix("Dot_").unwrap_or(&field.name);
            wanted.push((name.to_owned(), field.span));
        }
        _ => {}
    }
}
