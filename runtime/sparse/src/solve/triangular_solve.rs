//! Triangular solves with the fronts of a factorisation: forward substitution up the tree, backward substitution down.
//!
//! Promises: no allocation; the same bytes for any number of threads, because independent subtrees write disjoint
//! ranges and pass their contributions upwards in one fixed order. Handles fronts of LLT, LDLT and LU, also in one tree.

use rayon::prelude::*;

use super::contributions::{Contributions, Extent};
use super::multifrontal::Panel;
use super::symbolic::{INTERFACE, Plan, Symbolic, Task};
use wfl_dense::Real;
use wfl_dense::sweeps::{Diagonal, divide_by_pivots, subtract_product, subtract_transposed_product};

/// Below this number of values of the factor, a triangular solve costs less than waking threads.
const PARALLEL_VALUES: f64 = 5e5;

/// The factor of one front.
#[derive(Debug, Clone, Copy)]
pub(super) enum FrontFactor<'a> {
    /// `panel` holds L, (k + r) x k.
    Cholesky {
        /// By columns.
        panel: Panel<'a>,
    },
    /// `panel` holds L (unit diagonal) and U of the top, (k + r) x k, `upper` the rest of U, k x r; row i of the
    /// factored top is row `pivots[i]` of the front.
    Lu {
        /// By columns.
        panel: &'a [f64],
        /// By columns.
        upper: &'a [f64],
        /// Rows of the front in the order of the pivots.
        pivots: &'a [u32],
    },
    /// `panel` holds L (unit diagonal), (k + r) x k, with D on its diagonal; column i is column `pivots[i]` in the order of
    /// elimination.
    Ldlt {
        /// By columns.
        panel: &'a [f64],
        /// Entry of D beside its diagonal, at the first column of a pivot of two.
        beside: &'a [f64],
        /// Columns in the order of the pivots.
        pivots: &'a [u32],
        /// First column of the front.
        first: u32,
    },
}

/// Which system is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Transpose {
    /// `A x = b`.
    No,
    /// `Aᵀ x = b`.
    Yes,
}

impl Transpose {
    /// What a system is solved with where its transposed has been factored.
    pub(super) fn flipped(self) -> Self {
        match self {
            Self::No => Self::Yes,
            Self::Yes => Self::No,
        }
    }
}

/// Work space of the substitutions over all fronts of a structure.
pub(super) struct TriangularSolve {
    plan: Plan,
    columns: Vec<usize>,
    workspaces: Vec<Workspace>,
    /// What lies above the tasks, tree by tree.
    tops: Vec<Top>,
    /// The vector in the order of elimination.
    ordered: Vec<f64>,
    /// A copy of it that tasks read while they write their own parts.
    shared: Vec<f64>,
    parallel: bool,
}

/// The fronts of one tree above its tasks.
struct Top {
    /// Increasing; the last one is the root.
    fronts: Vec<u32>,
    workspace: Workspace,
}

struct Workspace {
    stack: Vec<f64>,
    waiting: Contributions,
    /// The pivots, or the rows, of one front.
    front: Vec<f64>,
}

impl TriangularSolve {
    /// Work space for the fronts in `members`: all of them, or every front above some.
    pub(super) fn new(symbolic: &Symbolic, members: Vec<bool>, threads: usize) -> Self {
        let cost = |front: usize| {
            let (k, r) = symbolic.sizes(front);
            (k * (k + 2 * r)) as f64
        };
        let plan = symbolic.plan(members, cost);
        let parallel = threads > 1 && plan.cost > PARALLEL_VALUES;
        let workspaces = plan.tasks.iter().map(|task| Workspace::new(symbolic, plan.fronts_of(task))).collect();
        let n = symbolic.ordering.forward().len();
        Self {
            tops: plan.tops(symbolic).into_iter().map(|fronts| Top::new(symbolic, fronts)).collect(),
            columns: symbolic.columns.iter().map(|&column| column as usize).collect(),
            plan,
            workspaces,
            ordered: vec![0.0; n],
            shared: vec![0.0; n],
            parallel,
        }
    }

