//! What linear solvers are foreseen to take, by formulas whose constants each way of solving has measured for itself.
//!
//! A factor in three dimensions grows with the planes that cut a body (George 1973): its bytes with the power 4/3 of the number
//! of unknowns, its time with a power about 2. Levels of multigrid and iterations grow as the unknowns do. Does not choose.

use wfl_discrete::system::System;
use wfl_host::memory::claim;
use wfl_sparse::solve::LinearMethod;

/// Number of unknowns, in three dimensions, at which the constants were measured: as many as a factor in three dimensions takes
/// seconds for.
const REFERENCE: f64 = 1e5;

/// Number of unknowns below which a factor is never too large: at most half a gigabyte.
const LEAST: usize = 30_000;

/// What is to be done: factors or levels that are made, and solutions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Work {
    pub(super) made: f64,
    pub(super) solutions: f64,
}

/// What factors took for [`REFERENCE`] unknowns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factors {
    /// Bytes for each unknown; they grow with the third root of the number of unknowns.
    pub(super) bytes: f64,
    /// Seconds of one, and the power of the number of unknowns they grow with.
    pub(super) seconds: f64,
    pub(super) power: f64,
    /// Seconds of a solution, which reads the factor twice and grows as its bytes do.
    pub(super) solution: f64,
}

/// What an iteration took for as many.
#[derive(Clone, Copy, Debug)]
pub(super) struct Iteration {
    /// Bytes for each unknown.
    pub(super) bytes: f64,
    /// Seconds in which the levels are made, and of a solution; both grow as the unknowns do.
    pub(super) levels: f64,
    pub(super) solution: f64,
}

/// Two ways to solve the same systems.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ways {
    pub(super) factors: Factors,
    pub(super) iteration: Iteration,
    /// Number of unknowns below which factors are not left for their time.
    pub(super) small: usize,
}

/// What a method is foreseen to take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cost {
    pub(super) seconds: f64,
    pub(super) bytes: f64,
}

impl Cost {
    /// The bytes as a need.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size in bytes")]
    pub(super) fn size(self) -> u64 {
        self.bytes as u64
    }
}

#[expect(clippy::cast_precision_loss, reason = "counts")]
impl Ways {
    /// What factors are foreseen to take.
    pub(super) fn by_factors(&self, n: usize, work: Work) -> Cost {
        let Factors { bytes, seconds, power, solution } = self.factors;
        let size = n as f64 / REFERENCE;
        let seconds = work.made * seconds * size.powf(power) + work.solutions * solution * size.powf(4.0 / 3.0);
        Cost { seconds, bytes: bytes * n as f64 * size.cbrt() }
    }

    /// What the iteration is foreseen to take.
    pub(super) fn by_iteration(&self, n: usize, work: Work) -> Cost {
        let Iteration { bytes, levels, solution } = self.iteration;
        let seconds = (work.made * levels + work.solutions * solution) * (n as f64 / REFERENCE);
        Cost { seconds, bytes: bytes * n as f64 }
    }

    /// Whether factors are left for the iteration: where it is asked for, or by itself in three dimensions where it is the better way.
    pub(super) fn are_left(&self, method: LinearMethod, system: &System, work: [Work; 2]) -> bool {
        let n = system.n_unknowns();
        match method {
            LinearMethod::Direct => false,
            LinearMethod::Iterative => true,
            LinearMethod::Auto => system.mesh.dim() == 3 && n >= LEAST && self.prefer_iteration(n, work),
        }
    }

    /// Whether the iteration is the better way, from what factors and the iteration have to do: it is foreseen to be faster, or
    /// no factor fits into the memory.
    pub(super) fn prefer_iteration(&self, n: usize, work: [Work; 2]) -> bool {
        let (factors, iteration) = (self.by_factors(n, work[0]), self.by_iteration(n, work[1]));
        let pays = n >= self.small && iteration.seconds < factors.seconds;
        pays || claim(factors.size(), "the factor of the matrix").is_err()
    }
}
