//! Arguments of several subcommands: numbers, repetitions, tables, masks and known heights.
use crate::console::{Context, Interrupt, median_ms};
use crate::failure::Failure;
use crate::text::{count, four_digits, printable};
use clap::{Args, ValueEnum};
use ndarray::Array2;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tactile_files::io::{
    FileError, Gaps, Grey, InputQuantity, Points, TableOptions, read_displaced_points,
    read_grey_image, read_grid, read_point_frames, read_table_with,
};

fn number(text: &str, fits: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    let value = text.parse().ok();
    let value = value.filter(|v: &f64| v.is_finite() && fits(*v));
    value.ok_or_else(|| format!("expected {expected}"))
}

/// An argument that is a positive, finite number.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    number(text, |v| v > 0.0, "a number above zero")
}

fn physical(text: &str, quantity: InputQuantity, scale: f64, unit: &str) -> Result<f64, String> {
    let [least, greatest] = quantity.limits().map(|v| four_digits(v / scale));
    let expected = format!("a number from {least} to {greatest} {unit}");
    number(text, |v| quantity.allows(v * scale), &expected)
}

/// An argument that is a length in millimetres.
pub(crate) fn length_mm(text: &str) -> Result<f64, String> {
    physical(text, InputQuantity::Length, 1e-3, "mm")
}

/// An argument that is the size of a lump in millimetres. The mesh of a smaller lump would be too
/// large.
pub(crate) fn lump_mm(text: &str) -> Result<f64, String> {
    let expected = "a number from 0.5 to 200 mm";
    number(text, |mm| (0.5..=200.0).contains(&mm), expected)
}

/// An argument that is the ratio of the modulus of an inclusion to that around it. Within a tenth
/// of one the inclusion is not visible.
pub(crate) fn contrast(text: &str) -> Result<f64, String> {
    let fits = |ratio: f64| (1.1..=1e3).contains(&ratio) || (1e-3..=0.9).contains(&ratio);
    number(text, fits, "a ratio from 1.1 to 1000, or from 0.001 to 0.9")
}

/// An argument that is a modulus in kilopascals.
pub(crate) fn modulus_kpa(text: &str) -> Result<f64, String> {
    physical(text, InputQuantity::Modulus, 1e3, "kPa")
}

/// An argument that is a force in newtons.
pub(crate) fn force_n(text: &str) -> Result<f64, String> {
    physical(text, InputQuantity::Force, 1.0, "N")
}

/// An argument that is the size of a pixel on the sensor in micrometres, one or width and height.
pub(crate) fn pixel_um(text: &str) -> Result<[f64; 2], String> {
    let [x, y] = one_or_two(text)?;
    for side in [x, y] {
        physical(&side.to_string(), InputQuantity::PixelSide, 1e-6, "µm")?;
    }
    if (x / y).max(y / x) > InputQuantity::MOST_UNEQUAL_SIDES {
        return Err("expected sides in one unit, neither of which is ten times the other".into());
    }
    Ok([x, y])
}

/// An argument that is a finite number of at least zero.
pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |v| v >= 0.0, "a number of at least zero")
}

/// An argument that is one positive number, or two separated by a comma: the size of a pixel along
/// x and y.
pub(crate) fn one_or_two(text: &str) -> Result<[f64; 2], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| positive(part.trim())).collect();
    match numbers.as_deref() {
        Ok(&[both]) => Ok([both; 2]),
        Ok(&[x, y]) => Ok([x, y]),
        _ => Err("expected one number above zero, or two separated by a comma".to_owned()),
    }
}

/// The name of a value as it is written on the command line.
pub(crate) fn name(value: impl ValueEnum) -> String {
    let value = value.to_possible_value();
    value.map_or(String::new(), |v| v.get_name().to_owned())
}

/// Number of repetitions.
#[derive(Args, Clone, Copy)]
pub(crate) struct Repetition {
    /// Repeat the computation N times. The median of the times is printed.
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub repeat: u32,
}

impl Repetition {
    /// The result of the last repetition, and the median of the times in milliseconds. Ctrl-C ends
    /// the repetitions.
    pub(crate) fn timed<T, E>(
        self,
        interrupt: &Interrupt,
        mut work: impl FnMut() -> Result<T, E>,
    ) -> Result<(T, f64), E> {
        let mut times = Vec::new();
        loop {
            let start = Instant::now();
            let result = work()?;
            times.push(start.elapsed());
            if times.len() >= self.repeat as usize || interrupt.requested() {
                return Ok((result, median_ms(times)));
            }
        }
    }
}

/// Options for tables whose format is not recognised.
#[derive(Args)]
pub(crate) struct TableArguments {
    /// Columns to be read, in their order: by heading or by number from 1.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    columns: Vec<String>,
    /// Number of lines before each table, for example the preamble of an instrument.
    #[arg(long, value_name = "LINES", default_value_t = 0)]
    skip_lines: usize,
    /// Refuse rows without a number instead of leaving them out.
    #[arg(long)]
    strict: bool,
}

impl TableArguments {
    fn options(&self) -> TableOptions {
        TableOptions {
            columns: self.columns.clone(),
            skip_lines: self.skip_lines,
            gaps: if self.strict {
                Gaps::Refuse
            } else {
                Gaps::LeaveOut
            },
        }
    }

    /// Columns of a table in SI units.
    pub(crate) fn columns<const N: usize>(
        &self,
        path: &Path,
        wanted: [(&[&str], &str); N],
        context: &mut Context,
    ) -> Result<[Vec<f64>; N], Failure> {
        let mut table = read_table_with(path, &self.options())?;
        let columns = table.columns(wanted)?;
        taken(path, &table.notes, context);
        Ok(columns)
    }

