//! Point laws alone, as assembly runs them: the tangents of the nine cases, in machine code and in the interpreter.
//!
//! `cargo bench -p wfl-run --bench kernels`; throughput is in points of the quadrature rule. Laws whose entries are
//! the same at all points need no kernel and do not appear. The time to make machine code is measured beside.

#[expect(dead_code, reason = "assembly is measured elsewhere")]
#[path = "assembly/cases.rs"]
mod cases;
#[path = "common/scene.rs"]
mod common;

use std::{io::Write as _, process::ExitCode};

use criterion::{BenchmarkId, Criterion, Throughput};
use wfl_compiler::{
    InterpreterBackend,
    backend::KernelBackend,
    ir::{LANES, VerifiedKernel},
};
use wfl_discrete::assemble::tangent_kernel;
use wfl_jit::JitBackend;

use cases::{CASES, Problem};

/// Blocks of points in one call: more than assembly has, few enough to stay in the nearest cache.
const BLOCKS: usize = 16;

fn main() -> ExitCode {
    match measure() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            let _ = writeln!(std::io::stderr(), "error: {e}");
            ExitCode::FAILURE
        }
    }
}

fn measure() -> Result<(), String> {
    let jit = JitBackend::new().map_err(|e| e.to_string())?;
    let mut criterion = Criterion::default().configure_from_args();
    for case in &CASES {
        let problem = Problem::new(case)?;
        let Some(kernel) = tangent_kernel(problem.law()) else { continue };
        let mut group = criterion.benchmark_group(case.name);
        group.bench_function("to machine code", |b| b.iter(|| jit.compile(&[&kernel]).map(|list| list.len())));
        group.throughput(Throughput::Elements((BLOCKS * LANES) as u64));
        for backend in [&jit as &dyn KernelBackend, &InterpreterBackend] {
            run(&mut group, backend, &kernel)?;
        }
        group.finish();
    }
    criterion.final_summary();
    Ok(())
}

fn run(
    group: &mut criterion::BenchmarkGroup<'_, criterion::measurement::WallTime>,
    backend: &dyn KernelBackend,
    kernel: &VerifiedKernel,
) -> Result<(), String> {
    let callable = backend.compile(&[kernel]).map_err(|e| e.to_string())?.pop().ok_or("no kernel")?;
    let shape = kernel.kernel();
    // small gradients, so that logarithms of determinants exist
    let inputs: Vec<f64> = (0..BLOCKS * shape.n_inputs * LANES).map(|k| 1e-3 * (k % 7) as f64).collect();
    let mut outputs = vec![0.0; BLOCKS * shape.outputs.len() * LANES];
    let uniforms = vec![1.0; shape.n_uniforms];
    group.bench_function(BenchmarkId::new("points", backend.name()), |b| {
        b.iter(|| callable.run(&uniforms, &inputs, &mut outputs, BLOCKS));
    });
    Ok(())
}
