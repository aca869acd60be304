//! Laws of derivatives in everything that a law reads, which adjoint equations are made of.
//!
//! Of a residual `R`, linear in its test functions, the derivative of the number `l.R` is compiled: test functions become
//! the weights `l`, and what the law reads becomes the test function of its field. So one residual kernel gives what one
//! weight vector makes of the derivatives in states, data, parameters and the past alike, by dof, however many there are.
//! The derivative of a value times a weight is made in the same way.
//!
//! Behind the fields of the scene stand their companions, one a field, of the same shape and space: the values of a
//! companion are weights, its test functions are those of the field at the end of the previous step. Along a direction the
//! values of a companion are what its field moves by, and the derivative of a residual is a residual again. Promises: kinks
//! take the branch of the value. What equations read of the past of rates has test functions of fields of its own.

mod sides;

use std::collections::BTreeSet;

use wfl::{Checked, Code, Diagnostic, ast::Expr};

use crate::{
    build::{Builder, Env},
    derive::{NoDerivative, derive},
    graph::{ExprId, Graph, Leaf, Node, Role},
    law::{KinkKind, Listing, TermLaw, ValueLaw},
    shape::{Motion, Velocity},
    term::{TermSource, law_of, listing_of, sides_law, value_of},
    types::{FieldId, FieldOp, PlaceSig, RateOrder, Side},
};

pub use sides::{ToSide, compile_term_to_side, compile_value_to_side, kinks_of_term, kinks_of_value};

/// The fields of a scene, with their companions behind them, behind those parameters and their companions, where there are
/// rates two more fields for each of the scene, and last what does not move.
#[derive(Clone, Copy, Debug)]
pub struct Companions {
    /// How many fields the scene has: the companion of field k is field k + n.
    pub n_fields: usize,
    /// How many parameters stand behind the companions; behind them theirs.
    pub n_parameters: usize,
    /// How the mesh moves; `None` where it does not.
    pub velocity: Option<Velocity>,
}

impl Companions {
    /// The companion of a field of the scene, or of a parameter.
    #[must_use]
    pub fn of(self, field: FieldId) -> FieldId {
        let behind = if field.index() < self.n_fields { self.n_fields } else { self.n_parameters };
        FieldId::new(field.index() + behind)
    }

    /// Whether something is differentiated in it: a field of the scene, or a parameter.
    fn moves(self, field: FieldId) -> bool {
        let parameters = 2 * self.n_fields..2 * self.n_fields + self.n_parameters;
        field.index() < self.n_fields || parameters.contains(&field.index())
    }

    /// The field whose test functions are what a residual reads of the past of the rates of a field of the scene.
    #[must_use]
    pub fn history(self, order: RateOrder, field: FieldId) -> FieldId {
        let first = 2 * (self.n_fields + self.n_parameters);
        FieldId::new(first + usize::from(order == RateOrder::Second) * self.n_fields + field.index())
    }

    /// How the mesh moves, by functions of a role.
    fn motion<'e>(self, env: &Env<'e>, role: Role) -> Option<Motion<'e>> {
        self.velocity.map(|of| Motion { of, role, fields: env.fields, n_fields: self.n_fields })
    }

    /// What a leaf moves by: the test function of its field, of its companion for the past.
    fn moved(self, g: &mut Graph, leaf: Leaf) -> Option<ExprId> {
        let test = |g: &mut Graph, field, side, op| Some(g.leaf(Leaf::Field { field, side, op, role: Role::Test }));
        match leaf {
            Leaf::Field { field, .. } if !self.moves(field) => None,
            Leaf::Field { field, side, op, role: Role::Current } => test(g, field, side, op),
            // a parameter was what it is
            Leaf::Field { field, side, op, role: Role::Previous } if field.index() >= self.n_fields => {
                test(g, field, side, op)
            }
            Leaf::Field { field, side, op, role: Role::Previous } => test(g, self.of(field), side, op),
            Leaf::Field { field, side, op, role: Role::History(order) } => {
                test(g, self.history(order, field), side, op)
            }
            _ => None,
        }
    }

    /// What a leaf moves by along a direction: the values of its companion.
    fn along(self, g: &mut Graph, leaf: Leaf) -> Option<ExprId> {
        match leaf {
            Leaf::Field { role: Role::Test | Role::Trial, .. } => None,
            Leaf::Field { field, side, op, role } if self.moves(field) => {
                Some(g.leaf(Leaf::Field { field: self.of(field), side, op, role }))
            }
            _ => None,
        }
    }
}

