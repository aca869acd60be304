//! An interface seen flat: coordinates in its plane, the parts of vectors along and across it, cuts through it.
//!
//! A curved interface is projected on the plane of its mean normal.

use crate::grid::Piece;

/// Cosines and sizes below this count as zero: coordinates are written exactly, so only rounding is between.
const ROUNDING: f64 = 1e-9;

/// A direction in space.
type Vector = [f64; 3];

/// An interface in its plane.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Surface {
    /// One or two directions in it, of length 1.
    pub(crate) along: Vec<Vector>,
    /// Names of the coordinates along them.
    pub(crate) names: Vec<String>,
    /// Across it, of length 1, its largest entry positive.
    pub(crate) normal: Vector,
    /// Every facet lies in the plane.
    pub(crate) flat: bool,
    origin: Vector,
}

/// A scalar of an interface.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Quantity {
    /// What it is, for an axis.
    pub(crate) label: String,
    /// The array it comes from, whose unit it has.
    pub(crate) source: String,
    /// A value a point.
    pub(crate) numbers: Vec<f64>,
}

impl Surface {
    /// The plane of a piece of lines (`dim` 1) or facets (`dim` 2); `None` if it has no extent.
    pub(crate) fn of(piece: &Piece) -> Option<Self> {
        let first = *piece.points.first()?;
        let far = |from: Vector| {
            piece.points.iter().copied().max_by(|a, b| size(sub(*a, from)).total_cmp(&size(sub(*b, from))))
        };
        let a = far(first)?;
        let chord = unit(sub(far(a)?, a))?;
        let (mut along, normal) = if piece.dim == 1 {
            let chord = positive(chord);
            (vec![chord], positive([-chord[1], chord[0], 0.0]))
        } else {
            let normal = positive(mean_normal(piece)?);
            let axes = in_plane(normal);
            (axes.to_vec(), normal)
        };
        let names: Vec<String> = along.iter().enumerate().map(|(k, d)| direction_name(*d, k, piece.dim)).collect();
        // coordinates of the scene where the plane has them, distances from the first point otherwise
        let named = |n: &String| matches!(n.as_str(), "x" | "y" | "z");
        let origin = if names.iter().all(named) { [0.0; 3] } else { lowest(piece, &along) };
        let extent = piece.points.iter().map(|p| size(sub(*p, first))).fold(0.0, f64::max);
        let flat = piece.points.iter().all(|p| dot(sub(*p, first), normal).abs() <= ROUNDING.sqrt() * extent);
        along.truncate(piece.dim);
        Some(Surface { along, names, normal, flat, origin })
    }

    /// Coordinates of a point in the plane; the second one is 0 on a line.
    pub(crate) fn at(&self, point: Vector) -> [f64; 2] {
        let p = sub(point, self.origin);
        [dot(p, self.along[0]), self.along.get(1).map_or(0.0, |d| dot(p, *d))]
    }

    /// Scalars of the arrays that live on the interface: numbers as they are, vectors by their part across and along a
    /// flat one, by their components otherwise. Parts that are only rounding are left out.
    pub(crate) fn quantities(&self, piece: &Piece) -> Vec<Quantity> {
        let mut found = Vec::new();
        for array in &piece.point_data {
            let name = &array.name;
            let vectors = || array.numbers.chunks_exact(3).map(|v| [v[0], v[1], v[2]]);
            let mut parts: Vec<(String, Vec<f64>)> = Vec::new();
            match array.width {
                1 => parts.push((name.clone(), array.numbers.clone())),
                3 if self.flat => {
                    parts.push((format!("{name} across"), vectors().map(|v| dot(v, self.normal)).collect()));
                    if let [direction] = self.along[..] {
                        parts.push((format!("{name} along"), vectors().map(|v| dot(v, direction)).collect()));
                    } else {
                        let part = |v: Vector| size(sub(v, scaled(self.normal, dot(v, self.normal))));
                        parts.push((format!("|{name} along|"), vectors().map(part).collect()));
                    }
                }
                3 => {
                    for (d, axis) in ["x", "y", "z"].iter().enumerate() {
                        parts.push((format!("{name} {axis}"), vectors().map(|v| v[d]).collect()));
                    }
                }
                _ => {}
            }
            let largest = array.numbers.iter().filter(|x| x.is_finite()).fold(0.0f64, |m, x| m.max(x.abs()));
            let alone = parts.len() == 1;
            for (label, numbers) in parts {
                let rounding = numbers.iter().all(|x| x.abs() <= ROUNDING * largest);
                if alone || !rounding {
                    found.push(Quantity { label, source: name.clone(), numbers });
                }
            }
        }
        found
    }

