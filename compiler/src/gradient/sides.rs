//! Laws of derivatives to one side: along a direction, on the branches that it leads to where a point is between two.
//!
//! Such a law is a residual in what the unknowns move by (the values of their companions), with its own tangent: linear
//! pieces as a rule, so that Newton's method on it finds what the unknowns do to one side. Behind the fields stands one more,
//! the same at all points, with a tolerance for each kink.

use wfl::{Checked, Diagnostic, ast::Expr};

use super::{Companions, refused};
use crate::{
    build::{Builder, Env},
    derive::{NoDerivative, Ties, derive, derive_to_side},
    graph::{ExprId, Graph, Leaf, Role},
    law::{Listing, TermLaw, ValueLaw},
    term::{TermSource, law_of, listing_of, sides_law, value_of},
    types::{FieldId, FieldOp, FieldSig, PlaceSig, Side},
};

/// A law to one side.
#[derive(Clone, Debug)]
pub struct ToSide<L> {
    /// The law.
    pub law: L,
    /// `[side, other side]` of one kink after the other; `None` without any that moves.
    pub sides: Option<ValueLaw>,
}

/// How many kinks a term has at most: so many tolerances [`compile_term_to_side`] needs.
#[must_use]
pub fn kinks_of_term(env: &Env<'_>, place: &PlaceSig, source: TermSource<'_>) -> usize {
    let listing = listing_of(env, place, source).value;
    listing.and_then(|l| Some(Ties::most(&l.graph, l.residual?))).unwrap_or(0)
}

/// The same for [`compile_value_to_side`].
#[must_use]
pub fn kinks_of_value(env: &Env<'_>, place: &PlaceSig, expr: &Expr) -> usize {
    let mut builder = Builder::new(env, place);
    builder.expr(expr).map_or(0, |root| Ties::most(&builder.graph, root))
}

fn tolerances(g: &mut Graph, field: FieldId) -> Ties {
    Ties::new(g.leaf(Leaf::Field { field, side: Side::Here, op: FieldOp::Value, role: Role::Current }))
}

/// The derivative of a term to one side, and the tangent of that in what the unknowns move by. `ties` is the field of the
/// tolerances.
#[must_use]
pub fn compile_term_to_side(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    source: TermSource<'_>,
    of: (Companions, FieldId),
) -> Checked<ToSide<TermLaw>> {
    let Checked { value, mut diagnostics } = listing_of(env, place, source);
    let Some(Listing { mut graph, residual: Some(residual), .. }) = value else {
        return Checked { value: None, diagnostics };
    };
    let made = term_to_side(env.fields, &mut graph, residual, of);
    let value = made.map_err(|none| diagnostics.push(refused(env, place, source.text(), &none))).ok();
    let value = value.map(|(residual, tangent, sides)| ToSide {
        sides: sides_law(env, place, name, &graph, &sides),
        law: law_of(env, place, name, Listing { graph, energy: None, residual: Some(residual), tangent }),
    });
    Checked { value, diagnostics }
}

type Sides = Vec<ExprId>;

fn term_to_side(
    fields: &[FieldSig],
    graph: &mut Graph,
    residual: ExprId,
    of: (Companions, FieldId),
) -> Result<(ExprId, ExprId, Sides), NoDerivative> {
    let (companions, field) = of;
    let mut ties = tolerances(graph, field);
    let moved = derive_to_side(graph, residual, &mut |g, leaf| companions.along(g, leaf), &mut ties)?;
    let tangent = derive(graph, moved, &mut |g, leaf| match leaf {
        Leaf::Field { field, side, op, role: Role::Current } => {
            let own = field.index().checked_sub(companions.n_fields).filter(|own| *own < companions.n_fields)?;
            let trial = Leaf::Field { field: FieldId::new(own), side, op, role: Role::Trial };
            fields[own].is_unknown().then(|| g.leaf(trial))
        }
        _ => None,
    })?;
    Ok((moved, tangent, ties.sides))
}

/// The derivative of an expression to one side; `None` where nothing moves it.
#[must_use]
pub fn compile_value_to_side(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    expr: &Expr,
    of: (Companions, FieldId),
) -> Checked<Option<ToSide<ValueLaw>>> {
    let (companions, field) = of;
    let mut builder = Builder::new(env, place);
    let root = builder.expr(expr);
    let mut diagnostics: Vec<Diagnostic> = std::mem::take(&mut builder.diagnostics);
    let Some(root) = root else { return Checked { value: None, diagnostics } };
    let mut graph = builder.graph;
    let mut ties = tolerances(&mut graph, field);
    let value = match derive_to_side(&mut graph, root, &mut |g, leaf| companions.along(g, leaf), &mut ties) {
        Ok(moved) if graph.is_zero(moved) => Some(None),
        Ok(moved) => Some(Some(ToSide {
            sides: sides_law(env, place, name, &graph, &ties.sides),
            law: value_of(env, place, name, graph, moved),
        })),
        Err(none) => {
            diagnostics.push(refused(env, place, expr, &none));
            None
        }
    };
    Checked { value, diagnostics }
}
