//! What moves with one unknown where the images of points follow the bodies.
//!
//! The numbers that a law reads are moved as the chain says: an unknown shifts the image, the image takes with it all that is
//! read there, and the test functions. The shift is worked out here from the numbers at the point, in double-double and
//! without the graph: normals by elimination, not by the nodes of `image.rs`. The matrix of the shift and the slope of the
//! normal are given; that they are right for a mesh is tested there.

use std::collections::BTreeMap;

use crate::{
    dd::Dd,
    graph::{Graph, Leaf, Role},
    law::TermLaw,
    types::{BasisSlot, FieldId, FieldOp, ImageBy, InputSlot, Moves, RateOrder, Side},
};

/// How images shift in a law.
pub(super) struct Chain<'l> {
    graph: &'l Graph,
    moves: Moves,
    dim: usize,
    at: BTreeMap<InputSlot, usize>,
}

/// A vector or a row.
type Row = [Dd; 3];
const ZERO: Row = [Dd::ZERO; 3];

fn dot(a: &Row, b: &Row) -> Dd {
    (0..3).fold(Dd::ZERO, |sum, k| sum + a[k] * b[k])
}

fn scaled(s: Dd, a: &Row) -> Row {
    a.map(|x| s * x)
}

fn minus(a: &Row, b: &Row) -> Row {
    std::array::from_fn(|k| a[k] - b[k])
}

/// `F^-T v`: of `F' x = v` by elimination; the unused rows of `f` are those of the identity.
fn carried(f: &[Row; 3], v: &Row) -> Row {
    let mut m: [Row; 3] = std::array::from_fn(|i| std::array::from_fn(|j| f[j][i]));
    let mut x = *v;
    for k in 0..3 {
        let pivot = (k..3).max_by(|a, b| m[*a][k].abs().hi().total_cmp(&m[*b][k].abs().hi())).unwrap_or(k);
        m.swap(k, pivot);
        x.swap(k, pivot);
        for i in (0..3).filter(|i| *i != k) {
            let factor = m[i][k] / m[k][k];
            for j in 0..3 {
                m[i][j] = m[i][j] - factor * m[k][j];
            }
            x[i] = x[i] - factor * x[k];
        }
    }
    std::array::from_fn(|k| x[k] / m[k][k])
}

fn unit(v: &Row) -> Row {
    let size = dot(v, v).sqrt();
    v.map(|x| x / size)
}

impl<'l> Chain<'l> {
    /// `None` where images stay.
    pub(super) fn new(law: &'l TermLaw) -> Option<Self> {
        let graph = &law.listing.graph;
        let at = law.inputs.iter().enumerate().map(|(k, slot)| (*slot, k)).collect();
        Some(Self { graph, moves: graph.moves?, dim: graph.dim, at })
    }

    fn read(&self, inputs: &[Dd], slot: InputSlot) -> Dd {
        self.at.get(&slot).map_or(Dd::ZERO, |k| inputs[*k])
    }

    /// A derivative at the image. One that the law does not read has some value all the same: a tangent that lacks it is
    /// wrong.
    fn derivative(&self, inputs: &[Dd], slot: InputSlot, entry: f64) -> Dd {
        self.at.get(&slot).map_or(Dd::from_f64(0.5 + 0.3 * entry), |k| inputs[*k])
    }

    fn vector(&self, inputs: &[Dd], slot: impl Fn(u8) -> InputSlot) -> Row {
        std::array::from_fn(|k| match u8::try_from(k) {
            Ok(entry) if k < self.dim => self.read(inputs, slot(entry)),
            _ => Dd::ZERO,
        })
    }

    fn displacement(&self, inputs: &[Dd], field: FieldId, side: Side) -> Row {
        self.vector(inputs, |k| InputSlot::Field(BasisSlot { field, side, op: FieldOp::Value, entry: u16::from(k) }))
    }

