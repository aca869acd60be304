//! Whether a term has a force of its own beside its projections: of a fault under initial stress, or a linear part.
//!
//! Promises: follows the instructions of the frozen form with every branch open, and finds each number that is the same
//! for all inputs. A force that it takes for one may be zero; none is missed.

use wfl_compiler::{
    TermLaw,
    ir::{Inst, Val},
    types::{FieldOp, InputSlot},
};

/// True if the frozen form of a term, whose branches and regularisation are the fields from `branches` on, puts a force on the values of test
/// functions where all branches are open.
pub(super) fn acts_when_open(form: &TermLaw, branches: usize) -> bool {
    let kernel = form.residual.kernel();
    let is_branch =
        |k: u32| matches!(form.inputs.get(k as usize), Some(InputSlot::Field(b)) if b.field.index() >= branches);
    let mut known: Vec<Option<f64>> = Vec::with_capacity(kernel.insts.len());
    for inst in &kernel.insts {
        let made = constant(inst, &known, is_branch);
        known.push(made);
    }
    let outputs = form.tests.iter().zip(&kernel.outputs);
    outputs.filter(|(test, _)| test.op == FieldOp::Value).any(|(_, v)| known[v.index()] != Some(0.0))
}

/// The value of an instruction, where it is the same for all inputs but the branches, which are zero.
fn constant(inst: &Inst, known: &[Option<f64>], is_branch: impl Fn(u32) -> bool) -> Option<f64> {
    let of = |v: &Val| known[v.index()];
    let flag = |holds: bool| f64::from(u8::from(holds));
    match inst {
        Inst::Const(c) => Some(*c),
        Inst::Input(k) => is_branch(*k).then_some(0.0),
        Inst::Add(a, b) => Some(of(a)? + of(b)?),
        Inst::Sub(a, b) => Some(of(a)? - of(b)?),
        Inst::Mul(a, b) => match (of(a), of(b)) {
            (Some(x), _) | (_, Some(x)) if x == 0.0 => Some(0.0),
            (a, b) => Some(a? * b?),
        },
        Inst::Div(a, b) => match (of(a)?, of(b)) {
            (0.0, _) => Some(0.0),
            (a, b) => Some(a / b?),
        },
        Inst::Neg(a) => Some(-of(a)?),
        Inst::Abs(a) => Some(of(a)?.abs()),
        Inst::Compare(compare, a, b) => Some(flag(compare.holds(of(a)?, of(b)?))),
        Inst::And(a, b) => Some(flag(of(a)? > 0.5 && of(b)? > 0.5)),
        Inst::Or(a, b) => Some(flag(of(a)? > 0.5 || of(b)? > 0.5)),
        Inst::Not(a) => Some(flag(of(a)? < 0.5)),
        Inst::Select(mask, a, b) => match of(mask) {
            Some(mask) if mask > 0.5 => of(a),
            Some(_) => of(b),
            None => of(a).filter(|x| of(b) == Some(*x)),
        },
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use crate::test_block::{Block, LAPLACE, PENALTY, PENALTY_WITH_FRICTION};

    fn acts(law: &str) -> bool {
        Block::new(1, &[LAPLACE], &[law]).contact.terms()[0].acts_when_open
    }

    #[test]
    fn a_law_that_is_all_projections_has_no_force_where_it_is_open() {
        assert!(!acts(PENALTY) && !acts(PENALTY_WITH_FRICTION));
    }

    #[test]
    fn an_initial_stress_or_a_spring_beside_a_projection_acts_where_it_is_open() {
        assert!(acts("(pos_part(10*u.Normal) - 3)*(Test_u.Normal)"));
        assert!(acts("(pos_part(10*u.Normal) + 2*u.Normal)*(Test_u.Normal)"));
    }

    #[test]
    fn what_cancels_where_it_is_open_is_no_force() {
        assert!(!acts("(pos_part(10*u.Normal)*(1 + u(1)))*(Test_u.Normal)"));
    }
}
