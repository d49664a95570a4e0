//! The guide's layers as the calibration's contacts tell them.

use super::{PROFILE_ERROR, SensorCalibration};
use crate::force::Estimate;
use crate::scene::SceneLayer;
use crate::sensor::error::SensorError;
use crate::sensor::findings::{LayerFinding, PressFinding};
use crate::sensor::input::{Indenter, LayerInput};
use crate::sensor::layers::{self, Ball, BallContact, LayerFit};

impl SensorCalibration {
    /// Fits the layers to the contacts of balls, and notes the force that they have there.
    pub(super) fn fit_layers(
        &self,
        presses: &mut [PressFinding],
    ) -> Result<Option<LayerFit>, SensorError> {
        let (mut balls, mut contacts, mut places) = (Vec::<Ball>::new(), Vec::new(), Vec::new());
        for (place, press) in presses.iter().enumerate() {
            let (
                Indenter::Ball {
                    radius_m,
                    radius_error_m,
                },
                Some(radius),
            ) = (press.indenter, press.contact_radius_m)
            else {
                continue;
            };
            if radius.value > layers::LARGEST_CONTACT_RATIO * radius_m || press.force_n <= 0.0 {
                continue;
            }
            let known = balls.iter().position(|b| b.radius_m == radius_m);
            let ball = known.unwrap_or_else(|| {
                balls.push(Ball {
                    radius_m,
                    radius_error: radius_error_m / radius_m,
                });
                balls.len() - 1
            });
            contacts.push(BallContact {
                ball,
                force_n: press.force_n,
                force_error: (self.gauge_noise_n / press.force_n).max(1e-4),
                radius_m: radius.value,
                radius_error: (radius.standard_error / radius.value).hypot(PROFILE_ERROR),
            });
            places.push(place);
        }
        let fit = layers::fit(&self.layers, &balls, &contacts)?;
        if let Some(fit) = &fit {
            for (place, force) in places.into_iter().zip(&fit.forces_n) {
                presses[place].layers_force_n = Some(*force);
            }
        }
        Ok(fit)
    }

    pub(super) fn found_layers(&self, fit: Option<&LayerFit>) -> Vec<SceneLayer> {
        let layer = |(k, input): (usize, &LayerInput)| match fit {
            None => input.layer,
            Some(fit) => SceneLayer {
                thickness_m: fit.layers[k].thickness_m,
                youngs_modulus_pa: fit.layers[k].youngs_modulus_pa,
                poisson_ratio: fit.layers[k].poisson_ratio,
                ..input.layer
            },
        };
        self.layers.iter().enumerate().map(layer).collect()
    }

    /// The stated errors, independent of one another.
    pub(super) fn stated_covariance(&self) -> Vec<Vec<f64>> {
        let n = self.layers.len();
        let errors: Vec<[f64; 3]> = self
            .layers
            .iter()
            .map(LayerInput::parameter_errors)
            .collect();
        let entry = |i: usize, j: usize| {
            if i == j {
                errors[i % n][i / n].powi(2)
            } else {
                0.0
            }
        };
        (0..3 * n)
            .map(|i| (0..3 * n).map(|j| entry(i, j)).collect())
            .collect()
    }

    pub(super) fn layer_findings(&self, fit: Option<&LayerFit>) -> Vec<LayerFinding> {
        let n = self.layers.len();
        let mut findings = Vec::with_capacity(3 * n);
        for (layer, input) in self.layers.iter().enumerate() {
            let stated = input.layer;
            let rows = [
                ("youngs_modulus_pa", stated.youngs_modulus_pa, true),
                ("thickness_m", stated.thickness_m, true),
                ("poisson_ratio", stated.poisson_ratio, false),
            ];
            for (k, (parameter, value, logarithm)) in rows.into_iter().enumerate() {
                let unit = |value: f64| if logarithm { value } else { 1.0 };
                let stated = Estimate::new(value, input.parameter_errors()[k] * unit(value));
                let fitted = fit.map_or(stated, |fit| {
                    let found = &fit.layers[layer];
                    let values = [
                        found.youngs_modulus_pa,
                        found.thickness_m,
                        found.poisson_ratio,
                    ];
                    let error = fit.covariance[(k * n + layer, k * n + layer)].sqrt();
                    Estimate::new(values[k], error * unit(values[k]))
                });
                findings.push(LayerFinding {
                    layer,
                    parameter,
                    stated,
                    fitted,
                    identified: fitted.standard_error < 0.7 * stated.standard_error,
                });
            }
        }
        findings
    }
}

pub fn rows(fit: &LayerFit) -> Vec<Vec<f64>> {
    let row = |i: usize| fit.covariance.row(i).iter().copied().collect();
    (0..fit.covariance.nrows()).map(row).collect()
}
