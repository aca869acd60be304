//! What the preconditioner is told of the unknowns, and the matrix seen as blocks of nodes.
//!
//! Promises: no finite elements here; points, components and weights are plain numbers. A component of a node that is
//! not solved for stays in its block as an equation `x = 0` of its own.

use wfl_host::team::Team;

use super::blocks::{Blocks, RowBuffer, Rows};
use super::operator::CoarserLevel;
use crate::csr::Csr;
use crate::index::NONE;
use crate::solve::SolveError;

/// Motions that hardly any energy belongs to, of which every coarser level must be capable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NearNullSpace {
    /// Constants of each component.
    Constants,
    /// Translations and rotations of a body in as many dimensions as a node has components (2 or 3).
    RigidBody,
}

/// The value of a node follows from those of others: `u = Σ weight u(node)` in the axes of the scene.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Interpolation {
    /// By node where its list begins, and the end of the last one.
    pub starts: Vec<usize>,
    /// A node of the coarser level and its weight. Nodes of that level are those of the lists; each stands in its own
    /// list alone, with weight 1.
    pub weights: Vec<(u32, f64)>,
}

/// The unknowns of a matrix, node by node.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeLayout {
    /// Unknowns of a node: 1, 2 or 3.
    pub components: usize,
    /// By row of the matrix: node times components plus component, increasing; [`NONE`] for a row that is not solved for.
    pub places: Vec<u32>,
    /// By node: its point (any unit of length).
    pub points: Vec<[f64; 3]>,
    /// What every level is capable of.
    pub modes: NearNullSpace,
    /// Nodes whose components are along axes of their own, increasing, with these axes: of components, orthonormal.
    pub frames: Vec<(u32, Vec<Vec<f64>>)>,
    /// The first coarser level where it is known: elements of degree 1 on the same cells.
    pub interpolation: Option<Interpolation>,
}

impl NodeLayout {
    /// Checks that the layout fits a matrix.
    ///
    /// # Errors
    /// [`SolveError::Shape`].
    pub(in crate::solve) fn check(&self, matrix: &Csr) -> Result<(), SolveError> {
        if matrix.n_cols() != matrix.n_rows() {
            let (expected, found) = (matrix.n_rows(), matrix.n_cols());
            return Err(SolveError::Shape { what: "columns of a square matrix", expected, found });
        }
        self.check_rows(matrix.n_rows())
    }

    /// Checks that the layout fits so many rows.
    ///
    /// # Errors
    /// [`SolveError::Shape`].
    pub(in crate::solve) fn check_rows(&self, n_rows: usize) -> Result<(), SolveError> {
        let shape = |what, expected, found| Err(SolveError::Shape { what, expected, found });
        if self.places.len() != n_rows {
            return shape("places of the rows of a matrix", n_rows, self.places.len());
        }
        if !(1..=3).contains(&self.components) {
            return shape("components of a node, at most", 3, self.components);
        }
        let used = self.places.iter().filter(|place| **place != NONE);
        let end = self.points.len() * self.components;
        if let Some(place) = used.clone().find(|place| **place as usize >= end) {
            return shape("places of nodes, below", end, *place as usize);
        }
        let is_increasing = used.clone().zip(used.skip(1)).all(|(a, b)| a < b);
        if is_increasing { Ok(()) } else { shape("increasing places of nodes", 1, 0) }
    }

    /// Number of vectors that span the near null space.
    #[must_use]
    pub fn n_modes(&self) -> usize {
        match (self.modes, self.components) {
            (NearNullSpace::RigidBody, 2) => 3,
            (NearNullSpace::RigidBody, 3) => 6,
            _ => self.components,
        }
    }

