//! Frames one after the other, from a video, concatenated images, a stack of pages, arrays or one
//! image.
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

/// First bytes of an array of NumPy, and of an archive of them.
pub(super) const ARRAY_STARTS: [&[u8]; 2] = npy::START;

/// What reads videos of other codecs.
const PIPE: &str = "pipe it by ffmpeg -i VIDEO -f yuv4mpegpipe -pix_fmt gray - | tactile … -";

/// Most damaged frames that are named.
const MOST_NAMED: usize = 10;

/// The frames of a stream of bytes: a pipe from a camera, a video, a file.
///
/// The first bytes show the format.
///
/// - **YUV4MPEG2**, as `ffmpeg -f yuv4mpegpipe` writes it. The luma plane is the grey, as it is
///   stored. Samples have 8 to 16 bits.
/// - **PGM and PPM**, of binary samples, any number one after the other.
/// - **JPEG and PNG**, any number one after the other, as `ffmpeg -f image2pipe` writes them. JPEG
///   frames without Huffman tables have the standard ones.
/// - **AVI** of JPEG frames (MJPG), as webcams record them, or of uncompressed ones (I420, YUY2,
///   Y800 and their kin, of which the luma is taken, and 24-bit colours). Frames that the recorder
///   dropped keep their time.
/// - **NPY and NPZ** of NumPy: arrays of `uint8` or `uint16` in C order, of shape (rows, columns)
///   or (frames, rows, columns), with 3 behind them for colours. Several arrays follow each other
///   in an archive, and in a pipe that `numpy.save` writes to. An archive's arrays of other numbers
///   are passed over.
/// - **TIFF**, a frame a page.
/// - Any other image of [`read_grey_image`](super::read_grey_image): one frame.
///
/// A frame of an AVI, or of JPEG and PNG images, that cannot be decoded or has another size than the
/// first is passed over, and [`passed_over`](Self::passed_over) names it.
///
/// As a [`FrameSource`] it gives grey frames. [`next_colour_frame`](Self::next_colour_frame) gives
/// those of a gel that is lit in colours.
///
/// Memory is that of one frame, but for TIFF and other images, which are read whole.
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
    /// None at the end.
    decoder: Option<Box<dyn Decoder>>,
    name: PathBuf,
    grey: Grey,
    bits: Option<u8>,
    /// The number of frames that were read, those that were dropped or damaged included.
    frames: u64,
    damaged: u64,
    dropped: u64,
    passed_over: Vec<String>,
    /// That of the first damaged frame.
    first_error: Option<FileError>,
    /// Rows and columns of the first frame, which the others have too.
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

/// How the frames of one format are found in a stream. A format is a file with its decoder, an entry
/// in [`FORMATS`] and a row in `docs/cameras.md`.
trait Decoder: Send {
    /// The next frame as it is stored. The memory of an older one may be used.
    fn next(&mut self, input: &mut dyn BufRead, memory: Vec<u8>)
    -> Result<Option<Encoded>, Broken>;

    /// The frame rate that the stream states.
    fn rate_hz(&self) -> Option<f64> {
        None
    }

    /// Frames so far that the recorder dropped.
    fn dropped(&self) -> u64 {
        0
    }

    /// Whether the frames after one that cannot be decoded are found.
    fn goes_on(&self) -> bool {
        false
    }
}

type Opened = Result<Box<dyn Decoder>, Broken>;

struct Format {
    name: &'static str,
    /// Whether a stream with these first bytes is of the format.
    begins: fn(&[u8]) -> bool,
    open: fn(&mut dyn BufRead) -> Opened,
}

/// All formats. The first that a stream begins as is taken.
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
    /// Opens a file, or standard input where the path is `-`. A stream that does not state its
    /// frame rate has `frame_rate_hz`.
    ///
    /// # Errors
    /// [`FileError`] where the file cannot be read or its header is no stream's.
    pub fn open(path: impl AsRef<Path>, frame_rate_hz: f64) -> Result<Self, FileError> {
        let path = path.as_ref();
        if path == Path::new("-") {
            // A pipe holds 64 kB by default, a twentieth of a large frame. Each filling wakes both
            // programs: with 1 MiB three times as many frames come through (1392 × 1042 pixels).
            // What is no pipe, or may not grow, is read as it is.
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

    /// Reads frames from any reader. Errors call it by `name`.
    ///
    /// # Errors
    /// [`FileError`] where the reader fails or its first bytes are no stream's.
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

    /// How colours become grey, in formats that store colours as red, green and blue.
    #[must_use]
    pub fn with_grey(mut self, grey: Grey) -> Self {
        self.grey = grey;
        self
    }

    /// The bits of the camera, as [`read_grey_image`](super::read_grey_image) takes them.
    #[must_use]
    pub fn with_bits(mut self, bits: Option<u8>) -> Self {
        self.bits = bits;
        self
    }

    /// The frame rate that the stream itself states.
    pub fn frame_rate_hz(&self) -> Option<f64> {
        self.decoder.as_ref()?.rate_hz()
    }

    /// Mean red, green and blue of the last frame that was read as a grey one. `None` for one that is
    /// stored as grey.
    #[must_use]
    pub fn colour(&self) -> Option<[f64; 3]> {
        self.colour
    }

    /// Number of frames so far, those that were dropped or damaged included.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The frames that were passed over so far: the number that the recorder dropped, that of damaged
    /// ones, and a sentence on each of the first of these.
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
    /// As the grey frames, and [`FileError::Content`] for grey ones. A YUV4MPEG2 video counts as
    /// grey: most halve the resolution of colours.
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

    /// The next frame and its time. `convert` makes it, and `size` gives its rows and columns.
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
                        // A stream of damaged frames alone has no frame.
                        Ok(_) if self.size.is_none() => {
                            Err(self.first_error.take().unwrap_or_else(empty))
                        }
                        ended => ended.map(|_| None),
                    };
                }
            }
        }
    }

    /// A frame of the size of the first.
    fn sized<T>(&mut self, frame: T, size: impl Fn(&T) -> (usize, usize)) -> Result<T, Broken> {
        let found = size(&frame);
        let first = *self.size.get_or_insert(found);
        if found == first {
            return Ok(frame);
        }
        Err(Broken::OtherSize { first, found })
    }
}

/// A frame as its stream stores it.
enum Encoded {
    /// A file whose first image is the frame.
    File(Arc<Vec<u8>>),
    Decoded(DynamicImage),
    /// Grey levels of so many rows and columns.
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
    /// [`FileError::Content`] where a frame is cut short, is none, or has another size than the
    /// first, and [`FileError::Image`] where it cannot be decoded. The stream has then ended.
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

/// Why a stream does not go on.
enum Broken {
    Read(Error),
    Content {
        expected: String,
        found: String,
    },
    /// Rows and columns that are not those of the first frame.
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

/// Appends the next bytes, fewer at the end of the stream. Memory grows with what arrives, not with
/// what a header announces.
fn append(input: &mut dyn Read, length: usize, bytes: &mut Vec<u8>) -> IoResult<usize> {
    input.take(length as u64).read_to_end(bytes)
}

fn is_read(columns: usize, rows: usize) -> bool {
    let (side, pixels) = largest_image();
    let sides = [columns, rows];
    sides.iter().all(|&s| s > 0 && s <= side as usize) && columns * rows <= pixels as usize
}
