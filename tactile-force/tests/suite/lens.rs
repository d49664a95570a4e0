//! The geometry of the camera compared with an independent forward model: Brown's polynomial
//! applied to the undistorted image.

use proptest::prelude::*;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, Normal};
use tactile_force::{DotPair, ForceError, LensFit, LensGeometry};

const SHAPE: (usize, usize) = (1042, 1392);
const CENTRE: [f64; 2] = [695.5, 520.5];
const SIZE: [f64; 2] = [21.6e-6, 22.032e-6];

/// Image position of a point in metres with a lens that moves the corners inwards by `barrel`. The
/// distortion is a function of the undistorted radius, the inverse of the crate's model.
fn seen(metres: [f64; 2], barrel: f64) -> [f64; 2] {
    let offset = [
        metres[0] - SIZE[0] * CENTRE[0],
        metres[1] - SIZE[1] * CENTRE[1],
    ];
    let corner = (SIZE[0] * CENTRE[0]).hypot(SIZE[1] * CENTRE[1]);
    let rho2 = (offset[0].powi(2) + offset[1].powi(2)) / corner.powi(2);
    let shrunk = 1.0 - barrel * rho2;
    [
        CENTRE[0] + offset[0] * shrunk / SIZE[0],
        CENTRE[1] + offset[1] * shrunk / SIZE[1],
    ]
}

/// A target of 15 × 11 dots, 1.9 mm apart, rotated by 10 mrad and shifted. The noise of the
/// centroids is `noise` pixels.
fn target(barrel: f64, noise: f64, seed: u64, mirror: bool) -> Vec<DotPair> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, noise).unwrap();
    let (sin, cos) = 0.01_f64.sin_cos();
    (0..15 * 11)
        .map(|k| [1.9e-3 * f64::from(k % 15), 1.9e-3 * f64::from(k / 15)])
        .map(|[x, y]| {
            let place = [1.8e-3 + cos * x - sin * y, 1.6e-3 + sin * x + cos * y];
            let [px, py] = seen(place, barrel);
            DotPair {
                pixel: [px + normal.sample(&mut rng), py + normal.sample(&mut rng)],
                target_m: [x, if mirror { -y } else { y }],
            }
        })
        .collect()
}

