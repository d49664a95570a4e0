//! Binning and smoothing of a contact's image, and the ball fitted to a depth map.

use ndarray::{Array2, s};
use tactile_sfs::{BallFit, BinnedContact, Binning, Domain};

#[test]
fn blocks_are_no_larger_than_the_points_allow() {
    for (pixels, side) in [(3_199, 1), (12_800, 2), (9 * 3_200 - 1, 2), (28_800, 3)] {
        assert_eq!(Binning::Auto.side(pixels, 200), side);
    }
    assert_eq!(Binning::Blocks(0).side(10, 0), 1);
}

#[test]
fn means_of_blocks_are_those_of_their_pixels() {
    let frame = Array2::from_shape_fn((9, 11), |(r, c)| (7 * r + 3 * c) as u8);
    let reference = Array2::from_elem((9, 11), 5_u8);
    let images = [frame.slice(s![1.., 2..]), reference.slice(s![1.., 2..])];
    let mut contact = BinnedContact::default();
    for (side, shape) in [(3, (2, 3)), (1, (8, 9)), (4, (2, 2))] {
        contact.load(images, side, -2.0);
        assert_eq!(contact.signal.dim(), shape);
        // The mean of a linear function is its value in the centre of the block. All sums are exact
        // in f64.
        let middle =
            |start: usize, block: usize| (start + side * block) as f64 + 0.5 * (side as f64 - 1.0);
        for ((r, c), mean) in contact.signal.indexed_iter() {
            let expected = -2.0 * (7.0 * middle(1, r) + 3.0 * middle(2, c) - 5.0);
            assert!((mean - expected).abs() < 1e-12, "{side} {r} {c}: {mean}");
        }
    }
}

#[test]
fn a_block_is_inside_if_three_quarters_of_it_are() {
    let flat = Array2::from_elem((4, 8), 0_u8);
    let mut contact = BinnedContact::default();
    contact.load([flat.view(), flat.view()], 2, 1.0);
    // The mask ends before the blocks do.
    let mask = Array2::from_shape_fn((2, 6), |(r, c)| c <= 2 || c == 4 || (c == 5 && r == 0));
    contact.load_mask(mask.view(), 2);
    let expected = [true, false, true, false, false, false, false, false];
    assert_eq!(contact.mask.as_slice(), Some(&expected[..]));
    contact.load([flat.view(), flat.view()], 1, 1.0);
    contact.load_mask(flat.mapv(|grey| grey > 0).view(), 1);
    assert!(contact.mask.iter().all(|inside| !inside));
}

#[test]
fn pixels_too_near_the_rim_of_a_hemisphere_are_trimmed() {
    let distance = |(r, c): (usize, usize)| (r as f64 - 25.3).hypot(c as f64 - 24.8);
    let mut contact = BinnedContact::default();
    contact.signal = Array2::from_shape_fn((50, 50), |at| {
        (1.0 - (distance(at) / 20.0).powi(2)).max(0.0).sqrt()
    });
    // The light of a blur extends half a pixel beyond the rim.
    contact.mask = Array2::from_shape_fn((50, 50), |at| distance(at) < 20.5);
    contact.trim_rim();
    for (at, inside) in contact.mask.indexed_iter() {
        // The radius from the pixels is at most half a pixel too large: a fortieth of the quarter
        // pixel.
        let inner = 20.0 - distance(at);
        assert!(*inside || inner < 0.26, "{at:?}: {inner}");
        assert!(!*inside || inner > 0.23, "{at:?}: {inner}");
    }
    contact.signal.fill(1.0);
    contact.mask.fill(true);
    contact.trim_rim();
    assert!(
        contact.mask.iter().all(|inside| *inside),
        "flat: no dark rim"
    );
}

#[test]
fn smoothing_keeps_lines_and_sums() {
    let plane = Array2::from_shape_fn((20, 30), |(r, c)| r as f64 + 2.0 * c as f64);
    let mut contact = BinnedContact::default();
    contact.signal = plane.clone();
    contact.smooth(5, |_| 1.0);
    // Away from the edge the moving average of a linear function is the function itself, within
    // rounding.
    assert!((contact.signal[[10, 15]] - plane[[10, 15]]).abs() < 1e-12);
    contact.signal = Array2::zeros((21, 21));
    contact.signal[[10, 10]] = 1.0;
    contact.smooth(5, |_| 1.0);
    assert!((contact.signal.sum() - 1.0).abs() < 1e-12);
    let smoothed = contact.signal.clone();
    contact.smooth(5, |_| 0.0);
    assert_eq!(
        contact.signal, smoothed,
        "a share of nothing changes nothing"
    );
}

#[test]
fn an_exact_cap_comes_back() {
    let (radius, contact_radius, centre) = (4e-3_f64, 2.5e-3_f64, [2.61e-3, 2.41e-3]);
    let size = [50e-6, 40e-6];
    let depth = |(r, c): (usize, usize)| {
        let (x, y) = (
            c as f64 * size[0] - centre[0],
            r as f64 * size[1] - centre[1],
        );
        let square = (radius * radius - x * x - y * y).max(0.0);
        square.sqrt() - (radius * radius - contact_radius * contact_radius).sqrt()
    };
    let heights = Array2::from_shape_fn((130, 110), depth);
    let mask = heights.mapv(|h| h > 0.0);
    let domain = Domain::new(size).unwrap().with_mask(mask.view());
    let known = BallFit::of_radius(heights.view(), &domain, radius).unwrap();
    // Gauss–Newton stops at 10⁻⁹ of the radius, and the search for a radius at a millionth of its
    // bracket.
    for (fit, tolerance) in [
        (known, 1e-10),
        (
            BallFit::of_any_radius(heights.view(), &domain).unwrap(),
            2e-8,
        ),
    ] {
        for (found, expected) in fit.centre_m.iter().zip(&centre) {
            assert!((found - expected).abs() < tolerance);
        }
        assert!((fit.radius_m - radius).abs() < tolerance);
        assert!((fit.contact_radius_m - contact_radius).abs() < tolerance);
        assert!(fit.mean_absolute_error_m < tolerance);
    }
    assert_eq!(
        BallFit::of_radius(heights.view(), &domain, 1e-3),
        None,
        "smaller than the contact"
    );
    let few = heights.slice(s![..3, ..5]);
    assert_eq!(
        BallFit::of_radius(few, &Domain::new(size).unwrap(), radius),
        None
    );
}
