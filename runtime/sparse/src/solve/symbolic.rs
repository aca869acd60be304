//! The structure of a sparse symmetric factorisation: ordering, dense fronts, and where every entry goes.
//!
//! The fronts (supernodes) are groups of columns of the factor that share their rows. They form a tree: eliminating a
//! front leaves a dense contribution that is added to its parent (Duff and Reid 1983, multifrontal method). The part
//! of the matrix ordered last, the interface, is not eliminated: fronts without a parent front contribute to it.
//!
//! Promises: columns of a subtree are contiguous, a front comes before its parent, and the split into independent
//! tasks depends on the structure alone, never on the number of threads.
//! Does not hold values.

use std::ops::Range;

use wfl_dense::Fronts;

use super::SolveError;
use super::ordering::{Ordering, order};
use crate::csr::Pattern;
use wfl_host::memory::{claim, claim_numbers, refused_by_the_system};

/// Two neighbouring supernodes of together at most so many columns are merged when less than this part of the result
/// is zeros. Measured on elasticity boxes of 7,344 and 53,856 unknowns.
const RELAXATION: &[(usize, f64)] = &[(4, 1.0), (16, 0.8), (48, 0.1), (usize::MAX, 0.05)];
/// Aim of the split into independent tasks: none has more than this part of all operations.
const TASK_SHARE: f64 = 1.0 / 16.0;
/// Numbers that may wait for the fronts above: below, sharing out all tasks at once counts more than 8 MB.
const WAITING: usize = 1 << 20;
/// Multiplications that a whole factorisation makes while a triangular solve loads one value. Measured on neo-Hookean boxes
/// (LLT of 43,125 unknowns of P2: 9, LU of 26,460 of Q1: 9, one thread): fronts are far below the peak of a processor.
const OPERATIONS_PER_VALUE: f64 = 9.0;
/// Bytes that the analysis takes for an entry and for a row of the matrix, at its largest: half of the entries stand in
/// two triangles of two 32-bit numbers each.
const BYTES_PER_ENTRY: u64 = 8;
const BYTES_PER_ROW: u64 = 80;
/// Parent of a front that contributes to the interface (or to nothing).
pub(super) const INTERFACE: u32 = u32::MAX;

/// Structure of a factorisation of everything before the interface.
pub(super) struct Symbolic {
    pub(super) ordering: Ordering,
    /// Lower half of the reordered matrix by columns.
    pub(super) lower_starts: Vec<u32>,
    pub(super) lower_rows: Vec<u32>,
    /// Place of each entry of the lower half in the values of the matrix.
    pub(super) lower_sources: Vec<u32>,
    /// First column of each front, and the end.
    pub(super) columns: Vec<u32>,
    /// Rows of each front below its columns: start in `rows`, and the end.
    pub(super) row_starts: Vec<usize>,
    pub(super) rows: Vec<u32>,
    /// For each of `rows` its place in the parent front (columns first, then rows), or in the interface.
    pub(super) places: Vec<u32>,
    pub(super) parents: Vec<u32>,
    /// Children of each front, increasing: start in `children`, and the end.
    pub(super) child_starts: Vec<u32>,
    pub(super) children: Vec<u32>,
}

/// A split of some fronts into independent subtrees and the rest above them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plan {
    /// Which fronts take part.
    pub(super) members: Vec<bool>,
    /// Independent subtrees, increasing.
    pub(super) tasks: Vec<Task>,
    /// Members in no task, increasing.
    pub(super) top: Vec<u32>,
    /// Cost of all members.
    pub(super) cost: f64,
}

/// One independent subtree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Task {
    /// First front; the subtree is the members among `first..=root`.
    pub(super) first: u32,
    /// Its root.
    pub(super) root: u32,
    /// Cost of its members.
    pub(super) cost: f64,
}

/// Subtrees that follow each other, and the fronts above them that can be eliminated before the next ones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Batch {
    /// Among the tasks of the plan.
    pub(super) tasks: Range<usize>,
    /// Among the fronts above.
    pub(super) top: Range<usize>,
}

