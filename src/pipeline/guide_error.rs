//! What the errors of the guide's layers do to its stiffness under a contact.
use crate::elasticity::contact::{Bond, Layer, LayerEquation, Waveguide};
use nalgebra::{DMatrix, DVector};

/// Parameters of a layer whose errors count: ln E, ln h and ν.
pub(crate) const LAYER_PARAMETERS: usize = 3;

/// Step of the numerical derivatives: third powers of it are lost, rounding of the integral equation is far below.
const STEP: f64 = 1e-3;

/// ln of the stiffness E_g of the guide under a ball's contact of radius a, F = 4/3 E_g a³/R; `None` where the layer equation
/// cannot be solved.
pub(crate) fn log_stiffness(layers: &[Layer], radius_m: f64) -> Option<f64> {
    let guide = Waveguide::new(layers.to_vec()).ok()?;
    let equation = LayerEquation::of_layers(&guide, Bond::Bonded).ok()?;
    let contact = equation.solve(radius_m / guide.thickness_m()).ok()?;
    let top = layers.first()?;
    let plane_strain = top.youngs_modulus_pa / (1.0 - top.poisson_ratio.powi(2));
    Some(plane_strain.ln() + contact.force_ratio_same_radius.ln())
}

/// Layers with their parameters moved: ln E of all layers, then ln h, then ν.
pub(crate) fn moved(layers: &[Layer], step: &DVector<f64>) -> Vec<Layer> {
    let n = layers.len();
    let layer = |(i, layer): (usize, &Layer)| Layer {
        youngs_modulus_pa: layer.youngs_modulus_pa * step[i].exp(),
        thickness_m: layer.thickness_m * step[n + i].exp(),
        poisson_ratio: (layer.poisson_ratio + step[2 * n + i]).min(0.5),
    };
    layers.iter().enumerate().map(layer).collect()
}

/// Derivatives of [`log_stiffness`] by ln E, ln h and ν of the layers, in this order.
pub(crate) fn gradient(layers: &[Layer], radius_m: f64) -> Option<DVector<f64>> {
    let count = LAYER_PARAMETERS * layers.len();
    let mut slopes = DVector::zeros(count);
    for k in 0..count {
        // ν is at most ½: it is stepped downwards alone.
        let upper = if k < 2 * layers.len() { STEP } else { 0.0 };
        let at = |value: f64| {
            let mut step = DVector::zeros(count);
            step[k] = value;
            log_stiffness(&moved(layers, &step), radius_m)
        };
        slopes[k] = (at(upper)? - at(-STEP)?) / (upper + STEP);
    }
    Some(slopes)
}

/// Relative standard error of the guide's compliance under a contact of radius a.
pub(super) fn relative_error(
    layers: &[Layer],
    covariance: &DMatrix<f64>,
    radius_m: f64,
) -> Option<f64> {
    let slopes = gradient(layers, radius_m)?;
    (covariance.nrows() == slopes.len())
        .then(|| slopes.dot(&(covariance * &slopes)).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paper() -> Vec<Layer> {
        let layer = |thickness_m, youngs_modulus_pa| Layer {
            thickness_m,
            youngs_modulus_pa,
            poisson_ratio: 0.495,
        };
        vec![layer(2e-3, 1.36e5), layer(3e-3, 8e4), layer(5e-3, 3.4e4)]
    }

    /// All moduli and all lengths scaled together leave a known trace.
    #[test]
    fn the_gradient_obeys_the_scaling_laws() {
        let layers = paper();
        let slopes = gradient(&layers, 1.5e-3).unwrap();
        // Twice the moduli, twice the stiffness.
        let moduli: f64 = slopes.rows(0, 3).sum();
        assert!((moduli - 1.0).abs() < 1e-6, "{moduli}");
        // Thicker layers under a contact as much larger: no change; so the slopes by ln h undo that by ln a.
        let [low, high] = [1.5e-3 / 1.001, 1.5e-3 * 1.001].map(|a| log_stiffness(&layers, a));
        let by_radius = (high.unwrap() - low.unwrap()) / (2.0 * 1.001_f64.ln());
        let by_thickness: f64 = slopes.rows(3, 3).sum();
        assert!((by_radius + by_thickness).abs() < 1e-5);
    }

    #[test]
    fn errors_common_to_all_moduli_are_the_compliance_s() {
        let covariance = DMatrix::from_fn(9, 9, |i, j| if i < 3 && j < 3 { 4e-4 } else { 0.0 });
        let error = relative_error(&paper(), &covariance, 1e-3).unwrap();
        assert!((error - 0.02).abs() < 1e-7, "{error}");
    }
}
