//! All levels, and one cycle over them.
//!
//! The finest level is of single precision: it is the largest, and a product with it takes as long as its bytes are
//! read. Coarser ones are of double precision, since the softest motions of thin bodies, far below the rounding of
//! single precision, must survive there. The coarsest is factored.
//!
//! Promises: a cycle is the same symmetric operator every time, up to rounding, with the same bits for any number of
//! threads.

use wfl_host::team::Alone;

use super::aggregate::aggregates;
use super::blocks::{Blocks, Real, Rows, Transfer};
use super::level::{Level, Product, inverted_blocks, inverted_diagonal};
use super::nodes::{NodeLayout, NodeRows};
use super::operator::{Finest, OperatorLevels};
use super::prolongation::{Coarsened, interpolated, smoothed};
use crate::csr::{Csr, Pattern};
use crate::solve::SolveError;
use crate::solve::factorization::Factorization;
use crate::solve::llt::Llt;
use crate::solve::triangular_solve::Transpose;

/// Unknowns that are factored: a dense factor of so many takes 0.1 s and 32 MB.
const COARSEST: usize = 2000;
/// Couplings below this part of the largest of their nodes are weak; halved from level to level (Vanek, Mandel and Brezina
/// 1996). Measured on cubes of tetrahedra whose cells are 10 times as long as wide: 17 iterations, and 85 with 0.15; on
/// cubes 16, and 15 with 0.4 in twice the memory.
const WEAK: f64 = 0.25;
/// A coarser level with more than this part of the unknowns does not pay: the matrix is factored then.
const SHRINKS: f64 = 0.7;

/// Unknowns of a coarser level for each of the finer one, at most, where groups can be made that large: cells that are thin
/// in one direction couple nodes along lines, three to a group, and six motions of each are no fewer unknowns.
const LARGEST_SHARE: f64 = 0.3;
/// Part of the diagonal that is added to a coarsest matrix that looks singular, to look for its null vector: little, so
/// that inverse iteration converges at once.
const SHIFT: f64 = 1e-9;
/// Steps of inverse iteration for it.
const INVERSE_ITERATIONS: usize = 3;

/// A level that is not the coarsest, with the way down from it.
struct Step<T, A> {
    level: Level<T, A>,
    transfer: Transfer<T>,
    /// Right-hand side, solution and residual of the level.
    b: Vec<T>,
    x: Vec<T>,
    residual: Vec<T>,
}

/// A level between the finest and the coarsest.
type Middle = Step<f64, Blocks<f64>>;

/// The levels of a matrix.
pub(super) struct Hierarchy {
    finest: Option<Step<f32, Finest>>,
    middle: Vec<Middle>,
    coarsest: Coarsest,
    /// Number of unknowns by level.
    sizes: Vec<usize>,
    /// Where the coarsest matrix looks singular: its softest motion, by place of the finest level.
    softest: Option<Vec<f64>>,
}

/// How levels are aggregated.
struct Aggregation {
    /// Unknowns of a coarser node.
    k: usize,
    /// Couplings below this part of the largest are weak.
    threshold: f64,
}

/// Most groups of nodes of a level, `k` unknowns each.
fn most(a: &dyn Rows, k: usize) -> usize {
    (LARGEST_SHARE * (a.n_nodes() * a.size()) as f64 / k as f64) as usize
}

/// The coarsest level.
struct Coarsest {
    factor: Llt,
    /// Right-hand side and solution.
    x: Vec<f64>,
    suspicion: Option<Suspicion>,
}

/// A coarsest matrix that may be singular.
struct Suspicion {
    matrix: Csr,
    /// Why it has no factor; `None` where it has one, with a tiny pivot.
    error: Option<SolveError>,
}

impl Coarsest {
    fn new(a: &dyn Rows) -> Result<Self, SolveError> {
        let (n, size) = (a.n_nodes(), a.size());
        let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        let mut buffer = super::blocks::RowBuffer::default();
        for node in 0..n {
            let (of_row, blocks) = a.row(node, &mut buffer);
            for c in 0..size {
                for (column, block) in of_row.iter().zip(blocks.chunks_exact(size * size)) {
                    columns.extend((0..size as u32).map(|d| column * size as u32 + d));
                    values.extend_from_slice(&block[c * size..][..size]);
                }
                starts.push(columns.len());
            }
        }
        let matrix = Csr::new(Pattern::new(n * size, n * size, starts, columns)?.into(), values)?;
        let mut factor = Llt::analyze(matrix.pattern(), None, rayon::current_num_threads())?;
        let suspicion = match factor.factor(&matrix) {
            Ok(pivot) => pivot.is_suspicious().then_some(Suspicion { matrix, error: None }),
            Err(error @ SolveError::NotPositiveDefinite { .. }) => Some(Suspicion { matrix, error: Some(error) }),
            Err(error) => return Err(error),
        };
        Ok(Self { x: vec![0.0; n * size], factor, suspicion })
    }