    /// Values along a line of the plane: where the other coordinate has this value. `axis` is the one that runs. On an
    /// interface that is a line itself, all its points. Between the corners of a facet a value is taken linearly.
    pub(crate) fn cut(&self, piece: &Piece, axis: usize, other: f64, numbers: &[f64]) -> Vec<[f64; 2]> {
        let mut points: Vec<[f64; 2]> = Vec::new();
        for cell in &piece.cells {
            for (k, a) in cell.iter().enumerate() {
                let b = cell[(k + 1) % cell.len()];
                let (p, q) = (self.at(piece.points[*a]), self.at(piece.points[b]));
                if self.along.len() == 1 {
                    points.push([p[0], numbers[*a]]);
                    continue;
                }
                let (lower, upper) = (p[1 - axis] - other, q[1 - axis] - other);
                if lower * upper <= 0.0 && lower != upper {
                    let share = lower / (lower - upper);
                    let between = |a: f64, b: f64| a + share * (b - a);
                    points.push([between(p[axis], q[axis]), between(numbers[*a], numbers[b])]);
                }
            }
        }
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let length = points.last().zip(points.first()).map_or(0.0, |(b, a)| b[0] - a[0]);
        points.dedup_by(|b, a| {
            b[0] - a[0] <= ROUNDING * length && (b[1] == a[1] || (b[1] - a[1]).abs() <= ROUNDING * a[1].abs())
        });
        points
    }

    /// The middle of a coordinate.
    pub(crate) fn middle(&self, piece: &Piece, axis: usize) -> f64 {
        let values = piece.points.iter().map(|p| self.at(*p)[axis]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        0.5 * (low + high)
    }
}

fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn scaled(a: Vector, s: f64) -> Vector {
    a.map(|x| s * x)
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn size(a: Vector) -> f64 {
    a[0].hypot(a[1]).hypot(a[2])
}

fn unit(a: Vector) -> Option<Vector> {
    let s = size(a);
    (s > 0.0 && s.is_finite()).then(|| a.map(|x| if (x / s).abs() < ROUNDING { 0.0 } else { x / s }))
}

/// The direction or its opposite: that with a positive largest entry.
fn positive(a: Vector) -> Vector {
    let largest = a.into_iter().fold(0.0f64, |m, x| if x.abs() > m.abs() { x } else { m });
    if largest < 0.0 { a.map(|x| if x == 0.0 { 0.0 } else { -x }) } else { a }
}

/// The mean normal of facets, weighted by their areas; facets are oriented to the side of the first.
fn mean_normal(piece: &Piece) -> Option<Vector> {
    let mut sum = [0.0; 3];
    for cell in piece.cells.iter().filter(|c| c.len() > 2) {
        let p = |k: usize| piece.points[cell[k]];
        let last = cell.len() - 1;
        let area = cross(sub(p(1), p(0)), sub(p(last), p(0)));
        let side = if dot(area, sum) < 0.0 { -1.0 } else { 1.0 };
        sum = [sum[0] + side * area[0], sum[1] + side * area[1], sum[2] + side * area[2]];
    }
    unit(sum)
}

/// Two directions of a plane: axes of the scene where it has them, the first one as level as it can be.
fn in_plane(normal: Vector) -> [Vector; 2] {
    let axis = |d: usize| [0, 1, 2].map(|k| if k == d { 1.0 } else { 0.0 });
    let free: Vec<usize> = (0..3).filter(|d| normal[*d].abs() < ROUNDING).collect();
    let first = match free[..] {
        [a, b] => return [axis(a), axis(b)],
        [a] => axis(a),
        _ => unit(cross([0.0, 0.0, 1.0], normal)).unwrap_or([1.0, 0.0, 0.0]),
    };
    [first, positive(unit(cross(normal, first)).unwrap_or([0.0, 1.0, 0.0]))]
}

fn direction_name(d: Vector, number: usize, dim: usize) -> String {
    for (k, name) in ["x", "y", "z"].iter().enumerate() {
        if (d[k].abs() - 1.0).abs() < ROUNDING {
            return (*name).to_owned();
        }
    }
    if dim == 1 { "s".to_owned() } else { format!("s{}", number + 1) }
}

/// The corner with the lowest coordinates, so that distances start at 0.
fn lowest(piece: &Piece, along: &[Vector]) -> Vector {
    let mut origin = [0.0; 3];
    for d in along {
        let low = piece.points.iter().map(|p| dot(*p, *d)).fold(f64::INFINITY, f64::min);
        if !["x", "y", "z"].contains(&direction_name(*d, 0, 1).as_str()) {
            origin = [origin[0] + low * d[0], origin[1] + low * d[1], origin[2] + low * d[2]];
        }
    }
    origin
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Values;

    /// A square of 2 x 2 facets with these corners.
    fn square(corner: impl Fn(f64, f64) -> Vector) -> Piece {
        let points: Vec<Vector> = (0..9).map(|k| corner(f64::from(k % 3), f64::from(k / 3))).collect();
        let cells = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]].map(|c| c.to_vec()).to_vec();
        Piece { points, cells, dim: 2, ..Piece::default() }
    }

