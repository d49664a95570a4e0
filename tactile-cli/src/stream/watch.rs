//! The frames of a stream one after the other: from images, folders, videos and pipes.
use crate::console::{Bar, Context, Exit, Failure};
use crate::frames::{Pixels, Reading};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What measures the frames of a stream.
pub trait Watcher {
    /// Frames as it takes them.
    type Frame: Pixels;

    fn progress(&mut self) -> &mut FrameCounts;

    /// The number of frames with an answer.
    fn measured(&self) -> usize;

    /// Measures a frame and shows its answer. Returns how long that took.
    fn take(&mut self, time_s: f64, frame: &Self::Frame) -> Result<Duration, Failure>;

    /// The last frame's answer as a line. None before the first.
    fn last_line(&self) -> Option<String>;

    /// Prints a line for every frame or, of a long series, for one out of sixteen.
    fn print_last(&self, every_one: bool, context: &mut Context) {
        if let Some(line) = self.last_line()
            && (every_one || (self.measured() - 1).is_multiple_of(16))
        {
            context.line(line.trim_end());
        }
    }
}

/// Counts of a stream's frames.
#[derive(Clone, Copy)]
pub struct FrameCounts {
    pub rate_hz: f64,
    /// The number of frames that came, measured or not.
    pub seen: usize,
    /// Those, and the files, that could not be measured.
    pub unusable: usize,
    /// Those whose answer came after the next one was due.
    pub late: usize,
}

impl FrameCounts {
    pub fn new(rate_hz: f64) -> Self {
        Self {
            rate_hz,
            seen: 0,
            unusable: 0,
            late: 0,
        }
    }

    pub fn late_percent(&self, measured: usize) -> f64 {
        100.0 * self.late as f64 / measured.max(1) as f64
    }

    /// Prints how many came late.
    pub fn print(&self, measured: usize, context: &mut Context) {
        let (rate, late, percent) = (self.rate_hz, self.late, self.late_percent(measured));
        context.line(format_args!(
            "{measured} frames at {rate} Hz, {late} late ({percent:.1} %)"
        ));
    }
}

/// Measures the frames of these files as they come. A file that breaks off or cannot be read is a
/// caution, and the next one follows.
pub fn watch<W: Watcher>(
    watcher: &mut W,
    frames: &[PathBuf],
    reading: Reading<'_>,
    rate_hz: Option<f64>,
    context: &mut Context,
) -> Result<(), Failure> {
    // The clock of a recording is the number in its frames' names, where they have one.
    let numbers = numbers(frames);
    let last = numbers.as_deref().and_then(<[_]>::last);
    let missing = last.map_or(0, |&last| last + 1 - frames.len() as u64);
    let mut bar = Bar::of(frames.len(), "measuring");
    let mut frame = W::Frame::default();
    context.interrupt.polled(true);
    for (k, path) in frames.iter().enumerate() {
        if context.interrupt.requested() {
            break;
        }
        if let Some(numbers) = &numbers {
            watcher.progress().seen = numbers[k] as usize;
        }
        // A torn frame does not end a recording. Of a stream it ends what comes from there.
        if let Err(failure) = file(watcher, path, reading, rate_hz, &mut frame, context) {
            if failure.exit == Exit::Output {
                return Err(failure);
            }
            let progress = watcher.progress();
            progress.unusable += 1;
            progress.seen = progress.seen.max(k + 1);
            context.caution(failure);
        }
        bar.done(k + 1);
    }
    drop(bar);
    let unusable = watcher.progress().unusable;
    if watcher.measured() == 0 && unusable > 0 {
        return Err(Failure::input(format!(
            "none of the {unusable} inputs can be measured"
        )));
    }
    if missing > 0 {
        context.warn(
            "frames_missing",
            json!({ "frames": missing }),
            format_args!(
                "{missing} missing in the numbers of the frames' names: times are counted by the \
                 numbers"
            ),
        );
    }
    Ok(())
}

/// Measures the frames of a file or a pipe as they come, in the memory of `frame`.
fn file<W: Watcher>(
    watcher: &mut W,
    path: &Path,
    reading: Reading<'_>,
    rate_hz: Option<f64>,
    frame: &mut W::Frame,
    context: &mut Context,
) -> Result<(), Failure> {
    let mut source = reading.open(path)?;
    if let Some(rate_hz) = rate_hz.or(source.frame_rate_hz()) {
        watcher.progress().rate_hz = rate_hz;
    }
    while !context.interrupt.requested() && frame.read_next(&mut source)?.is_some() {
        reading.fits(path, frame)?;
        let progress = watcher.progress();
        let rate_hz = progress.rate_hz;
        let time_s = progress.seen as f64 / rate_hz;
        progress.seen += 1;
        // Reading the file is not part of the measurement.
        match watcher.take(time_s, frame) {
            Ok(took) => {
                watcher.progress().late += usize::from(took.as_secs_f64() > 1.0 / rate_hz);
            }
            // A frame without an answer does not end a stream, and thousands of them are one
            // trouble.
            Err(failure) if failure.exit == Exit::Partial => {
                watcher.progress().unusable += 1;
                if watcher.progress().unusable <= 3 {
                    context.caution(Failure::in_file(path, failure));
                }
            }
            Err(failure) => return Err(failure),
        }
        watcher.print_last(watcher.measured() <= 32, context);
    }
    Ok(())
}

/// The numbers at the end of the frames' names, less the first one. `None` where a name has none or
/// they do not rise.
fn numbers(frames: &[PathBuf]) -> Option<Vec<u64>> {
    let number = |path: &PathBuf| -> Option<u64> {
        let stem = path.file_stem()?.to_str()?;
        let digits = stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        stem[digits..].parse().ok()
    };
    let numbers = frames.iter().map(number).collect::<Option<Vec<u64>>>()?;
    let first = *numbers.first()?;
    // More than a tenth missing is a way of naming (times, dates), not a gap.
    let last = numbers.last()?.checked_sub(first)?;
    let few_gaps = last < frames.len() as u64 + (frames.len() as u64 / 10).max(2);
    let rising = numbers.windows(2).all(|pair| pair[0] < pair[1]);
    (rising && few_gaps).then(|| numbers.iter().map(|n| n - first).collect())
}

/// The images that are named, and those of the folders that are named in the order of their names.
pub fn listed(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
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

/// The parts of a file's name, numbers by their value: frame_2 comes before frame_10.
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