    /// Where the matrix looks singular, its softest motion: inverse iteration with the factor of a matrix with a larger
    /// diagonal, in the norm of what was added, so that a null vector of the one is found by the other.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] where the matrix is not even semi-definite.
    fn softest_motion(&mut self) -> Result<Option<Vec<f64>>, SolveError> {
        let Some(suspicion) = &self.suspicion else { return Ok(None) };
        let mut shifted = suspicion.matrix.clone();
        let diagonal: Vec<f64> = (0..shifted.n_rows()).map(|row| shifted.get(row, row).abs()).collect();
        for (row, size) in diagonal.iter().enumerate() {
            if !shifted.add_to(row, row, SHIFT * size) {
                return Err(SolveError::NotPositiveDefinite { dof: 0, pivot: 0.0 });
            }
        }
        self.factor.factor(&shifted)?;
        // golden-ratio numbers: fixed, and orthogonal to no vector in particular
        let start = |i: usize| (i as f64 * 0.618_033_988_749_894_9).fract() - 0.5;
        let mut motion: Vec<f64> = (1..=diagonal.len()).map(start).collect();
        for _ in 0..INVERSE_ITERATIONS {
            motion.iter_mut().zip(&diagonal).for_each(|(value, size)| *value *= size);
            self.factor.solve(Transpose::No, &mut motion);
            let size = crate::norm::largest(motion.iter().copied());
            motion.iter_mut().for_each(|value| *value /= size);
        }
        Ok(Some(motion))
    }
}

impl<T: Real, A: Product<T>> Step<T, A> {
    fn new(level: Level<T, A>, transfer: Transfer<T>) -> Self {
        let zeros = || vec![T::default(); level.a.n_unknowns()];
        let (b, x, residual) = (zeros(), zeros(), zeros());
        Self { level, transfer, b, x, residual }
    }

    fn bytes(&self) -> usize {
        self.level.bytes() + self.transfer.bytes() + 3 * size_of_val(&self.b[..])
    }
}

impl Hierarchy {
    /// Makes the levels of a matrix.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] with an unknown of some level, [`SolveError::TooMuchMemory`].
    pub(super) fn new(matrix: &NodeRows<'_>, layout: &NodeLayout) -> Result<Self, SolveError> {
        let k = layout.n_modes();
        let size = matrix.n_nodes() * matrix.size();
        if size <= COARSEST {
            let mut coarsest = Coarsest::new(matrix)?;
            let softest = coarsest.softest_motion()?;
            return Ok(Self { finest: None, middle: Vec::new(), coarsest, sizes: vec![size], softest });
        }
        let inverse = inverted_diagonal(matrix)?;
        let level = Level::new(Finest::stored(matrix)?, &inverse);
        let modes = layout.mode_values(layout.extent(&Alone));
        let mut threshold = WEAK;
        let coarsened = match &layout.interpolation {
            Some(given) => interpolated(layout, given, &modes, k),
            None => {
                let groups = aggregates(matrix, threshold, most(matrix, k));
                threshold *= 0.5;
                smoothed(matrix, &groups, &modes, k, &inverse, level.largest)
            }
        };
        drop((modes, inverse));
        let a = super::galerkin::galerkin(matrix, &coarsened.transfer);
        Self::below(level, coarsened, a, Aggregation { k, threshold })
    }

    /// Makes the levels of an operator; its first coarser one is that of elements of degree 1.
    ///
    /// # Errors
    /// As [`Self::new`]; [`SolveError::NotFactored`] for a layout without that level.
    pub(super) fn of_operator(of: OperatorLevels, layout: &NodeLayout) -> Result<Self, SolveError> {
        let OperatorLevels { finest, scale, blocks, coarser } = of;
        let (k, size) = (layout.n_modes(), layout.components);
        let given = layout.interpolation.as_ref().ok_or(SolveError::NotFactored)?;
        let inverse = inverted_blocks(&blocks, size, 1.0 / scale)?;
        let level = Level::new(Finest::applied(finest, layout.points.len(), size), &inverse);
        drop((blocks, inverse));
        let coarsened = interpolated(layout, given, &layout.mode_values(layout.extent(&Alone)), k);
        let matrix = [&coarser.matrix];
        let a = Blocks::rounded(&NodeRows::of_coarser(&matrix, &coarser, size, scale))?;
        drop(coarser);
        Self::below(level, coarsened, a, Aggregation { k, threshold: WEAK })
    }

