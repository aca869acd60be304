//! `wfl sweep`: scenes over lists of settings, their errors and costs in one table.
//!
//! Every run is made in this process with a fresh state, one at a time: times are those of a machine that does nothing
//! else. Several at once (`--jobs`) are not timed. A setting that fails stays in the table with its message and time. A
//! table that is there already is gone on with: its rows are not run again as long as everything that their
//! scene reads, its reference and the version of the program are the same.
//!
//! `lists` reads the command line, knobs of the runtime change scenes, `one` runs a setting, `reference` gives errors,
//! `table` keeps the rows; `front` and `page` read nothing but these.

mod clock;
mod front;
mod lists;
mod machine;
pub(crate) mod one;
mod page;
mod reference;
mod study;
mod table;
mod verdict;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    sync::{
        atomic::{AtomicUsize, Ordering},
        mpsc::channel,
    },
    time::Instant,
};

use wfl_compiler::backend::KernelBackend;
use wfl_runtime::{
    compare::{Solved, measures},
    knobs::{self, Setting, number},
    output::{Kind, OutputDir, OutputError, Plan, State},
};

use self::{
    clock::Clock,
    lists::Knob,
    one::{Bench, Known, Status},
    reference::Reference,
    table::Row,
};
use crate::{
    args::SweepArgs,
    folder::{error_line, told_later},
    interrupt::Tidied,
    load::{out, say},
    prepared::{EXIT_ERROR, backend},
    threads::{available, limited},
};

/// A setting in words, as on the command line.
pub(crate) fn words(setting: &Setting) -> String {
    setting.iter().map(|(n, v)| format!("{n}={v}")).collect::<Vec<_>>().join(" ")
}

/// A scene of a sweep.
struct Method {
    path: PathBuf,
    known: Known,
    /// Which reference its errors are taken against.
    reference: Option<usize>,
    /// Statements put behind its text.
    more: String,
}

pub(crate) fn sweep(args: &SweepArgs) -> ExitCode {
    let done = match &args.study {
        Some(docs) => study::study(args, docs),
        None => run(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            say(&error_line(&why));
            ExitCode::from(EXIT_ERROR)
        }
    }
}

fn run(args: &SweepArgs) -> Result<(), String> {
    if args.plot {
        return plot(args);
    }
    let (scenes, lists): (Vec<String>, Vec<String>) = args.words.iter().cloned().partition(|w| !w.contains('='));
    if scenes.is_empty() {
        return Err("no scene is given\n  = help: wfl sweep SCENE.wfl gamma=1e4,1e6".to_owned());
    }
    let knobs = lists::knobs(&lists).map_err(|e| e.to_string())?;
    let Some(backend) = backend(false) else { return Err("there is no machine code on this processor".to_owned()) };
    let default = || if args.jobs.is_some_and(|n| n.get() > 1) { 1 } else { available() };
    let threads = args.threads.map_or_else(default, |n| limited(n.get()));
    let mut methods = methods(&scenes, &knobs, &*backend)?;
    let dir = OutputDir::open(&args.out).map_err(|e| told_later(&e))?;
    dir.go_on(Kind::Sweep, &plan(&methods)).map_err(|e| told_later(&e))?;
    let _tidied = Tidied::new(args.out.clone(), "the rows made are kept: the same command goes on");
    let mut sweep = Sweep {
        args,
        knobs: &knobs,
        bench: Bench { backend: &*backend, threads, only: None, last: false },
        references: Vec::new(),
        rows: kept_rows(&dir)?,
        dir: &dir,
        machine: machine::describe(),
    };
    sweep.references(&mut methods)?;
    sweep.all(&methods)?;
    dir.finish(State::Finished).map_err(|e| told_later(&e))
}

/// The names of the files of a sweep.
fn plan(methods: &[Method]) -> Plan {
    let mut files = vec![table::TABLE_FILE.to_owned(), page::PAGE_FILE.to_owned()];
    files.extend((1..=methods.len()).map(reference_file));
    let outputs = methods.iter().flat_map(|m| &m.known.loaded.script.outputs).flat_map(|o| &o.items);
    let quantities = ["L2", "H1"].into_iter().chain(outputs.map(|i| i.name.as_str()));
    files.extend(quantities.map(|q| format!("{}.svg", page::plot_name(q))));
    Plan { files, series: Vec::new() }
}

fn reference_file(number: usize) -> String {
    format!("reference_{number}.json")
}

