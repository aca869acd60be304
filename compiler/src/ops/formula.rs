//! Formulas on their own: a small graph whose arguments are free symbols, differentiated there and then copied.
//!
//! A derivative in an argument (`Derivative_max(p, q)`, the stress of an energy) must not care what stands in the
//! call: an argument may be a number, or the same expression twice. In the graph of the term both would be folded
//! into the formula; here they are leaves. What is copied goes through the constructors of the target graph, so it is
//! simplified there like anything else.

use crate::{
    derive::{NoDerivative, derive},
    graph::{ExprId, Graph, Leaf, Node, Role},
    types::{FieldId, FieldKind, FieldOp, FieldSig, Shape, Side},
};

/// A formula of free symbols.
pub(super) struct Formula {
    /// Where it is written.
    pub(super) graph: Graph,
    /// Its symbols.
    pub(super) arguments: Vec<ExprId>,
}

fn symbol(position: usize) -> Leaf {
    Leaf::Field { field: FieldId::new(position), side: Side::Here, op: FieldOp::Value, role: Role::Current }
}

impl Formula {
    /// Free symbols of these shapes, in the space dimension of `like`.
    pub(super) fn new(like: &Graph, shapes: &[Shape]) -> Self {
        let sig = |(k, shape): (usize, &Shape)| FieldSig {
            name: format!("argument {}", k + 1),
            shape: *shape,
            degree: 1,
            kind: FieldKind::Unknown,
            global: false,
            on_faces: false,
        };
        let fields: Vec<FieldSig> = shapes.iter().enumerate().map(sig).collect();
        let mut graph = Graph::new(like.dim, &fields);
        let arguments = (0..shapes.len()).map(|k| graph.leaf(symbol(k))).collect();
        Self { graph, arguments }
    }

    /// The derivative of `root` when every entry of argument `which` moves by 1.
    ///
    /// # Errors
    /// [`NoDerivative`] as for any derivative.
    pub(super) fn slope(&mut self, root: ExprId, which: usize) -> Result<ExprId, NoDerivative> {
        derive(&mut self.graph, root, &mut |g, leaf| {
            let shape = g.leaf_shape(leaf);
            (leaf == symbol(which)).then(|| g.constant(shape, &vec![1.0; shape.len()]))
        })
    }

    /// `root` in another graph, with `values` for the symbols.
    pub(super) fn copy(&self, root: ExprId, into: &mut Graph, values: &[ExprId]) -> ExprId {
        let mut needed = vec![false; root.index() + 1];
        needed[root.index()] = true;
        for k in (0..=root.index()).rev() {
            if needed[k] {
                self.graph.node(ExprId::new(k)).for_each_operand(|o| needed[o.index()] = true);
            }
        }
        let mut copied: Vec<Option<ExprId>> = vec![None; root.index() + 1];
        for k in 0..=root.index() {
            if needed[k] {
                let e = ExprId::new(k);
                let of = |o: ExprId| copied[o.index()].expect("operands come first");
                copied[k] = Some(rebuild(&self.graph, e, into, values, &of));
            }
        }
        copied[root.index()].expect("the root is needed")
    }
}

/// One node of `from` made in `g`, operands already there; `values` stand for the symbols of a [`Formula`].
pub(crate) fn rebuild(
    from: &Graph,
    e: ExprId,
    g: &mut Graph,
    values: &[ExprId],
    of: &dyn Fn(ExprId) -> ExprId,
) -> ExprId {
    let shape = from.shape(e);
    let wide = |x: u8| usize::from(x);
    match from.node(e) {
        Node::Const(bits) => g.constant(shape, &bits.iter().map(|b| f64::from_bits(*b)).collect::<Vec<f64>>()),
        Node::Leaf(leaf) => {
            let position = (0..values.len()).find(|k| *leaf == symbol(*k));
            position.map_or_else(|| g.leaf(*leaf), |k| values[k])
        }
        Node::Add(a, b) => g.add(of(*a), of(*b)),
        Node::Sub(a, b) => g.sub(of(*a), of(*b)),
        Node::Neg(a) => g.neg(of(*a)),
        Node::Scale(a, b) => g.scale(of(*a), of(*b)),
        Node::Divide(a, b) => g.divide(of(*a), of(*b)),
        Node::MulComponents(a, b) => g.mul_components(of(*a), of(*b)),
        Node::DivComponents(a, b) => g.div_components(of(*a), of(*b)),
        Node::Contract(a, b, axes) => {
            let axes: Vec<(usize, usize)> = axes.iter().map(|(i, j)| (wide(*i), wide(*j))).collect();
            g.contract(of(*a), of(*b), &axes)
        }
        Node::Trace(a, i, j) => g.trace(of(*a), wide(*i), wide(*j)),
        Node::Permute(a, perm) => g.permute(of(*a), &perm.iter().map(|p| wide(*p)).collect::<Vec<usize>>()),
        Node::Reshape(a) => g.reshape(of(*a), shape),
        Node::Pick(a, fixed) => {
            let fixed: Vec<Option<usize>> = fixed.iter().map(|f| f.map(usize::from)).collect();
            g.pick(of(*a), &fixed)
        }
        Node::Stack(parts) => g.stack(shape, &parts.iter().map(|p| of(*p)).collect::<Vec<ExprId>>()),
        Node::Map(f, a) => g.map(*f, of(*a)),
        Node::Lookup(curve, reading, a) => g.lookup(curve, *reading, of(*a)),
        Node::Map2(f, a, b) => g.map2(*f, of(*a), of(*b)),
        Node::Compare(op, a, b) => g.compare(*op, of(*a), of(*b)),
        Node::And(a, b) => g.and(of(*a), of(*b)),
        Node::Or(a, b) => g.or(of(*a), of(*b)),
        Node::Not(a) => g.not(of(*a)),
        Node::Select(m, a, b) => g.select(of(*m), of(*a), of(*b)),
        Node::Norm(a) => g.norm(of(*a)),
        Node::Unit(a) => g.unit(of(*a)),
        Node::Ball(v, r) => g.ball(of(*v), of(*r)),
        Node::InBall(v, r) => g.in_ball(of(*v), of(*r)),
        Node::BallRatio(v, r) => g.ball_ratio(of(*v), of(*r)),
        Node::Det(a) => g.det(of(*a)),
        Node::Inverse(a) => g.inverse(of(*a)),
        Node::Matrix(f, a) => g.matrix(*f, of(*a)),
        Node::Print(a) => g.print(of(*a)),
    }
}
