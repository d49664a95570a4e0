//! The frames of a stream in their order: from images, folders, videos and pipes.
use super::StreamArguments;
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::frames::{DEFAULT_RATE_HZ, Pixels, Reading};
use crate::outputs::Csv;
use crate::record::FrameRecorder;
use crate::serve::LivePage;
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Measures the frames of a stream.
pub(super) trait Meter {
    /// Type of its frames.
    type Frame: Pixels;
    /// Result of a frame.
    type Row;

    /// Heading above the lines, and in a table above the cells.
    fn heading(&self) -> String;
    const COLUMNS: &'static str;

    fn measure(&mut self, frame: &Self::Frame) -> Result<Self::Row, Box<dyn Error>>;

    /// The result as cells of a table. Unknown cells are empty.
    fn cells(row: &Self::Row) -> Vec<Option<f64>>;

    /// The result as a line between the time of the frame and the percentage of late frames.
    fn line(row: &Self::Row, time_s: f64, late_percent: f64) -> String;

    /// The result in the format of JSON.
    fn update(row: &Self::Row) -> Value;

    /// The result for browsers. A frame has this number of columns.
    fn shown(&self, row: &Self::Row, columns: f64) -> Value;

    /// The surface in the last frame, for browsers.
    fn surface(&mut self) -> Value;
}

/// A meter with the results of every frame so far.
pub(super) struct Watch<M: Meter> {
    pub meter: M,
    /// Times in seconds and answers.
    pub rows: Vec<(f64, M::Row)>,
    pub counts: FrameCounts,
    page: Option<LivePage>,
    recording: Option<FrameRecorder>,
}

impl<M: Meter> Watch<M> {
    pub(super) fn new(
        meter: M,
        arguments: &StreamArguments,
        context: &Context,
    ) -> Result<Self, Failure> {
        let page = arguments.serve.map(LivePage::serve).transpose()?;
        if let Some(page) = &page {
            context.note(format_args!("the measurement is shown at {}", page.url));
        }
        let recording = arguments.record.as_deref().map(FrameRecorder::create);
        Ok(Self {
            meter,
            rows: Vec::new(),
            counts: FrameCounts::new(arguments.rate.unwrap_or(DEFAULT_RATE_HZ)),
            page,
            recording: recording.transpose()?,
        })
    }

    /// Measures, shows and records a frame. Returns the duration of measuring and showing.
    pub(super) fn take(&mut self, time_s: f64, frame: &M::Frame) -> Result<Duration, Failure> {
        let FrameCounts { seen, late, .. } = self.counts;
        if let Some(recording) = &mut self.recording {
            recording.frame(frame.channels(), self.counts.rate_hz)?;
        }
        let start = Instant::now();
        let row = self.meter.measure(frame);
        let row = row.map_err(|error| Failure::no_answer(format!("frame {seen}: {error}")))?;
        if let Some(page) = &mut self.page {
            let mut shown = self.meter.shown(&row, frame.size().1 as f64);
            shown["frame"] = json!(seen);
            shown["time_s"] = json!(time_s);
            shown["late"] = json!(late);
            page.show(shown, frame.channels(), || self.meter.surface());
        }
        let took = start.elapsed();
        self.rows.push((time_s, row));
        if let Some(recording) = &mut self.recording {
            let (before, last) = self.rows.split_at(self.rows.len() - 1);
            recording.answers(&Self::table(last, before.is_empty()))?;
        }
        Ok(took)
    }

    /// One row per frame. The first has the names of the columns.
    fn table(rows: &[(f64, M::Row)], with_names: bool) -> Vec<u8> {
        let mut csv = match with_names {
            true => Csv::new(&format!("time_s,{}", M::COLUMNS)),
            false => Csv::default(),
        };
        for (time_s, row) in rows {
            csv.cells(std::iter::once(Some(*time_s)).chain(M::cells(row)));
        }
        csv.into_bytes()
    }

