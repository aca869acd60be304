//! One term of a scene, from its text to verified point laws: the pipeline of the compiler.
//!
//! build -> (energy: derive along the test functions) -> derive along the trial functions -> lower to linear forms
//! -> split off what is the same at all points -> verify. The law of a term gives at each point the *fluxes* (what
//! multiplies each test slot) and the *entries* (what multiplies each pair of test and trial slot); the runtime
//! contracts them with basis functions.

use std::collections::{BTreeMap, BTreeSet};

use wfl::{
    Checked, Diagnostic,
    ast::{Expr, ExprKind, MulOp},
};

use crate::{
    build::{Builder, Constant, Env, locate},
    degree::{Degree, degree},
    derive::{NoDerivative, derive},
    graph::{Arity, ExprId, Graph, Leaf, Node, Role},
    interp::interpret,
    ir::{Inst, Kernel, Origin, Val, VerifiedKernel},
    lower::Lowering,
    scalar::{NO_SLOT, Scalars},
    sign::radius_warnings,
    types::{BasisSlot, FieldId, FieldSig, InputSlot, PlaceSig, Shape, UniformSlot},
    verify::verify,
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
    /// The tangent changes with the step variable, the previous step, data or state.
    pub tangent_changes_with_step: bool,
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
    /// The typed graph and its roots, for listings.
    pub listing: Listing,
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
}

