//! The conformance corpus: what GetFEM assembled, assembled here on both backends.

use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_jit::JitBackend;
use wfl_tests::corpus::{CorpusReport, Verdict, run_corpus};

const OWN_AT_TIES: &[&str] = &["kink_max_equal_arguments", "kink_nitsche_at_rest"];

fn run(text: &str, backend: &dyn KernelBackend) -> CorpusReport {
    run_corpus(text, backend).expect("a corpus")
}

fn read(name: &str) -> String {
    std::fs::read_to_string(format!("{}/../reference/{name}.json", env!("CARGO_MANIFEST_DIR"))).expect("the corpus")
}

fn all_pass(name: &str, cases: usize, own_at_ties: &[&str], backend: &dyn KernelBackend) {
    let report = run(&read(name), backend);
    assert_eq!(report.cases.len(), cases);
    let failures: Vec<String> = report.failures().map(ToString::to_string).collect();
    assert!(failures.is_empty(), "{} failures\n{}", failures.len(), failures.join("\n"));
    // cases whose tangent at a tie is the language's own choice, and GetFEM's where that is asked for
    let ties = report.cases.iter().filter(|c| matches!(c.verdict, Verdict::TieDiffers { .. }));
    assert_eq!(ties.map(|c| c.id.as_str()).collect::<Vec<_>>(), own_at_ties);
}

#[test]
fn every_case_passes_in_the_interpreter() {
    all_pass("gwfl_corpus_open", 133, OWN_AT_TIES, &InterpreterBackend);
    all_pass("gwfl_corpus_second", 350, &[], &InterpreterBackend);
}

#[test]
fn every_case_passes_in_machine_code() {
    let machine = JitBackend::new().expect("machine code");
    all_pass("gwfl_corpus_open", 133, OWN_AT_TIES, &machine);
    all_pass("gwfl_corpus_second", 350, &[], &machine);
}
