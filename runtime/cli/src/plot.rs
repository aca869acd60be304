//! `wfl plot`.

mod film;

use std::{
    io::Read as _,
    path::{Path, PathBuf},
    process::ExitCode,
};

use wfl_report::{Beside, Picture, PlotError, Request, RunFolder, StepChoice, over, plots, profile_line, sized};
use wfl_tasks::formula;

use crate::{
    args_plot::PlotArgs,
    load::{out, say},
    prepared::EXIT_ERROR,
    report::explained,
};

pub(crate) fn plot(args: &PlotArgs) -> ExitCode {
    match made(args) {
        Ok(said) => {
            out(&said);
            ExitCode::SUCCESS
        }
        Err(message) => {
            say(&message);
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// Draws and writes; says which files, or why not.
fn made(args: &PlotArgs) -> Result<String, String> {
    endings(&[(&args.png, "png"), (&args.svg, "svg"), (&args.pdf, "pdf")])?;
    let real = |folder: &PathBuf| folder.canonicalize().unwrap_or_else(|_| folder.clone());
    let twice = (1..args.folders.len()).find(|k| args.folders[..*k].iter().any(|f| real(f) == real(&args.folders[*k])));
    if let Some(k) = twice {
        return Err(format!("error: {} is named twice\n", args.folders[k].display()));
    }
    let mut runs = Vec::with_capacity(args.folders.len());
    for folder in &args.folders {
        runs.push(RunFolder::read(folder).map_err(|e| explained(&e))?);
    }
    let zoom = args.zoom.map(|z| z.0);
    if let Some(pair) = &args.over {
        let tables: Vec<&Path> = args.with.iter().map(Path::new).collect();
        let Picture { name, chart } = over(&runs, pair, &tables).map_err(|e| told(&e))?;
        return written(args, &[Picture { name, chart: sized(chart, zoom, args.width) }]);
    }
    if runs.len() > 2 {
        let help = "  = help: two folders are drawn as their difference, more with --over\n";
        return Err(format!("error: {} folders\n{help}", runs.len()));
    }
    let other = if runs.len() == 2 { runs.pop() } else { None };
    let Some(run) = runs.pop() else { return Err("error: no folder\n".to_owned()) };
    let run = if let Some(other) = other { run.minus(other) } else { run };
    let request = Request {
        field: args.field.clone(),
        step: if args.film.is_some() { StepChoice::All } else { args.step.clone() },
        warp: args.warp,
        slice: args.slice.or(args.line),
        view: args.view,
        range: args.range,
        no_mesh: args.no_mesh,
        zoom,
        width: args.width,
        beside: Vec::new(),
    };
    let beside = formulas(args, &run, &request)?;
    let request = Request { beside, ..request };
    let pictures = plots(&run, &request).map_err(|e| told(&e))?;
    match &args.film {
        Some(file) => film::write(file, &pictures, args.rate),
        None => written(args, &pictures),
    }
}

/// The formulas that are to stand beside a profile, along its line.
fn formulas(args: &PlotArgs, run: &RunFolder, request: &Request) -> Result<Vec<Beside>, String> {
    if args.with.is_empty() {
        return Ok(Vec::new());
    }
    let Some(line) = profile_line(run, request).map_err(|e| told(&e))? else {
        let help = "  = help: --line 0,0:1,0 --with \"exact(x)\"; a table stands beside --over F:d\n";
        return Err(format!("error: a formula stands beside a profile, and this picture is none\n{help}"));
    };
    let curve = |formula: &String| {
        let points =
            formula::along(run.report(), formula, line.ends, line.time).map_err(|e| format!("error: {e}\n"))?;
        Ok(Beside { name: formula.clone(), points })
    };
    args.with.iter().map(curve).collect()
}

/// Names of pictures end as their kind does.
pub(crate) fn endings(files: &[(&Option<PathBuf>, &str)]) -> Result<(), String> {
    for (file, ending) in files {
        if let Some(file) = file.as_ref().filter(|f| f.extension().is_none_or(|e| e != *ending)) {
            let (name, better) = (file.display(), file.with_extension(ending));
            let help = format!("  = help: --{ending} {}\n", better.display());
            return Err(format!("error: {name} is no name of a .{ending} file\n{help}"));
        }
    }
    Ok(())
}

/// Writes pictures; says which files, or why not.
fn written(args: &PlotArgs, pictures: &[Picture]) -> Result<String, String> {
    let mut said = String::new();
    for picture in pictures {
        for (file, kind) in files(args, picture, pictures) {
            let bytes = match kind {
                Kind::Svg => picture.chart.svg().into_bytes(),
                Kind::Png => picture.chart.png().map_err(|e| format!("error: {e}\n"))?,
                Kind::Pdf => picture.chart.pdf().map_err(|e| format!("error: {e}\n"))?,
            };
            write(&file, &bytes)?;
            said += &format!("{}\n", file.display());
        }
    }
    Ok(said)
}

#[derive(Clone, Copy)]
enum Kind {
    Png,
    Svg,
    Pdf,
}

/// Where a picture goes: the files that are named, with its own name behind if there are several; a PNG named after the
/// field in this folder if none is.
fn files(args: &PlotArgs, picture: &Picture, all: &[Picture]) -> Vec<(PathBuf, Kind)> {
    let named = |file: &Path| {
        if all.len() == 1 {
            return file.to_owned();
        }
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let ending = file.extension().unwrap_or_default().to_string_lossy();
        file.with_file_name(format!("{stem}_{}.{ending}", picture.name))
    };
    let mut files: Vec<(PathBuf, Kind)> = Vec::new();
    files.extend(args.png.iter().map(|f| (named(f), Kind::Png)));
    files.extend(args.svg.iter().map(|f| (named(f), Kind::Svg)));
    files.extend(args.pdf.iter().map(|f| (named(f), Kind::Pdf)));
    if files.is_empty() {
        files.push((PathBuf::from(format!("{}.png", picture.name)), Kind::Png));
    }
    files
}

/// Writes a picture under its name, whole or not at all. It takes the place of a picture only.
pub(crate) fn write(file: &Path, bytes: &[u8]) -> Result<(), String> {
    if std::fs::symlink_metadata(file).is_ok() && !is_picture(file) {
        return Err(format!(
            "error: {} is there already and is no picture: it stays as it is\n  = help: name another file\n",
            file.display()
        ));
    }
    replace(file, bytes)
}

/// Writes a file under its name, whole or not at all, whatever was there.
pub(crate) fn replace(file: &Path, bytes: &[u8]) -> Result<(), String> {
    let mut part = file.as_os_str().to_owned();
    part.push(format!(".{}.part", std::process::id()));
    let part = PathBuf::from(part);
    let done = std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, file));
    done.map_err(|e| {
        // what is left of it helps nobody
        let _ = std::fs::remove_file(&part);
        format!("error: cannot write {}: {e}\n", file.display())
    })
}

fn is_picture(file: &Path) -> bool {
    let mut start = Vec::new();
    let regular = std::fs::symlink_metadata(file).is_ok_and(|m| m.is_file());
    let read = regular && std::fs::File::open(file).and_then(|f| f.take(8).read_to_end(&mut start)).is_ok();
    let kinds: [&[u8]; 5] = [b"\x89PNG", b"<svg", b"GIF8", b"\x1aE\xdf\xa3", b"%PDF"];
    // the kind of an mp4 file stands behind the length of its first box
    let is_film = start.get(4..).is_some_and(|rest| rest.starts_with(b"ftyp"));
    read && (start.is_empty() || is_film || kinds.iter().any(|kind| start.starts_with(kind)))
}

fn told(error: &PlotError) -> String {
    if let PlotError::Report(error) = error {
        return explained(error);
    }
    let help = error.help();
    if help.is_empty() { format!("error: {error}\n") } else { format!("error: {error}\n  = help: {help}\n") }
}
