//! Which equations a residual or a tangent belongs to: the arguments of [`super::System`] beside the unknowns.

use crate::{assemble::FieldValues, rates::Rates};

/// The branch of each projection at each integration point, by frozen term: values of a field of branch data that
/// stands behind the fields of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActiveSet {
    /// By frozen term: branch data, point after point.
    pub branch_data: Vec<Vec<f64>>,
}

/// The branches that projections are on.
#[derive(Clone, Copy, Debug)]
pub enum Branches<'a> {
    /// Each follows from the unknowns: the law as it is written.
    AsWritten,
    /// Those of an active set, whatever the unknowns are.
    Frozen(&'a ActiveSet),
}

/// How the terms that are linear in the unknowns are evaluated.
///
/// Their matrix is the quicker way. Its entries are rounded, and where cells are long and thin the sum of a row leaves
/// `eps |K| |u|` of a motion that strains nothing, which may be more than the forces of the motion that is wanted: a
/// needle of length h and width w bends with mu w^2/h while its entries are E h. At the points the strain is found
/// first; what rounding leaves of it acts on the nodes of a cell with opposite forces, which move the needle by nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinearTerms {
    /// By their matrix.
    #[default]
    ByMatrix,
    /// At their integration points.
    AtPoints,
}

/// The equations of a residual.
#[derive(Clone, Copy, Debug)]
pub struct Form<'a> {
    /// The branches of the projections.
    pub branches: Branches<'a>,
    /// How linear terms are evaluated; both ways give the same but for rounding.
    pub linear: LinearTerms,
    /// By dof, in the axes of the scene and the unit of the residual, in the rows of this rank: a constant that is added.
    /// Empty for none.
    pub offset: &'a [f64],
}

impl Form<'_> {
    /// The equations of the scene.
    pub const AS_WRITTEN: Form<'static> =
        Form { branches: Branches::AsWritten, linear: LinearTerms::ByMatrix, offset: &[] };
}

/// The values of all fields at a state, those of branch data behind those of the scene.
pub struct StateValues<'a> {
    /// Now.
    pub current: Vec<&'a [f64]>,
    /// At the end of the previous step; empty unless something reads it.
    pub previous: Vec<&'a [f64]>,
    /// Rates that are more than differences.
    pub rates: Option<&'a Rates>,
}

impl StateValues<'_> {
    /// As the assembly takes them.
    #[must_use]
    pub fn view(&self) -> FieldValues<'_> {
        FieldValues { current: &self.current, previous: &self.previous, rates: self.rates }
    }
}
