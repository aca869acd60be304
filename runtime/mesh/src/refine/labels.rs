//! Which edge of a simplex is halved next, and what that leaves for its halves.
//!
//! Triangles and segments: newest-vertex bisection, the edge opposite the newest vertex comes next (Mitchell 1989).
//! Tetrahedra: one edge of each face is marked, and the refinement edge is marked on both its faces (Arnold, Mukherjee
//! and Pouly, SIAM J. Sci. Comput. 22, 2000, algorithm BisectTet): conforming at all times, and at most 72 shapes of each
//! cell of the first mesh. Promises: the first labels depend on a total order of the edges alone, so two cells with a
//! common face mark the same edge of it. Does not know which cells are to be refined.

use crate::{
    cell::{CellKind, Subdivision},
    mesh::Mesh,
    vector::{difference, dot},
};

/// Two places in a cell, the lower one first.
pub(super) type Ends = [u8; 2];

/// What a simplex remembers between bisections.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(super) struct Label {
    /// The edge that is halved next.
    pub(super) refinement: Ends,
    /// Of a tetrahedron: the marked edge of the face opposite each vertex.
    faces: [Ends; 4],
    /// Of a tetrahedron whose marked edges lie in one plane: its parent's did, too.
    flagged: bool,
}

fn ends(a: usize, b: usize) -> Ends {
    [a.min(b) as u8, a.max(b) as u8]
}

/// Lengths whose squares agree to this many bits less than a number has are equal: what is left is rounding of the
/// coordinates, and equal edges are told apart by their nodes.
const ROUNDED_BITS: u32 = 24;

/// The labels of the cells of a mesh: the longest edge of each face is marked. `same[node]` is the node that stands for
/// all nodes at one place.
pub(super) fn first_labels(shape: &Mesh, same: impl Fn(u32) -> u32) -> Vec<Label> {
    let label = |cell| {
        let (kind, nodes) = (shape.kind(cell), shape.cell_vertices(cell));
        if kind.subdivision() != Some(Subdivision::Bisection) {
            return Label::default();
        }
        let key = |[a, b]: [usize; 2]| {
            let [a, b] = [a, b].map(|k| same(nodes[k].index() as u32));
            let [low, high] = [a.min(b), a.max(b)];
            let [x, y] = [low, high].map(|n| shape.nodes()[n as usize]);
            let along = difference(y, x);
            let length = dot(along, along).to_bits().saturating_add(1 << (ROUNDED_BITS - 1)) >> ROUNDED_BITS;
            (length, high, low)
        };
        let longest = |without: Option<usize>| {
            let among = kind.edges().iter().filter(|e| without.is_none_or(|v| !e.contains(&v)));
            among.copied().max_by_key(|e| key(*e)).map_or([0, 1], |[a, b]| ends(a, b))
        };
        let mut label = Label { refinement: longest(None), ..Label::default() };
        if kind == CellKind::Tetrahedron {
            label.faces = std::array::from_fn(|vertex| longest(Some(vertex)));
        }
        label
    };
    shape.cells().map(label).collect()
}

impl Label {
    /// The label of the half in which the new vertex takes the place `replaced`, one end of the refinement edge.
    pub(super) fn half(&self, kind: CellKind, replaced: usize) -> Label {
        let [a, b] = self.refinement.map(usize::from);
        let kept = if replaced == a { b } else { a };
        let others: Vec<usize> = (0..kind.n_vertices()).filter(|v| *v != a && *v != b).collect();
        match others[..] {
            [] => *self,
            [other] => Label { refinement: ends(kept, other), ..*self },
            [first, second, ..] => self.half_of_tetrahedron([replaced, kept], [first, second]),
        }
    }

    /// Steps 3 to 6 of BisectTet; `[replaced, kept]` are the ends of the refinement edge.
    fn half_of_tetrahedron(&self, [replaced, kept]: [usize; 2], others: [usize; 2]) -> Label {
        let inherited = self.faces[replaced];
        let mut faces = self.faces;
        // the halves of the two faces at the refinement edge: the edge opposite the new vertex
        for (k, other) in others.iter().enumerate() {
            faces[others[1 - k]] = ends(kept, *other);
        }
        let planar = self.common_plane([replaced, kept], others);
        faces[kept] = match planar {
            // the edge from the new vertex to the next refinement edge
            Some(shared) if self.flagged => ends(replaced, shared),
            _ => ends(others[0], others[1]),
        };
        Label { refinement: inherited, faces, flagged: planar.is_some() && !self.flagged }
    }

    /// The third vertex of the face in which all marked edges lie, if there is one.
    fn common_plane(&self, [a, b]: [usize; 2], others: [usize; 2]) -> Option<usize> {
        others.into_iter().find(|v| self.faces[a] == ends(b, *v) && self.faces[b] == ends(a, *v))
    }
}
