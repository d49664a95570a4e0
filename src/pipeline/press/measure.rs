//! Everything that a press can say, measured in one go.
use super::Press;
use crate::matching::StopReason;
use crate::pipeline::error::PipelineError;
use crate::pipeline::flag::Flag;
use crate::pipeline::measurement::{
    FrameResult, MatchResult, Measurement, ModulusResult, StrainResult,
};
use nalgebra::Matrix3;

impl Press<'_> {
    /// Measures everything: all stages on all frames.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let measurement = trial.press(&pipeline)?.measure()?;
    /// let height = measurement.frames[0].surface_height_m.expect("a surface");
    /// assert!((height / trial.truth().frames[0].surface_height_m - 1.0).abs() < 0.1);
    /// // At 0.7 N the ball is in contact beyond its own radius: Hertz holds for a/R up to 0.3.
    /// assert!(measurement.flags.iter().any(|flag| flag.to_string().contains("small-contact theory does not hold")));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError`]: a frame without contact or force, loads that do not determine a modulus. Where the modulus
    /// does without strain, trouble with surfaces and matches is a flag, not an error.
    pub fn measure(&mut self) -> Result<Measurement, PipelineError> {
        let youngs_modulus_pa = ModulusResult::from(&self.modulus()?);
        let mut flags = Vec::new();
        let last = self.frames().saturating_sub(1);
        let (mut matching, mut strain) = (None, None);
        if last > 0 {
            match self.match_and_strain(last, &mut flags) {
                Ok((m, s)) => (matching, strain) = (Some(m), Some(s)),
                Err(error) => flags.push(Flag::NoStrain {
                    reason: error.to_string(),
                }),
            }
        }
        let estimators: Vec<_> = self.estimates()?.iter().map(ModulusResult::from).collect();
        let frames = (0..self.frames())
            .map(|i| self.frame_result(i, &mut flags))
            .collect::<Result<_, _>>()?;
        let warnings = youngs_modulus_pa.warnings.iter().cloned();
        flags.extend(warnings.map(|warning| Flag::Assumption { warning }));
        let report = self.report().clone();
        Ok(Measurement {
            youngs_modulus_pa,
            estimators,
            frames,
            strain,
            matching,
            flags,
            report,
        })
    }

    fn frame_result(
        &mut self,
        frame: usize,
        flags: &mut Vec<Flag>,
    ) -> Result<FrameResult, PipelineError> {
        let reading = *self
            .contact(frame)?
            .ok_or(PipelineError::NoContact { frame })?;
        let force_n = reading.force_n.ok_or(PipelineError::NoForce { frame })?;
        let gauge_force_n = self.gauge_n(frame);
        flags.extend(reading.flags(frame));
        if let Some(gauge_n) = gauge_force_n {
            let apart = (gauge_n - force_n.value).abs();
            if apart > 3.0 * force_n.standard_error && apart > 0.02 * gauge_n {
                flags.push(Flag::GaugeDisagrees {
                    frame,
                    measured_n: force_n.value,
                    gauge_n,
                });
            }
        }
        let radius = self.pipeline.settings().object.sphere_radius_m();
        let surface_height_m = self.surface(frame).ok().map(|s| {
            let heights = s.surface.heights.iter().copied().filter(|h| h.is_finite());
            heights.fold(0.0, f64::max)
        });
        Ok(FrameResult {
            force_n,
            gauge_force_n,
            contact_radius_m: reading.contact_radius_m,
            contact_ratio: radius.map(|r| reading.contact_radius_m.value / r),
            centroid_px: reading.centroid_px.map(|c| c.value),
            centroid_sd_px: reading.centroid_px.map(|c| c.standard_error),
            contact_area_m2: reading.area_m2,
            mean_stress_pa: reading.mean_stress_pa(),
            surface_height_m,
        })
    }

    fn match_and_strain(
        &mut self,
        frame: usize,
        flags: &mut Vec<Flag>,
    ) -> Result<(MatchResult, StrainResult), PipelineError> {
        let model = self.control_points(0)?.to_vec();
        let matching = self.matching(frame)?;
        let n = model.len() as f64;
        let lengths = model
            .iter()
            .zip(&matching.warped)
            .map(|(a, b)| (b - a).norm());
        let result = MatchResult {
            points: model.len(),
            matched: matching.assignment.iter().flatten().count(),
            mean_confidence: matching.confidence.iter().sum::<f64>() / n,
            residual_m: matching.report.residual,
            mean_displacement_m: lengths.sum::<f64>() / n,
            iterations: matching.report.iterations,
            stop: format!("{:?}", matching.report.stop),
        };
        if matching.report.stop == StopReason::IterationLimit {
            flags.push(Flag::MatchNotConverged);
        }
        if result.matched < result.points {
            flags.push(Flag::Unmatched {
                points: result.points - result.matched,
            });
        }
        let strain = self.strain(frame)?;
        let summary = &strain.summary;
        if !summary.folded.is_empty() {
            flags.push(Flag::Folded {
                points: summary.folded.len(),
            });
        }
        let strain = StrainResult {
            measure: strain.measure.into(),
            mean: rows(&summary.mean),
            standard_error: rows(&summary.standard_error),
            spread: rows(&summary.spread),
            used: summary.used,
            folded: summary.folded.len(),
        };
        Ok((result, strain))
    }
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}
