//! What a press says of its frames, one stage after the other: contact, surface, control points, match, strain.
use super::{Loaded, Press};
use crate::matching::Matching;
use crate::pipeline::background;
use crate::pipeline::contact::{ContactReading, FrameContact};
use crate::pipeline::error::PipelineError;
use crate::pipeline::face::TextureStretch;
use crate::pipeline::pair::PairStrain;
use crate::pipeline::surface::{ContactSurface, ControlPoints};
use nalgebra::Point3;

impl Press<'_> {
    /// The contact of a frame with its force; `None` where nothing touches.
    ///
    /// # Errors
    /// [`PipelineError::Contact`], [`PipelineError::NoSuchFrame`].
    pub fn contact(&mut self, frame: usize) -> Result<Option<&ContactReading>, PipelineError> {
        let at = self.twin(frame)?;
        if self.frames[at].contact.is_none() {
            let mut contact = FrameContact::default();
            let loaded = &self.frames[at];
            let image = loaded.image.get(frame)?;
            self.runner
                .contact(frame, image.view(), loaded.gauge, &mut contact)?;
            self.frames[at].contact = Some(contact);
        }
        Ok(self.frames[at]
            .contact
            .as_ref()
            .and_then(|c| c.reading.as_ref()))
    }

    /// The contact of a frame that must have one.
    pub(super) fn reading(&mut self, frame: usize) -> Result<ContactReading, PipelineError> {
        if let Some(reading) = self.contact(frame)? {
            return Ok(*reading);
        }
        let image = self.frames[self.twin(frame)?].image.get(frame)?;
        let grey = background::greatest_step(image.view(), self.runner.reference().image());
        Err(if grey.abs() > background::CLEAR_STEP_GREY {
            PipelineError::OppositeSignal { frame, grey }
        } else {
            PipelineError::NoContact { frame }
        })
    }

    /// The surface of a frame's contact.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?;
    /// let mut press = trial.press(&pipeline)?;
    /// let surface = press.surface(0)?;
    /// let top = surface.surface.heights.iter().copied().filter(|h| h.is_finite()).fold(0.0, f64::max);
    /// // Hertz's pressure read as shading is a hemisphere as high as the contact's radius.
    /// let radius = trial.truth().frames[0].contact_radius_m;
    /// assert!((top / radius - 1.0).abs() < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoContact`], [`PipelineError::Surface`], and those of [`contact`](Self::contact).
    pub fn surface(&mut self, frame: usize) -> Result<&ContactSurface, PipelineError> {
        self.reading(frame)?;
        self.contact(0)?;
        let at = self.twin(frame)?;
        if self.frames[at].surface.is_none() {
            let loaded = &self.frames[at];
            let contact = loaded
                .contact
                .as_ref()
                .ok_or(PipelineError::NoContact { frame })?;
            let first = self.frames[0].contact.as_ref().unwrap_or(contact);
            let image = loaded.image.get(frame)?;
            let surface = self
                .runner
                .surface(frame, image.view(), contact, first.pixels())?;
            self.frames[at].surface = Some(surface);
        }
        self.frames[at]
            .surface
            .as_ref()
            .ok_or(PipelineError::NoContact { frame })
    }

    /// Frees the memory of a frame's surface; it is reconstructed again when it is asked for.
    pub(super) fn forget_surface(&mut self, frame: usize) -> Result<(), PipelineError> {
        let at = self.twin(frame)?;
        self.frames[at].surface = None;
        Ok(())
    }

    /// Control points on a frame's surface, in metres from the frame's first pixel.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let points = press.control_points(0)?;
    /// assert_eq!(points.len(), 60);
    /// // All within the contact, whose middle is the frame's: (86.5, 64.5) pixels.
    /// let radius = 1.1 * trial.truth().frames[0].contact_radius_m;
    /// assert!(points.iter().all(|p| (p.x - 86.5 * 172.4e-6).hypot(p.y - 64.5 * 172.4e-6) < radius));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`surface`](Self::surface).
    pub fn control_points(&mut self, frame: usize) -> Result<&[Point3<f64>], PipelineError> {
        self.surface(frame)?;
        let at = self.twin(frame)?;
        if self.frames[at].points.is_none() {
            let surface = self.frames[at]
                .surface
                .as_ref()
                .ok_or(PipelineError::NoContact { frame })?;
            let points = self.runner.control_points(frame, surface)?;
            self.frames[at].points = Some(points);
        }
        Ok(&known_points(&self.frames, at)?.points)
    }

    /// The matches of the first frame's control points to those of a later frame.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let matching = press.matching(1)?;
    /// let partners: Vec<_> = matching.assignment.iter().flatten().copied().collect();
    /// assert!(partners.len() > 50);
    /// assert_eq!(matching.warped.len(), 60, "where the first frame's points have gone");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Match`] and those of [`control_points`](Self::control_points).
    pub fn matching(&mut self, frame: usize) -> Result<&Matching<f64, 3>, PipelineError> {
        self.control_points(0)?;
        self.control_points(frame)?;
        let at = self.twin(frame)?;
        if self.frames[at].matching.is_none() {
            let (model, target) = (
                known_points(&self.frames, 0)?,
                known_points(&self.frames, at)?,
            );
            let matching = self
                .runner
                .matching([0, frame], &model.points, &target.points)?;
            self.frames[at].matching = Some(matching);
        }
        self.frames[at]
            .matching
            .as_ref()
            .ok_or(PipelineError::NoContact { frame })
    }

    /// The stretch of a face's material points from the first frame to a later one.
    pub(super) fn texture(&mut self, frame: usize) -> Result<TextureStretch, PipelineError> {
        self.reading(0)?;
        self.reading(frame)?;
        let (first, at) = (self.twin(0)?, self.twin(frame)?);
        let (Some(one), Some(two)) = (&self.frames[first].contact, &self.frames[at].contact) else {
            return Err(PipelineError::NoContact { frame });
        };
        let images = [
            self.frames[first].image.get(0)?,
            self.frames[at].image.get(frame)?,
        ];
        let images = images.each_ref().map(|image| image.view());
        self.runner.texture([0, frame], images, [one, two])
    }

    /// The strain between the first frame and a later one; of an object with a flat face by the growth of its area, the same at all points.
    ///
    /// # Errors
    /// [`PipelineError::TooFewMatches`], [`PipelineError::Warp`], [`PipelineError::Strain`] and those of
    /// [`matching`](Self::matching).
    pub fn strain(&mut self, frame: usize) -> Result<&PairStrain, PipelineError> {
        let at = self.twin(frame)?;
        if let Some(poisson_ratio) = self.pipeline().settings().object.flat_face() {
            let readings = [self.reading(0)?, self.reading(frame)?];
            let frames = [0, frame];
            let strain = self
                .runner
                .strain_of_faces(frames, readings.each_ref(), poisson_ratio)?;
            return Ok(self.frames[at].strain.insert(strain));
        }
        self.matching(frame)?;
        if self.frames[at].strain.is_none() {
            let (model, target) = (
                known_points(&self.frames, 0)?,
                known_points(&self.frames, at)?,
            );
            let matching = self.frames[at]
                .matching
                .as_ref()
                .ok_or(PipelineError::NoContact { frame })?;
            let strain = self
                .runner
                .strain([0, frame], model, &target.points, matching)?;
            self.frames[at].strain = Some(strain);
        }
        self.frames[at]
            .strain
            .as_ref()
            .ok_or(PipelineError::NoContact { frame })
    }
}

/// The control points of a frame, which the stage before has sampled.
fn known_points<'f>(
    frames: &'f [Loaded<'_>],
    frame: usize,
) -> Result<&'f ControlPoints, PipelineError> {
    frames[frame]
        .points
        .as_ref()
        .ok_or(PipelineError::NoContact { frame })
}
