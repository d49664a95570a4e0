//! The stages as functions of values. A press keeps the results, a session the memory that they are
//! written to.
use super::contact::{ContactReading, ContactStage, FrameContact};
use super::error::PipelineError;
use super::flag::Flag;
use super::pipeline::Pipeline;
use super::reference_light::LightChange;
use super::report::{Report, SkipReason, Stage};
use super::specimen::{Object, Specimen};
use super::strain::PairStrain;
use super::surface::{self, ContactSurface, ContactSurfaceWorkspace, ControlPoints};
use crate::elasticity::contact::Layer;
use crate::elasticity::field::StrainField;
use crate::elasticity::modulus::{
    Estimate, LoadSeries, LoadState, ModulusEstimate, ModulusEstimator, Warning,
};
use crate::force::{FaceReading, ForceWorkspace, ReferenceFrame, Source, Uncertain};
use crate::matching::{MatchedPairs, Matching, WarmStart};
use crate::tps::{Pairs, SeriesMemory};
use nalgebra::{Matrix3, Point3};
use ndarray::ArrayView2;
use std::sync::Arc;
use std::time::Instant;

/// Number of consecutive control points that share the errors of a surface.
const NEIGHBOURS: usize = 10;

/// Smallest decrease of the force that is a way back.
const LEAST_FALL: f64 = 0.02;

/// Share of the reference's light that a black frame has lost. A camera's black level may remain.
const LEAST_LOSS: f64 = 0.8;

/// The stages and settings of a press or a session. They are constant.
#[derive(Clone)]
pub(super) struct Stages {
    pub pipeline: Pipeline,
    pub reference: Arc<ReferenceFrame>,
    pub specimen: Specimen,
    /// Change of the light since the calibration, if its light is known.
    pub light: Option<LightChange>,
    /// The contact stage, or its variant for flat faces.
    contact: Arc<dyn ContactStage>,
}

/// Memory that stages reuse from frame to frame, and the record of their work.
#[derive(Default)]
pub(super) struct Scratch {
    pub force: ForceWorkspace,
    surface: ContactSurfaceWorkspace,
    strain: StrainWorkspace,
    pub report: Report,
}

impl Scratch {
    /// Runs a stage and records its time.
    pub(super) fn timed<T>(&mut self, stage: Stage, run: impl FnOnce(&mut Self) -> T) -> T {
        let start = Instant::now();
        let answer = run(self);
        self.report.ran(stage, start.elapsed());
        answer
    }
}

impl Stages {
    pub(super) fn new(pipeline: Pipeline, reference: Arc<ReferenceFrame>) -> Self {
        let specimen = Specimen::of(pipeline.settings().object);
        let contact = match specimen {
            Specimen::Flat(flat) if flat.stated => pipeline.contact().for_flat_faces(),
            _ => None,
        };
        Self {
            contact: contact.unwrap_or_else(|| pipeline.shared_contact()),
            light: pipeline
                .settings()
                .calibrated_light
                .as_ref()
                .and_then(|light| light.changed(&reference)),
            reference,
            specimen,
            pipeline,
        }
    }

