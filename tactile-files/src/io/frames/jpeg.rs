//! Streams of JPEG and PNG images, as `ffmpeg -f image2pipe` and camera recorders write them, and
//! the tables that JPEG frames of webcams leave out.
use super::super::files::LARGEST_FILE;
use super::{Broken, Decoder, Encoded, Format, append};
use std::io::{BufRead, Read, Result as IoResult};

/// First bytes of a JPEG image and of a PNG image.
const STARTS: [&[u8]; 2] = [b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n"];

pub(super) const FORMAT: Format = Format {
    name: "PNG, JPEG",
    // Network cameras separate images by lines that begin with two hyphens.
    begins: |start| start.starts_with(b"--") || STARTS.iter().any(|image| start.starts_with(image)),
    open: |_| Ok(Box::new(Images::default())),
};

// Markers of JPEG: begin and end of an image, its samples, Huffman tables.
const BEGIN: u8 = 0xd8;
const END: u8 = 0xd9;
const SAMPLES: u8 = 0xda;
const TABLES: u8 = 0xc4;

/// The Huffman tables of ISO/IEC 10918-1, K.3, each with its class, counts and values.
const STANDARD: &[u8; 416] =
    b"\x00\x00\x01\x05\x01\x01\x01\x01\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x01\x02\x03\x04\
      \x05\x06\x07\x08\x09\x0a\x0b\x10\x00\x02\x01\x03\x03\x02\x04\x03\x05\x05\x04\x04\x00\x00\
      \x01\x7d\x01\x02\x03\x00\x04\x11\x05\x12\x21\x31\x41\x06\x13\x51\x61\x07\x22\x71\x14\x32\
      \x81\x91\xa1\x08\x23\x42\xb1\xc1\x15\x52\xd1\xf0\x24\x33\x62\x72\x82\x09\x0a\x16\x17\x18\
      \x19\x1a\x25\x26\x27\x28\x29\x2a\x34\x35\x36\x37\x38\x39\x3a\x43\x44\x45\x46\x47\x48\x49\
      \x4a\x53\x54\x55\x56\x57\x58\x59\x5a\x63\x64\x65\x66\x67\x68\x69\x6a\x73\x74\x75\x76\x77\
      \x78\x79\x7a\x83\x84\x85\x86\x87\x88\x89\x8a\x92\x93\x94\x95\x96\x97\x98\x99\x9a\xa2\xa3\
      \xa4\xa5\xa6\xa7\xa8\xa9\xaa\xb2\xb3\xb4\xb5\xb6\xb7\xb8\xb9\xba\xc2\xc3\xc4\xc5\xc6\xc7\
      \xc8\xc9\xca\xd2\xd3\xd4\xd5\xd6\xd7\xd8\xd9\xda\xe1\xe2\xe3\xe4\xe5\xe6\xe7\xe8\xe9\xea\
      \xf1\xf2\xf3\xf4\xf5\xf6\xf7\xf8\xf9\xfa\x01\x00\x03\x01\x01\x01\x01\x01\x01\x01\x01\x01\
      \x00\x00\x00\x00\x00\x00\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0a\x0b\x11\x00\x02\x01\x02\
      \x04\x04\x03\x04\x07\x05\x04\x04\x00\x01\x02\x77\x00\x01\x02\x03\x11\x04\x05\x21\x31\x06\
      \x12\x41\x51\x07\x61\x71\x13\x22\x32\x81\x08\x14\x42\x91\xa1\xb1\xc1\x09\x23\x33\x52\xf0\
      \x15\x62\x72\xd1\x0a\x16\x24\x34\xe1\x25\xf1\x17\x18\x19\x1a\x26\x27\x28\x29\x2a\x35\x36\
      \x37\x38\x39\x3a\x43\x44\x45\x46\x47\x48\x49\x4a\x53\x54\x55\x56\x57\x58\x59\x5a\x63\x64\
      \x65\x66\x67\x68\x69\x6a\x73\x74\x75\x76\x77\x78\x79\x7a\x82\x83\x84\x85\x86\x87\x88\x89\
      \x8a\x92\x93\x94\x95\x96\x97\x98\x99\x9a\xa2\xa3\xa4\xa5\xa6\xa7\xa8\xa9\xaa\xb2\xb3\xb4\
      \xb5\xb6\xb7\xb8\xb9\xba\xc2\xc3\xc4\xc5\xc6\xc7\xc8\xc9\xca\xd2\xd3\xd4\xd5\xd6\xd7\xd8\
      \xd9\xda\xe2\xe3\xe4\xe5\xe6\xe7\xe8\xe9\xea\xf2\xf3\xf4\xf5\xf6\xf7\xf8\xf9\xfa";

/// The images of a stream.
#[derive(Default)]
struct Images {
    /// Whether the start of the next image was already read, because the image before it was cut
    /// short.
    begun: bool,
}

impl Decoder for Images {
    /// The next image, which is cut short if the stream ends within it. Bytes between images are
    /// skipped.
    fn next(&mut self, input: &mut dyn BufRead, _: Vec<u8>) -> Result<Option<Encoded>, Broken> {
        let Some(start) = self.start(input)? else {
            return Ok(None);
        };
        let mut bytes = start.to_vec();
        if start == STARTS[1] {
            png(input, &mut bytes)?;
            return Ok(Some(Encoded::File(bytes.into())));
        }
        self.jpeg(input, &mut bytes)?;
        Ok(Some(Encoded::File(with_tables(bytes).into())))
    }

    fn goes_on(&self) -> bool {
        true
    }
}

impl Images {
    fn start(&mut self, input: &mut dyn BufRead) -> IoResult<Option<&'static [u8]>> {
        if std::mem::take(&mut self.begun) {
            return Ok(Some(STARTS[0]));
        }
        let mut last = Vec::new();
        while let Some(byte) = one(input)? {
            last.push(byte);
            if let Some(start) = STARTS.into_iter().find(|start| last.ends_with(start)) {
                return Ok(Some(start));
            }
            if last.len() > 64 {
                last.drain(..32);
            }
        }
        Ok(None)
    }

    /// Appends an image segment by segment, because a preview inside a segment has an end marker
    /// too. `bytes` ends with the first byte of a marker.
    fn jpeg(&mut self, input: &mut dyn BufRead, bytes: &mut Vec<u8>) -> IoResult<()> {
        let mut marker = next_marker(input)?;
        while let Some(found) = marker {
            if found == BEGIN {
                self.begun = true;
                break;
            }
            bytes.push(found);
            if found == END {
                break;
            }
            let at = bytes.len();
            append(input, 2, bytes)?;
            let size = bytes[at..].iter();
            let length = size.fold(0, |sum, byte| 256 * sum + usize::from(*byte));
            append(input, length.saturating_sub(2), bytes)?;
            marker = if found == SAMPLES {
                samples(input, bytes)?
            } else if one(input)? == Some(0xff) {
                bytes.push(0xff);
                next_marker(input)?
            } else {
                None
            };
        }
        Ok(())
    }
}

