use super::memory;
use approx::assert_relative_eq;

#[test]
fn a_ramp_is_its_integral_and_a_sudden_change_counts_whole() {
    // u rises to 1 at once and to 2 within a second: e^{-1} + (1 − e^{-1}) at τ = 1, over u = 2.
    let ramp = memory(&[0.0, 1.0], &[1.0, 2.0], 1.0);
    assert_relative_eq!(ramp[1], 0.5, max_relative = 1e-14);
    let step = memory(&[1.0, 1.0], &[1.0, 2.0], 1.0);
    let expected = ((-1.0_f64).exp() + 1.0) / 2.0;
    assert_relative_eq!(step[1], expected, max_relative = 1e-14);
}
