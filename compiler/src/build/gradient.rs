//! `Grad(expr)`: the symbolic gradient in space. Fields have two derivatives; a third one is refused.

use wfl::{Code, Diagnostic, ast::Expr};

use crate::{
    build::Builder,
    derive::derive,
    graph::{ExprId, Graph, Leaf, Node, Role},
    types::{FieldId, FieldOp, FieldSig, PlaceKind, Side},
};

/// How the symbolic gradient of an expression came out of one direction.
#[derive(Clone, Copy, Default)]
pub(super) struct Reach {
    /// A third derivative of a field of cells is needed.
    third: bool,
    /// The second derivative of this field, which lives on faces, is needed.
    second_on_faces: Option<FieldId>,
}

/// The derivative of a leaf along axis `k`, where it has one.
pub(super) fn along_axis(
    g: &mut Graph,
    leaf: Leaf,
    k: usize,
    fields: &[FieldSig],
    reach: &mut Reach,
) -> Option<ExprId> {
    match leaf {
        Leaf::X => {
            let x = g.leaf(Leaf::X);
            let shape = g.shape(x);
            let unit: Vec<f64> = (0..shape.len()).map(|i| if i == k { 1.0 } else { 0.0 }).collect();
            Some(g.constant(shape, &unit))
        }
        Leaf::Field { field, .. } if g.is_global(field) => None,
        Leaf::Field { field, side, op, role } => {
            let next = match op {
                FieldOp::Value => FieldOp::Grad,
                FieldOp::Grad if fields[field.index()].on_faces => {
                    reach.second_on_faces = Some(field);
                    return None;
                }
                FieldOp::Grad => FieldOp::Hess,
                FieldOp::Hess => {
                    reach.third = true;
                    return None;
                }
            };
            let full = g.leaf(Leaf::Field { field, side, op: next, role });
            let rank = g.shape(full).rank();
            let mut fixed = vec![None; rank];
            fixed[rank - 1] = Some(k);
            Some(g.pick(full, &fixed))
        }
        _ => None,
    }
}

impl Builder<'_> {
    /// The symbolic gradient of an expression: one more index at the end. With a field in it that lives on faces it is the
    /// gradient along the face: what other fields and the position change across the face is left out.
    pub(crate) fn gradient(&mut self, e: &Expr, value: ExprId) -> Option<ExprId> {
        let shape = self.graph.shape(value);
        let dim = self.env.dim;
        let Some(result) = shape.with_last(dim) else {
            let d = Diagnostic::new(Code::E110, "the gradient of this tensor has too many indices");
            return self.report(d, e, "");
        };
        if self.graph.mapping.is_some() && reads_image(&self.graph, value) {
            let d = Diagnostic::new(Code::E111, "the gradient of a value at the image of a mapping is not available")
                .help("Interpolate(Grad_u, m) is the gradient at the image, in the coordinates there");
            return self.report(d, e, "");
        }
        if let Node::Leaf(Leaf::Field { field, side, op, role }) = *self.graph.node(value) {
            return self.next_derivative(e, field, side, op, role);
        }
        let mut columns = Vec::with_capacity(dim);
        for k in 0..dim {
            let mut reach = Reach::default();
            let fields = self.env.fields;
            let moved = derive(&mut self.graph, value, &mut |g, leaf| along_axis(g, leaf, k, fields, &mut reach));
            if let Some(field) = reach.second_on_faces {
                return self.no_second_gradient(e, field);
            }
            if reach.third {
                let d = Diagnostic::new(Code::E111, "third derivatives of a field are not available");
                return self.report(d, e, "");
            }
            match moved {
                Ok(d) => columns.push(d),
                Err(no) => return self.no_derivative(e, no.what),
            }
        }
        let entries: Vec<ExprId> =
            (0..result.len()).map(|p| self.graph.entry(columns[p / shape.len()], p % shape.len())).collect();
        let full = self.graph.stack(result, &entries);
        Some(if self.on_faces(value) { self.along_the_face(full) } else { full })
    }

    /// True if a field of the expression lives on faces.
    fn on_faces(&self, value: ExprId) -> bool {
        let is_on_faces = |field: FieldId| self.env.fields[field.index()].on_faces;
        let reached = self.graph.reachable(value).into_iter();
        reached
            .map(|e| self.graph.node(e))
            .any(|n| matches!(n, Node::Leaf(Leaf::Field { field, .. }) if is_on_faces(*field)))
    }

    /// A gradient without its part across the face, `G - (G.Normal)@Normal`. The sign of the normal does not count.
    fn along_the_face(&mut self, gradient: ExprId) -> ExprId {
        // across an edge the surface may have another direction
        let is_there = self.place.kind == PlaceKind::InnerEdges && reads_image(&self.graph, gradient);
        let normal = self.graph.leaf(Leaf::Normal(if is_there { Side::There } else { Side::Here }));
        let last = self.graph.shape(gradient).rank() - 1;
        let across = self.graph.contract(gradient, normal, &[(last, 0)]);
        let across = self.graph.contract(across, normal, &[]);
        self.graph.sub(gradient, across)
    }

    /// What is said of a second derivative of a field that lives on faces.
    pub(crate) fn no_second_gradient<T>(&mut self, e: &Expr, field: FieldId) -> Option<T> {
        let sig = &self.env.fields[field.index()];
        let name = &sig.name;
        let d =
            Diagnostic::new(Code::E208, format!("`{name}` lives on faces: it has no second derivatives")).about(name);
        let kind = if sig.shape.rank() == 0 { "vector" } else { "matrix" };
        let d = d.help(format!("an unknown of its own for the gradient, `unknown q : {kind} on ...` with the term (q - Grad_{name}).Test_q: then Grad_q"));
        self.report(d, e, "a face gives the gradient along it, and no derivative of that")
    }

    fn next_derivative(&mut self, e: &Expr, field: FieldId, side: Side, op: FieldOp, role: Role) -> Option<ExprId> {
        let next = match op {
            FieldOp::Value => FieldOp::Grad,
            FieldOp::Grad if self.env.fields[field.index()].on_faces => return self.no_second_gradient(e, field),
            FieldOp::Grad => FieldOp::Hess,
            FieldOp::Hess => {
                let d = Diagnostic::new(Code::E111, "third derivatives of a field are not available");
                return self.report(d, e, "");
            }
        };
        Some(self.graph.leaf(Leaf::Field { field, side, op: next, role }))
    }

    /// True if a value is read through a mapping that moves.
    pub(crate) fn reads_moving_image(&self, value: ExprId) -> bool {
        self.graph.moves.is_some() && reads_image(&self.graph, value)
    }

    pub(crate) fn no_derivative<T>(&mut self, e: &Expr, what: &str) -> Option<T> {
        let d = Diagnostic::new(Code::E111, format!("`{what}` has no second derivative here"));
        self.report(d, e, "needed for the tangent of this expression")
    }
}

/// True if a value is read on the side `There`.
fn reads_image(graph: &Graph, value: ExprId) -> bool {
    graph.reachable(value).into_iter().any(|e| {
        let there = Leaf::Normal(Side::There);
        matches!(graph.node(e), Node::Leaf(l) if *l == there || *l == Leaf::ImageX)
            || matches!(graph.node(e), Node::Leaf(Leaf::Field { side: Side::There, .. }))
    })
}
