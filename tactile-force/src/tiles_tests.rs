use super::*;
use proptest::prelude::*;

proptest! {
    /// Plain loops and the SIMD instructions of this machine give the same results as single
    /// pixels.
    #[test]
    fn a_tile_is_its_pixels(
        pixels in proptest::collection::vec(any::<u8>(), TILE_ROWS * TILE_COLUMNS),
        low in 0_u8..255, span in 0_u8..=255
    ) {
        // Grey levels in an arbitrary range.
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
