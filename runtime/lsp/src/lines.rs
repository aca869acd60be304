//! Places of a text: bytes here, lines and UTF-16 units in the protocol.

use lsp_types::{Position, Range};

/// Where the lines of a text start.
#[derive(Clone, Debug)]
pub(crate) struct Lines {
    starts: Vec<usize>,
}

impl Lines {
    pub(crate) fn new(text: &str) -> Self {
        let ends = text.bytes().enumerate().filter(|b| b.1 == b'\n').map(|b| b.0 + 1);
        Self { starts: std::iter::once(0).chain(ends).collect() }
    }

    /// The position of a byte; one past the end is the end.
    pub(crate) fn position(&self, text: &str, offset: usize) -> Position {
        let mut offset = offset.min(text.len());
        while !text.is_char_boundary(offset) {
            offset -= 1;
        }
        let line = self.starts.partition_point(|s| *s <= offset) - 1;
        let units = text[self.starts[line]..offset].encode_utf16().count();
        Position { line: narrow(line), character: narrow(units) }
    }

    /// The byte at a position; behind the end of a line it is that end.
    pub(crate) fn offset(&self, text: &str, position: Position) -> usize {
        let Some(start) = self.starts.get(position.line as usize).copied() else { return text.len() };
        let end = self.starts.get(position.line as usize + 1).map_or(text.len(), |e| e - 1);
        let mut units = position.character as usize;
        for (k, c) in text[start..end].char_indices() {
            if units < c.len_utf16() {
                return start + k;
            }
            units -= c.len_utf16();
        }
        end
    }

    pub(crate) fn range(&self, text: &str, start: usize, end: usize) -> Range {
        Range { start: self.position(text, start), end: self.position(text, end) }
    }
}

/// Texts have at most 4 MB, so numbers of lines and columns fit.
fn narrow(x: usize) -> u32 {
    u32::try_from(x).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_and_positions_lead_to_each_other() {
        let text = "a\n\u{1d6fe}é = 1\r\n\nend";
        let lines = Lines::new(text);
        for (k, _) in text.char_indices().chain([(text.len(), ' ')]) {
            let position = lines.position(text, k);
            assert_eq!(lines.offset(text, position), k, "{k} {position:?}");
        }
        assert_eq!(lines.position(text, 8), Position { line: 1, character: 3 });
        assert_eq!(lines.offset(text, Position { line: 1, character: 99 }), 13);
        assert_eq!(lines.offset(text, Position { line: 99, character: 0 }), text.len());
        assert_eq!(Lines::new("").offset("", Position { line: 0, character: 5 }), 0);
    }
}
