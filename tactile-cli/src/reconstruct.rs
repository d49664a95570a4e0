//! `tactile reconstruct`: a surface from one image, by shape from shading.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::images;
use crate::numbers::{finite, four_digits, list, median_ms, not_negative, positive};
use crate::outputs::Outputs;
use crate::plot::{HeatMap, Layer, Page, Panel};
use clap::{Args, ValueEnum};
use ndarray::Array2;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;
use tactile_imaging::sfs::{
    BoundaryCondition, BrooksHorn, Domain, Eikonal, EikonalBranch, Frame, Lighting, StopReason,
    Surface, SurfaceReconstruction, SurfaceWorkspace, TsaiShah, render, reprojection,
};

/// Reconstruct a surface from one shaded image
///
/// The light comes from X,Y,Z: x to the right, y down the image, z to the viewer. Heights are in pixels, NaN where there
/// is none. Grey levels are modelled as ambient + intensity · max(0, n·s); nothing is normalised. --out gets heights.csv
/// and surface.svg (image, heights, and the heights shaded again).
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile reconstruct examples/data/ball.pgm --light 0,0,1 --mask examples/data/ball.pgm
  tactile reconstruct examples/data/ball.pgm --light 1,0,1 --method brooks-horn --out target/reconstruct
Without --method: eikonal where heights are known, or under frontal light with a mask; else brooks-horn.")]
pub struct Arguments {
    /// PNG, PGM or JPEG.
    image: PathBuf,
    /// Direction to the light, any length; 0,0,1 is light from the camera.
    #[arg(long, value_name = "X,Y,Z", value_parser = list::<3>, allow_hyphen_values = true)]
    light: [f64; 3],
    /// How to reconstruct.
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Image of the object: bright (above 127) pixels are reconstructed.
    #[arg(long, value_name = "IMAGE")]
    mask: Option<PathBuf>,
    /// Known heights in pixels, NaN where unknown; those connected to the frame's border are taken as outside the object
    /// unless a mask says otherwise.
    #[arg(long, value_name = "KNOWN.csv")]
    heights: Option<PathBuf>,
    /// Height at the border of the mask, px (eikonal; 0 if there are no known heights).
    #[arg(long = "boundary", value_name = "PX", allow_negative_numbers = true, value_parser = finite)]
    boundary: Option<f64>,
    /// Which way the surface bulges (eikonal).
    #[arg(long, value_enum)]
    branch: Option<BranchName>,
    /// Grey level of a surface that faces the light, above the ambient.
    #[arg(long, default_value_t = 255.0, value_parser = positive)]
    intensity: f64,
    /// Grey level without light.
    #[arg(long, default_value_t = 0.0, value_parser = not_negative, allow_negative_numbers = true)]
    ambient: f64,
    /// Bits of the camera, for images of 16 bits whose file does not say.
    #[arg(long, value_parser = clap::value_parser!(u8).range(8..=16))]
    bits: Option<u8>,
    /// Folder for heights.csv and surface.svg.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Reconstruct N times; the median of the times is given.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
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

impl Method {
    fn name(self) -> &'static str {
        match self {
            Self::Eikonal => "eikonal",
            Self::TsaiShah => "tsai-shah",
            Self::BrooksHorn => "brooks-horn",
        }
    }
}

const FILES: [&str; 2] = ["heights.csv", "surface.svg"];

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let mut inputs = vec![arguments.image.as_path()];
    inputs.extend(arguments.mask.as_deref());
    inputs.extend(arguments.heights.as_deref());
    let mut outputs = Outputs::plan(arguments.out.as_deref(), &FILES, &inputs)?;
    let lighting = lighting(arguments).map_err(Failure::input)?;
    let image = images::read(&arguments.image, arguments.bits)?;
    let first = (arguments.image.as_path(), image.dim());
    let known = images::optional_grid(arguments.heights.as_deref(), first)?;
    let mut mask = images::optional_mask(arguments.mask.as_deref(), first)?;
    if let (None, Some(known)) = (&mask, &known) {
        mask = Some(not_outside(known));
    }
    let from_rim = mask.is_some() && lighting.direction() == [0.0, 0.0, 1.0];
    let method = arguments.method.unwrap_or(
        if known.is_some() || from_rim || arguments.boundary.is_some() {
            Method::Eikonal
        } else {
            Method::BrooksHorn
        },
    );
    if method != Method::Eikonal {
        for (given, option) in [
            (arguments.boundary.is_some(), "--boundary"),
            (arguments.branch.is_some(), "--branch"),
        ] {
            if given {
                return Err(Failure::input(format!(
                    "{option} applies to the method eikonal alone, not to {}",
                    method.name()
                )));
            }
        }
    }
    images::allow(context, image.dim(), "reconstructing")?;
    let mut domain = Domain::default();
    if let Some(mask) = &mask {
        domain = domain.with_mask(mask.view());
    }
    if let Some(known) = &known {
        domain = domain.with_known_heights(known.view());
    }
    let in_image = |error| Failure::input(format!("{}: {error}", arguments.image.display()));
    let reconstruction =
        reconstruction(arguments, method, lighting, mask.is_some(), known.is_some())
            .map_err(in_image)?;
    let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
    images::watch(&mut workspace, context, "reconstructing");
    let mut times = Vec::new();
    for _ in 0..arguments.repeat {
        let start = Instant::now();
        reconstruction
            .reconstruct_with(
                &mut workspace,
                Frame::Real(image.view()),
                &domain,
                &mut surface,
            )
            .map_err(in_image)?;
        times.push(start.elapsed());
    }
    let ms = median_ms(&mut times);
    // The surface is there whatever becomes of the comparison with the image.
    let frame = Frame::Real(image.view());
    let fit = reprojection(surface.heights.view(), frame, [1.0, 1.0], &lighting);
    outputs.write(FILES[0], &images::grid_csv(&surface.heights))?;
    outputs.page(FILES[1], || page(&image, &surface, &lighting))?;
    let report = &surface.report;
    let stop = images::stop_reason(report.stop);
    context.console.value(&json!({
        "method": method.name(), "time_ms": ms, "stop": stop, "iterations": report.iterations,
        "solved": report.solved, "flagged": report.flagged,
        "reprojection": match &fit {
            Ok(fit) => json!({ "value": { "rms_grey_levels": fit.1.rms } }),
            Err(error) => json!({ "error": error.to_string() }),
        },
    }));
    let console = &mut context.console;
    console.line(format!(
        "method        {} ({stop} after {} iterations, {ms:.1} ms)",
        method.name(),
        report.iterations
    ));
    console.line(format!(
        "heights       {}",
        images::span(&surface.heights, 1.0, "px")
    ));
    console.line(match &fit {
        Ok(fit) => format!(
            "reprojection  {} grey levels rms between the image and the heights shaded again",
            four_digits(fit.1.rms)
        ),
        Err(error) => format!("reprojection  none: {error}"),
    });
    if report.stop == StopReason::IterationLimit && method == Method::Eikonal {
        console.note(format!(
            "the sweeps did not settle; the last change was {:.1e} px",
            report.residual
        ));
    }
    if let Some(summary) = outputs.summary() {
        console.line(summary);
    }
    Ok(if fit.is_ok() {
        Exit::Complete
    } else {
        Exit::Partial
    })
}

