//! The local curve against an independent forward model: light that goes as a power of the pressure, vignetting, noise, whole
//! grey levels. The scenes that are measured show another ball than the ones that calibrated.

use ndarray::Array2;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use tactile_force::{
    Branch, CalibrationFrame, CalibrationOptions, CalibrationPair, ContactDetector, ContactOptions,
    Detection, DetectorWorkspace, ForceError, ForceMeasurement, ForceMeter, ForceOptions,
    ForceWorkspace, GreyHistogram, LinearCalibration, LocalCalibration, NoiseModel, PressureCurve,
    PressureCurveOptions, ReferenceFrame, StressCalibration,
};

const SHAPE: (usize, usize) = (200, 240);
const PIXEL_M: f64 = 40e-6;
const AREA_M2: f64 = PIXEL_M * PIXEL_M;

/// A sensor whose light goes as the pressure to the power `q`.
#[derive(Clone, Copy)]
struct Sensor {
    q: f64,
    vignetting: f64,
    /// Relative lag of unloading: its light belongs to a pressure lower by this share.
    hysteresis: f64,
}

/// Hertz: contact radius in metres of a ball of radius `ball_m` under a force; E* = 200 kPa.
fn contact_radius(force_n: f64, ball_m: f64) -> f64 {
    (0.75 * force_n * ball_m / 200e3).cbrt()
}

impl Sensor {
    /// Grey level of a pressure: 120 at 60 kPa.
    fn light(&self, pressure_pa: f64) -> f64 {
        120.0 * (pressure_pa / 60e3).powf(self.q)
    }

    /// A frame of a contact at (x, y) pixels; without force, of the sensor at rest.
    fn frame(
        &self,
        force_n: f64,
        ball_m: f64,
        [cx, cy]: [f64; 2],
        branch: Branch,
        seed: u64,
    ) -> Array2<u8> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let a = contact_radius(force_n, ball_m) / PIXEL_M;
        let lag = if branch == Branch::Unloading {
            1.0 - self.hysteresis
        } else {
            1.0
        };
        let peak = 1.5 * force_n / (std::f64::consts::PI * (a * PIXEL_M).powi(2)) * lag;
        Array2::from_shape_fn(SHAPE, |(y, x)| {
            let (x, y) = (x as f64, y as f64);
            let mut light = 0.0;
            if force_n > 0.0 && (x - cx).hypot(y - cy) < a + 2.0 {
                // The mean over the pixel, by three by three points.
                for k in 0..9 {
                    let (dx, dy) = (
                        f64::from(k % 3) / 3.0 - 1.0 / 3.0,
                        f64::from(k / 3) / 3.0 - 1.0 / 3.0,
                    );
                    let r2 = ((x + dx - cx).powi(2) + (y + dy - cy).powi(2)) / (a * a);
                    light += self.light(peak * (1.0 - r2).max(0.0).sqrt()) / 9.0;
                }
            }
            let (u, v) = ((x - 119.5) / 119.5, (y - 99.5) / 99.5);
            let even = 1.0 - 0.5 * self.vignetting * (u * u + v * v);
            let expected = even * (light + 40.0);
            let sd = (0.3 + 0.02 * expected).sqrt();
            let noise: f64 = StandardNormal.sample(&mut rng);
            (expected + sd * noise).round().clamp(0.0, 255.0) as u8
        })
    }

    fn reference(&self) -> ReferenceFrame {
        let frames: Vec<_> = (0..8)
            .map(|k| self.frame(0.0, 1.0, [0.0; 2], Branch::Loading, 900 + k))
            .collect();
        let views: Vec<_> = frames.iter().map(|f| f.view()).collect();
        ReferenceFrame::from_frames(&views)
            .unwrap()
            .with_flat_field()
            .unwrap()
    }

    /// Frames of a ball of 4 mm under 0.05 to 1 N, up and down, at places that differ, and a gauge good to 0.2 %.
    fn calibration(
        &self,
        reference: &ReferenceFrame,
        seed: u64,
    ) -> (Vec<CalibrationFrame>, Vec<CalibrationPair<f64>>) {
        let detector = ContactDetector::new(ContactOptions::default());
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut workspace = DetectorWorkspace::default();
        let (mut frames, mut pairs) = (Vec::new(), Vec::new());
        for k in 0..24 {
            let step = if k < 12 { k + 1 } else { 24 - k };
            let branch = if k < 12 {
                Branch::Loading
            } else {
                Branch::Unloading
            };
            let force = f64::from(step) / 12.0;
            let place = [
                100.0 + 30.0 * rng.random::<f64>(),
                85.0 + 25.0 * rng.random::<f64>(),
            ];
            let frame = self.frame(force, 4e-3, place, branch, 1000 * seed + k as u64);
            let found: Detection<f64> = detector
                .detect_with(&mut workspace, frame.view(), reference)
                .unwrap();
            let noise: f64 = StandardNormal.sample(&mut rng);
            let gauge = force * (1.0 + 2e-3 * noise);
            let histogram = workspace.grey_histogram(AREA_M2).unwrap();
            let sum = found.contact.unwrap().integrated_pixel_value.value;
            frames.push(CalibrationFrame::new(histogram, gauge, branch).unwrap());
            pairs.push(CalibrationPair {
                integrated_pixel_value: sum,
                force_n: gauge,
                branch,
            });
        }
        (frames, pairs)
    }

    fn curve(&self, reference: &ReferenceFrame, seed: u64) -> PressureCurve {
        PressureCurve::fit(
            &self.calibration(reference, seed).0,
            &PressureCurveOptions::default(),
        )
        .unwrap()
    }
}

