//! The modulus of a press, and the loads it is estimated from.
use super::Press;
use crate::elasticity::modulus::{LoadSeries, ModulusEstimate};
use crate::pipeline::error::PipelineError;
use crate::pipeline::error_budget::{self, ErrorShare};
use crate::pipeline::estimators::that_fit;
use crate::pipeline::face;
use crate::pipeline::load_reading::LoadReading;

/// Frames of a press whose strain is worked out for the modulus. A match takes milliseconds, so that thousands would take minutes; the error
/// of the mean strain is that of the first surface, which all share, and does not fall with more.
const STRAINED_FRAMES: usize = 32;

impl Press<'_> {
    /// Young's modulus by the estimator of the pipeline. For a
    /// ball that takes the contacts alone: no surface is reconstructed.
    ///
    /// # Errors
    /// [`PipelineError::Modulus`], [`PipelineError::NoForce`], and those of the stages it needs.
    pub fn modulus(&mut self) -> Result<ModulusEstimate, PipelineError> {
        let estimator = self.pipeline().estimator()?;
        let loads = self.loads(estimator.needs_strain())?;
        self.runner.modulus(estimator.as_ref(), &loads)
    }

    /// What every frame says of its load, with the strain since the first (of at most 32 frames, evenly chosen; of a flat face, of all frames and
    /// since the unloaded state) and the errors that all share. A frame that equals an earlier one says nothing new, and a contact that the frame's edge cuts says something wrong: their loads
    /// have a force alone (where all are cut, there is nothing better). This is what
    /// [estimators](crate::elasticity::modulus::ModulusEstimator) take.
    ///
    /// ```
    /// # use tactile_simulate::Trial;
    /// # use tactile_simulate::{CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
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
    pub fn load_series(&mut self) -> Result<LoadSeries, PipelineError> {
        self.loads(true)
    }

    /// What each input's error has in the standard error of [`modulus`](Self::modulus), the largest first.
    ///
    /// # Errors
    /// Those of [`modulus`](Self::modulus).
    pub(super) fn error_budget(&mut self) -> Result<Vec<ErrorShare>, PipelineError> {
        let estimator = self.pipeline().estimator()?;
        let loads = self.loads(estimator.needs_strain())?;
        Ok(error_budget::of(&estimator, &loads))
    }

    /// Young's modulus by every estimator that the frames allow, the paper's ratio first.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
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
    pub fn estimates(&mut self) -> Result<Vec<ModulusEstimate>, PipelineError> {
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
    pub(super) fn loads(&mut self, with_strain: bool) -> Result<LoadSeries, PipelineError> {
        let mut readings: Vec<LoadReading> = Vec::with_capacity(self.frames.len());
        // Contacts that the frame's edge cuts.
        let mut cut = Vec::with_capacity(self.frames.len());
        let size = self.pipeline().contact().pixel_size_m();
        for frame in 0..self.frames.len() {
            let contact = self.reading(frame)?;
            let reading = LoadReading::of(&contact, None, size);
            readings.push(reading.ok_or(PipelineError::NoForce { frame })?);
            cut.push(contact.touches_edge);
        }
        let flat = self.pipeline().settings().object.flat_face();
        if with_strain && flat.is_none() {
            for frame in self.strained_frames() {
                let step = readings[frame].force_n - readings[0].force_n;
                readings[frame].mean_strain = Some(self.strain(frame)?.of_load(step));
            }
        }
        let all_cut = cut.iter().all(|&cut| cut);
        for (frame, reading) in readings.iter_mut().enumerate() {
            if self.is_repeated(frame) || cut[frame] && !all_cut {
                reading.forget_contact();
            }
        }
        match flat.filter(|_| with_strain) {
            Some(poisson_ratio) => {
                self.check_faces(&cut)?;
                self.runner
                    .uniaxial_series(readings.iter().copied(), poisson_ratio)
            }
            None => self.runner.load_series(readings.iter().copied()),
        }
    }

    /// Refuses contacts that are not those of one flat face. Frames whose contact is `cut` by their edge do not count unless all are.
    fn check_faces(&mut self, cut: &[bool]) -> Result<(), PipelineError> {
        let all_cut = cut.iter().all(|&cut| cut);
        let mut contacts = Vec::with_capacity(cut.len());
        for frame in (0..cut.len()).filter(|&frame| all_cut || !cut[frame]) {
            contacts.push((frame, self.reading(frame)?));
        }
        let numbered = contacts.iter().map(|(frame, contact)| (*frame, contact));
        face::check(numbered, self.pipeline().settings().object)
    }

    /// The frames whose strain enters the modulus: those that equal no earlier one, thinned evenly where there are many.
    fn strained_frames(&self) -> Vec<usize> {
        let new: Vec<usize> = (1..self.frames.len())
            .filter(|&frame| !self.is_repeated(frame))
            .collect();
        let last = new.len().saturating_sub(1);
        let kept = new.len().min(STRAINED_FRAMES);
        // The last frame is always one of them.
        (1..=kept).map(|k| new[k * (last + 1) / kept - 1]).collect()
    }
}
