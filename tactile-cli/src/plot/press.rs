//! The pages of a press: frames, surfaces, matches, displacement, strain, summary.
use super::page::{Colour, HeatMap, Page, Panel, PlotError, PlotPoint};
use crate::text::in_unit;
use ndarray::Array2;
use tactile_imaging::pipeline::{ContactSurface, Measurement, PipelineError, Press, with_error};

/// Strains that differ by less are equal within rounding.
const LEAST_SPREAD: f64 = 1e-9;

/// The pages with their names. In the lines of the summary a tab separates name and value.
pub(crate) fn press_pages(
    press: &mut Press<'_>,
    summary: Vec<String>,
) -> Result<Vec<(&'static str, Page)>, PlotError> {
    let mut pages = vec![
        ("frames", frames_page(press)?),
        ("surfaces", surfaces_page(press)?),
    ];
    let last = press.frames().saturating_sub(1);
    if last > 0 && press.strain(last).is_ok() {
        pages.push(("matches", matches_page(press, last)?));
        pages.push(("displacement", displacement_page(press, last)?));
        // An affine warp has one strain for all points, which the summary states.
        if press.strain(last)?.summary.spread.amax() > LEAST_SPREAD {
            pages.push(("strain", strain_page(press, last)?));
        }
    }
    pages.push(("summary", summary_page(press, summary)?));
    Ok(pages)
}

/// The results of a measurement, as lines for the summary page.
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
        let i = i + 1;
        let frame = match frame {
            Ok(frame) => frame,
            Err(error) => {
                lines.push(format!("frame {i}\tnone: {error}"));
                continue;
            }
        };
        if let Ok(f) = &frame.force_n {
            lines.push(format!(
                "force {i}\t{} N",
                with_error(f.value, f.standard_error, 1.0)
            ));
        }
        let a = frame.contact_radius_m;
        let radius = with_error(a.value, a.standard_error, 1e3);
        lines.push(format!("contact radius {i}\t{radius} mm"));
        if let Some(ratio) = frame.contact_ratio {
            lines.push(format!("a/R {i}\t{ratio:.3}"));
        }
    }
    if let Ok(m) = &measurement.matching {
        lines.push(format!(
            "matches\t{} of {} control points",
            m.matched, m.points
        ));
    }
    if let Ok(s) = &measurement.strain {
        let mean = with_error(s.mean[2][2], s.standard_error[2][2], 1.0);
        let apparent = if s.apparent { "apparent " } else { "" };
        lines.push(format!("mean {apparent}strain e_zz\t{mean}"));
    }
    lines
}

fn force_title(press: &mut Press<'_>, frame: usize) -> Result<String, PipelineError> {
    let force = press.contact(frame)?.and_then(|c| c.force_n);
    let force = force.map_or(String::new(), |f| {
        format!(": {} N", in_unit(f.total(), 1.0))
    });
    Ok(format!("frame {}{force}", frame + 1))
}

fn axes(title: impl Into<String>) -> Panel {
    Panel::new(title, "x (mm)", "y (mm)")
}

/// A point seen from above, in millimetres.
fn above(p: &nalgebra::Point3<f64>) -> PlotPoint {
    [1e3 * p.x, 1e3 * p.y]
}

/// The frames with the contact circles.
fn frames_page(press: &mut Press<'_>) -> Result<Page, PlotError> {
    let size = press.pipeline().contact().pixel_size_m().map(|s| 1e3 * s);
    let mut panels = Vec::new();
    for frame in 0..press.frames() {
        let title = force_title(press, frame)?;
        let rim = press.contact(frame)?.map(|c| {
            let centre = [0, 1].map(|k| c.centroid_px[k].value * size[k]);
            circle(centre, 1e3 * c.contact_radius_m.value)
        });
        let image = press.image(frame)?;
        let panel = axes(title).heat_map(HeatMap::of_frame(image.view(), size));
        panels.push(panel.line(rim.unwrap_or_default(), Colour::Orange, "contact radius"));
    }
    Ok(Page::new(
        "Frames and contacts",
        press.frames().min(2),
        panels,
    ))
}

