//! Functions that are products of functions of one variable, at points that are a grid: tables of one direction.
//!
//! With L_a the functions of one variable and x_q the points of one direction, a function is N_abc = L_a L_b L_c and a point
//! (x_q, x_r, x_s), both in lexicographic order, x fastest. So values at all points follow from nodal values by a sum in each
//! direction in turn (sum factorisation), and derivatives from these values by one more sum, as they are polynomials of one
//! variable on each line of points (Kronbichler and Kormann 2019, <https://doi.org/10.1145/3325864>). Knows tables and points
//! alone: which elements and rules these are of is found from the numbers.

use crate::assemble::applied::number::Number;
use wfl_mesh::element::Table;

/// Most points of a direction: the kernel holds so many numbers of a line in registers.
pub(super) const MOST: usize = 8;
/// Fewest functions of a direction: sums over two are never faster in turn.
const FEWEST: usize = 3;
/// How far products may be from the table, a part of its largest number: functions of degree 4 lose some tens of roundings.
const SAME: f64 = 1e-12;

/// Products with sums that take as long as a number that a sum in turn writes and the next one reads, where sums over all functions
/// keep theirs in registers: measured. So elasticity on quadrilaterals of degree 3 takes as long both ways, less at once on those of
/// degree 2 and on hexahedra of degree 1, and less in turn on hexahedra of degree 2.
pub(in crate::assemble) const PRODUCTS_OF_A_LINE: usize = 4;

/// Tables of one direction.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::assemble) struct Factors {
    dim: usize,
    /// Functions and points of a direction.
    pub(super) n_functions: usize,
    pub(super) n_points: usize,
    /// `[point][function]`
    values: Vec<f64>,
    /// `[point][other point]`: derivative at a point from values at all points of its line.
    slopes: Vec<f64>,
}

impl Factors {
    /// Of the functions of a table at its points, where they are such products and have no more functions than points.
    pub(in crate::assemble) fn of(table: &Table, points: &[[f64; 3]]) -> Option<Self> {
        let dim = table.dim;
        if !(2..=3).contains(&dim) || points.len() != table.n_points {
            return None;
        }
        let (n, m) = (root(table.n_dofs, dim)?, root(table.n_points, dim)?);
        if n < FEWEST || m < n || m > MOST || !are_grid(points, m, dim) {
            return None;
        }
        // functions sum to 1, so that the sum over all but one direction leaves the factor of that one
        let mut values = vec![0.0; m * n];
        for (q, row) in values.chunks_exact_mut(n).enumerate() {
            let at_point = &table.values[q * table.n_dofs..][..table.n_dofs];
            at_point.iter().enumerate().for_each(|(k, value)| row[k % n] += value);
        }
        let line: Vec<f64> = points[..m].iter().map(|point| point[0]).collect();
        let made = Self { dim, n_functions: n, n_points: m, values, slopes: slopes(&line) };
        made.are_those_of(table).then_some(made)
    }

    /// Whether products of these numbers are those of a table.
    fn are_those_of(&self, table: &Table) -> bool {
        let (n, m, dim) = (self.n_functions, self.n_points, table.dim);
        let mut along = vec![0.0; m * n];
        for (along, slopes) in along.chunks_exact_mut(n).zip(self.slopes.chunks_exact(m)) {
            for (slope, values) in slopes.iter().zip(self.values.chunks_exact(n)) {
                along.iter_mut().zip(values).for_each(|(sum, value)| *sum += slope * value);
            }
        }
        let product = |q: usize, k: usize, direction: Option<usize>| -> f64 {
            let factor = |d: usize| {
                let at = q / m.pow(d as u32) % m * n + k / n.pow(d as u32) % n;
                if direction == Some(d) { along[at] } else { self.values[at] }
            };
            (0..dim).map(factor).product()
        };
        let size = |numbers: &[f64]| SAME * numbers.iter().fold(1.0, |size: f64, x| size.max(x.abs()));
        let (near, near_slope) = (size(&table.values), size(&table.gradients));
        (0..table.n_points * table.n_dofs).all(|at| {
            let (q, k) = (at / table.n_dofs, at % table.n_dofs);
            let slopes = table.gradients.chunks_exact(dim).nth(at);
            (product(q, k, None) - table.values[at]).abs() <= near
                && slopes.is_none_or(|slopes| {
                    slopes.iter().enumerate().all(|(d, slope)| (product(q, k, Some(d)) - slope).abs() <= near_slope)
                })
        })
    }

    /// Products with sums for what is read of one component at all points of a cell, where there are so many of them, and how many
    /// numbers are written: by the sums of each direction in turn, and by those of the derivatives. `None` where these points can not
    /// be such a grid.
    fn work(&self, n_points: usize, reads: Reads) -> Option<[usize; 2]> {
        let (n, dim) = (self.n_functions, self.dim);
        let m = root(n_points, dim).filter(|m| (n..=MOST).contains(m))?;
        let power = |base: usize, exponent: usize| (0..exponent).fold(1, |power, _| power * base);
        let values: usize = (0..dim).map(|d| power(m, d + 1) * power(n, dim - 1 - d)).sum();
        let slopes = if reads.gradients { dim * n_points } else { 0 };
        Some([values * n + slopes * m, values + slopes])
    }
}

