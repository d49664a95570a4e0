//! What a person at a bench wants to read.
use super::digits::{estimate, with_error};
use super::error::PipelineError;
use super::flag::Flag;
use super::measurement::{FrameResult, MatchResult, Measurement, ModulusResult, StrainResult};
use crate::matching::StopReason;
use std::fmt::{self, Display, Formatter};

impl Display for ModulusResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let k = |v: f64| v * 1e-3;
        write!(
            f,
            "{} kPa",
            with_error(self.value, self.standard_error, 1e-3)
        )?;
        match self.interval_95 {
            (low, Some(high)) => write!(f, "   95 %: {:.2} to {:.2} kPa", k(low), k(high))?,
            (low, None) if low > 0.0 => write!(f, "   95 %: above {:.2} kPa", k(low))?,
            (_, None) => f.write_str("   no interval: the errors are not known")?,
        }
        write!(f, "   ({})", self.estimator)
    }
}

impl Display for FrameResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.force_n {
            Ok(force) => write!(f, "force {} N", estimate(force, 1.0))?,
            Err(_) => f.write_str("force unknown")?,
        }
        let radius = self.contact_radius_m;
        if let Some(gauge) = self.gauge_force_n {
            write!(f, " (gauge {gauge:.4} N)")?;
        }
        write!(f, "   contact radius {} mm", estimate(radius, 1e3))?;
        if let Some(ratio) = self.contact_ratio {
            write!(f, "   a/R {ratio:.3}")?;
        }
        let [x, y] = self.centroid_px;
        write!(f, "   centroid ({x:.2}, {y:.2}) px")?;
        match self.mean_stress_pa {
            Some(stress) => write!(f, "   mean stress {} kPa", estimate(stress, 1e-3)),
            None => Ok(()),
        }
    }
}

impl Display for MatchResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} control points matched, residual {:.1} µm, mean displacement {:.1} µm, {} after {} iterations",
            self.matched,
            self.points,
            self.residual_m * 1e6,
            self.mean_displacement_m * 1e6,
            stop_text(self.stop),
            self.iterations
        )
    }
}

impl Display for StrainResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // The strain between equal frames is zero to rounding: digits beyond the sixth are never known.
        let error = |i: usize, j: usize| self.standard_error[i][j].max(1e-6);
        let e = |i: usize, j: usize| with_error(self.mean[i][j], error(i, j), 1.0);
        write!(
            f,
            "{}: e_xx {}  e_yy {}  e_zz {}",
            self.measure,
            e(0, 0),
            e(1, 1),
            e(2, 2)
        )
    }
}

/// Cautions of one kind that are printed; of a press with thousands of frames each may carry the same one.
const PRINTED_OF_A_KIND: usize = 3;

/// The first cautions of every kind, and how many more there are.
fn cautions(f: &mut Formatter<'_>, flags: &[Flag]) -> fmt::Result {
    let kind = |flag: &Flag| {
        let warning = match flag {
            Flag::Assumption { warning } => Some(std::mem::discriminant(warning)),
            _ => None,
        };
        (std::mem::discriminant(flag), warning)
    };
    let mut printed = Vec::new();
    for flag in flags {
        if printed.contains(&kind(flag)) {
            continue;
        }
        printed.push(kind(flag));
        let alike = || flags.iter().filter(|other| kind(other) == kind(flag));
        for flag in alike().take(PRINTED_OF_A_KIND) {
            writeln!(f, "  {flag}")?;
        }
        let more = alike().count().saturating_sub(PRINTED_OF_A_KIND);
        if more > 0 {
            writeln!(f, "  … and {more} more like it")?;
        }
    }
    Ok(())
}

/// A result under its heading, or why there is none.
fn line<T: Display>(
    f: &mut Formatter<'_>,
    heading: &str,
    result: &Result<T, PipelineError>,
) -> fmt::Result {
    match result {
        Ok(value) => writeln!(f, "{heading:<16} {value}"),
        Err(error) => writeln!(f, "{heading:<16} none: {error}"),
    }
}

fn stop_text(stop: StopReason) -> &'static str {
    match stop {
        StopReason::Converged => "converged",
        StopReason::Exact => "exact",
        StopReason::IterationLimit => "not converged",
        StopReason::Cancelled => "stopped by the caller",
        StopReason::Degenerate => "degenerate",
        _ => "stopped",
    }
}

impl Display for Measurement {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        line(f, "Young's modulus", &self.youngs_modulus_pa)?;
        if let Some(time) = &self.time {
            writeln!(f, "{:<16} {time}", "over time")?;
        }
        for (i, frame) in self.frames.iter().enumerate() {
            line(f, &format!("frame {}", i + 1), frame)?;
        }
        line(f, "match", &self.matching)?;
        line(f, "strain", &self.strain)?;
        if !self.estimators.is_empty() {
            writeln!(f, "all estimators:")?;
        }
        for estimate in &self.estimators {
            writeln!(f, "  {estimate}")?;
        }
        if !self.flags.is_empty() {
            writeln!(f, "cautions:")?;
            cautions(f, &self.flags)?;
        }
        Ok(())
    }
}
