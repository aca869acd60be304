//! What laws are compiled with in tests: fields, and a place that has them all.

use crate::types::{FieldKind, FieldSig, PlaceKind, PlaceSig, Shape};

/// A field of degree 1.
pub(crate) fn field(name: &str, shape: Shape, kind: FieldKind) -> FieldSig {
    FieldSig { name: name.to_owned(), shape, degree: 1, kind, global: false, on_faces: false }
}

/// A place with so many fields on its own side.
pub(crate) fn place(kind: PlaceKind, n_fields: usize) -> PlaceSig {
    PlaceSig {
        name: "here".to_owned(),
        kind,
        here: vec![true; n_fields],
        there: vec![false; n_fields],
        entities: Vec::new(),
        description: "a place".to_owned(),
        here_name: None,
        inside: false,
    }
}
