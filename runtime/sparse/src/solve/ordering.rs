//! Fill-reducing orderings of a symmetric structure.
//!
//! Promises: a permutation, always; the same one for the same input; dofs of one node stay together, in increasing
//! order; the dofs asked to come last come last; the elimination tree of everything before them is postordered, so
//! that each of its subtrees is a contiguous range.
//!
//! With coordinates: nested dissection of the node graph by recursive coordinate bisection (George 1973), separators
//! found on the graph so that hanging or long-range couplings are seen, approximate minimum degree in the leaves.
//! Without: approximate minimum degree on the graph of rows with equal structure.
//! Dofs without an entry on the diagonal (pressures, multipliers) come last in their leaf and in their separator: what
//! is eliminated before gives them a pivot (de Niet and Wubs 2009).
//! Does not use values.

use super::SolveError;
use crate::csr::Pattern;
use wfl_host::memory::refused_by_the_system;

/// Node sets up to this size are ordered by minimum degree.
const LEAF_NODES: usize = 32;
/// Coordinates that differ by less than this part of the bounding box name the same node.
const NODE_TOLERANCE: f64 = 1e-7;
/// How far from the middle a cut may move to follow a mesh plane, as a part of the node count.
const CUT_WINDOW: f64 = 0.1;

/// A permutation of dofs: `forward[new] = old` and `inverse[old] = new`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ordering {
    forward: Vec<u32>,
    inverse: Vec<u32>,
    n_first: usize,
}

impl Ordering {
    /// Old place of each new place.
    pub fn forward(&self) -> &[u32] {
        &self.forward
    }

    /// New place of each old place.
    pub fn inverse(&self) -> &[u32] {
        &self.inverse
    }

    /// Number of dofs before those that were asked to come last.
    pub fn n_first(&self) -> usize {
        self.n_first
    }

    /// That with these old places.
    pub(super) fn from_forward(forward: Vec<u32>, n_first: usize) -> Self {
        let mut inverse = vec![0u32; forward.len()];
        for (new, &old) in forward.iter().enumerate() {
            inverse[old as usize] = new as u32;
        }
        Self { forward, inverse, n_first }
    }
}

/// Orders the dofs of a square pattern, which is read as the pattern of `A + Aᵀ`.
///
/// `coordinates`, one point a dof in any length unit, choose nested dissection; `last` lists dofs to be put at the
/// end, in the order of the rest of the rules.
///
/// # Errors
/// [`SolveError::Shape`] when the pattern is not square, the coordinates are not one a dof, or a dof in `last` does
/// not exist; [`SolveError::TooMuchMemory`] when the work space cannot be had.
pub fn order(pattern: &Pattern, coordinates: Option<&[[f64; 3]]>, last: &[u32]) -> Result<Ordering, SolveError> {
    let n = pattern.n_rows();
    if pattern.n_cols() != n {
        return Err(SolveError::Shape { what: "columns of a square matrix", expected: n, found: pattern.n_cols() });
    }
    if let Some(points) = coordinates
        && points.len() != n
    {
        return Err(SolveError::Shape { what: "coordinates, one a dof", expected: n, found: points.len() });
    }
    let mut is_last = vec![false; n];
    for &dof in last {
        *is_last.get_mut(dof as usize).ok_or(SolveError::Shape {
            what: "dof to be ordered last",
            expected: n,
            found: dof as usize,
        })? = true;
    }
    // Without usable coordinates (absent, or not finite) minimum degree needs none.
    let points = coordinates.filter(|points| points.iter().flatten().all(|x| x.is_finite()));
    let symmetric;
    let pattern = if pattern.is_symmetric() {
        pattern
    } else {
        symmetric = pattern.union(&pattern.transpose().0)?;
        &symmetric
    };
    let is_bare: Vec<bool> = (0..n).map(|dof| pattern.position(dof, dof).is_none()).collect();
    let nodes = match points {
        Some(points) => Nodes::by_coordinates(points, &is_last, &is_bare),
        None => Nodes::by_structure(pattern, &is_last),
    };
    let graph = Graph::new(pattern, &nodes);
    let bare = (0..nodes.len() as u32).map(|node| is_bare[nodes.dofs(node)[0] as usize]).collect();
    let (mut first, mut end): (Vec<u32>, Vec<u32>) =
        (0..nodes.len() as u32).partition(|&node| !is_last[nodes.dofs(node)[0] as usize]);
    let centres: Option<Vec<[f64; 3]>> =
        points.map(|points| (0..nodes.len() as u32).map(|node| points[nodes.dofs(node)[0] as usize]).collect());
    let mut dissection =
        Dissection { graph: &graph, centres: centres.as_deref(), bare, part: vec![OUTSIDE; graph.len()] };
    for part in [&mut first, &mut end] {
        dissection.order(part)?;
    }
    let n_first = first.iter().map(|&node| nodes.dofs(node).len()).sum();
    let forward = first.iter().chain(&end).flat_map(|&node| nodes.dofs(node)).copied().collect();
    Ok(postordered(pattern, Ordering::from_forward(forward, n_first)))
}

