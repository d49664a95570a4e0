//! `tactile depth`: contact and depth of a sensor that darkens under pressure.
use crate::arguments::TableArguments;
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::frames::{NamedFrame, SensorFrames};
use crate::outputs::Csv;
use crate::photometric::{self, unless_sensor};
use crate::plot::{Colour, HeatMap, Page, Panel, circle, known_heights_mm};
use crate::surfaces::span;
use crate::text::{four_digits, in_unit};
use clap::{Args, ValueEnum};
use ndarray::Array2;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tactile_files::io::Grey;
use tactile_files::scene::doubt_of_depths;
use tactile_imaging::gel::{DarkFrame, DarkGel};
use tactile_imaging::pipeline::{
    BallFit, ContactReading, ContactSurface, DarkContact, Object, Pipeline, PipelineError,
    SurfaceInput,
};

/// Find the contact and its depth in frames of a sensor that grows darker with depth
///
/// TABLE.csv contains depth as a function of darkening. The column darkness is in grey levels below
/// the reference, with the same --grey. The column depth is in the unit of its heading (m, mm or
/// µm), or in mm without one. With --ball-radius-mm a ball of this radius is fitted to the depth,
/// with --ball a ball of any radius. --out gets NAME_depth.csv (m, NaN outside the contacts, for
/// the whole frame) and NAME_depth.svg for every frame NAME.
///
/// No darkening is no depth. A table with the row 0, 0 is used unchanged. Other tables, such as
/// those of 9DTact, count depth from a contact circle that was found at some darkening: they are
/// shifted.
///
/// --sensor is the sensor file of a gel lit in colours, written by `tactile calibrate`. It replaces
/// reference, table and pixel size. --out then gets NAME_depth.csv (displacement of the surface, m,
/// for the whole frame, zero far from contacts) and its gradients along columns and rows in
/// NAME_gradient_x.csv and NAME_gradient_y.csv. It also gets NAME_contact.csv (the contact of every
/// pixel from 1, and 0 without contact), NAME.ply (a mesh, mm), NAME.npz and NAME_depth.svg.
#[derive(Args)]
#[command(
    mut_arg("reference", |arg| unless_sensor(arg, ".")),
    mut_arg("pixel_um", |arg| unless_sensor(arg, "1")),
    mut_arg("table", |arg| unless_sensor(arg, "."))
)]
#[command(after_help = "\
Examples:
  tactile depth --reference examples/data/dark_reference.pgm --table examples/data/depth_table.csv \
                        --pixel-um 100 examples/data/dark_frame.pgm --ball-radius-mm 4
  tactile depth --reference examples/data/dark_reference.pgm --table examples/data/depth_table.csv \
                        --pixel-um 100 examples/data/dark_frame.pgm --ball --out target/depth
  tactile depth --sensor examples/data/colour/sensor.toml examples/data/colour/press_6.png --out \
                        target/depth")]
pub(crate) struct DepthArguments {
    #[command(flatten)]
    frames: SensorFrames,
    /// Sensor file of a gel lit in colours.
    #[arg(long, value_name = "SENSOR.toml",
          conflicts_with_all = ["reference", "pixel_um", "table", "ball", "ball_radius_mm",
                                "zero_table"])]
    sensor: Option<PathBuf>,
    /// Table of darkening and depth.
    #[arg(long, value_name = "TABLE.csv")]
    table: PathBuf,
    /// Fit a ball of this radius in mm.
    #[arg(long, value_name = "MM", value_parser = crate::arguments::length_mm)]
    ball_radius_mm: Option<f64>,
    /// Fit a ball of any radius.
    #[arg(long, conflicts_with = "ball_radius_mm")]
    ball: bool,
    /// Shift the table so that no darkening is no depth, even if it has the row 0, 0. An error if
    /// the table does not determine its zero.
    #[arg(long)]
    zero_table: bool,
    /// Conversion of colours to grey, as for the table.
    #[arg(long, value_enum, default_value_t = GreyOf::Rec601)]
    grey: GreyOf,
    #[command(flatten)]
    reading: TableArguments,
}

