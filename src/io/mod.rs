//! Files in and out: points, grids, case files, grey images.
//!
//! | module | reads | writes |
//! |---|---|---|
//! | [`points`] | CSV of points, columns by name or two or three without a header | the same |
//! | [`grid`] | CSV matrices, empty cells and `nan` as NaN | the same |
//! | [`cases`] | point-matching case files (`m` and `t` rows) | result files (`w` and `a` rows) |
//! | [`image`] | PNG, PGM, JPEG; grey or colour; 8 or 16 bits | 8-bit PNG and PGM |
//!
//! Whatever is wrong with a file is a [`ReadError`] that names the file, the line and column, what was expected
//! and what was found. No content makes a reader panic, and none makes it ask for more memory than a few times the
//! size of the file. Units in the headings of columns are converted to SI or refused ([`Quantity`]). A file that is
//! written takes the place of an older one only when it is complete.
pub mod cases;
mod depth;
mod error;
mod files;
mod grey;
pub mod grid;
pub mod image;
pub mod points;
pub mod table;
mod units;

pub use cases::{CasePoints, MatchCase, read_cases, write_case_result};
pub(crate) use error::shorten;
pub use error::{Expected, ReadError};
pub(crate) use files::read_bytes;
pub use files::write_file;
pub use grey::Grey;
pub use grid::{read_grid, write_grid};
pub use image::{
    GreyImage, read_grey_image, read_grey_image_as, read_grey_image_of_bits, write_grey_image,
};
pub use points::{PointTable, read_point_table, read_points, write_points};
pub use table::{Column, Table, read_table};
pub use units::Quantity;
