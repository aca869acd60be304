//! `Print(e)` in a term: its value as a law of its own, to be shown at the points of the term.

use crate::{
    build::Env,
    graph::Node,
    ir::Origin,
    law::{Listing, ValueLaw},
    term::value_of,
    types::PlaceSig,
};

/// One `Print` of a term.
#[derive(Clone, Debug)]
pub struct PrintLaw {
    /// Where it was written.
    pub origin: Option<Origin>,
    /// Its value.
    pub law: ValueLaw,
}

/// The laws of every `Print` of a term that does not hold a test function.
#[must_use]
pub fn compile_prints(env: &Env<'_>, place: &PlaceSig, name: &str, listing: &Listing) -> Vec<PrintLaw> {
    let g = &listing.graph;
    let Some(root) = listing.energy.or(listing.residual) else { return Vec::new() };
    let mut out = Vec::new();
    for e in g.reachable(root) {
        if let Node::Print(value) = *g.node(e)
            && !g.arity(value).test
            && !g.arity(value).trial
        {
            let law = value_of(env, place, &format!("{name}.print"), g.clone(), value);
            out.push(PrintLaw { origin: g.origin(e), law });
        }
    }
    out
}
