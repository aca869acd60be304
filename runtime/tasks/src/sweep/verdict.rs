//! What `wfl run --accuracy` makes of the scenes of the study: the true error of what it picks, and the time of the whole
//! command beside that of the cheapest run of the tables. Each is a process of its own, as
//! a user starts it.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
    time::Instant,
};

use wfl_adapt::knobs::MARKS;
use wfl_host::input::InputKind;
use wfl_output::{REPORT_FILE, Report};

use super::{
    Job,
    front::{method, setting},
    table::{self, Row},
};
use crate::{scene_file::read_text, setting_text};

/// A scene, the quantity asked about, the parts of the study that have its runs, and the reference of its true error.
struct Case {
    scene: &'static str,
    quantity: &'static str,
    parts: &'static [&'static str],
    reference: &'static str,
    asked: &'static [&'static str],
}

const CASES: &[Case] = &[
    Case {
        scene: "runtime/cli/tests/known/corner.wfl",
        quantity: "H1",
        parts: &["singular"],
        reference: "exact",
        asked: &["1e-1", "1e-2", "1e-3"],
    },
    Case {
        scene: "runtime/cli/tests/known/tip.wfl",
        quantity: "H1",
        parts: &["singular"],
        reference: "exact",
        asked: &["1e-1", "1e-2", "1e-3"],
    },
    Case {
        scene: "examples/signorini/signorini.wfl",
        quantity: "H1",
        parts: &["signorini"],
        reference: "exact",
        asked: &["1e-1", "1e-2", "1e-3"],
    },
    Case {
        scene: "examples/crack/compression.wfl",
        quantity: "slip",
        parts: &["crack"],
        reference: "out/study/crack/reference_1.json",
        asked: &["1e-1", "1e-2", "1e-3"],
    },
    Case {
        scene: "examples/fault/nitsche.wfl",
        quantity: "L2",
        parts: &["fault", "quadratic"],
        reference: "out/study/quadratic/reference_1.json",
        asked: &["1e-1", "1e-2", "1e-3"],
    },
    Case {
        scene: "examples/fault/penalty.wfl",
        quantity: "L2",
        parts: &["fault"],
        reference: "out/study/quadratic/reference_1.json",
        asked: &["1e-1", "1e-2"],
    },
];

/// Commands that take less than this, in seconds, are run several times: the fastest counts.
const SHORT: f64 = 5.0;
const REPEAT: usize = 5;
/// Those that take less than this are run so much more often.
const VERY_SHORT: f64 = 0.5;
const MORE: usize = 4;

const HEAD: &str = "
## Runs with a demanded accuracy

The table compares `wfl run SCENE --accuracy ERROR --of QUANTITY` with the cheapest run of the tables above that has the
demanded accuracy. The true error is taken against the references above. The time is that of the whole command: trial
runs, final run and result files. The cheapest run is known only after all runs of the tables; its time is that
of `wfl run` with the same scene and files. Times are the fastest of five commands if these take less than 5 s, of twenty
below 0.5 s.

| scene | demanded | settings picked | estimated error | true error, ± error of the reference | command [s] | cheapest run of the tables | its command [s] | ratio of times |
|---|---|---|---|---|---|---|---|---|
";

/// What no table says.
const TAIL: &str = "\
The command also pays for the runs of its error estimate, for the check of each estimate on another mesh and for the
safety factor. Its meshes are refined where the error comes from; `marks=REPORT` runs them again.
";

/// One demand: its row, its true error in parts of what was asked, and its time in parts of the cheapest.
pub(super) struct Met {
    row: String,
    part: f64,
    times: Option<f64>,
    /// The name of the scene, the quantity, and the parts of the study with runs of both.
    pub(super) scene: String,
    pub(super) quantity: &'static str,
    pub(super) parts: &'static [&'static str],
    /// True error and seconds of the run on the mesh that was found.
    pub(super) found: [f64; 2],
    /// Unknowns and estimated error of each mesh on the way.
    pub(super) way: Vec<[f64; 2]>,
}

/// What the rows say together.
fn summary(rows: &[Met]) -> String {
    let met = rows.iter().filter(|r| r.part <= 1.0).count();
    let near = rows.iter().filter(|r| (0.1..=1.0).contains(&r.part)).count();
    let mut times: Vec<f64> = rows.iter().filter_map(|r| r.times).collect();
    times.sort_by(f64::total_cmp);
    let mut text = format!(
        "\nThe true error is below the demanded one in {met} of {} rows, and at most ten times smaller in {near}.\n",
        rows.len()
    );
    if let (Some(least), Some(middle), Some(most)) = (times.first(), times.get(times.len() / 2), times.last()) {
        text += &format!(
            "The command takes {least:.1} to {most:.1} times as long as the cheapest run; the median is {middle:.1}.\n"
        );
    }
    text
}

/// The runs of every demand.
pub(super) fn runs(job: &Job<'_>) -> Result<Vec<Met>, String> {
    let demands = CASES.iter().flat_map(|case| case.asked.iter().map(move |asked| (case, *asked)));
    demands.map(|(case, asked)| met(job, case, asked)).collect()
}

/// The section of the study.
pub(super) fn section(rows: &[Met]) -> String {
    let table: String = rows.iter().map(|r| r.row.as_str()).collect();
    format!("{HEAD}{table}{}{TAIL}", summary(rows))
}

