//! Projections of a law and its frozen form: what Newton's method linearises at contact points.
//!
//! Every [`pos_part`](crate::functions), in whatever words, and `Ball_projection` of an unknown is the projection of an
//! argument `x` on a half-line or a ball: `t = P(x)`. For any `c > 0` the same equation reads `t = P(t + c (x - t))` (the
//! scaling of a normal cone), and Newton's method on `t` and the unknowns together, with `t` eliminated at each point, picks
//! its branches from `t + c (x - t)` in place of `x`. With `c` chosen so that `c dx/du` is about the stiffness of the
//! bodies this is the primal-dual active set method (Alart and Curnier 1991; Hintermüller, Ito and Kunisch 2002),
//! whatever the penalty, Nitsche or augmentation parameter in `x`: a point that slipped one way is tried as sticking
//! before it slips the other way, and two-cycles do not arise.
//!
//! Here the projections are found and the term is compiled a second time with each of them frozen on its branch, an affine
//! function of its argument; inside a function that may have no value there they stay as written (`frozen/as_written.rs`). Which branch that is the numbers of [`branch`](crate::branch) say, inputs that the runtime
//! fills in (`runtime/contact`). A converged state solves the term as written: only the path to it changes.

mod as_written;
mod half_lines;

pub(crate) use half_lines::active_code;
mod parameters;
mod pressing;
mod slopes;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    branch::{BranchLayout, BranchSizes, ProjectionKind},
    build::Env,
    compare::Compare,
    graph::{ExprId, Graph, Leaf, Node, Role},
    law::{Listing, TermLaw, ValueLaw},
    ops::rebuild,
    term::{law_of, tangent_of},
    types::{FieldId, FieldKind, FieldOp, FieldSig, PlaceSig, Shape, Side},
};

pub use parameters::{ScaledPart, Scaling, scaling_parameters};
use slopes::watch_law;
pub use slopes::{ArgumentSlope, SlopesLaw};

/// One projection of a law.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    /// On what.
    pub kind: ProjectionKind,
    /// Entries of its argument.
    pub n: usize,
    /// Where its branch stands among the numbers of a point.
    pub branch: BranchLayout,
    /// Its first output in the watch law: the argument (n), the radius (balls only), the value p on its branch (n).
    pub output: usize,
    /// Its value is a force of the term; false if it is used for nothing but the radius of balls, as a part of a
    /// friction bound is that is no gap, and for an aperture beside a half line that presses (`frozen/pressing.rs`).
    pub acts: bool,
}

impl Projection {
    /// How many outputs of the watch law it has.
    fn outputs(&self) -> usize {
        match self.kind {
            ProjectionKind::HalfLine => 2 * self.n,
            ProjectionKind::Ball => 2 * self.n + 1,
        }
    }
}

/// A term whose projections are frozen on branches.
#[derive(Clone, Debug)]
pub struct FrozenLaw {
    /// The field of the branches: one node at each integration point. That of the regularisation, one node for the whole
    /// term, has the next number.
    pub field: FieldId,
    /// Numbers of the branches at a point, and of the regularisation.
    pub sizes: BranchSizes,
    /// The projections, inner ones first.
    pub projections: Vec<Projection>,
    /// The frozen form of the term; reads the branches.
    pub law: TermLaw,
    /// Arguments, radii and values of all projections; reads the branches.
    pub watch: ValueLaw,
    /// The argument of each projection, in the graph of the listing of `law`.
    arguments: Vec<ExprId>,
    /// All outputs of the watch law as one vector, in the same graph.
    watched: ExprId,
    /// The fields of the scene and the two of the branches.
    fields: Vec<FieldSig>,
}

impl FrozenLaw {
    /// Fields that a law has behind those of the scene: branches, and regularisation.
    pub const FIELDS: usize = 2;
}

/// A projection in the graph of a term.
struct Found {
    /// Its node.
    node: ExprId,
    /// What is projected.
    argument: ExprId,
    projection: Projection,
}

