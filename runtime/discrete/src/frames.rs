//! Local frames of nodes with a prescribed displacement in a direction that is not an axis.
//!
//! At such a node the residual and the tangent are written in an orthonormal frame whose first axes are the prescribed
//! directions, and those equations are removed, so the prescribed value is exact. Displacements stay in the axes of the
//! scene; only equations and corrections are rotated. Dof `first + k` of such a node is component k in states, and axis
//! k of the frame in residuals, tangents and corrections.

use wfl_sparse::{
    csr::{Csr, Pattern},
    index::NONE,
};

/// The frame of one node.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The first dof of the node.
    pub first: usize,
    /// Orthonormal axes, one for each component.
    pub axes: Vec<Vec<f64>>,
}

/// The frames of a numbering; mostly none.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    list: Vec<Frame>,
    /// By dof: its frame, or [`NONE`]; empty without frames.
    of_dof: Vec<u32>,
}

impl Frames {
    /// Frames of different nodes among `n_dofs` dofs.
    #[must_use]
    pub fn new(list: Vec<Frame>, n_dofs: usize) -> Self {
        let mut of_dof = vec![NONE; if list.is_empty() { 0 } else { n_dofs }];
        for (k, frame) in list.iter().enumerate() {
            of_dof[frame.first..][..frame.axes.len()].fill(u32::try_from(k).expect("fewer than 2^32 nodes"));
        }
        Self { list, of_dof }
    }

    /// True if no node has one.
    #[must_use]
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The frame of the node of a dof.
    #[must_use]
    #[inline]
    pub fn of(&self, dof: usize) -> Option<&Frame> {
        self.of_dof.get(dof).and_then(|k| self.list.get(*k as usize))
    }

    /// Turns a vector by dof from the axes of the scene into the frames.
    pub fn turn(&self, v: &mut [f64]) {
        for frame in &self.list {
            let node = &mut v[frame.first..][..frame.axes.len()];
            let turned: Vec<f64> = frame.axes.iter().map(|axis| dot(axis, node)).collect();
            node.copy_from_slice(&turned);
        }
    }

    /// Turns a vector by dof from the frames back into the axes of the scene.
    pub fn turn_back(&self, v: &mut [f64]) {
        for frame in &self.list {
            let node = &mut v[frame.first..][..frame.axes.len()];
            let along = node.to_vec();
            node.fill(0.0);
            for (axis, size) in frame.axes.iter().zip(along) {
                node.iter_mut().zip(axis).for_each(|(x, a)| *x += size * a);
            }
        }
    }

    /// As [`Self::turn`], in single precision.
    pub fn turn_single(&self, v: &mut [f32]) {
        for frame in &self.list {
            let node = &mut v[frame.first..][..frame.axes.len()];
            let before: Vec<f64> = node.iter().map(|x| f64::from(*x)).collect();
            node.iter_mut().zip(&frame.axes).for_each(|(x, axis)| *x = dot(axis, &before) as f32);
        }
    }

    /// As [`Self::turn_back`], in single precision.
    pub fn turn_back_single(&self, v: &mut [f32]) {
        for frame in &self.list {
            let node = &mut v[frame.first..][..frame.axes.len()];
            let along: Vec<f64> = node.iter().map(|x| f64::from(*x)).collect();
            for (i, x) in node.iter_mut().enumerate() {
                *x = frame.axes.iter().zip(&along).map(|(axis, size)| size * axis[i]).sum::<f64>() as f32;
            }
        }
    }

    /// Rotates magnitudes: an upper bound of the rotated entries.
    pub fn turn_sizes(&self, v: &mut [f64]) {
        for frame in &self.list {
            let node = &mut v[frame.first..][..frame.axes.len()];
            let total = node.iter().fold(0.0f64, |m, x| m.hypot(*x));
            node.fill(total);
        }
    }

    /// Adds a correction of one dof to a state: along the component, or along the axis of its frame.
    #[inline]
    pub fn add(&self, dof: usize, correction: f64, u: &mut [f64]) {
        match self.of(dof) {
            None => u[dof] += correction,
            Some(frame) => {
                let axis = &frame.axes[dof - frame.first];
                for (x, a) in u[frame.first..].iter_mut().zip(axis) {
                    *x += correction * a;
                }
            }
        }
    }

    /// A state along a dof: the component, or the part along the axis of its frame.
    #[must_use]
    #[inline]
    pub fn along(&self, dof: usize, u: &[f64]) -> f64 {
        match self.of(dof) {
            None => u[dof],
            Some(frame) => dot(&frame.axes[dof - frame.first], &u[frame.first..][..frame.axes.len()]),
        }
    }

    /// All frames.
    #[must_use]
    #[inline]
    pub fn list(&self) -> &[Frame] {
        &self.list
    }

