//! Evaluation of a point law on a batch: gather, geometry, physical basis functions, kernel inputs.
//!
//! A batch is [`LANES`] entities, one a lane; lanes past the last entity repeat it and are ignored by the caller. Every
//! lane goes through the same operations on every processor and products are not fused with sums, so that laws read
//! the same bits everywhere.

use pulp::{Arch, Simd, WithSimd};
use wfl_compiler::{
    ir::LANES,
    types::{FieldOp, InputSlot, RateOrder, Side},
};

use crate::assemble::{
    basis::Operand,
    binding::{Binding, GroupBinding, Input, Needs},
    branches::BranchCounts,
    geometry::{OwnRows, PointGeometry, Row, element_size, gather_nodes, length, make_unit},
    simd::{Lanes, ZERO, load, parts, plus_product, store},
};
use crate::domain::{Domain, Group, ImageMotion};
use crate::rates::{RateFactors, Rates};
use crate::window::Window;
use wfl_mesh::mesh::Mesh;

/// Values of all fields by [`wfl_compiler::types::FieldId`]: `values[node * n_components + component]`.
#[derive(Clone, Copy, Debug)]
pub struct FieldValues<'a> {
    /// At the requested state.
    pub current: &'a [&'a [f64]],
    /// At the end of the previous step; empty unless the scene uses the past.
    pub previous: &'a [&'a [f64]],
    /// Their rates; `None` unless the scene has some that are more than differences.
    pub rates: Option<&'a Rates>,
}

impl FieldValues<'_> {
    /// A step as point laws are told of it, with the scalars of these rates.
    #[must_use]
    pub fn with_present_rates(&self, window: Window) -> Window {
        window.with_rates(self.rates.map_or_else(RateFactors::default, Rates::factors))
    }
}

