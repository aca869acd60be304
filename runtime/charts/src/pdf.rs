//! A chart as a PDF file of one page (ISO 32000-1:2008): paths and letters, to be included by LaTeX.
//!
//! Promises: the same chart gives the same bytes; shapes are those of the SVG on light ground, on a page without a ground;
//! letters are in Helvetica and Symbol, which every reader has, and can be searched and copied. Faces of a surface are
//! polygons, sorted by depth as in an SVG; of more faces than an SVG draws one by one the surface is an image.

mod letters;

use std::fmt::Write as _;

use letters::{Letter, length, letters};

use crate::{
    colour::of_class,
    map::Edge,
    marks::{Mark, Paint, Reads},
    raster::{Layers, PngError, layers},
    surface::{Placed, Surface},
    text::FACES,
};

/// Points a unit of a chart: text of 13 units is 8 points high, as in a column of a journal.
const POINTS: f64 = 8.0 / 13.0;
/// Control points of a quarter of a circle made of a cubic curve, for a radius of 1: 4/3 (sqrt(2) - 1).
const QUARTER: f64 = 0.552_284_749_830_793_4;
/// Ink of letters and edges, as in the style sheet.
const INK: [u8; 3] = [0x1d, 0x21, 0x25];
/// Widths of lines in units, as in the style sheet: the rim that closes hairlines, edges of the mesh and of the body.
const HAIR: f64 = 0.6;
const MESH: f64 = 0.4;
const RIM: f64 = 1.0;
/// How much of the colour an edge of the mesh has, on top of the face.
const MESH_COVER: &str = "0.45";

/// The file of marks on a page of this size in units.
pub(crate) fn pdf(marks: &[Mark], size: [f64; 2], title: &str) -> Result<Vec<u8>, PngError> {
    let mut page = Page { content: String::new(), height: size[1], images: Vec::new() };
    page.content.push_str("1 j\n");
    for mark in marks {
        page.draw(mark)?;
    }
    Ok(page.file(size, title))
}

/// The page while it is drawn on.
struct Page {
    /// Operators.
    content: String,
    /// In units.
    height: f64,
    images: Vec<Layers>,
}

impl Page {
    fn op(&mut self, text: std::fmt::Arguments<'_>) {
        // writing to a string cannot fail
        let _ = self.content.write_fmt(text);
        self.content.push('\n');
    }

    /// A place on the page in points, y up.
    fn at(&self, [x, y]: [f64; 2]) -> String {
        format!("{:.2} {:.2}", POINTS * x, POINTS * (self.height - y))
    }

    fn path(&mut self, points: &[[f64; 2]]) {
        for (k, point) in points.iter().enumerate() {
            let at = self.at(*point);
            self.op(format_args!("{at} {}", if k == 0 { 'm' } else { 'l' }));
        }
    }

    fn fill(&mut self, [r, g, b]: [u8; 3]) {
        self.op(format_args!("{} {} {} rg", share(r), share(g), share(b)));
    }

    fn stroke(&mut self, [r, g, b]: [u8; 3], width: f64) {
        self.op(format_args!("{} {} {} RG {:.3} w", share(r), share(g), share(b), POINTS * width));
    }

    fn draw(&mut self, mark: &Mark) -> Result<(), PngError> {
        match mark {
            Mark::Line { paint, points } => {
                let paint = Paint::of(paint);
                let Some(colour) = paint.stroke.filter(|_| points.len() > 1 && finite(points)) else { return Ok(()) };
                self.stroke(colour, paint.width);
                let [on, off] = [6.0, 4.0].map(|d| POINTS * d);
                if paint.dashed {
                    self.op(format_args!("[{on:.2} {off:.2}] 0 d"));
                }
                self.path(points);
                self.op(format_args!("S"));
                if paint.dashed {
                    self.op(format_args!("[] 0 d"));
                }
            }
            Mark::Polygon { paint, corners } if corners.len() > 2 && finite(corners) => {
                let how = self.paint(&Paint::of(paint));
                self.path(corners);
                self.op(format_args!("{how}"));
            }
            Mark::Polygon { .. } => {}
            Mark::Disc { paint, at, r } => {
                let how = self.paint(&Paint::of(paint));
                self.circle(*at, *r);
                self.op(format_args!("{how}"));
            }
            Mark::Text { class, at, text, reads } => self.text(class, *at, text, *reads),
            Mark::Surface(surface) => self.surface(surface)?,
        }
        Ok(())
    }

