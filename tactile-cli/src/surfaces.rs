//! `tactile reconstruct` and `tactile integrate`: heights from one image or from slopes.
use crate::arguments::{
    HeightRegion, Repetition, direction, finite, name, not_negative, one_or_two, positive,
    same_shape,
};
use crate::console::{Bar, Context, Exit, Failure, four_digits};
use crate::outputs::Csv;
use crate::plot::{HeatMap, Page, Panel};
use clap::{Args, ValueEnum};
use ndarray::Array2;
use serde_json::json;
use std::path::PathBuf;
use tactile_files::io::{Grey, read_grey_image, read_grid};
use tactile_imaging::sfs::{
    BoundaryCondition, BrooksHorn, CosinePoisson, Domain, Eikonal, EikonalBranch, Frame,
    FrankotChellappa, Lighting, MaskedLeastSquares, SfsError, SlopeIntegrator, StopReason, Surface,
    SurfaceReconstruction, SurfaceWorkspace, TsaiShah, render, reprojection, slopes,
};

/// Reconstruct a surface from one shaded image
///
/// The light comes from X,Y,Z: x to the right, y down the image, z to the viewer. Heights are in
/// pixels, NaN where there is none. Known heights that are connected to the frame's border are
/// taken as outside the object unless a mask says otherwise. Grey levels are modelled as ambient +
/// intensity · max(0, n·s). Nothing is normalised. --out gets heights.csv and surface.svg (image,
/// heights, and the heights shaded again).
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile reconstruct examples/data/ball.pgm --light 0,0,1 --mask examples/data/ball.pgm
  tactile reconstruct examples/data/ball.pgm --light 1,0,1 --method brooks-horn --out \
                        target/reconstruct
Without --method: eikonal where heights are known, or under frontal light with a mask; else \
                        brooks-horn.")]
pub struct ReconstructArguments {
    /// PNG, PGM or JPEG.
    image: PathBuf,
    /// Direction to the light, any length: 0,0,1 is light from the camera.
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    light: [f64; 3],
    /// How to reconstruct.
    #[arg(long, value_enum)]
    method: Option<Reconstruction>,
    #[command(flatten)]
    region: HeightRegion,
    /// Height at the border of the mask, px (eikonal). It is 0 if there are no known heights.
    #[arg(long = "boundary", value_name = "PX", allow_negative_numbers = true,
          value_parser = finite)]
    boundary: Option<f64>,
    /// Which way the surface bulges (eikonal).
    #[arg(long, value_enum)]
    branch: Option<BranchName>,
    /// Grey level of a surface that faces the light, above the ambient.
    #[arg(long, default_value_t = 255.0, value_parser = positive, allow_negative_numbers = true)]
    intensity: f64,
    /// Grey level without light.
    #[arg(long, default_value_t = 0.0, value_parser = not_negative, allow_negative_numbers = true)]
    ambient: f64,
    /// Bits of the camera, for images of 16 bits whose file does not say.
    #[arg(long, value_parser = clap::value_parser!(u8).range(8..=16))]
    bits: Option<u8>,
    #[command(flatten)]
    repetition: Repetition,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Reconstruction {
    Eikonal,
    TsaiShah,

    BrooksHorn,
}

#[derive(Clone, Copy, ValueEnum)]
enum BranchName {
    Auto,
    /// Heights bulge towards the viewer.
    Convex,
    /// Heights bulge away.
    Concave,
}

