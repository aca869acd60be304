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

pub use abaqus::{DeckPair, deck_pairs};
pub use error::{Place, ReadError};

use super::{Mesh, raw::RawMesh};

/// One file format.
struct Reader {
    recognises: fn(&[u8]) -> bool,
    parse: fn(&[u8]) -> Result<RawMesh, ReadError>,
}

const READERS: [Reader; 4] = [
    Reader { recognises: abaqus::recognises, parse: abaqus::parse },
    Reader { recognises: msh2::recognises, parse: msh2::parse },
    Reader { recognises: msh4::recognises, parse: msh4::parse },
    Reader { recognises: vtu::recognises, parse: vtu::parse },
];

/// The mesh in the contents of a file, checked. Physical groups become [`Group`](super::Group)s; an unnamed one is
/// called after its dimension and number, as in `surface_3`.
///
/// # Errors
/// [`ReadError`].
pub fn mesh_of(bytes: &[u8]) -> Result<Mesh, ReadError> {
    Ok(Mesh::from_file(parse_mesh(bytes)?)?)
}

/// The mesh in the contents of a file, not yet checked.
///
/// # Errors
/// [`ReadError`] other than `Mesh`.
pub fn parse_mesh(bytes: &[u8]) -> Result<RawMesh, ReadError> {
    if let Some(reader) = READERS.iter().find(|reader| (reader.recognises)(bytes)) {
        return (reader.parse)(bytes);
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
