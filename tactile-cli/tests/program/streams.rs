//! Frames from a pipe.
use super::harness::{folder_with_examples, printed, tactile, text, value, words};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Output, Stdio};
use tactile_files::io::{Grey, read_grey_image};

const SCENE: &str = "examples/data/press/scene.toml";
const CALIBRATED: &str = "--reference examples/data/press/reference.png --pairs \
                          examples/data/press/calibration.csv --pixel-um 40 --json";

/// Runs the program with these bytes as its standard input.
pub(crate) fn piped(folder: &Path, call: &str, bytes: &[u8]) -> Output {
    let mut command = tactile(folder, &words(call));
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    let bytes = bytes.to_vec();
    // The program may end before it has read all input.
    let writer = std::thread::spawn(move || drop(input.write_all(&bytes)));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    output
}

/// The two frames of the examples as a video of 80 Hz.
fn video(folder: &Path) -> Vec<u8> {
    let mut bytes = b"YUV4MPEG2 W174 H130 F80:1 Cmono\n".to_vec();
    for k in 1..3 {
        let path = folder.join(format!("examples/data/press/frame_{k}.png"));
        bytes.extend(b"FRAME\n");
        bytes.extend(
            read_grey_image(path, Grey::default(), None)
                .unwrap()
                .to_u8(),
        );
    }
    bytes
}

#[test]
fn a_pipe_gives_the_answers_of_the_files() {
    let folder = folder_with_examples();
    let video = video(folder.path());
    let both = "examples/data/press/frame_1.png examples/data/press/frame_2.png";
    for (call, from_files, answer) in [
        (
            format!("stream {SCENE} --json --allowed-late 100"),
            "",
            "/updates",
        ),
        (format!("measure {SCENE} --json"), "", "/youngs_modulus_pa"),
        (format!("force {CALIBRATED}"), both, "/frames/1/contact"),
    ] {
        let piped = value(&piped(folder.path(), &format!("{call} -"), &video));
        let files = tactile(folder.path(), &words(&format!("{call} {from_files}")));
        let files = value(&{ files }.output().unwrap());
        assert!(files.pointer(answer).is_some(), "{call}");
        assert_eq!(piped.pointer(answer), files.pointer(answer), "{call}");
    }
}

#[test]
fn a_broken_pipe_keeps_what_was_measured() {
    let folder = folder_with_examples();
    let whole = video(folder.path());
    let cut = &whole[..whole.len() - 9];
    for (call, frames) in [
        (
            format!("stream {SCENE} - --json --allowed-late 100"),
            "/updates",
        ),
        (format!("measure {SCENE} - --json"), "/frames"),
        (format!("force {CALIBRATED} -"), "/frames"),
    ] {
        let output = piped(folder.path(), &call, cut);
        let errors = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{call}: {errors}");
        let first = errors.lines().next().unwrap_or_default();
        let says = "tactile: standard input, frame 2: expected 22620 bytes of samples, found the \
                    end after 22611";
        assert_eq!(first, says, "{call}");
        let value = value(&output);
        let kept = value.pointer(frames).and_then(Value::as_array).unwrap();
        assert_eq!(kept.len(), 1, "{call}");
        // Empty input, and frames of another size than the reference, cannot be used.
        for bytes in [&b""[..], b"P5\n2 1\n255\nab"] {
            let output = piped(folder.path(), &call, bytes);
            assert_eq!(output.status.code(), Some(2), "{call}");
            assert!(output.stdout.is_empty(), "{call}");
        }
    }
}

#[test]
fn a_recording_is_measured_to_the_same_bits() {
    let folder = folder_with_examples();
    let live = format!("stream {SCENE} - --record kept.y4m --json --allowed-late 100");
    let first = piped(folder.path(), &live, &video(folder.path()));
    let again = |name: &str| {
        let call = format!("stream {SCENE} {name} --json --allowed-late 100");
        tactile(folder.path(), &words(&call)).output().unwrap()
    };
    let replayed = again("kept.y4m");
    // The output has a line of JSON for every frame, and the last line is the whole result.
    let printed = text(&replayed.stdout);
    let lines = printed
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap());
    let lines: Vec<Value> = lines.collect();
    assert_eq!(lines.len(), 3, "{printed}");
    assert_eq!(
        (&lines[1]["frame"], &lines[2]["frames"]),
        (&2.into(), &2.into())
    );
    assert_eq!(value(&replayed)["updates"], value(&first)["updates"]);
    let answers = std::fs::read_to_string(folder.path().join("kept.csv")).unwrap();
    assert_eq!(answers.lines().count(), 3, "{answers}");
    // These files remain if a run is killed in its second frame.
    let bytes = std::fs::read(folder.path().join("kept.y4m")).unwrap();
    std::fs::write(
        folder.path().join("killed.y4m"),
        &bytes[..bytes.len() - 999],
    )
    .unwrap();
    let killed = value(&again("killed.y4m"));
    assert_eq!(killed["updates"][0], value(&first)["updates"][0]);
    // A recording does not replace an existing file.
    let refused = piped(folder.path(), &live, &video(folder.path()));
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused.stderr));
}

