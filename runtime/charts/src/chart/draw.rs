//! Drawing: ground, axes, legend, data, what could not be shown.

use super::{
    Chart,
    frame::{BAR_NAME, EM, Frame},
};
use crate::{
    colour::style,
    map::{Map, MapCell, Meaning},
    marks::Mark,
    scale::{Axis, Ends, Scale},
    series::{Drawn, Series},
    surface::Surface,
    text::{Svg, clipped, escape, short, width},
};

/// Points of a series that can be pointed at; of longer ones every so many.
const TARGETS: usize = 80;
/// Points of a series that get a marker.
const MARKERS: usize = 60;
/// Width of a band that is shorter, in units of the chart: it is to be seen, and to be pointed at.
const THINNEST: f64 = 2.0;
/// Steps of the ramp beside a chart.
const RAMP: usize = 32;

/// What a chart stands on.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sheet {
    /// A file of its own, with style and ground.
    File,
    /// A page, which has both.
    Page,
}

impl Chart {
    pub(super) fn draw(&self, sheet: Sheet) -> String {
        self.drawn(sheet, Svg::default()).0.text
    }

    /// What is drawn, for a picture of pixels, and its width and height.
    pub(crate) fn marks(&self) -> (Vec<Mark>, [f64; 2]) {
        let (svg, size) = self.drawn(Sheet::File, Svg { marks: Some(Vec::new()), ..Svg::default() });
        (svg.marks.unwrap_or_default(), size)
    }

