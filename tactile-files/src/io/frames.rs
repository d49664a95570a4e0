//! Reads frames in order from a video, concatenated images, a stack of pages, arrays or one image.
mod anymap;
mod avi;
mod jpeg;
mod npy;
mod pages;
mod y4m;

use super::error::{FileError, FilePlace, quoted};
use super::files::{LONGEST_HEADER, open_file};
use super::image::{Grey, colour_levels, decode, eight_bit_levels, largest_image};
use ::image::DynamicImage;
use ndarray::{Array2, Array3};
use std::io::{BufRead, BufReader, Cursor, Error, ErrorKind, Read, Result as IoResult, stdin};
use std::mem::take;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tactile_imaging::pipeline::FrameSource;

pub(crate) use self::npy::{header_fields, members};

/// First bytes of a NumPy array, and of an archive of arrays.
pub(super) const ARRAY_STARTS: [&[u8]; 2] = npy::START;

/// The remedy for videos of other codecs.
const PIPE: &str = "pipe it by ffmpeg -i VIDEO -f yuv4mpegpipe -pix_fmt gray - | tactile … -";

/// Largest number of damaged frames that are named.
const MOST_NAMED: usize = 10;

/// The frames of a stream of bytes: a pipe from a camera, a video, a file.
///
/// The first bytes show the format.
///
/// - **YUV4MPEG2**, as `ffmpeg -f yuv4mpegpipe` writes it. The stored luma plane is the grey image.
///   Samples have 8 to 16 bits.
/// - **PGM and PPM** with binary samples, any number of images in a row.
/// - **JPEG and PNG**, any number in a row, as `ffmpeg -f image2pipe` writes them. JPEG frames
///   without Huffman tables are decoded with the standard ones.
/// - **AVI** of JPEG frames (MJPG), as webcams record them, or of uncompressed frames. Of I420,
///   YUY2, Y800 and related formats the luma is taken; 24-bit colours are read too. Dropped frames
///   count for the times of later frames.
/// - **NPY and NPZ** of NumPy: arrays of `uint8` or `uint16` in C order, of shape (rows, columns)
///   or (frames, rows, columns), with a last axis of 3 for colours. An archive, or a pipe that
///   `numpy.save` writes to, may hold several arrays. Arrays of other number types in an archive
///   are skipped.
/// - **TIFF**, one frame per page.
/// - Any other image that [`read_grey_image`](super::read_grey_image) reads, as one frame.
///
/// A frame of an AVI file, or of JPEG and PNG images, is skipped if it cannot be decoded or differs
/// in size from the first. [`passed_over`](Self::passed_over) names the skipped frames.
///
/// The [`FrameSource`] implementation returns grey frames.
/// [`next_colour_frame`](Self::next_colour_frame) returns frames in colour, for gels lit in
/// colours.
///
/// One frame is held in memory at a time. TIFF files and other single images are read whole.
///
/// ```
/// use ndarray::{Array2, array};
/// use tactile_files::io::FrameReader;
/// use tactile_imaging::pipeline::FrameSource;
/// let video = b"YUV4MPEG2 W2 H1 F25:1 Cmono\nFRAME\n\x0a\x14FRAME\n\x0b\x15FRAME\n\x0c";
/// let mut camera = FrameReader::new(&video[..], "pipe", 80.0)?;
/// assert_eq!(camera.frame_rate_hz(), Some(25.0));
/// let mut frame = Array2::zeros((0, 0));
/// assert_eq!(camera.next_frame(&mut frame)?, Some(0.0));
/// assert_eq!(camera.next_frame(&mut frame)?, Some(1.0 / 25.0));
/// assert_eq!(frame, array![[11, 21]]);
/// // The third frame is cut short.
/// let error = camera.next_frame(&mut frame).unwrap_err().to_string();
/// assert_eq!(error, "pipe, frame 3: expected 2 bytes of samples, found the end after 1");
/// assert_eq!(camera.next_frame(&mut frame)?, None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct FrameReader {
    input: Box<dyn BufRead + Send>,
    /// `None` at the end of the stream.
    decoder: Option<Box<dyn Decoder>>,
    name: PathBuf,
    grey: Grey,
    bits: Option<u8>,
    /// The number of frames so far, including dropped and damaged ones.
    frames: u64,
    damaged: u64,
    dropped: u64,
    passed_over: Vec<String>,
    /// The error of the first damaged frame.
    first_error: Option<FileError>,
    /// Rows and columns of the first frame, which all frames must have.
    size: Option<(usize, usize)>,
    colour: Option<[f64; 3]>,
    default_rate_hz: f64,
}

