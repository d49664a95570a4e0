//! Comparison with measured data and with the surfaces of the shape-from-shading survey. Skipped if
//! the data are absent.
#![allow(clippy::print_stdout)]

use crate::common::{Alignment, errors, from_rim, height_error};
use ndarray::Array2;
use tactile_sfs::*;
use test_support::published as data;

/// Channel means of an image: the grey values of the published table's calibration.
fn channel_mean(name: &str) -> Option<Array2<f64>> {
    let image = image::open(data(name)?).unwrap().into_rgb8();
    let shape = (image.height() as usize, image.width() as usize);
    Some(Array2::from_shape_fn(shape, |(r, c)| {
        let levels = image.get_pixel(c as u32, r as u32).0;
        levels.map(f64::from).iter().sum::<f64>() / 3.0
    }))
}

/// The survey's vase at 128 pixels: heights in pixels, slopes and mask.
fn vase() -> (Array2<f64>, [Array2<f64>; 2], Array2<bool>) {
    let f = |y: f64| 0.15 - 0.1 * y * (6.0 * y + 1.0).powi(2) * (y - 1.0).powi(2) * (3.0 * y - 2.0);
    let slope = |y: f64| (f(y + 1e-6) - f(y - 1e-6)) / 2e-6;
    // z² = f(y)² − x²; p = −x/z and q = f f′/z.
    let field = |of: &dyn Fn(f64, f64, f64) -> f64| {
        Array2::from_shape_fn((128, 128), |(r, c)| {
            let (x, y) = (c as f64 / 128.0 - 0.5075, r as f64 / 128.0);
            let square = f(y).powi(2) - x * x;
            if square > 0.0 {
                of(x, y, square.sqrt())
            } else {
                0.0
            }
        })
    };
    let z = field(&|_, _, z| 128.0 * z);
    let mask = z.mapv(|z| z > 0.0);
    (
        z,
        [
            field(&|x, _, z| -x / z),
            field(&|_, y, z| f(y) * slope(y) / z),
        ],
        mask,
    )
}

#[test]
fn survey_vase_from_its_rim() {
    let (z, [p, q], mask) = vase();
    let light = Lighting::default().with_normal_intensity(255.0).unwrap();
    let image = Array2::from_shape_fn(z.dim(), |at| {
        if mask[at] {
            light.shade(p[at], q[at]).round() as u8
        } else {
            0
        }
    });
    let domain = Domain::default().with_mask(mask.view());
    let surface = from_rim(light).reconstruct(Image::new(image.view(), domain));
    let heights = surface.unwrap().heights;
    let error = height_error(heights.view(), z.view(), Alignment::None);
    println!("vase, 8 bits, rim at 0: {error:?}");
    assert!((error.range - 36.2).abs() < 0.1 && error.constant_guess > 7.0);
    assert!(error.mean_absolute < 0.6);
}

#[test]
fn light_from_the_right_is_bright_on_the_right() {
    let Some(path) = data("sfs/vase_light101_128.pgm") else {
        return;
    };
    let image = image::open(path).unwrap().into_luma8();
    // At half the height of the vase, both flanks are in the frame. The direction of the light is
    // (1, 0, 1).
    let row: Vec<u8> = (0..128).map(|c| image.get_pixel(c, 64).0[0]).collect();
    let light = Lighting::new([1.0, 0.0, 1.0])
        .unwrap()
        .with_normal_intensity(255.0)
        .unwrap();
    assert!(row[88] > row[40] && light.shade(-0.5, 0.0) > light.shade(0.5, 0.0));
}

/// Pixel size of the rectified images of 9DTact, in metres.
const PIXEL: f64 = 0.051_015_1e-3;
/// Centre in pixels and radius in metres of the contact circle, and the radius of the ball.
const CENTRE: [f64; 2] = [243.9, 188.5];
const CONTACT: f64 = 67.6 * PIXEL;
const BALL: f64 = 4e-3;

/// A ball pressed into the gel of 9DTact, and its cap.
struct PressedBall {
    /// Darkening relative to the reference.
    signal: Array2<f64>,
    inside: Array2<bool>,
    cap: Array2<f64>,
}

