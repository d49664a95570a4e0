//! The paper's method over candidates, all of them kept, is the dense one.
use crate::common::{Stream, bend, reordered, scattered};
use crate::labelling::{LengthMaximum, Neighbourhood};
use crate::{MatchError, Matching, PointMatcher, RelaxationLabelling};
use nalgebra::Point;
use proptest::prelude::*;

/// A model and a bent copy of it in another order, with points of their own on either side.
fn scene<const D: usize>(rows: usize, columns: usize, seed: u64) -> [Vec<Point<f64, D>>; 2] {
    let all = scattered::<D>(rows.max(columns), seed);
    let target = reordered(&bend(&all, 0.3), &Stream::new(seed).permutation(all.len()));
    [all[..rows].to_vec(), target[..columns].to_vec()]
}

/// Largest difference of the soft matches of two answers.
fn difference<const D: usize>(a: &Matching<D>, b: &Matching<D>, columns: usize) -> f64 {
    let entry = |m: &Matching<D>, i, j| m.soft.row(i).find(|e| e.0 == j).map_or(0.0, |e| e.1);
    let pairs = (0..a.warped.len()).flat_map(|i| (0..columns).map(move |j| (i, j)));
    pairs
        .map(|(i, j)| (entry(a, i, j) - entry(b, i, j)).abs())
        .fold(0.0, f64::max)
}

/// The whole matcher with all candidates gives the dense one's M in one outer iteration and its answer at the end.
fn all_candidates_give_the_dense_answer<const D: usize>(
    [model, target]: [Vec<Point<f64, D>>; 2],
    options: RelaxationLabelling,
) -> Result<(), TestCaseError> {
    let dense = options;
    let few = options.with_candidates(target.len()).expect("candidates");
    let all = few;
    // The same positive terms in the same order of magnitude, summed in another order: rounding, grown by ten sweeps.
    prop_assert!(
        dense
            .relax(&model, &target)
            .largest_change(&all.relax(&model, &target))
            < 1e-10
    );
    let [dense, all] = [
        dense.match_points(&model, &target),
        all.match_points(&model, &target),
    ]
    .map(Result::unwrap);
    // Ten outer iterations pass the rounding on through splines; negligible matches (1e-4) may be listed by one alone.
    prop_assert!(difference(&dense, &all, target.len()) < 2e-4);
    prop_assert_eq!(&dense.assignment, &all.assignment);
    for (a, b) in dense.energy.iter().zip(&all.energy) {
        prop_assert!((a - b).abs() <= 1e-7 * a.abs());
    }
    Ok(())
}

#[test]
fn ten_candidates_do_no_worse_than_all_and_none_is_refused() {
    let [model, target] = scene::<2>(60, 60, 5);
    let order = Stream::new(5).permutation(60);
    let right = [10, 60].map(|candidates| {
        let options = RelaxationLabelling::default().with_candidates(candidates);
        let sparse = options.expect("candidates");
        let found = sparse.match_points(&model, &target).expect("finite points");
        found
            .assignment
            .iter()
            .enumerate()
            .filter(|(i, j)| j.is_some_and(|j| order[j] == *i))
            .count()
    });
    // The plain method leaves one or two points wrong here; fewer candidates have fewer ways to go astray.
    assert!(
        right[0] >= right[1] && right[1] >= 57,
        "{right:?} of 60 right"
    );
    let none = RelaxationLabelling::default().with_candidates(0);
    assert!(matches!(
        none,
        Err(MatchError::InvalidOption {
            option: "candidates",
            ..
        })
    ));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_whole_matcher_in_the_plane(rows in 3..20_usize, columns in 3..20_usize, seed in 0..1000_u64, k in 0..9_usize) {
        let neighbourhood = if k == 0 { Neighbourhood::MedianRadius } else { Neighbourhood::Nearest(k) };
        let options = RelaxationLabelling::default().with_neighbourhood(neighbourhood).unwrap();
        all_candidates_give_the_dense_answer::<2>(scene(rows, columns, seed), options)?;
    }

    #[test]
    fn the_whole_matcher_in_space(rows in 4..20_usize, columns in 4..20_usize, seed in 0..1000_u64) {
        let options = RelaxationLabelling::default().with_length_maximum(LengthMaximum::Global);
        all_candidates_give_the_dense_answer::<3>(scene(rows, columns, seed), options)?;
    }
}
