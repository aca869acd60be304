//! The structure of a sparse matrix: which entries exist, row by row.
//!
//! Promises: columns of a row are strictly increasing, every index is inside the shape, and equal input gives equal
//! bytes (no hashing). A pattern is shared by `Arc` between all matrices that carry values on it.
//! Does not hold values and does not number degrees of freedom.

use std::sync::Arc;

use super::error::CsrError;
use wfl_host::memory::grow;

/// Structure of a sparse matrix in compressed row form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern {
    n_rows: usize,
    n_cols: usize,
    row_starts: Vec<usize>,
    columns: Vec<u32>,
}

impl Pattern {
    /// Takes the arrays of a compressed row structure. `row_starts` has `n_rows + 1` entries.
    ///
    /// # Errors
    /// [`CsrError::Structure`] when the starts do not describe the columns, a column lies outside the shape, or the
    /// columns of a row are not strictly increasing; [`CsrError::TooLarge`] when an index does not fit 32 bits.
    pub fn new(n_rows: usize, n_cols: usize, row_starts: Vec<usize>, columns: Vec<u32>) -> Result<Self, CsrError> {
        if n_rows.max(n_cols) > u32::MAX as usize {
            return Err(CsrError::TooLarge { size: n_rows.max(n_cols) });
        }
        if row_starts.len() != n_rows + 1 || row_starts[0] != 0 || row_starts[n_rows] != columns.len() {
            return Err(CsrError::Structure { row: 0, what: "row starts do not span the columns" });
        }
        for row in 0..n_rows {
            if row_starts[row] > row_starts[row + 1] || row_starts[row + 1] > columns.len() {
                return Err(CsrError::Structure { row, what: "row starts decrease" });
            }
            let entries = &columns[row_starts[row]..row_starts[row + 1]];
            if entries.windows(2).any(|pair| pair[0] >= pair[1]) {
                return Err(CsrError::Structure { row, what: "columns are not strictly increasing" });
            }
            if entries.last().is_some_and(|&column| column as usize >= n_cols) {
                return Err(CsrError::Structure { row, what: "column outside the matrix" });
            }
        }
        Ok(Self { n_rows, n_cols, row_starts, columns })
    }

    /// The pattern without entries.
    pub fn empty(n_rows: usize, n_cols: usize) -> Self {
        Self { n_rows, n_cols, row_starts: vec![0; n_rows + 1], columns: Vec::new() }
    }

    /// Number of rows.
    #[inline]
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// Number of columns.
    #[inline]
    pub fn n_cols(&self) -> usize {
        self.n_cols
    }

    /// Number of stored entries.
    #[inline]
    pub fn n_entries(&self) -> usize {
        self.columns.len()
    }

    /// Start of each row in [`Pattern::columns`]; `n_rows + 1` entries.
    #[inline]
    pub fn row_starts(&self) -> &[usize] {
        &self.row_starts
    }

    /// Column of every entry, row after row.
    #[inline]
    pub fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// Columns of one row, increasing.
    #[inline]
    pub fn row(&self, row: usize) -> &[u32] {
        &self.columns[self.row_starts[row]..self.row_starts[row + 1]]
    }

    /// Place of entry (row, column) in the value array, if it is stored.
    #[inline]
    pub fn position(&self, row: usize, column: usize) -> Option<usize> {
        let wanted = u32::try_from(column).ok()?;
        let offset = self.row(row).binary_search(&wanted).ok()?;
        Some(self.row_starts[row] + offset)
    }

    /// The transposed pattern, and for each of its entries the place of that entry here.
    pub fn transpose(&self) -> (Pattern, Vec<usize>) {
        let mut row_starts = vec![0usize; self.n_cols + 1];
        for &column in &self.columns {
            row_starts[column as usize + 1] += 1;
        }
        for i in 0..self.n_cols {
            row_starts[i + 1] += row_starts[i];
        }
        let mut next = row_starts.clone();
        let mut columns = vec![0u32; self.columns.len()];
        let mut sources = vec![0usize; self.columns.len()];
        for row in 0..self.n_rows {
            for source in self.row_starts[row]..self.row_starts[row + 1] {
                let target = &mut next[self.columns[source] as usize];
                columns[*target] = row as u32;
                sources[*target] = source;
                *target += 1;
            }
        }
        (Pattern { n_rows: self.n_cols, n_cols: self.n_rows, row_starts, columns }, sources)
    }

    /// Whether (i, j) is stored exactly when (j, i) is.
    pub fn is_symmetric(&self) -> bool {
        if self.n_rows != self.n_cols {
            return false;
        }
        // rows come in order, and so do the mirror images in each row: the next one is the one that is looked for
        let mut next = self.row_starts[..self.n_rows].to_vec();
        (0..self.n_rows).all(|row| {
            self.row(row).iter().all(|column| {
                let place = &mut next[*column as usize];
                *place += 1;
                *place <= self.row_starts[*column as usize + 1] && self.columns[*place - 1] as usize == row
            })
        })
    }

