//! `tactile depth`: contact and depth of a sensor that grows darker where it is pressed.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::images;
use crate::numbers::{four_digits, one_or_two, positive};
use crate::outputs::Outputs;
use crate::plot::{Colour, HeatMap, Marker, Page, Panel};
use clap::{Args, ValueEnum};
use ndarray::Array2;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tactile_imaging::io::{Grey, read_columns, read_grey_image};
use tactile_imaging::pipeline::{
    BallFit, ContactReading, ContactSurface, DarkContact, Object, Pipeline, PipelineError,
    SurfaceInput, with_error,
};
use tactile_imaging::sfs::DepthTable;

/// Find the contact and its depth in frames of a sensor that grows darker with depth
///
/// TABLE.csv says how deep a darkness is: columns darkness (grey levels below the reference, of the same --grey) and depth (m, mm, µm,
/// by its heading; mm without one). With --ball-radius-mm a ball of this radius is fitted to the depth, with --ball one of any.
/// --out gets NAME_depth.csv (m, NaN outside the contact) and NAME_depth.svg for every frame NAME.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile depth --reference examples/data/dark_reference.pgm --table examples/data/depth_table.csv --pixel-um 100 examples/data/dark_frame.pgm --ball-radius-mm 4
  tactile depth --reference examples/data/dark_reference.pgm --table examples/data/depth_table.csv --pixel-um 100 examples/data/dark_frame.pgm --ball --out target/depth")]
pub struct Arguments {
    /// Pressed frames (PNG, PGM or JPEG).
    #[arg(required = true)]
    frames: Vec<PathBuf>,
    /// Frame of the sensor without contact.
    #[arg(long, value_name = "IMAGE")]
    reference: PathBuf,
    /// Table of darkness and depth.
    #[arg(long, value_name = "TABLE.csv")]
    table: PathBuf,
    /// Size of a pixel on the sensor's surface in micrometres, or its width and height.
    #[arg(long, value_name = "X[,Y]", value_parser = one_or_two, allow_negative_numbers = true)]
    pixel_um: [f64; 2],
    /// Fit a ball of this radius in mm.
    #[arg(long, value_name = "MM", value_parser = positive)]
    ball_radius_mm: Option<f64>,
    /// Fit a ball of any radius.
    #[arg(long, conflicts_with = "ball_radius_mm")]
    ball: bool,
    /// Shift the table so that no darkness is no depth: for tables counted from a contact circle found at some darkness.
    #[arg(long)]
    zero_table: bool,
    /// How the colours of a frame make its grey: as those of the table were made.
    #[arg(long, value_enum, default_value_t = GreyOf::Rec601)]
    grey: GreyOf,
    /// Bits of the camera, for images of 16 bits whose file does not say.
    #[arg(long, value_parser = clap::value_parser!(u8).range(8..=16))]
    bits: Option<u8>,
    /// Folder for the depth of every frame, as CSV and SVG.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
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

impl Arguments {
    /// A frame in eight bits, in the grey of the table.
    fn read(&self, path: &Path) -> Result<Array2<u8>, Failure> {
        let grey = match self.grey {
            GreyOf::Rec601 => Grey::Rec601,
            GreyOf::Rec709 => Grey::Rec709,
            GreyOf::Mean => Grey::Mean,
        };
        Ok(read_grey_image(path, grey, self.bits)?.to_u8())
    }

    fn pixel_m(&self) -> [f64; 2] {
        self.pixel_um.map(|um| um * 1e-6)
    }

    fn pipeline(&self, entries: &[(f64, f64)]) -> Result<Pipeline, Failure> {
        let in_table = |error| Failure::input(format!("{}: {error}", self.table.display()));
        let (contact, table) = self.depths(entries).map_err(in_table)?;
        let unknown = Object::Unknown {
            poisson_ratio: Object::DEFAULT_POISSON_RATIO,
        };
        let ball = |mm| Object::sphere(mm / MM);
        let object = self.ball_radius_mm.map_or(unknown, ball);
        let pipeline = Pipeline::new(contact, object).map_err(Failure::input)?;
        Ok(pipeline.with_surface(table, SurfaceInput::Signal))
    }

