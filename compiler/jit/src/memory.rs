//! Code memory: all kernels of one `compile` stand in one Cranelift module, owned by a [`CodeMemory`]. Its memory is
//! given back when the last kernel that holds it is dropped.

use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use cranelift_codegen::{CodegenError, Context, control::ControlPlane, ir};
use cranelift_frontend::FunctionBuilderContext;
use cranelift_jit::{JITBuilder, JITModule};
use cranelift_module::{FuncId, Linkage, Module, ModuleError, ModuleReloc, default_libcall_names};
use wfl_compiler::{backend::BackendError, ir::VerifiedKernel};

use crate::{emit, shim::Shim, target::Target};

/// Finished code of several kernels; freed on drop.
pub(crate) struct CodeMemory {
    /// In a mutex because a module may be sent to another thread but not looked at from two; only `drop` does.
    module: Mutex<Option<JITModule>>,
}

impl CodeMemory {
    /// Makes the code of all kernels: its owner, and the entry of each kernel in order. The entries are good as long
    /// as the owner lives.
    ///
    /// # Errors
    /// [`BackendError::Codegen`] when the code generator refuses a kernel.
    pub(crate) fn build(
        target: &Target,
        kernels: &[&VerifiedKernel],
    ) -> Result<(Arc<CodeMemory>, Vec<*const u8>), BackendError> {
        let mut builder = JITBuilder::with_isa(target.isa.clone(), default_libcall_names());
        for shim in Shim::all() {
            builder.symbol(shim.symbol(), shim.address());
        }
        let mut module = JITModule::new(builder);
        let entries = define_all(&mut module, target, kernels);
        // On error as well: the drop of the owner frees what has been made.
        let memory = CodeMemory { module: Mutex::new(Some(module)) };
        Ok((Arc::new(memory), entries?))
    }
}

impl Drop for CodeMemory {
    fn drop(&mut self) {
        if let Some(module) = self.module.get_mut().unwrap_or_else(PoisonError::into_inner).take() {
            // SAFETY: entries are called through kernels only (`call.rs`); each holds this owner by an `Arc`, so none
            // is left and none is running.
            unsafe { module.free_memory() };
        }
    }
}

fn define_all(
    module: &mut JITModule,
    target: &Target,
    kernels: &[&VerifiedKernel],
) -> Result<Vec<*const u8>, BackendError> {
    let all = |e: ModuleError| codegen_error("(all)", &e);
    let mut imports = BTreeMap::new();
    for shim in kernels.iter().flat_map(|k| emit::shims_of(k)) {
        let signature = shim.signature(&*target.isa);
        imports.insert(shim, module.declare_function(&shim.symbol(), Linkage::Import, &signature).map_err(all)?);
    }
    let signature = emit::signature(&*target.isa);
    let declare = |idx| module.declare_function(&format!("kernel_{idx}"), Linkage::Local, &signature).map_err(all);
    let functions = (0..kernels.len()).map(declare).collect::<Result<Vec<FuncId>, _>>()?;
    for ((kernel, code), id) in kernels.iter().zip(generate_all(target, kernels, &imports)).zip(&functions) {
        let error = |e: ModuleError| codegen_error(&kernel.kernel().name, &e);
        let code = code.map_err(|e| error(e.into()))?;
        module.define_function_bytes(*id, code.alignment, &code.bytes, &code.relocations).map_err(error)?;
    }
    module.finalize_definitions().map_err(all)?;
    Ok(functions.into_iter().map(|f| module.get_finalized_function(f)).collect())
}

fn codegen_error(kernel: &str, e: &ModuleError) -> BackendError {
    BackendError::Codegen { kernel: kernel.to_owned(), reason: e.to_string() }
}

/// Code of one kernel before it has a place.
struct Code {
    bytes: Vec<u8>,
    alignment: u64,
    relocations: Vec<ModuleReloc>,
}

/// With fewer instructions than this in all, starting threads costs more than it saves.
const PARALLEL_FROM: usize = 400;

/// Generates code for all kernels, in parallel: the code of one does not depend on the others.
fn generate_all(
    target: &Target,
    kernels: &[&VerifiedKernel],
    imports: &BTreeMap<Shim, FuncId>,
) -> Vec<Result<Code, CodegenError>> {
    let n_insts: usize = kernels.iter().map(|k| k.kernel().insts.len()).sum();
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from).min(kernels.len());
    let n_threads = if n_insts < PARALLEL_FROM { 1 } else { n_threads.max(1) };
    let next = AtomicUsize::new(0);
    let work = || {
        let (mut context, mut builder_context) = (Context::new(), FunctionBuilderContext::new());
        let mut done = Vec::new();
        loop {
            let idx = next.fetch_add(1, Ordering::Relaxed);
            let Some(kernel) = kernels.get(idx) else { return done };
            done.push((idx, generate(target, kernel, imports, &mut context, &mut builder_context)));
        }
    };
    let mut codes = std::thread::scope(|scope| {
        let others: Vec<_> = (1..n_threads).map(|_| scope.spawn(work)).collect();
        let mut codes = work();
        for other in others {
            codes.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        codes
    });
    codes.sort_unstable_by_key(|(idx, _)| *idx);
    codes.into_iter().map(|(_, code)| code).collect()
}

fn generate(
    target: &Target,
    kernel: &VerifiedKernel,
    imports: &BTreeMap<Shim, FuncId>,
    context: &mut Context,
    builder_context: &mut FunctionBuilderContext,
) -> Result<Code, CodegenError> {
    let isa = target.isa_for(kernel);
    context.clear();
    context.func.signature = emit::signature(isa);
    let mut import = |function: &mut ir::Function, shim: Shim| {
        let name = ir::UserExternalName { namespace: 0, index: imports[&shim].as_u32() };
        let name = ir::ExternalName::user(function.declare_imported_user_function(name));
        let signature = function.import_signature(shim.signature(isa));
        function.import_function(ir::ExtFuncData { name, signature, colocated: false, patchable: false })
    };
    emit::emit(kernel, target.width, isa, &mut context.func, builder_context, &mut import);
    let compiled = context.compile(isa, &mut ControlPlane::default()).map_err(|e| e.inner)?;
    let (bytes, alignment) = (compiled.buffer.data().to_vec(), u64::from(compiled.buffer.alignment));
    let compiled = context.compiled_code().expect("the line before has compiled it");
    // Relocations name imports only; the id would stand for the function itself, which is not recursive.
    let itself = FuncId::from_u32(0);
    let relocations = compiled.buffer.relocs().iter();
    let relocations = relocations.map(|r| ModuleReloc::from_mach_reloc(r, &context.func, itself)).collect();
    Ok(Code { bytes, alignment, relocations })
}
