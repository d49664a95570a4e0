//! Averages that are robust against outliers.

/// How a field is averaged.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::field::{Averaging, StrainField};
/// use tactile_elasticity::strain::Infinitesimal;
///
/// // One mismatched point among ten.
/// let mut gradients = vec![Matrix3::from_diagonal_element(0.01_f64); 10];
/// gradients[4] *= 100.0;
/// let field = StrainField::from_gradients(&gradients, None, &Infinitesimal)?;
/// let mean = |averaging| field.summary_with(averaging).mean[(0, 0)];
/// assert!((mean(Averaging::Mean) - 0.109).abs() < 1e-12);
/// assert!((mean(Averaging::Median) - 0.01).abs() < 1e-12);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Averaging {
    /// Weighted mean and standard deviation.
    #[default]
    Mean,
    /// Huber's mean, k = 1.345 (95 % efficient on normal data); spread from the median absolute deviation.
    Huber,
    /// Weighted median; spread from the median absolute deviation.
    Median,
}

/// Median absolute deviation of normal data over its standard deviation.
const MAD: f64 = 0.674_489_750_196_081_7;
/// Huber's constant.
const K: f64 = 1.345;

/// The value below which half of the weight lies.
pub(crate) fn weighted_median(values: &[f64], weights: &[f64]) -> f64 {
    let mut order: Vec<usize> = (0..values.len()).filter(|&i| weights[i] > 0.0).collect();
    order.sort_by(|&i, &j| {
        values[i]
            .partial_cmp(&values[j])
            .unwrap_or(core::cmp::Ordering::Equal)
    });
    let total = order.iter().fold(0.0, |s, &i| s + weights[i]);
    let half = total * 0.5;
    let mut below = 0.0;
    for (k, &i) in order.iter().enumerate() {
        below += weights[i];
        if below > half {
            return values[i];
        }
        if below == half {
            let next = order.get(k + 1).map_or(values[i], |&j| values[j]);
            return (values[i] + next) * 0.5;
        }
    }
    0.0
}

/// Centre and spread of one component.
pub(crate) fn centre_and_spread(values: &[f64], weights: &[f64], how: Averaging) -> (f64, f64) {
    let median = weighted_median(values, weights);
    let deviations: Vec<f64> = values.iter().map(|&v| (v - median).abs()).collect();
    let spread = weighted_median(&deviations, weights) / MAD;
    if how == Averaging::Median || spread == 0.0 {
        return (median, spread);
    }
    let limit = spread * K;
    let mut centre = median;
    for _ in 0..50 {
        let (mut sum, mut total) = (0.0, 0.0);
        for (&v, &w) in values.iter().zip(weights) {
            let away = (v - centre).abs();
            let w = if away > limit { w * limit / away } else { w };
            sum += w * (v - centre);
            total += w;
        }
        let step = sum / total;
        centre += step;
        if step.abs() <= spread * 1e-7 {
            break;
        }
    }
    (centre, spread)
}
