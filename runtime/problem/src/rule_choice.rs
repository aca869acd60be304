//! How the points of a region are chosen, and where faces of a body of revolution meet its axis. Makes no points.

use std::collections::BTreeMap;

use wfl_compiler::{
    Class, TermLaw,
    types::{FieldKind, InputSlot},
};
use wfl_discrete::field::Field;
use wfl_mesh::mesh::{FacetRef, Mesh};

/// A coordinate below this part of the length of the face is zero: the end lies on the axis.
const ON_AXIS: f64 = 1e-6;

/// Degree of the rule, or the nodal rule, by region name.
pub(super) type Rules = BTreeMap<String, RuleChoice>;

/// How points are chosen on a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RuleChoice {
    /// Gauss points exact to this degree.
    Degree(usize),
    /// Gauss points of this degree on the pieces between edges of the faces that a mapping leads to, for laws that read
    /// through it; on whole faces for others.
    Segments {
        /// The number of the mapping.
        mapping: usize,
        /// The degree.
        degree: usize,
    },
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
            RuleChoice::Segments { degree, .. } => format!("segments, degree {degree}"),
            RuleChoice::Vertex => "vertex".to_owned(),
            RuleChoice::Nodes { .. } => "nodes".to_owned(),
        }
    }

    /// The degree on pieces of faces, where they are cut.
    pub(super) fn pieces(self) -> Option<usize> {
        if let RuleChoice::Segments { degree, .. } = self { Some(degree) } else { None }
    }

    /// The rule of a law that reads through this mapping, if any: faces are cut for laws that read through the one that cuts.
    pub(super) fn through(self, read: Option<usize>) -> RuleChoice {
        match self {
            RuleChoice::Segments { mapping, degree } if read != Some(mapping) => RuleChoice::Degree(degree),
            choice => choice,
        }
    }

    /// The rule of a law on a region with this rule that no statement gives: what does not depend on the unknowns, a load,
    /// needs no points at the nodes and has those of its degree. So has a law without kinks with a field of a higher degree
    /// than those of the contact (the temperature beside a displacement): some of its nodes have no point here.
    pub(super) fn of(self, law: &TermLaw, fields: &[Field]) -> RuleChoice {
        match self {
            RuleChoice::Segments { .. } => self.through(law.listing.graph.mapping),
            RuleChoice::Nodes { .. } if law.class == Class::Constant => RuleChoice::Degree(law.degree.rule()),
            RuleChoice::Nodes { degree, .. } if !is_bound(law, fields) && highest(law, fields) > Some(degree) => {
                RuleChoice::Degree(law.degree.rule())
            }
            choice => choice,
        }
    }
}

/// Whether a law holds at the points of a rule and nowhere else: it has kinks, or reads a state that is stored there.
pub(super) fn is_bound(law: &TermLaw, fields: &[Field]) -> bool {
    law.degree.kinked || states_read(fields, &law.inputs).next().is_some()
}

/// The states that a law reads.
pub(super) fn states_read<'i>(fields: &'i [Field], inputs: &'i [InputSlot]) -> impl Iterator<Item = usize> + 'i {
    let field = |slot: &InputSlot| match slot {
        InputSlot::Field(b) | InputSlot::Previous(b) | InputSlot::History(_, b) => Some(b.field.index()),
        _ => None,
    };
    // the branches of frozen terms are numbered after the fields
    let is_state = |k: &usize| fields.get(*k).is_some_and(|f| f.kind == FieldKind::State && f.is_at_points());
    inputs.iter().filter_map(field).filter(is_state)
}

/// The highest degree of the fields that a law tests and depends on.
pub(super) fn highest(law: &TermLaw, fields: &[Field]) -> Option<usize> {
    let own = law.tests.iter().map(|t| t.field).chain(law.trials.iter().map(|t| t.field));
    own.filter_map(|field| fields.get(field.index())).map(Field::degree).max()
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
