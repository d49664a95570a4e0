//! The median of many numbers.

/// One in so many values is looked at first; a quarter of those of a frame's 5 700 tiles that are few enough to sort cost more
/// to collect than they leave out.
const SAMPLED: usize = 32;

/// The upper median, by [`f64::total_cmp`] (0 of no values); `scratch` is overwritten. A sample brackets it, so that most values are only counted.
/// The answer does not depend on the sample: where the bracket missed, all values are looked through.
pub(crate) fn median(values: &[f64], scratch: &mut Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    scratch.clear();
    scratch.extend(values.iter().step_by(SAMPLED));
    scratch.sort_unstable_by(f64::total_cmp);
    // Three standard deviations of a sample's rank, ½√n each.
    let reach = (1.5 * (scratch.len() as f64).sqrt()).ceil() as usize;
    let centre = scratch.len() / 2;
    let low = scratch[centre.saturating_sub(reach)];
    let high = scratch[(centre + reach).min(scratch.len() - 1)];
    if low <= high {
        // A value that is not a number, whatever its sign, is neither below nor above: it is among those looked at.
        scratch.resize(values.len(), 0.0);
        let (mut below, mut between, mut whole) = (0, 0, true);
        for value in values {
            // Written always and kept sometimes: no branch to guess.
            scratch[between] = *value;
            below += usize::from(*value < low);
            between += usize::from((*value >= low) & (*value <= high));
            whole &= !value.is_nan();
        }
        if whole && (below..below + between).contains(&middle) {
            let inside = &mut scratch[..between];
            return *inside
                .select_nth_unstable_by(middle - below, f64::total_cmp)
                .1;
        }
    }
    scratch.clear();
    scratch.extend_from_slice(values);
    *scratch.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn is_the_middle_of_the_sorted_values(
            mut values in proptest::collection::vec(prop_oneof![
                8 => -1.0..1.0_f64,
                2 => Just(0.0), 1 => Just(-0.0), 1 => Just(f64::INFINITY),
            ], 0..400),
            nan in proptest::option::of(0_usize..400), period in 1_usize..40,
        ) {
            // A sample taken at equal steps sees nothing of what lies between them.
            values.iter_mut().step_by(period).for_each(|v| *v += 10.0);
            if let Some(value) = nan.and_then(|at| values.get_mut(at)) {
                *value = -f64::NAN;
            }
            let found = median(&values, &mut vec![3.0]);
            values.sort_by(f64::total_cmp);
            let expected = values.get(values.len() / 2).copied().unwrap_or(0.0);
            prop_assert_eq!(found.to_bits(), expected.to_bits());
        }
    }
}
