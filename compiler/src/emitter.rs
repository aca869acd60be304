//! From the scalars of a term to its kernels: what all points share moves to a prologue that runs once a step.
//!
//! Promises: the kernels obey the rules of `verify`, and compute the same numbers as the scalars they come from. Does
//! not decide which scalars are outputs.

use std::collections::BTreeMap;

use crate::{
    ir::{Inst, Kernel, Val, VerifiedKernel},
    law::Prologue,
    scalar::Scalars,
    types::UniformSlot,
    verify::verify,
};

/// Turns scalars into kernels; what no point input enters becomes a uniform, computed by the prologue.
pub(crate) struct Emitter<'s> {
    scalars: &'s Scalars,
    n_inputs: usize,
    uniforms: BTreeMap<Val, u32>,
    pub(crate) order: Vec<Val>,
}

impl<'s> Emitter<'s> {
    pub(crate) fn new(scalars: &'s Scalars, n_inputs: usize) -> Self {
        Self { scalars, n_inputs, uniforms: BTreeMap::new(), order: Vec::new() }
    }

    fn hoisted(&self, v: Val) -> bool {
        let inst = &self.scalars.insts[v.index()];
        let number = !matches!(
            inst,
            Inst::Const(_) | Inst::Compare(..) | Inst::And(..) | Inst::Or(..) | Inst::Not(_) | Inst::Matrix { .. }
        );
        self.scalars.uniform[v.index()] && number
    }

    pub(crate) fn kernel(&mut self, name: &str, outputs: &[Val]) -> Kernel {
        let mut needed = vec![false; self.scalars.insts.len()];
        for v in outputs {
            needed[v.index()] = true;
        }
        for k in (0..needed.len()).rev() {
            if needed[k] && !self.hoisted(Val::new(k)) {
                self.scalars.insts[k].for_each_operand(|v| needed[v.index()] = true);
            }
        }
        let mut place = vec![None; needed.len()];
        let (mut insts, mut origins) = (Vec::new(), Vec::new());
        for k in 0..needed.len() {
            if !needed[k] {
                continue;
            }
            let v = Val::new(k);
            let inst = if self.hoisted(v) {
                let next = u32::try_from(self.uniforms.len()).expect("few uniforms");
                let id = *self.uniforms.entry(v).or_insert(next);
                if id == next {
                    self.order.push(v);
                }
                Inst::Uniform(id)
            } else {
                renamed(&self.scalars.insts[k], &place)
            };
            place[k] = Some(Val::new(insts.len()));
            insts.push(inst);
            origins.push(self.scalars.origins[k]);
        }
        let outputs = outputs.iter().map(|v| place[v.index()].expect("outputs are needed")).collect();
        Kernel { name: name.to_owned(), n_inputs: self.n_inputs, n_uniforms: 0, insts, origins, outputs }
    }

    pub(crate) fn prologue(&self, slots: Vec<UniformSlot>, name: &str) -> Prologue {
        let mut needed = vec![false; self.scalars.insts.len()];
        for v in &self.order {
            needed[v.index()] = true;
        }
        for k in (0..needed.len()).rev() {
            if needed[k] {
                self.scalars.insts[k].for_each_operand(|v| needed[v.index()] = true);
            }
        }
        let mut place = vec![None; needed.len()];
        let (mut insts, mut origins) = (Vec::new(), Vec::new());
        for k in (0..needed.len()).filter(|k| needed[*k]) {
            place[k] = Some(Val::new(insts.len()));
            insts.push(renamed(&self.scalars.insts[k], &place));
            origins.push(self.scalars.origins[k]);
        }
        let outputs = self.order.iter().map(|v| place[v.index()].expect("outputs are needed")).collect();
        let kernel =
            Kernel { name: format!("{name}.step"), n_inputs: 0, n_uniforms: slots.len(), insts, origins, outputs };
        Prologue { slots, kernel: accepted(kernel) }
    }

    pub(crate) fn finish(
        self,
        mut residual: Kernel,
        mut tangent: Kernel,
        mut others: [Option<Kernel>; 2],
        slots: Vec<UniformSlot>,
        name: &str,
    ) -> (VerifiedKernel, VerifiedKernel, [Option<VerifiedKernel>; 2], Prologue) {
        let n = self.order.len();
        for kernel in [&mut residual, &mut tangent].into_iter().chain(others.iter_mut().flatten()) {
            kernel.n_uniforms = n;
        }
        let prologue = self.prologue(slots, name);
        (accepted(residual), accepted(tangent), others.map(|kernel| kernel.map(accepted)), prologue)
    }
}

pub(crate) fn accepted(kernel: Kernel) -> VerifiedKernel {
    verify(kernel).expect("lowering makes kernels that obey the rules of verify.rs")
}

fn renamed(inst: &Inst, place: &[Option<Val>]) -> Inst {
    let p = |v: &Val| place[v.index()].expect("operands come first");
    match inst {
        Inst::Const(_) | Inst::Input(_) | Inst::Uniform(_) => inst.clone(),
        Inst::Add(a, b) => Inst::Add(p(a), p(b)),
        Inst::Sub(a, b) => Inst::Sub(p(a), p(b)),
        Inst::Mul(a, b) => Inst::Mul(p(a), p(b)),
        Inst::Div(a, b) => Inst::Div(p(a), p(b)),
        Inst::Neg(a) => Inst::Neg(p(a)),
        Inst::Abs(a) => Inst::Abs(p(a)),
        Inst::Sqrt(a) => Inst::Sqrt(p(a)),
        Inst::Compare(c, a, b) => Inst::Compare(*c, p(a), p(b)),
        Inst::And(a, b) => Inst::And(p(a), p(b)),
        Inst::Or(a, b) => Inst::Or(p(a), p(b)),
        Inst::Not(a) => Inst::Not(p(a)),
        Inst::Select(m, a, b) => Inst::Select(p(m), p(a), p(b)),
        Inst::Call1(f, a) => Inst::Call1(*f, p(a)),
        Inst::Lookup(curve, reading, a) => Inst::Lookup(curve.clone(), *reading, p(a)),
        Inst::Call2(f, a, b) => Inst::Call2(*f, p(a), p(b)),
        Inst::Matrix { function, n, entries } => {
            Inst::Matrix { function: *function, n: *n, entries: entries.iter().map(p).collect() }
        }
        Inst::Part(a, k) => Inst::Part(p(a), *k),
    }
}
