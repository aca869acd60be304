//! Projections of a law and the law with its pieces held: what Newton's method linearises at contact points.
//!
//! Every [`pos_part`](crate::functions) and `Ball_projection` of an unknown is the projection of an argument `x` on a
//! half-line or a ball: `t = P(x)`. For any `c > 0` the same equation reads `t = P(t + c (x - t))` (the scaling of a
//! normal cone), and Newton's method on `t` and the unknowns together, with `t` eliminated at each point, picks its
//! branches from `t + c (x - t)` in place of `x`. With `c` chosen so that `c dx/du` is about the stiffness of the
//! bodies this is the primal-dual active set method (Alart and Curnier 1991; Hintermüller, Ito and Kunisch 2002),
//! whatever the penalty, Nitsche or augmentation parameter in `x`: a point that slipped one way is tried as sticking
//! before it slips the other way, and two-cycles do not arise.
//!
//! Here the projections are found and the term is compiled a second time with each of them replaced by its held
//! piece, an affine function of its argument whose numbers (*guides*) are inputs; the runtime fills them in
//! (`runtime/contact`). A converged state solves the term as written: only the path to it changes.
//!
//! Pieces, of `x' = (1 - d) x`: half-line, entry by entry: `p = m ? x' : 0`. Ball: `p = s ? x' : f a e + k (x' - e (e.x'))`.
//! The factor `f` on the radius is 1 but for continuation in the friction; `d` is 0 but while contact is soft: with
//! `x = t + d/(1-d) t` the law holds for an argument less a part of the traction, as if a layer lay between the sides.
//! The value is `t = p + w (x' - p)`: `w` is 0 but while traction may exceed its bound, as in a viscoplastic law (Duvaut
//! and Lions 1976) with `x' - t` in place of a velocity. The radius of a ball is made of `p`.
//! Guides: half-line `m (n), d, w`; ball `s, k, f, d, w, e (n)`; masks are 0 or 1.

mod parameters;
mod slopes;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    build::Env,
    compare::Compare,
    graph::{ExprId, Graph, Leaf, Node, Role},
    law::{Listing, TermLaw, ValueLaw},
    ops::rebuild,
    term::{law_of, tangent_of, value_of},
    types::{FieldId, FieldKind, FieldOp, FieldSig, PlaceSig, Shape, Side},
};

pub use parameters::{ScaledPart, Scaling, scaling_parameters};
pub use slopes::{ArgumentSlope, SlopesLaw};

/// The convex set of a projection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProjectionKind {
    /// Numbers that are not negative, for each entry (`pos_part`).
    HalfLine,
    /// A ball (`Ball_projection`).
    Ball,
}

/// Guides of a half-line behind the masks: softness, overstress.
const HALF_LINE_NUMBERS: usize = 2;

/// Guides of a ball before the direction of slip: stick, factor across the direction of slip, factor on the radius,
/// softness, overstress.
pub const BALL_NUMBERS: usize = 5;

/// One projection of a law.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    /// On what.
    pub kind: ProjectionKind,
    /// Entries of its argument.
    pub n: usize,
    /// Its first guide.
    pub guide: usize,
    /// Its first output in the watch law: the argument (n), the radius (balls only), the held piece p (n).
    pub output: usize,
    /// Its value is a force of the term; false if it is used for nothing but the radius of balls, as a part of a
    /// friction bound is that is no gap.
    pub acts: bool,
}

impl Projection {
    /// How many guides it has.
    fn guides(&self) -> usize {
        match self.kind {
            ProjectionKind::HalfLine => self.n + HALF_LINE_NUMBERS,
            ProjectionKind::Ball => BALL_NUMBERS + self.n,
        }
    }

    /// How many outputs of the watch law it has.
    fn outputs(&self) -> usize {
        match self.kind {
            ProjectionKind::HalfLine => 2 * self.n,
            ProjectionKind::Ball => 2 * self.n + 1,
        }
    }
}

/// A term with the pieces of its projections held.
#[derive(Clone, Debug)]
pub struct PiecesLaw {
    /// The field of the guides: one node at each integration point.
    pub field: FieldId,
    /// Guides at a point.
    pub n_guides: usize,
    /// The projections, inner ones first.
    pub projections: Vec<Projection>,
    /// The term with held pieces; reads the guides.
    pub law: TermLaw,
    /// Arguments, radii and values of all projections; reads the guides.
    pub watch: ValueLaw,
    /// The argument of each projection, in the graph of the listing of `law`.
    arguments: Vec<ExprId>,
    /// All outputs of the watch law as one vector, in the same graph.
    watched: ExprId,
    /// The fields of the scene and that of the guides.
    fields: Vec<FieldSig>,
}

