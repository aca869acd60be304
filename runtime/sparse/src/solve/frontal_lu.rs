//! Multifrontal LU of the fronts that change, on top of Cholesky fronts that do not.
//!
//! A front is F = [F11 F12; F21 F22] with k columns to eliminate and r rows below. Rows are exchanged within F11 only:
//!
//! ```text
//! P F11 = L11 U11    U12 = L11⁻¹ P F12    L21 = F21 U11⁻¹    contribution F22 - L21 U12
//! ```
//!
//! The structure is that of `A + Aᵀ`, so a front is square and the tree is that of [`Symbolic`].
//!
//! Promises: a second factorisation on the same structure reuses all memory; the same bytes for any number of threads;
//! reports the smallest pivot relative to its column, and its dof.
//! Because pivots come from F11 alone this is not backward stable for every matrix: `checked` tests the true
//! residual, and a vanishing pivot is an error here, to be answered with another method.

use std::ops::Range;

use rayon::prelude::*;
use wfl_dense::{Accum, MatMut, Par, Real, Reborrow, ReborrowMut, Work, solve_unit_lower};

use super::SolveError;
use super::contributions::{Contributions, Extent, WHAT, give_back, shorten, stacks};
use super::dense::is_odd;
use super::multifrontal::Multifrontal;
use super::packed;
use super::symbolic::{Batch, INTERFACE, Plan, Symbolic, Task};
use super::triangular_solve::FrontFactor;
use crate::csr::Pattern;
use wfl_host::memory::{claim_numbers, lengthen, refused_by_the_system, zeros};

/// A pivot below this part of its column is as good as zero.
const VANISHING_PIVOT: f64 = 1e-15;

/// LU factors of the members of a plan.
pub(super) struct FrontalLu {
    plan: Plan,
    batches: Vec<Batch>,
    values: Vec<f64>,
    /// Start of the values of each front (panel, then upper part), and the end.
    starts: Vec<usize>,
    pivots: Vec<u32>,
    /// Start of the pivots of each front, and the end.
    pivot_starts: Vec<usize>,
    workspaces: Vec<Workspace>,
    top: Workspace,
    threads: usize,
}

/// Where the entries of one matrix go in the fronts that change.
pub(super) struct EntryMap {
    /// Start of the entries of each front, and the end.
    starts: Vec<usize>,
    entries: Vec<Entry>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    source: u32,
    row: u32,
    column: u32,
}

struct Workspace {
    stack: Vec<f64>,
    /// Numbers on the stack, at most.
    size: usize,
    memory: Work,
    waiting: Contributions,
    inverse: Vec<u32>,
    largest_in_column: Vec<f64>,
    /// A column of the eliminated part of a front.
    column: Vec<f64>,
    /// Smallest pivot relative to its column, and its place in the order of elimination.
    smallest: (f64, u32),
}

/// One matrix of the sum that is factored.
pub(super) struct Part<'a> {
    pub(super) map: &'a EntryMap,
    pub(super) values: &'a [f64],
}

struct Context<'a> {
    symbolic: &'a Symbolic,
    plan: &'a Plan,
    parts: &'a [Part<'a>],
    constant: Option<&'a Multifrontal>,
    tasks: &'a [Workspace],
    threads: usize,
}

