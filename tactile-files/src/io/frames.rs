//! Frames one after the other, from a video, concatenated images, a stack of pages, arrays or one
//! image.
mod avi;
mod jpeg;
mod npy;

use self::avi::Avi;
use self::jpeg::Images;
use self::npy::Arrays;
use super::error::{FileError, FilePlace, quoted};
use super::files::{LARGEST_FILE, open_file};
use super::image::{Grey, colour_levels, decode, eight_bit_levels, header_words, largest_image};
use super::kinds::kind_of;
use ::image::DynamicImage;
use ndarray::{Array2, Array3};
use std::borrow::Cow;
use std::collections::HashSet;
use std::io::{
    BufRead, BufReader, Cursor, Error, ErrorKind, Read, Result as IoResult, copy, sink, stdin,
};
use std::mem::take;
use std::path::{Path, PathBuf};
use tactile_imaging::pipeline::FrameSource;

/// Longest line of a video's header and longest header of an image, in bytes. Longer ones are no
/// video, and a line without an end would fill the memory.
const LONGEST_HEADER: u64 = 4096;

pub(crate) use self::npy::{header_fields, members};

/// First bytes of an array of NumPy, and of an archive of them.
pub(super) const ARRAY_STARTS: [&[u8]; 2] = Arrays::START;

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
    format: Format,
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
    default_rate_hz: f64,
}

impl std::fmt::Debug for FrameReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrameReader")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

