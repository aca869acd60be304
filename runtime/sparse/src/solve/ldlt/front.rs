//! Elimination of the columns of one dense symmetric front, `P F Pᵀ = L D Lᵀ`, with pivots of one and two columns.
//!
//! A front has n candidates, which may be eliminated, and r rows below them; its first n columns are a panel of
//! m = n + r rows by columns, of which the lower triangle and the rows below count. A pivot is taken where it bounds the
//! entries of L below it by `1 / THRESHOLD`, over all m rows (threshold pivoting, Duff and Reid 1983, 1996). Candidates
//! without such a pivot are put off, tried again once others are eliminated, and left if that does not help.
//!
//! Columns are eliminated in blocks: those of a block are brought up to date one by one when they are looked at (as
//! LAPACK's lasyf does), everything behind them by one product of matrices for the whole block.
//!
//! Promises: what is eliminated depends on the numbers alone, never on the number of threads. Nothing is added to a pivot.
//! Does not know of trees: `tree` does.

use wfl_dense::sweeps::{largest_beside, subtract_columns};
use wfl_dense::{Accum, MatMut, MatRef, Par, Real, ReborrowMut, lower_product};

use super::super::inertia::Inertia;
use super::super::packed;

/// A pivot is at least this part of the entries below it: rounding grows by no more than one over it in an elimination.
pub(super) const THRESHOLD: f64 = 0.01;
/// A block of two is a pivot if its determinant is at least this part of the square beside its diagonal: less has
/// cancelled, and one of its entries on the diagonal will do.
const DETERMINANT: f64 = 0.5;
/// Columns of a block. Measured on fronts of elasticity and flow: fewer make the products too thin, more leave too much
/// to single columns.
const BLOCK: usize = 32;

/// Work space of eliminations.
#[derive(Default)]
pub(super) struct Scratch {
    /// L D of the columns of a block, m numbers each, and one column more.
    products: Vec<f64>,
    /// L D of some rows.
    scaled: Vec<f64>,
}

/// What the pivots of some fronts have shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pivots {
    /// Their signs.
    pub(super) inertia: Inertia,
    /// The smallest one, and the name of its column.
    pub(super) smallest: (f64, u32),
}

impl Default for Pivots {
    fn default() -> Self {
        Self { inertia: Inertia::default(), smallest: (f64::INFINITY, 0) }
    }
}

impl Pivots {
    /// Those of both.
    pub(super) fn and(self, other: Self) -> Self {
        let [a, b] = [self.inertia, other.inertia];
        let inertia =
            Inertia { positive: a.positive + b.positive, negative: a.negative + b.negative, zero: a.zero + b.zero };
        Self { inertia, smallest: if other.smallest.0 < self.smallest.0 { other.smallest } else { self.smallest } }
    }
}

/// The candidates of a front while they are eliminated.
pub(super) struct Elimination<'a> {
    /// m x n, by columns: L without its unit diagonal, with D on the diagonal, then what is not eliminated.
    pub(super) panel: &'a mut [f64],
    /// Names of the candidates, which follow them as they are exchanged.
    pub(super) order: &'a mut [u32],
    /// Entry of D beside the diagonal, at the first column of a pivot of two.
    pub(super) beside: &'a mut [f64],
    /// Rows of the panel.
    pub(super) m: usize,
    /// Threads for products of matrices.
    pub(super) par: Par,
}

/// Where an elimination stands.
struct Progress {
    /// First column of the block at hand.
    begin: usize,
    /// Columns that are eliminated.
    done: usize,
    /// Candidates from here on have been put off.
    active: usize,
}

