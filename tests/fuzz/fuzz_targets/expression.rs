//! Any expression is compiled, or refused with a message. The first byte chooses dimension, place and kind of the term.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    if let Some((choice, text)) = data.split_first()
        && let Ok(text) = std::str::from_utf8(text)
    {
        wfl_tests::fuzz::run_expression(text, usize::from(*choice));
    }
});
