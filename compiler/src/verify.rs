//! The verifier: the only maker of [`VerifiedKernel`], hence the only gate to execution.
//!
//! A kernel is accepted when
//! 1. it has one origin slot for each instruction;
//! 2. every operand comes before its use;
//! 3. operands have the type that the instruction asks for: numbers, masks (`and`, `or`, `not`, the condition of
//!    `select`) or bundles (`part`); an instruction has one type itself;
//! 4. input and uniform slots lie below the declared numbers of slots;
//! 5. a matrix function has `n` from 1 to 3 and `n * n` entries;
//! 6. a part lies below the number of results of its matrix function;
//! 7. outputs are existing numbers;
//! 8. block offsets of all slots fit 31 bits of bytes (machine code carries them as constants).
//!
//! It looks at structure only: values may become infinite or NaN.

use thiserror::Error;

use crate::{
    ir::{Inst, Kernel, LANES, Val, VerifiedKernel},
    math::MatrixFn,
};

/// What an instruction gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueType {
    /// An f64.
    Number,
    /// Result of a comparison.
    Mask,
    /// Results of a matrix function, to be read by parts.
    Bundle,
}

impl std::fmt::Display for ValueType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            ValueType::Number => "number",
            ValueType::Mask => "mask",
            ValueType::Bundle => "bundle",
        })
    }
}

/// Which kind of slot is out of range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotKind {
    /// Point input.
    Input,
    /// Uniform.
    Uniform,
    /// Output.
    Output,
}

impl std::fmt::Display for SlotKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            SlotKind::Input => "input",
            SlotKind::Uniform => "uniform",
            SlotKind::Output => "output",
        })
    }
}

/// Why a kernel was refused: always a bug of the code that made it. `inst` is the position of the instruction.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum VerifyError {
    /// Rule 1.
    #[error("{origins} origins for {insts} instructions")]
    OriginCount {
        /// Number of instructions.
        insts: usize,
        /// Number of origin slots.
        origins: usize,
    },
    /// Rule 2.
    #[error("instruction %{inst} uses %{operand}, which does not come before it")]
    UseBeforeDefinition {
        /// The user.
        inst: usize,
        /// What it uses.
        operand: usize,
    },
    /// Rule 3.
    #[error("instruction %{inst} needs a {needed}, but %{operand} is a {found}")]
    OperandType {
        /// The user.
        inst: usize,
        /// What it uses.
        operand: usize,
        /// The type asked for.
        needed: ValueType,
        /// The type of the operand.
        found: ValueType,
    },
    /// Rule 4.
    #[error("instruction %{inst} reads {kind} slot {slot} of {count}")]
    SlotOutOfRange {
        /// The reader.
        inst: usize,
        /// Input or uniform.
        kind: SlotKind,
        /// The slot.
        slot: usize,
        /// The declared number of slots.
        count: usize,
    },
    /// Rule 5, rows.
    #[error("matrix function %{inst} has {n} rows, 1 to 3 are possible")]
    MatrixSize {
        /// The instruction.
        inst: usize,
        /// Its rows.
        n: usize,
    },
    /// Rule 5, entries.
    #[error("matrix function %{inst} of {n} rows has {found} entries")]
    MatrixEntries {
        /// The instruction.
        inst: usize,
        /// Its rows.
        n: usize,
        /// Its entries.
        found: usize,
    },
    /// Rule 6.
    #[error("instruction %{inst} reads result {part} of {n_results}")]
    PartOutOfRange {
        /// The reader.
        inst: usize,
        /// The result asked for.
        part: usize,
        /// The number of results.
        n_results: usize,
    },
    /// Rule 7, existence.
    #[error("output {slot} reads %{value}, which does not exist")]
    OutputUndefined {
        /// The output slot.
        slot: usize,
        /// What it reads.
        value: usize,
    },
    /// Rule 7, type.
    #[error("output {slot} reads %{value}, which is a {found}, not a number")]
    OutputType {
        /// The output slot.
        slot: usize,
        /// What it reads.
        value: usize,
        /// Its type.
        found: ValueType,
    },
    /// Rule 8.
    #[error("{count} {kind} slots are more than a block can hold")]
    TooManySlots {
        /// Which slots.
        kind: SlotKind,
        /// How many.
        count: usize,
    },
}

/// Most slots of one kind: their offsets in a block of lanes, in bytes, stay below 2^31.
const MAX_SLOTS: usize = (1 << 31) / (LANES * size_of::<f64>());

