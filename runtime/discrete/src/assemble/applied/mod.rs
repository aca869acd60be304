//! A term that is applied to vectors, cell by cell, without a matrix: a linear one, or the tangent of one at a state.
//!
//! What does not change from state to state is a [`Skeleton`]: functions at the points of the reference cell, dofs and maps of
//! the cells, and who computes what. An [`AppliedTerm`] has the entries of the law beside it. In double precision for residuals, in
//! single precision for preconditioners. Promises: the same bits for any number of threads. Does not know which dofs are prescribed.

mod cells;
mod factors;
mod kernel;
mod number;
mod passes;
mod peak;
mod portions;

use std::sync::{
    Arc, Mutex, PoisonError,
    atomic::{AtomicBool, Ordering},
};

use pulp::Arch;
use rayon::prelude::*;
use wfl_compiler::ir::LANES;

use cells::{Cells, Functions, Law};
pub(in crate::assemble) use cells::{Group, Units};
pub(in crate::assemble) use factors::{Factors, PRODUCTS_OF_A_LINE, Reads};
use kernel::Action;
pub(crate) use number::Number;
use passes::Grids;
pub use peak::products_per_second;
use portions::{Duty, Portions};

use super::entries::Entries;
use super::simd::Lanes;

/// The cells of a term and what they have in every state.
pub(crate) struct Skeleton<T: Number> {
    groups: Vec<Cells<T>>,
    n_dofs: usize,
    /// About the size of a cell, a power of two (length).
    length: f64,
    arch: Arch,
    /// For the number of threads that applied it last.
    portions: Mutex<Option<Arc<Portions>>>,
}

/// The entries of a law at a state, in the cells of a term.
pub(crate) struct AppliedTerm<T: Number> {
    skeleton: Arc<Skeleton<T>>,
    /// By group.
    laws: Vec<Law<T>>,
    /// Entries are multiplied by it.
    factor: f64,
}

/// How entries of a law are kept.
#[derive(Clone, Copy, Debug)]
pub(in crate::assemble) struct Keeping<'a> {
    pub(in crate::assemble) entries: &'a Entries,
    /// What is the same at all points.
    pub(in crate::assemble) uniforms: &'a [f64],
    /// They are multiplied by it.
    pub(in crate::assemble) factor: f64,
    /// Those of the first point stand for all points of a cell.
    pub(in crate::assemble) are_means: bool,
}

