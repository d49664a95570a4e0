//! `tactile warp`: a thin-plate spline through pairs of points.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::{count, four_digits, median_ms};
use crate::outputs::{Csv, Outputs};
use crate::progress::{Progress as Bar, waiting};
use clap::{Args, ValueEnum};
use nalgebra::{Point, SMatrix};
use serde_json::json;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;
use tactile_imaging::io::{PointTable, read_point_table};
use tactile_imaging::tps::{
    FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, ThinPlateSpline, TpsError,
};

/// Fit a thin-plate spline to pairs of points and warp other points by it
///
/// The files are CSV, a point a row: columns x, y and, in space, z, found by name where there is a header. Row i of
/// TARGETS is where row i of SOURCES goes. λ weighs the bending energy wᵀKw against the squared distances to the targets;
/// 0 passes through every target. --out gets warped.csv: fx, fy (and fz) and the Jacobian dfx_dx,dfx_dy,… at every query.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile warp examples/data/sources.csv examples/data/targets.csv examples/data/queries.csv --lambda gcv
  tactile warp examples/data/sources.csv examples/data/targets.csv examples/data/queries.csv --kernel r --out target/warp")]
pub struct Arguments {
    /// Where points are.
    sources: PathBuf,
    /// Where they go.
    targets: PathBuf,
    /// Points to warp.
    queries: PathBuf,
    /// U(r): r² ln r (the thin plate of the plane), −r (of space) or r³.
    #[arg(long, value_enum, default_value = "r2logr")]
    kernel: KernelName,
    /// Smoothing parameter, a number of at least zero, or gcv for the one of least generalised cross-validation.
    #[arg(long, value_name = "X|gcv", default_value = "0", value_parser = smoothing, allow_negative_numbers = true)]
    lambda: Smoothing<f64>,
    /// Folder for warped.csv.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Fit and evaluate N times; the median of the times is given.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
}

#[derive(Clone, Copy, ValueEnum)]
enum KernelName {
    /// r² ln r, half of r² log r²: the same splines, and with λ half of the other's the same smoothing.
    #[value(name = "r2logr", alias = "r2logr2")]
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

const FILE: &str = "warped.csv";

/// Residual of an iterative fit, relative to the largest target.
const TOLERANCE: f64 = 1e-10;

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let inputs = [&arguments.sources, &arguments.targets, &arguments.queries];
    let outputs = Outputs::plan(
        arguments.out.as_deref(),
        &[FILE],
        &inputs.map(PathBuf::as_path),
    )?;
    let [sources, targets, queries] = inputs.map(read_point_table);
    let ((sources, metres), targets, queries) = (sources?, targets?, queries?);
    for (path, unit) in [
        (&arguments.targets, targets.1),
        (&arguments.queries, queries.1),
    ] {
        if unit != metres {
            return Err(Failure::input(format!(
                "only one of {} and {} names the unit of its coordinates: name it in both headers or in none",
                arguments.sources.display(),
                path.display()
            )));
        }
    }
    match (sources, targets.0, queries.0) {
        (PointTable::Plane(a), PointTable::Plane(b), PointTable::Plane(q)) => {
            with_kernel(arguments, context, outputs, &[a, b, q])
        }
        (PointTable::Space(a), PointTable::Space(b), PointTable::Space(q)) => {
            with_kernel(arguments, context, outputs, &[a, b, q])
        }
        _ => Err(Failure::input(format!(
            "{}, {} and {} must all have two coordinates a point, or all three",
            arguments.sources.display(),
            arguments.targets.display(),
            arguments.queries.display()
        ))),
    }
}

/// Sources, targets and queries.
type Sets<const D: usize> = [Vec<Point<f64, D>>; 3];

fn with_kernel<const D: usize>(
    arguments: &Arguments,
    context: &mut Context,
    outputs: Outputs,
    sets: &Sets<D>,
) -> Result<Exit, Failure> {
    match arguments.kernel {
        KernelName::R2logr => warp(arguments, context, outputs, R2LogR, sets),
        KernelName::R => warp(arguments, context, outputs, NegR, sets),
        KernelName::R3 => warp(arguments, context, outputs, R3, sets),
    }
}