impl std::fmt::Debug for FrameReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrameReader")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

/// Finds the frames of one format in a stream. A new format needs a file with its decoder, an entry
/// in [`FORMATS`] and a row in `docs/cameras.md`.
trait Decoder: Send {
    /// The next frame as it is stored. `memory` may be reused for it.
    fn next(&mut self, input: &mut dyn BufRead, memory: Vec<u8>)
    -> Result<Option<Encoded>, Broken>;

    /// The frame rate that the stream states.
    fn rate_hz(&self) -> Option<f64> {
        None
    }

    /// Number of frames so far that the recorder dropped.
    fn dropped(&self) -> u64 {
        0
    }

    /// Whether the stream can be read on after a frame that cannot be decoded.
    fn goes_on(&self) -> bool {
        false
    }
}

type Opened = Result<Box<dyn Decoder>, Broken>;

struct Format {
    name: &'static str,
    /// Whether a stream with these first bytes has the format.
    begins: fn(&[u8]) -> bool,
    open: fn(&mut dyn BufRead) -> Opened,
}

/// All formats. The first one whose test of the first bytes succeeds is used.
const FORMATS: [Format; 8] = [
    y4m::FORMAT,
    anymap::FORMAT,
    avi::FORMAT,
    npy::FORMAT,
    npy::ARCHIVE,
    jpeg::FORMAT,
    pages::FORMAT,
    pages::OTHERS,
];

/// The names of all formats of frames, as help and errors list them.
///
/// ```
/// let formats = tactile_files::io::frame_formats();
/// assert!(formats.starts_with("YUV4MPEG2, PGM, PPM, AVI"));
/// ```
#[must_use]
pub fn frame_formats() -> String {
    FORMATS.map(|format| format.name).join(", ")
}

impl FrameReader {
    /// Opens a file, or standard input if the path is `-`. `frame_rate_hz` is used if the stream
    /// does not state its frame rate.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be read or its header is not that of a known stream.
    pub fn open(path: impl AsRef<Path>, frame_rate_hz: f64) -> Result<Self, FileError> {
        let path = path.as_ref();
        if path == Path::new("-") {
            // A pipe holds 64 kB by default, a twentieth of a large frame, and each filling wakes
            // both programs. With 1 MiB three times as many frames of 1392 × 1042 pixels pass. If
            // the input is no pipe or may not grow, the call has no effect.
            #[cfg(target_os = "linux")]
            let _ = rustix::pipe::fcntl_setpipe_size(stdin(), 1 << 20);
            return Self::new(stdin(), "standard input", frame_rate_hz);
        }
        let file = open_file(path).map_err(|source| FileError::Read {
            path: path.into(),
            source,
        })?;
        Self::new(file, path, frame_rate_hz)
    }

    /// Reads frames from any reader. Error messages use `name` for it.
    ///
    /// # Errors
    /// [`FileError`] if the reader fails or its first bytes are not those of a known stream.
    pub fn new(
        input: impl Read + Send + 'static,
        name: impl Into<PathBuf>,
        frame_rate_hz: f64,
    ) -> Result<Self, FileError> {
        let name = name.into();
        let failed = |source| FileError::Read {
            path: name.clone(),
            source,
        };
        let mut input = BufReader::with_capacity(1 << 16, input);
        // A pipe may deliver a signature byte by byte.
        let mut start = Vec::new();
        input
            .by_ref()
            .take(10)
            .read_to_end(&mut start)
            .map_err(failed)?;
        let mut input = Cursor::new(start.clone()).chain(input);
        let format = FORMATS.into_iter().find(|format| (format.begins)(&start));
        let decoder = format.map(|format| (format.open)(&mut input)).transpose();
        let decoder = decoder.map_err(|broken| broken.at(&name, FilePlace::File))?;
        Ok(Self {
            input: Box::new(input),
            decoder,
            name,
            grey: Grey::default(),
            bits: None,
            frames: 0,
            damaged: 0,
            dropped: 0,
            passed_over: Vec::new(),
            first_error: None,
            size: None,
            colour: None,
            default_rate_hz: frame_rate_hz,
        })
    }

    /// Sets the conversion from colour to grey, for formats that store red, green and blue.
    #[must_use]
    pub fn with_grey(mut self, grey: Grey) -> Self {
        self.grey = grey;
        self
    }

    /// Sets the bits of the camera, see [`read_grey_image`](super::read_grey_image).
    #[must_use]
    pub fn with_bits(mut self, bits: Option<u8>) -> Self {
        self.bits = bits;
        self
    }

    /// The frame rate that the stream itself states.
    pub fn frame_rate_hz(&self) -> Option<f64> {
        self.decoder.as_ref()?.rate_hz()
    }

