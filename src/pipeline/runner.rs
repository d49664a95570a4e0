//! Runs the stages of a pipeline one at a time, for a press and a session alike: times every run, and records what was skipped.
use super::composition::Pipeline;
use super::contact::{ContactReading, ContactStage, FrameContact};
use super::error::PipelineError;
use super::load_reading::{self, LoadReading};
use super::pair::{self, MatchedPoints, PairStrain, StrainWorkspace};
use super::report::{Report, SkipReason, Stage};
use super::surface::{self, ContactSurface, ControlPoints, SurfaceWorkspace};
use crate::elasticity::modulus::{LoadSeries, ModulusEstimate, ModulusEstimator, UniaxialLoads};
use crate::force::{
    Estimate, FaceReading, FaceWorkspace, ForceWorkspace, FrameCondition, ReferenceFrame,
    TextureStretch, texture_spots,
};
use crate::matching::{MatchError, MatchedPairs, Matching, WarmStart};
use nalgebra::{Point2, Point3};
use ndarray::ArrayView2;
use std::sync::Arc;
use std::time::Instant;

/// How skips enter the report.
#[derive(Clone, Copy, Debug)]
pub(super) enum SkipRecords {
    /// One entry for every skip, with its frame.
    EachFrame,
    /// One entry for every kind of skip, its savings summed: a stream's report must not grow.
    Summed,
}

/// Where the last match of a stream ended.
#[derive(Default)]
pub(super) struct MatchHistory {
    warm: WarmStart,
    /// Iterations of the first match, which had nothing to start from.
    first_iterations: Option<usize>,
}

/// A pipeline at work on the frames of one sensor.
pub(super) struct StageRunner {
    pipeline: Pipeline,
    /// In place of the pipeline's, where it has one for objects of this kind.
    contact: Option<Arc<dyn ContactStage>>,
    reference: Arc<ReferenceFrame>,
    force: ForceWorkspace,
    face: FaceWorkspace,
    surface: SurfaceWorkspace,
    strain: StrainWorkspace,
    skip_records: SkipRecords,
    report: Report,
}

impl StageRunner {
    pub(super) fn new(
        pipeline: Pipeline,
        reference: Arc<ReferenceFrame>,
        skip_records: SkipRecords,
    ) -> Self {
        let known_flat = pipeline.settings().object.is_flat();
        let contact = known_flat.then(|| pipeline.contact().for_flat_faces());
        Self {
            contact: contact.flatten(),
            pipeline,
            reference,
            force: ForceWorkspace::default(),
            face: FaceWorkspace::default(),
            surface: SurfaceWorkspace::default(),
            strain: StrainWorkspace::default(),
            skip_records,
            report: Report::default(),
        }
    }

    pub(super) fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    pub(super) fn reference(&self) -> &Arc<ReferenceFrame> {
        &self.reference
    }

    pub(super) fn report(&self) -> &Report {
        &self.report
    }

    /// Records that work on a frame was left out.
    pub(super) fn skip(&mut self, stage: Stage, frame: usize, reason: SkipReason, saved: usize) {
        match self.skip_records {
            SkipRecords::EachFrame => self.report.skipped(stage, frame, reason, saved),
            SkipRecords::Summed => self.report.count_skip(stage, reason, saved),
        }
    }

    /// Measures the contact of a frame into `contact`.
    pub(super) fn contact(
        &mut self,
        frame: usize,
        image: ArrayView2<'_, u8>,
        gauge: Option<Estimate>,
        contact: &mut FrameContact,
    ) -> Result<(), PipelineError> {
        let start = Instant::now();
        let stage = self.contact.as_deref().unwrap_or(self.pipeline.contact());
        stage
            .measure(&mut self.force, image, &self.reference, gauge, contact)
            .map_err(|source| PipelineError::Contact { frame, source })?;
        check_mask(frame, image.dim(), contact)?;
        self.face(image, contact);
        self.report.ran(Stage::Contact, start.elapsed());
        let pixels = image.len();
        match contact.region {
            None => self.skip(Stage::Surface, frame, SkipReason::NoContact, pixels),
            Some(region) if self.pipeline.settings().skips.outside_contact => {
                let saved = pixels - region.rows() * region.columns();
                self.skip(Stage::Surface, frame, SkipReason::OutsideContact, saved);
            }
            Some(_) => {}
        }
        Ok(())
    }

