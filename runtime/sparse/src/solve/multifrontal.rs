//! Multifrontal Cholesky factorisation `P A Pᵀ = L Lᵀ`, whole or up to an interface.
//!
//! With unknowns split into eliminated (I) and interface (G) ones,
//!
//! ```text
//! [K_II K_IG]   [L_II      ] [L_IIᵀ L_GIᵀ]
//! [K_GI K_GG] = [L_GI   1  ] [      S    ]     S = K_GG - K_GI K_II⁻¹ K_IG
//! ```
//!
//! the factorisation gives L_II, L_GI and the dense S in one pass over the fronts of [`Symbolic`]; dense work goes to
//! faer's kernels. Independent subtrees run in parallel.
//!
//! Promises: a second factorisation reuses all memory; the same bytes for any number of threads; a matrix that is not
//! positive definite is refused with the dof at which this was seen, in the caller's numbering.
//! Reads one half of the matrix and checks neither symmetry nor finiteness nor condition: `checked` does.

use std::ops::Range;

use rayon::prelude::*;
use wfl_dense::{Accum, MatMut, Par, Real, Reborrow, ReborrowMut, Work, lower_product};

use super::SolveError;
use super::contributions::{Contributions, Extent, WHAT, give_back, shorten, stacks};
use super::packed;
use super::scaling::power_of_two;
use super::symbolic::{Batch, INTERFACE, Plan, Symbolic, Task};
use wfl_host::memory::{claim_numbers, lengthen, refused_by_the_system, zeros};

/// A factorisation of the members of a plan: everything before the interface, or all fronts that never change.
pub(super) struct Multifrontal {
    plan: Plan,
    batches: Vec<Batch>,
    values: Values,
    /// Start of each panel in the values, and the end.
    panels: Vec<usize>,
    workspaces: Vec<Workspace>,
    top: Workspace,
    threads: usize,
}

/// The panels of all fronts (those that take no part stay zero).
enum Values {
    Double(Vec<f64>),
    /// For triangular solves alone.
    Single {
        rounded: Vec<f32>,
        /// What they have been multiplied with, a power of two.
        scale: f64,
    },
}

/// The panel of a front: its columns of L, (columns + rows) x columns, by columns.
#[derive(Debug, Clone, Copy)]
pub(super) enum Panel<'a> {
    Double(&'a [f64]),
    Single(&'a [f32]),
}

/// Memory of one task: contributions of fronts whose parent has not come yet, last in first out.
struct Workspace {
    stack: Vec<f64>,
    /// Numbers on the stack, at most.
    size: usize,
    memory: Work,
    waiting: Contributions,
}

/// What every front of one factorisation needs.
struct Context<'a> {
    symbolic: &'a Symbolic,
    plan: &'a Plan,
    matrix_values: &'a [f64],
    /// Contributions of finished tasks; empty inside a task.
    tasks: &'a [Workspace],
    threads: usize,
}

impl Multifrontal {
    /// Takes the memory for the fronts in `members`, which holds every front below a member.
    pub(super) fn new(symbolic: &Symbolic, members: Vec<bool>, threads: usize) -> Result<Self, SolveError> {
        let plan = symbolic.plan(members, |front| symbolic.operations(front));
        let extent = |fronts: &mut dyn Iterator<Item = u32>| Extent::new(symbolic, fronts, packed::length);
        let extents: Vec<Extent> = plan.tasks.iter().map(|task| extent(&mut plan.fronts_of(task))).collect();
        let of_top = extent(&mut plan.top.iter().copied());
        let mut panels = vec![0];
        for front in 0..symbolic.n_fronts() {
            let (k, r) = symbolic.sizes(front);
            panels.push(panels[front] + if plan.members[front] { k * (k + r) } else { 0 });
        }
        let threads = super::worthwhile_threads(threads, plan.cost);
        let whole: Vec<usize> = extents.iter().map(|extent| extent.stack).collect();
        let batches = plan.batches(symbolic, threads, packed::length);
        let stacks = stacks(symbolic, &plan, &batches, threads, &whole, packed::length);
        claim_numbers((panels[symbolic.n_fronts()] + stacks) as u64, "the factor of the matrix")?;
        let workspaces = extents.into_iter().map(Workspace::new).collect::<Result<_, _>>()?;
        let top = Workspace::new(of_top)?;
        let values = Values::Double(zeros(panels[symbolic.n_fronts()], "the factor of the matrix")?);
        Ok(Self { plan, batches, values, panels, workspaces, top, threads })
    }

