//! A chart as pixels: areas, lines and faces with a z-buffer, in nine samples a pixel, then the letters.
//!
//! Promises: the same chart gives the same bytes; a sample of a face has the colour of the number at its place; of faces
//! that hide each other the nearest is seen at every sample. Light ground only.

use crate::{
    colour::of_class,
    glyphs::glyphs,
    map::Edge,
    marks::{Mark, Paint, Reads},
    surface::{Placed, Surface},
};

/// Pixels a unit of the chart.
const SCALE: usize = 2;
/// Samples along the side of a pixel.
const SAMPLES: usize = 3;
/// Samples a unit.
#[expect(clippy::cast_precision_loss, reason = "6")]
const DENSE: f64 = (SCALE * SAMPLES) as f64;
/// Pixels of the largest picture: memory has seven bytes a sample.
const LARGEST: usize = 1 << 25;
/// Steps of a ramp.
const COLOURS: f64 = 192.0;
/// Length of dashes and of gaps, in units.
const DASH: f64 = 5.0;
/// How far an edge is in front of its face, in parts of the depth of the picture: less than what lies behind a body.
const IN_FRONT: f64 = 2e-3;
/// Width and cover of edges of the mesh and of the body, those of the style sheet.
const MESH: (f64, f64) = (0.5, 0.45);
const RIM: (f64, f64) = (1.1, 1.0);
const EDGE_COLOUR: [u8; 3] = [0x1d, 0x21, 0x25];

/// Why there are no pixels.
#[derive(Debug)]
pub enum PngError {
    /// Nothing, or more than there is room for: width and height in pixels.
    Size([usize; 2]),
    /// The encoder refuses.
    Encoding(png::EncodingError),
    /// The encoder of films refuses.
    Film(gif::EncodingError),
}

