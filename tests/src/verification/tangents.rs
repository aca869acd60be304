//! B16: the assembled tangent of every example scene against central differences of its assembled residual.
//!
//! Residuals are summed from the terms themselves, never from an assembled matrix, so linear terms are checked too.

use std::path::{Path, PathBuf};

use wfl_compiler::types::FieldKind;
use wfl_discrete::{
    system::{Branches, System},
    window::Window,
};
use wfl_jit::JitBackend;
use wfl_problem::Scene;

use super::{Benchmark, Case, Tolerance, common::or_failed};
use crate::{Sequence, examples, prepared, scene_files};

/// The benchmarks of this file.
pub(super) const BENCHMARKS: &[Benchmark] = &[Benchmark {
    id: "B16",
    title: "tangent of every example scene against central differences of its residual at a random state",
    origin: "central differences",
    slow: false,
    open: None,
    run: tangents,
}];

/// The tangent holds the points of cut faces where they are: it lacks what quadrature errs by as they move.
const HELD: f64 = 1e-2;

/// Directions a scene.
const DIRECTIONS: usize = 3;

/// Steps in parts of the direction: long ones for linear scenes, where loads leave few digits to short ones; short ones
/// where kinks are near. A wrong tangent is wrong for every step; the best counts.
const STEPS: [f64; 5] = [1.0, 1e-4, 1e-5, 1e-6, 1e-7];

fn tangents() -> Vec<Case> {
    scene_files()
        .into_iter()
        .map(|path| {
            let what = path.strip_prefix(examples()).unwrap_or(&path).display().to_string();
            or_failed(&what, check(&what, &path))
        })
        .collect()
}

fn check(what: &str, path: &Path) -> Result<Case, String> {
    let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
    // a theta that keeps every term
    let params: &[(&str, f64)] = if text.contains("param theta") { &[("theta", 1.0)] } else { &[] };
    let backend = JitBackend::new().map_err(|e| e.to_string())?;
    let folder = path.parent().map_or_else(PathBuf::new, Path::to_path_buf);
    let mut scene = prepared(&folder, text.clone(), &[], params, &backend)?;
    let window = Window::new(scene.steps.last(), 0.5);
    for (field, given) in &mut scene.data {
        let f = &scene.system.fields[*field];
        let positions: Vec<[f64; 3]> = (0..f.n_nodes()).map(|n| f.node_position(n)).collect();
        scene.system.set_data(*field, given.at(&positions, window).map_err(|e| e.to_string())?);
    }
    scene.system.begin_step(window).map_err(|e| e.to_string())?;
    let limit = if text.contains(" segments of ") { HELD } else { 1e-7 };
    let mut random = Sequence(0x9e37_79b9_7f4a_7c15);
    let sizes = sizes(&mut scene, &mut random)?;
    let mut case = Case::new(what);
    for k in 0..DIRECTIONS {
        let u = vector(&mut random, &scene.system, &sizes);
        let d = vector(&mut random, &scene.system, &sizes);
        let mut best: Vec<(String, f64)> = Vec::new();
        for step in STEPS {
            let found = errors(&scene.system, &u, &d, step)?;
            if best.is_empty() {
                best = found;
            } else {
                best.iter_mut().zip(found).for_each(|(b, f)| b.1 = b.1.min(f.1));
            }
        }
        for (name, error) in best {
            case = case.compare(format!("equations of {name}, direction {}", k + 1), error, limit, Tolerance::AtMost);
        }
    }
    Ok(case)
}

/// Numbers of the size of each field.
fn vector(random: &mut Sequence, system: &System, sizes: &[f64]) -> Vec<f64> {
    let mut u = vec![0.0; system.numbering.n_dofs];
    for (k, size) in sizes.iter().enumerate() {
        for x in system.range(k).into_iter().flatten() {
            u[x] = size * random.number();
        }
    }
    u
}

