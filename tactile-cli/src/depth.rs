//! `tactile depth`: contacts and depth of a gel sensor.
use crate::arguments::TableArguments;
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::frames::SensorFrames;
use crate::gel::{Ball, Reader, Wanted, depth, unless_sensor};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use tactile_files::io::Grey;
use tactile_files::scene::doubt_of_depths;
use tactile_imaging::gel::{DarkModel, GelSensor};

/// Find the contacts and their depth in frames of a gel sensor
///
/// --sensor is a sensor file written by `tactile calibrate`, of a gel lit in colours or of one that
/// darkens where it is pressed. Without a sensor file, a gel that darkens needs --reference, --table
/// and --pixel-um.
///
/// TABLE.csv contains depth as a function of darkening. The column darkness is in grey levels below
/// the reference, with the same --grey. The column depth is in the unit of its heading (m, mm or
/// µm), or in mm without one. No darkening is no depth. A table with the row 0, 0 is used unchanged.
/// Other tables, such as those of 9DTact, count depth from a contact circle that was found at some
/// darkening. They are shifted.
///
/// With --ball-radius-mm a ball of this radius is fitted to the depth of the first contact, with
/// --ball a ball of any radius.
///
/// For every frame NAME, --out gets NAME_depth.csv (displacement of the surface, m, for the whole
/// frame, zero far from contacts) and its gradients along columns and rows in NAME_gradient_x.csv
/// and NAME_gradient_y.csv. It also gets NAME_contact.csv (the contact of every pixel from 1, and 0
/// without contact), NAME.ply (a mesh, mm), NAME.npz and NAME_depth.svg.
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
    /// Sensor file of a gel.
    #[arg(long, value_name = "SENSOR.toml",
          conflicts_with_all = ["reference", "pixel_um", "table", "zero_table", "grey"])]
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
    /// The sensor of the table.
    fn sensor(&self, context: &mut Context) -> Result<Reader, Failure> {
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
        let [size, high] = self.frames.pixel_m();
        if size != high {
            return Err(Failure::input(
                "--pixel-um: the pixels of a gel must be square",
            ));
        }
        let model = DarkModel::new(size, entries.into_iter().map(<[f64; 2]>::from).collect());
        let table = model.depth_table().map_err(in_table)?;
        if self.zero_table {
            table.zeroed().map_err(in_table)?;
        }
        let grey = match self.grey {
            GreyOf::Rec601 => Grey::Rec601,
            GreyOf::Rec709 => Grey::Rec709,
            GreyOf::Mean => Grey::Mean,
        };
        let reference = self.frames.read_reference(grey)?;
        let sensor = GelSensor::new(model, &reference);
        let sensor = sensor.map_err(|error| Failure::in_file(&self.frames.reference, error))?;
        Ok(Reader::of(sensor, grey, self.frames.bits))
    }
}

pub(crate) fn run(arguments: &DepthArguments, context: &mut Context) -> Result<Exit, Failure> {
    let frames = &arguments.frames.frames;
    let wanted = Wanted {
        forces: false,
        ball: match (arguments.ball, arguments.ball_radius_mm) {
            (_, Some(mm)) => Some(Ball::OfRadius(1e-3 * mm)),
            (true, None) => Some(Ball::Any),
            (false, None) => None,
        },
    };
    if let Some(sensor) = &arguments.sensor {
        let reader = Reader::open(sensor)?;
        return depth(&reader, sensor, &[sensor], frames, wanted, context);
    }
    let (reader, reference) = (arguments.sensor(context)?, &arguments.frames.reference);
    let inputs = [reference.as_path(), &arguments.table];
    depth(&reader, reference, &inputs, frames, wanted, context)
}
