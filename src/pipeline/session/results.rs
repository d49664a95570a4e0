//! What a session computes only when asked: strain and modulus.
use super::Session;
use super::strain::{FollowedStrain, Frame, SessionStrain};
use crate::elasticity::modulus::ModulusEstimate;
use crate::pipeline::error::PipelineError;

impl Session {
    /// Strain of the last frame against the load where strain began to be asked for; that load's own answer is `None`.
    ///
    /// The first call makes its frame's load the one that strains are counted from, until [`restart_strain`](Self::restart_strain).
    /// Costs the surface, control points, match and strain of one frame; a call without a new frame costs nothing.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tactile_imaging::pipeline::Session;
    /// use tactile_simulate::Trial;
    /// use tactile_simulate::{Camera, CalibrationRun, PressLoad, PressOptions};
    /// let camera = Camera::default().coarser(4);
    /// let loads = [0.7, 1.0, 1.2].map(PressLoad::normal).to_vec();
    /// let trial = Trial::new(PressOptions { camera, loads, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
    /// let mut across = Vec::new();
    /// for frame in &trial.simulation.frames {
    ///     session.push(frame.view())?;
    ///     across.extend(session.strain()?.map(|found| found.strain.summary.mean[(0, 0)]));
    /// }
    /// // From 0.7 N the surface of a ball grows with the cube root of the load.
    /// let truth = |force: f64| 0.5 * ((force / 0.7_f64).powf(2.0 / 3.0) - 1.0);
    /// assert_eq!(across.len(), 2);
    /// assert!((across[0] - truth(1.0)).abs() < 0.02 && (across[1] - truth(1.2)).abs() < 0.02);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoContact`] where nothing touches; those of a [`Press`](crate::pipeline::Press)'s strain.
    pub fn strain(&mut self) -> Result<Option<&SessionStrain>, PipelineError> {
        let Some(reading) = self.contact.reading.filter(|_| self.measured) else {
            return Err(PipelineError::NoContact {
                frame: self.frames.saturating_sub(1) as usize,
            });
        };
        let frame = Frame {
            number: self.measured_frame,
            image: self.last.view(),
            contact: &self.contact,
            reading,
        };
        self.strain.follow(&mut self.runner, &frame)
    }

    /// Counts strain anew, from the next load that [`strain`](Self::strain) is asked for.
    ///
    /// ```
    /// # use std::sync::Arc;
    /// # use tactile_imaging::pipeline::Session;
    /// # use tactile_simulate::Trial;
    /// # use tactile_simulate::{Camera, CalibrationRun, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// # let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
    /// session.push(trial.simulation.frames[0].view())?;
    /// assert!(session.strain()?.is_none());
    /// session.push(trial.simulation.frames[1].view())?;
    /// session.restart_strain();
    /// assert!(session.strain()?.is_none(), "strain is now counted from this frame");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn restart_strain(&mut self) {
        self.strain = FollowedStrain::default();
    }

    /// Young's modulus from all loads so far, by the estimator of the pipeline. Where that needs strain the loads are those whose [`strain`](Self::strain) was asked for;
    /// of a flat face all.
    ///
    /// # Errors
    /// [`PipelineError::Modulus`]; [`PipelineError::NotUniaxial`] where the last contact is not that of a flat face.
    pub fn modulus(&mut self) -> Result<ModulusEstimate, PipelineError> {
        let estimator = self.runner.pipeline().estimator()?;
        let size = self.runner.pipeline().contact().pixel_size_m();
        let flat = self.runner.pipeline().settings().object.flat_face();
        let loads = if let Some(poisson_ratio) = flat.filter(|_| estimator.needs_strain()) {
            if let Some(contact) = &self.contact.reading {
                self.check_face(contact)?;
            }
            self.runner
                .uniaxial_series(self.loads.readings(size), poisson_ratio)?
        } else if estimator.needs_strain() {
            self.runner.load_series(self.strain.loads(size))?
        } else {
            self.runner.load_series(self.loads.readings(size))?
        };
        self.runner.modulus(estimator.as_ref(), &loads)
    }
}
