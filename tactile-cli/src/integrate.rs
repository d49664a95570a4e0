//! `tactile integrate`: slopes to heights.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::images;
use crate::numbers::{four_digits, median_ms, one_or_two};
use crate::outputs::Outputs;
use crate::plot::{HeatMap, Layer, Page, Panel};
use clap::{Args, ValueEnum};
use ndarray::Array2;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;
use tactile_imaging::io::read_grid;
use tactile_imaging::sfs::{
    CosinePoisson, Domain, FrankotChellappa, MaskedLeastSquares, SlopeIntegrator, Surface,
    SurfaceWorkspace, slopes,
};

/// Integrate slopes to heights
///
/// P holds the slopes ∂z/∂x (along a row) and Q ∂z/∂y (down the rows), as CSV matrices of the image's shape without a
/// header. The mean height is 0 unless heights are known. --out gets heights.csv and heights.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile integrate examples/data/slope_x.csv examples/data/slope_y.csv
  tactile integrate examples/data/slope_x.csv examples/data/slope_y.csv --pixel-size 5e-5 --out target/integrate
Without --method: poisson, or least-squares where there is a mask, known heights or a slope that is NaN.")]
pub struct Arguments {
    /// Slopes along x.
    p: PathBuf,
    /// Slopes along y.
    q: PathBuf,
    /// How to integrate.
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Image of the object: bright (above 127) pixels are integrated.
    #[arg(long, value_name = "IMAGE")]
    mask: Option<PathBuf>,
    /// Known heights, NaN where unknown.
    #[arg(long, value_name = "KNOWN.csv")]
    heights: Option<PathBuf>,
    /// Size of a pixel, or its width and height; heights have its unit.
    #[arg(long, value_name = "X[,Y]", default_value = "1", value_parser = one_or_two)]
    pixel_size: [f64; 2],
    /// Folder for heights.csv and heights.svg.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Integrate N times; the median of the times is given.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    Poisson,
    FrankotChellappa,
    LeastSquares,
}

impl Method {
    fn name(self) -> &'static str {
        match self {
            Self::Poisson => "poisson",
            Self::FrankotChellappa => "frankot-chellappa",
            Self::LeastSquares => "least-squares",
        }
    }

    fn integrator(self) -> Box<dyn SlopeIntegrator<f64>> {
        match self {
            Self::Poisson => Box::new(CosinePoisson),
            Self::FrankotChellappa => Box::new(FrankotChellappa),
            Self::LeastSquares => Box::new(MaskedLeastSquares::default()),
        }
    }
}

const FILES: [&str; 2] = ["heights.csv", "heights.svg"];

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let mut inputs = vec![arguments.p.as_path(), arguments.q.as_path()];
    inputs.extend(arguments.mask.as_deref());
    inputs.extend(arguments.heights.as_deref());
    let mut outputs = Outputs::plan(arguments.out.as_deref(), &FILES, &inputs)?;
    let p = read_grid(&arguments.p)?;
    let first = (arguments.p.as_path(), p.dim());
    let q = read_grid(&arguments.q)?;
    images::same_shape((&arguments.q, q.dim()), first)?;
    let known = images::optional_grid(arguments.heights.as_deref(), first)?;
    let mask = images::optional_mask(arguments.mask.as_deref(), first)?;
    let plain =
        mask.is_none() && known.is_none() && p.iter().chain(&q).all(|slope| slope.is_finite());
    let method = arguments.method.unwrap_or(if plain {
        Method::Poisson
    } else {
        Method::LeastSquares
    });
    if method != Method::LeastSquares {
        for (given, option) in [
            (&arguments.mask, "--mask"),
            (&arguments.heights, "--heights"),
        ] {
            if given.is_some() {
                return Err(Failure::input(format!(
                    "{option} applies to the method least-squares alone, not to {}",
                    method.name()
                )));
            }
        }
    }
    images::allow(context, p.dim(), "integrating")?;
    let mut domain = Domain::new(arguments.pixel_size).map_err(Failure::input)?;
    if let Some(mask) = &mask {
        domain = domain.with_mask(mask.view());
    }
    if let Some(known) = &known {
        domain = domain.with_known_heights(known.view());
    }
    let integrator = method.integrator();
    let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
    images::watch(&mut workspace, context, "integrating");
    let mut times = Vec::new();
    for _ in 0..arguments.repeat {
        let start = Instant::now();
        integrator
            .integrate_with(&mut workspace, p.view(), q.view(), &domain, &mut surface)
            .map_err(|error| Failure::input(format!("{}: {error}", arguments.p.display())))?;
        times.push(start.elapsed());
    }
    let ms = median_ms(&mut times);
    let rms = slope_rms(&surface, &p, &q, arguments.pixel_size);
    outputs.write(FILES[0], &images::grid_csv(&surface.heights))?;
    outputs.page(FILES[1], || page(&surface, arguments.pixel_size))?;
    let report = &surface.report;
    let stop = images::stop_reason(report.stop);
    context.console.value(&json!({
        "method": method.name(), "time_ms": ms, "slope_rms": rms, "stop": stop,
        "iterations": report.iterations, "residual": report.residual, "solved": report.solved,
        "flagged": report.flagged, "components": report.components.len(),
    }));
    let console = &mut context.console;
    console.line(format!(
        "method      {} ({stop}, {ms:.1} ms)",
        method.name()
    ));
    console.line(format!(
        "heights     {}",
        images::span(&surface.heights, 1.0, "(unit of the pixel size)")
    ));
    console.line(format!(
        "slopes      {} rms between the given ones and those of the heights",
        four_digits(rms)
    ));
    if report.components.len() > 1 {
        console.line(format!(
            "components  {}: their heights are not known against each other",
            report.components.len()
        ));
    }
    if let Some(summary) = outputs.summary() {
        console.line(summary);
    }
    Ok(Exit::Complete)
}

/// Root mean square of the difference between the slopes of the heights and the given ones.
fn slope_rms(
    surface: &Surface<f64>,
    p: &Array2<f64>,
    q: &Array2<f64>,
    pixel_size: [f64; 2],
) -> f64 {
    let (px, qy) = slopes(surface.heights.view(), pixel_size);
    let (mut sum, mut count) = (0.0, 0);
    for (found, given) in px.iter().zip(p).chain(qy.iter().zip(q)) {
        let difference = found - given;
        if difference.is_finite() {
            sum += difference * difference;
            count += 1;
        }
    }
    (sum / f64::from(count.max(1))).sqrt()
}

fn page(surface: &Surface<f64>, pixel_size: [f64; 2]) -> Page {
    let heights = HeatMap::of_pixels(surface.heights.view(), pixel_size, "height");
    let panel = Panel::new("Heights")
        .x_label("x (unit of the pixel size)")
        .y_label("y (unit of the pixel size)")
        .equal_aspect()
        .image_axes();
    Page::new("Integrated slopes")
        .columns(1)
        .panel(panel.layer(Layer::Heat(heights)))
}