    /// The panel of a member.
    pub(super) fn panel(&self, front: usize) -> Panel<'_> {
        let range = self.panels[front]..self.panels[front + 1];
        match &self.values {
            Values::Double(values) => Panel::Double(&values[range]),
            Values::Single { rounded, .. } => Panel::Single(&rounded[range]),
        }
    }

    /// The panels are those of the factor of the matrix times this power of four.
    pub(super) fn scale(&self) -> f64 {
        match &self.values {
            Values::Double(_) => 1.0,
            Values::Single { scale, .. } => scale * scale,
        }
    }

    /// Rounds the factor to single precision, with its largest pivot brought to about 1: half the memory, and half the
    /// time of a triangular solve.
    pub(super) fn narrow(&mut self, symbolic: &Symbolic) -> Result<(), SolveError> {
        let Values::Double(values) = &self.values else { return Ok(()) };
        let mut largest = 0.0f64;
        for front in (0..symbolic.n_fronts()).filter(|&front| self.plan.members[front]) {
            let (k, r) = symbolic.sizes(front);
            let panel = &values[self.panels[front]..self.panels[front + 1]];
            largest = (0..k).map(|column| panel[column * (k + r) + column]).fold(largest, f64::max);
        }
        let scale = if largest > 0.0 { power_of_two(1.0 / largest) } else { 1.0 };
        let mut rounded = zeros::<f32>(values.len(), "values of a sparse factor of single precision")?;
        rounded.iter_mut().zip(values).for_each(|(rounded, value)| *rounded = (value * scale) as f32);
        self.values = Values::Single { rounded, scale };
        Ok(())
    }

    /// The contribution of a member whose parent takes no part: rows x rows, lower half as in [`packed`].
    pub(super) fn contribution(&self, symbolic: &Symbolic, front: usize) -> &[f64] {
        let (workspace, start) = match self.plan.task_of(front as u32) {
            Some(task) => (&self.workspaces[task], 0),
            None => {
                let start = self.top.waiting.start_of(front as u32);
                (&self.top, start.expect("contributions outside the plan wait"))
            }
        };
        &workspace.stack[start..start + left_by(symbolic, front)]
    }

    /// Factors the matrix with these values. `interface` receives S by columns, lower half only; its length is the
    /// square of the number of interface unknowns.
    pub(super) fn factor(
        &mut self,
        symbolic: &Symbolic,
        matrix_values: &[f64],
        interface: &mut [f64],
    ) -> Result<(), SolveError> {
        let n_interface = symbolic.n_interface();
        assert!(interface.len() == n_interface * n_interface, "room for the interface matrix");
        let Values::Double(values) = &mut self.values else { panic!("a factor that was rounded is not made again") };
        let mut values = std::mem::take(values);
        values.fill(0.0);
        scatter_interface(symbolic, matrix_values, interface);
        self.top.waiting.clear();
        let outcome = self.batches.clone().into_iter().try_for_each(|batch| {
            self.factor_tasks(symbolic, matrix_values, &mut values, batch.tasks.clone())?;
            self.factor_top(symbolic, matrix_values, &mut values, interface, batch)
        });
        self.values = Values::Double(values);
        outcome
    }

    fn factor_tasks(
        &mut self,
        symbolic: &Symbolic,
        matrix_values: &[f64],
        values: &mut [f64],
        tasks: Range<usize>,
    ) -> Result<(), SolveError> {
        let (plan, starts) = (&self.plan, &self.panels);
        let panels = plan.split(values, tasks.clone(), |front| starts[front]);
        let context = Context { symbolic, plan, matrix_values, tasks: &[], threads: 1 };
        let run = |task: &Task, workspace: &mut Workspace, panels: &mut [f64]| {
            workspace.waiting.clear();
            lengthen(&mut workspace.stack, workspace.size, WHAT)?;
            workspace.factor_subtree(&context, task, starts, panels)?;
            shorten(&mut workspace.stack, left_by(symbolic, task.root as usize));
            Ok(())
        };
        let (tasks, workspaces) = (&plan.tasks[tasks.clone()], &mut self.workspaces[tasks]);
        let outcomes: Vec<Result<(), SolveError>> = if self.threads > 1 {
            (tasks.par_iter(), workspaces.par_iter_mut(), panels)
                .into_par_iter()
                .with_max_len(1)
                .map(|(task, workspace, panels)| run(task, workspace, panels))
                .collect()
        } else {
            let each = tasks.iter().zip(workspaces).zip(panels);
            each.map(|((task, workspace), panels)| run(task, workspace, panels)).collect()
        };
        // The first failure in the order of elimination, for any order of the threads.
        outcomes.into_iter().collect()
    }

    /// Eliminates the fronts above the tasks of a batch and adds everything that reaches the interface, in the order of
    /// the fronts, whatever the batches.
    fn factor_top(
        &mut self,
        symbolic: &Symbolic,
        matrix_values: &[f64],
        values: &mut [f64],
        interface: &mut [f64],
        batch: Batch,
    ) -> Result<(), SolveError> {
        let Self { plan, panels, workspaces, top, .. } = self;
        let n_interface = symbolic.n_interface();
        let mut tasks = batch.tasks.peekable();
        let add_task = |task: usize, workspaces: &mut [Workspace], interface: &mut [f64]| {
            let root = plan.tasks[task].root as usize;
            if symbolic.parents[root] == INTERFACE {
                let contribution = &workspaces[task].stack[..left_by(symbolic, root)];
                add_to_interface(contribution, symbolic.places_of(root), interface, n_interface);
                give_back(&mut workspaces[task].stack);
            }
        };
        for &front in &plan.top[batch.top] {
            while let Some(task) = tasks.next_if(|&task| plan.tasks[task].root < front) {
                add_task(task, workspaces, interface);
            }
            let front = front as usize;
            let panel = &mut values[panels[front]..panels[front + 1]];
            let context = Context { symbolic, plan, matrix_values, tasks: workspaces, threads: self.threads };
            let need = top.waiting.end() + left_by(symbolic, front);
            lengthen(&mut top.stack, need, WHAT)?;
            top.factor_front(&context, front, panel)?;
            for task in symbolic.children_of(front).iter().filter_map(|&child| plan.task_of(child)) {
                give_back(&mut workspaces[task].stack);
            }
            if symbolic.parents[front] == INTERFACE {
                let contribution = top.pop();
                add_to_interface(contribution, symbolic.places_of(front), interface, n_interface);
            }
            shorten(&mut top.stack, top.waiting.end());
        }
        tasks.for_each(|task| add_task(task, workspaces, interface));
        Ok(())
    }

    /// Gives back the memory that only a further factorisation needs, and the contributions with it.
    pub(super) fn finish(&mut self) {
        for workspace in self.workspaces.iter_mut().chain([&mut self.top]) {
            workspace.waiting.clear();
            workspace.stack = Vec::new();
        }
    }

    /// The smallest ratio of a squared pivot to the diagonal entry that it came from, with its dof: how much of the
    /// stiffest-looking unknown is left after elimination. Near rounding the matrix is singular. `None` without
    /// unknowns. `diagonal` is by dof.
    pub(super) fn smallest_pivot_ratio(&self, symbolic: &Symbolic, diagonal: &[f64]) -> Option<(f64, u32)> {
        let mut smallest: Option<(f64, u32)> = None;
        for front in (0..symbolic.n_fronts()).filter(|&front| self.plan.members[front]) {
            let (k, r) = symbolic.sizes(front);
            for column in 0..k {
                let dof = symbolic.ordering.forward()[symbolic.columns[front] as usize + column];
                let pivot = self.panel(front).at(column * (k + r) + column);
                let ratio = pivot * pivot / diagonal[dof as usize];
                if smallest.is_none_or(|(least, _)| ratio < least) {
                    smallest = Some((ratio, dof));
                }
            }
        }
        smallest
    }
}

