//! Tensor graph to scalar instructions: each tensor entry becomes a linear form over test and trial slots.
//!
//! Norms and projections are evaluated without overflow or underflow: with m the largest |v_i|, y = v/m and
//! rho = |y| in [1, sqrt(n)], the norm is m rho, the direction y/rho, and "norm at most r" is rho <= r/m.

use std::collections::BTreeMap;

use crate::{
    graph::{ExprId, Function1, Graph, Leaf, Node, Role, picked_position},
    ir::{Compare, Val},
    lookup::{CurveRef, Reading},
    math::MatrixFn,
    scalar::{Form, NO_SLOT, Scalars},
    types::{BasisSlot, FieldId, FieldOp, InputSlot, Moves, Shape, Side, UniformSlot},
};

/// Slots by the order in which the point law reads or multiplies them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slots {
    /// What the law reads at a point.
    pub(crate) inputs: BTreeMap<InputSlot, usize>,
    /// Numbers that are the same at all points.
    pub(crate) uniforms: BTreeMap<UniformSlot, usize>,
    /// Test functions.
    pub(crate) tests: BTreeMap<BasisSlot, u16>,
    /// Trial functions.
    pub(crate) trials: BTreeMap<BasisSlot, u16>,
}

/// Lowers expressions of one graph into one scalar graph.
pub(crate) struct Lowering<'g> {
    graph: &'g Graph,
    pub(crate) scalars: Scalars,
    pub(crate) slots: Slots,
    memo: Vec<Option<Vec<Form>>>,
    masks: BTreeMap<ExprId, Vec<Val>>,
    polar: BTreeMap<ExprId, Polar>,
}

/// A vector as length and direction, safely.
#[derive(Clone)]
struct Polar {
    /// Largest absolute entry.
    largest: Val,
    /// Norm of v over `largest`.
    rho: Val,
    /// Mask: v is zero.
    is_zero: Val,
    /// v over its norm, 0 at 0.
    unit: Vec<Val>,
}

impl<'g> Lowering<'g> {
    pub(crate) fn new(graph: &'g Graph) -> Self {
        Self {
            graph,
            scalars: Scalars::default(),
            slots: Slots::default(),
            memo: vec![None; graph.len()],
            masks: BTreeMap::new(),
            polar: BTreeMap::new(),
        }
    }

    /// The mapping that the graph reads through.
    pub(crate) fn mapping(&self) -> Option<usize> {
        self.graph.mapping
    }

    /// The displacements that the images of that mapping follow.
    pub(crate) fn moves(&self) -> Option<Moves> {
        self.graph.moves
    }

    /// The entries of an expression as forms.
    pub(crate) fn lower(&mut self, e: ExprId) -> Vec<Form> {
        if let Some(known) = &self.memo[e.index()] {
            return known.clone();
        }
        let before = std::mem::replace(&mut self.scalars.origin, self.graph.origin(e));
        let forms = self.entries(e);
        self.scalars.origin = before;
        self.memo[e.index()] = Some(forms.clone());
        forms
    }

    /// The entries of an expression without test functions.
    pub(crate) fn values(&mut self, e: ExprId) -> Vec<Val> {
        let forms = self.lower(e);
        forms.iter().map(|f| self.scalars.value(f)).collect()
    }

    fn scalar(&mut self, e: ExprId) -> Val {
        self.values(e)[0]
    }

    fn pairs(&mut self, a: ExprId, b: ExprId, f: fn(&mut Scalars, &Form, &Form) -> Form) -> Vec<Form> {
        let (x, y) = (self.lower(a), self.lower(b));
        x.iter().zip(&y).map(|(x, y)| f(&mut self.scalars, x, y)).collect()
    }

    fn each(&mut self, a: ExprId, mut f: impl FnMut(&mut Scalars, Val) -> Val) -> Vec<Form> {
        let x = self.lower(a);
        x.iter().map(|x| self.scalars.form_map(x, &mut f)).collect()
    }

    fn plain(&mut self, values: Vec<Val>) -> Vec<Form> {
        values.into_iter().map(|v| self.scalars.form(v)).collect()
    }

