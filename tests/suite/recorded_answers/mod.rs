//! The numbers of small simulated scenes, compared with those recorded in `tests/suite/recorded_answers/answers.txt`.
//!
//! A change that is meant to leave every answer as it is shows that here. A change that is meant to move answers records them
//! anew: `TACTILE_RECORD=1 cargo test --test suite recorded_answers`, and the difference of the text file says what moved.

mod scenes;

use std::fmt::Write as _;
use std::path::Path;

/// Largest difference from a recorded number, relative to the largest number of its line: sums taken in another order differ by some
/// thousand roundings of 1e-16; anything else moves a number by far more.
const TOLERANCE: f64 = 1e-12;

/// One line: what the numbers are, then the numbers.
struct Answer {
    name: String,
    numbers: Vec<f64>,
}

/// Answers under the name of a scene.
struct Answers {
    scene: &'static str,
    all: Vec<Answer>,
}

impl Answers {
    fn of(scene: &'static str) -> Self {
        Self {
            scene,
            all: Vec::new(),
        }
    }

    fn add(&mut self, name: impl std::fmt::Display, numbers: impl IntoIterator<Item = f64>) {
        self.all.push(Answer {
            name: format!("{}/{name}", self.scene),
            numbers: numbers.into_iter().collect(),
        });
    }
}

fn text_of(answers: &[Answer]) -> String {
    let mut text = String::new();
    for answer in answers {
        text.push_str(&answer.name);
        text.push(':');
        for number in &answer.numbers {
            write!(text, " {number:e}").expect("a string takes all");
        }
        text.push('\n');
    }
    text
}

/// What differs between a recorded line and an answer; `None` where nothing does.
fn difference(recorded: &str, answer: &Answer) -> Option<String> {
    let (name, numbers) = recorded.split_once(':').unwrap_or((recorded, ""));
    let numbers: Vec<f64> = numbers
        .split_whitespace()
        .map(|word| word.parse().expect("a number"))
        .collect();
    if name != answer.name || numbers.len() != answer.numbers.len() {
        let (expected, found) = (numbers.len(), answer.numbers.len());
        return Some(format!(
            "{name} ({expected} numbers) is now {} ({found} numbers)",
            answer.name
        ));
    }
    let largest = numbers.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let apart =
        |(a, b): (&f64, &f64)| (a - b).abs() > TOLERANCE * largest && a.to_bits() != b.to_bits();
    let worst = numbers
        .iter()
        .zip(&answer.numbers)
        .find(|pair| apart(*pair))?;
    Some(format!("{name}: {:e} is now {:e}", worst.0, worst.1))
}

#[test]
fn answers_are_those_recorded() {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/recorded_answers/answers.txt");
    let answers = scenes::all();
    if std::env::var_os("TACTILE_RECORD").is_some() {
        std::fs::write(&file, text_of(&answers)).expect("the file can be written");
        return;
    }
    let recorded = std::fs::read_to_string(&file).expect("the recorded answers");
    let mut differences: Vec<_> = recorded
        .lines()
        .zip(&answers)
        .filter_map(|(line, answer)| difference(line, answer))
        .collect();
    if recorded.lines().count() != answers.len() {
        differences.push(format!(
            "{} lines are recorded, {} found",
            recorded.lines().count(),
            answers.len()
        ));
    }
    assert!(differences.is_empty(), "{}", differences.join("\n"));
}

#[test]
fn a_number_that_moves_by_more_than_rounding_is_seen() {
    let answer = |last: f64| Answer {
        name: "scene/mean force".into(),
        numbers: vec![2.0, last],
    };
    assert!(difference("scene/mean force: 2e0 5e-1", &answer(0.5 + 1e-12)).is_none());
    for line in [
        "scene/mean force: 2e0 5e-1",
        "scene/radius: 2e0 5.1e-1",
        "scene/mean force: 2e0",
    ] {
        assert!(difference(line, &answer(0.51)).is_some(), "{line}");
    }
}
