//! Strain along a stream, counted from one load.
use super::loads::SeenLoads;
use crate::matching::{MatchReport, MatchedPairs};
use crate::pipeline::contact::{ContactReading, FrameContact};
use crate::pipeline::error::PipelineError;
use crate::pipeline::load_reading::LoadReading;
use crate::pipeline::object::Object;
use crate::pipeline::pair::{MatchedPoints, PairStrain};
use crate::pipeline::report::{SkipReason, Stage};
use crate::pipeline::runner::{MatchHistory, StageRunner};
use crate::pipeline::surface::{ContactSurface, ControlPoints};
use ndarray::ArrayView2;

/// Strain of one frame of a stream.
///
/// ```
/// # use std::sync::Arc;
/// # use tactile_imaging::pipeline::Session;
/// # use tactile_simulate::Trial;
/// # use tactile_simulate::{Camera, CalibrationRun, PressOptions};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
/// let mut session = Session::new(&trial.pipeline()?, &[trial.simulation.reference.view()])?;
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
    /// Control points with a partner on the strained surface; 0 of a flat face, whose strain is that of its area.
    pub matched: usize,
    /// How the match went.
    pub report: MatchReport,
    /// The strain at the control points of the load it is counted from.
    pub strain: PairStrain,
}

impl SessionStrain {
    fn empty() -> Self {
        Self {
            from: 0,
            to: 0,
            matched: 0,
            report: MatchReport::default(),
            strain: PairStrain::empty(),
        }
    }
}

/// The frame whose strain is asked for.
pub(super) struct Frame<'a> {
    pub(super) number: u64,
    pub(super) image: ArrayView2<'a, u8>,
    pub(super) contact: &'a FrameContact,
    pub(super) reading: ContactReading,
}

/// The load that strain is counted from.
struct Anchor {
    frame: u64,
    reading: ContactReading,
    /// Pixels of its contact: all surfaces have its grid.
    pixels: usize,
    /// None of a flat face, whose strain is that of its area.
    points: Option<ControlPoints>,
}

/// Memory of the stages before the strain.
struct Buffers {
    surface: ContactSurface,
    points: ControlPoints,
    pairs: MatchedPairs,
}

impl Default for Buffers {
    fn default() -> Self {
        Self {
            surface: ContactSurface::empty(),
            points: ControlPoints::default(),
            pairs: MatchedPairs::default(),
        }
    }
}

impl Buffers {
    /// The control points of a frame's surface, into `points`.
    fn sample(
        &mut self,
        runner: &mut StageRunner,
        frame: &Frame<'_>,
        grid_pixels: usize,
    ) -> Result<(), PipelineError> {
        let (number, surface) = (frame.number as usize, &mut self.surface);
        runner.surface(number, frame.image, frame.contact, grid_pixels, surface)?;
        runner.control_points(number, surface, &mut self.points)
    }
}

/// What is kept from frame to frame.
#[derive(Default)]
pub(super) struct FollowedStrain {
    anchor: Option<Anchor>,
    history: MatchHistory,
    buffers: Buffers,
    last: Option<SessionStrain>,
    loads: Option<SeenLoads>,
}

impl FollowedStrain {
    /// The strain of `frame`; `None` where it is the one that strain is counted from.
    pub(super) fn follow(
        &mut self,
        runner: &mut StageRunner,
        frame: &Frame<'_>,
    ) -> Result<Option<&SessionStrain>, PipelineError> {
        let Some(anchor) = &self.anchor else {
            let pixels = frame.contact.pixels();
            let curved = runner.pipeline().settings().object.flat_face().is_none();
            if curved {
                self.buffers.sample(runner, frame, pixels)?;
            }
            self.anchor = Some(Anchor {
                frame: frame.number,
                reading: frame.reading,
                pixels,
                points: curved.then(|| std::mem::take(&mut self.buffers.points)),
            });
            return Ok(None);
        };
        if anchor.frame == frame.number {
            return Ok(None);
        }
        let known = |last: &SessionStrain| last.to == frame.number;
        if !self.last.as_ref().is_some_and(known) {
            // A strain that fails leaves none behind.
            let mut found = self.last.take().unwrap_or_else(SessionStrain::empty);
            let (buffers, history) = (&mut self.buffers, &mut self.history);
            strain_since(anchor, buffers, history, runner, frame, &mut found)?;
            let step = force_n(&frame.reading) - force_n(&anchor.reading);
            self.loads
                .get_or_insert_with(SeenLoads::new)
                .learn(&frame.reading, Some(found.strain.of_load(step)));
            self.last = Some(found);
        }
        Ok(self.last.as_ref())
    }

    /// The load that strain is counted from, then all others with their strains.
    pub(super) fn loads(
        &self,
        pixel_size_m: [f64; 2],
    ) -> impl Iterator<Item = LoadReading> + Clone + '_ {
        let anchor = self.anchor.as_ref();
        let first = anchor.and_then(|anchor| LoadReading::of(&anchor.reading, None, pixel_size_m));
        let later = self
            .loads
            .iter()
            .flat_map(move |loads| loads.readings(pixel_size_m));
        first.into_iter().chain(later)
    }
}

fn strain_since(
    anchor: &Anchor,
    buffers: &mut Buffers,
    history: &mut MatchHistory,
    runner: &mut StageRunner,
    frame: &Frame<'_>,
    found: &mut SessionStrain,
) -> Result<(), PipelineError> {
    let frames = [anchor.frame as usize, frame.number as usize];
    (found.from, found.to) = (anchor.frame, frame.number);
    let Some(model) = &anchor.points else {
        let readings = [&anchor.reading, &frame.reading];
        let object = runner.pipeline().settings().object;
        let poisson_ratio = object.flat_face().unwrap_or(Object::DEFAULT_POISSON_RATIO);
        found.strain = runner.strain_of_faces(frames, readings, poisson_ratio)?;
        return Ok(());
    };
    buffers.sample(runner, frame, anchor.pixels)?;
    let kept = SkipReason::KeptFromBefore;
    runner.skip(Stage::Surface, frames[1], kept, anchor.pixels);
    let (pairs, target) = (&mut buffers.pairs, &buffers.points.points);
    runner.next_pairs(frames, history, &model.points, target, pairs)?;
    let matched = MatchedPoints {
        model,
        target,
        assignment: &pairs.assignment,
        confidence: &pairs.confidence,
    };
    runner.strain(frames, &matched, &mut found.strain)?;
    found.matched = pairs.assignment.iter().flatten().count();
    found.report.clone_from(&pairs.report);
    Ok(())
}

/// The force of a reading in newtons, zero where it has none.
fn force_n(reading: &ContactReading) -> f64 {
    reading.force_n.map_or(0.0, |force| force.value)
}
