//! The file from which a killed run continues.
//!
//! Promises: a continued run gives the same bits as an uninterrupted one; a file of another
//! run, and one that is cut short or damaged, is refused with the reason.
//! The file is written after the results of its step, under a temporary name, and renamed: whenever a run is killed,
//! results and checkpoint are whole. What was done in the steps since goes to the end of a second file, the log, before
//! the checkpoint says how long it is: the cost of a step does not grow with their number, and what a killed run wrote
//! behind that length is cut off. Does not keep the states of earlier steps: their results are in their files.

mod found;
mod steps;

use std::{
    cmp::Ordering,
    path::{Path as FilePath, PathBuf},
};

use thiserror::Error;
use wfl_contact::{ContactMemory, FrictionMemory};
use wfl_discrete::rates::RatesMemory;
use wfl_host::input::{InputError, InputKind, read_input};
use wfl_output::{
    Hash, OutputDir,
    bytes::{HASH_OF_NOTHING, Reader, Unreadable, Writer, hash, hash_on},
};
use wfl_problem::Solving;
use wfl_sparse::solve::{Reference, SolverMemory};

use super::{
    Clock, Run, RunError, RunState, StepResult,
    balance::Balance,
    control::Control,
    gained::Gained,
    memory::Memory,
    past::Past,
    remembered::{Adaptive, Uncertainty},
};
use steps::{read_step, step};

/// The name of the file in the folder of the results.
pub const CHECKPOINT_FILE: &str = "checkpoint.wflc";
/// The name of the file beside it with what was done in each step.
pub(super) const LOG_FILE: &str = "checkpoint_steps.wflc";
const MAGIC: &[u8; 8] = b"WFLSTATE";
/// Grows when the layout changes.
const FORMAT: u64 = 30;
/// Magic, format, length and checksum before the content.
const HEADER: usize = 32;

/// Why a run cannot go on from a checkpoint.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The system does not give the file.
    #[error("cannot read the checkpoint `{}`: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: InputError,
    },
    /// The file is no checkpoint, is cut short or damaged.
    #[error("`{}` is not a complete checkpoint ({what}); without --resume the run starts from the beginning", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: &'static str,
    },
    /// The results are those of something else.
    #[error(
        "`{}` holds results of {what}; --resume continues exactly the run that wrote them, without it the run starts from the beginning",
        path.display()
    )]
    Other {
        /// The folder.
        path: PathBuf,
        /// What differs: "another version of wfl (0.1.0)", "another content of `fault.wfl`".
        what: String,
    },
    /// Each rank went on with a part of the mesh, and there are others now.
    #[error(
        "the results in `{}` are of {}; they are continued in the same way only; without --resume the run starts from the \
         beginning",
        path.display(), of.in_words()
    )]
    Ranks {
        /// The folder.
        path: PathBuf,
        /// The ranks that wrote them.
        of: Holders,
    },
    /// A file of an earlier step is not there.
    #[error(
        "the results in `{}` are incomplete: `{name}` is missing; without --resume the run starts from the beginning",
        path.display()
    )]
    Gone {
        /// The folder.
        path: PathBuf,
        /// The file.
        name: String,
    },
}

/// Who has the state of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holders {
    /// Every rank has all of it.
    Each,
    /// So many ranks have a part each.
    Parts(usize),
}

impl Holders {
    /// Those of a scene.
    fn of(scene: &Solving<'_>) -> Self {
        scene.system.mesh.part_of_whole().map_or(Self::Each, |part| Self::Parts(part.team().size()))
    }

    fn in_words(self) -> String {
        match self {
            Self::Each => "a run with the whole mesh on each rank (one rank, or `--whole-mesh`)".to_owned(),
            Self::Parts(n) => format!("{n} ranks with a part of the mesh each (`mpirun -n {n}`)"),
        }
    }
}

/// Where a run stands, as it is kept in the files.
pub(super) struct Content {
    state: Vec<u8>,
    /// The steps since the last checkpoint, for the log, and where they begin there.
    entry: Vec<u8>,
    at: u64,
}

