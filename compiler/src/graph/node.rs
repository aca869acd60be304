//! The operations and leaves that the graph is made of, and what is known of each value. Data only: the rules that keep
//! nodes small are the constructors of the graph.

use crate::{
    compare::Compare,
    lookup::{CurveRef, Reading},
    math::{MathFn1, MathFn2, MatrixFn},
    types::{FieldId, FieldOp, RateFactor, RateOrder, Side},
};

wfl::define_index! {
    /// A node of the graph.
    ExprId,
}

/// What a field leaf stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Role {
    /// The current state.
    Current,
    /// The state at the end of the previous step.
    Previous,
    /// The part of a rate that the past alone gives.
    History(RateOrder),
    /// The test function.
    Test,
    /// The trial function of the tangent.
    Trial,
}

/// What a point law is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Leaf {
    /// A field, its test or its trial function.
    Field {
        /// Which.
        field: FieldId,
        /// On which side.
        side: Side,
        /// Value, gradient, Hessian.
        op: FieldOp,
        /// State, test or trial.
        role: Role,
    },
    /// The position.
    X,
    /// The position of the image under the mapping of the graph.
    ImageX,
    /// The symmetric matrix that gives the shift of an image that moves.
    ImageShift,
    /// The derivative of the outward normal at such an image along its face.
    ImageSlope,
    /// The outward unit normal of a side.
    Normal(Side),
    /// The unit vector in a face of a side that points out of it at its edge.
    Conormal(Side),
    /// The cell's size.
    ElementSize(Side),
    /// The gradient of the geometric map.
    ElementK(Side),
    /// Its transposed inverse.
    ElementB(Side),
    /// The variable of `steps`.
    Time,
    /// Its increment.
    TimeStep,
    /// What multiplies the change of a field over the step in one of its rates.
    RateFactor(RateFactor),
}

/// Functions of one number, applied to each entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Function1 {
    /// Square root.
    Sqrt,
    /// A function of `math.rs`.
    Math(MathFn1),
}

/// The operations of the graph. Masks (results of comparisons) are nodes too; `Graph::is_mask` tells.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// Entries as bits, first index fastest.
    Const(Vec<u64>),
    /// A leaf.
    Leaf(Leaf),
    /// a + b
    Add(ExprId, ExprId),
    /// a - b
    Sub(ExprId, ExprId),
    /// -a
    Neg(ExprId),
    /// scalar times tensor
    Scale(ExprId, ExprId),
    /// tensor over scalar
    Divide(ExprId, ExprId),
    /// entry by entry
    MulComponents(ExprId, ExprId),
    /// entry by entry
    DivComponents(ExprId, ExprId),
    /// Sum over pairs of indices (of a, of b); the free indices of a, then those of b, remain.
    Contract(ExprId, ExprId, Vec<(u8, u8)>),
    /// Sum over two indices of one tensor.
    Trace(ExprId, u8, u8),
    /// Index k of the result is index `perm[k]` of a.
    Permute(ExprId, Vec<u8>),
    /// The same entries with other sizes.
    Reshape(ExprId),
    /// Some indices fixed (from 0), the others kept.
    Pick(ExprId, Vec<Option<u16>>),
    /// A tensor from its entries.
    Stack(Vec<ExprId>),
    /// A function of each entry.
    Map(Function1, ExprId),
    /// A column of a table over a scalar.
    Lookup(CurveRef, Reading, ExprId),
    /// A function of two tensors, entry by entry.
    Map2(MathFn2, ExprId, ExprId),
    /// Mask, entry by entry.
    Compare(Compare, ExprId, ExprId),
    /// Mask: both.
    And(ExprId, ExprId),
    /// Mask: either.
    Or(ExprId, ExprId),
    /// Mask: not.
    Not(ExprId),
    /// mask ? a : b; the mask is a scalar or of the shape of a.
    Select(ExprId, ExprId, ExprId),
    /// Euclidean (Frobenius) norm, safe against overflow; derivative 0 at 0.
    Norm(ExprId),
    /// v over its norm, 0 at 0.
    Unit(ExprId),
    /// Projection of v on the ball of radius r; 0 for r < 0.
    Ball(ExprId, ExprId),
    /// Mask: norm of v at most r.
    InBall(ExprId, ExprId),
    /// min(r over norm of v, 1), 0 where v is 0.
    BallRatio(ExprId, ExprId),
    /// Determinant.
    Det(ExprId),
    /// Inverse matrix.
    Inverse(ExprId),
    /// Matrix exponential and logarithm and their derivatives (index pair of the result, index pair of the direction).
    Matrix(MatrixFn, ExprId),
    /// The value itself, printed at each point when the scene runs.
    Print(ExprId),
}

impl Node {
    /// Whether its entries are true or false.
    pub(crate) fn is_mask(&self) -> bool {
        matches!(self, Node::Compare(..) | Node::And(..) | Node::Or(..) | Node::Not(_) | Node::InBall(..))
    }

    /// Calls `f` on every operand of a node.
    pub(crate) fn for_each_operand(&self, mut f: impl FnMut(ExprId)) {
        match self {
            Node::Const(_) | Node::Leaf(_) => {}
            Node::Neg(a) | Node::Trace(a, ..) | Node::Permute(a, _) | Node::Reshape(a) | Node::Pick(a, _) => f(*a),
            Node::Map(_, a) | Node::Not(a) | Node::Norm(a) | Node::Unit(a) | Node::Det(a) | Node::Inverse(a) => f(*a),
            Node::Matrix(_, a) | Node::Print(a) | Node::Lookup(.., a) => f(*a),
            Node::Stack(parts) => parts.iter().copied().for_each(f),
            Node::Select(m, a, b) => {
                f(*m);
                f(*a);
                f(*b);
            }
            Node::Add(a, b) | Node::Sub(a, b) | Node::Scale(a, b) | Node::Divide(a, b) | Node::Contract(a, b, _) => {
                f(*a);
                f(*b);
            }
            Node::MulComponents(a, b) | Node::DivComponents(a, b) | Node::Map2(_, a, b) | Node::Compare(_, a, b) => {
                f(*a);
                f(*b);
            }
            Node::And(a, b) | Node::Or(a, b) | Node::Ball(a, b) | Node::InBall(a, b) | Node::BallRatio(a, b) => {
                f(*a);
                f(*b);
            }
        }
    }
}

/// How many test and trial functions multiply an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Arity {
    /// Linear in a test function.
    pub test: bool,
    /// Linear in a trial function.
    pub trial: bool,
}

impl Arity {
    /// Neither.
    pub const NONE: Arity = Arity { test: false, trial: false };

    pub(super) fn both(self, other: Arity) -> Arity {
        Arity { test: self.test || other.test, trial: self.trial || other.trial }
    }
}

/// What a value changes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Depends {
    /// The step variable.
    pub step: bool,
    /// The point (position, normal, known fields, test functions).
    pub point: bool,
    /// The unknowns at the current state.
    pub unknown: bool,
}

impl Depends {
    pub(super) fn join(self, o: Depends) -> Depends {
        Depends { step: self.step || o.step, point: self.point || o.point, unknown: self.unknown || o.unknown }
    }
}