impl EntryMap {
    /// Maps the entries of a pattern that fall into members. `None` when an entry has no place in the structure, or
    /// `all_inside` is asked for and an entry belongs to a front that is no member.
    pub(super) fn new(symbolic: &Symbolic, members: &[bool], pattern: &Pattern, all_inside: bool) -> Option<Self> {
        let inverse = symbolic.ordering.inverse();
        let n_fronts = symbolic.n_fronts();
        let mut front_of = vec![0u32; symbolic.n_eliminated()];
        for front in 0..n_fronts {
            front_of[symbolic.columns[front] as usize..symbolic.columns[front + 1] as usize].fill(front as u32);
        }
        let mut found: Vec<(u32, Entry)> = Vec::new();
        for row in 0..pattern.n_rows() {
            let new_row = inverse[row];
            let start = pattern.row_starts()[row];
            for (offset, &column) in pattern.row(row).iter().enumerate() {
                let new_column = inverse[column as usize];
                let front = *front_of.get(new_row.min(new_column) as usize)?;
                if members[front as usize] {
                    let row = symbolic.local(front as usize, new_row)?;
                    let column = symbolic.local(front as usize, new_column)?;
                    found.push((front, Entry { source: (start + offset) as u32, row, column }));
                } else if all_inside {
                    return None;
                }
            }
        }
        let mut starts = vec![0usize; n_fronts + 1];
        for (front, _) in &found {
            starts[*front as usize + 1] += 1;
        }
        for front in 0..n_fronts {
            starts[front + 1] += starts[front];
        }
        // Stable: entries of a front keep the order of the matrix.
        found.sort_by_key(|(front, _)| *front);
        Some(Self { starts, entries: found.into_iter().map(|(_, entry)| entry).collect() })
    }

    fn of(&self, front: usize) -> &[Entry] {
        &self.entries[self.starts[front]..self.starts[front + 1]]
    }
}

impl FrontalLu {
    /// Takes the memory for the fronts in `members`, which holds every front above a member.
    pub(super) fn new(symbolic: &Symbolic, members: Vec<bool>, threads: usize) -> Result<Self, SolveError> {
        let plan = symbolic.plan(members, |front| 2.0 * symbolic.operations(front));
        let square = |r: usize| r * r;
        let extent = |fronts: &mut dyn Iterator<Item = u32>| Extent::new(symbolic, fronts, square);
        let extents: Vec<Extent> = plan.tasks.iter().map(|task| extent(&mut plan.fronts_of(task))).collect();
        let of_top = extent(&mut plan.top.iter().copied());
        let (mut starts, mut pivot_starts) = (vec![0], vec![0]);
        for front in 0..symbolic.n_fronts() {
            let (k, r) = if plan.members[front] { symbolic.sizes(front) } else { (0, 0) };
            starts.push(starts[front] + k * (k + 2 * r));
            pivot_starts.push(pivot_starts[front] + k);
        }
        let threads = super::worthwhile_threads(threads, plan.cost);
        let whole: Vec<usize> = extents.iter().map(|extent| extent.stack).collect();
        let batches = plan.batches(symbolic, threads, square);
        let stacks = stacks(symbolic, &plan, &batches, threads, &whole, square);
        claim_numbers((starts[symbolic.n_fronts()] + stacks) as u64, "the factor of the matrix")?;
        let workspaces = extents.into_iter().map(Workspace::new).collect::<Result<_, _>>()?;
        let top = Workspace::new(of_top)?;
        let values = zeros(starts[symbolic.n_fronts()], "the factor of the matrix")?;
        let pivots = vec![0; pivot_starts[symbolic.n_fronts()]];
        Ok(Self { plan, batches, values, starts, pivots, pivot_starts, workspaces, top, threads })
    }

    /// Whether the determinant over the fronts of the plan is negative; pivots are exchanged within fronts only.
    pub(super) fn is_negative(&self, symbolic: &Symbolic) -> bool {
        let of_front = |front: usize| {
            let (k, r) = symbolic.sizes(front);
            let panel = &self.values[self.starts[front]..];
            let negative = (0..k).filter(|i| panel[i * (k + r) + i] < 0.0).count();
            let pivots = &self.pivots[self.pivot_starts[front]..][..k];
            (negative % 2 == 1) != is_odd(pivots)
        };
        (0..symbolic.n_fronts()).filter(|front| self.plan.members[*front] && of_front(*front)).count() % 2 == 1
    }

    pub(super) fn members(&self) -> &[bool] {
        &self.plan.members
    }

