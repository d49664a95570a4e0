//! `tactile match`: the point sets of case files.
use crate::arguments::{Repetition, TableArguments, positive};
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::text::{count, four_digits, printable};
use clap::{Args, ValueEnum};
use nalgebra::Point;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::io::Write as _;
use std::path::PathBuf;
use tactile_files::io::{
    CasePoints, MatchCase, PointTable, read_bytes, read_cases, write_case_result,
};
use tactile_imaging::PairsDoubt;
use tactile_imaging::matching::{
    AnnealedSoftassign, CoherentPointDrift, FittedTransformation, Judgement, LatticeStep,
    LinearAssignment, NearestNeighbour, Outliers, PointMatcher, RelaxationLabelling, Rotation,
    StopReason, Transformation,
};

/// Match the points of two sets, in the plane or in space
///
/// Two tables of points (columns x, y and z if there is one) are one case.
///
/// A case file holds one or more cases: a line `case NAME D n_model n_target`, then rows `m` (a
/// model point) and `t` (a target point) with D coordinates. --out gets one file per case file,
/// under the same name. A result is `case NAME time_ms`, then for every model row its warped
/// position (`w`) and its assigned target row (`a`, -1 for none).
#[derive(Args)]
#[command(
    after_help = "Examples:\n  tactile match examples/data/cases.txt --out target/match\n  \
                        tactile match examples/data/before.csv examples/data/after.csv"
)]
pub(crate) struct MatchArguments {
    /// Case files, or two tables of points.
    #[arg(required = true)]
    cases: Vec<PathBuf>,
    #[command(flatten)]
    expectations: Expectations,
    /// The matcher.
    #[arg(long, value_enum, default_value_t = Method::Softassign)]
    method: Method,
    #[command(flatten)]
    repetition: Repetition,
    #[command(flatten)]
    table: TableArguments,
}

