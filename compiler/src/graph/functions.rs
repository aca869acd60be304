//! Nodes of functions, masks, choices between values, norms and matrices.

use super::{ExprId, Function1, Graph, Node};
use crate::{
    compare::Compare,
    lookup::{CurveRef, Reading, read},
    math::{MathFn1, MathFn2, MatrixFn},
    types::Shape,
};

impl Graph {
    /// A function of each entry. `asinh` of a product with an exponential is one function of two numbers, which has values
    /// where the product overflows.
    pub fn map(&mut self, f: Function1, a: ExprId) -> ExprId {
        if f == Function1::Math(MathFn1::Asinh)
            && self.shape(a).rank() == 0
            && let Some((x, exponent)) = self.with_exponential(a)
        {
            return self.map2(MathFn2::AsinhExp, x, exponent);
        }
        let overflows = |x: f64| x.is_finite() && !MathFn1::Exp.eval(x).is_finite();
        if f == Function1::Math(MathFn1::Exp) && self.scalar_constant(a).is_some_and(overflows) {
            // it may be a factor in such a product; elsewhere the number is infinite when it is lowered
            return self.intern(Node::Map(f, a), self.shape(a), self.arity(a), self.depends(a));
        }
        let folded = self.fold1(a, |x| match f {
            Function1::Sqrt => x.sqrt(),
            Function1::Math(f) => f.eval(x),
        });
        folded.unwrap_or_else(|| self.intern(Node::Map(f, a), self.shape(a), self.arity(a), self.depends(a)))
    }

    /// A reading of a column of a table at a scalar. A number outside its rows stays a node: its value is not a number.
    pub fn lookup(&mut self, curve: &CurveRef, reading: Reading, a: ExprId) -> ExprId {
        assert_eq!(self.shape(a).rank(), 0);
        let known = self.scalar_constant(a).map(|x| read(curve, reading, x)).filter(|y| y.is_finite());
        match known {
            Some(y) => self.number(y),
            None => {
                let (arity, depends) = (self.arity(a), self.depends(a));
                self.intern(Node::Lookup(curve.clone(), reading, a), Shape::SCALAR, arity, depends)
            }
        }
    }

    /// A scalar as a product `x exp(y)`, of all exponentials that are its factors; `None` if there are none.
    fn with_exponential(&mut self, e: ExprId) -> Option<(ExprId, ExprId)> {
        match *self.node(e) {
            Node::Map(Function1::Math(MathFn1::Exp), y) => Some((self.number(1.0), y)),
            Node::Neg(a) => {
                let (x, y) = self.with_exponential(a)?;
                Some((self.neg(x), y))
            }
            Node::Scale(a, b) => match (self.with_exponential(a), self.with_exponential(b)) {
                (None, None) => None,
                (Some((x, y)), None) => Some((self.scale(x, b), y)),
                (None, Some((x, y))) => Some((self.scale(a, x), y)),
                (Some((x, y)), Some((z, w))) => Some((self.scale(x, z), self.add(y, w))),
            },
            Node::Divide(a, b) => match (self.with_exponential(a), self.with_exponential(b)) {
                (None, None) => None,
                (Some((x, y)), None) => Some((self.divide(x, b), y)),
                (None, Some((x, y))) => {
                    let minus = self.neg(y);
                    Some((self.divide(a, x), minus))
                }
                (Some((x, y)), Some((z, w))) => Some((self.divide(x, z), self.sub(y, w))),
            },
            _ => None,
        }
    }