    /// The pattern with the entries of both.
    ///
    /// # Errors
    /// [`CsrError::Shape`] when the shapes differ.
    pub fn union(&self, other: &Pattern) -> Result<Pattern, CsrError> {
        if (self.n_rows, self.n_cols) != (other.n_rows, other.n_cols) {
            return Err(CsrError::Shape {
                what: "union of patterns",
                expected: (self.n_rows, self.n_cols),
                found: (other.n_rows, other.n_cols),
            });
        }
        let mut row_starts = Vec::with_capacity(self.n_rows + 1);
        row_starts.push(0);
        let mut columns = Vec::with_capacity(self.columns.len() + other.columns.len());
        for row in 0..self.n_rows {
            merge_sorted(self.row(row), other.row(row), &mut columns);
            row_starts.push(columns.len());
        }
        columns.shrink_to_fit();
        Ok(Pattern { n_rows: self.n_rows, n_cols: self.n_cols, row_starts, columns })
    }

    /// The pattern with its mirrored entries: what elimination with pivots on the diagonal fills.
    ///
    /// # Errors
    /// [`CsrError::Shape`] unless square.
    pub fn mirrored(&self) -> Result<Pattern, CsrError> {
        if self.is_symmetric() { Ok(self.clone()) } else { self.union(&self.transpose().0) }
    }

    /// For each entry here its place in `wider`, or `None` when `wider` lacks one of them.
    pub fn positions_in(&self, wider: &Pattern) -> Option<Vec<usize>> {
        if (self.n_rows, self.n_cols) != (wider.n_rows, wider.n_cols) {
            return None;
        }
        let mut places = Vec::with_capacity(self.columns.len());
        for row in 0..self.n_rows {
            let mut place = wider.row_starts[row];
            let end = wider.row_starts[row + 1];
            for &column in self.row(row) {
                while place < end && wider.columns[place] < column {
                    place += 1;
                }
                if place == end || wider.columns[place] != column {
                    return None;
                }
                places.push(place);
            }
        }
        Some(places)
    }
}

/// Appends the union of two increasing lists.
fn merge_sorted(mut first: &[u32], mut second: &[u32], out: &mut Vec<u32>) {
    while let (Some(&a), Some(&b)) = (first.first(), second.first()) {
        out.push(a.min(b));
        if a <= b {
            first = &first[1..];
        }
        if b <= a {
            second = &second[1..];
        }
    }
    out.extend_from_slice(first);
    out.extend_from_slice(second);
}

/// Collects the entries that elements couple and makes the pattern of their sum.
///
/// Each element couples every one of its row dofs with every one of its column dofs. The order of the elements does
/// not change the result.
#[derive(Debug, Clone)]
pub struct PatternBuilder {
    n_rows: usize,
    n_cols: usize,
    row_dofs: Vec<u32>,
    row_dof_starts: Vec<usize>,
    column_dofs: Vec<u32>,
    column_dof_starts: Vec<usize>,
}

impl PatternBuilder {
    /// An empty pattern of this shape.
    pub fn new(n_rows: usize, n_cols: usize) -> Self {
        Self {
            n_rows,
            n_cols,
            row_dofs: Vec::new(),
            row_dof_starts: vec![0],
            column_dofs: Vec::new(),
            column_dof_starts: vec![0],
        }
    }

    /// Couples all dofs of a list with each other.
    pub fn add_element(&mut self, dofs: &[u32]) {
        self.add_coupling(dofs, dofs);
    }

    /// Couples every row dof with every column dof. Dofs may repeat.
    pub fn add_coupling(&mut self, rows: &[u32], columns: &[u32]) {
        self.row_dofs.extend_from_slice(rows);
        self.row_dof_starts.push(self.row_dofs.len());
        self.column_dofs.extend_from_slice(columns);
        self.column_dof_starts.push(self.column_dofs.len());
    }

    /// Adds the diagonal, so that every row has an entry.
    pub fn add_diagonal(&mut self) {
        for dof in 0..self.n_rows.min(self.n_cols) as u32 {
            self.add_coupling(&[dof], &[dof]);
        }
    }

    /// The pattern of the sum of all elements.
    ///
    /// # Errors
    /// [`CsrError::Structure`] when a dof lies outside the shape, [`CsrError::TooLarge`] beyond 32-bit indices.
    pub fn build(&self) -> Result<Pattern, CsrError> {
        self.check()?;
        let (element_starts, elements) = self.elements_of_rows();
        let mut row_starts = Vec::with_capacity(self.n_rows + 1);
        row_starts.push(0usize);
        let mut columns: Vec<u32> = Vec::new();
        let mut last_seen = vec![u32::MAX; self.n_cols];
        for row in 0..self.n_rows {
            let here = &elements[element_starts[row]..element_starts[row + 1]];
            let begin = columns.len();
            let columns_of = |element: &u32| {
                let element = *element as usize;
                self.column_dof_starts[element + 1] - self.column_dof_starts[element]
            };
            grow(&mut columns, here.iter().map(columns_of).sum(), "the pattern of the matrix")?;
            // The dofs of one node meet the same elements: copy the row before instead of sorting again.
            if row > 0 && here == &elements[element_starts[row - 1]..element_starts[row]] {
                columns.extend_from_within(row_starts[row - 1]..begin);
            } else {
                for &element in here {
                    let element = element as usize;
                    for &column in
                        &self.column_dofs[self.column_dof_starts[element]..self.column_dof_starts[element + 1]]
                    {
                        if last_seen[column as usize] != row as u32 {
                            last_seen[column as usize] = row as u32;
                            columns.push(column);
                        }
                    }
                }
                columns[begin..].sort_unstable();
            }
            row_starts.push(columns.len());
        }
        columns.shrink_to_fit();
        Ok(Pattern { n_rows: self.n_rows, n_cols: self.n_cols, row_starts, columns })
    }

