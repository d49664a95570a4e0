//! Converts contacts to the loads that estimators use.
use super::contact::ContactReading;
use crate::core::{Source, Uncertain};
use crate::elasticity::modulus::{Bodies, Estimate, LoadSeries, LoadState};
use std::sync::Arc;

/// A contact, converted to a load.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    pub contact: ContactReading,
    /// The force of `contact`, which must be known.
    pub force_n: Uncertain,
    /// Strain since the first load.
    pub mean_strain: Option<Estimate>,
    /// Whether estimators use the contact. They skip one that repeats an earlier contact (counting
    /// it twice adds no information) and one that is incomplete.
    pub counts: bool,
}

impl Load {
    /// The load of a contact. `None` if its force is unknown.
    pub(super) fn of(contact: &ContactReading) -> Option<Self> {
        Some(Self {
            contact: *contact,
            force_n: contact.force_n?,
            mean_strain: None,
            counts: true,
        })
    }

    /// The area of a face, with a lower limit for its error that no outline reaches: a hundredth of
    /// a pixel all around it. Speckles at the rim, blur and rounding shift the outline from one
    /// load to the next by this amount. Without the limit the coverage of the 95 % intervals is 88
    /// %, with it 97 % (`SCENES=400 cargo test --release --test suite moduli_of_blocks --
    /// --nocapture`).
    fn face_m2(&self, pixel_m: f64) -> Option<Estimate> {
        let area = self.contact.face?.area_m2;
        let outline_m = 2.0 * (std::f64::consts::PI * area.value).sqrt();
        let floor = 0.01 * pixel_m * outline_m;
        Some(Estimate::new(area.value, area.standard_error.hypot(floor)))
    }

    fn state(&self, forces: &InCommon, radii: &InCommon, pixel_m: f64) -> LoadState {
        let mut load = LoadState::new(forces.of(self.force_n));
        if self.counts {
            let radius = radii.of(self.contact.contact_radius_m);
            // The errors common to lengths count twice for areas. Depths have them once: depth
            // tables come from balls measured with the same pixels.
            let length = radius.without(Source::Noise) * radius.value.recip();
            let depth = self.contact.indentation_m.map(Uncertain::from);
            let area = self.face_m2(pixel_m).map(Uncertain::from);
            load.contact_radius_m = Some(radius);
            load.indentation_m = depth.map(|depth| depth * length);
            load.contact_area_m2 = area.map(|area| area * length.powf(2.0));
            load.mean_strain = self.mean_strain.map(Uncertain::from);
        }
        load
    }
}

/// The part of each source's relative error that all loads have in common: the smallest value (such
/// as a calibration's slope, or the pixel size). The excess in a load (such as a calibration's
/// offset) belongs to that load. If it were treated as common, a mean over loads would extrapolate
/// it away.
struct InCommon([f64; Source::ALL.len()]);

impl InCommon {
    fn to(numbers: impl Iterator<Item = Uncertain>) -> Self {
        let least = [f64::INFINITY; Source::ALL.len()];
        Self(numbers.fold(least, |mut least, number| {
            for (least, source) in least.iter_mut().zip(Source::ALL) {
                *least = least.min((number.part(source) / number.value).abs());
            }
            least
        }))
    }

    fn of(&self, number: Uncertain) -> Uncertain {
        let limits = Source::ALL.into_iter().zip(self.0);
        limits.filter(|(source, _)| *source != Source::Noise).fold(
            number,
            |number, (source, relative)| {
                number.with_excess_as_noise(source, relative * number.value.abs())
            },
        )
    }
}

/// The input of an estimator.
pub(super) fn series(
    loads: impl Iterator<Item = Load> + Clone,
    bodies: Arc<Bodies>,
    pixel_size_m: [f64; 2],
) -> LoadSeries {
    let forces = InCommon::to(loads.clone().map(|load| load.force_n));
    let radii = InCommon::to(loads.clone().map(|load| load.contact.contact_radius_m));
    let pixel_m = (pixel_size_m[0] * pixel_size_m[1]).sqrt();
    let states = loads.map(|load| load.state(&forces, &radii, pixel_m));
    LoadSeries::new(states.collect::<Vec<_>>()).with_bodies(bodies)
}

/// Number of loads that a session keeps separate. Further loads are merged.
pub(super) const MOST_LOADS: usize = 32;

/// The loads of a stream in ascending order of force, each with its number of frames. At most
/// [`MOST_LOADS`] are kept, and similar loads are merged.
#[derive(Clone, Debug)]
pub(super) struct SeenLoads(Vec<(Load, f64)>);

impl SeenLoads {
    pub(super) fn new() -> Self {
        Self(Vec::with_capacity(MOST_LOADS + 1))
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn loads(&self) -> impl Iterator<Item = Load> + Clone + '_ {
        self.0.iter().map(|(load, _)| *load)
    }

    /// Adds a reliable contact: complete, within the calibration, and with a fitted profile. A few
    /// saturated pixels are an error of its force. Other contacts beside it are no part of it.
    pub(super) fn learn(&mut self, contact: &ContactReading, mean_strain: Option<Estimate>) {
        // A flat face is measured without a fit of the profile.
        let read = contact.converged || contact.face.is_some();
        let trusted = !contact.touches_edge && !contact.out_of_calibration && read;
        let load = Load::of(contact).filter(|load| trusted && load.force_n.value > 0.0);
        let Some(load) = load else { return };
        // Noise separates two frames of one load, so equal contacts come from the same image.
        if self
            .0
            .iter()
            .any(|(known, _)| known.contact == load.contact)
        {
            return;
        }
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

    /// Merges the neighbours with the smallest ratio of forces.
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

/// The mean of two loads, weighted by their frames. This averages noise, but not the common errors.
/// Radii are averaged as cubes, which are proportional to the force.
fn merged((one, frames): (Load, f64), (other, more): (Load, f64)) -> (Load, f64) {
    let all = frames + more;
    let mean = |one: Uncertain, other: Uncertain| one * (frames / all) + other * (more / all);
    let of_both = |one: Option<Estimate>, other: Option<Estimate>| {
        Some(mean(one?.into(), other?.into()).total())
    };
    let (s, o) = (&one.contact, &other.contact);
    let force_n = mean(one.force_n, other.force_n);
    let [cube, other_cube] = [s, o].map(|contact| contact.contact_radius_m.powf(3.0));
    let area = |contact: &ContactReading| contact.face.map(|face| face.area_m2);
    let area_m2 = of_both(area(s), area(o));
    let contact = ContactReading {
        force_n: Some(force_n),
        contact_radius_m: mean(cube, other_cube).powf(1.0 / 3.0),
        indentation_m: of_both(s.indentation_m, o.indentation_m),
        face: (s.face.zip(area_m2)).map(|(mut face, area_m2)| {
            face.area_m2 = area_m2;
            face
        }),
        ..*s
    };
    let load = Load {
        contact,
        force_n,
        mean_strain: of_both(one.mean_strain, other.mean_strain),
        counts: true,
    };
    (load, all)
}
