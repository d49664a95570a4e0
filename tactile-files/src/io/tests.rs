//! Cases that are not covered by the documentation and by `tests/suite/io_properties`.
use super::*;
use ::image::{ImageBuffer, ImageFormat, Luma};
use std::io::Cursor;
use std::path::PathBuf;
use tactile_imaging::pipeline::FrameSource;

struct File {
    path: PathBuf,
    _folder: tempfile::TempDir,
}

fn file(bytes: impl AsRef<[u8]>) -> File {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    std::fs::write(&path, bytes).unwrap();
    File {
        path,
        _folder: folder,
    }
}

/// The error message about a file, without its name or folder.
fn sentence<T: std::fmt::Debug>(result: Result<T, FileError>) -> String {
    let text = result.unwrap_err().to_string();
    let (_, end) = text.split_once("t.csv").unwrap();
    end.into()
}

fn curve(text: &str) -> Result<[Vec<f64>; 2], FileError> {
    let file = file(text);
    read_columns(
        &file.path,
        [(&["indentation", "depth"], "m"), (&["force"], "N")],
    )
}

#[test]
fn a_file_is_replaced_whole_and_nothing_is_left_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    write_bytes(&path, b"first").unwrap();
    write_bytes(&path, b"second").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"second");
    let blocked = folder.path().join("a.csv/b.csv");
    assert!(write_bytes(&blocked, b"").is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn permissions_of_a_replaced_file_stay_and_a_socket_is_refused() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    write_bytes(&path, b"first").unwrap();
    let mode = |path: &PathBuf| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).unwrap();
    write_bytes(&path, b"second").unwrap();
    assert_eq!(mode(&path), 0o640);
    let socket = folder.path().join("socket");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    assert!(write_bytes(&socket, b"").is_err());
}

#[test]
fn a_folder_and_a_file_too_large_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let message = read_bytes(folder.path()).unwrap_err().to_string();
    assert!(message.ends_with("it is a folder, not a file: name the files in it"));
    // A sparse file takes no space on the disk.
    let file = file("");
    let holes = std::fs::File::create(&file.path).unwrap();
    holes.set_len((512 << 20) + 1).unwrap();
    let end = ": it has 536870913 bytes, more than the 536870912 that are read";
    assert_eq!(sentence(read_bytes(&file.path)), end);
}

#[test]
fn headings_are_cut_into_name_and_unit() {
    for (heading, factor) in [
        ("indentation_um", 1e-6),
        ("Depth [mm]", 1e-3),
        ("depth (μm)", 1e-6),
        ("depth cm", 1e-2),
        ("depth", 1.0),
    ] {
        let columns = curve(&format!("time_s;{heading};force_mN\n0;3;7\n")).unwrap();
        assert_eq!(columns, [[3.0 * factor], [7.0 * 1e-3]], "{heading}");
    }
    assert_eq!(curve("0.5;2\n").unwrap(), [[0.5], [2.0]], "by position");
    let counts = file("darkness_grey_levels,integrated_pixel_value\n1,2\n");
    let wanted: [(&[&str], &str); 2] = [(&["darkness"], "1"), (&["integrated_pixel_value"], "1")];
    assert_eq!(read_columns(&counts.path, wanted).unwrap(), [[1.0], [2.0]]);
}

#[test]
fn quotes_marks_and_line_ends_of_other_programs_are_understood() {
    let file = file("\u{feff}\"x\", \"y\"\r\n\"1\", 2\r\n");
    let table = read_table(&file.path).unwrap();
    assert_eq!(table.header, ["x", "y"]);
    assert_eq!(table.values, ndarray::array![[1.0, 2.0]]);
}

/// Lines of a file, and the end of the error message.
fn refused<T: std::fmt::Debug>(read: fn(&str) -> Result<T, FileError>, cases: &str) {
    for case in cases.lines() {
        let (text, end) = case.split_once(" => ").unwrap();
        let text = text.replace("\\n", "\n").replace("\\r", "\r");
        assert_eq!(sentence(read(&text)), end, "{text}");
    }
}

