//! Owned handles, checked codes, no raw pointer outside.
//!
//! MPI is started for one calling thread at a time (`MPI_THREAD_SERIALIZED`), and a run may call from any thread of its
//! pool: whoever calls holds the one [`Call`]. What is dropped is put aside and given back when the next call begins, in
//! the same order on all ranks; behind the end of the session nothing is given back.

use std::{
    ffi::{CStr, c_int},
    marker::PhantomData,
    ptr::{null, null_mut},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use wfl_host::team::Team;
use wfl_sparse::solve::Symmetry;

use crate::ffi;

/// Where the session is: `None` before its start and behind its end.
static DOOR: Mutex<Option<Ranks>> = Mutex::new(None);
/// Objects that nobody has any more.
static DROPPED: Mutex<Vec<Dropped>> = Mutex::new(Vec::new());

enum Dropped {
    Matrix(ffi::Mat),
    Solver(ffi::Solver),
}

// SAFETY: PETSc's objects belong to no thread; that one thread at a time calls is what `Call` is for.
unsafe impl Send for Dropped {}

fn put_aside(object: Dropped) {
    DROPPED.lock().unwrap_or_else(PoisonError::into_inner).push(object);
}

/// Gives back what was put aside; the door is held by the caller.
fn give_back() {
    let dropped = std::mem::take(&mut *DROPPED.lock().unwrap_or_else(PoisonError::into_inner));
    for object in dropped {
        match object {
            // SAFETY: nobody else has it: it was put aside when its owner was dropped; null is nothing to do.
            Dropped::Matrix(mut raw) => unsafe { ffi::wfl_matrix_free(&mut raw) },
            // SAFETY: as above; it is not null.
            Dropped::Solver(raw) => unsafe { ffi::wfl_solver_free(raw) },
        }
    }
}

/// This rank and their number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ranks {
    pub(crate) own: usize,
    pub(crate) all: usize,
    /// Every run on so many ranks has the same bits.
    pub(crate) repeat: bool,
}

/// What PETSc or MPI says of a call that failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Its text, with the function that it comes from.
    pub text: String,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "PETSc: {}", self.text)
    }
}

fn check(code: c_int) -> Result<(), Failure> {
    if code == 0 {
        return Ok(());
    }
    // SAFETY: the C side keeps a text that ends with zero for the life of the program.
    let text = unsafe { CStr::from_ptr(ffi::wfl_last_error()) }.to_string_lossy().into_owned();
    Err(Failure { text: if text.is_empty() { format!("error {code}") } else { text } })
}

fn door() -> MutexGuard<'static, Option<Ranks>> {
    DOOR.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A number as C has it.
fn c(n: usize) -> c_int {
    c_int::try_from(n).expect("sizes are checked when rows are distributed")
}

/// MPI and PETSc, from here to the end of this value. It stays on the thread that made it, as MPI wants.
pub struct Session {
    ranks: Ranks,
    _one_thread: PhantomData<*mut ()>,
}

impl Session {
    /// Starts both; once in the life of a program. A repeatable session gives the same bits in every run on as many ranks,
    /// at the price of a whole factor on each of them.
    ///
    /// # Errors
    /// [`Failure`] where they do not start, or were started before.
    pub fn start(is_repeatable: bool) -> Result<Self, Failure> {
        static STARTED: Mutex<bool> = Mutex::new(false);
        let mut started = STARTED.lock().unwrap_or_else(PoisonError::into_inner);
        if std::mem::replace(&mut *started, true) {
            return Err(Failure { text: "was started before in this program".to_owned() });
        }
        let mut open = door();
        let (mut rank, mut size) = (0, 0);
        // SAFETY: called once, before any other function of the C side; the numbers outlive the call.
        check(unsafe { ffi::wfl_start(is_repeatable.into(), &mut rank, &mut size) })?;
        let number = |n: c_int| usize::try_from(n).expect("ranks are counted from 0");
        let (own, all) = (number(rank), number(size));
        let ranks = Ranks { own, all, repeat: is_repeatable || all == 1 };
        *open = Some(ranks);
        Ok(Self { ranks, _one_thread: PhantomData })
    }