impl std::fmt::Display for PngError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            PngError::Size([w, h]) => write!(f, "a picture of {w} by {h} pixels cannot be made"),
            PngError::Encoding(e) => e.fmt(f),
            PngError::Film(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for PngError {}

/// The PNG file of marks on a ground of this size in units.
pub(crate) fn png(marks: &[Mark], size: [f64; 2]) -> Result<Vec<u8>, PngError> {
    let Pixels { rgb, size } = pixels(marks, size)?;
    smaller(&rgb, size, png::ColorType::Rgb)
}

/// Three bytes a pixel, row by row from the top, with width and height.
pub(crate) struct Pixels {
    pub(crate) rgb: Vec<u8>,
    pub(crate) size: [usize; 2],
}

/// The pixels of marks on a ground of this size in units.
pub(crate) fn pixels(marks: &[Mark], size: [f64; 2]) -> Result<Pixels, PngError> {
    let [w, h] = pixels_of(size)?;
    let mut canvas = Canvas::new(w * SAMPLES, h * SAMPLES);
    for mark in marks {
        canvas.draw(mark);
    }
    let mut pixels = canvas.pixels();
    for mark in marks {
        if let Mark::Text { class, at, text, reads } = mark {
            write_text(&mut pixels, w, class, *at, text, *reads);
        }
    }
    Ok(Pixels { rgb: pixels, size: [w, h] })
}

/// A PNG file at its place in a chart, in units.
pub(crate) struct Image {
    pub(crate) at: [f64; 2],
    pub(crate) size: [f64; 2],
    pub(crate) file: Vec<u8>,
}

/// The same for a PDF: its colours and how much of each pixel it covers, rows with filters of PNG, compressed.
pub(crate) struct Layers {
    /// The upper left corner, and width and height, in units.
    pub(crate) at: [f64; 2],
    pub(crate) units: [f64; 2],
    pub(crate) pixels: [usize; 2],
    pub(crate) colours: Vec<u8>,
    pub(crate) cover: Vec<u8>,
}

/// A surface alone as layers.
pub(crate) fn layers(surface: &Surface) -> Result<Layers, PngError> {
    let Alone { at, units, pixels, rgba } = alone(surface)?;
    let rgb: Vec<u8> = rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let cover: Vec<u8> = rgba.chunks_exact(4).map(|p| p[3]).collect();
    let colours = data(&smaller(&rgb, pixels, png::ColorType::Rgb)?);
    let cover = data(&smaller(&cover, pixels, png::ColorType::Grayscale)?);
    Ok(Layers { at, units, pixels, colours, cover })
}

/// What the chunks `IDAT` of a PNG file hold, together: a stream of zlib.
fn data(file: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    // a signature of 8 bytes; then length, kind, content and sum of each chunk
    let mut rest = file.get(8..).unwrap_or_default();
    while let Some((length, kind)) = rest.first_chunk::<4>().zip(rest.get(4..8)) {
        let end = 8 + u32::from_be_bytes(*length) as usize;
        if kind == b"IDAT" {
            out.extend_from_slice(rest.get(8..end).unwrap_or_default());
        }
        rest = rest.get(end + 4..).unwrap_or_default();
    }
    out
}

/// A surface alone on a ground without colour.
pub(crate) fn image(surface: &Surface) -> Result<Image, PngError> {
    let Alone { at, units, pixels, rgba } = alone(surface)?;
    Ok(Image { at, size: units, file: smaller(&rgba, pixels, png::ColorType::Rgba)? })
}

/// The pixels of a surface: place and size in units, red, green, blue and cover.
struct Alone {
    at: [f64; 2],
    units: [f64; 2],
    pixels: [usize; 2],
    rgba: Vec<u8>,
}

fn alone(surface: &Surface) -> Result<Alone, PngError> {
    let ends = |axis: usize| {
        let places = surface.faces.iter().flat_map(|f| &f.corners).map(|c| c[axis]);
        places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
    };
    let ((left, right), (top, bottom)) = (ends(0), ends(1));
    // edges are half their width beyond
    let (start, end) = ([left.floor() - 1.0, top.floor() - 1.0], [right.ceil() + 1.0, bottom.ceil() + 1.0]);
    let size = [end[0] - start[0], end[1] - start[1]];
    let [w, h] = pixels_of(size)?;
    let mut shifted = surface.clone();
    for corner in shifted.faces.iter_mut().flat_map(|f| &mut f.corners) {
        *corner = [corner[0] - start[0], corner[1] - start[1], corner[2]];
    }
    let mut canvas = Canvas::new(w * SAMPLES, h * SAMPLES);
    canvas.surface(&shifted);
    Ok(Alone { at: start, units: size, pixels: [w, h], rgba: canvas.pixels_with_cover() })
}

/// Width and height in pixels of a size in units.
pub(crate) fn pixels_of(size: [f64; 2]) -> Result<[usize; 2], PngError> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "charts have some hundred units")]
    let [w, h] = size.map(|x| x.max(0.0) as usize * SCALE);
    if w == 0 || h == 0 || w.checked_mul(h).is_none_or(|n| n > LARGEST) {
        return Err(PngError::Size([w, h]));
    }
    Ok([w, h])
}

/// The smaller of two files: filters help where colours run into each other, and not where they are few.
fn smaller(pixels: &[u8], size: [usize; 2], kind: png::ColorType) -> Result<Vec<u8>, PngError> {
    let one = encoded(pixels, size, kind, png::Filter::Adaptive).map_err(PngError::Encoding)?;
    let other = encoded(pixels, size, kind, png::Filter::NoFilter).map_err(PngError::Encoding)?;
    Ok(if other.len() < one.len() { other } else { one })
}

#[expect(clippy::cast_possible_truncation, reason = "limited above")]
fn encoded(
    pixels: &[u8],
    [w, h]: [usize; 2],
    kind: png::ColorType,
    filter: png::Filter,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, w as u32, h as u32);
    encoder.set_color(kind);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(filter);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(file)
}

/// Samples with their colours and depths, row by row.
struct Canvas {
    w: usize,
    h: usize,
    colour: Vec<[u8; 3]>,
    depth: Vec<f32>,
}

