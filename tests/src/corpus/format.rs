//! The text of a corpus file, `gwfl-corpus/1`, as typed data. Nothing is checked here beyond the types.

use std::collections::BTreeMap;

use serde::Deserialize;

/// The name of the format that is read.
pub(super) const FORMAT: &str = "gwfl-corpus/1";

#[derive(Debug, Deserialize)]
pub(super) struct Corpus {
    pub(super) format: String,
    pub(super) meshes: BTreeMap<String, MeshText>,
    pub(super) quadratures: BTreeMap<String, QuadratureText>,
    pub(super) cases: Vec<Case>,
}

/// Cells list their nodes in the order of the reference cells of the format, which is the order used here.
#[derive(Debug, Deserialize)]
pub(super) struct MeshText {
    pub(super) dim: usize,
    pub(super) nodes: Vec<Vec<f64>>,
    pub(super) cells: Vec<(String, Vec<u32>)>,
}

#[derive(Debug, Deserialize)]
pub(super) struct QuadratureText {
    pub(super) cell: String,
    pub(super) points: Vec<Vec<f64>>,
    pub(super) weights: Vec<f64>,
    #[serde(default)]
    pub(super) face_points: Vec<Vec<f64>>,
    #[serde(default)]
    pub(super) face_weights: Vec<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Case {
    pub(super) id: String,
    pub(super) family: String,
    pub(super) mesh: String,
    pub(super) region: RegionText,
    /// Rule by cell kind.
    pub(super) quadrature: BTreeMap<String, String>,
    pub(super) fields: BTreeMap<String, FieldText>,
    #[serde(default)]
    pub(super) data: BTreeMap<String, DataText>,
    #[serde(default)]
    pub(super) im_data: BTreeMap<String, PointDataText>,
    #[serde(default)]
    pub(super) macros: Vec<(String, String)>,
    pub(super) expression: String,
    pub(super) order: Option<usize>,
    #[serde(default)]
    pub(super) dofs: Vec<(String, Option<Vec<f64>>, usize)>,
    pub(super) scalar: Option<f64>,
    pub(super) residual: Option<Vec<f64>>,
    /// Row (test function), column (unknown), value.
    pub(super) tangent: Option<Vec<(usize, usize, f64)>>,
    pub(super) rtol: Option<f64>,
    #[serde(default)]
    pub(super) kink: bool,
    #[serde(default)]
    pub(super) reject: bool,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub(super) enum RegionText {
    Cells {
        cells: Vec<u32>,
    },
    /// The cell that owns the face, and the nodes of the face.
    Faces {
        faces: Vec<(u32, Vec<u32>)>,
    },
}

#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub(super) enum FieldText {
    Fem {
        role: Role,
        space: String,
        components: usize,
        cells: Vec<u32>,
        /// Position of a node, its components.
        values: Vec<(Vec<f64>, Vec<f64>)>,
    },
    Global {
        role: Role,
        values: Vec<f64>,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Role {
    Variable,
    Data,
}

/// Values column by column.
#[derive(Debug, Deserialize)]
pub(super) struct DataText {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct PointDataText {
    pub(super) shape: Vec<usize>,
    /// Position of an integration point, its entries.
    pub(super) values: Vec<(Vec<f64>, Vec<f64>)>,
}
