//! Rules on triangles and tetrahedra: symmetric ones of low degree, collapsed ones of any degree.
//!
//! The symmetric rules are published ones with positive weights and inner points (triangle: Strang
//! and Fix 2, Dunavant 4 and 6, Radon 5; tetrahedron: Hammer and Stroud 2, an 8-point rule 3,
//! Walkington 5, Keast 6). Their numbers were polished against the exact moments in 40 digits; the
//! tests check the moments again.

use super::{line::gauss_jacobi, rule::Rule};
use crate::cell::CellKind;

/// Points that are the same up to a permutation of their barycentric coordinates, with the weight
/// of each.
struct Orbit {
    weight: f64,
    /// Barycentric coordinates of one point; equal ones are written equal.
    barycentric: [f64; 4],
}

const fn s3(weight: f64, a: f64) -> Orbit {
    let barycentric = [a, a, 1.0 - 2.0 * a, 0.0];
    Orbit { weight, barycentric }
}

const fn s4(weight: f64, a: f64) -> Orbit {
    let barycentric = [a, a, a, 1.0 - 3.0 * a];
    Orbit { weight, barycentric }
}

const fn orbit(weight: f64, barycentric: [f64; 4]) -> Orbit {
    Orbit { weight, barycentric }
}

const THIRD: f64 = 1.0 / 3.0;
const TRIANGLE_1: [Orbit; 1] = [orbit(0.5, [THIRD, THIRD, THIRD, 0.0])];
const TRIANGLE_2: [Orbit; 1] = [s3(1.0 / 6.0, 1.0 / 6.0)];
const TRIANGLE_4: [Orbit; 2] =
    [s3(0.111_690_794_839_005_73, 0.445_948_490_915_964_9), s3(0.054_975_871_827_660_93, 0.091_576_213_509_770_74)];
const TRIANGLE_5: [Orbit; 3] = [
    orbit(0.1125, [THIRD, THIRD, THIRD, 0.0]),
    // (6 -+ sqrt 15) / 21 with weights (155 -+ sqrt 15) / 2400.
    s3(0.062_969_590_272_413_58, 0.101_286_507_323_456_33),
    s3(0.066_197_076_394_253_1, 0.470_142_064_105_115_1),
];
const TRIANGLE_6: [Orbit; 3] = [
    s3(0.058_393_137_863_189_68, 0.249_286_745_170_910_42),
    s3(0.025_422_453_185_103_41, 0.063_089_014_491_502_23),
    orbit(0.041_425_537_809_186_79, [0.053_145_049_844_816_95, 0.310_352_451_033_784_4, 0.636_502_499_121_398_6, 0.0]),
];
const TETRAHEDRON_1: [Orbit; 1] = [orbit(1.0 / 6.0, [0.25; 4])];
/// (5 - sqrt 5) / 20.
const TETRAHEDRON_2: [Orbit; 1] = [s4(1.0 / 24.0, 0.138_196_601_125_010_5)];
const TETRAHEDRON_3: [Orbit; 2] = [
    s4(0.138_527_966_511_862 / 6.0, 0.328_054_696_711_426_6),
    s4(0.111_472_033_488_138 / 6.0, 0.106_952_273_932_930_6),
];
const TETRAHEDRON_5: [Orbit; 3] = [
    s4(0.018_781_320_953_002_643, 0.310_885_919_263_300_6),
    s4(0.012_248_840_519_393_659, 0.092_735_250_310_891_23),
    orbit(
        0.007_091_003_462_846_911,
        [0.045_503_704_125_649_65, 0.045_503_704_125_649_65, 0.454_496_295_874_350_35, 0.454_496_295_874_350_35],
    ),
];
const TETRAHEDRON_6: [Orbit; 4] = [
    s4(0.006_653_791_709_694_582, 0.214_602_871_259_152_03),
    s4(0.001_679_535_175_886_774, 0.040_673_958_534_611_35),
    s4(0.009_226_196_923_942_454, 0.322_337_890_142_275_5),
    orbit(
        0.008_035_714_285_714_286,
        [0.063_661_001_875_017_53, 0.063_661_001_875_017_53, 0.269_672_331_458_315_8, 0.603_005_664_791_649_1],
    ),
];

/// The symmetric rule for `degree`, where there is one.
pub(super) fn symmetric(kind: CellKind, degree: usize) -> Option<Rule> {
    let (degree, orbits): (usize, &[Orbit]) = match (kind, degree) {
        (CellKind::Triangle, 0 | 1) => (1, &TRIANGLE_1),
        (CellKind::Triangle, 2) => (2, &TRIANGLE_2),
        (CellKind::Triangle, 3 | 4) => (4, &TRIANGLE_4),
        (CellKind::Triangle, 5) => (5, &TRIANGLE_5),
        (CellKind::Triangle, 6) => (6, &TRIANGLE_6),
        (CellKind::Tetrahedron, 0 | 1) => (1, &TETRAHEDRON_1),
        (CellKind::Tetrahedron, 2) => (2, &TETRAHEDRON_2),
        (CellKind::Tetrahedron, 3) => (3, &TETRAHEDRON_3),
        (CellKind::Tetrahedron, 4 | 5) => (5, &TETRAHEDRON_5),
        (CellKind::Tetrahedron, 6) => (6, &TETRAHEDRON_6),
        _ => return None,
    };
    let dim = kind.dim();
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for orbit in orbits {
        let mut seen: Vec<[f64; 4]> = Vec::new();
        permute(orbit.barycentric, 0, dim + 1, &mut seen);
        for barycentric in seen {
            let mut point = [0.0; 3];
            point[..dim].copy_from_slice(&barycentric[1..=dim]);
            points.push(point);
            weights.push(orbit.weight);
        }
    }
    Some(Rule { kind, degree, points, weights })
}

/// The midpoints of the edges of a triangle, exact for degree 2 (Strang and Fix).
pub(super) fn edge_midpoints() -> Rule {
    let points = vec![[0.5, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.5, 0.0]];
    Rule { kind: CellKind::Triangle, degree: 2, points, weights: vec![1.0 / 6.0; 3] }
}

/// All distinct permutations of the first `n` coordinates, in a fixed order.
fn permute(point: [f64; 4], fixed: usize, n: usize, seen: &mut Vec<[f64; 4]>) {
    if fixed == n {
        if !seen.contains(&point) {
            seen.push(point);
        }
        return;
    }
    for other in fixed..n {
        let mut next = point;
        next.swap(fixed, other);
        permute(next, fixed + 1, n, seen);
    }
}

/// The cube `(u, v, w)` collapsed to a simplex: `x = u`, `y = (1 - u) v`, `z = (1 - u)(1 - v) w`,
/// whose jacobian `(1 - u)^(dim - 1) ...` is taken up by Gauss-Jacobi weights.
pub(super) fn collapsed(dim: usize, n: usize) -> (Vec<[f64; 3]>, Vec<f64>) {
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    let lines: Vec<Vec<(f64, f64)>> = (0..dim).map(|d| gauss_jacobi(n, (dim - 1 - d) as u32)).collect();
    for position in 0..n.pow(dim as u32) {
        let (mut point, mut weight, mut room, mut rest) = ([0.0; 3], 1.0, 1.0, position);
        for (x, line) in point.iter_mut().zip(&lines) {
            let (t, w) = line[rest % n];
            rest /= n;
            *x = room * t;
            room *= 1.0 - t;
            weight *= w;
        }
        points.push(point);
        weights.push(weight);
    }
    (points, weights)
}
