//! From contacts to the loads that estimators take, and the errors that all loads share.
use super::contact::ContactReading;
use super::error::PipelineError;
use super::settings::Settings;
use crate::elasticity::modulus::{Estimate, LoadSeries, LoadState, SharedErrors};

/// A contact as a load, before errors are split into its own and those that all loads share.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    pub contact: ContactReading,
    /// The force of `contact`, which is known.
    pub force_n: Estimate,
    /// Strain since the first load.
    pub mean_strain: Option<Estimate>,
    /// Whether estimators use the contact. Not of one that repeats an earlier one (what is counted
    /// twice is not better known), nor of one that is not whole.
    pub counts: bool,
}

impl Load {
    /// The load of a contact. `None` where its force is not known.
    pub fn of(contact: &ContactReading) -> Option<Self> {
        Some(Self {
            contact: *contact,
            force_n: contact.force_n?,
            mean_strain: None,
            counts: true,
        })
    }

    /// Error of the force from the calibration, relative.
    fn calibration(&self) -> f64 {
        (self.contact.force_calibration_n / self.force_n.value).abs()
    }

    /// Error of the radius that frames of one load have in common, relative.
    fn common_length(&self) -> f64 {
        self.contact.radius_common_m / self.contact.contact_radius_m.value
    }

    /// The contact radius with the error that is its own, beside `common`.
    fn radius_m(&self, common: f64) -> Estimate {
        let radius = self.contact.contact_radius_m;
        Estimate::new(
            radius.value,
            beyond(radius.standard_error, common * radius.value),
        )
    }

    /// The area of a face with a floor of its error that no outline goes below: a hundredth of a
    /// pixel all around it, by which speckles at the rim, blur and rounding shift the outline from
    /// one load to the next. Without it 88 % of the 95 % intervals hold, with it 97 % (`SCENES=400
    /// cargo test --release --test suite moduli_of_blocks -- --nocapture`).
    fn face_m2(&self, pixel_m: f64) -> Option<Estimate> {
        let area = self.contact.face?.area_m2;
        let outline_m = 2.0 * (std::f64::consts::PI * area.value).sqrt();
        let floor = 0.01 * pixel_m * outline_m;
        Some(Estimate::new(area.value, area.standard_error.hypot(floor)))
    }

    fn state(&self, common: f64, common_length: f64, pixel_m: f64) -> LoadState {
        let own = beyond(
            self.contact.force_calibration_n,
            common * self.force_n.value,
        );
        let mut force = Estimate::new(self.force_n.value, self.contact.force_noise_n.hypot(own));
        force.degrees_of_freedom = self.force_n.degrees_of_freedom;
        let mut load = LoadState::new(force);
        if self.counts {
            load.contact_radius_m = Some(self.radius_m(common_length));
            load.indentation_m = self.contact.indentation_m;
            load.contact_area_m2 = self.face_m2(pixel_m);
            load.mean_strain = self.mean_strain;
        }
        load
    }
}

/// The part of an error beside another one.
pub fn beyond(whole: f64, part: f64) -> f64 {
    (whole * whole - part * part).max(0.0).sqrt()
}

/// Loads and the relative errors they share. Of the errors of forces and radii the smallest
/// relative one is common to all loads (a calibration's slope, the size of a pixel). A load's error
/// beyond that (a calibration's offset) is its own.
pub fn series(
    loads: impl Iterator<Item = Load> + Clone,
    settings: &Settings,
    pixel_size_m: [f64; 2],
) -> Result<LoadSeries, PipelineError> {
    let smallest = |error: fn(&Load) -> f64, otherwise: f64| {
        let errors = loads.clone().map(|load| error(&load));
        let least = errors.fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { otherwise }
    };
    let common = smallest(Load::calibration, settings.force_scale());
    let common_length = smallest(Load::common_length, settings.length_scale());
    let pixel_m = (pixel_size_m[0] * pixel_size_m[1]).sqrt();
    let counted = loads.clone().filter(|load| load.counts);
    let radii: Vec<f64> = counted
        .map(|load| load.contact.contact_radius_m.value)
        .collect();
    // NaN without a contact, which the guide's compliance refuses.
    let radius_m = radii.iter().sum::<f64>() / radii.len() as f64;
    let other_body = settings.guide_error(radius_m);
    let errors = common_length * other_body;
    let shared = SharedErrors {
        force_scale: common,
        length_scale: common_length,
        size: settings.size_error(),
        poisson_ratio: settings.poisson_error(),
        other_body,
        adhesion_n: settings.adhesion_n(),
        length_with_other_body: if errors > 0.0 {
            (settings.guide_with_length(radius_m) / errors).clamp(-1.0, 1.0)
        } else {
            0.0
        },
    };
    LoadSeries::new(
        loads
            .map(|load| load.state(common, common_length, pixel_m))
            .collect::<Vec<_>>(),
    )
    .with_shared_errors(shared)
    .map_err(PipelineError::Modulus)
}

