//! The runs of a sweep that are not in its table yet: in which order they are made, one by one or several at once.

use std::{
    collections::BTreeSet,
    path::Path,
    sync::{
        atomic::{AtomicUsize, Ordering},
        mpsc::channel,
    },
    time::Instant,
};

use wfl_adapt::knobs::Setting;

use super::{
    Method, Sweep,
    clock::{self, Clock},
    lists, page,
    table::{self, NOT_AS_EXPECTED, Row, SOLVED},
};
use crate::{STACK, ending::Ending, folder::told_later, limited_threads};

/// A run that is to be made.
pub(super) struct Planned<'a> {
    pub(super) method: &'a Method,
    pub(super) setting: &'a Setting,
    pub(super) key: String,
    size: String,
}

impl Sweep<'_> {
    /// All runs that are not in the table yet; gives how those of this sweep ended.
    pub(super) fn all(&mut self, methods: &[Method]) -> Result<Ending, String> {
        let settings = lists::combinations(self.knobs);
        let mut plan: Vec<Planned<'_>> = methods
            .iter()
            .flat_map(|m| settings.iter().map(move |s| (m, s.as_slice())))
            .map(|(method, setting)| {
                let size = clock::size(method, setting);
                Planned { method, setting, key: self.key(method, setting), size }
            })
            .collect();
        if !self.parallel() {
            // what ran beside others has no time yet
            let timed = |r: &Row| r.value("time").is_some();
            self.rows.retain(|r| timed(r) || plan.iter().all(|p| p.key != r.text("key")));
        }
        let others = self.drop_others(methods, &plan);
        let keys: BTreeSet<String> = plan.iter().map(|p| p.key.clone()).collect();
        plan.retain(|p| self.rows.iter().all(|r| r.text("key") != p.key));
        let all = methods.len() * settings.len();
        self.job.listener.progress(&format!("{} runs, {} of them already in the table", all, all - plan.len()));
        let before = std::mem::take(&mut self.rows);
        let mut made: Vec<Option<Row>> = plan.iter().map(|_| None).collect();
        let mut clock = Clock::new(plan.iter().map(|p| (p.method, p.setting)));
        // the smallest run goes first: the time of the others is told from it
        let mut order: Vec<usize> = (0..plan.len()).collect();
        let smallest = clock.smallest(plan.iter().map(|p| p.size.as_str()));
        if let Some(before) = order.get_mut(..=smallest) {
            before.rotate_right(1);
        }
        self.each(&plan, &order, |k, row, seconds| {
            clock.add(&plan[k].size, seconds);
            let n = made.iter().flatten().count() + 1;
            let rest = plan.iter().zip(&made).enumerate().filter(|(j, (_, m))| *j != k && m.is_none());
            let left = clock.left(rest.map(|(_, (p, _))| p.size.as_str())) / self.jobs() as f64;
            self.job.listener.progress(&line(&row, n, plan.len(), left));
            made[k] = Some(row);
            // a run that is broken off loses what was being made and no more
            let rows: Vec<Row> = before.iter().chain(made.iter().flatten()).cloned().collect();
            table::write(self.dir, &rows).map_err(|e| told_later(&e))
        })?;
        self.rows = before.into_iter().chain(made.into_iter().flatten()).collect();
        table::write(self.dir, &self.rows).map_err(|e| told_later(&e))?;
        page::write(self.dir, &self.rows).map_err(|e| told_later(&e))?;
        let page = self.job.out.join(page::PAGE_FILE);
        self.job.listener.result(&page::markdown(&self.rows));
        let told = format!("\n{}; {}\n{}{}", counts(&self.rows), page.display(), dropped(others), without(methods));
        self.job.listener.result(&told);
        Ok(ending(self.rows.iter().filter(|r| keys.contains(r.text("key")))))
    }

    fn jobs(&self) -> usize {
        self.job.jobs.map_or(1, |n| limited_threads(n.get(), self.job.listener))
    }

    pub(super) fn parallel(&self) -> bool {
        self.jobs() > 1
    }

    /// Runs what is planned, and hands on the position of each run, its row and its seconds as it ends.
    fn each(
        &self,
        plan: &[Planned<'_>],
        order: &[usize],
        mut done: impl FnMut(usize, Row, f64) -> Result<(), String>,
    ) -> Result<(), String> {
        let run = |k: usize| {
            let begin = Instant::now();
            let row = self.row(&plan[k]);
            (k, row, begin.elapsed().as_secs_f64())
        };
        if !self.parallel() {
            for k in order {
                let (k, row, seconds) = run(*k);
                done(k, row, seconds)?;
            }
            return Ok(());
        }
        let (next, (sender, receiver)) = (AtomicUsize::new(0), channel());
        std::thread::scope(|scope| {
            for _ in 0..self.jobs().min(plan.len()) {
                let (sender, next, run) = (sender.clone(), &next, &run);
                let work = move || {
                    loop {
                        let k = next.fetch_add(1, Ordering::Relaxed);
                        let Some(k) = order.get(k) else { return };
                        if sender.send(run(*k)).is_err() {
                            return;
                        }
                    }
                };
                // one that cannot be had leaves its work to the others
                let _ = std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, work);
            }
            drop(sender);
            receiver.iter().try_for_each(|(k, row, seconds)| done(k, row, seconds))
        })
    }
}

/// How many rows there are, and how many are not as they should be.
fn counts(rows: &[Row]) -> String {
    let failed = rows.iter().filter(|r| !r.is_solved()).count();
    let not_as_expected = rows.iter().filter(|r| r.text("status") == NOT_AS_EXPECTED).count();
    page::ended(failed, not_as_expected, &format!("{} rows", rows.len()))
}

/// What runs ended as, the worst of them.
fn ending<'r>(rows: impl Iterator<Item = &'r Row>) -> Ending {
    let mut worst = Ending::Done;
    for row in rows {
        if !row.is_solved() {
            return Ending::NotConverged;
        }
        if row.text("status") == NOT_AS_EXPECTED {
            worst = Ending::NotAsExpected;
        }
    }
    worst
}

/// What was taken out of the table; nothing where that is nothing.
fn dropped(others: usize) -> String {
    let what = "of a scene or inputs that have changed, of another version or against another reference";
    match others {
        0 => String::new(),
        1 => format!("1 row was dropped: {what}\n"),
        n => format!("{n} rows were dropped: {what}\n"),
    }
}

/// Why some problems have no reference.
fn without(methods: &[Method]) -> String {
    let mut said: Vec<&str> = Vec::new();
    for against in methods.iter().flat_map(|m| &m.references) {
        if let Err(why) = &against.found
            && !said.contains(&why.as_str())
        {
            said.push(why);
        }
    }
    said.iter().map(|why| format!("rows without errors: {why}\n")).collect()
}

/// One line about a run.
fn line(row: &Row, number: usize, of: usize, left: f64) -> String {
    let setting: Vec<String> =
        row.columns().filter_map(|c| c.strip_prefix("knob ").map(|name| format!("{name}={}", row.text(c)))).collect();
    let scene = Path::new(row.text("scene")).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let error = |name: &str| row.value(&format!("error {name}")).map(|e| format!(", {name} {e:.1e}"));
    let seconds = row.value("time").map_or_else(String::new, |s| format!("{s:.2} s, "));
    let what = match row.text("status") {
        SOLVED => format!("{} iterations{}", row.text("iterations"), error("H1").unwrap_or_default()),
        bad => format!("{bad}: {}", row.text("message").lines().next().unwrap_or_default()),
    };
    format!("[{number}/{of}] {scene} {}: {seconds}{what}; about {left:.0} s left", setting.join(" "))
}
