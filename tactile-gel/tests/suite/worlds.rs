//! Surfaces whose contacts, depths and forces are known exactly.
#![allow(clippy::print_stdout)]

use crate::sensors::{BALL_PX, PIXEL_M, calibrated, flat, gel, presses, random};
use tactile_gel::simulate::{ElasticFace, HertzPress};
use tactile_gel::{BallPress, GaugeForce, GelForce, GelFrame, GelLayer, GelSensor};

const MODULUS_PA: f64 = 1e5;
const LAYER_M: f64 = 4e-3;
const RATIO: f64 = 0.48;

fn count(variable: &str, usual: usize) -> usize {
    std::env::var(variable)
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(usual)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Contacts of 10 to 50 px with slopes from 0.04 to 0.5, on a half-space and on a bonded layer:
/// areas are within a tenth, depths and forces within their errors.
/// `cargo run --release -p tactile-gel --example exact_worlds` renders more of them, under other
/// lamps.
#[test]
fn areas_depths_and_forces_are_those_of_exact_worlds() {
    let gel = gel();
    let (sensor, report) = calibrated(&gel);
    println!(
        "{:?} {:?} {:?}",
        sensor.model().slope_standard_error(),
        report.face,
        report.doubts
    );
    let layer = GelLayer::new(LAYER_M, RATIO, [MODULUS_PA, 0.0]);
    let law = GelForce::new(&layer, &sensor).unwrap();
    let stiff = MODULUS_PA / (1.0 - RATIO * RATIO);
    let worlds = count("WORLDS", 16);
    let (mut area, mut depth, mut far, mut force) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut held = [0, 0, 0];
    let mut areas_held = 0;
    for k in 0..worlds {
        let radius = 10.0 * (5.0_f64).powf(random(k, 3));
        let slope = 0.04 * (10.0_f64).powf(random(k, 4));
        let at = [110.0 + 100.0 * random(k, 5), 90.0 + 60.0 * random(k, 6)];
        let press = HertzPress::ball(at, radius / slope, radius);
        let on_layer = k % 2 == 1;
        let face = match on_layer {
            true => ElasticFace {
                thickness_px: LAYER_M / PIXEL_M,
                poisson_ratio: RATIO,
            },
            false => ElasticFace::HALF_SPACE,
        };
        let truth = face.depth_px(gel.shape, &[press]);
        let frame = sensor
            .read(gel.frame(&truth, 1000 + k as u64).view())
            .unwrap();
        assert!(frame.doubts.is_empty(), "{k}: {:?}", frame.doubts);
        assert_eq!(frame.contacts.len(), 1, "{k}: {radius} {slope}");
        let contact = &frame.contacts[0];
        let true_area = std::f64::consts::PI * radius * radius * PIXEL_M * PIXEL_M;
        let top = [at[1].round() as usize, at[0].round() as usize];
        let ring = face.depth_px(
            [1, 400],
            &[HertzPress {
                at_px: [0.0, 0.0],
                ..press
            }],
        );
        let low = radius.floor() as usize;
        let rim =
            ring[[0, low]] + (radius - radius.floor()) * (ring[[0, low + 1]] - ring[[0, low]]);
        let below_rim = (truth[top] - rim) * PIXEL_M;
        let below_far = truth[top] * PIXEL_M;
        area.push((contact.area_m2.value / true_area - 1.0).abs());
        let within = |found: tactile_core::Estimate, truth: f64| {
            usize::from((found.value - truth).abs() < 1.96 * found.standard_error)
        };
        areas_held += within(contact.area_m2, true_area);
        depth.push((contact.depth_m.value / below_rim - 1.0).abs());
        held[0] += within(contact.depth_m, below_rim);
        far.push((contact.depth_below_far_m.value / below_far - 1.0).abs());
        held[1] += within(contact.depth_below_far_m, below_far);
        let mut text = String::new();
        if on_layer {
            let found = law.force(&frame).unwrap();
            let truth = press.force_n(stiff, PIXEL_M);
            force.push((found.value / truth - 1.0).abs());
            held[2] += within(found, truth);
            // About the middle of the frame, without markers: the three components of the surface
            // itself.
            let wrench = law.wrench(&frame, None).unwrap();
            let [x, y] = [at[0] - 159.5, at[1] - 119.5].map(|px| px * PIXEL_M);
            for (moment, arm) in [(wrench.torque_nm[0], y), (wrench.torque_nm[1], -x)] {
                // A centroid error of one pixel, and the error of the force.
                let miss = (moment.unwrap().value - arm * truth).abs();
                let bound = truth * PIXEL_M + 3.0 * found.standard_error * arm.abs();
                assert!(miss < bound, "{k}: {wrench:?}, {arm} m times {truth} N");
            }
            assert_eq!(wrench.force_n[2].map(|f| f.value), Some(found.value));
            assert!(wrench.force_n[0].is_none() && wrench.torque_nm[2].is_none());
            text = format!(
                "force {:.3} ± {:.3}",
                found.value / truth,
                found.standard_error / truth
            );
        }
        println!(
            "{k} {} a {radius:.1} s {slope:.3}: area {:.3} ± {:.3} rim {:.3} ± {:.3} far {:.3} ± {:.3} {text}",
            if on_layer { "layer" } else { "half " },
            contact.area_m2.value / true_area,
            contact.area_m2.standard_error / true_area,
            contact.depth_m.value / below_rim,
            contact.depth_m.standard_error / below_rim,
            contact.depth_below_far_m.value / below_far,
            contact.depth_below_far_m.standard_error / below_far,
        );
    }
    let tenth = area.iter().filter(|a| **a < 0.1).count();
    println!(
        "{worlds}: area within 10 % {tenth}, held {areas_held}; rim {:.4} {}; far {:.4} {}; force {:.4} {}",
        median(depth.clone()),
        held[0],
        median(far.clone()),
        held[1],
        median(force.clone()),
        held[2],
    );
    assert!(20 * tenth >= 19 * worlds, "{tenth}");
    assert!(median(depth) < 0.03 && median(far) < 0.03 && median(force) < 0.05);
}

/// A frame without contact has none, and neither does the reference itself.
#[test]
fn untouched_frames_have_no_contact() {
    let gel = gel();
    let sensor = calibrated(&gel).0;
    for seed in 0..count("FRAMES", 40) as u64 {
        let frame = sensor.read(flat(&gel, seed).view()).unwrap();
        assert!(
            frame.contacts.is_empty() && frame.doubts.is_empty(),
            "{seed}: {:?}",
            frame.doubts
        );
        // Noise of 0.007 in the slopes accumulates over the frame.
        let largest = frame.depth_m.iter().fold(0.0_f64, |m, z| m.max(z.abs()));
        assert!(largest < 0.25 * PIXEL_M, "{seed}: {largest}");
    }
}

/// Neighbouring contacts have the results that each has alone.
#[test]
fn several_contacts_are_those_alone() {
    let gel = gel();
    let sensor = calibrated(&gel).0;
    let presses = [
        HertzPress::ball([80.0, 70.0], 40.0, 14.0),
        HertzPress::ball([215.0, 80.0], 160.0, 32.0),
        HertzPress::ball([110.0, 170.0], 60.0, 11.0),
        HertzPress::ball([240.0, 180.0], 50.0, 16.0),
    ];
    let face = ElasticFace {
        thickness_px: LAYER_M / PIXEL_M,
        poisson_ratio: RATIO,
    };
    let read = |presses: &[HertzPress]| {
        sensor
            .read(gel.frame(&face.depth_px(gel.shape, presses), 5).view())
            .unwrap()
    };
    let together = read(&presses);
    assert_eq!(together.contacts.len(), 4, "{:?}", together.contacts);
    for press in presses {
        let alone = &read(&[press]).contacts[0];
        let near = |c: &&tactile_gel::GelContact| {
            let [x, y] = [0, 1].map(|k| c.centroid_px[k].value - press.at_px[k]);
            x.hypot(y) < 2.0
        };
        let found = together.contacts.iter().find(near).expect("the contact");
        let ratio = found.depth_m.value / alone.depth_m.value;
        let bound = 3.0 * alone.depth_m.relative_error();
        assert!((ratio - 1.0).abs() < bound, "{ratio} {bound}");
        assert!((found.area_m2.value / alone.area_m2.value - 1.0).abs() < 0.1);
    }
}

/// A wrongly drawn circle is reported, and the sensor hardly changes.
#[test]
fn a_wrong_circle_is_named() {
    let gel = gel();
    let frames = presses(&gel);
    let (sensor, found) = calibrated(&gel);
    let drawn = |k: usize| {
        let [x, y, radius] = found.circles[k].found_px.expect("a contact");
        Some([if k == 4 { x + 9.0 } else { x }, y, radius])
    };
    let given: Vec<_> = frames
        .iter()
        .enumerate()
        .map(|(k, frame)| BallPress {
            frame: frame.into(),
            ball_radius_m: BALL_PX * PIXEL_M,
            circle_px: drawn(k),
        })
        .collect();
    let (other, report) = GelSensor::calibrate(flat(&gel, 0).view(), PIXEL_M, &given).unwrap();
    let wrong: Vec<_> = (0..12).filter(|k| report.circles[*k].wrong).collect();
    assert_eq!(wrong, [4]);
    let [a, b] = [&sensor, &other].map(|s| s.model().slope_standard_error());
    assert!((a / b - 1.0).abs() < 0.5, "{a} {b}");
}

/// With a gauge the forces of other presses of its ball are determined, even on a layer whose
/// modulus is not stated.
#[test]
fn a_gauge_gives_forces_without_a_layer() {
    let gel = gel();
    let sensor = calibrated(&gel).0;
    let face = ElasticFace {
        thickness_px: LAYER_M / PIXEL_M,
        poisson_ratio: RATIO,
    };
    let read = |k: usize, radius: f64| {
        let at = [90.0 + 140.0 * random(k, 5), 80.0 + 80.0 * random(k, 6)];
        let press = HertzPress::ball(at, 60.0, radius);
        let frame = gel.frame(&face.depth_px(gel.shape, &[press]), 700 + k as u64);
        let force = press.force_n(MODULUS_PA, PIXEL_M);
        (sensor.read(&frame).unwrap(), force)
    };
    let given: Vec<_> = (0..12).map(|k| read(k, 10.0 + 1.8 * k as f64)).collect();
    let readings: Vec<(&GelFrame, f64)> = given.iter().map(|(frame, f)| (frame, *f)).collect();
    let law = GaugeForce::fit(&readings).unwrap();
    let others = (20..40).map(|k| read(k, 11.0 + 18.0 * random(k, 7)));
    let misses = others.map(|(frame, force)| {
        let found = law.forces(&frame)[0];
        assert!(found.relative_error() < 0.15, "{found:?}");
        (found.value - force) / found.standard_error
    });
    let misses: Vec<f64> = misses.collect();
    // With ten degrees of freedom, 19 of 20 are expected within 2.2 errors.
    let held = misses.iter().filter(|z| z.abs() < 2.2).count();
    assert!(held >= 17, "{misses:?}");
    assert!(law.at_volume(1.0).standard_error.is_infinite());
    assert!(GaugeForce::fit(&readings[..3]).is_err());
}