/// Checks a kernel against the rules at the top of `verify.rs`.
///
/// # Errors
/// The first broken rule in the order of instructions.
pub fn verify(kernel: Kernel) -> Result<VerifiedKernel, VerifyError> {
    for (kind, count) in [
        (SlotKind::Input, kernel.n_inputs),
        (SlotKind::Uniform, kernel.n_uniforms),
        (SlotKind::Output, kernel.outputs.len()),
    ] {
        if count > MAX_SLOTS {
            return Err(VerifyError::TooManySlots { kind, count });
        }
    }
    if kernel.origins.len() != kernel.insts.len() {
        return Err(VerifyError::OriginCount { insts: kernel.insts.len(), origins: kernel.origins.len() });
    }
    let mut types = Vec::with_capacity(kernel.insts.len());
    for inst in &kernel.insts {
        let found = Check { kernel: &kernel, types: &types }.inst(inst)?;
        types.push(found);
    }
    for (slot, v) in kernel.outputs.iter().enumerate() {
        let value = v.index();
        match types.get(value) {
            None => return Err(VerifyError::OutputUndefined { slot, value }),
            Some(ValueType::Number) => {}
            Some(&found) => return Err(VerifyError::OutputType { slot, value, found }),
        }
    }
    Ok(VerifiedKernel(kernel))
}

/// The state at one instruction: the types of all instructions before it.
struct Check<'a> {
    kernel: &'a Kernel,
    types: &'a [ValueType],
}