    fn entries(&mut self, e: ExprId) -> Vec<Form> {
        let g = self.graph;
        let shape = g.shape(e);
        match g.node(e).clone() {
            Node::Const(bits) => {
                let values = bits.iter().map(|b| self.scalars.constant(f64::from_bits(*b))).collect();
                self.plain(values)
            }
            Node::Leaf(leaf) => self.leaf(leaf),
            Node::Add(a, b) => self.pairs(a, b, Scalars::form_add),
            Node::Sub(a, b) => self.pairs(a, b, Scalars::form_sub),
            Node::Neg(a) => self.each(a, Scalars::neg),
            Node::Reshape(a) | Node::Print(a) => self.lower(a),
            Node::Scale(s, a) => {
                let s = self.lower(s).swap_remove(0);
                let a = self.lower(a);
                a.iter().map(|x| self.scalars.form_mul(&s, x)).collect()
            }
            Node::Divide(a, s) => {
                let s = self.scalar(s);
                self.each(a, |g, x| g.div(x, s))
            }
            Node::MulComponents(a, b) => self.pairs(a, b, Scalars::form_mul),
            Node::DivComponents(a, b) => self.quotients(a, b),
            Node::Contract(a, b, axes) => self.contract(a, b, &axes, shape),
            Node::Trace(a, i, j) => self.trace(a, usize::from(i), usize::from(j), shape),
            Node::Permute(a, perm) => self.permuted(a, &perm, shape),
            Node::Pick(a, fixed) => self.picked(a, &fixed, shape),
            Node::Stack(parts) => parts.iter().map(|p| self.lower(*p).swap_remove(0)).collect(),
            Node::Map(f, a) => self.mapped(f, a),
            Node::Lookup(curve, reading, a) => self.lookup(&curve, reading, a),
            Node::Map2(f, a, b) => {
                let (x, y) = (self.values(a), self.values(b));
                let z = x.into_iter().zip(y).map(|(x, y)| self.scalars.call2(f, x, y)).collect();
                self.plain(z)
            }
            Node::Select(mask, a, b) => {
                let mask = self.mask(mask);
                let (x, y) = (self.lower(a), self.lower(b));
                (0..x.len())
                    .map(|k| self.scalars.form_select(mask[if mask.len() == 1 { 0 } else { k }], &x[k], &y[k]))
                    .collect()
            }
            Node::Norm(v) => self.norm(v),
            Node::Unit(v) => {
                let unit = self.polar(v).unit;
                self.plain(unit)
            }
            Node::Ball(v, r) => self.ball(v, r),
            Node::BallRatio(v, r) => self.ball_ratio(v, r),
            Node::Det(a) => self.det(a),
            Node::Inverse(a) => self.inverse(a),
            Node::Matrix(f, a) => self.matrix(f, a),
            Node::Compare(..) | Node::And(..) | Node::Or(..) | Node::Not(_) | Node::InBall(..) => {
                panic!("masks are lowered by `mask`")
            }
        }
    }

    /// The entries of a tensor whose index k is index `perm[k]` of `a`.
    fn permuted(&mut self, a: ExprId, perm: &[u8], shape: Shape) -> Vec<Form> {
        let inner = self.lower(a);
        let from = self.graph.shape(a);
        let source = |q: usize| {
            let mut source = vec![0; perm.len()];
            for (index, p) in shape.indices(q).into_iter().zip(perm) {
                source[usize::from(*p)] = index;
            }
            from.position(&source)
        };
        (0..shape.len()).map(|q| inner[source(q)].clone()).collect()
    }

    /// The entries of `a` where some indices are fixed.
    fn picked(&mut self, a: ExprId, fixed: &[Option<u16>], shape: Shape) -> Vec<Form> {
        let inner = self.lower(a);
        let whole = self.graph.shape(a);
        let fixed: Vec<Option<usize>> = fixed.iter().map(|f| f.map(usize::from)).collect();
        (0..shape.len()).map(|q| inner[picked_position(whole, shape, &fixed, q)].clone()).collect()
    }

    /// A function of each entry.
    fn mapped(&mut self, f: Function1, a: ExprId) -> Vec<Form> {
        let x = self.values(a);
        let one = |x| match f {
            Function1::Sqrt => self.scalars.sqrt(x),
            Function1::Math(f) => self.scalars.call1(f, x),
        };
        let values = x.into_iter().map(one).collect();
        self.plain(values)
    }

    fn lookup(&mut self, curve: &CurveRef, reading: Reading, a: ExprId) -> Vec<Form> {
        let x = self.scalar(a);
        let value = self.scalars.lookup(curve, reading, x);
        self.plain(vec![value])
    }

    fn quotients(&mut self, a: ExprId, b: ExprId) -> Vec<Form> {
        let bottom = self.values(b);
        let top = self.lower(a);
        top.iter().zip(&bottom).map(|(x, y)| self.scalars.form_map(x, |g, x| g.div(x, *y))).collect()
    }

