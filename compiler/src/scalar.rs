//! The scalar expression graph below the tensor graph: hash-consed instructions with folding.
//!
//! Every tensor entry becomes a *linear form* over (test, trial) slots: an ordinary value has the one key
//! `NO_SLOT, NO_SLOT`, a zero has none. Products of forms pair their keys, so the coefficient of each pair of test
//! and trial functions falls out without any algebra on test functions, and structural zeros never exist.

use std::collections::HashMap;

use crate::{
    ir::{Compare, Inst, Origin, Val},
    lookup::{CurveRef, Reading},
    math::{MathFn1, MathFn2, MatrixFn},
};

/// No test (or trial) function.
pub(crate) const NO_SLOT: u16 = u16::MAX;

/// A pair of test slot and trial slot.
pub(crate) type Key = (u16, u16);

/// Coefficients by key, sorted by key.
pub(crate) type Form = Vec<(Key, Val)>;

#[derive(Clone, PartialEq, Eq, Hash)]
enum InstKey {
    Small(u8, u64, u64, u64),
    Matrix(MatrixFn, u8, Box<[Val]>),
}

fn key_of(inst: &Inst) -> InstKey {
    let v = |v: &Val| v.index() as u64;
    let small = InstKey::Small;
    match inst {
        Inst::Const(c) => small(0, c.to_bits(), 0, 0),
        Inst::Input(s) => small(1, u64::from(*s), 0, 0),
        Inst::Uniform(s) => small(2, u64::from(*s), 0, 0),
        Inst::Add(a, b) => small(3, v(a), v(b), 0),
        Inst::Sub(a, b) => small(4, v(a), v(b), 0),
        Inst::Mul(a, b) => small(5, v(a), v(b), 0),
        Inst::Div(a, b) => small(6, v(a), v(b), 0),
        Inst::Neg(a) => small(7, v(a), 0, 0),
        Inst::Abs(a) => small(8, v(a), 0, 0),
        Inst::Sqrt(a) => small(9, v(a), 0, 0),
        Inst::Compare(c, a, b) => small(10, *c as u64, v(a), v(b)),
        Inst::And(a, b) => small(11, v(a), v(b), 0),
        Inst::Or(a, b) => small(12, v(a), v(b), 0),
        Inst::Not(a) => small(13, v(a), 0, 0),
        Inst::Select(m, a, b) => small(14, v(m), v(a), v(b)),
        Inst::Call1(f, a) => small(15, *f as u64, v(a), 0),
        Inst::Lookup(curve, reading, a) => small(18, curve.address().addr() as u64, *reading as u64, v(a)),
        Inst::Call2(f, a, b) => small(16, *f as u64, v(a), v(b)),
        Inst::Matrix { function, n, entries } => InstKey::Matrix(*function, *n, entries.clone()),
        Inst::Part(a, k) => small(17, v(a), u64::from(*k), 0),
    }
}

/// The hash-consed scalar graph.
#[derive(Clone, Default)]
pub(crate) struct Scalars {
    pub(crate) insts: Vec<Inst>,
    pub(crate) origins: Vec<Option<Origin>>,
    /// True if no point input is below it.
    pub(crate) uniform: Vec<bool>,
    index: HashMap<InstKey, Val>,
    pub(crate) origin: Option<Origin>,
}

impl Scalars {
    fn push(&mut self, inst: Inst) -> Val {
        let key = key_of(&inst);
        if let Some(v) = self.index.get(&key) {
            return *v;
        }
        let mut uniform = !matches!(inst, Inst::Input(_));
        inst.for_each_operand(|v| uniform &= self.uniform[v.index()]);
        let v = Val::new(self.insts.len());
        self.index.insert(key, v);
        self.insts.push(inst);
        self.origins.push(self.origin);
        self.uniform.push(uniform);
        v
    }

    pub(crate) fn constant(&mut self, c: f64) -> Val {
        self.push(Inst::Const(c))
    }

    pub(crate) fn constant_value(&self, v: Val) -> Option<f64> {
        match self.insts[v.index()] {
            Inst::Const(c) => Some(c),
            _ => None,
        }
    }

    pub(crate) fn input(&mut self, slot: usize) -> Val {
        self.push(Inst::Input(u32::try_from(slot).expect("few inputs")))
    }

    pub(crate) fn uniform(&mut self, slot: usize) -> Val {
        self.push(Inst::Uniform(u32::try_from(slot).expect("few uniforms")))
    }

