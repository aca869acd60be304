//! All bodies of a grid together, with the nodes on edges and faces of their cells.

use std::path::Path;

use super::{Reader, Values, cell};
use crate::folder::{ReportError, bytes, damaged};

/// A cell with all its nodes, in the order of VTK.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct WholeCell {
    /// The number of `vtkCellType.h`.
    pub(crate) kind: u8,
    pub(crate) nodes: Vec<usize>,
}

/// The cells of one dimension in a file. Bodies share no nodes. A value is NaN where an array says nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Whole {
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) cells: Vec<WholeCell>,
    pub(crate) point_data: Vec<Values>,
}

impl WholeCell {
    /// Its corners.
    pub(crate) fn corners(&self) -> &[usize] {
        &self.nodes[..cell(self.kind).map_or(0, |c| c.1)]
    }
}

/// Reads the cells of this dimension of all pieces, and the names of all point and cell arrays of the file.
pub(crate) fn read_whole(file: &Path, dim: usize) -> Result<(Whole, Vec<String>), ReportError> {
    let all = bytes(file)?;
    let reader = Reader::new(file, &all)?;
    let (mut whole, mut names) = (Whole::default(), Vec::new());
    for tags in &reader.pieces {
        let types = reader.types(tags)?;
        for tag in tags.arrays.iter().filter(|a| matches!(a.section.as_str(), "PointData" | "CellData")) {
            if !names.contains(&tag.name) {
                names.push(tag.name.clone());
            }
        }
        if !types.iter().any(|t| cell(*t).is_some_and(|c| c.0 == dim)) {
            continue;
        }
        let wrong = || damaged(file, "its cells do not fit its points");
        let before = whole.points.len();
        let flat = reader.floats(tags, reader.find(tags, "Points")?)?;
        whole.points.extend(flat.chunks_exact(3).map(|p| [p[0], p[1], p[2]]));
        let ends = reader.integers(reader.find(tags, "offsets")?, tags.n_cells)?;
        let nodes = reader.integers(reader.find(tags, "connectivity")?, ends.last().copied().unwrap_or(0))?;
        let mut start = 0;
        for (kind, end) in types.iter().zip(ends) {
            let (found, corners) = cell(*kind).ok_or_else(wrong)?;
            let own = nodes.get(start..end).filter(|o| o.len() >= corners).ok_or_else(wrong)?;
            if own.iter().any(|n| *n >= tags.n_points) {
                return Err(wrong());
            }
            if found == dim {
                whole.cells.push(WholeCell { kind: *kind, nodes: own.iter().map(|n| n + before).collect() });
            }
            start = end;
        }
        for tag in tags.arrays.iter().filter(|a| a.section == "PointData") {
            add(&mut whole.point_data, &tag.name, tag.width, before, reader.floats(tags, tag)?);
        }
    }
    // what lives on interfaces alone says nothing here
    whole.point_data.retain(|v| v.numbers.iter().any(|x| !x.is_nan()));
    Ok((whole, names))
}

/// Appends the numbers of a piece whose points begin at `before`.
fn add(data: &mut Vec<Values>, name: &str, width: usize, before: usize, numbers: Vec<f64>) {
    match data.iter_mut().find(|v| v.name == name && v.width == width) {
        Some(known) => known.numbers.extend(numbers),
        None => {
            let mut all = vec![f64::NAN; before * width];
            all.extend(numbers);
            data.push(Values { name: name.to_owned(), width, numbers: all });
        }
    }
}