#[test]
fn a_barrel_of_three_percent_and_oblong_pixels_are_recovered() {
    let fit = LensFit::from_dots(&target(0.03, 0.02, 1, false), SHAPE).unwrap();
    assert_eq!(fit.stop, tactile_core::StopReason::Converged);
    let aspect = fit.pixel_size_m[1].value / fit.pixel_size_m[0].value;
    assert!(
        (aspect / (SIZE[1] / SIZE[0]) - 1.0).abs() < 1e-4,
        "{aspect}"
    );
    // A contact radius depends on distances: a ring of 2.7 mm anywhere in the frame.
    let mut worst = 0.0_f64;
    for centre in [[5e-3, 4e-3], [15e-3, 11.5e-3], [24e-3, 18e-3]] {
        for k in 0..24 {
            let (sin, cos) = (f64::from(k) * 0.13).sin_cos();
            let ends = [1.0, -1.0].map(|side| {
                let place = [
                    centre[0] + side * 2.7e-3 * cos,
                    centre[1] + side * 2.7e-3 * sin,
                ];
                fit.geometry.to_metres(seen(place, 0.03))
            });
            let diameter = (ends[0][0] - ends[1][0]).hypot(ends[0][1] - ends[1][1]);
            worst = worst.max((diameter / 5.4e-3 - 1.0).abs());
        }
    }
    // Without correction, diameters are wrong by up to 8 %. The remaining errors are the third
    // order, which two coefficients of the inverse cannot represent (3e-4 at the corner), and the
    // noise of the dots.
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn stated_errors_are_those_of_repeated_targets() {
    let of = |dots: &[DotPair]| {
        let fit = LensFit::from_dots(dots, SHAPE).unwrap();
        let ([hx, hy], [k1, k2]) = (fit.pixel_size_m, fit.distortion);
        [hx, hy, k1, k2]
    };
    let truth = of(&target(0.03, 0.0, 0, false));
    let mut squares = [0.0; 4];
    let seeds = 400;
    for seed in 1..=seeds {
        let found = of(&target(0.03, 0.05, seed, seed % 2 == 0));
        for k in 0..4 {
            squares[k] += ((found[k].value - truth[k].value) / found[k].standard_error).powi(2);
        }
    }
    for (k, sum) in squares.iter().enumerate() {
        let ratio = (sum / seeds as f64).sqrt();
        // A standard deviation from 400 seeds has an error of 3.5 %. Three times that.
        assert!((0.89..1.11).contains(&ratio), "parameter {k}: {ratio}");
    }
}

#[test]
fn targets_that_determine_nothing_are_refused() {
    let dots = target(0.0, 0.0, 1, false);
    assert_eq!(
        LensFit::from_dots(&dots[..6], SHAPE),
        Err(ForceError::TooFewPairs {
            required: 7,
            found: 6
        })
    );
    // One row of the target.
    let row = LensFit::from_dots(&dots[..15], SHAPE);
    assert!(
        matches!(row, Err(ForceError::DegeneratePairs { .. })),
        "{row:?}"
    );
    let mut bad = dots;
    bad[3].pixel[1] = f64::NAN;
    assert_eq!(
        LensFit::from_dots(&bad, SHAPE),
        Err(ForceError::NonFinitePair { index: 3 })
    );
}

#[test]
fn geometries_without_meaning_are_refused() {
    let lens = LensGeometry::new([20e-6; 2]).unwrap();
    for size in [0.0, -1.0, f64::NAN] {
        assert!(
            LensGeometry::new([size, 20e-6]).is_err() && LensGeometry::new([20e-6, size]).is_err()
        );
    }
    assert!(
        lens.with_distortion([f64::NAN, 0.0], 100.0, [0.0; 2])
            .is_err()
    );
    assert!(lens.with_distortion([0.0; 2], 0.0, [0.0; 2]).is_err());
    assert!(
        lens.with_distortion([0.0; 2], 100.0, [f64::INFINITY, 0.0])
            .is_err()
    );
    // 1 + 3 k₁ ρ² + 5 k₂ ρ⁴ vanishes at or inside ρ = 1.
    assert!(lens.with_distortion([0.0; 2], 100.0, [-0.34, 0.0]).is_err());
    assert!(lens.with_distortion([0.0; 2], 100.0, [-0.8, 0.28]).is_err());
    assert!(lens.with_distortion([0.0; 2], 100.0, [-0.3, 0.0]).is_ok());
}

proptest! {
    #[test]
    fn areas_of_pixels_are_the_maps_own(
        (x, y) in (0.0_f64..320.0, 0.0_f64..240.0),
        (k1, k2) in (-0.15_f64..0.15, -0.05_f64..0.05),
        aspect in 0.8_f64..1.25,
    ) {
        let lens = LensGeometry::new([20e-6, 20e-6 * aspect])
            .and_then(|l| l.with_distortion([159.5, 119.5], 199.3, [k1, k2]));
        prop_assume!(lens.is_ok());
        let lens = lens.unwrap();
        let inside = (x - 159.5).hypot(aspect * (y - 119.5)) < 199.3;
        prop_assume!(inside);
        let corner = |dx: f64, dy: f64| lens.to_metres([x + dx, y + dy]);
        let (a, b) = (corner(-0.5, -0.5), corner(0.5, -0.5));
        let (c, d) = (corner(0.5, 0.5), corner(-0.5, 0.5));
        let twice = (c[0] - a[0]) * (d[1] - b[1]) - (d[0] - b[0]) * (c[1] - a[1]);
        // Finite differences over a pixel: second order in 1/200.
        prop_assert!((lens.pixel_area_m2([x, y]) / (0.5 * twice) - 1.0).abs() < 1e-4);
    }
}

/// One ring of pixels compared with the whole contact, weighted with Hertz's pressure √(1 − r²/a²).
#[test]
fn the_mean_area_of_a_contacts_pixels_is_that_under_the_pressure() {
    let lens = LensGeometry::new([20e-6; 2])
        .and_then(|lens| lens.with_distortion([100.0; 2], 100.0, [0.05, 0.0]))
        .unwrap();
    let (centre, radius) = ([140.0, 80.0], 30.0_f64);
    let (mut sum, mut weights) = (0.0, 0.0);
    let offsets = || (-60..60).map(|k| 0.5 * f64::from(k) + 0.25);
    for (u, v) in offsets().flat_map(|u| offsets().map(move |v| (u, v))) {
        let weight = (1.0 - (u * u + v * v) / (radius * radius)).max(0.0).sqrt();
        sum += weight * lens.pixel_area_m2([centre[0] + u, centre[1] + v]);
        weights += weight;
    }
    let found = lens.mean_pixel_area_m2(centre, radius);
    // Accurate to second order: 3 k₁² ρ⁴, which differs between the ring and the contact by 4e-6.
    // Half pixels contribute about 1e-5.
    assert!((found * weights / sum - 1.0).abs() < 5e-5, "{found:e}");
}
