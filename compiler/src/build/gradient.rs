//! `Grad(expr)`: the symbolic gradient in space. Fields have two derivatives; a third one is refused.

use wfl::{Diagnostic, ast::Expr};

use crate::{
    build::Builder,
    derive::derive,
    graph::{ExprId, Graph, Leaf, Node, Role},
    types::{FieldId, FieldOp, Shape, Side},
};

impl Builder<'_> {
    /// The symbolic gradient of an expression: one more index at the end.
    pub(crate) fn gradient(&mut self, e: &Expr, value: ExprId) -> Option<ExprId> {
        let shape = self.graph.shape(value);
        let dim = self.env.dim;
        let Some(result) = shape.with_last(dim) else {
            let d = Diagnostic::new("E110", "the gradient of this tensor has too many indices");
            return self.report(d, e, "");
        };
        if self.graph.mapping.is_some() && reads_image(&self.graph, value) {
            let d = Diagnostic::new("E111", "the gradient of a value at the image of a mapping is not available")
                .help("Interpolate(Grad_u, m) is the gradient at the image, in the coordinates there");
            return self.report(d, e, "");
        }
        if let Node::Leaf(Leaf::Field { field, side, op, role }) = *self.graph.node(value) {
            return self.next_derivative(e, field, side, op, role);
        }
        let mut columns = Vec::with_capacity(dim);
        for k in 0..dim {
            let mut too_high = false;
            let moved = derive(&mut self.graph, value, &mut |g, leaf| match leaf {
                Leaf::X => {
                    let unit: Vec<f64> = (0..dim).map(|i| if i == k { 1.0 } else { 0.0 }).collect();
                    Some(g.constant(Shape::vector(dim), &unit))
                }
                Leaf::Field { field, .. } if g.is_global(field) => None,
                Leaf::Field { field, side, op, role } => {
                    let next = match op {
                        FieldOp::Value => FieldOp::Grad,
                        FieldOp::Grad => FieldOp::Hess,
                        FieldOp::Hess => {
                            too_high = true;
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
            });
            if too_high {
                let d = Diagnostic::new("E111", "third derivatives of a field are not available");
                return self.report(d, e, "");
            }
            match moved {
                Ok(d) => columns.push(d),
                Err(no) => return self.no_derivative(e, no.what),
            }
        }
        let entries: Vec<ExprId> =
            (0..result.len()).map(|p| self.graph.entry(columns[p / shape.len()], p % shape.len())).collect();
        Some(self.graph.stack(result, &entries))
    }

    fn next_derivative(&mut self, e: &Expr, field: FieldId, side: Side, op: FieldOp, role: Role) -> Option<ExprId> {
        let next = match op {
            FieldOp::Value => FieldOp::Grad,
            FieldOp::Grad => FieldOp::Hess,
            FieldOp::Hess => {
                let d = Diagnostic::new("E111", "third derivatives of a field are not available");
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
        let d = Diagnostic::new("E111", format!("`{what}` has no second derivative here"));
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