    /// The stages that read the table.
    fn depths(
        &self,
        entries: &[(f64, f64)],
    ) -> Result<(DarkContact, DepthTable<f64>), PipelineError> {
        let contact = DarkContact::new(entries, self.pixel_m())?;
        let table = DarkContact::depth_table(entries)?;
        if !self.zero_table {
            return Ok((contact, table));
        }
        let zeroed = table.zeroed().map_err(PipelineError::DepthTable)?;
        Ok((contact.zeroed()?, zeroed))
    }
}

const MM: f64 = 1e3;

/// What was found in a frame, as far as it came.
struct Found {
    reading: ContactReading,
    surface: Result<ContactSurface, String>,
    ball: Option<Result<BallFit, String>>,
}

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let mut names = Vec::new();
    for frame in &arguments.frames {
        names.extend(["csv", "svg"].map(|kind| result_name(frame, kind)));
    }
    let mut inputs = vec![arguments.reference.as_path(), arguments.table.as_path()];
    inputs.extend(arguments.frames.iter().map(PathBuf::as_path));
    let mut outputs = Outputs::plan(arguments.out.as_deref(), &names, &inputs)?;
    let entries = depth_table(&arguments.table)?;
    let pixel_m = arguments.pixel_m();
    let pipeline = arguments.pipeline(&entries)?;
    let reference = arguments.read(&arguments.reference)?;
    let first = (arguments.reference.as_path(), reference.dim());
    let mut frames = Vec::new();
    for path in &arguments.frames {
        let frame = arguments.read(path)?;
        images::same_shape((path, frame.dim()), first)?;
        frames.push(frame);
    }
    let mut press = pipeline
        .press(reference.view())
        .map_err(|error| Failure::input(format!("{}: {error}", arguments.reference.display())))?;
    frames.iter().for_each(|frame| {
        press.add_frame(frame.view());
    });
    let mut exit = Exit::Complete;
    let mut values = Vec::new();
    for (k, path) in arguments.frames.iter().enumerate() {
        let reading = match press.contact(k) {
            Ok(reading) => reading.copied(),
            Err(error) => return Err(Failure::input(format!("{}: {error}", path.display()))),
        };
        let found = reading.map(|reading| {
            let surface = press.surface(k).cloned().map_err(|e| e.to_string());
            let ball = ball(arguments, surface.as_ref().ok());
            Found {
                reading,
                surface,
                ball,
            }
        });
        context.console.line(format!("{}:", path.display()));
        print(found.as_ref(), context);
        values
            .push(json!({ "frame": path.display().to_string(), "contact": value(found.as_ref()) }));
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
        outputs.write(
            result_name(path, "csv"),
            &images::grid_csv(&surface.surface.heights),
        )?;
        let map = HeatMap::of_frame(frames[k].view(), pixel_m.map(|m| m * MM));
        let fitted = found.ball.as_ref().and_then(|ball| ball.as_ref().ok());
        let name = result_name(path, "svg");
        outputs.page(&name, || page(surface, fitted, pixel_m, map))?;
    }
    context.console.value(&json!({ "frames": values }));
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(exit)
}

fn result_name(frame: &Path, kind: &str) -> String {
    let stem = frame.file_stem().unwrap_or_default().to_string_lossy();
    format!("{stem}_depth.{kind}")
}

/// (darkness in grey levels, depth in metres).
fn depth_table(path: &Path) -> Result<Vec<(f64, f64)>, Failure> {
    let [darkness, depth] =
        read_columns(path, [(&["darkness"], "grey_levels"), (&["depth"], "mm")])?;
    Ok(darkness.into_iter().zip(depth).collect())
}

/// The ball that was asked for.
fn ball(
    arguments: &Arguments,
    surface: Option<&ContactSurface>,
) -> Option<Result<BallFit, String>> {
    let surface = surface?;
    let fit = if arguments.ball {
        surface.fit_any_ball()
    } else {
        surface.fit_ball(arguments.ball_radius_mm? / MM)
    };
    Some(fit.ok_or_else(|| "no ball fits the depth".to_owned()))
}

fn print(found: Option<&Found>, context: &mut Context) {
    let console = &mut context.console;
    let Some(found) = found else {
        console.line("  no contact");
        return;
    };
    let reading = &found.reading;
    let [x, y] = reading
        .centroid_px
        .map(|c| with_error(c.value, c.standard_error, 1.0));
    let radius = reading.contact_radius_m;
    console.line(format!("  centroid  ({x}, {y}) px"));
    console.line(format!(
        "  radius    {} mm (from the area of the contact)",
        with_error(radius.value, radius.standard_error, MM)
    ));
    match &found.surface {
        Ok(surface) => console.line(format!(
            "  depth     {}",
            images::span(&surface.surface.heights, MM, "mm")
        )),
        Err(reason) => console.line(format!("  depth     none: {reason}")),
    }
    match &found.ball {
        None => {}
        Some(Err(reason)) => console.line(format!("  ball      none: {reason}")),
        Some(Ok(ball)) => {
            console.line(format!(
                "  ball      of radius {} mm, {} mm deep, contact radius {} mm",
                four_digits(ball.radius_m * MM),
                four_digits(ball.depth_m(ball.centre_m) * MM),
                four_digits(ball.contact_radius_m * MM)
            ));
            console.line(format!(
                "            mean absolute error {} mm over {} pixels",
                four_digits(ball.mean_absolute_error_m * MM),
                ball.pixels
            ));
        }
    }
}

