//! Diagnostics: what is wrong, where, and what to do.
//!
//! User text never ends in a panic or a bare string: it gives [`Checked`], a value if there is one and every
//! diagnostic found on the way.

use crate::{
    codes::{Code, Severity},
    fix::Fix,
    source::Span,
};

/// A place with what is to be said about it (may be empty).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// The place.
    pub span: Span,
    /// The text beside the mark.
    pub text: String,
}

/// One message: code, sentence, primary place, further places, notes and helps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// `E203`, `W404`: a page of `codes.rs`.
    pub code: Code,
    /// Error or warning.
    pub severity: Severity,
    /// One line, lower case, no full stop.
    pub message: String,
    /// The first label is the primary place; none when no text is to blame.
    pub labels: Vec<Label>,
    /// `= note:` lines.
    pub notes: Vec<String>,
    /// `= help:` lines: what to type instead.
    pub helps: Vec<String>,
    /// Changes that take it away, where nothing is left to choose.
    pub fixes: Vec<Fix>,
    /// The name that is called unknown or missing; nothing is said if a broken declaration explains it.
    pub about: Option<String>,
    /// Where that name is written, without prefixes, if it is.
    pub word: Option<Span>,
}

impl Diagnostic {
    /// An error or warning, by the first letter of `code`.
    #[must_use]
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: code.severity(),
            message: message.into(),
            labels: Vec::new(),
            notes: Vec::new(),
            helps: Vec::new(),
            fixes: Vec::new(),
            about: None,
            word: None,
        }
    }

    /// Adds a place; the first one added is the primary one.
    #[must_use]
    pub fn at(mut self, span: Span, text: impl Into<String>) -> Self {
        self.labels.push(Label { span, text: text.into() });
        self
    }

    /// Adds a label where there is a place, and else a `= note:` line with its text.
    #[must_use]
    pub fn at_or_note(self, place: Option<Span>, text: impl Into<String>) -> Self {
        match place {
            Some(span) => self.at(span, text),
            None => self.note(text),
        }
    }

    /// All that it says in one line, without code and places.
    #[must_use]
    pub fn line(&self) -> String {
        let labels = self.labels.iter().map(|l| &l.text).filter(|text| !text.is_empty());
        let parts: Vec<&str> = std::iter::once(&self.message)
            .chain(labels)
            .chain(&self.notes)
            .chain(&self.helps)
            .map(String::as_str)
            .collect();
        parts.join("; ")
    }

    /// Adds a `= note:` line.
    #[must_use]
    pub fn note(mut self, text: impl Into<String>) -> Self {
        self.notes.push(text.into());
        self
    }

    /// Adds a `= help:` line.
    #[must_use]
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.helps.push(text.into());
        self
    }

    /// Offers a change that takes it away.
    #[must_use]
    pub fn fix(mut self, fix: Fix) -> Self {
        self.fixes.push(fix);
        self
    }

    /// Offers another text at a place; an empty one deletes what stands there.
    #[must_use]
    pub fn replace(self, span: Span, text: impl Into<String>) -> Self {
        self.fix(Fix::Replace { span, text: text.into(), title: None })
    }

    /// Adds a place where a word is unknown; the one that is near, if there is one, is offered in its place.
    #[must_use]
    pub fn did_you_mean(self, word: Span, near: Option<&str>) -> Self {
        match near {
            Some(near) => self.at(word, format!("did you mean `{near}`?")).replace(word, near),
            None => self.at(word, ""),
        }
    }

    /// Adds a `= help:` line that is a statement, and offers to add it.
    #[must_use]
    pub fn missing(self, statement: impl Into<String>) -> Self {
        let statement = statement.into();
        self.help(statement.clone()).fix(Fix::AddStatement(statement))
    }

    /// Says which name is missing.
    #[must_use]
    pub fn about(mut self, name: impl Into<String>) -> Self {
        self.about = Some(name.into());
        self
    }

    /// Says where the name of [`about`](Self::about) is written.
    #[must_use]
    pub fn word(mut self, at: Span) -> Self {
        self.word = Some(at);
        self
    }

    /// True for errors.
    #[must_use]
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }
}

