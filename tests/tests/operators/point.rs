//! Point laws of single expressions: compiled from text, run at one point, read by name.

use std::collections::BTreeMap;

use wfl::{Diagnostic, Expander, SourceMap, parse_gwfl};
use wfl_compiler::{
    Constant, Env, TermLaw, TermSource,
    backend::KernelBackend,
    compile_term,
    ir::{LANES, VerifiedKernel},
    types::{BasisSlot, FieldKind, FieldOp, FieldSig, InputSlot, PlaceKind, PlaceSig, Shape},
};

/// Scalar fields `p`, `q` and vector fields `u`, `w`, all unknown.
const FIELDS: [&str; 4] = ["p", "q", "u", "w"];

/// What an expression is compiled as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum As {
    Term,
    Energy,
}

/// Compiles `text` in `dim` dimensions on an interface; `A` is a matrix near the identity, `B` a constant one.
pub(crate) fn compile(text: &str, dim: usize, what: As) -> Result<TermLaw, Vec<Diagnostic>> {
    compile_on(text, dim, what, PlaceKind::Interface)
}

pub(crate) fn compile_on(text: &str, dim: usize, what: As, kind: PlaceKind) -> Result<TermLaw, Vec<Diagnostic>> {
    let b = match dim {
        1 => "[[3]]",
        2 => "[[3,-1],[2,5]]",
        _ => "[[3,-1,4],[2,5,-7],[1,6,-2]]",
    };
    let whole = format!("Def A:=Id({dim})+0.3*Grad_u; Def B:={b}; {text}");
    let mut sources = SourceMap::new();
    let id = sources.add("sample", whole);
    let parsed = parse_gwfl(&sources, id);
    let Some((locals, expr)) = parsed.value else { return Err(parsed.diagnostics) };
    let mut expander = Expander::new(&sources, []);
    let Some(expr) = expander.expr_with(&expr, &locals) else { return Err(expander.diagnostics) };
    let field = |name: &str| FieldSig {
        name: name.to_owned(),
        shape: if matches!(name, "u" | "w") { Shape::vector(dim) } else { Shape::SCALAR },
        degree: 2,
        kind: FieldKind::Unknown,
        global: false,
        on_faces: false,
    };
    let fields: Vec<FieldSig> = FIELDS.iter().map(|n| field(n)).collect();
    let params: BTreeMap<String, Constant> = BTreeMap::new();
    let env = Env {
        dim,
        fields: &fields,
        mappings: &[],
        params: &params,
        expansions: &expander.expansions,
        step_variable: Some("t"),
        rates: &[],
        tables: &[],
        equal_within: 0.0,
    };
    let place = PlaceSig {
        name: "place".to_owned(),
        kind,
        here: vec![true; FIELDS.len()],
        there: vec![kind == PlaceKind::Interface; FIELDS.len()],
        entities: Vec::new(),
        description: "a region of the test".to_owned(),
        here_name: None,
        inside: false,
    };
    let source = if what == As::Energy { TermSource::Energy(&expr) } else { TermSource::Residual(&expr) };
    let checked = compile_term(&env, &place, "sample", source);
    checked.value.ok_or(checked.diagnostics)
}

/// The values of the fields at a point, by name; gradients in the order of the language's matrices, column by column.
#[derive(Clone, Debug, Default)]
pub(crate) struct State {
    values: BTreeMap<(usize, u8), Vec<f64>>,
}

fn field(name: &str) -> usize {
    FIELDS.iter().position(|f| *f == name).expect("p, q, u or w")
}

impl State {
    pub(crate) fn value(mut self, name: &str, entries: &[f64]) -> Self {
        self.values.insert((field(name), 0), entries.to_vec());
        self
    }

    pub(crate) fn grad(mut self, name: &str, entries: &[f64]) -> Self {
        self.values.insert((field(name), 1), entries.to_vec());
        self
    }