#[test]
fn errors_name_line_column_and_what_was_found() {
    let cases = r"1,2,3\n => , line 1: expected 2 columns, found 3
depth,force\n1,2\n1,two\n => , line 3, column 2: expected a finite number, found `two`
1,2\n\n# three\n3\n => , line 4: expected 2 columns, found 1
1,2\r\n \r\n3,x\r\n => , line 3, column 2: expected a finite number, found `x`
1,inf\n => , line 1, column 2: expected a finite number, found `inf`
depth,force\n => : expected at least one row of numbers, found none
depth_m,load_kg\n1,2\n => : expected a column named `force`, found `depth_m`, `load_kg`
depth_m,force_N,force_mN\n1,2,3\n => : expected one column named `force`, found more than one
depth_m,force (lbf)\n1,2\n => : expected the column `force` in N or a multiple of it, found `lbf`
depth_m,force_mm\n1,2\n => : expected the column `force` in N or a multiple of it, found `mm`";
    refused(curve, cases);
    // The largest number is 1.8e308: a finite number of kilonewtons need not be one of newtons.
    let end = ": expected values of the column `force` that SI units can hold, found -9e307";
    assert_eq!(sentence(curve("depth_m,force_kN\n1,-9e307\n")), end);
    let utf_16 = file([0xff, 0xfe, b'1', 0]);
    let end = ": expected UTF-8 text, found UTF-16 text";
    assert_eq!(sentence(read_table(&utf_16.path)), end);
}

#[test]
fn case_files_are_read_without_their_truth_and_errors_name_the_line() {
    let case = file("case a_1 2 1 2\nm 1 2\nt 3 4\nt 5 6\ng not read\np x\n# note\n");
    let cases = read_cases(&case.path).unwrap();
    assert!(matches!(&cases[0].points, CasePoints::Plane { target, .. } if target[1].y == 6.0));
    let cases = r"case a 2 1 1\nm 1 x\n => , line 2, column 3: expected a finite number, found `x`
case a 2 2 0\nm 1 2\n => , line 1: expected 2 rows tagged m, found 1
case a 4 0 0\n => , line 1, column 3: expected dimension 2 or 3, found `4`
m 1 2\n => , line 1, column 1: expected `case NAME D n_model n_target`, found `m`
 => : expected `case NAME D n_model n_target`, found none";
    refused(|text| read_cases(&file(text).path), cases);
}

#[test]
fn a_result_is_written_as_the_scorer_reads_it() {
    let mut out = Vec::new();
    let warped = [[0.1, 2.0].into(), [-1.0, 1e-20].into()];
    write_case_result::<2>(&mut out, "a", 1.5, &warped, &[Some(3), None]).unwrap();
    assert_eq!(out, b"case a 1.5\nw 0.1 2.0\nw -1.0 1e-20\na 3\na -1\n");
}

fn grey(bytes: &[u8], bits: Option<u8>) -> Result<GreyImage, FileError> {
    read_grey_image(&file(bytes).path, Grey::default(), bits)
}

fn pnm(header: &str, samples: &[u8]) -> GreyImage {
    grey(&[header.as_bytes(), samples].concat(), None).unwrap()
}

#[test]
fn colour_is_rec_601() {
    let image = pnm("P6\n3 1\n255\n", &[255, 0, 0, 0, 255, 0, 0, 0, 255]);
    assert_eq!((image.colour, image.bits), (Some([85.0; 3]), 8));
    // 255 times the weights, to rounding.
    for (level, weight) in image.levels.iter().zip(Grey::Rec601.weights()) {
        assert!((level - 255.0 * weight).abs() < 1e-12);
    }
    assert_eq!(image.to_u8().into_raw_vec_and_offset().0, [76, 150, 29]);
}

#[test]
fn sixteen_bits_keep_their_fraction() {
    let image = pnm("P5\n2 1\n65535\n", &[0x01, 0x00, 0xff, 0xff]);
    assert_eq!((image.bits, image.colour), (16, None));
    assert_eq!(image.levels.as_slice().unwrap(), [256.0 / 257.0, 255.0]);
}

