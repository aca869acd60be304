//! The fixes of messages as edits of the texts of a scene, which an editor offers.

use crate::{
    diag::Diagnostic,
    fix::Fix,
    parse::statement_ranges,
    quote::unquoted,
    source::{SourceId, SourceMap, Span},
};

/// A fix as a change of text, ready for a menu.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edit {
    /// What it does.
    pub title: String,
    /// What is replaced; empty where something is put in.
    pub span: Span,
    /// What stands there then.
    pub text: String,
}

/// The fixes of a message as edits of the texts that it speaks of, in the order in which they were set.
#[must_use]
pub fn edits(diagnostic: &Diagnostic, sources: &SourceMap) -> Vec<Edit> {
    let place = diagnostic.labels.first().map(|l| l.span);
    diagnostic.fixes.iter().filter_map(|fix| edit(fix, place, sources)).collect()
}

fn edit(fix: &Fix, place: Option<Span>, sources: &SourceMap) -> Option<Edit> {
    match fix {
        Fix::Replace { span, text, title } => {
            let text = unquoted(text, sources);
            Some(replaced(*span, text, *title, sources))
        }
        Fix::FirstWord { from, to } => {
            let span = place?;
            let start = statement_around(span, sources)?.start;
            let has_it = sources.get(span.source).text[start..].starts_with(from);
            has_it.then(|| replaced(at(span.source, start, start + from.len()), (*to).to_owned(), None, sources))
        }
        Fix::AddStatement(statement) => {
            let (source, position) = match place {
                Some(span) => (span.source, statement_around(span, sources)?.start),
                None => sources.iter().next().map(|(source, main)| (source, main.text.len()))?,
            };
            let statement = unquoted(statement, sources);
            let text = &sources.get(source).text;
            let before = if position > 0 && !text[..position].ends_with('\n') { "\n" } else { "" };
            let title = format!("Add `{statement}`");
            Some(Edit { title, span: at(source, position, position), text: format!("{before}{statement}\n") })
        }
        Fix::DeleteStatement => {
            let span = place?;
            let whole = statement_around(span, sources)?;
            let kept = code_end(&sources.get(span.source).text[whole.clone()]);
            let title = "Delete the statement".to_owned();
            Some(Edit { title, span: at(span.source, whole.start, whole.start + kept), text: String::new() })
        }
    }
}

fn replaced(span: Span, text: String, title: Option<&'static str>, sources: &SourceMap) -> Edit {
    let title = match (title, sources.snippet(span).trim(), text.trim()) {
        (Some(title), ..) => title.to_owned(),
        (None, "", new) => format!("Put in `{new}`"),
        (None, old, "") => format!("Delete `{old}`"),
        (None, _, new) => format!("Replace by `{new}`"),
    };
    Edit { title, span, text }
}

/// The bytes of the statement around a place.
fn statement_around(span: Span, sources: &SourceMap) -> Option<std::ops::Range<usize>> {
    let ranges = statement_ranges(&sources.get(span.source).text);
    ranges.into_iter().find(|r| r.contains(&(span.start as usize)))
}

fn at(source: SourceId, start: usize, end: usize) -> Span {
    // texts are at most TEXT_LIMIT bytes, so positions fit
    Span { source, start: start as u32, end: end as u32 }
}

