//! Runs mutated examples under the oracle of `wfl_tests::mutants` and prints what became of them:
//! `mutants COUNT [FIRST]`; `mutants show NUMBER` prints one and its verdict, `mutants seeds` the
//! verdicts of the examples they are made from. Mutants on which the oracle disagrees, that
//! panic or that take longer than [`LIMIT`] are written to `out/mutants/`, and the program ends with code 1.

use std::{
    collections::BTreeMap,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    process::ExitCode,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    time::{Duration, Instant},
};

use wfl_tests::mutants::{Mutant, Seed, Verdict, judge, mutant, seeds};

/// No mutant takes longer: time of the processors, since a busy machine makes no mutant slow.
const LIMIT: Duration = Duration::from_secs(10);
/// Memory of the process, so that a mutant with a million cells is refused and not solved.
const MEMORY: u64 = 2 << 30;
/// Where mutants with a fault are written.
const FOLDER: &str = "out/mutants";
/// Mutants at once.
const WORKERS: usize = 2;

/// What a worker tells: the number of a mutant that begins, or its verdict.
enum Told {
    Begins(u64),
    Ends(u64, Option<Verdict>),
}

/// Works until the numbers are used up. A worker that hangs is left alone, and another one takes its place.
fn work(seeds: &Arc<Vec<Seed>>, next: &Arc<AtomicU64>, end: u64, told: Sender<Told>) {
    let (seeds, next) = (seeds.clone(), next.clone());
    let body = move || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= end || told.send(Told::Begins(number)).is_err() {
                return;
            }
            let out = std::env::temp_dir().join(format!("wfl-mutant-{}-{number}", std::process::id()));
            let verdict = catch_unwind(AssertUnwindSafe(|| judge(&mutant(&seeds, number), Some(out.clone())))).ok();
            let _ = std::fs::remove_dir_all(&out);
            if told.send(Told::Ends(number, verdict)).is_err() {
                return;
            }
        }
    };
    let started = std::thread::Builder::new().stack_size(16 << 20).spawn(body);
    if let Err(error) = started {
        eprintln!("no thread: {error}");
    }
}

/// Seconds that all threads of this process have had a processor; `None` where the system does not tell.
fn spent() -> Option<Duration> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // behind the name in brackets come the fields from the third on; 14 and 15 are the times, in hundredths of a second
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let hundredths: u64 = fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?;
    Some(Duration::from_millis(10 * hundredths))
}

/// Counts by kind, and by code.
#[derive(Default)]
struct Tally {
    counts: BTreeMap<&'static str, u64>,
    codes: BTreeMap<String, u64>,
    /// Not yet written.
    failures: Vec<(u64, String)>,
    kept: u64,
    slowest: (Duration, u64),
}

impl Tally {
    fn add(&mut self, number: u64, took: Duration, verdict: Option<Verdict>) {
        if took > self.slowest.0 {
            self.slowest = (took, number);
        }
        let (kind, code) = match verdict {
            Some(Verdict::Refused(code)) => ("refused", Some(code)),
            Some(Verdict::Warned(code)) => ("warned", Some(code)),
            Some(Verdict::NotConverged) => ("not converged", None),
            Some(Verdict::Agreed) => ("solved and agreed", None),
            Some(Verdict::Disagrees(why)) => {
                self.failures.push((number, why.join("\n")));
                ("disagreements", None)
            }
            None => {
                self.failures.push((number, "panics".to_owned()));
                ("panics", None)
            }
        };
        *self.counts.entry(kind).or_default() += 1;
        if let Some(code) = code {
            *self.codes.entry(format!("{kind} {code}")).or_default() += 1;
        }
    }

    fn hang(&mut self, number: u64) {
        *self.counts.entry("hangs").or_default() += 1;
        self.failures.push((number, format!("takes longer than {} s", LIMIT.as_secs())));
    }
}