    /// By node a matrix of components by modes, row by row: its part of each mode, zero where it is not solved for.
    /// Points are taken from the centre and in units of the size of an extent ([`Self::extent`]), so that all modes have
    /// one size.
    #[must_use]
    pub fn mode_values(&self, extent: ([f64; 3], f64)) -> Vec<f64> {
        let (centre, size) = extent;
        let (b, k) = (self.components, self.n_modes());
        let mut values = vec![0.0; self.points.len() * b * k];
        for (point, mode) in self.points.iter().zip(values.chunks_exact_mut(b * k)) {
            let x = [0, 1, 2].map(|d| (point[d] - centre[d]) / size);
            (0..b).for_each(|c| mode[c * k + c] = 1.0);
            match k {
                3 if b == 2 => {
                    mode[2] = -x[1];
                    mode[k + 2] = x[0];
                }
                6 => {
                    (mode[k + 3], mode[2 * k + 3]) = (-x[2], x[1]);
                    (mode[4], mode[2 * k + 4]) = (x[2], -x[0]);
                    (mode[5], mode[k + 5]) = (-x[1], x[0]);
                }
                _ => {}
            }
        }
        for (node, axes) in &self.frames {
            let mode = &mut values[*node as usize * b * k..][..b * k];
            let turned: Vec<f64> =
                axes.iter().flat_map(|axis| (0..k).map(|m| (0..b).map(|c| axis[c] * mode[c * k + m]).sum())).collect();
            mode.copy_from_slice(&turned);
        }
        for (place, is_solved) in self.solved().iter().enumerate() {
            if !is_solved {
                values[place * k..][..k].fill(0.0);
            }
        }
        values
    }

    /// By place whether it is solved for.
    pub(super) fn solved(&self) -> Vec<bool> {
        let mut solved = vec![false; self.points.len() * self.components];
        self.places.iter().filter(|place| **place != NONE).for_each(|place| solved[*place as usize] = true);
        solved
    }

    /// Centre of the box around the points of all ranks and largest distance along an axis from it.
    #[must_use]
    pub fn extent(&self, team: &dyn Team) -> ([f64; 3], f64) {
        let ranges = [0, 1, 2].map(|d| {
            let along = self.points.iter().map(|p| p[d]);
            team.range(along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max))
        });
        let size = ranges.iter().fold(0.0, |size: f64, [low, high]| size.max(0.5 * (high - low)));
        (ranges.map(|[low, high]| 0.5 * (low + high)), if size > 0.0 { size } else { 1.0 })
    }
}

/// The power of two that brings a largest entry to about 1, so that numbers of single precision hold all.
#[must_use]
pub fn scale_of(largest: f64) -> f64 {
    if largest > 0.0 && largest.is_finite() { (-largest.log2().round()).exp2() } else { 1.0 }
}

/// A matrix of single entries, the sum of parts, seen as blocks of nodes and times a power of two.
pub(super) struct NodeRows<'a> {
    parts: &'a [&'a Csr],
    size: usize,
    /// By row of the matrix.
    places: &'a [u32],
    /// By place the row of the matrix, or [`NONE`].
    rows: Vec<u32>,
    /// Makes the largest entry about 1, so that numbers of single precision hold all.
    scale: f64,
}

