//! Runs many inputs of the fuzzing generator and prints one line: `fuzz 10000000` or `fuzz COUNT FIRST`, where FIRST is
//! the number of the first input; `fuzz show NUMBER` prints an input. Odd inputs are texts for the parser, even ones
//! expressions for the compiler. An input that fails, or takes longer than [`SLOW`], is printed with its number, and
//! the program ends with code 1.

use std::{
    panic::catch_unwind,
    process::ExitCode,
    sync::atomic::{AtomicU64, Ordering},
    time::{Duration, Instant},
};

use wfl_tests::fuzz::{Random, expression, run_expression, run_text, text};

/// Longer than this for one input is a failure (time of the processor where the system tells it, since a busy machine
/// makes no input slow).
const SLOW: Duration = Duration::from_secs(5);

/// The stack of the thread that reads and compiles: what threads get by default.
const STACK: usize = 2 << 20;

/// The input that is being run, for the watch.
static NUMBER: AtomicU64 = AtomicU64::new(0);

fn input(number: u64) -> (String, Option<usize>) {
    let mut random = Random(number.wrapping_mul(0x2545_f491_4f6c_dd1d));
    if number % 2 == 1 {
        return (text(&mut random), None);
    }
    let choice = random.below(36);
    (expression(&mut random), Some(choice))
}

/// Time this thread has had a processor; the time since `begin` where the system does not tell.
fn spent(begin: Instant) -> Duration {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|t| t.split_whitespace().next()?.parse().ok());
    nanoseconds.map_or_else(|| begin.elapsed(), Duration::from_nanos)
}

fn one(number: u64) -> Result<(Duration, usize), String> {
    NUMBER.store(number, Ordering::Relaxed);
    let (text, choice) = input(number);
    let begin = Instant::now();
    let before = spent(begin);
    let result = catch_unwind(|| match choice {
        None => run_text(&text),
        Some(choice) => run_expression(&text, choice),
    });
    let took = spent(begin).saturating_sub(before);
    match result {
        Err(_) => Err(format!("input {number} panics: {text:?}")),
        Ok(()) if took > SLOW => Err(format!("input {number} takes {took:.1?}: {text:?}")),
        Ok(()) => Ok((took, text.len())),
    }
}

/// Prints an input that never ends, since nothing else could.
fn watch() {
    let (mut last, mut since) = (0, Instant::now());
    loop {
        std::thread::sleep(Duration::from_secs(1));
        let now = NUMBER.load(Ordering::Relaxed);
        if now != last {
            (last, since) = (now, Instant::now());
        } else if since.elapsed() > 30 * SLOW {
            eprintln!("input {now} does not end: {:?}", input(now).0);
            std::process::exit(1);
        }
    }
}

fn main() -> ExitCode {
    let show = std::env::args().nth(1).is_some_and(|a| a == "show");
    let mut numbers = std::env::args().skip(1).filter_map(|a| a.parse::<u64>().ok());
    let count = numbers.next().unwrap_or(100_000);
    if show {
        eprintln!("{:?}", input(count));
        return ExitCode::SUCCESS;
    }
    let first = numbers.next().unwrap_or(0);
    std::thread::spawn(watch);
    let work = move || {
        let begin = Instant::now();
        let (mut failures, mut slowest, mut bytes) = (0u64, (Duration::ZERO, 0), 0);
        for number in first..first + count {
            match one(number) {
                Ok((took, length)) => {
                    slowest = slowest.max((took, number));
                    bytes += length;
                }
                Err(what) => {
                    eprintln!("{what}");
                    failures += 1;
                }
            }
            if (number + 1) % 1_000_000 == 0 {
                eprintln!("{} inputs, {failures} failures, {:.0} s", number + 1 - first, begin.elapsed().as_secs_f64());
            }
        }
        eprintln!(
            "fuzz: {count} inputs ({} texts, {} expressions), {bytes} bytes, {failures} failures, {:.0} s, slowest {:.0} ms (input {})",
            count / 2,
            count - count / 2,
            begin.elapsed().as_secs_f64(),
            1e3 * slowest.0.as_secs_f64(),
            slowest.1
        );
        failures
    };
    let thread = std::thread::Builder::new().stack_size(STACK).spawn(work);
    match thread.map(std::thread::JoinHandle::join) {
        Ok(Ok(0)) => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}
