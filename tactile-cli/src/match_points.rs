//! `tactile match`: the point sets of case files.
use crate::arguments::{Repetition, positive};
use crate::console::{Context, Exit, Failure, count, four_digits, printable};
use clap::{Args, ValueEnum};
use nalgebra::Point;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::io::Write as _;
use std::path::PathBuf;
use tactile_files::io::{CasePoints, read_cases, write_case_result};
use tactile_imaging::PairsDoubt;
use tactile_imaging::matching::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, NearestNeighbour, Outliers,
    PointMatcher, RelaxationLabelling, Rotation, StopReason,
};

/// Match the points of two sets, in the plane or in space
///
/// A case file holds one or more cases: a line `case NAME D n_model n_target`, then rows `m` (a
/// model point) and `t` (a target point) with D coordinates. The answers go to --out, a file for
/// each case file under the same name: `case NAME time_ms`, then for every model row its warped
/// position (`w`) and the target row assigned to it (`a`, -1 for none).
#[derive(Args)]
#[command(after_help = "Example:\n  tactile match examples/data/cases.txt --out target/match")]
pub struct MatchArguments {
    /// Case files.
    #[arg(required = true)]
    cases: Vec<PathBuf>,
    #[command(flatten)]
    expectations: Expectations,
    /// The matcher.
    #[arg(long, value_enum, default_value_t = Method::Softassign)]
    method: Method,
    #[command(flatten)]
    repetition: Repetition,
}

/// The prior knowledge of the sets.
#[derive(Args, Clone, Copy)]
pub struct Expectations {
    /// How far the target may be turned against the model.
    #[arg(long, value_enum, default_value_t = Turn::Limited)]
    rotation: Turn,
    /// Which set has points without a partner in the other.
    #[arg(long, value_enum, default_value_t = Unmatched::Both)]
    outliers: Unmatched,
    /// The largest motion of a point, in the points' unit. It tells the answers of a lattice that
    /// goes on beyond the view apart.
    #[arg(long, value_name = "LENGTH", value_parser = positive)]
    largest_motion: Option<f64>,
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
        let matcher = AnnealedSoftassign::default()
            .with_rotation(rotation)
            .with_outliers(outliers);
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
pub fn allow(context: &Context, model: usize, target: usize, remedy: &str) -> Result<(), Failure> {
    let (model_points, targets) = (model as f64, target as f64);
    // The scores of all candidates take 4.5 bytes for every pair of a model and a target point.
    // Sets of four thousand points and more are matched coarse to fine, where 3 to 8 kilobytes a
    // point were measured.
    let bytes = if model.min(target) < 4000 {
        4.5 * model_points * targets
    } else {
        2250.0 * (model_points + targets)
    };
    let job = format!("matching {model} points to {target}");
    context.allow(bytes, &job, remedy)
}

pub fn run(arguments: &MatchArguments, context: &mut Context) -> Result<Exit, Failure> {
    let Expectations {
        rotation,
        outliers,
        largest_motion,
    } = arguments.expectations;
    let expected =
        rotation != Turn::Limited || outliers != Unmatched::Both || largest_motion.is_some();
    if arguments.method != Method::Softassign && expected {
        return Err(Failure::input(
            "--rotation, --outliers and --largest-motion apply to the method softassign alone: leave \
             out --method or them",
        ));
    }
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_owned();
    let names: Vec<OsString> = arguments.cases.iter().map(name).collect();
    context.outputs.plan(&names, &arguments.cases)?;
    // All files are read before the first case is matched, so that a mistake in the last costs no
    // time.
    let mut files = Vec::new();
    for path in &arguments.cases {
        let cases = read_cases(path)?;
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
        // The cases that are done are written, the file says which.
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

/// Matches one case, prints a line about it, appends its answer to `text` and returns it as JSON.
/// It is none after Ctrl-C.
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
    let interrupt = context.interrupt.clone();
    let answer = context.wait(job, move || {
        let matcher = method.matcher(expectations);
        repetition.timed(&interrupt, || matcher.match_points(&model, &target))
    })?;
    let (matching, ms) = match answer {
        Ok(answer) => answer,
        Err(error) => {
            context.line(format_args!("{name}: no answer: {error}"));
            // Writing into memory does not fail, here and below.
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
    let doubt = report
        .doubt
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
    let value = json!({
        "model_points": points, "target_points": targets, "matched": matched,
        "assignment": matching.assignment, "confidence": matching.confidence,
        "unmatched_share": 1.0 - matched as f64 / points as f64,
        "residual": report.residual, "noise": report.sigma, "stop": stop, "doubt": doubt,
        "iterations": iterations, "starts": starts, "time_ms": ms,
    });
    Some(json!({ "case": case, "match": value }))
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
