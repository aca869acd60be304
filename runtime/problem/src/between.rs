//! Given values between the nodes of the fields that take them.
//!
//! A prescribed value, a known field or a first value is a formula of the position, and a field takes it at its nodes: a
//! pulse between them is lost without a trace. Found by comparing the formula with its interpolation at many points. Says
//! how much of the given values is lost in the mean; does not judge.

use std::iter;

use wfl_compiler::types::InputSlot;
use wfl_discrete::{field::FieldSpace, space::Support, value::Value, window::Window};
use wfl_mesh::{
    element::{Element, Family},
    mesh::{CellId, CellKind, FacetRef, Mesh},
    quadrature::{composite, facet_points},
};

use super::{Given, Scene, parts};

/// What interpolation between nodes loses of given values.
#[derive(Clone, Debug, Default)]
pub struct Between {
    /// By cell of the mesh: the integral of the size of the difference over that of the size of the values.
    pub parts: Vec<f64>,
    /// Their sum, the largest of all given values.
    pub lost: f64,
}

/// Where a formula is looked at.
pub(super) enum At<'a> {
    Cells(&'a [CellId]),
    Facets(&'a [FacetRef]),
}

impl Scene {
    /// What elements of degree `more` above those of its fields lose of prescribed values, and of first values where a step
    /// depends on those before; of known fields, their own elements. At the last step.
    #[must_use]
    pub fn between_nodes(&self, window: Window, more: usize, with_starts: bool) -> Between {
        let mesh = &self.system.mesh;
        let mut out = Between { parts: vec![0.0; mesh.n_cells()], lost: 0.0 };
        for (field, facets, value) in self.prescribed.formulas() {
            let degree = self.system.fields[field].degree() + more;
            out.add(mesh, &At::Facets(facets), &value.at_step(window), degree);
        }
        let given = self.data.iter().map(|(field, given)| (*field, given, 0, window.stage));
        let first = self.steps.first();
        let starts = self.starts.iter().map(|(field, given)| (*field, given, more, first));
        for (field, given, more, time) in given.chain(starts.filter(|_| with_starts)) {
            let (field, Given::Formula(value, ..)) = (&self.system.fields[field], given) else { continue };
            let FieldSpace::Nodal(space) = &field.space else { continue };
            let value = &value.at_step(Window { stage: time, ..window });
            let degree = field.degree() + more;
            match space.support() {
                Support::Cells(cells) => out.add(mesh, &At::Cells(cells), value, degree),
                Support::Facets(facets) => out.add(mesh, &At::Facets(facets), value, degree),
                // a formula along edges has no points between nodes that it is compared at
                Support::Edges(_) => {}
            }
        }
        out
    }

    /// By name of known fields that are continuous what interpolation between their nodes loses of their formulas, in parts of the size
    /// of the values in the mean; at the first step.
    #[must_use]
    pub fn data_between_nodes(&self) -> Vec<(String, f64)> {
        let window = self.steps.first_window();
        let of = |(field, given): &(usize, Given)| {
            let (field, Given::Formula(value, ..)) = (&self.system.fields[*field], given) else { return None };
            let FieldSpace::Nodal(space) = &field.space else { return None };
            let at = match space.support() {
                Support::Cells(cells) => At::Cells(cells),
                Support::Facets(facets) => At::Facets(facets),
                Support::Edges(_) => return None,
            };
            if space.family() != Family::Continuous {
                return None;
            }
            let mut between = Between { parts: vec![0.0; self.system.mesh.n_cells()], lost: 0.0 };
            between.add(&self.system.mesh, &at, &value.at_step(window), field.degree());
            Some((field.name.clone(), between.lost))
        };
        self.data.iter().filter_map(of).collect()
    }
}

impl Between {
    fn add(&mut self, mesh: &Mesh, at: &At<'_>, value: &Value, degree: usize) {
        if !value.law.inputs.iter().any(|slot| matches!(slot, InputSlot::X(_))) {
            return;
        }
        let (n, dim) = match at {
            At::Cells(cells) => (cells.len(), mesh.dim()),
            At::Facets(facets) => (facets.len(), mesh.dim() - 1),
        };
        let n = parts(dim, n, 1);
        let mut shapes: Vec<(CellKind, usize, Option<Shape>)> = Vec::new();
        let (mut found, mut size) = (Vec::new(), 0.0);
        let entities: Vec<(CellId, Option<FacetRef>)> = match at {
            At::Cells(cells) => cells.iter().map(|c| (*c, None)).collect(),
            At::Facets(facets) => facets.iter().map(|f| (f.cell, Some(*f))).collect(),
        };
        for (cell, facet) in entities {
            let (kind, local) = (mesh.kind(cell), facet.map_or(usize::MAX, |f| f.local as usize));
            let known = shapes.iter().position(|s| s.0 == kind && s.1 == local);
            let known = known.unwrap_or_else(|| {
                shapes.push((kind, local, Shape::new(mesh, (kind, facet), degree, n)));
                shapes.len() - 1
            });
            let Some(shape) = &shapes[known].2 else { continue };
            // where there is no finite value the run itself says so with the place
            let Some([lost, all]) = shape.lost(mesh, cell, value) else { continue };
            let measure = mesh.cell_diameter(cell).powi(i32::try_from(dim).unwrap_or(1));
            found.push((cell, lost * measure));
            size += all * measure;
        }
        if size <= 0.0 {
            return;
        }
        self.lost = self.lost.max(found.iter().map(|f| f.1).sum::<f64>() / size);
        found.iter().for_each(|(cell, lost)| self.parts[cell.index()] += lost / size);
    }
}

/// What entities of one kind have in common.
struct Shape {
    /// Nodes of the element, those on the facet alone.
    nodes: Vec<usize>,
    weights: Vec<f64>,
    /// Values of the basis at the points, `[point][node]`.
    basis: Vec<f64>,
    /// The geometry at the nodes of the element, and at the points.
    at_nodes: wfl_mesh::element::Table,
    at_points: wfl_mesh::element::Table,
}

impl Shape {
    fn new(mesh: &Mesh, of: (CellKind, Option<FacetRef>), degree: usize, parts: usize) -> Option<Self> {
        let (kind, facet) = of;
        let highest = wfl_mesh::element::MAX_DEGREE;
        let element = Element::lagrange(kind, degree.clamp(1, highest), Family::Continuous).ok()?;
        let (points, weights, nodes) = match facet {
            None => {
                let rule = composite(kind, 1, parts).ok()?;
                (rule.points, rule.weights, (0..element.points().len()).collect::<Vec<usize>>())
            }
            Some(facet) => {
                let local = facet.local as usize;
                let rule = composite(kind.facets()[local].kind, 1, parts).ok()?;
                (facet_points(kind, local, &rule), rule.weights, element.facet_closure(local).to_vec())
            }
        };
        let table = element.tabulate(&points, 0);
        let n = table.n_dofs;
        let basis = (0..points.len()).flat_map(|p| nodes.iter().map(move |k| (p, *k)));
        let basis = basis.map(|(p, k)| table.values[p * n + k]).collect();
        let geometry = mesh.geometry_element(kind);
        let at = |points: &[[f64; 3]]| geometry.tabulate(points, 0);
        let own: Vec<[f64; 3]> = nodes.iter().map(|k| element.points()[*k]).collect();
        Some(Self { at_nodes: at(&own), at_points: at(&points), nodes, weights, basis })
    }

    /// The integrals of the size of the difference and of the values on the reference entity of a cell.
    fn lost(&self, mesh: &Mesh, cell: CellId, value: &Value) -> Option<[f64; 2]> {
        let places = |table: &wfl_mesh::element::Table, n: usize| -> Vec<[f64; 3]> {
            (0..n).map(|p| mesh.point_at(cell, table, p)).collect()
        };
        let given = value.at_positions(&places(&self.at_nodes, self.nodes.len())).ok()?;
        let there = value.at_positions(&places(&self.at_points, self.weights.len())).ok()?;
        let components = value.n_components();
        let (mut lost, mut size) = (0.0, 0.0);
        for (p, weight) in self.weights.iter().enumerate() {
            let row = &self.basis[p * self.nodes.len()..][..self.nodes.len()];
            for c in 0..components {
                let inside: f64 = iter::zip(row, given.iter().skip(c).step_by(components)).map(|(b, v)| b * v).sum();
                let is = there[p * components + c];
                lost += weight * (inside - is).abs();
                size += weight * is.abs();
            }
        }
        Some([lost, size])
    }
}
