//! The pages of a press: frames, surfaces, matches, displacement, strain, summary.
use super::colour::Colour;
use super::heat::HeatMap;
use super::layer::Marker;
use super::page::{Page, PlotError};
use super::panel::Panel;
use ndarray::Array2;
use std::path::{Path, PathBuf};
use tactile_imaging::pipeline::{Measurement, PipelineError, Press, with_error};

const MM: f64 = 1e3;
const UM: f64 = 1e6;

/// Writes every page that the press has results for to `folder`, as SVG: frames, surfaces, matches, displacement and strain between the
/// first and the last frame, and a summary of [`Press::measure`]. Returns their paths.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # use tactile_simulate::{CalibrationRun, Camera, PressLoad, PressOptions, PressScene};
/// use tactile_imaging::{Object, Pipeline};
/// use tactile_cli::plot::save_press_pages;
/// # let camera = Camera::default().coarser(16);
/// # let scene = PressScene::new(PressOptions { camera, loads: vec![PressLoad::normal(0.7)], ..Default::default() })?;
/// # let calibration = scene.calibrate(&CalibrationRun { steps: 8, ..Default::default() })?;
/// # let made = scene.simulate();
/// let pipeline = Pipeline::from_pairs(&calibration.pairs, made.pixel_size_m, Object::sphere(3e-3))?.with_control_points(40);
/// let mut press = pipeline.press(made.reference.view())?;
/// press.add_frame(made.frames[0].view());
/// let folder = tempfile::tempdir()?;
/// let paths = save_press_pages(&mut press, folder.path())?;
/// let names: Vec<_> = paths.iter().filter_map(|p| p.file_name()).collect();
/// assert_eq!(names, ["frames.svg", "surfaces.svg", "summary.svg"], "strain takes two frames");
/// let summary = std::fs::read_to_string(folder.path().join("summary.svg"))?;
/// assert!(summary.contains("Young's modulus") && summary.contains("force 1"));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`PlotError`].
pub fn save_press_pages(
    press: &mut Press<'_>,
    folder: impl AsRef<Path>,
) -> Result<Vec<PathBuf>, PlotError> {
    let summary = summary_lines(&press.measure());
    save_pages(press, summary, folder.as_ref())
}

/// As [`save_press_pages`], with these lines in the summary: a tab stands between name and value.
pub(crate) fn save_pages(
    press: &mut Press<'_>,
    summary: Vec<String>,
    folder: &Path,
) -> Result<Vec<PathBuf>, PlotError> {
    let mut pages = vec![
        ("frames", frames_page(press)?),
        ("surfaces", surfaces_page(press)?),
    ];
    let last = press.frames().saturating_sub(1);
    if last > 0 && press.strain(last).is_ok() {
        pages.push(("matches", matches_page(press, last)?));
        pages.push(("displacement", displacement_page(press, last)?));
        pages.push(("strain", strain_page(press, last)?));
    }
    pages.push(("summary", summary_page(press, summary)?));
    let mut paths = Vec::with_capacity(pages.len());
    for (name, page) in pages {
        let path = folder.join(format!("{name}.svg"));
        page.save(&path)?;
        paths.push(path);
    }
    Ok(paths)
}

/// What every measurement says, as lines for the summary page.
pub(crate) fn summary_lines(measurement: &Measurement) -> Vec<String> {
    let mut lines = Vec::new();
    match &measurement.youngs_modulus_pa {
        Ok(modulus) => {
            let value = with_error(modulus.value, modulus.standard_error, 1e-3);
            lines.push(format!("Young's modulus\t{value} kPa"));
            lines.push(format!("estimator\t{}", modulus.estimator));
        }
        Err(error) => lines.push(format!("Young's modulus\tnone: {error}")),
    }
    for (i, frame) in measurement.frames.iter().enumerate() {
        let frame = match frame {
            Ok(frame) => frame,
            Err(error) => {
                lines.push(format!("frame {}\tnone: {error}", i + 1));
                continue;
            }
        };
        if let Ok(f) = &frame.force_n {
            let value = with_error(f.value, f.standard_error, 1.0);
            lines.push(format!("force {}\t{value} N", i + 1));
        }
        let a = frame.contact_radius_m;
        lines.push(format!(
            "contact radius {}\t{} mm",
            i + 1,
            with_error(a.value, a.standard_error, MM)
        ));
        if let Some(ratio) = frame.contact_ratio {
            lines.push(format!("a/R {}\t{ratio:.3}", i + 1));
        }
    }
    if let Ok(m) = &measurement.matching {
        lines.push(format!(
            "matches\t{} of {} control points",
            m.matched, m.points
        ));
    }
    if let Ok(s) = &measurement.strain {
        lines.push(format!(
            "mean strain e_zz\t{}",
            with_error(s.mean[2][2], s.standard_error[2][2], 1.0)
        ));
    }
    lines
}

