//! What is said of a results folder that cannot be used, with its code and what to do. Does not touch the folder.

use wfl::Code;
use wfl_output::OutputError;
use wfl_run::CheckpointError;

/// What helps of every command that writes its results where it is told to.
const ELSEWHERE: &str = "write elsewhere: --out DIR";

/// The message of an error of a results folder that a command writes its results to.
#[must_use]
pub fn told(error: &OutputError) -> String {
    let Some((code, help, is_place)) = explained(error) else { return format!("error: {error}\n") };
    let help = match (help, is_place) {
        ("", _) => ELSEWHERE.to_owned(),
        (help, true) => format!("{help}, or {ELSEWHERE}"),
        (help, false) => help.to_owned(),
    };
    format!("error[{code}]: {error}\n  = help: {help}\n")
}

/// The message of an error of a folder whose run a command shows: it has no other folder to write to.
#[must_use]
pub fn told_of_showing(error: &OutputError) -> String {
    let Some((code, help, _)) = explained(error) else { return format!("error: {error}\n") };
    let help = match (error, help) {
        (OutputError::OtherKind { .. }, _) => "give the folder of a run; that of a sweep has its own page: sweep.html",
        (_, "") => "copy the folder to where files can be written",
        (_, help) => help,
    };
    format!("error[{code}]: {error}\n  = help: {help}\n")
}

/// The code of an error, what to do about it where it is (empty: nothing), and whether it helps to write elsewhere.
fn explained(error: &OutputError) -> Option<(Code, &'static str, bool)> {
    Some(match error {
        OutputError::BadName { .. } => {
            (Code::E710, "take a name that is a file name on every system, such as fields", false)
        }
        OutputError::InUse { .. } => (Code::E711, "wait until it has ended", true),
        OutputError::Foreign { .. } => (Code::E712, "move it away if it is yours, remove it if not", true),
        OutputError::OtherKind { .. } => (Code::E713, "", true),
        OutputError::Manifest { .. } => (Code::E715, "remove the folder to start from the beginning", true),
        OutputError::Damaged { .. } => (Code::E715, "without --resume the run starts from the beginning", false),
        OutputError::Input { .. } => (Code::E716, "give the output another name", true),
        OutputError::Write { .. } => (
            Code::E717,
            "files written so far are complete: free some space and continue, wfl run with --resume; wfl sweep keeps its rows, too",
            false,
        ),
        OutputError::NotADirectory { .. }
        | OutputError::CannotCreate { .. }
        | OutputError::NotWritable { .. }
        | OutputError::Remove { .. } => (Code::E717, "", true),
        OutputError::Vtu { .. } | OutputError::Time { .. } | OutputError::RowLength { .. } => return None,
    })
}

/// The message of results that a run cannot go on from.
#[must_use]
pub fn told_of_resuming(error: &CheckpointError) -> String {
    let (code, help) = match error {
        CheckpointError::Other { .. } => (Code::E714, "restore what differs, or write elsewhere: --out DIR"),
        CheckpointError::Ranks { .. } => (Code::E714, "go on with as many ranks, or run without --resume"),
        CheckpointError::Read { .. } | CheckpointError::Damaged { .. } | CheckpointError::Gone { .. } => {
            (Code::E715, "restore the file, or run without --resume")
        }
    };
    format!("error[{code}]: {error}\n  = help: {help}\n")
}

/// The message of an error of a results folder without the word `error`, see [`error_line`].
#[must_use]
pub fn told_later(error: &OutputError) -> String {
    let text = told(error);
    text.strip_prefix("error").unwrap_or(&text).trim_end().to_owned()
}

/// A message of a command; it may begin with its code in brackets.
#[must_use]
pub fn error_line(why: &str) -> String {
    if why.starts_with(['[', ':']) { format!("error{why}\n") } else { format!("error: {why}\n") }
}