    fn drawn(&self, sheet: Sheet, mut svg: Svg) -> (Svg, [f64; 2]) {
        let (entries, rows) = self.legend();
        let frame = self.frame(rows);
        let [w, _] = self.size;
        // a chart with equal units is as high as it needs
        let lost = self.lost();
        let h = (frame.bottom + self.below() + if lost > 0 { 16.0 } else { 0.0 }).round();
        let name = escape(&self.title);
        let paper = self.paper_size([w, h]);
        svg.raw(&format!(
            r#"<svg class="wfl" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w:.0} {h:.0}"{paper} role="img" aria-label="{name}">"#
        ));
        if sheet == Sheet::File {
            svg.raw(&format!("<style>{}</style>", style()));
            svg.raw(&format!(r#"<rect class="b" width="{w:.0}" height="{h:.0}"/>"#));
        }
        svg.label("t", [8.0, 18.0], &clipped(&self.title, 60));
        for e in &entries {
            self.legend_entry(&mut svg, e);
        }
        if let Some(text) = &self.subtitle {
            svg.label("s", [8.0, 34.0], &clipped(text, 78));
        }
        match &self.triad {
            Some(triad) => draw_triad(&mut svg, &frame, triad),
            None => self.axes(&mut svg, &frame),
        }
        self.draw_bands(&mut svg, &frame);
        if let Some(map) = &self.map {
            draw_map(&mut svg, &frame, map);
        }
        self.draw_bars(&mut svg, &frame);
        self.draw_series(&mut svg, &frame);
        self.draw_ramp(&mut svg, &frame);
        self.remarks(&mut svg, &frame, lost, h);
        svg.raw("</svg>");
        (svg, [w, h])
    }

    fn legend_entry(&self, svg: &mut Svg, e: &super::frame::Entry) {
        let (x, y) = (10.0 + e.at[0], 35.0 + self.second_line() + e.at[1]);
        match e.drawn {
            None => svg.rect(&format!(r#"class="{}""#, e.class), [x, y - 6.0], [14.0, 12.0], ""),
            Some(drawn) => {
                if drawn != Drawn::Points {
                    let dash = if e.dashed { " d" } else { "" };
                    svg.line(&format!("l {}{dash}", e.class), [x, y], [x + 22.0, y]);
                }
                if drawn != Drawn::Line {
                    marker(svg, &e.class, e.marker, [x + 11.0, y], "");
                }
            }
        }
        let text = if e.drawn.is_some() { x + 28.0 } else { x + 20.0 };
        svg.label("", [text, y + 4.0], &e.name);
    }

    fn draw_bands(&self, svg: &mut Svg, f: &Frame) {
        for band in &self.bands {
            let (Some(from), Some(to)) = (f.x.at(band.from), f.x.at(band.to)) else { continue };
            // what lies outside the axis is not shown
            if to < 0.0 || from > 1.0 {
                continue;
            }
            let place = |at: f64| f.left + at.clamp(0.0, 1.0) * (f.right - f.left);
            let width = (place(to) - place(from)).max(THINNEST);
            svg.rect(r#"class="o z""#, [place(from), f.top], [width, f.bottom - f.top], &band.note);
        }
    }

    fn draw_series(&self, svg: &mut Svg, f: &Frame) {
        if !self.bars.is_empty() {
            return;
        }
        for (k, (series, drawn)) in self.series.iter().enumerate() {
            let class = self.class_of(k);
            if *drawn != Drawn::Points {
                let dash = if series.dashed { " d" } else { "" };
                for part in parts(series, f) {
                    svg.polyline(&format!(r#"class="l {class}{dash}""#), &part);
                }
            }
            let n = series.points.len();
            let every = n.div_ceil(TARGETS).max(1);
            let marked = *drawn == Drawn::Points || (*drawn == Drawn::Both && n <= MARKERS);
            for (i, point) in series.points.iter().enumerate() {
                let Some(at) = f.at(*point) else { continue };
                let note = self.note(series, i);
                if marked {
                    // markers of a family are alike, its tones tell it apart
                    let shape = if self.tones.is_some() { 0 } else { k };
                    marker(svg, &class, shape, at, &note);
                } else if i % every == 0 || i + 1 == n || !series.notes.is_empty() {
                    svg.target(at, &note);
                }
            }
        }
    }

    fn note(&self, series: &Series, i: usize) -> String {
        if let Some(note) = series.notes.get(i) {
            return note.clone();
        }
        let [x, y] = series.points[i];
        let name = if series.name.is_empty() { String::new() } else { format!("{}\n", series.name) };
        format!("{name}{} = {}\n{} = {}", self.x.0, short(x), self.y.0, short(y))
    }

    fn draw_bars(&self, svg: &mut Svg, f: &Frame) {
        #[expect(clippy::cast_precision_loss, reason = "few bars")]
        let height = (f.bottom - f.top) / self.bars.len().max(1) as f64;
        let thick = (0.68 * height).min(26.0);
        for (k, bar) in self.bars.iter().enumerate() {
            #[expect(clippy::cast_precision_loss, reason = "few bars")]
            let middle = f.top + (k as f64 + 0.5) * height;
            svg.label("e", [f.left - 6.0, middle + 4.0], &clipped(&bar.label, BAR_NAME));
            let place = if bar.value >= 0.0 { f.x.at(bar.value) } else { None };
            let length = place.map_or(0.0, |at| at.clamp(0.0, 1.0) * (f.right - f.left));
            let value = short(bar.value);
            let note = if bar.note.is_empty() { format!("{}\n{value}", bar.label) } else { bar.note.clone() };
            svg.rect(r#"class="c0 z""#, [f.left, middle - 0.5 * thick], [length.max(0.5), thick], &note);
            svg.label("s", [f.left + length + 5.0, middle + 4.0], &value);
        }
    }

    /// The ramp at the right: what its colours stand for.
    fn draw_ramp(&self, svg: &mut Svg, f: &Frame) {
        let (label, range) = match (&self.tones, &self.map) {
            (Some((label, range)), _) => (label, *range),
            (None, Some(map)) => match &map.meaning {
                Meaning::Quantity(label) => (label, map.shown()),
                Meaning::States(_) => return,
            },
            (None, None) => return,
        };
        let (x, low, high) = (f.right + 14.0, f.bottom, f.top);
        #[expect(clippy::cast_precision_loss, reason = "few steps")]
        let at = |k: usize| low + (high - low) * k as f64 / RAMP as f64;
        for k in 0..RAMP {
            #[expect(clippy::cast_precision_loss, reason = "few steps")]
            let tone = (k as f64 + 0.5) / RAMP as f64;
            let paint = match self.tones {
                Some(_) => format!(r#"class="{}""#, crate::Colour::Tone(tone).class()),
                None => format!(r#"fill="{}""#, self.ramp().hex(tone)),
            };
            svg.rect(&paint, [x, at(k + 1)], [12.0, at(k) - at(k + 1) + 0.4], "");
        }
        let axis = Axis::fit(Scale::Linear, range.into_iter(), Ends::Tight, 5);
        for tick in axis.ticks.iter().filter(|t| (-1e-6..=1.000_001).contains(&t.at)) {
            svg.label("s", [x + 16.0, low + (high - low) * tick.at + 4.0], &tick.label);
        }
        let longest = axis.ticks.iter().map(|t| width(&t.label)).fold(2.0, f64::max);
        let name = format!("{label}{}", axis.factor());
        svg.upright("m", [x + 32.0 + 12.0 * longest, 0.5 * (low + high)], &name);
    }

    fn remarks(&self, svg: &mut Svg, f: &Frame, lost: usize, height: f64) {
        if self.series.iter().all(|(s, _)| s.points.is_empty()) && self.bars.is_empty() && self.map.is_none() {
            svg.label("s m", [0.5 * (f.left + f.right), 0.5 * (f.top + f.bottom)], "no data");
        }
        if lost > 0 {
            let log = self.x.1 == Scale::Log || self.y.1 == Scale::Log;
            let why = if log { "not finite, or not positive" } else { "not finite" };
            let number = if lost == 1 { "1 value is".to_owned() } else { format!("{lost} values are") };
            svg.label("s", [8.0, height - 6.0], &format!("{number} not shown: {why}"));
        }
    }
}

impl Map {
    /// The range of its ramp: the given one, or that of its numbers.
    pub(super) fn shown(&self) -> [f64; 2] {
        if let Some(range) = self.range {
            return range;
        }
        let of_faces = self.faces.iter().flat_map(|f| f.values.iter().copied());
        let finite = self.cells.iter().map(|c| c.value).chain(of_faces).filter(|v| v.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if low <= high { [low, high] } else { [0.0, 1.0] }
    }
}

/// Width of the edges of a mesh: thin enough to leave the colours of small cells.
const EDGE: &str = ".25";

fn draw_map(svg: &mut Svg, f: &Frame, map: &Map) {
    let range = map.shown();
    let ramp = Axis::fit(Scale::Linear, range.into_iter(), Ends::Tight, 5);
    for cell in &map.cells {
        let Some(corners) = cell.outline.iter().map(|p| f.at(*p)).collect::<Option<Vec<_>>>() else { continue };
        let (paint, value) = match &map.meaning {
            Meaning::Quantity(label) => {
                let at = ramp.at(cell.value).unwrap_or(f64::NAN);
                let colour = map.ramp.hex(at);
                // a rim of the same colour closes the hairlines between neighbours
                let rim = if map.edges { ("#ffffff", EDGE) } else { (colour.as_str(), ".6") };
                let paint = format!(r#"class="z" fill="{colour}" stroke="{}" stroke-width="{}""#, rim.0, rim.1);
                (paint, format!("{label} = {}", short(cell.value)))
            }
            Meaning::States(states) => state(states, cell),
        };
        svg.polygon(&paint, &corners, if cell.note.is_empty() { &value } else { &cell.note });
    }
    if map.faces.is_empty() {
        return;
    }
    let mut surface = Surface::new(map.ramp);
    for face in &map.faces {
        let places = face.corners.iter().map(|[x, y, depth]| f.at([*x, *y]).map(|[x, y]| [x, y, *depth]));
        let Some(corners) = places.collect::<Option<Vec<_>>>() else { continue };
        let tones = face.values.iter().map(|v| ramp.at(*v).unwrap_or(f64::NAN)).collect();
        surface.push(corners, tones, face.edges.clone());
    }
    svg.surface(surface);
}

/// Length of an axis that points across the view.
const ARM: f64 = 26.0;

/// The axes of space at the lower left, each with its name.
fn draw_triad(svg: &mut Svg, f: &Frame, triad: &[[f64; 2]; 3]) {
    let origin = [f.left + ARM + 8.0, f.bottom + ARM + 12.0];
    for (name, [right, up]) in ["x", "y", "z"].iter().zip(triad) {
        let length = right.hypot(*up);
        if length < 0.05 {
            continue; // it points at the reader
        }
        let tip = |part: f64| [origin[0] + part * ARM * right, origin[1] - part * ARM * up];
        svg.line("a", origin, tip(1.0));
        let [x, y] = tip(1.0 + 0.32 / length);
        svg.label("s m", [x, y + 4.0], name);
    }
}

fn state(states: &[(String, String)], cell: &MapCell) -> (String, String) {
    let unknown = (String::from("unknown"), String::from("ci"));
    #[expect(clippy::cast_precision_loss, reason = "few states")]
    let (name, class) = (0..states.len()).find(|k| *k as f64 == cell.value).map_or(&unknown, |k| &states[k]);
    (format!(r#"class="{class} z""#), name.clone())
}

/// The parts of a line between points that have no place.
fn parts(series: &Series, f: &Frame) -> Vec<Vec<[f64; 2]>> {
    let mut parts: Vec<Vec<[f64; 2]>> = vec![Vec::new()];
    for point in &series.points {
        match f.at(*point) {
            Some(at) => {
                if let Some(part) = parts.last_mut() {
                    part.push(at);
                }
            }
            None => parts.push(Vec::new()),
        }
    }
    parts.retain(|p| p.len() > 1);
    parts
}

/// Disc, square, triangle, diamond: by the number of the series.
fn marker(svg: &mut Svg, class: &str, k: usize, [x, y]: [f64; 2], note: &str) {
    let r = 0.3 * EM;
    let paint = format!(r#"class="{class} z""#);
    match k % 4 {
        0 => svg.disc(&paint, [x, y], r, note),
        1 => svg.rect(&paint, [x - 0.88 * r, y - 0.88 * r], [1.76 * r, 1.76 * r], note),
        2 => svg.polygon(&paint, &[[x - 1.1 * r, y + 0.9 * r], [x + 1.1 * r, y + 0.9 * r], [x, y - 1.2 * r]], note),
        _ => svg.polygon(&paint, &[[x - 1.3 * r, y], [x, y + 1.3 * r], [x + 1.3 * r, y], [x, y - 1.3 * r]], note),
    }
}
