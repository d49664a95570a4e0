//! Streams of binary PGM and PPM images.
use super::super::image::header_words;
use super::{Broken, Decoder, Encoded, Format, LONGEST_HEADER, append, is_read, quoted};
use std::io::{BufRead, Read, Result as IoResult};

pub(super) const FORMAT: Format = Format {
    name: "PGM, PPM",
    begins: |start| matches!(start, [b'P', b'5' | b'6', ..]),
    open: |_| Ok(Box::new(Anymaps)),
};

struct Anymaps;

impl Decoder for Anymaps {
    fn next(&mut self, input: &mut dyn BufRead, _: Vec<u8>) -> Result<Option<Encoded>, Broken> {
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
        Ok(Some(Encoded::File(bytes.into())))
    }
}

/// The header of the next PGM or PPM, up to the byte before its samples. `None` at the end.
fn anymap_header(input: &mut dyn BufRead) -> IoResult<Option<Vec<u8>>> {
    let mut header = Vec::new();
    let (mut words, mut in_word, mut in_comment) = (0, false, false);
    for byte in input.take(LONGEST_HEADER).bytes() {
        let byte = byte?;
        // Some writers put a line break after an image.
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
