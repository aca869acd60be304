//! Unstructured grids in the XML format of VTK: `.vtu`, appended raw binary.
//!
//! Promises: the grid is checked before the first byte, the header and the data come from one
//! list of blocks, values are written bit for bit (also NaN), the bytes depend on the input only,
//! and no copy of the data is made. Little endian, `UInt64` block headers, `Float64` values.
//! The file has one `Piece`, since some readers keep the last one only; the parts that it is made of keep their own nodes
//! one after the other, and the cell array [`PART`] numbers them from 0.
//! Does not compress, merge nodes of different parts, or decide where fields are sampled.

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::PathBuf;

use super::atomic::Staged;
use super::grid::{Array, Piece, VtuError, check_cells};
use super::{OutputDir, OutputError, VtkCell};

/// Bytes converted at a time.
const CHUNK: usize = 8192;
/// The cell array that says which part of the grid a cell belongs to: their position in the list of pieces.
pub const PART: &str = "part";
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
    stage_outlined(dir, name, time, pieces).map(|(staged, _)| staged)
}

/// What the grids of all parts of a step have in common.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Outline {
    pub(super) n_pieces: usize,
    /// Name and components in the file of each array, in the order of the file.
    pub(super) point_data: Vec<(String, usize)>,
    /// The same of the arrays on cells, [`PART`] first.
    pub(super) cell_data: Vec<(String, usize)>,
}

/// [`stage_vtu`], with what the grid has.
pub(super) fn stage_outlined<'d>(
    dir: &'d OutputDir,
    name: &str,
    time: Option<f64>,
    pieces: &[Piece],
) -> Result<(Staged<'d>, Outline), OutputError> {
    let file = || dir.path().join(name);
    if let Some(time) = time.filter(|time| !time.is_finite()) {
        return Err(OutputError::Time { file: file(), time });
    }
    let grid = Grid::check(time, pieces).map_err(|source| OutputError::Vtu { file: file(), source })?;
    Ok((dir.stage(name, |out| grid.write(out))?, grid.outline()))
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
    /// What the parts of the grid give, one after the other.
    content: Vec<Content<'a>>,
}

