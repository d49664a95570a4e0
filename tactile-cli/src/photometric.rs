//! `tactile calibrate` and `tactile depth` for gels lit in colours.
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::frames::{NamedFrame, Reading};
use crate::mesh;
use crate::outputs::{Csv, Npz, beside};
use crate::plot::{Colour, HeatMap, Page, Panel};
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
use tactile_imaging::gel::{BallFace, CalibrationReport, GelContact, GelFrame, GelLaw, GelSensor};

/// An argument that a sensor file replaces. `filler` is parsed but not used.
pub(crate) fn unless_sensor(arg: Arg, filler: &'static str) -> Arg {
    arg.required(false)
        .required_unless_present("sensor")
        .default_value_if("sensor", ArgPredicate::IsPresent, filler)
}

/// Calibrates from the presses in the file. `sensor` is the name of the sensor file in the folder
/// of results. The frame without contact is written beside it.
pub(crate) fn calibrate(
    path: &Path,
    sensor: &Path,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let presses = PhotometricPresses::read(path)?;
    let reference = reference_name(sensor, &presses.reference_path);
    if let Some(folder) = context.outputs.folder().map(Path::to_path_buf) {
        context.outputs.plan_in(&folder, &[&reference], &[path])?;
    }
    let found = presses.calibrate();
    let (calibrated, found) = found.map_err(|error| Failure::in_file(path, error))?;
    print(&presses.names, &calibrated.sensor, &found, context);
    for doubt in &found.doubts {
        context.warn(doubt.kind(), json!({}), doubt);
    }
    if let Some(gel) = &calibrated.layer {
        let modulus = Estimate::new(gel.youngs_modulus_pa, gel.youngs_modulus_error_pa);
        context.row("gel", in_unit(modulus, 1e-3) + " kPa");
    }
    if let Some(gauge) = &calibrated.gauge {
        let [exponent, scatter] = [gauge.exponent(), 100.0 * gauge.scatter()].map(four_digits);
        let law = format!("force as volume to the power {exponent}, readings off by {scatter} %");
        context.row("gauge", law);
    }
    let model = calibrated.sensor.model();
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
        "slope_standard_error": model.slope_standard_error, "face": found.face, "gel": calibrated.layer,
        "gauge": calibrated.gauge,
    }));
    if context.outputs.folder().is_some() {
        let text = PhotometricSensor::of(&reference, &calibrated).to_toml();
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
        format_args!("{depth} mm, standard error of a pixel of presses left out"),
    );
    let slope = four_digits(1e2 * model.slope_standard_error);
    context.row(
        "slopes",
        format_args!("{slope} %, standard error of all slopes of a press left out"),
    );
    if found.face == BallFace::Paraboloid {
        context.row(
            "face",
            "a paraboloid, as of Hertz's law, fits the light better than a ball",
        );
    }
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

/// The reason why a sensor without a gel layer has no force.
const NO_GEL: &str = "the sensor file has no [gel]: give its calibration the gel's thickness \
    and modulus, a frame under a known weight, or readings of a gauge";

/// The error if a sensor file is given without frames.
pub(crate) const NO_FRAMES: &str =
    "a sensor file names no frames: give images, a video or - for a pipe after it";

/// A sensor with its force law, or the reason why there is none.
pub(crate) struct Reader {
    pub stereo: GelSensor,
    pub law: Result<GelLaw, String>,
}

impl Reader {
    pub(crate) fn open(sensor: &Path) -> Result<Self, Failure> {
        let gel = PhotometricSensor::read(sensor)?;
        let law = gel.law().map_err(|error| error.to_string());
        let law = law.and_then(|law| law.ok_or_else(|| NO_GEL.to_owned()));
        let stereo = gel.sensor;
        Ok(Self { stereo, law })
    }