/// The vertices of a circle.
pub(crate) fn circle([x, y]: PlotPoint, radius: f64) -> Vec<PlotPoint> {
    let angles = (0..=120).map(|i| f64::from(i) * std::f64::consts::TAU / 120.0);
    let at = |angle: f64| [x + radius * angle.cos(), y + radius * angle.sin()];
    angles.map(at).collect()
}

/// Heights as maps, and a cut through the highest point of each.
fn surfaces_page(press: &mut Press<'_>) -> Result<Page, PlotError> {
    let mut panels = Vec::new();
    let mut heading = "Reconstructed surfaces";
    let mut cuts = Panel::new(
        "Cuts along x through the highest point",
        "x (mm)",
        "height (mm)",
    );
    for frame in 0..press.frames() {
        let title = force_title(press, frame)?;
        let dots: Vec<PlotPoint> = press.control_points(frame)?.iter().map(above).collect();
        let surface = press.surface(frame)?;
        let size = surface.pixel_size_m.map(|s| 1e3 * s);
        let origin = surface.origin_m.map(|o| 1e3 * o);
        let heights = known_heights_mm(surface);
        if surface.apparent {
            heading = "Apparent surfaces: the pressure interpreted as shading";
        }
        let map = HeatMap::of_pixels(heights.view(), size, "height (mm)").origin(origin);
        let panel = axes(title.clone()).heat_map(map);
        panels.push(panel.rings(dots, Colour::Red, ""));
        let finite = heights.indexed_iter().filter(|(_, h)| h.is_finite());
        if let Some(((row, _), _)) = finite.max_by(|a, b| a.1.total_cmp(b.1)) {
            let cut = heights.row(row);
            let at = |(c, h): (usize, &f64)| [origin[0] + c as f64 * size[0], *h];
            let line: Vec<PlotPoint> = cut.iter().enumerate().map(at).collect();
            // The colours repeat after six frames, and a legend of more would fill the panel.
            let label = if frame < 6 { title.as_str() } else { "" };
            cuts = cuts.line(line, Colour::category(frame), label);
        }
    }
    panels.push(cuts);
    panels.extend(depressions(press)?);
    let columns = if panels.len() == 4 { 2 } else { 3 };
    Ok(Page::new(heading, panels.len().min(columns), panels))
}

/// The surface of the guide under a ball, from the law of its layers.
fn depressions(press: &Press<'_>) -> Result<Option<Panel>, PlotError> {
    let mut panel = Panel::new(
        "The guide's surface, by the contact law",
        "from the centre (mm)",
        "height (mm)",
    );
    let mut known = false;
    for frame in 0..press.frames() {
        let Some(contact) = press.contact(frame)? else {
            continue;
        };
        // Up to twice the contact radius, where most of the depression has decayed.
        let step = contact.contact_radius_m.value / 20.0;
        let distances: Vec<f64> = (-40..=40).map(|k| f64::from(k) * step).collect();
        let Some(depths) = press.guide_depression_m(frame, &distances)? else {
            continue;
        };
        let points = distances.iter().zip(&depths);
        let line = points.map(|(r, depth)| [1e3 * r, -1e3 * depth.value]);
        panel = panel.line(line.collect::<Vec<_>>(), Colour::category(frame), "");
        known = true;
    }
    Ok(known.then_some(panel))
}

/// Heights in millimetres, NaN outside the surface.
pub(crate) fn known_heights_mm(found: &ContactSurface) -> Array2<f64> {
    let (mask, heights) = (&found.surface.mask, &found.surface.heights);
    Array2::from_shape_fn(heights.dim(), |at| match mask[at] {
        true => 1e3 * heights[at],
        false => f64::NAN,
    })
}

