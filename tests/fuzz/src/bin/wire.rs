//! Searches with libFuzzer for inputs that make this target fail: [`massline_fuzz::wire`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| massline_fuzz::wire::run(bytes));
