//! Matches the cases of a file with the default matcher, writes the results in the same format, and
//! prints one line per level. A line contains the error and the time, the results with a doubt,
//! those with fewer than nine of ten correct pairs, and how many of the latter have no doubt.
//! Finally the calibration of the confidences of all pairs is printed.
//!
//! ```text
//! cargo run --release -p tactile-match --example peer_cases -- CASES.txt [RESULTS.txt]
//! ```
//!
//! For the format of cases see `support/cases.rs`. A result is `case NAME milliseconds`, then for
//! each model row `w` (warped) and `a` (target row or −1). The time is the shortest of five calls
//! with a warm workspace.
#![allow(clippy::print_stdout)]
use nalgebra::Point;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};
use tactile_match::{AnnealedSoftassign, MatchError, SoftassignWorkspace};

#[path = "support/cases.rs"]
mod cases;
#[path = "support/tenths.rs"]
mod tenths;
use cases::Case;
use tenths::Tenths;

/// The printed results of one case.
struct Score {
    error: f64,
    right: f64,
    milliseconds: f64,
    starts: usize,
    doubted: bool,
    /// Whether fewer than nine of ten found pairs are correct.
    wrong: bool,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments
        .next()
        .ok_or("usage: peer_cases CASES.txt [RESULTS.txt]")?;
    let cases = cases::read(&std::fs::read_to_string(path)?)?;
    let mut results = String::new();
    let mut levels: BTreeMap<String, Vec<Score>> = BTreeMap::new();
    let mut tenths = Tenths::default();
    for case in &cases {
        let score = match case.dimension {
            2 => solve::<2>(case, &mut results, &mut tenths)?,
            3 => solve::<3>(case, &mut results, &mut tenths)?,
            other => return Err(format!("{}: dimension {other}", case.name).into()),
        };
        let level = case
            .name
            .rsplit_once('_')
            .map_or(case.name.as_str(), |(level, _)| level);
        levels.entry(level.to_owned()).or_default().push(score);
    }
    println!(
        "{:<24} {:>10} {:>7} {:>9} {:>7} {:>8} {:>6} {:>7}",
        "level", "error", "right", "ms", "starts", "doubted", "wrong", "silent"
    );
    for (level, scores) in &levels {
        let mean = |f: fn(&Score) -> f64| scores.iter().map(f).sum::<f64>() / scores.len() as f64;
        let count = |f: fn(&Score) -> bool| scores.iter().filter(|score| f(score)).count();
        let mut times: Vec<f64> = scores.iter().map(|score| score.milliseconds).collect();
        times.sort_by(f64::total_cmp);
        println!(
            "{level:<24} {:>10.5} {:>7.3} {:>9.2} {:>7.1} {:>8} {:>6} {:>7}",
            mean(|score| score.error),
            mean(|score| score.right),
            times[times.len() / 2],
            mean(|score| score.starts as f64),
            count(|score| score.doubted),
            count(|score| score.wrong),
            count(|score| score.wrong && !score.doubted),
        );
    }
    tenths.print();
    if let Some(path) = arguments.next() {
        std::fs::write(path, results)?;
    }
    Ok(())
}

fn solve<const D: usize>(
    case: &Case,
    results: &mut String,
    tenths: &mut Tenths,
) -> Result<Score, MatchError> {
    let points = |rows: &[Vec<f64>]| -> Vec<Point<f64, D>> {
        rows.iter().map(|row| Point::from_slice(row)).collect()
    };
    let (model, target, truth) = (
        points(&case.model),
        points(&case.target),
        points(&case.truth),
    );
    let matcher = AnnealedSoftassign::default();
    let mut workspace = SoftassignWorkspace::default();
    let mut least = Duration::MAX;
    for _ in 0..5 {
        let start = Instant::now();
        matcher.match_points_with(
            &mut workspace,
            &model,
            &target,
            || ControlFlow::Continue(()),
        )?;
        least = least.min(start.elapsed());
    }
    let found =
        matcher.match_points_with(
            &mut workspace,
            &model,
            &target,
            || ControlFlow::Continue(()),
        )?;
    let warped: Vec<Point<f64, D>> = found.warped().collect();
    let milliseconds = 1e3 * least.as_secs_f64();
    // Writing to a string cannot fail.
    let _ = writeln!(results, "case {} {milliseconds:.6}", case.name);
    let (mut error, mut right, mut paired, mut found_pairs) = (0.0, 0.0, 0.0, 0.0);
    for (i, (place, assigned)) in warped.iter().zip(found.assignment).enumerate() {
        let coordinates: Vec<String> = place.iter().map(|c| format!("{c:?}")).collect();
        let row = assigned.map_or(-1, |j| i64::try_from(j).unwrap_or(-1));
        let _ = writeln!(results, "w {}\na {row}", coordinates.join(" "));
        if assigned.is_some() {
            found_pairs += 1.0;
            tenths.add(found.confidence[i], row == case.partner[i]);
        }
        if case.partner[i] >= 0 {
            paired += 1.0;
            error += (place - truth[i]).norm();
            right += f64::from(u8::from(row == case.partner[i]));
        }
    }
    Ok(Score {
        error: error / paired,
        right: right / paired,
        milliseconds,
        starts: found.report.starts,
        doubted: found.report.doubt().is_some(),
        wrong: right < 0.9 * found_pairs,
    })
}