/// Compiles the frozen form of a term; `None` if no projection moves with the unknowns, or if no derivative exists.
#[must_use]
pub fn compile_frozen(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    listing: &Listing,
    field: FieldId,
) -> Option<FrozenLaw> {
    let root = listing.residual?;
    let rewritten = half_lines::rewritten(&listing.graph, root, env.fields);
    let (from, root) = rewritten.as_ref().map_or((&listing.graph, root), |(graph, root)| (graph, *root));
    let order = from.reachable(root);
    let (mut found, kept) = projections(from, root, &order);
    pressing::leave_pressing(from, root, env.fields, &mut found);
    let sizes = found.last().map(|f| f.projection.branch.end())?;
    let fields = with_branches(env.fields, field, sizes);
    let env = Env { fields: &fields, ..*env };
    let mut g = Graph::new(from.dim, &fields);
    g.moves = from.moves;
    let leaf = |field| Leaf::Field { field, side: Side::Here, op: FieldOp::Value, role: Role::Current };
    let data =
        BranchData { branches: g.leaf(leaf(field)), regularisation: g.leaf(leaf(FieldId::new(field.index() + 1))) };
    let kept = as_written::copies(from, &order, &kept, &mut g);
    let Frozen { residual, watched, arguments } = freeze(from, &order, &found, &kept, &mut g, data)?;
    let watched = g.stack(Shape::vector(watched.len()), &watched);
    let watch = watch_law(&env, place, &format!("{name}.watch"), g.clone(), (watched, &arguments))?;
    let tangent = tangent_of(&mut g, &fields, residual).ok()?;
    let listing = Listing { graph: g, energy: None, residual: Some(residual), tangent };
    let law = law_of(&env, place, &format!("{name}.frozen"), listing);
    let projections = found.into_iter().map(|f| f.projection).collect();
    Some(FrozenLaw { field, sizes, projections, law, watch, arguments, watched, fields })
}

/// The nodes that are projections which move with the unknowns: on what, and their arguments.
fn candidates(g: &Graph, order: &[ExprId]) -> BTreeMap<ExprId, (ProjectionKind, ExprId)> {
    let half_lines = half_lines(g, order);
    let moves = |v: ExprId| g.depends(v).unknown;
    let candidate = |e: &ExprId| match *g.node(*e) {
        Node::Select(mask, x, _) if half_lines.contains(&(mask, *e)) => Some((*e, (ProjectionKind::HalfLine, x))),
        Node::Ball(v, r) if moves(v) || moves(r) => Some((*e, (ProjectionKind::Ball, v))),
        _ => None,
    };
    order.iter().filter_map(candidate).collect()
}

/// The projections of a term that are frozen, inner ones first, and the nodes that keep those inside them as written.
fn projections(g: &Graph, root: ExprId, order: &[ExprId]) -> (Vec<Found>, BTreeSet<ExprId>) {
    let candidates = candidates(g, order);
    let kept = as_written::nodes(g, order, &|e| candidates.contains_key(&e));
    let acting = uses(root, &|e| match *g.node(e) {
        Node::Ball(v, _) => vec![v],
        _ => operands(g, e, &kept),
    });
    let used = uses(root, &|e| operands(g, e, &kept));
    let (mut first, mut output) = (BranchSizes::default(), 0);
    let mut found: Vec<Found> = Vec::new();
    for e in order.iter().filter(|e| used[e.index()]) {
        let Some(&(kind, argument)) = candidates.get(e) else { continue };
        let n = g.shape(argument).len();
        let branch = BranchLayout::new(kind, n, first);
        let projection = Projection { kind, n, branch, output, acts: acting[e.index()] };
        first = branch.end();
        output += projection.outputs();
        found.push(Found { node: *e, argument, projection });
    }
    (found, kept)
}

