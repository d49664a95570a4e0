//! AVI files of JPEG or uncompressed frames, as webcams and microscopes record them.
use super::jpeg::with_tables;
use super::{Broken, Decoder, Encoded, Format, append, is_read, quoted};
use ::image::{DynamicImage, ImageBuffer};
use std::io::{BufRead, Read, Result as IoResult, copy, sink};

pub(super) const FORMAT: Format = Format {
    name: "AVI",
    begins: |start| matches!(start, [b'R', b'I', b'F', b'F', .., b'A', b'V']),
    open: |input| Ok(Box::new(Avi::open(input)?)),
};

/// The chunks of an AVI file: its headers, then its frames.
///
/// Lists are entered without regard to their sizes, because a recorder that was killed leaves them
/// unset.
#[derive(Default)]
struct Avi {
    rate_hz: Option<f64>,
    /// Number of announced streams, and the index of the video stream.
    streams: usize,
    video: Option<usize>,
    /// The number of frames that the header announces. It is zero in a file that was not closed.
    announced: u64,
    /// Number of frames so far, including dropped ones, and number of dropped frames.
    frames: u64,
    dropped: u64,
    pixels: Pixels,
    columns: usize,
    rows: usize,
}

/// How a frame is stored.
#[derive(Clone, Copy, Default)]
enum Pixels {
    #[default]
    Jpeg,
    /// The luma of all pixels is stored first.
    Planar,
    /// Luma and chroma alternate, with the luma at this byte of two.
    Packed(usize),
    /// Blue, green and red, with the lowest row first.
    Bgr,
}

impl Pixels {
    fn of(codec: &[u8], bits: u32) -> Option<Self> {
        match codec.to_ascii_uppercase().as_slice() {
            b"MJPG" | b"JPEG" | b"AVRN" | b"DMB1" => Some(Self::Jpeg),
            b"I420" | b"IYUV" | b"YV12" | b"NV12" | b"NV21" | b"Y800" | b"Y8  " | b"GREY"
            | b"GRAY" => Some(Self::Planar),
            b"YUY2" | b"YUYV" | b"YUNV" | b"YVYU" => Some(Self::Packed(0)),
            b"UYVY" | b"Y422" => Some(Self::Packed(1)),
            [0, 0, 0, 0] | b"DIB " if bits == 24 => Some(Self::Bgr),
            _ => None,
        }
    }
}

impl Avi {
    const EXPECTED: &str = "a video of JPEG frames (MJPG) or of uncompressed ones";

    /// Reads up to the first frame.
    fn open(input: &mut dyn BufRead) -> Result<Self, Broken> {
        let mut avi = Self::default();
        while let Some((name, size)) = chunk(input)? {
            if is_list(&name) {
                let mut kind = Vec::new();
                append(input, 4, &mut kind)?;
                match (kind.as_slice(), avi.video) {
                    (b"movi", Some(_)) => return Ok(avi),
                    (b"movi", None) => break,
                    _ => continue,
                }
            }
            let mut head = Vec::new();
            let kept = size.min(64);
            append(input, kept, &mut head)?;
            pass_over(input, size - kept + size % 2)?;
            avi.header(&name, &head)?;
        }
        Err(Broken::new(Self::EXPECTED, "none"))
    }

