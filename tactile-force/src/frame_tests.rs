//! The single pass compared with a direct loop: integers, so that equality is exact.

use proptest::prelude::*;

use super::*;

fn compare(
    reference: &ReferenceFrame,
    frame: ArrayView2<'_, u8>,
    threshold: u8,
) -> FrameStatistics {
    reference.compare_with(&mut PassWorkspace::default(), frame, threshold)
}

fn slow(
    frame: ArrayView2<'_, u8>,
    reference: ArrayView2<'_, u8>,
    threshold: u8,
) -> FrameStatistics {
    let (rows, columns) = frame.dim();
    let mut s = FrameStatistics {
        rows,
        columns,
        sum: 0,
        saturated: 0,
        bounding_box: None,
    };
    for ((y, x), &f) in frame.indexed_iter() {
        let d = i16::from(f) - i16::from(reference[[y, x]]);
        s.sum += i64::from(d);
        s.saturated += usize::from(f == 255);
        if d.unsigned_abs() > u16::from(threshold) {
            let here = BoundingBox {
                row_start: y,
                row_end: y + 1,
                column_start: x,
                column_end: x + 1,
            };
            s.bounding_box = Some(s.bounding_box.map_or(here, |b| BoundingBox {
                row_start: b.row_start.min(y),
                row_end: b.row_end.max(y + 1),
                column_start: b.column_start.min(x),
                column_end: b.column_end.max(x + 1),
            }));
        }
    }
    s
}

/// A pair of images: noise of any amplitude on any level, possibly with one bright rectangle.
fn images() -> impl Strategy<Value = (Array2<u8>, Array2<u8>)> {
    let size = (1_usize..90, 1_usize..2200);
    (size, any::<u64>(), 0_u8..=255, 0_u8..=255, any::<bool>()).prop_map(
        |((h, w), seed, level, spread, bright)| {
            let mut state = seed;
            let mut next = || {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                (state >> 56) as u8
            };
            let mut image = || {
                Array2::from_shape_simple_fn((h, w), || {
                    level.saturating_add(((u16::from(next()) * u16::from(spread)) >> 8) as u8)
                })
            };
            let (mut frame, reference) = (image(), image());
            if bright {
                let mut part = frame.slice_axis_mut(Axis(0), Slice::from(h / 3..h / 2 + 1));
                part.slice_axis_mut(Axis(1), Slice::from(w / 4..w / 3 + 1))
                    .fill(255);
            }
            (frame, reference)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn equals_the_obvious_loop((frame, reference) in images(), threshold in 0_u8..=255) {
        let prepared = ReferenceFrame::new(reference.view()).unwrap();
        let found = compare(&prepared, frame.view(), threshold);
        prop_assert_eq!(found, slow(frame.view(), reference.view(), threshold));
        // The same pixels, in column order in memory.
        let turned = |image: Array2<u8>| image.t().as_standard_layout().into_owned();
        let [frame, reference] = [frame, reference].map(turned);
        let prepared = ReferenceFrame::new(reference.t()).unwrap();
        prop_assert_eq!(compare(&prepared, frame.t(), threshold), found);
    }
}
