//! Meshes of several files as one: each at its place, side by side without common nodes.
//!
//! Promises: a placement keeps shapes and orientations (motions, turns, positive factors), so cells stay sound; groups of
//! one name and one dimension become one, and which they are is told. Does not join nodes that coincide.

use super::{
    Group, GroupEntities, GroupFacet, Mesh, MeshError, MeshWarnings, NodeId, RawMesh, index::CellId, second_order,
};

/// Where the mesh of a file is put: `x -> factor * turn x + shift`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    linear: [[f64; 3]; 3],
    shift: [f64; 3],
}

impl Default for Placement {
    fn default() -> Self {
        Placement { linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], shift: [0.0; 3] }
    }
}

impl Placement {
    /// This one, then a motion.
    #[must_use]
    pub fn moved(mut self, by: [f64; 3]) -> Self {
        (0..3).for_each(|d| self.shift[d] += by[d]);
        self
    }

    /// This one, then all lengths from the origin times a factor.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.linear.as_flattened_mut().iter_mut().chain(&mut self.shift).for_each(|x| *x *= factor);
        self
    }

    /// This one, then a turn about an axis through the origin, which has a length; right angles are exact.
    #[must_use]
    pub fn turned(self, degrees: f64, axis: [f64; 3]) -> Self {
        let length = axis.iter().map(|k| k * k).sum::<f64>().sqrt();
        let k = axis.map(|x| x / length);
        let (sine, cosine) = match degrees.rem_euclid(360.0) {
            0.0 => (0.0, 1.0),
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            other => other.to_radians().sin_cos(),
        };
        // Rodrigues' formula, column by column
        let turn = |x: [f64; 3]| -> [f64; 3] {
            let along = (0..3).map(|d| k[d] * x[d]).sum::<f64>() * (1.0 - cosine);
            std::array::from_fn(|d| {
                let (i, j) = ((d + 1) % 3, (d + 2) % 3);
                cosine * x[d] + sine * (k[i] * x[j] - k[j] * x[i]) + along * k[d]
            })
        };
        let column = |j: usize| turn([0, 1, 2].map(|i| self.linear[i][j]));
        let columns = [column(0), column(1), column(2)];
        Placement { linear: std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i])), shift: turn(self.shift) }
    }

    /// Where a point goes.
    #[must_use]
    pub fn of(&self, x: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (0..3).map(|j| self.linear[i][j] * x[j]).sum::<f64>() + self.shift[i])
    }
}

/// A mesh of several ones.
#[derive(Debug)]
pub struct Together {
    /// All of them.
    pub mesh: Mesh,
    /// Names of groups that stand in several of them, and are one here.
    pub joined: Vec<String>,
}

/// Meshes at their places as one. Those of first order get nodes in the middle of their edges where others are of second
/// order. Numbers of elements and nodes are counted on from one mesh to the next.
///
/// # Errors
/// [`MeshError::OtherDimension`], and what [`Mesh::from_raw`] finds.
pub fn together(meshes: Vec<(Mesh, Placement)>) -> Result<Together, MeshError> {
    let order = meshes.iter().map(|(mesh, _)| mesh.order()).max().unwrap_or(1);
    let mut all = RawMesh { order, ..RawMesh::default() };
    let mut joined = Vec::new();
    let mut warnings = MeshWarnings::default();
    for (mesh, place) in meshes {
        if all.dim != 0 && all.dim != mesh.dim() {
            return Err(MeshError::OtherDimension { first: all.dim, other: mesh.dim() });
        }
        all.dim = mesh.dim();
        let turned = mesh.warnings().turned_cells.clone();
        let mesh = if order > 1 { second_order(mesh)? } else { mesh };
        let (nodes, cells) = (all.nodes.len(), all.kinds.len());
        warnings.turned_cells.extend(turned.iter().map(|c| CellId::new(c.index() + cells)));
        let raw = mesh.into_raw();
        for (list, new) in [(&mut all.numbers.cells, raw.numbers.cells), (&mut all.numbers.nodes, raw.numbers.nodes)] {
            let highest = list.iter().copied().max().unwrap_or(0);
            list.extend(new.into_iter().map(|number| number + highest));
        }
        all.nodes.extend(raw.nodes.into_iter().map(|x| place.of(x)));
        all.kinds.extend(raw.kinds);
        all.connectivity.extend(raw.connectivity.into_iter().map(|n| n + nodes as u32));
        for group in raw.groups {
            let group = Group { entities: shifted(group.entities, nodes, cells), ..group };
            match all.groups.iter_mut().find(|g| g.name == group.name && g.dim == group.dim) {
                Some(known) => {
                    add(&mut known.entities, group.entities);
                    if !joined.contains(&group.name) {
                        joined.push(group.name);
                    }
                }
                None => all.groups.push(group),
            }
        }
    }
    let mut mesh = Mesh::from_raw(all)?;
    mesh.warnings.turned_cells = warnings.turned_cells;
    Ok(Together { mesh, joined })
}

