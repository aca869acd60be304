//! What pest says about a failed parse, turned into a message: which slip it is, where, and what to type instead.

use super::{
    Rule,
    scan::{called, to_column_1},
    span_at,
};
use crate::{
    codes::Code,
    diag::{Diagnostic, nearest},
    foreign::{foreign, form},
    keywords::{STATEMENTS, is_keyword},
    source::{SourceId, Span},
};
use pest::error::{Error, ErrorVariant, InputLocation};

/// The diagnostic for a parse that failed on `masked`, which starts at byte `base` of the source.
/// `rule` is what was to be read: a statement, or a lone expression.
pub(super) fn explain(error: &Error<Rule>, masked: &str, base: usize, id: SourceId, rule: Rule) -> Diagnostic {
    let at = match error.location {
        InputLocation::Pos(p) | InputLocation::Span((p, _)) => p,
    };
    let ErrorVariant::ParsingError { positives, .. } = &error.variant else {
        let d = Diagnostic::new(Code::E119, "this statement is too complicated to be read");
        return d.at(span_at(id, base, 0, 1), "").help("give parts of it a name: def part = ...");
    };
    let at = at + masked[at..].len() - masked[at..].trim_start().len();
    Slip { masked, base, id, at, expected: positives, statement: rule == Rule::statement }.diagnostic()
}

/// The form of a choice between two values.
pub(super) const CHOICE: &str = "if condition then a else b";

pub(super) struct Slip<'s> {
    pub(super) masked: &'s str,
    pub(super) base: usize,
    pub(super) id: SourceId,
    /// Where the parse stopped: the first byte that did not fit.
    pub(super) at: usize,
    pub(super) expected: &'s [Rule],
    /// A whole statement was to be read, no lone expression.
    pub(super) statement: bool,
}

