//! Strain along a stream, counted from one load.
use super::loads::SeenLoads;
use crate::elasticity::modulus::SharedErrors;
use crate::elasticity::modulus::{Estimate, LoadState};
use crate::force::ReferenceFrame;
use crate::matching::{MatchReport, WarmStart};
use crate::pipeline::composition::Pipeline;
use crate::pipeline::contact::{ContactReading, FrameContact};
use crate::pipeline::error::PipelineError;
use crate::pipeline::load_reading::{LoadReading, radius_with_floor, split_errors};
use crate::pipeline::pair::{self, PairStrain};
use crate::pipeline::report::{Report, SkipReason, Stage};
use crate::pipeline::settings::Settings;
use crate::pipeline::surface::{self, SurfaceWorkspace};
use nalgebra::Point3;
use ndarray::ArrayView2;
use std::time::Instant;

/// Strain of one frame of a stream.
///
/// ```
/// # use std::sync::Arc;
/// # use tactile_imaging::pipeline::{Session, Trial};
/// # use tactile_imaging::simulate::{Camera, CalibrationOptions, PressOptions};
/// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// let mut session = Session::new(&trial.pipeline()?, trial.simulation.reference.view())?;
/// for frame in &trial.simulation.frames {
///     session.push(frame.view())?;
///     if let Some(found) = session.strain()? {
///         assert_eq!((found.from, found.to), (0, 1));
///         assert!(found.strain.summary.mean[(0, 0)] > 0.0, "the load rose: the surface grew");
///     }
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct SessionStrain {
    /// The frame from whose load strain is counted, from 0.
    pub from: u64,
    /// The strained frame.
    pub to: u64,
    /// Control points with a partner on the strained surface.
    pub matched: usize,
    /// How the match went.
    pub report: MatchReport<f64>,
    /// The strain at the control points of the load it is counted from.
    pub strain: PairStrain,
}

/// The frame whose strain is asked for.
pub(super) struct Frame<'a> {
    pub(super) number: u64,
    pub(super) image: ArrayView2<'a, u8>,
    pub(super) reference: &'a ReferenceFrame,
    pub(super) contact: &'a FrameContact,
    pub(super) reading: ContactReading,
}

/// The load that strain is counted from.
struct Anchor {
    frame: u64,
    reading: ContactReading,
    /// Pixels of its contact: all surfaces have its grid.
    pixels: usize,
    points: Vec<Point3<f64>>,
    /// The surfaces' pixel.
    grid_m: f64,
}

/// What is kept from frame to frame.
#[derive(Default)]
pub(super) struct FollowedStrain {
    anchor: Option<Anchor>,
    warm: WarmStart,
    surface: SurfaceWorkspace,
    last: Option<SessionStrain>,
    loads: Option<SeenLoads>,
    /// Iterations of the first match.
    first_iterations: usize,
}

impl FollowedStrain {
    /// The strain of `frame`; `None` where it is the one that strain is counted from.
    pub(super) fn follow(
        &mut self,
        pipeline: &Pipeline,
        frame: &Frame<'_>,
        report: &mut Report,
    ) -> Result<Option<&SessionStrain>, PipelineError> {
        match &self.anchor {
            None => {
                let pixels = frame.contact.mask.iter().filter(|m| **m).count();
                let (points, grid_m) = self.points(pipeline, frame, pixels, report)?;
                let reading = frame.reading;
                self.anchor = Some(Anchor {
                    frame: frame.number,
                    reading,
                    pixels,
                    points,
                    grid_m,
                });
                return Ok(None);
            }
            Some(anchor) if anchor.frame == frame.number => return Ok(None),
            Some(_) => {}
        }
        if self
            .last
            .as_ref()
            .is_none_or(|last| last.to != frame.number)
        {
            self.last = None;
            self.last = self.measure(pipeline, frame, report)?;
        }
        Ok(self.last.as_ref())
    }