    /// Prints the last frame: always in JSON, and as text every sixteenth of a long series.
    pub(super) fn print_last(&self, every_one: bool, context: &mut Context) {
        let Some((time_s, row)) = self.rows.last() else {
            return;
        };
        if context.json {
            let mut value = M::update(row);
            value["frame"] = json!(self.counts.seen);
            value["time_s"] = json!(time_s);
            context.print_json(&value);
        }
        if every_one || (self.rows.len() - 1).is_multiple_of(16) {
            let late = self.counts.late_percent(self.rows.len());
            context.line(M::line(row, *time_s, late).trim_end());
        }
    }

    /// The common fields of the result.
    pub(super) fn value(&self) -> Value {
        json!({
            "frames": self.rows.len(), "rate_hz": self.counts.rate_hz, "late": self.counts.late,
        })
    }

    /// Adds the table of the series to the files. Complete if the percentage of late frames does
    /// not exceed the allowed one.
    pub(super) fn close(&self, allowed_late: f64, context: &mut Context) -> Exit {
        context
            .outputs
            .add("stream.csv", Self::table(&self.rows, true));
        let percent = self.counts.late_percent(self.rows.len());
        if percent > allowed_late {
            context.note(format_args!(
                "{percent:.1} % of the frames were late, more than {allowed_late} %"
            ));
        }
        Exit::complete_if(percent <= allowed_late)
    }
}

/// Counts of a stream's frames.
#[derive(Clone, Copy)]
pub(super) struct FrameCounts {
    pub rate_hz: f64,
    /// Number of frames, measured or not.
    pub seen: usize,
    /// Number of frames and files that could not be measured.
    pub unusable: usize,
    /// Number of frames whose result came after the next frame was due.
    pub late: usize,
}

impl FrameCounts {
    pub(super) fn new(rate_hz: f64) -> Self {
        Self {
            rate_hz,
            seen: 0,
            unusable: 0,
            late: 0,
        }
    }

    pub(super) fn late_percent(&self, measured: usize) -> f64 {
        100.0 * self.late as f64 / measured.max(1) as f64
    }

    /// Prints the number of late frames.
    pub(super) fn print(&self, measured: usize, context: &mut Context) {
        let (rate, late, percent) = (self.rate_hz, self.late, self.late_percent(measured));
        context.line(format_args!(
            "{measured} frames at {rate} Hz, {late} late ({percent:.1} %)"
        ));
    }
}

/// Measures the frames of these files in their order. A file that is truncated or unreadable gives
/// a caution, and the next one follows.
pub(super) fn watch<M: Meter>(
    watch: &mut Watch<M>,
    frames: &[PathBuf],
    reading: Reading<'_>,
    rate_hz: Option<f64>,
    context: &mut Context,
) -> Result<(), Failure> {
    context.line(watch.meter.heading());
    // The times of a recording follow from the numbers in the names of its frames, if there are
    // any.
    let numbers = numbers(frames);
    let last = numbers.as_deref().and_then(<[_]>::last);
    let missing = last.map_or(0, |&last| last + 1 - frames.len() as u64);
    let mut before = 0;
    let unreadable = reading.each::<M::Frame>(frames, context, |frame, context| {
        if frame.number == 1 {
            // An unreadable file counts as one frame.
            before = match &numbers {
                Some(numbers) => numbers[frame.file] as usize,
                None => watch.counts.seen.max(frame.file),
            };
        }
        let stated = rate_hz.or(frame.rate_hz);
        let rate_hz = stated.unwrap_or(watch.counts.rate_hz);
        watch.counts.rate_hz = rate_hz;
        // Frames dropped by the recorder take their time, too.
        watch.counts.seen = before + frame.place;
        let time_s = (watch.counts.seen - 1) as f64 / rate_hz;
        // Reading the file is not part of the measurement.
        match watch.take(time_s, frame.pixels) {
            Ok(took) => {
                watch.counts.late += usize::from(took.as_secs_f64() > 1.0 / rate_hz);
                watch.print_last(watch.rows.len() <= 32, context);
            }
            // A frame without a result does not end a stream, and thousands of them give one
            // caution.
            Err(failure) if failure.exit == Exit::Partial => {
                watch.counts.unusable += 1;
                let frame_number = watch.counts.seen;
                context.print_json(&json!({
                    "frame": frame_number, "time_s": time_s, "error": failure.to_string(),
                }));
                if watch.counts.unusable <= 3 {
                    context.caution(Failure::in_file(frame.path, failure));
                }
            }
            Err(failure) => return Err(failure),
        }
        Ok(())
    })?;
    watch.counts.unusable += unreadable;
    let unusable = watch.counts.unusable;
    if watch.rows.is_empty() && unusable > 0 {
        return Err(Failure::input(format!(
            "none of the {unusable} inputs can be measured"
        )));
    }
    if missing > 0 {
        context.warn(
            "frames_missing",
            json!({ "frames": missing }),
            format_args!(
                "{missing} missing in the numbers of the frames' names: times follow from the \
                 numbers"
            ),
        );
    }
    Ok(())
}