/// The fields with those of the branches and of the regularisation at their places; places between are not used by the
/// law.
fn with_branches(fields: &[FieldSig], field: FieldId, sizes: BranchSizes) -> Vec<FieldSig> {
    let data = |shape: Shape| FieldSig {
        name: String::new(),
        shape,
        degree: 0,
        kind: FieldKind::Data,
        global: false,
        on_faces: false,
    };
    let mut all = fields.to_vec();
    all.resize_with(field.index(), || data(Shape::SCALAR));
    all.push(data(Shape::vector(sizes.point)));
    all.push(FieldSig { global: true, ..data(Shape::vector(sizes.term)) });
    all
}

/// What is frozen below a node: its operands, none of one that keeps them as written.
fn operands(g: &Graph, e: ExprId, kept: &BTreeSet<ExprId>) -> Vec<ExprId> {
    let mut list = Vec::new();
    if !kept.contains(&e) {
        g.node(e).for_each_operand(|o| list.push(o));
    }
    list
}

/// By node: whether the root is made of it, if a node is made of what `of` gives for it. Of a ball that may leave out its radius:
/// a projection that stands there alone does not act.
fn uses(root: ExprId, of: &dyn Fn(ExprId) -> Vec<ExprId>) -> Vec<bool> {
    let mut used = vec![false; root.index() + 1];
    used[root.index()] = true;
    for k in (0..used.len()).rev().map(ExprId::new) {
        if used[k.index()] {
            of(k).into_iter().for_each(|o| used[o.index()] = true);
        }
    }
    used
}

/// Selections `0 <= x ? x : 0` or `0 < x ? x : 0`, one for each mask: `(mask, selection)`.
fn half_lines(g: &Graph, order: &[ExprId]) -> BTreeSet<(ExprId, ExprId)> {
    let mut found: BTreeMap<ExprId, ExprId> = BTreeMap::new();
    for e in order {
        if let Node::Select(mask, a, b) = *g.node(*e)
            && let Node::Compare(Compare::LessEqual | Compare::Less, zero, x) = *g.node(mask)
            && a == x
            && g.is_zero(b)
            && g.is_zero(zero)
            && g.depends(x).unknown
        {
            found.insert(mask, *e);
        }
    }
    found.into_iter().collect()
}

/// The frozen form of a term, in the graph that is made for it.
struct Frozen {
    residual: ExprId,
    /// Arguments, radii and values, in the order of the outputs of the watch law.
    watched: Vec<ExprId>,
    /// The argument of each projection.
    arguments: Vec<ExprId>,
}

/// What branches are read from.
#[derive(Clone, Copy)]
struct BranchData {
    /// The numbers of a point.
    branches: ExprId,
    /// The numbers of the term.
    regularisation: ExprId,
}

