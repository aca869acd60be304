//! Common parts of both Gmsh formats: header, physical names, element types, and the conversion of numbered nodes and
//! elements to a [`RawMesh`].

mod complete;

use std::collections::BTreeMap;

use complete::complete;

use super::{
    cursor::Cursor,
    error::{Place, ReadError},
};
use crate::{
    cell::CellKind,
    mesh::{
        index::{CellId, NodeId},
        raw::{Group, GroupEntities, GroupFacet, RawMesh},
    },
};

/// One of the supported element types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ElementType {
    pub(super) kind: CellKind,
    pub(super) order: usize,
    /// Nodes in the middle of quadrilaterals and of a hexahedron are left out; they would be the last ones.
    pub(super) serendipity: bool,
}

/// Types of second order without nodes in the middle of faces: Gmsh's number, kind, number of nodes.
const SERENDIPITY: [(i64, CellKind, usize); 4] = [
    (16, CellKind::Quadrilateral, 8),
    (17, CellKind::Hexahedron, 20),
    (18, CellKind::Wedge, 15),
    (19, CellKind::Pyramid, 13),
];

impl ElementType {
    /// Place in Gmsh's node list of each node of our Lagrange element.
    pub(super) fn nodes(self) -> &'static [usize] {
        self.kind.gmsh(self.order).nodes
    }
}

/// The element type with this number. `place` is called only for an error: finding a line is slow.
pub(super) fn find_type(code: i64, element: u64, place: impl FnOnce() -> Place) -> Result<ElementType, ReadError> {
    let all = [1, 2]
        .into_iter()
        .flat_map(|order| CellKind::ALL.into_iter().map(move |kind| ElementType { kind, order, serendipity: false }));
    let bare = SERENDIPITY.iter().find(|row| row.0 == code);
    let bare = bare.map(|(_, kind, _)| ElementType { kind: *kind, order: 2, serendipity: true });
    let found = all.into_iter().find(|t| t.kind.gmsh(t.order).code == code).or(bare);
    found.ok_or_else(|| ReadError::ElementType {
        element,
        code,
        name: match code {
            20..=28 => "line or triangle of higher order",
            29..=33 => "tetrahedron of higher order",
            36..=62 => "line, triangle or quadrilateral of higher order",
            71..=75 | 79..=83 | 92..=98 => "tetrahedron or hexahedron of higher order",
            90 | 91 | 106..=121 => "wedge or pyramid of higher order",
            _ => "cell of unknown shape",
        },
        remedy: match code {
            20..=33 | 36..=62 | 71..=75 | 79..=83 | 90..=98 | 106..=121 => {
                "; write the mesh with `Mesh.ElementOrder = 2`: `gmsh part.geo -3 -order 2 -o part.msh`"
            }
            _ => "",
        },
        place: place(),
    })
}

/// The version in the header, for files that look like Gmsh's.
pub(super) fn version(bytes: &[u8]) -> Option<String> {
    let mut cursor = Cursor::new(bytes);
    while let Some(name) = cursor.section() {
        if name == b"MeshFormat" {
            let line = cursor.line().trim_ascii();
            let word = line.split(u8::is_ascii_whitespace).next()?;
            return Some(String::from_utf8_lossy(&word[..word.len().min(20)]).into_owned());
        }
        // A comment may come first; anything else is no Gmsh file.
        if name != b"Comments" || cursor.skip_section(name).is_err() {
            return None;
        }
    }
    None
}

