//! Warps points by a thin-plate spline fitted to pairs of points.
//!
//! ```text
//! cargo run --release --example warp_points -- SOURCES.csv TARGETS.csv QUERIES.csv --out WARPED.csv
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::{
    error::Error,
    fmt::Write as _,
    ops::ControlFlow,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Instant,
};

use clap::{Parser, ValueEnum};
use nalgebra::{Point, SMatrix};
use tactile_imaging::{
    io::{PointTable, read_point_table, read_points},
    tps::{
        Factorization, FitOptions, Input, Kernel, NegR, Progress, R2LogR, R3, Smoothing, Spline,
        ThinPlateSpline, TpsError, Workspace,
    },
};

/// Fits the spline that takes SOURCES to TARGETS and gives its values and Jacobians at QUERIES.
///
/// The files are CSV, a point a row, two or three columns, with or without a header line. Row i of TARGETS is where row i
/// of SOURCES goes. The values and Jacobians go to the file given by --out; one line of JSON with the fit's report and
/// median times in milliseconds goes to standard output.
#[derive(Parser)]
#[command(after_help = "\
Examples:
  warp_points sources.csv targets.csv queries.csv --out warped.csv
  warp_points sources.csv targets.csv queries.csv --kernel r            3-D thin plate
  warp_points sources.csv targets.csv queries.csv --lambda gcv          smoothing chosen from the data
λ weighs the bending energy wᵀKw against the squared distances to the targets; 0 passes through every target.")]
struct Arguments {
    /// Where points are.
    sources: PathBuf,
    /// Where they go.
    targets: PathBuf,
    /// Points to warp.
    queries: PathBuf,
    /// U(r): r² ln r (the thin plate of the plane), −r (of space) or r³.
    #[arg(long, value_enum, default_value = "r2logr2")]
    kernel: KernelName,
    /// Smoothing parameter, a number of at least zero, or gcv for the one of least cross-validation.
    #[arg(long, value_name = "X|gcv", default_value = "0", value_parser = smoothing, allow_negative_numbers = true)]
    lambda: Smoothing<f64>,
    /// CSV file for the values and Jacobians: fx,fy[,fz],dfx_dx,dfx_dy,…
    #[arg(long, value_name = "OUT.csv")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum KernelName {
    /// r² ln r, half of r² log r²: the same splines, and with λ half of the other's the same smoothing.
    #[value(name = "r2logr2", alias = "r2logr")]
    R2logr,
    /// −r.
    R,
    /// r³.
    R3,
}

