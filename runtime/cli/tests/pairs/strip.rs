//! A strip in the middle of a ring of hexahedra, as a mesh file of Gmsh.

use std::fmt::Write as _;

use super::Pair;

/// Cells of the ring along its way round.
const ROUND: usize = 12;

/// A ring with sections of 2 x 2 hexahedra and the group `strip` of the faces in the middle of them. The section turns by
/// `half_turns` half turns on the way round: of one, the strip has one side only.
fn ring(half_turns: usize) -> String {
    let mut text =
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 1 \"strip\"\n3 2 \"rock\"\n$EndPhysicalNames\n"
            .to_owned();
    let _ = writeln!(text, "$Nodes\n{}", 9 * ROUND);
    for k in 0..ROUND {
        let part = k as f64 / ROUND as f64;
        let (way, turn) = (std::f64::consts::TAU * part, std::f64::consts::PI * half_turns as f64 * part);
        for n in 0..9 {
            let (a, b) = ((n % 3) as f64 - 1.0, (n / 3) as f64 - 1.0);
            let (z, r) = (a * turn.cos() - b * turn.sin(), 5.0 + a * turn.sin() + b * turn.cos());
            let _ = writeln!(text, "{} {} {} {z}", 9 * k + n + 1, r * way.cos(), r * way.sin());
        }
    }
    // the last section is the first one, turned
    let node = |a: usize, b: usize, k: usize| match (k == ROUND, half_turns % 2) {
        (true, 1) => 9 - (3 * b + a),
        (true, _) => 3 * b + a + 1,
        _ => 9 * k + 3 * b + a + 1,
    };
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", 6 * ROUND);
    let mut number = 0;
    let mut element = |head: &str, nodes: &[usize]| {
        number += 1;
        let list: Vec<String> = nodes.iter().map(usize::to_string).collect();
        let _ = writeln!(text, "{number} {head} {}", list.join(" "));
    };
    for k in 0..ROUND {
        for (a, b) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let square = |k| [node(a, b, k), node(a + 1, b, k), node(a + 1, b + 1, k), node(a, b + 1, k)];
            element("5 2 2 2", &[square(k), square(k + 1)].concat());
        }
        for a in 0..2 {
            element("3 2 1 1", &[node(a, 1, k), node(a + 1, 1, k), node(a + 1, 1, k + 1), node(a, 1, k + 1)]);
        }
    }
    text + "$EndElements\n"
}

/// The surface of a Moebius strip, and that of a ring without a turn.
pub(crate) fn one_sided() -> Pair {
    let scene = "mesh file \"moebius.msh\"\nregion crack = interface along strip\nunknown p : scalar\n\
        term flow on all : Grad_p.Grad_Test_p + p*Test_p - Test_p\nmeasure area = integral(1) on crack\n";
    Pair::new("E436", scene).near("moebius.msh", "plain.msh").file("moebius.msh", ring(1)).file("plain.msh", ring(0))
}
