//! Contraction of the outputs of a point law with basis functions, 8 entities at a time.
//!
//! The formula: residual of test dof (i, c) is the sum over points of w (N_i f_c + dN_i/dx_d f_cd); the tangent the
//! same with the law's entries on both sides. Per pair of test and trial component the tangent is one small matrix
//! product: entries times trial functions first, then test functions times that, summed over test slots and points in
//! registers, or a sum of shared integrals ([`crate::assemble::integrals`]). Pairs without entries do not exist; of
//! symmetric laws one triangle is made; functions that are zero at all points of a facet are left out where a term
//! reads values only.

use pulp::{Simd, WithSimd};
use wfl_compiler::{ir::LANES, types::FieldOp};

use crate::assemble::{
    basis::{Basis, Operand},
    binding::{Binding, GroupBinding, SlotPlace},
    block::{Block, Product, Row, TILE},
    entries::{Coefficient, Entries},
    evaluate::Workspace,
    integrals::{self, Integral, Sources},
    simd::{Lanes, ZERO, fused, load, parts, plus_product, store},
    strips::Strips,
};
use crate::domain::Group;
use wfl_sparse::index::NONE;

/// How the tangent of one group is made.
#[derive(Clone, Debug)]
pub(super) struct TangentPlan {
    blocks: Vec<Block>,
    /// Numbers in the local tangent; one more behind them is zero.
    pub(super) n_local: usize,
    /// Where the entry (test dof, trial dof) stands in the local tangent, by `test * n_dofs + trial`; [`NONE`] if it
    /// is always zero.
    pub(super) sources: Vec<u32>,
    /// Some pairs of functions meet at no point: those of two nodes under a rule with its points at the nodes.
    pub(super) has_apart: bool,
    n_coefficients: usize,
    flux: usize,
    integrals: Vec<Integral>,
    /// Numbers of the integrals.
    n_integrals: usize,
}

/// A component of a basis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Component {
    basis: usize,
    component: usize,
}

impl Component {
    fn of(place: &SlotPlace) -> Self {
        Self { basis: place.basis, component: place.component }
    }
}

impl TangentPlan {
    pub(super) fn new(binding: &Binding, g: usize, entries: &Entries) -> Self {
        let group = &binding.groups[g];
        let n_dofs = group.n_dofs();
        let mut plan = Self {
            blocks: Vec::new(),
            n_local: 0,
            sources: vec![NONE; n_dofs * n_dofs],
            has_apart: false,
            n_coefficients: entries.coefficients.len(),
            flux: 0,
            integrals: Vec::new(),
            n_integrals: 0,
        };
        let mut pairs: Vec<(Component, Component)> = entries
            .list
            .iter()
            .map(|(t, s, _)| (Component::of(&binding.tests[*t]), Component::of(&binding.trials[*s])))
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        for (row, column) in pairs {
            if !(entries.symmetric && column < row) {
                plan.add_block(binding, group, entries, row, column);
            }
        }
        let n_points = group.bases.first().map_or(0, Basis::n_points);
        (plan.integrals, plan.n_integrals) = integrals::share(&mut plan.blocks, entries, n_points);
        plan
    }

    /// Groups of local dofs that are coupled, by nodes: those whose equations have an entry, and those that an entry
    /// multiplies. On a facet the value of a function that belongs to a node off the facet is zero, so such a dof is
    /// coupled only where a derivative is taken. There is one group, but where functions meet at no point.
    pub(super) fn coupled(&self, group: &GroupBinding) -> Vec<(Vec<usize>, Vec<usize>)> {
        let n_dofs = group.n_dofs();
        let present = |row: usize, column: usize| self.sources[row * n_dofs + column] != NONE;
        let is_row = |k: &usize| (0..n_dofs).any(|other| present(*k, other));
        let is_column = |k: &usize| (0..n_dofs).any(|other| present(other, *k));
        let all = ((0..n_dofs).filter(is_row).collect(), (0..n_dofs).filter(is_column).collect());
        if !self.has_apart {
            return vec![all];
        }
        // the least dof that each is connected with
        let mut first: Vec<usize> = (0..n_dofs).collect();
        let mut join = |a: usize, b: usize| {
            let (low, high) = (first[a].min(first[b]), first[a].max(first[b]));
            first.iter_mut().filter(|f| **f == high).for_each(|f| *f = low);
        };
        for basis in &group.bases {
            for node in 0..basis.n_nodes {
                (1..basis.n_components).for_each(|c| join(basis.dof(node, 0), basis.dof(node, c)));
            }
        }
        let pairs = (0..n_dofs).flat_map(|row| (0..n_dofs).map(move |column| (row, column)));
        pairs.filter(|(row, column)| present(*row, *column)).for_each(|(row, column)| join(row, column));
        let (rows, columns) = all;
        let of = |list: &[usize], k: usize| list.iter().copied().filter(|dof| first[*dof] == k).collect::<Vec<_>>();
        let groups = (0..n_dofs).map(|k| (of(&rows, k), of(&columns, k)));
        groups.filter(|(rows, _)| !rows.is_empty()).collect()
    }

