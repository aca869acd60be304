//! Cuts a text into statements and checks what needs no grammar: characters, strings, brackets, nesting, foreign
//! operators. Gives the text of a statement with comments blanked out, byte for byte in place.

use super::{
    NESTING_LIMIT, Parsed, TEXT_LIMIT,
    characters::{ascii_for, character_name},
    span_at,
};
use crate::{
    diag::{Diagnostic, nearest},
    foreign::{foreign, foreign_statement},
    keywords::{KEYWORDS, STATEMENTS},
    source::{SourceId, Span},
};

/// The bytes of one statement, from its first character in column 1 to the next statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    /// First byte.
    pub(crate) start: usize,
    /// One past the last byte; comments and blank lines that follow are inside.
    pub(crate) end: usize,
}

/// Where the text starts behind a byte order mark.
pub(super) fn text_start(text: &str) -> usize {
    if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 }
}

/// Refuses texts longer than [`TEXT_LIMIT`].
pub(super) fn check_length(text: &str, id: SourceId) -> Parsed<()> {
    if text.len() <= TEXT_LIMIT {
        return Ok(());
    }
    let d = Diagnostic::new("E125", format!("this text has {} bytes, {TEXT_LIMIT} are allowed", text.len()));
    Err(Box::new(d.at(span_at(id, 0, 0, 0), "").help("tables of numbers belong into a file: data k : ... = \"file\"")))
}

/// Cuts a text at the lines that start in column 1. Comment lines and lines that open with a closing bracket do not
/// start a statement. Text before the first statement is reported beside the pieces.
pub(crate) fn cut(text: &str, id: SourceId) -> Parsed<(Vec<Piece>, Vec<Diagnostic>)> {
    check_length(text, id)?;
    let mut pieces: Vec<Piece> = Vec::new();
    let mut strays = Vec::new();
    let mut at = text_start(text);
    for line in text[at..].split_inclusive('\n') {
        let starts = line.starts_with(|c: char| !c.is_ascii_whitespace() && !"#)]}".contains(c));
        if starts {
            if let Some(last) = pieces.last_mut() {
                last.end = at;
            }
            pieces.push(Piece { start: at, end: text.len() });
        } else if pieces.is_empty() && strays.is_empty() {
            let content = line.trim_start();
            if !content.is_empty() && !content.starts_with('#') {
                let from = at + line.len() - content.len();
                let to = at + line.trim_end().len();
                let d = Diagnostic::new("E115", "a statement starts in column 1")
                    .at(span_at(id, 0, from, to), "this line is indented, but there is no statement to continue");
                strays.push(d);
            }
        }
        at += line.len();
    }
    Ok((pieces, strays))
}

/// Refuses a piece whose first word is no statement.
pub(super) fn known_statement(masked: &str, piece: &Piece, id: SourceId) -> Parsed<()> {
    let word = masked.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').next().unwrap_or("");
    if STATEMENTS.contains(&word) || word == "wfl" {
        return Ok(());
    }
    let line = masked.lines().next().unwrap_or("").trim_end();
    let shown = if word.is_empty() { line } else { word };
    let shown_short: String = shown.chars().take(30).collect();
    let mark = span_at(id, piece.start, 0, shown.len());
    let continued = "a continuation line is indented: put a space before it";
    let is_import = word != "from" || line.contains(" import");
    if let Some(here) = foreign_statement(word).filter(|_| is_import) {
        let d = Diagnostic::new("E115", format!("`{shown_short}` is not a statement"));
        return Err(Box::new(d.at(mark, "").help(here)));
    }
    if KEYWORDS.contains(&word) {
        let d = Diagnostic::new("E115", format!("`{word}` does not start a statement"));
        return Err(Box::new(d.at(mark, "").help(continued)));
    }
    if word.is_empty() {
        let d = Diagnostic::new("E115", "a statement starts with a word");
        return Err(Box::new(d.at(mark, "").help(continued)));
    }
    let d = Diagnostic::new("E115", format!("`{shown_short}` is not a statement"));
    let rest = masked[word.len()..].trim_start();
    let d = match nearest(word, STATEMENTS.iter().copied()) {
        None if rest.starts_with('(') && rest.contains('=') => {
            let fix = format!("a prescribed value: fix {shown_short}(1) = ... on REGION");
            d.at(mark, "").help(format!("{fix}; an expression: def {shown_short}(a) = ..."))
        }
        Some(s) => d.at(mark, format!("did you mean `{s}`?")),
        None if rest.starts_with('=') && foreign(called(rest)).is_some() => {
            d.at(mark, "").help(foreign(called(rest)).unwrap_or_default())
        }
        None if rest.starts_with('=') && !rest.starts_with("==") => {
            d.at(mark, "").help(format!("a number: param {shown_short} = ...; an expression: def {shown_short} = ..."))
        }
        None => d.at(mark, "").help(continued),
    };
    Err(Box::new(d.note(format!("statements are {}", STATEMENTS.join(", ")))))
}