impl Elimination<'_> {
    /// Eliminates what has a pivot; the number of columns that are eliminated. Those that are left stand behind them, up to
    /// date.
    pub(super) fn run(&mut self, scratch: &mut Scratch, pivots: &mut Pivots) -> usize {
        let n = self.order.len();
        let room = self.m * (BLOCK + 1).min(n + 1);
        if scratch.products.len() < room {
            scratch.products.resize(room, 0.0);
        }
        let w = &mut scratch.products[..];
        let mut at = Progress { begin: 0, done: 0, active: n };
        let mut before = 0;
        loop {
            if at.done == at.active {
                let is_over = at.done == n || at.done == before;
                if is_over || at.done - at.begin >= BLOCK {
                    self.update(w, &mut at);
                }
                if is_over {
                    return at.done;
                }
                (before, at.active) = (at.done, n);
            }
            if at.done - at.begin >= BLOCK {
                self.update(w, &mut at);
            }
            self.step(w, &mut at, pivots);
        }
    }

    /// Eliminates the next candidate, or puts it off.
    fn step(&mut self, w: &mut [f64], at: &mut Progress, pivots: &mut Pivots) {
        let (m, done) = (self.m, at.done);
        let used = (done - at.begin) * m;
        let (old, new) = w.split_at_mut(used);
        let (first, second) = new.split_at_mut(m);
        self.bring_up(old, at, done, first);
        let beside = largest_beside(&first[done + 1..]);
        let own = first[done].abs();
        if own > 0.0 && own >= THRESHOLD * beside {
            self.take_one(first, done);
            pivots.count_one(first[done], self.order[done]);
            at.done += 1;
            return;
        }
        let partner = (done + 1..at.active).reduce(|a, b| if first[b].abs() > first[a].abs() { b } else { a });
        if let Some(partner) = partner.filter(|&partner| first[partner] != 0.0) {
            let second = &mut second[..m];
            self.bring_up(old, at, partner, second);
            if is_pivot(first, second, done, partner) {
                self.swap(old, done + 1, partner);
                first.swap(done + 1, partner);
                second.swap(done + 1, partner);
                self.take_two(first, second, done);
                let block = [first[done], first[done + 1], second[done + 1]];
                pivots.count_two(block, self.order[done]);
                at.done += 2;
                return;
            }
            let beside = (done..m).filter(|row| *row != partner).fold(0.0, |x: f64, row| x.max(second[row].abs()));
            if second[partner].abs() > 0.0 && second[partner].abs() >= THRESHOLD * beside {
                self.swap(old, done, partner);
                second.swap(done, partner);
                first.copy_from_slice(second);
                self.take_one(first, done);
                pivots.count_one(first[done], self.order[done]);
                at.done += 1;
                return;
            }
        }
        at.active -= 1;
        self.swap(old, done, at.active);
    }

    /// A column that is not eliminated, from the row `done` on, as it stands after the pivots of the block.
    fn bring_up(&self, products: &[f64], at: &Progress, column: usize, target: &mut [f64]) {
        let (m, done) = (self.m, at.done);
        for (row, value) in (done..column).zip(&mut target[done..column]) {
            *value = self.panel[row * m + column];
        }
        target[column..].copy_from_slice(&self.panel[column * m + column..(column + 1) * m]);
        let mut factors = [0.0; BLOCK + 1];
        let n = done - at.begin;
        for (k, factor) in factors[..n].iter_mut().enumerate() {
            *factor = self.panel[(at.begin + k) * m + column];
        }
        subtract_columns(products, m, &factors[..n], done, &mut target[done..]);
    }

    /// The column at `done` becomes one of L.
    fn take_one(&mut self, column: &[f64], done: usize) {
        let m = self.m;
        let pivot = column[done];
        let target = &mut self.panel[done * m..(done + 1) * m];
        target[done] = pivot;
        let inverse = 1.0 / pivot;
        if inverse.is_finite() {
            target[done + 1..].iter_mut().zip(&column[done + 1..]).for_each(|(l, value)| *l = value * inverse);
        } else {
            target[done + 1..].iter_mut().zip(&column[done + 1..]).for_each(|(l, value)| *l = value / pivot);
        }
        self.beside[done] = 0.0;
    }

    /// The columns at `done` and behind it become two of L.
    fn take_two(&mut self, first: &[f64], second: &[f64], done: usize) {
        let m = self.m;
        let (a, b, c) = (first[done], first[done + 1], second[done + 1]);
        // divided by b twice, so that the square neither overflows nor vanishes
        let (p, q) = (a / b, c / b);
        let scale = 1.0 / (b * (p * q - 1.0));
        let (left, right) = self.panel[done * m..(done + 2) * m].split_at_mut(m);
        (left[done], left[done + 1], right[done + 1]) = (a, 0.0, c);
        let sources = first[done + 2..].iter().zip(&second[done + 2..]);
        let targets = left[done + 2..].iter_mut().zip(&mut right[done + 2..]);
        for ((x, y), (l, r)) in sources.zip(targets) {
            *l = (q * x - y) * scale;
            *r = (p * y - x) * scale;
        }
        (self.beside[done], self.beside[done + 1]) = (b, 0.0);
    }

    /// Exchanges two candidates, in what is eliminated too.
    fn swap(&mut self, products: &mut [f64], a: usize, b: usize) {
        let (i, j) = (a.min(b), a.max(b));
        if i == j {
            return;
        }
        let m = self.m;
        products.chunks_exact_mut(m).for_each(|column| column.swap(i, j));
        self.panel[..i * m].chunks_exact_mut(m).for_each(|column| column.swap(i, j));
        let (left, right) = self.panel.split_at_mut(j * m);
        let left = &mut left[i * m..];
        std::mem::swap(&mut left[i], &mut right[j]);
        for between in 1..j - i {
            let (head, column) = left.split_at_mut(between * m);
            std::mem::swap(&mut head[i + between], &mut column[j]);
        }
        left[j + 1..m].swap_with_slice(&mut right[j + 1..m]);
        self.order.swap(i, j);
    }

    /// Brings all candidates behind a block up to date.
    fn update(&mut self, products: &[f64], at: &mut Progress) {
        let (m, n, done) = (self.m, self.order.len(), at.done);
        let width = done - at.begin;
        if width > 0 && done < n {
            let (left, right) = self.panel.split_at_mut(done * m);
            let l = MatRef::from_column_major_slice(&left[at.begin * m..], m, width);
            let w = MatRef::from_column_major_slice(&products[..width * m], m, width);
            let (l, w) = (l.split_at_row(done).1, w.split_at_row(done).1);
            let rest = MatMut::from_column_major_slice_mut(right, m, n - done).split_at_row_mut(done).1;
            let (mut top, below) = rest.split_at_row_mut(n - done);
            let transposed = l.split_at_row(n - done).0.transpose();
            lower_product(top.rb_mut(), Accum::Add, w.split_at_row(n - done).0, transposed, self.par);
            if m > n {
                f64::product(below, Accum::Add, w.split_at_row(n - done).1, transposed, -1.0, self.par);
            }
        }
        at.begin = done;
    }
}