    fn read(&self, slot: BasisSlot) -> f64 {
        let order = u8::try_from(slot.op.order()).expect("small");
        let stored = self.values.get(&(slot.field.index(), order));
        stored.and_then(|v| v.get(usize::from(slot.entry))).copied().unwrap_or(0.0)
    }

    /// The inputs of a law; positions are 0.5, the normal is the first axis, sizes are 1.
    pub(crate) fn inputs(&self, law: &TermLaw) -> Vec<f64> {
        let input = |slot: &InputSlot| match slot {
            InputSlot::Field(s) => self.read(*s),
            InputSlot::X(_) | InputSlot::ImageX(_) => 0.5,
            InputSlot::Normal(_, k) => f64::from(u8::from(*k == 0)),
            InputSlot::ElementSize(_) => 1.0,
            _ => 0.0,
        };
        law.inputs.iter().map(input).collect()
    }
}

/// Runs a kernel at one point on a backend; the step variable and its increment are 1.
pub(crate) fn run(law: &TermLaw, kernel: &VerifiedKernel, inputs: &[f64], backend: &dyn KernelBackend) -> Vec<f64> {
    let compiled = backend.compile(&[kernel]).expect("kernels compile").swap_remove(0);
    let uniforms = wfl_compiler::run_prologue(&law.prologue, &vec![1.0; law.prologue.slots.len()]);
    let blocked: Vec<f64> = inputs.iter().flat_map(|x| [*x; LANES]).collect();
    let n = kernel.kernel().outputs.len();
    let mut outputs = vec![0.0; n * LANES];
    compiled.run(&uniforms, &blocked, &mut outputs, 1);
    (0..n).map(|k| outputs[k * LANES]).collect()
}

/// What a law gives at a point.
pub(crate) struct Outcome<'l> {
    law: &'l TermLaw,
    outputs: Vec<f64>,
}

impl Outcome<'_> {
    pub(crate) fn at<'l>(law: &'l TermLaw, state: &State, backend: &dyn KernelBackend) -> Outcome<'l> {
        Outcome { law, outputs: run(law, &law.tangent, &state.inputs(law), backend) }
    }

    /// What multiplies component `entry` of `Test_name`.
    pub(crate) fn flux(&self, name: &str, entry: u16) -> f64 {
        let is = |s: &BasisSlot| s.field.index() == field(name) && s.op == FieldOp::Value && s.entry == entry;
        self.law.tests.iter().position(is).map_or(0.0, |k| self.outputs[k])
    }

    /// The derivative of that flux in component `column` of the value of `unknown`.
    pub(crate) fn slope(&self, name: &str, entry: u16, unknown: &str, column: u16) -> f64 {
        self.slope_in(name, entry, unknown, FieldOp::Value, column)
    }

    /// The same in the value or gradient of `unknown`.
    pub(crate) fn slope_in(&self, name: &str, entry: u16, unknown: &str, op: FieldOp, column: u16) -> f64 {
        let row = |s: &BasisSlot| s.field.index() == field(name) && s.op == FieldOp::Value && s.entry == entry;
        let trial = |s: &BasisSlot| s.field.index() == field(unknown) && s.op == op && s.entry == column;
        let matches =
            |(t, s): &(u16, u16)| row(&self.law.tests[usize::from(*t)]) && trial(&self.law.trials[usize::from(*s)]);
        let k = self.law.entries.iter().position(matches);
        k.map_or(0.0, |k| self.outputs[self.law.tests.len() + k])
    }
}

/// Value and derivative of `(text)*Test_p` at a state, as a function of `unknown`'s first component.
pub(crate) fn scalar(text: &str, unknown: &str, state: &State, backend: &dyn KernelBackend) -> (f64, f64) {
    let law = compile(&format!("({text})*Test_p"), 2, As::Term).unwrap_or_else(|d| panic!("{text}: {d:?}"));
    let outcome = Outcome::at(&law, state, backend);
    (outcome.flux("p", 0), outcome.slope("p", 0, unknown, 0))
}
