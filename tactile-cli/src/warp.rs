//! `tactile warp`: a thin-plate spline through pairs of points.
use crate::arguments::{Repetition, TableArguments};
use crate::console::{Bar, Context, median_ms};
use crate::failure::{Exit, Failure};
use crate::outputs::Csv;
use crate::text::{count, four_digits};
use clap::{Args, ValueEnum};
use nalgebra::{Point, SMatrix};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;
use tactile_files::io::PointTable;
use tactile_imaging::tps::{
    FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, ThinPlateSpline, TpsError,
};

/// Fit a thin-plate spline to pairs of points and warp other points by it
///
/// The files are CSV with one point per row: columns x, y and, in space, z, identified by name if
/// there is a header. Row i of TARGETS is the image of row i of SOURCES. λ is the weight of the
/// bending energy wᵀKw relative to the squared distances to the targets; with 0 the spline passes
/// through every target. --out gets warped.csv: fx, fy (and fz) and the Jacobian dfx_dx,dfx_dy,… at
/// every query.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile warp examples/data/sources.csv examples/data/targets.csv examples/data/queries.csv \
                        --lambda gcv
  tactile warp examples/data/sources.csv examples/data/targets.csv examples/data/queries.csv \
                        --kernel r --out target/warp")]
pub(crate) struct WarpArguments {
    /// Source points.
    sources: PathBuf,
    /// Target points.
    targets: PathBuf,
    /// Points to warp.
    queries: PathBuf,
    /// U(r): r² ln r (the thin plate of the plane, the default there), r³ (the default in space) or
    /// −r (the thin plate of space).
    #[arg(long, value_enum)]
    kernel: Option<KernelName>,
    /// Smoothing parameter: a number of at least zero, or gcv for the minimum of generalised
    /// cross-validation.
    #[arg(long, value_name = "X|gcv", default_value = "0", value_parser = smoothing,
          allow_negative_numbers = true)]
    lambda: Smoothing,
    #[command(flatten)]
    repetition: Repetition,
    #[command(flatten)]
    table: TableArguments,
}

#[derive(Clone, Copy, ValueEnum)]
enum KernelName {
    /// r² ln r, half of r² log r²: the same splines, and with λ half of the other's the same
    /// smoothing.
    #[value(name = "r2logr", alias = "r2logr2")]
    R2logr,
    /// −r.
    R,
    /// r³.
    R3,
}

fn smoothing(text: &str) -> Result<Smoothing, String> {
    if text.eq_ignore_ascii_case("gcv") {
        return Ok(Smoothing::Gcv);
    }
    match text.parse::<f64>() {
        Ok(0.0) => Ok(Smoothing::None),
        Ok(lambda) if lambda > 0.0 && lambda.is_finite() => Ok(Smoothing::Lambda(lambda)),
        _ => Err("expected a finite number of at least zero, or gcv".to_owned()),
    }
}

/// Residual of an iterative fit, relative to the largest target, below which the digits of a CSV
/// file hardly change.
const TOLERANCE: f64 = 1e-10;

pub(crate) fn run(arguments: &WarpArguments, context: &mut Context) -> Result<Exit, Failure> {
    let inputs = [&arguments.sources, &arguments.targets, &arguments.queries];
    context.outputs.plan(&["warped.csv"], &inputs)?;
    let mut tables = arguments
        .table
        .read_points(&inputs, [false; 2], context)?
        .frames;
    let [sources, targets, queries] = inputs.map(|path| path.display());
    if tables.len() != inputs.len() {
        return Err(Failure::input(format!(
            "one of {sources}, {targets} and {queries} holds several frames: give a table of one"
        )));
    }
    let sets = tables.split_at_mut(1);
    sets.0[0].points.keep_shared_rows(&mut sets.1[0].points);
    let tables: Vec<PointTable> = tables
        .into_iter()
        .map(|table| table.points.points)
        .collect();
    match &tables[..] {
        [
            PointTable::Plane(a),
            PointTable::Plane(b),
            PointTable::Plane(q),
        ] => with_kernel(arguments, context, [a, b, q]),
        [
            PointTable::Space(a),
            PointTable::Space(b),
            PointTable::Space(q),
        ] => with_kernel(arguments, context, [a, b, q]),
        _ => Err(Failure::input(format!(
            "{sources}, {targets} and {queries} must all have two coordinates per point, or all \
                 three"
        ))),
    }
}

