//! `tactile match`: the point sets of case files.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::{count, four_digits, median_ms};
use crate::outputs::Outputs;
use crate::progress::waiting_or_interrupted;
use clap::{Args, ValueEnum};
use nalgebra::Point;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tactile_imaging::io::{CasePoints, MatchCase, read_cases, write_case_result};
use tactile_imaging::matching::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, MatchError, Matching,
    NearestNeighbour, Outliers, PointMatcher, RelaxationLabelling, Rotation, StopReason,
};

/// Match the points of two sets, in the plane or in space
///
/// A case file holds one or more cases: a line `case NAME D n_model n_target`, then rows `m` (a model point) and `t` (a
/// target point) with D coordinates. The answers go to --out, a file for each case file under the same name: `case NAME
/// time_ms`, then for every model row its warped position (`w`) and the target row assigned to it (`a`, -1 for none).
#[derive(Args)]
#[command(after_help = "Example:\n  tactile match examples/data/cases.txt --out target/match")]
pub struct Arguments {
    /// Case files.
    #[arg(required = true)]
    cases: Vec<PathBuf>,
    /// Folder for the answers, a file for each case file.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    expectations: Expectations,
    /// The matcher.
    #[arg(long, value_enum, default_value_t = Method::Softassign)]
    method: Method,
    /// Calls for each case; the median of their times is given.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
}

/// What is known of the sets beforehand.
#[derive(Args, Clone, Copy)]
pub struct Expectations {
    /// How far the target may be turned against the model.
    #[arg(long, value_enum, default_value_t = Turn::Limited)]
    rotation: Turn,
    /// Which set has points without a partner in the other.
    #[arg(long, value_enum, default_value_t = Unmatched::Both)]
    outliers: Unmatched,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Turn {
    Limited,
    Any,
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
    /// The paper's relaxation labelling as printed: slow.
    Labelling,
    /// The same over ten candidates for each point.
    SparseLabelling,
    /// Coherent point drift.
    Drift,
    /// Each model point to the nearest target point.
    Nearest,
    /// The cheapest one-to-one assignment by distance.
    Assignment,
}

impl Expectations {
    /// The default matcher with these.
    pub fn matcher(self) -> AnnealedSoftassign {
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
        AnnealedSoftassign::default()
            .with_rotation(rotation)
            .with_outliers(outliers)
    }

    fn are_default(self) -> bool {
        self.rotation == Turn::Limited && self.outliers == Unmatched::Both
    }
}

/// What is done with one case.
#[derive(Clone, Copy)]
struct Job<'a> {
    name: &'a str,
    method: Method,
    expectations: Expectations,
    repeat: u32,
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

/// Bytes that matching takes for every pair of a model and a target point: the scores of all candidates.
const BYTES_OF_A_PAIR: f64 = 4.5;

/// Refuses sets whose table of candidates does not fit into memory.
pub fn allow(context: &Context, model: usize, target: usize, remedy: &str) -> Result<(), Failure> {
    context.memory.allow(
        BYTES_OF_A_PAIR * model as f64 * target as f64,
        &format!("matching {model} points to {target}"),
        remedy,
    )
}

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    if arguments.method != Method::Softassign && !arguments.expectations.are_default() {
        return Err(Failure::input(
            "--rotation and --outliers apply to the method softassign alone: leave out --method or them",
        ));
    }
    let names: Vec<OsString> = (arguments.cases.iter())
        .map(|path| path.file_name().unwrap_or_default().to_owned())
        .collect();
    let inputs: Vec<&Path> = arguments.cases.iter().map(PathBuf::as_path).collect();
    let mut outputs = Outputs::plan(arguments.out.as_deref(), &names, &inputs)?;
    // All files are read before the first case is matched, so that a mistake in the last costs no time.
    let mut files = Vec::new();
    for path in &arguments.cases {
        let cases = read_cases(path)?;
        for case in &cases {
            let (model, target) = sizes(case);
            allow(context, model, target, "give fewer points")?;
        }
        files.push(cases);
    }
    let mut exit = Exit::Complete;
    let mut answers = Vec::new();
    'files: for (name, cases) in names.iter().zip(files) {
        let mut text = Vec::new();
        for case in cases {
            let job = Job {
                name: &case.name,
                method: arguments.method,
                expectations: arguments.expectations,
                repeat: arguments.repeat,
            };
            let solved = match case.points {
                CasePoints::Plane { model, target } => job.solve(context, model, target, &mut text),
                CasePoints::Space { model, target } => job.solve(context, model, target, &mut text),
            };
            let Some((answer, complete)) = solved else {
                exit = Exit::Interrupted;
                outputs.write(name, &text)?;
                break 'files;
            };
            answers.push(answer);
            if !complete {
                exit = Exit::Partial;
            }
        }
        outputs.write(name, &text)?;
    }
    context.console.value(&json!({ "cases": answers }));
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(exit)
}