    /// The levels below the finest one, `a` the matrix of the first of them.
    fn below(
        level: Level<f32, Finest>,
        coarsened: Coarsened,
        mut a: Blocks<f64>,
        how: Aggregation,
    ) -> Result<Self, SolveError> {
        let Aggregation { k, mut threshold } = how;
        let Coarsened { transfer, mut modes } = coarsened;
        let mut sizes = vec![level.a.n_unknowns()];
        let (mut middle, mut coarsest): (Vec<Middle>, _) = (Vec::new(), None);
        while coarsest.is_none() {
            sizes.push(a.n_unknowns());
            let groups = aggregates(&a, threshold, most(&a, k));
            threshold *= 0.5;
            let shrinks = groups.count > 0 && (groups.count * k) as f64 <= SHRINKS * a.n_unknowns() as f64;
            if a.n_unknowns() <= COARSEST || !shrinks {
                coarsest = Some(Coarsest::new(&a)?);
                break;
            }
            let inverse = inverted_diagonal(&a)?;
            let level = Level::new(a.clone(), &inverse);
            let next = smoothed(&a, &groups, &modes, k, &inverse, level.largest);
            a = super::galerkin::galerkin(&a, &next.transfer);
            modes = next.modes;
            middle.push(Step::new(level, next.transfer));
        }
        let mut coarsest = coarsest.expect("the loop ends with it");
        let mut softest = coarsest.softest_motion()?;
        if let Some(motion) = &mut softest {
            for coarser in middle.iter().rev().map(|step| &step.transfer).chain([&transfer]) {
                let mut finer = vec![0.0; coarser.down.n_unknowns()];
                coarser.prolong_add(motion, &mut finer);
                *motion = finer;
            }
        }
        let finest = Some(Step::new(level, transfer.rounded()));
        Ok(Self { finest, middle, coarsest, sizes, softest })
    }

    /// Number of unknowns by level, the finest first.
    pub(super) fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// Bytes of all levels but the factor of the coarsest.
    pub(super) fn bytes(&self) -> usize {
        self.finest.as_ref().map_or(0, Step::bytes) + self.middle.iter().map(Step::bytes).sum::<usize>()
    }

    /// `x` = one cycle from zero for the right-hand side `b`, both by place.
    pub(super) fn cycle(&mut self, b: &[f32], x: &mut [f32]) {
        let Some(finest) = &mut self.finest else {
            self.coarsest.x.iter_mut().zip(b).for_each(|(x, b)| *x = f64::from(*b));
            self.coarsest.factor.solve(Transpose::No, &mut self.coarsest.x);
            x.iter_mut().zip(&self.coarsest.x).for_each(|(x, y)| *x = *y as f32);
            return;
        };
        finest.level.smooth_from_zero(b, x);
        finest.level.a.residual(b, x, &mut finest.residual);
        let next = self.middle.first_mut().map_or(&mut self.coarsest.x, |step| &mut step.b);
        finest.transfer.restrict(&finest.residual, next);
        down(&mut self.middle, &mut self.coarsest);
        let correction = self.middle.first().map_or(&self.coarsest.x, |step| &step.x);
        finest.transfer.prolong_add(correction, x);
        finest.level.smooth(b, x);
    }

    /// Where the coarsest matrix looks singular: its softest motion, a null vector of the matrix if that has one.
    pub(super) fn take_softest_motion(&mut self) -> Option<Vec<f64>> {
        self.softest.take()
    }

    /// Takes the factor of a coarsest matrix that looks singular as it is.
    ///
    /// # Errors
    /// [`SolveError::NotPositiveDefinite`] where it has none.
    pub(super) fn trust(&mut self) -> Result<(), SolveError> {
        match self.coarsest.suspicion.take() {
            Some(Suspicion { error: Some(error), .. }) => Err(error),
            Some(Suspicion { matrix, error: None }) => self.coarsest.factor.factor(&matrix).map(|_| ()),
            None => Ok(()),
        }
    }
}

/// Solves on these levels from zero, `b` of the first into its `x`; the coarsest in place.
fn down(levels: &mut [Middle], coarsest: &mut Coarsest) {
    let Some((first, rest)) = levels.split_first_mut() else {
        coarsest.factor.solve(Transpose::No, &mut coarsest.x);
        return;
    };
    let Step { level, transfer, b, x, residual } = first;
    level.smooth_from_zero(b, x);
    level.a.residual(b, x, residual);
    transfer.restrict(residual, rest.first_mut().map_or(&mut coarsest.x, |step| &mut step.b));
    down(rest, coarsest);
    transfer.prolong_add(rest.first().map_or(&coarsest.x, |step| &step.x), x);
    level.smooth(b, x);
}
