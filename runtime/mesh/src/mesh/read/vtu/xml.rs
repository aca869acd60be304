//! The tags of an XML file, one after the other, up to data that is no text.

use super::{ReadError, wrong};

/// A tag with its attributes.
pub(super) struct Tag {
    pub(super) name: String,
    pub(super) attributes: Vec<(String, String)>,
    /// `</...>`.
    pub(super) closes: bool,
    /// `<... />`.
    pub(super) empty: bool,
    /// Where it begins.
    pub(super) at: usize,
}

impl Tag {
    pub(super) fn value(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|a| a.0 == name).map(|a| a.1.as_str())
    }

    pub(super) fn number(&self, name: &str) -> Option<usize> {
        self.value(name)?.trim().parse().ok()
    }
}

/// A place in a file.
pub(super) struct Tags<'a> {
    bytes: &'a [u8],
    /// Behind the last tag.
    pub(super) at: usize,
}

impl<'a> Tags<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Tags { bytes, at: 0 }
    }

    fn find(&self, from: usize, what: &[u8]) -> Option<usize> {
        self.bytes.get(from..)?.windows(what.len()).position(|w| w == what).map(|k| from + k)
    }

    /// The next tag that is no comment and no instruction.
    pub(super) fn next(&mut self) -> Result<Option<Tag>, ReadError> {
        while let Some(at) = self.find(self.at, b"<") {
            let cut = || wrong(at, "the file ends inside a tag");
            let rest = &self.bytes[at..];
            if rest.starts_with(b"<!--") {
                self.at = self.find(at, b"-->").ok_or_else(cut)? + 3;
                continue;
            }
            let end = self.find(at, b">").ok_or_else(cut)?;
            self.at = end + 1;
            if !rest.starts_with(b"<?") && !rest.starts_with(b"<!") {
                return Ok(Some(tag(&self.bytes[at + 1..end], at)));
            }
        }
        Ok(None)
    }

    /// The text of the element whose opening tag was read last, without elements inside it; goes behind its closing tag.
    pub(super) fn text(&mut self, name: &str) -> Result<Vec<u8>, ReadError> {
        let mut text = Vec::new();
        let (start, mut depth) = (self.at, 0usize);
        loop {
            let cut = || wrong(start, format!("`{name}` is not closed"));
            let open = self.find(self.at, b"<").ok_or_else(cut)?;
            if depth == 0 {
                text.extend_from_slice(&self.bytes[self.at..open]);
            }
            let tag = self.next()?.ok_or_else(cut)?;
            match (tag.closes, depth) {
                (true, 0) if tag.name == name => return Ok(text),
                (true, _) => depth = depth.saturating_sub(1),
                (false, _) => depth += usize::from(!tag.empty),
            }
        }
    }
}

fn tag(bytes: &[u8], at: usize) -> Tag {
    let text = String::from_utf8_lossy(bytes);
    let closes = text.starts_with('/');
    let empty = text.ends_with('/');
    let text = text.trim_matches('/');
    let end = text.find(char::is_whitespace).unwrap_or(text.len());
    let (name, mut rest) = text.split_at(end);
    let mut attributes = Vec::new();
    while let Some((key, behind)) = rest.split_once('=') {
        let behind = behind.trim_start();
        let Some(quote) = behind.chars().next().filter(|c| matches!(c, '"' | '\'')) else { break };
        let Some((value, more)) = behind[1..].split_once(quote) else { break };
        attributes.push((key.trim().to_owned(), value.to_owned()));
        rest = more;
    }
    Tag { name: name.to_owned(), attributes, closes, empty, at }
}
