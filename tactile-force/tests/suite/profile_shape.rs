//! A contact that is not that of a ball is reported.
#![allow(clippy::print_stdout)]

use ndarray::Array2;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use tactile_force::{DriftCorrection, HertzFit, ProfileShape, ReferenceFrame};

use crate::blob::calibration;
use crate::simulated::{SHAPE, measure};

/// Light at (x, y).
type Level = dyn Fn(f64, f64) -> f64;

/// The profile fitted to a contact whose light is `level` at (x, y), in units of a radius of 35
/// pixels and with 120 grey levels at 1.
fn fitted(level: impl Fn(f64, f64) -> f64, seed: u64) -> HertzFit {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut frame = |pressed: bool| {
        Array2::from_shape_fn(SHAPE, |(y, x)| {
            let mut light = 0.0;
            for k in 0..if pressed { 9 } else { 0 } {
                let (dx, dy) = (
                    f64::from(k % 3) / 3.0 - 1.0 / 3.0,
                    f64::from(k / 3) / 3.0 - 1.0 / 3.0,
                );
                light += 120.0 / 9.0
                    * level(
                        (x as f64 + dx - 121.3) / 35.0,
                        (y as f64 + dy - 97.6) / 35.0,
                    );
            }
            let noise: f64 = StandardNormal.sample(&mut rng);
            (40.0 + light + (1.0 + 0.02 * light).sqrt() * noise).round() as u8
        })
    };
    let reference = ReferenceFrame::new(frame(false).view()).unwrap();
    measure(
        &frame(true),
        &reference,
        &calibration(),
        DriftCorrection::Automatic,
    )
    .profile
    .unwrap()
}

fn radius2(x: f64, y: f64) -> f64 {
    x * x + y * y
}

fn ball(x: f64, y: f64) -> f64 {
    (1.0 - radius2(x, y)).max(0.0).sqrt()
}

#[test]
fn balls_are_balls() {
    for seed in 0..20 {
        let fit = fitted(ball, seed);
        assert_eq!(
            fit.shape,
            ProfileShape::Hertz,
            "{seed}: {} {}",
            fit.radial_misfit,
            fit.azimuthal_misfit
        );
        assert!(fit.radial_misfit < 0.003, "{seed}: {}", fit.radial_misfit);
        assert_eq!(fit.bend.value, 0.0, "{seed}: nothing to explain");
    }
}

/// Contacts at finite strain: finite elements give c from −0.3 (stiff balls in soft layers) to 0.15
/// (balls flattened on glass).
#[test]
fn radii_of_bent_profiles_are_right() {
    for (seed, bend) in [-0.3, -0.1, 0.08, 0.15].into_iter().enumerate() {
        let bent = |x: f64, y: f64| ball(x, y) * (1.0 - bend * radius2(x, y));
        let fit = fitted(bent, seed as u64);
        let (radius, found) = (fit.radius_px, fit.bend);
        // Four standard errors plus the error of 3 × 3 samples per pixel at the edge (0.01 px for a
        // Hertz profile).
        let off = (radius.value - 35.0).abs();
        assert!(
            off < 4.0 * radius.standard_error() + 0.01,
            "{bend}: {radius:?}"
        );
        assert!(
            (found.value - bend).abs() < 4.0 * found.standard_error + 0.005,
            "{bend}: {found:?}"
        );
        // The level of the centre, within half a grey level of rounding and the noise.
        let peak = fit.peak;
        assert!(
            (peak.value - 120.0).abs() < 4.0 * peak.standard_error + 0.1,
            "{bend}: {peak:?}"
        );
        // The best Hertz profile is 0.9 % too wide at c = −0.3.
        assert!(radius.standard_error() < 0.03, "{bend}: {radius:?}");
    }
}

#[test]
fn punches_pads_ellipses_and_rings_are_not() {
    let shapes: [(&str, &Level); 5] = [
        ("flat punch", &|x, y| {
            if radius2(x, y) < 0.999 {
                0.5 / (1.0 - radius2(x, y)).sqrt().max(0.4)
            } else {
                0.0
            }
        }),
        ("even pressure", &|x, y| {
            if radius2(x, y) < 1.0 { 1.0 } else { 0.0 }
        }),
        ("cone", &|x, y| (1.0 - radius2(x, y).sqrt()).max(0.0)),
        ("ellipse", &|x, y| ball(x / 1.2, y * 1.2)),
        ("ring", &|x, y| {
            if radius2(x, y) < 0.16 {
                0.3
            } else {
                ball(x, y)
            }
        }),
    ];
    for (name, level) in shapes {
        let fit = fitted(level, 3);
        println!(
            "{name}: {:.4} {:.4}",
            fit.radial_misfit, fit.azimuthal_misfit
        );
        assert_eq!(
            fit.shape,
            ProfileShape::NotHertz,
            "{name}: {} {}",
            fit.radial_misfit,
            fit.azimuthal_misfit
        );
        // If the contact is not that of a ball, Gauss–Newton does not find a minimum, and ends when
        // χ² no longer decreases. There are two fits, with and without a bend. Each has the twelve
        // steps that are ample for a ball, and a few more.
        assert!(fit.iterations <= 40, "{name}: {}", fit.iterations);
    }
}
