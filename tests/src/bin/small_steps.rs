//! What a small step costs: seconds and bytes a step of runs with many of them, as a table.
//!
//! `cargo build --release -p wfl-cli && cargo run --release -p wfl-tests --bin small_steps` runs the `wfl` beside it on one thread:
//! each scene with its steps and with half of them, in turn and three times. What the longer run takes more, in processor time
//! and in the largest resident size, over the steps that it has more is what a step costs (Linux only).

use std::{
    path::Path,
    process::{Command, ExitCode},
};

/// Runs of each length: the median counts.
const ROUNDS: usize = 3;

/// A row of the table.
struct Case {
    name: &'static str,
    /// Of the longer run.
    steps: usize,
    /// The scene with so many steps.
    text: fn(usize) -> String,
}

const CASES: [Case; 5] = [
    Case { name: "heat, 64 x 64 cells, linear", steps: 1000, text: heat },
    Case { name: "a string of 32 cells, Newmark, linear", steps: 80_000, text: string },
    Case { name: "pores, 12 x 12 cells, linear", steps: 1000, text: pores },
    Case { name: "a nonlinear bar of 16 cells", steps: 2000, text: nonlinear },
    Case { name: "an oscillator with an event in every step", steps: 4000, text: events },
];

fn heat(steps: usize) -> String {
    format!(
        "wfl 1\nmesh box [0,0] to [1,1] cells [64,64] tri\nunknown u : scalar\nstart u = 1\nterm storage on all : Dot_u*Test_u\n\
         term flux on all : Grad_u.Grad_Test_u\nfix u = 0 on boundary\nsteps t = 0 to {} by 0.0001\nmeasure value = integral(u) on all\n",
        steps as f64 * 1e-4
    )
}

fn string(steps: usize) -> String {
    format!(
        "wfl 1\nmesh box [0] to [1] cells [32] segment\nregion ends = faces where x == 0 or x == 1\nunknown u : scalar\n\
         start u = sin(pi*x)\nterm inertia on all : Dot2_u*Test_u\nterm stress on all : Grad_u.Grad_Test_u\nfix u = 0 on ends\n\
         steps t = 0 to {} by 0.01\nmeasure area = integral(u) on all\n",
        steps as f64 * 0.01
    )
}

fn pores(steps: usize) -> String {
    format!(
        "wfl 1\nmesh box [0,0] to [1,1] cells [12,12] tri\nregion floor = faces where y == 0\nregion top = faces where y == 1\n\
         region sides = faces where x == 0 or x == 1\nunknown u : vector P2\nunknown p : scalar\n\
         term body on all : (2*Sym(Grad_u) + Div_u*Id(2)):Grad_Test_u - p*Div_Test_u\n\
         term volume on all : (0.1*Dot_p + Div_Dot_u)*Test_p\nterm flow on all : 0.01*Grad_p.Grad_Test_p\n\
         fix u = [0,0] on floor\nfix u(1) = 0 on sides\nfix p = 0 on top\nload u = [0,-1] on top\n\
         steps t = 0 to {} by 0.001\nmeasure settled = mean(u(2)) on top\nmeasure pressure = mean(p) on floor\n",
        steps as f64 * 1e-3
    )
}

fn nonlinear(steps: usize) -> String {
    format!(
        "wfl 1\nmesh box [0] to [1] cells [16] segment\nregion left = faces where x == 0\nunknown u : scalar\n\
         term storage on all : Dot_u*Test_u\nterm flux on all : (1 + u*u)*Grad_u.Grad_Test_u\nfix u = sin(t) on left\n\
         steps t = 0 to {} by 0.01\nmeasure heat = integral(u) on all\n",
        steps as f64 * 0.01
    )
}

fn events(steps: usize) -> String {
    format!(
        "wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\nterm follow on all : (u - cos(pi*t))*Test_u\n\
         steps t = 0 to {steps} by 1\nmeasure value = mean(u) on all\nevent high = value > 0\n"
    )
}

/// Clock ticks a second in `/proc`, on every Linux (proc_pid_stat(5), USER_HZ).
const TICKS: f64 = 100.0;

/// Processor seconds of all programs that this one has started and that have ended.
fn seconds_of_children() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // behind the name, which may hold anything, the state is the first number: `cutime` and `cstime` are 13 and 14 behind it
    let numbers: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |k: usize| numbers.get(k)?.parse::<f64>().ok();
    Some((ticks(13)? + ticks(14)?) / TICKS)
}

/// Processor seconds and the largest resident size (bytes) of a run.
fn run(program: &Path, folder: &Path, text: &str) -> Result<[f64; 2], String> {
    let file = folder.join("scene.wfl");
    std::fs::write(&file, text).map_err(|e| e.to_string())?;
    let out = folder.join("out");
    let words =
        ["run".as_ref(), file.as_os_str(), "--threads".as_ref(), "1".as_ref(), "--out".as_ref(), out.as_os_str()];
    let time = || seconds_of_children().ok_or_else(|| "no processor times in /proc".to_owned());
    let before = time()?;
    let ended = Command::new(program).args(words).output().map_err(|e| e.to_string())?;
    let seconds = time()? - before;
    if !ended.status.success() {
        return Err(String::from_utf8_lossy(&ended.stderr).into_owned());
    }
    let report = std::fs::read_to_string(out.join("report.json")).map_err(|e| e.to_string())?;
    let report: serde_json::Value = serde_json::from_str(&report).map_err(|e| e.to_string())?;
    let _ = std::fs::remove_dir_all(&out);
    let bytes = report["peak_memory_bytes"].as_f64().ok_or_else(|| "the report has no memory".to_owned())?;
    Ok([seconds, bytes])
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

#[expect(clippy::print_stdout, reason = "this program prints its result")]
fn table(program: &Path, folder: &Path) -> Result<(), String> {
    println!("| scene | steps | microseconds a step | bytes a step |\n|---|---|---|---|");
    for case in &CASES {
        let (mut seconds, mut bytes) = (Vec::new(), Vec::new());
        let more = (case.steps - case.steps / 2) as f64;
        for _ in 0..ROUNDS {
            let [of_half, of_all] = [case.steps / 2, case.steps].map(|n| run(program, folder, &(case.text)(n)));
            let (half, all) = (of_half?, of_all?);
            seconds.push((all[0] - half[0]) / more);
            bytes.push((all[1] - half[1]).max(0.0) / more);
        }
        println!("| {} | {} | {:.0} | {:.0} |", case.name, case.steps, 1e6 * median(seconds), median(bytes));
    }
    Ok(())
}

fn main() -> ExitCode {
    let folder = std::env::temp_dir().join(format!("wfl-steps-{}", std::process::id()));
    let made = std::fs::create_dir_all(&folder).map_err(|e| e.to_string());
    let program = std::env::current_exe().map(|path| path.with_file_name("wfl")).map_err(|e| e.to_string());
    let result = made.and(program).and_then(|program| table(&program, &folder));
    let _ = std::fs::remove_dir_all(&folder);
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}; the command is built by: cargo build --release -p wfl-cli");
            ExitCode::FAILURE
        }
    }
}