/// The prior knowledge of the sets.
#[derive(Args, Clone, Copy)]
pub(crate) struct Expectations {
    /// How far the target may be rotated relative to the model.
    #[arg(long, value_enum, default_value_t = Turn::Limited)]
    rotation: Turn,
    /// Which set has points without a partner in the other.
    #[arg(long, value_enum, default_value_t = Unmatched::Both)]
    outliers: Unmatched,
    /// The deformation: smooth, or a single map whose parameters are printed.
    #[arg(long, value_enum, default_value_t = Change::Smooth)]
    transformation: Change,
    /// The largest motion of a point, in the unit of the points. For a lattice that continues
    /// beyond the view, it excludes matches that are shifted by a lattice vector.
    #[arg(long, value_name = "LENGTH", value_parser = positive)]
    largest_motion: Option<f64>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Turn {
    Limited,
    Any,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Change {
    /// Rotate and shift.
    Rigid,
    /// Rotate, shift and scale.
    Similarity,
    /// Any affine map.
    Affine,
    /// Smooth deformation.
    Smooth,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Unmatched {
    Both,
    Model,
    Target,
    None,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Annealed softassign, the default matcher.
    Softassign,
    /// The paper's relaxation labelling as printed, which is slow.
    Labelling,
    /// Relaxation labelling over ten candidates per point.
    SparseLabelling,
    /// Coherent point drift.
    Drift,
    /// The nearest target point for each model point.
    Nearest,
    /// The cheapest one-to-one assignment by distance.
    Assignment,
}

impl Expectations {
    /// The default matcher with these expectations.
    pub(crate) fn matcher(self) -> AnnealedSoftassign {
        let rotation = match self.rotation {
            Turn::Limited => Rotation::Limited,
            Turn::Any => Rotation::Any,
        };
        let outliers = match self.outliers {
            Unmatched::Both => Outliers::Both,
            Unmatched::Model => Outliers::Model,
            Unmatched::Target => Outliers::Target,
            Unmatched::None => Outliers::None,
        };
        let transformation = match self.transformation {
            Change::Rigid => Transformation::Rigid,
            Change::Similarity => Transformation::Similarity,
            Change::Affine => Transformation::Affine,
            Change::Smooth => Transformation::Smooth,
        };
        let matcher = AnnealedSoftassign::default()
            .with_rotation(rotation)
            .with_outliers(outliers)
            .with_transformation(transformation);
        match self.largest_motion {
            Some(motion) => matcher
                .with_largest_motion(motion)
                .expect("a positive length"),
            None => matcher,
        }
    }
}

impl Method {
    fn matcher<const D: usize>(self, expectations: Expectations) -> Box<dyn PointMatcher<D>> {
        match self {
            Self::Softassign => Box::new(expectations.matcher()),
            Self::Labelling => Box::new(RelaxationLabelling::default()),
            Self::SparseLabelling => {
                let options = RelaxationLabelling::default().with_candidates(10);
                Box::new(options.expect("some candidates"))
            }
            Self::Drift => Box::new(CoherentPointDrift::default()),
            Self::Nearest => Box::new(NearestNeighbour::default()),
            Self::Assignment => Box::new(LinearAssignment::default()),
        }
    }
}

/// Refuses sets whose table of candidates does not fit into memory.
pub(crate) fn allow(
    context: &Context,
    model: usize,
    target: usize,
    remedy: &str,
) -> Result<(), Failure> {
    let (model_points, targets) = (model as f64, target as f64);
    // The scores of all candidates take 4.5 bytes for every pair of a model and a target point.
    // Sets of 4,000 points and more are matched coarse to fine, and 3 to 8 kB per point were
    // measured there.
    let bytes = if model.min(target) < 4000 {
        4.5 * model_points * targets
    } else {
        2250.0 * (model_points + targets)
    };
    let job = format!("matching {model} points to {target}");
    context.allow(bytes, &job, remedy)
}

pub(crate) fn run(arguments: &MatchArguments, context: &mut Context) -> Result<Exit, Failure> {
    let Expectations {
        rotation,
        outliers,
        transformation,
        largest_motion,
    } = arguments.expectations;
    let expected = rotation != Turn::Limited
        || outliers != Unmatched::Both
        || transformation != Change::Smooth
        || largest_motion.is_some();
    if arguments.method != Method::Softassign && expected {
        return Err(Failure::input(
            "--rotation, --outliers, --transformation and --largest-motion apply to the method \
             softassign alone: omit them, or omit --method",
        ));
    }
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_owned();
    let tables = are_tables(&arguments.cases)?;
    let mut names: Vec<OsString> = arguments.cases.iter().map(name).collect();
    if tables {
        names = vec![OsString::from(TABLES_ANSWER)];
    }
    context.outputs.plan(&names, &arguments.cases)?;
    // All files are read before the first case is matched, so that a mistake in the last file is
    // found at once.
    let mut files = Vec::new();
    let read = if tables {
        vec![vec![case_of_tables(arguments, context)?]]
    } else {
        let cases = arguments.cases.iter().map(read_cases);
        cases.collect::<Result<Vec<_>, _>>()?
    };
    for cases in read {
        for case in &cases {
            let (model, target) = match &case.points {
                CasePoints::Plane { model, target } => (model.len(), target.len()),
                CasePoints::Space { model, target } => (model.len(), target.len()),
            };
            allow(context, model, target, "give fewer points")?;
        }
        files.push(cases);
    }
    let (mut answers, mut interrupted) = (Vec::new(), false);
    for (name, cases) in names.iter().zip(files) {
        let mut text = Vec::new();
        for case in cases {
            let solved = match case.points {
                CasePoints::Plane { model, target } => {
                    solve(arguments, context, &case.name, model, target, &mut text)
                }
                CasePoints::Space { model, target } => {
                    solve(arguments, context, &case.name, model, target, &mut text)
                }
            };
            interrupted = solved.is_none();
            answers.extend(solved);
            if interrupted {
                break;
            }
        }
        // The finished cases are written. The file names them.
        context.outputs.add(name, text);
        if interrupted {
            break;
        }
    }
    let complete = answers.iter().all(|answer| answer.get("error").is_none());
    context.value(&json!({ "cases": answers }));
    Ok(if interrupted {
        Exit::Interrupted
    } else {
        Exit::complete_if(complete)
    })
}

/// Matches one case, prints a line about it, appends its result to `text` and returns it as JSON.
/// `None` after Ctrl-C.
fn solve<const D: usize>(
    arguments: &MatchArguments,
    context: &mut Context,
    case: &str,
    model: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
    text: &mut Vec<u8>,
) -> Option<Value> {
    let name = printable(case);
    let (points, targets) = (model.len(), target.len());
    let job = format!("matching {name}: {points} points to {targets}");
    let repetition = arguments.repetition;
    let (method, expectations) = (arguments.method, arguments.expectations);
    let answer = context.wait(job, |interrupt| {
        let matcher = method.matcher(expectations);
        repetition.timed(interrupt, || {
            matcher.match_watched(&model, &target, &mut || interrupt.flow())
        })
    })?;
    let (matching, ms) = match answer {
        Ok(answer) => answer,
        Err(error) => {
            context.line(format_args!("{name}: no answer: {error}"));
            // Writing to memory cannot fail, here and below.
            let _ = writeln!(text, "# {name}: no answer: {error}");
            return Some(json!({ "case": case, "error": error.to_string() }));
        }
    };
    let report = &matching.report;
    let (iterations, starts) = (report.iterations, report.starts);
    let matched = matching.assignment.iter().flatten().count();
    let stop = stop_reason(report.stop);
    let found = format!(
        "{matched} of {points} points matched, residual {}, {stop} after {} and {}",
        four_digits(report.residual),
        count(iterations, "iteration"),
        count(starts, "start")
    );
    context.aside(format_args!("{name}: {found}, {ms:.1} ms"));
    if let Some(report) = &mut context.outputs.report {
        report.row(&name, &found);
    }
    if let Some(step) = report.period {
        context.aside(format_args!("{name}: {}", smallest_motion(step)));
    }
    let doubt = report
        .doubt()
        .map(|doubt| PairsDoubt::Matcher(doubt).to_string());
    if let Some(doubt) = &doubt {
        context.warn(
            "doubtful_pairs",
            json!({ "case": name }),
            format_args!("{name}: {doubt}"),
        );
    }
    let _ = writeln!(
        text,
        "# {name}: {stop} after {iterations} iterations, starts: {starts}, residual {:.3e}",
        report.residual
    );
    let _ = write_case_result(text, case, ms, &matching.warped, &matching.assignment);
    let transformation = matching.transformation.as_ref().map(|found| {
        context.aside(format_args!("{name}: {}", described(found)));
        parameters(found)
    });
    let mut value = json!({
        "model_points": points, "target_points": targets, "matched": matched,
        "assignment": matching.assignment, "confidence": matching.confidence,
        "unmatched_share": 1.0 - matched as f64 / points as f64,
        "residual": report.residual, "noise": report.sigma, "stop": stop, "doubt": doubt,
        "period": report.period.map(|step| step.0[..D].to_vec()),
        "judged": report.judgement != Judgement::NotJudged,
        "iterations": iterations, "starts": starts, "time_ms": ms,
    });
    if let Some(transformation) = transformation {
        value["transformation"] = transformation;
    }
    Some(json!({ "case": case, "match": value }))
}

/// What a match of two sets that repeat assumes.
pub(crate) fn smallest_motion(step: LatticeStep) -> String {
    format!("{step}: assumed is the smallest motion (--largest-motion bounds it)")
}

/// Rotation, scale and shift of a map with their standard errors, in words.
fn described<const D: usize>(found: &FittedTransformation<D>) -> String {
    let pair = |value: f64, error: f64| format!("{} ± {}", four_digits(value), four_digits(error));
    let degrees = |k: usize| {
        pair(
            found.rotation[k].to_degrees(),
            found.rotation_error[k].to_degrees(),
        )
    };
    let turn: Vec<_> = (if D == 2 { 2..3 } else { 0..3 }).map(degrees).collect();
    let shift: Vec<_> = (0..D)
        .map(|k| pair(found.shift[k], found.shift_error[k]))
        .collect();
    format!(
        "turned by ({}) degrees, scale {}, shift ({})",
        turn.join(", "),
        pair(found.scale, found.scale_error),
        shift.join(", ")
    )
}

/// The parameters of a map as JSON, with its matrix by rows.
fn parameters<const D: usize>(found: &FittedTransformation<D>) -> Value {
    let row = |r: usize| (0..D).map(|c| found.linear[(r, c)]).collect::<Vec<_>>();
    let matrix: Vec<_> = (0..D).map(row).collect();
    json!({
        "matrix": matrix,
        "shift": found.shift.as_slice(), "shift_error": found.shift_error.as_slice(),
        "scale": found.scale, "scale_error": found.scale_error,
        "rotation_deg": found.rotation.map(f64::to_degrees).as_slice(),
        "rotation_error_deg": found.rotation_error.map(f64::to_degrees).as_slice(),
    })
}

/// The result file for two tables.
const TABLES_ANSWER: &str = "match.txt";

/// Whether these are two tables of points, neither of which has the first line of a case.
fn are_tables(paths: &[PathBuf]) -> Result<bool, Failure> {
    if paths.len() != 2 {
        return Ok(false);
    }
    for path in paths {
        let bytes = read_bytes(path)?;
        let mut lines = bytes.split(|byte| *byte == b'\n');
        if lines.any(|line| line.trim_ascii_start().starts_with(b"case ")) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Reads two tables as one case.
fn case_of_tables(arguments: &MatchArguments, context: &mut Context) -> Result<MatchCase, Failure> {
    let paths = &arguments.cases;
    let mut tables = arguments
        .table
        .read_points(paths, [false; 2], context)?
        .frames;
    if tables.len() > 2 {
        return Err(Failure::input(
            "a table holds several frames: `tactile strain` follows them",
        ));
    }
    let mut next = || tables.pop().map(|table| table.points.points);
    let (target, model) = (next(), next());
    let points = match (model, target) {
        (Some(PointTable::Plane(model)), Some(PointTable::Plane(target))) => {
            CasePoints::Plane { model, target }
        }
        (Some(PointTable::Space(model)), Some(PointTable::Space(target))) => {
            CasePoints::Space { model, target }
        }
        _ => {
            return Err(Failure::input(
                "both tables must have two coordinates per point, or both three",
            ));
        }
    };
    let name = |path: &PathBuf| {
        path.file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let name = format!("{}-{}", name(&paths[0]), name(&paths[1])).replace(' ', "_");
    Ok(MatchCase { name, points })
}

fn stop_reason(stop: StopReason) -> &'static str {
    match stop {
        StopReason::Converged => "converged",
        StopReason::Exact => "exact",
        StopReason::IterationLimit => "stopped at the limit",
        StopReason::Cancelled => "stopped by the caller",
        StopReason::Degenerate => "degenerate points",
        _ => "stopped",
    }
}
