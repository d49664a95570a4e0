//! Properties of every contact: its position in the frame and the values outside its mask do not
//! matter. The estimates and error functions are compared with cases calculated by hand.

use crate::common::{integrators, reconstructions};
use ndarray::{Array2, s};
use proptest::prelude::*;
use tactile_sfs::*;

/// An uneven frame, its slopes and an elliptical mask, all placed at (top, left) of a larger frame.
struct Placed {
    image: Array2<f64>,
    p: Array2<f64>,
    q: Array2<f64>,
    mask: Array2<bool>,
}

const PATCH: (usize, usize) = (17, 23);

impl Placed {
    fn new(frame: (usize, usize), [top, left]: [usize; 2], axes: [f64; 2], outside: f64) -> Self {
        let inside = |r: usize, c: usize| {
            ((r as f64 - 8.0) / axes[1]).hypot((c as f64 - 11.0) / axes[0]) <= 1.0
        };
        let place = |value: &dyn Fn(usize, usize) -> f64| {
            let mut placed = Array2::from_elem(frame, outside);
            for r in 0..PATCH.0 {
                for c in 0..PATCH.1 {
                    if inside(r, c) {
                        placed[[top + r, left + c]] = value(r, c);
                    }
                }
            }
            placed
        };
        let mut mask = Array2::from_elem(frame, false);
        let patch = Array2::from_shape_fn(PATCH, |(r, c)| inside(r, c));
        mask.slice_mut(s![top..top + PATCH.0, left..left + PATCH.1])
            .assign(&patch);
        Self {
            image: place(&|r, c| 0.7 + 0.2 * (0.9 * r as f64).sin() * (0.4 * c as f64).cos()),
            p: place(&|r, c| (0.3 * c as f64).sin() + 0.1 * r as f64),
            q: place(&|r, c| (0.5 * r as f64).cos() - 0.05 * c as f64),
            mask,
        }
    }

    /// Heights of the placed frame by every method.
    fn heights(&self, [top, left]: [usize; 2]) -> Vec<(&'static str, Array2<f64>)> {
        let domain = Domain::default().with_mask(self.mask.view());
        let light = Lighting::new([0.3, -0.2, 1.0]).unwrap();
        let patch = |surface: Surface<f64>| {
            assert_eq!(surface.mask, self.mask);
            assert!(
                surface
                    .heights
                    .indexed_iter()
                    .all(|(at, z)| self.mask[at] || z.is_nan())
            );
            surface
                .heights
                .slice(s![top..top + PATCH.0, left..left + PATCH.1])
                .to_owned()
        };
        let images = reconstructions(light).into_iter().map(|(name, method)| {
            let surface = method.reconstruct(Image::new(self.image.view(), domain));
            (name, patch(surface.unwrap()))
        });
        let slopes = integrators().into_iter().map(|(name, method)| {
            let surface = method.integrate(self.p.view(), self.q.view(), &domain);
            (name, patch(surface.unwrap()))
        });
        images.chain(slopes).collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24, failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn neither_the_place_nor_what_is_outside_the_mask_matters(
        top in 0usize..20, left in 0usize..20, rows in 37usize..50, columns in 43usize..60,
        a in 2.0f64..11.0, b in 2.0f64..8.0,
        outside in prop_oneof![Just(f64::NAN), Just(1e300), -3.0f64..3.0],
    ) {
        let here = Placed::new(PATCH, [0, 0], [a, b], 0.0).heights([0, 0]);
        let there = Placed::new((rows, columns), [top, left], [a, b], outside).heights([top, left]);
        for ((name, here), (_, there)) in here.iter().zip(&there) {
            // The box is solved by the same operations wherever it lies, which gives equal bits.
            let equal = |x: &f64, y: &f64| x.to_bits() == y.to_bits() || x.is_nan() && y.is_nan();
            let same = here.iter().zip(there).all(|(x, y)| equal(x, y));
            prop_assert!(same, "{}", name);
        }
    }
}

/// Exchanging rows and columns, with slopes and pixel sizes, exchanges those of the heights. This
/// includes lines of every short length, for most of which the transform needs no working memory.
#[test]
fn a_turned_frame_has_turned_heights() {
    let short = (1..20).map(|columns| (13, columns));
    for (rows, columns) in [(64, 37), (30, 45)].into_iter().chain(short) {
        let p = Array2::from_shape_fn((rows, columns), |(r, c)| {
            (0.2 * r as f64).sin() + 0.03 * c as f64
        });
        let q = Array2::from_shape_fn((rows, columns), |(r, c)| {
            (0.15 * c as f64).cos() - 0.02 * r as f64
        });
        for (name, method) in integrators() {
            let heights = |p: ndarray::ArrayView2<'_, f64>, q, pixel_size_m| {
                let domain = Domain::new(pixel_size_m).unwrap();
                method.integrate(p, q, &domain).unwrap().heights
            };
            let plain = heights(p.view(), q.view(), [1.0, 1.5]);
            let turned = heights(q.t(), p.t(), [1.5, 1.0]);
            let differences = plain.iter().zip(turned.t()).map(|(a, b)| (a - b).abs());
            // The heights are several tens. All solutions are direct, with the rounding error of
            // transforms of 64 points.
            let largest = differences.fold(0.0, f64::max);
            assert!(largest < 1e-10, "{name}, {rows} × {columns}: {largest:e}");
        }
    }
}

#[test]
fn a_depth_table_is_linear_between_its_entries_and_holds_its_ends() {
    let table = DepthTable::new(&[(10.0, 1.0), (20.0, 2.0), (60.0, 10.0)]).unwrap();
    for (signal, depth, within) in [
        (5.0, 1.0, false),
        (10.0, 1.0, true),
        (15.0, 1.5, true),
        (20.0, 2.0, true),
        (30.0, 4.0, true),
        (50.0, 8.0, true),
        (60.0, 10.0, true),
        (70.0, 10.0, false),
    ] {
        assert_eq!(table.depth(signal), (depth, within), "{signal}");
    }
}
