//! The frames of images, stacks, videos and pipes, as several subcommands measure them.
use crate::arguments::same_shape;
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::text::count;
use ndarray::{Array2, Array3, ArrayView3, Axis};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use tactile_files::io::{FileError, FrameReader, Grey};
use tactile_imaging::pipeline::FrameSource;

/// Frames per second where neither stream nor argument states them: those of the paper's camera.
pub const DEFAULT_RATE_HZ: f64 = 80.0;

/// The pixels of a frame, grey or in colours.
pub trait Pixels: Default {
    /// Reads the next frame in place of this one, and returns its time in seconds.
    fn read_next(&mut self, reader: &mut FrameReader) -> Result<Option<f64>, FileError>;

    /// Rows and columns.
    fn size(&self) -> (usize, usize);

    /// `[row, column, channel]`.
    fn channels(&self) -> ArrayView3<'_, u8>;
}

impl Pixels for Array2<u8> {
    fn read_next(&mut self, reader: &mut FrameReader) -> Result<Option<f64>, FileError> {
        reader.next_frame(self)
    }

    fn size(&self) -> (usize, usize) {
        self.dim()
    }

    fn channels(&self) -> ArrayView3<'_, u8> {
        self.view().insert_axis(Axis(2))
    }
}

impl Pixels for Array3<u8> {
    fn read_next(&mut self, reader: &mut FrameReader) -> Result<Option<f64>, FileError> {
        reader.next_colour_frame(self)
    }

    fn size(&self) -> (usize, usize) {
        (self.dim().0, self.dim().1)
    }

    fn channels(&self) -> ArrayView3<'_, u8> {
        self.view()
    }
}

/// How frames are read: the colours' grey, the camera's bits and the reference they have to fit.
#[derive(Clone, Copy)]
pub struct Reading<'a> {
    pub grey: Grey,
    pub bits: Option<u8>,
    pub reference: &'a Path,
    /// Rows and columns of the reference.
    pub size: (usize, usize),
}

impl Reading<'_> {
    pub fn open(&self, path: &Path) -> Result<FrameReader, Failure> {
        let reader = FrameReader::open(path, DEFAULT_RATE_HZ)?;
        Ok(reader.with_grey(self.grey).with_bits(self.bits))
    }

    /// Refuses a frame of another size than the reference.
    pub fn fits(&self, path: &Path, frame: &impl Pixels) -> Result<(), Failure> {
        same_shape((path, frame.size()), (self.reference, self.size))
    }

    /// Finds a file that cannot be read before the first one is measured. A pipe is read once.
    pub fn check(&self, paths: &[PathBuf]) -> Result<(), Failure> {
        let files = paths.iter().filter(|path| *path != Path::new("-"));
        let mut frame = Array2::zeros((0, 0));
        for path in files {
            self.open(path)?.next_frame(&mut frame)?;
            self.fits(path, &frame)?;
        }
        Ok(())
    }

    /// The frames of these files one after the other, each with its name. The failure of a stream
    /// that breaks off after its first frame is a partial answer, that of any other file an input
    /// that cannot be used.
    pub fn frames<P: Pixels>(
        &self,
        paths: &[PathBuf],
    ) -> impl Iterator<Item = Result<NamedFrame<P>, Failure>> {
        paths.iter().flat_map(move |path| {
            let (mut source, mut number) = (Some(self.open(path)), 0);
            std::iter::from_fn(move || {
                let mut frame = P::default();
                let read = source.take()?.and_then(|mut reader| {
                    if frame.read_next(&mut reader)?.is_none() {
                        return match passed_over(path, &reader) {
                            Some(sentence) => Err(Failure::no_answer(sentence)),
                            None => Ok(None),
                        };
                    }
                    self.fits(path, &frame)?;
                    Ok(Some(reader))
                });
                match read {
                    Ok(reader) => {
                        source = Some(Ok(reader?));
                        number += 1;
                        Some(Ok(NamedFrame::new(path, number, frame)))
                    }
                    Err(failure) if number > 0 => Some(Err(Failure::no_answer(failure))),
                    Err(failure) => Some(Err(failure)),
                }
            })
        })
    }

    /// All frames of these files. A stream that breaks off leaves those before, and makes the
    /// answer a partial one.
    pub fn all<P: Pixels>(
        &self,
        paths: &[PathBuf],
        context: &mut Context,
    ) -> Result<(Vec<NamedFrame<P>>, Exit), Failure> {
        let (mut frames, mut exit) = (Vec::new(), Exit::Complete);
        for frame in self.frames(paths) {
            match frame {
                Ok(frame) => frames.push(frame),
                Err(failure) if failure.exit == Exit::Partial => {
                    context.caution(failure);
                    exit = Exit::Partial;
                }
                Err(failure) => return Err(failure),
            }
            let job = format!("a stream of {} frames or more", frames.len());
            let bytes = frames.len() as f64 * (self.size.0 * self.size.1) as f64;
            context.allow(bytes, &job, "give fewer or smaller frames")?;
            if context.interrupt.requested() {
                break;
            }
        }
        Ok((frames, exit))
    }
}

/// A sentence on the damaged frames of a stream that were passed over. `None` without any.
pub fn passed_over(path: &Path, reader: &FrameReader) -> Option<String> {
    let (_, damaged, sentences) = reader.passed_over();
    let [first, ..] = sentences else {
        return None;
    };
    let frames = count(damaged as usize, "damaged frame");
    Some(format!(
        "{}: {frames} passed over, the first {first}",
        path.display()
    ))
}

/// A frame with its name.
pub struct NamedFrame<P = Array2<u8>> {
    pub name: String,
    /// What the files of its results begin with.
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

    /// The name of a result.
    pub fn file(&self, suffix: &str) -> OsString {
        let mut name = self.stem.clone();
        name.push(suffix);
        name
    }
}