    fn det(&mut self, a: ExprId) -> Vec<Form> {
        let m = self.values(a);
        let n = self.graph.shape(a).size(0);
        let all: Vec<usize> = (0..n).collect();
        let det = self.determinant(&m, n, &all, &all);
        self.plain(vec![det])
    }

    fn norm(&mut self, v: ExprId) -> Vec<Form> {
        let p = self.polar(v);
        let norm = self.scalars.mul(p.largest, p.rho);
        let zero = self.scalars.constant(0.0);
        let norm = self.scalars.select(p.is_zero, zero, norm);
        self.plain(vec![norm])
    }

    /// min(r over norm of v, 1), 0 where v is 0.
    fn ball_ratio(&mut self, v: ExprId, r: ExprId) -> Vec<Form> {
        let p = self.polar(v);
        let r = self.scalar(r);
        let s = &mut self.scalars;
        let over = s.div(r, p.largest);
        let ratio = s.div(over, p.rho);
        let one = s.constant(1.0);
        let zero = s.constant(0.0);
        let small = s.compare(Compare::LessEqual, ratio, one);
        let ratio = s.select(small, ratio, one);
        let ratio = s.select(p.is_zero, zero, ratio);
        self.plain(vec![ratio])
    }

    /// The entries of a mask.
    pub(crate) fn mask(&mut self, e: ExprId) -> Vec<Val> {
        if let Some(known) = self.masks.get(&e) {
            return known.clone();
        }
        let before = std::mem::replace(&mut self.scalars.origin, self.graph.origin(e));
        let two = |this: &mut Self, a, b, f: fn(&mut Scalars, Val, Val) -> Val| {
            let (x, y) = (this.mask(a), this.mask(b));
            x.into_iter().zip(y).map(|(x, y)| f(&mut this.scalars, x, y)).collect()
        };
        let mask: Vec<Val> = match *self.graph.node(e) {
            Node::Compare(op, a, b) => {
                let (x, y) = (self.values(a), self.values(b));
                x.into_iter().zip(y).map(|(x, y)| self.scalars.compare(op, x, y)).collect()
            }
            Node::And(a, b) => two(self, a, b, Scalars::and),
            Node::Or(a, b) => two(self, a, b, Scalars::or),
            Node::Not(a) => self.mask(a).into_iter().map(|x| self.scalars.not(x)).collect(),
            Node::InBall(v, r) => vec![self.in_ball(v, r)],
            _ => panic!("only masks come here"),
        };
        self.scalars.origin = before;
        self.masks.insert(e, mask.clone());
        mask
    }

    fn leaf(&mut self, leaf: Leaf) -> Vec<Form> {
        let n = self.graph.leaf_shape(leaf).len();
        let number = |k: usize| u16::try_from(k).expect("tensors are small");
        let small = |k: usize| u8::try_from(k).expect("geometry tensors are small");
        (0..n)
            .map(|k| match leaf {
                Leaf::Field { field, side, op, role } => {
                    let slot = BasisSlot { field, side, op, entry: number(k) };
                    match role {
                        Role::Current => self.input(InputSlot::Field(slot)),
                        Role::Previous => self.input(InputSlot::Previous(slot)),
                        Role::History(order) => self.input(InputSlot::History(order, slot)),
                        Role::Test => {
                            let next = number(self.slots.tests.len());
                            let id = *self.slots.tests.entry(slot).or_insert(next);
                            vec![((id, NO_SLOT), self.scalars.constant(1.0))]
                        }
                        Role::Trial => {
                            let next = number(self.slots.trials.len());
                            let id = *self.slots.trials.entry(slot).or_insert(next);
                            vec![((NO_SLOT, id), self.scalars.constant(1.0))]
                        }
                    }
                }
                Leaf::X => self.input(InputSlot::X(small(k))),
                Leaf::ImageX => self.input(InputSlot::ImageX(small(k))),
                Leaf::ImageShift => {
                    let (i, j) = (k % self.graph.dim, k / self.graph.dim);
                    let (low, high) = (i.min(j), i.max(j));
                    self.input(InputSlot::ImageShift(small(high * (high + 1) / 2 + low)))
                }
                Leaf::ImageSlope => self.input(InputSlot::ImageSlope(small(k))),
                Leaf::Normal(side) => self.input(InputSlot::Normal(side, small(k))),
                Leaf::Conormal(side) => self.input(InputSlot::Conormal(side, small(k))),
                Leaf::ElementSize(side) => self.input(InputSlot::ElementSize(side)),
                Leaf::ElementK(side) => self.input(InputSlot::ElementK(side, small(k))),
                Leaf::ElementB(side) => self.input(InputSlot::ElementB(side, small(k))),
                Leaf::Time => self.uniform(UniformSlot::Time),
                Leaf::TimeStep => self.uniform(UniformSlot::TimeStep),
                Leaf::RateFactor(factor) => self.uniform(UniformSlot::Rate(factor)),
            })
            .collect()
    }

