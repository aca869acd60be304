//! Boxes: structured meshes of segments, triangles, quadrilaterals, tetrahedra, hexahedra.
//!
//! Promises: nodes are numbered lexicographically, x fastest; simplices come from the same
//! subdivision of each box cell, so meshes conform; corners of the box are met exactly.

use super::{
    Mesh,
    error::{MeshError, MeshWarnings},
    raw::{RawMesh, cell_bytes, node_bytes},
};
use crate::cell::CellKind;
use wfl_host::memory::claim;

/// Shape of the cells of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoxShape {
    /// Dimension 1.
    Segment,
    /// Two triangles a square, cut along the diagonal from the lowest corner.
    Triangle,
    /// Squares.
    Quadrilateral,
    /// Six tetrahedra a cube around the diagonal from the lowest corner (Kuhn).
    Tetrahedron,
    /// Cubes.
    Hexahedron,
}

impl BoxShape {
    /// The kind of the cells.
    #[must_use]
    pub fn kind(self) -> CellKind {
        match self {
            BoxShape::Segment => CellKind::Segment,
            BoxShape::Triangle => CellKind::Triangle,
            BoxShape::Quadrilateral => CellKind::Quadrilateral,
            BoxShape::Tetrahedron => CellKind::Tetrahedron,
            BoxShape::Hexahedron => CellKind::Hexahedron,
        }
    }

    /// Corner numbers (bit d set: upper end of axis d) of the cells of one box cell, in the vertex
    /// order of the kind.
    fn corners(self) -> &'static [&'static [u32]] {
        match self {
            BoxShape::Segment => &[&[0, 1]],
            BoxShape::Triangle => &[&[0, 1, 3], &[0, 3, 2]],
            BoxShape::Quadrilateral => &[&[0, 1, 2, 3]],
            // Paths along the axes from corner 0 to corner 7; odd permutations of the axes list
            // their inner vertices the other way round.
            BoxShape::Tetrahedron => {
                &[&[0, 1, 3, 7], &[0, 5, 1, 7], &[0, 3, 2, 7], &[0, 2, 6, 7], &[0, 4, 5, 7], &[0, 6, 4, 7]]
            }
            BoxShape::Hexahedron => &[&[0, 1, 2, 3, 4, 5, 6, 7]],
        }
    }
}

/// Why a node map failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapError<E> {
    /// The map itself failed.
    #[error("the node map failed")]
    Map(E),
    /// The moved mesh is not usable.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Numbers of cells along the axes so that no cell is longer than `size` (to rounding).
///
/// # Errors
/// [`MeshError::BadBox`] when `size` is not positive or far too small.
pub fn cells_for_size(from: [f64; 3], to: [f64; 3], size: f64, dim: usize) -> Result<[usize; 3], MeshError> {
    /// Part of a cell that counts as rounding in `length / size`.
    const SLACK: f64 = 1e-9;
    let mut cells = [1; 3];
    for axis in 0..dim.min(3) {
        let count = ((to[axis] - from[axis]) / size - SLACK).ceil().max(1.0);
        if !(size > 0.0 && count < 4e9) {
            let needed = "a positive cell size that gives fewer than 4e9 cells along each axis";
            return Err(MeshError::BadBox { needed });
        }
        cells[axis] = count as usize;
    }
    Ok(cells)
}