impl<T: Number> Skeleton<T> {
    /// Of groups of cells of about this size, for vectors of so many dofs. Maps come with [`Self::take_maps`].
    pub(super) fn new(groups: &[Group<'_>], n_dofs: usize, length: f64) -> Self {
        let groups = groups.iter().map(Cells::new).collect();
        let length = Units::power_of_two(length);
        Self { groups, n_dofs, length, arch: Arch::new(), portions: Mutex::default() }
    }

    /// Takes the maps of batch `number` of [`LANES`] cells of a group.
    pub(super) fn take_maps(&mut self, group: usize, number: usize, maps: &[Lanes]) {
        let units = self.units(1.0);
        self.groups[group].take_maps(number, maps, units);
    }

    fn units(&self, factor: f64) -> Units {
        Units { length: self.length, factor }
    }

    /// Whether cells of a group have one map.
    pub(super) fn is_affine(&self, group: usize) -> bool {
        self.groups[group].is_affine
    }

    /// The entries of a law in these cells: `outputs(memory, group, number, out)` gives those of its kernel in batch `number` of
    /// [`LANES`] cells. `None` if a number is not finite.
    pub(super) fn with_law<M: Default>(
        self: &Arc<Self>,
        keeping: Keeping<'_>,
        outputs: impl Fn(&mut M, usize, usize, &mut Vec<f64>) + Sync,
    ) -> Option<AppliedTerm<T>> {
        let Keeping { entries, uniforms, factor, are_means } = keeping;
        let (units, finite) = (self.units(factor), AtomicBool::new(true));
        let of_group = |(g, cells): (usize, &Cells<T>)| {
            let n = cells.n_lines(are_means);
            let coefficients = vec![T::Line::default(); cells.n_batches() * n];
            let mut law = Law { coefficients, are_means, ..cells.law(entries, uniforms, units) };
            if n > 0 {
                let halves = T::LANES / LANES;
                let memory = || (M::default(), Vec::new());
                law.coefficients.par_chunks_mut(n).enumerate().for_each_init(
                    memory,
                    |(memory, out), (batch, lines)| {
                        let of_batch = (batch * halves..(batch + 1) * halves).filter(|k| k * LANES < cells.n_cells);
                        for number in of_batch {
                            outputs(memory, g, number, out);
                            if !cells.take_outputs(number, out, lines, units) {
                                finite.store(false, Ordering::Relaxed);
                            }
                        }
                    },
                );
            }
            law
        };
        let laws = self.groups.iter().enumerate().map(of_group).collect();
        let made = AppliedTerm { skeleton: Arc::clone(self), laws, factor };
        finite.into_inner().then_some(made)
    }

    /// By dof the largest magnitude in the cells around it, if it is larger than what stands there.
    pub(crate) fn largest_nearby(&self, u: &[T], out: &mut [T]) {
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

    /// Who computes what on the threads of the current pool that are worth while.
    fn portions(&self) -> Arc<Portions> {
        let n = portions::count(&self.groups, rayon::current_num_threads());
        let mut kept = self.portions.lock().unwrap_or_else(PoisonError::into_inner);
        match kept.as_ref().filter(|portions| portions.duties.len() == n) {
            Some(portions) => Arc::clone(portions),
            None => Arc::clone(kept.insert(Arc::new(Portions::new(&self.groups, n, self.n_dofs)))),
        }
    }

    /// Bytes that are stored.
    pub(crate) fn bytes(&self) -> usize {
        self.groups.iter().map(Cells::bytes).sum()
    }
}

impl<T: Number> AppliedTerm<T> {
    /// The cells.
    pub(crate) fn skeleton(&self) -> &Arc<Skeleton<T>> {
        &self.skeleton
    }

    /// Bytes that are stored, those of the cells aside.
    pub(crate) fn bytes(&self) -> usize {
        self.laws.iter().map(|law| size_of_val(&law.coefficients[..])).sum()
    }

    /// `out = out + factor A u`, both by dof.
    pub(crate) fn add(&self, u: &[T], out: &mut [T]) {
        let portions = self.skeleton.portions();
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
        let (cells, law) = (&self.skeleton.groups[duty.group], &self.laws[duty.group]);
        memory.fit(duty.group, cells);
        for of in &cells.functions {
            match of.n_components {
                1 => of.gather::<1>(duty.batch, u, &mut memory.local),
                2 => of.gather::<2>(duty.batch, u, &mut memory.local),
                _ => of.gather::<3>(duty.batch, u, &mut memory.local),
            }
        }
        let Memory { local, out: by_node, at_points, scratch: [one, other], fluxes, .. } = memory;
        let grids = Grids { at_points, scratch: [one, other] };
        self.skeleton.arch.dispatch(Action { cells, law, batch: duty.batch, local, out: by_node, grids, fluxes });
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
}

impl AppliedTerm<f64> {
    /// The outputs of the kernel in batch `number` of a group, `[point][output]`; those that no entry needs are any numbers.
    pub(super) fn give_outputs(&self, group: usize, number: usize, outputs: &mut Vec<f64>) {
        let (cells, units) = (&self.skeleton.groups[group], self.skeleton.units(self.factor));
        cells.give_outputs(number, &self.laws[group], units, outputs);
    }

    /// The same as means over the points of each cell, for so many points.
    pub(super) fn give_means(&self, group: usize, number: usize, n_points: usize, outputs: &mut Vec<f64>) {
        let (cells, units) = (&self.skeleton.groups[group], self.skeleton.units(self.factor));
        cells.give_means(number, &self.laws[group], units, (n_points, outputs));
    }
}

/// Memory of one thread.
struct Memory<T: Number> {
    /// The group that it fits.
    group: Option<usize>,
    local: Vec<T::Line>,
    out: Vec<T::Line>,
    /// `[point][number]` of all points if sums of some field are taken direction by direction, else of one.
    at_points: Vec<T::Line>,
    scratch: [Vec<T::Line>; 2],
    fluxes: Vec<T::Line>,
}

impl<T: Number> Default for Memory<T> {
    fn default() -> Self {
        let none = Vec::new;
        let scratch = [none(), none()];
        Self { group: None, local: none(), out: none(), at_points: none(), scratch, fluxes: none() }
    }
}

impl<T: Number> Memory<T> {
    fn fit(&mut self, group: usize, cells: &Cells<T>) {
        if self.group == Some(group) {
            return;
        }
        self.group = Some(group);
        let n_on_grid = cells.functions.iter().map(Functions::n_on_grid).max().unwrap_or(0);
        let n_points = if cells.has_grids() { cells.n_points } else { 1 };
        let [one, other] = &mut self.scratch;
        for (lines, n) in [
            (one, n_on_grid),
            (other, n_on_grid),
            (&mut self.local, cells.n_local),
            (&mut self.out, cells.n_local),
            (&mut self.at_points, n_points * cells.n_at_point),
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

#[cfg(test)]
mod tests;
