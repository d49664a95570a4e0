//! Moments under pedestals, at every scale, of saturated and constant images, against 80-digit numbers.
#![allow(clippy::print_stdout)]

#[path = "../../../evidence/worst.rs"]
mod worst;

use ndarray::Array2;
use tactile_force::ImageMoments;
use worst::{Worst, cases, numbers, rows};

/// Sums are taken in twice the digits, so the pixels being exact there is no condition: a few final roundings.
const ALLOWED: f64 = 4.0;

#[test]
fn moments_have_all_their_digits() {
    let mut table = Worst::new("image moments");
    for case in cases(include_str!("../reference/moments.json")) {
        let at = |key: &str| case[key].as_f64().unwrap();
        let (name, pixels) = (case["name"].as_str().unwrap(), rows(&case["pixels"]));
        let image = Array2::from_shape_fn((pixels.len(), pixels[0].len()), |(r, c)| pixels[r][c]);
        let found = ImageMoments::of(image.view(), at("background")).unwrap();
        let centroid = found.centroid_px.expect("light");
        let expected = numbers(&case["centroid"]);
        for (quantity, found, expected) in [
            ("sum", found.sum, at("sum")),
            ("mean", found.mean, at("mean")),
            ("variance", found.variance, at("variance")),
            ("centroid x", centroid[0], expected[0]),
            ("centroid y", centroid[1], expected[1]),
            (
                "gyration",
                found.radius_of_gyration_px.expect("light"),
                at("radius_of_gyration"),
            ),
        ] {
            let gap = (found - expected).abs();
            let units = if gap == 0.0 {
                0.0
            } else {
                gap / expected.abs() / f64::EPSILON
            };
            table.enter(&format!("{quantity}, {name}"), units, ALLOWED);
        }
    }
    table.finish();
}