    /// Writes contact and force of a frame into `contact`. If the stage gives no force, the gauge's
    /// is used.
    pub(super) fn contact(
        &self,
        scratch: &mut Scratch,
        frame: usize,
        image: ArrayView2<'_, u8>,
        gauge: Option<Estimate>,
        contact: &mut FrameContact,
    ) -> Result<(), PipelineError> {
        scratch.timed(Stage::Contact, |scratch| {
            self.contact
                .measure_into(&mut scratch.force, image, &self.reference, contact)
                .map_err(|source| PipelineError::Contact { frame, source })?;
            contact.check(frame, image.dim())?;
            let settings = self.pipeline.settings();
            if contact.background_step_grey.is_none()
                && let Some(bounds) = contact.bounds()
            {
                let step = self.reference.shift_outside(image, bounds);
                // A twentieth of a grey level is half a per cent of a dim background, and noise
                // exceeds five standard errors once in a million frames.
                let limit = |step: Estimate| 0.05_f64.max(5.0 * step.standard_error);
                let beyond = |step: Estimate| match step.value.abs() > limit(step) {
                    true => step.value,
                    false => 0.0,
                };
                contact.background_step_grey = step.map(beyond);
            }
            if let Specimen::Flat(_) = self.specimen {
                let face = self.face(image, contact);
                if let Some(reading) = &mut contact.reading {
                    reading.face = face;
                    if let Some(face) = face.filter(FaceReading::has_edge) {
                        reading.take_area(face.area_m2);
                    }
                }
            }
            if let Some(reading) = &mut contact.reading {
                // A force that is not read from light has the error that its stage states.
                let own = reading.force_n.is_some() && !self.contact.reads_light();
                let error = |source| match own {
                    true => settings.assumptions.stated(source).unwrap_or(0.0),
                    false => settings.assumptions.error(source),
                };
                let factor = match reading.force_n {
                    Some(_) => self.of_light(error(Source::Coupling)),
                    None => Uncertain::exact(1.0),
                };
                // A line from sums is calibrated in the middle of the frame.
                let unseen = reading.force_n.is_some()
                    && self.contact.reads_light()
                    && settings.checked_gain.is_none();
                let centre = reading.centroid_px.map(|centroid| centroid.value);
                let vignetting = match unseen {
                    true => self.reference.vignetting_at(centre),
                    false => 0.0,
                };
                // Above its saturation level a Hertz profile has less than this fraction of its
                // force.
                let factor = factor
                    .by_relative(Source::Gain, error(Source::Gain))
                    .by_relative(Source::Gain, vignetting)
                    .by_relative(Source::Gain, reading.saturated_share);
                let force = reading.force_n.or_else(|| gauge.map(Uncertain::from));
                reading.force_n = force.map(|force| force * factor);
                reading.peak_stress_pa = reading.peak_stress_pa.map(|stress| stress * factor);
                reading.contact_radius_m = reading
                    .contact_radius_m
                    .by_relative(
                        Source::PixelSize,
                        settings.assumptions.error(Source::PixelSize),
                    )
                    .by_relative(Source::Profile, self.shape_doubt(reading));
            }
            Ok::<(), PipelineError>(())
        })?;
        if contact.reading.is_none() {
            scratch
                .report
                .skipped(Stage::Surface, SkipReason::NoContact);
        }
        Ok(())
    }

    /// Relative error of a force on the way back. See [`ContactStage::unknown_hysteresis`].
    pub(super) fn unknown_hysteresis(&self) -> f64 {
        self.contact.unknown_hysteresis()
    }

    /// Adds the unknown hysteresis to a force on the way back from the largest so far of its press,
    /// and returns the largest including this one: zero without contact, which ends a press.
    pub(super) fn with_hysteresis(&self, greatest_n: f64, contact: &mut FrameContact) -> f64 {
        let error = self.unknown_hysteresis();
        let reading = contact.reading.as_mut();
        let Some((reading, force)) = reading.and_then(|r| r.force_n.map(|force| (r, force))) else {
            let black = contact
                .background_step_grey
                .is_some_and(|step| self.is_black(step));
            return if black { greatest_n } else { 0.0 };
        };
        let noise_n = force.part(Source::Noise).abs();
        if error > 0.0 && force.value + 3.0 * noise_n < (1.0 - LEAST_FALL) * greatest_n {
            reading.unknown_hysteresis = true;
            reading.force_n = Some(force.by_relative(Source::Gain, error));
            let stress = reading.peak_stress_pa;
            reading.peak_stress_pa = stress.map(|s| s.by_relative(Source::Gain, error));
        }
        greatest_n.max(force.value)
    }

