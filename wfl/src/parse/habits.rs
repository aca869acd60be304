//! What people type out of habit from other languages and from paper, where the grammar alone would name the wrong cause.

use super::{
    Pair, Rule, is_statement,
    slip::{CHOICE, Slip},
};
use crate::{
    codes::Code,
    diag::Diagnostic,
    foreign::{foreign, form},
    source::Span,
    units::is_unit,
    words::is_function,
};

/// E128 for the semicolons behind statements, the first marked: one message for all of a file.
pub(super) fn semicolons(ended: &[Span]) -> Option<Diagnostic> {
    let first = ended.first()?;
    let d = Diagnostic::new(Code::E128, "a statement ends without `;`").at(*first, "");
    let d = if ended.len() > 1 { d.note(format!("{} more statements end so", ended.len() - 1)) } else { d };
    Some(d.help("delete it: a statement ends where the next line starts in column 1").replace(*first, ""))
}

/// The place and the length of a comparison for equality on the top level of an expression.
pub(super) fn equation_in(expr: &Pair<'_>) -> Option<(usize, usize)> {
    let mut parts = expr.clone().into_inner().filter(|p| p.as_rule() == Rule::infix);
    parts.find(|p| p.as_str() == "==").map(|p| (p.as_span().start(), p.as_str().len()))
}

/// E116 for a term that is written as an equation; `side` is the sign with what stands behind it.
pub(super) fn equation_as_term(sign: &str, right: &str, side: Span) -> Diagnostic {
    let d = Diagnostic::new(Code::E116, "a term is a residual: all terms together are zero, so it has no other side");
    if right.trim_end_matches(['.', '0']).is_empty() && right.starts_with('0') {
        return d.help(format!("leave `{sign} 0` out")).replace(side, "");
    }
    // a right side on one line and without a further sign is taken over as it is
    let is_plain = !right.is_empty() && !right.contains(['=', '<', '>', '\n']);
    let d = if is_plain { d.replace(side, format!(" - ({right})")) } else { d };
    d.help(format!(
        "bring the right side to the left: term name on REGION : left - (right), in place of left {sign} right"
    ))
}

