//! Has libFuzzer look for inputs that break [`massline_fuzz::flash`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| massline_fuzz::flash::run(bytes));
