//! Mass taken from some nodes and given to others, so that the body moves as before: nodes of contact without inertia.
//!
//! A node without mass takes part in the inertia with a value that is extrapolated from nodes beside it, its carriers, by
//! weights that reproduce affine fields. With S the extrapolation and M the mass matrix, the new mass is S'MS: it has no
//! entries at the nodes that were relieved, stays symmetric and positive, and gives every rigid motion and every uniform
//! strain the energy that it had; so total mass, centre of mass and moments of inertia stay. Kept are S'MS and the difference
//! S'MS - M, by dof in the axes of the scene. Promises: a function of the mesh and the terms alone. Steps nothing.
//!
//! Source: H. B. Khenous, P. Laborde, Y. Renard, Mass redistribution method for finite element contact problems in
//! elastodynamics, Eur. J. Mech. A/Solids 27 (2008) 918-932, who ask for the same invariants and solve for the entries of
//! the new matrix.

use std::collections::BTreeSet;

use nalgebra::{Matrix4, SymmetricEigen, Vector4};
use wfl_sparse::csr::Csr;

use crate::{
    assemble::AssembledTerm,
    field::{Field, FieldSpace},
    lumped::has_a_mass_of_its_own,
    rates::{Rates, Scheme},
    space::Space,
    system::{Branches, InRates, Redistribution, System, SystemError},
};
use wfl_compiler::types::{RateForm, RateOrder};

/// Eigenvalues below this part of the largest one are those of directions in which the carriers do not spread.
const FLAT: f64 = 1e-10;
/// Weights reproduce affine fields to this part of the distance of the carriers.
const EXACT: f64 = 1e-9;
/// Rings of elements around a node that are searched for carriers: enough for elements of any shape, and near enough for
/// the mass to stay beside the contact.
const RINGS: usize = 4;

/// Sum of the sizes of the weights of a node up to which its carriers are as near as they can be: two layers of equal
/// elements extrapolate with 2 and -1, layers that become twice as thick with 1.5 and -0.5, half as thick with 3 and -2.
const SPREAD: f64 = 5.0;

/// Nodes, or dofs, with their weights.
type Weights = Vec<(u32, f64)>;

/// Why mass cannot be taken from nodes.
#[derive(Debug)]
pub enum Unmovable {
    /// No field with inertia has nodes there.
    NoNodes,
    /// The inertia of a term, by its position, is not a matrix of its own that stays.
    Mixed {
        /// The term.
        term: usize,
    },
    /// All nodes near one are to be relieved, too, or the others lie in one plane that it is not in.
    Thin {
        /// The field.
        field: String,
        /// The node.
        position: [f64; 3],
    },
    /// The inertia of a term, by its position, is that of the faces themselves: it would be moved by a layer of cells.
    OnFaces {
        /// The term.
        term: usize,
    },
    /// The forces of a term, by its position, couple rates of relieved nodes with those of others and are not symmetric.
    Turning {
        /// The term.
        term: usize,
    },
    /// The mass cannot be evaluated.
    System(SystemError),
}

impl<E: Into<SystemError>> From<E> for Unmovable {
    fn from(error: E) -> Self {
        Self::System(error.into())
    }
}