#[derive(Clone, Copy, ValueEnum)]
enum GreyOf {
    /// 0.299 R + 0.587 G + 0.114 B, as OpenCV and most camera software do
    #[value(name = "rec601")]
    Rec601,
    /// 0.2126 R + 0.7152 G + 0.0722 B
    #[value(name = "rec709")]
    Rec709,
    /// The mean of the channels, as 9DTact's tables
    Mean,
}

impl DepthArguments {
    fn pipeline(&self, context: &mut Context) -> Result<(Pipeline, DarkGel), Failure> {
        let columns = [(&["darkness"][..], "grey_levels"), (&["depth"][..], "mm")];
        let [darkness, depth] = self.reading.columns(&self.table, columns, context)?;
        let mut entries: Vec<_> = darkness.into_iter().zip(depth).collect();
        if let Some(reason) = doubt_of_depths(&entries) {
            return Err(Failure::in_file(&self.table, reason));
        }
        if self.zero_table {
            entries.retain(|entry| *entry != (0.0, 0.0));
        }
        let in_table = |error| Failure::in_file(&self.table, error);
        let contact = DarkContact::new(&entries, self.frames.pixel_m()).map_err(in_table)?;
        let table = DarkContact::depth_table(&entries).map_err(in_table)?;
        if self.zero_table {
            let zeroed = table.clone().zeroed().map_err(PipelineError::DepthTable);
            zeroed.map_err(in_table)?;
        }
        // The depth follows from the table for any object. The object only determines the fits.
        let unknown = Object::Unknown {
            poisson_ratio: Object::DEFAULT_POISSON_RATIO,
        };
        let ball = |mm| Object::sphere(1e-3 * mm);
        let object = self.ball_radius_mm.map_or(unknown, ball);
        let gel = contact.gel().clone();
        let pipeline = Pipeline::new(contact, object).map_err(Failure::input)?;
        Ok((pipeline.with_surface(table, SurfaceInput::Signal), gel))
    }

    /// The requested ball.
    fn fitted(&self, surface: &ContactSurface) -> Option<Result<BallFit, &'static str>> {
        let fit = if self.ball {
            surface.fit_any_ball()
        } else {
            surface.fit_ball(1e-3 * self.ball_radius_mm?)
        };
        Some(fit.ok_or("no ball fits the depth"))
    }
}

/// The results of a frame with a contact.
struct Found {
    reading: ContactReading,
    surface: Result<ContactSurface, String>,
    ball: Option<Result<BallFit, &'static str>>,
}

