//! Arguments of `wfl plot`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use wfl_report::{Over, Slice, StepChoice, View, Warp};

pub(crate) const PLOT_HELP: &str = "\
A field is the name of an array of `output vtk`, or the common beginning of several: `u` is uL and uR. Parts: of a vector
magnitude (if none is named), x, y, z; of a tensor vonmises (if none is named), xx, xy, ..., trace, mean, max, min, norm.
Fields of an interface (slip, traction, `state` for the contact state) are drawn in its plane or along it; parts: along,
across. Without --png and --svg a PNG named after the field is written to the current folder.

Of two folders the difference is drawn, the first run minus the second one, on the mesh that both have; with --line a
curve of each. --over draws measures of any number of runs, a curve each.

Examples:
  wfl plot out/nitsche
  wfl plot out/nitsche --field stress:vonmises --step 10 --warp 200 --png stress.png
  wfl plot out/nitsche --field stress:yy --slice x=0.5 --svg slice.svg
  wfl plot out/nitsche --field u:z --line -1,2,2:1,2,2 --png profile.png
  wfl plot out/bar --field u --with \"exact(x)\" --zoom 0.4:0.6,0:0.1 --width 85mm --pdf figure.pdf
  wfl plot out/nitsche --field state --png contact.png
  wfl plot out/nitsche out/penalty --field u:z --png difference.png
  wfl plot out/nitsche out/penalty --over Fn:t --with measured.csv --png curve.png
  wfl plot out/nitsche --field slip --film slip.gif";

/// What is drawn, and where it goes.
#[derive(Debug, ClapArgs)]
pub(crate) struct PlotArgs {
    /// The folder that `wfl run` wrote; of two the difference, of more with --over
    #[arg(value_name = "OUT", required = true)]
    pub(crate) folders: Vec<PathBuf>,
    /// A measure over another one, or over the step variable: a curve through the steps of each run
    #[arg(long, value_name = "UP:RIGHT", value_parser = over, conflicts_with_all = ["field", "step", "slice", "line", "film"])]
    pub(crate) over: Option<Over>,
    /// Beside the curves: of --over the first two columns of a CSV file with a line of names; of a profile a formula of
    /// the scene, such as "exact(x)", with its macros and parameters
    #[arg(long, value_name = "CSV|FORMULA")]
    pub(crate) with: Vec<String>,
    /// The field and a part of it, such as stress:vonmises [default: the displacement, or the first field]
    #[arg(long, value_name = "FIELD[:PART]")]
    pub(crate) field: Option<String>,
    /// `last`, `all` (a picture each, with the same colours) or numbers of steps, counted from 0: 3 or 0,5,10; profiles of
    /// several steps are curves in one picture
    #[arg(long, value_name = "STEP", default_value = "last", value_parser = step)]
    pub(crate) step: StepChoice,
    /// What displacements are multiplied by: `auto` or a number, 0 for bodies that are not deformed
    #[arg(long, value_name = "FACTOR", default_value = "auto", value_parser = warp, allow_negative_numbers = true)]
    pub(crate) warp: Warp,
    /// Cut the bodies, as they were: a plane in three dimensions, a line in two
    #[arg(long, value_name = "x=VALUE", value_parser = slice)]
    pub(crate) slice: Option<Slice>,
    /// Values along the line between two points
    #[arg(long, value_name = "X,Y[,Z]:X,Y[,Z]", value_parser = line, conflicts_with = "slice", allow_hyphen_values = true)]
    pub(crate) line: Option<Slice>,
    /// From where solid bodies are seen: azimuth from x towards y, elevation above the plane of x and y, in degrees
    #[arg(long, value_name = "AZ,EL", default_value = "-60,25", value_parser = view, allow_hyphen_values = true)]
    pub(crate) view: View,
    /// The range of the colours [default: that of the numbers]
    #[arg(long, value_name = "LOW,HIGH", value_parser = range, allow_hyphen_values = true)]
    pub(crate) range: Option<[f64; 2]>,
    /// Only this part of a plane body, a cut or a curve: from and to on both axes
    #[arg(long, value_name = "X0:X1,Y0:Y1", value_parser = zoom, allow_hyphen_values = true)]
    pub(crate) zoom: Option<Zoom>,
    /// Width on paper, such as 85mm for a column of a journal: text is then 8 points high
    #[arg(long, value_name = "WIDTH", value_parser = width)]
    pub(crate) width: Option<f64>,
    /// Leave out the edges of the mesh
    #[arg(long)]
    pub(crate) no_mesh: bool,
    /// Write all steps as a film: .gif, or .mp4 and .webm where ffmpeg is installed
    #[arg(long, value_name = "FILE", conflicts_with_all = ["png", "svg", "pdf"])]
    pub(crate) film: Option<PathBuf>,
    /// Pictures of a film in a second
    #[arg(long, value_name = "NUMBER", default_value = "5", value_parser = clap::value_parser!(u16).range(1..=50), requires = "film")]
    pub(crate) rate: u16,
    /// Write a PNG file
    #[arg(long, value_name = "FILE")]
    pub(crate) png: Option<PathBuf>,
    /// Write an SVG file, with a light and a dark theme
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// Write a PDF file for LaTeX: shapes are paths, text is 8 points high
    #[arg(long, value_name = "FILE")]
    pub(crate) pdf: Option<PathBuf>,
}

