//! Unstructured grids in the XML format of VTK: `.vtu`, appended raw binary.
//!
//! Promises: the grid is checked before the first byte, the header and the data come from one
//! list of blocks, values are written bit for bit (also NaN), the bytes depend on the input only,
//! and no copy of the data is made. Little endian, `UInt64` block headers, `Float64` values.
//! Does not compress, merge nodes of different pieces, or decide where fields are sampled.

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::PathBuf;

use super::atomic::Staged;
use super::grid::{Array, Cells, Piece, VtuError, check_cells};
use super::{OutputDir, OutputError, VtkCell};

/// Bytes converted at a time.
const CHUNK: usize = 8192;
/// First line of a VTK XML file, shared with the index of a series.
pub(super) const XML_DECLARATION: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";

/// Writes `pieces` as one grid into the file `name` (with its `.vtu`) and returns its path.
/// An array that a piece lacks is filled with NaN there. `time` becomes the field `TimeValue`. The file is on the disc
/// after [`OutputDir::sync`].
///
/// # Errors
/// [`OutputError::Vtu`], [`OutputError::Time`], [`OutputError::BadName`],
/// [`OutputError::Write`]; after any of them the file has its former content.
pub fn write_vtu(dir: &OutputDir, name: &str, time: Option<f64>, pieces: &[Piece]) -> Result<PathBuf, OutputError> {
    stage_vtu(dir, name, time, pieces)?.commit_unsynced()
}

/// [`write_vtu`] up to the final name.
pub(super) fn stage_vtu<'d>(
    dir: &'d OutputDir,
    name: &str,
    time: Option<f64>,
    pieces: &[Piece],
) -> Result<Staged<'d>, OutputError> {
    let file = || dir.path().join(name);
    if let Some(time) = time.filter(|time| !time.is_finite()) {
        return Err(OutputError::Time { file: file(), time });
    }
    let grid = Grid::check(time, pieces).map_err(|source| OutputError::Vtu { file: file(), source })?;
    dir.stage(name, |out| grid.write(out))
}

/// A grid without contradictions.
struct Grid<'a> {
    time: Option<f64>,
    pieces: &'a [Piece],
    point_channels: Vec<Channel<'a>>,
    cell_channels: Vec<Channel<'a>>,
}

/// An array as it stands in all pieces of the file.
struct Channel<'a> {
    name: &'a str,
    components: usize,
    /// Values in each piece; `None` stands for NaN.
    values: Vec<Option<&'a [f64]>>,
}

impl Channel<'_> {
    /// Components in the file.
    fn width(&self) -> usize {
        if self.components == 2 { 3 } else { self.components }
    }
}

/// One `DataArray` of the file, in the order of the file.
struct Block<'a> {
    name: &'a str,
    /// Components of one entry in the file.
    width: usize,
    n_entries: usize,
    content: Content<'a>,
}

