//! The frames of images, stacks, videos and pipes, for several subcommands.
use crate::arguments::{pixel_um, same_shape};
use crate::console::{Bar, Context};
use crate::failure::Failure;
use crate::text::count;
use clap::Args;
use ndarray::{Array2, Array3, ArrayView3, Axis};
use serde_json::json;
use std::ffi::OsString;
use std::mem::take;
use std::path::{Path, PathBuf};
use tactile_files::io::{FileError, FrameReader, Grey, image_colour, read_grey_image};
use tactile_imaging::gel::GelImage;
use tactile_imaging::pipeline::FrameSource;

/// Frames per second if neither stream nor argument states them: the rate of the paper's camera.
pub(crate) const DEFAULT_RATE_HZ: f64 = 80.0;

/// The pixels of a frame, in grey or in colour.
pub(crate) trait Pixels: Default {
    const IS_GREY: bool;

    /// Replaces this frame by the next one and returns its time in seconds.
    fn read_next(&mut self, reader: &mut FrameReader) -> Result<Option<f64>, FileError>;

    /// Rows and columns.
    fn size(&self) -> (usize, usize);

    /// The samples, `[row, column, channel]`.
    fn channels(&self) -> ArrayView3<'_, u8>;

    /// For a gel sensor.
    fn image(&self) -> GelImage<'_>;
}

impl Pixels for Array2<u8> {
    const IS_GREY: bool = true;

    fn read_next(&mut self, reader: &mut FrameReader) -> Result<Option<f64>, FileError> {
        reader.next_frame(self)
    }

    fn size(&self) -> (usize, usize) {
        self.dim()
    }

    fn channels(&self) -> ArrayView3<'_, u8> {
        self.view().insert_axis(Axis(2))
    }

    fn image(&self) -> GelImage<'_> {
        self.into()
    }
}

impl Pixels for Array3<u8> {
    const IS_GREY: bool = false;

    fn read_next(&mut self, reader: &mut FrameReader) -> Result<Option<f64>, FileError> {
        reader.next_colour_frame(self)
    }

    fn size(&self) -> (usize, usize) {
        (self.dim().0, self.dim().1)
    }

    fn channels(&self) -> ArrayView3<'_, u8> {
        self.view()
    }

    fn image(&self) -> GelImage<'_> {
        self.into()
    }
}

/// The help of an argument for frames.
pub(crate) fn frames_help(what: &str) -> String {
    let formats = tactile_files::io::frame_formats();
    format!("{what}: {formats}, or `-` for a pipe of any of them")
}

/// Pressed frames and the frame without contact.
#[derive(Args)]
pub(crate) struct SensorFrames {
    #[arg(required = true, help = frames_help("Pressed frames"))]
    pub frames: Vec<PathBuf>,
    /// Frame of the sensor without contact.
    #[arg(long, value_name = "IMAGE")]
    pub reference: PathBuf,
    /// Size of a pixel on the sensor's surface in micrometres, or its width and height.
    #[arg(long, value_name = "X[,Y]", value_parser = pixel_um, allow_negative_numbers = true)]
    pixel_um: [f64; 2],
    /// Bits of the camera, for 16-bit images whose file does not state them.
    #[arg(long, value_parser = clap::value_parser!(u8).range(8..=16))]
    pub bits: Option<u8>,
}

impl SensorFrames {
    /// The files that are read: reference, a table and the frames.
    pub(crate) fn files<'a>(&'a self, table: &'a Path) -> Vec<&'a Path> {
        let frames = self.frames.iter().map(PathBuf::as_path);
        frames.chain([self.reference.as_path(), table]).collect()
    }

    pub(crate) fn pixel_m(&self) -> [f64; 2] {
        self.pixel_um.map(|um| um * 1e-6)
    }

    /// The frame without contact, in eight bits.
    pub(crate) fn read_reference(&self, grey: Grey) -> Result<Array2<u8>, Failure> {
        self.read_without_contact(&self.reference, grey)
    }

    /// Another frame without contact, in eight bits.
    pub(crate) fn read_without_contact(
        &self,
        path: &Path,
        grey: Grey,
    ) -> Result<Array2<u8>, Failure> {
        Ok(read_grey_image(path, grey, self.bits)?.to_u8())
    }