    /// Sets the colours of an area; the operator that closes it and paints.
    fn paint(&mut self, paint: &Paint) -> &'static str {
        if let Some(colour) = paint.fill {
            self.fill(colour);
        }
        if let Some(colour) = paint.stroke {
            self.stroke(colour, paint.width);
        }
        match (paint.fill, paint.stroke) {
            (Some(_), Some(_)) => "b*",
            (Some(_), None) => "f*",
            (None, Some(_)) => "s",
            (None, None) => "n",
        }
    }

    /// Four cubic curves.
    fn circle(&mut self, [x, y]: [f64; 2], r: f64) {
        let start = self.at([x + r, y]);
        self.op(format_args!("{start} m"));
        let mut from = [1.0, 0.0];
        for _ in 0..4 {
            let to = [-from[1], from[0]];
            let place = |a: [f64; 2], b: [f64; 2]| [x + r * (a[0] + QUARTER * b[0]), y + r * (a[1] + QUARTER * b[1])];
            let [one, two, end] =
                [place(from, to), place(to, from), [x + r * to[0], y + r * to[1]]].map(|p| self.at(p));
            self.op(format_args!("{one} {two} {end} c"));
            from = to;
        }
    }

    fn text(&mut self, class: &str, at: [f64; 2], text: &str, reads: Reads) {
        let has = |c: &str| class.split(' ').any(|x| x == c);
        let size = POINTS
            * if has("t") {
                14.0
            } else if has("s") {
                12.0
            } else {
                13.0
            };
        let list = letters(text, has("t"));
        let along = size
            * length(&list)
            * if has("m") {
                0.5
            } else if has("e") {
                1.0
            } else {
                0.0
            };
        let [x, y] = [POINTS * at[0], POINTS * (self.height - at[1])];
        self.fill(class.split(' ').find_map(of_class).unwrap_or(INK));
        let place = if reads == Reads::Up {
            format!("0 1 -1 0 {x:.2} {:.2} Tm", y - along)
        } else {
            format!("1 0 0 1 {:.2} {y:.2} Tm", x - along)
        };
        self.op(format_args!("BT {place}"));
        for run in list.chunk_by(Letter::alike) {
            let Letter { font, raised, .. } = run[0];
            let (size, rise) = if raised { (letters::SMALL * size, letters::RISE * size) } else { (size, 0.0) };
            let text: String = run.iter().map(Letter::escaped).collect();
            self.op(format_args!("/{} {size:.2} Tf {rise:.2} Ts ({text}) Tj", font.name()));
        }
        self.op(format_args!("ET"));
    }

    fn surface(&mut self, surface: &Surface) -> Result<(), PngError> {
        if surface.faces.len() > FACES {
            let image = layers(surface)?;
            let [w, h] = image.units.map(|s| POINTS * s);
            let low = self.at([image.at[0], image.at[1] + image.units[1]]);
            let k = self.images.len();
            self.op(format_args!("q {w:.2} 0 0 {h:.2} {low} cm /Im{k} Do Q"));
            self.images.push(image);
            return Ok(());
        }
        let parts = surface.parts();
        if surface.is_flat() {
            surface.faces.iter().for_each(|face| self.face(surface, face, parts));
            surface.faces.iter().for_each(|face| self.edges(face));
        } else {
            for face in surface.farthest_first() {
                self.face(surface, face, parts);
                self.edges(face);
            }
        }
        Ok(())
    }

    fn face(&mut self, surface: &Surface, face: &Placed, parts: usize) {
        for (corners, tone) in face.parts(parts) {
            let colour = surface.ramp.rgb(tone);
            self.fill(colour);
            // a rim of the same colour closes the hairlines between neighbours
            self.stroke(colour, HAIR);
            self.path(&corners);
            self.op(format_args!("b*"));
        }
    }

    fn edges(&mut self, face: &Placed) {
        for (kind, width) in [(Edge::Mesh, MESH), (Edge::Rim, RIM)] {
            let mut is_first = true;
            for (k, _) in face.edges.iter().enumerate().filter(|(_, edge)| **edge == kind) {
                if std::mem::take(&mut is_first) {
                    let state = if kind == Edge::Mesh { "/Mesh gs" } else { "/Full gs" };
                    self.op(format_args!("{state}"));
                    self.stroke(INK, width);
                }
                let (a, b) = (face.corners[k], face.corners[(k + 1) % face.corners.len()]);
                self.path(&[[a[0], a[1]], [b[0], b[1]]]);
            }
            if !is_first {
                self.op(format_args!("S /Full gs"));
            }
        }
    }

    /// Objects, their table and the trailer.
    fn file(self, size: [f64; 2], title: &str) -> Vec<u8> {
        let [w, h] = size.map(|s| POINTS * s);
        let mut images = String::new();
        let first_image = 9;
        for k in 0..self.images.len() {
            let _ = write!(images, "/Im{k} {} 0 R ", first_image + 2 * k);
        }
        let font =
            |base: &str, coding: &str| format!("<</Type/Font/Subtype/Type1/BaseFont/{base}{coding}>>").into_bytes();
        const LATIN: &str = "/Encoding/WinAnsiEncoding";
        let title: String = letters(title, false).iter().map(Letter::escaped).collect();
        let mut objects = vec![
            b"<</Type/Catalog/Pages 2 0 R>>".to_vec(),
            b"<</Type/Pages/Kids[3 0 R]/Count 1>>".to_vec(),
            format!(
                "<</Type/Page/Parent 2 0 R/MediaBox[0 0 {w:.2} {h:.2}]/Contents 4 0 R/Resources<</Font<</F1 5 0 R/F2 6 0 R\
                 /F3 7 0 R>>/XObject<<{images}>>/ExtGState<</Mesh<</CA {MESH_COVER}>>/Full<</CA 1>>>>>>>>"
            )
            .into_bytes(),
            stream("", self.content.as_bytes()),
            font("Helvetica", LATIN),
            font("Helvetica-Bold", LATIN),
            font("Symbol", ""),
            format!("<</Title({title})/Producer(WFL)>>").into_bytes(),
        ];
        for (k, image) in self.images.iter().enumerate() {
            let [w, h] = image.pixels;
            let layer = |colours: &str, n: usize, mask: &str, data: &[u8]| {
                let rows = format!("/DecodeParms<</Predictor 15/Colors {n}/BitsPerComponent 8/Columns {w}>>");
                let head = "/Type/XObject/Subtype/Image/BitsPerComponent 8/Filter/FlateDecode";
                stream(&format!("{head}/Width {w}/Height {h}/ColorSpace/{colours}{mask}{rows}"), data)
            };
            let mask = format!("/SMask {} 0 R", first_image + 2 * k + 1);
            objects.push(layer("DeviceRGB", 3, &mask, &image.colours));
            objects.push(layer("DeviceGray", 1, "", &image.cover));
        }
        assembled(&objects)
    }
}