impl<'a> NodeRows<'a> {
    pub(super) fn new(parts: &'a [&'a Csr], layout: &'a NodeLayout) -> Self {
        let mut rows = vec![NONE; layout.points.len() * layout.components];
        for (row, place) in layout.places.iter().enumerate().filter(|(_, place)| **place != NONE) {
            rows[*place as usize] = row as u32;
        }
        let largest = parts.iter().fold(0.0, |largest: f64, part| largest.max(part.max_abs()));
        Self { parts, size: layout.components, places: &layout.places, rows, scale: scale_of(largest) }
    }

    /// Times a given number.
    pub(super) fn scaled(parts: &'a [&'a Csr], layout: &'a NodeLayout, scale: f64) -> Self {
        Self { scale, ..Self::new(parts, layout) }
    }

    /// The blocks of rows with entries alone; unknowns that are not solved for have none. A row has a block on the diagonal.
    pub(super) fn entries(&self) -> Blocks<f64> {
        let (size, area) = (self.size, self.size * self.size);
        let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        let mut buffer = RowBuffer::default();
        for (node, rows) in self.rows.chunks_exact(size).enumerate() {
            let has_entries = |row: &u32| self.parts.iter().any(|part| !part.row(*row as usize).0.is_empty());
            if rows.iter().filter(|row| **row != NONE).any(has_entries) {
                let (of_row, blocks) = self.row(node, &mut buffer);
                let own = columns.len() + of_row.partition_point(|column| (*column as usize) < node);
                columns.extend_from_slice(of_row);
                values.extend_from_slice(blocks);
                for component in (0..size).filter(|component| rows[*component] == NONE) {
                    values[own * area + component * size + component] = 0.0;
                }
            }
            starts.push(columns.len());
        }
        Blocks { shape: [size, size], n_cols: self.n_nodes(), starts, columns, values }
    }

    /// Of nodes with so many components, with places by row, times a given number.
    pub(super) fn of_coarser(parts: &'a [&'a Csr], coarser: &'a CoarserLevel, size: usize, scale: f64) -> Self {
        let mut rows = vec![NONE; coarser.n_nodes * size];
        (0..).zip(&coarser.places).for_each(|(row, place)| rows[*place as usize] = row);
        Self { parts, size, places: &coarser.places, rows, scale }
    }

    /// What entries are multiplied by.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// Columns of blocks of a node.
    fn columns(&self, node: usize, columns: &mut Vec<u32>) {
        columns.clear();
        let rows = self.rows[node * self.size..][..self.size].iter().filter(|row| **row != NONE);
        // nearly all columns come with the first row
        for (row, part) in rows.flat_map(|row| self.parts.iter().map(move |part| (*row as usize, part))) {
            let is_first = columns.is_empty();
            let mut at = 0;
            for column in part.row(row).0 {
                let place = self.places[*column as usize];
                if place == NONE {
                    continue;
                }
                let other = place / self.size as u32;
                if is_first {
                    if columns.last() != Some(&other) {
                        columns.push(other);
                    }
                    continue;
                }
                while at < columns.len() && columns[at] < other {
                    at += 1;
                }
                if columns.get(at) != Some(&other) {
                    columns.insert(at, other);
                }
            }
        }
        if let Err(at) = columns.binary_search(&(node as u32)) {
            columns.insert(at, node as u32);
        }
    }

    /// The rows of a node where they couple whole nodes alike, as they do but where values are prescribed: then entries lie as those
    /// of blocks do, and the columns of blocks are told here.
    fn aligned(&self, node: usize, columns: &mut Vec<u32>) -> Option<&[u32]> {
        let size = self.size;
        let rows = &self.rows[node * size..][..size];
        let [part] = self.parts else { return None };
        let (first, others) = rows.split_first()?;
        if rows.contains(&NONE) {
            return None;
        }
        let own = part.row(*first as usize).0;
        if others.iter().any(|row| part.row(*row as usize).0 != own) || own.len() % size != 0 {
            return None;
        }
        columns.clear();
        let mut has_own = false;
        for group in own.chunks_exact(size) {
            let begin = self.places[group[0] as usize];
            let other = begin / size as u32;
            let is_whole =
                group.iter().map(|column| self.places[*column as usize]).eq(begin..begin.saturating_add(size as u32));
            if begin == NONE || !begin.is_multiple_of(size as u32) || !is_whole {
                return None;
            }
            has_own |= other as usize == node;
            columns.push(other);
        }
        has_own.then_some(rows)
    }
}

impl Rows for NodeRows<'_> {
    fn size(&self) -> usize {
        self.size
    }

    fn n_nodes(&self) -> usize {
        self.rows.len() / self.size
    }

    fn row<'a>(&'a self, node: usize, buffer: &'a mut RowBuffer) -> (&'a [u32], &'a [f64]) {
        let size = self.size;
        if let Some(rows) = self.aligned(node, &mut buffer.columns) {
            buffer.values.resize(buffer.columns.len() * size * size, 0.0);
            for (component, row) in rows.iter().enumerate() {
                let values = self.parts[0].row(*row as usize).1.chunks_exact(size);
                for (block, values) in buffer.values.chunks_exact_mut(size * size).zip(values) {
                    let out = &mut block[component * size..][..size];
                    out.iter_mut().zip(values).for_each(|(out, value)| *out = self.scale * value);
                }
            }
            return (&buffer.columns, &buffer.values);
        }
        self.columns(node, &mut buffer.columns);
        buffer.values.clear();
        buffer.values.resize(buffer.columns.len() * size * size, 0.0);
        for component in 0..size {
            let row = self.rows[node * size + component];
            if row == NONE {
                let own = buffer.columns.binary_search(&(node as u32)).expect("a node has a block of its own");
                buffer.values[(own * size + component) * size + component] = 1.0;
                continue;
            }
            for part in self.parts {
                let mut at = 0;
                let (columns, values) = part.row(row as usize);
                for (column, value) in columns.iter().zip(values) {
                    let place = self.places[*column as usize];
                    if place == NONE {
                        continue;
                    }
                    let other = place / size as u32;
                    while buffer.columns[at] < other {
                        at += 1;
                    }
                    let along = place as usize - other as usize * size;
                    buffer.values[(at * size + component) * size + along] += self.scale * value;
                }
            }
        }
        (&buffer.columns, &buffer.values)
    }
}