    /// The factor for a force read from light: it corrects for light brighter than at the
    /// calibration and for the gain by presses of known force, without which it has this error.
    fn of_light(&self, coupling: f64) -> Uncertain {
        let settings = self.pipeline.settings();
        let mut factor = match settings.checked_gain {
            Some(checked) => Uncertain::of(checked.gain, Source::Coupling).powf(-1.0),
            None => Uncertain::exact(1.0).by(Source::Coupling, coupling),
        };
        if let Some(light) = self.light {
            factor = factor * light.gain.value.recip();
            // Presses of known force used the same light.
            if settings.checked_gain.is_none() {
                factor = factor.by_relative(Source::Gain, light.gain.relative_error());
            }
        }
        factor
    }

    /// Whether the object may be a ball. An object stated to have another shape need not look like
    /// one.
    fn is_ball(&self) -> bool {
        let object = self.pipeline.settings().object;
        matches!(object, Object::Sphere { .. } | Object::Layer { .. })
    }

    /// The relative error of lengths if a contact does not look like the object.
    fn shape_doubt(&self, reading: &ContactReading) -> f64 {
        match self.other_punch(reading) {
            _ if self.is_ball() => reading.shape_doubt(),
            // An error of twice a length marks the length as undetermined.
            Some(punch_m) => (reading.contact_radius_m.value / punch_m)
                .ln()
                .abs()
                .min(2.0),
            None => 0.0,
        }
    }

    /// The radius of the stated punch, if the contact has another one.
    fn other_punch(&self, reading: &ContactReading) -> Option<f64> {
        let Object::FlatPunch { radius_m, .. } = self.pipeline.settings().object else {
            return None;
        };
        // A punch touches with its whole face. The radius of a small blurred disc is known to a
        // tenth.
        let ratio = reading.contact_radius_m.value / radius_m;
        (ratio.ln().abs() > 0.1).then_some(radius_m)
    }

    /// The cautions about a frame: about its contact, the surrounding light, the gauge reading of
    /// its force, or the reason why it may have no contact.
    pub(super) fn cautions(
        &self,
        frame: usize,
        image: ArrayView2<'_, u8>,
        contact: &FrameContact,
        gauge: Option<Estimate>,
    ) -> Vec<Flag> {
        let reference = self.reference.image();
        let Some(reading) = &contact.reading else {
            if contact
                .background_step_grey
                .is_some_and(|step| self.is_black(step))
            {
                return vec![Flag::BlackFrame { frame }];
            }
            let sign = f64::from(self.contact.polarity().sign());
            let shift = self.reference.background_shift(image);
            let caution = shift.map(|grey| match grey * sign < 0.0 {
                true => Flag::OppositeSignal { frame, grey },
                // The light that was corrected, or a contact too faint or too small to be detected.
                false => Flag::LightDrifted { grey },
            });
            return caution.into_iter().collect();
        };
        // A body of unknown shape that does not look like a flat face is compared with a ball: a wet
        // ring or a tacky ball changes its force, too.
        let unknown = matches!(self.pipeline.settings().object, Object::Unknown { .. });
        let is_face = reading.face.as_ref().is_some_and(FaceReading::has_edge);
        let ball = self.is_ball() || unknown && !is_face;
        let own = reading
            .flags(frame)
            .filter(|flag| ball || !matches!(flag, Flag::NotABall { .. } | Flag::NotRound { .. }));
        let mut flags: Vec<Flag> = own.collect();
        let [width, height] = self.contact.pixel_size_m();
        let (rows, columns) = reference.dim();
        let narrowest_m = (rows as f64 * height).min(columns as f64 * width);
        let radius_m = reading.contact_radius_m.value;
        if 2.0 * radius_m > narrowest_m {
            flags.push(Flag::WiderThanFrame { frame, radius_m });
        }
        if let Some(punch_m) = self.other_punch(reading) {
            flags.push(Flag::NotThePunch {
                frame,
                radius_m,
                punch_m,
            });
        }
        if let Some(face) = &reading.face
            && face.sticks()
        {
            let edge_ratio = face.edge_ratio;
            flags.push(Flag::FaceSticks { frame, edge_ratio });
        }
        if let (Some(gauge), Some(force_n)) = (gauge, reading.force_n) {
            let (gauge_n, measured_n) = (gauge.value, force_n.value);
            let apart = (gauge_n - measured_n).abs();
            // A gauge reveals the coupling of the object, so the coupling error must not excuse a
            // difference.
            let error_n = force_n.without(Source::Coupling).standard_error();
            if apart > 3.0 * error_n && apart > 0.02 * gauge_n {
                flags.push(Flag::GaugeDisagrees {
                    frame,
                    measured_n,
                    gauge_n,
                });
            }
        }
        let step = contact.background_step_grey.filter(|&grey| grey != 0.0);
        flags.extend(step.map(|grey| Flag::LightDrifted { grey }));
        flags
    }

