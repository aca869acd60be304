//! The canonical text of a scene (`wfl fmt`): one space where a space belongs, statements in column 1, their further
//! lines indented, comments kept. Formatting twice changes nothing, and never the syntax tree.
//!
//! Works on the words and signs of a text that parses, so numbers, parentheses and line breaks stay as the author
//! wrote them. What an author aligns stays aligned: where a space belongs, outside brackets and before a comment, more
//! of them are kept. Inside a pair of brackets the first comma and the first sum decide for the others whether spaces
//! stand there: `[0,0,1]` and `(1+nu)` are as good as `[x, y + 1]`. Does not align columns of its own and does not join
//! or break lines.

use crate::{
    diag::Checked,
    keywords::is_keyword,
    parse::parse,
    source::{SourceId, SourceMap},
};

/// The indentation of continuation lines.
const INDENT: &str = "    ";

/// The canonical text of a file; a file that does not parse gives its errors and no text.
#[must_use]
pub fn format(sources: &SourceMap, id: SourceId) -> Checked<String> {
    let parsed = parse(sources, id);
    if parsed.has_errors() {
        return Checked { value: None, diagnostics: parsed.diagnostics };
    }
    let text = sources.get(id).text.trim_start_matches('\u{feff}');
    let lines: Vec<Line<'_>> = text.lines().map(Line::new).collect();
    let versioned = lines.iter().any(|l| l.starts_statement && l.tokens.first().is_some_and(|t| t.text == "wfl"));
    let mut printer = Printer { out: String::with_capacity(text.len()), state: State::default(), blank: false };
    if !versioned && lines.iter().any(|l| l.starts_statement) {
        printer.out.push_str("wfl 1\n");
    }
    for (i, line) in lines.iter().enumerate() {
        let next = lines[i + 1..].iter().find(|l| !l.tokens.is_empty());
        let inside = i > 0 && next.is_some_and(|n| !n.starts_statement) && printer.state.open;
        printer.line(line, if inside { Place::InStatement } else { Place::BetweenStatements });
    }
    Checked { value: Some(printer.out), diagnostics: parsed.diagnostics }
}

/// A word or sign with the number of blanks before it; none at the start of a line.
#[derive(Clone, Copy)]
struct Token<'t> {
    text: &'t str,
    gap: Option<usize>,
}

/// One line of the source.
struct Line<'t> {
    tokens: Vec<Token<'t>>,
    comment: Option<Token<'t>>,
    starts_statement: bool,
}

impl<'t> Line<'t> {
    fn new(text: &'t str) -> Self {
        let mut rest = text.trim_end();
        let starts = rest.starts_with(|c: char| !c.is_ascii_whitespace() && !"#)]}".contains(c));
        let mut line = Line { tokens: Vec::new(), comment: None, starts_statement: starts };
        loop {
            let before = rest.len();
            rest = rest.trim_start();
            let gap = (!line.tokens.is_empty()).then_some(before - rest.len());
            if rest.is_empty() {
                return line;
            }
            if rest.starts_with('#') {
                line.comment = Some(Token { text: rest, gap });
                return line;
            }
            let n = token_length(rest, line.tokens.last().is_some_and(|t| ends_value(t.text)));
            line.tokens.push(Token { text: &rest[..n], gap });
            rest = &rest[n..];
        }
    }
}

/// True if a `.` behind this token is an operator even in front of a digit.
fn ends_value(token: &str) -> bool {
    let introduces = is_keyword(token) || ["wfl", "box", "file", "size", "map", "point", "times"].contains(&token);
    let last = token.as_bytes().last().copied().unwrap_or(b' ');
    !introduces && (last.is_ascii_alphanumeric() || matches!(last, b'_' | b')' | b']' | b'\''))
}