    /// The options for reading the pressed frames.
    pub(crate) fn reading(&self, grey: Grey, reference: &Array2<u8>) -> Reading<'_> {
        Reading {
            grey,
            bits: self.bits,
            reference: &self.reference,
            size: reference.dim(),
        }
    }
}

/// The options for reading frames: conversion to grey, bits of the camera, and the reference that
/// they must match.
#[derive(Clone, Copy)]
pub(crate) struct Reading<'a> {
    pub grey: Grey,
    pub bits: Option<u8>,
    pub reference: &'a Path,
    /// Rows and columns of the reference.
    pub size: (usize, usize),
}

impl Reading<'_> {
    fn open(&self, path: &Path) -> Result<FrameReader, Failure> {
        let reader = FrameReader::open(path, DEFAULT_RATE_HZ)?;
        Ok(reader.with_grey(self.grey).with_bits(self.bits))
    }

    /// Reads the next frame and refuses it if its size differs from the reference. Returns false at
    /// the end.
    fn next<P: Pixels>(
        &self,
        source: &mut FrameReader,
        path: &Path,
        frame: &mut P,
    ) -> Result<bool, Failure> {
        if frame.read_next(source)?.is_none() {
            return Ok(false);
        }
        same_shape((path, frame.size()), (self.reference, self.size))?;
        Ok(true)
    }

    /// Passes the frames of these files in order to `work`, with the memory of one frame, until
    /// Ctrl-C. If a file cannot be read or is cut short, a caution is given and the next file
    /// follows. Returns the number of files and frames that could not be read.
    ///
    /// # Errors
    /// The error of the first file, if no file has a frame.
    pub(crate) fn each<P: Pixels>(
        &self,
        paths: &[PathBuf],
        context: &mut Context,
        mut work: impl FnMut(Arrived<'_, P>, &mut Context) -> Result<(), Failure>,
    ) -> Result<usize, Failure> {
        let mut bar = Bar::of(paths.len(), "measuring");
        let (mut pixels, mut unreadable) = (P::default(), 0);
        let (mut failures, mut any, mut colours) = (Vec::new(), false, Colours::Unknown);
        context.interrupt.polled(true);
        for (file, path) in paths.iter().enumerate() {
            if context.interrupt.requested() {
                break;
            }
            let mut number = 0;
            let mut read = |source: &mut FrameReader| -> Result<Result<(), Failure>, Failure> {
                while !context.interrupt.requested() {
                    match self.next(source, path, &mut pixels) {
                        Ok(true) => number += 1,
                        ended => return Ok(ended.map(|_| ())),
                    }
                    failures
                        .drain(..)
                        .for_each(|failure| context.caution(failure));
                    any = true;
                    if number == 1 && P::IS_GREY {
                        colours.compare(self.reference, path, source.colour(), context);
                    }
                    let frame = Arrived {
                        path,
                        file,
                        number,
                        place: source.frames() as usize,
                        rate_hz: source.frame_rate_hz(),
                        pixels: &mut pixels,
                    };
                    work(frame, context)?;
                }
                Ok(Ok(()))
            };
            let ended = match self.open(path) {
                Ok(mut source) => {
                    let ended = read(&mut source)?;
                    if number > 0 {
                        unreadable += passed_over(path, &source, context);
                    }
                    ended
                }
                Err(failure) => Err(failure),
            };
            if let Err(failure) = ended {
                unreadable += 1;
                match any {
                    true => context.caution(failure),
                    false => failures.push(failure),
                }
            }
            bar.done(file + 1);
        }
        context.interrupt.polled(false);
        let mut failures = failures.into_iter();
        let Some(first) = failures.next() else {
            return Ok(unreadable);
        };
        failures.for_each(|failure| context.caution(failure));
        Err(first)
    }

    /// All frames of these files, and the number of files and frames that could not be read.
    pub(crate) fn all<P: Pixels>(
        &self,
        paths: &[PathBuf],
        context: &mut Context,
    ) -> Result<(Vec<NamedFrame<P>>, usize), Failure> {
        let mut frames = Vec::new();
        let unreadable = self.each(paths, context, |frame, context| {
            frames.push(frame.named());
            let job = format!("a stream of {} frames or more", frames.len());
            let bytes = frames.len() as f64 * (self.size.0 * self.size.1) as f64;
            context.allow(bytes, &job, "give fewer or smaller frames")
        })?;
        Ok((frames, unreadable))
    }
}

