//! What is stored of the cells of a group to apply a term there.
//!
//! Functions are stored at the points of the reference cell, once a group; maps by cell, or by cell and point where the map is
//! not affine; entries of the law by cell and point where they change.

use crate::assemble::{
    applied::number::Number,
    binding::{GroupBinding, SlotPlace},
    entries::{Coefficient, Entries},
    simd::Lanes,
};
use wfl_compiler::{ir::LANES, types::FieldOp};

/// A field in the cells of a group.
#[derive(Clone, Debug)]
pub(super) struct Functions<T> {
    /// Components at a node.
    pub(super) n_components: usize,
    /// Nodes of a cell.
    pub(super) n_nodes: usize,
    /// `[point][function]`; empty where no slot reads values.
    pub(super) values: Vec<T>,
    /// `[point][function][direction]`, derivatives in the reference cell; empty where no slot reads them.
    pub(super) gradients: Vec<T>,
    /// `[batch][function][lane]`: the first dof of the node.
    pub(super) dofs: Vec<u32>,
    /// Where its numbers begin among those of a cell.
    pub(super) first: usize,
    /// Where its values and its derivatives begin among the numbers of a point.
    pub(super) value_at: usize,
    pub(super) gradient_at: usize,
}

/// An entry of the law: the number of a test slot at a point is a sum of entries times those of trial slots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry<T> {
    /// Among the numbers of a point.
    pub(super) test: u16,
    pub(super) trial: u16,
    /// The first one of its test slot.
    pub(super) is_first: bool,
    pub(super) factor: Factor<T>,
}

/// What an entry is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Factor<T> {
    /// The same at all points.
    Even(T),
    /// By cell and point, so many lines behind the first of a point.
    Stored(u16),
}

/// The cells of a group, [`Number::LANES`] a batch.
#[derive(Clone, Debug)]
pub(super) struct Cells<T: Number> {
    pub(super) dim: usize,
    pub(super) n_cells: usize,
    pub(super) n_points: usize,
    pub(super) functions: Vec<Functions<T>>,
    /// Numbers of a cell and of a point.
    pub(super) n_local: usize,
    pub(super) n_at_point: usize,
    pub(super) entries: Vec<Entry<T>>,
    /// Outputs of the kernel of the law, and which of them are stored by cell and point, in which unit.
    n_outputs: usize,
    pub(super) stored: Vec<(usize, f64)>,
    /// Maps are the same at all points of a cell.
    pub(super) is_affine: bool,
    /// `[batch][point, if not affine][direction][direction]`: derivatives of the reference coordinates, and behind them the
    /// measure of the reference cell.
    pub(super) maps: Vec<T::Line>,
    /// By point: of the rule.
    pub(super) weights: Vec<T>,
    /// `[batch][point][entry]`: entries that are stored.
    pub(super) coefficients: Vec<T::Line>,
}

/// Where the slots of a law stand among the numbers of a point.
pub(super) struct Layout {
    values: Vec<usize>,
    gradients: Vec<usize>,
    n: usize,
}

impl Layout {
    /// Of the slots of a law; values and derivatives of a field that some slot reads have places.
    pub(super) fn new(group: &GroupBinding, slots: &[&SlotPlace], dim: usize) -> Self {
        let (mut values, mut gradients, mut n) = (Vec::new(), Vec::new(), 0);
        for (b, basis) in group.bases.iter().enumerate() {
            let reads = |op: FieldOp| slots.iter().any(|slot| slot.basis == b && slot.op == op);
            values.push(n);
            n += if reads(FieldOp::Value) { basis.n_components } else { 0 };
            gradients.push(n);
            n += if reads(FieldOp::Grad) { basis.n_components * dim } else { 0 };
        }
        Self { values, gradients, n }
    }

    fn has_values(&self, basis: usize) -> bool {
        self.gradients[basis] > self.values[basis]
    }

    fn has_gradients(&self, basis: usize) -> bool {
        self.values.get(basis + 1).copied().unwrap_or(self.n) > self.gradients[basis]
    }

    fn of(&self, slot: &SlotPlace, dim: usize) -> u16 {
        let at = match slot.op {
            FieldOp::Value => self.values[slot.basis] + slot.component,
            _ => self.gradients[slot.basis] + slot.component * dim + slot.direction,
        };
        u16::try_from(at).expect("few slots")
    }
}

