//! Real presses of a ball of known radius. Skipped if the data are absent.
#![allow(clippy::print_stdout)]

use ndarray::Array3;
use tactile_gel::{BallPress, GelFrame, GelSensor};
use test_support::published as data;

const PIXEL_M: f64 = 1e-3 / 19.58;
const BALL_PX: f64 = 2.35e-3 / PIXEL_M;

fn image(name: &str) -> Option<Array3<u8>> {
    let image = image::open(data(name)?).unwrap().into_rgb8();
    let shape = (image.height() as usize, image.width() as usize, 3);
    Array3::from_shape_vec(shape, image.into_raw()).ok()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Median angle in degrees between the normals and the ball in the circle, and mean height
/// difference in millimetres with a free zero.
fn misses(frame: &GelFrame, [x0, y0, radius]: [f64; 3]) -> (f64, f64) {
    let (mut angles, mut heights) = (Vec::new(), Vec::new());
    for ((r, c), depth) in frame.depth_m.indexed_iter() {
        let [x, y] = [c as f64 - x0, r as f64 - y0];
        if x.hypot(y) >= radius {
            continue;
        }
        let up = (BALL_PX * BALL_PX - x * x - y * y).sqrt();
        let truth = [-x / up, -y / up];
        let found = [0, 1].map(|k: usize| f64::from(frame.gradient[k][[r, c]]));
        let length = |[p, q]: [f64; 2]| (1.0 + p * p + q * q).sqrt();
        let cosine =
            (1.0 + found[0] * truth[0] + found[1] * truth[1]) / (length(found) * length(truth));
        angles.push(cosine.min(1.0).acos().to_degrees());
        heights.push(1e3 * (depth - up * PIXEL_M));
    }
    let zero = heights.iter().sum::<f64>() / heights.len() as f64;
    let height = heights.iter().map(|z| (z - zero).abs()).sum::<f64>() / heights.len() as f64;
    (median(angles), height)
}

/// Normals and heights of presses that were not used for the calibration: each half is tested with
/// the other.
#[test]
fn presses_held_back_have_their_ball() {
    let (Some(reference), Some(table)) = (
        image("gelsight/reference.png"),
        data("gelsight/circles.csv"),
    ) else {
        return;
    };
    let table = std::fs::read_to_string(table).unwrap();
    let presses = table.lines().skip(1).map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        let circle = [1, 2, 3].map(|k| cells[k].parse::<f64>().unwrap());
        let frame = image(&format!("gelsight/gelsight/{}", cells[0])).unwrap();
        (frame, circle)
    });
    let presses: Vec<_> = presses.collect();
    let (mut angles, mut heights) = (Vec::new(), Vec::new());
    for half in [0, 1] {
        let of = |k: usize| presses.iter().skip(k).step_by(2);
        let given = of(half).map(|(frame, circle)| BallPress {
            frame: frame.into(),
            ball_radius_m: BALL_PX * PIXEL_M,
            circle_px: Some(*circle),
        });
        let given: Vec<_> = given.collect();
        let sensor = GelSensor::calibrate(&reference, PIXEL_M, &given).unwrap().0;
        for (frame, circle) in of(1 - half) {
            let (angle, height) = misses(&sensor.read(frame.view()).unwrap(), *circle);
            println!("{circle:?}: {angle:.2}°, {height:.4} mm");
            angles.push(angle);
            heights.push(height);
        }
    }
    let height = heights.iter().sum::<f64>() / heights.len() as f64;
    let angle = median(angles);
    println!("median {angle:.2}°, mean height {height:.4} mm");
    // The circles were drawn by hand: perfect balls around the centres of the contacts would have
    // differences of 0.07 mm and 3.3 degrees.
    assert!(angle < 5.1, "{angle}");
    assert!(height < 0.092, "{height}");
}
