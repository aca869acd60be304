//! Evaluation of a point law on a batch: gather, geometry, kernel, contraction with the basis functions.
//!
//! The formula: residual of test dof (i, c) is the sum over points of w (N_i f_c + dN_i/dx_d f_cd); the tangent the
//! same with the law's entries on both sides. A batch is [`LANES`] entities, one a lane; lanes past the last entity
//! repeat it and are ignored by the caller.

use wfl_compiler::{
    ir::LANES,
    types::{FieldOp, InputSlot, Side},
};

use crate::{
    assemble::{
        binding::{Binding, GroupBinding, Input, SlotPlace},
        domain::{Domain, Group},
        geometry::{Lanes, PointGeometry, ZERO, add_product, add_scaled, element_size, gather_nodes},
    },
    mesh::Mesh,
};

/// Values of all fields by [`wfl_compiler::types::FieldId`]: `values[node * n_components + component]`.
#[derive(Clone, Copy, Debug)]
pub struct FieldValues<'a> {
    /// At the state asked for.
    pub current: &'a [&'a [f64]],
    /// At the end of the previous step; empty unless the scene uses the past.
    pub previous: &'a [&'a [f64]],
}

/// Basis functions of one field and side at one point, in physical space.
#[derive(Clone, Debug, Default)]
struct PointBasis {
    gradients: Vec<[Lanes; 3]>,
    hessians: Vec<[Lanes; 9]>,
}

/// Reusable memory of one thread.
#[derive(Debug, Default)]
pub struct Workspace {
    nodes_here: Vec<[Lanes; 3]>,
    nodes_there: Vec<[Lanes; 3]>,
    here: PointGeometry,
    there: PointGeometry,
    /// `bases[point * n_bases + basis]`
    bases: Vec<PointBasis>,
    /// Weight times measure at each point.
    weights: Vec<Lanes>,
    /// Sizes of the cells here and there, if the law reads them.
    sizes: [Lanes; 2],
    current: Vec<Lanes>,
    previous: Vec<Lanes>,
    /// Kernel inputs, blocked.
    pub inputs: Vec<f64>,
    /// Kernel outputs, blocked.
    pub outputs: Vec<f64>,
    flux: Vec<Lanes>,
}

/// A law on a domain with everything that evaluation reads.
#[derive(Clone, Copy, Debug)]
pub struct Bound<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Where.
    pub domain: &'a Domain,
    /// Slots and tables.
    pub binding: &'a Binding,
}

impl Workspace {
    /// Fills kernel inputs, weights and physical basis functions of batch `batch` of group `g`.
    pub fn prepare(&mut self, bound: Bound<'_>, g: usize, batch: usize, values: FieldValues<'_>) {
        let (group, binding) = (&bound.domain.groups[g], &bound.binding.groups[g]);
        self.gather(bound, g, batch, values);
        self.measure_cells(bound, group);
        let n_bases = binding.bases.len();
        let n_points = group.n_points();
        self.weights.resize(n_points, ZERO);
        self.bases.resize(n_points * n_bases, PointBasis::default());
        self.inputs.resize(n_points * bound.binding.inputs.len() * LANES, 0.0);
        for q in 0..n_points {
            self.point(bound.domain.dim, group, binding, q);
            self.fill_inputs(bound, group, binding, q);
        }
    }

    fn gather(&mut self, bound: Bound<'_>, g: usize, batch: usize, values: FieldValues<'_>) {
        let (group, binding) = (&bound.domain.groups[g], &bound.binding.groups[g]);
        gather_nodes(bound.mesh, &group.here, batch, &mut self.nodes_here);
        if let Some(there) = &group.there {
            gather_nodes(bound.mesh, there, batch, &mut self.nodes_there);
        }
        self.current.clear();
        self.previous.clear();
        let last = group.entities.len() - 1;
        for basis in &binding.bases {
            let nc = basis.n_components;
            for (store, all) in [(&mut self.current, values.current), (&mut self.previous, values.previous)] {
                let Some(field) = all.get(basis.field.index()) else { continue };
                let start = store.len();
                store.resize(start + basis.n_dofs(), ZERO);
                for l in 0..LANES {
                    let entity = (batch * LANES + l).min(last);
                    for (i, node) in basis.nodes[entity * basis.n_nodes..][..basis.n_nodes].iter().enumerate() {
                        for c in 0..nc {
                            store[start + i * nc + c][l] = field[*node as usize * nc + c];
                        }
                    }
                }
            }
        }
    }

    /// The sizes of the cells, where an input asks for them.
    fn measure_cells(&mut self, bound: Bound<'_>, group: &Group) {
        for input in &bound.binding.inputs {
            match (input, &group.there) {
                (Input::Geometry(InputSlot::ElementSize(Side::There)), Some(there)) => {
                    element_size(bound.domain.dim, &there.corners, &self.nodes_there, &mut self.sizes[1]);
                }
                (Input::Geometry(InputSlot::ElementSize(_)), _) => {
                    element_size(bound.domain.dim, &group.here.corners, &self.nodes_here, &mut self.sizes[0]);
                }
                _ => {}
            }
        }
    }

