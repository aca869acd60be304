//! The page: its sections in the order in which they are read, and its charts as files.

use wfl_charts::{Page, Section};

use crate::{
    accuracy, events, fault,
    folder::{ReportError, RunFolder},
    picture::Picture,
    plot::{self, PlotError},
    profile, solver,
};

/// Steps shown where not all can be, if the reader does not choose.
const SHOWN: usize = 3;

/// The page of a run and its charts.
#[derive(Clone, Debug)]
pub struct Pages {
    /// The page.
    pub page: Page,
    /// Its charts, each under a name of its own.
    pub pictures: Vec<Picture>,
}

impl Pages {
    /// Makes the page of a run. Maps and profiles show the steps closest to the values `at` of the step variable, or
    /// the first, the middle and the last one if there are none.
    ///
    /// # Errors
    /// [`ReportError`] when a result file is cut off.
    pub fn new(run: &RunFolder, at: &[f64]) -> Result<Self, ReportError> {
        let chosen = chosen(run, at);
        let mut parts = vec![(solver::summary(run), Vec::new()), (solver::checks(run), Vec::new())];
        // a run that failed begins with the reason, others with what came out
        let failed = run.report.error.is_some() || run.report.steps.iter().any(|s| !s.converged);
        parts.insert(usize::from(failed), bodies(run)?);
        parts.extend(accuracy::section(run)?);
        parts.push(solver::contact(run));
        parts.extend(fault::sections(run, &chosen)?);
        parts.push((events::section(run), Vec::new()));
        parts.push(measures(run));
        parts.extend(profile::sections(run, &chosen)?);
        parts.push(solver::newton(run));
        parts.push(solver::time(run));
        parts.push((solver::left_out(run), Vec::new()));
        parts.push((solver::numbers(run), Vec::new()));
        parts.push((texts(run), Vec::new()));
        let report = &run.report;
        let mut page = Page::new(format!("{}: report of a run", report.scene));
        page = page.lead(format!("wfl {}. Point at anything in a chart to read its numbers.", report.version));
        let mut pictures: Vec<Picture> = Vec::new();
        for (section, new) in parts {
            page = page.section(section);
            for mut picture in new {
                let same = pictures.iter().filter(|p| p.name == picture.name).count();
                if same > 0 {
                    picture.name = format!("{}_{}", picture.name, pictures.len());
                }
                pictures.push(picture);
            }
        }
        Ok(Pages { page, pictures })
    }
}

/// The deformed bodies at the last step. A field that cannot be drawn leaves no section.
fn bodies(run: &RunFolder) -> Result<(Section, Vec<Picture>), ReportError> {
    let pictures = match plot::overview(run) {
        Ok(pictures) => pictures,
        Err(PlotError::Report(error)) => return Err(error),
        Err(_) => Vec::new(),
    };
    let mut section = Section::new("The result");
    for picture in &pictures {
        section = section.chart(&picture.chart);
    }
    Ok((section, pictures))
}

fn measures(run: &RunFolder) -> (Section, Vec<Picture>) {
    let pictures = profile::measures(run);
    let mut section = Section::new("Measures");
    for picture in &pictures {
        section = section.small(&picture.chart);
    }
    (section, pictures)
}

fn texts(run: &RunFolder) -> Section {
    let mut section = Section::new("The scene");
    for text in &run.report.about.texts {
        section = section.code(text.name.as_str(), text.text.as_str());
    }
    section
}

/// Numbers of the steps to show, in order, of those that have files.
fn chosen(run: &RunFolder, at: &[f64]) -> Vec<usize> {
    let series = run.grids.iter().chain(&run.tables);
    let mut steps: Vec<usize> = series.flat_map(|s| s.steps.iter().map(|(step, _)| *step)).collect();
    steps.sort_unstable();
    steps.dedup();
    if steps.is_empty() {
        return steps;
    }
    let mut chosen: Vec<usize> = if at.is_empty() {
        (0..SHOWN).map(|k| steps[k * (steps.len() - 1) / (SHOWN - 1)]).collect()
    } else {
        let distance = |step: usize, t: f64| (run.time(step) - t).abs();
        let closest = |t: &f64| steps.iter().copied().min_by(|a, b| distance(*a, *t).total_cmp(&distance(*b, *t)));
        at.iter().filter_map(closest).collect()
    };
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}
