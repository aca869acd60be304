//! The typed tensor graph: every expression once, with its shape, what it depends on and where it came from.
//!
//! Nodes are made by the constructors here only. They fold constants and drop zeros and ones, so a term that a
//! parameter switches off (`theta = 0`) leaves no node behind. `0*x` is 0 and `x - x` is not simplified: values
//! that are not numbers never become numbers, except where a literal zero removes a factor.
//! Constructors expect legal shapes (checked by `build.rs`) and assert them.

use std::collections::HashMap;

use crate::{
    ir::Origin,
    types::{FieldId, FieldKind, FieldSig, Moves, Shape, Side},
};

mod difference;
mod functions;
mod node;
mod shorthand;
mod tensors;

pub(crate) use node::{Arity, Depends, Function1};
pub use node::{ExprId, Leaf, Node, Role};
pub(crate) use shorthand::{apply, pow_components, times};
pub(crate) use tensors::picked_position;

#[derive(Clone, Debug)]
struct Info {
    shape: Shape,
    mask: bool,
    arity: Arity,
    depends: Depends,
    origin: Option<Origin>,
    /// Operations on the longest way to a leaf.
    depth: u32,
}

/// The graph of one term: append-only, equal nodes are one node.
#[derive(Clone, Debug)]
pub struct Graph {
    nodes: Vec<Node>,
    infos: Vec<Info>,
    index: HashMap<(Node, Shape), ExprId>,
    origin: Option<Origin>,
    /// The space dimension.
    pub dim: usize,
    /// What the side `There` is: the image under this mapping, or the neighbour.
    pub mapping: Option<usize>,
    /// The displacements that the images follow, where they move.
    pub moves: Option<Moves>,
    /// Whether each field is solved for.
    unknown: Vec<bool>,
    shapes: Vec<Shape>,
    global: Vec<bool>,
    /// Where projections on balls of a radius that is a number below 0 were asked for.
    pub(crate) negative_radii: Vec<Origin>,
}

impl Graph {
    /// An empty graph over these fields in space of dimension `dim`.
    #[must_use]
    pub fn new(dim: usize, fields: &[FieldSig]) -> Self {
        Self {
            nodes: Vec::new(),
            infos: Vec::new(),
            index: HashMap::new(),
            origin: None,
            dim,
            mapping: None,
            moves: None,
            unknown: fields.iter().map(FieldSig::is_unknown).collect(),
            shapes: fields.iter().map(|f| f.shape).collect(),
            global: fields.iter().map(|f| f.global).collect(),
            negative_radii: Vec::new(),
        }
    }

    /// Adds fields that are known, one like each of those that there are; gives how many there were.
    pub(crate) fn add_companions(&mut self) -> usize {
        let n = self.shapes.len();
        self.unknown.resize(2 * n, false);
        self.shapes.extend_from_within(..);
        self.global.extend_from_within(..);
        n
    }

    /// The fields as far as laws are made with them: without their names and where they live.
    pub(crate) fn fields(&self) -> Vec<FieldSig> {
        let kind = |k: usize| if self.unknown[k] { FieldKind::Unknown } else { FieldKind::Data };
        let field = |k: usize| FieldSig {
            name: String::new(),
            shape: self.shapes[k],
            degree: 0,
            kind: kind(k),
            global: self.global[k],
            on_faces: false,
        };
        (0..self.shapes.len()).map(field).collect()
    }

    /// New nodes come from this place from now on; returns the place that held before.
    pub fn set_origin(&mut self, origin: Option<Origin>) -> Option<Origin> {
        std::mem::replace(&mut self.origin, origin)
    }

    /// The node.
    #[must_use]
    pub fn node(&self, e: ExprId) -> &Node {
        &self.nodes[e.index()]
    }

    /// Its shape.
    #[must_use]
    pub fn shape(&self, e: ExprId) -> Shape {
        self.infos[e.index()].shape
    }

    /// True for results of comparisons.
    #[must_use]
    pub fn is_mask(&self, e: ExprId) -> bool {
        self.infos[e.index()].mask
    }

    /// Test and trial functions in it.
    #[must_use]
    pub fn arity(&self, e: ExprId) -> Arity {
        self.infos[e.index()].arity
    }

    /// What it changes with.
    #[must_use]
    pub fn depends(&self, e: ExprId) -> Depends {
        self.infos[e.index()].depends
    }

    /// Where it was written.
    #[must_use]
    pub fn origin(&self, e: ExprId) -> Option<Origin> {
        self.infos[e.index()].origin
    }

    /// Operations on the longest way from it to a leaf.
    #[must_use]
    pub fn depth(&self, e: ExprId) -> usize {
        self.infos[e.index()].depth as usize
    }

    /// True if the field is global (one value, no gradient).
    #[must_use]
    pub fn is_global(&self, f: FieldId) -> bool {
        self.global[f.index()]
    }

    /// True if the field is solved for.
    #[must_use]
    pub fn is_unknown(&self, f: FieldId) -> bool {
        self.unknown[f.index()]
    }

