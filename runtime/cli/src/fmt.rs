//! `wfl fmt`.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
    process::ExitCode,
};

use wfl::SourceMap;
use wfl_host::input::InputKind;
use wfl_tasks::scene_file::read_text;

use crate::{
    args::FmtArgs,
    load::{out, print_all, say},
    prepared::EXIT_ERROR,
};

pub(crate) fn fmt(args: &FmtArgs) -> ExitCode {
    let mut good = true;
    for file in &args.files {
        good &= one(file, args.check);
    }
    if good { ExitCode::SUCCESS } else { ExitCode::from(EXIT_ERROR) }
}

/// False if the file cannot be formatted, or would change under `--check`.
fn one(file: &Path, check: bool) -> bool {
    let text = match read_text(file, InputKind::Scene) {
        Ok(text) => text,
        Err(why) => {
            say(&format!("error: cannot read {}: {why}\n", file.display()));
            return false;
        }
    };
    let mut sources = SourceMap::new();
    let id = sources.add(file.display().to_string(), text.as_str());
    let formatted = wfl::format(&sources, id);
    print_all(&formatted.diagnostics, &sources);
    let Some(new) = formatted.value else { return false };
    if new == text {
        return true;
    }
    if check {
        out(&format!("{} would change\n", file.display()));
        return false;
    }
    match replace(file, &new) {
        Ok(()) => true,
        Err(e) => {
            say(&format!("error: cannot write {}: {e}\n", file.display()));
            false
        }
    }
}

/// Writes beside the file and moves it over, so that an interruption leaves the old text or the new one.
fn replace(file: &Path, text: &str) -> std::io::Result<()> {
    // the file behind a link, not the link
    let file = std::fs::canonicalize(file)?;
    let mut name = file.as_os_str().to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = PathBuf::from(name);
    let written = (|| {
        let mut new = std::fs::File::create_new(&temporary)?;
        new.set_permissions(std::fs::metadata(&file)?.permissions())?;
        new.write_all(text.as_bytes())?;
        new.sync_all()?;
        std::fs::rename(&temporary, &file)
    })();
    if written.is_err() {
        // the error of the writing is what matters
        let _ = std::fs::remove_file(&temporary);
    }
    written
}
