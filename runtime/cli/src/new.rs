//! `wfl new`: a commented scene to start from.

use std::{
    fmt::Write as _,
    io::{ErrorKind, Write as _},
    path::{Path, PathBuf},
    process::ExitCode,
};

use wfl::{TEMPLATES, Template, nearest};

use crate::{
    args::NewArgs,
    load::{out, say},
    prepared::EXIT_ERROR,
};

pub(crate) fn new(args: &NewArgs) -> ExitCode {
    let Some(kind) = &args.kind else {
        out(&kinds());
        return ExitCode::SUCCESS;
    };
    let Some(template) = TEMPLATES.iter().find(|t| t.kind == kind) else {
        let near = nearest(kind, TEMPLATES.iter().map(|t| t.kind));
        let near = near.map_or_else(String::new, |n| format!("\n  = help: wfl new {n}"));
        say(&format!("error: there is no scene `{kind}` to start from{near}\n\n{}", kinds()));
        return ExitCode::from(EXIT_ERROR);
    };
    let file = args.file.clone().unwrap_or_else(|| PathBuf::from(format!("{kind}.wfl")));
    match written(&file, template) {
        Ok(()) => {
            out(&format!("{}: {}\n  wfl run {}\n", file.display(), template.title, file.display()));
            ExitCode::SUCCESS
        }
        Err(why) => {
            say(&format!("error: {why}\n"));
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// All kinds, a line each.
fn kinds() -> String {
    let width = TEMPLATES.iter().map(|t| t.kind.len()).max().unwrap_or(0);
    let mut text = "Scenes to start from:\n".to_owned();
    for t in TEMPLATES {
        let _ = writeln!(text, "  {:width$}  {}", t.kind, t.title);
    }
    text
}

/// Writes the scene to a file that is not there yet.
fn written(file: &Path, template: &Template) -> Result<(), String> {
    let name = file.display();
    if file.extension().is_none_or(|e| e != "wfl") {
        return Err(format!("a scene is a .wfl file\n  = help: wfl new {} {name}.wfl", template.kind));
    }
    let made = std::fs::File::create_new(file).and_then(|mut f| f.write_all(template.text.as_bytes()));
    made.map_err(|e| match e.kind() {
        ErrorKind::AlreadyExists => {
            format!(
                "{name} is there already and stays as it is\n  = help: name another file: wfl new {} NAME.wfl",
                template.kind
            )
        }
        _ => format!("cannot write {name}: {e}"),
    })
}
