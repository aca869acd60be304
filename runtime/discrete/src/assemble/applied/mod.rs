//! A linear term that is applied to vectors, cell by cell, without a matrix.
//!
//! What is stored is what does not change from product to product: functions at the points of the reference cell, maps of the
//! cells, entries of the law where they are not the same everywhere. In double precision for residuals, in single precision
//! for preconditioners. Promises: the same bits for any number of threads. Does not know which dofs are prescribed.

mod cells;
mod kernel;
mod number;
mod peak;
mod portions;

use std::sync::{Arc, Mutex, PoisonError};

use pulp::Arch;
use rayon::prelude::*;

pub(in crate::assemble) use cells::{Batch, Group, Units};
use cells::{Cells, Functions};
use kernel::Action;
use number::Number;
pub use peak::products_per_second;
use portions::{Duty, Portions};

/// A linear term on cells.
pub(crate) struct AppliedTerm {
    double: Precise<f64>,
    single: Precise<f32>,
}

/// The same in one precision.
struct Precise<T: Number> {
    groups: Vec<Cells<T>>,
    n_dofs: usize,
    units: Units,
    arch: Arch,
    /// For the number of threads that applied it last.
    portions: Mutex<Option<Arc<Portions>>>,
}

impl AppliedTerm {
    /// On groups of cells of about this size, for vectors of so many dofs; in single precision entries are multiplied by
    /// `scale`. Maps and stored entries come with [`Self::take`].
    pub(super) fn new(groups: &[Group<'_>], n_dofs: usize, length: f64, scale: f64) -> Self {
        let length = Units::power_of_two(length);
        let (double, single) = (Units { length, factor: 1.0 }, Units { length, factor: scale });
        Self { double: Precise::new(groups, n_dofs, double), single: Precise::new(groups, n_dofs, single) }
    }

    /// Takes what is stored of a batch of a group.
    pub(super) fn take(&mut self, group: usize, batch: &Batch<'_>) {
        self.double.take(group, batch);
        self.single.take(group, batch);
    }

    /// `out = out + A u`, both by dof.
    pub(crate) fn add(&self, u: &[f64], out: &mut [f64]) {
        self.double.add(u, out);
    }

    /// The same times the scale, in single precision.
    pub(crate) fn add_single(&self, u: &[f32], out: &mut [f32]) {
        self.single.add(u, out);
    }

    /// By dof the largest magnitude in the cells around it, if it is larger than what stands there.
    pub(crate) fn largest_nearby(&self, u: &[f64], out: &mut [f64]) {
        self.double.largest_nearby(u, out);
    }

    /// Bytes that are stored.
    pub(crate) fn bytes(&self) -> usize {
        let of_double: usize = self.double.groups.iter().map(Cells::bytes).sum();
        of_double + self.single.groups.iter().map(Cells::bytes).sum::<usize>()
    }
}

impl<T: Number> Precise<T> {
    fn new(groups: &[Group<'_>], n_dofs: usize, units: Units) -> Self {
        let groups = groups.iter().map(|group| Cells::new(group, units)).collect();
        Self { groups, n_dofs, units, arch: Arch::new(), portions: Mutex::default() }
    }

    fn take(&mut self, group: usize, batch: &Batch<'_>) {
        self.groups[group].take(batch, self.units);
    }

    /// Who computes what on the threads of the current pool that are worth while.
    fn portions(&self) -> Arc<Portions> {
        let n = portions::count(&self.groups, rayon::current_num_threads());
        let mut kept = self.portions.lock().unwrap_or_else(PoisonError::into_inner);
        match kept.as_ref().filter(|portions| portions.duties.len() == n) {
            Some(portions) => Arc::clone(portions),
            None => Arc::clone(kept.insert(Arc::new(Portions::new(&self.groups, n, self.n_dofs)))),
        }
    }

    fn add(&self, u: &[T], out: &mut [T]) {
        let portions = self.portions();
        let out = T::shared(out);
        let one = |me: usize| {
            let mut memory = Memory::default();
            for duty in &portions.duties[me] {
                let owned = |dof: u32| duty.all_nodes || usize::from(portions.owner[dof as usize]) == me;
                self.add_batch(duty, u, out, &mut memory, owned);
            }
        };
        match portions.duties.len() {
            1 => one(0),
            n => (0..n).into_par_iter().with_max_len(1).for_each(one),
        }
    }

    fn add_batch(
        &self,
        duty: &Duty,
        u: &[T],
        out: &[T::Shared],
        memory: &mut Memory<T>,
        owned: impl Fn(u32) -> bool + Copy,
    ) {
        let cells = &self.groups[duty.group];
        memory.fit(duty.group, cells);
        for of in &cells.functions {
            match of.n_components {
                1 => of.gather::<1>(duty.batch, u, &mut memory.local),
                2 => of.gather::<2>(duty.batch, u, &mut memory.local),
                _ => of.gather::<3>(duty.batch, u, &mut memory.local),
            }
        }
        let Memory { local, out: by_node, trials, fluxes, .. } = memory;
        self.arch.dispatch(Action { cells, batch: duty.batch, local, out: by_node, trials, fluxes });
        let n_cells = T::LANES.min(cells.n_cells - duty.batch * T::LANES);
        for of in &cells.functions {
            let to = Scatter { out, batch: duty.batch, n_cells };
            match of.n_components {
                1 => of.scatter::<1>(&to, by_node, owned),
                2 => of.scatter::<2>(&to, by_node, owned),
                _ => of.scatter::<3>(&to, by_node, owned),
            }
        }
    }

    fn largest_nearby(&self, u: &[T], out: &mut [T]) {
        let larger = |a: T, b: T| if a < b { b } else { a };
        for cells in &self.groups {
            for batch in 0..cells.n_batches() {
                let dofs = || cells.functions.iter().map(|of| (of, of.dofs_of(batch)));
                for lane in 0..T::LANES {
                    let mut largest = T::default();
                    for (of, dofs) in dofs() {
                        for dof in dofs.iter().skip(lane).step_by(T::LANES) {
                            let node = &u[*dof as usize..][..of.n_components];
                            largest = node.iter().fold(largest, |largest, x| larger(largest, x.size()));
                        }
                    }
                    for (of, dofs) in dofs() {
                        for dof in dofs.iter().skip(lane).step_by(T::LANES) {
                            let node = &mut out[*dof as usize..][..of.n_components];
                            node.iter_mut().for_each(|slot| *slot = larger(*slot, largest));
                        }
                    }
                }
            }
        }
    }
}

/// Memory of one thread.
struct Memory<T: Number> {
    /// The group that it fits.
    group: Option<usize>,
    local: Vec<T::Line>,
    out: Vec<T::Line>,
    trials: Vec<T::Line>,
    fluxes: Vec<T::Line>,
}

impl<T: Number> Default for Memory<T> {
    fn default() -> Self {
        let none = Vec::new;
        Self { group: None, local: none(), out: none(), trials: none(), fluxes: none() }
    }
}

impl<T: Number> Memory<T> {
    fn fit(&mut self, group: usize, cells: &Cells<T>) {
        if self.group == Some(group) {
            return;
        }
        self.group = Some(group);
        for (lines, n) in [
            (&mut self.local, cells.n_local),
            (&mut self.out, cells.n_local),
            (&mut self.trials, cells.n_at_point),
            (&mut self.fluxes, cells.n_at_point),
        ] {
            // what no entry makes is zero
            lines.clear();
            lines.resize(n, T::Line::default());
        }
    }
}

/// Where the numbers of a batch go.
struct Scatter<'a, T: Number> {
    out: &'a [T::Shared],
    batch: usize,
    n_cells: usize,
}

impl<T: Number> Functions<T> {
    /// `[function][lane]`: first dofs of the nodes of a batch.
    fn dofs_of(&self, batch: usize) -> &[u32] {
        let n = self.n_nodes * T::LANES;
        &self.dofs[batch * n..][..n]
    }

    #[inline(always)]
    fn gather<const N: usize>(&self, batch: usize, u: &[T], local: &mut [T::Line]) {
        let nodes = local[self.first..].as_chunks_mut::<N>().0;
        for (node, dofs) in nodes.iter_mut().zip(self.dofs_of(batch).chunks_exact(T::LANES)) {
            for (lane, dof) in dofs.iter().enumerate() {
                let values = &u[*dof as usize..][..N];
                for (line, value) in node.iter_mut().zip(values) {
                    *T::lane_mut(line, lane) = *value;
                }
            }
        }
    }

    #[inline(always)]
    fn scatter<const N: usize>(&self, to: &Scatter<'_, T>, local: &[T::Line], owned: impl Fn(u32) -> bool) {
        let nodes = local[self.first..].as_chunks::<N>().0;
        for (node, dofs) in nodes.iter().zip(self.dofs_of(to.batch).chunks_exact(T::LANES)) {
            for (lane, dof) in dofs[..to.n_cells].iter().enumerate().filter(|(_, dof)| owned(**dof)) {
                let cells = &to.out[*dof as usize..][..N];
                for (cell, line) in cells.iter().zip(node) {
                    T::add(cell, T::lane(line, lane));
                }
            }
        }
    }
}
