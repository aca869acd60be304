//! The distinct entries of a tangent law: those that the assembly kernel computes, and those that are known without it.
//!
//! Of a symmetric law one triangle is computed. Equal entries are stored once. Entries that are the same at all points
//! (constants, numbers of the step) need no kernel.

use std::collections::BTreeMap;

use wfl_compiler::{
    TermLaw,
    ir::{Inst, Kernel, Val, VerifiedKernel},
    types::BasisSlot,
    verify,
};

/// Where the value of an entry comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Coefficient {
    /// A number.
    Constant(f64),
    /// A number of the step.
    Uniform(usize),
    /// An output of the kernel.
    Output(usize),
}

/// The entries of a law.
#[derive(Clone, Debug)]
pub(super) struct Entries {
    /// Values, each once.
    pub(super) coefficients: Vec<Coefficient>,
    /// `(test slot, trial slot, coefficient)`, in the order of the law.
    pub(super) list: Vec<(usize, usize, usize)>,
    /// The value of (test, trial) is that of (trial, test) for every pair.
    pub(super) symmetric: bool,
    /// Number of outputs of the kernel.
    pub(super) n_outputs: usize,
    pub(super) outputs: Vec<Val>,
}

impl Entries {
    pub(super) fn new(law: &TermLaw) -> Self {
        let pairs: Vec<(BasisSlot, BasisSlot)> =
            law.entries.iter().map(|(t, s)| (law.tests[usize::from(*t)], law.trials[usize::from(*s)])).collect();
        let at: BTreeMap<(BasisSlot, BasisSlot), usize> = pairs.iter().enumerate().map(|(k, p)| (*p, k)).collect();
        let symmetric = law.symmetric && pairs.iter().all(|(t, s)| at.contains_key(&(*s, *t)));
        let kernel = law.tangent.kernel();
        let first = law.tests.len();
        let mut known: BTreeMap<usize, usize> = BTreeMap::new();
        let (mut coefficients, mut outputs, mut list) = (Vec::new(), Vec::new(), Vec::new());
        for (k, (t, s)) in pairs.iter().enumerate() {
            let source = if symmetric && s < t { at[&(*s, *t)] } else { k };
            let value = kernel.outputs[first + source];
            let coefficient = *known.entry(value.index()).or_insert_with(|| {
                coefficients.push(match &kernel.insts[value.index()] {
                    Inst::Const(c) => Coefficient::Constant(*c),
                    Inst::Uniform(u) => Coefficient::Uniform(*u as usize),
                    _ => {
                        outputs.push(value);
                        Coefficient::Output(outputs.len() - 1)
                    }
                });
                coefficients.len() - 1
            });
            let (test, trial) = law.entries[k];
            list.push((usize::from(test), usize::from(trial), coefficient));
        }
        Self { coefficients, list, symmetric, n_outputs: outputs.len(), outputs }
    }

    /// Which inputs the kernel reads.
    pub(super) fn reads(&self, law: &TermLaw) -> Vec<bool> {
        inputs_behind(law.tangent.kernel(), &self.outputs)
    }
}

/// Which inputs the values of a kernel depend on.
pub(super) fn inputs_behind(kernel: &Kernel, values: &[Val]) -> Vec<bool> {
    let mut needed = vec![false; kernel.insts.len()];
    values.iter().for_each(|v| needed[v.index()] = true);
    let mut reads = vec![false; kernel.n_inputs];
    for at in (0..kernel.insts.len()).rev() {
        if !needed[at] {
            continue;
        }
        if let Inst::Input(slot) = &kernel.insts[at] {
            reads[*slot as usize] = true;
        }
        kernel.insts[at].for_each_operand(|v| needed[v.index()] = true);
    }
    reads
}

/// The kernel that [`crate::assemble::AssembledTerm`] runs for the tangent of a law: the entries that change from point
/// to point, each once. `None` if there are none.
#[must_use]
pub fn tangent_kernel(law: &TermLaw) -> Option<VerifiedKernel> {
    let entries = Entries::new(law);
    if entries.outputs.is_empty() {
        return None;
    }
    let kernel = Kernel { outputs: entries.outputs, ..law.tangent.kernel().clone() };
    Some(verify(kernel).expect("a part of a verified kernel is one"))
}
