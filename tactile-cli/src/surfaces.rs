//! `tactile integrate`: heights from slopes.
use crate::arguments::{HeightRegion, Repetition, name, one_or_two};
use crate::console::{Bar, Context};
use crate::failure::{Exit, Failure};
use crate::outputs::Csv;
use crate::plot::{HeatMap, Page, Panel};
use crate::slopes;
use crate::text::four_digits;
use clap::{Args, ValueEnum};
use ndarray::{Array2, Zip};
use serde_json::json;
use std::path::{Path, PathBuf};
use tactile_imaging::sfs::{
    CosinePoisson, Domain, MaskedLeastSquares, SlopeIntegrator, StopReason, Surface,
    SurfaceWorkspace, slopes as slopes_of,
};

/// The domain with a mask and known heights, if there are any.
fn within<'a>(
    mut domain: Domain<'a, f64>,
    mask: &'a Option<Array2<bool>>,
    known: &'a Option<Array2<f64>>,
) -> Domain<'a, f64> {
    if let Some(mask) = mask {
        domain = domain.with_mask(mask.view());
    }
    if let Some(known) = known {
        domain = domain.with_known_heights(known.view());
    }
    domain
}

/// Integrate slopes to heights
///
/// P contains the slopes ∂z/∂x (along a row) and Q the slopes ∂z/∂y (down the rows). Both are
/// matrices with the shape of the image (CSV without a header, NPY, NPZ, MAT). P alone is a normal
/// map: an image of 8 or 16 bits, or an array of shape (rows, columns, 3). The mean height is 0
/// unless heights are known. --out gets heights.csv and heights.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile integrate examples/data/slope_x.csv examples/data/slope_y.csv
  tactile integrate examples/data/slope_x.csv examples/data/slope_y.csv --pixel-size 5e-5 --out \
                        target/integrate
Without --method: poisson, or least-squares if there is a mask, known heights or a slope that \
                        is NaN.")]
pub(crate) struct IntegrateArguments {
    /// Slopes along x, or a normal map.
    p: PathBuf,
    /// Slopes along y.
    q: Option<PathBuf>,
    /// Method of integration.
    #[arg(long, value_enum)]
    method: Option<Integration>,
    #[command(flatten)]
    region: HeightRegion,
    /// Size of a pixel, or its width and height. Heights have its unit.
    #[arg(long, value_name = "X[,Y]", default_value = "1", value_parser = one_or_two,
          allow_negative_numbers = true)]
    pixel_size: [f64; 2],
    #[command(flatten)]
    repetition: Repetition,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Integration {
    Poisson,
    LeastSquares,
}