/// What takes the mass from nodes: `nodes` gives those of a field, sorted.
///
/// # Errors
/// [`Unmovable`] says what stands against it.
pub fn redistribution(system: &mut System, nodes: &dyn Fn(&Field) -> Vec<u32>) -> Result<Redistribution, Unmovable> {
    let inertia = |t: &AssembledTerm| t.law.reads_rates(RateOrder::Second);
    if let Some(term) = system.terms.iter().position(|t| inertia(t) && !has_a_mass_of_its_own(t)) {
        return Err(Unmovable::Mixed { term });
    }
    let mut carriers: Vec<Option<Weights>> = vec![None; system.numbering.n_dofs];
    let fields = system.rates().into_iter().flat_map(Rates::fields).filter(|of| of.form == RateForm::Second);
    for of in fields {
        let field = &system.fields[of.field];
        let FieldSpace::Nodal(space) = &field.space else { continue };
        let relieved: BTreeSet<u32> = nodes(field).into_iter().collect();
        for (node, weights) in
            carriers_of(space, &relieved).map_err(|position| Unmovable::Thin { field: field.name.clone(), position })?
        {
            for component in 0..field.n_components {
                let dof = |node: u32| of.dofs.start + node as usize * field.n_components + component;
                let number = |node: u32| u32::try_from(dof(node)).expect("fewer than 2^32 dofs");
                carriers[dof(node)] = Some(weights.iter().map(|(node, w)| (number(*node), *w)).collect());
            }
        }
    }
    let relieved: Vec<bool> = carriers.iter().map(Option::is_some).collect();
    if !relieved.contains(&true) {
        return Err(Unmovable::NoNodes);
    }
    if let Some(term) = on_faces(system, &relieved) {
        return Err(Unmovable::OnFaces { term });
    }
    if let Some(term) = turning(system, &relieved)? {
        return Err(Unmovable::Turning { term });
    }
    let inertial: Vec<usize> = (0..system.terms.len()).filter(|k| inertia(&system.terms[*k])).collect();
    let mass = of_rates(system, RateOrder::Second, &inertial)?;
    let [left, difference] = redistributed(&mass, &carriers)?;
    Ok(Redistribution::new(left, difference, relieved))
}

/// A term on faces with inertia at dofs that are to be relieved.
fn on_faces(system: &System, relieved: &[bool]) -> Option<usize> {
    let acts_there = |term: &AssembledTerm| {
        let mut acts = false;
        term.for_each_entity(|rows, _| acts |= rows.iter().any(|d| relieved[*d as usize]));
        acts
    };
    system.terms.iter().position(|t| t.law.reads_rates(RateOrder::Second) && !t.on_cells() && acts_there(t))
}

/// By relieved node its carriers with their weights; the position of a node that has none.
fn carriers_of(space: &Space, relieved: &BTreeSet<u32>) -> Result<Vec<(u32, Weights)>, [f64; 3]> {
    let mut elements: Vec<Vec<usize>> = vec![Vec::new(); space.n_nodes()];
    for position in 0..space.n_positions() {
        space.entity_nodes(position).iter().for_each(|node| elements[*node as usize].push(position));
    }
    let at = space.node_coordinates();
    let of_node = |node: u32| {
        let point = at[node as usize];
        let (mut ring, mut found) = (BTreeSet::from([node]), None);
        for _ in 0..RINGS {
            let beside = ring.iter().flat_map(|n| &elements[*n as usize]);
            ring = beside.flat_map(|position| space.entity_nodes(*position)).copied().collect();
            let others: Vec<(u32, [f64; 3])> = ring.difference(relieved).map(|n| (*n, at[*n as usize])).collect();
            match nearest_carriers(point, others) {
                Some((size, weights)) if size <= SPREAD => return Ok((node, weights)),
                other => found = other.or(found),
            }
        }
        found.map(|(_, weights)| (node, weights)).ok_or(point)
    };
    relieved.iter().map(|node| of_node(*node)).collect()
}

/// The nearest of some nodes that carry a point with weights of a moderate size, else all of them; with the sum of the sizes
/// of the weights. Nodes at one distance come together, so that the weights have the symmetry of the mesh.
fn nearest_carriers(point: [f64; 3], others: Vec<(u32, [f64; 3])>) -> Option<(f64, Weights)> {
    let distance = |p: &[f64; 3]| (0..3).map(|d| (p[d] - point[d]).powi(2)).sum::<f64>().sqrt();
    let mut others: Vec<(f64, u32, [f64; 3])> = others.into_iter().map(|(n, p)| (distance(&p), n, p)).collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut last = None;
    for count in 1..=others.len() {
        if others.get(count).is_some_and(|next| next.0 <= (1.0 + EXACT) * others[count - 1].0) {
            continue;
        }
        let places: Vec<[f64; 3]> = others[..count].iter().map(|o| o.2).collect();
        let Some(weights) = affine_weights(point, &places) else { continue };
        let size = weights.iter().map(|w| w.abs()).sum();
        last = Some((size, others.iter().zip(weights).map(|(o, w)| (o.1, w)).collect()));
        if size <= SPREAD {
            break;
        }
    }
    last
}

