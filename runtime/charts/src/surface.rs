//! A surface in the picture: faces with depths, written from the farthest to the nearest.
//!
//! Promises: a colour is that of the number at its place, with no shade on it. In an SVG a face is a few polygons of one
//! colour each; faces are sorted by the depth of their middles, so long ones that pass each other can be wrong there.
//! The picture of pixels decides at every pixel.

use std::{collections::BTreeMap, fmt::Write};

use crate::{colour::Ramp, map::Edge};

/// Polygons of a surface in an SVG, if its faces are fewer: about 60 bytes each.
const POLYGONS: usize = 2000;
/// Most parts of a face along one of its sides.
const PARTS: usize = 8;
/// Colours of a surface in an SVG.
const LEVELS: f64 = 96.0;

/// Faces at their places, y down, depth towards the reader.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    pub(crate) ramp: Ramp,
    pub(crate) faces: Vec<Placed>,
}

/// A face with its numbers on the ramp.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) corners: Vec<[f64; 3]>,
    pub(crate) tones: Vec<f64>,
    pub(crate) edges: Vec<Edge>,
}

impl Surface {
    pub(crate) fn new(ramp: Ramp) -> Self {
        Surface { ramp, faces: Vec::new() }
    }

    /// Adds a face; one with a number that has no colour is left out.
    pub(crate) fn push(&mut self, corners: Vec<[f64; 3]>, tones: Vec<f64>, edges: Vec<Edge>) {
        if corners.len() > 2 && tones.iter().chain(corners.as_flattened()).all(|x| x.is_finite()) {
            self.faces.push(Placed { corners, tones, edges });
        }
    }

    /// Parts of a face along one of its sides, so that polygons stay few.
    pub(crate) fn parts(&self) -> usize {
        (1..=PARTS).rev().find(|n| n * n * self.faces.len() <= POLYGONS).unwrap_or(1)
    }

    /// All faces are in one plane across the view: none hides another.
    pub(crate) fn is_flat(&self) -> bool {
        self.faces.iter().flat_map(|f| &f.corners).all(|c| c[2] == 0.0)
    }

    /// The faces from the farthest to the nearest.
    pub(crate) fn farthest_first(&self) -> Vec<&Placed> {
        let mut order: Vec<(f64, usize)> = self.faces.iter().enumerate().map(|(k, f)| (f.depth(), k)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.into_iter().map(|(_, k)| &self.faces[k]).collect()
    }

    /// Writes the surface as SVG.
    pub(crate) fn write(&self, out: &mut String) {
        let parts = self.parts();
        out.push_str("<g class=\"f\">\n");
        if self.is_flat() {
            self.write_flat(out, parts)
        } else {
            self.write_sorted(out, parts)
        }
        out.push_str("</g>\n");
    }

    /// A plane hides nothing: one path a colour, then the edges.
    fn write_flat(&self, out: &mut String, parts: usize) {
        let mut paths: BTreeMap<u32, String> = BTreeMap::new();
        let (mut mesh, mut rim) = (String::new(), String::new());
        for face in &self.faces {
            for (corners, tone) in face.parts(parts) {
                close(paths.entry(level(tone)).or_default(), &corners);
            }
            face.edges(&mut mesh, &mut rim);
        }
        for (level, path) in paths {
            self.path(out, level, &path);
        }
        edges(out, &mesh, &rim);
    }

    fn write_sorted(&self, out: &mut String, parts: usize) {
        for face in self.farthest_first() {
            let mut paths: BTreeMap<u32, String> = BTreeMap::new();
            for (corners, tone) in face.parts(parts) {
                close(paths.entry(level(tone)).or_default(), &corners);
            }
            for (level, path) in paths {
                self.path(out, level, &path);
            }
            let (mut mesh, mut rim) = (String::new(), String::new());
            face.edges(&mut mesh, &mut rim);
            edges(out, &mesh, &rim);
        }
    }

    fn path(&self, out: &mut String, level: u32, path: &str) {
        let colour = self.ramp.hex(f64::from(level) / LEVELS);
        // a rim of the same colour closes the hairlines between neighbours; writing to a string cannot fail
        let _ = writeln!(out, r#"<path fill="{colour}" stroke="{colour}" d="{path}"/>"#);
    }
}

impl Placed {
    /// How near its middle is.
    fn depth(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a few corners")]
        let n = self.corners.len() as f64;
        self.corners.iter().map(|c| c[2]).sum::<f64>() / n
    }

    fn edges(&self, mesh: &mut String, rim: &mut String) {
        for (k, edge) in self.edges.iter().enumerate() {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % self.corners.len()]);
            let path = match edge {
                Edge::None => continue,
                Edge::Mesh => &mut *mesh,
                Edge::Rim => &mut *rim,
            };
            let _ = write!(path, "M{:.1},{:.1}L{:.1},{:.1}", a[0], a[1], b[0], b[1]);
        }
    }