    fn constants(&self, a: Val, b: Val) -> Option<(f64, f64)> {
        Some((self.constant_value(a)?, self.constant_value(b)?))
    }

    pub(crate) fn add(&mut self, a: Val, b: Val) -> Val {
        if let Some((x, y)) = self.constants(a, b) {
            return self.constant(x + y);
        }
        if self.constant_value(a) == Some(0.0) {
            return b;
        }
        if self.constant_value(b) == Some(0.0) {
            return a;
        }
        if let Inst::Neg(c) = self.insts[b.index()] {
            return self.sub(a, c);
        }
        if let Inst::Neg(c) = self.insts[a.index()] {
            return self.sub(b, c);
        }
        self.push(Inst::Add(a.min(b), a.max(b)))
    }

    pub(crate) fn sub(&mut self, a: Val, b: Val) -> Val {
        if let Some((x, y)) = self.constants(a, b) {
            return self.constant(x - y);
        }
        if self.constant_value(b) == Some(0.0) {
            return a;
        }
        if self.constant_value(a) == Some(0.0) {
            return self.neg(b);
        }
        if let Inst::Neg(c) = self.insts[b.index()] {
            return self.add(a, c);
        }
        self.push(Inst::Sub(a, b))
    }

    pub(crate) fn mul(&mut self, a: Val, b: Val) -> Val {
        if let Some((x, y)) = self.constants(a, b) {
            return self.constant(x * y);
        }
        for (x, y) in [(a, b), (b, a)] {
            match self.constant_value(x) {
                Some(0.0) => return self.constant(0.0),
                Some(1.0) => return y,
                Some(-1.0) => return self.neg(y),
                _ => {}
            }
            if let Inst::Neg(inner) = self.insts[x.index()] {
                let product = self.mul(inner, y);
                return self.neg(product);
            }
        }
        self.push(Inst::Mul(a.min(b), a.max(b)))
    }

    pub(crate) fn div(&mut self, a: Val, b: Val) -> Val {
        if let Some((x, y)) = self.constants(a, b) {
            return self.constant(x / y);
        }
        if self.constant_value(b) == Some(1.0) {
            return a;
        }
        if let Inst::Neg(inner) = self.insts[a.index()] {
            let over = self.div(inner, b);
            return self.neg(over);
        }
        self.push(Inst::Div(a, b))
    }

    pub(crate) fn neg(&mut self, a: Val) -> Val {
        if let Some(x) = self.constant_value(a) {
            return self.constant(-x);
        }
        match self.insts[a.index()] {
            Inst::Neg(inner) => inner,
            Inst::Sub(x, y) => self.push(Inst::Sub(y, x)),
            _ => self.push(Inst::Neg(a)),
        }
    }

    pub(crate) fn abs(&mut self, a: Val) -> Val {
        if let Some(x) = self.constant_value(a) {
            return self.constant(x.abs());
        }
        self.push(Inst::Abs(a))
    }

    pub(crate) fn sqrt(&mut self, a: Val) -> Val {
        if let Some(x) = self.constant_value(a) {
            return self.constant(x.sqrt());
        }
        self.push(Inst::Sqrt(a))
    }

    pub(crate) fn compare(&mut self, op: Compare, a: Val, b: Val) -> Val {
        self.push(Inst::Compare(op, a, b))
    }

    pub(crate) fn and(&mut self, a: Val, b: Val) -> Val {
        self.push(Inst::And(a, b))
    }

    pub(crate) fn or(&mut self, a: Val, b: Val) -> Val {
        self.push(Inst::Or(a, b))
    }

    pub(crate) fn not(&mut self, a: Val) -> Val {
        self.push(Inst::Not(a))
    }

    pub(crate) fn select(&mut self, mask: Val, a: Val, b: Val) -> Val {
        if a == b {
            return a;
        }
        if let Inst::Compare(op, x, y) = self.insts[mask.index()]
            && let Some((x, y)) = self.constants(x, y)
        {
            return if op.holds(x, y) { a } else { b };
        }
        self.push(Inst::Select(mask, a, b))
    }

    /// The larger; `b` when either is not a number.
    pub(crate) fn max(&mut self, a: Val, b: Val) -> Val {
        let less = self.compare(Compare::LessEqual, b, a);
        self.select(less, a, b)
    }

    pub(crate) fn call1(&mut self, f: MathFn1, a: Val) -> Val {
        if let Some(x) = self.constant_value(a) {
            return self.constant(f.eval(x));
        }
        self.push(Inst::Call1(f, a))
    }