/// Bytes of the lines of a statement without the comments and blank lines behind it.
fn code_end(text: &str) -> usize {
    let mut end = 0;
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        at += line.len();
        let content = line.trim_start();
        if !content.is_empty() && !content.starts_with('#') {
            end = at;
        }
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{NoFiles, resolve};

    const SCENE: &str = "mesh box [0,0] to [1,1] cells [8,8] quad\nparam gamma = 2\nunknown u : scalar\n";

    /// The text with the first fix of its first message.
    fn cured(text: &str) -> String {
        let mut sources = SourceMap::new();
        let main = sources.add("scene.wfl", text);
        let found = resolve(&mut sources, main, &mut NoFiles, &[]).diagnostics;
        let error = found.iter().find(|d| d.is_error()).or(found.first());
        let first = error.unwrap_or_else(|| panic!("no message: {text}"));
        let edits = edits(first, &sources);
        let edit = edits.first().unwrap_or_else(|| panic!("no fix: {first:?}"));
        let range = edit.span.start as usize..edit.span.end as usize;
        let mut text = text.to_owned();
        text.replace_range(range, &edit.text);
        text
    }

    #[test]
    fn a_fix_makes_the_text_that_was_meant() {
        for (wrong, right) in [
            ("term on all : gamma**2*u*Test_u", "term on all : gamma^2*u*Test_u"),
            ("trem on all : gamma*u*Test_u", "term on all : gamma*u*Test_u"),
            ("term on al : gamma*u*Test_u", "term on all : gamma*u*Test_u"),
            ("term on all : gamma*u*Test_u;", "term on all : gamma*u*Test_u"),
            ("term on all : gamma u*Test_u", "term on all : gamma*u*Test_u"),
            ("term on all : gamma\u{2212}u*Test_u", "term on all : gamma-u*Test_u"),
            ("term on all : gamma*(u*Test_u]", "term on all : gamma*(u*Test_u)"),
            ("param b = 1d5\nterm on all : gamma*u*Test_u*b", "param b = 1e5\nterm on all : gamma*u*Test_u*b"),
            ("term on all : gamma*u*Test_u\nparam d = 1", "term on all : gamma*u*Test_u\n"),
            ("term on all : gamma*u\n*Test_u", "term on all : gamma*u\n    *Test_u"),
            ("fix u == 0 on all\nterm on all : gamma*u*Test_u", "fix u = 0 on all\nterm on all : gamma*u*Test_u"),
            (
                "solver newton with tl=1e-8\nterm on all : gamma*u*Test_u",
                "solver newton with tol=1e-8\nterm on all : gamma*u*Test_u",
            ),
            ("param b = 3 kN\nterm on all : u*Test_u*b", "param b = 3 [kN]\nterm on all : u*Test_u*b"),
            ("param b = 3 [N/mm2]\nterm on all : u*Test_u*b", "param b = 3 [N/mm^2]\nterm on all : u*Test_u*b"),
            ("term on all : u*Test_u = 0", "term on all : u*Test_u"),
            ("param b = 0,3\nterm on all : u*Test_u*b", "param b = 0.3\nterm on all : u*Test_u*b"),
            ("term on all : Grad_u[0]*Test_u", "term on all : Grad_u(1)*Test_u"),
            ("fix u.n = 0 on all\nterm on all : u*Test_u", "fix u.Normal = 0 on all\nterm on all : u*Test_u"),
            ("fix u.x = 0 on all\nterm on all : u*Test_u", "fix u(1) = 0 on all\nterm on all : u*Test_u"),
            ("term on all : (0,1).Grad_u*Test_u", "term on all : [0,1].Grad_u*Test_u"),
            ("term on all : gamma*(u*Test_u # all", "term on all : gamma*(u*Test_u) # all"),
            ("term on all : gamma*u*Test_u)", "term on all : gamma*u*Test_u"),
            ("term on all : u*Test_u*sin x", "term on all : u*Test_u*sin(x)"),
            ("% comment\nterm on all : u*Test_u", "# comment\nterm on all : u*Test_u"),
            ("term on all : u*Test_u*pi()", "term on all : u*Test_u*pi"),
            ("term on all : \u{2016}Grad_u\u{2016}*Test_u", "term on all : Norm(Grad_u)*Test_u"),
            ("term on all : u*Test_u*tan(\u{bd})", "term on all : u*Test_u*tan((1/2))"),
            ("term on all : Grad_u.(1, sin(0))*Test_u", "term on all : Grad_u.[1, sin(0)]*Test_u"),
            ("term on all : u*Test_u = 0.0", "term on all : u*Test_u"),
            ("term on all : u*Test_u == gamma*Test_u", "term on all : u*Test_u - (gamma*Test_u)"),
            ("const b = 5\nterm on all : b*u*Test_u", "param b = 5\nterm on all : b*u*Test_u"),
            ("fix u = 0 all\nterm on all : u*Test_u", "fix u = 0 on all\nterm on all : u*Test_u"),
            ("region r = left || right\nterm on r : u*Test_u", "region r = left + right\nterm on r : u*Test_u"),
            ("b = 5\nterm on all : b*u*Test_u", "param b = 5\nterm on all : b*u*Test_u"),
            ("term on all : tr(Id(2))*u*Test_u", "term on all : Trace(Id(2))*u*Test_u"),
            (
                "output vtk \u{201c}a\u{201d} : u\nterm on all : u*Test_u",
                "output vtk \"a\" : u\nterm on all : u*Test_u",
            ),
            (
                "solver newton with tol=1e-8 max_iter=9\nterm on all : u*Test_u",
                "solver newton with tol=1e-8, max_iter=9\nterm on all : u*Test_u",
            ),
        ] {
            assert_eq!(cured(&format!("{SCENE}{wrong}\n")).trim_end(), format!("{SCENE}{right}").trim_end(), "{wrong}");
        }
    }

    #[test]
    fn what_is_missing_is_put_in() {
        let text = cured("mesh box [0,0] to [1,1] cells [8,8] quad\nterm on all : w*Test_w\n");
        assert!(text.contains("\nunknown w : vector\nterm on all"), "{text}");
        let text = cured("mesh box [0,0] to [1,1] cells [8,8] quad\nunknown u : scalar\n");
        assert!(text.ends_with("unknown u : scalar\nterm on all : Grad_u.Grad_Test_u - Test_u\n"), "{text}");
    }

    #[test]
    fn a_first_line_that_is_indented_is_moved() {
        assert!(cured(&format!("  {SCENE}term on all : gamma*u*Test_u\n")).starts_with("mesh box"));
    }
}
