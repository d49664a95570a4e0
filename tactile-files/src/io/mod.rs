//! Files in and out: points, columns, grids, case files, grey images.
//!
//! | read by | what |
//! |---|---|
//! | [`read_points`] | CSV of points, columns by name or two or three without a header |
//! | [`read_columns`] | CSV columns by name, in SI units |
//! | [`read_grid`] | CSV matrices, empty cells and `nan` as NaN |
//! | [`read_cases`] | point-matching case files (`m` and `t` rows) |
//! | [`read_grey_image`] | PNG, PGM, JPEG, TIFF, grey or colour, 8 or 16 bits |
//! | [`read_colour_levels`] | PNG, PPM, JPEG, TIFF in colour, in 8 bits |
//! | [`FrameReader`] | frames of videos, pipes, arrays and stacks of images, one after the other |
//!
//! In CSV, fields are separated by commas, semicolons or tabs, and may stand in double quotes. A
//! first line without any number is a header. Empty lines and lines that start with `#` are passed
//! over. Units in the headings of columns are converted to SI (m, N, Pa, s) or refused.
//!
//! Whatever is wrong with a file is a [`FileError`]: one sentence with the file, the place, what
//! was expected and what was found. No content makes a reader panic, and none makes it ask for more
//! memory than a few times the size of the file. A file that is written takes the place of an older
//! one only when it is complete.
mod cases;
mod error;
mod files;
mod frames;
mod image;
mod range;
mod table;
#[cfg(test)]
mod tests;

pub use cases::{CasePoints, MatchCase, read_cases, write_case_result};
pub use error::{FileError, FilePlace};
pub use files::{read_bytes, replace_file, write_bytes};
pub use frames::FrameReader;
pub use image::{
    Grey, GreyImage, image_size, read_colour_levels, read_grey_image, read_grey_levels,
    write_grey_image,
};
pub use range::InputQuantity;
pub use table::{
    PointTable, Table, read_columns, read_displaced_points, read_grid, read_point_rows,
    read_point_table, read_points, read_table,
};

pub(crate) use files::{
    beside, finite, not_negative, number, one_or_more, parse_toml, poisson_ratio, positive,
    positive_pair, read_toml,
};
pub(crate) use image::read_frame;
pub(crate) use range::{force, length, modulus, pixel_size};
