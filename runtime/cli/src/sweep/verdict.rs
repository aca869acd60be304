//! What `wfl run --accuracy` makes of the scenes of the study: the true error and the time of what it picks, beside the
//! cheapest run of the tables. Each demand is a process of its own, as a user starts it.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use wfl_runtime::output::{REPORT_FILE, Report};

use super::{
    front::method,
    table::{self, Row},
    words,
};
use crate::{args::SweepArgs, load::read_text};

/// A scene, the quantity asked about, and the part of the study that has its reference and its runs.
struct Case {
    scene: &'static str,
    quantity: &'static str,
    part: &'static str,
    reference: &'static str,
    asked: &'static [&'static str],
}

const CASES: &[Case] = &[
    Case {
        scene: "examples/signorini/signorini.wfl",
        quantity: "H1",
        part: "signorini",
        reference: "exact",
        asked: &["1e-1", "1e-2", "1e-3"],
    },
    Case {
        scene: "examples/crack/compression.wfl",
        quantity: "slip",
        part: "crack",
        reference: "out/study/crack/reference_1.json",
        asked: &["1e-1", "1e-2", "1e-3"],
    },
    Case {
        scene: "examples/fault/nitsche.wfl",
        quantity: "L2",
        part: "fault",
        reference: "out/study/fault/reference_1.json",
        asked: &["1e-1", "1e-2"],
    },
    Case {
        scene: "examples/fault/penalty.wfl",
        quantity: "L2",
        part: "fault",
        reference: "out/study/fault/reference_1.json",
        asked: &["1e-1", "1e-2"],
    },
];

const HEAD: &str = "
## A wanted accuracy

What `wfl run SCENE --accuracy ERROR --of QUANTITY` picks, its true error against the references above, the time of all
its runs together, and that of the cheapest run of the tables above that is as accurate as asked for (with the same
method; which run that is, is only known when all are done).

| scene | asked | picked | estimated | true | all runs [s] | cheapest of the tables [s] |
|---|---|---|---|---|---|---|
";

/// The section of the study.
pub(super) fn section(args: &SweepArgs) -> Result<String, String> {
    let mut text = HEAD.to_owned();
    for case in CASES {
        for asked in case.asked {
            text += &line(args, case, asked)?;
        }
    }
    Ok(text)
}

fn line(args: &SweepArgs, case: &Case, asked: &str) -> Result<String, String> {
    let name = method(case.scene);
    let folder = PathBuf::from("out/study/accuracy").join(format!("{name}_{asked}"));
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let demand = ["--accuracy", asked, "--of", case.quantity, "-q", "--out"];
    let ended = Command::new(program).args(["run", case.scene]).args(demand).arg(&folder).output();
    let ended = ended.map_err(|e| format!("cannot run {}: {e}", case.scene))?;
    let text = read_text(&folder.join(REPORT_FILE))?;
    let report: Report = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let Some(record) = report.accuracy else {
        return Err(format!("{}: {}", case.scene, String::from_utf8_lossy(&ended.stderr)));
    };
    let truth = truth(args, case, &record.picked, &folder.join("true"))?;
    let seconds: f64 = record.rungs.iter().map(|r| r.seconds).sum();
    let wanted: f64 = asked.parse().map_err(|_| format!("{asked} is no number"))?;
    let rows = table::read(&Path::new("out/study").join(case.part)).map_err(|e| e.to_string())?;
    let cheapest = cheapest(&rows, case, wanted).map_or("none".to_owned(), |t| format!("{t:.3}"));
    Ok(format!(
        "| {name}, {} | {asked} | `{}` | {:.1e} | {truth:.1e} | {seconds:.3} | {cheapest} |\n",
        case.quantity,
        words(&record.picked),
        record.estimate.0
    ))
}

/// The error of what was picked.
fn truth(args: &SweepArgs, case: &Case, picked: &[(String, String)], folder: &Path) -> Result<f64, String> {
    // a table of an earlier study has runs of its own
    let _ = std::fs::remove_dir_all(folder);
    let knobs = picked.iter().map(|(n, v)| format!("{n}={v}"));
    let own = SweepArgs {
        words: std::iter::once(case.scene.to_owned()).chain(knobs).collect(),
        reference: case.reference.to_owned(),
        reference_knob: Vec::new(),
        out: folder.to_path_buf(),
        plot: false,
        study: None,
        quiet: true,
        ..args.clone()
    };
    super::run(&own)?;
    let rows = table::read(folder).map_err(|e| e.to_string())?;
    let error = rows.first().and_then(|r| r.value(&format!("error {}", case.quantity)));
    error.ok_or_else(|| format!("{}: what was picked has no error", case.scene))
}

/// The smallest time of a run of the same scene with an error as small as asked for.
fn cheapest(rows: &[Row], case: &Case, wanted: f64) -> Option<f64> {
    let error = format!("error {}", case.quantity);
    let good = |r: &&Row| r.text("scene") == case.scene && r.value(&error).is_some_and(|e| e <= wanted);
    rows.iter().filter(good).filter_map(|r| r.value("time")).min_by(f64::total_cmp)
}
