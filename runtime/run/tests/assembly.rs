//! Assembled tangents: energies of strains known by hand, the same bits for any number of threads and any values that the
//! matrix had before, made anew or added, rows and columns of fixed dofs left out.

#[path = "../benches/common/scene.rs"]
mod common;

use wfl::{Loader, SourceId};
use wfl_discrete::assemble::FieldValues;
use wfl_problem::Scene;
use wfl_sparse::csr::{Csr, PatternBuilder};

/// A scene that uses no other file.
struct Alone;

impl Loader for Alone {
    fn load(&mut self, path: &str, _from: SourceId) -> Result<(String, String), wfl::Unloaded> {
        Err(format!("{path} is not part of the scene").into())
    }
}

const FIXED: u32 = u32::MAX;

const LAMBDA: f64 = 120.0;
const MU: f64 = 80.0;

const ELASTIC: &str = "
def sigma(v) = lambda*Div_v*Id(3) + 2*mu*Sym(Grad_v)
term law on all : sigma(u):Grad_Test_u
";
const NEO_HOOKEAN: &str = "
def F = Id(3) + Grad_u
term law on all : (mu*(F - Inv(F)') + lambda*log(Det(F))*Inv(F)'):Grad_Test_u
";

/// A box of volume 1, or its face of area 2.
fn scene(cells: &str, element: &str, degree: usize, law: &str) -> Scene {
    let corners = if cells.contains("tri") { "[0,0] to [1,2]" } else { "[0,0,0] to [1,2,0.5]" };
    let text = format!(
        "wfl 1\nmesh box {corners} cells {cells}\nquadrature on all degree {degree}\n\
         param lambda = {LAMBDA}\nparam mu = {MU}\nunknown u : vector {element}\n{law}"
    );
    common::scene("box", text, &mut Alone).expect("a scene")
}

/// The tangent at `u` on `threads` threads, in a matrix that held no numbers before; `free` maps dofs to rows.
fn tangent(scene: &mut Scene, u: &[f64], free: &[u32], threads: usize) -> Csr {
    made(scene, u, free, threads, f64::NAN)
}

/// The same in a matrix whose values were `before`, and added to them if they were zero.
fn made(scene: &mut Scene, u: &[f64], free: &[u32], threads: usize, before: f64) -> Csr {
    let system = &mut scene.system;
    let n = free.iter().filter(|f| **f != FIXED).count();
    let mut pattern = PatternBuilder::new(n, n);
    let kept =
        |dofs: &[u32]| -> Vec<u32> { dofs.iter().map(|d| free[*d as usize]).filter(|row| *row != FIXED).collect() };
    system.terms[0].for_each_entity(|rows, columns| pattern.add_coupling(&kept(rows), &kept(columns)));
    let mut matrix = Csr::zeros(pattern.build_shared().expect("a pattern"));
    matrix.values_mut().fill(before);
    system.terms[0].locate(matrix.pattern(), free);
    system.terms[0].set_step(wfl_discrete::window::Window::default());
    let values = FieldValues { current: &[u], previous: &[], rates: None };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let done = pool.install(|| match before == 0.0 {
        true => system.terms[0].add_tangent(&system.mesh, values, matrix.values_mut()),
        false => system.terms[0].set_tangent(&system.mesh, values, matrix.values_mut()),
    });
    done.expect("finite numbers");
    matrix
}

fn all_free(scene: &Scene) -> Vec<u32> {
    (0u32..).take(scene.system.numbering.n_dofs).collect()
}

/// The displacement `g x` at every node.
fn linear(scene: &Scene, g: [[f64; 3]; 3]) -> Vec<f64> {
    let field = &scene.system.fields[0];
    let at = |node: usize| {
        let x = field.node_position(node);
        g.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2])
    };
    (0..field.n_dofs() / 3).flat_map(at).collect()
}

/// Differs from dof to dof.
fn shaken(scene: &Scene) -> Vec<f64> {
    (0..scene.system.numbering.n_dofs).map(|k| 1e-3 * ((k * 7919 % 1000) as f64 / 1000.0 - 0.5)).collect()
}

fn times(matrix: &Csr, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    matrix.multiply(x, &mut y, 1);
    y
}

