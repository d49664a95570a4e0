//! The tests of `tactile-match`, in one program: the generic code is compiled once for all of them.

mod allocation;
mod assignment;
mod common;
mod conformance;
mod dense;
mod dense_sets;
mod drift;
mod hostile;
mod labelling_against_dense;
mod recorded;
mod reference;
mod relaxation;
#[cfg(feature = "serde")]
mod serde;
mod serialtrack;
mod series;
mod sparse_against_dense;
mod stability;
mod stability_scale;