/// Sources, targets and queries.
type Sets<'a, const D: usize> = [&'a [Point<f64, D>]; 3];

fn with_kernel<const D: usize>(
    arguments: &WarpArguments,
    context: &mut Context,
    sets: Sets<'_, D>,
) -> Result<Exit, Failure> {
    // In space the gradient of −r has cusps, and r³ is closer to smooth maps by a factor of three
    // to five (`cargo bench -p tactile-benches --bench work_precision`).
    let usual = if D == 2 {
        KernelName::R2logr
    } else {
        KernelName::R3
    };
    match arguments.kernel.unwrap_or(usual) {
        KernelName::R2logr => warp(arguments, context, R2LogR, sets),
        KernelName::R => warp(arguments, context, NegR, sets),
        KernelName::R3 => warp(arguments, context, R3, sets),
    }
}

fn warp<const D: usize, K: Kernel>(
    arguments: &WarpArguments,
    context: &mut Context,
    kernel: K,
    sets: Sets<'_, D>,
) -> Result<Exit, Failure> {
    let [sources, targets, queries] = sets;
    // Cross-validation is direct for any number of points: it needs the eigenvalues of a dense
    // matrix.
    if matches!(arguments.lambda, Smoothing::Gcv) {
        let n = sources.len() as f64;
        let job = format!("cross-validation with {} points", sources.len());
        context.allow(24.0 * n * n, &job, "give --lambda a number")?;
    }
    let options = FitOptions::new(kernel)
        .with_smoothing(arguments.lambda)
        .and_then(|options| options.with_tolerance(TOLERANCE))
        .map_err(Failure::input)?;
    let (mut fit_times, mut evaluate_times) = (Vec::new(), Vec::new());
    let mut values = vec![Point::origin(); queries.len()];
    let mut jacobians = vec![SMatrix::zeros(); queries.len()];
    let mut warped = 0;
    let (spline, _) = arguments.repetition.timed(&context.interrupt, || {
        let start = Instant::now();
        let spline = fit(context, sources, targets, &options)
            .map_err(|error| Failure::input(in_files(arguments, error)))?;
        fit_times.push(start.elapsed());
        let start = Instant::now();
        warped = evaluate(context, &spline, queries, &mut values, &mut jacobians)?;
        evaluate_times.push(start.elapsed());
        Ok::<_, Failure>(spline)
    })?;
    let [fit_ms, evaluate_ms] = [fit_times, evaluate_times].map(median_ms);
    let report = &spline.report;
    // As much work as a step of the iteration, and not needed after Ctrl-C.
    let bending_energy = (!context.interrupt.requested()).then(|| {
        let _clock = Bar::clock("computing the bending energy");
        spline.bending_energy()
    });
    if report.rank <= D {
        let spanned = report.rank - 1;
        context.warn(
            "undetermined_directions",
            json!({ "spanned": spanned, "of": D }),
            format_args!(
                "the sources span {spanned} of {D} directions; displacements are interpolated \
                 along these, and lengths across stay unchanged"
            ),
        );
    }
    context.value(&json!({
        "points": report.points, "queries": warped, "lambda": report.lambda,
        "bending_energy": bending_energy, "condition": report.condition, "rank": report.rank,
        "merged": report.merged, "extents": report.extents, "residual": report.residual,
        "digits": report.digits,
        "iterations": report.iterations, "converged": report.converged(), "fit_ms": fit_ms,
        "evaluate_ms": evaluate_ms,
    }));
    context.row(
        "points",
        format_args!("{} ({} merged)", report.points, report.merged),
    );
    context.row("smoothing λ", four_digits(report.lambda));
    if let Some(energy) = bending_energy {
        context.row("bending energy", four_digits(energy));
    }
    if let Some(residual) = report.residual {
        context.row(
            "residual",
            format_args!("{residual:.1e} of the largest target"),
        );
    }
    let (condition, digits) = (report.condition, report.digits);
    context.row(
        "condition",
        format_args!("{condition:.1e}, about {digits:.0} digits left"),
    );
    let evaluations = count(warped, "evaluation");
    let text = format!("fit {fit_ms:.2} ms, {evaluations} {evaluate_ms:.2} ms");
    context.row("time", text);
    context
        .outputs
        .add("warped.csv", table(&values[..warped], &jacobians[..warped]));
    if !report.converged() {
        context.note(
            "the iteration was stopped before it reached its tolerance; the residual shows how far \
             it came",
        );
    }
    if warped < queries.len() {
        let all = queries.len();
        context.note(format_args!(
            "stopped after {warped} of {all} points to warp"
        ));
    }
    Ok(Exit::complete_if(report.converged()))
}

