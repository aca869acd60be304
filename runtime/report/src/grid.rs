//! Grids as the runtime writes them: VTK XML, one line a tag, data appended raw, little endian, `UInt64` sizes, the bodies
//! and faces one after the other and told apart by the cell array [`PART`].
//!
//! Promises: offsets and sizes are checked, so a file that was cut off is an error and never half a picture.
//! Reads no other dialect of the format.

mod whole;

use std::{ops::Range, path::Path};

use wfl_runtime::output::PART;

use crate::folder::{ReportError, bytes, damaged};

pub(crate) use whole::{Whole, WholeCell, read_whole};

/// Nodal or cell values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Values {
    pub(crate) name: String,
    /// Numbers of one entry.
    pub(crate) width: usize,
    pub(crate) numbers: Vec<f64>,
}

/// The cells of one body or interface.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Piece {
    pub(crate) points: Vec<[f64; 3]>,
    /// Corners of each cell, around it.
    pub(crate) cells: Vec<Vec<usize>>,
    /// Dimension of its cells.
    pub(crate) dim: usize,
    pub(crate) point_data: Vec<Values>,
    pub(crate) cell_data: Vec<Values>,
}

/// Reads the parts whose cells have this dimension. Point data that another part with larger cells has, too, belongs to
/// the bodies and is left out, as is what the part itself lacks.
pub(crate) fn read_pieces(file: &Path, dim: usize) -> Result<Vec<Piece>, ReportError> {
    let all = bytes(file)?;
    let reader = Reader::new(file, &all)?;
    let mut pieces = Vec::new();
    for tags in &reader.pieces {
        let parts = reader.parts(tags)?;
        for part in parts.iter().filter(|p| p.dim == dim) {
            let mut piece = reader.piece(tags, part)?;
            for array in tags.arrays.iter().filter(|a| a.section == "PointData") {
                let numbers = reader.floats(tags, array)?;
                let has = |p: &Part| entries(&numbers, array.width, &p.points).iter().any(|x| !x.is_nan());
                if parts.iter().any(|p| p.dim > dim && has(p)) {
                    piece.point_data.retain(|v| v.name != array.name);
                }
            }
            pieces.push(piece);
        }
    }
    Ok(pieces)
}

/// The numbers of some of the entries of an array.
fn entries<'n>(numbers: &'n [f64], width: usize, which: &Range<usize>) -> &'n [f64] {
    &numbers[width * which.start..width * which.end]
}

/// Dimension and number of corners of a cell type (`vtkCellType.h`).
fn cell(kind: u8) -> Option<(usize, usize)> {
    Some(match kind {
        1 => (0, 1),
        3 | 21 => (1, 2),
        5 | 22 => (2, 3),
        9 | 28 => (2, 4),
        10 | 24 => (3, 4),
        12 | 29 => (3, 8),
        _ => return None,
    })
}

/// A `DataArray`.
struct Tag {
    section: String,
    name: String,
    width: usize,
    offset: usize,
}

struct PieceTags {
    n_points: usize,
    n_cells: usize,
    arrays: Vec<Tag>,
}

/// The cells and points of a body or interface among those of a piece.
struct Part {
    dim: usize,
    cells: Range<usize>,
    points: Range<usize>,
}

struct Reader<'a> {
    file: &'a Path,
    data: &'a [u8],
    pieces: Vec<PieceTags>,
}

impl<'a> Reader<'a> {
    fn new(file: &'a Path, all: &'a [u8]) -> Result<Self, ReportError> {
        let mark = b"<AppendedData encoding=\"raw\">\n_";
        let wrong = |what: &str| damaged(file, what);
        let at = all.windows(mark.len()).position(|w| w == mark).ok_or_else(|| wrong("it has no data"))?;
        let header = std::str::from_utf8(&all[..at]).map_err(|_| wrong("its header is not UTF-8"))?;
        let (mut pieces, mut section): (Vec<PieceTags>, _) = (Vec::new(), String::new());
        for line in header.lines() {
            let word = line.trim_start_matches('<').split([' ', '>']).next().unwrap_or_default();
            match word {
                "Piece" => {
                    let count = |key| number(line, key).ok_or_else(|| wrong("a piece has no size"));
                    let [n_points, n_cells] = [count("NumberOfPoints")?, count("NumberOfCells")?];
                    pieces.push(PieceTags { n_points, n_cells, arrays: Vec::new() });
                }
                "DataArray" => {
                    let Some(piece) = pieces.last_mut() else { continue };
                    let tag = tag(line, &section).ok_or_else(|| wrong("an array has no name, width or offset"))?;
                    piece.arrays.push(tag);
                }
                other if line.starts_with('<') && !other.starts_with('/') => other.clone_into(&mut section),
                _ => {}
            }
        }
        Ok(Reader { file, data: &all[at + mark.len()..], pieces })
    }