/// Whether two columns bound the entries of L below them.
fn is_pivot(first: &[f64], second: &[f64], done: usize, partner: usize) -> bool {
    let (a, b, c) = (first[done].abs(), first[partner].abs(), second[partner].abs());
    let determinant = (first[done] * second[partner] - b * b).abs();
    if determinant.is_nan() || determinant < DETERMINANT * b * b || determinant == 0.0 {
        return false;
    }
    let (mut x, mut y) = (0.0f64, 0.0f64);
    for row in (done + 1..first.len()).filter(|row| *row != partner) {
        (x, y) = (x.max(first[row].abs()), y.max(second[row].abs()));
    }
    c * x + b * y <= determinant / THRESHOLD && b * x + a * y <= determinant / THRESHOLD
}

impl Pivots {
    fn count_one(&mut self, pivot: f64, column: u32) {
        self.count(pivot);
        self.note(pivot.abs(), column);
    }

    fn count_two(&mut self, block: [f64; 3], column: u32) {
        let [a, b, c] = block;
        if a * c < b * b {
            self.inertia.positive += 1;
            self.inertia.negative += 1;
        } else {
            (0..2).for_each(|_| self.count(a));
        }
        // about the smaller eigenvalue
        let size = a.abs().max(b.abs()).max(c.abs());
        self.note((a / size * c - b / size * b).abs(), column);
    }

    fn count(&mut self, pivot: f64) {
        if pivot > 0.0 { self.inertia.positive += 1 } else { self.inertia.negative += 1 }
    }

    fn note(&mut self, size: f64, column: u32) {
        if size < self.smallest.0 {
            self.smallest = (size, column);
        }
    }
}

/// The lower half, as in [`packed`], of `-L2 D L2ᵀ`: what the first `eliminated` columns of a panel of m rows leave to its
/// rows from n on.
pub(super) fn contribution(
    panel: &[f64],
    beside: &[f64],
    rows: (usize, usize),
    own: &mut [f64],
    scratch: &mut Scratch,
    par: Par,
) {
    let (m, n) = rows;
    let eliminated = beside.len();
    if eliminated == 0 {
        own.fill(0.0);
        return;
    }
    let l = MatRef::from_column_major_slice(&panel[..m * eliminated], m, eliminated).split_at_row(n).1;
    for block in packed::blocks(m - n) {
        let target = MatMut::from_column_major_slice_mut(&mut own[block.range()], block.rows, block.columns);
        let (diagonal, rest) = target.split_at_row_mut(block.columns);
        let (here, below) = l.split_at_row(block.first).1.split_at_row(block.columns);
        if scratch.scaled.len() < block.columns * eliminated {
            scratch.scaled.resize(block.columns * eliminated, 0.0);
        }
        let scaled = &mut scratch.scaled[..block.columns * eliminated];
        let first = n + block.first;
        times_pivots(panel, beside, m, first..first + block.columns, scaled);
        let scaled = MatRef::from_column_major_slice(scaled, block.columns, eliminated).transpose();
        lower_product(diagonal, Accum::Replace, here, scaled, par);
        if below.nrows() > 0 {
            f64::product(rest, Accum::Replace, below, scaled, -1.0, par);
        }
    }
}

/// Some rows of L D, by columns.
fn times_pivots(panel: &[f64], beside: &[f64], m: usize, rows: std::ops::Range<usize>, scaled: &mut [f64]) {
    let size = rows.len();
    let mut column = 0;
    while column < beside.len() {
        let l = &panel[column * m..];
        let target = &mut scaled[column * size..];
        if beside[column] == 0.0 {
            let d = l[column];
            target[..size].iter_mut().zip(&l[rows.clone()]).for_each(|(w, l)| *w = l * d);
            column += 1;
            continue;
        }
        let (a, b, c) = (l[column], beside[column], l[m + column + 1]);
        let (left, right) = target.split_at_mut(size);
        let sources = l[rows.clone()].iter().zip(&l[m + rows.start..m + rows.end]);
        for ((x, y), (w, v)) in sources.zip(left.iter_mut().zip(right)) {
            *w = a * x + b * y;
            *v = b * x + c * y;
        }
        column += 2;
    }
}
