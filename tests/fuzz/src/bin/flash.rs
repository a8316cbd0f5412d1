//! Searches with libFuzzer for inputs that make this target fail: [`massline_fuzz::flash`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| massline_fuzz::flash::run(bytes));
