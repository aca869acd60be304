//! Multifrontal factorisation `P A Pᵀ = L D Lᵀ` of a symmetric matrix that need not be definite.
//!
//! The fronts are those of [`Symbolic`]; `front` eliminates their columns. Columns that have no pivot in their front, such
//! as a multiplier whose displacements come later, wait for the front above (Duff and Reid 1983): that becomes larger, and
//! [`FrontalLdlt::structure`] tells where everything has come to stand.
//!
//! Promises: a second factorisation uses the memory of the first; the same bytes for any number of threads; the signs of all
//! pivots. Where columns wait, more memory is asked for than was foreseen. A matrix with columns that have no pivot at all
//! is an error. Reads one half of the matrix and checks neither symmetry nor condition: `checked` does.

use std::ops::Range;

use rayon::prelude::*;

use super::super::SolveError;
use super::super::contributions::{Contributions, Extent, WHAT, give_back, shorten, stacks};
use super::super::multifrontal::{add_to_columns, add_to_rows};
use super::super::packed;
use super::super::symbolic::{Batch, INTERFACE, Plan, Symbolic};
use super::super::triangular_solve::FrontFactor;
use super::front::{Elimination, Pivots, Scratch, contribution};
use super::structure::{Columns, moved};
use wfl_dense::Par;
use wfl_host::memory::{claim_numbers, lengthen, refused_by_the_system};

/// A part of the memory that is asked for at least where columns that wait have made a factor larger than foreseen.
const MORE: usize = 16;

/// A factorisation of all fronts of a structure.
pub(super) struct FrontalLdlt {
    plan: Plan,
    batches: Vec<Batch>,
    workspaces: Vec<Workspace>,
    top: Workspace,
    threads: usize,
    /// Where the factor of each front is: the number of the workspace (that of the fronts above is the last) and its place
    /// there.
    places: Vec<(u32, u32)>,
    /// Where columns have waited.
    moved: Option<Symbolic>,
}

/// What one task has: its part of the factor, and contributions of fronts whose parent has not come yet, last in first out.
struct Workspace {
    stack: Vec<f64>,
    /// Numbers on the stack, at most, where no column waits.
    size: usize,
    waiting: Contributions,
    /// Panels of the fronts, one after the other.
    values: Vec<f64>,
    /// Numbers of the panels where no column waits.
    foreseen: usize,
    /// Candidates of the fronts by their places in the order of elimination: those that are eliminated, then those that wait.
    candidates: Vec<u32>,
    /// By candidate: entry of D beside the diagonal.
    beside: Vec<f64>,
    made: Vec<Made>,
    scratch: Scratch,
    pivots: Pivots,
}

/// The factor of a front in the lists of its workspace.
#[derive(Debug, Clone, Copy)]
struct Made {
    front: u32,
    /// Where its panel starts.
    values: usize,
    /// Where its candidates start.
    candidates: usize,
    /// How many there are, and how many have been eliminated.
    n: usize,
    eliminated: usize,
}

/// The matrix as it is factored: values, and the scales of columns and rows by places in the order of elimination.
#[derive(Clone, Copy)]
pub(super) struct Scaled<'a> {
    pub(super) values: &'a [f64],
    pub(super) scale: &'a [f64],
    pub(super) row_scale: &'a [f64],
}

struct Context<'a> {
    symbolic: &'a Symbolic,
    plan: &'a Plan,
    matrix: Scaled<'a>,
    /// Finished tasks; empty inside a task.
    tasks: &'a [Workspace],
    threads: usize,
}

/// What a child has left to a front.
struct Child<'a> {
    /// Lower half, as in [`packed`], columns that wait first.
    contribution: &'a [f64],
    /// By its rows: the place in the front.
    places: std::borrow::Cow<'a, [u32]>,
    /// Those places increase.
    is_sorted: bool,
}

