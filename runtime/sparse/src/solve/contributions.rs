//! The stack of contributions: what each front leaves for its parent, last in first out.
//!
//! Promises the same places for the same fronts. Does not hold the numbers: a stack is its owner's.

use std::ops::Range;

use super::symbolic::{INTERFACE, Symbolic};

/// Contributions of fronts whose parent has not come yet.
pub(super) struct Contributions {
    /// Front, increasing, and start of each.
    waiting: Vec<(u32, usize)>,
    /// End of the last of them.
    end: usize,
}

impl Contributions {
    /// With room for so many.
    pub(super) fn with_capacity(depth: usize) -> Self {
        Self { waiting: Vec::with_capacity(depth), end: 0 }
    }

    pub(super) fn clear(&mut self) {
        self.waiting.clear();
        self.end = 0;
    }

    /// Where free numbers begin.
    pub(super) fn end(&self) -> usize {
        self.end
    }

    /// Where the contribution of a front starts, if it waits.
    pub(super) fn start_of(&self, front: u32) -> Option<usize> {
        let place = self.waiting.binary_search_by_key(&front, |&(other, _)| other).ok()?;
        Some(self.waiting[place].1)
    }

    /// Takes those of the children of a front off; its own may start where the first of them did. The numbers stay
    /// readable until the next [`Contributions::push`].
    pub(super) fn take_children(&mut self, symbolic: &Symbolic, front: usize) -> usize {
        let mut start = self.end;
        while self.waiting.last().is_some_and(|&(child, _)| symbolic.parents[child as usize] == front as u32) {
            start = self.waiting.pop().expect("it has just been seen").1;
        }
        start
    }

    /// Leaves so many numbers of a front from `start` on.
    pub(super) fn push(&mut self, front: usize, start: usize, length: usize) {
        self.waiting.push((front as u32, start));
        self.end = start + length;
    }

    /// Takes the last one off; its numbers stay readable until the next [`Contributions::push`].
    pub(super) fn pop(&mut self) -> Range<usize> {
        let (_, start) = self.waiting.pop().expect("a front has been pushed");
        start..std::mem::replace(&mut self.end, start)
    }
}

/// The size of a stack, and of the fronts that use it.
pub(super) struct Extent {
    /// Numbers on the stack, at most.
    pub(super) stack: usize,
    /// Contributions that wait, at most.
    pub(super) depth: usize,
    /// Columns of the largest front.
    pub(super) columns: usize,
    /// Rows below the columns, at most.
    pub(super) rows: usize,
}

impl Extent {
    /// That of these fronts in this order. A front of k columns and r rows below them needs `room(k, r)` numbers on the
    /// stack and leaves `left(r)` of them.
    pub(super) fn new(
        symbolic: &Symbolic,
        fronts: impl Iterator<Item = u32>,
        room: impl Fn(usize, usize) -> usize,
        left: impl Fn(usize) -> usize,
    ) -> Self {
        let mut contributions = Contributions::with_capacity(0);
        let mut extent = Self { stack: 0, depth: 0, columns: 0, rows: 0 };
        for front in fronts.map(|front| front as usize) {
            let (k, r) = symbolic.sizes(front);
            extent.columns = extent.columns.max(k);
            extent.rows = extent.rows.max(r);
            extent.stack = extent.stack.max(contributions.end + room(k, r));
            let start = contributions.take_children(symbolic, front);
            contributions.push(front, start, left(r));
            extent.depth = extent.depth.max(contributions.waiting.len());
            // what the interface gets is taken at once
            if symbolic.parents[front] == INTERFACE {
                contributions.pop();
            }
        }
        extent
    }
}

/// Numbers of a stack above which what is not needed any more is given back: below, asking for it again costs more than
/// it saves.
const KEPT: usize = 1 << 17;

/// Leaves so many numbers of a stack.
pub(super) fn shorten(stack: &mut Vec<f64>, length: usize) {
    if stack.len() > KEPT && stack.len() > length {
        stack.truncate(length);
        stack.shrink_to_fit();
    }
}

/// Numbers that the stacks hold at most: every task keeps the contribution of its root, and so many tasks at a time have
/// a whole stack.
pub(super) fn stacks(tasks: impl Iterator<Item = StackSizes>, top: usize, threads: usize) -> usize {
    let (mut kept, mut rest) = (0, Vec::new());
    for task in tasks {
        kept += task.root;
        rest.push(task.whole.saturating_sub(task.root));
    }
    rest.sort_unstable_by(|a, b| b.cmp(a));
    kept + rest.iter().take(threads.max(1)).sum::<usize>().max(top)
}

/// Numbers on the stack of a task.
pub(super) struct StackSizes {
    /// At most.
    pub(super) whole: usize,
    /// At its end.
    pub(super) root: usize,
}
