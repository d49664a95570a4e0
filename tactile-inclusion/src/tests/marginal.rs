//! Marginal posteriors of ridges with a closed form.

use crate::ridge::{Marginal, Node, Ridge};
use nalgebra::{DMatrix, DVector};
use statrs::function::erf::erfc;

/// Nodes at these deviations of ln E₁, with another coordinate that depends on it linearly.
fn ridge(at: &[f64], density: impl Fn(f64) -> f64, laplace: f64) -> Ridge {
    let node = |x: &f64| Node {
        density: density(*x),
        at: DVector::from_vec(vec![-0.5 * x, *x]),
        covariance: DMatrix::from_diagonal(&DVector::from_vec(vec![0.04, 0.0])),
    };
    Ridge {
        nodes: at.iter().map(node).collect(),
        index: 1,
        laplace,
    }
}

#[test]
fn a_gaussian_has_its_own_interval_and_evidence() {
    let (error, top) = (0.3, -7.0);
    let at: Vec<f64> = (-2..=2).map(|k| 0.36 * f64::from(k)).collect();
    let laplace = top + 0.5 * core::f64::consts::TAU.ln() + f64::ln(error);
    let ridge = ridge(&at, |x| top - 0.5 * (x / error).powi(2), laplace);
    let marginal = Marginal::new(&ridge, None).unwrap();
    let own = 1.96 * error;
    let other = 1.96 * f64::hypot(0.5 * error, 0.2);
    for (coordinate, reach) in [(1, own), (0, other)] {
        let [low, high] = marginal.interval(coordinate);
        for end in [high, -low] {
            assert!(
                (end / reach - 1.0).abs() < 0.03,
                "{coordinate}: {end} {reach}"
            );
        }
    }
    assert!(marginal.gain.abs() < 0.03, "{}", marginal.gain);
    let correlation = marginal.covariance()[(0, 1)] / (0.3 * f64::hypot(0.15, 0.2));
    assert!((correlation + 0.6).abs() < 0.05, "{correlation}");
}

#[test]
fn a_ridge_that_is_open_upwards_reaches_further_there() {
    // The density falls like a Gaussian of width 0.2 below and three times that above: a quarter
    // and three quarters of the probability.
    let fall = |x: f64| x * x * if x < 0.0 { 12.5 } else { 12.5 / 9.0 };
    let nodes = [-0.5, -0.25, 0.0, 0.6, 1.2, 1.8];
    let marginal = Marginal::new(&ridge(&nodes, |x| -fall(x), 0.0), None).unwrap();
    let [low, high] = marginal.interval(1);
    // The points at which the half Gaussians leave a tenth of a quarter, and a thirtieth of three
    // quarters.
    assert!((low + 0.2 * 1.645).abs() < 0.03, "{low}");
    assert!((high - 0.6 * 2.128).abs() < 0.06, "{high}");
    assert!((marginal.median(1) - 0.6 * 0.431).abs() < 0.03);
}

#[test]
fn a_ball_and_a_spheroid_count_by_their_odds() {
    // The first coordinate is the logarithm of height over width: 0.15 ± 0.1 for any ln E₁. A third
    // coordinate deviates by 0.3 with it, with a correlation of 0.8.
    let node = |x: f64| Node {
        density: -0.5 * x * x,
        at: DVector::from_vec(vec![0.15, x, 0.3]),
        covariance: DMatrix::from_row_slice(
            3,
            3,
            &[0.01, 0.0, 0.016, 0.0, 0.0, 0.0, 0.016, 0.0, 0.04],
        ),
    };
    let ridge = Ridge {
        nodes: [-2.4, -1.2, 0.0, 1.2, 2.4].map(node).to_vec(),
        index: 1,
        laplace: 0.5 * core::f64::consts::TAU.ln(),
    };
    let known = 0.3;
    let marginal = Marginal::new(&ridge, Some((0, known))).unwrap();
    // p(0) of the posterior over that of the prior.
    let odds = f64::exp(-0.5 * 1.5f64.powi(2)) * known / 0.1;
    assert!((marginal.ball - odds / (1.0 + odds)).abs() < 1e-6);
    // Half the sum of both evidences. That of the spheroid is one, up to 3 % of the quadrature.
    assert!((marginal.gain - (0.5 * (1.0 + odds)).ln()).abs() < 0.03);
    // The mean of a ball is lower by 1.6 times the deviation of the shape, and its variance by 1.6
    // × 0.016.
    let ball = marginal.ball;
    let variance = 0.04 - 0.0256 * ball + ball * (1.0 - ball) * 0.24f64.powi(2);
    assert!((marginal.covariance()[(2, 2)] - variance).abs() < 1e-6);
    let below = |x: f64| {
        let part = |mean: f64, error: f64| 0.5 * erfc((mean - x) / (2f64.sqrt() * error));
        (1.0 - ball) * part(0.3, 0.2) + ball * part(0.06, 0.12)
    };
    // Bisection ends far below a thousandth.
    let [low, high] = marginal.interval(2).map(below);
    assert!((low - 0.025).abs() < 1e-3 && (high - 0.975).abs() < 1e-3);
}

#[test]
fn two_nodes_are_no_ridge() {
    assert!(Marginal::new(&ridge(&[0.0, 1.0], |_| 0.0, 0.0), None).is_none());
}