/// Runs the mutants `first..end`; those that fail are written as they are found.
fn all(seeds: Vec<Seed>, first: u64, end: u64) -> Tally {
    let seeds = Arc::new(seeds);
    let next = Arc::new(AtomicU64::new(first));
    let (sender, receiver): (Sender<Told>, Receiver<Told>) = channel();
    (0..WORKERS).for_each(|_| work(&seeds, &next, end, sender.clone()));
    let mut running: BTreeMap<u64, (Instant, Option<Duration>)> = BTreeMap::new();
    let (mut tally, mut ended) = (Tally::default(), 0);
    while ended < end - first {
        match receiver.recv_timeout(Duration::from_secs(1)) {
            Ok(Told::Begins(number)) => drop(running.insert(number, (Instant::now(), spent()))),
            Ok(Told::Ends(number, verdict)) => {
                // a verdict after the limit has been counted as a hang
                if let Some((begin, _)) = running.remove(&number) {
                    tally.add(number, begin.elapsed(), verdict);
                    ended += 1;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        // while a mutant takes its time the other workers take theirs
        let (now, limit) = (spent(), LIMIT * u32::try_from(WORKERS).unwrap_or(1));
        let late = running.iter().filter(|(_, (begin, before))| {
            begin.elapsed() > LIMIT && now.zip(*before).is_none_or(|(now, before)| now.saturating_sub(before) > limit)
        });
        let late: Vec<u64> = late.map(|(n, _)| *n).collect();
        for number in late {
            running.remove(&number);
            tally.hang(number);
            ended += 1;
            work(&seeds, &next, end, sender.clone());
        }
        for (number, why) in tally.failures.drain(..) {
            keep(number, &mutant(&seeds, number), &why);
            tally.kept += 1;
        }
    }
    tally
}

/// Writes a mutant with what is wrong as comments.
fn keep(number: u64, mutant: &Mutant, why: &str) {
    let lines: Vec<String> = mutant.changes.iter().map(|c| format!("# {}", c.replace('\n', " "))).collect();
    let why = why.replace('\n', "\n# ");
    let text = format!("# mutant {number} of {}: {why}\n{}\n{}", mutant.seed, lines.join("\n"), mutant.text());
    let folder = Path::new(FOLDER);
    let file = folder.join(format!("{number}.wfl"));
    if let Err(error) = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(file, text)) {
        eprintln!("mutant {number} cannot be written: {error}");
    }
}

#[expect(clippy::print_stdout, reason = "this program prints its result")]
fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize| words.get(at).and_then(|w| w.replace('_', "").parse::<u64>().ok());
    wfl_host::memory::set_limit(MEMORY);
    if words.first().is_some_and(|w| w == "show") {
        let mutant = mutant(&seeds(), number(1).unwrap_or(0));
        println!("{}\n{:?}\n{:?}", mutant.text(), mutant.changes, judge(&mutant, None));
        return ExitCode::SUCCESS;
    }
    if words.first().is_some_and(|w| w == "seeds") {
        for seed in seeds() {
            println!("{}: {:?}", seed.name, judge(&seed.as_mutant(), None));
        }
        return ExitCode::SUCCESS;
    }
    let (count, first) = (number(0).unwrap_or(10_000), number(1).unwrap_or(0));
    // panics are counted; their texts would drown the counts
    std::panic::set_hook(Box::new(|_| {}));
    let begin = Instant::now();
    let tally = all(seeds(), first, first + count);
    println!("{count} mutants from {first}: {:.0} s", begin.elapsed().as_secs_f64());
    tally.counts.iter().for_each(|(kind, n)| println!("  {n} {kind}"));
    tally.codes.iter().for_each(|(code, n)| println!("    {n} {code}"));
    println!("  slowest: mutant {} in {:.1} s", tally.slowest.1, tally.slowest.0.as_secs_f64());
    if tally.kept == 0 {
        return ExitCode::SUCCESS;
    }
    println!("  see {FOLDER}");
    ExitCode::FAILURE
}
