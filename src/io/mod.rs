//! Files in and out: points, grids, case files, grey images.
//!
//! | module | reads | writes |
//! |---|---|---|
//! | [`points`] | CSV of two or three columns, with or without a header | the same |
//! | [`grid`] | CSV matrices, empty cells and `nan` as NaN | the same |
//! | [`cases`] | point-matching case files (`m` and `t` rows) | result files (`w` and `a` rows) |
//! | [`image`] | PNG, PGM, JPEG; grey or colour; 8 or 16 bits | 8-bit PNG and PGM |
//!
//! Whatever is wrong with a file is a [`ReadError`] that names the file, the line and column, what was expected
//! and what was found. No content makes a reader panic.
pub mod cases;
mod error;
pub mod grid;
pub mod image;
pub mod points;
pub mod table;

pub use cases::{CasePoints, MatchCase, read_cases, write_case_result};
pub use error::{Expected, ReadError};
pub use grid::{read_grid, write_grid};
pub use image::{GreyImage, read_grey_image, write_grey_image};
pub use points::{PointTable, read_point_table, read_points, write_points};
pub use table::{Table, read_table};