impl Canvas {
    fn new(w: usize, h: usize) -> Self {
        Canvas { w, h, colour: vec![[255; 3]; w * h], depth: vec![f32::NEG_INFINITY; w * h] }
    }

    fn draw(&mut self, mark: &Mark) {
        match mark {
            Mark::Line { paint, points } => {
                let paint = Paint::of(paint);
                if let Some(colour) = paint.stroke {
                    self.line(points, &paint, colour);
                }
            }
            Mark::Polygon { paint, corners } => {
                let paint = Paint::of(paint);
                if let Some(colour) = paint.fill {
                    self.polygon(corners, colour);
                }
                if let (Some(colour), Some(first)) = (paint.stroke, corners.first()) {
                    let around: Vec<[f64; 2]> = corners.iter().copied().chain([*first]).collect();
                    self.line(&around, &Paint { dashed: false, ..paint }, colour);
                }
            }
            Mark::Disc { paint, at, r } => {
                let corner = |k: usize| {
                    #[expect(clippy::cast_precision_loss, reason = "a few corners")]
                    let angle = std::f64::consts::TAU * k as f64 / 24.0;
                    [at[0] + r * angle.cos(), at[1] + r * angle.sin()]
                };
                if let Some(colour) = Paint::of(paint).fill {
                    self.polygon(&(0..24).map(corner).collect::<Vec<_>>(), colour);
                }
            }
            Mark::Surface(surface) => self.surface(surface),
            Mark::Text { .. } => {}
        }
    }

    /// Rows or columns of samples whose middles are between two places.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the picture")]
    fn between(low: f64, high: f64, n: usize) -> std::ops::Range<usize> {
        #[expect(clippy::cast_precision_loss, reason = "pixels of a picture")]
        let limit = n as f64;
        let first = (low * DENSE - 0.5).ceil().clamp(0.0, limit) as usize;
        let last = ((high * DENSE - 0.5).floor() + 1.0).clamp(0.0, limit) as usize;
        first..last
    }