/// The mesh of a file of any version: reads the sections that all versions write alike and gives the others, whose
/// names are already read, to `read`.
pub(super) fn parse(
    bytes: &[u8],
    mut read: impl FnMut(&[u8], &mut Cursor<'_>, &mut Contents) -> Result<(), ReadError>,
) -> Result<RawMesh, ReadError> {
    let mut cursor = Cursor::new(bytes);
    let mut contents = Contents::default();
    let mut missing = vec!["Nodes", "Elements"];
    while let Some(section) = cursor.section() {
        match section {
            b"MeshFormat" => header(&mut cursor)?,
            b"PhysicalNames" => names(&mut cursor, &mut contents.names)?,
            other => read(other, &mut cursor, &mut contents)?,
        }
        missing.retain(|name| name.as_bytes() != section);
    }
    match missing.first() {
        Some(section) => Err(ReadError::MissingSection { section }),
        None => contents.into_raw(),
    }
}

/// Reads the header, whose section name is already read, and sets the mode of the cursor.
fn header(cursor: &mut Cursor<'_>) -> Result<(), ReadError> {
    cursor.double("the format version")?;
    let binary = cursor.text_integer("the file type, 0 or 1")? == 1;
    let size = cursor.text_integer("the size of a number")?;
    if size != 8 {
        let found = format!("with numbers of {size} bytes");
        return Err(ReadError::Version { found });
    }
    cursor.line();
    if binary {
        cursor.binary = true;
        let place = cursor.place();
        // The file holds the int 1 in the order of bytes of its machine.
        let found = cursor.integer("the number 1")?;
        if found == 1 << 24 {
            cursor.big_endian = true;
        } else if found != 1 {
            return Err(ReadError::Syntax { needed: "the number 1", found: found.to_string(), place });
        }
    }
    cursor.close("$EndMeshFormat")
}

/// Names of physical groups by dimension and number.
type Names = BTreeMap<(usize, i64), String>;

/// Reads the names, whose section name is already read; they are text in binary files too.
fn names(cursor: &mut Cursor<'_>, names: &mut Names) -> Result<(), ReadError> {
    let count = cursor.text_size("the number of names")?;
    for _ in 0..count {
        let dim = cursor.text_size("the dimension of a group")?;
        let tag = cursor.text_integer("the number of a group")?;
        let line = cursor.line().trim_ascii();
        let name = line.strip_prefix(b"\"").and_then(|l| l.strip_suffix(b"\""));
        let Some(name) = name else {
            return Err(ReadError::Syntax {
                needed: "a name in double quotes",
                found: String::from_utf8_lossy(&line[..line.len().min(40)]).into_owned(),
                place: cursor.place(),
            });
        };
        let name = String::from_utf8_lossy(name).into_owned();
        names.insert((dim.min(4) as usize, tag), name);
    }
    cursor.close("$EndPhysicalNames")
}

/// A run of elements of one type on one geometric entity.
#[derive(Debug)]
pub(super) struct Block {
    pub(super) element_type: ElementType,
    /// Physical groups of the elements.
    pub(super) groups: Vec<i64>,
    /// Numbers of the elements.
    pub(super) elements: Vec<u64>,
    /// Node numbers of the file, all elements one after the other.
    pub(super) nodes: Vec<u64>,
}

impl ElementType {
    /// Number of nodes in the file.
    pub(super) fn n_nodes(self) -> usize {
        let bare = SERENDIPITY.iter().find(|row| self.serendipity && row.1 == self.kind);
        bare.map_or(self.nodes().len(), |row| row.2)
    }

    pub(super) fn dim(self) -> usize {
        self.kind.dim()
    }
}

/// A Gmsh file without its syntax.
#[derive(Debug, Default)]
pub(super) struct Contents {
    names: Names,
    pub(super) node_numbers: Vec<u64>,
    pub(super) nodes: Vec<[f64; 3]>,
    pub(super) blocks: Vec<Block>,
}

/// From node numbers of the file to positions.
pub(super) enum NodeMap {
    /// `positions[number]`, `u32::MAX` where there is no such node.
    Dense(Vec<u32>),
    /// Sorted pairs, when the numbers are far apart.
    Sparse(Vec<(u64, u32)>),
}

impl NodeMap {
    pub(super) fn new(numbers: &[u64]) -> Result<NodeMap, ReadError> {
        let highest = numbers.iter().copied().max().unwrap_or(0);
        if highest / 8 <= numbers.len() as u64 + 1000 {
            let mut positions = vec![u32::MAX; highest as usize + 1];
            for (position, number) in numbers.iter().enumerate() {
                let slot = &mut positions[*number as usize];
                if *slot != u32::MAX {
                    return Err(ReadError::DuplicateNode { node: *number });
                }
                *slot = position as u32;
            }
            return Ok(NodeMap::Dense(positions));
        }
        let mut pairs: Vec<(u64, u32)> = numbers.iter().copied().zip(0..).collect();
        pairs.sort_unstable();
        match pairs.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            Some(pair) => Err(ReadError::DuplicateNode { node: pair[0].0 }),
            None => Ok(NodeMap::Sparse(pairs)),
        }
    }

    pub(super) fn find(&self, number: u64) -> Option<u32> {
        match self {
            NodeMap::Dense(positions) => {
                let position = *positions.get(usize::try_from(number).ok()?)?;
                (position != u32::MAX).then_some(position)
            }
            NodeMap::Sparse(pairs) => {
                let place = pairs.binary_search_by_key(&number, |pair| pair.0).ok()?;
                Some(pairs[place].1)
            }
        }
    }
}