    /// The options for reading its frames.
    pub(crate) fn reading<'a>(&self, sensor: &'a Path) -> Reading<'a> {
        Reading {
            grey: Grey::default(),
            bits: None,
            reference: sensor,
            size: self.stereo.shape(),
        }
    }

    /// The total force of a frame: `None` without contact, or the reason why there is none.
    pub(crate) fn force(&self, reading: &GelFrame) -> Result<Option<Estimate>, String> {
        let law = self.law.as_ref().map_err(String::clone)?;
        Ok(law.force(reading))
    }

    /// The force of each contact, if the sensor has a force law.
    fn forces(&self, reading: &GelFrame) -> Vec<Option<Estimate>> {
        match &self.law {
            Ok(law) => law.forces(reading).into_iter().map(Some).collect(),
            Err(_) => vec![None; reading.contacts.len()],
        }
    }
}

/// A force as JSON: null without contact, or an object with the reason why there is none.
pub(crate) fn number_or_error(force: &Result<Option<Estimate>, String>) -> Value {
    match force {
        Ok(force) => json!(force),
        Err(reason) => json!({ "error": reason }),
    }
}

/// Reads depth, contact and force of frames with a sensor file, and writes the files of `depth`.
pub(crate) fn measure(
    sensor: &Path,
    frames: &[PathBuf],
    context: &mut Context,
) -> Result<Exit, Failure> {
    if frames.is_empty() {
        return Err(Failure::in_file(sensor, NO_FRAMES));
    }
    depth(sensor, frames, true, context)
}

/// Suffixes of the files of a frame.
const SUFFIXES: [&str; 7] = [
    "_depth.csv",
    "_gradient_x.csv",
    "_gradient_y.csv",
    "_contact.csv",
    ".ply",
    ".npz",
    "_depth.svg",
];

/// Reads gradients, face and contacts of frames with a sensor file, and their forces if `forces` is
/// set.
pub(crate) fn depth(
    sensor: &Path,
    frames: &[PathBuf],
    forces: bool,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let reader = Reader::open(sensor)?;
    let stereo = &reader.stereo;
    let size = stereo.model().pixel_size_m;
    let source = reader.reading(sensor);
    let (images, unreadable) = source.all::<Array3<u8>>(frames, context)?;
    let mut exit = Exit::complete_if(unreadable == 0);
    let names = images
        .iter()
        .flat_map(|image| SUFFIXES.map(|suffix| image.file(suffix)));
    let names: Vec<_> = names.collect();
    let inputs: Vec<&Path> = (frames.iter().map(PathBuf::as_path).chain([sensor])).collect();
    context.outputs.plan(&names, &inputs)?;
    let mut values = Vec::new();
    for (image, names) in images.iter().zip(names.chunks(SUFFIXES.len())) {
        let NamedFrame { name, pixels, .. } = image;
        let reading = stereo.read(pixels.view());
        let reading = reading.map_err(|error| Failure::in_file(Path::new(name), error))?;
        context.line(format_args!("{name}:"));
        let contacts = contacts(&reading, &reader.forces(&reading), forces);
        match contacts.as_slice() {
            [] if reading.is_refused() => context.line("not read"),
            [] => context.line("no contact"),
            all => print_contacts(&reading, &reader.forces(&reading), all.len(), context),
        }
        warn(&reading, name, context);
        let mut value = json!({
            "frame": name, "contact": contacts.first(), "contacts": contacts,
        });
        if reading.is_refused() {
            exit = Exit::Partial;
        }
        if forces && !contacts.is_empty() {
            let force = reader.force(&reading);
            match &force {
                Ok(Some(force)) => context.row("force", in_unit(*force, 1.0) + " N"),
                Ok(None) => {}
                Err(reason) => context.row("force", format_args!("none: {reason}")),
            }
            value["force_n"] = number_or_error(&force);
        } else if forces {
            value["force_n"] = Value::Null;
        }
        values.push(value);
        if context.outputs.folder().is_none() || reading.is_refused() {
            continue;
        }
        let [x, y] = [0, 1].map(|axis: usize| reading.gradient[axis].mapv(f64::from));
        let labels = reading.labels.mapv(f64::from);
        let tables = [&reading.depth_m, &x, &y, &labels].map(Csv::of_grid);
        for (name, table) in names.iter().zip(tables) {
            context.outputs.add(name, table);
        }
        context
            .outputs
            .add(&names[4], mesh::ply(&reading.depth_m, size));
        let mut arrays = Npz::new();
        for (name, grid) in [
            ("depth_m", &reading.depth_m),
            ("gradient_x", &x),
            ("gradient_y", &y),
            ("contact", &labels),
        ] {
            let shape = [grid.nrows(), grid.ncols()];
            arrays.add(name, "<f8", &shape, grid.iter().map(|v| v.to_le_bytes()))?;
        }
        context.outputs.add(&names[5], arrays.into_bytes()?);
        context.outputs.page(&names[6], || page(&reading, size))?;
    }
    context.value(&json!({ "frames": values }));
    Ok(exit)
}