impl Slip<'_> {
    fn diagnostic(&self) -> Diagnostic {
        let found = token(&self.masked[self.at..]);
        if found.is_empty() {
            return self.with_form(self.too_short());
        }
        let d = self.habit(found).unwrap_or_else(|| self.by_grammar(found));
        self.with_form(d)
    }

    /// The form of the statement as help for a message that has none.
    fn with_form(&self, d: Diagnostic) -> Diagnostic {
        let offers = !d.fixes.is_empty();
        if d.helps.is_empty() && (self.expects(Rule::k_then) || self.expects(Rule::k_else)) {
            return d.help(CHOICE);
        }
        let word = token(self.masked.trim_start());
        let value = self.masked.split_once('=').map_or("", |(_, value)| value);
        if let Some(here) = foreign(called(value)).filter(|_| d.helps.is_empty() && !offers && word != "measure") {
            return d.help(here);
        }
        match form(word).filter(|_| self.statement && d.helps.is_empty() && !offers && d.code != Code::E207) {
            Some(form) => d.help(format!("the form is: {form}")),
            None => d,
        }
    }

    fn by_grammar(&self, found: &str) -> Diagnostic {
        if let Some(d) = self.equals(found) {
            return d;
        }
        let operand = self.expects(Rule::expr) || self.expects_operand();
        let starts = self.at == 0 && !self.statement;
        if is_keyword(found) && (operand || starts || self.expects(Rule::ident)) {
            return self.keyword(found);
        }
        if operand && found.starts_with(|c: char| c.is_ascii_digit() || c == '.') && found.len() > 2 {
            let d = Diagnostic::new(Code::E120, format!("`{found}` is not a number"));
            return self.mark(d, found, "");
        }
        if let Some(d) = self.two_operands(found) {
            return d;
        }
        if self.expects(Rule::EOI) {
            return self.after_the_end(found);
        }
        let d = Diagnostic::new(Code::E113, format!("expected {}, found `{found}`", self.list()));
        self.with_hints(self.mark(d, found, ""), found)
    }

    pub(super) fn expects(&self, rule: Rule) -> bool {
        self.expected.contains(&rule)
    }

    pub(super) fn expects_operand(&self) -> bool {
        [Rule::number, Rule::tensor, Rule::paren, Rule::sign, Rule::argument, Rule::row]
            .iter()
            .any(|r| self.expects(*r))
    }

    pub(super) fn mark(&self, d: Diagnostic, found: &str, text: impl Into<String>) -> Diagnostic {
        d.at(self.here(found.len()), text)
    }

    /// So many bytes from the slip on.
    pub(super) fn here(&self, length: usize) -> Span {
        self.span(self.at, self.at + length)
    }

    /// A range of the text.
    pub(super) fn span(&self, start: usize, end: usize) -> Span {
        span_at(self.id, self.base, start, end)
    }

    /// From the end of the text before the slip: blanks between are part of it, unless a line ends there.
    pub(super) fn with_blanks_before(&self, length: usize) -> Span {
        let before = self.before().len();
        let start = if self.masked[before..self.at].contains('\n') { self.at } else { before };
        self.span(start, self.at + length)
    }

    /// The text before the place of the slip, without trailing space.
    pub(super) fn before(&self) -> &str {
        self.masked[..self.at].trim_end()
    }

    fn too_short(&self) -> Diagnostic {
        let end = self.masked.trim_end().len();
        let last = self.masked[..end].char_indices().next_back().map_or(0, |(i, _)| i);
        Diagnostic::new(Code::E113, format!("the statement ends too early: expected {}", self.list()))
            .at(span_at(self.id, self.base, last, end), "the statement ends here")
    }

    /// `=` where a comparison stands, `==` where a value is given.
    fn equals(&self, found: &str) -> Option<Diagnostic> {
        if found == "=" && self.expects(Rule::infix) {
            let d = Diagnostic::new(Code::E116, "`=` gives a value, `==` compares");
            return Some(self.written(d, found, "=="));
        }
        if found == "==" && self.expects(Rule::t_eq) {
            let d = Diagnostic::new(Code::E116, "`==` compares, `=` gives a value");
            return Some(self.written(d, found, "="));
        }
        if found == ":=" && self.expects(Rule::t_eq) {
            let d = Diagnostic::new(Code::E116, "`:=` stands in `Def` inside a term and in `state`; here it is `=`");
            return Some(self.written(d, found, "="));
        }
        if found == "=" && self.expects(Rule::t_assign) {
            let d = Diagnostic::new(Code::E116, "`Def` inside a term and `state` are written with `:=`");
            return Some(self.written(d, found, ":="));
        }
        None
    }

    /// Another sign in place of the one at the slip.
    fn written(&self, d: Diagnostic, found: &str, sign: &str) -> Diagnostic {
        self.mark(d, found, "").help(format!("write `{sign}`")).replace(self.here(found.len()), sign)
    }

    /// A keyword where an expression or a name has to stand.
    fn keyword(&self, found: &str) -> Diagnostic {
        if self.starts_line() && STATEMENTS.contains(&found) {
            return self.indented_statement(found);
        }
        if found == "if" {
            let d = Diagnostic::new(Code::E113, "`if` inside a larger expression needs parentheses");
            return self.mark(d, found, "").help("(if condition then a else b)");
        }
        let next = self.masked[self.at + found.len()..].trim_start();
        let used_as_name = next.is_empty() || next.starts_with(|c: char| "+-*/.)],;^='".contains(c));
        if used_as_name && !self.before().ends_with("=") || next.starts_with('=') {
            return keyword_as_name(found).at(self.here(found.len()), "");
        }
        let d = Diagnostic::new(Code::E113, format!("expected {}, found the word `{found}`", self.list()));
        self.mark(d, found, format!("something is missing before `{found}`"))
    }

    /// `2x`, `a b`, `1.2.3`: two values without an operator.
    fn two_operands(&self, found: &str) -> Option<Diagnostic> {
        let before = self.before();
        if !self.expects(Rule::infix) || before.len() != self.at && self.starts_line() {
            return None;
        }
        let starts_operand = found.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '_' || c == '(' || c == '.')
            && !is_keyword(found)
            && found != "..";
        let start = before.rfind(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != '.').map_or(0, |i| i + 1);
        let value = &before[start..];
        if !starts_operand {
            return None;
        }
        let words: Vec<&str> = self.expected.iter().flat_map(|r| contextual(*r)).copied().collect();
        if found.starts_with(|c: char| c.is_ascii_alphabetic())
            && let Some(w) = nearest(found, words.iter().copied())
        {
            let d = Diagnostic::new(Code::E113, format!("expected {}, found `{found}`", self.list()));
            return Some(d.did_you_mean(self.here(found.len()), Some(w)));
        }
        let left = if value.is_empty() { &before[before.len().saturating_sub(1)..] } else { value };
        if left.is_empty() || !left.is_ascii() {
            return None;
        }
        let d = Diagnostic::new(Code::E113, format!("an operator is missing between `{left}` and `{found}`"));
        let [a, b] =
            [(left, ")", "(...)"), (found, "(", "(...)")].map(|(t, bracket, all)| if t == bracket { all } else { t });
        let product = format!("{a}*{b}");
        let d = self.mark(d, found, "");
        let d = d.help(format!("a product is written with `*`: {product}"));
        // a word behind a bracket is rather a unit, or a word of the statement
        let is_factor = before.ends_with(|c: char| c.is_ascii_alphanumeric() || c == '_' || c == ')');
        Some(if is_factor { d.replace(self.with_blanks_before(0), "*") } else { d })
    }

    fn after_the_end(&self, found: &str) -> Diagnostic {
        if self.starts_line() && STATEMENTS.contains(&found) {
            return self.indented_statement(found);
        }
        let d = Diagnostic::new(Code::E117, format!("`{found}` stands after the end of the statement"));
        let list = self.list();
        let d = if list == "the end of the statement" { d } else { d.note(format!("here may follow {list}")) };
        self.with_hints(self.mark(d, found, ""), found)
    }

    fn indented_statement(&self, found: &str) -> Diagnostic {
        let d = Diagnostic::new(Code::E117, format!("`{found}` starts a new statement inside another one"));
        self.mark(d, found, "this line is indented, so it continues the statement above")
            .help("a statement starts in column 1")
            .fix(to_column_1(self.span(self.masked[..self.at].rfind('\n').map_or(0, |k| k + 1), self.at)))
    }

    /// True if only space stands before the slip on its line.
    fn starts_line(&self) -> bool {
        let line = self.masked[..self.at].rsplit('\n').next().unwrap_or("");
        self.at > line.len() && line.trim().is_empty()
    }

    fn with_hints(&self, d: Diagnostic, found: &str) -> Diagnostic {
        let words: Vec<&str> = self.expected.iter().flat_map(|r| contextual(*r)).copied().collect();
        let offered = nearest(found, words.iter().copied());
        let mut d = d;
        if let (Some(w), Some(label)) = (offered, d.labels.first_mut()) {
            label.text = format!("did you mean `{w}`?");
            d = d.replace(self.here(found.len()), w);
        } else if found == "," && self.before().ends_with(',') || found == ";" && self.before().ends_with(';') {
            d = d.help("tensors of higher order are nested: [[[1,2],[3,4]],[[5,6],[7,8]]]");
        }
        d
    }

    /// `a, b or c`: what could have stood at the slip.
    pub(super) fn list(&self) -> String {
        let mut words: Vec<String> = Vec::new();
        for text in self.expected.iter().flat_map(|r| describe(*r)) {
            if !words.contains(&text) {
                words.push(text);
            }
        }
        // Rules that are always possible behind an expression say the least, so they come last.
        words.sort_by_key(|w| (w == "the end of the statement", w == "an operator"));
        let last = words.pop().unwrap_or_else(|| "something else".to_owned());
        if words.is_empty() { last } else { format!("{} or {last}", words.join(", ")) }
    }
}

