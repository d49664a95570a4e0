//! What a press says of its frames, one stage after the other: contact, surface, control points, match, strain.
use super::{KnownContact, Loaded, Press};
use crate::force::{TextureStretch, background_shift, median_shift_outside};
use crate::matching::Matching;
use crate::pipeline::contact::{ContactReading, FrameContact};
use crate::pipeline::error::PipelineError;
use crate::pipeline::pair::{MatchedPoints, PairStrain};
use crate::pipeline::surface::{ContactSurface, ControlPoints};
use nalgebra::Point3;
use ndarray::{Array2, ArrayView2, CowArray, Ix2};

impl<'a> Press<'a> {
    /// The contact of a frame with its force; `None` where nothing touches.
    ///
    /// # Errors
    /// [`PipelineError::Contact`], [`PipelineError::NoSuchFrame`].
    pub fn contact(&mut self, frame: usize) -> Result<Option<&ContactReading>, PipelineError> {
        let at = self.twin(frame)?;
        if self.frames[at].contact.is_none() {
            let image = self.frames[at].image.get(frame)?;
            let mut contact = self.measured(frame, image.view())?;
            let pixels = contact.pixels();
            let mut light_step_grey = None;
            if self.frames[at].image.is_on_demand() {
                let reference = self.runner.reference().image();
                let around = contact.bounds();
                light_step_grey = around
                    .and_then(|contact| median_shift_outside(image.view(), reference, contact));
                contact.mask = Array2::default((0, 0));
            }
            self.frames[at].contact = Some(Box::new(KnownContact {
                contact,
                pixels,
                light_step_grey,
            }));
        }
        let known = self.frames[at].contact.as_ref();
        Ok(known.and_then(|known| known.contact.reading.as_ref()))
    }

    fn measured(
        &mut self,
        frame: usize,
        image: ArrayView2<'_, u8>,
    ) -> Result<FrameContact, PipelineError> {
        let mut contact = FrameContact::default();
        let gauge = self.gauge(frame);
        self.runner.contact(frame, image, gauge, &mut contact)?;
        Ok(contact)
    }

    /// A frame's image and its contact with the mask, which is found again where the frame keeps none.
    fn masked(
        &mut self,
        frame: usize,
    ) -> Result<(CowArray<'a, u8, Ix2>, FrameContact), PipelineError> {
        let at = self.twin(frame)?;
        let image = self.frames[at].image.get(frame)?;
        let contact = match &self.frames[at].contact {
            Some(known) if !self.frames[at].image.is_on_demand() => known.contact.clone(),
            _ => self.measured(frame, image.view())?,
        };
        Ok((image, contact))
    }

    /// The contact of a frame that must have one.
    pub(super) fn reading(&mut self, frame: usize) -> Result<ContactReading, PipelineError> {
        if let Some(reading) = self.contact(frame)? {
            return Ok(*reading);
        }
        let image = self.frames[self.twin(frame)?].image.get(frame)?;
        let reference = self.runner.reference().image();
        Err(match background_shift(image.view(), reference) {
            Some(grey) => PipelineError::OppositeSignal { frame, grey },
            None => PipelineError::NoContact { frame },
        })
    }

    /// The surface of a frame's contact.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// let pipeline = trial.pipeline()?;
    /// let mut press = trial.press(&pipeline)?;
    /// let surface = press.surface(0)?;
    /// let top = surface.surface.heights.iter().copied().filter(|h| h.is_finite()).fold(0.0, f64::max);
    /// // Hertz's pressure read as shading is a hemisphere as high as the contact's radius.
    /// let radius = trial.simulation.truth[0].contact.contact_radius_m;
    /// assert!((top / radius - 1.0).abs() < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::NoContact`], [`PipelineError::Surface`], and those of [`contact`](Self::contact).
    pub fn surface(&mut self, frame: usize) -> Result<&ContactSurface, PipelineError> {
        self.reading(frame)?;
        let at = self.twin(frame)?;
        if self.frames[at].surface.is_none() {
            let pixels = self.contact_pixels(0)?;
            let (image, contact) = self.masked(frame)?;
            let mut surface = Box::new(ContactSurface::empty());
            self.runner
                .surface(frame, image.view(), &contact, pixels, &mut surface)?;
            self.frames[at].surface = Some(surface);
        }
        self.frames[at]
            .surface
            .as_deref()
            .ok_or(PipelineError::NoContact { frame })
    }

    /// Number of the pixels of a frame's contact.
    pub(super) fn contact_pixels(&mut self, frame: usize) -> Result<usize, PipelineError> {
        self.contact(frame)?;
        let known = self.frames[self.twin(frame)?].contact.as_ref();
        Ok(known.map_or(0, |known| known.pixels))
    }

    /// Whether a frame's surface has been reconstructed.
    pub(super) fn has_surface(&self, frame: usize) -> bool {
        self.twin(frame)
            .is_ok_and(|at| self.frames[at].surface.is_some())
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
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let points = press.control_points(0)?;
    /// assert_eq!(points.len(), 60);
    /// // All within the contact, whose middle is the frame's: (86.5, 64.5) pixels.
    /// let radius = 1.1 * trial.simulation.truth[0].contact.contact_radius_m;
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
                .as_deref()
                .ok_or(PipelineError::NoContact { frame })?;
            let mut points = ControlPoints::default();
            self.runner.control_points(frame, surface, &mut points)?;
            self.frames[at].points = Some(points);
        }
        Ok(&known_points(&self.frames, at)?.points)
    }

    /// The matches of the first frame's control points to those of a later frame.
    ///
    /// ```
    /// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
    /// # let camera = Camera::default().coarser(8);
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
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
    pub fn matching(&mut self, frame: usize) -> Result<&Matching<3>, PipelineError> {
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
            self.frames[at].matching = Some(Box::new(matching));
        }
        self.frames[at]
            .matching
            .as_deref()
            .ok_or(PipelineError::NoContact { frame })
    }

    /// The stretch of a face's material points from the first frame to a later one.
    pub(super) fn texture(&mut self, frame: usize) -> Result<TextureStretch, PipelineError> {
        self.reading(0)?;
        self.reading(frame)?;
        let (first_image, first) = self.masked(0)?;
        let (image, contact) = self.masked(frame)?;
        let images = [first_image.view(), image.view()];
        self.runner.texture([0, frame], images, [&first, &contact])
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
            return Ok(self.frames[at].strain.insert(Box::new(strain)));
        }
        self.matching(frame)?;
        if self.frames[at].strain.is_none() {
            let (model, target) = (
                known_points(&self.frames, 0)?,
                known_points(&self.frames, at)?,
            );
            let matching = self.frames[at]
                .matching
                .as_deref()
                .ok_or(PipelineError::NoContact { frame })?;
            let matched = MatchedPoints {
                model,
                target: &target.points,
                assignment: &matching.assignment,
                confidence: &matching.confidence,
            };
            let mut strain = Box::new(PairStrain::empty());
            self.runner.strain([0, frame], &matched, &mut strain)?;
            self.frames[at].strain = Some(strain);
        }
        self.frames[at]
            .strain
            .as_deref()
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
