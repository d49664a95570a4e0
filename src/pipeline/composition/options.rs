//! What a pipeline is told beside its stages.
use super::Pipeline;
use crate::pipeline::error::PipelineError;
use crate::pipeline::settings::Settings;

impl Pipeline {
    /// Sets the number of control points.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(40);
    /// assert_eq!(trial.press(&pipeline)?.control_points(0)?.len(), 40);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_control_points(mut self, count: usize) -> Self {
        self.settings.control_points = count;
        self
    }

    /// Changes any of the settings; all are checked together.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// use tactile_imaging::pipeline::Binning;
    /// let exact = trial.pipeline()?;
    /// let pipeline = exact.clone().with_settings(|settings| {
    ///     settings.binning = Binning::Blocks(2);
    ///     settings.object_radius_error_m = 0.09e-3; // 3 % of the ball's radius
    /// })?;
    /// let mut press = trial.press(&pipeline)?;
    /// assert!((press.surface(0)?.pixel_size_m[0] / camera.pixel_size_m[0] - 2.0).abs() < 1e-12);
    /// // E is proportional to the radius, but for the guide's share of the compliance and the correction for finite strain.
    /// let relative = |m: &tactile_imaging::elasticity::modulus::ModulusEstimate| m.standard_error_pa / m.youngs_modulus_pa;
    /// let of_the_radius = relative(&press.modulus()?).powi(2) - relative(&trial.press(&exact)?.modulus()?).powi(2);
    /// assert!(of_the_radius.sqrt() > 0.03);
    /// // On a rigid flat instead of the layered guide the ball would be softer for the same contact.
    /// let rigid = exact.clone().with_settings(|settings| settings.waveguide = None)?;
    /// assert!(trial.press(&rigid)?.modulus()?.youngs_modulus_pa < trial.press(&exact)?.modulus()?.youngs_modulus_pa);
    /// assert!(exact.clone().with_settings(|settings| settings.smoothing_px = 8).is_err(), "no middle");
    /// assert!(exact.with_settings(|settings| settings.force_scale_error = f64::NAN).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Material`] for an object that is not physical, [`PipelineError::EvenSmoothing`], [`PipelineError::EmptyBlocks`],
    /// [`PipelineError::ScaleError`] and [`PipelineError::InputError`] for an error that is negative or not finite, and
    /// [`PipelineError::LayerCovariance`] for one that has not three rows and columns for each layer of the waveguide.
    pub fn with_settings(
        mut self,
        change: impl FnOnce(&mut Settings),
    ) -> Result<Self, PipelineError> {
        let known = (self.settings.object, self.settings.waveguide.clone());
        change(&mut self.settings);
        self.settings.check()?;
        if known != (self.settings.object, self.settings.waveguide.clone()) {
            self.estimator.renew();
        }
        Ok(self)
    }
}