/// The cautions of a frame.
pub(crate) fn warn(reading: &GelFrame, name: &str, context: &mut Context) {
    for doubt in &reading.doubts {
        context.warn(doubt.kind(), json!({ "frame": name }), doubt);
    }
}

/// The contacts of a frame, printed and as JSON.
fn contacts(reading: &GelFrame, forces: &[Option<Estimate>], wanted: bool) -> Vec<Value> {
    let value = |(contact, force): (&GelContact, &Option<Estimate>)| {
        let mut value = GelReading::of_contact(contact).value();
        value["outline_px"] = json!(contact.outline_px);
        value["touches_border"] = json!(contact.touches_border);
        if let Some(force) = force.filter(|_| wanted) {
            value["force_n"] = json!(force);
        }
        value
    };
    reading.contacts.iter().zip(forces).map(value).collect()
}

fn print_contacts(
    reading: &GelFrame,
    forces: &[Option<Estimate>],
    count: usize,
    context: &mut Context,
) {
    for (k, (contact, force)) in reading.contacts.iter().zip(forces).enumerate() {
        if count > 1 {
            context.line(format_args!("contact {} of {count}", k + 1));
        }
        let [x, y] = contact.centroid_px.map(|at| in_unit(at, 1.0));
        context.row("centroid", format_args!("({x}, {y}) px"));
        context.row("area", in_unit(contact.area_m2, 1e6) + " mm²");
        let depth = in_unit(contact.depth_m, 1e3);
        context.row("depth", depth + " mm below the contact's rim");
        let depth = in_unit(contact.depth_below_far_m, 1e3);
        context.row("", depth + " mm below the gel far away");
        if let (Some(force), true) = (force, count > 1) {
            context.row("force", in_unit(*force, 1.0) + " N");
        }
    }
}

/// The numbers of the first contact of a frame, for printing.
#[derive(Clone, Copy, Serialize)]
pub(crate) struct GelReading {
    pub centroid: [f64; 2],
    pub area_m2: f64,
    pub area_error_m2: f64,
    /// Largest depth below the rim of the contact.
    pub largest_depth_m: Estimate,
    pub depth_below_far_m: Estimate,
}

impl GelReading {
    pub(crate) fn of(reading: &GelFrame) -> Option<Self> {
        reading.contacts.first().map(Self::of_contact)
    }

    fn of_contact(contact: &GelContact) -> Self {
        Self {
            centroid: contact.centroid_px.map(|at| at.value),
            area_m2: contact.area_m2.value,
            area_error_m2: contact.area_m2.standard_error,
            largest_depth_m: contact.depth_m,
            depth_below_far_m: contact.depth_below_far_m,
        }
    }

    fn value(&self) -> Value {
        json!(self)
    }
}

fn page(reading: &GelFrame, size: f64) -> Page {
    let depth = reading.depth_m.mapv(|z| 1e3 * z);
    let map = HeatMap::of_pixels(depth.view(), [1e3 * size; 2], "depth (mm)");
    let mut panel = Panel::new("Face", "x (mm)", "y (mm)").heat_map(map);
    for (k, contact) in reading.contacts.iter().enumerate() {
        let line = contact.outline_px.iter().chain(contact.outline_px.first());
        let line: Vec<[f64; 2]> = line.map(|at| at.map(|v| 1e3 * size * v as f64)).collect();
        let name = if k == 0 { "contact" } else { "" };
        panel = panel.line(line, Colour::Orange, name);
    }
    Page::new("Face of the gel", 1, vec![panel])
}
