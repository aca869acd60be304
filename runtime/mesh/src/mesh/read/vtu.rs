//! Grids of VTK (`.vtu`): one piece of cells, ASCII, base64 or appended, plain or compressed by zlib.
//!
//! Arrays of whole numbers at the cells are groups: cells with the value 3 of `material` are `material_3`; cells of lower
//! dimension, such as a skin, are faces of these groups. Cell types and the order of their nodes: `vtkCellType.h` and the
//! figures of the VTK user's guide. Does not read polyhedra, Lagrange cells above first order on hexahedra and wedges,
//! several pieces (their borders are not joined), nor fields.

mod array;
mod cell;
mod xml;

use array::{Data, Layout};
use xml::{Tag, Tags};

use super::{
    error::{Place, ReadError},
    gmsh::{Block, Contents, find_type},
};
use crate::mesh::raw::RawMesh;

/// Values of an array of whole numbers up to which it tells groups; one with more has numbers of cells.
const GROUPS: usize = 256;

/// True for a VTK file in XML.
pub(super) fn recognises(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(1024)];
    start.trim_ascii_start().starts_with(b"<") && start.windows(8).any(|w| w == b"<VTKFile")
}

/// What is wrong at a byte of a file.
fn wrong(byte: usize, what: impl Into<String>) -> ReadError {
    ReadError::Deck { what: what.into(), place: Place::Byte(byte) }
}

/// The arrays of a piece.
#[derive(Default)]
struct Piece {
    points: Option<Data>,
    connectivity: Option<Data>,
    offsets: Option<Data>,
    types: Option<Data>,
    /// Arrays of whole numbers at the cells, with their names.
    numbers: Vec<(String, Data)>,
}

/// The mesh of a file.
pub(super) fn parse(bytes: &[u8]) -> Result<RawMesh, ReadError> {
    let layout = Layout::of(bytes)?;
    let mut tags = Tags::new(bytes);
    let mut piece = Piece::default();
    let (mut pieces, mut inside) = (0, String::new());
    while let Some(tag) = tags.next()? {
        match tag.name.as_str() {
            "Piece" if !tag.closes => {
                pieces += usize::from(tag.number("NumberOfCells") != Some(0));
                if pieces > 1 {
                    let help = "the borders of its pieces are not joined: write it as one piece (ParaView: Merge Blocks \
                                with `Merge Points`, then Save Data)";
                    return Err(wrong(tag.at, format!("the grid has several pieces; {help}")));
                }
            }
            "Points" | "Cells" | "CellData" | "PointData" | "FieldData" if !tag.empty => {
                inside = if tag.closes { String::new() } else { tag.name.clone() };
            }
            "DataArray" if !tag.closes => take(&mut piece, &inside, &tag, &layout, &mut tags)?,
            "AppendedData" => break,
            _ => {}
        }
    }
    contents(piece)?.into_raw()
}

/// Reads an array if the mesh needs it.
fn take(piece: &mut Piece, inside: &str, tag: &Tag, layout: &Layout<'_>, tags: &mut Tags<'_>) -> Result<(), ReadError> {
    let name = tag.value("Name").unwrap_or_default().to_owned();
    let whole = tag.value("type").is_some_and(|t| t.starts_with("Int") || t.starts_with("UInt"));
    let one = tag.number("NumberOfComponents").is_none_or(|n| n == 1);
    if let ("Points", Some(n)) = (inside, tag.number("NumberOfComponents").filter(|n| *n != 3)) {
        let help = "a grid of VTK has three coordinates a point, in the plane z = 0 as the third";
        return Err(wrong(tag.at, format!("the points have NumberOfComponents=\"{n}\"; {help}")));
    }
    let slot = match (inside, name.to_ascii_lowercase().as_str()) {
        ("Points", _) => &mut piece.points,
        ("Cells", "connectivity") => &mut piece.connectivity,
        ("Cells", "offsets") => &mut piece.offsets,
        ("Cells", "types") => &mut piece.types,
        ("CellData", _) if whole && one && !name.starts_with("vtk") => {
            let data = layout.read(tag, tags)?;
            piece.numbers.push((name, data));
            return Ok(());
        }
        _ => return Ok(()),
    };
    *slot = Some(layout.read(tag, tags)?);
    Ok(())
}

/// What a file of Gmsh would hold.
fn contents(piece: Piece) -> Result<Contents, ReadError> {
    let lost = |what: &str| wrong(0, format!("the grid has no array `{what}`"));
    let points = piece.points.ok_or_else(|| lost("Points"))?;
    let connectivity = piece.connectivity.ok_or_else(|| lost("connectivity"))?;
    let offsets = piece.offsets.ok_or_else(|| lost("offsets"))?;
    let types = piece.types.ok_or_else(|| lost("types"))?;
    if points.values.len() % 3 != 0 {
        let n = points.values.len();
        return Err(wrong(points.at, format!("the points have {n} numbers, which is not three coordinates a point")));
    }
    let mut contents = Contents::default();
    for (node, x) in points.values.chunks_exact(3).enumerate() {
        let node = node as u64;
        if let Some(value) = x.iter().find(|x| !x.is_finite()) {
            return Err(ReadError::NonFinite { node, value: *value, place: Place::Byte(points.at) });
        }
        contents.nodes.push([x[0], x[1], x[2]]);
        contents.node_numbers.push(node);
    }
    let (names, marks) = groups(&piece.numbers, types.values.len());
    contents.name_groups(&names);
    let mut start = 0;
    for (k, (kind, end)) in types.whole()?.into_iter().zip(offsets.whole()?).enumerate() {
        let nodes = connectivity.part(start, end, k)?;
        start = end;
        let cell::Listed { code, nodes } = cell::listed(kind, nodes, &contents.nodes, k, types.at)?;
        let element_type = find_type(code, k as u64, || Place::Byte(types.at))?;
        let of = marks.get(k).cloned().unwrap_or_default();
        match contents.blocks.last_mut().filter(|b| b.element_type == element_type && b.groups == of) {
            Some(block) => {
                block.elements.push(k as u64);
                block.nodes.extend(nodes);
            }
            None => contents.blocks.push(Block { element_type, groups: of, elements: vec![k as u64], nodes }),
        }
    }
    Ok(contents)
}

/// Names of the groups, and of each cell the numbers of its groups, counted from 1.
fn groups(arrays: &[(String, Data)], n_cells: usize) -> (Vec<String>, Vec<Vec<i64>>) {
    let (mut names, mut marks) = (Vec::new(), vec![Vec::new(); n_cells]);
    for (name, data) in arrays.iter().filter(|(_, data)| data.values.len() == n_cells) {
        let mut values: Vec<i64> = data.values.iter().map(|x| *x as i64).collect();
        values.sort_unstable();
        values.dedup();
        if values.len() > GROUPS {
            continue;
        }
        let first = names.len();
        names.extend(values.iter().map(|v| format!("{name}_{v}").replace('-', "minus_")));
        for (mark, value) in marks.iter_mut().zip(&data.values) {
            if let Ok(at) = values.binary_search(&(*value as i64)) {
                mark.push((first + at + 1) as i64);
            }
        }
    }
    (names, marks)
}

#[cfg(test)]
mod tests;