    /// Control points of a frame's surface, and its pixel.
    fn points(
        &mut self,
        pipeline: &Pipeline,
        frame: &Frame<'_>,
        pixels: usize,
        report: &mut Report,
    ) -> Result<(Vec<Point3<f64>>, f64), PipelineError> {
        let failed = |source| PipelineError::Surface {
            frame: frame.number as usize,
            source,
        };
        let start = Instant::now();
        let images = [frame.image, frame.reference.image()];
        let surface = if pipeline.settings().skips.outside_contact {
            surface::reconstruct(pipeline, &mut self.surface, images, frame.contact, pixels)
        } else {
            let contact = frame.contact.widened(frame.image.dim());
            surface::reconstruct(pipeline, &mut self.surface, images, &contact, pixels)
        };
        let surface = surface.map_err(failed)?;
        report.ran(Stage::Surface, start.elapsed());
        let start = Instant::now();
        let points = surface::sample(pipeline, &surface).map_err(failed)?;
        report.ran(Stage::ControlPoints, start.elapsed());
        Ok((points, surface.pixel_size_m[0].max(surface.pixel_size_m[1])))
    }

    fn measure(
        &mut self,
        pipeline: &Pipeline,
        frame: &Frame<'_>,
        report: &mut Report,
    ) -> Result<Option<SessionStrain>, PipelineError> {
        let Some(pixels) = self.anchor.as_ref().map(|anchor| anchor.pixels) else {
            return Ok(None);
        };
        let (target, _) = self.points(pipeline, frame, pixels, report)?;
        let Some(anchor) = &self.anchor else {
            return Ok(None);
        };
        report.count_skip(Stage::Surface, SkipReason::KeptFromBefore, anchor.pixels);
        let frames = [anchor.frame as usize, frame.number as usize];
        let start = Instant::now();
        let found = if pipeline.settings().skips.last_answer {
            pair::match_next(pipeline, frames, &mut self.warm, &anchor.points, &target)?
        } else {
            pair::match_points(pipeline, frames, &anchor.points, &target)?
        };
        report.ran(Stage::Match, start.elapsed());
        if self.first_iterations == 0 {
            self.first_iterations = found.report.iterations;
        } else if pipeline.settings().skips.last_answer {
            let saved = self
                .first_iterations
                .saturating_sub(found.report.iterations);
            report.count_skip(Stage::Match, SkipReason::NearLastAnswer, saved);
        }
        let start = Instant::now();
        let strain = pair::strain(
            pipeline,
            frames,
            &anchor.points,
            &target,
            &found,
            anchor.grid_m,
        )?;
        report.ran(Stage::Strain, start.elapsed());
        let step = force_n(&frame.reading) - force_n(&anchor.reading);
        let zz = |m: &nalgebra::Matrix3<f64>| m[(2, 2)];
        // (31) takes the strain's size; its sign says whether the load rose.
        let value = zz(&strain.summary.mean).abs().copysign(step);
        let load = Estimate::new(value, zz(&strain.summary.standard_error));
        self.loads
            .get_or_insert_with(SeenLoads::new)
            .learn(&frame.reading, Some(load));
        let matched = found.assignment.iter().flatten().count();
        Ok(Some(SessionStrain {
            from: anchor.frame,
            to: frame.number,
            matched,
            report: found.report,
            strain,
        }))
    }

    /// The load that strain is counted from, then all others with their strains, and the errors they share.
    pub(super) fn loads(
        &self,
        pixel_size_m: [f64; 2],
        settings: &Settings,
    ) -> (Vec<LoadState<f64>>, SharedErrors<f64>) {
        let anchor = self.anchor.as_ref().map(|anchor| &anchor.reading);
        let first = anchor.and_then(|reading| {
            let a = reading.contact_radius_m;
            Some(LoadReading {
                force_n: reading.force_n?.value,
                noise_n: reading.force_noise_n,
                calibration_n: reading.force_calibration_n,
                radius_m: radius_with_floor(a.value, a.standard_error, pixel_size_m),
            })
        });
        let later = self
            .loads
            .iter()
            .flat_map(|loads| loads.readings(pixel_size_m));
        let (mut loads, shared) = split_errors(first.into_iter().chain(later), settings);
        let strains = self.loads.iter().flat_map(SeenLoads::strains);
        for (load, strain) in loads
            .iter_mut()
            .skip(usize::from(first.is_some()))
            .zip(strains)
        {
            load.mean_strain = strain;
        }
        (loads, shared)
    }
}

/// The force of a reading in newtons, nought where it has none.
fn force_n(reading: &ContactReading) -> f64 {
    reading.force_n.map_or(0.0, |force| force.value)
}