    /// The same as [`PatternBuilder::build`], ready to be shared.
    ///
    /// # Errors
    /// As [`PatternBuilder::build`].
    pub fn build_shared(&self) -> Result<Arc<Pattern>, CsrError> {
        self.build().map(Arc::new)
    }

    fn check(&self) -> Result<(), CsrError> {
        // u32::MAX marks "not seen yet" above.
        if self.n_rows.max(self.n_cols) >= u32::MAX as usize {
            return Err(CsrError::TooLarge { size: self.n_rows.max(self.n_cols) });
        }
        if let Some(&row) = self.row_dofs.iter().find(|&&row| row as usize >= self.n_rows) {
            return Err(CsrError::Structure { row: row as usize, what: "row outside the matrix" });
        }
        if let Some(&column) = self.column_dofs.iter().find(|&&column| column as usize >= self.n_cols) {
            return Err(CsrError::Structure { row: column as usize, what: "column outside the matrix" });
        }
        Ok(())
    }

    /// For each row the elements that touch it, increasing, without repetition.
    fn elements_of_rows(&self) -> (Vec<usize>, Vec<u32>) {
        let n_elements = self.row_dof_starts.len() - 1;
        let mut last_element = vec![u32::MAX; self.n_rows];
        let mut starts = vec![0usize; self.n_rows + 1];
        for element in 0..n_elements {
            for &row in self.rows_of(element) {
                if last_element[row as usize] != element as u32 {
                    last_element[row as usize] = element as u32;
                    starts[row as usize + 1] += 1;
                }
            }
        }
        for row in 0..self.n_rows {
            starts[row + 1] += starts[row];
        }
        last_element.fill(u32::MAX);
        let mut next = starts.clone();
        let mut elements = vec![0u32; starts[self.n_rows]];
        for element in 0..n_elements {
            for &row in self.rows_of(element) {
                let row = row as usize;
                if last_element[row] != element as u32 {
                    last_element[row] = element as u32;
                    elements[next[row]] = element as u32;
                    next[row] += 1;
                }
            }
        }
        (starts, elements)
    }

    fn rows_of(&self, element: usize) -> &[u32] {
        &self.row_dofs[self.row_dof_starts[element]..self.row_dof_starts[element + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn element_order_does_not_change_the_pattern() {
        let elements: [&[u32]; 4] = [&[0, 3, 4], &[4, 1], &[2, 3], &[4, 4, 0]];
        let mut forward = PatternBuilder::new(5, 5);
        let mut backward = PatternBuilder::new(5, 5);
        for element in elements {
            forward.add_element(element);
        }
        for element in elements.iter().rev() {
            backward.add_element(element);
        }
        let pattern = forward.build().unwrap();
        assert_eq!(pattern, backward.build().unwrap());
        assert_eq!(pattern.row(4), &[0, 1, 3, 4]);
        assert_eq!(pattern.row(1), &[1, 4]);
        assert!(pattern.is_symmetric());
        assert_eq!(pattern.position(4, 3), Some(pattern.row_starts()[4] + 2));
        assert_eq!(pattern.position(4, 2), None);
    }

    #[test]
    fn bad_structures_are_refused() {
        assert!(Pattern::new(2, 2, vec![0, 1, 2], vec![0, 2]).is_err());
        assert!(Pattern::new(2, 2, vec![0, 2, 2], vec![1, 0]).is_err());
        assert!(Pattern::new(2, 2, vec![0, 2, 1], vec![0, 1]).is_err());
        assert!(Pattern::new(2, 2, vec![0, 3, 2], vec![0, 1]).is_err());
        assert!(Pattern::new(0, 0, vec![0], vec![]).is_ok());
        let mut outside = PatternBuilder::new(2, 2);
        outside.add_element(&[2]);
        assert!(outside.build().is_err());
    }

    #[test]
    fn union_and_positions_agree() {
        let first = Pattern::new(2, 3, vec![0, 2, 3], vec![0, 2, 1]).unwrap();
        let second = Pattern::new(2, 3, vec![0, 1, 3], vec![1, 1, 2]).unwrap();
        let both = first.union(&second).unwrap();
        assert_eq!(both.row(0), &[0, 1, 2]);
        assert_eq!(both.row(1), &[1, 2]);
        assert_eq!(first.positions_in(&both), Some(vec![0, 2, 3]));
        assert_eq!(both.positions_in(&first), None);
        let (back, sources) = both.transpose();
        assert_eq!(back.transpose().0, both);
        assert_eq!(sources, vec![0, 1, 3, 2, 4]);
    }
}