    fn point(&mut self, dim: usize, group: &Group, binding: &GroupBinding, q: usize) {
        self.here.evaluate(dim, &group.here.geometry, q, &self.nodes_here);
        if let Some(there) = &group.there {
            self.there.evaluate(dim, &there.geometry, q, &self.nodes_there);
        }
        let mut measure = ZERO;
        self.here.measure(dim, group, &mut measure);
        self.weights[q] = measure.map(|m| m * group.weights[q]);
        for (k, basis) in binding.bases.iter().enumerate() {
            if basis.order == 0 {
                continue;
            }
            let slot = &mut self.bases[q * binding.bases.len() + k];
            slot.gradients.resize(basis.n_nodes, [ZERO; 3]);
            let (geometry, table, nodes) = match (basis.side, &group.there) {
                (Side::There, Some(there)) => (&self.there, &there.geometry, &self.nodes_there),
                _ => (&self.here, &group.here.geometry, &self.nodes_here),
            };
            geometry.gradients(dim, &basis.table, q, &mut slot.gradients);
            if basis.order > 1 {
                slot.hessians.resize(basis.n_nodes, [ZERO; 9]);
                geometry.hessians(dim, &basis.table, table, nodes, q, &slot.gradients, &mut slot.hessians);
            }
        }
    }

    fn fill_inputs(&mut self, bound: Bound<'_>, group: &Group, binding: &GroupBinding, q: usize) {
        let dim = bound.domain.dim;
        let n = bound.binding.inputs.len();
        let mut normal: Option<[Lanes; 3]> = None;
        for (slot, input) in bound.binding.inputs.iter().enumerate() {
            let value = match input {
                Input::Current(place) => self.field(binding, place, q, &self.current),
                Input::Previous(place) => self.field(binding, place, q, &self.previous),
                Input::Geometry(InputSlot::Normal(side, k)) => {
                    let n = normal.get_or_insert_with(|| {
                        let mut n = [ZERO; 3];
                        self.here.normal(dim, group.reference_normal, &mut n);
                        n
                    });
                    let component = n[usize::from(*k)];
                    if *side == Side::There { component.map(|x| -x) } else { component }
                }
                Input::Geometry(slot) => self.geometry(dim, group, *slot),
            };
            self.inputs[(q * n + slot) * LANES..][..LANES].copy_from_slice(&value);
        }
    }

    fn geometry(&self, dim: usize, group: &Group, slot: InputSlot) -> Lanes {
        let two_sided = group.there.is_some();
        let of = |side: Side| if side == Side::There && two_sided { &self.there } else { &self.here };
        match slot {
            InputSlot::X(k) => self.here.x[usize::from(k)],
            InputSlot::ElementSize(side) => self.sizes[usize::from(side == Side::There && two_sided)],
            // entry i + dim * j of K = dx_i/dxi_j; of B = K^-T, so B_ij = inverse_ji
            InputSlot::ElementK(side, e) => of(side).jacobian[usize::from(e) % dim][usize::from(e) / dim],
            InputSlot::ElementB(side, e) => of(side).inverse[usize::from(e) / dim][usize::from(e) % dim],
            InputSlot::Normal(..) | InputSlot::Field(_) | InputSlot::Previous(_) => ZERO,
        }
    }

    fn field(&self, binding: &GroupBinding, place: &SlotPlace, q: usize, values: &[Lanes]) -> Lanes {
        let basis = &binding.bases[place.basis];
        let values = &values[basis.offset..][..basis.n_dofs()];
        let nc = basis.n_components;
        let mut sum = ZERO;
        match place.op {
            FieldOp::Value => {
                let row = &basis.table.values[q * basis.n_nodes..][..basis.n_nodes];
                for (i, value) in row.iter().enumerate() {
                    add_scaled(&mut sum, *value, &values[i * nc + place.component]);
                }
            }
            FieldOp::Grad => {
                let point = &self.bases[q * binding.bases.len() + place.basis];
                for (i, gradient) in point.gradients.iter().enumerate() {
                    add_product(&mut sum, &gradient[place.direction], &values[i * nc + place.component]);
                }
            }
            FieldOp::Hess => {
                let point = &self.bases[q * binding.bases.len() + place.basis];
                for (i, hessian) in point.hessians.iter().enumerate() {
                    add_product(&mut sum, &hessian[place.direction], &values[i * nc + place.component]);
                }
            }
        }
        sum
    }

    /// Weight times measure at point `q`.
    #[must_use]
    pub fn weight(&self, q: usize) -> &Lanes {
        &self.weights[q]
    }

