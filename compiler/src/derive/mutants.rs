//! Wrong derivative rules on purpose: one rule by its name gives its derivative with the other sign.
//!
//! For the test that the tangent check notices each of them; no build of the program has this module.

use std::{cell::RefCell, collections::BTreeSet};

use crate::{
    graph::{ExprId, Function1, Graph, Node},
    math::MatrixFn,
};

thread_local! {
    static FLIPPED: RefCell<Option<String>> = const { RefCell::new(None) };
    static APPLIED: RefCell<BTreeSet<String>> = const { RefCell::new(BTreeSet::new()) };
}

/// The name of the rule of a node; none for what has no derivative and for leaves.
fn name(node: &Node) -> Option<&'static str> {
    Some(match node {
        Node::Const(_) | Node::Leaf(_) | Node::Compare(..) | Node::And(..) | Node::Or(..) | Node::Not(_) => {
            return None;
        }
        Node::InBall(..) => return None,
        Node::Add(..) => "a + b",
        Node::Sub(..) => "a - b",
        Node::Neg(_) => "-a",
        Node::Scale(..) => "scalar times tensor",
        Node::Divide(..) => "tensor over scalar",
        Node::MulComponents(..) => "a .* b",
        Node::DivComponents(..) => "a ./ b",
        Node::Contract(..) => "contraction",
        Node::Trace(..) => "trace",
        Node::Permute(..) => "order of the indices",
        Node::Reshape(_) => "reshape",
        Node::Pick(..) => "entry",
        Node::Stack(_) => "tensor from entries",
        Node::Map(Function1::Sqrt, _) => "sqrt",
        Node::Map(Function1::Math(f), _) => f.name(),
        Node::Lookup(_, reading, _) => reading.name(),
        Node::Map2(f, ..) => f.name(),
        Node::Select(..) => "selection",
        Node::Norm(_) => "norm",
        Node::Unit(_) => "unit vector",
        Node::Ball(..) => "projection on a ball",
        Node::BallRatio(..) => "ratio of the projection",
        Node::Det(_) => "determinant",
        Node::Inverse(_) => "inverse",
        Node::Matrix(MatrixFn::Expm, _) => "Expm",
        Node::Matrix(MatrixFn::Logm, _) => "Logm",
        Node::Matrix(MatrixFn::ExpmDerivative | MatrixFn::LogmDerivative, _) => return None,
        Node::Print(_) => "Print",
    })
}

/// Notes the rule that gave a derivative, and flips it if it is the one that is to be wrong.
pub(super) fn applied(g: &mut Graph, e: ExprId, derivative: Option<ExprId>) -> Option<ExprId> {
    let (Some(d), Some(rule)) = (derivative, name(g.node(e))) else { return derivative };
    APPLIED.with_borrow_mut(|all| all.insert(rule.to_owned()));
    let wrong = FLIPPED.with_borrow(|f| f.as_deref() == Some(rule));
    Some(if wrong { g.neg(d) } else { d })
}

/// What `make` gives while a rule is wrong, and the rules that it used.
pub(crate) fn with_wrong<T>(rule: Option<&str>, make: impl FnOnce() -> T) -> (T, BTreeSet<String>) {
    FLIPPED.set(rule.map(str::to_owned));
    APPLIED.take();
    let made = make();
    FLIPPED.set(None);
    (made, APPLIED.take())
}