impl FrontalLdlt {
    /// Asks for the memory of a factor in which no column waits.
    pub(super) fn new(symbolic: &Symbolic, threads: usize) -> Result<Self, SolveError> {
        let members = vec![true; symbolic.n_fronts()];
        let plan = symbolic.plan(members, |front| symbolic.operations(front));
        let threads = super::super::worthwhile_threads(threads, plan.cost);
        let workspace = |fronts: &mut dyn Iterator<Item = u32>| {
            let fronts: Vec<u32> = fronts.collect();
            let extent = Extent::new(symbolic, fronts.iter().copied(), packed::length);
            let panel = |front: &u32| {
                let (k, r) = symbolic.sizes(*front as usize);
                k * (k + r)
            };
            Workspace::new(&extent, fronts.iter().map(panel).sum())
        };
        let workspaces: Vec<Workspace> = plan.tasks.iter().map(|task| workspace(&mut plan.fronts_of(task))).collect();
        let top = workspace(&mut plan.top.iter().copied());
        let batches = plan.batches(symbolic, threads, packed::length);
        let whole: Vec<usize> = workspaces.iter().map(|workspace| workspace.size).collect();
        let stacks = stacks(symbolic, &plan, &batches, threads, &whole, packed::length);
        let panels: usize = workspaces.iter().chain([&top]).map(|workspace| workspace.foreseen).sum();
        claim_numbers((panels + stacks) as u64, "the factor of the matrix")?;
        Ok(Self { plan, batches, workspaces, top, threads, places: Vec::new(), moved: None })
    }

    /// Factors a matrix.
    ///
    /// # Errors
    /// [`SolveError::VanishingPivot`] where columns are left without a pivot; [`SolveError::TooMuchMemory`].
    pub(super) fn factor(&mut self, symbolic: &Symbolic, matrix: Scaled<'_>) -> Result<Pivots, SolveError> {
        self.moved = None;
        self.top.clear()?;
        for batch in self.batches.clone() {
            self.factor_tasks(symbolic, matrix, batch.tasks.clone())?;
            self.factor_top(symbolic, matrix, batch.top)?;
        }
        self.places = vec![(0, 0); symbolic.n_fronts()];
        let mut is_moved = false;
        for (owner, workspace) in (0..).zip(self.workspaces.iter().chain([&self.top])) {
            for (place, made) in (0..).zip(&workspace.made) {
                self.places[made.front as usize] = (owner, place);
                is_moved |= made.eliminated < made.n;
            }
        }
        if is_moved {
            let columns = |front: usize| {
                let (workspace, made) = self.made(front);
                let candidates = &workspace.candidates[made.candidates..made.candidates + made.n];
                let (eliminated, waiting) = candidates.split_at(made.eliminated);
                Columns { eliminated, waiting }
            };
            let moved = moved(symbolic, columns);
            self.rename(&moved);
            self.moved = Some(moved);
        }
        let all = self.workspaces.iter().chain([&self.top]).map(|workspace| workspace.pivots);
        Ok(all.fold(Pivots::default(), Pivots::and))
    }

    /// Candidates stand in the new order as they were eliminated.
    fn rename(&mut self, moved: &Symbolic) {
        for workspace in self.workspaces.iter_mut().chain([&mut self.top]) {
            for made in &workspace.made {
                let names = workspace.candidates[made.candidates..][..made.eliminated].iter_mut();
                names.zip(moved.columns[made.front as usize]..).for_each(|(name, place)| *name = place);
            }
        }
    }

    fn made(&self, front: usize) -> (&Workspace, Made) {
        let (owner, place) = self.places[front];
        let workspace = self.workspaces.get(owner as usize).unwrap_or(&self.top);
        (workspace, workspace.made[place as usize])
    }

    /// The structure of the factor; that of the analysis where no column has waited.
    pub(super) fn structure<'a>(&'a self, symbolic: &'a Symbolic) -> &'a Symbolic {
        self.moved.as_ref().unwrap_or(symbolic)
    }

    /// Whether columns have waited, so that the structure is not that of the analysis.
    pub(super) fn has_moved(&self) -> bool {
        self.moved.is_some()
    }

