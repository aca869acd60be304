//! All bodies of a grid together, with the nodes on edges and faces of their cells.

use std::path::Path;

use super::{Part, Values, cell, joined};
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
    /// Names of the arrays that the file has for cells: at the nodes stands the mean of the cells around each.
    pub(crate) of_cells: Vec<String>,
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
            for array in &grid.cell_data {
                let numbers = at_nodes(array, &grid.cells, part);
                add(&mut whole.point_data, &array.name, array.width, before, numbers);
                if !whole.of_cells.contains(&array.name) {
                    whole.of_cells.push(array.name.clone());
                }
            }
        }
    }
    // what lives on interfaces alone says nothing here
    whole.point_data.retain(|v| v.numbers.iter().any(|x| !x.is_nan()));
    Ok((whole, names))
}

/// Of numbers of cells the mean over those around each point of a part that have one; NaN elsewhere.
fn at_nodes(array: &Values, cells: &[Vec<usize>], part: &Part) -> Vec<f64> {
    let (width, first) = (array.width, part.points.start);
    let mut sums = vec![0.0; width * part.points.len()];
    let mut counts = vec![0.0; part.points.len()];
    for k in part.cells.clone() {
        let own = array.of(&(k..k + 1));
        if own.iter().any(|x| x.is_nan()) {
            continue;
        }
        for node in cells[k].iter().map(|n| n - first) {
            counts[node] += 1.0;
            sums[width * node..][..width].iter_mut().zip(own).for_each(|(sum, x)| *sum += x);
        }
    }
    // 0/0 is NaN where no cell says something
    sums.chunks_exact_mut(width.max(1)).zip(counts).for_each(|(entry, n)| entry.iter_mut().for_each(|x| *x /= n));
    sums
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
