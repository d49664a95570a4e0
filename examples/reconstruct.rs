//! Reconstructs a surface from one image by shape from shading.
//!
//! ```text
//! cargo run --release --example reconstruct -- IMAGE --light X,Y,Z --mask MASK --out HEIGHT.csv --plot OUT.svg
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::{error::Error, ops::ControlFlow, path::PathBuf, process::ExitCode, time::Instant};

use clap::{Parser, ValueEnum};
use ndarray::Array2;
use tactile_imaging::{
    io::{read_grey_image, read_grid, write_grid},
    plot::{HeatMap, Layer, Page, Panel},
    sfs::{
        BoundaryCondition, Branch, BrooksHorn, Domain, Eikonal, Frame, Lighting, Pentland,
        StopReason, Surface, SurfaceReconstruction, TsaiShah, Workspace, render, reprojection,
    },
};

/// Reconstructs heights from IMAGE, lit from X,Y,Z: x to the right, y down the image, z to the viewer.
///
/// Heights are in pixels, a row of OUT a row of the image, NaN where there is none. One line of JSON goes to standard
/// output: median time in milliseconds, iterations, and the root mean square difference in grey levels between the
/// image and the surface shaded again (pixels next to the border of the object have one-sided slopes).
#[derive(Parser)]
#[command(after_help = "\
Examples:
  reconstruct vase.png --light 0,0,1 --mask object.png --out z.csv     rising from height 0 at the mask's border
  reconstruct vase.png --light 0,0,1 --heights known.csv --plot z.svg  heights known outside and at some points
  reconstruct face.pgm --light 1,0,1 --mask object.png --method brooks-horn