/// A projection in the graph of a term.
struct Found {
    /// Its node.
    node: ExprId,
    /// What is projected.
    argument: ExprId,
    projection: Projection,
}

/// Compiles a term with held pieces; `None` if no projection moves with the unknowns, or if no derivative exists.
#[must_use]
pub fn compile_pieces(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    listing: &Listing,
    field: FieldId,
) -> Option<PiecesLaw> {
    let root = listing.residual?;
    let from = &listing.graph;
    let order = from.reachable(root);
    let found = projections(from, root, &order);
    let n_guides = found.last().map(|f| f.projection.guide + f.projection.guides())?;
    let fields = with_guides(env.fields, field, n_guides);
    let env = Env { fields: &fields, ..*env };
    let mut g = Graph::new(from.dim, &fields);
    let guides = g.leaf(Leaf::Field { field, side: Side::Here, op: FieldOp::Value, role: Role::Current });
    let Held { residual, watched, arguments } = hold(from, &order, &found, &mut g, guides)?;
    let watched = g.stack(Shape::vector(watched.len()), &watched);
    let watch = value_of(&env, place, &format!("{name}.watch"), g.clone(), watched);
    let tangent = tangent_of(&mut g, &fields, residual).ok()?;
    let listing = Listing { graph: g, energy: None, residual: Some(residual), tangent };
    let law = law_of(&env, place, &format!("{name}.held"), listing);
    let projections = found.into_iter().map(|f| f.projection).collect();
    Some(PiecesLaw { field, n_guides, projections, law, watch, arguments, watched, fields })
}

/// The projections of a term that move with the unknowns, inner ones first.
fn projections(g: &Graph, root: ExprId, order: &[ExprId]) -> Vec<Found> {
    let half_lines = half_lines(g, order);
    let acting = acting(g, root);
    let moves = |v: ExprId| g.depends(v).unknown;
    let (mut guide, mut output) = (0, 0);
    let mut found: Vec<Found> = Vec::new();
    for e in order {
        let (kind, argument) = match *g.node(*e) {
            Node::Select(mask, x, _) if half_lines.contains(&(mask, *e)) => (ProjectionKind::HalfLine, x),
            Node::Ball(v, r) if moves(v) || moves(r) => (ProjectionKind::Ball, v),
            _ => continue,
        };
        let n = g.shape(argument).len();
        let projection = Projection { kind, n, guide, output, acts: acting[e.index()] };
        guide += projection.guides();
        output += projection.outputs();
        found.push(Found { node: *e, argument, projection });
    }
    found
}

/// The fields with the field of the guides at its place; places between are not used by the law.
fn with_guides(fields: &[FieldSig], field: FieldId, n_guides: usize) -> Vec<FieldSig> {
    let data = |shape: Shape| FieldSig { name: String::new(), shape, degree: 0, kind: FieldKind::Data, global: false };
    let mut all = fields.to_vec();
    all.resize_with(field.index(), || data(Shape::SCALAR));
    all.push(data(Shape::vector(n_guides)));
    all
}

/// By node: whether the root depends on it other than through the radius of a ball.
fn acting(g: &Graph, root: ExprId) -> Vec<bool> {
    let mut acts = vec![false; root.index() + 1];
    acts[root.index()] = true;
    for k in (0..acts.len()).rev() {
        match *g.node(ExprId::new(k)) {
            _ if !acts[k] => {}
            Node::Ball(v, _) => acts[v.index()] = true,
            ref node => node.for_each_operand(|o| acts[o.index()] = true),
        }
    }
    acts
}

