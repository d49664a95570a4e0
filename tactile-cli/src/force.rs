//! `tactile force`: normal force, contact and stress from frames.
use crate::arguments::TableArguments;
use crate::calibrate::PairLine;
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::frames::{NamedFrame, SensorFrames};
use crate::outputs::Csv;
use crate::text::{digits, in_unit};
use clap::Args;
use ndarray::Array2;
use serde::Serialize;
use serde_json::json;
use std::path::PathBuf;
use tactile_files::io::Grey;
use tactile_imaging::Pipeline;
use tactile_imaging::force::{Estimate, ReferenceFrame, Source};
use tactile_imaging::pipeline::{ContactReading, Object, ReferenceLight, Session, Update};

/// Measure force, contact radius, centroid and stress in frames of a sensor that grows brighter
/// where it is pressed
///
/// First fits and reports the calibration (see `tactile calibrate`). --out gets force.csv (one row
/// per frame) and calibration.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile force --reference examples/data/press/reference.png --pairs \
                        examples/data/press/calibration.csv --pixel-um 40 \
                        examples/data/press/frame_1.png examples/data/press/frame_2.png
  tactile force --reference examples/data/press/reference.png --pairs \
                        examples/data/press/calibration.csv --pixel-um 40 \
                        examples/data/press/frame_1.png --out target/force")]
pub(crate) struct ForceArguments {
    #[command(flatten)]
    frames: SensorFrames,
    /// Calibration pairs: CSV with the columns integrated_pixel_value and force.
    #[arg(long, value_name = "PAIRS.csv")]
    pairs: PathBuf,
    /// Frame without contact from which the sums of the pairs were taken. With it, forces allow for
    /// lamps that changed since.
    #[arg(long, value_name = "IMAGE")]
    pairs_reference: Option<PathBuf>,
    /// The sensor has a fixed diffusing skin, so that the light does not depend on the object.
    #[arg(long)]
    skin: bool,
    #[command(flatten)]
    reading: TableArguments,
}

pub(crate) fn run(arguments: &ForceArguments, context: &mut Context) -> Result<Exit, Failure> {
    let ForceArguments {
        frames,
        pairs,
        pairs_reference,
        skin,
        reading,
    } = arguments;
    let table = "force.csv";
    let mut read = frames.files(pairs);
    read.extend(pairs_reference.as_deref());
    context.outputs.plan(&[table, PairLine::PAGE], &read)?;
    let line = PairLine::read(pairs, false, reading, context)?;
    let image = frames.read_reference(Grey::default())?;
    // Forces follow from the light for any object.
    let object = Object::Unknown {
        poisson_ratio: Object::DEFAULT_POISSON_RATIO,
    };
    let light = pairs_reference.as_deref().map(|path| {
        let image = frames.read_without_contact(path, Grey::default())?;
        let frame = ReferenceFrame::new(image.view());
        Ok::<_, Failure>(ReferenceLight::of(
            &frame.map_err(|e| Failure::in_file(path, e))?,
        ))
    });
    let light = light.transpose()?;
    let pipeline = Pipeline::from_pairs(&line.pairs, frames.pixel_m(), object);
    let pipeline = pipeline.and_then(|pipeline| {
        pipeline.with_settings(|settings| {
            settings.calibrated_light = light;
            if *skin {
                settings.assumptions.state(Source::Coupling, 0.0);
            }
        })
    });
    let mut session = pipeline
        .and_then(|pipeline| Session::new(&pipeline, &[image.view()]))
        .map_err(|error| Failure::in_file(&frames.reference, error))?;
    let read_frames = frames.reading(Grey::default(), &image);
    // Without a readable frame, the heading is not printed.
    let mut heading = Some(&line);
    let mut exit = Exit::Complete;
    let mut values = Vec::new();
    let mut csv = Csv::new(
        "frame,force_N,se_force_N,radius_m,se_radius_m,x_m,se_x_m,y_m,se_y_m,mean_stress_Pa,\
         se_mean_stress_Pa",
    );
    let unreadable =
        read_frames.each::<Array2<u8>>(&frames.frames, context, |frame, context| {
            let NamedFrame { name, pixels, .. } = frame.named();
            if let Some(line) = heading.take() {
                line.print(context);
                if pairs_reference.is_none() {
                    context.warn_of_unknown_light("--pairs-reference)");
                }
                context.warn_of_frame(&session.standing_cautions());
            }
            let found = session.push(pixels.view());
            context.line(format_args!("{name}:"));
            match found {
                Ok(Update { contact, .. }) => {
                    let answer = contact
                        .map(|contact| Answer::new(&contact, pixels.dim(), frames.pixel_m()));
                    print(answer.as_ref(), context);
                    context.warn_of_frame(&session.cautions());
                    csv.row(row(values.len(), answer.as_ref()));
                    values.push(json!({ "frame": name, "contact": answer }));
                }
                Err(error) => {
                    exit = Exit::Partial;
                    let error = error.numbered_from(1);
                    context.line(format_args!("no answer: {error}"));
                    values.push(json!({ "frame": name, "error": error.to_string() }));
                }
            }
            Ok(())
        })?;
    if unreadable > 0 {
        exit = Exit::Partial;
    }
    context.value(&json!({ "calibration": line.value(), "frames": values }));
    context.outputs.add(table, csv.into_bytes());
    context.outputs.page(PairLine::PAGE, || line.page())?;
    Ok(exit)
}