fn share(byte: u8) -> String {
    format!("{:.3}", f64::from(byte) / 255.0)
}

fn finite(points: &[[f64; 2]]) -> bool {
    points.as_flattened().iter().all(|x| x.is_finite())
}

fn stream(entries: &str, data: &[u8]) -> Vec<u8> {
    let mut out = format!("<<{entries}/Length {}>>\nstream\n", data.len()).into_bytes();
    out.extend_from_slice(data);
    out.extend_from_slice(b"\nendstream");
    out
}

/// The file of numbered objects: the first is the catalogue, the eighth tells of the document.
fn assembled(objects: &[Vec<u8>]) -> Vec<u8> {
    let mut out = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n".to_vec();
    let mut table = String::new();
    for (k, object) in objects.iter().enumerate() {
        let _ = writeln!(table, "{:010} 00000 n ", out.len());
        out.extend(format!("{} 0 obj\n", k + 1).into_bytes());
        out.extend_from_slice(object);
        out.extend_from_slice(b"\nendobj\n");
    }
    let (n, start) = (objects.len() + 1, out.len());
    let tail = format!(
        "xref\n0 {n}\n0000000000 65535 f \n{table}trailer\n<</Size {n}/Root 1 0 R/Info 8 0 R>>\nstartxref\n{start}\n%%EOF\n"
    );
    out.extend(tail.into_bytes());
    out
}

