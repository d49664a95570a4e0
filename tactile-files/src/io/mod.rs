//! Reads and writes files of points, columns, grids, matching cases and grey images.
//!
//! | read by | what |
//! |---|---|
//! | [`read_points`] | tables of points, columns by name or two or three without a header |
//! | [`read_columns`] | columns of tables by name, in SI units |
//! | [`read_grid`] | matrices, empty cells and `nan` as NaN |
//! | [`read_cases`] | point-matching case files (`m` and `t` rows) |
//! | [`read_grey_image`] | PNG, PGM, JPEG, TIFF, grey or colour, 8 or 16 bits |
//! | [`read_colour_levels`] | PNG, PPM, JPEG, TIFF in colour, in 8 bits |
//! | [`read_normal_map`] | normals of a surface, as images or arrays |
//! | [`FrameReader`] | frames of videos, pipes, arrays and stacks of images, one after the other |
//!
//! Tables are text, or arrays of numbers in `.npy`, `.npz` and `.mat` (version 5). In text, cells
//! are separated by commas, semicolons, tabs or blanks, and may stand in double quotes. Decimal
//! commas are recognised if commas do not separate cells. A first line without any number is a
//! heading. A comment before the first row is a heading too if it names the columns. Empty lines
//! and lines that start with `#` or `%` are skipped. Units in headings are converted to SI (m, N,
//! Pa, s) or refused.
//!
//! Every fault of a file is a [`FileError`]: one sentence with the file, the place, the expected
//! and the found content. Readers do not panic on any content, and their memory is limited to a few
//! times the size of the file. A new file replaces an older one only when it is complete.
mod cases;
mod columns;
mod error;
mod files;
mod frames;
mod image;
mod kinds;
mod normals;
mod numbers;
mod range;
mod table;
#[cfg(test)]
mod tests;
mod text;

pub use cases::{CasePoints, MatchCase, read_cases, write_case_result};
pub use error::{FileError, FilePlace};
pub use files::{read_bytes, replace_file, write_bytes};
pub use frames::{FrameReader, frame_formats};
pub use image::{
    Grey, GreyImage, image_colour, image_size, read_colour_levels, read_grey_image,
    read_grey_levels, write_colour_image, write_grey_image,
};
pub use normals::read_normal_map;
pub use range::InputQuantity;
pub use table::{
    Gaps, PointTable, Points, Table, TableOptions, read_columns, read_displaced_points, read_grid,
    read_point_frames, read_points, read_table, read_table_with,
};

pub(crate) use files::{
    beside, finite, not_negative, number, one_or_more, parse_toml, poisson_ratio, positive,
    positive_pair, read_toml,
};
pub(crate) use image::read_frame;
pub(crate) use range::{force, length, modulus, pixel_size};
