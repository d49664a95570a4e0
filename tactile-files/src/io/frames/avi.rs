//! JPEG frames in AVI files, as webcams and microscopes record them.
use super::{Broken, append, quoted};
use std::io::{BufRead, Read, Result as IoResult, copy, sink};

/// The chunks of an AVI file up to its frames, and these.
///
/// Lists are entered and their sizes are not asked for: a recorder that was killed left them open.
#[derive(Default)]
pub struct Avi {
    pub rate_hz: Option<f64>,
    /// Streams that were announced, and which of them is the video.
    streams: usize,
    video: Option<usize>,
    /// The number of frames that the header announces. It is none in a file that was left open.
    announced: u64,
    frames: u64,
}

impl Avi {
    const EXPECTED: &str = "a video of JPEG frames (MJPG)";

    /// Reads up to the first frame.
    pub fn open(input: &mut dyn BufRead) -> Result<Self, Broken> {
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
                if ![&b"MJPG"[..], b"mjpg", b"JPEG", b"jpeg"].contains(&codec) {
                    let codec = String::from_utf8_lossy(codec);
                    let found = format!("the codec `{}`", quoted(&codec, 4));
                    return Err(Broken::new(Self::EXPECTED, found));
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The next frame, a JPEG image. Empty chunks, which cameras write for frames that they
    /// dropped, are passed over.
    pub fn next(&mut self, input: &mut dyn BufRead) -> Result<Option<Vec<u8>>, Broken> {
        while let Some((name, size)) = chunk(input)? {
            if is_list(&name) {
                pass_over(input, 4)?;
                continue;
            }
            let number = std::str::from_utf8(&name[..2]).ok();
            let number = number.and_then(|digits| digits.parse::<usize>().ok());
            let is_frame = number.is_some() && number == self.video && name[2] == b'd';
            if !is_frame || size == 0 {
                pass_over(input, size + size % 2)?;
                continue;
            }
            let mut jpeg = Vec::new();
            append(input, size, &mut jpeg)?;
            if jpeg.len() < size {
                return Err(Broken::cut(size, jpeg.len()));
            }
            pass_over(input, size % 2)?;
            self.frames += 1;
            return Ok(Some(jpeg));
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
}

fn is_list(name: &[u8; 4]) -> bool {
    [b"RIFF", b"LIST"].contains(&name)
}

/// Name and size of the next chunk. None at the end, also where a chunk's header is cut.
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