fn measure(
    frame: &Array2<u8>,
    reference: &ReferenceFrame,
    calibration: &dyn StressCalibration<f64>,
) -> ForceMeasurement<f64> {
    let meter = ForceMeter::new([PIXEL_M; 2], &ForceOptions::default()).unwrap();
    meter
        .measure_with(
            &mut ForceWorkspace::default(),
            frame.view(),
            reference,
            calibration,
        )
        .unwrap()
}

fn sensor(q: f64) -> Sensor {
    Sensor {
        q,
        vignetting: 0.1,
        hysteresis: 0.0,
    }
}

#[test]
fn force_and_radius_of_another_ball_are_right_whatever_the_power() {
    for q in [0.8, 0.9, 1.0, 1.1, 1.2] {
        let sensor = sensor(q);
        let reference = sensor.reference();
        let (frames, pairs) = sensor.calibration(&reference, 1);
        let curve = PressureCurve::fit(&frames, &PressureCurveOptions::default()).unwrap();
        let options = CalibrationOptions::default().with_zero_at_origin();
        let sums = LinearCalibration::fit(&pairs, &options).unwrap();
        // The local curve, and the frame sums for comparison: worst relative errors of force and radius.
        let (mut local, mut summed) = ([0.0_f64; 2], [0.0_f64; 2]);
        for (k, force) in [0.1, 0.2, 0.3, 0.4].into_iter().enumerate() {
            let frame = sensor.frame(force, 2.5e-3, [121.3, 97.6], Branch::Loading, 77 + k as u64);
            let radius = contact_radius(force, 2.5e-3);
            for (worst, calibration) in [
                (&mut local, &curve as &dyn StressCalibration<f64>),
                (&mut summed, &sums),
            ] {
                let m = measure(&frame, &reference, calibration);
                worst[0] = worst[0].max((m.force_n.value / force - 1.0).abs());
                worst[1] = worst[1].max((m.contact_radius_m.unwrap().value / radius - 1.0).abs());
            }
        }
        println!(
            "q {q}: force {:.4} (sums {:.4}), radius {:.4} (light {:.4})",
            local[0], summed[0], local[1], summed[1]
        );
        // A modulus goes as F/a³: 1 % here is what the sum of both may cost it.
        assert!(local[0] < 0.01 && local[1] < 0.004, "q {q}: {local:?}");
        if (q - 1.0_f64).abs() > 0.15 {
            assert!(
                summed[0] > 2.0 * local[0] && summed[1] > 2.0 * local[1],
                "q {q}: {summed:?} {local:?}"
            );
        }
    }
}

#[test]
fn stated_errors_cover_the_truth() {
    let sensor = sensor(0.9);
    let reference = sensor.reference();
    let frames: Vec<_> = (0..4)
        .map(|k| {
            (
                0.1 * f64::from(k + 1),
                sensor.frame(
                    0.1 * f64::from(k + 1),
                    2.5e-3,
                    [121.3, 97.6],
                    Branch::Loading,
                    50 + k as u64,
                ),
            )
        })
        .collect();
    let (mut inside, mut count) = (0, 0);
    for seed in 0..25 {
        let curve = sensor.curve(&reference, seed);
        for (force, frame) in &frames {
            let found = measure(frame, &reference, &curve).force_n;
            inside += usize::from((found.value - force).abs() < 2.0 * found.standard_error);
            count += 1;
        }
    }
    let share = inside as f64 / count as f64;
    // 95.4 % if the errors were exact. Those of smoothing are an average over curves like this one, and four forces of one
    // calibration share its error: 25 draws, ± 4 % each way.
    assert!(share > 0.85, "{share}");
}

