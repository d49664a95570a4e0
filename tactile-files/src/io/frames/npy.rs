//! Frames in NumPy arrays, from `.npy` files and `.npz` archives.
//!
//! The reader is our own. Existing ones start at the end of an archive, which a pipe cannot reach,
//! and bring a parser of Python literals for a header of three fields.
use super::{Broken, Decoder, Encoded, Format, LONGEST_HEADER, append, is_read, quoted};
use ::image::{DynamicImage, ImageBuffer};
use flate2::{Crc, Decompress, FlushDecompress, Status};
use std::io::{BufRead, Error, ErrorKind, Read, Result as IoResult, copy, sink};
use std::mem::take;

/// The first bytes of an array, or of an archive.
pub(super) const START: [&[u8]; 2] = [b"\x93NUMPY", b"PK\x03\x04"];

pub(super) const FORMAT: Format = Format {
    name: "NPY",
    begins: |start| start.starts_with(START[0]),
    open: |_| Ok(Box::new(Arrays::new(false))),
};

pub(super) const ARCHIVE: Format = Format {
    name: "NPZ",
    begins: |start| start.starts_with(START[1]),
    open: |_| Ok(Box::new(Arrays::new(true))),
};

/// The arrays of a stream in order.
struct Arrays {
    archived: bool,
    member: Member,
    layout: Option<Layout>,
    /// Number of frames of the array that were not read yet.
    left: usize,
    found_any: bool,
}

impl Arrays {
    fn new(archived: bool) -> Self {
        Self {
            archived,
            member: Member::default(),
            layout: None,
            left: 0,
            found_any: false,
        }
    }

    fn source<'a>(&'a mut self, input: &'a mut dyn BufRead) -> Box<dyn Read + 'a> {
        match self.archived {
            true => Box::new(Source {
                input,
                member: &mut self.member,
            }),
            false => Box::new(input),
        }
    }
}

