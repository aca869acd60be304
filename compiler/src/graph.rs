//! The typed tensor graph: every expression once, with its shape, what it depends on and where it came from.
//!
//! Nodes are made by the constructors here only. They fold constants and drop zeros and ones, so a term that a
//! parameter switches off (`theta = 0`) leaves no node behind. `0*x` is 0 and `x - x` is not simplified: values
//! that are not numbers never become numbers, except where a literal zero removes a factor.
//! Constructors expect legal shapes (checked by `build.rs`) and assert them.

use std::collections::HashMap;

use crate::{
    ir::{Compare, Origin},
    math::{MathFn2, MatrixFn},
    types::{FieldId, FieldSig, Shape},
};

mod node;
mod shorthand;

pub(crate) use node::{Arity, Depends, Function1};
pub use node::{ExprId, Leaf, Node, Role};
pub(crate) use shorthand::{apply, pow_components, times};

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
            unknown: fields.iter().map(FieldSig::is_unknown).collect(),
            shapes: fields.iter().map(|f| f.shape).collect(),
            global: fields.iter().map(|f| f.global).collect(),
            negative_radii: Vec::new(),
        }
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

    fn intern(&mut self, node: Node, shape: Shape, mask: bool, arity: Arity, depends: Depends) -> ExprId {
        if let Some(&e) = self.index.get(&(node.clone(), shape)) {
            return e;
        }
        let e = ExprId::new(self.nodes.len());
        let mut below = 0;
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
        self.intern(Node::Const(bits), shape, false, Arity::NONE, Depends::default())
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
            Leaf::X | Leaf::ImageX | Leaf::Normal(_) => Shape::vector(n),
            Leaf::ElementK(_) | Leaf::ElementB(_) => Shape::matrix(n, n),
            Leaf::ElementSize(_) | Leaf::Time | Leaf::TimeStep => Shape::SCALAR,
        }
    }

    /// A leaf.
    pub fn leaf(&mut self, leaf: Leaf) -> ExprId {
        let mut arity = Arity::NONE;
        let mut depends = Depends { point: true, ..Depends::default() };
        match leaf {
            Leaf::Field { field, role, .. } => match role {
                Role::Current => depends.unknown = self.unknown[field.index()],
                Role::Previous => {}
                Role::Test => arity.test = true,
                Role::Trial => arity.trial = true,
            },
            Leaf::Time | Leaf::TimeStep => depends = Depends { step: true, ..Depends::default() },
            _ => {}
        }
        self.intern(Node::Leaf(leaf), self.leaf_shape(leaf), false, arity, depends)
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
        self.intern(Node::Add(a, b), self.shape(a), false, arity, depends)
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
        self.intern(Node::Sub(a, b), self.shape(a), false, arity, depends)
    }

    /// -a
    pub fn neg(&mut self, a: ExprId) -> ExprId {
        if let Node::Neg(inner) = *self.node(a) {
            return inner;
        }
        if let Some(e) = self.fold1(a, |x| -x) {
            return e;
        }
        self.intern(Node::Neg(a), self.shape(a), false, self.arity(a), self.depends(a))
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
        self.intern(Node::Scale(s, a), shape, false, arity, depends)
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
        self.intern(Node::Divide(a, s), self.shape(a), false, arity, depends)
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
        self.intern(Node::MulComponents(a, b), self.shape(a), false, arity, depends)
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
        self.intern(Node::DivComponents(a, b), self.shape(a), false, arity, depends)
    }

    /// Sum over the index pairs `axes` (of a, of b).
    pub fn contract(&mut self, a: ExprId, b: ExprId, axes: &[(usize, usize)]) -> ExprId {
        let (sa, sb) = (self.shape(a), self.shape(b));
        let mut sizes: Vec<usize> =
            (0..sa.rank()).filter(|i| axes.iter().all(|x| x.0 != *i)).map(|i| sa.size(i)).collect();
        sizes.extend((0..sb.rank()).filter(|i| axes.iter().all(|x| x.1 != *i)).map(|i| sb.size(i)));
        assert!(axes.iter().all(|&(i, j)| sa.size(i) == sb.size(j)));
        let shape = Shape::new(&sizes).expect("rank is checked before");
        if sa.rank() == 0 {
            return self.scale(a, b);
        }
        if sb.rank() == 0 {
            return self.scale(b, a);
        }
        if self.is_zero(a) || self.is_zero(b) {
            return self.zero(shape);
        }
        // Scalar factors move out, so that constants meet constants.
        for (first, second, swapped) in [(a, b, false), (b, a, true)] {
            let moved = match *self.node(first) {
                Node::Scale(s, t) if self.constant_value(s).is_some() => Some((s, t)),
                _ => None,
            };
            if let Some((s, t)) = moved {
                let inner = if swapped { self.contract(second, t, axes) } else { self.contract(t, second, axes) };
                return self.scale(s, inner);
            }
        }
        let (arity, depends) = self.join2(a, b);
        let axes = axes
            .iter()
            .map(|&(i, j)| (u8::try_from(i).expect("rank is small"), u8::try_from(j).expect("rank is small")))
            .collect();
        self.intern(Node::Contract(a, b, axes), shape, false, arity, depends)
    }

    /// Full contraction of two tensors of one shape: the scalar product.
    pub fn inner(&mut self, a: ExprId, b: ExprId) -> ExprId {
        let axes: Vec<(usize, usize)> = (0..self.shape(a).rank()).map(|i| (i, i)).collect();
        self.contract(a, b, &axes)
    }

    /// Sum over the indices `i < j` of `a`.
    pub fn trace(&mut self, a: ExprId, i: usize, j: usize) -> ExprId {
        let s = self.shape(a);
        assert!(i < j && s.size(i) == s.size(j));
        let sizes: Vec<usize> = (0..s.rank()).filter(|k| *k != i && *k != j).map(|k| s.size(k)).collect();
        let shape = Shape::new(&sizes).expect("smaller rank");
        if self.is_zero(a) {
            return self.zero(shape);
        }
        if let Some(v) = self.constant_value(a) {
            let mut out = vec![0.0; shape.len()];
            for (p, x) in v.iter().enumerate() {
                let idx = s.indices(p);
                if idx[i] == idx[j] {
                    let rest: Vec<usize> = (0..s.rank()).filter(|k| *k != i && *k != j).map(|k| idx[k]).collect();
                    out[shape.position(&rest)] += x;
                }
            }
            return self.constant(shape, &out);
        }
        let node = Node::Trace(a, u8::try_from(i).expect("rank is small"), u8::try_from(j).expect("rank is small"));
        self.intern(node, shape, false, self.arity(a), self.depends(a))
    }

    /// Index k of the result is index `perm[k]` of `a`.
    pub fn permute(&mut self, a: ExprId, perm: &[usize]) -> ExprId {
        let s = self.shape(a);
        if perm.iter().enumerate().all(|(k, p)| k == *p) {
            return a;
        }
        let sizes: Vec<usize> = perm.iter().map(|p| s.size(*p)).collect();
        let shape = Shape::new(&sizes).expect("same rank");
        if let Some(v) = self.constant_value(a) {
            let mut out = vec![0.0; v.len()];
            for (q, slot) in out.iter_mut().enumerate() {
                let idx = shape.indices(q);
                let mut from = vec![0; perm.len()];
                for (k, p) in perm.iter().enumerate() {
                    from[*p] = idx[k];
                }
                *slot = v[s.position(&from)];
            }
            return self.constant(shape, &out);
        }
        if let Node::Permute(inner, first) = self.node(a).clone() {
            let joined: Vec<usize> = perm.iter().map(|p| usize::from(first[*p])).collect();
            return self.permute(inner, &joined);
        }
        let perm = perm.iter().map(|p| u8::try_from(*p).expect("rank is small")).collect();
        self.intern(Node::Permute(a, perm), shape, false, self.arity(a), self.depends(a))
    }

    /// Transposed matrix.
    pub fn transpose(&mut self, a: ExprId) -> ExprId {
        self.permute(a, &[1, 0])
    }

    /// The same entries with the sizes of `shape`.
    pub fn reshape(&mut self, a: ExprId, shape: Shape) -> ExprId {
        assert_eq!(self.shape(a).len(), shape.len());
        if self.shape(a) == shape {
            return a;
        }
        if let Some(v) = self.constant_value(a) {
            return self.constant(shape, &v);
        }
        if let Node::Reshape(inner) = *self.node(a) {
            return self.reshape(inner, shape);
        }
        self.intern(Node::Reshape(a), shape, false, self.arity(a), self.depends(a))
    }

    /// A tensor with one entry as a scalar.
    pub fn to_scalar(&mut self, a: ExprId) -> ExprId {
        self.reshape(a, Shape::SCALAR)
    }

    /// Some indices fixed (from 0), the others kept.
    pub fn pick(&mut self, a: ExprId, fixed: &[Option<usize>]) -> ExprId {
        let s = self.shape(a);
        let sizes: Vec<usize> = (0..s.rank()).filter(|k| fixed[*k].is_none()).map(|k| s.size(k)).collect();
        let shape = Shape::new(&sizes).expect("smaller rank");
        if fixed.iter().all(Option::is_none) {
            return a;
        }
        if let Some(v) = self.constant_value(a) {
            let out: Vec<f64> = (0..shape.len()).map(|q| v[picked_position(s, shape, fixed, q)]).collect();
            return self.constant(shape, &out);
        }
        if let (Node::Stack(parts), 0) = (self.node(a), shape.rank()) {
            return parts[picked_position(s, shape, fixed, 0)];
        }
        let fixed = fixed.iter().map(|f| f.map(|i| u16::try_from(i).expect("sizes are small"))).collect();
        self.intern(Node::Pick(a, fixed), shape, false, self.arity(a), self.depends(a))
    }

    /// Entry `position` (first index fastest) as a scalar.
    pub fn entry(&mut self, a: ExprId, position: usize) -> ExprId {
        let fixed: Vec<Option<usize>> = self.shape(a).indices(position).into_iter().map(Some).collect();
        self.pick(a, &fixed)
    }

    /// A tensor from its entries, first index fastest.
    pub fn stack(&mut self, shape: Shape, parts: &[ExprId]) -> ExprId {
        assert_eq!(shape.len(), parts.len());
        if shape.rank() == 0 {
            return parts[0];
        }
        let constants: Option<Vec<f64>> = parts.iter().map(|p| self.scalar_constant(*p)).collect();
        if let Some(values) = constants {
            return self.constant(shape, &values);
        }
        let mut arity = Arity::NONE;
        let mut depends = Depends::default();
        for p in parts {
            arity = arity.both(self.arity(*p));
            depends = depends.join(self.depends(*p));
        }
        self.intern(Node::Stack(parts.to_vec()), shape, false, arity, depends)
    }

    /// A function of each entry.
    pub fn map(&mut self, f: Function1, a: ExprId) -> ExprId {
        let folded = self.fold1(a, |x| match f {
            Function1::Sqrt => x.sqrt(),
            Function1::Math(f) => f.eval(x),
        });
        folded.unwrap_or_else(|| self.intern(Node::Map(f, a), self.shape(a), false, self.arity(a), self.depends(a)))
    }

    /// A function of two tensors of one shape, entry by entry.
    pub fn map2(&mut self, f: MathFn2, a: ExprId, b: ExprId) -> ExprId {
        assert_eq!(self.shape(a), self.shape(b));
        if let Some(e) = self.fold2(a, b, |x, y| f.eval(x, y)) {
            return e;
        }
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::Map2(f, a, b), self.shape(a), false, arity, depends)
    }

    /// Mask, entry by entry, equal shapes.
    pub fn compare(&mut self, op: Compare, a: ExprId, b: ExprId) -> ExprId {
        assert_eq!(self.shape(a), self.shape(b));
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::Compare(op, a, b), self.shape(a), true, arity, depends)
    }

    /// Mask: both.
    pub fn and(&mut self, a: ExprId, b: ExprId) -> ExprId {
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::And(a, b), self.shape(a), true, arity, depends)
    }

    /// Mask: either.
    pub fn or(&mut self, a: ExprId, b: ExprId) -> ExprId {
        let (arity, depends) = self.join2(a, b);
        self.intern(Node::Or(a, b), self.shape(a), true, arity, depends)
    }

    /// Mask: not.
    pub fn not(&mut self, a: ExprId) -> ExprId {
        self.intern(Node::Not(a), self.shape(a), true, self.arity(a), self.depends(a))
    }

    /// The value of a mask all of whose operands are constants.
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
            Node::And(a, b) => Some(zip(self.constant_mask(a)?, self.constant_mask(b)?, |x, y| x && y)),
            Node::Or(a, b) => Some(zip(self.constant_mask(a)?, self.constant_mask(b)?, |x, y| x || y)),
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
        self.intern(Node::Select(mask, a, b), self.shape(a), false, arity, depends)
    }

    fn unary(&mut self, node: Node, a: ExprId, shape: Shape) -> ExprId {
        self.intern(node, shape, false, self.arity(a), self.depends(a))
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
        self.intern(Node::Ball(v, r), self.shape(v), false, arity, depends)
    }

    /// Mask: norm of v at most r.
    pub fn in_ball(&mut self, v: ExprId, r: ExprId) -> ExprId {
        let (arity, depends) = self.join2(v, r);
        self.intern(Node::InBall(v, r), Shape::SCALAR, true, arity, depends)
    }

    /// min(r over norm of v, 1), 0 where v is 0.
    pub fn ball_ratio(&mut self, v: ExprId, r: ExprId) -> ExprId {
        let (arity, depends) = self.join2(v, r);
        self.intern(Node::BallRatio(v, r), Shape::SCALAR, false, arity, depends)
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

/// Where entry `q` of the picked tensor stands in the whole one.
pub(crate) fn picked_position(whole: Shape, picked: Shape, fixed: &[Option<usize>], q: usize) -> usize {
    let mut rest = picked.indices(q).into_iter();
    let full: Vec<usize> =
        fixed.iter().map(|f| f.unwrap_or_else(|| rest.next().expect("one index per free slot"))).collect();
    whole.position(&full)
}