    /// Number of ranks of the run.
    #[must_use]
    pub fn size(&self) -> usize {
        self.ranks.all
    }

    /// Number of this rank, from 0.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.ranks.own
    }
}

/// The ranks of MPI. Its operations wait for calls of other threads of this rank.
#[derive(Debug)]
struct Mpi {
    ranks: Ranks,
}

/// Numbers in one message: counts of MPI have 32 bits.
const MOST: usize = 1 << 27;

impl Team for Mpi {
    fn rank(&self) -> usize {
        self.ranks.own
    }

    fn size(&self) -> usize {
        self.ranks.all
    }

    fn sum(&self, values: &mut [f64]) {
        let _call = Call::begin().expect("a session lives as long as its ranks assemble");
        for part in values.chunks_mut(MOST) {
            // SAFETY: so many numbers, written in place; the call is held.
            unsafe { ffi::wfl_sum(part.as_mut_ptr(), c(part.len())) };
        }
    }

    fn sum_words(&self, words: &mut [u64]) {
        let _call = Call::begin().expect("a session lives as long as its ranks assemble");
        for part in words.chunks_mut(MOST) {
            // SAFETY: as above; unsigned overflow is defined in C.
            unsafe { ffi::wfl_sum_words(part.as_mut_ptr(), c(part.len())) };
        }
    }

    fn max_words(&self, words: &mut [u64]) {
        let _call = Call::begin().expect("a session lives as long as its ranks assemble");
        for part in words.chunks_mut(MOST) {
            // SAFETY: as above.
            unsafe { ffi::wfl_max_words(part.as_mut_ptr(), c(part.len())) };
        }
    }

    fn exchange(&self, sends: &[(usize, Vec<u64>)], from: &[(usize, usize)]) -> Vec<Vec<u64>> {
        let _call = Call::begin().expect("a session lives as long as its ranks assemble");
        let mut received: Vec<Vec<u64>> = from.iter().map(|(_, n)| vec![0; *n]).collect();
        let (mut messages, mut before) = (Vec::new(), 0);
        let lengths = sends.iter().map(|(_, words)| words.len()).chain(from.iter().map(|(_, n)| *n));
        let longest = lengths.max().unwrap_or(0);
        // a long message comes in parts, of which both sides know
        while before < longest {
            messages.clear();
            let part = |n: usize| before.min(n)..n.min(before + MOST);
            for (rank, words) in sends {
                let words = &words[part(words.len())];
                messages.push(ffi::Message { rank: c(*rank), n: c(words.len()), to: null_mut(), from: words.as_ptr() });
            }
            for ((rank, _), words) in from.iter().zip(&mut received) {
                let range = part(words.len());
                let words = &mut words[range];
                messages.push(ffi::Message { rank: c(*rank), n: c(words.len()), to: words.as_mut_ptr(), from: null() });
            }
            messages.retain(|message| message.n > 0);
            // SAFETY: each message has so many words to read or to write, which outlive the call; none is of two messages.
            unsafe { ffi::wfl_exchange(messages.as_ptr(), c(messages.len())) };
            before += MOST;
        }
        received
    }
}

impl Session {
    /// The ranks of the run, to share a system out over.
    #[must_use]
    pub fn team(&self) -> Arc<dyn Team> {
        Arc::new(Mpi { ranks: self.ranks })
    }

    /// Gives memory that is not used any more back to the system: what the allocator of C keeps counts for this rank
    /// however little of it is used again.
    pub fn trim_memory(&self) {
        // SAFETY: changes nothing that is in use.
        unsafe { ffi::wfl_trim_memory() };
    }