    /// The factor of a front; `structure` is that of the factor.
    pub(super) fn front(&self, structure: &Symbolic, front: usize) -> FrontFactor<'_> {
        let (workspace, made) = self.made(front);
        let (k, r) = structure.sizes(front);
        FrontFactor::Ldlt {
            panel: &workspace.values[made.values..made.values + k * (k + r)],
            beside: &workspace.beside[made.candidates..made.candidates + k],
            pivots: &workspace.candidates[made.candidates..made.candidates + k],
            first: structure.columns[front],
        }
    }

    fn factor_tasks(&mut self, symbolic: &Symbolic, matrix: Scaled<'_>, tasks: Range<usize>) -> Result<(), SolveError> {
        let plan = &self.plan;
        let context = Context { symbolic, plan, matrix, tasks: &[], threads: 1 };
        let run = |task: usize, workspace: &mut Workspace| {
            workspace.clear()?;
            lengthen(&mut workspace.stack, workspace.size, WHAT)?;
            let task = &plan.tasks[task];
            plan.fronts_of(task).try_for_each(|front| workspace.factor_front(&context, front as usize))?;
            let left = workspace.left_by(symbolic, task.root as usize);
            shorten(&mut workspace.stack, left);
            Ok(())
        };
        let workspaces = &mut self.workspaces[tasks.clone()];
        let outcomes: Vec<Result<(), SolveError>> = if self.threads > 1 {
            let each = (tasks.into_par_iter(), workspaces.par_iter_mut()).into_par_iter().with_max_len(1);
            each.map(|(task, workspace)| run(task, workspace)).collect()
        } else {
            tasks.zip(workspaces).map(|(task, workspace)| run(task, workspace)).collect()
        };
        // The first failure in the order of elimination, for any order of the threads.
        outcomes.into_iter().collect()
    }

    /// Eliminates fronts above the tasks.
    fn factor_top(&mut self, symbolic: &Symbolic, matrix: Scaled<'_>, fronts: Range<usize>) -> Result<(), SolveError> {
        let Self { plan, workspaces, top, threads, .. } = self;
        for front in plan.top[fronts].iter().map(|&front| front as usize) {
            let need = top.waiting.end() + packed::length(symbolic.sizes(front).1);
            lengthen(&mut top.stack, need, WHAT)?;
            let context = Context { symbolic, plan, matrix, tasks: workspaces, threads: *threads };
            top.factor_front(&context, front)?;
            for task in symbolic.children_of(front).iter().filter_map(|&child| plan.task_of(child)) {
                give_back(&mut workspaces[task].stack);
            }
            shorten(&mut top.stack, top.waiting.end());
        }
        Ok(())
    }
}

impl Workspace {
    fn new(extent: &Extent, foreseen: usize) -> Self {
        Self {
            stack: Vec::new(),
            size: extent.stack,
            waiting: Contributions::with_capacity(extent.depth),
            values: Vec::new(),
            foreseen,
            candidates: Vec::new(),
            beside: Vec::new(),
            made: Vec::new(),
            scratch: Scratch::default(),
            pivots: Pivots::default(),
        }
    }

    /// Forgets the factorisation before.
    fn clear(&mut self) -> Result<(), SolveError> {
        self.waiting.clear();
        self.values.clear();
        self.candidates.clear();
        self.beside.clear();
        self.made.clear();
        self.pivots = Pivots::default();
        // asked for when the structure was analysed
        let refused = |_| refused_by_the_system(Some(8 * self.foreseen as u64), "the factor of the matrix");
        self.values.try_reserve_exact(self.foreseen).map_err(refused)?;
        Ok(())
    }

    /// Columns that a front of this workspace has left to the front above.
    fn waiting_of(&self, front: u32) -> &[u32] {
        match self.made.binary_search_by_key(&front, |made| made.front) {
            Ok(place) => {
                let made = self.made[place];
                &self.candidates[made.candidates + made.eliminated..made.candidates + made.n]
            }
            Err(_) => &[],
        }
    }

    /// Number of values of the contribution that a front of this workspace has left.
    fn left_by(&self, symbolic: &Symbolic, front: usize) -> usize {
        packed::length(self.waiting_of(front as u32).len() + symbolic.sizes(front).1)
    }

