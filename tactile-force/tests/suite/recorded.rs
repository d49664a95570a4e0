//! Results of an earlier version of this crate. They ensure that a change of the implementation
//! changes no number.
//!
//! `tests/recorded/answers.txt` contains one line per name. After a change that is meant to change
//! results, rewrite it with `RECORD_ANSWERS=1 cargo test -p tactile-force --test suite recorded`
//! and inspect the difference before committing.

use test_support as record;

use ndarray::Array2;
use tactile_force::{
    CalibrationPair, ContactOptions, DriftCorrection, Estimate, ForceMeasurement, ForceMeter,
    ForceOptions, ForceWorkspace, LinearCalibration, Polarity, ReferenceFrame, ShearCalibration,
    ShearPair, Source, StressCalibration,
};

use crate::blob::{hertz, noise};

const RECORDED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recorded/answers.txt");

/// Named numbers, in the order of their computation.
#[derive(Default)]
struct Answers {
    all: record::Answers,
}

impl Answers {
    fn add(&mut self, name: &str, value: f64) {
        self.all.add(name, [value]);
    }

    fn estimate(&mut self, name: &str, e: Estimate) {
        self.add(&format!("{name}.value"), e.value);
        self.add(&format!("{name}.error"), e.standard_error);
    }
}

/// A Hertz contact of `peak` grey levels on a slightly uneven background, with the noise of a seed.
fn frame(centre: [f64; 2], radius: f64, peak: f64, illumination: f64, seed: u64) -> Array2<u8> {
    let mut noise = noise(seed);
    let blob = hertz((150, 210), centre, radius, peak);
    Array2::from_shape_fn((150, 210), |(y, x)| {
        let background = 60.0 - 0.02 * (x as f64 - 105.0) + 0.03 * (y as f64 - 75.0);
        (illumination * (blob[[y, x]] + background) + noise())
            .round()
            .clamp(0.0, 255.0) as u8
    })
}

fn pairs() -> Vec<CalibrationPair> {
    let forces = [
        0.01, 0.19, 0.43, 0.58, 0.83, 0.97, 1.22, 1.38, 1.21, 0.79, 0.41, 0.02,
    ];
    let levels = [
        0.0, 1e5, 2e5, 3e5, 4e5, 5e5, 6e5, 7e5, 6.05e5, 4.1e5, 2.05e5, 0.04e5,
    ];
    levels
        .iter()
        .zip(forces)
        .enumerate()
        .map(|(k, (&v, f))| {
            if k < 8 {
                CalibrationPair::loading(v, f)
            } else {
                CalibrationPair::unloading(v, f)
            }
        })
        .collect()
}

fn calibration(answers: &mut Answers, name: &str, c: &LinearCalibration) {
    for v in [0.0, 1.3e5, 5.2e5, 7.5e5] {
        answers.add(&format!("{name}.force"), c.force_n(v));
        answers.add(&format!("{name}.sensitivity"), c.sensitivity_n(v));
        answers.add(&format!("{name}.error"), c.standard_error_n(v));
        answers.add(
            &format!("{name}.covariance"),
            c.error_covariance_n2(v, 3.1e5),
        );
        answers.add(
            &format!("{name}.stress"),
            c.stress_per_grey_level_pa(v, 4e-10),
        );
    }
    let inverse = c.integrated_pixel_value(0.7);
    answers.add(&format!("{name}.inverse"), inverse.unwrap_or(-1.0));
    let report = c.report();
    for p in &report.parameters {
        answers.estimate(&format!("{name}.parameter"), *p);
    }
    for interval in report.parameters.iter().map(|p| p.interval_95()) {
        answers.add(&format!("{name}.low"), interval.lower);
        answers.add(&format!("{name}.high"), interval.upper.unwrap());
    }
    let h = report.hysteresis.unwrap();
    answers.add(&format!("{name}.hysteresis"), h.greatest_n);
    answers.estimate(&format!("{name}.hysteresis.mean"), h.mean_n);
    for (what, value) in [
        ("r2", report.r_squared),
        ("sd", report.residual_sd_n),
        ("linearity", report.linearity_error),
        ("mean sensitivity", report.sensitivity_n),
        ("smallest", report.smallest_force_n),
    ] {
        answers.add(&format!("{name}.{what}").replace(' ', "_"), value);
    }
}

fn calibrations(answers: &mut Answers) {
    for (origin, fit) in [
        (false, LinearCalibration::fit as fn(&[CalibrationPair]) -> _),
        (true, LinearCalibration::through_origin),
    ] {
        let line: LinearCalibration = fit(&pairs()).unwrap();
        calibration(
            answers,
            &format!("calibration.f64.line.plain.{origin}"),
            &line,
        );
    }
}

