//! The basis of a field at the points of a group, and where its numbers stand.
//!
//! Knows no laws: which slots read it is told from outside.

use std::sync::Arc;

use wfl_compiler::types::{FieldId, FieldOp, Side};

use crate::{
    assemble::simd::Lanes,
    domain::Group,
    field::{Field, FieldError},
    space::NodeList,
};
use wfl_mesh::{element::Table, mesh::Mesh};

/// A field on one side of a group: its basis at the points and its nodes in each entity.
#[derive(Clone, Debug)]
pub struct Basis {
    /// The field.
    pub field: FieldId,
    /// On which side.
    pub side: Side,
    /// Components at a node.
    pub n_components: usize,
    /// Nodes in an entity.
    pub n_nodes: usize,
    /// Values and reference derivatives at the points, those of a field on facets in the parameters of the facet.
    pub table: Table,
    /// Of a field on facets: derivatives of the reference point of the cell in those parameters.
    pub tangents: Option<[[f64; 3]; 2]>,
    /// Where entities are points: by entity its row of the table; else empty.
    pub rows: Arc<[u32]>,
    /// By entity how many of its nodes are its own, the others stand in and have no function; empty where all are.
    pub(super) counts: Vec<u16>,
    /// By entity the tangents, where they differ; else empty.
    pub(super) own_tangents: Vec<[[f64; 3]; 2]>,
    /// Highest derivative that a slot reads.
    pub order: usize,
    /// Node numbers: `nodes[entity * n_nodes + i]`.
    pub nodes: NodeList,
    /// Where its dofs start among the local dofs of the law.
    pub offset: usize,
    /// Functions whose value is not zero (to rounding) at all points: those of the nodes on the facet, as a rule.
    pub support: Vec<u16>,
    pub(super) starts: Starts,
}

/// Where the numbers of a basis start: values among those that every batch shares, derivatives in the workspace.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Starts {
    /// `[point][function]`
    pub(super) values: usize,
    /// `[point][function of the support]`
    pub(super) support: usize,
    /// `[direction][point][function]`, or `[direction][function]` where gradients are the same at all points.
    pub(super) gradients: usize,
    /// `[pair of directions][point][function]`
    pub(super) hessians: usize,
    /// Gradients are the same at all points: linear functions on cells with an affine map.
    pub(super) constant_gradients: bool,
    /// Entities are points: all numbers are in the workspace, those of one point.
    pub(super) own: bool,
}

/// Basis functions under one operation: those of point `q` start at `start + q * step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Operand {
    /// Among the values that every batch shares, else among the derivatives of the workspace.
    pub(super) is_value: bool,
    /// Of point 0.
    pub(super) start: usize,
    /// From point to point.
    pub(super) step: usize,
    /// How many functions.
    pub(super) n: usize,
}

impl Operand {
    /// The functions at a point.
    #[inline(always)]
    pub(super) fn at<'a>(&self, values: &'a [Lanes], derivatives: &'a [Lanes], q: usize) -> &'a [Lanes] {
        let from = if self.is_value { values } else { derivatives };
        &from[self.start + q * self.step..][..self.n]
    }
}

impl Basis {
    /// The same with the functions found that act at the points.
    pub(super) fn with_support(mut self) -> Self {
        let (n, values) = (self.n_nodes, &self.table.values);
        let is_zero = |i: usize| values.iter().skip(i).step_by(n).all(|v| v.abs() <= NO_VALUE);
        let acting = (0..n).filter(|i| !is_zero(*i)).map(|i| u16::try_from(i).expect("few functions")).collect();
        self.support = acting;
        self
    }

    /// The functions under an operation; `on_support` leaves out those whose value is zero at all points.
    pub(super) fn operand(&self, op: FieldOp, direction: usize, on_support: bool) -> Operand {
        let n = self.n_nodes;
        let derivatives = |start: usize| {
            let start = start + direction * self.n_points() * n;
            Operand { is_value: false, start, step: n, n }
        };
        let is_value = !self.starts.own;
        match op {
            FieldOp::Value if on_support => {
                let n = self.support.len();
                Operand { is_value, start: self.starts.support, step: n, n }
            }
            FieldOp::Value => Operand { is_value, start: self.starts.values, step: n, n },
            FieldOp::Grad if self.starts.constant_gradients => {
                Operand { is_value: false, start: self.starts.gradients + direction * n, step: 0, n }
            }
            FieldOp::Grad => derivatives(self.starts.gradients),
            FieldOp::Hess => derivatives(self.starts.hessians),
        }
    }