enum Content<'a> {
    Time(f64),
    Points(&'a [[f64; 3]]),
    Nodes(&'a [u32]),
    Ends(&'a [usize]),
    Types(&'a [VtkCell]),
    Values { components: usize, values: &'a [f64] },
    Missing,
}

impl<'a> Grid<'a> {
    fn check(time: Option<f64>, pieces: &'a [Piece]) -> Result<Self, VtuError> {
        if pieces.is_empty() {
            return Err(VtuError::NoPiece);
        }
        for (idx, piece) in pieces.iter().enumerate() {
            check_cells(idx, piece)?;
        }
        Ok(Grid {
            time,
            pieces,
            point_channels: channels(pieces, |piece| (piece.points.len(), &piece.point_data))?,
            cell_channels: channels(pieces, |piece| (piece.cells.len(), &piece.cell_data))?,
        })
    }

    fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut header = Header::default();
        header.text.push_str(XML_DECLARATION);
        header.text.push_str(
            "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\">\n<UnstructuredGrid>\n",
        );
        if let Some(time) = self.time {
            header.section("FieldData", [time_block(time)]);
        }
        for (idx, piece) in self.pieces.iter().enumerate() {
            let [n_points, n_cells] = [piece.points.len(), piece.cells.len()];
            header.text.push_str(&format!("<Piece NumberOfPoints=\"{n_points}\" NumberOfCells=\"{n_cells}\">\n"));
            let points = self.point_channels.iter();
            let cells = self.cell_channels.iter();
            header.section("Points", [point_block(piece)]);
            header.section("Cells", cell_blocks(piece));
            header.section("PointData", points.map(|c| value_block(c, idx, n_points)));
            header.section("CellData", cells.map(|c| value_block(c, idx, n_cells)));
            header.text.push_str("</Piece>\n");
        }
        let Header { mut text, blocks, .. } = header;
        text.push_str("</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_");
        out.write_all(text.as_bytes())?;
        for block in blocks {
            out.write_all(&block.n_bytes().to_le_bytes())?;
            block.write(out)?;
        }
        out.write_all(b"\n</AppendedData>\n</VTKFile>\n")
    }
}

/// The text before the data, and the data that it promises.
#[derive(Default)]
struct Header<'a> {
    text: String,
    blocks: Vec<Block<'a>>,
    /// Where the next block begins, counted from behind the `_`.
    offset: u64,
}

impl<'a> Header<'a> {
    fn section(&mut self, tag: &str, blocks: impl IntoIterator<Item = Block<'a>>) {
        self.text.push_str(&format!("<{tag}>\n"));
        for block in blocks {
            self.declare(block, if tag == "FieldData" { "NumberOfTuples=\"1\" " } else { "" });
        }
        self.text.push_str(&format!("</{tag}>\n"));
    }

    fn declare(&mut self, block: Block<'a>, extra: &str) {
        self.text.push_str(&format!(
            "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" {extra}\
             format=\"appended\" offset=\"{}\"/>\n",
            block.content.word().0,
            escape(block.name),
            block.width,
            self.offset
        ));
        self.offset += size_of::<u64>() as u64 + block.n_bytes();
        self.blocks.push(block);
    }
}

impl Content<'_> {
    /// Type of a number in the file and its bytes.
    fn word(&self) -> (&'static str, usize) {
        match self {
            Content::Nodes(_) | Content::Ends(_) => ("Int64", 8),
            Content::Types(_) => ("UInt8", 1),
            _ => ("Float64", 8),
        }
    }
}

impl Block<'_> {
    fn n_bytes(&self) -> u64 {
        (self.n_entries * self.width * self.content.word().1) as u64
    }

    fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        match self.content {
            Content::Time(time) => out.write_all(&time.to_le_bytes()),
            Content::Points(points) => write_words(out, points.as_flattened().iter().map(|x| x.to_le_bytes())),
            Content::Nodes(nodes) => write_words(out, nodes.iter().map(|&node| i64::from(node).to_le_bytes())),
            // A length in memory is below 2^63, so the signed type of VTK has the same bytes.
            Content::Ends(ends) => write_words(out, ends.iter().map(|&end| (end as u64).to_le_bytes())),
            Content::Types(kinds) => write_words(out, kinds.iter().map(|kind| [kind.type_number()])),
            Content::Values { components, values } if components == self.width => {
                write_words(out, values.iter().map(|x| x.to_le_bytes()))
            }
            Content::Values { components, values } => {
                let padded = |entry| pad(entry, self.width);
                let entries = values.chunks_exact(components);
                write_words(out, entries.flat_map(padded).map(f64::to_le_bytes))
            }
            Content::Missing => {
                let n = self.n_entries * self.width;
                write_words(out, std::iter::repeat_n(f64::NAN.to_le_bytes(), n))
            }
        }
    }
}

/// The entry, then zeros up to `width`.
fn pad(entry: &[f64], width: usize) -> impl Iterator<Item = f64> {
    entry.iter().copied().chain(std::iter::repeat(0.0)).take(width)
}