/// The rows of earlier sweeps, if the table is what they wrote.
fn kept_rows(dir: &OutputDir) -> Result<Vec<Row>, String> {
    let changed = |e: OutputError| {
        let help = "its rows are not gone on with: move it away, or write elsewhere: --out DIR; wfl sweep --plot makes its page";
        format!("[E715]: {e}\n  = help: {help}")
    };
    match dir.verify(table::TABLE_FILE).map_err(changed)? {
        Some(_) => table::read(dir.path()).map_err(|e| e.to_string()),
        None => Ok(Vec::new()),
    }
}

/// Makes page and plots anew from the tables of sweeps.
fn plot(args: &SweepArgs) -> Result<(), String> {
    let given: Vec<PathBuf> = args.words.iter().map(PathBuf::from).collect();
    let folders = if given.is_empty() { vec![args.out.clone()] } else { given };
    for folder in folders {
        let rows = table::read(&folder).map_err(|e| e.to_string())?;
        if rows.is_empty() {
            let help = "give the folder of a sweep: wfl sweep --plot DIR";
            return Err(format!("there is no {} in {}\n  = help: {help}", table::TABLE_FILE, folder.display()));
        }
        replot(&folder, &rows).map_err(|e| told_later(&e))?;
        if !args.quiet {
            out(&format!("{}\n", folder.join(page::PAGE_FILE).display()));
        }
    }
    Ok(())
}

fn replot(folder: &Path, rows: &[Row]) -> Result<(), OutputError> {
    let dir = OutputDir::open(folder)?;
    let charts = page::charts(rows).into_iter().map(|(name, _)| format!("{name}.svg"));
    let files = charts.chain([page::PAGE_FILE.to_owned()]).collect();
    dir.go_on(Kind::Sweep, &Plan { files, series: Vec::new() })?;
    page::write(&dir, rows)?;
    dir.finish(State::Finished)
}

/// Reads the scenes and checks that every knob means something in each of them.
fn methods(scenes: &[String], knobs: &[Knob], backend: &dyn KernelBackend) -> Result<Vec<Method>, String> {
    let mut out = Vec::new();
    for scene in scenes {
        let path = PathBuf::from(scene);
        let known = one::known(&path, &[], backend)?;
        for knob in knobs {
            for value in &knob.values {
                let setting = [(knob.name.clone(), value.clone())];
                let mut script = known.loaded.script.clone();
                knobs::apply(&mut script, &setting, &known.params, &known.kinked)
                    .map_err(|e| format!("{scene}: {e}"))?;
            }
        }
        out.push(Method { path, known, reference: None, more: String::new() });
    }
    Ok(out)
}

/// A run that is to be made.
struct Planned<'a> {
    method: &'a Method,
    setting: &'a Setting,
    key: String,
    size: String,
}

struct Sweep<'a> {
    args: &'a SweepArgs,
    knobs: &'a [Knob],
    bench: Bench<'a>,
    references: Vec<Reference>,
    rows: Vec<Row>,
    dir: &'a OutputDir,
    machine: machine::Machine,
}