#[test]
fn the_report_says_what_was_learned() {
    let sensor = Sensor {
        q: 1.1,
        vignetting: 0.1,
        hysteresis: 0.03,
    };
    let reference = sensor.reference();
    let curve = sensor.curve(&reference, 3);
    let report = curve.fit_report();
    assert_eq!(report.frames, 24);
    let [low, high] = report.identified_grey;
    let top = sensor.light(1.5 / (std::f64::consts::PI * contact_radius(1.0, 4e-3).powi(2)));
    assert!(
        low < 30.0 && (0.9 * top..1.3 * top).contains(&high),
        "{low} {high} {top}"
    );
    // Light of p (1 − 0.03) under the same force: f of unloading is larger by 3 %.
    let lag = report.hysteresis.unwrap();
    assert!(
        (lag.relative.value + 0.03).abs() < 3.0 * lag.relative.standard_error,
        "{lag:?}"
    );
    assert!((0.01..0.02).contains(&lag.width), "{lag:?}");
    // Pressures are those of the forward model, between the two branches.
    for grey in [40.0, 80.0, 120.0] {
        let truth = 60e3 * (grey / 120.0_f64).powf(1.0 / 1.1) * 1.015;
        let found = curve.pressure_pa(grey);
        assert!(
            (found.value / truth - 1.0).abs() < 0.03,
            "{grey}: {found:?} {truth}"
        );
    }
    // A reading is no surer than half of the lag.
    let frame = sensor.frame(0.4, 2.5e-3, [121.3, 97.6], Branch::Loading, 8);
    let reading = measure(&frame, &reference, &curve).reading.unwrap();
    assert!(reading.calibration_n >= lag.width * reading.force_n.value && !reading.out_of_range);
}

#[test]
fn grey_levels_beyond_those_seen_are_flagged() {
    let sensor = sensor(1.0);
    let reference = sensor.reference();
    let curve = sensor.curve(&reference, 4);
    // A small ball presses harder than any of the calibration.
    let frame = sensor.frame(0.15, 1.2e-3, [121.3, 97.6], Branch::Loading, 9);
    assert!(
        measure(&frame, &reference, &curve)
            .reading
            .unwrap()
            .out_of_range
    );
}

#[test]
fn frames_that_determine_no_curve_are_refused() {
    let disc = |grey: f32| GreyHistogram::from_differences(std::iter::repeat_n(grey, 500), AREA_M2);
    let frame =
        |grey: f32, force| CalibrationFrame::new(disc(grey), force, Branch::Loading).unwrap();
    let fit =
        |frames: &[CalibrationFrame]| PressureCurve::fit(frames, &PressureCurveOptions::default());
    let few: Vec<_> = (1..5)
        .map(|k| frame(10.0 * k as f32, f64::from(k)))
        .collect();
    assert_eq!(
        fit(&few),
        Err(ForceError::TooFewPairs {
            required: 5,
            found: 4
        })
    );
    let dark = vec![frame(0.0, 1.0); 6];
    assert!(matches!(
        fit(&dark),
        Err(ForceError::DegeneratePairs { .. })
    ));
    let idle = vec![frame(50.0, 0.0); 6];
    assert!(matches!(
        fit(&idle),
        Err(ForceError::DegeneratePairs { .. })
    ));
    for force in [f64::NAN, -0.1, f64::INFINITY] {
        assert!(CalibrationFrame::new(disc(3.0), force, Branch::Loading).is_err());
    }
    let options = PressureCurveOptions::default();
    for bad in [f64::NAN, -1.0, f64::INFINITY] {
        assert!(options.with_smoothness(bad).is_err());
        assert!(
            options.with_force_error(bad, 0.1).is_err()
                && options.with_force_error(0.1, bad).is_err()
        );
    }
    assert!(options.with_force_error(0.0, 0.0).is_err() && options.with_smoothness(0.0).is_err());
}

#[test]
fn measuring_with_a_curve_allocates_nothing_after_a_warm_up() {
    let sensor = sensor(1.1);
    let reference = sensor
        .reference()
        .with_noise(NoiseModel::new(0.5, 0.02).unwrap());
    let curve = sensor.curve(&reference, 5);
    let frame = sensor.frame(0.4, 2.5e-3, [121.3, 97.6], Branch::Loading, 8);
    let meter = ForceMeter::new([PIXEL_M; 2], &ForceOptions::default()).unwrap();
    let mut workspace = ForceWorkspace::default();
    let mut run = || {
        meter
            .measure_with(&mut workspace, frame.view(), &reference, &curve)
            .unwrap()
    };
    let first = run();
    let mut second = None;
    let counted = allocation_counter::measure(|| second = Some(run()));
    assert_eq!((counted.count_total, second), (0, Some(first)));
}

proptest! {
    #[test]
    fn curves_rise_through_the_origin_whatever_the_frames(
        greys in proptest::collection::vec(1.0_f32..250.0, 5..20),
        noise in proptest::collection::vec(0.2_f64..1.8, 20),
    ) {
        let frames: Vec<_> = greys
            .iter()
            .zip(&noise)
            .map(|(grey, noise)| {
                let disc = GreyHistogram::from_differences(std::iter::repeat_n(*grey, 100), 1e-9);
                CalibrationFrame::new(disc, noise * f64::from(*grey), Branch::Loading).unwrap()
            })
            .collect();
        // Forces that fall throughout leave the sums without a rising curve; that is refused.
        if let Ok(curve) = PressureCurve::fit(&frames, &PressureCurveOptions::default()) {
            prop_assert_eq!(curve.pressure_pa(0.0).value, 0.0);
            let pressures: Vec<f64> = (-10..=260).map(|g| curve.pressure_pa(f64::from(g)).value).collect();
            prop_assert!(pressures.windows(2).all(|w| w[1] >= w[0]));
            prop_assert!(curve.pressure_pa(100.0).standard_error.is_finite());
        }
    }
}