impl Panel<'_> {
    fn at(self, place: usize) -> f64 {
        match self {
            Panel::Double(values) => values[place],
            Panel::Single(values) => f64::from(values[place]),
        }
    }
}

impl Workspace {
    fn new(extent: Extent) -> Result<Self, SolveError> {
        let memory = Work::of_cholesky::<f64>(extent.columns, Par::Seq)
            .map_err(|_| refused_by_the_system(None, "work space of a sparse factorisation"))?;
        let waiting = Contributions::with_capacity(extent.depth);
        Ok(Self { stack: Vec::new(), size: extent.stack, memory, waiting })
    }

    /// Takes the last contribution off the stack; it stays readable until the next front.
    fn pop(&mut self) -> &[f64] {
        &self.stack[self.waiting.pop()]
    }

    fn factor_subtree(
        &mut self,
        context: &Context<'_>,
        task: &Task,
        starts: &[usize],
        panels: &mut [f64],
    ) -> Result<(), SolveError> {
        let offset = starts[task.first as usize];
        for front in context.plan.fronts_of(task).map(|front| front as usize) {
            self.factor_front(context, front, &mut panels[starts[front] - offset..starts[front + 1] - offset])?;
        }
        Ok(())
    }

    /// Assembles and eliminates one front; its contribution replaces those of its children on the stack.
    fn factor_front(&mut self, context: &Context<'_>, front: usize, panel: &mut [f64]) -> Result<(), SolveError> {
        let symbolic = context.symbolic;
        let (k, r) = symbolic.sizes(front);
        let (below, free) = self.stack.split_at_mut(self.waiting.end());
        let left = packed::length(r);
        let own = &mut free[..left];
        let waiting = &self.waiting;
        let children = || {
            symbolic.children_of(front).iter().map(|&child| {
                let contribution = match waiting.start_of(child) {
                    Some(start) => &below[start..start + left_by(symbolic, child as usize)],
                    None => context.finished(child),
                };
                (contribution, symbolic.places_of(child as usize))
            })
        };
        let par = super::parallelism(context.threads, symbolic.operations(front));
        scatter_front(symbolic, front, context.matrix_values, panel);
        for (contribution, places) in children() {
            add_to_columns(contribution, places, panel, k, k + r);
        }
        eliminate(panel, own, k, par, &mut self.memory).map_err(|column| {
            let dof = symbolic.ordering.forward()[symbolic.columns[front] as usize + column];
            SolveError::NotPositiveDefinite { dof: dof as usize, pivot: f64::NAN }
        })?;
        for (contribution, places) in children() {
            add_to_rows(contribution, places, own, k, |column| packed::column(r, column));
        }
        let (start, end) = (self.waiting.take_children(symbolic, front), self.waiting.end());
        if start < end {
            self.stack.copy_within(end..end + left, start);
        }
        self.waiting.push(front, start, left);
        Ok(())
    }
}

