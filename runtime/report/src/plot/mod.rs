//! Pictures of results: a field on the deformed bodies, on a plane or a line through them, on an interface.
//!
//! Promises: pictures of several steps share their colours and the factor of the displacements; a colour is the number of
//! the file at its place, linear between nodes. Reads the files that the report of the run names and no others.

mod body;
mod error;
mod field;
mod interface;
mod over;
mod section;
mod skin;
pub(crate) use skin::{MeshLines, skin};
mod view;

use wfl_charts::Chart;

use crate::{
    folder::RunFolder,
    grid::{Whole, read_whole},
    picture::Picture,
};

pub(crate) use body::overview;
pub use error::PlotError;
use field::{Numbers, Wanted};
pub use over::{Over, over};
pub use view::View;

/// The steps that are drawn.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum StepChoice {
    /// The last one with files.
    #[default]
    Last,
    /// All with files.
    All,
    /// Those of these numbers.
    Numbers(Vec<usize>),
}

impl StepChoice {
    /// Pictures have the number of their step in their names.
    fn is_several(&self) -> bool {
        match self {
            StepChoice::Last => false,
            StepChoice::All => true,
            StepChoice::Numbers(list) => list.len() > 1,
        }
    }
}

/// What displacements are multiplied by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Warp {
    /// 1, 2 or 5 times a power of ten, such that the largest displacement is at most a tenth of the extent of the bodies;
    /// 1 if it is more than a twentieth as it is.
    #[default]
    Auto,
    /// This factor; 0 for the bodies as they were.
    Factor(f64),
}

/// Where a body is cut, before it is deformed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slice {
    /// The plane (in three dimensions) or line (in two) where the axis 0, 1 or 2 has this value.
    Plane {
        /// The axis.
        axis: usize,
        /// Its value. Length.
        value: f64,
    },
    /// The line between two points. Length.
    Line([[f64; 3]; 2]),
}

/// What is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    /// A field and a part of it, as in `stress:vonmises`; the displacement, or the first field, if `None`.
    pub field: Option<String>,
    /// The steps.
    pub step: StepChoice,
    /// The factor of the displacements.
    pub warp: Warp,
    /// A cut in place of the whole body.
    pub slice: Option<Slice>,
    /// From where solid bodies are seen.
    pub view: View,
    /// The range of the colours; that of the numbers if `None`.
    pub range: Option<[f64; 2]>,
    /// Leave out the edges of the mesh.
    pub no_mesh: bool,
    /// Only what lies between two corners, in the units of the axes.
    pub zoom: Option<[[f64; 2]; 2]>,
    /// Width on paper in millimetres.
    pub width: Option<f64>,
    /// Curves beside a profile, such as a closed form: names, and numbers at places along it.
    pub beside: Vec<Beside>,
}

/// A curve beside a profile.
#[derive(Clone, Debug, PartialEq)]
pub struct Beside {
    /// What it is.
    pub name: String,
    /// From 0 at one end of the line to 1 at the other, and the number there.
    pub points: Vec<[f64; 2]>,
}

/// Draws a field: one picture, or one for each step that is asked for.
///
/// # Errors
/// [`PlotError`] when files are damaged, or have not what is asked for.
pub fn plots(run: &RunFolder, request: &Request) -> Result<Vec<Picture>, PlotError> {
    if request.zoom.is_some() && dimension(run) == 3 && request.slice.is_none() {
        let what = "a part is drawn of plane bodies, cuts and curves: in space with --slice or --line";
        return Err(PlotError::Unfit(what.to_owned()));
    }
    let pictures = whole_pictures(run, request)?;
    Ok(pictures.into_iter().map(|picture| fitted(picture, request)).collect())
}

/// The part of a picture that is asked for, in the size that is asked for.
fn fitted(Picture { name, chart }: Picture, request: &Request) -> Picture {
    Picture { name, chart: sized(chart, request.zoom, request.width) }
}

