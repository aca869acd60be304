//! Sums over one direction of a cell in turn: from nodes to all points of a batch, and back.
//!
//! An array over a grid is a line of numbers for each place and component, places in lexicographic order, x fastest. A pass
//! replaces the places of one direction by others: of functions by those of points, and the reverse. All components of a field are
//! taken at once, so that a number of the table serves all of them.

use pulp::{Simd, WithSimd};

use crate::assemble::applied::{
    cells::Functions,
    factors::{Lines, MOST},
    number::Number,
};

/// Where the numbers of an array stand.
#[derive(Clone, Copy, Debug)]
struct Steps {
    first: usize,
    /// From place to place; components stand one behind the other.
    place: usize,
}

/// A sum over one direction.
#[derive(Clone, Copy)]
struct Pass<'a, T: Number> {
    /// `[place behind][place before]` of the direction.
    table: &'a [T],
    /// Places of the directions before and behind it.
    n_inner: usize,
    n_outer: usize,
    n_components: usize,
    from: Steps,
    to: Steps,
    /// What stands there is kept.
    adds: bool,
}

/// A pass between two arrays, on part `p` of their lines: of K places with N components, to as many places if it is square.
struct Sums<'a, T: Number, const K: usize, const N: usize, const IS_SQUARE: bool> {
    p: usize,
    pass: Pass<'a, T>,
    from: &'a [T::Line],
    to: &'a mut [T::Line],
}

impl<T: Number, const K: usize, const N: usize, const IS_SQUARE: bool> WithSimd for Sums<'_, T, K, N, IS_SQUARE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { p, pass, from: source, to: target } = self;
        let (rows, n_inner) = (pass.table.as_chunks::<K>().0, pass.n_inner);
        // a number of places that the compiler knows
        let rows = if IS_SQUARE { &rows[..K] } else { rows };
        let (from, to) = (pass.from, pass.to);
        let zero = T::splat(simd, T::default());
        for outer in 0..pass.n_outer {
            for inner in 0..n_inner {
                let first = from.first + (outer * K * n_inner + inner) * from.place;
                let mut line = [[zero; N]; K];
                for (k, place) in line.iter_mut().enumerate() {
                    let lines = &source[first + k * n_inner * from.place..][..N];
                    place.iter_mut().zip(lines).for_each(|(slot, line)| *slot = T::load::<S>(line, p));
                }
                let first = to.first + (outer * rows.len() * n_inner + inner) * to.place;
                for (k, row) in rows.iter().enumerate() {
                    let lines = &mut target[first + k * n_inner * to.place..][..N];
                    let mut sums = [zero; N];
                    if pass.adds {
                        sums.iter_mut().zip(&*lines).for_each(|(sum, line)| *sum = T::load::<S>(line, p));
                    }
                    for (place, factor) in line.iter().zip(row) {
                        let factor = T::splat(simd, *factor);
                        sums.iter_mut().zip(place).for_each(|(sum, x)| *sum = T::fused(simd, *sum, *x, factor));
                    }
                    lines.iter_mut().zip(sums).for_each(|(line, sum)| T::store::<S>(line, p, sum));
                }
            }
        }
    }
}

impl<T: Number> Pass<'_, T> {
    /// With so many places before it.
    #[inline(always)]
    fn run<S: Simd>(self, simd: S, p: usize, n: usize, from: &[T::Line], to: &mut [T::Line]) {
        match (n, self.table.len() == n * n) {
            (3, true) => self.of_places::<S, 3, true>(simd, p, from, to),
            (4, true) => self.of_places::<S, 4, true>(simd, p, from, to),
            (5, true) => self.of_places::<S, 5, true>(simd, p, from, to),
            (3, _) => self.of_places::<S, 3, false>(simd, p, from, to),
            (4, _) => self.of_places::<S, 4, false>(simd, p, from, to),
            (5, _) => self.of_places::<S, 5, false>(simd, p, from, to),
            (6, _) => self.of_places::<S, 6, false>(simd, p, from, to),
            (7, _) => self.of_places::<S, 7, false>(simd, p, from, to),
            _ => self.of_places::<S, MOST, false>(simd, p, from, to),
        }
    }

    #[inline(always)]
    fn of_places<S: Simd, const K: usize, const IS_SQUARE: bool>(
        self,
        simd: S,
        p: usize,
        from: &[T::Line],
        to: &mut [T::Line],
    ) {
        match self.n_components {
            1 => simd.vectorize(Sums::<T, K, 1, IS_SQUARE> { p, pass: self, from, to }),
            2 => simd.vectorize(Sums::<T, K, 2, IS_SQUARE> { p, pass: self, from, to }),
            _ => simd.vectorize(Sums::<T, K, 3, IS_SQUARE> { p, pass: self, from, to }),
        }
    }
}