/// The numbers of a contact.
#[derive(Serialize)]
struct Answer {
    force_n: Option<Estimate>,
    #[serde(skip)]
    no_force_n: Option<f64>,
    contact_radius_m: Estimate,
    centroid_m: [Estimate; 2],
    mean_stress_pa: Option<Estimate>,
    peak_stress_pa: Option<Estimate>,
    /// Relative change of the force if the lens displaces the corners of the frame by 1 %.
    force_per_percent_of_distortion: Option<f64>,
}

impl Answer {
    fn new(contact: &ContactReading, shape: (usize, usize), pixel_m: [f64; 2]) -> Self {
        let [x, y] = contact.centroid_px;
        Self {
            force_n: contact.force_n.map(|force| force.total()),
            no_force_n: contact.no_force_n(),
            contact_radius_m: contact.contact_radius_m.total(),
            centroid_m: [x * pixel_m[0], y * pixel_m[1]],
            mean_stress_pa: contact.mean_stress_pa().map(|stress| stress.total()),
            peak_stress_pa: contact.peak_stress_pa.map(|stress| stress.total()),
            force_per_percent_of_distortion: contact
                .per_distortion(shape, pixel_m)
                .map(|[force, _]| force),
        }
    }
}

fn print(answer: Option<&Answer>, context: &mut Context) {
    let Some(answer) = answer else {
        context.line("no contact");
        return;
    };
    if let Some(most_n) = answer.no_force_n {
        context.line(format_args!("no force (< {most_n:.2e} N)"));
        return;
    }
    if let Some(force) = answer.force_n {
        context.row("force", in_unit(force, 1.0) + " N");
    }
    context.row("radius", in_unit(answer.contact_radius_m, 1e3) + " mm");
    let [x, y] = answer.centroid_m.map(|e| in_unit(e, 1e3));
    context.row("centroid", format_args!("({x}, {y}) mm"));
    if let (Some(mean), Some(peak)) = (answer.mean_stress_pa, answer.peak_stress_pa) {
        let [mean, peak] = [mean, peak].map(|e| in_unit(e, 1e-3));
        context.row("stress", format_args!("{mean} kPa mean, {peak} kPa peak"));
    }
    // Named if it matters beside the error of the force.
    let error = answer.force_n.map_or(0.0, |force| force.relative_error());
    let lens = answer.force_per_percent_of_distortion;
    if let Some(share) = lens.filter(|share| 3.0 * share.abs() > error) {
        let share = digits(100.0 * share, 2);
        context.row(
            "lens",
            format_args!("the force changes by {share} % for 1 % of distortion at the corners"),
        );
    }
}

/// The row of a frame, with NaN without contact.
fn row(k: usize, answer: Option<&Answer>) -> Vec<f64> {
    let numbers = match answer {
        Some(answer) => {
            let [x, y] = answer.centroid_m.map(Some);
            let radius = Some(answer.contact_radius_m);
            [answer.force_n, radius, x, y, answer.mean_stress_pa]
        }
        None => [Some(Estimate::default()), None, None, None, None],
    };
    let cells = numbers.map(|number| {
        let number = number.unwrap_or(Estimate::new(f64::NAN, f64::NAN));
        [number.value, number.standard_error]
    });
    let row = std::iter::once(k as f64 + 1.0).chain(cells.concat());
    row.collect()
}
