//! What each load says, and the errors that all loads share.
use super::contact::ContactReading;
use super::error::PipelineError;
use super::object::Object;
use super::settings::Settings;
use crate::elasticity::contact::guide_compliance_error;
use crate::elasticity::modulus::{Estimate, LoadSeries, LoadState, SharedErrors};

/// What one load says, before errors are split into its own and those that all loads share.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoadReading {
    pub force_n: f64,
    /// Error of the force from noise.
    pub noise_n: f64,
    /// Error of the force from the calibration.
    pub calibration_n: f64,
    /// Degrees of freedom of the force's error, where it was estimated.
    pub degrees_of_freedom: Option<f64>,
    pub radius_m: Option<Estimate>,
    pub indentation_m: Option<Estimate>,
    /// Area of a flat face.
    pub face_m2: Option<Estimate>,
    /// Strain since the first load.
    pub mean_strain: Option<Estimate>,
}

impl LoadReading {
    /// What a contact says of its load; `None` where its force is not known.
    pub(super) fn of(
        contact: &ContactReading,
        mean_strain: Option<Estimate>,
        pixel_size_m: [f64; 2],
    ) -> Option<Self> {
        let radius = contact.contact_radius_m;
        Some(Self {
            force_n: contact.force_n?.value,
            noise_n: contact.force_noise_n,
            calibration_n: contact.force_calibration_n,
            degrees_of_freedom: contact.force_n?.degrees_of_freedom,
            radius_m: Some(radius_with_floor(
                radius.value,
                radius.standard_error,
                pixel_size_m,
            )),
            indentation_m: contact
                .indentation_m
                .map(|depth| Estimate::new(depth.value, depth.standard_error)),
            face_m2: contact
                .face
                .map(|face| face.area_m2)
                .map(|area| area_with_floor(area.value, area.standard_error, pixel_size_m)),
            mean_strain,
        })
    }

    /// Keeps the force alone, so that no estimator uses the load: it repeats an earlier one (what is counted twice is not better known), or
    /// the contact is not whole.
    pub(super) fn forget_contact(&mut self) {
        (self.radius_m, self.indentation_m) = (None, None);
        (self.face_m2, self.mean_strain) = (None, None);
    }
}

/// The contact radius with what no profile can know better: a hundredth of a pixel, by which a rim of pixels, blur and the
/// contact's true shape differ from the fitted profile.
pub(super) fn radius_with_floor(
    value: f64,
    standard_error: f64,
    pixel_size_m: [f64; 2],
) -> Estimate {
    let floor = 0.01 * (pixel_size_m[0] * pixel_size_m[1]).sqrt();
    Estimate::new(value, standard_error.hypot(floor))
}

/// The area of a face with what no outline can know better: a hundredth of a pixel all around it, by which speckles at the rim, blur
/// and rounding shift the outline from one load to the next. Without it 88 % of the 95 % intervals hold, with it 97 % (`SCENES=400
/// cargo test --release --test suite moduli_of_blocks -- --nocapture`).
pub(super) fn area_with_floor(value: f64, standard_error: f64, pixel_size_m: [f64; 2]) -> Estimate {
    let shift_m = 0.01 * (pixel_size_m[0] * pixel_size_m[1]).sqrt();
    let outline_m = 2.0 * (std::f64::consts::PI * value).sqrt();
    Estimate::new(value, standard_error.hypot(shift_m * outline_m))
}

/// Loads and the relative errors they share. Of the calibration's errors the smallest relative one is common to all loads (the
/// slope's); what a load has beyond that (the offset's) is its own.
pub(super) fn series(
    readings: impl Iterator<Item = LoadReading> + Clone,
    settings: &Settings,
) -> Result<LoadSeries, PipelineError> {
    let relative = |r: &LoadReading| (r.calibration_n / r.force_n).abs();
    let common = readings
        .clone()
        .map(|r| relative(&r))
        .fold(f64::INFINITY, f64::min);
    let common = if common.is_finite() { common } else { 0.0 };
    let load = |r: LoadReading| {
        let rest = (r.calibration_n.powi(2) - (common * r.force_n).powi(2))
            .max(0.0)
            .sqrt();
        let mut force = Estimate::new(r.force_n, r.noise_n.hypot(rest));
        force.degrees_of_freedom = r.degrees_of_freedom;
        let mut load = LoadState::new(force);
        load.contact_radius_m = r.radius_m;
        load.indentation_m = r.indentation_m;
        load.mean_strain = r.mean_strain;
        load.contact_area_m2 = r.face_m2;
        load
    };
    let shared = SharedErrors {
        force_scale: common.hypot(settings.force_scale_error),
        length_scale: settings.length_scale_error,
        size: relative_size_error(settings),
        poisson_ratio: settings.poisson_ratio_error,
        other_body: guide_error_at(readings.clone(), settings),
    };
    LoadSeries::new(readings.map(load).collect::<Vec<_>>())
        .with_shared_errors(shared)
        .map_err(PipelineError::Modulus)
}

/// Relative error of the object's size.
fn relative_size_error(settings: &Settings) -> f64 {
    let radius = match settings.object {
        Object::Sphere { radius_m, .. } | Object::FlatPunch { radius_m, .. } => radius_m,
        Object::Layer {
            indenter_radius_m, ..
        } => indenter_radius_m,
        Object::Cone { .. }
        | Object::Block { .. }
        | Object::Cylinder { .. }
        | Object::Unknown { .. } => return 0.0,
    };
    settings.object_radius_error_m / radius
}

/// Relative error of the guide's compliance under contacts of the mean radius.
fn guide_error_at(readings: impl Iterator<Item = LoadReading>, settings: &Settings) -> f64 {
    let (Some(guide), Some(covariance)) = (&settings.waveguide, &settings.layer_covariance) else {
        return 0.0;
    };
    let (mut sum, mut count) = (0.0, 0.0);
    for radius in readings.filter_map(|reading| reading.radius_m) {
        sum += radius.value;
        count += 1.0;
    }
    // Without a radius the mean is NaN, which the compliance refuses.
    guide_compliance_error(guide.layers(), covariance, sum / count).unwrap_or(0.0)
}
