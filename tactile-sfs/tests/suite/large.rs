//! Images of 4096 × 4096: a small contact, and one that fills the frame.

use ndarray::{Array2, s};
use tactile_sfs::*;

const N: usize = 4096;

/// A paraboloid of the given radius in pixels around the centre of the frame, its mask and its
/// image of 8 bits.
fn paraboloid(radius: f32) -> (Array2<f32>, Array2<bool>, Array2<u8>) {
    let square = |(r, c): (usize, usize)| {
        let (x, y) = (c as f32 - 2047.5, r as f32 - 2047.5);
        (x * x + y * y) / (radius * radius)
    };
    // Height 0.2 radius, slope −0.4 ρ at ρ radii from the centre.
    let z = Array2::from_shape_fn((N, N), |at| 0.2 * radius * (1.0 - square(at)));
    let mask = Array2::from_shape_fn((N, N), |at| square(at) < 1.0);
    let image = Array2::from_shape_fn((N, N), |at| {
        (255.0 / (1.0 + 0.16 * square(at)).sqrt()).round() as u8
    });
    (z, mask, image)
}

fn check(radius: f32) {
    let (z, mask, image) = paraboloid(radius);
    let light = Lighting::default().with_normal_intensity(255.0).unwrap();
    let method = Eikonal::new(light)
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap();
    let surface = method
        .reconstruct(
            image.view().into(),
            &Domain::default().with_mask(mask.view()),
        )
        .unwrap();
    assert_eq!(surface.mask, mask);
    let rows = mask
        .outer_iter()
        .filter(|row| row.iter().any(|&inside| inside));
    let side = rows.count();
    assert!((side as f32 - 2.0 * radius).abs() < 2.0);
    let inside = s![
        2048 - side / 4..2048 + side / 4,
        2048 - side / 4..2048 + side / 4
    ];
    let error = height_error(
        surface.heights.slice(inside),
        z.slice(inside),
        None,
        Alignment::None,
    )
    .unwrap();
    // Rounding to 8 bits hides slopes below 0.06 at the top and moves the others by up to 2 %: 1 %
    // of the height.
    assert!(
        error.error.mean_absolute < 0.01 * 0.2 * f64::from(radius),
        "{error:?}"
    );
}

#[test]
fn a_small_contact_in_an_image_of_4096() {
    check(100.0);
}

#[test]
fn a_contact_that_fills_an_image_of_4096() {
    check(2047.0);
}
