//! The contract between compiled point laws and the runtime that calls them.
//!
//! The runtime is handed a `&dyn KernelBackend` and never knows whether machine code or the interpreter runs.

use thiserror::Error;

use crate::ir::VerifiedKernel;

/// A point law that can be called.
pub trait PointKernel: Send + Sync {
    /// Runs the law on `n_blocks` blocks of [`crate::ir::LANES`] points. Shapes: `uniforms` holds at least the
    /// kernel's uniforms; `inputs` at least `n_blocks * n_inputs * LANES` numbers, `outputs` at least
    /// `n_blocks * n_outputs * LANES`, both blocked as described in [`crate::ir`].
    ///
    /// # Panics
    /// If a slice is shorter than that.
    fn run(&self, uniforms: &[f64], inputs: &[f64], outputs: &mut [f64], n_blocks: usize);
}

/// What can go wrong when making machine code.
#[derive(Debug, Error)]
pub enum BackendError {
    /// This machine is not one the code generator knows.
    #[error("no machine code for this processor: {reason}")]
    UnsupportedMachine {
        /// The code generator's words.
        reason: String,
    },
    /// The code generator refused a kernel: a bug of this program.
    #[error("code generation failed for kernel {kernel}: {reason}")]
    Codegen {
        /// The kernel's name.
        kernel: String,
        /// The code generator's words.
        reason: String,
    },
}

/// Something that makes kernels callable.
pub trait KernelBackend: Sync {
    /// `"jit"` or `"interpreter"`.
    fn name(&self) -> &'static str;

    /// Makes all kernels callable, in order.
    ///
    /// # Errors
    /// [`BackendError`] when no code can be made.
    fn compile(&self, kernels: &[&VerifiedKernel]) -> Result<Vec<Box<dyn PointKernel>>, BackendError>;

    /// The generated code of one kernel as text, for `wfl show`; `None` where there is none.
    fn listing(&self, kernel: &VerifiedKernel) -> Option<String>;
}