/// A dark frame of 8 bits that another program saved with 16 bits.
#[test]
fn eight_bits_stretched_to_sixteen_are_known() {
    let png = |samples: Vec<u16>| {
        let image = ImageBuffer::<Luma<u16>, _>::from_raw(3, 1, samples).unwrap();
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::Png).unwrap();
        grey(bytes.get_ref(), None)
    };
    let levels = png(vec![0, 3 * 257, 11 * 257]).unwrap().levels;
    assert_eq!(levels.as_slice().unwrap(), [0.0, 3.0, 11.0]);
    assert!(png(vec![0, 3 * 257, 11 * 257 + 1]).is_err());
}

#[test]
fn a_pgm_is_scaled_by_the_largest_value_it_announces() {
    let image = pnm(
        "P5\n# a camera of 12 bits\n2 1\n4095\n",
        &[0x0f, 0xff, 0x03, 0x33],
    );
    // The decoder rounds 819 of 4095 to 13107 of 65535, which is exact.
    assert!((image.levels[[0, 0]] - 255.0).abs() < 1e-12);
    assert!((image.levels[[0, 1]] - 51.0).abs() < 1e-12);
    let coarse = pnm("P2\n2 1\n15\n15 3\n", b"");
    assert_eq!(coarse.levels.as_slice().unwrap(), [255.0, 51.0]);
}

#[test]
fn bits_given_beside_an_announced_largest_value_count_in_its_samples() {
    let bytes = [b"P5\n2 1\n4095\n".as_slice(), &[0x03, 0xff, 0x01, 0x55]].concat();
    let image = grey(&bytes, Some(10)).unwrap();
    // 1023 of ten bits is 255, 341 a third of it. The decoder rounds to one part in 65535.
    assert!((image.levels[[0, 0]] - 255.0).abs() < 255.0 / 16_000.0);
    assert!((image.levels[[0, 1]] - 85.0).abs() < 255.0 / 16_000.0);
    let end = ": it has a sample of 1023, more than 9 bits hold";
    assert_eq!(sentence(grey(&bytes, Some(9))), end);
}

/// The frames of a stream and, if it breaks off, the error message.
fn frames_of(bytes: &[u8]) -> (Vec<ndarray::Array2<u8>>, Option<String>) {
    let mut frames = Vec::new();
    let mut frame = ndarray::Array2::default((0, 0));
    let mut reader = match FrameReader::new(Cursor::new(bytes.to_vec()), "pipe", 80.0) {
        Ok(reader) => reader,
        Err(error) => return (frames, Some(error.to_string())),
    };
    loop {
        match reader.next_frame(&mut frame) {
            Ok(Some(time_s)) => {
                let rate_hz = reader.frame_rate_hz().unwrap_or(80.0);
                assert_eq!(time_s, frames.len() as f64 / rate_hz);
                frames.push(frame.clone());
            }
            Ok(None) => return (frames, None),
            Err(error) => {
                assert_eq!(reader.next_frame(&mut frame).unwrap(), None, "it has ended");
                return (frames, Some(error.to_string()));
            }
        }
    }
}

/// Three frames of 5 × 3 pixels.
fn three_frames() -> Vec<ndarray::Array2<u8>> {
    let frame =
        |k: usize| ndarray::Array2::from_shape_fn((3, 5), |(r, c)| (40 * k + 7 * r + c) as u8);
    (1..4).map(frame).collect()
}

/// Frames as a video. A chroma plane has 3 × 2 samples.
fn video(space: &str, bytes_per_sample: usize, chroma_planes: usize) -> Vec<u8> {
    let mut bytes = format!("YUV4MPEG2 W5 H3 F25:1 Ip A1:1 C{space} XYSCSS=A\n").into_bytes();
    for frame in three_frames() {
        bytes.extend(b"FRAME Ip\n");
        for level in frame {
            // Of 12 bits 4095 is as white as 255 of 8.
            let twelve = ((u32::from(level) * 4095 / 255) as u16).to_le_bytes();
            match bytes_per_sample {
                2 => bytes.extend(twelve),
                _ => bytes.push(level),
            }
        }
        bytes.extend(vec![128; 6 * bytes_per_sample * chroma_planes]);
    }
    bytes
}