    /// Polygons of one tone each: triangles and quadrilaterals in `n` parts along each side, others as they are.
    pub(crate) fn parts(&self, n: usize) -> Vec<(Vec<[f64; 2]>, f64)> {
        let whole = || {
            #[expect(clippy::cast_precision_loss, reason = "a few corners")]
            let tone = self.tones.iter().sum::<f64>() / self.tones.len() as f64;
            vec![(self.corners.iter().map(|c| [c[0], c[1]]).collect(), tone)]
        };
        let (low, high) =
            self.tones.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(*t), b.max(*t)));
        // no more parts than it has colours
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the number of levels")]
        let n = n.min(((high - low) * LEVELS).ceil().max(1.0) as usize);
        match self.corners.len() {
            _ if n < 2 => whole(),
            3 => self.triangle_parts(n),
            4 => self.quadrilateral_parts(n),
            _ => whole(),
        }
    }

    fn quadrilateral_parts(&self, n: usize) -> Vec<(Vec<[f64; 2]>, f64)> {
        let at = |u: f64, v: f64| {
            let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v];
            self.mixed(&weights)
        };
        let mut parts = Vec::with_capacity(n * n);
        for i in 0..n {
            for j in 0..n {
                let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[i, j]| {
                    let (point, _) = at(share(i, n), share(j, n));
                    point
                });
                let (_, tone) = at(share(2 * i + 1, 2 * n), share(2 * j + 1, 2 * n));
                parts.push((corners.to_vec(), tone));
            }
        }
        parts
    }

    fn triangle_parts(&self, n: usize) -> Vec<(Vec<[f64; 2]>, f64)> {
        let at = |i: usize, j: usize, of: usize| {
            let (u, v) = (share(i, of), share(j, of));
            self.mixed(&[1.0 - u - v, u, v])
        };
        let mut parts = Vec::with_capacity(n * n);
        for i in 0..n {
            for j in 0..n - i {
                let lower = [[i, j], [i + 1, j], [i, j + 1]].map(|[i, j]| at(i, j, n).0);
                parts.push((lower.to_vec(), at(3 * i + 1, 3 * j + 1, 3 * n).1));
                if i + j + 1 < n {
                    let upper = [[i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[i, j]| at(i, j, n).0);
                    parts.push((upper.to_vec(), at(3 * i + 2, 3 * j + 2, 3 * n).1));
                }
            }
        }
        parts
    }

    fn mixed(&self, weights: &[f64]) -> ([f64; 2], f64) {
        let (mut point, mut tone) = ([0.0; 2], 0.0);
        for ((corner, t), w) in self.corners.iter().zip(&self.tones).zip(weights) {
            point = [point[0] + w * corner[0], point[1] + w * corner[1]];
            tone += w * t;
        }
        (point, tone)
    }
}

#[expect(clippy::cast_precision_loss, reason = "few parts")]
fn share(k: usize, n: usize) -> f64 {
    k as f64 / n as f64
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and the number of levels")]
fn level(tone: f64) -> u32 {
    (tone.clamp(0.0, 1.0) * LEVELS).round() as u32
}

/// Adds a closed polygon: its first corner, then the steps from corner to corner of what was written, so that rounding
/// does not add up.
fn close(path: &mut String, corners: &[[f64; 2]]) {
    let tenth = |p: [f64; 2]| p.map(|x| (10.0 * x).round());
    let mut last = tenth(corners[0]);
    let _ = write!(path, "M{},{}l", last[0] / 10.0, last[1] / 10.0);
    for (k, corner) in corners.iter().enumerate().skip(1) {
        let next = tenth(*corner);
        let blank = if k > 1 { " " } else { "" };
        let _ = write!(path, "{blank}{},{}", (next[0] - last[0]) / 10.0, (next[1] - last[1]) / 10.0);
        last = next;
    }
    path.push('z');
}

fn edges(out: &mut String, mesh: &str, rim: &str) {
    for (class, path) in [("fm", mesh), ("fr", rim)] {
        if !path.is_empty() {
            let _ = writeln!(out, r#"<path class="{class}" d="{path}"/>"#);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(depth: f64, tones: [f64; 4]) -> Placed {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| [x, y, depth]).to_vec();
        Placed { corners, tones: tones.to_vec(), edges: vec![Edge::Rim; 4] }
    }

    #[test]
    fn parts_of_a_face_have_the_colours_of_their_middles() {
        let parts = square(0.0, [0.0, 1.0, 1.0, 0.0]).parts(2);
        assert_eq!(parts.iter().map(|p| p.1).collect::<Vec<_>>(), [0.25, 0.25, 0.75, 0.75]);
        let triangle = Placed {
            corners: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            tones: vec![0.0, 0.9, 0.0],
            edges: vec![Edge::None; 3],
        };
        let tones: Vec<f64> = triangle.parts(3).iter().map(|p| (p.1 * 10.0).round()).collect();
        assert_eq!(tones.len(), 9);
        assert_eq!((tones[0], tones.iter().copied().fold(0.0, f64::max)), (1.0, 7.0));
        // one colour needs no parts
        assert_eq!(square(0.0, [0.5; 4]).parts(8).len(), 1);
    }

    #[test]
    fn near_faces_are_written_last() {
        let mut surface = Surface::new(Ramp::Viridis);
        surface.faces = vec![square(1.0, [1.0; 4]), square(-1.0, [0.0; 4])];
        let mut text = String::new();
        surface.write(&mut text);
        assert!(text.find("#440154").unwrap() < text.find("#fde725").unwrap(), "{text}");
    }
}