/// The derivative of a term times weights, in all that it reads: a law whose residual has a flux for each of them. The
/// weights are the values of the companions of the fields that the term tests.
#[must_use]
pub fn compile_term_gradient(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    source: TermSource<'_>,
    companions: Companions,
) -> Checked<TermLaw> {
    let Checked { value, mut diagnostics } = listing_of(env, place, source);
    let Some(Listing { mut graph, residual: Some(residual), .. }) = value else {
        return Checked { value: None, diagnostics };
    };
    let weighted = derive(&mut graph, residual, &mut |g, leaf| match leaf {
        Leaf::Field { field, side, op, role: Role::Test } => {
            Some(g.leaf(Leaf::Field { field: companions.of(field), side, op, role: Role::Current }))
        }
        _ => None,
    });
    let law =
        weighted.and_then(|weighted| gradient_of(env, place, name, graph, (weighted, Some(weighted), companions)));
    let value = law.map_err(|none| diagnostics.push(refused(env, place, source.text(), &none))).ok();
    Checked { value, diagnostics }
}

/// The derivative of an expression times a weight, in all that it reads. `weight` is a field of as many components as the
/// expression has entries. What the growth of the region by the motion of the mesh counts by is a field of its own, one number
/// a point, where there is one.
#[must_use]
pub fn compile_value_gradient(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    expr: &Expr,
    weight: (FieldId, Option<FieldId>, Companions),
) -> Checked<TermLaw> {
    let (field, growing, companions) = weight;
    let mut builder = Builder::new(env, place);
    let root = builder.expr(expr).filter(|value| builder.no_tests(expr, *value, name).is_some());
    let mut diagnostics = std::mem::take(&mut builder.diagnostics);
    let Some(root) = root else { return Checked { value: None, diagnostics } };
    let mut graph = builder.graph;
    let weight = graph.leaf(Leaf::Field { field, side: Side::Here, op: FieldOp::Value, role: Role::Current });
    let root = graph.reshape(root, graph.shape(weight));
    let weighted = graph.inner(root, weight);
    let growing = growing
        .map(|field| graph.leaf(Leaf::Field { field, side: Side::Here, op: FieldOp::Value, role: Role::Current }));
    let law = gradient_of(env, place, name, graph, (weighted, growing, companions));
    let value = law.map_err(|none| diagnostics.push(refused(env, place, expr, &none))).ok();
    Checked { value, diagnostics }
}

/// The derivative of a term along a direction, which is the values of the companions: a residual in the test functions of
/// the term.
#[must_use]
pub fn compile_term_along(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    source: TermSource<'_>,
    companions: Companions,
) -> Checked<TermLaw> {
    let Checked { value, mut diagnostics } = listing_of(env, place, source);
    let Some(Listing { mut graph, residual: Some(residual), .. }) = value else {
        return Checked { value: None, diagnostics };
    };
    let motion = companions.motion(env, Role::Current);
    let moved = derive(&mut graph, residual, &mut |g, leaf| {
        let own = companions.along(g, leaf);
        with_mesh(g, leaf, own, motion)
    });
    let law = moved.map(|moved| {
        let residual = grown(&mut graph, moved, Some(residual), motion);
        let tangent = graph.number(0.0);
        law_of(env, place, name, Listing { graph, energy: None, residual: Some(residual), tangent })
    });
    let value = law.map_err(|none| diagnostics.push(refused(env, place, source.text(), &none))).ok();
    Checked { value, diagnostics }
}

/// The derivative of an expression along a direction, which is the values of the companions; `None` where nothing moves it.
#[must_use]
pub fn compile_value_along(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    expr: &Expr,
    companions: Companions,
) -> Checked<Option<ValueLaw>> {
    let mut builder = Builder::new(env, place);
    let root = builder.expr(expr);
    let mut diagnostics = std::mem::take(&mut builder.diagnostics);
    let Some(root) = root else { return Checked { value: None, diagnostics } };
    let mut graph = builder.graph;
    let motion = companions.motion(env, Role::Current);
    let moved = derive(&mut graph, root, &mut |g, leaf| {
        let own = companions.along(g, leaf);
        with_mesh(g, leaf, own, motion)
    });
    let value = match moved {
        Ok(moved) if graph.is_zero(moved) => Some(None),
        Ok(moved) => Some(Some(value_of(env, place, name, graph, moved))),
        Err(none) => {
            diagnostics.push(refused(env, place, expr, &none));
            None
        }
    };
    Checked { value, diagnostics }
}

/// By direction the derivative of an expression in one entry of a field that is the same everywhere; `None` where the
/// expression does not change with it.
#[must_use]
pub fn compile_slopes(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    expr: &Expr,
    directions: &[(FieldId, usize)],
) -> Checked<Vec<Option<ValueLaw>>> {
    slopes_in(env, place, name, (expr, directions.len()), &|g, leaf, k| {
        let (moving, entry) = directions[k];
        let is_moving = matches!(leaf, Leaf::Field { field, role: Role::Current, .. } if field == moving);
        is_moving.then(|| unit(g, leaf, entry))
    })
}

