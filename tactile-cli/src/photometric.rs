//! Sensors with a gel that is lit in colours: `tactile calibrate` and `tactile depth` for them.
use crate::console::{Context, Exit, Failure, four_digits, in_unit};
use crate::outputs::{Csv, beside};
use crate::plot::{HeatMap, Page, Panel};
use clap::Arg;
use clap::builder::ArgPredicate;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tactile_imaging::core::Estimate;
use tactile_imaging::io::{read_bytes, read_colour_levels};
use tactile_imaging::sensor::{PhotometricPresses, PhotometricSensor};
use tactile_imaging::sfs::{PhotometricCalibration, PhotometricReading};

/// An argument that a sensor file takes the place of. `filler` is parsed and not used.
pub fn unless_sensor(arg: Arg, filler: &'static str) -> Arg {
    arg.required(false)
        .required_unless_present("sensor")
        .default_value_if("sensor", ArgPredicate::IsPresent, filler)
}

/// Calibrates from the presses that the file names. `sensor` is the name of the sensor file in the
/// folder of the results. The frame without contact is written beside it.
pub fn calibrate(path: &Path, sensor: &Path, context: &mut Context) -> Result<Exit, Failure> {
    let presses = PhotometricPresses::read(path)?;
    let reference = reference_name(sensor, &presses.reference_path);
    if let Some(folder) = context.outputs.folder().map(Path::to_path_buf) {
        context.outputs.plan_in(&folder, &[&reference], &[path])?;
    }
    let found = presses.calibrate();
    let found = found.map_err(|error| Failure::in_file(path, error))?;
    print(&presses.names, &found, context);
    let model = found.sensor.model().clone();
    let circles: Vec<Value> = presses
        .names
        .iter()
        .zip(&found.circles)
        .map(|(name, circle)| json!({ "image": name.display().to_string(), "circle": circle }))
        .collect();
    context.value(&json!({
        "presses": circles, "offset_px": found.offset_px,
        "median_angle_deg": found.median_angle_deg,
        "normal_standard_error": model.normal_standard_error,
        "depth_standard_error_m": model.depth_standard_error_m,
    }));
    if context.outputs.folder().is_some() {
        let text = PhotometricSensor::new(&reference, model).to_toml();
        let text = text.map_err(Failure::output)?;
        context.outputs.add(sensor, text.into_bytes());
        context
            .outputs
            .add(reference, read_bytes(&presses.reference_path)?);
    }
    Ok(Exit::Complete)
}

/// The name of the frame without contact beside a sensor file.
fn reference_name(sensor: &Path, reference: &Path) -> PathBuf {
    let extension = reference.extension().unwrap_or_default().to_string_lossy();
    beside(sensor, &format!("_reference.{extension}")).into()
}

fn print(names: &[PathBuf], found: &PhotometricCalibration, context: &mut Context) {
    let used = found
        .circles
        .iter()
        .filter(|circle| circle.used_px.is_some());
    context.line(format_args!(
        "sensor lit in colours, from {} of {} presses:",
        used.count(),
        names.len()
    ));
    let model = found.sensor.model();
    let angle = four_digits(found.median_angle_deg);
    context.row(
        "normals",
        format_args!("{angle}° off in the median press left out"),
    );
    let depth = four_digits(1e3 * model.depth_standard_error_m);
    context.row(
        "depth",
        format_args!("{depth} mm, standard error of presses left out"),
    );
    let [x, y, radius] = found.offset_px.map(four_digits);
    if found.circles.iter().any(|circle| circle.drawn_px.is_some()) {
        let text = format!("x {x}, y {y}, radius {radius} px from those found, in the median");
        context.row("drawn circles", text);
    }
    for (name, circle) in names.iter().zip(&found.circles) {
        let name = name.display();
        let words = |c: [f64; 3]| format!("x {:.1}, y {:.1}, radius {:.1} px", c[0], c[1], c[2]);
        let Some(seen) = circle.found_px else {
            context.line(format_args!("{name}: no contact found"));
            continue;
        };
        match circle.drawn_px.filter(|_| circle.wrong) {
            Some(drawn) => context.line(format_args!(
                "{name}: the drawn circle is wrong, it was left out: drawn {}, found {}",
                words(drawn),
                words(seen)
            )),
            None => context.line(format_args!("{name}: contact at {}", words(seen))),
        }
    }
}

