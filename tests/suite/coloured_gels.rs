//! Sensors that are lit in colours, on simulated frames whose depth is known at every pixel.
use ndarray::{Array2, Array3};
use tactile_imaging::elasticity::contact::{Bond, Layer, LayerEquation, LayerPlane, Waveguide};
use tactile_imaging::gel::{BallPress, CalibrationReport, GelSensor};
use tactile_simulate::{ColourGel, GelObject};

const PIXEL_M: f64 = 5e-5;
const BALL_PX: f64 = 30.0;

/// Contact circles of nine presses all over the frame.
fn circles() -> Vec<[f64; 3]> {
    let circle = |k: usize| {
        let (x, y) = (40.0 + 40.0 * (k % 3) as f64, 36.0 + 24.0 * (k / 3) as f64);
        [x, y, [16.0, 20.0, 24.0][(k + k / 3) % 3]]
    };
    (0..9).map(circle).collect()
}

fn ball([x, y, contact_px]: [f64; 3]) -> (Array2<f64>, Array3<u8>) {
    // Exposure changes from frame to frame.
    let gel = ColourGel {
        gain: 1.0 + 0.01 * (x % 3.0),
        ..ColourGel::default()
    };
    let object = GelObject::Ball {
        radius_px: BALL_PX,
        contact_px,
    };
    let depth = gel.depth_px(&object, [x, y]);
    let frame = gel.frame(&depth, x as u64);
    (depth, frame)
}

fn reference() -> Array3<u8> {
    let gel = ColourGel::default();
    gel.frame(&Array2::zeros((gel.shape[0], gel.shape[1])), 0)
}

fn calibrated(
    drawn: impl Fn(usize, [f64; 3]) -> Option<[f64; 3]>,
) -> (GelSensor, CalibrationReport) {
    let frames: Vec<_> = circles().into_iter().map(|circle| ball(circle).1).collect();
    let presses = circles().into_iter().zip(&frames).enumerate();
    let presses: Vec<_> = presses
        .map(|(k, (circle, frame))| BallPress {
            frame: frame.view(),
            ball_radius_m: BALL_PX * PIXEL_M,
            circle_px: drawn(k, circle),
        })
        .collect();
    GelSensor::calibrate(reference().view(), PIXEL_M, &presses).unwrap()
}

/// Without drawn circles the presses are found, and a press that was not among them has the depth
/// and the normals of its ball.
#[test]
fn a_press_has_its_depth_without_drawn_circles() {
    let (sensor, found) = calibrated(|_, _| None);
    for (circle, truth) in found.circles.iter().zip(circles()) {
        let seen = circle.found_px.expect("a contact");
        // The mask is that of pairs of pixels, the blur of the frames has a deviation of one.
        for k in 0..3 {
            assert!((seen[k] - truth[k]).abs() < 1.5, "{seen:?} {truth:?}");
        }
    }
    let circle = [70.0, 66.0, 22.0];
    let (truth, frame) = ball(circle);
    let reading = sensor.read(frame.view()).unwrap();
    let (mut depth, mut inside, mut held) = (0.0, 0.0, 0.0);
    for ((row, column), z) in reading.depth_m.indexed_iter() {
        let distance = (column as f64 - circle[0]).hypot(row as f64 - circle[1]);
        if distance < circle[2] {
            inside += 1.0;
            depth += (z / PIXEL_M - truth[[row, column]]).abs();
            let up = (BALL_PX * BALL_PX - distance * distance).sqrt();
            let slope = (circle[0] - column as f64) / up;
            let miss = f64::from(reading.gradient[0][[row, column]]) - slope;
            let error = f64::from(reading.gradient_error[0][[row, column]]);
            held += f64::from(u8::from(miss.abs() < error));
        } else if distance > circle[2] + 6.0 {
            assert_eq!(*z, 0.0, "({row}, {column})");
        }
    }
    // A tenth of the depth of 9.6 px.
    assert!(depth / inside < 1.0, "{}", depth / inside);
    // 68 % for all presses together, of which this is one.
    assert!((0.5..0.9).contains(&(held / inside)), "{}", held / inside);
}

