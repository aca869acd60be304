//! What is stored of the cells of a group to apply a term there.
//!
//! Functions are stored at the points of the reference cell, once a group; maps by cell, or by cell and point where the map is
//! not affine. Both stay from state to state. Entries of the law belong to one state: they are stored by cell and point where they
//! change, or by cell where their means are asked for.

use crate::assemble::{
    applied::{
        factors::{Lines, Reads},
        number::Number,
    },
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
    pub(super) reads: Reads,
    /// Tables of one direction, where sums are taken direction by direction.
    pub(super) lines: Option<Lines<T>>,
    /// `[point][function]`; empty where no slot reads values or sums are taken direction by direction.
    pub(super) values: Vec<T>,
    /// `[point][function][direction]`, derivatives in the reference cell; empty likewise.
    pub(super) gradients: Vec<T>,
    /// `[batch][function][lane]`: the first dof of the node.
    pub(super) dofs: Vec<u32>,
    /// Where its numbers begin among those of a cell.
    pub(super) first: usize,
    /// Where its values `[component]` and its derivatives `[direction][component]` begin among the numbers of a point.
    pub(super) value_at: usize,
    pub(super) gradient_at: usize,
}

/// Where an entry of the law stands.
#[derive(Clone, Copy, Debug)]
struct Pair {
    /// Among the numbers of a point.
    test: u16,
    trial: u16,
    /// Among the values of the entries.
    coefficient: usize,
    /// Derivatives of both slots.
    derivatives: usize,
}

/// Entries of one test slot: its number at a point is the sum of these times the numbers of trial slots.
#[derive(Clone, Debug)]
pub(super) struct Row<T> {
    /// Among the numbers of a point.
    pub(super) test: u16,
    /// Trial slots with entries that are the same at all points.
    pub(super) even: Vec<(u16, T)>,
    /// Trial slots with entries that are stored, so many lines behind the first of a point.
    pub(super) stored: Vec<(u16, u16)>,
}

/// An output of the kernel that is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
struct StoredOutput {
    output: usize,
    derivatives: usize,
}

/// The entries of the law in a group of cells at a state.
#[derive(Clone, Debug)]
pub(super) struct Law<T: Number> {
    pub(super) rows: Vec<Row<T>>,
    /// `[batch][point, unless they are means][stored entry]`
    pub(super) coefficients: Vec<T::Line>,
    /// Lines of a point.
    pub(super) n_stored: usize,
    /// The lines are means over the points of a cell.
    pub(super) are_means: bool,
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
    /// Entries of the law, by test slot.
    pairs: Vec<Pair>,
    /// Outputs of the kernel of the law, and which of them are stored.
    n_outputs: usize,
    stored: Vec<StoredOutput>,
    /// Maps are the same at all points of a cell.
    pub(super) is_affine: bool,
    /// `[batch][point, if not affine][direction][direction]`: derivatives of the reference coordinates, and behind them the
    /// measure of the reference cell.
    pub(super) maps: Vec<T::Line>,
    /// By point: of the rule.
    pub(super) weights: Vec<T>,
}

/// Where the slots of a law stand among the numbers of a point.
pub(super) struct Layout {
    values: Vec<usize>,
    gradients: Vec<usize>,
    /// Components of each field.
    components: Vec<usize>,
    n: usize,
}

impl Layout {
    /// Of the slots of a law; values and derivatives of a field that some slot reads have places.
    pub(super) fn new(group: &GroupBinding, slots: &[&SlotPlace], dim: usize) -> Self {
        let (mut values, mut gradients, mut components, mut n) = (Vec::new(), Vec::new(), Vec::new(), 0);
        for (b, basis) in group.bases.iter().enumerate() {
            let reads = |op: FieldOp| slots.iter().any(|slot| slot.basis == b && slot.op == op);
            components.push(basis.n_components);
            values.push(n);
            n += if reads(FieldOp::Value) { basis.n_components } else { 0 };
            gradients.push(n);
            n += if reads(FieldOp::Grad) { basis.n_components * dim } else { 0 };
        }
        Self { values, gradients, components, n }
    }

    fn has_values(&self, basis: usize) -> bool {
        self.gradients[basis] > self.values[basis]
    }

    fn has_gradients(&self, basis: usize) -> bool {
        self.values.get(basis + 1).copied().unwrap_or(self.n) > self.gradients[basis]
    }