/// The word behind `=`: `TestFunction` of `= ufl.TestFunction(V)`.
pub(super) fn called(rest: &str) -> &str {
    let value = rest.trim_start_matches('=').trim_start();
    let path = value.split(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != '.').next().unwrap_or("");
    path.rsplit('.').next().unwrap_or(path)
}

/// Checks characters, strings, brackets, nesting and foreign operators of a piece and blanks out its comments.
pub(super) fn scan(text: &str, piece: &Piece, id: SourceId) -> Parsed<String> {
    let mut scanner = Scanner {
        text: &text[piece.start..piece.end],
        at: 0,
        base: piece.start,
        id,
        masked: String::with_capacity(piece.end - piece.start),
        open: Vec::new(),
        ifs: vec![0],
    };
    while let Some(c) = scanner.peek() {
        scanner.step(c)?;
    }
    scanner.finish()
}

struct Scanner<'t> {
    text: &'t str,
    at: usize,
    base: usize,
    id: SourceId,
    masked: String,
    /// Open brackets with their places.
    open: Vec<(char, usize)>,
    /// `if`s seen since the last comma, by bracket level; their `else` parts nest.
    ifs: Vec<usize>,
}

impl Scanner<'_> {
    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    fn span(&self, start: usize, end: usize) -> Span {
        span_at(self.id, self.base, start, end)
    }

    fn keep(&mut self, bytes: usize) {
        self.masked.push_str(&self.text[self.at..self.at + bytes]);
        self.at += bytes;
    }

    fn step(&mut self, c: char) -> Parsed<()> {
        match c {
            '#' => return self.comment(),
            '"' => return self.string(),
            '0'..='9' => return self.number(),
            'a'..='z' | 'A'..='Z' | '_' => {
                let start = self.at;
                return if self.word() == "if" { self.open_if(start) } else { Ok(()) };
            }
            '(' | '[' | '{' => {
                self.open.push((c, self.at));
                self.ifs.push(0);
                self.check_depth(self.at)?;
            }
            ')' | ']' | '}' => self.close(c)?,
            '\'' => self.apostrophe()?,
            ',' | ';' => *self.ifs.last_mut().expect("one level is always there") = 0,
            _ => self.sign(c)?,
        }
        self.keep(c.len_utf8());
        Ok(())
    }

    fn comment(&mut self) -> Parsed<()> {
        while let Some(c) = self.peek().filter(|c| *c != '\n') {
            self.allowed_anywhere(c)?;
            if c == '\r' {
                self.keep(1);
                continue;
            }
            self.masked.extend(std::iter::repeat_n(' ', c.len_utf8()));
            self.at += c.len_utf8();
        }
        Ok(())
    }

    fn string(&mut self) -> Parsed<()> {
        let start = self.at;
        self.keep(1);
        while let Some(c) = self.peek() {
            if c == '\n' {
                break;
            }
            self.allowed_anywhere(c)?;
            self.keep(c.len_utf8());
            if c == '"' {
                return Ok(());
            }
        }
        let end = self.masked.trim_end().len();
        let d = Diagnostic::new("E121", "this text has no closing quote");
        Err(Box::new(d.at(self.span(start, end.max(start + 1)), "a text ends on the line it starts on")))
    }

    fn word(&mut self) -> &str {
        let start = self.at;
        let rest = &self.text[start..];
        let n = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
        self.keep(n);
        &self.text[start..start + n]
    }

    /// A number with what follows it without a space.
    fn number(&mut self) -> Parsed<()> {
        let rest = &self.text[self.at..];
        let read = number_length(rest);
        let (number, behind) = rest.split_at(read);
        let word = behind.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(behind.len());
        if let Some(slip) = number_slip(number, behind) {
            let sign =
                usize::from(behind[word..].starts_with(['+', '-']) && ["e", "E", "d", "D"].contains(&&behind[..word]));
            let digits = behind[word + sign..].find(|c: char| !c.is_ascii_alphanumeric() && c != '.' && c != '_');
            let mut end = read + word + sign + digits.unwrap_or(behind.len() - word - sign);
            end = rest[..end].trim_end_matches('.').len().max(read);
            if slip.quoted {
                end = read + 1 + behind[1..].find(|c: char| !c.is_ascii_digit()).unwrap_or(behind.len() - 1);
            }
            let text: String = rest[..end].chars().take(40).collect();
            let d = Diagnostic::new("E120", format!("`{text}` is not a number"));
            return Err(Box::new(d.at(self.span(self.at, self.at + end), "").help(slip.help)));
        }
        self.keep(read + word);
        Ok(())
    }

    /// `'` behind a value transposes it; elsewhere it is a quote of another language.
    fn apostrophe(&self) -> Parsed<()> {
        let line = self.text[self.at + 1..].lines().next().unwrap_or("");
        let before = self.masked.trim_end();
        let apart =
            before.len() < self.masked.len() && line.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '_');
        if before.ends_with(|c: char| c.is_ascii_alphanumeric() || "_)]'.".contains(c)) && !apart {
            return Ok(());
        }
        let Some(end) = line.find('\'') else { return Ok(()) };
        let inner = &line[..end];
        let mark = self.span(self.at, self.at + end + 2);
        let d = Diagnostic::new("E129", format!("`'{inner}'` is no text and no transposition")).at(mark, "");
        Err(Box::new(if matches!(inner, "+" | "-") {
            d.help(
                "on an interface plain names are those of the first side: u; the other side is \
                 Interpolate(u, neighbor_element), and Normal points from the first to the other",
            )
        } else {
            d.help(format!("a text stands in double quotes: \"{inner}\""))
        }))
    }

    fn open_if(&mut self, at: usize) -> Parsed<()> {
        *self.ifs.last_mut().expect("one level is always there") += 1;
        self.check_depth(at)
    }

    fn check_depth(&self, at: usize) -> Parsed<()> {
        let depth = self.open.len() + self.ifs.iter().sum::<usize>();
        if depth <= NESTING_LIMIT {
            return Ok(());
        }
        let d = Diagnostic::new("E119", format!("nested more than {NESTING_LIMIT} deep"));
        Err(Box::new(d.at(self.span(at, at + 1), "").help("give parts of it a name: def part = ...")))
    }

    fn close(&mut self, c: char) -> Parsed<()> {
        let here = self.span(self.at, self.at + 1);
        match self.open.pop() {
            Some((open, _)) if closing(open) == c => {
                self.ifs.pop();
                Ok(())
            }
            Some((open, at)) => {
                let d = Diagnostic::new("E114", format!("`{open}` is closed by `{c}`"));
                let d = d.at(here, format!("`{}` belongs here", closing(open)));
                Err(Box::new(d.at(self.span(at, at + 1), "opened here")))
            }
            None => {
                let d = Diagnostic::new("E114", format!("`{c}` closes nothing"));
                Err(Box::new(d.at(here, "no bracket is open here")))
            }
        }
    }

    fn finish(self) -> Parsed<String> {
        let Some(&(open, at)) = self.open.last() else {
            return Ok(self.masked);
        };
        let d = Diagnostic::new("E114", format!("`{open}` is never closed"));
        Err(Box::new(d.at(self.span(at, at + 1), format!("`{}` is missing", closing(open)))))
    }

    /// Characters that no part of a text may hold, comments and strings included.
    fn allowed_anywhere(&self, c: char) -> Parsed<()> {
        let hidden = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}');
        let lone_return = c == '\r' && !self.text[self.at..].starts_with("\r\n");
        if !(c.is_control() && !"\t\r\n".contains(c) || hidden || lone_return) {
            return Ok(());
        }
        let d = Diagnostic::new("E118", format!("the character {} is not allowed", character_name(c)));
        let d = d.at(self.span(self.at, self.at + c.len_utf8()), "");
        Err(Box::new(match c {
            '\r' => d.help("end lines with a line feed, with or without a carriage return before it"),
            '\0' => d.help("this looks like a binary file, or text in UTF-16; a scene is UTF-8 text"),
            _ => d.help("delete it"),
        }))
    }

    /// Everything that is no word, bracket, comma or string.
    fn sign(&mut self, c: char) -> Parsed<()> {
        self.allowed_anywhere(c)?;
        if c.is_ascii_whitespace() {
            return Ok(());
        }
        if !c.is_ascii() {
            let d = Diagnostic::new("E118", format!("the character {} is not part of the language", character_name(c)));
            let d = d.at(self.span(self.at, self.at + c.len_utf8()), "");
            return Err(Box::new(match ascii_for(c) {
                Some(r) => d.help(format!("write {r}")),
                None => {
                    d.help("names are made of the letters a to z, A to Z, digits and `_`; comments may hold any text")
                }
            }));
        }
        let rest = &self.text[self.at..];
        for (slip, help) in FOREIGN_OPERATORS {
            if rest.starts_with(slip) && !(*slip == "!" && rest.starts_with("!=")) {
                let code = if slip.len() == 1 && "$?\\`%~".contains(slip) { "E118" } else { "E107" };
                let message = match code {
                    "E107" => format!("`{slip}` is not an operator"),
                    _ => format!("the character `{slip}` is not part of the language"),
                };
                let d = Diagnostic::new(code, message).at(self.span(self.at, self.at + slip.len()), "");
                let region = self.text.starts_with("region") && ["|", "||", "&&"].contains(slip);
                let help = if region {
                    "regions: p + q is both together, p & q what they share, p - q the rest"
                } else {
                    help
                };
                return Err(Box::new(d.help(help)));
            }
        }
        Ok(())
    }
}

