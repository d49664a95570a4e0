//! The surface of the guide under a contact.
use super::contact::ContactReading;
use crate::core::Estimate;
use crate::elasticity::contact::{Bond, Waveguide, depression_m};
use crate::elasticity::modulus::Bodies;

/// Relative standard error of the depth by large strain: this much of depth over contact radius,
/// up to [`MOST_SLOPE`], and this much of depth over thickness. The law is for small strains.
const SLOPE_ERROR: f64 = 0.075;
const COMPRESSION_ERROR: f64 = 0.1;
const MOST_SLOPE: f64 = 0.5;

/// Relative standard error at a/h = 1 by the flatter pressure on thin layers. It goes as (a/h)².
///
/// These three leave 95 of 100 intervals true beside finite elements at a/R up to 1.15 and a/h up
/// to 1.4 (`PRESSES=48 cargo test --release --test suite depressions`).
const THIN_LAYER_ERROR: f64 = 0.025;

/// Depths in metres at distances from the contact's centre. `None` where the force is not known or
/// the guide has no layers.
///
/// The errors of force, contact radius and layers count, and that of the law.
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
    let found = depression_m(guide, Bond::Bonded, force.value, radius.value, &places).ok()?;
    let (&greatest, asked) = found.split_first()?;
    // On a half-space the depth on the axis goes as 1/a, on layers and elsewhere it changes less.
    let share = law_error(guide, radius.value, greatest)
        .hypot(force.relative_error())
        .hypot(radius.relative_error())
        .hypot(bodies.guide_compliance(radius.value).standard_error());
    // The law is off by a share of the greatest depth, at the rim too.
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