fn measurement(answers: &mut Answers, name: &str, m: &ForceMeasurement) {
    answers.estimate(&format!("{name}.force"), m.force_n.total());
    answers.add(&format!("{name}.sums"), m.difference_sum as f64);
    for c in m.drift.coefficients {
        answers.add(&format!("{name}.drift"), c);
    }
    answers.add(&format!("{name}.drift.error"), m.drift.standard_error);
    let (Some(contact), Some(noise), Some(reading)) = (m.contact, m.noise, m.reading) else {
        return;
    };
    for n in [
        noise.background,
        noise.gain,
        noise.common,
        noise.scale,
        noise.flat_field,
    ] {
        answers.add(&format!("{name}.noise"), n);
    }
    answers.add(&format!("{name}.area"), contact.area_px as f64);
    answers.add(&format!("{name}.aperture"), contact.aperture_px as f64);
    answers.add(&format!("{name}.peak"), contact.peak);
    answers.estimate(&format!("{name}.integral"), contact.integrated_pixel_value);
    contact
        .centroid_px
        .iter()
        .for_each(|c| answers.estimate(&format!("{name}.centroid"), *c));
    answers.add(
        &format!("{name}.reading.noise"),
        reading.force_n.part(Source::Noise),
    );
    answers.add(
        &format!("{name}.reading.calibration"),
        reading.force_n.part(Source::Calibration),
    );
    answers.add(
        &format!("{name}.reading.freedom"),
        m.force_n.total().degrees_of_freedom.unwrap(),
    );
    answers.estimate(
        &format!("{name}.radius"),
        m.contact_radius_m.unwrap().total(),
    );
    answers.estimate(&format!("{name}.mean"), m.mean_stress_pa.unwrap().total());
    answers.estimate(
        &format!("{name}.peak_stress"),
        m.peak_stress_pa.unwrap().total(),
    );
    if let Some(p) = m.profile {
        for e in [
            p.centre_px[0],
            p.centre_px[1],
            p.radius_px.total(),
            p.peak,
            p.integrated_pixel_value,
        ] {
            answers.estimate(&format!("{name}.profile"), e);
        }
        answers.add(&format!("{name}.blur"), p.blur_px);
        answers.add(&format!("{name}.chi2"), p.reduced_chi_squared);
        answers.add(&format!("{name}.profile.covariance"), p.covariance[1][2]);
    }
}

fn frames(answers: &mut Answers) {
    let quiet = [1, 2, 3].map(|seed| frame([100.0, 70.0], 1.0, 0.0, 1.0, seed));
    let plain = ReferenceFrame::new(quiet[0].view()).unwrap();
    let mean = ReferenceFrame::from_frames(&quiet.each_ref().map(|f| f.view())).unwrap();
    let flat = plain.clone().with_flat_field().unwrap();
    let firm = frame([98.3, 71.6], 36.0, 120.0, 1.0, 7);
    let faint = frame([98.3, 71.6], 30.0, 4.0, 1.0, 8);
    let brighter = frame([60.1, 80.2], 21.0, 90.0, 1.06, 9);
    let darker = frame([98.3, 71.6], 30.0, -40.0, 1.0, 10);
    let line = LinearCalibration::fit(&pairs()).unwrap();
    let contact = ContactOptions::default().with_drift(DriftCorrection::None);
    let options = || ForceOptions::default().with_contact(contact);
    let drift = |correction| options().with_contact(contact.with_drift(correction));
    let darker_contact = contact.with_polarity(Polarity::Darker);
    let cases: [(&str, &ReferenceFrame, &Array2<u8>, ForceOptions); 9] = [
        ("quiet", &plain, &quiet[1], options()),
        ("firm", &plain, &firm, options()),
        ("firm mean", &mean, &firm, options()),
        ("firm flat", &flat, &firm, options()),
        ("faint", &mean, &faint, options()),
        ("no profile", &plain, &firm, options().without_profile()),
        (
            "brighter",
            &plain,
            &brighter,
            drift(DriftCorrection::Automatic),
        ),
        (
            "tilted",
            &flat,
            &brighter,
            drift(DriftCorrection::TiltedIllumination),
        ),
        (
            "darker",
            &plain,
            &darker,
            options().with_contact(darker_contact),
        ),
    ];
    for (name, reference, image, options) in cases {
        let meter = ForceMeter::new([20e-6, 22e-6], &options).unwrap();
        let m = meter
            .measure_with(
                &mut ForceWorkspace::default(),
                image.view(),
                reference,
                &line,
            )
            .unwrap();
        measurement(answers, &format!("frame.f64.{name}").replace(' ', "_"), &m);
    }
}

fn others(answers: &mut Answers) {
    let shear_pairs = [(1e-5, 0.021), (2e-5, 0.038), (4e-5, 0.083)].map(|(u, f)| ShearPair {
        centroid_step_m: [u, -u],
        force_n: [f, -1.4 * f],
    });
    let shear = ShearCalibration::fit(&shear_pairs).unwrap();
    for k in 0..2 {
        answers.estimate("shear.stiffness", shear.stiffness_n_per_m[k]);
        answers.add("shear.sd", shear.residual_sd_n[k]);
    }
}

#[test]
fn answers_are_those_recorded() {
    let mut answers = Answers::default();
    calibrations(&mut answers);
    frames(&mut answers);
    others(&mut answers);
    answers.all.check(RECORDED, |_, recorded, _| {
        // A sum in another order changes the last digits of a double.
        let tolerance = 1e-12;
        // Differences of nearly equal numbers: errors of a perfect fit, sums over a frame without
        // contact.
        (tolerance * recorded.abs()).max(1e-25)
    });
}