fn sizes(case: &MatchCase) -> (usize, usize) {
    match &case.points {
        CasePoints::Plane { model, target } => (model.len(), target.len()),
        CasePoints::Space { model, target } => (model.len(), target.len()),
    }
}

impl Job<'_> {
    /// Matches one case, prints a line about it, appends its answer to `text`; whether there is one. None after Ctrl-C.
    fn solve<const D: usize>(
        self,
        context: &mut Context,
        model: Vec<Point<f64, D>>,
        target: Vec<Point<f64, D>>,
        text: &mut Vec<u8>,
    ) -> Option<(Value, bool)> {
        let name = self.name;
        let (points, targets) = (model.len(), target.len());
        let job = format!("matching {name}: {points} points to {targets}");
        let Self {
            method,
            expectations,
            repeat,
            ..
        } = self;
        let answer = waiting_or_interrupted(job, &context.interrupt, move || {
            repeated(&*method.matcher(expectations), repeat, &model, &target)
        })?;
        Some(match answer {
            Ok((matching, ms)) => {
                let report = &matching.report;
                let matched = matching.assignment.iter().flatten().count();
                let stop = stop_reason(report.stop);
                context.console.line(format!(
                    "{name}: {matched} of {points} points matched, residual {}, {stop} after {} and {}, {ms:.1} ms",
                    four_digits(report.residual),
                    count(report.iterations, "iteration"),
                    count(report.starts, "start")
                ));
                // Writing into memory does not fail.
                let _ = writeln!(
                    text,
                    "# {name}: {stop} after {} iterations, starts: {}, residual {:.3e}",
                    report.iterations, report.starts, report.residual
                );
                let _ = write_case_result(text, name, ms, &matching.warped, &matching.assignment);
                let value = json!({
                    "model_points": points, "target_points": targets, "matched": matched,
                    "assignment": matching.assignment, "confidence": matching.confidence,
                    "residual": report.residual, "noise": report.sigma, "stop": stop,
                    "iterations": report.iterations, "starts": report.starts, "time_ms": ms,
                });
                (json!({ "case": name, "value": value }), true)
            }
            Err(error) => {
                context.console.line(format!("{name}: no answer: {error}"));
                let _ = writeln!(text, "# {name}: no answer: {error}");
                (json!({ "case": name, "error": error.to_string() }), false)
            }
        })
    }
}

/// The answer, and the median time of the calls in milliseconds.
fn repeated<const D: usize>(
    matcher: &dyn PointMatcher<D>,
    repeat: u32,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
) -> Result<(Matching<D>, f64), MatchError> {
    let timed = || -> Result<(Matching<D>, Duration), MatchError> {
        let start = Instant::now();
        let matching = matcher.match_points(model, target)?;
        Ok((matching, start.elapsed()))
    };
    let (mut matching, first) = timed()?;
    let mut times = vec![first];
    for _ in 1..repeat {
        let (again, time) = timed()?;
        matching = again;
        times.push(time);
    }
    Ok((matching, median_ms(&mut times)))
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
