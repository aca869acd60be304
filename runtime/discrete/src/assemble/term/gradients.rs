//! What a term on cells says of gradients: its fluxes at a gradient that is asked for, and the determinants of Id + Grad_u
//! at its points. For checks of states.

use rayon::prelude::*;

use super::AssembledTerm;
use crate::assemble::{
    binding::Needs,
    evaluate::{FieldValues, Workspace},
};
use crate::domain::Group;
use wfl_compiler::{
    interpret,
    ir::LANES,
    types::{FieldOp, InputSlot, Side},
};
use wfl_mesh::mesh::{CellId, Mesh};

/// The gradient of a vector field of the space, or a flux against that of its test function: row by row, `[i][j]` the
/// derivative of component i in direction j; the third row and column are 0 in the plane.
pub type Gradient = [[f64; 3]; 3];

/// Cells in which the determinant of Id + Grad_u is not positive at a point of a rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NegativeVolumes {
    /// How many.
    pub n_cells: usize,
    /// The cells of the term that this rank has.
    pub of: usize,
    /// The smallest determinant.
    pub smallest: f64,
    /// Where.
    pub position: [f64; 3],
}

/// Where the smallest determinant of some entities is.
#[derive(Clone, Copy)]
struct Found {
    determinant: f64,
    n_cells: usize,
    group: usize,
    entity: usize,
    q: usize,
}

impl AssembledTerm {
    /// The positions of the gradient of a vector field of the space among the inputs, `[i][j]`; `None` unless the law reads
    /// all of it.
    fn gradient_inputs(&self, dim: usize, field: usize) -> Option<[[usize; 3]; 3]> {
        let mut places = [[0; 3]; 3];
        for i in 0..dim {
            for j in 0..dim {
                let is_it = |slot: &InputSlot| match slot {
                    InputSlot::Field(b) => {
                        b.field.index() == field
                            && b.op == FieldOp::Grad
                            && b.side == Side::Here
                            && usize::from(b.entry) == i + dim * j
                    }
                    _ => false,
                };
                places[i][j] = self.law.inputs.iter().position(is_it)?;
            }
        }
        Some(places)
    }

    /// The flux against the gradient of the test function of a vector field, at the first point of a cell, if the gradient of
    /// the field were `gradient` there and all else as it is. `None` where the term does not act, or does not read all of
    /// the gradient.
    #[must_use]
    pub fn flux_at_gradient(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        cell: CellId,
        field: usize,
        gradients: &[Gradient],
    ) -> Option<Vec<Gradient>> {
        let dim = self.integrator.domain.dim;
        let places = self.gradient_inputs(dim, field)?;
        let place = |(g, group): (usize, &Group)| group.here.cells.iter().position(|c| *c == cell).map(|e| (g, e));
        let (g, entity) = self.integrator.domain.groups.iter().enumerate().find_map(place)?;
        let (mut workspace, n_in) = (Workspace::default(), self.integrator.binding.inputs.len());
        workspace.prepare(self.bound(mesh), g, entity / LANES, values);
        let mut inputs: Vec<f64> = (0..n_in).map(|s| workspace.inputs[s * LANES + entity % LANES]).collect();
        let mut out = vec![0.0; self.law.residual.kernel().outputs.len()];
        let mut fluxes = Vec::with_capacity(gradients.len());
        for gradient in gradients {
            for (row, places) in gradient.iter().zip(&places).take(dim) {
                row.iter().zip(places).take(dim).for_each(|(value, place)| inputs[*place] = *value);
            }
            interpret(&self.law.residual, &self.uniforms, &inputs, &mut Vec::new(), &mut out);
            let mut flux = [[0.0; 3]; 3];
            for (slot, value) in self.law.tests.iter().zip(&out) {
                if slot.field.index() == field && slot.op == FieldOp::Grad && slot.side == Side::Here {
                    flux[usize::from(slot.entry) % dim][usize::from(slot.entry) / dim] = *value;
                }
            }
            fluxes.push(flux);
        }
        Some(fluxes)
    }

