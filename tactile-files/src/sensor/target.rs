//! Finds the dots of a target and their places on the grid.
use super::findings::SensorError;
use ndarray::ArrayView2;
use tactile_imaging::core::{otsu, regions};
use tactile_imaging::force::DotPair;

/// Enough to fit six parameters of the lens and judge the residual.
const FEWEST_DOTS: usize = 20;

/// Finds the dots of a target, dark on bright or bright on dark, and assigns them to places on a
/// square grid.
///
/// The frame is split at Otsu's threshold. Dots are the connected regions of the rarer level that
/// do not touch the edge, and their centres are weighted with the level. The grid is followed from
/// dot to dot, starting at the centre. Each place is predicted from its neighbours, so that
/// distortion does not matter. The cost is O(pixels).
///
/// # Errors
/// [`SensorError::Target`] if fewer than twenty dots lie on the grid.
pub(super) fn find_dots(
    frame: ArrayView2<'_, u8>,
    pitch_m: f64,
) -> Result<Vec<DotPair>, SensorError> {
    let dots = centres(frame);
    let placed = on_grid(&dots, frame.dim());
    if placed.len() < FEWEST_DOTS {
        return Err(SensorError::Target {
            found: placed.len(),
            expected: FEWEST_DOTS,
        });
    }
    let pair = |(dot, place): &(usize, [i32; 2])| DotPair {
        pixel: dots[*dot],
        target_m: place.map(|k| f64::from(k) * pitch_m),
    };
    Ok(placed.iter().map(pair).collect())
}

/// Centres (x, y) of connected regions of the rarer level.
fn centres(frame: ArrayView2<'_, u8>) -> Vec<[f64; 2]> {
    let mut histogram = [0.0; 256];
    frame.iter().for_each(|v| histogram[usize::from(*v)] += 1.0);
    let cut = otsu(&histogram, |level| level as f64).unwrap_or(0.0);
    let above = frame.iter().filter(|v| f64::from(**v) > cut).count();
    // Dots cover less than half of the frame, whether dark or bright.
    let sign = if 2 * above < frame.len() { 1.0 } else { -1.0 };
    let weights: Vec<f64> = frame.iter().map(|v| sign * (f64::from(*v) - cut)).collect();
    let (rows, columns) = frame.dim();
    let mut open: Vec<bool> = weights.iter().map(|weight| *weight > 0.0).collect();
    let centre = |region: Vec<usize>| {
        let mut sums = [0.0; 3];
        let mut inside = true;
        for &at in &region {
            let (r, c) = (at / columns, at % columns);
            let weight = weights[at];
            sums[0] += weight;
            sums[1] += weight * c as f64;
            sums[2] += weight * r as f64;
            inside &= r > 0 && c > 0 && r + 1 < rows && c + 1 < columns;
        }
        // Smaller regions are noise.
        let is_dot = inside && region.len() >= 9;
        is_dot.then(|| [sums[1] / sums[0], sums[2] / sums[0]])
    };
    regions(&mut open, columns).filter_map(centre).collect()
}

/// Dots with their places on the grid, followed from the dot nearest to the centre of the frame.
fn on_grid(dots: &[[f64; 2]], (rows, columns): (usize, usize)) -> Vec<(usize, [i32; 2])> {
    let middle = [0.5 * columns as f64, 0.5 * rows as f64];
    let Some(first) = nearest(dots, middle, f64::INFINITY) else {
        return Vec::new();
    };
    let Some(along) = first_step(dots, first) else {
        return Vec::new();
    };
    // The second axis is perpendicular, because grid and pixels are nearly square.
    let steps = [along, [-along[1], along[0]]];
    let mut placed = vec![(first, [0, 0], steps)];
    let mut taken = vec![false; dots.len()];
    taken[first] = true;
    let mut next = 0;
    while let Some(&(from, place, steps)) = placed.get(next) {
        next += 1;
        for (axis, sign) in [(0, 1), (0, -1), (1, 1), (1, -1)] {
            let step = steps[axis].map(|s| s * f64::from(sign));
            let expected = [dots[from][0] + step[0], dots[from][1] + step[1]];
            // Between neighbouring dots, distortion bends the grid by less than a quarter of the
            // pitch.
            let reach = 0.25 * step[0].hypot(step[1]);
            let Some(dot) = nearest(dots, expected, reach).filter(|dot| !taken[*dot]) else {
                continue;
            };
            taken[dot] = true;
            let mut there = place;
            there[axis] += sign;
            // The last step is a better guess for the next one.
            let mut guess = steps;
            guess[axis] = [
                f64::from(sign) * (dots[dot][0] - dots[from][0]),
                f64::from(sign) * (dots[dot][1] - dots[from][1]),
            ];
            placed.push((dot, there, guess));
        }
    }
    placed
        .into_iter()
        .map(|(dot, place, _)| (dot, place))
        .collect()
}

/// The step to the nearest neighbour of a dot.
fn first_step(dots: &[[f64; 2]], from: usize) -> Option<[f64; 2]> {
    let distance = |dot: &[f64; 2]| (dot[0] - dots[from][0]).hypot(dot[1] - dots[from][1]);
    let others = dots.iter().enumerate().filter(|(k, _)| *k != from);
    let (_, dot) = others.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))?;
    Some([dot[0] - dots[from][0], dot[1] - dots[from][1]])
}

fn nearest(dots: &[[f64; 2]], place: [f64; 2], within: f64) -> Option<usize> {
    let distance = |dot: &[f64; 2]| (dot[0] - place[0]).hypot(dot[1] - place[1]);
    let (k, dot) = dots
        .iter()
        .enumerate()
        .min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))?;
    (distance(dot) <= within).then_some(k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn dots_are_paired_with_their_places_on_the_grid() {
        // Dots of 6 px, 20 px apart, dark on bright.
        let near = |v: usize| {
            let past = (v as f64 - 10.0).rem_euclid(20.0);
            past.min(20.0 - past)
        };
        let target = Array2::from_shape_fn((200, 300), |(r, c)| {
            if near(r).hypot(near(c)) < 6.0 {
                40
            } else {
                200
            }
        });
        let dots = find_dots(target.view(), 1e-3).unwrap();
        assert_eq!(dots.len(), 10 * 15);
        let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        // The dots are symmetric: rounding alone moves their centres.
        assert!((apart(dots[0].pixel, dots[1].pixel) - 20.0).abs() < 1e-6);
        assert!((apart(dots[0].target_m, dots[1].target_m) - 1e-3).abs() < 1e-12);
    }
}