    /// Solves in place; `x` is by dof. Between the substitutions `interface` solves for the unknowns that were not eliminated.
    /// Where not all fronts are members, the right-hand side must vanish on the others, and the solution is found on
    /// the members alone.
    pub(super) fn solve<'f>(
        &mut self,
        symbolic: &Symbolic,
        factor: impl Fn(usize) -> FrontFactor<'f> + Sync,
        transpose: Transpose,
        interface: impl FnOnce(&mut [f64]),
        x: &mut [f64],
    ) {
        for (value, &dof) in self.ordered.iter_mut().zip(symbolic.ordering.forward()) {
            *value = x[dof as usize];
        }
        self.forward(symbolic, &factor, transpose);
        interface(&mut self.ordered[symbolic.n_eliminated()..]);
        self.backward(symbolic, &factor, transpose);
        for (value, &dof) in self.ordered.iter().zip(symbolic.ordering.forward()) {
            x[dof as usize] = *value;
        }
    }

    /// Forward substitution with a Cholesky factor, from a right-hand side by dof; where not all fronts are members it must
    /// vanish on the others.
    pub(super) fn substitute_forward<'f>(
        &mut self,
        symbolic: &Symbolic,
        factor: impl Fn(usize) -> FrontFactor<'f> + Sync,
        b: &[f64],
    ) {
        for (value, &dof) in self.ordered.iter_mut().zip(symbolic.ordering.forward()) {
            *value = b[dof as usize];
        }
        self.forward(symbolic, &factor, Transpose::No);
    }

    /// Starts from the forward substitution of another.
    pub(super) fn copy_forward(&mut self, other: &TriangularSolve) {
        self.ordered.copy_from_slice(&other.ordered);
    }

    /// Adds the forward substitution of another.
    pub(super) fn add_forward(&mut self, forward: &TriangularSolve) {
        self.ordered.iter_mut().zip(&forward.ordered).for_each(|(value, other)| *value += other);
    }

    /// Backward substitution from there. The solution comes by dof, on the members alone.
    pub(super) fn substitute_backward<'f>(
        &mut self,
        symbolic: &Symbolic,
        factor: impl Fn(usize) -> FrontFactor<'f> + Sync,
        x: &mut [f64],
    ) {
        self.backward(symbolic, &factor, Transpose::No);
        for (value, &dof) in self.ordered.iter().zip(symbolic.ordering.forward()) {
            x[dof as usize] = *value;
        }
    }

    fn forward<'f>(
        &mut self,
        symbolic: &Symbolic,
        factor: &(impl Fn(usize) -> FrontFactor<'f> + Sync),
        transpose: Transpose,
    ) {
        let (plan, columns) = (&self.plan, &self.columns);
        let parts = plan.split(&mut self.ordered, 0..plan.tasks.len(), |front| columns[front]);
        let run = |workspace: &mut Workspace, (task, x): (&Task, &mut [f64])| {
            workspace.waiting.clear();
            let offset = columns[task.first as usize];
            for front in plan.fronts_of(task).map(|front| front as usize) {
                let own = &mut x[columns[front] - offset..columns[front + 1] - offset];
                workspace.forward_front(symbolic, front, factor(front), transpose, own, |child| {
                    assert!(!plan.members[child as usize], "children are done first");
                    &[]
                });
            }
        };
        each(self.parallel, &mut self.workspaces, plan.tasks.iter().zip(parts).collect(), run);
        let (fronts, interface) = self.ordered.split_at_mut(symbolic.n_eliminated());
        let workspaces = &self.workspaces;
        let finished = |child: u32| {
            if !plan.members[child as usize] {
                return &[][..];
            }
            let task = plan.task_of(child).expect("children are done first");
            &workspaces[task].stack[..symbolic.sizes(child as usize).1]
        };
        let run = |Top { fronts, workspace }: &mut Top, (offset, x): (usize, &mut [f64])| {
            workspace.waiting.clear();
            for front in fronts.iter().map(|&front| front as usize) {
                let own = &mut x[columns[front] - offset..columns[front + 1] - offset];
                workspace.forward_front(symbolic, front, factor(front), transpose, own, finished);
            }
        };
        let parts = split_by_tree(&self.tops, columns, fronts);
        each(self.parallel, &mut self.tops, parts, run);
        let mut reach_interface = |front: usize, contribution: &[f64]| {
            for (&place, value) in symbolic.places_of(front).iter().zip(contribution) {
                interface[place as usize] += value;
            }
        };
        for task in plan.tasks.iter().filter(|task| symbolic.parents[task.root as usize] == INTERFACE) {
            reach_interface(task.root as usize, finished(task.root));
        }
        for top in &mut self.tops {
            let root = top.root();
            if symbolic.parents[root] == INTERFACE {
                reach_interface(root, top.workspace.pop());
            }
        }
    }

    fn backward<'f>(
        &mut self,
        symbolic: &Symbolic,
        factor: &(impl Fn(usize) -> FrontFactor<'f> + Sync),
        transpose: Transpose,
    ) {
        let (plan, columns) = (&self.plan, &self.columns);
        let (fronts, interface) = self.ordered.split_at_mut(symbolic.n_eliminated());
        let interface = &*interface;
        let n_eliminated = symbolic.n_eliminated();
        let run = |Top { fronts, workspace }: &mut Top, (begin, x): (usize, &mut [f64])| {
            for front in fronts.iter().rev().map(|&front| front as usize) {
                let (own, above) = x[columns[front] - begin..].split_at_mut(columns[front + 1] - columns[front]);
                let offset = columns[front + 1];
                let read =
                    |row: usize| if row < n_eliminated { above[row - offset] } else { interface[row - n_eliminated] };
                workspace.backward_front(symbolic, front, factor(front), transpose, own, read);
            }
        };
        let parts = split_by_tree(&self.tops, columns, fronts);
        each(self.parallel, &mut self.tops, parts, run);
        self.shared.copy_from_slice(&self.ordered);
        let shared = &self.shared;
        let parts = plan.split(&mut self.ordered, 0..plan.tasks.len(), |front| columns[front]);
        let run = |workspace: &mut Workspace, (task, x): (&Task, &mut [f64])| {
            let (begin, end) = (columns[task.first as usize], columns[task.root as usize + 1]);
            for front in plan.fronts_of(task).rev().map(|front| front as usize) {
                let (own, above) = x[columns[front] - begin..].split_at_mut(columns[front + 1] - columns[front]);
                let offset = columns[front + 1];
                let read = |row: usize| if row < end { above[row - offset] } else { shared[row] };
                workspace.backward_front(symbolic, front, factor(front), transpose, own, read);
            }
        };
        each(self.parallel, &mut self.workspaces, plan.tasks.iter().zip(parts).collect(), run);
    }
}

