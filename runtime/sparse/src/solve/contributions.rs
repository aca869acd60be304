//! The stack of contributions: what each front leaves for its parent, last in first out.
//!
//! Promises the same places for the same fronts. Does not hold the numbers: a stack is its owner's.

use std::ops::Range;

use super::symbolic::{Batch, INTERFACE, Plan, Symbolic};

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
    /// That of these fronts in this order. A front of r rows below its columns needs `left(r)` numbers on the stack and
    /// leaves them.
    pub(super) fn new(symbolic: &Symbolic, fronts: impl Iterator<Item = u32>, left: impl Fn(usize) -> usize) -> Self {
        let mut contributions = Contributions::with_capacity(0);
        let mut extent = Self { stack: 0, depth: 0, columns: 0, rows: 0 };
        for front in fronts.map(|front| front as usize) {
            let (k, r) = symbolic.sizes(front);
            extent.columns = extent.columns.max(k);
            extent.rows = extent.rows.max(r);
            extent.stack = extent.stack.max(contributions.end + left(r));
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

/// What memory is asked for.
pub(super) const WHAT: &str = "the contributions of a sparse factorisation";

/// Gives a stack back that nobody reads any more.
pub(super) fn give_back(stack: &mut Vec<f64>) {
    shorten(stack, 0);
}

/// Numbers that the stacks hold at most while the batches of a plan are done: those of so many tasks at a time, the
/// contributions of their roots until a front takes them up, and the stack of the fronts above. `whole` is by task;
/// `left(r)` as in [`Extent::new`].
pub(super) fn stacks(
    symbolic: &Symbolic,
    plan: &Plan,
    batches: &[Batch],
    threads: usize,
    whole: &[usize],
    left: impl Fn(usize) -> usize,
) -> usize {
    let left = |front: u32| left(symbolic.sizes(front as usize).1);
    // a small stack stays as it is
    let kept = |task: usize| if whole[task] > KEPT { left(plan.tasks[task].root) } else { whole[task] };
    let freed = |task: usize| if kept(task) > KEPT { kept(task) } else { 0 };
    let (mut waiting, mut most) = (0, 0);
    let mut above = Contributions::with_capacity(0);
    for batch in batches.iter().cloned() {
        let mut rest: Vec<usize> = batch.tasks.clone().map(|task| whole[task] - kept(task)).collect();
        rest.sort_unstable_by(|a, b| b.cmp(a));
        waiting += batch.tasks.clone().map(kept).sum::<usize>();
        most = most.max(waiting + above.end + rest.iter().take(threads.max(1)).sum::<usize>());
        for &front in &plan.top[batch.top] {
            most = most.max(waiting + above.end + left(front));
            let start = above.take_children(symbolic, front as usize);
            let tasks = symbolic.children_of(front as usize).iter().filter_map(|&child| plan.task_of(child));
            waiting -= tasks.map(freed).sum::<usize>();
            above.push(front as usize, start, left(front));
            if symbolic.parents[front as usize] == INTERFACE {
                above.pop();
            }
        }
        let done = batch.tasks.filter(|&task| symbolic.parents[plan.tasks[task].root as usize] == INTERFACE);
        waiting -= done.map(freed).sum::<usize>();
    }
    most
}
