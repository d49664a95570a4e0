//! Files in and out: points, columns, grids, case files, grey images.
//!
//! | read by | what |
//! |---|---|
//! | [`read_points`] | CSV of points, columns by name or two or three without a header |
//! | [`read_columns`] | CSV columns by name, in SI units |
//! | [`read_grid`] | CSV matrices, empty cells and `nan` as NaN |
//! | [`read_cases`] | point-matching case files (`m` and `t` rows) |
//! | [`read_grey_image`] | PNG, PGM, JPEG; grey or colour; 8 or 16 bits; [`write_grey_image`] writes 8-bit PNG and PGM |
//!
//! In CSV, fields are separated by commas, semicolons or tabs. A first line without any number is a header. Empty lines and lines that start
//! with `#` are passed over.
//!
//! Whatever is wrong with a file is a [`ReadError`] that names the file, the line and column, what was expected
//! and what was found. No content makes a reader panic, and none makes it ask for more memory than a few times the
//! size of the file. Units in the headings of columns are converted to SI (m, N, Pa, s) or refused. A file that is
//! written takes the place of an older one only when it is complete.
// Some formats are read and written by the program alone.

mod cases;
mod depth;
mod error;
mod files;
mod grey;
mod grid;
mod image;
mod points;
mod replace_file;
mod table;
mod units;

pub use cases::write_case_result;
pub use cases::{CasePoints, MatchCase, read_cases};
pub use error::shorten;
pub use error::{Expected, ReadError};
pub use files::{read_bytes, write_bytes};
pub use grey::Grey;
pub use grid::read_grid;
pub use image::read_grey_levels;
pub use image::{GreyImage, read_grey_image, write_grey_image};
pub use points::read_points;
pub use points::{PointTable, read_point_table};
pub use replace_file::replace_file;
pub use table::read_columns;
pub use table::{Column, read_table};
pub use units::Quantity;