/// Selections `0 <= x ? x : 0`, one for each mask: `(mask, selection)`.
fn half_lines(g: &Graph, order: &[ExprId]) -> BTreeSet<(ExprId, ExprId)> {
    let mut found: BTreeMap<ExprId, ExprId> = BTreeMap::new();
    for e in order {
        if let Node::Select(mask, a, b) = *g.node(*e)
            && let Node::Compare(Compare::LessEqual, zero, x) = *g.node(mask)
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

/// A term with held pieces, in the graph that is made for it.
struct Held {
    residual: ExprId,
    /// Arguments, radii and values, in the order of the outputs of the watch law.
    watched: Vec<ExprId>,
    /// The argument of each projection.
    arguments: Vec<ExprId>,
}

/// The residual with held pieces, and what is watched of each projection.
fn hold(from: &Graph, order: &[ExprId], found: &[Found], g: &mut Graph, guides: ExprId) -> Option<Held> {
    let mut copied: BTreeMap<ExprId, ExprId> = BTreeMap::new();
    let mut masks: BTreeMap<ExprId, ExprId> = BTreeMap::new();
    for Found { node, projection: p, .. } in found {
        if let (ProjectionKind::HalfLine, Node::Select(mask, x, _)) = (p.kind, from.node(*node)) {
            let numbers: Vec<ExprId> = (0..p.n).map(|k| g.entry(guides, p.guide + k)).collect();
            let numbers = g.stack(from.shape(*x), &numbers);
            masks.insert(*mask, switched_on(g, numbers));
        }
    }
    let mut watched = Vec::new();
    // the same without overstress: what radii are made of
    let mut plain: BTreeMap<ExprId, ExprId> = BTreeMap::new();
    for e in order {
        let before = g.set_origin(from.origin(*e));
        let projection = found.iter().find(|f| f.node == *e).map(|f| f.projection);
        let (made, without) = match (masks.get(e), projection, from.node(*e)) {
            (Some(mask), _, _) => (*mask, *mask),
            (_, Some(p), Node::Ball(v, r)) => {
                let radius = g.to_scalar(plain[r]);
                let piece = held_ball(g, guides, p, copied[v], radius);
                watched.extend((0..p.n).map(|k| g.entry(copied[v], k)));
                watched.push(radius);
                watched.extend((0..p.n).map(|k| g.entry(piece.held, k)));
                (piece.value, piece.held)
            }
            (_, Some(p), Node::Select(_, x, _)) => {
                let chosen = rebuild(from, *e, g, &[], &|o: ExprId| copied[&o]);
                let [softness, overstress] = [0, 1].map(|k| g.entry(guides, p.guide + p.n + k));
                let held = soften(g, softness, chosen);
                let softened = soften(g, softness, copied[x]);
                watched.extend((0..p.n).map(|k| g.entry(copied[x], k)));
                watched.extend((0..p.n).map(|k| g.entry(held, k)));
                (exceed(g, overstress, softened, held), held)
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
    Some(Held { residual, watched, arguments })
}

fn switched_on(g: &mut Graph, numbers: ExprId) -> ExprId {
    let shape = g.shape(numbers);
    let half = g.constant(shape, &vec![0.5; shape.len()]);
    g.compare(Compare::LessEqual, half, numbers)
}

/// (1 - softness) x.
fn soften(g: &mut Graph, softness: ExprId, x: ExprId) -> ExprId {
    let lost = g.scale(softness, x);
    g.sub(x, lost)
}

/// p + overstress (x - p).
fn exceed(g: &mut Graph, overstress: ExprId, x: ExprId, held: ExprId) -> ExprId {
    let beyond = g.sub(x, held);
    let beyond = g.scale(overstress, beyond);
    g.add(held, beyond)
}

/// The held piece of a ball, and its value.
struct HeldBall {
    held: ExprId,
    value: ExprId,
}

fn held_ball(g: &mut Graph, guides: ExprId, p: Projection, x: ExprId, radius: ExprId) -> HeldBall {
    let shape = g.shape(x);
    let [stick, factor, friction, softness, overstress] = [0, 1, 2, 3, 4].map(|k| g.entry(guides, p.guide + k));
    let x = soften(g, softness, x);
    let along: Vec<ExprId> = (0..p.n).map(|k| g.entry(guides, p.guide + BALL_NUMBERS + k)).collect();
    let along = g.stack(shape, &along);
    let part = g.inner(along, x);
    let part = g.scale(part, along);
    let across = g.sub(x, part);
    let across = g.scale(factor, across);
    let radius = g.mul_components(friction, radius);
    let limit = g.scale(radius, along);
    let slip = g.add(limit, across);
    let stick = switched_on(g, stick);
    let held = g.select(stick, x, slip);
    HeldBall { held, value: exceed(g, overstress, x, held) }
}
