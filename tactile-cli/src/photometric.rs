//! Sensors with a gel that is lit in colours: `tactile calibrate` and `tactile depth` for them.
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::frames::{NamedFrame, Reading};
use crate::outputs::{Csv, beside};
use crate::plot::{HeatMap, Page, Panel};
use crate::text::{four_digits, in_unit};
use clap::Arg;
use clap::builder::ArgPredicate;
use ndarray::Array3;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tactile_files::io::{Grey, read_bytes};
use tactile_files::sensor::{PhotometricPresses, PhotometricSensor};
use tactile_imaging::core::Estimate;
use tactile_imaging::gel::{CalibrationReport, GelForce, GelFrame, GelSensor};

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
    let (calibrated, found) = found.map_err(|error| Failure::in_file(path, error))?;
    print(&presses.names, &calibrated, &found, context);
    let gel = presses.gel(&calibrated);
    let gel = gel.map_err(|error| Failure::in_file(path, error))?;
    if let Some(gel) = &gel {
        let modulus = Estimate::new(gel.youngs_modulus_pa, gel.youngs_modulus_error_pa);
        context.row("gel", in_unit(modulus, 1e-3) + " kPa");
    }
    let model = calibrated.model().clone();
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
        "depth_standard_error_m": model.depth_standard_error_m, "gel": gel,
    }));
    if context.outputs.folder().is_some() {
        let text = PhotometricSensor::new(&reference, model)
            .with_gel(gel)
            .to_toml();
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

fn print(names: &[PathBuf], sensor: &GelSensor, found: &CalibrationReport, context: &mut Context) {
    let used = found
        .circles
        .iter()
        .filter(|circle| circle.used_px.is_some());
    context.line(format_args!(
        "sensor lit in colours, from {} of {} presses:",
        used.count(),
        names.len()
    ));
    let model = sensor.model();
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

/// Why a sensor without a gel's layer has no force.
const NO_GEL: &str = "the sensor file has no [gel]: give its calibration the gel's thickness \
    and modulus, or a frame under a known weight";

/// Why nothing is measured.
pub const NO_FRAMES: &str =
    "a sensor file names no frames: give images, a video or - for a pipe after it";

/// A sensor with its law of forces, or why there is none.
pub struct Reader {
    pub stereo: GelSensor,
    pub law: Result<GelForce, String>,
}

impl Reader {
    pub fn open(sensor: &Path) -> Result<Self, Failure> {
        let (stereo, gel) = PhotometricSensor::read(sensor)?;
        let law = gel.ok_or_else(|| NO_GEL.to_owned());
        let law = law.and_then(|gel| GelForce::new(&gel, &stereo).map_err(|e| e.to_string()));
        Ok(Self { stereo, law })
    }

    /// How its frames are read.
    pub fn reading<'a>(&self, sensor: &'a Path) -> Reading<'a> {
        Reading {
            grey: Grey::default(),
            bits: None,
            reference: sensor,
            size: self.stereo.shape(),
        }
    }

    /// The force of a frame with contact, none without, or why it has none.
    pub fn force(&self, reading: &GelFrame) -> Result<Option<Estimate>, String> {
        let law = self.law.as_ref().map_err(String::clone)?;
        law.force(reading).map_err(|error| error.to_string())
    }
}

/// A force, null without contact, or an object with the reason why there is none.
pub fn number_or_error(force: &Result<Option<Estimate>, String>) -> Value {
    match force {
        Ok(force) => json!(force),
        Err(reason) => json!({ "error": reason }),
    }
}

/// Reads depth, contact and force of frames with a sensor file, and gives the tables of `depth`.
pub fn measure(sensor: &Path, frames: &[PathBuf], context: &mut Context) -> Result<Exit, Failure> {
    if frames.is_empty() {
        return Err(Failure::in_file(sensor, NO_FRAMES));
    }
    depth(sensor, frames, true, context)
}

/// Reads gradients and depth of frames with a sensor file, and their forces where `forces` is set.
pub fn depth(
    sensor: &Path,
    frames: &[PathBuf],
    forces: bool,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let reader = Reader::open(sensor)?;
    let stereo = &reader.stereo;
    let size = stereo.model().pixel_size_m;
    let source = reader.reading(sensor);
    let (images, exit) = source.all::<Array3<u8>>(frames, context)?;
    let suffixes = [
        "_depth.csv",
        "_gradient_x.csv",
        "_gradient_y.csv",
        "_depth.svg",
    ];
    let names = images
        .iter()
        .flat_map(|image| suffixes.map(|suffix| image.file(suffix)));
    let names: Vec<_> = names.collect();
    let inputs: Vec<&Path> = (frames.iter().map(PathBuf::as_path).chain([sensor])).collect();
    context.outputs.plan(&names, &inputs)?;
    let mut values = Vec::new();
    for (k, NamedFrame { name, pixels, .. }) in images.iter().enumerate() {
        let reading = stereo.read(pixels.view());
        let reading = reading.map_err(|error| Failure::in_file(Path::new(name), error))?;
        context.line(format_args!("{name}:"));
        let contact = GelContact::of(&reading, size);
        match &contact {
            Some(contact) => contact.print(context),
            None => context.line("no contact"),
        }
        let mut value = json!({ "frame": name, "contact": contact });
        if forces && contact.is_some() {
            let force = reader.force(&reading);
            match &force {
                Ok(Some(force)) => context.row("force", in_unit(*force, 1.0) + " N"),
                Ok(None) => context.row("force", "none: the contact is smaller than a cell"),
                Err(reason) => context.row("force", format_args!("none: {reason}")),
            }
            value["force_n"] = number_or_error(&force);
        } else if forces {
            value["force_n"] = Value::Null;
        }
        values.push(value);
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
    Ok(exit)
}

/// What a frame's contact is printed by.
#[derive(Serialize)]
pub struct GelContact {
    pub centroid: [f64; 2],
    pub area_m2: f64,
    pub largest_depth_m: Estimate,
}

impl GelContact {
    pub fn of(reading: &GelFrame, size: f64) -> Option<Self> {
        let mut sums = [0.0; 3];
        let touched = reading
            .contact
            .indexed_iter()
            .filter(|(_, inside)| **inside);
        for ((row, column), _) in touched {
            let more = [1.0, column as f64, row as f64];
            sums = [0, 1, 2].map(|k: usize| sums[k] + more[k]);
        }
        let [pixels, x, y] = sums;
        let deepest = reading.depth_m.iter().copied().fold(0.0, f64::max);
        (pixels > 0.0).then(|| Self {
            centroid: [x / pixels, y / pixels],
            area_m2: pixels * size * size,
            largest_depth_m: Estimate::new(deepest, reading.depth_standard_error_m),
        })
    }

    fn print(&self, context: &mut Context) {
        let [x, y] = self.centroid.map(four_digits);
        context.row("centroid", format_args!("({x}, {y}) px"));
        let area = four_digits(1e6 * self.area_m2);
        context.row("area", format_args!("{area} mm²"));
        let depth = in_unit(self.largest_depth_m, 1e3);
        context.row("depth", depth + " mm at the deepest pixel");
    }
}

fn page(reading: &GelFrame, size: f64) -> Page {
    let depth = reading.depth_m.mapv(|z| 1e3 * z);
    let map = HeatMap::of_pixels(depth.view(), [1e3 * size; 2], "depth (mm)");
    let panel = Panel::new("Depth", "x (mm)", "y (mm)").heat_map(map);
    Page::new("Depth of the contact", 1, vec![panel])
}
