//! A solver of PETSc for the matrices of one scene, with the more robust methods behind the first one.
//!
//! Multigrid: the levels are made of the first matrix of a step, contact included; those of an earlier step serve on where
//! runs need not have the same bits. Levels of the bodies alone know no
//! smooth motion that contact holds, and take two to three times as many iterations; what is left of large penalty or
//! augmentation parameters the filter takes, so the number of iterations hardly depends on them. The levels are made anew
//! of the present matrix where an iteration does not end, or becomes [`SLOWER`] times as slow; after that BoomerAMG makes
//! levels, and then a factor of MUMPS takes over. Promises: what is decided follows from numbers that all ranks have, and after [`Engine::restart`]
//! from later matrices alone.

use std::sync::Arc;

use wfl_host::team::{Alone, Team};
use wfl_sparse::{
    csr::Csr,
    index::NONE,
    solve::{Engine, Equations, NearNullSpace, NodeLayout, RowOwners, SolveError, Symmetry},
};

use crate::{
    method::{Choice, Method, in_words, method},
    objects::{Call, Cycle, Failure, Kind, Levels, Matrix, Solver},
    rows::{Numbers, Rows, middle_of_diagonal},
};

/// Iterations of one solution; a factor costs less than more of them wherever it fits into the memory.
const MOST: usize = 500;
/// Iterations for a digit, relative to those of the first solution with the same levels, that new levels are worth.
const SLOWER: f64 = 3.0;
/// Fewer iterations for a digit are never slow.
const FEW: f64 = 3.0;
/// A solution to fewer digits says little about the levels.
const TELLING: f64 = 1e-4;

impl From<Failure> for SolveError {
    fn from(failure: Failure) -> Self {
        Self::Library { text: failure.to_string() }
    }
}

/// See the module documentation.
pub(crate) struct PetscEngine {
    choice: Choice,
    equations: Arc<Equations>,
    symmetry: Symmetry,
    /// That of the present matrix; a factor where multigrid gave up.
    method: Method,
    /// What makes the levels of multigrid; another one where the first gave up.
    cycle: Cycle,
    /// Rows of a node.
    block: usize,
    /// What the points of nodes are measured from and by.
    extent: ([f64; 3], f64),
    numbers: Numbers,
    /// What stands on the diagonal of rows that are not solved for; none before the first matrix of an attempt.
    unit: Option<f64>,
    solver: Option<Solver>,
    has_levels: bool,
    /// The levels are of the matrix that was taken last.
    are_new: bool,
    /// New levels are due.
    is_slow: bool,
    /// Iterations for a digit of the first telling solution with these levels.
    rate: Option<f64>,
    own: Vec<f64>,
    counts: Counts,
}

/// What was done so far.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    iterations: usize,
    solutions: usize,
    levels: usize,
    of_boomeramg: usize,
    factors_instead: usize,
}

impl PetscEngine {
    pub(crate) fn new(choice: Choice, equations: &Arc<Equations>, symmetry: Symmetry) -> Result<Self, SolveError> {
        let owners = equations.owners.as_ref();
        if Call::begin()?.ranks().all != owners.map_or(1, |owners| owners.team.size()) {
            return Err(SolveError::Internal { what: "equations that are not shared out over the ranks" });
        }
        let (method, _) = method(choice, &equations.traits);
        let (block, numbers) = match (method, &equations.layout) {
            (Method::Multigrid, Some(layout)) => {
                let components = layout.components;
                (components, Numbers::new(&layout.places, components, owners)?)
            }
            _ => (1, in_order(equations.n_rows(), owners)?),
        };
        let own = vec![0.0; numbers.part.n_own()];
        let team: &dyn Team = owners.map_or(&Alone, |owners| &*owners.team);
        let extent = equations.layout.as_ref().map_or(([0.0; 3], 1.0), |layout| layout.extent(team));
        Ok(Self {
            choice,
            equations: Arc::clone(equations),
            symmetry,
            method,
            cycle: Cycle::Gamg,
            block,
            extent,
            numbers,
            unit: None,
            solver: None,
            has_levels: false,
            are_new: false,
            is_slow: false,
            rate: None,
            own,
            counts: Counts::default(),
        })
    }

    fn kind(&self) -> Kind {
        match (self.method, self.symmetry) {
            (Method::Direct, Symmetry::Symmetric) => Kind::Cholesky,
            (Method::Direct, Symmetry::General) => Kind::Lu,
            (Method::Multigrid, Symmetry::Symmetric) if self.equations.traits.on_contact == 0 => {
                Kind::ConjugateGradients
            }
            (Method::Multigrid, _) => Kind::Gmres,
        }
    }

