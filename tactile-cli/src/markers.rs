//! `tactile markers`: printed markers followed from a reference.
use crate::arguments::positive;
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::frames::{NamedFrame, Reading};
use crate::outputs::Csv;
use crate::stream::listed;
use crate::text::in_unit;
use clap::Args;
use ndarray::Array2;
use serde_json::{Value, json};
use std::path::PathBuf;
use tactile_files::io::{Grey, image_size, read_grey_image};
use tactile_imaging::PairsDoubt;
use tactile_imaging::gel::{MarkerField, find_markers};

/// Follow the markers of a gel from a reference to frames
///
/// Dark dots of one size are found in colour or grey images, even under uneven light. The matcher
/// pairs them in any order, and markers may be missing. Frames are followed one after the other, so
/// that a grid may move by more than its pitch. --out gets NAME_markers.csv for every frame NAME,
/// with one row per marker of the reference. A row has position and displacement in pixels, the
/// standard errors of a coordinate of both, and whether the marker is visible (if 0, its
/// displacement is estimated from its neighbours). With shear modulus and thickness of the gel, the
/// force along x and y and the torque about the mean of the markers are printed.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile markers --reference examples/data/markers_reference.png examples/data/markers_frame.png
  tactile markers --reference examples/data/markers_reference.png examples/data/markers_frame.png \
                        --pixel-um 100 --shear-modulus-kpa 40 --thickness-mm 4 --out \
                        target/markers")]
pub(crate) struct MarkersArguments {
    /// Frames: images, folders, videos, arrays, or - for a pipe.
    #[arg(required = true)]
    frames: Vec<PathBuf>,
    /// Frame before the markers moved.
    #[arg(long, value_name = "IMAGE")]
    reference: PathBuf,
    /// The largest displacement of a marker between consecutive frames, in pixels.
    #[arg(long, value_name = "PX", value_parser = positive)]
    largest_motion_px: Option<f64>,
    /// Size of a pixel on the gel in micrometres.
    #[arg(long, value_name = "UM", value_parser = positive, requires = "shear_modulus_kpa")]
    pixel_um: Option<f64>,
    /// Shear modulus of the gel in kPa, a third of its Young's modulus.
    #[arg(long, value_name = "KPA", value_parser = positive, requires = "thickness_mm")]
    shear_modulus_kpa: Option<f64>,
    /// Thickness of the gel in mm.
    #[arg(long, value_name = "MM", value_parser = positive, requires = "pixel_um")]
    thickness_mm: Option<f64>,
}

pub(crate) fn run(arguments: &MarkersArguments, context: &mut Context) -> Result<Exit, Failure> {
    let MarkersArguments {
        frames, reference, ..
    } = arguments;
    if let Some((rows, columns)) = image_size(reference) {
        // Grey levels as numbers, the surrounding light, and the passes that find the dots.
        let bytes = 80.0 * rows as f64 * columns as f64;
        context.allow(bytes, "finding the markers", "give smaller images")?;
    }
    let frames = listed(frames)?;
    let rest = read_grey_image(reference, Grey::Mean, None)?.levels;
    let reading = Reading {
        grey: Grey::Mean,
        bits: None,
        reference,
        size: rest.dim(),
    };
    let before = find_markers(rest.view());
    let mut field = MarkerField::at_rest(&before);
    if let Some(motion) = arguments.largest_motion_px {
        field = field
            .with_largest_motion_px(motion)
            .map_err(Failure::input)?;
    }
    let (images, unreadable) = reading.all::<Array2<u8>>(&frames, context)?;
    let mut exit = Exit::complete_if(unreadable == 0);
    let names = images.iter().map(|image| image.file("_markers.csv"));
    let names: Vec<_> = names.collect();
    let inputs: Vec<_> = frames.iter().chain([reference]).collect();
    context.outputs.plan(&names, &inputs)?;
    let mut values = Vec::new();
    for (
        NamedFrame {
            name: frame,
            pixels,
            ..
        },
        name,
    ) in images.iter().zip(&names)
    {
        let after = find_markers(pixels.mapv(f64::from).view());
        context.line(format_args!("{frame}:"));
        let (first, now) = (before.len(), after.len());
        context.row(
            "markers",
            format_args!("{first} in the reference, {now} in the frame"),
        );
        match field.followed(&after) {
            Ok(found) => {
                field = found;
                values.push(arguments.print(frame, &field, context));
                context.outputs.add(name, table(&field));
            }
            Err(error) => {
                context.row("followed", format_args!("none: {error}"));
                values.push(json!({ "frame": frame, "error": error.to_string() }));
                exit = Exit::Partial;
            }
        }
    }
    context.value(&json!({ "reference_markers": before.len(), "frames": values }));
    Ok(exit)
}

fn table(field: &MarkerField) -> Vec<u8> {
    let mut csv =
        Csv::new("x_px,y_px,dx_px,dy_px,x_error_px,y_error_px,dx_error_px,dy_error_px,seen");
    for track in &field.tracks {
        let (p, u, [own, moved]) = (
            track.position_px,
            track.displacement_px,
            track.standard_errors_px,
        );
        let seen = f64::from(u8::from(track.seen_row.is_some()));
        csv.row([p.x, p.y, u.x, u.y, own, own, moved, moved, seen]);
    }
    csv.into_bytes()
}

impl MarkersArguments {
    fn print(&self, frame: &str, field: &MarkerField, context: &mut Context) -> Value {
        let followed = field.seen().count();
        let largest = field.largest_px();
        let by = largest.map_or_else(|| "0".to_owned(), |px| in_unit(px, 1.0));
        context.row("followed", format_args!("{followed}, by {by} px at most"));
        if let Some(step) = field.period {
            let text = format_args!("{step}: the smallest motion since the last frame");
            context.row("assumed", text);
        }
        if let Some(doubt) = &field.doubt {
            let sentence = PairsDoubt::Matcher(*doubt);
            context.warn("doubtful_pairs", json!({ "frame": frame }), sentence);
        }
        let strain = field.strain().map(|strain| {
            for (name, part) in ["xx", "yy", "xy"].iter().zip(strain) {
                context.row(&format!("strain {name}"), in_unit(part, 100.0) + " %");
            }
            let [xx, yy, xy] = strain;
            json!({ "xx": xx, "yy": yy, "xy": xy })
        });
        let shear = self
            .shear_modulus_kpa
            .zip(self.thickness_mm)
            .zip(self.pixel_um);
        let shear = shear.and_then(|((kpa, mm), um)| field.shear(1e6 * kpa / mm, 1e-6 * um));
        let shear = shear.map(|shear| {
            for (name, force) in ["F_x", "F_y"].iter().zip(shear.force_n) {
                context.row(name, in_unit(force, 1e3) + " mN");
            }
            context.row("M_z", in_unit(shear.torque_nm, 1e6) + " mN mm");
            json!({ "force_n": shear.force_n, "torque_nm": shear.torque_nm })
        });
        json!({
            "frame": frame, "followed": followed, "largest_displacement_px": largest.map_or(0.0, |px| px.value),
            "doubt": field.doubt.map(|doubt| PairsDoubt::Matcher(doubt).to_string()),
            "period": field.period.map(|step| step.0[..2].to_vec()), "strain": strain, "shear": shear,
        })
    }
}