    /// Fills a polygon by its rows, inside where a row has crossed an odd number of edges.
    fn polygon(&mut self, corners: &[[f64; 2]], colour: [u8; 3]) {
        if !corners.as_flattened().iter().all(|x| x.is_finite()) {
            return;
        }
        let (low, high) =
            corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[1]), b.max(p[1])));
        let mut crossings = Vec::new();
        for row in Self::between(low, high, self.h) {
            let y = middle(row);
            crossings.clear();
            for (k, a) in corners.iter().enumerate() {
                let b = corners[(k + 1) % corners.len()];
                if (a[1] <= y) != (b[1] <= y) {
                    crossings.push(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                for column in Self::between(pair[0], pair[1], self.w) {
                    self.colour[row * self.w + column] = colour;
                }
            }
        }
    }

    fn line(&mut self, points: &[[f64; 2]], paint: &Paint, colour: [u8; 3]) {
        let Paint { width, dashed, .. } = *paint;
        let mut walked = 0.0;
        for pair in points.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let length = (b[0] - a[0]).hypot(b[1] - a[1]);
            let at = |s: f64| [a[0] + s / length * (b[0] - a[0]), a[1] + s / length * (b[1] - a[1])];
            if length == 0.0 || !length.is_finite() {
                continue;
            }
            let mut s = 0.0;
            while s < length {
                let phase = (walked + s) % (2.0 * DASH);
                let next = if dashed { (s + DASH - phase % DASH).min(length) } else { length };
                if !dashed || phase < DASH {
                    self.polygon(&band(at(s), at(next), width), colour);
                }
                // a dash shorter than a sample must not hold us here
                s = next.max(s + 1.0 / DENSE);
            }
            walked += length;
        }
    }

    /// Faces first, then their edges, where these are not behind.
    fn surface(&mut self, surface: &Surface) {
        let depths = surface.faces.iter().flat_map(|f| f.corners.iter().map(|c| c[2]));
        let (low, high) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
        let lift = IN_FRONT * (high - low);
        for face in &surface.faces {
            // as many colours as an eye tells apart make a file of half the size
            self.face(face, |tone| surface.ramp.rgb((tone * COLOURS).round() / COLOURS));
        }
        for wanted in [Edge::Mesh, Edge::Rim] {
            let (width, cover) = if wanted == Edge::Mesh { MESH } else { RIM };
            for face in &surface.faces {
                for (k, _) in face.edges.iter().enumerate().filter(|(_, e)| **e == wanted) {
                    let (a, b) = (face.corners[k], face.corners[(k + 1) % face.corners.len()]);
                    self.edge([a, b], width, cover, lift);
                }
            }
        }
    }

    /// A face as triangles around its middle, its numbers linear in each.
    fn face(&mut self, face: &Placed, colour: impl Fn(f64) -> [u8; 3]) {
        let n = face.corners.len();
        let corner = |k: usize| {
            let c = face.corners[k % n];
            [c[0], c[1], c[2], face.tones[k % n]]
        };
        if n == 3 {
            return self.triangle([corner(0), corner(1), corner(2)], &colour);
        }
        #[expect(clippy::cast_precision_loss, reason = "a few corners")]
        let centre = (0..n).map(corner).fold([0.0; 4], |s, c| [0, 1, 2, 3].map(|i| s[i] + c[i] / n as f64));
        for k in 0..n {
            self.triangle([corner(k), corner(k + 1), centre], &colour);
        }
    }

    /// A triangle of places, depths and tones.
    fn triangle(&mut self, [a, b, c]: [[f64; 4]; 3], colour: &impl Fn(f64) -> [u8; 3]) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let lowest = |i: usize| a[i].min(b[i]).min(c[i]);
        let highest = |i: usize| a[i].max(b[i]).max(c[i]);
        for row in Self::between(lowest(1), highest(1), self.h) {
            let y = middle(row);
            for column in Self::between(lowest(0), highest(0), self.w) {
                let x = middle(column);
                let u = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area;
                let v = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area;
                // a sample on a common side belongs to both triangles, so that none is missed
                if u < -1e-9 || v < -1e-9 || u + v > 1.0 + 1e-9 {
                    continue;
                }
                let mixed = |i: usize| a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]);
                self.set(row * self.w + column, mixed(2), || colour(mixed(3)));
            }
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "depths are compared, not computed with")]
    fn set(&mut self, at: usize, depth: f64, colour: impl FnOnce() -> [u8; 3]) {
        if depth as f32 >= self.depth[at] {
            self.depth[at] = depth as f32;
            self.colour[at] = colour();
        }
    }

    /// An edge in space: samples of its band that are not behind a face. It keeps the depths as they are.
    fn edge(&mut self, [a, b]: [[f64; 3]; 2], width: f64, cover: f64, lift: f64) {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let square = dx * dx + dy * dy;
        if square == 0.0 || !square.is_finite() {
            return;
        }
        let corners = band([a[0], a[1]], [b[0], b[1]], width);
        let ends =
            |i: usize| corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[i]), h.max(p[i])));
        let ((left, right), (top, bottom)) = (ends(0), ends(1));
        for row in Self::between(top, bottom, self.h) {
            for column in Self::between(left, right, self.w) {
                let (x, y) = (middle(column) - a[0], middle(row) - a[1]);
                let along = (x * dx + y * dy) / square;
                let across = (x * dy - y * dx).abs() / square.sqrt();
                let depth = a[2] + along.clamp(0.0, 1.0) * (b[2] - a[2]) + lift;
                let at = row * self.w + column;
                if !(0.0..=1.0).contains(&along) || across > 0.5 * width || depth < f64::from(self.depth[at]) {
                    continue;
                }
                let under = self.colour[at];
                self.colour[at] = [0, 1, 2].map(|i| mixed(under[i], EDGE_COLOUR[i], cover));
            }
        }
    }

    /// The means of the samples that a face or an edge covers, as red, green, blue, and the part that is covered.
    fn pixels_with_cover(&self) -> Vec<u8> {
        let (w, h) = (self.w / SAMPLES, self.h / SAMPLES);
        let mut out = Vec::with_capacity(4 * w * h);
        for y in 0..h {
            for x in 0..w {
                let (mut sum, mut n) = ([0usize; 3], 0);
                for k in
                    (0..SAMPLES).flat_map(|j| (0..SAMPLES).map(move |i| (y * SAMPLES + j) * self.w + x * SAMPLES + i))
                {
                    if self.depth[k] > f32::NEG_INFINITY || self.colour[k] != [255; 3] {
                        sum = [0, 1, 2].map(|i| sum[i] + usize::from(self.colour[k][i]));
                        n += 1;
                    }
                }
                let all = SAMPLES * SAMPLES;
                #[expect(clippy::cast_possible_truncation, reason = "means of bytes")]
                out.extend(sum.map(|s| (s / n.max(1)) as u8).into_iter().chain([(n * 255 / all) as u8]));
            }
        }
        out
    }

    /// The means of the samples of each pixel, as red, green, blue.
    fn pixels(&self) -> Vec<u8> {
        let (w, h) = (self.w / SAMPLES, self.h / SAMPLES);
        let mut out = Vec::with_capacity(3 * w * h);
        for y in 0..h {
            for x in 0..w {
                let mut sum = [0usize; 3];
                for j in 0..SAMPLES {
                    for sample in &self.colour[(y * SAMPLES + j) * self.w + x * SAMPLES..][..SAMPLES] {
                        sum = [0, 1, 2].map(|i| sum[i] + usize::from(sample[i]));
                    }
                }
                let n = SAMPLES * SAMPLES;
                #[expect(clippy::cast_possible_truncation, reason = "a mean of bytes")]
                out.extend(sum.map(|s| ((s + n / 2) / n) as u8));
            }
        }
        out
    }
}

