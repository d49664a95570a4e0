use super::*;

/// For pixels at multiples of a quarter, the sums of a block equal those of its pixels to rounding.
fn compare<const SIDE: usize>(aspect: f64) {
    let value = |k: usize, j: usize| (k * 7 + j * 13 % 5) as f32 - 9.25;
    let block = RingBlock::<SIDE> {
        pixels: std::array::from_fn(|k| std::array::from_fn(|j| value(k, j))),
        u: -31.25,
        v: 12.5,
        aspect,
    };
    let mut expected = Ring::default();
    for (k, row) in block.pixels.iter().enumerate() {
        for (j, d) in row.iter().enumerate() {
            let from_centre = |at: usize| at as f64 - 0.5 * (SIDE as f64 - 1.0);
            let (u, v) = (block.u + from_centre(j), block.v + aspect * from_centre(k));
            expected.add(u, v, u * u + v * v, f64::from(*d));
        }
    }
    let found = block.sums();
    let flat = |ring: &Ring| {
        let mut all = [ring.place, ring.product, ring.difference].concat();
        all.push(ring.r4);
        all
    };
    for (k, (found, expected)) in flat(&found).iter().zip(flat(&expected)).enumerate() {
        let error = (found - expected).abs();
        assert!(error <= 1e-13 * expected.abs(), "{k}: {found} {expected}");
    }
}

#[test]
fn a_block_is_its_pixels() {
    for aspect in [1.0, 0.75] {
        compare::<2>(aspect);
        compare::<4>(aspect);
    }
}

/// If the image is mirrored about a centre that is not in the middle of a pixel, the blocks are
/// mirrored too and counted equally.
#[test]
fn blocks_are_mirrored_with_the_image() {
    let size = 40;
    let spans = vec![[0, size]; size];
    let grid = |centre: [f64; 2]| Grid {
        centre,
        aspect: 1.0,
        spans: &spans,
    };
    let centre = [17.3, 21.8];
    let (one, other) = (grid(centre), grid(centre.map(|c| size as f64 - 1.0 - c)));
    for k in -3..3 {
        let row = one.first(1) + 4 * k;
        let (here, there) = (
            one.columns::<4>(row, 11.0),
            other.columns::<4>(size as isize - 4 - row, 11.0),
        );
        assert_eq!(here.is_empty(), !(-2..2).contains(&k), "{here:?}");
        if !here.is_empty() {
            assert_eq!(here, size - there.end..size - there.start);
        }
        let mirrored = other.number::<4>(size as isize - 4 - row, 1);
        assert_eq!(one.number::<4>(row, 1), mirrored);
    }
    assert_eq!(one.columns::<4>(-1, 11.0), 0..0, "a row outside");
}
