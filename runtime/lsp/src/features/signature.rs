//! The parameters of the call around the cursor.

use lsp_types::{
    Documentation, MarkupContent, MarkupKind, ParameterInformation, ParameterLabel, Position, SignatureHelp,
    SignatureInformation,
};
use wfl_compiler::functions;

use crate::{
    features::docs,
    symbols::{Key, Kind},
    view::View,
};

pub(crate) fn signature(view: &View<'_>, position: Position) -> Option<SignatureHelp> {
    let offset = view.offset(position);
    let start = wfl::statement_ranges(view.text).into_iter().rev().find(|r| r.start <= offset)?.start;
    let (name, argument) = call_around(&view.text[start..offset])?;
    let names = view.analysis.names();
    let declared = names.declaration(&Key::Value(name.to_owned())).filter(|d| d.declares == Some(Kind::Def));
    let (label, doc) = match declared {
        Some(d) => (docs::head(view.analysis, d), docs::declared(view.analysis, None, d)),
        None => {
            let op = functions().find(|op| op.name == name)?;
            (op.usage.to_owned(), op.doc.to_owned())
        }
    };
    let formals = docs::formals(&label);
    let parameter = |f: &String| ParameterInformation { label: ParameterLabel::Simple(f.clone()), documentation: None };
    let active = u32::try_from(argument).ok();
    let signature = SignatureInformation {
        documentation: Some(Documentation::MarkupContent(MarkupContent { kind: MarkupKind::Markdown, value: doc })),
        parameters: Some(formals.iter().map(parameter).collect()),
        active_parameter: active,
        label,
    };
    Some(SignatureHelp { signatures: vec![signature], active_signature: Some(0), active_parameter: active })
}

/// The name of the innermost call that is open at the end of a text, and the number of commas in it.
fn call_around(text: &str) -> Option<(&str, usize)> {
    let mut open: Vec<(usize, usize)> = Vec::new();
    for (k, c) in text.char_indices() {
        match c {
            '(' | '[' | '{' => open.push((k, 0)),
            ')' | ']' | '}' => {
                open.pop();
            }
            ',' => {
                if let Some(last) = open.last_mut() {
                    last.1 += 1;
                }
            }
            _ => {}
        }
    }
    // a tensor inside the call is no call
    let (at, commas) = open.into_iter().rev().find(|o| text[o.0..].starts_with('('))?;
    let before = &text[..at];
    let start = before.rfind(|c: char| !c.is_ascii_alphanumeric() && c != '_').map_or(0, |k| k + 1);
    (start < at).then_some((&before[start..], commas))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_innermost_open_call_is_found() {
        assert_eq!(call_around("term on f : nitsche(uL, f(a, b), "), Some(("nitsche", 2)));
        assert_eq!(call_around("g(a, [1, 2"), Some(("g", 1)));
        assert_eq!(call_around("a*(b + "), None);
        assert_eq!(call_around("f(a)"), None);
    }
}