fn anymaps() -> Vec<u8> {
    let mut bytes = Vec::new();
    for frame in three_frames() {
        bytes.extend(b"P5 # a comment\n5 3\n255\n");
        bytes.extend(frame);
    }
    bytes
}

/// A TIFF with three pages, each with its samples and its directory.
fn pages(little_endian: bool) -> Vec<u8> {
    let end_for_end = |mut bytes: Vec<u8>| {
        if !little_endian {
            bytes.reverse();
        }
        bytes
    };
    let two = |v: u16| end_for_end(v.to_le_bytes().into());
    let four = |v: u32| end_for_end(v.to_le_bytes().into());
    let magic: &[u8] = if little_endian { b"II*\0" } else { b"MM\0*" };
    let mut bytes = [magic.to_vec(), four(8 + 15)].concat();
    for (k, frame) in three_frames().into_iter().enumerate() {
        let samples = bytes.len() as u32;
        bytes.extend(frame);
        // Width, height, bits, compression, black is zero, strips, samples, rows, bytes.
        let tags = [256, 257, 258, 259, 262, 273, 277, 278, 279];
        let values = [5, 3, 8, 1, 1, samples, 1, 3, 15];
        bytes.extend(two(tags.len() as u16));
        for (tag, value) in tags.into_iter().zip(values) {
            bytes.extend([two(tag), two(4)].concat());
            bytes.extend([four(1), four(value)].concat());
        }
        let next = bytes.len() as u32 + 4 + 15;
        bytes.extend(four(if k < 2 { next } else { 0 }));
    }
    bytes
}

/// The same frames as NumPy and Pillow write them.
const OF_OTHERS: [&[u8]; 6] = [
    include_bytes!("../../../tests/data/corpus/stream/stack.npy"),
    include_bytes!("../../../tests/data/corpus/stream/big_endian.npy"),
    include_bytes!("../../../tests/data/corpus/stream/one_by_one.npy"),
    include_bytes!("../../../tests/data/corpus/stream/stored.npz"),
    include_bytes!("../../../tests/data/corpus/stream/deflated.npz"),
    include_bytes!("../../../tests/data/corpus/stream/sixteen.tif"),
];

/// Three frames of 16 × 12 pixels at 25 Hz, written by ffmpeg: grey 40 k + 3 row + 2 column.
const CLIP: &[u8] = include_bytes!("../../../tests/data/corpus/stream/clip.avi");

#[test]
fn jpeg_frames_of_a_video_are_those_that_were_recorded() {
    let (frames, broken) = frames_of(CLIP);
    assert_eq!((frames.len(), broken), (3, None));
    for (k, frame) in (1..).zip(frames) {
        for ((row, column), level) in frame.indexed_iter() {
            let recorded = 40 * k + 3 * row as i32 + 2 * column as i32;
            // What JPEG of the best quality loses.
            assert!(
                (i32::from(*level) - recorded).abs() <= 2,
                "frame {k}: {level}"
            );
        }
    }
    // What a recorder leaves that is killed: sizes and counts are none yet.
    let mut killed = CLIP.to_vec();
    killed[4..8].fill(0);
    killed[48..52].fill(0);
    let end = killed.windows(4).position(|name| name == b"idx1").unwrap();
    assert_eq!(frames_of(&killed[..end]).0.len(), 3);
    let mut another = CLIP.to_vec();
    let codec = another
        .windows(4)
        .rposition(|name| name == b"MJPG")
        .unwrap();
    another[codec..codec + 4].copy_from_slice(b"H264");
    breaks_off(&another, 0, "found the codec `H264`: pipe it by ffmpeg -i");
}