    /// Whether a frame without contact, darker than the reference by this on average, has lost its
    /// light: the camera dropped it, or the lamps were off.
    pub(super) fn is_black(&self, step_grey: f64) -> bool {
        // Less than half a grey level is the smallest drift that is named.
        step_grey < -0.5 && step_grey < -LEAST_LOSS * self.reference.mean_grey()
    }

    /// The cautions about all frames: about the calibration, and the change of the light since.
    pub(super) fn standing_cautions(&self) -> impl Iterator<Item = Flag> {
        let doubts = self.contact.doubts().iter().filter_map(Flag::of_pairs);
        // The reading of each frame has the bend.
        let doubts = doubts.filter(|flag| !matches!(flag, Flag::LightNotProportional { .. }));
        doubts.chain(self.light.and_then(|light| light.caution()))
    }

    /// The contact as a flat face.
    fn face(&self, image: ArrayView2<'_, u8>, contact: &FrameContact) -> Option<FaceReading> {
        let (reading, region) = (contact.reading.as_ref()?, contact.region?);
        let images = [image, self.reference.image()];
        let (polarity, size) = (self.contact.polarity(), self.contact.pixel_size_m());
        let mut face = FaceReading::measure(images, region, contact.mask.view(), polarity, size)?;
        if let Some(lens) = self.contact.lens() {
            // With a distorting lens the pixels differ in size.
            let pixel_m2 = size[0] * size[1];
            let place = reading.centroid_px.map(|c| c.value);
            let radius_px = (face.area_m2.value / (std::f64::consts::PI * pixel_m2)).sqrt();
            let growth = lens.mean_pixel_area_m2(place, radius_px) / pixel_m2;
            face.area_m2 = face.area_m2 * growth;
        }
        Some(face)
    }

    /// Reconstructs the surface of a contact in `surface`. All compared surfaces use the grid of a
    /// contact of `grid_pixels` pixels, so that the grid does not contribute to the strain.
    pub(super) fn surface(
        &self,
        scratch: &mut Scratch,
        frame: usize,
        image: ArrayView2<'_, u8>,
        contact: &FrameContact,
        grid_pixels: usize,
        surface: &mut ContactSurface,
    ) -> Result<(), PipelineError> {
        let images = [image, self.reference.image()];
        scratch.timed(Stage::Surface, |scratch| {
            let workspace = &mut scratch.surface;
            surface::reconstruct(
                &self.pipeline,
                workspace,
                images,
                contact,
                grid_pixels,
                surface,
            )
            .map_err(|source| PipelineError::Surface { frame, source })
        })
    }

    /// Writes the control points of a surface into `points`.
    pub(super) fn control_points(
        &self,
        scratch: &mut Scratch,
        frame: usize,
        surface: &ContactSurface,
        points: &mut ControlPoints,
    ) -> Result<(), PipelineError> {
        scratch.timed(Stage::ControlPoints, |scratch| {
            surface::sample(&self.pipeline, &mut scratch.surface, surface, points)
                .map_err(|source| PipelineError::Surface { frame, source })
        })
    }