/// Bytes of the first word, number, text or sign; `operator` if a point is no part of a number here.
fn token_length(text: &str, operator: bool) -> usize {
    let bytes = text.as_bytes();
    let digit = |i: usize| bytes.get(i).is_some_and(u8::is_ascii_digit);
    let run = |from: usize, ok: fn(&u8) -> bool| from + bytes[from..].iter().take_while(|b| ok(b)).count();
    match bytes[0] {
        b'"' => text[1..].find('"').map_or(text.len(), |i| i + 2),
        b'a'..=b'z' | b'A'..=b'Z' | b'_' => run(0, |b| b.is_ascii_alphanumeric() || *b == b'_'),
        b'0'..=b'9' | b'.' if bytes[0] != b'.' || digit(1) && !operator => {
            let mut n = run(0, u8::is_ascii_digit);
            if bytes.get(n) == Some(&b'.') && bytes.get(n + 1) != Some(&b'.') {
                n = run(n + 1, u8::is_ascii_digit);
            }
            let signed = usize::from(matches!(bytes.get(n + 1), Some(b'+' | b'-')));
            if matches!(bytes.get(n), Some(b'e' | b'E')) && digit(n + 1 + signed) {
                n = run(n + 1 + signed, u8::is_ascii_digit);
            }
            n
        }
        _ => {
            let two = [":=", "==", "<=", ">=", "!=", "..", ".*", "./"];
            if two.iter().any(|t| text.starts_with(t)) { 2 } else { text.chars().next().map_or(1, char::len_utf8) }
        }
    }
}

/// What the first comma and the first sum inside a pair of brackets decided: true with spaces.
#[derive(Clone, Copy, Default)]
struct Bracket {
    comma: Option<bool>,
    sum: Option<bool>,
}

/// Where in a statement the printer is.
#[derive(Default)]
struct State {
    /// A statement was begun.
    open: bool,
    /// It is one whose first `:` separates what it declares from the rest.
    colon_separates: bool,
    is_mesh: bool,
    is_output: bool,
    /// Open brackets, outermost first.
    brackets: Vec<Bracket>,
    in_options: bool,
    /// The last token was a sign of one operand: nothing stands between both.
    unary: bool,
    /// The last token was a sign of two operands.
    sum: bool,
    /// The last token was a `:` that separates.
    separator: bool,
    /// The last token was set off by a space.
    set_off: bool,
    previous: String,
}

struct Printer {
    out: String,
    state: State,
    blank: bool,
}

/// Where a line without words stands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    InStatement,
    BetweenStatements,
}

/// What a sign does that has several uses.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    /// Ends what a statement declares.
    Separator,
    /// Adds or subtracts.
    Sum,
    /// Belongs to the value behind it.
    Sign,
    Other,
}

impl Printer {
    fn line(&mut self, line: &Line<'_>, place: Place) {
        if line.tokens.is_empty() && line.comment.is_none() {
            self.blank = place == Place::BetweenStatements;
            return;
        }
        if self.blank && !self.out.is_empty() {
            self.out.push('\n');
        }
        self.blank = false;
        if line.tokens.is_empty() {
            self.out.push_str(if place == Place::InStatement { INDENT } else { "" });
        } else if line.starts_statement {
            let word = line.tokens[0].text;
            let separates = ["term", "energy", "unknown", "multiplier", "data", "state", "output"].contains(&word);
            let (is_mesh, is_output, in_options) = (word == "mesh", word == "output", word == "scheme");
            self.state =
                State { open: true, colon_separates: separates, is_mesh, is_output, in_options, ..State::default() };
        } else {
            self.out.push_str(INDENT);
        }
        for (i, token) in line.tokens.iter().enumerate() {
            self.token(*token, line.tokens.get(i + 1).copied());
        }
        if let Some(comment) = line.comment {
            let spaces = comment.gap.map_or(0, |g| g.max(2));
            self.out.extend(std::iter::repeat_n(' ', spaces));
            self.out.push_str(comment.text);
        }
        self.out.push('\n');
    }

    fn token(&mut self, Token { text: token, gap }: Token<'_>, next: Option<Token<'_>>) {
        let after = next.map_or("", |n| n.text);
        let s = &mut self.state;
        let role = match token {
            ":" if s.brackets.is_empty() && s.colon_separates => Role::Separator,
            "-" | "+" if s.ends_operand() => Role::Sum,
            "-" | "+" => Role::Sign,
            _ => Role::Other,
        };
        if let Some(inside) = s.brackets.last_mut() {
            // a break of the line is a space
            let spaced = |gap: Option<usize>| gap.is_none_or(|g| g > 0);
            if s.previous == "," || s.previous == ";" {
                inside.comma.get_or_insert(spaced(gap));
            } else if role == Role::Sum {
                inside.sum.get_or_insert(spaced(gap) && spaced(next.and_then(|n| n.gap)));
            }
        }
        let set_off = gap.is_some() && s.space_before(token, role, after);
        if set_off {
            let aligned = if s.brackets.is_empty() { gap.unwrap_or(1).max(1) } else { 1 };
            self.out.extend(std::iter::repeat_n(' ', aligned));
        }
        self.out.push_str(token);
        match token {
            "(" | "[" | "{" => s.brackets.push(Bracket::default()),
            ")" | "]" | "}" => {
                s.brackets.pop();
            }
            "with" if s.brackets.is_empty() => s.in_options = true,
            _ => {}
        }
        s.sum = role == Role::Sum;
        s.colon_separates &= role != Role::Separator;
        s.separator = role == Role::Separator;
        s.unary = role == Role::Sign;
        s.set_off = set_off;
        s.previous.clear();
        s.previous.push_str(token);
    }
}