    /// A function of two tensors of one shape, entry by entry.
    pub fn map2(&mut self, f: MathFn2, a: ExprId, b: ExprId) -> ExprId {
        assert_eq!(self.shape(a), self.shape(b));
        if let Some(e) = self.fold2(a, b, |x, y| f.eval(x, y)) {
            return e;
        }
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::Map2(f, a, b), self.shape(a), arity, depends)
    }

    /// Mask, entry by entry, equal shapes.
    pub fn compare(&mut self, op: Compare, a: ExprId, b: ExprId) -> ExprId {
        assert_eq!(self.shape(a), self.shape(b));
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::Compare(op, a, b), self.shape(a), arity, depends)
    }

    /// Mask: both.
    pub fn and(&mut self, a: ExprId, b: ExprId) -> ExprId {
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::And(a, b), self.shape(a), arity, depends)
    }

    /// Mask: either.
    pub fn or(&mut self, a: ExprId, b: ExprId) -> ExprId {
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::Or(a, b), self.shape(a), arity, depends)
    }

    /// Mask: not.
    pub fn not(&mut self, a: ExprId) -> ExprId {
        self.intern(Node::Not(a), self.shape(a), self.arity(a), self.depends(a))
    }

    /// The value of a mask that constants decide.
    #[must_use]
    pub fn constant_mask(&self, e: ExprId) -> Option<Vec<bool>> {
        let zip = |a: Vec<bool>, b: Vec<bool>, f: fn(bool, bool) -> bool| {
            a.into_iter().zip(b).map(|(x, y)| f(x, y)).collect::<Vec<bool>>()
        };
        match *self.node(e) {
            Node::Compare(op, a, b) => {
                let (x, y) = (self.constant_value(a)?, self.constant_value(b)?);
                Some(x.iter().zip(&y).map(|(x, y)| op.holds(*x, *y)).collect())
            }
            Node::And(a, b) | Node::Or(a, b) => {
                let either = matches!(self.node(e), Node::Or(..));
                match (self.constant_mask(a), self.constant_mask(b)) {
                    (Some(x), Some(y)) if either => Some(zip(x, y, |x, y| x || y)),
                    (Some(x), Some(y)) => Some(zip(x, y, |x, y| x && y)),
                    // one side decides alone
                    (Some(one), None) | (None, Some(one)) => one.iter().all(|x| *x == either).then_some(one),
                    (None, None) => None,
                }
            }
            Node::Not(a) => Some(self.constant_mask(a)?.into_iter().map(|x| !x).collect()),
            _ => None,
        }
    }

    /// mask ? a : b; the mask is a scalar or of the shape of a.
    pub fn select(&mut self, mask: ExprId, a: ExprId, b: ExprId) -> ExprId {
        assert_eq!(self.shape(a), self.shape(b));
        assert!(self.is_mask(mask));
        if a == b {
            return a;
        }
        if let Some(m) = self.constant_mask(mask) {
            if m.iter().all(|x| *x) {
                return a;
            }
            if m.iter().all(|x| !*x) {
                return b;
            }
        }
        let (arity, depends) = self.join2(a, b);
        let depends = depends.join(self.depends(mask));
        self.intern(Node::Select(mask, a, b), self.shape(a), arity, depends)
    }

    fn unary(&mut self, node: Node, a: ExprId, shape: Shape) -> ExprId {
        self.intern(node, shape, self.arity(a), self.depends(a))
    }

    /// Euclidean norm of all entries.
    pub fn norm(&mut self, a: ExprId) -> ExprId {
        if self.is_zero(a) {
            return self.number(0.0);
        }
        self.unary(Node::Norm(a), a, Shape::SCALAR)
    }

    /// a over its norm, 0 at 0.
    pub fn unit(&mut self, a: ExprId) -> ExprId {
        if self.is_zero(a) {
            return a;
        }
        self.unary(Node::Unit(a), a, self.shape(a))
    }

    /// Projection of v on the ball of radius r.
    pub fn ball(&mut self, v: ExprId, r: ExprId) -> ExprId {
        let r = self.to_scalar(r);
        if self.scalar_constant(r).is_some_and(|r| r < 0.0)
            && let Some(origin) = self.origin
            && !self.negative_radii.contains(&origin)
        {
            self.negative_radii.push(origin);
        }
        if self.is_zero(v) || self.scalar_constant(r).is_some_and(|r| r <= 0.0) {
            return self.zero(self.shape(v));
        }
        let (arity, depends) = self.join2(v, r);
        self.intern(Node::Ball(v, r), self.shape(v), arity, depends)
    }

    /// Mask: norm of v at most r.
    pub fn in_ball(&mut self, v: ExprId, r: ExprId) -> ExprId {
        let (arity, depends) = self.join2(v, r);
        self.intern(Node::InBall(v, r), Shape::SCALAR, arity, depends)
    }

    /// min(r over norm of v, 1), 0 where v is 0.
    pub fn ball_ratio(&mut self, v: ExprId, r: ExprId) -> ExprId {
        let (arity, depends) = self.join2(v, r);
        self.intern(Node::BallRatio(v, r), Shape::SCALAR, arity, depends)
    }

    /// Determinant of a square matrix.
    pub fn det(&mut self, a: ExprId) -> ExprId {
        self.unary(Node::Det(a), a, Shape::SCALAR)
    }

    /// Inverse of a square matrix.
    pub fn inverse(&mut self, a: ExprId) -> ExprId {
        self.unary(Node::Inverse(a), a, self.shape(a))
    }

    /// A function of a square matrix; its derivative has two more indices.
    pub fn matrix(&mut self, f: MatrixFn, a: ExprId) -> ExprId {
        let n = self.shape(a).size(0);
        let shape = match f {
            MatrixFn::Expm | MatrixFn::Logm => self.shape(a),
            MatrixFn::ExpmDerivative | MatrixFn::LogmDerivative => {
                Shape::new(&[n, n, n, n]).expect("matrices of 3 at most")
            }
        };
        self.unary(Node::Matrix(f, a), a, shape)
    }

    /// The value itself, printed at run time.
    pub fn print(&mut self, a: ExprId) -> ExprId {
        self.unary(Node::Print(a), a, self.shape(a))
    }
}