impl Contents {
    /// Names for the groups with the tags 1, 2, ..., whatever their dimension.
    pub(super) fn name_groups(&mut self, names: &[String]) {
        for (tag, name) in (1..).zip(names) {
            self.names.extend((0..4).map(|dim| ((dim, tag), name.clone())));
        }
    }

    /// The mesh of the elements of highest dimension; the others only fill groups.
    pub(super) fn into_raw(mut self) -> Result<RawMesh, ReadError> {
        let used = self.blocks.iter().filter(|b| !b.elements.is_empty());
        let dim = used.map(|b| b.element_type.dim()).max().unwrap_or(0);
        if dim == 0 {
            let section = "Elements";
            return Err(ReadError::MissingSection { section });
        }
        let order = self.order(dim)?;
        complete(&mut self, dim)?;
        let map = NodeMap::new(&self.node_numbers)?;
        let mut raw = RawMesh { dim, order, ..RawMesh::default() };
        let mut groups = Groups::default();
        for block in &self.blocks {
            if block.element_type.dim() == dim {
                add_cells(block, &map, &mut raw, &mut groups)?;
            } else {
                add_lower(block, dim, &map, &mut groups)?;
            }
        }
        merge_repeated(&mut raw, &mut groups);
        self.check_flat(&raw)?;
        raw.groups = groups.finish(&self.names, dim);
        raw.nodes = self.nodes;
        raw.numbers.nodes = self.node_numbers;
        Ok(raw)
    }

    fn order(&self, dim: usize) -> Result<usize, ReadError> {
        let example = |order: usize| {
            let fits = |b: &&Block| b.element_type.dim() == dim && b.element_type.order == order;
            self.blocks.iter().filter(fits).find_map(|b| b.elements.first().copied())
        };
        match (example(1), example(2)) {
            (Some(first), Some(second)) => Err(ReadError::MixedOrder { first, second }),
            (_, Some(_)) => Ok(2),
            _ => Ok(1),
        }
    }

    /// Coordinates beyond the dimension must be the same for all nodes of cells, to rounding.
    fn check_flat(&self, raw: &RawMesh) -> Result<(), ReadError> {
        /// Part of the extent of the mesh that a flat mesh may be thick.
        const THICKNESS: f64 = 1e-9;
        let Some(first) = raw.connectivity.first() else {
            return Ok(());
        };
        let start = self.nodes[*first as usize];
        let used = raw.connectivity.iter().map(|n| (*n, self.nodes[*n as usize]));
        let offset = |x: &[f64; 3], d: usize| (x[d] - start[d]).abs();
        let extent = used.clone().flat_map(|(_, x)| (0..3).map(move |d| offset(&x, d))).fold(0.0, f64::max);
        let outside = |x: &[f64; 3]| (raw.dim..3).any(|d| offset(x, d) > THICKNESS * extent);
        match used.into_iter().find(|(_, x)| outside(x)) {
            None => Ok(()),
            Some((node, _)) => Err(ReadError::NotFlat { dim: raw.dim, node: self.node_numbers[node as usize] }),
        }
    }
}

/// Members of the groups by dimension and number.
#[derive(Default)]
struct Groups {
    cells: BTreeMap<i64, Vec<CellId>>,
    facets: BTreeMap<i64, Vec<GroupFacet>>,
    nodes: BTreeMap<(usize, i64), Points>,
}

/// Members of a group of points or curves.
#[derive(Default)]
struct Points {
    nodes: Vec<NodeId>,
    /// Ends of the edges of curves.
    edges: Vec<[NodeId; 2]>,
}

fn resolve(map: &NodeMap, element: u64, node: u64) -> Result<u32, ReadError> {
    map.find(node).ok_or(ReadError::MissingNode { element, node })
}

fn add_cells(block: &Block, map: &NodeMap, raw: &mut RawMesh, groups: &mut Groups) -> Result<(), ReadError> {
    let places = block.element_type.nodes();
    let first = raw.kinds.len();
    for (element, nodes) in block.elements.iter().zip(block.nodes.chunks_exact(places.len())) {
        for place in places {
            raw.connectivity.push(resolve(map, *element, nodes[*place])?);
        }
        raw.kinds.push(block.element_type.kind);
        raw.numbers.cells.push(*element);
    }
    for group in &block.groups {
        let members = groups.cells.entry(*group).or_default();
        members.extend((first..raw.kinds.len()).map(CellId::new));
    }
    Ok(())
}

