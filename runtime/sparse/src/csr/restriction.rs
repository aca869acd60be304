//! A part of a matrix as a smaller matrix: rows and columns left out, or added to others.

use std::sync::Arc;

use super::{Csr, CsrError, Pattern};
use crate::index::NONE;

/// A reusable recipe that gathers the entries of any matrix on one pattern in a smaller matrix: rows and columns are left
/// out, or added to others.
#[derive(Debug, Clone)]
pub struct Restriction {
    pattern: Arc<Pattern>,
    gathering: Gathering,
}

/// How the entries of the source are found in the result.
#[derive(Debug, Clone)]
enum Gathering {
    /// Those that are kept follow one another as in the source.
    InOrder {
        source: Arc<Pattern>,
        /// By row and column of the source whether it is kept.
        is_kept: Vec<bool>,
    },
    /// By entry of the source its place in the result, or [`NONE`].
    Places(Vec<u32>),
}

impl Restriction {
    /// Prepares a result of `n` rows and columns: row and column i of the square source are added to row and column
    /// `targets[i]` of it; those with [`NONE`] are left out.
    ///
    /// # Errors
    /// [`CsrError::Structure`] when the lists do not fit the source or the size.
    pub fn new(source: &Arc<Pattern>, targets: &[u32], n: usize) -> Result<Self, CsrError> {
        if source.n_rows() != targets.len() || source.n_cols() != targets.len() {
            return Err(CsrError::Structure { row: targets.len(), what: "one target for each row and column" });
        }
        if let Some(row) = targets.iter().position(|t| *t != NONE && *t as usize >= n) {
            return Err(CsrError::Structure { row, what: "target outside the matrix" });
        }
        if targets.iter().filter(|t| **t != NONE).copied().eq(0..n as u32) {
            return Self::in_order(source, targets);
        }
        let pattern = merged(source, targets, n)?;
        let gathering = by_places(source, targets, &pattern);
        Ok(Self { pattern: Arc::new(pattern), gathering })
    }

    /// Of targets that rise by one.
    fn in_order(source: &Arc<Pattern>, targets: &[u32]) -> Result<Self, CsrError> {
        let kept = |row: &usize| targets[*row] != NONE;
        let of_row = |row: usize| source.row(row).iter().map(|c| targets[*c as usize]).filter(|t| *t != NONE);
        let count = (0..targets.len()).filter(kept).map(|row| of_row(row).count()).sum();
        let (mut row_starts, mut columns) = (vec![0usize], Vec::with_capacity(count));
        for row in (0..targets.len()).filter(kept) {
            columns.extend(of_row(row));
            row_starts.push(columns.len());
        }
        let n = row_starts.len() - 1;
        let pattern = Arc::new(Pattern::new(n, n, row_starts, columns)?);
        let is_kept = targets.iter().map(|t| *t != NONE).collect();
        Ok(Self { pattern, gathering: Gathering::InOrder { source: Arc::clone(source), is_kept } })
    }

    /// The pattern of the result.
    #[inline]
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// The result of a matrix on the source pattern.
    ///
    /// # Panics
    /// When `matrix` has another number of entries than the source pattern.
    pub fn apply(&self, matrix: &Csr) -> Csr {
        let mut out = Csr::zeros(Arc::clone(&self.pattern));
        self.apply_into(matrix, out.values_mut());
        out
    }

    /// Writes the values of the result, without allocation.
    ///
    /// # Panics
    /// When `matrix` has another number of entries than the source pattern, or `values` another than the result.
    pub fn apply_into(&self, matrix: &Csr, values: &mut [f64]) {
        let n_entries = match &self.gathering {
            Gathering::InOrder { source, .. } => source.n_entries(),
            Gathering::Places(places) => places.len(),
        };
        assert!(matrix.values().len() == n_entries && values.len() == self.pattern.n_entries(), "other pattern");
        match &self.gathering {
            Gathering::InOrder { source, is_kept } => {
                let mut out = values.iter_mut();
                for row in (0..is_kept.len()).filter(|row| is_kept[*row]) {
                    let entries = source.row(row).iter().zip(matrix.row(row).1);
                    let kept = entries.filter(|(column, _)| is_kept[**column as usize]);
                    kept.for_each(|(_, value)| *out.next().expect("as many as were counted") = *value);
                }
            }
            Gathering::Places(places) => {
                values.fill(0.0);
                for (place, value) in places.iter().zip(matrix.values()).filter(|(place, _)| **place != NONE) {
                    values[*place as usize] += value;
                }
            }
        }
    }
}

