//! One number of each step over another: curves of force over displacement, hysteresis loops.

use std::path::Path;

use wfl_charts::{Chart, Colour, Scale, Series};

use super::PlotError;
use crate::{
    folder::{ReportError, RunFolder},
    picture::Picture,
    table::Columns,
};

/// What is drawn over what: `F:d`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Over {
    /// The measure that goes up.
    pub up: String,
    /// The measure, or the step variable, that goes to the right.
    pub right: String,
}

impl Over {
    /// Reads `F:d`; `None` where it is not two names.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let (up, right) = text.split_once(':')?;
        let [up, right] = [up.trim().to_owned(), right.trim().to_owned()];
        (!up.is_empty() && !right.is_empty() && !right.contains(':')).then_some(Self { up, right })
    }
}

/// A curve a run, through its converged steps in their order, and points of tables beside them: the first two columns.
///
/// # Errors
/// [`PlotError`] when a run has no such measure, or a table cannot be read.
pub fn over(runs: &[RunFolder], over: &Over, with: &[&Path]) -> Result<Picture, PlotError> {
    let Some(first) = runs.first() else { return Err(PlotError::NoFields) };
    let mut chart = Chart::new(format!("{} over {}", over.up, over.right))
        .size(520.0, 340.0)
        .x(first.with_unit(&over.right, &over.right), Scale::Linear)
        .y(first.with_unit(&over.up, &over.up), Scale::Linear);
    for run in runs {
        let points = points(run, over)?;
        let name = if runs.len() + with.len() > 1 { run.folder_name() } else { String::new() };
        chart = chart.line_points(Series::new(name, points));
    }
    for (k, file) in with.iter().enumerate() {
        let columns = Columns::foreign(file).map_err(|error| match error {
            ReportError::Damaged { what, .. } => PlotError::Unfit(format!("`{}` is no table: {what}", file.display())),
            other => other.into(),
        })?;
        let [x, y, ..] = columns.values.as_slice() else {
            let what = format!("`{}` has fewer than two columns", file.display());
            return Err(PlotError::Unfit(what));
        };
        let name = file.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let points = x.iter().zip(y).map(|(x, y)| [*x, *y]);
        chart = chart.points(Series::new(name, points).colour(Colour::Palette(runs.len() + k)));
    }
    Ok(Picture::new(&format!("{}_over_{}", over.up, over.right), chart))
}

fn points(run: &RunFolder, over: &Over) -> Result<Vec<[f64; 2]>, PlotError> {
    let variable = run.variable();
    let value = |step: usize, name: &str| match run.report.steps[step].measures.get(name) {
        Some(value) => Some(value.0),
        None => (name == variable).then(|| run.time(step)),
    };
    let mut points = Vec::new();
    for step in (0..run.report.steps.len()).filter(|k| run.report.steps[*k].converged) {
        let mut pair = [0.0; 2];
        for (number, name) in pair.iter_mut().zip([&over.right, &over.up]) {
            *number = value(step, name).ok_or_else(|| {
                let measures = run.report.steps[step].measures.iter().map(|(name, _)| name.to_owned());
                let known = measures.chain([variable.to_owned()]).collect();
                PlotError::NoMeasure { asked: name.clone(), known }
            })?;
        }
        points.push(pair);
    }
    if points.is_empty() {
        return Err(PlotError::Unfit("no step of the run has converged".to_owned()));
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_names_with_a_colon_between() {
        let read = |text| Over::read(text).map(|o| (o.up, o.right));
        assert_eq!(read("F:d"), Some(("F".to_owned(), "d".to_owned())));
        assert_eq!(read(" F : t "), Some(("F".to_owned(), "t".to_owned())));
        for text in ["F", "F:", ":d", "a:b:c", ""] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