/// How long the log is and what is in it.
#[derive(Clone, Debug)]
pub(super) struct Log {
    /// Steps.
    count: usize,
    length: u64,
    hash: u64,
}

impl Default for Log {
    fn default() -> Self {
        Self { count: 0, length: 0, hash: HASH_OF_NOTHING }
    }
}

/// Where the run stands after its last step, at `state`; `log` grows by the steps that it does not have. Of
/// ranks that have parts of the mesh the first one has the content of all, and all make it together.
pub(super) fn pack(run: &Run, log: &mut Log, scene: &Solving<'_>, state: &RunState) -> Content {
    let holders = Holders::of(scene);
    let own = written(state, run.clock);
    let states = match holders {
        Holders::Each => vec![own],
        Holders::Parts(_) => scene.system.team().at_first(&own),
    };
    let mut entry = Writer::default();
    run.steps[log.count..].iter().for_each(|s| step(&mut entry, s));
    let (entry, at) = (entry.bytes, log.length);
    log.count = run.steps.len();
    log.length += entry.len() as u64;
    log.hash = hash_on(log.hash, &entry);
    let mut w = Writer::default();
    w.text(&run.identity.to_string());
    w.count(run.steps.len());
    [log.length, log.hash].iter().for_each(|x| w.word(*x));
    w.count(match holders {
        Holders::Each => 0,
        Holders::Parts(n) => n,
    });
    w.list(&states, |w, state| w.all(state));
    Content { state: w.bytes, entry, at }
}

/// A state and the time that was spent, as bytes.
fn written(state: &RunState, c: Clock) -> Vec<u8> {
    let RunState { u, memory: m, rates, solver, level, easy, adaptive: a, balance: b, friction: f } = state;
    let mut w = Writer::default();
    w.count(u.len());
    w.numbers(u);
    memory(&mut w, m);
    w.numbers(&rates.factors);
    w.numbers(&rates.before);
    w.count(rates.kept.len());
    rates.kept.iter().for_each(|kept| w.numbers(kept));
    w.numbers(&solver.factored);
    w.flag(solver.dense);
    w.flag(solver.symmetric);
    w.count(solver.factorisations);
    w.count(solver.spent);
    w.count(solver.apart.len());
    solver.apart.iter().for_each(|dof| w.count(*dof as usize));
    w.flag(solver.single);
    w.flag(solver.iterative);
    let reference = &solver.reference;
    w.numbers(&reference.values);
    w.count(reference.groups.len());
    for group in &reference.groups {
        w.count(group.len());
        group.iter().for_each(|row| w.count(*row as usize));
    }
    w.count(reference.whole);
    w.count(*level as usize);
    w.count(*easy as usize);
    adaptive(&mut w, a.as_ref());
    balance(&mut w, b.as_ref());
    friction(&mut w, f.as_ref());
    w.numbers(&[c.assemble, c.factor, c.solve, c.write, c.check, c.measure]);
    w.bytes
}

/// Writes where a run stands.
pub(super) fn write(content: &Content, dir: &OutputDir) -> Result<(), RunError> {
    dir.append(LOG_FILE, content.at, &content.entry)?;
    let content = &content.state;
    // results and log are on the disc before a checkpoint says so
    dir.sync()?;
    dir.write_checked(CHECKPOINT_FILE, |out| {
        out.write_all(MAGIC)?;
        for number in [FORMAT, content.len() as u64, hash(content)] {
            out.write_all(&number.to_le_bytes())?;
        }
        out.write_all(content)
    })?;
    Ok(())
}

/// What a checkpoint brings back.
pub(super) struct Found {
    pub(super) steps: Vec<StepResult>,
    pub(super) state: RunState,
    pub(super) clock: Clock,
    pub(super) log: Log,
}