/// Groups of dofs that are eliminated together.
struct Nodes {
    starts: Vec<usize>,
    dofs: Vec<u32>,
}

impl Nodes {
    fn len(&self) -> usize {
        self.starts.len() - 1
    }

    fn dofs(&self, node: u32) -> &[u32] {
        &self.dofs[self.starts[node as usize]..self.starts[node as usize + 1]]
    }

    fn by_coordinates(points: &[[f64; 3]], is_last: &[bool], is_bare: &[bool]) -> Self {
        let extent = (0..3)
            .map(|axis| {
                let values = || points.iter().map(|point| point[axis]);
                values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
            })
            .fold(0.0, f64::max);
        let unit = if extent > 0.0 { extent * NODE_TOLERANCE } else { 1.0 };
        let key = |dof: u32| {
            let point = points[dof as usize];
            (is_last[dof as usize], point.map(|x| (x / unit).round() as i64), is_bare[dof as usize])
        };
        let mut keyed: Vec<_> = (0..points.len() as u32).map(|dof| (key(dof), dof)).collect();
        keyed.sort_unstable();
        let mut starts = vec![0];
        for i in 1..keyed.len() {
            if keyed[i].0 != keyed[i - 1].0 {
                starts.push(i);
            }
        }
        if !keyed.is_empty() {
            starts.push(keyed.len());
        }
        Self { starts, dofs: keyed.into_iter().map(|(_, dof)| dof).collect() }
    }

    /// Neighbouring rows with the same columns are one node: the usual numbering puts the components of a vector
    /// field side by side.
    fn by_structure(pattern: &Pattern, is_last: &[bool]) -> Self {
        let n = pattern.n_rows();
        let starts = (0..n)
            .filter(|&i| i == 0 || is_last[i] != is_last[i - 1] || pattern.row(i) != pattern.row(i - 1))
            .chain(std::iter::once(n))
            .collect();
        Self { starts, dofs: (0..n as u32).collect() }
    }
}

/// Adjacency of nodes, without loops, each list increasing.
struct Graph {
    starts: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Graph {
    fn new(pattern: &Pattern, nodes: &Nodes) -> Self {
        let mut node_of = vec![0u32; pattern.n_rows()];
        for node in 0..nodes.len() as u32 {
            for &dof in nodes.dofs(node) {
                node_of[dof as usize] = node;
            }
        }
        let mut last_seen = vec![u32::MAX; nodes.len()];
        let mut starts = vec![0];
        let mut neighbours = Vec::new();
        for node in 0..nodes.len() as u32 {
            last_seen[node as usize] = node;
            let begin = neighbours.len();
            for &dof in nodes.dofs(node) {
                for &column in pattern.row(dof as usize) {
                    let other = node_of[column as usize];
                    if last_seen[other as usize] != node {
                        last_seen[other as usize] = node;
                        neighbours.push(other);
                    }
                }
            }
            neighbours[begin..].sort_unstable();
            starts.push(neighbours.len());
        }
        Self { starts, neighbours }
    }

    fn len(&self) -> usize {
        self.starts.len() - 1
    }

    fn neighbours(&self, node: u32) -> &[u32] {
        &self.neighbours[self.starts[node as usize]..self.starts[node as usize + 1]]
    }
}

/// The state of one recursive bisection.
struct Dissection<'a> {
    graph: &'a Graph,
    centres: Option<&'a [[f64; 3]]>,
    /// By node: no entry on the diagonal.
    bare: Vec<bool>,
    /// Which part a node is in while one set is split (see the constants below), or its number in a leaf.
    part: Vec<u32>,
}

const OUTSIDE: u32 = u32::MAX;
const LOWER: u32 = 0;
const UPPER: u32 = 1;
const SEPARATOR: u32 = 2;

