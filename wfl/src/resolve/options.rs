//! Options of statements and values from outside: both are checked against what the scene knows.

use super::{Allowed, OPTIONS, Override, Resolver, names};
use crate::{
    ast::{ExprKind, Ident, OptionItem, OptionValue},
    codes::Code,
    diag::{Diagnostic, nearest},
};

impl Resolver<'_> {
    /// E211 for a word that is none of `words`.
    pub(super) fn one_of(&mut self, statement: &str, word: &Ident, words: &[&str]) -> Option<()> {
        if words.contains(&word.name.as_str()) {
            return Some(());
        }
        let d = Diagnostic::new(Code::E211, format!("`{statement}` does not know `{}`", word.name));
        let d = d.did_you_mean(word.span, nearest(&word.name, words.iter().copied()));
        self.diagnostics.push(d.note(format!("it knows {}", words.join(", "))));
        None
    }

    pub(super) fn options(&mut self, statement: &str, options: &[OptionItem]) -> Option<Vec<OptionItem>> {
        let known = OPTIONS.iter().find(|o| o.0 == statement).map_or(&[][..], |o| o.1);
        let mut resolved: Vec<OptionItem> = Vec::new();
        let mut complete = Some(());
        for option in options {
            let name = option.name.clone();
            if !known.contains(&name.name.as_str()) {
                self.diagnostics.push(unknown_option(statement, &name, known));
                complete = None;
                continue;
            }
            if let Some(first) = resolved.iter().find(|o| o.name.name == name.name) {
                let d = Diagnostic::new(Code::E209, format!("the option `{}` is given twice", name.name));
                self.diagnostics.push(d.at(name.span, "").at(first.name.span, "first given here"));
                complete = None;
            }
            let value = match &option.value {
                None => None,
                Some(OptionValue::Text(text, span)) => Some(OptionValue::Text(text.clone(), *span)),
                // a lone word is a choice, such as search=none, and no value
                Some(OptionValue::Expr(e)) if matches!(e.kind, ExprKind::Name(_)) => {
                    let e = self.expander.expr(e)?;
                    self.note_words(&e);
                    Some(OptionValue::Expr(e))
                }
                Some(OptionValue::Expr(e)) => Some(OptionValue::Expr(self.expr(e)?)),
            };
            let places = self.places(&option.places, Allowed::RegionsAndGlobal)?;
            resolved.push(OptionItem { name, value, places });
        }
        complete.map(|()| resolved)
    }

    /// Puts the values from outside in place of those of the scene.
    pub(super) fn overrides(&mut self, overrides: &[Override]) {
        for (i, given) in overrides.iter().enumerate() {
            if let Some(first) = overrides[..i].iter().find(|o| o.name == given.name) {
                let d = Diagnostic::new(Code::E209, format!("`{}` is given twice", given.name));
                self.diagnostics.push(d.at(given.span, "").at(first.span, "first given here"));
                continue;
            }
            let value = self.expr(&given.value);
            let Some(param) = self.script.params.iter_mut().find(|p| p.name.name == given.name) else {
                if !self.script.lost.covers(&given.name) {
                    self.diagnostics.push(self.unknown_param(given));
                }
                continue;
            };
            if let Some(value) = value {
                param.value = value;
                param.overridden = Some(given.span);
            }
        }
    }

    pub(super) fn unknown_param(&self, given: &Override) -> Diagnostic {
        let d = Diagnostic::new(Code::E703, format!("`{}` is not a param of this scene", given.name));
        let params = || self.script.params.iter().map(|p| p.name.name.as_str());
        let text = match nearest(&given.name, params()) {
            Some(near) => {
                let (_, at) = self.names.values[near];
                names::offer(near, "param", Some(at), given.span, self.sources)
            }
            None => String::new(),
        };
        let list: Vec<&str> = params().collect();
        let d = d.at(given.span, text);
        if list.is_empty() {
            d.note("the scene has no params")
        } else {
            d.note(format!("params are {}", list.join(", ")))
        }
    }
}

fn unknown_option(statement: &str, name: &Ident, known: &[&str]) -> Diagnostic {
    let d = Diagnostic::new(Code::E211, format!("`{statement}` has no option `{}`", name.name));
    let longer = known.iter().copied().find(|k| name.name.starts_with(k) && k.len() > 2);
    let near = longer.or_else(|| nearest(&name.name, known.iter().copied()));
    let list = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
    d.did_you_mean(name.span, near).note(format!("options of `{statement}`: {list}"))
}