/// The spline. Thousands of points are solved for by iteration. Ctrl-C stops it with the spline so
/// far.
fn fit<const D: usize, K: Kernel>(
    context: &Context,
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    options: &FitOptions<K>,
) -> Result<ThinPlateSpline<D, K>, TpsError> {
    let interrupt = &context.interrupt;
    let job = format!("fitting {}", count(sources.len(), "point"));
    // A direct solution does not report its progress.
    let mut clock = Some(Bar::clock(job.clone()));
    let mut preparing: Option<Bar> = None;
    let mut iterating: Option<Bar> = None;
    let mut first = None;
    let spline = ThinPlateSpline::fit_watched(sources, targets, options, |progress| {
        // From here on Ctrl-C is polled; before, it ends the program.
        interrupt.polled(true);
        clock = None;
        match progress.residual {
            None => preparing
                .get_or_insert_with(|| Bar::of(progress.total, format!("{job}: preparing")))
                .done(progress.done),
            Some(residual) => {
                let first = *first.get_or_insert(residual);
                preparing = None;
                // Conjugate gradients gain about as many digits in every step, so the progress is
                // counted in digits.
                let part = (first / residual).ln() / (first / TOLERANCE).ln();
                iterating
                    .get_or_insert_with(|| Bar::of(1000, format!("{job}: iterating")))
                    .done((1000.0 * part.clamp(0.0, 1.0)) as usize);
            }
        }
        interrupt.flow()
    });
    interrupt.polled(false);
    spline
}

/// Values and Jacobians at the queries. After Ctrl-C, the number of completed queries.
fn evaluate<const D: usize, K: Kernel>(
    context: &Context,
    spline: &ThinPlateSpline<D, K>,
    queries: &[Point<f64, D>],
    values: &mut [Point<f64, D>],
    jacobians: &mut [SMatrix<f64, D, D>],
) -> Result<usize, Failure> {
    let interrupt = &context.interrupt;
    interrupt.polled(true);
    let job = format!("warping {}", count(queries.len(), "point"));
    let mut bar = Bar::of(queries.len(), job);
    // 2^26 kernels take about a second, the longest delay after Ctrl-C.
    let run = ((1 << 26) / spline.report.points.max(1)).max(1);
    let mut done = 0;
    let parts = queries.chunks(run).zip(values.chunks_mut(run));
    for ((queries, values), jacobians) in parts.zip(jacobians.chunks_mut(run)) {
        let applied = spline.apply_and_jacobian_into(queries, values, jacobians);
        applied.map_err(Failure::no_answer)?;
        done += queries.len();
        bar.done(done);
        if interrupt.requested() {
            break;
        }
    }
    interrupt.polled(false);
    Ok(done)
}

/// The error with its file.
fn in_files(arguments: &WarpArguments, error: TpsError) -> String {
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
            "{sources}: points {} and {} coincide but their targets in {targets} differ: smooth \
             with --lambda, or drop one",
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
    let mut csv = Csv::new(&header.join(","));
    for (value, jacobian) in values.iter().zip(jacobians) {
        let transposed = jacobian.transpose();
        csv.row(value.iter().chain(transposed.iter()));
    }
    csv.into_bytes()
}
