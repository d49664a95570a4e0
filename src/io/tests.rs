//! What the documentation and the properties of `tests/suite/io_properties` do not show.
use super::*;
use ::image::{ImageBuffer, ImageFormat, Luma};
use std::io::Cursor;
use std::path::PathBuf;

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

/// The sentence about a file after its name, or after its folder.
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
    assert!(message.ends_with("it is a folder, not a file"));
    // A file of holes takes no room on the disk.
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
        let [depth, force] = curve(&format!("time_s;{heading};force_mN\n0;3;7\n")).unwrap();
        assert_eq!(
            (depth[0], force[0]),
            (3.0 * factor, 7.0 * 1e-3),
            "{heading}"
        );
    }
    assert_eq!(
        curve("0.5;2\n").unwrap(),
        [vec![0.5], vec![2.0]],
        "by position"
    );
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

#[test]
fn errors_name_line_column_and_what_was_found() {
    for (text, end) in [
        (
            "depth,force\n1,2\n1,two\n",
            ", line 3, column 2: expected a finite number, found `two`",
        ),
        (
            "1,2\n\n# three\n3\n",
            ", line 4: expected 2 columns, found 1",
        ),
        (
            "1,2\r\n \r\n3,x\r\n",
            ", line 3, column 2: expected a finite number, found `x`",
        ),
        (
            "1,inf\n",
            ", line 1, column 2: expected a finite number, found `inf`",
        ),
        (
            "depth,force\n",
            ": expected at least one row of numbers, found none",
        ),
        ("1,2,3\n", ", line 1: expected 2 columns, found 3"),
        (
            "depth_m,load_kg\n1,2\n",
            ": expected a column named `force`, found `depth_m`, `load_kg`",
        ),
        (
            "depth_m,force_N,force_mN\n1,2,3\n",
            ": expected one column named `force`, found more than one",
        ),
        (
            "depth_m,force (lbf)\n1,2\n",
            ": expected the column `force` in N or a multiple of it, found `lbf`",
        ),
        (
            "depth_m,force_mm\n1,2\n",
            ": expected the column `force` in N or a multiple of it, found `mm`",
        ),
        // The largest number is 1.8e308: a finite number of kilonewtons need not be one of newtons.
        (
            "depth_m,force_kN\n1,-9e307\n",
            ": expected values of the column `force` that SI units can hold, found -9e307",
        ),
    ] {
        assert_eq!(sentence(curve(text)), end, "{text}");
    }
    let utf_16 = file([0xff, 0xfe, b'1', 0]);
    assert_eq!(
        sentence(read_table(&utf_16.path)),
        ": expected UTF-8 text, found UTF-16 text"
    );
}

#[test]
fn case_files_are_read_without_their_truth_and_errors_name_the_line() {
    let case = file("case a_1 2 1 2\nm 1 2\nt 3 4\nt 5 6\ng not read\np x\n# note\n");
    let cases = read_cases(&case.path).unwrap();
    assert!(matches!(&cases[0].points, CasePoints::Plane { target, .. } if target[1].y == 6.0));
    for (text, end) in [
        (
            "case a 2 1 1\nm 1 x\n",
            ", line 2, column 3: expected a finite number, found `x`",
        ),
        (
            "case a 2 2 0\nm 1 2\n",
            ", line 1: expected 2 rows tagged m, found 1",
        ),
        (
            "case a 4 0 0\n",
            ", line 1, column 3: expected dimension 2 or 3, found `4`",
        ),
        (
            "m 1 2\n",
            ", line 1, column 1: expected `case NAME D n_model n_target`, found `m`",
        ),
        ("", ": expected `case NAME D n_model n_target`, found none"),
    ] {
        assert_eq!(sentence(read_cases(&file(text).path)), end);
    }
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
    assert!(image.colour && image.bits == 8);
    // 255 times the weights, to rounding.
    for (level, weight) in image.levels.iter().zip(Grey::Rec601.weights()) {
        assert!((level - 255.0 * weight).abs() < 1e-12);
    }
    assert_eq!(image.to_u8().into_raw_vec_and_offset().0, [76, 150, 29]);
}

#[test]
fn sixteen_bits_keep_their_fraction() {
    let image = pnm("P5\n2 1\n65535\n", &[0x01, 0x00, 0xff, 0xff]);
    assert_eq!((image.bits, image.colour), (16, false));
    assert_eq!(image.levels.as_slice().unwrap(), [256.0 / 257.0, 255.0]);
}

/// A dark frame of 8 bits that another program saved in 16.
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