    /// True for what is another where the image of a point is another.
    #[must_use]
    pub fn is_at_image(&self, leaf: Leaf) -> bool {
        match leaf {
            Leaf::Field { field, side, .. } => side == Side::There && !self.is_global(field),
            Leaf::Normal(side) => side == Side::There,
            Leaf::ImageX | Leaf::ImageShift | Leaf::ImageSlope => true,
            _ => false,
        }
    }

    /// Number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// True before the first node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Nodes below `root`, operands first, `root` last.
    pub(crate) fn reachable(&self, root: ExprId) -> Vec<ExprId> {
        let mut seen = vec![false; self.len()];
        seen[root.index()] = true;
        for k in (0..=root.index()).rev() {
            if seen[k] {
                self.nodes[k].for_each_operand(|o| seen[o.index()] = true);
            }
        }
        (0..self.len()).filter(|k| seen[*k]).map(ExprId::new).collect()
    }

    /// The entries of a constant.
    #[must_use]
    pub fn constant_value(&self, e: ExprId) -> Option<Vec<f64>> {
        match self.node(e) {
            Node::Const(bits) => Some(bits.iter().map(|b| f64::from_bits(*b)).collect()),
            _ => None,
        }
    }

    /// The value of a constant with one entry.
    #[must_use]
    pub fn scalar_constant(&self, e: ExprId) -> Option<f64> {
        self.constant_value(e).filter(|v| v.len() == 1).map(|v| v[0])
    }

    /// True for a constant all of whose entries are zero.
    #[must_use]
    pub fn is_zero(&self, e: ExprId) -> bool {
        matches!(self.node(e), Node::Const(b) if b.iter().all(|b| f64::from_bits(*b) == 0.0))
    }

    fn intern(&mut self, node: Node, shape: Shape, arity: Arity, depends: Depends) -> ExprId {
        if let Some(&e) = self.index.get(&(node.clone(), shape)) {
            return e;
        }
        let e = ExprId::new(self.nodes.len());
        let (mask, mut below) = (node.is_mask(), 0);
        node.for_each_operand(|a| below = below.max(self.infos[a.index()].depth));
        self.index.insert((node.clone(), shape), e);
        self.nodes.push(node);
        self.infos.push(Info { shape, mask, arity, depends, origin: self.origin, depth: below + 1 });
        e
    }

    fn join2(&self, a: ExprId, b: ExprId) -> (Arity, Depends) {
        (self.arity(a).both(self.arity(b)), self.depends(a).join(self.depends(b)))
    }

    /// A constant tensor; entries with the first index fastest.
    pub fn constant(&mut self, shape: Shape, values: &[f64]) -> ExprId {
        assert_eq!(shape.len(), values.len());
        let bits = values.iter().map(|v| v.to_bits()).collect();
        self.intern(Node::Const(bits), shape, Arity::NONE, Depends::default())
    }

    /// A number.
    pub fn number(&mut self, value: f64) -> ExprId {
        self.constant(Shape::SCALAR, &[value])
    }

    /// The zero tensor.
    pub fn zero(&mut self, shape: Shape) -> ExprId {
        self.constant(shape, &vec![0.0; shape.len()])
    }

    /// The identity matrix.
    pub fn identity(&mut self, n: usize) -> ExprId {
        let values: Vec<f64> = (0..n * n).map(|k| if k % (n + 1) == 0 { 1.0 } else { 0.0 }).collect();
        self.constant(Shape::matrix(n, n), &values)
    }

    /// A scalar repeated in every entry of `shape`.
    pub fn fill(&mut self, scalar: ExprId, shape: Shape) -> ExprId {
        if shape.rank() == 0 {
            return scalar;
        }
        let ones = self.constant(shape, &vec![1.0; shape.len()]);
        self.scale(scalar, ones)
    }

    /// The shape of a leaf.
    #[must_use]
    pub fn leaf_shape(&self, leaf: Leaf) -> Shape {
        let n = self.dim;
        match leaf {
            Leaf::Field { field, op, .. } => {
                let mut shape = self.shapes[field.index()];
                for _ in 0..op.order() {
                    shape = shape.with_last(n).expect("fields have rank 2 at most");
                }
                shape
            }
            Leaf::X | Leaf::ImageX | Leaf::Normal(_) | Leaf::Conormal(_) => Shape::vector(n),
            Leaf::ElementK(_) | Leaf::ElementB(_) | Leaf::ImageShift | Leaf::ImageSlope => Shape::matrix(n, n),
            Leaf::ElementSize(_) | Leaf::Time | Leaf::TimeStep | Leaf::RateFactor(_) => Shape::SCALAR,
        }
    }

    /// A leaf.
    pub fn leaf(&mut self, leaf: Leaf) -> ExprId {
        let mut arity = Arity::NONE;
        let mut depends = Depends { point: true, ..Depends::default() };
        match leaf {
            Leaf::Field { field, role, .. } => match role {
                Role::Current => depends.unknown = self.unknown[field.index()],
                Role::Previous | Role::History(_) => {}
                Role::Test => arity.test = true,
                Role::Trial => arity.trial = true,
            },
            Leaf::Time | Leaf::TimeStep | Leaf::RateFactor(_) => depends = Depends { step: true, ..Depends::default() },
            _ => {}
        }
        depends.unknown |= self.moves.is_some() && self.is_at_image(leaf);
        self.intern(Node::Leaf(leaf), self.leaf_shape(leaf), arity, depends)
    }

