//! The statement `mesh`: a box, or files at their places.

use super::{BoxDivision, BoxShape, Expr};
use crate::source::Span;

/// Where a mesh comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshSource {
    /// `box A to B cells N shape` or `box A to B size h shape`
    Box {
        /// One corner.
        from: Expr,
        /// The opposite corner.
        to: Expr,
        /// Cells in each direction, or one size for all.
        division: BoxDivision,
        /// The shape; the default is segment, quad or hex by dimension.
        shape: Option<(BoxShape, Span)>,
    },
    /// `file "m.msh", "n.msh" moved by [1,0]`
    Files(Vec<MeshFile>),
}

/// `"m.msh" scaled by s turned by a about [..] moved by [..]`
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFile {
    /// The path as written, relative to the scene file.
    pub path: String,
    /// Its place.
    pub span: Span,
    /// How it is placed, in the order in which this is done.
    pub placed: Vec<Placing>,
}

/// One step of placing the mesh of a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Placing {
    /// `moved by [1,0]`
    Moved(Expr),
    /// `turned by 30 about [0,0,1]`: degrees, about an axis through the origin; in the plane without one.
    Turned(Expr, Option<Expr>),
    /// `scaled by 1e-3`
    Scaled(Expr),
}

impl Placing {
    /// Its expressions.
    pub fn exprs(&self) -> impl Iterator<Item = &Expr> {
        let (first, second) = match self {
            Placing::Moved(e) | Placing::Scaled(e) => (e, None),
            Placing::Turned(e, axis) => (e, axis.as_ref()),
        };
        std::iter::once(first).chain(second)
    }
}

impl MeshSource {
    /// The expressions that say where the meshes of files are.
    pub fn placing(&self) -> impl Iterator<Item = &Expr> {
        let files: &[MeshFile] = match self {
            MeshSource::Files(files) => files,
            MeshSource::Box { .. } => &[],
        };
        files.iter().flat_map(|f| &f.placed).flat_map(Placing::exprs)
    }
}