fn value(found: Option<&Found>) -> Value {
    let Some(found) = found else {
        return Value::Null;
    };
    let reading = &found.reading;
    let largest = |surface: &ContactSurface| {
        let finite = surface.surface.heights.iter().filter(|h| h.is_finite());
        finite.copied().fold(f64::NAN, f64::max)
    };
    let surface = match &found.surface {
        Ok(surface) => json!({ "value": { "largest_depth_m": largest(surface) } }),
        Err(reason) => json!({ "error": reason }),
    };
    let ball = found.ball.as_ref().map(|ball| match ball {
        Ok(ball) => json!({ "value": {
            "radius_m": ball.radius_m, "centre_m": ball.centre_m, "contact_radius_m": ball.contact_radius_m,
            "depth_m": ball.depth_m(ball.centre_m), "mean_absolute_error_m": ball.mean_absolute_error_m,
            "pixels": ball.pixels,
        } }),
        Err(reason) => json!({ "error": reason }),
    });
    json!({
        "centroid_px": reading.centroid_px.map(|c| [c.value, c.standard_error]),
        "contact_radius_m": [reading.contact_radius_m.value, reading.contact_radius_m.standard_error],
        "depth": surface, "ball": ball,
    })
}

/// Mean measured depth and the ball's by distance from the ball's centre, in mm: distance, measured, ball.
fn profile(surface: &ContactSurface, ball: &BallFit, pixel_m: [f64; 2]) -> Vec<[f64; 3]> {
    let origin = surface.origin_m;
    let width = ball.contact_radius_m * 1.2 / 20.0;
    let mut rings = [[0.0; 4]; 20];
    for ((row, column), h) in surface.surface.heights.indexed_iter() {
        let x = origin[0] + column as f64 * pixel_m[0];
        let y = origin[1] + row as f64 * pixel_m[1];
        let distance = (x - ball.centre_m[0]).hypot(y - ball.centre_m[1]);
        if let Some(ring) = rings.get_mut((distance / width) as usize) {
            let depth = if h.is_finite() { *h } else { 0.0 };
            for (sum, v) in ring
                .iter_mut()
                .zip([1.0, distance, depth, ball.depth_m([x, y])])
            {
                *sum += v;
            }
        }
    }
    let filled = rings.iter().filter(|ring| ring[0] > 0.0);
    filled
        .map(|[n, r, z, b]| [r / n * MM, z / n * MM, b / n * MM])
        .collect()
}

fn page(
    surface: &ContactSurface,
    ball: Option<&BallFit>,
    pixel_m: [f64; 2],
    frame: HeatMap,
) -> Page {
    let axes = |title: &str| {
        Panel::new(title)
            .x_label("x (mm)")
            .y_label("y (mm)")
            .equal_aspect()
            .image_axes()
    };
    let depth = surface.surface.heights.mapv(|h| h * MM);
    let size = surface.pixel_size_m.map(|m| m * MM);
    let map = HeatMap::of_pixels(depth.view(), size, "depth (mm)")
        .origin(surface.origin_m.map(|o| o * MM));
    let (mut frame, mut depth) = (axes("Frame").heat_map(frame), axes("Depth").heat_map(map));
    let mut page = Page::new("Depth of the contact");
    if let Some(ball) = ball {
        let circle: Vec<[f64; 2]> = (0..=120)
            .map(|i| f64::from(i) * std::f64::consts::TAU / 120.0)
            .map(|turn| {
                let at = |k: usize, v: f64| (ball.centre_m[k] + ball.contact_radius_m * v) * MM;
                [at(0, turn.cos()), at(1, turn.sin())]
            })
            .collect();
        frame = frame.line(circle.clone(), Colour::ORANGE, "ball's contact");
        depth = depth.line(circle, Colour::ORANGE, "");
        let rings = profile(surface, ball, pixel_m);
        let column = |k: usize| rings.iter().map(move |ring| [ring[0], ring[k]]);
        let name = format!("ball of {} mm", four_digits(ball.radius_m * MM));
        let cut = Panel::new("Depth around the centre")
            .x_label("distance from the centre (mm)")
            .y_label("depth (mm)")
            .line(column(2), Colour::BLUE, &name)
            .marked(column(1), Marker::Ring, Colour::RED, "measured");
        page = page.columns(3).panel(frame).panel(depth).panel(cut);
    } else {
        page = page.columns(2).panel(frame).panel(depth);
    }
    page
}
