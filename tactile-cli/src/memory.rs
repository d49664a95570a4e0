//! The memory that a job will need, before it starts.
use crate::failure::Failure;

/// The most that a job may take.
#[derive(Clone, Copy)]
pub struct Memory {
    bytes: f64,
}

impl Memory {
    pub fn of_gigabytes(gigabytes: f64) -> Self {
        Self {
            bytes: gigabytes * 1e9,
        }
    }

    /// Refuses a job that needs more; `job` names it and its size, `remedy` says what to do.
    pub fn allow(self, bytes: f64, job: &str, remedy: &str) -> Result<(), Failure> {
        if bytes <= self.bytes {
            return Ok(());
        }
        Err(Failure::input(format!(
            "{job} needs about {}, more than the {} allowed: {remedy}, or allow more with --memory-gb",
            size(bytes),
            size(self.bytes)
        )))
    }
}

fn size(bytes: f64) -> String {
    let (scale, unit) = match bytes {
        b if b >= 1e12 => (1e-12, "TB"),
        b if b >= 1e9 => (1e-9, "GB"),
        _ => (1e-6, "MB"),
    };
    format!("{:.1} {unit}", bytes * scale)
}