/// A value, if one could be made, and everything that was found.
#[derive(Clone, Debug)]
pub struct Checked<T> {
    /// The value; may be present beside errors when later stages can still use it to find more.
    pub value: Option<T>,
    /// All messages, in the order of the text where possible.
    pub diagnostics: Vec<Diagnostic>,
}

impl<T> Checked<T> {
    /// A value without messages.
    pub fn ok(value: T) -> Self {
        Self { value: Some(value), diagnostics: Vec::new() }
    }

    /// No value, one message.
    #[must_use]
    pub fn fail(diagnostic: Diagnostic) -> Self {
        Self { value: None, diagnostics: vec![diagnostic] }
    }

    /// True if any message is an error.
    #[must_use]
    pub fn has_errors(&self) -> bool {
        self.diagnostics.iter().any(Diagnostic::is_error)
    }

    /// The value if there is one and no error stands; the messages otherwise. Warnings are appended to `sink`.
    pub fn into_result(self, sink: &mut Vec<Diagnostic>) -> Option<T> {
        let bad = self.has_errors();
        sink.extend(self.diagnostics);
        if bad { None } else { self.value }
    }
}

/// The name in `known` nearest to `word` by edit distance, if it is near enough to be offered.
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted: Vec<char> = word.to_lowercase().chars().collect();
    if wanted.len() > LONGEST_NAME {
        return None;
    }
    // one letter is as near to any other: only its case can be wrong
    let limit = match wanted.len() {
        0 | 1 => 0,
        n => (n / 3).max(1),
    };
    known
        .into_iter()
        .take(MOST_NAMES)
        .filter_map(|k| Some((edit_distance(&wanted, k, limit)?, k)))
        .min_by_key(|(d, _)| *d)
        .map(|(_, k)| k)
}

/// Longer names are not offered for, and no more names than this are looked at: each message would cost as much as the
/// scene has names, and a scene may have as many messages.
const LONGEST_NAME: usize = 64;
const MOST_NAMES: usize = 2000;

/// Optimal string alignment distance (insert, delete, replace, swap of neighbours), case ignored; `None` above `limit`.
/// `a` is in lower case.
fn edit_distance(a: &[char], b: &str, limit: usize) -> Option<usize> {
    // every character has one to four bytes
    if b.len() > 4 * (a.len() + limit) {
        return None;
    }
    let b: Vec<char> = b.to_lowercase().chars().collect();
    if a.len().abs_diff(b.len()) > limit {
        return None;
    }
    let (mut before, mut last, mut row) = (Vec::new(), (0..=b.len()).collect::<Vec<usize>>(), Vec::new());
    for i in 1..=a.len() {
        row.clear();
        row.push(i);
        for j in 1..=b.len() {
            let replace = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut best = replace.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(before[j - 2] + 1);
            }
            row.push(best);
        }
        // a later row is at least as large as the smallest of two neighbours
        if row.iter().chain(&last).all(|d| *d > limit) {
            return None;
        }
        before = std::mem::replace(&mut last, std::mem::take(&mut row));
    }
    Some(last[b.len()]).filter(|d| *d <= limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offers_the_nearest_name_only() {
        assert_eq!(nearest("gama", ["gamma", "theta"]), Some("gamma"));
        assert_eq!(nearest("m", ["X", "u"]), None);
        assert_eq!(nearest("N", ["n", "u"]), Some("n"));
        assert_eq!(nearest("xyz", ["gamma", "theta"]), None);
        assert_eq!(nearest("Nomral", ["Normal", "X"]), Some("Normal"));
        assert_eq!(nearest("gamma_contact", ["gama_contat", "theta"]), Some("gama_contat"));
        assert_eq!(nearest("abcdef", ["badcfe", "abdcxx"]), None);
        assert_eq!(nearest(&"a".repeat(100), ["b"]), None);
    }
}
