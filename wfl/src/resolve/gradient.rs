//! `gradient`: the measures and what they are differentiated in are names of the scene.

use super::{Resolver, names, names::Kind};
use crate::{
    ast::{AtSteps, Differentiated, Gradients, Ident},
    codes::Code,
    diag::{Diagnostic, nearest},
    script::{Derivative, Gradient},
    source::Span,
};

impl Resolver<'_> {
    pub(super) fn gradient(&mut self, of: &Gradients, span: Span) -> Option<()> {
        let mut complete = Some(());
        let mut results = Vec::new();
        for result in &of.results {
            complete = self.one_of_kind(&result.measure, Kind::Measure, Code::E471).and(complete);
            match self.at_steps(&result.at) {
                Some(at) => results.push(Differentiated { at, ..result.clone() }),
                None => complete = None,
            }
        }
        for (list, kind) in [(&of.parameters, Kind::Param), (&of.fields, Kind::Data)] {
            for name in list {
                complete = self.one_of_kind(name, kind, Code::E472).and(complete);
            }
        }
        complete?;
        let words = |s: &Span| self.sources.snippet(*s).split_whitespace().collect::<Vec<_>>().join(" ");
        let texts = of.results.iter().map(|r| words(&r.span)).collect();
        let (parameters, fields) = (of.parameters.clone(), of.fields.clone());
        let derivatives = Derivative::all(&results, &parameters);
        self.words.extend(parameters.iter().chain(&fields).map(|name| name.name.clone()));
        self.script.gradients.push(Gradient { results, texts, parameters, fields, derivatives, span });
        Some(())
    }

    fn at_steps(&mut self, at: &AtSteps) -> Option<AtSteps> {
        let AtSteps::At(variable, value) = at else { return Some(at.clone()) };
        if let Some(variable) = variable {
            self.one_of_kind(variable, Kind::Steps, Code::E471)?;
        }
        Some(AtSteps::At(variable.clone(), self.expr(value)?))
    }

    /// A message for a name that is not of this kind.
    fn one_of_kind(&mut self, name: &Ident, kind: Kind, code: Code) -> Option<()> {
        let found = self.names.values.get(&name.name).map(|v| v.0);
        if found == Some(kind) {
            return Some(());
        }
        if found.is_none() && self.script.lost.covers(&name.name) {
            return None;
        }
        let text = format!("`{}` is not {}", name.name, names::article(kind));
        let d = Diagnostic::new(code, text);
        let of_kind = self.names.values.iter().filter(|(_, v)| v.0 == kind);
        let near = nearest(&name.name, of_kind.map(|(known, _)| known.as_str()));
        self.diagnostics.push(match (found, near) {
            (Some(Kind::Data), _) if kind == Kind::Param => {
                let d = d.at(name.span, "a data field").help(format!("in its values at nodes: field {}", name.name));
                d.replace(name.span, format!("field {}", name.name))
            }
            (Some(other), _) => d.at(name.span, format!("this is {}", names::article(other))),
            (None, Some(near)) => {
                let at = self.names.values[near].1;
                d.at(name.span, names::offer(near, kind.word(), Some(at), name.span, self.sources))
                    .replace(name.span, near)
            }
            (None, None) => d.at(name.span, "no statement declares it"),
        });
        None
    }
}
