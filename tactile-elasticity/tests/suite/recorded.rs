//! Recorded results of the crate at the time `tests/recorded.txt` was written. They ensure that a
//! change of the implementation changes no number.
//!
//! `RECORD_ANSWERS=1 cargo test -p tactile-elasticity --test suite recorded` rewrites the file.
//! Give the reason in the commit.

use test_support as record;

use nalgebra::Matrix3;
use tactile_elasticity::contact::*;
use tactile_elasticity::field::StrainField;
use tactile_elasticity::modulus::*;
use tactile_elasticity::strain::*;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recorded.txt");

/// A sum in another order, or another method for the same zero of a function, may change the last
/// digits. Other changes are errors.
const TOLERANCE: f64 = 1e-12;

/// Names with their numbers.
#[derive(Default)]
struct Answers(record::Answers);

impl Answers {
    fn add(&mut self, name: &str, value: f64) {
        self.0.add(name, [value]);
    }

    fn all<const N: usize>(&mut self, name: &str, values: [(&str, f64); N]) {
        for (of, value) in values {
            self.add(&format!("{name} {of}"), value);
        }
    }

    fn tensor(&mut self, name: &str, tensor: &Matrix3<f64>) {
        for (i, x) in tensor.iter().enumerate() {
            self.add(&format!("{name} {i}"), *x);
        }
    }

    fn estimate(&mut self, name: &str, estimator: &dyn ModulusEstimator, series: &LoadSeries) {
        let e = estimator.estimate(series).expect(name);
        self.all(
            name,
            [
                ("E", e.youngs_modulus_pa),
                ("error", e.standard_error_pa),
                ("lower", e.interval_95.lower),
                ("upper", e.interval_95.upper.unwrap_or(-1.0)),
                ("warnings", e.warnings.len() as f64),
            ],
        );
        for (i, load) in e.loads.iter().enumerate() {
            let of_load = [
                ("E", load.youngs_modulus_pa.unwrap_or(-1.0)),
                ("residual", load.standardized_residual.unwrap_or(-1.0)),
            ];
            self.all(&format!("{name} load {i}"), of_load);
        }
    }
}

fn strain_and_stress(answers: &mut Answers) {
    let h = Matrix3::new(0.02, -0.13, 0.01, 0.11, -0.05, 0.03, 0.004, 0.02, -0.21);
    let deformation = Deformation::from_displacement_gradient(h);
    let measures: [&dyn StrainMeasure; 5] = [
        &GreenLagrange,
        &EulerAlmansi,
        &Hencky,
        &Biot,
        &Infinitesimal,
    ];
    for measure in measures {
        answers.tensor(measure.name(), &measure.of(&deformation).unwrap());
    }
    answers.add("volume change", deformation.volume_change());
    let gradients: Vec<_> = (1..9).map(|k| h * f64::from(k * k) * 0.01).collect();
    let field = StrainField::from_gradients(&gradients, None, &GreenLagrange).unwrap();
    answers.tensor("mean Mean", &field.summary().mean);
}

fn contacts(answers: &mut Answers) {
    let hertz = HertzContact::from_force(0.05, 3e-3, 45e3).unwrap();
    for r in [0.0, 1e-3, 2.5e-3, 7e-3] {
        let (a, p0) = (hertz.contact_radius_m, hertz.peak_pressure_pa);
        let u = HertzContact::surface_displacement_m(r, a, p0, hertz.reduced_modulus_pa);
        answers.add(&format!("Hertz displacement {r}"), u);
    }
    for (name, bond, nu) in [
        ("bonded", Bond::Bonded, 0.5),
        ("bonded 0.3", Bond::Bonded, 0.3),
        ("free", Bond::Free, 0.4),
    ] {
        for ratio in [0.01, 0.4, 1.5, 7.0] {
            let equation = LayerEquation::new(bond, nu).unwrap().with_share(0.8);
            let contact = equation.solve(ratio).unwrap();
            let found = [
                ("force", contact.force_ratio_same_radius),
                ("indentation", contact.indentation_ratio),
            ];
            answers.all(&format!("layer {name} {ratio}"), found);
        }
    }
}