pub fn reconstruct(
    arguments: &ReconstructArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let path = arguments.image.as_path();
    let names = ["heights.csv", "surface.svg"];
    context
        .outputs
        .plan(&names, &arguments.region.files(&[path]))?;
    let lighting = Lighting::new(arguments.light)
        .and_then(|l| l.with_normal_intensity(arguments.intensity))
        .and_then(|l| l.with_ambient(arguments.ambient))
        .map_err(Failure::input)?;
    let image = read_grey_image(path, Grey::default(), arguments.bits)?.levels;
    let first = (path, image.dim());
    let known = arguments.region.known_heights(first)?;
    let mut mask = arguments.region.bright_pixels(first)?;
    if let (None, Some(known)) = (&mask, &known) {
        mask = Some(not_outside(known));
    }
    // Under frontal light the eikonal equation needs nothing but the rim of the object.
    let frontal = lighting.direction() == [0.0, 0.0, 1.0];
    let rimmed = known.is_some() || mask.is_some() && frontal || arguments.boundary.is_some();
    let method = arguments.method.unwrap_or(if rimmed {
        Reconstruction::Eikonal
    } else {
        Reconstruction::BrooksHorn
    });
    let given = [
        ("--boundary", arguments.boundary.is_some()),
        ("--branch", arguments.branch.is_some()),
    ];
    only(method, Reconstruction::Eikonal, given)?;
    allow(context, image.dim(), "reconstructing")?;
    let domain = within(Domain::default(), &mask, &known);
    let in_image = |error: SfsError| Failure::in_file(path, error);
    let reconstruction: Box<dyn SurfaceReconstruction<f64>> = match method {
        Reconstruction::Eikonal => {
            let rim = known.is_none() && mask.is_some();
            let height = arguments.boundary.or(rim.then_some(0.0));
            let branch = match arguments.branch {
                None | Some(BranchName::Auto) => EikonalBranch::Auto,
                Some(BranchName::Convex) => EikonalBranch::Convex,
                Some(BranchName::Concave) => EikonalBranch::Concave,
            };
            let boundary = height.map_or(BoundaryCondition::Free, BoundaryCondition::Height);
            let eikonal = Eikonal::new(lighting).with_boundary(boundary);
            Box::new(eikonal.map_err(in_image)?.with_branch(branch))
        }
        Reconstruction::TsaiShah => Box::new(TsaiShah::new(lighting)),
        Reconstruction::BrooksHorn => {
            let occluding = mask.is_some() && frontal;
            Box::new(BrooksHorn::new(lighting).with_occluding_boundary(occluding))
        }
    };
    let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
    watch(&mut workspace, context, "reconstructing");
    let frame = || Frame::Real(image.view());
    let ((), ms) = arguments
        .repetition
        .timed(&context.interrupt, || {
            reconstruction.reconstruct_with(&mut workspace, frame(), &domain, &mut surface)
        })
        .map_err(in_image)?;
    // The surface is there whatever becomes of the comparison with the image.
    let fit = reprojection(surface.heights.view(), frame(), [1.0, 1.0], &lighting);
    let report = &surface.report;
    let stop = stop_reason(report.stop);
    let method_name = name(method);
    if report.stop == StopReason::IterationLimit && method == Reconstruction::Eikonal {
        let last = report.residual;
        context.warn(
            "not_converged",
            json!({ "last_change_px": last }),
            format_args!("the sweeps did not settle, the last change was {last:.1e} px"),
        );
    }
    // A tenth of the brightest level is more than noise: the shading is not that of the heights.
    let badly = fit
        .as_ref()
        .ok()
        .filter(|fit| fit.1.rms > 0.1 * arguments.intensity);
    if let Some(fit) = badly {
        context.warn(
            "reprojection",
            json!({ "rms_grey_levels": fit.1.rms }),
            format_args!(
                "the heights shaded again are {} grey levels from the image: check --light, \
                 --intensity, --ambient and the mask",
                four_digits(fit.1.rms)
            ),
        );
    }
    context.value(&json!({
        "method": method_name, "time_ms": ms, "stop": stop, "iterations": report.iterations,
        "solved": report.solved, "flagged": report.flagged,
        "reprojection": match &fit {
            Ok(fit) => json!({ "rms_grey_levels": fit.1.rms }),
            Err(error) => json!({ "error": error.to_string() }),
        },
    }));
    let iterations = report.iterations;
    let text = format!("{method_name} ({stop} after {iterations} iterations, {ms:.1} ms)");
    context.row("method", text);
    context.row("heights", span(&surface.heights, 1.0, "px"));
    context.row(
        "reprojection",
        match &fit {
            Ok(fit) => format!(
                "{} grey levels rms between the image and the heights shaded again",
                four_digits(fit.1.rms)
            ),
            Err(error) => format!("none: {error}"),
        },
    );
    context
        .outputs
        .add(names[0], Csv::of_grid(&surface.heights));
    let page = || reconstruction_page(&image, &surface, &lighting);
    context.outputs.page(names[1], page)?;
    Ok(Exit::complete_if(fit.is_ok()))
}

/// The domain with a mask and known heights, where there are some.
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

/// Refuses options that apply to one method alone, where another one is taken.
fn only<M: ValueEnum + PartialEq + Copy>(
    method: M,
    alone: M,
    given: [(&str, bool); 2],
) -> Result<(), Failure> {
    match given.iter().find(|(_, given)| *given && method != alone) {
        Some((option, _)) => Err(Failure::input(format!(
            "{option} applies to the method {} alone, not to {}",
            name(alone),
            name(method)
        ))),
        None => Ok(()),
    }
}

/// Everything but the known heights that are connected to the frame's border.
fn not_outside(known: &Array2<f64>) -> Array2<bool> {
    let (rows, columns) = known.dim();
    let mut mask = Array2::from_elem((rows, columns), true);
    let border = |&(r, c): &(usize, usize)| r == 0 || c == 0 || r + 1 == rows || c + 1 == columns;
    let all = known.indexed_iter().map(|(at, _)| at);
    let mut open: Vec<(usize, usize)> = all.filter(border).collect();
    while let Some((r, c)) = open.pop() {
        if mask[(r, c)] && known[(r, c)].is_finite() {
            mask[(r, c)] = false;
            let above = [(r.wrapping_sub(1), c), (r, c.wrapping_sub(1))];
            let near = above.into_iter().chain([(r + 1, c), (r, c + 1)]);
            open.extend(near.filter(|&(r, c)| r < rows && c < columns));
        }
    }
    mask
}

