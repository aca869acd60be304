//! `interface along s`: both sides of faces that lie inside a body.
//!
//! Promises: `Normal` points to one side all over each sheet, the same for every numbering of the mesh; faces without
//! a second side, a surface with one side only and a direction that chooses none have a message with the place.

use std::{cell::RefCell, collections::BTreeMap};

use wfl::{
    Code, Diagnostic, ResolvedScript, Span,
    ast::{Expr, Ident},
};
use wfl_compiler::{Constant, InterpreterBackend, compile_value};
use wfl_discrete::{
    finite::{BadGiven, NotFinite},
    value::Value,
};
use wfl_mesh::mesh::{Mesh, RegionSet, SheetError, Topology, both_sides, oriented_sheets};

use crate::{
    constants::bare_env,
    mesh::{POSITIONS_ONLY, position_place},
};

/// `interface along surface towards v`, where the surface is the region `set`.
pub(super) struct Along<'a> {
    pub(super) script: &'a ResolvedScript,
    pub(super) mesh: &'a Mesh,
    pub(super) topology: &'a Topology,
    pub(super) params: &'a BTreeMap<String, Constant>,
    pub(super) diagnostics: &'a mut Vec<Diagnostic>,
}

impl Along<'_> {
    /// The interface; `None` after a message.
    pub(super) fn make(
        &mut self,
        set: &RegionSet,
        surface: &Ident,
        towards: Option<&Expr>,
        span: Span,
    ) -> Option<RegionSet> {
        let pairs = match set {
            RegionSet::Facets(facets) => both_sides(self.mesh, self.topology, facets),
            RegionSet::Interface(pairs) => Ok(pairs.clone()),
            other => {
                let text = format!("`{}` is a region of {}", surface.name, other.kind());
                let d = Diagnostic::new(Code::E405, format!("{text}, faces inside a body are needed"));
                self.diagnostics.push(d.at(surface.span, ""));
                return None;
            }
        };
        let direction = match towards {
            Some(e) => Some((self.direction(e)?, e)),
            None => None,
        };
        let bad = RefCell::new(None);
        let dim = self.mesh.dim();
        let value_at = |x: [f64; 3]| match direction.as_ref().map(|(value, _)| value.at_positions(&[x])) {
            Some(Ok(v)) => std::array::from_fn(|i| if i < dim { v[i] } else { 0.0 }),
            Some(Err(e)) => {
                bad.borrow_mut().get_or_insert(e);
                [0.0; 3]
            }
            None => [0.0; 3],
        };
        let by = direction.as_ref().map(|_| &value_at as &dyn Fn([f64; 3]) -> [f64; 3]);
        let made = pairs.and_then(|pairs| oriented_sheets(self.mesh, &pairs, by));
        if let (Some(at), Some((_, e))) = (bad.borrow_mut().take(), &direction) {
            self.not_finite(e, at);
            return None;
        }
        match made {
            Ok(sheets) => {
                let mut pairs: Vec<_> = sheets.into_iter().flat_map(|s| s.facets).collect();
                pairs.sort_unstable();
                Some(RegionSet::Interface(pairs))
            }
            Err(e) => {
                self.diagnostics.push(without_sides(&e, surface, span, towards));
                None
            }
        }
    }

    /// The direction of `towards`, by position.
    fn direction(&mut self, e: &Expr) -> Option<Value> {
        let dim = self.mesh.dim();
        let env = bare_env(self.script, dim, self.params);
        let law = compile_value(&env, &position_place(0), "the direction of `towards`", e);
        self.diagnostics.extend(law.diagnostics);
        let law = law.value?;
        if law.shape.len() != dim {
            let d = Diagnostic::new(
                Code::E108,
                format!("the direction of `towards` has {dim} components here, found a {}", law.shape),
            );
            self.diagnostics.push(wfl::at_expr(d, e, env.expansions, ""));
            return None;
        }
        match Value::new(law, &InterpreterBackend) {
            Ok(v) if v.reads_positions_only() => Some(v),
            Ok(_) => {
                self.diagnostics.push(Diagnostic::new(Code::E407, POSITIONS_ONLY).at(e.span, ""));
                None
            }
            Err(e2) => {
                self.diagnostics.push(Diagnostic::new(Code::E609, e2.to_string()).at(e.span, ""));
                None
            }
        }
    }

    fn not_finite(&mut self, e: &Expr, at: NotFinite) {
        let bad = BadGiven { what: "the direction of `towards`".to_owned(), span: e.span, at: Box::new(at) };
        self.diagnostics.push(bad.diagnostic(&self.script.expansions, None));
    }
}

/// The message about a surface that has no two sides, or none that `towards` names.
fn without_sides(error: &SheetError, surface: &Ident, span: Span, towards: Option<&Expr>) -> Diagnostic {
    let name = &surface.name;
    match error {
        SheetError::OneSided { facets, total, .. } => {
            let d = Diagnostic::new(Code::E405, format!("no interface lies along `{name}`: {error}"));
            let d = d.at(surface.span, "faces between two cells of the mesh are needed");
            let mixed = format!("{name} - boundary has those inside only");
            d.help(if facets < total {
                mixed
            } else {
                "of two bodies whose nodes are separate: interface from a to b, with regions of cells".to_owned()
            })
        }
        SheetError::OneSide { .. } => {
            let d = Diagnostic::new(Code::E436, format!("`{name}` cannot be oriented: {error}")).at(span, "");
            d.help(
                "cut it into surfaces with two sides each (physical groups of the mesh file): one interface for each",
            )
        }
        SheetError::Along { .. } => {
            let d = Diagnostic::new(Code::E437, format!("`{name}` has no side there: {error}"));
            d.at(towards.map_or(span, |e| e.span), "")
                .help("a direction that leaves the sheet; it may depend on the position: towards [x,y,0]")
        }
    }
}
