//! Rules on the parts of a reference cell that is divided evenly: what a formula is sampled with that a rule of a few
//! points may miss.
//!
//! Tensor cells are divided into `parts` along each direction; simplices into `parts^dim` simplices of the same volume
//! (Kuhn's division of the cubes of a lattice, of which those inside are kept), wedges into parts of their triangle and of
//! their height, pyramids into parts of their base and of their height. Promises: weights are positive and sum up
//! to the volume, the degree is that of the rule on each part.

use super::{QuadratureError, Rule, product, pyramid, rule};
use crate::cell::{Basis, CellKind};

/// The orders of the axes by which a point of a cube is in one of its simplices.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// [`rule`] of a degree on each of the `parts^dim` even parts of a reference cell; on the layers of a pyramid one with a
/// point more.
///
/// # Errors
/// [`QuadratureError`] of [`rule`], and where `parts` is 0.
pub fn composite(kind: CellKind, degree: usize, parts: usize) -> Result<Rule, QuadratureError> {
    if parts == 0 {
        return Err(QuadratureError::NoPoints);
    }
    let one = rule(kind, degree)?;
    if parts == 1 || kind.dim() == 0 {
        return Ok(one);
    }
    match kind.basis() {
        Basis::Wedge => {
            let [triangle, segment] = [CellKind::Triangle, CellKind::Segment].map(|k| composite(k, degree, parts));
            return Ok(product(kind, &triangle?, &segment?));
        }
        Basis::Pyramid => {
            let (points, weights) = pyramid::composite(degree / 2 + 1, parts);
            return Ok(Rule { points, weights, ..one });
        }
        Basis::Simplex | Basis::Tensor => {}
    }
    let n = parts.pow(u32::try_from(kind.dim()).unwrap_or(3));
    let mut out = Rule { points: Vec::new(), weights: Vec::new(), ..one.clone() };
    if kind.basis() == Basis::Simplex && kind.dim() > 1 {
        for corners in simplices(kind.dim(), parts) {
            for point in &one.points {
                let first = 1.0 - point.iter().sum::<f64>();
                out.points.push(std::array::from_fn(|d| {
                    first * corners[0][d] + (0..kind.dim()).map(|k| point[k] * corners[k + 1][d]).sum::<f64>()
                }));
            }
            out.weights.extend(one.weights.iter().map(|w| w / n as f64));
        }
        return Ok(out);
    }
    for part in 0..n {
        let corner = lattice(part, parts);
        for (point, weight) in one.points.iter().zip(&one.weights) {
            let dim = kind.dim();
            let at = |d: usize| if d < dim { (corner[d] as f64 + point[d]) / parts as f64 } else { 0.0 };
            out.points.push(std::array::from_fn(at));
            out.weights.push(weight / n as f64);
        }
    }
    Ok(out)
}

/// The corner of a part of a lattice, in parts.
fn lattice(mut part: usize, parts: usize) -> [usize; 3] {
    std::array::from_fn(|_| {
        let at = part % parts;
        part /= parts;
        at
    })
}

/// The vertices of the parts of the reference triangle or tetrahedron. In the coordinates `1 >= a >= b >= c >= 0`, of
/// which the barycentric ones are the differences, it is one simplex of a cube, and so are its parts.
fn simplices(dim: usize, parts: usize) -> Vec<[[f64; 3]; 4]> {
    let mut out = Vec::new();
    let n = parts.pow(u32::try_from(dim).unwrap_or(3));
    for part in 0..n {
        let corner = lattice(part, parts);
        for order in ORDERS.iter().filter(|o| dim == 3 || o[2] == 2) {
            let mut at: [f64; 3] = std::array::from_fn(|d| if d < dim { corner[d] as f64 } else { 0.0 });
            let mut vertices = [at; 4];
            for (k, axis) in order.iter().take(dim).enumerate() {
                at[*axis] += 1.0;
                vertices[k + 1] = at;
            }
            let is_inside = vertices[..=dim].iter().all(|v| (1..dim).all(|d| v[d - 1] >= v[d]));
            if is_inside {
                let m = parts as f64;
                out.push(vertices.map(|v| std::array::from_fn(|d| (v[d] - if d < 2 { v[d + 1] } else { 0.0 }) / m)));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral of `x^a y^b z^c` over a reference cell.
    fn exact(kind: CellKind, powers: [u32; 3]) -> f64 {
        let whole = rule(kind, 6).expect("a rule");
        let term = |x: &[f64; 3]| (0..kind.dim()).map(|d| x[d].powi(powers[d] as i32)).product::<f64>();
        whole.points.iter().zip(&whole.weights).map(|(x, w)| w * term(x)).sum()
    }

    #[test]
    fn parts_have_the_degree_of_their_rule_and_positive_weights_inside() {
        for kind in CellKind::ALL.into_iter().filter(|k| k.dim() > 0) {
            for parts in [1, 2, 3, 5] {
                let made = composite(kind, 3, parts).expect("a rule");
                let n = parts.pow(u32::try_from(kind.dim()).unwrap());
                let of_one = match kind.basis() {
                    // two lines of two points and one of three
                    Basis::Pyramid if parts > 1 => 12,
                    _ => rule(kind, 3).expect("a rule").n_points(),
                };
                assert_eq!(made.n_points(), n * of_one, "{kind} {parts}");
                assert!(made.weights.iter().all(|w| *w > 0.0));
                assert!(made.points.iter().flatten().all(|x| (-1e-14..=1.0 + 1e-14).contains(x)), "{kind}");
                for powers in [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 1, 0], [1, 1, 1], [3, 0, 0], [0, 0, 3]] {
                    let powers = std::array::from_fn(|d| if d < kind.dim() { powers[d] } else { 0 });
                    let term = |x: &[f64; 3]| (0..kind.dim()).map(|d| x[d].powi(powers[d] as i32)).product::<f64>();
                    // part by part: one sum over a thousand points has more rounding than the rule
                    let parts_of = made.points.chunks(of_one).zip(made.weights.chunks(of_one));
                    let part = |(x, w): (&[[f64; 3]], &[f64])| x.iter().zip(w).map(|(x, w)| w * term(x)).sum::<f64>();
                    let sum: f64 = parts_of.map(part).sum();
                    assert!((sum - exact(kind, powers)).abs() < 1e-14, "{kind} {parts} {powers:?}: {sum}");
                }
            }
        }
    }

    #[test]
    fn no_parts_are_no_rule() {
        assert_eq!(composite(CellKind::Triangle, 2, 0), Err(QuadratureError::NoPoints));
    }
}