impl Dissection<'_> {
    /// Reorders a set of nodes in place.
    fn order(&mut self, nodes: &mut [u32]) -> Result<(), SolveError> {
        // An explicit stack: the depth of the recursion must not depend on the mesh.
        let mut open: Vec<(usize, usize)> = vec![(0, nodes.len())];
        while let Some((begin, end)) = open.pop() {
            let set = &mut nodes[begin..end];
            match self.centres {
                Some(centres) if set.len() > LEAF_NODES => match self.split(set, centres) {
                    Some((n_lower, n_upper)) => {
                        open.push((begin, begin + n_lower));
                        open.push((begin + n_lower, begin + n_lower + n_upper));
                        // The front of the separator is dense in any order.
                        self.bare_last(&mut set[n_lower + n_upper..]);
                    }
                    None => self.minimum_degree(set)?,
                },
                Some(_) => {
                    self.minimum_degree(set)?;
                    self.bare_last(set);
                }
                None => self.minimum_degree(set)?,
            }
        }
        Ok(())
    }

    /// Nodes without an entry on the diagonal behind the others.
    fn bare_last(&self, set: &mut [u32]) {
        set.sort_by_key(|&node| self.bare[node as usize]);
    }

    /// Sorts a set into lower part, upper part, separator; the sizes of the first two. `None` when no cut helps.
    fn split(&mut self, set: &mut [u32], centres: &[[f64; 3]]) -> Option<(usize, usize)> {
        let mut best: Option<(f64, usize, f64)> = None;
        let mut sorted = set.to_vec();
        for axis in 0..3 {
            sort_along(&mut sorted, centres, axis);
            for cut in cuts(&sorted, centres, axis) {
                let (n_separator, n_lower, n_upper) = self.mark(&sorted, cut);
                self.clear(&sorted);
                if n_lower == 0 || n_upper == 0 {
                    continue;
                }
                let balance = n_lower.max(n_upper) as f64 / (sorted.len() - n_separator) as f64;
                let cost = n_separator as f64 * (0.5 + balance);
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, cut as f64));
                }
            }
        }
        let (_, axis, cut) = best?;
        sort_along(&mut sorted, centres, axis);
        let (n_separator, n_lower, n_upper) = self.mark(&sorted, cut as usize);
        if n_separator * 2 > sorted.len() {
            self.clear(&sorted);
            return None;
        }
        let mut places = [0, n_lower, n_lower + n_upper];
        for &node in &sorted {
            let place = &mut places[self.part[node as usize] as usize];
            set[*place] = node;
            *place += 1;
        }
        self.clear(&sorted);
        Some((n_lower, n_upper))
    }

    /// Marks the parts for the cut that puts `sorted[..cut]` below. The separator is the smaller of the two layers of
    /// nodes with an edge across the cut, less those that turn out not to be needed.
    fn mark(&mut self, sorted: &[u32], cut: usize) -> (usize, usize, usize) {
        for (place, &node) in sorted.iter().enumerate() {
            self.part[node as usize] = if place < cut { LOWER } else { UPPER };
        }
        let touches = |part: &[u32], node: u32, wanted: u32| {
            self.graph.neighbours(node).iter().any(|&other| part[other as usize] == wanted)
        };
        let lower_layer = sorted[..cut].iter().filter(|&&node| touches(&self.part, node, UPPER)).count();
        let upper_layer = sorted[cut..].iter().filter(|&&node| touches(&self.part, node, LOWER)).count();
        let take_lower = match lower_layer.cmp(&upper_layer) {
            std::cmp::Ordering::Less => true,
            std::cmp::Ordering::Greater => false,
            // Equal layers: take the one from the larger side.
            std::cmp::Ordering::Equal => 2 * cut >= sorted.len(),
        };
        let (side, other_part) = if take_lower { (&sorted[..cut], UPPER) } else { (&sorted[cut..], LOWER) };
        let layer: Vec<u32> = side.iter().copied().filter(|&node| touches(&self.part, node, other_part)).collect();
        for &node in &layer {
            self.part[node as usize] = SEPARATOR;
        }
        let own_part = 1 - other_part;
        let mut n_separator = layer.len();
        let mut moved = 0;
        for &node in &layer {
            // Nothing of its own side left beside it: it can join the other side.
            if !touches(&self.part, node, own_part) {
                self.part[node as usize] = other_part;
                n_separator -= 1;
                moved += 1;
            }
        }
        let n_own = side.len() - layer.len();
        let n_other = sorted.len() - side.len() + moved;
        if take_lower { (n_separator, n_own, n_other) } else { (n_separator, n_other, n_own) }
    }

    fn clear(&mut self, set: &[u32]) {
        for &node in set {
            self.part[node as usize] = OUTSIDE;
        }
    }

    /// Approximate minimum degree of the graph of a set.
    fn minimum_degree(&mut self, set: &mut [u32]) -> Result<(), SolveError> {
        if set.len() < 3 {
            return Ok(());
        }
        for (place, &node) in set.iter().enumerate() {
            self.part[node as usize] = place as u32;
        }
        let mut starts = vec![0u32];
        let mut neighbours = Vec::new();
        for &node in set.iter() {
            let inside = self.graph.neighbours(node).iter().map(|&other| self.part[other as usize]);
            neighbours.extend(inside.filter(|&place| place != OUTSIDE));
            let begin = starts[starts.len() - 1] as usize;
            neighbours[begin..].sort_unstable();
            starts.push(neighbours.len() as u32);
        }
        self.clear(set);
        let places = wfl_dense::minimum_degree(&starts, &neighbours)
            .map_err(|_| refused_by_the_system(None, "minimum degree ordering"))?;
        let before = set.to_vec();
        for (target, place) in set.iter_mut().zip(places) {
            *target = before[place as usize];
        }
        Ok(())
    }
}

