//! What the tests of several crates share: recorded answers, tables of worst errors, published
//! data.
#![forbid(unsafe_code)]
#![allow(missing_docs, clippy::print_stdout)]

mod published;
mod recorded;
mod worst;

pub use published::{published, reference};
pub use recorded::Answers;
pub use worst::{Worst, cases, numbers, rows};
