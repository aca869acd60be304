//! All levels, and one cycle over them.
//!
//! Matrices of levels are stored in single precision: a product takes as long as their bytes are read. Each is made from
//! the one above in double precision before it is rounded, since the softest motions of thin bodies, far below the rounding of
//! single precision, must reach the coarsest, which is factored in double precision.
//!
//! Promises: a cycle is the same operator every time, up to rounding, with the same bits for any number of threads; a
//! symmetric one where no changing part was taken in.

use wfl_host::team::Alone;

use super::aggregate::aggregates;
use super::blocks::{Blocks, Real, Rows, Transfer};
use super::changing::{Changing, Sum};
use super::coarsest::Coarsest;
use super::galerkin::{galerkin, galerkin_of_any, galerkin_then_rounded};
use super::level::{Level, Product, inverted_blocks, inverted_diagonal};
use super::nodes::{NodeLayout, NodeRows};
use super::operator::{Finest, OperatorLevels};
use super::prolongation::{Coarsened, interpolated, smoothed};
use crate::solve::SolveError;

/// Unknowns that are factored: a dense factor of so many takes 0.1 s and 32 MB.
const COARSEST: usize = 2000;
/// The same where a factor without symmetry is made for each changing part: 0.05 s.
const COARSEST_OF_ANY: usize = 1000;
/// Couplings below this part of the largest of their nodes are weak; halved from level to level (Vanek, Mandel and Brezina
/// 1996). Measured on cubes of tetrahedra whose cells are 10 times as long as wide: 17 iterations, and 85 with 0.15; on
/// cubes 16, and 15 with 0.4 in twice the memory.
const WEAK: f64 = 0.25;
/// A coarser level with more than this part of the unknowns does not pay: the matrix is factored then.
const SHRINKS: f64 = 0.7;

/// Unknowns of a coarser level for each of the finer one, at most, where groups can be made that large: cells that are thin
/// in one direction couple nodes along lines, three to a group, and six motions of each are no fewer unknowns.
const LARGEST_SHARE: f64 = 0.3;
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
type Middle = Step<f64, Blocks<f32>>;

/// The levels of a matrix.
pub(super) struct Hierarchy {
    finest: Option<Step<f32, Finest>>,
    middle: Vec<Middle>,
    coarsest: Coarsest,
    /// Number of unknowns by level.
    sizes: Vec<usize>,
    /// Where the coarsest matrix looks singular: its softest motion, by place of the finest level.
    softest: Option<Vec<f64>>,
    room: Option<Room>,
}

/// Room for a part that changes.
struct Room {
    /// Where it stands in each level, the finest first.
    levels: Vec<Changing>,
    /// The coarsest matrix with it.
    coarsest: Blocks<f64>,
}

/// How levels are aggregated.
struct Aggregation {
    /// Unknowns of a coarser node.
    k: usize,
    /// Couplings below this part of the largest are weak.
    threshold: f64,
    /// Unknowns that are factored.
    coarsest: usize,
}