/// A box of `cells[d]` equal cells along each axis `d < dim`, first order.
///
/// # Errors
/// [`MeshError::BadBox`] when the shape does not have dimension `dim`, a count is 0 or an end is
/// not finite or not above its start; [`MeshError::TooLarge`].
pub fn generate_box(
    from: [f64; 3],
    to: [f64; 3],
    cells: [usize; 3],
    dim: usize,
    shape: BoxShape,
) -> Result<Mesh, MeshError> {
    let bad = |needed| Err(MeshError::BadBox { needed });
    if shape.kind().dim() != dim {
        return bad("a cell shape of its own dimension");
    }
    let mut counts = [1usize; 3];
    for axis in 0..dim {
        if cells[axis] == 0 {
            return bad("at least one cell along each axis");
        }
        let sound = to[axis] > from[axis] && (to[axis] - from[axis]).is_finite();
        if !sound {
            return bad("finite corners, the second above the first along each axis");
        }
        counts[axis] = cells[axis];
    }
    let stored = |axis: usize| counts[axis] as u128 + u128::from(axis < dim);
    let nodes = stored(0) * stored(1) * stored(2);
    if nodes > u128::from(u32::MAX) {
        return Err(MeshError::TooLarge { nodes });
    }
    let cells = (0..3).map(|axis| counts[axis] as u64).product::<u64>() * shape.corners().len() as u64;
    claim(node_bytes(nodes as u64) + cells * cell_bytes(shape.kind()), "the mesh")?;
    Mesh::from_raw(RawMesh {
        dim,
        order: 1,
        nodes: lattice(from, to, counts, dim),
        kinds: vec![shape.kind(); counts.iter().product::<usize>() * shape.corners().len()],
        connectivity: connectivity(counts, dim, shape),
        ..RawMesh::default()
    })
}

fn lattice(from: [f64; 3], to: [f64; 3], counts: [usize; 3], dim: usize) -> Vec<[f64; 3]> {
    let axis = |d: usize| -> Vec<f64> {
        if d >= dim {
            return vec![0.0];
        }
        let n = counts[d];
        // Exact at both ends and, for small whole numbers, in between.
        let at = |i: usize| ((n - i) as f64 * from[d] + i as f64 * to[d]) / n as f64;
        (0..=n)
            .map(|i| {
                if i == n {
                    to[d]
                } else if i == 0 {
                    from[d]
                } else {
                    at(i)
                }
            })
            .collect()
    };
    let (x, y, z) = (axis(0), axis(1), axis(2));
    let mut nodes = Vec::with_capacity(x.len() * y.len() * z.len());
    for z in &z {
        for y in &y {
            nodes.extend(x.iter().map(|x| [*x, *y, *z]));
        }
    }
    nodes
}

fn connectivity(counts: [usize; 3], dim: usize, shape: BoxShape) -> Vec<u32> {
    let row = counts[0] as u32 + 1;
    let layer = row * if dim > 1 { counts[1] as u32 + 1 } else { 1 };
    let steps = [1, row, layer];
    let offset = |corner: u32| -> u32 { (0..3).map(|d| ((corner >> d) & 1) * steps[d]).sum() };
    let offsets: Vec<u32> = shape.corners().concat().into_iter().map(offset).collect();
    let mut nodes = Vec::with_capacity(offsets.len() * counts.iter().product::<usize>());
    for k in 0..counts[2] as u32 {
        for j in 0..counts[1] as u32 {
            for i in 0..counts[0] as u32 {
                let corner = i + j * row + k * layer;
                nodes.extend(offsets.iter().map(|offset| corner + offset));
            }
        }
    }
    nodes
}

/// The mesh with every node moved to `map` of its place, checked again.
///
/// # Errors
/// The first error of the map, or what [`Mesh::from_raw`] finds in the moved mesh.
pub fn map_nodes<E>(mesh: Mesh, map: impl FnMut([f64; 3]) -> Result<[f64; 3], E>) -> Result<Mesh, MapError<E>> {
    Ok(Mesh::from_raw(moved(mesh, map)?)?)
}

/// As [`map_nodes`], of a refined mesh: `warnings` are those of the moved mesh before it was refined. Nodes that lie on
/// each other are not looked for again, which would take long where cells crowd.
///
/// # Errors
/// As [`map_nodes`].
pub fn map_refined<E>(
    mesh: Mesh,
    warnings: &MeshWarnings,
    map: impl FnMut([f64; 3]) -> Result<[f64; 3], E>,
) -> Result<Mesh, MapError<E>> {
    Ok(Mesh::from_refined(moved(mesh, map)?, warnings.clone())?)
}

fn moved<E>(mesh: Mesh, mut map: impl FnMut([f64; 3]) -> Result<[f64; 3], E>) -> Result<RawMesh, MapError<E>> {
    let mut raw = mesh.into_raw();
    for node in &mut raw.nodes {
        *node = map(*node).map_err(MapError::Map)?;
    }
    Ok(raw)
}
