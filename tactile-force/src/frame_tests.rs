use super::*;
use proptest::prelude::*;

/// Small and large responses, an odd number of them.
#[test]
fn pairs_are_counted_like_single_responses() {
    let rows: [Vec<i16>; 2] = [
        (0..799).map(|k| k * 37 % 71).collect(),
        (0..33).map(|k| k * 127).collect(),
    ];
    let (mut counts, mut expected) = (Counts::new(), vec![0; 4081]);
    for responses in &rows {
        counts.add(responses);
        responses.iter().for_each(|&r| expected[r as usize] += 1);
    }
    assert_eq!(counts.histogram(), expected);
}

#[test]
fn responses_are_those_of_the_mask() {
    let lines = [[7, 250, 3, 90], [0, 255, 0, 255], [12, 13, 200, 1]].map(Vec::from);
    let mask = [1, -2, 1];
    let expected = [0, 1].map(|x: usize| {
        let terms = (0..9).map(|k| mask[k / 3] * mask[k % 3] * lines[k / 3][x + k % 3]);
        terms.sum::<i16>().abs()
    });
    let mut scratch = [vec![0; 4], vec![0; 4]];
    assert_eq!(respond(&lines, &mut scratch), expected);
}

proptest! {
    /// By plain loops and by whatever instructions this machine has: those of the pixels one by
    /// one.
    #[test]
    fn a_tile_is_its_pixels(
        pixels in proptest::collection::vec(any::<u8>(), TILE_ROWS * TILE_COLUMNS),
        low in 0_u8..255, span in 0_u8..=255
    ) {
        // Anywhere within any range of grey levels.
        let grey = |p: u8| (u32::from(low) + u32::from(p) * u32::from(span) / 255).min(255) as u8;
        let row = |k: usize| std::array::from_fn(|j| grey(pixels[TILE_COLUMNS * k + j]));
        let tile: [Row; TILE_ROWS] = std::array::from_fn(row);
        let all = tile.as_flattened();
        let sum: i32 = all.iter().map(|p| i32::from(*p)).sum();
        let expected = (sum, [*all.iter().min().unwrap(), *all.iter().max().unwrap()]);
        let rows = tile.each_ref().map(std::slice::from_ref);
        prop_assert_eq!(Plain.summary(&rows, 0), expected);
        let (mut sum, mut darkest, mut brightest) = ([0], [0], [0]);
        let tiles = OfTiles { sums: &mut sum, darkest: &mut darkest, brightest: &mut brightest };
        summarise(rows, tiles);
        prop_assert_eq!((sum[0], [darkest[0], brightest[0]]), expected);
    }
}
