//! Search for points near a point: a uniform grid as a sorted list of occupied boxes.
//!
//! Promises: the order of the results depends only on the input. Does not adapt to strongly graded point clouds.

/// Points sorted into boxes of a uniform grid.
pub(super) struct PointGrid<'a> {
    points: &'a [[f64; 3]],
    low: [f64; 3],
    box_size: f64,
    entries: Vec<([i32; 3], u32)>,
}

impl<'a> PointGrid<'a> {
    /// Sorts the points selected by `members` (positions in `points`). The points are finite.
    pub(super) fn new(points: &'a [[f64; 3]], members: &[u32], dim: usize) -> Self {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for member in members {
            let x = points[*member as usize];
            for i in 0..3 {
                low[i] = low[i].min(x[i]);
                high[i] = high[i].max(x[i]);
            }
        }
        let extent = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
        // About one point a box along each axis; the cap keeps box numbers inside i32.
        let mut per_axis = 1.0;
        let reaches = |n: f64| (0..dim).map(|_| n).product::<f64>() >= members.len() as f64;
        while !reaches(per_axis) && per_axis < 1e6 {
            per_axis *= 2.0;
        }
        let box_size = if extent > 0.0 { extent / per_axis } else { 1.0 };
        let mut grid = PointGrid { points, low, box_size, entries: Vec::with_capacity(members.len()) };
        for member in members {
            let key = grid.key(points[*member as usize]);
            grid.entries.push((key, *member));
        }
        grid.entries.sort_unstable();
        grid
    }

    fn key(&self, x: [f64; 3]) -> [i32; 3] {
        // A float-to-int cast saturates, so far points only fall into far boxes.
        std::array::from_fn(|i| ((x[i] - self.low[i]) / self.box_size).floor() as i32)
    }

    /// Calls `visit(member, distance)` for every point within `radius` of `x`, in a fixed order.
    pub(super) fn near(&self, x: [f64; 3], radius: f64, mut visit: impl FnMut(u32, f64)) {
        let low = self.key(x.map(|c| c - radius));
        let high = self.key(x.map(|c| c + radius));
        let mut report = |slice: &[([i32; 3], u32)]| {
            for (_, member) in slice {
                let distance = crate::vector::distance(self.points[*member as usize], x);
                if distance <= radius {
                    visit(*member, distance);
                }
            }
        };
        let boxes: f64 = (0..2).map(|i| f64::from(high[i]) - f64::from(low[i]) + 1.0).product();
        if boxes > self.entries.len() as f64 {
            report(&self.entries);
            return;
        }
        for i in low[0]..=high[0] {
            for j in low[1]..=high[1] {
                let from = self.entries.partition_point(|(key, _)| *key < [i, j, low[2]]);
                let count = self.entries[from..].partition_point(|(key, _)| *key <= [i, j, high[2]]);
                report(&self.entries[from..from + count]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_finds_what_a_full_search_finds() {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        let points: Vec<[f64; 3]> = (0..300).map(|_| [next() - 3.0, next(), 0.1 * next()]).collect();
        let members: Vec<u32> = (0..300).filter(|i| i % 3 != 0).collect();
        let grid = PointGrid::new(&points, &members, 3);
        for radius in [0.0, 1e-3, 0.05, 0.4, 10.0] {
            for x in &points {
                let mut found = Vec::new();
                grid.near(*x, radius, |m, _| found.push(m));
                found.sort_unstable();
                let inside = |m: &&u32| crate::vector::distance(points[**m as usize], *x) <= radius;
                let expected: Vec<u32> = members.iter().filter(inside).copied().collect();
                assert_eq!(found, expected);
            }
        }
    }
}
