//! The surface of the guide under a contact.
use super::contact::ContactReading;
use crate::core::Estimate;
use crate::elasticity::contact::{Bond, Waveguide};
use crate::elasticity::modulus::Bodies;

/// Relative standard error of the depth because of large strain: this factor times depth over
/// contact radius, up to [`MOST_SLOPE`], and times depth over thickness. The law assumes small
/// strains.
const SLOPE_ERROR: f64 = 0.075;
const COMPRESSION_ERROR: f64 = 0.1;
const MOST_SLOPE: f64 = 0.5;

/// Relative standard error at a/h = 1 because the pressure on thin layers is flatter. It is
/// proportional to (a/h)².
///
/// With these three constants, 95 of 100 intervals contain the value from finite elements. This was
/// tested for a/R up to 1.15 and a/h up to 1.4
/// (`PRESSES=48 cargo test --release --test suite depressions`).
const THIN_LAYER_ERROR: f64 = 0.025;

/// Depths in metres at distances from the centre of the contact. `None` if the force is unknown or
/// the guide has no layers.
///
/// The error combines those of force, contact radius, layers and law.
pub(super) fn depths(
    contact: &ContactReading,
    bodies: &Bodies,
    distances_m: &[f64],
) -> Option<Vec<Estimate>> {
    let guide = bodies.guide()?;
    let force = contact.force_n?;
    let radius = contact.contact_radius_m;
    let places: Vec<f64> = std::iter::once(0.0)
        .chain(distances_m.iter().copied())
        .collect();
    let found = guide
        .depression_m(Bond::Bonded, force.value, radius.value, &places)
        .ok()?;
    let (&greatest, asked) = found.split_first()?;
    // On a half-space the depth on the axis is proportional to 1/a. On layers and off the axis it
    // varies less.
    let share = law_error(guide, radius.value, greatest)
        .hypot(force.relative_error())
        .hypot(radius.relative_error())
        .hypot(bodies.guide_compliance(radius.value).standard_error());
    // The error of the law is a fraction of the largest depth, also at the rim.
    let depth = |&depth_m: &f64| Estimate::new(depth_m, share * greatest);
    Some(asked.iter().map(depth).collect())
}

fn law_error(guide: &Waveguide, contact_radius_m: f64, depth_m: f64) -> f64 {
    let thickness = guide.thickness_m();
    let thin = THIN_LAYER_ERROR * (contact_radius_m / thickness).powi(2);
    let strain = SLOPE_ERROR * (depth_m / contact_radius_m).min(MOST_SLOPE);
    thin.hypot(strain)
        .hypot(COMPRESSION_ERROR * depth_m / thickness)
}
