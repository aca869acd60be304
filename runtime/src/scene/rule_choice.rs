//! How the points of a region are chosen, and where faces of a body of revolution meet its axis. Makes no points.

use std::collections::BTreeMap;

use wfl_compiler::{Class, TermLaw};

use crate::mesh::{FacetRef, Mesh};

/// A coordinate below this part of the length of the face is zero: the end lies on the axis.
const ON_AXIS: f64 = 1e-6;

/// Degree of the rule, or the nodal rule, by region name.
pub(super) type Rules = BTreeMap<String, RuleChoice>;

/// How points are chosen on a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RuleChoice {
    /// Gauss points exact to this degree.
    Degree(usize),
    /// The nodes of the fields on the region: the vertices for degree 1, Simpson's points for degree 2.
    Vertex,
    /// As many points as elements of this degree have nodes; inside faces that meet the axis where a coordinate is zero.
    Nodes {
        /// The degree of the fields.
        degree: usize,
        /// The coordinate: 0 for x.
        axis: Option<usize>,
    },
}

impl RuleChoice {
    /// What `wfl check` calls it.
    #[must_use]
    pub fn words(self) -> String {
        match self {
            RuleChoice::Degree(degree) => format!("degree {degree}"),
            RuleChoice::Vertex => "vertex".to_owned(),
            RuleChoice::Nodes { .. } => "nodes".to_owned(),
        }
    }

    /// The rule of a law on a region with this rule that no statement gives: what does not depend on the unknowns, a load,
    /// needs no points at the nodes and has those of its degree.
    pub(super) fn of(self, law: &TermLaw) -> RuleChoice {
        match self {
            RuleChoice::Nodes { .. } if law.class == Class::Constant => RuleChoice::Degree(law.degree.rule()),
            choice => choice,
        }
    }
}

/// The end of a facet of a plane mesh that lies where this coordinate is zero: 0 or 1.
pub(super) fn end_on_axis(mesh: &Mesh, facet: FacetRef, axis: usize) -> Option<usize> {
    let ends = ends(mesh, facet);
    let length = (ends[0][0] - ends[1][0]).hypot(ends[0][1] - ends[1][1]);
    let on = |end: usize| ends[end][axis].abs() <= ON_AXIS * length;
    (0..2).find(|end| on(*end) && !on(1 - end))
}

/// The ends of a facet of a plane mesh.
pub(super) fn ends(mesh: &Mesh, facet: FacetRef) -> [[f64; 3]; 2] {
    let vertices = mesh.facet_vertices(facet).vertices;
    [0, 1].map(|k| mesh.node(vertices[k]))
}