    /// Hands the values of a matrix to PETSc: all of them to a new solver, then those that change. Makes levels where they
    /// are due, or the factor.
    fn load(&mut self, call: &Call, changing: &Csr) -> Result<(), SolveError> {
        let (equations, kind) = (Arc::clone(&self.equations), self.kind());
        let parts = [&*equations.constant, changing];
        let unit = self.unit.ok_or(SolveError::NotFactored)?;
        if let Some(solver) = &mut self.solver {
            let mut rows = Rows::new(&self.numbers, parts, &[], unit);
            put(call, solver.matrix(), &mut rows, |rows, k| rows.changes(k))?;
        } else {
            let a = self.matrix(call, parts, &[], unit)?;
            let contact = self.numbers.own_of(&equations.on_contact);
            let filtered = !kind.is_direct() && equations.traits.on_contact > 0;
            self.solver = Some(Solver::new(call, kind, a, filtered.then_some(contact.as_slice()))?);
        }
        let levels = self.levels(call, parts, unit)?;
        let solver = self.solver.as_mut().expect("made above");
        let taken = solver.take(call, &levels, self.cycle)?;
        if taken.null_pivots > 0 {
            return Err(SolveError::VanishingPivot { dof: 0, ratio: 0.0 });
        }
        match taken.reason {
            0 => Ok(()),
            // PC_FACTOR_STRUCT_ZEROPIVOT, PC_FACTOR_NUMERIC_ZEROPIVOT
            1 | 2 => Err(SolveError::VanishingPivot { dof: 0, ratio: 0.0 }),
            3 => Err(SolveError::Library { text: "PETSc: MUMPS has too little memory for the factor".to_owned() }),
            other => Err(SolveError::Library { text: format!("PETSc: no factor (reason {other})") }),
        }
    }

    /// A matrix with its values.
    fn matrix(&self, call: &Call, parts: [&Csr; 2], hidden: &[u32], unit: f64) -> Result<Matrix, SolveError> {
        let mut rows = Rows::new(&self.numbers, parts, hidden, unit);
        let [own, others] = rows.room();
        let mut matrix = Matrix::new(call, [&own, &others], self.block, self.symmetry)?;
        put(call, &mut matrix, &mut rows, |_, _| true)?;
        Ok(matrix)
    }

    /// What new levels are made of, where they are due: the matrix itself, but for multipliers, which have no stiffness.
    fn levels(&mut self, call: &Call, parts: [&Csr; 2], unit: f64) -> Result<Levels, SolveError> {
        self.are_new = false;
        if self.method == Method::Direct || (self.has_levels && !self.is_slow) {
            return Ok(Levels::Kept);
        }
        let equations = Arc::clone(&self.equations);
        let Some(layout) = &equations.layout else { return Ok(Levels::Kept) };
        let mut levels = match equations.traits.multipliers {
            0 => Levels::OfItself,
            _ => Levels::Of(self.matrix(call, parts, &equations.multipliers, unit)?),
        };
        if layout.modes == NearNullSpace::RigidBody {
            let (modes, k) = (self.modes(layout), layout.n_modes());
            match (&mut levels, &mut self.solver) {
                (Levels::Of(matrix), _) => matrix.set_modes(call, k, &modes)?,
                (_, Some(solver)) => solver.matrix().set_modes(call, k, &modes)?,
                _ => {}
            }
        }
        (self.has_levels, self.are_new, self.is_slow, self.rate) = (true, true, false, None);
        self.counts.levels += 1;
        self.counts.of_boomeramg += usize::from(self.cycle == Cycle::BoomerAmg);
        Ok(levels)
    }

    /// Rigid motions at the rows of this rank, one behind the other; none at multipliers.
    fn modes(&self, layout: &NodeLayout) -> Vec<f64> {
        let (values, k) = (layout.mode_values(self.extent), layout.n_modes());
        let is_multiplier = |row: u32| self.equations.multipliers.binary_search(&row).is_ok();
        let mut modes = Vec::with_capacity(k * self.numbers.own_rows.len());
        for mode in 0..k {
            for (place, row) in self.numbers.own_places.iter().zip(&self.numbers.own_rows) {
                modes.push(if is_multiplier(*row) { 0.0 } else { values[*place as usize * k + mode] });
            }
        }
        modes
    }

    /// Solves for the rows of this rank, with another method where one does not end.
    fn solve_own(
        &mut self,
        call: &Call,
        changing: &Csr,
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
    ) -> Result<(), SolveError> {
        let before = self.counts.iterations;
        loop {
            if let Some(iterations) = self.attempt(call, rhs, x, tolerance)? {
                self.learn(iterations, tolerance);
                return Ok(());
            }
            self.turn_to_next(call, changing, tolerance, before)?;
        }
    }

    /// One solution with the present method: iterations, or `None` where it did not end.
    fn attempt(
        &mut self,
        call: &Call,
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
    ) -> Result<Option<usize>, SolveError> {
        let b: Vec<f64> =
            self.numbers.own_rows.iter().map(|row| if *row == NONE { 0.0 } else { rhs[*row as usize] }).collect();
        let solver = self.solver.as_mut().ok_or(SolveError::NotFactored)?;
        let ended = solver.solve(call, &b, &mut self.own, tolerance, MOST)?;
        self.counts.iterations += if self.method == Method::Direct { 0 } else { ended.iterations };
        if ended.reason <= 0 {
            return Ok(None);
        }
        for (row, value) in self.numbers.own_rows.iter().zip(&self.own).filter(|(row, _)| **row != NONE) {
            x[*row as usize] = *value;
        }
        Ok(Some(ended.iterations))
    }