/// The numbers at the end of the names of the frames, relative to the first. `None` if a name has
/// no number or if they do not increase.
fn numbers(frames: &[PathBuf]) -> Option<Vec<u64>> {
    let number = |path: &PathBuf| -> Option<u64> {
        let stem = path.file_stem()?.to_str()?;
        let digits = stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        stem[digits..].parse().ok()
    };
    let numbers = frames.iter().map(number).collect::<Option<Vec<u64>>>()?;
    let first = *numbers.first()?;
    // If more than a tenth is missing, the numbers are a naming scheme (times, dates) rather than
    // gaps.
    let last = numbers.last()?.checked_sub(first)?;
    let few_gaps = last < frames.len() as u64 + (frames.len() as u64 / 10).max(2);
    let rising = numbers.windows(2).all(|pair| pair[0] < pair[1]);
    (rising && few_gaps).then(|| numbers.iter().map(|n| n - first).collect())
}

/// The given images, and those of the given folders in the order of their names.
pub(crate) fn listed(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut frames = Vec::new();
    for path in paths {
        if !path.is_dir() {
            frames.push(path.clone());
            continue;
        }
        let name = path.display();
        let entries = std::fs::read_dir(path).and_then(|entries| {
            let paths = entries.map(|entry| entry.map(|e| e.path()));
            paths.collect::<std::io::Result<Vec<PathBuf>>>()
        });
        let unreadable = |error| Failure::input(format!("cannot list the folder {name}: {error}"));
        let mut images = entries.map_err(unreadable)?;
        images.retain(|file| is_image(file));
        if images.is_empty() {
            return Err(Failure::input(format!(
                "the folder {name} has no PNG, PGM, JPEG or TIFF images"
            )));
        }
        images.sort_by_cached_key(|image| natural(image));
        frames.append(&mut images);
    }
    Ok(frames)
}

fn is_image(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str());
    let extension = extension.unwrap_or_default().to_ascii_lowercase();
    ["png", "pgm", "ppm", "jpg", "jpeg", "tif", "tiff"].contains(&extension.as_str())
}

/// The parts of a file name, with numbers by their value: frame_2 comes before frame_10.
fn natural(path: &Path) -> Vec<(u64, String)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut parts: Vec<(u64, String)> = vec![(0, String::new())];
    let mut in_number = false;
    for character in name.chars() {
        let digit = character.to_digit(10);
        if digit.is_some() && !in_number {
            parts.push((0, String::new()));
        }
        in_number = digit.is_some();
        let Some((number, text)) = parts.last_mut() else {
            continue;
        };
        match digit {
            Some(digit) => *number = number.saturating_mul(10).saturating_add(digit.into()),
            None => text.push(character),
        }
    }
    parts
}
