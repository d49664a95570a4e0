//! Frames that NumPy wrote: arrays in `.npy` files and in `.npz` archives.
//!
//! A reader of its own for a header of three fields: those that exist bring a parser of Python's
//! literals.
use super::super::files::LARGEST_FILE;
use super::{Broken, Decoder, Encoded, Format, LONGEST_HEADER, append, is_read, quoted};
use ::image::{DynamicImage, ImageBuffer};
use std::io::{BufRead, Cursor, Read};
use zip::read::read_zipfile_from_stream;

/// The first bytes of an array, or of an archive.
pub(super) const START: [&[u8]; 2] = [b"\x93NUMPY", b"PK\x03\x04"];

pub(super) const FORMAT: Format = Format {
    name: "NPY",
    begins: |start| start.starts_with(START[0]),
    open: |_| Ok(Box::new(Arrays::default())),
};

pub(super) const ARCHIVE: Format = Format {
    name: "NPZ",
    begins: |start| start.starts_with(START[1]),
    open: |_| {
        Ok(Box::new(Arrays {
            member: Some(Member::default()),
            ..Arrays::default()
        }))
    },
};

/// The arrays of a stream, one after the other.
#[derive(Default)]
struct Arrays {
    /// The file of an archive that is read. `None` for arrays without an archive.
    member: Option<Member>,
    layout: Option<Layout>,
    /// Frames of the array that were not read yet.
    left: usize,
    found_any: bool,
}

impl Decoder for Arrays {
    /// Arrays of an archive that hold other numbers are passed over.
    fn next(&mut self, mut input: &mut dyn BufRead, _: Vec<u8>) -> Result<Option<Encoded>, Broken> {
        while self.left == 0 {
            if let Some(member) = &mut self.member {
                if let Some(broken) = member.broken.take() {
                    return Err(broken);
                }
                match Member::next(input)? {
                    Some(next) => *member = next,
                    None if self.found_any => return Ok(None),
                    None => return Err(Broken::new("an array of frames", "none")),
                }
            } else if input.fill_buf()?.is_empty() {
                return Ok(None);
            }
            match Layout::read(source(&mut self.member, &mut input)) {
                Ok(layout) => (self.left, self.layout) = (layout.frames, Some(layout)),
                Err(Broken::Content { .. }) if self.member.is_some() => {}
                Err(broken) => return Err(broken),
            }
        }
        let Some(layout) = self.layout else {
            return Ok(None);
        };
        if layout.fortran {
            return Err(Broken::new(
                "frames in C order (numpy.ascontiguousarray)",
                "Fortran order",
            ));
        }
        self.left -= 1;
        self.found_any = true;
        let mut samples = Vec::new();
        append(
            source(&mut self.member, &mut input),
            layout.bytes(),
            &mut samples,
        )?;
        if samples.len() < layout.bytes() {
            let broken = self.member.as_mut().and_then(|member| member.broken.take());
            return Err(broken.unwrap_or(Broken::cut(layout.bytes(), samples.len())));
        }
        Ok(layout.image(samples).map(Encoded::Decoded))
    }
}

/// What the arrays are read from.
fn source<'a>(member: &'a mut Option<Member>, input: &'a mut &mut dyn BufRead) -> &'a mut dyn Read {
    match member {
        Some(member) => &mut member.content,
        None => input,
    }
}

/// How the frames of an array lie in it.
#[derive(Clone, Copy)]
struct Layout {
    frames: usize,
    rows: usize,
    columns: usize,
    channels: usize,
    wide: bool,
    big_endian: bool,
    fortran: bool,
}

impl Layout {
    const EXPECTED: &str = "an array of frames, uint8 or uint16 of shape (rows, columns) or \
                            (frames, rows, columns), with 3 behind them for colours";