fn add_lower(block: &Block, dim: usize, map: &NodeMap, groups: &mut Groups) -> Result<(), ReadError> {
    let (kind, n) = (block.element_type.kind, block.element_type.n_nodes());
    for (element, numbers) in block.elements.iter().zip(block.nodes.chunks_exact(n)) {
        // Resolved also without a group: a missing node is an error of the file.
        let mut nodes = [NodeId::new(0); 9];
        for (node, number) in nodes.iter_mut().zip(numbers) {
            *node = NodeId::new(resolve(map, *element, *number)? as usize);
        }
        for group in &block.groups {
            if kind.dim() + 1 == dim {
                // Corners come first in Gmsh's lists, for every order.
                let corner = |i: usize| nodes[kind.gmsh(1).nodes.get(i).copied().unwrap_or(0)];
                let vertices = std::array::from_fn(corner);
                let facets = groups.facets.entry(*group).or_default();
                facets.push(GroupFacet { kind, vertices });
            } else {
                let members = groups.nodes.entry((kind.dim(), *group)).or_default();
                members.nodes.extend_from_slice(&nodes[..n]);
                if kind == CellKind::Segment {
                    members.edges.push([nodes[0], nodes[1]]);
                }
            }
        }
    }
    Ok(())
}

/// MSH 2 writes an element once for each of its groups: such copies become one cell.
fn merge_repeated(raw: &mut RawMesh, groups: &mut Groups) {
    if groups.cells.len() < 2 {
        return;
    }
    let mut starts = Vec::with_capacity(raw.kinds.len() + 1);
    starts.push(0);
    for kind in &raw.kinds {
        let n = kind.gmsh(raw.order).nodes.len();
        starts.push(starts[starts.len() - 1] + n);
    }
    let nodes = |cell: u32| &raw.connectivity[starts[cell as usize]..starts[cell as usize + 1]];
    let mut order: Vec<u32> = (0..raw.kinds.len() as u32).collect();
    order.sort_unstable_by(|a, b| nodes(*a).cmp(nodes(*b)).then(a.cmp(b)));
    let mut original: Vec<u32> = (0..raw.kinds.len() as u32).collect();
    for same in order.chunk_by(|a, b| nodes(*a) == nodes(*b)) {
        for cell in same {
            original[*cell as usize] = same[0];
        }
    }
    if original.iter().zip(0..).all(|(first, cell)| *first == cell) {
        return;
    }
    let (mut kinds, mut connectivity, mut numbers, mut renumbered) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (cell, first) in original.iter().enumerate() {
        if *first as usize == cell {
            renumbered.push(CellId::new(kinds.len()));
            kinds.push(raw.kinds[cell]);
            numbers.push(raw.numbers.cells[cell]);
            connectivity.extend_from_slice(nodes(cell as u32));
        } else {
            renumbered.push(renumbered[*first as usize]);
        }
    }
    for members in groups.cells.values_mut() {
        for cell in members {
            *cell = renumbered[cell.index()];
        }
    }
    (raw.kinds, raw.connectivity, raw.numbers.cells) = (kinds, connectivity, numbers);
}

impl Groups {
    fn finish(self, names: &Names, dim: usize) -> Vec<Group> {
        fn unique<T: Ord>(mut members: Vec<T>) -> Vec<T> {
            members.sort_unstable();
            members.dedup();
            members
        }
        let group = |dim: usize, tag: i64, entities| Group {
            name: names.get(&(dim, tag)).cloned().unwrap_or_else(|| {
                let what = ["point", "curve", "surface", "volume"][dim];
                format!("{what}_{tag}")
            }),
            dim,
            entities,
        };
        let mut groups = Vec::new();
        for (tag, cells) in self.cells {
            groups.push(group(dim, tag, GroupEntities::Cells(unique(cells))));
        }
        for (tag, facets) in self.facets {
            groups.push(group(dim - 1, tag, GroupEntities::Facets(unique(facets))));
        }
        for ((dim, tag), points) in self.nodes {
            let entities = GroupEntities::Nodes { nodes: unique(points.nodes), edges: unique(points.edges) };
            groups.push(group(dim, tag, entities));
        }
        groups
    }
}