fn smoothing(text: &str) -> Result<Smoothing<f64>, String> {
    if text.eq_ignore_ascii_case("gcv") {
        return Ok(Smoothing::Gcv);
    }
    match text.parse::<f64>() {
        Ok(0.0) => Ok(Smoothing::None),
        Ok(lambda) if lambda > 0.0 && lambda.is_finite() => Ok(Smoothing::Lambda(lambda)),
        _ => Err("expected a finite number of at least zero, or gcv".to_owned()),
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("warp_points: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    match read_point_table(&arguments.sources)? {
        PointTable::Plane(sources) => with_kernel(arguments, &sources),
        PointTable::Space(sources) => with_kernel(arguments, &sources),
    }
}

fn with_kernel<const D: usize>(
    arguments: &Arguments,
    sources: &[Point<f64, D>],
) -> Result<(), Box<dyn Error>> {
    match arguments.kernel {
        KernelName::R2logr => warp(arguments, R2LogR, sources),
        KernelName::R => warp(arguments, NegR, sources),
        KernelName::R3 => warp(arguments, R3, sources),
    }
}

fn warp<const D: usize, K: Kernel>(
    arguments: &Arguments,
    kernel: K,
    sources: &[Point<f64, D>],
) -> Result<(), Box<dyn Error>> {
    let targets = read_points::<D>(&arguments.targets)?;
    let queries = read_points::<D>(&arguments.queries)?;
    let options = FitOptions::new(kernel.clone()).with_smoothing(arguments.lambda)?;
    let name = |error| in_files(arguments, error);
    let (fit_ms, spline) = median_ms(|| fit(sources, &targets, &options));
    let spline = spline.map_err(name)?;
    let factorization = Factorization::new(sources, &options).map_err(name)?;
    let (mut workspace, mut refitted) = (Workspace::new(), Spline::empty(kernel));
    let (refit_ms, refit) =
        median_ms(|| factorization.fit_with(&mut workspace, &targets, &mut refitted));
    refit.map_err(name)?;
    let mut values = vec![Point::origin(); queries.len()];
    let mut jacobians = vec![SMatrix::zeros(); queries.len()];
    let (evaluate_ms, done) = median_ms(|| spline.apply_into(&queries, &mut values));
    done?;
    let (jacobian_ms, done) =
        median_ms(|| spline.apply_and_jacobian_into(&queries, &mut values, &mut jacobians));
    done?;
    if let Some(path) = &arguments.out {
        write(path, &values, &jacobians)?;
    }
    let report = spline.report();
    let line = serde_json::json!({
        "n": report.points, "lambda": report.lambda, "bending_energy": spline.bending_energy(),
        "condition": report.condition, "rank": report.rank, "fit_ms": fit_ms, "refit_ms": refit_ms,
        "evaluate_ms": evaluate_ms, "jacobian_ms": jacobian_ms, "merged": report.merged, "extents": report.extents,
        "residual": report.residual, "digits": report.digits, "iterations": report.iterations,
        "converged": report.converged,
    });
    println!("{line}");
    if report.rank <= D {
        eprintln!(
            "the sources span {} of {D} directions; the spline bends along these alone",
            report.rank - 1
        );
    }
    Ok(())
}

/// The spline; thousands of points are solved for by iteration, which tells on stderr how far it is.
fn fit<const D: usize, K: Kernel>(
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    options: &FitOptions<f64, K>,
) -> Result<ThinPlateSpline<f64, D, K>, TpsError> {
    let tell = |progress: &Progress| {
        match progress.residual {
            Some(residual) => eprint!(
                "\rstep {}: largest residual {residual:.1e}   ",
                progress.done
            ),
            None => eprint!(
                "\rprepared {} of {} points   ",
                progress.done, progress.total
            ),
        }
        ControlFlow::Continue(())
    };
    let spline = Factorization::new_watched(sources, options, tell)?.fit_watched(targets, tell)?;
    if spline.report().iterations > 0 {
        eprintln!();
    }
    Ok(spline)
}

/// The error with the file it is about.
fn in_files(arguments: &Arguments, error: TpsError) -> String {
    let path = match error {
        TpsError::Length {
            input: Input::Targets,
            ..
        }
        | TpsError::NotFinite {
            input: Input::Targets,
            ..
        } => &arguments.targets,
        _ => &arguments.sources,
    };
    match error {
        TpsError::Length {
            expected, found, ..
        } => format!(
            "{}: expected {expected} rows, as many as {} has, found {found}",
            path.display(),
            arguments.sources.display()
        ),
        TpsError::Conflict { first, second } => format!(
            "{}: points {} and {} coincide but their targets in {} differ; smooth with --lambda, or drop one",
            path.display(),
            first + 1,
            second + 1,
            arguments.targets.display()
        ),
        error => format!("{}: {error}", path.display()),
    }
}

/// Median time of a call in milliseconds, over up to 31 calls or about a second, and its last result.
fn median_ms<R>(mut call: impl FnMut() -> R) -> (f64, R) {
    let (mut times, begin) = (Vec::new(), Instant::now());
    loop {
        let start = Instant::now();
        let result = call();
        times.push(start.elapsed().as_secs_f64() * 1e3);
        if times.len() == 31 || begin.elapsed().as_secs_f64() > 1.0 {
            times.sort_by(f64::total_cmp);
            return (times[times.len() / 2], result);
        }
    }
}

/// Columns fx, fy, …, dfx_dx, dfx_dy, …; every number with the digits that give it back.
fn write<const D: usize>(
    path: &Path,
    values: &[Point<f64, D>],
    jacobians: &[SMatrix<f64, D, D>],
) -> Result<(), Box<dyn Error>> {
    const AXES: [&str; 3] = ["x", "y", "z"];
    let mut header: Vec<String> = AXES[..D].iter().map(|i| format!("f{i}")).collect();
    header.extend(
        AXES[..D]
            .iter()
            .flat_map(|i| AXES[..D].iter().map(move |j| format!("df{i}_d{j}"))),
    );
    let mut text = header.join(",") + "\n";
    for (value, jacobian) in values.iter().zip(jacobians) {
        let transposed = jacobian.transpose();
        for (k, x) in value.iter().chain(transposed.iter()).enumerate() {
            let _ = write!(text, "{}{x:?}", if k == 0 { "" } else { "," });
        }
        text.push('\n');
    }
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()).into())
}
