//! The checks of [`Mesh::from_raw`](super::Mesh::from_raw): structure, jacobians, oddities.
//!
//! Promises: the first defect in the order of the cells is reported; every tolerance is relative
//! to the cell or edge it judges, so scaling or shifting a mesh does not change the verdict.

use wfl_host::memory::claim;

use super::{
    Mesh,
    error::{DUPLICATE_TOLERANCE, MeshError, MeshWarnings},
    index::{CellId, NodeId},
    points::PointGrid,
    raw::{GroupEntities, RawMesh, cell_bytes, node_bytes},
    turn::turn,
};
use crate::{
    cell::CellKind,
    element::Table,
    quadrature,
    vector::{determinant, distance, norm},
};

/// A determinant below this part of the product of the column lengths counts as zero: the cell is
/// flat to about ten digits. A cell that is only long and thin keeps a ratio near 1.
const FLAT: f64 = 1e-10;

/// A column shorter than this part of the coordinates it is the difference of is rounding noise.
const NOISE: f64 = 32.0 * f64::EPSILON;

impl Mesh {
    /// Checks a raw mesh and takes it over.
    ///
    /// # Errors
    /// Any defect that [`MeshError`] names; warnings are kept in [`Mesh::warnings`].
    pub fn from_raw(raw: RawMesh) -> Result<Mesh, MeshError> {
        let cells: u64 = raw.kinds.iter().map(|kind| cell_bytes(*kind)).sum();
        claim(node_bytes(raw.nodes.len() as u64) + cells, "the mesh")?;
        let starts = structure(&raw)?;
        let mut mesh = Mesh::assemble(raw, starts);
        jacobians(&mesh)?;
        mesh.warnings = warnings(&mesh);
        Ok(mesh)
    }

    /// [`Mesh::from_raw`] for what a file says: plane cells that run clockwise are put in the other order.
    ///
    /// # Errors
    /// As there.
    pub fn from_file(mut raw: RawMesh) -> Result<Mesh, MeshError> {
        let turned = turn(&mut raw);
        let mut mesh = Mesh::from_raw(raw)?;
        mesh.warnings.turned_cells = turned;
        Ok(mesh)
    }

    /// Takes over cells of a mesh that was checked.
    pub(super) fn checked_before(raw: RawMesh) -> Mesh {
        let mut starts = vec![0];
        for kind in &raw.kinds {
            starts.push(starts[starts.len() - 1] + n_nodes(*kind, raw.order));
        }
        Mesh::assemble(raw, starts)
    }

    /// Checks a refined mesh and takes it over: `warnings` are those of the mesh it was made of, whose nodes it has.
    pub(crate) fn from_refined(raw: RawMesh, warnings: MeshWarnings) -> Result<Mesh, MeshError> {
        let starts = structure(&raw)?;
        let mut mesh = Mesh::assemble(raw, starts);
        jacobians(&mesh)?;
        mesh.warnings = warnings;
        Ok(mesh)
    }
}

/// Node numbers, counts, finite coordinates; returns the start of each cell in the connectivity.
fn structure(raw: &RawMesh) -> Result<Vec<usize>, MeshError> {
    let (dim, order) = (raw.dim, raw.order);
    if !(1..=3).contains(&dim) || !(1..=2).contains(&order) {
        return Err(MeshError::Unsupported { dim, order });
    }
    if raw.kinds.is_empty() {
        return Err(MeshError::Empty);
    }
    if u32::try_from(raw.nodes.len()).is_err() {
        let nodes = raw.nodes.len() as u128;
        return Err(MeshError::TooLarge { nodes });
    }
    finite(raw)?;
    let mut starts = Vec::with_capacity(raw.kinds.len() + 1);
    starts.push(0);
    let mut end = 0;
    for (cell, kind) in raw.kinds.iter().enumerate() {
        if kind.dim() != dim {
            let (cell, kind) = (raw.numbers.cell(CellId::new(cell)), *kind);
            return Err(MeshError::WrongDimension { cell, kind, dim });
        }
        end += n_nodes(*kind, order);
        starts.push(end);
    }
    if raw.connectivity.len() != end {
        return Err(MeshError::ConnectivityLength { expected: end, found: raw.connectivity.len() });
    }
    for (cell, bounds) in starts.windows(2).enumerate() {
        cell_nodes(raw, CellId::new(cell), &raw.connectivity[bounds[0]..bounds[1]])?;
    }
    groups(raw)?;
    Ok(starts)
}