    /// The bytes of an array of `n` entries of `size` bytes.
    fn block(&self, tag: &Tag, n: usize, size: usize) -> Result<&'a [u8], ReportError> {
        let bytes = || {
            let start = tag.offset.checked_add(8)?;
            let stored: [u8; 8] = self.data.get(tag.offset..start)?.try_into().ok()?;
            let length = n.checked_mul(tag.width)?.checked_mul(size)?;
            (u64::from_le_bytes(stored) == length as u64).then_some(())?;
            self.data.get(start..start.checked_add(length)?)
        };
        bytes().ok_or_else(|| damaged(self.file, format!("the array `{}` is cut off", tag.name)))
    }

    fn find<'p>(&self, piece: &'p PieceTags, name: &str) -> Result<&'p Tag, ReportError> {
        let found = piece.arrays.iter().find(|a| a.name == name && matches!(a.section.as_str(), "Cells" | "Points"));
        found.ok_or_else(|| damaged(self.file, format!("a piece has no `{name}`")))
    }

    fn types(&self, piece: &PieceTags) -> Result<Vec<u8>, ReportError> {
        Ok(self.block(self.find(piece, "types")?, piece.n_cells, 1)?.to_vec())
    }

    fn floats(&self, piece: &PieceTags, tag: &Tag) -> Result<Vec<f64>, ReportError> {
        let n = if tag.section == "CellData" { piece.n_cells } else { piece.n_points };
        let words = self.block(tag, n, 8)?.chunks_exact(8);
        Ok(words.filter_map(|w| w.try_into().ok()).map(f64::from_le_bytes).collect())
    }

    fn integers(&self, tag: &Tag, n: usize) -> Result<Vec<usize>, ReportError> {
        let words = self.block(tag, n, 8)?.chunks_exact(8).filter_map(|w| w.try_into().ok());
        let read = |w| usize::try_from(i64::from_le_bytes(w)).map_err(|_| damaged(self.file, "a negative index"));
        words.map(read).collect()
    }

    /// The nodes of each cell.
    fn cells(&self, tags: &PieceTags) -> Result<Vec<Vec<usize>>, ReportError> {
        let wrong = || damaged(self.file, "its cells do not fit its points");
        let ends = self.integers(self.find(tags, "offsets")?, tags.n_cells)?;
        let nodes = self.integers(self.find(tags, "connectivity")?, ends.last().copied().unwrap_or(0))?;
        let mut start = 0;
        let one = |end: usize| {
            let own = nodes.get(start..end).filter(|c| c.iter().all(|n| *n < tags.n_points)).ok_or_else(wrong)?;
            start = end;
            Ok(own.to_vec())
        };
        ends.into_iter().map(one).collect()
    }

    /// The parts of a piece, in their order.
    fn parts(&self, tags: &PieceTags) -> Result<Vec<Part>, ReportError> {
        let (types, cells) = (self.types(tags)?, self.cells(tags)?);
        let tag = tags.arrays.iter().find(|a| a.section == "CellData" && a.name == PART);
        let numbers = self.floats(tags, tag.ok_or_else(|| damaged(self.file, format!("it has no `{PART}`")))?)?;
        let (mut parts, mut first) = (Vec::new(), 0);
        for own in numbers.chunk_by(|a, b| a == b) {
            let range = first..first + own.len();
            first = range.end;
            let nodes = || cells[range.clone()].iter().flatten().copied();
            let points = nodes().min().unwrap_or(0)..nodes().max().map_or(0, |n| n + 1);
            let dim = cell(types[range.start]).map_or(0, |c| c.0);
            parts.push(Part { dim, cells: range, points });
        }
        Ok(parts)
    }

    fn piece(&self, tags: &PieceTags, part: &Part) -> Result<Piece, ReportError> {
        let wrong = || damaged(self.file, "its cells do not fit its points");
        let flat = self.floats(tags, self.find(tags, "Points")?)?;
        let points = entries(&flat, 3, &part.points).chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        let (types, all) = (self.types(tags)?, self.cells(tags)?);
        let mut cells = Vec::with_capacity(part.cells.len());
        for k in part.cells.clone() {
            let corners = cell(types[k]).filter(|c| c.0 == part.dim).ok_or_else(wrong)?.1;
            let corners = all[k].get(..corners).ok_or_else(wrong)?;
            cells.push(corners.iter().map(|n| n - part.points.start).collect());
        }
        let mut piece = Piece { points, cells, dim: part.dim, ..Piece::default() };
        for tag in &tags.arrays {
            let (list, own) = match tag.section.as_str() {
                "PointData" => (&mut piece.point_data, &part.points),
                "CellData" if tag.name != PART => (&mut piece.cell_data, &part.cells),
                _ => continue,
            };
            let numbers = entries(&self.floats(tags, tag)?, tag.width, own).to_vec();
            if numbers.iter().any(|x| !x.is_nan()) {
                list.push(Values { name: tag.name.clone(), width: tag.width, numbers });
            }
        }
        Ok(piece)
    }
}

fn attribute<'l>(line: &'l str, key: &str) -> Option<&'l str> {
    let (_, rest) = line.split_once(&format!(" {key}=\""))?;
    Some(rest.split_once('"')?.0)
}

fn number(line: &str, key: &str) -> Option<usize> {
    attribute(line, key)?.parse().ok()
}

fn tag(line: &str, section: &str) -> Option<Tag> {
    let plain = |name: &str| {
        let name = name.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"");
        name.replace("&apos;", "'").replace("&amp;", "&")
    };
    Some(Tag {
        section: section.to_owned(),
        name: plain(attribute(line, "Name")?),
        width: number(line, "NumberOfComponents")?,
        offset: number(line, "offset")?,
    })
}
