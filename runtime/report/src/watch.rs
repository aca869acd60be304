//! The page about a run that is still going on: residuals, contact and measures so far, and how long it may take.
//!
//! Made from numbers that whoever runs it collects; reads no files. The page loads itself again until the run has ended.

use wfl_charts::{Chart, Page, Scale, Section, Series, short};

/// Iterations that are shown.
const ITERATIONS: usize = 200;
/// Seconds after which a browser loads the page again.
const AGAIN: u32 = 2;

/// A step that has ended.
#[derive(Clone, Debug, PartialEq)]
pub struct WatchedStep {
    /// The step variable.
    pub time: f64,
    /// Measures by name.
    pub measures: Vec<(String, f64)>,
    /// Points open, slipping, sticking; `None` without contact.
    pub contact: Option<[usize; 3]>,
}

/// What is known of a run so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Watched {
    /// The name of the scene.
    pub scene: String,
    /// The name of the step variable.
    pub variable: String,
    /// How many steps there are; `None` where the run chooses them.
    pub count: Option<usize>,
    /// Steps that an earlier process did.
    pub before: usize,
    /// Steps that have ended.
    pub steps: Vec<WatchedStep>,
    /// Relative residuals of all iterations so far, the last ones.
    pub residuals: Vec<f64>,
    /// How the last iteration found its points: open, slipping, sticking.
    pub contact: Option<[usize; 3]>,
    /// Seconds since it began.
    pub seconds: f64,
    /// It has ended.
    pub has_ended: bool,
}

impl Watched {
    /// Adds the residual of an iteration.
    pub fn iteration(&mut self, residual: f64, contact: Option<[usize; 3]>) {
        if self.residuals.len() == 2 * ITERATIONS {
            self.residuals.drain(..ITERATIONS);
        }
        self.residuals.push(residual);
        self.contact = contact;
    }

    /// Seconds that are left if steps take as long as they took; `None` before a step has ended, and where their number is
    /// not known.
    #[must_use]
    pub fn seconds_left(&self) -> Option<f64> {
        let left = self.count?.saturating_sub(self.before + self.steps.len());
        #[expect(clippy::cast_precision_loss, reason = "numbers of steps")]
        let left = left as f64 / self.steps.len() as f64 * self.seconds;
        (!self.steps.is_empty()).then_some(left)
    }

    /// The page.
    #[must_use]
    pub fn html(&self) -> String {
        let page = Page::new(self.scene.as_str()).lead(self.lead()).section(self.residual_section());
        let page = page.section(self.contact_section()).section(self.measure_section());
        if self.has_ended { page.html() } else { page.again(AGAIN).html() }
    }

    fn lead(&self) -> String {
        let done = self.before + self.steps.len();
        let mut parts = vec![match self.count {
            Some(count) => format!("{done} of {count} steps done"),
            None => format!("{done} steps done"),
        }];
        if let Some(step) = self.steps.last() {
            parts.push(format!("{} = {}", self.variable, short(step.time)));
        }
        parts.push(format!("{} so far", duration(self.seconds)));
        match self.seconds_left() {
            _ if self.has_ended => parts.push("the run has ended".to_owned()),
            Some(left) => parts.push(format!("about {} left", duration(left))),
            None => {}
        }
        parts.join(", ")
    }

    fn residual_section(&self) -> Section {
        let from = self.residuals.len().saturating_sub(ITERATIONS);
        #[expect(clippy::cast_precision_loss, reason = "some hundred iterations")]
        let points = self.residuals[from..].iter().enumerate().map(|(k, r)| [k as f64, *r]);
        let chart = Chart::new("Residual").x("iteration", Scale::Linear).y("relative residual", Scale::Log);
        let chart = chart.line_points(Series::new("", points));
        let section = Section::new("Residual").text("The last iterations, those of a step one after the other.");
        if self.residuals.is_empty() { Section::new("Residual") } else { section.chart(&chart) }
    }

    fn contact_section(&self) -> Section {
        let section = Section::new("Contact");
        let Some(now) = self.contact else { return section };
        let section = section.text(format!("Now {} points open, {} slipping, {} sticking.", now[0], now[1], now[2]));
        let mut chart =
            Chart::new("Contact points").x(self.variable.as_str(), Scale::Linear).y("points", Scale::Linear);
        for (k, name) in ["open", "slip", "stick"].into_iter().enumerate() {
            #[expect(clippy::cast_precision_loss, reason = "numbers of points")]
            let points = self.steps.iter().filter_map(|s| Some([s.time, s.contact?[k] as f64]));
            chart = chart.line_points(Series::new(name, points));
        }
        section.chart(&chart)
    }

    fn measure_section(&self) -> Section {
        let mut section = Section::new("Measures");
        let Some(last) = self.steps.last() else { return section };
        for (name, value) in &last.measures {
            let of = |s: &WatchedStep| Some([s.time, s.measures.iter().find(|m| m.0 == *name)?.1]);
            let chart = Chart::new(format!("{name} = {}", short(*value)))
                .x(self.variable.as_str(), Scale::Linear)
                .y(name.as_str(), Scale::Linear)
                .line_points(Series::new("", self.steps.iter().filter_map(of)));
            section = section.small(&chart);
        }
        section
    }
}

/// Seconds as a person says them.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watched() -> Watched {
        let step =
            |k: f64| WatchedStep { time: k, measures: vec![("F".to_owned(), 3.0 * k)], contact: Some([1, 2, 3]) };
        let mut watched = Watched {
            scene: "belt".to_owned(),
            variable: "t".to_owned(),
            count: Some(10),
            before: 2,
            steps: vec![step(3.0), step(4.0)],
            seconds: 8.0,
            ..Watched::default()
        };
        (0..3).for_each(|k| watched.iteration(0.1f64.powi(k), Some([0, 4, 2])));
        watched
    }

    #[test]
    fn what_is_left_follows_from_the_steps_of_this_process() {
        let mut watched = watched();
        assert_eq!(watched.seconds_left(), Some(24.0));
        let html = watched.html();
        for words in
            ["4 of 10 steps done", "t = 4", "8 s so far", "about 24 s left", "http-equiv=\"refresh\"", "F = 12"]
        {
            assert!(html.contains(words), "{words}");
        }
        assert!(html.contains("0 points open, 4 slipping, 2 sticking"));
        watched.has_ended = true;
        assert!(watched.html().contains("the run has ended") && !watched.html().contains("http-equiv"));
        watched.count = None;
        assert_eq!(watched.seconds_left(), None);
    }

    #[test]
    fn memory_does_not_grow_with_the_iterations() {
        let mut watched = Watched::default();
        (0..10_000).for_each(|k| watched.iteration(f64::from(k), None));
        assert!(watched.residuals.len() <= 2 * ITERATIONS && watched.residuals.last() == Some(&9999.0));
        assert!(Watched::default().html().contains("0 steps done"));
    }
}