impl State {
    /// True if the last token ends a value, so that a sign behind it has two operands.
    fn ends_operand(&self) -> bool {
        let p = self.previous.as_str();
        let word = p.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        if word {
            return !self.introduces(p);
        }
        p.starts_with(|c: char| c.is_ascii_digit() || c == '"')
            || matches!(p, ")" | "]" | "}" | "'")
            || p.len() > 1 && p.starts_with('.') && p.as_bytes()[1].is_ascii_digit()
    }

    /// True for words that are followed by a value of its own and are no function.
    fn introduces(&self, word: &str) -> bool {
        is_keyword(word)
            || self.is_mesh && ["box", "file", "size", "map", "about"].contains(&word)
            || self.is_output && ["every", "at"].contains(&word)
            || word == "point"
    }

    fn space_before(&self, token: &str, role: Role, after: &str) -> bool {
        let p = self.previous.as_str();
        if matches!(p, "(" | "[" | "{") || matches!(token, ")" | "]" | "}" | "," | ";" | "'") || self.unary {
            return false;
        }
        let inside = self.brackets.last().copied().unwrap_or_default();
        if matches!(p, "," | ";") {
            return inside.comma.unwrap_or(true);
        }
        if self.sum || role == Role::Sum {
            return inside.sum.unwrap_or(true);
        }
        if role == Role::Separator || self.separator {
            return true;
        }
        let in_option = |sign: &str| sign == "=" && self.in_options && self.brackets.is_empty();
        if in_option(token) || in_option(p) {
            return false;
        }
        if token == "(" && self.ends_operand() {
            return false;
        }
        let tight = |sign: &str| matches!(sign, "*" | "/" | "." | ":" | ".*" | "./" | "@" | "^");
        if token == ".." {
            return p.ends_with('.') || after.starts_with('.');
        }
        if p == ".." {
            return self.set_off;
        }
        if tight(token) {
            // `2 .* p` is not `2.*p`, and `p . .5` is not `p..5`.
            return token.starts_with('.') && (self.ends_number() || starts_number(after));
        }
        if tight(p) {
            return p.starts_with('.') && (self.set_off || starts_number(token));
        }
        true
    }

    fn ends_number(&self) -> bool {
        starts_number(&self.previous)
    }
}

