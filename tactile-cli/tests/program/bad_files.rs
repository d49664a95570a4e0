//! Files that no reader accepts.
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

/// Writes invalid files of every kind to the folder. Returns the names of files that are not
/// images, and of files that are not tables.
pub(crate) fn write(folder: &Path) -> (Vec<&'static str>, Vec<&'static str>) {
    let put = |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).unwrap();
    let image = fs::read(folder.join("reference.png")).unwrap();
    put("empty", b"");
    put(
        "garbage",
        &[0x80, 0, 0xff, 0xfe, 7, 9, 200, 3, 1, 0, 0, 255].repeat(40),
    );
    put(
        "utf16.csv",
        &[0xff, 0xfe, b'x', 0, b',', 0, b'y', 0, b'\n', 0],
    );
    put("half.png", &image[..image.len() / 2]);
    let mut wrong = image.clone();
    let middle = wrong.len() / 2;
    wrong[middle..middle + 8].fill(0x55);
    put("crc.png", &wrong);
    // One header announces 30,000 × 30,000 pixels, another an impossible size.
    put("bomb.pgm", b"P5\n30000 30000\n255\n");
    put("bomb_text.pgm", b"P2\n4000000000 4000000000\n255\n1 2 3\n");
    // The signature of a PNG and its first chunk with the checksum, for 60,000 × 60,000 pixels.
    put(
        "bomb.png",
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\xea\x60\0\0\xea\x60\x08\0\0\0\0\xa5\xb9\x2a\x9e",
    );
    put("negative.pgm", b"P5\n-3 4\n255\nabc");
    put("none.pgm", b"P5\n0 0\n255\n");
    put(
        "half.jpg",
        &[0xff, 0xd8, 0xff, 0xe0, 0, 16, b'J', b'F', b'I', b'F', 0],
    );
    put("words.csv", b"x,y\none,two\n");
    put("ragged.csv", b"1,2\n3,4\n5\n");
    put("infinite.csv", b"1,2\ninf,4\n");
    put("header.csv", b"x,y\n");
    put("unit.csv", b"x (furlong),y (furlong)\n1,2\n3,4\n5,6\n");
    put("wide.csv", "1,".repeat(200_000).as_bytes());
    let huge = fs::File::create(folder.join("huge")).unwrap();
    huge.set_len(20 << 30).unwrap();
    fs::create_dir(folder.join("folder")).unwrap();
    symlink("loop_b", folder.join("loop_a")).unwrap();
    symlink("loop_a", folder.join("loop_b")).unwrap();
    symlink("nowhere", folder.join("dangling")).unwrap();
    let made = Command::new("mkfifo").arg(folder.join("pipe")).status();
    assert!(made.unwrap().success());
    let no_file = [
        "empty",
        "garbage",
        "huge",
        "folder",
        "loop_a",
        "dangling",
        "pipe",
        "absent",
        "/dev/zero",
    ];
    let images = [
        "half.png",
        "crc.png",
        "bomb.pgm",
        "bomb_text.pgm",
        "bomb.png",
        "negative.pgm",
        "none.pgm",
        "half.jpg",
        "words.csv",
    ];
    let tables = [
        "utf16.csv",
        "words.csv",
        "ragged.csv",
        "infinite.csv",
        "header.csv",
        "unit.csv",
        "wide.csv",
        "half.png",
    ];
    (
        [&no_file[..], &images].concat(),
        [&no_file[..], &tables].concat(),
    )
}
