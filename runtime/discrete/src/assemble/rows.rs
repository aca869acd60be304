//! Ownership of matrix rows, and when each row is cleared.
//!
//! Every thread receives the values of its own rows only, as a few ranges of the matrix, and adds to them with vector
//! instructions. A matrix is not cleared as a whole: each thread clears a few rows just before the first batch that
//! adds to one of them, so the additions find them in the cache. Made once for a pattern and a number of threads.

use crate::assemble::shares::{Shares, Touched};
use rayon::prelude::*;
use wfl_sparse::{csr::Pattern, index::NONE};

/// Values of a matrix that follow one another, from `start` on.
#[derive(Debug)]
struct Stretch<'a> {
    start: usize,
    values: &'a mut [f64],
}

/// The values that one thread adds to.
#[derive(Debug)]
pub(super) struct Own<'a, 'b> {
    /// In the order of the matrix.
    stretches: &'b mut [Stretch<'a>],
    /// Where the last row was found.
    last: usize,
}

impl Own<'_, '_> {
    /// The values from `start` on, as far as they are this thread's; `None` if that one is not.
    #[inline(always)]
    pub(super) fn from(&mut self, start: usize) -> Option<&mut [f64]> {
        let holds = |s: &Stretch<'_>| start.wrapping_sub(s.start) < s.values.len();
        if !self.stretches.get(self.last).is_some_and(holds) {
            self.last = self.stretches.partition_point(|s| s.start <= start).checked_sub(1)?;
        }
        let stretch = &mut self.stretches[self.last];
        stretch.values.get_mut(start.wrapping_sub(stretch.start)..).filter(|values| !values.is_empty())
    }
}

/// So many values are cleared at once, at least: short ranges one by one make the processor wait for memory.
const AT_ONCE: usize = 4096;

/// What one thread clears.
#[derive(Debug, Default)]
struct Clears {
    /// First value and how many, ordered by batch.
    ranges: Vec<(u32, u32)>,
    /// By batch of the thread: how many ranges are cleared before it and all batches before. One more at the end.
    until: Vec<u32>,
}

/// How the values of a matrix are shared out.
#[derive(Debug)]
pub(super) struct Rows {
    /// Ends of the ranges, and their owners.
    ends: Vec<(usize, u16)>,
    /// Threads.
    n: usize,
    /// By thread; empty where nothing is cleared.
    clears: Vec<Clears>,
}

impl Rows {
    /// `free` maps dofs to rows of the pattern. To clear the matrix takes more than to add to it.
    pub(super) fn new(
        pattern: &Pattern,
        free: &[u32],
        shares: &Shares,
        touched: &Touched<'_>,
        with_clears: bool,
    ) -> Self {
        let n = shares.duties.len();
        if n == 1 && !with_clears {
            return Self { ends: Vec::new(), n, clears: Vec::new() };
        }
        let mut dof_of = vec![NONE; pattern.n_rows()];
        for (dof, row) in (0u32..).zip(free).filter(|(_, row)| **row != NONE) {
            dof_of[*row as usize] = dof;
        }
        let owner = |row: usize| shares.owner.get(dof_of[row] as usize).copied().filter(|o| usize::from(*o) < n);
        let (ends, owners) = stretches(pattern.row_starts(), owner);
        let clearing = if with_clears { n } else { 0 };
        let clears = (0..clearing).map(|me| Clears::new(pattern, free, me, &owners, shares, touched)).collect();
        Self { ends, n, clears }
    }

    /// Whether the matrix can be cleared.
    pub(super) fn can_clear(&self) -> bool {
        !self.clears.is_empty()
    }

    /// Clears what thread `me` adds to for the first time in its batch `duty`; with the number of its batches, the
    /// rest.
    pub(super) fn clear(&self, me: usize, duty: usize, own: &mut Own<'_, '_>) {
        let clears = &self.clears[me];
        let first = if duty == 0 { 0 } else { clears.until[duty - 1] };
        for (start, n) in &clears.ranges[first as usize..clears.until[duty] as usize] {
            if let Some(values) = own.from(*start as usize) {
                values[..*n as usize].fill(0.0);
            }
        }
    }

