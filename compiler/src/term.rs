//! One term of a scene, from its text to verified point laws: the pipeline of the compiler.
//!
//! build -> (energy: derive along the test functions) -> derive along the trial functions -> lower to linear forms
//! -> split off what is the same at all points -> verify. The law of a term gives at each point the *fluxes* (what
//! multiplies each test slot) and the *entries* (what multiplies each pair of test and trial slot); the runtime
//! contracts them with basis functions.

use std::collections::{BTreeMap, BTreeSet};

use wfl::{
    Checked, Code, Diagnostic, Fix,
    ast::{Expr, ExprKind, MulOp},
};

use crate::{
    build::{Builder, Env, first_test, locate},
    degree::{Degree, degree},
    derive::{NoDerivative, derive},
    emitter::{Emitter, accepted},
    graph::{Arity, ExprId, Graph, Leaf, Node, Role},
    image::Variation,
    ir::{Inst, Val},
    jumps::value_jumps,
    law::{Class, Kink, KinkKind, Listing, TermLaw, ValueLaw},
    lower::Lowering,
    scalar::{Key, NO_SLOT, Scalars},
    sign::radius_warnings,
    summands::{self, magnitude_of_sides},
    symmetry::is_symmetric,
    types::{BasisSlot, FieldId, FieldOp, FieldSig, InputSlot, Moves, PlaceSig, Shape, Side, UniformSlot},
};

