//! The pattern of the tangent follows images: no entry is lost, and what a resumed run remembers has them.

use std::path::Path;

use wfl_compiler::InterpreterBackend;
use wfl_discrete::system::{Branches, System};
use wfl_tests::{Sequence, prepared};

use super::blocks;

/// The tangent of a state against differences of residuals, by columns, whatever states came before; and what is recalled of
/// it.
#[test]
fn a_tangent_is_that_of_its_state_whatever_came_before() {
    let text = blocks(6, "steps s = 0 to 1 by 1\n").replace("param fric = 0.2", "param fric = 0");
    let made = prepared(Path::new("."), text, &[], &[], &InterpreterBackend);
    let scene = made.unwrap_or_else(|e| panic!("{e}"));
    let mut equations = scene.at_first_step().expect("equations");
    let system: &mut System = &mut equations.system;
    let upper = system.range(0).expect("an unknown");
    let n = system.numbering.n_dofs;
    let mut random = Sequence(7);
    let noise: Vec<f64> = (0..n).map(|_| 1e-3 * random.number()).collect();
    let state = |slid: f64| -> Vec<f64> {
        let moved = |d: usize| if upper.contains(&d) { [slid, -0.03][(d - upper.start) % 2] } else { 0.0 };
        (0..n).map(|d| moved(d) + noise[d]).collect()
    };
    let mut kept = system.new_tangent();
    let sizes: Vec<usize> = [0.0, 1.3, 2.6, 0.4]
        .into_iter()
        .map(|slid| {
            let u = state(slid);
            system.tangent(&u, Branches::AsWritten, &mut kept).expect("a tangent");
            let mut fresh = system.new_tangent();
            system.tangent(&u, Branches::AsWritten, &mut fresh).expect("a tangent");
            let whole = system.bulk().plus(&kept.changing).expect("one shape");
            for row in 0..whole.n_rows() {
                let (columns, values) = kept.changing.row(row);
                for (column, value) in columns.iter().zip(values) {
                    assert_eq!(*value, fresh.changing.get(row, *column as usize), "{slid}: {row}, {column}");
                }
            }
            differences(system, &u, &whole);
            let mut recalled = system.new_tangent();
            assert!(recalled.recall(&kept.memory()));
            assert!(recalled.changing.pattern() == kept.changing.pattern());
            assert_eq!(recalled.changing.values(), kept.changing.values());
            fresh.changing.pattern().n_entries()
        })
        .collect();
    assert!(sizes.iter().all(|n| *n > 0), "{sizes:?}");
}

/// The part of contact does not depend on the bodies: beside the tangent of bodies that are not linear it is what changes where bodies
/// are.
#[test]
fn the_part_on_faces_is_that_of_contact_whatever_came_before() {
    let text = blocks(6, "steps s = 0 to 1 by 1\n");
    let law = text.lines().find(|line| line.starts_with("def P(g)")).expect("a law").to_owned();
    let of_linear = text.replace(&law, "def P(g) = 0.8*Sym(g)");
    let [mut of_bodies, mut alone] = [text, of_linear].map(|text| {
        let made = prepared(Path::new("."), text, &[], &[], &InterpreterBackend);
        let scene = made.unwrap_or_else(|e| panic!("{e}"));
        let mut equations = scene.at_first_step().expect("equations");
        equations.system.keep_faces_apart().expect("a pattern");
        (equations.system.new_tangent(), equations.system)
    });
    let upper = alone.1.range(0).expect("an unknown");
    for slid in [0.0, 1.3, 2.6, 0.4] {
        let moved = |d: usize| if upper.contains(&d) { [slid, -0.03][(d - upper.start) % 2] } else { 0.0 };
        let u: Vec<f64> = (0..alone.1.numbering.n_dofs).map(moved).collect();
        for (tangent, system) in [&mut of_bodies, &mut alone] {
            system.tangent(&u, Branches::AsWritten, tangent).expect("a tangent");
        }
        let whole = &alone.0.changing;
        let size = whole.max_abs();
        assert!(size > 1.0, "the bodies touch");
        for (tangent, _) in [&of_bodies, &alone] {
            let part = tangent.on_faces().expect("it is kept apart");
            let other = part.plus(whole).expect("one shape");
            for row in 0..other.n_rows() {
                for column in other.row(row).0.iter().map(|column| *column as usize) {
                    let (a, b) = (part.get(row, column), whole.get(row, column));
                    assert!((a - b).abs() <= 1e-14 * size, "{slid}: {row}, {column}: {a:e} and {b:e}");
                }
            }
        }
    }
}

/// Along a few directions the tangent is the difference of residuals.
pub(super) fn differences(system: &System, u: &[f64], tangent: &wfl_sparse::csr::Csr) {
    let mut random = Sequence(11);
    for _ in 0..3 {
        let direction: Vec<f64> = (0..u.len()).map(|_| random.number()).collect();
        let at = |h: f64| {
            let moved: Vec<f64> = u.iter().zip(&direction).map(|(u, d)| u + h * d).collect();
            system.residual_at_points(&moved).expect("a residual").0
        };
        let h = 2e-6;
        let (plus, minus) = (at(h), at(-h));
        let mut free = Vec::new();
        system.numbering.gather(&direction, &mut free);
        let mut product = vec![0.0; tangent.n_rows()];
        tangent.multiply(&free, &mut product, 1);
        // fixed dofs do not move in the product
        assert_eq!(free.len(), u.len(), "nothing is prescribed here");
        let mut difference = Vec::new();
        let all: Vec<f64> = plus.iter().zip(&minus).map(|(a, b)| (a - b) / (2.0 * h)).collect();
        system.numbering.gather(&all, &mut difference);
        let size = product.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        for (a, b) in product.iter().zip(&difference) {
            assert!((a - b).abs() < 1e-6 * size, "{a} {b} of {size}");
        }
    }
}
