//! Cuts a text into statements and checks what needs no grammar: characters, strings, brackets, nesting, foreign
//! operators. Gives the text of a statement with comments blanked out, byte for byte in place.

use super::{
    NESTING_LIMIT, Parsed, TEXT_LIMIT,
    characters::{Meant, ascii_for, character_name},
    is_statement, span_at,
};
use crate::{
    codes::Code,
    diag::{Diagnostic, nearest},
    fix::Fix,
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
    let d = Diagnostic::new(Code::E125, format!("this text has {} bytes, {TEXT_LIMIT} are allowed", text.len()));
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
                let d = Diagnostic::new(Code::E115, "a statement starts in column 1")
                    .at(span_at(id, 0, from, to), "this line is indented, but there is no statement to continue")
                    .fix(to_column_1(span_at(id, 0, at, from)));
                strays.push(d);
            }
        }
        at += line.len();
    }
    Ok((pieces, strays))
}

/// The indentation of a first line goes.
pub(super) fn to_column_1(indentation: Span) -> Fix {
    Fix::Replace { span: indentation, text: String::new(), title: Some("Move to column 1") }
}

/// The message for a line that probably continues the statement above, if there is one.
fn continuing(d: Diagnostic, piece: &Piece, id: SourceId, above: &str) -> Diagnostic {
    let d = d.help("a continuation line is indented: put a space before it");
    let is_code = |line: &str| !line.trim_start().is_empty() && !line.trim_start().starts_with('#');
    if !above.lines().any(is_code) {
        return d;
    }
    let title = Some("Indent: the statement above goes on here");
    d.fix(Fix::Replace { span: span_at(id, piece.start, 0, 0), text: "    ".to_owned(), title })
}

