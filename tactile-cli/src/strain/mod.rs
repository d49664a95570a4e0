//! `tactile strain`: from two sets of points, before and after a deformation.
mod report;

use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::match_points::{self, Expectations};
use crate::outputs::Outputs;
use crate::progress::waiting_or_interrupted;
use clap::{Args, ValueEnum};
use nalgebra::Point;
use report::Report;
use std::path::PathBuf;
use tactile_imaging::StrainBetween;
use tactile_imaging::elasticity::strain::{
    Biot, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure,
};
use tactile_imaging::io::{PointTable, read_point_table};
use tactile_imaging::matching::PointMatcher;

/// Match the points before and after a deformation and measure the strain between them
///
/// The files are CSV, a point a row: columns x, y and, in space, z, found by name where there is a header. Points may come
/// and go. A smoothing spline whose smoothing is chosen by cross-validation gives the strain; misplaced points are found
/// and left out. --out gets pairs.csv (rows, positions and displacements of the pairs), strain.csv (the strain at every
/// point with its standard error) and strain.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile strain examples/data/before.csv examples/data/after.csv
  tactile strain examples/data/before.csv examples/data/after.csv --measure hencky --rotation any --out target/strain")]
pub struct Arguments {
    /// Points before.
    before: PathBuf,
    /// Points after.
    after: PathBuf,
    /// Measure of strain.
    #[arg(long, value_enum, default_value_t = Measure::GreenLagrange)]
    measure: Measure,
    #[command(flatten)]
    expectations: Expectations,
    /// Folder for pairs.csv, strain.csv and strain.svg.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Measure {
    GreenLagrange,
    EulerAlmansi,
    Hencky,
    Biot,
    Infinitesimal,
}

impl Measure {
    fn strain(self) -> &'static dyn StrainMeasure {
        match self {
            Self::GreenLagrange => &GreenLagrange,
            Self::EulerAlmansi => &EulerAlmansi,
            Self::Hencky => &Hencky,
            Self::Biot => &Biot,
            Self::Infinitesimal => &Infinitesimal,
        }
    }
}

const FILES: [&str; 3] = ["pairs.csv", "strain.csv", "strain.svg"];

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let (before, after) = (&arguments.before, &arguments.after);
    let outputs = Outputs::plan(arguments.out.as_deref(), &FILES, &[before, after])?;
    let (a, metres) = read_point_table(before)?;
    let (b, also_metres) = read_point_table(after)?;
    if metres != also_metres {
        return Err(Failure::input(format!(
            "only one of {} and {} names the unit of its coordinates: name it in both headers or in none",
            before.display(),
            after.display()
        )));
    }
    let unit = if metres {
        report::METRES
    } else {
        "the points' unit"
    };
    match (a, b) {
        (PointTable::Plane(a), PointTable::Plane(b)) => {
            measured(&a, &b, unit, arguments, context, outputs)
        }
        (PointTable::Space(a), PointTable::Space(b)) => {
            measured(&a, &b, unit, arguments, context, outputs)
        }
        _ => Err(Failure::input(format!(
            "{} and {} must both have two coordinates a point, or both three",
            before.display(),
            after.display()
        ))),
    }
}

fn measured<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    unit: &'static str,
    arguments: &Arguments,
    context: &mut Context,
    mut outputs: Outputs,
) -> Result<Exit, Failure> {
    let remedy = "take every tenth point, or cut the sets into parts";
    match_points::allow(context, before.len(), after.len(), remedy)?;
    let matcher = arguments.expectations.matcher();
    let job = format!("matching {} to {} points", before.len(), after.len());
    let (from, to) = (before.to_vec(), after.to_vec());
    let matching = waiting_or_interrupted(job, &context.interrupt, move || {
        matcher.match_points(&from, &to)
    });
    let Some(matching) = matching else {
        return Ok(Exit::Interrupted);
    };
    let matching = matching.map_err(|error| {
        Failure::input(format!(
            "{} and {} cannot be matched: {error}",
            arguments.before.display(),
            arguments.after.display()
        ))
    })?;
    let partner = |(i, j): (usize, &Option<usize>)| j.map(|j| (i, j));
    let rows: Vec<_> = matching
        .assignment
        .iter()
        .enumerate()
        .filter_map(partner)
        .collect();
    let job = format!("fitting {} pairs", rows.len());
    let (from, to, pairs, measure) = (
        before.to_vec(),
        after.to_vec(),
        rows.clone(),
        arguments.measure,
    );
    let found = waiting_or_interrupted(job, &context.interrupt, move || {
        StrainBetween::of_pairs(&from, &to, &pairs, measure.strain())
            .map_err(|error| error.to_string())
    });
    let report = Report {
        before,
        after,
        matched: &rows,
        strain: found.unwrap_or_else(|| Err("stopped by Ctrl-C".to_owned())),
        measure: arguments.measure.strain().name(),
        unit,
    };
    outputs.write(FILES[0], &report.pairs())?;
    if let Ok(strain) = &report.strain {
        outputs.write(FILES[1], &report::strains(strain, unit))?;
        outputs.page(FILES[2], || report::page(strain, unit))?;
    }
    report.print(&mut context.console);
    context.console.value(&report.json());
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(if report.strain.is_ok() {
        Exit::Complete
    } else {
        Exit::Partial
    })
}