#[cfg(test)]
mod tests {
    use crate::{Chart, Edge, Face, Ramp, Scale, Series};

    fn text(file: &[u8]) -> String {
        file.iter().map(|b| char::from(*b)).collect()
    }

    /// Every object starts where the table says, and the page has the size that is asked for.
    #[test]
    fn the_table_names_the_objects() {
        let line = Series::new("measured", [[0.0, -1.0], [1.0, 2e-3], [2.0, 3.0]]).dashed();
        let chart = Chart::new("A (test)").x("h [m]", Scale::Linear).y("τ [MPa]", Scale::Linear).line_points(line);
        let file = chart.column(85.0).pdf().unwrap();
        let all = text(&file);
        let start: usize = all.rsplit("startxref\n").next().unwrap().lines().next().unwrap().parse().unwrap();
        let table = text(&file[start..]);
        let rows: Vec<&str> = table.lines().skip(3).take_while(|l| l.ends_with("n ")).collect();
        assert_eq!(rows.len(), 8);
        for (k, row) in rows.iter().enumerate() {
            let at: usize = row[..10].parse().unwrap();
            assert!(file[at..].starts_with(format!("{} 0 obj", k + 1).as_bytes()), "{row}");
        }
        // 85 mm are 240.94 points
        let width: f64 = all.split("MediaBox[0 0 ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!((width / (85.0 / 25.4 * 72.0) - 1.0).abs() < 5e-3, "{width}");
        for words in ["(A \\(test\\)) Tj", "/F3", "(t) Tj", "] 0 d", "(h [m]) Tj"] {
            assert!(all.contains(words), "{words} is not in {all}");
        }
    }

    /// Few faces are polygons, the near ones last; many are an image with its cover.
    #[test]
    fn surfaces_are_polygons_or_an_image() {
        let square = |depth: f64, value: f64, size: f64| {
            let corners = [[0.0, 0.0], [size, 0.0], [size, size], [0.0, size]].map(|[x, y]| [x, y, depth]).to_vec();
            Face::new(corners, vec![value; 4], vec![Edge::Rim; 4])
        };
        let few = Chart::new("few")
            .surface("p", Ramp::Viridis, [square(1.0, 1.0, 1.0), square(-1.0, 0.0, 1.0)])
            .pdf()
            .unwrap();
        let few = text(&few);
        let (dark, bright) = ("0.267 0.004 0.329 rg", "0.992 0.906 0.145 rg");
        assert!(few.find(dark).unwrap() < few.find(bright).unwrap() && !few.contains("/Im0 Do"));
        // small ones: each would be filled sample by sample
        let many = (0..3000).map(|k| square(f64::from(k), f64::from(k), if k == 0 { 1.0 } else { 0.01 }));
        let many = text(&Chart::new("many").surface("p", Ramp::Viridis, many).pdf().unwrap());
        assert!(many.contains("/Im0 Do") && many.contains("/SMask 10 0 R") && many.contains("/Predictor 15"));
    }
}