/// A window: its lower and its upper corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Zoom(pub(crate) [[f64; 2]; 2]);

/// `0:1,-1:2`.
fn zoom(text: &str) -> Result<Zoom, String> {
    let range = |text: &str| {
        let (from, to) = text.split_once(':')?;
        let ends = [number(from)?, number(to)?];
        (ends[0] < ends[1]).then_some(ends)
    };
    let read = || {
        let (x, y) = text.split_once(',')?;
        let ([x0, x1], [y0, y1]) = (range(x)?, range(y)?);
        Some(Zoom([[x0, y0], [x1, y1]]))
    };
    read().ok_or_else(|| "it is two ranges, each from a smaller to a larger number, as in `0:1,-1:2`".to_owned())
}

/// `85mm`, `8.5cm`, `3.3in`: in millimetres.
fn width(text: &str) -> Result<f64, String> {
    let units = [("mm", 1.0), ("cm", 10.0), ("in", 25.4)];
    let read = units.iter().find_map(|(unit, size)| Some(size * number(text.strip_suffix(unit)?)?));
    read.filter(|w| (30.0..=1000.0).contains(w))
        .ok_or_else(|| "it is a length from 30mm to 1000mm, as in `85mm`".to_owned())
}

/// `last`, `all`, or numbers.
fn step(text: &str) -> Result<StepChoice, String> {
    match text {
        "last" => Ok(StepChoice::Last),
        "all" => Ok(StepChoice::All),
        numbers => {
            let list: Result<Vec<usize>, _> = numbers.split(',').map(|n| n.trim().parse()).collect();
            list.map(StepChoice::Numbers).map_err(|_| "it is `last`, `all` or numbers of steps, as in `0,5,10`".into())
        }
    }
}

/// `F:d`.
fn over(text: &str) -> Result<Over, String> {
    Over::read(text).ok_or_else(|| "it is two names, as in `F:d`".to_owned())
}

/// `auto`, or a number.
fn warp(text: &str) -> Result<Warp, String> {
    if text == "auto" {
        return Ok(Warp::Auto);
    }
    number(text).map(Warp::Factor).ok_or_else(|| "it is `auto` or a number".to_owned())
}

/// `x=0`.
fn slice(text: &str) -> Result<Slice, String> {
    let read = || {
        let (name, value) = text.split_once('=')?;
        let axis = ["x", "y", "z"].iter().position(|a| *a == name.trim())?;
        Some(Slice::Plane { axis, value: number(value)? })
    };
    read().ok_or_else(|| "it is `x=`, `y=` or `z=` with a number".to_owned())
}

/// `0,0:1,2`.
fn line(text: &str) -> Result<Slice, String> {
    let point = |text: &str| {
        let numbers = numbers(text)?;
        matches!(numbers.len(), 2 | 3).then(|| [numbers[0], numbers[1], numbers.get(2).copied().unwrap_or(0.0)])
    };
    let ends = text.split_once(':').and_then(|(a, b)| Some([point(a)?, point(b)?]));
    match ends {
        Some([a, b]) if a == b => Err("both ends are one point: a line has a length, as in `0,0:1,2`".to_owned()),
        Some(ends) => Ok(Slice::Line(ends)),
        None => Err("it is two points, as in `0,0:1,2`".to_owned()),
    }
}

/// `-60,25`.
pub(crate) fn view(text: &str) -> Result<View, String> {
    match numbers(text).as_deref() {
        Some([azimuth, elevation]) => Ok(View { azimuth: *azimuth, elevation: *elevation }),
        _ => Err("it is two angles in degrees, as in `-60,25`".to_owned()),
    }
}

/// `0,40`.
fn range(text: &str) -> Result<[f64; 2], String> {
    match numbers(text).as_deref() {
        Some([low, high]) if low < high => Ok([*low, *high]),
        _ => Err("it is two numbers, the smaller one first, as in `0,40`".to_owned()),
    }
}

fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split(',').map(number).collect()
}

fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|x: &f64| x.is_finite())
}
