//! The cure of a message as a change of the text, where the message leaves no choice: what an editor offers as a fix.
//!
//! Read off the words of the message, so a message and its cure cannot disagree. A cure that would need a guess is left
//! out.

use crate::{
    Diagnostic, SourceId, SourceMap, Span,
    keywords::STATEMENTS,
    parse::{parse, statement_ranges},
    quote::unquoted,
    words::split_prefixes,
};

/// A change of one place that takes a message away.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cure {
    /// What it does, ready for a menu.
    pub title: String,
    /// What is replaced; empty where something is put in.
    pub span: Span,
    /// What stands there then.
    pub text: String,
}

/// Operators of other languages and what each is here.
const OPERATORS: &[(&str, &str)] = &[
    ("**", "^"),
    ("===", "=="),
    ("!==", "!="),
    ("...", ".."),
    ("&&", " and "),
    ("||", " or "),
    ("//", "#"),
    ("=<", "<="),
    ("=>", ">="),
    ("<>", "!="),
    ("~=", "!="),
    ("->", "="),
    ("$", ""),
    ("\\", ""),
    ("`", ""),
];

/// The changes that a message asks for; none where there is a choice, or where no text is to blame.
#[must_use]
pub fn cures(diagnostic: &Diagnostic, sources: &SourceMap) -> Vec<Cure> {
    let finder = Finder { diagnostic, sources };
    let mut found: Vec<Cure> = finder.nearest().into_iter().collect();
    if let Some(span) = diagnostic.labels.first().map(|l| l.span) {
        found.extend(finder.replaced(span));
        found.extend(finder.moved(span));
    }
    found.extend(finder.added());
    found
}

struct Finder<'a> {
    diagnostic: &'a Diagnostic,
    sources: &'a SourceMap,
}

impl Finder<'_> {
    fn text(&self, span: Span) -> &str {
        self.sources.snippet(span)
    }

    fn helps(&self) -> impl Iterator<Item = String> + '_ {
        self.diagnostic.helps.iter().map(|h| unquoted(h, self.sources))
    }

    fn replace(&self, span: Span, text: impl Into<String>) -> Cure {
        let text = text.into();
        let title = match (self.text(span).trim(), text.trim()) {
            ("", here) => format!("Put in `{here}`"),
            (there, "") => format!("Delete `{there}`"),
            (_, here) => format!("Replace by `{here}`"),
        };
        Cure { title, span, text }
    }

    /// `did you mean gamma?`: the name in place of the word, behind the prefixes that are written.
    fn nearest(&self) -> Option<Cure> {
        let label = self.diagnostic.labels.iter().find(|l| l.text.contains("did you mean `"))?;
        let text = unquoted(&label.text, self.sources);
        let name = text.split_once("did you mean `")?.1.split_once('`')?.0;
        let written = self.text(label.span);
        if written.is_empty() || !written.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            return None;
        }
        let (prefixes, root) = split_prefixes(written);
        let of_root = self.diagnostic.about.as_deref() == Some(root) && split_prefixes(name).0.is_empty();
        let kept = if of_root { prefixes } else { "" };
        Some(self.replace(label.span, format!("{kept}{name}")))
    }

    /// What stands at the mark, written as it is written here.
    fn replaced(&self, span: Span) -> Option<Cure> {
        let written = self.text(span);
        if matches!(self.diagnostic.code, "E107" | "E118")
            && let Some((_, here)) = OPERATORS.iter().find(|o| o.0 == written)
        {
            return Some(self.replace(span, *here));
        }
        let label = &self.diagnostic.labels.first()?.text;
        if let Some(bracket) = label.strip_suffix("` belongs here").and_then(|l| l.strip_prefix('`')) {
            return Some(self.replace(span, bracket));
        }
        self.helps().find_map(|help| self.by_help(span, &help))
    }

    /// The cure that one help says.
    fn by_help(&self, span: Span, help: &str) -> Option<Cure> {
        if let Some(word) = help.strip_prefix("write `").and_then(|h| h.strip_suffix('`')) {
            return (!word.contains('`')).then(|| self.replace(span, word));
        }
        if help == "write an ordinary space" {
            return Some(self.replace(span, " "));
        }
        if let Some((word, wrong)) = help
            .split_once(" in place of `")
            .map(|(here, there)| (here.rsplit("write `").next().unwrap_or(""), there.trim_end_matches('`')))
        {
            return self.first_word(span, wrong, word.trim_end_matches('`'));
        }
        if help == "delete it" || help.starts_with("delete it: ") {
            return Some(self.replace(span, ""));
        }
        if help.starts_with("a product is written with `*`") && self.diagnostic.code != "E105" {
            // the blanks before the second factor go
            let before = self.sources.get(span.source).text.get(..span.start as usize)?.trim_end().len();
            return Some(self.replace(at(span.source, before, span.start as usize), "*"));
        }
        const WHOLE: &[&str] = &[
            "a text stands in double quotes: ",
            "digits are not grouped: ",
            "a power of ten is written with e: ",
            "`:` contracts both indices: ",
        ];
        let text = WHOLE.iter().find_map(|start| help.strip_prefix(start))?;
        (self.diagnostic.labels.len() == 1).then(|| self.replace(span, text))
    }

    /// Another word at the start of the statement.
    fn first_word(&self, span: Span, wrong: &str, word: &str) -> Option<Cure> {
        let text = &self.sources.get(span.source).text;
        let start = self.statement(span)?.start;
        text[start..].starts_with(wrong).then(|| self.replace(at(span.source, start, start + wrong.len()), word))
    }

    /// Lines that belong elsewhere: indented first lines, continued lines in column 1, statements that nothing needs.
    fn moved(&self, span: Span) -> Option<Cure> {
        let text = &self.sources.get(span.source).text;
        let start = span.start as usize;
        let line = text.get(..start)?.rfind('\n').map_or(0, |k| k + 1);
        if self.diagnostic.message == "a statement starts in column 1" {
            let title = "Move to column 1".to_owned();
            return Some(Cure { title, span: at(span.source, line, start), text: String::new() });
        }
        if line == start && self.helps().any(|h| h.starts_with("a continuation line is indented")) {
            let title = "Indent: the statement above goes on here".to_owned();
            return Some(Cure { title, span: at(span.source, start, start), text: "    ".to_owned() });
        }
        if self.diagnostic.code == "W702" {
            let whole = self.statement(span)?;
            let kept = code_end(&text[whole.clone()]);
            let title = "Delete the statement".to_owned();
            return Some(Cure { title, span: at(span.source, whole.start, whole.start + kept), text: String::new() });
        }
        None
    }

    /// The statement around a place.
    fn statement(&self, span: Span) -> Option<std::ops::Range<usize>> {
        let ranges = statement_ranges(&self.sources.get(span.source).text);
        ranges.into_iter().find(|r| r.contains(&(span.start as usize)))
    }

    /// A help that is a statement is put in before the statement with the mistake, or at the end of the scene.
    fn added(&self) -> Option<Cure> {
        let help = self.helps().find_map(|help| {
            let first = help.split(", or ").next().unwrap_or(&help).to_owned();
            [help, first].into_iter().find(|h| is_statement(h))
        })?;
        let place = self.diagnostic.labels.first().map(|l| l.span);
        let (source, position) = match place {
            Some(span) => (span.source, self.statement(span)?.start),
            None => {
                let (source, main) = self.sources.iter().next()?;
                (source, main.text.len())
            }
        };
        let text = &self.sources.get(source).text;
        let before = if position > 0 && !text[..position].ends_with('\n') { "\n" } else { "" };
        let title = format!("Add `{help}`");
        Some(Cure { title, span: at(source, position, position), text: format!("{before}{help}\n") })
    }
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

