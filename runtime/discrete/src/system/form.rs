//! Which equations a residual or a tangent belongs to: the arguments of [`super::System`] beside the unknowns.

use crate::{assemble::FieldValues, rates::Rates};

/// The branch of each projection at each integration point, by frozen term: values of two fields a term, which stand behind
/// the fields of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActiveSet {
    /// By frozen term.
    pub terms: Vec<TermBranches>,
}

/// The branches of a frozen term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TermBranches {
    /// The branches of its projections, point after point.
    pub points: Vec<f64>,
    /// How its law differs from what is written, once for all points.
    pub regularisation: Vec<f64>,
}

impl TermBranches {
    /// Puts the branches into the values of all fields, in which `field` is the first of their two.
    pub fn stand_in<'a>(&'a self, field: usize, current: &mut [&'a [f64]]) {
        (current[field], current[field + 1]) = (&self.points, &self.regularisation);
    }

    /// The branches in the values of all fields, in which `field` is the first of their two.
    #[must_use]
    pub fn from_values(field: usize, current: &[&[f64]]) -> Self {
        Self { points: current[field].to_vec(), regularisation: current[field + 1].to_vec() }
    }
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

/// The values of all fields at a state, those of branches behind those of the scene.
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
