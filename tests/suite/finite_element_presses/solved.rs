//! Presses and tables that are solved on request.

use super::{Ball, guide};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use std::ops::ControlFlow;
use std::sync::Arc;
use tactile_imaging::elasticity::contact::ContactTable;
use tactile_imaging::fem::{
    self, AppliedLoad, ContactTableOptions, Material, ObjectPress, ObjectShape,
};
use tactile_simulate::ContactState;

/// The radius of a ball and the layers (thickness, modulus) below it. An empty list is a rigid
/// flat.
type Sensor = (f64, &'static [(f64, f64)]);

const PAPER: &[(f64, f64)] = &[(2e-3, 136e3), (3e-3, 80e3), (5e-3, 34e3)];

/// The guide of the paper under balls of 3 and 8 mm, single layers on which contacts of 1.2 ball
/// radii have a/h of 1 and 1.5, and rigid flats.
pub(super) const SENSORS: [Sensor; 6] = [
    (3e-3, PAPER),
    (8e-3, PAPER),
    (5e-3, &[(6e-3, 80e3)]),
    (5e-3, &[(4e-3, 120e3)]),
    (4e-3, &[]),
    (20e-3, &[]),
];

/// The largest a/R of the laws and the tables. On a guide that is softer than the ball, approaches
/// that would give 1.15 on a rigid flat may exceed it.
const LARGEST_RATIO: f64 = 1.2;

/// Poisson's ratio of the elements for ½.
const POISSON_RATIO: f64 = 0.4999;

pub(super) fn table((radius_m, layers): &Sensor) -> Arc<ContactTable> {
    let guide = guide(layers);
    let options = ContactTableOptions::default();
    let table = fem::solve_contact_table(*radius_m, 0.5, &guide, &options, |_| {
        ControlFlow::Continue(())
    });
    Arc::new(table.unwrap())
}

/// A ball of 30 to 250 kPa on one of the sensors at four loads, a/R 0.1 to 1.2, on a coarser or
/// finer mesh than that of the tables.
pub(super) fn ball(seed: u64) -> Ball {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (radius_m, layers) = SENSORS[seed as usize % SENSORS.len()];
    let modulus = 30e3 * (250.0_f64 / 30.0).powf(rng.random::<f64>());
    let fineness = if rng.random::<bool>() { 4 } else { 7 };
    // Approaches at which a/R is about x: Hertz's a²/R minus the effect of large strain and of the
    // far side of the ball.
    let part = if layers.is_empty() { 0.75 } else { 0.9 };
    let ratios = [0.12, 0.45].map(|from: f64| {
        let smaller = from * (0.85_f64 / 0.45).powf(1.6 * rng.random::<f64>());
        [smaller, smaller * (1.15 + 0.25 * rng.random::<f64>())]
    });
    let mut ratios = ratios.concat();
    ratios.sort_by(f64::total_cmp);
    let loads: Vec<AppliedLoad> = (ratios.iter())
        .map(|x| AppliedLoad::Approach(part * x.min(1.15).powi(2) * radius_m))
        .collect();
    let scene = press(radius_m, layers, modulus, POISSON_RATIO, fineness);
    let states = scene.solve(&loads).states;
    let states: Vec<ContactState> = states
        .iter()
        .filter_map(ContactState::from_solved)
        .filter(|state| state.contact_radius_m < LARGEST_RATIO * radius_m)
        .collect();
    Ball {
        name: format!("{seed}: {modulus:.0} Pa, {radius_m} m on {layers:?}"),
        youngs_modulus_pa: modulus,
        radius_m,
        layers: layers.to_vec(),
        states,
    }
}

/// A press of a ball on layers (thickness, modulus). The rim of the guide differs from that of the
/// tables.
pub(crate) fn press(
    radius_m: f64,
    layers: &[(f64, f64)],
    modulus: f64,
    poisson_ratio: f64,
    fineness: usize,
) -> fem::FemScene {
    let material = |modulus| Material::new(modulus, poisson_ratio).unwrap();
    let mut press = ObjectPress::new(ObjectShape::Ball { radius_m }, material(modulus)).unwrap();
    if !layers.is_empty() {
        let thickness: f64 = layers.iter().map(|layer| layer.0).sum();
        let layer = |&(thickness_m, modulus): &(f64, f64)| fem::GuideLayer {
            thickness_m,
            material: material(modulus),
        };
        let rim = (5.0 * radius_m).max(3.0 * thickness);
        let guide = fem::Guide::new(layers.iter().map(layer).collect(), rim).unwrap();
        press = press.on_guide(guide).unwrap();
    }
    press.with_fineness(fineness).unwrap().scene().unwrap()
}
