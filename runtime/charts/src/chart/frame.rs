//! The room of a chart: where title, legend, axes and data are.

use super::Chart;
use crate::{
    colour::Ramp,
    map::Meaning,
    scale::{Axis, Ends, Scale},
    series::Drawn,
    text::{Svg, clipped, width},
};

/// Height of text.
pub(super) const EM: f64 = 13.0;
/// Height of a line of the legend.
const LEGEND: f64 = 19.0;
/// Characters of a name in the legend.
const NAME: usize = 44;
/// Characters of the name of a bar.
pub(super) const BAR_NAME: usize = 26;

/// Axes with the rectangle they stand at.
pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) right: f64,
    pub(super) top: f64,
    pub(super) bottom: f64,
    pub(super) x: Axis,
    pub(super) y: Axis,
}

impl Frame {
    /// The place of a point; `None` where it has none on the axes.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let (x, y) = (self.x.at(x)?, self.y.at(y)?);
        Some([self.left + x * (self.right - self.left), self.bottom - y * (self.bottom - self.top)])
    }
}

/// An entry of the legend: name, class, marker, whether it is dashed.
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) class: String,
    pub(super) drawn: Option<Drawn>,
    pub(super) dashed: bool,
    pub(super) marker: usize,
    /// Place of the upper left corner, relative to the legend.
    pub(super) at: [f64; 2],
}

impl Chart {
    pub(super) fn frame(&self, legend_rows: f64) -> Frame {
        let has_room = self.map.is_none() && self.bars.is_empty();
        let ends = if has_room { Ends::Margin } else { Ends::Tight };
        let (xs, ys) = (self.values(0), self.values(1));
        let x = Axis::fit(self.x.1, xs.into_iter(), if self.only_lines() { Ends::Tight } else { ends }, 6);
        let y = Axis::fit(self.y.1, ys.into_iter(), ends, 5);
        let names = if self.bars.is_empty() {
            y.ticks.iter().map(|t| width(&t.label)).fold(1.0, f64::max)
        } else {
            self.bars.iter().map(|b| width(&clipped(&b.label, BAR_NAME))).fold(1.0, f64::max)
        };
        let left = 12.0 + EM * names + if self.y.0.is_empty() { 4.0 } else { 20.0 };
        let mut right = self.size[0] - 14.0;
        if self.has_ramp() {
            right -= 84.0;
        } else if !self.bars.is_empty() {
            right -= 46.0;
        }
        let left = if self.triad.is_some() || self.flat { 24.0 } else { left };
        let top = 32.0 + self.second_line() + legend_rows * (LEGEND + 1.0);
        let lost = if self.lost() > 0 { 16.0 } else { 0.0 };
        let bottom = self.size[1] - self.below() - lost;
        let frame = Frame { left, right: right.max(left + 40.0), top, bottom: bottom.max(top + 40.0), x, y };
        if self.equal { frame.equal(self) } else { frame }
    }

    /// Room below the data: for numbers and name of the axis, or for the axes of space.
    pub(super) fn below(&self) -> f64 {
        if self.triad.is_some() { 62.0 } else { 44.0 }
    }

    /// Room of the line under the title.
    pub(super) fn second_line(&self) -> f64 {
        if self.subtitle.is_some() { 16.0 } else { 0.0 }
    }

    /// Numbers of one axis; a bar starts at 0.
    fn values(&self, axis: usize) -> Vec<f64> {
        if !self.bars.is_empty() {
            let ends = self.bars.iter().map(|b| b.value).filter(|v| *v >= 0.0);
            let start = if self.x.1 == Scale::Linear { Some(0.0) } else { None };
            return if axis == 0 { start.into_iter().chain(ends).collect() } else { Vec::new() };
        }
        let of_cells = self.map.iter().flat_map(|m| &m.cells).flat_map(|c| &c.outline);
        let other = [self.x.1, self.y.1][1 - axis];
        let drawn = |p: &&[f64; 2]| other == Scale::Linear && p[1 - axis].is_finite() || p[1 - axis] > 0.0;
        let of_series = self.series.iter().flat_map(|(s, _)| &s.points).filter(drawn);
        let of_faces = self.map.iter().flat_map(|m| &m.faces).flat_map(|f| &f.corners).map(|c| c[axis]);
        let of_room = self.room.iter().flatten().map(|p| p[axis]);
        of_series.chain(of_cells).map(|p| p[axis]).chain(of_faces).chain(of_room).collect()
    }

    fn only_lines(&self) -> bool {
        !self.series.is_empty() && self.series.iter().all(|(_, d)| *d == Drawn::Line)
    }

    /// A ramp of colours stands at the right.
    pub(super) fn has_ramp(&self) -> bool {
        self.tones.is_some() || self.map.as_ref().is_some_and(|m| matches!(m.meaning, Meaning::Quantity(_)))
    }