fn gel() -> Waveguide {
    let layer = |thickness_m, youngs_modulus_pa, poisson_ratio| Layer {
        thickness_m,
        youngs_modulus_pa,
        poisson_ratio,
    };
    Waveguide::new(vec![
        layer(2e-3, 1.36e5, 0.48),
        layer(3e-3, 8.0e4, 0.49),
        layer(5e-3, 3.4e4, 0.5),
    ])
    .unwrap()
}

/// Loads near Hertz's with errors that no law fits exactly.
fn loads() -> Vec<LoadState> {
    [(0.01, 1.003), (0.02, 0.996), (0.05, 1.001)]
        .map(|(force, factor)| {
            let contact = HertzContact::from_force(force, 4e-3, 25e3).unwrap();
            let (a, d) = (
                contact.contact_radius_m * factor,
                contact.indentation_m / factor,
            );
            LoadState::new(Estimate::new(force, 0.004 * force).with_degrees_of_freedom(9.0))
                .with_radius(Estimate::new(a, 0.003 * a))
                .with_indentation(Estimate::new(d, 0.005 * d))
                .with_strain(Estimate::new(0.6 * force * factor, 1e-4))
        })
        .to_vec()
}

fn estimators(answers: &mut Answers) {
    let (radius, nu, gel) = (4e-3, 0.48, gel());
    let series = LoadSeries::new(loads());
    // All forces come from one gauge, and its error was estimated with them.
    let scaled: Vec<_> = (loads().into_iter())
        .map(|mut load| {
            let scale = 0.01 * load.force_n.value;
            load.force_n = (load.force_n).by_estimated(Source::Gain, scale, Some(9.0));
            load
        })
        .collect();
    let hertz = HertzSphere::new(radius, nu).unwrap();
    let uncertain: Vec<_> = (scaled.iter())
        .map(|load| {
            let by_pixels = |number: Uncertain| number.by_relative(Source::PixelSize, 0.004);
            let mut load = *load;
            load.contact_radius_m = load.contact_radius_m.map(by_pixels);
            load.indentation_m = load.indentation_m.map(by_pixels);
            load
        })
        .collect();
    let ball = Bodies::new(Object::sphere(radius), None).with_size_error(0.002);
    let uncertain = LoadSeries::new(uncertain).with_bodies(ball.unwrap());
    let scaled = LoadSeries::new(scaled);
    let on_guide = hertz.clone().with_waveguide(&gel);
    answers.estimate("Hertz on the guide", &on_guide, &uncertain);
    let by_depth = loads().into_iter().map(|mut load| {
        load.contact_radius_m = None;
        load
    });
    let by_depth = LoadSeries::new(by_depth.collect::<Vec<_>>());
    answers.estimate("Hertz from indentation", &hertz, &by_depth);
    let layered = SphereOnWaveguide::new(radius, nu, &gel, Bond::Bonded).unwrap();
    answers.estimate("on the guide", &layered, &series);
    let layer = BondedLayer::new(radius, 9e-3, nu, Bond::Bonded).unwrap();
    answers.estimate("layer IntegralEquation", &layer, &series);
    answers.estimate("punch", &FlatPunch::new(1e-3, nu).unwrap(), &series);
    answers.estimate("cone", &Cone::new(1.1, nu).unwrap(), &series);
    let ratio = PaperRatio::default().with_sphere_radius(radius).unwrap();
    answers.estimate("stress over strain", &ratio, &scaled);
    let ratio = PaperRatio::default().with_reference(StrainReference::FirstLoad);
    answers.estimate("stress over strain from the first load", &ratio, &series);
    answers.estimate("regression Tested", &StressStrainRegression, &scaled);
}

#[test]
fn answers_are_those_recorded() {
    let mut answers = Answers::default();
    strain_and_stress(&mut answers);
    contacts(&mut answers);
    estimators(&mut answers);
    // Numbers that are zero up to rounding have no relative error.
    answers
        .0
        .check(FILE, |_, recorded, _| TOLERANCE * recorded.abs().max(1e-6));
}