    /// Learns from a solution how good the levels are.
    fn learn(&mut self, iterations: usize, tolerance: f64) {
        if self.method == Method::Direct || tolerance > TELLING {
            return;
        }
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let rate = (iterations as f64 / -tolerance.log10()).max(FEW);
        let first = *self.rate.get_or_insert(rate);
        self.is_slow |= rate > SLOWER * first;
    }

    /// Whether every run has the same bits, one that is continued, too: then what was learned in earlier steps is forgotten.
    fn repeats(&self) -> bool {
        Call::begin().is_ok_and(|call| call.ranks().repeat)
    }

    /// Turns to the next method that can be made after one that did not end.
    fn turn_to_next(&mut self, call: &Call, changing: &Csr, tolerance: f64, before: usize) -> Result<(), SolveError> {
        loop {
            if !self.fall_back() {
                let iterations = self.counts.iterations - before;
                return Err(SolveError::Library {
                    text: format!("PETSc: no solution to {tolerance:.1e}, {iterations} iterations and a factor"),
                });
            }
            match self.load(call, changing) {
                // another library, which may refuse what is no matrix of a body
                Err(_) if self.cycle == Cycle::BoomerAmg && self.method == Method::Multigrid => {}
                other => return other,
            }
        }
    }

    /// Turns to the next method after one that did not end; false if there is none.
    fn fall_back(&mut self) -> bool {
        if self.method == Method::Direct {
            return false;
        }
        if self.are_new && self.cycle == Cycle::Gamg && Cycle::BoomerAmg.exists() {
            self.cycle = Cycle::BoomerAmg;
            self.has_levels = false;
        } else if self.are_new {
            self.method = Method::Direct;
            (self.solver, self.has_levels) = (None, false);
            self.counts.factors_instead += 1;
        } else {
            self.is_slow = true;
        }
        true
    }
}

/// Puts some rows into a matrix.
fn put(
    call: &Call,
    matrix: &mut Matrix,
    rows: &mut Rows<'_>,
    which: impl Fn(&Rows<'_>, usize) -> bool,
) -> Result<(), SolveError> {
    for k in 0..rows.len() {
        if which(rows, k) {
            let (row, columns, values) = rows.row(k);
            matrix.put(call, row, columns, values)?;
        }
    }
    Ok(matrix.finish(call)?)
}

/// Rows in their order: for factors, which have an order of their own.
fn in_order(n: usize, owners: Option<&RowOwners>) -> Result<Numbers, SolveError> {
    let places: Vec<u32> = (0..u32::try_from(n).map_err(|_| SolveError::TooLarge { what: "the matrix" })?).collect();
    Numbers::new(&places, 1, owners)
}

impl Engine for PetscEngine {
    fn take(&mut self, changing: &Csr) -> Result<(), SolveError> {
        // other ranks are waited for before the right to call is taken
        let parts = [&*self.equations.constant, changing];
        let owners = self.equations.owners.as_ref();
        self.unit = self.unit.or_else(|| Some(middle_of_diagonal(parts, owners)));
        self.load(&Call::begin()?, changing)
    }

    fn solve(&mut self, changing: &Csr, rhs: &[f64], x: &mut [f64], tolerance: f64) -> Result<usize, SolveError> {
        let before = self.counts.iterations;
        self.counts.solutions += 1;
        self.solve_own(&Call::begin()?, changing, rhs, x, tolerance)?;
        // other ranks are heard after the right to call is given back
        if let Some(owners) = &self.equations.owners {
            owners.update(x);
        }
        Ok(self.counts.iterations - before)
    }

    fn restart(&mut self) {
        let (first, _) = method(self.choice, &self.equations.traits);
        if self.method != first || self.cycle != Cycle::Gamg {
            self.cycle = Cycle::Gamg;
            (self.method, self.solver, self.has_levels, self.is_slow, self.rate) = (first, None, false, false, None);
        }
        if self.repeats() {
            (self.has_levels, self.are_new, self.is_slow, self.rate) = (false, false, false, None);
            self.unit = None;
        }
    }

    fn describe(&self) -> String {
        let Counts { iterations, solutions, levels, of_boomeramg, factors_instead } = self.counts;
        let mut text = in_words(self.choice, &self.equations.traits);
        if levels > 0 {
            text.push_str(&format!("; {iterations} iterations in {solutions} solutions, levels made {levels} times"));
        }
        if of_boomeramg > 0 {
            text.push_str(&format!(", {of_boomeramg} of them by BoomerAMG in place of GAMG"));
        }
        if factors_instead > 0 {
            text.push_str(&format!("; a factor in place of iterations {factors_instead} times"));
        }
        text
    }
}
