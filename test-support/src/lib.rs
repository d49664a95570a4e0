//! Tools shared by the tests of several crates: recorded answers, tables of worst errors, published
//! data.
#![forbid(unsafe_code)]
#![allow(missing_docs, clippy::print_stdout)]

mod published;
mod recorded;
mod worst;

pub use published::{published, reference};
pub use recorded::Answers;
pub use worst::{Worst, cases, numbers, rows};

/// Number of draws in a study: from the environment variable, or the default of the test.
pub fn draws(variable: &str, otherwise: u64) -> u64 {
    let given = std::env::var(variable).ok();
    given.and_then(|n| n.parse().ok()).unwrap_or(otherwise)
}