/// Bytes of the number at the start of a text that starts with a digit.
fn number_length(text: &str) -> usize {
    let digits = |from: usize| text[from..].find(|c: char| !c.is_ascii_digit()).map_or(text.len(), |n| from + n);
    let mut end = digits(0);
    if text[end..].starts_with('.') && !text[end..].starts_with("..") {
        end = digits(end + 1);
    }
    let exponent = &text[end..];
    if exponent.starts_with(['e', 'E']) {
        let sign = usize::from(exponent[1..].starts_with(['+', '-']));
        if exponent[1 + sign..].starts_with(|c: char| c.is_ascii_digit()) {
            end = digits(end + 1 + sign);
        }
    }
    end
}

/// Why what stands behind a number makes it none.
struct NumberSlip {
    help: String,
    /// The slip is a `'` between digits.
    quoted: bool,
}

fn number_slip(number: &str, behind: &str) -> Option<NumberSlip> {
    let said = |help: String| Some(NumberSlip { help, quoted: false });
    let digit = |text: &str| text.starts_with(|c: char| c.is_ascii_digit());
    let mut next = behind.chars();
    let (first, rest) = (next.next()?, next.as_str());
    match first {
        '_' if digit(rest) => {
            let digits: String = behind.chars().take_while(|c| c.is_ascii_digit() || *c == '_').collect();
            said(format!("digits are not grouped: {number}{}", digits.replace('_', "")))
        }
        '\'' if digit(rest) => {
            let digits: String = behind.chars().take_while(|c| c.is_ascii_digit() || *c == '\'').collect();
            let help = format!("digits are not grouped: {number}{}", digits.replace('\'', ""));
            Some(NumberSlip { help, quoted: true })
        }
        '.' if digit(rest) && !number.ends_with('.') => said("a number has one decimal point".to_owned()),
        'e' | 'E' if !rest.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') => {
            said(format!("the power of ten behind `{first}` is a whole number: {number}e3; the number e is exp(1)"))
        }
        'd' | 'D' if digit(rest.trim_start_matches(['+', '-'])) => {
            said(format!("a power of ten is written with e: {number}e{}", leading_power(rest)))
        }
        'x' | 'X' if number == "0" && rest.starts_with(|c: char| c.is_ascii_hexdigit()) => {
            said("numbers are decimal".to_owned())
        }
        _ => None,
    }
}

