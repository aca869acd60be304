//! Numbers to arrays: vectors are handed over, not copied, where they are one block already.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use wfl_output::{Cells, Piece, VtkCell};
use wfl_sparse::csr::Csr;

/// Positions as an array of `n` by `dim`.
pub(crate) fn points<'py>(py: Python<'py>, positions: &[[f64; 3]], dim: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = positions.iter().flat_map(|x| x[..dim].iter().copied()).collect();
    PyArray1::from_vec(py, flat).reshape([positions.len(), dim])
}

/// The rows of a compressed matrix: starts of the rows, columns, values, size.
pub(crate) fn csr<'py>(py: Python<'py>, matrix: &Csr) -> PyResult<Bound<'py, PyTuple>> {
    let (mut starts, mut columns) = (vec![0i64], Vec::with_capacity(matrix.values().len()));
    for row in 0..matrix.n_rows() {
        columns.extend(matrix.row(row).0.iter().map(|c| i64::from(*c)));
        starts.push(i64::try_from(columns.len()).unwrap_or(i64::MAX));
    }
    let values = PyArray1::from_vec(py, matrix.values().to_vec());
    let all = (values, PyArray1::from_vec(py, columns), PyArray1::from_vec(py, starts), matrix.n_rows());
    all.into_pyobject(py)
}

/// Cells by kind as `(name of meshio, number of VTK, nodes of each cell, positions of the cells)`.
pub(crate) fn cells<'py>(py: Python<'py>, cells: &Cells) -> PyResult<Bound<'py, PyList>> {
    let mut blocks: Vec<(VtkCell, Vec<i64>, Vec<i64>)> = Vec::new();
    for (k, (kind, nodes)) in cells.iter().enumerate() {
        let known = blocks.iter().position(|b| b.0 == kind).unwrap_or_else(|| {
            blocks.push((kind, Vec::new(), Vec::new()));
            blocks.len() - 1
        });
        blocks[known].1.extend(nodes.iter().map(|n| i64::from(*n)));
        blocks[known].2.push(i64::try_from(k).unwrap_or(i64::MAX));
    }
    let list = PyList::empty(py);
    for (kind, nodes, at) in blocks {
        let n = at.len();
        let nodes = PyArray1::from_vec(py, nodes).reshape([n, kind.n_nodes()])?;
        list.append((name(kind), kind.type_number(), nodes, PyArray1::from_vec(py, at)))?;
    }
    Ok(list)
}

/// The name that meshio has for a cell.
fn name(kind: VtkCell) -> &'static str {
    match kind {
        VtkCell::Vertex => "vertex",
        VtkCell::Line => "line",
        VtkCell::QuadraticLine => "line3",
        VtkCell::Triangle => "triangle",
        VtkCell::QuadraticTriangle => "triangle6",
        VtkCell::Quad => "quad",
        VtkCell::BiquadraticQuad => "quad9",
        VtkCell::Tetra => "tetra",
        VtkCell::QuadraticTetra => "tetra10",
        VtkCell::Hexahedron => "hexahedron",
        VtkCell::TriquadraticHexahedron => "hexahedron27",
        VtkCell::Wedge => "wedge",
        VtkCell::QuadraticWedge => "wedge18",
        VtkCell::Pyramid => "pyramid",
        VtkCell::QuadraticPyramid => "pyramid13",
    }
}

/// A piece of a grid as a dictionary: points, cells, point and cell data.
pub(crate) fn piece<'py>(py: Python<'py>, piece: &Piece) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    made.set_item("points", points(py, &piece.points, 3)?)?;
    made.set_item("cells", cells(py, &piece.cells)?)?;
    for (key, arrays) in [("point_data", &piece.point_data), ("cell_data", &piece.cell_data)] {
        let data = PyDict::new(py);
        for array in arrays {
            let values = PyArray1::from_vec(py, array.values.clone());
            if array.components == 1 {
                data.set_item(&array.name, values)?;
            } else {
                let n = array.values.len() / array.components;
                data.set_item(&array.name, values.reshape([n, array.components])?)?;
            }
        }
        made.set_item(key, data)?;
    }
    Ok(made)
}
