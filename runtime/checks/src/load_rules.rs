//! Loads that their quadrature rule does not resolve: their nodal forces under a rule of a higher degree.
//!
//! A load is a formula of the position (and of known fields). Where it is no polynomial that the rule integrates exactly, a
//! rule with more points says how far the nodal forces are from the integral: a peak between the points, a jump inside a
//! facet, a pole at an edge such as 1/x, whose integral does not even exist. Looks at terms without unknowns alone, at the
//! step of the system; loads that their rule integrates exactly cost nothing.

use wfl_compiler::Class;
use wfl_discrete::{
    assemble::{AssembledTerm, Domain, Over},
    system::{FIXED, System},
};
use wfl_mesh::{
    mesh::{CellKind, InterfaceFacet, RegionSet},
    quadrature::Rule,
};

use crate::{
    singular::{with_points, with_rule},
    worst::Finding,
};

/// What the degree of a rule is raised by: two more points in each direction, whose error for smooth loads is a hundred times
/// smaller, so that the difference is the error of the rule that is used.
const MORE: usize = 4;
/// The part of the nodal forces that a finer rule may move without a word. A jump of the load inside one of ten facets
/// moves half a facet at most, a twentieth; elastic displacements are wrong by the same part as the forces.
const MOVED: f64 = 0.1;

/// A load whose nodal forces a finer rule moves.
#[derive(Clone, Debug, PartialEq)]
pub struct CoarseLoad {
    /// The position of its term.
    pub term: usize,
    /// The degree of the finer rule.
    pub degree: usize,
    /// By how much that moves the nodal forces: the sum of the sizes of the changes over that of the forces.
    pub share: f64,
    /// The step variable.
    pub time: f64,
    /// The node where the change is the largest.
    pub position: [f64; 3],
}

/// Of the terms at these positions with the degrees of their rules, the loads that they do not resolve.
#[must_use]
pub fn coarse_loads(system: &System, ruled: &[(usize, usize)]) -> Vec<CoarseLoad> {
    ruled.iter().filter_map(|(term, degree)| coarse_load(system, *term, *degree)).collect()
}

fn coarse_load(system: &System, term: usize, degree: usize) -> Option<CoarseLoad> {
    let load = &system.terms[term];
    let law = &load.law;
    let is_exact = law.degree.is_exact() && law.degree.rule() <= degree;
    if law.class != Class::Constant || law.tests.is_empty() || is_exact {
        return None;
    }
    // a term through a mapping has points where others have none
    let region = region(&load.integrator.domain).filter(|_| law.listing.graph.mapping.is_none())?;
    let degree = degree.max(law.degree.rule()) + MORE;
    let finer = with_rule(system, load, &region, degree)?;
    let zero = vec![0.0; system.numbering.n_dofs];
    let forces = |term: &AssembledTerm| {
        let mut out = vec![0.0; zero.len()];
        // where the load has no finite value the run itself says so with the place
        system.residual_of(term, &zero, &mut out).ok().map(|()| out)
    };
    let (own, fine) = (forces(load)?, forces(&finer)?);
    let (mut moved, mut size, mut worst) = (0.0, 0.0, (0.0f64, 0));
    for dof in (0..zero.len()).filter(|d| system.numbering.free[*d] != FIXED) {
        let change = (fine[dof] - own[dof]).abs();
        moved += change;
        size += fine[dof].abs().max(own[dof].abs());
        if change > worst.0 {
            worst = (change, dof);
        }
    }
    let mut sums = [moved, size];
    system.team().sum(&mut sums);
    let own = (worst.0 > 0.0).then(|| {
        let (field, node, _) = system.numbering.describe(&system.fields, worst.1);
        Finding { size: worst.0, numbers: system.fields[field].node_position(node).to_vec(), names: Vec::new() }
    });
    let position = Finding::worst(own, system.team())?.numbers.try_into().ok()?;
    let (share, time) = (sums[0] / sums[1], system.step().stage);
    (share > MOVED).then_some(CoarseLoad { term, degree, share, time, position })
}

/// A term with the points of another rule, interpreted, at the step of the system; `None` for terms at nodes, on `global`
/// and through a mapping, and for those that read states, which have values at the points of their own rule alone.
#[must_use]
pub fn under_rule(system: &System, term: &AssembledTerm, rule: &dyn Fn(CellKind) -> Rule) -> Option<AssembledTerm> {
    let region = region(&term.integrator.domain).filter(|_| term.law.listing.graph.mapping.is_none())?;
    with_points(system, term, &region, rule)
}

/// The region of a domain; `None` for loads at nodes and on `global`.
fn region(domain: &Domain) -> Option<RegionSet> {
    let groups = &domain.groups;
    match domain.over {
        Over::Points => return None,
        Over::Cells => {
            return Some(RegionSet::Cells(groups.iter().flat_map(|g| g.here.cells.iter().copied()).collect()));
        }
        Over::Edges => return Some(RegionSet::Edges(domain.edges().collect())),
        Over::Facets => {}
    }
    if groups.iter().all(|g| g.there.is_none()) {
        return Some(RegionSet::Facets(groups.iter().flat_map(|g| g.here.facets.iter().copied()).collect()));
    }
    let mut pairs = Vec::new();
    for group in groups {
        let sides = group.here.facets.iter().zip(&group.there.as_ref()?.facets);
        pairs.extend(sides.map(|(here, there)| InterfaceFacet { here: *here, there: *there }));
    }
    Some(RegionSet::Interface(pairs))
}
