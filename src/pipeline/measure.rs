//! All results of a press in one call, with cautions.
use super::budget::error_budget;
use super::error::PipelineError;
use super::flag::Flag;
use super::press::Press;
use super::report::{SkipReason, Stage};
use super::result::{FrameResult, MatchResult, Measurement, ModulusResult, StrainResult};
use super::settings::SurfaceInput;
use super::specimen::{Specimen, material_law};
use super::time::{self, TimeResult};
use crate::core::{Source, Uncertain};
use crate::elasticity::modulus::{Estimate, LoadSeries, PaperRatio};
use crate::elasticity::relaxation::TimeDependence;
use crate::matching::StopReason;
use nalgebra::Matrix3;

/// Presses of up to this number of frames get a surface per frame, for plots. Each surface takes
/// about 30 kB and a millisecond.
const PLOTTED_FRAMES: usize = 64;

/// Error of the height of a surface from shading, in cells of its grid. This and the next constant
/// were chosen for balls of 6 to 150 pixels, computed with finite elements. With smaller values
/// more of them fail (`SEEDS=6 cargo test --test suite heights -- --nocapture`).
const CELL_ERROR: f64 = 0.3;

/// Additional relative error for a contact of [`RIM_RADIUS_PX`] pixels. It decreases with the cube
/// of the number of pixels.
const RIM_ERROR: f64 = 0.15;
const RIM_RADIUS_PX: f64 = 20.0;

/// Upper limit of this error for the smallest contacts.
const LARGEST_RIM_ERROR: f64 = 0.4;

