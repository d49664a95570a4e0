//! What the tests of several crates share: recorded answers, and tables of worst errors.
#![forbid(unsafe_code)]
#![allow(missing_docs, clippy::print_stdout)]

mod recorded;
mod worst;

pub use recorded::Answers;
pub use worst::{Worst, cases, numbers, rows};
