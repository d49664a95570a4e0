//! Real presses of a ball of known radius; skipped where the data are not there.
#![allow(clippy::print_stdout)]

use ndarray::Array3;
use tactile_gel::{BallPress, GelSensor};
use test_support::published as data;

fn image(name: &str) -> Option<Array3<u8>> {
    let image = image::open(data(name)?).unwrap().into_rgb8();
    let shape = (image.height() as usize, image.width() as usize, 3);
    Array3::from_shape_vec(shape, image.into_raw()).ok()
}

const PIXEL_M: f64 = 1e-3 / 19.58;
const BALL_M: f64 = 2.35e-3;

/// Normals and heights of presses that the sensor was not calibrated with.
#[test]
fn presses_left_out_have_their_ball() {
    let (Some(reference), Some(table)) = (
        image("gelsight/reference.png"),
        data("gelsight/circles.csv"),
    ) else {
        return;
    };
    let table = std::fs::read_to_string(table).unwrap();
    let rows = table.lines().skip(1).map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        let circle = [1, 2, 3].map(|k| cells[k].parse::<f64>().unwrap());
        (
            image(&format!("gelsight/gelsight/{}", cells[0])).unwrap(),
            circle,
        )
    });
    let rows: Vec<_> = rows.collect();
    let presses: Vec<_> = rows
        .iter()
        .map(|(frame, circle)| BallPress {
            frame: frame.view(),
            ball_radius_m: BALL_M,
            circle_px: Some(*circle),
        })
        .collect();
    let all = GelSensor::calibrate(reference.view(), PIXEL_M, &presses)
        .unwrap()
        .1;
    println!(
        "{:.2}° {:?} {:?}",
        all.median_angle_deg, all.offset_px, all.face
    );
    let (mut angles, mut heights, mut radii) = (Vec::new(), Vec::new(), Vec::new());
    let drawn = std::env::var("UNDRAWN").is_err();
    let step = if std::env::var("ALL").is_ok() { 1 } else { 4 };
    for left in (0..rows.len()).step_by(step) {
        let others: Vec<_> = (0..rows.len())
            .filter(|k| *k != left)
            .map(|k| BallPress {
                circle_px: presses[k].circle_px.filter(|_| drawn),
                ..presses[k]
            })
            .collect();
        let (sensor, report) = GelSensor::calibrate(reference.view(), PIXEL_M, &others).unwrap();
        let frame = sensor.read(rows[left].0.view()).unwrap();
        let [x0, y0, radius] = rows[left].1;
        let ball = BALL_M / PIXEL_M;
        let (mut miss, mut products, mut z) = (Vec::new(), [0.0; 2], Vec::new());
        for ((r, c), depth) in frame.depth_m.indexed_iter() {
            let [x, y] = [c as f64 - x0, r as f64 - y0];
            let distance = x.hypot(y);
            if distance >= radius.min(0.999 * ball) {
                continue;
            }
            let up = (ball * ball - distance * distance).sqrt();
            let truth = [-x / up, -y / up];
            let found = [0, 1].map(|k: usize| f64::from(frame.gradient[k][[r, c]]));
            let length = |[p, q]: [f64; 2]| (1.0 + p * p + q * q).sqrt();
            let cosine =
                (1.0 + found[0] * truth[0] + found[1] * truth[1]) / (length(found) * length(truth));
            miss.push(cosine.min(1.0).acos().to_degrees());
            let normals = [x / ball, y / ball];
            let seen = found.map(|p| -p / length(found));
            products[0] += normals[0] * seen[0] + normals[1] * seen[1];
            products[1] += normals[0] * normals[0] + normals[1] * normals[1];
            z.push((depth * 1e3, up * PIXEL_M * 1e3));
        }
        let zero = z.iter().map(|(a, b)| a - b).sum::<f64>() / z.len() as f64;
        let height = z.iter().map(|(a, b)| (a - b - zero).abs()).sum::<f64>() / z.len() as f64;
        miss.sort_by(f64::total_cmp);
        angles.push(miss[miss.len() / 2]);
        radii.push(products[1] / products[0]);
        if radius < ball {
            heights.push(height);
        }
        println!(
            "{left}: {:.2}° height {height:.4} radius {:.3} found {:.1?} contacts {} doubts {:?} {} {:.3}",
            angles[angles.len() - 1],
            radii[radii.len() - 1],
            frame.contacts.first().map(|c| (
                c.centroid_px[0].value - x0,
                c.centroid_px[1].value - y0,
                (c.area_m2.value / std::f64::consts::PI).sqrt() / PIXEL_M - radius
            )),
            frame.contacts.len(),
            frame.doubts,
            report.doubts.len(),
            sensor.model().slope_standard_error,
        );
    }
    angles.sort_by(f64::total_cmp);
    let height = heights.iter().sum::<f64>() / heights.len() as f64;
    println!(
        "median {:.2}°, heights {height:.4} mm of {}",
        angles[angles.len() / 2],
        heights.len()
    );
    // A contact of a ball that is pressed in up to near its equator: its drawn circles are off by
    // some pixels, of which each is a degree.
    assert!(all.median_angle_deg < 5.0);
    assert!(height < 0.13);
}
