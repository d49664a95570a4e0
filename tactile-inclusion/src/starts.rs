//! Inclusions that fits start from.

use super::forward::{Forward, Prediction};
use super::parameters::{LumpParameters, Parameters};
use super::progress::Counter;

/// Diameters and depths over the face's radius, and contrasts E₁/E₀, that a face can see.
const DIAMETERS: [f64; 3] = [0.35, 0.65, 1.05];
const DEPTHS: [f64; 3] = [0.15, 0.3, 0.55];
const CONTRASTS: [f64; 2] = [2.5, 8.0];
/// Part of the block's height that an inclusion may reach down to.
const REACH: f64 = 0.95;

/// An inclusion in a block, and its pressures.
#[derive(Debug, Clone)]
pub(super) struct Start {
    pub(super) parameters: Parameters,
    pub(super) predicted: Prediction,
    /// Part by which each value exceeds that of a plain block on the same mesh.
    pub(super) added: Vec<f64>,
}

/// The grid of inclusions in a plain block under a face of this radius; `None` where the search is to end.
pub(super) fn starts(
    forward: &Forward,
    plain: &Parameters,
    counter: &mut Counter<'_>,
) -> Option<Vec<Start>> {
    let face_radius_m = forward.guide.radius_m();
    let mut starts = Vec::new();
    for diameter in DIAMETERS {
        for depth in DEPTHS {
            let lump = |contrast: f64| LumpParameters {
                diameter_m: diameter * face_radius_m,
                depth_m: depth * face_radius_m,
                youngs_modulus_pa: contrast * plain.block_modulus_pa,
            };
            if (diameter + depth) * face_radius_m >= REACH * plain.height_m {
                continue;
            }
            let with = |contrast: f64| Parameters {
                lump: Some(lump(contrast)),
                ..*plain
            };
            if !counter.step() {
                return None;
            }
            let Some(none) = forward.predict(&with(1.0)) else {
                continue;
            };
            for contrast in CONTRASTS {
                if !counter.step() {
                    return None;
                }
                let parameters = with(contrast);
                let Some(predicted) = forward.predict(&parameters) else {
                    continue;
                };
                let added = predicted.values.iter().zip(&none.values);
                starts.push(Start {
                    parameters,
                    added: added.map(|(with, none)| with / none - 1.0).collect(),
                    predicted,
                });
            }
        }
    }
    Some(starts)
}