impl Symbolic {
    /// Orders and analyses a square pattern, read as symmetric; `last`, the interface, is not eliminated.
    pub(super) fn new(pattern: &Pattern, coordinates: Option<&[[f64; 3]]>, last: &[u32]) -> Result<Self, SolveError> {
        let too_large = SolveError::TooLarge { what: "a sparse matrix" };
        if pattern.n_entries() >= i32::MAX as usize {
            return Err(too_large);
        }
        // two triangles with rows and sources, the ordering, the lists of the analysis
        let need = BYTES_PER_ENTRY * pattern.n_entries() as u64 + BYTES_PER_ROW * pattern.n_rows() as u64;
        claim(need, "the analysis of a sparse factorisation")?;
        let ordering = order(pattern, coordinates, last)?;
        let (lower_starts, lower_rows, lower_sources) = triangle(pattern, &ordering, |row, column| row >= column);
        let supernodes = supernodes(pattern, &ordering)?;
        let (columns, row_starts, rows) = clip(&supernodes, ordering.n_first() as u32);
        let mut symbolic = Self {
            parents: parents(&columns, &row_starts, &rows),
            ordering,
            lower_starts,
            lower_rows,
            lower_sources,
            columns,
            row_starts,
            rows,
            places: Vec::new(),
            child_starts: Vec::new(),
            children: Vec::new(),
        };
        symbolic.find_children();
        symbolic.find_places();
        Ok(symbolic)
    }

    pub(super) fn n_fronts(&self) -> usize {
        self.columns.len() - 1
    }

    /// Number of unknowns that are eliminated.
    pub(super) fn n_eliminated(&self) -> usize {
        self.ordering.n_first()
    }

    /// Number of unknowns of the interface.
    pub(super) fn n_interface(&self) -> usize {
        self.ordering.forward().len() - self.ordering.n_first()
    }

    /// Columns and rows of a front.
    pub(super) fn sizes(&self, front: usize) -> (usize, usize) {
        ((self.columns[front + 1] - self.columns[front]) as usize, self.row_starts[front + 1] - self.row_starts[front])
    }

    pub(super) fn rows_of(&self, front: usize) -> &[u32] {
        &self.rows[self.row_starts[front]..self.row_starts[front + 1]]
    }

    pub(super) fn places_of(&self, front: usize) -> &[u32] {
        &self.places[self.row_starts[front]..self.row_starts[front + 1]]
    }

    pub(super) fn children_of(&self, front: usize) -> &[u32] {
        &self.children[self.child_starts[front] as usize..self.child_starts[front + 1] as usize]
    }

    /// Places of the lower half of one column in `lower_rows` and `lower_sources`.
    pub(super) fn lower_entries(&self, column: usize) -> Range<usize> {
        self.lower_starts[column] as usize..self.lower_starts[column + 1] as usize
    }

    /// Place of a row or column (in the order of elimination) in a front: its columns first, then its rows.
    pub(super) fn local(&self, front: usize, place: u32) -> Option<u32> {
        let (first, end) = (self.columns[front], self.columns[front + 1]);
        if place < end {
            return place.checked_sub(first);
        }
        self.rows_of(front).binary_search(&place).ok().map(|row| end - first + row as u32)
    }

    /// Fronts that own one of the dofs, and all above them.
    pub(super) fn fronts_above(&self, dofs: &[u32]) -> Vec<bool> {
        let mut members = vec![false; self.n_fronts()];
        for &dof in dofs {
            let place = self.ordering.inverse()[dof as usize];
            members[self.columns.partition_point(|&column| column <= place) - 1] = true;
        }
        for front in 0..members.len() {
            if members[front] && self.parents[front] != INTERFACE {
                members[self.parents[front] as usize] = true;
            }
        }
        members
    }

    /// Multiplications of the Cholesky factorisation of one front.
    pub(super) fn operations(&self, front: usize) -> f64 {
        let (k, r) = self.sizes(front);
        let (k, r) = (k as f64, r as f64);
        k * k * k / 6.0 + k * k * r / 2.0 + k * r * r / 2.0
    }

    /// Krylov iterations with a whole factor that cost as much as the factor; by LU with `is_general`, else by LLT.
    pub(super) fn worthwhile_iterations(&self, is_general: bool) -> usize {
        let times = if is_general { 2.0 } else { 1.0 };
        let operations: f64 = (0..self.n_fronts()).map(|front| times * self.operations(front)).sum();
        // LLT: forward and backward substitution load the same values
        let values = (0..self.n_fronts()).map(|front| {
            let (k, r) = self.sizes(front);
            (if is_general { k * (k + 2 * r) } else { 2 * k * (k + r) }) as f64
        });
        (operations / (OPERATIONS_PER_VALUE * values.sum::<f64>()).max(1.0)) as usize
    }