fn one(input: &mut dyn BufRead) -> IoResult<Option<u8>> {
    input.bytes().next().transpose()
}

/// The next marker, after any number of fill bytes.
fn next_marker(input: &mut dyn BufRead) -> IoResult<Option<u8>> {
    loop {
        match one(input)? {
            Some(0xff) => {}
            marker => return Ok(marker),
        }
    }
}

/// Appends samples and the first byte of the next marker, which is returned.
fn samples(input: &mut dyn BufRead, bytes: &mut Vec<u8>) -> IoResult<Option<u8>> {
    loop {
        (&mut *input).take(LARGEST_FILE).read_until(0xff, bytes)?;
        if bytes.last() != Some(&0xff) {
            return Ok(None);
        }
        match next_marker(input)? {
            // An escaped sample of 255, or a restart marker.
            Some(sample @ (0 | 0xd0..=0xd7)) => bytes.push(sample),
            marker => return Ok(marker),
        }
    }
}

/// Appends the chunks of an image up to the last.
fn png(input: &mut dyn BufRead, bytes: &mut Vec<u8>) -> IoResult<()> {
    loop {
        let at = bytes.len();
        if append(input, 8, bytes)? < 8 {
            return Ok(());
        }
        let head = bytes[at..].to_vec();
        let length = head[..4]
            .iter()
            .fold(0, |sum, byte| 256 * sum + usize::from(*byte));
        // The checksum follows.
        let read = append(input, length + 4, bytes)?;
        if read < length + 4 || &head[4..] == b"IEND" {
            return Ok(());
        }
    }
}

/// Adds the standard tables to a JPEG image that has none.
pub(super) fn with_tables(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut at = 2;
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..).and_then(<[u8]>::first_chunk) {
        match marker {
            TABLES => break,
            SAMPLES => {
                let length = (STANDARD.len() as u16 + 2).to_be_bytes();
                let segment = [&[0xff, TABLES][..], &length, STANDARD].concat();
                bytes.splice(at..at, segment);
                break;
            }
            _ => at += 2 + usize::from(u16::from_be_bytes([high, low])),
        }
    }
    bytes
}