/// The middle of a sample in units.
fn middle(k: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "pixels of a picture")]
    let k = k as f64;
    (k + 0.5) / DENSE
}

/// The rectangle around a line.
fn band(a: [f64; 2], b: [f64; 2], width: f64) -> [[f64; 2]; 4] {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let s = 0.5 * width / dx.hypot(dy);
    let (nx, ny) = (-s * dy, s * dx);
    [[a[0] + nx, a[1] + ny], [b[0] + nx, b[1] + ny], [b[0] - nx, b[1] - ny], [a[0] - nx, a[1] - ny]]
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two bytes")]
fn mixed(under: u8, over: u8, cover: f64) -> u8 {
    (f64::from(under) + cover * (f64::from(over) - f64::from(under))).round() as u8
}

/// Writes a text on the pixels of a picture of width `w`.
fn write_text(pixels: &mut [u8], w: usize, class: &str, at: [f64; 2], text: &str, reads: Reads) {
    let has = |c: &str| class.split(' ').any(|x| x == c);
    let colour = class.split(' ').find_map(of_class).unwrap_or(EDGE_COLOUR);
    let (letters, length) = glyphs(text, has("t"));
    #[expect(clippy::cast_precision_loss, reason = "pixels of a picture")]
    let (length, scale) = (length as f64, SCALE as f64);
    let back = if has("m") {
        0.5 * length
    } else if has("e") {
        length
    } else {
        0.0
    };
    #[expect(clippy::cast_possible_truncation, reason = "pixels of a picture")]
    let [x0, y0] = if reads == Reads::Up {
        [(scale * at[0]).round() as i64, (scale * at[1] + back).round() as i64]
    } else {
        [(scale * at[0] - back).round() as i64, (scale * at[1]).round() as i64]
    };
    #[expect(clippy::cast_possible_wrap, reason = "pixels of a picture")]
    let (width, height) = (w as i64, (pixels.len() / 3 / w) as i64);
    for letter in &letters {
        for (right, down, cover) in letter.pixels() {
            let (x, y) = if reads == Reads::Up { (x0 + down, y0 - right) } else { (x0 + right, y0 + down) };
            if x < 0 || y < 0 || x >= width || y >= height {
                continue;
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the picture")]
            let pixel = &mut pixels[3 * (y * width + x) as usize..][..3];
            for (p, c) in pixel.iter_mut().zip(colour) {
                *p = mixed(*p, c, f64::from(cover) / 255.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Chart, Face, Ramp};

    fn decoded(file: &[u8]) -> (Vec<u8>, usize) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (pixels, info.width as usize)
    }

    fn count(pixels: &[u8], colour: [u8; 3]) -> usize {
        pixels.chunks_exact(3).filter(|p| **p == colour).count()
    }

    #[test]
    fn the_nearer_of_two_faces_is_seen_whatever_their_order() {
        let square = |low: f64, depth: f64, value: f64| {
            let corners = [[low, low], [low + 2.0, low], [low + 2.0, low + 2.0], [low, low + 2.0]];
            Face::new(corners.map(|[x, y]| [x, y, depth]).to_vec(), vec![value; 4], vec![Edge::None; 4])
        };
        let faces = [square(0.0, 0.0, 0.0), square(1.0, 1.0, 1.0)];
        let picture = |faces: Vec<Face>| {
            let chart = Chart::new("two").surface("v", Ramp::Diverging, faces).equal().triad([
                [1.0, 0.0],
                [0.0, 1.0],
                [0.0; 2],
            ]);
            decoded(&chart.png().unwrap()).0
        };
        let found = picture(faces.to_vec());
        assert_eq!(found, picture(vec![faces[1].clone(), faces[0].clone()]));
        let (far, near) = (count(&found, Ramp::Diverging.rgb(0.0)), count(&found, Ramp::Diverging.rgb(1.0)));
        // the near one is whole, of the far one three quarters are left
        #[expect(clippy::cast_precision_loss, reason = "pixels")]
        let share = far as f64 / near as f64;
        assert!((share - 0.75).abs() < 0.02, "{share}");
    }

    #[test]
    fn a_line_has_its_width_and_its_colour() {
        let line = Mark::Line { paint: "class=\"l c0\"".to_owned(), points: vec![[2.0, 5.0], [18.0, 5.0]] };
        let (pixels, w) = decoded(&png(&[line], [20.0, 10.0]).unwrap());
        assert_eq!((w, pixels.len()), (40, 3 * 40 * 20));
        // 1.8 units of width are 3.6 pixels: two or three of them are covered by all samples
        let column: Vec<&[u8]> = (0..20).map(|y| &pixels[3 * (40 * y + 20)..][..3]).collect();
        let whole = column.iter().filter(|p| **p == [0, 0x72, 0xb2]).count();
        assert!((2..=4).contains(&whole), "{column:?}");
        assert_eq!(pixels[..3], [255; 3]);
    }

    #[test]
    fn letters_stand_where_they_are_anchored() {
        let ink = |class: &str| {
            let text =
                Mark::Text { class: class.to_owned(), at: [50.0, 15.0], text: "HH".to_owned(), reads: Reads::Across };
            let (pixels, w) = decoded(&png(&[text], [100.0, 30.0]).unwrap());
            let dark = pixels.chunks_exact(3).enumerate().filter(|(_, p)| p[0] < 128).map(|(k, _)| (k % w, k / w));
            let dark: Vec<(usize, usize)> = dark.collect();
            let xs = || dark.iter().map(|p| p.0);
            assert!(dark.iter().all(|p| p.1 <= 31 && p.1 > 8), "they stand on the line: {dark:?}");
            (xs().min().unwrap(), xs().max().unwrap())
        };
        assert!(ink("").0 >= 100 && ink("e").1 <= 100);
        let (left, right) = ink("m");
        assert!(left < 100 && right > 100);
    }

    #[test]
    fn a_picture_without_pixels_is_refused() {
        assert!(matches!(png(&[], [0.0, 5.0]), Err(PngError::Size([0, 10]))));
        assert!(png(&[], [1e6, 1e6]).is_err());
    }
}