#[test]
fn jpeg_frames_follow_each_other_with_or_without_their_tables() {
    let (mut whole, mut bare) = (Vec::new(), Vec::new());
    for frame in three_frames() {
        let image = ImageBuffer::<Luma<u8>, _>::from_raw(5, 3, frame.into_raw_vec_and_offset().0);
        let mut bytes = Cursor::new(Vec::new());
        image
            .unwrap()
            .write_to(&mut bytes, ImageFormat::Jpeg)
            .unwrap();
        let mut jpeg = bytes.into_inner();
        whole.extend(&jpeg);
        while let Some(at) = jpeg.windows(2).position(|marker| marker == [0xff, 0xc4]) {
            let length = usize::from(jpeg[at + 2]) * 256 + usize::from(jpeg[at + 3]);
            jpeg.drain(at..at + 2 + length);
        }
        bare.extend(jpeg);
    }
    let (frames, broken) = frames_of(&whole);
    assert_eq!((frames.len(), broken), (3, None));
    assert_eq!(frames_of(&bare), (frames, None));
}

#[test]
fn dropped_and_damaged_frames_of_a_video_leave_the_others_their_times() {
    let second = CLIP
        .windows(4)
        .enumerate()
        .filter(|(_, name)| *name == b"00dc");
    let second = second.map(|(at, _)| at).nth(2).unwrap();
    let mut bytes = CLIP.to_vec();
    // The table of quantisation is what a decoder cannot do without.
    let damaged = second
        + 8
        + bytes[second..]
            .windows(2)
            .position(|m| m == [0xff, 0xdb])
            .unwrap()
        - 8;
    bytes[damaged + 1] = 0xfe;
    bytes.splice(second..second, *b"00dc\0\0\0\0");
    let mut reader = FrameReader::new(Cursor::new(bytes), "clip", 80.0).unwrap();
    let mut frame = ndarray::Array2::zeros((0, 0));
    let mut times = Vec::new();
    while let Some(time_s) = reader.next_frame(&mut frame).unwrap() {
        times.push((time_s * 25.0).round());
    }
    // One dropped, then one damaged, at 25 frames a second.
    assert_eq!(times, [0.0, 3.0]);
    let (dropped, damaged, sentences) = reader.passed_over();
    assert_eq!((dropped, damaged), (1, 1));
    assert!(sentences[0].starts_with("frame 3: "), "{sentences:?}");
}