    /// Calls `work(thread, its values)` for every thread, each on a thread of the current pool.
    pub(super) fn share_out(&self, matrix: &mut [f64], work: impl Fn(usize, &mut Own<'_, '_>) + Sync) {
        if self.n == 1 {
            let mut all = [Stretch { start: 0, values: matrix }];
            return work(0, &mut Own { stretches: &mut all, last: 0 });
        }
        let mut parts: Vec<Vec<Stretch<'_>>> = (0..self.n).map(|_| Vec::new()).collect();
        let (mut rest, mut start) = (matrix, 0);
        for (end, owner) in &self.ends {
            let (values, others) = rest.split_at_mut(end - start);
            parts[usize::from(*owner)].push(Stretch { start, values });
            (rest, start) = (others, *end);
        }
        parts
            .par_iter_mut()
            .enumerate()
            .with_max_len(1)
            .for_each(|(me, stretches)| work(me, &mut Own { stretches, last: 0 }));
    }
}

/// Ends of the ranges of values and their owners, and the owner of each row. A row that nobody adds to goes with the
/// one before, and so does an empty one: it must not part the values of the rows beside it, which are cleared together.
fn stretches(starts: &[usize], owner: impl Fn(usize) -> Option<u16>) -> (Vec<(usize, u16)>, Vec<u16>) {
    let (mut ends, mut owners) = (Vec::<(usize, u16)>::new(), Vec::with_capacity(starts.len()));
    for (row, range) in starts.windows(2).enumerate() {
        let own = owner(row).filter(|_| range[1] > range[0]);
        let owner = own.or(owners.last().copied()).unwrap_or(0);
        owners.push(owner);
        match ends.last_mut().filter(|(_, o)| *o == owner) {
            Some((end, _)) => *end = range[1],
            None => ends.push((range[1], owner)),
        }
    }
    (ends, owners)
}

impl Clears {
    fn new(pattern: &Pattern, free: &[u32], me: usize, owners: &[u16], shares: &Shares, touched: &Touched<'_>) -> Self {
        let duties = &shares.duties[me];
        let mine = |row: usize| usize::from(owners[row]) == me;
        let starts = pattern.row_starts();
        let place = |at: usize| u32::try_from(at).expect("fewer than 2^32 entries");
        let mut out = Self::default();
        let mut seen = vec![false; pattern.n_rows()];
        let (mut rows, mut size, mut waiting) = (Vec::new(), 0, 0);
        let mut flush = |rows: &mut Vec<usize>, duties: usize| {
            rows.sort_unstable();
            let first = out.ranges.len();
            for row in rows.drain(..) {
                let (start, n) = (place(starts[row]), place(starts[row + 1] - starts[row]));
                match out.ranges[first..].last_mut().filter(|(before, n)| *before + *n == start) {
                    Some((_, sum)) => *sum += n,
                    None => out.ranges.push((start, n)),
                }
            }
            out.until.extend(std::iter::repeat_n(place(out.ranges.len()), duties));
        };
        for duty in duties {
            for dof in touched.dofs(duty.group, duty.batch) {
                let row = free[dof as usize] as usize;
                if row != NONE as usize && mine(row) && !std::mem::replace(&mut seen[row], true) {
                    rows.push(row);
                    size += starts[row + 1] - starts[row];
                }
            }
            waiting += 1;
            if size >= AT_ONCE {
                flush(&mut rows, waiting);
                (size, waiting) = (0, 0);
            }
        }
        flush(&mut rows, waiting);
        rows.extend((0..pattern.n_rows()).filter(|row| mine(*row) && !seen[*row]));
        flush(&mut rows, 1);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_without_values_do_not_part_a_stretch() {
        // rows of 3, 0, 2, 0 and 4 values; the empty ones belong to the other thread, the last but one to nobody
        let owners = [Some(0), Some(1), Some(0), None, Some(1)];
        let (ends, of_rows) = stretches(&[0, 3, 3, 5, 5, 9], |row| owners[row]);
        assert_eq!(ends, [(5, 0), (9, 1)]);
        assert_eq!(of_rows, [0, 0, 0, 0, 1]);
    }
}