/// E207 for a keyword that is used as a name.
pub(super) fn keyword_as_name(word: &str) -> Diagnostic {
    Diagnostic::new(Code::E207, format!("`{word}` is a word of the language and cannot be a name"))
        .help(format!("choose another name, such as `{word}_`"))
}

/// The first word, number or sign of a text.
fn token(text: &str) -> &str {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let Some(first) = text.chars().next() else {
        return "";
    };
    let n = if word(first) || first == '.' && text[1..].starts_with(|c: char| c.is_ascii_digit()) {
        text[1..].find(|c: char| !word(c) && (c != '.' || !first.is_ascii_digit())).map_or(text.len(), |i| i + 1)
    } else if first == '"' {
        text[1..].find('"').map_or(text.len(), |i| i + 2)
    } else {
        let two = [":=", "==", "<=", ">=", "!=", "..", ".*", "./"].iter().any(|t| text.starts_with(t));
        if two { 2 } else { first.len_utf8() }
    };
    &text[..n]
}

/// Words a rule stands for, to be offered for a misspelt one.
fn contextual(rule: Rule) -> &'static [&'static str] {
    match rule {
        Rule::shape => &["hex", "tet", "quad", "tri", "segment"],
        Rule::rank => &["scalar", "vector", "matrix"],
        Rule::reduction => &["mean", "max", "min", "integral", "value", "reaction"],
        Rule::entity => &["cells", "faces", "nodes"],
        Rule::picked => &["cells", "faces", "nodes"],
        Rule::region_expr => &["cells", "faces", "nodes", "interface"],
        Rule::interface | Rule::k_iface => &["interface"],
        Rule::map_kind | Rule::map_search => &["project", "raytrace"],
        Rule::k_point | Rule::map_point => &["point"],
        Rule::k_box | Rule::mesh_box => &["box"],
        Rule::k_file | Rule::mesh_file => &["file"],
        Rule::k_cells | Rule::mesh_cells => &["cells"],
        Rule::k_size | Rule::mesh_size => &["size"],
        Rule::k_map | Rule::mesh_map => &["map"],
        Rule::k_moved | Rule::moved => &["moved"],
        Rule::k_turned | Rule::turned => &["turned"],
        Rule::k_scaled | Rule::scaled => &["scaled"],
        Rule::k_about | Rule::turn_about => &["about"],
        Rule::k_global | Rule::place => &["global", "on"],
        Rule::k_on => &["on"],
        Rule::k_in => &["in"],
        Rule::k_from | Rule::start_file => &["from"],
        Rule::k_to => &["to"],
        Rule::k_by => &["by"],
        Rule::k_onto => &["onto"],
        Rule::k_of | Rule::pick_of => &["of"],
        Rule::k_where | Rule::pick_where => &["where"],
        Rule::k_with | Rule::options => &["with"],
        Rule::k_as => &["as"],
        Rule::k_along | Rule::along | Rule::surface | Rule::refine_along => &["along"],
        Rule::k_towards => &["towards"],
        Rule::k_moving | Rule::map_moving => &["moving"],
        Rule::k_times | Rule::refine_times => &["times"],
        Rule::k_every | Rule::every => &["every"],
        Rule::k_when | Rule::when => &["when"],
        Rule::k_within => &["within"],
        Rule::k_at | Rule::at | Rule::measure_at => &["at"],
        Rule::k_nodes | Rule::at_nodes => &["nodes"],
        Rule::k_degree | Rule::quad_degree => &["degree"],
        Rule::k_segments | Rule::quad_segments => &["segments"],
        Rule::k_vertex => &["vertex"],
        Rule::k_across => &["across"],
        Rule::k_then => &["then"],
        Rule::k_else => &["else"],
        Rule::k_Normal | Rule::normal => &["Normal"],
        _ => &[],
    }
}