type SfsResult<T> = Result<T, tactile_imaging::sfs::SfsError>;

fn lighting(arguments: &Arguments) -> SfsResult<Lighting<f64>> {
    Lighting::new(arguments.light)?
        .with_normal_intensity(arguments.intensity)?
        .with_ambient(arguments.ambient)
}

/// Everything but the known heights that are connected to the frame's border.
fn not_outside(known: &Array2<f64>) -> Array2<bool> {
    let (rows, columns) = known.dim();
    let mut mask = Array2::from_elem((rows, columns), true);
    let border = |&(r, c): &(usize, usize)| r == 0 || c == 0 || r + 1 == rows || c + 1 == columns;
    let mut open: Vec<(usize, usize)> = known
        .indexed_iter()
        .map(|(at, _)| at)
        .filter(border)
        .collect();
    while let Some(at) = open.pop() {
        if mask[at] && known[at].is_finite() {
            mask[at] = false;
            let (r, c) = at;
            let near = [
                (r.wrapping_sub(1), c),
                (r + 1, c),
                (r, c.wrapping_sub(1)),
                (r, c + 1),
            ];
            open.extend(near.into_iter().filter(|&(r, c)| r < rows && c < columns));
        }
    }
    mask
}

fn reconstruction(
    arguments: &Arguments,
    method: Method,
    lighting: Lighting<f64>,
    masked: bool,
    known: bool,
) -> SfsResult<Box<dyn SurfaceReconstruction<f64>>> {
    Ok(match method {
        Method::Eikonal => {
            let height = arguments.boundary.or((!known && masked).then_some(0.0));
            let branch = match arguments.branch {
                None | Some(BranchName::Auto) => EikonalBranch::Auto,
                Some(BranchName::Convex) => EikonalBranch::Convex,
                Some(BranchName::Concave) => EikonalBranch::Concave,
            };
            let eikonal = Eikonal::new(lighting)
                .with_boundary(height.map_or(BoundaryCondition::Free, BoundaryCondition::Height))?;
            Box::new(eikonal.with_branch(branch))
        }
        Method::TsaiShah => Box::new(TsaiShah::new(lighting)),
        Method::BrooksHorn => {
            let occluding = masked && lighting.direction() == [0.0, 0.0, 1.0];
            Box::new(BrooksHorn::new(lighting).with_occluding_boundary(occluding))
        }
    })
}

fn page(image: &Array2<f64>, surface: &Surface<f64>, lighting: &Lighting<f64>) -> Page {
    let grey = |values: &Array2<f64>| {
        let levels = values.mapv(|v| v as u8);
        Layer::Heat(HeatMap::of_frame(levels.view(), [1.0, 1.0]))
    };
    let panel = |title: &str, layer: Layer| {
        Panel::new(title)
            .x_label("x (px)")
            .y_label("y (px)")
            .equal_aspect()
            .image_axes()
            .layer(layer)
    };
    let heights = HeatMap::of_pixels(surface.heights.view(), [1.0, 1.0], "height (px)");
    let shaded = render(surface.heights.view(), [1.0, 1.0], lighting);
    Page::new("Surface from one image")
        .columns(3)
        .panel(panel("Image", grey(image)))
        .panel(panel("Heights", Layer::Heat(heights)))
        .panel(panel("Heights, shaded again", grey(&shaded)))
}
