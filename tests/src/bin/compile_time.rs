//! From text to callable kernels: `cargo run --release -p wfl-tests --bin compile_time` prints the median of each scene.
//!
//! Counted are parsing, names, units, typing, derivatives, kernels and machine code of everything in the scene, outputs
//! included; not counted are mesh, regions and dofs.

use std::{io::Write as _, time::Instant};

use wfl::{Loader, SourceId, SourceMap, resolve};
use wfl_jit::JitBackend;
use wfl_problem::prepare;
use wfl_tests::examples;

const SCENES: [&str; 6] = [
    "fault/nitsche.wfl",
    "fault/penalty.wfl",
    "fault/augmented_lagrangian.wfl",
    "hyperelastic/contact.wfl",
    "crack/compression.wfl",
    "hertz/hertz.wfl",
];
const ROUNDS: usize = 15;

struct Files;

impl Loader for Files {
    fn load(&mut self, path: &str, from: SourceId) -> Result<(String, String), wfl::Unloaded> {
        let _ = from;
        let full = examples().join("fault").join(path);
        std::fs::read_to_string(&full).map(|t| (full.display().to_string(), t)).map_err(|e| e.to_string().into())
    }
}

fn main() -> std::process::ExitCode {
    let mut out = std::io::stdout().lock();
    let Ok(backend) = JitBackend::new() else { return std::process::ExitCode::FAILURE };
    let _ = writeln!(out, "milliseconds from text to kernels, median of {ROUNDS}\n");
    let _ = writeln!(out, "| scene | parse | compile | together |\n|---|---|---|---|");
    for scene in SCENES {
        let path = examples().join(scene);
        let Ok(text) = std::fs::read_to_string(&path) else { return std::process::ExitCode::FAILURE };
        let folder = path.parent().unwrap_or(&path);
        let mut times: Vec<(f64, f64)> = Vec::new();
        for _ in 0..ROUNDS {
            let begin = Instant::now();
            let mut sources = SourceMap::new();
            let main = sources.add(scene, text.clone());
            let Some(script) = resolve(&mut sources, main, &mut Files, &[]).value else {
                return std::process::ExitCode::FAILURE;
            };
            let parse = begin.elapsed().as_secs_f64();
            let Some(made) = prepare(&script, folder, &backend).scene else { return std::process::ExitCode::FAILURE };
            times.push((1e3 * parse, 1e3 * made.times.compile));
        }
        let median = |pick: &dyn Fn(&(f64, f64)) -> f64| {
            let mut list: Vec<f64> = times.iter().map(pick).collect();
            list.sort_by(f64::total_cmp);
            list[ROUNDS / 2]
        };
        let (parse, compile, both) = (median(&|t| t.0), median(&|t| t.1), median(&|t| t.0 + t.1));
        let _ = writeln!(out, "| {scene} | {parse:.1} | {compile:.1} | {both:.1} |");
    }
    std::process::ExitCode::SUCCESS
}