    /// Mean red, green and blue of the last frame that was read as grey. `None` if it is stored as
    /// grey.
    #[must_use]
    pub fn colour(&self) -> Option<[f64; 3]> {
        self.colour
    }

    /// Number of frames so far, including dropped and damaged ones.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The frames that were skipped so far: the number of dropped frames, the number of damaged
    /// frames, and one sentence about each of the first ten damaged frames.
    ///
    /// ```
    /// use tactile_files::io::FrameReader;
    /// use tactile_imaging::pipeline::FrameSource;
    /// // A JPEG image that ends in its header.
    /// let mut camera = FrameReader::new(&b"\xff\xd8\xff\xe0\0\x10JFIF"[..], "pipe", 25.0)?;
    /// assert!(camera.next_frame(&mut ndarray::Array2::zeros((0, 0))).is_err(), "no frame at all");
    /// assert_eq!(camera.passed_over().1, 1);
    /// # Ok::<(), tactile_files::io::FileError>(())
    /// ```
    #[must_use]
    pub fn passed_over(&self) -> (u64, u64, &[String]) {
        (self.dropped, self.damaged, &self.passed_over)
    }

    /// The next frame in red, green and blue, `[row, column, channel]`, and its time in seconds,
    /// counted from the first. Samples of 16 bits are rounded to 8.
    ///
    /// ```
    /// use tactile_files::io::FrameReader;
    /// let video = b"P6\n1 1\n255\n\xf0\x10\x00P6\n1 1\n255\n\xf1\x11\x01";
    /// let mut camera = FrameReader::new(&video[..], "pipe", 25.0)?;
    /// let mut frame = ndarray::Array3::zeros((0, 0, 0));
    /// assert_eq!(camera.next_colour_frame(&mut frame)?, Some(0.0));
    /// assert_eq!(camera.next_colour_frame(&mut frame)?, Some(1.0 / 25.0));
    /// assert_eq!(frame, ndarray::array![[[241, 17, 1]]]);
    /// assert_eq!(camera.next_colour_frame(&mut frame)?, None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The errors of grey frames, and [`FileError::Content`] if the frames are grey. A YUV4MPEG2
    /// video counts as grey, because most such videos halve the resolution of the colours.
    pub fn next_colour_frame(&mut self, frame: &mut Array3<u8>) -> Result<Option<f64>, FileError> {
        let colours = |found: &str| Broken::new("a frame in red, green and blue", found);
        let convert = |encoded: Encoded, name: &Path| {
            let image = match encoded {
                Encoded::Luma { .. } => {
                    return Err(colours(
                        "luma and chroma: ffmpeg writes colours by -c:v ppm",
                    ));
                }
                Encoded::File(bytes) => decode(&bytes, name)?,
                Encoded::Decoded(image) => image,
            };
            colour_levels(image).ok_or_else(|| colours("a grey one: record it in colour"))
        };
        let size = |frame: &Array3<u8>| (frame.dim().0, frame.dim().1);
        let next = self.next_of(Vec::new(), convert, size)?;
        Ok(next.map(|(time_s, next)| {
            *frame = next;
            time_s
        }))
    }

    /// The next frame and its time. `convert` makes the frame, and `size` returns its rows and
    /// columns.
    fn next_of<T>(
        &mut self,
        memory: Vec<u8>,
        convert: impl Fn(Encoded, &Path) -> Result<T, Broken>,
        size: impl Fn(&T) -> (usize, usize),
    ) -> Result<Option<(f64, T)>, FileError> {
        let rate_hz = self.frame_rate_hz().unwrap_or(self.default_rate_hz);
        let name = self.name.clone();
        let mut memory = Some(memory);
        loop {
            let Some(decoder) = &mut self.decoder else {
                return Ok(None);
            };
            let read = decoder.next(&mut self.input, memory.take().unwrap_or_default());
            let read = read.and_then(|next| next.map(|next| convert(next, &name)).transpose());
            let (dropped, goes_on) = (decoder.dropped(), decoder.goes_on());
            let got = u64::from(!matches!(read, Ok(None)));
            self.frames += got + dropped - self.dropped;
            self.dropped = dropped;
            let read = read.and_then(|next| next.map(|next| self.sized(next, &size)).transpose());
            let place = FilePlace::Frame(self.frames + 1 - got);
            let is_damaged = matches!(read, Err(Broken::File(_) | Broken::OtherSize { .. }));
            let read = read.map_err(|broken| broken.at(&name, place));
            match read {
                Ok(Some(next)) => return Ok(Some(((self.frames - 1) as f64 / rate_hz, next))),
                Err(error) if goes_on && is_damaged => {
                    self.damaged += 1;
                    if self.passed_over.len() < MOST_NAMED {
                        self.passed_over.push(match &error {
                            FileError::Image { reason, .. } => {
                                format!("frame {}: {reason}", self.frames)
                            }
                            other => other.to_string(),
                        });
                    }
                    self.first_error.get_or_insert(error);
                }
                ended => {
                    self.decoder = None;
                    let empty = || FileError::Empty {
                        path: name.clone(),
                        of: "frame",
                    };
                    return match ended {
                        // A stream in which all frames are damaged is an error.
                        Ok(_) if self.size.is_none() => {
                            Err(self.first_error.take().unwrap_or_else(empty))
                        }
                        ended => ended.map(|_| None),
                    };
                }
            }
        }
    }

