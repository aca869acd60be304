//! The conformance corpus: what GetFEM assembled, assembled here on both backends.

use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_jit::JitBackend;
use wfl_runtime::corpus::{CorpusReport, run_corpus};

fn run(text: &str, backend: &dyn KernelBackend) -> CorpusReport {
    run_corpus(text, backend).expect("a corpus")
}

fn read(name: &str) -> String {
    std::fs::read_to_string(format!("{}/reference/{name}.json", env!("CARGO_MANIFEST_DIR"))).expect("the corpus")
}

fn all_pass(name: &str, cases: usize, backend: &dyn KernelBackend) {
    let report = run(&read(name), backend);
    assert_eq!(report.cases.len(), cases);
    let failures: Vec<String> = report.failures().map(ToString::to_string).collect();
    assert!(failures.is_empty(), "{} failures\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn every_case_passes_in_the_interpreter() {
    all_pass("gwfl_corpus_open", 133, &InterpreterBackend);
    all_pass("gwfl_corpus_second", 350, &InterpreterBackend);
}

#[test]
fn every_case_passes_in_machine_code() {
    let machine = JitBackend::new().expect("machine code");
    all_pass("gwfl_corpus_open", 133, &machine);
    all_pass("gwfl_corpus_second", 350, &machine);
}