impl Context<'_> {
    /// The contribution of the root of a finished task.
    fn finished(&self, root: u32) -> &[f64] {
        let task = self.plan.task_of(root).expect("children are done first");
        &self.tasks[task].stack[..left_by(self.symbolic, root as usize)]
    }
}

/// Number of values of the contribution that a front leaves.
fn left_by(symbolic: &Symbolic, front: usize) -> usize {
    packed::length(symbolic.sizes(front).1)
}

/// Adds the entries of the matrix in the columns of a front to its zeroed panel.
fn scatter_front(symbolic: &Symbolic, front: usize, matrix_values: &[f64], panel: &mut [f64]) {
    let (k, r) = symbolic.sizes(front);
    let (first, rows) = (symbolic.columns[front], symbolic.rows_of(front));
    for (column, target) in panel.chunks_exact_mut(k + r).enumerate() {
        let mut below = 0;
        for entry in symbolic.lower_entries(first as usize + column) {
            let row = symbolic.lower_rows[entry];
            let place = if row < first + k as u32 {
                (row - first) as usize
            } else {
                // Both lists increase.
                while rows[below] != row {
                    below += 1;
                }
                k + below
            };
            target[place] += matrix_values[symbolic.lower_sources[entry] as usize];
        }
    }
}

/// Cholesky of the columns of a front; `own` becomes the lower half, as in [`packed`], of minus the product of the rows
/// below. An error is the column whose pivot is not positive.
fn eliminate(panel: &mut [f64], own: &mut [f64], k: usize, par: Par, memory: &mut Work) -> Result<(), usize> {
    let m = panel.len() / k;
    let (mut top, mut bottom) = MatMut::from_column_major_slice_mut(panel, m, k).split_at_row_mut(k);
    f64::cholesky(top.rb_mut(), par, memory)?;
    if m == k {
        return Ok(());
    }
    f64::solve_lower(top.rb(), bottom.rb_mut().transpose_mut(), par);
    for block in packed::blocks(m - k) {
        let target = MatMut::from_column_major_slice_mut(&mut own[block.range()], block.rows, block.columns);
        let (diagonal, rest) = target.split_at_row_mut(block.columns);
        let (beside, below) = bottom.rb().split_at_row(block.first).1.split_at_row(block.columns);
        lower_product(diagonal, Accum::Replace, beside, beside.transpose(), par);
        if below.nrows() > 0 {
            f64::product(rest, Accum::Replace, below, beside.transpose(), -1.0, par);
        }
    }
    Ok(())
}

