//! Everything that the frames of a press say, in one go.
use super::Press;
use crate::force::{Estimate, median_shift_outside};
use crate::matching::StopReason;
use crate::pipeline::error::PipelineError;
use crate::pipeline::face;
use crate::pipeline::flag::Flag;
use crate::pipeline::measurement::{
    FrameResult, MatchResult, Measurement, ModulusResult, StrainResult,
};
use crate::pipeline::object::Object;
use crate::pipeline::report::{SkipReason, Stage};
use nalgebra::Matrix3;

/// Frames of a press up to which all surfaces are reconstructed and kept, which plots want to show: some milliseconds and some hundred
/// kilobytes each. With more, only those of the first and the last frame are kept, and of the others only those reconstructed whose strain is
/// worked out.
const KEPT_SURFACES: usize = 64;

/// Radius in pixels of a contact below which the strain's stated error has been seen to be too small: over 40 presses the largest deviation is
/// 3.05 of e_zz's standard errors at 38 pixels and 2.1 at 51 (`STRAIN_SEEDS=40 cargo test --test suite strain_of_sizes -- --nocapture`).
const COARSE_RADIUS_PX: f64 = 40.0;

/// Standard errors by which the stretches of a face's outline and of its texture may differ: with one comparison a press, one in some 10⁴ is flagged in vain.
const SLIP_ERRORS: f64 = 4.0;
/// Share of the strain below which their difference does no harm.
const SLIP_SHARE: f64 = 0.02;

