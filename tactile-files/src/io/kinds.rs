//! Detects kinds of files by their first bytes, so that an error can name the kind of a wrong file.

pub(super) const UTF_16: &str = "UTF-16 text";

/// Offset and value of the first bytes, the kind of file, and the remedy.
const KINDS: [(usize, &[u8], &str, &str); 25] = [
    (8, b"WEBP", "a WebP image", AS_PNG),
    (0, b"\xff\xfe", UTF_16, ""),
    (0, b"\xfe\xff", UTF_16, ""),
    (0, b"\x89PNG", "a PNG image", ""),
    (0, b"\xff\xd8\xff", "a JPEG image", ""),
    (0, b"II*\0", "a TIFF image", ""),
    (0, b"MM\0*", "a TIFF image", ""),
    (0, b"II+\0", "a BigTIFF", AS_TIFF),
    (0, b"MM\0+", "a BigTIFF", AS_TIFF),
    (0, b"BM", "a BMP image", AS_PNG),
    (
        0,
        b"GIF8",
        "a GIF",
        ", which is not read: save its frames as PNG",
    ),
    (0, b"P5\n", "a PGM image", ""),
    (0, b"P6\n", "a PPM image", ""),
    (0, b"YUV4MPEG2", "a YUV4MPEG2 video", ""),
    (0, b"RIFF", "an AVI video", ""),
    (4, b"ftyp", "a compressed video", PIPED),
    (0, b"\x1a\x45\xdf\xa3", "a compressed video", PIPED),
    (0, b"OggS", "a compressed video", PIPED),
    (0, b"\x00\x00\x01", "a compressed video", PIPED),
    (0, b"\x93NUMPY", "an array of NumPy", ""),
    (0, b"PK\x03\x04", "a ZIP archive", AS_CSV_OR_NPZ),
    (0, b"\x89HDF", "an HDF5 file", AS_CSV_OR_MAT),
    (
        0,
        b"MATLAB 5.0",
        "a .mat file",
        ": numpy.save writes frames",
    ),
    (0, b"%PDF", "a PDF", ""),
    (0, b"\x1f\x8b", "a file packed by gzip", ": unpack it"),
];

const AS_PNG: &str = ", which is not read: save it as PNG";
const AS_TIFF: &str = ", which is not read: save it as TIFF (tifffile: bigtiff=False)";
const AS_CSV_OR_NPZ: &str = ": a spreadsheet is saved as CSV, arrays by numpy.savez";
const AS_CSV_OR_MAT: &str = ": export CSV, or save .mat by `save -v7`";
const PIPED: &str = ", which is not read: pipe it by \
                     ffmpeg -i VIDEO -f yuv4mpegpipe -pix_fmt gray - | tactile … -";

/// First characters of texts that are no tables, and the kind of text with the remedy.
const TEXTS: [(&str, &str); 5] = [
    ("P2\n", "a PGM image"),
    ("P3\n", "a PPM image"),
    ("{", "a JSON text: export it as CSV"),
    ("<", "an HTML or XML text: export it as CSV"),
    (
        "version https://git-lfs",
        "a pointer of Git LFS in place of the file: git lfs pull",
    ),
];

/// The kind of a text that is no table. `None` if it may be a table.
pub(super) fn kind_of_text(bytes: &[u8]) -> Option<String> {
    let text = bytes.trim_ascii_start();
    // A bracket alone is not enough: the preamble of a table may have names in brackets.
    let list = text.strip_prefix(b"[").map(<[u8]>::trim_ascii_start);
    let is_json = list.is_some_and(|rest| {
        rest.starts_with(b"[") || rest.first().is_some_and(|c| b"{\"-0123456789".contains(c))
    });
    let text = if is_json { b"{" } else { text };
    let mut texts = TEXTS.iter();
    let (_, kind) = texts.find(|(start, _)| text.starts_with(start.as_bytes()))?;
    Some((*kind).into())
}

/// Number of bytes that are tested. Text has no control characters among them.
const LOOKED_AT: usize = 4096;

/// The kind of a file that is no text. `None` for text.
pub(super) fn kind_of(bytes: &[u8]) -> Option<String> {
    let begins = |(at, magic, ..): &&(usize, &[u8], &str, &str)| {
        let rest = bytes.get(*at..).unwrap_or_default();
        // A signature of two letters may be the start of a text.
        rest.starts_with(magic) && (magic.len() > 2 || !is_text(bytes) || *at > 0)
    };
    let unknown = "a binary file of an unknown kind: export it as CSV, or as PNG if it is an image";
    let kind = KINDS.iter().find(begins);
    let kind = kind.map(|(_, _, kind, remedy)| format!("{kind}{remedy}"));
    kind.or((!is_text(bytes)).then(|| unknown.into()))
}

/// Whether the first bytes of a file are text.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(LOOKED_AT)];
    let is_control = |byte: &&u8| byte.is_ascii_control() && !byte.is_ascii_whitespace();
    // A single control character is left to the reader, which names its place.
    let controls = start.iter().filter(is_control).count();
    !start.contains(&0) && 10 * controls <= start.len()
}