/// Number of geometry nodes of a cell.
fn n_nodes(kind: CellKind, order: usize) -> usize {
    kind.gmsh(order).nodes.len()
}

fn finite(raw: &RawMesh) -> Result<(), MeshError> {
    for (node, x) in raw.nodes.iter().enumerate() {
        for (axis, value) in x.iter().enumerate() {
            if !value.is_finite() {
                let (node, value) = (raw.numbers.node(NodeId::new(node)), *value);
                return Err(MeshError::NonFinite { node, axis, value });
            }
        }
    }
    Ok(())
}

fn cell_nodes(raw: &RawMesh, cell: CellId, nodes: &[u32]) -> Result<(), MeshError> {
    for (position, node) in nodes.iter().enumerate() {
        if *node as usize >= raw.nodes.len() {
            let cell = raw.numbers.cell(cell);
            return Err(MeshError::MissingNode { cell, node: *node as usize, n_nodes: raw.nodes.len() });
        }
        if nodes[..position].contains(node) {
            let (cell, node) = (raw.numbers.cell(cell), raw.numbers.node(NodeId::new(*node as usize)));
            return Err(MeshError::RepeatedNode { cell, node });
        }
    }
    Ok(())
}

fn groups(raw: &RawMesh) -> Result<(), MeshError> {
    let node_exists = |node: &NodeId| node.index() < raw.nodes.len();
    for group in &raw.groups {
        let (what, complete) = match &group.entities {
            GroupEntities::Cells(cells) => ("cell", cells.iter().all(|c| c.index() < raw.kinds.len())),
            GroupEntities::Facets(facets) => {
                let complete = facets.iter().all(|f| f.vertices().iter().all(node_exists));
                ("facet", complete)
            }
            GroupEntities::Nodes { nodes, edges } => {
                let complete = nodes.iter().chain(edges.as_flattened()).all(node_exists);
                ("node", complete)
            }
        };
        if !complete {
            let group = group.name.clone();
            return Err(MeshError::GroupEntity { group, what });
        }
    }
    Ok(())
}

/// Checks the jacobian determinant of every cell at its vertices, nodes and Gauss points.
fn jacobians(mesh: &Mesh) -> Result<(), MeshError> {
    let tables: Vec<Table> = CellKind::ALL.map(|kind| sample(mesh, kind)).into();
    for cell in mesh.cells() {
        check_cell(mesh, cell, &tables[mesh.kind(cell).index()])?;
    }
    Ok(())
}

/// Geometry table at the points where determinants are checked: one point for an affine cell.
fn sample(mesh: &Mesh, kind: CellKind) -> Table {
    let element = mesh.geometry_element(kind);
    let points = if kind.straight_is_affine() && mesh.order() == 1 {
        vec![kind.reference_centre()]
    } else {
        let rule =
            quadrature::gauss(kind, mesh.order() + 1).expect("Gauss rules of two and three points exist on every cell");
        let mut points = kind.vertices().to_vec();
        points.extend_from_slice(element.points());
        points.extend_from_slice(&rule.points);
        points
    };
    element.tabulate(&points, 1)
}

fn check_cell(mesh: &Mesh, cell: CellId, table: &Table) -> Result<(), MeshError> {
    let magnitude =
        mesh.cell_nodes(cell).iter().flat_map(|node| mesh.node(*node)).fold(0.0, |m: f64, c| m.max(c.abs()));
    let (mut lowest, mut highest) = ((f64::INFINITY, 0), f64::NEG_INFINITY);
    let mut bad = false;
    let mut flat_everywhere = true;
    for point in 0..table.n_points {
        let jacobian = mesh.jacobian_at(cell, table, point);
        let value = determinant(&jacobian, mesh.dim());
        let mut scale = 1.0;
        let mut noise = false;
        let column = |j: usize| norm([jacobian[0][j], jacobian[1][j], jacobian[2][j]]);
        for length in (0..mesh.dim()).map(column) {
            noise |= length <= NOISE * magnitude;
            scale *= length;
        }
        // Written so that a NaN (overflow of huge coordinates) counts as bad.
        let sound = value > FLAT * scale && !noise && value.is_finite();
        bad |= !sound;
        flat_everywhere &= noise || value.abs() <= FLAT * scale;
        if value < lowest.0 {
            lowest = (value, point);
        }
        highest = highest.max(value);
    }
    if !bad {
        return Ok(());
    }
    let (group, point) = (group_of(mesh, cell), mesh.point_at(cell, table, lowest.1));
    let (position, cell) = (cell, mesh.numbers().cell(cell));
    if flat_everywhere {
        let determinant = if highest.abs() > lowest.0.abs() { highest } else { lowest.0 };
        let size = mesh.cell_diameter(position);
        return Err(MeshError::ZeroVolume { cell, group, determinant, size });
    }
    if highest < 0.0 {
        let determinant = highest;
        return Err(MeshError::Inverted { cell, group, determinant });
    }
    Err(MeshError::Folded { cell, group, determinant: lowest.0, point })
}