/// The units of what is stored: powers of two, so that single precision holds cells of any size and matrices in any unit.
#[derive(Clone, Copy, Debug)]
pub(in crate::assemble) struct Units {
    /// About the size of a cell (length).
    pub(in crate::assemble) length: f64,
    /// What entries of the law are multiplied by.
    pub(in crate::assemble) factor: f64,
}

impl Units {
    /// The power of two next to a positive number; 1 for others.
    pub(in crate::assemble) fn power_of_two(value: f64) -> f64 {
        if value > 0.0 && value.is_finite() { value.log2().round().exp2() } else { 1.0 }
    }

    /// Of an entry between slots with so many derivatives in all, on cells of this dimension: maps are in units of length.
    fn of_entry(self, dim: usize, derivatives: usize) -> f64 {
        let power = i32::try_from(dim).unwrap_or(0) - i32::try_from(derivatives).unwrap_or(0);
        self.factor * self.length.powi(power)
    }

    /// Of number `k` of a map: inverse Jacobian, and behind it the measure.
    fn of_map(self, dim: usize, k: usize) -> f64 {
        let power = if k % (dim * dim + 1) < dim * dim { 1 } else { -i32::try_from(dim).unwrap_or(0) };
        self.length.powi(power)
    }
}

/// What a group of cells is made from.
pub(in crate::assemble) struct Group<'a> {
    pub(in crate::assemble) dim: usize,
    pub(in crate::assemble) n_cells: usize,
    pub(in crate::assemble) weights: &'a [f64],
    pub(in crate::assemble) is_affine: bool,
    pub(in crate::assemble) binding: &'a GroupBinding,
    /// By field where its dofs begin.
    pub(in crate::assemble) starts: &'a [Option<usize>],
    pub(in crate::assemble) tests: &'a [SlotPlace],
    pub(in crate::assemble) trials: &'a [SlotPlace],
    /// Entries of the law, and what is the same at all points.
    pub(in crate::assemble) entries: &'a Entries,
    pub(in crate::assemble) uniforms: &'a [f64],
}

/// What is stored of the cells of a batch of [`LANES`].
pub(in crate::assemble) struct Batch<'a> {
    pub(in crate::assemble) number: usize,
    /// `[point, if not affine][direction][direction]`, and behind them the measure.
    pub(in crate::assemble) maps: &'a [Lanes],
    /// `[point][entry]`, [`LANES`] numbers each.
    pub(in crate::assemble) outputs: &'a [f64],
}

impl<T: Number> Cells<T> {
    /// Without maps and stored entries, which [`Self::take`] brings.
    pub(super) fn new(group: &Group<'_>, units: Units) -> Self {
        let slots: Vec<&SlotPlace> = group.tests.iter().chain(group.trials).collect();
        let (dim, layout) = (group.dim, Layout::new(group.binding, &slots, group.dim));
        let of_entry = |(t, s, c): &(usize, usize, usize)| {
            let (test, trial) = (&group.tests[*t], &group.trials[*s]);
            let unit = units.of_entry(dim, test.op.order() + trial.op.order());
            (layout.of(test, dim), layout.of(trial, dim), *c, unit)
        };
        let mut list: Vec<(u16, u16, usize, f64)> = group.entries.list.iter().map(of_entry).collect();
        list.sort_unstable_by_key(|(test, trial, c, _)| (*test, *trial, *c));
        let (mut before, mut stored) = (None, Vec::new());
        let entries = list.into_iter().map(|(test, trial, c, unit)| Entry {
            test,
            trial,
            is_first: before.replace(test) != Some(test),
            factor: match group.entries.coefficients[c] {
                Coefficient::Constant(value) => Factor::Even(T::of(unit * value)),
                Coefficient::Uniform(u) => Factor::Even(T::of(unit * group.uniforms[u])),
                Coefficient::Output(k) => Factor::Stored(place_of(&mut stored, (k, unit))),
            },
        });
        let entries = entries.collect();
        let n_batches = group.n_cells.div_ceil(T::LANES);
        let n_maps = n_batches * (dim * dim + 1) * if group.is_affine { 1 } else { group.weights.len() };
        Self {
            dim,
            n_cells: group.n_cells,
            n_points: group.weights.len(),
            functions: functions(group, &layout),
            n_local: group.binding.n_dofs(),
            n_at_point: layout.n,
            entries,
            n_outputs: group.entries.n_outputs,
            is_affine: group.is_affine,
            maps: vec![T::Line::default(); n_maps],
            weights: group.weights.iter().map(|w| T::of(*w)).collect(),
            coefficients: vec![T::Line::default(); n_batches * group.weights.len() * stored.len()],
            stored,
        }
    }

