//! `cargo xtask`: see [`massline_tests::xtask`].

use std::process::ExitCode;

fn main() -> ExitCode {
    massline_tests::xtask::main(std::env::args().skip(1))
}
