//! Reading numbers from a file that is text or binary: one cursor for both.
//!
//! Promises: no panic on any input; every error carries the line (text) or byte (binary).

use super::error::{Place, ReadError};

/// A position in a file.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Numbers are binary now.
    pub(super) binary: bool,
    /// Binary numbers have their most significant byte first.
    pub(super) big_endian: bool,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Cursor { bytes, at: 0, binary: false, big_endian: false }
    }

    /// The current place, for an error message; counts lines only then.
    pub(super) fn place(&self) -> Place {
        if self.binary {
            return Place::Byte(self.at);
        }
        let before = &self.bytes[..self.at.min(self.bytes.len())];
        Place::Line(1 + before.iter().filter(|byte| **byte == b'\n').count())
    }

    /// Bytes not read yet: a bound for how many numbers can follow.
    pub(super) fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    pub(super) fn truncated(&self, needed: &'static str) -> ReadError {
        let place = self.place();
        ReadError::Truncated { needed, place }
    }

    pub(super) fn skip_white(&mut self) {
        while self.bytes.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
    }

    /// The next word of text; empty at the end of the file.
    fn word(&mut self) -> &'a [u8] {
        self.skip_white();
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    /// The rest of the current line without its end.
    pub(super) fn line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|byte| *byte == b'\n');
        let line = &rest[..length.unwrap_or(rest.len())];
        self.at += line.len() + usize::from(length.is_some());
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    fn wrong(&mut self, word: &[u8], needed: &'static str) -> ReadError {
        if word.is_empty() {
            return self.truncated(needed);
        }
        self.at -= word.len();
        let shown = &word[..word.len().min(40)];
        ReadError::Syntax { needed, found: String::from_utf8_lossy(shown).into_owned(), place: self.place() }
    }

    /// A whole number written as text, also in a binary file.
    pub(super) fn text_integer(&mut self, needed: &'static str) -> Result<i64, ReadError> {
        let word = self.word();
        let (negative, digits) = match word {
            [b'-', digits @ ..] => (true, digits),
            digits => (false, digits),
        };
        // 18 digits cannot overflow.
        if digits.is_empty() || digits.len() > 18 || !digits.iter().all(u8::is_ascii_digit) {
            return Err(self.wrong(word, needed));
        }
        let value = digits.iter().fold(0, |value, digit| value * 10 + i64::from(digit - b'0'));
        Ok(if negative { -value } else { value })
    }

    /// A count or number written as text, not negative.
    pub(super) fn text_size(&mut self, needed: &'static str) -> Result<u64, ReadError> {
        let before = self.at;
        let value = self.text_integer(needed)?;
        u64::try_from(value).map_err(|_| self.negative(before, value, needed))
    }

    fn negative(&mut self, before: usize, value: i64, needed: &'static str) -> ReadError {
        self.at = before;
        if !self.binary {
            self.skip_white();
        }
        ReadError::Syntax { needed, found: value.to_string(), place: self.place() }
    }

    fn raw<const N: usize>(&mut self, needed: &'static str) -> Result<[u8; N], ReadError> {
        let Some(bytes) = self.bytes[self.at..].first_chunk::<N>() else {
            self.at = self.bytes.len();
            return Err(self.truncated(needed));
        };
        self.at += N;
        let mut bytes = *bytes;
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// An `int` of the file.
    pub(super) fn integer(&mut self, needed: &'static str) -> Result<i64, ReadError> {
        if self.binary {
            return Ok(i64::from(i32::from_le_bytes(self.raw(needed)?)));
        }
        self.text_integer(needed)
    }

    /// An `int` of the file that is not negative.
    pub(super) fn natural(&mut self, needed: &'static str) -> Result<u64, ReadError> {
        let before = self.at;
        let value = self.integer(needed)?;
        u64::try_from(value).map_err(|_| self.negative(before, value, needed))
    }

    /// A `size_t` of the file.
    pub(super) fn size(&mut self, needed: &'static str) -> Result<u64, ReadError> {
        if self.binary {
            return Ok(u64::from_le_bytes(self.raw(needed)?));
        }
        self.text_size(needed)
    }

    /// A `double` of the file.
    pub(super) fn double(&mut self, needed: &'static str) -> Result<f64, ReadError> {
        if self.binary {
            return Ok(f64::from_le_bytes(self.raw(needed)?));
        }
        let word = self.word();
        let value = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        value.ok_or_else(|| self.wrong(word, needed))
    }

    /// Three finite coordinates of a node.
    pub(super) fn coordinates(&mut self, node: u64) -> Result<[f64; 3], ReadError> {
        let mut x = [0.0; 3];
        for value in &mut x {
            *value = self.double("a coordinate")?;
            if !value.is_finite() {
                return Err(ReadError::NonFinite { node, value: *value, place: self.place() });
            }
        }
        Ok(x)
    }

    /// The word that closes a section. `needed` is that word.
    pub(super) fn close(&mut self, needed: &'static str) -> Result<(), ReadError> {
        let word = self.word();
        if word == needed.as_bytes() {
            return Ok(());
        }
        // What stands there may be binary; show it as text.
        self.binary = false;
        Err(self.wrong(word, needed))
    }

    /// Goes behind the next line `$...` and returns its name; `None` at the end of the file.
    pub(super) fn section(&mut self) -> Option<&'a [u8]> {
        while self.at < self.bytes.len() {
            self.skip_white();
            let line = self.line();
            if let [b'$', name @ ..] = line {
                return Some(name.trim_ascii());
            }
        }
        None
    }

    /// Goes behind the end of section `name` without reading it.
    pub(super) fn skip_section(&mut self, name: &[u8]) -> Result<(), ReadError> {
        let end = [b"$End", name].concat();
        let rest = &self.bytes[self.at..];
        // Only the few bytes after a `$` are compared in full.
        let found = rest.iter().enumerate().find(|(i, byte)| **byte == b'$' && rest[*i..].starts_with(&end));
        let Some((offset, _)) = found else {
            self.at = self.bytes.len();
            return Err(self.truncated("the end of a section"));
        };
        self.at += offset + end.len();
        Ok(())
    }
}