    /// The cells in which Id + Grad_u of a vector field of the space has no positive determinant at a point of the rule, of
    /// those that this rank counts. `None` if there is no such cell, or if the law does not read all of the gradient.
    #[must_use]
    pub fn negative_volumes(&self, mesh: &Mesh, values: FieldValues<'_>, field: usize) -> Option<NegativeVolumes> {
        let (domain, binding) = (&self.integrator.domain, &self.integrator.binding);
        let places = self.gradient_inputs(domain.dim, field)?;
        let wanted: Vec<usize> = places[..domain.dim].iter().flat_map(|row| &row[..domain.dim]).copied().collect();
        let n_bases = binding.n_bases();
        let needs = binding.needs_of(n_bases, |k| wanted.contains(&k), false, false);
        let mut found: Vec<Found> = Vec::new();
        for (g, group) in domain.groups.iter().enumerate() {
            let batches = (0..group.n_batches()).into_par_iter();
            let of_batch = |workspace: &mut Workspace, batch| {
                self.negative_in_batch(mesh, values, workspace, &Batch { g, batch, places: &places, needs: &needs })
            };
            found.par_extend(batches.map_init(Workspace::default, of_batch).flatten());
        }
        let worst = found.iter().copied().reduce(|a, b| if b.determinant < a.determinant { b } else { a })?;
        let here = &domain.groups[worst.group].here;
        Some(NegativeVolumes {
            n_cells: found.iter().map(|f| f.n_cells).sum(),
            of: domain.n_entities,
            smallest: worst.determinant,
            position: mesh.point_at(here.cells[worst.entity], &here.geometry, worst.q),
        })
    }

    fn negative_in_batch(
        &self,
        mesh: &Mesh,
        values: FieldValues<'_>,
        workspace: &mut Workspace,
        at: &Batch<'_>,
    ) -> Option<Found> {
        let group = &self.integrator.domain.groups[at.g];
        let (dim, n_in) = (self.integrator.domain.dim, self.integrator.binding.inputs.len());
        workspace.prepare_some(self.bound(mesh), at.g, at.batch, values, at.needs);
        let mut smallest: [(f64, usize); LANES] = [(f64::INFINITY, 0); LANES];
        for (q, inputs) in workspace.inputs.as_chunks::<LANES>().0.chunks_exact(n_in).take(group.n_points()).enumerate()
        {
            for (lane, determinant) in determinants(dim, inputs, at.places).iter().enumerate() {
                if *determinant < smallest[lane].0 {
                    smallest[lane] = (*determinant, q);
                }
            }
        }
        let own = LANES.min(group.entities.len() - at.batch * LANES);
        let negative = smallest[..own].iter().enumerate().filter(|(_, (d, _))| *d <= 0.0);
        let counted = negative.filter(|(lane, _)| group.is_counted(mesh, at.batch * LANES + lane));
        let found = counted.map(|(lane, (determinant, q))| Found {
            determinant: *determinant,
            n_cells: 1,
            group: at.g,
            entity: at.batch * LANES + lane,
            q: *q,
        });
        found.reduce(|a, b| Found { n_cells: a.n_cells + 1, ..if b.determinant < a.determinant { b } else { a } })
    }
}

/// Some entities of a group, and what is read of them.
struct Batch<'a> {
    g: usize,
    batch: usize,
    places: &'a [[usize; 3]; 3],
    needs: &'a Needs,
}

/// det(Id + G) of all lanes.
fn determinants(dim: usize, inputs: &[[f64; LANES]], places: &[[usize; 3]; 3]) -> [f64; LANES] {
    std::array::from_fn(|lane| {
        let f = |i: usize, j: usize| inputs[places[i][j]][lane] + if i == j { 1.0 } else { 0.0 };
        match dim {
            1 => f(0, 0),
            2 => f(0, 0) * f(1, 1) - f(0, 1) * f(1, 0),
            _ => {
                f(0, 0) * (f(1, 1) * f(2, 2) - f(1, 2) * f(2, 1)) - f(0, 1) * (f(1, 0) * f(2, 2) - f(1, 2) * f(2, 0))
                    + f(0, 2) * (f(1, 0) * f(2, 1) - f(1, 1) * f(2, 0))
            }
        }
    })
}
