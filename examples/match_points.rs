//! Matches the point sets of case files and writes result files.
//!
//! `cargo run --release --example match_points -- CASES.txt [CASES.txt …] --out DIR`
//!
//! Only the points are read from a case, never its truth. The time reported is the median of the calls of the matcher
//! alone; a line starting with `#` says how each match went.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use clap::{Parser, ValueEnum};
use nalgebra::Point;
use std::error::Error;
use std::fs::{File, create_dir_all};
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::time::Instant;
use tactile_imaging::io::{CasePoints, read_cases, write_case_result};
use tactile_imaging::matching::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, MatchError, Matching,
    NearestNeighbour, Outliers, PointMatcher, RelaxationLabelling, Rotation, SoftassignOptions,
    SparseRelaxationLabelling,
};

/// Matches the point sets of case files and writes result files.
#[derive(Parser)]
struct Arguments {
    /// Case files: blocks `case NAME D n_model n_target` with rows `m` (model) and `t` (target).
    #[arg(required = true)]
    cases: Vec<PathBuf>,
    /// Folder for the result files, one a case file.
    #[arg(long)]
    out: PathBuf,
    /// How far the target may be turned against the model.
    #[arg(long, value_enum, default_value_t = Turn::Limited)]
    rotation: Turn,
    /// Where points without a partner are expected.
    #[arg(long, value_enum, default_value_t = OutlierSide::Both)]
    outliers: OutlierSide,
    /// The matcher.
    #[arg(long, value_enum, default_value_t = Method::Softassign)]
    method: Method,
    /// Calls a case; the median of their times is written.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
}

#[derive(Clone, Copy, ValueEnum)]
enum Turn {
    Limited,
    Any,
}

#[derive(Clone, Copy, ValueEnum)]
enum OutlierSide {
    Both,
    Model,
    Target,
    None,
}

#[derive(Clone, Copy, ValueEnum)]
enum Method {
    /// Annealed softassign, the default matcher.
    Softassign,
    /// The paper's relaxation labelling as printed: slow.
    Labelling,
    /// The same over ten candidates a point.
    SparseLabelling,
    /// Coherent point drift.
    Drift,
    /// Each model point to the nearest target point.
    Nearest,
    /// The cheapest one-to-one assignment by distance.
    Assignment,
}

impl Arguments {
    fn options(&self) -> SoftassignOptions {
        let rotation = match self.rotation {
            Turn::Limited => Rotation::Limited,
            Turn::Any => Rotation::Any,
        };
        let outliers = match self.outliers {
            OutlierSide::Both => Outliers::Both,
            OutlierSide::Model => Outliers::Model,
            OutlierSide::Target => Outliers::Target,
            OutlierSide::None => Outliers::None,
        };
        SoftassignOptions::default()
            .with_rotation(rotation)
            .with_outliers(outliers)
    }

    fn matcher<const D: usize>(&self) -> Box<dyn PointMatcher<f64, D>> {
        match self.method {
            Method::Softassign => Box::new(AnnealedSoftassign::new(self.options())),
            Method::Labelling => Box::new(RelaxationLabelling::default()),
            Method::SparseLabelling => Box::new(SparseRelaxationLabelling::default()),
            Method::Drift => Box::new(CoherentPointDrift::default()),
            Method::Nearest => Box::new(NearestNeighbour::default()),
            Method::Assignment => Box::new(LinearAssignment::default()),
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    create_dir_all(&arguments.out)?;
    for path in &arguments.cases {
        let name = path.file_name().ok_or("a case file needs a name")?;
        let mut out = BufWriter::new(File::create(arguments.out.join(name))?);
        let cases = read_cases(path)?;
        for case in &cases {
            match &case.points {
                CasePoints::Plane { model, target } => {
                    solve(&arguments, &case.name, model, target, &mut out)?
                }
                CasePoints::Space { model, target } => {
                    solve(&arguments, &case.name, model, target, &mut out)?
                }
            }
        }
        eprintln!("{}: {} cases", path.display(), cases.len());
    }
    Ok(())
}

/// Matches one case and writes its answer.
fn solve<const D: usize>(
    arguments: &Arguments,
    name: &str,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    out: &mut impl Write,
) -> Result<(), Box<dyn Error>> {
    let matcher = arguments.matcher::<D>();
    let (mut matching, first) = timed(&*matcher, model, target)?;
    let mut times = vec![first];
    for _ in 1..arguments.repeats {
        let (again, time) = timed(&*matcher, model, target)?;
        matching = again;
        times.push(time);
    }
    times.sort_by(f64::total_cmp);
    let report = &matching.report;
    writeln!(
        out,
        "# {name}: {:?} after {} iterations, {} starts, residual {:.3e}",
        report.stop, report.iterations, report.starts, report.residual
    )?;
    write_case_result(
        out,
        name,
        times[times.len() / 2],
        &matching.warped,
        &matching.assignment,
    )?;
    Ok(())
}

/// One call and its time in milliseconds.
fn timed<const D: usize>(
    matcher: &dyn PointMatcher<f64, D>,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
) -> Result<(Matching<f64, D>, f64), MatchError> {
    let start = Instant::now();
    let matching = matcher.match_points(model, target)?;
    Ok((matching, 1e3 * start.elapsed().as_secs_f64()))
}
