//! `wfl corpus FILE`: runs a conformance corpus, for developers of WFL.

use std::process::ExitCode;

use wfl_compiler::{InterpreterBackend, backend::KernelBackend};
use wfl_jit::JitBackend;
use wfl_runtime::{
    corpus::run_corpus,
    input::{InputKind, read_text},
};

use crate::{
    args::CorpusArgs,
    load::{out, say},
};

/// A line a case and a closing count in machine code; then the interpreter, of which only failures get lines.
pub(crate) fn corpus(args: &CorpusArgs) -> ExitCode {
    let text = match read_text(&args.file, InputKind::Scene) {
        Ok(text) => text,
        Err(e) => {
            say(&format!("error: cannot read {}: {e}\n", args.file.display()));
            return ExitCode::FAILURE;
        }
    };
    let machine = match JitBackend::new() {
        Ok(backend) => backend,
        Err(e) => {
            say(&format!("error: {e}\n"));
            return ExitCode::FAILURE;
        }
    };
    let backends: [&dyn KernelBackend; 2] = [&machine, &InterpreterBackend];
    let mut good = true;
    for (k, backend) in backends.into_iter().enumerate() {
        let report = match run_corpus(&text, backend) {
            Ok(report) => report,
            Err(e) => {
                say(&format!("error: {}: {e}\n", args.file.display()));
                return ExitCode::FAILURE;
            }
        };
        good &= report.failures().next().is_none();
        if k == 0 {
            out(&report.to_string());
        } else {
            report.failures().for_each(|case| out(&format!("{case}\n")));
            out(&format!("{}\n", report.summary()));
        }
    }
    if good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
