//! Has libFuzzer look for inputs that break [`massline_fuzz::inputs`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| massline_fuzz::inputs::run(bytes));
