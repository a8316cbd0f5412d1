//! `massline`
fn main() {}