    /// Ends the run on all ranks at once: what one of them cannot go on with the others would wait for. Does not return
    /// where there are several; one rank alone has nobody to wait for it.
    pub fn abort(self, code: u8) {
        if self.ranks.all > 1 {
            // SAFETY: MPI runs as long as the session lives.
            unsafe { ffi::wfl_abort(code.into()) };
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        if std::thread::panicking() && self.ranks.all > 1 {
            // SAFETY: as above; the others would wait at the end of MPI.
            unsafe { ffi::wfl_abort(101) };
        }
        let mut open = door();
        give_back();
        *open = None;
        // SAFETY: nothing calls the C side behind this: every call looks at the door first.
        unsafe { ffi::wfl_finish() };
    }
}

/// The right to call, while it lives.
pub(crate) struct Call {
    open: MutexGuard<'static, Option<Ranks>>,
}

impl Call {
    /// Waits for the other threads of this rank.
    pub(crate) fn begin() -> Result<Self, Failure> {
        let open = door();
        if open.is_none() {
            return Err(Failure { text: "is not running: no session was started, or it has ended".to_owned() });
        }
        give_back();
        Ok(Self { open })
    }

    pub(crate) fn ranks(&self) -> Ranks {
        self.open.expect("looked at when the call began")
    }
}

/// A square sparse matrix, rows by rank.
pub(crate) struct Matrix {
    raw: ffi::Mat,
}

// SAFETY: as for `Dropped`.
unsafe impl Send for Matrix {}

impl Matrix {
    /// With room for the entries of the rows of this rank: by row those in columns of this rank and of others.
    pub(crate) fn new(_call: &Call, room: [&[i32]; 2], block: usize, symmetry: Symmetry) -> Result<Self, Failure> {
        let [own, others] = room;
        assert_eq!(own.len(), others.len(), "numbers of entries by row");
        let mut this = Self { raw: null_mut() };
        let (n, own, others) = (c(own.len()), own.as_ptr(), others.as_ptr());
        let is_symmetric = symmetry == Symmetry::Symmetric;
        // SAFETY: both lists have a number for each row; PETSc copies them.
        check(unsafe { ffi::wfl_matrix_new(n, c(block), is_symmetric.into(), own, others, &mut this.raw) })?;
        Ok(this)
    }

    /// Takes the values of one row; [`Self::finish`] follows the last one.
    pub(crate) fn put(&mut self, _call: &Call, row: i32, columns: &[i32], values: &[f64]) -> Result<(), Failure> {
        assert_eq!(values.len(), columns.len(), "a value for each entry");
        // SAFETY: the handle is alive; so many columns and values, which PETSc copies.
        check(unsafe { ffi::wfl_matrix_put(self.raw, row, c(values.len()), columns.as_ptr(), values.as_ptr()) })
    }

    /// Puts what was taken in order; on all ranks.
    pub(crate) fn finish(&mut self, _call: &Call) -> Result<(), Failure> {
        // SAFETY: the handle is alive.
        check(unsafe { ffi::wfl_matrix_finish(self.raw) })
    }

    /// Tells `k` motions without energy, each with a number for every row of this rank, one behind the other; on all ranks.
    pub(crate) fn set_modes(&mut self, _call: &Call, k: usize, modes: &[f64]) -> Result<(), Failure> {
        let n_rows = modes.len().checked_div(k).unwrap_or(0);
        assert_eq!(modes.len(), k * n_rows, "a number for each row");
        // SAFETY: the handle is alive; k vectors of so many numbers, as many as the matrix has rows here.
        check(unsafe { ffi::wfl_matrix_set_modes(self.raw, c(n_rows), c(k), modes.as_ptr()) })
    }
}

impl Drop for Matrix {
    fn drop(&mut self) {
        put_aside(Dropped::Matrix(self.raw));
    }
}

/// The preconditioner and method of a [`Solver`], by the prefix of its options in `shim.c`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Lu,
    Cholesky,
    ConjugateGradients,
    Gmres,
}

impl Kind {
    fn prefix(self) -> &'static CStr {
        match self {
            Self::Lu => c"wfl_lu_",
            Self::Cholesky => c"wfl_cholesky_",
            Self::ConjugateGradients => c"wfl_cg_",
            Self::Gmres => c"wfl_gmres_",
        }
    }

    pub(crate) fn is_direct(self) -> bool {
        matches!(self, Self::Lu | Self::Cholesky)
    }
}

/// What the levels of multigrid are made of.
pub(crate) enum Levels {
    /// They stay, or there are none.
    Kept,
    /// The matrix that is solved with.
    OfItself,
    /// Another matrix.
    Of(Matrix),
}