#[test]
fn tables_of_other_programs_are_read() {
    let pts = "point\n2\n1.5 2\n3 4\n";
    let slicer = "# columns = id,x,y,label\n1,1.5,2,F-1\n2,3,4,F-2\n";
    let trackmate = "LABEL,POSITION_X,POSITION_Y\nName,X,Y\n,(px),(px)\nID1,1.5,2\nID2,3,4\n";
    for text in [
        "x y\n1.5 2\n3 4\n",
        "# x\ty\n1.5\t2\n3\t4\n",
        "% y, x\n2,1.5\n4,3\n",
        "# probe 3\n  1.5   2\n  3     4\n",
        "x;y\n1,5;2\n3;4\n",
        "1,5 2,0\n3,0 4,0\n",
        "COORDINATE_X,COORDINATE_Y,SIGMA\n1.5,2,word\n3,4,0\n",
        "label,\"Points:0\",\"Points:1\"\na,1.5,2,\nb,3,4,\n",
        pts,
        slicer,
        trackmate,
        // Names of rows without a heading (R, pandas), numbers as headings, units in a line.
        "\"x\" \"y\"\n\"a\" 1.5 2\n\"b\" 3 4\n",
        ",0,1\n0,1.5,2\n1,3,4\n",
        "0,1\n1.5,2.0\n3.0,4.0\n",
        "x\ty\npx\tpx\nA\tB\n1.5\t2\n3\t4\n",
        "sep=;\nx;y\n1,5;2\n3;4\n",
        "x,y\r1.5,2\r3,4\r",
        "1.5D+00  2\n 0.3D+01  4\n",
        "*** DICe\nid,Pos. X [px],Pos. Y [px]\n1,1.5,2\n2,3,4\n",
        "label,row,col\n1,2,1.5\n2,4,3\n",
        "x/px,y/px\n1.5,2\n3,4\n",
        // Groups of columns above their names, and errors of a spreadsheet in place of a number.
        "scorer,net,net,net\nparts,dot,dot,dot\ncoords,x,y,score\n0,1.5,2,1\n1,3,4,1\n",
        "a,a\nx,y\n1.5,2\n3,4\n",
        "x,y\n1.5,2\n#DIV/0!,3\n3,4\n",
    ] {
        let file = file(text);
        let frames = read_point_frames(&file.path, &TableOptions::default()).unwrap();
        let expected = vec![[1.5, 2.0].into(), [3.0, 4.0].into()];
        assert_eq!(frames[0].points, PointTable::Plane(expected), "{text}");
    }
    // Columns that are chosen may have displacements beside them, and a first row of whole numbers
    // in a matrix is one.
    let chosen = TableOptions {
        columns: ["b", "a", "3", "4"].map(String::from).into(),
        ..TableOptions::default()
    };
    let moved = file("a,b,c,d\n2,1.5,0.5,0\n");
    let moved = read_displaced_points(&moved.path, &chosen).unwrap();
    let expected = PointTable::Plane(vec![[2.0, 2.0].into()]);
    assert_eq!(moved.displaced, Some(expected));
    assert_eq!(read_grid(&file("0,1\n0.5,2\n").path).unwrap().nrows(), 2);
    // A heading that is a comment has units, and a row without a number is left out and counted.
    let file = file("# depth_um, darkness\n5, 1\n-, 2\n7, 3\n");
    let mut table = read_table(&file.path).unwrap();
    let depth = table.columns([(&["depth"], "mm")]).unwrap();
    assert_eq!(depth, [[5.0 * 1e-6, 7.0 * 1e-6]]);
    assert!(
        table.notes[1].starts_with("1 of 3 rows"),
        "{:?}",
        table.notes
    );
}

