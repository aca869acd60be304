//! All bodies of a grid together, with the nodes on edges and faces of their cells.

use std::path::Path;

use wfl_runtime::output::PART;

use super::{Reader, Tag, Values, cell, entries};
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

/// Reads the cells of this dimension of all parts, and the names of all point and cell arrays of the file.
pub(crate) fn read_whole(file: &Path, dim: usize) -> Result<(Whole, Vec<String>), ReportError> {
    let all = bytes(file)?;
    let reader = Reader::new(file, &all)?;
    let wrong = || damaged(file, "its cells do not fit its points");
    let (mut whole, mut names) = (Whole::default(), Vec::new());
    for tags in &reader.pieces {
        let own = |a: &&Tag| matches!(a.section.as_str(), "PointData" | "CellData") && a.name != PART;
        for tag in tags.arrays.iter().filter(own) {
            if !names.contains(&tag.name) {
                names.push(tag.name.clone());
            }
        }
        let (types, nodes) = (reader.types(tags)?, reader.cells(tags)?);
        let flat = reader.floats(tags, reader.find(tags, "Points")?)?;
        for part in reader.parts(tags)?.iter().filter(|part| part.dim == dim) {
            let before = whole.points.len();
            whole.points.extend(entries(&flat, 3, &part.points).chunks_exact(3).map(|p| [p[0], p[1], p[2]]));
            for k in part.cells.clone() {
                let (found, corners) = cell(types[k]).ok_or_else(wrong)?;
                if found != dim || nodes[k].len() < corners {
                    return Err(wrong());
                }
                let nodes = nodes[k].iter().map(|n| n - part.points.start + before).collect();
                whole.cells.push(WholeCell { kind: types[k], nodes });
            }
            for tag in tags.arrays.iter().filter(|a| a.section == "PointData") {
                let numbers = entries(&reader.floats(tags, tag)?, tag.width, &part.points).to_vec();
                add(&mut whole.point_data, &tag.name, tag.width, before, numbers);
            }
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