impl Sweep<'_> {
    fn tell(&self, text: &str) {
        if !self.args.quiet {
            say(&format!("{text}\n"));
        }
    }

    /// Makes or reads what the errors are taken against.
    fn references(&mut self, methods: &mut [Method]) -> Result<(), String> {
        match self.args.reference.as_str() {
            "none" => {}
            "exact" => {
                for method in &mut *methods {
                    let help = "write `def exact = ...` (or def exact_u, def exact_slip for an output `slip`)";
                    method.more = reference::exact_statements(&method.known).ok_or_else(|| {
                        format!("{} defines no exact solution\n  = help: {help}", method.path.display())
                    })?;
                    method.reference = Some(0);
                }
                let what = "exact solution".to_owned();
                self.references.push(Reference { what, exact: true, ..Reference::default() });
            }
            "auto" => {
                let last = methods.len() - 1;
                for k in 0..methods.len() {
                    // never the same method, where there is a choice
                    let of = if k == last { 0 } else { last };
                    let setting = self.finer_setting(&methods[of].known)?;
                    let found = self.finer(&methods[of], &setting)?;
                    methods[k].reference = Some(found);
                }
                reference::compare(&mut self.references);
            }
            file => {
                self.references.push(reference::from_file(Path::new(file))?);
                methods.iter_mut().for_each(|m| m.reference = Some(0));
            }
        }
        Ok(())
    }

    /// The setting of the finer run: the finest mesh of the sweep with one degree more, cells of half the size where the
    /// degree is 2 already or the scene is plane, the smallest tolerance; everything else as the scene says.
    fn finer_setting(&self, known: &Known) -> Result<Vec<(String, String)>, String> {
        let sizes = knobs::mesh_words(&known.loaded.script);
        let mut setting: Vec<(String, String)> = Vec::new();
        let pick = |knob: &Knob, largest: bool| {
            let value = |v: &&String| number(v).unwrap_or(0.0);
            let sorted = |a: &&String, b: &&String| value(a).total_cmp(&value(b));
            if largest { knob.values.iter().max_by(sorted) } else { knob.values.iter().min_by(sorted) }.cloned()
        };
        let mut degree = reference::largest_degree(known);
        let mut refine = 1.0;
        for knob in self.knobs {
            match knob.name.as_str() {
                "degree" => degree = pick(knob, true).and_then(|d| d.parse().ok()).unwrap_or(degree),
                "refine" => refine = pick(knob, true).and_then(|r| number(&r)).unwrap_or(1.0),
                "h" | "tol" => setting.extend(pick(knob, false).map(|v| (knob.name.clone(), v))),
                name if sizes.iter().any(|s| s == name) => {
                    setting.extend(pick(knob, true).map(|v| (knob.name.clone(), v)));
                }
                _ => {}
            }
        }
        if degree > 1 || known.scene.system.mesh.dim() < 3 {
            refine *= 2.0;
        }
        setting.push(("degree".to_owned(), degree.max(2).to_string()));
        setting.push(("refine".to_owned(), refine.to_string()));
        for given in lists::knobs(&self.args.reference_knob).map_err(|e| e.to_string())? {
            setting.retain(|k| k.0 != given.name);
            setting.extend(given.values.first().map(|v| (given.name.clone(), v.clone())));
        }
        setting.retain(|(name, value)| name != "refine" || value != "1");
        Ok(setting)
    }

    /// The position of a finer run of a method among the references: kept from before, or made now.
    fn finer(&mut self, method: &Method, setting: &Setting) -> Result<usize, String> {
        let what = format!("{} {}", method.path.display(), words(setting));
        if let Some(k) = self.references.iter().position(|r| r.what == what) {
            return Ok(k);
        }
        let k = self.references.len();
        let name = reference_file(k + 1);
        let made = match self.kept_reference(&name, &what, method) {
            Some(kept) => kept,
            None => {
                let begin = Instant::now();
                let quiet = self.args.quiet;
                let mut progress = |text: &str| {
                    if !quiet {
                        say(&format!("reference: {text}\n"));
                    }
                };
                let bench = Bench { last: true, only: None, ..self.bench };
                let made = reference::finer(&bench, &method.path, &method.known, setting, &mut progress)?;
                reference::to_file(&made, self.dir, &name)?;
                let file = self.dir.path().join(&name);
                self.tell(&format!("reference: {:.1} s; kept in {}", begin.elapsed().as_secs_f64(), file.display()));
                made
            }
        };
        self.references.push(made);
        Ok(k)
    }

    /// The reference that an earlier sweep made of the same, if its file is what was written.
    fn kept_reference(&self, name: &str, what: &str, method: &Method) -> Option<Reference> {
        let read = match self.dir.verify(name) {
            Ok(file) => reference::from_file(&file?),
            Err(error) => Err(error.to_string()),
        };
        if let Err(why) = &read {
            self.tell(&format!("reference: {why}: made anew"));
        }
        read.ok().filter(|r| r.what == what && r.identity == method.known.identity.hash())
    }

    /// All runs that are not in the table yet.
    fn all(&mut self, methods: &[Method]) -> Result<(), String> {
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
        plan.retain(|p| self.rows.iter().all(|r| r.text("key") != p.key));
        let all = methods.len() * settings.len();
        self.tell(&format!("{} runs, {} of them in the table already", all, all - plan.len()));
        let before = std::mem::take(&mut self.rows);
        let mut made: Vec<Option<Row>> = plan.iter().map(|_| None).collect();
        let mut clock = Clock::new(plan.iter().map(|p| (p.method, p.setting)));
        // the smallest run goes first: the time of the others is told from it
        let mut order: Vec<usize> = (0..plan.len()).collect();
        let smallest = clock.smallest(plan.iter().map(|p| p.size.as_str()));
        if let Some(before) = order.get_mut(..=smallest) {
            before.rotate_right(1);
        }
        self.each((&plan, &order), |k, row, seconds| {
            clock.add(&plan[k].size, seconds);
            let n = made.iter().flatten().count() + 1;
            let rest = plan.iter().zip(&made).enumerate().filter(|(j, (_, m))| *j != k && m.is_none());
            let left = clock.left(rest.map(|(_, (p, _))| p.size.as_str())) / self.jobs() as f64;
            self.tell(&line(&row, n, plan.len(), left));
            made[k] = Some(row);
            // a run that is broken off loses what was being made and no more
            let rows: Vec<Row> = before.iter().chain(made.iter().flatten()).cloned().collect();
            table::write(self.dir, &rows).map_err(|e| told_later(&e))
        })?;
        self.rows = before.into_iter().chain(made.into_iter().flatten()).collect();
        table::write(self.dir, &self.rows).map_err(|e| told_later(&e))?;
        page::write(self.dir, &self.rows).map_err(|e| told_later(&e))?;
        if !self.args.quiet {
            let bad = self.rows.iter().filter(|r| r.text("status") != "ok").count();
            let page = self.args.out.join(page::PAGE_FILE);
            out(&page::markdown(&self.rows));
            out(&format!("\n{} rows, {bad} of them failures; {}\n", self.rows.len(), page.display()));
        }
        Ok(())
    }

    fn jobs(&self) -> usize {
        self.args.jobs.map_or(1, |n| limited(n.get()))
    }

    fn parallel(&self) -> bool {
        self.jobs() > 1
    }

    /// Runs what is planned, and hands on the position of each run, its row and its seconds as it ends.
    fn each(
        &self,
        (plan, order): (&[Planned<'_>], &[usize]),
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
                let _ = std::thread::Builder::new().stack_size(crate::STACK).spawn_scoped(scope, work);
            }
            drop(sender);
            receiver.iter().try_for_each(|(k, row, seconds)| done(k, row, seconds))
        })
    }

    /// What tells a row from others: scene with its text, setting, repetitions and reference.
    fn key(&self, method: &Method, setting: &Setting) -> String {
        let reference = method.reference.map(|k| &self.references[k]);
        let reference = reference.map_or("none".to_owned(), |r| format!("{} {}", r.what, r.identity));
        let n = self.args.repeat;
        let identity = method.known.identity.hash();
        format!("{} {identity} | {} | {n} | {reference}", method.path.display(), words(setting))
    }

    /// Runs a setting as often as asked for.
    fn row(&self, planned: &Planned<'_>) -> Row {
        let Planned { method, setting, key, .. } = planned;
        machine::forget_peak_memory();
        let mut runs: Vec<one::Run> = Vec::new();
        for _ in 0..self.args.repeat.get() {
            let run = self.bench.run(&method.path, &method.known, setting, &method.more);
            let ok = run.status == Status::Ok;
            runs.push(run);
            if !ok {
                break;
            }
        }
        let mut row = self.head(method, setting);
        let mut seconds: Vec<f64> = runs.iter().map(|r| r.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        let last = runs.pop();
        let errors = last.as_ref().and_then(|run| self.errors(method, run));
        row.set("status", "failed");
        if let Some(run) = &last {
            let (status, message) = status(run, errors.as_ref());
            row.set("status", status);
            row.set("message", message);
        }
        row.number("repeats", seconds.len() as f64);
        if !self.parallel() {
            row.number("time", seconds[seconds.len() / 2]);
            row.number("time_min", seconds[0]);
            row.number("time_max", seconds[seconds.len() - 1]);
        }
        if let Some(solved) = last.as_ref().and_then(|r| r.solved.as_ref()) {
            if !self.parallel() {
                times(&mut row, solved);
            }
            costs(&mut row, solved);
        }
        if let Some(Ok(errors)) = errors {
            let reference = method.reference.map(|k| &self.references[k]);
            for (name, value) in &errors {
                row.number(format!("error {name}"), *value);
                if let Some(own) = reference.and_then(|r| r.own_error(name)) {
                    row.number(format!("reference error {name}"), own);
                }
            }
        }
        row.set("key", key.as_str());
        row
    }

    /// The columns that say how to run it again.
    fn head(&self, method: &Method, setting: &Setting) -> Row {
        let mut row = Row::default();
        row.set("scene", method.path.display().to_string());
        for (name, value) in setting {
            row.set(format!("knob {name}"), value.clone());
        }
        for column in ["status", "message"] {
            row.set(column, "");
        }
        row.set("reference", method.reference.map_or("none", |k| &self.references[k].what));
        row.set("version", self.machine.version.clone());
        row.set("commit", self.machine.commit.clone());
        row.set("machine", self.machine.name.clone());
        row.number("threads", self.bench.threads as f64);
        row.set("command", format!("wfl sweep {} {}", method.path.display(), words(setting)).trim_end());
        row
    }

    fn errors(&self, method: &Method, run: &one::Run) -> Option<Result<Vec<(String, f64)>, String>> {
        let reference = &self.references[method.reference?];
        let solved = run.solved.as_ref().filter(|_| run.status == Status::Ok)?;
        Some(reference.errors(solved, self.bench.backend))
    }
}

