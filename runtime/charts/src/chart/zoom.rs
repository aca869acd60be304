//! A part of a chart, and its size on paper.
//!
//! Promises: what lies in the window is drawn as before, with its colours; faces, polygons and lines are cut at its border,
//! where their numbers are those between their corners. Points outside are left out and not counted as lost.

use super::Chart;
use crate::{
    colour::Colour,
    map::{Edge, Face, MapCell},
    series::{Drawn, Series},
};

/// Millimetres of a unit of a chart on paper: text of 13 units is 8 points high there.
const UNIT: f64 = 8.0 / 13.0 * 25.4 / 72.0;

/// Room for a map without title and ramp, in units.
const ROOM: [f64; 2] = [440.0, 330.0];

/// A corner of a polygon that is cut: place, number, kind of the edge behind it.
#[derive(Clone, Copy)]
struct Corner {
    at: [f64; 3],
    value: f64,
    edge: Edge,
}

/// A half plane: `sign * (x[axis] - limit) >= 0`.
#[derive(Clone, Copy)]
struct Side {
    axis: usize,
    sign: f64,
    limit: f64,
}

impl Side {
    fn of(low: [f64; 2], high: [f64; 2]) -> [Side; 4] {
        [(0, 1.0, low[0]), (0, -1.0, high[0]), (1, 1.0, low[1]), (1, -1.0, high[1])].map(|(axis, sign, limit)| Side {
            axis,
            sign,
            limit,
        })
    }

    fn depth(self, at: [f64; 3]) -> f64 {
        self.sign * (at[self.axis] - self.limit)
    }

    /// The part of a polygon on this side (Sutherland and Hodgman); the cut itself is no edge.
    fn cut(self, corners: &[Corner]) -> Vec<Corner> {
        let mut out = Vec::with_capacity(corners.len() + 2);
        for (k, a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            let (here, there) = (self.depth(a.at), self.depth(b.at));
            let between = |edge: Edge| {
                let s = here / (here - there);
                let at = std::array::from_fn(|d| a.at[d] + s * (b.at[d] - a.at[d]));
                Corner { at, value: a.value + s * (b.value - a.value), edge }
            };
            match (here >= 0.0, there >= 0.0) {
                (true, true) => out.push(*a),
                (true, false) => out.extend([*a, between(Edge::None)]),
                (false, true) => out.push(between(a.edge)),
                (false, false) => {}
            }
        }
        out
    }
}

fn inside(corners: Vec<Corner>, sides: &[Side; 4]) -> Option<Vec<Corner>> {
    let cut = sides.iter().fold(corners, |corners, side| side.cut(&corners));
    (cut.len() > 2).then_some(cut)
}

impl Face {
    fn within(&self, sides: &[Side; 4]) -> Option<Face> {
        let corner = |k: usize| Corner { at: self.corners[k], value: self.values[k], edge: self.edges[k] };
        let cut = inside((0..self.corners.len()).map(corner).collect(), sides)?;
        let (corners, rest): (Vec<_>, Vec<_>) = cut.into_iter().map(|c| (c.at, (c.value, c.edge))).unzip();
        let (values, edges) = rest.into_iter().unzip();
        Some(Face { corners, values, edges })
    }
}

impl MapCell {
    fn within(&self, sides: &[Side; 4]) -> Option<MapCell> {
        let corner = |p: &[f64; 2]| Corner { at: [p[0], p[1], 0.0], value: self.value, edge: Edge::None };
        let cut = inside(self.outline.iter().map(corner).collect(), sides)?;
        Some(MapCell { outline: cut.iter().map(|c| [c.at[0], c.at[1]]).collect(), ..self.clone() })
    }
}

/// The parts of a line in a window.
fn pieces(points: &[[f64; 2]], sides: &[Side; 4]) -> Vec<Vec<[f64; 2]>> {
    let mut out: Vec<Vec<[f64; 2]>> = Vec::new();
    for pair in points.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|p| [p[0], p[1], 0.0]);
        let (mut from, mut to) = (0.0f64, 1.0f64);
        for side in sides {
            let (here, there) = (side.depth(a), side.depth(b));
            match (here >= 0.0, there >= 0.0) {
                (true, true) => {}
                (true, false) => to = to.min(here / (here - there)),
                (false, true) => from = from.max(here / (here - there)),
                // a gap, where a number is not finite, is outside too
                (false, false) => to = -1.0,
            }
        }
        if from > to {
            continue;
        }
        let at = |s: f64| [0, 1].map(|d| a[d] + s * (b[d] - a[d]));
        let (start, end) = (at(from), at(to));
        match out.last_mut().filter(|line| from == 0.0 && line.last() == Some(&pair[0])) {
            Some(line) => line.push(if to == 1.0 { pair[1] } else { end }),
            None => out.push(vec![start, if to == 1.0 { pair[1] } else { end }]),
        }
    }
    out
}

