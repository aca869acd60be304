//! Additions of the scene to messages of the compiler: where the nearest name is declared, where a field is defined,
//! and the word in the statement that selected the region.

use wfl::{
    Code, Diagnostic, FieldKind, Fix, Label, ResolvedScript, Span,
    ast::{Ident, Place},
    line_of, nearest,
};

/// Adds the context of the scene to messages of the compiler.
pub(super) fn add(script: &ResolvedScript, diagnostics: &mut [Diagnostic]) {
    let mut offers = 0;
    for d in diagnostics {
        match d.code {
            Code::E201 if offers < MOST_OFFERS => {
                offers += 1;
                offer(script, d);
            }
            Code::E202 => home(script, d),
            Code::E203 | Code::E204 => place(script, d),
            _ => {}
        }
    }
}

/// Messages for which a name is looked for: it costs as much as the scene has names, and no more messages are shown.
const MOST_OFFERS: usize = 100;

/// Names of the scene with what they are and where.
fn declared(script: &ResolvedScript) -> impl Iterator<Item = (&Ident, &'static str)> {
    let kind = |f: &wfl::Field| match f.kind {
        FieldKind::Unknown => "unknown",
        FieldKind::Multiplier { .. } => "multiplier",
        FieldKind::Data { .. } => "data",
        FieldKind::State { .. } => "state",
    };
    let params = script.params.iter().map(|p| (&p.name, "param"));
    let fields = script.fields.iter().map(move |f| (&f.name, kind(f)));
    let macros = script.macros.iter().map(|m| (&m.name, "def"));
    let measures = script.measures.iter().map(|m| (&m.name, "measure"));
    let computed = script.computed.iter().map(|m| (&m.name, "measure"));
    params.chain(fields).chain(macros).chain(measures).chain(computed)
}

/// The nearest name with its line.
fn offer(script: &ResolvedScript, d: &mut Diagnostic) {
    let (Some(name), Some(label)) = (&d.about, d.labels.first_mut()) else { return };
    let Some(near) = nearest(name, declared(script).map(|n| n.0.name.as_str())) else { return };
    let Some((ident, kind)) = declared(script).find(|n| n.0.name == near) else { return };
    let line = line_of(ident.span);
    if near == name {
        let why = if kind == "param" { "params stand before what uses them" } else { "no formula here can use it" };
        label.text = format!("{kind} on {line}: {why}");
        return;
    }
    label.text = format!("did you mean `{near}`, {kind} on {line}?");
    let title = None;
    d.fixes = d.word.map(|span| Fix::Replace { span, text: near.to_owned(), title }).into_iter().collect();
}

/// Where a field lives that does not live here.
fn home(script: &ResolvedScript, d: &mut Diagnostic) {
    let field = script.fields.iter().find(|f| d.about.as_ref() == Some(&f.name.name));
    let (Some(field), Some(label)) = (field, d.labels.last_mut()) else { return };
    if let Place::On(regions) = &field.space.place {
        let regions: Vec<String> = regions.iter().map(|r| format!("`{}`", r.name)).collect();
        label.text = format!("{} lives on {}; {}", field.name.name, regions.join(", "), label.text);
    }
}

/// A note on the kind of a region becomes a mark at the region.
fn place(script: &ResolvedScript, d: &mut Diagnostic) {
    let Some(at) = d.labels.first().map(|l| l.span) else { return };
    let inside = |s: Span| s.source == at.source && s.start <= at.start && at.end <= s.end;
    let terms = script.terms.iter().map(|t| (t.span, &t.places));
    let measures = script.reductions().map(|m| (m.span, &m.places));
    let Some((_, places)) = terms.chain(measures).find(|s| inside(s.0)) else { return };
    for place in places {
        let start = format!("`{}` is ", place.name);
        if let Some(note) = d.notes.iter().position(|n| n.starts_with(&start)) {
            let text = d.notes.remove(note);
            d.labels.push(Label { span: place.span, text });
        }
    }
}