/// What is compiled.
#[derive(Clone, Copy, Debug)]
pub enum TermSource<'a> {
    /// `term`: a residual, linear in the test functions.
    Residual(&'a Expr),
    /// `energy`: a potential.
    Energy(&'a Expr),
    /// GWFL: potential, residual or bare tangent, whichever the expression is.
    Any(&'a Expr),
    /// As `Any`, with the choices that GetFEM makes at ties, to compare with its numbers. They differ from those of the
    /// language in `neg_part`, `max`, `min`, `Ball_projection` of radius 0 and the contact part of
    /// `Coulomb_friction_coupled_projection`.
    GetFem(&'a Expr),
    /// `load field = value`: minus value times the test function; `entry` picks one component.
    Load {
        /// The force or traction.
        value: &'a Expr,
        /// What it acts on.
        field: FieldId,
        /// Which part.
        part: LoadPart,
    },
}

/// The part of a field that a load acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadPart {
    /// All components.
    Whole,
    /// One component, from 0.
    Component(usize),
    /// The component along the outward normal.
    Normal,
}

/// Compiles one term on one place.
#[must_use]
pub fn compile_term(env: &Env<'_>, place: &PlaceSig, name: &str, source: TermSource<'_>) -> Checked<TermLaw> {
    let mut builder = Builder::new(env, place);
    let roots = roots(&mut builder, source);
    let mut diagnostics = std::mem::take(&mut builder.diagnostics);
    let Some(listing) =
        roots.map(|(energy, residual, tangent)| Listing { graph: builder.graph, energy, residual, tangent })
    else {
        return Checked { value: None, diagnostics };
    };
    diagnostics.extend(kink_warnings(env, &listing));
    diagnostics.extend(radius_warnings(env, &listing));
    Checked { value: Some(law_of(env, place, name, listing)), diagnostics }
}

type Roots = (Option<ExprId>, Option<ExprId>, ExprId);

fn roots(b: &mut Builder<'_>, source: TermSource<'_>) -> Option<Roots> {
    let (text, energy_allowed, residual_allowed) = match source {
        TermSource::Residual(e) => (e, false, true),
        TermSource::Energy(e) => (e, true, false),
        TermSource::Any(e) => (e, true, true),
        TermSource::GetFem(e) => {
            b.graph.getfem_ties = true;
            (e, true, true)
        }
        TermSource::Load { value, field, part } => {
            let residual = load(b, value, field, part)?;
            let zero = b.graph.number(0.0);
            return Some((None, Some(residual), zero));
        }
    };
    let root = b.expr(text)?;
    let shape = b.graph.shape(root);
    if !shape.is_scalar_like() {
        let d = Diagnostic::new("E103", format!("this term is not a scalar, it is a {shape}"));
        return not_scalar(b, d, text, shape);
    }
    let root = b.graph.to_scalar(root);
    let (energy, residual) = match b.graph.arity(root) {
        Arity { test: false, trial: false } if energy_allowed => {
            let along = direction(b, root, Role::Test, text)?;
            (Some(root), along)
        }
        Arity { test: false, trial: false } if b.graph.is_zero(root) => (None, root),
        Arity { test: false, trial: false } => {
            let d = Diagnostic::new("E302", "this term has no test function")
                .help("if it is a potential to be minimised, write `energy` in place of `term`");
            return b.report(d, text, "no Test_ in it");
        }
        Arity { test: true, trial: false } if residual_allowed => (None, root),
        Arity { test: true, trial: false } => {
            let d =
                Diagnostic::new("E302", "an energy has no test functions").help("write `term` in place of `energy`");
            return b.report(d, text, "");
        }
        _ if matches!(source, TermSource::Any(_) | TermSource::GetFem(_)) && b.graph.arity(root).test => {
            return Some((None, None, root));
        }
        _ => {
            let d = Diagnostic::new("E301", "`Test2_` stands in tangents only; a scene gives residuals and potentials");
            return b.report(d, text, "");
        }
    };
    let tangent = direction(b, residual, Role::Trial, text)?;
    Some((energy, Some(residual), tangent))
}

/// E103, with the operator that would have made a scalar.
fn not_scalar<T>(b: &mut Builder<'_>, d: Diagnostic, text: &Expr, shape: Shape) -> Option<T> {
    if let ExprKind::Product(first, rest) = &text.kind
        && let [(MulOp::Dot, _, second)] = rest.as_slice()
        && let (Some(x), Some(y)) = (b.expr(first), b.expr(second))
        && b.graph.shape(x) == b.graph.shape(y)
        && shape.rank() == 2
    {
        let s = b.graph.shape(x);
        let d = d.help(format!("`:` contracts both indices: {}:{}", b.text_of(text, first), b.text_of(text, second)));
        return b.report(d, text, format!("`.` contracts one index of each: {s} . {s} is {shape}"));
    }
    let d = d.help(if shape.rank() == 2 {
        "`:` contracts both indices of two matrices"
    } else {
        "`.` contracts a vector with a vector"
    });
    b.report(d, text, shape.to_string())
}

/// The derivative along the test or trial functions of all unknowns.
fn derived_along(g: &mut Graph, fields: &[FieldSig], root: ExprId, role: Role) -> Result<ExprId, NoDerivative> {
    derive(g, root, &mut |g, leaf| match leaf {
        Leaf::Field { field, side, op, role: Role::Current } if fields[field.index()].is_unknown() => {
            Some(g.leaf(Leaf::Field { field, side, op, role }))
        }
        _ => None,
    })
}

/// The tangent of a residual.
pub(crate) fn tangent_of(g: &mut Graph, fields: &[FieldSig], residual: ExprId) -> Result<ExprId, NoDerivative> {
    derived_along(g, fields, residual, Role::Trial)
}

fn direction(b: &mut Builder<'_>, root: ExprId, role: Role, text: &Expr) -> Option<ExprId> {
    match derived_along(&mut b.graph, b.env.fields, root, role) {
        Ok(d) => Some(d),
        Err(NoDerivative { what, .. }) => b.no_derivative(text, what),
    }
}

fn load(b: &mut Builder<'_>, value: &Expr, field: FieldId, part: LoadPart) -> Option<ExprId> {
    let v = b.expr(value)?;
    b.no_tests(value, v, "load")?;
    let shape = b.env.fields[field.index()].shape;
    let test = b.graph.leaf(Leaf::Field {
        field,
        side: crate::types::Side::Here,
        op: crate::types::FieldOp::Value,
        role: Role::Test,
    });
    let needed = if part == LoadPart::Whole { shape } else { Shape::SCALAR };
    let found = b.graph.shape(v);
    if found != needed && !(found.is_scalar_like() && needed.is_scalar_like()) {
        let d = Diagnostic::new("E108", format!("this load needs a {needed}, found a {found}"));
        return b.report(d, value, found.to_string());
    }
    let v = b.graph.reshape(v, needed);
    let work = match part {
        LoadPart::Whole => b.graph.inner(v, test),
        LoadPart::Component(k) => {
            let component = b.graph.entry(test, k);
            b.graph.scale(v, component)
        }
        LoadPart::Normal => {
            let normal = b.graph.leaf(Leaf::Normal(crate::types::Side::Here));
            let along = b.graph.inner(test, normal);
            b.graph.scale(v, along)
        }
    };
    Some(b.graph.neg(work))
}

/// W501: `Heaviside` and `sign` of an unknown have no useful derivative.
fn kink_warnings(env: &Env<'_>, listing: &Listing) -> Vec<Diagnostic> {
    let g = &listing.graph;
    let Some(residual) = listing.residual else { return Vec::new() };
    let mut out = Vec::new();
    for e in reachable(g, residual) {
        if let Node::Select(mask, a, b) = *g.node(e)
            && g.depends(mask).unknown
            && let (Some(x), Some(y)) = (g.constant_value(a), g.constant_value(b))
            && x != y
            && let Some(origin) = g.origin(e)
        {
            let d = Diagnostic::new("W501", "a step in an unknown has derivative 0: Newton does not see it");
            out.push(locate(d, origin, env.expansions, "jumps where its argument changes sign"));
        }
    }
    out
}

/// Nodes below `root`, operands first.
pub(crate) fn reachable(g: &Graph, root: ExprId) -> Vec<ExprId> {
    let mut seen = vec![false; g.len()];
    seen[root.index()] = true;
    for k in (0..=root.index()).rev() {
        if seen[k] {
            crate::display::operands(g.node(ExprId::new(k)), |o| seen[o.index()] = true);
        }
    }
    (0..g.len()).filter(|k| seen[*k]).map(ExprId::new).collect()
}

/// The law of a residual and its tangent.
pub(crate) fn law_of(env: &Env<'_>, place: &PlaceSig, name: &str, listing: Listing) -> TermLaw {
    let g = listing.graph.clone();
    let mut lowering = Lowering::new(&g);
    let residual = listing.residual.map(|r| lowering.lower(r).swap_remove(0)).unwrap_or_default();
    let tangent = lowering.lower(listing.tangent).swap_remove(0);
    let energy = listing.energy.map(|e| lowering.values(e)[0]);
    let (kinks, codes) = kinks(&g, listing.residual, &mut lowering);

    // slots in sorted order, only those that carry something
    let used = |pick: fn((u16, u16)) -> u16| {
        let keys = residual.iter().chain(&tangent).map(move |(k, _)| pick(*k));
        keys.filter(|k| *k != NO_SLOT).collect::<BTreeSet<u16>>()
    };
    let (tests, test_of) = sorted_slots(&lowering.slots.tests, &used(|k| k.0));
    let (trials, trial_of) = sorted_slots(&lowering.slots.trials, &used(|k| k.1));
    let zero = lowering.scalars.constant(0.0);
    let mut fluxes = vec![zero; tests.len()];
    for ((t, _), v) in &residual {
        fluxes[usize::from(test_of[t])] = *v;
    }
    let pairs: BTreeMap<(u16, u16), Val> = tangent.iter().map(|((t, s), v)| ((test_of[t], trial_of[s]), *v)).collect();
    let entries: Vec<(u16, u16)> = pairs.keys().copied().collect();

    let slots: Vec<InputSlot> = by_position(&lowering.slots.inputs);
    let uniform_slots: Vec<UniformSlot> = by_position(&lowering.slots.uniforms);
    let changes = changes(env, &lowering.scalars, &slots);
    let depends = |v: &Val| changes[v.index()];
    let class = if pairs.values().any(|v| depends(v).unknown) {
        if kinks.is_empty() { Class::Nonlinear } else { Class::Kinked }
    } else if pairs.is_empty() && !fluxes.iter().any(|v| depends(v).unknown) {
        Class::Constant
    } else {
        Class::Linear
    };
    let tangent_changes_with_step = pairs.values().any(|v| depends(v).step);

    let mut emitter = Emitter::new(&lowering.scalars, slots.len());
    let residual_outputs: Vec<Val> = fluxes.iter().chain(&codes).copied().collect();
    let tangent_outputs: Vec<Val> = fluxes.iter().chain(pairs.values()).chain(&codes).copied().collect();
    let residual = emitter.kernel(&format!("{name}.residual"), &residual_outputs);
    let tangent = emitter.kernel(&format!("{name}.tangent"), &tangent_outputs);
    let energy = energy.map(|e| emitter.kernel(&format!("{name}.energy"), &[e]));
    let (residual, tangent, energy, prologue) = emitter.finish(residual, tangent, energy, uniform_slots, name);

    let root = listing.residual.unwrap_or(listing.tangent);
    let degree = degree(&g, root, env.fields, place.tensor_cells);
    let mut law = TermLaw {
        name: name.to_owned(),
        class,
        symmetric: false,
        tangent_changes_with_step,
        degree,
        inputs: slots,
        prologue,
        tests,
        trials,
        entries,
        kinks,
        residual,
        tangent,
        energy,
        listing,
    };
    law.symmetric = listing_is_energy(&law) || is_symmetric(&law, &pairs);
    law
}

fn listing_is_energy(law: &TermLaw) -> bool {
    law.listing.energy.is_some()
}

/// Kinks of the residual that move with the unknowns, with their branch codes.
fn kinks(g: &Graph, residual: Option<ExprId>, lowering: &mut Lowering<'_>) -> (Vec<Kink>, Vec<Val>) {
    let (mut kinks, mut codes, mut masks) = (Vec::new(), Vec::new(), BTreeSet::new());
    let Some(root) = residual else { return (kinks, codes) };
    for e in reachable(g, root) {
        match *g.node(e) {
            Node::Select(mask, ..) if g.depends(mask).unknown && masks.insert(mask) => {
                for m in lowering.mask(mask) {
                    let [one, zero] = [1.0, 0.0].map(|c| lowering.scalars.constant(c));
                    codes.push(lowering.scalars.select(m, one, zero));
                    kinks.push(Kink { kind: KinkKind::Select, origin: g.origin(mask) });
                }
            }
            Node::Ball(v, r) if g.depends(v).unknown || g.depends(r).unknown => {
                codes.push(lowering.ball_code(v, r));
                kinks.push(Kink { kind: KinkKind::Ball, origin: g.origin(e) });
            }
            _ => {}
        }
    }
    (kinks, codes)
}

fn sorted_slots(all: &BTreeMap<BasisSlot, u16>, used: &BTreeSet<u16>) -> (Vec<BasisSlot>, BTreeMap<u16, u16>) {
    let mut slots = Vec::new();
    let mut renumber = BTreeMap::new();
    for (slot, id) in all {
        if used.contains(id) {
            renumber.insert(*id, u16::try_from(slots.len()).expect("few slots"));
            slots.push(*slot);
        }
    }
    (slots, renumber)
}

fn by_position<T: Copy>(map: &BTreeMap<T, usize>) -> Vec<T> {
    let mut list: Vec<(usize, T)> = map.iter().map(|(slot, id)| (*id, *slot)).collect();
    list.sort_by_key(|(id, _)| *id);
    list.into_iter().map(|(_, slot)| slot).collect()
}

#[derive(Clone, Copy, Default)]
struct Changes {
    unknown: bool,
    step: bool,
}

/// For each scalar what it changes with.
fn changes(env: &Env<'_>, scalars: &Scalars, slots: &[InputSlot]) -> Vec<Changes> {
    let mut out: Vec<Changes> = Vec::with_capacity(scalars.insts.len());
    for inst in &scalars.insts {
        let mut c = match inst {
            Inst::Input(s) => match slots[*s as usize] {
                InputSlot::Field(b) if env.fields[b.field.index()].is_unknown() => {
                    Changes { unknown: true, step: false }
                }
                InputSlot::Field(_) | InputSlot::Previous(_) => Changes { unknown: false, step: true },
                _ => Changes::default(),
            },
            Inst::Uniform(_) => Changes { unknown: false, step: true },
            _ => Changes::default(),
        };
        inst.for_each_operand(|v| {
            c.unknown |= out[v.index()].unknown;
            c.step |= out[v.index()].step;
        });
        out.push(c);
    }
    out
}

/// Turns scalars into kernels; what no point input enters becomes a uniform, computed by the prologue.
struct Emitter<'s> {
    scalars: &'s Scalars,
    n_inputs: usize,
    uniforms: BTreeMap<Val, u32>,
    order: Vec<Val>,
}

impl<'s> Emitter<'s> {
    fn new(scalars: &'s Scalars, n_inputs: usize) -> Self {
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

    fn kernel(&mut self, name: &str, outputs: &[Val]) -> Kernel {
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

    fn prologue(&self, slots: Vec<UniformSlot>, name: &str) -> Prologue {
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

    fn finish(
        self,
        mut residual: Kernel,
        mut tangent: Kernel,
        mut energy: Option<Kernel>,
        slots: Vec<UniformSlot>,
        name: &str,
    ) -> (VerifiedKernel, VerifiedKernel, Option<VerifiedKernel>, Prologue) {
        let n = self.order.len();
        for kernel in [Some(&mut residual), Some(&mut tangent), energy.as_mut()].into_iter().flatten() {
            kernel.n_uniforms = n;
        }
        let prologue = self.prologue(slots, name);
        (accepted(residual), accepted(tangent), energy.map(accepted), prologue)
    }
}

fn accepted(kernel: Kernel) -> VerifiedKernel {
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
        Inst::Call2(f, a, b) => Inst::Call2(*f, p(a), p(b)),
        Inst::Matrix { function, n, entries } => {
            Inst::Matrix { function: *function, n: *n, entries: entries.iter().map(p).collect() }
        }
        Inst::Part(a, k) => Inst::Part(p(a), *k),
    }
}

/// Symmetric: equal scalars in mirrored entries, or equal values at sampled states (identity testing).
fn is_symmetric(law: &TermLaw, pairs: &BTreeMap<(u16, u16), Val>) -> bool {
    if law.entries.is_empty() {
        return true;
    }
    let position = |slot: BasisSlot, list: &[BasisSlot]| list.iter().position(|s| *s == slot);
    let mut mirror = BTreeMap::new();
    for (k, (t, s)) in law.entries.iter().enumerate() {
        let Some(row) = position(law.trials[usize::from(*s)], &law.tests) else { return false };
        let Some(column) = position(law.tests[usize::from(*t)], &law.trials) else { return false };
        let key = (u16::try_from(row).expect("few slots"), u16::try_from(column).expect("few slots"));
        let Ok(other) = law.entries.binary_search(&key) else { return false };
        mirror.insert(k, other);
    }
    let values: Vec<Val> = pairs.values().copied().collect();
    if mirror.iter().all(|(k, other)| values[*k] == values[*other]) {
        return true;
    }
    sampled_symmetric(law, &mirror)
}

/// Entries compared at sampled inputs: relative difference below rounding growth.
const SYMMETRY_SAMPLES: usize = 24;
const SYMMETRY_TOLERANCE: f64 = 1e-11;

fn sampled_symmetric(law: &TermLaw, mirror: &BTreeMap<usize, usize>) -> bool {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        #[expect(clippy::cast_precision_loss, reason = "53 random bits")]
        let unit = (state >> 11) as f64 / (1u64 << 53) as f64;
        2.0 * unit - 1.0
    };
    let kernel = law.tangent.kernel();
    let mut values = Vec::new();
    let mut outputs = vec![0.0; kernel.outputs.len()];
    for sample in 0..SYMMETRY_SAMPLES {
        let scale = 10f64.powi(i32::try_from(sample % 6).expect("small") - 4);
        let uniforms: Vec<f64> = (0..kernel.n_uniforms).map(|_| random()).collect();
        let mut inputs: Vec<f64> =
            law.inputs.iter().map(|s| random() * if matches!(s, InputSlot::Field(_)) { scale } else { 1.0 }).collect();
        unit_normals(&law.inputs, &mut inputs);
        interpret(&law.tangent, &uniforms, &inputs, &mut values, &mut outputs);
        let entries = &outputs[law.tests.len()..law.tests.len() + law.entries.len()];
        let size = entries.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        if mirror.iter().any(|(k, other)| (entries[*k] - entries[*other]).abs() > SYMMETRY_TOLERANCE * size) {
            return false;
        }
    }
    true
}

/// Makes sampled normals unit vectors (opposite on the two sides) and sizes positive.
pub fn unit_normals(slots: &[InputSlot], inputs: &mut [f64]) {
    let mut length = 0.0f64;
    let mut here = [0.0; 3];
    for (slot, x) in slots.iter().zip(inputs.iter()) {
        if let InputSlot::Normal(crate::types::Side::Here, k) = slot {
            here[usize::from(*k)] = *x;
            length = length.hypot(*x);
        }
    }
    for (slot, x) in slots.iter().zip(inputs.iter_mut()) {
        match slot {
            InputSlot::Normal(side, k) => {
                let sign = if *side == crate::types::Side::Here { 1.0 } else { -1.0 };
                if length > 0.0 {
                    *x = sign * here[usize::from(*k)] / length;
                }
            }
            InputSlot::ElementSize(_) => *x = 0.5 + x.abs(),
            _ => {}
        }
    }
}

/// Compiles an expression without test functions.
#[must_use]
pub fn compile_value(env: &Env<'_>, place: &PlaceSig, name: &str, expr: &Expr) -> Checked<ValueLaw> {
    compile_built(env, place, name, |b| {
        let value = b.expr(expr)?;
        b.no_tests(expr, value, name)?;
        Some(value)
    })
}

/// Compiles a condition: 1 where it holds, 0 elsewhere. `==` on positions is within `env.equal_within`.
#[must_use]
pub fn compile_condition(env: &Env<'_>, place: &PlaceSig, name: &str, cond: &wfl::ast::Cond) -> Checked<ValueLaw> {
    compile_built(env, place, name, |b| {
        b.loose_equality = true;
        let mask = b.condition(cond)?;
        let [one, zero] = [1.0, 0.0].map(|x| b.graph.number(x));
        // a constant condition folds to a number
        Some(b.graph.select(mask, one, zero))
    })
}

fn compile_built(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    build: impl FnOnce(&mut Builder<'_>) -> Option<ExprId>,
) -> Checked<ValueLaw> {
    let mut builder = Builder::new(env, place);
    let root = build(&mut builder);
    let diagnostics = std::mem::take(&mut builder.diagnostics);
    let Some(root) = root else {
        return Checked { value: None, diagnostics };
    };
    Checked { value: Some(value_of(env, place, name, builder.graph, root)), diagnostics }
}

/// The law of a value.
pub(crate) fn value_of(env: &Env<'_>, place: &PlaceSig, name: &str, g: Graph, root: ExprId) -> ValueLaw {
    let mut lowering = Lowering::new(&g);
    let outputs = lowering.values(root);
    let inputs = by_position(&lowering.slots.inputs);
    let slots = by_position(&lowering.slots.uniforms);
    let changes = changes(env, &lowering.scalars, &inputs);
    let changes_with_step = outputs.iter().any(|v| changes[v.index()].step);
    let mut emitter = Emitter::new(&lowering.scalars, inputs.len());
    let mut kernel = emitter.kernel(name, &outputs);
    kernel.n_uniforms = emitter.order.len();
    let prologue = emitter.prologue(slots, name);
    let degree = degree(&g, root, env.fields, place.tensor_cells);
    ValueLaw { shape: g.shape(root), inputs, prologue, kernel: accepted(kernel), degree, changes_with_step }
}

/// The value of an expression that must not change with anything.
#[must_use]
pub fn constant(env: &Env<'_>, what: &str, expr: &Expr) -> Checked<Constant> {
    let nowhere = PlaceSig {
        name: "global".to_owned(),
        kind: crate::types::PlaceKind::Global,
        here: vec![false; env.fields.len()],
        there: vec![false; env.fields.len()],
        tensor_cells: false,
        description: "no place".to_owned(),
        here_name: None,
    };
    let law = compile_value(env, &nowhere, what, expr);
    let known = format!("{what} must be a number known before the run");
    let mut diagnostics: Vec<Diagnostic> =
        law.diagnostics.into_iter().map(|d| without_fields(d, "E112", &known)).collect();
    let value = law.value.and_then(|law| {
        if law.inputs.is_empty() && law.prologue.slots.is_empty() {
            let kernel = law.kernel.kernel();
            let uniforms = run_prologue(&law.prologue, &[]);
            let mut out = vec![0.0; kernel.outputs.len()];
            interpret(&law.kernel, &uniforms, &[], &mut Vec::new(), &mut out);
            return Some(Constant { shape: law.shape, values: out, declared: Some(expr.span) });
        }
        let d = Diagnostic::new("E112", known);
        let origin = Origin { span: expr.span, expansion: expr.expansion };
        diagnostics.push(locate(d, origin, env.expansions, "changes with position or time"));
        None
    });
    Checked { value, diagnostics }
}

/// A message about a field where no field can be (E202) in the words of the statement.
#[must_use]
pub fn without_fields(d: Diagnostic, code: &'static str, message: &str) -> Diagnostic {
    if d.code != "E202" {
        return d;
    }
    let field = d.about.clone().unwrap_or_default();
    let told = d.labels.into_iter().enumerate().fold(Diagnostic::new(code, message), |told, (k, label)| {
        let text = if k == 0 { format!("`{field}` is a field: it has values only during the run") } else { label.text };
        told.at(label.span, text)
    });
    told.about(field)
}

/// The uniforms of a law for these values of its prologue's slots.
#[must_use]
pub fn run_prologue(prologue: &Prologue, values: &[f64]) -> Vec<f64> {
    let kernel = prologue.kernel.kernel();
    let mut out = vec![0.0; kernel.outputs.len()];
    interpret(&prologue.kernel, values, &[], &mut Vec::new(), &mut out);
    out
}