impl Chart {
    /// Only what lies between two corners, in the units of the axes.
    #[must_use]
    pub fn zoom(mut self, low: [f64; 2], high: [f64; 2]) -> Self {
        let sides = Side::of(low, high);
        if let Some(map) = &mut self.map {
            // the ramp stays that of the whole
            map.range = Some(map.shown());
            map.faces = map.faces.iter().filter_map(|f| f.within(&sides)).collect();
            map.cells = map.cells.iter().filter_map(|c| c.within(&sides)).collect();
        }
        let mut series = Vec::new();
        let mut unnamed = 0;
        for (one, drawn) in std::mem::take(&mut self.series) {
            let colour = one.colour.unwrap_or(Colour::Palette(unnamed));
            unnamed += usize::from(one.colour.is_none());
            let part = |points: Vec<[f64; 2]>, name: &str| Series {
                name: name.to_owned(),
                points,
                notes: Vec::new(),
                colour: Some(colour),
                dashed: one.dashed,
            };
            let is_in = |p: &&[f64; 2]| sides.iter().all(|s| s.depth([p[0], p[1], 0.0]) >= 0.0);
            let seen: Vec<[f64; 2]> = one.points.iter().filter(is_in).copied().collect();
            let mut name = one.name.as_str();
            if drawn != Drawn::Points {
                for piece in pieces(&one.points, &sides) {
                    series.push((part(piece, name), Drawn::Line));
                    name = "";
                }
            }
            if drawn != Drawn::Line && !seen.is_empty() {
                series.push((part(seen, name), Drawn::Points));
            }
        }
        self.series = series;
        self.room = Some([low, high]);
        if self.equal {
            // as large as a picture of the whole would be
            let [dx, dy] = [high[0] - low[0], high[1] - low[1]];
            let scale = (ROOM[0] / dx).min(ROOM[1] / dy);
            self.size = [((scale * dx).max(120.0) + 150.0).max(360.0), (scale * dy).max(60.0) + 112.0];
        }
        self
    }

    /// The chart as wide as a column of a journal, in millimetres, with text of 8 points; as high as it was for its width.
    #[must_use]
    pub fn column(mut self, width: f64) -> Self {
        let units = width / UNIT;
        self.size = [units, self.size[1] * units / self.size[0]];
        self.paper = true;
        self
    }

    /// Width and height for a file that is printed; nothing for one that fills its place.
    pub(super) fn paper_size(&self, [w, h]: [f64; 2]) -> String {
        if self.paper { format!(r#" width="{:.2}mm" height="{:.2}mm""#, w * UNIT, h * UNIT) } else { String::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ramp, Scale};

    #[test]
    fn a_face_is_cut_with_its_numbers_and_the_cut_is_no_edge() {
        let corners = vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 4.0], [0.0, 2.0, 4.0]];
        let face = Face::new(corners, vec![0.0, 2.0, 2.0, 0.0], vec![Edge::Rim; 4]);
        let cut = face.within(&Side::of([1.0, -1.0], [3.0, 1.0])).unwrap();
        assert_eq!(cut.corners, [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 2.0], [1.0, 1.0, 2.0]]);
        assert_eq!(cut.values, [1.0, 2.0, 2.0, 1.0]);
        assert_eq!(cut.edges, [Edge::Rim, Edge::Rim, Edge::None, Edge::None]);
        assert_eq!(face.within(&Side::of([3.0, 0.0], [4.0, 1.0])), None);
    }

    #[test]
    fn a_line_that_leaves_and_comes_back_is_in_two_parts() {
        let line = [[0.0, 0.0], [1.0, 0.5], [2.0, 2.0], [3.0, 0.0], [4.0, 0.0], [5.0, f64::NAN]];
        let found = pieces(&line, &Side::of([0.5, 0.0], [9.0, 1.0]));
        let expected =
            [vec![[0.5, 0.25], [1.0, 0.5], [1.0 + 1.0 / 3.0, 1.0]], vec![[2.5, 1.0], [3.0, 0.0], [4.0, 0.0]]];
        assert_eq!(found.len(), 2);
        for (a, b) in found.iter().flatten().flatten().zip(expected.iter().flatten().flatten()) {
            assert!((a - b).abs() < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn a_column_has_its_width_and_a_window_its_axes() {
        let line = Series::new("a", [[0.0, 0.0], [10.0, 10.0]]);
        let chart = Chart::new("t").x("x", Scale::Linear).y("y", Scale::Linear).line(line).zoom([2.0, 2.0], [4.0, 4.0]);
        let text = chart.clone().column(85.0).svg();
        assert!(text.contains(r#"width="85.00mm""#), "{}", &text[..300]);
        // the axes go from 2 to 4
        assert!(text.contains(">3<") && !text.contains(">6<") && !text.contains(">0<"), "{text}");
        let map = Chart::new("m").surface(
            "q",
            Ramp::Viridis,
            [Face::new(vec![[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]], vec![0.0, 7.0, 0.0], vec![Edge::None; 3])],
        );
        // colours stay those of the whole
        assert_eq!(map.zoom([0.0, 0.0], [1.0, 1.0]).map.and_then(|m| m.range), Some([0.0, 7.0]));
    }
}
