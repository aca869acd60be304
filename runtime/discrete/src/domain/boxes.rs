//! A tree of boxes around the faces that rays may meet.
//!
//! Which faces are near each other is taken from the reference placement, once; the boxes are those of a state, made anew from
//! the leaves up. Promises: each box holds those below it, so that no face is left out whose own box a ray meets, and faces
//! come out in their order whatever the shape of the tree. Does not know faces.

use nalgebra::Vector3;

/// Low and high corner.
pub(super) type Bounds = [Vector3<f64>; 2];

/// Faces in a leaf.
const LEAF: usize = 4;

/// Which faces lie under which node. Nodes stand before those under them.
#[derive(Clone, Debug, Default)]
pub(super) struct BoxTree {
    nodes: Vec<Node>,
    /// The faces, leaf after leaf.
    faces: Vec<u32>,
}

#[derive(Clone, Debug)]
struct Node {
    /// The first node that is not under this one.
    next: usize,
    /// Faces of a leaf; none of other nodes.
    first: usize,
    n: usize,
}

/// The boxes of a state.
#[derive(Clone, Debug)]
pub(super) struct Boxes {
    /// By face.
    pub(super) faces: Vec<Bounds>,
    /// By node of the tree.
    nodes: Vec<Bounds>,
}

fn around(a: &Bounds, b: &Bounds) -> Bounds {
    [a[0].inf(&b[0]), a[1].sup(&b[1])]
}

/// The box of nothing.
fn nothing() -> Bounds {
    [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)]
}

impl BoxTree {
    /// A tree over faces with these boxes.
    pub(super) fn new(boxes: &[Bounds]) -> Self {
        let faces = (0..boxes.len()).map(|k| u32::try_from(k).expect("fewer than 2^32 faces")).collect();
        let mut this = Self { nodes: Vec::new(), faces };
        if !boxes.is_empty() {
            this.split(boxes, 0, boxes.len());
        }
        this
    }

    /// The node over some faces, halved at the median along the axis where their centres are the farthest apart.
    fn split(&mut self, boxes: &[Bounds], first: usize, end: usize) {
        let at = self.nodes.len();
        let is_leaf = end - first <= LEAF;
        self.nodes.push(Node { next: 0, first, n: if is_leaf { end - first } else { 0 } });
        if !is_leaf {
            let centre = |face: u32| boxes[face as usize][0] + boxes[face as usize][1];
            let own = &mut self.faces[first..end];
            let all = own.iter().fold(nothing(), |all, face| around(&all, &[centre(*face); 2]));
            let axis = (all[1] - all[0]).imax();
            own.sort_by(|a, b| centre(*a)[axis].total_cmp(&centre(*b)[axis]).then(a.cmp(b)));
            let middle = first.midpoint(end);
            self.split(boxes, first, middle);
            self.split(boxes, middle, end);
        }
        self.nodes[at].next = self.nodes.len();
    }

    /// The boxes of all nodes, from those of the faces.
    pub(super) fn fit(&self, faces: Vec<Bounds>) -> Boxes {
        let mut nodes = vec![nothing(); self.nodes.len()];
        for (k, node) in self.nodes.iter().enumerate().rev() {
            nodes[k] = if node.n > 0 {
                let own = &self.faces[node.first..node.first + node.n];
                own.iter().fold(nothing(), |all, face| around(&all, &faces[*face as usize]))
            } else {
                around(&nodes[k + 1], &nodes[self.nodes[k + 1].next])
            };
        }
        Boxes { faces, nodes }
    }

    /// Calls `visit` with faces, nearer boxes first where they are under one node, until all others are further away than
    /// the distance that it gave last.
    pub(super) fn nearest(&self, boxes: &Boxes, distance: impl Fn(&Bounds) -> f64, visit: &mut impl FnMut(u32) -> f64) {
        let mut bound = f64::INFINITY;
        let mut open: Vec<(f64, usize)> = boxes.nodes.first().map(|root| (distance(root), 0)).into_iter().collect();
        while let Some((least, k)) = open.pop() {
            let node = &self.nodes[k];
            if least > bound {
                continue;
            }
            if node.n > 0 {
                for face in &self.faces[node.first..node.first + node.n] {
                    if distance(&boxes.faces[*face as usize]) <= bound {
                        bound = visit(*face);
                    }
                }
                continue;
            }
            let [a, b] = [k + 1, self.nodes[k + 1].next].map(|child| (distance(&boxes.nodes[child]), child));
            let (near, far) = if b.0 < a.0 { (b, a) } else { (a, b) };
            open.extend([far, near]);
        }
    }

    /// The faces whose boxes are met, in their order.
    pub(super) fn met(&self, boxes: &Boxes, meets: impl Fn(&Bounds) -> bool, found: &mut Vec<u32>) {
        found.clear();
        let mut k = 0;
        while let Some(node) = self.nodes.get(k) {
            if !meets(&boxes.nodes[k]) {
                k = node.next;
                continue;
            }
            let own = &self.faces[node.first..node.first + node.n];
            found.extend(own.iter().filter(|face| meets(&boxes.faces[**face as usize])));
            k += 1;
        }
        found.sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_box_is_found() {
        for n in [0, 1, 4, 5, 9, 300] {
            let tree = BoxTree::new(&scattered(n));
            let moved: Vec<Bounds> = scattered(n + 13).split_off(13);
            let boxes = tree.fit(moved.clone());
            for probe in scattered(50) {
                let distance = |b: &Bounds| (b[0] - probe[0]).sup(&(probe[0] - b[1])).sup(&Vector3::zeros()).norm();
                let (mut least, mut visited) = (f64::INFINITY, 0);
                tree.nearest(&boxes, distance, &mut |face| {
                    visited += 1;
                    least = least.min(distance(&moved[face as usize]));
                    least
                });
                assert_eq!(least, moved.iter().map(distance).fold(f64::INFINITY, f64::min));
                assert!(visited <= n && (n < 300 || visited < n / 4), "{visited} of {n}");
            }
        }
    }

    /// Boxes of sizes and places that follow no pattern.
    fn scattered(n: u32) -> Vec<Bounds> {
        let part = |k: u32, m: u32| f64::from(k.wrapping_mul(m) % 1009) / 1009.0;
        let low = |k: u32| Vector3::new(part(k, 7919), part(k, 104_729), part(k, 1_299_709));
        (0..n).map(|k| [low(k), low(k) + Vector3::repeat(0.05 * part(k, 611_953))]).collect()
    }

    #[test]
    fn all_boxes_that_are_met_are_found_in_their_order() {
        for n in [0, 1, 4, 5, 9, 300] {
            let tree = BoxTree::new(&scattered(n));
            // the boxes have moved since the tree was made
            let moved: Vec<Bounds> = scattered(n + 13).split_off(13);
            let boxes = tree.fit(moved.clone());
            let mut found = Vec::new();
            for probe in scattered(50) {
                let meets = |b: &Bounds| (0..3).all(|d| b[0][d] <= probe[1][d] + 0.1 && probe[0][d] - 0.1 <= b[1][d]);
                tree.met(&boxes, meets, &mut found);
                let all: Vec<u32> = (0..n).filter(|k| meets(&moved[*k as usize])).collect();
                assert_eq!(found, all);
            }
        }
    }
}
