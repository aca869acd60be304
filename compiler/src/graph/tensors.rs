//! Nodes that contract and rearrange the entries of tensors.

use super::{Arity, Depends, ExprId, Graph, Node};
use crate::types::Shape;

impl Graph {
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
        self.intern(Node::Contract(a, b, axes), shape, arity, depends)
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
        self.intern(node, shape, self.arity(a), self.depends(a))
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
        self.intern(Node::Permute(a, perm), shape, self.arity(a), self.depends(a))
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
        self.intern(Node::Reshape(a), shape, self.arity(a), self.depends(a))
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
        self.intern(Node::Pick(a, fixed), shape, self.arity(a), self.depends(a))
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
        self.intern(Node::Stack(parts.to_vec()), shape, arity, depends)
    }
}

/// Where entry `q` of the picked tensor stands in the whole one.
pub(crate) fn picked_position(whole: Shape, picked: Shape, fixed: &[Option<usize>], q: usize) -> usize {
    let mut rest = picked.indices(q).into_iter();
    let full: Vec<usize> =
        fixed.iter().map(|f| f.unwrap_or_else(|| rest.next().expect("one index per free slot"))).collect();
    whole.position(&full)
}