enum Content<'a> {
    Time(f64),
    Points(&'a [[f64; 3]]),
    /// Node numbers, and how many nodes the parts before have.
    Nodes(&'a [u32], usize),
    /// Where cells end, and how many nodes the cells of the parts before name.
    Ends(&'a [usize], usize),
    Types(&'a [VtkCell]),
    Values {
        components: usize,
        values: &'a [f64],
    },
    /// NaN for so many numbers.
    Missing(usize),
    /// A number for each of so many cells.
    Constant(f64, usize),
}

impl<'a> Grid<'a> {
    fn check(time: Option<f64>, pieces: &'a [Piece]) -> Result<Self, VtuError> {
        if pieces.is_empty() {
            return Err(VtuError::NoPiece);
        }
        for (idx, piece) in pieces.iter().enumerate() {
            check_cells(idx, piece)?;
        }
        let point_channels = channels(pieces, |piece| (piece.points.len(), &piece.point_data))?;
        let cell_channels = channels(pieces, |piece| (piece.cells.len(), &piece.cell_data))?;
        if let Some(piece) = pieces.iter().position(|p| p.cell_data.iter().any(|a| a.name == PART)) {
            return Err(VtuError::DuplicateArray { piece, name: PART.to_owned() });
        }
        Ok(Grid { time, pieces, point_channels, cell_channels })
    }

    fn outline(&self) -> Outline {
        let of =
            |channels: &[Channel<'_>]| -> Vec<_> { channels.iter().map(|c| (c.name.to_owned(), c.width())).collect() };
        let cell_data = std::iter::once((PART.to_owned(), 1)).chain(of(&self.cell_channels)).collect();
        Outline { n_pieces: self.pieces.len(), point_data: of(&self.point_channels), cell_data }
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
        let sum = |count: fn(&Piece) -> usize| self.pieces.iter().map(count).sum::<usize>();
        let [n_points, n_cells] = [sum(|p| p.points.len()), sum(|p| p.cells.len())];
        header.text.push_str(&format!("<Piece NumberOfPoints=\"{n_points}\" NumberOfCells=\"{n_cells}\">\n"));
        header.section("Points", [self.points()]);
        header.section("Cells", self.cells());
        header.section("PointData", self.point_channels.iter().map(|c| self.values(c, |p| p.points.len())));
        let cells = self.cell_channels.iter().map(|c| self.values(c, |p| p.cells.len()));
        header.section("CellData", std::iter::once(self.parts()).chain(cells));
        header.text.push_str("</Piece>\n");
        let Header { mut text, blocks, .. } = header;
        text.push_str("</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_");
        out.write_all(text.as_bytes())?;
        for block in blocks {
            out.write_all(&block.n_bytes().to_le_bytes())?;
            block.write(out)?;
        }
        out.write_all(b"\n</AppendedData>\n</VTKFile>\n")
    }

    /// A block of one number or one triple an entry, part after part.
    fn block(&self, name: &'static str, width: usize, of: impl Fn(&'a Piece) -> Content<'a>) -> Block<'a> {
        Block { name, width, content: self.pieces.iter().map(of).collect() }
    }

    fn points(&self) -> Block<'a> {
        self.block("Points", 3, |piece| Content::Points(&piece.points))
    }

    fn cells(&self) -> [Block<'a>; 3] {
        // nodes of the parts before, and numbers in their lists of cells
        let (mut nodes, mut named) = (Vec::new(), Vec::new());
        let (mut n, mut m) = (0, 0);
        for piece in self.pieces {
            nodes.push(Content::Nodes(&piece.cells.nodes, n));
            named.push(Content::Ends(&piece.cells.ends, m));
            n += piece.points.len();
            m += piece.cells.nodes.len();
        }
        [
            Block { name: "connectivity", width: 1, content: nodes },
            Block { name: "offsets", width: 1, content: named },
            self.block("types", 1, |piece| Content::Types(&piece.cells.kinds)),
        ]
    }

    #[expect(clippy::cast_precision_loss, reason = "a grid has few parts")]
    fn parts(&self) -> Block<'a> {
        let of = |(number, piece): (usize, &Piece)| Content::Constant(number as f64, piece.cells.len());
        Block { name: PART, width: 1, content: self.pieces.iter().enumerate().map(of).collect() }
    }

    fn values(&self, channel: &Channel<'a>, n_entries: impl Fn(&Piece) -> usize) -> Block<'a> {
        let (components, width) = (channel.components, channel.width());
        let of = |(piece, values): (&Piece, &Option<&'a [f64]>)| match values {
            Some(values) => Content::Values { components, values },
            None => Content::Missing(n_entries(piece) * width),
        };
        Block { name: channel.name, width, content: self.pieces.iter().zip(&channel.values).map(of).collect() }
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
            block.word().0,
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
            Content::Nodes(..) | Content::Ends(..) => ("Int64", 8),
            Content::Types(_) => ("UInt8", 1),
            _ => ("Float64", 8),
        }
    }

    /// How many numbers it has in a block of so many components.
    fn n_numbers(&self, width: usize) -> usize {
        match self {
            Content::Time(_) => 1,
            Content::Points(points) => 3 * points.len(),
            Content::Nodes(nodes, _) => nodes.len(),
            Content::Ends(ends, _) => ends.len(),
            Content::Types(kinds) => kinds.len(),
            Content::Values { components, values } => values.len() / components * width,
            Content::Missing(n) | Content::Constant(_, n) => *n,
        }
    }

    fn write(&self, width: usize, out: &mut dyn Write) -> io::Result<()> {
        match *self {
            Content::Time(time) => out.write_all(&time.to_le_bytes()),
            Content::Points(points) => write_words(out, points.as_flattened().iter().map(|x| x.to_le_bytes())),
            // Numbers of things in memory are below 2^63, so the signed type of VTK has the same bytes.
            Content::Nodes(nodes, before) => {
                write_words(out, nodes.iter().map(|&node| (before as u64 + u64::from(node)).to_le_bytes()))
            }
            Content::Ends(ends, before) => {
                write_words(out, ends.iter().map(|&end| ((before + end) as u64).to_le_bytes()))
            }
            Content::Types(kinds) => write_words(out, kinds.iter().map(|kind| [kind.type_number()])),
            Content::Values { components, values } if components == width => {
                write_words(out, values.iter().map(|x| x.to_le_bytes()))
            }
            Content::Values { components, values } => {
                let entries = values.chunks_exact(components);
                write_words(out, entries.flat_map(|entry| pad(entry, width)).map(f64::to_le_bytes))
            }
            Content::Missing(n) => write_words(out, std::iter::repeat_n(f64::NAN.to_le_bytes(), n)),
            Content::Constant(number, n) => write_words(out, std::iter::repeat_n(number.to_le_bytes(), n)),
        }
    }
}

impl Block<'_> {
    /// Type of a number in the file and its bytes.
    fn word(&self) -> (&'static str, usize) {
        self.content.first().map_or(("Float64", 8), Content::word)
    }

    fn n_bytes(&self) -> u64 {
        let numbers: usize = self.content.iter().map(|c| c.n_numbers(self.width)).sum();
        (numbers * self.word().1) as u64
    }

    fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        self.content.iter().try_for_each(|c| c.write(self.width, out))
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
    Block { name: "TimeValue", width: 1, content: vec![Content::Time(time)] }
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