    /// Reads the header of an array.
    fn read(input: &mut dyn Read) -> Result<Self, Broken> {
        let mut start = [0; 8];
        input.read_exact(&mut start)?;
        let mut length = [0; 4];
        // The length of a header has two bytes in the first version and four in later ones.
        let digits = if start[6] == 1 { 2 } else { 4 };
        input.read_exact(&mut length[..digits])?;
        let length = u64::from(u32::from_le_bytes(length));
        if !start.starts_with(START[0]) || length > LONGEST_HEADER {
            return Err(Broken::new(Self::EXPECTED, "no header of an array"));
        }
        let mut header = Vec::new();
        input.take(length).read_to_end(&mut header)?;
        let header = String::from_utf8_lossy(&header);
        Self::parse(&header)
            .ok_or_else(|| Broken::new(Self::EXPECTED, format!("`{}`", quoted(&header, 120))))
    }

    fn parse(header: &str) -> Option<Self> {
        let (kind, fortran, sides) = header_fields(header)?;
        let (wide, big_endian) = match kind {
            "|u1" => (false, false),
            "<u2" => (true, false),
            ">u2" => (true, true),
            _ => return None,
        };
        let (frames, rows, columns, channels) = match *sides.as_slice() {
            [rows, columns] => (1, rows, columns, 1),
            [rows, columns, 3] => (1, rows, columns, 3),
            [frames, rows, columns] => (frames, rows, columns, 1),
            [frames, rows, columns, channels @ (1 | 3)] => (frames, rows, columns, channels),
            _ => return None,
        };
        let layout = Self {
            frames,
            rows,
            columns,
            channels,
            wide,
            big_endian,
            fortran,
        };
        is_read(columns, rows).then_some(layout)
    }

    /// Bytes of a frame.
    fn bytes(&self) -> usize {
        self.rows * self.columns * self.channels * (1 + usize::from(self.wide))
    }

    fn image(&self, samples: Vec<u8>) -> Option<DynamicImage> {
        let (width, height) = (self.columns as u32, self.rows as u32);
        let sample = |pair: &[u8]| match self.big_endian {
            true => u16::from_be_bytes([pair[0], pair[1]]),
            false => u16::from_le_bytes([pair[0], pair[1]]),
        };
        let words = |bytes: Vec<u8>| bytes.chunks_exact(2).map(sample).collect::<Vec<u16>>();
        match (self.channels, self.wide) {
            (1, false) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageLuma8)
            }
            (1, true) => {
                ImageBuffer::from_raw(width, height, words(samples)).map(DynamicImage::ImageLuma16)
            }
            (_, false) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageRgb8)
            }
            (_, true) => {
                ImageBuffer::from_raw(width, height, words(samples)).map(DynamicImage::ImageRgb16)
            }
        }
    }
}

/// Kind of the numbers, whether columns come first, and shape, of an array's header.
pub(crate) fn header_fields(header: &str) -> Option<(&str, bool, Vec<usize>)> {
    let after = |key: &str| Some(header.split_once(key)?.1.trim_start());
    let kind = after("'descr':")?.strip_prefix('\'')?.split('\'').next()?;
    let fortran = after("'fortran_order':")?.starts_with("True");
    let shape = after("'shape':")?.strip_prefix('(')?.split_once(')')?.0;
    let sides = shape.split(',').map(str::trim).filter(|s| !s.is_empty());
    let sides = sides.map(str::parse).collect::<Result<Vec<usize>, _>>();
    Some((kind, fortran, sides.ok()?))
}

/// A file of an archive, read whole.
#[derive(Default)]
pub(crate) struct Member {
    pub name: String,
    pub content: Cursor<Vec<u8>>,
    /// Why the content ends before its end.
    broken: Option<Broken>,
}

impl Member {
    /// The next file. `None` where the list of the files begins, which stands behind them.
    pub(crate) fn next(mut input: &mut dyn BufRead) -> Result<Option<Self>, Broken> {
        let damaged = || {
            Broken::new(
                "an archive as numpy.savez writes it",
                "another, or a damaged one",
            )
        };
        let file = read_zipfile_from_stream(&mut input).map_err(|_| damaged())?;
        let Some(mut file) = file else {
            return Ok(None);
        };
        let mut bytes = Vec::new();
        let read = (&mut file).take(LARGEST_FILE).read_to_end(&mut bytes);
        Ok(Some(Self {
            name: file.name().map_err(|_| damaged())?.into(),
            content: Cursor::new(bytes),
            broken: read.is_err().then(damaged),
        }))
    }
}
