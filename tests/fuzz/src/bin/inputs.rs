//! Searches with libFuzzer for inputs that make this target fail: [`massline_fuzz::inputs`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| massline_fuzz::inputs::run(bytes));