impl Check<'_> {
    fn inst(&self, inst: &Inst) -> Result<ValueType, VerifyError> {
        use ValueType::{Bundle, Mask, Number};
        match inst {
            Inst::Const(_) => Ok(Number),
            Inst::Input(slot) => self.slot(SlotKind::Input, *slot, self.kernel.n_inputs),
            Inst::Uniform(slot) => self.slot(SlotKind::Uniform, *slot, self.kernel.n_uniforms),
            Inst::Add(a, b) | Inst::Sub(a, b) | Inst::Mul(a, b) | Inst::Div(a, b) | Inst::Call2(_, a, b) => {
                self.operands(&[(*a, Number), (*b, Number)], Number)
            }
            Inst::Neg(a) | Inst::Abs(a) | Inst::Sqrt(a) | Inst::Call1(_, a) => self.operands(&[(*a, Number)], Number),
            Inst::Lookup(.., a) => self.operands(&[(*a, Number)], Number),
            Inst::Compare(_, a, b) => self.operands(&[(*a, Number), (*b, Number)], Mask),
            Inst::And(a, b) | Inst::Or(a, b) => self.operands(&[(*a, Mask), (*b, Mask)], Mask),
            Inst::Not(a) => self.operands(&[(*a, Mask)], Mask),
            Inst::Select(m, a, b) => self.operands(&[(*m, Mask), (*a, Number), (*b, Number)], Number),
            Inst::Matrix { n, entries, .. } => {
                let (at, n) = (self.types.len(), usize::from(*n));
                if !(1..=3).contains(&n) {
                    return Err(VerifyError::MatrixSize { inst: at, n });
                }
                if entries.len() != n * n {
                    return Err(VerifyError::MatrixEntries { inst: at, n, found: entries.len() });
                }
                entries.iter().try_for_each(|v| self.operand(*v, Number))?;
                Ok(Bundle)
            }
            Inst::Part(a, part) => self.part(*a, *part),
        }
    }

    fn slot(&self, kind: SlotKind, slot: u32, count: usize) -> Result<ValueType, VerifyError> {
        let slot = slot as usize;
        if slot < count {
            Ok(ValueType::Number)
        } else {
            Err(VerifyError::SlotOutOfRange { inst: self.types.len(), kind, slot, count })
        }
    }

    fn operands(&self, list: &[(Val, ValueType)], result: ValueType) -> Result<ValueType, VerifyError> {
        list.iter().try_for_each(|(v, needed)| self.operand(*v, *needed))?;
        Ok(result)
    }

    fn operand(&self, v: Val, needed: ValueType) -> Result<(), VerifyError> {
        let (inst, operand) = (self.types.len(), v.index());
        match self.types.get(operand) {
            None => Err(VerifyError::UseBeforeDefinition { inst, operand }),
            Some(&found) if found != needed => Err(VerifyError::OperandType { inst, operand, needed, found }),
            Some(_) => Ok(()),
        }
    }

    fn part(&self, bundle: Val, part: u32) -> Result<ValueType, VerifyError> {
        self.operand(bundle, ValueType::Bundle)?;
        let n_results = match &self.kernel.insts[bundle.index()] {
            Inst::Matrix { function, n, .. } => MatrixFn::n_results(*function, usize::from(*n)),
            _ => 0,
        };
        let part = part as usize;
        if part < n_results {
            Ok(ValueType::Number)
        } else {
            Err(VerifyError::PartOutOfRange { inst: self.types.len(), part, n_results })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ir::Compare;

    fn check(insts: Vec<Inst>, outputs: &[usize]) -> Result<VerifiedKernel, VerifyError> {
        verify(Kernel {
            name: "t".into(),
            n_inputs: 2,
            n_uniforms: 1,
            origins: vec![None; insts.len()],
            insts,
            outputs: outputs.iter().map(|i| Val::new(*i)).collect(),
        })
    }

    fn v(i: usize) -> Val {
        Val::new(i)
    }

    fn expm(n: u8, entries: &[usize]) -> Inst {
        Inst::Matrix { function: MatrixFn::Expm, n, entries: entries.iter().map(|i| v(*i)).collect() }
    }

    #[test]
    fn a_kernel_with_every_type_is_accepted() {
        let insts = vec![
            Inst::Input(1),
            Inst::Uniform(0),
            Inst::Compare(Compare::Less, v(0), v(1)),
            Inst::Not(v(2)),
            Inst::And(v(2), v(3)),
            Inst::Select(v(4), v(0), v(1)),
            expm(2, &[0, 1, 5, 0]),
            Inst::Part(v(6), 3),
        ];
        assert!(check(insts, &[7, 0]).is_ok());
    }

    #[test]
    fn order_and_counts() {
        assert_eq!(
            check(vec![Inst::Input(0), Inst::Add(v(0), v(1))], &[]).unwrap_err(),
            VerifyError::UseBeforeDefinition { inst: 1, operand: 1 }
        );
        let kernel = Kernel {
            name: "t".into(),
            n_inputs: 1,
            n_uniforms: 0,
            insts: vec![Inst::Input(0)],
            origins: vec![],
            outputs: vec![],
        };
        assert_eq!(verify(kernel.clone()).unwrap_err(), VerifyError::OriginCount { insts: 1, origins: 0 });
        let wide = Kernel { origins: vec![None], n_inputs: MAX_SLOTS + 1, ..kernel };
        assert!(matches!(verify(wide).unwrap_err(), VerifyError::TooManySlots { kind: SlotKind::Input, .. }));
    }

    #[test]
    fn types() {
        use ValueType::{Bundle, Mask, Number};
        let base = vec![Inst::Input(0), Inst::Compare(Compare::Equal, v(0), v(0)), expm(1, &[0])];
        let cases = [
            (Inst::Add(v(0), v(1)), 1, Number, Mask),
            (Inst::Sqrt(v(2)), 2, Number, Bundle),
            (Inst::Compare(Compare::Less, v(1), v(0)), 1, Number, Mask),
            (Inst::And(v(1), v(0)), 0, Mask, Number),
            (Inst::Not(v(2)), 2, Mask, Bundle),
            (Inst::Select(v(0), v(0), v(0)), 0, Mask, Number),
            (Inst::Select(v(1), v(0), v(2)), 2, Number, Bundle),
            (Inst::Part(v(0), 0), 0, Bundle, Number),
            (expm(1, &[1]), 1, Number, Mask),
        ];
        for (bad, operand, needed, found) in cases {
            let mut insts = base.clone();
            insts.push(bad);
            let expected = VerifyError::OperandType { inst: 3, operand, needed, found };
            assert_eq!(check(insts, &[0]).unwrap_err(), expected);
        }
    }

    #[test]
    fn ranges() {
        let slot = |kind, slot, count| VerifyError::SlotOutOfRange { inst: 0, kind, slot, count };
        assert_eq!(check(vec![Inst::Input(2)], &[]).unwrap_err(), slot(SlotKind::Input, 2, 2));
        assert_eq!(check(vec![Inst::Uniform(1)], &[]).unwrap_err(), slot(SlotKind::Uniform, 1, 1));
        let x = || Inst::Input(0);
        assert_eq!(check(vec![x(), expm(0, &[])], &[]).unwrap_err(), VerifyError::MatrixSize { inst: 1, n: 0 });
        assert_eq!(check(vec![x(), expm(4, &[0; 16])], &[]).unwrap_err(), VerifyError::MatrixSize { inst: 1, n: 4 });
        assert_eq!(
            check(vec![x(), expm(2, &[0; 3])], &[]).unwrap_err(),
            VerifyError::MatrixEntries { inst: 1, n: 2, found: 3 }
        );
        assert_eq!(
            check(vec![x(), expm(2, &[0; 4]), Inst::Part(v(1), 4)], &[]).unwrap_err(),
            VerifyError::PartOutOfRange { inst: 2, part: 4, n_results: 4 }
        );
        assert_eq!(check(vec![x()], &[1]).unwrap_err(), VerifyError::OutputUndefined { slot: 0, value: 1 });
        let mask = Inst::Compare(Compare::Less, v(0), v(0));
        assert_eq!(
            check(vec![x(), mask], &[0, 1]).unwrap_err(),
            VerifyError::OutputType { slot: 1, value: 1, found: ValueType::Mask }
        );
    }
}