/// Reusable memory of one thread.
#[derive(Debug, Default)]
pub struct Workspace {
    /// The instructions this processor has.
    pub(super) arch: Arch,
    nodes_here: Vec<[Lanes; 3]>,
    nodes_there: Vec<[Lanes; 3]>,
    here: PointGeometry,
    there: PointGeometry,
    /// Physical derivatives of the basis functions, see [`Operand`].
    pub(super) derivatives: Vec<Lanes>,
    /// Weight times measure at each point.
    pub(super) weights: Vec<Lanes>,
    /// Area vectors of the points, where they are not those of the map there.
    areas: Vec<[Lanes; 3]>,
    /// Sizes of the cells here and there, if the law reads them.
    sizes: [Lanes; 2],
    /// Rows of the tables of entities that are points: of the geometry here and there, and of a basis.
    own: [OwnRows; 3],
    current: Vec<Lanes>,
    previous: Vec<Lanes>,
    histories: [Vec<Lanes>; 2],
    /// Kernel inputs, blocked.
    pub inputs: Vec<f64>,
    /// Kernel outputs, blocked.
    pub outputs: Vec<f64>,
    /// Weighted entries of the law, `[point][entry]`.
    pub(super) coefficients: Vec<Lanes>,
    /// Entries times trial functions, `[test slot][point][function]`.
    pub(super) flux: Vec<Lanes>,
    /// Integrals of products of functions.
    pub(super) integrals: Vec<Lanes>,
    /// Local residual or tangent.
    pub(super) local: Vec<Lanes>,
    /// A row of the local tangent.
    pub(super) row: Vec<Lanes>,
    /// Branches of this thread.
    pub(super) branches: BranchCounts,
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
        self.prepare_some(bound, g, batch, values, &bound.binding.needs);
    }

    /// As [`Self::prepare`], but only what is needed; other inputs and derivatives hold any numbers.
    pub(super) fn prepare_some(
        &mut self,
        bound: Bound<'_>,
        g: usize,
        batch: usize,
        values: FieldValues<'_>,
        needs: &Needs,
    ) {
        let (group, binding) = (&bound.domain.groups[g], &bound.binding.groups[g]);
        self.gather(bound, g, batch, values, needs);
        self.measure_cells(bound, group, needs);
        let n_points = group.n_points();
        self.weights.resize(n_points, ZERO);
        if self.derivatives.len() < binding.n_derivatives {
            self.derivatives.resize(binding.n_derivatives, ZERO);
        }
        self.inputs.resize(n_points * bound.binding.inputs.len() * LANES, 0.0);
        self.arch.dispatch(Points {
            workspace: self,
            inputs: &bound.binding.inputs,
            group,
            binding,
            needs,
            dim: bound.domain.dim,
            entities: std::array::from_fn(|l| (batch * LANES + l).min(group.entities.len() - 1)),
        });
    }

    fn gather(&mut self, bound: Bound<'_>, g: usize, batch: usize, values: FieldValues<'_>, needs: &Needs) {
        let (group, binding) = (&bound.domain.groups[g], &bound.binding.groups[g]);
        gather_nodes(bound.mesh, &group.here, batch, &mut self.nodes_here);
        if let Some(there) = &group.there {
            gather_nodes(bound.mesh, there, batch, &mut self.nodes_there);
        }
        let last = group.entities.len() - 1;
        let [first, second] = &mut self.histories;
        let stores = [&mut self.current, &mut self.previous, first, second];
        let of = |k: usize, field: usize| match k {
            0 => values.current.get(field).copied(),
            1 => values.previous.get(field).copied(),
            _ => {
                let order = if k == 2 { RateOrder::First } else { RateOrder::Second };
                values.rates.map(|r| r.history(order, field)).filter(|h| !h.is_empty())
            }
        };
        for (k, store) in stores.into_iter().enumerate() {
            if k > 1 && values.rates.is_none() {
                continue;
            }
            store.resize(binding.n_dofs(), ZERO);
            for (basis, _) in binding.bases.iter().zip(&needs.gather).filter(|(_, wanted)| **wanted) {
                let Some(field) = of(k, basis.field.index()) else { continue };
                let nc = basis.n_components;
                let store = &mut store[basis.offset..][..basis.n_dofs()];
                let entities: [&[u32]; LANES] = std::array::from_fn(|l| {
                    let entity = (batch * LANES + l).min(last);
                    &basis.nodes[entity * basis.n_nodes..][..basis.n_nodes]
                });
                for (k, slots) in store.chunks_exact_mut(nc).enumerate() {
                    let places = entities.map(|nodes| nodes[k] as usize * nc);
                    for (component, slot) in slots.iter_mut().enumerate() {
                        *slot = Lanes(places.map(|place| field[place + component]));
                    }
                }
            }
        }
    }

    /// The sizes of the cells, where an input asks for them.
    fn measure_cells(&mut self, bound: Bound<'_>, group: &Group, needs: &Needs) {
        let wanted = bound.binding.inputs.iter().zip(&needs.inputs).filter(|(_, wanted)| **wanted);
        for (input, _) in wanted {
            match (input, &group.there) {
                (Input::Geometry(InputSlot::ElementSize(Side::There)), Some(there)) => {
                    let face = group.edge_there.map(|_| there.facet_map().tangents);
                    element_size(bound.domain.dim, &there.corners, face, &self.nodes_there, &mut self.sizes[1]);
                }
                (Input::Geometry(InputSlot::ElementSize(_)), _) => {
                    let face = group.edge.and(group.tangents);
                    element_size(bound.domain.dim, &group.here.corners, face, &self.nodes_here, &mut self.sizes[0]);
                }
                _ => {}
            }
        }
    }

    /// The map of the batch prepared last at a point of its group: `inverse[j][i]`, derivative of reference coordinate j in
    /// direction i, and the magnitude of the determinant.
    pub(super) fn map_at(&mut self, group: &Group, dim: usize, q: usize) -> ([[Lanes; 3]; 3], Lanes) {
        self.arch.dispatch(MapAt { geometry: &mut self.here, nodes: &self.nodes_here, group, dim, q });
        (self.here.inverse, Lanes(self.here.determinant.map(f64::abs)))
    }

    /// The outward normal of a lane of the batch prepared last, at the last point of its rule.
    #[must_use]
    pub fn normal_at_the_end(&self, dim: usize, group: &Group, lane: usize) -> [f64; 3] {
        let mut normal = [ZERO; 3];
        self.here.normal(dim, group.reference_normal, &mut normal);
        normal.map(|component| component[lane])
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
}

/// The map of a batch at one point.
struct MapAt<'a> {
    geometry: &'a mut PointGeometry,
    nodes: &'a [[Lanes; 3]],
    group: &'a Group,
    dim: usize,
    q: usize,
}

impl WithSimd for MapAt<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let at = Row::of(&self.group.here.geometry, self.q);
        match self.dim {
            1 => self.geometry.evaluate::<S, 1, f64>(simd, at, self.nodes),
            2 => self.geometry.evaluate::<S, 2, f64>(simd, at, self.nodes),
            _ => self.geometry.evaluate::<S, 3, f64>(simd, at, self.nodes),
        }
    }
}