    /// Asks for the memory of all factors before any of it is taken: fronts with `is_general` are factored by LU, and
    /// `more` numbers follow.
    pub(super) fn claim(&self, is_general: impl Fn(usize) -> bool, more: usize) -> Result<(), SolveError> {
        let numbers = |front: usize| {
            let (k, r) = self.sizes(front);
            let across = if is_general(front) { 2 * r } else { r };
            (k * (k + across)) as u64
        };
        let factor: u64 = (0..self.n_fronts()).map(numbers).sum();
        // contributions of fronts that wait for their parent: the largest, and one child of it
        let waiting = (0..self.n_fronts()).map(|front| self.sizes(front).1 as u64).max().map_or(0, |r| 2 * r * r);
        claim_numbers(factor + waiting + more as u64, "the factor of the matrix")?;
        Ok(())
    }

    fn find_children(&mut self) {
        let n = self.n_fronts();
        let mut starts = vec![0u32; n + 1];
        for &parent in self.parents.iter().filter(|&&parent| parent != INTERFACE) {
            starts[parent as usize + 1] += 1;
        }
        for front in 0..n {
            starts[front + 1] += starts[front];
        }
        let mut next = starts.clone();
        let mut children = vec![0u32; starts[n] as usize];
        for (front, &parent) in self.parents.iter().enumerate() {
            if parent != INTERFACE {
                let place = &mut next[parent as usize];
                children[*place as usize] = front as u32;
                *place += 1;
            }
        }
        (self.child_starts, self.children) = (starts, children);
    }

    fn find_places(&mut self) {
        let mut places = Vec::with_capacity(self.rows.len());
        for front in 0..self.n_fronts() {
            let parent = self.parents[front];
            if parent == INTERFACE {
                let offset = self.n_eliminated() as u32;
                places.extend(self.rows_of(front).iter().map(|row| row - offset));
                continue;
            }
            let (first, end) = (self.columns[parent as usize], self.columns[parent as usize + 1]);
            let parent_rows = self.rows_of(parent as usize);
            let mut below = 0;
            for &row in self.rows_of(front) {
                if row < end {
                    places.push(row - first);
                } else {
                    while parent_rows[below] != row {
                        below += 1;
                    }
                    places.push(end - first + below as u32);
                }
            }
        }
        self.places = places;
    }

    /// Splits the members so that no task has much more than its share of their cost. Members are all fronts below some
    /// fronts, or all above some.
    pub(super) fn plan(&self, members: Vec<bool>, cost: impl Fn(usize) -> f64) -> Plan {
        let n = self.n_fronts();
        let mut first: Vec<u32> = (0..n as u32).collect();
        let mut costs: Vec<f64> = (0..n).map(|front| if members[front] { cost(front) } else { 0.0 }).collect();
        for front in 0..n {
            if self.parents[front] != INTERFACE {
                let parent = self.parents[front] as usize;
                first[parent] = first[parent].min(first[front]);
                costs[parent] += costs[front];
            }
        }
        let is_root = |front: &usize| {
            let parent = self.parents[*front];
            members[*front] && (parent == INTERFACE || !members[parent as usize])
        };
        let mut open: Vec<usize> = (0..n).filter(is_root).collect();
        let total: f64 = open.iter().map(|&front| costs[front]).sum();
        let (mut tasks, mut top) = (Vec::new(), Vec::new());
        while let Some(front) = open.pop() {
            let children = || self.children_of(front).iter().filter(|&&child| members[child as usize]);
            if costs[front] > TASK_SHARE * total && children().next().is_some() {
                top.push(front as u32);
                open.extend(children().map(|&child| child as usize));
            } else {
                tasks.push(Task { first: first[front], root: front as u32, cost: costs[front] });
            }
        }
        top.sort_unstable();
        tasks.sort_unstable_by_key(|task| task.root);
        Plan { members, tasks, top, cost: total }
    }
}

impl Plan {
    /// The members in no task by the tree they belong to, each increasing.
    pub(super) fn tops(&self, symbolic: &Symbolic) -> Vec<Vec<u32>> {
        let mut trees: Vec<Vec<u32>> = Vec::new();
        // trees are numbered one after the other, and their roots last
        let mut is_open = false;
        for &front in &self.top {
            if !std::mem::replace(&mut is_open, true) {
                trees.push(Vec::new());
            }
            trees.last_mut().into_iter().for_each(|tree| tree.push(front));
            let parent = symbolic.parents[front as usize];
            is_open = parent != INTERFACE && self.members[parent as usize];
        }
        trees
    }