/// Sorts nodes by one coordinate, then by number.
fn sort_along(nodes: &mut [u32], centres: &[[f64; 3]], axis: usize) {
    nodes.sort_unstable_by(|&a, &b| {
        let along = |node: u32| centres[node as usize][axis];
        along(a).total_cmp(&along(b)).then(a.cmp(&b))
    });
}

/// Places to cut a sorted set: the steps of the coordinate nearest to the middle on both sides, else the middle.
fn cuts(sorted: &[u32], centres: &[[f64; 3]], axis: usize) -> Vec<usize> {
    let middle = sorted.len() / 2;
    let along = |place: usize| centres[sorted[place] as usize][axis];
    let extent = along(sorted.len() - 1) - along(0);
    if extent <= 0.0 {
        return Vec::new();
    }
    let is_step = |place: usize| along(place) - along(place - 1) > extent * NODE_TOLERANCE;
    let window = (sorted.len() as f64 * CUT_WINDOW) as usize;
    let (lowest, highest) = (middle.saturating_sub(window).max(1), (middle + window).min(sorted.len() - 1));
    let below = (lowest..=middle).rev().find(|&place| is_step(place));
    let above = (middle + 1..=highest).find(|&place| is_step(place));
    match (below, above) {
        (None, None) => vec![middle],
        _ => below.into_iter().chain(above).collect(),
    }
}

/// Renumbers so that the children of every place of the elimination tree of the first part come directly before it.
/// This changes neither fill nor arithmetic, only the order in which independent places are listed.
fn postordered(pattern: &Pattern, ordering: Ordering) -> Ordering {
    let n_first = ordering.n_first;
    let parent = elimination_tree(pattern, &ordering);
    let mut first_child = vec![u32::MAX; n_first];
    let mut sibling = vec![u32::MAX; n_first];
    let mut roots = Vec::new();
    for place in (0..n_first).rev() {
        match parent[place] {
            above if (above as usize) < n_first => {
                sibling[place] = first_child[above as usize];
                first_child[above as usize] = place as u32;
            }
            _ => roots.push(place as u32),
        }
    }
    let mut forward = Vec::with_capacity(ordering.forward.len());
    let mut path = Vec::new();
    for &root in roots.iter().rev() {
        path.push(root);
        while let Some(&place) = path.last() {
            let child = first_child[place as usize];
            if child == u32::MAX {
                path.pop();
                forward.push(ordering.forward[place as usize]);
            } else {
                first_child[place as usize] = sibling[child as usize];
                path.push(child);
            }
        }
    }
    forward.extend_from_slice(&ordering.forward[n_first..]);
    Ordering::from_forward(forward, n_first)
}

/// Parent of every place in the elimination tree of the reordered pattern (Liu 1990, with path compression);
/// `u32::MAX` for a root.
fn elimination_tree(pattern: &Pattern, ordering: &Ordering) -> Vec<u32> {
    let n = pattern.n_rows();
    let mut parent = vec![u32::MAX; n];
    let mut ancestor = vec![u32::MAX; n];
    for place in 0..n as u32 {
        for &column in pattern.row(ordering.forward[place as usize] as usize) {
            let mut below = ordering.inverse[column as usize];
            while below < place {
                let next = ancestor[below as usize];
                ancestor[below as usize] = place;
                if next == u32::MAX {
                    parent[below as usize] = place;
                    break;
                }
                below = next;
            }
        }
    }
    parent
}