fn reconstruction_page(
    image: &Array2<f64>,
    surface: &Surface<f64>,
    lighting: &Lighting<f64>,
) -> Page {
    let grey = |values: &Array2<f64>| {
        let levels = values.mapv(|v| v as u8);
        HeatMap::of_frame(levels.view(), [1.0, 1.0])
    };
    let panel = |title: &str, map| Panel::new(title, "x (px)", "y (px)").heat_map(map);
    let heights = HeatMap::of_pixels(surface.heights.view(), [1.0, 1.0], "height (px)");
    let shaded = render(surface.heights.view(), [1.0, 1.0], lighting);
    let panels = vec![
        panel("Image", grey(image)),
        panel("Heights", heights),
        panel("Heights, shaded again", grey(&shaded)),
    ];
    Page::new("Surface from one image", 3, panels)
}

/// Integrate slopes to heights
///
/// P holds the slopes ∂z/∂x (along a row) and Q ∂z/∂y (down the rows), as CSV matrices of the
/// image's shape without a header. The mean height is 0 unless heights are known. --out gets
/// heights.csv and heights.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile integrate examples/data/slope_x.csv examples/data/slope_y.csv
  tactile integrate examples/data/slope_x.csv examples/data/slope_y.csv --pixel-size 5e-5 --out \
                        target/integrate
Without --method: poisson, or least-squares where there is a mask, known heights or a slope that \
                        is NaN.")]
pub struct IntegrateArguments {
    /// Slopes along x.
    p: PathBuf,
    /// Slopes along y.
    q: PathBuf,
    /// How to integrate.
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
    FrankotChellappa,
    LeastSquares,
}

pub fn integrate(arguments: &IntegrateArguments, context: &mut Context) -> Result<Exit, Failure> {
    let IntegrateArguments {
        p: path,
        q,
        region,
        pixel_size,
        ..
    } = arguments;
    let names = ["heights.csv", "heights.svg"];
    context.outputs.plan(&names, &region.files(&[path, q]))?;
    let p = read_grid(path)?;
    let first = (path.as_path(), p.dim());
    let q_path = q;
    let q = read_grid(q_path)?;
    same_shape((q_path, q.dim()), first)?;
    let known = region.known_heights(first)?;
    let mask = region.bright_pixels(first)?;
    if !p
        .iter()
        .zip(&q)
        .any(|(p, q)| p.is_finite() && q.is_finite())
    {
        return Err(Failure::input(format!(
            "{} and {} have no pixel with both slopes: heights cannot be told",
            path.display(),
            q_path.display()
        )));
    }
    // The cosine transform takes whole rectangles of numbers alone.
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
    only(method, Integration::LeastSquares, given)?;
    allow(context, p.dim(), "integrating")?;
    let domain = Domain::new(*pixel_size).map_err(Failure::input)?;
    let domain = within(domain, &mask, &known);
    let integrator: Box<dyn SlopeIntegrator<f64>> = match method {
        Integration::Poisson => Box::new(CosinePoisson),
        Integration::FrankotChellappa => Box::new(FrankotChellappa),
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
            format_args!(
                "{components} parts do not touch: their heights are not known against each other"
            ),
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
    let text = four_digits(rms) + " rms between the given ones and those of the heights";
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
    let (px, qy) = slopes(surface.heights.view(), size);
    let pairs = px.iter().zip(p).chain(qy.iter().zip(q));
    let differences = pairs.map(|(found, given)| found - given);
    let (sum, count) = differences
        .filter(|d| d.is_finite())
        .fold((0.0, 0), |(sum, n), d| (sum + d * d, n + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

/// Refuses images whose buffers do not fit into memory.
fn allow(context: &Context, (rows, columns): (usize, usize), job: &str) -> Result<(), Failure> {
    // Inputs, heights, and the buffers of the slowest method take about 200 bytes a pixel.
    context.allow(
        200.0 * rows as f64 * columns as f64,
        &format!("{job} {rows} × {columns} pixels"),
        "cut the object out, or make the image smaller",
    )
}

/// Shows the progress of iterative solves and lets Ctrl-C end them with the heights so far.
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

/// Lowest and highest value in a unit of which one is `1 / scale`, in words.
pub fn span(values: &Array2<f64>, scale: f64, unit: &str) -> String {
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
        StopReason::Stagnated => "stopped where nothing improved any more",
        StopReason::Cancelled => "stopped by Ctrl-C",
        _ => "stopped",
    }
}
