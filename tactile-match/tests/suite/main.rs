//! The tests of `tactile-match`, in a single program, so that the generic code is compiled once.

mod allocation;
mod common;
mod conformance;
mod corpus;
mod dense_sets;
mod drift;
mod first_tries;
mod hostile;
mod large_sets;
mod nearest;
mod recorded;
mod rigid;
#[cfg(feature = "serde")]
mod serde;
mod serialtrack;
mod series;
mod softassign;
mod stability;
mod trust;
