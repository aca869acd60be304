//! Which rank has the row of each dof.
//!
//! Nodes are shared out by recursive bisection of their coordinates, whole: every component of a node, and all nodes at
//! one point (the two sides of an interface) have one rank. A dof that follows another one goes with it. The owner of a
//! row computes all of it, entities next to its own included, so every row has the bits that one rank alone gives it.
//! Promises: a function of the scene and the number of ranks alone. Does not assemble.

use std::sync::Arc;

use wfl_host::team::Team;

use crate::{field::Field, system::Numbering};

/// See the module documentation.
#[derive(Clone, Debug)]
pub struct Share {
    team: Arc<dyn Team>,
    /// Number of this rank.
    own: u16,
    /// By dof.
    owner: Vec<u16>,
}

impl Share {
    /// Shares out the dofs of the fields that are solved for.
    ///
    /// # Panics
    /// With more than 65,535 ranks.
    #[must_use]
    pub fn new(team: Arc<dyn Team>, fields: &[Field], numbering: &Numbering) -> Self {
        let solved = || (fields.iter().zip(&numbering.starts)).filter_map(|(field, start)| Some((field, (*start)?)));
        let nodes = solved().flat_map(|(field, _)| (0..field.n_nodes()).map(|node| field.node_position(node)));
        let ranks = bisect(&nodes.collect::<Vec<_>>(), team.size());
        let mut owner = vec![0; numbering.n_dofs];
        let mut ranks = ranks.into_iter();
        for (field, start) in solved() {
            for dofs in owner[start..][..field.n_dofs()].chunks_mut(field.n_components) {
                dofs.fill(ranks.next().expect("a rank for each node"));
            }
        }
        numbering.ties().iter().for_each(|tie| owner[tie.follower] = owner[tie.leader]);
        let own = u16::try_from(team.rank()).expect("fewer than 2^16 ranks");
        Self { team, own, owner }
    }

    /// The ranks.
    #[must_use]
    pub fn team(&self) -> &Arc<dyn Team> {
        &self.team
    }

    /// The rank that has the row of a dof.
    #[inline]
    #[must_use]
    pub fn owner(&self, dof: usize) -> usize {
        usize::from(self.owner[dof])
    }

    /// Whether this rank has the row of a dof.
    #[inline]
    #[must_use]
    pub fn owns(&self, dof: usize) -> bool {
        self.owner[dof] == self.own
    }

    /// Clears what other ranks own of numbers by dof.
    pub fn keep_own(&self, values: &mut [f64]) {
        assert_eq!(values.len(), self.owner.len(), "a number for each dof");
        let of_others = values.iter_mut().zip(&self.owner).filter(|(_, owner)| **owner != self.own);
        of_others.for_each(|(value, _)| *value = 0.0);
    }
}

/// By node its rank: halves of the longest axis, in the ratio of the ranks on both sides.
fn bisect(points: &[[f64; 3]], ranks: usize) -> Vec<u16> {
    let rank = |k: usize| u16::try_from(k).expect("fewer than 2^16 ranks");
    let mut owner = vec![0; points.len()];
    let mut parts = vec![((0..points.len()).collect::<Vec<usize>>(), 0, ranks)];
    while let Some((mut nodes, first, n)) = parts.pop() {
        if n <= 1 || nodes.is_empty() {
            nodes.iter().for_each(|node| owner[*node] = rank(first));
            continue;
        }
        let length = |d: usize| {
            let along = nodes.iter().map(|node| points[*node][d]);
            along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
        };
        let longest = (1..3).fold(0, |best, d| if length(d) > length(best) { d } else { best });
        // the other axes decide among nodes on one plane
        let axes = [longest, (longest + 1) % 3, (longest + 2) % 3];
        let compare = |a: &usize, b: &usize| {
            let by = |d: &usize| points[*a][*d].total_cmp(&points[*b][*d]);
            axes.iter().map(by).find(|order| order.is_ne()).unwrap_or_else(|| a.cmp(b))
        };
        nodes.sort_unstable_by(compare);
        let mut cut = nodes.len() * (n / 2) / n;
        while cut > 0 && cut < nodes.len() && points[nodes[cut]] == points[nodes[cut - 1]] {
            cut += 1;
        }
        let behind = nodes.split_off(cut);
        parts.push((nodes, first, n / 2));
        parts.push((behind, first + n / 2, n - n / 2));
    }
    owner
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_even_and_nodes_at_one_point_have_one_rank() {
        // two bodies of 3x2x1 nodes that touch at x = 2
        let body = |x0: f64| (0..6).map(move |k| [x0 + f64::from(k % 3), f64::from(k / 3), 0.0]);
        let points: Vec<[f64; 3]> = body(0.0).chain(body(2.0)).collect();
        for ranks in 1..=4 {
            let owner = bisect(&points, ranks);
            assert_eq!((owner[2], owner[5]), (owner[6], owner[9]), "{ranks} ranks: the sides of the interface");
            let counts: Vec<usize> =
                (0..ranks).map(|rank| owner.iter().filter(|o| usize::from(**o) == rank).count()).collect();
            assert!(counts.iter().all(|n| n.abs_diff(12 / ranks) <= 2), "{counts:?}");
        }
    }
}
