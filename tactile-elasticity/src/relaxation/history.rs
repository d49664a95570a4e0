//! What is left at each load of the history before it.

/// g_k(u, τ) = (1/u_k) ∫₀^{t_k} e^{−(t_k − s)/τ} du(s), and what of it a change of u_k alone adds, O(n).
///
/// The first load is put on at time 0 and kept; between loads u is linear.
pub(super) fn memory(times_s: &[f64], held: &[f64], time_constant_s: f64) -> Vec<f64> {
    let mut remaining = 0.0;
    let mut before = (0.0, 0.0);
    let of_load = |(&time_s, &now): (&f64, &f64)| {
        let (last_s, last) = before;
        let elapsed = (time_s - last_s) / time_constant_s;
        let decay = (-elapsed).exp();
        // Of the first load all is put on at the start; of a later one's change what a steady growth leaves, (1 − e^{−u})/u.
        let growth = match (last > 0.0, elapsed > 0.0) {
            (false, _) => decay,
            (true, false) => 1.0,
            (true, true) => -(-elapsed).exp_m1() / elapsed,
        };
        remaining = remaining * decay + (now - last) * growth;
        before = (time_s, now);
        remaining / now
    };
    times_s.iter().zip(held).map(of_load).collect()
}

#[cfg(test)]
mod tests {
    use super::memory;
    use approx::assert_relative_eq;

    #[test]
    fn what_is_held_is_forgotten_exponentially() {
        let times = [0.0, 0.5, 0.5, 2.0];
        for (found, time) in memory(&times, &[3.0; 4], 0.8).iter().zip(times) {
            // Products of exponentials against one: some units in the last place.
            assert_relative_eq!(*found, (-time / 0.8_f64).exp(), max_relative = 1e-14);
        }
    }

    #[test]
    fn a_ramp_is_its_integral_and_a_sudden_change_counts_whole() {
        // u = 1 at once, then to 2 over a second: e^{-1} + (1 − e^{-1}) at τ = 1, over u = 2.
        let ramp = memory(&[0.0, 1.0], &[1.0, 2.0], 1.0);
        assert_relative_eq!(ramp[1], 0.5, max_relative = 1e-14);
        let step = memory(&[1.0, 1.0], &[1.0, 2.0], 1.0);
        let expected = ((-1.0_f64).exp() + 1.0) / 2.0;
        assert_relative_eq!(step[1], expected, max_relative = 1e-14);
    }
}