    /// All functions, or those of the support.
    pub(super) fn functions(&self, on_support: bool) -> Vec<usize> {
        if on_support { self.support.iter().map(|i| usize::from(*i)).collect() } else { (0..self.n_nodes).collect() }
    }

    /// Points of each entity.
    pub(super) fn n_points(&self) -> usize {
        if self.starts.own { 1 } else { self.table.n_points }
    }

    /// Whether one of two functions, this one and that of another basis, is zero (to rounding) at each point.
    pub(super) fn is_apart(&self, function: usize, other: &Self, of_other: usize) -> bool {
        // a number that all points share has one row where entities are points
        let row = |of: &Self, q: usize| q.min(of.table.n_points - 1) * of.n_nodes;
        let is_zero = |of: &Self, q: usize, k: usize| of.table.values[row(of, q) + k].abs() <= NO_VALUE;
        if self.starts.own && (self.side == Side::There || other.side == Side::There) {
            // other images have other rows
            return false;
        }
        let n = self.table.n_points.max(other.table.n_points);
        (0..n).all(|q| is_zero(self, q, function) || is_zero(other, q, of_other))
    }

    /// How many of the nodes of an entity are its own.
    pub(super) fn n_own_nodes(&self, entity: usize) -> usize {
        self.counts.get(entity).map_or(self.n_nodes, |count| usize::from(*count))
    }

    /// Local dof of a component at a node.
    pub(super) fn dof(&self, node: usize, component: usize) -> usize {
        self.offset + node * self.n_components + component
    }

    /// True if gradients are the same at all points.
    pub(super) fn has_constant_gradients(&self) -> bool {
        self.starts.constant_gradients
    }

    /// What the plan of a tangent takes of its functions at a point.
    pub(super) fn of_plan(&self) -> Functions {
        Functions {
            field: self.field,
            side: self.side,
            n: self.n_nodes,
            start: self.starts.values,
            order: self.order,
            support: self.support.clone(),
        }
    }

    /// Where its numbers start, of entities that are points; all of them are in the workspace.
    pub(super) fn start_at_point(&mut self, dim: usize, end: &mut usize) {
        let mut take = |size: usize| {
            *end += size;
            *end - size
        };
        let n = self.n_nodes;
        self.starts = Starts {
            values: take(n),
            support: take(self.support.len()),
            gradients: take(if self.order > 0 { dim * n } else { 0 }),
            hessians: take(if self.order > 1 { dim * dim * n } else { 0 }),
            constant_gradients: false,
            own: true,
        };
    }

    /// Numbers of points at entities that are points, from the numbers of these points.
    pub(super) fn at_points(field: &Field, id: FieldId, offset: usize, group: &Group, nodes: &[u32]) -> Self {
        let table =
            Table { n_points: 1, n_dofs: 1, dim: group.here.geometry.dim, values: vec![1.0], ..Table::default() };
        Self {
            field: id,
            side: Side::Here,
            n_components: field.n_components,
            n_nodes: 1,
            table,
            tangents: None,
            rows: group.one_row(),
            counts: Vec::new(),
            own_tangents: Vec::new(),
            order: 0,
            nodes: NodeList::from(nodes.to_vec()),
            offset,
            support: vec![0],
            starts: Starts::default(),
        }
    }

    /// Local dofs.
    #[must_use]
    pub fn n_dofs(&self) -> usize {
        self.n_nodes * self.n_components
    }
}

/// What the plan of a tangent takes of the functions of a basis at one point.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Functions {
    field: FieldId,
    side: Side,
    n: usize,
    start: usize,
    order: usize,
    support: Vec<u16>,
}

/// A basis function below this at every point does not act there; its largest value is 1.
pub(super) const NO_VALUE: f64 = 1e-14;

/// The basis of a field on one side of a group; derivatives to this order.
///
/// # Errors
/// [`FieldError`] when the field has no dofs on an entity.
pub(super) fn basis(
    mesh: &Mesh,
    group: &Group,
    field: &Field,
    id: FieldId,
    side: Side,
    order: usize,
    offset: usize,
) -> Result<Basis, FieldError> {
    let tabulated = field.tabulate(mesh, group, side, order)?;
    let n_nodes = tabulated.table.n_dofs;
    let basis = Basis {
        field: id,
        side,
        n_components: field.n_components,
        n_nodes,
        table: tabulated.table,
        tangents: tabulated.tangents,
        rows: tabulated.rows,
        counts: tabulated.counts,
        own_tangents: tabulated.own_tangents,
        order,
        nodes: tabulated.nodes,
        offset,
        support: Vec::new(),
        starts: Starts::default(),
    };
    Ok(basis.with_support())
}
