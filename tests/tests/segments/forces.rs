//! What a constant pressure gives to the nodes of both sides, and the area and the moments of an overlap.

use proptest::prelude::*;
use wfl_compiler::InterpreterBackend;
use wfl_discrete::system::System;
use wfl_problem::Scene;
use wfl_tests::{MeshFolder, prepared};

use super::blocks::{Blocks, Cells};

/// A pressure of 1 between the blocks through a map, and on each side by itself.
fn scene(name: &str, blocks: &Blocks, degree: usize) -> Scene {
    let text = format!(
        "wfl 1
mesh file \"body.msh\"
region top = floor
region bottom = sole
unknown a : vector on upper
unknown b : vector on lower
term upper on upper : Grad_a:Grad_Test_a
term lower on lower : Grad_b:Grad_Test_b
mapping m = raytrace from sole onto floor within 0.3
term contact on sole : Normal.(Test_a - Interpolate(Test_b, m))
term here on bottom : Normal.Test_a
term there on top : Normal.Test_b
quadrature on sole segments of m degree {degree}
quadrature on bottom, top degree 4
steps k = 0 to 1 by 1
"
    );
    let folder = MeshFolder::new(&format!("forces-{name}"), &blocks.mesh());
    prepared(folder.path(), text.clone(), &[], &[], &InterpreterBackend).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn residual(system: &System, names: &[&str]) -> Vec<f64> {
    let mut forces = vec![0.0; system.numbering.n_dofs];
    let u = vec![0.0; system.numbering.n_dofs];
    let values = system.values(&u);
    for term in system.terms.iter().filter(|t| names.contains(&t.law.name.as_str())) {
        term.add_residual(&system.mesh, values.view(), &mut forces).expect("finite forces");
    }
    forces
}

/// The force of a field along the last axis, and its moments about the others: the area of what is pressed and the integrals
/// of the positions over it.
fn moments(system: &System, forces: &[f64], field: usize, dim: usize) -> [f64; 3] {
    let range = system.range(field).expect("an unknown");
    let mut sum = [0.0; 3];
    for (node, own) in forces[range].chunks(dim).enumerate() {
        let x = system.fields[field].node_position(node);
        let force = own[dim - 1];
        sum = [sum[0] + force, sum[1] + force * x[0], if dim > 2 { sum[2] + force * x[1] } else { 0.0 }];
    }
    sum
}

fn cells(dim: usize) -> impl Strategy<Value = Cells> {
    let all = match dim {
        2 => vec![Cells::Quadrilaterals, Cells::Triangles],
        _ => vec![Cells::Hexahedra, Cells::Tetrahedra, Cells::Wedges, Cells::Pyramids],
    };
    proptest::sample::select(all)
}

fn any_blocks() -> impl Strategy<Value = Blocks> {
    (2..4usize).prop_flat_map(|dim| {
        // 1 to 6 cells, half of them matching, halves or thirds of the other side
        let n = (1..5usize, prop_oneof![Just(1), Just(2), 1..5usize]);
        let ways = ([-3.0..3.0f64, -3.0..3.0f64], 0u64..1000, [0.0..0.3f64, 0.0..0.3f64]);
        (cells(dim), cells(dim), n, ways).prop_map(move |(lower, upper, n, ways)| {
            let mut blocks = Blocks::of(dim, (lower, n.0), (upper, n.0.max(1) * n.1.min(3)));
            (blocks.turned, blocks.seed) = (ways.0, ways.1);
            let is_affine = |cells| !matches!(cells, Cells::Hexahedra | Cells::Pyramids);
            blocks.lower.amount = if is_affine(lower) { ways.2[0] } else { 0.0 };
            blocks.upper.amount = if is_affine(upper) { ways.2[1] } else { 0.0 };
            blocks
        })
    })
}

const CASES: u32 = if cfg!(debug_assertions) { 24 } else { 200 };

proptest! {
    #![proptest_config(ProptestConfig { cases: CASES, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_constant_pressure_has_the_forces_of_each_side_by_itself(blocks in any_blocks()) {
        let scene = scene("exact", &blocks, 2);
        let system = &scene.system;
        let through = residual(system, &["contact"]);
        let alone = residual(system, &["here", "there"]);
        let size = alone.iter().fold(0.0f64, |m, f| m.max(f.abs()));
        // of faces whose edges nearly coincide: a corner outside by less than 1e-10 of a face counts as inside, and a piece
        // with less is none (`BESIDE` and `SLIVER` of domain/segments.rs); a node has some of them
        let distorted = blocks.lower.amount.max(blocks.upper.amount) > 0.0;
        let rounding = if distorted { 5e-10 } else { 1e-12 };
        for (a, b) in through.iter().zip(&alone) {
            prop_assert!((a - b).abs() < rounding * size, "{} for {} of {}", a, b, size);
        }
    }

    #[test]
    fn an_overlap_has_its_area_and_its_moments(
        blocks in any_blocks(), shift in [-0.7..0.7f64, -0.7..0.7f64], turn in -1.6..1.6f64, is_turned in any::<bool>(),
    ) {
        let mut blocks = Blocks { shift, turned: [0.0; 2], ..blocks };
        blocks.turn = if is_turned { turn } else { 0.0 };
        let corners = |turn: f64, [dx, dy]: [f64; 2]| -> Vec<[f64; 2]> {
            let (s, c) = turn.sin_cos();
            let place = |[x, y]: [f64; 2]| [0.5 + c * (x - 0.5) - s * (y - 0.5) + dx, 0.5 + s * (x - 0.5) + c * (y - 0.5) + dy];
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(place).to_vec()
        };
        let expected = if blocks.dim == 2 {
            let (from, to) = (shift[0].max(0.0), (1.0 + shift[0]).min(1.0));
            [to - from, 0.5 * (to * to - from * from), 0.0]
        } else {
            common(&corners(0.0, [0.0; 2]), &corners(blocks.turn, shift))
        };
        prop_assume!(expected[0] > 1e-3);
        let scene = scene("overlap", &blocks, 2);
        let forces = residual(&scene.system, &["contact"]);
        let [a, b] = ["a", "b"].map(|name| scene.system.fields.iter().position(|f| f.name == name).expect("a field"));
        // the normal of the upper block points down
        for (field, sign) in [(a, -1.0), (b, 1.0)] {
            let found = moments(&scene.system, &forces, field, blocks.dim);
            for (found, expected) in found.iter().zip(expected) {
                prop_assert!((sign * found - expected).abs() < 1e-12, "{} for {}", sign * found, expected);
            }
        }
    }
}

