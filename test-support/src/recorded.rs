//! Recorded answers of the tests' scenes, compared with those of an earlier state, in one format
//! for all crates.
//!
//! A record is a text file of lines `name: number number …`. It confirms a change that should not
//! affect any answer. After a change that should, write the records again with
//! `RECORD_ANSWERS=1 cargo test -p CRATE --test suite recorded`. The difference of the file shows
//! the effect, and the commit explains it.
use std::fmt::Write as _;

/// Answers of a crate's scenes, in the order of computation.
#[derive(Default)]
pub struct Answers {
    /// Name of each line, with its numbers.
    lines: Vec<(String, Vec<f64>)>,
}

impl Answers {
    pub fn add(&mut self, name: impl std::fmt::Display, numbers: impl IntoIterator<Item = f64>) {
        self.lines
            .push((name.to_string(), numbers.into_iter().collect()));
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for (name, numbers) in &self.lines {
            text.push_str(name);
            text.push(':');
            for number in numbers {
                write!(text, " {number:e}").expect("a string takes all");
            }
            text.push('\n');
        }
        text
    }

    /// Differences from a recorded text that exceed
    /// `tolerance(name, number, largest number of the line)`.
    pub fn differences(
        &self,
        record: &str,
        tolerance: impl Fn(&str, f64, f64) -> f64,
    ) -> Vec<String> {
        let mut differences = Vec::new();
        let recorded = record.lines().count();
        if recorded != self.lines.len() {
            let found = self.lines.len();
            differences.push(format!("{recorded} lines are recorded, {found} found"));
        }
        for (line, (name, numbers)) in record.lines().zip(&self.lines) {
            let (recorded_name, words) = line.rsplit_once(':').unwrap_or((line, ""));
            let recorded: Vec<f64> = words
                .split_whitespace()
                .map(|word| word.parse().expect("a number"))
                .collect();
            if recorded_name != name || recorded.len() != numbers.len() {
                let (before, now) = (recorded.len(), numbers.len());
                differences.push(format!(
                    "{recorded_name} ({before} numbers) is now {name} ({now} numbers)"
                ));
                continue;
            }
            let largest = recorded.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
            for (&before, &now) in recorded.iter().zip(numbers) {
                let allowed = tolerance(name, before, largest);
                if (before - now).abs() > allowed || before.is_nan() != now.is_nan() {
                    differences.push(format!("{name}: {before:e} is now {now:e}"));
                }
            }
        }
        differences
    }

    /// Compares with the record at `path`, or writes it if the environment requests it.
    pub fn check(&self, path: &str, tolerance: impl Fn(&str, f64, f64) -> f64) {
        if std::env::var_os("RECORD_ANSWERS").is_some() {
            std::fs::write(path, self.text()).expect("the record can be written");
            return;
        }
        let record = std::fs::read_to_string(path).expect("the record is committed");
        let differences = self.differences(&record, tolerance);
        assert!(differences.is_empty(), "{}", differences.join("\n"));
    }
}