    /// The dofs of an entity with all dofs of its rotated nodes, each once: they are coupled after the rotation.
    pub fn complete<'a>(&self, dofs: impl Iterator<Item = &'a u32> + Clone, out: &mut Vec<u32>) {
        out.clear();
        out.extend(dofs.clone());
        if self.list.is_empty() {
            return;
        }
        for dof in dofs {
            if let Some(frame) = self.of(*dof as usize) {
                out.extend((frame.first..frame.first + frame.axes.len()).map(|d| u32::try_from(d).expect("a dof")));
            }
        }
        out.sort_unstable();
        out.dedup();
    }

    /// Turns rows and columns of a matrix whose pattern is made of completed entities; `place` is the row of a dof. The
    /// matrix may have the rows of some nodes alone.
    pub fn turn_matrix(&self, matrix: &mut Csr, place: impl Fn(usize) -> usize) {
        let pattern = matrix.pattern().clone();
        let values = matrix.values_mut();
        let elsewhere = self.rows_beside(&pattern, &place);
        for (frame, elsewhere) in self.list.iter().zip(&elsewhere) {
            let n = frame.axes.len();
            let rows: Vec<usize> = (0..n).map(|k| place(frame.first + k)).collect();
            let start: Vec<usize> = rows.iter().map(|r| pattern.row_starts()[*r]).collect();
            for entry in 0..pattern.row(rows[0]).len() {
                let column: Vec<f64> = start.iter().map(|s| values[s + entry]).collect();
                for (s, axis) in start.iter().zip(&frame.axes) {
                    values[s + entry] = dot(axis, &column);
                }
            }
            // entities couple both ways, so the rows that hold these columns are the columns of these rows
            for row in pattern.row(rows[0]).iter().chain(elsewhere) {
                let places: Option<Vec<usize>> = rows.iter().map(|c| pattern.position(*row as usize, *c)).collect();
                let Some(places) = places else { continue };
                let old: Vec<f64> = places.iter().map(|p| values[*p]).collect();
                for (p, axis) in places.iter().zip(&frame.axes) {
                    values[*p] = dot(axis, &old);
                }
            }
        }
    }

    /// By frame: the rows that hold columns of its node, where the matrix does not have the rows of that node.
    fn rows_beside(&self, pattern: &Pattern, place: impl Fn(usize) -> usize) -> Vec<Vec<u32>> {
        let mut beside = vec![Vec::new(); self.list.len()];
        let mut frame_of = vec![NONE; 0];
        for (k, frame) in (0u32..).zip(&self.list) {
            let row = place(frame.first);
            if pattern.row(row).is_empty() {
                frame_of.resize(pattern.n_cols(), NONE);
                frame_of[row] = k;
            }
        }
        if !frame_of.is_empty() {
            for row in 0..pattern.n_rows() {
                let frames = pattern.row(row).iter().map(|column| frame_of[*column as usize]);
                let row = u32::try_from(row).expect("fewer than 2^32 rows");
                frames.filter(|k| *k != NONE).for_each(|k| beside[k as usize].push(row));
            }
        }
        beside
    }

    /// True if a pattern has the rows and columns that turning needs.
    #[must_use]
    pub fn fit(&self, pattern: &Pattern, place: impl Fn(usize) -> usize) -> bool {
        self.list.iter().all(|frame| {
            let first = pattern.row(place(frame.first));
            (1..frame.axes.len()).all(|k| pattern.row(place(frame.first + k)) == first)
        })
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use wfl_sparse::csr::PatternBuilder;

    /// Dofs 1 and 2 are a node, 0 and 3 are single; a rotated matrix is Q K Q'.
    #[test]
    fn a_turned_matrix_is_that_of_the_turned_basis() {
        let (c, s) = (0.8, 0.6);
        let frames = Frames::new(vec![Frame { first: 1, axes: vec![vec![c, s], vec![-s, c]] }], 4);
        let mut builder = PatternBuilder::new(4, 4);
        let mut list = Vec::new();
        for entity in [&[0u32, 1][..], &[2, 3]] {
            frames.complete(entity.iter(), &mut list);
            builder.add_element(&list);
        }
        let mut matrix = Csr::zeros(builder.build_shared().expect("a small pattern"));
        assert!(frames.fit(matrix.pattern(), |d| d));
        let k = [[2.0, 1.0, 0.0, 0.0], [1.0, 3.0, 0.5, 0.0], [0.0, -0.5, 4.0, 1.5], [0.0, 0.0, 1.0, 5.0]];
        for (i, row) in k.iter().enumerate() {
            for (j, value) in row.iter().enumerate().filter(|(_, v)| **v != 0.0) {
                assert!(matrix.add_to(i, j, *value));
            }
        }
        frames.turn_matrix(&mut matrix, |d| d);
        let q = [[1.0, 0.0, 0.0, 0.0], [0.0, c, s, 0.0], [0.0, -s, c, 0.0], [0.0, 0.0, 0.0, 1.0]];
        for i in 0..4 {
            for j in 0..4 {
                let exact: f64 =
                    (0..4).flat_map(|a| (0..4).map(move |b| (a, b))).map(|(a, b)| q[i][a] * k[a][b] * q[j][b]).sum();
                assert!((matrix.get(i, j) - exact).abs() < 1e-15, "{i} {j}");
            }
        }
        // a correction along the first axis moves the node along it
        let mut u = vec![0.0; 4];
        frames.add(1, 2.0, &mut u);
        assert_eq!(u, [0.0, 1.6, 1.2, 0.0]);
        frames.turn(&mut u);
        assert!((u[1] - 2.0).abs() < 1e-15 && u[2].abs() < 1e-15);
        frames.turn_back(&mut u);
        assert!((u[1] - 1.6).abs() < 1e-15 && (u[2] - 1.2).abs() < 1e-15);
    }
}