    /// The matches between the control points of two frames.
    pub(super) fn matching(
        &self,
        scratch: &mut Scratch,
        [from, to]: [usize; 2],
        model: &[Point3<f64>],
        target: &[Point3<f64>],
    ) -> Result<Matching<3>, PipelineError> {
        let matcher = self.pipeline.matcher();
        scratch
            .timed(Stage::Match, |_| matcher.match_points(model, target))
            .map_err(|source| PipelineError::Match { from, to, source })
    }

    /// Writes the pairs of a match that starts from the last answer into `pairs`.
    pub(super) fn next_pairs(
        &self,
        scratch: &mut Scratch,
        [from, to]: [usize; 2],
        warm: &mut WarmStart,
        points: [&[Point3<f64>]; 2],
        pairs: &mut MatchedPairs,
    ) -> Result<(), PipelineError> {
        let matcher = self.pipeline.matcher();
        let [model, target] = points;
        scratch
            .timed(Stage::Match, |_| {
                matcher.match_next_pairs(warm, model, target, pairs)
            })
            .map_err(|source| PipelineError::Match { from, to, source })
    }

    /// Writes the strain between two frames, from the matches of their control points, into
    /// `strain`.
    pub(super) fn strain(
        &self,
        scratch: &mut Scratch,
        frames: [usize; 2],
        matched: &MatchedPoints<'_>,
        strain: &mut PairStrain,
    ) -> Result<(), PipelineError> {
        scratch.timed(Stage::Strain, |scratch| {
            scratch
                .strain
                .strain(&self.pipeline, frames, matched, strain)
        })
    }

    /// Young's modulus. The time of a failed estimate is recorded too.
    pub(super) fn modulus(
        &self,
        scratch: &mut Scratch,
        estimator: &dyn ModulusEstimator,
        loads: &LoadSeries,
    ) -> Result<ModulusEstimate, PipelineError> {
        let read = |load: &LoadState| load.contact_radius_m.is_some();
        // A flat face is measured by its area, not by a radius.
        let curved = !matches!(self.specimen, Specimen::Flat(_));
        if curved && !loads.loads().is_empty() && !loads.loads().iter().any(read) {
            return Err(PipelineError::NoWholeContact);
        }
        let mut estimate = scratch
            .timed(Stage::Modulus, |_| estimator.estimate(loads))
            .map_err(PipelineError::Modulus)?;
        let radii = loads
            .loads()
            .iter()
            .filter_map(|load| load.contact_radius_m);
        let radius_m = radii.map(|radius| radius.value).reduce(f64::max);
        let slips = self.likely_slips(estimate.youngs_modulus_pa, radius_m);
        estimate.warnings.extend(slips);
        Ok(estimate)
    }

    /// Warnings about values that are possible but more often come from a wrong unit or name.
    fn likely_slips(
        &self,
        modulus_pa: f64,
        radius_m: Option<f64>,
    ) -> impl Iterator<Item = Warning> {
        let settings = self.pipeline.settings();
        let layers = settings
            .waveguide
            .as_ref()
            .map_or(&[][..], |guide| guide.layers());
        let far = |ratio: &f64| ratio.ln().abs() > Warning::UNLIKE_GUIDE.ln();
        // The modulus of a deep layer as stiff as the guide under the contact. Solving for it is
        // worth the time only if the sample is not like one of the layers.
        let unlike_layers = layers.iter().all(|layer| {
            (modulus_pa / layer.youngs_modulus_pa).ln().abs() > 0.5 * Warning::UNLIKE_GUIDE.ln()
        });
        let ratio = radius_m
            .filter(|_| unlike_layers && !layers.is_empty())
            .and_then(|radius_m| {
                let nu = layers[0].poisson_ratio;
                let guide_pa = Layer::log_stiffness(layers, radius_m)?.exp() * (1.0 - nu * nu);
                Some(modulus_pa / guide_pa)
            });
        let unlike = ratio
            .filter(far)
            .map(|ratio| Warning::UnlikeGuide { ratio });
        let poisson_ratio = settings.object.poisson_ratio();
        let negative =
            (poisson_ratio < 0.0).then_some(Warning::NegativePoissonRatio { poisson_ratio });
        unlike.into_iter().chain(negative)
    }
}