fn met(job: &Job<'_>, case: &Case, asked: &str) -> Result<Met, String> {
    let name = method(case.scene);
    let folder = PathBuf::from("out/study/accuracy").join(format!("{name}_{asked}"));
    let place = folder.display().to_string();
    let demand = ["run", case.scene, "--accuracy", asked, "--of", case.quantity, "-q", "--out", &place];
    let (ended, seconds) = timed(job, &demand, &folder)?;
    let text = read_text(&folder.join(REPORT_FILE), InputKind::Results)?;
    let report: Report = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let Some(record) = report.accuracy else {
        return Err(format!("{}: {}", case.scene, String::from_utf8_lossy(&ended.stderr)));
    };
    let mut picked = record.picked.clone();
    if record.rounds > 0 {
        picked.push((MARKS.to_owned(), folder.join(REPORT_FILE).display().to_string()));
    }
    let (found, truth) = truth(job, case, &picked, &folder.join("true"))?;
    let wanted: f64 = asked.parse().map_err(|_| format!("{asked} is no number"))?;
    let mut times = None;
    let cheapest = match cheapest(case, wanted)? {
        Some(knobs) => {
            let place = folder.join("cheapest").display().to_string();
            let mut command = vec!["run", case.scene, "-q", "--out", &place];
            command.extend(knobs.iter().map(String::as_str));
            let (_, least) = timed(job, &command, Path::new(&place))?;
            times = Some(seconds / least);
            format!("`{}` | {least:.3} | {:.1}", knobs.join(" "), seconds / least)
        }
        None => "none | | ".to_owned(),
    };
    let row = format!(
        "| {name}, {} | {asked} | `{}`, {} round{} | {:.1e} | {truth} | {seconds:.3} | {cheapest} |\n",
        case.quantity,
        setting_text(&record.picked),
        record.rounds,
        if record.rounds == 1 { "" } else { "s" },
        record.estimate.0
    );
    let known = record.trial_runs.iter().filter(|t| t.error.0.is_finite());
    Ok(Met {
        row,
        part: found[0] / wanted,
        times,
        scene: name,
        quantity: case.quantity,
        parts: case.parts,
        found,
        way: known.map(|t| [t.dofs as f64, t.error.0]).collect(),
    })
}

/// Runs a command of this program that writes into a folder: how it ended, and its seconds, of the fastest of several
/// where it is short.
fn timed(job: &Job<'_>, command: &[&str], folder: &Path) -> Result<(Output, f64), String> {
    let mut least = f64::INFINITY;
    for k in 0..MORE * REPEAT {
        // the folder of a sweep remembers its runs
        let _ = std::fs::remove_dir_all(folder);
        let begin = Instant::now();
        let ended = Command::new(job.program).args(command).output();
        let ended = ended.map_err(|e| format!("cannot run wfl {}: {e}", command.join(" ")))?;
        least = least.min(begin.elapsed().as_secs_f64());
        let most = if least < VERY_SHORT { MORE * REPEAT } else { REPEAT };
        if k + 1 >= most || least > SHORT {
            return Ok((ended, least));
        }
    }
    Err("no run".to_owned())
}

/// The error of what was picked and the seconds of its run; the error in words with that of the reference where it has one.
fn truth(job: &Job<'_>, case: &Case, picked: &[(String, String)], folder: &Path) -> Result<([f64; 2], String), String> {
    // a table of an earlier study has runs of its own
    let _ = std::fs::remove_dir_all(folder);
    let knobs = picked.iter().map(|(n, v)| format!("{n}={v}"));
    let own = Job {
        words: std::iter::once(case.scene.to_owned()).chain(knobs).collect(),
        reference: case.reference.to_owned(),
        reference_knob: Vec::new(),
        out: folder.to_path_buf(),
        listener: &(),
        ..job.clone()
    };
    super::sweep(&own)?;
    let rows = table::read(folder).map_err(|e| e.to_string())?;
    let of = |what: &str| rows.first().and_then(|r| r.value(&format!("{what} {}", case.quantity)));
    let error = of("error").ok_or_else(|| format!("{}: what was picked has no error", case.scene))?;
    let told = match of("reference error") {
        Some(own) => format!("{error:.1e} ± {own:.1e}"),
        None => format!("{error:.1e}"),
    };
    let seconds = rows.first().and_then(|r| r.value("time")).unwrap_or(f64::NAN);
    Ok(([error, seconds], told))
}

/// The knobs of the fastest run of the same scene with an error as small as asked for.
fn cheapest(case: &Case, wanted: f64) -> Result<Option<Vec<String>>, String> {
    let error = format!("error {}", case.quantity);
    let good = |r: &Row| r.text("scene") == case.scene && r.value(&error).is_some_and(|e| e <= wanted);
    let mut best: Option<(f64, Vec<String>)> = None;
    for part in case.parts {
        let rows = table::read(&Path::new("out/study").join(part)).map_err(|e| e.to_string())?;
        for row in rows.iter().filter(|r| good(r)) {
            let Some(time) = row.value("time").filter(|t| best.as_ref().is_none_or(|b| *t < b.0)) else { continue };
            let knobs = setting(row).into_iter().filter(|k| !k.1.is_empty());
            let knob = |(column, value): (&str, &str)| Some(format!("{}={value}", column.strip_prefix("knob ")?));
            best = Some((time, knobs.filter_map(knob).collect()));
        }
    }
    Ok(best.map(|b| b.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_demand_that_is_missed_is_counted() {
        let row = |part: f64, times: f64| Met {
            row: String::new(),
            part,
            times: Some(times),
            scene: String::new(),
            quantity: "H1",
            parts: &[],
            found: [part, times],
            way: Vec::new(),
        };
        let told = summary(&[row(0.5, 2.0), row(1.5, 9.0), row(0.01, 3.0), row(f64::NAN, 4.0)]);
        assert!(told.contains("in 2 of 4 rows, and at most ten times smaller in 1."), "{told}");
        assert!(told.contains("2.0 to 9.0 times as long as the cheapest run; the median is 4.0"), "{told}");
    }
}
