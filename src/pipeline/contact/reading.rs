//! What a frame says of its contact, and where in the frame the contact is.
use crate::force::{
    BoundingBox, Estimate, FaceReading, ForceMeasurement, ProfileShape, StopReason,
};
use ndarray::Array2;

/// What a frame says of its contact.
///
/// ```
/// use tactile_imaging::pipeline::{ContactReading, Object, Pipeline};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// // 1.005 N over a disc of 1 mm radius.
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// let contact: ContactReading = *press.contact(0)?.expect("a contact");
/// assert!((contact.contact_radius_m.value / 1e-3 - 1.0).abs() < 0.01);
/// let force = contact.force_n.expect("a calibrated sensor");
/// assert!((force.value / 1.005 - 1.0).abs() < 0.01);
/// assert_eq!(contact.flags(0).count(), 0, "nothing to caution of");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ContactReading {
    /// Normal force in newtons; `None` where neither calibration nor gauge gives it.
    pub force_n: Option<Estimate>,
    /// The part of the force's error that comes from noise in the frames, in newtons.
    pub force_noise_n: f64,
    /// The part that comes from the calibration and is common to all frames, in newtons.
    pub force_calibration_n: f64,
    /// Contact radius in metres; of a flat face √(A/π), that of a disc of its area.
    pub contact_radius_m: Estimate,
    /// Indentation in metres, where the sensor measures depth.
    pub indentation_m: Option<Estimate>,
    /// Centroid (x, y) in pixels.
    pub centroid_px: [Estimate; 2],
    /// Area of the contact in square metres.
    pub area_m2: f64,
    /// Greatest signal: grey levels above (or below) the reference.
    pub peak_grey: f64,
    /// Share of the contact's pixels that are saturated.
    pub saturated_share: f64,
    /// The signal lies outside the range of the calibration.
    pub out_of_calibration: bool,
    /// The contact reaches the frame's edge: part of it may be missing.
    pub touches_edge: bool,
    /// Other contacts in the frame: this one is the largest.
    pub other_contacts: usize,
    /// Whether the fit of the contact's profile converged (no fit counts as converged).
    pub converged: bool,
    /// Misfit of the pressure's profile as a share of its peak, where it is not that of a ball's contact.
    pub profile_misfit: Option<f64>,
    /// The contact as a flat face, where the object may have one and the contact is large enough to tell.
    pub face: Option<FaceReading>,
    /// Longer over shorter half axis of the outline, less one, where it is not round.
    pub elongation: Option<f64>,
    /// Departure of the calibration's pairs from a line at half scale, as a share of the full scale, where the pairs show one.
    pub calibration_bend: Option<f64>,
}

impl ContactReading {
    /// F/(π a²) in pascals.
    pub(crate) fn mean_stress_pa(&self) -> Option<Estimate> {
        let (force, radius) = (self.force_n?, self.contact_radius_m);
        let value = force.value / (std::f64::consts::PI * radius.value * radius.value);
        let relative =
            (force.standard_error / force.value).hypot(2.0 * radius.standard_error / radius.value);
        Some(Estimate::new(value, value.abs() * relative))
    }

    /// The force is the gauge's.
    pub(super) fn take_gauge(&mut self, gauge: Option<Estimate>) {
        self.force_n = gauge;
        self.force_noise_n = gauge.map_or(0.0, |gauge| gauge.standard_error);
        self.force_calibration_n = 0.0;
        self.out_of_calibration = false;
    }

    /// The contact is a flat face of that area: the radius is that of a disc as large.
    pub(in crate::pipeline) fn take_area(&mut self, area_m2: Estimate) {
        let radius_m = (area_m2.value / std::f64::consts::PI).sqrt();
        self.area_m2 = area_m2.value;
        self.contact_radius_m = Estimate::new(
            radius_m,
            0.5 * radius_m * area_m2.standard_error / area_m2.value,
        );
    }

    pub(super) fn of_light(force: &ForceMeasurement) -> Option<Self> {
        let (contact, reading, radius) = (force.contact?, force.reading?, force.contact_radius_m?);
        Some(Self {
            force_n: Some(force.force_n),
            force_noise_n: reading.noise_n,
            force_calibration_n: reading.calibration_n,
            contact_radius_m: radius,
            indentation_m: None,
            centroid_px: contact.centroid_px,
            area_m2: force.contact_area_m2?,
            peak_grey: force.profile.map_or(contact.peak, |p| p.peak.value),
            saturated_share: contact.saturated_px as f64 / contact.area_px as f64,
            out_of_calibration: reading.out_of_range,
            touches_edge: contact.touches_edge,
            other_contacts: contact.other_contacts,
            converged: force
                .profile
                .is_none_or(|p| p.stop == StopReason::Converged),
            profile_misfit: force
                .profile
                .filter(|p| p.shape == ProfileShape::NotHertz)
                .map(|p| p.radial_misfit.hypot(p.azimuthal_misfit)),
            face: None,
            elongation: force.elongation,
            calibration_bend: None,
        })
    }
}