/// Arrays of a batch: what stands at all points, `[point][number]`, and two that the passes use in turn.
pub(super) struct Grids<'a, T: Number> {
    pub(super) at_points: &'a mut [T::Line],
    pub(super) scratch: [&'a mut [T::Line]; 2],
}

/// A field on the grid of a cell.
#[derive(Clone, Copy)]
pub(super) struct OnGrid<'a, T: Number> {
    of: &'a Functions<T>,
    lines: &'a Lines<T>,
    /// Numbers of a point.
    n_at_point: usize,
    dim: usize,
}

impl<'a, T: Number> OnGrid<'a, T> {
    /// Where the functions of a field are products.
    pub(super) fn new(of: &'a Functions<T>, n_at_point: usize, dim: usize) -> Option<Self> {
        of.lines.as_ref().map(|lines| Self { of, lines, n_at_point, dim })
    }

    /// A sum over direction `d`, of arrays that have points in directions before it and functions in those behind it.
    fn pass(&self, d: usize, table: &'a [T]) -> Pass<'a, T> {
        let (n, m, n_components) = (self.lines.n_functions, self.lines.n_points, self.of.n_components);
        let steps = Steps { first: 0, place: n_components };
        let (n_inner, n_outer) = (m.pow(d as u32), n.pow((self.dim - 1 - d) as u32));
        Pass { table, n_inner, n_outer, n_components, from: steps, to: steps, adds: false }
    }

    /// The derivatives along direction `d`, between values at the points and what stands there: the steps of the latter.
    fn along(&self, d: usize, table: &'a [T]) -> (Pass<'a, T>, Steps) {
        let n_outer = self.lines.n_points.pow((self.dim - 1 - d) as u32);
        let steps = Steps { first: self.of.gradient_at + d * self.of.n_components, place: self.n_at_point };
        (Pass { n_outer, ..self.pass(d, table) }, steps)
    }

    /// Values and derivatives in the reference cell at all points, from nodal values.
    #[inline(always)]
    pub(super) fn to_points<S: Simd>(self, simd: S, p: usize, local: &[T::Line], grids: &mut Grids<'_, T>) {
        let (n, m) = (self.lines.n_functions, self.lines.n_points);
        let [values, other] = &mut grids.scratch;
        for d in 0..self.dim {
            let pass = self.pass(d, &self.lines.values[0]);
            if d == 0 {
                pass.run(simd, p, n, &local[self.of.first..], values);
            } else {
                pass.run(simd, p, n, values, other);
                std::mem::swap(values, other);
            }
        }
        if self.of.reads.gradients {
            for d in 0..self.dim {
                let (pass, to) = self.along(d, &self.lines.slopes[0]);
                Pass { to, ..pass }.run(simd, p, m, values, grids.at_points);
            }
        }
        if self.of.reads.values {
            self.each_value(|k, at| T::store::<S>(&mut grids.at_points[at], p, T::load::<S>(&values[k], p)));
        }
    }

    /// What fluxes in the reference cell at all points make at the nodes.
    #[inline(always)]
    pub(super) fn to_nodes<S: Simd>(self, simd: S, p: usize, grids: &mut Grids<'_, T>, out: &mut [T::Line]) {
        let m = self.lines.n_points;
        let [sums, other] = &mut grids.scratch;
        if self.of.reads.values {
            self.each_value(|k, at| T::store::<S>(&mut sums[k], p, T::load::<S>(&grids.at_points[at], p)));
        }
        if self.of.reads.gradients {
            for d in 0..self.dim {
                let (pass, from) = self.along(d, &self.lines.slopes[1]);
                let adds = d > 0 || self.of.reads.values;
                Pass { from, adds, ..pass }.run(simd, p, m, grids.at_points, sums);
            }
        }
        for d in (0..self.dim).rev() {
            let pass = self.pass(d, &self.lines.values[1]);
            if d == 0 {
                pass.run(simd, p, m, sums, &mut out[self.of.first..]);
            } else {
                pass.run(simd, p, m, sums, other);
                std::mem::swap(sums, other);
            }
        }
    }

    /// Calls with each value at the points: its place by itself, and among the numbers at the points.
    #[inline(always)]
    fn each_value(&self, mut call: impl FnMut(usize, usize)) {
        let n = self.of.n_components;
        for q in 0..self.lines.n_points.pow(self.dim as u32) {
            (0..n).for_each(|c| call(q * n + c, q * self.n_at_point + self.of.value_at + c));
        }
    }
}