impl Slip<'_> {
    /// The message for a habit that is recognised at the slip.
    pub(super) fn habit(&self, found: &str) -> Option<Diagnostic> {
        let behind_value = self.expects(Rule::infix);
        match found {
            _ if self.expects(Rule::k_then) || self.expects(Rule::k_else) => {
                let d = Diagnostic::new(Code::E113, format!("expected {}, found `{found}`", self.list()));
                Some(self.mark(d, found, "").help(CHOICE))
            }
            "=" if behind_value && self.is("term") => {
                let right = self.masked[self.at + 1..].trim();
                let side = self.span(self.before().len(), self.masked.trim_end().len());
                Some(self.mark(equation_as_term("=", right, side), found, ""))
            }
            "[" => self.bracket(behind_value),
            "<" if !behind_value && self.expects_operand() => {
                let d = Diagnostic::new(Code::E113, "`<` stands between two numbers that are compared");
                Some(self.mark(d, found, "").help("the scalar product is a.b, of matrices A:B"))
            }
            "," => self.comma(),
            "{" => {
                let d = Diagnostic::new(Code::E113, "a vector stands in square brackets");
                let d = self
                    .mark(d, found, "")
                    .help("[1,2] is a vector, [1,2;3,4] a matrix; `{a, b}` is the set of a param");
                let inside =
                    self.masked[self.at + 1..].split_once('}').map(|s| s.0).filter(|i| !i.contains(['{', '\n']));
                Some(inside.into_iter().fold(d, |d, i| d.replace(self.here(i.len() + 2), format!("[{i}]"))))
            }
            "if" if behind_value && !self.in_list_of_words() => {
                let d = Diagnostic::new(Code::E113, "a choice begins with its condition");
                Some(self.mark(d, found, "").help("(if condition then a else b), in place of a if condition else b"))
            }
            ")" if self.before().ends_with('(') => {
                let d = Diagnostic::new(Code::E113, "nothing stands in these parentheses");
                let d = self.mark(d, found, "").help("a name without arguments stands without them: pi, not pi()");
                Some(d.replace(self.span(self.before().len() - 1, self.at + 1), ""))
            }
            "where" | "==" | "<" | ">" | "<=" | ">=" if self.expects(Rule::EOI) && self.takes_regions() => {
                let d = Diagnostic::new(Code::E117, format!("`{found}` stands after the end of the statement"));
                let help = "places are picked by a statement of their own: region part = faces where y > 0.5";
                Some(self.mark(d, found, "").help(help))
            }
            "on" if self.expects(Rule::EOI) && self.is("start") => {
                let d = Diagnostic::new(Code::E117, "`start` gives first values wherever the field lives");
                let d = self.mark(d, found, "");
                let d = d.help("leave `on ...` out; a choice: start u = (if x < 0.5 then a else b)");
                Some(d.replace(self.with_blanks_before(self.masked.trim_end().len() - self.at), ""))
            }
            _ if self.expects(Rule::k_Normal) => self.component_behind_point(found),
            _ if behind_value => self.missing_word(found).or_else(|| self.unit_or_digits(found)),
            _ => self.missing_word(found),
        }
    }

    fn is(&self, statement: &str) -> bool {
        self.statement
            && self
                .masked
                .strip_prefix(statement)
                .is_some_and(|rest| !rest.starts_with(|c: char| c.is_ascii_alphanumeric()))
    }

    /// Statements that end in a list of regions.
    fn takes_regions(&self) -> bool {
        ["fix", "load", "measure", "split", "quadrature"].iter().any(|s| self.is(s))
    }

    /// `fix u.x = 0`.
    fn component_behind_point(&self, found: &str) -> Option<Diagnostic> {
        let d = Diagnostic::new(Code::E113, format!("expected `Normal`, found `{found}`"));
        let d = self.mark(d, found, "");
        let by = "a component is taken with its number, the normal one by name";
        match found {
            "x" | "y" | "z" => {
                let number = format!("({})", 1 + "xyz".find(found)?);
                let point = self.before().len() - 1;
                Some(d.help(format!("{by}: u{number}")).replace(self.span(point, self.at + 1), number))
            }
            "n" | "N" => Some(d.help(format!("{by}: u.Normal")).replace(self.here(1), "Normal")),
            _ => None,
        }
    }

    /// Two values side by side where a word of the statement or a comma is missing rather than an operator.
    fn missing_word(&self, found: &str) -> Option<Diagnostic> {
        let is_word = found.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        if !self.expects(Rule::infix) || !is_word {
            return None;
        }
        let rest = self.masked[self.at + found.len()..].trim_start();
        if rest.starts_with('=') && !rest.starts_with("==") && self.masked[..self.at].contains(" with ") {
            let d = self.comma_before(found);
            return Some(d.help("options stand one behind the other: with tol=1e-8, max_iter=20"));
        }
        if self.is("output") && !self.before().ends_with(|c: char| c.is_ascii_digit()) {
            return Some(self.comma_before(found).help("output vtk \"name\" : u, expression as name"));
        }
        if let Some(here) = foreign(found).filter(|_| ["dx", "ds", "dS", "dA", "dV"].contains(&found)) {
            let d = Diagnostic::new(Code::E216, format!("`{found}` is not a word of this language"));
            return Some(self.mark(d, found, "").help(format!("{found}: {here}")));
        }
        let before = self.before();
        let start = before.rfind(|c: char| !c.is_ascii_alphanumeric() && c != '_').map_or(0, |i| i + 1);
        if is_function(&before[start..]) {
            let d = Diagnostic::new(Code::E113, format!("`{}` takes its arguments in parentheses", &before[start..]));
            let d = self.mark(d, found, "").help(format!("{}({found})", &before[start..]));
            return Some(d.replace(self.with_blanks_before(found.len()), format!("({found})")));
        }
        // a word that the statement needs and that does not follow either
        let needed = [(Rule::k_on, "on"), (Rule::k_to, "to"), (Rule::k_by, "by")];
        let follows = |word: &str| self.masked[self.at..].split_whitespace().any(|w| w == word);
        let (_, word) = needed.iter().find(|(rule, word)| self.expects(*rule) && !follows(word))?;
        let d = Diagnostic::new(Code::E113, format!("expected `{word}`, found `{found}`"));
        let form = form(self.masked.split_whitespace().next().unwrap_or(""))?;
        let d = self.mark(d, found, format!("`{word}` is missing before this")).help(format!("the form is: {form}"));
        let mended = format!("{}{word} {}", &self.masked[..self.at], &self.masked[self.at..]);
        Some(if is_statement(&mended, self.id) { d.replace(self.here(0), format!("{word} ")) } else { d })
    }

    /// E113 for two items of a list side by side.
    fn comma_before(&self, found: &str) -> Diagnostic {
        let d = Diagnostic::new(Code::E113, format!("a comma is missing before `{found}`"));
        self.mark(d, found, "").replace(self.with_blanks_before(found.len()), format!(", {found}"))
    }

    /// A region list may be followed by anything but a choice.
    fn in_list_of_words(&self) -> bool {
        self.before().ends_with(|c: char| "+-*/.:^@,(".contains(c))
    }

    /// `u[1]`, `3 [MPa] in 0..1`, `load u = [0,-1] [MPa]`.
    fn bracket(&self, behind_value: bool) -> Option<Diagnostic> {
        let rest = &self.masked[self.at + 1..];
        let inside = rest.split([']', '\n']).next().unwrap_or(rest).trim();
        let unit =
            inside.split(['*', '/', '^', '(', ')']).all(|w| is_unit(w.trim()) || w.trim().parse::<i32>().is_ok());
        let word_before = self.masked[..self.at].ends_with(|c: char| c.is_ascii_alphanumeric() || "_)]'".contains(c));
        if unit && inside.contains(|c: char| c.is_ascii_alphabetic()) {
            let d = Diagnostic::new(Code::E113, format!("the unit `[{inside}]` cannot stand here"));
            let form = if self.is("param") {
                format!("it stands behind the value: param name = 1 [{inside}] in 0..2")
            } else if ["unknown", "multiplier", "data", "state"].iter().any(|s| self.is(s)) {
                format!("it stands last: unknown u : vector P2 on REGION [{inside}]")
            } else {
                format!("units are declared with params and fields: param p = 1 [{inside}]")
            };
            return Some(self.mark(d, "[", "").help(form));
        }
        if !word_before || !(behind_value || self.expects(Rule::t_open) || self.expects(Rule::component)) {
            return None;
        }
        let d = Diagnostic::new(Code::E113, "a component is taken with parentheses");
        // more brackets inside are slips of their own
        let closed = rest.find(']').filter(|n| !rest[..*n].contains(['[', '(', '\n']));
        let d = self.mark(d, "[", "");
        let offer = |d: Diagnostic, before: usize, text: String| match closed {
            Some(n) => d.replace(self.span(self.at - before, self.at + n + 2), text),
            None => d,
        };
        Some(match inside.parse::<usize>() {
            Ok(k) if self.is_coordinate() => {
                let meant = ["x", "y", "z"].get(k).copied().unwrap_or("z");
                let d = d.help(format!("the coordinates are `x`, `y`, `z`: x[{k}] is {meant}"));
                offer(d, 1, meant.to_owned())
            }
            Ok(0) => offer(d.help("indices count from 1: the first component is u(1)"), 0, "(1)".to_owned()),
            _ => {
                let d = d.help(format!("u({inside}): indices count from 1, A(1,2) is row 1, column 2"));
                offer(d, 0, format!("({inside})"))
            }
        })
    }

    /// True if the word before the slip is `x` alone.
    fn is_coordinate(&self) -> bool {
        self.before().rsplit(|c: char| !c.is_ascii_alphanumeric() && c != '_').next() == Some("x")
    }

    /// `(0,-1)`, `0,5`, `1,000`.
    fn comma(&self) -> Option<Diagnostic> {
        if let Some(open) = self.open_parenthesis() {
            let callee = self.masked[..open].trim_end();
            let word = callee.rsplit(|c: char| !c.is_ascii_alphanumeric() && c != '_').next().unwrap_or("");
            if callee.ends_with(|c: char| c.is_ascii_alphanumeric() || "_)'".contains(c))
                && !["on", "to", "by", "map"].contains(&word)
            {
                return None;
            }
            let close = self.closing_parenthesis();
            let end = close.unwrap_or(self.masked.len());
            let inside: String = self.masked[open + 1..end].split_whitespace().collect();
            if let Some((a, b)) = inside.split_once(',').filter(|_| inside.contains("Test_")) {
                let d = Diagnostic::new(Code::E113, "the product of a form is no pair in parentheses");
                return Some(
                    self.mark(d, ",", "").help(format!("the scalar product is a.b, of matrices A:B: {a}.{b}")),
                );
            }
            let d = Diagnostic::new(Code::E113, "a vector stands in square brackets");
            let short = if inside.len() <= 60 { format!("[{inside}]") } else { "[a, b]".to_owned() };
            let d = self.mark(d, ",", "").help(short);
            let written = |close: usize| format!("[{}]", &self.masked[open + 1..close]);
            return Some(close.into_iter().fold(d, |d, end| d.replace(self.span(open, end + 1), written(end))));
        }
        let (before, behind) = (self.before(), self.masked[self.at + 1..].trim_start_matches(' '));
        let left = &before[before.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| i + 1)..];
        let right = &behind[..behind.find(|c: char| !c.is_ascii_digit() && c != ',').unwrap_or(behind.len())];
        let right = right.trim_end_matches(',');
        if left.is_empty() || right.is_empty() || !self.expects(Rule::infix) {
            return None;
        }
        let d = Diagnostic::new(Code::E120, format!("`{left},{right}` is not a number"));
        let start = before.len() - left.len();
        let mark = self.span(start, self.masked.len() - behind.len() + right.len());
        let d = d.at(mark, "");
        let groups: Vec<&str> = right.split(',').collect();
        let grouped = left != "0" && groups.iter().all(|g| g.len() == 3);
        let number = format!("{left}{}", groups.concat());
        let joined = format!("digits are not grouped: {number}");
        if groups.len() > 1 {
            return Some(if grouped {
                d.help(joined).replace(mark, number)
            } else {
                d.help(format!("a list stands in brackets: [{left},{right}]"))
            });
        }
        let d = d.replace(mark, format!("{left}.{right}"));
        let d = if grouped { d.replace(mark, number) } else { d };
        let joined = if grouped { format!("; {joined}") } else { String::new() };
        Some(d.help(format!("the decimal sign is a point: {left}.{right}{joined}; a vector is [{left},{right}]")))
    }

    /// The innermost parenthesis that is open at the slip, if no other bracket is inside it.
    fn open_parenthesis(&self) -> Option<usize> {
        let mut depth = 0usize;
        for (i, c) in self.masked[..self.at].char_indices().rev() {
            match c {
                ')' | ']' | '}' => depth += 1,
                '(' if depth == 0 => return Some(i),
                '[' | '{' if depth == 0 => return None,
                '(' | '[' | '{' => depth -= 1,
                _ => {}
            }
        }
        None
    }

    /// Where the innermost parenthesis that is open at the slip is closed; all of a statement are.
    fn closing_parenthesis(&self) -> Option<usize> {
        let mut depth = 0usize;
        for (i, c) in self.masked[self.at..].char_indices() {
            match c {
                '(' => depth += 1,
                ')' if depth == 0 => return Some(self.at + i),
                ')' => depth -= 1,
                _ => {}
            }
        }
        None
    }

    /// What stands behind a value: `3 MPa`, `1 000`, `[0 1]`.
    fn unit_or_digits(&self, found: &str) -> Option<Diagnostic> {
        let before = self.before();
        if !before.ends_with(|c: char| c.is_ascii_digit() || c == '.') {
            return None;
        }
        let left =
            &before[before.rfind(|c: char| !c.is_ascii_alphanumeric() && c != '.' && c != '_').map_or(0, |i| i + 1)..];
        if !left.starts_with(|c: char| c.is_ascii_digit()) {
            return None;
        }
        if found.starts_with(|c: char| c.is_ascii_digit()) {
            let d = Diagnostic::new(Code::E113, format!("`{left}` and `{found}` stand side by side"));
            let d = self.mark(d, found, "");
            let grouped = format!("digits are not grouped: {left}{found}");
            return Some(d.help(format!("entries of a list are separated by commas: [{left}, {found}]; {grouped}")));
        }
        if self.is("param") && is_unit(found) {
            let end = self.masked[self.at..]
                .find(|c: char| c.is_whitespace() || c == '"')
                .map_or(self.masked.len(), |n| self.at + n);
            let unit = &self.masked[self.at..end];
            let d = Diagnostic::new(Code::E113, format!("a unit stands in brackets: [{unit}]"));
            let d = self.mark(d, found, "").help(format!("{left} [{unit}]"));
            return Some(d.replace(self.with_blanks_before(unit.len()), format!(" [{unit}]")));
        }
        None
    }
}
