use super::*;
use crate::common::Stream;
use proptest::prelude::*;

/// All pairs as candidates, from `(I + 1) × (J + 1)` numbers.
fn matrix(entries: &[&[f64]]) -> MatchMatrix {
    let (last, rows) = entries.split_last().expect("slack row");
    let mut m = MatchMatrix::default();
    m.reset(last.split_last().expect("slack column").1.iter().copied());
    for row in rows {
        let (slack, row) = row.split_last().expect("slack column");
        m.push_row(row.iter().copied().enumerate(), *slack);
    }
    m
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn normalisation_makes_rows_and_columns_sum_to_one(rows in 1..12_usize, columns in 1..12_usize, seed in 0..1000_u64) {
        let mut stream = Stream::new(seed);
        let mut m = MatchMatrix::default();
        let mut next = || 0.05 + stream.next();
        m.reset((0..columns).map(|_| next()).collect::<Vec<_>>());
        for _ in 0..rows {
            let row: Vec<_> = (0..columns).map(|j| (j, next())).collect();
            m.push_row(row, next());
        }
        let row_sum = |m: &MatchMatrix, i| m.row(i).map(|pair| pair.1).sum::<f64>() + m.slack(i);
        let settled = |m: &MatchMatrix| (0..rows).all(|i| (row_sum(m, i) - 1.0).abs() <= 1e-12);
        let mut sweeps = 0;
        // Positive entries with slack on both sides are always feasible, and convergence is linear.
        while !settled(&m) && sweeps < 10_000 {
            m.normalise();
            sweeps += 1;
        }
        prop_assert!(settled(&m));
        let mut sums = m.column_slack.clone();
        for i in 0..rows {
            for (j, p) in m.row(i) {
                sums[j] += p;
            }
        }
        prop_assert!(sums.iter().all(|sum| (sum - 1.0).abs() <= 1e-12));
        prop_assert!(m.all_entries().all(|p| (0.0..=1.0).contains(&p)));
    }
}

#[test]
fn a_row_without_support_stays_as_it_was() {
    let mut m = matrix(&[&[0.5, 0.5, 0.0], &[0.5, 0.5, 0.0], &[0.0; 3]]);
    m.update(&[0.0, 0.0, 1.0, 3.0], 0.5);
    assert_eq!(m.entries, [0.5, 0.5, 0.25, 0.75]);
    assert_eq!(m.row_slack, [0.0, 0.0]);
}

#[test]
fn products_that_overflow_or_underflow_are_taken_relative_to_their_row() {
    let mut m = matrix(&[&[1e-200, 1e-300, 0.0], &[0.0; 3]]);
    m.update(&[1e-200, 1e-100], 0.5);
    // Two quotients, a product, a sum and a quotient.
    assert!(m.entries.iter().all(|p| (p - 0.5).abs() < 1e-15), "{m:?}");
}

#[test]
fn the_likeliest_candidates_stay_in_ascending_order() {
    let mut m = matrix(&[&[0.1, 0.4, 0.2, 0.4, 0.3], &[0.1; 5]]);
    m.keep_likeliest(3);
    assert_eq!(m.row(0).collect::<Vec<_>>(), [(1, 0.4), (2, 0.2), (3, 0.4)]);
    m.keep_likeliest(1);
    assert_eq!(m.row(0).collect::<Vec<_>>(), [(1, 0.4)]);
    assert_eq!((m.slack(0), m.column_slack.len()), (0.3, 4));
}