    /// The children of a front with n candidates; `stack` is that of this workspace.
    fn children<'a>(&'a self, stack: &'a [f64], context: &Context<'a>, front: usize, n: usize) -> Vec<Child<'a>> {
        let symbolic = context.symbolic;
        let k = symbolic.sizes(front).0;
        // where columns wait, the rows stand behind them
        let shift = (n - k) as u32;
        let mut next = k as u32;
        let of_child = |&child: &u32| {
            let (owner, numbers) = match self.waiting.start_of(child) {
                Some(start) => (self, &stack[start..]),
                None => {
                    let owner = &context.tasks[context.plan.task_of(child).expect("children are done first")];
                    (owner, &owner.stack[..])
                }
            };
            let contribution = &numbers[..owner.left_by(symbolic, child as usize)];
            let n_waiting = owner.waiting_of(child).len() as u32;
            let rows = symbolic.places_of(child as usize);
            if shift == 0 {
                return Child { contribution, places: rows.into(), is_sorted: true };
            }
            let below = rows.iter().map(|&place| if place < k as u32 { place } else { place + shift });
            let places: Vec<u32> = (next..next + n_waiting).chain(below).collect();
            next += n_waiting;
            Child { contribution, places: places.into(), is_sorted: n_waiting == 0 }
        };
        symbolic.children_of(front).iter().map(of_child).collect()
    }

    /// Makes room for a panel, and gives its start.
    fn make_room(&mut self, numbers: usize) -> Result<usize, SolveError> {
        let start = self.values.len();
        if self.values.capacity() < start + numbers {
            let what = "the factor of the matrix";
            let more = numbers.max(self.values.capacity() / MORE);
            claim_numbers(more as u64, what)?;
            let refused = |_| refused_by_the_system(Some(8 * more as u64), what);
            self.values.try_reserve_exact(more).map_err(refused)?;
        }
        self.values.resize(start + numbers, 0.0);
        Ok(start)
    }

    /// Lists the candidates of a front: its own columns, then those that wait.
    fn list_candidates(&mut self, context: &Context<'_>, front: usize) -> usize {
        let symbolic = context.symbolic;
        let start = self.candidates.len();
        self.candidates.extend(symbolic.columns[front]..symbolic.columns[front + 1]);
        for &child in symbolic.children_of(front) {
            match context.plan.task_of(child).and_then(|task| context.tasks.get(task)) {
                Some(owner) => self.candidates.extend_from_slice(owner.waiting_of(child)),
                None => {
                    let waiting = self.waiting_of(child).to_vec();
                    self.candidates.extend(waiting);
                }
            }
        }
        self.beside.resize(self.candidates.len(), 0.0);
        start
    }

    /// Assembles and eliminates one front; its contribution replaces those of its children on the stack.
    fn factor_front(&mut self, context: &Context<'_>, front: usize) -> Result<(), SolveError> {
        let symbolic = context.symbolic;
        let candidates = self.list_candidates(context, front);
        let n = self.candidates.len() - candidates;
        let m = n + symbolic.sizes(front).1;
        let values = self.make_room(m * n)?;
        let mut panel = std::mem::take(&mut self.values);
        scatter(context, front, n, &mut panel[values..]);
        for child in self.children(&self.stack, context, front, n) {
            child.add_to_panel(&mut panel[values..], n, m);
        }
        self.values = panel;
        let par = super::super::parallelism(context.threads, symbolic.operations(front));
        let mut elimination = Elimination {
            panel: &mut self.values[values..],
            order: &mut self.candidates[candidates..],
            beside: &mut self.beside[candidates..],
            m,
            par,
        };
        let eliminated = elimination.run(&mut self.scratch, &mut self.pivots);
        self.made.push(Made { front: front as u32, values, candidates, n, eliminated });
        if symbolic.parents[front] == INTERFACE && eliminated < n {
            let place = self.candidates[candidates + eliminated] as usize;
            return Err(SolveError::VanishingPivot { dof: symbolic.ordering.forward()[place] as usize, ratio: 0.0 });
        }
        self.leave(context, front, par)?;
        self.values.truncate(values + m * eliminated);
        Ok(())
    }

    /// Makes the contribution of the front that was eliminated last.
    fn leave(&mut self, context: &Context<'_>, front: usize, par: Par) -> Result<(), SolveError> {
        let symbolic = context.symbolic;
        let Made { values, candidates, n, eliminated, .. } = *self.made.last().expect("it has just been made");
        let r = symbolic.sizes(front).1;
        let (m, waiting) = (n + r, n - eliminated);
        let (left, of_rows) = (packed::length(waiting + r), packed::length(r));
        let end = self.waiting.end();
        let beyond = if waiting > 0 { left } else { 0 };
        lengthen(&mut self.stack, end + beyond + of_rows, WHAT)?;
        let mut stack = std::mem::take(&mut self.stack);
        let own = &mut stack[end..];
        let beside = &self.beside[candidates..candidates + eliminated];
        let panel = &self.values[values..];
        contribution(panel, beside, (m, n), &mut own[beyond..beyond + of_rows], &mut self.scratch, par);
        if waiting > 0 {
            let (target, rows) = own.split_at_mut(left);
            for column in 0..waiting + r {
                let source = match column.checked_sub(waiting) {
                    None => &panel[(eliminated + column) * m + eliminated + column..(eliminated + column + 1) * m],
                    Some(row) => &rows[packed::column(r, row)],
                };
                target[packed::column(waiting + r, column)].copy_from_slice(source);
            }
        }
        if r > 0 {
            let (below, own) = stack.split_at_mut(end);
            for child in self.children(below, context, front, n) {
                child.add_to_contribution(&mut own[..left], n, waiting, r);
            }
        }
        self.stack = stack;
        let (start, end) = (self.waiting.take_children(symbolic, front), self.waiting.end());
        if start < end {
            self.stack.copy_within(end..end + left, start);
        }
        self.waiting.push(front, start, left);
        if symbolic.parents[front] == INTERFACE {
            self.waiting.pop();
        }
        Ok(())
    }
}

