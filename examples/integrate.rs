//! Integrates slopes to heights.
//!
//! ```text
//! cargo run --release --example integrate -- P.csv Q.csv --out Z.csv
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::{error::Error, path::PathBuf, process::ExitCode, time::Instant};

use clap::{Parser, ValueEnum};
use ndarray::Array2;
use tactile_imaging::{
    io::{read_grey_image, read_grid, write_grid},
    plot::{HeatMap, Layer, Page, Panel},
    sfs::{
        CosinePoisson, Domain, FrankotChellappa, MaskedLeastSquares, SlopeIntegrator, Surface,
        Workspace, slopes,
    },
};

/// Integrates the slopes P = ∂z/∂x (along a row) and Q = ∂z/∂y (down the rows) to heights.
///
/// The files are CSV matrices of the image's shape. The mean height is 0 unless heights are known. One line of JSON goes
/// to standard output: median time in milliseconds, iterations, and the root mean square difference between the given
/// slopes and those of the heights (`slope_rms`).
#[derive(Parser)]
#[command(after_help = "\
Examples:
  integrate p.csv q.csv --out z.csv                       Poisson, second order
  integrate p.csv q.csv --mask object.png --out z.csv     least squares on the mask; NaN slopes are left out
  integrate p.csv q.csv --pixel-size 5e-5,6e-5            heights in metres")]
struct Arguments {
    /// Slopes along x.
    p: PathBuf,
    /// Slopes along y.
    q: PathBuf,
    /// How to integrate; without it poisson, or least-squares where there is a mask, known heights or a NaN.
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Image of the object: bright (above 127) pixels are integrated.
    #[arg(long, value_name = "IMAGE")]
    mask: Option<PathBuf>,
    /// Known heights, NaN where unknown.
    #[arg(long, value_name = "KNOWN.csv")]
    heights: Option<PathBuf>,
    /// Width and height of a pixel; heights have their unit.
    #[arg(
        long,
        value_name = "X,Y",
        default_value = "1,1",
        value_delimiter = ',',
        num_args = 1
    )]
    pixel_size: Vec<f64>,
    /// CSV file for the heights.
    #[arg(long, value_name = "Z.csv")]
    out: Option<PathBuf>,
    /// SVG page of the heights.
    #[arg(long, value_name = "OUT.svg")]
    plot: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Method {
    Poisson,
    FrankotChellappa,
    LeastSquares,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("integrate: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let [width, height] = arguments.pixel_size[..] else {
        return Err("--pixel-size needs two numbers X,Y".into());
    };
    let (p, q) = (read_grid(&arguments.p)?, read_grid(&arguments.q)?);
    let known = arguments.heights.as_ref().map(read_grid).transpose()?;
    let mask = match &arguments.mask {
        Some(path) => Some(read_grey_image(path)?.levels.mapv(|level| level > 127.0)),
        None => None,
    };
    let mut domain = Domain::new([width, height])?;
    if let Some(mask) = &mask {
        domain = domain.with_mask(mask.view());
    }
    if let Some(known) = &known {
        domain = domain.with_known_heights(known.view());
    }
    let plain =
        mask.is_none() && known.is_none() && p.iter().chain(&q).all(|slope| slope.is_finite());
    let automatic = if plain {
        Method::Poisson
    } else {
        Method::LeastSquares
    };
    let (name, method): (_, Box<dyn SlopeIntegrator<f64>>) =
        match arguments.method.unwrap_or(automatic) {
            Method::Poisson => ("poisson", Box::new(CosinePoisson)),
            Method::FrankotChellappa => ("frankot-chellappa", Box::new(FrankotChellappa)),
            Method::LeastSquares => ("least-squares", Box::new(MaskedLeastSquares::new())),
        };
    let (ms, surface) = solve(method.as_ref(), &p, &q, &domain)?;
    let report = &surface.report;
    let line = serde_json::json!({
        "ms": ms, "iterations": report.iterations, "slope_rms": slope_rms(&surface, &p, &q, [width, height]),
        "method": name, "stop": format!("{:?}", report.stop), "residual": report.residual,
        "solved": report.solved, "flagged": report.flagged, "components": report.components.len(),
    });
    println!("{line}");
    if let Some(path) = &arguments.out {
        write_grid(path, surface.heights.view())?;
    }
    if let Some(path) = &arguments.plot {
        let heights = HeatMap::of_pixels(surface.heights.view(), [width, height], "height");
        let panel = Panel::new("Heights")
            .x_label("x")
            .y_label("y")
            .equal_aspect()
            .image_axes();
        Page::new("Integrated slopes")
            .columns(1)
            .panel(panel.layer(Layer::Heat(heights)))
            .save(path)?;
    }
    Ok(())
}

/// Median time of up to five runs, and the surface.
fn solve(
    method: &dyn SlopeIntegrator<f64>,
    p: &Array2<f64>,
    q: &Array2<f64>,
    domain: &Domain<'_, f64>,
) -> Result<(f64, Surface<f64>), Box<dyn Error>> {
    let (mut workspace, mut surface) = (Workspace::new(), Surface::new());
    let mut times = Vec::new();
    while times.len() < 5 && times.iter().sum::<f64>() < 500.0 {
        let start = Instant::now();
        method.integrate_with(&mut workspace, p.view(), q.view(), domain, &mut surface)?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok((times[times.len() / 2], surface))
}

/// Root mean square of the difference between the slopes of the heights and the given ones.
fn slope_rms(
    surface: &Surface<f64>,
    p: &Array2<f64>,
    q: &Array2<f64>,
    pixel_size: [f64; 2],
) -> f64 {
    let (px, qy) = slopes(surface.heights.view(), pixel_size);
    let squares = |a: &Array2<f64>, b: &Array2<f64>| -> (f64, usize) {
        let differences = a
            .iter()
            .zip(b)
            .map(|(a, b)| a - b)
            .filter(|d| d.is_finite());
        differences.fold((0.0, 0), |(sum, count), d| (sum + d * d, count + 1))
    };
    let ((a, m), (b, n)) = (squares(&px, p), squares(&qy, q));
    ((a + b) / (m + n).max(1) as f64).sqrt()
}
