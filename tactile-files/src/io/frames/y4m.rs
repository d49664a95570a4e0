//! YUV4MPEG2 videos, as `ffmpeg -f yuv4mpegpipe` writes them.
use super::{Broken, Decoder, Encoded, Format, LONGEST_HEADER, append, is_read, quoted};
use std::io::{BufRead, Read, Result as IoResult, copy, sink};

pub(super) const FORMAT: Format = Format {
    name: "YUV4MPEG2",
    begins: |start| start.starts_with(b"YUV4MPEG2 "),
    open: |input| {
        let header = line(input)?;
        let expected = "the header of a YUV4MPEG2 video";
        let video = Video::parse(&header).map_err(|found| Broken::new(expected, found))?;
        Ok(Box::new(video))
    },
};

/// The header of a YUV4MPEG2 video.
struct Video {
    columns: usize,
    rows: usize,
    depth: u32,
    /// Size in bytes of the planes after the luma.
    chroma_bytes: usize,
    rate_hz: Option<f64>,
}

impl Video {
    /// The parsed header, or a description of the part that cannot be used.
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
            // These words give the position of 8-bit chroma samples.
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

    /// The luma as a PGM, whose header states the bits, so that one rule scales the deep samples of
    /// all formats.
    fn anymap(&self, luma: &[u8]) -> Vec<u8> {
        let largest = (1_u32 << self.depth) - 1;
        let header = format!("P5\n{} {}\n{largest}\n", self.columns, self.rows);
        let swapped = luma
            .chunks_exact(2)
            .flat_map(|sample| [sample[1], sample[0]]);
        header.into_bytes().into_iter().chain(swapped).collect()
    }
}

impl Decoder for Video {
    fn next(
        &mut self,
        input: &mut dyn BufRead,
        mut samples: Vec<u8>,
    ) -> Result<Option<Encoded>, Broken> {
        let start = line(input)?;
        if start.is_empty() {
            return Ok(None);
        }
        if !(start.starts_with(b"FRAME") && start.ends_with(b"\n")) {
            let found = quoted(&String::from_utf8_lossy(&start), 40);
            return Err(Broken::new("the word FRAME", format!("`{found}`")));
        }
        let luma = self.rows * self.columns * self.bytes_per_sample();
        samples.clear();
        append(input, luma, &mut samples)?;
        let rest = input.take(self.chroma_bytes as u64);
        let skipped = copy(&mut { rest }, &mut sink())? as usize;
        if samples.len() + skipped < luma + self.chroma_bytes {
            let found = samples.len() + skipped;
            return Err(Broken::cut(luma + self.chroma_bytes, found));
        }
        Ok(Some(match self.depth {
            8 => Encoded::Luma {
                size: (self.rows, self.columns),
                samples,
            },
            _ => Encoded::File(self.anymap(&samples).into()),
        }))
    }

    fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }
}

/// A line with its line break. The break is missing if the stream ends or the line is too long.
fn line(input: &mut dyn BufRead) -> IoResult<Vec<u8>> {
    let mut line = Vec::new();
    input.take(LONGEST_HEADER).read_until(b'\n', &mut line)?;
    Ok(line)
}