/// True for a text that is one statement as it stands, without a word that stands for another (`REGION`).
fn is_statement(text: &str) -> bool {
    let words = || text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    let placeholder = |w: &str| w.len() > 3 && w.chars().all(|c| c.is_ascii_uppercase());
    if !STATEMENTS.contains(&words().next().unwrap_or("")) || words().any(placeholder) || text.contains('\n') {
        return false;
    }
    let mut sources = SourceMap::new();
    let id = sources.add("", text);
    let parsed = parse(&sources, id);
    parsed.diagnostics.is_empty() && parsed.value.is_some_and(|s| s.items.len() == 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{NoFiles, resolve};

    const SCENE: &str = "mesh box [0,0] to [1,1] cells [8,8] quad\nparam gamma = 2\nunknown u : scalar\n";

    /// The text with the first cure of its first message.
    fn cured(text: &str) -> String {
        let mut sources = SourceMap::new();
        let main = sources.add("scene.wfl", text);
        let found = resolve(&mut sources, main, &mut NoFiles, &[]).diagnostics;
        let first = found.first().unwrap_or_else(|| panic!("no message: {text}"));
        let cures = cures(first, &sources);
        let cure = cures.first().unwrap_or_else(|| panic!("no cure: {first:?}"));
        let range = cure.span.start as usize..cure.span.end as usize;
        let mut text = text.to_owned();
        text.replace_range(range, &cure.text);
        text
    }

    #[test]
    fn a_cure_makes_the_text_that_was_meant() {
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
        assert!(
            is_statement("split u across crack") && !is_statement("fix u = 0 on REGION") && !is_statement("cg, amg")
        );
    }

    #[test]
    fn a_first_line_that_is_indented_is_moved() {
        assert!(cured(&format!("  {SCENE}term on all : gamma*u*Test_u\n")).starts_with("mesh box"));
    }
}
