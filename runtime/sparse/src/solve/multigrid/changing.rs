//! A part of the matrix that changes while the levels stay, and need not be symmetric: contact.
//!
//! Groups of nodes and prolongations are those of the constant part alone, so no group joins bodies that contact holds
//! together now and lets go later. What changes has entries at few nodes; Galerkin's product carries it down, and on each
//! level it is added to the constant matrix where it has entries. So every level knows contact as it is, at the cost of its
//! few nodes.
//!
//! The smoother divides by `D = K_ii + (C_ii + the sums of |C_ij|) / λ`, λ the largest eigenvalue of the constant part with its
//! own diagonal: then λ is a bound of the sum, too, however stiff C is (of an l1-smoother's kind: Baker, Falgout, Kolev and
//! Yang, SIAM J. Sci. Comput. 33 (2011)).
//!
//! Promises: the same levels for the same changing part, whatever came before, and for any number of threads.

use super::blocks::{Blocks, Real, RowBuffer, Rows};
use super::level::{Level, Product};

/// How much stiffer than the constant part, by diagonals, the changing part of a level may be. The fault with 16 cells a side
/// and gamma h/E = 50, penalty contact and Nitsche's method: 1.7 and 1.5 iterations a digit; with 1 there are 2.1 and 1.6, and
/// without a limit the latter take 2.2.
const STIFFEST: f64 = 4.0;

/// Where the changing part stands in the matrix of a level.
pub(super) struct Changing {
    /// By block of the changing part its place among the blocks of the level.
    places: Vec<usize>,
    /// The constant part there, block after block.
    constant: Vec<f64>,
}

/// The sum of two matrices.
pub(super) struct Sum<'a> {
    pub(super) constant: &'a dyn Rows,
    pub(super) changing: &'a Blocks<f64>,
}

impl Rows for Sum<'_> {
    fn size(&self) -> usize {
        self.constant.size()
    }

    fn n_nodes(&self) -> usize {
        self.constant.n_nodes()
    }

    fn row<'a>(&'a self, node: usize, buffer: &'a mut RowBuffer) -> (&'a [u32], &'a [f64]) {
        let (others, added) = self.changing.row_of(node);
        if others.is_empty() {
            return self.constant.row(node, buffer);
        }
        let area = self.size() * self.size();
        let mut own = RowBuffer::default();
        let (columns, values) = self.constant.row(node, &mut own);
        let (mut i, mut j) = (0, 0);
        buffer.columns.clear();
        buffer.values.clear();
        while i < columns.len() || j < others.len() {
            let (here, there) = (columns.get(i), others.get(j));
            let column = here.into_iter().chain(there).min().copied().unwrap_or_default();
            let at = buffer.values.len();
            buffer.columns.push(column);
            buffer.values.resize(at + area, 0.0);
            let mut add = |values: &[f64]| buffer.values[at..].iter_mut().zip(values).for_each(|(sum, v)| *sum += v);
            if here == Some(&column) {
                add(&values[i * area..][..area]);
                i += 1;
            }
            if there == Some(&column) {
                add(&added[j * area..][..area]);
                j += 1;
            }
        }
        (&buffer.columns, &buffer.values)
    }
}

impl Changing {
    /// `constant` and `changing` in the matrix `whole`, which has blocks wherever they have.
    pub(super) fn new<T>(constant: &dyn Rows, changing: &Blocks<f64>, whole: &Blocks<T>) -> Self {
        let area = constant.size() * constant.size();
        let (mut places, mut values) = (Vec::with_capacity(changing.columns.len()), Vec::new());
        let mut buffer = RowBuffer::default();
        for row in 0..changing.n_rows() {
            let (of_changing, (begin, end)) = (changing.row_of(row).0, (whole.starts[row], whole.starts[row + 1]));
            if of_changing.is_empty() {
                continue;
            }
            let (columns, blocks) = constant.row(row, &mut buffer);
            for column in of_changing {
                places.push(begin + whole.columns[begin..end].partition_point(|other| other < column));
                match columns.binary_search(column) {
                    Ok(at) => values.extend_from_slice(&blocks[at * area..][..area]),
                    Err(_) => values.resize(values.len() + area, 0.0),
                }
            }
        }
        Self { places, constant: values }
    }

    /// Bytes that it holds.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.places[..]) + size_of_val(&self.constant[..])
    }

    /// Makes the changing part of a level no stiffer than [`STIFFEST`] times the constant part.
    ///
    /// Groups on the two sides of an interface do not match, so what ties them in every point would leave a coarse level no
    /// motion but those of the whole interface. A joint as soft as the cells of the level holds smooth motions as well. On the
    /// finest level what is stiff from node to node is left to who solves for it directly.
    pub(super) fn weaken(&self, changing: &mut Blocks<f64>) {
        let size = changing.shape[0];
        let area = size * size;
        let mut stiffest = STIFFEST;
        for row in 0..changing.n_rows() {
            let (columns, blocks) = changing.row_of(row);
            let Ok(at) = columns.binary_search(&(row as u32)) else { continue };
            let constant = &self.constant[(changing.starts[row] + at) * area..][..area];
            let diagonals = (0..size).map(|c| (constant[c * size + c], blocks[at * area + c * size + c]));
            let ratios = diagonals.filter(|(own, _)| *own > 0.0).map(|(own, added)| added / own);
            stiffest = ratios.fold(stiffest, f64::max);
        }
        if stiffest > STIFFEST {
            changing.values.iter_mut().for_each(|value| *value *= STIFFEST / stiffest);
        }
    }

    /// Puts the sum into the matrix of a level.
    pub(super) fn add<T: Real>(&self, changing: &Blocks<f64>, whole: &mut Blocks<T>) {
        let area = whole.shape[0] * whole.shape[1];
        let blocks = self.constant.chunks_exact(area).zip(changing.values.chunks_exact(area));
        for (place, (own, added)) in self.places.iter().zip(blocks) {
            let out = &mut whole.values[place * area..][..area];
            out.iter_mut().zip(own.iter().zip(added)).for_each(|(out, (own, added))| *out = T::of(own + added));
        }
    }

    /// Puts the diagonal of the sum into the smoother of a level; that of the constant part where it has no inverse.
    pub(super) fn set_diagonal<T: Real, A: Product<T>>(&self, changing: &Blocks<f64>, level: &mut Level<T, A>) {
        let size = changing.shape[0];
        let (area, share) = (size * size, 1.0 / level.largest);
        for row in 0..changing.n_rows() {
            let (columns, blocks) = changing.row_of(row);
            let Ok(own) = columns.binary_search(&(row as u32)) else { continue };
            let constant = &self.constant[(changing.starts[row] + own) * area..][..area];
            let mut diagonal = constant.to_vec();
            for (at, block) in blocks.chunks_exact(area).enumerate() {
                if at == own {
                    diagonal.iter_mut().zip(block).for_each(|(sum, value)| *sum += share * value);
                    continue;
                }
                for (c, entries) in block.chunks_exact(size).enumerate() {
                    diagonal[c * size + c] += share * entries.iter().map(|value| value.abs()).sum::<f64>();
                }
            }
            if !level.set_diagonal(row, &diagonal) {
                level.set_diagonal(row, constant);
            }
        }
    }
}
