//! Gmsh MSH 2.2, ASCII and binary.
//!
//! Each element carries its tags; the first is its physical group, 0 for none.

use super::{cursor::Cursor, error::ReadError, gmsh};
use crate::mesh::raw::RawMesh;
use gmsh::{Block, Contents};

/// True for the versions 2, 2.1 and 2.2.
pub(super) fn recognises(bytes: &[u8]) -> bool {
    let version = gmsh::version(bytes);
    version.is_some_and(|v| v == "2" || v == "2.0" || v == "2.1" || v == "2.2")
}

/// The mesh of a file.
pub(super) fn parse(bytes: &[u8]) -> Result<RawMesh, ReadError> {
    gmsh::parse(bytes, |section, cursor, contents| match section {
        b"Nodes" => nodes(cursor, contents),
        b"Elements" => elements(cursor, contents),
        other => cursor.skip_section(other),
    })
}

fn nodes(cursor: &mut Cursor<'_>, contents: &mut Contents) -> Result<(), ReadError> {
    let count = cursor.text_size("the number of nodes")?;
    cursor.line();
    let room = usize::try_from(count).map_or(0, |count| count.min(cursor.remaining() / 8));
    contents.nodes.reserve(room);
    contents.node_numbers.reserve(room);
    for _ in 0..count {
        let number = cursor.natural("the number of a node")?;
        contents.node_numbers.push(number);
        contents.nodes.push(cursor.coordinates(number)?);
    }
    cursor.close("$EndNodes")
}

fn elements(cursor: &mut Cursor<'_>, contents: &mut Contents) -> Result<(), ReadError> {
    let count = cursor.text_size("the number of elements")?;
    cursor.line();
    let mut read = 0;
    while read < count {
        if cursor.binary {
            let place = cursor.place();
            let code = cursor.integer("an element type")?;
            let follow = cursor.natural("the number of elements of a block")?;
            let n_tags = cursor.natural("the number of tags")?;
            if follow == 0 || follow > count - read {
                return Err(ReadError::Syntax {
                    needed: "a block of one or more of the elements counted",
                    found: follow.to_string(),
                    place,
                });
            }
            for _ in 0..follow {
                let number = cursor.natural("the number of an element")?;
                let element_type = gmsh::find_type(code, number, || place)?;
                element(cursor, contents, number, element_type, n_tags)?;
            }
            read += follow;
        } else {
            let number = cursor.natural("the number of an element")?;
            let code = cursor.integer("an element type")?;
            let element_type = gmsh::find_type(code, number, || cursor.place())?;
            let n_tags = cursor.natural("the number of tags")?;
            element(cursor, contents, number, element_type, n_tags)?;
            read += 1;
        }
    }
    cursor.close("$EndElements")
}

/// Tags and nodes of one element; it joins the last block when type and group are the same.
fn element(
    cursor: &mut Cursor<'_>,
    contents: &mut Contents,
    number: u64,
    element_type: gmsh::ElementType,
    n_tags: u64,
) -> Result<(), ReadError> {
    let mut group = 0;
    for position in 0..n_tags {
        let tag = cursor.integer("a tag")?;
        if position == 0 {
            group = tag;
        }
    }
    // A negative number says that the group takes the entity with its orientation reversed.
    let groups: &[i64] = if group == 0 { &[] } else { &[group.abs()] };
    let joins =
        contents.blocks.last().is_some_and(|block| block.element_type == element_type && block.groups == groups);
    if !joins {
        contents.blocks.push(Block { element_type, groups: groups.to_vec(), elements: Vec::new(), nodes: Vec::new() });
    }
    let block = contents.blocks.last_mut().expect("a block was just added");
    block.elements.push(number);
    for _ in 0..element_type.n_nodes() {
        block.nodes.push(cursor.natural("a node of an element")?);
    }
    Ok(())
}