fn warp<const D: usize, K: Kernel>(
    arguments: &Arguments,
    context: &mut Context,
    mut outputs: Outputs,
    kernel: K,
    sets: &Sets<D>,
) -> Result<Exit, Failure> {
    let [sources, targets, queries] = sets;
    // Cross-validation is direct whatever the number of points: it takes the eigenvalues of a dense matrix.
    if matches!(arguments.lambda, Smoothing::Gcv) {
        let n = sources.len() as f64;
        let job = format!("cross-validation with {} points", sources.len());
        context
            .memory
            .allow(24.0 * n * n, &job, "give --lambda a number")?;
    }
    let options = FitOptions::new(kernel)
        .with_smoothing(arguments.lambda)
        .and_then(|options| options.with_tolerance(TOLERANCE))
        .map_err(Failure::input)?;
    let (mut fit_times, mut evaluate_times) = (Vec::new(), Vec::new());
    let mut values = vec![Point::origin(); queries.len()];
    let mut jacobians = vec![SMatrix::zeros(); queries.len()];
    let (mut spline, mut warped) = (None, 0);
    for _ in 0..arguments.repeat {
        // A direct solution does not tell how far it is.
        let clock = Bar::with_clock(fitting(sources.len()));
        let start = Instant::now();
        let fitted = fit(context, clock, sources, targets, &options);
        let fitted = fitted.map_err(|error| Failure::input(in_files(arguments, error)))?;
        fit_times.push(start.elapsed());
        let start = Instant::now();
        warped = evaluate(context, &fitted, queries, &mut values, &mut jacobians)?;
        evaluate_times.push(start.elapsed());
        spline = Some(fitted);
        if warped < queries.len() {
            break;
        }
    }
    let Some(spline) = spline else {
        return Ok(Exit::Complete);
    };
    let (fit_ms, evaluate_ms) = (median_ms(&mut fit_times), median_ms(&mut evaluate_times));
    outputs.write(FILE, &table(&values[..warped], &jacobians[..warped]))?;
    let report = &spline.report;
    // As much work as a step of the iteration, which after Ctrl-C nobody waits for.
    let bending_energy = (!context.interrupt.requested())
        .then(|| waiting("computing the bending energy", || spline.bending_energy()));
    let console = &mut context.console;
    console.value(&json!({
        "points": report.points, "queries": warped, "lambda": report.lambda,
        "bending_energy": bending_energy, "condition": report.condition, "rank": report.rank,
        "merged": report.merged, "extents": report.extents, "residual": report.residual, "digits": report.digits,
        "iterations": report.iterations, "converged": report.converged(), "fit_ms": fit_ms,
        "evaluate_ms": evaluate_ms,
    }));
    console.line(format!(
        "points           {} ({} merged)",
        report.points, report.merged
    ));
    console.line(format!("smoothing λ      {}", four_digits(report.lambda)));
    if let Some(energy) = bending_energy {
        console.line(format!("bending energy   {}", four_digits(energy)));
    }
    if let Some(residual) = report.residual {
        console.line(format!(
            "residual         {residual:.1e} of the largest target"
        ));
    }
    console.line(format!(
        "condition        {:.1e}, about {:.0} digits left",
        report.condition, report.digits
    ));
    console.line(format!(
        "time             fit {fit_ms:.2} ms, {} {evaluate_ms:.2} ms",
        count(warped, "evaluation")
    ));
    if report.rank <= D {
        console.note(format!(
            "the sources span {} of {D} directions; the spline bends along these alone",
            report.rank - 1
        ));
    }
    if let Some(summary) = outputs.summary() {
        console.line(summary);
    }
    if !report.converged() {
        console.note("the iteration was stopped before it reached its tolerance; the residual says how far it came");
    }
    if warped < queries.len() {
        console.note(format!(
            "stopped after {warped} of {} points to warp",
            queries.len()
        ));
    }
    if context.interrupt.requested() {
        return Ok(Exit::Interrupted);
    }
    if !report.converged() {
        return Ok(Exit::Partial);
    }
    Ok(Exit::Complete)
}