impl PressedBall {
    fn read() -> Option<Self> {
        let reference = channel_mean("9dtact/rectify_crop_ref.png")?;
        let pressed = channel_mean("9dtact/rectify_crop_sample.png")?;
        let r = |(row, column): (usize, usize)| {
            (column as f64 - CENTRE[0]).hypot(row as f64 - CENTRE[1]) * PIXEL
        };
        let inside = Array2::from_shape_fn(pressed.dim(), |at| r(at) < CONTACT);
        let rim = (BALL * BALL - CONTACT * CONTACT).sqrt();
        let cap = Array2::from_shape_fn(pressed.dim(), |at| {
            (BALL * BALL - r(at) * r(at)).max(0.0).sqrt() - rim
        });
        Some(Self {
            signal: reference - pressed,
            inside,
            cap,
        })
    }

    /// Mean absolute error of a table's surface within a mask, in metres.
    fn error(&self, table: &DepthTable<f64>, mask: &Array2<bool>) -> f64 {
        let domain = Domain::new([PIXEL, PIXEL]).unwrap().with_mask(mask.view());
        let surface = table.reconstruct(Image::new(self.signal.view(), domain));
        errors(&surface.unwrap(), &self.cap, Alignment::None).mean_absolute
    }
}

/// The published table of 9DTact.
fn makers_table() -> Option<DepthTable<f64>> {
    let text = std::fs::read_to_string(data("9dtact/grey_to_depth_mm.csv")?).unwrap();
    let row = |line: &str| {
        line.split_once(',')
            .map(|(s, d)| (s.parse().unwrap(), 1e-3 * d.parse::<f64>().unwrap()))
    };
    let mut entries: Vec<(f64, f64)> = text.lines().skip(1).filter_map(row).collect();
    entries[0].1 = 0.0;
    Some(DepthTable::new(&entries).unwrap())
}

#[test]
fn ball_of_9dtact_by_the_makers_table() {
    let (Some(ball), Some(makers)) = (PressedBall::read(), makers_table()) else {
        return;
    };
    // The published table was measured on this image, with a circle whose radius and centre were
    // rounded down to pixels.
    let zeroed = makers
        .with_contact_threshold(3.0)
        .and_then(DepthTable::zeroed)
        .unwrap();
    let error = ball.error(&zeroed, &ball.inside);
    // The published value. Noise alone is 0.030 mm.
    assert!(error < 0.0462e-3, "{error}");
}

/// Mean errors of the heights of Tsai–Shah, after an offset and after scale and offset, under the
/// three lights of the survey.
fn tsai_shah_errors(
    name: &str,
    z: &Array2<f64>,
    [p, q]: &[Array2<f64>; 2],
    mask: &Array2<bool>,
) -> [[f64; 2]; 3] {
    [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [5.0, 5.0, 7.0]].map(|light| {
        let lighting = Lighting::new(light).unwrap();
        let image = Array2::from_shape_fn(z.dim(), |at| lighting.shade(p[at], q[at]));
        let domain = Domain::default().with_mask(mask.view());
        let surface = TsaiShah::new(lighting)
            .reconstruct(Image::new(image.view(), domain))
            .unwrap();
        let heights = surface.heights.view();
        let error = |alignment| height_error(heights, z.view(), alignment);
        let (offset, affine) = (error(Alignment::Offset), error(Alignment::Affine));
        let errors = [offset.mean_absolute, affine.mean_absolute];
        let [a, b] = errors;
        println!(
            "tsai-shah, {name}, {light:?}: {a:.2} px, scaled by {:.2} {b:.2} px",
            affine.scale
        );
        // A negative scale, which inverts the surface, would be no agreement.
        assert!(affine.scale > 0.0 && a < offset.constant_guess);
        errors
    })
}

/// Heights and slopes of Mozart's bust at full size, and at half size by means of 2 × 2 pixels.
fn mozart(half: bool) -> Option<(Array2<f64>, [Array2<f64>; 2])> {
    let text = std::fs::read_to_string(data("sfs/mozart_256_depth.csv")?).unwrap();
    let values: Vec<f64> = text
        .lines()
        .flat_map(|line| line.split(',').map(|v| v.trim().parse::<f64>().unwrap()))
        .collect();
    let mut z = Array2::from_shape_vec((256, 256), values).unwrap();
    if half {
        let block = |r: usize, c: usize| z.slice(ndarray::s![2 * r..2 * r + 2, 2 * c..2 * c + 2]);
        // Half as many pixels per unit: heights in pixels are halved as well.
        z = Array2::from_shape_fn((128, 128), |(r, c)| block(r, c).sum() / 8.0);
    }
    let (p, q) = slopes(z.view(), [1.0, 1.0]);
    Some((z, [p, q]))
}

