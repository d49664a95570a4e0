//! Worst error relative to rounding times condition number, one row per check.

/// The rows of one crate.
pub struct Worst {
    heading: &'static str,
    rows: Vec<(String, f64, f64)>,
}

impl Worst {
    pub fn new(heading: &'static str) -> Self {
        Self {
            heading,
            rows: Vec::new(),
        }
    }

    /// Enters an error in units of ε·cond. `bound` is the limit of the check. NaN is kept.
    pub fn enter(&mut self, check: &str, units: f64, bound: f64) {
        match self.rows.iter_mut().find(|row| row.0 == check) {
            Some(row) if row.1.is_nan() || units <= row.1 => {}
            Some(row) => (row.1, row.2) = (units, bound),
            None => self.rows.push((check.to_owned(), units, bound)),
        }
    }

    /// Prints the table, and fails if a row is above its bound or NaN.
    pub fn finish(self) {
        println!(
            "{}: worst error / (epsilon * condition)\n  {:<48} {:>10} {:>10}",
            self.heading, "check", "worst", "allowed"
        );
        for (check, units, bound) in &self.rows {
            println!("  {check:<48} {units:>10.3} {bound:>10.1}");
        }
        let bad: Vec<_> = self
            .rows
            .iter()
            .filter(|(_, units, bound)| !matches!(units.partial_cmp(bound), Some(o) if o.is_le()))
            .collect();
        assert!(bad.is_empty(), "{}: {bad:?}", self.heading);
    }
}

/// The cases of a file of `tests/reference`, written by `evidence/reference_cases.py`.
pub fn cases(text: &str) -> Vec<serde_json::Value> {
    serde_json::from_str(text).expect("the file is JSON")
}

pub fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value
        .as_array()
        .expect("an array")
        .iter()
        .map(|v| v.as_f64().expect("a number"))
        .collect()
}

pub fn rows(value: &serde_json::Value) -> Vec<Vec<f64>> {
    value
        .as_array()
        .expect("rows")
        .iter()
        .map(numbers)
        .collect()
}
