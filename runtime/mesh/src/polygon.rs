//! Polygons in a plane: the part of one inside another, what is left of it, areas.
//!
//! Corners are cut by one line after the other (Sutherland and Hodgman 1974), so the polygon that cuts has to be convex and
//! to go around counter-clockwise, the one that is cut may be any. A corner within a tolerance (a length) outside of a line
//! counts as inside: sides that coincide leave no slivers. Promises: the same polygons for the same corners. Does not know
//! meshes.

/// Corners in their order.
pub type Polygon = Vec<[f64; 2]>;

/// The area, positive where the corners go around counter-clockwise.
#[must_use]
pub fn area(polygon: &[[f64; 2]]) -> f64 {
    let Some(first) = polygon.first() else { return 0.0 };
    let from = |p: &[f64; 2]| [p[0] - first[0], p[1] - first[1]];
    let twice = |pair: &[[f64; 2]]| {
        let [a, b] = [from(&pair[0]), from(&pair[1])];
        a[0] * b[1] - a[1] * b[0]
    };
    0.5 * polygon.windows(2).map(twice).sum::<f64>()
}

/// The mean of the corners.
#[must_use]
pub fn middle(polygon: &[[f64; 2]]) -> [f64; 2] {
    #[expect(clippy::cast_precision_loss, reason = "few corners")]
    let n = polygon.len().max(1) as f64;
    [0, 1].map(|d| polygon.iter().map(|p| p[d]).sum::<f64>() / n)
}

/// By corner how far inside of a side of a polygon it is; `None` for a side without length.
fn distances(polygon: &[[f64; 2]], [a, b]: [[f64; 2]; 2], tolerance: f64) -> Option<Vec<f64>> {
    let e = [b[0] - a[0], b[1] - a[1]];
    let length = e[0].hypot(e[1]);
    let of = |p: &[f64; 2]| (e[0] * (p[1] - a[1]) - e[1] * (p[0] - a[0])) / length;
    (length > tolerance).then(|| polygon.iter().map(of).collect())
}

/// The part of a polygon whose corners have these distances from a line that is not outside of it.
fn half(polygon: &[[f64; 2]], distances: &[f64], tolerance: f64) -> Polygon {
    let mut part = Polygon::with_capacity(polygon.len() + 1);
    let n = polygon.len();
    for k in 0..n {
        let before = (k + n - 1) % n;
        let (p, q, of_p, of_q) = (polygon[before], polygon[k], distances[before], distances[k]);
        if (of_p >= -tolerance) != (of_q >= -tolerance) {
            let s = of_p / (of_p - of_q);
            part.push([p[0] + (q[0] - p[0]) * s, p[1] + (q[1] - p[1]) * s]);
        }
        if of_q >= -tolerance {
            part.push(q);
        }
    }
    part
}

/// The sides of a polygon.
fn sides(polygon: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
    (0..polygon.len()).map(|k| [polygon[k], polygon[(k + 1) % polygon.len()]])
}

/// Without corners that coincide; nothing where fewer than three are left.
fn cleaned(polygon: &[[f64; 2]], tolerance: f64) -> Polygon {
    let apart = |[p, q]: &[[f64; 2]; 2]| (q[0] - p[0]).hypot(q[1] - p[1]) > tolerance;
    let kept: Polygon = sides(polygon).filter(apart).map(|[p, _]| p).collect();
    if kept.len() < 3 { Polygon::new() } else { kept }
}

/// The part of a polygon inside a window; empty where there is none.
#[must_use]
pub fn inside(polygon: &[[f64; 2]], window: &[[f64; 2]], tolerance: f64) -> Polygon {
    let mut part = polygon.to_vec();
    for side in sides(window) {
        if let Some(distances) = distances(&part, side, tolerance) {
            part = half(&part, &distances, tolerance);
        }
    }
    cleaned(&part, tolerance)
}

