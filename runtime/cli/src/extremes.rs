//! `wfl extremes`: each parameter far from its value, in turn; what the scene then does.

use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

use serde_json::Value;
use wfl_tasks::extremes::{Ending, Job, Tried, extremes as try_extremes, summary};

use crate::{
    args::ExtremesArgs,
    console::Console,
    load::{load, out, print_all, say},
    prepared::{EXIT_ERROR, backend},
    table::{Table, number},
};

/// A value was refused, did not converge or was out of time.
const EXIT_FAILED: u8 = 2;

pub(crate) fn extremes(args: &ExtremesArgs, started: Instant) -> ExitCode {
    let Some(base) = load(&args.scene.scene, &args.scene.overrides, "extremes") else {
        return ExitCode::from(EXIT_ERROR);
    };
    let Some(backend) = backend(false) else { return ExitCode::from(EXIT_ERROR) };
    let job = Job {
        file: &args.scene.scene,
        overrides: &args.scene.overrides,
        limit: args.limit.map(Duration::from_secs_f64),
        backend: &*backend,
        listener: &Console { quiet: false },
        started,
    };
    let trials = match try_extremes(&job, &base) {
        Ok(trials) => trials,
        Err(messages) => {
            print_all(&messages, &base.sources);
            return ExitCode::from(EXIT_ERROR);
        }
    };
    let table = table(&trials);
    out(&table.text());
    out(&summary(&trials));
    if let Some(path) = &args.out
        && let Err(error) = std::fs::write(path, csv(&table))
    {
        say(&format!("error: cannot write {}: {error}\n", path.display()));
        return ExitCode::from(EXIT_ERROR);
    }
    match trials.iter().map(|tried| tried.trial.ending).min() {
        Some(Ending::SilentlyWrong) => ExitCode::from(EXIT_ERROR),
        Some(ending) if ending < Ending::Warned => ExitCode::from(EXIT_FAILED),
        _ => ExitCode::SUCCESS,
    }
}

fn table(trials: &[Tried]) -> Table {
    let mut table = Table::new("extremes", &["parameter", "value", "outcome", "steps", "iterations", "message"]);
    for Tried { parameter, value, trial } in trials {
        table.push(vec![
            parameter.clone().into(),
            if value.is_nan() { Value::Null } else { number(*value).into() },
            trial.ending.word().into(),
            trial.steps.into(),
            trial.iterations.into(),
            trial.message.clone().into(),
        ]);
    }
    table
}

/// The table as comma-separated values, texts in quotes (RFC 4180).
fn csv(table: &Table) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let mut text = table.columns.join(",") + "\n";
    for row in &table.rows {
        let cells: Vec<String> = row
            .iter()
            .map(|v| match v {
                Value::Null => String::new(),
                Value::String(s) => quoted(s),
                other => other.to_string(),
            })
            .collect();
        text += &(cells.join(",") + "\n");
    }
    text
}