/// By field, how large its values may be: displacements that strain cells by some percent; multipliers of the size
/// that balances them in the contact terms, so that every branch is met.
fn sizes(scene: &mut Scene, random: &mut Sequence) -> Result<Vec<f64>, String> {
    let system = &mut scene.system;
    let mesh = &system.mesh;
    let extent = |d: usize| {
        let values = mesh.nodes().iter().map(|x| x[d]);
        values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
    };
    let size = (0..mesh.dim()).map(extent).product::<f64>() / mesh.n_cells() as f64;
    let cell = size.powf(1.0 / mesh.dim() as f64);
    let mut sizes: Vec<f64> = system.fields.iter().map(|_| 5e-3 * cell).collect();
    let multipliers: Vec<usize> =
        (0..sizes.len()).filter(|k| system.fields[*k].kind == FieldKind::Multiplier).collect();
    if multipliers.is_empty() {
        return Ok(sizes);
    }
    let u = vector(random, system, &sizes);
    let mut tangent = system.new_tangent();
    system.tangent(&u, Branches::AsWritten, &mut tangent).map_err(|e| e.to_string())?;
    for k in multipliers {
        let range = system.range(k).ok_or("an unknown")?;
        let dofs = &system.numbering.free_dofs;
        let (mut own, mut coupled) = (0.0f64, 0.0f64);
        for row in (0..dofs.len()).filter(|r| !range.contains(&(dofs[*r] as usize))) {
            let (columns, values) = tangent.changing.row(row);
            for (c, v) in columns.iter().zip(values) {
                let slot = if range.contains(&(dofs[*c as usize] as usize)) { &mut coupled } else { &mut own };
                *slot = slot.max(v.abs());
            }
        }
        // multipliers of linear terms have no branches
        if own > 0.0 && coupled > 0.0 {
            sizes[k] *= own / coupled;
        }
    }
    Ok(sizes)
}

/// Residual of every term at `u`.
fn residual(system: &System, u: &[f64]) -> Result<Vec<f64>, String> {
    let mut out = vec![0.0; u.len()];
    let values = system.values(u);
    for term in &system.terms {
        term.add_residual(&system.mesh, values.view(), &mut out).map_err(|e| e.to_string())?;
    }
    system.numbering.turn(&mut out);
    Ok(out)
}

/// By field, the largest difference between `K d` and the difference quotient, in parts of the largest entry.
fn errors(system: &System, u: &[f64], d: &[f64], step: f64) -> Result<Vec<(String, f64)>, String> {
    // free dofs only: the matrix has no columns for the others
    let free: Vec<usize> = system.numbering.free_dofs.iter().map(|f| *f as usize).collect();
    let moved = |sign: f64| {
        let mut x = u.to_vec();
        let correction: Vec<f64> = free.iter().map(|f| d[*f]).collect();
        system.numbering.advance(u, &correction, sign * step, &mut x);
        x
    };
    let [above, below, twice_above, twice_below] = [1.0, -1.0, 2.0, -2.0].map(moved);
    let at = |u: &[f64]| residual(system, u);
    let (above, below, twice_above, twice_below) = (at(&above)?, at(&below)?, at(&twice_above)?, at(&twice_below)?);
    let mut tangent = system.new_tangent();
    system.tangent(u, Branches::AsWritten, &mut tangent).map_err(|e| e.to_string())?;
    let product = |row: usize| -> f64 {
        [system.bulk(), &tangent.changing]
            .iter()
            .map(|m| {
                let (columns, values) = m.row(row);
                columns.iter().zip(values).map(|(c, v)| v * d[free[*c as usize]]).sum::<f64>()
            })
            .sum()
    };
    let mut worst = vec![(0.0f64, 0.0f64); system.fields.len()];
    for (row, f) in free.iter().enumerate() {
        let (field, _, _) = system.numbering.describe(&system.fields, *f);
        let exact = product(row);
        // central differences of fourth order
        let quotient = (8.0 * (above[*f] - below[*f]) - (twice_above[*f] - twice_below[*f])) / (12.0 * step);
        worst[field].0 = worst[field].0.max((exact - quotient).abs());
        worst[field].1 = worst[field].1.max(exact.abs());
    }
    let named = worst.iter().zip(&*system.fields).filter(|(w, _)| w.1 > 0.0);
    Ok(named.map(|(w, f)| (f.name.clone(), w.0 / w.1)).collect())
}
