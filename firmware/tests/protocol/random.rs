//! Random numbers, and how many of them a test takes.

pub use massline_firmware::models::random::Random;

/// A count that the environment may set, for the long form of a test.
pub fn wanted(variable: &str, otherwise: u64) -> u64 {
    let given = std::env::var(variable).ok();
    given.map_or(otherwise, |text| {
        let digits = text.replace('_', "");
        let count = digits.parse();
        count.unwrap_or_else(|_| panic!("{variable} is {text:?}, which is no number"))
    })
}
