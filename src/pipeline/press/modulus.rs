//! The modulus of a press, and the loads it is estimated from.
use super::Press;
use crate::elasticity::modulus::{LoadSeries, ModulusEstimate};
use crate::pipeline::error::PipelineError;
use crate::pipeline::error_budget::{self, ErrorShare};
use crate::pipeline::estimators::that_fit;
use crate::pipeline::load_reading::LoadReading;

impl Press<'_> {
    /// Young's modulus by the estimator of the pipeline. For a
    /// ball that takes the contacts alone: no surface is reconstructed.
    ///
    /// # Errors
    /// [`PipelineError::Modulus`], [`PipelineError::NoForce`], and those of the stages it needs.
    pub fn modulus(&mut self) -> Result<ModulusEstimate<f64>, PipelineError> {
        let estimator = self.pipeline().estimator()?;
        let loads = self.loads(estimator.needs_strain())?;
        self.runner.modulus(estimator.as_ref(), &loads)
    }

    /// What every frame says of its load, with the strain since the first and the errors that all share: what
    /// [estimators](crate::elasticity::modulus::ModulusEstimator) take.
    ///
    /// ```
    /// # use tactile_imaging::pipeline::Trial;
    /// # use tactile_imaging::simulate::{CalibrationOptions, Camera, PressOptions};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// # let pipeline = trial.pipeline()?;
    /// let series = trial.press(&pipeline)?.load_series()?;
    /// let loads = series.loads();
    /// assert!((loads[1].force_n.value - 1.2).abs() < 0.01);
    /// assert!(loads[0].mean_strain.is_none() && loads[1].mean_strain.is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoForce`], and those of the contacts and of [`strain`](Self::strain).
    pub fn load_series(&mut self) -> Result<LoadSeries<f64>, PipelineError> {
        self.loads(true)
    }

    /// What each input's error has in the standard error of [`modulus`](Self::modulus), the largest first.
    ///
    /// # Errors
    /// Those of [`modulus`](Self::modulus).
    pub fn error_budget(&mut self) -> Result<Vec<ErrorShare>, PipelineError> {
        let estimator = self.pipeline().estimator()?;
        let loads = self.loads(estimator.needs_strain())?;
        Ok(error_budget::of(&estimator, &loads))
    }

    /// Young's modulus by every estimator that the frames allow, the paper's ratio first.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::elasticity::modulus::EstimatorKind;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let estimates = press.estimates()?;
    /// assert_eq!(estimates[0].estimator, EstimatorKind::PaperRatio, "stress over strain");
    /// let best = press.modulus()?;
    /// assert!(estimates.contains(&best) && best.estimator == EstimatorKind::HertzSphere);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of the contacts; what an estimator cannot do is left out.
    pub fn estimates(&mut self) -> Result<Vec<ModulusEstimate<f64>>, PipelineError> {
        let loads = match self.loads(true) {
            Ok(loads) => loads,
            Err(_) => self.loads(false)?,
        };
        let settings = self.pipeline().settings();
        let mut estimators = that_fit(settings.object, settings.waveguide.as_ref())?;
        if let Ok(chosen) = self.pipeline().estimator()
            && estimators.iter().all(|e| e.kind() != chosen.kind())
        {
            estimators.push(chosen);
        }
        let estimates = estimators
            .iter()
            .filter_map(|estimator| self.runner.modulus(estimator.as_ref(), &loads).ok());
        Ok(estimates.collect())
    }

    /// What every frame says of its load, and the relative errors that all share.
    fn loads(&mut self, with_strain: bool) -> Result<LoadSeries<f64>, PipelineError> {
        let mut readings: Vec<LoadReading> = Vec::with_capacity(self.frames.len());
        let size = self.pipeline().contact().pixel_size_m();
        for frame in 0..self.frames.len() {
            let contact = self.reading(frame)?;
            let reading = LoadReading::of(&contact, None, size);
            readings.push(reading.ok_or(PipelineError::NoForce { frame })?);
        }
        let strained = if with_strain { readings.len() } else { 0 };
        for frame in 1..strained {
            // A frame that equals the first has no strain.
            if self.twins[frame] != 0 {
                let step = readings[frame].force_n - readings[0].force_n;
                readings[frame].mean_strain = Some(self.strain(frame)?.of_load(step));
            }
        }
        self.runner.load_series(readings.iter().copied())
    }
}