/// Where the entries of a source stand in a pattern that has all of them.
fn by_places(source: &Pattern, targets: &[u32], pattern: &Pattern) -> Gathering {
    let mut places = Vec::with_capacity(source.n_entries());
    for (row, target) in targets.iter().enumerate() {
        for column in source.row(row) {
            let at = match (*target, targets[*column as usize]) {
                (NONE, _) | (_, NONE) => None,
                (row, column) => pattern.position(row as usize, column as usize),
            };
            places.push(at.map_or(NONE, |p| u32::try_from(p).expect("fewer than 2^32 entries")));
        }
    }
    Gathering::Places(places)
}

/// The pattern of a source whose rows and columns are left out, or added to others.
fn merged(source: &Pattern, targets: &[u32], n: usize) -> Result<Pattern, CsrError> {
    let mut order: Vec<u32> = (0..targets.len() as u32).filter(|r| targets[*r as usize] != NONE).collect();
    order.sort_by_key(|r| targets[*r as usize]);
    let (mut row_starts, mut columns) = (vec![0usize], Vec::new());
    let mut rest = order.as_slice();
    for row in 0..n as u32 {
        let (own, others) = rest.split_at(rest.partition_point(|r| targets[*r as usize] == row));
        rest = others;
        let begin = columns.len();
        let entries = own.iter().flat_map(|r| source.row(*r as usize));
        columns.extend(entries.map(|c| targets[*c as usize]).filter(|t| *t != NONE));
        columns[begin..].sort_unstable();
        let mut kept = begin;
        for at in begin..columns.len() {
            if at == begin || columns[at] != columns[kept - 1] {
                columns[kept] = columns[at];
                kept += 1;
            }
        }
        columns.truncate(kept);
        row_starts.push(columns.len());
    }
    Pattern::new(n, n, row_starts, columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_restriction_leaves_out_and_adds_up() {
        let triplets = [(0, 0, 1.0), (0, 1, 2.0), (1, 0, 3.0), (1, 2, 4.0), (2, 1, 5.0), (2, 2, 6.0), (3, 3, 7.0)];
        let a = Csr::from_triplets(4, 4, &triplets).unwrap();
        // 2 is added to 0, 3 is left out
        let map = Restriction::new(a.pattern(), &[0, 1, 0, NONE], 2).unwrap();
        let b = map.apply(&a);
        assert_eq!([b.get(0, 0), b.get(0, 1), b.get(1, 0), b.get(1, 1)], [7.0, 7.0, 7.0, 0.0]);
        assert_eq!(map.pattern().n_entries(), 3);
        assert!(Restriction::new(a.pattern(), &[0, 1, 0, 3], 2).is_err());
        assert!(Restriction::new(a.pattern(), &[0, 1], 2).is_err());
    }

    #[test]
    fn rows_that_are_kept_in_their_order_need_no_places() {
        let triplets = [(0, 0, 1.0), (0, 3, 2.0), (1, 1, 3.0), (2, 0, 4.0), (2, 2, 5.0), (3, 0, 6.0), (3, 3, 7.0)];
        let a = Csr::from_triplets(4, 4, &triplets).unwrap();
        let map = Restriction::new(a.pattern(), &[0, NONE, 1, 2], 3).unwrap();
        assert!(matches!(map.gathering, Gathering::InOrder { .. }));
        let (b, places) =
            (map.apply(&a), Restriction { gathering: by_places(a.pattern(), &[0, NONE, 1, 2], &map.pattern), ..map });
        assert_eq!(b, places.apply(&a));
        assert_eq!([b.get(0, 0), b.get(0, 2), b.get(1, 0), b.get(1, 1), b.get(2, 2)], [1.0, 2.0, 4.0, 5.0, 7.0]);
    }
}
