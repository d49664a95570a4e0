//! Ctrl-C ends every long subcommand soon, with the results so far.
use super::harness::{folder_with_examples, tactile, text, words};
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Longest time from Ctrl-C to the end on a busy machine. Without Ctrl-C the work would take
/// minutes.
const SOON: Duration = Duration::from_secs(30);

/// Starts the program, sends it a signal (that of Ctrl-C is `-INT`) a moment after it has printed
/// some lines, and returns what it printed and its exit code.
fn ended_by(
    signal: &str,
    folder: &Path,
    arguments: &str,
    lines_before: usize,
) -> (String, Option<i32>) {
    let mut child = tactile(folder, &words(arguments))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut reader = BufReader::new(child.stdout.take().unwrap());
    let mut printed = String::new();
    for _ in 0..lines_before {
        assert!(
            reader.read_line(&mut printed).unwrap() > 0,
            "tactile {arguments}: {printed}"
        );
    }
    // The handler is installed before anything is printed. Without a line to wait for, the test
    // waits a moment.
    std::thread::sleep(Duration::from_millis(700));
    let sent = Instant::now();
    let id = child.id().to_string();
    assert!(
        Command::new("kill")
            .args([signal, &id])
            .status()
            .unwrap()
            .success()
    );
    reader.read_to_string(&mut printed).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(
        sent.elapsed() < SOON,
        "tactile {arguments} went on for {:?}",
        sent.elapsed()
    );
    let errors = text(&output.stderr);
    assert!(
        !errors.contains("panicked"),
        "tactile {arguments}: {errors}"
    );
    (printed, output.status.code())
}

/// Number of points whose match takes some seconds on a fast machine in the build of the tests,
/// longer than the delay before Ctrl-C. More than 30,000 points are refused because of the memory
/// limit.
const LARGE: usize = 24_000;

/// Angles of spirals in radians.
const TURN: f64 = 2.4;
const OTHER_TURN: f64 = 2.5;

/// A spiral of points, each rotated by this angle from the previous one. Spirals with different
/// angles do not match, so that a match takes long.
fn points(n: usize, turn: f64, row: &str) -> String {
    let point = |k: usize| {
        let angle = turn * k as f64;
        let radius = (k as f64).sqrt();
        format!(
            "{row}{},{}\n",
            radius * angle.cos(),
            1.1 * radius * angle.sin()
        )
    };
    (0..n).map(point).collect()
}

#[test]
fn matching_leaves_the_cases_that_are_done() {
    let folder = folder_with_examples();
    let rows = |n: usize, turn, kind: &str| points(n, turn, &format!("{kind} ")).replace(',', " ");
    let case = |name: &str, n: usize, turn| {
        let [model, target] = [rows(n, TURN, "m"), rows(n, turn, "t")];
        format!("case {name} 2 {n} {n}\n{model}{target}")
    };
    let cases = case("small", 40, TURN) + &case("large", LARGE, OTHER_TURN);
    fs::write(folder.path().join("both.txt"), cases).unwrap();
    let (printed, code) = ended_by("-INT", folder.path(), "match both.txt --out results", 1);
    assert_eq!(code, Some(130), "{printed}");
    assert!(printed.starts_with("small: 40 of 40"), "{printed}");
    let answers = fs::read_to_string(folder.path().join("results/both.txt")).unwrap();
    assert!(answers.contains("case small") && !answers.contains("case large"));
    // A partial result must not replace an earlier one, and no other file may remain.
    let results = folder.path().join("results");
    let before = fs::read_dir(&results).unwrap().count();
    fs::write(results.join("both.txt"), "complete").unwrap();
    for signal in ["-INT", "-TERM", "-HUP"] {
        let (_, code) = ended_by(signal, folder.path(), "match both.txt --out results", 1);
        assert_eq!(code, Some(130), "{signal}");
        let kept = fs::read_to_string(results.join("both.txt")).unwrap();
        assert_eq!(kept, "complete", "{signal}");
        assert_eq!(fs::read_dir(&results).unwrap().count(), before, "{signal}");
    }
}

#[test]
fn a_stream_ends_with_what_it_has_measured() {
    let folder = folder_with_examples();
    let call = "stream --rate 20 --period 60 --allowed-late 100 --out results";
    // The simulation of frames is interrupted, so that no frames are played.
    let (printed, code) = ended_by("-INT", folder.path(), call, 0);
    assert_eq!(code, Some(130), "{printed}");
}

#[test]
fn work_that_has_nothing_yet_ends_at_once() {
    let folder = folder_with_examples();
    for (name, turn) in [("many.csv", TURN), ("others.csv", OTHER_TURN)] {
        let table = "x,y\n".to_owned() + &points(LARGE, turn, "");
        fs::write(folder.path().join(name), table).unwrap();
    }
    for (call, lines) in [
        ("strain many.csv others.csv --out results", 0),
        // The interrupt arrives while the points are being ordered.
        ("warp many.csv many.csv many.csv --out results", 0),
        ("light --rays 9000000", 1),
        ("measure --repeat 4000", 0),
    ] {
        let (printed, code) = ended_by("-INT", folder.path(), call, lines);
        assert_eq!(code, Some(130), "tactile {call}: {printed}");
    }
    assert!(!folder.path().join("results").exists());
}