impl Press<'_> {
    /// Runs all stages on all frames. If a stage fails, its error takes the place of its result,
    /// and the other stages are not affected.
    ///
    /// ```
    /// use tactile_simulate::Trial;
    /// let trial = Trial::coarser(8)?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let measurement = trial.press(&pipeline)?.measure();
    /// let first = measurement.frames[0].as_ref().expect("a contact");
    /// let height = first.surface_height_m.as_ref().expect("a surface");
    /// assert!(
    ///     (height.value / trial.simulation.truth[0].contact.apparent_height_m(0.0) - 1.0).abs()
    ///         < 0.1
    /// );
    /// // At 0.7 N the contact is larger than the ball's radius; Hertz holds for a/R up to 0.3.
    /// assert!(
    ///     measurement
    ///         .flags
    ///         .iter()
    ///         .any(|flag| flag.to_string().contains("small-contact theory is not valid"))
    /// );
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn measure(&self) -> Measurement {
        let mut flags = Vec::new();
        let modulus = self.modulus();
        let error_budget = match &modulus {
            Ok(found) => error_budget(&found.by_source, self.pipeline().settings()),
            Err(_) => Vec::new(),
        };
        let youngs_modulus_pa = modulus.map(|m| ModulusResult::from(&m));
        let matching = self.match_result(&mut flags);
        let strain = self.strain_result(&mut flags);
        let estimates = self.estimates().unwrap_or_default();
        let frames = (0..self.frames())
            .map(|frame| self.frame_result(frame, &mut flags))
            .collect();
        let step = self.light_step_grey().filter(|&grey| grey != 0.0);
        flags.extend(step.map(|grey| Flag::LightDrifted { grey }));
        flags.extend(self.stages.standing_cautions());
        if let Ok(modulus) = &youngs_modulus_pa {
            let warnings = modulus.warnings.iter().copied();
            flags.extend(warnings.map(|warning| Flag::Assumption { warning }));
        }
        flags.extend(self.material_law());
        let time = self.time_dependence().ok().flatten();
        flags.extend(self.time_flags(time.as_ref()));
        Measurement {
            first_frame: 0,
            youngs_modulus_pa,
            time,
            checked_gain: self.pipeline().settings().checked_gain,
            checked_guide: self.pipeline().settings().checked_guide,
            error_budget,
            estimators: estimates.iter().map(ModulusResult::from).collect(),
            frames,
            strain,
            matching,
            flags,
            report: self.report(),
        }
    }

    /// A caution if a flat face is compressed so far that the law of its material matters.
    fn material_law(&self) -> Option<Flag> {
        let Specimen::Flat(_) = self.stages.specimen else {
            return None;
        };
        let series = self.loads(true).ok()?;
        let strains = series.loads().iter().filter_map(|load| load.mean_strain);
        let largest = strains
            .map(|e| e.value)
            .max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let measure = self.pipeline().strain();
        // Loads count compression as positive.
        material_law(measure, -largest.abs())
    }

    fn frame_result(
        &self,
        frame: usize,
        flags: &mut Vec<Flag>,
    ) -> Result<FrameResult, PipelineError> {
        let reading = self.reading(frame)?;
        let gauge_force_n = self.gauge(frame).map(|gauge| gauge.value);
        let cautions = self.cautions(frame)?;
        // All frames have the same light, so its caution is given once.
        let of_frame = |flag: &Flag| !matches!(flag, Flag::LightDrifted { .. });
        flags.extend(cautions.into_iter().filter(of_frame));
        let radius = self.pipeline().settings().object.sphere_radius_m();
        let surface_height_m = self.surface_height(frame);
        Ok(FrameResult {
            force_n: (reading.force_n.map(|force| force.total()))
                .ok_or(PipelineError::NoForce { frame }),
            gauge_force_n,
            contact_radius_m: reading.contact_radius_m.total(),
            contact_ratio: radius.map(|r| reading.contact_radius_m.value / r),
            centroid_px: reading.centroid_px,
            contact_area_m2: reading.area_m2,
            mean_stress_pa: reading.mean_stress_pa().map(|stress| stress.total()),
            surface_height_m,
            surface_apparent: self.apparent(),
            guide_depression_m: self
                .guide_depression_m(frame, &[0.0])?
                .and_then(|depths| depths.first().copied()),
        })
    }

    /// Whether surfaces are apparent: the pressure interpreted as shading.
    fn apparent(&self) -> bool {
        self.pipeline().settings().surface_input == SurfaceInput::Shading
    }

    /// Frames whose surface [`measure`](Self::measure) reconstructs: every frame of a press of up
    /// to 64 frames, for plots; otherwise the first and the last.
    ///
    /// ```
    /// # use tactile_imaging::{Object, Pipeline, force::CalibrationPair};
    /// let pairs: Vec<_> = (0..6)
    ///     .map(|k| CalibrationPair::loading(2e4 * k as f64, 0.1 * k as f64))
    ///     .collect();
    /// let pipeline = Pipeline::from_pairs(&pairs, [86.2e-6, 86.2e-6], Object::sphere(3e-3))?;
    /// let frame = ndarray::Array2::from_elem((120, 160), 12_u8);
    /// let mut press = pipeline.press(frame.view())?;
    /// (0..100).for_each(|_| {
    ///     press.add_frame(frame.view());
    /// });
    /// assert_eq!(press.measured_surfaces().collect::<Vec<_>>(), [0, 99]);
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn measured_surfaces(&self) -> impl Iterator<Item = usize> + use<> {
        let frames = self.frames();
        let step = if frames <= PLOTTED_FRAMES {
            1
        } else {
            frames - 1
        };
        (0..frames).step_by(step.max(1))
    }

    /// The height of a frame's surface. In a press of many frames only the first, the last and
    /// those with a strain have one: each takes several milliseconds and several hundred kilobytes.
    fn surface_height(&self, frame: usize) -> Result<Estimate, PipelineError> {
        let frames = self.frames();
        let wanted = self.measured_surfaces().any(|other| other == frame);
        if !wanted && !self.has_surface(frame) {
            self.skipped(Stage::Surface, SkipReason::NotAsked);
            return Err(PipelineError::NotReconstructed { frame, frames });
        }
        let surface = self.surface(frame)?;
        let heights = surface.surface.heights.iter().copied();
        let height = heights.filter(|h| h.is_finite()).fold(0.0, f64::max);
        let [hx, hy] = surface.pixel_size_m;
        let cell_m = hx.max(hy);
        if !self.apparent() {
            return Ok(Estimate::new(height, cell_m));
        }
        // For a small contact, smoothing leaves little more than the rim, and the height is
        // overestimated.
        let radius_px = self.radius_px(frame).unwrap_or(RIM_RADIUS_PX);
        let of_rim = RIM_ERROR * (RIM_RADIUS_PX / radius_px).powi(3);
        let of_rim = of_rim.min(LARGEST_RIM_ERROR);
        let error_m = (CELL_ERROR * cell_m).hypot(of_rim * height);
        Ok(Estimate::new(height, error_m))
    }

    /// The last frame. There must be at least two.
    fn last(&self) -> Result<usize, PipelineError> {
        match self.frames() {
            found @ 0..2 => Err(PipelineError::TooFewFrames { found }),
            frames => Ok(frames - 1),
        }
    }

    fn match_result(&self, flags: &mut Vec<Flag>) -> Result<MatchResult, PipelineError> {
        let last = self.last()?;
        if let Specimen::Flat(_) = self.stages.specimen {
            return Err(PipelineError::FlatFace { from: 0, to: last });
        }
        let model = self.control_points(0)?;
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

    /// The contact's radius in pixels.
    fn radius_px(&self, frame: usize) -> Option<f64> {
        let size = self.pipeline().contact().pixel_size_m();
        let radius = self.reading(frame).ok()?.contact_radius_m.value;
        Some(radius / (size[0] * size[1]).sqrt())
    }

    fn strain_result(&self, flags: &mut Vec<Flag>) -> Result<StrainResult, PipelineError> {
        let last = self.last()?;
        let strain = self.strain(last)?;
        let summary = &strain.summary;
        let fewest_px = [0, last].map(|frame| self.radius_px(frame));
        let radius_px = fewest_px
            .into_iter()
            .flatten()
            .fold(f64::INFINITY, f64::min);
        // For smaller contacts the stated error of the strain was found too small: over 40 presses
        // the largest deviation is 3.05 standard errors of e_zz at 38 pixels and 2.1 at 51
        // (`STRAIN_SEEDS=40 cargo test --test suite strain_of_sizes -- --nocapture`).
        if radius_px < 40.0 {
            flags.push(Flag::CoarseStrain { radius_px });
        }
        if !summary.folded.is_empty() {
            flags.push(Flag::Folded {
                points: summary.folded.len(),
            });
        }
        Ok(StrainResult {
            measure: strain.measure,
            apparent: self.apparent() && !matches!(self.stages.specimen, Specimen::Flat(_)),
            mean: rows(&summary.mean),
            standard_error: rows(&summary.standard_error),
            spread: rows(&summary.spread),
            used: summary.used,
            folded: summary.folded.len(),
        })
    }

    /// Whether the modulus changes over the frames that have a [time](Self::set_time_s), because
    /// the sample relaxes or the sensor drifts, see [`relaxation`](crate::elasticity::relaxation).
    /// If all of them have a gauge reading, the gauge's force is used, which does not depend on the
    /// sensor's gain. `None` if fewer than two frames have a time and a modulus of their own.
    ///
    /// # Errors
    /// Those of [`modulus`](Self::modulus), except those of its estimator: frames without a modulus
    /// are skipped.
    fn time_dependence(&self) -> Result<Option<TimeResult>, PipelineError> {
        let times_s: Vec<_> = (0..self.frames()).map(|k| self.time_s(k)).collect();
        if times_s.iter().flatten().count() < 2 {
            return Ok(None);
        }
        let estimator = self.pipeline().estimator()?;
        let flat = matches!(self.stages.specimen, Specimen::Flat(_));
        // The strain since the first frame gives no modulus for a single load. The strain of a face
        // is counted from the unloaded state.
        if estimator.needs_strain() && !flat {
            return Ok(None);
        }
        let series = self.loads(estimator.needs_strain())?;
        let series = match self.gauged_loads(&series) {
            Some(gauged) => gauged,
            None => series,
        };
        Ok(match estimator.needs_strain() {
            true => time::of_moduli(&PaperRatio::default(), &series, &times_s),
            false => time::of_moduli(estimator.as_ref(), &series, &times_s),
        })
    }

    /// The loads with the gauge's forces, if all frames with a time have one.
    fn gauged_loads(&self, series: &LoadSeries) -> Option<LoadSeries> {
        let mut loads = series.loads().to_vec();
        for (frame, load) in loads.iter_mut().enumerate() {
            if self.time_s(frame).is_some() {
                let gauge = self.gauge(frame)?;
                let scale = self.pipeline().settings().assumptions.error(Source::Gain);
                load.force_n = Uncertain::from(gauge).by_relative(Source::Gain, scale);
            }
        }
        Some(series.with_loads(loads))
    }

    /// Relative change of the light's force compared with the gauge, if all frames with a time have
    /// both.
    fn gain_change(&self) -> Option<f64> {
        let mut forces = Vec::new();
        for frame in 0..self.frames() {
            let Some(time_s) = self.time_s(frame) else {
                continue;
            };
            let gauge = self.gauge(frame)?;
            let reading = self.reading(frame).ok()?;
            let force = reading.force_n?;
            let light = Estimate::new(force.value, force.part(Source::Noise).abs());
            // Without a calibration the reading comes from the gauge.
            let is_gauge = light.value == gauge.value;
            if !is_gauge {
                forces.push((time_s, light, gauge));
            }
        }
        let result = time::of_gains(&forces)?;
        (result.change != TimeDependence::Steady).then(|| result.relative_change())
    }

    /// Cautions about time: a modulus that applies to one moment only, or a gain that has changed
    /// since the calibration.
    fn time_flags(&self, time: Option<&TimeResult>) -> Vec<Flag> {
        let gain = self
            .gain_change()
            .map(|change| Flag::SensorDrifts { change });
        let of_moduli = time.and_then(|time| match time.change {
            TimeDependence::Relaxes(solid) => Some(Flag::SampleRelaxes {
                instantaneous_pa: solid.instantaneous_pa,
                equilibrium_pa: solid.equilibrium_pa,
                time_constant_s: solid.time_constant_s,
            }),
            TimeDependence::Drifts { .. } if gain.is_none() => Some(Flag::SensorDrifts {
                change: time.relative_change(),
            }),
            TimeDependence::Steady => None,
            _ => Some(Flag::ChangesWithTime {
                change: time.relative_change(),
            }),
        });
        gain.into_iter().chain(of_moduli).collect()
    }
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}