/// What is compiled.
#[derive(Clone, Copy, Debug)]
pub enum TermSource<'a> {
    /// `term`: a residual, linear in the test functions.
    Residual(&'a Expr),
    /// `energy`: a potential.
    Energy(&'a Expr),
    /// GWFL: potential, residual or bare tangent, whichever the expression is.
    Any(&'a Expr),
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

impl<'a> TermSource<'a> {
    /// What was written.
    pub(crate) fn text(self) -> &'a Expr {
        match self {
            TermSource::Residual(e) | TermSource::Energy(e) | TermSource::Any(e) => e,
            TermSource::Load { value, .. } => value,
        }
    }
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
    let Checked { value, mut diagnostics } = listing_of(env, place, source);
    let Some(listing) = value else {
        return Checked { value: None, diagnostics };
    };
    diagnostics.extend(kink_warnings(env, &listing));
    diagnostics.extend(radius_warnings(env, &listing));
    Checked { value: Some(law_of(env, place, name, listing)), diagnostics }
}

/// The graph of one term on one place.
pub(crate) fn listing_of(env: &Env<'_>, place: &PlaceSig, source: TermSource<'_>) -> Checked<Listing> {
    let mut builder = Builder::new(env, place);
    let roots = roots(&mut builder, source);
    let diagnostics = std::mem::take(&mut builder.diagnostics);
    let listing = roots.map(|(energy, residual, tangent)| Listing { graph: builder.graph, energy, residual, tangent });
    Checked { value: listing, diagnostics }
}

type Roots = (Option<ExprId>, Option<ExprId>, ExprId);

fn roots(b: &mut Builder<'_>, source: TermSource<'_>) -> Option<Roots> {
    let (text, energy_allowed, residual_allowed) = match source {
        TermSource::Residual(e) => (e, false, true),
        TermSource::Energy(e) => (e, true, false),
        TermSource::Any(e) => (e, true, true),
        TermSource::Load { value, field, part } => {
            let residual = load(b, value, field, part)?;
            // a load may follow unknowns: a pressure that is solved for, a follower force
            let tangent = direction(b, residual, Role::Trial, value)?;
            return Some((None, Some(residual), tangent));
        }
    };
    let root = b.expr(text)?;
    let shape = b.graph.shape(root);
    if !shape.is_scalar_like() {
        let d = Diagnostic::new(Code::E103, format!("this term is not a scalar, it is a {shape}"));
        return not_scalar(b, d, text, shape);
    }
    let root = b.graph.to_scalar(root);
    let (energy, residual) = match b.graph.arity(root) {
        Arity { test: false, trial: false } if energy_allowed && b.reads_moving_image(root) => {
            let d = Diagnostic::new(Code::E111, "an energy cannot read through a mapping that moves")
                .help("write the residual as a `term`: force.(Test_u - Interpolate(Test_u, m))");
            return b.report(d, text, "its tangent would need second variations of the image");
        }
        Arity { test: false, trial: false } if energy_allowed => {
            let along = direction(b, root, Role::Test, text)?;
            (Some(root), along)
        }
        Arity { test: false, trial: false } if b.graph.is_zero(root) => (None, root),
        Arity { test: false, trial: false } => {
            let d = Diagnostic::new(Code::E302, "this term has no test function")
                .help("if it is a potential to be minimised, write `energy` in place of `term`");
            // a test function that vanishes is a mistake of another kind
            let is_potential = first_test(text).is_none();
            let d = if is_potential { d.fix(Fix::FirstWord { from: "term", to: "energy" }) } else { d };
            return b.report(d, text, "no Test_ in it");
        }
        Arity { test: true, trial: false } if residual_allowed => (None, root),
        Arity { test: true, trial: false } => {
            let d = Diagnostic::new(Code::E302, "an energy has no test functions")
                .help("write `term` in place of `energy`");
            return b.report(d.fix(Fix::FirstWord { from: "energy", to: "term" }), text, "");
        }
        _ if matches!(source, TermSource::Any(_)) && b.graph.arity(root).test => {
            return Some((None, None, root));
        }
        _ => {
            let d =
                Diagnostic::new(Code::E301, "`Test2_` stands in tangents only; a scene gives residuals and potentials");
            return b.report(d, text, "");
        }
    };
    let tangent = direction(b, residual, Role::Trial, text)?;
    Some((energy, Some(residual), tangent))
}

/// E103, with the operator that would have made a scalar.
fn not_scalar<T>(b: &mut Builder<'_>, d: Diagnostic, text: &Expr, shape: Shape) -> Option<T> {
    if let ExprKind::Product(first, rest) = &text.kind
        && let [(MulOp::Dot, operator, second)] = rest.as_slice()
        && let (Some(x), Some(y)) = (b.expr(first), b.expr(second))
        && b.graph.shape(x) == b.graph.shape(y)
        && shape.rank() == 2
    {
        let s = b.graph.shape(x);
        let d = d.help(format!("`:` contracts both indices: {}:{}", b.text_of(text, first), b.text_of(text, second)));
        return b.report(
            d.replace(*operator, ":"),
            text,
            format!("`.` contracts one index of each: {s} . {s} is {shape}"),
        );
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
    let mut variation = Variation::new(role);
    let derived = derive(g, root, &mut |g, leaf| {
        let own = match leaf {
            Leaf::Field { field, side, op, role: Role::Current } if fields[field.index()].is_unknown() => {
                Some(g.leaf(Leaf::Field { field, side, op, role }))
            }
            _ => None,
        };
        variation.of(g, leaf, own)
    })?;
    variation.finish(root, derived)
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
    if b.reads_moving_image(v) {
        let d = Diagnostic::new(Code::E111, "a load cannot read through a mapping that moves");
        return b.report(
            d.help("write a `term`: minus the load times the test function"),
            value,
            "it follows the bodies",
        );
    }
    let shape = b.env.fields[field.index()].shape;
    let test =
        b.graph.leaf(Leaf::Field { field, side: crate::types::Side::Here, op: FieldOp::Value, role: Role::Test });
    let needed = if part == LoadPart::Whole { shape } else { Shape::SCALAR };
    let found = b.graph.shape(v);
    if found != needed && !(found.is_scalar_like() && needed.is_scalar_like()) {
        let d = Diagnostic::new(Code::E108, format!("this load needs a {needed}, found a {found}"));
        let d = match (found.is_scalar_like(), needed.len()) {
            (true, n @ 2..=3) => {
                let d = d.help(format!("a vector is written with all its components: [{}1]", "0,".repeat(n - 1)));
                // no force at all is none in any direction
                match value.kind {
                    ExprKind::Number(0.0) => d.replace(value.span, format!("[{}0]", "0,".repeat(n - 1))),
                    _ => d,
                }
            }
            _ => d,
        };
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
pub(crate) fn kink_warnings(env: &Env<'_>, listing: &Listing) -> Vec<Diagnostic> {
    let g = &listing.graph;
    let Some(residual) = listing.residual else { return Vec::new() };
    let mut out = Vec::new();
    for e in g.reachable(residual) {
        if let Node::Select(mask, a, b) = *g.node(e)
            && g.depends(mask).unknown
            && let (Some(x), Some(y)) = (g.constant_value(a), g.constant_value(b))
            && x != y
            && let Some(origin) = g.origin(e)
        {
            let d = Diagnostic::new(
                Code::W501,
                "a discontinuity in an unknown has derivative 0: Newton's method does not see it",
            );
            out.push(locate(d, origin, env.expansions, "jumps where its argument changes sign"));
        }
    }
    out
}

/// The law of a residual and its tangent.
pub(crate) fn law_of(env: &Env<'_>, place: &PlaceSig, name: &str, listing: Listing) -> TermLaw {
    let degree = degree(&listing.graph, listing.residual.unwrap_or(listing.tangent), env.fields, place);
    law_with(env.fields, name, listing, degree)
}

/// The same with the degree of its quadrature.
pub(crate) fn law_with(fields: &[FieldSig], name: &str, listing: Listing, degree: Degree) -> TermLaw {
    let g = listing.graph.clone();
    let mut lowering = Lowering::new(&g);
    let residual = listing.residual.map(|r| lowering.lower(r).swap_remove(0)).unwrap_or_default();
    let tangent = lowering.lower(listing.tangent).swap_remove(0);
    let energy = listing.energy.map(|e| lowering.values(e)[0]);
    let (kinks, codes) = kinks(&g, listing.residual, &mut lowering);

    // slots in sorted order, only those that carry something
    let used: Vec<Key> = residual.iter().chain(&tangent).map(|(key, _)| *key).collect();
    let (tests, test_of) = sorted_slots(&lowering.slots.tests, used.iter().map(|k| k.0));
    let (trials, trial_of) = sorted_slots(&lowering.slots.trials, used.iter().map(|k| k.1));
    let zero = lowering.scalars.constant(0.0);
    let mut fluxes = vec![zero; tests.len()];
    for ((t, _), v) in &residual {
        fluxes[usize::from(test_of[t])] = *v;
    }
    let pairs: BTreeMap<(u16, u16), Val> = tangent.iter().map(|((t, s), v)| ((test_of[t], trial_of[s]), *v)).collect();
    let entries: Vec<(u16, u16)> = pairs.keys().copied().collect();

    let slots: Vec<InputSlot> = by_position(&lowering.slots.inputs);
    let uniform_slots: Vec<UniformSlot> = by_position(&lowering.slots.uniforms);
    let changes = changes(fields, &lowering, &slots);
    let class = class_of(&changes, &fluxes, &pairs, &kinks);
    let tangent_has = |what: fn(&Changes) -> bool| pairs.values().any(|v| what(&changes[v.index()]));

    let sizes = summand_sizes(fields, &tests, class, &mut lowering.scalars, &changes, &fluxes);
    let mut emitter = Emitter::new(&lowering.scalars, slots.len());
    let residual_outputs: Vec<Val> = fluxes.iter().chain(&codes).copied().collect();
    let tangent_outputs: Vec<Val> = fluxes.iter().chain(pairs.values()).chain(&codes).copied().collect();
    let residual = emitter.kernel(&format!("{name}.residual"), &residual_outputs);
    let tangent = emitter.kernel(&format!("{name}.tangent"), &tangent_outputs);
    let energy = energy.map(|e| emitter.kernel(&format!("{name}.energy"), &[e]));
    let sizes = sizes.map(|list| emitter.kernel(&format!("{name}.summands"), &list));
    let (residual, tangent, [energy, summands], prologue) =
        emitter.finish(residual, tangent, [energy, sizes], uniform_slots, name);

    let mut law = TermLaw {
        name: name.to_owned(),
        class,
        symmetric: false,
        tangent_has_uniforms: tangent_has(|c| c.uniforms),
        tangent_reads_known: tangent_has(|c| c.known),
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
        summands,
        listing,
    };
    // images shift with the one displacement and act on the other
    law.symmetric = g.moves.is_none() && (law.listing.energy.is_some() || is_symmetric(&law, &pairs));
    law
}

/// By test slot what cancels in the flux of a term that is not affine, zero for slots of which nothing is asked; `None` if
/// that is all of them. Asked is it of the equations of single numbers, those of scalars and of global fields; of forces and
/// stresses, which balance between terms and cells, only for what rounding leaves of them, and not of laws of contact.
fn summand_sizes(
    fields: &[FieldSig],
    tests: &[BasisSlot],
    class: Class,
    scalars: &mut Scalars,
    changes: &[Changes],
    fluxes: &[Val],
) -> Option<Vec<Val>> {
    let is_single = |slot: &BasisSlot| {
        let field = &fields[slot.field.index()];
        field.global || field.shape.len() == 1
    };
    let is_smooth = class == Class::Nonlinear;
    let is_asked = |slot: &BasisSlot| is_smooth || slot.op == FieldOp::Value && is_single(slot);
    if class < Class::Nonlinear || !tests.iter().any(is_asked) {
        return None;
    }
    let moves = |v: Val| changes[v.index()].unknown;
    let mut known = BTreeMap::new();
    let one = |(slot, flux): (&BasisSlot, &Val)| match slot.op {
        _ if !is_asked(slot) => scalars.constant(0.0),
        FieldOp::Value => summands::size(scalars, &moves, *flux),
        FieldOp::Grad | FieldOp::Hess => summands::magnitude(scalars, &mut known, *flux),
    };
    Some(tests.iter().zip(fluxes).map(one).collect())
}

/// How a term with these fluxes and entries depends on the unknowns.
fn class_of(changes: &[Changes], fluxes: &[Val], entries: &BTreeMap<(u16, u16), Val>, kinks: &[Kink]) -> Class {
    let moves = |v: &Val| changes[v.index()].unknown;
    if !kinks.is_empty() {
        // also where no entry moves: a law that jumps from one affine form to another is not affine
        Class::Kinked
    } else if entries.values().any(moves) {
        Class::Nonlinear
    } else if entries.is_empty() && !fluxes.iter().any(moves) {
        Class::Constant
    } else {
        Class::Linear
    }
}

/// Kinks of the residual that move with the unknowns, with their branch codes.
fn kinks(g: &Graph, residual: Option<ExprId>, lowering: &mut Lowering<'_>) -> (Vec<Kink>, Vec<Val>) {
    let (mut kinks, mut codes, mut masks) = (Vec::new(), Vec::new(), BTreeSet::new());
    let Some(root) = residual else { return (kinks, codes) };
    for e in g.reachable(root) {
        match *g.node(e) {
            Node::Select(mask, ..) if g.depends(mask).unknown && masks.insert(mask) => {
                for m in lowering.mask(mask) {
                    let [one, zero] = [1.0, 0.0].map(|c| lowering.scalars.constant(c));
                    codes.push(lowering.scalars.select(m, one, zero));
                    kinks.push(Kink {
                        kind: KinkKind::Select,
                        active: crate::frozen::active_code(g, e),
                        origin: g.origin(mask),
                    });
                }
            }
            Node::Ball(v, r) if g.depends(v).unknown || g.depends(r).unknown => {
                codes.push(lowering.ball_code(v, r));
                kinks.push(Kink { kind: KinkKind::Ball, active: None, origin: g.origin(e) });
            }
            _ => {}
        }
    }
    (kinks, codes)
}

fn sorted_slots(
    all: &BTreeMap<BasisSlot, u16>,
    used: impl Iterator<Item = u16>,
) -> (Vec<BasisSlot>, BTreeMap<u16, u16>) {
    let used: BTreeSet<u16> = used.filter(|k| *k != NO_SLOT).collect();
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
    /// Data, states, the previous step.
    known: bool,
    /// The step variable and what is computed from it alone.
    uniforms: bool,
}

/// What a number that a law reads changes with; `moves` says how images follow the unknowns, where they do.
fn changes_of(fields: &[FieldSig], slot: InputSlot, moves: Option<Moves>) -> Changes {
    let moves = moves.is_some();
    let at_image = |side: Side| moves && side == Side::There;
    match slot {
        InputSlot::Field(b) if fields[b.field.index()].is_unknown() => Changes { unknown: true, ..Changes::default() },
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => {
            Changes { known: true, unknown: at_image(b.side), ..Changes::default() }
        }
        InputSlot::Normal(side, _) | InputSlot::ElementSize(side) => {
            Changes { unknown: at_image(side), ..Changes::default() }
        }
        InputSlot::ImageX(_) | InputSlot::ImageShift(_) | InputSlot::ImageSlope(_) => {
            Changes { unknown: moves, ..Changes::default() }
        }
        _ => Changes::default(),
    }
}

/// For each scalar what it changes with.
fn changes(fields: &[FieldSig], lowering: &Lowering<'_>, slots: &[InputSlot]) -> Vec<Changes> {
    let (scalars, moves) = (&lowering.scalars, lowering.moves());
    let mut out: Vec<Changes> = Vec::with_capacity(scalars.insts.len());
    for inst in &scalars.insts {
        let mut c = match inst {
            Inst::Input(s) => changes_of(fields, slots[*s as usize], moves),
            Inst::Uniform(_) => Changes { uniforms: true, ..Changes::default() },
            _ => Changes::default(),
        };
        inst.for_each_operand(|v| {
            c.unknown |= out[v.index()].unknown;
            c.known |= out[v.index()].known;
            c.uniforms |= out[v.index()].uniforms;
        });
        out.push(c);
    }
    out
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
    let degree = degree(&g, root, env.fields, place);
    let law = values_law(env.fields, name, lowering, &outputs, g.shape(root), degree);
    ValueLaw { jumps: value_jumps(&g, root), ..law }
}

/// The law of pairs of numbers that are compared, each with the largest magnitude of what they are made of behind it: a
/// difference of numbers is zero within rounding of these. `None` without pairs.
pub(crate) fn sides_law(env: &Env<'_>, place: &PlaceSig, name: &str, g: &Graph, sides: &[ExprId]) -> Option<ValueLaw> {
    // an empty tensor has no shape
    let (pairs, all) = (Shape::new(&[sides.len()])?, Shape::new(&[sides.len() / 2 * 3])?);
    let mut g = g.clone();
    let root = g.stack(pairs, sides);
    let mut lowering = Lowering::new(&g);
    let (values, mut known) = (lowering.values(root), BTreeMap::new());
    let scalars = &mut lowering.scalars;
    let mut outputs = Vec::new();
    for pair in values.chunks_exact(2) {
        let [a, b] = [pair[0], pair[1]].map(|side| magnitude_of_sides(scalars, &mut known, side));
        outputs.extend([pair[0], pair[1], scalars.add(a, b)]);
    }
    let degree = degree(&g, root, env.fields, place);
    Some(values_law(env.fields, name, lowering, &outputs, all, degree))
}

/// The law whose outputs are some scalars of a lowering.
pub(crate) fn values_law(
    fields: &[FieldSig],
    name: &str,
    lowering: Lowering<'_>,
    outputs: &[Val],
    shape: Shape,
    degree: Degree,
) -> ValueLaw {
    let inputs = by_position(&lowering.slots.inputs);
    let slots = by_position(&lowering.slots.uniforms);
    let changes = changes(fields, &lowering, &inputs);
    let changes_with_step = outputs.iter().map(|v| changes[v.index()]).any(|c| c.known || c.uniforms);
    let mut emitter = Emitter::new(&lowering.scalars, inputs.len());
    let mut kernel = emitter.kernel(name, outputs);
    kernel.n_uniforms = emitter.order.len();
    let prologue = emitter.prologue(slots, name);
    let mapping = lowering.mapping();
    ValueLaw {
        shape,
        inputs,
        prologue,
        kernel: accepted(kernel),
        degree,
        changes_with_step,
        mapping,
        jumps: Vec::new(),
    }
}