pub(crate) fn integrate(
    arguments: &IntegrateArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let IntegrateArguments {
        p: path,
        q,
        region,
        pixel_size,
        ..
    } = arguments;
    let names = ["heights.csv", "heights.svg"];
    let files: Vec<&Path> = [Some(path), q.as_ref()]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    context.outputs.plan(&names, &region.files(&files))?;
    let [p, q] = slopes::read(path, q.as_deref(), *pixel_size, context)?;
    let first = (path.as_path(), p.dim());
    let known = region.known_heights(first)?;
    let mask = region.bright_pixels(first)?;
    if !p
        .iter()
        .zip(&q)
        .any(|(p, q)| p.is_finite() && q.is_finite())
    {
        return Err(Failure::input(format!(
            "no pixel of {} has both slopes: heights are undetermined",
            path.display()
        )));
    }
    // The cosine transform needs complete rectangles of numbers.
    let finite = p.iter().chain(&q).all(|slope| slope.is_finite());
    let whole = mask.is_none() && known.is_none() && finite;
    let method = arguments.method.unwrap_or(if whole {
        Integration::Poisson
    } else {
        Integration::LeastSquares
    });
    let given = [
        ("--mask", region.mask.is_some()),
        ("--heights", region.heights.is_some()),
    ];
    let given = given
        .iter()
        .find(|(_, given)| *given && method != Integration::LeastSquares);
    if let Some((option, _)) = given {
        return Err(Failure::input(format!(
            "{option} applies to the method {} alone, not to {}",
            name(Integration::LeastSquares),
            name(method)
        )));
    }
    allow(context, p.dim(), "integrating")?;
    let domain = Domain::new(*pixel_size).map_err(Failure::input)?;
    // No heights at pixels without slopes.
    let sloped = Zip::from(&p)
        .and(&q)
        .map_collect(|p, q| p.is_finite() || q.is_finite());
    let inside = match mask {
        Some(mask) => Some(mask & sloped),
        None if method == Integration::LeastSquares => Some(sloped),
        None => None,
    };
    let domain = within(domain, &inside, &known);
    let integrator: Box<dyn SlopeIntegrator<f64>> = match method {
        Integration::Poisson => Box::new(CosinePoisson),
        Integration::LeastSquares => Box::new(MaskedLeastSquares::default()),
    };
    let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
    watch(&mut workspace, context, "integrating");
    let ((), ms) = arguments
        .repetition
        .timed(&context.interrupt, || {
            integrator.integrate_with(&mut workspace, p.view(), q.view(), &domain, &mut surface)
        })
        .map_err(|error| Failure::in_file(path, error))?;
    let rms = slope_rms(&surface, &p, &q, *pixel_size);
    let report = &surface.report;
    if !surface.heights.iter().any(|height| height.is_finite()) {
        return Err(Failure::no_answer(format!(
            "{}: no pixel has slopes on both axes, so there are no heights",
            path.display()
        )));
    }
    let stop = stop_reason(report.stop);
    let components = report.components.len();
    if components > 1 {
        context.warn(
            "components",
            json!({ "components": components }),
            format_args!("{components} parts do not touch: their relative heights are unknown"),
        );
    }
    context.value(&json!({
        "method": name(method), "time_ms": ms, "slope_rms": rms, "stop": stop,
        "iterations": report.iterations, "residual": report.residual, "solved": report.solved,
        "flagged": report.flagged, "components": components,
    }));
    context.row(
        "method",
        format_args!("{} ({stop}, {ms:.1} ms)", name(method)),
    );
    let heights = span(&surface.heights, 1.0, "(unit of the pixel size)");
    context.row("heights", heights);
    let text = four_digits(rms) + " rms between the given slopes and those of the heights";
    context.row("slopes", text);
    context
        .outputs
        .add(names[0], Csv::of_grid(&surface.heights));
    context.outputs.page(names[1], || {
        let map = HeatMap::of_pixels(surface.heights.view(), *pixel_size, "height");
        let [x, y] = ["x (unit of the pixel size)", "y (unit of the pixel size)"];
        let panel = Panel::new("Heights", x, y).heat_map(map);
        Page::new("Integrated slopes", 1, vec![panel])
    })?;
    Ok(Exit::Complete)
}

/// Root mean square of the difference between the slopes of the heights and the given ones.
fn slope_rms(surface: &Surface<f64>, p: &Array2<f64>, q: &Array2<f64>, size: [f64; 2]) -> f64 {
    let (px, qy) = slopes_of(surface.heights.view(), size);
    let pairs = px.iter().zip(p).chain(qy.iter().zip(q));
    let differences = pairs.map(|(found, given)| found - given);
    let (sum, count) = differences
        .filter(|d| d.is_finite())
        .fold((0.0, 0), |(sum, n), d| (sum + d * d, n + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

/// An error if the buffers of images do not fit into memory.
fn allow(context: &Context, (rows, columns): (usize, usize), job: &str) -> Result<(), Failure> {
    // Inputs, heights, and the buffers of the slowest method take about 200 bytes per pixel.
    context.allow(
        200.0 * rows as f64 * columns as f64,
        &format!("{job} {rows} × {columns} pixels"),
        "cut the object out, or make the image smaller",
    )
}

/// Shows the progress of iterative solutions. Ctrl-C stops them with the heights so far.
fn watch(workspace: &mut SurfaceWorkspace<f64>, context: &Context, job: &'static str) {
    let interrupt = context.interrupt.clone();
    let mut bar: Option<Bar> = None;
    workspace.on_progress(move |progress| {
        interrupt.polled(true);
        bar.get_or_insert_with(|| Bar::of(progress.total, job))
            .done(progress.done);
        interrupt.flow()
    });
}

/// Lowest and highest value in a unit with 1 unit = `1 / scale`, in words.
pub(crate) fn span(values: &Array2<f64>, scale: f64, unit: &str) -> String {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let pixels = finite().count();
    if pixels == 0 {
        return "none".to_owned();
    }
    let ends = [
        finite().fold(f64::INFINITY, f64::min),
        finite().fold(f64::NEG_INFINITY, f64::max),
    ];
    let [low, high] = ends.map(|v| four_digits(scale * v));
    format!("{low} to {high} {unit} over {pixels} pixels")
}

fn stop_reason(stop: StopReason) -> &'static str {
    match stop {
        StopReason::Direct => "solved directly",
        StopReason::Converged => "converged",
        StopReason::IterationLimit => "stopped at the limit of iterations",
        StopReason::Stagnated => "stopped because the residual no longer decreased",
        StopReason::Cancelled => "stopped by Ctrl-C",
        _ => "stopped",
    }
}
