//! The points of contact terms where several ranks have them.
//!
//! Every rank that has an entity evaluates it, so copies of a point have the same numbers and the same branches; one rank
//! counts it. Promises: what is decided for all points follows from sums and largest numbers of all ranks.

use wfl_discrete::assemble::Domain;
use wfl_mesh::mesh::Mesh;

/// What all ranks call a point of a term: names of points of one rank increase.
pub(super) type PointName = [u64; 2];

/// The points of a term on one of several ranks.
#[derive(Clone, Debug)]
pub(super) struct SharedPoints {
    /// By point: this rank counts it.
    counted: Vec<bool>,
    names: Vec<PointName>,
}

impl SharedPoints {
    pub(super) fn new(mesh: &Mesh, domain: &Domain) -> Self {
        let (mut counted, mut names) = (Vec::new(), Vec::new());
        for group in &domain.groups {
            let key = group.key.iter().fold(0, |word, byte| word << 8 | u64::from(*byte));
            for k in 0..group.entities.len() {
                let (counts, cell) = (group.is_counted(mesh, k), u64::from(mesh.cell_number(group.here.cells[k])));
                for q in 0..group.n_points() {
                    let q = group.here.row(k, q) as u64;
                    counted.push(counts);
                    // points of one entity may stand in several groups where images are found in other cells
                    names.push(if mesh.is_whole() { [0, names.len() as u64] } else { [key, cell << 16 | q] });
                }
            }
        }
        Self { counted, names }
    }

    /// Whether this rank counts a point.
    #[inline]
    pub(super) fn counts(&self, point: usize) -> bool {
        self.counted[point]
    }

    /// What all ranks call a point.
    pub(super) fn name(&self, point: usize) -> PointName {
        self.names[point]
    }
}
