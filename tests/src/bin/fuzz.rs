//! Runs many inputs of the fuzzing generators and prints what became of them: `fuzz 10000000` or `fuzz COUNT FIRST`, where
//! FIRST is the number of the first input; `fuzz show NUMBER` prints an input. Odd inputs are texts for the parser, even
//! ones expressions for the compiler, and one in a thousand is a whole scene that is made ready to run; for each hundred
//! there is a damaged file (a mesh, a table of values, a checkpoint, a folder of results). An input that panics, gives a
//! wrong answer or takes longer than [`SLOW`] is printed with its number, and the program ends with code 1.

use std::{
    ops::Range,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    process::ExitCode,
    sync::atomic::{AtomicU64, Ordering},
    time::{Duration, Instant},
};

use wfl_compiler::InterpreterBackend;
use wfl_output::peak_memory_bytes;
use wfl_tests::{
    fuzz::{
        Random, expression,
        files::{Files, KINDS},
        run_expression, run_text, text,
    },
    mutants::{Seed, mutant, ready, seeds},
};

/// Longer than this for one input is a failure (time of the processor where the system tells it, since a busy machine
/// makes no input slow).
const SLOW: Duration = Duration::from_secs(10);
/// The stack of the threads that read and compile: what threads get by default.
const STACK: usize = 2 << 20;
/// Threads at once.
const WORKERS: usize = 2;
/// One input in so many is a whole scene.
const SCENES: u64 = 1000;
/// Inputs for each damaged file.
const FILES: u64 = 100;
/// What the process may take: an input that asks for more is refused with E606.
const MEMORY: u64 = 1 << 30;

/// The inputs that are being run, for the watch.
static RUNNING: [AtomicU64; WORKERS] = [const { AtomicU64::new(u64::MAX) }; WORKERS];

/// An input of the parser, the compiler or the whole way to a problem.
enum Input {
    Text(String),
    Expression(String, usize),
    Scene(Box<wfl_tests::mutants::Mutant>),
}

fn input(number: u64, seeds: &[Seed]) -> Input {
    let mut random = Random(number.wrapping_mul(0x2545_f491_4f6c_dd1d));
    if number % SCENES == SCENES - 1 {
        return Input::Scene(Box::new(mutant(seeds, number)));
    }
    if number % 2 == 1 {
        return Input::Text(text(&mut random));
    }
    let choice = random.below(36);
    Input::Expression(expression(&mut random), choice)
}

fn shown(input: &Input) -> String {
    match input {
        Input::Text(text) | Input::Expression(text, _) => format!("{text:?}"),
        Input::Scene(mutant) => mutant.text(),
    }
}

/// Time this thread has had a processor; the time since `begin` where the system does not tell.
fn spent(begin: Instant) -> Duration {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|t| t.split_whitespace().next()?.parse().ok());
    nanoseconds.map_or_else(|| begin.elapsed(), Duration::from_nanos)
}

/// Runs one input; its time, or what is wrong.
fn timed(run: impl FnOnce() -> Result<(), String>) -> Result<Duration, String> {
    let begin = Instant::now();
    let before = spent(begin);
    let result = catch_unwind(AssertUnwindSafe(run));
    let took = spent(begin).saturating_sub(before);
    match result {
        Err(_) => Err("panics".to_owned()),
        Ok(Err(wrong)) => Err(wrong),
        Ok(Ok(())) if took > SLOW => Err(format!("takes {took:.1?}")),
        Ok(Ok(())) => Ok(took),
    }
}

/// Prints an input that never ends, since nothing else could.
fn watch() {
    let mut last = [(u64::MAX, Instant::now()); WORKERS];
    loop {
        std::thread::sleep(Duration::from_secs(1));
        for (running, last) in RUNNING.iter().zip(&mut last) {
            let now = running.load(Ordering::Relaxed);
            if now != last.0 || now == u64::MAX {
                *last = (now, Instant::now());
            } else if last.1.elapsed() > 30 * SLOW {
                eprintln!("input {now} does not end");
                std::process::exit(1);
            }
        }
    }
}

/// Counts of one worker, or of all.
#[derive(Default)]
struct Tally {
    failures: u64,
    bytes: usize,
    inputs: [u64; 3],
    /// By kind of file: damaged, and of these taken.
    files: [[u64; 2]; KINDS.len()],
    slowest: (Duration, String),
}

impl Tally {
    fn took(&mut self, time: Duration, name: impl FnOnce() -> String) {
        if time > self.slowest.0 {
            self.slowest = (time, name());
        }
    }

    fn add(&mut self, other: Tally) {
        self.failures += other.failures;
        self.bytes += other.bytes;
        self.inputs.iter_mut().zip(other.inputs).for_each(|(a, b)| *a += b);
        self.files.iter_mut().flatten().zip(other.files.iter().flatten()).for_each(|(a, b)| *a += b);
        self.took(other.slowest.0, || other.slowest.1);
    }