/// The status of a row and what there is to say about it. Numbers that are not finite are a failure of their own.
fn status(run: &one::Run, errors: Option<&Result<Vec<(String, f64)>, String>>) -> (&'static str, String) {
    match (&run.status, errors) {
        (Status::Failed(why), _) => ("failed", why.clone()),
        (Status::NotConverged(why), _) => ("not converged", why.clone()),
        (Status::Ok, Some(Err(why))) => ("failed", format!("solved, but it cannot be compared: {why}")),
        (Status::Ok, errors) => {
            let measures = run.solved.as_ref().map(measures).unwrap_or_default();
            let errors = errors.and_then(|e| e.as_ref().ok()).into_iter().flatten();
            let broken: Vec<&str> =
                errors.chain(&measures).filter(|v| !v.1.is_finite()).map(|v| v.0.as_str()).collect();
            if broken.is_empty() {
                ("ok", String::new())
            } else {
                ("not finite", format!("not a finite number: {}", broken.join(", ")))
            }
        }
    }
}

/// Seconds and memory of a run that had the machine to itself.
fn times(row: &mut Row, solved: &Solved) {
    let report = &solved.outcome.report;
    let t = report.timings;
    let split = [t.parse, t.compile, t.mesh, t.assemble, t.factor, t.solve];
    for (name, value) in ["parse", "compile", "mesh", "assemble", "factor", "solve"].into_iter().zip(split) {
        row.number(name, value);
    }
    if let Some(bytes) = report.peak_memory_bytes {
        row.number("peak_memory_bytes", bytes as f64);
    }
}