/// Runs each owner on its part, on several threads or one after the other.
fn each<W: Send, P: Send>(parallel: bool, owners: &mut [W], parts: Vec<P>, run: impl Fn(&mut W, P) + Sync) {
    if parallel {
        (owners, parts).into_par_iter().with_max_len(1).for_each(|(owner, part)| run(owner, part));
    } else {
        owners.iter_mut().zip(parts).for_each(|(owner, part)| run(owner, part));
    }
}

/// The unknowns of each tree, with the number of the first one; those of other trees may lie before them.
fn split_by_tree<'x>(tops: &[Top], columns: &[usize], mut x: &'x mut [f64]) -> Vec<(usize, &'x mut [f64])> {
    let mut done = 0;
    let part = |top: &Top| {
        let end = columns[top.root() + 1];
        let (part, rest) = std::mem::take(&mut x).split_at_mut(end - done);
        x = rest;
        (std::mem::replace(&mut done, end), part)
    };
    tops.iter().map(part).collect()
}

impl Top {
    fn new(symbolic: &Symbolic, fronts: Vec<u32>) -> Self {
        Self { workspace: Workspace::new(symbolic, fronts.iter().copied()), fronts }
    }

    fn root(&self) -> usize {
        self.fronts[self.fronts.len() - 1] as usize
    }
}

impl Workspace {
    fn new(symbolic: &Symbolic, fronts: impl Iterator<Item = u32>) -> Self {
        let Extent { stack, depth, columns, rows } = Extent::new(symbolic, fronts, |r| r);
        let (stack, front) = (vec![0.0; stack], vec![0.0; columns.max(rows)]);
        Self { stack, waiting: Contributions::with_capacity(depth), front }
    }

    fn pop(&mut self) -> &[f64] {
        &self.stack[self.waiting.pop()]
    }