/// Control points of both frames and their matches, from above and from the side.
fn matches_page(press: &mut Press<'_>, last: usize) -> Result<Page, PlotError> {
    let model = press.control_points(0)?.to_vec();
    let target = press.control_points(last)?.to_vec();
    let assignment = press.matching(last)?.assignment.iter().enumerate();
    let pairs: Vec<_> = assignment.filter_map(|(i, a)| a.map(|j| (i, j))).collect();
    let view = |title: &str, y: &str, axis: [usize; 2]| {
        let at = |p: &nalgebra::Point3<f64>| axis.map(|k| 1e3 * p[k]);
        let segments = pairs.iter().map(|&(i, j)| [at(&model[i]), at(&target[j])]);
        Panel::new(title, "x (mm)", y)
            .equal_aspect()
            .segments(segments, Colour::Grey, "match")
            .points(model.iter().map(at), Colour::Blue, "first frame")
            .rings(target.iter().map(at), Colour::Red, "last frame")
    };
    let panels = vec![
        view("From above", "y (mm)", [0, 1]),
        view("From the side", "z (mm)", [0, 2]),
    ];
    Ok(Page::new("Control points and matches", 2, panels))
}

/// Displacement as arrows and as lengths.
fn displacement_page(press: &mut Press<'_>, last: usize) -> Result<Page, PlotError> {
    let model = press.control_points(0)?.to_vec();
    let warped = &press.matching(last)?.warped;
    let pairs = || model.iter().zip(warped);
    let arrows = pairs().map(|(a, b)| [above(a), above(b)]);
    let lengths = pairs().map(|(a, b)| 1e6 * (b - a).norm());
    let rise = pairs().map(|(a, b)| 1e6 * (b.z - a.z));
    let places = || model.iter().map(above);
    let panel = |title: &str| axes(title).equal_aspect();
    let panels = vec![
        panel("Direction").arrows(arrows, Colour::Blue, "displacement"),
        panel("Length").valued_points(places(), lengths, "displacement (µm)"),
        panel("Along z").valued_points(places(), rise, "displacement (µm)"),
    ];
    let title = "Displacement between the first and the last frame";
    Ok(Page::new(title, 3, panels))
}

/// The diagonal of the strain over the control points.
fn strain_page(press: &mut Press<'_>, last: usize) -> Result<Page, PlotError> {
    let places: Vec<PlotPoint> = press.control_points(0)?.iter().map(above).collect();
    let strain = press.strain(last)?;
    let panel = |(k, name): (usize, &str)| {
        let values = strain.field.strains.iter().map(|e| e[(k, k)]);
        let title = format!("{name}: mean {:+.4}", strain.summary.mean[(k, k)]);
        let panel = axes(title).equal_aspect();
        panel.valued_points(places.iter().copied(), values, name)
    };
    let panels = ["e_xx", "e_yy", "e_zz"].into_iter().enumerate().map(panel);
    let of = match press.surface(last)?.apparent {
        true => " of the apparent surface",
        false => "",
    };
    let title = format!("{} strain{of}", strain.measure);
    Ok(Page::new(title, 3, panels.collect()))
}

fn summary_page(press: &mut Press<'_>, lines: Vec<String>) -> Result<Page, PlotError> {
    let mut readings = Vec::new();
    for frame in 0..press.frames() {
        if let Some(c) = press.contact(frame)?
            && let Some(force) = c.force_n
        {
            let radius = c.contact_radius_m;
            readings.push([
                force.value,
                1e3 * radius.value,
                1e3 * radius.standard_error(),
            ]);
        }
    }
    let at = readings.iter().map(|[f, a, _]| [*f, *a]);
    let errors = readings
        .iter()
        .map(|[f, a, error]| [[*f, a - error], [*f, a + error]]);
    let largest = readings.iter().map(|r| r[0]).fold(0.0, f64::max);
    let cubes = readings.iter().map(|[f, a, _]| a / f.cbrt());
    let scale = cubes.sum::<f64>() / readings.len().max(1) as f64;
    // The curve bends at its start, where the steps in the force are the smallest.
    let forces = (0..=100).map(|i| 1.05 * largest * (f64::from(i) / 100.0).powi(3));
    let law = forces.map(|f| [f, scale * f.cbrt()]);
    let title = "Contact radius against force";
    let growth = Panel::new(title, "force (N)", "contact radius (mm)")
        .dashed(law, Colour::Grey, "a ∝ F^(1/3)")
        .segments(errors, Colour::Blue, "")
        .points(at, Colour::Blue, "measured");
    let panels = vec![Panel::of_text("Results", lines), growth];
    Ok(Page::new("Summary", 2, panels))
}