/// The spline; thousands of points are solved for by iteration, which Ctrl-C ends with what there is.
fn fit<const D: usize, K: Kernel>(
    context: &Context,
    clock: Bar,
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    options: &FitOptions<f64, K>,
) -> Result<ThinPlateSpline<f64, D, K>, TpsError> {
    let interrupt = &context.interrupt;
    let job = fitting(sources.len());
    let mut clock = Some(clock);
    let mut preparing: Option<Bar> = None;
    let mut iterating: Option<Bar> = None;
    let mut first = None;
    let spline = ThinPlateSpline::fit_watched(sources, targets, options, |progress| {
        // From here on Ctrl-C is looked at; before, it ends the program.
        interrupt.hear(true);
        clock = None;
        match progress.residual {
            None => preparing
                .get_or_insert_with(|| Bar::of(progress.total, format!("{job}: preparing")))
                .done(progress.done),
            Some(residual) => {
                let first = *first.get_or_insert(residual);
                preparing = None;
                iterating
                    .get_or_insert_with(|| Bar::of(DIGITS, format!("{job}: iterating")))
                    .done(digits(first, residual));
            }
        }
        if interrupt.requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    interrupt.hear(false);
    spline
}

fn fitting(points: usize) -> String {
    format!("fitting {}", count(points, "point"))
}

/// Steps of the bar of an iteration.
const DIGITS: usize = 1000;

/// How much of the way from the `first` residual to the tolerance is done, in digits: conjugate gradients gain about as many in every step.
fn digits(first: f64, residual: f64) -> usize {
    let (first, now, end) = (first.ln(), residual.ln(), TOLERANCE.ln());
    let part = (first - now) / (first - end);
    (DIGITS as f64 * part.clamp(0.0, 1.0)) as usize
}

/// Kernels between two looks at the clock and at Ctrl-C.
const KERNELS: usize = 1 << 26;

/// Values and Jacobians at the queries; how many there are after Ctrl-C.
fn evaluate<const D: usize, K: Kernel>(
    context: &Context,
    spline: &ThinPlateSpline<f64, D, K>,
    queries: &[Point<f64, D>],
    values: &mut [Point<f64, D>],
    jacobians: &mut [SMatrix<f64, D, D>],
) -> Result<usize, Failure> {
    let interrupt = &context.interrupt;
    interrupt.hear(true);
    let job = format!("warping {}", count(queries.len(), "point"));
    let mut bar = Bar::of(queries.len(), job);
    let run = (KERNELS / spline.report.points.max(1)).max(1);
    let mut done = 0;
    let parts = queries.chunks(run).zip(values.chunks_mut(run));
    for ((queries, values), jacobians) in parts.zip(jacobians.chunks_mut(run)) {
        (spline.apply_and_jacobian_into(queries, values, jacobians)).map_err(Failure::no_answer)?;
        done += queries.len();
        bar.done(done);
        if interrupt.requested() {
            break;
        }
    }
    interrupt.hear(false);
    Ok(done)
}

/// The error with the file it is about.
fn in_files(arguments: &Arguments, error: TpsError) -> String {
    let sources = arguments.sources.display();
    let targets = arguments.targets.display();
    match error {
        TpsError::Length {
            expected, found, ..
        } => format!(
            "{targets}: expected {}, as many as {sources} has, found {found}",
            count(expected, "row")
        ),
        TpsError::Stopped => {
            "stopped before there was a spline: the points were still being prepared".to_owned()
        }
        TpsError::Conflict { first, second } => format!(
            "{sources}: points {} and {} coincide but their targets in {targets} differ: smooth with --lambda, or drop one",
            first + 1,
            second + 1,
        ),
        TpsError::NotFinite {
            input: "target points",
            ..
        } => format!("{targets}: {error}"),
        error => format!("{sources}: {error}"),
    }
}

/// Columns fx, fy, …, dfx_dx, dfx_dy, …
fn table<const D: usize>(values: &[Point<f64, D>], jacobians: &[SMatrix<f64, D, D>]) -> Vec<u8> {
    let axes = &["x", "y", "z"][..D];
    let mut header: Vec<String> = axes.iter().map(|i| format!("f{i}")).collect();
    for i in axes {
        header.extend(axes.iter().map(|j| format!("df{i}_d{j}")));
    }
    let mut csv = Csv::new(&header);
    for (value, jacobian) in values.iter().zip(jacobians) {
        let transposed = jacobian.transpose();
        csv.row(value.iter().chain(transposed.iter()));
    }
    csv.into_bytes()
}