/// What a checkpoint and the log beside it hold.
#[derive(Default)]
pub(super) struct Files {
    /// There is a checkpoint.
    is_there: bool,
    of: String,
    log: Log,
    holders: Option<Holders>,
    /// Of all, or by rank.
    states: Vec<Vec<u8>>,
    /// The bytes of the log.
    steps: Vec<u8>,
}

impl Files {
    /// Those that the first rank has read, on every rank: each has the state that it goes on from. Empty where the first one
    /// has none.
    pub(super) fn of_first(mut self, scene: &Solving<'_>, folder: &FilePath) -> Result<Self, CheckpointError> {
        let team = scene.system.team();
        if !team.any(self.is_there) {
            return Ok(Self::default());
        }
        if let Some(of) = self.holders.filter(|of| *of != Holders::of(scene)) {
            return Err(CheckpointError::Ranks { path: folder.to_path_buf(), of });
        }
        let mut states = std::mem::take(&mut self.states).into_iter();
        let mut next = |_| states.next().unwrap_or_default();
        let state = match Holders::of(scene) {
            Holders::Each => team.of_rank(0, &next(0)),
            Holders::Parts(_) => team.hand_out(&mut next),
        };
        let mut log = [self.log.count as u64, self.log.length, self.log.hash];
        if team.rank() > 0 {
            log = [0; 3];
        }
        team.sum_words(&mut log);
        let [count, length, hash] = log;
        let count = usize::try_from(count).expect("a number of steps in memory");
        let of = String::from_utf8_lossy(&team.of_rank(0, self.of.as_bytes())).into_owned();
        let (log, steps) = (Log { count, length, hash }, team.of_rank(0, &self.steps));
        Ok(Self { is_there: true, of, log, holders: None, states: vec![state], steps })
    }

    /// True where there is nothing to go on from.
    pub(super) fn is_empty(&self) -> bool {
        !self.is_there
    }
}

/// Reads the checkpoint in a folder; empty if there is none.
pub(super) fn read(folder: &FilePath) -> Result<Files, CheckpointError> {
    let bytes_of = |name: &str| {
        let path = folder.join(name);
        read_input(&path, InputKind::Results).map_err(|source| (path, source))
    };
    let state = match bytes_of(CHECKPOINT_FILE) {
        Ok(bytes) => bytes,
        Err((_, InputError::NotFound)) => return Ok(Files::default()),
        Err((path, source)) => return Err(CheckpointError::Read { path, source }),
    };
    let steps = bytes_of(LOG_FILE).map_err(|(path, source)| CheckpointError::Read { path, source })?;
    let damaged = |what| CheckpointError::Damaged { path: folder.join(CHECKPOINT_FILE), what };
    let head = read_head(&mut Reader::new(content(&state).map_err(damaged)?));
    Ok(Files { steps, ..head.map_err(|_| damaged("its content does not fit together"))? })
}

/// Whose checkpoint it is, and the states that it holds.
fn read_head(r: &mut Reader<'_>) -> Result<Files, Unreadable> {
    let (of, count) = (r.text()?, r.count()?);
    let log = Log { count, length: r.word()?, hash: r.word()? };
    let holders = match r.count()? {
        0 => Holders::Each,
        n => Holders::Parts(n),
    };
    let states = r.list(|r| Ok(r.all()?.to_vec()))?;
    r.end()?;
    Ok(Files { is_there: true, of, log, holders: Some(holders), states, steps: Vec::new() })
}

/// What a checkpoint in `folder` says.
pub(super) fn found(
    scene: &Solving<'_>,
    identity: Hash,
    folder: &FilePath,
    files: &Files,
) -> Result<Found, CheckpointError> {
    let path = folder.join(CHECKPOINT_FILE);
    let damaged = |what| CheckpointError::Damaged { path: path.clone(), what };
    let cut = |_: Unreadable| damaged("its content does not fit together");
    let [state] = files.states.as_slice() else { return Err(cut(Unreadable)) };
    let mut r = Reader::new(state);
    if files.of != identity.to_string() || r.count().map_err(cut)? != scene.system.numbering.n_dofs {
        return Err(damaged("it belongs to another run"));
    }
    let steps = read_log(folder, &files.steps, &files.log, files.log.count)?;
    found_in(&mut r, steps, files.log.clone()).map_err(cut)
}