#[test]
fn a_homogeneous_strain_has_its_energy_and_a_rotation_none() {
    let g: [[f64; 3]; 3] = [[0.3, -0.2, 0.5], [0.7, -0.4, 0.1], [0.2, 0.6, 0.9]];
    let strain = |i: usize, j: usize| 0.5 * (g[i][j] + g[j][i]);
    let trace = g[0][0] + g[1][1] + g[2][2];
    let squares: f64 = (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).map(|(i, j)| strain(i, j).powi(2)).sum();
    let energy = LAMBDA * trace * trace + 2.0 * MU * squares;
    let cases =
        [("[2,3,2] tet", "P1", 1), ("[2,3,2] tet", "P2", 2), ("[2,3,2] hex", "Q1", 3), ("[2,2,1] hex", "Q2", 5)];
    for (cells, element, degree) in cases {
        for law in [ELASTIC, NEO_HOOKEAN] {
            let mut scene = scene(cells, element, degree, law);
            let free = all_free(&scene);
            // without displacement the neo-Hookean tangent is the elastic one
            let zero = vec![0.0; free.len()];
            let matrix = tangent(&mut scene, &zero, &free, 1);
            let u = linear(&scene, g);
            let found: f64 = times(&matrix, &u).iter().zip(&u).map(|(f, u)| f * u).sum();
            assert!((found - energy).abs() < 1e-12 * energy, "{cells} {element}: {found} for {energy}");
            let turn = linear(&scene, [[0.0, -1.0, 2.0], [1.0, 0.0, -3.0], [-2.0, 3.0, 0.0]]);
            let largest = matrix.values().iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let force = times(&matrix, &turn).iter().fold(0.0f64, |m, f| m.max(f.abs()));
            assert!(force < 1e-12 * largest, "{cells} {element}: {force} of {largest}");
        }
    }
}

#[test]
fn every_number_of_threads_gives_the_same_bits() {
    for (cells, element, degree) in [("[5,4,3] tet", "P2", 2), ("[6,5,7] tet", "P1", 1), ("[6,7,5] hex", "Q1", 3)] {
        for law in [ELASTIC, NEO_HOOKEAN] {
            let mut scene = scene(cells, element, degree, law);
            let (free, u) = (all_free(&scene), shaken(&scene));
            let one = tangent(&mut scene, &u, &free, 1);
            assert!(one.values().iter().all(|v| v.is_finite()));
            for threads in [2, 3, 7] {
                assert!(tangent(&mut scene, &u, &free, threads) == one, "{element}: {threads} threads");
            }
        }
    }
}

/// Of a symmetric tangent made anew one half is copied from the other: it must be what would be added there.
#[test]
fn a_matrix_made_anew_is_the_one_added_to_nothing() {
    let cases = [("[5,4,3] tet", "P1", 1), ("[3,4,3] tet", "P2", 2), ("[6,7,5] hex", "Q1", 3), ("[4,3] tri", "P2", 2)];
    for (cells, element, degree) in cases {
        for law in [ELASTIC, NEO_HOOKEAN] {
            let law = if cells.contains("tri") { law.replace("Id(3)", "Id(2)") } else { law.to_owned() };
            let mut scene = scene(cells, element, degree, &law);
            let (all, u) = (all_free(&scene), shaken(&scene));
            let mut free = vec![FIXED; all.len()];
            let kept = all.iter().filter(|d| **d / 3 % 11 != 1 && **d % 17 != 3);
            (0u32..).zip(kept).for_each(|(row, dof)| free[*dof as usize] = row);
            for free in [all, free] {
                for threads in [1, 3] {
                    let added = made(&mut scene, &u, &free, threads, 0.0);
                    let largest = added.values().iter().fold(0.0f64, |m, v| m.max(v.abs()));
                    let anew = tangent(&mut scene, &u, &free, threads);
                    assert!(largest > 0.0 && anew.values().len() == added.values().len());
                    for (k, (value, expected)) in anew.values().iter().zip(added.values()).enumerate() {
                        let differs = (value - expected).abs();
                        assert!(differs <= 1e-14 * largest, "{cells} {element}: {k} {value} for {expected}");
                    }
                }
            }
        }
    }
}

#[test]
fn fixed_dofs_take_out_rows_and_columns() {
    let mut scene = scene("[4,3,3] hex", "Q1", 3, NEO_HOOKEAN);
    let (all, u) = (all_free(&scene), shaken(&scene));
    let whole = tangent(&mut scene, &u, &all, 1);
    let largest = whole.values().iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let mut free = vec![FIXED; all.len()];
    let kept: Vec<u32> = all.iter().copied().filter(|d| d % 7 != 3 && d / 3 % 5 != 1).collect();
    for (row, dof) in (0u32..).zip(&kept) {
        free[*dof as usize] = row;
    }
    let part = tangent(&mut scene, &u, &free, 1);
    assert_eq!(part.n_rows(), kept.len());
    for threads in [1, 3] {
        assert!(tangent(&mut scene, &u, &free, threads) == part, "{threads} threads");
        for (row, dof) in kept.iter().enumerate() {
            let (columns, values) = part.row(row);
            assert!(!columns.is_empty());
            for (column, value) in columns.iter().zip(values) {
                let expected = whole.get(*dof as usize, kept[*column as usize] as usize);
                assert!((value - expected).abs() < 1e-14 * largest, "{row} {column}: {value} for {expected}");
            }
        }
    }
}
