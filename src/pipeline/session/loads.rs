//! The loads that a session has seen: a bounded number, similar ones merged.
use crate::elasticity::modulus::Estimate;
use crate::pipeline::contact::ContactReading;
use crate::pipeline::load_reading::{LoadReading, area_with_floor, radius_with_floor};

/// Loads that a session keeps apart; more are merged.
pub(super) const MOST_LOADS: usize = 32;

/// Force and radius at one load, averaged over the frames taken there.
#[derive(Clone, Copy, Debug)]
struct MergedLoad {
    frames: f64,
    force_n: f64,
    radius_m: f64,
    force_variance: f64,
    radius_variance: f64,
    calibration: f64,
    degrees_of_freedom: Option<f64>,
    indentation_m: Option<Estimate>,
    face_m2: Option<Estimate>,
    mean_strain: Option<Estimate>,
}

impl MergedLoad {
    fn of(reading: &ContactReading, mean_strain: Option<Estimate>) -> Option<Self> {
        let force = reading.force_n?;
        Some(Self {
            frames: 1.0,
            force_n: force.value,
            radius_m: reading.contact_radius_m.value,
            force_variance: reading.force_noise_n.powi(2),
            radius_variance: reading.contact_radius_m.standard_error.powi(2),
            calibration: (reading.force_calibration_n / force.value).abs(),
            degrees_of_freedom: force.degrees_of_freedom,
            indentation_m: reading
                .indentation_m
                .map(|depth| Estimate::new(depth.value, depth.standard_error)),
            face_m2: reading
                .face
                .map(|face| Estimate::new(face.area_m2.value, face.area_m2.standard_error)),
            mean_strain,
        })
    }

    /// The mean of both. Radii are averaged as cubes, which grow in proportion to the force.
    fn merged(self, other: Self) -> Self {
        let frames = self.frames + other.frames;
        let (a, b) = (self.frames / frames, other.frames / frames);
        let mean = |one: Option<Estimate>, two: Option<Estimate>| {
            one.zip(two).map(|(s, o)| {
                let error = (a * s.standard_error).hypot(b * o.standard_error);
                Estimate::new(a * s.value + b * o.value, error)
            })
        };
        Self {
            frames,
            force_n: a * self.force_n + b * other.force_n,
            radius_m: (a * self.radius_m.powi(3) + b * other.radius_m.powi(3)).cbrt(),
            force_variance: a * a * self.force_variance + b * b * other.force_variance,
            radius_variance: a * a * self.radius_variance + b * b * other.radius_variance,
            calibration: a * self.calibration + b * other.calibration,
            degrees_of_freedom: fewest(self.degrees_of_freedom, other.degrees_of_freedom),
            indentation_m: mean(self.indentation_m, other.indentation_m),
            face_m2: mean(self.face_m2, other.face_m2),
            mean_strain: mean(self.mean_strain, other.mean_strain),
        }
    }

    fn reading(&self, pixel_size_m: [f64; 2]) -> LoadReading {
        LoadReading {
            force_n: self.force_n,
            noise_n: self.force_variance.sqrt(),
            calibration_n: self.calibration * self.force_n,
            degrees_of_freedom: self.degrees_of_freedom,
            radius_m: Some(radius_with_floor(
                self.radius_m,
                self.radius_variance.sqrt(),
                pixel_size_m,
            )),
            indentation_m: self.indentation_m,
            face_m2: self
                .face_m2
                .map(|area| area_with_floor(area.value, area.standard_error, pixel_size_m)),
            mean_strain: self.mean_strain,
        }
    }
}

/// The smaller of the degrees of freedom that are not infinite.
fn fewest(one: Option<f64>, other: Option<f64>) -> Option<f64> {
    one.into_iter().chain(other).reduce(f64::min)
}

/// At most [`MOST_LOADS`] loads in rising order of force.
#[derive(Clone, Debug)]
pub(super) struct SeenLoads(Vec<MergedLoad>);

impl SeenLoads {
    pub(super) fn new() -> Self {
        Self(Vec::with_capacity(MOST_LOADS + 1))
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// What all loads say.
    pub(super) fn readings(
        &self,
        pixel_size_m: [f64; 2],
    ) -> impl Iterator<Item = LoadReading> + Clone {
        self.0.iter().map(move |load| load.reading(pixel_size_m))
    }

    /// Takes a contact that can be trusted: alone, whole, unsaturated, inside the calibration, its profile fitted.
    pub(super) fn learn(&mut self, reading: &ContactReading, strain: Option<Estimate>) {
        let whole = !reading.touches_edge && reading.other_contacts == 0;
        // A flat face is not read by the fit of a profile.
        let read = reading.converged || reading.face.is_some();
        let trusted = whole && !reading.out_of_calibration && read;
        let trusted = trusted && reading.saturated_share == 0.0;
        let Some(load) = MergedLoad::of(reading, strain).filter(|l| trusted && l.force_n > 0.0)
        else {
            return;
        };
        let at = self.0.partition_point(|l| l.force_n < load.force_n);
        self.0.insert(at, load);
        if self.0.len() > MOST_LOADS {
            self.merge_closest();
        }
    }

    /// The neighbours that are closest by ratio become one.
    fn merge_closest(&mut self) {
        let gap = |i: usize| self.0[i + 1].force_n / self.0[i].force_n;
        let closest = (0..self.0.len() - 1)
            .min_by(|&i, &j| gap(i).total_cmp(&gap(j)))
            .unwrap_or(0);
        self.0[closest] = self.0[closest].merged(self.0[closest + 1]);
        self.0.remove(closest + 1);
    }
}