/// The steps in the log, as far as the checkpoint knows them.
fn read_log(folder: &FilePath, bytes: &[u8], log: &Log, count: usize) -> Result<Vec<StepResult>, CheckpointError> {
    let path = folder.join(LOG_FILE);
    let damaged = |what| CheckpointError::Damaged { path: path.clone(), what };
    let length = usize::try_from(log.length).ok().filter(|n| *n <= bytes.len());
    let bytes = &bytes[..length.ok_or_else(|| damaged("it is shorter than the checkpoint says"))?];
    if hash(bytes) != log.hash {
        return Err(damaged("it is not the one of the checkpoint"));
    }
    let mut r = Reader::new(bytes);
    // not collected by count: a wrong one ends at the first step that is missing
    let mut steps = Vec::new();
    for _ in 0..count {
        steps.push(read_step(&mut r).map_err(|_| damaged("its content does not fit together"))?);
    }
    r.end().map_err(|_| damaged("its content does not fit together"))?;
    Ok(steps)
}

fn found_in(r: &mut Reader<'_>, steps: Vec<StepResult>, log: Log) -> Result<Found, Unreadable> {
    let (u, memory) = (r.numbers()?, read_memory(r)?);
    let [rate, velocity, acceleration] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
    let before = r.numbers()?;
    let factors = [rate, velocity, acceleration];
    let rates = RatesMemory { factors, before, kept: r.list(Reader::numbers)? };
    let solver = SolverMemory {
        factored: r.numbers()?,
        dense: r.flag()?,
        symmetric: r.flag()?,
        factorisations: r.count()?,
        spent: r.count()?,
        apart: r.list(Reader::small)?,
        single: r.flag()?,
        iterative: r.flag()?,
        reference: Reference { values: r.numbers()?, groups: r.list(|r| r.list(Reader::small))?, whole: r.count()? },
    };
    let (level, easy) = (r.small()?, r.small()?);
    let (adaptive, balance, friction) = (read_adaptive(r)?, read_balance(r)?, read_friction(r)?);
    let [assemble, factor, solve, write, check, measure] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
    let clock = Clock { assemble, factor, solve, write, check, measure };
    r.end()?;
    let state = RunState { u, memory, rates, solver, level, easy, adaptive, balance, friction };
    Ok(Found { steps, state, clock, log })
}

/// The content behind the header, if the file is whole.
fn content(bytes: &[u8]) -> Result<&[u8], &'static str> {
    if bytes.len() < HEADER || bytes[..8] != *MAGIC {
        return Err("it does not begin like one");
    }
    let number = |k: usize| bytes[8 * k..8 * k + 8].try_into().map_or(0, u64::from_le_bytes);
    let content = &bytes[HEADER..];
    if number(1) != FORMAT {
        return Err("its layout is that of another version of wfl");
    }
    match number(2).cmp(&(content.len() as u64)) {
        Ordering::Greater => return Err("it is cut short"),
        Ordering::Less => return Err("it is longer than it says"),
        Ordering::Equal => {}
    }
    if number(3) != hash(content) {
        return Err("its checksum is wrong");
    }
    Ok(content)
}

fn memory(w: &mut Writer, m: &Memory) {
    w.numbers(&m.changing);
    w.flag(m.contact.warm);
    for lists in [&m.contact.active, &m.contact.terms, &m.contact.converged, &m.states] {
        w.count(lists.len());
        lists.iter().for_each(|l| w.numbers(l));
    }
}

fn read_memory(r: &mut Reader<'_>) -> Result<Memory, Unreadable> {
    Ok(Memory {
        changing: r.numbers()?,
        contact: ContactMemory {
            warm: r.flag()?,
            active: r.list(Reader::numbers)?,
            terms: r.list(Reader::numbers)?,
            converged: r.list(Reader::numbers)?,
        },
        states: r.list(Reader::numbers)?,
    })
}