/// What a run cost in numbers that do not depend on the machine, and its measures.
fn costs(row: &mut Row, solved: &Solved) {
    let report = &solved.outcome.report;
    let steps = &solved.outcome.steps;
    let newton = |s: &wfl_runtime::StepResult| {
        let parts: usize = s.attempts.iter().map(|a| a.iterations).sum();
        parts.max(s.history.n_iterations())
    };
    row.set("solver", report.solver.clone().unwrap_or_default());
    row.number("dofs", report.dofs as f64);
    row.number("cells", report.mesh.cells as f64);
    row.number("steps", steps.len() as f64);
    row.number("iterations", steps.iter().map(newton).sum::<usize>() as f64);
    row.number("factorisations", report.factorisations as f64);
    let residual = |s: &wfl_runtime::StepResult| s.history.iterations.last().map(|i| i.residual);
    if let Some(largest) = steps.iter().filter_map(residual).max_by(f64::total_cmp) {
        row.number("residual", largest);
    }
    for (name, value) in measures(solved) {
        row.number(format!("measure {name}"), value);
    }
}

/// One line about a run.
fn line(row: &Row, number: usize, of: usize, left: f64) -> String {
    let setting: Vec<String> =
        row.columns().filter_map(|c| c.strip_prefix("knob ").map(|name| format!("{name}={}", row.text(c)))).collect();
    let scene = Path::new(row.text("scene")).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let error = |name: &str| row.value(&format!("error {name}")).map(|e| format!(", {name} {e:.1e}"));
    let seconds = row.value("time").map_or_else(String::new, |s| format!("{s:.2} s, "));
    let what = match row.text("status") {
        "ok" => format!("{} iterations{}", row.text("iterations"), error("H1").unwrap_or_default()),
        bad => format!("{bad}: {}", row.text("message").lines().next().unwrap_or_default()),
    };
    format!("[{number}/{of}] {scene} {}: {seconds}{what}; about {left:.0} s left", setting.join(" "))
}
