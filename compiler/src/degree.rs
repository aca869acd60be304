//! Estimate of the polynomial degree of an expression, for the choice of quadrature.
//!
//! On simplices the total degree counts, on tensor-product cells the degree in each variable; a gradient there
//! keeps the degree of its field. Functions that are no polynomials add 2 to the degree of their argument, kinks
//! that depend on the unknowns add 2 once (where the contact set cuts a facet no rule is exact).

use crate::{
    graph::{ExprId, Graph, Leaf, Node},
    types::{FieldOp, FieldSig},
};

/// Degree and whether a kink that moves with the unknowns is below.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Degree {
    /// Polynomial degree, kinks not counted.
    pub polynomial: usize,
    /// A kink depends on the unknowns.
    pub kinked: bool,
}

/// Largest degree the estimate asks for.
const LARGEST: usize = 12;

impl Degree {
    /// The degree the quadrature rule should have.
    #[must_use]
    pub fn rule(self) -> usize {
        (self.polynomial + if self.kinked { 2 } else { 0 }).min(LARGEST)
    }

    /// Of a sum.
    fn sum(self, o: Degree) -> Degree {
        Degree { polynomial: self.polynomial.max(o.polynomial), kinked: self.kinked || o.kinked }
    }

    /// Of a product.
    fn product(self, o: Degree) -> Degree {
        Degree { polynomial: self.polynomial + o.polynomial, kinked: self.kinked || o.kinked }
    }

    /// Of a function that is no polynomial.
    fn composed(self) -> Degree {
        if self.polynomial == 0 { self } else { Degree { polynomial: self.polynomial + 2, ..self } }
    }
}

/// The degree of an expression on cells that are tensor products or simplices.
#[must_use]
pub(crate) fn degree(graph: &Graph, root: ExprId, fields: &[FieldSig], tensor_cells: bool) -> Degree {
    let mut degrees: Vec<Degree> = Vec::with_capacity(root.index() + 1);
    for k in 0..=root.index() {
        let e = ExprId::new(k);
        let of = |x: ExprId| degrees[x.index()];
        let d = match graph.node(e) {
            Node::Const(_) => Degree::default(),
            Node::Leaf(leaf) => leaf_degree(*leaf, fields, tensor_cells),
            Node::Add(a, b) | Node::Sub(a, b) | Node::And(a, b) | Node::Or(a, b) | Node::Compare(_, a, b) => {
                of(*a).sum(of(*b))
            }
            Node::InBall(a, b) => of(*a).sum(of(*b)),
            Node::Neg(a)
            | Node::Trace(a, ..)
            | Node::Permute(a, _)
            | Node::Reshape(a)
            | Node::Pick(a, _)
            | Node::Not(a)
            | Node::Print(a) => of(*a),
            Node::Scale(a, b) | Node::MulComponents(a, b) | Node::Contract(a, b, _) => of(*a).product(of(*b)),
            Node::Divide(a, b) | Node::DivComponents(a, b) => of(*a).product(of(*b).composed()),
            Node::Stack(parts) => parts.iter().fold(Degree::default(), |d, p| d.sum(of(*p))),
            Node::Map(_, a) | Node::Matrix(_, a) | Node::Inverse(a) | Node::Norm(a) | Node::Unit(a) => {
                of(*a).composed()
            }
            Node::Map2(_, a, b) => of(*a).sum(of(*b)).composed(),
            Node::Select(mask, a, b) => {
                let d = of(*a).sum(of(*b));
                Degree { kinked: d.kinked || graph.depends(*mask).unknown, ..d }
            }
            Node::Ball(v, r) | Node::BallRatio(v, r) => {
                let moves = graph.depends(*v).unknown || graph.depends(*r).unknown;
                let d = of(*v).sum(of(*r));
                Degree { kinked: d.kinked || moves, ..d }
            }
            Node::Det(a) => Degree { polynomial: of(*a).polynomial * graph.shape(*a).size(0), ..of(*a) },
        };
        degrees.push(d);
    }
    degrees[root.index()]
}

fn leaf_degree(leaf: Leaf, fields: &[FieldSig], tensor_cells: bool) -> Degree {
    let polynomial = match leaf {
        Leaf::Field { field, op, .. } => {
            let k = fields[field.index()].degree;
            match op {
                FieldOp::Value => k,
                _ if tensor_cells => k,
                FieldOp::Grad => k.saturating_sub(1),
                FieldOp::Hess => k.saturating_sub(2),
            }
        }
        Leaf::X | Leaf::ImageX => 1,
        _ => 0,
    };
    Degree { polynomial, kinked: false }
}