/// The smallest weights whose sum is 1 and which bring the centre of the places to a point; `None` where none do.
fn affine_weights(point: [f64; 3], places: &[[f64; 3]]) -> Option<Vec<f64>> {
    let from = |place: &[f64; 3]| [0, 1, 2].map(|d| place[d] - point[d]);
    let size = places.iter().flat_map(from).fold(0.0f64, |a, b| a.max(b.abs()));
    if size == 0.0 {
        return None;
    }
    let column = |place: &[f64; 3]| {
        let [x, y, z] = from(place).map(|d| d / size);
        Vector4::new(1.0, x, y, z)
    };
    let gram: Matrix4<f64> = places.iter().map(|p| column(p) * column(p).transpose()).sum();
    let found = SymmetricEigen::new(gram);
    let least = FLAT * found.eigenvalues.max();
    let wanted = Vector4::new(1.0, 0.0, 0.0, 0.0);
    let mut factors = Vector4::zeros();
    for (k, value) in found.eigenvalues.iter().enumerate().filter(|(_, value)| **value > least) {
        let direction = found.eigenvectors.column(k);
        factors += direction * (direction.dot(&wanted) / value);
    }
    let weights: Vec<f64> = places.iter().map(|p| column(p).dot(&factors)).collect();
    let sum: Vector4<f64> = places.iter().zip(&weights).map(|(p, w)| column(p) * *w).sum();
    ((sum - wanted).amax() < EXACT).then_some(weights)
}

/// A term whose derivative in the rates is not symmetric between relieved nodes and others, such as that of Coriolis or of
/// convection. Its two forces cancel in the power as long as both nodes have rates of one kind; those of nodes without
/// mass are differences backwards, those of others are not, and such a term feeds what it should turn.
fn turning(system: &mut System, relieved: &[bool]) -> Result<Option<usize>, SystemError> {
    // schemes of backward differences lose what such a term feeds
    if !system.rates().is_some_and(|rates| matches!(rates.scheme(), Scheme::Newmark { .. } | Scheme::Alpha(_))) {
        return Ok(None);
    }
    let second = system.rates().into_iter().flat_map(Rates::fields).filter(|of| of.form == RateForm::Second);
    let ranges: Vec<_> = second.map(|of| of.dofs.clone()).collect();
    let moves = |dof: usize| ranges.iter().any(|range| range.contains(&dof));
    for term in 0..system.terms.len() {
        if !system.terms[term].law.reads_rates(RateOrder::First) {
            continue;
        }
        let made = of_rates(system, RateOrder::First, &[term])?;
        let beside = (0..made.n_rows()).filter(|row| relieved[*row]);
        let is_skew = |row: usize| {
            let columns = made.row(row).0.iter().map(|column| *column as usize);
            let mut others = columns.filter(|column| !relieved[*column] && moves(*column));
            others.any(|column| (made.get(row, column) - made.get(column, row)).abs() > EXACT * made.max_abs())
        };
        if beside.filter(|row| moves(*row)).any(is_skew) {
            return Ok(Some(term));
        }
    }
    Ok(None)
}

/// The derivative of some terms in the rates of an order where nothing has moved, by dof in the axes of the scene: in the second
/// ones it is the mass matrix.
fn of_rates(system: &mut System, order: RateOrder, terms: &[usize]) -> Result<Csr, SystemError> {
    let zero = vec![0.0; system.numbering.n_dofs];
    system.matrix_of_rates(InRates { order, terms, at: &zero, branches: Branches::AsWritten })
}