/// Gives cautions about damaged frames of a stream and about frames that its recorder dropped.
/// Returns the number of damaged frames.
fn passed_over(path: &Path, source: &FrameReader, context: &mut Context) -> usize {
    let (dropped, damaged, sentences) = source.passed_over();
    let path = path.display();
    if let [first, ..] = sentences {
        let frames = count(damaged as usize, "damaged frame");
        let sentence = format!("{path}: {frames} skipped, the first {first}");
        context.warn("frames_damaged", json!({ "frames": damaged }), sentence);
    }
    if dropped > 0 {
        let frames = count(dropped as usize, "frame");
        let sentence = format!("{path}: the recorder dropped {frames}, whose times are kept");
        context.warn("frames_dropped", json!({ "frames": dropped }), sentence);
    }
    damaged as usize
}

/// Mean red, green and blue of an image. `None` for a grey image.
type Colour = Option<[f64; 3]>;

/// Red and blue are exchanged if exchanging them reduces the difference between the mean colours of
/// two frames below this share. Under the same light the difference does not fall so far.
const EXCHANGED: f64 = 0.5;

/// The state of the comparison of colours between the frames and their reference.
pub(crate) enum Colours {
    Unknown,
    /// The mean colours of the reference.
    Reference(Colour),
    /// A caution was given. One is enough.
    Warned,
}

impl Colours {
    /// Gives a caution if only one of frame and reference is in colour, or if red and blue are
    /// exchanged in one of them.
    pub(crate) fn compare(
        &mut self,
        reference: &Path,
        path: &Path,
        frame: Colour,
        context: &mut Context,
    ) {
        if let Self::Unknown = self {
            // A sensor file has no colours, and its reference was read before.
            *self = image_colour(reference).map_or(Self::Warned, Self::Reference);
        }
        let Self::Reference(rest) = *self else {
            return;
        };
        let (path, reference) = (path.display(), reference.display());
        let remedy = "Save both in the same way, as for the calibration";
        let sentence = match (rest, frame) {
            (None, Some(_)) => format!(
                "{path} is in colour and {reference} is grey: its channels are weighted as those \
                 of \
                 an image in red, green and blue. {remedy}"
            ),
            (Some(_), None) => format!("{path} is grey and {reference} is in colour. {remedy}"),
            (Some(rest), Some([r, g, b]))
                if off(rest, [b, g, r]) < EXCHANGED * off(rest, [r, g, b]) =>
            {
                format!(
                    "red and blue seem to be exchanged between {path} and {reference}. {remedy}"
                )
            }
            _ => return,
        };
        context.warn(
            "colours_differ",
            json!({ "frame": path.to_string() }),
            sentence,
        );
        *self = Self::Warned;
    }
}

fn off(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// A frame that was just read.
pub(crate) struct Arrived<'a, P> {
    pub path: &'a Path,
    /// The index of its file.
    pub file: usize,
    /// Number among the frames that were read from its file, from 1.
    pub number: usize,
    /// Number among all frames of its file, including dropped and damaged ones, from 1.
    pub place: usize,
    /// Frames per second as stated by its file.
    pub rate_hz: Option<f64>,
    pub pixels: &'a mut P,
}

impl<P: Default> Arrived<'_, P> {
    /// Takes the frame's pixels.
    pub(crate) fn named(self) -> NamedFrame<P> {
        NamedFrame::new(self.path, self.number, take(self.pixels))
    }
}

/// A frame with its name.
pub(crate) struct NamedFrame<P = Array2<u8>> {
    pub name: String,
    /// First part of the names of its result files.
    pub stem: OsString,
    pub pixels: P,
}

impl<P> NamedFrame<P> {
    fn new(path: &Path, number: usize, pixels: P) -> Self {
        let (mut name, mut stem) = match path.to_str() {
            Some("-") => ("standard input".to_owned(), "stdin".into()),
            _ => (
                path.display().to_string(),
                path.file_stem().unwrap_or_default().to_owned(),
            ),
        };
        if number > 1 {
            name += &format!(" frame {number}");
            stem.push(format!("_{number}"));
        }
        Self { name, stem, pixels }
    }

    /// The name of a result file.
    pub(crate) fn file(&self, suffix: &str) -> OsString {
        let mut name = self.stem.clone();
        name.push(suffix);
        name
    }
}
