//! Strain between two sets of points that particles or features leave before and after a deformation.
//!
//! ```text
//! cargo run --release --example strain_between -- before.csv after.csv --measure hencky
//! ```
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    unreachable_pub,
    missing_docs
)]

mod measure;
mod robust_spline;

use clap::{Parser, ValueEnum};
use measure::{Strain, strain_between};
use nalgebra::{Matrix3, Point};
use std::error::Error;
use std::path::PathBuf;
use tactile_imaging::elasticity::strain::{
    Biot, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure,
};
use tactile_imaging::io::{PointTable, read_point_table};
use tactile_imaging::matching::AnnealedSoftassign;
use tactile_imaging::plot::{Colour, Page, Panel};

/// Matches the points of A and B, fits a smoothing spline and prints the strain from A to B.
///
/// Two columns make a plane, three make space; any unit, the same in both files. Points may come and go. The
/// smoothing is chosen from the data by cross-validation, and misplaced points are found and left out.
#[derive(Parser)]
struct Arguments {
    /// Points before.
    a: PathBuf,
    /// Points after.
    b: PathBuf,
    /// Measure of strain.
    #[arg(long, value_enum, default_value_t = Measure::GreenLagrange)]
    measure: Measure,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    json: bool,
    /// Where the plot goes.
    #[arg(long, value_name = "FILE", default_value = "strain_between.svg")]
    plot: PathBuf,
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
    fn strain(self) -> &'static dyn StrainMeasure<f64> {
        match self {
            Self::GreenLagrange => &GreenLagrange,
            Self::EulerAlmansi => &EulerAlmansi,
            Self::Hencky => &Hencky,
            Self::Biot => &Biot,
            Self::Infinitesimal => &Infinitesimal,
        }
    }
}

fn main() -> std::process::ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            std::process::ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    match (
        read_point_table(&arguments.a)?,
        read_point_table(&arguments.b)?,
    ) {
        (PointTable::Plane(a), PointTable::Plane(b)) => report(&a, &b, arguments),
        (PointTable::Space(a), PointTable::Space(b)) => report(&a, &b, arguments),
        _ => Err("one file has two columns and the other three".into()),
    }
}

fn report<const D: usize>(
    a: &[Point<f64, D>],
    b: &[Point<f64, D>],
    arguments: &Arguments,
) -> Result<(), Box<dyn Error>> {
    eprintln!("matching {} to {} points", a.len(), b.len());
    let found = strain_between(
        a,
        b,
        &AnnealedSoftassign::default(),
        arguments.measure.strain(),
    )?;
    if arguments.json {
        println!("{:#}", json(&found, a.len(), b.len(), arguments));
    } else {
        print(&found, a.len(), b.len(), arguments);
    }
    page(&found).save(&arguments.plot)?;
    eprintln!("plot: {}", arguments.plot.display());
    Ok(())
}

/// Names and indices of the components in `D` dimensions.
fn components(dimensions: usize) -> Vec<(&'static str, usize, usize)> {
    let all = [
        ("e_xx", 0, 0),
        ("e_yy", 1, 1),
        ("e_xy", 0, 1),
        ("e_zz", 2, 2),
        ("e_xz", 0, 2),
        ("e_yz", 1, 2),
    ];
    all[..if dimensions == 2 { 3 } else { 6 }].to_vec()
}

fn left_out<const D: usize>(found: &Strain<D>) -> usize {
    found.weights.iter().filter(|w| **w < 1e-3).count()
}

fn smoothing<const D: usize>(found: &Strain<D>) -> String {
    if found.relative_lambda >= 1e8 {
        "homogeneous (nothing finer is supported by the data)".into()
    } else {
        format!("λ = {:.0e} squared radii", found.relative_lambda)
    }
}

