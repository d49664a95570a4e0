//! Compares averages with brute force, their sum, and reference numbers.

use crate::pixel_average::{Disc, Profile, SMOOTH, corner};
use std::f64::consts::PI;

/// Mean over a pixel by `n`×`n` midpoints.
fn sampled(disc: &Disc, profile: Profile, row: isize, col: isize, n: usize) -> f64 {
    let offset = |k: usize| (k as f64 + 0.5) / n as f64 - 0.5;
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let x =
                (col as f64 + offset(j) - disc.centre_px[0]) * disc.pixel_size_m[0] / disc.radius_m;
            let y =
                (row as f64 + offset(i) - disc.centre_px[1]) * disc.pixel_size_m[1] / disc.radius_m;
            let rest = (1.0 - x * x - y * y).max(0.0);
            sum += if profile == Profile::Hemisphere {
                rest.sqrt()
            } else {
                rest
            };
        }
    }
    sum / (n * n) as f64
}

#[test]
fn averages_agree_with_brute_force_for_oblong_pixels_inside_and_at_the_rim() {
    let disc = Disc {
        centre_px: [6.3, 4.8],
        radius_m: 4.1,
        pixel_size_m: [0.9, 1.3],
    };
    for profile in [Profile::Hemisphere, Profile::Paraboloid] {
        let patch = disc.average(profile, [[0, 10], [0, 13]]);
        for ((r, c), &value) in patch.values.indexed_iter() {
            let slow = sampled(&disc, profile, r as isize, c as isize, 400);
            // 400 midpoints per side have an error of about h^1.5 = 1e-4 of a pixel at the rim,
            // where the slope is infinite.
            assert!(
                (value - slow).abs() < 1e-4,
                "{profile:?} row {r} column {c}: {value} {slow}"
            );
        }
    }
}

#[test]
fn the_sum_over_pixels_is_the_integral() {
    for (centre, radius) in [
        ([40.2, 33.9], 27.3),
        ([40.0, 33.5], 12.0),
        ([40.13, 33.4], 0.3),
    ] {
        let disc = Disc {
            centre_px: centre,
            radius_m: radius,
            pixel_size_m: [1.0, 0.8],
        };
        let window = disc.window([80, 80], 0);
        let hemisphere = disc.average(Profile::Hemisphere, window).values.sum() * 0.8;
        let paraboloid = disc.average(Profile::Paraboloid, window).values.sum() * 0.8;
        let (a2, eps) = (radius * radius, f64::EPSILON);
        // The terms at common corners cancel. The remainder is the rounding of about a² pixels of
        // size eps·a².
        assert!(
            (hemisphere / (2.0 / 3.0 * PI * a2) - 1.0).abs() < 1e3 * eps,
            "{hemisphere}"
        );
        assert!(
            (paraboloid / (0.5 * PI * a2) - 1.0).abs() < 1e3 * eps,
            "{paraboloid}"
        );
    }
}

#[test]
fn a_disc_cut_by_the_frame_keeps_the_values_of_its_visible_pixels() {
    let disc = Disc {
        centre_px: [1.4, 9.2],
        radius_m: 6.0,
        pixel_size_m: [1.0; 2],
    };
    let whole = disc.average(Profile::Hemisphere, [[-10, 30], [-10, 30]]);
    let cut = disc.average(Profile::Hemisphere, disc.window([12, 12], 0));
    assert_eq!(cut.origin, [3, 0]);
    for ((r, c), &value) in cut.values.indexed_iter() {
        let same = whole.values[[r + 3 + 10, c + 10]];
        assert!(
            (value - same).abs() < 1e-13,
            "the corner sums differ by rounding only"
        );
    }
}

#[test]
fn quadrature_and_corners_agree_where_both_hold() {
    let disc = Disc {
        centre_px: [50.3, 49.8],
        radius_m: 60.0,
        pixel_size_m: [1.1, 0.7],
    };
    for profile in [Profile::Hemisphere, Profile::Paraboloid] {
        let patch = disc.average(profile, disc.window([100, 100], 0));
        let (mut smooth, mut worst) = (0, 0.0_f64);
        for ((r, c), &value) in patch.values.indexed_iter() {
            let at = |axis: usize, k: isize| {
                (k as f64 - 0.5 - disc.centre_px[axis]) * disc.pixel_size_m[axis] / disc.radius_m
            };
            let (col, row) = (c as isize + patch.origin[1], r as isize + patch.origin[0]);
            let g = |i: isize, j: isize| corner(profile, at(0, col + i), at(1, row + j));
            let exact = (g(1, 1) - g(0, 1) - g(1, 0) + g(0, 0)) / (1.1 * 0.7 / 3600.0);
            let x = at(0, col).abs().max(at(0, col + 1).abs());
            let y = at(1, row).abs().max(at(1, row + 1).abs());
            smooth += usize::from(1.1 / 60.0 < SMOOTH * (1.0 - x * x - y * y));
            worst = worst.max((value - exact.max(0.0)).abs());
        }
        assert!(smooth > 1000, "{smooth}");
        // Rounding of the corners: 4 ulps of 1 over a pixel of 2e-4 of the squared radius is 4e-12.
        assert!(worst < 4e-12, "{profile:?} {worst:e}");
    }
}

#[test]
fn averages_agree_with_the_reference_numbers() {
    let Some(data) = test_support::reference("image.json") else {
        return;
    };
    let mut cases = 0;
    let all = data["cases"].as_array().unwrap();
    for case in all.iter().filter(|case| case["kind"] == "hertz") {
        let pitch = case["pitch"].as_f64().unwrap();
        let size = case["size"].as_u64().unwrap() as isize;
        let at = |name: &str| case["params"][name].as_f64().unwrap();
        // In the reference, pixel (0, 0) covers [0, h] × [0, h]; here its centre is the origin.
        let centre_px = [at("cx") / pitch - 0.5, at("cy") / pitch - 0.5];
        let disc = Disc {
            centre_px,
            radius_m: at("a"),
            pixel_size_m: [pitch; 2],
        };
        let found = disc.average(Profile::Hemisphere, [[0, size], [0, size]]);
        // Near the rim, corner values are of size 1 in units of the radius, and a pixel of (h/a)².
        // The discs whose rim is hit have radii below 10 pixels.
        let cancelled = 20.0 * f64::EPSILON * (at("a") / pitch).clamp(1.0, 10.0).powi(2);
        let Some(expected) = case["expected"]["pixels"].as_array() else {
            let is_empty = found.values.iter().all(|&v| v == 0.0);
            assert!(is_empty, "{}", case["id"]);
            continue;
        };
        let expected = expected.iter().flat_map(|line| line.as_array().unwrap());
        for (value, found) in expected.zip(&found.values) {
            let error = (at("amplitude") * found - value.as_f64().unwrap()).abs() / at("amplitude");
            assert!(error < cancelled, "{}: {error:e}", case["id"]);
        }
        cases += 1;
    }
    assert!(cases >= 7);
}
