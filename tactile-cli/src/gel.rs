//! Gel sensors, lit in colours or darkening: `tactile calibrate` and `tactile depth` for them.
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::frames::{NamedFrame, Pixels, Reading};
use crate::mesh;
use crate::outputs::{Csv, Npz, beside};
use crate::plot::{Colour, HeatMap, Page, Panel, circle};
use crate::text::{four_digits, in_unit};
use clap::Arg;
use clap::builder::ArgPredicate;
use ndarray::{Array2, Array3};
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tactile_files::io::{Grey, read_bytes};
use tactile_files::sensor::{GelFile, GelPresses};
use tactile_imaging::PairsDoubt;
use tactile_imaging::core::Estimate;
use tactile_imaging::gel::{
    BallFace, CalibrationReport, GelContact, GelFrame, GelImage, GelLaw, GelMarkers, GelModel,
    GelSensor, GelWrench, MarkerSlip,
};
use tactile_imaging::pipeline::BallFit;
use tactile_imaging::sfs::Domain;

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
    let presses = GelPresses::read(path)?;
    let reference = reference_name(sensor, &presses.reference_path);
    if let Some(folder) = context.outputs.folder().map(Path::to_path_buf) {
        context.outputs.plan_in(&folder, &[&reference], &[path])?;
    }
    let found = presses.calibrate();
    let (calibrated, found) = found.map_err(|error| Failure::in_file(path, error))?;
    let model = calibrated.sensor.model();
    let mut value = json!({ "gel": calibrated.layer, "gauge": calibrated.gauge });
    match &found {
        Some(found) => {
            print(&presses.names, &calibrated.sensor, found, context);
            for doubt in &found.doubts {
                context.warn(doubt.kind(), json!({}), doubt);
            }
            let pairs = presses.names.iter().zip(&found.circles);
            let circles: Vec<Value> = pairs
                .map(|(name, circle)| json!({ "image": name.display().to_string(), "circle": circle }))
                .collect();
            value["presses"] = json!(circles);
            value["offset_px"] = json!(found.offset_px);
            value["median_angle_deg"] = json!(found.median_angle_deg);
            value["face"] = json!(found.face);
            value["depth_standard_error_m"] = json!(model.depth_standard_error_m());
            value["slope_standard_error"] = json!(model.slope_standard_error());
            if let GelModel::Colour(model) = model {
                value["normal_standard_error"] = json!(model.normal_standard_error);
            }
        }
        None => context.line("sensor of a gel that darkens, from a table of depths"),
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
    context.value(&value);
    if context.outputs.folder().is_some() {
        let text = GelFile::of(&reference, &calibrated).to_toml();
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
    let model = sensor.model();
    let kind = match model {
        GelModel::Dark(_) => "sensor of a gel that darkens",
        _ => "sensor lit in colours",
    };
    context.line(format_args!(
        "{kind}, from {} of {} presses:",
        used.count(),
        names.len()
    ));
    let angle = four_digits(found.median_angle_deg);
    context.row(
        "normals",
        format_args!("{angle}° off in the median press left out"),
    );
    let depth = four_digits(1e3 * model.depth_standard_error_m());
    context.row(
        "depth",
        format_args!("{depth} mm, standard error of a pixel of presses left out"),
    );
    let slope = four_digits(1e2 * model.slope_standard_error());
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
    pub sensor: GelSensor,
    pub law: Result<GelLaw, String>,
    /// Conversion of colours to grey, for a gel that darkens.
    pub grey: Grey,
    pub bits: Option<u8>,
}

impl Reader {
    pub(crate) fn open(sensor: &Path) -> Result<Self, Failure> {
        let gel = GelFile::read(sensor)?;
        let law = gel.law().map_err(|error| error.to_string());
        Ok(Self {
            law: law.and_then(|law| law.ok_or_else(|| NO_GEL.to_owned())),
            sensor: gel.sensor,
            grey: gel.grey,
            bits: None,
        })
    }

    /// A sensor without a law of forces.
    pub(crate) fn of(sensor: GelSensor, grey: Grey, bits: Option<u8>) -> Self {
        let law = Err(NO_GEL.to_owned());
        Self {
            sensor,
            law,
            grey,
            bits,
        }
    }

    pub(crate) fn has_colours(&self) -> bool {
        matches!(self.sensor.reference(), GelImage::Colour(_))
    }

    /// How its frames are read, to the size of a reference.
    pub(crate) fn reading<'a>(&self, reference: &'a Path) -> Reading<'a> {
        Reading {
            grey: self.grey,
            bits: self.bits,
            reference,
            size: self.sensor.shape(),
        }
    }

    /// A follower of the dots, if the gel has any.
    pub(crate) fn markers(&self) -> Option<GelMarkers> {
        self.sensor
            .has_dots()
            .then(|| GelMarkers::new(&self.sensor))
    }

    /// Force, torque and slip from the dots of a frame.
    pub(crate) fn sideways(
        &self,
        markers: &mut GelMarkers,
        frame: GelImage<'_>,
        reading: &GelFrame,
    ) -> Result<Sideways, String> {
        let slip = markers.follow(frame, reading);
        let slip = slip.map_err(|error| error.to_string())?;
        if let Some(doubt) = markers.field().doubt {
            return Err(PairsDoubt::Matcher(doubt).to_string());
        }
        let wrench = match &self.law {
            Ok(GelLaw::Layer(law)) => law.wrench(reading, Some(markers.field())),
            _ => None,
        };
        Ok(Sideways { wrench, slip })
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

/// What the dots of a gel show of a frame.
#[derive(Clone, Copy, Serialize)]
pub(crate) struct Sideways {
    /// Forces and torques. `None` without contact, or for a sensor without a gel layer.
    pub wrench: Option<GelWrench>,
    /// Slip since the contact began. `None` with fewer than four dots under it.
    pub slip: Option<MarkerSlip>,
}

impl Sideways {
    fn print(&self, context: &mut Context) {
        if let Some(wrench) = &self.wrench {
            let [x, y, _] = wrench.force_n;
            let torque = wrench.torque_nm[2];
            for (name, force) in [("force along x", x), ("force along y", y)] {
                if let Some(force) = force {
                    context.row(name, in_unit(force, 1.0) + " N");
                }
            }
            if let Some(torque) = torque {
                context.row("torque about z", in_unit(torque, 1e3) + " mN m");
            }
        }
        if let Some(slip) = &self.slip {
            let percent = 100.0 * slip.share;
            let text = format!(
                "{percent:.0} % of {} dots since the contact began",
                slip.markers
            );
            context.row("slip", text);
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

/// A ball that is fitted to the depth of the first contact.
#[derive(Clone, Copy)]
pub(crate) enum Ball {
    Any,
    OfRadius(f64),
}

/// What is measured besides face and contacts.
#[derive(Clone, Copy)]
pub(crate) struct Wanted {
    pub forces: bool,
    pub ball: Option<Ball>,
}

/// Measures frames with a sensor file, with forces and without a ball.
pub(crate) fn measure(
    sensor: &Path,
    frames: &[PathBuf],
    context: &mut Context,
) -> Result<Exit, Failure> {
    if frames.is_empty() {
        return Err(Failure::in_file(sensor, NO_FRAMES));
    }
    let wanted = Wanted {
        forces: true,
        ball: None,
    };
    depth(
        &Reader::open(sensor)?,
        sensor,
        &[sensor],
        frames,
        wanted,
        context,
    )
}

/// Reads gradients, face and contacts of frames. `reference` is compared with the frames, and
/// `inputs` are the other files that must not be overwritten.
pub(crate) fn depth(
    reader: &Reader,
    reference: &Path,
    inputs: &[&Path],
    frames: &[PathBuf],
    wanted: Wanted,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let source = reader.reading(reference);
    let inputs = frames
        .iter()
        .map(PathBuf::as_path)
        .chain(inputs.iter().copied());
    let inputs: Vec<&Path> = inputs.collect();
    if reader.has_colours() {
        let images = source.all::<Array3<u8>>(frames, context)?;
        depth_of(reader, images, &inputs, wanted, context)
    } else {
        let images = source.all::<Array2<u8>>(frames, context)?;
        depth_of(reader, images, &inputs, wanted, context)
    }
}

fn depth_of<P: Pixels>(
    reader: &Reader,
    (images, unreadable): (Vec<NamedFrame<P>>, usize),
    inputs: &[&Path],
    Wanted { forces, ball }: Wanted,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let size = reader.sensor.pixel_size_m();
    let mut exit = Exit::complete_if(unreadable == 0);
    let names = images
        .iter()
        .flat_map(|image| SUFFIXES.map(|suffix| image.file(suffix)));
    let names: Vec<_> = names.collect();
    context.outputs.plan(&names, inputs)?;
    let mut values = Vec::new();
    let mut markers = reader.markers();
    for (image, names) in images.iter().zip(names.chunks(SUFFIXES.len())) {
        let NamedFrame { name, pixels, .. } = image;
        let reading = reader.sensor.read(pixels.image());
        let reading = reading.map_err(|error| Failure::in_file(Path::new(name), error))?;
        context.line(format_args!("{name}:"));
        let each = reader.forces(&reading);
        let contacts = contacts(&reading, &each, forces);
        match contacts.as_slice() {
            [] if reading.is_refused() => context.line("not read"),
            [] => context.line("no contact"),
            all => print_contacts(&reading, &each, all.len(), context),
        }
        warn(&reading, name, context);
        let mut value = json!({
            "frame": name, "contact": contacts.first(), "contacts": contacts,
        });
        let fit = ball
            .filter(|_| !contacts.is_empty())
            .map(|ball| fitted(&reading, size, ball));
        if let Some(fit) = &fit {
            value["ball"] = print_ball(fit.as_ref(), context);
            if fit.is_none() {
                exit = Exit::Partial;
            }
        }
        let fit = fit.flatten();
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
        if let Some(markers) = markers.as_mut().filter(|_| forces && !reading.is_refused()) {
            match reader.sideways(markers, pixels.image(), &reading) {
                Ok(sideways) => {
                    sideways.print(context);
                    value["dots"] = json!(sideways);
                }
                Err(reason) => {
                    context.warn("doubtful_pairs", json!({ "frame": name }), &reason);
                    value["dots"] = json!({ "error": reason });
                }
            }
        }
        values.push(value);
        if let Some(report) = context
            .outputs
            .report
            .as_mut()
            .filter(|_| !reading.is_refused())
        {
            let heights_mm = reading.depth_m.mapv(|z| 1e3 * z);
            report.surface(
                &format!("depth in {name}"),
                heights_mm.view(),
                [1e3 * size; 2],
            );
        }
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
        let page = || page(&reading, fit.as_ref(), size);
        context.outputs.page(&names[6], page)?;
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

/// The depth inside the first contact, NaN outside.
fn first_contact(reading: &GelFrame) -> Array2<f64> {
    let mut depth = reading.depth_m.clone();
    depth.zip_mut_with(&reading.labels, |depth, label| {
        if *label != 1 {
            *depth = f64::NAN;
        }
    });
    depth
}

fn fitted(reading: &GelFrame, size: f64, ball: Ball) -> Option<BallFit> {
    let (depth, domain) = (first_contact(reading), Domain::new([size; 2]).ok()?);
    match ball {
        Ball::Any => BallFit::of_any_radius(depth.view(), &domain),
        Ball::OfRadius(radius_m) => BallFit::of_radius(depth.view(), &domain, radius_m),
    }
}

/// Prints the ball and returns it as JSON.
fn print_ball(ball: Option<&BallFit>, context: &mut Context) -> Value {
    let Some(ball) = ball else {
        let reason = "no ball fits the depth";
        context.row("ball", format_args!("none: {reason}"));
        return json!({ "error": reason });
    };
    let depth_m = ball.depth_m(ball.centre_m);
    let lengths = [
        ball.radius_m,
        depth_m,
        ball.contact_radius_m,
        ball.mean_absolute_error_m,
    ];
    let [radius, depth, contact, error] = lengths.map(|m| four_digits(1e3 * m));
    let text = format!("of radius {radius} mm, {depth} mm deep, contact radius {contact} mm");
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

/// Mean measured depth and depth of the ball as a function of the distance from the centre of the
/// ball, in mm: distance, measured, ball.
fn profile(depth_m: &Array2<f64>, size: f64, ball: &BallFit) -> Vec<[f64; 3]> {
    // Twenty rings up to a fifth of the radius outside the contact.
    let width = ball.contact_radius_m * 1.2 / 20.0;
    let mut rings = [[0.0; 4]; 20];
    for ((row, column), depth) in depth_m.indexed_iter() {
        let [x, y] = [column as f64 * size, row as f64 * size];
        let distance = (x - ball.centre_m[0]).hypot(y - ball.centre_m[1]);
        if let Some(ring) = rings.get_mut((distance / width) as usize) {
            let more = [1.0, distance, *depth, ball.depth_m([x, y])];
            ring.iter_mut().zip(more).for_each(|(sum, v)| *sum += v);
        }
    }
    let filled = rings.iter().filter(|ring| ring[0] > 0.0);
    let mean = |[n, r, z, b]: &[f64; 4]| [r, z, b].map(|sum| 1e3 * sum / n);
    filled.map(mean).collect()
}

fn page(reading: &GelFrame, ball: Option<&BallFit>, size: f64) -> Page {
    let depth = reading.depth_m.mapv(|z| 1e3 * z);
    let map = HeatMap::of_pixels(depth.view(), [1e3 * size; 2], "depth (mm)");
    let mut panel = Panel::new("Face", "x (mm)", "y (mm)").heat_map(map);
    for (k, contact) in reading.contacts.iter().enumerate() {
        let line = contact.outline_px.iter().chain(contact.outline_px.first());
        let line: Vec<[f64; 2]> = line.map(|at| at.map(|v| 1e3 * size * v as f64)).collect();
        let name = if k == 0 { "contact" } else { "" };
        panel = panel.line(line, Colour::Orange, name);
    }
    let mut panels = vec![panel];
    if let Some(ball) = ball {
        let centre = ball.centre_m.map(|m| 1e3 * m);
        let rim = circle(centre, 1e3 * ball.contact_radius_m);
        panels = vec![panels.remove(0).line(rim, Colour::Red, "ball's contact")];
        let rings = profile(&reading.depth_m, size, ball);
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
    Page::new("Face of the gel", panels.len(), panels)
}