    /// The order in which tasks and the fronts above them are done: all tasks first, or, where the contributions of their
    /// roots (`left(r)` numbers each for r rows) are large, as few at a time as keep so many threads busy.
    pub(super) fn batches(&self, symbolic: &Symbolic, threads: usize, left: impl Fn(usize) -> usize) -> Vec<Batch> {
        let waiting: usize = self.tasks.iter().map(|task| left(symbolic.sizes(task.root as usize).1)).sum();
        // as the largest tasks together, so that no thread waits for long
        let enough = match threads {
            _ if waiting <= WAITING => f64::INFINITY,
            0 | 1 => 0.0,
            _ => threads as f64 * TASK_SHARE * self.cost,
        };
        let (mut batches, mut begin, mut top, mut cost) = (Vec::new(), 0, 0, 0.0);
        for (number, task) in self.tasks.iter().enumerate() {
            cost += task.cost;
            let next = self.tasks.get(number + 1).map_or(u32::MAX, |task| task.first);
            let end = self.top.partition_point(|&front| front < next);
            if cost >= enough || number + 1 == self.tasks.len() {
                batches.push(Batch { tasks: begin..number + 1, top: top..end });
                (begin, top, cost) = (number + 1, end, 0.0);
            }
        }
        batches
    }

    /// Members of a task, increasing.
    pub(super) fn fronts_of(&self, task: &Task) -> impl DoubleEndedIterator<Item = u32> + Clone + use<'_> {
        (task.first..=task.root).filter(|&front| self.members[front as usize])
    }

    /// Number of the task with this root.
    pub(super) fn task_of(&self, root: u32) -> Option<usize> {
        self.tasks.binary_search_by_key(&root, |task| task.root).ok()
    }

    /// The part of a buffer that belongs to each of some tasks; `start` is the first place of a front (or of the end).
    pub(super) fn split<'a, T>(
        &self,
        mut buffer: &'a mut [T],
        tasks: Range<usize>,
        start: impl Fn(usize) -> usize,
    ) -> Vec<&'a mut [T]> {
        let mut done = 0;
        let mut parts = Vec::with_capacity(tasks.len());
        for task in &self.tasks[tasks] {
            let (first, end) = (start(task.first as usize), start(task.root as usize + 1));
            let (part, rest) = buffer.split_at_mut(first - done).1.split_at_mut(end - first);
            parts.push(part);
            buffer = rest;
            done = end;
        }
        parts
    }
}

/// Structure of the whole factor, interface included.
fn supernodes(pattern: &Pattern, ordering: &Ordering) -> Result<Fronts, SolveError> {
    let (starts, rows, _) = triangle(pattern, ordering, |row, column| row <= column);
    wfl_dense::fronts(pattern.n_rows(), &starts, &rows, RELAXATION)
        .map_err(|_| refused_by_the_system(None, "the analysis of a sparse factorisation").into())
}

/// Columns and rows of the fronts with less than `end` columns; one that reaches over the end is cut there.
fn clip(supernodes: &Fronts, end: u32) -> (Vec<u32>, Vec<usize>, Vec<u32>) {
    let (mut columns, mut row_starts, mut rows) = (Vec::new(), vec![0], Vec::new());
    for front in 0..supernodes.len() {
        let [first, last] = supernodes.columns(front);
        if first >= end {
            break;
        }
        columns.push(first);
        rows.extend(last.min(end)..last);
        rows.extend_from_slice(supernodes.rows(front));
        row_starts.push(rows.len());
    }
    columns.push(end);
    (columns, row_starts, rows)
}

/// The front that owns the first row below each front.
fn parents(columns: &[u32], row_starts: &[usize], rows: &[u32]) -> Vec<u32> {
    let n = columns.len() - 1;
    (0..n)
        .map(|front| match rows[row_starts[front]..row_starts[front + 1]].first() {
            Some(&row) if row < columns[n] => columns.partition_point(|&column| column <= row) as u32 - 1,
            _ => INTERFACE,
        })
        .collect()
}

/// The reordered pattern by columns, those entries (row, column) for which `keep` holds, and their sources.
fn triangle(pattern: &Pattern, ordering: &Ordering, keep: impl Fn(u32, u32) -> bool) -> (Vec<u32>, Vec<u32>, Vec<u32>) {
    let mut starts = vec![0];
    let mut entries = Vec::with_capacity(pattern.n_entries() / 2 + pattern.n_rows());
    for (column, &old) in ordering.forward().iter().enumerate() {
        let source = pattern.row_starts()[old as usize];
        let begin = entries.len();
        for (offset, &other) in pattern.row(old as usize).iter().enumerate() {
            let row = ordering.inverse()[other as usize];
            if keep(row, column as u32) {
                entries.push((row, (source + offset) as u32));
            }
        }
        entries[begin..].sort_unstable();
        starts.push(entries.len() as u32);
    }
    let (rows, sources) = entries.into_iter().unzip();
    (starts, rows, sources)
}