/// What makes levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cycle {
    /// Smoothed aggregation, of PETSc.
    Gamg,
    /// Classical multigrid, of hypre.
    BoomerAmg,
}

impl Cycle {
    /// The prefix of its options.
    fn prefix(self) -> &'static CStr {
        match self {
            Self::Gamg => c"wfl_cycle_",
            Self::BoomerAmg => c"wfl_boomeramg_",
        }
    }

    /// Whether the PETSc of this program has it.
    pub(crate) fn exists(self) -> bool {
        // SAFETY: a constant of the C side.
        self == Self::Gamg || unsafe { ffi::wfl_has_boomeramg() } != 0
    }
}

/// What became of a matrix that was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Taken {
    /// 0, or PETSc's reason why a factor could not be made.
    pub(crate) reason: i32,
    pub(crate) null_pivots: i32,
}

/// What became of a solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ended {
    pub(crate) iterations: usize,
    /// PETSc's reason: positive where the iteration converged.
    pub(crate) reason: i32,
}

/// A Krylov method or a factor for one matrix. Both are kept here, so that the one outlives the other.
pub(crate) struct Solver {
    raw: ffi::Solver,
    a: Matrix,
}

// SAFETY: as for `Dropped`.
unsafe impl Send for Solver {}

impl Solver {
    /// `contact` are PETSc's numbers of the rows of this rank that are solved directly after a cycle; `None` for no filter.
    pub(crate) fn new(_call: &Call, kind: Kind, a: Matrix, contact: Option<&[i32]>) -> Result<Self, Failure> {
        let mut this = Self { raw: null_mut(), a };
        let own = contact.unwrap_or_default();
        let (prefix, direct, has) = (kind.prefix().as_ptr(), kind.is_direct().into(), contact.is_some().into());
        let (n, a, numbers) = (c(own.len()), this.a.raw, own.as_ptr());
        // SAFETY: the matrix lives as long as the solver; the numbers are copied.
        check(unsafe { ffi::wfl_solver_new(prefix, direct, a, n, numbers, has, &mut this.raw) })?;
        Ok(this)
    }

    /// The matrix, to be given new values; [`Self::take`] follows.
    pub(crate) fn matrix(&mut self) -> &mut Matrix {
        &mut self.a
    }

    /// Takes the values that the matrix has now, and makes the levels anew where they are due.
    pub(crate) fn take(&mut self, _call: &Call, levels: &Levels, cycle: Cycle) -> Result<Taken, Failure> {
        let mut taken = Taken { reason: 0, null_pivots: 0 };
        let levels = match levels {
            Levels::Kept => null_mut(),
            Levels::OfItself => self.a.raw,
            Levels::Of(matrix) => matrix.raw,
        };
        // SAFETY: handles are alive; PETSc counts its own references to the matrix of the levels.
        check(unsafe {
            let cycle = cycle.prefix().as_ptr();
            ffi::wfl_solver_take(self.raw, levels, cycle, &mut taken.reason, &mut taken.null_pivots)
        })?;
        Ok(taken)
    }

    /// Solves for the rows of this rank.
    pub(crate) fn solve(
        &mut self,
        _call: &Call,
        b: &[f64],
        x: &mut [f64],
        tolerance: f64,
        most: usize,
    ) -> Result<Ended, Failure> {
        assert_eq!(b.len(), x.len(), "one equation for each unknown");
        let (mut iterations, mut reason) = (0, 0);
        let (n, most) = (c(b.len()), c(most));
        // SAFETY: both slices have so many numbers, as many as the matrix has rows on this rank.
        let code = unsafe {
            let (b, x) = (b.as_ptr(), x.as_mut_ptr());
            ffi::wfl_solver_solve(self.raw, n, b, x, tolerance, most, &mut iterations, &mut reason)
        };
        check(code)?;
        Ok(Ended { iterations: usize::try_from(iterations).unwrap_or(0), reason })
    }
}

impl Drop for Solver {
    fn drop(&mut self) {
        if !self.raw.is_null() {
            put_aside(Dropped::Solver(self.raw));
        }
    }
}
