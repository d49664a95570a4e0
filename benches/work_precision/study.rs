//! A study: settings of one stage on one problem, each with its time and its error.

use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

/// Duration of the timing of each setting.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effort {
    Once,
    Quick,
    Full,
}

/// Differences below this are due to rounding.
const ROUNDING: f64 = 1e-14;

/// Times or errors of settings that differ by less than this factor count as equal: times of one
/// job scatter by as much.
const AS_GOOD: f64 = 0.98;

pub(crate) struct Entry {
    pub(crate) knob: &'static str,
    pub(crate) setting: String,
    pub(crate) is_default: bool,
    pub(crate) seconds: f64,
    pub(crate) error: f64,
}

pub(crate) struct Study {
    pub(crate) name: &'static str,
    pub(crate) error_label: &'static str,
    pub(crate) entries: Vec<Entry>,
    pub(crate) effort: Effort,
}

impl Study {
    pub(crate) fn new(name: &'static str, effort: Effort) -> Self {
        Self {
            name,
            error_label: "error",
            entries: Vec::new(),
            effort,
        }
    }

    /// `quick` or `full`, according to the effort.
    pub(crate) fn choose<T>(&self, quick: T, full: T) -> T {
        if self.effort == Effort::Full {
            full
        } else {
            quick
        }
    }

    /// Times a job (the shortest of many runs) and computes the error of its result. The default
    /// setting must be marked as such.
    pub(crate) fn run<R>(
        &mut self,
        knob: &'static str,
        setting: impl ToString,
        is_default: bool,
        mut job: impl FnMut() -> R,
        error: impl FnOnce(&R) -> f64,
    ) {
        let budget = match self.effort {
            Effort::Once => Duration::ZERO,
            Effort::Quick => Duration::from_millis(150),
            Effort::Full => Duration::from_millis(1500),
        };
        let (begin, mut seconds) = (Instant::now(), f64::INFINITY);
        let answer = loop {
            let start = Instant::now();
            let answer = std::hint::black_box(job());
            seconds = seconds.min(start.elapsed().as_secs_f64());
            if begin.elapsed() >= budget {
                break answer;
            }
        };
        let error = error(&answer).max(ROUNDING);
        assert!(
            error.is_finite(),
            "{}: {knob} {} has no error",
            self.name,
            setting.to_string()
        );
        self.entries.push(Entry {
            knob,
            setting: setting.to_string(),
            is_default,
            seconds,
            error,
        });
    }

    /// Distance of a setting from the front, as the larger of two factors: the speed-up by a
    /// setting that is no less accurate, and the gain in accuracy by a setting that is no slower.
    /// It is one on the front.
    pub(crate) fn behind(&self, entry: &Entry) -> f64 {
        let factor = |other: &Entry| {
            let (faster, better) = (entry.seconds / other.seconds, entry.error / other.error);
            let in_time = if better >= AS_GOOD { faster } else { 1.0 };
            let in_error = if faster >= AS_GOOD { better } else { 1.0 };
            in_time.max(in_error)
        };
        self.entries.iter().map(factor).fold(1.0, f64::max)
    }

    /// Prints the table. Returns the number of defaults whose distance from the front exceeds
    /// `within`.
    pub(crate) fn judge(&self, within: f64) -> usize {
        println!("\n{} ({})", self.name, self.error_label);
        println!(
            "  {:<16} {:<28} {:>13} {:>10} {:>6} verdict",
            "option", "setting", "time", "error", "behind"
        );
        let mut failures = 0;
        for e in &self.entries {
            let behind = self.behind(e);
            let verdict = match (e.is_default, behind <= within) {
                (true, true) => "default",
                (true, false) => "DEFAULT BEHIND THE FRONT",
                _ => "",
            };
            failures += usize::from(e.is_default && behind > within);
            let time = 1e3 * e.seconds;
            println!(
                "  {:<16} {:<28} {time:>10.4} ms {:>10.2e} {behind:>6.2} {verdict}",
                e.knob, e.setting, e.error
            );
        }
        failures
    }

    pub(crate) fn write_csv(&self, path: &Path) -> std::io::Result<()> {
        let mut file = std::fs::File::create(path)?;
        writeln!(
            file,
            "study,knob,setting,default,seconds,error,behind_front"
        )?;
        for e in &self.entries {
            let behind = self.behind(e);
            writeln!(
                file,
                "{},{},\"{}\",{},{:e},{:e},{behind:.3}",
                self.name, e.knob, e.setting, e.is_default, e.seconds, e.error
            )?;
        }
        Ok(())
    }
}
