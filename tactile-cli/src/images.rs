//! What the subcommands that work on images and grids have in common.
use crate::context::Context;
use crate::failure::Failure;
use crate::numbers::four_digits;
use crate::outputs::Csv;
use crate::progress::Progress as Bar;
use ndarray::Array2;
use std::ops::ControlFlow;
use std::path::Path;
use tactile_imaging::io::{Grey, read_grey_image, read_grid};
use tactile_imaging::sfs::{StopReason, SurfaceWorkspace};

/// Rows and columns of a file.
pub type Shaped<'a> = (&'a Path, (usize, usize));

/// Refuses a file of another shape than the first.
pub fn same_shape(
    (path, (rows, columns)): Shaped<'_>,
    (first, (first_rows, first_columns)): Shaped<'_>,
) -> Result<(), Failure> {
    if (rows, columns) == (first_rows, first_columns) {
        return Ok(());
    }
    Err(Failure::input(format!(
        "{} has {rows} rows and {columns} columns, but {} has {first_rows} and {first_columns}: give files of one size",
        path.display(),
        first.display()
    )))
}

/// A grey image, of a camera with so many bits where that is given.
pub fn read(path: &Path, bits: Option<u8>) -> Result<Array2<f64>, Failure> {
    Ok(read_grey_image(path, Grey::default(), bits)?.levels)
}

/// The bright pixels of an image of the first file's shape.
pub fn optional_mask(
    path: Option<&Path>,
    first: Shaped<'_>,
) -> Result<Option<Array2<bool>>, Failure> {
    let Some(path) = path else {
        return Ok(None);
    };
    let levels = read(path, None)?;
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

/// A grid of the first file's shape.
pub fn optional_grid(
    path: Option<&Path>,
    first: Shaped<'_>,
) -> Result<Option<Array2<f64>>, Failure> {
    let Some(path) = path else {
        return Ok(None);
    };
    let grid = read_grid(path)?;
    same_shape((path, grid.dim()), first)?;
    Ok(Some(grid))
}

/// Bytes that the work on a surface takes for every pixel: inputs, heights, and the buffers of the slowest method.
const BYTES_OF_A_PIXEL: f64 = 200.0;

/// Refuses images whose buffers do not fit into memory.
pub fn allow(context: &Context, (rows, columns): (usize, usize), job: &str) -> Result<(), Failure> {
    context.memory.allow(
        BYTES_OF_A_PIXEL * rows as f64 * columns as f64,
        &format!("{job} {rows} × {columns} pixels"),
        "cut the object out, or make the image smaller",
    )
}

/// Shows the progress of iterative solves and lets Ctrl-C end them with what there is.
pub fn watch(workspace: &mut SurfaceWorkspace<f64>, context: &Context, job: &str) {
    let interrupt = context.interrupt.clone();
    let mut bar: Option<Bar> = None;
    let job = job.to_owned();
    workspace.on_progress(move |progress| {
        interrupt.hear(true);
        bar.get_or_insert_with(|| Bar::of(progress.total, job.clone()))
            .done(progress.done);
        if interrupt.requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
}

/// A matrix as CSV, a row a line, with the digits that give the numbers back.
pub fn grid_csv(values: &Array2<f64>) -> Vec<u8> {
    let mut csv = Csv::without_header();
    for row in values.rows() {
        csv.row(row);
    }
    csv.into_bytes()
}

/// Lowest and highest value in a unit of which one is `1 / scale`, in words.
pub fn span(values: &Array2<f64>, scale: f64, unit: &str) -> String {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    match finite().count() {
        0 => "none".to_owned(),
        pixels => format!(
            "{} to {} {unit} over {pixels} pixels",
            four_digits(scale * finite().fold(f64::INFINITY, f64::min)),
            four_digits(scale * finite().fold(f64::NEG_INFINITY, f64::max))
        ),
    }
}

pub fn stop_reason(stop: StopReason) -> &'static str {
    match stop {
        StopReason::Direct => "solved directly",
        StopReason::Converged => "converged",
        StopReason::IterationLimit => "stopped at the limit of iterations",
        StopReason::Stagnated => "stopped where nothing improved any more",
        StopReason::Cancelled => "stopped by Ctrl-C",
        _ => "stopped",
    }
}

/// An image in 8 bits, of a camera with so many bits where that is given.
pub fn eight_bits(path: &Path, bits: Option<u8>) -> Result<Array2<u8>, Failure> {
    Ok(read_grey_image(path, Grey::default(), bits)?.to_u8())
}
