//! Verified point kernels to machine code, by Cranelift: the only crate with unsafe code.
//!
//! [`JitBackend`] makes one function per kernel, a loop over blocks of points that works on two lanes at a time.
//! Promises: the bits of the interpreter (signs and payloads of NaN excepted), on every machine; code memory lives
//! as long as one of its kernels and is given back after the last.
//! It does not optimise the law: that is done before, on the tensor graph, where it can be checked.

mod call;
mod emit;
mod memory;
mod shim;
mod target;
#[cfg(test)]
mod tests;

use cranelift_codegen::ir::{self, ExtFuncData, ExternalName};
use cranelift_frontend::FunctionBuilderContext;
use wfl_compiler::{
    backend::{BackendError, KernelBackend, PointKernel},
    ir::VerifiedKernel,
};

use target::Target;

/// Makes machine code for the processor it runs on.
#[derive(Debug)]
pub struct JitBackend {
    target: Target,
}

impl JitBackend {
    /// A backend for this processor, with vectors of two lanes where the code generator has them.
    ///
    /// # Errors
    /// [`BackendError::UnsupportedMachine`] when the code generator does not know the processor.
    pub fn new() -> Result<Self, BackendError> {
        Ok(Self { target: Target::host()? })
    }
}

impl KernelBackend for JitBackend {
    fn name(&self) -> &'static str {
        "jit"
    }

    fn compile(&self, kernels: &[&VerifiedKernel]) -> Result<Vec<Box<dyn PointKernel>>, BackendError> {
        call::compile(&self.target, kernels)
    }

    fn listing(&self, kernel: &VerifiedKernel) -> Option<String> {
        let isa = self.target.isa_for(kernel);
        let mut function = ir::Function::with_name_signature(
            ir::UserFuncName::testcase(kernel.kernel().name.as_bytes()),
            emit::signature(isa),
        );
        let mut import = |function: &mut ir::Function, shim: shim::Shim| {
            let signature = function.import_signature(shim.signature(isa));
            let name = ExternalName::testcase(shim.name().as_bytes());
            function.import_function(ExtFuncData { name, signature, colocated: false, patchable: false })
        };
        emit::emit(kernel, self.target.width, isa, &mut function, &mut FunctionBuilderContext::new(), &mut import);
        Some(function.display().to_string())
    }
}