#[test]
fn arrays_of_numbers_are_tables() {
    let header = "{'descr': '>i2', 'fortran_order': True, 'shape': (3, 2), }";
    let mut npy = b"\x93NUMPY\x01\0".to_vec();
    npy.extend((header.len() as u16).to_le_bytes());
    npy.extend(
        header
            .bytes()
            .chain([0, 1, 0, 2, 0, 3, 0xff, 0xfc, 0, 5, 0, 6]),
    );
    let read = |bytes: &[u8]| read_table(&file(bytes).path).map(|table| table.values);
    assert_eq!(
        read(&npy).unwrap(),
        ndarray::array![[1.0, -4.0], [2.0, 5.0], [3.0, 6.0]]
    );
    let element = |kind: u8, content: &[u8]| {
        let mut bytes = vec![kind, 0, 0, 0, content.len() as u8, 0, 0, 0];
        bytes.extend(content);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    // A matrix of 1 × 2 doubles, which are stored as bytes: a column.
    let sides = element(5, &[1, 0, 0, 0, 2, 0, 0, 0]);
    let parts = [
        element(6, &[6, 0, 0, 0, 0, 0, 0, 0]),
        sides,
        element(1, b"x"),
        element(2, &[7, 9]),
    ];
    let mut mat = format!("{:<126}IM", "MATLAB 5.0 MAT-file").into_bytes();
    mat.extend(element(14, &parts.concat()));
    assert_eq!(read(&mat).unwrap(), ndarray::array![[7.0], [9.0]]);
    assert!(sentence(read(&mat[..150])).contains("one array of numbers"));
    // The same marked as complex: its second part would be lost.
    mat[128 + 8 + 8 + 1] = 8;
    assert!(sentence(read(&mat)).contains("save arrays of numbers"));
}

#[test]
fn what_is_no_table_is_named_with_its_remedy() {
    let cases = [
        (&b"\x89PNG\r\n\x1a\n"[..], "found a PNG image"),
        (b"\x89HDF\r\n\x1a\n", "save .mat by `save -v7`"),
        (&[7, 0, 1, 2], "a binary file of an unknown kind"),
        (b"[\n [1, 2], [3, 4]]", "a JSON text: export it as CSV"),
        (b"x;y\n1,234;2.5\n", "`1,234` beside decimal points"),
        (b"version https://git-lfs.github.com", "git lfs pull"),
        (
            b"Gauge: A\nGain 5\ndepth,force\n1,2\n3,4\n",
            "--skip-lines 2",
        ),
        (
            b"# x_mm, y_mm\n1,2,3\n4,5,6\n",
            "a heading of 3 columns, found the comment",
        ),
    ];
    for (bytes, words) in cases {
        let text = sentence(read_table(&file(bytes).path));
        assert!(text.contains(words), "{text} lacks {words}");
    }
}

/// The bytes contain this number of frames, followed by an error with these words.
fn breaks_off(bytes: &[u8], kept: usize, says: &str) {
    let (frames, broken) = frames_of(bytes);
    let sentence = broken.unwrap_or_default();
    assert_eq!(frames.len(), kept, "{says}: {sentence}");
    assert!(sentence.contains(says), "`{sentence}` lacks `{says}`");
}

#[test]
fn arrays_that_are_damaged_or_no_frames_are_refused() {
    let array = |header: &str| {
        let mut bytes = b"\x93NUMPY\x01\0".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes().chain(*b"abcdef"));
        bytes
    };
    let none = "expected an array of frames";
    for (kind, order, shape, kept, says) in [
        ("|u1", "False", "2, 3", 1, ""),
        ("|u1", "False", "1, 2, 3", 1, ""),
        ("<u2", "False", "1, 3", 1, ""),
        (
            "|u1",
            "True",
            "2, 1, 3",
            0,
            "C order (numpy.ascontiguousarray), found Fortran order",
        ),
        ("<f8", "False", "2, 1, 3", 0, none),
        ("|O", "False", "2, 1, 3", 0, none),
        ("|u1", "False", "0, 0", 0, none),
        ("|u1", "False", "65535, 65535", 0, none),
        ("|u1", "False", "9, 18446744073709551616, 3", 0, none),
        (
            "|u1",
            "False",
            "99, 2, 2",
            1,
            "4 bytes of samples, found the end after 2",
        ),
    ] {
        let order = format!("'fortran_order': {order}");
        let header = format!("{{'descr': '{kind}', {order}, 'shape': ({shape}), }}");
        breaks_off(&array(&header), kept, says);
    }
    breaks_off(&array(""), 0, none);
    breaks_off(b"PK\x03\x04", 0, "expected more bytes, found the end");
    let mut damaged = OF_OTHERS[3].to_vec();
    let level = damaged
        .windows(5)
        .rposition(|levels| levels == [134, 135, 136, 137, 138]);
    damaged[level.unwrap()] ^= 1;
    breaks_off(&damaged, 2, "its checksum differs");
}

#[test]
fn every_stream_gives_the_frames_that_went_in() {
    for bytes in OF_OTHERS {
        let name = bytes.escape_ascii();
        assert_eq!(frames_of(bytes), (three_frames(), None), "{name}");
    }
    for bytes in [
        video("mono", 1, 0),
        video("420jpeg", 1, 2),
        video("mono12", 2, 0),
        video("420p12", 2, 2),
        anymaps(),
        pages(true),
        pages(false),
    ] {
        let start = String::from_utf8_lossy(&bytes[..40]).into_owned();
        assert_eq!(frames_of(&bytes), (three_frames(), None), "{start}");
    }
}