/// Everything at the points of a batch, in the instructions of this processor.
struct Points<'a> {
    workspace: &'a mut Workspace,
    inputs: &'a [Input],
    group: &'a Group,
    binding: &'a GroupBinding,
    needs: &'a Needs,
    dim: usize,
    /// By lane.
    entities: [usize; LANES],
}

impl WithSimd for Points<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        match self.dim {
            1 => self.all::<S, 1>(simd),
            2 => self.all::<S, 2>(simd),
            _ => self.all::<S, 3>(simd),
        }
    }
}

impl Points<'_> {
    #[inline(always)]
    fn all<S: Simd, const D: usize>(&mut self, simd: S) {
        if self.group.own.is_some() {
            return self.own_points::<S, D>(simd);
        }
        let mut measure = ZERO;
        self.node_areas::<S, D>(simd);
        for q in 0..self.group.n_points() {
            let (group, w) = (self.group, &mut *self.workspace);
            if q == 0 || !group.here.is_affine() {
                w.here.evaluate::<S, D, f64>(simd, Row::of(&group.here.geometry, q), &w.nodes_here);
                w.here.measure(D, group, &mut measure);
            }
            if let Some(area) = w.areas.get(q) {
                for l in 0..LANES {
                    measure[l] = length(area.map(|component| component[l]));
                }
            }
            if let Some(there) = &group.there
                && (q == 0 || !there.is_affine())
            {
                w.there.evaluate::<S, D, f64>(simd, Row::of(&there.geometry, q), &w.nodes_there);
            }
            if self.needs.position {
                w.here.locate::<S, D, f64>(simd, Row::of(&group.here.geometry, q), &w.nodes_here);
            }
            if let Some(there) = group.there.as_ref().filter(|_| self.needs.image) {
                w.there.locate::<S, D, f64>(simd, Row::of(&there.geometry, q), &w.nodes_there);
            }
            for l in 0..LANES {
                w.weights[q][l] = measure[l] * group.weights[q];
            }
            self.derivatives::<S, D>(simd, q);
            self.fill_inputs::<S, D>(simd, q);
        }
    }

    /// The same where entities are points: a point of each lane, with its own row of every table.
    #[inline(always)]
    fn own_points<S: Simd, const D: usize>(&mut self, simd: S) {
        let (group, w) = (self.group, &mut *self.workspace);
        let Some(of_points) = &group.own else { return };
        let [here, there, _] = &mut w.own;
        let order = |side: Side| {
            let orders = self.binding.bases.iter().zip(&self.needs.orders).filter(|(basis, _)| basis.side == side);
            orders.map(|(_, order)| *order).max().unwrap_or(0).max(1)
        };
        here.gather(&group.here.geometry, self.entities.map(|k| group.here.row(k, 0)), order(Side::Here));
        w.here.evaluate::<S, D, Lanes>(simd, here.row(), &w.nodes_here);
        if self.needs.position {
            w.here.locate::<S, D, Lanes>(simd, here.row(), &w.nodes_here);
        }
        if let Some(images) = &group.there {
            let table = self.binding.bent.as_ref().unwrap_or(&images.geometry);
            there.gather(table, self.entities.map(|k| images.row(k, 0)), order(Side::There));
            w.there.evaluate::<S, D, Lanes>(simd, there.row(), &w.nodes_there);
            if self.needs.image {
                w.there.locate::<S, D, Lanes>(simd, there.row(), &w.nodes_there);
            }
        }
        let mut measure = ZERO;
        w.here.measure(D, group, &mut measure);
        for l in 0..LANES {
            w.weights[0][l] = measure[l] * of_points.weights[self.entities[l]];
        }
        self.own_functions::<S, D>(simd);
        self.fill_inputs::<S, D>(simd, 0);
    }

    /// Values and physical derivatives of the basis functions, of one point in each lane.
    #[inline(always)]
    fn own_functions<S: Simd, const D: usize>(&mut self, simd: S) {
        let (group, w) = (self.group, &mut *self.workspace);
        for (basis, order) in self.binding.bases.iter().zip(&self.needs.orders) {
            let [here, there, own] = &mut w.own;
            own.gather(&basis.table, self.entities.map(|k| basis.rows[k] as usize), *order);
            let row = own.row();
            let values = basis.operand(FieldOp::Value, 0, false).start;
            w.derivatives[values..][..row.values.len()].copy_from_slice(row.values);
            let on_support = basis.operand(FieldOp::Value, 0, true);
            for (slot, k) in w.derivatives[on_support.start..][..on_support.n].iter_mut().zip(&basis.support) {
                *slot = row.values[usize::from(*k)];
            }
            if *order == 0 {
                continue;
            }
            let is_there = basis.side == Side::There && group.there.is_some();
            let (geometry, of_map, nodes) =
                if is_there { (&w.there, there, &w.nodes_there) } else { (&w.here, here, &w.nodes_here) };
            let (from, stride) = (basis.operand(FieldOp::Grad, 0, false).start, basis.n_nodes);
            if let Some(tangents) = &basis.tangents {
                let own = |t: usize, d: usize| {
                    Lanes(self.entities.map(|k| basis.own_tangents.get(k).unwrap_or(tangents)[t][d]))
                };
                let tangents = [0, 1].map(|t| [0, 1, 2].map(|d| own(t, d)));
                let out = &mut w.derivatives[from..];
                geometry.surface_gradients(D, &tangents, row.gradients, basis.n_nodes, out, stride);
                continue;
            }
            geometry.gradients::<S, D, Lanes>(simd, row, &mut w.derivatives[from..], stride);
            if *order > 1 {
                let hessians = basis.operand(FieldOp::Hess, 0, false).start;
                let (before, after) = w.derivatives.split_at_mut(hessians);
                geometry.hessians(D, row, of_map.row(), nodes, &before[from..], after, stride);
            }
        }
    }

    /// The area vectors of the points of a nodal rule on quadrilateral faces; none elsewhere.
    #[inline(always)]
    fn node_areas<S: Simd, const D: usize>(&mut self, simd: S) {
        let (group, w) = (self.group, &mut *self.workspace);
        w.areas.clear();
        if let (Some(of), Some(tangents), 3) = (&group.areas, &group.tangents, D) {
            w.areas.resize(group.n_points(), [ZERO; 3]);
            w.here.areas(simd, of, tangents, &w.nodes_here, &mut w.areas);
        }
    }

    /// Physical derivatives of the basis functions at point `q`.
    #[inline(always)]
    fn derivatives<S: Simd, const D: usize>(&mut self, simd: S, q: usize) {
        let (group, w) = (self.group, &mut *self.workspace);
        for (basis, order) in self.binding.bases.iter().zip(&self.needs.orders) {
            if *order == 0 || (q > 0 && basis.has_constant_gradients()) {
                continue;
            }
            let (geometry, table, nodes) = match (basis.side, &group.there) {
                (Side::There, Some(there)) => (&w.there, &there.geometry, &w.nodes_there),
                _ => (&w.here, &group.here.geometry, &w.nodes_here),
            };
            let first = basis.operand(FieldOp::Grad, 0, false);
            let stride = basis.operand(FieldOp::Grad, 1, false).start - first.start;
            let from = first.start + q * first.step;
            if let Some(tangents) = &basis.tangents {
                let (table, out) = (&basis.table, &mut w.derivatives[from..]);
                geometry.surface_gradients(D, tangents, Row::of(table, q).gradients, table.n_dofs, out, stride);
                continue;
            }
            let row = Row::of(&basis.table, q);
            geometry.gradients::<S, D, f64>(simd, row, &mut w.derivatives[from..], stride);
            if *order > 1 {
                let hessians = basis.operand(FieldOp::Hess, 0, false);
                let (before, after) = w.derivatives.split_at_mut(hessians.start);
                let out = &mut after[q * hessians.step..];
                geometry.hessians(D, row, Row::of(table, q), nodes, &before[from..], out, stride);
            }
        }
    }

    #[inline(always)]
    fn fill_inputs<S: Simd, const D: usize>(&mut self, simd: S, q: usize) {
        let n = self.inputs.len();
        let (mut normal, mut image_normal): (Option<[Lanes; 3]>, Option<[Lanes; 3]>) = (None, None);
        for (slot, (input, wanted)) in self.inputs.iter().zip(&self.needs.inputs).enumerate() {
            if !wanted {
                continue;
            }
            let w = &*self.workspace;
            let value = match input {
                Input::Current(place) | Input::Previous(place) | Input::History(_, place) => {
                    let values = match input {
                        Input::Previous(_) => &w.previous,
                        Input::History(RateOrder::First, _) => &w.histories[0],
                        Input::History(RateOrder::Second, _) => &w.histories[1],
                        _ => &w.current,
                    };
                    let basis = &self.binding.bases[place.basis];
                    let operand = basis.operand(place.op, place.direction, false);
                    let values = &values[basis.offset..][..basis.n_dofs()];
                    self.field(simd, operand, q, values, basis.n_components, place.component)
                }
                Input::Geometry(InputSlot::Normal(Side::There, k)) if self.group.there_normal.is_some() => {
                    image_normal.get_or_insert_with(|| self.image_normal(D))[usize::from(*k)]
                }
                Input::Geometry(InputSlot::Normal(side, k)) => {
                    let n = normal.get_or_insert_with(|| {
                        let mut n = [ZERO; 3];
                        match w.areas.get(q) {
                            Some(area) => {
                                n = *area;
                                make_unit(D, &mut n);
                            }
                            None => w.here.normal(D, self.group.reference_normal, &mut n),
                        }
                        n
                    });
                    let component = n[usize::from(*k)];
                    if *side == Side::There { Lanes(component.map(|x| -x)) } else { component }
                }
                Input::Geometry(InputSlot::Conormal(side, k)) => {
                    let mut conormal = [ZERO; 3];
                    match (side, &self.group.there, &self.group.edge_there, &self.group.edge) {
                        (Side::There, Some(there), Some(edge), _) => {
                            w.there.conormal(D, &there.facet_map().tangents, edge, &mut conormal);
                        }
                        (.., Some(edge)) => {
                            w.here.conormal(D, &self.group.tangents.unwrap_or_default(), edge, &mut conormal);
                        }
                        _ => {}
                    }
                    conormal[usize::from(*k)]
                }
                Input::Geometry(slot) => self.geometry(D, *slot),
            };
            self.workspace.inputs[(q * n + slot) * LANES..][..LANES].copy_from_slice(&*value);
        }
    }

    /// How images shift, by lane.
    #[inline(always)]
    fn motions(&self) -> [Option<&ImageMotion>; LANES] {
        self.entities.map(|k| self.group.motion(k))
    }

    /// The outward unit normal of the faces that images lie on.
    fn image_normal(&self, dim: usize) -> [Lanes; 3] {
        let mut normal = [ZERO; 3];
        let own = self.group.own.as_ref().map(|own| &own.there_normals);
        match own.filter(|normals| !normals.is_empty()) {
            Some(normals) => {
                let of = |d: usize| Lanes(self.entities.map(|k| normals[k][d]));
                self.workspace.there.normal(dim, [of(0), of(1), of(2)], &mut normal);
            }
            None => self.workspace.there.normal(dim, self.group.there_normal.unwrap_or_default(), &mut normal),
        }
        normal
    }

    fn geometry(&self, dim: usize, slot: InputSlot) -> Lanes {
        let w = &*self.workspace;
        let two_sided = self.group.there.is_some();
        let of = |side: Side| if side == Side::There && two_sided { &w.there } else { &w.here };
        match slot {
            InputSlot::X(k) => w.here.x[usize::from(k)],
            InputSlot::ImageX(k) => {
                let mut x = of(Side::There).x[usize::from(k)];
                for (x, motion) in x.0.iter_mut().zip(self.motions()) {
                    *x = motion.and_then(|motion| motion.stand_in).map_or(*x, |place| place[usize::from(k)]);
                }
                x
            }
            InputSlot::ImageShift(e) => Lanes(self.motions().map(|m| m.map_or(0.0, |m| m.shift[usize::from(e)]))),
            InputSlot::ImageSlope(e) => Lanes(self.motions().map(|m| m.map_or(0.0, |m| m.slope[usize::from(e)]))),
            InputSlot::ElementSize(side) => w.sizes[usize::from(side == Side::There && two_sided)],
            // entry i + dim * j of K = dx_i/dxi_j; of B = K^-T, so B_ij = inverse_ji
            InputSlot::ElementK(side, e) => of(side).jacobian[usize::from(e) % dim][usize::from(e) / dim],
            InputSlot::ElementB(side, e) => of(side).inverse[usize::from(e) / dim][usize::from(e) % dim],
            InputSlot::Normal(..)
            | InputSlot::Conormal(..)
            | InputSlot::Field(_)
            | InputSlot::Previous(_)
            | InputSlot::History(..) => ZERO,
        }
    }

    /// Sum over the basis functions of function times nodal value.
    #[inline(always)]
    fn field<S: Simd>(
        &self,
        simd: S,
        operand: Operand,
        q: usize,
        values: &[Lanes],
        n_components: usize,
        component: usize,
    ) -> Lanes {
        let functions = operand.at(&self.binding.values, &self.workspace.derivatives, q);
        let mut out = ZERO;
        for p in 0..parts::<S>() {
            let mut sum = simd.splat_f64s(0.0);
            for (function, nodal) in functions.iter().zip(values.chunks_exact(n_components)) {
                sum = plus_product(simd, sum, load::<S>(function, p), load::<S>(&nodal[component], p));
            }
            store::<S>(&mut out, p, sum);
        }
        out
    }
}
