//! Mesh files: Gmsh MSH 2.2 and 4.1, ASCII and binary; input files of Abaqus and CalculiX; grids of VTK (`.vtu`).
//!
//! Promises: a file gives a [`RawMesh`] or an error with its place in the file; nothing in a file
//! can make the reader panic or allocate more than a small multiple of the file's size. What the
//! reader cannot see (orientation, volumes, duplicates) is checked by [`Mesh::from_raw`].
//! Does not read fields, partitions, periodic links or geometry.

mod abaqus;
mod cursor;
mod error;
mod gmsh;
mod msh2;
mod msh4;
mod other;
mod vtu;

pub use abaqus::{DeckNotes, DeckPair, deck_notes};
pub use error::{Place, ReadError};
use wfl_host::{input::InputError, reading::ReadingError};

use super::{Mesh, raw::RawMesh};

/// Gives the content of a file that a mesh file names, by the name that is written there. Who has the place of the mesh
/// file decides where that is looked for, and whether it may be read.
pub type Beside<'a> = dyn FnMut(&str) -> Result<Vec<u8>, ReadingError> + 'a;

/// For contents without a place: no other file is found.
///
/// # Errors
/// Always: there is no such file.
pub fn nothing_beside(_: &str) -> Result<Vec<u8>, ReadingError> {
    Err(InputError::NotFound.into())
}

/// One file format.
struct Reader {
    recognises: fn(&[u8]) -> bool,
    parse: fn(&[u8], &mut Beside<'_>) -> Result<RawMesh, ReadError>,
}

const READERS: [Reader; 4] = [
    Reader { recognises: abaqus::recognises, parse: abaqus::parse },
    Reader { recognises: msh2::recognises, parse: |bytes, _| msh2::parse(bytes) },
    Reader { recognises: msh4::recognises, parse: |bytes, _| msh4::parse(bytes) },
    Reader { recognises: vtu::recognises, parse: |bytes, _| vtu::parse(bytes) },
];

/// The mesh in the contents of a file, checked. Physical groups become [`Group`](super::Group)s; an unnamed one is
/// called after its dimension and number, as in `surface_3`.
///
/// # Errors
/// [`ReadError`].
pub fn mesh_of(bytes: &[u8]) -> Result<Mesh, ReadError> {
    mesh_beside(bytes, &mut nothing_beside)
}

/// As [`mesh_of`], of a file that may name others.
///
/// # Errors
/// [`ReadError`].
pub fn mesh_beside(bytes: &[u8], beside: &mut Beside<'_>) -> Result<Mesh, ReadError> {
    Ok(Mesh::from_file(parse_beside(bytes, beside)?)?)
}

/// The mesh in the contents of a file, not yet checked.
///
/// # Errors
/// [`ReadError`] other than `Mesh`.
pub fn parse_mesh(bytes: &[u8]) -> Result<RawMesh, ReadError> {
    parse_beside(bytes, &mut nothing_beside)
}

fn parse_beside(bytes: &[u8], beside: &mut Beside<'_>) -> Result<RawMesh, ReadError> {
    if let Some(reader) = READERS.iter().find(|reader| (reader.recognises)(bytes)) {
        return (reader.parse)(bytes, beside);
    }
    match gmsh::version(bytes) {
        Some(found) => Err(ReadError::Version { found }),
        None => {
            Err(other::told(bytes).map_or(ReadError::UnknownFormat, |(what, cure)| ReadError::Other { what, cure }))
        }
    }
}

#[cfg(test)]
mod tests;