/// How a rule is named in "expected ...".
fn describe(rule: Rule) -> Vec<String> {
    let words = contextual(rule);
    if !words.is_empty() {
        return words.iter().map(|w| format!("`{w}`")).collect();
    }
    let text = match rule {
        Rule::expr
        | Rule::number
        | Rule::tensor
        | Rule::paren
        | Rule::sign
        | Rule::prefix_word
        | Rule::k_not
        | Rule::choice
        | Rule::k_if
        | Rule::argument
        | Rule::row
        | Rule::range
        | Rule::outitem
        | Rule::count
        | Rule::direction
        | Rule::slice => "an expression",
        Rule::infix | Rule::call | Rule::transpose => "an operator",
        Rule::ident
        | Rule::name
        | Rule::formals
        | Rule::word
        | Rule::places
        | Rule::target
        | Rule::keyword
        | Rule::start_field
        | Rule::option => "a name",
        Rule::string => "a text in quotes",
        Rule::unit => "a unit in brackets",
        Rule::unit_term | Rule::unit_name | Rule::unit_one => "a unit",
        Rule::unit_power => "a whole number",
        Rule::unit_op => "`*`, `/`",
        Rule::set => "`{`",
        Rule::domain => "a range a..b or a set {a, b}",
        Rule::rank_sizes | Rule::t_open | Rule::component => "`(`",
        Rule::space => "scalar, vector or matrix",
        Rule::element => "an element such as P2",
        Rule::region_op => "`+`, `-`, `&`",
        Rule::t_eq => "`=`",
        Rule::t_assign => "`:=`",
        Rule::t_colon => "`:`",
        Rule::t_comma => "`,`",
        Rule::t_semi => "`;`",
        Rule::t_close => "`)`",
        Rule::t_row_end => "`]`",
        Rule::t_set_end => "`}`",
        Rule::t_range => "`..`",
        Rule::t_dot => "`.`",
        Rule::EOI => "the end of the statement",
        _ => return Vec::new(),
    };
    vec![text.to_owned()]
}
