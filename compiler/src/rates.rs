//! What a term multiplies the rates of unknowns by, values held: its mass, and its damping.
//!
//! `Dot_u` and `Dot2_u` are `c (u - Previous_u) + history`, so the derivative in a rate is the one in its history: neither the
//! stiffness of the term nor the scalar c of a scheme is in it, and nothing has to be told from them by numbers. Compiled when it is
//! asked for. Promises: kinks take the branch of the value, as in the tangent. Images of points stay where they are.

use crate::{
    derive::derive,
    graph::{ExprId, Graph, Leaf, Role},
    law::{Listing, TermLaw},
    term::law_with,
    types::{FieldId, RateOrder},
};

/// The derivative of a term in the rates of one order.
#[derive(Clone, Debug)]
pub struct RateLaw {
    /// Its tangent is the derivative; its residual is that times rates of their own, which are the values of fields behind those of
    /// the term.
    pub law: TermLaw,
    /// How many fields the term knows: the rates of field k are the values of field k + n.
    pub n_fields: usize,
}

/// The derivative of a term in the rates of one order; `None` where it is zero.
#[must_use]
pub fn compile_rates(law: &TermLaw, order: RateOrder) -> Option<RateLaw> {
    let residual = law.listing.residual?;
    let mut graph = law.listing.graph.clone();
    let n_fields = graph.add_companions();
    let own = |field: FieldId| (FieldId::new(field.index() + n_fields), Role::Current);
    let product = moved(&mut graph, residual, order, &own)?;
    let tangent = moved(&mut graph, residual, order, &|field| (field, Role::Trial))?;
    let fields = graph.fields();
    let name = format!("{}.{order:?}", law.name);
    let listing = Listing { graph, energy: None, residual: Some(product), tangent };
    Some(RateLaw { law: law_with(&fields, &name, listing, law.degree), n_fields })
}

/// The derivative of a root where rates move by a function of a field, in a role; `None` for zero.
fn moved(g: &mut Graph, root: ExprId, order: RateOrder, by: &dyn Fn(FieldId) -> (FieldId, Role)) -> Option<ExprId> {
    let moved = derive(g, root, &mut |g, leaf| match leaf {
        Leaf::Field { field, side, op, role } if role == Role::History(order) && g.is_unknown(field) => {
            let (field, role) = by(field);
            Some(g.leaf(Leaf::Field { field, side, op, role }))
        }
        _ => None,
    });
    // a term whose tangent exists has this derivative, which is a part of it
    moved.ok().filter(|moved| !g.is_zero(*moved))
}

#[cfg(test)]
mod tests;