fn write_words<const N: usize>(out: &mut dyn Write, words: impl Iterator<Item = [u8; N]>) -> io::Result<()> {
    let mut buffer = [0; CHUNK];
    let mut filled = 0;
    for word in words {
        if filled + N > CHUNK {
            out.write_all(&buffer[..filled])?;
            filled = 0;
        }
        buffer[filled..filled + N].copy_from_slice(&word);
        filled += N;
    }
    out.write_all(&buffer[..filled])
}

fn time_block<'a>(time: f64) -> Block<'a> {
    Block { name: "TimeValue", width: 1, n_entries: 1, content: Content::Time(time) }
}

fn point_block(piece: &Piece) -> Block<'_> {
    Block { name: "Points", width: 3, n_entries: piece.points.len(), content: Content::Points(&piece.points) }
}

fn cell_blocks(piece: &Piece) -> [Block<'_>; 3] {
    let Cells { kinds, nodes, ends } = &piece.cells;
    let block = |name, n_entries, content| Block { name, width: 1, n_entries, content };
    [
        block("connectivity", nodes.len(), Content::Nodes(nodes)),
        block("offsets", ends.len(), Content::Ends(ends)),
        block("types", kinds.len(), Content::Types(kinds)),
    ]
}

fn value_block<'a>(channel: &Channel<'a>, piece: usize, n_entries: usize) -> Block<'a> {
    let components = channel.components;
    Block {
        name: channel.name,
        width: channel.width(),
        n_entries,
        content: channel.values[piece].map_or(Content::Missing, |values| Content::Values { components, values }),
    }
}

/// The arrays of all pieces, in the order of their first appearance.
fn channels<'a>(
    pieces: &'a [Piece],
    select: impl Fn(&'a Piece) -> (usize, &'a [Array]),
) -> Result<Vec<Channel<'a>>, VtuError> {
    let mut channels: Vec<Channel<'a>> = Vec::new();
    for (idx, piece) in pieces.iter().enumerate() {
        let (n_entries, arrays) = select(piece);
        for array in arrays {
            let known = channels.iter().position(|c| c.name == array.name);
            let at = known.unwrap_or(channels.len());
            if known.is_none() {
                channels.push(Channel {
                    name: &array.name,
                    components: array.components.max(1),
                    values: vec![None; pieces.len()],
                });
            }
            check_array(idx, n_entries, array, &channels[at])?;
            channels[at].values[idx] = Some(&array.values);
        }
    }
    Ok(channels)
}

fn check_array(piece: usize, n_entries: usize, array: &Array, channel: &Channel<'_>) -> Result<(), VtuError> {
    let name = || array.name.clone();
    if channel.values[piece].is_some() {
        let name = name();
        return Err(VtuError::DuplicateArray { piece, name });
    }
    if array.components != channel.components {
        return Err(VtuError::ArrayComponents {
            piece,
            name: name(),
            expected: channel.components,
            found: array.components,
        });
    }
    let expected = n_entries * array.components;
    if array.values.len() != expected {
        return Err(VtuError::ArrayLength { piece, name: name(), expected, found: array.values.len() });
    }
    Ok(())
}

/// Text as the value of an XML attribute. Characters that XML cannot hold become U+FFFD.
pub(super) fn escape(text: &str) -> Cow<'_, str> {
    let is_special = |c| matches!(c, '&' | '<' | '>' | '"' | '\'' | '\u{fffe}' | '\u{ffff}');
    let is_plain = |c: char| !c.is_control() && !is_special(c);
    if text.chars().all(is_plain) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&apos;"),
            '\t' | '\n' | '\r' => escaped.push_str(&format!("&#{};", u32::from(c))),
            c if is_plain(c) => escaped.push(c),
            _ => escaped.push(char::REPLACEMENT_CHARACTER),
        }
    }
    Cow::Owned(escaped)
}

#[cfg(test)]
#[path = "vtu_tests.rs"]
mod tests;