/// The derivatives of an expression along several directions, each of which says what leaves move by.
fn slopes_in(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    of: (&Expr, usize),
    moved: &dyn Fn(&mut Graph, Leaf, usize) -> Option<ExprId>,
) -> Checked<Vec<Option<ValueLaw>>> {
    let (expr, n) = of;
    let mut builder = Builder::new(env, place);
    let root = builder.expr(expr);
    let mut diagnostics = std::mem::take(&mut builder.diagnostics);
    let Some(root) = root else { return Checked { value: None, diagnostics } };
    let mut graph = builder.graph;
    let mut laws = Vec::with_capacity(n);
    for k in 0..n {
        match derive(&mut graph, root, &mut |g, leaf| moved(g, leaf, k)) {
            Ok(slope) if graph.is_zero(slope) => laws.push(None),
            Ok(slope) => laws.push(Some(value_of(env, place, name, graph.clone(), slope))),
            Err(none) => {
                diagnostics.push(refused(env, place, expr, &none));
                return Checked { value: None, diagnostics };
            }
        }
    }
    Checked { value: Some(laws), diagnostics }
}

/// One at an entry of a leaf, zero at the others.
fn unit(g: &mut Graph, leaf: Leaf, entry: usize) -> ExprId {
    let shape = g.leaf_shape(leaf);
    let values: Vec<f64> = (0..shape.len()).map(|k| f64::from(u8::from(k == entry))).collect();
    g.constant(shape, &values)
}

/// The law whose fluxes are the derivatives of a number.
fn gradient_of(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    mut graph: Graph,
    of: (ExprId, Option<ExprId>, Companions),
) -> Result<TermLaw, NoDerivative> {
    let (number, growing, companions) = of;
    let motion = companions.motion(env, Role::Test);
    let moved = derive(&mut graph, number, &mut |g, leaf| {
        let own = companions.moved(g, leaf);
        with_mesh(g, leaf, own, motion)
    })?;
    let residual = grown(&mut graph, moved, growing, motion);
    let tangent = graph.number(0.0);
    Ok(law_of(env, place, name, Listing { graph, energy: None, residual: Some(residual), tangent }))
}

/// What a leaf moves by on its own and with the mesh.
fn with_mesh(g: &mut Graph, leaf: Leaf, own: Option<ExprId>, motion: Option<Motion<'_>>) -> Option<ExprId> {
    match (own, motion.and_then(|motion| motion.of_leaf(g, leaf))) {
        (Some(own), Some(with)) => Some(g.add(own, with)),
        (own, with) => own.or(with),
    }
}

/// A derivative, and what the growth of the region adds to the integral of `growing`.
fn grown(g: &mut Graph, moved: ExprId, growing: Option<ExprId>, motion: Option<Motion<'_>>) -> ExprId {
    let (Some(growing), Some(motion)) = (growing, motion) else { return moved };
    match motion.growth(g) {
        Some(growth) => {
            let more = g.scale(growth, growing);
            g.add(moved, more)
        }
        None => moved,
    }
}

/// By how much of itself a region grows along a direction, at its points; `None` for points and where the mesh does not move.
#[must_use]
pub fn compile_growth_along(env: &Env<'_>, place: &PlaceSig, name: &str, companions: Companions) -> Option<ValueLaw> {
    let mut graph = Builder::new(env, place).graph;
    let growth = companions.motion(env, Role::Current)?.growth(&mut graph)?;
    Some(value_of(env, place, name, graph, growth))
}

/// By direction of space the derivative of an expression in the position; `None` where it does not change with it.
#[must_use]
pub fn compile_position_slopes(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    expr: &Expr,
) -> Checked<Vec<Option<ValueLaw>>> {
    let dim = env.dim;
    slopes_in(env, place, name, (expr, dim), &|g, leaf, k| (leaf == Leaf::X).then(|| unit(g, leaf, k)))
}

/// The message about an expression that has no second derivative.
fn refused(env: &Env<'_>, place: &PlaceSig, text: &Expr, none: &NoDerivative) -> Diagnostic {
    let d = Diagnostic::new(Code::E111, format!("`{}` has no second derivative here", none.what));
    Builder::new(env, place).at(d, text, "the derivative of a result in a parameter needs it")
}

/// What the kinks of a law compare: the two sides of each comparison, entry by entry, and norm and radius of each
/// projection. A kink lies where both are one number.
#[derive(Clone, Debug)]
pub struct KinkSides {
    /// `[side, other side, magnitude of what they are made of]` of one kink after the other.
    pub law: ValueLaw,
    /// What each of them is.
    pub kinds: Vec<KinkKind>,
    /// What they move by; `None` where it was not asked for, or where there is no derivative.
    pub motion: Option<KinkMotion>,
}