#[test]
fn tsai_shah_is_no_worse_than_the_plain_method() {
    let (z, slopes, mask) = vase();
    let errors = tsai_shah_errors("vase", &z, &slopes, &mask);
    // The unmodified method has errors of 5.3 to 7.3 px with scale and offset fitted, for several
    // lights and settings, and of 7.4 px or more with the offset alone (7.4 for a constant).
    assert!(
        errors
            .iter()
            .all(|&[offset, affine]| offset < 7.3 && affine < 5.3),
        "{errors:?}"
    );
    let Some((z, slopes)) = mozart(false) else {
        return;
    };
    let errors = tsai_shah_errors("mozart", &z, &slopes, &z.mapv(|z| z > 0.0));
    // The best result of the unmodified method for several lights and settings is 10.8 px. A
    // constant has 11.65.
    assert!(
        errors.iter().flatten().all(|&error| error < 10.8),
        "{errors:?}"
    );
}

/// Height 0 outside the object, and the height at points that face the light, at which z + (s_x x +
/// s_y y)/s_z has a maximum, a minimum or a saddle.
fn singular_heights(z: &Array2<f64>, mask: &Array2<bool>, light: [f64; 3]) -> Array2<f64> {
    const RING: [[usize; 2]; 8] = [
        [0, 0],
        [0, 1],
        [0, 2],
        [1, 2],
        [2, 2],
        [2, 1],
        [2, 0],
        [1, 0],
    ];
    let tilted = Array2::from_shape_fn(z.dim(), |(r, c)| {
        z[[r, c]] + (light[0] * c as f64 + light[1] * r as f64) / light[2]
    });
    Array2::from_shape_fn(z.dim(), |(r, c)| {
        if !mask[[r, c]] {
            return 0.0;
        }
        let ring = RING.map(|[dr, dc]| [(r + dr).wrapping_sub(1), (c + dc).wrapping_sub(1)]);
        if !ring.iter().all(|at| mask.get(*at) == Some(&true)) {
            return f64::NAN;
        }
        let above = ring.map(|at| tilted[at] > tilted[[r, c]]);
        let changes = (0..8).filter(|&i| above[i] != above[(i + 1) % 8]).count();
        if changes == 0 || changes >= 4 {
            z[[r, c]]
        } else {
            f64::NAN
        }
    })
}

/// Prints the errors in the README of the methods for oblique light.
#[test]
fn surfaces_from_the_heights_of_their_singular_points() {
    let (z, slopes, mask) = vase();
    let bust = mozart(true).map(|(z, slopes)| ("bust", z.mapv(|z| z > 0.0), z, slopes));
    for (name, mask, z, [p, q]) in [Some(("vase", mask, z, slopes)), bust].iter().flatten() {
        for light in [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [5.0, 5.0, 7.0]] {
            let lighting = Lighting::new(light).unwrap();
            let image = Array2::from_shape_fn(z.dim(), |at| lighting.shade(p[at], q[at]));
            let known = singular_heights(z, mask, light);
            let masked = Domain::default().with_mask(mask.view());
            let error =
                |method: &dyn SurfaceReconstruction<f64>, domain: &Domain<'_, f64>, alignment| {
                    let surface = method
                        .reconstruct(Image::new(image.view(), *domain))
                        .unwrap();
                    errors(&surface, z, alignment).mean_absolute
                };
            let informed = masked.with_known_heights(known.view());
            let eikonal = error(&Eikonal::new(lighting), &informed, Alignment::None);
            println!("{name}, {light:?}: eikonal {eikonal:.2} px");
            // Under frontal light. A constant has 7.4 px on the vase and more on the bust.
            assert!(light[0] > 0.0 || eikonal < 1.15, "{name}: {eikonal}");
        }
    }
}