/// Reads gradients and depth of frames with a sensor file.
pub fn depth(sensor: &Path, frames: &[PathBuf], context: &mut Context) -> Result<Exit, Failure> {
    let suffixes = [
        "_depth.csv",
        "_gradient_x.csv",
        "_gradient_y.csv",
        "_depth.svg",
    ];
    let names = frames
        .iter()
        .flat_map(|frame| suffixes.map(|suffix| beside(frame, suffix)));
    let names: Vec<_> = names.collect();
    let inputs: Vec<&Path> = frames
        .iter()
        .map(PathBuf::as_path)
        .chain([sensor])
        .collect();
    context.outputs.plan(&names, &inputs)?;
    let stereo = PhotometricSensor::read(sensor)?;
    let size = stereo.model().pixel_size_m;
    let images = frames.iter().map(read_colour_levels);
    let images = images.collect::<Result<Vec<_>, _>>()?;
    let mut values = Vec::new();
    for (k, path) in frames.iter().enumerate() {
        let reading = stereo.read(images[k].view());
        let reading = reading.map_err(|error| Failure::in_file(path, error))?;
        context.line(format_args!("{}:", path.display()));
        values.push(json!({
            "frame": path.display().to_string(), "contact": reading_value(&reading, size, context),
        }));
        if context.outputs.folder().is_none() {
            continue;
        }
        let [x, y] = [0, 1].map(|axis: usize| reading.gradient[axis].mapv(f64::from));
        let tables = [&reading.depth_m, &x, &y].map(Csv::of_grid);
        for (name, table) in names[4 * k..].iter().zip(tables) {
            context.outputs.add(name, table);
        }
        context
            .outputs
            .page(&names[4 * k + 3], || page(&reading, size))?;
    }
    context.value(&json!({ "frames": values }));
    Ok(Exit::Complete)
}

/// Prints a contact and returns it as JSON, null without one.
fn reading_value(reading: &PhotometricReading, size: f64, context: &mut Context) -> Value {
    let mut sums = [0.0; 3];
    for ((row, column), _) in reading
        .contact
        .indexed_iter()
        .filter(|(_, inside)| **inside)
    {
        let more = [1.0, column as f64, row as f64];
        sums.iter_mut()
            .zip(more)
            .for_each(|(sum, more)| *sum += more);
    }
    let [pixels, x, y] = sums;
    if pixels == 0.0 {
        context.line("no contact");
        return Value::Null;
    }
    let centroid = [x / pixels, y / pixels];
    let deepest = reading.depth_m.iter().copied().fold(0.0, f64::max);
    let area = pixels * size * size;
    let depth = Estimate::new(deepest, reading.depth_standard_error_m);
    let [x, y] = centroid.map(four_digits);
    context.row("centroid", format_args!("({x}, {y}) px"));
    context.row("area", format_args!("{} mm²", four_digits(1e6 * area)));
    context.row("depth", in_unit(depth, 1e3) + " mm at the deepest pixel");
    json!({ "centroid": centroid, "area_m2": area, "largest_depth_m": depth })
}

fn page(reading: &PhotometricReading, size: f64) -> Page {
    let depth = reading.depth_m.mapv(|z| 1e3 * z);
    let map = HeatMap::of_pixels(depth.view(), [1e3 * size; 2], "depth (mm)");
    let panel = Panel::new("Depth", "x (mm)", "y (mm)").heat_map(map);
    Page::new("Depth of the contact", 1, vec![panel])
}