    fn input(&mut self, slot: InputSlot) -> Form {
        let next = self.slots.inputs.len();
        let id = *self.slots.inputs.entry(slot).or_insert(next);
        let v = self.scalars.input(id);
        self.scalars.form(v)
    }

    /// The value of a global field of one entry.
    pub(crate) fn global_value(&mut self, field: FieldId) -> Val {
        let form = self.input(InputSlot::Field(BasisSlot { field, side: Side::Here, op: FieldOp::Value, entry: 0 }));
        self.scalars.value(&form)
    }

    fn uniform(&mut self, slot: UniformSlot) -> Form {
        let next = self.slots.uniforms.len();
        let id = *self.slots.uniforms.entry(slot).or_insert(next);
        let v = self.scalars.uniform(id);
        self.scalars.form(v)
    }

    fn contract(&mut self, a: ExprId, b: ExprId, axes: &[(u8, u8)], shape: Shape) -> Vec<Form> {
        let (sa, sb) = (self.graph.shape(a), self.graph.shape(b));
        let (x, y) = (self.lower(a), self.lower(b));
        let free_a: Vec<usize> = (0..sa.rank()).filter(|i| axes.iter().all(|p| usize::from(p.0) != *i)).collect();
        let free_b: Vec<usize> = (0..sb.rank()).filter(|i| axes.iter().all(|p| usize::from(p.1) != *i)).collect();
        let summed =
            Shape::new(&axes.iter().map(|p| sa.size(usize::from(p.0))).collect::<Vec<_>>()).expect("smaller rank");
        let mut out = Vec::with_capacity(shape.len());
        for q in 0..shape.len() {
            let idx = shape.indices(q);
            let base_a: usize = free_a.iter().zip(&idx).map(|(f, i)| i * sa.stride(*f)).sum();
            let base_b: usize = free_b.iter().zip(&idx[free_a.len()..]).map(|(f, i)| i * sb.stride(*f)).sum();
            let mut total: Form = Vec::new();
            for s in 0..summed.len() {
                let sum = summed.indices(s);
                let pa = base_a + axes.iter().zip(&sum).map(|(p, i)| i * sa.stride(usize::from(p.0))).sum::<usize>();
                let pb = base_b + axes.iter().zip(&sum).map(|(p, i)| i * sb.stride(usize::from(p.1))).sum::<usize>();
                let product = self.scalars.form_mul(&x[pa], &y[pb]);
                total = self.scalars.form_add(&total, &product);
            }
            out.push(total);
        }
        out
    }

    fn trace(&mut self, a: ExprId, i: usize, j: usize, shape: Shape) -> Vec<Form> {
        let s = self.graph.shape(a);
        let x = self.lower(a);
        let kept: Vec<usize> = (0..s.rank()).filter(|k| *k != i && *k != j).collect();
        (0..shape.len())
            .map(|q| {
                let base: usize = kept.iter().zip(shape.indices(q)).map(|(k, idx)| idx * s.stride(*k)).sum();
                let mut total: Form = Vec::new();
                for m in 0..s.size(i) {
                    total = self.scalars.form_add(&total, &x[base + m * (s.stride(i) + s.stride(j))]);
                }
                total
            })
            .collect()
    }

    fn polar(&mut self, v: ExprId) -> Polar {
        if let Some(known) = self.polar.get(&v) {
            return known.clone();
        }
        let x = self.values(v);
        let s = &mut self.scalars;
        let mut largest = s.constant(0.0);
        for (k, x) in x.iter().enumerate() {
            let size = s.abs(*x);
            largest = if k == 0 { size } else { s.max(size, largest) };
        }
        let zero = s.constant(0.0);
        let is_zero = s.compare(Compare::Equal, largest, zero);
        let y: Vec<Val> = x.iter().map(|x| s.div(*x, largest)).collect();
        let mut square = s.constant(0.0);
        for y in &y {
            let part = s.mul(*y, *y);
            square = s.add(square, part);
        }
        let rho = s.sqrt(square);
        let unit = y
            .iter()
            .map(|y| {
                let e = s.div(*y, rho);
                s.select(is_zero, zero, e)
            })
            .collect();
        let polar = Polar { largest, rho, is_zero, unit };
        self.polar.insert(v, polar.clone());
        polar
    }