/// The residual on branches, and what is watched of each projection. Of some nodes there are copies already.
fn freeze(
    from: &Graph,
    order: &[ExprId],
    found: &[Found],
    kept: &BTreeMap<ExprId, ExprId>,
    g: &mut Graph,
    data: BranchData,
) -> Option<Frozen> {
    let masks = frozen_masks(from, found, g, data);
    let mut watched = Vec::new();
    let mut copied: BTreeMap<ExprId, ExprId> = BTreeMap::new();
    // the same without overstress: what radii are made of
    let mut plain: BTreeMap<ExprId, ExprId> = BTreeMap::new();
    for e in order {
        let before = g.set_origin(from.origin(*e));
        let projection = found.iter().find(|f| f.node == *e).map(|f| f.projection);
        let (made, without) = match (masks.get(e).or(kept.get(e)), projection, from.node(*e)) {
            (Some(made), _, _) => (*made, *made),
            (_, Some(p), Node::Ball(v, r)) => {
                let radius = g.to_scalar(plain[r]);
                let ball = frozen_ball(g, data, p, copied[v], radius);
                watched.extend((0..p.n).map(|k| g.entry(copied[v], k)));
                watched.push(radius);
                watched.extend((0..p.n).map(|k| g.entry(ball.branch, k)));
                (ball.value, ball.branch)
            }
            (_, Some(p), Node::Select(_, x, _)) => {
                let chosen = rebuild(from, *e, g, &[], &|o: ExprId| copied[&o]);
                let [compliance, overstress] =
                    [p.branch.compliance(), p.branch.overstress()].map(|at| g.entry(data.regularisation, at));
                let branch = soften(g, compliance, chosen);
                let softened = soften(g, compliance, copied[x]);
                watched.extend((0..p.n).map(|k| g.entry(copied[x], k)));
                watched.extend((0..p.n).map(|k| g.entry(branch, k)));
                (exceed(g, overstress, softened, branch), branch)
            }
            _ => {
                let made = rebuild(from, *e, g, &[], &|o: ExprId| copied[&o]);
                (made, rebuild(from, *e, g, &[], &|o: ExprId| plain[&o]))
            }
        };
        g.set_origin(before);
        copied.insert(*e, made);
        plain.insert(*e, without);
    }
    let residual = *copied.get(order.last()?)?;
    let arguments = found.iter().map(|f| copied[&f.argument]).collect();
    Some(Frozen { residual, watched, arguments })
}

/// The masks of half-lines, read from the numbers of a point.
fn frozen_masks(from: &Graph, found: &[Found], g: &mut Graph, data: BranchData) -> BTreeMap<ExprId, ExprId> {
    let mut masks = BTreeMap::new();
    for Found { node, projection: p, .. } in found {
        if let (ProjectionKind::HalfLine, Node::Select(mask, x, _)) = (p.kind, from.node(*node)) {
            let numbers: Vec<ExprId> = (0..p.n).map(|k| g.entry(data.branches, p.branch.mask(k))).collect();
            let numbers = g.stack(from.shape(*x), &numbers);
            masks.insert(*mask, switched_on(g, numbers));
        }
    }
    masks
}

fn switched_on(g: &mut Graph, numbers: ExprId) -> ExprId {
    let shape = g.shape(numbers);
    let half = g.constant(shape, &vec![0.5; shape.len()]);
    g.compare(Compare::LessEqual, half, numbers)
}

/// (1 - compliance) x.
fn soften(g: &mut Graph, compliance: ExprId, x: ExprId) -> ExprId {
    let lost = g.scale(compliance, x);
    g.sub(x, lost)
}

/// p + overstress (x - p).
fn exceed(g: &mut Graph, overstress: ExprId, x: ExprId, branch: ExprId) -> ExprId {
    let beyond = g.sub(x, branch);
    let beyond = g.scale(overstress, beyond);
    g.add(branch, beyond)
}

/// A ball on its branch, and its value.
struct FrozenBall {
    branch: ExprId,
    value: ExprId,
}

fn frozen_ball(g: &mut Graph, data: BranchData, p: Projection, x: ExprId, radius: ExprId) -> FrozenBall {
    let shape = g.shape(x);
    let at = p.branch;
    let [stick, factor] = [at.mask(0), at.across()].map(|k| g.entry(data.branches, k));
    let [friction, compliance, overstress] =
        [at.friction(), at.compliance(), at.overstress()].map(|k| g.entry(data.regularisation, k));
    let x = soften(g, compliance, x);
    let along: Vec<ExprId> = (0..p.n).map(|k| g.entry(data.branches, at.along(k))).collect();
    let along = g.stack(shape, &along);
    let part = g.inner(along, x);
    let part = g.scale(part, along);
    let across = g.sub(x, part);
    let across = g.scale(factor, across);
    let radius = g.mul_components(friction, radius);
    let limit = g.scale(radius, along);
    let slip = g.add(limit, across);
    let stick = switched_on(g, stick);
    let branch = g.select(stick, x, slip);
    FrozenBall { branch, value: exceed(g, overstress, x, branch) }
}