    pub(crate) fn lookup(&mut self, curve: &CurveRef, reading: Reading, a: Val) -> Val {
        self.push(Inst::Lookup(curve.clone(), reading, a))
    }

    pub(crate) fn call2(&mut self, f: MathFn2, a: Val, b: Val) -> Val {
        if let Some((x, y)) = self.constants(a, b) {
            return self.constant(f.eval(x, y));
        }
        self.push(Inst::Call2(f, a, b))
    }

    pub(crate) fn matrix(&mut self, function: MatrixFn, n: usize, entries: &[Val]) -> Vec<Val> {
        let n = u8::try_from(n).expect("matrices are small");
        let bundle = self.push(Inst::Matrix { function, n, entries: entries.into() });
        let count = function.n_results(usize::from(n));
        (0..count).map(|k| self.push(Inst::Part(bundle, u32::try_from(k).expect("few results")))).collect()
    }

    // ---- linear forms ---------------------------------------------------------------------------------------

    /// A value as a form; a literal zero is the empty form.
    pub(crate) fn form(&self, v: Val) -> Form {
        if self.constant_value(v) == Some(0.0) { Vec::new() } else { vec![((NO_SLOT, NO_SLOT), v)] }
    }

    /// The value of a form without test and trial functions.
    pub(crate) fn value(&mut self, form: &Form) -> Val {
        match form.as_slice() {
            [] => self.constant(0.0),
            [((NO_SLOT, NO_SLOT), v)] => *v,
            _ => panic!("test functions stand linearly: checked by the builder"),
        }
    }

    /// Coefficient by coefficient; a key that one side lacks counts as zero.
    pub(crate) fn merge(
        &mut self,
        a: &Form,
        b: &Form,
        mut f: impl FnMut(&mut Self, Option<Val>, Option<Val>) -> Val,
    ) -> Form {
        let mut out = Vec::with_capacity(a.len().max(b.len()));
        let (mut i, mut j) = (0, 0);
        while i < a.len() || j < b.len() {
            let take_a = j >= b.len() || (i < a.len() && a[i].0 <= b[j].0);
            let take_b = i >= a.len() || (j < b.len() && b[j].0 <= a[i].0);
            let key = if take_a { a[i].0 } else { b[j].0 };
            let x = take_a.then(|| a[i].1);
            let y = take_b.then(|| b[j].1);
            i += usize::from(take_a);
            j += usize::from(take_b);
            let v = f(self, x, y);
            if self.constant_value(v) != Some(0.0) {
                out.push((key, v));
            }
        }
        out
    }

    pub(crate) fn form_add(&mut self, a: &Form, b: &Form) -> Form {
        self.merge(a, b, |s, x, y| match (x, y) {
            (Some(x), Some(y)) => s.add(x, y),
            (x, y) => x.or(y).expect("one side has the key"),
        })
    }

    pub(crate) fn form_sub(&mut self, a: &Form, b: &Form) -> Form {
        self.merge(a, b, |s, x, y| match (x, y) {
            (Some(x), Some(y)) => s.sub(x, y),
            (Some(x), None) => x,
            (None, y) => s.neg(y.expect("one side has the key")),
        })
    }

    pub(crate) fn form_map(&mut self, a: &Form, mut f: impl FnMut(&mut Self, Val) -> Val) -> Form {
        let mut out = Vec::with_capacity(a.len());
        for (key, v) in a {
            let v = f(self, *v);
            if self.constant_value(v) != Some(0.0) {
                out.push((*key, v));
            }
        }
        out
    }

    pub(crate) fn form_mul(&mut self, a: &Form, b: &Form) -> Form {
        let mut out: Form = Vec::with_capacity(a.len() * b.len());
        for (ka, x) in a {
            for (kb, y) in b {
                let v = self.mul(*x, *y);
                if self.constant_value(v) != Some(0.0) {
                    out.push((pair(*ka, *kb), v));
                }
            }
        }
        out.sort_by_key(|(k, _)| *k);
        out
    }

    pub(crate) fn form_select(&mut self, mask: Val, a: &Form, b: &Form) -> Form {
        let zero = self.constant(0.0);
        self.merge(a, b, |s, x, y| s.select(mask, x.unwrap_or(zero), y.unwrap_or(zero)))
    }
}

fn pair(a: Key, b: Key) -> Key {
    let one = |x: u16, y: u16| {
        assert!(x == NO_SLOT || y == NO_SLOT, "one test and one trial function: checked by the builder");
        x.min(y)
    };
    (one(a.0, b.0), one(a.1, b.1))
}
