//! What is said of a results folder that cannot be used, with its code and what to do. Does not touch the folder.

use wfl::Code;
use wfl_output::OutputError;
use wfl_run::CheckpointError;

/// The message of an error of a results folder.
#[must_use]
pub fn told(error: &OutputError) -> String {
    let (code, help) = match error {
        OutputError::BadName { .. } => (Code::E710, "take a name that is a file name on every system, such as fields"),
        OutputError::InUse { .. } => (Code::E711, "wait until it has ended, or write elsewhere: --out DIR"),
        OutputError::Foreign { .. } => {
            (Code::E712, "move it away if it is yours, remove it if not, or write elsewhere: --out DIR")
        }
        OutputError::OtherKind { .. } => (Code::E713, "write elsewhere: --out DIR"),
        OutputError::Manifest { .. } => {
            (Code::E715, "remove the folder to start from the beginning, or write elsewhere: --out DIR")
        }
        OutputError::Damaged { .. } => (Code::E715, "without --resume the run starts from the beginning"),
        OutputError::Input { .. } => (Code::E716, "give the output another name, or write elsewhere: --out DIR"),
        OutputError::Write { .. } => (
            Code::E717,
            "files written so far are complete: free some space and continue, wfl run with --resume; wfl sweep keeps its rows, too",
        ),
        OutputError::NotADirectory { .. }
        | OutputError::CannotCreate { .. }
        | OutputError::NotWritable { .. }
        | OutputError::Remove { .. } => (Code::E717, "write elsewhere: --out DIR"),
        OutputError::Vtu { .. } | OutputError::Time { .. } | OutputError::RowLength { .. } => {
            return format!("error: {error}\n");
        }
    };
    format!("error[{code}]: {error}\n  = help: {help}\n")
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