    /// Output `k` of the kernel at point `q`.
    #[must_use]
    pub fn output(&self, n_outputs: usize, q: usize, k: usize) -> &[f64] {
        &self.outputs[(q * n_outputs + k) * LANES..][..LANES]
    }

    /// Adds the fluxes of all points to the local residual `out[local dof]`.
    pub fn contract_residual(&mut self, bound: Bound<'_>, g: usize, n_outputs: usize, out: &mut [Lanes]) {
        let (group, binding) = (&bound.domain.groups[g], &bound.binding.groups[g]);
        for q in 0..group.n_points() {
            let weight = self.weights[q];
            for (t, place) in bound.binding.tests.iter().enumerate() {
                let mut flux = ZERO;
                let value = &self.outputs[(q * n_outputs + t) * LANES..][..LANES];
                for l in 0..LANES {
                    flux[l] = weight[l] * value[l];
                }
                let basis = &binding.bases[place.basis];
                for i in 0..basis.n_nodes {
                    let slot = &mut out[basis.offset + i * basis.n_components + place.component];
                    self.multiply(binding, place, q, i, &flux, slot);
                }
            }
        }
    }

    /// `out += (basis function i under the operation of `place`) * factor`
    #[inline(always)]
    fn multiply(&self, binding: &GroupBinding, place: &SlotPlace, q: usize, i: usize, factor: &Lanes, out: &mut Lanes) {
        let basis = &binding.bases[place.basis];
        match place.op {
            FieldOp::Value => add_scaled(out, basis.table.values[q * basis.n_nodes + i], factor),
            FieldOp::Grad => {
                let point = &self.bases[q * binding.bases.len() + place.basis];
                add_product(out, &point.gradients[i][place.direction], factor);
            }
            FieldOp::Hess => {
                let point = &self.bases[q * binding.bases.len() + place.basis];
                add_product(out, &point.hessians[i][place.direction], factor);
            }
        }
    }

    /// Adds the entries of all points to the local tangent `out[row * n_dofs + column]`.
    ///
    /// `entries` are pairs of test and trial slot sorted by test slot; their values follow the fluxes in the outputs.
    pub fn contract_tangent(
        &mut self,
        bound: Bound<'_>,
        g: usize,
        n_outputs: usize,
        entries: &[(u16, u16)],
        out: &mut [Lanes],
    ) {
        let (group, binding) = (&bound.domain.groups[g], &bound.binding.groups[g]);
        let n_dofs = binding.n_dofs();
        let first = bound.binding.tests.len();
        let mut flux = std::mem::take(&mut self.flux);
        for q in 0..group.n_points() {
            let weight = self.weights[q];
            let mut k = 0;
            while k < entries.len() {
                // one test slot and the trial slots of one component of one basis: a run of entries
                let (test, trial) = entries[k];
                let row_place = bound.binding.tests[usize::from(test)];
                let column_place = bound.binding.trials[usize::from(trial)];
                let end = run_end(bound.binding, entries, k);
                let column_basis = &binding.bases[column_place.basis];
                // flux[j * components + c]: the test flux when trial dof (j, c) moves
                let nc = column_basis.n_components;
                flux.clear();
                flux.resize(column_basis.n_dofs(), ZERO);
                let mut used = [false; 16];
                for (e, (_, s)) in entries.iter().enumerate().take(end).skip(k) {
                    let place = bound.binding.trials[usize::from(*s)];
                    let value = &self.outputs[(q * n_outputs + first + e) * LANES..][..LANES];
                    let mut coefficient = ZERO;
                    for l in 0..LANES {
                        coefficient[l] = weight[l] * value[l];
                    }
                    used[place.component.min(15)] = true;
                    for j in 0..column_basis.n_nodes {
                        let slot = &mut flux[j * nc + place.component];
                        self.multiply(binding, &place, q, j, &coefficient, slot);
                    }
                }
                let row_basis = &binding.bases[row_place.basis];
                for i in 0..row_basis.n_nodes {
                    let row = row_basis.offset + i * row_basis.n_components + row_place.component;
                    let row = &mut out[row * n_dofs + column_basis.offset..][..column_basis.n_dofs()];
                    for (column, (slot, f)) in row.iter_mut().zip(&flux).enumerate() {
                        if used[(column % nc).min(15)] {
                            self.multiply(binding, &row_place, q, i, f, slot);
                        }
                    }
                }
                k = end;
            }
        }
        self.flux = flux;
    }
}

/// End of the run of entries that share the test slot and the trial basis of entry `k`.
fn run_end(binding: &Binding, entries: &[(u16, u16)], k: usize) -> usize {
    let (test, trial) = entries[k];
    let basis = binding.trials[usize::from(trial)].basis;
    let same = |e: &(u16, u16)| e.0 == test && binding.trials[usize::from(e.1)].basis == basis;
    k + entries[k..].iter().take_while(|e| same(e)).count()
}
