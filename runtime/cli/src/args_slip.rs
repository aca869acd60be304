//! A command line that cannot be read: what was meant, where that can be seen, and what to type.

use clap::{CommandFactory, Error, error::ErrorKind};
use wfl::nearest;

use crate::args::Args;

/// Commands that take a scene and values of its params.
const WITH_VALUES: &[&str] = &["run", "check", "show", "verify", "extremes", "sweep"];

/// What people type for a command that is called otherwise here.
const OTHERWISE: &[(&[&str], &str)] = &[
    (&["solve", "simulate", "execute", "exec", "start", "compute", "go"], "run"),
    (&["lint", "validate", "test", "info", "inspect"], "check"),
    (&["format", "prettify", "pretty"], "fmt"),
    (&["plot", "visualize", "visualise", "view", "post", "html"], "report"),
    (&["convert", "translate"], "import"),
    (&["doc", "docs", "why", "error"], "explain"),
    (&["study", "batch", "scan", "convergence"], "sweep"),
    (&["compile", "dump", "print", "ast"], "show"),
    (&["init", "create", "template", "scaffold"], "new"),
];

/// What other programs call an option that has another name here.
const OPTIONS_OTHERWISE: &[(&[&str], &str)] = &[
    (&["output", "outdir", "out-dir", "output-dir", "directory", "dir", "folder"], "out"),
    (&["jobs", "cores", "procs", "nthreads", "num-threads", "omp"], "threads"),
    (&["silent"], "quiet"),
    (&["restart", "continue"], "resume"),
    (&["solver", "linear-solver"], "backend"),
    (&["max-memory", "mem"], "memory"),
];

/// The message for a command line that was refused, with what to type in place of it.
pub(crate) fn told(error: &Error, words: &[String]) -> String {
    let told = match error.kind() {
        ErrorKind::InvalidSubcommand => words.first().map(|first| command(first, words)),
        ErrorKind::UnknownArgument => value_as_option(words),
        _ => None,
    };
    told.unwrap_or_else(|| {
        // a hint at `--` helps nobody who meant an option
        let text = error.render().to_string();
        let kept = text.split("\n\n").filter(|part| !part.contains("to pass '") || !part.contains("as a value"));
        kept.collect::<Vec<_>>().join("\n\n")
    })
}

fn command(first: &str, words: &[String]) -> String {
    let rest = words[1..].join(" ");
    let typed = |command: &str, rest: &str| format!("wfl {command} {rest}").trim_end().to_owned();
    if first.ends_with(".wfl") || std::path::Path::new(first).is_file() {
        let run = typed("run", &words.join(" "));
        return format!("error: a command is missing before the scene `{first}`\n  = help: {run}\n");
    }
    let known: Vec<String> = Args::command().get_subcommands().map(|c| c.get_name().to_owned()).collect();
    let other = OTHERWISE.iter().find(|(words, _)| words.contains(&first)).map(|(_, command)| *command);
    let starts: Vec<&String> = known.iter().filter(|k| !first.is_empty() && k.starts_with(first)).collect();
    let begun = if let [one] = starts.as_slice() { Some(one.as_str()) } else { None };
    let meant = other.or(begun).or_else(|| nearest(first, known.iter().map(String::as_str)));
    let help = match meant {
        Some(meant) => typed(meant, &rest),
        None => format!("wfl run SCENE; the commands are {}", known.join(", ")),
    };
    format!("error: `{first}` is not a command of wfl\n  = help: {help}\n")
}

/// `--gamma 3` and `--gamma=3` where `gamma=3` is meant: an option that the command does not have.
fn value_as_option(words: &[String]) -> Option<String> {
    let command = words.iter().find(|w| WITH_VALUES.contains(&w.as_str()))?;
    let known = Args::command();
    let options: Vec<String> = known
        .get_subcommands()
        .filter(|c| c.get_name() == command)
        .flat_map(clap::Command::get_arguments)
        .chain(known.get_arguments())
        .filter_map(|a| a.get_long().map(str::to_owned))
        .collect();
    let unknown = |w: &&String| {
        let name = w.trim_start_matches('-').split('=').next().unwrap_or("");
        w.starts_with("--")
            && name.starts_with(|c: char| c.is_ascii_alphabetic())
            && !options.iter().any(|o| o == name)
            && !["help", "version"].contains(&name)
    };
    let at = words.iter().position(|w| unknown(&w))?;
    let bare = words[at].trim_start_matches('-');
    let (name, value) = match bare.split_once('=') {
        Some((name, value)) => (name, Some(value)),
        None => (bare, words.get(at + 1).map(String::as_str).filter(|v| !v.ends_with(".wfl"))),
    };
    let other = OPTIONS_OTHERWISE.iter().find(|(words, own)| words.contains(&name) && options.iter().any(|o| o == own));
    if let Some((_, own)) = other {
        let typed =
            words.iter().enumerate().map(|(k, word)| if k == at { word.replacen(name, own, 1) } else { word.clone() });
        let line: Vec<String> = typed.collect();
        return Some(format!(
            "error: `{command}` has no option `--{name}`: it is `--{own}`\n  = help: wfl {}\n",
            line.join(" ")
        ));
    }
    let near = nearest(name, options.iter().map(String::as_str))
        .map_or_else(String::new, |n| format!("; the nearest option is --{n}"));
    let mut line: Vec<String> = words[..at].to_vec();
    line.push(match value {
        // `--param gamma=3`
        Some(pair) if pair.contains('=') => pair.to_owned(),
        _ => format!("{}={}", name.replace('-', "_"), value.unwrap_or("VALUE")),
    });
    let behind = if bare.contains('=') || value.is_none() { at + 1 } else { at + 2 };
    line.extend(words.iter().skip(behind).cloned());
    Some(format!(
        "error: `{command}` has no option `--{name}`{near}\n  = help: the value of a param is given without `--`: wfl {}\n",
        line.join(" ")
    ))
}
