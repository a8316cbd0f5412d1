//! `massline`: weigh what is on the shaker, from the test you run anyway.

fn main() -> std::process::ExitCode {
    massline::cli::main()
}