/// A circle that is drawn wrong is named, and the answer hardly changes.
#[test]
fn a_wrong_circle_is_named() {
    let (_, right) = calibrated(|_, circle| Some(circle));
    assert!(right.circles.iter().all(|circle| !circle.wrong));
    let moved = |k: usize, [x, y, r]: [f64; 3]| Some([if k == 4 { x + 9.0 } else { x }, y, r]);
    let (_, found) = calibrated(moved);
    let wrong: Vec<_> = (0..9).filter(|&k| found.circles[k].wrong).collect();
    assert_eq!(wrong, [4]);
    // Both are fitted with the circles that are found.
    assert!((found.median_angle_deg - right.median_angle_deg).abs() < 1.0);
}

/// Noise is no contact, and a flat punch touches where it stands.
#[test]
fn contacts_of_other_shapes() {
    let sensor = calibrated(|_, _| None).0;
    let gel = ColourGel::default();
    let none = Array2::zeros((gel.shape[0], gel.shape[1]));
    let reading = sensor.read(gel.frame(&none, 7).view()).unwrap();
    assert!(reading.contact.iter().all(|touched| !touched));
    let punch = GelObject::Flat {
        contact_px: 24.0,
        depth_px: 6.0,
        edge_px: 8.0,
    };
    let depth = gel.depth_px(&punch, [80.0, 60.0]);
    let reading = sensor.read(gel.frame(&depth, 8).view()).unwrap();
    // The blur rounds the rim of the punch by some pixels.
    let touched = reading.contact.iter().filter(|touched| **touched).count() as f64;
    let area = core::f64::consts::PI * 24.0_f64.powi(2);
    assert!((0.6..1.3).contains(&(touched / area)), "{touched} {area}");
    assert!((reading.depth_m[[60, 80]] / PIXEL_M - 6.0).abs() < 1.5);
}

/// The force of a ball on a layer, against the integral equation of axisymmetric contact.
#[test]
fn a_ball_has_the_force_of_the_integral_equation() {
    let layer = Layer {
        thickness_m: 4e-3,
        youngs_modulus_pa: 1e5,
        poisson_ratio: 0.48,
    };
    let guide = Waveguide::new(vec![layer]).unwrap();
    let cell = 1e-4;
    let plane = LayerPlane::new(&guide, Bond::Bonded, [50, 54], cell).unwrap();
    let reduced = 1e5 / (1.0 - 0.48_f64.powi(2));
    for radius in [1.2e-3, 2e-3] {
        let ball = 20e-3;
        let truth = LayerEquation::of_layers(&guide, Bond::Bonded).unwrap();
        let truth = truth.solve(radius / 4e-3).unwrap();
        let depth = truth.indentation_ratio * radius * radius / ball;
        let force = truth.force_ratio_same_radius * 4.0 * reduced * radius.powi(3) / (3.0 * ball);
        let square = |at: usize| {
            let [x, y] = [(at % 54) as f64 - 26.3, (at / 54) as f64 - 24.6];
            (x * x + y * y) * cell * cell
        };
        let moved = (0..50 * 54).map(|at| depth - square(at) / (2.0 * ball));
        let moved: Vec<f64> = moved.collect();
        let contact = (0..50 * 54).map(|at| square(at) < radius * radius);
        let contact: Vec<bool> = contact.collect();
        let found = plane.force(&moved, &contact, 1e-6).unwrap();
        // Cells of a twelfth of the radius and less.
        let miss = (found.value / force - 1.0).abs();
        assert!(miss < 0.03, "{found:?} {force}");
        let pressure = plane.pressure(&moved, &contact).unwrap();
        let sum = pressure.iter().sum::<f64>() * cell * cell;
        assert!((sum / found.value - 1.0).abs() < 2e-3, "{sum} {found:?}");
        // A depth that is off by its error moves the force by its error.
        let deeper: Vec<f64> = moved.iter().map(|u| u + 1e-6).collect();
        let more = plane.force(&deeper, &contact, 0.0).unwrap().value - found.value;
        assert!((more / found.standard_error - 1.0).abs() < 1e-6);
    }
    assert!(plane.force(&[0.0; 3], &[true; 3], 0.0).is_err());
    assert!(plane.pressure(&[f64::NAN; 2700], &[true; 2700]).is_err());
}
