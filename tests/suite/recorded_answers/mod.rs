//! The results of small simulated scenes, compared with those recorded in
//! `tests/suite/recorded_answers/answers.txt`.
//!
//! A change that is not meant to change results must pass this test. After a change that is meant
//! to change them, record them again with
//! `RECORD_ANSWERS=1 cargo test --test suite recorded_answers`. The difference of the text file
//! shows the changed results.

mod readings;
mod scenes;

/// Largest difference from a recorded number, relative to the largest number of its line. Sums in
/// another order differ by some thousand roundings of 1e-16. Other causes change a number by far
/// more.
const TOLERANCE: f64 = 1e-12;

/// The tolerance for strains and results that depend on them. Processors with wider SIMD registers
/// sum in another order, and λ, the minimum of a flat score, is accurate to the square root of
/// rounding: strains with AVX-512 and with AVX2 differ by up to 4e-10.
const STRAIN_TOLERANCE: f64 = 1e-8;

/// Results, by the name of their scene.
#[derive(Default)]
struct Answers {
    scene: &'static str,
    record: test_support::Answers,
}

impl Answers {
    fn add(&mut self, name: impl std::fmt::Display, numbers: impl IntoIterator<Item = f64>) {
        self.record.add(format!("{}/{name}", self.scene), numbers);
    }
}

fn tolerance(name: &str, _recorded: f64, largest: f64) -> f64 {
    let of_strain = name.contains("strain") || name.contains("paper-ratio");
    let relative = if of_strain {
        STRAIN_TOLERANCE
    } else {
        TOLERANCE
    };
    // For two points and two constants, the residual is only the square of a rounding error.
    let floor = if name.ends_with("chi squared") {
        1e-20
    } else {
        0.0
    };
    (relative * largest).max(floor)
}

#[test]
fn answers_are_those_recorded() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/suite/recorded_answers");
    let mut answers = Answers::default();
    scenes::all(&mut answers);
    answers
        .record
        .check(&format!("{folder}/answers.txt"), tolerance);
}

#[test]
fn a_number_that_moves_by_more_than_rounding_is_seen() {
    let differences = |line: &str, last: f64| {
        let mut record = test_support::Answers::default();
        record.add("scene/mean force", [2.0, last]);
        record.differences(line, tolerance).len()
    };
    let line = "scene/mean force: 2e0 5e-1";
    assert_eq!(differences(line, 0.5 + 1e-12), 0);
    for line in [
        line,
        "scene/radius: 2e0 5.1e-1",
        "scene/mean force: 2e0",
        "",
    ] {
        assert_eq!(differences(line, 0.51), 1, "{line}");
    }
}
