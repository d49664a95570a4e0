//! `tactile stream` with a gel sensor: force, contact and depth live.
use super::StreamArguments;
use super::watch::{Meter, Watch, listed, watch};
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::frames::Pixels;
use crate::gel::{GelReading, NO_FRAMES, Reader, Sideways, number_or_error};
use crate::relief::HeightGrid;
use ndarray::{Array2, Array3};
use serde_json::{Value, json};
use std::error::Error;
use std::marker::PhantomData;
use std::path::Path;
use tactile_imaging::core::Estimate;
use tactile_imaging::gel::{FrameDoubt, GelMarkers};

/// The results of one frame.
pub(super) struct Row {
    /// The force: `None` without contact, or the reason why there is none.
    force_n: Result<Option<Estimate>, String>,
    contact: Option<GelReading>,
    /// What the dots show, or the reason why they show nothing. `None` for a gel without dots.
    dots: Option<Result<Sideways, String>>,
    cautions: Vec<String>,
}

impl Row {
    fn sideways(&self) -> Option<&Sideways> {
        self.dots.as_ref()?.as_ref().ok()
    }

    /// Forces along x and y and torque about z.
    fn shear(&self) -> [Option<Estimate>; 3] {
        let wrench = self.sideways().and_then(|dots| dots.wrench);
        wrench.map_or([None; 3], |w| [w.force_n[0], w.force_n[1], w.torque_nm[2]])
    }

    fn slip(&self) -> Option<f64> {
        self.sideways()?.slip.map(|slip| slip.share)
    }

    fn force(&self) -> Option<Estimate> {
        self.force_n.as_ref().ok().copied().flatten()
    }
}

fn pair(of: Estimate) -> [f64; 2] {
    [of.value, of.standard_error]
}

/// A sensor of frames `P`, with the depth in the last one.
struct Gel<P> {
    reader: Reader,
    markers: Option<GelMarkers>,
    depth_m: Array2<f64>,
    frames: PhantomData<P>,
}

impl<P: Pixels> Meter for Gel<P> {
    type Frame = P;
    type Row = Row;

    fn heading(&self) -> String {
        "time (s)   force (N)   largest depth (mm)   contact (mm²)   slip (%)   late (%)".to_owned()
    }

    const COLUMNS: &'static str = "force_N,force_error_N,contact_area_m2,largest_depth_m,\
         largest_depth_error_m,force_x_N,force_x_error_N,force_y_N,force_y_error_N,torque_z_Nm,torque_z_error_Nm,slip_share";

    fn measure(&mut self, frame: &P) -> Result<Row, Box<dyn Error>> {
        let reading = self.reader.sensor.read(frame.image())?;
        let markers = self.markers.as_mut().filter(|_| !reading.is_refused());
        let dots = markers.map(|m| self.reader.sideways(m, frame.image(), &reading));
        let doubts = reading.doubts.iter().map(FrameDoubt::to_string);
        let doubtful = dots.as_ref().and_then(|dots| dots.as_ref().err().cloned());
        let row = Row {
            force_n: self.reader.force(&reading),
            contact: GelReading::of(&reading),
            cautions: doubts.chain(doubtful).collect(),
            dots,
        };
        self.depth_m = reading.depth_m;
        Ok(row)
    }

    fn cells(row: &Row) -> Vec<Option<f64>> {
        let cells = |of: Option<Estimate>| of.map_or([None; 2], |e| pair(e).map(Some));
        let contact = row.contact.as_ref();
        let area = contact.map(|contact| contact.area_m2);
        let depth = cells(contact.map(|contact| contact.largest_depth_m));
        let shear = row.shear().map(cells).concat();
        [
            &cells(row.force())[..],
            &[area],
            &depth,
            &shear,
            &[row.slip()],
        ]
        .concat()
    }

    fn line(row: &Row, time_s: f64, late_percent: f64) -> String {
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        let contact = row.contact.as_ref();
        let force = number(row.force().map(|force| force.value), 3);
        let depth = number(contact.map(|c| 1e3 * c.largest_depth_m.value), 3);
        let area = number(contact.map(|c| 1e6 * c.area_m2), 2);
        let slip = number(row.slip().map(|share| 100.0 * share), 0);
        format!("{time_s:8.3} {force:>11} {depth:>20} {area:>15} {slip:>10} {late_percent:10.1}")
    }

    fn update(row: &Row) -> Value {
        let mut value = json!({
            "force_n": number_or_error(&row.force_n), "contact": row.contact,
            "cautions": row.cautions,
        });
        match &row.dots {
            Some(Ok(dots)) => value["dots"] = json!(dots),
            Some(Err(reason)) => value["dots"] = json!({ "error": reason }),
            None => {}
        }
        value
    }

    fn shown(&self, row: &Row, columns: f64) -> Value {
        let contact = row.contact.as_ref();
        json!({
            "cautions": row.cautions,
            "force_n": row.force().map(pair),
            "centre": contact.map(|contact| contact.centroid.map(|c| c / columns)),
            "depth_m": contact.map(|contact| pair(contact.largest_depth_m)),
        })
    }

    fn surface(&mut self) -> Value {
        let size = 1e3 * self.reader.sensor.pixel_size_m();
        let relief = HeightGrid::of(self.depth_m.mapv(|z| 1e3 * z).view(), [size; 2]);
        json!({ "name": "depth", "relief": relief })
    }
}

/// Measures frames of a gel sensor.
pub(super) fn gel(
    sensor: &Path,
    arguments: &StreamArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let reader = Reader::open(sensor)?;
    match reader.has_colours() {
        true => live::<Array3<u8>>(reader, sensor, arguments, context),
        false => live::<Array2<u8>>(reader, sensor, arguments, context),
    }
}

fn live<P: Pixels>(
    reader: Reader,
    sensor: &Path,
    arguments: &StreamArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    if arguments.strain {
        let sentence = "--strain is not available for a gel sensor";
        return Err(Failure::input(sentence));
    }
    let frames = listed(&arguments.frames)?;
    if frames.is_empty() {
        return Err(Failure::in_file(sensor, NO_FRAMES));
    }
    context.outputs.protect(&frames)?;
    if let Some(report) = &mut context.outputs.report {
        report.inputs(frames.iter().cloned());
    }
    let reading = reader.reading(sensor);
    let gel = Gel::<P> {
        markers: reader.markers(),
        reader,
        depth_m: Array2::default((0, 0)),
        frames: PhantomData,
    };
    let mut live = Watch::new(gel, arguments, context)?;
    watch(&mut live, &frames, reading, arguments.rate, context)?;
    // Prints the results of the whole series.
    live.counts.print(live.rows.len(), context);
    if let Err(reason) = &live.meter.reader.law {
        context.answer("force", format_args!("none: {reason}"));
    }
    context.value(&live.value());
    let exit = live.close(arguments.allowed_late, context);
    Ok(match live.counts.unusable {
        0 => exit,
        _ => Exit::Partial,
    })
}