    /// Frames of points. A table of tracked points has several frames. A single file with one frame
    /// must have displacements beside its points. For paired frames row i of one is row i of the
    /// others, and missing numbers are NaN. An empty file of a series is an empty frame.
    pub(crate) fn read_points(
        &self,
        paths: &[impl AsRef<Path>],
        [paired, series]: [bool; 2],
        context: &mut Context,
    ) -> Result<PointFrames, Failure> {
        let mut options = self.options();
        if paired && !self.strict {
            options.gaps = Gaps::Keep;
        }
        let (mut frames, mut empty) = (Vec::<PointFrame>::new(), Vec::new());
        for path in paths {
            let path = path.as_ref();
            let file = printable(&path.display().to_string());
            let read = match (paths.len(), options.columns.len()) {
                (1, 4 | 6) => Ok(Vec::new()),
                _ => read_point_frames(path, &options),
            };
            let read = match read {
                Err(FileError::Empty { .. }) if series => {
                    empty.push(file);
                    continue;
                }
                Ok(found) if paths.len() == 1 && found.len() < 2 => {
                    if !self.strict {
                        options.gaps = Gaps::Keep;
                    }
                    vec![read_displaced_points(path, &options)?]
                }
                read => read?,
            };
            taken(path, &read[0].notes, context);
            let several = read.len() > 1;
            for (k, points) in read.into_iter().enumerate() {
                let number = frames.len() + empty.len() + 1;
                let name = match several {
                    true => format!("{file} frame {}", k + 1),
                    false => file.clone(),
                };
                match points.rows.is_empty() {
                    true => empty.push(name),
                    false => frames.push(PointFrame {
                        number,
                        name,
                        points,
                    }),
                }
            }
            if let [first, .., last] = &frames[..]
                && first.points.metric != last.points.metric
            {
                return Err(Failure::input(format!(
                    "only one of {} and {} names the unit of its coordinates: name it in both \
                     headers or in none",
                    first.name, last.name
                )));
            }
        }
        if let [first, ..] = &empty[..] {
            let of_all = count(empty.len() + frames.len(), "frame");
            let sentence = format!(
                "{} of {of_all} without points skipped, the first {first}",
                empty.len()
            );
            context.warn("frames_empty", json!({ "frames": empty.len() }), sentence);
        }
        Ok(PointFrames {
            frames,
            empty: empty.len(),
        })
    }
}

/// Frames of points. Either all of their coordinates have a unit, or none.
pub(crate) struct PointFrames {
    pub frames: Vec<PointFrame>,
    /// The number of frames without points, which are skipped.
    pub empty: usize,
}

/// Points, the number of their frame from 1 among all given frames, and its name.
pub(crate) struct PointFrame {
    pub number: usize,
    pub name: String,
    pub points: Points,
}

/// Prints the assumptions made for a table.
fn taken(path: &Path, notes: &[String], context: &mut Context) {
    for note in notes {
        let sentence = format!("{}: {note}", path.display());
        context.warn(
            "table",
            json!({ "file": path.display().to_string() }),
            sentence,
        );
    }
}

/// Rows and columns of a file.
pub(crate) type Shaped<'a> = (&'a Path, (usize, usize));

/// An error if a file has another shape than the first.
pub(crate) fn same_shape(
    (path, (rows, columns)): Shaped<'_>,
    (first, (first_rows, first_columns)): Shaped<'_>,
) -> Result<(), Failure> {
    if (rows, columns) == (first_rows, first_columns) {
        return Ok(());
    }
    Err(Failure::input(format!(
        "{} has {rows} rows and {columns} columns, but {} has {first_rows} and {first_columns}: \
         give files of one size",
        path.display(),
        first.display()
    )))
}

/// The part of a surface to be computed, and its known heights.
#[derive(Args)]
pub(crate) struct HeightRegion {
    /// Image of the object: heights are computed at bright pixels (above 127).
    #[arg(long, value_name = "IMAGE")]
    pub mask: Option<PathBuf>,
    /// Known heights, NaN if unknown.
    #[arg(long, value_name = "KNOWN.csv")]
    pub heights: Option<PathBuf>,
}

impl HeightRegion {
    /// The files other than the first, which determines the shape.
    pub(crate) fn files<'a>(&'a self, first: &'a [&'a Path]) -> Vec<&'a Path> {
        let own = self.mask.iter().chain(&self.heights).map(PathBuf::as_path);
        first.iter().copied().chain(own).collect()
    }

    pub(crate) fn known_heights(&self, first: Shaped<'_>) -> Result<Option<Array2<f64>>, Failure> {
        let Some(path) = &self.heights else {
            return Ok(None);
        };
        let grid = read_grid(path)?;
        same_shape((path, grid.dim()), first)?;
        Ok(Some(grid))
    }

    pub(crate) fn bright_pixels(&self, first: Shaped<'_>) -> Result<Option<Array2<bool>>, Failure> {
        let Some(path) = &self.mask else {
            return Ok(None);
        };
        let levels = read_grey_image(path, Grey::default(), None)?.levels;
        same_shape((path, levels.dim()), first)?;
        let mask = levels.mapv(|level| level > 127.0);
        if !mask.iter().any(|&inside| inside) {
            return Err(Failure::input(format!(
                "the mask {} has no pixel brighter than 127: paint the object white",
                path.display()
            )));
        }
        Ok(Some(mask))
    }
}
