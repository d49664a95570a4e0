//! What a person at a bench wants to read.
use super::measurement::{FrameResult, MatchResult, Measurement, ModulusResult, StrainResult};
use std::fmt::{self, Display, Formatter};

impl Display for ModulusResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let k = |v: f64| v * 1e-3;
        write!(f, "{:8.2} ± {:.2} kPa", k(self.value), k(self.standard_error))?;
        match self.interval_95 {
            (low, Some(high)) => write!(f, "   95 %: {:.2} to {:.2} kPa", k(low), k(high))?,
            (low, None) => write!(f, "   95 %: above {:.2} kPa", k(low))?,
        }
        write!(f, "   ({})", self.estimator)
    }
}

impl Display for FrameResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (force, radius) = (self.force_n, self.contact_radius_m);
        write!(f, "force {:.4} ± {:.4} N", force.value, force.standard_error)?;
        if let Some(gauge) = self.gauge_force_n {
            write!(f, " (gauge {gauge:.4} N)")?;
        }
        write!(f, "   contact radius {:.4} ± {:.4} mm", radius.value * 1e3, radius.standard_error * 1e3)?;
        if let Some(ratio) = self.contact_ratio {
            write!(f, "   a/R {ratio:.3}")?;
        }
        let [x, y] = self.centroid_px;
        write!(f, "   centroid ({x:.2}, {y:.2}) px")?;
        match self.mean_stress_pa {
            Some(stress) => write!(f, "   mean stress {:.2} kPa", stress.value * 1e-3),
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
            self.stop.to_lowercase(),
            self.iterations
        )
    }
}

impl Display for StrainResult {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let e = |i: usize, j: usize| format!("{:+.4} ± {:.4}", self.mean[i][j], self.standard_error[i][j]);
        write!(f, "{}: e_xx {}  e_yy {}  e_zz {}", self.measure, e(0, 0), e(1, 1), e(2, 2))
    }
}

impl Display for Measurement {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "Young's modulus  {}", self.youngs_modulus_pa)?;
        for (i, frame) in self.frames.iter().enumerate() {
            writeln!(f, "frame {:<10} {frame}", i + 1)?;
        }
        if let Some(matching) = &self.matching {
            writeln!(f, "match            {matching}")?;
        }
        if let Some(strain) = &self.strain {
            writeln!(f, "strain           {strain}")?;
        }
        writeln!(f, "all estimators:")?;
        for estimate in &self.estimators {
            writeln!(f, "  {estimate}")?;
        }
        if !self.flags.is_empty() {
            writeln!(f, "cautions:")?;
            for flag in &self.flags {
                writeln!(f, "  {flag}")?;
            }
        }
        Ok(())
    }
}
