//! Answers of an earlier state of this crate, so that a change of its form changes no number.
//!
//! `tests/recorded/answers.txt` holds a line for every name. After a change that is meant to alter
//! answers, write it anew with
//! `RECORD_ANSWERS=1 cargo test -p tactile-optics --test suite recorded` and read the difference
//! before committing.

use test_support as record;

use tactile_optics::surface::{Dimple, Flat, TopSurface, Touched, TouchingObject};
use tactile_optics::trace::{LightBudget, Slab, SlabLayer, TraceOptions, path, trace};
use tactile_optics::{
    Dispersion, SensorParameters, SensorSpecification, acceptance_angle, critical_angle, fresnel,
    led_cone, normal_incidence, propagation,
};
use tactile_optics::{Geometry, Led};

const RECORDED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recorded/answers.txt");

/// Named numbers, in the order in which they were computed.
#[derive(Default)]
struct Answers {
    all: record::Answers,
}

impl Answers {
    fn add(&mut self, name: &str, value: f64) {
        self.all.add(name, [value]);
    }

    fn budget(&mut self, name: &str, b: &LightBudget) {
        for share in [
            b.entry,
            b.guided,
            b.returned,
            b.above,
            b.below,
            b.camera,
            b.absorbed,
            b.unresolved,
        ] {
            self.add(name, share);
        }
    }
}

fn closed_forms(answers: &mut Answers) {
    for (n, n0) in [
        (1.38, 1.0),
        (1.41, 1.0),
        (1.3, 1.0),
        // Just below √2, where every ray is trapped.
        (14_142.0 / 10_000.0, 1.0),
        (1.5, 1.33),
        (1.0001, 1.0),
    ] {
        let acceptance = acceptance_angle(n, n0).unwrap();
        answers.add("acceptance.f64", acceptance.radians);
        if acceptance.radians > 0.0 && acceptance.complement > 0.0 {
            answers.add("acceptance.complement.f64", acceptance.complement);
        }
        if let Some(angle) = critical_angle(n, n0).unwrap() {
            answers.add("critical.f64", angle.radians);
            answers.add("critical.complement.f64", angle.complement);
        }
        for incidence in [0.0, 0.3, 0.7, 1.2, 1.57] {
            let f = fresnel(n, n0, incidence).unwrap();
            for value in [
                f.reflectance_s,
                f.reflectance_p,
                f.transmittance_s,
                f.transmittance_p,
            ] {
                answers.add("fresnel.f64", value);
            }
        }
        if let Some(angle) = propagation(n, 0.9).unwrap() {
            answers.add("propagation.f64", angle.radians);
            let cosine = angle.complement.sin();
            answers.add("propagation.cosine.f64", cosine);
        }
        for geometry in [Geometry::Section, Geometry::Volume] {
            let led = Led::from_half_intensity_angle(0.8).unwrap();
            answers.add("trapped.f64", led.trapped_share(acceptance, geometry));
        }
    }
    let indices = [1.38, 1.39, 1.40, 1.41];
    let normal = normal_incidence(&indices, 1.0).unwrap();
    for value in [normal.single_pass, normal.transmittance, normal.reflectance] {
        answers.add("stack.f64", value);
    }
    for n in indices {
        let angle = acceptance_angle(n, 1.0).unwrap();
        answers.add("stack.acceptance.f64", angle.radians);
    }
    let cone = led_cone(&indices, 1.0, 2.4).unwrap();
    answers.add("cone.f64", cone.margin);
    for (name, material) in [
        ("5:1", Dispersion::PDMS_5_1),
        ("10:1", Dispersion::PDMS_10_1),
        ("20:1", Dispersion::PDMS_20_1),
        ("RTV615", Dispersion::PDMS_RTV615),
        ("BOROFLOAT", Dispersion::BOROFLOAT_33),
        ("N-BK7", Dispersion::N_BK7),
    ] {
        answers.add(
            &format!("index.{name}.f64"),
            material.index(530e-9).unwrap(),
        );
        answers.add(&format!("abbe.{name}.f64"), material.abbe_number().unwrap());
    }
}

fn traces(answers: &mut Answers) {
    let layers =
        [(1.41, 2e-3), (1.40, 3e-3), (1.39, 5e-3), (1.4715, 2e-3)].map(|(index, thickness)| {
            SlabLayer {
                index,
                thickness_m: thickness,
            }
        });
    let slab = Slab::new(&layers, 1.0, 30e-3).unwrap();
    let dimple = Dimple::new([15e-3, 1e-3], 4e-3, 1.5e-3).unwrap();
    let object = TouchingObject {
        index: 1.45,
        albedo: 0.7,
    };
    let touched = Touched::new(dimple, object, [15e-3, 1e-3], 2e-3).unwrap();
    let surfaces: [(&str, &dyn TopSurface); 3] =
        [("flat", &Flat), ("dimple", &dimple), ("touched", &touched)];
    for (name, surface) in surfaces {
        for (form, geometry) in [("section", Geometry::Section), ("volume", Geometry::Volume)] {
            let options = TraceOptions::default()
                .with_geometry(geometry)
                .with_seed(5)
                .with_rays(300)
                .and_then(|o| o.with_cutoff(1e-4))
                .and_then(|o| o.with_camera_half_angle(0.9))
                .and_then(|o| o.with_emitter_half_width_m(3e-3))
                .unwrap();
            let mut profile = [0.0; 6];
            let led = Led::new(1.5, 1.2).unwrap();
            let budget = trace(&slab, &led, surface, &options, &mut profile).unwrap();
            let name = format!("trace.{name}.{form}.f64");
            answers.budget(&name, &budget);
            profile
                .iter()
                .for_each(|p| answers.add(&format!("{name}.profile"), *p));
        }
        let mut vertices = [[0.0; 3]; 12];
        let count = path(&slab, surface, 0.3, 0.4, &mut vertices).unwrap();
        vertices[..count]
            .iter()
            .flatten()
            .for_each(|v| answers.add(&format!("path.{name}.f64"), *v));
    }
}

fn specification(answers: &mut Answers) {
    let parameters = SensorParameters {
        side_m: 30e-3,
        pixel_m: 4.65e-6,
        frame_rate_hz: 80.0,
        largest_force_n: 2.0,
        newton_per_grey: 8.7e-8,
        pixel_noise_grey: 0.76,
        summed_pixels: 1392.0 * 1042.0,
    };
    let sensor = SensorSpecification::new(&parameters, 3.0).unwrap();
    for value in [
        sensor.grid_elements,
        sensor.temporal_resolution_s,
        sensor.force_resolution_n,
        sensor.force_levels,
    ] {
        answers.add("specification", value);
    }
}

#[test]
fn answers_are_those_recorded() {
    let mut answers = Answers::default();
    closed_forms(&mut answers);
    traces(&mut answers);
    specification(&mut answers);
    answers.all.check(RECORDED, |name, recorded, _| {
        // A sum taken in another order moves the last digits.
        let tolerance = 1e-12;
        // Coordinates of a path that are zero up to rounding are compared as lengths of the slab's
        // size.
        let floor = if name.contains("path") { 1e-17 } else { 0.0 };
        tolerance * recorded.abs() + floor
    });
}