    fn add_block(
        &mut self,
        binding: &Binding,
        group: &GroupBinding,
        entries: &Entries,
        row: Component,
        column: Component,
    ) {
        let is_here = |(test, trial, _): &&(usize, usize, usize)| {
            Component::of(&binding.tests[*test]) == row && Component::of(&binding.trials[*trial]) == column
        };
        let here: Vec<(usize, usize, usize)> = entries.list.iter().filter(is_here).copied().collect();
        let values_only =
            |mut places: &mut dyn Iterator<Item = &SlotPlace>| (&mut places).all(|p| p.op == FieldOp::Value);
        let rows_on_support = values_only(&mut here.iter().map(|(t, _, _)| &binding.tests[*t]));
        let columns_on_support = values_only(&mut here.iter().map(|(_, s, _)| &binding.trials[*s]));
        let operand = |p: &SlotPlace, on_support| group.bases[p.basis].operand(p.op, p.direction, on_support);
        let mut tests: Vec<usize> = here.iter().map(|(t, _, _)| *t).collect();
        tests.dedup();
        let rows: Vec<Row> = tests
            .iter()
            .map(|test| Row {
                tests: operand(&binding.tests[*test], rows_on_support),
                entries: here
                    .iter()
                    .filter(|(t, _, _)| t == test)
                    .map(|(_, s, c)| (*c, operand(&binding.trials[*s], columns_on_support)))
                    .collect(),
            })
            .collect();
        let (of_rows, of_columns) = (&group.bases[row.basis], &group.bases[column.basis]);
        let (row_nodes, column_nodes) = (of_rows.functions(rows_on_support), of_columns.functions(columns_on_support));
        let (n_tests, n_trials) = (row_nodes.len(), column_nodes.len());
        if n_tests == 0 || n_trials == 0 {
            return;
        }
        let is_triangle = entries.symmetric && row == column && rows_on_support == columns_on_support;
        let n_dofs = group.n_dofs();
        for (i, test) in row_nodes.iter().enumerate() {
            for (j, trial) in column_nodes.iter().enumerate() {
                if rows_on_support && columns_on_support && of_rows.is_apart(*test, of_columns, *trial) {
                    self.has_apart = true;
                    continue;
                }
                let test = of_rows.dof(*test, row.component);
                let trial = of_columns.dof(*trial, column.component);
                let (i, j) = if is_triangle { (i.min(j), i.max(j)) } else { (i, j) };
                let source = u32::try_from(self.n_local + i * n_trials + j).expect("small local matrices");
                self.sources[test * n_dofs + trial] = source;
                if entries.symmetric {
                    self.sources[trial * n_dofs + test] = source;
                }
            }
        }
        let n_points = of_columns.n_points();
        self.flux = self.flux.max(rows.len() * n_points * n_trials);
        self.blocks.push(Block { rows, n_tests, n_trials, start: self.n_local, is_triangle, sum: Vec::new() });
        self.n_local += n_tests * n_trials;
    }
}

/// Makes the local tangent of the batch in a workspace from the outputs of the kernel. False if a number is not finite.
pub(super) fn tangent(
    workspace: &mut Workspace,
    plan: &TangentPlan,
    entries: &Entries,
    group: &Group,
    binding: &GroupBinding,
    uniforms: &[f64],
) -> bool {
    let n_points = group.n_points();
    workspace.coefficients.resize(n_points * plan.n_coefficients, ZERO);
    workspace.integrals.resize(plan.n_integrals, ZERO);
    if workspace.flux.len() < plan.flux {
        workspace.flux.resize(plan.flux, ZERO);
    }
    workspace.local.resize(plan.n_local + 1, ZERO);
    workspace.local[plan.n_local] = ZERO;
    workspace.arch.dispatch(Tangent {
        plan,
        entries,
        uniforms,
        n_points,
        weights: &workspace.weights,
        outputs: &workspace.outputs,
        values: &binding.values,
        derivatives: &workspace.derivatives,
        coefficients: &mut workspace.coefficients,
        flux: &mut workspace.flux,
        integrals: &mut workspace.integrals,
        local: &mut workspace.local,
    })
}

