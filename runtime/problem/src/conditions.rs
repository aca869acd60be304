//! Conditions on positions: which cells, faces and nodes a region or a refinement takes.
//!
//! Promises: `==` on coordinates means near, in parts of the mesh and, on a refined one, of its smallest cell. Does not
//! know what is picked.

use std::collections::BTreeMap;

use wfl::{Code, Diagnostic, ResolvedScript, ast::Cond};
use wfl_compiler::{Constant, Env, InterpreterBackend, backend::KernelBackend, compile_condition};
use wfl_discrete::value::Value;
use wfl_mesh::mesh::Mesh;

use crate::mesh::position_place;

/// `==` on coordinates means within this part of the mesh size.
const EQUAL_WITHIN: f64 = 1e-9;

/// ... and within this part of the smallest cell of a refined mesh, whose nodes are further apart.
const EQUAL_IN_CELL: f64 = 1e-3;

/// ... and within this part of the coordinates themselves, which far from the origin are coarser than that.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Meshes of fewer cells are looked through by the interpreter.
const FEW_CELLS: usize = 2000;

/// What conditions are made with.
#[derive(Clone, Copy)]
pub(super) struct ConditionMaker<'a> {
    pub(super) script: &'a ResolvedScript,
    pub(super) mesh: &'a Mesh,
    pub(super) params: &'a BTreeMap<String, Constant>,
    pub(super) backend: &'a dyn KernelBackend,
    /// The diameter of the smallest cell of a refined mesh; infinite for others.
    pub(super) smallest: f64,
}

impl ConditionMaker<'_> {
    /// A condition, 1 where it holds; `None` after a message.
    pub(super) fn make(&self, cond: &Cond, diagnostics: &mut Vec<Diagnostic>) -> Option<Value> {
        let (low, high) = self.mesh.bounds();
        let size = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        let far = (0..3).fold(0.0f64, |m, d| m.max(low[d].abs()).max(high[d].abs()));
        let env = Env {
            dim: self.mesh.dim(),
            fields: &[],
            mappings: &[],
            params: self.params,
            expansions: &self.script.expansions,
            step_variable: None,
            rates: &[],
            tables: &self.script.tables,
            equal_within: (EQUAL_WITHIN * size).min(EQUAL_IN_CELL * self.smallest) + ROUNDING * far,
        };
        let law = compile_condition(&env, &position_place(0), "a condition", cond);
        diagnostics.extend(law.diagnostics);
        // a kernel of machine code costs as much as the interpreter does for thousands of positions
        let few = self.mesh.n_cells() < FEW_CELLS;
        let backend: &dyn KernelBackend = if few { &InterpreterBackend } else { self.backend };
        match Value::new(law.value?, backend) {
            Ok(v) if v.reads_positions_only() => Some(v),
            Ok(_) => {
                let d = Diagnostic::new(Code::E405, "a region is picked by position only");
                diagnostics.push(d.at(cond.span, ""));
                None
            }
            Err(e) => {
                diagnostics.push(Diagnostic::new(Code::E609, e.to_string()).at(cond.span, ""));
                None
            }
        }
    }
}

/// Whether a condition holds at a position; `None` where it is not a number.
pub(super) fn holds(condition: &Value, x: [f64; 3]) -> Option<bool> {
    match condition.at_positions(&[x]) {
        Ok(v) if !condition.compares_nan_at(x) => Some(v[0] == 1.0),
        _ => None,
    }
}

/// The message about a condition that is not a number at `x`.
pub(super) fn not_a_number(x: [f64; 3], span: wfl::Span) -> Diagnostic {
    Diagnostic::new(Code::E601, format!("not a number in this condition at x = {x:?}")).at(span, "")
}
