//! The lower half of a symmetric dense matrix in blocks of columns, which dense kernels take as they are.
//!
//! A block holds the rows from its first column on, by columns: the memory is half of the square's and half a block more.
//! Does not hold the numbers.

use std::ops::Range;

/// Columns of a block: enough for a dense kernel to work at full speed.
const WIDTH: usize = 64;
/// Blocks of a large matrix: half a block more than the half is a few per cent, and larger blocks serve more threads.
const BLOCKS: usize = 16;

/// Columns of the blocks of a matrix with so many rows.
fn width(n: usize) -> usize {
    WIDTH * n.div_ceil(WIDTH * BLOCKS).max(1)
}

/// A block of columns of a matrix with so many rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Block {
    /// First column, and first row.
    pub(super) first: usize,
    /// Columns.
    pub(super) columns: usize,
    /// Rows, from the first column on.
    pub(super) rows: usize,
    /// Where its numbers start.
    pub(super) start: usize,
}

impl Block {
    fn of(n: usize, block: usize) -> Self {
        let width = width(n);
        let first = block * width;
        // the blocks before it have n, n - width, ... rows
        let start = width * block * n - width * width * (block * block.saturating_sub(1) / 2);
        Self { first, columns: width.min(n - first), rows: n - first, start }
    }

    /// Where its numbers are.
    pub(super) fn range(self) -> Range<usize> {
        self.start..self.start + self.rows * self.columns
    }
}

/// The blocks of a matrix with so many rows.
pub(super) fn blocks(n: usize) -> impl Iterator<Item = Block> {
    (0..n.div_ceil(width(n))).map(move |block| Block::of(n, block))
}

/// Numbers that a matrix with so many rows takes.
pub(super) fn length(n: usize) -> usize {
    n.div_ceil(width(n)).checked_sub(1).map_or(0, |last| Block::of(n, last).range().end)
}

/// Where the numbers of a column from its diagonal down are.
pub(super) fn column(n: usize, column: usize) -> Range<usize> {
    let block = Block::of(n, column / width(n));
    let inside = column - block.first;
    let start = block.start + inside * block.rows + inside;
    start..start + n - column
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_lie_one_after_the_other_in_half_of_the_square() {
        for n in [0, 1, 5, 63, 64, 65, 128, 200, 1000, 1025, 3000] {
            let mut end = 0;
            for block in blocks(n) {
                assert_eq!(block.start, end);
                end = block.range().end;
                for inside in 0..block.columns {
                    let place = column(n, block.first + inside);
                    assert_eq!(place.len(), n - block.first - inside);
                    assert_eq!(place.end, block.start + (inside + 1) * block.rows);
                }
            }
            assert_eq!(length(n), end);
            assert!(end <= n * n && end <= n * (n + width(n)) / 2 + width(n).pow(2));
        }
    }
}