struct Tangent<'a> {
    plan: &'a TangentPlan,
    entries: &'a Entries,
    uniforms: &'a [f64],
    n_points: usize,
    weights: &'a [Lanes],
    outputs: &'a [f64],
    values: &'a [Lanes],
    derivatives: &'a [Lanes],
    coefficients: &'a mut [Lanes],
    flux: &'a mut [Lanes],
    integrals: &'a mut [Lanes],
    local: &'a mut [Lanes],
}

impl WithSimd for Tangent<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> bool {
        let mut finite = self.sums::<S>(simd);
        if self.plan.blocks.iter().all(|block| !block.sum.is_empty()) {
            return finite;
        }
        self.weigh::<S>(simd);
        for block in self.plan.blocks.iter().filter(|block| block.sum.is_empty()) {
            if block.n_tests <= TILE {
                finite &= self.strips::<S>(simd, block);
                continue;
            }
            for (r, row) in block.rows.iter().enumerate() {
                let size = self.n_points * block.n_trials;
                let flux = &mut self.flux[r * size..][..size];
                for (q, flux) in flux.chunks_exact_mut(block.n_trials).enumerate() {
                    let coefficients = &self.coefficients[q * self.plan.n_coefficients..][..self.plan.n_coefficients];
                    let from = Trials { entries: &row.entries, values: self.values, derivatives: self.derivatives, q };
                    for p in 0..parts::<S>() {
                        from.flux::<S>(simd, coefficients, flux, p);
                    }
                }
            }
            let out = &mut self.local[block.start..][..block.n_tests * block.n_trials];
            for p in 0..parts::<S>() {
                let product = Product {
                    rows: &block.rows,
                    n_tests: block.n_tests,
                    n_trials: block.n_trials,
                    is_triangle: block.is_triangle,
                    n_points: self.n_points,
                    values: self.values,
                    derivatives: self.derivatives,
                    flux: self.flux,
                    p,
                };
                finite &= product.all::<S>(simd, out);
            }
        }
        finite
    }
}

impl Tangent<'_> {
    /// The blocks that are sums of integrals.
    #[inline(always)]
    fn sums<S: Simd>(&mut self, simd: S) -> bool {
        if self.plan.integrals.is_empty() {
            return true;
        }
        for (slot, coefficient) in self.coefficients.iter_mut().zip(&self.entries.coefficients) {
            *slot = match coefficient {
                Coefficient::Constant(c) => Lanes([*c; LANES]),
                Coefficient::Uniform(u) => Lanes([self.uniforms[*u]; LANES]),
                Coefficient::Output(_) => ZERO,
            };
        }
        let from = Sources { weights: self.weights, values: self.values, derivatives: self.derivatives };
        from.integrate::<S>(simd, &self.plan.integrals, self.flux, self.integrals);
        let zero = simd.splat_f64s(0.0);
        let mut check = [zero; TILE];
        for block in self.plan.blocks.iter().filter(|block| !block.sum.is_empty()) {
            let out = &mut self.local[block.start..][..block.n_tests * block.n_trials];
            for p in 0..parts::<S>() {
                let from = Trials { entries: &block.sum, values: &[], derivatives: self.integrals, q: 0 };
                from.flux::<S>(simd, self.coefficients, out, p);
                for numbers in out.chunks(TILE) {
                    for (check, number) in check.iter_mut().zip(numbers) {
                        *check = fused(simd, *check, load::<S>(number, p), zero);
                    }
                }
            }
        }
        check.into_iter().all(|sums| simd.reduce_sum_f64s(sums) == 0.0)
    }

    /// A block of few test functions.
    #[inline(always)]
    fn strips<S: Simd>(&mut self, simd: S, block: &Block) -> bool {
        let out = &mut self.local[block.start..][..block.n_tests * block.n_trials];
        let mut finite = true;
        for p in 0..parts::<S>() {
            let strips = Strips {
                rows: &block.rows,
                n_tests: block.n_tests,
                n_trials: block.n_trials,
                is_triangle: block.is_triangle,
                values: self.values,
                derivatives: self.derivatives,
                coefficients: self.coefficients,
                n_coefficients: self.plan.n_coefficients,
                p,
            };
            finite &= strips.all::<S>(simd, out);
        }
        finite
    }

    /// Entries times weights.
    #[inline(always)]
    fn weigh<S: Simd>(&mut self, simd: S) {
        let n = self.plan.n_coefficients;
        for (q, weight) in self.weights.iter().enumerate() {
            let out = &mut self.coefficients[q * n..][..n];
            let outputs = &self.outputs[q * self.entries.n_outputs * LANES..];
            for (slot, coefficient) in out.iter_mut().zip(&self.entries.coefficients) {
                for p in 0..parts::<S>() {
                    let factor = match coefficient {
                        Coefficient::Constant(c) => simd.splat_f64s(*c),
                        Coefficient::Uniform(u) => simd.splat_f64s(self.uniforms[*u]),
                        Coefficient::Output(k) => S::as_simd_f64s(&outputs[k * LANES..][..LANES]).0[p],
                    };
                    store::<S>(slot, p, simd.mul_f64s(load::<S>(weight, p), factor));
                }
            }
        }
    }
}