    fn text(&mut self, number: u64, seeds: &[Seed]) {
        let input = input(number, seeds);
        let kind = match &input {
            Input::Text(_) => 0,
            Input::Expression(..) => 1,
            Input::Scene(_) => 2,
        };
        self.inputs[kind] += 1;
        let result = timed(|| {
            match &input {
                Input::Text(text) => run_text(text),
                Input::Expression(text, choice) => run_expression(text, *choice),
                Input::Scene(mutant) => drop(ready(mutant, &InterpreterBackend, &[])),
            }
            Ok(())
        });
        match result {
            Ok(time) => {
                self.bytes += match &input {
                    Input::Text(text) | Input::Expression(text, _) => text.len(),
                    Input::Scene(mutant) => mutant.text().len(),
                };
                self.took(time, || format!("input {number}"));
            }
            Err(what) => {
                eprintln!("input {number} {what}: {}", shown(&input));
                self.failures += 1;
            }
        }
    }

    fn file(&mut self, number: u64, files: &Files, folder: &Path) {
        let mut found = None;
        let result = timed(|| {
            found = Some(files.try_one(number, folder)?);
            Ok(())
        });
        match (result, found) {
            (Ok(time), Some((kind, taken))) => {
                self.files[kind][0] += 1;
                self.files[kind][1] += u64::from(taken);
                self.took(time, || format!("file {number}"));
            }
            (result, _) => {
                eprintln!("file {number} {}", result.err().unwrap_or_default());
                self.failures += 1;
            }
        }
    }
}

/// The inputs of these numbers and the files that belong to them.
fn work(worker: usize, next: &AtomicU64, numbers: Range<u64>, seeds: &[Seed], files: &Files) -> Tally {
    let folder = std::env::temp_dir().join(format!("wfl-fuzz-{}-{worker}", std::process::id()));
    let mut tally = Tally::default();
    loop {
        let number = next.fetch_add(1, Ordering::Relaxed);
        if number >= numbers.end {
            break;
        }
        RUNNING[worker].store(number, Ordering::Relaxed);
        tally.text(number, seeds);
        if number.is_multiple_of(FILES) {
            tally.file(number / FILES, files, &folder);
        }
        if (number + 1).is_multiple_of(1_000_000) {
            eprintln!("{} inputs", number + 1 - numbers.start);
        }
    }
    RUNNING[worker].store(u64::MAX, Ordering::Relaxed);
    let _ = std::fs::remove_dir_all(folder);
    tally
}

fn tell(tally: &Tally, begin: Instant) {
    let [texts, expressions, scenes] = tally.inputs;
    eprintln!("fuzz: {texts} texts, {expressions} expressions, {scenes} scenes, {} bytes", tally.bytes);
    for (kind, [damaged, taken]) in KINDS.iter().zip(tally.files) {
        eprintln!("  {damaged} damaged {kind}, {taken} taken, the others refused");
    }
    let memory = peak_memory_bytes().map_or_else(|| "unknown".to_owned(), |b| format!("{} MB", b >> 20));
    eprintln!(
        "  {} failures, {:.0} s, peak memory {memory}, slowest {:.0} ms ({})",
        tally.failures,
        begin.elapsed().as_secs_f64(),
        1e3 * tally.slowest.0.as_secs_f64(),
        tally.slowest.1
    );
}

fn main() -> ExitCode {
    let show = std::env::args().nth(1).is_some_and(|a| a == "show");
    let mut numbers = std::env::args().skip(1).filter_map(|a| a.replace('_', "").parse::<u64>().ok());
    let count = numbers.next().unwrap_or(100_000);
    let seeds = seeds();
    if show {
        eprintln!("{}", shown(&input(count, &seeds)));
        return ExitCode::SUCCESS;
    }
    wfl_host::memory::set_limit(MEMORY);
    let first = numbers.next().unwrap_or(0);
    // the inputs that panic are told with their numbers
    std::panic::set_hook(Box::new(|_| {}));
    let folder = std::env::temp_dir().join(format!("wfl-fuzz-{}", std::process::id()));
    let files = match Files::new(&folder) {
        Ok(files) => files,
        Err(error) => {
            eprintln!("fuzz: {error}");
            return ExitCode::FAILURE;
        }
    };
    let _ = std::fs::remove_dir_all(folder);
    std::thread::spawn(watch);
    let (begin, next, mut tally) = (Instant::now(), AtomicU64::new(first), Tally::default());
    let whole = std::thread::scope(|scope| {
        let one = |worker: usize| {
            let (next, seeds, files) = (&next, &seeds, &files);
            let body = move || work(worker, next, first..first + count, seeds, files);
            std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, body)
        };
        let workers: Vec<_> = (0..WORKERS).map(one).collect();
        workers.into_iter().map(|w| w.ok()?.join().ok()).collect::<Option<Vec<Tally>>>()
    });
    let Some(parts) = whole else {
        eprintln!("fuzz: a thread ended before its time");
        return ExitCode::FAILURE;
    };
    parts.into_iter().for_each(|part| tally.add(part));
    tell(&tally, begin);
    if tally.failures == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