/// Most groups of nodes of a level, `k` unknowns each.
fn most(a: &dyn Rows, k: usize) -> usize {
    (LARGEST_SHARE * (a.n_nodes() * a.size()) as f64 / k as f64) as usize
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
        Ok(Self::down_to(COARSEST, matrix, layout)?.0)
    }

    /// Makes the levels of a matrix `constant` and room in each of them for another part, with blocks where `changing` has
    /// them; [`Self::take`] is to come before a cycle.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(super) fn with_room(
        constant: &NodeRows<'_>,
        changing: &Blocks<f64>,
        layout: &NodeLayout,
    ) -> Result<Self, SolveError> {
        let (mut this, coarsest) = Self::down_to(COARSEST_OF_ANY, constant, layout)?;
        let coarsest = coarsest.map_or_else(|| Blocks::rounded(constant), Ok)?;
        this.make_room(constant, &coarsest, changing)?;
        Ok(this)
    }

    /// The levels of a matrix, and the coarsest matrix where that is another one; so many unknowns are factored.
    fn down_to(
        most_unknowns: usize,
        matrix: &NodeRows<'_>,
        layout: &NodeLayout,
    ) -> Result<(Self, Option<Blocks<f64>>), SolveError> {
        let k = layout.n_modes();
        let size = matrix.n_nodes() * matrix.size();
        if size <= most_unknowns {
            let mut coarsest = Coarsest::new(matrix)?;
            let softest = coarsest.softest_motion()?;
            let this = Self { finest: None, middle: Vec::new(), coarsest, sizes: vec![size], softest, room: None };
            return Ok((this, None));
        }
        let level = Level::new(Finest::stored(matrix)?, &inverted_diagonal(matrix)?);
        let largest = level.largest;
        let first = || first_coarser(matrix, layout, largest);
        let Coarsened { transfer, modes } = first()?;
        let threshold = if layout.interpolation.is_some() { WEAK } else { 0.5 * WEAK };
        let (a, transfer) = galerkin_then_rounded(matrix, transfer);
        let finest = Step::new(level, transfer);
        let again = || first().map(|coarsened| coarsened.transfer);
        let how = Aggregation { k, threshold, coarsest: most_unknowns };
        Self::below(finest, a, modes, how, &again).map(|(this, coarsest)| (this, Some(coarsest)))
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
        let first = || interpolated(layout, given, &layout.mode_values(layout.extent(&Alone)), k);
        let Coarsened { transfer, modes } = first();
        let finest = Step::new(level, transfer.rounded());
        let matrix = [&coarser.matrix];
        let a = Blocks::rounded(&NodeRows::of_coarser(&matrix, &coarser, size, scale))?;
        drop(coarser);
        let how = Aggregation { k, threshold: WEAK, coarsest: COARSEST };
        Ok(Self::below(finest, a, modes, how, &|| Ok(first().transfer))?.0)
    }

    /// The levels below the finest one, and the coarsest matrix: `a` is the matrix of the first of them, `modes` its near null
    /// space. `again` makes the prolongation from there in double precision, which a motion without energy needs and a cycle
    /// does not.
    fn below(
        finest: Step<f32, Finest>,
        mut a: Blocks<f64>,
        mut modes: Vec<f64>,
        how: Aggregation,
        again: &dyn Fn() -> Result<Transfer<f64>, SolveError>,
    ) -> Result<(Self, Blocks<f64>), SolveError> {
        let Aggregation { k, mut threshold, coarsest: most_unknowns } = how;
        let mut sizes = vec![finest.level.a.n_unknowns()];
        let (mut middle, mut coarsest): (Vec<Middle>, _) = (Vec::new(), None);
        while coarsest.is_none() {
            sizes.push(a.n_unknowns());
            let groups = aggregates(&a, threshold, most(&a, k));
            threshold *= 0.5;
            let shrinks = groups.count > 0 && (groups.count * k) as f64 <= SHRINKS * a.n_unknowns() as f64;
            if a.n_unknowns() <= most_unknowns || !shrinks {
                coarsest = Some(Coarsest::new(&a)?);
                break;
            }
            let inverse = inverted_diagonal(&a)?;
            let level = Level::new(Blocks::rounded(&a)?, &inverse);
            let next = smoothed(&a, &groups, &modes, k, &inverse, level.largest)?;
            a = galerkin(&a, &next.transfer);
            modes = next.modes;
            middle.push(Step::new(level, next.transfer));
        }
        let mut coarsest = coarsest.expect("the loop ends with it");
        let mut softest = coarsest.softest_motion()?;
        if let Some(motion) = &mut softest {
            let first = again()?;
            for coarser in middle.iter().rev().map(|step| &step.transfer).chain([&first]) {
                let mut finer = vec![0.0; coarser.down.n_unknowns()];
                coarser.prolong_add(motion, &mut finer);
                *motion = finer;
            }
        }
        Ok((Self { finest: Some(finest), middle, coarsest, sizes, softest, room: None }, a))
    }

    /// Widens the matrices of the levels, and the coarsest one, by a part that changes.
    fn make_room(
        &mut self,
        constant: &NodeRows<'_>,
        coarsest: &Blocks<f64>,
        changing: &Blocks<f64>,
    ) -> Result<(), SolveError> {
        let mut levels = Vec::new();
        let mut part = changing.clone();
        if let Some(finest) = &mut self.finest {
            let whole = widened(constant, &part, &mut levels)?;
            finest.level.a = Finest::Stored(whole);
            part = galerkin_of_any(&part, &finest.transfer);
        }
        for step in &mut self.middle {
            step.level.a = widened(&step.level.a, &part, &mut levels)?;
            part = galerkin_of_any(&part, &step.transfer);
        }
        let coarsest = widened(coarsest, &part, &mut levels)?;
        self.coarsest = Coarsest::of_any(&coarsest)?;
        self.room = Some(Room { levels, coarsest });
        Ok(())
    }

    /// Takes the part that changes, with blocks where those have been that room was made for.
    ///
    /// # Errors
    /// [`SolveError`] where the coarsest matrix has no factor.
    pub(super) fn take(&mut self, mut part: Blocks<f64>) -> Result<(), SolveError> {
        let Some(Room { levels, coarsest }) = &mut self.room else { return Err(SolveError::NotFactored) };
        let mut levels = levels.iter();
        if let Some((finest, own)) = self.finest.as_mut().and_then(|finest| Some((finest, levels.next()?))) {
            own.weaken(&mut part);
            own.set_diagonal(&part, &mut finest.level);
            if let Finest::Stored(whole) = &mut finest.level.a {
                own.add(&part, whole);
            }
            part = galerkin_of_any(&part, &finest.transfer);
        }
        for (step, own) in self.middle.iter_mut().zip(&mut levels) {
            own.weaken(&mut part);
            own.set_diagonal(&part, &mut step.level);
            own.add(&part, &mut step.level.a);
            part = galerkin_of_any(&part, &step.transfer);
        }
        let Some(own) = levels.next() else { return Err(SolveError::NotFactored) };
        own.weaken(&mut part);
        own.add(&part, coarsest);
        self.coarsest.take(coarsest)
    }

    /// Number of unknowns by level, the finest first.
    pub(super) fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// Bytes of all levels but the factor of the coarsest.
    pub(super) fn bytes(&self) -> usize {
        self.finest.as_ref().map_or(0, Step::bytes)
            + self.middle.iter().map(Step::bytes).sum::<usize>()
            + self.room.iter().flat_map(|room| &room.levels).map(Changing::bytes).sum::<usize>()
    }

    /// `x` = one cycle from zero for the right-hand side `b`, both by place.
    pub(super) fn cycle(&mut self, b: &[f32], x: &mut [f32]) {
        let Some(finest) = &mut self.finest else {
            self.coarsest.x.iter_mut().zip(b).for_each(|(x, b)| *x = f64::from(*b));
            self.coarsest.factor.solve(&mut self.coarsest.x);
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
        self.coarsest.trust()
    }
}

