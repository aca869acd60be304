//! The same scenes on several ranks, which are threads: each with the whole mesh, or with a part of it.

use std::{panic::AssertUnwindSafe, path::Path};

use wfl_problem::Scene;
use wfl_tests::ranks::{Holding, Shared, run_with_gathered};

use super::{Found, brought, panicked};

/// What several ranks find together, or what one of them told.
pub(super) fn found(folder: &Path, scene: &str, ranks: usize, holding: Holding) -> Result<Found, String> {
    let text = format!("{scene}solver newton with tol=1e-12\n");
    let shared = Shared::text(folder, text, &[]);
    let work = |scene: Scene| {
        let system = &scene.system;
        // nodes of a part have numbers of their own
        let is_whole = holding == Holding::Whole;
        let names = (0..system.fields.len())
            .filter_map(|k| Some((system.fields[k].name.clone(), system.range(k).filter(|_| is_whole)?)))
            .collect::<Vec<_>>();
        let own: Vec<bool> = (0..system.numbering.n_dofs).map(|dof| system.owns(dof)).collect();
        let outcome = run_with_gathered(scene).map_err(|e| e.to_string())?;
        Ok((brought(&names, outcome)?, own, names))
    };
    let each = std::panic::catch_unwind(AssertUnwindSafe(|| shared.on_ranks(ranks, holding, work)));
    let each: Result<Vec<_>, String> = each.map_err(|e| panicked(&*e))?.into_iter().collect();
    let mut each = each?.into_iter();
    let (mut first, _, names) = each.next().expect("a rank");
    for (other, own, _) in each {
        if first.measures.iter().map(|m| m.1.to_bits()).ne(other.measures.iter().map(|m| m.1.to_bits())) {
            return Err("ranks have other measures".to_owned());
        }
        for ((k, (_, range)), (_, values)) in names.iter().enumerate().zip(&other.fields) {
            for (node, _) in range.clone().enumerate().filter(|(_, dof)| own[*dof]) {
                first.fields[k].1[node] = values[node];
            }
        }
    }
    Ok(first)
}

/// Whether each rank can have a part of the mesh.
pub(super) fn may_have_parts(folder: &Path, scene: &str) -> bool {
    Shared::text(folder, scene.to_owned(), &[]).whole().needs_whole_mesh().is_none()
}