    fn fold2(&mut self, a: ExprId, b: ExprId, f: impl Fn(f64, f64) -> f64) -> Option<ExprId> {
        let (x, y) = (self.constant_value(a)?, self.constant_value(b)?);
        let values: Vec<f64> = x.iter().zip(&y).map(|(x, y)| f(*x, *y)).collect();
        Some(self.constant(self.shape(a), &values))
    }

    fn fold1(&mut self, a: ExprId, f: impl Fn(f64) -> f64) -> Option<ExprId> {
        let values: Vec<f64> = self.constant_value(a)?.iter().map(|x| f(*x)).collect();
        Some(self.constant(self.shape(a), &values))
    }

    /// a + b, equal shapes.
    pub fn add(&mut self, a: ExprId, b: ExprId) -> ExprId {
        assert_eq!(self.shape(a), self.shape(b));
        if self.is_zero(a) {
            return b;
        }
        if self.is_zero(b) {
            return a;
        }
        if let Some(e) = self.fold2(a, b, |x, y| x + y) {
            return e;
        }
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::Add(a, b), self.shape(a), arity, depends)
    }

    /// a - b, equal shapes.
    pub fn sub(&mut self, a: ExprId, b: ExprId) -> ExprId {
        assert_eq!(self.shape(a), self.shape(b));
        if self.is_zero(b) {
            return a;
        }
        if self.is_zero(a) {
            return self.neg(b);
        }
        if let Some(e) = self.fold2(a, b, |x, y| x - y) {
            return e;
        }
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::Sub(a, b), self.shape(a), arity, depends)
    }

    /// -a
    pub fn neg(&mut self, a: ExprId) -> ExprId {
        if let Node::Neg(inner) = *self.node(a) {
            return inner;
        }
        if let Some(e) = self.fold1(a, |x| -x) {
            return e;
        }
        self.intern(Node::Neg(a), self.shape(a), self.arity(a), self.depends(a))
    }

    /// scalar `s` times `a`.
    pub fn scale(&mut self, s: ExprId, a: ExprId) -> ExprId {
        assert!(self.shape(s).is_scalar_like());
        let s = self.to_scalar(s);
        if self.is_zero(a) || self.scalar_constant(s) == Some(1.0) {
            return a;
        }
        let shape = self.shape(a);
        if self.is_zero(s) {
            return self.zero(shape);
        }
        if self.scalar_constant(s) == Some(-1.0) {
            return self.neg(a);
        }
        if let (Some(f), Some(values)) = (self.scalar_constant(s), self.constant_value(a)) {
            let values: Vec<f64> = values.iter().map(|x| f * x).collect();
            return self.constant(shape, &values);
        }
        if shape.rank() == 0 && self.scalar_constant(a) == Some(1.0) {
            return s;
        }
        let (arity, depends) = self.join2(s, a);
        self.intern(Node::Scale(s, a), shape, arity, depends)
    }

    /// `a` over scalar `s`.
    pub fn divide(&mut self, a: ExprId, s: ExprId) -> ExprId {
        assert!(self.shape(s).is_scalar_like());
        let s = self.to_scalar(s);
        if self.scalar_constant(s) == Some(1.0) {
            return a;
        }
        if self.is_zero(a) && !self.is_zero(s) {
            return a;
        }
        if let (Some(values), Some(f)) = (self.constant_value(a), self.scalar_constant(s)) {
            let values: Vec<f64> = values.iter().map(|x| x / f).collect();
            return self.constant(self.shape(a), &values);
        }
        let (arity, depends) = self.join2(a, s);
        self.intern(Node::Divide(a, s), self.shape(a), arity, depends)
    }

    /// Entry by entry, equal shapes.
    pub fn mul_components(&mut self, a: ExprId, b: ExprId) -> ExprId {
        assert_eq!(self.shape(a), self.shape(b));
        if self.shape(a).rank() == 0 {
            return self.scale(a, b);
        }
        if self.is_zero(a) {
            return a;
        }
        if self.is_zero(b) {
            return b;
        }
        if let Some(e) = self.fold2(a, b, |x, y| x * y) {
            return e;
        }
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::MulComponents(a, b), self.shape(a), arity, depends)
    }

    /// Entry by entry, equal shapes.
    pub fn div_components(&mut self, a: ExprId, b: ExprId) -> ExprId {
        assert_eq!(self.shape(a), self.shape(b));
        if self.shape(a).rank() == 0 {
            return self.divide(a, b);
        }
        if let Some(e) = self.fold2(a, b, |x, y| x / y) {
            return e;
        }
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::DivComponents(a, b), self.shape(a), arity, depends)
    }
}
