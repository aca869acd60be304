//! Gmsh MSH 4.1, ASCII and binary.
//!
//! Elements come in blocks, one a geometric entity; the entity carries the physical groups. In a partitioned file elements
//! stand on entities of partitions, which have a section of their own.

use std::collections::BTreeMap;

use super::{cursor::Cursor, error::ReadError, gmsh};
use crate::mesh::raw::RawMesh;
use gmsh::{Block, Contents};

/// True for version 4.1.
pub(super) fn recognises(bytes: &[u8]) -> bool {
    gmsh::version(bytes).is_some_and(|version| version == "4.1")
}

/// Physical groups of each geometric entity, by dimension and number.
type Entities = BTreeMap<(i64, i64), Vec<i64>>;

/// The mesh of a file.
pub(super) fn parse(bytes: &[u8]) -> Result<RawMesh, ReadError> {
    let mut entity_groups = Entities::new();
    gmsh::parse(bytes, |section, cursor, contents| match section {
        b"Entities" => entities(cursor, &mut entity_groups),
        b"PartitionedEntities" => partitioned_entities(cursor, &mut entity_groups),
        b"Nodes" => nodes(cursor, contents),
        b"Elements" => elements(cursor, &entity_groups, contents),
        other => cursor.skip_section(other),
    })
}

fn entities(cursor: &mut Cursor<'_>, groups: &mut Entities) -> Result<(), ReadError> {
    entity_lists(cursor, groups, |_| Ok(()))?;
    cursor.close("$EndEntities")
}

/// The entities of a partitioned mesh, on which its elements stand: each has the groups of the one that it is a part of.
fn partitioned_entities(cursor: &mut Cursor<'_>, groups: &mut Entities) -> Result<(), ReadError> {
    cursor.size("the number of partitions")?;
    for _ in 0..cursor.size("the number of ghost entities")? {
        cursor.integer("the number of a ghost entity")?;
        cursor.integer("the partition of a ghost entity")?;
    }
    entity_lists(cursor, groups, |cursor| {
        cursor.integer("the dimension of a parent")?;
        cursor.integer("the number of a parent")?;
        for _ in 0..cursor.size("the number of partitions of an entity")? {
            cursor.integer("a partition of an entity")?;
        }
        Ok(())
    })?;
    cursor.close("$EndPartitionedEntities")
}

/// Points, curves, surfaces and volumes; behind the number of each stands what `skip` reads.
fn entity_lists(
    cursor: &mut Cursor<'_>,
    groups: &mut Entities,
    skip: impl Fn(&mut Cursor<'_>) -> Result<(), ReadError>,
) -> Result<(), ReadError> {
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = cursor.size("a number of entities")?;
    }
    for (dim, count) in (0..).zip(counts) {
        for _ in 0..count {
            let tag = cursor.integer("the number of an entity")?;
            skip(cursor)?;
            // A point has its place, the others their bounding box.
            for _ in 0..if dim == 0 { 3 } else { 6 } {
                cursor.double("a coordinate of an entity")?;
            }
            let n_groups = cursor.size("the number of physical groups")?;
            let mut of_entity = Vec::new();
            for _ in 0..n_groups {
                of_entity.push(cursor.integer("the number of a group")?.abs());
            }
            of_entity.sort_unstable();
            of_entity.dedup();
            groups.insert((dim, tag), of_entity);
            if dim > 0 {
                for _ in 0..cursor.size("the number of bounding entities")? {
                    cursor.integer("the number of a bounding entity")?;
                }
            }
        }
    }
    Ok(())
}

fn nodes(cursor: &mut Cursor<'_>, contents: &mut Contents) -> Result<(), ReadError> {
    let n_blocks = cursor.size("the number of node blocks")?;
    let count = cursor.size("the number of nodes")?;
    cursor.size("the lowest node number")?;
    cursor.size("the highest node number")?;
    let room = usize::try_from(count).map_or(0, |count| count.min(cursor.remaining() / 4));
    contents.nodes.reserve(room);
    contents.node_numbers.reserve(room);
    for _ in 0..n_blocks {
        let dim = cursor.natural("the dimension of an entity")?;
        cursor.integer("the number of an entity")?;
        let parametric = cursor.integer("0 or 1")? != 0;
        let in_block = cursor.size("the number of nodes of a block")?;
        let first = contents.node_numbers.len();
        for _ in 0..in_block {
            let number = cursor.size("the number of a node")?;
            contents.node_numbers.push(number);
        }
        for position in first..contents.node_numbers.len() {
            let number = contents.node_numbers[position];
            contents.nodes.push(cursor.coordinates(number)?);
            for _ in 0..if parametric { dim.min(3) } else { 0 } {
                cursor.double("a parameter of a node")?;
            }
        }
    }
    cursor.close("$EndNodes")
}

fn elements(cursor: &mut Cursor<'_>, groups: &Entities, contents: &mut Contents) -> Result<(), ReadError> {
    let n_blocks = cursor.size("the number of element blocks")?;
    cursor.size("the number of elements")?;
    cursor.size("the lowest element number")?;
    cursor.size("the highest element number")?;
    for _ in 0..n_blocks {
        let dim = cursor.integer("the dimension of an entity")?;
        let tag = cursor.integer("the number of an entity")?;
        let code = cursor.integer("an element type")?;
        let in_block = cursor.size("the number of elements of a block")?;
        let element_type = match gmsh::find_type(code, 0, || cursor.place()) {
            Ok(element_type) => element_type,
            Err(_) => {
                // Name the first element of the block in the message.
                let number = cursor.size("the number of an element")?;
                gmsh::find_type(code, number, || cursor.place())?
            }
        };
        let n_nodes = element_type.n_nodes();
        let fits = cursor.remaining() / (2 * (n_nodes + 1));
        let room = usize::try_from(in_block).map_or(0, |count| count.min(fits));
        let mut block = Block {
            element_type,
            groups: groups.get(&(dim, tag)).cloned().unwrap_or_default(),
            elements: Vec::with_capacity(room),
            nodes: Vec::with_capacity(room * n_nodes),
        };
        for _ in 0..in_block {
            block.elements.push(cursor.size("the number of an element")?);
            for _ in 0..n_nodes {
                block.nodes.push(cursor.size("a node of an element")?);
            }
        }
        contents.blocks.push(block);
    }
    cursor.close("$EndElements")
}