fn print<const D: usize>(found: &Strain<D>, before: usize, after: usize, arguments: &Arguments) {
    let matched = found.pairs.len();
    let share = |n: usize| 100.0 * matched as f64 / n as f64;
    println!(
        "matched     {matched} of {before} points before ({:.1} %), of {after} after ({:.1} %)",
        share(before),
        share(after)
    );
    println!("left out    {} as misplaced", left_out(found));
    println!(
        "noise       {:.3} per coordinate (in the points' unit)",
        found.sigma
    );
    println!("smoothing   {}", smoothing(found));
    if !found.summary.folded.is_empty() {
        println!(
            "FOLDED      at {} points (det F ≤ 0), left out of the mean",
            found.summary.folded.len()
        );
    }
    println!(
        "\n{:<8} {:>12} {:>12} {:>12}   ({})",
        "",
        "mean",
        "spread",
        "std. error",
        arguments.measure.strain().name()
    );
    for (name, i, j) in components(D) {
        let at = |m: &Matrix3<f64>| m[(i, j)];
        let (mean, spread) = (at(&found.summary.mean), at(&found.summary.spread));
        println!(
            "{name:<8} {mean:>12.6} {spread:>12.6} {:>12.6}",
            at(&found.standard_error)
        );
    }
    println!(
        "(standard errors with {} degrees of freedom)",
        found.degrees_of_freedom
    );
}

fn json<const D: usize>(
    found: &Strain<D>,
    before: usize,
    after: usize,
    arguments: &Arguments,
) -> serde_json::Value {
    let components: serde_json::Map<String, serde_json::Value> = (components(D).into_iter())
        .map(|(name, i, j)| {
            let value = serde_json::json!({
                "mean": found.summary.mean[(i, j)],
                "spread": found.summary.spread[(i, j)],
                "standard_error": found.standard_error[(i, j)],
            });
            (name.to_string(), value)
        })
        .collect();
    serde_json::json!({
        "measure": arguments.measure.strain().name(),
        "points_before": before,
        "points_after": after,
        "matched": found.pairs.len(),
        "share_matched_before": found.pairs.len() as f64 / before as f64,
        "share_matched_after": found.pairs.len() as f64 / after as f64,
        "left_out_as_misplaced": left_out(found),
        "noise_per_coordinate": found.sigma,
        "smoothing_over_squared_radius": found.relative_lambda,
        "degrees_of_freedom": found.degrees_of_freedom,
        "folded_points": found.summary.folded,
        "strain": components,
    })
}

fn page<const D: usize>(found: &Strain<D>) -> Page {
    let flat = |p: &Point<f64, D>| [p[0], p[1]];
    let good = |i: &usize| found.weights[*i] >= 1e-3;
    let pairs = |keep: bool| {
        let chosen = (0..found.pairs.len())
            .filter(|i| good(i) == keep)
            .collect::<Vec<_>>();
        chosen
            .into_iter()
            .map(|i| [flat(&found.pairs[i][0]), flat(&found.pairs[i][1])])
            .collect::<Vec<_>>()
    };
    let matches = Panel::new("Matches")
        .x_label("x (unit of the points)")
        .y_label("y (unit of the points)")
        .arrows(pairs(true), Colour::BLUE, "matched")
        .arrows(pairs(false), Colour::RED, "left out")
        .equal_aspect();
    let positions: Vec<_> = found.pairs.iter().map(|p| flat(&p[0])).collect();
    let map = |name: &str, i: usize, j: usize| {
        Panel::new(format!(
            "{name}: mean {:.5} ± {:.5}",
            found.summary.mean[(i, j)],
            found.standard_error[(i, j)]
        ))
        .x_label("x (unit of the points)")
        .y_label("y (unit of the points)")
        .coloured_points(
            positions.clone(),
            found.strains.iter().map(|e| e[(i, j)]),
            name,
        )
        .equal_aspect()
    };
    let page = Page::new("Strain between two point sets")
        .columns(2)
        .panel(matches);
    components(D)
        .into_iter()
        .filter(|c| c.1 == c.2 || D == 2)
        .fold(page, |page, (n, i, j)| page.panel(map(n, i, j)))
}