    /// The factor of a member.
    pub(super) fn front(&self, symbolic: &Symbolic, front: usize) -> FrontFactor<'_> {
        let (k, r) = symbolic.sizes(front);
        let (panel, upper) = self.values[self.starts[front]..self.starts[front + 1]].split_at(k * (k + r));
        FrontFactor::Lu { panel, upper, pivots: &self.pivots[self.pivot_starts[front]..self.pivot_starts[front + 1]] }
    }

    /// Factors the sum of the parts; `constant` holds what the fronts below have left. Returns the smallest pivot
    /// relative to the largest entry of its column, and its dof; `(1, 0)` without members.
    ///
    /// # Errors
    /// [`SolveError::VanishingPivot`] when a pivot is zero to rounding, or not finite.
    pub(super) fn factor(
        &mut self,
        symbolic: &Symbolic,
        parts: &[Part<'_>],
        constant: Option<&Multifrontal>,
    ) -> Result<(f64, u32), SolveError> {
        self.values.fill(0.0);
        self.top.clear();
        for batch in self.batches.clone() {
            self.factor_tasks(symbolic, parts, constant, batch.tasks)?;
            self.factor_top(symbolic, parts, constant, batch.top)?;
        }
        let all = self.workspaces.iter().chain(std::iter::once(&self.top)).map(|workspace| workspace.smallest);
        let (ratio, place) = all.fold((1.0, 0), |least, one| if one.0 < least.0 { one } else { least });
        Ok((ratio, symbolic.ordering.forward().get(place as usize).copied().unwrap_or(0)))
    }

    fn factor_tasks(
        &mut self,
        symbolic: &Symbolic,
        parts: &[Part<'_>],
        constant: Option<&Multifrontal>,
        tasks: Range<usize>,
    ) -> Result<(), SolveError> {
        let (plan, starts, pivot_starts) = (&self.plan, &self.starts, &self.pivot_starts);
        let values = plan.split(&mut self.values, tasks.clone(), |front| starts[front]);
        let pivots = plan.split(&mut self.pivots, tasks.clone(), |front| pivot_starts[front]);
        let context = Context { symbolic, plan, parts, constant, tasks: &[], threads: 1 };
        let run = |task: &Task, workspace: &mut Workspace, values: &mut [f64], pivots: &mut [u32]| {
            workspace.clear();
            lengthen(&mut workspace.stack, workspace.size, WHAT)?;
            let (offset, pivot_offset) = (starts[task.first as usize], pivot_starts[task.first as usize]);
            for front in plan.fronts_of(task).map(|front| front as usize) {
                let values = &mut values[starts[front] - offset..starts[front + 1] - offset];
                let pivots = &mut pivots[pivot_starts[front] - pivot_offset..pivot_starts[front + 1] - pivot_offset];
                workspace.factor_front(&context, front, values, pivots)?;
            }
            shorten(&mut workspace.stack, symbolic.sizes(task.root as usize).1.pow(2));
            Ok(())
        };
        let (tasks, workspaces) = (&plan.tasks[tasks.clone()], &mut self.workspaces[tasks]);
        let outcomes: Vec<Result<(), SolveError>> = if self.threads > 1 {
            (tasks.par_iter(), workspaces.par_iter_mut(), values, pivots)
                .into_par_iter()
                .with_max_len(1)
                .map(|(task, workspace, values, pivots)| run(task, workspace, values, pivots))
                .collect()
        } else {
            let each = tasks.iter().zip(workspaces).zip(values).zip(pivots);
            each.map(|(((task, workspace), values), pivots)| run(task, workspace, values, pivots)).collect()
        };
        outcomes.into_iter().collect()
    }

    /// Eliminates fronts above the tasks.
    fn factor_top(
        &mut self,
        symbolic: &Symbolic,
        parts: &[Part<'_>],
        constant: Option<&Multifrontal>,
        fronts: Range<usize>,
    ) -> Result<(), SolveError> {
        let Self { plan, values, starts, pivots, pivot_starts, workspaces, top, threads, .. } = self;
        for front in plan.top[fronts].iter().map(|&front| front as usize) {
            let values = &mut values[starts[front]..starts[front + 1]];
            let pivots = &mut pivots[pivot_starts[front]..pivot_starts[front + 1]];
            let need = top.waiting.end() + symbolic.sizes(front).1.pow(2);
            lengthen(&mut top.stack, need, WHAT)?;
            let context = Context { symbolic, plan, parts, constant, tasks: workspaces, threads: *threads };
            top.factor_front(&context, front, values, pivots)?;
            for task in symbolic.children_of(front).iter().filter_map(|&child| plan.task_of(child)) {
                give_back(&mut workspaces[task].stack);
            }
            shorten(&mut top.stack, top.waiting.end());
        }
        Ok(())
    }
}

impl Workspace {
    fn new(extent: Extent) -> Result<Self, SolveError> {
        let Extent { stack, depth, columns: largest, .. } = extent;
        let memory = Work::of_lu::<f64>(largest, Par::Seq)
            .map_err(|_| refused_by_the_system(None, "work space of a sparse factorisation"))?;
        Ok(Self {
            stack: Vec::new(),
            size: stack,
            memory,
            waiting: Contributions::with_capacity(depth),
            inverse: vec![0; largest],
            largest_in_column: vec![0.0; largest],
            column: vec![0.0; largest],
            smallest: (1.0, 0),
        })
    }

    /// Forgets the factorisation before.
    fn clear(&mut self) {
        self.waiting.clear();
        self.smallest = (1.0, 0);
    }

    /// Assembles and eliminates one front; its contribution replaces those of its children on the stack.
    fn factor_front(
        &mut self,
        context: &Context<'_>,
        front: usize,
        values: &mut [f64],
        pivots: &mut [u32],
    ) -> Result<(), SolveError> {
        let symbolic = context.symbolic;
        let (k, r) = symbolic.sizes(front);
        let (panel, upper) = values.split_at_mut(k * (k + r));
        let (below, free) = self.stack.split_at_mut(self.waiting.end());
        let own = &mut free[..r * r];
        own.fill(0.0);
        let mut target = Front { panel, upper, own, k, r };
        for part in context.parts {
            for entry in part.map.of(front) {
                *target.entry(entry.row as usize, entry.column as usize) += part.values[entry.source as usize];
            }
        }
        for &child in symbolic.children_of(front) {
            let (child, places) = (child as usize, symbolic.places_of(child as usize));
            if let Some(constant) = context.constant.filter(|_| !context.plan.members[child]) {
                target.add_symmetric(constant.contribution(symbolic, child), places);
                continue;
            }
            let size = places.len() * places.len();
            let contribution = match self.waiting.start_of(child as u32) {
                Some(start) => &below[start..start + size],
                None => {
                    &context.tasks[context.plan.task_of(child as u32).expect("children are done first")].stack[..size]
                }
            };
            target.add_general(contribution, places);
        }
        let m = k + r;
        for (largest, column) in self.largest_in_column.iter_mut().zip(target.panel.chunks_exact(m)) {
            *largest = column.iter().fold(0.0, |largest, value| value.abs().max(largest));
        }
        let par = super::parallelism(context.threads, 2.0 * symbolic.operations(front));
        target.eliminate(pivots, &mut self.inverse[..k], &mut self.column[..k], par, &mut self.memory);
        self.check_pivots(symbolic, front, panel)?;
        self.keep_contribution(symbolic, front);
        Ok(())
    }

    fn check_pivots(&mut self, symbolic: &Symbolic, front: usize, panel: &[f64]) -> Result<(), SolveError> {
        let (k, r) = symbolic.sizes(front);
        for column in 0..k {
            let ratio = panel[column * (k + r) + column].abs() / self.largest_in_column[column];
            let place = symbolic.columns[front] + column as u32;
            if ratio.is_nan() || ratio <= VANISHING_PIVOT {
                let dof = symbolic.ordering.forward()[place as usize] as usize;
                return Err(SolveError::VanishingPivot { dof, ratio: if ratio.is_finite() { ratio } else { 0.0 } });
            }
            if ratio < self.smallest.0 {
                self.smallest = (ratio, place);
            }
        }
        Ok(())
    }

    /// Moves the contribution of the front from the end of the stack over those of its children.
    fn keep_contribution(&mut self, symbolic: &Symbolic, front: usize) {
        let r = symbolic.sizes(front).1;
        let (start, end) = (self.waiting.take_children(symbolic, front), self.waiting.end());
        if start < end {
            self.stack.copy_within(end..end + r * r, start);
        }
        self.waiting.push(front, start, r * r);
        if symbolic.parents[front] == INTERFACE {
            self.waiting.pop();
        }
    }
}

/// A front with k columns to eliminate and r rows below, each part by columns.
struct Front<'a> {
    /// F11 above F21, (k + r) x k.
    panel: &'a mut [f64],
    /// F12, k x r.
    upper: &'a mut [f64],
    /// F22, r x r.
    own: &'a mut [f64],
    k: usize,
    r: usize,
}

impl Front<'_> {
    fn entry(&mut self, row: usize, column: usize) -> &mut f64 {
        let Self { k, r, .. } = *self;
        match (row.checked_sub(k), column.checked_sub(k)) {
            (_, None) => &mut self.panel[column * (k + r) + row],
            (None, Some(column)) => &mut self.upper[column * k + row],
            (Some(row), Some(column)) => &mut self.own[column * r + row],
        }
    }

    /// Adds a full contribution, by columns; `places` increase.
    fn add_general(&mut self, contribution: &[f64], places: &[u32]) {
        let Self { k, r, .. } = *self;
        let (size, n_eliminated) = (places.len(), places.partition_point(|&place| (place as usize) < k));
        let (first, rest) = places.split_at(n_eliminated);
        for (&column, source) in places.iter().zip(contribution.chunks_exact(size.max(1))) {
            let column = column as usize;
            if column < k {
                let target = &mut self.panel[column * (k + r)..(column + 1) * (k + r)];
                places.iter().zip(source).for_each(|(&row, value)| target[row as usize] += value);
                continue;
            }
            let (above, below) = source.split_at(n_eliminated);
            let target = &mut self.upper[(column - k) * k..(column - k + 1) * k];
            first.iter().zip(above).for_each(|(&row, value)| target[row as usize] += value);
            let target = &mut self.own[(column - k) * r..(column - k + 1) * r];
            rest.iter().zip(below).for_each(|(&row, value)| target[row as usize - k] += value);
        }
    }

    /// Adds a symmetric contribution of which the lower half is given, as in [`packed`].
    fn add_symmetric(&mut self, contribution: &[f64], places: &[u32]) {
        for (column, &target) in places.iter().enumerate() {
            let values = &contribution[packed::column(places.len(), column)];
            for (&row, value) in places[column..].iter().zip(values) {
                *self.entry(row as usize, target as usize) += value;
            }
            for (&row, value) in places[column + 1..].iter().zip(&values[1..]) {
                *self.entry(target as usize, row as usize) += value;
            }
        }
    }

    /// LU of the panel, then the upper part, then the contribution. `column` holds k numbers for a while.
    fn eliminate(&mut self, pivots: &mut [u32], inverse: &mut [u32], column: &mut [f64], par: Par, memory: &mut Work) {
        let Self { k, r, .. } = *self;
        let (mut top, mut bottom) = MatMut::from_column_major_slice_mut(self.panel, k + r, k).split_at_row_mut(k);
        f64::lu(top.rb_mut(), pivots, inverse, par, memory);
        if r == 0 {
            return;
        }
        for target in self.upper.chunks_exact_mut(k) {
            column.copy_from_slice(target);
            target.iter_mut().zip(pivots.iter()).for_each(|(value, &row)| *value = column[row as usize]);
        }
        let mut upper = MatMut::from_column_major_slice_mut(self.upper, k, r);
        solve_unit_lower(top.rb(), upper.rb_mut(), par);
        // L21 U11 = F21, transposed to a lower triangle.
        f64::solve_lower(top.rb().transpose(), bottom.rb_mut().transpose_mut(), par);
        let own = MatMut::from_column_major_slice_mut(self.own, r, r);
        f64::product(own, Accum::Add, bottom.rb(), upper.rb(), -1.0, par);
    }
}
