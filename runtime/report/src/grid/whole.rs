//! All bodies of a grid together, with the nodes on edges and faces of their cells.

use std::path::Path;

use super::{Values, cell, joined};
use crate::folder::{ReportError, damaged};

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
    let wrong = || damaged(file, "its cells do not fit its points");
    let (mut whole, mut names) = (Whole::default(), Vec::new());
    for grid in joined::read(file)? {
        for array in grid.point_data.iter().chain(&grid.cell_data) {
            if !names.contains(&array.name) {
                names.push(array.name.clone());
            }
        }
        for part in grid.parts().iter().filter(|part| part.dim == dim) {
            let before = whole.points.len();
            whole.points.extend(&grid.points[part.points.clone()]);
            for k in part.cells.clone() {
                let (kind, nodes) = (grid.types[k], &grid.cells[k]);
                let (found, corners) = cell(kind).ok_or_else(wrong)?;
                if found != dim || nodes.len() < corners {
                    return Err(wrong());
                }
                let nodes = nodes.iter().map(|n| n - part.points.start + before).collect();
                whole.cells.push(WholeCell { kind, nodes });
            }
            for array in &grid.point_data {
                add(&mut whole.point_data, &array.name, array.width, before, array.of(&part.points).to_vec());
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