fn force_title(press: &mut Press<'_>, frame: usize) -> Result<String, PipelineError> {
    let force = press.contact(frame)?.and_then(|c| c.force_n);
    Ok(match force {
        Some(f) => format!("frame {}: {:.3} N", frame + 1, f.value),
        None => format!("frame {}", frame + 1),
    })
}

fn axes(title: impl Into<String>) -> Panel {
    Panel::new(title).x_label("x (mm)").y_label("y (mm)")
}

/// The frames with the contact circles.
fn frames_page(press: &mut Press<'_>) -> Result<Page, PlotError> {
    let size = press.pipeline().contact().pixel_size_m().map(|s| s * MM);
    let mut page = Page::new("Frames and contacts").columns(press.frames().min(2));
    for frame in 0..press.frames() {
        let title = force_title(press, frame)?;
        let circle = press.contact(frame)?.map(|c| {
            let [x, y] = [
                c.centroid_px[0].value * size[0],
                c.centroid_px[1].value * size[1],
            ];
            circle([x, y], c.contact_radius_m.value * MM)
        });
        let image = press.image(frame)?;
        let panel = axes(title).heat_map(HeatMap::of_frame(image.view(), size));
        page = page.panel(panel.line(circle.unwrap_or_default(), Colour::ORANGE, "contact radius"));
    }
    Ok(page)
}

fn circle([x, y]: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    let at = |i: u32| f64::from(i) * std::f64::consts::TAU / 120.0;
    (0..=120)
        .map(|i| [x + radius * at(i).cos(), y + radius * at(i).sin()])
        .collect()
}

/// Heights as maps, and a cut through the middle of each.
fn surfaces_page(press: &mut Press<'_>) -> Result<Page, PlotError> {
    let mut page = Page::new("Reconstructed surfaces").columns((press.frames() + 1).min(3));
    let mut cuts = axes("Cuts along x through the highest point").y_label("height (mm)");
    for frame in 0..press.frames() {
        let title = force_title(press, frame)?;
        let points = press.control_points(frame)?.to_vec();
        let surface = press.surface(frame)?;
        let (origin, size) = (surface.origin_m, surface.pixel_size_m.map(|s| s * MM));
        let masked = |(at, h): ((usize, usize), &f64)| {
            if surface.surface.mask[at] {
                *h * MM
            } else {
                f64::NAN
            }
        };
        let cells: Vec<f64> = surface.surface.heights.indexed_iter().map(masked).collect();
        let heights =
            Array2::from_shape_vec(surface.surface.heights.dim(), cells).unwrap_or_default();
        let map =
            HeatMap::of_pixels(heights.view(), size, "height (mm)").origin(origin.map(|o| o * MM));
        let dots = points.iter().map(|p| [p.x * MM, p.y * MM]);
        page = page.panel(axes(title.clone()).heat_map(map).marked(
            dots,
            Marker::Ring,
            Colour::RED,
            "",
        ));
        let top = heights
            .indexed_iter()
            .filter(|(_, h)| h.is_finite())
            .max_by(|a, b| a.1.total_cmp(b.1));
        if let Some(((row, _), _)) = top {
            let cut = heights.row(row);
            let line = cut
                .iter()
                .enumerate()
                .map(|(c, h)| [origin[0] * MM + c as f64 * size[0], *h]);
            cuts = cuts.line(
                line,
                Colour::CATEGORIES[frame % Colour::CATEGORIES.len()],
                &title,
            );
        }
    }
    Ok(page.panel(cuts))
}

