//! What people type out of habit from other languages and from paper, where the grammar alone would name the wrong cause.

use super::{
    Pair, Rule,
    slip::{CHOICE, Slip},
};
use crate::{
    diag::Diagnostic,
    foreign::{foreign, form},
    source::Span,
    units::is_unit,
    words::is_function,
};

/// E128 for the semicolons behind statements, the first marked: one message for all of a file.
pub(super) fn semicolons(ended: &[Span]) -> Option<Diagnostic> {
    let first = ended.first()?;
    let d = Diagnostic::new("E128", "a statement ends without `;`").at(*first, "");
    let d = if ended.len() > 1 { d.note(format!("{} more statements end so", ended.len() - 1)) } else { d };
    Some(d.help("delete it: a statement ends where the next line starts in column 1"))
}

/// The place and the length of a comparison for equality on the top level of an expression.
pub(super) fn equation_in(expr: &Pair<'_>) -> Option<(usize, usize)> {
    let mut parts = expr.clone().into_inner().filter(|p| p.as_rule() == Rule::infix);
    parts.find(|p| p.as_str() == "==").map(|p| (p.as_span().start(), p.as_str().len()))
}

/// E116 for a term that is written as an equation.
pub(super) fn equation_as_term(sign: &str, right: &str) -> Diagnostic {
    let d = Diagnostic::new("E116", "a term is a residual: all terms together are zero, so it has no other side");
    if right.trim_end_matches(['.', '0']).is_empty() && right.starts_with('0') {
        return d.help(format!("leave `{sign} 0` out"));
    }
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
                let d = Diagnostic::new("E113", format!("expected {}, found `{found}`", self.list()));
                Some(self.mark(d, found, "").help(CHOICE))
            }
            "=" if behind_value && self.is("term") => {
                let right = self.masked[self.at + 1..].trim();
                Some(self.mark(equation_as_term("=", right), found, ""))
            }
            "[" => self.bracket(behind_value),
            "<" if !behind_value && self.expects_operand() => {
                let d = Diagnostic::new("E113", "`<` stands between two numbers that are compared");
                Some(self.mark(d, found, "").help("the scalar product is a.b, of matrices A:B"))
            }
            "," => self.comma(),
            "{" => {
                let d = Diagnostic::new("E113", "a vector stands in square brackets");
                Some(
                    self.mark(d, found, "")
                        .help("[1,2] is a vector, [1,2;3,4] a matrix; `{a, b}` is the set of a param"),
                )
            }
            "if" if behind_value && !self.in_list_of_words() => {
                let d = Diagnostic::new("E113", "a choice begins with its condition");
                Some(self.mark(d, found, "").help("(if condition then a else b), in place of a if condition else b"))
            }
            ")" if self.before().ends_with('(') => {
                let d = Diagnostic::new("E113", "nothing stands in these parentheses");
                Some(self.mark(d, found, "").help("a name without arguments stands without them: pi, not pi()"))
            }
            "where" | "==" | "<" | ">" | "<=" | ">=" if self.expects(Rule::EOI) && self.takes_regions() => {
                let d = Diagnostic::new("E117", format!("`{found}` stands after the end of the statement"));
                let help = "places are picked by a statement of their own: region part = faces where y > 0.5";
                Some(self.mark(d, found, "").help(help))
            }
            "on" if self.expects(Rule::EOI) && self.is("start") => {
                let d = Diagnostic::new("E117", "`start` gives first values wherever the field lives");
                Some(self.mark(d, found, "").help("leave `on ...` out; a choice: start u = (if x < 0.5 then a else b)"))
            }
            _ if self.expects(Rule::k_Normal) => self.component_behind_point(found),
            _ => self.missing_word(found).or_else(|| self.unit_or_digits(found, behind_value)),
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
        let meant = match found {
            "x" | "y" | "z" => format!("u({})", 1 + "xyz".find(found)?),
            "n" | "N" => "u.Normal".to_owned(),
            _ => return None,
        };
        let d = Diagnostic::new("E113", format!("expected `Normal`, found `{found}`"));
        Some(
            self.mark(d, found, "")
                .help(format!("a component is taken with its number, the normal one by name: {meant}")),
        )
    }

    /// Two values side by side where a word of the statement or a comma is missing rather than an operator.
    fn missing_word(&self, found: &str) -> Option<Diagnostic> {
        let is_word = found.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        if !self.expects(Rule::infix) || !is_word {
            return None;
        }
        let rest = self.masked[self.at + found.len()..].trim_start();
        if rest.starts_with('=') && !rest.starts_with("==") && self.masked[..self.at].contains(" with ") {
            let d = Diagnostic::new("E113", format!("a comma is missing before `{found}`"));
            return Some(
                self.mark(d, found, "").help("options stand one behind the other: with tol=1e-8, max_iter=20"),
            );
        }
        if self.is("output") && !self.before().ends_with(|c: char| c.is_ascii_digit()) {
            let d = Diagnostic::new("E113", format!("a comma is missing before `{found}`"));
            return Some(self.mark(d, found, "").help("output vtk \"name\" : u, expression as name"));
        }
        if let Some(here) = foreign(found).filter(|_| ["dx", "ds", "dS", "dA", "dV"].contains(&found)) {
            let d = Diagnostic::new("E216", format!("`{found}` is not a word of this language"));
            return Some(self.mark(d, found, "").help(format!("{found}: {here}")));
        }
        let before = self.before();
        let start = before.rfind(|c: char| !c.is_ascii_alphanumeric() && c != '_').map_or(0, |i| i + 1);
        if is_function(&before[start..]) {
            let d = Diagnostic::new("E113", format!("`{}` takes its arguments in parentheses", &before[start..]));
            return Some(self.mark(d, found, "").help(format!("{}({found})", &before[start..])));
        }
        // a word that the statement needs and that does not follow either
        let needed = [(Rule::k_on, "on"), (Rule::k_to, "to"), (Rule::k_by, "by")];
        let follows = |word: &str| self.masked[self.at..].split_whitespace().any(|w| w == word);
        let (_, word) = needed.iter().find(|(rule, word)| self.expects(*rule) && !follows(word))?;
        let d = Diagnostic::new("E113", format!("expected `{word}`, found `{found}`"));
        let form = form(self.masked.split_whitespace().next().unwrap_or(""))?;
        Some(self.mark(d, found, format!("`{word}` is missing before this")).help(format!("the form is: {form}")))
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
            let d = Diagnostic::new("E113", format!("the unit `[{inside}]` cannot stand here"));
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
        let d = Diagnostic::new("E113", "a component is taken with parentheses");
        let wanted = match inside.parse::<usize>() {
            Ok(k) if self.is_coordinate() => {
                let meant = ["x", "y", "z"].get(k).copied().unwrap_or("z");
                format!("the coordinates are `x`, `y`, `z`: x[{k}] is {meant}")
            }
            Ok(0) => "indices count from 1: the first component is u(1)".to_owned(),
            _ => format!("u({inside}): indices count from 1, A(1,2) is row 1, column 2"),
        };
        Some(self.mark(d, "[", "").help(wanted))
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
            let end = self.masked[self.at..].find(')').map_or(self.masked.len(), |n| self.at + n);
            let inside: String = self.masked[open + 1..end].split_whitespace().collect();
            if let Some((a, b)) = inside.split_once(',').filter(|_| inside.contains("Test_")) {
                let d = Diagnostic::new("E113", "the product of a form is no pair in parentheses");
                return Some(
                    self.mark(d, ",", "").help(format!("the scalar product is a.b, of matrices A:B: {a}.{b}")),
                );
            }
            let d = Diagnostic::new("E113", "a vector stands in square brackets");
            let short = if inside.len() <= 60 { format!("[{inside}]") } else { "[a, b]".to_owned() };
            return Some(self.mark(d, ",", "").help(short));
        }
        let (before, behind) = (self.before(), self.masked[self.at + 1..].trim_start_matches(' '));
        let left = &before[before.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| i + 1)..];
        let right = &behind[..behind.find(|c: char| !c.is_ascii_digit() && c != ',').unwrap_or(behind.len())];
        let right = right.trim_end_matches(',');
        if left.is_empty() || right.is_empty() || !self.expects(Rule::infix) {
            return None;
        }
        let d = Diagnostic::new("E120", format!("`{left},{right}` is not a number"));
        let start = before.len() - left.len();
        let d = d.at(super::span_at(self.id, self.base, start, self.masked.len() - behind.len() + right.len()), "");
        let groups: Vec<&str> = right.split(',').collect();
        let grouped = left != "0" && groups.iter().all(|g| g.len() == 3);
        let joined = format!("digits are not grouped: {left}{}", groups.concat());
        if groups.len() > 1 {
            return Some(d.help(if grouped { joined } else { format!("a list stands in brackets: [{left},{right}]") }));
        }
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

    /// `3 MPa`, `1 000`, `[0 1]`.
    fn unit_or_digits(&self, found: &str, behind_value: bool) -> Option<Diagnostic> {
        let before = self.before();
        if !behind_value || !before.ends_with(|c: char| c.is_ascii_digit() || c == '.') {
            return None;
        }
        let left =
            &before[before.rfind(|c: char| !c.is_ascii_alphanumeric() && c != '.' && c != '_').map_or(0, |i| i + 1)..];
        if !left.starts_with(|c: char| c.is_ascii_digit()) {
            return None;
        }
        if found.starts_with(|c: char| c.is_ascii_digit()) {
            let d = Diagnostic::new("E113", format!("`{left}` and `{found}` stand side by side"));
            let d = self.mark(d, found, "");
            let grouped = format!("digits are not grouped: {left}{found}");
            return Some(d.help(format!("entries of a list are separated by commas: [{left}, {found}]; {grouped}")));
        }
        if self.is("param") && is_unit(found) {
            let end = self.masked[self.at..]
                .find(|c: char| c.is_whitespace() || c == '"')
                .map_or(self.masked.len(), |n| self.at + n);
            let unit = &self.masked[self.at..end];
            let d = Diagnostic::new("E113", format!("a unit stands in brackets: [{unit}]"));
            return Some(self.mark(d, found, "").help(format!("{left} [{unit}]")));
        }
        None
    }
}
