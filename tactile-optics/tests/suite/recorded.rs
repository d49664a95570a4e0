//! Answers of an earlier state of this crate, so that a change of its form changes no number.
//!
//! `tests/recorded/answers.txt` holds a line for every name. After a change that is meant to alter answers, write it
//! anew with `RECORD_ANSWERS=1 cargo test -p tactile-optics --test suite recorded` and read the difference before committing.

use test_support as record;

use tactile_optics::led::{Geometry, Led};
use tactile_optics::surface::{Dimple, Flat, TopSurface, Touched, TouchingObject};
use tactile_optics::trace::{LightBudget, Slab, SlabLayer, TraceOptions, path, trace};
use tactile_optics::{
    Dispersion, SensorParameters, SensorSpecification, acceptance_angle, critical_angle, fresnel,
    led_cone, normal_incidence, propagation,
};

use num_traits::{Float, FloatConst};

const RECORDED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recorded/answers.txt");

/// Named numbers, in the order in which they were computed.
#[derive(Default)]
struct Answers {
    all: record::Answers,
}

impl Answers {
    fn add<T: Float + FloatConst>(&mut self, name: &str, value: T) {
        self.all.add(name, [value.to_f64().unwrap()]);
    }

    fn budget<T: Float + FloatConst>(&mut self, name: &str, b: &LightBudget<T>) {
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

fn closed_forms<T: Float + FloatConst>(answers: &mut Answers, scalar: &str) {
    let r = |v: f64| T::from(v).unwrap();
    for (n, n0) in [
        (1.38, 1.0),
        (1.41, 1.0),
        (1.3, 1.0),
        // Just below √2, where every ray is trapped.
        (14_142.0 / 10_000.0, 1.0),
        (1.5, 1.33),
        (1.0001, 1.0),
    ] {
        let acceptance = acceptance_angle(r(n), r(n0)).unwrap();
        answers.add(&format!("acceptance.{scalar}"), acceptance.radians);
        if acceptance.radians > T::zero() && acceptance.complement > T::zero() {
            answers.add(
                &format!("acceptance.complement.{scalar}"),
                acceptance.complement,
            );
        }
        if let Some(angle) = critical_angle(r(n), r(n0)).unwrap() {
            answers.add(&format!("critical.{scalar}"), angle.radians);
            answers.add(&format!("critical.complement.{scalar}"), angle.complement);
        }
        for incidence in [0.0, 0.3, 0.7, 1.2, 1.57] {
            let f = fresnel(r(n), r(n0), r(incidence)).unwrap();
            for value in [
                f.reflectance_s,
                f.reflectance_p,
                f.transmittance_s,
                f.transmittance_p,
            ] {
                answers.add(&format!("fresnel.{scalar}"), value);
            }
        }
        if let Some(angle) = propagation(r(n), r(0.9)).unwrap() {
            answers.add(&format!("propagation.{scalar}"), angle.radians);
            let cosine = angle.complement.sin();
            answers.add(&format!("propagation.cosine.{scalar}"), cosine);
        }
        for geometry in [Geometry::Section, Geometry::Volume] {
            let led = Led::from_half_intensity_angle(r(0.8)).unwrap();
            answers.add(
                &format!("trapped.{scalar}"),
                led.trapped_share(acceptance, geometry),
            );
        }
    }
    let indices = [1.38, 1.39, 1.40, 1.41].map(r);
    let normal = normal_incidence(&indices, T::one()).unwrap();
    for value in [normal.single_pass, normal.transmittance, normal.reflectance] {
        answers.add(&format!("stack.{scalar}"), value);
    }
    for n in indices {
        let angle = acceptance_angle(n, T::one()).unwrap();
        answers.add(&format!("stack.acceptance.{scalar}"), angle.radians);
    }
    let cone = led_cone(&indices, T::one(), r(2.4)).unwrap();
    answers.add(&format!("cone.{scalar}"), cone.margin);
    for (name, material) in [
        ("5:1", Dispersion::PDMS_5_1),
        ("10:1", Dispersion::PDMS_10_1),
        ("20:1", Dispersion::PDMS_20_1),
        ("RTV615", Dispersion::PDMS_RTV615),
        ("BOROFLOAT", Dispersion::BOROFLOAT_33),
        ("N-BK7", Dispersion::N_BK7),
    ] {
        answers.add(
            &format!("index.{name}.{scalar}"),
            material.index(r(530e-9)).unwrap(),
        );
        answers.add(
            &format!("abbe.{name}.{scalar}"),
            material.abbe_number::<T>().unwrap(),
        );
    }
}

fn traces<T: Float + FloatConst>(answers: &mut Answers, scalar: &str) {
    let r = |v: f64| T::from(v).unwrap();
    let layers =
        [(1.41, 2e-3), (1.40, 3e-3), (1.39, 5e-3), (1.4715, 2e-3)].map(|(index, thickness)| {
            SlabLayer {
                index: r(index),
                thickness_m: r(thickness),
            }
        });
    let slab = Slab::new(&layers, T::one(), r(30e-3)).unwrap();
    let dimple = Dimple::new([r(15e-3), r(1e-3)], r(4e-3), r(1.5e-3)).unwrap();
    let object = TouchingObject {
        index: r(1.45),
        albedo: r(0.7),
    };
    let touched = Touched::new(dimple, object, [r(15e-3), r(1e-3)], r(2e-3)).unwrap();
    let surfaces: [(&str, &dyn TopSurface<T>); 3] =
        [("flat", &Flat), ("dimple", &dimple), ("touched", &touched)];
    for (name, surface) in surfaces {
        for (form, geometry) in [("section", Geometry::Section), ("volume", Geometry::Volume)] {
            let options = TraceOptions::default()
                .with_geometry(geometry)
                .with_seed(5)
                .with_rays(300)
                .and_then(|o| o.with_cutoff(r(1e-4)))
                .and_then(|o| o.with_camera_half_angle(r(0.9)))
                .and_then(|o| o.with_emitter_half_width_m(r(3e-3)))
                .unwrap();
            let mut profile = [T::zero(); 6];
            let led = Led::new(r(1.5), r(1.2)).unwrap();
            let budget = trace(&slab, &led, surface, &options, &mut profile).unwrap();
            let name = format!("trace.{name}.{form}.{scalar}");
            answers.budget(&name, &budget);
            profile
                .iter()
                .for_each(|p| answers.add(&format!("{name}.profile"), *p));
        }
        let mut vertices = [[T::zero(); 3]; 12];
        let count = path(&slab, surface, r(0.3), r(0.4), &mut vertices).unwrap();
        vertices[..count]
            .iter()
            .flatten()
            .for_each(|v| answers.add(&format!("path.{name}.{scalar}"), *v));
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
    closed_forms::<f64>(&mut answers, "f64");
    closed_forms::<f32>(&mut answers, "f32");
    traces::<f64>(&mut answers, "f64");
    traces::<f32>(&mut answers, "f32");
    specification(&mut answers);
    answers.all.check(RECORDED, |name, recorded, _| {
        // A sum taken in another order moves the last digits of a double; a single must not move by more than one unit.
        let tolerance = if name.contains("f32") { 1.2e-7 } else { 1e-12 };
        // Coordinates of a path that are zero up to rounding are compared as lengths of the slab's size.
        let floor = if name.contains("path") { 1e-17 } else { 0.0 };
        tolerance * recorded.abs() + floor
    });
}
