//! Tests of the building blocks, which users do not see.

mod properties;
mod reference;
mod scale;
mod sparse;
