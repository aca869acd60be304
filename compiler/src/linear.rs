//! What is affine in the fields that it reads, and its derivatives there: of the past and of measures the runtime then makes
//! matrices and vectors once in place of evaluations at points in every step.
//!
//! Promises: a law that is called affine is so at every point, whatever the numbers are; a derivative is the one that the
//! rules of [`crate::derive`] give.

use wfl::ast::Expr;

use crate::{
    build::{Builder, Env},
    derive::derive,
    graph::{ExprId, Graph, Leaf, Role},
    ir::{Inst, VerifiedKernel},
    law::{Class, Listing, TermLaw},
    term::{law_of, law_with},
    types::{FieldSig, PlaceSig, RateOrder},
};

/// The state at which a law reads a field that is solved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reading {
    /// The present one.
    Current,
    /// That at the end of the previous step.
    Previous,
    /// What the past alone gives of a rate.
    History(RateOrder),
}

impl Reading {
    fn role(self) -> Role {
        match self {
            Self::Current => Role::Current,
            Self::Previous => Role::Previous,
            Self::History(order) => Role::History(order),
        }
    }
}

/// How a number depends on the inputs that move.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Dependence {
    /// Not at all.
    Fixed,
    /// With slopes that do not move.
    Affine,
    /// In another way, or it is not known.
    Other,
}

/// True if the outputs of a kernel are affine in the inputs for which `moves` holds (by input slot), with slopes that do not
/// read them. False where that does not show in the instructions.
#[must_use]
pub fn is_affine(kernel: &VerifiedKernel, moves: impl Fn(usize) -> bool) -> bool {
    use Dependence::{Affine, Fixed, Other};
    let kernel = kernel.kernel();
    let mut found: Vec<Dependence> = Vec::with_capacity(kernel.insts.len());
    for inst in &kernel.insts {
        let of = |v: &crate::ir::Val| found[v.index()];
        let dependence = match inst {
            Inst::Input(slot) if moves(*slot as usize) => Affine,
            Inst::Add(a, b) | Inst::Sub(a, b) => of(a).max(of(b)),
            Inst::Neg(a) => of(a),
            Inst::Mul(a, b) => match (of(a), of(b)) {
                (Fixed, other) | (other, Fixed) => other,
                _ => Other,
            },
            Inst::Div(a, b) if of(b) == Fixed => of(a),
            Inst::Select(mask, a, b) if of(mask) == Fixed => of(a).max(of(b)),
            _ => {
                let mut is_fixed = true;
                inst.for_each_operand(|v| is_fixed &= of(&v) == Fixed);
                if is_fixed { Fixed } else { Other }
            }
        };
        found.push(dependence);
    }
    kernel.outputs.iter().all(|v| found[v.index()] <= Affine)
}

/// The derivative of a term in the unknowns as it reads them at a state: a law whose tangent it is. `None` where it is zero,
/// where there is none, and where it depends on a state.
#[must_use]
pub fn compile_linear_part(fields: &[FieldSig], law: &TermLaw, reading: Reading) -> Option<TermLaw> {
    let mut graph = law.listing.graph.clone();
    let tangent = along(&mut graph, fields, law.listing.residual?, (reading, Role::Trial))?;
    let name = format!("{}.{reading:?}", law.name);
    let made = law_with(fields, &name, Listing { graph, energy: None, residual: None, tangent }, law.degree);
    (made.class == Class::Linear && !made.tangent_reads_known).then_some(made)
}

/// The derivative of an expression in the unknowns as it reads them at a state: a law whose residual it is. `None` where it is
/// zero, and where there is none.
#[must_use]
pub fn compile_value_weights(
    env: &Env<'_>,
    place: &PlaceSig,
    name: &str,
    expr: &Expr,
    reading: Reading,
) -> Option<TermLaw> {
    let mut builder = Builder::new(env, place);
    let root = builder.expr(expr)?;
    let mut graph = builder.graph;
    if !graph.shape(root).is_scalar_like() {
        return None;
    }
    let root = graph.to_scalar(root);
    let residual = along(&mut graph, env.fields, root, (reading, Role::Test))?;
    let tangent = graph.number(0.0);
    Some(law_of(env, place, name, Listing { graph, energy: None, residual: Some(residual), tangent }))
}

/// The derivative of a root where the unknowns, as they are read at a state, move by functions of a role; `None` for zero.
fn along(g: &mut Graph, fields: &[FieldSig], root: ExprId, by: (Reading, Role)) -> Option<ExprId> {
    let (reading, functions) = by;
    let moved = derive(g, root, &mut |g, leaf| match leaf {
        Leaf::Field { field, side, op, role } if role == reading.role() && fields[field.index()].is_unknown() => {
            Some(g.leaf(Leaf::Field { field, side, op, role: functions }))
        }
        _ => None,
    });
    moved.ok().filter(|moved| !g.is_zero(*moved))
}