/// Frames before the break are kept, and the error is one sentence.
#[test]
fn a_stream_may_break_anywhere() {
    for bytes in [
        video("420jpeg", 1, 2),
        video("mono12", 2, 0),
        anymaps(),
        pages(true),
        OF_OTHERS[0].to_vec(),
        OF_OTHERS[2].to_vec(),
        OF_OTHERS[3].to_vec(),
        OF_OTHERS[4].to_vec(),
    ] {
        for end in 0..bytes.len() {
            let (frames, broken) = frames_of(&bytes[..end]);
            assert_eq!(frames, three_frames()[..frames.len()]);
            let whole = bytes[..end].ends_with(b"\n") || frames.len() == 3;
            let sentence = broken.unwrap_or_default();
            assert!(
                !sentence.contains('\n') && sentence.len() < 300,
                "{sentence}"
            );
            assert!(whole || end < 10 || !sentence.is_empty() || is_between(&bytes, end));
        }
    }
}

/// Whether a frame of the stream ends at this byte.
fn is_between(bytes: &[u8], end: usize) -> bool {
    let rest = &bytes[end..];
    let starts = [&b"FRAME"[..], b"P5", b"\x93NUMPY"];
    starts.iter().any(|start| rest.starts_with(start)) || bytes.starts_with(b"II")
}

#[test]
fn what_is_no_stream_is_refused_in_a_sentence() {
    let pgm = "pipe, frame 1: expected the header of a PGM";
    for (text, says) in [
        ("", "pipe: expected a video or an image, found no bytes"),
        (
            "no stream at all",
            "found a text that begins with `no stream ",
        ),
        ("P5\n0 0\n255\n", pgm),
        ("P5\n3 1\n70000\nabc", pgm),
        ("P5\n3 1\n0\nabc", pgm),
        ("P5\n30000 2000\n255\nabc", "found the end after 3"),
        (
            "P6\n65535 65535\n255\n",
            "at most 64 million pixels, found P6",
        ),
    ] {
        breaks_off(text.as_bytes(), 0, says);
    }
    for (header, says) in [
        ("W0 H0", "found 0 × 0 pixels"),
        ("W65535 H65535", "found 65535 × 65535 pixels"),
        ("W30000 H30000", "found 30000 × 30000 pixels"),
        ("W-3 H1", "found `YUV4MPEG2 W-3 H1`"),
        ("W3", "found `"),
        ("W99999999999999999999 H1", "found `"),
        ("W3 H1 Cpalette", "the colour space `palette`"),
        ("W3 H1 Cmono99", "the colour space `mono99`"),
        (&"X".repeat(5000), "a first line of more than"),
        (
            "W3 H1 Cmono16",
            "frame 1: expected 6 bytes of samples, found the end after 3",
        ),
    ] {
        let text = format!("YUV4MPEG2 {header}\nFRAME\nabc");
        breaks_off(text.as_bytes(), 0, says);
    }
    breaks_off(b"II*\0\xff\xff\xff\x7f", 0, "cannot use the image pipe");
    let another_size = [&anymaps()[..], b"P5\n3 5\n255\n123456789012345"].concat();
    let says = "frame 4: expected 5 × 3 pixels as in the first, found 3 × 5";
    breaks_off(&another_size, 3, says);
    let lost = [&video("mono", 1, 0)[..], b"garbage"].concat();
    breaks_off(
        &lost,
        3,
        "frame 4: expected the word FRAME, found `garbage`",
    );
    let pam = b"P7\nWIDTH 2\nHEIGHT 1\nDEPTH 1\nMAXVAL 255\nENDHDR\nab";
    breaks_off(&pam.repeat(2), 0, "several: write binary PGM or PPM");
    breaks_off(b"--frame\r\n\r\n", 0, "at least one frame, found none");
    let animated = b"\x89PNG\r\n\x1a\n\0\0\0\x08acTL\0\0\0\x02\0\0\0\0\0\0\0\0";
    breaks_off(animated, 0, "it is an animation");
    // ImageJ states the frames of a large stack behind one directory.
    let mut stack = pages(true);
    stack.extend(b"ImageJ=1.53\nimages=9\n");
    breaks_off(&stack, 3, "expected 9 pages, as ImageJ states, found 3");
    let mut endless = pages(true);
    let last = endless.len() - 4;
    endless[last..].copy_from_slice(&23_u32.to_le_bytes());
    breaks_off(&endless, 3, "");
}