    /// How many points, bars or cells have no place or no colour.
    pub(super) fn lost(&self) -> usize {
        let on = |scale: Scale, v: f64| v.is_finite() && (scale == Scale::Linear || v > 0.0);
        let off = |p: &&[f64; 2]| !on(self.x.1, p[0]) || !on(self.y.1, p[1]);
        let points = self.series.iter().flat_map(|(s, _)| &s.points).filter(off).count();
        let bars = self.bars.iter().filter(|b| !on(self.x.1, b.value) || b.value < 0.0).count();
        let cells = self.map.iter().flat_map(|m| &m.cells);
        let cells = cells.filter(|c| !c.value.is_finite() || c.outline.iter().flatten().any(|v| !v.is_finite()));
        let faces = self.map.iter().flat_map(|m| &m.faces);
        let faces = faces.filter(|f| f.values.iter().chain(f.corners.as_flattened()).any(|v| !v.is_finite()));
        points + bars + cells.count() + faces.count()
    }

    /// The ramp of its map.
    pub(super) fn ramp(&self) -> Ramp {
        self.map.as_ref().map_or(Ramp::Viridis, |m| m.ramp)
    }

    /// Entries of the legend with their places, and its number of rows.
    pub(super) fn legend(&self) -> (Vec<Entry>, f64) {
        let mut entries: Vec<Entry> = Vec::new();
        if self.tones.is_none() && self.bars.is_empty() {
            for (k, (s, drawn)) in self.series.iter().enumerate().filter(|(_, (s, _))| !s.name.is_empty()) {
                let class = self.class_of(k);
                entries.push(Entry { drawn: Some(*drawn), dashed: s.dashed, ..entry(&s.name, class, k) });
            }
        }
        if let Some(Meaning::States(states)) = self.map.as_ref().map(|m| &m.meaning) {
            entries.extend(states.iter().map(|(name, class)| entry(name, class.clone(), 0)));
        }
        if entries.len() == 1 && self.map.is_none() && self.title.contains(&entries[0].name) {
            entries.clear(); // the title says it
        }
        let (mut x, mut row) = (0.0, 0.0);
        for e in &mut entries {
            let length = 30.0 + EM * width(&e.name) + 12.0;
            if x > 0.0 && x + length > self.size[0] - 20.0 {
                (x, row) = (0.0, row + 1.0);
            }
            e.at = [x, row * LEGEND];
            x += length;
        }
        let rows = if entries.is_empty() { 0.0 } else { row + 1.0 };
        (entries, rows)
    }

    /// The class of the colour of a series.
    pub(super) fn class_of(&self, k: usize) -> String {
        let unnamed = |k: usize| self.series[..k].iter().filter(|(s, _)| s.colour.is_none()).count();
        self.series[k].0.colour.unwrap_or_else(|| crate::colour::Colour::Palette(unnamed(k))).class()
    }

    /// Grid, ticks, names of the axes.
    pub(super) fn axes(&self, svg: &mut Svg, f: &Frame) {
        for tick in f.x.ticks.iter().filter(|t| (-1e-6..=1.000_001).contains(&t.at)) {
            let x = f.left + tick.at * (f.right - f.left);
            svg.line(if tick.label.is_empty() { "g2" } else { "g" }, [x, f.top], [x, f.bottom]);
            if !tick.label.is_empty() {
                svg.label("s m", [x, f.bottom + 16.0], &tick.label);
            }
        }
        let upright = self.bars.is_empty() && !self.flat;
        for tick in f.y.ticks.iter().filter(|t| upright && (-1e-6..=1.000_001).contains(&t.at)) {
            let y = f.bottom - tick.at * (f.bottom - f.top);
            svg.line(if tick.label.is_empty() { "g2" } else { "g" }, [f.left, y], [f.right, y]);
            if !tick.label.is_empty() {
                svg.label("s e", [f.left - 6.0, y + 4.0], &tick.label);
            }
        }
        svg.line("a", [f.left, f.bottom], [f.right, f.bottom]);
        if !self.flat {
            svg.line("a", [f.left, f.top], [f.left, f.bottom]);
        }
        let middle = [0.5 * (f.left + f.right), 0.5 * (f.top + f.bottom)];
        let (x, y) = (format!("{}{}", self.x.0, f.x.factor()), format!("{}{}", self.y.0, f.y.factor()));
        if !x.is_empty() {
            svg.label("m", [middle[0], f.bottom + 35.0], &x);
        }
        if !self.y.0.is_empty() || (upright && f.y.power != 0) {
            svg.upright("m", [15.0, middle[1]], &y);
        }
    }
}

impl Frame {
    /// The same axes with equal units: the longer side in the room keeps its length.
    fn equal(mut self, chart: &Chart) -> Self {
        let span = |axis: usize| {
            let values = chart.values(axis);
            let finite = values.iter().filter(|v| v.is_finite());
            let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
            high - low
        };
        let (dx, dy) = (span(0), span(1));
        if !(dx > 0.0 && dy > 0.0 && dx.is_finite() && dy.is_finite()) {
            return self;
        }
        let (w, h) = (self.right - self.left, self.bottom - self.top);
        if w / dx > h / dy {
            let wanted = h * (dx / dy);
            self.right = self.left + wanted.max(60.0);
        } else {
            let wanted = w * (dy / dx);
            self.bottom = self.top + wanted.max(30.0);
        }
        self
    }
}

fn entry(name: &str, class: String, marker: usize) -> Entry {
    Entry { name: clipped(name, NAME), class, drawn: None, dashed: false, marker, at: [0.0; 2] }
}