impl Press<'_> {
    /// Runs all stages on all frames. A stage that fails withholds nothing of the others: its error stands in its place.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let measurement = trial.press(&pipeline)?.measure();
    /// let first = measurement.frames[0].as_ref().expect("a contact");
    /// let height = first.surface_height_m.as_ref().expect("a surface");
    /// assert!((height / trial.simulation.truth[0].contact.apparent_height_m(0.0) - 1.0).abs() < 0.1);
    /// // At 0.7 N the ball is in contact beyond its own radius: Hertz holds for a/R up to 0.3.
    /// assert!(measurement.flags.iter().any(|flag| flag.to_string().contains("small-contact theory does not hold")));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn measure(&mut self) -> Measurement {
        let mut flags = Vec::new();
        let youngs_modulus_pa = self.modulus().map(|m| ModulusResult::from(&m));
        let matching = self.match_result(&mut flags);
        let strain = self.strain_result(&mut flags);
        let estimates = self.estimates().unwrap_or_default();
        let frames = (0..self.frames())
            .map(|frame| self.frame_result(frame, &mut flags))
            .collect();
        flags.extend(self.light_drift());
        if let Ok(modulus) = &youngs_modulus_pa {
            let warnings = modulus.warnings.iter().copied();
            flags.extend(warnings.map(|warning| Flag::Assumption { warning }));
        }
        let error_budget = match youngs_modulus_pa {
            Ok(_) => self.error_budget().unwrap_or_default(),
            Err(_) => Vec::new(),
        };
        flags.extend(self.material_law());
        let time = self.time_dependence().ok().flatten();
        flags.extend(self.time_flags(time.as_ref()));
        Measurement {
            youngs_modulus_pa,
            time,
            error_budget,
            estimators: estimates.iter().map(ModulusResult::from).collect(),
            frames,
            strain,
            matching,
            flags,
            report: self.report().clone(),
        }
    }

    /// A caution where the light of a frame, away from its contact, differs from the reference's; of the frame where it does most.
    fn light_drift(&self) -> Option<Flag> {
        let reference = self.runner.reference().image();
        let steps = self.frames.iter().enumerate().filter_map(|(index, frame)| {
            let known = frame.contact.as_ref()?;
            if frame.image.is_on_demand() {
                return known.light_step_grey;
            }
            let image = frame.image.get(index).ok()?;
            median_shift_outside(image.view(), reference, known.contact.bounds()?)
        });
        let greatest = steps.max_by_key(|step| step.abs())?;
        (greatest != 0).then_some(Flag::LightDrifted {
            grey: f64::from(greatest),
        })
    }

    /// A caution where a flat face is squeezed so far that the law of its material matters.
    fn material_law(&mut self) -> Option<Flag> {
        self.pipeline().settings().object.flat_face()?;
        let series = self.loads(true).ok()?;
        let strains = series.loads().iter().filter_map(|load| load.mean_strain);
        let largest = strains
            .map(|e| e.value)
            .max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let measure = self.pipeline().strain().name();
        // Loads count a squeeze as positive.
        face::material_law_caution(measure, -largest.abs())
    }

    fn frame_result(
        &mut self,
        frame: usize,
        flags: &mut Vec<Flag>,
    ) -> Result<FrameResult, PipelineError> {
        let reading = self.reading(frame)?;
        let gauge_force_n = self.gauge(frame).map(|gauge| gauge.value);
        // What is said to be no ball need not look like one.
        let ball = matches!(
            self.pipeline().settings().object,
            Object::Sphere { .. } | Object::Layer { .. }
        );
        let cautions = reading.flags(frame);
        flags.extend(
            cautions.filter(|flag| {
                ball || !matches!(flag, Flag::NotABall { .. } | Flag::NotRound { .. })
            }),
        );
        if let Some(face) = &reading.face
            && face.sticks()
        {
            let edge_ratio = face.edge_ratio;
            flags.push(Flag::FaceSticks { frame, edge_ratio });
        }
        if let (Some(gauge_n), Some(force_n)) = (gauge_force_n, reading.force_n) {
            let apart = (gauge_n - force_n.value).abs();
            if apart > 3.0 * force_n.standard_error && apart > 0.02 * gauge_n {
                flags.push(Flag::GaugeDisagrees {
                    frame,
                    measured_n: force_n.value,
                    gauge_n,
                });
            }
        }
        let radius = self.pipeline().settings().object.sphere_radius_m();
        let surface_height_m = self.surface_height(frame);
        Ok(FrameResult {
            force_n: reading.force_n.ok_or(PipelineError::NoForce { frame }),
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

    /// The height of a frame's surface, unless there are many frames and this one's surface served nothing.
    fn surface_height(&mut self, frame: usize) -> Result<f64, PipelineError> {
        let frames = self.frames();
        let kept = frames <= KEPT_SURFACES || frame == 0 || frame == frames - 1;
        if !kept && !self.has_surface(frame) {
            let pixels = self.contact_pixels(frame)?;
            let reason = SkipReason::NotAsked;
            self.runner.skip(Stage::Surface, frame, reason, pixels);
            return Err(PipelineError::NotReconstructed { frame, frames });
        }
        let surface = &self.surface(frame)?.surface;
        let heights = surface.heights.iter().copied().filter(|h| h.is_finite());
        let highest = heights.fold(0.0, f64::max);
        if !kept {
            self.forget_surface(frame)?;
        }
        Ok(highest)
    }

    /// The last frame, if there are two.
    fn last(&self) -> Result<usize, PipelineError> {
        match self.frames() {
            found @ 0..2 => Err(PipelineError::TooFewFrames { found }),
            frames => Ok(frames - 1),
        }
    }

    fn match_result(&mut self, flags: &mut Vec<Flag>) -> Result<MatchResult, PipelineError> {
        let last = self.last()?;
        if self.pipeline().settings().object.flat_face().is_some() {
            return self.texture_result(last, flags);
        }
        let model = self.control_points(0)?.to_vec();
        let matching = self.matching(last)?;
        let count = model.len() as f64;
        let displacements = model.iter().zip(&matching.warped);
        let lengths = displacements.map(|(from, to)| (to - from).norm());
        let result = MatchResult {
            points: model.len(),
            matched: matching.assignment.iter().flatten().count(),
            mean_confidence: matching.confidence.iter().sum::<f64>() / count,
            residual_m: matching.report.residual,
            mean_displacement_m: lengths.sum::<f64>() / count,
            iterations: matching.report.iterations,
            stop: matching.report.stop,
        };
        if result.stop == StopReason::IterationLimit {
            flags.push(Flag::MatchNotConverged);
        }
        if result.matched < result.points {
            flags.push(Flag::Unmatched {
                points: result.points - result.matched,
            });
        }
        Ok(result)
    }

    /// The match of a face's texture, and a caution where its points stretch otherwise than the outline.
    fn texture_result(
        &mut self,
        last: usize,
        flags: &mut Vec<Flag>,
    ) -> Result<MatchResult, PipelineError> {
        let texture = self.texture(last)?;
        let areas = [0, last].map(|frame| Some(self.reading(frame).ok()?.face?.area_m2));
        if let [Some(first), Some(second)] = areas {
            let outline = (second.value / first.value).sqrt();
            let relative = |area: Estimate| area.standard_error / area.value;
            let error = 0.5 * outline * relative(first).hypot(relative(second));
            let apart = (outline - texture.stretch.value).abs();
            let allowed = SLIP_ERRORS * error.hypot(texture.stretch.standard_error);
            if apart > allowed && apart > SLIP_SHARE * (outline - 1.0).abs() {
                flags.push(Flag::Slip {
                    frame: last,
                    outline_strain: outline - 1.0,
                    texture_strain: texture.stretch.value - 1.0,
                });
            }
        }
        Ok(MatchResult {
            points: texture.points,
            matched: texture.pairs,
            mean_confidence: texture.pairs as f64 / texture.points as f64,
            residual_m: texture.residual_m,
            mean_displacement_m: texture.displacement_m,
            iterations: 1,
            stop: StopReason::Converged,
        })
    }

    /// The contact's radius in pixels.
    fn radius_px(&mut self, frame: usize) -> Option<f64> {
        let size = self.pipeline().contact().pixel_size_m();
        let radius = self.reading(frame).ok()?.contact_radius_m.value;
        Some(radius / (size[0] * size[1]).sqrt())
    }

    fn strain_result(&mut self, flags: &mut Vec<Flag>) -> Result<StrainResult, PipelineError> {
        let last = self.last()?;
        self.strain(last)?;
        let fewest_px = [0, last]
            .map(|frame| self.radius_px(frame))
            .into_iter()
            .flatten();
        let radius_px = fewest_px.fold(f64::INFINITY, f64::min);
        let strain = self.strain(last)?;
        let summary = &strain.summary;
        if radius_px < COARSE_RADIUS_PX {
            flags.push(Flag::CoarseStrain { radius_px });
        }
        if !summary.folded.is_empty() {
            flags.push(Flag::Folded {
                points: summary.folded.len(),
            });
        }
        Ok(StrainResult {
            measure: strain.measure,
            mean: rows(&summary.mean),
            standard_error: rows(&summary.standard_error),
            spread: rows(&summary.spread),
            used: summary.used,
            folded: summary.folded.len(),
        })
    }
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}