fn starts_number(token: &str) -> bool {
    token.starts_with(|c: char| c.is_ascii_digit() || c == '.')
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, SCENES};

    fn formatted(text: &str) -> Option<String> {
        let mut sources = SourceMap::new();
        let id = sources.add("scene.wfl", text);
        format(&sources, id).value
    }

    /// The tree without its places and without the version that is added.
    fn shape(text: &str) -> String {
        let mut sources = SourceMap::new();
        let id = sources.add("scene.wfl", text);
        let items = parse(&sources, id).value.map(|s| s.items).unwrap_or_default();
        let debug: Vec<String> =
            items.iter().map(|i| format!("{:?}", i.kind)).filter(|k| !k.starts_with("Version")).collect();
        let mut out = String::new();
        for (i, part) in debug.concat().split("Span {").enumerate() {
            out.push_str(if i == 0 { part } else { part.split_once('}').map_or("", |p| p.1) });
        }
        out
    }

    fn check(text: &str) -> String {
        let once = formatted(text).expect("it parses");
        assert_eq!(shape(&once), shape(text), "{text:?} became {once:?}");
        assert_eq!(formatted(&once).as_deref(), Some(once.as_str()), "{text:?}");
        once
    }

    #[test]
    fn spaces_stand_where_they_belong() {
        for (text, expected) in [
            ("param a=-1 [MPa/mm^2] in 0 .. 1.5 \"x\"#c", "param a = -1 [MPa/mm^2] in 0..1.5 \"x\"  #c"),
            ("param a  =-1   in 0..1   # c", "param a  = -1   in 0..1   # c"),
            ("def a=f( 1+nu,  2 )*(1 - 2*nu)-b", "def a = f(1+nu, 2)*(1 - 2*nu) - b"),
            ("def a=[0,0, 1]+[x, y,z]+(a- b + -c)", "def a = [0,0,1] + [x, y, z] + (a-b+-c)"),
            ("def a = b.1. + (c).5", "def a = b . 1. + (c) . 5"),
            ("param a=1 in 1. .. .5", "param a = 1 in 1. .. .5"),
            ("param a=1 in { -1,0 , 1 }", "param a = 1 in {-1,0,1}"),
            ("term t on a,b:Grad_u : Grad_Test_u-f*Test_u", "term t on a, b : Grad_u:Grad_Test_u - f*Test_u"),
            ("term on a : Def f( a ):=a^-2 ;f (b) '", "term on a : Def f(a) := a^-2; f(b)'"),
            ("def a = 2 .* p + 2.*p - q . .5 + 3 . p", "def a = 2 .* p + 2.*p - q . .5 + 3 . p"),
            ("def a = p .* q ./ 2 + r . 5 + - - b", "def a = p.*q ./ 2 + r . 5 + --b"),
            ("def a=if x<1 and not(y>=2)then -1 else (2)", "def a = if x < 1 and not (y >= 2) then -1 else (2)"),
            ("solver newton with tol = 1e-8 , search=auto", "solver newton with tol=1e-8, search=auto"),
            ("mesh box(a)to(b) size h hex map [ x , 2*y]", "mesh box (a) to (b) size h hex map [x, 2*y]"),
            ("unknown u:vector (3)P2 on a,b [mm]", "unknown u : vector(3) P2 on a, b [mm]"),
            ("state s:scalar:=s+1", "state s : scalar := s + 1"),
            ("region r=a+b-(c&d)", "region r = a + b - (c & d)"),
            (
                "region r=interface along s towards [ 0,1 ]-(c&d)",
                "region r = interface along s towards [0,1] - (c & d)",
            ),
            ("refine on a,b where x<.1 times 2 along x ,y", "refine on a, b where x < .1 times 2 along x, y"),
            ("fix u(1),v . Normal=0 on a", "fix u(1), v.Normal = 0 on a"),
            ("def s = Sym Grad_u (1 , :)", "def s = Sym Grad_u(1, :)"),
            ("mapping m = point(x)", "mapping m = point (x)"),
            ("output vtk \"a\"  every(n):u,v", "output vtk \"a\"  every (n) : u, v"),
        ] {
            assert_eq!(check(text), format!("wfl 1\n{expected}\n"), "{text}");
        }
    }

    #[test]
    fn comments_blank_lines_and_line_breaks_are_kept() {
        let text = "\u{feff}# head  \r\n\r\n\r\nwfl 1\r\n\tparam\r\n"
            .replace("\tparam\r\n", "param a = (1 +\r\n# inside\r\n\r\n\t2\r\n) # end\r\n  # after\r\n\r\n\r\n#last");
        let expected = "# head\n\nwfl 1\nparam a = (1 +\n    # inside\n    2\n    )  # end\n# after\n\n#last\n";
        assert_eq!(check(&text), expected);
        assert_eq!(formatted("# only a comment\n").as_deref(), Some("# only a comment\n"));
        assert_eq!(formatted("param a = "), None);
    }

    #[test]
    fn scenes_keep_their_trees() {
        for (_, text) in SCENES {
            check(text);
        }
    }

    /// Lines of the scenes with bytes changed: whatever still parses keeps its tree.
    #[test]
    fn anything_that_parses_keeps_its_tree() {
        let lines: Vec<&str> = SCENES.iter().flat_map(|(_, t)| t.lines()).collect();
        let mut random = Random(11);
        let mut parsed = 0;
        for _ in 0..40_000 {
            let mut bytes = lines[random.below(lines.len())].as_bytes().to_vec();
            for _ in 0..1 + random.below(3) {
                let at = random.below(bytes.len() + 1);
                bytes.insert(at, b" .*/-+()[]:,;^'#\n2e5_a@=&"[random.below(25)]);
            }
            let text = String::from_utf8_lossy(&bytes).into_owned();
            if formatted(&text).is_some() {
                check(&text);
                parsed += 1;
            }
        }
        assert!(parsed > 5000, "{parsed}");
    }
}
