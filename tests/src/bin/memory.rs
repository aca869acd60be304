//! What runs take of the memory that they may have: a table, and exit code 1 where one took more.
//!
//! `cargo build --release -p wfl-cli && cargo run --release -p wfl-tests --bin memory` runs the `wfl` beside it on scenes
//! of all kinds, each under several limits. Each run must end with its result or with E606, and its largest resident
//! size must stay within the limit. The size is that which the system keeps (Linux only), read each millisecond.

use std::{
    io::Read as _,
    path::{Path, PathBuf},
    process::{Child, Command, ExitCode, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use wfl_tests::examples;

/// Limits in MB, as they are given.
const LIMITS: [u64; 4] = [40, 80, 160, 320];
/// What the resident size may be above the limit: what is taken between two looks of a millisecond.
const ABOVE: u64 = 12_000_000;
/// No run is waited for longer: one that goes on so long within its limit is a good one.
const LONGEST: Duration = Duration::from_secs(60);

/// A command and a scene with its settings.
const SCENES: &[(&str, &[&str])] = &[
    ("fault/nitsche.wfl", &["cells=24"]),
    ("fault/penalty.wfl", &["cells=32"]),
    ("fault/augmented_lagrangian.wfl", &["cells=24"]),
    ("fault/nitsche.wfl", &["cells=12", "degree=2"]),
    ("fault_gmsh/fault_30deg.wfl", &[]),
    ("fault_gmsh/fault_2deg.wfl", &[]),
    ("hertz/hertz.wfl", &["refine=4"]),
    ("hertz/sphere.wfl", &["n=24"]),
    ("signorini/signorini.wfl", &["n=400"]),
    ("friction/tresca.wfl", &["refine=6"]),
    ("hyperelastic/shear.wfl", &["n=90"]),
    ("hyperelastic/contact.wfl", &["cells=16"]),
    ("stokes/stokes.wfl", &["refine=16"]),
    ("heat/heat.wfl", &["refine=16"]),
    ("mapping/pressed.wfl", &["degree=2"]),
    ("mapping/periodic.wfl", &["refine=16"]),
    ("crack/compression.wfl", &["refine=8"]),
    ("dg/poisson.wfl", &["refine=16"]),
    ("plaplace/plaplace.wfl", &["refine=32"]),
    ("plasticity/perzyna.wfl", &["refine=16"]),
    ("poisson/poisson.wfl", &["n=700"]),
    ("elasticity/block.wfl", &["refine=8"]),
    ("elasticity/block.wfl", &["refine=4", "degree=2"]),
];

/// Blocks of first and second degree: name, cells and unknown.
const BLOCKS: [(&str, &str, &str); 4] = [
    ("P1 block 30", "[30,30,30] tet", "vector"),
    ("Q1 block 40", "[40,40,40] hex", "vector"),
    ("P2 block 20", "[20,20,20] tet", "vector P2"),
    ("Q2 block 14", "[14,14,14] hex", "vector Q2"),
];

fn block(cells: &str, unknown: &str) -> String {
    format!(
        "wfl 1\nmesh box [0,0,0] to [1,1,1] cells {cells}\nregion west = faces where x == 0\nunknown u : {unknown}\n\
         term bulk on all : (Id(3)*Trace(Grad_u) + Grad_u + Grad_u'):Grad_Test_u\nfix u = [0,0,0] on west\nload u = [0,0,-1] on all\n"
    )
}

/// How a run ended.
struct Ended {
    code: Option<i32>,
    peak: u64,
    told: String,
}

impl Ended {
    fn words(&self, limit: u64) -> (String, bool) {
        let good = match self.code {
            // E603 and E604 are results: a coarse mesh need not meet what a scene expects
            Some(0 | 2 | 3) | None => true,
            Some(1) => self.told.contains("error[E606]"),
            Some(_) => false,
        };
        let within = self.peak <= limit + ABOVE;
        let size = self.peak as f64 / 1e6;
        let word = match self.code {
            Some(0 | 2 | 3) => "solved",
            None => "goes on",
            Some(1) if good => "E606",
            _ => "FAILED",
        };
        (format!("{word} {size:.0}{}", if within { "" } else { " ABOVE" }), good && within)
    }
}

fn run(program: &Path, scene: &Path, settings: &[&str], limit: u64, out: &Path) -> std::io::Result<Ended> {
    let mut command = Command::new(program);
    command.arg("run").arg(scene).args(settings).arg("--out").arg(out).arg("--quiet");
    command.arg("--memory").arg(format!("{limit}B"));
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn()?;
    let (code, peak) = followed(&mut child)?;
    let mut told = String::new();
    if let Some(mut stderr) = child.stderr.take() {
        stderr.read_to_string(&mut told)?;
    }
    Ok(Ended { code, peak, told })
}

/// Exit code, `None` for a run that was ended for its time, and largest resident size.
fn followed(child: &mut Child) -> std::io::Result<(Option<i32>, u64)> {
    let (begin, status, mut peak) = (Instant::now(), format!("/proc/{}/status", child.id()), 0);
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let size = text.lines().find_map(|l| l.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse::<u64>().ok());
        peak = peak.max(size.unwrap_or(0) * 1024);
        if let Some(status) = child.try_wait()? {
            return Ok((Some(status.code().unwrap_or(-1)), peak));
        }
        if begin.elapsed() > LONGEST {
            child.kill()?;
            child.wait()?;
            return Ok((None, peak));
        }
        sleep(Duration::from_millis(1));
    }
}

#[expect(clippy::print_stdout, reason = "this program prints its result")]
fn all(program: &Path, folder: &Path) -> std::io::Result<bool> {
    let mut scenes: Vec<(String, PathBuf, &[&str])> = Vec::new();
    for one in BLOCKS {
        let file = folder.join(format!("{}.wfl", one.0.replace(' ', "_")));
        std::fs::write(&file, block(one.1, one.2))?;
        scenes.push((one.0.to_owned(), file, &[]));
    }
    for (name, settings) in SCENES {
        scenes.push((format!("{name} {}", settings.join(" ")), examples().join(name), settings));
    }
    let head: Vec<String> = LIMITS.iter().map(|limit| format!("{limit} MB")).collect();
    println!("| scene | {} |\n|---|{}", head.join(" | "), "---|".repeat(LIMITS.len()));
    let mut good = true;
    for (name, file, settings) in &scenes {
        let mut row = Vec::new();
        for limit in LIMITS {
            let ended = run(program, file, settings, limit * 1_000_000, &folder.join("out"))?;
            let (words, fine) = ended.words(limit * 1_000_000);
            row.push(words);
            if !fine {
                good = false;
                eprintln!("{name} at {limit} MB, exit code {:?}:\n{}", ended.code, ended.told);
            }
        }
        println!("| {name} | {} |", row.join(" | "));
    }
    Ok(good)
}

fn main() -> ExitCode {
    let folder = std::env::temp_dir().join(format!("wfl-memory-{}", std::process::id()));
    let program = std::env::current_exe().map(|path| path.with_file_name("wfl"));
    let made = std::fs::create_dir_all(&folder);
    let good = program.and_then(|program| made.and_then(|()| all(&program, &folder)));
    let _ = std::fs::remove_dir_all(&folder);
    match good {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}; the command is built by: cargo build --release -p wfl-cli");
            ExitCode::FAILURE
        }
    }
}
