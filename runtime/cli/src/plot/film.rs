//! Pictures one after the other in one file: GIF by ourselves, other kinds by ffmpeg where it is installed.

use std::{
    io::Write as _,
    path::Path,
    process::{Command, Stdio},
};

use wfl_report::{Picture, film};

const INSTEAD: &str = "  = help: --film film.gif needs no other program\n";

/// Writes a film of the pictures, so many in a second; says which file, or why not.
pub(super) fn write(file: &Path, pictures: &[Picture], rate: u16) -> Result<String, String> {
    let ending = file.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
    if !["gif", "mp4", "webm"].contains(&ending.as_str()) {
        let help = format!("  = help: --film {}\n", file.with_extension("gif").display());
        return Err(format!("error: {} is no name of a .gif, .mp4 or .webm file\n{help}", file.display()));
    }
    if pictures.len() < 2 {
        let help = "  = help: a film needs several steps with `output vtk`; --png draws this one\n";
        return Err(format!("error: there is one picture\n{help}"));
    }
    let bytes = if ending == "gif" {
        let charts = pictures.iter().map(|p| p.chart.clone()).collect::<Vec<_>>();
        film(&charts, 100 / rate).map_err(|e| format!("error: {e}\n"))?
    } else {
        by_ffmpeg(&ending, pictures, rate)?
    };
    super::write(file, &bytes)?;
    Ok(format!("{}\n", file.display()))
}

/// The bytes of a film that ffmpeg makes of PNG files that it is sent.
fn by_ffmpeg(kind: &str, pictures: &[Picture], rate: u16) -> Result<Vec<u8>, String> {
    let folder = std::env::temp_dir().join(format!("wfl-film-{}", std::process::id()));
    let made = std::fs::create_dir_all(&folder).map_err(|e| format!("error: {}: {e}\n", folder.display()));
    let bytes = made.and_then(|()| {
        let file = folder.join(format!("film.{kind}"));
        encode(&file, pictures, rate)?;
        std::fs::read(&file).map_err(|e| format!("error: {}: {e}\n", file.display()))
    });
    // what is left of it helps nobody
    let _ = std::fs::remove_dir_all(&folder);
    bytes
}

fn encode(file: &Path, pictures: &[Picture], rate: u16) -> Result<(), String> {
    let rate = rate.to_string();
    // encoders of films want even numbers of pixels
    let even = "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white,format=yuv420p";
    let mut command = Command::new("ffmpeg");
    command.args(["-loglevel", "error", "-y", "-f", "image2pipe", "-framerate", &rate, "-i", "-", "-vf", even]);
    command.arg(file).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command
        .spawn()
        .map_err(|e| format!("error: ffmpeg, which writes this kind of film, cannot be started: {e}\n{INSTEAD}"))?;
    let mut input = child.stdin.take();
    for picture in pictures {
        let png = picture.chart.png().map_err(|e| format!("error: {e}\n"))?;
        // a pipe that is closed early is told by what ffmpeg says
        let sent = input.as_mut().map(|pipe| pipe.write_all(&png));
        if sent.is_some_and(|sent| sent.is_err()) {
            break;
        }
    }
    drop(input);
    let ended = child.wait_with_output().map_err(|e| format!("error: ffmpeg: {e}\n"))?;
    if ended.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&ended.stderr);
    let last = said.lines().last().unwrap_or("it says nothing");
    Err(format!("error: ffmpeg could not write the film: {last}\n{INSTEAD}"))
}
