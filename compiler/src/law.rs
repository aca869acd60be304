//! What compiling gives: point laws with their kernels, and what is known of them.
//!
//! Data only. `term.rs` makes laws from texts, `frozen.rs` from laws; the runtime binds them to meshes.

use crate::{
    degree::Degree,
    graph::{ExprId, Graph},
    interp::interpret,
    ir::{Origin, VerifiedKernel},
    types::{BasisSlot, FieldId, InputSlot, RateOrder, Shape, UniformSlot},
};

/// How a term depends on the unknowns; each class has its own treatment in assembly and solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// No unknown in it: a load.
    Constant,
    /// Affine in the unknowns: its tangent never changes with them.
    Linear,
    /// Neither, and smooth.
    Nonlinear,
    /// Neither, with kinks.
    Kinked,
}

impl Class {
    /// The word in listings.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Class::Constant => "constant",
            Class::Linear => "linear",
            Class::Nonlinear => "nonlinear",
            Class::Kinked => "nonlinear with kinks",
        }
    }
}

/// What kind of kink a branch code belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KinkKind {
    /// A selection: code 1 when the condition holds, else 0 (`pos_part`: 1 in contact).
    Select,
    /// A projection on a ball: 0 open, 1 slip, 2 stick.
    Ball,
}

/// A kink that moves with the unknowns; its branch code is an output of the law.
#[derive(Clone, Debug)]
pub struct Kink {
    /// Which table of codes.
    pub kind: KinkKind,
    /// The code on which a selection that is a multiple of a positive part is no zero: 1 for `pos_part(x)`, 0 for `max(0, x)`, which
    /// selects its zero. `None` for other selections and for balls.
    pub active: Option<u8>,
    /// Where it was written.
    pub origin: Option<Origin>,
}

/// Numbers that are the same at all points, computed once per step.
#[derive(Clone, Debug)]
pub struct Prologue {
    /// What its uniforms are.
    pub slots: Vec<UniformSlot>,
    /// Its outputs are the uniforms of the point kernels.
    pub kernel: VerifiedKernel,
}

/// A compiled term.
#[derive(Clone, Debug)]
pub struct TermLaw {
    /// The name in listings.
    pub name: String,
    /// How it depends on the unknowns.
    pub class: Class,
    /// The tangent is symmetric under exchange of test and trial function.
    pub symmetric: bool,
    /// The tangent reads numbers that are the same at all points, such as the step variable and its increment.
    pub tangent_has_uniforms: bool,
    /// The tangent reads data, states or the previous step.
    pub tangent_reads_known: bool,
    /// Degree estimate for the quadrature.
    pub degree: Degree,
    /// What the kernels read at a point, by input slot.
    pub inputs: Vec<InputSlot>,
    /// Numbers computed once per step.
    pub prologue: Prologue,
    /// Test slots; one flux each.
    pub tests: Vec<BasisSlot>,
    /// Trial slots.
    pub trials: Vec<BasisSlot>,
    /// Nonzero pairs of test and trial slot (positions in `tests` and `trials`), sorted.
    pub entries: Vec<(u16, u16)>,
    /// Kinks that move with the unknowns.
    pub kinks: Vec<Kink>,
    /// Outputs: fluxes, then branch codes.
    pub residual: VerifiedKernel,
    /// Outputs: fluxes, entries, branch codes.
    pub tangent: VerifiedKernel,
    /// The density of an `energy` (one output).
    pub energy: Option<VerifiedKernel>,
    /// Outputs: by test slot the size of what cancels in its flux, for the equations of scalars and of global fields; zero
    /// for others. `None` without such equations and for affine terms.
    pub summands: Option<VerifiedKernel>,
    /// The typed graph and its roots, for listings.
    pub listing: Listing,
}

impl TermLaw {
    /// Whether it reads rates of this order.
    #[must_use]
    pub fn reads_rates(&self, order: RateOrder) -> bool {
        self.inputs.iter().any(|slot| matches!(slot, InputSlot::History(of, _) if *of == order))
    }
}

/// The graph behind a law.
#[derive(Clone, Debug)]
pub struct Listing {
    /// All nodes.
    pub graph: Graph,
    /// The potential of an `energy`.
    pub energy: Option<ExprId>,
    /// The residual; `None` for a bare tangent (GWFL order 2).
    pub residual: Option<ExprId>,
    /// The tangent.
    pub tangent: ExprId,
}

/// A difference of values on the two sides of a face that is zero where fields have the same unknowns on both sides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValueJump {
    /// The fields that must have the same unknowns on both sides for it to be zero, sorted.
    pub fields: Vec<FieldId>,
    /// Where it is written.
    pub origin: Option<Origin>,
}

/// A compiled expression without test functions.
#[derive(Clone, Debug)]
pub struct ValueLaw {
    /// Its shape.
    pub shape: Shape,
    /// What the kernel reads at a point.
    pub inputs: Vec<InputSlot>,
    /// Numbers computed once per step.
    pub prologue: Prologue,
    /// One output per entry, first index fastest.
    pub kernel: VerifiedKernel,
    /// Degree estimate.
    pub degree: Degree,
    /// It changes with the step variable or the past.
    pub changes_with_step: bool,
    /// The mapping it reads through.
    pub mapping: Option<usize>,
    /// Differences of values of the same field on both sides.
    pub jumps: Vec<ValueJump>,
}

/// The uniforms of a law for these values of its prologue's slots.
#[must_use]
pub fn run_prologue(prologue: &Prologue, values: &[f64]) -> Vec<f64> {
    let kernel = prologue.kernel.kernel();
    let mut out = vec![0.0; kernel.outputs.len()];
    interpret(&prologue.kernel, values, &[], &mut Vec::new(), &mut out);
    out
}
