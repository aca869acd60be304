//! Cells without a term: a hole in the model that no equation would show.

use wfl::{Code, Diagnostic, MeshStmt, ResolvedScript, ast::OptionValue};
use wfl_mesh::mesh::{CellId, GroupEntities, Mesh, RegionSet};

use super::terms::PlacedLaw;

/// E425 if cells of the mesh are in no term, unless the mesh statement allows that. A scene whose terms all stand on
/// faces has no such cells; of one with a term that has a mistake nothing is known.
pub(super) fn check(script: &ResolvedScript, mesh: &Mesh, laws: &[PlacedLaw], diagnostics: &mut Vec<Diagnostic>) {
    let Some(statement) = &script.mesh else { return };
    let (allowed, idle) = (allowed(statement, diagnostics), idle(mesh, laws));
    let broken = !script.lost.is_empty() || script.terms.iter().any(|t| laws.iter().all(|law| law.span != t.span));
    let Some(first) = idle.first().filter(|_| !allowed && !broken) else { return };
    let x = mesh.centroid(*first);
    let groups = mesh.groups().iter().filter(|g| matches!(&g.entities, GroupEntities::Cells(c) if c.contains(first)));
    let group = groups.map(|g| format!(" of group `{}`", g.name)).next().unwrap_or_default();
    let place = format!("the first is {}{group} around {:?}", mesh.numbers().cell(*first), &x[..mesh.dim()]);
    let count = match idle.len() {
        1 => "1 cell of the mesh is".to_owned(),
        n => format!("{n} cells of the mesh are"),
    };
    let help = "put them into a region with a term; `with idle_cells=allowed` behind the mesh leaves them out";
    diagnostics.push(Diagnostic::new(Code::E425, format!("{count} in no term")).at(statement.span, place).help(help));
}

/// What the mesh statement says about idle cells.
fn allowed(statement: &MeshStmt, diagnostics: &mut Vec<Diagnostic>) -> bool {
    let mut allowed = false;
    for option in &statement.options {
        let value = match &option.value {
            Some(OptionValue::Expr(e)) => match &e.kind {
                wfl::ast::ExprKind::Name(n) => n.as_str(),
                _ => "",
            },
            _ => "",
        };
        match (option.name.name.as_str(), value) {
            ("idle_cells", "allowed") => allowed = true,
            ("idle_cells", "refused") => allowed = false,
            (name, _) => {
                let d = Diagnostic::new(Code::E414, format!("option `{name}` is not understood here"));
                diagnostics.push(d.at(option.name.span, "known: idle_cells=refused, idle_cells=allowed"));
            }
        }
    }
    allowed
}

fn idle(mesh: &Mesh, laws: &[PlacedLaw]) -> Vec<CellId> {
    let mut reached = vec![false; mesh.n_cells()];
    let mut any = false;
    for law in laws {
        // a load alone gives a cell no equation
        if let Some(RegionSet::Cells(cells)) = law.set.as_ref().filter(|_| !law.law.trials.is_empty()) {
            any = true;
            cells.iter().for_each(|c| reached[c.index()] = true);
        }
    }
    if any { mesh.cells().filter(|c| !reached[c.index()]).collect() } else { Vec::new() }
}