pub(crate) fn run(arguments: &DepthArguments, context: &mut Context) -> Result<Exit, Failure> {
    let DepthArguments { frames, table, .. } = arguments;
    if let Some(sensor) = &arguments.sensor {
        return photometric::depth(sensor, &frames.frames, false, context);
    }
    let (pipeline, gel) = arguments.pipeline(context)?;
    let grey = match arguments.grey {
        GreyOf::Rec601 => Grey::Rec601,
        GreyOf::Rec709 => Grey::Rec709,
        GreyOf::Mean => Grey::Mean,
    };
    let reference = frames.read_reference(grey)?;
    let reading = frames.reading(grey, &reference);
    let (images, unreadable) = reading.all::<Array2<u8>>(&frames.frames, context)?;
    let mut exit = Exit::complete_if(unreadable == 0);
    // Frames are kept in memory, and each has a surface with its plot.
    let pixels = (reference.len() * images.len()) as f64;
    let job = format!("the depth of {} frames", images.len());
    context.allow(40.0 * pixels, &job, "give fewer or smaller frames")?;
    let names = images
        .iter()
        .flat_map(|image| ["_depth.csv", "_depth.svg"].map(|suffix| image.file(suffix)));
    let names: Vec<_> = names.collect();
    context.outputs.plan(&names, &frames.files(table))?;
    let mut press = pipeline
        .press(reference.view())
        .map_err(|error| Failure::in_file(&frames.reference, error))?;
    for image in &images {
        press.add_frame(image.pixels.view());
    }
    let mut values = Vec::new();
    for (k, NamedFrame { name, pixels, .. }) in images.iter().enumerate() {
        let reading = press.contact(k).map(|reading| reading.copied());
        let reading =
            reading.map_err(|error| Failure::in_file(Path::new(name), error.numbered_from(1)))?;
        let found = reading.map(|reading| {
            let surface = press.surface(k).cloned();
            let surface = surface.map_err(|error| error.numbered_from(1).to_string());
            let ball = surface.as_ref().ok().and_then(|s| arguments.fitted(s));
            Found {
                reading,
                surface,
                ball,
            }
        });
        context.line(format_args!("{name}:"));
        let value = found.as_ref().map(|found| print(found, context));
        if found.is_none() {
            context.line("no contact");
        }
        context.warn_of_frame(&press.cautions(k).unwrap_or_default());
        let all = gel.read(pixels.view(), reference.view());
        let all = all.map_err(|error| Failure::in_file(Path::new(name), error))?;
        if all.contacts.len() > 1 {
            print_all(&all, context);
        }
        values.push(json!({ "frame": name, "contact": value, "contacts": all.contacts }));
        let Some(found) = found else {
            continue;
        };
        let Ok(surface) = &found.surface else {
            exit = Exit::Partial;
            continue;
        };
        if matches!(found.ball, Some(Err(_))) {
            exit = Exit::Partial;
        }
        let depth = Csv::of_grid(&all.depth_m);
        context.outputs.add(&names[2 * k], depth);
        let size = surface.pixel_size_m.map(|m| 1e3 * m);
        let frame = HeatMap::of_frame(pixels.view(), size);
        let ball = found.ball.and_then(Result::ok);
        if let Some(report) = &mut context.outputs.report {
            report.surface(
                &format!("depth in {name}"),
                known_heights_mm(surface).view(),
                size,
            );
        }
        let page = || page(surface, ball.as_ref(), frame);
        context.outputs.page(&names[2 * k + 1], page)?;
    }
    context.value(&json!({ "frames": values }));
    Ok(exit)
}

/// Prints every contact of a frame with several. The lines above belong to the widest.
fn print_all(frame: &DarkFrame, context: &mut Context) {
    let count = frame.contacts.len();
    for (k, contact) in frame.contacts.iter().enumerate() {
        let [x, y] = contact.centroid_px.map(|at| in_unit(at, 1.0));
        let area = four_digits(1e6 * contact.area_m2);
        let depth = in_unit(contact.depth_m, 1e3);
        let beyond = if contact.beyond_table {
            ", beyond the table"
        } else {
            ""
        };
        context.line(format_args!(
            "contact {} of {count}: at ({x}, {y}) px, {area} mm², {depth} mm deep{beyond}",
            k + 1
        ));
    }
}