/// Loads that a session keeps apart. More are merged.
pub const MOST_LOADS: usize = 32;

/// The loads of a stream in rising order of force, at most [`MOST_LOADS`]: similar ones are merged.
/// Beside each load the number of its frames.
#[derive(Clone, Debug)]
pub struct SeenLoads(Vec<(Load, f64)>);

impl SeenLoads {
    pub fn new() -> Self {
        Self(Vec::with_capacity(MOST_LOADS + 1))
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn loads(&self) -> impl Iterator<Item = Load> + Clone + '_ {
        self.0.iter().map(|(load, _)| *load)
    }

    /// Takes a contact that can be trusted: alone, whole, unsaturated, inside the calibration, its
    /// profile fitted.
    pub fn learn(&mut self, contact: &ContactReading, mean_strain: Option<Estimate>) {
        let whole = !contact.touches_edge && contact.other_contacts == 0;
        // A flat face is not read by the fit of a profile.
        let read = contact.converged || contact.face.is_some();
        let trusted = whole && !contact.out_of_calibration && read;
        let trusted = trusted && contact.saturated_share == 0.0;
        let load = Load::of(contact).filter(|load| trusted && load.force_n.value > 0.0);
        let Some(load) = load else { return };
        let force = load.force_n.value;
        let at = self.0.partition_point(|(l, _)| l.force_n.value < force);
        self.0.insert(
            at,
            (
                Load {
                    mean_strain,
                    ..load
                },
                1.0,
            ),
        );
        if self.0.len() > MOST_LOADS {
            self.merge_closest();
        }
    }

    /// The neighbours that are closest by ratio become one.
    fn merge_closest(&mut self) {
        let force = |i: usize| self.0[i].0.force_n.value;
        let gap = |i: usize| force(i + 1) / force(i);
        let closest = (0..self.0.len() - 1)
            .min_by(|&i, &j| gap(i).total_cmp(&gap(j)))
            .unwrap_or(0);
        self.0[closest] = merged(self.0[closest], self.0[closest + 1]);
        self.0.remove(closest + 1);
    }
}

/// The mean of two loads, weighted with their frames. Radii are averaged as cubes, which grow in
/// proportion to the force. Relative errors of the calibration are common to both.
fn merged((one, frames): (Load, f64), (other, more): (Load, f64)) -> (Load, f64) {
    let all = frames + more;
    let (a, b) = (frames / all, more / all);
    let error = |one: f64, other: f64| (a * one).hypot(b * other);
    let mean = |one: Estimate, other: Estimate| {
        let standard_error = error(one.standard_error, other.standard_error);
        Estimate::new(a * one.value + b * other.value, standard_error)
    };
    let (s, o) = (&one.contact, &other.contact);
    let mut force_n = one.force_n;
    force_n.value = a * one.force_n.value + b * other.force_n.value;
    let radii = [s, o].map(|contact| contact.contact_radius_m);
    let radius_m = (a * radii[0].value.powi(3) + b * radii[1].value.powi(3)).cbrt();
    // Noise is averaged away, errors that both have in common are not.
    let common_m = (a * one.common_length() + b * other.common_length()) * radius_m;
    let noise = |c: &ContactReading| beyond(c.contact_radius_m.standard_error, c.radius_common_m);
    let radius_error_m = error(noise(s), noise(o)).hypot(common_m);
    let face = s.face.zip(o.face).map(|(mut face, other)| {
        face.area_m2 = mean(face.area_m2, other.area_m2);
        face
    });
    let contact = ContactReading {
        force_n: Some(force_n),
        force_noise_n: error(s.force_noise_n, o.force_noise_n),
        force_calibration_n: (a * one.calibration() + b * other.calibration()) * force_n.value,
        contact_radius_m: Estimate::new(radius_m, radius_error_m),
        radius_common_m: common_m,
        indentation_m: s
            .indentation_m
            .zip(o.indentation_m)
            .map(|(s, o)| mean(s, o)),
        face,
        ..*s
    };
    let strains = one.mean_strain.zip(other.mean_strain);
    let mean_strain = strains.map(|(s, o)| mean(s, o));
    let load = Load {
        contact,
        force_n,
        mean_strain,
        counts: true,
    };
    (load, all)
}
