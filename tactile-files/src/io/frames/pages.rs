//! TIFF files with one frame per page, and single images of any format that can be decoded.
use super::super::files::LARGEST_FILE;
use super::super::kinds::{kind_of, kind_of_text};
use super::{Broken, Decoder, Encoded, Format, LONGEST_HEADER, frame_formats, quoted};
use std::collections::HashSet;
use std::io::{BufRead, Read, Result as IoResult};
use std::mem::take;
use std::sync::Arc;

pub(super) const FORMAT: Format = Format {
    name: "TIFF",
    begins: |start| start.starts_with(b"II*\0") || start.starts_with(b"MM\0*"),
    open: |input| {
        let pages = Pages::of(whole(input)?);
        let cut = || Broken::new("a TIFF file", "one that is cut short");
        Ok(Box::new(pages.ok_or_else(cut)?))
    },
};

/// All other streams: a single image, or a kind of file that is refused.
pub(super) const OTHERS: Format = Format {
    name: "single images",
    begins: |_| true,
    open: |input| {
        let bytes = whole(input)?;
        if ::image::guess_format(&bytes).is_ok_and(|format| format.reading_enabled()) {
            // Of several PNM images in text form the decoder would read only the first.
            let (start, rest) = bytes.split_at(bytes.len().min(8));
            if start.starts_with(b"P") && rest.windows(8).any(|next| next == start) {
                return Err(Broken::new("one image", "several: write binary PGM or PPM"));
            }
            return Ok(Box::new(Single(bytes)));
        }
        if bytes.is_empty() {
            return Err(Broken::new("a video or an image", "no bytes"));
        }
        let text = || {
            let start = String::from_utf8_lossy(&bytes[..bytes.len().min(40)]);
            format!("a text that begins with `{}`", quoted(&start, 10))
        };
        let kind = kind_of(&bytes).or_else(|| kind_of_text(&bytes));
        let found = kind.unwrap_or_else(text);
        Err(Broken::new(
            format!("a video or an image ({})", frame_formats()),
            found,
        ))
    },
};

fn whole(input: &mut dyn BufRead) -> IoResult<Vec<u8>> {
    let mut bytes = Vec::new();
    input.take(LARGEST_FILE).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// One image. Empty after it was returned.
struct Single(Vec<u8>);

impl Decoder for Single {
    fn next(&mut self, _: &mut dyn BufRead, _: Vec<u8>) -> Result<Option<Encoded>, Broken> {
        let bytes = Some(take(&mut self.0)).filter(|bytes| !bytes.is_empty());
        Ok(bytes.map(|bytes| Encoded::File(bytes.into())))
    }
}

/// The pages of a TIFF file.
struct Pages {
    /// Shared with the last page, and changed in place if that page was dropped.
    bytes: Arc<Vec<u8>>,
    little_endian: bool,
    /// Offset of the directory of the next page.
    next: usize,
    /// Offsets of the directories that were read. A chain that returns to one of them would never
    /// end.
    seen: HashSet<usize>,
    /// The number of frames that ImageJ states. It writes only one directory for a large stack.
    announced: usize,
}

impl Pages {
    /// `None` if the bytes are not a TIFF file with 32-bit offsets.
    fn of(bytes: Vec<u8>) -> Option<Self> {
        let little_endian = match bytes.get(..4)? {
            b"II*\0" => true,
            b"MM\0*" => false,
            _ => return None,
        };
        let mut pages = Self {
            bytes: Arc::new(bytes),
            little_endian,
            next: 0,
            seen: HashSet::new(),
            announced: 0,
        };
        let start = &pages.bytes[..pages.bytes.len().min(LONGEST_HEADER as usize)];
        if let Some(at) = start.windows(7).position(|word| word == b"ImageJ=") {
            let description = String::from_utf8_lossy(&start[at..]);
            let mut lines = description.lines();
            let images = lines.find_map(|line| line.strip_prefix("images="));
            pages.announced = images.and_then(|n| n.parse().ok()).unwrap_or(0);
        }
        pages.next = pages.number(4, 4)?;
        Some(pages)
    }

    /// A whole number that is stored in `bytes` bytes.
    fn number(&self, at: usize, bytes: usize) -> Option<usize> {
        let mut digits = self.bytes.get(at..at.checked_add(bytes)?)?.to_vec();
        if self.little_endian {
            digits.reverse();
        }
        Some((digits.iter()).fold(0, |sum, digit| 256 * sum + usize::from(*digit)))
    }

    /// The file with its next page as the first one, which decoders of images read.
    fn turn(&mut self) -> Option<Arc<Vec<u8>>> {
        let page = self.next;
        // The first directory is read from any offset. The decoder refuses a wrong one.
        if !self.seen.is_empty() && page == 0 || !self.seen.insert(page) {
            return None;
        }
        let entries = self.number(page, 2).unwrap_or(0);
        self.next = self.number(page + 2 + 12 * entries, 4).unwrap_or(0);
        let mut first = (page as u32).to_le_bytes();
        if !self.little_endian {
            first.reverse();
        }
        Arc::make_mut(&mut self.bytes)[4..8].copy_from_slice(&first);
        Some(Arc::clone(&self.bytes))
    }
}

impl Decoder for Pages {
    fn next(&mut self, _: &mut dyn BufRead, _: Vec<u8>) -> Result<Option<Encoded>, Broken> {
        let page = self.turn();
        if page.is_none() && self.seen.len() < self.announced {
            let expected = format!("{} pages, as ImageJ states", self.announced);
            let remedy = "save the stack as an image sequence";
            return Err(Broken::new(
                expected,
                format!("{}: {remedy}", self.seen.len()),
            ));
        }
        Ok(page.map(Encoded::File))
    }

    fn goes_on(&self) -> bool {
        true
    }
}
