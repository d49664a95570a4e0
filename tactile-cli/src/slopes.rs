//! Slopes from two files or a normal map, with a test that they belong to one surface.
use crate::arguments::same_shape;
use crate::console::Context;
use crate::failure::Failure;
use ndarray::{Array2, Array3};
use serde_json::json;
use std::path::Path;
use tactile_files::io::{read_grid, read_normal_map};

/// Number of blocks along the shorter side whose mean slopes are compared. It is small enough to
/// average noise, and large enough to resolve a bump of a tenth of the side.
const BLOCKS: usize = 32;

/// Slopes in another order or with another sign are taken as right if they reduce the closure error
/// below this share. Noise alone does not reduce it.
const CLEARLY_LESS: f64 = 0.5;

/// Smallest z component of a unit normal. No visible surface is steeper.
const FLATTEST: f64 = 0.02;

/// Slopes along x and y.
pub(crate) type Slopes = [Array2<f64>; 2];

/// Reads slopes and gives a caution if they cannot be integrated but would be in another order or
/// with another sign.
pub(crate) fn read(
    path: &Path,
    q: Option<&Path>,
    pixel: [f64; 2],
    context: &mut Context,
) -> Result<Slopes, Failure> {
    let Some(q_path) = q else {
        return normal_map(path, pixel, context);
    };
    let slopes = [read_grid(path)?, read_grid(q_path)?];
    same_shape((q_path, slopes[1].dim()), (path, slopes[0].dim()))?;
    let [p, q] = &slopes;
    let closure = |p: &Array2<f64>, q: &Array2<f64>| closure(p, q, pixel);
    let given = closure(p, q);
    let others = [
        (
            "with the sign of Q changed (is y up in them?)",
            closure(p, &-q),
        ),
        ("with P and Q exchanged", closure(q, p)),
        (
            "with P and Q exchanged and the sign of one changed",
            closure(q, &-p),
        ),
    ];
    let best = others.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((how, least)) = best.filter(|(_, least)| *least < CLEARLY_LESS * given) {
        context.warn(
            "slopes_of_no_surface",
            json!({ "closure": given, "closure_otherwise": least }),
            format_args!("the slopes do not belong to a surface, but nearly do {how}"),
        );
    }
    Ok(slopes)
}

/// Slopes from normals n: −n_x/n_z and −n_y/n_z, or n_y/n_z if y points up, because rows are
/// counted downwards.
fn normal_map(path: &Path, pixel: [f64; 2], context: &mut Context) -> Result<Slopes, Failure> {
    let normals = read_normal_map(path)?;
    let slope = |normals: &Array3<f64>, axis: usize| {
        let (rows, columns, _) = normals.dim();
        Array2::from_shape_fn((rows, columns), |(row, column)| {
            let [x, y, z] = [0, 1, 2].map(|k| normals[[row, column, k]]);
            let length = (x * x + y * y + z * z).sqrt();
            // Black, grey and white are not normals.
            let is_normal = (0.5..1.5).contains(&length) && z > FLATTEST * length;
            if is_normal {
                -normals[[row, column, axis]] / z
            } else {
                f64::NAN
            }
        })
    };
    let [p, down] = [0, 1].map(|axis| slope(&normals, axis));
    let up = -&down;
    let [closure_down, closure_up] = [&down, &up].map(|q| closure(&p, q, pixel));
    let (q, direction) = match closure_down < CLEARLY_LESS * closure_up {
        true => (down, "down"),
        false => (up, "up"),
    };
    let known = closure_up < CLEARLY_LESS * closure_down || direction == "down";
    let words = if known {
        "as the slopes fit"
    } else {
        "as is usual"
    };
    context.warn(
        "normal_map",
        json!({ "y": direction }),
        format_args!(
            "{}: a normal map, with y assumed to point {direction}, {words}",
            path.display()
        ),
    );
    Ok([p, q])
}

/// Root mean square of the height difference along a closed path around a square of blocks. It is
/// zero on a surface.
fn closure(p: &Array2<f64>, q: &Array2<f64>, [width, height]: [f64; 2]) -> f64 {
    let side = (p.nrows().min(p.ncols()) / BLOCKS).max(1);
    let (rows, columns) = (p.nrows() / side, p.ncols() / side);
    let [p, q] = [p, q].map(|slopes| {
        let blocks = slopes.exact_chunks((side, side));
        let means = blocks
            .into_iter()
            .map(|block| block.mean().unwrap_or(f64::NAN));
        Array2::from_shape_vec((rows, columns), means.collect()).unwrap_or_default()
    });
    let squares = (1..rows).flat_map(|r| (1..columns).map(move |c| (r, c)));
    let gains = squares.map(|(r, c)| {
        let along = p[[r - 1, c - 1]] + p[[r - 1, c]] - p[[r, c - 1]] - p[[r, c]];
        let down = q[[r - 1, c]] + q[[r, c]] - q[[r - 1, c - 1]] - q[[r, c - 1]];
        0.5 * (width * along + height * down)
    });
    let gains: Vec<f64> = gains.filter(|gain| gain.is_finite()).collect();
    (gains.iter().map(|gain| gain * gain).sum::<f64>() / gains.len().max(1) as f64).sqrt()
}
