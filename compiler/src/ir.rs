//! The instructions of a point law: straight-line scalar code run at every integration point.
//!
//! A [`Kernel`] reads point inputs (traces and gradients of fields, position, normal, ...) and uniforms (numbers
//! that are the same at all points of a call), and writes outputs (fluxes and their derivatives). It has no loops
//! and no memory: the backend runs it lane by lane over blocks of [`LANES`] points.
//!
//! Buffers are blocked structures of arrays: slot `s` of lane `l` of block `b` stands at
//! `(b * n_slots + s) * LANES + l`, for inputs and outputs alike.
//!
//! Numbers are IEEE f64 without contraction: no backend may fuse, reorder or approximate, so that every backend
//! gives the same bits as the interpreter.

use std::fmt::Write as _;

use wfl::{Span, ast::ExpansionId};

pub use crate::compare::Compare;
use crate::{
    lookup::{CurveRef, Reading},
    math::{MathFn1, MathFn2, MatrixFn},
};

/// Points per block: the lanes of one AVX-512 register.
pub const LANES: usize = 8;

wfl::define_index! {
    /// The result of one instruction of a kernel.
    Val,
}

/// One instruction. Numbers and masks (results of comparisons) are distinct types; `verify.rs` checks them.
#[derive(Clone, Debug, PartialEq)]
pub enum Inst {
    /// A number.
    Const(f64),
    /// Point input slot.
    Input(u32),
    /// Uniform slot.
    Uniform(u32),
    /// `a + b`
    Add(Val, Val),
    /// `a - b`
    Sub(Val, Val),
    /// `a * b`
    Mul(Val, Val),
    /// `a / b`
    Div(Val, Val),
    /// `-a`
    Neg(Val),
    /// `|a|`
    Abs(Val),
    /// Square root, correctly rounded.
    Sqrt(Val),
    /// Mask: comparison of two numbers.
    Compare(Compare, Val, Val),
    /// Mask: both.
    And(Val, Val),
    /// Mask: either.
    Or(Val, Val),
    /// Mask: not.
    Not(Val),
    /// `mask ? a : b`; the untaken operand may be anything, NaN included.
    Select(Val, Val, Val),
    /// One-argument function.
    Call1(MathFn1, Val),
    /// A column of a table at a number.
    Lookup(CurveRef, Reading, Val),
    /// Two-argument function.
    Call2(MathFn2, Val, Val),
    /// A function of an n by n matrix (column by column); its results are read by `Part`. Type: bundle.
    Matrix {
        /// Which function.
        function: MatrixFn,
        /// Rows of the matrix, 1 to 3.
        n: u8,
        /// `n * n` entries, column by column.
        entries: Box<[Val]>,
    },
    /// Result number `.1` of a `Matrix` instruction.
    Part(Val, u32),
}

impl Inst {
    /// Calls `f` on every operand.
    pub fn for_each_operand(&self, mut f: impl FnMut(Val)) {
        match self {
            Inst::Const(_) | Inst::Input(_) | Inst::Uniform(_) => {}
            Inst::Add(a, b) | Inst::Sub(a, b) | Inst::Mul(a, b) | Inst::Div(a, b) => {
                f(*a);
                f(*b);
            }
            Inst::Compare(_, a, b) | Inst::And(a, b) | Inst::Or(a, b) | Inst::Call2(_, a, b) => {
                f(*a);
                f(*b);
            }
            Inst::Neg(a) | Inst::Abs(a) | Inst::Sqrt(a) | Inst::Not(a) | Inst::Call1(_, a) | Inst::Part(a, _) => f(*a),
            Inst::Lookup(.., a) => f(*a),
            Inst::Select(m, a, b) => {
                f(*m);
                f(*a);
                f(*b);
            }
            Inst::Matrix { entries, .. } => entries.iter().copied().for_each(f),
        }
    }
}

/// Where an instruction comes from in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Origin {
    /// The expression.
    pub span: Span,
    /// The macro use that brought it there.
    pub expansion: Option<ExpansionId>,
}

/// A point law before verification.
#[derive(Clone, Debug)]
pub struct Kernel {
    /// A name for listings.
    pub name: String,
    /// Point inputs per lane.
    pub n_inputs: usize,
    /// Uniform inputs.
    pub n_uniforms: usize,
    /// The instructions; operands come before their uses.
    pub insts: Vec<Inst>,
    /// One origin per instruction, `None` where a rewrite made it.
    pub origins: Vec<Option<Origin>>,
    /// What is written to each output slot.
    pub outputs: Vec<Val>,
}

impl Kernel {
    /// The text form: one instruction a line, `%3 = mul %1 %2`.
    #[must_use]
    pub fn text(&self) -> String {
        let mut out = format!("kernel {} inputs {} uniforms {}\n", self.name, self.n_inputs, self.n_uniforms);
        for (i, inst) in self.insts.iter().enumerate() {
            let _ = writeln!(out, "  %{i} = {}", inst_text(inst));
        }
        for (slot, v) in self.outputs.iter().enumerate() {
            let _ = writeln!(out, "  output {slot} = %{}", v.index());
        }
        out
    }
}

fn inst_text(inst: &Inst) -> String {
    let two = |name: &str, a: &Val, b: &Val| format!("{name} %{} %{}", a.index(), b.index());
    let one = |name: &str, a: &Val| format!("{name} %{}", a.index());
    match inst {
        Inst::Const(c) => format!("const {c:?}"),
        Inst::Input(s) => format!("input {s}"),
        Inst::Uniform(s) => format!("uniform {s}"),
        Inst::Add(a, b) => two("add", a, b),
        Inst::Sub(a, b) => two("sub", a, b),
        Inst::Mul(a, b) => two("mul", a, b),
        Inst::Div(a, b) => two("div", a, b),
        Inst::Neg(a) => one("neg", a),
        Inst::Abs(a) => one("abs", a),
        Inst::Sqrt(a) => one("sqrt", a),
        Inst::Compare(Compare::Less, a, b) => two("lt", a, b),
        Inst::Compare(Compare::LessEqual, a, b) => two("le", a, b),
        Inst::Compare(Compare::Equal, a, b) => two("eq", a, b),
        Inst::Compare(Compare::NotEqual, a, b) => two("ne", a, b),
        Inst::And(a, b) => two("and", a, b),
        Inst::Or(a, b) => two("or", a, b),
        Inst::Not(a) => one("not", a),
        Inst::Select(m, a, b) => format!("select %{} %{} %{}", m.index(), a.index(), b.index()),
        Inst::Call1(f, a) => one(f.name(), a),
        Inst::Lookup(curve, reading, a) => format!("{} {} %{}", reading.name(), curve.name, a.index()),
        Inst::Call2(f, a, b) => two(f.name(), a, b),
        Inst::Matrix { function, n, entries } => {
            let list: Vec<String> = entries.iter().map(|v| format!("%{}", v.index())).collect();
            format!("{}{n} {}", function.name(), list.join(" "))
        }
        Inst::Part(a, k) => format!("part %{} {k}", a.index()),
    }
}

/// A kernel that `verify.rs` has accepted. Only verified kernels can be executed.
#[derive(Clone, Debug)]
pub struct VerifiedKernel(pub(crate) Kernel);

impl VerifiedKernel {
    /// The kernel.
    #[must_use]
    pub fn kernel(&self) -> &Kernel {
        &self.0
    }
}
