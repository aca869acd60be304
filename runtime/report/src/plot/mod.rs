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
#[cfg(test)]
pub(crate) use skin::skin;
mod view;

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepChoice {
    /// The last one with files.
    #[default]
    Last,
    /// All with files.
    All,
    /// The one of this number.
    Number(usize),
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
}

/// Draws a field: one picture, or one for each step that is asked for.
///
/// # Errors
/// [`PlotError`] when files are damaged, or have not what is asked for.
pub fn plots(run: &RunFolder, request: &Request) -> Result<Vec<Picture>, PlotError> {
    let wanted = request.field.as_deref().map(Wanted::read);
    if run.grids.is_empty() {
        return Err(PlotError::NoFields);
    }
    let mut names: Vec<String> = Vec::new();
    for grid in &run.grids {
        let steps = steps(&grid.steps, request.step)?;
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

fn steps(all: &[Step], choice: StepChoice) -> Result<Vec<Step>, PlotError> {
    let found: Vec<Step> = match choice {
        StepChoice::Last => all.last().cloned().into_iter().collect(),
        StepChoice::All => all.to_vec(),
        StepChoice::Number(n) => all.iter().filter(|(step, _)| *step == n).cloned().collect(),
    };
    match (found.is_empty(), choice) {
        (true, StepChoice::Number(asked)) => {
            Err(PlotError::NoStep { asked, known: all.iter().map(|(step, _)| *step).collect() })
        }
        (true, _) => Err(PlotError::NoFields),
        _ => Ok(found),
    }
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
