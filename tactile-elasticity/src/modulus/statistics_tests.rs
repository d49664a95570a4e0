use super::*;

use approx::assert_relative_eq;

/// Compares the mean, its variance, χ² and the weights with the plain formulas for the full
/// covariance matrix.
#[test]
fn shared_errors_give_what_the_matrix_of_all_pairs_gives() {
    let z = [2.0, 2.3, 1.8, 2.1, 2.6, 1.9];
    let loads = [0, 0, 1, 2, 2, 3];
    let own = |i: usize| 0.1 + 0.03 * i as f64;
    let in_load = |i: usize| 0.2 - 0.02 * i as f64;
    let scale = |_: usize| 0.3;
    let slope = |i: usize| 0.05 * (i as f64 - 1.0);
    let number = |i: usize| {
        Uncertain::exact(z[i])
            .by(Source::Noise, own(i))
            .by(Source::Gain, scale(i))
            .by(Source::PixelSize, slope(i))
    };
    let numbers: [_; 6] = std::array::from_fn(number);
    let covariance = Covariance::of(&numbers, loads.into_iter()).with(
        Source::Noise,
        CommonTo::Load,
        None,
        in_load,
    );
    let dense = DMatrix::from_fn(6, 6, |i, j| {
        let own = if i == j { own(i).powi(2) } else { 0.0 };
        let in_load = if loads[i] == loads[j] {
            in_load(i) * in_load(j)
        } else {
            0.0
        };
        own + in_load + scale(i) * scale(j) + slope(i) * slope(j)
    });
    let inverse = dense.clone().try_inverse().unwrap();
    let information = inverse.sum();
    let weights = inverse.column_sum() / information;
    let mean = weights.dot(&DVector::from_row_slice(&z));
    let residual = DVector::from_row_slice(&z).add_scalar(-mean);
    let chi_squared = residual.dot(&(&inverse * &residual));

    // Inverting a matrix with this condition number (10²) costs three of sixteen digits.
    let found = common_mean(&z, &covariance).unwrap();
    assert_relative_eq!(found.mean.value, mean, max_relative = 1e-12);
    assert_relative_eq!(
        found.mean.standard_error().powi(2),
        1.0 / information,
        max_relative = 1e-12
    );
    assert_relative_eq!(found.chi_squared, chi_squared, max_relative = 1e-11);
    assert_relative_eq!(found.weights, weights, max_relative = 1e-11);
    let of_scale: f64 = (0..6).map(|i| weights[i] * scale(i)).sum();
    assert_relative_eq!(
        found.mean.part(Source::Gain),
        of_scale,
        max_relative = 1e-11
    );
}

#[test]
fn a_shared_error_far_above_all_others_costs_no_digits() {
    let number = Uncertain::exact(0.0)
        .by(Source::Noise, 1e-9)
        .by(Source::Gain, 1.0);
    let covariance = Covariance::of(&[number; 3], 0..3);
    let found = common_mean(&[1.0, 1.0 + 1e-9, 1.0 - 1e-9], &covariance).unwrap();
    assert_relative_eq!(found.mean.value, 1.0, max_relative = 1e-15);
    assert_relative_eq!(found.mean.standard_error(), 1.0, max_relative = 1e-12);
    // There are two residuals of one standard error each. z is rounded to 1e-16, which is a
    // ten-millionth of the residuals.
    assert_relative_eq!(found.chi_squared, 2.0, max_relative = 1e-6);
}