/// Adds those columns of a child's contribution that are columns of the parent. Only the lower half is kept, and
/// `places` increase, so a column starts at its own diagonal.
pub(super) fn add_to_columns(contribution: &[f64], places: &[u32], panel: &mut [f64], k: usize, m: usize) {
    let size = places.len();
    for (column, &place) in places.iter().enumerate().take_while(|&(_, &place)| (place as usize) < k) {
        let target = &mut panel[place as usize * m..(place as usize + 1) * m];
        let source = &contribution[packed::column(size, column)];
        for (&row, value) in places[column..].iter().zip(source) {
            target[row as usize] += value;
        }
    }
}

/// Adds the remaining columns of a child's contribution to those of the parent; `lies` says where one of them lies, from
/// its diagonal down.
pub(super) fn add_to_rows(
    contribution: &[f64],
    places: &[u32],
    own: &mut [f64],
    k: usize,
    lies: impl Fn(usize) -> Range<usize>,
) {
    let size = places.len();
    let first = places.partition_point(|&place| (place as usize) < k);
    for column in first..size {
        let place = places[column] as usize;
        let target = &mut own[lies(place - k)];
        let source = &contribution[packed::column(size, column)];
        for (&row, value) in places[column..].iter().zip(source) {
            target[row as usize - place] += value;
        }
    }
}

/// The entries of the matrix between interface unknowns, lower half by columns.
fn scatter_interface(symbolic: &Symbolic, matrix_values: &[f64], interface: &mut [f64]) {
    let (first, n) = (symbolic.n_eliminated(), symbolic.n_interface());
    interface.fill(0.0);
    for column in 0..n {
        for entry in symbolic.lower_entries(first + column) {
            let row = symbolic.lower_rows[entry] as usize - first;
            interface[column * n + row] += matrix_values[symbolic.lower_sources[entry] as usize];
        }
    }
}

/// Adds a contribution to the dense matrix of the interface, lower half.
fn add_to_interface(contribution: &[f64], places: &[u32], interface: &mut [f64], n: usize) {
    add_to_rows(contribution, places, interface, 0, |column| column * (n + 1)..(column + 1) * n);
}

#[cfg(test)]
mod tests {
    use super::super::problems::{BoxOptions, ElasticBox};
    use super::*;

    /// Dense Cholesky in the order of elimination, stopped before the interface, written from the definition.
    fn partial_cholesky(problem: &ElasticBox, symbolic: &Symbolic) -> Vec<Vec<f64>> {
        let order = symbolic.ordering.forward();
        let entry = |i: usize, j: usize| problem.matrix.get(order[i] as usize, order[j] as usize);
        let n = order.len();
        let mut a: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
        for k in 0..symbolic.n_eliminated() {
            let pivot = a[k][k].sqrt();
            let column: Vec<f64> = (0..n).map(|i| a[i][k] / pivot).collect();
            for i in k + 1..n {
                a[i][k] = column[i];
                (k + 1..n).for_each(|j| a[i][j] -= column[i] * column[j]);
            }
            a[k][k] = pivot;
        }
        a
    }

    #[test]
    fn factor_and_interface_matrix_match_the_definition() {
        let problem = ElasticBox::new(&BoxOptions { cells: [4, 3, 3], cut: Some(2), fix_low: true, fix_high: false });
        for points in [None, Some(&problem.coordinates[..])] {
            let symbolic = Symbolic::new(problem.matrix.pattern(), points, &problem.interface).unwrap();
            let wanted = partial_cholesky(&problem, &symbolic);
            let (n, first) = (symbolic.n_interface(), symbolic.n_eliminated());
            for threads in [1, 2] {
                let mut numeric = Multifrontal::new(&symbolic, vec![true; symbolic.n_fronts()], threads).unwrap();
                let mut interface = vec![0.0; n * n];
                // Twice: nothing may be left over from the first time.
                for _ in 0..2 {
                    numeric.factor(&symbolic, problem.matrix.values(), &mut interface).unwrap();
                }
                for column in 0..n {
                    for row in column..n {
                        let difference = interface[column * n + row] - wanted[first + row][first + column];
                        assert!(difference.abs() < 1e-12, "({row}, {column}): {difference:e}");
                    }
                }
                for front in 0..symbolic.n_fronts() {
                    let (k, r) = symbolic.sizes(front);
                    for column in 0..k {
                        let j = symbolic.columns[front] as usize + column;
                        for (place, &row) in symbolic.rows_of(front).iter().enumerate() {
                            let value = numeric.panel(front).at(column * (k + r) + k + place);
                            assert!((value - wanted[row as usize][j]).abs() < 1e-12);
                        }
                    }
                }
            }
        }
    }
}