    /// `I + Grad u`
    fn deformation(&self, inputs: &[Dd], field: FieldId, side: Side) -> [Row; 3] {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let one = Dd::from_f64(f64::from(u8::from(i == j)));
                if i >= self.dim || j >= self.dim {
                    return one;
                }
                let entry = u16::try_from(i + self.dim * j).expect("small tensors");
                one + self.read(inputs, InputSlot::Field(BasisSlot { field, side, op: FieldOp::Grad, entry }))
            })
        })
    }

    /// The shift of the image with one unknown.
    pub(super) fn shift(&self, inputs: &[Dd], unknown: BasisSlot) -> Row {
        let entry = usize::from(unknown.entry);
        let is =
            |field: FieldId, side: Side, op: FieldOp| (unknown.field, unknown.side, unknown.op) == (field, side, op);
        let Moves { here, there, by } = self.moves;
        let by_value = [is(here, Side::Here, FieldOp::Value), is(there, Side::There, FieldOp::Value)];
        let by_gradient = match by {
            ImageBy::Ray => is(here, Side::Here, FieldOp::Grad),
            ImageBy::Closest => is(there, Side::There, FieldOp::Grad),
        };
        if !(by_value.contains(&true) || by_gradient) {
            return ZERO;
        }
        let f2 = self.deformation(inputs, there, Side::There);
        let (x, image) = (self.vector(inputs, InputSlot::X), self.vector(inputs, InputSlot::ImageX));
        let (u1, u2) = (self.displacement(inputs, here, Side::Here), self.displacement(inputs, there, Side::There));
        let way: Row = std::array::from_fn(|k| image[k] + u2[k] - x[k] - u1[k]);
        let carried_back =
            |v: &Row| -> Row { std::array::from_fn(|k| (0..3).fold(Dd::ZERO, |sum, i| sum + f2[i][k] * v[i])) };
        let mut w = ZERO;
        if !by_gradient {
            w[entry] = Dd::from_f64(if by_value[0] { 1.0 } else { -1.0 });
        }
        let (i, j) = (entry % self.dim, entry / self.dim);
        let back = match by {
            ImageBy::Closest if by_gradient => {
                w[j] = -way[i];
                w
            }
            ImageBy::Closest => carried_back(&w),
            ImageBy::Ray => {
                let f1 = self.deformation(inputs, here, Side::Here);
                let n = unit(&carried(&f1, &self.vector(inputs, |k| InputSlot::Normal(Side::Here, k))));
                let n_y = unit(&carried(&f2, &self.vector(inputs, |k| InputSlot::Normal(Side::There, k))));
                if by_gradient {
                    let mut along = ZERO;
                    along[j] = n[i];
                    let carried = carried(&f1, &along);
                    w = scaled(dot(&way, &n), &minus(&scaled(dot(&n, &carried), &n), &carried));
                }
                carried_back(&minus(&w, &scaled(dot(&n_y, &w) / dot(&n, &n_y), &n)))
            }
        };
        std::array::from_fn(|i| {
            (0..self.dim).fold(Dd::ZERO, |sum, j| {
                let (low, high) = (i.min(j), i.max(j));
                let entry = u8::try_from(high * (high + 1) / 2 + low).expect("small tensors");
                if i < self.dim { sum + self.read(inputs, InputSlot::ImageShift(entry)) * back[j] } else { sum }
            })
        })
    }

    /// The same slot with one more derivative, in direction `k`.
    fn derived(&self, slot: BasisSlot, k: usize) -> Option<BasisSlot> {
        let op = match slot.op {
            FieldOp::Value => FieldOp::Grad,
            FieldOp::Grad => FieldOp::Hess,
            FieldOp::Hess => return None,
        };
        let leaf = Leaf::Field { field: slot.field, side: slot.side, op: slot.op, role: Role::Current };
        let entries = self.graph.leaf_shape(leaf).len();
        Some(BasisSlot { op, entry: slot.entry + u16::try_from(entries * k).expect("small tensors"), ..slot })
    }

    /// How fast all inputs move where the image shifts.
    pub(super) fn rates(&self, inputs: &[Dd], shift: &Row) -> Vec<Dd> {
        let along = |slot: BasisSlot, role: fn(BasisSlot) -> InputSlot| {
            if slot.side == Side::Here || self.graph.is_global(slot.field) {
                return Dd::ZERO;
            }
            (0..self.dim).fold(Dd::ZERO, |sum, k| match self.derived(slot, k) {
                Some(next) => sum + self.derivative(inputs, role(next), f64::from(next.entry)) * shift[k],
                None => sum,
            })
        };
        let mut rates = vec![Dd::ZERO; inputs.len()];
        for (slot, at) in &self.at {
            rates[*at] = match *slot {
                InputSlot::Field(b) => along(b, InputSlot::Field),
                InputSlot::Previous(b) => along(b, InputSlot::Previous),
                InputSlot::History(RateOrder::First, b) => along(b, |b| InputSlot::History(RateOrder::First, b)),
                InputSlot::History(RateOrder::Second, b) => along(b, |b| InputSlot::History(RateOrder::Second, b)),
                InputSlot::ImageX(k) => shift[usize::from(k)],
                InputSlot::Normal(Side::There, i) => (0..self.dim).fold(Dd::ZERO, |sum, j| {
                    let entry = u8::try_from(usize::from(i) + self.dim * j).expect("small tensors");
                    sum + self.derivative(inputs, InputSlot::ImageSlope(entry), f64::from(entry)) * shift[j]
                }),
                _ => Dd::ZERO,
            };
        }
        rates
    }

    /// What the test functions that move bring to the flux of each test slot; to that of the slot itself where the law has no
    /// slot for it, which is wrong then.
    pub(super) fn moved_tests(&self, tests: &[BasisSlot], fluxes: &[Dd], shift: &Row) -> Vec<Dd> {
        let mut out = vec![Dd::ZERO; tests.len()];
        let there = |test: &BasisSlot| test.side == Side::There && !self.graph.is_global(test.field);
        for (own, test) in tests.iter().enumerate().filter(|(_, test)| there(test)) {
            for (k, shift) in shift.iter().enumerate().take(self.dim) {
                let next = self.derived(*test, k);
                let at = next.and_then(|next| tests.iter().position(|t| *t == next)).unwrap_or(own);
                out[at] = out[at] + fluxes[own] * *shift;
            }
        }
        out
    }

    /// Gives the images of a sampled point normals of their own.
    pub(super) fn turn_normals(&self, inputs: &mut [f64], mut random: impl FnMut() -> f64) {
        let mut normal: Vec<f64> = (0..self.dim).map(|_| random()).collect();
        let size = normal.iter().fold(0.0f64, |m, x| m.hypot(*x));
        normal.iter_mut().for_each(|x| *x /= size);
        for (slot, at) in &self.at {
            if let InputSlot::Normal(Side::There, k) = slot {
                inputs[*at] = normal[usize::from(*k)];
            }
        }
    }
}