#[test]
fn a_report_is_one_page_that_changes_with_the_data_only() {
    let folder = folder_with_examples();
    let call = format!("measure {SCENE} --report page.html");
    let page = || {
        printed(folder.path(), &call);
        std::fs::read_to_string(folder.path().join("page.html")).unwrap()
    };
    let first = page();
    assert_eq!(first, page());
    for part in [
        "</head>\n<body>\n<h1>",
        "Young&#39;s modulus",
        "<svg",
        "Cautions",
        "taken as exact",
        "frame_2.png",
        &call,
    ] {
        assert!(first.contains(part), "the page lacks {part}");
    }
    // The page loads nothing, and runs only the script that rotates the surface.
    assert_eq!(first.matches("<script").count(), 1);
    assert!(first.contains("script-src 'sha256-") && first.contains("data-relief="));
    for part in ["src=\"http", "url(", "@import", "<link", "<iframe"] {
        assert!(!first.contains(part), "the page has {part}");
    }
    assert!(first.len() < 3_000_000, "{} bytes", first.len());
    let input = "examples/data/press/reference.png";
    let call = format!("measure {SCENE} --report {input}");
    let refused = tactile(folder.path(), &words(&call)).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("would replace the input"));
}

#[test]
fn browsers_of_this_computer_see_the_stream() {
    let folder = folder_with_examples();
    let call = "stream --rate 20 --period 1 --cycles 2 --allowed-late 100 --serve 127.0.0.1:0";
    let mut command = tactile(folder.path(), &words(call));
    let piped = command.stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = piped.spawn().unwrap();
    let mut line = String::new();
    let mut errors = BufReader::new(child.stderr.take().unwrap());
    errors.read_line(&mut line).unwrap();
    let url = line
        .trim()
        .split("http://")
        .nth(1)
        .unwrap_or_else(|| panic!("{line}"));
    let address = url.trim_end_matches('/').to_owned();
    let get = |path: &str, host: &str| {
        let mut stream = TcpStream::connect(&address).unwrap();
        let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    };
    let page = get("/", &address);
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("default-src 'none'"));
    assert!(get("/", "evil.example").starts_with("HTTP/1.1 403"));
    assert!(get("/../../etc/passwd", &address).starts_with("HTTP/1.1 404"));
    let events = get("/events", &address);
    assert!(
        ["data: {", "\"levels\":", "\"relief\":{"]
            .iter()
            .all(|part| events.contains(part)),
        "{events:.300}"
    );
    assert!(events.contains("event: end"));
    assert!(child.wait().unwrap().success());
}

/// A TIFF with one strip whose header states a size, without samples.
fn empty_tiff(columns: u32, rows: u32) -> Vec<u8> {
    let entries = [
        (256, columns),
        (257, rows),
        (258, 8),
        (259, 1),
        (262, 1),
        (273, 8),
        (278, rows),
        (279, columns.saturating_mul(rows)),
    ];
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, value) in entries {
        bytes.extend((tag as u16).to_le_bytes());
        bytes.extend(b"\x04\0\x01\0\0\0");
        bytes.extend(u32::to_le_bytes(value));
    }
    bytes.extend([0; 4]);
    bytes
}

/// The header of a byte array with this shape.
fn empty_npy(shape: &str) -> Vec<u8> {
    let mut header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}, }}");
    while (10 + header.len()) % 64 != 63 {
        header.push(' ');
    }
    header.push('\n');
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\0", &length[..], header.as_bytes()].concat()
}

/// The error output of a run.
fn sentences(output: &Output) -> usize {
    let errors = text(&output.stderr);
    errors
        .lines()
        .filter(|line| line.starts_with("tactile: "))
        .count()
}

#[test]
fn what_is_no_stream_is_refused_in_one_sentence() {
    let folder = folder_with_examples();
    // The tests of the readers cover other faults, and `bad_calls` covers damaged images.
    let frame = [b"FRAME\n", &video(folder.path())[..174 * 130]].concat();
    let piped_cases = [
        "YUV4MPEG2 W-174 H130 F80:1 Cmono\n",
        "YUV4MPEG2 W4294967295 H4294967295 F80:1 Cmono\n",
        "YUV4MPEG2 W174 H130 F80:1 Cmono",
        "P5\n65535 65535\n255\n",
        "P9\n174 130\n255\n",
        "\u{89}PNG\r\n",
    ];
    let run = |case: &str, call: &str, bytes: &[u8]| {
        let output = piped(folder.path(), &format!("force {CALIBRATED} {call}"), bytes);
        let case = format!("{case}: {}", text(&output.stderr));
        assert_eq!(output.status.code(), Some(2), "{case}");
        assert_eq!(sentences(&output), 1, "{case}");
        assert!(output.stdout.is_empty(), "{case}");
    };
    for header in piped_cases {
        run(header, "-", &[header.as_bytes(), &frame].concat());
    }
    let files = [
        ("no_sample.tiff", empty_tiff(174, 130)),
        ("nothing.tiff", empty_tiff(0, 0)),
        ("huge.tiff", empty_tiff(65_535, 65_535)),
        ("five.npy", empty_npy("(1, 2, 3, 4, 5)")),
        (
            "no_video.avi",
            b"RIFF\xff\xff\xff\xffAVI LIST\xff\xff\xff\xff".to_vec(),
        ),
    ];
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        run(name, name, b"");
    }
}