    /// Takes the maps and the entries of a batch of [`LANES`] cells; lanes past the last cell repeat it.
    pub(super) fn take(&mut self, batch: &Batch<'_>, units: Units) {
        let halves = T::LANES / LANES;
        let (own, offset) = (batch.number / halves, batch.number % halves * LANES);
        let (n_maps, n_coefficients) = (batch.maps.len(), self.n_points * self.stored.len());
        let is_last = (batch.number + 1) * LANES >= self.n_cells;
        let lanes = if is_last { offset..T::LANES } else { offset..offset + LANES };
        for lane in lanes {
            let from = (lane - offset).min(LANES - 1);
            let lines = self.maps[own * n_maps..][..n_maps].iter_mut();
            for (k, (line, map)) in lines.zip(batch.maps).enumerate() {
                *T::lane_mut(line, lane) = T::of(units.of_map(self.dim, k) * map[from]);
            }
            let lines = self.coefficients[own * n_coefficients..][..n_coefficients].iter_mut();
            let places = (0..self.n_points).flat_map(|q| self.stored.iter().map(move |stored| (q, stored)));
            for (line, (q, (output, unit))) in lines.zip(places) {
                let value = batch.outputs[(q * self.n_outputs + output) * LANES + from];
                *T::lane_mut(line, lane) = T::of(unit * value);
            }
        }
    }

    /// Number of batches.
    pub(super) fn n_batches(&self) -> usize {
        self.n_cells.div_ceil(T::LANES)
    }

    /// Bytes that are stored.
    pub(super) fn bytes(&self) -> usize {
        let functions = self
            .functions
            .iter()
            .map(|f| size_of::<T>() * (f.values.len() + f.gradients.len()) + size_of::<u32>() * f.dofs.len());
        functions.sum::<usize>() + size_of::<T::Line>() * (self.maps.len() + self.coefficients.len())
    }
}

/// The place of something in a list that has each once.
fn place_of(list: &mut Vec<(usize, f64)>, wanted: (usize, f64)) -> u16 {
    let at = list.iter().position(|known| *known == wanted).unwrap_or_else(|| {
        list.push(wanted);
        list.len() - 1
    });
    u16::try_from(at).expect("few entries")
}

/// The fields of a group.
fn functions<T: Number>(group: &Group<'_>, layout: &Layout) -> Vec<Functions<T>> {
    let of = |(b, basis): (usize, &crate::assemble::Basis)| {
        let numbers = |wanted: bool, all: &[f64]| -> Vec<T> {
            if wanted { all.iter().map(|x| T::of(*x)).collect() } else { Vec::new() }
        };
        let start = group.starts[basis.field.index()].unwrap_or(0);
        let n_batches = group.n_cells.div_ceil(T::LANES);
        let mut dofs = Vec::with_capacity(n_batches * basis.n_nodes * T::LANES);
        for batch in 0..n_batches {
            for k in 0..basis.n_nodes {
                for lane in 0..T::LANES {
                    let cell = (batch * T::LANES + lane).min(group.n_cells - 1);
                    let dof = start + basis.nodes[cell * basis.n_nodes + k] as usize * basis.n_components;
                    dofs.push(u32::try_from(dof).expect("fewer than 2^32 dofs"));
                }
            }
        }
        Functions {
            n_components: basis.n_components,
            n_nodes: basis.n_nodes,
            values: numbers(layout.has_values(b), &basis.table.values),
            gradients: numbers(layout.has_gradients(b), &basis.table.gradients),
            dofs,
            first: basis.offset,
            value_at: layout.values[b],
            gradient_at: layout.gradients[b],
        }
    };
    let is_used = |(b, _): &(usize, &crate::assemble::Basis)| layout.has_values(*b) || layout.has_gradients(*b);
    group.binding.bases.iter().enumerate().filter(is_used).map(of).collect()
}