Without --method: eikonal where heights are known, or under frontal light with a mask; else brooks-horn.
Intensities are modelled as ambient + intensity · max(0, n·s); nothing is normalised.")]
struct Arguments {
    /// PNG, PGM or JPEG.
    image: PathBuf,
    /// Direction to the light, any length; 0,0,1 is light from the camera.
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
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
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    rim: Option<f64>,
    /// Which way heights run from the known ones (eikonal).
    #[arg(long, value_enum, default_value = "auto")]
    branch: BranchName,
    /// Grey level of a surface that faces the light, above the ambient.
    #[arg(long, default_value_t = 255.0)]
    intensity: f64,
    /// Grey level without light.
    #[arg(long, default_value_t = 0.0)]
    ambient: f64,
    /// CSV file for the heights.
    #[arg(long, value_name = "HEIGHT.csv")]
    out: Option<PathBuf>,
    /// SVG page: image, heights, and the heights shaded again.
    #[arg(long, value_name = "OUT.svg")]
    plot: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Method {
    Eikonal,
    TsaiShah,
    Pentland,
    BrooksHorn,
}

#[derive(Clone, Copy, ValueEnum)]
enum BranchName {
    Auto,
    Rising,
    Falling,
}

fn direction(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map_while(|part| part.trim().parse().ok())
        .collect();
    let count = text.split(',').count();
    match parts[..] {
        [x, y, z] if count == 3 => Ok([x, y, z]),
        _ => Err("expected three numbers X,Y,Z".to_owned()),
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("reconstruct: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let image = read_grey_image(&arguments.image)?.levels;
    let known = arguments.heights.as_ref().map(read_grid).transpose()?;
    let mask = match (&arguments.mask, &known) {
        (Some(path), _) => Some(read_grey_image(path)?.levels.mapv(|level| level > 127.0)),
        (None, Some(known)) => Some(not_outside(known)),
        (None, None) => None,
    };
    let lighting = Lighting::new(arguments.light)?
        .with_normal_intensity(arguments.intensity)?
        .with_ambient(arguments.ambient)?;
    let mut domain = Domain::pixels();
    if let Some(mask) = &mask {
        domain = domain.with_mask(mask.view());
    }
    if let Some(known) = &known {
        domain = domain.with_known_heights(known.view());
    }
    let (name, method) = choose(arguments, lighting, mask.is_some(), known.is_some())?;
    let (ms, surface) = solve(method.as_ref(), &image, &domain)?;
    let fit = reprojection(
        surface.heights.view(),
        Frame::Real(image.view()),
        [1.0, 1.0],
        &lighting,
    )?;
    let report = &surface.report;
    let line = serde_json::json!({
        "ms": ms, "iterations": report.iterations, "reprojection_rms": fit.error.rms, "method": name,
        "stop": format!("{:?}", report.stop), "solved": report.solved, "flagged": report.flagged,
        "lowest": extreme(&surface.heights, f64::min), "highest": extreme(&surface.heights, f64::max),
    });
    println!("{line}");
    if report.stop == StopReason::IterationLimit && matches!(name, "eikonal") {
        eprintln!(
            "the sweeps did not settle; the last change was {:.2e} px",
            report.residual
        );
    }
    if let Some(path) = &arguments.out {
        write_grid(path, surface.heights.view())?;
    }
    if let Some(path) = &arguments.plot {
        plot(&image, &surface, &lighting).save(path)?;
    }
    Ok(())
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

type Boxed = Box<dyn SurfaceReconstruction<f64>>;

fn choose(
    arguments: &Arguments,
    lighting: Lighting<f64>,
    masked: bool,
    known: bool,
) -> Result<(&'static str, Boxed), Box<dyn Error>> {
    let from_rim = masked && lighting.is_frontal();
    let automatic = if known || from_rim || arguments.rim.is_some() {
        Method::Eikonal
    } else {
        Method::BrooksHorn
    };
    Ok(match arguments.method.unwrap_or(automatic) {
        Method::Eikonal => {
            let rim = arguments
                .rim
                .or((!known && masked).then_some(0.0))
                .map_or(BoundaryCondition::Free, BoundaryCondition::Height);
            let branch = match arguments.branch {
                BranchName::Auto => Branch::Auto,
                BranchName::Rising => Branch::Convex,
                BranchName::Falling => Branch::Concave,
            };
            (
                "eikonal",
                Box::new(
                    Eikonal::new(lighting)
                        .with_boundary(rim)?
                        .with_branch(branch),
                ),
            )
        }
        Method::TsaiShah => ("tsai-shah", Box::new(TsaiShah::new(lighting))),
        Method::Pentland => ("pentland", Box::new(Pentland::new(lighting))),
        Method::BrooksHorn => {
            let occluding = masked && lighting.is_frontal();
            (
                "brooks-horn",
                Box::new(BrooksHorn::new(lighting).with_occluding_boundary(occluding)),
            )
        }
    })
}

/// Median time of up to five runs, and the surface.
fn solve(
    method: &dyn SurfaceReconstruction<f64>,
    image: &Array2<f64>,
    domain: &Domain<'_, f64>,
) -> Result<(f64, Surface<f64>), Box<dyn Error>> {
    let (mut workspace, mut surface) = (Workspace::new(), Surface::new());
    let started = Instant::now();
    let mut told = Instant::now();
    workspace.on_progress(move |progress| {
        if told.elapsed().as_secs_f64() > 1.0 {
            told = Instant::now();
            eprintln!(
                "{} of at most {} iterations, {:.1} s",
                progress.iterations,
                progress.limit,
                started.elapsed().as_secs_f64()
            );
        }
        ControlFlow::Continue(())
    });
    let mut times = Vec::new();
    while times.len() < 5 && times.iter().sum::<f64>() < 500.0 {
        let start = Instant::now();
        method.reconstruct_with(
            &mut workspace,
            Frame::Real(image.view()),
            domain,
            &mut surface,
        )?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok((times[times.len() / 2], surface))
}

fn extreme(heights: &Array2<f64>, pick: fn(f64, f64) -> f64) -> f64 {
    heights
        .iter()
        .copied()
        .filter(|z| z.is_finite())
        .fold(f64::NAN, pick)
}

fn plot(image: &Array2<f64>, surface: &Surface<f64>, lighting: &Lighting<f64>) -> Page {
    let grey = |values: &Array2<f64>| {
        Layer::Heat(HeatMap::of_frame(
            values.mapv(|v| v as u8).view(),
            [1.0, 1.0],
        ))
    };
    let panel = |title: &str, layer: Layer| {
        Panel::new(title)
            .x_label("x / px")
            .y_label("y / px")
            .equal_aspect()
            .image_axes()
            .layer(layer)
    };
    let heights = HeatMap::of_pixels(surface.heights.view(), [1.0, 1.0], "height / px");
    let shaded = render(surface.heights.view(), [1.0, 1.0], lighting);
    Page::new("Surface from one image")
        .columns(3)
        .panel(panel("Image", grey(image)))
        .panel(panel("Heights", Layer::Heat(heights)))
        .panel(panel("Heights, shaded again", grey(&shaded)))
}