/// Where a profile is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileLine {
    /// Its ends.
    pub ends: [[f64; 3]; 2],
    /// The step variable at the last step that is drawn.
    pub time: f64,
}

/// The line of the profile that a request draws; `None` where it draws none.
///
/// # Errors
/// [`PlotError`] when files are damaged, or there is no such step.
pub fn profile_line(run: &RunFolder, request: &Request) -> Result<Option<ProfileLine>, PlotError> {
    let Some(grid) = run.grids.first() else { return Err(PlotError::NoFields) };
    body::line_of(run, &steps(&grid.steps, &request.step)?, request)
}

/// A part of a chart, in a size on paper.
#[must_use]
pub fn sized(chart: Chart, zoom: Option<[[f64; 2]; 2]>, width: Option<f64>) -> Chart {
    let chart = match zoom {
        Some([low, high]) => chart.zoom(low, high),
        None => chart,
    };
    match width {
        Some(width) => chart.column(width),
        None => chart,
    }
}

fn whole_pictures(run: &RunFolder, request: &Request) -> Result<Vec<Picture>, PlotError> {
    let wanted = request.field.as_deref().map(Wanted::read);
    if run.grids.is_empty() {
        return Err(PlotError::NoFields);
    }
    let mut names: Vec<String> = Vec::new();
    for grid in &run.grids {
        let steps = steps(&grid.steps, &request.step)?;
        let dim = dimension(run);
        let Some((_, file)) = steps.last() else { continue };
        let (whole, new) = read_whole(file, dim)?;
        let wanted = wanted.clone().or_else(|| field::first_choice(run, &whole));
        if let Some(wanted) = &wanted
            && field::numbers(&whole, dim, wanted)?.is_some()
        {
            return body::pictures(run, &steps, wanted, request);
        }
        if let Some(wanted) = &wanted
            && let Some(found) = interface::pictures(run, grid, &steps, wanted, request)?
        {
            return Ok(found);
        }
        names.extend(new);
    }
    let asked = request.field.clone().unwrap_or_default();
    if let Some(state) = names.iter_mut().find(|n| *n == "contact_state") {
        "state".clone_into(state);
    }
    names.sort();
    names.dedup();
    Err(if names.is_empty() { PlotError::NoFields } else { PlotError::NoField { asked, known: names } })
}

/// A step with its file.
type Step = (usize, std::path::PathBuf);

fn steps(all: &[Step], choice: &StepChoice) -> Result<Vec<Step>, PlotError> {
    let found: Vec<Step> = match choice {
        StepChoice::Last => all.last().cloned().into_iter().collect(),
        StepChoice::All => all.to_vec(),
        StepChoice::Numbers(list) => {
            let mut found = Vec::with_capacity(list.len());
            for asked in list {
                let step = all.iter().find(|(step, _)| step == asked);
                let known = || all.iter().map(|(step, _)| *step).collect();
                found.push(step.ok_or_else(|| PlotError::NoStep { asked: *asked, known: known() })?.clone());
            }
            found
        }
    };
    if found.is_empty() { Err(PlotError::NoFields) } else { Ok(found) }
}

fn dimension(run: &RunFolder) -> usize {
    usize::try_from(run.report.mesh.dim).unwrap_or(0)
}

/// Numbers of the cells that have the field at all their nodes.
fn known_cells(whole: &Whole, numbers: &Numbers) -> Vec<usize> {
    let known = |k: &usize| whole.cells[*k].nodes.iter().all(|n| numbers.numbers[*n].is_finite());
    (0..whole.cells.len()).filter(known).collect()
}

/// The name of the scene without folder and ending.
fn scene(run: &RunFolder) -> String {
    let path = std::path::Path::new(&run.report.scene);
    path.file_stem().map_or_else(|| run.report.scene.clone(), |s| s.to_string_lossy().into_owned())
}
