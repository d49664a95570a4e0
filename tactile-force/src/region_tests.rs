use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn box_sums_are_sums_over_boxes(
        values in proptest::collection::vec(-255_i32..256, 1..200),
        columns in 1_usize..20, half in 0_usize..7
    ) {
        let rows = values.len() / columns;
        prop_assume!(rows > 0);
        let values: Vec<f32> = values[..rows * columns].iter().map(|v| *v as f32).collect();
        let mut sums = Vec::new();
        box_sums(&values, columns, 2 * half + 1, &mut Vec::new(), &mut sums);
        for y in 0..rows {
            for x in 0..columns {
                let mut expected = 0.0;
                for v in y.saturating_sub(half)..(y + half + 1).min(rows) {
                    for u in x.saturating_sub(half)..(x + half + 1).min(columns) {
                        expected += values[v * columns + u];
                    }
                }
                // Integers below 2²⁴ are exact.
                prop_assert_eq!(sums[y * columns + x], expected);
            }
        }
    }
}

const COLUMNS: usize = 13;

fn runs_of(mask: &[bool]) -> Vec<Run> {
    let mut runs = Vec::new();
    mask.chunks(COLUMNS)
        .enumerate()
        .for_each(|(y, row)| push_runs(&mut runs, y, row, |m| *m));
    runs
}

fn mask_of(runs: &[Run], rows: usize) -> Vec<bool> {
    let mut mask = vec![false; rows * COLUMNS];
    runs.iter().for_each(|r| mask[r.span(COLUMNS)].fill(true));
    mask
}

/// All pixels with the seed's value that are connected to it, by painting until nothing changes.
fn reached(mask: &[bool], seed: usize, diagonal: bool) -> Vec<bool> {
    let mut set = vec![false; mask.len()];
    set[seed] = true;
    loop {
        let before = set.clone();
        for p in (0..mask.len()).filter(|p| before[*p]) {
            for q in (0..mask.len()).filter(|q| mask[*q] == mask[seed]) {
                let (dy, dx) = (
                    (p / COLUMNS).abs_diff(q / COLUMNS),
                    (p % COLUMNS).abs_diff(q % COLUMNS),
                );
                set[q] |= if diagonal {
                    dy.max(dx) <= 1
                } else {
                    dy + dx <= 1
                };
            }
        }
        if set == before {
            return set;
        }
    }
}

proptest! {
    #[test]
    fn agrees_with_painting(
        mask in proptest::collection::vec(proptest::bool::weighted(0.45), 9 * COLUMNS)
    ) {
        let rows = 9;
        let sets: Vec<Vec<bool>> =
            (0..mask.len()).filter(|p| mask[*p]).map(|p| reached(&mask, p, true)).collect();
        let size = |s: &Vec<bool>| s.iter().filter(|m| **m).count();
        let largest = sets.iter().map(size).max().unwrap_or(0);
        let mut runs = runs_of(&mask);
        let (area, _) = Components::default().keep_largest(&mut runs, 1);
        prop_assert_eq!(area, largest);
        let kept = mask_of(&runs, rows);
        prop_assert!(area == 0 || sets.contains(&kept));
        let filled_by = Components::default().fill_holes(&mut runs, &mut Vec::new(), rows, COLUMNS);
        let border = |p: usize| {
            [0, rows - 1].contains(&(p / COLUMNS)) || [0, COLUMNS - 1].contains(&(p % COLUMNS))
        };
        let mut expected = kept.clone();
        for p in (0..kept.len()).filter(|p| !kept[*p]) {
            let set = reached(&kept, p, false);
            expected[p] = !(0..set.len()).any(|q| set[q] && border(q));
        }
        prop_assert_eq!(mask_of(&runs, rows), expected);
        prop_assert_eq!(runs.iter().map(Run::len).sum::<usize>(), area + filled_by);
    }

    #[test]
    fn growing_is_a_maximum_over_the_square(
        mask in proptest::collection::vec(proptest::bool::weighted(0.1), 9 * COLUMNS),
        margin in 0_usize..4
    ) {
        let mut grown = Vec::new();
        grow(&runs_of(&mask), &mut grown, margin, 9, COLUMNS);
        let near = |p: usize| (0..mask.len()).any(|q| {
            let dy = (p / COLUMNS).abs_diff(q / COLUMNS);
            let dx = (p % COLUMNS).abs_diff(q % COLUMNS);
            mask[q] && dy.max(dx) <= margin
        });
        prop_assert_eq!(mask_of(&grown, 9), (0..mask.len()).map(near).collect::<Vec<_>>());
        prop_assert!(grown.windows(2).all(|w| w[0].row < w[1].row || w[0].end < w[1].start));
    }

    #[test]
    fn those_within_are_those_contained_and_mirroring_changes_none(
        start in 0_usize..20, length in 1_usize..40, step in 1_usize..7,
        from in 0_usize..60, count in 0_usize..60
    ) {
        let every = EveryNth::of(start..start + length, step);
        let found: Vec<usize> = every.within(from..from + count).collect();
        let expected: Vec<usize> = (from..from + count).filter(|&at| every.contains(at)).collect();
        prop_assert_eq!(found, expected);
        for at in start..start + length {
            let mirrored = 2 * start + length - 1 - at;
            prop_assert_eq!(every.contains(at), every.contains(mirrored));
        }
    }
}
