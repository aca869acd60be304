//! What cancels in the equations of single numbers: the summands of a term, integrated with the magnitudes of its test
//! functions.

use wfl_compiler::{
    InterpreterBackend, TermLaw,
    backend::{KernelBackend, PointKernel},
    ir::LANES,
};

use super::AssembledTerm;
use crate::assemble::{
    binding::{Binding, Needs},
    entries::inputs_behind,
    evaluate::FieldValues,
    shared::{add, shared},
    simd::{Lanes, ZERO},
};
use crate::share::Share;
use wfl_mesh::mesh::Mesh;
use wfl_sparse::index::NONE;

/// The kernel that gives the summands, and what it reads.
pub(super) struct Summands {
    kernel: Box<dyn PointKernel>,
    needs: Needs,
}

impl Summands {
    /// `None` for a law without them. They are interpreted: the same bits as from machine code, and most of their time is
    /// in mathematical functions.
    pub(super) fn new(law: &TermLaw, binding: &Binding, n_bases: usize) -> Option<Self> {
        let verified = law.summands.as_ref()?;
        let kernel = InterpreterBackend.compile(&[verified]).ok()?.pop()?;
        let read = inputs_behind(verified.kernel(), &verified.kernel().outputs);
        Some(Self { kernel, needs: binding.needs_of(n_bases, |k| read[k], true, false) })
    }
}

impl AssembledTerm {
    /// Adds the sizes of the summands to `out`, by dof, in the rows of this rank. Nothing for a law that has none.
    pub fn add_own_summands(&self, mesh: &Mesh, values: FieldValues<'_>, out: &mut [f64], share: Option<&Share>) {
        let Some(Summands { kernel, needs }) = self.summands.as_deref() else { return };
        if let Some(moved) = self.moved(mesh, values) {
            return moved.add_own_summands(mesh, values, out, share);
        }
        let binding = &self.assembled.binding;
        let n_out = binding.tests.len();
        let out = shared(out);
        self.share_out(mesh, share, |workspace, duties, owns| {
            for duty in duties {
                let (g, group) = (duty.group, &binding.groups[duty.group]);
                workspace.prepare_some(self.bound(mesh), g, duty.batch, values, needs);
                self.call(&**kernel, workspace, g, n_out);
                let mut local: Vec<Lanes> = vec![ZERO; group.n_dofs()];
                for (q, weight) in workspace.weights.iter().enumerate() {
                    for (t, place) in binding.tests.iter().enumerate() {
                        let basis = &group.bases[place.basis];
                        let functions = basis.operand(place.op, place.direction, false);
                        let functions = functions.at(&group.values, &workspace.derivatives, q);
                        let sizes = &workspace.outputs[(q * n_out + t) * LANES..][..LANES];
                        let slots = local[basis.offset..][..basis.n_dofs()].chunks_exact_mut(basis.n_components);
                        for (slots, function) in slots.zip(functions) {
                            for lane in 0..LANES {
                                slots[place.component][lane] += (weight[lane] * function[lane]).abs() * sizes[lane];
                            }
                        }
                    }
                }
                let n = group.n_dofs();
                for (lane, entity) in self.entities(duty).enumerate() {
                    for (dof, value) in self.dofs[g][entity * n..][..n].iter().zip(&local) {
                        if *dof != NONE && (duty.all_rows || owns(*dof)) {
                            add(&out[*dof as usize], value[lane]);
                        }
                    }
                }
            }
        });
    }
}