    #[test]
    fn a_plane_across_x_has_the_coordinates_of_the_scene() {
        let surface = Surface::of(&square(|a, b| [5.0, a - 1.0, b])).unwrap();
        assert_eq!((surface.names.join(" ").as_str(), surface.normal, surface.flat), ("y z", [1.0, 0.0, 0.0], true));
        assert_eq!(surface.at([5.0, -1.0, 2.0]), [-1.0, 2.0]);
    }

    #[test]
    fn an_inclined_plane_has_distances_from_its_lowest_corner() {
        // dip of 30 degrees about y: e = (cos, 0, sin)
        let (c, s) = (0.75f64.sqrt(), 0.5);
        let surface = Surface::of(&square(|a, b| [3.0 + b * c, a, 7.0 + b * s])).unwrap();
        assert_eq!(surface.names, ["y", "s2"]);
        let [y, along] = surface.at([3.0 + 2.0 * c, 1.0, 7.0 + 2.0 * s]);
        assert!((y - 1.0).abs() < 1e-12 && (along - 2.0).abs() < 1e-12, "{y} {along}");
        assert!((surface.normal[2] - c).abs() < 1e-12 && surface.flat);
    }

    #[test]
    fn vectors_are_taken_apart_and_rounding_is_left_out() {
        let mut piece = square(|a, b| [0.0, a, b]);
        let slip = [1e-17, 3.0, 4.0].repeat(9);
        let traction = [-2.0, 0.0, 1.0].repeat(9);
        piece.point_data.push(Values { name: "slip".into(), width: 3, numbers: slip });
        piece.point_data.push(Values { name: "p".into(), width: 3, numbers: traction });
        let found = Surface::of(&piece).unwrap().quantities(&piece);
        let shown: Vec<(&str, f64)> = found.iter().map(|q| (q.label.as_str(), q.numbers[4])).collect();
        assert_eq!(shown, [("|slip along|", 5.0), ("p across", -2.0), ("|p along|", 1.0)]);
    }

    #[test]
    fn a_cut_is_linear_between_corners() {
        let piece = square(|a, b| [0.0, a, b]);
        let surface = Surface::of(&piece).unwrap();
        let values: Vec<f64> = piece.points.iter().map(|p| 10.0 * p[1] + p[2]).collect();
        let cut = surface.cut(&piece, 0, 0.5, &values);
        assert_eq!(cut, [[0.0, 0.5], [1.0, 10.5], [2.0, 20.5]]);
        assert_eq!(surface.middle(&piece, 1), 1.0);
    }

    #[test]
    fn a_line_in_the_plane_has_its_own_coordinate() {
        let points = (0..3).map(|k| [f64::from(k), f64::from(k), 0.0]).collect();
        let piece = Piece { points, cells: vec![vec![0, 1], vec![1, 2]], dim: 1, ..Piece::default() };
        let surface = Surface::of(&piece).unwrap();
        let cut = surface.cut(&piece, 0, 0.0, &[5.0, 6.0, 7.0]);
        assert_eq!(surface.names, ["s"]);
        assert_eq!(cut.len(), 3);
        assert!((cut[2][0] - 8f64.sqrt()).abs() < 1e-12 && cut[2][1] == 7.0, "{cut:?}");
    }
}