/// The pairs of a match between the control points of two frames.
#[derive(Clone, Copy)]
pub(super) struct MatchedPoints<'a> {
    pub model: &'a ControlPoints,
    pub target: &'a [Point3<f64>],
    /// Partner of each point of the model.
    pub assignment: &'a [Option<usize>],
    pub confidence: &'a [f64],
}

/// Working memory of the strain stage.
#[derive(Default)]
struct StrainWorkspace {
    warp: SeriesMemory,
    sources: Vec<Point3<f64>>,
    targets: Vec<Point3<f64>>,
    weights: Vec<f64>,
    gradients: Vec<Matrix3<f64>>,
}

impl StrainWorkspace {
    /// Stores the pairs of a match.
    fn take(&mut self, matched: &MatchedPoints<'_>) {
        self.sources.clear();
        self.targets.clear();
        self.weights.clear();
        let points = matched.model.points.iter().zip(matched.assignment);
        for ((source, partner), &weight) in points.zip(matched.confidence) {
            let partner = partner.and_then(|partner| matched.target.get(partner));
            if let Some(target) = partner.filter(|_| weight > 0.0) {
                self.sources.push(*source);
                self.targets.push(*target);
                self.weights.push(weight);
            }
        }
    }

    /// Strain, at the first frame's control points, of the warp through the matches, weighted by
    /// their confidence.
    ///
    /// The matcher's own warp follows every point. Its gradient normal to the surface, where no two
    /// points lie behind each other, would be noise. The default warp here is affine, because a
    /// finer one would fit the errors of reconstructed surfaces, which neighbouring points share.
    fn strain(
        &mut self,
        pipeline: &Pipeline,
        [from, to]: [usize; 2],
        matched: &MatchedPoints<'_>,
        strain: &mut PairStrain,
    ) -> Result<(), PipelineError> {
        self.take(matched);
        // Twice the four affine terms of a spline in space.
        let expected = 8;
        let found = self.sources.len();
        if found < expected {
            return Err(PipelineError::TooFewMatches {
                from,
                to,
                expected,
                found,
            });
        }
        let model = &matched.model.points;
        self.gradients.clear();
        self.gradients.resize(model.len(), Matrix3::zeros());
        let pairs = Pairs {
            sources: &self.sources,
            targets: &self.targets,
            weights: Some(&self.weights),
        };
        pipeline
            .warp()
            .jacobians_through(&mut self.warp, pairs, model, &mut self.gradients)
            .map_err(|source| PipelineError::Warp { from, to, source })?;
        let gradients = self.gradients.iter_mut();
        gradients.for_each(|g| *g -= Matrix3::identity());
        let measure = pipeline.strain();
        strain
            .field
            .set_gradients(&self.gradients, None, measure)
            .map_err(|source| PipelineError::Strain { from, to, source })?;
        strain.measure = measure.name();
        strain.summary = strain.field.summary();
        let noise = StrainField::mean_error(
            &self.sources,
            &self.targets,
            matched.model.grid_m,
            NEIGHBOURS,
        );
        let errors = &mut strain.summary.standard_error;
        errors.zip_apply(&noise, |error, noise| *error = error.hypot(noise));
        // Normal to the surface the strain follows from the height: ½ (h₂²/h₁² − 1). Its error is
        // common to both loads apart from half a cell of the grid.
        let height = |points: &[Point3<f64>]| points.iter().fold(0.0, |h: f64, p| h.max(p.z));
        let [first, last] = [model.as_slice(), matched.target].map(height);
        let half_cell = 0.5 * matched.model.grid_m;
        let of_height = (last / first).powi(2) * (half_cell / first).hypot(half_cell / last);
        if of_height.is_finite() {
            errors[(2, 2)] = errors[(2, 2)].hypot(of_height);
        }
        Ok(())
    }
}