/// The members of a group with numbers counted on.
fn shifted(entities: GroupEntities, nodes: usize, cells: usize) -> GroupEntities {
    let node = |n: NodeId| NodeId::new(n.index() + nodes);
    match entities {
        GroupEntities::Cells(list) => {
            GroupEntities::Cells(list.into_iter().map(|c| CellId::new(c.index() + cells)).collect())
        }
        GroupEntities::Facets(list) => {
            let facet = |f: GroupFacet| GroupFacet { kind: f.kind, vertices: f.vertices.map(node) };
            GroupEntities::Facets(list.into_iter().map(facet).collect())
        }
        GroupEntities::Nodes { nodes: list, edges } => GroupEntities::Nodes {
            nodes: list.into_iter().map(node).collect(),
            edges: edges.into_iter().map(|ends| ends.map(node)).collect(),
        },
    }
}

/// Adds members of the same kind.
fn add(to: &mut GroupEntities, more: GroupEntities) {
    match (to, more) {
        (GroupEntities::Cells(to), GroupEntities::Cells(more)) => to.extend(more),
        (GroupEntities::Facets(to), GroupEntities::Facets(more)) => to.extend(more),
        (GroupEntities::Nodes { nodes, edges }, GroupEntities::Nodes { nodes: n, edges: e }) => {
            nodes.extend(n);
            edges.extend(e);
        }
        // groups of one dimension in meshes of one dimension have one kind of members
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BoxShape, cell_volumes, generate_box};

    fn square(order: usize, name: &str) -> Mesh {
        let mesh = generate_box([0.0; 3], [1.0, 1.0, 0.0], [2, 2, 1], 2, BoxShape::Triangle).unwrap();
        let mut raw = mesh.into_raw();
        let all = (0..raw.kinds.len()).map(CellId::new).collect();
        raw.groups.push(Group { name: name.to_owned(), dim: 2, entities: GroupEntities::Cells(all) });
        let mesh = Mesh::from_raw(raw).unwrap();
        if order > 1 { second_order(mesh).unwrap() } else { mesh }
    }

    #[test]
    fn meshes_of_two_orders_stand_side_by_side() {
        let there = Placement::default().turned(90.0, [0.0, 0.0, 1.0]).scaled(2.0).moved([5.0, 0.0, 0.0]);
        let meshes = vec![(square(1, "a"), Placement::default()), (square(2, "a"), there), (square(1, "b"), there)];
        let Together { mesh, joined } = together(meshes).unwrap();
        assert_eq!((joined, mesh.order(), mesh.groups().len(), mesh.n_cells()), (vec!["a".to_owned()], 2, 2, 24));
        let area: f64 = cell_volumes(&mesh, &mesh.cells().collect::<Vec<_>>()).iter().sum();
        assert!((area - 9.0).abs() < 1e-13);
        // a quarter of a turn takes the square to x from -1 to 0
        assert_eq!(mesh.bounds(), ([0.0; 3], [5.0, 2.0, 0.0]));
        let line = generate_box([0.0; 3], [1.0, 0.0, 0.0], [2, 1, 1], 1, BoxShape::Segment).unwrap();
        let told = together(vec![(line, there), (square(1, "a"), there)]).unwrap_err().to_string();
        assert_eq!(told, "a mesh of dimension 1 and one of dimension 2 cannot stand in one scene");
    }

    #[test]
    fn a_turn_is_that_of_the_right_hand_about_its_axis_and_steps_are_done_in_their_order() {
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|d| (a[d] - b[d]).abs() < 1e-15);
        assert!(near(Placement::default().turned(90.0, [0.0, 0.0, 2.0]).of([1.0, 0.0, 3.0]), [0.0, 1.0, 3.0]));
        assert!(near(Placement::default().turned(120.0, [1.0, 1.0, 1.0]).of([1.0, 2.0, 3.0]), [3.0, 1.0, 2.0]));
        let moved = Placement::default().moved([1.0, 0.0, 0.0]);
        assert!(near(moved.turned(-90.0, [0.0, 0.0, 1.0]).of([0.0; 3]), [0.0, -1.0, 0.0]));
        assert!(near(Placement::default().turned(45.0, [0.0, 0.0, 1.0]).of([2f64.sqrt(), 0.0, 0.0]), [1.0, 1.0, 0.0]));
    }
}