#[cfg(test)]
mod tests {
    use super::super::problems::{BoxOptions, ElasticBox};
    use super::*;
    use crate::csr::PatternBuilder;

    fn sample() -> ElasticBox {
        ElasticBox::new(&BoxOptions { cells: [6, 8, 8], cut: Some(3), fix_low: true, fix_high: false })
    }

    /// Entries of the factor, by elimination on sets.
    fn fill(pattern: &Pattern, ordering: &Ordering) -> usize {
        let parent = elimination_tree(pattern, ordering);
        let mut rows: Vec<Vec<u32>> = vec![Vec::new(); pattern.n_rows()];
        let mut count = 0;
        for place in 0..pattern.n_rows() {
            let old = ordering.forward()[place] as usize;
            let mut below = std::mem::take(&mut rows[place]);
            below.extend(pattern.row(old).iter().map(|&c| ordering.inverse()[c as usize]));
            below.retain(|&row| row as usize > place);
            below.sort_unstable();
            below.dedup();
            count += 1 + below.len();
            if parent[place] != u32::MAX {
                rows[parent[place] as usize].extend(below);
            }
        }
        count
    }

    fn is_permutation(ordering: &Ordering) {
        let mut seen = ordering.forward().to_vec();
        seen.sort_unstable();
        assert!(seen.iter().zip(0..).all(|(&dof, place)| dof == place));
        assert!((0..seen.len()).all(|new| ordering.inverse()[ordering.forward()[new] as usize] as usize == new));
    }

    #[test]
    fn every_kind_of_ordering_is_a_permutation_with_the_last_dofs_last() {
        let problem = sample();
        for points in [None, Some(&problem.coordinates[..])] {
            for last in [&[][..], &problem.interface[..]] {
                let ordering = order(problem.matrix.pattern(), points, last).unwrap();
                is_permutation(&ordering);
                assert_eq!(ordering.n_first(), problem.n() - last.len());
                let mut end = ordering.forward()[ordering.n_first()..].to_vec();
                end.sort_unstable();
                assert_eq!(end, last);
                let parent = elimination_tree(problem.matrix.pattern(), &ordering);
                let mut subtree: Vec<usize> = (0..parent.len()).collect();
                for place in 0..ordering.n_first() {
                    // Postorder: the first dof of the subtree below each place starts where the one before ends.
                    let above = parent[place] as usize;
                    if above < ordering.n_first() {
                        subtree[above] = subtree[above].min(subtree[place]);
                        assert!(subtree[above] <= place && above > place);
                    }
                }
                for place in 1..ordering.n_first() {
                    assert!(subtree[place] == place || parent[place - 1] as usize == place);
                }
            }
        }
    }

    #[test]
    fn dissection_beats_the_natural_order_and_is_no_worse_than_minimum_degree() {
        let problem = ElasticBox::new(&BoxOptions { cells: [10, 10, 10], cut: None, fix_low: true, fix_high: false });
        let pattern = problem.matrix.pattern();
        let natural = Ordering::from_forward((0..problem.n() as u32).collect(), problem.n());
        let [natural, degree, dissected] =
            [natural, order(pattern, None, &[]).unwrap(), order(pattern, Some(&problem.coordinates), &[]).unwrap()]
                .map(|ordering| fill(pattern, &ordering) as f64);
        assert!(dissected < 0.6 * natural && dissected < 1.02 * degree, "{natural} {degree} {dissected}");
    }

    #[test]
    fn odd_graphs_are_ordered_too() {
        // An unsymmetric pattern, isolated dofs, equal and infinite points.
        let mut builder = PatternBuilder::new(500, 500);
        (0..400u32).for_each(|i| builder.add_coupling(&[i], &[(i * 17 + 5) % 400, i]));
        let pattern = builder.build().unwrap();
        for points in [vec![[0.0; 3]; 500], vec![[f64::INFINITY, 0.0, 0.0]; 500], {
            (0..500).map(|i| [f64::from(i % 20), f64::from(i / 20), 0.0]).collect()
        }] {
            let ordering = order(&pattern, Some(&points), &[7, 3]).unwrap();
            is_permutation(&ordering);
            let mut end = ordering.forward()[498..].to_vec();
            end.sort_unstable();
            assert_eq!(end, [3, 7]);
        }
        let nothing = order(&Pattern::empty(0, 0), Some(&[]), &[]).unwrap();
        assert!(nothing.forward().is_empty());
        assert!(order(&pattern, Some(&[]), &[]).is_err() && order(&pattern, None, &[500]).is_err());
    }
}