/// Refuses a piece whose first word is no statement; `above` is the text before it.
pub(super) fn known_statement(masked: &str, piece: &Piece, id: SourceId, above: &str) -> Parsed<()> {
    let word = masked.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').next().unwrap_or("");
    if STATEMENTS.contains(&word) || word == "wfl" {
        return Ok(());
    }
    let line = masked.lines().next().unwrap_or("").trim_end();
    let shown = if word.is_empty() { line } else { word };
    let shown_short: String = shown.chars().take(30).collect();
    let mark = span_at(id, piece.start, 0, shown.len());
    let is_import = word != "from" || line.contains(" import");
    if let Some(here) = foreign_statement(word).filter(|_| is_import) {
        let d = Diagnostic::new(Code::E115, format!("`{shown_short}` is not a statement"));
        let d = d.at(mark, "").help(here.text);
        let meant = here.word.filter(|meant| is_statement(&format!("{meant}{}", &masked[word.len()..]), id));
        return Err(Box::new(match meant {
            Some(meant) => d.replace(mark, meant),
            None => d,
        }));
    }
    if KEYWORDS.contains(&word) {
        let d = Diagnostic::new(Code::E115, format!("`{word}` does not start a statement"));
        return Err(Box::new(continuing(d.at(mark, ""), piece, id, above)));
    }
    if word.is_empty() {
        let d = Diagnostic::new(Code::E115, "a statement starts with a word");
        return Err(Box::new(continuing(d.at(mark, ""), piece, id, above)));
    }
    let d = Diagnostic::new(Code::E115, format!("`{shown_short}` is not a statement"));
    let rest = masked[word.len()..].trim_start();
    let d = match nearest(word, STATEMENTS.iter().copied()) {
        None if rest.starts_with('(') && rest.contains('=') => {
            let fix = format!("a prescribed value: fix {shown_short}(1) = ... on REGION");
            d.at(mark, "").help(format!("{fix}; an expression: def {shown_short}(a) = ..."))
        }
        Some(s) => d.at(mark, format!("did you mean `{s}`?")).replace(mark, s),
        None if rest.starts_with('=') && foreign(called(rest)).is_some() => {
            d.at(mark, "").help(foreign(called(rest)).unwrap_or_default())
        }
        None if rest.starts_with('=') && !rest.starts_with("==") => {
            let d = d.at(mark, "").replace(span_at(id, piece.start, 0, 0), "param ");
            d.help(format!("a number: param {shown_short} = ...; an expression: def {shown_short} = ..."))
        }
        None => continuing(d.at(mark, ""), piece, id, above),
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
        let d = Diagnostic::new(Code::E121, "this text has no closing quote");
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
            let mark = self.span(self.at, self.at + end);
            let text: String = rest[..end].chars().take(40).collect();
            let d = Diagnostic::new(Code::E120, format!("`{text}` is not a number"));
            let d = d.at(mark, "").help(slip.help);
            return Err(Box::new(match slip.meant {
                Some(meant) if meant.read == end - read => d.replace(mark, meant.number),
                _ => d,
            }));
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
        let d = Diagnostic::new(Code::E129, format!("`'{inner}'` is no text and no transposition")).at(mark, "");
        Err(Box::new(if matches!(inner, "+" | "-") {
            d.help(
                "on an interface plain names are those of the first side: u; the other side is \
                 Interpolate(u, neighbor_element), and Normal points from the first to the other",
            )
        } else {
            d.help(format!("a text stands in double quotes: \"{inner}\"")).replace(mark, format!("\"{inner}\""))
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
        let d = Diagnostic::new(Code::E119, format!("nested more than {NESTING_LIMIT} deep"));
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
                let d = Diagnostic::new(Code::E114, format!("`{open}` is closed by `{c}`"));
                let d = d.at(here, format!("`{}` belongs here", closing(open))).replace(here, closing(open));
                Err(Box::new(d.at(self.span(at, at + 1), "opened here")))
            }
            None => {
                let d = Diagnostic::new(Code::E114, format!("`{c}` closes nothing"));
                Err(Box::new(d.at(here, "no bracket is open here").replace(here, "")))
            }
        }
    }

    fn finish(self) -> Parsed<String> {
        let Some(&(open, at)) = self.open.last() else {
            return Ok(self.masked);
        };
        let d = Diagnostic::new(Code::E114, format!("`{open}` is never closed"));
        let d = d.at(self.span(at, at + 1), format!("`{}` is missing", closing(open)));
        // on several lines it may be missing anywhere
        let code = self.masked.trim_end();
        let end = self.span(code.len(), code.len());
        Err(Box::new(if code.contains('\n') { d } else { d.replace(end, closing(open)) }))
    }

    /// Characters that no part of a text may hold, comments and strings included.
    fn allowed_anywhere(&self, c: char) -> Parsed<()> {
        let hidden = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}');
        let lone_return = c == '\r' && !self.text[self.at..].starts_with("\r\n");
        if !(c.is_control() && !"\t\r\n".contains(c) || hidden || lone_return) {
            return Ok(());
        }
        let d = Diagnostic::new(Code::E118, format!("the character {} is not allowed", character_name(c)));
        let mark = self.span(self.at, self.at + c.len_utf8());
        let d = d.at(mark, "");
        Err(Box::new(match c {
            '\r' => d.help("end lines with a line feed, with or without a carriage return before it"),
            '\0' => d.help("this looks like a binary file, or text in UTF-16; a scene is UTF-8 text"),
            _ => d.help("delete it").replace(mark, ""),
        }))
    }

    /// What stands for a character outside ASCII, the next one.
    fn plain(&self, c: char, meant: Meant) -> Option<Fix> {
        let line = self.text[self.at..].lines().next().unwrap_or("");
        let (length, text, title) = match meant {
            Meant::Unknown => return None,
            Meant::Sign(sign) => (c.len_utf8(), sign.to_owned(), None),
            Meant::Quotes => {
                let typographic = |c: char| matches!(c, '\u{201c}'..='\u{201f}' | '\u{ab}' | '\u{bb}');
                let last = line.char_indices().rev().find(|(_, c)| typographic(*c));
                let length = last.map_or(line.len(), |(k, c)| k + c.len_utf8());
                (length, line[..length].replace(typographic, "\""), Some("Write plain quotes"))
            }
            Meant::Call { function, partner } => {
                let inside = line[c.len_utf8()..].split_once(partner)?.0;
                let length = c.len_utf8() + inside.len() + partner.len_utf8();
                (length, format!("{function}({inside})"), None)
            }
        };
        Some(Fix::Replace { span: self.span(self.at, self.at + length), text, title })
    }

    /// Everything that is no word, bracket, comma or string.
    fn sign(&mut self, c: char) -> Parsed<()> {
        self.allowed_anywhere(c)?;
        if c.is_ascii_whitespace() {
            return Ok(());
        }
        if !c.is_ascii() {
            let d =
                Diagnostic::new(Code::E118, format!("the character {} is not part of the language", character_name(c)));
            let mark = self.span(self.at, self.at + c.len_utf8());
            let d = d.at(mark, "");
            return Err(Box::new(match ascii_for(c) {
                Some(plain) => {
                    let d = d.help(format!("write {}", plain.text));
                    self.plain(c, plain.meant).into_iter().fold(d, Diagnostic::fix)
                }
                None => {
                    d.help("names are made of the letters a to z, A to Z, digits and `_`; comments may hold any text")
                }
            }));
        }
        let rest = &self.text[self.at..];
        for (slip, help, meant) in FOREIGN_OPERATORS {
            if rest.starts_with(slip) && !(*slip == "!" && rest.starts_with("!=")) {
                let code = if slip.len() == 1 && "$?\\`%~".contains(slip) { Code::E118 } else { Code::E107 };
                let message = match code {
                    Code::E107 => format!("`{slip}` is not an operator"),
                    _ => format!("the character `{slip}` is not part of the language"),
                };
                let mark = self.span(self.at, self.at + slip.len());
                let d = Diagnostic::new(code, message).at(mark, "");
                let of_regions = [("|", "+"), ("||", "+"), ("&&", "&")].into_iter().find(|o| o.0 == *slip);
                if let Some((_, meant)) = of_regions.filter(|_| self.text.starts_with("region")) {
                    let help = "regions: p + q is both together, p & q what they share, p - q the rest";
                    return Err(Box::new(d.help(help).replace(mark, meant)));
                }
                let d = d.help(*help);
                return Err(Box::new(match meant {
                    Some(meant) => d.replace(mark, *meant),
                    None => d,
                }));
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
    meant: Option<MeantNumber>,
}

/// The number that is meant, and how many bytes behind the one that was read are part of it.
struct MeantNumber {
    number: String,
    read: usize,
}

fn number_slip(number: &str, behind: &str) -> Option<NumberSlip> {
    let said = |help: String| Some(NumberSlip { help, quoted: false, meant: None });
    let meant = |start: &str, number: String, read: usize| {
        let help = format!("{start}{number}");
        Some(NumberSlip { help, quoted: false, meant: Some(MeantNumber { number, read }) })
    };
    let digit = |text: &str| text.starts_with(|c: char| c.is_ascii_digit());
    let grouped = |sign: char| {
        let digits = behind.find(|c: char| !c.is_ascii_digit() && c != sign).unwrap_or(behind.len());
        meant("digits are not grouped: ", format!("{number}{}", behind[..digits].replace(sign, "")), digits)
    };
    let mut next = behind.chars();
    let (first, rest) = (next.next()?, next.as_str());
    match first {
        '_' if digit(rest) => grouped('_'),
        '\'' if digit(rest) => Some(NumberSlip { quoted: true, ..grouped('\'')? }),
        '.' if digit(rest) && !number.ends_with('.') => said("a number has one decimal point".to_owned()),
        'e' | 'E' if !rest.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') => {
            said(format!("the power of ten behind `{first}` is a whole number: {number}e3; the number e is exp(1)"))
        }
        'd' | 'D' if digit(rest.trim_start_matches(['+', '-'])) => {
            let power = leading_power(rest);
            meant("a power of ten is written with e: ", format!("{number}e{power}"), 1 + power.len())
        }
        'x' | 'X' if number == "0" && rest.starts_with(|c: char| c.is_ascii_hexdigit()) => {
            let digits = rest.find(|c: char| !c.is_ascii_hexdigit()).unwrap_or(rest.len());
            let value = u64::from_str_radix(&rest[..digits], 16).ok();
            let meant = value.map(|value| MeantNumber { number: value.to_string(), read: 1 + digits });
            Some(NumberSlip { help: "numbers are decimal".to_owned(), quoted: false, meant })
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

/// What people type out of habit from elsewhere, what to type here, and what stands for the sign itself if that is sure.
const FOREIGN_OPERATORS: &[(&str, &str, Option<&str>)] = &[
    ("**", "x^2, or sqr(x)", Some("^")),
    (".^", "`^` takes numbers; entry by entry only `.*` and `./` exist: v.*v", None),
    ("===", "==", Some("==")),
    ("!==", "!=", Some("!=")),
    ("->", "`=` gives a value: def f(a) = a^2", Some("=")),
    ("...", "a range is written a..b", Some("..")),
    ("&&", "a < b and c < d", Some(" and ")),
    ("||", "a < b or c < d", Some(" or ")),
    ("//", "a comment starts with `#`", Some("#")),
    ("/*", "a comment starts with `#`", None),
    ("=<", "<=", Some("<=")),
    ("=>", ">=", Some(">=")),
    ("<>", "!=", Some("!=")),
    ("~=", "!=", Some("!=")),
    ("+=", "write the sum out", None),
    ("-=", "write the difference out", None),
    ("*=", "write the product out", None),
    ("!", "not a == b, or a != b", None),
    ("|", "Norm(v) for the norm, abs(a) for the absolute value", None),
    ("%", "a comment starts with `#`", Some("#")),
    ("?", "if condition then a else b", None),
    ("~", "not a == b", None),
    ("$", "a name stands without a mark: gamma, not $gamma", Some("")),
    (
        "\\",
        "a statement goes on over indented lines without a mark; names stand without it: gamma, not \\gamma",
        Some(""),
    ),
    ("`", "delete it", Some("")),
];

fn closing(open: char) -> char {
    match open {
        '(' => ')',
        '[' => ']',
        _ => '}',
    }
}
