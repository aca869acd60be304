//! Code memory and the symbols that machine code calls.
//!
//! All kernels of one `compile` stand in one Cranelift module, owned by a [`CodeMemory`]. Its memory is given back
//! when the last kernel that holds it is dropped. [`Shim`]s are C entries to the functions of `wfl_compiler`, so
//! that machine code and interpreter run the same mathematics.

use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use cranelift_codegen::{
    CodegenError, Context,
    control::ControlPlane,
    ir::{self, AbiParam, types},
    isa::TargetIsa,
};
use cranelift_frontend::FunctionBuilderContext;
use cranelift_jit::{JITBuilder, JITModule};
use cranelift_module::{FuncId, Linkage, Module, ModuleError, ModuleReloc, default_libcall_names};
use wfl_compiler::{MathFn1, MathFn2, MatrixFn, backend::BackendError, ir::VerifiedKernel};

use crate::{Target, emit};

/// A function outside the kernel that machine code calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Shim {
    One(MathFn1),
    Two(MathFn2),
    Matrix(MatrixFn),
}

impl Shim {
    fn all() -> impl Iterator<Item = Shim> {
        let one = MathFn1::ALL.into_iter().map(Shim::One);
        one.chain(MathFn2::ALL.into_iter().map(Shim::Two)).chain(MatrixFn::ALL.into_iter().map(Shim::Matrix))
    }

    /// The name in listings.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Shim::One(f) => f.name(),
            Shim::Two(f) => f.name(),
            Shim::Matrix(f) => f.name(),
        }
    }

    /// The link name: a prefix keeps it apart from the C library.
    fn symbol(self) -> String {
        format!("wfl_{}", self.name())
    }

    /// Numbers to a number; a matrix function takes rows, lanes, entries and results, see [`run_matrix`].
    pub(crate) fn signature(self, isa: &dyn TargetIsa) -> ir::Signature {
        let mut signature = ir::Signature::new(isa.default_call_conv());
        let number = AbiParam::new(types::F64);
        let pointer = AbiParam::new(isa.pointer_type());
        match self {
            Shim::One(_) => signature.params.push(number),
            Shim::Two(_) => signature.params.extend([number; 2]),
            Shim::Matrix(_) => signature.params.extend([pointer; 4]),
        }
        if !matches!(self, Shim::Matrix(_)) {
            signature.returns.push(number);
        }
        signature
    }

    fn address(self) -> *const u8 {
        match self {
            Shim::One(f) => address1(f),
            Shim::Two(f) => address2(f),
            Shim::Matrix(f) => address_matrix(f),
        }
    }
}

/// A `match` over all variants of an enum; each arm defines the C function of its variant and gives its address.
macro_rules! shims {
    ($value:expr, $kind:ident: $($variant:ident)*, |$function:ident| $item:item) => {
        match $value {
            $($kind::$variant => {
                const $function: $kind = $kind::$variant;
                $item
                shim as *const u8
            })*
        }
    };
}

macro_rules! address_of_rows {
    ($($kind:ident $variant:ident $name:literal $doc:literal [$($sample:literal),*] $form:ident($($value:tt)*);)*) => {
        fn address1(f: MathFn1) -> *const u8 {
            shims!(f, MathFn1: $($variant)*, |FUNCTION| extern "C" fn shim(t: f64) -> f64 { FUNCTION.eval(t) })
        }
    };
}

wfl_compiler::scalar_functions!(address_of_rows);

#[rustfmt::skip]
fn address2(f: MathFn2) -> *const u8 {
    shims!(f, MathFn2: Pow Atan2, |FUNCTION| extern "C" fn shim(t: f64, u: f64) -> f64 { FUNCTION.eval(t, u) })
}

fn address_matrix(f: MatrixFn) -> *const u8 {
    shims!(f, MatrixFn: Expm ExpmDerivative Logm LogmDerivative, |FUNCTION| unsafe extern "C" fn shim(
        n: usize,
        lanes: usize,
        entries: *const f64,
        results: *mut f64,
    ) {
        // SAFETY: machine code passes stack slots that `emit.rs` has made as large as `run_matrix` asks for.
        unsafe { run_matrix(FUNCTION, n, lanes, entries, results) }
    })
}

/// A matrix function for each of `lanes` points: number k of lane l stands at `k * lanes + l`.
///
/// # Safety
/// `entries` is valid for reading `n * n * lanes` numbers, `results` for writing `function.n_results(n) * lanes`.
unsafe fn run_matrix(function: MatrixFn, n: usize, lanes: usize, entries: *const f64, results: *mut f64) {
    let (n_entries, n_results) = (n * n, function.n_results(n));
    let (mut matrix, mut values) = ([0.0; 9], [0.0; 81]);
    for lane in 0..lanes {
        for (k, x) in matrix[..n_entries].iter_mut().enumerate() {
            // SAFETY: k * lanes + lane < n * n * lanes, which the caller has made readable.
            *x = unsafe { entries.add(k * lanes + lane).read() };
        }
        function.eval(n, &matrix[..n_entries], &mut values[..n_results]);
        for (k, x) in values[..n_results].iter().enumerate() {
            // SAFETY: k * lanes + lane < n_results * lanes, which the caller has made writable.
            unsafe { results.add(k * lanes + lane).write(*x) };
        }
    }
}

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