    /// Adds what the children left, eliminates the columns of the front, leaves what its rows get.
    fn forward_front<'c>(
        &mut self,
        symbolic: &Symbolic,
        front: usize,
        factor: FrontFactor<'_>,
        transpose: Transpose,
        x: &mut [f64],
        finished: impl Fn(u32) -> &'c [f64],
    ) {
        let (k, r) = symbolic.sizes(front);
        let (below, free) = self.stack.split_at_mut(self.waiting.end());
        let own = &mut free[..r];
        own.fill(0.0);
        for &child in symbolic.children_of(front) {
            let contribution = match self.waiting.start_of(child) {
                Some(start) => &below[start..start + symbolic.sizes(child as usize).1],
                None => finished(child),
            };
            for (&place, value) in symbolic.places_of(child as usize).iter().zip(contribution) {
                let place = place as usize;
                *(if place < k { &mut x[place] } else { &mut own[place - k] }) += value;
            }
        }
        match (factor, transpose) {
            (FrontFactor::Cholesky { panel: Panel::Double(l) }, _) => f64::lower_solve(l, Diagonal::Stored, x, own),
            (FrontFactor::Cholesky { panel: Panel::Single(l) }, _) => f32::lower_solve(l, Diagonal::Stored, x, own),
            (FrontFactor::Lu { panel, pivots, .. }, Transpose::No) => {
                let permuted = &mut self.front[..k];
                for (value, &row) in permuted.iter_mut().zip(pivots) {
                    *value = x[row as usize];
                }
                x.copy_from_slice(permuted);
                f64::lower_solve(panel, Diagonal::Unit, x, own);
            }
            (FrontFactor::Ldlt { panel, pivots, first, .. }, _) => {
                let permuted = &mut self.front[..k];
                for (value, &row) in permuted.iter_mut().zip(pivots) {
                    *value = x[(row - first) as usize];
                }
                x.copy_from_slice(permuted);
                f64::lower_solve(panel, Diagonal::Unit, x, own);
            }
            (FrontFactor::Lu { panel, upper, .. }, Transpose::Yes) => {
                f64::upper_transposed_solve(panel, k + r, x);
                subtract_transposed_product(upper, x, own);
            }
        }
        let (start, end) = (self.waiting.take_children(symbolic, front), self.waiting.end());
        if start < end {
            self.stack.copy_within(end..end + r, start);
        }
        self.waiting.push(front, start, r);
    }

    /// Finds the unknowns of the front from those of its rows.
    fn backward_front(
        &mut self,
        symbolic: &Symbolic,
        front: usize,
        factor: FrontFactor<'_>,
        transpose: Transpose,
        x: &mut [f64],
        read: impl Fn(usize) -> f64,
    ) {
        let (k, r) = symbolic.sizes(front);
        let rows = &mut self.front[..r];
        for (value, &row) in rows.iter_mut().zip(symbolic.rows_of(front)) {
            *value = read(row as usize);
        }
        match (factor, transpose) {
            (FrontFactor::Cholesky { panel: Panel::Double(l) }, _) => {
                f64::lower_transposed_solve(l, Diagonal::Stored, x, rows);
            }
            (FrontFactor::Cholesky { panel: Panel::Single(l) }, _) => {
                f32::lower_transposed_solve(l, Diagonal::Stored, x, rows);
            }
            (FrontFactor::Ldlt { panel, beside, pivots, first }, _) => {
                divide_by_pivots(panel, beside, k + r, x);
                f64::lower_transposed_solve(panel, Diagonal::Unit, x, rows);
                let permuted = &mut self.front[..k];
                for (&value, &row) in x.iter().zip(pivots) {
                    permuted[(row - first) as usize] = value;
                }
                x.copy_from_slice(permuted);
            }
            (FrontFactor::Lu { panel, upper, .. }, Transpose::No) => {
                subtract_product(upper, rows, x);
                f64::upper_solve(panel, k + r, x);
            }
            (FrontFactor::Lu { panel, pivots, .. }, Transpose::Yes) => {
                f64::lower_transposed_solve(panel, Diagonal::Unit, x, rows);
                let permuted = &mut self.front[..k];
                for (&value, &row) in x.iter().zip(pivots) {
                    permuted[row as usize] = value;
                }
                x.copy_from_slice(permuted);
            }
        }
    }
}