    /// Values by component, derivatives by direction and component: neighbours are those that one pass over a direction makes.
    fn of(&self, slot: &SlotPlace) -> u16 {
        let at = match slot.op {
            FieldOp::Value => self.values[slot.basis] + slot.component,
            _ => self.gradients[slot.basis] + slot.direction * self.components[slot.basis] + slot.component,
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
    /// In the reference cell.
    pub(in crate::assemble) points: &'a [[f64; 3]],
    pub(in crate::assemble) is_affine: bool,
    pub(in crate::assemble) binding: &'a GroupBinding,
    /// By field where its dofs begin.
    pub(in crate::assemble) starts: &'a [Option<usize>],
    pub(in crate::assemble) tests: &'a [SlotPlace],
    pub(in crate::assemble) trials: &'a [SlotPlace],
    /// Entries of the law.
    pub(in crate::assemble) entries: &'a Entries,
}

impl<T: Number> Cells<T> {
    /// Without maps, which [`Self::take_maps`] brings.
    pub(super) fn new(group: &Group<'_>) -> Self {
        let slots: Vec<&SlotPlace> = group.tests.iter().chain(group.trials).collect();
        let (dim, layout) = (group.dim, Layout::new(group.binding, &slots, group.dim));
        let of_entry = |(t, s, c): &(usize, usize, usize)| {
            let (test, trial) = (&group.tests[*t], &group.trials[*s]);
            let derivatives = test.op.order() + trial.op.order();
            Pair { test: layout.of(test), trial: layout.of(trial), coefficient: *c, derivatives }
        };
        let mut pairs: Vec<Pair> = group.entries.list.iter().map(of_entry).collect();
        pairs.sort_unstable_by_key(|pair| (pair.test, pair.trial, pair.coefficient));
        let mut stored = Vec::new();
        for pair in &pairs {
            if let Coefficient::Output(output) = group.entries.coefficients[pair.coefficient] {
                let wanted = StoredOutput { output, derivatives: pair.derivatives };
                if !stored.contains(&wanted) {
                    stored.push(wanted);
                }
            }
        }
        let n_batches = group.n_cells.div_ceil(T::LANES);
        let n_maps = n_batches * (dim * dim + 1) * if group.is_affine { 1 } else { group.weights.len() };
        Self {
            dim,
            n_cells: group.n_cells,
            n_points: group.weights.len(),
            functions: functions(group, &layout),
            n_local: group.binding.n_dofs(),
            n_at_point: layout.n,
            pairs,
            n_outputs: group.entries.n_outputs,
            stored,
            is_affine: group.is_affine,
            maps: vec![T::Line::default(); n_maps],
            weights: group.weights.iter().map(|w| T::of(*w)).collect(),
        }
    }

    /// Takes the maps of a batch of [`LANES`] cells, `[point, if not affine][direction][direction]` and behind them the measure;
    /// lanes past the last cell repeat it.
    pub(super) fn take_maps(&mut self, number: usize, maps: &[Lanes], units: Units) {
        let halves = T::LANES / LANES;
        let n_maps = maps.len();
        let (own, lanes) = (number / halves, self.lanes(number));
        let lines = self.maps[own * n_maps..][..n_maps].iter_mut();
        for (k, (line, map)) in lines.zip(maps).enumerate() {
            for (lane, from) in lanes.clone().zip((0..LANES).chain(std::iter::repeat(LANES - 1))) {
                *T::lane_mut(line, lane) = T::of(units.of_map(self.dim, k) * map[from]);
            }
        }
    }

    /// The lanes of a batch of [`LANES`] cells; the last one takes those past it, too.
    fn lanes(&self, number: usize) -> std::ops::Range<usize> {
        let offset = number % (T::LANES / LANES) * LANES;
        let is_last = (number + 1) * LANES >= self.n_cells;
        offset..if is_last { T::LANES } else { offset + LANES }
    }

    /// The entries of the law without room for what is stored of them, which [`Self::take_outputs`] brings; `uniforms` are those of
    /// the step.
    pub(super) fn law(&self, entries: &Entries, uniforms: &[f64], units: Units) -> Law<T> {
        let mut rows: Vec<Row<T>> = Vec::new();
        for pair in &self.pairs {
            if rows.last().is_none_or(|row| row.test != pair.test) {
                rows.push(Row { test: pair.test, even: Vec::new(), stored: Vec::new() });
            }
            let Some(row) = rows.last_mut() else { continue };
            let unit = units.of_entry(self.dim, pair.derivatives);
            match entries.coefficients[pair.coefficient] {
                Coefficient::Constant(value) => row.even.push((pair.trial, T::of(unit * value))),
                Coefficient::Uniform(u) => row.even.push((pair.trial, T::of(unit * uniforms[u]))),
                Coefficient::Output(output) => {
                    let wanted = StoredOutput { output, derivatives: pair.derivatives };
                    let place = self.stored.iter().position(|known| *known == wanted).expect("all outputs are stored");
                    row.stored.push((pair.trial, u16::try_from(place).expect("few entries")));
                }
            }
        }
        Law { rows, coefficients: Vec::new(), n_stored: self.stored.len(), are_means: false }
    }

    /// Takes the outputs of the kernel in a batch of [`LANES`] cells, `[point][output]` with [`LANES`] numbers each, into the
    /// lines of a batch. False if a number is not finite.
    pub(super) fn take_outputs(&self, number: usize, outputs: &[f64], lines: &mut [T::Line], units: Units) -> bool {
        let (lanes, n, mut finite) = (self.lanes(number), self.stored.len(), true);
        for (k, line) in lines.iter_mut().enumerate() {
            let (q, stored) = (k / n, self.stored[k % n]);
            let unit = units.of_entry(self.dim, stored.derivatives);
            let values = &outputs[(q * self.n_outputs + stored.output) * LANES..][..LANES];
            for (lane, from) in lanes.clone().zip((0..LANES).chain(std::iter::repeat(LANES - 1))) {
                *T::lane_mut(line, lane) = T::of(unit * values[from]);
            }
            finite &= values.iter().all(|value| value.is_finite());
        }
        finite
    }

    /// Lines of the law in a batch.
    pub(super) fn n_lines(&self, are_means: bool) -> usize {
        self.stored.len() * if are_means { 1 } else { self.n_points }
    }

    /// Whether sums of some field are taken direction by direction.
    pub(super) fn has_grids(&self) -> bool {
        self.functions.iter().any(|of| of.lines.is_some())
    }

    /// Number of batches.
    pub(super) fn n_batches(&self) -> usize {
        self.n_cells.div_ceil(T::LANES)
    }

    /// Bytes that are stored.
    pub(super) fn bytes(&self) -> usize {
        let functions =
            self.functions.iter().map(|f| size_of::<T>() * f.n_in_tables() + size_of::<u32>() * f.dofs.len());
        functions.sum::<usize>() + size_of::<T::Line>() * self.maps.len()
    }
}

impl<T> Functions<T> {
    /// Numbers of its values at all points where sums are taken direction by direction, else none.
    pub(super) fn n_on_grid(&self) -> usize {
        self.lines.as_ref().map_or(0, |lines| self.n_components * lines.n_in_cell)
    }

    /// Numbers in its tables.
    fn n_in_tables(&self) -> usize {
        self.values.len() + self.gradients.len() + self.lines.as_ref().map_or(0, Lines::len)
    }
}

impl Cells<f64> {
    /// The outputs of the kernel in a batch as [`Self::take_outputs`] took them, `[point][output]`; outputs that no entry needs hold
    /// any numbers.
    pub(super) fn give_outputs(&self, number: usize, law: &Law<f64>, units: Units, outputs: &mut Vec<f64>) {
        outputs.resize(self.n_points * self.n_outputs * LANES, 0.0);
        let n = self.n_lines(false);
        let lines = &law.coefficients[number * n..][..n];
        for (k, line) in lines.iter().enumerate() {
            let (q, stored) = (k / self.stored.len(), self.stored[k % self.stored.len()]);
            let unit = units.of_entry(self.dim, stored.derivatives).recip();
            let values = &mut outputs[(q * self.n_outputs + stored.output) * LANES..][..LANES];
            values.iter_mut().zip(&line.0).for_each(|(value, x)| *value = unit * x);
        }
    }

    /// The same as means over the points of each cell, repeated for so many points.
    pub(super) fn give_means(&self, number: usize, law: &Law<f64>, units: Units, of: (usize, &mut Vec<f64>)) {
        let (n_points, outputs) = of;
        outputs.resize(n_points * self.n_outputs * LANES, 0.0);
        let (n, n_stored, n_map) = (self.n_lines(false), self.stored.len(), self.dim * self.dim + 1);
        let lines = &law.coefficients[number * n..][..n];
        let weight = |q: usize| {
            let place = if self.is_affine { number } else { number * self.n_points + q };
            let measure = &self.maps[place * n_map + n_map - 1].0;
            measure.map(|measure| measure * self.weights[q])
        };
        let weights: Vec<[f64; LANES]> = (0..self.n_points).map(weight).collect();
        let whole: [f64; LANES] = std::array::from_fn(|lane| weights.iter().map(|w| w[lane]).sum());
        for (k, stored) in self.stored.iter().enumerate() {
            let unit = units.of_entry(self.dim, stored.derivatives).recip();
            let mut mean = [0.0; LANES];
            for (q, weight) in weights.iter().enumerate() {
                let line = &lines[q * n_stored + k].0;
                mean.iter_mut().zip(line).zip(weight).for_each(|((mean, x), w)| *mean += w * x);
            }
            mean.iter_mut().zip(&whole).for_each(|(mean, whole)| *mean *= unit / whole);
            for q in 0..n_points {
                outputs[(q * self.n_outputs + stored.output) * LANES..][..LANES].copy_from_slice(&mean);
            }
        }
    }
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
        let reads = Reads { values: layout.has_values(b), gradients: layout.has_gradients(b) };
        let factors = reads.factors(&basis.table, group.points);
        let at_once = factors.is_none();
        Functions {
            n_components: basis.n_components,
            n_nodes: basis.n_nodes,
            reads,
            lines: factors.as_ref().map(Lines::new),
            values: numbers(reads.values && at_once, &basis.table.values),
            gradients: numbers(reads.gradients && at_once, &basis.table.gradients),
            dofs,
            first: basis.offset,
            value_at: layout.values[b],
            gradient_at: layout.gradients[b],
        }
    };
    let is_used = |(b, _): &(usize, &crate::assemble::Basis)| layout.has_values(*b) || layout.has_gradients(*b);
    group.binding.bases.iter().enumerate().filter(is_used).map(of).collect()
}
