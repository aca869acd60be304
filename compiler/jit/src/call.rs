//! Calls machine code: the one place where it is entered.
//!
//! Why this is sound:
//! 1. Every offset in the code is a constant made by `emit.rs` from a slot number: slot `s` of a block is read or
//!    written at `s * LANES + lane`, `lane < LANES`, uniforms at their slot. `verify.rs` has checked each slot against
//!    `n_inputs`, `n_uniforms` and the number of outputs of the same kernel; only a [`VerifiedKernel`] gets here.
//! 2. The loop runs over exactly `n_blocks` blocks, each `n_inputs * LANES` (`n_outputs * LANES`) numbers long.
//!    Before each call the slices are checked to hold as much; products are checked for overflow.
//! 3. Loads and stores ask for no alignment beyond that of f64, which slices have.
//! 4. The code writes through `outputs`, which is borrowed mutably, and to its own stack frame, nowhere else; it keeps
//!    no pointer. A frame larger than a page is probed page by page, so that running out of stack meets the guard;
//!    matrix functions write into stack slots of their size.
//! 5. The functions it calls are the shims of `shim.rs`, with the signatures declared there; they do not unwind.
//! 6. The memory that holds the code is owned by a [`CodeMemory`], which each kernel keeps alive by an `Arc`.
//! 7. Code is never written again after it was finished, so that calls from several threads do not disturb each other.
//! 8. Addresses of curves in the code are those of the instructions of the kernel; [`MachineKernel`] holds a reference to
//!    each, and a curve is never changed.

use std::sync::Arc;

use wfl_compiler::{
    backend::{BackendError, PointKernel},
    ir::{Inst, LANES, VerifiedKernel},
    lookup::CurveRef,
};

use crate::{memory::CodeMemory, target::Target};

/// `(uniforms, inputs, outputs, n_blocks)`, the signature of `emit::signature`.
type Entry = unsafe extern "C" fn(*const f64, *const f64, *mut f64, usize);

/// A kernel as machine code.
struct MachineKernel {
    entry: Entry,
    n_uniforms: usize,
    /// Numbers per block.
    input_stride: usize,
    output_stride: usize,
    /// Keeps the tables alive whose addresses the code passes to the shims; see 8.
    _curves: Vec<CurveRef>,
    /// Keeps the code alive; see 6.
    _memory: Arc<CodeMemory>,
}

/// Makes code for `kernels` and wraps each for calling.
///
/// # Errors
/// [`BackendError::Codegen`] when the code generator refuses a kernel.
pub(crate) fn compile(target: &Target, kernels: &[&VerifiedKernel]) -> Result<Vec<Box<dyn PointKernel>>, BackendError> {
    let (memory, entries) = CodeMemory::build(target, kernels)?;
    let one = |(kernel, address): (&&VerifiedKernel, *const u8)| {
        let kernel = kernel.kernel();
        // SAFETY: the address is the start of a finished function that `emit.rs` has given the signature of `Entry`
        // in the default calling convention of this machine, which is that of `extern "C"`; it is never null.
        let entry = unsafe { std::mem::transmute::<*const u8, Entry>(address) };
        Box::new(MachineKernel {
            entry,
            n_uniforms: kernel.n_uniforms,
            input_stride: kernel.n_inputs * LANES,
            output_stride: kernel.outputs.len() * LANES,
            _curves: kernel.insts.iter().filter_map(curve_of).collect(),
            _memory: Arc::clone(&memory),
        }) as Box<dyn PointKernel>
    };
    Ok(kernels.iter().zip(entries).map(one).collect())
}

fn curve_of(inst: &Inst) -> Option<CurveRef> {
    match inst {
        Inst::Lookup(curve, ..) => Some(curve.clone()),
        _ => None,
    }
}

impl PointKernel for MachineKernel {
    fn run(&self, uniforms: &[f64], inputs: &[f64], outputs: &mut [f64], n_blocks: usize) {
        let holds = |len: usize, stride: usize| n_blocks.checked_mul(stride).is_some_and(|needed| needed <= len);
        assert!(uniforms.len() >= self.n_uniforms, "{} uniforms, {} needed", uniforms.len(), self.n_uniforms);
        assert!(holds(inputs.len(), self.input_stride), "inputs are too short for {n_blocks} blocks");
        assert!(holds(outputs.len(), self.output_stride), "outputs are too short for {n_blocks} blocks");
        // SAFETY: the three slices are as long as points 1 and 2 at the top of this file ask for, just checked.
        // `outputs` is borrowed mutably, so it overlaps nothing; the code is alive by `_memory`.
        unsafe { (self.entry)(uniforms.as_ptr(), inputs.as_ptr(), outputs.as_mut_ptr(), n_blocks) }
    }
}