/// Control points of both frames and their matches, from above and from the side.
fn matches_page(press: &mut Press<'_>, last: usize) -> Result<Page, PlotError> {
    let (model, target) = (
        press.control_points(0)?.to_vec(),
        press.control_points(last)?.to_vec(),
    );
    let matching = press.matching(last)?;
    let pairs = || {
        matching
            .assignment
            .iter()
            .enumerate()
            .filter_map(|(i, a)| a.map(|j| (i, j)))
    };
    let view = |title: &str, axis: [usize; 2]| {
        let at = |p: &nalgebra::Point3<f64>| axis.map(|k| p[k] * MM);
        let segments = pairs().map(|(i, j)| [at(&model[i]), at(&target[j])]);
        Panel::new(title)
            .x_label("x (mm)")
            .equal_aspect()
            .segments(segments, Colour::GREY, "match")
            .points(model.iter().map(at), Colour::BLUE, "first frame")
            .marked(
                target.iter().map(at),
                Marker::Ring,
                Colour::RED,
                "last frame",
            )
    };
    Ok(Page::new("Control points and matches")
        .columns(2)
        .panel_size(620, 520)
        .panel(view("From above", [0, 1]).y_label("y (mm)"))
        .panel(view("From the side", [0, 2]).y_label("z (mm)")))
}

/// Displacement as arrows and as lengths.
fn displacement_page(press: &mut Press<'_>, last: usize) -> Result<Page, PlotError> {
    let model = press.control_points(0)?.to_vec();
    let warped = &press.matching(last)?.warped;
    let at = |p: &nalgebra::Point3<f64>| [p.x * MM, p.y * MM];
    let arrows = model.iter().zip(warped).map(|(a, b)| [at(a), at(b)]);
    let lengths = model.iter().zip(warped).map(|(a, b)| (b - a).norm() * UM);
    let rise = model.iter().zip(warped).map(|(a, b)| (b.z - a.z) * UM);
    let points = || model.iter().map(at);
    Ok(
        Page::new("Displacement between the first and the last frame")
            .columns(3)
            .panel(
                axes("Direction")
                    .equal_aspect()
                    .arrows(arrows, Colour::BLUE, "displacement"),
            )
            .panel(axes("Length").equal_aspect().coloured_points(
                points(),
                lengths,
                "displacement (µm)",
            ))
            .panel(axes("Along z").equal_aspect().coloured_points(
                points(),
                rise,
                "displacement (µm)",
            )),
    )
}

/// The diagonal of the strain over the control points.
fn strain_page(press: &mut Press<'_>, last: usize) -> Result<Page, PlotError> {
    let model = press.control_points(0)?.to_vec();
    let strain = press.strain(last)?;
    let mut page = Page::new(format!("{} strain", strain.measure)).columns(3);
    for (k, name) in ["e_xx", "e_yy", "e_zz"].into_iter().enumerate() {
        let values = strain.field.strains.iter().map(|e| e[(k, k)]);
        let title = format!("{name}: mean {:+.4}", strain.summary.mean[(k, k)]);
        let points = model.iter().map(|p| [p.x * MM, p.y * MM]);
        page = page.panel(
            axes(title)
                .equal_aspect()
                .coloured_points(points, values, name),
        );
    }
    Ok(page)
}

fn summary_page(press: &mut Press<'_>, lines: Vec<String>) -> Result<Page, PlotError> {
    let mut points = Vec::new();
    for frame in 0..press.frames() {
        if let Some(c) = press.contact(frame)?
            && let Some(force) = c.force_n
        {
            points.push((force, c.contact_radius_m));
        }
    }
    let at = points.iter().map(|(f, a)| [f.value, a.value * MM]);
    let errors = points.iter().map(|(_, a)| a.standard_error * MM);
    let largest = points.iter().map(|(f, _)| f.value).fold(0.0, f64::max);
    let cubes = points.iter().map(|(f, a)| a.value / f.value.cbrt());
    let scale = cubes.sum::<f64>() / points.len().max(1) as f64 * MM;
    let law = (0..=100)
        .map(|i| 1.05 * largest * f64::from(i) / 100.0)
        .map(|f| [f, scale * f.cbrt()]);
    let growth = Panel::new("Contact radius against force")
        .x_label("force (N)")
        .y_label("contact radius (mm)")
        .dashed(law, Colour::GREY, "a ∝ F^(1/3)")
        .error_bars(at.clone(), errors, Colour::BLUE)
        .points(at, Colour::BLUE, "measured");
    Ok(Page::new("Summary")
        .columns(2)
        .panel(Panel::new("Results").text(lines))
        .panel(growth))
}
