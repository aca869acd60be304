//! The processor that code is made for, and the settings of the code generator.

use cranelift_codegen::{
    isa::{OwnedTargetIsa, TargetIsa},
    settings::{self, Configurable},
};
use wfl_compiler::{backend::BackendError, ir::VerifiedKernel};

use crate::emit::{Width, is_supported};

/// The processor and how code is made for it.
pub(crate) struct Target {
    pub(crate) isa: OwnedTargetIsa,
    /// For kernels of more than [`LARGE_KERNEL`] instructions.
    pub(crate) isa_large: OwnedTargetIsa,
    pub(crate) width: Width,
}

impl Target {
    pub(crate) fn host() -> Result<Self, BackendError> {
        let isa = host_isa(&[])?;
        let isa_large = host_isa(&[("regalloc_algorithm", "single_pass")])?;
        let width = if is_supported(&*isa, Width::Pair) { Width::Pair } else { Width::One };
        Ok(Self { isa, isa_large, width })
    }

    pub(crate) fn isa_for(&self, kernel: &VerifiedKernel) -> &dyn TargetIsa {
        if kernel.kernel().insts.len() > LARGE_KERNEL { &*self.isa_large } else { &*self.isa }
    }
}

impl std::fmt::Debug for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Target").field("isa", &self.isa.triple().to_string()).field("width", &self.width).finish()
    }
}

/// Beyond this, registers are given out in one pass: the time of the careful method grows faster than the kernel.
const LARGE_KERNEL: usize = 10_000;

/// Chosen by measurement on one core of an AMD EPYC (tangled random laws without calls, and a neo-Hookean law with its
/// tangent, 500 instructions; milliseconds to compile, nanoseconds per point to run):
///
/// | instructions | none | speed | none, single pass |
/// |---|---|---|---|
/// | 50 | 0.12 ms, 1.4 ns | 0.16 ms, 1.0 ns | 0.09 ms, 2.4 ns |
/// | 500 | 0.70 ms, 15 ns | 0.96 ms, 15 ns | 0.27 ms, 24 ns |
/// | 500, neo-Hookean | 0.68 ms, 32 ns | 0.93 ms, 28 ns | 0.30 ms, 38 ns |
/// | 3000 | 9.3 ms, 185 ns | 10.5 ms, 175 ns | 1.5 ms, 316 ns |
///
/// What the optimiser could gain, a good order of instructions, `emit.rs` gives already (without that order: 375 ns
/// in the last row).
const SETTINGS: [(&str, &str); 8] = [
    ("opt_level", "none"),
    ("regalloc_algorithm", "backtracking"),
    ("is_pic", "false"),
    ("use_colocated_libcalls", "false"),
    ("unwind_info", "false"),
    // Frames with many matrix functions or spilled values exceed a page: touch each, so that none is jumped over.
    ("enable_probestack", "true"),
    ("probestack_strategy", "inline"),
    ("enable_verifier", if cfg!(debug_assertions) { "true" } else { "false" }),
];

/// This processor with [`SETTINGS`], changed by `wanted`.
pub(crate) fn host_isa(wanted: &[(&str, &str)]) -> Result<OwnedTargetIsa, BackendError> {
    let unsupported = |reason: String| BackendError::UnsupportedMachine { reason };
    let mut flags = settings::builder();
    for (name, value) in SETTINGS.iter().chain(wanted) {
        flags.set(name, value).map_err(|e| unsupported(e.to_string()))?;
    }
    let builder = cranelift_native::builder().map_err(|e| unsupported(e.to_owned()))?;
    builder.finish(settings::Flags::new(flags)).map_err(|e| unsupported(e.to_string()))
}