    /// norm of v at most r: v is zero and r is not negative, or rho <= r/m
    fn in_ball(&mut self, v: ExprId, r: ExprId) -> Val {
        let p = self.polar(v);
        let r = self.scalar(r);
        let s = &mut self.scalars;
        let zero = s.constant(0.0);
        let closed = s.compare(Compare::LessEqual, zero, r);
        let at_center = s.and(p.is_zero, closed);
        let bound = s.div(r, p.largest);
        let inside = s.compare(Compare::LessEqual, p.rho, bound);
        s.or(at_center, inside)
    }

    fn ball(&mut self, v: ExprId, r: ExprId) -> Vec<Form> {
        let inside = self.in_ball(v, r);
        let unit = self.polar(v).unit;
        let x = self.values(v);
        let r = self.scalar(r);
        let s = &mut self.scalars;
        let zero = s.constant(0.0);
        let closed = s.compare(Compare::LessEqual, zero, r);
        let out = x
            .iter()
            .zip(&unit)
            .map(|(x, e)| {
                let slip = s.mul(r, *e);
                let value = s.select(inside, *x, slip);
                s.select(closed, value, zero)
            })
            .collect();
        self.plain(out)
    }

    /// The branch of a projection: 0 open (no radius), 1 slip, 2 stick. Of a radius of zero that of the parts which make it
    /// zero, as `pos_part` of a gap does: a point that is open and has not moved does not stick.
    pub(crate) fn ball_code(&mut self, v: ExprId, r: ExprId) -> Val {
        let inside = self.in_ball(v, r);
        let left_out = self.left_out_in(r);
        let r = self.scalar(r);
        let s = &mut self.scalars;
        let [zero, one, two] = [0.0, 1.0, 2.0].map(|c| s.constant(c));
        let positive = s.compare(Compare::Less, zero, r);
        let closed = s.compare(Compare::LessEqual, zero, r);
        let slip = s.select(positive, one, zero);
        let tie = left_out.into_iter().fold(two, |code, is_left_out| s.select(is_left_out, zero, code));
        let stick = s.select(positive, two, tie);
        let code = s.select(inside, stick, slip);
        s.select(closed, code, zero)
    }

    /// Where the choices inside an expression that move with the unknowns take zero.
    fn left_out_in(&mut self, e: ExprId) -> Vec<Val> {
        let mut found = Vec::new();
        for part in self.graph.reachable(e) {
            let Node::Select(mask, a, b) = *self.graph.node(part) else { continue };
            if !self.graph.depends(mask).unknown || self.graph.is_zero(a) == self.graph.is_zero(b) {
                continue;
            }
            let takes_second = self.graph.is_zero(b);
            for m in self.mask(mask) {
                found.push(if takes_second { self.scalars.not(m) } else { m });
            }
        }
        found
    }

    fn determinant(&mut self, m: &[Val], n: usize, rows: &[usize], columns: &[usize]) -> Val {
        let Some((first, rest)) = rows.split_first() else {
            return self.scalars.constant(1.0);
        };
        let mut total = self.scalars.constant(0.0);
        for (k, column) in columns.iter().enumerate() {
            let others: Vec<usize> = columns.iter().copied().filter(|c| c != column).collect();
            let below = self.determinant(m, n, rest, &others);
            let product = self.scalars.mul(m[first + n * column], below);
            total = if k % 2 == 0 { self.scalars.add(total, product) } else { self.scalars.sub(total, product) };
        }
        total
    }

    fn inverse(&mut self, a: ExprId) -> Vec<Form> {
        let m = self.values(a);
        let n = self.graph.shape(a).size(0);
        let all: Vec<usize> = (0..n).collect();
        let det = self.determinant(&m, n, &all, &all);
        let mut out = Vec::with_capacity(n * n);
        for j in 0..n {
            for i in 0..n {
                // entry (i, j) of the inverse is cofactor (j, i) over the determinant
                let rows: Vec<usize> = (0..n).filter(|k| *k != j).collect();
                let columns: Vec<usize> = (0..n).filter(|k| *k != i).collect();
                let minor = self.determinant(&m, n, &rows, &columns);
                let signed = if (i + j) % 2 == 0 { minor } else { self.scalars.neg(minor) };
                out.push(self.scalars.div(signed, det));
            }
        }
        self.plain(out)
    }

    fn matrix(&mut self, f: MatrixFn, a: ExprId) -> Vec<Form> {
        let m = self.values(a);
        let n = self.graph.shape(a).size(0);
        let parts = self.scalars.matrix(f, n, &m);
        self.plain(parts)
    }
}
