//! `tactile markers`: printed markers followed from a reference.
use crate::arguments::positive;
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::outputs::{Csv, beside};
use crate::text::{four_digits, in_unit};
use clap::Args;
use ndarray::Array2;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tactile_files::io::{Grey, image_size, read_grey_image};
use tactile_imaging::PairsDoubt;
use tactile_imaging::core::Estimate;
use tactile_imaging::markers::{MarkerField, find_markers, track_markers};

/// Follow the markers of a gel from a reference to frames
///
/// Dark dots of one size are found in colour or grey images, also under uneven light. The matcher
/// pairs them, whatever their order, and bears missing ones. --out gets NAME_markers.csv for every
/// frame NAME, a row a marker: its place in the reference and its displacement in pixels, and the
/// standard error of a coordinate of both. With the gel's shear modulus and thickness the force
/// along x and y and the torque about the markers' mean are printed.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile markers --reference examples/data/markers_reference.png examples/data/markers_frame.png
  tactile markers --reference examples/data/markers_reference.png examples/data/markers_frame.png \
                        --pixel-um 100 --shear-modulus-kpa 40 --thickness-mm 4 --out \
                        target/markers")]
pub(crate) struct MarkersArguments {
    /// Frames (PNG, PGM, PPM or JPEG).
    #[arg(required = true)]
    frames: Vec<PathBuf>,
    /// Frame before the markers moved.
    #[arg(long, value_name = "IMAGE")]
    reference: PathBuf,
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
    let names: Vec<_> = frames
        .iter()
        .map(|frame| beside(frame, "_markers.csv"))
        .collect();
    let inputs: Vec<_> = frames.iter().chain([reference]).collect();
    context.outputs.plan(&names, &inputs)?;
    if let Some((rows, columns)) = image_size(reference) {
        // Grey levels as numbers, the light around them, and the passes that find the dots.
        let bytes = 80.0 * rows as f64 * columns as f64;
        context.allow(bytes, "finding the markers", "give smaller images")?;
    }
    let before = find_markers(grey(reference)?.view());
    let mut values = Vec::new();
    let mut exit = Exit::Complete;
    for (path, name) in frames.iter().zip(&names) {
        let after = find_markers(grey(path)?.view());
        context.line(format_args!("{}:", path.display()));
        let counts = format!(
            "{} in the reference, {} in the frame",
            before.len(),
            after.len()
        );
        context.row("markers", counts);
        let frame = path.display().to_string();
        match track_markers(&before, &after) {
            Ok(field) => {
                values.push(arguments.print(&frame, &field, context));
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

fn grey(path: &Path) -> Result<Array2<f64>, Failure> {
    Ok(read_grey_image(path, Grey::Mean, None)?.levels)
}

fn table(field: &MarkerField) -> Vec<u8> {
    let mut csv = Csv::new("x_px,y_px,dx_px,dy_px,x_error_px,y_error_px,dx_error_px,dy_error_px");
    for track in &field.tracks {
        let (p, u, [own, moved]) = (
            track.position_px,
            track.displacement_px,
            track.standard_errors_px,
        );
        csv.row([p.x, p.y, u.x, u.y, own, own, moved, moved]);
    }
    csv.into_bytes()
}

impl MarkersArguments {
    fn print(&self, frame: &str, field: &MarkerField, context: &mut Context) -> Value {
        let lengths = field
            .tracks
            .iter()
            .map(|track| track.displacement_px.norm());
        let largest = lengths.fold(0.0, f64::max);
        let followed = field.tracks.len();
        context.row(
            "followed",
            format_args!("{followed}, by {} px at most", four_digits(largest)),
        );
        if let Some(doubt) = &field.doubt {
            let sentence = PairsDoubt::Matcher(*doubt);
            context.warn("doubtful_pairs", json!({ "frame": frame }), sentence);
        }
        let strain = field.strain.as_ref().map(|strain| {
            [("xx", (0, 0)), ("yy", (1, 1)), ("xy", (0, 1))].map(|(name, at)| {
                let part = Estimate::new(strain.summary.mean[at], strain.standard_error[at]);
                context.row(&format!("strain {name}"), in_unit(part, 100.0) + " %");
                (name, part)
            })
        });
        let strain: Option<BTreeMap<_, _>> = strain.map(BTreeMap::from);
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
            "frame": frame, "followed": followed, "largest_displacement_px": largest,
            "doubt": field.doubt.map(|doubt| PairsDoubt::Matcher(doubt).to_string()),
            "strain": strain, "shear": shear,
        })
    }
}