/// What the kinks of a law move by along a direction, which is the values of the companions. A comparison moves by what its sides
/// do, a projection by the entries of its vector and by its radius. Where all of these are the same on both sides along
/// every direction, nothing leads to one side of the kink rather than to the other.
#[derive(Clone, Debug)]
pub struct KinkMotion {
    /// `[what a side moves by, what the other side does, magnitude of what they are made of]` of one pair after the other.
    pub law: ValueLaw,
    /// By kink how many pairs it has.
    pub pairs: Vec<usize>,
}

/// The sides of the kinks of a term that move with the unknowns; `None` without such kinks.
#[must_use]
pub fn compile_term_kink_sides(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    source: TermSource<'_>,
    companions: Companions,
) -> Option<KinkSides> {
    let listing = listing_of(env, place, source).value?;
    sides_of(env, place, name, (listing.graph, listing.residual?), Some(companions))
}

/// The sides of the kinks of an expression that move with the unknowns; `None` without such kinks.
#[must_use]
pub fn compile_value_kink_sides(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    expr: &Expr,
    companions: Option<Companions>,
) -> Option<KinkSides> {
    let mut builder = Builder::new(env, place);
    let root = builder.expr(expr)?;
    sides_of(env, place, name, (builder.graph, root), companions)
}

fn sides_of(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    of: (Graph, ExprId),
    companions: Option<Companions>,
) -> Option<KinkSides> {
    let (mut graph, root) = of;
    let (mut kinds, mut sides, mut known) = (Vec::new(), Vec::new(), BTreeSet::new());
    let mut moving: Vec<Vec<Pair>> = Vec::new();
    for e in graph.reachable(root) {
        match *graph.node(e) {
            Node::Ball(v, r) if graph.depends(v).unknown || graph.depends(r).unknown => {
                kinds.push(KinkKind::Ball);
                let (norm, radius) = (graph.norm(v), graph.to_scalar(r));
                sides.extend([norm, radius]);
                let entries = (0..graph.shape(v).len()).map(|entry| Pair { side: v, other: None, entry });
                moving.push(entries.chain([Pair { side: radius, other: None, entry: 0 }]).collect());
            }
            Node::Select(mask, ..) if graph.depends(mask).unknown && known.insert(mask) => {
                for (a, b) in compared(&graph, mask) {
                    for k in 0..graph.shape(a).len() {
                        kinds.push(KinkKind::Select);
                        let pair = [graph.entry(a, k), graph.entry(b, k)];
                        sides.extend(pair);
                        moving.push(vec![Pair { side: a, other: Some(b), entry: k }]);
                    }
                }
            }
            _ => {}
        }
    }
    let law = sides_law(env, place, name, &graph, &sides)?;
    let motion = companions.and_then(|companions| motion_of(env, place, name, (graph, &moving), companions));
    Some(KinkSides { law, kinds, motion })
}

/// An entry of a node, and the same of another one; of one that stands alone, and zero.
struct Pair {
    side: ExprId,
    other: Option<ExprId>,
    entry: usize,
}

/// What the pairs of each kink move by.
fn motion_of(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    of: (Graph, &[Vec<Pair>]),
    companions: Companions,
) -> Option<KinkMotion> {
    let (mut graph, moving) = of;
    let motion = companions.motion(env, Role::Current);
    let mut sides = Vec::new();
    for Pair { side, other, entry } in moving.iter().flatten() {
        for side in [Some(*side), *other] {
            let moved = match side {
                Some(side) => {
                    let moved = derive(&mut graph, side, &mut |g, leaf| {
                        // the past of a rate moves with what was before: what it is now tells enough
                        let is_history = matches!(leaf, Leaf::Field { role: Role::History(_), .. });
                        let own = if is_history { None } else { companions.along(g, leaf) };
                        with_mesh(g, leaf, own, motion)
                    });
                    let moved = moved.ok()?;
                    graph.entry(moved, *entry)
                }
                None => graph.number(0.0),
            };
            sides.push(moved);
        }
    }
    let law = sides_law(env, place, name, &graph, &sides)?;
    Some(KinkMotion { law, pairs: moving.iter().map(Vec::len).collect() })
}

/// The comparisons that a mask is made of.
fn compared(graph: &Graph, mask: ExprId) -> Vec<(ExprId, ExprId)> {
    match *graph.node(mask) {
        Node::Compare(_, a, b) if graph.depends(mask).unknown => vec![(a, b)],
        Node::And(a, b) | Node::Or(a, b) => [compared(graph, a), compared(graph, b)].concat(),
        Node::Not(a) => compared(graph, a),
        _ => Vec::new(),
    }
}