    fn header(&mut self, name: &[u8; 4], head: &[u8]) -> Result<(), Broken> {
        let number = |at: usize| {
            let bytes = head.get(at..).and_then(<[u8]>::first_chunk);
            u32::from_le_bytes(bytes.copied().unwrap_or_default())
        };
        match name {
            b"avih" => self.announced = number(16).into(),
            b"strh" => {
                self.streams += 1;
                if self.video.is_none() && head.starts_with(b"vids") {
                    self.video = Some(self.streams - 1);
                    let rate_hz = f64::from(number(24)) / f64::from(number(20));
                    self.rate_hz = Some(rate_hz).filter(|r| *r > 0.0 && r.is_finite());
                }
            }
            b"strf" if self.video.is_some_and(|video| video + 1 == self.streams) => {
                let codec = head.get(16..20).unwrap_or_default();
                let Some(pixels) = Pixels::of(codec, number(14) & 0xffff) else {
                    let codec = String::from_utf8_lossy(codec);
                    let found = format!("the codec `{}`: {}", quoted(&codec, 4), super::PIPE);
                    return Err(Broken::new(Self::EXPECTED, found));
                };
                self.pixels = pixels;
                // The height is negative if the highest row comes first.
                let side = |at| (number(at) as i32).unsigned_abs() as usize;
                (self.columns, self.rows) = (side(4), side(8));
                if !matches!(pixels, Pixels::Jpeg) && !is_read(self.columns, self.rows) {
                    let found = format!("{} × {} pixels", self.columns, self.rows);
                    return Err(Broken::new(Self::EXPECTED, found));
                }
            }
            _ => {}
        }
        Ok(())
    }
    fn frame(&self, mut bytes: Vec<u8>) -> Result<Encoded, Broken> {
        let (columns, rows) = (self.columns, self.rows);
        let pixels = columns * rows;
        // Colour rows are padded to a multiple of four bytes.
        let width = (3 * columns).next_multiple_of(4);
        let needed = match self.pixels {
            Pixels::Jpeg => return Ok(Encoded::File(with_tables(bytes).into())),
            Pixels::Planar => pixels,
            Pixels::Packed(_) => 2 * pixels,
            Pixels::Bgr => width * rows,
        };
        if bytes.len() < needed {
            return Err(Broken::cut(needed, bytes.len()));
        }
        bytes.truncate(needed);
        if let Pixels::Packed(first) = self.pixels {
            bytes = bytes.into_iter().skip(first).step_by(2).collect();
        }
        let size = (columns as u32, rows as u32);
        let image = if let Pixels::Bgr = self.pixels {
            let lines = bytes.chunks_exact(width).rev();
            let colours = lines.flat_map(|line| line[..3 * columns].chunks_exact(3));
            let colours = colours.flat_map(|bgr| [bgr[2], bgr[1], bgr[0]]).collect();
            ImageBuffer::from_raw(size.0, size.1, colours).map(DynamicImage::ImageRgb8)
        } else {
            ImageBuffer::from_raw(size.0, size.1, bytes).map(DynamicImage::ImageLuma8)
        };
        let image = image.ok_or_else(|| Broken::new(Self::EXPECTED, "another size"))?;
        Ok(Encoded::Decoded(image))
    }
}

impl Decoder for Avi {
    /// Empty chunks, which cameras write for dropped frames, are skipped and counted.
    fn next(&mut self, input: &mut dyn BufRead, _: Vec<u8>) -> Result<Option<Encoded>, Broken> {
        while let Some((name, size)) = chunk(input)? {
            if is_list(&name) {
                pass_over(input, 4)?;
                continue;
            }
            let number = std::str::from_utf8(&name[..2]).ok();
            let number = number.and_then(|digits| digits.parse::<usize>().ok());
            let is_frame = number.is_some() && number == self.video && name[2] == b'd';
            if !is_frame || size == 0 {
                self.frames += u64::from(is_frame);
                self.dropped += u64::from(is_frame);
                pass_over(input, size + size % 2)?;
                continue;
            }
            let mut bytes = Vec::new();
            append(input, size, &mut bytes)?;
            self.frames += 1;
            if bytes.len() < size {
                return Err(Broken::cut(size, bytes.len()));
            }
            pass_over(input, size % 2)?;
            return self.frame(bytes).map(Some);
        }
        if self.frames < self.announced {
            let expected = format!("{} frames", self.announced);
            return Err(Broken::new(
                expected,
                format!("the end after {}", self.frames),
            ));
        }
        Ok(None)
    }

    fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    fn dropped(&self) -> u64 {
        self.dropped
    }

    fn goes_on(&self) -> bool {
        true
    }
}

fn is_list(name: &[u8; 4]) -> bool {
    [b"RIFF", b"LIST"].contains(&name)
}

/// Name and size of the next chunk. `None` at the end of the file or if the header of the chunk is
/// cut short.
fn chunk(input: &mut dyn BufRead) -> IoResult<Option<([u8; 4], usize)>> {
    let mut head = Vec::new();
    append(input, 8, &mut head)?;
    Ok(head.split_first_chunk().and_then(|(name, size)| {
        let size = u32::from_le_bytes(size.try_into().ok()?);
        Some((*name, size as usize))
    }))
}

fn pass_over(input: &mut dyn BufRead, bytes: usize) -> IoResult<u64> {
    copy(&mut input.take(bytes as u64), &mut sink())
}