enum Format {
    Video(Video),
    Avi(Avi),
    Images(Images),
    Arrays(Arrays),
    Anymaps,
    Pages(Pages),
    Image(Vec<u8>),
    Ended,
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
        let refused = |broken: Broken| broken.at(&name, FilePlace::File);
        let format = match start.as_slice() {
            b"YUV4MPEG2 " => {
                let header = line(&mut input).map_err(failed)?;
                let expected = "the header of a YUV4MPEG2 video";
                let video = Video::parse(&header).map_err(|found| Broken::new(expected, found));
                Format::Video(video.map_err(refused)?)
            }
            [b'P', b'5' | b'6', ..] => Format::Anymaps,
            [b'R', b'I', b'F', b'F', .., b'A', b'V'] => {
                Format::Avi(Avi::open(&mut input).map_err(refused)?)
            }
            start if start.starts_with(Arrays::START[0]) => Format::Arrays(Arrays::new(false)),
            start if start.starts_with(Arrays::START[1]) => Format::Arrays(Arrays::new(true)),
            start if jpeg::STARTS.iter().any(|image| start.starts_with(image)) => {
                Format::Images(Images::default())
            }
            [] => return Err(refused(Broken::new("a video or an image", "no bytes"))),
            _ => {
                let mut bytes = Vec::new();
                let whole = input.by_ref().take(LARGEST_FILE).read_to_end(&mut bytes);
                whole.map_err(failed)?;
                match Pages::of(&bytes) {
                    Some(pages) => Format::Pages(pages),
                    None if is_image(&bytes) => Format::Image(bytes),
                    None => {
                        let expected = "a video or an image, known by its first bytes";
                        let found = kind_of(&bytes).map_or_else(
                            || format!("a text that begins with `{}`", start.escape_ascii()),
                            str::to_owned,
                        );
                        return Err(refused(Broken::new(expected, found)));
                    }
                }
            }
        };
        Ok(Self {
            input: Box::new(input),
            format,
            name,
            grey: Grey::default(),
            bits: None,
            frames: 0,
            damaged: 0,
            dropped: 0,
            passed_over: Vec::new(),
            first_error: None,
            size: None,
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
        match &self.format {
            Format::Video(video) => video.rate_hz,
            Format::Avi(avi) => avi.rate_hz,
            _ => None,
        }
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
        let convert = |encoded: Encoded<'_>, name: &Path| {
            let image = match encoded {
                Encoded::Luma { .. } => return Err(colours("a video in luma and chroma")),
                Encoded::File(bytes) => decode(&bytes, name)?,
                Encoded::Decoded(image) => image,
            };
            colour_levels(image).ok_or_else(|| colours("a grey one"))
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
        convert: impl Fn(Encoded<'_>, &Path) -> Result<T, Broken>,
        size: impl Fn(&T) -> (usize, usize),
    ) -> Result<Option<(f64, T)>, FileError> {
        let rate_hz = self.frame_rate_hz().unwrap_or(self.default_rate_hz);
        let name = self.name.clone();
        let mut memory = Some(memory);
        loop {
            let before = self.frames;
            let read = self.read(memory.take().unwrap_or_default(), |encoded| {
                convert(encoded, &name)
            });
            self.frames = match &self.format {
                Format::Avi(avi) => avi.frames,
                _ if matches!(read, Ok(None)) => before,
                _ => before + 1,
            };
            let got = u64::from(!matches!(read, Ok(None)));
            self.dropped += (self.frames - before).saturating_sub(got);
            let read = read.and_then(|next| next.map(|next| self.sized(next, &size)).transpose());
            let place = FilePlace::Frame(self.frames.max(before + 1));
            let goes_on = matches!(self.format, Format::Avi(_) | Format::Images(_));
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
                    // A stream of damaged frames alone has no frame.
                    let error = self.first_error.take().filter(|_| self.size.is_none());
                    self.format = Format::Ended;
                    return match error {
                        Some(error) => Err(error),
                        None => ended.map(|_| None),
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

    /// The next frame as `convert` makes it, in the memory of an older one where the format allows
    /// that.
    fn read<T>(
        &mut self,
        memory: Vec<u8>,
        convert: impl Fn(Encoded<'_>) -> Result<T, Broken>,
    ) -> Result<Option<T>, Broken> {
        let input = &mut self.input;
        let file = |bytes: Cow<'_, [u8]>| convert(Encoded::File(bytes));
        Ok(match &mut self.format {
            Format::Ended => None,
            Format::Image(bytes) => {
                let bytes = take(bytes);
                self.format = Format::Ended;
                Some(file(bytes.into())?)
            }
            Format::Pages(pages) => {
                let page = pages.turn();
                page.map(|bytes| file(bytes.into())).transpose()?
            }
            Format::Avi(avi) => avi.next(input)?.map(&convert).transpose()?,
            Format::Images(images) => {
                let image = images.next(input)?;
                image.map(|bytes| file(bytes.into())).transpose()?
            }
            Format::Arrays(arrays) => {
                let image = arrays.next(input)?;
                image
                    .map(|image| convert(Encoded::Decoded(image)))
                    .transpose()?
            }
            Format::Anymaps => {
                let Some(mut bytes) = anymap_header(input)? else {
                    return Ok(None);
                };
                let Some(samples) = anymap_samples(&bytes) else {
                    let found = quoted(&String::from_utf8_lossy(&bytes), 40);
                    let expected = "the header of a PGM or PPM image of at most 64 million pixels";
                    return Err(Broken::new(expected, found));
                };
                let header = bytes.len();
                append(input, samples, &mut bytes)?;
                if bytes.len() < header + samples {
                    return Err(Broken::cut(samples, bytes.len() - header));
                }
                Some(file(bytes.into())?)
            }
            Format::Video(video) => {
                let start = line(input)?;
                if start.is_empty() {
                    return Ok(None);
                }
                if !(start.starts_with(b"FRAME") && start.ends_with(b"\n")) {
                    let found = quoted(&String::from_utf8_lossy(&start), 40);
                    return Err(Broken::new("the word FRAME", format!("`{found}`")));
                }
                let luma = video.rows * video.columns * video.bytes_per_sample();
                let mut samples = memory;
                samples.clear();
                append(input, luma, &mut samples)?;
                let rest = input.take(video.chroma_bytes as u64);
                let skipped = copy(&mut { rest }, &mut sink())? as usize;
                if samples.len() + skipped < luma + video.chroma_bytes {
                    let found = samples.len() + skipped;
                    return Err(Broken::cut(luma + video.chroma_bytes, found));
                }
                Some(convert(Encoded::Luma { video, samples })?)
            }
        })
    }
}

/// A frame as its stream stores it.
enum Encoded<'a> {
    /// An image with its header.
    File(Cow<'a, [u8]>),
    Decoded(DynamicImage),
    Luma {
        video: &'a Video,
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
        let convert = |encoded: Encoded<'_>, name: &Path| {
            let levels =
                |bytes: &[u8]| eight_bit_levels(decode(bytes, name)?, bytes, name, grey, bits);
            Ok(match encoded {
                Encoded::File(bytes) => levels(&bytes)?,
                Encoded::Decoded(image) => eight_bit_levels(image, &[], name, grey, bits)?,
                Encoded::Luma { video, samples } if video.depth > 8 => {
                    levels(&video.anymap(&samples))?
                }
                Encoded::Luma { video, samples } => {
                    let shape = (video.rows, video.columns);
                    Array2::from_shape_vec(shape, samples).unwrap_or_else(|_| Array2::zeros(shape))
                }
            })
        };
        let next = self.next_of(memory, convert, Array2::dim)?;
        Ok(next.map(|(time_s, next)| {
            *frame = next;
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

/// Whether the first bytes are those of an image that is decoded.
fn is_image(bytes: &[u8]) -> bool {
    image::guess_format(bytes).is_ok_and(|format| format.reading_enabled())
}

/// A line with its end, without one where the stream ends or the line is too long.
fn line(input: &mut dyn BufRead) -> IoResult<Vec<u8>> {
    let mut line = Vec::new();
    input.take(LONGEST_HEADER).read_until(b'\n', &mut line)?;
    Ok(line)
}

/// Appends the next bytes, fewer at the end of the stream. Memory grows with what arrives, not with
/// what a header announces.
fn append(input: &mut dyn Read, length: usize, bytes: &mut Vec<u8>) -> IoResult<usize> {
    input.take(length as u64).read_to_end(bytes)
}

/// What the header of a YUV4MPEG2 video states.
struct Video {
    columns: usize,
    rows: usize,
    depth: u32,
    /// Bytes of the planes after the luma.
    chroma_bytes: usize,
    rate_hz: Option<f64>,
}

impl Video {
    /// The header, or the part of it that cannot be used.
    fn parse(header: &[u8]) -> Result<Self, String> {
        let text = String::from_utf8_lossy(header);
        let Some(text) = text.strip_suffix('\n') else {
            return Err(format!("a first line of more than {} bytes", header.len()));
        };
        let field = |name| {
            text.split(' ')
                .skip(1)
                .find_map(|word| word.strip_prefix(name))
        };
        let side = |name: char| {
            let digits = field(name).unwrap_or_default();
            digits
                .parse::<usize>()
                .map_err(|_| format!("`{}`", quoted(text, 80)))
        };
        let (columns, rows) = (side('W')?, side('H')?);
        if !is_read(columns, rows) {
            return Err(format!("{columns} × {rows} pixels"));
        }
        let space = field('C').unwrap_or("420");
        let halves = [columns, rows].map(|side| side.div_ceil(2));
        let unknown = || format!("the colour space `{}`", quoted(space, 20));
        let known = [
            ("mono", 0),
            ("420", 2 * halves[0] * halves[1]),
            ("422", 2 * halves[0] * rows),
            ("444alpha", 3 * columns * rows),
            ("444", 2 * columns * rows),
            ("411", 2 * columns.div_ceil(4) * rows),
        ];
        let found = known.iter().find(|(name, _)| space.starts_with(name));
        let (name, chroma) = found.ok_or_else(unknown)?;
        let depth = match space[name.len()..].trim_start_matches('p') {
            // How the colours of 8 bits are placed.
            "" | "jpeg" | "mpeg2" | "aldv" => 8,
            digits => digits.parse().map_err(|_| unknown())?,
        };
        if !(8..=16).contains(&depth) {
            return Err(unknown());
        }
        let rate = field('F').and_then(|rate| rate.split_once(':'));
        let rate = rate.and_then(|(n, d)| Some(n.parse::<f64>().ok()? / d.parse::<f64>().ok()?));
        let mut video = Self {
            columns,
            rows,
            depth,
            chroma_bytes: 0,
            rate_hz: rate.filter(|rate| *rate > 0.0 && rate.is_finite()),
        };
        video.chroma_bytes = chroma * video.bytes_per_sample();
        Ok(video)
    }

    fn bytes_per_sample(&self) -> usize {
        if self.depth > 8 { 2 } else { 1 }
    }

    /// The luma as a PGM, whose header states the bits: one rule for deep samples of all formats.
    fn anymap(&self, luma: &[u8]) -> Vec<u8> {
        let largest = (1_u32 << self.depth) - 1;
        let header = format!("P5\n{} {}\n{largest}\n", self.columns, self.rows);
        let swapped = luma
            .chunks_exact(2)
            .flat_map(|sample| [sample[1], sample[0]]);
        header.into_bytes().into_iter().chain(swapped).collect()
    }
}

fn is_read(columns: usize, rows: usize) -> bool {
    let (side, pixels) = largest_image();
    let sides = [columns, rows];
    sides.iter().all(|&s| s > 0 && s <= side as usize) && columns * rows <= pixels as usize
}

/// The header of the next PGM or PPM up to the byte before its samples. None at the end.
fn anymap_header(input: &mut dyn BufRead) -> IoResult<Option<Vec<u8>>> {
    let mut header = Vec::new();
    let (mut words, mut in_word, mut in_comment) = (0, false, false);
    for byte in input.take(LONGEST_HEADER).bytes() {
        let byte = byte?;
        // Some writers end an image with a line's end.
        if header.is_empty() && byte.is_ascii_whitespace() {
            continue;
        }
        header.push(byte);
        in_comment = byte != b'\n' && (in_comment || (byte == b'#' && !in_word));
        let part_of_word = !in_comment && !byte.is_ascii_whitespace();
        words += usize::from(in_word && !part_of_word);
        in_word = part_of_word;
        // Magic number, width, height, largest value, and one white space.
        if words == 4 {
            break;
        }
    }
    Ok(Some(header).filter(|header| !header.is_empty()))
}

/// Bytes of the samples of an image with this header.
fn anymap_samples(header: &[u8]) -> Option<usize> {
    let words: Vec<&str> = header_words(std::str::from_utf8(header).ok()?).collect();
    let &[magic, width, height, largest] = words.as_slice() else {
        return None;
    };
    let channels = match magic {
        "P5" => 1,
        "P6" => 3,
        _ => return None,
    };
    let (width, height) = (width.parse().ok()?, height.parse().ok()?);
    let bytes = match largest.parse().ok()? {
        1..=255 => 1,
        256..=65_535_u32 => 2,
        _ => return None,
    };
    is_read(width, height).then(|| width * height * channels * bytes)
}

/// The pages of a TIFF file.
struct Pages {
    bytes: Vec<u8>,
    little_endian: bool,
    /// Where the directory of the next page stands.
    next: usize,
    /// Directories that were read: a chain that returns to one of them would never end.
    seen: HashSet<usize>,
}

impl Pages {
    /// None where the bytes are no TIFF of 32-bit offsets.
    fn of(bytes: &[u8]) -> Option<Self> {
        let little_endian = match bytes.get(..4)? {
            b"II*\0" => true,
            b"MM\0*" => false,
            _ => return None,
        };
        let mut pages = Self {
            bytes: bytes.to_vec(),
            little_endian,
            next: 0,
            seen: HashSet::new(),
        };
        pages.next = pages.number(4, 4)?;
        Some(pages)
    }

    /// A whole number of so many bytes.
    fn number(&self, at: usize, bytes: usize) -> Option<usize> {
        let mut digits = self.bytes.get(at..at.checked_add(bytes)?)?.to_vec();
        if self.little_endian {
            digits.reverse();
        }
        Some((digits.iter()).fold(0, |sum, digit| 256 * sum + usize::from(*digit)))
    }

    /// The file with the next page as its first, which is the one that decoders of images read.
    fn turn(&mut self) -> Option<&[u8]> {
        let page = self.next;
        // The first directory is the decoder's to judge, wherever it stands.
        if !self.seen.is_empty() && page == 0 || !self.seen.insert(page) {
            return None;
        }
        let entries = self.number(page, 2).unwrap_or(0);
        self.next = self.number(page + 2 + 12 * entries, 4).unwrap_or(0);
        let mut first = (page as u32).to_le_bytes();
        if !self.little_endian {
            first.reverse();
        }
        self.bytes[4..8].copy_from_slice(&first);
        Some(&self.bytes)
    }
}
