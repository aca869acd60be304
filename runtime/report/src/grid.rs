//! Grids as the runtime writes them: VTK XML, one line a tag, data appended raw, little endian, `UInt64` sizes, the bodies
//! and faces one after the other and told apart by the cell array [`PART`].
//!
//! Grids in parts, one a rank, are read and joined ([`joined`]): they then are as the whole grid.
//!
//! Promises: offsets and sizes are checked, so a file that was cut off is an error and never half a picture.
//! Reads no other dialect of the format.

mod joined;
mod whole;

use std::{ops::Range, path::Path};

use wfl_output::PART;

use crate::folder::{ReportError, damaged};

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
    let mut pieces = Vec::new();
    for grid in joined::read(file)? {
        let parts = grid.parts();
        for part in parts.iter().filter(|p| p.dim == dim) {
            let mut piece = grid.piece(file, part)?;
            for array in &grid.point_data {
                let has = |p: &Part| array.of(&p.points).iter().any(|x| !x.is_nan());
                if parts.iter().any(|p| p.dim > dim && has(p)) {
                    piece.point_data.retain(|v| v.name != array.name);
                }
            }
            pieces.push(piece);
        }
    }
    Ok(pieces)
}

impl Values {
    /// The same array without entries.
    fn empty(&self) -> Self {
        Values { name: self.name.clone(), width: self.width, numbers: Vec::new() }
    }

    /// The numbers of some of the entries.
    fn of(&self, which: &Range<usize>) -> &[f64] {
        &self.numbers[self.width * which.start..self.width * which.end]
    }
}

/// A grid as it stands in a file: bodies and faces one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
struct Raw {
    points: Vec<[f64; 3]>,
    /// The nodes of each cell, in the order of VTK.
    cells: Vec<Vec<usize>>,
    /// Their numbers in `vtkCellType.h`.
    types: Vec<u8>,
    /// The number of the body or interface of each cell.
    part: Vec<f64>,
    point_data: Vec<Values>,
    /// Without `part`.
    cell_data: Vec<Values>,
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
        13 | 32 => (3, 6),
        14 | 27 => (3, 5),
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

    /// A piece of the file.
    fn raw(&self, tags: &PieceTags) -> Result<Raw, ReportError> {
        let flat = self.floats(tags, self.find(tags, "Points")?)?;
        let tag = tags.arrays.iter().find(|a| a.section == "CellData" && a.name == PART);
        let mut raw = Raw {
            points: flat.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect(),
            cells: self.cells(tags)?,
            types: self.types(tags)?,
            part: self.floats(tags, tag.ok_or_else(|| damaged(self.file, format!("it has no `{PART}`")))?)?,
            ..Raw::default()
        };
        for tag in &tags.arrays {
            let list = match tag.section.as_str() {
                "PointData" => &mut raw.point_data,
                "CellData" if tag.name != PART => &mut raw.cell_data,
                _ => continue,
            };
            list.push(Values { name: tag.name.clone(), width: tag.width, numbers: self.floats(tags, tag)? });
        }
        Ok(raw)
    }
}

impl Raw {
    /// The bodies and faces, in their order.
    fn parts(&self) -> Vec<Part> {
        let (mut parts, mut first) = (Vec::new(), 0);
        for own in self.part.chunk_by(|a, b| a == b) {
            let range = first..first + own.len();
            first = range.end;
            let nodes = || self.cells[range.clone()].iter().flatten().copied();
            let points = nodes().min().unwrap_or(0)..nodes().max().map_or(0, |n| n + 1);
            let dim = cell(self.types[range.start]).map_or(0, |c| c.0);
            parts.push(Part { dim, cells: range, points });
        }
        parts
    }

    fn piece(&self, file: &Path, part: &Part) -> Result<Piece, ReportError> {
        let wrong = || damaged(file, "its cells do not fit its points");
        let mut cells = Vec::with_capacity(part.cells.len());
        for k in part.cells.clone() {
            let corners = cell(self.types[k]).filter(|c| c.0 == part.dim).ok_or_else(wrong)?.1;
            let corners = self.cells[k].get(..corners).ok_or_else(wrong)?;
            cells.push(corners.iter().map(|n| n - part.points.start).collect());
        }
        let own = |data: &[Values], which: &Range<usize>| {
            let cut = data.iter().map(|v| Values { numbers: v.of(which).to_vec(), ..v.empty() });
            cut.filter(|v| v.numbers.iter().any(|x| !x.is_nan())).collect()
        };
        Ok(Piece {
            points: self.points[part.points.clone()].to_vec(),
            cells,
            dim: part.dim,
            point_data: own(&self.point_data, &part.points),
            cell_data: own(&self.cell_data, &part.cells),
        })
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
