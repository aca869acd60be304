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
    ("%", "#"),
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
        // the word of a unit that is marked whole
        if let Some(wrong) = self.diagnostic.message.strip_prefix("unknown unit `").and_then(|m| m.strip_suffix('`'))
            && let Some(k) = written.find(wrong)
        {
            let start = label.span.start as usize + k;
            return Some(self.replace(at(label.span.source, start, start + wrong.len()), name));
        }
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
        let quoted = |end: &str| label.strip_suffix(end).and_then(|l| l.strip_prefix('`'));
        if let Some(bracket) = quoted("` belongs here") {
            return Some(self.replace(span, bracket));
        }
        if label == "no bracket is open here" {
            return Some(self.replace(span, ""));
        }
        if let Some(bracket) = quoted("` is missing").filter(|b| matches!(*b, ")" | "]" | "}")) {
            let end = self.code_end_of_line(span)?;
            return Some(self.replace(at(span.source, end, end), bracket));
        }
        self.helps().find_map(|help| self.by_help(span, &help))
    }

    /// The cure that one help says, in place of the mark.
    fn by_help(&self, span: Span, help: &str) -> Option<Cure> {
        const WHOLE: &[&str] = &[
            "a text stands in double quotes: ",
            "digits are not grouped: ",
            "a power of ten is written with e: ",
            "`:` contracts both indices: ",
            "by ",
        ];
        let alone = self.diagnostic.labels.len() == 1;
        if let Some(text) = WHOLE.iter().find_map(|start| help.strip_prefix(start)).filter(|_| alone) {
            return Some(self.replace(span, text));
        }
        match help {
            "write an ordinary space" => return Some(self.replace(span, " ")),
            "write `\"`" => return Some(self.plain_quotes(span)),
            "write `term` in place of `energy`" => return self.first_word(span, "energy", "term"),
            // with a test function in it, something else is wrong
            _ if help.ends_with("write `energy` in place of `term`") => {
                let whole = self.statement(span)?;
                let text = &self.sources.get(span.source).text[whole];
                return if text.contains("Test_") { None } else { self.first_word(span, "term", "energy") };
            }
            _ if help == "delete it" || help.starts_with("delete it: ") => return Some(self.replace(span, "")),
            _ => {}
        }
        if let Some(rest) = help.strip_prefix("write `")
            && let Some((word, behind)) = rest.split_once('`')
            && (behind.is_empty() || behind.starts_with(" for "))
            && !word.contains("..")
        {
            return Some(self.replace(span, word));
        }
        if let Some(start) = help.strip_prefix("the decimal sign is a point: ")
            && let Some(number) = start.split(';').next()
            && number.replace('.', ",") == self.text(span)
        {
            return Some(self.replace(span, number));
        }
        if let Some(zeros) = help.strip_prefix("a vector is written with all its components: ")
            && self.text(span) == "0"
        {
            return Some(self.replace(span, zeros));
        }
        self.renamed(span, help).or_else(|| self.around(span, help))
    }

    /// A function that has another name here: `norm: the norm of a vector or matrix is `Norm(v)``.
    fn renamed(&self, span: Span, help: &str) -> Option<Cure> {
        let written = self.text(span);
        let (_, here) = help.strip_prefix(written)?.strip_prefix(": ")?.split_once(" is `")?;
        let (name, argument) = here.strip_suffix("`")?.split_once('(')?;
        let called = self.behind(span).starts_with('(');
        (called && matches!(argument, "v)" | "A)" | "t)")).then(|| self.replace(span, name))
    }

    /// What stands behind a mark.
    fn behind(&self, span: Span) -> &str {
        self.sources.get(span.source).text.get(span.end as usize..).unwrap_or("")
    }

    /// What stands before a mark, and where it ends without blanks.
    fn before(&self, span: Span) -> &str {
        self.sources.get(span.source).text.get(..span.start as usize).unwrap_or("").trim_end()
    }

    /// The cure that one help says, where more than the mark changes.
    fn around(&self, span: Span, help: &str) -> Option<Cure> {
        let written = self.text(span);
        let before = self.before(span);
        let from = |start: usize, end: usize, text: String| Some(self.replace(at(span.source, start, end), text));
        let (start, end) = (span.start as usize, span.end as usize);
        if help.starts_with("leave `") && help.ends_with("= 0` out") {
            let zero = self.behind(span).trim_start();
            let length = self.behind(span).len() - zero.len() + 1;
            return if zero.starts_with('0') { from(before.len(), end + length, String::new()) } else { None };
        }
        if help.starts_with("a product is written with `*`") && self.diagnostic.code == "E113" {
            let follows = before.ends_with(|c: char| c.is_ascii_alphanumeric() || c == '_' || c == ')');
            return if follows { from(before.len(), start, "*".to_owned()) } else { None };
        }
        if let Some(meant) = help.strip_prefix("a component is taken with its number, the normal one by name: ") {
            return match meant.split_once('(') {
                Some((_, number)) if before.ends_with('.') => from(before.len() - 1, end, format!("({number}")),
                _ => from(start, end, "Normal".to_owned()),
            };
        }
        if written == "[" && (help.contains("indices count from 1")) {
            let inner = self.behind(span).split(']').next().filter(|i| !i.contains(['[', '(', '\n']))?;
            let index = if inner.trim() == "0" { "1" } else { inner };
            return from(start, end + inner.len() + 1, format!("({index})"));
        }
        if self.diagnostic.message == "a vector stands in square brackets" {
            let open = before.rfind('(')?;
            let close = end + self.behind(span).find(')')?;
            return from(open, close + 1, help.to_owned());
        }
        // a unit behind a number, an argument behind a function
        let put_behind = |left: &str, text: String| before.ends_with(left).then_some((before.len(), text));
        let (start, text) = match (help.split_once(" ["), help.split_once('(')) {
            (Some((left, unit)), _) if *unit == format!("{written}]") => put_behind(left, format!(" [{unit}"))?,
            (_, Some((left, argument))) if *argument == format!("{written})") => {
                put_behind(left, format!("({argument}"))?
            }
            _ if help.starts_with(&format!("a number: param {written} = ")) => {
                return from(start, start, "param ".to_owned());
            }
            _ if help.starts_with("options stand one behind the other") => (before.len(), format!(", {written}")),
            _ => return self.product(span, help),
        };
        from(start, end, text)
    }

    /// The scalar product of two vectors in place of `*`: the first of the products that the help offers.
    fn product(&self, span: Span, help: &str) -> Option<Cure> {
        let (product, _) = help.strip_prefix('`')?.split_once("` for the scalar product")?;
        let (left, right) = product.split_once('.')?;
        let before = self.before(span);
        let factor = before.strip_suffix('*')?;
        let fits = right == self.text(span) && factor.trim_end().ends_with(left);
        fits.then(|| self.replace(at(span.source, factor.len(), span.start as usize), "."))
    }

    /// Quotes of a text processor on the line of the mark, made plain.
    fn plain_quotes(&self, span: Span) -> Cure {
        let rest = self.sources.get(span.source).text.get(span.start as usize..).unwrap_or("");
        let line = rest.lines().next().unwrap_or("");
        let typographic = |c: char| matches!(c, '\u{201c}'..='\u{201f}' | '\u{ab}' | '\u{bb}');
        let length =
            line.rfind(typographic).map_or(line.len(), |k| k + line[k..].chars().next().map_or(1, char::len_utf8));
        let text = line[..length].replace(typographic, "\"");
        let title = "Write plain quotes".to_owned();
        Cure { title, span: at(span.source, span.start as usize, span.start as usize + length), text }
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

    /// Where the code of a line ends, if its statement has no other line.
    fn code_end_of_line(&self, span: Span) -> Option<usize> {
        let whole = self.statement(span)?;
        let text = &self.sources.get(span.source).text[whole.clone()];
        let code = &text[..code_end(text)];
        let line = code.lines().next().unwrap_or("");
        let bare = line.split('#').next().unwrap_or(line).trim_end();
        (code.trim_end().len() == line.trim_end().len()).then_some(whole.start + bare.len())
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
            Some(span) => {
                let start = self.statement(span)?.start;
                // the form of the statement that is wrong is no further statement
                let word = help.split(' ').next().unwrap_or("");
                if self.sources.get(span.source).text[start..].starts_with(word) {
                    return None;
                }
                (span.source, start)
            }
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
        let error = found.iter().find(|d| d.is_error()).or(found.first());
        let first = error.unwrap_or_else(|| panic!("no message: {text}"));
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
        assert!(
            is_statement("split u across crack") && !is_statement("fix u = 0 on REGION") && !is_statement("cg, amg")
        );
    }

    #[test]
    fn a_first_line_that_is_indented_is_moved() {
        assert!(cured(&format!("  {SCENE}term on all : gamma*u*Test_u\n")).starts_with("mesh box"));
    }
}
