//! The conformance corpus: what GetFEM assembled, assembled here on both backends.

use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_jit::JitBackend;
use wfl_runtime::corpus::{CorpusReport, run_corpus};

fn run(text: &str, backend: &dyn KernelBackend) -> CorpusReport {
    run_corpus(text, backend).expect("a corpus")
}

fn open() -> String {
    std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/reference/gwfl_corpus_open.json"))
        .expect("the corpus")
}

fn all_pass(backend: &dyn KernelBackend) {
    let report = run(&open(), backend);
    assert_eq!(report.cases.len(), 133);
    let failures: Vec<String> = report.failures().map(ToString::to_string).collect();
    assert!(failures.is_empty(), "{} failures\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn every_open_case_passes_in_the_interpreter() {
    all_pass(&InterpreterBackend);
}

#[test]
fn every_open_case_passes_in_machine_code() {
    all_pass(&JitBackend::new().expect("machine code"));
}