fn adaptive(w: &mut Writer, a: Option<&Adaptive>) {
    w.flag(a.is_some());
    let Some(a) = a else { return };
    let Control { next, order, last: [allowed, increment], failed } = a.control;
    w.numbers(&[next, allowed, increment]);
    w.count(order as usize);
    w.flag(failed);
    w.numbers(&a.start);
    w.numbers(&a.solved);
    w.numbers(&a.course);
    a.changes.iter().for_each(|changes| w.numbers(changes));
    w.numbers(&a.left);
    w.numbers(&a.uncertainty.sizes);
    w.count(a.uncertainty.held);
    w.flag(a.uncertainty.explains);
    w.numbers(&a.uncertainty.excused);
    w.numbers(&a.uncertainty.missed);
    w.numbers(&a.past.increments);
    w.count(a.past.solutions.len());
    a.past.solutions.iter().for_each(|s| w.numbers(s));
    balance(w, a.gained.as_ref().map(|gained| &gained.balance));
    w.numbers(&[a.gained.as_ref().map_or(0.0, |gained| gained.largest)]);
}

fn read_adaptive(r: &mut Reader<'_>) -> Result<Option<Adaptive>, Unreadable> {
    if !r.flag()? {
        return Ok(None);
    }
    let [next, allowed, increment] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
    let control = Control { next, order: r.small()?, last: [allowed, increment], failed: r.flag()? };
    let (start, solved, course) = (r.numbers()?, r.numbers()?, r.numbers()?);
    let changes = [r.numbers()?, r.numbers()?, r.numbers()?];
    let left = r.numbers()?;
    let (sizes, held, explains) = (r.numbers()?, r.count()?, r.flag()?);
    let uncertainty = Uncertainty { sizes, held, explains, excused: r.numbers()?, missed: r.numbers()? };
    let past = Past { increments: r.numbers()?, solutions: r.list(Reader::numbers)? };
    let balance = read_balance(r)?;
    let [largest] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
    let gained = balance.map(|balance| Gained { balance, largest });
    Ok(Some(Adaptive { control, past, start, solved, course, changes, left, uncertainty, gained }))
}

fn balance(w: &mut Writer, b: Option<&Balance>) {
    w.flag(b.is_some());
    let Some(b) = b else { return };
    [&b.kinetic[..], &b.works, &[b.prescribed], &b.total].iter().for_each(|numbers| w.numbers(numbers));
    w.count(b.forces.len());
    b.forces.iter().for_each(|f| w.numbers(f));
    w.count(b.free.len());
    b.free.iter().for_each(|f| w.numbers(f));
}

fn friction(w: &mut Writer, f: Option<&FrictionMemory>) {
    w.flag(f.is_some());
    let Some(f) = f else { return };
    for lists in [&f.rest, &f.lost] {
        w.count(lists.len());
        lists.iter().for_each(|l| w.numbers(l));
    }
}

fn read_friction(r: &mut Reader<'_>) -> Result<Option<FrictionMemory>, Unreadable> {
    if !r.flag()? {
        return Ok(None);
    }
    Ok(Some(FrictionMemory { rest: r.list(Reader::numbers)?, lost: r.list(Reader::numbers)? }))
}

fn read_balance(r: &mut Reader<'_>) -> Result<Option<Balance>, Unreadable> {
    if !r.flag()? {
        return Ok(None);
    }
    let kinetic = r.numbers()?.try_into().map_err(|_| Unreadable)?;
    let works = r.numbers()?;
    let [prescribed] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
    let total = r.numbers()?;
    let (forces, free) = (r.list(Reader::numbers)?, r.list(Reader::numbers)?);
    let fits = works.len() == forces.len() && free.len() == forces.len();
    if forces.is_empty() || !fits || forces.iter().any(|f| f.len() != total.len()) {
        return Err(Unreadable);
    }
    Ok(Some(Balance { kinetic, works, prescribed, forces, total, free }))
}