/// Area and moments of what two convex polygons have in common: its corners are those of each inside the other and where
/// their sides cross, in the order of their angles.
fn common(a: &[[f64; 2]], b: &[[f64; 2]]) -> [f64; 3] {
    let sides = |p: &[[f64; 2]]| -> Vec<[[f64; 2]; 2]> { (0..p.len()).map(|k| [p[k], p[(k + 1) % p.len()]]).collect() };
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let minus = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
    let is_in =
        |p: [f64; 2], of: &[[f64; 2]]| sides(of).iter().all(|[x, y]| cross(minus(*y, *x), minus(p, *x)) >= -1e-13);
    let mut corners: Vec<[f64; 2]> = a.iter().copied().filter(|p| is_in(*p, b)).collect();
    corners.extend(b.iter().copied().filter(|p| is_in(*p, a)));
    for [p, q] in sides(a) {
        for [r, s] in sides(b) {
            let (d, e) = (minus(q, p), minus(s, r));
            let determinant = cross(d, e);
            let (t, u) = (cross(minus(r, p), e) / determinant, cross(minus(r, p), d) / determinant);
            if (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&u) {
                corners.push([p[0] + t * d[0], p[1] + t * d[1]]);
            }
        }
    }
    let mean = [0, 1].map(|d| corners.iter().map(|p| p[d]).sum::<f64>() / corners.len().max(1) as f64);
    let angle = |p: &[f64; 2]| (p[1] - mean[1]).atan2(p[0] - mean[0]);
    corners.sort_by(|p, q| angle(p).total_cmp(&angle(q)));
    let mut sum = [0.0; 3];
    for [p, q] in sides(&corners) {
        let area = 0.5 * cross(minus(p, mean), minus(q, mean));
        let centre = [0, 1].map(|d| (p[d] + q[d] + mean[d]) / 3.0);
        sum = [sum[0] + area, sum[1] + area * centre[0], sum[2] + area * centre[1]];
    }
    sum
}