/// Prints a contact and returns it as JSON.
fn print(found: &Found, context: &mut Context) -> Value {
    let ContactReading {
        centroid_px,
        contact_radius_m,
        indentation_m,
        ..
    } = found.reading;
    let contact_radius_m = contact_radius_m.total();
    let [x, y] = centroid_px.map(|c| in_unit(c, 1.0));
    context.row("centroid", format_args!("({x}, {y}) px"));
    let radius = in_unit(contact_radius_m, 1e3);
    context.row("radius", radius + " mm (from the area of the contact)");
    let depth = match &found.surface {
        Ok(surface) => {
            let heights = &surface.surface.heights;
            context.row("depth", span(heights, 1e3, "mm"));
            let finite = heights.iter().copied().filter(|h| h.is_finite());
            json!({
                "largest_depth_m": finite.fold(f64::NAN, f64::max),
                "origin_m": [0.0, 0.0], "pixel_size_m": surface.pixel_size_m,
            })
        }
        Err(reason) => {
            context.row("depth", format_args!("none: {reason}"));
            json!({ "error": reason })
        }
    };
    let ball = found.ball.as_ref().map(|ball| match ball {
        Ok(ball) => {
            let depth_m = ball.depth_m(ball.centre_m);
            let lengths = [
                ball.radius_m,
                depth_m,
                ball.contact_radius_m,
                ball.mean_absolute_error_m,
            ];
            let [radius, depth, contact, error] = lengths.map(|m| four_digits(1e3 * m));
            let text =
                format!("of radius {radius} mm, {depth} mm deep, contact radius {contact} mm");
            context.row("ball", text);
            let text = format!("mean absolute error {error} mm over {} pixels", ball.pixels);
            context.row("", text);
            json!({
                "radius_m": ball.radius_m, "centre_m": ball.centre_m,
                "contact_radius_m": ball.contact_radius_m,
                "depth_m": depth_m, "mean_absolute_error_m": ball.mean_absolute_error_m,
                "pixels": ball.pixels,
            })
        }
        Err(reason) => {
            context.row("ball", format_args!("none: {reason}"));
            json!({ "error": reason })
        }
    });
    json!({
        "centroid_px": centroid_px, "contact_radius_m": contact_radius_m,
        "indentation_m": indentation_m, "surface": depth, "ball": ball,
    })
}

/// Mean measured depth and depth of the ball as a function of the distance from the centre of the
/// ball, in mm: distance, measured, ball.
fn profile(surface: &ContactSurface, ball: &BallFit) -> Vec<[f64; 3]> {
    let ([x0, y0], [dx, dy]) = (surface.origin_m, surface.pixel_size_m);
    // Twenty rings up to a fifth of the radius outside the contact.
    let width = ball.contact_radius_m * 1.2 / 20.0;
    let mut rings = [[0.0; 4]; 20];
    for ((row, column), h) in surface.surface.heights.indexed_iter() {
        let [x, y] = [x0 + column as f64 * dx, y0 + row as f64 * dy];
        let distance = (x - ball.centre_m[0]).hypot(y - ball.centre_m[1]);
        if let Some(ring) = rings.get_mut((distance / width) as usize) {
            let depth = if h.is_finite() { *h } else { 0.0 };
            let more = [1.0, distance, depth, ball.depth_m([x, y])];
            ring.iter_mut().zip(more).for_each(|(sum, v)| *sum += v);
        }
    }
    let filled = rings.iter().filter(|ring| ring[0] > 0.0);
    let mean = |[n, r, z, b]: &[f64; 4]| [r, z, b].map(|sum| 1e3 * sum / n);
    filled.map(mean).collect()
}

fn page(surface: &ContactSurface, ball: Option<&BallFit>, frame: HeatMap) -> Page {
    let axes = |title: &str| Panel::new(title, "x (mm)", "y (mm)");
    let depth = surface.surface.heights.mapv(|h| 1e3 * h);
    let size = surface.pixel_size_m.map(|m| 1e3 * m);
    let map = HeatMap::of_pixels(depth.view(), size, "depth (mm)")
        .origin(surface.origin_m.map(|o| 1e3 * o));
    let mut panels = vec![axes("Frame").heat_map(frame), axes("Depth").heat_map(map)];
    if let Some(ball) = ball {
        let rim = circle(ball.centre_m.map(|m| 1e3 * m), 1e3 * ball.contact_radius_m);
        let named = panels.into_iter().zip(["ball's contact", ""]);
        let drawn = named.map(|(panel, name)| panel.line(rim.clone(), Colour::Orange, name));
        panels = drawn.collect();
        let rings = profile(surface, ball);
        let column = |k: usize| rings.iter().map(move |ring| [ring[0], ring[k]]);
        let name = format!("ball of {} mm", four_digits(1e3 * ball.radius_m));
        let cut = Panel::new(
            "Depth around the centre",
            "distance from the centre (mm)",
            "depth (mm)",
        )
        .line(column(2), Colour::Blue, &name)
        .rings(column(1), Colour::Red, "measured");
        panels.push(cut);
    }
    Page::new("Depth of the contact", panels.len(), panels)
}