/// Entries of one test slot at one point.
#[derive(Clone, Copy)]
struct Trials<'a> {
    entries: &'a [(usize, Operand)],
    values: &'a [Lanes],
    derivatives: &'a [Lanes],
    q: usize,
}

impl Trials<'_> {
    /// `flux[j]` = sum over the entries of entry times trial function `j`.
    #[inline(always)]
    fn flux<S: Simd>(self, simd: S, coefficients: &[Lanes], flux: &mut [Lanes], p: usize) {
        let first = self.entries.len() % 3;
        match first {
            1 => self.some::<S, 1>(simd, 0, coefficients, flux, p),
            2 => self.some::<S, 2>(simd, 0, coefficients, flux, p),
            _ => {}
        }
        for e in (first..self.entries.len()).step_by(3) {
            self.some::<S, 3>(simd, e, coefficients, flux, p);
        }
    }

    #[inline(always)]
    fn some<S: Simd, const K: usize>(
        self,
        simd: S,
        first: usize,
        coefficients: &[Lanes],
        flux: &mut [Lanes],
        p: usize,
    ) {
        let entries = &self.entries[first..][..K];
        let mut factors = [simd.splat_f64s(0.0); K];
        let mut trials: [&[Lanes]; K] = [&[]; K];
        for k in 0..K {
            factors[k] = load::<S>(&coefficients[entries[k].0], p);
            trials[k] = &entries[k].1.at(self.values, self.derivatives, self.q)[..flux.len()];
        }
        for (j, slot) in flux.iter_mut().enumerate() {
            let mut sum = simd.mul_f64s(factors[0], load::<S>(&trials[0][j], p));
            for k in 1..K {
                sum = fused(simd, sum, factors[k], load::<S>(&trials[k][j], p));
            }
            let sum = if first == 0 { sum } else { simd.add_f64s(sum, load::<S>(slot, p)) };
            store::<S>(slot, p, sum);
        }
    }
}

/// Makes the local residual of the batch in a workspace from the fluxes, the first outputs of the kernel. False if a
/// number is not finite. Products are not fused with sums: forces in balance leave the same rests on every processor.
pub(super) fn residual(workspace: &mut Workspace, binding: &Binding, g: usize, n_outputs: usize) -> bool {
    let group = &binding.groups[g];
    workspace.local.clear();
    workspace.local.resize(group.n_dofs(), ZERO);
    workspace.arch.dispatch(Residual {
        tests: &binding.tests,
        group,
        n_outputs,
        weights: &workspace.weights,
        derivatives: &workspace.derivatives,
        outputs: &workspace.outputs,
        local: &mut workspace.local,
    })
}

struct Residual<'a> {
    tests: &'a [SlotPlace],
    group: &'a GroupBinding,
    n_outputs: usize,
    weights: &'a [Lanes],
    derivatives: &'a [Lanes],
    outputs: &'a [f64],
    local: &'a mut [Lanes],
}

impl WithSimd for Residual<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        for (q, weight) in self.weights.iter().enumerate() {
            for (t, place) in self.tests.iter().enumerate() {
                let basis = &self.group.bases[place.basis];
                let functions = basis.operand(place.op, place.direction, false);
                let functions = functions.at(&self.group.values, self.derivatives, q);
                let flux = S::as_simd_f64s(&self.outputs[(q * self.n_outputs + t) * LANES..][..LANES]).0;
                let local = &mut self.local[basis.offset..][..basis.n_dofs()];
                for p in 0..parts::<S>() {
                    let flux = simd.mul_f64s(load::<S>(weight, p), flux[p]);
                    for (slots, function) in local.chunks_exact_mut(basis.n_components).zip(functions) {
                        let slot = &mut slots[place.component];
                        store::<S>(slot, p, plus_product(simd, load::<S>(slot, p), load::<S>(function, p), flux));
                    }
                }
            }
        }
        let mut check = simd.splat_f64s(0.0);
        for number in self.local.iter() {
            for p in 0..parts::<S>() {
                check = plus_product(simd, check, load::<S>(number, p), simd.splat_f64s(0.0));
            }
        }
        simd.reduce_sum_f64s(check) == 0.0
    }
}