impl Decoder for Arrays {
    /// Arrays of other number types in an archive are skipped.
    fn next(&mut self, input: &mut dyn BufRead, _: Vec<u8>) -> Result<Option<Encoded>, Broken> {
        while self.left == 0 {
            if self.archived {
                if self.layout.take().is_some() {
                    // Reads the end of the compressed array, which checks its sum.
                    copy(&mut self.source(input).take(1), &mut sink())?;
                }
                self.member.end(input)?;
                match Member::open(input)? {
                    Some(member) => self.member = member,
                    None if self.found_any => return Ok(None),
                    None => return Err(Broken::new("an array of frames", "none")),
                }
            } else if input.fill_buf()?.is_empty() {
                return Ok(None);
            }
            let layout = Layout::read(&mut self.source(input));
            match layout {
                Ok(layout) => (self.left, self.layout) = (layout.frames, Some(layout)),
                Err(Broken::Content { .. }) if self.archived => {}
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
        append(&mut self.source(input), layout.bytes(), &mut samples)?;
        if samples.len() < layout.bytes() {
            return Err(Broken::cut(layout.bytes(), samples.len()));
        }
        Ok(layout.image(samples).map(Encoded::Decoded))
    }
}

/// Layout of the frames in an array.
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
                            (frames, rows, columns), with a last axis of 3 for colours";

    /// Reads the header of an array.
    fn read(input: &mut dyn Read) -> Result<Self, Broken> {
        let mut start = [0; 8];
        input.read_exact(&mut start)?;
        let mut length = [0; 4];
        // The length of the header takes two bytes in version 1 and four in later versions.
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

    /// Size of a frame in bytes.
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

/// Number type, whether the order is by columns, and shape, from the header of an array.
pub(crate) fn header_fields(header: &str) -> Option<(&str, bool, Vec<usize>)> {
    let after = |key: &str| Some(header.split_once(key)?.1.trim_start());
    let kind = after("'descr':")?.strip_prefix('\'')?.split('\'').next()?;
    let fortran = after("'fortran_order':")?.starts_with("True");
    let shape = after("'shape':")?.strip_prefix('(')?.split_once(')')?.0;
    let sides = shape.split(',').map(str::trim).filter(|s| !s.is_empty());
    let sides = sides.map(str::parse).collect::<Result<Vec<usize>, _>>();
    Some((kind, fortran, sides.ok()?))
}

/// Names and contents of the files of an archive, at most `most` bytes together. `None` if the
/// archive cannot be read.
pub(crate) fn members(mut input: &[u8], mut most: u64) -> Option<Vec<(String, Vec<u8>)>> {
    let mut files = Vec::new();
    while let Some(mut member) = Member::open(&mut input).ok()? {
        let mut bytes = Vec::new();
        let source = Source {
            input: &mut input,
            member: &mut member,
        };
        most -= source.take(most).read_to_end(&mut bytes).ok()? as u64;
        let name = take(&mut member.name);
        member.end(&mut input).ok()?;
        files.push((name, bytes));
    }
    Some(files)
}

/// A file of an archive, as its local header announces it.
#[derive(Default)]
struct Member {
    name: String,
    /// Number of bytes in the archive that were not read yet.
    left: u64,
    inflate: Option<Decompress>,
    sum: Crc,
    announced_sum: u32,
    /// Whether all bytes were read, so that the checksum can be compared.
    ended: bool,
}

impl Member {
    /// The next file. `None` at the archive's directory, which follows the files.
    fn open(input: &mut dyn BufRead) -> Result<Option<Self>, Broken> {
        const FILE: &[u8] = b"PK\x03\x04";
        /// Marks a size that stands in the extra field, in 64 bits.
        const ELSEWHERE: u64 = u32::MAX as u64;
        let mut start = Vec::new();
        append(input, 4, &mut start)?;
        if [&b"PK\x01\x02"[..], b"PK\x05\x06"].contains(&start.as_slice()) {
            return Ok(None);
        }
        if start != FILE {
            let found = match start.len() {
                4 => format!("`{}`", start.escape_ascii()),
                cut => format!("the end after {cut} bytes"),
            };
            return Err(Broken::new("a file of the archive", found));
        }
        let mut header = [0; 26];
        input.read_exact(&mut header)?;
        let number = |at: usize, bytes: usize| {
            let digits = header[at..at + bytes].iter().rev();
            digits.fold(0, |sum, digit| 256 * sum + u64::from(*digit))
        };
        let (flags, method) = (number(2, 2), number(4, 2));
        let mut names = Vec::new();
        append(input, (number(22, 2) + number(24, 2)) as usize, &mut names)?;
        let mut left = number(14, 4);
        if left == ELSEWHERE {
            // The extra field of 64-bit sizes holds its kind (1), its length, the size and the
            // packed size.
            let mut extra = names.get(number(22, 2) as usize..).unwrap_or_default();
            left = loop {
                let Some((head, rest)) = extra.split_at_checked(4) else {
                    return Err(Broken::new("a size of the array", "none"));
                };
                let size = rest.get(8..16).and_then(<[u8]>::first_chunk);
                if let ([1, 0], Some(size)) = (&head[..2], size) {
                    break u64::from_le_bytes(*size);
                }
                let length = usize::from(u16::from_le_bytes([head[2], head[3]]));
                extra = rest.get(length..).unwrap_or_default();
            };
        }
        let inflate = match method {
            0 => None,
            8 => Some(Decompress::new(false)),
            _ => {
                return Err(Broken::new(
                    "arrays stored or deflated",
                    format!("method {method}"),
                ));
            }
        };
        // The file is encrypted, or its size follows its content.
        if flags & 0b1001 != 0 {
            return Err(Broken::new(
                "an archive as numpy.savez writes it to a file",
                "another",
            ));
        }
        let name = &names[..names.len().min(number(22, 2) as usize)];
        Ok(Some(Self {
            name: String::from_utf8_lossy(name).into(),
            left,
            inflate,
            sum: Crc::new(),
            announced_sum: number(10, 4) as u32,
            ended: false,
        }))
    }

    /// Skips the unread rest of the file.
    fn end(&mut self, input: &mut dyn BufRead) -> IoResult<()> {
        copy(&mut input.take(self.left), &mut sink())?;
        self.left = 0;
        Ok(())
    }
}

/// The content of a file in an archive.
struct Source<'a> {
    input: &'a mut dyn BufRead,
    member: &'a mut Member,
}

impl Read for Source<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> IoResult<usize> {
        let member = &mut *self.member;
        let mut read = 0;
        while read == 0 && !member.ended && !bytes.is_empty() {
            let waiting = self.input.fill_buf()?;
            let most = usize::try_from(member.left).unwrap_or(usize::MAX);
            let waiting = &waiting[..waiting.len().min(most)];
            if waiting.is_empty() && member.left > 0 {
                break;
            }
            let used = if let Some(inflate) = &mut member.inflate {
                let [before_in, before_out] = [inflate.total_in(), inflate.total_out()];
                let status = inflate.decompress(waiting, bytes, FlushDecompress::None)?;
                read = (inflate.total_out() - before_out) as usize;
                let used = (inflate.total_in() - before_in) as usize;
                member.ended = status == Status::StreamEnd || used + read == 0;
                used
            } else {
                read = waiting.len().min(bytes.len());
                bytes[..read].copy_from_slice(&waiting[..read]);
                member.ended = member.left == read as u64;
                read
            };
            self.input.consume(used);
            member.left -= used as u64;
            member.sum.update(&bytes[..read]);
            if member.ended && member.sum.sum() != member.announced_sum {
                let words = "an array of the archive is damaged: its checksum differs";
                return Err(Error::new(ErrorKind::InvalidData, words));
            }
        }
        Ok(read)
    }
}