/// The sign and the digits at the start of a text.
fn leading_power(text: &str) -> &str {
    let digits = text.trim_start_matches(['+', '-']);
    let sign = text.len() - digits.len();
    &text[..sign + digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len())]
}

/// What people type out of habit from elsewhere, and what to type here.
const FOREIGN_OPERATORS: &[(&str, &str)] = &[
    ("**", "x^2, or sqr(x)"),
    (".^", "`^` takes numbers; entry by entry only `.*` and `./` exist: v.*v"),
    ("===", "=="),
    ("!==", "!="),
    ("->", "`=` gives a value: def f(a) = a^2"),
    ("...", "a range is written a..b"),
    ("&&", "a < b and c < d"),
    ("||", "a < b or c < d"),
    ("//", "a comment starts with `#`"),
    ("/*", "a comment starts with `#`"),
    ("=<", "<="),
    ("=>", ">="),
    ("<>", "!="),
    ("~=", "!="),
    ("+=", "write the sum out"),
    ("-=", "write the difference out"),
    ("*=", "write the product out"),
    ("!", "not a == b, or a != b"),
    ("|", "Norm(v) for the norm, abs(a) for the absolute value"),
    ("%", "a comment starts with `#`"),
    ("?", "if condition then a else b"),
    ("~", "not a == b"),
    ("$", "a name stands without a mark: gamma, not $gamma"),
    ("\\", "a statement goes on over indented lines without a mark; names stand without it: gamma, not \\gamma"),
    ("`", "delete it"),
];

fn closing(open: char) -> char {
    match open {
        '(' => ')',
        '[' => ']',
        _ => '}',
    }
}
