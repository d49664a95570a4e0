//! The time of each frame of a press, and what the moduli say of it.
use super::Press;
use crate::elasticity::modulus::{Estimate, LoadSeries, PaperRatio};
use crate::elasticity::relaxation::TimeDependence;
use crate::pipeline::error::PipelineError;
use crate::pipeline::flag::Flag;
use crate::pipeline::time::{self, TimeResult};

impl Press<'_> {
    /// Says when a frame was taken, in seconds since the object touched. Frames without a time do not count where time does.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::pipeline::PipelineError;
    /// let pipeline = trial.pipeline()?;
    /// let mut press = trial.press(&pipeline)?;
    /// press.set_time_s(0, 2.0)?;
    /// let error = press.set_time_s(1, 1.5).unwrap_err();
    /// assert_eq!(error, PipelineError::TimeDecreases { frame: 1, before_s: 2.0, found_s: 1.5 });
    /// press.set_time_s(1, 2.5)?;
    /// let time = press.measure().time.expect("two loads with their times");
    /// assert_eq!((time.from_s, time.to_s, time.loads), (2.0, 2.5, 2));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoSuchFrame`], [`PipelineError::Time`] for what is negative or not finite, [`PipelineError::TimeDecreases`].
    pub fn set_time_s(&mut self, frame: usize, time_s: f64) -> Result<(), PipelineError> {
        self.twin(frame)?;
        if !(time_s >= 0.0 && time_s.is_finite()) {
            return Err(PipelineError::Time {
                frame,
                found_s: time_s,
            });
        }
        let times =
            |of: &[super::Loaded<'_>]| of.iter().filter_map(|f| f.time_s).collect::<Vec<_>>();
        let before_s = times(&self.frames[..frame]).pop();
        if let Some(before_s) = before_s.filter(|before_s| time_s < *before_s) {
            return Err(PipelineError::TimeDecreases {
                frame,
                before_s,
                found_s: time_s,
            });
        }
        let after =
            (frame + 1..self.frames.len()).find(|&later| self.frames[later].time_s.is_some());
        if let Some((later, found_s)) = after.and_then(|k| Some((k, self.frames[k].time_s?)))
            && found_s < time_s
        {
            return Err(PipelineError::TimeDecreases {
                frame: later,
                before_s: time_s,
                found_s,
            });
        }
        self.frames[frame].time_s = Some(time_s);
        Ok(())
    }

    /// Whether the modulus changes over the frames that have a [time](Self::set_time_s): relaxing sample or drifting sensor, see
    /// [`relaxation`](crate::elasticity::relaxation). Where all of them have a gauge's force, that is taken in place of the light's: no gain is in it.
    /// `None` where fewer than two frames have a time and a modulus of their own.
    ///
    /// # Errors
    /// Those of [`modulus`](Self::modulus) but for its estimator's: what gives no modulus is left out.
    pub(super) fn time_dependence(&mut self) -> Result<Option<TimeResult>, PipelineError> {
        let times_s: Vec<Option<f64>> = self.frames.iter().map(|frame| frame.time_s).collect();
        if times_s.iter().flatten().count() < 2 {
            return Ok(None);
        }
        let estimator = self.pipeline().estimator()?;
        let flat = self.pipeline().settings().object.flat_face().is_some();
        // A strain since the first frame gives no modulus of one load; that of a face is since the unloaded state.
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

    /// The loads with the gauge's forces, where all frames with a time have one.
    fn gauged_loads(&self, series: &LoadSeries) -> Option<LoadSeries> {
        let mut loads = series.loads().to_vec();
        for (load, frame) in loads.iter_mut().zip(&self.frames) {
            if frame.time_s.is_some() {
                let gauge = frame.gauge?;
                load.force_n = Estimate::new(gauge.value, gauge.standard_error);
            }
        }
        let shared = *series.shared_errors();
        LoadSeries::new(loads).with_shared_errors(shared).ok()
    }

    /// How the light's force changed against the gauge's, where all frames with a time have both.
    fn gain_change(&mut self) -> Option<f64> {
        let mut forces = Vec::new();
        for frame in 0..self.frames.len() {
            let Some(time_s) = self.frames[frame].time_s else {
                continue;
            };
            let gauge = self.frames[frame].gauge?;
            let reading = self.reading(frame).ok()?;
            let light = Estimate::new(reading.force_n?.value, reading.force_noise_n);
            // Without a calibration the reading is the gauge's.
            let is_gauge = light.value == gauge.value;
            if !is_gauge {
                let gauge = Estimate::new(gauge.value, gauge.standard_error);
                forces.push((time_s, light, gauge));
            }
        }
        let result = time::of_gains(&forces)?;
        (result.change != TimeDependence::Steady).then(|| result.relative_change())
    }

    /// What to be cautious about: a modulus that is of a moment, a gain that is no longer the calibration's.
    pub(super) fn time_flags(&mut self, time: Option<&TimeResult>) -> Vec<Flag> {
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