    /// Reads a contact as a flat face, where the object may have one.
    fn face(&mut self, image: ArrayView2<'_, u8>, contact: &mut FrameContact) {
        let stage = self.pipeline.contact();
        let may_be_flat = self.pipeline.settings().object.flat_face().is_some();
        let (true, Some(region)) = (may_be_flat && contact.reading.is_some(), contact.region)
        else {
            return;
        };
        let images = [image, self.reference.image()];
        let mask = contact.mask.view();
        let (polarity, pixel_size_m) = (stage.polarity(), stage.pixel_size_m());
        let mut face = self
            .face
            .measure(images, region, mask, polarity, pixel_size_m);
        if let (Some(face), Some(lens), Some(reading)) = (&mut face, stage.lens(), &contact.reading)
        {
            // Pixels of a lens that distorts differ in size.
            let [hx, hy] = stage.pixel_size_m();
            let place = reading.centroid_px.map(|c| c.value);
            let radius_px = (face.area_m2.value / (std::f64::consts::PI * hx * hy)).sqrt();
            let growth = lens.mean_pixel_area_m2(place, radius_px) / (hx * hy);
            face.area_m2 = face.area_m2 * growth;
        }
        if let Some(reading) = &mut contact.reading {
            reading.face = face;
            if let Some(face) = face.filter(FaceReading::has_edge) {
                reading.take_area(face.area_m2);
            }
        }
    }

    /// What the last measured frame shows of the sensor outside the contact; `None` where the contact stage does not look there.
    pub(super) fn condition(&mut self) -> Option<FrameCondition> {
        self.force.detector.condition(&self.reference)
    }

    /// Reconstructs the surface of a contact into `surface`. All surfaces that are compared have one grid, so that what the grid does to them leaves no
    /// strain: the grid for a contact of `grid_pixels` pixels.
    pub(super) fn surface(
        &mut self,
        frame: usize,
        image: ArrayView2<'_, u8>,
        contact: &FrameContact,
        grid_pixels: usize,
        surface: &mut ContactSurface,
    ) -> Result<(), PipelineError> {
        let start = Instant::now();
        let images = [image, self.reference.image()];
        let (pipeline, workspace) = (&self.pipeline, &mut self.surface);
        let widened;
        let contact = if pipeline.settings().skips.outside_contact {
            contact
        } else {
            widened = contact.widened(image.dim());
            &widened
        };
        surface::reconstruct(pipeline, workspace, images, contact, grid_pixels, surface)
            .map_err(|source| PipelineError::Surface { frame, source })?;
        self.report.ran(Stage::Surface, start.elapsed());
        Ok(())
    }

    /// Samples the control points of a surface into `points`.
    pub(super) fn control_points(
        &mut self,
        frame: usize,
        surface: &ContactSurface,
        points: &mut ControlPoints,
    ) -> Result<(), PipelineError> {
        let start = Instant::now();
        surface::sample(&self.pipeline, &mut self.surface, surface, points)
            .map_err(|source| PipelineError::Surface { frame, source })?;
        self.report.ran(Stage::ControlPoints, start.elapsed());
        Ok(())
    }

    /// Matches the control points of two frames.
    pub(super) fn matching(
        &mut self,
        frames: [usize; 2],
        model: &[Point3<f64>],
        target: &[Point3<f64>],
    ) -> Result<Matching<3>, PipelineError> {
        self.matched(frames, |pipeline| {
            pipeline.matcher().match_points(model, target)
        })
    }

    /// The pairs of a match that begins where the last one ended, unless that skip is turned off.
    pub(super) fn next_pairs(
        &mut self,
        frames: [usize; 2],
        history: &mut MatchHistory,
        model: &[Point3<f64>],
        target: &[Point3<f64>],
        pairs: &mut MatchedPairs,
    ) -> Result<(), PipelineError> {
        if !self.pipeline.settings().skips.last_answer {
            let Matching {
                assignment,
                confidence,
                report,
                ..
            } = self.matching(frames, model, target)?;
            (pairs.assignment, pairs.confidence, pairs.report) = (assignment, confidence, report);
            return Ok(());
        }
        let warm = &mut history.warm;
        self.matched(frames, |pipeline| {
            let matcher = pipeline.matcher();
            matcher.match_next_pairs(warm, model, target, pairs)
        })?;
        let iterations = pairs.report.iterations;
        match history.first_iterations {
            None => history.first_iterations = Some(iterations),
            Some(first) => {
                let saved = first.saturating_sub(iterations);
                self.skip(Stage::Match, frames[1], SkipReason::NearLastAnswer, saved);
            }
        }
        Ok(())
    }

    fn matched<M>(
        &mut self,
        [from, to]: [usize; 2],
        run: impl FnOnce(&Pipeline) -> Result<M, MatchError>,
    ) -> Result<M, PipelineError> {
        let start = Instant::now();
        let matching =
            run(&self.pipeline).map_err(|source| PipelineError::Match { from, to, source })?;
        self.report.ran(Stage::Match, start.elapsed());
        Ok(matching)
    }

