//! Starting values of inclusions for the fits.

use crate::forward::Forward;
use crate::parameters::{LumpParameters, Parameters};
use crate::progress::Counter;

/// Fraction of the block's height to which an inclusion may extend.
pub(crate) const DEEPEST: f64 = 0.95;

/// Diameters and depths relative to the face radius, and contrasts E₁/E₀, that a face can detect.
pub(crate) const DIAMETERS: [f64; 3] = [0.35, 0.65, 1.05];
pub(crate) const DEPTHS: [f64; 3] = [0.15, 0.3, 0.55];
const CONTRASTS: [f64; 2] = [2.5, 8.0];

/// Contrast of a soft inclusion, and its contribution relative to that of one with the first
/// contrast: (c − 1) / (1 + 0.4 (c − 1)) for a ball of contrast c in an incompressible body (J. D.
/// Eshelby, Proc. R. Soc. A 241 (1957) 376). From stiff starts alone the fit of a wide soft
/// inclusion does not converge.
const SOFT: (f64, f64) = (0.4, -0.84);

/// An inclusion in a block, with its pressures.
#[derive(Debug, Clone)]
pub(crate) struct GridStart {
    pub parameters: Parameters,
    pub predicted: Vec<f64>,
    /// Relative excess of each value over that of a homogeneous block on the same mesh.
    pub added: Vec<f64>,
}

/// The grid of inclusions in a homogeneous block under a face of this radius. `None` if the search
/// was cancelled.
pub(crate) fn starts(
    forward: &Forward,
    homogeneous: &Parameters,
    counter: &mut Counter<'_>,
) -> Option<Vec<GridStart>> {
    let face_radius_m = forward.guide.radius_m();
    let mut starts = Vec::new();
    for diameter in DIAMETERS {
        for depth in DEPTHS {
            if (diameter + depth) * face_radius_m >= DEEPEST * homogeneous.height_m {
                continue;
            }
            let with = |contrast: f64| Parameters {
                lump: Some(LumpParameters::ball(
                    diameter * face_radius_m,
                    depth * face_radius_m,
                    contrast * homogeneous.block_modulus_pa,
                )),
                ..homogeneous.clone()
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
                let Some(predicted) = forward.predict(&with(contrast)) else {
                    continue;
                };
                let added = predicted.iter().zip(&none);
                let added: Vec<f64> = added.map(|(with, none)| with / none - 1.0).collect();
                let soft = (contrast == CONTRASTS[0]).then(|| {
                    let added = added.iter().map(|part| SOFT.1 * part);
                    (SOFT.0, added.collect())
                });
                for (contrast, added) in [(contrast, added)].into_iter().chain(soft) {
                    let pairs = added.iter().zip(&none);
                    starts.push(GridStart {
                        parameters: with(contrast),
                        predicted: pairs.map(|(part, none)| (1.0 + part) * none).collect(),
                        added,
                    });
                }
            }
        }
    }
    Some(starts)
}
