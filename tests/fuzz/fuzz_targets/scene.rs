//! Any text is read, resolved and formatted without a panic; formatting twice changes nothing.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| wfl_tests::fuzz::run_text(text));