    /// Checks that a frame has the size of the first.
    fn sized<T>(&mut self, frame: T, size: impl Fn(&T) -> (usize, usize)) -> Result<T, Broken> {
        let found = size(&frame);
        let first = *self.size.get_or_insert(found);
        if found == first {
            return Ok(frame);
        }
        Err(Broken::OtherSize { first, found })
    }
}

/// A frame as stored in the stream.
enum Encoded {
    /// A file whose first image is the frame.
    File(Arc<Vec<u8>>),
    Decoded(DynamicImage),
    /// Grey levels with their numbers of rows and columns.
    Luma {
        size: (usize, usize),
        samples: Vec<u8>,
    },
}

impl FrameSource for FrameReader {
    type Error = FileError;

    /// Writes the next frame into `frame` and returns its time in seconds, counted from the first.
    ///
    /// # Errors
    /// [`FileError::Content`] if a frame is cut short, is no frame or differs in size from the
    /// first; [`FileError::Image`] if it cannot be decoded. The stream has then ended.
    fn next_frame(&mut self, frame: &mut Array2<u8>) -> Result<Option<f64>, Self::Error> {
        let memory = take(frame).into_raw_vec_and_offset().0;
        let (grey, bits) = (self.grey, self.bits);
        let convert = |encoded: Encoded, name: &Path| {
            Ok(match encoded {
                Encoded::File(bytes) => {
                    eight_bit_levels(decode(&bytes, name)?, &bytes, name, grey, bits)?
                }
                Encoded::Decoded(image) => eight_bit_levels(image, &[], name, grey, bits)?,
                Encoded::Luma { size, samples } => {
                    let levels = Array2::from_shape_vec(size, samples);
                    (levels.unwrap_or_else(|_| Array2::zeros(size)), None)
                }
            })
        };
        let next = self.next_of(memory, convert, |(levels, _)| levels.dim())?;
        Ok(next.map(|(time_s, next)| {
            (*frame, self.colour) = next;
            time_s
        }))
    }
}

/// The reason why a stream ends.
enum Broken {
    Read(Error),
    Content {
        expected: String,
        found: String,
    },
    /// The size differs from that of the first frame.
    OtherSize {
        first: (usize, usize),
        found: (usize, usize),
    },
    File(FileError),
}

impl Broken {
    fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self::Content {
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// A frame that is cut short.
    fn cut(expected: usize, found: usize) -> Self {
        let expected = format!("{expected} bytes of samples");
        Self::new(expected, format!("the end after {found}"))
    }

    fn at(self, name: &Path, place: FilePlace) -> FileError {
        match self {
            Self::Read(source) => FileError::Read {
                path: name.into(),
                source,
            },
            Self::Content { expected, found } => FileError::content(name, place, expected, found),
            Self::OtherSize { first, found } => {
                let expected = format!("{} × {} pixels as in the first", first.1, first.0);
                FileError::content(name, place, expected, format!("{} × {}", found.1, found.0))
            }
            Self::File(error) => error,
        }
    }
}

impl From<Error> for Broken {
    fn from(error: Error) -> Self {
        match error.kind() {
            ErrorKind::UnexpectedEof => Self::new("more bytes", "the end"),
            _ => Self::Read(error),
        }
    }
}

impl From<FileError> for Broken {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

/// Appends the next bytes, or fewer at the end of the stream. Memory grows with the bytes that
/// arrive, not with the size that a header announces.
fn append(input: &mut dyn Read, length: usize, bytes: &mut Vec<u8>) -> IoResult<usize> {
    input.take(length as u64).read_to_end(bytes)
}

fn is_read(columns: usize, rows: usize) -> bool {
    let (side, pixels) = largest_image();
    let sides = [columns, rows];
    sides.iter().all(|&s| s > 0 && s <= side as usize) && columns * rows <= pixels as usize
}