/// What the first stage leaves behind: the reading, and where in the frame the contact is.
///
/// ```
/// use tactile_imaging::force::{ForceWorkspace, ReferenceFrame};
/// use tactile_imaging::pipeline::{ContactStage, FrameContact, LightContact};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// let stage = LightContact::from_pairs(&pairs, [50e-6; 2])?;
/// let reference = ReferenceFrame::new(hertz(0.0).view())?;
/// let (mut workspace, mut contact) = (ForceWorkspace::default(), FrameContact::default());
/// stage.measure(&mut workspace, hertz(120.0).view(), &reference, None, &mut contact)?;
/// let region = contact.region.expect("a contact");
/// assert_eq!(contact.mask.dim(), (region.rows(), region.columns()));
/// assert!(region.row_start <= 12 && region.row_end >= 52, "20 pixels around row 32");
/// // Without contact: how far the light is from the reference's.
/// stage.measure(&mut workspace, hertz(0.0).view(), &reference, None, &mut contact)?;
/// assert_eq!((contact.reading, contact.background_step_grey), (None, Some(0.0)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct FrameContact {
    /// The reading; `None` without contact.
    pub reading: Option<ContactReading>,
    /// The box worked on: the contact's, with a margin of at least one pixel (but at the frame's edge).
    pub region: Option<BoundingBox>,
    /// The contact's pixels within the box.
    pub mask: Array2<bool>,
    /// Mean of frame minus reference in grey levels, of a frame without contact; `None` with one, or where it is not known.
    pub background_step_grey: Option<f64>,
}

impl FrameContact {
    /// Number of the contact's pixels.
    pub(in crate::pipeline) fn pixels(&self) -> usize {
        let count = |pixels: &[bool]| {
            // Short runs fit a byte, whose sums are wide instructions.
            let sum = |run: &[bool]| run.iter().map(|inside| u8::from(*inside)).sum::<u8>();
            pixels.chunks(128).map(|run| usize::from(sum(run))).sum()
        };
        match self.mask.as_slice() {
            Some(pixels) => count(pixels),
            None => self.mask.iter().filter(|inside| **inside).count(),
        }
    }

    /// The smallest box of the frame that holds the contact's pixels: `region` may be wider.
    pub(in crate::pipeline) fn bounds(&self) -> Option<BoundingBox> {
        let region = self.region?;
        let mut bounds: Option<BoundingBox> = None;
        for (row, pixels) in self.mask.rows().into_iter().enumerate() {
            // Whole lines outside are passed over in wide instructions.
            let any = |all: bool, inside: &bool| all | inside;
            if pixels
                .as_slice()
                .is_some_and(|pixels| !pixels.iter().fold(false, any))
            {
                continue;
            }
            let Some(first) = pixels.iter().position(|inside| *inside) else {
                continue;
            };
            let last = pixels.iter().rposition(|inside| *inside).unwrap_or(first);
            let run = BoundingBox {
                row_start: region.row_start + row,
                row_end: region.row_start + row + 1,
                column_start: region.column_start + first,
                column_end: region.column_start + last + 1,
            };
            bounds = Some(bounds.map_or(run, |bounds| BoundingBox {
                row_end: run.row_end,
                column_start: bounds.column_start.min(run.column_start),
                column_end: bounds.column_end.max(run.column_end),
                ..bounds
            }));
        }
        bounds
    }

    /// Gives up the saving of the contact's box: the mask is laid out over the whole frame.
    pub(in crate::pipeline) fn widened(&self, (rows, columns): (usize, usize)) -> Self {
        let Some(region) = self.region else {
            return self.clone();
        };
        let mut mask = Array2::from_elem((rows, columns), false);
        for ((row, column), inside) in self.mask.indexed_iter() {
            mask[[region.row_start + row, region.column_start + column]] = *inside;
        }
        let region = Some(BoundingBox {
            row_start: 0,
            row_end: rows,
            column_start: 0,
            column_end: columns,
        });
        Self {
            reading: self.reading,
            region,
            mask,
            background_step_grey: self.background_step_grey,
        }
    }
}