/// What the slots of a law read of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::assemble) struct Reads {
    pub(in crate::assemble) values: bool,
    pub(in crate::assemble) gradients: bool,
}

impl Reads {
    /// Something.
    pub(in crate::assemble) fn any(self) -> bool {
        self.values || self.gradients
    }

    /// The factors of the functions of a table at its points, where sums in turn are faster.
    pub(in crate::assemble) fn factors(self, table: &Table, points: &[[f64; 3]]) -> Option<Factors> {
        let made = Factors::of(table, points)?;
        self.in_turn(&made, [table.n_points, table.n_dofs]).is_some().then_some(made)
    }

    /// Products with sums for what is read of one component at so many points of so many functions, in the faster way, and numbers
    /// that sums in turn write.
    pub(in crate::assemble) fn work(self, factors: Option<&Factors>, size: [usize; 2], dim: usize) -> [usize; 2] {
        let in_turn = factors.and_then(|factors| self.in_turn(factors, size));
        in_turn.unwrap_or_else(|| [self.at_once(size, dim), 0])
    }

    /// The same where sums in turn are faster.
    fn in_turn(self, factors: &Factors, size: [usize; 2]) -> Option<[usize; 2]> {
        let work = factors.work(size[0], self)?;
        (work[0] + PRODUCTS_OF_A_LINE * work[1] < self.at_once(size, factors.dim)).then_some(work)
    }

    /// The same of sums over all functions.
    fn at_once(self, size: [usize; 2], dim: usize) -> usize {
        let numbers = usize::from(self.values) + if self.gradients { dim } else { 0 };
        size[0] * size[1] * numbers
    }
}

/// The number that is this one to the power `dim`.
fn root(number: usize, dim: usize) -> Option<usize> {
    (1..=number).take_while(|root| root.pow(dim as u32) <= number).find(|root| root.pow(dim as u32) == number)
}

/// Whether points are those of a line in each direction, x fastest.
fn are_grid(points: &[[f64; 3]], m: usize, dim: usize) -> bool {
    let is_there = |(q, point): (usize, &[f64; 3])| {
        (0..dim).all(|d| (point[d] - points[q / m.pow(d as u32) % m][0]).abs() <= SAME)
    };
    points.iter().enumerate().all(is_there)
}

/// `[point][other point]`: derivatives of the polynomials that are 1 at one point of a line and 0 at the others, in the barycentric
/// form (Berrut and Trefethen 2004, <https://doi.org/10.1137/S0036144502417715>): each row sums to zero.
fn slopes(line: &[f64]) -> Vec<f64> {
    let m = line.len();
    let weight = |j: usize| -> f64 { (0..m).filter(|k| *k != j).map(|k| (line[j] - line[k]).recip()).product() };
    let weights: Vec<f64> = (0..m).map(weight).collect();
    let mut slopes = vec![0.0; m * m];
    for (i, row) in slopes.chunks_exact_mut(m).enumerate() {
        for j in (0..m).filter(|j| *j != i) {
            row[j] = weights[j] / weights[i] / (line[i] - line[j]);
        }
        row[i] = -row.iter().sum::<f64>();
    }
    slopes
}

/// Tables of a direction as the kernel reads them: to the points, and transposed on the way back.
#[derive(Clone, Debug)]
pub(super) struct Lines<T> {
    /// Functions and points of a direction.
    pub(super) n_functions: usize,
    pub(super) n_points: usize,
    /// Points of a cell.
    pub(super) n_in_cell: usize,
    /// `[point][function]`, and `[function][point]`.
    pub(super) values: [Vec<T>; 2],
    /// `[point][other point]`, and transposed.
    pub(super) slopes: [Vec<T>; 2],
}

impl<T> Lines<T> {
    /// Numbers that are stored.
    pub(super) fn len(&self) -> usize {
        self.values.iter().chain(&self.slopes).map(Vec::len).sum()
    }
}

impl<T: Number> Lines<T> {
    /// In a precision.
    pub(super) fn new(factors: &Factors) -> Self {
        let (n, m) = (factors.n_functions, factors.n_points);
        let both = |table: &[f64], width: usize| {
            let transposed = (0..width).flat_map(|k| table.iter().skip(k).step_by(width));
            [table.iter().map(|x| T::of(*x)).collect(), transposed.map(|x| T::of(*x)).collect()]
        };
        let n_in_cell = m.pow(factors.dim as u32);
        Self {
            n_functions: n,
            n_points: m,
            n_in_cell,
            values: both(&factors.values, n),
            slopes: both(&factors.slopes, m),
        }
    }
}