fn group_of(mesh: &Mesh, cell: CellId) -> Option<String> {
    let holds = |entities: &GroupEntities| matches!(entities, GroupEntities::Cells(cells) if cells.contains(&cell));
    let group = mesh.groups().iter().find(|g| holds(&g.entities));
    group.map(|g| g.name.clone())
}

/// Duplicate nodes of one body and nodes of no cell.
fn warnings(mesh: &Mesh) -> MeshWarnings {
    let mut used = vec![false; mesh.n_nodes()];
    let mut shortest = vec![f64::INFINITY; mesh.n_nodes()];
    for cell in mesh.cells() {
        for node in mesh.cell_nodes(cell) {
            used[node.index()] = true;
        }
        let vertices = mesh.cell_vertices(cell);
        for [first, second] in mesh.kind(cell).edges() {
            let (first, second) = (vertices[*first].index(), vertices[*second].index());
            let length = distance(mesh.nodes()[first], mesh.nodes()[second]);
            shortest[first] = shortest[first].min(length);
            shortest[second] = shortest[second].min(length);
        }
    }
    let members: Vec<u32> = (0..mesh.n_nodes() as u32).filter(|node| shortest[*node as usize].is_finite()).collect();
    let unused_nodes = (0..mesh.n_nodes()).filter(|node| !used[*node]).map(NodeId::new).collect();
    MeshWarnings { duplicate_nodes: duplicates(mesh, &members, &shortest), unused_nodes, turned_cells: Vec::new() }
}

fn duplicates(mesh: &Mesh, members: &[u32], shortest: &[f64]) -> Vec<(NodeId, NodeId)> {
    let grid = PointGrid::new(mesh.nodes(), members, mesh.dim());
    let mut pairs = Vec::new();
    for node in members {
        let far = mesh.nodes()[*node as usize].iter().fold(0.0, |m: f64, c| m.max(c.abs()));
        let radius = DUPLICATE_TOLERANCE * shortest[*node as usize] + 8.0 * f64::EPSILON * far;
        grid.near(mesh.nodes()[*node as usize], radius, |other, _| {
            if other != *node {
                pairs.push((other.min(*node), other.max(*node)));
            }
        });
    }
    if pairs.is_empty() {
        return Vec::new();
    }
    pairs.sort_unstable();
    pairs.dedup();
    // Coincident nodes of two bodies are how two bodies touch; only one body is odd.
    let bodies = bodies(mesh);
    pairs.retain(|(first, second)| bodies[*first as usize] == bodies[*second as usize]);
    let id = |node: u32| NodeId::new(node as usize);
    pairs.into_iter().map(|(a, b)| (id(a), id(b))).collect()
}

impl Mesh {
    /// For each node a number that is the same for all nodes connected through cells.
    #[must_use]
    pub fn bodies(&self) -> Vec<u32> {
        bodies(self)
    }
}

fn bodies(mesh: &Mesh) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..mesh.n_nodes() as u32).collect();
    fn root(parent: &mut [u32], mut node: u32) -> u32 {
        while parent[node as usize] != node {
            parent[node as usize] = parent[parent[node as usize] as usize];
            node = parent[node as usize];
        }
        node
    }
    for cell in mesh.cells() {
        let nodes = mesh.cell_nodes(cell);
        let first = root(&mut parent, nodes[0].index() as u32);
        for node in &nodes[1..] {
            let other = root(&mut parent, node.index() as u32);
            parent[other as usize] = first;
        }
    }
    (0..mesh.n_nodes() as u32).map(|node| root(&mut parent, node)).collect()
}