/// What is left of a convex polygon outside of a window, in pieces that are convex and do not overlap.
#[must_use]
pub fn outside(polygon: &[[f64; 2]], window: &[[f64; 2]], tolerance: f64) -> Vec<Polygon> {
    let mut rest = polygon.to_vec();
    let mut pieces = Vec::new();
    for side in sides(window) {
        let Some(distances) = distances(&rest, side, tolerance) else { continue };
        let outwards: Vec<f64> = distances.iter().map(|d| -d).collect();
        pieces.push(cleaned(&half(&rest, &outwards, tolerance), tolerance));
        rest = half(&rest, &distances, tolerance);
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: f64 = 1e-12;

    /// Corners on a circle, at angles that follow no pattern.
    fn convex(seed: u32, centre: [f64; 2], radius: f64) -> Polygon {
        let n = 3 + seed % 4;
        let part = |k: u32| f64::from((k * 7919 + seed * 104_729) % 1009) / 1009.0;
        let angle = |k: u32| (f64::from(k) + 0.8 * part(k)) * std::f64::consts::TAU / f64::from(n);
        (0..n).map(|k| [centre[0] + radius * angle(k).cos(), centre[1] + radius * angle(k).sin()]).collect()
    }

    fn holds(polygon: &[[f64; 2]], p: [f64; 2]) -> bool {
        sides(polygon).all(|side| distances(&[p], side, 0.0).is_none_or(|d| d[0] >= 0.0))
    }

    #[test]
    fn what_is_inside_and_what_is_outside_are_the_whole() {
        for seed in 0..200 {
            let part = |k: u32| f64::from((seed * 611_953 + k) % 997) / 997.0;
            let polygon = convex(seed, [0.0, 0.0], 1.0);
            let window = convex(seed + 77, [2.4 * part(3) - 1.2, 2.4 * part(5) - 1.2], 0.3 + part(7));
            let common = inside(&polygon, &window, TOLERANCE);
            let left = outside(&polygon, &window, TOLERANCE);
            let sum = area(&common) + left.iter().map(|p| area(p)).sum::<f64>();
            assert!((sum - area(&polygon)).abs() < 1e-14, "{seed}: {sum} of {}", area(&polygon));
            // each point of a grid lies in one of them, as its place says
            for (i, j) in (0..21).flat_map(|i| (0..21).map(move |j| (i, j))) {
                let p = [f64::from(i) / 10.0 - 0.9987, f64::from(j) / 10.0 - 1.0013];
                let both = holds(&polygon, p) && holds(&window, p);
                assert_eq!(!common.is_empty() && holds(&common, p), both, "{seed} {p:?}");
                let pieces = left.iter().filter(|piece| holds(piece, p)).count();
                assert_eq!(pieces, usize::from(holds(&polygon, p) && !holds(&window, p)), "{seed} {p:?}");
            }
        }
    }

    #[test]
    fn sides_that_coincide_leave_no_slivers() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(inside(&square, &square, TOLERANCE).len(), 4);
        assert!(outside(&square, &square, TOLERANCE).is_empty());
        let beside = square.map(|[x, y]| [x + 1.0, y + 1e-15]);
        assert!(area(&inside(&beside, &square, TOLERANCE)).abs() < 1e-11);
        let lower = [[-1.0, -1.0], [2.0, -1.0], [2.0, 0.25], [-1.0, 0.25]];
        assert_eq!(area(&inside(&square, &lower, TOLERANCE)), 0.25);
    }

    #[test]
    fn the_polygon_that_is_cut_may_have_corners_that_go_in() {
        // an arrow of area 1.5 in the square [0, 2]^2 and its left half
        let arrow = [[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.5, 1.0]];
        let left = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]];
        assert_eq!(area(&arrow), 1.5);
        // by hand: between the lines to the tip up to x = 1 there are 1.5, less the notch of 0.5
        assert!((area(&inside(&arrow, &left, TOLERANCE)) - 1.0).abs() < 1e-15);
    }
}