    /// Works out the strain between two frames, from the match of their control points, into `strain`.
    pub(super) fn strain(
        &mut self,
        frames: [usize; 2],
        matched: &MatchedPoints<'_>,
        strain: &mut PairStrain,
    ) -> Result<(), PipelineError> {
        let start = Instant::now();
        self.strain
            .strain(&self.pipeline, frames, matched, strain)?;
        self.report.ran(Stage::Strain, start.elapsed());
        Ok(())
    }

    /// Works out the strain between two loads of a specimen with a flat face.
    pub(super) fn strain_of_faces(
        &mut self,
        frames: [usize; 2],
        readings: [&ContactReading; 2],
        poisson_ratio: f64,
    ) -> Result<PairStrain, PipelineError> {
        let start = Instant::now();
        let strain = pair::of_faces(&self.pipeline, frames, readings, poisson_ratio)?;
        self.report.ran(Stage::Strain, start.elapsed());
        Ok(strain)
    }

    /// The stretch of a face between two frames by the material points of its texture.
    pub(super) fn texture(
        &mut self,
        [from, to]: [usize; 2],
        images: [ArrayView2<'_, u8>; 2],
        contacts: [&FrameContact; 2],
    ) -> Result<TextureStretch, PipelineError> {
        let start = Instant::now();
        let stage = self.pipeline.contact();
        let [hx, hy] = stage.pixel_size_m();
        let polarity = stage.polarity();
        let none = PipelineError::NoTexture { from, to };
        let mut points = [Vec::new(), Vec::new()];
        let mut faces = Vec::with_capacity(2);
        let mut centres = Vec::with_capacity(2);
        for ((image, contact), points) in images.into_iter().zip(contacts).zip(&mut points) {
            let (Some(region), Some(reading)) = (contact.region, contact.reading) else {
                return Err(none);
            };
            let pair = [image, self.reference.image()];
            *points = texture_spots(pair, region, contact.mask.view(), polarity, [hx, hy]);
            let [x, y] = reading.centroid_px.map(|c| c.value);
            centres.push(Point2::new(x * hx, y * hy));
            faces.push(reading.face.ok_or_else(|| none.clone())?);
        }
        let pixel_m = (hx * hy).sqrt();
        let growth = (faces[1].area_m2.value / faces[0].area_m2.value).sqrt();
        let predict = |p: &Point2<f64>| centres[1] + growth * (p - centres[0]);
        let [one, two] = &points;
        let stretch = TextureStretch::between([one, two], predict, 4.0 * pixel_m);
        self.report.ran(Stage::Match, start.elapsed());
        stretch.ok_or(none)
    }

    /// The loads of a specimen with a flat face: its areas turned into strains.
    pub(super) fn uniaxial_series(
        &self,
        readings: impl Iterator<Item = LoadReading> + Clone,
        poisson_ratio: f64,
    ) -> Result<LoadSeries, PipelineError> {
        let series = self.load_series(readings)?;
        let measure = self.pipeline.strain();
        let uniaxial = UniaxialLoads::new(&series, poisson_ratio, measure);
        Ok(uniaxial.map_err(PipelineError::Modulus)?.series)
    }

    /// What estimators take: the loads, and the errors that all share.
    pub(super) fn load_series(
        &self,
        readings: impl Iterator<Item = LoadReading> + Clone,
    ) -> Result<LoadSeries, PipelineError> {
        load_reading::series(readings, self.pipeline.settings())
    }

    /// Estimates the modulus. An estimate that fails is timed too: it has looked at the data.
    pub(super) fn modulus(
        &mut self,
        estimator: &dyn ModulusEstimator,
        loads: &LoadSeries,
    ) -> Result<ModulusEstimate, PipelineError> {
        let start = Instant::now();
        let estimate = estimator.estimate(loads).map_err(PipelineError::Modulus);
        self.report.ran(Stage::Modulus, start.elapsed());
        estimate
    }
}

/// Refuses a mask that does not fill its region, and a region that does not lie in the frame: a stage may be a user's own.
fn check_mask(
    frame: usize,
    image: (usize, usize),
    contact: &FrameContact,
) -> Result<(), PipelineError> {
    let Some(at) = contact.region else {
        return Ok(());
    };
    let ordered = at.row_start <= at.row_end && at.column_start <= at.column_end;
    let inside = ordered && at.row_end <= image.0 && at.column_end <= image.1;
    let mask = contact.mask.dim();
    if inside && mask == (at.rows(), at.columns()) {
        return Ok(());
    }
    let region = (
        at.row_end.saturating_sub(at.row_start),
        at.column_end.saturating_sub(at.column_start),
    );
    Err(PipelineError::ContactMask {
        frame,
        mask,
        region,
        image,
    })
}