/// S'MS and S'MS - M, where S takes the value of a dof with carriers from them.
fn redistributed(mass: &Csr, carriers: &[Option<Weights>]) -> Result<[Csr; 2], SystemError> {
    let (mut left, mut difference) = (Vec::new(), Vec::new());
    let itself = |dof: u32| vec![(dof, 1.0)];
    for (row, number) in (0..mass.n_rows()).zip(0u32..) {
        let (columns, values) = mass.row(row);
        for (column, value) in columns.iter().zip(values).filter(|(_, value)| **value != 0.0) {
            let (of_row, of_column) = (&carriers[row], &carriers[*column as usize]);
            if of_row.is_none() && of_column.is_none() {
                left.push((number, *column, *value));
                continue;
            }
            difference.push((number, *column, -value));
            for (r, a) in of_row.clone().unwrap_or_else(|| itself(number)) {
                let of_column = of_column.clone().unwrap_or_else(|| itself(*column));
                let entries = || of_column.iter().map(|(c, b)| (r, *c, a * value * b));
                left.extend(entries());
                difference.extend(entries());
            }
        }
    }
    let n = mass.n_rows();
    Ok([Csr::from_triplets(n, n, &left)?, Csr::from_triplets(n, n, &difference)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(weights: &[f64], places: &[[f64; 3]]) -> [f64; 4] {
        let sum = |f: &dyn Fn(&[f64; 3]) -> f64| weights.iter().zip(places).map(|(w, p)| w * f(p)).sum();
        [sum(&|_| 1.0), sum(&|p| p[0]), sum(&|p| p[1]), sum(&|p| p[2])]
    }

    #[test]
    fn weights_reproduce_affine_fields_and_are_none_where_the_places_do_not_spread() {
        let plane = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0]];
        assert_eq!(affine_weights([0.5, 0.5, 0.0], &plane), None);
        let mut layers = plane.to_vec();
        layers.extend(plane.map(|p| [p[0], p[1], 2.0 + p[0]]));
        let weights = affine_weights([0.3, 0.9, 0.0], &layers).unwrap();
        for (found, exact) in moments(&weights, &layers).iter().zip([1.0, 0.3, 0.9, 0.0]) {
            assert!((found - exact).abs() < 1e-12, "{found} {exact}");
        }
        // a point in the plane of its carriers needs no third direction
        let weights = affine_weights([0.5, 0.5, 1.0], &plane).unwrap();
        assert!(weights.iter().all(|w| (w - 0.25).abs() < 1e-12), "{weights:?}");
        assert_eq!(affine_weights([0.0; 3], &[]), None);
    }

    #[test]
    fn the_new_mass_has_no_entries_at_relieved_nodes_and_the_old_energy_of_affine_motions() {
        // a bar of three elements with nodes at 0, 1, 2, 4; the first one is relieved: its value is 2 x1 - x2
        let lengths = [1.0, 1.0, 2.0];
        let mut entries = Vec::new();
        for (k, l) in (0u32..).zip(lengths) {
            entries.extend([(k, k, l / 3.0), (k, k + 1, l / 6.0), (k + 1, k, l / 6.0), (k + 1, k + 1, l / 3.0)]);
        }
        let mass = Csr::from_triplets(4, 4, &entries).unwrap();
        let carriers = [Some(vec![(1, 2.0), (2, -1.0)]), None, None, None];
        let [new, difference] = redistributed(&mass, &carriers).unwrap();
        let sum = mass.plus(&difference).unwrap();
        assert!((0..16).all(|k| (sum.get(k / 4, k % 4) - new.get(k / 4, k % 4)).abs() < 1e-15));
        assert_eq!((0..4).map(|k| new.get(0, k).abs() + new.get(k, 0).abs()).sum::<f64>(), 0.0);
        assert!(new.is_symmetric(1e-15));
        let energy = |m: &Csr, v: [f64; 4]| {
            let mut p = vec![0.0; 4];
            m.multiply(&v, &mut p, 1);
            v.iter().zip(&p).map(|(v, p)| v * p).sum::<f64>()
        };
        for motion in [[1.0; 4], [0.0, 1.0, 2.0, 4.0], [3.0, 2.0, 1.0, -1.0]] {
            assert!((energy(&new, motion) - energy(&mass, motion)).abs() < 1e-13, "{motion:?}");
        }
    }
}
