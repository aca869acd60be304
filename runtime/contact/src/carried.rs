//! Branches and projections at the points of one state for those of another, where faces are cut anew in each state.
//!
//! Such a point has no past of its own: its branch is that of the nearest point of its face, at which another state was cut.
//! Each point of an active set therefore ends with its name, the number of its face and the parameters there, which laws do
//! not read. Promises: what is on the points of the state already stays as it is. Laws whose points stay have no names.

use std::borrow::Cow;

use super::{ContactTerm, ProjectionState};
use wfl_discrete::{
    assemble::FieldValues,
    domain::{NAME, PointName, nearest_points},
    system::TermBranches,
};
use wfl_mesh::mesh::Mesh;

impl ContactTerm {
    /// True if its points are others in each state: those of pieces of faces.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.sampled.domain.moving.as_ref().is_some_and(|points| points.are_of_pieces())
    }

    /// The names of the points at a state; none of a term whose points stay.
    pub(super) fn names_at(&self, mesh: &Mesh, values: FieldValues<'_>) -> Vec<PointName> {
        if self.is_cut() { self.sampled.at(mesh, values.current).domain.point_names() } else { Vec::new() }
    }

    /// True if so many numbers are those of some points.
    pub(super) fn has_whole_points(&self, n: usize) -> bool {
        n > 0 && n.is_multiple_of(self.sizes.point)
    }

    /// The names at the ends of points.
    fn names_of(&self, data: &TermBranches) -> Vec<PointName> {
        let points = data.points.chunks_exact(self.sizes.point);
        points.filter_map(|point| point.last_chunk().copied()).collect()
    }

    /// Open branches at points with these names.
    pub(super) fn open_on(&self, names: &[PointName]) -> TermBranches {
        let mut open = self.open_at(names.len());
        for (point, name) in open.points.chunks_exact_mut(self.sizes.point).zip(names) {
            let end = point.len() - NAME;
            point[end..].copy_from_slice(name);
        }
        open
    }

    /// The branches at points with these names.
    pub(super) fn carried<'d>(&self, data: &'d TermBranches, names: &[PointName]) -> Cow<'d, TermBranches> {
        if !self.is_cut() {
            return Cow::Borrowed(data);
        }
        let from = self.names_of(data);
        if from == names || from.is_empty() {
            return Cow::Borrowed(data);
        }
        let mut carried = self.open_on(names);
        carried.regularisation.clone_from(&data.regularisation);
        let n = self.sizes.point;
        for (point, k) in carried.points.chunks_exact_mut(n).zip(nearest_points(&from, names)) {
            point[..n - NAME].copy_from_slice(&data.points[k as usize * n..][..n - NAME]);
        }
        Cow::Owned(carried)
    }

    /// The branches at the points of others.
    pub(super) fn carried_to<'d>(&self, data: &'d TermBranches, others: &TermBranches) -> Cow<'d, TermBranches> {
        if self.is_cut() { self.carried(data, &self.names_of(others)) } else { Cow::Borrowed(data) }
    }
}

impl ProjectionState {
    /// The same at the points of another state, with their weights.
    pub(super) fn carried_to(&self, to: &Self) -> Cow<'_, Self> {
        if self.names == to.names || self.names.is_empty() {
            return Cow::Borrowed(self);
        }
        let n = self.values.len() / self.names.len();
        let nearest = nearest_points(&self.names, &to.names);
        let values = nearest.iter().flat_map(|k| &self.values[*k as usize * n..][..n]).copied().collect();
        Cow::Owned(Self { values, weights: to.weights.clone(), names: to.names.clone() })
    }
}