impl Child<'_> {
    /// Adds the columns that are candidates of the front.
    fn add_to_panel(&self, panel: &mut [f64], n: usize, m: usize) {
        if self.is_sorted {
            add_to_columns(self.contribution, &self.places, panel, n, m);
            return;
        }
        self.each(|row, column, value| {
            if column < n {
                panel[column * m + row] += value;
            }
        });
    }

    /// Adds the other columns to what the front leaves: `waiting` columns and r rows.
    fn add_to_contribution(&self, own: &mut [f64], n: usize, waiting: usize, r: usize) {
        let lies = |column: usize| packed::column(waiting + r, waiting + column);
        if self.is_sorted {
            add_to_rows(self.contribution, &self.places, own, n, lies);
            return;
        }
        self.each(|row, column, value| {
            if column >= n {
                own[lies(column - n).start + row - column] += value;
            }
        });
    }

    /// All entries of the lower half, by their rows and columns of the front.
    fn each(&self, mut add: impl FnMut(usize, usize, f64)) {
        for (column, &place) in self.places.iter().enumerate() {
            let values = &self.contribution[packed::column(self.places.len(), column)];
            for (&other, value) in self.places[column..].iter().zip(values) {
                add(place.max(other) as usize, place.min(other) as usize, *value);
            }
        }
    }
}

/// Adds the entries of the scaled matrix in the own columns of a front with n candidates to its zeroed panel.
fn scatter(context: &Context<'_>, front: usize, n: usize, panel: &mut [f64]) {
    let (symbolic, Scaled { values, scale, row_scale }) = (context.symbolic, context.matrix);
    let (k, r) = symbolic.sizes(front);
    let (first, rows) = (symbolic.columns[front], symbolic.rows_of(front));
    for (column, target) in panel.chunks_exact_mut(n + r).take(k).enumerate() {
        let mut below = 0;
        let place = first as usize + column;
        for entry in symbolic.lower_entries(place) {
            let row = symbolic.lower_rows[entry];
            let at = if row < first + k as u32 {
                (row - first) as usize
            } else {
                // Both lists increase.
                while rows[below] != row {
                    below += 1;
                }
                n + below
            };
            // the values are those of a row of the matrix
            let factor = row_scale[place] * scale[row as usize];
            target[at] += values[symbolic.lower_sources[entry] as usize] * factor;
        }
    }
}
