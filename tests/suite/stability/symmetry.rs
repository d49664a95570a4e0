//! The contact at other positions in the frame, mirrored and rotated.
use super::press::{Answer, Images, SI, answer, pipeline, relative};
use super::table::{EXACT, STRAIN, Table};
use nalgebra::Matrix3;
use ndarray::{Array2, Axis};
use tactile_simulate::Trial;

/// The threshold of the contact allows for false alarms among the pixels of the surrounding tiles,
/// and these tiles differ: a few faint pixels of the rim are included or not, about 10⁻⁶ of the
/// light. The tolerances are for force, radius (of a fit that hardly depends on the rim) and
/// centroid in pixels (10⁻⁵ of the light, at a distance of at most a hundred pixels).
const RIM: [f64; 3] = [1e-5, 1e-6, 1e-3];

/// The image shifted by whole pixels with periodic continuation, so that all grey values are kept.
fn shifted(image: &Array2<u8>, [x, y]: [isize; 2]) -> Array2<u8> {
    let (rows, columns) = image.dim();
    let from = |i: usize, by: isize, n: usize| (i as isize - by).rem_euclid(n as isize) as usize;
    Array2::from_shape_fn((rows, columns), |(r, c)| {
        image[[from(r, y, rows), from(c, x, columns)]]
    })
}

pub(crate) fn shifts(table: &mut Table, trial: &Trial, expected: &Answer) {
    // The larger contact, with a radius of 91 pixels, does not reach the edge: a contact that is
    // cut by the edge is left out of the modulus.
    for by in [[1, 0], [0, 1], [-17, 9], [40, -25], [-50, -20]] {
        let moved = Images::of(trial).map(|image| shifted(image, by));
        let found = answer(&pipeline(trial, SI), &moved);
        let there = |c: [f64; 2]| [c[0] + by[0] as f64, c[1] + by[1] as f64];
        let there = (there, Matrix3::identity());
        compare(table, "moved by whole pixels", &found, expected, there, RIM);
    }
}

/// One of the seven ways to mirror and rotate a frame: first rows and columns are exchanged, then
/// columns and rows are reversed.
#[derive(Clone, Copy)]
struct Turn {
    transposed: bool,
    reversed: [bool; 2],
}

impl Turn {
    fn image(self, image: &Array2<u8>) -> Array2<u8> {
        let mut view = if self.transposed {
            image.t()
        } else {
            image.view()
        };
        for (k, axis) in [Axis(1), Axis(0)].into_iter().enumerate() {
            if self.reversed[k] {
                view.invert_axis(axis);
            }
        }
        view.as_standard_layout().into_owned()
    }

    /// New position of (x, y) in a frame of this many columns and rows.
    fn point(self, [x, y]: [f64; 2], [columns, rows]: [f64; 2]) -> [f64; 2] {
        let (p, n) = if self.transposed {
            ([y, x], [rows, columns])
        } else {
            ([x, y], [columns, rows])
        };
        std::array::from_fn(|k| {
            if self.reversed[k] {
                n[k] - 1.0 - p[k]
            } else {
                p[k]
            }
        })
    }

    /// The rotation of directions.
    fn rotation(self) -> Matrix3<f64> {
        let sign = |k: usize| if k < 2 && self.reversed[k] { -1.0 } else { 1.0 };
        let from = |k: usize| if k < 2 && self.transposed { 1 - k } else { k };
        Matrix3::from_fn(|i, j| if from(i) == j { sign(i) } else { 0.0 })
    }
}

pub(crate) fn turns(table: &mut Table, trial: &Trial, expected: &Answer) {
    let (rows, columns) = trial.simulation.reference.dim();
    for k in 1..8 {
        let turn = Turn {
            transposed: k & 4 != 0,
            reversed: [k & 1 != 0, k & 2 != 0],
        };
        let turned = Images::of(trial).map(|image| turn.image(image));
        let found = answer(&pipeline(trial, SI), &turned);
        let there = |c| turn.point(c, [columns as f64, rows as f64]);
        let there = (there, turn.rotation());
        let case = if turn.transposed {
            "turned"
        } else {
            "mirrored"
        };
        compare(table, case, &found, expected, there, [EXACT, EXACT, 1e-10]);
    }
}

/// The strain agrees within the tolerance of the matcher: points are placed from the first row on,
/// and differ if the contact has another orientation in the frame.
fn compare(
    table: &mut Table,
    case: &str,
    found: &Answer,
    expected: &Answer,
    (there, rotation): (impl Fn([f64; 2]) -> [f64; 2], Matrix3<f64>),
    [of_force, of_radius, of_pixel]: [f64; 3],
) {
    let centroids = found.centroid_px.iter().zip(&expected.centroid_px);
    let centroid = centroids.map(|(f, e)| {
        let e = there(*e);
        (f[0] - e[0]).hypot(f[1] - e[1])
    });
    let strain = rotation * expected.strain * rotation.transpose();
    let gap = (found.strain - strain).abs();
    let across = gap[(0, 0)].max(gap[(1, 1)]).max(gap[(0, 1)]);
    let up = gap[(2, 2)].max(gap[(0, 2)]).max(gap[(1, 2)]);
    let mut enter = |what: &str, error, tolerance| {
        table.enter(&format!("{case}: {what}"), error, tolerance);
    };
    let modulus = relative(&found.modulus_pa[..1], &expected.modulus_pa[..1], 1.0);
    enter(
        "force",
        relative(&found.force_n, &expected.force_n, 1.0),
        of_force,
    );
    enter(
        "radius",
        relative(&found.radius_m, &expected.radius_m, 1.0),
        of_radius,
    );
    enter("centroid in pixels", centroid.fold(0.0, f64::max), of_pixel);
    enter("modulus", modulus, 3.0 * of_force.max(of_radius));
    enter("strain e_xx, e_yy, e_xy", across, STRAIN[0]);
    enter("strain e_zz, e_xz, e_yz", up, STRAIN[2]);
}