/// The first coarser level of a matrix, `largest` the largest eigenvalue of `D⁻¹ A`.
fn first_coarser(matrix: &NodeRows<'_>, layout: &NodeLayout, largest: f64) -> Result<Coarsened, SolveError> {
    let (k, modes) = (layout.n_modes(), layout.mode_values(layout.extent(&Alone)));
    if let Some(given) = &layout.interpolation {
        return Ok(interpolated(layout, given, &modes, k));
    }
    let groups = aggregates(matrix, WEAK, most(matrix, k));
    Ok(smoothed(matrix, &groups, &modes, k, &inverted_diagonal(matrix)?, largest)?)
}

/// A matrix with room for a part that changes, and where that stands.
fn widened<T: Real>(
    constant: &dyn Rows,
    part: &Blocks<f64>,
    levels: &mut Vec<Changing>,
) -> Result<Blocks<T>, SolveError> {
    let whole = Blocks::rounded(&Sum { constant, changing: part })?;
    levels.push(Changing::new(constant, part, &whole));
    Ok(whole)
}

/// Solves on these levels from zero, `b` of the first into its `x`; the coarsest in place.
fn down(levels: &mut [Middle], coarsest: &mut Coarsest) {
    let Some((first, rest)) = levels.split_first_mut() else {
        coarsest.factor.solve(&mut coarsest.x);
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
