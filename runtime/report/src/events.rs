//! The events of a run: a table of their times, and bands behind what is drawn over the steps.

use wfl_charts::{Chart, Section, Table, short};

use crate::folder::RunFolder;

/// Times of one event that the table shows; of more it shows the first and the last ones.
const SHOWN: usize = 20;

/// When each event began and ended.
pub(crate) fn section(run: &RunFolder) -> Section {
    let section = Section::new("Events");
    if run.report.events.is_empty() {
        return section;
    }
    let variable = run.with_unit(run.variable(), run.variable());
    let mut table =
        Table::new(["event", "number", &format!("begins at {variable}"), "ends at", "lasts", "since the last one"]);
    let mut left_out = Vec::new();
    for (name, times) in run.report.events.iter() {
        if times.is_empty() {
            table.row([
                name.to_owned(),
                "0".to_owned(),
                "never".to_owned(),
                String::new(),
                String::new(),
                String::new(),
            ]);
        }
        for (k, time) in times.iter().enumerate() {
            if times.len() > SHOWN && (SHOWN / 2..times.len() - SHOWN / 2).contains(&k) {
                continue;
            }
            let since = k.checked_sub(1).map_or(String::new(), |b| short(time.begin.0 - times[b].begin.0));
            let end = time.end.map_or("at the last step it lasts".to_owned(), |e| short(e.0));
            let lasts = time.end.map_or(String::new(), |e| short(e.0 - time.begin.0));
            table.row([name.to_owned(), (k + 1).to_string(), short(time.begin.0), end, lasts, since]);
        }
        if times.len() > SHOWN {
            left_out.push(format!("{} of {} times of `{name}` are not shown.", times.len() - SHOWN, times.len()));
        }
    }
    let section = section.table(table);
    left_out.into_iter().fold(section, |section, text| section.text(text))
}

/// A chart over the steps, with a band where an event lasted.
pub(crate) fn marked(run: &RunFolder, chart: Chart) -> Chart {
    let last = run.report.steps.last().map_or(0.0, |s| s.t.0);
    let times = run.report.events.iter().flat_map(|(name, times)| times.iter().map(move |t| (name, t)));
    times.fold(chart, |chart, (name, time)| {
        let end = time.end.map_or(last, |e| e.0);
        chart.band(time.begin.0, end, format!("{name}\n{} to {}", short(time.begin.0), short(end)))
    })
}
