//! `tactile stream` with a gel that is lit in colours: force, contact and depth live.
use super::watch::{FrameCounts, Watcher, listed, watch};
use super::{Shown, StreamArguments};
use crate::console::{Context, Exit, Failure};
use crate::frames::DEFAULT_RATE_HZ;
use crate::outputs::Csv;
use crate::photometric::{GelContact, NO_FRAMES, Reader, number_or_error};
use crate::relief::HeightGrid;
use ndarray::{Array2, Array3};
use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};
use tactile_imaging::core::Estimate;

/// The results of one frame.
struct Row {
    time_s: f64,
    /// None without contact, or why it has none.
    force_n: Result<Option<Estimate>, String>,
    contact: Option<GelContact>,
}

impl Row {
    fn force(&self) -> Option<Estimate> {
        self.force_n.as_ref().ok().copied().flatten()
    }

    /// Adds the row, with empty cells for unknown values.
    fn add_to(&self, csv: &mut Csv) {
        let pair = |of: Option<Estimate>| of.map_or([None; 2], |e| pair(e).map(Some));
        let contact = self.contact.as_ref();
        let force = pair(self.force());
        let area = contact.map(|contact| contact.area_m2);
        let depth = pair(contact.map(|contact| contact.largest_depth_m));
        csv.cells([&[Some(self.time_s)][..], &force, &[area], &depth].concat());
    }
}

fn pair(of: Estimate) -> [f64; 2] {
    [of.value, of.standard_error]
}

const COLUMNS: [&str; 6] = [
    "time_s",
    "force_N",
    "force_error_N",
    "contact_area_m2",
    "largest_depth_m",
    "largest_depth_error_m",
];

/// A sensor with the results of every frame so far.
struct Live {
    reader: Reader,
    rows: Vec<Row>,
    progress: FrameCounts,
    shown: Shown,
}

impl Live {
    fn show(&mut self, frame: &Array3<u8>, depth_m: &Array2<f64>) {
        let (Some(page), Some(row)) = (&mut self.shown.page, self.rows.last()) else {
            return;
        };
        let contact = row.contact.as_ref();
        let columns = frame.dim().1 as f64;
        let numbers = json!({
            "frame": self.progress.seen, "time_s": row.time_s, "late": self.progress.late,
            "cautions": [], "force_n": row.force().map(pair),
            "centre": contact.map(|contact| contact.centroid.map(|c| c / columns)),
            "depth_m": contact.map(|contact| pair(contact.largest_depth_m)),
        });
        let size = 1e3 * self.reader.stereo.model().pixel_size_m;
        page.show(numbers, frame.view(), || {
            let relief = HeightGrid::of(depth_m.mapv(|z| 1e3 * z).view(), [size; 2]);
            json!({ "name": "depth", "relief": relief, "health": "" })
        });
    }

    fn print_heading(context: &mut Context) {
        context.line("time (s)   force (N)   largest depth (mm)   contact (mm²)   late (%)");
    }

    /// Prints the results of the whole series, and adds its table to the files.
    fn finish(self, allowed_late: f64, context: &mut Context) -> Exit {
        let (count, progress) = (self.rows.len(), self.progress);
        progress.print(count, context);
        if let Err(reason) = &self.reader.law {
            context.answer("force", format_args!("none: {reason}"));
        }
        let update = |row: &Row| {
            json!({
                "time_s": row.time_s, "force_n": number_or_error(&row.force_n),
                "contact": row.contact,
            })
        };
        context.value(&json!({
            "frames": count, "rate_hz": progress.rate_hz, "late": progress.late,
            "updates": self.rows.iter().map(update).collect::<Vec<Value>>(),
        }));
        let mut csv = Csv::new(&COLUMNS);
        self.rows.iter().for_each(|row| row.add_to(&mut csv));
        context.outputs.add("stream.csv", csv.into_bytes());
        let percent = progress.late_percent(count);
        if percent > allowed_late {
            context.note(format_args!(
                "{percent:.1} % of the frames came late, more than {allowed_late} %"
            ));
        }
        Exit::complete_if(progress.unusable == 0 && percent <= allowed_late)
    }
}

impl Watcher for Live {
    type Frame = Array3<u8>;

    fn progress(&mut self) -> &mut FrameCounts {
        &mut self.progress
    }

    fn measured(&self) -> usize {
        self.rows.len()
    }

    fn take(&mut self, time_s: f64, frame: &Array3<u8>) -> Result<Duration, Failure> {
        self.shown.record(frame.view(), self.progress.rate_hz)?;
        let start = Instant::now();
        let reading = self.reader.stereo.read(frame.view());
        let reading = reading.map_err(|error| {
            Failure::no_answer(format!("frame {}: {error}", self.progress.seen))
        })?;
        self.rows.push(Row {
            time_s,
            force_n: self.reader.force(&reading),
            contact: GelContact::of(&reading, self.reader.stereo.model().pixel_size_m),
        });
        self.show(frame, &reading.depth_m);
        let took = start.elapsed();
        if let Some(row) = self.rows.last() {
            self.shown
                .record_answer(self.rows.len(), &COLUMNS, |csv| row.add_to(csv))?;
        }
        Ok(took)
    }

    fn last_line(&self) -> Option<String> {
        let row = self.rows.last()?;
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        let contact = row.contact.as_ref();
        let force = number(row.force().map(|force| force.value), 3);
        let depth = number(contact.map(|c| 1e3 * c.largest_depth_m.value), 3);
        let area = number(contact.map(|c| 1e6 * c.area_m2), 2);
        let (time, late) = (row.time_s, self.progress.late_percent(self.rows.len()));
        Some(format!(
            "{time:8.3} {force:>11} {depth:>20} {area:>15} {late:10.1}"
        ))
    }
}

/// Measures frames of a gel that is lit in colours.
pub fn coloured(
    sensor: &Path,
    arguments: &StreamArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    if arguments.strain {
        let sentence = "--strain is not there for a gel that is lit in colours";
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
    let reader = Reader::open(sensor)?;
    let reading = reader.reading(sensor);
    let mut live = Live {
        reader,
        rows: Vec::new(),
        progress: FrameCounts::new(arguments.rate.unwrap_or(DEFAULT_RATE_HZ)),
        shown: Shown::new(arguments, context)?,
    };
    Live::print_heading(context);
    watch(&mut live, &frames, reading, arguments.rate, context)?;
    Ok(live.finish(arguments.allowed_late, context))
}
