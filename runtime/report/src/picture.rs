//! What the sections share: charts with names, words and colours for steps and contact states.

use wfl_charts::{Chart, Colour, Series, short};

use crate::folder::RunFolder;

/// Names and colours of the numbers in `contact_state`.
pub(crate) const STATES: [(&str, Option<Colour>); 3] =
    [("open", None), ("slip", Some(Colour::Palette(1))), ("stick", Some(Colour::Palette(0)))];
/// Most lines that are named one by one.
const LEGEND: usize = 5;

/// A chart with a name for its file.
#[derive(Clone, Debug)]
pub struct Picture {
    /// A file name without its ending: letters, digits, `_` and `-`.
    pub name: String,
    /// The chart.
    pub chart: Chart,
}

impl Picture {
    /// A picture; other characters of the name become `_`.
    pub(crate) fn new(name: &str, chart: Chart) -> Self {
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
        let words: String = name.chars().map(plain).collect();
        let name = words.split('_').filter(|w| !w.is_empty()).collect::<Vec<_>>().join("_");
        Picture { name, chart }
    }
}

/// `t = 0.5`, or nothing in a run of one step.
pub(crate) fn at_step(run: &RunFolder, step: usize) -> String {
    if run.report.steps.len() < 2 {
        return "at the end".to_owned();
    }
    format!("{} = {}", run.variable(), short(run.time(step)))
}

/// A line a step: dark is early, bright is late. One line alone has no tone.
pub(crate) fn over_steps(run: &RunFolder, chart: Chart, lines: Vec<(usize, Vec<[f64; 2]>)>) -> Chart {
    let times: Vec<f64> = lines.iter().map(|(step, _)| run.time(*step)).collect();
    let (low, high) = times.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(*t), b.max(*t)));
    let several = lines.len() > 1 && low < high;
    let many = several && lines.len() > LEGEND;
    let mut chart = if many { chart.tones(run.with_unit(run.variable(), run.variable()), low, high) } else { chart };
    for ((step, points), time) in lines.into_iter().zip(times) {
        let name = if several { at_step(run, step) } else { String::new() };
        let series = Series::new(name, points);
        let series = if several { series.colour(Colour::Tone((time - low) / (high - low))) } else { series };
        chart = chart.line_points(series);
    }
    chart
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_pictures_are_file_names() {
        assert_eq!(Picture::new("|slip along| 1 (a/b)_3", Chart::new("")).name, "slip_along_1_a_b_3");
    }
}
